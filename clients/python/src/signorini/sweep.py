"""A sweep: one problem with many values, solved together, read as one table."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from . import _calls as calls
from ._data import Event
from ._progress import Waiting, goes_on
from ._sweep import TABLE_S, Member, SweepTable, SweepView, about_table
from .errors import SignoriniError
from .job import Job

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from .client import Client


class Sweep(SweepView):
    """A sweep of the service, as it was when it was last asked."""

    def __init__(self, client: Client, document: Mapping[str, Any]) -> None:
        super().__init__(document)
        self._client = client

    def refresh(self) -> Sweep:
        self.document = self._client._send(calls.sweep(self.id))
        return self

    def wait(self, timeout: float | None = None, progress: bool = True) -> Sweep:
        """Waits until all members have ended, solved or not: the table says which.

        Arguments are those of `Job.wait`; Ctrl-C detaches. With `progress` it tells in the end how many members have no
        solution, or one with warnings.
        """
        back = goes_on("sweep", f"client.sweep({self.id!r}).wait()", self._client._ends_with_program)
        waiting = Waiting(self.title, timeout, progress, back, self._card)
        try:
            while not self.ended:
                call = calls.sweep(self.id, waiting.seconds())
                with waiting.in_time():
                    self.document = self._client._send(call, waiting.deadline, waiting.note)
                waiting.seen(self.status, self.line(), self.ended)
        except KeyboardInterrupt:
            waiting.detached()
            raise
        finally:
            waiting.close()
        if progress and not self._told:
            self._told = True
            # the sweep has ended, whatever becomes of this
            with contextlib.suppress(SignoriniError):
                waiting.tell(self._table(waiting.soon(TABLE_S)).hinted_notes())
        return self

    def table(self) -> SweepTable:
        """The table as it is now; it fills while the sweep runs."""
        table = self._table()
        if self._of_table is None:
            # without units a table is what it is
            with contextlib.suppress(SignoriniError):
                page = self._client._send(calls.jobs_of_sweep(self.id))
                for job in page["jobs"]:
                    self._of_table = about_table(self._client._send(calls.problem(job["id"])))
        table.about = self._of_table or {}
        return table

    def _table(self, deadline: float | None = None) -> SweepTable:
        return SweepTable(self._client._send(calls.sweep_table(self.id), deadline), self.title)

    def plot(self, quantity: str, **options: Any) -> Figure:
        """Draws a column of the table over the parameters; see `signorini.figures.sweep`."""
        return self.table().plot(quantity, **options)

    def to_pandas(self) -> pandas.DataFrame:
        """The table as one of pandas (`pip install signorini[pandas]`)."""
        return self.table().to_pandas()

    def members(self) -> Iterator[SweepMember]:
        """The members by number."""
        token: str | None = ""
        while token is not None:
            page = self._client._send(calls.sweep_members(self.id, token))
            yield from (SweepMember(self, row) for row in page["members"])
            token = page.get("next_page_token") or None

    def member(self, number: int) -> SweepMember:
        """A member by its number from 0, in the order of the definition (the last axis runs fastest)."""
        for member in self.members():
            if member.number == number:
                return member
        raise IndexError(f"the sweep has members 0 to {len(self) - 1}")

    def events(self, after_seq: int = 0) -> Iterator[Event]:
        """The rows of members as they end, past ones first; see `Job.events`."""
        return self._client._events(calls._sweep(self.id) + "/events", self.id, after_seq)

    def jobs(self) -> Iterator[Job]:
        """The jobs that solve it: one for all members on the same body."""
        return self._client.jobs(sweep=self.id)

    def cancel(self) -> Sweep:
        """Asks all its jobs to stop; the rows that it has are kept."""
        self.document = self._client._send(calls.cancel_sweep(self.id))
        return self

    def delete(self) -> None:
        """Deletes a sweep that has ended, with its jobs and rows."""
        self._client._send(calls.delete_sweep(self.id))


class SweepMember(Member):
    """A member, which can be solved as a job of its own."""

    def __init__(self, sweep: Sweep, row: Mapping[str, Any]) -> None:
        super().__init__(row)
        self._sweep = sweep

    def job(self) -> Job:
        """Submits it as a job, for its profile, fields, history, verdict, and the errors of its numbers."""
        client = self._sweep._client
        return Job(client, client._send(calls.member_job(self._sweep.id, self.number)))
