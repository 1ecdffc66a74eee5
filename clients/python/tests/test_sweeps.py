"""Sweeps: axes, the table, members, and that waiting and following see all of them."""

from __future__ import annotations

import json
import signal
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from conftest import long_problem

import signorini as sg
from signorini import _calls as calls
from signorini._progress import Waiting, sweep_line
from signorini.pointer import short_names

BASE = sg.examples.rectangular_punch(refine=0)
MU = "contacts.0.friction.coefficient"
RHO = "/contacts/0/friction/nonlocal_radius"


def test_a_grid_is_every_combination(client: sg.Client, capsys: pytest.CaptureFixture[str]) -> None:
    sweep = client.sweep(BASE, {RHO: [0.008, 0.01], MU: sg.linspace(0, 0.5, 3)}, name="grid", labels={"a": "b"})
    assert len(sweep) == 6 and sweep.labels == {"a": "b"} and sweep.paths == [RHO, "/contacts/0/friction/coefficient"]
    table = sweep.wait(60).table()
    assert "grid · succeeded · ████████████████████ 6 of 6" in capsys.readouterr().err
    assert sweep.ended and sweep.status == "succeeded" and sweep.title == "grid" and str(sweep).startswith("grid · ")
    assert table.parameters == ["nonlocal_radius", "coefficient"] and len(table) == 6
    np.testing.assert_allclose(table["coefficient"], [0, 0.25, 0.5] * 2)
    np.testing.assert_allclose(table["nonlocal_radius"], [0.008] * 3 + [0.01] * 3)
    assert table.to_arrow().num_rows == 6
    frame = sweep.to_pandas()
    assert list(frame.index) == list(range(6)) and (frame["status"] == "succeeded").all()
    assert repr(client.sweep(sweep.id)) == f"<Sweep {sweep.id} 'grid' succeeded>"
    assert sweep.id in [found.id for found in client.sweeps()]
    # a member alone is the same within its tolerance, and has more
    member = sweep.member(4)
    assert (member.number, member.status, member.reason) == (4, "succeeded", None)
    assert dict(member.parameters) == {RHO: 0.01, "/contacts/0/friction/coefficient": 0.25}
    assert "<SweepMember 4 succeeded" in repr(member)
    result = member.job().wait(60, progress=False)
    assert float(result.normal_force) == pytest.approx(member["normal_force"], rel=1e-8)
    assert result.normal_force.error is not None
    with pytest.raises(IndexError, match="members 0 to 5"):
        sweep.member(6)
    assert [job.status for job in sweep.jobs()] == ["succeeded"]
    events = list(sweep.events())
    assert [event.seq for event in events] == list(range(1, 8))
    assert sorted(event["member"]["number"] for event in events[:-1]) == list(range(6)) and events[-1].type == "done"
    assert sweep.refresh().cancel().status == "succeeded"
    sweep.delete()
    with pytest.raises(sg.Deleted):
        sweep.refresh()


def test_values_that_belong_together(client: sg.Client) -> None:
    zipped = client.sweep(BASE, {RHO: np.array([0.008, 0.01]), MU: (0.1, 0.2)}, mode="zip").wait(60, progress=False)
    assert zipped.title == zipped.id
    np.testing.assert_allclose(zipped.table()["coefficient"], [0.1, 0.2])
    obstacle = sg.problem.Parabola(radius=8, to=0.5)
    listed = client.sweep(
        BASE, [{MU: 0.1, "solver.tolerance": 1e-9}, {"contacts.0.obstacle": obstacle}], timeout_s=60, priority=1
    ).wait(60, progress=False)
    first, second = listed.members()
    assert dict(first.parameters) == {"/contacts/0/friction/coefficient": 0.1, "/solver/tolerance": 1e-9}
    assert second.parameters["/contacts/0/obstacle"]["kind"] == "parabola"


