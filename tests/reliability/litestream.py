"""Litestream beside the service, and what is restored from its replica (R31).

    litestream.py [--soak]

Jobs are submitted while Litestream copies the write-ahead log, with the configuration of docs/operations.md but for its
paths. Then the service and Litestream are killed at once, as when a machine is lost. What was acknowledged more than a
second before that is in the restored store; jobs that had ended have the same bytes in every answer as in the original
store, started again, and the others are solved.
"""

import pathlib
import re
import subprocess
import sys
import tempfile
import threading
import time

from attack import SOAK, check, equal, example
from backups import EXAMPLES, answers, run
from outside import TERMINAL, TOP, Server

ROUNDS = 20 if SOAK else 2
LOAD_S = 4
# the promise
MOST_LOST_S = 1
LITESTREAM = pathlib.Path(sys.executable).parent / "litestream"


def configuration(folder, store, replica):
    """The one that is documented, with other paths."""
    page = (TOP / "docs/operations.md").read_text()
    text = re.search(r"```yaml\n# /etc/litestream.yml\n(.*?)```", page, re.S).group(1)
    for documented, here in (("/var/lib/signorini", store), ("/var/backups/signorini-litestream", replica)):
        check(documented in text, "%s is not in the documented configuration" % documented)
        text = text.replace(documented, str(here))
    file = folder / "litestream.yml"
    file.write_text(text)
    return file


class Load(threading.Thread):
    """Submits until the service is gone; when each job was acknowledged."""

    def __init__(self, server):
        super().__init__()
        self.server, self.acknowledged, self.failure = server, {}, None

    def run(self):
        number = 0
        try:
            while True:
                number += 1
                job = self.server.submit(example(EXAMPLES[number % 5]), cache="refresh")
                self.acknowledged[job] = time.monotonic()
                time.sleep(0.03)
        except OSError as error:  # it was killed
            self.failure = error


def one_round(folder):
    """How many jobs the restored store has, and how long before the end the first lost one was acknowledged."""
    replica = folder / "replica"
    with Server() as server:
        file = configuration(folder, server.data, replica)
        with (folder / "log").open("w") as log:
            copying = subprocess.Popen([LITESTREAM, "replicate", "-config", file], stdout=log, stderr=log)
        load = Load(server)
        load.start()
        time.sleep(LOAD_S)
        check(copying.poll() is None, "Litestream has ended: " + (folder / "log").read_text()[-2000:])
        copying.kill()
        copying.wait()
        killed = time.monotonic()
        server.kill()
        load.join(60)
        check(load.failure is not None, "the load goes on without a service")
        server.start()  # it was not harmed
        restored = Server()
        restored.data.mkdir(mode=0o700)
        command = [LITESTREAM, "restore", "-config", file, "-o", restored.data / "signorini.db", server.data / "signorini.db"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
        equal(done.returncode, 0, "litestream restore: " + done.stderr)
        with restored:
            there = {job["id"] for job in restored.every_job()}
            # not those that were acknowledged while one of both was killed already
            before = {job: at for job, at in load.acknowledged.items() if at < killed}
            check(len(before) > 20, "only %d jobs were acknowledged" % len(before))
            lost = max((killed - at for job, at in before.items() if job not in there), default=0)
            check(lost <= MOST_LOST_S, "a job that was acknowledged %.2f s before the end is lost" % lost)
            for job in there:
                here = restored.finished(job)
                equal(here["status"], "succeeded", "a restored job")
                events = restored.events(job)
                equal([event["seq"] for event in events], list(range(1, len(events) + 1)), "the numbers of its events")
                equal([event["type"] for event in events].count("done"), 1, "its ends")
                if server.finished(job)["finished_at"] == here["finished_at"]:
                    equal(answers(restored, job), answers(server, job), "what is told of %s, which had ended" % job)
            restored.stop()
            run("doctor", "--data", restored.data)
        check(all(job["status"] in TERMINAL for job in server.every_job()), "every job of the original store has ended")
        server.stop()
    return len(there), lost


def main():
    found = []
    for _ in range(ROUNDS):
        with tempfile.TemporaryDirectory() as folder:
            found.append(one_round(pathlib.Path(folder)))
    version = subprocess.run([LITESTREAM, "version"], capture_output=True, text=True, check=True).stdout.strip()
    print("figure: Litestream %s beside the service, both killed %d times: of jobs that had been acknowledged the last %.2f s at most were "
          "lost, %d restored ones equal the original ones or were solved" % (
              version, ROUNDS, max(lost for _, lost in found), sum(jobs for jobs, _ in found)))


main()
