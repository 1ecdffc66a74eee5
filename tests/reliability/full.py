"""A full disk: what is refused, what still works, and how soon all is well again (R5).

    full.py [--soak]

The store is on a volume of 64 MiB of its own, which is filled, in the end by the store itself: with the results of jobs, with
the rows of a sweep, with meshes, which are then deleted. Submissions are refused within a second; reading,
canceling, deleting and pausing work; a canceled job does not succeed. Two restarts on the full disk work. When there is
space again jobs are accepted within ten seconds, without a restart, and nothing is damaged. Needs `unshare`, and leave to mount.
"""

import os
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
        return pathlib.Path("/proc/%d/root%s" % (self.keeper.pid, self.data))

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
    # the first start must not use up what the second needs
    for start in ("a start", "a second start"):
        server.stop()
        server.fill()  # what the write-ahead log has given back
        server.start()
        until(lambda: is_full(server), 5, "the disk is full after %s" % start)
    equal(server.json("/v1/jobs/" + queued[1])["status"], "queued", "a job that waits, after a start on a full disk")
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


def is_full(server):
    """Whether a submit is refused, and readiness says so: between the two the store may have given space back."""
    refused = server.call("POST", "/v1/jobs", submission(example())).status == 507
    ready = server.call("GET", "/readyz")
    equal(ready.status, 200, "readiness, %r" % ready)
    return refused and ready.body.startswith(b"degraded")


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
    # the space of what was deleted may suffice for a few
    until(lambda: is_full(server), 5, "submits are refused on a full disk")
    until(lambda: server.json("/v1/jobs/" + running[0])["status"] == "canceled", 5, "the canceled job ends")


def many_contacts(count):
    """A strip with contacts side by side: each member of a sweep over it keeps half a kilobyte."""
    parts = {"c%d" % i: {"side": "top", "x": [i / count - 1e-9, (i + 0.5) / count + 1e-9]} for i in range(count)}
    return {
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [i / (2 * count) for i in range(2 * count + 1)], "y": [0, 0.5, 1]}, "boundaries": parts},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": name, "obstacle": {"kind": "flat"}, "indentation": 0.01} for name in parts],
    }


def mesh(number, lines=60):
    """A deck with a square of elements of eight nodes, of another size for each number."""
    side, text, numbers = 2 * lines + 1, ["*NODE"], {}
    for row in range(side):
        for column in range(side):
            if row % 2 == 0 or column % 2 == 0:
                numbers[row, column] = len(numbers) + 1
                text.append("%d, %r, %r" % (len(numbers), column * (1 + number / 100) / side, row / side))
    text.append("*ELEMENT, TYPE=CPE8, ELSET=ALL")
    places = ((0, 0), (0, 2), (2, 2), (2, 0), (0, 1), (1, 2), (2, 1), (1, 0))
    for row in range(0, side - 1, 2):
        for column in range(0, side - 1, 2):
            nodes = [numbers[row + down, column + right] for down, right in places]
            text.append(", ".join(map(str, [len(text), *nodes])))
    return ("\n".join(text) + "\n").encode()


class Jobs:
    """Results of jobs, deleted by a filter."""

    free = 16 << 20  # bytes

    def __init__(self, server):
        self.server, self.number = server, 0

    def fill(self):
        self.number += 1
        problem = example(refine=4)
        problem["contacts"][0]["indentation"] *= 1 + self.number / 1000
        answer = self.server.call("POST", "/v1/jobs", submission(problem, labels={"kind": "filling"}), prefer="wait=5")
        return answer.status

    def remove(self):
        equal(self.server.call("POST", "/v1/jobs/cancel?label.kind=filling").status, 200, "cancel by a filter")
        left = lambda: self.server.json("/v1/jobs/count?label.kind=filling&status=queued,running")["total"]
        until(lambda: left() == 0, 10, "the canceled jobs end")
        equal(self.server.call("DELETE", "/v1/jobs?label.kind=filling").status, 200, "deletion by a filter")


