"""What all figures have: the texts around them, panels, legends, the looks of curves."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ._style import CURVES, SLIDE, Theme, new, panels, subtitle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ._data import Array


MOST_CURVES = 12
"""More in one figure cannot be told apart."""


def looks_of(plt: Any, colours: Theme, count: int) -> list[dict[str, Any]]:
    """Colours and dashes of several curves: colours along a scale of brightness, which any eye can order; neither end
    is lost on the ground."""
    ends = (0.0, 0.85) if colours.ground == "#ffffff" else (0.3, 1.0)
    scale = plt.get_cmap("cividis")(np.linspace(*ends, count))
    colour = [colours.normal] if count == 1 else list(scale)
    looks = []
    for number in range(count):
        dashes, marker = CURVES[number]
        # markers only where dashes begin again
        repeated = {"marker": marker, "markevery": 0.12, "markersize": 4} if number >= 6 else {}
        looks.append({"color": colour[number], "linestyle": dashes, **repeated})
    return looks


def two_panels(
    plt: Any, size: str, width: float, ax: Any, narrow: float, wide: float, **options: Any
) -> tuple[Any, Any, Any]:
    """A figure with two panels with a common axis: below each other, on a slide side by side; or on axes of the caller.

    narrow, wide: the height as a part of the width, in a column and on a page
    """
    if ax is not None:
        given = panels(ax)
        return given[0].figure, given[0], given[-1]
    if size == "slide":
        figure, axes = new(plt, 1, 2, (width, SLIDE * width), sharex=True, layout="constrained")
    else:
        # in a narrow column the words on the axes need more height
        height = width * (narrow if size == "column" else wide)
        figure, axes = new(plt, 2, 1, (width, height), sharex=True, layout="constrained", **options)
    return figure, axes.flat[0], axes.flat[1]


def rightmost(upper: Any, lower: Any) -> Any:
    """The panel over whose right end there is room for the verdict: the second one if it is beside the first."""
    first, second = (axes.get_subplotspec() for axes in (upper, lower))
    beside = first is not None and second is not None and second.colspan.start > first.colspan.start
    return lower if beside else upper


def legend_below(
    plt: Any, figure: Any, upper: Any, lower: Any, columns: int, every: tuple[Any, ...] | None = None
) -> None:
    """Outside, since a long history fills its panels. Of the curves of both panels, unless it is told of which.

    Where panels are side by side it begins below the left one.
    """
    from matplotlib.transforms import offset_copy

    handles = [handle for axes in every or (upper, lower) for handle in axes.get_legend_handles_labels()[0]]
    if rightmost(upper, lower) is lower:
        lower = upper
    # below the name of the axis, by the height of letters
    below = offset_copy(lower.transAxes, figure, 0, -3.6 * plt.rcParams["font.size"], units="points")
    lower.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(0, 0), bbox_transform=below, borderaxespad=0, ncols=columns
    )


def head(
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
        mark, colour = f"● {about.get('of', 'verdict')}: {verdict}", getattr(colours, verdict, colours.ink)
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


def foot(figure: Any, about: Mapping[str, Any], colours: Theme, width: float) -> None:
    """The warnings, in words."""
    codes = [code.replace("_", " ") for code in dict.fromkeys(about.get("warnings") or [])]
    if codes:
        text = "\n".join(textwrap.wrap("Warnings: " + "; ".join(codes), 95 if width < 9 else 110))
        figure.supxlabel(text, x=0.01, ha="left", fontsize="x-small", color=colours.faint)


def entitled(
    axes: Any, about: Mapping[str, Any], partial: bool, title: str | None, style: str, boundary: str | None = None
) -> Figure:
    """Gives axes of the caller a title unless they are bare, and returns their figure."""
    if style == "bare":
        return drawn_on(axes)
    verdict = about.get("verdict")
    state = "PARTIAL" if partial else f"verdict: {verdict}" if verdict else ""
    words = "\n".join(filter(None, [about.get("title") or "", subtitle(about, boundary), state]))
    axes.set_title(words if title is None else title, loc="left", fontsize="medium")
    return drawn_on(axes)


def drawn_on(axes: Any) -> Figure:
    figure: Figure = axes.figure
    return figure


def finished(plt: Any, figure: Any) -> Figure:
    """Takes a figure from pyplot's list, so that a notebook shows it once and many figures take no memory."""
    plt.close(figure)
    finished: Figure = figure
    return finished


def short(value: Any) -> str:
    """A value as a label has it; a member of a list that leaves it out has that of the problem itself."""
    if isinstance(value, str) and value.startswith("{"):  # an object of the problem, such as an obstacle
        document = json.loads(value)
        parts = [str(document.pop("kind"))] if "kind" in document else []
        return " ".join(parts + [f"{name} {short(inner)}" for name, inner in document.items()])
    if value == "" or (isinstance(value, float) and np.isnan(value)):
        return "as in the problem"
    return f"{value:.6g}".replace("-", "−") if isinstance(value, float) else str(value)


def with_unit(name: str, unit: str) -> str:
    return f"{name}  ({unit})" if unit else name


def quantile(values: Array, lengths: Array, share: float) -> float:
    order = np.argsort(values)
    total = np.cumsum(lengths[order])
    return float(values[order][min(np.searchsorted(total, share * total[-1]), len(values) - 1)])
