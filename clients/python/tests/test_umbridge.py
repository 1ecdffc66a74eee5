"""Problems as functions: outputs bit by bit, derivatives that are known, definitions, errors in the form of UM-Bridge.

The protocol itself, point by point and with its own client: tests/clients/umbridge.py of the repository.
"""

from __future__ import annotations

import asyncio
import json
import math
import pathlib
import pickle
import threading
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from aiohttp.test_utils import TestClient, TestServer
from conftest import BINARY, unconverged_problem

import signorini as sg
from signorini import umbridge
from signorini._parametrised import scalar
from signorini.errors import ApiError, Violation, invalid

DEPTH, MODULUS, POISSON = "/contacts/0/indentation", "/materials/0/youngs_modulus", "/materials/0/poissons_ratio"


def frictionless(**values: Any) -> sg.Problem:
    """A flat punch without friction, so that all numbers are proportional to the indentation and to Young's modulus."""
    problem = sg.examples.rectangular_punch(refine=0).with_values({DEPTH: 0.25, **values})
    problem.contacts[0].friction = None
    return problem


def definition(**changes: Any) -> dict[str, Any]:
    return {
        "problem": frictionless(),
        "inputs": [[DEPTH], [MODULUS, "materials.0.poissons_ratio"]],
        "outputs": [
            {"scalars": ["normal_force", "contacts/top/peak_normal_stress"]},
            {"profile": "top", "quantity": "normal_stress", "points": 5},
        ],
        **changes,
    }


@pytest.fixture(scope="module")
def model(client: sg.Client) -> umbridge.Model:
    return umbridge.Model("flat", definition(), client)


AT = [[0.2], [1500.0, 0.3]]


def test_an_evaluation_is_a_job(client: sg.Client, model: umbridge.Model) -> None:
    assert (model.get_input_sizes(), model.get_output_sizes({})) == ([1, 2], [2, 5])
    found = model(AT)
    result = client.submit(frictionless(**{DEPTH: 0.2, MODULUS: 1500})).wait(60, progress=False)
    peak = result.contacts["top"].peak_normal_stress
    assert peak is not None and found[0] == [float(result.normal_force), float(peak.value)]
    assert found[1] == list(result.profile(points=5).normal_stress)
    # arrays will do, and the same input is answered from the cache
    assert model([np.array([0.2]), np.array([1500, 0.3])]) == found
    jobs = list(client.jobs(labels={"model": "flat"}))
    assert {job.name for job in jobs} == {"model flat"} and jobs[0].cached_from
    assert {job.input_hash for job in jobs} == {result.job.input_hash}


