"""Generated calls against the API as /openapi.json describes it: schemathesis makes them from valid and invalid
data, and checks that every answer is a described one (status, type, headers, schema, code), and none a 5xx.

    tests/contract.py [CALLS]        minimum number of calls, by default 2000

Two servers: the first keeps its jobs, so that names resolve; operations that delete or cancel many jobs, or pause
the queue, run against the second. The jobs whose events are requested have ended: schemathesis would wait for the
end of a stream that does not end (tests/service reads such streams).
"""

# Operations: GetOpenApi

import concurrent.futures
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

import openapi_spec_validator
import schemathesis

TOP = pathlib.Path(__file__).resolve().parents[1]
SIGNORINI = TOP / "target/release/signorini"
# of the Python environment that runs this script
SCHEMATHESIS = pathlib.Path(sys.executable).with_name("schemathesis")
# seconds after which a run that hangs is ended
PATIENCE = 240
# operations that delete or cancel many jobs, or pause the queue
DRASTIC = "^(DELETE |POST /v1/jobs/cancel|POST /v1/queue/)"
# a stream without an end, which schemathesis would read for ever; `stream_of_the_list` reads its beginning
ENDLESS = "^GET /v1/events$"
# A new seed each time: over many runs that finds more than the same calls every day.
SETTINGS = """
hooks = "contract"
continue-on-failure = true
request-timeout = 30
suppress-health-check = ["all"]
# more threads trigger a fault of CPython 3.11: "AST constructor recursion depth mismatch"
workers = 1
warnings = false

[generation]
max-examples = {examples}

[phases]
stateful.enabled = false

[checks]
# Data valid by the schema may still be refused: a boundary that does not exist, a body that is free to move.
positive_data_acceptance.enabled = false
# There is no authentication.
ignored_auth.enabled = false

[[operations]]
# The violations of a problem are its answer.
include-operation-id = "ValidateProblem"
checks.negative_data_rejection.enabled = false

[dictionaries]
{dictionaries}

[parameters]
{parameters}
"""


class Server:
    """A server of its own, with jobs of every terminal status."""

    def __init__(self, folder):
        self.process = subprocess.Popen(
            [SIGNORINI, "serve", "--listen", "127.0.0.1:0", "--data", folder / "data",
             # that the examples fit: what is sent may be wrong in other ways
             "--memory-budget-bytes", str(4 << 30)],
            stdout=subprocess.PIPE,
            stderr=open(folder / "log", "w"),
            text=True,
        )
        self.url = self.process.stdout.readline().strip()
        self.log = folder / "log"
        self.known = {"id": self.jobs(), "hash": [self.mesh()], "boundary": ["top"]}

    def ask(self, method, path, body=None, **headers):
        data = body if isinstance(body, (bytes, type(None))) else json.dumps(body).encode()
        headers.setdefault("Content-Type", "application/json")
        request = urllib.request.Request(self.url + path, data, headers, method=method)
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.load(answer)

    def jobs(self):
        """Succeeded, not converged, canceled."""
        problem = json.loads((TOP / "tests/data/thesis/rectangular_punch.json").read_text(encoding="utf-8"))
        hasty = dict(problem, solver={"max_iterations": 1})
        names = [
            self.ask("POST", "/v1/jobs", {"problem": problem, "name": "seed"}, Prefer="wait=60")["id"]
            for problem in (problem, hasty)
        ]
        self.ask("POST", "/v1/queue/pause")
        names.append(self.ask("POST", "/v1/jobs", {"problem": problem, "cache": "off"})["id"])
        self.ask("POST", f"/v1/jobs/{names[-1]}/cancel")
        self.ask("POST", "/v1/queue/resume")
        return names

    def mesh(self):
        mesh = (TOP / "tests/data/gmsh/sheet-tri6-msh41-binary.msh").read_bytes()
        return self.ask("POST", "/v1/meshes", mesh)["hash"]

    def end(self):
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(timeout=30)


