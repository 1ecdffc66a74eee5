"""Backups under load, and what is restored from them (R31).

    backups.py [--soak] [SEED]

Jobs are submitted and meshes uploaded and deleted while backups are made. Each is restored to a folder of its own and
served: what was acknowledged before it began is there, jobs that had ended have the same bytes in every answer, and
those that had not are solved, to fields with the same digest. A backup that is killed, or whose disk is full, at the n-th
write leaves nothing under its name, and the next one works. What is changed in a backup is noticed. A store with tokens
stays closed.
"""

import contextlib
import hashlib
import json
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import threading
import time

from attack import SOAK, check, equal, example
from faults import DIE, Faulty
from outside import BINARY, TERMINAL, TOP, Server, submission, talkative

SEED = next((int(word) for word in sys.argv[1:] if word.isdigit()), random.randrange(1 << 32))
ROUNDS, EARLIER, STEP = (20, 1500, 1) if SOAK else (2, 40, 8)
EXAMPLES = ("rectangular_punch", "cylinder", "annular_punch", "cylinder_on_end", "sheet")
MESH = (TOP / "tests/data/gmsh/fillet-mixed-msh41-binary.msh").read_bytes()
OTHER_MESH = (TOP / "tests/data/gmsh/hertz-tri6-msh41-binary.msh").read_bytes()
FAILED, FOLDER, LOCKED, SCHEMA, DAMAGED = 1, 4, 5, 6, 7
PARTS = ("", "/problem", "/result", "/history", "/events", "/fields")
ENOSPC = 28


def run(*words, code=0, **how):
    """A command of the program, with this exit code."""
    done = subprocess.run([BINARY, *words], capture_output=True, text=True, timeout=300, **how)
    equal(done.returncode, code, "signorini %s: %s" % (" ".join(map(str, words)), done.stderr))
    return done


def on_mesh(mesh):
    return {
        "analysis": {"kind": "plane_strain"}, "mesh": {"stored": mesh},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": {"kind": "parabola", "radius": 5, "center": 1}, "indentation": 0.05}],
    }


