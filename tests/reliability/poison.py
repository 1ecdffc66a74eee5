"""Jobs that kill their worker process cost only themselves (R21), with `serve --isolation process`.

    poison.py [--soak]

What a poisoned job would do to its process is done to it from outside, with the real binary: it aborts, meets an
illegal instruction, is killed by the system, loops without end and hears nothing. (The unit tests `rpc::worker::processes` have
solvers that do so themselves, and one whose stack overflows.) A job whose process dies is tried again, fails as `worker_lost` after three attempts, and
another one beside it and the next one succeed each time.
"""

import os
import pathlib
import signal
import time

from attack import SOAK, Attacked, Bystander, check, cpu_s, equal, example
from outside import children, talkative

ROUNDS = 20 if SOAK else 2
LONG = talkative(3000, refine=3)
DEATHS = {"abort": signal.SIGABRT, "illegal instruction": signal.SIGILL, "killed by the system": signal.SIGKILL}
# what the API promises for a cancel; a worker is free a second after the end, and a new process starts
MOST_CANCEL_S, MOST_FREE_S = 0.5, 1.5
MARGIN_S = 0.0 if SOAK else 1.0


class Processes(Attacked):
    def workers(self):
        return children(self.process.pid)

    def worker_of(self, job):
        """The process that solves a job: the only one at work."""
        while self.json("/v1/jobs/" + job)["status"] != "running":
            time.sleep(0.005)
        before = {pid: cpu_s(pid) for pid in self.workers()}
        while True:
            time.sleep(0.03)
            busy = [pid for pid in self.workers() if cpu_s(pid) > before.get(pid, 0)]
            if busy:
                return busy[0]


def dies(server, how, number):
    """A job whose process dies in each attempt."""
    job = server.submit(LONG)
    for attempt in (1, 2, 3):
        while server.json("/v1/jobs/" + job)["attempt"] < attempt:
            time.sleep(0.005)
        pid = server.worker_of(job)
        os.kill(pid, number)
        while pid in server.workers():
            time.sleep(0.005)
    ended = server.finished(job)
    equal((ended["status"], ended["reason"], ended["attempt"]), ("failed", "worker_lost", 3), how)
    check("3 attempts" in ended["failure"]["detail"], "%s: %r" % (how, ended["failure"]))
    requeued = [event for event in server.events(job) if event["type"] == "status" and event.get("reason") == "worker_lost"]
    equal(len(requeued), 2, "%s: events of its loss" % how)
    equal(server.finished(server.submit(example()))["status"], "succeeded", "%s: the next job" % how)


def hangs(server):
    """A job whose process hears nothing any more: it is killed when the job is canceled, or reaches its time limit."""
    job = server.submit(LONG)
    pid = server.worker_of(job)
    os.kill(pid, signal.SIGSTOP)
    began = time.monotonic()
    server.call("POST", "/v1/jobs/%s/cancel" % job)
    equal(server.finished(job)["status"], "canceled", "a job whose process hangs")
    canceled = time.monotonic() - began
    equal(server.finished(server.submit(example()))["status"], "succeeded", "the next job")
    free = time.monotonic() - began
    check(canceled <= MOST_CANCEL_S + MARGIN_S, "canceled after %.2f s" % canceled)
    while pid in server.workers():
        time.sleep(0.005)
    gone = time.monotonic() - began
    check(gone <= MOST_CANCEL_S + MOST_FREE_S + MARGIN_S, "its process was there for %.2f s" % gone)
    return canceled, max(free, gone)


def main():
    worst, deaths = (0.0, 0.0), 0
    with Processes("--isolation", "process", "--workers", "1") as server:
        with Bystander(server):
            for _ in range(ROUNDS):
                for how, number in DEATHS.items():
                    dies(server, how, number)
                    deaths += 3
                worst = tuple(map(max, worst, hangs(server)))
        pids = server.workers()
        equal(len(pids), 1, "worker processes at the end")
        server.stop()
        began = time.monotonic()
        while any(pathlib.Path("/proc/%d" % pid).exists() for pid in pids):
            check(time.monotonic() < began + 5, "a worker process has outlived the service")
            time.sleep(0.01)
    print("figure: %d worker processes died (%s): %d jobs failed as worker_lost after 3 attempts, each next job succeeded; a "
          "job whose process hung was canceled after %.2f s, its worker free after %.2f s" % (
              deaths, ", ".join(DEATHS), deaths // 3, *worst))


main()