@schemathesis.hook
def before_call(context, case, kwargs):
    """A job that has ended does not change: waiting for a change would take a minute in vain."""
    try:
        if case.operation.path == "/v1/jobs/{id}" and 0.05 < float(case.query["wait"]) <= 60:
            case.query["wait"] = 0.05
    except (KeyError, TypeError, ValueError):
        pass  # the request does not wait


def settings(known, examples):
    """Three names of four exist: with random ones alone, nearly every answer would be 404."""
    dictionaries = "".join(f"{name} = {{ values = {json.dumps(values)} }}\n" for name, values in known.items())
    bound = '"path.{0}" = {{ dictionary = "{0}", probability = 0.75 }}\n'
    return SETTINGS.format(
        examples=examples, dictionaries=dictionaries, parameters="".join(bound.format(name) for name in known)
    )


def stream_of_the_list(server):
    """The stream of a list begins as described, and a wrong request for it is refused."""
    def begin(query, **headers):
        request = urllib.request.Request(server.url + "/v1/events" + query, headers=headers)
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                return answer.status, answer.headers["Content-Type"], answer.readline()
        except urllib.error.HTTPError as error:
            return error.code, error.headers["Content-Type"], error.read()

    described = server.ask("GET", "/openapi.json")["paths"]["/v1/events"]["get"]["responses"]
    found = [begin(query, **headers) for query in ("", "?status=succeeded", "?label.study=none", "?fields=id,status")
             for headers in ({}, {"Accept": "application/x-ndjson"}, {"Accept": "application/jsonl"})]
    found += [begin(query, **headers) for query, headers in (
        ("?status=done", {}), ("?no_such_filter=1", {}), ("?fields=no_such_field", {}), ("?created_after=yesterday", {}),
        ("", {"Accept": "image/png"}), ("?after=nonsense", {}))]
    for status, media, line in found:
        kinds = described[str(status)]["content"] if str(status) in described else described["default"]["content"]
        assert media.split(";")[0] in kinds, (status, media, line)
    assert {status for status, *_ in found} >= {200, 400, 406}, found


def run(folder, examples, *which):
    """Schemathesis against a server of its own: the number of calls, and the faults found."""
    folder.mkdir()
    server = Server(folder)
    try:
        openapi_spec_validator.validate(server.ask("GET", "/openapi.json"))
        stream_of_the_list(server)
        config = folder / "schemathesis.toml"
        config.write_text(settings(server.known, examples), encoding="utf-8")
        command = [SCHEMATHESIS, "--config-file", config, "run", server.url + "/openapi.json", *which]
        environment = dict(os.environ, PYTHONPATH=TOP / "tests", NO_PROXY="127.0.0.1", no_proxy="127.0.0.1")
        done = subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True, timeout=PATIENCE)
    finally:
        code = server.end()
    found = re.search(r"(\d+) generated", done.stdout)
    wrong = "" if done.returncode == 0 and code == 0 else f"{done.stdout}{done.stderr}\nthe server ended with {code}"
    return int(found[1]) if found else 0, wrong


def main():
    least = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor() as both:
        folder = pathlib.Path(folder)
        # beside these, drawn at random for each operation, there are those that schemathesis always makes
        keep = both.submit(run, folder / "keep", least // 40, "--exclude-name-regex", "%s|%s" % (DRASTIC, ENDLESS))
        drop = both.submit(run, folder / "drop", least // 40, "--include-name-regex", DRASTIC)
        results = [keep.result(), drop.result()]
    calls = sum(calls for calls, _ in results)
    wrong = [text for _, text in results if text]
    print(*wrong, sep="\n")
    print(f"schemathesis: {calls} calls in {time.monotonic() - began:.0f} s")
    if wrong:
        sys.exit("an answer is not as described")
    if calls < least:
        sys.exit(f"fewer than {least} calls")


# schemathesis imports this file for its hook
if __name__ == "__main__":
    main()
