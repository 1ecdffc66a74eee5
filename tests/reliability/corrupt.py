"""A disk that changes what was stored: nothing changed is served, and what is intact is saved (R6).

    corrupt.py [--soak] [SEED]

A store of finished jobs is copied, harmed at random (mostly one bit; a sector of zeros, a page of noise, the end cut
off), and served. Every answer is as it was before, or an error that says so; an answer from the cache is as right.
Then `doctor --salvage` saves it: every job that was still served whole is in the new store, and served as before.

The store has tokens, and a mesh of one owner: in the harmed store and in the saved one nobody gets in without a token or
with one that was revoked, and the mesh is its owner's. Who had a token that was served is still known in the saved store.
"""

import hashlib
import http.client
import pathlib
import random
import re
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import outside
from outside import BINARY, Server, check, equal, example, submission

SOAK = "--soak" in sys.argv
NUMBERS = [int(word) for word in sys.argv[1:] if word.isdigit()]
TRIALS, SEED = 200 if SOAK else 20, NUMBERS[0] if NUMBERS else random.randrange(1 << 32)
EXAMPLES = ("rectangular_punch", "cylinder", "annular_punch", "cylinder_on_end", "sheet")
JOBS = 10
LEAST_SAVED = 0.95
MESH = (outside.TOP / "tests/data/gmsh/fillet-mixed-msh41-binary.msh").read_bytes()
OWNERS = {"admin": ("root", "admin"), "ada": ("ada", "read,submit"), "bob": ("bob", "read"), "revoked": ("eve", "admin")}
# never let in
OUTSIDERS = ("nobody", "revoked")
tokens, mesh = {}, []


class Reader:
    """Requests on one connection."""

    def __init__(self, address, who="admin"):
        self.token = tokens.get(who)
        self.connection = http.client.HTTPConnection(address, timeout=60)

    def call(self, method, path, body=None, **headers):
        headers = {name.replace("_", "-"): value for name, value in headers.items()}
        if self.token:
            headers["authorization"] = "Bearer " + self.token
        if body is not None:
            headers.setdefault("content-type", "application/json")
        try:
            self.connection.request(method, path, body, headers)
            response = self.connection.getresponse()
            return response.status, response.read()
        except (http.client.HTTPException, OSError) as error:
            self.connection.close()  # cut off in the middle: the client knows that it has not all of it
            return 0, repr(error).encode()


def paths(job, boundary):
    of_job = "/v1/jobs/%s" % job
    parts = ("", "/problem", "/result", "/history", "/events", "/fields", "/profiles/" + boundary)
    return [of_job + part for part in parts]


def served(address, jobs):
    """Status and hash of every answer."""
    reader, found = Reader(address), {}
    for job, boundary in jobs.items():
        for path in paths(job, boundary):
            status, body = reader.call("GET", path)
            # what jobs share is counted for one of them, and that one may be damaged
            body = re.sub(rb'"stored_bytes":(?:[0-9]+|null),?', b"", body)
            if status not in (200, 0):
                body = b"corrupt-data" if b'"corrupt-data"' in body else body[:300]
                found[path] = status, body
            else:
                # a stream that stops without `done` is no answer: it is followed again, and then an error
                stopped = path.endswith("/events") and b"event: done" not in body
                found[path] = 0 if stopped else status, hashlib.sha256(body).hexdigest()
    for who in (*OWNERS, "nobody"):
        status, body = Reader(address, who).call("GET", "/v1/meshes/" + mesh[0])
        found[who] = status, b"corrupt-data" if b'"corrupt-data"' in body else body[:300]
    return found


def signorini(*words):
    done = subprocess.run([BINARY, *words], capture_output=True, text=True, timeout=60)
    equal(done.returncode, 0, "signorini %s: %s" % (words, done.stderr))
    return done.stdout.strip()


def create_tokens(data):
    """Of each owner, the first an administrator's; one of them is revoked."""
    for who, (owner, scopes) in OWNERS.items():
        tokens[who] = signorini("token", "create", "--data", data, "--name", who, "--owner", owner, "--scope", scopes)
    signorini("token", "revoke", tokens["revoked"].split("_")[1], "--data", data)


def start(server):
    """Starts it, unless it refuses; then its exit code, and what it says."""
    command = [BINARY, "serve", "--listen", "127.0.0.1:0", "--data", server.data]
    with server.log.open("w") as log:
        server.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log)
    url = server.process.stdout.readline().decode().strip()
    if url:
        server.address = url[len("http://"):]
        return None
    code = server.process.wait(timeout=10)
    return code, server.log.read_text(errors="replace")


