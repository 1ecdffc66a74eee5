"""What tells how a job or sweep gets on while one waits (a line, in a notebook a card), and how long to wait for it."""

from __future__ import annotations

import contextlib
import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, TextIO

from ._calls import LONGEST_WAIT_S
from ._retry import Late
from .errors import WaitTimeout

REFRESH_S = 0.5
GRACE_S = 1.0
"""Seconds after a time-out within which an answer may still arrive."""


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
        self._out: TextIO | None = out or sys.stderr  # pythonw has none
        self._card = card if in_notebook() else None
        self._shown_card: Any = None
        self._residuals: list[float] = []
        self._in_place = self._card is not None or _is_terminal(self._out)
        self._shown = ""
        self._status = ""
        self._end = None if timeout is None else time.monotonic() + float(timeout)

    @property
    def deadline(self) -> float | None:
        """When an answer is no longer waited for, of `time.monotonic`: the service itself answers at the time-out."""
        return None if self._end is None else self._end + GRACE_S

    def soon(self, seconds: float) -> float:
        """The deadline of something that is less important."""
        return min(time.monotonic() + seconds, self.deadline or math.inf)

    def seconds(self, crowded: bool = False) -> float:
        """Seconds that the service should wait for the end before it answers.

        crowded: whether others wait for their turn to ask
        """
        longest = REFRESH_S if crowded or (self._progress and self._in_place) else LONGEST_WAIT_S
        return longest if self._end is None else max(0.0, min(longest, self._end - time.monotonic()))

    @contextlib.contextmanager
    def in_time(self) -> Iterator[None]:
        """Raises `WaitTimeout` if the deadline comes while the service is asked."""
        try:
            yield
        except Late as error:
            raise self._over(f"The service does not answer: {error}") from error

    def _over(self, why: str = "") -> WaitTimeout:
        return WaitTimeout(
            "\n  ".join(filter(None, [f"{self.what} has not ended in time; it goes on.", why, self.back]))
        )

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
            raise self._over()

    def note(self, text: str) -> None:
        """Shows, on a line of its own, what happens to the connection meanwhile."""
        if self._progress:
            self.close()
            self.tell([text])

    def detached(self) -> None:
        """Tells how to come back, after Ctrl-C."""
        self.close()
        self._say(f"Detached. {self.back}\n")

    def tell(self, lines: Iterable[str]) -> None:
        """Writes lines below the last one."""
        self._say("".join(line + "\n" for line in lines))

    def close(self) -> None:
        if self._shown and self._in_place:
            self._say("\n")
        self._shown = ""

    def _say(self, text: str) -> None:
        """Writes to standard error; a stream that cannot be written does not stop the waiting."""
        if self._out is None or not text:
            return
        try:
            try:
                self._out.write(text)
            except UnicodeEncodeError as error:
                self._out.write(text.encode(error.encoding, "backslashreplace").decode(error.encoding))
            self._out.flush()
        except Exception:
            self._out = None

    def _show_card(self, html: str) -> None:
        from IPython.display import HTML, display

        if self._shown_card is None:
            self._shown_card = display(HTML(html), display_id=True)
        else:
            self._shown_card.update(HTML(html))

    def _write(self, line: str, ended: bool) -> None:
        if self._in_place:
            # blanks over the rest of a longer earlier line
            self._say("\r" + line + " " * max(0, len(self._shown) - len(line)))
            self._shown = line
            if ended:
                self.close()
        else:
            self._say(line + "\n")


def goes_on(what: str, again: str, ends_with_program: bool) -> str:
    """A line that says that a job or sweep continues, and how to wait for it again.

    ends_with_program: whether it is that of a service whose jobs end with it, and that with the program
    """
    if ends_with_program:
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
    if job.get("verdict"):
        parts.append(str(job["verdict"]))
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


def _is_terminal(out: Any) -> bool:
    try:
        return bool(out.isatty())
    except Exception:  # None, closed, or something that can only write
        return False


def in_notebook() -> bool:
    """Whether this runs in a notebook, which understands lines that are drawn in place."""
    shell = sys.modules.get("IPython")
    return shell is not None and type(shell.get_ipython()).__name__ == "ZMQInteractiveShell"
