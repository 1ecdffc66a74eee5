"""The service as Python sees it with nothing but its standard library."""

import base64
import hashlib
import http.client
import json
import pathlib
import sys
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
import uuid

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import outside
from outside import TERMINAL, Server, check, equal, example, submission, talkative

PROFILE = ["s", "x", "y", "gap", "normal_displacement", "tangential_displacement", "normal_stress", "tangential_stress",
           "nonlocal_pressure", "friction_bound", "friction_ratio", "state"]


class Client:
    """`urllib.request`, with JSON both ways. A refusal is an answer too."""

    def __init__(self, url):
        self.url = url
        self.opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))

    def __call__(self, method, path, body=None, **headers):
        headers = {name.replace("_", "-"): value for name, value in headers.items()}
        if body is not None:
            body = body if isinstance(body, bytes) else json.dumps(body).encode()
            headers.setdefault("content-type", "application/json")
        request = urllib.request.Request(self.url + path, body, headers, method=method)
        try:
            with self.opener.open(request, timeout=120) as response:
                return outside.Answer(response.status, lower(response.headers), response.read())
        except urllib.error.HTTPError as error:
            return outside.Answer(error.code, lower(error.headers), error.read())

    def get(self, path, **headers):
        answer = self("GET", path, **headers)
        equal(answer.status, 200, "GET %s, %r" % (path, answer))
        return answer.json()

    def submit(self, problem, **envelope):
        answer = self("POST", "/v1/jobs", submission(problem, **envelope))
        equal(answer.status, 202, "submit, %r" % answer)
        return answer.json()

    def finished(self, job):
        """Long polls, each held back until the end or a time limit."""
        while True:
            answer = self("GET", "/v1/jobs/%s?wait=30&until=terminal" % job)
            equal(answer.status, 200, "a long poll without If-None-Match, %r" % answer)
            if answer.json()["status"] in TERMINAL:
                return answer.json()

    def refused(self, status, code, *request, **headers):
        answer = self(*request, **headers)
        equal((answer.status, answer.json()["code"]), (status, code), "%s %s, %r" % (*request[:2], answer))
        equal(answer.headers["content-type"], "application/problem+json", "the type of an error document")
        return answer


def lower(headers):
    return {name.lower(): value for name, value in headers.items()}


def submit_and_poll(client):
    job = client.submit(example(), name="poll", labels={"kind": "punch"}, priority=3)
    equal((job["name"], job["labels"], job["priority"], job["owner"]), ("poll", {"kind": "punch"}, 3, "local"), "a new job")
    job = client.finished(job["id"])
    equal((job["status"], job["attempt"], job["cached_from"]), ("succeeded", 1, None), "a job that has run")
    tag = 'W/"%d"' % job["version"]
    began = time.monotonic()
    answer = client("GET", "/v1/jobs/%s?wait=1" % job["id"], if_none_match=tag)
    equal((answer.status, time.monotonic() - began >= 0.9), (304, True), "a long poll for a change that does not come")
    answer = client("GET", "/v1/jobs/%s?wait=30" % job["id"], if_none_match='"1"')
    equal((answer.status, answer.headers["etag"]), (200, tag), "a long poll for a change that has come")
    answer = client("GET", "/v1/jobs/%s?wait=30&until=terminal" % job["id"], if_none_match=tag)
    check(time.monotonic() - began < 5, "a poll for the end of a job that has ended took %g s" % (time.monotonic() - began))
    client.refused(400, "unknown-parameter", "GET", "/v1/jobs/%s?weight=1" % job["id"])
    return job["id"]


def poll_for_each_change(client):
    """Every version of a running job by If-None-Match, until the last."""
    job = client.submit(talkative(200, refine=3))
    tags = ['W/"%d"' % job["version"]]
    while job["status"] not in TERMINAL:
        answer = client("GET", "/v1/jobs/%s?wait=30" % job["id"], if_none_match=tags[-1])
        check(answer.status in (200, 304), "a long poll, %r" % answer)
        if answer.status == 200:
            job = answer.json()
            tags.append(answer.headers["etag"])
    equal(sorted(set(tags), key=lambda tag: int(tag.strip('W/"'))), tags, "the versions, each once and in order")
    equal(job["status"], "succeeded", "the job of many polls")


