"""One client in a storm: 16 threads, 200 tasks, forked and spawned processes, interrupts, cancellations and connections
that are cut, all at random and at the same time.

Each answer has to be that of the job that was asked, and the call after a disturbance has to work within its time-out.
The test of this name is its small form; by hand, for hours:

    tests/soak client [CALLS]
"""

from __future__ import annotations

import argparse
import asyncio
import collections
import concurrent.futures
import contextlib
import multiprocessing
import os
import pickle
import random
import select
import signal
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

from peers import cutting, listening

import signorini as sg

THREADS, TASKS = 16, 200
CUT = 0.03
"""Share of the connections that are cut."""
RETRY_FOR_S = 30.0
LONGEST_S = 60.0
"""Within which every call has to be answered: its repetitions and one time-out."""


class Interrupted(BaseException):
    """What a signal raises."""


class Storm:
    """What is asked, what is right, and what was found.

    calls: how many calls all threads, tasks and processes make together
    """

    def __init__(self, url: str, calls: int, seed: int) -> None:
        self.calls = calls
        self.seed = seed
        self.client = sg.Client(url, retry_for=RETRY_FOR_S)
        self.twin = sg.AsyncClient(url, retry_for=RETRY_FOR_S)
        self.right: dict[str, float] = {}
        self.counts: collections.Counter[str] = collections.Counter()
        self.wrong: list[str] = []
        self.slowest = 0.0
        self._lock = threading.Lock()

    def prepare(self, url: str) -> None:
        """Solves the jobs, and reads their forces over connections that nobody cuts, one for each."""
        with sg.Client(url) as client:
            jobs = client.submit_many([sg.examples.sheet(mu=0.05 + 0.02 * n, refine=0) for n in range(24)])
            for job in jobs:
                job.wait(60, progress=False)
        for job in jobs:
            with sg.Client(url) as client:
                self.right[job.id] = float(client.job(job.id).result().tangential_force)

    def over(self) -> bool:
        return self.counts["calls"] >= self.calls or bool(self.wrong)

    def note(self, who: str, began: float, asked: str, got: str, force: float | None = None) -> None:
        took = time.monotonic() - began
        with self._lock:
            self.counts["calls"] += 1
            self.counts[who] += 1
            self.slowest = max(self.slowest, took)
            if got != asked or (force is not None and force != self.right[asked]) or took > LONGEST_S:
                self.wrong.append(f"{who}: asked {asked}, got {got}, {force} after {took:.1f} s")

    def failed(self, who: str, error: BaseException) -> None:
        with self._lock:
            self.wrong.append(f"{who}: {error!r}")

    def job(self, id: str) -> sg.Job:
        """As somebody knows it who has only its id."""
        return sg.Job(self.client, {"id": id, "status": "queued"})

    def threads(self) -> list[threading.Thread]:
        def work(number: int) -> None:
            chance = random.Random(f"{self.seed} thread {number}")
            try:
                while not self.over():
                    self.ask("threads", chance)
            except BaseException as error:
                self.failed("a thread", error)

        return [threading.Thread(target=work, args=(number,), daemon=True) for number in range(THREADS)]

    def ask(self, who: str, chance: random.Random) -> None:
        """One call of the kinds that people make."""
        asked = chance.choice(list(self.right))
        began = time.monotonic()
        kind = chance.randrange(6)
        if kind == 0:
            self.note(who, began, asked, self.client.job(asked).id)
        elif kind == 1:
            job = self.job(asked)
            self.note(who, began, asked, asked, float(job.wait(30, progress=False).tangential_force))
        elif kind == 2:
            *_, last = self.client._events(f"/v1/jobs/{asked}/events", asked, 0)
            self.note(who, began, asked, last["job"]["id"])
        else:
            result = self.job(asked).result()
            began = time.monotonic()
            if kind == 3:
                profile = result.profile()
                self.note(who, began, asked, asked if len(profile) > 5 else "too little")
            self.note(who, began, asked, result.job.id, float(result.tangential_force))

    def tasks(self) -> threading.Thread:
        """The tasks of asyncio, in a loop that is a new one now and then."""

        async def work(number: int, end: float) -> None:
            chance = random.Random(f"{self.seed} task {number} {end}")
            while not self.over() and time.monotonic() < end:
                asked = chance.choice(list(self.right))
                began = time.monotonic()
                try:
                    job = await asyncio.wait_for(self.twin.job(asked), chance.choice([0.003, 0.03, 0.3, 60]))
                    self.note("tasks", began, asked, job.id)
                except asyncio.TimeoutError:
                    with self._lock:
                        self.counts["cancellations"] += 1
                    continue
                began = time.monotonic()
                result = await job.result()
                self.note("tasks", began, asked, result.job.id, float(result.tangential_force))

        async def all_of_them() -> None:
            end = time.monotonic() + 10
            done = await asyncio.gather(*(work(number, end) for number in range(TASKS)), return_exceptions=True)
            for error in done:
                if error is not None:
                    self.failed("a task", error)

        def run() -> None:
            while not self.over():
                asyncio.run(all_of_them())
                with self._lock:
                    self.counts["event loops"] += 1

        return threading.Thread(target=run, daemon=True)

    def fork(self, chance: random.Random) -> None:
        """A child that is forked in the middle of all this asks with what it has inherited."""
        asked = chance.sample(list(self.right), 3)
        reader, writer = os.pipe()
        child = os.fork()
        if child == 0:
            try:
                found = [force_of(self.job(id)) for id in asked]
                os.write(writer, pickle.dumps(found))
            except BaseException as error:
                os.write(writer, pickle.dumps(repr(error)))
            os._exit(0)
        os.close(writer)
        began = time.monotonic()
        with os.fdopen(reader, "rb") as pipe:
            if not select.select([pipe], [], [], LONGEST_S)[0]:
                os.kill(child, signal.SIGKILL)
                self.wrong.append("a forked process hangs")
            found = pickle.loads(pipe.read() or pickle.dumps("nothing"))
        os.waitpid(child, 0)
        if not isinstance(found, list):
            self.wrong.append(f"a forked process: {found}")
            return
        for id, force in zip(asked, found, strict=True):
            self.note("forked processes", began, id, id, force)

    def spawn(self, pool: concurrent.futures.Executor, chance: random.Random) -> None:
        """A process that was started anew is given jobs, and with them the client."""
        asked = chance.sample(list(self.right), 3)
        began = time.monotonic()
        jobs = [self.job(id) for id in asked]
        for id, force in zip(asked, pool.map(force_of, jobs, timeout=LONGEST_S), strict=True):
            self.note("spawned processes", began, id, id, force)

    def interrupted(self, chance: random.Random) -> None:
        """A call of the main thread that a signal stops somewhere, and the next one, which has to work."""
        try:
            signal.setitimer(signal.ITIMER_REAL, chance.choice([0.0005, 0.003, 0.02]) * chance.random() + 1e-6)
            self.ask("main thread", chance)
            signal.setitimer(signal.ITIMER_REAL, 0)
        except Interrupted:
            self.counts["interrupts"] += 1
        self.ask("after an interrupt", chance)

    def run(self) -> None:
        chance = random.Random(self.seed)
        context = multiprocessing.get_context("spawn")
        started = [*self.threads(), self.tasks()]
        with raising_signals(), concurrent.futures.ProcessPoolExecutor(2, mp_context=context) as pool:
            # started before the storm, so that what is forked is forked on purpose
            list(pool.map(abs, range(4)))
            for thread in started:
                thread.start()
            try:
                while not self.over():
                    for _ in range(20):
                        self.interrupted(chance)
                    self.fork(chance)
                    self.spawn(pool, chance)
            except Exception as error:
                self.failed("the main thread", error)
            for thread in started:
                thread.join(LONGEST_S)
        if any(thread.is_alive() for thread in started):
            self.wrong.append("a thread hangs")


