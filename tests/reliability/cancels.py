"""Cancels that race with the end of what they cancel, and how long a canceled job lives on (R19).

    cancels.py [CANCELS] [SEED]

First small jobs, each canceled at a random moment around its end: every one ends once, and answer, job
and events agree on how. Then jobs of about 20,000 unknowns, canceled at random moments of their run.
"""

import asyncio
import collections
import json
import random
import re
import sys
import time

from attack import Attacked, Bystander, check, equal, example
from outside import Connection, each, percentile, submission

CANCELS = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
SEED = int(sys.argv[2]) if len(sys.argv) > 2 else random.randrange(1 << 32)
# as many as workers and a few more: some jobs are canceled in the queue, most while they run
CLIENTS = 6
LARGE_CANCELS, LARGE_REFINE = 100, 3
# seconds from the request to the terminal job, 99 of 100 (G7)
MOST_S = 0.5


def story(answer):
    """Numbers and types of the events of a job that has ended, and the job as `done` carries it."""
    check(answer.status == 200, "events, %r" % answer)
    seqs = [int(seq) for seq in re.findall(rb"^id: (\d+)$", answer.body, re.MULTILINE)]
    types = re.findall(rb"^event: (\w+)$", answer.body, re.MULTILINE)
    last = [line for line in answer.body.split(b"\n") if line.startswith(b"data: ")][-1]
    equal(seqs, list(range(1, len(seqs) + 1)), "the numbers of the events")
    equal((types.count(b"done"), types[-1]), (1, b"done"), "the ends of a job, and its last event")
    return json.loads(last[6:])["job"]


def check_end(job, outcome, asked):
    """A job as it ended and the answer to a cancel tell one story."""
    check(job["status"] in ("succeeded", "canceled"), "%s is %s" % (job["id"], job["status"]))
    equal(job["reason"] == "user_cancel", job["status"] == "canceled", "the reason of %s is a cancel" % job["id"])
    if outcome == "canceled":
        equal((asked["status"], job["status"]), ("canceled", "canceled"), "a job that was canceled")
    elif outcome == "already_terminal":
        equal((asked["status"], asked["version"]), (job["status"], job["version"]), "a job that had ended")
    else:
        equal(outcome, "cancel_requested", "the outcome of a cancel")


def told(outcomes):
    return ", ".join("%d × %s → %s" % (n, *pair) for pair, n in sorted(outcomes.items()))


async def race(server, dice):
    """Small jobs, canceled around their end."""
    outcomes, ended, spans, numbers = collections.Counter(), {}, [0.02], iter(range(CANCELS))

    async def client(_):
        connection = Connection(server)
        body = submission(example())
        for _ in numbers:
            began = time.monotonic()
            job = (await connection.call("POST", "/v1/jobs", body)).json()["id"]
            # from at once to a little after the usual end
            await asyncio.sleep(dice.uniform(0, 1.3) * percentile(spans[-50:], 0.5))
            answer = await connection.call("POST", "/v1/jobs/%s/cancel" % job)
            equal(answer.status, 200, "cancel, %r" % answer)
            answer = answer.json()
            end = story(await connection.call("GET", "/v1/jobs/%s/events" % job))
            check_end(end, answer["outcome"], answer["job"])
            outcomes[answer["outcome"], end["status"]] += 1
            ended[job] = end["status"], end["version"]
            if (answer["outcome"], end["status"]) == ("already_terminal", "succeeded"):
                spans.append(end["queue_wait_s"] + end["run_s"])
            elif time.monotonic() - began > spans[-1]:
                spans.append(spans[-1] * 1.05)
        connection.close()

    await each(range(CLIENTS), client)
    equal(sum(outcomes.values()), CANCELS, "the number of cancels")
    listed = {job["id"]: (job["status"], job["version"]) for job in server.every_job()}
    listed.pop(server.finished_job())  # the bystander's
    equal(listed, ended, "all jobs, as listed and as they ended")
    return outcomes


async def cancel_large(server, dice):
    """One job at a time; a second client waits for its end."""
    problem = example(refine=LARGE_REFINE)
    judged = server.call("POST", "/v1/problems/validate", {"problem": problem}).json()
    dofs = judged["estimate"]["dofs"]
    check(18_000 < dofs < 25_000, "the large job has %d unknowns" % dofs)
    spans = []
    for _ in range(5):
        began = time.monotonic()
        server.finished(server.submit(problem))
        spans.append(time.monotonic() - began)
    usual = percentile(spans, 0.5)
    answered, ended, outcomes, canceled = [], [], collections.Counter(), 0
    asking, waiting = Connection(server), Connection(server)
    while canceled < LARGE_CANCELS:
        check(sum(outcomes.values()) < 4 * LARGE_CANCELS, "most cancels came too late: " + told(outcomes))
        job = (await asking.call("POST", "/v1/jobs", submission(problem))).json()["id"]
        events = asyncio.ensure_future(waiting.call("GET", "/v1/jobs/%s/events" % job))
        await asyncio.sleep(dice.uniform(0, usual))
        began = time.monotonic()
        answer = (await asking.call("POST", "/v1/jobs/%s/cancel" % job)).json()
        answer_s = time.monotonic() - began
        end = story(await events)
        end_s = time.monotonic() - began
        check_end(end, answer["outcome"], answer["job"])
        outcomes[answer["outcome"], end["status"]] += 1
        canceled += end["status"] == "canceled"
        if answer["outcome"] != "already_terminal":
            answered.append(answer_s)
            ended.append(end_s)
    asking.close()
    waiting.close()
    worst = percentile(ended, 0.99)
    check(worst <= MOST_S, "99 of 100 canceled jobs end within %.0f ms only" % (1e3 * worst))
    return dofs, usual, outcomes, answered, ended


async def run(server, dice):
    began = time.monotonic()
    outcomes = await race(server, dice)
    took = time.monotonic() - began
    small = "%d cancels of small jobs in %.0f s, each job ended once: %s" % (CANCELS, took, told(outcomes))
    print(small, flush=True)
    dofs, usual, outcomes, answered, ended = await cancel_large(server, dice)
    ms = lambda values, share: 1e3 * percentile(values, share)
    print("figure: %s; %d cancels of a job of %d unknowns (%.0f ms alone): %s; answered p50 %.1f ms, p99 %.1f ms; terminal p50 "
          "%.1f ms, p99 %.1f ms" % (
              small, sum(outcomes.values()), dofs, 1e3 * usual, told(outcomes), ms(answered, 0.5), ms(answered, 0.99),
              ms(ended, 0.5), ms(ended, 0.99)))


def main():
    print("seed %d" % SEED, flush=True)
    with Attacked() as server, Bystander(server):
        asyncio.run(run(server, random.Random(SEED)))


main()
