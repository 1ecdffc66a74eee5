"""Meshes from files, from meshio and stored ones; obstacles from arrays."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest
from conftest import TOP

import signorini as sg
from signorini import problem as p

MESHES = TOP / "tests/data/gmsh"


def solve(client: sg.Client, mesh: p.MeshInput, obstacle: p.Obstacle | None = None) -> sg.Result:
    problem = p.Problem(
        analysis=p.PlaneStrain(),
        mesh=mesh,
        materials=[p.Material(youngs_modulus=1000, poissons_ratio=0.3)],
        supports=[p.Support(boundary="bottom", ux=0, uy=0)],
        contacts=[
            p.Contact(boundary="top", obstacle=obstacle or p.Parabola(radius=5, center=1), indentation=0.05),
        ],
    )
    return client.submit(problem).wait(60, progress=False)


def test_a_stored_mesh(client: sg.Client) -> None:
    file = MESHES / "fillet-mixed-msh41-binary.msh"
    stored = client.upload_mesh(file)
    assert stored.hash.startswith("sha256:") and {"top", "bottom"} <= set(stored.boundaries) and stored.dofs > 0
    assert client.upload_mesh(file.read_bytes()) == stored == client.mesh(stored.hash)
    assert stored.hash in [mesh.hash for mesh in client.meshes()]
    assert solve(client, p.MeshInput(stored=stored.hash)).normal_force > 0
    client.delete_mesh(stored.hash)
    with pytest.raises(sg.NotFound):
        client.mesh(stored.hash)
    with pytest.raises(ValueError, match="is not a text; upload it"):
        sg.mesh.from_file(file)
    with pytest.raises(ValueError, match="only meshes from files and inline meshes"):
        client.upload_mesh(p.MeshInput(grid=p.Grid(x=[0, 1], y=[0, 1])))


def test_a_file_as_part_of_the_problem(client: sg.Client, tmp_path: pathlib.Path) -> None:
    binary = solve(client, p.MeshInput(stored=client.upload_mesh(MESHES / "fillet-mixed-msh41-binary.msh").hash))
    file = MESHES / "fillet-mixed-msh41-ascii.msh"
    text = sg.mesh.from_file(file)
    assert text.gmsh and float(solve(client, text).normal_force) == pytest.approx(float(binary.normal_force), rel=1e-9)
    assert client.upload_mesh(file).hash == client.upload_mesh(text).hash
    deck = tmp_path / "plate.inp"
    deck.write_text("*NODE\n")
    assert sg.mesh.from_file(deck).abaqus == "*NODE\n"
    assert client.upload_mesh(sg.mesh.from_file(TOP / "tests/data/abaqus/ring-cpe8.inp")).document["format"] == "abaqus"


@pytest.mark.parametrize("name", ["fillet-mixed-msh22-ascii", "fillet-quad9-msh22-ascii", "fillet-mixed1-msh41-ascii"])
def test_a_file_by_way_of_meshio(client: sg.Client, name: str) -> None:
    meshio = pytest.importorskip("meshio")
    file = MESHES / f"{name}.msh"
    ours, theirs = sg.mesh.from_meshio(meshio.read(file)), sg.mesh.from_file(file)
    stored = client.upload_mesh(file)
    assert ours.inline is not None and len(ours.inline.nodes) == stored.nodes
    assert set(ours.inline.boundaries) == set(stored.boundaries)
    force = float(solve(client, theirs).normal_force)
    assert float(solve(client, ours).normal_force) == pytest.approx(force, rel=1e-6)


# A plate of two squares, 2 × 1; the second one is clockwise and may be cut into triangles.
#
#   3---4---5
#   | 0 | 1 |
#   0---1---2
POINTS = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0], [9, 9, 0]], float)
LINES = [[3, 4], [4, 5], [0, 1], [1, 2]]


@pytest.mark.parametrize(
    "cells",
    [[("quad", [[0, 1, 4, 3], [1, 4, 5, 2]])], [("quad", [[0, 1, 4, 3]]), ("triangle", [[1, 2, 5], [1, 4, 5]])]],
)
def test_a_mesh_of_meshio(client: sg.Client, cells: list[tuple[str, list[list[int]]]]) -> None:
    meshio = pytest.importorskip("meshio")
    blocks = len(cells)
    mesh = meshio.Mesh(
        POINTS,
        [*cells, ("line", LINES), ("vertex", [[0]])],
        point_sets={"corner": np.array([0])},
        cell_sets={
            "top": [*[None] * blocks, np.array([0, 1]), None],
            "bottom": [*[None] * blocks, np.array([2, 3]), None],
            "all": [*[np.arange(len(found)) for _, found in cells], None, None],
            "meshio:own": [*[None] * blocks, np.array([0]), None],
        },
    )
    found = sg.mesh.from_meshio(mesh, refine=2)
    assert found.inline is not None
    # six corners and seven or eight midsides; the point that no element uses is left out
    assert len(found.inline.nodes) == 13 + (blocks - 1)
    assert set(found.inline.boundaries) == {"top", "bottom"} and found.inline.node_sets == {"corner": [0]}
    assert found.inline.groups == {"all": list(range(len(found.inline.elements)))}
    grid = p.MeshInput(grid=p.Grid(x=[0, 1, 2], y=[0, 1]), refine=2)
    rel = 1e-9 if blocks == 1 else 0.02
    assert float(solve(client, found).normal_force) == pytest.approx(float(solve(client, grid).normal_force), rel=rel)
    assert client.upload_mesh(found).nodes == len(found.inline.nodes)


def test_physical_groups_of_a_file_and_nine_nodes(tmp_path: pathlib.Path) -> None:
    meshio = pytest.importorskip("meshio")
    points = [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5], [0.5, 0.5]]
    mesh = meshio.Mesh(
        points,
        {"quad9": [[0, 3, 2, 1, 7, 6, 5, 4, 8]], "line3": [[2, 3, 6]]},
        cell_data={"gmsh:physical": [np.array([1]), np.array([2])]},
        field_data={"body": np.array([1, 2]), "top": np.array([2, 1]), "nothing": np.array([7, 1])},
    )
    inline = sg.mesh.from_meshio(mesh).inline
    assert inline is not None and len(inline.nodes) == 8 and inline.groups == {"body": [0]}
    (element,) = inline.elements
    places = [inline.nodes[n] for n in element]
    assert places == [points[n] for n in (0, 1, 2, 3, 4, 5, 6, 7)], "the corners are turned counter-clockwise"
    assert [inline.nodes[n] for n in inline.boundaries["top"][0]] == [points[n] for n in (2, 3, 6)]


def test_what_is_wrong_with_a_mesh_of_meshio() -> None:
    meshio = pytest.importorskip("meshio")
    with pytest.raises(ValueError, match="no quadrilaterals or triangles"):
        sg.mesh.from_meshio(meshio.Mesh(POINTS, [("line", LINES)]))
    with pytest.raises(ValueError, match="plane of constant z"):
        sg.mesh.from_meshio(meshio.Mesh(POINTS + np.outer(np.arange(7), [0, 0, 1]), [("quad", [[0, 1, 4, 3]])]))
    sets = {"cut": [None, np.array([0])]}
    with pytest.raises(ValueError, match="the line from point 0 to point 4 is no side of an element"):
        sg.mesh.from_meshio(meshio.Mesh(POINTS, [("quad", [[0, 1, 4, 3]]), ("line", [[0, 4]])], cell_sets=sets))


def test_obstacles_from_arrays(client: sg.Client) -> None:
    c = np.linspace(-0.5, 2.5, 61)
    gap = (c - 1) ** 2 / 10
    shuffled = np.random.default_rng(4).permutation(len(c))
    table = sg.obstacle.from_points(c[shuffled], gap[shuffled], interpolation="cubic")
    assert table == sg.obstacle.from_points(c, gap, interpolation="cubic")
    grid = p.MeshInput(grid=p.Grid(x=np.linspace(0, 2, 9), y=[0, 0.5, 1]))
    exact = solve(client, grid)
    assert float(solve(client, grid, table).normal_force) == pytest.approx(float(exact.normal_force), rel=1e-9)
    smooth = sg.obstacle.from_points(c, gap, standard_deviation=1e-6)
    assert smooth.interpolation == "cubic" and smooth.smoothing == p.Smoothing(standard_deviation=1e-6)
    curve = sg.obstacle.from_curve(np.column_stack([c, 1 + gap]), interpolation="cubic")
    assert float(solve(client, grid, curve).normal_force) == pytest.approx(float(exact.normal_force), rel=1e-3)
    for wrong in ([0, 1, 1], [0]):
        with pytest.raises(ValueError, match="at least two points, each coordinate once"):
            sg.obstacle.from_points(wrong, wrong)
    with pytest.raises(ValueError, match="2 coordinates, but 3 gaps"):
        sg.obstacle.from_points([0, 1], [0, 1, 2])
    with pytest.raises(ValueError, match="rows of x and y"):
        sg.obstacle.from_curve([1, 2])