class Meshes:
    """Meshes, deleted one by one."""

    free = 16 << 20

    def __init__(self, server):
        self.server, self.hashes, self.number = server, [], 0

    def fill(self):
        self.number += 1
        # where no large file fits any more the disk is not full yet
        for lines in (60, 10):
            answer = self.server.call("POST", "/v1/meshes", mesh(self.number, lines), content_type="application/octet-stream")
            check(answer.status in (201, 507), "an upload to a disk that fills: %r" % answer)
            if answer.status == 201:
                self.hashes.append(answer.json()["hash"])
                break
        return answer.status

    def remove(self):
        for name in self.hashes:
            equal(self.server.call("DELETE", "/v1/meshes/" + name).status, 204, "deletion of a mesh on a full disk")


class Sweep:
    """A sweep, canceled and deleted while its rows cannot be stored."""

    free = 4 << 20  # less than ten thousand rows take

    def __init__(self, server):
        self.server, self.id = server, None

    def fill(self):
        if self.id is None:
            values = [0.001 + 1e-6 * n for n in range(10000)]
            axes = [{"path": "/contacts/0/indentation", "values": values}]
            answer = self.server.call("POST", "/v1/sweeps", {"base": many_contacts(60), "axes": axes})
            equal(answer.status, 202, "a sweep, %r" % answer)
            self.id = answer.json()["id"]
        time.sleep(0.2)
        return self.server.call("POST", "/v1/jobs", submission(example())).status

    def remove(self):
        # a job that cannot store what it has found says why it does not go on
        jobs = self.server.json("/v1/jobs?status=running")["jobs"]
        equal([job["progress"]["stage"] for job in jobs], ["low_disk"] * len(jobs), "the stage of running jobs")
        equal(self.server.call("POST", "/v1/sweeps/%s/cancel" % self.id).status, 200, "cancel of a sweep")
        deleted = lambda: self.server.call("DELETE", "/v1/sweeps/" + self.id).status == 204
        until(deleted, 10, "the canceled sweep is deleted")


def filled_by_itself(server, kind):
    """The store fills its disk, and has all of the space again that deletions free."""
    what = kind(server)
    free = os.statvfs(server.inside())
    (server.inside() / "filling").write_bytes(bytes(free.f_bavail * free.f_frsize - kind.free))
    began = time.monotonic()
    while not (what.fill() == 507 and is_full(server)):
        check(time.monotonic() < began + 180, "%s: the disk is never full" % kind.__doc__)
    what.remove()
    began = time.monotonic()
    body = submission(example())
    until(lambda: server.call("POST", "/v1/jobs", body).status == 202, MOST_BACK_S, "jobs are accepted again: %s" % kind.__doc__)
    slowest["back"] = max(slowest["back"], time.monotonic() - began)
    size = lambda name: (server.inside() / name).stat().st_size
    equal(size("signorini.reserve"), 16 << 20, "the reserve")
    equal(size("signorini.progress"), 81, "the record of the progress")
    # it is given back little by little
    until(lambda: size("signorini.db") < 12 << 20, 30, "the database keeps less than 12 MiB")
    server.free()
    until(lambda: server.json("/v1/jobs/count?status=queued,running")["total"] == 0, 30, "the jobs end")
    server.call("DELETE", "/v1/jobs?status=succeeded,canceled,failed")


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
            for kind in (Jobs, Meshes, Sweep):
                filled_by_itself(server, kind)
            check("panicked" not in server.log.read_text(), "no panic")
            server.stop()
            done = subprocess.run([*server.wrapper, BINARY, "doctor", "--data", server.data], capture_output=True, text=True)
            equal(done.returncode, 0, "doctor: %s%s" % (done.stdout, done.stderr))
        finally:
            server.keeper.kill()
            server.keeper.wait()
    check(slowest["refused"] <= MOST_REFUSED_S, "a refusal took %.2f s" % slowest["refused"])
    print("figure: %d times a full volume of 64 MiB, and three times one that the store has filled: refused with 507 within %.2f s, control and reads within %.2f s, "
          "jobs accepted again %.1f s after space was freed, nothing damaged" % (
              ROUNDS, slowest["refused"], slowest["control"], slowest["back"]))


main()
