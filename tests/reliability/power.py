"""Power that goes at any moment under load, on a disk that had written any part of what it was not yet told to keep (R2b).

    power.py [--soak] [SEED]

The server is killed just before one of its writes or syncs, chosen at random, also while it starts. Then what it had
not synced is taken back: all of it, or a random part, by pages of 4 KiB; removed and created files too (`faults.py`).
Every job, cancel and deletion that was acknowledged is there after that, a repeated key has one job, the database is
whole, and no watcher was told an event that the end does not know.
"""

import asyncio
import http.client
import json
import random
import sys
import time

from attack import SOAK, check, equal, example
from faults import DIE, Faulty, check_database
from outside import TERMINAL, Connection, Lost, each, submission

CUTS = 500 if SOAK else 30
SEED = next((int(word) for word in sys.argv[1:] if word.isdigit()), random.randrange(1 << 32))
SUBMITTERS, WATCHERS, PER_S = 4, 6, 60
# calls until the power goes: a commit has ten, a job some hundred, and a checkpoint comes after two thousand
MOST_CALLS, STARTING_CALLS, LONGEST_S = 4000, 80, 5
EXAMPLES = ("rectangular_punch", "cylinder", "annular_punch", "cylinder_on_end", "sheet")


class Load:
    """What the clients asked for, and what they were answered, over all lives of the server."""

    def __init__(self, server, dice):
        self.server, self.dice, self.sent = server, dice, 0
        self.names, self.keys, self.pending = {}, {}, []
        self.told, self.canceled, self.to_delete, self.deleted = {}, set(), set(), set()
        self.recent = []

    async def live(self):
        """Until the server dies."""
        self.recent = []
        clients = [self.submit] * SUBMITTERS + [self.watch] * WATCHERS + [self.end_jobs]
        await each(clients, lambda client: client())

    async def submit(self):
        """Jobs under names of their own; half of them with a key, repeated in the next life if there was no answer."""
        connection = Connection(self.server)
        while True:
            began = time.monotonic()
            if self.pending:
                name = self.pending.pop()
            else:
                self.sent += 1
                name = "%s %d" % ("key" if self.dice.random() < 0.5 else "job", self.sent)
            keyed = name.startswith("key")
            headers = {"idempotency_key": name} if keyed else {}
            body = submission(example(EXAMPLES[int(name.split()[1]) % 5]), name=name)
            try:
                answer = await connection.call("POST", "/v1/jobs", body, **headers)
            except Lost:
                if keyed:
                    self.pending.append(name)
                return
            equal(answer.status, 202 if not keyed else answer.status, "submit, %r" % answer)
            check(answer.status in (200, 201, 202), "submit under a key, %r" % answer)
            job = answer.json()["id"]
            equal(self.keys.setdefault(name, job), job, "the job of %s" % name)
            self.names[job] = name
            self.recent.append(job)
            await asyncio.sleep(max(0, began + SUBMITTERS / PER_S - time.monotonic()))

    async def end_jobs(self):
        """Cancels one job or deletes another, now and then."""
        connection = Connection(self.server)
        while True:
            await asyncio.sleep(0.05)
            if not self.recent:
                continue
            job = self.dice.choice(self.recent)
            try:
                if self.dice.random() < 0.5:
                    answer = await connection.call("POST", "/v1/jobs/%s/cancel" % job)
                    if answer.status == 200 and answer.json()["outcome"] == "canceled":
                        self.canceled.add(job)
                else:
                    self.to_delete.add(job)
                    answer = await connection.call("DELETE", "/v1/jobs/" + job)
                    if answer.status == 204:
                        self.deleted.add(job)
                check(answer.status in (200, 204, 409, 410), "a cancel or deletion, %r" % answer)
            except Lost:
                return

    async def watch(self):
        """Follows one of the last jobs, then another; each event must follow the last one that anybody was told."""
        while True:
            if not self.recent:
                await asyncio.sleep(0.01)
                continue
            job = self.dice.choice(self.recent)
            lines = self.told.setdefault(job, {})
            try:
                host, port = self.server.address.split(":")
                reader, writer = await asyncio.open_connection(host, int(port), limit=1 << 20)
                writer.write(b"GET /v1/jobs/%s/events HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n" % job.encode())
                status = (await reader.readuntil(b"\r\n")).split()[1]
                check(status in (b"200", b"204", b"410"), "events of %s: %r" % (job, status))
                while line := await reader.readline():
                    if line.startswith(b"data: ") and line.endswith(b"\n"):
                        event = json.loads(line[6:])
                        equal(lines.setdefault(event["seq"], event), event, "event %d of %s" % (event["seq"], job))
                writer.close()
                await asyncio.sleep(0.01)
            except (OSError, EOFError):
                return


def start(server):
    """Whether it was ready before it died."""
    try:
        server.start()
        return True
    except (AssertionError, OSError, http.client.HTTPException):
        equal(server.process.wait(timeout=10), -9, "exit code of a server that did not start")
        return False


