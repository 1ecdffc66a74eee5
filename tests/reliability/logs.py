"""A log that nobody reads, and signals that end a process which does not expect them: work goes on.

    logs.py [--soak]

Standard error is a pipe whose reader never reads: thousands of submits are answered. SIGHUP, and SIGXFSZ when a file
reaches the limit of the process, end nothing; what cannot be stored is refused and the rest is answered.
"""

import resource
import signal
import subprocess
import time

from attack import MIB, SOAK, Attacked, check, equal, example, submission

SUBMITS = 10000 if SOAK else 400


class Unread(Attacked):
    """A server whose log goes to a pipe that nobody reads."""

    def start(self):
        real = subprocess.Popen
        subprocess.Popen = lambda command, stdout, stderr: real(command, stdout=stdout, stderr=subprocess.PIPE)
        try:
            return super().start()
        finally:
            subprocess.Popen = real


def unread():
    with Unread() as server:
        server.call("POST", "/v1/queue/pause")
        longest = 0
        for _ in range(SUBMITS):
            began = time.monotonic()
            server.submit(example())
            longest = max(longest, time.monotonic() - began)
        check(longest < 5, "a submit took %.1f s" % longest)
        server.process.send_signal(signal.SIGTERM)
        equal(server.process.wait(timeout=15), 0, "exit code with a log that nobody reads")
        server.start()
        lost = b""
        server.process.kill()
    return "%d submits with an unread log, the longest %.0f ms; it stopped cleanly" % (SUBMITS, 1000 * longest)


def signals():
    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (24 * MIB, resource.RLIM_INFINITY))

    limited = ("prlimit", "--fsize=%d:" % (24 * MIB))
    with Attacked(wrapper=limited) as server:
        server.process.send_signal(signal.SIGHUP)
        job = server.finished_job()
        refused, statuses = 0, []
        for _ in range(2000):
            answer = server.call("POST", "/v1/jobs", submission(example(), labels={str(k): "x" * 250 for k in range(60)}))
            statuses.append(answer.status)
            if answer.status == 507:
                refused += 1
                if refused > 3:
                    break
        check(refused > 3, "no submit was refused: %r" % statuses[-5:])
        equal(server.call("GET", "/v1/jobs/" + job).status, 200, "a read with a full store")
        server.stop()
    return "SIGHUP and SIGXFSZ survived; %d submits until a file limit of 24 MiB, then 507" % statuses.count(202)


print("figure: " + "; ".join([unread(), signals()]))
