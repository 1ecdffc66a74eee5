"""Measures what workers on other machines cost the service, and prints the tables of docs/scale.md.

    workers.py [--cores]

`cargo build --release --workspace --all-targets` comes first: workers whose solver only waits are
`target/release/examples/played_workers`. With --cores only the last table, for which 10,240 jobs run at the same time.
"""

import contextlib
import os
import pathlib
import subprocess
import sys
import tempfile
import time

TESTS = pathlib.Path(__file__).resolve().parent.parent
sys.path[:0] = [str(TESTS)]

from outside import BINARY, TOP, Server, check, cpu_s, equal, example, memory, table

PLAYED = TOP / "target/release/examples/played_workers"
MANY = ("--workers", "0", "--max-queued", "1000000")


def waiting():
    """A problem with meshes of its own: for played workers."""
    problem = example()
    problem["solver"] = {"accuracy": "verify"}
    return problem


@contextlib.contextmanager
def started(*command):
    """A program that is killed in the end."""
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen([*map(str, command)], stderr=said)
        try:
            yield process
        finally:
            process.kill()
            process.wait()


def played(server, workers, seconds, slots=1):
    return started(PLAYED, "--server", server.url, "--workers", workers, "--slots", slots, "--seconds", seconds)


def submit(server, problem, count):
    for first in range(0, count, 1000):
        jobs = [{"problem": problem, "cache": "off"} for _ in range(min(1000, count - first))]
        equal(server.call("POST", "/v1/jobs/batch", {"jobs": jobs}).status, 202, "a batch")


def until_ended(server, pause=0.02):
    while True:
        queue = server.json("/v1/queue")
        if queue["queued"] == queue["running"] == 0:
            return
        time.sleep(pause)


def ran(server, problem, count, slots, processes=()):
    """Has jobs solved by workers that are there; returns the wall time and the processor times, of the service and of the
    processes (s). They are submitted before, while the queue is paused."""
    while server.json("/v1/queue")["workers"] < slots:
        time.sleep(0.01)
    equal(server.call("POST", "/v1/queue/pause").status, 200, "a pause")
    before = cpu_s(server.process.pid)
    submit(server, problem, count)
    submitted = cpu_s(server.process.pid) - before
    began, before = time.monotonic(), cpu_s(server.process.pid)
    theirs = sum(cpu_s(process.pid) for process in processes)
    equal(server.call("POST", "/v1/queue/resume").status, 200, "a resumption")
    until_ended(server)
    wall = time.monotonic() - began
    theirs = sum(cpu_s(process.pid) for process in processes) - theirs
    failed = server.json("/v1/jobs/count?status=failed")["total"]
    equal(failed, 0, "failed jobs")
    return wall, cpu_s(server.process.pid) - before, submitted, theirs


def overhead():
    rows = []
    for name, problem, real in (("solves 224 elements, 8 iterations", example(refine=1), True),
                                ("waits for 10 ms, 3 iterations", waiting(), False)):
        with Server(*MANY) as server:
            workers = started(BINARY, "worker", "--server", server.url, "--slots", 1) if real else played(server, 1, 0.01)
            with workers as worker:
                ran(server, problem, 50, 1)
                wall, cpu, submitted, theirs = ran(server, problem, 500, 1, [worker])
        rows.append((name, 1e3 * wall / 500, 1e3 * theirs / 500, 1e3 * cpu / 500, 1e3 * submitted / 500))
    table("A job at one worker elsewhere with one slot, ms (500 jobs)", ("the job", "wall", "processor time of the worker", "of the service: lease, "
          "iterations, result, end", "of the service before: to accept it, in batches of 1000"), rows)


def rates():
    rows = []
    for workers, seconds, count in ((64, 0.2, 4000), (256, 0.8, 4000), (1024, 3.2, 6000)):
        with Server(*MANY) as server, played(server, workers, seconds) as process:
            ran(server, waiting(), workers, workers)
            wall, cpu, _, theirs = ran(server, waiting(), count, workers, [process])
        rows.append((workers, seconds, workers / seconds, count / wall, 1e3 * cpu / count, 1e3 * theirs / count))
    table("Jobs a second to workers that wait", ("workers", "a job waits, s", "jobs a second, if the service cost nothing", "jobs a second",
          "processor time of the service, ms a job", "of all workers, ms a job"), rows)


