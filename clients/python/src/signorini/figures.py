"""Figures for papers and lectures, by matplotlib (`pip install signorini[plot]`).

    profile       stresses along a contact, stick and slip shaded
    convergence   residuals and changes of contact by iteration
    deformed      the deformed body with a stress
    sweep         a column of a study over its parameters
    problem       mesh, supports and obstacles of a problem, before it is solved

All return a `matplotlib.figure.Figure`: `figure.savefig("punch.pdf")`. Each takes `size`, one of `column` (88 mm),
`page` (default) and `slide`, and `theme`, `light` (default) or `dark`. Under the title stand the parameters μ, ρ, ε,
beside it the verdict; below the figure the warnings.

`ax` draws on axes of your own, `figure, ax = plt.subplots()`: on one, or on as many as the figure has panels. Their
title then has the parameters and the verdict; letters and sizes are those of your figure.
"""

from __future__ import annotations

import dataclasses
import json
import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _shapes as shapes
from ._style import PARAMETERS, QUANTITIES, Theme, panels, parameters, style, subtitle, unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ._data import Array, Fields, History, Profile
    from ._sweep import SweepTable
    from .problem import Problem

__all__ = ["convergence", "deformed", "problem", "profile", "sweep"]

CUT = 6.0
"""A stress is drawn up to so many times its median along the contact; a peak beyond it is cut and marked."""


def profile(
    found: Profile, *, size: str = "page", theme: str = "light", title: str | None = None, ax: Any = None
) -> Figure:
    """Normal and tangential stress along a contact by arc length, with the friction bound; stick and slip shaded.

    ax: one for both stresses, or two
    """
    with style(size, theme, ax) as (plt, width, colours):
        if ax is None:
            # in a narrow column the words on the axes need more height
            height = width * (1.1 if size == "column" else 0.78)
            figure, pair = plt.subplots(2, 1, sharex=True, figsize=(width, height), layout="constrained")
        else:
            pair = panels(ax)
            figure = pair[0].figure
        upper, lower = pair[0], pair[-1]
        s = found.s
        _shade(upper, found, colours, words=True)
        if lower is not upper:
            _shade(lower, found, colours, words=False)
        upper.plot(s, found.normal_stress, color=colours.normal, label=QUANTITIES["normal_stress"])
        bound = found.friction_bound
        signs = [sign for sign in (1, -1) if np.any(sign * found.tangential_stress > 0)] or [1]
        if np.any(bound > 0):
            for sign in signs:
                label = QUANTITIES["friction_bound"] if sign == signs[0] else None
                lower.plot(s, sign * bound, color=colours.faint, linestyle=(0, (4, 2)), label=label)
        lower.plot(s, found.tangential_stress, color=colours.tangential, label=QUANTITIES["tangential_stress"])
        if lower is upper:
            # away from the note on a peak that is cut
            lower.legend(loc="lower left" if _is_late(s, found.normal_stress) else "lower right")
        elif np.any(bound > 0):
            lower.legend(loc="best")
        stress = unit(found.about, "stress")
        upper.set_ylabel(QUANTITIES["normal_stress"] + stress)
        lower.set_ylabel(("stress on the body" if lower is upper else QUANTITIES["tangential_stress"]) + stress)
        lower.set_xlabel(f"arc length $s${unit(found.about, 'length')} along “{found.boundary}”")
        for axes in pair:
            axes.axhline(0, color=colours.ink, linewidth=0.5)
            axes.margins(x=0)
        pressed = _limits(s, found.normal_stress)
        # with the bound, unless it is far from being reached
        low, high = _limits(s, found.tangential_stress, np.inf)
        reach = 1.08 * float(bound.max())
        rubbed = min(low, max(-reach, 1.6 * low)), max(high, min(reach, 1.6 * high))
        if lower is upper:
            pressed = rubbed = min(pressed[0], rubbed[0]), max(pressed[1], rubbed[1])
        upper.set_ylim(*pressed)
        lower.set_ylim(*rubbed)
        _mark_cut(upper, s, found.normal_stress, colours, found.about, found.boundary, short=lower is upper)
        _position_axis(upper, found)
        if ax is not None:
            return _entitled(upper, found.about, found.partial, title, found.boundary)
        _head(figure, upper, found.about, colours, found.partial, title, found.boundary)
        _foot(figure, found.about, colours, width)
    return _finished(plt, figure)


