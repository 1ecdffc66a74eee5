"""Whatever stops a call, an interrupt, a cancellation, a time-out, leaves the next call alone, and holds nothing."""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import faulthandler
import functools
import gc
import io
import multiprocessing
import multiprocessing.connection
import os
import pathlib
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from peers import listening, silent, trickling
from storm import storm

import signorini as sg

PROBLEM = sg.examples.rectangular_punch(refine=0)


def open_files() -> int:
    gc.collect()
    return len(os.listdir("/proc/self/fd"))


def in_process(work: Callable[..., None], *arguments: Any) -> None:
    """Does something in a process of its own: what measures coverage has a lock that a signal may leave closed."""
    process = multiprocessing.get_context("spawn").Process(target=observed, args=(work, *arguments))
    process.start()
    if not multiprocessing.connection.wait([process.sentinel], 150):
        process.kill()
        raise AssertionError("it hangs")
    # a process that another thread starts collects those that have ended: then it is seen a moment later here
    while process.exitcode is None:
        time.sleep(0.01)
    assert process.exitcode == 0, "its error is on standard error"


def observed(work: Callable[..., None], *arguments: Any) -> None:
    """Says where it hangs, if it does."""
    faulthandler.dump_traceback_later(100, exit=True)
    work(*arguments)
    faulthandler.cancel_dump_traceback_later()


@contextlib.contextmanager
def interrupted(kind: type[BaseException], after: float) -> Iterator[None]:
    """A signal raises this after so many seconds, here, or nowhere: what the system delivers late is left out."""
    armed = True

    def handler(*arguments: Any) -> None:
        if armed:
            raise kind("from a signal")

    signal.signal(signal.SIGALRM, handler)
    signal.setitimer(signal.ITIMER_REAL, after)
    try:
        yield
    finally:
        armed = False
        signal.setitimer(signal.ITIMER_REAL, 0)


def signals_during_calls(url: str, id: str, kind: type[BaseException]) -> None:
    client = sg.Client(url)
    chance = random.Random(1983)
    interrupts = 0
    others: list[Any] = []
    end = threading.Event()

    def ask() -> None:
        while not end.is_set():
            others.append(client.job(id).id == id)

    threads = [threading.Thread(target=ask, daemon=True) for _ in range(3)]
    for thread in threads:
        thread.start()
    files = open_files()
    for _ in range(400):
        try:
            with interrupted(kind, chance.uniform(1e-5, 0.006)):
                assert client.job(id).id == id
        except kind:
            interrupts += 1
        began = time.monotonic()
        assert client.job(id).id == id
        assert time.monotonic() - began < 10
    end.set()
    for thread in threads:
        thread.join(10)
    assert interrupts > 20, "the signal was seen, not taken for something of the network"
    assert len(others) > 20 and all(others) and not any(thread.is_alive() for thread in threads)
    assert open_files() < files + 30


def signals_during_streams(url: str, id: str) -> None:
    # Python drops what a signal raises while a generator is thrown away, and says so
    sys.unraisablehook = lambda _: None
    job = sg.Client(url).job(id)
    chance = random.Random(1983)
    files = open_files()
    for _ in range(200):
        with contextlib.suppress(KeyboardInterrupt), interrupted(KeyboardInterrupt, chance.uniform(1e-5, 0.01)):
            for event in job.events():
                assert event.seq
        assert [event.type for event in job.events()][-1] == "done"
    assert open_files() < files + 30


@pytest.mark.parametrize("kind", [KeyboardInterrupt, TimeoutError, ConnectionResetError])
def test_a_signal_at_any_moment_of_a_call(kind: type[BaseException], server: sg.LocalServer, punch: sg.Result) -> None:
    in_process(signals_during_calls, server.url, punch.job.id, kind)


def signals_during_the_first_calls(url: str, id: str, seed: int) -> None:
    """The HTTP library imports modules when it is first used, under locks that all threads need."""
    client = sg.Client(url)
    chance = random.Random(seed)
    threads = [threading.Thread(target=client.job, args=(id,), daemon=True) for _ in range(3)]
    for thread in threads:
        thread.start()
    for _ in range(15):
        with contextlib.suppress(ConnectionResetError), interrupted(ConnectionResetError, chance.uniform(1e-5, 0.03)):
            client.job(id)
    assert client.job(id).id == id
    for thread in threads:
        thread.join(30)
    assert not any(thread.is_alive() for thread in threads)


def test_a_signal_during_the_first_calls_of_a_program(server: sg.LocalServer, punch: sg.Result) -> None:
    # where it hangs, it does in one process of ten
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        ask = functools.partial(in_process, signals_during_the_first_calls, server.url, punch.job.id)
        assert list(pool.map(ask, range(24))) == [None] * 24


def test_a_signal_in_the_middle_of_a_stream(server: sg.LocalServer, punch: sg.Result) -> None:
    in_process(signals_during_streams, server.url, punch.job.id)


def test_streams_that_are_left_half_read(client: sg.Client, punch: sg.Result) -> None:
    files = open_files()
    for number in range(60):
        events = punch.job.events()
        next(events)
        if number % 2:
            with pytest.raises(ZeroDivisionError):
                for _ in events:
                    raise ZeroDivisionError
        assert client.job(punch.job.id).id == punch.job.id
    del events
    assert open_files() < files + 30


