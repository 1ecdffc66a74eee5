"""Figures for papers and lectures, by matplotlib (`pip install signorini[plot]`).

    profile       stresses along a contact, stick and slip shaded
    profiles      the same of several jobs in one figure; the legend has what their problems differ in
    convergence   residuals and changes of contact by iteration
    deformed      the deformed body with a stress
    sweep         a column of a study over its parameters
    problem       mesh, supports and obstacles of a problem, before it is solved

All return a `matplotlib.figure.Figure`: `figure.savefig("punch.pdf")`, whose letters stay letters. Each takes `size`,
one of `column` (88 mm), `page` (default) and `slide` (16:9), and `theme`, `light` (default) or `dark`. Under the title
stand the parameters μ, ρ, ε, beside it the verdict; below the figure the warnings. `style="bare"` has none of these:
your caption then says what is shown, and how far it can be trusted. `xlim`, `ylim` and, for the lower of two panels,
`ylim_below` are limits of axes, two numbers each.

`ax` draws on axes of your own, `figure, ax = plt.subplots()`: on one, or on as many as the figure has panels. Their
title then has the parameters and the verdict; letters and sizes are those of your figure.
"""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _shapes as shapes
from ._around import (
    MOST_CURVES,
    drawn_on,
    entitled,
    finished,
    foot,
    head,
    legend_below,
    looks_of,
    quantile,
    rightmost,
    short,
    two_panels,
    with_unit,
)
from ._profiles import profile, profiles
from ._style import (
    CURVES,
    PARAMETERS,
    QUANTITIES,
    SLIDE,
    Limits,
    Theme,
    coordinates,
    limits,
    new,
    panels,
    parameters,
    quantity_name,
    styled,
    unit,
    unit_of,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ._data import Array, Fields, History
    from ._sweep import SweepTable
    from .problem import Problem

__all__ = ["convergence", "deformed", "problem", "profile", "profiles", "sweep"]


def convergence(
    found: History,
    *,
    size: str = "page",
    theme: str = "light",
    style: str = "full",
    title: str | None = None,
    xlim: Any = None,
    ylim: Any = None,
    ylim_below: Any = None,
    ax: Any = None,
) -> Figure:
    """Residuals by iteration, the tolerance, and how many nodes entered and left contact.

    ylim, ylim_below: limits of the residuals, and of the numbers of nodes
    ax: one for the residuals alone, or two
    """
    across, up, below = limits(xlim=xlim, ylim=ylim, ylim_below=ylim_below)
    if up is not None and up[0] <= 0:
        raise ValueError("ylim: the axis of residuals is logarithmic: limits are positive")
    with styled(size, theme, ax, style) as (plt, width, colours):
        figure, upper, lower = two_panels(plt, size, width, ax, 1.15, 0.7, height_ratios=[3, 1])
        pair = (upper, lower)
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
            start, entered, left = _at_most(BARS, k, found.contact_entered, found.contact_left)
            wide = (k[-1] - k[0] + 1) / len(start) if len(start) < len(k) else 0.8
            lower.bar(start, entered, wide, color=colours.stick, label="entered")
            lower.bar(start, -left.astype(float), wide, color=colours.slip, hatch="///", label="left")
            lower.axhline(0, color=colours.ink, linewidth=0.5)
            lower.set_ylabel("nodes of\ncontact")
        lower.set_xlabel("iteration $k$")
        if rightmost(upper, lower) is lower:
            upper.set_xlabel("iteration $k$")
        for axes, given in ((upper, up), (lower, below if lower is not upper else None)):
            if given is not None:
                axes.set_ylim(*given)
            if across is not None:
                axes.set_xlim(*across)
        if ax is None:
            legend_below(plt, figure, upper, lower, columns=2 if size == "column" else 3)
        else:
            for axes in pair:
                axes.legend(loc="best")
        lower.xaxis.get_major_locator().set_params(integer=True)
        for change in np.flatnonzero(np.diff(found.step.astype(int))):
            for axes in pair:
                axes.axvline((k[change] + k[change + 1]) / 2, color=colours.faint, linewidth=0.6)
        if ax is not None:
            return entitled(upper, found.about, found.partial, title, style)
        if style == "full":
            head(figure, upper, found.about, colours, found.partial, title, right=rightmost(upper, lower))
            foot(figure, found.about, colours, width)
    return finished(plt, figure)


BARS = 1000
"""More bars cannot be told apart, and each is a shape in a file."""


def _at_most(most: int, k: Array, *columns: Array) -> list[Array]:
    """Columns over k in at most so many groups of neighbours: where a group begins, and of each column its largest
    value, so that no peak is lost."""
    if len(k) <= most:
        return [k, *columns]
    starts = np.linspace(0, len(k), most, endpoint=False).astype(int)
    return [k[starts], *(np.maximum.reduceat(column, starts) for column in columns)]


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
    style: str = "full",
    title: str | None = None,
    xlim: Any = None,
    ylim: Any = None,
    ax: Any = None,
) -> Figure:
    """The deformed body, coloured by a stress, with its outline before and the obstacles as they are after.

    quantity: `von_mises`, `stress_xx`, `stress_yy`, `stress_zz`, `stress_xy`
    scale: factor on displacements and gaps; absent: one by which they can be seen, which the figure names
    zoom: whether only the contact and what is near it is shown; absent: a second panel shows it where it is small
    xlim, ylim: the part that is shown, in one panel; zoom then has no effect
    ax: one, or two for the body and the contact
    """
    if quantity == "von_mises":
        values = found.von_mises
    elif quantity in COMPONENTS:
        values = found.stress[:, COMPONENTS[quantity]]
    else:
        raise ValueError(f"quantity is one of von_mises, {', '.join(COMPONENTS)}, not {quantity!r}")
    across, up = limits(xlim=xlim, ylim=ylim)
    given = None if ax is None else panels(ax)
    if across or up:
        views = [_part(found, scale, across, up)]
    else:
        views = _views(found, scale, False if given is not None and len(given) == 1 and zoom is None else zoom)
    signed = quantity != "von_mises"
    # of the last view, which is the one at the contact
    high = _usual(found, values, views[-1])
    low = -high if signed else 0.0
    with styled(size, theme, ax, style) as (plt, width, colours):
        # a long body needs the width
        below = size != "slide" and (size == "column" or views[0].height < 0.5 * views[0].width)
        rows, columns = (len(views), 1) if below else (1, len(views))
        most = (1.1 if len(views) == 1 else 0.8 if size == "column" else 0.5) * width
        tall = [np.clip(0.75 * width * view.height / view.width / columns, 0.2 * width, most) for view in views]
        height = SLIDE * width if size == "slide" else float(sum(tall) if below else max(tall)) + 0.25 * width
        ratios = {"height_ratios": tall} if below else {}
        if given is None:
            figure, grid = new(plt, rows, columns, (width, height), layout="compressed", **ratios)
            drawn = list(grid.ravel())
        else:
            drawn = given[: len(views)]
            figure = drawn[0].figure
        for axes, view in zip(drawn, views, strict=True):
            image = _draw_body(
                axes, found, view, values, colours, cmap="PuOr" if signed else "cividis", vmin=low, vmax=high
            )
            x, y = coordinates(found.about)
            axes.set_xlabel(f"${x}$" + unit(found.about, "length") + f"\n{view.words}")
            axes.set_ylabel(f"${y}$" + unit(found.about, "length"))
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
        bar.set_label(quantity_name(found.about, quantity) + unit(found.about, "stress"))
        bar.outline.set_visible(False)
        if ax is not None:
            return entitled(drawn[0], found.about, found.partial, title, style)
        if style == "full":
            head(figure, drawn[0], found.about, colours, found.partial, title, right=drawn[columns - 1])
            foot(figure, found.about, colours, width)
    return finished(plt, figure)


