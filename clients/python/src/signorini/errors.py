"""What can go wrong, one class for each family of error codes of the service.

SignoriniError
├── ApiError                 the service refused a request
│   ├── InvalidProblem       with every violation; also raised locally, before anything is sent
│   ├── BadRequest, TooLarge
│   ├── Unauthenticated, Forbidden
│   ├── NotFound             ├── NoResult, Deleted
│   ├── Conflict             ├── JobActive, ResultNotReady, PartialResult, StaleVersion
│   ├── QuotaExceeded, RateLimited
│   └── ServiceError         ├── Unavailable, StorageFull
├── JobFailed                with the reason and the job ─ JobCanceled
├── UnexpectedAnswer         something else than the service answered
├── WaitTimeout              also a TimeoutError; the job goes on
└── ConnectionLost           also a ConnectionError; the job goes on
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._job import JobView


@dataclass(frozen=True)
class Violation:
    """A fault of a problem, described so that its author can correct it."""

    pointer: str
    """JSON Pointer into the problem, e.g. `/contacts/0/friction/elastic_slip`."""
    reason: str
    """The kind, stable for programs: `unknown_name`, `missing`, `out_of_range`, …"""
    got: str
    """What the problem has there."""
    expected: str
    """What is required there."""
    hint: str = ""
    """How to correct it."""

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> Violation:
        text = {name: str(document.get(name) or "") for name in ("pointer", "reason", "got", "expected", "hint")}
        # the envelope of a request is ours, the problem in it is the user's: pointers begin at the problem
        for envelope in ("/problem", "/base"):
            if text["pointer"] == envelope or text["pointer"].startswith(envelope + "/"):
                text["pointer"] = text["pointer"][len(envelope) :]
        return cls(**text)

    def __str__(self) -> str:
        line = f"{self.pointer or '(the problem)'}: got {self.got}, expected {self.expected}"
        return f"{line}\n     {self.hint}" if self.hint else line


class SignoriniError(Exception):
    """Every error of this package."""


class ApiError(SignoriniError):
    """The service refused a request (RFC 9457).

    code: stable name of the error, which `signorini explain CODE` explains
    status: HTTP status; None where the fault was found before anything was sent
    violations: every fault of the problem or request
    retryable: whether the same request may succeed later
    retry_after_s: seconds after which the service suggests to try again, or None
    request_id: what the service's log calls the request
    """

    def __init__(
        self,
        title: str,
        *,
        code: str = "",
        status: int | None = None,
        detail: str = "",
        violations: Sequence[Violation] = (),
        retryable: bool = False,
        retry_after_s: float | None = None,
        request_id: str = "",
    ) -> None:
        super().__init__(title)
        self.title = title
        self.code = code
        self.status = status
        self.detail = detail
        self.violations = tuple(violations)
        self.retryable = retryable
        self.retry_after_s = retry_after_s
        self.request_id = request_id

    def __str__(self) -> str:
        head = self.title
        if self.status is not None:
            head += f" ({self.status} {self.code})"
        if not self.violations:
            return f"{head}: {self.detail}" if self.detail else head
        return head + ":" + "".join(f"\n  {n}. {v}" for n, v in enumerate(self.violations, 1))


class InvalidProblem(ApiError):
    """The problem, or the request around it, is invalid; `violations` lists everything that is wrong with it."""


class BadRequest(ApiError):
    """The request itself is wrong: an unknown filter, a bad value of a parameter, a format that does not exist."""


class TooLarge(ApiError):
    """The request, or the work that the problem would be, is larger than the service accepts."""


class Unauthenticated(ApiError):
    """A valid token is required: `Client(token=…)` or the environment variable SIGNORINI_TOKEN."""


class Forbidden(ApiError):
    """The token does not allow this."""


class NotFound(ApiError):
    """There is no such job, sweep, mesh or boundary, or it belongs to somebody else."""


class NoResult(NotFound):
    """The job has ended without a result."""


class Deleted(NotFound):
    """The job or sweep was deleted."""


class Conflict(ApiError):
    """The request does not fit the present state of the job, or repeats an id or key for something else."""


class JobActive(Conflict):
    """The job has not ended: wait for it or cancel it first."""


class ResultNotReady(Conflict):
    """The job has not ended, and has no result yet."""


class PartialResult(Conflict):
    """The job failed or was canceled, and has only the state at which it stopped: `partial=True` asks for that."""


class StaleVersion(Conflict):
    """The job was changed by somebody else in the meantime."""


class QuotaExceeded(ApiError):
    """The owner's quota of the queue or of the disk is used up."""


