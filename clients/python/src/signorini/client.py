"""The client: jobs, sweeps and meshes of a service, over blocking connections."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

import httpx

from . import _calls as calls
from ._answer import check_events
from ._calls import Call, MeshSource, Submission
from ._connection import Connection, request_arguments, stream_arguments
from ._data import Event, StoredMesh, Validation
from ._events import Cursor
from ._pool import Pool
from ._retry import BROKEN, LOG, Attempts
from ._table import JobTable
from .errors import NotFound
from .job import Job
from .local import LocalServer
from .problem import Problem
from .sweep import Sweep

if TYPE_CHECKING:
    from typing_extensions import Unpack

T = TypeVar("T")


class Client:
    """A connection to a service.

    url: its address; absent: the environment variable SIGNORINI_URL, or http://127.0.0.1:8080
    token: who you are; absent: SIGNORINI_TOKEN
    ca: for https, a file with the certificate of the authority that has signed the service's, if the machine does not
        know it; absent: SIGNORINI_CA
    retry_for: seconds for which a request is repeated while the service cannot be reached or is busy; only requests
        that cannot do anything twice are repeated

    A client may be used by several threads at once, and in processes that are forked or are given a pickle of it, of a
    job or of a result. It is closed by `close()`, or at the end of a `with` block.
    Every method raises an `ApiError` where the service refuses, and `ConnectionLost` where it cannot be reached.
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
        self._http = Pool(self._connection.settings())

    @property
    def url(self) -> str:
        return self._connection.url

    def __getstate__(self) -> dict[str, Any]:
        """For pickles and copies, which have connections of their own, and the service of this one, if it has one, as
        long as that runs."""
        return {name: value for name, value in vars(self).items() if name not in ("_http", "_server")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _http=Pool(state["_connection"].settings()), _server=None)

    @classmethod
    def local(
        cls,
        data: str | os.PathLike[str] | None = None,
        *,
        binary: str | os.PathLike[str] | None = None,
        workers: int | None = None,
        options: Sequence[str] = (),
    ) -> Client:
        """A service of one's own, which starts now and stops with this client, or at the end of the program.

        data: folder of its store; absent: a temporary one, so that its jobs are gone with it
        binary: the program; absent: the environment variable SIGNORINI_BINARY, the program that was installed with this
            package, or `signorini` in PATH
        workers: how many jobs it solves at the same time
        options: further options of `signorini serve`, other than --listen, --data and --workers
        """
        server = LocalServer(data, binary=binary, workers=workers, options=options)
        client = cls(server.start(), token="", ca="")
        client._server, client._ends_with_program = server, server.temporary
        return client

    def close(self) -> None:
        """Closes the connection, and stops a service of one's own."""
        self._http.close()
        if self._server is not None:
            self._server.stop()

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Client {self.url}>"

    # Jobs

    def submit(
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
    ) -> Job:
        """Submits a job. When this returns, the job is stored, and will be solved whatever happens to this program.

        The arguments are those of `Submission`. Raises `InvalidProblem` with everything that is wrong.
        """
        submission = Submission(problem, name, labels or {}, priority, timeout_s, queue_ttl_s, cache, key)
        return Job(self, self._send(calls.submit(submission)))

    def submit_many(
        self, problems: Iterable[Problem | Mapping[str, Any] | Submission], *, key: str | None = None
    ) -> list[Job]:
        """Submits up to 1000 jobs, all or none of them. `Submission(problem, name=…)` gives a job its name."""
        documents = self._send(calls.submit_many(calls.submissions(problems), key))
        return [Job(self, document) for document in documents]

    def job(self, id: str) -> Job:
        """A job by its id: from another machine, or the next day."""
        return Job(self, self._send(calls.job(id)))

    def jobs(self, **filters: Unpack[calls.Listing]) -> Iterator[Job]:
        """The jobs that match all filters, newest first; pages are fetched as they are needed.

        Filters: `status` (one or several), `labels` (a dictionary), `name`, `owner`, `sweep`, `input_hash`,
        `created_after`, `created_before`, `finished_after`, `finished_before`; also `order_by` and `page_size`.
        """
        params = calls.filters(**filters)
        token: str | None = ""
        while token is not None:
            page = self._send(calls.jobs(params, token))
            yield from (Job(self, document) for document in page["jobs"])
            token = page.get("next_page_token") or None

    def table(
        self, columns: Sequence[str] | None = None, *, partial: bool = False, **filters: Unpack[calls.Listing]
    ) -> JobTable:
        """The jobs that match all filters of `jobs`, and the numbers of their results, as one table; all pages of it.

        columns: names of columns: those of a job, `label.KEY`, `normal_force`, `normal_force.BOUNDARY`,
            `normal_force_error`, …; absent: the most important ones
        partial: whether the table also has the numbers of jobs that failed or were canceled, which are those of the
            state at which they stopped

        Raises `BadRequest` with all columns that there are for one that does not exist.
        """
        params = calls.filters(**filters)
        names: list[str] = []
        rows: list[Mapping[str, Any]] = []
        token: str | None = ""
        while token is not None:
            page = self._send(calls.job_table(params, columns, partial, token))
            names = page["columns"]
            rows += page["rows"]
            token = page.get("next_page_token") or None
        return JobTable(names, rows)

    def count(self, *, group_by: str | None = None, **filters: Unpack[calls.Filters]) -> Mapping[str, Any]:
        """How many jobs match the filters of `jobs`; by `group_by` also of each status, name, …"""
        return self._send(calls.count(calls.filters(**filters, group_by=group_by)))

    def cancel_jobs(self, **filters: Unpack[calls.Filters]) -> Mapping[str, int]:
        """Asks all jobs that match the filters of `jobs` to stop: `{"matched", "changed"}`."""
        return self._send(calls.cancel_jobs(calls.filters(**filters)))

    def delete_jobs(self, **filters: Unpack[calls.Filters]) -> Mapping[str, int]:
        """Deletes all jobs that match the filters of `jobs` and have ended: `{"matched", "changed"}`."""
        before = self._send(calls.count(calls.filters(**filters, group_by="status")))
        return self._send(calls.delete_jobs(calls.filters(**filters), before))

    def validate(self, problem: Problem | Mapping[str, Any]) -> Validation:
        """Everything that is wrong with a problem, and what solving it would cost; stores nothing."""
        return self._send(calls.validate(problem))

    # Sweeps

    def sweep(
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
    ) -> Sweep:
        """Submits one problem with many values, or finds a sweep again by its id.

        axes: values by dotted name or JSON Pointer, `{"contacts.0.friction.coefficient": [0.1, 0.2]}`, with lists,
            arrays, `linspace(…)` or `logspace(…)`; or a list of such dictionaries, one for each member
        mode: with `grid` every combination is a member, with `zip` the values belong together, one of each axis
        """
        if isinstance(base, str):
            return Sweep(self, self._send(calls.sweep(base)))
        if axes is None:
            raise TypeError("a new sweep needs its axes")
        envelope = calls._envelope(name, labels, priority, timeout_s, queue_ttl_s)
        return Sweep(self, self._send(calls.submit_sweep(base, axes, mode, envelope, key)))

    def sweeps(self) -> Iterator[Sweep]:
        """All sweeps, newest first."""
        token: str | None = ""
        while token is not None:
            page = self._send(calls.sweeps(token))
            yield from (Sweep(self, document) for document in page["sweeps"])
            token = page.get("next_page_token") or None

    # Meshes

    def upload_mesh(self, source: MeshSource) -> StoredMesh:
        """Stores a mesh once, for many jobs: `Problem(mesh=MeshInput(stored=mesh.hash), …)`.

        source: path of a file of Gmsh, Abaqus or CalculiX; its content; or an inline mesh, as from
            `signorini.mesh.from_meshio`
        """
        return self._send(calls.upload_mesh(source))

    def mesh(self, hash: str) -> StoredMesh:
        return self._send(calls.mesh(hash))

    def meshes(self) -> Iterator[StoredMesh]:
        """All stored meshes, newest first."""
        token: str | None = ""
        while token is not None:
            page = self._send(calls.meshes(token))
            yield from (StoredMesh.from_json(document) for document in page["meshes"])
            token = page.get("next_page_token") or None

    def delete_mesh(self, hash: str) -> None:
        self._send(calls.delete_mesh(hash))

    # The service

    def info(self) -> Mapping[str, Any]:
        """Version and limits of the service."""
        return self._send(calls.info())

    def me(self) -> Mapping[str, Any]:
        """Who you are to the service, what you may do, and your share of the queue."""
        return self._send(calls.me())

    def queue(self) -> Mapping[str, Any]:
        return self._send(calls.queue())

    def pause_queue(self) -> Mapping[str, Any]:
        """Starts no more jobs until the queue is resumed; for administrators."""
        return self._send(calls.pause_queue())

    def resume_queue(self) -> Mapping[str, Any]:
        return self._send(calls.resume_queue())

    def explain(self, code: str) -> Mapping[str, Any]:
        """What the code of an error or of a warning, or the reason of a failed job, means, and what to do."""
        try:
            return self._send(calls.explain("errors", code.replace("_", "-")))
        except NotFound:
            return self._send(calls.explain("warnings", code.replace("-", "_")))

    # Sending

    def _send(self, call: Call[T], deadline: float | None = None, tell: Callable[[str], None] = LOG.warning) -> T:
        """Sends a request, again where that is safe, and reads the answer.

        deadline: of `time.monotonic`; then `Late` is raised, whatever the service or the network does
        """
        attempts = Attempts(call.repeatable, self.retry_for, tell=tell, deadline=deadline, address=self.url)
        while True:
            try:
                response = self._http.call(request_arguments(call), deadline)
                pause = attempts.after_answer(response)
                if pause is None:
                    return call.read(response, attempts.failures + 1)
            except BROKEN as error:
                pause = attempts.after_error(error)
            time.sleep(pause)

    def _events(self, path: str, id: str, after_seq: int) -> Iterator[Event]:
        """The events at a path, each once, over as many connections as it takes."""
        cursor = Cursor(after_seq, id)
        attempts = Attempts(True, self.retry_for, address=self.url)
        while not cursor.done:
            try:
                with self._http.stream(stream_arguments(path, cursor.headers())) as stream:
                    if stream.response.status_code != 200:
                        stream.read()
                    pause = attempts.after_answer(stream.response)
                    if pause is None:
                        if not check_events(stream.response, cursor.seq):
                            return
                        for content in stream.pieces():
                            attempts.succeeded()
                            yield from cursor.read(content)
                            if cursor.done:
                                return
                        # the service stopped in good order; what is missing comes from the next one
                        raise httpx.ReadError("the stream ended", request=stream.response.request)
            except BROKEN as error:
                pause = attempts.after_error(error)
            time.sleep(pause)
