"""The common parts of the tests from outside: a server of their own, a small HTTP client, the examples. Nothing here
knows more of the service than its clients do.
"""

import asyncio
import contextlib
import http.client
import json
import math
import os
import pathlib
import re
import signal
import socket
import ssl
import subprocess
import sys
import tempfile
import time
import urllib.parse

TOP = pathlib.Path(__file__).resolve().parent.parent
BINARY = pathlib.Path(os.environ.get("SIGNORINI_BINARY", TOP / "target/release/signorini"))
TERMINAL = ("succeeded", "failed", "canceled")
# a proxy must not be used between two processes of this machine
os.environ.update(NO_PROXY="127.0.0.1", no_proxy="127.0.0.1", no_grpc_proxy="127.0.0.1")

checks = 0


def check(holds, what):
    global checks
    checks += 1
    if not holds:
        raise AssertionError(what)


def equal(found, expected, what):
    check(found == expected, "%s: found %r, expected %r" % (what, found, expected))


def example(name="rectangular_punch", **mesh):
    """An example of the thesis; `mesh` is laid over its mesh, as in `refine=3`."""
    problem = json.loads((TOP / "tests/data/thesis" / (name + ".json")).read_text(encoding="utf-8"))
    problem["mesh"].update(mesh)
    return problem


def talkative(increments, **mesh):
    """A problem with about seven events for each increment of its load."""
    return dict(example(**mesh), steps=[{"name": "press", "increments": increments}])


def long_contact(elements):
    """A strip one element wide that touches with all of its long side: nearly all the work is dense."""
    return {
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [0, 1], "y": list(range(elements + 1))}, "boundaries": {"wall": {"normal": [1, 0]}}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "uy": 0}],
        "contacts": [{
            "boundary": "wall", "obstacle": {"kind": "flat", "from": 0, "to": elements}, "indentation": 0.01,
            "friction": {"coefficient": 0.3, "nonlocal_radius": 2, "elastic_slip": 1e-4},
        }],
    }


def many_contacts(count, steps=1):
    """A strip with so many contacts in a row on its top, pressed in load steps: few bytes, and many numbers."""
    contact = lambda i: {
        "boundary": "c%d" % i, "obstacle": {"kind": "flat"}, "indentation": 0.01,
        "friction": {"coefficient": 0.3, "nonlocal_radius": 2 / count, "elastic_slip": 1e-4},
    }
    part = lambda i: {"side": "top", "x": [i / count - 1e-9, (i + 0.5) / count + 1e-9]}
    return {
        "analysis": {"kind": "plane_strain"},
        "mesh": {
            "grid": {"x": [i / (2 * count) for i in range(2 * count + 1)], "y": [0, 0.3, 0.6, 1]},
            "boundaries": {"c%d" % i: part(i) for i in range(count)},
        },
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [contact(i) for i in range(count)],
        "steps": [{"indentation": (i + 1) / steps, "increments": 1} for i in range(steps)] if steps > 1 else [],
    }


def submission(problem, **envelope):
    """The body of a submission. No job is answered from the cache, so that every counted job has run."""
    return json.dumps({"cache": "off", **envelope, "problem": problem}).encode()


def percentile(values, share):
    """The smallest value that `share` of all do not exceed."""
    return sorted(values)[max(0, math.ceil(len(values) * share) - 1)]


class Answer:
    """Status, headers (names in lower case) and body of a response."""

    def __init__(self, status, headers, body):
        self.status, self.headers, self.body = status, headers, body

    def json(self):
        return json.loads(self.body)

    def __repr__(self):
        return "%d %r %r" % (self.status, self.headers, self.body[:600])


def children(pid):
    """The ids of the processes that a process has started: the worker processes of a service."""
    found = []
    with contextlib.suppress(OSError):  # it has ended meanwhile
        for task in list(pathlib.Path("/proc/%d/task" % pid).glob("*")):
            with contextlib.suppress(OSError):  # or a thread of it
                found += map(int, (task / "children").read_text().split())
    return found


