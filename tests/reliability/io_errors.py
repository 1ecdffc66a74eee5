"""The n-th write, sync, truncation, removal, opening or reading of a file fails, for n = 1, 2, 3, … (R3).

    io_errors.py [--soak] [SEED]

Once or from then on, with each errno that a disk gives, or half of the bytes are written. Meanwhile a job is submitted,
followed, read and deleted: each answer is as always, or tells of the error in a problem document; the server lives, a
job that was accepted ends as it must, and one that was refused is not there. When the disk works again the next job
runs at once. The same while the server starts and stops. Without --soak some of the n, with it every one, until a whole
job does not meet the fault any more.
"""

import collections
import errno
import http.client
import random
import sys
import time

from attack import SOAK, check, equal, example
from outside import submission
from faults import FOREVER, HALF, Faulty, check_database

SEED = next((int(word) for word in sys.argv[1:] if word.isdigit()), random.randrange(1 << 32))
# mean distance of the n that are tried
STRIDE = 1 if SOAK else 15
FAULTS = [(error, count) for error in (errno.EIO, errno.ENOSPC, errno.EDQUOT) for count in (1, FOREVER)] + [
    (errno.EROFS, FOREVER), (errno.EINTR, 1), (HALF, 1)]
# a disk that works again; then the longest pause between two attempts to store something
SOON_S, LATEST_S = 5, 12
MOST_READS = 60 if SOAK else 10
STARTS = range(1, 61) if SOAK else range(1, 61, 5)
ENDED = ("succeeded", "failed", "canceled")

told = collections.Counter()


def named(error, count):
    name = "half a write" if error == HALF else errno.errorcode[error]
    return name + (" once" if count == 1 else " from then on")


def clean(answer, good, error, what):
    """Whether it is as always; otherwise it must say that the disk failed, or is full."""
    told[what, answer.status] += 1
    if answer.status in good:
        return True
    wanted = [(500, "internal"), (507, "storage-full")]
    check(answer.headers.get("content-type") == "application/problem+json", "%s: no problem document: %r" % (what, answer))
    found = (answer.status, answer.json()["code"])
    check(found in wanted, "%s: %r" % (what, answer))
    return False


def until_ended(server, job, seconds):
    """The job, ended or not, after so long."""
    return server.call("GET", "/v1/jobs/%s?wait=%g&until=terminal" % (job, seconds)).json()


def next_job_runs(server):
    """Soon nothing of the fault is left: the service looks once a second whether the disk can be written."""
    began = time.monotonic()
    while (answer := server.call("POST", "/v1/jobs", submission(example()))).status == 507:
        check(time.monotonic() < began + SOON_S, "the disk works, and is still said to be full")
        time.sleep(0.05)
    equal(answer.status, 202, "the next job, %r" % answer)
    job = answer.json()["id"]
    equal(until_ended(server, job, SOON_S)["status"], "succeeded", "the next job within %d s" % SOON_S)
    equal(server.call("DELETE", "/v1/jobs/" + job).status, 204, "deleting the next job")
    equal(server.call("GET", "/readyz").status, 200, "ready when the disk works again")


def attempt(server, n, error, count):
    """A job while the n-th call fails. Whether the fault was met."""
    server.fail(n, error, count)
    name = "%s, call %d" % (named(error, count), n)
    answer = server.call("POST", "/v1/jobs", submission(example(), name=name))
    accepted, met = clean(answer, (202,), error, "submit"), 0
    if accepted:
        job = answer.json()["id"]
        # with a lasting fault it cannot end, unless it had ended before
        found = until_ended(server, job, 0.3 if count == FOREVER else LATEST_S)
        if count == FOREVER and found["status"] not in ENDED:
            lasting(server, job, error)
            met = server.heal()
            found = until_ended(server, job, LATEST_S)
        equal(found["status"], "succeeded", "%s: an accepted job" % name)
        events = server.events(job)
        equal([event["seq"] for event in events], list(range(1, len(events) + 1)), "%s: its events" % name)
        equal([event["type"] for event in events].count("done"), 1, "%s: its ends" % name)
        equal(server.call("GET", "/v1/jobs/%s/result" % job).status, 200, "%s: its result" % name)
        deleted = clean(server.call("DELETE", "/v1/jobs/" + job), (204,), error, "delete")
        status = server.call("GET", "/v1/jobs/" + job).status
        equal(status, 410 if deleted else 200, "%s: after a deletion that was%s answered with 204" % (name, "" if deleted else " not"))
    elif count == FOREVER:
        lasting(server, None, error)
    met += server.heal()
    check(server.process.poll() is None, "%s: the server ended" % name)
    if not accepted:
        listed = [job["id"] for job in server.json("/v1/jobs?page_size=50")["jobs"] if job["name"] == name]
        equal(listed, [], "%s: a job that was refused" % name)
    elif not deleted:
        equal(server.call("DELETE", "/v1/jobs/" + job).status, 204, "%s: deleting it when the disk works" % name)
    next_job_runs(server)
    return met


