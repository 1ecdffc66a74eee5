"""A server that is told to stop again and again under load (R18).

    stops.py [--soak] [SEED]

SIGTERM at random moments, sometimes twice or with a SIGHUP before it, while jobs are submitted, run and are watched.
Each time it ends with 0 within its grace time; whoever waits is answered; server-sent events end without `done`, gRPC
streams with UNAVAILABLE, and both resume after the restart without a gap. No acknowledged job is lost or fails. Then
the same with worker processes, which receive each signal as well, as when a terminal or systemd stops all of a group:
no job counts that as a death.
"""

import asyncio
import contextlib
import faulthandler
import json
import os
import random
import signal
import sqlite3
import sys
import threading
import time

sys.path.insert(0, __file__.rsplit("/", 2)[0] + "/clients")

import grpc
from attack import SOAK, Attacked, check, equal, example
from faults import check_database
from outside import TERMINAL, Connection, Lost, children, each, percentile, submission, talkative
from reflected import Client

STOPS = {"thread": 100, "process": 100} if SOAK else {"thread": 20, "process": 8}
SEED = next((int(word) for word in sys.argv[1:] if word.isdigit()), random.randrange(1 << 32))
GRACE_S = 3
SUBMITTERS, PER_S, FOLLOWERS = 4, 40, 4
# long enough to be interrupted by every stop
LONG = dict(increments=1200, refine=3)


class Load:
    """Clients that outlive the stops of the server."""

    def __init__(self, server):
        self.server, self.acknowledged, self.sent, self.over = server, {}, 0, False
        self.refused = self.cut_sse = self.cut_grpc = self.events = 0
        # of the server: odd from a signal on until its successor runs
        self.turns = 0
        self.failure, self.grpc_jobs = None, {}
        self.known = Client(server.address)

    def stopping(self, since):
        """Whether what began when `turns` was `since` was broken off by a stop: the server stops, or did meanwhile."""
        return self.turns > since or self.turns % 2 == 1

    async def submit(self, _):
        connection = Connection(self.server)
        problem, since = example(), self.turns
        while not self.over:
            self.sent += 1
            name, began = "job %d" % self.sent, time.monotonic()
            try:
                asked = self.turns
                answer = await connection.call("POST", "/v1/jobs", submission(problem, name=name))
                if answer.status == 503:
                    equal(answer.json()["code"], "draining", "a refusal while stopping")
                    check(self.stopping(since), "draining, and nobody had asked for it")
                    self.refused += 1
                else:
                    equal(answer.status, 202, "submit, %r" % answer)
                    self.acknowledged[answer.json()["id"]] = name
                # the connection was still that of this server
                since = asked
            except Lost:
                check(self.stopping(since), "a submit was cut off by a server that runs")
                connection.close()
                since = self.turns
            await asyncio.sleep(max(0, began + SUBMITTERS / PER_S - time.monotonic()))
        connection.close()

    async def follow(self, job):
        """Server-sent events from stop to stop, with the number of the last one, until `done`."""
        seen = 0
        while True:
            since = self.turns
            try:
                host, port = self.server.address.split(":")
                reader, writer = await asyncio.open_connection(host, int(port), limit=1 << 20)
            except OSError:
                await asyncio.sleep(0.01)
                continue
            before = seen
            try:
                request = "GET /v1/jobs/%s/events HTTP/1.1\r\nhost: localhost\r\nlast-event-id: %d\r\n\r\n"
                writer.write((request % (job, seen)).encode())
                status = (await reader.readuntil(b"\r\n")).split()[1]
                check(status in (b"200", b"503"), "events of %s: %r" % (job, status))
                while status == b"200":
                    line = await reader.readuntil(b"\n")
                    if line.startswith(b"data: "):
                        event = json.loads(line[6:])
                        seen += 1
                        equal(event["seq"], seen, "the next event of " + job)
                        self.events += 1
                        if event["type"] == "done":
                            equal(event["job"]["status"], "succeeded", "the end of " + job)
                            return
                    elif line == b"0\r\n":
                        # the end of a chunked body: in good order, though the job has not ended
                        self.cut_sse += seen > before
                        check(self.stopping(since), "a stream ended without done, and the server runs")
                        break
                await asyncio.sleep(0.01)
            except (OSError, EOFError):
                check(self.stopping(since), "a stream was cut off by a server that runs")
                await asyncio.sleep(0.01)
            finally:
                writer.close()

    def follow_grpc(self, job):
        """The same by WatchJob, in a thread."""
        try:
            seen, done = 0, False
            while not done and not self.failure:
                before, since = seen, self.turns
                try:
                    with Client(self.server.address, known=self.known) as client:
                        for event in client.WatchJob(id=job, after_seq=seen):
                            seen += 1
                            equal(event.seq, seen, "the next event of " + job)
                            self.events += 1
                            done = event.WhichOneof("payload") == "done"
                    check(done, "WatchJob of %s ended in good order before done" % job)
                except grpc.RpcError as error:
                    equal(error.code().name, "UNAVAILABLE", "the end of WatchJob when the server stops")
                    check(self.stopping(since), "UNAVAILABLE from a server that runs: %s" % error.details())
                    self.cut_grpc += seen > before
                time.sleep(0.02)
        except BaseException as error:
            self.failure = error


def send(server, number, workers):
    """A signal to the service and its worker processes, those first."""
    pids = children(server.process.pid)
    check(len(pids) >= workers or server.process.poll() is not None, "%d worker processes" % len(pids))
    for pid in (*pids, server.process.pid):
        with contextlib.suppress(ProcessLookupError):  # it has ended
            os.kill(pid, number)


