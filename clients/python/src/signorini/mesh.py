"""Meshes from files and from meshio.

Elements of the service are 8-node quadrilaterals and 6-node triangles. A mesh of meshio may also have those with 4, 9
and 3 nodes: midsides are put in, centres left out.
"""

from __future__ import annotations

import collections
import os
import pathlib
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .problem import InlineMesh, MeshInput, Refine

# kind of cell: its corners, and whether it has midsides
FACES = {"quad": (4, False), "quad8": (4, True), "quad9": (4, True), "triangle": (3, False), "triangle6": (3, True)}
EDGES = {"line", "line3"}


def from_file(path: str | os.PathLike[str], refine: Refine = 0) -> MeshInput:
    """The text of a file of Gmsh (.msh, ASCII) or of Abaqus or CalculiX (.inp), as part of a problem.

    For a large or binary file, or for many jobs, store it once: `Client.upload_mesh(path)`.
    """
    path = pathlib.Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ValueError(f"{path.name} is not a text; upload it: client.upload_mesh({os.fspath(path)!r})") from None
    if path.suffix == ".inp":
        return MeshInput(abaqus=text, refine=refine)
    return MeshInput(gmsh=text, refine=refine)


def from_meshio(mesh: Any, refine: Refine = 0) -> MeshInput:
    """A mesh of meshio, written out in the problem.

    Named sets of lines become boundaries, named sets of faces groups, named sets of points node sets: `cell_sets` and
    `point_sets`, or the physical groups of a file of Gmsh (`field_data`).
    """
    points = np.asarray(mesh.points, float)
    if points.shape[1] > 2 and np.any(points[:, 2] != points[0, 2]):
        raise ValueError("the mesh does not lie in a plane of constant z")
    builder = _Builder(points[:, :2])
    numbers: list[list[Any]] = []  # of each block: element numbers of faces, node pairs of lines
    for block in mesh.cells:
        if block.type in FACES:
            numbers.append([builder.face(cell, *FACES[block.type]) for cell in block.data])
        elif block.type in EDGES:
            numbers.append([(int(cell[0]), int(cell[1])) for cell in block.data])
        else:
            numbers.append([None] * len(block.data))
    if not builder.elements:
        raise ValueError("the mesh has no quadrilaterals or triangles")
    boundaries: dict[str, list[list[int]]] = {}
    groups: dict[str, Any] = {}
    for name, block, members in _named_cells(mesh):
        kind = mesh.cells[block].type
        if kind in FACES:
            groups.setdefault(name, []).extend(numbers[block][member] for member in members)
        elif kind in EDGES:
            sides = [builder.side(*numbers[block][member]) for member in members]
            # a line inside of the body is no boundary; the service leaves it out of a file, too
            if outer := [side for side in sides if builder.is_outer(side)]:
                boundaries.setdefault(name, []).extend(outer)
    sets: dict[str, Any] = {
        name: [builder.node(int(n)) for n in np.ravel(found)] for name, found in mesh.point_sets.items()
    }
    inline = InlineMesh(
        nodes=builder.nodes,
        elements=builder.elements,
        boundaries={name: list(map(list, dict.fromkeys(map(tuple, sides)))) for name, sides in boundaries.items()},
        groups=groups or None,
        node_sets=sets or None,
    )
    return MeshInput(inline=inline, refine=refine)


class _Builder:
    """Numbers the nodes that elements use, and puts in midsides where there are none."""

    def __init__(self, points: NDArray[Any]) -> None:
        self.points = points
        self.nodes: list[list[float]] = []
        self.elements: list[list[int]] = []
        self._numbers: dict[int, int] = {}
        self._midsides: dict[tuple[int, int], int] = {}
        self._elements_at: collections.Counter[int] = collections.Counter()

    def node(self, point: int) -> int:
        """The new number of a point of the mesh."""
        if point not in self._numbers:
            self._numbers[point] = len(self.nodes)
            self.nodes.append(self.points[point].tolist())
        return self._numbers[point]

    def face(self, cell: Iterable[int], corners: int, has_midsides: bool) -> int:
        """Adds an element, its corners counter-clockwise; returns its number."""
        cell = [int(point) for point in cell]
        around, middle = cell[:corners], cell[corners : 2 * corners] if has_midsides else []
        x, y = self.points[around].T
        if np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) < 0:
            around = around[:1] + around[:0:-1]
            middle = middle[::-1]
        ends = [self.node(point) for point in around]
        sides = list(zip(around, around[1:] + around[:1], strict=True))
        for number, (start, end) in enumerate(sides):
            key = (min(start, end), max(start, end))
            if key not in self._midsides:
                if middle:
                    self._midsides[key] = self.node(middle[number])
                else:
                    self._midsides[key] = len(self.nodes)
                    self.nodes.append(((self.points[start] + self.points[end]) / 2).tolist())
        midsides = [self._midsides[min(side), max(side)] for side in sides]
        self._elements_at.update(midsides)
        self.elements.append(ends + midsides)
        return len(self.elements) - 1

    def side(self, start: int, end: int) -> list[int]:
        """A side of an element: two corners and the midside between them."""
        key = (min(start, end), max(start, end))
        if key not in self._midsides:
            raise ValueError(f"the line from point {start} to point {end} is no side of an element")
        return [self.node(start), self.node(end), self._midsides[key]]

    def is_outer(self, side: list[int]) -> bool:
        """Whether there is an element on one side only."""
        return self._elements_at[side[2]] == 1


def _named_cells(mesh: Any) -> Iterable[tuple[str, int, Any]]:
    """Name, block and members of each named set of cells; those that meshio itself adds are left out."""
    found = False
    for name, blocks in (mesh.cell_sets or {}).items():
        if ":" in name:
            continue
        for block, members in enumerate(blocks):
            if members is not None and len(members):
                found = True
                yield name, block, members
    if found:
        return
    tags = (mesh.cell_data or {}).get("gmsh:physical")
    for name, (tag, dimension) in (mesh.field_data or {}).items():
        for block, cells in enumerate(mesh.cells):
            if tags is not None and (1 if cells.type in EDGES else 2) == dimension:
                members = np.flatnonzero(np.asarray(tags[block]) == tag)
                if len(members):
                    yield name, block, members