def convergence(
    found: History, *, size: str = "page", theme: str = "light", title: str | None = None, ax: Any = None
) -> Figure:
    """Residuals by iteration, the tolerance, and how many nodes entered and left contact.

    ax: one for the residuals alone, or two
    """
    with style(size, theme, ax) as (plt, width, colours):
        if ax is None:
            height = width * (1.15 if size == "column" else 0.7)
            figure, pair = plt.subplots(
                2, 1, sharex=True, figsize=(width, height), layout="constrained", height_ratios=[3, 1]
            )
        else:
            pair = panels(ax)
            figure = pair[0].figure
        upper, lower = pair[0], pair[-1]
        k = found.k
        marker = "o" if len(k) <= 60 else ""
        lines = [("residual", colours.normal, "-", "o"), ("friction_residual", colours.tangential, "--", "s")]
        for name, colour, dashes, shape in lines:
            values = np.where(getattr(found, name) > 0, getattr(found, name), np.nan)
            upper.semilogy(
                k, values, color=colour, linestyle=dashes, marker=marker and shape, markersize=3, label=QUANTITIES[name]
            )
        upper.semilogy(k, found.tolerance, color=colours.ink, linewidth=0.8, linestyle=":", label="tolerance")
        upper.set_ylabel("residual (dimensionless)")
        upper.grid(axis="y")
        if lower is not upper:
            lower.bar(k, found.contact_entered, color=colours.stick, label="entered")
            lower.bar(k, -found.contact_left.astype(float), color=colours.slip, hatch="///", label="left")
            lower.axhline(0, color=colours.ink, linewidth=0.5)
            lower.set_ylabel("nodes of\ncontact")
        lower.set_xlabel("iteration $k$")
        if ax is None:
            _legend_below(plt, figure, upper, lower, columns=2 if size == "column" else 3)
        else:
            for axes in pair:
                axes.legend(loc="best")
        lower.xaxis.get_major_locator().set_params(integer=True)
        for change in np.flatnonzero(np.diff(found.step.astype(int))):
            for axes in pair:
                axes.axvline((k[change] + k[change + 1]) / 2, color=colours.faint, linewidth=0.6)
        if ax is not None:
            return _entitled(upper, found.about, found.partial, title)
        _head(figure, upper, found.about, colours, found.partial, title)
        _foot(figure, found.about, colours, width)
    return _finished(plt, figure)


def _legend_below(plt: Any, figure: Any, upper: Any, lower: Any, columns: int) -> None:
    """Outside, since a long history fills its panels."""
    from matplotlib.transforms import offset_copy

    handles = [handle for axes in (upper, lower) for handle in axes.get_legend_handles_labels()[0]]
    # below the name of the axis, by the height of letters
    below = offset_copy(lower.transAxes, figure, 0, -3.6 * plt.rcParams["font.size"], units="points")
    lower.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(0, 0), bbox_transform=below, borderaxespad=0, ncols=columns
    )


VISIBLE = 0.1
"""The largest displacement is drawn as this part of the body, or of the window at the contact."""
SMALL = 0.2
"""A contact below this part of the body has a panel of its own."""
COMPONENTS = {"stress_xx": 0, "stress_yy": 1, "stress_zz": 2, "stress_xy": 3}


