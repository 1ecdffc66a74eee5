"""A full disk: what is refused, what still works, and how soon all is well again (R5).

    full.py [--soak]

The store is on a volume of 64 MiB of its own, which is filled. Submissions are refused within a second; reading,
canceling, deleting and pausing work; a canceled job does not succeed. Two restarts on the full disk work. When there is
space again jobs are accepted within ten seconds, without a restart, and nothing is damaged. Needs `unshare`, and leave to mount.
"""

import pathlib
import subprocess
import time

from attack import SOAK, Attacked, Bystander, check, equal, example
from outside import BINARY, submission, talkative

ROUNDS = 10 if SOAK else 2
MOST_REFUSED_S, MOST_BACK_S = 1, 10
LONG = talkative(2000, refine=2)
slowest = {"refused": 0.0, "control": 0.0, "back": 0.0}


class Volume(Attacked):
    """A server in a mount namespace with a small volume of its own for the store."""

    def __init__(self):
        super().__init__("--workers", "2")
        self.data.mkdir()
        mount = 'mount -t tmpfs -o size=64m none "%s" && exec "$@"' % self.data
        self.wrapper = ("unshare", "--map-root-user", "--mount", "sh", "-c", mount, "sh")

    def keep(self):
        """A process that keeps the volume while the server is stopped, or the rest of the script for `doctor`."""
        enter = ["nsenter", "--user", "--mount", "--preserve-credentials", "--target"]
        self.keeper = subprocess.Popen([*enter, str(self.process.pid), "sleep", "3600"])
        time.sleep(0.5)
        self.wrapper = [*enter, str(self.keeper.pid)]

    def inside(self):
        return pathlib.Path("/proc/%d/root%s" % (self.process.pid, self.data))

    def fill(self):
        """To the last byte; the server's own files stay."""
        with (self.inside() / "filling").open("ab", buffering=0) as file:
            for size in (1 << 20, 1 << 12, 1 << 8):
                try:
                    while True:
                        file.write(bytes(size))
                except OSError:
                    pass

    def free(self):
        (self.inside() / "filling").unlink()

    def timed(self, kind, *request, **headers):
        began = time.monotonic()
        answer = self.call(*request, **headers)
        slowest[kind] = max(slowest[kind], time.monotonic() - began)
        return answer


def refuse(server):
    """Submits until the disk refuses; what SQLite has in hand already may suffice for a few."""
    bulky = submission(example(), name="x", labels={"l%d" % n: "y" * 60 for n in range(60)})
    for _ in range(3000):
        server.fill()
        answer = server.timed("refused", "POST", "/v1/jobs", bulky)
        if answer.status == 507:
            equal(answer.json()["code"], "storage-full", "the refusal")
            return
        equal(answer.status, 202, "submit on a disk that fills, %r" % answer)
    check(False, "the disk is never full")


def one_round(server):
    server.finished_job()
    ended = server.submit(example())
    equal(server.finished(ended)["status"], "succeeded", "a job before")
    running = [server.submit(LONG, limits={"timeout_s": 600}) for _ in range(2)]
    while any(server.json("/v1/jobs/" + job)["status"] != "running" for job in running):
        time.sleep(0.02)
    queued = [server.submit(example()) for _ in range(2)]
    refuse(server)
    with Bystander(server):
        control(server, ended, running, queued)
    server.fill()
    time.sleep(1)
    # the first start must not use up what the second needs
    for start in ("a start", "a second start"):
        server.stop()
        server.start()
        equal(server.call("GET", "/readyz").body.startswith(b"degraded"), True, "readiness of %s on a full disk" % start)
    equal(server.json("/v1/jobs/" + queued[1])["status"], "queued", "a job that waits, after a start on a full disk")
    equal(server.call("POST", "/v1/jobs", submission(example())).status, 507, "submit after a start on a full disk")
    # space again
    server.free()
    began = time.monotonic()
    body = submission(example())
    until(lambda: server.call("POST", "/v1/jobs", body).status == 202, MOST_BACK_S, "jobs are accepted again")
    slowest["back"] = max(slowest["back"], time.monotonic() - began)
    equal(server.call("POST", "/v1/queue/resume").status, 200, "resume")
    equal(server.call("POST", "/v1/jobs/%s/cancel" % running[1]).status, 200, "cancel")
    equal(server.finished(running[0])["status"], "canceled", "the job that was canceled on a full disk")
    equal(server.finished(queued[1])["status"], "succeeded", "the job that waited on a full disk")
    server.call("DELETE", "/v1/jobs?status=canceled,failed")


def control(server, ended, running, queued):
    """What works on a full disk: reads, and everything that control needs."""
    equal(server.timed("control", "GET", "/v1/jobs/%s/result" % ended).status, 200, "a result")
    equal(server.timed("control", "GET", "/v1/jobs").status, 200, "the list")
    waits = lambda: server.json("/v1/jobs/" + queued[0])["queue"]["reason"] == "low_disk"
    until(waits, 5, "a job that waits says that it is for the disk")
    answer = server.timed("control", "POST", "/v1/queue/pause")
    equal(answer.status, 200, "pause, %r" % answer)
    answer = server.timed("control", "POST", "/v1/jobs/%s/cancel" % queued[0])
    equal((answer.status, answer.json().get("outcome")), (200, "canceled"), "cancel of a queued job, %r" % answer)
    answer = server.timed("control", "POST", "/v1/jobs/%s/cancel" % running[0])
    equal((answer.status, answer.json().get("outcome")), (200, "cancel_requested"), "cancel, %r" % answer)
    answer = server.timed("control", "DELETE", "/v1/jobs/" + ended)
    equal(answer.status, 204, "delete, %r" % answer)
    equal(server.call("POST", "/v1/jobs", submission(example())).status, 507, "submit on a full disk")
    ready = server.call("GET", "/readyz")
    equal((ready.status, ready.body.startswith(b"degraded")), (200, True), "readiness, %r" % ready)
    until(lambda: server.json("/v1/jobs/" + running[0])["status"] == "canceled", 5, "the canceled job ends")


def until(holds, most_s, what):
    began = time.monotonic()
    while not holds():
        check(time.monotonic() < began + most_s, "%s: not within %g s" % (what, most_s))
        time.sleep(0.05)


def main():
    with Volume() as server:
        # the volume ends with its last process
        server.keep()
        try:
            for _ in range(ROUNDS):
                one_round(server)
            check("panicked" not in server.log.read_text(), "no panic")
            server.stop()
            done = subprocess.run([*server.wrapper, BINARY, "doctor", "--data", server.data], capture_output=True, text=True)
            equal(done.returncode, 0, "doctor: %s%s" % (done.stdout, done.stderr))
        finally:
            server.keeper.kill()
            server.keeper.wait()
    check(slowest["refused"] <= MOST_REFUSED_S, "a refusal took %.2f s" % slowest["refused"])
    print("figure: %d times a full volume of 64 MiB: refused with 507 within %.2f s, control and reads within %.2f s, "
          "jobs accepted again %.1f s after space was freed, nothing damaged" % (
              ROUNDS, slowest["refused"], slowest["control"], slowest["back"]))


main()
