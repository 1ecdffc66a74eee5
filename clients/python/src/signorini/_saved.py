"""A result in a file, which is opened without the service: the service's answers to all that a result can be asked.

A ZIP file: `index.json` names, for each request, the file with its answer.
"""

from __future__ import annotations

import io
import json
import os
import pathlib
import zipfile
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar
from urllib.parse import urlencode

import httpx

from . import _calls as calls
from ._calls import Call
from .errors import SignoriniError

T = TypeVar("T")

FORMAT = "signorini result 1"


def requests(
    id: str, input_hash: str, summary: Mapping[str, Any], steps: list[str], fields: bool, partial: bool
) -> Iterator[Call[Any]]:
    """What a result is asked for: numbers, problem, history, and of each contact its profile, at each load step.

    fields: displacements and stresses of the whole body, too
    partial: whether it is the state of a job without a solution
    """
    yield calls.job(id)
    yield calls.result(id, True, input_hash)
    yield calls.problem(id)
    yield calls.history(id, None, partial)
    for boundary in summary["contacts"]:
        yield calls.profile(id, boundary, None, None, partial)
        yield calls.profile(id, boundary, None, "nodes", partial)
        for number, name in enumerate(steps):
            yield calls.profile(id, boundary, number, None, partial)
            yield calls.profile(id, boundary, name, None, partial)
    if fields:
        yield calls.fields(id, partial)
        yield calls.vtu(id, partial)


def _entry(name: str) -> zipfile.ZipInfo:
    """An entry without the time, so that the same result is the same file."""
    entry = zipfile.ZipInfo(name)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o600 << 16
    return entry


def packed(id: str, answers: Mapping[str, tuple[str, bytes]]) -> bytes:
    """The file: answers by request, each with its media type."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as file:
        names: dict[bytes, str] = {}
        index = {}
        for request, (media, answer) in answers.items():
            name = names.setdefault(answer, f"{len(names):04}.{media.rpartition('/')[2].rpartition('-')[2]}")
            index[request] = {"media": media, "file": name}
        for answer, name in names.items():
            file.writestr(_entry(name), answer)
        file.writestr(_entry("index.json"), json.dumps({"format": FORMAT, "job": id, "answers": index}))
    return content.getvalue()


def key(call: Call[Any]) -> str:
    """The name of a request in the file. What is partial is so whether it is asked for as such or not."""
    params = [param for param in call.params if param not in calls.PARTIAL]
    return f"{call.method} {call.path}?{urlencode(params)}"


def write(path: str | os.PathLike[str], content: bytes) -> pathlib.Path:
    """Writes a file under another name first, so that what has the name is whole."""
    target = pathlib.Path(path)
    part = target.with_name(target.name + ".part")
    part.write_bytes(content)
    part.replace(target)
    return target


class Saved:
    """What a client is to a job and its result, from a file."""

    _ends_with_program = False

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = pathlib.Path(path)
        try:
            with zipfile.ZipFile(self.path) as file:
                index = json.loads(file.read("index.json"))
                if index["format"] != FORMAT:
                    raise ValueError(f"it is a {index['format']!r}, and this client reads {FORMAT!r}")
                self.job = str(index["job"])
                self._answers = {
                    request: (str(found["media"]), file.read(found["file"]))
                    for request, found in index["answers"].items()
                }
        except (zipfile.BadZipFile, KeyError, TypeError, ValueError) as error:
            raise SignoriniError(f"{self.path} is not a result that was saved by this package: {error}") from error

    def __repr__(self) -> str:
        return f"<Saved {self.path}>"

    def _send(self, call: Call[T], deadline: float | None = None, tell: Callable[[str], None] | None = None) -> T:
        if key(call) not in self._answers:
            raise SignoriniError(
                f"{self.path} does not have {call.method} {call.path}. The service may: Client().job({self.job!r})"
            )
        media, content = self._answers[key(call)]
        request = httpx.Request(call.method, f"file://{call.path}")
        return call.read(httpx.Response(200, headers={"Content-Type": media}, content=content, request=request), 1)

    def _events(self, path: str, id: str, after_seq: int) -> Any:
        raise SignoriniError(f"{self.path} does not have the events of the job")


class AsyncSaved(Saved):
    """The same for asyncio."""

    async def _send(  # type: ignore[override]
        self, call: Call[T], deadline: float | None = None, tell: Callable[[str], None] | None = None
    ) -> T:
        return super()._send(call)