def deformed(
    found: Fields,
    *,
    quantity: str = "von_mises",
    scale: float | None = None,
    zoom: bool | None = None,
    size: str = "page",
    theme: str = "light",
    title: str | None = None,
    ax: Any = None,
) -> Figure:
    """The deformed body, coloured by a stress, with its outline before and the obstacles as they are after.

    quantity: `von_mises`, `stress_xx`, `stress_yy`, `stress_zz`, `stress_xy`
    scale: factor on displacements and gaps; absent: one by which they can be seen, which the figure names
    zoom: whether only the contact and what is near it is shown; absent: a second panel shows it where it is small
    ax: one, or two for the body and the contact
    """
    if quantity == "von_mises":
        values = found.von_mises
    elif quantity in COMPONENTS:
        values = found.stress[:, COMPONENTS[quantity]]
    else:
        raise ValueError(f"quantity is one of von_mises, {', '.join(COMPONENTS)}, not {quantity!r}")
    given = None if ax is None else panels(ax)
    views = _views(found, scale, False if given is not None and len(given) == 1 and zoom is None else zoom)
    signed = quantity != "von_mises"
    # of the last view, which is the one at the contact
    high = _usual(found, values, views[-1])
    low = -high if signed else 0.0
    with style(size, theme, ax) as (plt, width, colours):
        # a long body needs the width
        below = size == "column" or views[0].height < 0.5 * views[0].width
        rows, columns = (len(views), 1) if below else (1, len(views))
        most = (1.1 if len(views) == 1 else 0.8 if size == "column" else 0.5) * width
        tall = [np.clip(0.75 * width * view.height / view.width / columns, 0.2 * width, most) for view in views]
        height = float(sum(tall) if below else max(tall)) + 0.25 * width
        ratios = {"height_ratios": tall} if below else {}
        if given is None:
            figure, grid = plt.subplots(
                rows, columns, figsize=(width, height), layout="compressed", squeeze=False, **ratios
            )
            drawn = list(grid.ravel())
        else:
            drawn = given[: len(views)]
            figure = drawn[0].figure
        for axes, view in zip(drawn, views, strict=True):
            image = _draw_body(
                axes, found, view, values, colours, cmap="PuOr" if signed else "cividis", vmin=low, vmax=high
            )
            axes.set_xlabel("$x$" + unit(found.about, "length") + f"\n{view.words}")
            axes.set_ylabel("$y$" + unit(found.about, "length"))
        handles, labels = drawn[-1].get_legend_handles_labels()
        if labels:
            unique = dict(zip(labels, handles, strict=True))
            place = "upper right" if len(found.profiles) < 2 else "lower left"
            legend = drawn[-1].legend(
                unique.values(), unique.keys(), loc=place, markerscale=2, frameon=True, framealpha=0.85
            )
            legend.get_frame().set(facecolor=colours.ground, linewidth=0)
        beyond = {(True, True): "both", (True, False): "min", (False, True): "max", (False, False): "neither"}
        extend = beyond[bool(values.min() < low), bool(values.max() > high)]
        bar = figure.colorbar(image, ax=drawn, extend=extend, shrink=0.85, pad=0.02)
        bar.set_label(QUANTITIES[quantity] + unit(found.about, "stress"))
        bar.outline.set_visible(False)
        if ax is not None:
            return _entitled(drawn[0], found.about, found.partial, title)
        _head(figure, drawn[0], found.about, colours, found.partial, title, right=drawn[columns - 1])
        _foot(figure, found.about, colours, width)
    return _finished(plt, figure)


@dataclasses.dataclass(frozen=True)
class _View:
    """A part of the deformed body: two corners of a box, and the factor on displacements."""

    low: Array
    high: Array
    scale: float
    contact: bool

    @property
    def width(self) -> float:
        return float(self.high[0] - self.low[0])

    @property
    def height(self) -> float:
        return float(self.high[1] - self.low[1])

    @property
    def words(self) -> str:
        scale = "displacements to scale" if self.scale == 1 else f"displacements × {self.scale:g}"
        return f"contact, {scale}" if self.contact else scale


def _views(found: Fields, scale: float | None, zoom: bool | None) -> list[_View]:
    """What is shown: the body, and the contact where it is small, or one of both."""
    before, moved = found.points[:, :2], found.displacement[:, :2]
    size = float(np.ptp(before, axis=0).max())

    def at(scale: float) -> Array:
        return np.asarray(before + scale * moved)

    factor = _visible(VISIBLE * size, moved) if scale is None else scale
    shown = np.concatenate([before, at(factor)])
    margin = 0.04 * size
    whole = _View(shown.min(axis=0) - margin, shown.max(axis=0) + margin, factor, False)
    touching = found.contact_state > 0
    # with the neighbours on the surface, so that one node has an extent too
    _, outline = shapes.sides([found.quads, found.triangles])
    touching[outline[np.any(touching[outline], axis=1)]] = True
    if zoom is False or not np.any(touching):
        return [whole]
    extent = float(np.ptp(before[touching], axis=0).max())
    if zoom is None and extent > SMALL * size:
        return [whole]
    if scale is None:
        # at least 1: the window follows a contact that has moved far
        factor = max(1.0, _visible(VISIBLE * 1.5 * extent, moved[touching]))
    reach = 0.5 * max(1.5 * extent, 1.1 * float(np.ptp(at(factor)[touching], axis=0).max()))
    middle = _middle(at(factor)[touching])
    contact = _View(middle - reach, middle + reach, factor, True)
    return [contact] if zoom else [whole, contact]


