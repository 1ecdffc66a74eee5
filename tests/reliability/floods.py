"""Floods of HTTP/2 frames end their connection, and disturb nobody (R16).

    floods.py [--soak]

PING, SETTINGS, PRIORITY, WINDOW_UPDATE, empty DATA, unknown frames, streams that are reset at once, headers that never
end, ten thousand streams: each on a connection of its own, as fast as the server reads, while a bystander asks for a
job. Each connection is closed by the server.
"""

import itertools
import struct
import time

from attack import (
    CONTINUATION, DATA, HEADERS, PING, PREFACE, PRIORITY, RST_STREAM, SOAK, WINDOW_UPDATE, Attacked, Bystander, check,
    frame, get, head, settings,
)

FRAMES = 1000000 if SOAK else 100000
LONGEST_S = 60 if SOAK else 10


def streams(frames_of):
    return lambda: (frames_of(2 * number + 1) for number in range(FRAMES))


def repeated(content):
    return lambda: (content for _ in range(FRAMES))


def headers_without_end():
    yield frame(HEADERS, 0, 1, b"\x82")
    for _ in range(FRAMES):
        yield frame(CONTINUATION, 0, 1, b"\x00\x01a\x01b" * 100)


FLOODS = {
    "PING": repeated(frame(PING, content=bytes(8))),
    "SETTINGS": repeated(settings()),
    "PRIORITY": repeated(frame(PRIORITY, 0, 1, bytes(5))),
    "WINDOW_UPDATE": repeated(frame(WINDOW_UPDATE, content=struct.pack(">I", 1))),
    "unknown frames": repeated(frame(77, content=bytes(4))),
    "rapid reset": streams(lambda s: get("/v1/info", s) + frame(RST_STREAM, 0, s, struct.pack(">I", 8))),
    "empty DATA": lambda: itertools.chain([head("POST", "/v1/jobs", 1, content_type="application/json")], repeated(frame(DATA, 0, 1))()),
    "CONTINUATION": headers_without_end,
    "10,000 streams at once": lambda: (get("/v1/info", 2 * number + 1) for number in range(10000)),
}


def flood(server, frames):
    """Sends them all, or until the server closes the connection: whether it did, and seconds."""
    began, waiting = time.monotonic(), []
    with server.socket() as connection:
        connection.settimeout(5)
        connection.sendall(PREFACE + settings(window=0))
        try:
            for one in frames:
                waiting.append(one)
                if len(waiting) == 500:
                    connection.sendall(b"".join(waiting))
                    waiting = []
                    check(time.monotonic() - began < LONGEST_S, "the flood was not ended")
            connection.sendall(b"".join(waiting))
            while connection.recv(1 << 16):
                pass
            closed = True
        except TimeoutError:
            closed = False
        except OSError:
            closed = True
    return closed, time.monotonic() - began


with Attacked() as server:
    lines = []
    with Bystander(server):
        for name, frames in FLOODS.items():
            cpu = server.cpu_s()
            closed, time_s = flood(server, frames())
            used = server.cpu_s() - cpu
            print("%s: %s after %.2f s, %.2f CPU s" % (name, "closed" if closed else "open", time_s, used))
            check(closed, name + " did not end the connection")
            check(used < 0.5, "%s used %.1f CPU s in %.1f s" % (name, used, time_s))
            lines.append(used)
        time.sleep(2)
    print("figure: %d kinds of floods, each ended its connection with at most %.2f CPU s" % (len(FLOODS), max(lines)))
