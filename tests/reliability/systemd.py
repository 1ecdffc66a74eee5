"""What systemd is told, on a real socket: ready, alive, stopping (R18c). And the unit of contrib/systemd, if systemd's own
tool is there to check it.

    systemd.py [--soak]

READY comes once the service answers, and after the first line of its output; WATCHDOG in time for as long as the store
answers. Another process takes the lock that the single writer needs: no WATCHDOG comes until it gives it back, and jobs
are solved then. STOPPING comes before the end. With --soak systemd-analyze has to be there.
"""

import os
import pathlib
import re
import shutil
import socket
import sqlite3
import subprocess
import tempfile
import time

from attack import SOAK, check, equal, example
from outside import BINARY, Server, TOP, talkative

WATCHDOG_S = 1.5
UNIT = TOP / "contrib/systemd/signorini.service"
MOST_EXPOSURE = 2.0


class Notified(Server):
    """A server that tells us what it would tell systemd."""

    def __init__(self, *options):
        super().__init__(*options)
        name = str(pathlib.Path(self.folder.name) / "notify")
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(name)
        self.wrapper = ("env", "NOTIFY_SOCKET=" + name, "WATCHDOG_USEC=%d" % (WATCHDOG_S * 1e6))

    def told(self, seconds):
        """Each message of the next seconds, with its time."""
        end, found = time.monotonic() + seconds, []
        while (left := end - time.monotonic()) > 0:
            self.socket.settimeout(left)
            try:
                found.append((time.monotonic(), self.socket.recv(4096).decode().splitlines()))
            except TimeoutError:
                break
        return found

    def beats(self, seconds):
        return [when for when, lines in self.told(seconds) if "WATCHDOG=1" in lines]


def health(url):
    done = subprocess.run([BINARY, "health", "--url", url], capture_output=True, text=True, timeout=10)
    return done.returncode, done.stdout


def live():
    longest = 0.0
    with Notified() as server:
        # `start` has read the first line of output, and has been answered
        (_, first), = [(when, lines) for when, lines in server.told(0.5) if "READY=1" in lines]
        check(any(line.startswith("STATUS=http://") for line in first), "READY with %r" % first)
        beats = server.beats(2 * WATCHDOG_S)
        longest = max(after - before for before, after in zip(beats, beats[1:]))
        check(longest < WATCHDOG_S, "%.2f s between two beats" % longest)
        # it runs until it is canceled: what has not changed between two beats is not told again
        job = server.submit(talkative(8000, refine=3))
        statuses = [line for _, lines in server.told(2 * WATCHDOG_S) for line in lines if line.startswith("STATUS=")]
        check(statuses and all(re.search(r"\b1 job running", line) for line in statuses), "%r" % statuses)
        equal(server.call("POST", "/v1/jobs/%s/cancel" % job).status, 200, "cancel")
        server.finished(job)

        # the writer cannot get its lock
        connection = sqlite3.connect(server.data / "signorini.db", isolation_level=None)
        connection.execute("begin immediate")
        began = time.monotonic()
        late = [when - began for when in server.beats(3) if when - began > 1]
        equal(late, [], "beats while the store cannot write")
        connection.execute("rollback")
        connection.close()
        check(len(server.beats(2 * WATCHDOG_S)) >= 2, "no beats after the lock was given back")
        equal(server.finished(server.submit(example(), cache="refresh"))["status"], "succeeded", "a job after that")
        equal(health(server.url), (0, "ok\n"), "signorini health")

        server.stop()
        check(any("STOPPING=1" in lines for _, lines in server.told(0.5)), "no STOPPING")
        equal(health(server.url), (1, ""), "signorini health of a service that has stopped")
    return longest


def unit():
    """What systemd finds wrong with the unit, and how exposed it calls the service."""
    analyze = shutil.which("systemd-analyze")
    if not analyze:
        check(not SOAK, "systemd-analyze is missing (Debian's systemd)")
        return "the unit not checked here"
    with tempfile.TemporaryDirectory() as folder:
        # with a program and a user that are there
        copy = pathlib.Path(folder) / "signorini.service"
        text = UNIT.read_text().replace("/usr/local/bin/signorini", str(BINARY))
        copy.write_text(text.replace("User=signorini", "User=daemon").replace("Group=signorini", "Group=daemon"))
        done = subprocess.run([analyze, "verify", "--man=no", copy], capture_output=True, text=True)
        told = [line for line in (done.stdout + done.stderr).splitlines() if "signorini" in line]
        equal((done.returncode, told), (0, []), "systemd-analyze verify")
        done = subprocess.run([analyze, "security", "--offline=yes", copy], capture_output=True, text=True, env={**os.environ, "LC_ALL": "C"})
        exposure = re.search(r"Overall exposure level for \S+: ([\d.]+)", done.stdout)
        check(exposure, "systemd-analyze security: %s %s" % (done.stdout[-500:], done.stderr))
        check(float(exposure[1]) <= MOST_EXPOSURE, "exposure %s" % exposure[1])
        return "the unit verified, exposure level %s" % exposure[1]


def main():
    found = unit()
    longest = live()
    print("figure: ready, alive and stopping are told, at most %.2f s between two beats of a watchdog of %.1f s, and none "
          "while the store cannot write; %s" % (longest, WATCHDOG_S, found))


main()