def memory(pid, field="VmRSS"):
    """Bytes of memory of a process: resident now (VmRSS), or at most (VmHWM); 0 of one that has ended."""
    try:
        text = pathlib.Path("/proc/%d/status" % pid).read_text()
    except OSError:
        return 0
    found = re.search(field + r":\s+(\d+) kB", text)
    return int(found[1]) * 1024 if found else 0


def cpu_s(pid):
    """Seconds of processor time of a process; 0 of one that has ended."""
    try:
        fields = pathlib.Path("/proc/%d/stat" % pid).read_text().rsplit(")", 1)[1].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def note(**figures):
    """Notes what every script measures, if `run.py` wants to know: see peaks.py."""
    notes = os.environ.get("SIGNORINI_NOTES")
    if notes:
        with open(notes, "a", encoding="utf-8") as file:
            file.write(json.dumps({"script": pathlib.Path(sys.argv[0]).name, **figures}) + "\n")


class Server:
    """The real binary on a free port with a store of its own, which outlives a kill."""

    def __init__(self, *options, wrapper=(), ca=None, port=0):
        """`ca`: the authority whose certificate it shows, if the options have it speak TLS. `port`: for one that clients find again
        after a restart."""
        self.options, self.wrapper, self.ca, self.port = options, wrapper, ca, port
        self.folder = tempfile.TemporaryDirectory()
        self.data = pathlib.Path(self.folder.name) / "data"
        self.log = pathlib.Path(self.folder.name) / "log"
        self.process = None

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, kind, *_):
        if kind is not None:
            print("".join(self.log.read_text(errors="replace").splitlines(True)[-20:]), file=sys.stderr)
        if self.process.poll() is None:
            self.kill()
        self.folder.cleanup()

    def start(self):
        """Starts it, and returns the seconds until it is ready."""
        began = time.monotonic()
        command = [*self.wrapper, BINARY, "serve", "--listen", "127.0.0.1:%d" % self.port, "--data", self.data, *self.options]
        with self.open_log() as log:
            self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log)
        self.url = self.process.stdout.readline().decode().strip()
        scheme = "https://" if self.ca else "http://"
        check(self.url.startswith(scheme + "127.0.0.1:"), "serve began with %r, not with its URL" % self.url)
        self.address = self.url[len(scheme):]
        while self.call("GET", "/readyz").status != 200:
            check(time.monotonic() < began + 60, "the server was not ready within a minute")
        return time.monotonic() - began

    def open_log(self):
        return self.log.open("a")

    def note_peak(self):
        """Notes the most memory that the processes have used, and the budget of their jobs."""
        peak = sum(memory(pid, "VmHWM") for pid in (self.process.pid, *children(self.process.pid)))
        chosen = dict(zip(self.options, self.options[1:])).get("--memory-budget-bytes")
        if peak:
            note(peak=peak, budget=int(chosen or os.environ.get("SIGNORINI_MEMORY_BUDGET_BYTES", 0)))

    def kill(self):
        """As a crash would."""
        self.note_peak()
        self.process.kill()
        self.process.wait()

    def stop(self):
        """As an operator would."""
        self.note_peak()
        self.process.send_signal(signal.SIGTERM)
        equal(self.process.wait(timeout=30), 0, "exit code after SIGTERM")

    def connection(self):
        """A connection that lasts for several requests."""
        if not self.ca:
            return http.client.HTTPConnection(self.address, timeout=120)
        trusted = ssl.create_default_context(cafile=self.ca)
        return http.client.HTTPSConnection(self.address, timeout=120, context=trusted)

    def call(self, method, path, body=None, **headers):
        """One request on a connection of its own. `if_match` becomes the header If-Match."""
        headers = {name.replace("_", "-"): value for name, value in headers.items()}
        if body is not None:
            body = body if isinstance(body, bytes) else json.dumps(body).encode()
            headers.setdefault("content-type", "application/json")
        connection = self.connection()
        try:
            connection.request(method, path, body, headers)
            response = connection.getresponse()
            names = {name.lower(): value for name, value in response.getheaders()}
            return Answer(response.status, names, response.read())
        finally:
            connection.close()

    def json(self, path):
        answer = self.call("GET", path)
        equal(answer.status, 200, "GET %s, %r" % (path, answer))
        return answer.json()

    def submit(self, problem, **envelope):
        """Submits a job; returns its id."""
        answer = self.call("POST", "/v1/jobs", submission(problem, **envelope))
        equal(answer.status, 202, "submit, %r" % answer)
        return answer.json()["id"]

    def finished(self, job):
        """Waits for the job's end; returns the terminal job."""
        while True:
            self.call("GET", "/v1/jobs/%s/events" % job)  # closes after `done`
            found = self.json("/v1/jobs/" + job)
            if found["status"] in TERMINAL:
                return found

    def events(self, job):
        """All events of a finished job."""
        answer = self.call("GET", "/v1/jobs/%s/events" % job)
        equal(answer.status, 200, "events, %r" % answer)
        return [json.loads(line[6:]) for line in answer.body.splitlines() if line.startswith(b"data: ")]

    def every_job(self, **filters):
        """All pages of the list."""
        jobs, filters = [], {"page_size": 1000, **filters}
        while True:
            page = self.json("/v1/jobs?" + urllib.parse.urlencode(filters))
            jobs += page["jobs"]
            filters["page_token"] = page["next_page_token"]
            if not filters["page_token"]:
                return jobs


