"""The parser of server-sent events, cut everywhere, and the place that a client has in them."""

from __future__ import annotations

import json
import random

import pytest

from signorini import SignoriniError
from signorini._events import Cursor, Message, Parser

STREAM = (
    "\ufeff: a comment\n\n"
    'id: 1\nevent: status\ndata: {"seq":1}\n\n'
    ":\n\n"
    "id:2\r\nevent:no space\r\ndata: first\r\ndata:  second\r\n\r\n"
    "data: σ is two bytes\rid: 3\r\r"
    "retry: 10\nevent: without data\n\n"
    "data\n\n"
    "id: 4\ndata: the end, which no empty line completes\n"
).encode()

MESSAGES = [
    Message("1", "status", '{"seq":1}'),
    Message("2", "no space", "first\n second"),
    Message("3", "", "σ is two bytes"),
    Message("", "", ""),
]


def read(pieces: list[bytes]) -> list[Message]:
    parser = Parser()
    return [message for piece in pieces for message in parser.feed(piece)]


def test_a_stream_cut_in_two_at_every_byte() -> None:
    for cut in range(len(STREAM) + 1):
        assert read([STREAM[:cut], STREAM[cut:]]) == MESSAGES, cut


def test_a_stream_byte_by_byte() -> None:
    assert read([STREAM[i : i + 1] for i in range(len(STREAM))]) == MESSAGES


def test_a_stream_cut_at_random() -> None:
    chance = random.Random(1983)
    for _ in range(300):
        cuts = sorted(chance.sample(range(len(STREAM)), chance.randrange(1, 20)))
        ends = zip([0, *cuts], [*cuts, len(STREAM)], strict=True)
        assert read([STREAM[a:b] for a, b in ends]) == MESSAGES, cuts


def lines(*numbers: int, done: int = 0) -> bytes:
    def event(seq: int) -> str:
        kind = "done" if seq == done else "iteration"
        return f"id: {seq}\nevent: {kind}\ndata: {json.dumps({'seq': seq, 'type': kind, 'attempt': 1})}\n\n"

    return "".join(event(number) for number in numbers).encode()


def test_a_cursor_asks_for_what_follows_and_drops_what_it_has_seen() -> None:
    cursor = Cursor()
    assert cursor.headers()["Last-Event-ID"] == "0"
    assert [e.seq for e in cursor.read(lines(1, 2) + lines(3)[:20])] == [1, 2]
    # the connection breaks inside an event; what was read of it is forgotten
    assert cursor.headers()["Last-Event-ID"] == "2"
    assert [e.seq for e in cursor.read(lines(2, 3, 4, done=4))] == [3, 4]
    assert cursor.done and not list(cursor.read(lines(4)))


def test_a_gap_is_an_error() -> None:
    with pytest.raises(SignoriniError, match="after event 1 the service sent event 3"):
        list(Cursor().read(lines(1, 3)))


def test_what_an_event_says() -> None:
    (event,) = Cursor(6).read(lines(7))
    assert (event.seq, event.type, event.attempt, event["seq"]) == (7, "iteration", 1, 7)
