"""What is known of a job; common to `Job` and `AsyncJob`, which add the verbs."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from typing import Any

from . import _html
from ._data import Warning
from ._progress import job_line
from .errors import JobCanceled, JobFailed


class JobView:
    """A job as the service last described it. Times are in UTC; durations end in `_s` and are in seconds."""

    def __init__(self, document: Mapping[str, Any]) -> None:
        self.document = document

    @property
    def id(self) -> str:
        return str(self.document["id"])

    @property
    def status(self) -> str:
        """`queued`, `running`, `succeeded`, `failed`, `canceled`."""
        return str(self.document["status"])

    @property
    def ended(self) -> bool:
        return self.status in ("succeeded", "failed", "canceled")

    @property
    def reason(self) -> str | None:
        """Why it failed or was canceled: `not_converged`, `timed_out`, `user_cancel`, …"""
        return self.document.get("reason")

    @property
    def failure(self) -> Mapping[str, Any] | None:
        """What went wrong, in words: `code`, `title`, `detail`."""
        return self.document.get("failure")

    @property
    def name(self) -> str | None:
        return self.document.get("name")

    @property
    def title(self) -> str:
        """What to call it: its name or, without one, its id."""
        return self.name or self.id

    @property
    def labels(self) -> dict[str, str]:
        return dict(self.document.get("labels") or {})

    @property
    def owner(self) -> str:
        return str(self.document["owner"])

    @property
    def priority(self) -> int:
        return int(self.document["priority"])

    @property
    def pinned(self) -> bool:
        """Whether it is kept for ever."""
        return bool(self.document.get("pinned"))

    @property
    def progress(self) -> Mapping[str, Any] | None:
        """`stage`, `iteration`, `residual`, `tolerance`, `contact_changes`, `rate`, `eta_s`; None before the start."""
        return self.document.get("progress")

    @property
    def result_available(self) -> str:
        """`none`, `partial`, `final`."""
        return str(self.document["result_available"])

    @property
    def cached_from(self) -> str | None:
        """The job whose result answered this one."""
        return self.document.get("cached_from")

    @property
    def input_hash(self) -> str:
        """The same for problems that differ in nothing but the title."""
        return str(self.document["input_hash"])

    @property
    def created_at(self) -> datetime.datetime:
        return _time(self.document["created_at"])

    @property
    def finished_at(self) -> datetime.datetime | None:
        text = self.document.get("finished_at")
        return _time(text) if text else None

    @property
    def run_s(self) -> float | None:
        """Seconds from the start of the last attempt to the end."""
        return self.document.get("run_s")

    @property
    def verdict(self) -> str | None:
        """`good`, `fair` or `poor`; None until there is a result with stated errors."""
        return self.document.get("verdict")

    @property
    def quantities(self) -> list[Mapping[str, Any]]:
        """Forces and peaks of the result: each with `quantity`, `contact`, `value`, `error` and `relative`."""
        return list(self.document.get("quantities") or [])

    @property
    def warnings(self) -> list[Warning]:
        """Up to five, the worst first; the result has all of them."""
        return [Warning.from_json(w) for w in self.document.get("warnings") or []]

    def raise_for_status(self) -> None:
        """Raises `JobFailed` or `JobCanceled` if that is how the job ended."""
        if self.status == "failed":
            raise JobFailed(self)
        if self.status == "canceled":
            raise JobCanceled(self)

    def line(self) -> str:
        """The job on one line."""
        return job_line(self.title, self.document)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.id}{f' {self.name!r}' if self.name else ''} {self.status}>"

    def __str__(self) -> str:
        return self.line()

    def _residual(self) -> float | None:
        return (self.progress or {}).get("residual")

    def _card(self, residuals: Sequence[float]) -> str:
        return _html.job(self, residuals)

    def _repr_html_(self) -> str:
        return self._card(())


def _time(text: str) -> datetime.datetime:
    return datetime.datetime.fromisoformat(text.replace("Z", "+00:00"))


EDITABLE = ("name", "labels", "priority", "pinned")


def changes(values: Mapping[str, Any]) -> dict[str, Any]:
    """The body of an edit: what is given, `None` included, since it removes a name."""
    unknown = [name for name in values if name not in EDITABLE]
    if unknown:
        raise TypeError(f"a job has no {unknown[0]!r} to edit, only {', '.join(EDITABLE)}")
    return dict(values)
