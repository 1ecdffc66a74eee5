"""Owners share the service (R23): who has thousands of jobs in the queue does not hold up another.

    shares.py [--soak]

One owner has 5,000 jobs in the queue (50,000 with --soak), then another submits one: at most one of the first owner's
starts before it. Then 20 owners submit as many jobs each as the workers finish in a while, and at any time each has had
as many started as the others, or one more or less. The user is named in a header, as by a proxy.
"""

import collections
import json
import time

from attack import SOAK, Attacked, check, equal, example

JOBS = 50_000 if SOAK else 5_000
OWNERS = 20
OF_EACH = 100 if SOAK else 20
BATCH = 500
# for one wait; the slowest machine takes a small part of it
PATIENCE_S = 3600 if SOAK else 900


def submit(server, owner, count):
    """So many jobs, each with an input of its own; the answers' last job."""
    last = None
    while count > 0:
        body = {"jobs": [{"problem": example(), "cache": "off"}] * min(BATCH, count)}
        answer = server.call("POST", "/v1/jobs/batch", json.dumps(body).encode(), x_remote_user=owner)
        equal(answer.status, 202, "a batch of " + owner)
        last = answer.json()["jobs"][-1]
        count -= BATCH
    return last


def switch(server, verb):
    equal(server.call("POST", "/v1/queue/" + verb, x_remote_user="root").status, 200, verb)


def started(server, filters):
    """The owners of all jobs that have started, in order of their starts."""
    found, token = [], ""
    while token is not None:
        page = server.call("GET", "/v1/jobs?page_size=1000%s&page_token=%s" % (filters, token), x_remote_user="root").json()
        found += [(job["started_at"], job["owner"]) for job in page["jobs"] if job["started_at"]]
        token = page["next_page_token"]
    return [owner for _, owner in sorted(found)]


def end_of(server, owner, job):
    path, last = "/v1/jobs/%s?wait=60&until=terminal" % job["id"], time.monotonic() + PATIENCE_S
    while time.monotonic() < last:
        found = server.call("GET", path, x_remote_user=owner).json()
        if found["status"] not in ("queued", "running"):
            return found
    raise AssertionError("%s's job is %s after %d s" % (owner, found["status"], PATIENCE_S))


def ended(server, names, statuses):
    """How many jobs of these owners have ended so."""
    states = server.call("GET", "/v1/jobs/count?group_by=owner&status=" + statuses, x_remote_user="root").json()
    return sum(n for owner, n in states["groups"].items() if owner in names)


def main():
    arguments = ["--trusted-proxy", "127.0.0.1", "--proxy-user-header", "x-remote-user", "--proxy-admin", "root", "--max-queued-per-owner", str(JOBS)]
    with Attacked(*arguments) as server:
        switch(server, "pause")
        submit(server, "ada", JOBS)
        refused = server.call("POST", "/v1/jobs", json.dumps({"problem": example(), "cache": "off"}).encode(),
                              x_remote_user="ada")
        equal((refused.status, refused.json()["code"]), (429, "quota-exceeded"), "one more than ada may have")
        job = submit(server, "bob", 1)
        equal(job["queue"]["ahead"], 1, "jobs ahead of bob's")
        switch(server, "resume")
        equal(end_of(server, "bob", job)["status"], "succeeded", "bob's job")
        # another one, while ada's run
        job = submit(server, "bob", 1)
        check(job["status"] == "running" or job["queue"]["ahead"] <= 1, "bob's second job: %r" % job["queue"])
        equal(end_of(server, "bob", job)["status"], "succeeded", "bob's second job")
        switch(server, "pause")
        order = started(server, "&status=running,succeeded")
        first = order.index("bob")
        check(first <= 2, "%d of ada's jobs started before bob's, with two workers" % first)
        left = server.call("POST", "/v1/jobs/cancel?owner=ada&status=queued,running", x_remote_user="root").json()["changed"]
        check(left > JOBS // 2, "bob did not wait for ada's jobs: %d of %d were left" % (left, JOBS))

        names = ["owner%02d" % n for n in range(OWNERS)]
        for name in names:
            submit(server, name, OF_EACH)
        switch(server, "resume")
        # all but a few, so that all owners have some left
        enough = OWNERS * (OF_EACH - 2)
        count, last = 0, time.monotonic() + PATIENCE_S
        while count < enough:
            check(time.monotonic() < last, "%d of %d jobs have ended after %d s" % (count, enough, PATIENCE_S))
            count = ended(server, names, "succeeded,failed,canceled")
        equal(ended(server, names, "failed,canceled"), 0, "jobs that did not succeed")
        order = [owner for owner in started(server, "&status=running,succeeded") if owner in names]
        so_far, widest = collections.Counter({name: 0 for name in names}), 0
        for owner in order[:enough]:
            so_far[owner] += 1
            widest = max(widest, max(so_far.values()) - min(so_far.values()))
        check(widest <= 1, "of 20 owners one had %d more jobs started than another" % widest)
    print("figure: with %d jobs of one owner in the queue, %d of them started before another's; 20 owners never differed by more "
          "than %d started job" % (JOBS, first, widest))


main()
