"""One cancel, and one deletion, of very many jobs (item 11 of the attacks).

    bulk.py [--soak]

All jobs that wait are canceled by one request, and all that have ended are deleted by another, while a bystander asks
for a job. Each used to take a commit for every job: four milliseconds.
"""

import json
import time

from attack import SOAK, Attacked, Bystander, check, equal, example

JOBS = 97_704 if SOAK else 4_000
BATCH = 500
# a quarter of what a commit for each takes, so that a busy machine does not decide
MOST_S_EACH = 1e-3
# the pace of a machine changes, too: one round of these within the bound shows what the program can do
MOST_ROUNDS = 5


def submit(server, count):
    one = {"problem": example(), "cache": "off", "labels": {"study": "bulk"}}
    while count > 0:
        body = json.dumps({"jobs": [one] * min(BATCH, count)}).encode()
        equal(server.call("POST", "/v1/jobs/batch", body).status, 202, "a batch")
        count -= BATCH


def timed(server, method, path, expected):
    began = time.monotonic()
    answer = server.call(method, path)
    took = time.monotonic() - began
    equal(answer.status, 200, path)
    found = answer.json()
    equal((found["matched"], found["changed"]), (expected, expected), path)
    return took


def main():
    with Attacked() as server:
        seen = server.finished_job()
        equal(server.call("POST", "/v1/queue/pause").status, 200, "pause")
        canceled = deleted = float("inf")
        rounds = 0
        while max(canceled, deleted) > JOBS * MOST_S_EACH:
            check(rounds < MOST_ROUNDS, "of %d rounds the fastest cancel took %.1f s, the fastest deletion %.1f s" % (
                rounds, canceled, deleted))
            rounds += 1
            submit(server, JOBS)
            with Bystander(server):
                canceled = min(canceled, timed(server, "POST", "/v1/jobs/cancel?status=queued", JOBS))
                deleted = min(deleted, timed(server, "DELETE", "/v1/jobs?status=canceled", JOBS))
        equal(server.json("/v1/jobs/" + seen)["status"], "succeeded", "the job of the bystander")
        log = server.log.read_text()
        check("has ended: canceled" in log and "was deleted" in log, "the log tells of each")
    print("figure: %d jobs canceled by one request in %.1f s, %d deleted in %.1f s" % (JOBS, canceled, JOBS, deleted))


main()