def test_a_study_tells_what_to_look_at_and_is_drawn(client: sg.Client, capsys: pytest.CaptureFixture[str]) -> None:
    axes = {RHO: sg.logspace(0.005, 0.05, 4), MU: [0.1, 0.3]}
    study = client.sweep(BASE, axes, name="stick over ρ").wait(60)
    told = capsys.readouterr().err
    assert (
        "8 of 8 members have warnings: " in told
        and "mesh_too_coarse_for_radius 6" in told
        and "client.explain(code)" in told
    )
    table = study.table()
    text = repr(table)
    assert text.splitlines()[0].split()[:4] == ["number", "nonlocal_radius", "coefficient", "status"]
    assert "0.005" in text and "members have warnings" in text
    assert "… 2 more rows" in repr(
        sg.SweepTable({name: np.resize(column, 12) for name, column in table.columns.items()})
    )
    with pytest.raises(KeyError, match="there is no column 'stick_with'; did you mean 'stick_width'"):
        table["stick_with"]
    with pytest.raises(KeyError, match="there is no column 'zzz'; there are number, "):
        table["zzz"]

    figure = study.plot("stick_width", size="column", theme="dark")
    (axes_drawn,) = figure.axes
    assert axes_drawn.get_xscale() == "log" and axes_drawn.get_ylabel() == "width of stick"
    legend = axes_drawn.get_legend()
    assert legend is not None and [text.get_text() for text in legend.get_texts()][:2] == [
        r"$\mu$ = 0.1",
        r"$\mu$ = 0.3",
    ]
    told = figure.get_supxlabel().replace("\n", " ")
    assert figure.get_suptitle() == "stick over ρ"
    assert "8 of 8 members have warnings: " in told and "mesh too coarse for radius 6" in told
    other = table.plot("normal_force", x="coefficient", title="")
    assert other.axes[0].get_xscale() == "linear" and other.axes[0].get_xlabel() == r"$\mu$"
    for words, wrong in [("has no numbers", ("status", None)), ("has no numbers", ("stick_width", "warnings"))]:
        with pytest.raises(ValueError, match=words):
            table.plot(wrong[0], x=wrong[1])
    many = {**table.columns, "coefficient": np.arange(8.0), "nonlocal_radius": np.zeros(8), "number": np.arange(8)}
    crowd = sg.SweepTable({name: np.resize(column, 16) for name, column in many.items()} | {"/a": np.arange(16.0)})
    crowd.parameters = ["coefficient", "a"]
    crowd.columns["coefficient"] = np.arange(16.0) % 2
    with pytest.raises(ValueError, match="16 curves are too many"):
        crowd.plot("stick_width", x="coefficient")
    # values that belong together are one curve; a last state that did not converge is no value
    pair = sg.SweepTable({**table.columns, "/b": np.arange(8.0), "/a": 2 * np.arange(8.0)})
    pair.columns["status"] = np.array(["succeeded"] * 6 + ["failed", "canceled"])
    pair.columns["reason"] = np.array([""] * 6 + ["not_converged", "user_cancel"])
    (drawn,) = pair.plot("normal_force", title="pair").axes
    heights = np.asarray(drawn.lines[0].get_ydata())
    assert len(heights) == 8 and np.isnan(heights[6:].astype(float)).all()
    assert pair.notes()[0] == "2 of 8 members have no solution: not_converged 1, user_cancel 1"
    pair.columns["verdict"] = np.array(["good", *[""] * 6, "fair"])
    assert pair.notes()[-1] == f"verdict fair (member {pair['number'][7]}); the other 6 members have no verdict"
    listed = sg.SweepTable({**table.columns, "/b": np.arange(8) // 2 * 1.0, "/a": np.array([1.0, np.nan] * 4)})
    labels = listed.plot("normal_force").axes[0].get_legend_handles_labels()[1]
    assert labels[:2] == ["a = 1", "a = as in the problem"]
    nothing = {name: column[:0] for name, column in pair.columns.items()}
    assert sg.SweepTable(nothing | {"/a": np.zeros(0)}).plot("normal_force").axes
    alone = sg.SweepTable({"number": np.arange(1), "stick_width": np.ones(1), "status": np.array(["failed"]),
                           "reason": np.array(["invalid_problem"]), "warnings": np.array([""])})  # fmt: skip
    assert alone.notes() == ["1 of 1 members have no solution: invalid_problem 1"]
    with pytest.raises(ValueError, match="has no parameters"):
        alone.plot("stick_width")


def test_axes_are_spaced_as_the_service_spaces_them(client: sg.Client) -> None:
    axis = sg.logspace(0.005, 0.05, 4)
    table = client.sweep(BASE, {RHO: axis}).wait(60, progress=False).table()
    np.testing.assert_allclose(table["nonlocal_radius"], list(axis))
    np.testing.assert_allclose(list(sg.linspace(1, 2, 3)), [1, 1.5, 2])
    assert list(sg.linspace(1, 2, 1)) == [1]
    body = json.loads(calls.submit_sweep(BASE, {MU: axis}, "grid", {}, None).content or b"")
    assert body["axes"] == [
        {"path": "/contacts/0/friction/coefficient", "logspace": {"start": 0.005, "stop": 0.05, "count": 4}}
    ]


def test_a_sweep_can_be_left_and_stopped(
    client: sg.Client, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    sweep = client.sweep(long_problem(10_000), {MU: [0.1, 0.2]}, name="long")
    with pytest.raises(sg.WaitTimeout, match="long has not ended in time; it goes on.\n  The sweep goes on. Come back"):
        sweep.wait(timeout=0.01, progress=False)
    with monkeypatch.context() as patched:
        patched.setattr(Waiting, "seconds", lambda self: 0.05)
        patched.setattr(Waiting, "seen", lambda self, *seen: signal.raise_signal(signal.SIGINT))
        with pytest.raises(KeyboardInterrupt):
            sweep.wait()
    assert "Detached. The sweep goes on." in capsys.readouterr().err
    assert sweep.cancel().wait(30, progress=False).status == "canceled"
    assert [member.status for member in sweep.members()] == ["canceled", "canceled"]


def test_what_is_wrong_with_a_sweep(client: sg.Client) -> None:
    with pytest.raises(sg.InvalidProblem):
        client.sweep(BASE, {"contacts.3.indentation": [1, 2]})
    with pytest.raises(TypeError, match="a new sweep needs its axes"):
        client.sweep(BASE)
    with pytest.raises(sg.NotFound):
        client.sweep("sweep_nothing")


def test_names_of_columns() -> None:
    assert short_names([RHO, "/contacts/0/indentation", "/contacts/1/indentation", "/steps/0"]) == {
        RHO: "nonlocal_radius",
        "/contacts/0/indentation": "contacts.0.indentation",
        "/contacts/1/indentation": "contacts.1.indentation",
        "/steps/0": "steps.0",
    }


def test_what_the_line_says() -> None:
    counts = {"total": 4, "queued": 0, "running": 1, "succeeded": 1, "failed": 2, "canceled": 0}
    assert (
        sweep_line("s", {"status": "running", "members": counts})
        == "s · running · ███████████████░░░░░ 3 of 4 · 2 failed"
    )


def test_axes_of_everyday_values(client: sg.Client) -> None:
    iterations = "solver.max_iterations"
    decimals = (Decimal(n) for n in (150, 151, 152))
    for values in (range(150, 153), np.arange(150, 153), sg.linspace(150, 152, 3), decimals):
        table = client.sweep(BASE, {iterations: values}).wait(60, progress=False).table()
        assert table["max_iterations"].dtype.kind == "i" and table["max_iterations"].tolist() == [150, 151, 152]
    axes = {MU: [Decimal("0.1"), Fraction(1, 5)], "solver.check_uniqueness": [True, np.bool_(False)]}
    sweep = client.sweep(BASE, axes, labels={"n": 1}, timeout_s=np.float64(60)).wait(60, progress=False)
    table = sweep.table()
    assert table["check_uniqueness"].tolist() == [True, False] * 2 and table["coefficient"].dtype == float
    assert "coefficient" in table and "bogus" not in table and 0 not in table and list(table)[0] == "number"
    member = sweep.member(0)
    assert "normal_force" in member and "bogus" not in member and 0 not in member
    listed = client.sweep(BASE, [{MU: Decimal("0.1")}, {iterations: np.int64(150)}]).wait(60, progress=False).table()
    assert np.isnan(listed["max_iterations"][0]) and listed["max_iterations"][1] == 150


def test_a_parameter_with_the_name_of_a_result_keeps_its_column(client: sg.Client) -> None:
    base = BASE.with_values({"solver.algorithm": "thesis", "solver.thesis": {"relaxation": 0.9}})
    sweep = client.sweep(base, {"/solver/thesis/friction_force": [1, 2]}).wait(60, progress=False)
    table = sweep.table()
    assert table.parameters == ["solver.thesis.friction_force"]
    assert table["solver.thesis.friction_force"].tolist() == [1, 2]
    # the algorithm of the thesis leads to no solution, and a member without one has no numbers
    assert [member["friction_force"] for member in sweep.members()] == [None, None]
    assert np.isnan(table["friction_force"]).all()
    np.testing.assert_array_equal(table["iterations"], [member["iterations"] for member in sweep.members()])
    assert {"solver.thesis.friction_force", "friction_force"} <= set(sweep.to_pandas().columns)
    # whatever the names: each column is there once
    pointers = ["/a/number", "/a.b", "/c/d", "/c.d", "/e/d", "/x/status"]
    found = {name: np.arange(2.0) for name in ["number", *pointers, "x.status", "status"]}
    table = sg.SweepTable(found)
    assert table.parameters == ["a.number", "a.b", "/c/d", "c.d", "e.d", "/x/status"] and len(list(table)) == 9
