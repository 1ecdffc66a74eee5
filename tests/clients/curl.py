"""The service as curl sees it: submit and wait, idempotency keys, entity tags, server-sent events, error
documents, cancel.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import outside
from outside import Answer, Server, check, equal, example, submission, talkative


class Curl:
    def __init__(self, server, folder):
        self.server, self.folder = server, pathlib.Path(folder)

    def __call__(self, path, *options, body=None):
        """Runs curl; a body is sent as JSON from a file, as one would."""
        head, file = self.folder / "head", self.folder / "body"
        if body is not None:
            file.write_bytes(body if isinstance(body, bytes) else json.dumps(body).encode())
            options += ("--json", "@%s" % file)
        command = ["curl", "--silent", "--show-error", "--max-time", "120", "--dump-header", head, *options]
        done = subprocess.run([*command, self.server.url + path], capture_output=True)
        equal(done.returncode, 0, "curl %s ended, %r" % (path, done.stderr))
        # of several responses (an interim one, a redirection) the last counts
        lines = head.read_text().strip().split("\n\n")[-1].splitlines()
        pairs = [line.split(": ", 1) for line in lines[1:] if ": " in line]
        return Answer(int(lines[0].split()[1]), {name.lower(): value for name, value in pairs}, done.stdout)


def submit_and_wait(curl):
    answer = curl("/v1/jobs", "-H", "Prefer: wait=30", body=submission(example()))
    equal(answer.status, 201, "submit with Prefer: wait, %r" % answer)
    equal(answer.headers.get("preference-applied"), "wait=30", "Preference-Applied")
    job = answer.json()
    equal((job["status"], job["result_available"]), ("succeeded", "final"), "the job that was waited for")
    equal(answer.headers["location"], "/v1/jobs/" + job["id"], "Location")
    equal(answer.headers["etag"], 'W/"%d"' % job["version"], "ETag")

    answer = curl("/v1/jobs", body=submission(example()))
    equal(answer.status, 202, "submit without waiting, %r" % answer)
    check(int(answer.headers["retry-after"]) >= 1, "Retry-After")
    equal(answer.headers["etag"], 'W/"%d"' % answer.json()["version"], "ETag")
    return job


def repeat_under_a_key(curl):
    key, body = ("-H", "Idempotency-Key: from-curl"), submission(example(), name="once")
    first = curl("/v1/jobs", *key, "-H", "Prefer: wait=30", body=body)
    equal((first.status, first.headers.get("idempotency-replayed")), (201, None), "the first post under a key")
    again = curl("/v1/jobs", *key, body=body)
    check(again.status in (200, 201, 202), "the second post under a key, %r" % again)
    equal(again.headers.get("idempotency-replayed"), "true", "Idempotency-Replayed of the second")
    equal(again.json(), first.json(), "the job of the second post, as it is now")
    equal(again.headers["location"], first.headers["location"], "Location of the second")
    other = curl("/v1/jobs", *key, body=submission(example("sheet")))
    equal((other.status, other.json()["code"]), (422, "idempotency-key-reuse"), "another body under the same key")


def ask_only_for_changes(curl, job):
    path = "/v1/jobs/" + job["id"]
    tag = curl(path).headers["etag"]
    answer = curl(path, "-H", "If-None-Match: " + tag)
    equal((answer.status, answer.body, answer.headers.get("etag")), (304, b"", tag), "If-None-Match with the tag")
    equal(curl(path, "-H", 'If-None-Match: "0", %s' % tag).status, 304, "If-None-Match with a list")
    equal(curl(path, "-H", 'If-None-Match: "0"').status, 200, "If-None-Match with another tag")


def watch(curl):
    job = curl("/v1/jobs", body=submission(talkative(100))).json()["id"]
    answer = curl("/v1/jobs/%s/events" % job, "-N")
    equal(answer.headers["content-type"].split(";")[0], "text/event-stream", "the type of events")
    events = []
    for block in answer.body.decode().split("\n\n"):
        fields = dict(line.split(": ", 1) for line in block.splitlines() if line and not line.startswith(":"))
        if fields:
            event = json.loads(fields["data"])
            equal((fields["id"], fields["event"]), (str(event["seq"]), event["type"]), "id and type of an event")
            events.append(event)
    equal([event["seq"] for event in events], list(range(1, len(events) + 1)), "the numbers of the events")
    equal(events[-1]["type"], "done", "the last event")
    half = len(events) // 2
    rest = curl("/v1/jobs/%s/events" % job, "-N", "-H", "Last-Event-ID: %d" % half)
    equal(rest.body.count(b"\ndata: ") + rest.body.startswith(b"data: "), len(events) - half, "events after half of them")
    lines = curl("/v1/jobs/%s/events?after_seq=%d" % (job, half), "-H", "Accept: application/x-ndjson")
    equal([json.loads(line) for line in lines.body.splitlines()], events[half:], "the same as JSON Lines")
    equal(curl("/v1/jobs/%s/events?after_seq=%d" % (job, len(events))).status, 204, "events after the last")

    # submit and watch in one request
    answer = curl("/v1/jobs", "-N", "-H", "Accept: text/event-stream", body=submission(example()))
    types = [line[7:] for line in answer.body.decode().splitlines() if line.startswith("event: ")]
    equal((types[0], types[-1], types.count("done")), ("status", "done", 1), "the events of a submit that streams")


def be_refused(curl):
    wrong = example()
    wrong["materials"][0]["youngs_modulus"] = -1
    wrong["contacts"][0]["friction"]["coefficient"] = -0.3
    answer = curl("/v1/jobs", body=submission(wrong))
    equal(answer.status, 422, "an invalid problem, %r" % answer)
    equal(answer.headers["content-type"], "application/problem+json", "the type of an error document")
    document = answer.json()
    equal((document["type"], document["code"], document["status"], document["retryable"], document["instance"]),
          ("/v1/errors/invalid-problem", "invalid-problem", 422, False, "/v1/jobs"), "the error document")
    pointers = [error["pointer"] for error in document["errors"]]
    equal(sorted(pointers), ["/problem/contacts/0/friction/coefficient", "/problem/materials/0/youngs_modulus"], "the pointers")
    for error in document["errors"]:
        check(error["reason"] and error["got"] and error["expected"] and error["hint"], "an error without a word: %r" % error)
    page = curl(document["type"])
    equal(page.status, 200, "the page of an error")
    for path, options, status, code in [
        ("/v1/jobs/job_00000000-0000-7000-8000-000000000000", (), 404, "not-found"),
        ("/v1/jobs/nonsense", (), 404, "not-found"),
        ("/v1/nowhere", (), 404, "not-found"),
        ("/v1/jobs?colour=red", (), 400, "unknown-parameter"),
        ("/v1/jobs?page_token=red", (), 400, "bad-page-token"),
        ("/v1/jobs", ("-X", "PATCH"), 405, "method-not-allowed"),
        ("/v1/jobs", ("-d", "{}", "-H", "Content-Type: text/plain"), 415, "unsupported-media"),
        ("/v1/jobs", ("--json", "{"), 400, "malformed-json"),
        ("/v1/jobs", ("-X", "DELETE"), 400, "missing-filter"),
    ]:
        answer = curl(path, *options)
        equal((answer.status, answer.json()["code"]), (status, code), "%s %s" % (path, options))
        equal(answer.headers["content-type"], "application/problem+json", "the type of " + code)
        check(status != 405 or "GET" in answer.headers["allow"], "405 without Allow")


def cancel(curl):
    # behind a long one: canceled in the queue or at work, either way soon at its end
    job = curl("/v1/jobs", body=submission(talkative(4000, refine=3))).json()["id"]
    answer = curl("/v1/jobs/%s/cancel" % job, "-X", "POST")
    equal(answer.status, 200, "cancel, %r" % answer)
    check(answer.json()["outcome"] in ("canceled", "cancel_requested"), "the outcome of a cancel, %r" % answer)
    ended = curl("/v1/jobs/%s?wait=10&until=terminal" % job)
    equal((ended.status, ended.json()["status"], ended.json()["reason"]), (200, "canceled", "user_cancel"), "a canceled job")
    equal(curl("/v1/jobs/%s/cancel" % job, "-X", "POST").json()["outcome"], "already_terminal", "a second cancel")


def main():
    with Server() as server, tempfile.TemporaryDirectory() as folder:
        curl = Curl(server, folder)
        job = submit_and_wait(curl)
        for part in (repeat_under_a_key, watch, be_refused, cancel):
            part(curl)
        ask_only_for_changes(curl, job)
    print("curl: %d checks" % outside.checks)


main()
