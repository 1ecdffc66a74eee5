"""The types of a problem: as the service's schema has them, and checked when they are made."""

from __future__ import annotations

import datetime
import json
import os
import pathlib
import subprocess
import sys
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from conftest import BINARY, TOP

import signorini as sg
from signorini import problem as p
from signorini._parts import hints, json_name

CLIENT = TOP / "clients/python"


def schema() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(subprocess.run([BINARY, "schema"], check=True, capture_output=True).stdout)
    return found


def test_the_types_are_those_that_the_schema_generates() -> None:
    script = CLIENT / "tools/generate_problem.py"
    environment = {**os.environ, "SIGNORINI_PRINT": "1", "PYTHONIOENCODING": "utf-8"}
    made = subprocess.run([sys.executable, script], check=True, capture_output=True, env=environment).stdout
    committed = (CLIENT / "src/signorini/problem.py").read_bytes()
    assert made == committed, "run clients/python/tools/generate_problem.py"


def test_the_names_of_fields_are_those_of_the_schema() -> None:
    document = schema()
    for name, definition in [*document["$defs"].items(), ("Problem", document)]:
        if "properties" in definition:
            fields = {json_name(field) for field in hints(getattr(p, name))}
            assert fields == set(definition["properties"]), name


def test_the_examples_are_those_of_the_repository() -> None:
    files = sorted((TOP / "examples").glob("*.json"))
    assert [file.stem for file in files] == sorted(sg.examples.__all__)
    for file in files:
        packaged = CLIENT / "src/signorini/examples" / file.name
        assert packaged.read_bytes() == file.read_bytes(), f"copy {file.name} to {packaged.parent}"


@pytest.mark.parametrize("name", sg.examples.__all__)
def test_an_example_survives_being_read_and_written(name: str) -> None:
    document = json.loads((TOP / "examples" / f"{name}.json").read_text(encoding="utf-8"))
    problem = getattr(sg.examples, name)()
    assert problem.to_dict() == document
    assert p.Problem.from_dict(problem.to_dict(defaults=True)) == problem
    assert eval(repr(problem), vars(p)) == problem


def test_parameters_of_examples() -> None:
    problem = sg.examples.cylinder(rho=0.02, mu=0.4, epsilon=1e-3, refine=2)
    friction = problem.contacts[0].friction
    assert friction is not None
    assert (friction.nonlocal_radius, friction.coefficient, friction.elastic_slip) == (0.02, 0.4, 1e-3)
    assert problem.mesh.refine == 2
    assert sg.examples.cylinder(refine=0.01).mesh.refine == p.AdaptiveRefine(tolerance=0.01)
    with pytest.raises(sg.InvalidProblem, match="/contacts/0/friction/coefficient: got nan"):
        sg.examples.cylinder(mu=float("nan"))


def test_everything_that_is_wrong_is_told_at_once() -> None:
    with pytest.raises(sg.InvalidProblem) as caught:
        p.Problem.from_dict(
            {
                "analysis": {"kind": "plain_strain"},
                "mesh": {"grid": {"x": [0, float("nan")], "z": [1]}, "refine": "fine"},
                "materials": [{"youngs_modulus": "1", "poissons_ratio": True}],
                "contact": [],
                "contacts": [{"boundary": "top", "obstacle": {"from": 0}, "friction": {"kernel": "bum"}}],
                "supports": 3,
                "steps": [{"increments": 1.5}, {"increments": -1}],
                "title": 7,
                "solver": {"thesis": {"contact_guess": [1]}},
                "loads": [{"traction": [1]}, "push"],
            }
        )
    found = {(v.pointer, v.reason) for v in caught.value.violations}
    assert found == {
        ("/analysis/kind", "unknown_value"),
        ("/mesh/grid/x/1", "not_finite"),
        ("/mesh/grid/y", "missing"),
        ("/mesh/grid/z", "unknown_name"),
        ("/mesh/refine", "wrong_type"),
        ("/materials/0/youngs_modulus", "wrong_type"),
        ("/materials/0/poissons_ratio", "wrong_type"),
        ("/contact", "unknown_name"),
        ("/contacts/0/obstacle/kind", "unknown_value"),
        ("/contacts/0/friction/elastic_slip", "missing"),
        ("/contacts/0/friction/kernel", "unknown_value"),
        ("/supports", "wrong_type"),
        ("/steps/0/increments", "wrong_type"),
        ("/steps/1/increments", "wrong_type"),
        ("/title", "wrong_type"),
        ("/solver/thesis/contact_guess", "wrong_type"),
        ("/loads/0/traction", "wrong_length"),
        ("/loads/1", "wrong_type"),
    }
    text = str(caught.value)
    assert text.startswith("Problem is invalid:\n  1. ")
    assert "/contact: got `contact`, expected one of" in text and "Did you mean `contacts`?" in text
    assert "got `plain_strain`, expected one of `plane_strain`" in text and "Did you mean `plane_strain`?" in text
    assert "/mesh/refine: got 'fine', expected a whole number ≥ 0 or a AdaptiveRefine or a dictionary" in text


