"""The client with asyncio: the same names, awaited.

Requests, answers, decisions about repetition, events, progress and data are those of the other client; only sending
and waiting are written here once more.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import pathlib
from collections.abc import AsyncIterator, Callable, Iterable, Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar, cast

import httpx

from . import _calls as calls
from . import _html
from ._about import about, obstacles
from ._answer import check_events
from ._calls import Call, MeshSource, Submission
from ._connection import Connection, request_arguments, stream_arguments
from ._data import Event, Fields, History, Profile, StoredMesh, Summary, Validation, known
from ._events import Cursor
from ._job import JobView, changes
from ._pool import AsyncPool
from ._progress import Waiting, goes_on
from ._retry import BROKEN, LOG, Attempts
from ._saved import AsyncSaved, key, packed, requests, write
from ._sweep import TABLE_S, Member, SweepTable, SweepView, about_table
from ._table import JobTable
from .errors import NotFound, SignoriniError
from .local import LocalServer
from .problem import Problem

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure
    from typing_extensions import Unpack

T = TypeVar("T")


class AsyncClient:
    """A connection to a service, for asyncio; see `Client`. It is closed by `aclose()` or `async with`.

    It may be used in one event loop after the other, and in several threads, each with a loop of its own.
    """

    def __init__(
        self,
        url: str | None = None,
        token: str | None = None,
        *,
        ca: str | os.PathLike[str] | None = None,
        retry_for: float = 60.0,
    ) -> None:
        self._connection = Connection.of(url, token, ca)
        self.retry_for = retry_for
        self._server: LocalServer | None = None
        self._ends_with_program = False
        self._http = AsyncPool(self._connection.settings())

    @property
    def url(self) -> str:
        return self._connection.url

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in ("_http", "_server")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _http=AsyncPool(state["_connection"].settings()), _server=None)

    @classmethod
    def local(
        cls,
        data: str | os.PathLike[str] | None = None,
        *,
        binary: str | os.PathLike[str] | None = None,
        workers: int | None = None,
        options: Sequence[str] = (),
    ) -> AsyncClient:
        """A service of one's own; see `Client.local`."""
        server = LocalServer(data, binary=binary, workers=workers, options=options)
        client = cls(server.start(), token="", ca="")
        client._server, client._ends_with_program = server, server.temporary
        return client

    async def aclose(self) -> None:
        await self._http.aclose()
        if self._server is not None:
            await asyncio.to_thread(self._server.stop)

    async def __aenter__(self) -> AsyncClient:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.aclose()

    def __repr__(self) -> str:
        return f"<AsyncClient {self.url}>"

    # Jobs

    async def submit(
        self,
        problem: Problem | Mapping[str, Any],
        *,
        name: str | None = None,
        labels: Mapping[str, object] | None = None,
        priority: int | None = None,
        timeout_s: float | None = None,
        queue_ttl_s: float | None = None,
        cache: str | None = None,
        key: str | None = None,
    ) -> AsyncJob:
        submission = Submission(problem, name, labels or {}, priority, timeout_s, queue_ttl_s, cache, key)
        return AsyncJob(self, await self._send(calls.submit(submission)))

    async def submit_many(
        self, problems: Iterable[Problem | Mapping[str, Any] | Submission], *, key: str | None = None
    ) -> list[AsyncJob]:
        documents = await self._send(calls.submit_many(calls.submissions(problems), key))
        return [AsyncJob(self, document) for document in documents]

    async def job(self, id: str) -> AsyncJob:
        return AsyncJob(self, await self._send(calls.job(id)))

    async def jobs(self, **filters: Unpack[calls.Listing]) -> AsyncIterator[AsyncJob]:
        """The jobs that match all filters, which are those of `Client.jobs`."""
        params = calls.filters(**filters)
        token: str | None = ""
        while token is not None:
            page = await self._send(calls.jobs(params, token))
            for document in page["jobs"]:
                yield AsyncJob(self, document)
            token = page.get("next_page_token") or None

    async def table(
        self, columns: Sequence[str] | None = None, *, partial: bool = False, **filters: Unpack[calls.Listing]
    ) -> JobTable:
        """The jobs and the numbers of their results as one table; see `Client.table`."""
        params = calls.filters(**filters)
        names: list[str] = []
        rows: list[Mapping[str, Any]] = []
        token: str | None = ""
        while token is not None:
            page = await self._send(calls.job_table(params, columns, partial, token))
            names = page["columns"]
            rows += page["rows"]
            token = page.get("next_page_token") or None
        return JobTable(names, rows)

    async def count(self, *, group_by: str | None = None, **filters: Unpack[calls.Filters]) -> Mapping[str, Any]:
        return await self._send(calls.count(calls.filters(**filters, group_by=group_by)))

    async def cancel_jobs(self, **filters: Unpack[calls.Filters]) -> Mapping[str, int]:
        return await self._send(calls.cancel_jobs(calls.filters(**filters)))

    async def delete_jobs(self, **filters: Unpack[calls.Filters]) -> Mapping[str, int]:
        before = await self._send(calls.count(calls.filters(**filters, group_by="status")))
        return await self._send(calls.delete_jobs(calls.filters(**filters), before))

    async def validate(self, problem: Problem | Mapping[str, Any]) -> Validation:
        return await self._send(calls.validate(problem))

    # Sweeps

    async def sweep(
        self,
        base: Problem | Mapping[str, Any] | str,
        axes: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None = None,
        *,
        mode: str = "grid",
        name: str | None = None,
        labels: Mapping[str, object] | None = None,
        priority: int | None = None,
        timeout_s: float | None = None,
        queue_ttl_s: float | None = None,
        key: str | None = None,
    ) -> AsyncSweep:
        """Submits a sweep, or finds it again by its id; see `Client.sweep`."""
        if isinstance(base, str):
            return AsyncSweep(self, await self._send(calls.sweep(base)))
        if axes is None:
            raise TypeError("a new sweep needs its axes")
        envelope = calls._envelope(name, labels, priority, timeout_s, queue_ttl_s)
        return AsyncSweep(self, await self._send(calls.submit_sweep(base, axes, mode, envelope, key)))

    async def sweeps(self) -> AsyncIterator[AsyncSweep]:
        token: str | None = ""
        while token is not None:
            page = await self._send(calls.sweeps(token))
            for document in page["sweeps"]:
                yield AsyncSweep(self, document)
            token = page.get("next_page_token") or None

    # Meshes

    async def upload_mesh(self, source: MeshSource) -> StoredMesh:
        return await self._send(calls.upload_mesh(source))

    async def mesh(self, hash: str) -> StoredMesh:
        return await self._send(calls.mesh(hash))

    async def meshes(self) -> AsyncIterator[StoredMesh]:
        token: str | None = ""
        while token is not None:
            page = await self._send(calls.meshes(token))
            for document in page["meshes"]:
                yield StoredMesh.from_json(document)
            token = page.get("next_page_token") or None

    async def delete_mesh(self, hash: str) -> None:
        await self._send(calls.delete_mesh(hash))

    # The service

    async def info(self) -> Mapping[str, Any]:
        return await self._send(calls.info())

    async def me(self) -> Mapping[str, Any]:
        return await self._send(calls.me())

    async def queue(self) -> Mapping[str, Any]:
        return await self._send(calls.queue())

    async def pause_queue(self) -> Mapping[str, Any]:
        return await self._send(calls.pause_queue())

    async def resume_queue(self) -> Mapping[str, Any]:
        return await self._send(calls.resume_queue())

    async def explain(self, code: str) -> Mapping[str, Any]:
        try:
            return await self._send(calls.explain("errors", code.replace("_", "-")))
        except NotFound:
            return await self._send(calls.explain("warnings", code.replace("-", "_")))

    # Sending

    async def _send(self, call: Call[T], deadline: float | None = None, tell: Callable[[str], None] = LOG.warning) -> T:
        attempts = Attempts(call.repeatable, self.retry_for, tell=tell, deadline=deadline, address=self.url)
        while True:
            try:
                response = await self._http.call(request_arguments(call), deadline, call.wait_s > 0)
                pause = attempts.after_answer(response)
                if pause is None:
                    return call.read(response, attempts.failures + 1)
            except BROKEN as error:
                pause = attempts.after_error(error)
            await asyncio.sleep(pause)

    async def _events(self, path: str, id: str, after_seq: int) -> AsyncIterator[Event]:
        cursor = Cursor(after_seq, id)
        attempts = Attempts(True, self.retry_for, address=self.url)
        while not cursor.done:
            try:
                async with self._http.stream(stream_arguments(path, cursor.headers())) as stream:
                    if stream.response.status_code != 200:
                        await stream.read()
                    pause = attempts.after_answer(stream.response)
                    if pause is None:
                        if not check_events(stream.response, cursor.seq):
                            return
                        async for content in stream.pieces():
                            attempts.succeeded()
                            for event in cursor.read(content):
                                yield event
                            if cursor.done:
                                return
                        raise httpx.ReadError("the stream ended", request=stream.response.request)
            except BROKEN as error:
                pause = attempts.after_error(error)
            await asyncio.sleep(pause)


