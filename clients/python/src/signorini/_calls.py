"""Every request of the API: what is sent, and how the answer is read.

A `Call` is data; `Client` sends it with blocking sockets, `AsyncClient` with asyncio. So that is all in which the two
differ, and a request is written once.
"""

from __future__ import annotations

import dataclasses
import datetime
import json
import math
import os
import pathlib
import re
import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypedDict, TypeVar
from urllib.parse import quote

import httpx

from . import errors
from ._answer import FILES, JSON, NOTHING, NPZ, Kind, read, unexpected
from ._data import Array, StoredMesh, Validation
from ._parts import kinds_at, plain
from .errors import Violation
from .pointer import escape, to_pointer
from .problem import MeshInput, Problem

T = TypeVar("T", covariant=True)
Document = dict[str, Any]
Params = tuple[tuple[str, str], ...]

JOB = ("id", "status", "result_available")
"""What the service says of every job."""
ENDED = ("succeeded", "failed", "canceled")

LONGEST_WAIT_S = 20.0
"""How long the service is asked to hold back an answer: less than proxies usually allow."""


@dataclass(frozen=True)
class Call(Generic[T]):
    """A request, and how its answer is read.

    decode: what is made of what the answer says
    repeatable: sending it twice does no more than sending it once
    wait_s: the service may hold its answer back for so many seconds
    kind: what the body of the answer is
    about: id of the job or sweep that it is about, and so must be the answer
    gone: codes of errors that mean success once an earlier attempt may have done what was asked
    repeated: what is made of the answer then, where it differs
    """

    method: str
    path: str
    decode: Callable[[Any], T]
    params: Params = ()
    headers: Mapping[str, str] = field(default_factory=dict)
    content: bytes | None = None
    repeatable: bool = True
    wait_s: float = 0.0
    kind: Kind = JSON
    about: str = ""
    gone: tuple[str, ...] = ()
    repeated: Callable[[Any], T] | None = None

    def read(self, response: httpx.Response, attempt: int) -> T:
        """What the answer says. Raises an `ApiError` if it is an error, and what `_answer.read` raises."""
        try:
            found = read(response, self.kind, self.about)
        except errors.ApiError as error:
            if attempt > 1 and error.code in self.gone:
                return self.decode(None)
            raise
        try:
            return (self.repeated if attempt > 1 and self.repeated else self.decode)(found)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise unexpected(response, f"it lacks something: {error!r}") from error


def unread(call: Call[Any]) -> Call[tuple[str, bytes]]:
    """The same request, whose answer is checked but not read: its media type and content."""

    def keep(content: bytes) -> tuple[str, bytes]:
        call.decode(call.kind.read(content))
        return call.kind.media, content

    return dataclasses.replace(call, kind=Kind(call.kind.media, keep), decode=lambda found: found)


@dataclass
class Submission:
    """A problem, and how it is to be solved.

    labels: names and texts by which programs find the job again
    priority: −10 … 10; higher ones run first
    timeout_s: seconds that solving may take; queue_ttl_s: seconds that the job may wait before it
    cache: `use` (default) a result of the same problem, `refresh` it, or leave it `off`
    key: two submissions with the same key are one job, also if the program runs again; made up if absent.
        Jobs of `submit_many` have one key together, an argument of that
    """

    problem: Problem | Mapping[str, Any]
    name: str | None = None
    labels: Mapping[str, object] = field(default_factory=dict)
    priority: int | None = None
    timeout_s: float | None = None
    queue_ttl_s: float | None = None
    cache: str | None = None
    key: str | None = None

    def to_dict(self) -> Document:
        body = _envelope(self.name, self.labels, self.priority, self.timeout_s, self.queue_ttl_s)
        if self.cache is not None:
            body["cache"] = self.cache
        return {"problem": problem_document(self.problem), **body}


def _envelope(
    name: str | None,
    labels: Mapping[str, object] | None,
    priority: int | None,
    timeout_s: float | None,
    queue_ttl_s: float | None,
) -> Document:
    limits = {"timeout_s": timeout_s, "queue_ttl_s": queue_ttl_s}
    body = {
        "name": name,
        "labels": {str(key): str(value) for key, value in labels.items()} if labels else None,
        "priority": priority,
        "limits": {key: value for key, value in limits.items() if value is not None} or None,
    }
    return {key: plain(value) for key, value in body.items() if value is not None}