def _middle(points: Array) -> Array:
    return np.asarray((points.min(axis=0) + points.max(axis=0)) / 2)


def _visible(wanted: float, moved: Array) -> float:
    """1, 2 or 5 times a power of ten, by which the largest displacement is about `wanted`; 1 if it nearly is."""
    largest = float(np.linalg.norm(moved, axis=1).max(initial=0.0))
    if not largest or 0.25 <= wanted / largest < 2:
        return 1.0
    power = 10.0 ** np.floor(np.log10(wanted / largest))
    return float(max(step for step in (power, 2 * power, 5 * power) if step <= wanted / largest * (1 + 1e-9)))


def _usual(found: Fields, values: Array, view: _View) -> float:
    """The size of a stress that nearly all of a view stays below.

    A mesh has most of its nodes where stresses are largest: what is usual is judged by area.
    """
    triangles = _small_triangles(found)
    (x0, y0), (x1, y1), (x2, y2) = (found.points[triangles[:, corner], :2].T for corner in range(3))
    areas = np.abs((x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0))
    points = (found.points + view.scale * found.displacement)[:, :2]
    middles = points[triangles].mean(axis=1)
    inside = np.all((middles >= view.low) & (middles <= view.high), axis=1)
    # a window within one element has the middle of none
    areas = areas * inside if np.any(inside) else areas
    return _quantile(np.abs(values[triangles]).mean(axis=1), areas, 0.995) or 1.0


def _draw_body(axes: Any, found: Fields, view: _View, values: Array, colours: Theme, **look: Any) -> Any:
    """One view of the body; the colours are returned, for their bar."""
    from matplotlib.collections import LineCollection

    points = (found.points + view.scale * found.displacement)[:, :2]
    triangles = _small_triangles(found)
    image = axes.tripcolor(points[:, 0], points[:, 1], triangles, values, shading="gouraud", rasterized=True, **look)
    sides, outline = shapes.sides([found.quads, found.triangles])
    # thin enough that a graded mesh does not hide what is below it
    thickness = 0.35 if len(sides) < 1000 else 0.12
    lines = shapes.curved(points, sides)
    axes.add_collection(LineCollection(list(lines), colors=colours.ink, linewidths=thickness, alpha=0.5))
    before = shapes.curved(found.points[:, :2], outline)
    axes.add_collection(LineCollection(list(before), colors=colours.faint, linewidths=0.6, linestyles=(0, (4, 3))))
    depth = 0.03 * max(view.width, view.height)
    for along in found.profiles.values():
        face, outward = shapes.obstacle_after(found, along, view.scale)
        if len(face) > 1:
            band = np.concatenate([face, (face + depth * outward)[::-1]])
            axes.fill(
                *band.T, facecolor=colours.obstacle, edgecolor=colours.ink, linewidth=0.6, alpha=0.85, label="obstacle"
            )
    for state, colour, shape, word in ((1, colours.stick, "o", "stick"), (2, colours.slip, "D", "slip")):
        at = points[found.contact_state == state]
        if len(at):
            axes.plot(*at.T, shape, color=colour, markersize=2, label=word, linestyle="none")
    axes.set_aspect("equal")
    axes.set(xlim=(view.low[0], view.high[0]), ylim=(view.low[1], view.high[1] + 1.5 * depth))
    return image