@dataclasses.dataclass(frozen=True)
class _View:
    """A part of the deformed body: two corners of a box, and the factor on displacements."""

    low: Array
    high: Array
    scale: float
    contact: bool
    is_given: bool = False
    """Whether its limits are those of the caller."""

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


def _part(found: Fields, scale: float | None, across: Limits | None, up: Limits | None) -> _View:
    """The part of the body between limits."""
    (whole,) = _views(found, scale, False)
    (left, right), (bottom, top) = across or (whole.low[0], whole.high[0]), up or (whole.low[1], whole.high[1])
    low, high = np.array([left, bottom]), np.array([right, top])
    before = found.points[:, :2]
    inside = np.all((before >= low) & (before <= high), axis=1)
    if scale is None:
        # at least 1: what is looked for would else be elsewhere
        scale = max(1.0, _visible(VISIBLE * float((high - low).max()), found.displacement[inside, :2]))
    return _View(low, high, scale, False, True)


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
    return quantile(np.abs(values[triangles]).mean(axis=1), areas, 0.995) or 1.0


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
    room = 0.0 if view.is_given else 1.5 * depth
    axes.set(xlim=(view.low[0], view.high[0]), ylim=(view.low[1], view.high[1] + room))
    return image


def problem(
    found: Problem,
    *,
    size: str = "page",
    theme: str = "light",
    style: str = "full",
    title: str | None = None,
    xlim: Any = None,
    ylim: Any = None,
    ax: Any = None,
) -> Figure:
    """Mesh, supports, loads and obstacles. Raises ValueError for a mesh in a file, which is not read here."""
    across, up = limits(xlim=xlim, ylim=ylim)
    document = found.to_dict(defaults=True)
    about = {
        "title": found.title or "",
        "parameters": {contact["boundary"]: parameters(contact) for contact in document.get("contacts") or []},
        "units": document.get("units") or {},
        "analysis": (document.get("analysis") or {}).get("kind"),
    }
    with styled(size, theme, ax, style) as (plt, width, colours):
        from matplotlib.collections import LineCollection

        lines = list(shapes.mesh_lines(found.mesh))
        every = np.concatenate(lines)
        span = np.ptp(every, axis=0)
        height = float(np.clip(0.6 * width * span[1] / span[0], 0.25 * width, 1.1 * width)) + 0.2 * width
        if ax is None:
            height = SLIDE * width if size == "slide" else height
            figure, ((axes,),) = new(plt, 1, 1, (width, height), layout="compressed")
        else:
            (axes,) = panels(ax, 1)
            figure = axes.figure
        axes.add_collection(LineCollection(lines, colors=colours.faint, linewidths=0.5))
        reach = 0.03 * float(span.max())
        for support in found.supports:
            points = shapes.boundary(found.mesh, support.boundary or "")
            if len(points):
                held = [name for name in ("ux", "uy", "un", "ut") if getattr(support, name) is not None]
                _hatched(axes, points, reach, colours.normal, _held(held, about))
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
        if across is not None:
            axes.set_xlim(*across)
        if up is not None:
            axes.set_ylim(*up)
        x, y = coordinates(about)
        axes.set_xlabel(f"${x}$" + unit(about, "length"))
        axes.set_ylabel(f"${y}$" + unit(about, "length"))
        handles, labels = axes.get_legend_handles_labels()
        unique = dict(zip(labels, handles, strict=True))
        outside = {} if ax is not None else {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)}
        axes.legend(unique.values(), unique.keys(), ncols=1, **outside)
        if ax is not None:
            return entitled(axes, about, False, title, style)
        if style == "full":
            head(figure, axes, about, colours, False, title)
    return finished(plt, figure)