def list_pages(client):
    first = [client.submit(example(), name="listed", labels={"n": str(n)})["id"] for n in range(7)]
    pages, token = [], None
    while token is not None or not pages:
        query = {"name": "listed", "page_size": 3, **({"page_token": token} if token else {})}
        page = client.get("/v1/jobs?" + urllib.parse.urlencode(query))
        pages.append([job["id"] for job in page["jobs"]])
        token = page["next_page_token"]
        if len(pages) == 1:
            # what arrives between two pages moves nothing
            client.submit(example(), name="listed", labels={"n": "late"})
    equal([job for page in pages for job in page], first[::-1], "the pages, newest first")
    equal([len(page) for page in pages], [3, 3, 1], "the sizes of the pages")
    page = client.get("/v1/jobs?label.n=4&name=listed")
    equal([job["id"] for job in page["jobs"]], [first[4]], "the list by a label")
    page = client.get("/v1/jobs?name=listed&order_by=created_at%20asc")
    equal([job["id"] for job in page["jobs"]][:7], first, "the list, oldest first")
    for job in first:
        client.finished(job)
    counts = client.get("/v1/jobs/count?group_by=status&name=listed")
    check("succeeded" in json.dumps(counts), "the counts by status: %r" % counts)
    client.refused(400, "unknown-parameter", "GET", "/v1/jobs?colour=red")
    client.refused(400, "bad-page-token", "GET", "/v1/jobs?page_token=abc")


def read_result(client, job):
    result = client.get("/v1/jobs/%s/result" % job)
    summary = result["summary"]
    equal((summary["outcome"], summary["converged"]), ("converged", True), "the outcome")
    # formulation 5.2: example 1 has +14.17
    equal(round(summary["tangential_force"], 2), 14.17, "the tangential force")
    profile = client.get("/v1/jobs/%s/profiles/top" % job)
    peak = summary["contacts"]["top"]["peak_tangential_stress"]["value"]
    equal(max(profile["tangential_stress"], key=abs), peak, "the peak of the profile")
    profile = client.get("/v1/jobs/%s/profiles/top?points=nodes" % job)
    equal(list(profile), PROFILE, "the columns of a profile")
    equal(profile["s"], sorted(profile["s"]), "the arc length")
    equal({len(column) for column in profile.values()}, {11}, "the lengths of the columns")
    points = client.get("/v1/jobs/%s/profiles/top?points=101" % job)
    equal(len(points["s"]), 101, "a profile at 101 points")
    history = client.get("/v1/jobs/%s/history" % job)
    rows = history if isinstance(history, list) else history["history"]
    equal([row["k"] for row in rows], list(range(1, summary["iterations"] + 1)), "the rows of the history")
    few = client.get("/v1/jobs/%s/history?max_points=3" % job)
    few = few if isinstance(few, list) else few["history"]
    equal((len(few), few[0], few[-1]), (3, rows[0], rows[-1]), "three rows of the history")
    problem = client.get("/v1/jobs/%s/problem" % job)
    equal(problem["title"], example()["title"], "the title of the problem")
    judged = client("POST", "/v1/problems/validate", {"problem": problem}).json()
    equal(judged["input_hash"], client.get("/v1/jobs/" + job)["input_hash"], "the problem as it was handed in")
    client.refused(404, "not-found", "GET", "/v1/jobs/%s/profiles/left" % job)