def problem(
    found: Problem, *, size: str = "page", theme: str = "light", title: str | None = None, ax: Any = None
) -> Figure:
    """Mesh, supports, loads and obstacles. Raises ValueError for a mesh in a file, which is not read here."""
    with style(size, theme, ax) as (plt, width, colours):
        from matplotlib.collections import LineCollection

        lines = list(shapes.mesh_lines(found.mesh))
        every = np.concatenate(lines)
        span = np.ptp(every, axis=0)
        height = float(np.clip(0.6 * width * span[1] / span[0], 0.25 * width, 1.1 * width)) + 0.2 * width
        if ax is None:
            figure, axes = plt.subplots(figsize=(width, height), layout="compressed")
        else:
            (axes,) = panels(ax, 1)
            figure = axes.figure
        axes.add_collection(LineCollection(lines, colors=colours.faint, linewidths=0.5))
        reach = 0.03 * float(span.max())
        for support in found.supports:
            points = shapes.boundary(found.mesh, support.boundary or "")
            if len(points):
                held = [name for name in ("ux", "uy", "un", "ut") if getattr(support, name) is not None]
                _hatched(axes, points, reach, colours.normal, _held(held))
        for load in found.loads:
            points = shapes.boundary(found.mesh, load.boundary or "")
            if len(points):
                axes.plot(*points.T, color=colours.slip, linewidth=2.5, label=f"load on {load.boundary}")
        for contact in found.contacts:
            face = shapes.boundary(found.mesh, contact.boundary)
            if len(face):
                axes.plot(*face.T, color=colours.tangential, linewidth=1.4, label=f"may touch: {contact.boundary}")
            obstacle = shapes.obstacle(found.mesh, contact)
            if len(obstacle) > 1:
                above = obstacle + 2.5 * reach * shapes.normals(obstacle)
                axes.fill(
                    *np.concatenate([obstacle, above[::-1]]).T,
                    facecolor=colours.obstacle,
                    edgecolor=colours.ink,
                    linewidth=0.6,
                    alpha=0.85,
                    label=f"obstacle, pushed by {contact.indentation:g}".replace("-", "−"),
                )
        axes.autoscale_view()
        axes.margins(0.05)
        axes.set_aspect("equal")
        axes.set_xlabel("$x$")
        axes.set_ylabel("$y$")
        handles, labels = axes.get_legend_handles_labels()
        unique = dict(zip(labels, handles, strict=True))
        outside = {} if ax is not None else {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)}
        axes.legend(unique.values(), unique.keys(), ncols=1, **outside)
        friction = {contact.boundary: parameters(contact.to_dict(defaults=True)) for contact in found.contacts}
        about = {"title": found.title or "", "parameters": friction}
        if ax is not None:
            return _entitled(axes, about, False, title)
        _head(figure, axes, about, colours, False, title)
    return _finished(plt, figure)


MOST_CURVES = 12
"""More in one figure cannot be told apart."""


