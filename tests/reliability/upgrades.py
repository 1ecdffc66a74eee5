"""Stores of every earlier version, brought up to date by starting this one on them (R30).

    upgrades.py [--soak] [SEED]

A store is filled by the service: jobs of each kind of end, one that waits, labels, keys, a mesh, a sweep, a deletion. For
each earlier version of its tables, a store is made by the migrations up to that one, and gets what that version would
have stored of all this. The service starts on it, and what was stored is served as before, byte by byte where that
version stored it; the waiting job is solved; models, which the service no longer has, are files. On the way it is backed up and restored as it is. Then the upgrade is killed before its n-th write or sync, and started again.
A store of a later version is refused.
"""

import hashlib
import json
import pathlib
import random
import shutil
import sqlite3
import struct
import subprocess
import sys
import tempfile
import time
import zlib

from attack import SOAK, check, equal, example
from faults import DIE, Faulty, check_database
from outside import BINARY, TOP, Server, submission, talkative

SEED = next((int(word) for word in sys.argv[1:] if word.isdigit()), random.randrange(1 << 32))
STEPS = sorted((TOP / "migrations").glob("*.sql"))
VERSIONS = [int(step.stem[:4]) for step in STEPS]
EXAMPLES = ("rectangular_punch", "cylinder", "annular_punch", "cylinder_on_end", "sheet")
MESH = (TOP / "tests/data/gmsh/fillet-mixed-msh41-binary.msh").read_bytes()
SCHEMA = 6
KILLS = 400 if SOAK else 5
# columns and tables under the names that they had
OLD_NAMES = {("job", "twin_of"): "coalesced_into"}
# what a table has that was filled from another one, or belongs to the new store alone
NOT_COPIED = ("_sqlx_migrations", "sqlite_sequence", "progress", "owner_size", "queue", "owner_queue", "waiting")
# the first version that stores results compactly, and the first that has nothing but content by its hash
COMPACT, CONTENT = 10, 18
MOVED = ("problem", "result_part", "result_info", "mesh_piece", "sweep_definition", "content", "content_piece", "attachment")
# the versions that had models
MODELS = range(12, 14)
MODEL = {"title": None, "inputs": [["/contacts/0/indentation"]], "outputs": [{"scalars": ["normal_force"]}]}
PIECE_BYTES = 256 << 10


def everything(server, jobs, mesh, sweep):
    """Digests of what is served, by path."""
    paths = ["/v1/jobs/%s%s" % (job, part) for job in jobs
             for part in ("/problem", "/result", "/history", "/fields", "/events")]
    paths += ["/v1/jobs/%s/profiles/%s" % (job, boundary) for job, boundary in jobs.items()]
    if sweep:
        paths.append("/v1/sweeps/%s/results?format=csv" % sweep)
    if mesh:
        paths.append("/v1/meshes/" + mesh)
    found = {}
    for path in paths:
        answer = server.call("GET", path)
        found[path] = answer.status, hashlib.sha256(answer.body).hexdigest()
    return found


def sizes(server):
    """What each job keeps that has ended; its owner keeps the sum."""
    def of_owner():
        owner, = server.json("/v1/owners")["owners"]
        return owner["jobs"], owner["job_bytes"]

    before, after = None, of_owner()
    # the job that waited may end between the answers
    while before != after:
        before = after
        kept = {job["id"]: job["stored_bytes"] for job in server.every_job() if job.get("stored_bytes") is not None}
        after = of_owner()
    equal(after, (len(kept), sum(kept.values())), "what the owner keeps")
    return kept