def table(title, columns, rows):
    """Prints a table of figures as the documentation has it."""
    print("\n**%s**\n" % title)
    print("| %s |" % " | ".join(columns))
    print("|%s" % ("---|" * len(columns)))
    for row in rows:
        print("| %s |" % " | ".join("%.2f" % cell if isinstance(cell, float) else str(cell) for cell in row))
    sys.stdout.flush()


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Lost(Exception):
    """The connection broke before the answer was complete."""


class Connection:
    """A connection that stays open from request to request, for many clients in one thread."""

    def __init__(self, server):
        self.server, self.writer = server, None

    async def call(self, method, path, body=None, **headers):
        try:
            if self.writer is None:
                host, port = self.server.address.split(":")
                self.reader, self.writer = await asyncio.open_connection(host, int(port), limit=1 << 24)
            lines = ["%s %s HTTP/1.1" % (method, path), "host: " + self.server.address]
            lines += ["%s: %s" % (name.replace("_", "-"), value) for name, value in headers.items()]
            if body is not None:
                lines += ["content-type: application/json", "content-length: %d" % len(body)]
            self.writer.write("\r\n".join([*lines, "", ""]).encode() + (body or b""))
            head = (await self.reader.readuntil(b"\r\n\r\n")).decode("latin-1").split("\r\n")
            pairs = [line.split(":", 1) for line in head[1:] if line]
            names = {name.lower(): value.strip() for name, value in pairs}
            status = int(head[0].split()[1])
            return Answer(status, names, await self._body(status, names))
        except (OSError, EOFError) as error:
            self.close()
            raise Lost(str(error)) from error

    async def _body(self, status, headers):
        if "content-length" in headers:
            return await self.reader.readexactly(int(headers["content-length"]))
        if headers.get("transfer-encoding") != "chunked":
            check(status in (204, 304), "a body without length")
            return b""
        pieces = []
        while True:
            size = int(await self.reader.readuntil(b"\r\n"), 16)
            piece = (await self.reader.readexactly(size + 2))[:-2]
            if size == 0:
                return b"".join(pieces)
            pieces.append(piece)

    async def call_until_answered(self, *request, **headers):
        """Repeats the request as long as the connection breaks: for clients of a server that is killed."""
        while True:
            try:
                return await self.call(*request, **headers)
            except Lost:
                await asyncio.sleep(0.02)

    def close(self):
        if self.writer is not None:
            self.writer.close()
            self.writer = None


async def each(clients, work):
    """Runs `work(client)` for all clients at once; the first failure ends them all."""
    tasks = [asyncio.ensure_future(work(client)) for client in clients]
    try:
        await asyncio.gather(*tasks)
    finally:
        for task in tasks:
            task.cancel()