def problem_document(problem: Problem | Mapping[str, Any], defaults: bool = False) -> Document:
    """The problem as JSON. Raises `InvalidProblem` if it cannot be right.

    A `Problem` is checked again, since its fields may have been set after it was made. A dictionary is left to the
    service, which may know more than this client; only what JSON cannot express is found here.
    """
    document: Document = plain(problem, defaults)
    if isinstance(problem, Problem):
        Problem.from_dict(document)
    else:
        found: list[Violation] = []
        _find_non_json(document, "", found)
        if found:
            raise errors.invalid(found)
    return document


def _find_non_json(value: Any, pointer: str, found: list[Violation]) -> None:
    if isinstance(value, dict):
        for key, item in value.items():
            _find_non_json(item, f"{pointer}/{escape(key)}", found)
    elif isinstance(value, list):
        for number, item in enumerate(value):
            _find_non_json(item, f"{pointer}/{number}", found)
    elif isinstance(value, float):
        if not math.isfinite(value):
            found.append(Violation(pointer, "not_finite", repr(value), "a finite number"))
    elif not isinstance(value, (str, int, type(None))):
        found.append(Violation(pointer, "wrong_type", type(value).__name__, "a value of JSON"))


def _having(*names: str) -> Callable[[Document], Document]:
    """Reads a document that has these names, as what the service says of a thing always has."""

    def decode(document: Document) -> Document:
        for name in names:
            document[name]
        return document

    return decode


def _nothing(document: None) -> None:
    return None


def _of(id: str, *path: str) -> Callable[[Document], Document]:
    """Reads a document that has, at a place in it, the id that was asked for."""

    def decode(document: Document) -> Document:
        named: Any = document
        for name in path or ("id",):
            named = named[name]
        if named != id:
            raise ValueError(f"it is about {named}, not {id}")
        return document

    return decode


def _get(path: str, *names: str, params: Params = ()) -> Call[Document]:
    return Call("GET", path, _having(*names), params)


def _post(path: str, *names: str, body: Any = None, key: Any = None, params: Params = ()) -> Call[Document]:
    """A request that changes something. With a key it can be repeated: the service does it once."""
    headers = {"Content-Type": "application/json"} if body is not None else {}
    if key is not None:
        # letters that no header can have are written as in an address
        headers["Idempotency-Key"] = re.sub(r"[^ -~]+", lambda found: quote(found[0]), str(key))
    content = None if body is None else json.dumps(body, allow_nan=False, ensure_ascii=False).encode()
    return Call("POST", path, _having(*names), params, headers, content, repeatable=key is not None)


def new_key() -> str:
    return str(uuid.uuid4())


# Jobs


def submit(submission: Submission) -> Call[Document]:
    return _post("/v1/jobs", *JOB, body=submission.to_dict(), key=submission.key or new_key())


def submit_many(submissions: Sequence[Submission], key: str | None) -> Call[list[Document]]:
    if any(submission.key for submission in submissions):
        raise ValueError("jobs that are submitted together have one key: submit_many(…, key=…)")
    call = _post("/v1/jobs/batch", body={"jobs": [s.to_dict() for s in submissions]}, key=key or new_key())

    def decode(document: Document) -> list[Document]:
        if len(document["jobs"]) != len(submissions):
            raise ValueError(f"{len(document['jobs'])} jobs, not {len(submissions)}")
        return list(document["jobs"])

    return Call(call.method, call.path, decode, (), call.headers, call.content, True)


def job(id: str, wait_s: float | None = None) -> Call[Document]:
    """The job now or, with `wait_s`, when it has ended, at the latest after so many seconds."""
    params: Params = () if wait_s is None else (("wait", f"{wait_s:.3f}"), ("until", "terminal"))
    return Call("GET", _job(id), _of(id), params, wait_s=wait_s or 0.0)


def jobs(params: Params, page_token: str) -> Call[Document]:
    return _get("/v1/jobs", "jobs", params=params + _page(page_token))


def jobs_of_sweep(id: str) -> Call[Document]:
    """One of the jobs that solve a sweep."""
    return jobs((("sweep", id), ("page_size", "1")), "")


def job_table(params: Params, columns: Sequence[str] | None, partial: bool, page_token: str) -> Call[Document]:
    if columns is not None:
        params += (("columns", ",".join(columns)),)
    params += PARTIAL if partial else ()
    return _get("/v1/jobs/table", "columns", "rows", params=(("format", "json"), *params, *_page(page_token)))


def count(params: Params) -> Call[Document]:
    return _get("/v1/jobs/count", "total", params=params)


def cancel(id: str) -> Call[Document]:
    return Call("POST", _job(id) + "/cancel", _of(id, "job", "id"))


