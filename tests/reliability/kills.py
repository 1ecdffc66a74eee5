"""A server that is killed again and again under load, and what it had promised before (R1).

    kills.py [KILLS] [SEED]

About 50 submits a second, 20 watchers, two workers; kill -9 at random times, and a restart on the same
data; the database is checked as a whole after each of the first 50 and every tenth, since it grows by some MiB each time.
In the end every acknowledged job is there exactly once and terminal with one `done`, no job is
there that nobody handed in, and nobody was told an event that the end does not know.
"""

import asyncio
import json
import pathlib
import random
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import outside
from faults import check_database
from outside import TERMINAL, Connection, Lost, Server, check, each, equal, example, submission

KILLS = int(sys.argv[1]) if len(sys.argv) > 1 else 50
SEED = int(sys.argv[2]) if len(sys.argv) > 2 else random.randrange(1 << 32)
SUBMITS_PER_S, SUBMITTERS, WATCHERS = 50, 5, 20
MOST_READY_S = 2
EXAMPLES = ("rectangular_punch", "cylinder", "annular_punch", "cylinder_on_end", "sheet")


class Load:
    """What the clients have handed in and heard."""

    def __init__(self, server, dice):
        self.server, self.dice = server, dice
        self.sent, self.acknowledged, self.told = 0, {}, {}
        self.over = False

    async def submit(self, _):
        """Hands in jobs at a steady rate, each under a name of its own."""
        connection = Connection(self.server)
        problems = [example(name) for name in EXAMPLES]
        while not self.over:
            self.sent += 1
            name = "job %d" % self.sent
            began = time.monotonic()
            try:
                answer = await connection.call("POST", "/v1/jobs", submission(problems[self.sent % 5], name=name))
                equal(answer.status, 202, "submit, %r" % answer)
                self.acknowledged[answer.json()["id"]] = name
            except Lost:
                pass  # never acknowledged: it may be there or not
            await asyncio.sleep(max(0, began + SUBMITTERS / SUBMITS_PER_S - time.monotonic()))
        connection.close()

    async def watch(self, _):
        """Follows one of the last jobs to its end, then another."""
        while not self.over:
            if not self.acknowledged:
                await asyncio.sleep(0.01)
                continue
            job = self.dice.choice(list(self.acknowledged)[-100:])
            while not self.over:
                lines = self.told.setdefault(job, {})
                try:
                    if await self.hear(job, lines, max(lines, default=0)):
                        break
                except (OSError, EOFError):
                    await asyncio.sleep(0.02)

    async def hear(self, job, lines, seen):
        """Events of a job until the stream breaks; tells whether there are no more."""
        host, port = self.server.address.split(":")
        reader, writer = await asyncio.open_connection(host, int(port), limit=1 << 20)
        try:
            request = "GET /v1/jobs/%s/events?after_seq=%d HTTP/1.1\r\nhost: localhost\r\n\r\n"
            writer.write((request % (job, seen)).encode())
            status = (await reader.readuntil(b"\r\n")).split()[1]
            check(status in (b"200", b"204"), "events of %s: %r" % (job, status))
            if status == b"204":
                return True
            while True:
                line = await reader.readuntil(b"\n")
                if line.startswith(b"data: "):
                    event = json.loads(line[6:])
                    seen += 1
                    equal(event["seq"], seen, "the next event of " + job)
                    lines[seen] = event
                    if event["type"] == "done":
                        return True
        finally:
            writer.close()


async def kill_under_load(server, dice):
    load = Load(server, dice)
    clients = [asyncio.ensure_future(each(range(SUBMITTERS), load.submit)),
               asyncio.ensure_future(each(range(WATCHERS), load.watch))]
    loop, worst = asyncio.get_running_loop(), 0
    for number in range(KILLS):
        ended, _ = await asyncio.wait(clients, timeout=dice.uniform(0.05, 1.5), return_when=asyncio.FIRST_COMPLETED)
        for client in ended:
            client.result()
        server.kill()
        if number < 50 or number % 10 == 0:
            check_database(server)
        # in a thread: the clients knock at the door meanwhile
        worst = max(worst, await loop.run_in_executor(None, server.start))
    check(worst <= MOST_READY_S, "ready only after %.2f s" % worst)
    await asyncio.sleep(0.5)
    load.over = True
    await asyncio.gather(*clients)
    return load, worst


def main():
    print("seed %d" % SEED, flush=True)
    dice = random.Random(SEED)
    with Server("--workers", "2") as server:
        load, worst = asyncio.run(kill_under_load(server, dice))
        end = time.monotonic() + 120
        while any(job["status"] not in TERMINAL for job in server.every_job()):
            check(time.monotonic() < end, "jobs that never end")
            time.sleep(0.2)
        jobs = {}
        for job in server.every_job():
            check(job["id"] not in jobs, "%s is listed twice" % job["id"])
            jobs[job["id"]] = job
        names = [job["name"] for job in jobs.values()]
        equal(len(names), len(set(names)), "the number of names, one for each submit")
        for job, name in load.acknowledged.items():
            check(job in jobs, "%s was acknowledged and is lost" % job)
            equal(jobs[job]["name"], name, "the name of " + job)
        for job in jobs:
            events = server.events(job)
            equal([event["seq"] for event in events], list(range(1, len(events) + 1)), "the numbers of " + job)
            equal([event["type"] for event in events].count("done"), 1, "the ends of " + job)
            last = events[-1]
            equal((last["type"], last["job"]["status"]), ("done", jobs[job]["status"]), "the end of " + job)
            for seq, event in load.told.get(job, {}).items():
                equal(event, events[seq - 1], "event %d of %s, as a watcher was told" % (seq, job))
        server.kill()
        check_database(server)
    statuses = [job["status"] for job in jobs.values()]
    restarted = sum(job["attempt"] > 1 for job in jobs.values())
    print("%d checks" % outside.checks)
    print("figure: %d kills, %d submits, %d acknowledged, %d jobs, all terminal (%s), %d of them started more than once; %d "
          "events watched; ready after at most %.2f s" % (
              KILLS, load.sent, len(load.acknowledged), len(jobs),
              ", ".join("%d %s" % (statuses.count(s), s) for s in TERMINAL if s in statuses), restarted,
              sum(map(len, load.told.values())), worst))


main()
