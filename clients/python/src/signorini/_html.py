"""What notebooks show of a job, a result and a sweep. Every text is escaped: names and labels come from others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

from ._progress import duration

if TYPE_CHECKING:
    from ._data import Summary
    from ._job import JobView
    from ._sweep import SweepView

COLOURS = {
    "succeeded": "#009E73", "good": "#009E73", "running": "#0072B2", "queued": "#767676", "fair": "#B07A00",
    "failed": "#D55E00", "poor": "#D55E00", "canceled": "#767676",
}  # fmt: skip

CARD = "border:1px solid #9994;border-left:4px solid {colour};border-radius:4px;padding:.5em .8em;max-width:46em"


def job(found: JobView, residuals: Sequence[float] = ()) -> str:
    """A card: name, status, progress, times; with residuals that were seen on the way their curve."""
    rows = [("id", found.id)]
    if found.labels:
        rows.append(("labels", ", ".join(f"{key}={value}" for key, value in found.labels.items())))
    if found.failure:
        rows.append(("failure", str(found.failure.get("detail") or found.failure.get("title"))))
    progress = found.progress or {}
    if progress.get("residual") is not None:
        rows.append(("residual", f"{progress['residual']:.1e} → {progress['tolerance']:.0e}"))
    if progress.get("iteration"):
        rows.append(("iteration", str(progress["iteration"])))
    if found.run_s is not None:
        rows.append(("time", "from the cache" if found.cached_from else duration(found.run_s)))
    rows += [(warning.kind, warning.code.replace("_", " ")) for warning in found.warnings]
    return _card(found.title, found.status, rows, _curve(residuals, progress.get("tolerance")))


def result(found: Summary) -> str:
    """A table: forces with their errors, extents, verdict, warnings."""
    rows = [(name, value) for name, value in found.lines() if name != "verdict"]
    rows += [("because", reason) for reason in found.reasons]
    rows += [(warning.kind, warning.message) for warning in found.warnings]
    title = "Partial result: the iteration did not end" if found.partial else "Result"
    return _card(title, found.verdict, rows)


def sweep(found: SweepView) -> str:
    """A card: how many members have ended."""
    counts = found.counts
    rows = [("id", found.id), ("over", ", ".join(found.paths))]
    rows += [(status, str(number)) for status, number in counts.items() if number and status != "total"]
    return _card(found.title, found.status, rows)


def _curve(residuals: Sequence[float], tolerance: float | None) -> str:
    """Residuals as a small curve, logarithmic, with a dashed line at the tolerance."""
    seen = [math.log10(residual) for residual in residuals if residual > 0]
    if len(seen) < 2 or not tolerance:
        return ""
    goal, width, height = math.log10(tolerance), 240, 48
    low, high = min(goal, *seen), max(goal, *seen)
    scale = (height - 6) / ((high - low) or 1.0)

    def y(value: float) -> float:
        return 3 + (high - value) * scale

    points = " ".join(f"{width * number / (len(seen) - 1):.1f},{y(value):.1f}" for number, value in enumerate(seen))
    return (
        f"<svg width='{width}' height='{height}' role='img' aria-label='residual while waiting'>"
        f"<line x1='0' x2='{width}' y1='{y(goal):.1f}' y2='{y(goal):.1f}' stroke='#767676' stroke-dasharray='3 3'/>"
        f"<polyline points='{points}' fill='none' stroke='#D55E00' stroke-width='1.5'/></svg>"
    )


def _card(title: str, mark: str, rows: list[tuple[str, str]], more: str = "") -> str:
    colour = COLOURS.get(mark, "#767676")
    body = "".join(
        f"<tr><td style='text-align:left;opacity:.7;white-space:nowrap;vertical-align:top'>{escape(name)}</td>"
        f"<td style='text-align:left'>{escape(value)}</td></tr>"
        for name, value in rows
    )
    return (
        f"<div style='{CARD.format(colour=colour)}'><b>{escape(title)}</b> "
        f"<span style='color:{colour};font-weight:bold'>{escape(mark)}</span><table>{body}</table>{more}</div>"
    )