def harm(path, dice):
    """Changes the file in one way."""
    size = path.stat().st_size
    kind = dice.choices(("flip", "zeros", "noise", "cut"), (14, 2, 2, 2))[0]
    with path.open("r+b") as file:
        if kind == "flip":
            place, bit = dice.randrange(size), dice.randrange(8)
            file.seek(place)
            byte = file.read(1)[0] ^ (1 << bit)
            file.seek(place)
            file.write(bytes([byte]))
            return "bit %d of byte %d flipped" % (bit, place)
        if kind == "cut":
            place = dice.randrange(size)
            file.truncate(place)
            return "cut at %d of %d" % (place, size)
        length = 512 if kind == "zeros" else 4096
        place = dice.randrange(size // length) * length
        file.seek(place)
        file.write(bytes(length) if kind == "zeros" else dice.randbytes(length))
        return "%s of %d bytes at %d" % (kind, length, place)


def main():
    print("seed %d" % SEED)
    dice = random.Random(SEED)
    counts = dict.fromkeys(("refused", "told", "wrong", "intact", "saved"), 0)
    with tempfile.TemporaryDirectory() as folder:
        base = pathlib.Path(folder) / "base"
        jobs, before, problems = {}, {}, {}
        with Server() as server:
            for n in range(JOBS):
                problem = example(EXAMPLES[n % len(EXAMPLES)])
                job = server.submit(problem, name="job %d" % n, labels={"n": str(n)}, cache="refresh")
                equal(server.finished(job)["status"], "succeeded", "the job")
                jobs[job] = problem["contacts"][0]["boundary"]
                problems[job] = problem
            server.stop()
            create_tokens(server.data)
            server.start()
            upload = Reader(server.address, "ada").call("POST", "/v1/meshes", MESH, content_type="application/octet-stream")
            equal(upload[0], 201, "upload")
            mesh.append(outside.json.loads(upload[1])["hash"])
            before = served(server.address, jobs)
            expected = dict(bob=404, nobody=401, revoked=401)
            check(all(status == expected.get(path, 200) for path, (status, _) in before.items()), "before: %r" % before)
            server.stop()
            shutil.copytree(server.data, base)
        for trial in range(TRIALS):
            one_trial(base, jobs, before, problems, dice, counts)
    share = counts["saved"] / max(1, counts["intact"])
    told = "%d of %d corrupted stores were refused, %d answers were errors that told of the damage" % (
        counts["refused"], TRIALS, counts["told"])
    print("%s, %d served something changed; %d of %d intact jobs were saved" % (
        told, counts["wrong"], counts["saved"], counts["intact"]))
    equal(counts["wrong"], 0, "stores that served something changed")
    check(share >= LEAST_SAVED, "only %.1f %% of the intact jobs were saved" % (100 * share))
    print("figure: %d random corruptions: 0 wrong answers, 0 panics, %.1f %% of intact jobs saved, nobody let in without a valid token (%s; seed %d)" % (
        TRIALS, 100 * share, told, SEED))


def one_trial(base, jobs, before, problems, dice, counts):
    server = Server()
    shutil.copytree(base, server.data)
    what = harm(server.data / "signorini.db", dice)
    wrong = []
    refused = start(server)
    intact, owned = set(), False
    if refused:
        code, text = refused
        check(code in (6, 7), "%s: exit code %d, %s" % (what, code, text))
        equal(len([line for line in text.splitlines() if line.startswith("signorini: ")]), 1, "%s: %s" % (what, text))
        counts["refused"] += 1
    else:
        after = served(server.address, jobs)
        for path, (status, body) in after.items():
            if (status, body) == before[path]:
                continue
            # a damaged token identifies nobody
            if (status, body) == (500, b"corrupt-data") or status == 0 or (status == 401 and path not in OUTSIDERS):
                counts["told"] += 1
            else:
                wrong.append((path, status, body))
        intact = {job for job, boundary in jobs.items() if all(after[p] == before[p] for p in paths(job, boundary))}
        owned = after["ada"] == before["ada"]
        # from the cache, or solved anew: the same bits
        job = dice.choice(list(jobs))
        reader = Reader(server.address)
        status, body = reader.call(
            "POST", "/v1/jobs", submission(problems[job], cache="use"), prefer="wait=30")
        if status == 201:
            again = outside.json.loads(body)["id"]
            status, body = reader.call("GET", "/v1/jobs/%s/fields" % again)
            if status == 200 and hashlib.sha256(body).hexdigest() != before["/v1/jobs/%s/fields" % job][1]:
                wrong.append(("the same problem again", status, body[:100]))
        log = server.log.read_text(errors="replace")
        check("panicked" not in log, "%s: %s" % (what, log[-2000:]))
        server.kill()
    if wrong:
        counts["wrong"] += 1
        print("%s: %r" % (what, wrong[:3]))
    salvaged(server, jobs, before, intact, owned, what, counts)
    server.folder.cleanup()


def salvaged(server, jobs, before, intact, owned, what, counts):
    """Saves the intact jobs to a new store, and compares what is served from there."""
    new = server.data.parent / "new"
    command = [BINARY, "doctor", "--data", server.data, "--salvage", new]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    check(done.returncode in (0, 7), "%s: doctor ended with %d: %s" % (what, done.returncode, done.stderr))
    equal(done.returncode == 0, len(done.stdout.splitlines()) == 1, "%s: findings, and exit code" % what)
    shutil.rmtree(server.data)
    new.rename(server.data)
    # as an operator does who has lost the last one
    known, tokens["admin"] = tokens["admin"], signorini(
        "token", "create", "--data", server.data, "--name", "new", "--owner", "root", "--scope", "admin")
    equal(start(server), None, "%s: the saved store" % what)
    after = served(server.address, jobs)
    tokens["admin"] = known
    server.kill()
    for who in OUTSIDERS:
        equal(after[who][0], 401, "%s: %s asks the saved store" % (what, who))
    equal(after["bob"][0] in (401, 404), True, "%s: a mesh of another's in the saved store" % what)
    # what is told of a mesh does not read its nodes and elements, which the doctor does
    if owned and "mesh " + mesh[0] not in done.stdout:
        equal(after["ada"], before["ada"], "%s: the mesh and the token of its owner" % what)
    for job, boundary in jobs.items():
        states = [after[path] == before[path] for path in paths(job, boundary)]
        check(all(states) or after["/v1/jobs/" + job][0] == 404, "%s: %s was saved in part" % (what, job))
        if job in intact:
            counts["intact"] += 1
            counts["saved"] += all(states)


main()