def test_a_class_checks_itself_when_it_is_made() -> None:
    with pytest.raises(sg.InvalidProblem) as caught:
        p.Friction(coefficient="a", elastic_slip=float("inf"), kernel="bum")  # type: ignore[arg-type]
    assert [v.pointer for v in caught.value.violations] == ["/elastic_slip", "/coefficient", "/kernel"]
    with pytest.raises(TypeError, match="elastic_slip"):
        p.Friction(coefficient=0.3)  # type: ignore[call-arg]


def test_arrays_and_numbers_of_numpy_and_tuples_will_do() -> None:
    grid = p.Grid(x=np.linspace(0, 1, 3), y=(0, np.float64(1)), top=np.array([[0, 1], [1, 2]]))
    assert grid == p.Grid(x=[0, 0.5, 1], y=[0, 1], top=[[0, 1], [1, 2]])
    json.dumps(grid.to_dict())
    assert p.Step(increments=np.int64(3)).increments == 3
    assert p.Support(boundary="top", ux=np.array([0, 1])).to_dict() == {"boundary": "top", "ux": [0, 1]}
    with pytest.raises(sg.InvalidProblem, match="/x/1: got inf"):
        p.Grid(x=np.array([0, np.inf]), y=[0, 1])


def test_arrays_may_be_set_later_too() -> None:
    problem = sg.examples.rectangular_punch()
    assert problem.mesh.grid is not None
    problem.mesh.grid.top = np.array([[0, 0], [4, 0.1]])
    problem.supports[0].ux = [np.float64(0), np.array(0.1)]  # type: ignore[list-item]
    document = problem.to_dict()
    assert document["mesh"]["grid"]["top"] == [[0, 0], [4, 0.1]] and document["supports"][0]["ux"] == [0, 0.1]
    json.dumps(document)
    assert "top=array" in repr(problem)


def test_dictionaries_will_do_wherever_a_class_is_expected() -> None:
    contact = p.Contact(boundary="top", obstacle={"kind": "flat", "from": 0, "to": 1})
    assert contact.obstacle == p.Flat(from_=0, to=1)
    assert contact.to_dict() == {"boundary": "top", "obstacle": {"kind": "flat", "from": 0, "to": 1}}


def test_what_is_set_later_is_checked_when_it_is_submitted(client: sg.Client) -> None:
    problem = sg.examples.rectangular_punch()
    problem.contacts[0].indentation = "deep"  # type: ignore[assignment]
    with pytest.raises(sg.InvalidProblem, match="/contacts/0/indentation: got 'deep', expected a number"):
        client.submit(problem)


def test_other_values_by_dotted_names_or_pointers() -> None:
    problem = sg.examples.rectangular_punch()
    other = problem.with_values(
        {"contacts.0.friction.coefficient": 0.1, "/solver/tolerance": 1e-8, "contacts.0.obstacle": p.Flat(to=0.4)}
    )
    friction = other.contacts[0].friction
    assert friction is not None and friction.coefficient == 0.1
    assert other.solver.tolerance == 1e-8 and other.contacts[0].obstacle == p.Flat(to=0.4)
    assert problem == sg.examples.rectangular_punch(), "the problem itself stays as it is"
    for path in ("contacts.1.friction", "contact.0", "title.x.y", "title.x", "contacts.7", "contacts.x.y"):
        with pytest.raises(KeyError, match="there is no"):
            problem.with_values({path: 1})