def cancel_jobs(params: Params) -> Call[Document]:
    return _post("/v1/jobs/cancel", "matched", "changed", params=params)


def delete_jobs(params: Params, before: Mapping[str, Any]) -> Call[Document]:
    """before: how many jobs there were, by their status: an attempt whose answer is lost leaves none to count"""
    ended = sum(before["groups"].get(status, 0) for status in ENDED)

    def repeated(document: Document) -> Document:
        return {
            **document,
            "matched": max(document["matched"], before["total"]),
            "changed": max(document["changed"], ended),
        }

    return Call("DELETE", "/v1/jobs", _having("matched", "changed"), params, repeated=repeated)


def retry(id: str, timeout_s: float | None, queue_ttl_s: float | None, priority: int | None) -> Call[Document]:
    limits = _envelope(None, None, priority, timeout_s, queue_ttl_s)
    call = _post(_job(id) + "/retry", body=limits or None, key=new_key())
    return dataclasses.replace(call, decode=_of(id, "parent"))


def edit(id: str, changes: Mapping[str, Any]) -> Call[Document]:
    headers = {"Content-Type": "application/merge-patch+json"}
    return Call("PATCH", _job(id), _of(id), headers=headers, content=json.dumps(plain(changes)).encode())


def delete(id: str) -> Call[None]:
    return Call("DELETE", _job(id), _nothing, kind=NOTHING, gone=("deleted",))


def problem(id: str) -> Call[Document]:
    return _get(_job(id) + "/problem", "mesh", "materials")


def result(id: str, partial: bool, input_hash: str) -> Call[Document]:
    def decode(document: Document) -> Document:
        found = document["summary"].get("input_hash") or input_hash
        if found != input_hash:
            raise ValueError(f"it is of the problem {found}, not {input_hash}")
        # while a job runs, the service has the last of its load steps that has ended
        if document["result_available"] == "partial" and not partial:
            detail = "what it has so far is partial: result(partial=True) returns that"
            raise errors.ResultNotReady("The job has not ended", code="result-not-ready", detail=detail)
        return document

    return Call("GET", _job(id) + "/result", decode)


PARTIAL: Params = (("partial", "true"),)
"""Asks for the state of a job without a solution; otherwise absent, since earlier services do not know it."""


def profile(
    id: str, boundary: str, step: int | str | None, points: int | str | None, partial: bool = False
) -> Call[dict[str, Array]]:
    params = [("format", "npz")]
    if step is not None:
        params.append(("step", str(step)))
    if points is not None:
        params.append(("points", str(points)))
    path = f"{_job(id)}/profiles/{quote(boundary, safe='')}"
    return _file(id, path, NPZ, tuple(params), partial)


def history(id: str, max_points: int | None, partial: bool = False) -> Call[dict[str, Array]]:
    params: Params = (("format", "npz"),)
    if max_points is not None:
        params += (("max_points", str(max_points)),)
    return _file(id, _job(id) + "/history", NPZ, params, partial)


def fields(id: str, partial: bool = False) -> Call[dict[str, Array]]:
    return _file(id, _job(id) + "/fields", NPZ, (("format", "npz"),), partial)


def vtu(id: str, partial: bool = False) -> Call[bytes]:
    return _file(id, _job(id) + "/fields", FILES["vtu"], (("format", "vtu"),), partial)


class Look(TypedDict, total=False):
    """How a figure that the service draws is to look, by the names of the query of `GET /v1/jobs/{id}/plots/{plot}`."""

    style: str
    """`full` (default), or `bare`: without title, parameters, verdict and warnings."""
    stress: str
    """Of `deformed`: `von_mises` (default), `xx`, `yy`, `zz`, `xy`."""
    xlim: Sequence[float]
    """Limits of an axis, two numbers."""
    ylim: Sequence[float]
    ylim_below: Sequence[float]
    """Of the lower panels of `profile` and `convergence`."""


def plot(
    id: str,
    name: str,
    ending: str,
    theme: str,
    size: str,
    step: int | str | None,
    look: Mapping[str, Any],
    partial: bool = False,
) -> Call[bytes]:
    unknown = look.keys() - Look.__annotations__
    if unknown:
        raise TypeError(f"no such option: {', '.join(sorted(unknown))}; there are {', '.join(Look.__annotations__)}")
    params: Params = (("theme", theme), ("size", size))
    if step is not None:
        params += (("step", str(step)),)
    for option, value in look.items():
        if value is not None:
            text = value if isinstance(value, str) else ",".join(repr(float(number)) for number in value)
            params += ((option, text),)
    return _file(id, f"{_job(id)}/plots/{quote(name, safe='')}.{ending}", FILES[ending], params, partial)


