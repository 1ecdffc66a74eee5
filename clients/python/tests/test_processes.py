"""One client in many processes, event loops and copies: each answer is that of the job that was asked for."""

from __future__ import annotations

import asyncio
import concurrent.futures
import copy
import multiprocessing
import os
import pathlib
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any

import pytest
from conftest import long_problem, unconverged_problem

import signorini as sg

METHODS = multiprocessing.get_all_start_methods()
_JOBS: list[sg.Job] = []


@pytest.fixture(scope="module")
def jobs(client: sg.Client) -> list[sg.Job]:
    found = client.submit_many([sg.examples.sheet(mu=0.1 * i, refine=0) for i in range(1, 9)])
    for job in found:
        job.wait(60, progress=False)
    return found


@pytest.fixture(scope="module")
def right(jobs: list[sg.Job]) -> list[float]:
    return [float(job.result().tangential_force) for job in jobs]


def force(job: sg.Job) -> float:
    return float(job.refresh().result().tangential_force)


def force_of_global(number: int) -> float:
    return force(_JOBS[number])


@pytest.mark.parametrize("method", METHODS)
def test_a_pool_of_processes_is_given_jobs(method: str, jobs: list[sg.Job], right: list[float]) -> None:
    context = multiprocessing.get_context(method)
    with concurrent.futures.ProcessPoolExecutor(3, mp_context=context) as pool:
        assert list(pool.map(force, jobs)) == right
    with context.Pool(3) as other:
        assert other.map(force, jobs) == right


def test_forked_processes_share_what_was_there(jobs: list[sg.Job], right: list[float]) -> None:
    _JOBS[:] = jobs
    context = multiprocessing.get_context("fork")
    for _ in range(3):
        with concurrent.futures.ProcessPoolExecutor(4, mp_context=context) as pool:
            assert list(pool.map(force_of_global, range(8))) == right
        assert [force(job) for job in jobs] == right, "and the parent goes on with its own connections"


