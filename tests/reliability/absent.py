"""A changed bit in any table or index: what was there is not said to be absent (R6).

    absent.py [--soak] [SEED]

A store has something in each of its tables. In turn each table and each index has one bit changed, in a page of its own,
and the store is served. Every list, every item found by a name, a label, a hash or a request key, and every item that was
deleted, is answered as before, or soon by an error that says that the store is damaged. A repeated submit never makes a second
job.
"""

import pathlib
import random
import re
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import outside
from outside import Server, check, equal, example, submission

SOAK = "--soak" in sys.argv
NUMBERS = [int(word) for word in sys.argv[1:] if word.isdigit()]
BITS, SEED = 12 if SOAK else 1, NUMBERS[0] if NUMBERS else random.randrange(1 << 32)
MESH = (outside.TOP / "tests/data/gmsh/fillet-mixed-msh41-binary.msh").read_bytes()
# a day's scrub begins with the service: how long until it has read these small tables
SOON_S = 10
VOLATILE = re.compile(rb'"(stored_bytes|version|uptime_s|last_used_at)":(?:[0-9.]+|null|"[^"]*"),?')


def fill(server):
    """Something in each table; the paths that find it, and the submits that are repeated."""
    punch = example("rectangular_punch", refine=0)
    submits, found = [], ["/v1/jobs", "/v1/sweeps", "/v1/meshes", "/v1/tokens", "/v1/owners", "/v1/jobs/count?group_by=status"]
    for n in range(3):
        body = submission(punch, name="name %d" % n, labels={"kind": "label %d" % n}, cache="refresh")
        job = server.call("POST", "/v1/jobs", body, Prefer="wait=30", Idempotency_Key="key %d" % n).json()
        equal(job["status"], "succeeded", "the job")
        submits.append((body, "key %d" % n, job["id"]))
        found += ["/v1/jobs?name=name%%20%d" % n, "/v1/jobs?label.kind=label%%20%d" % n]
        found += ["/v1/jobs/%s%s" % (job["id"], part) for part in ("", "/problem", "/result", "/history", "/events", "/fields")]
    gone = server.submit(punch, name="deleted")
    server.finished(gone)
    equal(server.call("DELETE", "/v1/jobs/" + gone).status, 204, "a deleted job")
    mesh = server.call("POST", "/v1/meshes", MESH, content_type="application/octet-stream").json()["hash"]
    sweeps = []
    for values in ([0.1, 0.2], [0.15]):
        axis = {"path": "/contacts/0/friction/coefficient", "values": values}
        sweep = server.call("POST", "/v1/sweeps", {"base": punch, "name": "study", "axes": [axis]}, Prefer="wait=30").json()["id"]
        server.call("GET", "/v1/sweeps/%s?wait=30" % sweep)
        sweeps.append(sweep)
    equal(server.call("DELETE", "/v1/sweeps/" + sweeps[1]).status, 204, "a deleted sweep")
    found += ["/v1/jobs/" + gone, "/v1/sweeps/" + sweeps[1], "/v1/meshes/" + mesh]
    found += ["/v1/sweeps/%s%s" % (sweeps[0], part) for part in ("", "/members", "/results", "/events")]
    return found, submits


def answers(server, paths):
    found = {}
    for path in paths:
        try:
            answer = server.call("GET", path)
        except OSError as error:
            # cut off in the middle: the client knows that it has not all of it
            found[path] = 0, repr(error)
            continue
        # a stream that stops without `done` is followed again, and then an error
        stopped = path.endswith("/events") and b"event: done" not in answer.body
        found[path] = 0 if stopped else answer.status, VOLATILE.sub(b"", answer.body)
    return found


def told(status):
    return status == 0 or status >= 500