def stop(server, load, dice, workers):
    """Seconds until it had ended."""
    began = time.monotonic()
    load.turns += 1
    kind = dice.choice(("once", "once", "twice", "at once twice", "hangup"))
    if kind == "hangup":
        send(server, signal.SIGHUP, workers)
        time.sleep(0.02)
        check(server.process.poll() is None, "SIGHUP ended it")
    send(server, signal.SIGTERM, workers)
    if kind.endswith("twice"):
        if kind == "twice":
            time.sleep(dice.uniform(0, 0.05))
        send(server, signal.SIGTERM, 0)
    equal(server.process.wait(timeout=GRACE_S + 20), 0, "exit code after SIGTERM (%s)" % kind)
    took = time.monotonic() - began
    check(took <= GRACE_S + 1, "it ended only %.2f s after SIGTERM (%s)" % (took, kind))
    return took


async def stop_under_load(server, dice, stops, workers):
    load, loop = Load(server), asyncio.get_running_loop()
    long = [server.submit(talkative(**LONG), priority=5) for _ in range(2)]
    threads = [threading.Thread(target=load.follow_grpc, args=(job,), daemon=True) for job in long]
    for thread in threads:
        thread.start()
    clients = [asyncio.ensure_future(each(range(SUBMITTERS), load.submit)),
               asyncio.ensure_future(each(long * (FOLLOWERS // 2), load.follow))]
    times = []
    for _ in range(stops):
        ended, _ = await asyncio.wait(clients, timeout=dice.uniform(0.05, 1), return_when=asyncio.FIRST_EXCEPTION)
        for client in ended:
            client.result()
        check(load.failure is None, "gRPC: %r" % load.failure)
        times.append(await loop.run_in_executor(None, stop, server, load, dice, workers))
        check_database(server)
        await loop.run_in_executor(None, server.start)
        load.turns += 1
    load.over = True
    await asyncio.wait_for(asyncio.gather(*clients), 300)
    await loop.run_in_executor(None, lambda: [thread.join(60) for thread in threads])
    check(load.failure is None, "gRPC: %r" % load.failure)
    if any(thread.is_alive() for thread in threads):
        faulthandler.dump_traceback(all_threads=True)
        check(False, "a gRPC client that never ends, after %d events; its jobs: %r" % (load.events, [
            (job["status"], job["attempt"]) for job in server.every_job() if job["id"] in long]))
    return load, times


def attack(isolation, stops, dice):
    """Stops of a server; what was seen."""
    with Attacked("--workers", "2", "--grace-s", str(GRACE_S), "--isolation", isolation) as server:
        load, times = asyncio.run(stop_under_load(server, dice, stops, 2 if isolation == "process" else 0))
        end = time.monotonic() + 120
        while any(job["status"] not in TERMINAL for job in server.every_job()):
            check(time.monotonic() < end, "jobs that never end")
            time.sleep(0.2)
        jobs = {job["id"]: job for job in server.every_job()}
        for job, name in load.acknowledged.items():
            check(job in jobs, "%s was acknowledged and is lost" % job)
            equal((jobs[job]["name"], jobs[job]["status"]), (name, "succeeded"), "%s, acknowledged" % job)
        names = [job["name"] for job in jobs.values() if job["name"]]
        equal(len(names), len(set(names)), "the number of names, one for each submit")
        for job in jobs:
            events = server.events(job)
            equal([event["seq"] for event in events], list(range(1, len(events) + 1)), "the numbers of " + job)
            equal([event["type"] for event in events].count("done"), 1, "the ends of " + job)
            lost = [event for event in events if event.get("reason") == "worker_lost"]
            equal(lost, [], "events of deaths of " + job)
        server.stop()
        check_database(server)
    check(load.cut_sse and load.cut_grpc, "no stream was cut by a stop")
    return ("isolation %s: %d stops under load, some by two SIGTERMs or after a SIGHUP: exit 0 after %.0f ms (median), %.0f ms at "
            "most (grace %d s); %d jobs acknowledged, 0 lost, all succeeded; %d submits refused as draining; server-sent events "
            "ended %d times without done, WatchJob %d times with UNAVAILABLE, all %d events heard in order" % (
                isolation, stops, 1e3 * percentile(times, 0.5), 1e3 * max(times), GRACE_S, len(load.acknowledged), load.refused,
                load.cut_sse, load.cut_grpc, load.events))


def beside_a_reader():
    """Another program reads the store, as one that copies it does: the service stops all the same, and knows that it has."""
    with Attacked() as server:
        server.finished_job()
        with contextlib.closing(sqlite3.connect("file:%s?mode=ro" % (server.data / "signorini.db"), uri=True)) as reader:
            reader.execute("begin")
            reader.execute("select count(*) from job").fetchall()
            server.finished(server.submit(example()))
            server.stop()
            check("did not close in time" not in server.log.read_text(), "the store is closed beside a reader")
            check(" stopped " in (server.data / "signorini.progress").read_text(), "the store knows that the service has stopped")
        server.start()
        equal(len(server.every_job(status="succeeded")), 2, "jobs after the restart")
        server.stop()


def main():
    print("seed %d" % SEED, flush=True)
    beside_a_reader()
    dice = random.Random(SEED)
    print("figure: " + "; ".join(attack(isolation, stops, dice) for isolation, stops in STOPS.items()))


main()
