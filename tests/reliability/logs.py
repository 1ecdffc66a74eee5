"""A log that nobody reads, and signals that end a process which does not expect them: work goes on.

    logs.py [--soak]

Standard error is a pipe whose reader never reads: thousands of submits are answered. SIGHUP, and SIGXFSZ when a file
reaches the limit of the process, end nothing; what cannot be stored is refused and the rest is answered.
"""

import os
import signal
import time

from attack import MIB, SOAK, Attacked, Bystander, check, equal, example
from outside import submission

SUBMITS = 10000 if SOAK else 400


class Unread(Attacked):
    """A server whose log goes to a pipe that nobody reads."""

    def open_log(self):
        self.log.touch()
        self.unread, log = map(os.fdopen, os.pipe(), ("rb", "wb"))
        return log


def unread():
    with Unread() as server:
        server.finished_job()
        server.call("POST", "/v1/queue/pause")
        longest = 0
        with Bystander(server):
            for _ in range(SUBMITS):
                began = time.monotonic()
                server.submit(example())
                longest = max(longest, time.monotonic() - began)
        check(longest < 5, "a submit took %.1f s" % longest)
        server.process.send_signal(signal.SIGTERM)
        equal(server.process.wait(timeout=15), 0, "exit code with a log that nobody reads")
    return "%d submits with an unread log, the longest %.0f ms; it stopped cleanly" % (SUBMITS, 1000 * longest)


def signals():
    limited = ("prlimit", "--fsize=%d:" % (24 * MIB))
    with Attacked(wrapper=limited) as server:
        server.process.send_signal(signal.SIGHUP)
        job, statuses = server.finished_job(), []
        with Bystander(server):
            while len(statuses) < 2000 and statuses.count(507) <= 3:
                bulky = submission(example(), labels={str(k): "x" * 250 for k in range(60)})
                statuses.append(server.call("POST", "/v1/jobs", bulky).status)
        check(statuses.count(507) > 3, "no submit was refused: %r" % statuses[-5:])
        equal(server.call("GET", "/v1/jobs/" + job).status, 200, "a read with a full store")
        server.stop()
    return "SIGHUP and SIGXFSZ survived; %d submits until a file limit of 24 MiB, then 507" % statuses.count(202)


print("figure: " + "; ".join([unread(), signals()]))