def test_the_service_validates(client: sg.Client) -> None:
    found = sg.examples.rectangular_punch().validate(client)
    assert found and found.estimate is not None and found.estimate["dofs"] > 0
    assert [w.pointer for w in found.warnings if w.code == "mesh_too_coarse_for_radius"] == [
        "/contacts/0/friction/nonlocal_radius"
    ]
    assert str(found).startswith("valid\n  warning: mesh_too_coarse_for_radius: ")
    problem = sg.examples.rectangular_punch()
    problem.materials[0].youngs_modulus = -1
    problem.contacts[0].boundary = "tap"
    bad = client.validate(problem)
    assert not bad
    assert {v.pointer for v in bad.violations} == {"/materials/0/youngs_modulus", "/contacts/0/boundary"}
    assert "1. /materials/0/youngs_modulus: got -1, expected a stress > 0" in str(bad)
    with pytest.raises(sg.InvalidProblem, match="/analysis/x: got nan, expected a finite number"):
        client.validate({"analysis": {"x": float("nan")}})


def test_a_misspelt_field_is_refused_also_later() -> None:
    problem = sg.examples.rectangular_punch()
    friction = problem.contacts[0].friction
    assert friction is not None
    with pytest.raises(TypeError, match="Friction has no `coeficient`. Did you mean `coefficient`?"):
        p.Friction(**{"coeficient": 0.3, "elastic_slip": 1e-4})  # type: ignore[arg-type]
    with pytest.raises(AttributeError, match="Friction has no `coeficient`. Did you mean `coefficient`?"):
        friction.coeficient = 0.9  # type: ignore[attr-defined]
    friction.coefficient = 0.9
    assert problem.to_dict()["contacts"][0]["friction"]["coefficient"] == 0.9


def test_everyday_values_will_do(client: sg.Client) -> None:
    pandas = pytest.importorskip("pandas")
    # what a type checker is told, too: nothing here is ignored
    contact = p.Contact(
        boundary="top",
        obstacle={"kind": "flat", "to": Decimal("0.5")},
        indentation=Decimal("0.25"),
        friction={"coefficient": np.float32(0.5), "nonlocal_radius": Fraction(1, 100), "elastic_slip": 1e-4},
    )
    assert contact.friction == p.Friction(coefficient=0.5, nonlocal_radius=0.01, elastic_slip=1e-4)
    assert contact.indentation == 0.25 and contact.obstacle == p.Flat(to=0.5)
    assert p.Step(increments=np.int64(3)) == p.Step(increments=3)
    several: list[Any] = [range(5), pandas.Series(range(5)), (n for n in range(5)), dict.fromkeys(range(5)).keys()]
    for lines in several:
        assert p.Grid(x=lines, y=[0, 1]).x == [0, 1, 2, 3, 4]
    with pytest.raises(sg.InvalidProblem, match="/x: got {0, 1}"):
        p.Grid(x={0, 1}, y=[0, 1])  # type: ignore[arg-type]
    with pytest.raises(sg.InvalidProblem, match="/indentation: got nan"):
        p.Contact(boundary="top", obstacle=p.Flat(), indentation=Decimal("NaN"))
    assert p.MeshInput(gmsh=pathlib.Path("a.msh")).gmsh == "a.msh"  # type: ignore[arg-type]

    document = sg.examples.sheet(refine=0).to_dict()
    document["title"] = pathlib.PurePosixPath("studies/größe")
    document["solver"] = {"max_iterations": np.int32(150), "tolerance": Decimal("1e-9"), "algorithm": np.str_("auto")}
    document["mesh"]["grid"]["x"] = pandas.Series(document["mesh"]["grid"]["x"])
    job = client.submit(
        document,
        name=pathlib.PurePosixPath("größe.msh"),  # type: ignore[arg-type]
        labels={"größe": 1, "run": np.int64(7), "path": pathlib.PurePosixPath("a/b")},
        priority=np.int64(2),  # type: ignore[arg-type]
        timeout_s=Decimal(60),  # type: ignore[arg-type]
        key="größe 0.3 µ",
    )
    assert job.wait(60, progress=False).converged
    assert (job.name, job.priority) == ("größe.msh", 2)
    assert job.labels == {"größe": "1", "run": "7", "path": "a/b"}
    same = client.submit(document, name="größe.msh", labels=job.labels, priority=2, timeout_s=60, key="größe 0.3 µ")
    assert same.id == job.id
    assert job.problem_document()["title"] == "studies/größe"
    assert job.problem_document()["solver"]["max_iterations"] == 150
    assert [found.id for found in client.jobs(labels={"größe": 1}, created_after=datetime.date(2020, 1, 1))] == [job.id]
    assert not list(client.jobs(labels={"größe": 1}, created_before=datetime.date(2020, 1, 1)))
    events = list(job.events())
    assert "type" in events[0] and "nothing" not in events[0] and 0 not in events[0]