def download_in_pieces(client, job):
    """Fields by Range requests, broken off and resumed; what is put together has the digest of all."""
    path = "/v1/jobs/%s/fields" % job
    whole = client("GET", path)
    equal(whole.status, 200, "fields, %r" % whole)
    tag = whole.headers["etag"]
    check(tag.startswith('"') and whole.headers["accept-ranges"] == "bytes", "ETag and Accept-Ranges: %r" % whole.headers)
    digest = hashlib.sha256(whole.body).digest()
    equal(digest_of(whole.headers, "content-digest"), digest, "Content-Digest of all")
    got, pieces = b"", 0
    while len(got) < len(whole.body):
        connection = http.client.HTTPConnection(client.url[len("http://"):], timeout=60)
        connection.request("GET", path, headers={"range": "bytes=%d-" % len(got), "if-range": tag})
        response = connection.getresponse()
        equal(response.status, 206, "a part of the fields")
        equal(response.getheader("etag"), tag, "ETag of a part")
        equal(digest_of(lower(response.headers), "repr-digest"), digest, "Repr-Digest of a part, which is that of all")
        end = len(whole.body)
        equal(response.getheader("content-range"), "bytes %d-%d/%d" % (len(got), end - 1, end), "Content-Range")
        # broken off after a third of it
        got += response.read(end // 3 + 1)
        pieces += 1
        connection.close()
    equal((got == whole.body, pieces), (True, 3), "the fields put together")
    part = client("GET", path, range="bytes=100-299")
    equal((part.status, part.body), (206, whole.body[100:300]), "200 bytes of the fields")
    equal(client("GET", path, range="bytes=-50").body, whole.body[-50:], "the last 50 bytes")
    equal(client("GET", path, range="bytes=0-9", if_range='"other"').status, 200, "a part of what has changed")
    equal(client("GET", path, if_none_match=tag).status, 304, "the fields that one has")
    client.refused(416, "range-not-satisfiable", "GET", path, range="bytes=%d-" % len(whole.body))
    client.refused(406, "not-acceptable", "GET", path + "?format=csv")
    equal(json.loads(client("GET", path + "?format=json").body)["elements"][0].__len__(), 8, "fields as JSON")


def digest_of(headers, name):
    """RFC 9530: `sha-256=:<base64>:`, perhaps beside others."""
    for entry in headers[name].split(","):
        kind, _, value = entry.strip().partition("=")
        if kind == "sha-256":
            return base64.b64decode(value.strip(":"))
    raise AssertionError("no sha-256 in %s: %r" % (name, headers[name]))


def submit_batch(client):
    jobs = [json.loads(submission(example(), name="batch", labels={"n": str(n)})) for n in range(20)]
    answer = client("POST", "/v1/jobs/batch", {"jobs": jobs}, idempotency_key="batch")
    equal(answer.status, 202, "batch, %r" % answer)
    made = [job["id"] for job in answer.json()["jobs"]]
    equal(len(set(made)), 20, "the jobs of a batch")
    again = client("POST", "/v1/jobs/batch", {"jobs": jobs}, idempotency_key="batch")
    equal([job["id"] for job in again.json()["jobs"]], made, "the same batch again")
    equal(again.headers.get("idempotency-replayed"), "true", "Idempotency-Replayed of a batch")
    for job in made:
        equal(client.finished(job)["status"], "succeeded", "a job of a batch")
    # all or nothing
    jobs[7]["problem"]["materials"] = []
    answer = client.refused(422, "invalid-problem", "POST", "/v1/jobs/batch", {"jobs": jobs})
    check(all(error["pointer"].startswith("/jobs/7/") for error in answer.json()["errors"]), "the pointers, %r" % answer)
    equal(len(client.get("/v1/jobs?name=batch&page_size=1000")["jobs"]), 20, "the jobs of a refused batch")


def put_with_own_name(client):
    name = "/v1/jobs/job_" + version_7()
    body = submission(example(), name="mine")
    answer = client("PUT", name, body)
    check(answer.status in (201, 202), "the first PUT, %r" % answer)
    equal(answer.json()["id"], name[len("/v1/jobs/"):], "the id of a PUT")
    again = client("PUT", name, body)
    equal((again.status, again.json()["id"]), (200, answer.json()["id"]), "the same PUT again")
    client.refused(409, "id-conflict", "PUT", name, submission(example(), name="other"))
    client.refused(404, "not-found", "PUT", "/v1/jobs/mine", body)


def version_7():
    """A UUID of version 7, which this library gives only from Python 3.14 on."""
    random = uuid.uuid4().int & ((1 << 74) - 1)
    value = int(time.time() * 1000) << 80 | 7 << 76 | (random >> 62) << 64 | 2 << 62 | random & ((1 << 62) - 1)
    return str(uuid.UUID(int=value))


def retry_edit_delete(client, job):
    answer = client("POST", "/v1/jobs/%s/retry" % job)
    equal((answer.status, answer.json()["parent"]), (202, job), "retry, %r" % answer)
    again = client.finished(answer.json()["id"])
    equal((again["status"], again["id"] != job), ("succeeded", True), "the job tried again")

    path = "/v1/jobs/" + again["id"]
    tag = client("GET", path).headers["etag"]
    answer = client("PATCH", path, {"name": "edited", "labels": {"a": "b"}, "pinned": True}, if_match=tag)
    equal((answer.status, answer.json()["name"], answer.json()["labels"]), (200, "edited", {"a": "b"}), "PATCH, %r" % answer)
    check(answer.headers["etag"] != tag, "an edit leaves the version")
    client.refused(412, "stale-version", "PATCH", path, {"name": "lost"}, if_match=tag)
    equal(client.get(path)["name"], "edited", "the name after a stale edit")

    running = client.submit(talkative(4000, refine=3))["id"]
    client.refused(409, "job-active", "DELETE", "/v1/jobs/" + running)
    client("POST", "/v1/jobs/%s/cancel" % running)
    client.finished(running)
    equal(client("DELETE", path).status, 204, "DELETE")
    for gone in (path, path + "/events", path + "/result"):
        client.refused(410, "deleted", "GET", gone)
    equal(client("DELETE", "/v1/jobs/" + running).status, 204, "DELETE of a canceled job")
    client.refused(404, "not-found", "GET", "/v1/jobs/job_" + version_7())


def many_at_once(client):
    """Cancel and delete by filters, while the queue is paused."""
    equal(client("POST", "/v1/queue/pause").status, 200, "pause")
    jobs = [client.submit(example(), name="many", labels={"half": str(n % 2)})["id"] for n in range(10)]
    waiting = client.get("/v1/jobs/" + jobs[3])
    equal((waiting["status"], waiting["queue"]["reason"]), ("queued", "paused"), "a job of a paused queue")
    equal((waiting["queue"]["position"], waiting["queue"]["ahead"]), (4, 3), "its place")
    client.refused(409, "result-not-ready", "GET", "/v1/jobs/%s/result" % jobs[0])
    answer = client("POST", "/v1/jobs/cancel?name=many&label.half=1")
    equal((answer.status, answer.json()), (200, {"matched": 5, "changed": 5}), "cancel by filters")
    equal(client.finished(jobs[1])["status"], "canceled", "a job canceled by filters")
    # somebody waits while the queue starts again
    found = []
    waiter = threading.Thread(target=lambda: found.append(client.finished(jobs[0])))
    waiter.start()
    equal(client("POST", "/v1/queue/resume").status, 200, "resume")
    waiter.join()
    equal(found[0]["status"], "succeeded", "a job of a resumed queue")
    for job in jobs:
        client.finished(job)
    answer = client("DELETE", "/v1/jobs?name=many")
    equal((answer.status, answer.json()), (200, {"matched": 10, "changed": 10}), "delete by filters")
    equal(client.get("/v1/jobs?name=many")["jobs"], [], "the list after that")
    client.refused(400, "missing-filter", "POST", "/v1/jobs/cancel")


def main():
    with Server() as server:
        client = Client(server.url)
        job = submit_and_poll(client)
        for part in (poll_for_each_change, list_pages, submit_batch, put_with_own_name, many_at_once):
            part(client)
        for part in (read_result, download_in_pieces, retry_edit_delete):
            part(client, job)
    print("Python's standard library: %d checks" % outside.checks)


main()
