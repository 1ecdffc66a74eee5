"""Whether, and when, a request is sent again. Decisions only: nothing here sends or sleeps.

A request is repeated only where that cannot do anything twice: if it never arrived (connection refused), if the
service says that it did not do it (429, 503), or if it is repeatable by its nature (reading, deleting, a submission
with its idempotency key).
"""

from __future__ import annotations

import logging
import random
import ssl
import time
from collections.abc import Callable

import httpx

from .errors import ConnectionLost

FIRST_PAUSE_S = 0.1
LONGEST_PAUSE_S = 5.0
QUIET_S = 1.0
"""Nothing is said of what is over after so many seconds."""

LOG = logging.getLogger("signorini")
"""Python shows its warnings on standard error unless the program sets up logging otherwise."""


BROKEN = (httpx.TransportError, httpx.DecodingError)
"""What httpx raises where there is no answer, or only a part of one."""


class Late(ConnectionLost):
    """The deadline of a call has come."""


class Attempts:
    """The attempts of one request.

    limit_s: no attempt begins later than so many seconds after the first failure
    deadline: nor at this time of the clock; None: without
    address: of the service
    tell: is given a sentence when attempts go on for longer than a moment, and another one when they have succeeded
    """

    def __init__(
        self,
        repeatable: bool,
        limit_s: float,
        clock: Callable[[], float] = time.monotonic,
        tell: Callable[[str], None] = LOG.warning,
        deadline: float | None = None,
        address: str = "this address",
    ) -> None:
        self.repeatable = repeatable
        self.deadline = deadline
        self.address = address
        self.limit_s = limit_s
        self.failures = 0
        self._clock = clock
        self._tell = tell
        self._told = False
        self._first_failure: float | None = None

    def succeeded(self) -> None:
        """The service was reached: later failures are counted from zero."""
        if self._told:
            self._tell("the service answers again")
        self.failures = 0
        self._told = False
        self._first_failure = None

    def after_error(self, error: httpx.RequestError) -> float:
        """Seconds to wait before the next attempt. Raises `ConnectionLost` if there is none."""
        reason = str(error) or type(error).__name__
        if _is_lasting(error):
            raise ConnectionLost(f"the service at {self.address} cannot be called: {reason}") from error
        never_arrived = isinstance(error, (httpx.ConnectError, httpx.ConnectTimeout, httpx.PoolTimeout))
        why = f"the service at {self.address} cannot be reached ({reason})"
        pause = self._pause(None, why) if self.repeatable or never_arrived else None
        if pause is None:
            after = f", also after {self.failures} attempts" if self.failures > 1 else ""
            hint = (
                "Is it running (`signorini serve`)? SIGNORINI_URL names another; Client.local() starts one. "
                "Jobs that it has go on, or begin again with it"
            )
            raise ConnectionLost(f"the service at {self.address} cannot be reached{after}: {reason}. {hint}") from error
        return pause

    def after_answer(self, response: httpx.Response) -> float | None:
        """Seconds to wait before the next attempt; None if this answer is the last."""
        if response.status_code in (429, 503):
            again = _says_retryable(response)
        else:
            again = response.status_code in (502, 504) and self.repeatable
        if again:
            silent = response.status_code in (502, 504)
            who = "a proxy gets no answer from the service" if silent else "the service is busy"
            return self._pause(retry_after_s(response), f"{who} ({_reason(response)})")
        if self._told:
            self._tell("the service answers again")
            self._told = False
        return None

    def _pause(self, wanted: float | None, why: str) -> float | None:
        now = self._clock()
        if self._first_failure is None:
            self._first_failure = now
        self.failures += 1
        # half of the pause is left to chance, so that many clients do not come back at the same moment
        pause: float = min(FIRST_PAUSE_S * 2 ** min(self.failures - 1, 10), LONGEST_PAUSE_S) * random.uniform(0.5, 1)
        if wanted is not None:
            pause = max(pause, wanted)
        last = self._first_failure + self.limit_s
        if self.deadline is not None and self.deadline <= last:
            last = self.deadline
            if now + pause > last:
                raise Late(f"{why}, also after {self.failures} attempts")
        if now + pause > last:
            return None
        if not self._told and now + pause > self._first_failure + QUIET_S:
            self._tell(f"{why}; trying again for {last - now:.0f} s")
            self._told = True
        return pause


def _is_lasting(error: httpx.RequestError) -> bool:
    """Whether the request would end the same way at any time: a certificate that is not trusted, no such protocol."""
    if isinstance(error, (httpx.UnsupportedProtocol, httpx.LocalProtocolError)):
        return True
    causes: list[BaseException | None] = [error]
    while (cause := causes[-1]) is not None:
        if isinstance(cause, ssl.SSLCertVerificationError):
            return True
        causes.append(cause.__cause__ or cause.__context__)
    return False


def retry_after_s(response: httpx.Response) -> float | None:
    """Retry-After in seconds; None without it."""
    text = response.headers.get("Retry-After", "")
    return float(text) if text.isdigit() else None


def _says_retryable(response: httpx.Response) -> bool:
    try:
        return bool(response.json().get("retryable", True))
    except (ValueError, AttributeError):  # not the service's own answer, but a proxy's
        return True


def _reason(response: httpx.Response) -> str:
    """The code of the error that the service answered with, or the status."""
    try:
        return str(response.json()["code"])
    except (ValueError, KeyError, TypeError):  # not the service's own answer, but a proxy's
        return f"HTTP status {response.status_code}"
