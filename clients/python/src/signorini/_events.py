"""Server-sent events, and where one stands in them.

`Parser` turns bytes, cut anywhere, into events. `Cursor` knows the last event that was seen: it asks for what lies
after it, so that a stream that breaks is resumed without a gap and without a repetition.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ._data import Event
from .errors import SignoriniError, UnexpectedAnswer


@dataclass(frozen=True)
class Message:
    """A message of the stream, as its sender wrote it."""

    id: str
    event: str
    data: str


class Parser:
    """Reads `text/event-stream` (WHATWG HTML, section 9.2). Feed it bytes as they come."""

    def __init__(self) -> None:
        self._rest = b""
        self._fields: dict[str, list[str]] = {}
        self._at_start = True

    def feed(self, content: bytes) -> Iterator[Message]:
        """The messages that these bytes complete."""
        self._rest += content
        while (line := self._line()) is not None:
            if not line:
                yield from self._message()
            elif not line.startswith(":"):  # a comment keeps the connection alive
                name, _, value = line.partition(":")
                self._fields.setdefault(name, []).append(value.removeprefix(" "))

    def _line(self) -> str | None:
        """The next complete line, which ends in LF, CRLF or CR."""
        ends = [end for end in (self._rest.find(b"\n"), self._rest.find(b"\r")) if end >= 0]
        if not ends:
            return None
        end = min(ends)
        if self._rest[end : end + 1] == b"\r":
            if end + 1 == len(self._rest):
                return None  # whether LF follows is not known yet
            after = end + 2 if self._rest[end + 1 : end + 2] == b"\n" else end + 1
        else:
            after = end + 1
        line, self._rest = self._rest[:end], self._rest[after:]
        text = line.decode("utf-8", "replace")
        if self._at_start:
            text, self._at_start = text.removeprefix("\ufeff"), False
        return text

    def _message(self) -> Iterator[Message]:
        fields, self._fields = self._fields, {}
        if "data" in fields:
            yield Message(fields.get("id", [""])[-1], fields.get("event", [""])[-1], "\n".join(fields["data"]))


class Cursor:
    """A place in the events of a job or sweep.

    id: which one; empty if it is not known
    seq: number of the last event that was seen
    done: whether the last of all events was seen
    """

    def __init__(self, after_seq: int = 0, id: str = "") -> None:
        self.seq = after_seq
        self._id = id
        self.done = False
        self._parser = Parser()

    def headers(self) -> dict[str, str]:
        """What a request for the following events says; a new connection begins with a new line."""
        self._parser = Parser()
        return {"Accept": "text/event-stream", "Last-Event-ID": str(self.seq)}

    def _is_asked(self, data: Any) -> bool:
        """Whether what an event says of a job or sweep is said of the one that was asked for."""
        named = data.get("job") or data.get("sweep")
        found = named.get("id") if isinstance(named, dict) else named
        return not self._id or not found or found == self._id

    def read(self, content: bytes) -> Iterator[Event]:
        """The events that these bytes complete, each once and in its order."""
        for message in self._parser.feed(content):
            try:
                data = json.loads(message.data)
                event = Event(int(data["seq"]), str(data["type"]), data)
            except (ValueError, KeyError, TypeError) as error:
                raise UnexpectedAnswer(f"this is no event of the service: {message.data[:100]!r}") from error
            if not self._is_asked(data):
                raise UnexpectedAnswer(f"this event is not of {self._id}: {message.data[:200]!r}")
            if event.seq <= self.seq:
                continue
            if event.seq != self.seq + 1:
                raise SignoriniError(f"after event {self.seq} the service sent event {event.seq}")
            self.seq = event.seq
            self.done = event.type == "done"
            yield event