def fill(server):
    """All kinds of content; what is known of it."""
    jobs = {}
    for number, name in enumerate(EXAMPLES):
        problem = example(name)
        job = server.submit(problem, name=name, labels={"n": str(number)}, cache="use")
        equal(server.finished(job)["status"], "succeeded", name)
        jobs[job] = problem["contacts"][0]["boundary"]
    upload = server.call("POST", "/v1/meshes", MESH, content_type="application/octet-stream")
    mesh = upload.json()["hash"]
    sweep = {"base": example(), "axes": [{"path": "/contacts/0/friction/coefficient", "values": [0.1, 0.2, 0.3]}]}
    answer = server.call("POST", "/v1/sweeps", sweep)
    equal(answer.status // 100, 2, "the sweep, %r" % answer)
    sweep = answer.json()["id"]
    while server.json("/v1/sweeps/" + sweep)["status"] in ("queued", "running"):
        time.sleep(0.05)
    gone = server.submit(example(), cache="refresh")
    server.finished(gone)
    equal(server.call("DELETE", "/v1/jobs/" + gone).status // 100, 2, "deleting")
    canceled = server.submit(talkative(4000, refine=2))
    server.call("POST", "/v1/jobs/%s/cancel" % canceled)
    equal(server.finished(canceled)["status"], "canceled", "the canceled job")
    equal(server.call("POST", "/v1/queue/pause").status, 200, "pausing")
    answer = server.call("POST", "/v1/jobs", submission(example("sheet"), cache="refresh"), idempotency_key="waiting")
    return jobs, mesh, sweep, gone, canceled, answer.json()["id"]


def checksum(values):
    """Of a row: CRC-32 of kind, place, length and bytes of each value that is not null."""
    kinds = {int: (b"i", lambda value: struct.pack("<q", value)), float: (b"r", lambda value: struct.pack("<d", value)),
             str: (b"t", str.encode), bytes: (b"b", bytes)}
    packed = b""
    for place, value in enumerate(values):
        if value is not None:
            kind, pack = kinds[type(value)]
            packed += struct.pack("<cIQ", kind, place, len(pack(value))) + pack(value)
    return zlib.crc32(packed)


def attached(store, kind):
    """What is attached to jobs or meshes of the new store: bytes by number and name."""
    rows = store.execute("select key, name, body from new.attachment join new.content_piece using (content) "
                         "where kind = ? order by key, name, piece", (kind,))
    found = {}
    for key, name, body in rows:
        found[key, name] = found.get((key, name), b"") + body
    return found


def parts(result, fields):
    """The parts of a stored result: name, encoding, size and hash of the JSON, stored bytes."""
    length, = struct.unpack_from("<I", result, 1)
    place, body = 9, 9 + length

    def number():
        nonlocal place
        value = shift = 0
        while True:
            byte = result[place]
            place += 1
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    def text():
        nonlocal place
        count = number()
        place += count
        return result[place - count:place]

    for _ in range(number()):
        name, encoding, size, digest, stored = text().decode(), number(), number(), text(), number()
        yield name, encoding or None, size, digest, fields if name == "fields" else result[body:body + stored]
        body += stored


def insert(store, table, row):
    """A row, but for what this version of the table does not have."""
    ours = [column for _, column, *_ in store.execute("pragma main.table_info(%s)" % table)]
    row = {column: value for column, value in row.items() if column in ours}
    store.execute("insert into main.%s (%s) values (%s)" % (table, ", ".join(row), ", ".join("?" * len(row))), list(row.values()))


def insert_pieces(store, table, start, body):
    for number, place in enumerate(range(0, len(body), PIECE_BYTES)):
        row = dict(start, piece=number, body=body[place:place + PIECE_BYTES])
        insert(store, table, dict(row, checksum=checksum(row.values())))


def before_content(store, fields, version):
    """What versions before CONTENT stored in tables of their own."""
    tables = [name for name, in store.execute("select name from main.sqlite_schema where type = 'table'")]
    jobs = {row["id"]: row for row in rows(store, "select * from new.job where id in (select id from main.job)")}
    own = {row["uuid"]: row["id"] for row in jobs.values() if row["cached_from"] is None}
    for (key, name), body in attached(store, "job").items():
        job = jobs.get(key)
        if job is None:
            continue  # of a sweep, which this version does not have
        if name == "problem":
            problem = [job["input_hash"], body.decode(), job["mesh"], job["memory_bytes"]]
            columns = "input_hash", "body", "mesh", "memory_bytes"
            known = store.execute("select 1 from main.problem where input_hash = ?", problem[:1]).fetchone()
            if known is None:
                sum_of = problem if version >= 7 else problem[:3]
                insert(store, "problem", dict(zip(columns, problem), checksum=checksum(sum_of)))
        elif name == "definition" and "sweep_definition" in tables:
            sweep, = store.execute("select id from new.sweep where uuid = ?", (job["sweep"],)).fetchone()
            if store.execute("select 1 from main.sweep_definition where sweep = ?", (sweep,)).fetchone() is None:
                row = dict(sweep=sweep, body=body.decode())
                insert(store, "sweep_definition", dict(row, checksum=checksum(row.values())))
        elif name == "result" and job["cached_from"] is None:
            old_result(store, job, body, attached(store, "job").get((key, "fields")), fields, version)
    for mesh in rows(store, "select * from new.mesh") if version >= 2 else ():
        body = attached(store, "mesh")[mesh["id"], "mesh"]
        insert_pieces(store, "mesh_piece", {"hash": mesh["hash"]}, body)
        if version >= 6:
            store.execute("update main.mesh set pieces = ?", (-(-len(body) // PIECE_BYTES),))
    if version >= 3:
        for job in jobs.values():
            if job["cached_from"] is not None:
                store.execute("update main.job set result_job = ? where id = ?", (own[job["cached_from"]], job["id"]))
    if version >= 6:
        for table in ("job", "mesh"):
            for row in rows(store, "select * from main." + table):
                row.pop("checksum")
                store.execute("update main.%s set checksum = ? where id = ?" % table, (checksum(row.values()), row["id"]))


def old_result(store, job, result, columns, fields, version):
    """A result part by part; before COMPACT as JSON, here without checksums."""
    for name, encoding, size, digest, stored in parts(result, columns):
        start = {"job_id": job["id"], "name": name}
        info = dict(start, bytes=size, digest=digest, encoding=encoding, stored_digest=hashlib.sha256(stored).digest())
        if version >= COMPACT:
            info["checksum"] = checksum(info.values())
            insert_pieces(store, "result_part", start, stored)
        else:
            text = zlib.decompress(stored, -15) if encoding == 1 else fields["job_" + job["uuid"]]
            for number, place in enumerate(range(0, len(text), PIECE_BYTES)):
                insert(store, "result_part", dict(start, piece=number, body=text[place:place + PIECE_BYTES]))
        if version >= 3:
            insert(store, "result_info", info)


def rows(store, question):
    found = store.execute(question)
    names = [column[0] for column in found.description]
    return [dict(zip(names, row)) for row in found.fetchall()]


def older(source, fields, folder, version):
    """The store as this version would have it."""
    folder.mkdir(mode=0o700)
    store = sqlite3.connect(folder / "signorini.db", isolation_level=None)
    # of later versions of SQLite
    store.create_function("octet_length", 1, lambda text: None if text is None else len(text.encode()), deterministic=True)
    store.execute("attach ? as new", (str(source),))
    # as the library writes it
    (create,), = store.execute("select sql from new.sqlite_schema where name = '_sqlx_migrations'")
    store.execute(create)
    for step in STEPS:
        if int(step.stem[:4]) > version:
            continue
        text = step.read_bytes()
        store.executescript(text.decode())
        number, name = step.stem.split("_", 1)
        store.execute("insert into _sqlx_migrations (version, description, success, checksum, execution_time) values (?, ?, 1, ?, 0)",
                      (int(number), name.replace("_", " "), hashlib.sha384(text).digest()))
    store.execute("begin")
    tables = [name for name, in store.execute("select name from main.sqlite_schema where type = 'table'")]
    # rows before those that refer to them
    order = ("job", "mesh", "sweep", "content")
    for table in sorted(tables, key=lambda name: (name not in order, order.index(name) if name in order else name)):
        if table in NOT_COPIED or table in ("model", "model_problem") or (version < CONTENT and table in MOVED):
            continue
        ours = [column for _, column, *_ in store.execute("pragma main.table_info(%s)" % table)]
        theirs = {column for _, column, *_ in store.execute("pragma new.table_info(%s)" % table)}
        pairs = [(column, OLD_NAMES.get((table, column), column)) for column in ours]
        pairs = [pair for pair in pairs if pair[1] in theirs]
        if table == "job_label" and "owner" in ours:  # up to step 16
            pairs.append(("owner", "(select owner from new.job where id = job_id)"))
        # before sweeps, no job was one of them
        where = " where sweep is null" if table == "job" and version < 8 else ""
        if table in ("event", "job_label") and version < 8:
            where = " where job_id in (select id from new.job where sweep is null)"
        store.execute("insert into main.%s (%s) select %s from new.%s%s" % (
            table, ", ".join(old for old, _ in pairs), ", ".join(new for _, new in pairs), table, where))
        if table == "job" and "checksum" in ours and "verdict" not in ours:
            # without the columns of later versions
            for row in rows(store, "select * from main.job"):
                row.pop("checksum")
                store.execute("update main.job set checksum = ? where id = ?", (checksum(row.values()), row["id"]))
    if version in MODELS:
        columns = "(id, owner, name, description, created_at, updated_at)"
        store.execute("insert into model %s values (1, 'local', 'punch', ?, 1, 1)" % columns, (json.dumps(MODEL),))
        store.execute("insert into model_problem (model, body) values (1, ?)", (json.dumps(example()),))
    if version < CONTENT:
        before_content(store, fields, version)
    if version >= 6:
        (count,), = store.execute("select commits from new.progress")
        store.execute("update main.progress set commits = ?", (count,))
        (name,), = store.execute("select store from main.progress")
        line = "signorini %s %020d stopped" % (name, count)
        (folder / "signorini.progress").write_text("%s %08x\n" % (line, zlib.crc32(line.encode())))
    store.execute("commit")
    equal(store.execute("pragma foreign_key_check").fetchall(), [], "the store of version %d" % version)
    store.close()


def command(*words):
    done = subprocess.run([BINARY, *words], capture_output=True, text=True, timeout=60)
    equal(done.returncode, 0, "signorini %s: %s" % (words, done.stderr))


def compare(server, version, known, before, kept):
    jobs, mesh, sweep, gone, canceled, waiting = known
    now = sizes(server)
    now.pop(waiting, None)
    if version >= COMPACT:
        equal(now, kept, "what jobs of version %d keep" % version)
    else:
        check(all(now[job] > kept[job] for job in jobs), "what jobs of version %d keep: %r" % (version, now))
    after = everything(server, jobs, mesh if version >= 2 else None, sweep if version >= 8 else None)
    for path, found in after.items():
        equal(found, before[path], "%s of a store of version %d" % (path, version))
    kept_model = server.data / "models/punch,local.json"
    equal(kept_model.exists(), version in MODELS, "a file of a model of version %d" % version)
    if version in MODELS:
        equal(json.loads(kept_model.read_text()), dict(MODEL, problem=example()), "the model of version %d" % version)
    for job in jobs:
        equal(server.json("/v1/jobs/" + job)["status"], "succeeded", "a job of version %d" % version)
    labeled = [job["name"] for job in server.every_job(**{"label.n": "3"})]
    equal(labeled, [EXAMPLES[3]], "jobs with a label, from version %d" % version)
    equal(server.json("/v1/jobs/" + canceled)["status"], "canceled", "the canceled job of version %d" % version)
    equal(server.call("GET", "/v1/jobs/" + gone).status, 410 if version >= 3 else 404, "the deleted job of version %d" % version)
    server.call("POST", "/v1/queue/resume")
    equal(server.finished(waiting)["status"], "succeeded", "the waiting job of version %d" % version)
    if version >= 3:
        again = server.call("POST", "/v1/jobs", submission(example("sheet"), cache="refresh"), idempotency_key="waiting")
        equal(again.json()["id"], waiting, "the repeated key, from version %d" % version)


def killed(make, known, before, kept, dice):
    """The upgrade is killed before its n-th write or sync; then it is done, from what that left."""
    kills = 0
    for version in (1, 5, 8, 12, 15, 17):
        with Faulty() as server:
            server.kill()
            n = 1
            for _ in range(KILLS):
                shutil.rmtree(server.data)
                make(server.data, version)
                server.fail(n, DIE)
                serve = [*server.wrapper, BINARY, "serve", "--listen", "127.0.0.1:0", "--data", server.data]
                with server.open_log() as log:
                    process = subprocess.Popen(serve, stdout=subprocess.PIPE, stderr=log)
                line = process.stdout.readline()
                if line:
                    process.kill()
                process.wait()
                died = server.heal()
                if line and not died:
                    break
                kills += 1
                server.start()
                compare(server, version, known, before, kept)
                server.kill()
                check_database(server)
                n += 1 if SOAK else dice.randrange(1, 12)
            server.start()
    return kills


def main():
    print("seed %d" % SEED)
    dice = random.Random(SEED)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        with Server() as server:
            known = fill(server)
            before = everything(server, known[0], known[1], known[2])
            kept = sizes(server)
            check(all(status == 200 for status, _ in before.values()), "before: %r" % before)
            answers = {job["id"]: server.call("GET", "/v1/jobs/%s/fields?format=json" % job["id"]) for job in server.every_job()}
            fields = {job: answer.body for job, answer in answers.items() if answer.status == 200}
            server.stop()
            shutil.copy(server.data / "signorini.db", folder / "new.db")

        def make(data, version):
            older(folder / "new.db", fields, data, version)

        for version in VERSIONS:
            server, made = Server(), folder / ("version %d" % version)
            make(made, version)
            # by way of a backup, which this version makes of it as it is
            command("backup", "--data", made, folder / ("backup %d" % version))
            command("restore", folder / ("backup %d" % version), "--data", server.data)
            with server:
                compare(server, version, known, before, kept)
                server.stop()
                server.start()
                compare(server, version, known, before, kept)
        later = folder / "later"
        make(later, VERSIONS[-1])
        with sqlite3.connect(later / "signorini.db") as store:
            store.execute("insert into _sqlx_migrations (version, description, success, checksum, execution_time) values (99, '', 1, x'00', 0)")
        store.close()
        done = subprocess.run([BINARY, "serve", "--listen", "127.0.0.1:0", "--data", later], capture_output=True, text=True)
        equal(done.returncode, SCHEMA, done.stderr)
        check("a later version of this program" in done.stderr and "use that version" in done.stderr, done.stderr)
        kills = killed(make, known, before, kept, dice)
    print("figure: stores of %d versions of the tables are brought up to date, with the same digest of every answer; upgrades "
          "killed at %d writes and started again; a later version refused" % (len(STEPS), kills))


main()
