"""What tells how a job or sweep gets on while one waits (a line, in a notebook a card), and how long to wait for it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TextIO

from ._calls import LONGEST_WAIT_S
from .errors import WaitTimeout

if TYPE_CHECKING:
    from .local import LocalServer

REFRESH_S = 0.5


class Waiting:
    """How long to wait, and what to show meanwhile.

    timeout: seconds until `WaitTimeout`; None: without limit
    progress: whether a line is shown on standard error. It is drawn in place in a terminal; elsewhere, as in the log
        of a batch system, a line is written when the status changes.
    card: in a notebook a card is shown instead of the line; it is given the residuals seen so far
    """

    def __init__(
        self,
        what: str,
        timeout: float | None,
        progress: bool,
        back: str,
        card: Callable[[Sequence[float]], str] | None = None,
        out: TextIO | None = None,
    ) -> None:
        self.what = what
        self.back = back
        self._progress = progress
        self._out = out or sys.stderr
        self._card = card if in_notebook() else None
        self._shown_card: Any = None
        self._residuals: list[float] = []
        self._in_place = self._out.isatty() or self._card is not None
        self._shown = ""
        self._status = ""
        self._end = None if timeout is None else time.monotonic() + timeout

    def seconds(self) -> float:
        """Seconds that the service should wait for the end before it answers."""
        longest = REFRESH_S if self._progress and self._in_place else LONGEST_WAIT_S
        return min(longest, self.left(longest))

    def left(self, otherwise: float) -> float:
        """Seconds until the time-out, at most `otherwise`."""
        return otherwise if self._end is None else max(0.0, min(otherwise, self._end - time.monotonic()))

    def seen(self, status: str, line: str, ended: bool, residual: float | None = None) -> None:
        """Shows the line. Raises `WaitTimeout` when the time is over."""
        if residual is not None:
            self._residuals.append(residual)
        if self._progress and self._card is not None:
            self._show_card(self._card(self._residuals))
        elif self._progress and (self._in_place or status != self._status or ended):
            self._write(line, ended)
        self._status = status
        if not ended and self._end is not None and time.monotonic() >= self._end:
            raise WaitTimeout(f"{self.what} has not ended in time; it goes on.\n  {self.back}")

    def note(self, text: str) -> None:
        """Shows, on a line of its own, what happens to the connection meanwhile."""
        if self._progress:
            self.close()
            self.tell([text])

    def detached(self) -> None:
        """Tells how to come back, after Ctrl-C."""
        self.close()
        self._out.write(f"Detached. {self.back}\n")
        self._out.flush()

    def tell(self, lines: Iterable[str]) -> None:
        """Writes lines below the last one."""
        self._out.writelines(line + "\n" for line in lines)
        self._out.flush()

    def close(self) -> None:
        if self._shown and self._in_place:
            self._out.write("\n")
            self._out.flush()
        self._shown = ""

    def _show_card(self, html: str) -> None:
        from IPython.display import HTML, display

        if self._shown_card is None:
            self._shown_card = display(HTML(html), display_id=True)
        else:
            self._shown_card.update(HTML(html))

    def _write(self, line: str, ended: bool) -> None:
        if self._in_place:
            # blanks over what is left of a longer line before
            self._out.write("\r" + line + " " * max(0, len(self._shown) - len(line)))
            self._shown = line
            if ended:
                self.close()
        else:
            self._out.write(line + "\n")
        self._out.flush()


def goes_on(what: str, again: str, server: LocalServer | None) -> str:
    """What becomes of a job or sweep that nobody waits for any more, and how to wait again."""
    if server is not None and server.temporary:
        return f"The {what} is lost when this program ends, and its service with it. Until then: {again}"
    return f"The {what} goes on. Come back with {again}"


def job_line(title: str, job: Mapping[str, Any]) -> str:
    """Iteration, residual → tolerance, changes of contact, time to go."""
    status = str(job["status"])
    parts = [title, status if not job.get("reason") else f"{status} ({str(job['reason']).replace('_', ' ')})"]
    progress = job.get("progress") or {}
    if status == "queued" and job.get("queue"):
        ahead = job["queue"]["ahead"]
        place = f"{ahead} ahead" if ahead else "next in line"
        parts.append(f"{place} ({str(job['queue']['reason']).replace('_', ' ')})")
    if progress.get("mesh"):
        parts.append(f"mesh {progress['mesh']}, {progress['mesh_elements']} elements")
    if progress.get("iteration"):
        parts.append(f"iteration {progress['iteration']}")
    if progress.get("residual") is not None:
        parts.append(f"residual {progress['residual']:.1e} → {progress['tolerance']:.0e}")
    if progress.get("contact_changes") is not None and status == "running":
        parts.append(f"contact ±{progress['contact_changes']}")
    if progress.get("eta_s") is not None and status == "running":
        parts.append(f"eta {duration(progress['eta_s'])}")
    if job.get("run_s") is not None and job.get("finished_at"):
        parts.append("from the cache" if job.get("cached_from") else f"in {duration(job['run_s'])}")
    return " · ".join(parts)


def sweep_line(title: str, sweep: Mapping[str, Any]) -> str:
    """How many members have ended."""
    counts = sweep["members"]
    ended = counts["succeeded"] + counts["failed"] + counts["canceled"]
    width = 20
    bar = "█" * (width * ended // max(counts["total"], 1))
    parts = [title, str(sweep["status"]), f"{bar:░<{width}} {ended} of {counts['total']}"]
    parts += [f"{counts[status]} {status}" for status in ("failed", "canceled") if counts[status]]
    return " · ".join(parts)


def duration(seconds: float) -> str:
    """Seconds in words: 1.4 s, 3 min 20 s, 2 h 5 min."""
    if seconds < 10:
        return f"{seconds:.1f} s"
    if seconds < 60:
        return f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"


def in_notebook() -> bool:
    """Whether this runs in a notebook, which understands lines that are drawn in place."""
    shell = sys.modules.get("IPython")
    return shell is not None and type(shell.get_ipython()).__name__ == "ZMQInteractiveShell"
