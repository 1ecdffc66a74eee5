"""Measures the service from outside and prints the tables of docs/performance.md, "The service".

    service.py [JOBS]
    service.py --isolation
    service.py --bodies
    service.py --processor

With --isolation only the table of threads and processes, with --bodies only that of bodies that are kept, with --processor
only that of the service's own processor time. JOBS (1,000,000
when absent) is how many jobs the lists are read from; what they show is compared with plain SQL over the same rows.
`cargo build --release` comes first: requests are sent by `target/release/load`.
"""

import calendar
import json
import os
import pathlib
import random
import sqlite3
import struct
import subprocess
import sys
import tempfile
import time
import urllib.parse
import uuid
import zlib

TESTS = pathlib.Path(__file__).resolve().parent.parent
sys.path[:0] = [str(TESTS), str(TESTS / "peers")]

import problem as block

from outside import TERMINAL, TOP, Server, check, cpu_s, equal, example, percentile, submission, table, talkative

ONLY = sys.argv[1] if sys.argv[1:] in (["--isolation"], ["--bodies"], ["--processor"]) else None
JOBS = int(sys.argv[1]) if len(sys.argv) > 1 and not ONLY else 1_000_000
# every job factors its body
NO_BODIES = ("--body-cache-bytes", "0")
LOAD = TOP / "target/release/load"
MANY = ("--max-queued", "1000000")


def request(method, path, body=b"", **headers):
    """The bytes of a request."""
    lines = ["%s %s HTTP/1.1" % (method, path), "host: localhost"]
    lines += ["%s: %s" % (name.replace("_", "-"), value) for name, value in headers.items()]
    if body:
        lines += ["content-type: application/json", "content-length: %d" % len(body)]
    return "\r\n".join([*lines, "", ""]).encode() + body


def load(server, connections, answers, sent, status):
    """Sends a request so many times; every answer must have this status."""
    command = [LOAD, server.address, str(connections), str(answers)]
    found = json.loads(subprocess.run(command, input=sent, stdout=subprocess.PIPE, check=True).stdout)
    equal(found["statuses"], {str(status): answers}, "the answers to %r" % sent[:80])
    return found


def commits(folder):
    """What a durable commit costs on this disk, whoever makes it."""
    rows = []
    for name, sync in (("fsync", os.fsync), ("fdatasync", os.fdatasync)):
        for size, kind in ((24 << 10, "grows by 24 KiB"), (24 << 10, "24 KiB written over")):
            path = pathlib.Path(folder) / "commits"
            if kind.startswith("grows"):
                path.unlink(missing_ok=True)
            with path.open("r+b" if path.exists() else "wb", buffering=0) as file:
                spans = []
                for _ in range(500):
                    file.write(b"x" * size)
                    began = time.perf_counter()
                    sync(file.fileno())
                    spans.append(1e3 * (time.perf_counter() - began))
            rows.append((name, kind, percentile(spans, 0.5), percentile(spans, 0.99)))
    table("A flush of this machine's disk, ms (500 each)", ("call", "the file", "p50", "p99"), rows)


def waited(server):
    """One client that waits for each small job, solved or answered from the cache."""
    jobs = 1000
    solved = request("POST", "/v1/jobs", submission(example()), prefer="wait=30")
    load(server, 1, 50, solved, 201)
    found = load(server, 1, jobs, solved, 201)
    ran = [job for job in server.every_job()[:jobs] if job["attempt"] == 1 and job["cached_from"] is None]
    equal(len(ran), jobs, "the jobs that ran")
    server.finished(server.submit(example(), cache="refresh"))
    cached = load(server, 1, jobs, request("POST", "/v1/jobs", submission(example(), cache="use"), prefer="wait=30"), 201)
    equal(sum(job["cached_from"] is not None for job in server.every_job()), jobs, "the jobs from the cache")
    share = lambda name, q: 1e3 * percentile([job[name] for job in ran], q)
    table("One job of 56 elements by `Prefer: wait`, one after the other, ms (1,000 jobs of each kind)", ("", "p50", "p99"),
          [("solved, all 1,000 of them: request to answer", found["p50_ms"], found["p99_ms"]),
           ("of it in the queue (`queue_wait_s`)", share("queue_wait_s", 0.5), share("queue_wait_s", 0.99)),
           ("of it with a worker (`run_s`)", share("run_s", 0.5), share("run_s", 0.99)),
           ("answered from the cache, none solved: request to answer", cached["p50_ms"], cached["p99_ms"])])