def throughput():
    rows = []
    for workers in (1, 2, 4, 8):
        found = [workers]
        with Server(*MANY) as server, played(server, workers, 0.1) as process:
            ran(server, waiting(), workers, workers)
            found.append(60 * workers / ran(server, waiting(), 60 * workers, workers, [process])[0])
        with Server(*MANY) as server, contextlib.ExitStack() as stack:
            command = (BINARY, "worker", "--server", server.url, "--slots", 1)
            processes = [stack.enter_context(started(*command)) for _ in range(workers)]
            ran(server, example(refine=2), 20, workers)
            found.append(300 / ran(server, example(refine=2), 300, workers, processes)[0])
        rows.append(found)
    first = rows[0]
    rows = [(n, waits, waits / first[1], solves, solves / first[2]) for n, waits, solves in rows]
    table("Jobs a second against the number of workers, each of one slot", ("workers", "jobs that wait for .1 s", "times that of one",
          "jobs that solve 896 elements, on two processors with the service", "times that of one"), rows)


def idle():
    """What workers cost that have nothing to tell: those that wait for a job, and those that renew leases."""
    rows = []
    for workers in (1000,):
        with Server(*MANY) as server:
            empty = memory(server.process.pid)
            with played(server, workers, 60):
                while server.json("/v1/queue")["workers"] < workers:
                    time.sleep(0.05)
                time.sleep(2)
                before = cpu_s(server.process.pid)
                time.sleep(20)
                waits = (cpu_s(server.process.pid) - before) / 20
                taken = memory(server.process.pid) - empty
                submit(server, waiting(), workers)
                while server.json("/v1/queue")["queued"]:
                    time.sleep(0.05)
                time.sleep(2)
                before = cpu_s(server.process.pid)
                time.sleep(20)
                renews = (cpu_s(server.process.pid) - before) / 20
        rows.append((workers, 100 * waits, 100 * renews, taken / workers / 1024))
    table("Workers without news", ("workers", "they wait for jobs: processors of the service, %", "they solve, and renew leases: %",
          "memory of the service for each, KiB"), rows)


def cores():
    """10,240 slots: as many as 160 nodes of 64 cores. Jobs take between half and one and a half of their time."""
    workers, slots, count = 160, 64, 30_000
    rows = []
    for seconds in (40, 80):
        with Server(*MANY) as server, played(server, workers, seconds, slots):
            while server.json("/v1/queue")["workers"] < workers * slots:
                time.sleep(0.05)
            submit(server, waiting(), count)
            # from when all are busy until none waits
            queue = server.json("/v1/queue")
            while queue["running"] < 0.98 * workers * slots and queue["queued"]:
                time.sleep(0.1)
                queue = server.json("/v1/queue")
            first, busy = queue["queued"], []
            began, before = time.monotonic(), cpu_s(server.process.pid)
            while queue["queued"]:
                busy.append(queue["running"])
                time.sleep(0.1)
                queue = server.json("/v1/queue")
            wall, cpu = time.monotonic() - began, cpu_s(server.process.pid) - before
            taken = memory(server.process.pid)
            until_ended(server, 0.2)
            equal(server.json("/v1/jobs/count?status=succeeded")["total"], count, "jobs that succeeded")
            equal({job["attempt"] for job in server.every_job()[:2000]}, {1}, "attempts")
        share = sum(busy) / len(busy) / (workers * slots)
        rows.append((seconds, workers * slots / seconds, first / wall, 100 * share, 1e3 * cpu / first, 100 * cpu / wall, taken / 2**20))
    table("%d slots of %d workers, all busy and jobs waiting" % (workers * slots, workers),
          ("a job takes, s", "jobs a second, if the service cost nothing", "jobs a second", "slots that solve, %", "processor time of the service, ms a job",
           "of one processor, %", "memory, MiB"), rows)


check(PLAYED.exists(), "no %s: run `cargo build --release --workspace --all-targets`" % PLAYED)
for part in ((cores,) if "--cores" in sys.argv else (overhead, rates, throughput, idle, cores)):
    part()
