"""The connections of a client: each is used by one call at a time, and again only after a call that has ended well.

So whatever stops a call, an interrupt, a cancellation, a broken network, takes its own connection with it and leaves
the next call alone. A forked process and another event loop begin with no connections, since two of them on one
connection would read each other's answers. Signals reach the main thread alone: what that asks for is sent and read in
a thread beside it, so that an interrupt never stops the HTTP library in the middle of anything, such as a lock.
"""

from __future__ import annotations

import _thread
import asyncio
import collections
import contextlib
import contextvars
import functools
import os
import queue
import socket
import threading
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Generator, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import httpx

T = TypeVar("T")
Settings = Mapping[str, Any]
"""Of `httpx.Client` and `httpx.AsyncClient`."""
Request = Mapping[str, Any]
"""Of their method `build_request`."""

ONE = httpx.Limits(max_connections=1, max_keepalive_connections=1)
MOST_IDLE = 20
"""Connections that are kept for later calls."""
MOST_AT_ONCE = 100
"""Calls of one event loop that are under way at the same time; and as many again that wait for the end of a job."""
OPENED = ("connect_tcp.complete", "start_tls.complete")


class Line:
    """One connection."""

    def __init__(self, settings: Settings) -> None:
        self.process = os.getpid()
        self._settings = settings
        self._http: httpx.Client | None = None
        self._socket: socket.socket | None = None
        self._pieces: Iterator[bytes] = iter(())
        self._busy = self._dropped = False

    def send(self, request: Request) -> httpx.Response:
        """Sends a request, and reads the head of the answer."""
        if self._http is None:
            # not when it is made, in the main thread: it imports modules, under locks that all threads need
            self._http = httpx.Client(limits=ONE, **self._settings)
        extensions = {"trace": self._trace}
        return self._http.send(self._http.build_request(**request, extensions=extensions), stream=True)

    def _trace(self, event: str, info: Mapping[str, Any]) -> None:
        if event.endswith(OPENED):
            self._socket = info["return_value"].get_extra_info("socket")

    def run(self, work: Callable[[], T], deadline: float | None) -> T:
        """Does something on the connection; after an exception it is closed. Raises `ReadTimeout` at the deadline."""
        try:
            if deadline is None and threading.current_thread() is not threading.main_thread():
                return work()
            return self._beside(work, deadline)
        except BaseException:
            self.drop()
            raise

    def _beside(self, work: Callable[[], T], deadline: float | None) -> T:
        done: queue.SimpleQueue[tuple[T | None, BaseException | None]] = queue.SimpleQueue()

        def act() -> None:
            found: tuple[T | None, BaseException | None]
            try:
                found = work(), None
            except BaseException as error:
                found = None, error
            self._busy = False
            if self._dropped:
                self._close()
            done.put(found)

        self._busy = True
        _start(functools.partial(contextvars.copy_context().run, act))
        try:
            result, error = done.get(timeout=None if deadline is None else max(0.0, deadline - time.monotonic()))
        except queue.Empty:
            raise httpx.ReadTimeout("no answer in time") from None
        if error is not None:
            raise error
        return result  # type: ignore[return-value]

    def pieces(self, response: httpx.Response) -> Iterator[bytes]:
        """The bytes of an answer as they come. Raises a `TransportError` where the connection breaks."""
        self._pieces = response.iter_raw()
        while True:
            if self.process != os.getpid():  # a process that was forked meanwhile would take them from this one
                raise httpx.ReadError("the process was forked", request=response.request)
            piece = self.run(lambda: next(self._pieces, None), None)
            if piece is None:
                return
            yield piece

    def drop(self) -> None:
        """Ends whatever is under way on the connection, from any thread, and closes it."""
        self._dropped = True
        if self._busy and self.process == os.getpid():
            # the thread that reads from it wakes up, and closes it
            with contextlib.suppress(OSError):
                if self._socket is not None:
                    self._socket.shutdown(socket.SHUT_RDWR)
        elif not self._busy:
            _start(self._close)

    def _close(self) -> None:
        with contextlib.suppress(Exception):
            if isinstance(self._pieces, Generator):
                self._pieces.close()
        if self._http is not None:
            self._http.close()


def _start(work: Callable[[], None]) -> None:
    """Does something in a thread of its own. `threading.Thread` has locks that an interrupt may leave closed."""
    try:
        _thread.start_new_thread(work, ())
    except RuntimeError:  # at the end of the program there are no new ones
        work()


@dataclass(frozen=True)
class Stream:
    """An answer that is read as it comes."""

    line: Line
    response: httpx.Response

    def read(self) -> None:
        self.line.run(self.response.read, None)

    def pieces(self) -> Iterator[bytes]:
        return self.line.pieces(self.response)