def force_of(job: sg.Job) -> float:
    return float(job.result().tangential_force)


@contextlib.contextmanager
def raising_signals() -> Iterator[None]:
    def handler(*arguments: Any) -> None:
        raise Interrupted

    before = signal.signal(signal.SIGALRM, handler)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def storm(url: str, calls: int, seed: int) -> Storm:
    """Calls of all kinds through a relay that cuts connections; what came of them."""
    with listening(cutting(url, random.Random(seed), CUT)) as relay:
        made = Storm(relay, calls, seed)
        made.prepare(url)
        made.run()
        made.client.close()
        asyncio.run(made.twin.aclose())
    return made


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("calls", type=int, nargs="?", default=100_000)
    parser.add_argument("--seed", type=int, default=random.randrange(1 << 30))
    given = parser.parse_args()
    server = sg.LocalServer(workers=1)
    began = time.monotonic()
    files = len(os.listdir("/proc/self/fd"))
    try:
        made = storm(server.start(), given.calls, given.seed)
    finally:
        server.stop()
    print(f"seed {given.seed}: {made.counts['calls']} calls in {time.monotonic() - began:.0f} s, {dict(made.counts)}")
    print(f"slowest {made.slowest:.1f} s; open files {files} before, {len(os.listdir('/proc/self/fd'))} after")
    print("\n".join(made.wrong[:20]) or "every answer was that of the job asked")
    sys.exit(bool(made.wrong))


if __name__ == "__main__":
    main()
