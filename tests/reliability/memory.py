"""Jobs that ask for more memory than they say, or than there is (R17).

    memory.py [--soak]

The budget is 512 MiB. The 35 KB job: a long contact under a name of its own, whose dense matrices take many GiB. Jobs
whose estimates run from 1 MiB to beyond 10 GiB: each is refused with figures, waits for memory, or is solved. A job of
1,000 load steps. Healthy jobs beside them succeed, and the server stays below budget + 256 MiB. --soak solves more of
them, and the large ones to their ends.
"""

from attack import MIB, SOAK, Attacked, Bystander, Watch, check, equal, example
from outside import long_contact

BUDGET = 512 * MIB
MOST = BUDGET + 256 * MIB
STEPS = 1_000 if SOAK else 200


def told(server, problem):
    """The estimate that the service tells."""
    answer = server.call("POST", "/v1/problems/validate", {"problem": problem})
    equal(answer.status, 200, "validate, %r" % answer)
    return answer.json()


def offer(server, problem):
    """Submits a problem; its job, or None if it is refused with figures."""
    answer = server.call("POST", "/v1/jobs", {"cache": "off", "problem": problem, "limits": {"timeout_s": 120}})
    if answer.status == 202:
        return answer.json()["id"]
    document = answer.json()
    check(answer.status == 413, "a problem that is too large, %r" % answer)
    check(document["estimate"]["memory_bytes"] > BUDGET, "the figures of a refusal: %r" % document)
    equal(document["memory_budget_bytes"], BUDGET, "the budget in a refusal")
    return None


def attack(isolation):
    with Attacked("--workers", "2", "--memory-budget-bytes", str(BUDGET), "--isolation", isolation) as server, Bystander(server):
        watch = Watch(server.process.pid)
        watch.start()
        healthy = server.submit(example(refine=2))

        # far beyond what can be numbered: a violation at its place, and no estimate of 2⁶⁴
        answer = server.call("POST", "/v1/jobs", {"problem": example(refine=100)})
        equal(answer.status, 422, "refine: 100, %r" % answer)
        check(any(v["pointer"] == "/problem/mesh/refine" for v in answer.json()["errors"]), "its place: %r" % answer)

        # the 35 KB job, which was told to need 103 MiB
        large = long_contact(6_000)
        estimate = told(server, large)["estimate"]["memory_bytes"]
        check(estimate > 3 * 8 * 24_000 ** 2 / 2, "a contact of 12,001 nodes is told to need %d bytes" % estimate)
        equal(offer(server, large), None, "the 35 KB job")

        # of every size; those that fit wait for each other
        sizes = (100, 300, 600, 800, 1_000, 1_500, 2_000, 4_000, 8_000) if SOAK else (50, 100, 300, 450, 2_000, 8_000)
        jobs, refused, waited = [], 0, False
        for elements in sizes:
            job = offer(server, long_contact(elements))
            refused += job is None
            jobs += [job] if job else []
        jobs += [server.submit(example(refine=3 if SOAK else 2)) for _ in range(3)]
        jobs.append(server.submit(dict(
            example(refine=3 if SOAK else 1), steps=[{"indentation": k / STEPS} for k in range(1, STEPS + 1)]
        )))
        check(refused >= 2 and len(jobs) >= 6, "%d refused, %d accepted" % (refused, len(jobs)))
        for job in jobs:
            found = server.json("/v1/jobs/" + job)
            waited |= (found["queue"] or {}).get("reason") == "memory"
            ended = server.finished(job)
            # the estimate by which it was accepted is an upper bound
            equal(ended["status"], "succeeded", "a job within the budget, %r" % ended["failure"])
        equal(server.finished(healthy)["status"], "succeeded", "the healthy job beside them")
        equal(server.finished(server.submit(example()))["status"], "succeeded", "a healthy job after them")
        equal(server.call("GET", "/readyz").status, 200, "the server after all of it")
        watch.ended = True
        check(watch.highest <= MOST, "resident %d MiB, allowed %d" % (watch.highest // MIB, MOST // MIB))
        return "%s: %d jobs were refused and %d solved, one of them with %d load steps; resident memory reached %d MiB%s" % (
            isolation, refused, len(jobs), STEPS, watch.highest // MIB, ", and a job waited for memory" if waited else "")


print("figure: with a budget of %d MiB, %s" % (BUDGET // MIB, "; ".join(map(attack, ("thread", "process")))))
