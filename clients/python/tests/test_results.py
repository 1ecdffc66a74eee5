"""Numbers with their errors, and the arrays of a result."""

from __future__ import annotations

import asyncio
import copy
import io
import pathlib
import pickle
import sys
import zipfile
from typing import Any

import numpy as np
import pytest

import signorini as sg
from signorini._data import Fields, Number, Profile, Summary, Warning, arrays, known
from signorini._extras import load


def test_a_number_is_shown_as_its_error_allows() -> None:
    shown = {
        (96.6512, 0.0503): "96.65 ± 0.05",
        (96.6512, 0.0123): "96.651 ± 0.012",
        (14.2, 3.4): "14 ± 3",
        (-186868.8, 1234.5): "-186869 ± 1234",
        (1.5e-9, 2e-11): "1.5e-09 ± 2.0e-11",
        (1.5e9, 2e5): "1.5e+09 ± 2.0e+05",
        (0.5, 0.0): "0.5 ± 0",
        (-0.0, 0.0): "0 ± 0",
        (-0.001, 0.5): "0.0 ± 0.5",
        (-186868.8287, None): "-1.8687e+05 (error unknown)",
    }
    for (value, error), text in shown.items():
        assert str(Number(value, error)) == text
    assert repr(Number(-1e5, None, "no_limit")) == "-1e+05 (no limit)"
    assert str(Number(1, None, "too_many")) == "1 (too many)"
    assert f"{Number(96.6512, 0.0503):.3f}" == "96.651 ± 0.050" and f"{Number(1, None):.1f}" == "1.0 ± ?"
    assert f"{Number(96.6512, 0.0503)}" == "96.65 ± 0.05"


def test_a_number_is_a_float() -> None:
    number = Number(2.0, 0.5)
    assert number + 1 == 3 and float(number) == number.value == 2 and number.relative == 0.25
    assert type(float(number)) is float and np.asarray([number]).dtype == float
    assert Number(0.0, 1.0).relative is None and Number(1.0).relative is None
    for twin in (copy.copy(number), pickle.loads(pickle.dumps(number))):
        assert (twin, twin.error) == (2.0, 0.5)


def test_the_summary(punch: sg.Result) -> None:
    assert punch.verdict in ("good", "fair", "poor") and punch.reasons and punch.converged
    assert float(punch.normal_force) == pytest.approx(96.65, abs=0.01)
    assert punch.normal_force.error is not None and 0 < punch.normal_force.error < 5
    assert float(punch.tangential_force) == pytest.approx(14.17, abs=0.01)
    assert float(punch.friction_force) == pytest.approx(14.17, abs=0.01)
    contact = punch.contacts["top"]
    ((start, end),) = contact.contact
    assert start == 0 and end == pytest.approx(0.5)
    assert contact.normal_force == punch.normal_force and contact.normal_force.error == punch.normal_force.error
    assert contact.peak_normal_stress is not None and contact.peak_normal_stress.x == pytest.approx(0.5)
    assert punch.peak_normal_stress == contact.peak_normal_stress.value and punch.peak_normal_stress < 0
    assert punch.peak_normal_stress.why == "no_limit" and punch.peak_tangential_stress is not None
    assert "sharp_edge" in [warning.code for warning in punch.warnings]
    text = repr(punch)
    assert text.startswith("outcome           converged\nverdict ") and "normal force      9" in text
    assert "\nnote: sharp_edge: " in text and "warning: sharp_edge" not in text
    assert repr(punch.profile()).startswith("<Profile of 'top': ") and " rows; .s, .x, .y, " in repr(punch.profile())
    assert repr(punch.history).startswith("<History: ") and ".to_pandas()" in repr(punch.history)
    assert repr(punch.fields()).startswith("<Fields: ") and " nodes, " in repr(punch.fields())


def test_the_errors_of_several_contacts_add_up() -> None:
    def contact(force: float) -> dict[str, object]:
        forces = dict.fromkeys(("normal_force", "tangential_force", "friction_force"), force)
        return {**forces, "contact": [], "stick": [], "slip": [], "peak_normal_stress": None}

    quantities = [
        {"quantity": "normal_force", "contact": name, "error": 0.5, "method": "weighted_recovery"} for name in "ab"
    ]
    summary = {
        "normal_force": 3.0, "tangential_force": 3.0, "friction_force": 3.0, "outcome": "converged", "converged": True,
        "contacts": {"a": contact(1.0), "b": contact(2.0)}, "accuracy": {"verdict": "fair", "quantities": quantities},
        "iterations": 1, "dofs": 2,
    }  # fmt: skip
    found = Summary({"summary": summary}, False)
    assert (found.normal_force, found.normal_force.error) == (3.0, 1.0)
    assert found.tangential_force.error is None and found.peak_normal_stress is None
    assert "contact on b      nowhere" in str(found)
    with pytest.raises(ValueError, match=r"which contact: boundary=… is one of \['a', 'b'\]"):
        found._boundary(None)
    with pytest.raises(ValueError, match="has no contacts"):
        Summary({"summary": {"contacts": {}}}, False)._boundary(None)