def test_a_poor_verdict_is_told_once(client: sg.Client) -> None:
    def model(layers: int) -> umbridge.Model:
        problem = sg.examples.cylinder(refine=0)
        grid = problem.mesh.grid
        assert grid is not None
        grid.y = np.linspace(min(grid.y), max(grid.y), layers + 1).tolist()
        outputs = [{"scalars": ["normal_force"]}]
        return umbridge.Model("layers", {"problem": problem, "inputs": [[DEPTH]], "outputs": outputs}, client)

    poor = model(1)
    with pytest.warns(UserWarning, match="the verdict on job_.* is poor: .*label.model=layers&verdict=poor"):
        (first,) = poor([[0.5]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (second,) = poor([[0.4]])
    assert first[0] > second[0] > 0


def test_derivatives_are_those_that_are_known(model: umbridge.Model) -> None:
    (force, stress), profile = model(AT)
    assert model.gradient(0, 0, AT, [1, 0]) == pytest.approx([force / 0.2], rel=1e-6)
    assert model.gradient(0, 0, AT, [0.5, 2.0]) == pytest.approx([(0.5 * force + 2.0 * stress) / 0.2], rel=1e-6)
    assert model.gradient(0, 1, AT, [1, 0])[0] == pytest.approx(force / 1500, rel=1e-6)
    assert model.apply_jacobian(0, 0, AT, [3.0]) == pytest.approx([15 * force, 15 * stress], rel=1e-6)
    assert model.apply_jacobian(0, 0, AT, [0.0]) == [0.0, 0.0]
    expected = [value / 1500 for value in profile]
    assert model.apply_jacobian(1, 1, AT, [1.0, 0.0]) == pytest.approx(expected, rel=1e-6)


def refused(work: Any) -> umbridge.ModelError:
    with pytest.raises(umbridge.ModelError) as raised:
        work()
    return raised.value


def test_a_difference_of_two_meshes_is_no_derivative(client: sg.Client) -> None:
    """The end of the obstacle is at a node: a step to one side leaves out an edge of the contact."""
    edge = umbridge.Model("edge", definition(inputs=[["/contacts/0/obstacle/to"]]), client)
    for work in (lambda: edge.gradient(0, 0, [[0.5]], [1, 0]), lambda: edge.apply_jacobian(0, 0, [[0.5]], [1])):
        error = refused(work)
        assert error.type == "UnsupportedFeature" and "mesh.refine" in error.message
        on_contacts = error.message.split("(")[1].split(" ")
        assert on_contacts[0] != on_contacts[2], error.message


def test_solutions_that_rounding_ended_early_have_no_difference(model: umbridge.Model) -> None:
    exact = model._evaluation(model._client.submit(frictionless()))
    rough = type(exact)("job_x", exact.outputs, exact.unknowns, 1e-5)
    error = refused(lambda: model._check_comparable(exact, rough))
    assert error.type == "UnsupportedFeature" and "job_x has a residual of 1.0e-05" in error.message


def test_a_model_without_sizes_has_no_derivatives(client: sg.Client) -> None:
    flat = umbridge.Model("zero", definition(problem=frictionless(**{DEPTH: 0})), client)
    assert flat.supports_evaluate() and not flat.supports_apply_jacobian() and not flat.supports_apply_hessian()
    assert refused(lambda: flat.gradient(0, 0, AT, [1, 0])).type == "UnsupportedFeature"


def test_inputs_that_are_none_are_refused(model: umbridge.Model) -> None:
    for work, words in (
        (lambda: model(0.2), "input: expected a list of vectors"),  # type: ignore[arg-type]
        (lambda: model([[0.2]]), "input has 1 vectors; the model takes 2"),
        (lambda: model([[0.2, 1], [1000, 0.3]]), "input 0 has 2 numbers; expected 1"),
        (lambda: model([[0.2], [math.nan, 0.3]]), "got NaN in it"),
        (lambda: model([[0.2], [10**400, 0.3]]), "finite numbers"),
        (lambda: model([[0.2], [-5, 0.5]]), "/materials/0/youngs_modulus = -5"),
        (lambda: model(AT, {"level": 1}), 'config has "level"'),
        (lambda: model(AT, []), "config: expected an object"),  # type: ignore[arg-type]
        (lambda: model.gradient(2, 0, AT, [1, 0]), "outWrt is 2; expected 0 … 1"),
        (lambda: model.gradient(0, 0.5, AT, [1, 0]), "inWrt: expected"),  # type: ignore[arg-type]
        (lambda: model.gradient(0, 0, AT, [1]), "sens has 1 numbers; expected 2"),
        (lambda: model.gradient(0, 0, AT, [1e308, 1e308]), "beyond double precision"),
        (lambda: model.apply_jacobian(0, 0, AT, [1, 2]), "vec has 2 numbers; expected 1"),
        (lambda: model.apply_jacobian(0, 0, AT, [1.7e308]), "vec is too large"),
        (lambda: model.apply_jacobian(0, 0, AT, [5e-324]), "vec is too small"),
    ):
        error = refused(work)
        assert error.type == "InvalidInput" and words in error.message, error
    again = pickle.loads(pickle.dumps(error))
    assert (again.type, again.message) == (error.type, error.message)


def test_without_a_solution_there_is_never_a_number(client: sg.Client, model: umbridge.Model) -> None:
    error = refused(lambda: model([[-0.1], [1000, 0.3]]))
    assert error.type == "InvalidOutput" and "job_" in error.message
    assert "without contact there is none" in error.message
    shear = definition(outputs=[{"scalars": ["contacts/top/peak_tangential_stress/x"]}])
    error = refused(lambda: umbridge.Model("shear", shear, client)(AT))
    assert "without friction there is none" in error.message
    hasty = umbridge.Model("hasty", definition(problem=unconverged_problem()), client)
    with pytest.raises(sg.JobFailed) as failed:
        hasty(AT)
    status, kind, message = umbridge._told(failed.value)
    assert (status, kind) == (500, "InvalidOutput")
    assert message.startswith(f"{failed.value.job.id} failed: not-converged: ")


def test_all_that_is_wrong_with_a_definition_is_told(client: sg.Client) -> None:
    def wrong(**changes: Any) -> dict[str, str]:
        with pytest.raises(sg.InvalidProblem) as raised:
            umbridge.Model("wrong", definition(**changes), client)
        return {violation.pointer: violation.reason for violation in raised.value.violations}

    inputs = [
        ["/contacts/0/identation", "/title", DEPTH, "contacts.0.indentation"],
        [],
        ["/mesh/grid/x", "/mesh/grid/x/99"],
    ]
    outputs = [
        {
            "scalars": [
                "normal_forces",
                "contacts/side/normal_force",
                "contacts/top",
                "contacts/top/normal_force/value",
                "",
            ]
        },
        {"profile": "side", "quantity": "gap", "points": 1},
        {"profile": "top"},
        {"scalars": []},
        {"scalars": ["energy"], "points": 3},
    ]
    assert wrong(inputs=inputs, outputs=outputs, problem=frictionless(**{MODULUS: -1})) == {
        "/inputs/0/0": "unknown_name",
        "/inputs/0/1": "wrong_type",
        "/inputs/0/3": "duplicate",
        "/inputs/1": "too_few",
        "/inputs/2/0": "wrong_type",
        "/inputs/2/1": "unknown_name",
        "/outputs/0/scalars/0": "unknown_name",
        "/outputs/0/scalars/1": "unknown_boundary",
        "/outputs/0/scalars/2": "unknown_name",
        "/outputs/0/scalars/3": "unknown_name",
        "/outputs/0/scalars/4": "unknown_name",
        "/outputs/1/profile": "unknown_boundary",
        "/outputs/1/points": "out_of_range",
        "/outputs/2": "wrong_fields",
        "/outputs/3": "too_few",
        "/outputs/4": "wrong_fields",
        "/problem/materials/0/youngs_modulus": "out_of_range",
    }
    assert wrong(inputs=[], outputs=[]) == {"/inputs": "too_few", "/outputs": "too_few"}
    outputs = [{"profile": "top", "quantity": "normal_stres", "points": 3}]
    assert wrong(inputs="/a", outputs=outputs, more=1) == {
        "/more": "unknown_name",
        "/inputs": "wrong_type",
        "/outputs/0/quantity": "unknown_value",
    }
    with pytest.raises(sg.InvalidProblem, match="letters, digits"):
        umbridge.Model("a b", definition(), client)


def test_every_number_of_a_summary_has_its_path(punch: sg.Result) -> None:
    top = punch.contacts["top"]
    assert top.peak_tangential_stress is not None
    for path, expected in {
        "strain_energy": punch.summary["strain_energy"],
        "contacts/top/friction_force": top.friction_force,
        "contacts/top/stick_width": sum(end - start for start, end in top.stick),
        "contacts/top/peak_tangential_stress": top.peak_tangential_stress.value,
        "contacts/top/peak_tangential_stress/x": top.peak_tangential_stress.x,
    }.items():
        assert scalar(punch.summary, path) == float(expected), path


def test_files_and_the_command(tmp_path: pathlib.Path, client: sg.Client, capfd: Any, monkeypatch: Any) -> None:
    (tmp_path / "problem.json").write_text(json.dumps(frictionless().to_dict()))
    (tmp_path / "model.json").write_text(json.dumps(definition(problem="problem.json", title="a punch")))
    (tmp_path / "list.json").write_text("[]")
    (tmp_path / "deep.json").write_text("[" * 100_000)
    monkeypatch.setenv("SIGNORINI_URL", client.url)
    served: list[Any] = []
    monkeypatch.setattr(umbridge, "serve", lambda *given: served.append(given))
    good = f"flat={tmp_path / 'model.json'}"
    assert umbridge.main([good, "--port", "0"]) == 0
    ((models, host, port, threads),) = served
    assert (models[0].name, host, port, threads) == ("flat", "127.0.0.1", 0, 32)
    assert capfd.readouterr().err == "flat (a punch): inputs [1, 2], outputs [2, 5], with derivatives\n"
    bad = [f"m={tmp_path / name}" for name in ("list.json", "deep.json", "no.json")]
    assert umbridge.main([good, good, "flat", *bad]) == 1
    told = capfd.readouterr().err
    for words in ("two models flat", "expected NAME=FILE.json", "an object with problem", "deep.json: ", "no.json"):
        assert words in told
    monkeypatch.setenv("SIGNORINI_URL", "http://127.0.0.1:9")
    assert umbridge.main([good, "--retry-for", "0"]) == 1
    assert "cannot be reached" in capfd.readouterr().err


@pytest.fixture
def own() -> Iterator[sg.Client]:
    """A service that has room for two jobs in its queue; it is not asked again when it is busy."""
    with sg.Client.local(binary=BINARY, options=["--max-queued", "2"]) as client:
        client.retry_for = 0.0
        yield client


async def asked(models: list[umbridge.Model], *requests: tuple[str, Any], **headers: str) -> list[tuple[int, Any]]:
    async with TestClient(TestServer(umbridge.application(models))) as http:
        answers = []
        for path, body in requests:
            answer = await http.post(path, data=body if isinstance(body, str) else json.dumps(body), headers=headers)
            assert answer.content_type == "application/json"
            answers.append((answer.status, await answer.json()))
        return answers


def test_answers_have_the_form_of_the_protocol(model: umbridge.Model) -> None:
    at = {"name": "flat", "input": AT, "config": {}}
    expected = model(AT)
    requests = [
        ("/Evaluate", at),
        ("/Evaluate", {"name": "flat"}),
        ("/Evaluate", {"name": 7}),
        ("/Evaluate", {"name": "flat", "inputs": []}),
        ("/Evaluate", "[1]"),
        ("/Evaluate", '{"name"'),
        ("/Evaluate", " " * (1 << 20) + " "),
        ("/EvaluateShMem", at),
        ("/Nothing", at),
    ]
    answers = asyncio.run(asked([model], *requests))
    assert answers[0] == (200, {"output": expected})
    for _, answer in answers[1:]:
        assert list(answer) == ["error"] and sorted(answer["error"]) == ["message", "type"]
    kinds = [(status, answer["error"]["type"]) for status, answer in answers[1:]]
    assert kinds == [(400, "InvalidInput")] * 5 + [(413, "payload-too-large")] + [(404, "not-found")] * 2
    assert asyncio.run(asked([model], ("/Evaluate", at), Origin="http://elsewhere.example"))[0][0] == 403


def test_what_the_service_refuses_has_its_code(own: sg.Client) -> None:
    model = umbridge.Model("flat", definition(), own)
    own.pause_queue()
    at = {"name": "flat", "input": AT, "outWrt": 0, "inWrt": 1, "sens": [1, 0]}
    ((status, answer),) = asyncio.run(asked([model], ("/Gradient", at)))
    # four jobs at once, of which two may wait: none is submitted
    assert (status, answer["error"]["type"]) == (503, "queue-full"), answer
    assert own.count()["total"] == 0

    def cancel() -> None:
        while not (jobs := list(own.jobs(status="queued"))):
            pass
        jobs[0].cancel()

    thread = threading.Thread(target=cancel)
    thread.start()
    ((status, answer),) = asyncio.run(asked([model], ("/Evaluate", {"name": "flat", "input": AT})))
    thread.join()
    assert (status, answer["error"]["type"]) == (500, "InvalidOutput"), answer
    assert "canceled: user_cancel" in answer["error"]["message"]
    assert umbridge._told(sg.Deleted("gone", code="deleted", status=410))[:2] == (410, "deleted")
    assert umbridge._told(ApiError("no", code="storage-full", status=507))[:2] == (507, "storage-full")
    assert umbridge._told(sg.UnexpectedAnswer("a page to log in"))[:2] == (502, "unexpected-answer")
    assert umbridge._told(sg.ConnectionLost("away"))[:2] == (503, "service-unreachable")
    assert umbridge._told(RuntimeError("a fault"))[:2] == (500, "internal")


def test_violations_without_a_place_are_told_as_they_are(model: umbridge.Model) -> None:
    error = model._refused([[1.0] * 3], invalid([Violation("/limits", "too_large", "a", "b")]).violations)
    assert error.message == "/limits: got a, expected b"
