"""Whether an answer comes from the service, is about what was asked, and is whole.

A proxy may answer in the service's place, with its page to log in, and may pass on half of an answer as if it were all.
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NoReturn

import httpx

from . import errors
from ._data import arrays
from ._retry import retry_after_s


@dataclass(frozen=True)
class Kind:
    """What the body of an answer is.

    read: what it says; a ValueError or EOFError means that it is not whole
    """

    media: str
    read: Callable[[bytes], Any]


def _file(begin: bytes, end: bytes) -> Callable[[bytes], bytes]:
    def read(content: bytes) -> bytes:
        if not (content.startswith(begin) and content.rstrip().endswith(end)):
            raise ValueError(f"it does not begin with {begin!r} and end with {end!r}")
        return content

    return read


NOTHING = Kind("", lambda content: None)
JSON = Kind("application/json", json.loads)
NPZ = Kind("application/x-npz", arrays)
FILES = {
    "vtu": Kind("application/vnd.vtk.unstructuredgrid+xml", _file(b"<", b"</VTKFile>")),
    "svg": Kind("image/svg+xml", _file(b"<", b"</svg>")),
    "png": Kind("image/png", _file(b"\x89PNG\r\n\x1a\n", b"IEND\xaeB`\x82")),
    "pdf": Kind("application/pdf", _file(b"%PDF-", b"%%EOF")),
}


def read(response: httpx.Response, kind: Kind, about: str) -> Any:
    """What an answer says.

    about: id of the job or sweep that was asked for; empty if it is not known
    Raises an `ApiError` if it is an error of the service, `UnexpectedAnswer` if it is not an answer of the service to
    this, and a `TransportError` if it is not whole.
    """
    check_status(response, 204 if kind is NOTHING else 200)
    if kind is NOTHING:
        return None
    if _media(response) != kind.media:
        raise unexpected(response, f"{kind.media} was expected")
    named = re.search(r'filename="((?:job|sweep)_[^".]*)', response.headers.get("Content-Disposition", ""))
    if about and named and named[1] != about:
        raise unexpected(response, f"it is about {named[1]}")
    try:
        _check_digest(response)
        return kind.read(response.content)
    except (ValueError, EOFError) as error:
        raise httpx.ReadError(f"the answer is not whole: {error}", request=response.request) from error


def check_status(response: httpx.Response, expected: int) -> None:
    """Raises the error that an answer is, and where it is neither that nor a success of the expected kind (204: without
    content)."""
    if response.is_error:
        raise_error(response)
    if not response.is_success or (response.status_code == 204) != (expected == 204):
        raise unexpected(response, f"status {expected} was expected")
    # nothing else tells the service's silence from that of another
    if expected == 204 and "X-Request-Id" not in response.headers:
        raise unexpected(response, "the service names each request")


def check_events(response: httpx.Response, after_seq: int) -> bool:
    """Whether events follow: there are none after the last one of a job that has ended."""
    if response.status_code == 204 and after_seq > 0:
        check_status(response, 204)
        return False
    check_status(response, 200)
    if _media(response) != "text/event-stream":
        raise unexpected(response, "events were expected")
    return True


def unexpected(response: httpx.Response, why: str) -> errors.UnexpectedAnswer:
    """The error of an answer that the service did not give, or not to this request."""
    got = f"status {response.status_code}"
    if to := response.headers.get("Location"):
        got += f" to {to[:100]}"
    if media := _media(response):
        got += f", {media}"
    with contextlib.suppress(httpx.ResponseNotRead):  # a stream, which may have no end
        if media.startswith("text/") and response.text:
            got += f", {' '.join(response.text[:100].split())!r}"
    return errors.UnexpectedAnswer(
        f"{response.url} is not answered as by the service: got {got}; {why}. "
        "Is this its address, and is there a proxy that wants you to log in?"
    )


def raise_error(response: httpx.Response) -> NoReturn:
    """Raises the error that an answer is."""
    try:
        document = response.json()
    except ValueError:
        document = None
    if not isinstance(document, dict):  # from a proxy, or from something that is not the service
        document = {"detail": response.text[:300]}
    raise errors.of_answer(
        response.status_code,
        document,
        retry_after_s=retry_after_s(response),
        request_id=response.headers.get("X-Request-Id", ""),
    )


def _media(response: httpx.Response) -> str:
    return str(response.headers.get("Content-Type", "")).partition(";")[0].strip().lower()


def _check_digest(response: httpx.Response) -> None:
    """RFC 9530; of the content as it was sent, which a compressed one no longer is."""
    found = re.search(r"sha-256=:([^:]*):", response.headers.get("Content-Digest", ""))
    if found and "Content-Encoding" not in response.headers:
        digest = base64.b64encode(hashlib.sha256(response.content).digest()).decode()
        if digest != found[1]:
            raise ValueError("its digest is another one")
