"""The result of a job: numbers with their errors at once, arrays when they are asked for."""

from __future__ import annotations

import functools
import os
import pathlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast

from . import _calls as calls
from ._about import about, obstacles
from ._data import Fields, History, Profile, Summary, known
from ._saved import Saved, key, packed, requests

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .client import Client
    from .job import Job


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
        found = self._client._send(calls.profile(self.job.id, name, step, points))
        about = self._about(step)
        # a step that has ended is what it is, whatever became of the next one
        partial = self.partial and about.get("step") is None
        return Profile(**known(Profile, found), boundary=name, about=about, partial=partial)

    @functools.cached_property
    def history(self) -> History:
        """A row for each iteration."""
        found = self._client._send(calls.history(self.job.id, None))
        return History(**known(History, found), about=self.about, partial=self.partial)

    def fields(self) -> Fields:
        """Displacements and stresses of the whole body."""
        found = self._client._send(calls.fields(self.job.id))
        profiles = {name: self.profile(name, points="nodes") for name in obstacles(self._problem)}
        return Fields(**known(Fields, found), profiles=profiles, about=self.about, partial=self.partial)

    def save_vtu(self, path: str | os.PathLike[str]) -> pathlib.Path:
        """Writes the fields for ParaView, completely or not at all."""
        return write(path, self._client._send(calls.vtu(self.job.id)))

    def save(self, path: str | os.PathLike[str], *, fields: bool = True) -> pathlib.Path:
        """Writes all of it to a file, which `Result.open` reads without the service: numbers, problem, history, the
        profiles of each contact and load step.

        fields: displacements and stresses of the whole body, too
        """
        steps = [str(step["name"]) for step in self.steps]
        wanted = requests(self.job.id, self.job.input_hash, self.summary, steps, fields)
        answers = {key(call): self._client._send(calls.unread(call)) for call in wanted}
        return write(path, packed(self.job.id, answers))

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Result:
        """A result from a file that `save` has written. Raises `SignoriniError` for another file, and later for what is
        not in it."""
        from .job import Job

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
        from . import _html

        return _html.result(self)


def write(path: str | os.PathLike[str], content: bytes) -> pathlib.Path:
    """Writes a file under another name first, so that what has the name is whole."""
    target = pathlib.Path(path)
    part = target.with_name(target.name + ".part")
    part.write_bytes(content)
    part.replace(target)
    return target
