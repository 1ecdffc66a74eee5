"""Obstacles from arrays, as they are measured or computed."""

from __future__ import annotations

from typing import Any

import numpy as np

from .problem import Along, Interpolation, Polyline, Smoothing, Table


def from_points(
    c: Any,
    gap: Any,
    *,
    interpolation: Interpolation = "linear",
    standard_deviation: float | None = None,
    along: Along = "x",
) -> Table:
    """An obstacle by its distance from the surface at points of it.

    c: coordinates along the boundary, in any order, each once (length)
    gap: the obstacle's distance there before it is pushed (length, either sign)
    interpolation: `linear`, where every point is a kink, at which the pressure has no limit; or `cubic`, a spline
    standard_deviation: of the error of one point, for a measured profile: the curve then passes near the points
        instead of through them (length). Needs, and implies, `cubic`.
    """
    c, gap = np.asarray(c, float).ravel(), np.asarray(gap, float).ravel()
    if len(c) != len(gap):
        raise ValueError(f"{len(c)} coordinates, but {len(gap)} gaps")
    order = np.argsort(c, kind="stable")
    c, gap = c[order], gap[order]
    if len(c) < 2 or not np.all(np.diff(c) > 0):
        raise ValueError("an obstacle needs at least two points, each coordinate once")
    smoothing = None if standard_deviation is None else Smoothing(standard_deviation=standard_deviation)
    kind: Interpolation = "cubic" if smoothing else interpolation
    return Table(x=c, gap=gap, interpolation=kind, smoothing=smoothing, along=along)


def from_curve(points: Any, *, interpolation: Interpolation = "linear") -> Polyline:
    """An obstacle by points `[x, y]` in space, from one end to the other; its gap is along the body's normal."""
    points = np.asarray(points, float)
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"points are rows of x and y, not an array of shape {points.shape}")
    return Polyline(points=points, interpolation=interpolation)