class Pool:
    """The connections of a client of threads."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._closed = False
        self._process = os.getpid()
        # not a list under a lock, which an interrupt may leave closed: append and pop are one step each
        self._idle: collections.deque[Line] = collections.deque()

    def call(self, request: Request, deadline: float | None = None) -> httpx.Response:
        """Sends a request, and reads the whole answer. Raises a `TransportError`, at the latest at the deadline (of
        `time.monotonic`)."""
        line = self._take()

        def work() -> httpx.Response:
            response = line.send(request)
            response.read()
            return response

        response = line.run(work, deadline)
        self._give(line)
        return response

    @contextlib.contextmanager
    def stream(self, request: Request) -> Iterator[Stream]:
        """Sends a request whose answer is read as it comes."""
        line = self._take()
        try:
            yield Stream(line, line.run(lambda: line.send(request), None))
        finally:
            line.drop()

    def close(self) -> None:
        self._closed = True
        while self._idle:
            self._idle.pop().drop()

    def _take(self) -> Line:
        if self._closed:
            raise RuntimeError("this client is closed")
        if self._process != os.getpid():
            self._process, self._idle = os.getpid(), collections.deque()
        try:
            return self._idle.pop()
        except IndexError:
            return Line(self._settings)

    def _give(self, line: Line) -> None:
        if self._closed or len(self._idle) >= MOST_IDLE:
            line.drop()
        else:
            self._idle.append(line)


class AsyncLine:
    """One connection of an event loop."""

    _closing: set[asyncio.Task[None]] = set()

    def __init__(self, settings: Settings) -> None:
        self._http = httpx.AsyncClient(limits=ONE, **settings)
        self._stream: Any = None

    async def send(self, request: Request) -> httpx.Response:
        extensions = {"trace": self._trace}
        return await self._http.send(self._http.build_request(**request, extensions=extensions), stream=True)

    async def _trace(self, event: str, info: Mapping[str, Any]) -> None:
        if event.endswith(OPENED):
            self._stream = info["return_value"]

    def drop(self) -> None:
        """Closes it in a task, which no cancellation of the caller stops."""
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:  # the loop has ended, and the connection with it
            return
        task = loop.create_task(self.close())
        self._closing.add(task)  # a loop alone does not keep its tasks
        task.add_done_callback(self._closing.discard)

    async def close(self) -> None:
        with contextlib.suppress(Exception):
            await self._http.aclose()
        with contextlib.suppress(Exception):
            # what was stopped while it was opened is not known to the library
            if self._stream is not None:
                await self._stream.aclose()


class Place:
    """What an event loop has: connections, and how many calls may be under way."""

    def __init__(self) -> None:
        self.process = os.getpid()
        self.idle: collections.deque[AsyncLine] = collections.deque()
        self.short = asyncio.Semaphore(MOST_AT_ONCE)
        self.long = asyncio.Semaphore(MOST_AT_ONCE)


class AsyncStream:
    """An answer that is read as it comes."""

    def __init__(self, response: httpx.Response) -> None:
        self.response = response

    async def read(self) -> None:
        await self.response.aread()

    def pieces(self) -> AsyncIterator[bytes]:
        return self.response.aiter_raw()


class AsyncPool:
    """The connections of a client of asyncio, apart for each event loop."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._closed = False
        self._places: dict[asyncio.AbstractEventLoop, Place] = {}

    async def call(self, request: Request, deadline: float | None = None, waits: bool = False) -> httpx.Response:
        """Sends a request, and reads the whole answer; see `Pool.call`.

        waits: whether the service holds back its answer; such calls take no places from others
        """
        place = self._place()

        async def act() -> httpx.Response:
            async with place.long if waits else place.short:
                line = self._take(place)
                try:
                    response = await line.send(request)
                    await response.aread()
                except BaseException:
                    line.drop()
                    raise
                if self._closed or len(place.idle) >= MOST_IDLE:
                    line.drop()
                else:
                    place.idle.append(line)
                return response

        return await _within(act(), deadline)

    def crowded(self) -> bool:
        """Whether calls that wait for the end of a job wait for each other."""
        return self._place().long.locked()

    @contextlib.asynccontextmanager
    async def stream(self, request: Request) -> AsyncIterator[AsyncStream]:
        """Sends a request whose answer is read as it comes."""
        line = self._take(self._place())
        try:
            yield AsyncStream(await line.send(request))
        finally:
            line.drop()

    async def aclose(self) -> None:
        self._closed = True
        place = self._places.pop(asyncio.get_running_loop(), None)
        for line in place.idle if place else ():
            await line.close()
        self._places.clear()

    def _place(self) -> Place:
        loop = asyncio.get_running_loop()
        place = self._places.get(loop)
        if place is None or place.process != os.getpid():
            # connections of a loop that has ended are of no use to anybody
            self._places = {other: place for other, place in self._places.items() if not other.is_closed()}
            place = self._places[loop] = Place()
        return place

    def _take(self, place: Place) -> AsyncLine:
        if self._closed:
            raise RuntimeError("this client is closed")
        return place.idle.pop() if place.idle else AsyncLine(self._settings)


async def _within(work: Awaitable[T], deadline: float | None) -> T:
    if deadline is None:
        return await work
    try:
        return await asyncio.wait_for(work, max(0.0, deadline - time.monotonic()))
    except asyncio.TimeoutError:
        raise httpx.ReadTimeout("no answer in time") from None