def lasting(server, job, error):
    """What a server does whose disk takes nothing any more: it reads, and says why it does not write."""
    for path in ("/livez", "/v1/jobs", "/v1/queue", "/v1/info", *(["/v1/jobs/" + job] if job else [])):
        equal(server.call("GET", path).status, 200, "GET %s on a disk that takes nothing" % path)
    answer = server.call("POST", "/v1/jobs", submission(example()))
    check(not clean(answer, (202,), error, "submit again"), "a job was accepted on a disk that takes nothing")
    if error == errno.ENOSPC:
        equal(answer.status, 507, "submit again on a full disk")


def stop_and_check(server, n, error, count):
    """Faults while it stops; what is left is whole."""
    server.fail(n, error, count)
    server.stop()
    server.heal()
    check_database(server)
    server.start()


def jobs_under_faults(dice):
    """How many faults were met, and what did not hold: the first of each kind, since others may tell why."""
    met, broken = 0, []
    with Faulty() as server:
        kept = server.finished_job()
        for error, count in FAULTS:
            began, n, last = time.monotonic(), 0, False
            while not last:
                n += 1 if SOAK else dice.randrange(1, 2 * STRIDE)
                check(n < 5000, "a job that has more than 5000 calls")
                try:
                    last = not attempt(server, n, error, count)
                    if n % 8 == 0:
                        stop_and_check(server, dice.randrange(1, 20), error, count)
                except (AssertionError, OSError, http.client.HTTPException) as wrong:
                    broken.append("%s, call %d: %s" % (named(error, count), n, wrong))
                    print(broken[-1], *server.log.read_text().splitlines()[-3:], sep="\n  ", flush=True)
                    server.kill()
                    server.heal()
                    server.start()
                    last = True  # the next calls would only take long to find the same
                met += not last
            print("%s: up to call %d, %.0f s" % (named(error, count), n, time.monotonic() - began), flush=True)
        stop_and_check(server, 1, errno.EIO, FOREVER)
        equal(server.json("/v1/jobs/" + kept)["status"], "succeeded", "a job from before the faults")
        server.stop()
        check_database(server)
    return met, broken


def reads_under_faults():
    """The disk fails to read once. Whoever asked is told; everybody else is served, and the next job runs."""
    met, n, missed = 0, 0, 0
    with Faulty() as server:
        kept = server.finished_job()
        while missed < 3 and n < MOST_READS:
            n += 1
            server.fail_read(n)
            name = "reading, call %d" % n
            answer = server.call("POST", "/v1/jobs", submission(example(), name=name, cache="off"))
            if answer.status == 202:
                # its worker may have given up: then it is started again; what cannot be read of it fails it
                found = until_ended(server, answer.json()["id"], LATEST_S)
                if found.get("code") == "corrupt-data":  # it was this answer that was not read
                    found = until_ended(server, answer.json()["id"], LATEST_S)
                check((found["status"], found["reason"]) in (("succeeded", None), ("failed", "internal")), "%s: %r" % (name, found))
            else:
                equal((answer.status, answer.json()["code"]), (500, "corrupt-data"), "%s: %r" % (name, answer))
            for path in ("/v1/jobs/" + kept, "/v1/jobs/%s/result" % kept, "/v1/jobs?page_size=5"):
                answer = server.call("GET", path)
                check(answer.status in (200, 500), "%s: %r" % (name, answer))
            failed = server.heal()
            met, missed = met + failed, 0 if failed else missed + 1
            next_job_runs(server)
            # what SQLite has in memory it does not read
            if n % 3 == 0:
                server.stop()
                server.start()
        server.stop()
        check_database(server)
    return met


def starts_under_faults():
    """A server whose n-th call fails while it starts: it runs, or ends with its reason; the next start is as usual."""
    refused = 0
    for n in STARTS:
        server = Faulty()
        server.fail(n, errno.ENOSPC if n % 2 else errno.EIO)
        try:
            try:
                server.start()
            except (AssertionError, OSError, http.client.HTTPException):
                refused += 1
                code = server.process.wait(timeout=10)
                check(code > 0, "it ended with %d" % code)
                log = server.log.read_text(errors="replace").strip()
                check(log and "panicked" not in log, "it gave no reason: %r" % log)
                server.heal()
                server.start()
            server.heal()
            next_job_runs(server)
            server.stop()
            check_database(server)
        except BaseException:
            server.__exit__(AssertionError)
            raise
        server.__exit__(None)
    return refused


def main():
    print("seed %d" % SEED, flush=True)
    dice = random.Random(SEED)
    refused = starts_under_faults()
    print("%d starts under faults, %d of them refused" % (len(STARTS), refused), flush=True)
    reads = reads_under_faults()
    check(reads, "no read has failed")
    met, broken = jobs_under_faults(dice)
    print(", ".join("%s %d: %d ×" % (*key, count) for key, count in sorted(told.items())))
    check(not broken, "%d of %d faults were not overcome; the first: %s" % (len(broken), met, broken[:1]))
    print("figure: %d faults in a job's writes, syncs, truncations and openings (EIO, ENOSPC, EDQUOT, EROFS, EINTR, half writes; "
          "once or from then on): every answer clean, 0 accepted jobs lost, the next job ran each time; %d faults while "
          "starting: %d refused with a reason, all started afterwards; %d reads that failed once were told, and disturbed no other "
          "job" % (met, len(STARTS), refused, reads))


main()
