"""Figures of the stresses along a contact, of one job or of several."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import pointer as pointers
from ._around import (
    MOST_CURVES,
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
)
from ._style import PARAMETERS, QUANTITIES, Limits, Theme, coordinates, limits, styled, unit, unit_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ._data import Array, Profile


CUT = 6.0
"""A stress is drawn up to so many times its median along the contact; a peak beyond it is cut and marked."""


def profile(
    found: Profile,
    *,
    size: str = "page",
    theme: str = "light",
    style: str = "full",
    title: str | None = None,
    zoom: bool = True,
    xlim: Any = None,
    ylim: Any = None,
    ylim_below: Any = None,
    ax: Any = None,
) -> Figure:
    """Normal and tangential stress along a contact by arc length, with the friction bound; stick and slip shaded.

    zoom: whether only what is under stress is shown, with a margin; else the whole boundary
    xlim: limits of the arc length `s`, which is not the coordinate x on every boundary
    ylim, ylim_below: limits of the normal stress, and of the tangential stress
    ax: one for both stresses, or two
    """
    across, up, below = limits(xlim=xlim, ylim=ylim, ylim_below=ylim_below)
    with styled(size, theme, ax, style) as (plt, width, colours):
        figure, upper, lower = two_panels(plt, size, width, ax, 1.1, 0.78)
        part = _view(found, zoom, across)
        s, normal, tangential = found.s[part], found.normal_stress[part], found.tangential_stress[part]
        across = across or (float(s[0]), float(s[-1]))
        for axes in {upper, lower}:
            _shade(axes, found, colours, across)
        pressed = up or _limits(s, normal)
        upper.plot(s, _without_returns(normal, pressed[0]), color=colours.normal, label=QUANTITIES["normal_stress"])
        bound = found.friction_bound[part]
        signs = [sign for sign in (1, -1) if np.any(sign * tangential > 0)] or [1]
        if np.any(bound > 0):
            for sign in signs:
                label = QUANTITIES["friction_bound"] if sign == signs[0] else None
                lower.plot(s, sign * bound, color=colours.faint, linestyle=(0, (4, 2)), label=label)
        lower.plot(
            s, tangential, color=colours.tangential, linestyle="--" if lower is upper else "-",
            label=QUANTITIES["tangential_stress"],
        )  # fmt: skip
        if lower is upper:
            # away from the note on a peak that is cut
            lower.legend(loc="lower left" if _is_late(s, normal) else "lower right")
        elif np.any(bound > 0) and size == "column" and ax is None:
            # panels are so small that it would lie on the curves
            legend_below(plt, figure, upper, lower, columns=2, every=(lower,))
        elif np.any(bound > 0):
            lower.legend(loc="best")
        _stress_axes(upper, lower, found, across)
        for axes in (upper, lower):
            axes.axhline(0, color=colours.ink, linewidth=0.5)
        # with the bound, unless it is far from being reached
        low, high = _limits(s, tangential, np.inf)
        reach = 1.08 * float(bound.max())
        rubbed = min(low, max(-reach, 1.6 * low)), max(high, min(reach, 1.6 * high))
        if lower is upper and up is None:
            pressed = rubbed = min(pressed[0], rubbed[0]), max(pressed[1], rubbed[1])
        lower.set_ylim(*below or rubbed)
        upper.set_ylim(*pressed)
        _words(upper, found, colours, across)
        no_limit = style == "full" and lower is not upper
        _mark_cut(upper, s, normal, colours, found.about, found.boundary, no_limit)
        _position_axis(upper, found, part)
        if ax is not None:
            return entitled(upper, found.about, found.partial, title, style, found.boundary)
        if style == "full":
            head(
                figure,
                upper,
                found.about,
                colours,
                found.partial,
                title,
                found.boundary,
                right=rightmost(upper, lower),
            )
            foot(figure, found.about, colours, width)
    return finished(plt, figure)


def profiles(
    found: Sequence[Any],
    boundary: str | None = None,
    *,
    labels: Sequence[str] | None = None,
    step: int | str | None = None,
    size: str = "page",
    theme: str = "light",
    style: str = "full",
    title: str | None = None,
    zoom: bool = True,
    xlim: Any = None,
    ylim: Any = None,
    ylim_below: Any = None,
    ax: Any = None,
) -> Figure:
    """Stresses along a contact of several jobs in one figure.

    found: jobs that have ended, results, or profiles
    boundary: name of the contact's boundary; may be left out where there is only one
    labels: of the curves in the legend; absent: what the problems of the jobs differ in, by short names with values
    step: the load step at whose end it is, by name or number
    ylim, ylim_below: limits of the normal stress, and of the tangential stress
    ax: two

    Under the title stand the parameters that all have in common, beside it the worst of the verdicts, below the figure
    the warnings of all of them. Raises ValueError for more than twelve.
    """
    if not 1 <= len(found) <= MOST_CURVES:
        raise ValueError(f"a figure has 1 to {MOST_CURVES} curves, not {len(found)}")
    if labels is not None and len(labels) != len(found):
        raise ValueError(f"there are {len(labels)} labels for {len(found)} jobs")
    across, up, below = limits(xlim=xlim, ylim=ylim, ylim_below=ylim_below)
    several = [_profile_of(each, boundary, step) for each in found]
    names = list(labels) if labels is not None else _told_apart([each.about for each in several])
    with styled(size, theme, ax, style) as (plt, width, colours):
        figure, upper, lower = two_panels(plt, size, width, ax, 1.3, 0.85)
        if lower is upper:
            raise ValueError("ax is two pairs of axes, not 1")
        parts = [_view(each, zoom, across) for each in several]
        if across is None:
            ends = [each.s[part][[0, -1]] for each, part in zip(several, parts, strict=True)]
            across = float(min(end[0] for end in ends)), float(max(end[1] for end in ends))
        looks = looks_of(plt, colours, len(several))
        within = [(each, _view(each, False, across)) for each in several]
        low = up[0] if up else min(_limits(each.s[part], each.normal_stress[part])[0] for each, part in within)
        reach = []
        for each, name, look in zip(several, names, looks, strict=True):
            part = _view(each, False, across)
            upper.plot(each.s[part], _without_returns(each.normal_stress[part], low), label=name, **look)
            lower.plot(each.s[part], each.tangential_stress[part], label=name, **look)
            stresses = (each.normal_stress, CUT), (each.tangential_stress, np.inf)
            reach.append([_limits(each.s[part], stress[part], cut) for stress, cut in stresses])
        _stress_axes(upper, lower, several[0], across, {each.boundary for each in several})
        for axes, given, which in ((upper, up, 0), (lower, below, 1)):
            axes.axhline(0, color=colours.ink, linewidth=0.5)
            axes.set_ylim(*given or (min(pair[which][0] for pair in reach), max(pair[which][1] for pair in reach)))
        for each, look in zip(several, looks, strict=True):
            part = _view(each, False, across)
            _mark_cut(upper, each.s[part], each.normal_stress[part], colours, {}, "", False, look["color"], said=False)
        about = _common([each.about for each in several], several[0].boundary)
        partial = any(each.partial for each in several)
        if ax is not None:
            upper.legend(loc="best")
            return entitled(upper, about, partial, title, style, several[0].boundary)
        legend_below(plt, figure, upper, lower, columns=1 if size == "column" else 2, every=(upper,))
        if style == "full":
            head(figure, upper, about, colours, partial, title, several[0].boundary, right=rightmost(upper, lower))
            foot(figure, about, colours, width)
    return finished(plt, figure)


def _profile_of(found: Any, boundary: str | None, step: int | str | None) -> Profile:
    """The profile of a job, of a result, or as it is."""
    if hasattr(found, "result"):
        found = found.result()
    if hasattr(found, "profile"):
        found = found.profile(boundary, step=step)
    if not hasattr(found, "normal_stress"):
        raise TypeError(f"expected jobs, results or profiles, not {type(found).__name__}")
    profile: Profile = found
    return profile


def _told_apart(abouts: Sequence[Mapping[str, Any]]) -> list[str]:
    """A label for each result: what its problem differs in from the others, or, where nothing does, its number."""
    documents = [
        {name: part for name, part in (about.get("problem") or {}).items() if name not in ("title", "units")}
        for about in abouts
    ]
    found = pointers.differences(documents)
    parts: list[list[str]] = [[] for _ in abouts]
    for pointer, name in pointers.short_names(list(found)).items():
        symbol = PARAMETERS.get(pointers.names(pointer)[-1], name.replace("_", " "))
        for number, (about, value) in enumerate(zip(abouts, found[pointer], strict=True)):
            parts[number].append(_said(symbol, value, unit_of(about, pointer)))
    steps = [about.get("step") for about in abouts]
    for number, step in enumerate(steps):
        if len(set(steps)) > 1:
            parts[number].append("last load step" if step is None else f"load step {step}")
    labels = [", ".join(of_one) for of_one in parts]
    return [
        label if labels.count(label) == 1 else f"{label} (no. {number})".strip()
        for number, label in enumerate(labels, 1)
    ]


def _said(symbol: str, value: Any, unit: str) -> str:
    """A value of a problem in a label."""
    if value is None:
        return f"without {symbol}"
    if isinstance(value, dict):
        return f"{symbol} {short(json.dumps(value))}" if "kind" in value and len(str(value)) < 80 else f"other {symbol}"
    if isinstance(value, list):
        return f"other {symbol}"
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return f"{symbol} = {short(float(value)) if number else value}{f' {unit}' if unit and number else ''}"


def _common(abouts: Sequence[Mapping[str, Any]], boundary: str) -> dict[str, Any]:
    """What figures of several results say: the parameters that all have, the worst verdict, all warnings."""
    ranks = ["good", "fair", "poor"]
    verdicts = [about.get("verdict") or "" for about in abouts]
    worst = max(verdicts, key=lambda verdict: ranks.index(verdict) if verdict in ranks else len(ranks))
    each = [(about.get("parameters") or {}).get(boundary) or {} for about in abouts]
    same = {symbol: value for symbol, value in each[0].items() if all(one.get(symbol) == value for one in each)}
    titles = {about.get("title") or "" for about in abouts}
    return {
        **abouts[0],
        "title": titles.pop() if len(titles) == 1 else "",
        # without those that differ, nothing is left of some laws
        "parameters": {boundary: same} if same or not any(each) else {},
        "step": None,
        "verdict": worst,
        "of": "worst verdict" if len(set(verdicts)) > 1 else "verdict",
        "outcome": "of at least one",
        "warnings": [code for about in abouts for code in about.get("warnings") or []],
        "peaks": {},
    }


def _view(found: Profile, zoom: bool, across: Limits | None) -> slice:
    """The rows of a profile that are shown: between limits, or where there is stress, and a fifth of that on each side.

    A contact is often a small part of the boundary that faces the obstacle.
    """
    s = found.s
    if across is not None:
        low, high = across
        first, last = int(np.searchsorted(s, low)), int(np.searchsorted(s, high, "right")) - 1
    else:
        loaded = np.flatnonzero((found.normal_stress != 0) | (found.friction_bound != 0))
        if not zoom or len(loaded) == 0:
            return slice(0, len(s))
        first, last = int(loaded[0]), int(loaded[-1])
        margin = 0.2 * (s[last] - s[first])
        first = min(first, int(np.searchsorted(s, s[first] - margin)))
        last = max(last, int(np.searchsorted(s, s[last] + margin, "right")) - 1)
    # one node beyond, so that the curves visibly return to zero, or leave the figure
    part = slice(max(min(first, last) - 1, 0), min(max(first, last) + 2, len(s)))
    if part.stop - part.start < 2 or (across is not None and not (s[0] < across[1] and across[0] < s[-1])):
        raise ValueError(f"xlim: the contact lies between {s[0]:.6g} and {s[-1]:.6g}")
    return part


def _stress_axes(upper: Any, lower: Any, found: Profile, across: Limits, boundaries: set[str] | None = None) -> None:
    """Names and range of the axes of stresses along a contact."""
    stress = unit(found.about, "stress")
    upper.set_ylabel(QUANTITIES["normal_stress"] + stress)
    lower.set_ylabel(("stress on the body" if lower is upper else QUANTITIES["tangential_stress"]) + stress)
    along = f" along “{found.boundary}”" if boundaries is None or len(boundaries) == 1 else ""
    lower.set_xlabel(f"arc length $s${unit(found.about, 'length')}{along}")
    if rightmost(upper, lower) is lower and lower is not upper:
        upper.set_xlabel(lower.get_xlabel())
    for axes in (upper, lower):
        axes.set_xlim(*across)


def _shade(axes: Any, found: Profile, colours: Theme, across: Limits) -> None:
    """Stick and slip behind the curves."""
    for part, start, end in _parts(found, across):
        colour = colours.stick if part == "stick" else colours.slip
        axes.axvspan(start, end, facecolor=colour, alpha=0.16, linewidth=0)
        if part == "slip":
            axes.axvspan(start, end, facecolor="none", edgecolor=colour, alpha=0.25, hatch="////", linewidth=0)


def _words(axes: Any, found: Profile, colours: Theme, across: Limits) -> None:
    """The words stick and slip, so that colour is not all that tells them apart; beside the normal stress."""
    length = across[1] - across[0]
    low, high = axes.get_ylim()
    for part, start, end in _parts(found, across):
        if end - start > 0.08 * length:
            middle = (start + end) / 2
            near = np.linspace(middle - 0.05 * length, middle + 0.05 * length, 11)
            curve = (np.interp(near, found.s, found.normal_stress) - low) / (high - low)
            # the first place that is clear of the curve
            places = [place for place in (0.5, 0.37, 0.75) if np.abs(curve - place).min() > 0.1]
            axes.text(
                middle, [*places, 0.5][0], part, color=colours.ink, alpha=0.8, ha="center", va="center",
                transform=axes.get_xaxis_transform(), fontsize="small",
                bbox={"facecolor": colours.ground, "alpha": 0.6, "linewidth": 0, "pad": 1.5},
            )  # fmt: skip


def _parts(found: Profile, across: Limits) -> Iterator[tuple[str, float, float]]:
    """The parts of the contact in stick and in slip, as far as they are shown."""
    extents = (found.about.get("extents") or {}).get(found.boundary) or {}
    for part in ("stick", "slip"):
        for start, end in extents.get(part, []):
            start, end = max(start, across[0]), min(end, across[1])
            if start < end:
                yield part, start, end


def _limits(s: Array, values: Array, cut: float = CUT) -> tuple[float, float]:
    """Limits of an axis; a peak far beyond all else is cut, since nothing else could be seen beside it.

    What is usual is judged by length, not by points: a mesh has most of its points where the peak is.
    """
    lengths = np.gradient(s) if len(s) > 1 else np.ones(1)
    largest = float(np.abs(values).max()) or 1.0
    acting = np.abs(values) > 1e-9 * largest
    most = min(largest, cut * quantile(np.abs(values[acting]), lengths[acting], 0.5)) if np.any(acting) else 1.0
    # a single point may overshoot beside a peak: where nothing of length is beyond zero, the axis ends there
    low, high = quantile(values, lengths, 0.001), quantile(values, lengths, 0.999)
    below = min(most, -float(values.min())) if low < 0 else 0.0
    above = min(most, float(values.max())) if high > 0 else 0.0
    if not (below or above):
        return -1.0, 1.0
    return -1.08 * below - 0.02 * above, 1.08 * above + 0.02 * below


def _is_late(s: Array, values: Array) -> bool:
    """Whether the lowest of the values is in the second half."""
    return bool(s[int(np.argmin(values))] > (s[0] + s[-1]) / 2)


def _mark_cut(
    axes: Any,
    s: Array,
    values: Array,
    colours: Theme,
    about: Mapping[str, Any],
    boundary: str,
    remark: bool,
    colour: Any = None,
    said: bool = True,
) -> None:
    """Two small strokes wherever the curve leaves the figure, and how far it goes.

    remark: whether it is told that the peak grows on finer meshes
    said: whether the value is told
    """
    low, _ = axes.get_ylim()
    beyond = np.flatnonzero(values < low)
    if len(beyond) == 0:
        return
    for run in np.split(beyond, np.flatnonzero(np.diff(beyond) > 1) + 1):
        axes.annotate(
            "≈", (s[run[np.argmin(values[run])]], 0), xycoords=("data", "axes fraction"), ha="center", va="center",
            color=colours.normal if colour is None else colour, fontsize="large", annotation_clip=False,
            bbox={"boxstyle": "square,pad=0", "facecolor": colours.ground, "edgecolor": "none"},
        )  # fmt: skip
    if not said:
        return
    at = int(np.argmin(values))
    peak = ((about.get("peaks") or {}).get(boundary) or {}).get("normal_stress")
    no_limit = peak is not None and peak.value.why == "no_limit"
    text = f"peak {values[at]:.3g}".replace("-", "−") + (", which grows on finer meshes" if no_limit and remark else "")
    to_left = _is_late(s, values)
    axes.annotate(
        text, (s[at], 0), xycoords=("data", "axes fraction"), xytext=(-10 if to_left else 10, 12),
        textcoords="offset points", ha="right" if to_left else "left", va="bottom", fontsize="small",
    )  # fmt: skip


def _without_returns(values: Array, low: float) -> Array:
    """Values without single ones above the end of the axis between two below it, which are not drawn.

    Beside a peak without a limit the quadratic pressure of an edge turns back between its nodes.
    """
    drawn = np.array(values, float)
    below = drawn < low
    drawn[1:-1][~below[1:-1] & below[:-2] & below[2:]] = np.nan
    return drawn


def _position_axis(axes: Any, found: Profile, part: slice) -> None:
    """The position above s, where the two differ: x, or y where the boundary turns back in x; r or z in axisymmetry."""
    s = found.s[part]
    along = zip(coordinates(found.about), (found.x[part], found.y[part]), strict=True)
    name, values = next(((name, values) for name, values in along if _is_monotone(values)), ("", s))
    if np.abs(values - s).max() <= 1e-6 * (s[-1] - s[0]):
        return
    # interpolation needs places that rise
    order = slice(None) if values[0] < values[-1] else slice(None, None, -1)
    there, back = lambda at: _between(at, s, values), lambda at: _between(at, values[order], s[order])
    above = axes.secondary_xaxis("top", functions=(there, back))
    above.set_xlabel(f"position ${name}$" + unit(found.about, "length"))
    above.spines["top"].set_visible(True)


def _between(at: Any, x: Array, y: Array) -> Array:
    """Linear between points and beyond them: numbers of an axis that are not shown have places outside of it."""
    at = np.asarray(at, float)
    before = (at - x[0]) * (y[1] - y[0]) / (x[1] - x[0]) + y[0]
    after = (at - x[-1]) * (y[-1] - y[-2]) / (x[-1] - x[-2]) + y[-1]
    return np.asarray(np.where(at < x[0], before, np.where(at > x[-1], after, np.interp(at, x, y))))


def _is_monotone(values: Array) -> bool:
    steps = np.diff(values)
    return bool(np.all(steps > 0) or np.all(steps < 0))