class Load(threading.Thread):
    """Submits and uploads until it is told to stop."""

    def __init__(self, server, mesh):
        super().__init__()
        self.server, self.mesh, self.acknowledged, self.over = server, mesh, [], threading.Event()

    def run(self):
        number = 0
        while not self.over.is_set():
            number += 1
            problem = on_mesh(self.mesh) if number % 7 == 0 else example(EXAMPLES[number % 5])
            self.acknowledged.append(self.server.submit(problem, name="job %d" % number, cache="refresh"))
            if number % 5 == 0:
                answer = self.server.call("POST", "/v1/meshes", OTHER_MESH, content_type="application/octet-stream")
                check(answer.status in (200, 201), "upload, %r" % answer)
                path = "/v1/meshes/" + answer.json()["hash"]
                equal(self.server.call("DELETE", path).status // 100, 2, "deleting the mesh")
            time.sleep(0.03)


def answers(server, job):
    """Status and digest of everything that is told of a job."""
    found = {}
    for part in PARTS:
        answer = server.call("GET", "/v1/jobs/%s%s" % (job, part))
        found[part] = answer.status, hashlib.sha256(answer.body).hexdigest()
    return found


def statuses(server):
    return {job["id"]: job["status"] for job in server.every_job()}


@contextlib.contextmanager
def serving(backup):
    """A server on what is restored from a backup; it has not answered for itself yet."""
    server = Server()
    run("restore", backup, "--data", server.data)
    with server:
        yield server


def under_load(folder):
    took, jobs, requeued = 0.0, 0, 0
    with Server() as server:
        answer = server.call("POST", "/v1/meshes", MESH, content_type="application/octet-stream")
        mesh = answer.json()["hash"]
        for n in range(EARLIER):
            server.submit(example(EXAMPLES[n % 5]), cache="refresh")
        load = Load(server, mesh)
        load.start()
        made = []
        for n in range(ROUNDS):
            time.sleep(0.7)
            # two that run meanwhile
            load.acknowledged += [server.submit(talkative(200, refine=2)) for _ in range(2)]
            time.sleep(0.1)
            acknowledged = list(load.acknowledged)
            target = folder / ("backup %d" % n)
            began = time.monotonic()
            told = run("backup", "--data", server.data, target).stdout
            took = max(took, time.monotonic() - began)
            check("sha256:" in told, told)
            made.append((target, acknowledged))
        load.over.set()
        load.join()
        while any(status not in TERMINAL for status in statuses(server).values()):
            time.sleep(0.1)
        for target, acknowledged in made:
            manifest = json.loads((target / "manifest.json").read_text())
            equal(manifest["damaged"], 0, "damage in the backup")
            with serving(target) as restored:
                there = statuses(restored)
                equal(len(there), manifest["jobs"], "jobs in the backup")
                equal([job for job in acknowledged if job not in there], [], "acknowledged, and not in the backup")
                equal(restored.json("/v1/meshes/" + mesh)["hash"], mesh, "the mesh")
                for job in there:
                    equal(restored.finished(job)["status"], "succeeded", "the job")
                    here, original = answers(restored, job), answers(server, job)
                    if restored.json("/v1/jobs/" + job)["finished_at"] == server.json("/v1/jobs/" + job)["finished_at"]:
                        equal(here, original, "what is told of %s, which had ended" % job)
                    else:
                        requeued += 1
                        equal(here["/fields"], original["/fields"], "the fields of %s, which was solved again" % job)
                    jobs += 1
        check(requeued > 0, "every job had ended when the backups were made")
        server.stop()
        refusals(server, folder, made[0][0])
    return took, jobs, requeued


def refusals(server, folder, backup):
    """What is not done; the server of the store has stopped."""
    run("backup", "--data", server.data, backup, code=FOLDER)
    run("backup", "--data", server.data, server.data / "backup", code=FOLDER)
    run("backup", "--data", folder / "missing", folder / "none", code=FOLDER)
    run("backup", "--data", server.data, folder / "missing" / "none", code=FOLDER)
    (folder / "lent.partial").mkdir()
    (folder / "lent.partial/letter").write_text("")
    run("backup", "--data", server.data, folder / "lent", code=FOLDER)
    check((folder / "lent.partial/letter").exists(), "a foreign file was removed")
    run("restore", folder / "missing", "--data", folder / "new", code=FOLDER)
    run("restore", backup, "--data", server.data, code=FOLDER)
    server.start()
    run("restore", backup, "--data", server.data, code=LOCKED)
    run("restore", backup, "--data", server.data, "--replace", code=LOCKED)
    server.stop()
    before = (server.data / "signorini.db").stat().st_size
    told = run("restore", backup, "--data", server.data, "--replace").stdout
    aside = pathlib.Path(told.splitlines()[0].removeprefix("the previous store is in "))
    equal((aside / "signorini.db").stat().st_size, before, "the store that was put aside")
    server.start()
    server.stop()
    # what is changed is noticed, and nothing is left that a server would start on
    for what, name, change, code in (
        ("a bit", "signorini.db", lambda old: old[:5000] + bytes([old[5000] ^ 1]) + old[5001:], DAMAGED),
        ("an end", "signorini.db", lambda old: old[:-4096], DAMAGED),
        ("no manifest", "manifest.json", None, FOLDER),
        ("half a manifest", "manifest.json", lambda old: old[:100], DAMAGED),
        ("a later form", "manifest.json", lambda old: old.replace(b'"format": 1', b'"format": 2'), SCHEMA),
        ("later tables", "manifest.json", lambda old: old.replace(b'"tables": ', b'"tables": 9'), SCHEMA),
    ):
        other = pathlib.Path(tempfile.mkdtemp(dir=folder)) / "backup"
        shutil.copytree(backup, other)
        if change:
            (other / name).write_bytes(change((other / name).read_bytes()))
        else:
            (other / name).unlink()
        new = other.parent / "new"
        if name == "signorini.db" or change is not None and code == DAMAGED:
            run("doctor", "--data", other, code=DAMAGED)
        run("restore", other, "--data", new, code=code)
        equal(list(new.iterdir()) if new.exists() else [], [], "left of a refused restore: " + what)
    # a restore that was interrupted: not served, and done again
    new = folder / "interrupted"
    new.mkdir()
    (new / "signorini.db.restoring").write_bytes(b"half")
    done = run("serve", "--listen", "127.0.0.1:0", "--data", new, code=FOLDER)
    check("was not completed" in done.stderr, done.stderr)
    run("restore", backup, "--data", new)
    run("doctor", "--data", new)


def broken_off(folder):
    """A backup that is killed or finds the disk full, at every n-th write and sync."""
    tried = 0
    with Faulty() as server:
        server.finished(server.submit(example()))
        server.stop()
        target = folder / "broken off"
        partial = folder / "broken off.partial"
        environment = dict(word.split("=", 1) for word in server.wrapper[1:])
        environment["FAULTS_FOLDER"] = str(partial)
        for error in (DIE, ENOSPC):
            n = 1
            while True:
                server.fail(n, error)
                done = subprocess.run([BINARY, "backup", "--data", server.data, target], capture_output=True, text=True, env=environment)
                failed = server.heal()
                if not failed:
                    equal(done.returncode, 0, "a backup without a fault, %s" % done.stderr)
                    break
                tried += 1
                if target.exists():
                    # the last call flushes the name, after the backup has it: it is whole
                    run("restore", target, "--data", folder / ("whole %d" % tried))
                    shutil.rmtree(target)
                else:
                    check(done.returncode != 0, "a backup that is not there was made")
                    if error == ENOSPC:
                        equal(done.returncode in (FAILED, FOLDER), True, "a full disk: %d, %s" % (done.returncode, done.stderr))
                        check(not partial.exists(), "a backup on a full disk leaves something")
                n += STEP
            check(n > STEP, "no call of the backup failed")
            run("restore", target, "--data", folder / ("after %d" % error))
            run("doctor", "--data", folder / ("after %d" % error))
            tried += restores_broken_off(server, environment, target, folder)
            shutil.rmtree(target)
        server.start()  # it was not touched
    return tried


def restores_broken_off(server, environment, backup, folder):
    """A restore to an empty folder, and in the place of a store, that is killed at every n-th write and sync: until it is
    complete, the service does not start on it, and it is done again."""
    tried = 0
    for replace in ((), ("--replace",)):
        n = 0
        while True:
            n += 1
            new = folder / ("restored %d" % n)
            shutil.rmtree(new, ignore_errors=True)
            if replace:
                run("restore", backup, "--data", new)
            server.fail(n, DIE)
            words = [BINARY, "restore", backup, "--data", new, *replace]
            subprocess.run(words, capture_output=True, env={**environment, "FAULTS_FOLDER": str(new)})
            if not server.heal():
                break
            tried += 1
            if (new / "signorini.db.restoring").exists():
                done = run("serve", "--listen", "127.0.0.1:0", "--data", new, code=FOLDER)
                check("was not completed" in done.stderr, done.stderr)
            if replace or not (new / "signorini.db").exists():
                run("restore", backup, "--data", new, *replace)
            equal(run("doctor", "--data", new).stdout, "1 of 1 jobs are intact\n", "the doctor")
        check(n > 3, "no call of the restore failed")
    return tried


def closed(folder):
    """A store with tokens: its backup has them, as they were."""
    with Server() as server:
        server.stop()
        create = ("token", "create", "--data", server.data, "--name", "a")
        token = run(*create, "--owner", "root", "--scope", "admin").stdout.strip()
        target = folder / "with tokens"
        run("backup", "--data", server.data, target)
        with Server() as other:
            other.stop()
            shutil.rmtree(other.data)
            run("restore", target, "--data", other.data)
            other.start()
            equal(other.call("GET", "/v1/jobs").status, 401, "a request without a token")
            equal(other.call("GET", "/v1/jobs", authorization="Bearer " + token).status, 200, "a request with it")


def main():
    print("seed %d" % SEED)
    random.seed(SEED)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        took, jobs, requeued = under_load(folder)
        tried = broken_off(folder)
        closed(folder)
    print("figure: %d backups under load, each in at most %.1f s; %d restored jobs equal the original ones by digest, %d of them "
          "solved after the restore; %d backups and restores broken off by a kill or a full disk, none of which looked whole" % (
              ROUNDS, took, jobs, requeued, tried))


if __name__ == "__main__":
    main()
