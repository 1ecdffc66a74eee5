"""Small jobs of twenty owners, one after the other, with retention on (R24): nothing grows.

    retention.py [--soak]

4,000 jobs (a million with --soak, of which one in twenty is solved and the others are answered from its result) are removed
some seconds after their end. Of the second and the last third
of the time are compared: memory, open files, the size of the database, and how long one answer takes. In the end all jobs
are gone, their space is given back to the file system, and the id of the last one is answered with 410.
"""

import json
import pathlib
import time

from attack import MIB, SOAK, Attacked, check, equal, example, percentile
from outside import memory

JOBS = 1_000_000 if SOAK else 4_000
KEPT_S = 60 if SOAK else 4
OWNERS = 20
BATCH = 200 if SOAK else 50
# enough to keep the workers busy, and few enough to be solved soon
MOST_WAITING = 400
# after the last job: those that are kept, and the next two times that the limits are applied
END_S = KEPT_S + 30
# an allocator takes some before it is even
MOST_GROWTH = 8 * MIB
# With --soak, over the last two thirds of the time: R24's figure for a million jobs in 24 hours. Here they come some fifty times
# as fast, and what a job leaves behind with them: an hour is one of that pace.
MOST_GROWTH_IN_AN_HOUR, PACE = MIB, 1_000_000 / 24
# the ids of the last 100,000 are remembered
MOST_LEFT = (32 if SOAK else 8) * MIB


def look(server):
    """What there is now."""
    began = time.monotonic()
    equal(server.call("GET", "/v1/queue", x_remote_user="root").status, 200, "the queue")
    took = time.monotonic() - began
    folder = pathlib.Path(server.data)
    size = lambda name: (folder / name).stat().st_size if (folder / name).exists() else 0
    # without the pages of the program's own file: they come when code is first run, and the system takes them back
    return {"t": time.monotonic(), "rss": memory(server.process.pid, "RssAnon"), "files": server.files(), "took": took,
            "db": size("signorini.db"), "wal": size("signorini.db-wal")}


def slope(rows, name):
    """How much it grows in an hour, by least squares."""
    mean = lambda name: sum(row[name] for row in rows) / len(rows)
    t, y = mean("t"), mean(name)
    return 3600 * sum((row["t"] - t) * (row[name] - y) for row in rows) / sum((row["t"] - t) ** 2 for row in rows)


def main():
    arguments = ["--trusted-proxy", "127.0.0.1", "--proxy-user-header", "x-remote-user", "--proxy-admin", "root", "--retain-days", repr(KEPT_S / 86400)]
    with Attacked(*arguments) as server:
        solved, answered = ({"problem": example(), "cache": cache} for cache in ("refresh", "use"))
        jobs = [answered if SOAK and n % 20 else solved for n in range(BATCH)]
        body = json.dumps({"jobs": jobs}).encode()
        seen, submitted, first, last_one = [], 0, None, None
        while submitted < JOBS:
            queue = server.call("GET", "/v1/queue", x_remote_user="root").json()
            seen.append(look(server))
            if queue["queued"] > MOST_WAITING:
                time.sleep(0.05)
                continue
            owner = "user%02d" % (submitted // BATCH % OWNERS)
            answer = server.call("POST", "/v1/jobs/batch", body, x_remote_user=owner)
            equal((answer.status, answer.body[:300] if answer.status != 202 else b""), (202, b""), "a batch of " + owner)
            last_one = owner, answer.json()["jobs"][-1]["id"]
            first = first or last_one
            submitted += BATCH
            if submitted % 50_000 == 0:
                kept = server.call("GET", "/v1/jobs/count", x_remote_user="root").json()["total"]
                print("%d jobs in %.0f s, %.1f MiB of memory, %d jobs kept" % (
                    submitted, time.monotonic() - seen[0]["t"], seen[-1]["rss"] / MIB, kept), flush=True)
        began, ended = seen[0]["t"], seen[-1]["t"]
        third = lambda n: [one for one in seen if n <= 3 * (one["t"] - began) / (ended - began + 1e-9) < n + 1]
        second, last = third(1), third(2)
        median = lambda rows, name: percentile([row[name] for row in rows], 0.5)
        growth = median(last, "rss") - median(second, "rss")
        check(growth < MOST_GROWTH, "memory grew by %.1f MiB" % (growth / MIB))
        files = median(last, "files") - median(second, "files")
        check(abs(files) <= 5, "%d more open files" % files)
        largest = lambda rows, name: max(row[name] for row in rows)
        check(largest(last, "db") <= 1.5 * largest(second, "db") + 4 * MIB, "the database grew from %.1f to %.1f MiB" % (
            largest(second, "db") / MIB, largest(last, "db") / MIB))
        check(largest(seen, "wal") <= 64 * MIB, "the write-ahead log has %.1f MiB" % (largest(seen, "wal") / MIB))
        p99 = [1e3 * percentile([row["took"] for row in rows], 0.99) for rows in (second, last)]
        told = ""
        if SOAK:
            in_an_hour = slope(second + last, "rss") * PACE / (3600 * submitted / (ended - began))
            told = " (%+.2f MiB in an hour of which a million jobs take 24)" % (in_an_hour / MIB)
            print("memory%s, 99 %% of answers %.1f ms, then %.1f ms" % (told, *p99), flush=True)
            check(in_an_hour < MOST_GROWTH_IN_AN_HOUR, "memory grew by %.2f MiB in an hour" % (in_an_hour / MIB))
            check(p99[1] <= 1.2 * p99[0] + 1, "99 %% of answers took %.1f ms, then %.1f ms" % tuple(p99))
        end = time.monotonic() + END_S
        left = -1
        while left and time.monotonic() < end:
            time.sleep(0.5)
            left = server.call("GET", "/v1/jobs/count", x_remote_user="root").json()["total"]
        equal(left, 0, "jobs that are left")
        for (owner, job), status in ((first, 404 if submitted > 200_000 else 410), (last_one, 410)):
            equal(server.call("GET", "/v1/jobs/" + job, x_remote_user=owner).status, status, "a job that was removed")
        owners = server.call("GET", "/v1/owners", x_remote_user="root").json()["owners"]
        equal({(one["jobs"], one["job_bytes"]) for one in owners}, {(0, 0)}, "what owners keep")
        while seen[-1]["db"] > 0.75 * MOST_LEFT and time.monotonic() < end:
            time.sleep(0.5)
            seen.append(look(server))
        server.stop()
        size = (pathlib.Path(server.data) / "signorini.db").stat().st_size
        check(size <= MOST_LEFT, "the database still has %.1f MiB" % (size / MIB))
        print("figure: %d jobs of %d owners in %.0f s, each kept for %d s: memory %+.1f MiB from the second to the last third of "
              "the time%s, open files %+d, the database at most %.1f and %.1f MiB, its log at most %.1f MiB, 99 %% of answers %.1f "
              "and %.1f ms; in the end all are gone and the database has %.1f MiB" % (
                  submitted, OWNERS, ended - began, KEPT_S, growth / MIB, told, files, largest(second, "db") / MIB,
                  largest(last, "db") / MIB, largest(seen, "wal") / MIB, *p99, size / MIB))


main()