def isolation():
    """The same jobs solved on threads of the service and in processes of their own, in turns."""
    kinds = {"56 elements": (example(), 200), "56 elements, 500 load steps, some 5,000 events": (talkative(500), 3),
             "14,336 elements, a result of 5 MB": (example(refine=4), 2)}
    found = {kind: {"thread": [], "process": []} for kind in kinds}
    with Server(*NO_BODIES) as threads, Server("--isolation", "process") as processes:
        for _ in range(5):
            for kind, (problem, count) in kinds.items():
                sent = request("POST", "/v1/jobs", submission(problem), prefer="wait=60")
                for where, server in (("thread", threads), ("process", processes)):
                    found[kind][where].append(load(server, 1, count, sent, 201)["p50_ms"])
    rows = []
    for kind, spans in found.items():
        thread, process = (percentile(spans[where], 0.5) for where in ("thread", "process"))
        rows.append((kind, thread, process, process - thread, process / thread))
    table("Request to answer, solved on a thread and in a process of its own, ms (median of 5 medians, in turns)",
          ("the job", "thread", "process", "more", "ratio"), rows)


def bodies():
    """Jobs on one body that differ in friction: with the body kept, and factored anew by each, in turns."""
    rows = []
    for size in ("2e4", "2e5"):
        with Server() as keeping, Server(*NO_BODIES) as without:
            spans = {keeping: [], without: []}
            for turn in range(7):
                problem = block.problem(block.mesh(size), 0.2 + 0.02 * turn)
                digests = set()
                for server, taken in spans.items():
                    before = cpu_s(server.process.pid)
                    job = server.submit(problem, cache="off")
                    equal(server.finished(job)["status"], "succeeded", "a job")
                    taken.append(cpu_s(server.process.pid) - before)
                    summary = server.json("/v1/jobs/%s/result" % job)["summary"]
                    equal(summary["body_reused"], server is keeping and turn > 0, "whether the body was reused")
                    digests.add(summary["digest"])
                equal(len(digests), 1, "digests of the same problem")
            kept = keeping.json("/v1/info")["body_cache"]
        # the first turn makes the body
        pairs = list(zip(spans[keeping], spans[without]))[1:]
        ratios = sorted(found / alone for found, alone in pairs)
        found, alone = (percentile([pair[k] for pair in pairs], 0.5) for k in (0, 1))
        rows.append((size, alone, found, "%.2f (%.2f–%.2f)" % (percentile(ratios, 0.5), ratios[0], ratios[-1]),
                     kept["bytes"] / 2**20))
    table("Processor time of the service for a job on a body that is kept, s (median of 6, in turns; the result stored)",
          ("unknowns", "factored anew", "kept", "ratio (least–most)", "the body, MiB"), rows)