def test_a_profile(punch: sg.Result) -> None:
    profile = punch.profile()
    assert profile.boundary == "top" and len(profile) == len(profile.s) and not profile.partial
    assert np.all(np.diff(profile.s) >= 0) and set(profile.state) <= {"open", "stick", "slip"}
    frame = profile.to_pandas()
    assert list(frame.columns[:4]) == ["s", "x", "y", "gap"] and frame["state"].iloc[0] == "stick"
    even = punch.profile("top", points=11)
    np.testing.assert_allclose(even.s, np.linspace(0, profile.s[-1], 11), atol=1e-12)
    assert len(punch.profile(points="nodes")) < len(profile)
    # normal stress is quadratic on each edge: Simpson's rule on its three nodes is exact
    nodes = punch.profile(points="nodes")
    weights = np.zeros(len(nodes))
    for first in range(0, len(nodes) - 2, 2):
        weights[first : first + 3] += (nodes.s[first + 2] - nodes.s[first]) / 6 * np.array([1, 4, 1])
    assert -weights @ nodes.normal_stress == pytest.approx(float(punch.normal_force), rel=1e-9)
    with pytest.raises(ValueError, match="which contact"):
        punch.profile("bottom")
    with pytest.raises(sg.NotFound, match="no load steps"):
        punch.profile(step=1)
    assert np.array_equal(punch.profile(step=0).s, punch.profile().s)  # a problem without steps has one


def test_the_steps_of_a_load(client: sg.Client) -> None:
    problem = sg.examples.rectangular_punch(refine=0)
    problem.steps = [sg.problem.Step(name="half", indentation=0.5), sg.problem.Step(name="whole")]
    result = client.submit(problem).wait(60, progress=False)
    assert [step["name"] for step in result.steps] == ["half", "whole"]
    half, whole = result.profile(step="half"), result.profile(step=1)
    np.testing.assert_allclose(half.gap, whole.gap / 2)


def test_a_job_between_two_load_steps_has_no_result_yet(client: sg.Client) -> None:
    problem = sg.examples.rectangular_punch(refine=0)
    problem.steps = [sg.problem.Step(name="half", indentation=0.5), sg.problem.Step(name="rest", increments=10_000)]
    job = client.submit(problem, cache="off")
    try:
        assert any(event.type == "iteration" and event["step"] == 1 for event in job.events())
        # the service has what there is; it must not be taken for the end
        with pytest.raises(sg.ResultNotReady):
            job.result()
        so_far = job.result(partial=True)
        assert so_far.partial and [step["name"] for step in so_far.steps] == ["half"]
    finally:
        job.cancel()


def test_the_history(punch: sg.Result) -> None:
    history = punch.history
    assert list(history.k) == list(range(1, punch.summary["iterations"] + 1))
    assert max(history.residual[-1], history.friction_residual[-1]) < history.tolerance[-1]
    assert {"contact_entered", "wall_s"} <= set(history.to_pandas().columns)


def test_a_package_that_is_not_installed_is_named(punch: sg.Result, monkeypatch: pytest.MonkeyPatch) -> None:
    profile = punch.profile()
    for module, act in [("pandas", profile.to_pandas), ("pyarrow", profile.to_arrow), ("matplotlib", profile.plot)]:
        with monkeypatch.context() as patched:
            for name in [name for name in sys.modules if name.partition(".")[0] == module]:
                patched.delitem(sys.modules, name)
            patched.setattr(sys, "meta_path", [Missing(module), *sys.meta_path])
            with pytest.raises(ImportError, match=f'needs {module}, which is not installed: pip install "signorini'):
                act()


class Missing:
    """Stands for a package that is not installed."""

    def __init__(self, module: str) -> None:
        self.module = module

    def find_spec(self, name: str, path: object, target: object = None) -> None:
        if name.partition(".")[0] == self.module:
            raise ModuleNotFoundError(f"No module named {name!r}", name=self.module)


def test_an_import_that_fails_inside_of_a_package_is_told_as_it_is(tmp_path: pathlib.Path, monkeypatch: Any) -> None:
    (tmp_path / "broken_package.py").write_text("import no_such_module")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ModuleNotFoundError, match="no_such_module"):
        load("broken_package", "plot")


def test_tables_of_arrow(punch: sg.Result) -> None:
    pytest.importorskip("pyarrow")
    table = punch.profile().to_arrow()
    assert table.num_rows == len(punch.profile()) and table.column("state")[0].as_py() == "stick"


def test_the_fields(punch: sg.Result, tmp_path: pathlib.Path) -> None:
    fields = punch.fields()
    assert fields.points.shape == (len(fields.von_mises), 3) and fields.stress.shape[1] == 6
    assert len(fields.element_error) == len(fields.quads) + len(fields.triangles)
    saved = punch.save_vtu(tmp_path / "punch.vtu")
    assert saved.read_bytes().startswith(b"<?xml") and list(tmp_path.iterdir()) == [saved]


