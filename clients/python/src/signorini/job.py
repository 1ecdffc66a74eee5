"""A job: wait for it, follow it, stop it, read its result."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from . import _calls as calls
from ._data import Event
from ._job import JobView, changes
from ._progress import Waiting, goes_on
from .problem import Problem
from .result import Result, write

if TYPE_CHECKING:
    from .client import Client


class Job(JobView):
    """A job of the service, as it was when it was last asked; `refresh()` asks again.

    It lives in the service: nothing that happens to this program, or to this object, changes it.
    """

    def __init__(self, client: Client, document: Mapping[str, Any]) -> None:
        super().__init__(document)
        self._client = client

    def refresh(self) -> Job:
        """Asks the service how the job is now."""
        self.document = self._client._send(calls.job(self.id))
        return self

    def wait(self, timeout: float | None = None, progress: bool = True) -> Result:
        """Waits until the job has ended, and returns its result.

        timeout: seconds; then `WaitTimeout` is raised. The job goes on, as it does after Ctrl-C.
        progress: whether one line on standard error shows how it gets on

        Raises `JobFailed` or `JobCanceled` if it has no solution. While the service restarts, waiting goes on.
        """
        waiting = Waiting(self.title, timeout, progress, self._back(), self._card)
        try:
            while not self.ended:
                call = calls.job(self.id, waiting.seconds())
                with waiting.in_time():
                    self.document = self._client._send(call, waiting.deadline, waiting.note)
                waiting.seen(self.status, self.line(), self.ended, self._residual())
        except KeyboardInterrupt:
            waiting.detached()
            raise
        finally:
            waiting.close()
        return self.result()

    def _back(self) -> str:
        again = f"client.job({self.id!r})"
        return goes_on("job", f"{again}.wait(), or stop it with {again}.cancel()", self._client._ends_with_program)

    def events(self, after_seq: int = 0) -> Iterator[Event]:
        """All events of the job, past ones first, then live ones, until it has ended.

        Each comes once and in its order, also if the connection breaks or the service restarts. `after_seq` is the
        number of the last event that is already known.
        """
        return self._client._events(calls._job(self.id) + "/events", self.id, after_seq)

    def cancel(self) -> Job:
        """Asks the job to stop; it has ended within half a second. A job that has ended stays as it is."""
        self.document = self._client._send(calls.cancel(self.id))["job"]
        return self

    def retry(
        self, *, timeout_s: float | None = None, queue_ttl_s: float | None = None, priority: int | None = None
    ) -> Job:
        """Solves the problem of a job that has ended again, without the cache: a new job."""
        return Job(self._client, self._client._send(calls.retry(self.id, timeout_s, queue_ttl_s, priority)))

    def edit(self, **values: Any) -> Job:
        """Changes `name`, `labels` (all of them), `priority` or `pinned` (kept for ever)."""
        self.document = self._client._send(calls.edit(self.id, changes(values)))
        return self

    def delete(self) -> None:
        """Deletes a job that has ended, with its result. Raises `JobActive` before."""
        self._client._send(calls.delete(self.id))

    def problem(self) -> Problem:
        """What was submitted, with its defaults filled in."""
        return Problem.from_dict(self.problem_document())

    def problem_document(self) -> Mapping[str, Any]:
        """The same as plain JSON, which also a service newer than this client can be asked for."""
        return self._client._send(calls.problem(self.id))

    def result(self, partial: bool = False) -> Result:
        """The result. Raises `ResultNotReady` while the job runs, `JobFailed` where it has no solution.

        partial: whether the last state of an iteration that did not end will do, or, while the job runs, the last load
            step that has ended
        """
        if not self.ended:
            self.refresh()
        if not partial:
            self.raise_for_status()
        return Result(self._client, self, self._client._send(calls.result(self.id, partial, self.input_hash)))

    def svg(self, plot: str, theme: str = "light", *, size: str = "page", step: int | str | None = None) -> str:
        """A figure that the service draws: `profile`, `convergence`, `deformed` or `mesh`.

        size: what it is for: `column`, `page` or `slide`
        step: the load step at whose end it is, by name or number; of `profile` and `convergence`
        """
        return self._client._send(calls.plot(self.id, plot, "svg", theme, size, step)).decode()

    def save_figure(
        self,
        path: str | os.PathLike[str],
        plot: str = "profile",
        theme: str = "light",
        *,
        size: str = "page",
        step: int | str | None = None,
    ) -> pathlib.Path:
        """The same as a file, of the kind that its name ends with: .svg, .png (300 dots to an inch) or .pdf."""
        ending = calls.figure_ending(path)
        return write(path, self._client._send(calls.plot(self.id, plot, ending, theme, size, step)))