def processor():
    """What the service takes of the processors, with the solution where a job is solved, without the clients."""
    rows = []

    def spent(what, count, work):
        """Six turns, of which the first warms up; milliseconds per answer."""
        spans = []
        for _ in range(6):
            before = cpu_s(server.process.pid)
            work()
            spans.append(1e3 * (cpu_s(server.process.pid) - before) / count)
        spans = sorted(spans[1:])
        rows.append((what, spans[2], "%.2f–%.2f" % (spans[0], spans[-1])))

    job = lambda **envelope: request("POST", "/v1/jobs", submission(example(), **envelope), prefer="wait=30")
    with Server(*NO_BODIES) as server:
        spent("a job of 56 elements, one after the other", 300, lambda: load(server, 1, 300, job(cache="off"), 201))
        spent("the same, of 32 clients", 1000, lambda: load(server, 32, 1000, job(cache="off"), 201))
        server.finished(server.submit(example(), cache="refresh"))
        spent("an answer from the cache, of 32 clients", 1000, lambda: load(server, 32, 1000, job(cache="use"), 201))

        def swept():
            made = server.call("POST", "/v1/sweeps", {"base": example(), "axes": [
                {"path": "/contacts/0/indentation", "linspace": {"start": 0.01, "stop": 0.02, "count": 1000}}]})
            equal(made.status, 202, "a sweep, %r" % made)
            place = "/v1/sweeps/%s" % made.json()["id"]
            while server.json(place + "?wait=10")["status"] not in TERMINAL:
                pass
            equal(server.json(place)["status"], "succeeded", "a sweep")

        spent("a member of a sweep of 1,000", 1000, swept)
        watched = server.submit(talkative(500), cache="off")
        server.finished(watched)
        spent("a watcher of the events of 500 steps, from the first on", 10, lambda: [server.events(watched) for _ in range(10)])
    with Server(*MANY) as server:
        equal(server.call("POST", "/v1/queue/pause").status, 200, "pausing the queue")
        sent = request("POST", "/v1/jobs", submission(example(), cache="off"))
        spent("a submit, of 32 clients", 2000, lambda: load(server, 32, 2000, sent, 202))
    table("Processor time of the service, ms (median of 5, least to most)", ("", "ms", "least–most"), rows)


def submits():
    """Durable submits from many clients: the queue paused, then not, then answered from the cache."""
    rows = []
    for kind, answers, paused, cache in (("paused", 20_000, True, "off"), ("working", 5_000, False, "off"),
                                         ("from the cache", 10_000, False, "use")):
        with Server(*MANY) as server:
            if paused:
                equal(server.call("POST", "/v1/queue/pause").status, 200, "pausing the queue")
            if cache == "use":
                server.finished(server.submit(example(), cache="use"))
            sent = request("POST", "/v1/jobs", submission(example(), cache=cache))
            found = load(server, 32, answers, sent, 202)
            counts = server.json("/v1/jobs/count?group_by=status")
            ended = sum(job["status"] in TERMINAL and job["cached_from"] is None for job in server.every_job())
        equal(sum(counts["groups"].values()), answers + (cache == "use"), "the jobs of the service")
        rows.append((kind, answers, "%d" % ended, answers / found["seconds"], found["p50_ms"], found["p99_ms"]))
    table("Submits of 32 clients, each on a connection that stays open", (
        "the queue", "accepted", "solved meanwhile", "accepted/s", "answer p50, ms", "p99, ms"), rows)


def checksum(row):
    """Of a row, as the service has it: CRC-32 of kind, place, length and bytes of each value that is not null."""
    pack = {int: lambda value: (b"i", struct.pack("<q", value)), float: lambda value: (b"r", struct.pack("<d", value)),
            str: lambda value: (b"t", value.encode()), bytes: lambda value: (b"b", value)}
    values = [value for column, value in row.items() if column != "checksum"]
    packed = [(place, *pack[type(value)](value)) for place, value in enumerate(values) if value is not None]
    return zlib.crc32(b"".join(struct.pack("<cIQ", kind, place, len(body)) + body for place, kind, body in packed))