class RateLimited(ApiError):
    """Too many requests at once."""


class ServiceError(ApiError):
    """The service met a fault of its own; its log has the cause under `request_id`."""


class Unavailable(ServiceError):
    """The service cannot do this now: its queue is full, or it is starting or stopping."""


class StorageFull(ServiceError):
    """The disk of the service is full."""


class JobFailed(SignoriniError):
    """A job ended without a solution.

    job: the job; `job.result(partial=True)` is its last state where there is one
    reason: why, stable for programs: `not_converged`, `timed_out`, `singular_system`, …
    detail: what happened, in words
    """

    def __init__(self, job: JobView) -> None:
        self.job = job
        self.reason = job.reason or ""
        failure = job.failure or {}
        self.detail = str(failure.get("detail", ""))
        text = f"{job.title} {job.status}: {str(failure.get('title') or self.reason)}"
        if self.detail:
            text += f": {self.detail}"
        if job.result_available != "none":
            text += "\n  Its last state is kept: job.result(partial=True)"
        super().__init__(text)

    def __reduce__(self) -> tuple[type[JobFailed], tuple[JobView]]:
        return type(self), (self.job,)


class JobCanceled(JobFailed):
    """A job was canceled."""


class WaitTimeout(SignoriniError, TimeoutError):
    """The caller's time to wait is over; the job or sweep continues."""


class ConnectionLost(SignoriniError, ConnectionError):
    """The service could not be reached, again and again until the limit of `Client(retry_for=…)`."""


class UnexpectedAnswer(SignoriniError):
    """What answered is not the service, or the answer is not one to this request: a proxy's page to log in, …"""


CLASSES: Mapping[str, type[ApiError]] = {
    "invalid-problem": InvalidProblem,
    "malformed-json": BadRequest,
    "unknown-parameter": BadRequest,
    "bad-parameter": BadRequest,
    "bad-page-token": BadRequest,
    "missing-filter": BadRequest,
    "bad-request": BadRequest,
    "method-not-allowed": BadRequest,
    "not-acceptable": BadRequest,
    "uri-too-long": BadRequest,
    "unsupported-media": BadRequest,
    "range-not-satisfiable": BadRequest,
    "header-too-large": BadRequest,
    "payload-too-large": TooLarge,
    "problem-too-large": TooLarge,
    "unauthenticated": Unauthenticated,
    "forbidden": Forbidden,
    "not-found": NotFound,
    "no-result": NoResult,
    "deleted": Deleted,
    "job-active": JobActive,
    "result-not-ready": ResultNotReady,
    "partial-result": PartialResult,
    "id-conflict": Conflict,
    "idempotency-key-reuse": Conflict,
    "stale-version": StaleVersion,
    "quota-exceeded": QuotaExceeded,
    "rate-limited": RateLimited,
    "internal": ServiceError,
    "corrupt-data": ServiceError,
    "request-timeout": Unavailable,
    "queue-full": Unavailable,
    "draining": Unavailable,
    "overloaded": Unavailable,
    "storage-lost": Unavailable,
    "storage-full": StorageFull,
}
"""The class of each code that the service knows (docs/api.md, "Errors")."""


def of_answer(
    status: int, document: Mapping[str, Any], *, retry_after_s: float | None = None, request_id: str = ""
) -> ApiError:
    """The error that an answer means; a code that this client does not know is judged by the status."""
    code = str(document.get("code") or "")
    kind = CLASSES.get(code)
    if kind is None:
        kind = ServiceError if status >= 500 else ApiError
    return kind(
        str(document.get("title") or f"HTTP status {status}"),
        code=code or "unknown",
        status=status,
        detail=str(document.get("detail") or ""),
        violations=[Violation.from_json(v) for v in document.get("errors") or []],
        retryable=bool(document.get("retryable", status in (429, 502, 503, 504))),
        retry_after_s=retry_after_s,
        request_id=request_id,
    )


def invalid(violations: Sequence[Violation], what: str = "The problem") -> InvalidProblem:
    """The error of faults that were found locally."""
    return InvalidProblem(f"{what} is invalid", code="invalid-problem", violations=violations)
