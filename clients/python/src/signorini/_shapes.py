"""Where the parts of a problem lie, as far as that can be told without the service; for figures.

Grids and inline meshes are known here; meshes in files are not read.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from . import problem as p
    from ._data import Array, Fields, Profile


def mesh_lines(mesh: p.MeshInput) -> Iterator[Array]:
    """The lines of the mesh, each a row (x, y) for each point. Raises ValueError for a mesh in a file."""
    grids = [mesh.grid] if mesh.grid is not None else list((mesh.grids or {}).values())
    if grids:
        for grid in grids:
            x, y = np.asarray(grid.x, float), np.asarray(grid.y, float)
            for fraction in y:
                yield np.column_stack([x, _height(grid, x, float(fraction))])
            for position in x:
                yield np.array([[position, _height(grid, np.array([position]), float(f))[0]] for f in (y[0], y[-1])])
    elif mesh.inline is not None:
        nodes = np.asarray(mesh.inline.nodes, float)
        for element in mesh.inline.elements:
            yield nodes[around(list(element))]
    else:
        raise ValueError("the mesh is in a file, which is not read here; once there is a job, job.svg('mesh') draws it")


def sides(blocks: list[Array]) -> tuple[Array, Array]:
    """The sides of quadratic elements, each once, as rows (end, middle, end); and those that only one element has."""
    every = []
    for block in blocks:
        corners = block.shape[1] // 2 if len(block) else 0
        for k in range(corners):
            every.append(np.column_stack([block[:, k], block[:, corners + k], block[:, (k + 1) % corners]]))
    rows = np.concatenate(every).astype(int)
    # two elements that share a side share the node in its middle
    _, first, counts = np.unique(rows[:, 1], return_index=True, return_counts=True)
    return rows[first], rows[first[counts == 1]]


def curved(points: Array, sides: Array) -> Array:
    """The sides as curves through their three nodes, five points each."""
    xi = np.linspace(-1, 1, 5)
    shape = np.column_stack([xi * (xi - 1) / 2, 1 - xi**2, xi * (xi + 1) / 2])
    return np.asarray(np.einsum("pk,skc->spc", shape, points[sides]))


def obstacle_after(fields: Fields, profile: Profile, scale: float) -> tuple[Array, Array]:
    """The face of an obstacle at the end, beside a body with scaled displacements, and the direction out of the body.

    On the surface where they touch, elsewhere as far from it as their gap, which is scaled like the displacements.
    """
    # a profile names its nodes by their positions, which are those of the fields to the last bit
    numbers = {place: number for number, place in enumerate(map(tuple, fields.points[:, :2].tolist()))}
    places = zip(profile.x.tolist(), profile.y.tolist(), strict=True)
    found = [(row, numbers[place]) for row, place in enumerate(places) if place in numbers]
    if len(found) < 2:
        return np.empty((0, 2)), np.empty((0, 2))
    rows, nodes = np.array(found).T
    outward = normals(fields.points[nodes, :2])
    gap = (profile.gap - profile.normal_displacement)[rows]
    there = np.isfinite(gap)
    drawn = (fields.points + scale * fields.displacement)[nodes, :2]
    face = drawn + scale * np.where(there, gap, 0)[:, None] * outward
    return face[there], outward[there]


def around(element: list[int]) -> list[int]:
    """The nodes of an element along its sides, back to the first."""
    corners = len(element) // 2
    return [n for i in range(corners) for n in (element[i], element[corners + i])] + [element[0]]


def _height(grid: p.Grid, x: Array, y: float) -> Array:
    """The position y of a grid line: given, or a fraction of the height of a strip."""
    if grid.top is None and grid.bottom is None:
        return np.full(len(x), y)
    low, high = (
        np.zeros(len(x)) if line is None else np.interp(x, *np.asarray(line, float).T)
        for line in (grid.bottom, grid.top)
    )
    return low + y * (high - low)


def boundary(mesh: p.MeshInput, name: str) -> Array:
    """The points of a boundary, the body on their right; empty if it is not known here."""
    part = mesh.boundaries.get(name)
    if part is not None:
        if part.side is None or part.normal is not None:
            return np.empty((0, 2))
        points = boundary(mesh, part.side)
        inside = np.ones(len(points), bool)
        for axis, limits in ((0, part.x), (1, part.y)):
            if limits is not None:
                inside &= _within(points[:, axis], float(limits[0]), float(limits[1]))
        return points[inside]
    body, _, side = name.rpartition(".")
    grid = (mesh.grids or {}).get(body) if body else mesh.grid
    if grid is not None:
        x, y = np.asarray(grid.x, float), np.asarray(grid.y, float)
        if side in ("top", "bottom"):
            line = np.column_stack([x, _height(grid, x, float(y[-1] if side == "top" else y[0]))])
            return line if side == "top" else line[::-1]
        if side in ("left", "right"):
            position = np.array([x[0] if side == "left" else x[-1]])
            line = np.array([[position[0], _height(grid, position, float(f))[0]] for f in y])
            return line if side == "left" else line[::-1]
    if mesh.inline is not None and name in mesh.inline.boundaries:
        nodes = np.asarray(mesh.inline.nodes, float)
        sides = [[side[0], side[2], side[1]] for side in mesh.inline.boundaries[name]]
        return nodes[[n for side in sides for n in side]]
    return np.empty((0, 2))


def _within(values: Array, start: float, end: float) -> Any:
    rounding = 1e-9 * max(abs(start), abs(end), 1e-300)
    return (values >= start - rounding) & (values <= end + rounding)


def arc_length(points: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def normals(points: Array) -> Array:
    """Outward normals: the tangent turned to the left, since the body is on the right."""
    tangents = np.gradient(points, axis=0)
    lengths = np.linalg.norm(tangents, axis=1, keepdims=True)
    tangents = tangents / np.where(lengths == 0, 1, lengths)
    return np.column_stack([-tangents[:, 1], tangents[:, 0]])


def obstacle(mesh: p.MeshInput, contact: p.Contact) -> Array:
    """The face of the obstacle before it is pushed, as points in space; empty if it is not known here."""
    shape = contact.obstacle
    if shape is None:
        return np.empty((0, 2))
    if shape.kind == "polyline":
        return np.asarray(shape.points, float)
    face = boundary(mesh, contact.boundary)
    if len(face) < 2:
        return np.empty((0, 2))
    if shape.kind == "line":
        angle, size = math.radians(shape.angle), np.ptp(face, axis=0).max() / 2
        middle, along = np.asarray(shape.point, float), np.array([math.cos(angle), math.sin(angle)])
        return np.array([middle - size * along, middle + size * along])
    s = arc_length(face)
    fine = np.union1d(np.linspace(0, s[-1], 801), s)
    points = np.column_stack([np.interp(fine, s, face[:, axis]) for axis in (0, 1)])
    c = points[:, 0] if shape.along == "x" else fine
    start = c.min() if shape.from_ is None else shape.from_
    end = c.max() if shape.to is None else shape.to
    # the ends themselves, which no other point may hit
    ends = np.interp([start, end], c, fine) if c[-1] > c[0] else np.interp([start, end], c[::-1], fine[::-1])
    fine = np.union1d(fine, ends)
    points = np.column_stack([np.interp(fine, s, face[:, axis]) for axis in (0, 1)])
    c = points[:, 0] if shape.along == "x" else fine
    distance = profile(shape, c)
    there = _within(c, float(start), float(end)) & np.isfinite(distance)
    return np.asarray(points[there] + distance[there, None] * normals(points)[there])


def profile(shape: p.Obstacle, c: Array) -> Array:
    """The distance of an obstacle from the surface before it is pushed; NaN where there is none."""
    if shape.kind == "table":
        x, gap = np.asarray(shape.x, float), np.asarray(shape.gap, float)
        return np.asarray(np.interp(c, x, gap, left=np.nan, right=np.nan))
    if shape.kind == "flat":
        return np.zeros(len(c))
    if shape.kind == "polyline" or shape.kind == "line":
        raise TypeError("a curve in space has no profile of its own")
    c = c - shape.center
    if shape.kind == "circle":
        return _circle(np.abs(c), shape.radius)
    if shape.kind == "parabola":
        return np.asarray(c**2 / (2 * shape.radius))
    if shape.kind == "wedge" or shape.kind == "cone":
        return np.asarray(np.abs(c) * math.tan(math.radians(shape.angle)))
    if shape.kind == "tilted":
        return np.asarray(shape.slope * c)
    if shape.kind == "power":
        return np.asarray(shape.coefficient * np.abs(c) ** shape.exponent)
    return _circle(np.maximum(np.abs(c) - shape.half_width, 0), shape.radius)


def _circle(c: Array, radius: float) -> Array:
    inside = c <= radius
    return np.asarray(np.where(inside, radius - np.sqrt(np.where(inside, radius**2 - c**2, 0)), np.nan))