def fill(server, jobs, dice):
    """Rows as the service writes them, straight into its file: copies of two real jobs, one in the queue."""
    database = sqlite3.connect(server.data / "signorini.db")
    database.row_factory = sqlite3.Row
    # indexes are built at the end, which is quicker than row by row
    indexes = database.execute(
        "select name, sql from sqlite_master where type = 'index' and sql is not null and tbl_name in ('job', 'job_label')")
    indexes = list(map(tuple, indexes))
    samples = {row["status"]: dict(row) for row in database.execute("select * from job")}
    equal(set(samples), {"succeeded", "queued"}, "the jobs to copy")
    problem, digest = database.execute(
        "select content, hash from attachment join content on content.id = content where name = 'problem' limit 1").fetchone()
    hashes = ["sha256:%064x" % n for n in range(2000)]
    # nobody else is there, and whoever is interrupted begins anew
    for pragma in ("journal_mode = off", "synchronous = off", "cache_size = -1000000"):
        database.execute("pragma " + pragma)
    for name, _ in indexes:
        database.execute('drop index "%s"' % name)
    number = database.execute("select max(id) from job").fetchone()[0]
    now = int(time.time() * 1e6)
    columns = list(samples["queued"])

    def rows():
        for n in range(1, jobs + 1):
            created = now - (jobs - n) * 1_000_000  # one a second
            # the last thousand wait; before them most went well
            status = "queued" if n > jobs - 1000 else dice.choices(("succeeded", "failed", "canceled"), (92, 6, 2))[0]
            row = dict(samples["queued" if status == "queued" else "succeeded"])
            row.update(id=number + n, status=status, created_at=created, input_hash=dice.choice(hashes),
                       uuid=str(uuid.UUID(int=created // 1000 << 80 | 7 << 76 | 2 << 62 | n)),
                       name="run %d" % (n % 50_000), labels=json.dumps(labels(n)))
            if row["expires_at"] is not None:
                row["expires_at"] = now + 86_400_000_000
            if status != "queued":
                row.update(started_at=created + 5_000, finished_at=created + dice.randrange(20_000, 60_000_000))
            yield [checksum(row) if column == "checksum" else row[column] for column in columns]

    database.executemany("insert into job (%s) values (%s)" % (", ".join(columns), ", ".join("?" * len(columns))), rows())
    # one problem for all, whatever their input hash
    attachments = (("job", number + n, "problem") for n in range(1, jobs + 1))
    database.executemany(
        "insert into attachment (kind, key, name, content, checksum) values (?, ?, ?, ?, ?)",
        ((*place, problem, checksum(dict(enumerate((*place, digest))))) for place in attachments))
    database.executemany(
        "insert into job_label (key, value, created_at, job_id) values (?, ?, ?, ?)",
        sorted((key, value, now - (jobs - n) * 1_000_000, number + n)
               for n in range(1, jobs + 1) for key, value in labels(n).items()))
    for _, sql in indexes:
        database.execute(sql)
    database.commit()
    database.close()
    return hashes


def labels(n):
    """One that half of all jobs have, one of each thousand, one of each study of a hundred."""
    return {"half": str(n % 2), "kind": str(n % 1000), "study": str(n // 100)}


def first_page(database, query):
    """What the first page must show, by plain SQL over all rows."""
    by, _, direction = query.get("order_by", "created_at desc").partition(" ")
    where, values = [by + " is not null"], []
    for name, value in query.items():
        if name == "status":
            where.append("status in (select value from json_each(?))")
            values.append(json.dumps(value.split(",")))
        elif name.startswith("label."):
            where.append("json_extract(labels, ?) = ?")
            values += ["$." + name[len("label."):], value]
        elif name.endswith(("_after", "_before")):
            column, _, side = name.partition("_")
            where.append("%s_at %s ?" % (column, ">=" if side == "after" else "<"))
            values.append(1_000_000 * calendar.timegm(time.strptime(value, "%Y-%m-%dT%H:%M:%SZ")))
        elif name in ("name", "input_hash", "owner"):
            where.append(name + " = ?")
            values.append(value)
    sql = "select 'job_' || uuid from job not indexed where %s order by %s %s, id %s limit ?"
    sql %= (" and ".join(where), by, direction, direction)
    return [name for name, in database.execute(sql, (*values, query.get("page_size", 50)))]


def first_jobs(server, query):
    """As many jobs as a page may have, from as many pages as that takes: any of them may be short."""
    most, found, token = query.get("page_size", 50), [], None
    while len(found) < most:
        page = server.json(list_path(query, token))
        found += [job["id"] for job in page["jobs"]]
        token = page["next_page_token"]
        if not token:
            break
    return found[:most]


def list_path(query, token):
    return "/v1/jobs?" + urllib.parse.urlencode({**query, **({"page_token": token} if token else {})})


def walk(server, query, pages):
    """The token after so many pages of a thousand."""
    token = None
    for _ in range(pages):
        page = server.json(list_path({**query, "page_size": 1000}, token))
        token = page["next_page_token"]
    return token


def lists():
    """Pages of a list, with as many jobs stored as were asked for."""
    dice = random.Random(1)
    with Server(*MANY) as server:
        server.finished(server.submit(example()))
        equal(server.call("POST", "/v1/queue/pause").status, 200, "pausing the queue")
        server.submit(example())
        server.stop()
        began = time.monotonic()
        hashes = fill(server, JOBS, dice)
        filled = time.monotonic() - began
        size = sum(file.stat().st_size for file in server.data.iterdir())
        ready = server.start()
        # by `created_at` and `finished_at` as of the rows above
        middle = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(time.time() - JOBS / 2))
        deep = JOBS // 2000
        cases = [
            ({}, 0), ({}, deep), ({"page_size": 1000}, 0),
            ({"order_by": "created_at asc"}, 0), ({"order_by": "finished_at desc"}, 0), ({"order_by": "finished_at desc"}, deep),
            ({"status": "queued"}, 0), ({"status": "succeeded"}, 0), ({"status": "succeeded"}, deep * 9 // 10),
            ({"status": "failed,canceled"}, 0), ({"status": "failed,canceled", "order_by": "finished_at desc"}, 0),
            ({"label.study": "77"}, 0), ({"label.kind": "77"}, 0), ({"label.half": "1"}, 0), ({"label.half": "1"}, deep // 2),
            ({"label.half": "1", "label.kind": "77"}, 0), ({"label.half": "0", "label.kind": "77"}, 0),
            ({"label.half": "1", "status": "canceled"}, 0), ({"label.half": "1", "status": "queued"}, 0),
            ({"label.half": "1", "order_by": "finished_at desc"}, 0),
            ({"name": "run 77"}, 0), ({"name": "run 77", "status": "canceled"}, 0), ({"name": "nobody's"}, 0),
            ({"input_hash": hashes[7]}, 0), ({"created_before": middle}, 0), ({"created_after": middle, "status": "failed"}, 0),
            ({"finished_before": middle}, 0), ({"finished_before": middle, "status": "failed"}, 0),
            ({"owner": "local", "status": "running"}, 0), ({"status": "running"}, 0),
        ]
        rows, database = [], sqlite3.connect(server.data / "signorini.db")
        for query, pages in cases:
            token = walk(server, query, pages)
            path = list_path(query, token)
            shown = [job["id"] for job in server.json(path)["jobs"]]
            if pages == 0:
                equal(first_jobs(server, query), first_page(database, query), "the first jobs of %r" % query)
            found = load(server, 1, 200, request("GET", path), 200)
            words = " ".join("`%s=%s`" % (k, v[:16]) if isinstance(v, str) else "`%s=%s`" % (k, v) for k, v in query.items())
            where = "after %s,000" % format(pages, ",") if pages else "first"
            rows.append((words or "none", where, len(shown), found["p50_ms"], found["p99_ms"], "" if found["p99_ms"] <= 10 else "over 10"))
        database.close()
    table("A page of the list with %s jobs stored, ms (200 requests each, one after the other)" % format(JOBS, ","),
          ("filters and order", "page", "jobs on it", "p50", "p99", ""), rows)
    print("\nThe store has %.2f GiB; the rows were written in %.0f s; the service is ready %.2f s after its start." % (
        size / 2**30, filled, ready))


def main():
    if ONLY == "--bodies":
        return bodies()
    check(LOAD.exists(), "%s is missing: cargo build --release" % LOAD)
    if ONLY == "--isolation":
        return isolation()
    if ONLY == "--processor":
        return processor()
    with tempfile.TemporaryDirectory() as folder:
        commits(folder)
    with Server(*NO_BODIES) as server:
        waited(server)
    isolation()
    bodies()
    processor()
    submits()
    lists()


main()