def starts(server):
    """Starts it, and waits until it says how it is: ready, or that it reads only; false if it refuses."""
    with server.log.open("w") as log:
        command = [outside.BINARY, "serve", "--listen", "127.0.0.1:0", "--data", server.data]
        server.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log)
    server.address = server.process.stdout.readline().decode().strip().removeprefix("http://")
    end = time.monotonic() + 60
    while server.address:
        check(time.monotonic() < end, "the server was not ready within a minute")
        ready = server.call("GET", "/readyz")
        if ready.status == 200 or b"storage-lost" in ready.body:
            return True
        time.sleep(0.05)
    return False


def trees(path):
    """The pages of each table and index, and where in them there is content."""
    database = sqlite3.connect(path)
    pages = {}
    for name, page in database.execute("select name, pageno from dbstat where pagetype != 'overflow' order by name, pageno"):
        pages.setdefault(name, []).append(page)
    size = database.execute("pragma page_size").fetchone()[0]
    database.close()
    return pages, size


def content(page, first):
    """Where the page's cells are; of an empty page its head."""
    head = 100 if first else 0
    start = int.from_bytes(page[head + 5:head + 7], "big") or 65536
    return range(start, len(page)) or range(head, head + 8)


def one_trial(base, what, place, bit, paths, before, submits):
    """What is absent without a word, if anything; and how many answers told of the damage."""
    server = Server()
    shutil.copytree(base, server.data)
    with (server.data / "signorini.db").open("r+b") as file:
        file.seek(place)
        byte = file.read(1)[0]
        file.seek(place)
        file.write(bytes([byte ^ (1 << bit)]))
    if not starts(server):
        code = server.process.wait(timeout=10)
        check(code in (6, 7), "%s: exit code %d" % (what, code))
        return [], "refused"
    end, after = time.monotonic() + SOON_S, {}
    while True:
        after = answers(server, paths)
        wrong = [(path, *answer) for path, answer in after.items() if answer != before[path] and not told(answer[0])]
        if b"degraded" in server.call("GET", "/readyz").body:
            # sums of what owners keep: they are shown, and nothing is removed by them
            wrong = [one for one in wrong if one[0] != "/v1/owners"]
        if not wrong or time.monotonic() > end:
            break
        time.sleep(0.1)
    for body, key, job in submits:
        answer = server.call("POST", "/v1/jobs", body, Prefer="wait=30", Idempotency_Key=key)
        if not told(answer.status) and answer.json().get("id") != job:
            wrong.append(("another job for " + key, answer.status, answer.body))
    ready = server.call("GET", "/readyz").body
    log = server.log.read_text(errors="replace")
    check("panicked" not in log, "%s: %s" % (what, log[-2000:]))
    server.kill()
    server.folder.cleanup()
    changed = any(answer != before[path] for path, answer in after.items())
    return [(what, ready[:80], *one[:2], one[2][:200]) for one in wrong], "told" if changed else "as before"


def main():
    print("seed %d" % SEED)
    dice = random.Random(SEED)
    counts = dict.fromkeys(("refused", "told", "as before"), 0)
    wrong = []
    with tempfile.TemporaryDirectory() as folder:
        base = pathlib.Path(folder) / "base"
        with Server() as server:
            paths, submits = fill(server)
            server.stop()
            server.start()
            before = answers(server, paths)
            server.stop()
            shutil.copytree(server.data, base)
        pages, size = trees(base / "signorini.db")
        raw = (base / "signorini.db").read_bytes()
        for name in sorted(pages):
            for _ in range(BITS):
                page = dice.choice(pages[name])
                start = (page - 1) * size
                place = start + dice.choice(content(raw[start:start + size], page == 1))
                bit = dice.randrange(8)
                what = "%s: bit %d of byte %d" % (name, bit, place)
                found, result = one_trial(base, what, place, bit, paths, before, submits)
                counts[result] += 1
                wrong += found
                for one in found:
                    print(one, flush=True)
    equal(len(wrong), 0, "answers without what is there")
    check(counts["told"] > 0, "no bit was noticed")
    print("figure: a bit changed in each of %d tables and indexes, %d times each: 0 items said to be absent, no second job (%d starts refused, %d told, %d without effect)" % (
        len(pages), BITS, counts["refused"], counts["told"], counts["as before"]))


main()