def test_fields_of_pyvista(punch: sg.Result) -> None:
    pyvista = pytest.importorskip("pyvista")
    fields = punch.fields()
    grid = fields.to_pyvista()
    assert isinstance(grid, pyvista.UnstructuredGrid)
    assert (grid.n_points, grid.n_cells) == (len(fields.points), len(fields.quads) + len(fields.triangles))
    np.testing.assert_array_equal(grid.point_data["von_mises"], fields.von_mises)
    assert grid.area == pytest.approx(16, rel=1e-6)
    mixed = dict(vars(fields), quads=fields.quads[:1], quad_numbers=np.array([1]))
    mixed.update(triangles=np.array([[0, 1, 2, 3, 4, 5]]), triangle_numbers=np.array([0]))
    assert list(Fields(**known(Fields, mixed)).to_pyvista().celltypes) == [23, 22]


def test_columns_that_this_client_does_not_know_are_left_out(punch: sg.Result) -> None:
    columns = punch.profile().columns()
    assert "new" not in known(Profile, {**columns, "new": columns["s"]})
    assert str(Warning("code", "in words")) == "code: in words"
    read = Warning.from_json({"code": "a", "message": "b", "pointer": "/problem/mesh", "severity": "serious"})
    assert (read.pointer, read.kind) == ("/mesh", "serious warning")
    assert Warning.from_json({"code": "a", "message": "b"}).kind == "warning"


def test_arrays_are_read_in_many_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    content = io.BytesIO()
    np.savez(content, a=np.arange(3))
    load_once = np.load
    failures = [SystemError("AST constructor recursion depth mismatch")] * 3

    def fails_at_first(*given: Any, **named: Any) -> Any:
        if failures:
            raise failures.pop()
        return load_once(*given, **named)

    monkeypatch.setattr("numpy.load", fails_at_first)
    assert arrays(content.getvalue())["a"].tolist() == [0, 1, 2]
    failures = [SystemError("for good")] * 1000
    with pytest.raises(SystemError):
        arrays(content.getvalue())


def test_a_result_is_saved_and_opened_without_the_service(client: sg.Client, tmp_path: pathlib.Path) -> None:
    problem = sg.examples.rectangular_punch(refine=0)
    problem.steps = [sg.problem.Step(name="half", indentation=0.5), sg.problem.Step(name="whole")]
    job = client.submit(problem, name="kept", cache="off")
    result = job.wait(60, progress=False)
    path = result.save(tmp_path / "punch.signorini")
    small = result.save(tmp_path / "small.signorini", fields=False)
    assert small.stat().st_size < path.stat().st_size and len(list(tmp_path.iterdir())) == 2
    expected = [result.profile(step=step).tangential_stress for step in (None, 0, "half", "whole")]
    shown, history, fields = str(result), result.history, result.fields()
    vtu = result.save_vtu(tmp_path / "a.vtu").read_bytes()
    job.delete()

    kept = sg.Result.open(path)
    assert str(kept) == shown and kept.job.name == "kept" and kept.job.problem() == job_problem(problem)
    for step, stress in zip((None, 0, "half", "whole"), expected, strict=True):
        np.testing.assert_array_equal(kept.profile(step=step).tangential_stress, stress)
    np.testing.assert_array_equal(kept.history.residual, history.residual)
    np.testing.assert_array_equal(kept.fields().von_mises, fields.von_mises)
    assert kept.save_vtu(tmp_path / "b.vtu").read_bytes() == vtu
    assert kept.job.wait().normal_force == kept.normal_force and kept.job.refresh().status == "succeeded"
    again = kept.save(tmp_path / "again.signorini")
    assert pickle.loads(pickle.dumps(sg.Result.open(again))).normal_force == result.normal_force
    assert repr(kept._client) == f"<Saved {path}>"
    # what is not in it is told
    for ask in (sg.Result.open(small).fields, lambda: kept.profile(points=7), kept.job.cancel, kept.job.delete):
        with pytest.raises(sg.SignoriniError, match=f"does not have .*The service may: Client.*{job.id}"):
            ask()
    with pytest.raises(sg.SignoriniError, match="does not have the events"):
        list(kept.job.events())
    for wrong in (b"", b"PK", tmp_path.joinpath("a.vtu").read_bytes(), path.read_bytes()[:-100]):
        (tmp_path / "wrong").write_bytes(wrong)
        with pytest.raises(sg.SignoriniError, match="is not a result that was saved"):
            sg.Result.open(tmp_path / "wrong")
    with zipfile.ZipFile(tmp_path / "newer", "w") as file:
        file.writestr("index.json", '{"format": "signorini result 9"}')
    with pytest.raises(sg.SignoriniError, match="'signorini result 9', and this client reads 'signorini result 1'"):
        sg.Result.open(tmp_path / "newer")

    async def asynchronously() -> None:
        opened = await sg.AsyncResult.open(path)
        assert opened.normal_force == result.normal_force and len(await opened.history()) == len(history)
        assert (await opened.save(tmp_path / "third")).read_bytes() == again.read_bytes()

    asyncio.run(asynchronously())


def job_problem(problem: sg.Problem) -> sg.Problem:
    return sg.Problem.from_dict(problem.to_dict(defaults=True))