def in_child(work: Any) -> Any:
    """What a function returns in a child that was forked with everything that there is."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            found = work()
        except BaseException as error:
            found = repr(error)
        os.write(writer, pickle.dumps(found))
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        found = pickle.loads(pipe.read())
    os.waitpid(child, 0)
    return found


def test_a_stream_of_events_that_is_half_read_when_a_process_is_forked(client: sg.Client) -> None:
    job = client.submit(long_problem(400), cache="off")
    events = job.events()
    first = [next(events).seq for _ in range(3)]

    def rest() -> list[int]:
        return [event.seq for event in events]

    in_the_child = in_child(rest)
    here = rest()
    assert first == [1, 2, 3] and here == in_the_child == list(range(4, 4 + len(here)))


def test_threads_that_ask_while_others_fork(client: sg.Client, jobs: list[sg.Job], right: list[float]) -> None:
    wrong: list[Any] = []
    end = threading.Event()

    def ask() -> None:
        while not end.is_set():
            for job, expected in zip(jobs, right, strict=True):
                if force(sg.Job(client, job.document)) != expected:
                    wrong.append(job.id)

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for _ in range(10):
        assert in_child(lambda: [force(job) for job in jobs]) == right
    end.set()
    for thread in threads:
        thread.join(30)
    assert not wrong and not any(thread.is_alive() for thread in threads)


def test_a_service_of_ones_own_is_not_stopped_by_a_child(tmp_path: pathlib.Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import os, sys\nimport signorini as sg\n"
        "client = sg.Client.local()\n"
        "child = os.fork()\n"
        "if child == 0:\n    client.close()\n    sys.exit(0)\n"
        "os.waitpid(child, 0)\n"
        "print(client.info()['name'], client._server.data.exists())\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=60)
    assert done.stdout == "signorini True\n", done.stderr


def test_copies_and_pickles(client: sg.Client, punch: sg.Result, jobs: list[sg.Job]) -> None:
    sweep = client.sweep(sg.examples.sheet(refine=0), {"contacts.0.indentation": [0.01, 0.02]})
    member = sweep.wait(60, progress=False).member(1)
    with sg.Client("http://user@lab.test:1", token="t", retry_for=7) as other:
        twin = pickle.loads(pickle.dumps(other))
        assert (twin.url, twin.retry_for, twin._connection) == (other.url, 7, other._connection)
        assert twin._http is not other._http
    ways: list[Callable[[Any], Any]] = [lambda x: pickle.loads(pickle.dumps(x)), copy.deepcopy, copy.copy]
    for made in ways:
        assert made(client).info()["name"] == "signorini"
        assert made(jobs[0]).refresh().id == jobs[0].id
        assert made(punch).normal_force == punch.normal_force
        assert made(punch).normal_force.error == punch.normal_force.error
        assert len(made(punch).profile()) == len(punch.profile())
        assert made(sweep).refresh().status == "succeeded" and made(member)["number"] == 1
        assert made(sweep.table()).parameters == ["indentation"]
        problem = punch.job.problem()
        for data in (punch.profile(), punch.history, punch.fields(), problem, client.validate(problem)):
            assert repr(made(data)) == repr(data)
    asynchronous = pickle.loads(pickle.dumps(sg.AsyncClient(client.url)))
    assert asyncio.run(asynchronous.info())["name"] == "signorini"


def test_every_error_survives_a_pickle(client: sg.Client) -> None:
    caught: list[BaseException] = []
    for ask in (
        lambda: client.submit(unconverged_problem()).wait(60, progress=False),
        lambda: client.submit({"bogus": 1}),
        lambda: client.job("job_nothing"),
        lambda: client.submit(long_problem(5000), cache="off").cancel().wait(30, progress=False),
        lambda: client.submit(long_problem(5000), cache="off").wait(0, progress=False),
        lambda: sg.Client("http://127.0.0.1:9", retry_for=0).info(),
    ):
        with pytest.raises(sg.SignoriniError) as raised:
            ask()
        caught.append(raised.value)
    assert {type(error).__name__ for error in caught} == {
        "JobFailed", "JobCanceled", "InvalidProblem", "NotFound", "WaitTimeout", "ConnectionLost",
    }  # fmt: skip
    for error in [*caught, sg.UnexpectedAnswer("what"), *(kind("t", code="c") for kind in sg.errors.CLASSES.values())]:
        for twin in (pickle.loads(pickle.dumps(error)), copy.deepcopy(error)):
            assert type(twin) is type(error) and str(twin) == str(error)
            for name in ("code", "status", "violations", "reason", "detail", "retryable"):
                assert getattr(twin, name, None) == getattr(error, name, None)
    failed = pickle.loads(pickle.dumps(caught[0]))
    assert failed.job.result(partial=True).partial


def solve_what_fails(url: str) -> float:
    return float(sg.Client(url).submit(unconverged_problem()).wait(60, progress=False).normal_force)


def test_a_failed_job_fails_one_task_of_a_pool(server: sg.LocalServer) -> None:
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(1, mp_context=context) as pool:
        with pytest.raises(sg.JobFailed, match="did not converge"):
            pool.submit(solve_what_fails, server.url).result(60)
        assert pool.submit(abs, -1).result(60) == 1, "and the pool lives"
    with context.Pool(1) as other, pytest.raises(sg.JobFailed):
        other.apply_async(solve_what_fails, (server.url,)).get(60)


def test_one_client_in_several_event_loops(server: sg.LocalServer, jobs: list[sg.Job], right: list[float]) -> None:
    client = sg.AsyncClient(server.url)

    async def forces() -> list[float]:
        found = await asyncio.gather(*(client.job(job.id) for job in jobs))
        return [float((await job.result()).tangential_force) for job in found]

    for _ in range(3):
        assert asyncio.run(forces()) == right
    found: list[Any] = []
    threads = [threading.Thread(target=lambda: found.append(asyncio.run(forces()))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert found == [right] * 4
    assert in_child(lambda: asyncio.run(forces())) == right
    assert len(client._http._places) <= 5, "loops that have ended are forgotten"
    asyncio.run(client.aclose())