def _file(id: str, path: str, kind: Kind, params: Params, partial: bool = False) -> Call[Any]:
    params += PARTIAL if partial else ()
    # compressed, it has no length by which to tell that it is whole
    headers = {"Accept": kind.media, "Accept-Encoding": "identity"}
    return Call("GET", path, lambda content: content, params, headers, kind=kind, about=id)


FIGURES = ("svg", "png", "pdf")


def figure_ending(path: str | os.PathLike[str]) -> str:
    """The kind of a file of a figure. Raises ValueError for another."""
    ending = pathlib.Path(path).suffix[1:].lower()
    if ending not in FIGURES:
        raise ValueError(f"{os.fspath(path)!r} must end with .{', .'.join(FIGURES)}")
    return ending


def _job(id: str) -> str:
    return "/v1/jobs/" + quote(id, safe="")


class Filters(TypedDict, total=False):
    """Which jobs: those that match all that is given, by the names of the query of `GET /v1/jobs`."""

    status: str | Sequence[str] | None
    labels: Mapping[str, object] | None
    name: str | None
    owner: str | None
    sweep: str | None
    verdict: str | Sequence[str] | None
    input_hash: str | None
    created_after: datetime.date | str | None
    created_before: datetime.date | str | None
    finished_after: datetime.date | str | None
    finished_before: datetime.date | str | None


class Listing(Filters, total=False):
    """Which jobs, and how they are listed."""

    order_by: str | None
    page_size: int | None


NAMES = frozenset(Listing.__annotations__) | {"group_by"}


def filters(
    status: str | Sequence[str] | None = None,
    labels: Mapping[str, object] | None = None,
    verdict: str | Sequence[str] | None = None,
    **others: str | datetime.date | int | None,
) -> Params:
    """The parameters of `GET /v1/jobs`."""
    unknown = others.keys() - NAMES
    if unknown:
        raise TypeError(f"no such filter: {', '.join(sorted(unknown))}; there are {', '.join(sorted(NAMES))}")
    found = [("status", s) for s in _several(status)] + [("verdict", v) for v in _several(verdict)]
    found += [(f"label.{key}", str(value)) for key, value in (labels or {}).items()]
    for name, value in others.items():
        if isinstance(value, datetime.date) and not isinstance(value, datetime.datetime):
            value = datetime.datetime.combine(value, datetime.time())
        if isinstance(value, datetime.datetime):
            value = value.astimezone(datetime.timezone.utc).isoformat().replace("+00:00", "Z")
        if value is not None:
            found.append((name, str(value).lower() if isinstance(value, bool) else str(value)))
    return tuple(found)


def _several(values: str | Sequence[str] | None) -> Sequence[str]:
    return [values] if isinstance(values, str) else values or []


# Sweeps


@dataclass(frozen=True)
class Spaced:
    """Numbers at equal distances or at equal ratios, as the service spaces them."""

    kind: str
    start: float
    stop: float
    count: int

    def __iter__(self) -> Any:
        for number in range(self.count):
            share = number / max(self.count - 1, 1)
            if self.kind == "linspace":
                yield self.start + share * (self.stop - self.start)
            else:
                yield self.start * (self.stop / self.start) ** share


def linspace(start: float, stop: float, count: int) -> Spaced:
    """`count` numbers at equal distances, both ends included."""
    return Spaced("linspace", float(start), float(stop), int(count))


def logspace(start: float, stop: float, count: int) -> Spaced:
    """`count` numbers at equal ratios, both ends included: the ends are values > 0, not exponents."""
    return Spaced("logspace", float(start), float(stop), int(count))


def submit_sweep(
    base: Problem | Mapping[str, Any],
    axes: Mapping[str, Any] | Sequence[Mapping[str, Any]],
    mode: str,
    envelope: Document,
    key: str | None,
) -> Call[Document]:
    # with all defaults, so that each pointer finds the object that it leads into
    body = {"base": problem_document(base, defaults=True), **envelope}
    if isinstance(axes, Mapping):
        body["axes"] = [_axis(path, values) for path, values in axes.items()]
        body["mode"] = mode
    else:
        body["points"] = [{to_pointer(path): plain(v) for path, v in point.items()} for point in axes]
        body["mode"] = "list"
    return _post("/v1/sweeps", "id", "paths", "members", body=body, key=key or new_key())


