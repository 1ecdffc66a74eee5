"""How soon a worker is free after its job has ended by time or was canceled, wherever it is stopped (R17a).

    stuck.py [--soak]

The jobs are a strip one element wide that touches with all of its long side: few bytes, and a dense matrix of two
unknowns for each contact node. One is stopped by its time limit, another by a cancel; a small job waits behind it, on
the only worker. --soak takes up to 3,000 elements along the contact (6,001 nodes, 12,000 unknowns).

Then jobs of hundreds of contacts, each with stated errors of its own, and of hundreds of load steps, whose results are
written: stopped at moments over all of their time. --soak takes 1,000 contacts, and 1,000 steps of 60.
"""

import time

from attack import SOAK, Attacked, Bystander, check, equal, example
from outside import long_contact, many_contacts

# elements along the contact
SIZES = (1_500, 2_000, 3_000) if SOAK else (1_500,)
# seconds from the end of a job to the start of the next; the machine may be at work for others
MOST_S = 1.0
# the smallest of the jobs takes several times as long
TIMEOUT_S = 2.0
# contacts and load steps, and the seconds after which a job is stopped
MANY = ((500, 1), (60, 300), (60, 1_000), (1_000, 1)) if SOAK else ((400, 1), (60, 300))
MOMENTS_S = (0.3, 0.6, 1.0, 1.5, 2.2, 3.0, 4.5, 6.0) if SOAK else (0.4, 0.8, 1.4, 2.2)


def seconds(text):
    """The seconds of an RFC 3339 time within its day, and its day."""
    date, clock = text.rstrip("Z").split("T")
    hours, minutes, rest = clock.split(":")
    return time.mktime(time.strptime(date, "%Y-%m-%d")) + 3600 * int(hours) + 60 * int(minutes) + float(rest)


def wait_until_running(server, job):
    for _ in range(2_000):
        if server.json("/v1/jobs/" + job)["status"] != "queued":
            return
        time.sleep(0.01)
    raise AssertionError("job %s was not started within 20 s" % job)


def gap(server, stopped, following):
    """Seconds from the end of one job to the start of the one behind it."""
    ended, began = server.finished(stopped), server.finished(following)
    equal(began["status"], "succeeded", "the job behind")
    return ended, seconds(began["started_at"]) - seconds(ended["finished_at"])


def attack(server, elements, stop_after):
    """One job stopped by its time limit, one canceled at `stop_after` seconds: the two gaps."""
    large, small = long_contact(elements), example()
    slow = server.submit(large, limits={"timeout_s": TIMEOUT_S})
    ended, by_time = gap(server, slow, server.submit(small))
    equal((ended["status"], ended["reason"]), ("failed", "timed_out"), "a job at its time limit")
    slow = server.submit(large)
    following = server.submit(small)
    wait_until_running(server, slow)
    time.sleep(stop_after)
    server.call("POST", "/v1/jobs/%s/cancel" % slow)
    ended, by_cancel = gap(server, slow, following)
    equal(ended["status"], "canceled", "a job that was canceled")
    return by_time, by_cancel


def attack_many(server, contacts, steps):
    """A job of many contacts and load steps, canceled at several moments: the longest gap, and how many were stopped."""
    large, small = many_contacts(contacts, steps), example()
    gaps = []
    for moment in MOMENTS_S:
        slow = server.submit(large)
        following = server.submit(small)
        wait_until_running(server, slow)
        time.sleep(moment)
        canceled = time.time()
        server.call("POST", "/v1/jobs/%s/cancel" % slow)
        ended, free = gap(server, slow, following)
        if ended["status"] == "canceled":
            # its end may be as late as the worker
            late = time.time() - canceled
            check(late <= 4 * MOST_S, "it ended and the next was done %.1f s after the cancel" % late)
            gaps.append(free)
    check(gaps, "every job of %d contacts and %d steps was done before it was stopped" % (contacts, steps))
    return max(gaps), len(gaps)


def main():
    told = []
    with Attacked("--workers", "1", "--memory-budget-bytes", str(6 << 30)) as server, Bystander(server):
        for elements in SIZES:
            gaps = []
            # in the factorisation of the body, and later, in that of the contact's matrix
            for stop_after in (1.0, 3.0, 6.0) if SOAK else (1.0,):
                gaps.extend(attack(server, elements, stop_after))
            told.append("%d elements along the contact: %.2f s" % (elements, max(gaps)))
            check(max(gaps) <= MOST_S, "the worker was free after %s s, %d elements" % (gaps, elements))
        for contacts, steps in MANY:
            longest, stopped = attack_many(server, contacts, steps)
            told.append("%d contacts in %d load steps: %.2f s (%d cancels)" % (contacts, steps, longest, stopped))
            check(longest <= MOST_S, "the worker was free after %.1f s, %d contacts, %d steps" % (longest, contacts, steps))
    print("figure: after a time-out or a cancel the worker was free within, at the most, " + "; ".join(told))


main()