async def live_and_die(server, load):
    alive = asyncio.ensure_future(load.live())
    end = time.monotonic() + LONGEST_S
    while server.process.poll() is None and time.monotonic() < end:
        done, _ = await asyncio.wait([alive], timeout=0.01)
        if done:
            alive.result()
            break
    server.kill()
    # who waits for an answer hears now that there will be none
    await asyncio.wait([alive], timeout=5)
    if not alive.done():
        alive.cancel()
    elif alive.exception():
        raise alive.exception()


def cut_again_and_again(server, load, dice):
    starting = changes = worst = 0
    for cut in range(CUTS):
        at_start = cut == 0 or dice.random() < 0.2
        if at_start:
            server.fail(dice.randrange(1, STARTING_CALLS), DIE)
        began = time.monotonic()
        # it may also die just when it is ready, of the fault that it was to start with
        if start(server) and not server.heal():
            worst = max(worst, time.monotonic() - began)
            check_recent(server, load)
            server.fail(dice.randrange(1, MOST_CALLS), DIE)
            asyncio.run(live_and_die(server, load))
            server.heal()
        else:
            equal(server.process.wait(timeout=10), -9, "exit code of a server that was killed while it started")
            server.heal()
            starting += 1
        changes += server.cut_power(dice, everything=dice.random() < 1 / 3)
        check_database(server)
    server.heal()
    check(start(server), "it does not start without faults")
    check_recent(server, load)
    return starting, changes, worst


def check_recent(server, load):
    """What was acknowledged in the last life, so that the cut which lost it is known."""
    for job in load.recent:
        answer = server.call("GET", "/v1/jobs/" + job)
        if job in load.deleted:
            equal(answer.status, 410, "%s, deleted before the cut" % job)
            continue
        if job in load.to_delete and answer.status == 410:
            continue  # deleted, though the answer was lost with the power
        equal(answer.status, 200, "%s, acknowledged before the cut" % job)
        if job in load.canceled:
            equal(answer.json()["status"], "canceled", "%s, canceled before the cut" % job)


def check_all(server, load):
    end = time.monotonic() + 300
    while any(job["status"] not in TERMINAL for job in server.every_job()):
        check(time.monotonic() < end, "jobs that never end")
        time.sleep(0.2)
    jobs = {job["id"]: job for job in server.every_job()}
    names = [job["name"] for job in jobs.values()]
    equal(len(names), len(set(names)), "the number of names, one for each submit")
    for job, name in load.names.items():
        if job in load.deleted:
            check(job not in jobs, "%s was deleted and is back" % job)
            continue
        if job in load.to_delete and job not in jobs:
            equal(server.call("GET", "/v1/jobs/" + job).status, 410, "%s, deleted, though that was not acknowledged" % job)
            continue
        check(job in jobs, "%s was acknowledged and is lost" % job)
        equal(jobs[job]["name"], name, "the name of " + job)
    for job in jobs:
        events = server.events(job)
        equal([event["seq"] for event in events], list(range(1, len(events) + 1)), "the numbers of " + job)
        equal([event["type"] for event in events].count("done"), 1, "the ends of " + job)
        for seq, event in load.told.get(job, {}).items():
            check(seq <= len(events), "event %d of %s, that a watcher was told, is lost" % (seq, job))
            equal(event, events[seq - 1], "event %d of %s, as a watcher was told" % (seq, job))
    return jobs


def would_find_a_loss(dice):
    """On a disk that lies about syncs an acknowledged job is lost, and that is seen here."""
    with Faulty(undo=True) as server:
        server.write("lying", 1)
        job = server.submit(example())
        server.kill()
        changes = server.cut_power(dice, everything=True)
        server.write("lying", 0)
        server.start()
        equal((changes > 0, server.call("GET", "/v1/jobs/" + job).status), (True, 404), "a job on a disk that lies")


def main():
    print("seed %d" % SEED, flush=True)
    dice = random.Random(SEED)
    would_find_a_loss(dice)
    server = Faulty("--workers", "2", undo=True)
    load = Load(server, dice)
    failed = True
    try:
        starting, changes, worst = cut_again_and_again(server, load, dice)
        jobs = check_all(server, load)
        failed = False
    finally:
        server.__exit__(AssertionError if failed else None)
    check(changes, "nothing was unsynced at any cut")
    told = sum(map(len, load.told.values()))
    print("figure: %d power cuts, %d of them while it started, %d unsynced changes taken back or torn: %d jobs acknowledged, "
          "%d there (the rest deleted or never acknowledged), %d events told, %d cancels and %d deletions: 0 lost, "
          "every integrity_check ok, ready after at most %.2f s" % (
              CUTS, starting, changes, len(load.names), len(jobs), told, len(load.canceled), len(load.deleted), worst))


main()