def test_a_cancellation_at_any_moment_of_a_call(server: sg.LocalServer, punch: sg.Result) -> None:
    async def run() -> None:
        async with sg.AsyncClient(server.url, retry_for=5) as client:
            chance = random.Random(1983)
            canceled = 0

            async def one() -> None:
                nonlocal canceled
                try:
                    job = await asyncio.wait_for(client.job(punch.job.id), chance.uniform(0, 0.05))
                    assert job.id == punch.job.id
                except asyncio.TimeoutError:
                    canceled += 1

            await client.job(punch.job.id)
            files = open_files()
            for _ in range(40):
                await asyncio.gather(*(one() for _ in range(40)))
            assert canceled > 100
            await asyncio.sleep(0.2)
            assert open_files() < files + 40, "connections are given back"
            assert (await asyncio.wait_for(client.job(punch.job.id), 5)).id == punch.job.id

    asyncio.run(run())


def test_many_streams_and_waits_starve_no_other_call(server: sg.LocalServer, client: sg.Client) -> None:
    labels = {"crowd": "yes"}
    client.pause_queue()
    try:
        jobs = client.submit_many([sg.Submission(PROBLEM, f"s{n}", labels, cache="off") for n in range(130)])
        streams = [job.events() for job in jobs]
        for stream in streams:
            next(stream)
        began = time.monotonic()
        assert client.job(jobs[0].id).id == jobs[0].id
        assert time.monotonic() - began < 5
        del streams, stream

        async def run() -> None:
            async with sg.AsyncClient(server.url, retry_for=10) as twin:

                async def follow(job: sg.Job) -> str:
                    *_, last = [event.type async for event in sg.AsyncJob(twin, job.document).events()]
                    return last

                following = [asyncio.create_task(follow(job)) for job in jobs]
                waiting = [
                    asyncio.create_task(sg.AsyncJob(twin, job.document).wait(120, progress=False))
                    for job in jobs
                    for _ in range(2)
                ]
                await asyncio.sleep(1)
                began = time.monotonic()
                await twin.resume_queue()
                assert time.monotonic() - began < 5
                assert set(await asyncio.gather(*following)) == {"done"}
                assert all(result.converged for result in await asyncio.gather(*waiting))

        asyncio.run(run())
    finally:
        client.resume_queue()


@pytest.mark.parametrize("handler", [silent, trickling])
def test_a_wait_ends_with_its_time_out_whatever_the_service_does(handler: Any) -> None:
    job = {"id": "job_1", "status": "queued", "name": None, "result_available": "none"}
    sweep: dict[str, Any] = {"id": "sweep_1", "status": "queued", "name": None, "members": {}, "finished_at": None}
    with listening(handler) as url, sg.Client(url) as client:

        def of_thread() -> None:
            with pytest.raises(sg.WaitTimeout):
                sg.Job(client, job).wait(timeout=0.5, progress=False)

        thread = threading.Thread(target=of_thread)
        began = time.monotonic()
        thread.start()
        with pytest.raises(sg.WaitTimeout, match="The service does not answer: .*no answer in time"):
            sg.Job(client, job).wait(timeout=0.5, progress=False)
        thread.join()
        with pytest.raises(TimeoutError):
            sg.Sweep(client, sweep).wait(timeout=0, progress=False)

        async def run() -> None:
            async with sg.AsyncClient(url) as twin:
                with pytest.raises(sg.WaitTimeout):
                    await sg.AsyncJob(twin, job).wait(timeout=0.5, progress=False)
                with pytest.raises(sg.WaitTimeout):
                    await sg.AsyncSweep(twin, sweep).wait(timeout=0, progress=False)

        asyncio.run(run())
        assert time.monotonic() - began < 9
    with pytest.raises(sg.WaitTimeout):
        sg.Job(sg.Client(url), job).wait(timeout=0.5, progress=False)


def test_a_call_at_the_end_of_a_program(server: sg.LocalServer, punch: sg.Result, tmp_path: pathlib.Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import atexit, sys\nimport signorini as sg\n"
        "client = sg.Client(sys.argv[1])\n"
        "half = client.job(sys.argv[2]).events()\n"
        "next(half)\n"
        "atexit.register(lambda: print(client.info()['name']))\n"
    )
    command = [sys.executable, "-X", "dev", str(script), server.url, punch.job.id]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.returncode) == ("signorini\n", 0) and "Exception" not in done.stderr, done.stderr


class OnlyWrites:
    def __init__(self) -> None:
        self.said = ""

    def write(self, text: str) -> None:
        self.said += text


class Closed(io.StringIO):
    def __init__(self) -> None:
        super().__init__()
        self.close()


class Full(io.StringIO):
    def write(self, text: str) -> int:
        raise OSError(28, "No space left on device")


@pytest.mark.parametrize(
    "make",
    [
        lambda: None,
        OnlyWrites,
        Closed,
        Full,
        lambda: io.TextIOWrapper(io.BytesIO(), "ascii"),
        lambda: io.TextIOWrapper(io.BytesIO(), "cp1252"),
    ],
)
def test_waiting_needs_no_standard_error(
    make: Callable[[], Any], client: sg.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    for progress in (True, False):
        out = make()
        with monkeypatch.context() as patched:
            patched.setattr(sys, "stderr", out)
            assert client.submit(PROBLEM, name="größe σ", cache="off").wait(60, progress=progress).converged
            sweep = client.sweep(PROBLEM, {"contacts.0.friction.coefficient": [0.1, 0.2]}, name="größe σ")
            assert sweep.wait(60, progress=progress).ended
        if progress and isinstance(out, OnlyWrites):
            assert "größe σ · succeeded" in out.said
        if progress and isinstance(out, io.TextIOWrapper):
            assert b"\\u03c3" in out.buffer.getvalue()


def small_storm(url: str) -> None:
    made = storm(url, 2500, 1983)
    assert not made.wrong, "\n".join(made.wrong[:20])
    for kind in ("interrupts", "cancellations", "forked processes", "spawned processes", "threads", "tasks"):
        assert made.counts[kind] > 0, made.counts


def test_one_client_in_a_storm(server: sg.LocalServer) -> None:
    in_process(small_storm, server.url)