class AsyncJob(JobView):
    """A job of the service; see `Job`."""

    def __init__(self, client: AsyncClient, document: Mapping[str, Any]) -> None:
        super().__init__(document)
        self._client = client

    async def refresh(self) -> AsyncJob:
        self.document = await self._client._send(calls.job(self.id))
        return self

    async def wait(self, timeout: float | None = None, progress: bool = True) -> AsyncResult:
        """Waits until the job has ended, and returns its result; see `Job.wait`. It can be canceled like any task,
        and the job goes on."""
        back = goes_on("job", f"await (await client.job({self.id!r})).wait()", self._client._ends_with_program)
        waiting = Waiting(self.title, timeout, progress, back, self._card)
        try:
            while not self.ended:
                call = calls.job(self.id, waiting.seconds(self._client._http.crowded()))
                with waiting.in_time():
                    self.document = await self._client._send(call, waiting.deadline, waiting.note)
                waiting.seen(self.status, self.line(), self.ended, self._residual())
        except asyncio.CancelledError:  # which is also what Ctrl-C becomes, and what a time-out of asyncio does
            if progress:
                waiting.detached()
            raise
        finally:
            waiting.close()
        return await self.result()

    def events(self, after_seq: int = 0) -> AsyncIterator[Event]:
        """All events of the job, each once and in its order; see `Job.events`."""
        return self._client._events(calls._job(self.id) + "/events", self.id, after_seq)

    async def cancel(self) -> AsyncJob:
        self.document = (await self._client._send(calls.cancel(self.id)))["job"]
        return self

    async def retry(
        self, *, timeout_s: float | None = None, queue_ttl_s: float | None = None, priority: int | None = None
    ) -> AsyncJob:
        document = await self._client._send(calls.retry(self.id, timeout_s, queue_ttl_s, priority))
        return AsyncJob(self._client, document)

    async def edit(self, **values: Any) -> AsyncJob:
        self.document = await self._client._send(calls.edit(self.id, changes(values)))
        return self

    async def delete(self) -> None:
        await self._client._send(calls.delete(self.id))

    async def problem(self) -> Problem:
        return Problem.from_dict(await self.problem_document())

    async def problem_document(self) -> Mapping[str, Any]:
        return await self._client._send(calls.problem(self.id))

    async def result(self, partial: bool = False) -> AsyncResult:
        """The result; see `Job.result`."""
        if not self.ended:
            await self.refresh()
        if not partial:
            self.raise_for_status()
        document = await self._client._send(calls.result(self.id, partial, self.input_hash))
        return AsyncResult(self._client, self, document)

    async def svg(
        self,
        plot: str,
        theme: str = "light",
        *,
        size: str = "page",
        step: int | str | None = None,
        partial: bool = False,
        **look: Unpack[calls.Look],
    ) -> str:
        found = await self._client._send(calls.plot(self.id, plot, "svg", theme, size, step, look, partial))
        return found.decode()

    async def save_figure(
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
        ending = calls.figure_ending(path)
        return write(
            path, await self._client._send(calls.plot(self.id, plot, ending, theme, size, step, look, partial))
        )


class AsyncResult(Summary):
    """A solution, or the last state of an iteration that did not end; see `Result`."""

    def __init__(self, client: AsyncClient, job: AsyncJob, document: Mapping[str, Any]) -> None:
        super().__init__(document, document.get("result_available") == "partial")
        self._client = client
        self._problem: Mapping[str, Any] | None = None
        self.job = job

    async def profile(
        self, boundary: str | None = None, *, step: int | str | None = None, points: int | str | None = None
    ) -> Profile:
        name = self._boundary(boundary)
        found = await self._client._send(calls.profile(self.job.id, name, step, points, self.partial))
        about = await self.about(step)
        partial = self.partial and about.get("step") is None
        return Profile(**known(Profile, found), boundary=name, about=about, partial=partial)

    async def history(self) -> History:
        found = await self._client._send(calls.history(self.job.id, None, self.partial))
        return History(**known(History, found), about=await self.about(), partial=self.partial)

    async def fields(self) -> Fields:
        found = await self._client._send(calls.fields(self.job.id, self.partial))
        about = await self.about()
        profiles = {name: await self.profile(name, points="nodes") for name in obstacles(self._problem or {})}
        return Fields(**known(Fields, found), profiles=profiles, about=about, partial=self.partial)

    async def save_vtu(self, path: str | os.PathLike[str]) -> pathlib.Path:
        return write(path, await self._client._send(calls.vtu(self.job.id, self.partial)))

    async def save(self, path: str | os.PathLike[str], *, fields: bool = True) -> pathlib.Path:
        """Writes all of it to a file; see `Result.save`."""
        steps = [str(step["name"]) for step in self.steps]
        wanted = requests(self.job.id, self.job.input_hash, self.summary, steps, fields, self.partial)
        return write(
            path, packed(self.job.id, {key(call): await self._client._send(calls.unread(call)) for call in wanted})
        )

    @classmethod
    async def open(cls, path: str | os.PathLike[str]) -> AsyncResult:
        """A result from a file; see `Result.open`."""
        saved = AsyncSaved(path)
        client = cast("AsyncClient", saved)
        job = AsyncJob(client, await saved._send(calls.job(saved.job)))
        return cls(client, job, await saved._send(calls.result(job.id, True, job.input_hash)))

    async def plot_profile(
        self, boundary: str | None = None, *, step: int | str | None = None, **options: Any
    ) -> Figure:
        return (await self.profile(boundary, step=step)).plot(**options)

    async def about(self, step: int | str | None = None) -> Mapping[str, Any]:
        if self._problem is None:
            self._problem = await self._client._send(calls.problem(self.job.id))
        return about(self, self._problem, step)

    def _repr_html_(self) -> str:
        return _html.result(self)


class AsyncSweep(SweepView):
    """A sweep of the service; see `Sweep`."""

    def __init__(self, client: AsyncClient, document: Mapping[str, Any]) -> None:
        super().__init__(document)
        self._client = client

    async def refresh(self) -> AsyncSweep:
        self.document = await self._client._send(calls.sweep(self.id))
        return self

    async def wait(self, timeout: float | None = None, progress: bool = True) -> AsyncSweep:
        back = goes_on("sweep", f"await (await client.sweep({self.id!r})).wait()", self._client._ends_with_program)
        waiting = Waiting(self.title, timeout, progress, back, self._card)
        try:
            while not self.ended:
                call = calls.sweep(self.id, waiting.seconds(self._client._http.crowded()))
                with waiting.in_time():
                    self.document = await self._client._send(call, waiting.deadline, waiting.note)
                waiting.seen(self.status, self.line(), self.ended)
        except asyncio.CancelledError:
            if progress:
                waiting.detached()
            raise
        finally:
            waiting.close()
        if progress and not self._told:
            self._told = True
            # the sweep has ended, whatever becomes of this
            with contextlib.suppress(SignoriniError):
                waiting.tell((await self._table(waiting.soon(TABLE_S))).hinted_notes())
        return self

    async def table(self) -> SweepTable:
        table = await self._table()
        if self._of_table is None:
            with contextlib.suppress(SignoriniError):
                page = await self._client._send(calls.jobs_of_sweep(self.id))
                for job in page["jobs"]:
                    self._of_table = about_table(await self._client._send(calls.problem(job["id"])))
        table.about = self._of_table or {}
        return table

    async def _table(self, deadline: float | None = None) -> SweepTable:
        return SweepTable(await self._client._send(calls.sweep_table(self.id), deadline), self.title)

    async def plot(self, quantity: str, **options: Any) -> Figure:
        return (await self.table()).plot(quantity, **options)

    async def to_pandas(self) -> pandas.DataFrame:
        return (await self.table()).to_pandas()

    async def members(self) -> AsyncIterator[AsyncMember]:
        token: str | None = ""
        while token is not None:
            page = await self._client._send(calls.sweep_members(self.id, token))
            for row in page["members"]:
                yield AsyncMember(self, row)
            token = page.get("next_page_token") or None

    async def member(self, number: int) -> AsyncMember:
        async for member in self.members():
            if member.number == number:
                return member
        raise IndexError(f"the sweep has members 0 to {len(self) - 1}")

    def events(self, after_seq: int = 0) -> AsyncIterator[Event]:
        return self._client._events(calls._sweep(self.id) + "/events", self.id, after_seq)

    def jobs(self) -> AsyncIterator[AsyncJob]:
        return self._client.jobs(sweep=self.id)

    async def cancel(self) -> AsyncSweep:
        self.document = await self._client._send(calls.cancel_sweep(self.id))
        return self

    async def delete(self) -> None:
        await self._client._send(calls.delete_sweep(self.id))


class AsyncMember(Member):
    """A member of a sweep, which can be solved as a job of its own."""

    def __init__(self, sweep: AsyncSweep, row: Mapping[str, Any]) -> None:
        super().__init__(row)
        self._sweep = sweep

    async def job(self) -> AsyncJob:
        client = self._sweep._client
        return AsyncJob(client, await client._send(calls.member_job(self._sweep.id, self.number)))