def sweep(
    table: SweepTable,
    quantity: str,
    *,
    x: str | None = None,
    size: str = "page",
    theme: str = "light",
    style: str = "full",
    title: str | None = None,
    xlim: Any = None,
    ylim: Any = None,
    ax: Any = None,
) -> Figure:
    """A column of a study over one parameter, with a curve for each value of the others.

    quantity: a column of numbers, such as `stick_width`
    x: the parameter along the axis; absent: the one with the most values. Words and obstacles stand beside each other
        in the order of the definition.
    ax: axes of the caller, one

    The axis is logarithmic where the values of the parameter grow by a factor, such as those of `logspace`, else
    linear; units are those that the problem names. A member with a warning that not all of them have has a hollow
    marker; one without a solution interrupts its curve. Bars are the errors of `contact_width`; other columns have
    none. Below is counted how many members have which warnings. Raises ValueError where more than twelve curves would
    be needed, or a column has no numbers.
    """
    across, up = limits(xlim=xlim, ylim=ylim)
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
    errors = table.columns.get(f"{quantity}_error")
    with styled(size, theme, ax, style) as (plt, width, colours):
        if ax is None:
            height = (SLIDE if size == "slide" else 0.7) * width
            figure, ((axes,),) = new(plt, 1, 1, (width, height), layout="constrained")
        else:
            (axes,) = panels(ax, 1)
            figure = axes.figure
        looks = looks_of(plt, colours, len(curves))
        for (label, rows), look, (dashes, marker) in zip(curves.items(), looks, CURVES, strict=False):
            order = np.array(rows)[np.argsort(along[rows], kind="stable")]
            colour = look["color"]
            axes.plot(along[order], values[order], color=colour, linestyle=dashes)
            if errors is not None:
                axes.errorbar(
                    along[order], values[order], errors[order], fmt="none", ecolor=colour, elinewidth=0.8, capsize=2
                )
            for some, face in ((order[~warned[order]], colour), (order[warned[order]], colours.ground)):
                axes.plot(
                    along[some],
                    values[some],
                    marker,
                    color=colour,
                    markerfacecolor=face,
                    markersize=4,
                    linestyle="none",
                    # hollow ones stay visible where curves lie on one another
                    zorder=3 if face is colours.ground else 2,
                )
            # the sample in the legend has line and marker
            axes.plot([], [], marker=marker, color=colour, linestyle=dashes, markersize=4, label=label or None)
        if np.any(warned):
            axes.plot([], [], "o", color=colours.ink, mfc=colours.ground, markersize=4, label="with warnings")
        if names is not None:
            axes.set_xticks(range(len(names)), [textwrap.fill(short(name), 16) for name in names])
            axes.margins(x=0.1)
        elif table[x].dtype.kind in "iu":
            axes.xaxis.get_major_locator().set_params(integer=True)
        elif len(along) and np.all(along > 0) and _is_geometric(np.unique(along)):
            axes.set_xscale("log")
            # few numbers, in plain form: powers of ten would cover each other within a decade
            axes.xaxis.set_major_locator(plt.matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter("")
        axes.set_xlabel(with_unit(PARAMETERS.get(x, x.replace("_", " ")), unit_of(table.about, x)))
        axes.set_ylabel(with_unit(quantity_name(table.about, quantity), unit_of(table.about, quantity)))
        axes.grid(axis="y")
        if across is not None:
            axes.set_xlim(*across)
        if up is not None:
            axes.set_ylim(*up)
        handles, labels = axes.get_legend_handles_labels()
        if ax is not None:
            if labels:
                axes.legend(loc="best")
            if style == "full":
                axes.set_title(table.title if title is None else title, loc="left")
            return drawn_on(axes)
        if labels and size == "column":
            columns = max(1, min(3, 48 // (6 + max(map(len, labels)))))
            # above twelve long labels there would be no room for the curves
            figure.set_figheight(figure.get_figheight() + 0.14 * max(0, -(-len(labels) // columns) - 3))
            axes.legend(handles, labels, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns)
        elif labels:
            # as the curves mostly are, the last on top
            axes.legend(handles[::-1], labels[::-1], loc="upper left", bbox_to_anchor=(1.0, 1.0))
        if style == "full":
            words = table.title if title is None else title
            figure.suptitle(words, x=0.01, ha="left", fontweight="bold", fontsize="large")
        notes = "\n".join(textwrap.fill(note.replace("_", " "), 95) for note in table.notes())
        if notes and style == "full":
            figure.supxlabel(notes, x=0.01, ha="left", fontsize="x-small", color=colours.faint)
    return finished(plt, figure)


def _curves(table: SweepTable, x: str) -> dict[str, list[int]]:
    """The rows of each curve, by its label: members that differ in x alone, and in what x determines."""
    columns = {name: [short(value) for value in table[name].tolist()] for name in table.parameters}
    along = [repr(value) for value in table[x].tolist()]  # NaN is not equal to itself
    pairs = {name: set(zip(along, column, strict=True)) for name, column in columns.items()}
    others = [name for name in columns if len(set(columns[name])) > 1 and len(pairs[name]) > len(set(along))]
    curves: dict[str, list[int]] = {}
    for row in range(len(table)):
        label = ", ".join(_labelled(table, name, columns[name][row]) for name in others)
        curves.setdefault(label, []).append(row)
    if len(curves) > MOST_CURVES:
        raise ValueError(
            f"{len(curves)} curves are too many for one figure (x={x!r}, one for each {', '.join(others)})"
        )
    return curves


def _labelled(table: SweepTable, name: str, value: str) -> str:
    """The value of a parameter in a label, with its unit if it is a number."""
    unit = unit_of(table.about, name) if table[name].dtype.kind in "fiu" and value[-1:].isdigit() else ""
    return f"{PARAMETERS.get(name, name)} = {value}{f' {unit}' if unit else ''}"


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
    """Whether values grow by about the same factor rather than by about the same amount, and in all by a lot."""
    if len(values) < 3 or values[-1] < 4 * values[0]:
        return False
    factors, amounts = values[1:] / values[:-1], np.diff(values)
    uneven = factors.max() / factors.min()
    return bool(uneven < 1.6 and uneven < amounts.max() / amounts.min())


def _held(names: list[str], about: Mapping[str, Any]) -> str:
    x, y = coordinates(about)
    symbols = {"ux": f"$u_{x}$", "uy": f"$u_{y}$", "un": "$u_n$", "ut": "$u_t$"}
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


def _small_triangles(found: Fields) -> Array:
    """Corners and midsides of each element as linear triangles."""
    of_quad = [(0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 7), (5, 6, 7)]
    of_triangle = [(0, 3, 5), (3, 1, 4), (4, 2, 5), (3, 4, 5)]
    blocks = [found.quads[:, part] for part in of_quad if len(found.quads)]
    blocks += [found.triangles[:, part] for part in of_triangle if len(found.triangles)]
    return np.concatenate(blocks).astype(int)
