"""One service for all tests, with a store of its own; nothing here sleeps to wait."""

from __future__ import annotations

import os
import pathlib
import signal
from collections.abc import Iterator

import pytest

os.environ.setdefault("MPLBACKEND", "Agg")

import signorini as sg

TOP = pathlib.Path(__file__).resolve().parents[3]
BINARY = pathlib.Path(os.environ.get("SIGNORINI_BINARY", TOP / "target/release/signorini"))
os.environ["SIGNORINI_BINARY"] = str(BINARY)
for variable in ("SIGNORINI_URL", "SIGNORINI_TOKEN", "SIGNORINI_CA"):
    os.environ.pop(variable, None)


@pytest.fixture(autouse=True)
def interrupts() -> Iterator[None]:
    """Ctrl-C interrupts, also where the tests run in the background of a shell, which has them ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def server() -> Iterator[sg.LocalServer]:
    service = sg.LocalServer(workers=2)
    service.start()
    yield service
    service.stop()


@pytest.fixture(scope="session")
def client(server: sg.LocalServer) -> Iterator[sg.Client]:
    with sg.Client(server.url, retry_for=20) as connected:
        yield connected


@pytest.fixture(scope="session")
def punch(client: sg.Client) -> sg.Result:
    """The rectangular punch on its coarse mesh, solved once for all tests that only look at a result."""
    return client.submit(sg.examples.rectangular_punch(refine=0), name="punch").wait(60, progress=False)


def long_problem(increments: int) -> sg.Problem:
    """A problem with about seven events for each increment of its load: a thousand take a second or more."""
    problem = sg.examples.rectangular_punch(refine=0)
    problem.steps = [sg.problem.Step(name="press", increments=increments)]
    return problem


def unconverged_problem() -> sg.Problem:
    """The thesis's own iteration, stopped after five steps: it fails, and its last state is kept."""
    problem = sg.examples.rectangular_punch(refine=0)
    problem.solver = sg.problem.SolverControls(algorithm="thesis", max_iterations=5)
    return problem
