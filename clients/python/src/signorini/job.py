"""A job: wait for it, follow it, stop it. And its result: numbers with their errors, arrays when they are asked for."""

from __future__ import annotations

import functools
import os
import pathlib
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, cast

from . import _calls as calls
from . import _html
from ._about import about, obstacles
from ._data import Event, Fields, History, Profile, Summary, known
from ._job import JobView, changes
from ._progress import Waiting, goes_on
from ._saved import Saved, key, packed, requests, write
from .problem import Problem

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from typing_extensions import Unpack

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
            step that has ended. The profiles, history and fields of the result are then of that state, too
        """
        if not self.ended:
            self.refresh()
        if not partial:
            self.raise_for_status()
        return Result(self._client, self, self._client._send(calls.result(self.id, partial, self.input_hash)))

    def svg(
        self,
        plot: str,
        theme: str = "light",
        *,
        size: str = "page",
        step: int | str | None = None,
        partial: bool = False,
        **look: Unpack[calls.Look],
    ) -> str:
        """A figure that the service draws: `profile`, `convergence`, `deformed` or `mesh`.

        size: what it is for: `column`, `page` or `slide`
        step: the load step at whose end it is, by name or number; of `profile` and `convergence`
        look: `style="bare"` without title, parameters, verdict and warnings; `stress` of `deformed`; `xlim`, `ylim`,
            `ylim_below` are limits of axes, two numbers each
        partial: whether the state at which a job that failed or was canceled stopped will do, which is not a solution;
            without it such a job raises `PartialResult`, but for its `mesh`
        """
        return self._client._send(calls.plot(self.id, plot, "svg", theme, size, step, look, partial)).decode()

    def save_figure(
        self,
        path: str | os.PathLike[str],
        plot: str = "profile",
        theme: str = "light",
        *,
        size: str = "page",
        step: int | str | None = None,
        partial: bool = False,
        **look: Unpack[calls.Look],
    ) -> pathlib.Path:
        """The same as a file, of the kind that its name ends with: .svg, .png (300 dots to an inch) or .pdf."""
        ending = calls.figure_ending(path)
        return write(path, self._client._send(calls.plot(self.id, plot, ending, theme, size, step, look, partial)))


class Result(Summary):
    """A solution, or with `partial` the last state of an iteration that did not end.

    `verdict` says how far it can be trusted, `reasons` and `warnings` why. Forces and peaks are numbers with their
    errors. `profile()`, `history` and `fields()` are arrays, fetched when they are asked for.
    """

    def __init__(self, client: Client, job: Job, document: Mapping[str, Any]) -> None:
        super().__init__(document, document.get("result_available") == "partial")
        self._client = client
        self.job = job

    def profile(
        self, boundary: str | None = None, *, step: int | str | None = None, points: int | str | None = None
    ) -> Profile:
        """Stresses and displacements along a contact.

        boundary: name of the contact's boundary; may be left out if there is only one
        step: load step by its name or its number from 0; absent: the last
        points: `nodes`, `friction` (where friction acts) or a number of evenly spaced ones; absent: nodes, friction
            points and the peaks
        """
        name = self._boundary(boundary)
        found = self._client._send(calls.profile(self.job.id, name, step, points, self.partial))
        about = self._about(step)
        # a step that has ended is what it is, whatever became of the next one
        partial = self.partial and about.get("step") is None
        return Profile(**known(Profile, found), boundary=name, about=about, partial=partial)

    @functools.cached_property
    def history(self) -> History:
        """A row for each iteration."""
        found = self._client._send(calls.history(self.job.id, None, self.partial))
        return History(**known(History, found), about=self.about, partial=self.partial)

    def fields(self) -> Fields:
        """Displacements and stresses of the whole body."""
        found = self._client._send(calls.fields(self.job.id, self.partial))
        profiles = {name: self.profile(name, points="nodes") for name in obstacles(self._problem)}
        return Fields(**known(Fields, found), profiles=profiles, about=self.about, partial=self.partial)

    def save_vtu(self, path: str | os.PathLike[str]) -> pathlib.Path:
        """Writes the fields for ParaView, completely or not at all."""
        return write(path, self._client._send(calls.vtu(self.job.id, self.partial)))

    def save(self, path: str | os.PathLike[str], *, fields: bool = True) -> pathlib.Path:
        """Writes all of it to a file, which `Result.open` reads without the service: numbers, problem, history, the
        profiles of each contact and load step.

        fields: displacements and stresses of the whole body, too
        """
        steps = [str(step["name"]) for step in self.steps]
        wanted = requests(self.job.id, self.job.input_hash, self.summary, steps, fields, self.partial)
        answers = {key(call): self._client._send(calls.unread(call)) for call in wanted}
        return write(path, packed(self.job.id, answers))

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Result:
        """A result from a file that `save` has written. Raises `SignoriniError` for another file, and later for what is
        not in it."""
        saved = Saved(path)
        client = cast("Client", saved)
        job = Job(client, saved._send(calls.job(saved.job)))
        return cls(client, job, saved._send(calls.result(job.id, True, job.input_hash)))

    def plot_profile(self, boundary: str | None = None, *, step: int | str | None = None, **options: Any) -> Figure:
        """Draws the stresses along a contact, at the end of a load step; see `signorini.figures.profile`."""
        return self.profile(boundary, step=step).plot(**options)

    @functools.cached_property
    def about(self) -> Mapping[str, Any]:
        """What a figure says besides its curves: title, parameters, verdict, units."""
        return self._about()

    def _about(self, step: int | str | None = None) -> Mapping[str, Any]:
        return about(self, self._problem, step)

    @functools.cached_property
    def _problem(self) -> Mapping[str, Any]:
        return self._client._send(calls.problem(self.job.id))

    def _repr_html_(self) -> str:
        return _html.result(self)
