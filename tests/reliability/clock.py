"""A clock that jumps while jobs wait and run (R7).

    clock.py [--soak]

The server's clock is set by an hour, by a day, to 1970 and back, while a job runs, another waits for its time limit and
a third runs into its own. No duration is negative or wrong by more than a second, no limit is early or late by more than
that, and jobs stay in the order in which they arrived; the same with worker processes. Needs Debian's `faketime`.
"""

import glob
import pathlib
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

from outside import Server, check, equal, example, talkative

LIBRARY = glob.glob("/usr/lib/*/faketime/libfaketime.so.1")
HOUR, DAY = 3600, 86400
TO_1970 = -int(time.time()) + 1000
ALL = [HOUR, -HOUR, DAY, -DAY, TO_1970]
JUMPS = {"thread": ALL, "process": ALL} if "--soak" in sys.argv else {"thread": [HOUR, -HOUR, TO_1970], "process": [-HOUR]}
LONG = talkative(8000, refine=5)  # several times as long as its limit on a fast machine, and its solver asks often whether to stop
# the queue looks once a second for jobs that have waited too long, and this machine may be busy
TOLERANCE_S = 1.3
worst = 0.0


def near(found, expected, what):
    global worst
    worst = max(worst, abs(found - expected))
    check(found >= 0, "%s: %r s" % (what, found))
    check(abs(found - expected) <= TOLERANCE_S, "%s: %.3f s, expected %.3f s" % (what, found, expected))


def jump(server, clock, seconds):
    """One jump, with a job running and others waiting."""
    order = []

    def submit(*arguments, **more):
        order.append(server.submit(*arguments, **more))
        return order[-1], time.monotonic()

    running, began = submit(LONG)
    while server.json("/v1/jobs/" + running)["status"] != "running":
        time.sleep(0.01)
    limited, limited_at = submit(LONG, limits={"timeout_s": 4})
    waiting, waiting_at = submit(example(), limits={"queue_ttl_s": 2}, priority=-5)
    patient, patient_at = submit(example(), limits={"queue_ttl_s": 600}, priority=-9)
    time.sleep(0.5)
    clock.write_text("%+d" % seconds)
    time.sleep(0.3)
    later, _ = submit(example(), priority=-10)
    expired = server.finished(waiting)
    near(time.monotonic() - waiting_at, 2, "time until a job expires in the queue")
    equal(expired["reason"], "queue_expired", "the job that waited too long")
    timed_out = server.finished(limited)
    equal(timed_out["reason"], "timed_out", "the job that ran too long")
    near(timed_out["run_s"], 4, "run_s of a job that timed out after 4 s")
    canceled_at = time.monotonic()
    equal(server.call("POST", "/v1/jobs/%s/cancel" % running).status, 200, "cancel")
    near(server.finished(running)["run_s"], canceled_at - began, "run_s of a job that was canceled")
    ended = server.finished(patient)
    equal(ended["status"], "succeeded", "a job that waited")
    near(ended["queue_wait_s"] + ended["run_s"], time.monotonic() - patient_at, "its time")
    equal(server.finished(later)["status"], "succeeded", "the last job")
    for job in order:
        for event, following in zip(*[iter(server.events(job)[i:]) for i in (0, 1)]):
            check(event["t"] <= following["t"], "times of the events of %s" % job)
    return order


def attack(isolation, jumps):
    """Jumps of the clock of a server, and of its worker processes."""
    order = []
    with tempfile.TemporaryDirectory() as folder:
        clock = pathlib.Path(folder) / "clock"
        clock.write_text("+0")
        faked = {"LD_PRELOAD": LIBRARY[0], "FAKETIME_TIMESTAMP_FILE": str(clock), "FAKETIME_NO_CACHE": "1",
                 "FAKETIME_DONT_FAKE_MONOTONIC": "1"}
        wrapper = ["env", *("%s=%s" % pair for pair in faked.items())]
        with Server("--workers", "2", "--memory-budget-bytes", str(4 << 30), "--isolation", isolation, wrapper=wrapper) as server:
            for seconds in jumps:
                order += jump(server, clock, seconds)
                check("the clock of the machine was set" in server.log.read_text(), "the log tells of it")
                equal([job["id"] for job in server.every_job()], order[::-1], "the list, newest first")
                # a restart with the clock as it is now, and another after it is right again
                server.stop()
                server.start()
                order.append(server.submit(example()))
                equal(server.finished(order[-1])["status"], "succeeded", "a job after a restart")
                clock.write_text("+0")
                server.stop()
                server.start()
                order.append(server.submit(example()))
                ended = server.finished(order[-1])
                near(ended["queue_wait_s"] + ended["run_s"], 0.2, "the time of a small job")
                equal([job["id"] for job in server.every_job()], order[::-1], "the list, newest first")


def main():
    check(LIBRARY, "Debian's faketime is needed")
    for isolation, jumps in JUMPS.items():
        attack(isolation, jumps)
    print("figure: jumps of the clock by %s: limits and durations right within %.2f s, none negative, jobs in order, also after "
          "restarts" % ("; ".join("%s s (isolation %s)" % (", ".join("%+d" % one for one in jumps), isolation)
                                  for isolation, jumps in JUMPS.items()), worst))


main()
