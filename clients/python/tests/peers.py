"""What stands between a client and the service, or in its place: servers of a few lines on a port of their own."""

from __future__ import annotations

import contextlib
import random
import re
import socket
import threading
import urllib.parse
from collections.abc import Callable, Iterator

Handler = Callable[[socket.socket], None]


@contextlib.contextmanager
def listening(handler: Handler) -> Iterator[str]:
    """Gives each connection to `handler`, in a thread of its own; the address is returned."""
    listener = socket.create_server(("127.0.0.1", 0), backlog=512)

    def serve() -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = listener.accept()
                threading.Thread(target=handle, args=(connection,), daemon=True).start()

    def handle(connection: socket.socket) -> None:
        with contextlib.suppress(OSError), connection:
            handler(connection)

    threading.Thread(target=serve, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        # a thread that waits in accept() wakes up
        with contextlib.suppress(OSError):
            listener.shutdown(socket.SHUT_RDWR)
        listener.close()


def request(connection: socket.socket) -> tuple[bytes, bytes]:
    """Head and body of the next request; empty at the end."""
    got = b""
    while b"\r\n\r\n" not in got:
        piece = connection.recv(65536)
        if not piece:
            return b"", b""
        got += piece
    head, _, body = got.partition(b"\r\n\r\n")
    length = re.search(rb"content-length: (\d+)", head, re.I)
    while length and len(body) < int(length[1]):
        body += connection.recv(65536)
    return head, body


def answering(answer: bytes) -> Handler:
    """The same answer to every request."""

    def handler(connection: socket.socket) -> None:
        while request(connection)[0]:
            connection.sendall(answer)

    return handler


def answer(status: str, media: str = "", body: bytes = b"", **headers: str) -> bytes:
    lines = [f"HTTP/1.1 {status}", f"Content-Length: {len(body)}"]
    lines += [f"Content-Type: {media}"] if media else []
    lines += [f"{name.replace('_', '-')}: {value}" for name, value in headers.items()]
    return "\r\n".join([*lines, "", ""]).encode() + body


def relayed(url: str, head: bytes, body: bytes, *, protocol: bytes = b"HTTP/1.1") -> tuple[bytes, bytes]:
    """Head and body of the service's answer to a request, which is passed on over a connection of its own."""
    first, *lines = head.split(b"\r\n")
    kept = [line for line in lines if not line.lower().startswith((b"connection:", b"host:"))]
    place = urllib.parse.urlsplit(url)
    assert place.hostname and place.port
    first = first.rpartition(b" ")[0] + b" " + protocol
    lines = [first, b"Host: " + place.netloc.encode(), b"Connection: close", *kept]
    with socket.create_connection((place.hostname, place.port)) as service:
        service.sendall(b"\r\n".join(lines) + b"\r\n\r\n" + body)
        got = b""
        while piece := service.recv(65536):
            got += piece
    head, _, body = got.partition(b"\r\n\r\n")
    return head, body


def halving(url: str, share: float) -> Handler:
    """A proxy that speaks HTTP/1.0 to the service, and passes on the part of an answer that it gets as if it were all
    of it: one without a length ends with its connection."""

    def handler(connection: socket.socket) -> None:
        asked, sent = request(connection)
        if not asked:
            return
        head, body = relayed(url, asked, sent, protocol=b"HTTP/1.0")
        cut = body[: int(share * len(body))]
        lines = [
            line for line in head.split(b"\r\n")[1:] if not line.lower().startswith((b"content-length", b"connection"))
        ]
        chunk = b"%x\r\n%s\r\n" % (len(cut), cut) if cut else b""
        connection.sendall(
            b"\r\n".join([b"HTTP/1.1 " + head.split(b" ", 1)[1].split(b"\r\n")[0], *lines, b"Connection: close"])
            + b"\r\nTransfer-Encoding: chunked\r\n\r\n" + chunk + b"0\r\n\r\n"
        )  # fmt: skip

    return handler


def cutting(url: str, chance: random.Random, share: float) -> Handler:
    """Passes bytes on in both directions, and cuts a share of the connections after some of them."""
    place = urllib.parse.urlsplit(url)
    assert place.hostname and place.port

    def handler(connection: socket.socket) -> None:
        left = [chance.randrange(1, 20_000) if chance.random() < share else 1 << 40]
        with socket.create_connection((place.hostname or "", place.port or 0)) as service:

            def pass_on(source: socket.socket, sink: socket.socket) -> None:
                with contextlib.suppress(OSError):
                    while piece := source.recv(65536):
                        sink.sendall(piece[: max(left[0], 0)])
                        left[0] -= len(piece)
                        if left[0] <= 0:
                            break
                for end in (source, sink):
                    with contextlib.suppress(OSError):
                        end.shutdown(socket.SHUT_RDWR)

            back = threading.Thread(target=pass_on, args=(service, connection), daemon=True)
            back.start()
            pass_on(connection, service)
            back.join()

    return handler


def silent(connection: socket.socket) -> None:
    """Takes a request, and says nothing."""
    while connection.recv(65536):
        pass


def trickling(connection: socket.socket) -> None:
    """Answers, a byte every tenth of a second."""
    request(connection)
    pause = threading.Event().wait
    for byte in answer("200 OK", "application/json", b" " * 10_000):
        connection.sendall(bytes([byte]))
        pause(0.1)


@contextlib.contextmanager
def relay_that_loses(url: str, method: bytes) -> Iterator[str]:
    """A relay that loses its first answer to a method."""
    lost: list[bytes] = []

    def handler(connection: socket.socket) -> None:
        asked, sent = request(connection)
        if not asked:
            return
        head, body = relayed(url, asked, sent)
        if asked.startswith(method) and not lost:
            lost.append(asked)
            return
        connection.sendall(head + b"\r\nConnection: close\r\n\r\n" + body)

    with listening(handler) as address:
        yield address
    assert lost, "nothing was lost"