def _axis(path: str, values: Any) -> Document:
    axis: Document = {"path": to_pointer(path)}
    if isinstance(values, Spaced) and not (kinds_at(Problem, path) == {int} and all(v == int(v) for v in values)):
        axis[values.kind] = {"start": values.start, "stop": values.stop, "count": values.count}
    else:
        axis["values"] = plain([int(v) for v in values] if isinstance(values, Spaced) else values)
    return axis


def sweep(id: str, wait_s: float | None = None) -> Call[Document]:
    params: Params = () if wait_s is None else (("wait", f"{wait_s:.3f}"),)
    return Call("GET", _sweep(id), _of(id), params, wait_s=wait_s or 0.0)


def sweeps(page_token: str) -> Call[Document]:
    return _get("/v1/sweeps", "sweeps", params=_page(page_token))


def sweep_table(id: str) -> Call[dict[str, Array]]:
    return _file(id, _sweep(id) + "/results", NPZ, (("format", "npz"),))


def sweep_members(id: str, page_token: str) -> Call[Document]:
    return _get(_sweep(id) + "/results", "members", params=(("page_size", "1000"), *_page(page_token)))


def _page(token: str) -> Params:
    return (("page_token", token),) if token else ()


def cancel_sweep(id: str) -> Call[Document]:
    return Call("POST", _sweep(id) + "/cancel", _of(id))


def delete_sweep(id: str) -> Call[None]:
    return Call("DELETE", _sweep(id), _nothing, kind=NOTHING, gone=("deleted",))


def member_job(id: str, number: int) -> Call[Document]:
    return _post(f"{_sweep(id)}/members/{number}/job", *JOB, key=new_key())


def _sweep(id: str) -> str:
    return "/v1/sweeps/" + quote(id, safe="")


# Meshes


MeshSource = str | os.PathLike[str] | bytes | MeshInput | Mapping[str, Any]


def upload_mesh(source: MeshSource) -> Call[StoredMesh]:
    """A mesh is stored by the hash of its content, so that sending it twice does no more than once."""
    content = mesh_bytes(source)
    headers = {"Content-Type": "application/octet-stream"}
    return Call("POST", "/v1/meshes", StoredMesh.from_json, headers=headers, content=content)


def mesh_bytes(source: MeshSource) -> bytes:
    """The file that a mesh is: a path, the content of a file, or a mesh that is written out in a problem."""
    if isinstance(source, bytes):
        return source
    if isinstance(source, (str, os.PathLike)):
        return pathlib.Path(source).read_bytes()
    document = plain(source)
    for kind in ("gmsh", "abaqus"):
        if document.get(kind) is not None:
            return str(document[kind]).encode()
    inline = document.get("inline", document)
    if "nodes" not in inline:
        raise ValueError("only meshes from files and inline meshes can be stored")
    return json.dumps(inline, allow_nan=False).encode()


def mesh(hash: str) -> Call[StoredMesh]:
    return Call("GET", _mesh(hash), lambda document: StoredMesh.from_json(_of(hash, "hash")(document)))


def meshes(page_token: str) -> Call[Document]:
    return _get("/v1/meshes", "meshes", params=_page(page_token))


def delete_mesh(hash: str) -> Call[None]:
    return Call("DELETE", _mesh(hash), _nothing, kind=NOTHING, gone=("deleted", "not-found"))


def _mesh(hash: str) -> str:
    return "/v1/meshes/" + quote(hash, safe=":")


# Service


def validate(problem: Problem | Mapping[str, Any]) -> Call[Validation]:
    """What is wrong is the answer here, so that nothing is checked before but what JSON cannot express."""
    document = plain(problem)
    found: list[Violation] = []
    _find_non_json(document, "", found)
    if found:
        raise errors.invalid(found)
    call = _post("/v1/problems/validate", body={"problem": document})
    return Call(call.method, call.path, Validation.from_json, (), call.headers, call.content, True)


def info() -> Call[Document]:
    return _get("/v1/info", "name")


def me() -> Call[Document]:
    return _get("/v1/me", "owner")


def queue() -> Call[Document]:
    return _get("/v1/queue", "paused")


def pause_queue() -> Call[Document]:
    return Call("POST", "/v1/queue/pause", _having("paused"))


def resume_queue() -> Call[Document]:
    return Call("POST", "/v1/queue/resume", _having("paused"))


def explain(kind: str, code: str) -> Call[Document]:
    return Call("GET", f"/v1/{kind}/" + quote(code, safe=""), _having("title"), headers={"Accept": "application/json"})


def submissions(problems: Iterable[Problem | Mapping[str, Any] | Submission]) -> list[Submission]:
    return [p if isinstance(p, Submission) else Submission(p) for p in problems]