def sweep(
    table: SweepTable,
    quantity: str,
    *,
    x: str | None = None,
    size: str = "page",
    theme: str = "light",
    title: str | None = None,
    ax: Any = None,
) -> Figure:
    """A column of a study over one parameter, with a curve for each value of the others.

    quantity: a column of numbers, such as `stick_width`
    x: the parameter along the axis; absent: the one with the most values. Words and obstacles stand beside each other
        in the order of the definition.
    ax: axes of the caller, one

    A member with a warning that not all of them have has a hollow marker; one without a solution interrupts its
    curve. Below is counted how many members have which warnings. Raises ValueError where more than twelve curves
    would be needed, or a column has no numbers.
    """
    if not table.parameters:
        raise ValueError("the sweep has no parameters")
    # one that did not converge has the numbers of its last state
    values = np.where(table["status"] == "succeeded", _numbers(table, quantity), np.nan)
    if x is None:
        numeric = [name for name in table.parameters if table[name].dtype.kind in "fiu"]
        x = max(numeric or table.parameters, key=lambda name: np.unique(table[name]).size)
    names = _categories(table[x]) if x in table.parameters else None
    if names is None:
        along = _numbers(table, x)
    else:
        along = np.array([names.index(value) for value in table[x].tolist()], float)
    curves = _curves(table, x)
    warned = _warned(table, values)
    with style(size, theme, ax) as (plt, width, colours):
        if ax is None:
            figure, axes = plt.subplots(figsize=(width, 0.7 * width), layout="constrained")
        else:
            (axes,) = panels(ax, 1)
            figure = axes.figure
        # along a scale of brightness, which any eye can order; neither end is lost on the ground
        scale = plt.get_cmap("cividis")(np.linspace(*((0.0, 0.85) if theme == "light" else (0.3, 1.0)), len(curves)))
        colour = [colours.normal] if len(curves) == 1 else scale
        for number, (label, rows) in enumerate(curves.items()):
            order = np.array(rows)[np.argsort(along[rows], kind="stable")]
            dashes = ("-", "--", "-.", ":")[number % 4]
            axes.plot(along[order], values[order], color=colour[number], linestyle=dashes, label=label or None)
            for some, face in ((order[~warned[order]], colour[number]), (order[warned[order]], colours.ground)):
                axes.plot(along[some], values[some], "o", color=colour[number], markerfacecolor=face, markersize=4)
        if np.any(warned):
            axes.plot([], [], "o", color=colours.ink, mfc=colours.ground, markersize=4, label="with warnings")
        if names is not None:
            axes.set_xticks(range(len(names)), [textwrap.fill(_short(name), 16) for name in names])
            axes.margins(x=0.1)
        elif table[x].dtype.kind in "iu":
            axes.xaxis.get_major_locator().set_params(integer=True)
        elif len(along) and np.all(along > 0) and _is_geometric(np.unique(along)):
            axes.set_xscale("log")
            # few numbers, in plain form: powers of ten would cover each other within a decade
            axes.xaxis.set_major_locator(plt.matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter("")
        axes.set_xlabel(PARAMETERS.get(x, x.replace("_", " ")))
        axes.set_ylabel(QUANTITIES.get(quantity, quantity.replace("_", " ")))
        axes.grid(axis="y")
        handles, labels = axes.get_legend_handles_labels()
        if ax is not None:
            if labels:
                axes.legend(loc="best")
            axes.set_title(table.title if title is None else title, loc="left")
            return _drawn_on(axes)
        if labels and size == "column":
            columns = max(1, min(3, 48 // (6 + max(map(len, labels)))))
            # above twelve long labels there would be no room for the curves
            figure.set_figheight(figure.get_figheight() + 0.14 * max(0, -(-len(labels) // columns) - 3))
            axes.legend(handles, labels, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns)
        elif labels:
            # as the curves mostly are, the last on top
            axes.legend(handles[::-1], labels[::-1], loc="upper left", bbox_to_anchor=(1.0, 1.0))
        figure.suptitle(table.title if title is None else title, x=0.01, ha="left", fontweight="bold", fontsize="large")
        notes = "\n".join(textwrap.fill(note.replace("_", " "), 95) for note in table.notes())
        if notes:
            figure.supxlabel(notes, x=0.01, ha="left", fontsize="x-small", color=colours.faint)
    return _finished(plt, figure)


def _curves(table: SweepTable, x: str) -> dict[str, list[int]]:
    """The rows of each curve, by its label: members that differ in x alone, and in what x determines."""
    columns = {name: [_short(value) for value in table[name].tolist()] for name in table.parameters}
    along = [repr(value) for value in table[x].tolist()]  # NaN is not equal to itself
    pairs = {name: set(zip(along, column, strict=True)) for name, column in columns.items()}
    others = [name for name in columns if len(set(columns[name])) > 1 and len(pairs[name]) > len(set(along))]
    curves: dict[str, list[int]] = {}
    for row in range(len(table)):
        label = ", ".join(f"{PARAMETERS.get(name, name)} = {columns[name][row]}" for name in others)
        curves.setdefault(label, []).append(row)
    if len(curves) > MOST_CURVES:
        raise ValueError(
            f"{len(curves)} curves are too many for one figure (x={x!r}, one for each {', '.join(others)})"
        )
    return curves


def _warned(table: SweepTable, values: Array) -> Array:
    """Which members with a value have a warning that not all of these have."""
    codes = [set(text.split()) for text in table["warnings"].tolist()]
    there = np.isfinite(values)
    solved = [codes[row] for row in np.flatnonzero(there)]
    of_all = set.intersection(*solved) if solved else set()
    return np.asarray(there & np.array([bool(of_member - of_all) for of_member in codes], dtype=bool))


def _categories(column: Array) -> list[Any] | None:
    """The values of a column that has words, in the order in which they come; None for numbers."""
    return None if column.dtype.kind in "fiu" else list(dict.fromkeys(column.tolist()))


def _numbers(table: SweepTable, name: str) -> Array:
    column = table[name]
    if column.dtype.kind not in "fiu":
        raise ValueError(f"the column {name!r} has no numbers")
    return column.astype(float)


def _is_geometric(values: Array) -> bool:
    """Whether values grow by about the same factor, and in all by a lot."""
    if len(values) < 3 or values[-1] < 4 * values[0]:
        return False
    factors = values[1:] / values[:-1]
    return bool(factors.max() < 1.6 * factors.min())


def _short(value: Any) -> str:
    """A value as a label has it; a member of a list that leaves it out has that of the problem itself."""
    if isinstance(value, str) and value.startswith("{"):  # an object of the problem, such as an obstacle
        document = json.loads(value)
        parts = [str(document.pop("kind"))] if "kind" in document else []
        return " ".join(parts + [f"{name} {_short(inner)}" for name, inner in document.items()])
    if value == "" or (isinstance(value, float) and np.isnan(value)):
        return "as in the problem"
    return f"{value:.6g}".replace("-", "−") if isinstance(value, float) else str(value)


def _finished(plt: Any, figure: Any) -> Figure:
    """Takes a figure from pyplot's list, so that a notebook shows it once and many figures take no memory."""
    plt.close(figure)
    finished: Figure = figure
    return finished


def _held(names: list[str]) -> str:
    symbols = {"ux": "$u_x$", "uy": "$u_y$", "un": "$u_n$", "ut": "$u_t$"}
    return "prescribed " + ", ".join(symbols[name] for name in names)


def _hatched(axes: Any, points: Array, reach: float, colour: str, label: str) -> None:
    """A support: a band outside of the boundary, hatched."""
    outside = points + reach * shapes.normals(points)
    axes.fill(
        *np.concatenate([points, outside[::-1]]).T,
        facecolor="none",
        edgecolor=colour,
        hatch="//////" if "," in label else "......",
        linewidth=0.8,
        label=label,
    )


def _shade(axes: Any, found: Profile, colours: Theme, words: bool) -> None:
    """Stick and slip behind the curves; words on top, so that colour is not all that tells them apart."""
    extents = (found.about.get("extents") or {}).get(found.boundary) or {}
    length = float(found.s[-1] - found.s[0]) or 1.0
    for part, colour, hatch in (("stick", colours.stick, None), ("slip", colours.slip, "////")):
        for start, end in extents.get(part, []):
            axes.axvspan(start, end, facecolor=colour, alpha=0.16, linewidth=0)
            if hatch:
                axes.axvspan(start, end, facecolor="none", edgecolor=colour, alpha=0.25, hatch=hatch, linewidth=0)
            if words and (end - start) > 0.08 * length:
                axes.text(
                    (start + end) / 2, 0.5, part, color=colours.ink, alpha=0.8, ha="center", va="center",
                    transform=axes.get_xaxis_transform(), fontsize="small",
                    bbox={"facecolor": colours.ground, "alpha": 0.6, "linewidth": 0, "pad": 1.5},
                )  # fmt: skip


def _limits(s: Array, values: Array, cut: float = CUT) -> tuple[float, float]:
    """Limits of an axis; a peak far beyond all else is cut, since nothing else could be seen beside it.

    What is usual is judged by length, not by points: a mesh has most of its points where the peak is.
    """
    lengths = np.gradient(s) if len(s) > 1 else np.ones(1)
    largest = float(np.abs(values).max()) or 1.0
    acting = np.abs(values) > 1e-9 * largest
    most = min(largest, cut * _quantile(np.abs(values[acting]), lengths[acting], 0.5)) if np.any(acting) else 1.0
    # a single point may overshoot beside a peak: where nothing of length is beyond zero, the axis ends there
    low, high = _quantile(values, lengths, 0.001), _quantile(values, lengths, 0.999)
    below = min(most, -float(values.min())) if low < 0 else 0.0
    above = min(most, float(values.max())) if high > 0 else 0.0
    if not (below or above):
        return -1.0, 1.0
    return -1.08 * below - 0.02 * above, 1.08 * above + 0.02 * below


def _quantile(values: Array, lengths: Array, share: float) -> float:
    order = np.argsort(values)
    total = np.cumsum(lengths[order])
    return float(values[order][min(np.searchsorted(total, share * total[-1]), len(values) - 1)])


def _is_late(s: Array, values: Array) -> bool:
    """Whether the lowest of the values is in the second half."""
    return bool(s[int(np.argmin(values))] > (s[0] + s[-1]) / 2)


def _mark_cut(
    axes: Any, s: Array, values: Array, colours: Theme, about: Mapping[str, Any], boundary: str, short: bool = False
) -> None:
    """Two small strokes wherever the curve leaves the figure, and how far it goes."""
    low, _ = axes.get_ylim()
    beyond = np.flatnonzero(values < low)
    if len(beyond) == 0:
        return
    for run in np.split(beyond, np.flatnonzero(np.diff(beyond) > 1) + 1):
        axes.annotate(
            "≈", (s[run[np.argmin(values[run])]], 0), xycoords=("data", "axes fraction"), ha="center", va="center",
            color=colours.normal, fontsize="large", annotation_clip=False,
            bbox={"boxstyle": "square,pad=0", "facecolor": colours.ground, "edgecolor": "none"},
        )  # fmt: skip
    at = int(np.argmin(values))
    peak = ((about.get("peaks") or {}).get(boundary) or {}).get("normal_stress")
    no_limit = peak is not None and peak.value.why == "no_limit"
    text = f"peak {values[at]:.3g}".replace("-", "−") + (
        ", which grows on finer meshes" if no_limit and not short else ""
    )
    to_left = _is_late(s, values)
    axes.annotate(
        text, (s[at], 0), xycoords=("data", "axes fraction"), xytext=(-10 if to_left else 10, 12),
        textcoords="offset points", ha="right" if to_left else "left", va="bottom", fontsize="small",
    )  # fmt: skip


def _position_axis(axes: Any, found: Profile) -> None:
    """x above s, where the two differ and the boundary does not turn back."""
    if np.all(np.diff(found.x) > 0) and not np.allclose(found.x - found.x[0], found.s, rtol=1e-6):
        above = axes.secondary_xaxis(
            "top", functions=(lambda s: np.interp(s, found.s, found.x), lambda x: np.interp(x, found.x, found.s))
        )
        above.set_xlabel("position $x$" + unit(found.about, "length"))
        above.spines["top"].set_visible(True)


def _head(
    figure: Any,
    axes: Any,
    about: Mapping[str, Any],
    colours: Theme,
    partial: bool,
    title: str | None,
    boundary: str | None = None,
    right: Any = None,
) -> None:
    """Title, parameters below it; the verdict on the right, over the panel `right` where several are side by side."""
    words = title if title is not None else about.get("title") or ""
    below = subtitle(about, boundary)
    verdict = about.get("verdict") or ""
    if partial:
        mark, colour = f"PARTIAL: {str(about.get('outcome') or '').replace('_', ' ')}", colours.poor
    elif verdict:
        mark, colour = f"● verdict: {verdict}", getattr(colours, verdict, colours.ink)
    else:
        mark, colour = "", colours.ink
    figure.suptitle(words, x=0.01, ha="left", fontweight="bold", fontsize="large")
    line = axes.set_title(below, loc="left", fontsize="medium", color=colours.ink)
    line.set_wrap(False)
    if mark:
        # on a line of its own where both would not fit beside each other
        lines = below.count("\n") + 1
        if partial or figure.get_figwidth() < 4 or lines > 1:
            mark += "\n" * lines
        weight = "bold" if partial else None
        (right or axes).set_title(mark, loc="right", fontsize="medium", color=colour, fontweight=weight)


def _entitled(
    axes: Any, about: Mapping[str, Any], partial: bool, title: str | None, boundary: str | None = None
) -> Figure:
    """Gives axes of the caller a title, and returns their figure."""
    verdict = about.get("verdict")
    state = "PARTIAL" if partial else f"verdict: {verdict}" if verdict else ""
    words = "\n".join(filter(None, [about.get("title") or "", subtitle(about, boundary), state]))
    axes.set_title(words if title is None else title, loc="left", fontsize="medium")
    return _drawn_on(axes)


def _drawn_on(axes: Any) -> Figure:
    figure: Figure = axes.figure
    return figure


def _foot(figure: Any, about: Mapping[str, Any], colours: Theme, width: float) -> None:
    """The warnings, in words."""
    codes = [code.replace("_", " ") for code in dict.fromkeys(about.get("warnings") or [])]
    if codes:
        text = "\n".join(textwrap.wrap("Warnings: " + "; ".join(codes), 95 if width < 9 else 110))
        figure.supxlabel(text, x=0.01, ha="left", fontsize="x-small", color=colours.faint)


def _small_triangles(found: Fields) -> Array:
    """Corners and midsides of each element as linear triangles."""
    of_quad = [(0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 7), (5, 6, 7)]
    of_triangle = [(0, 3, 5), (3, 1, 4), (4, 2, 5), (3, 4, 5)]
    blocks = [found.quads[:, part] for part in of_quad if len(found.quads)]
    blocks += [found.triangles[:, part] for part in of_triangle if len(found.triangles)]
    return np.concatenate(blocks).astype(int)
