"""Connections that ask nothing, or never finish asking: others are answered, and these are closed (R8, R14, R15).

    connections.py [--soak]

A server that may open 300 files (--soak: 1,700) is given three times as many idle connections; a bystander opens new ones meanwhile and is
answered at once. Heads and bodies of requests that stop half-way are closed after 30 s and 60 s, idle connections after
75 s; so are TLS handshakes that stop. Clients that vanish in the middle of anything leave nothing behind, and cancel nothing.
"""

import pathlib
import random
import socket
import sys
import tempfile
import time

from attack import MIB, PREFACE, SOAK, Attacked, Bystander, check, equal, example, get, settings
from outside import submission

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "clients"))
from certificates import Authority

FILES = 1700 if SOAK else 300
HALF = 2000 if SOAK else 100
VANISHING = 10000 if SOAK else 1000
HEAD_S, BODY_S, IDLE_S = 30, 60, 75
# a client's first message, of which the second half never comes
HELLO = b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(200)
HEAD = b"POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: 5000\r\n\r\n{\"pro"


def crowded():
    """More idle connections than there are files."""
    limited = ("prlimit", "--nofile=%d" % FILES)
    with Attacked(wrapper=limited) as server:
        idle = []
        with Bystander(server):
            for _ in range(3 * FILES):
                idle.append(server.socket())
            time.sleep(2)
        closed = sum(is_closed(one) for one in idle)
        check(closed >= 2 * FILES, "of %d connections only %d were closed" % (len(idle), closed))
        for one in idle:
            one.close()
    return "%d idle connections at a limit of %d files disturb nobody" % (3 * FILES, FILES)


def is_closed(connection):
    connection.setblocking(False)
    try:
        return connection.recv(1) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def half_requests(server, encrypted):
    """Connections of each kind that stop, to a server and one that speaks TLS, and when the server closed the last of each."""
    kinds = {
        "no byte": (b"", HEAD_S),
        "half a head": (b"GET /v1/jobs HTTP/1.1\r\nhost: localhost\r\nx-slow: ", HEAD_S),
        "half a preface of HTTP/2": (PREFACE[:9], HEAD_S),
        "HTTP/2 without a request": (PREFACE + settings(), HEAD_S),
    }
    if SOAK:
        waiting = server.submit(example())  # the queue is paused
        unread = get("/v1/jobs/" + server.finished_job(), 1) + get("/v1/jobs/%s/events" % waiting, 3)
        kinds.update({
            "an answer of which one byte is read, beside a stream": (PREFACE + settings(window=1) + unread, BODY_S),
            "half a body": (HEAD, BODY_S),
            "idle after an answer": (b"GET /livez HTTP/1.1\r\nhost: localhost\r\n\r\n", IDLE_S),
            "idle after an answer over HTTP/2": (PREFACE + settings() + get("/livez", 1), IDLE_S),
        })
    stalled = {"TLS: no byte": (b"", HEAD_S), "TLS: half a handshake": (HELLO, HEAD_S)}
    kinds.update(stalled)
    open_ones, times = {}, {}
    with Bystander(server):
        began = time.monotonic()
        for name, (sent, _) in kinds.items():
            asked = encrypted if name in stalled else server
            open_ones[name] = [asked.socket() for _ in range(HALF // len(kinds))]
            for one in open_ones[name]:
                one.sendall(sent)
        while any(open_ones.values()):
            check(time.monotonic() < began + 100, "still open: %r" % {n: len(o) for n, o in open_ones.items() if o})
            time.sleep(0.2)
            for name, ones in open_ones.items():
                still = [one for one in ones if not ended(one)]
                if ones and not still:
                    times[name] = time.monotonic() - began
                open_ones[name] = still
    for name, (_, most) in kinds.items():
        print("%s: closed after %.0f s" % (name, times[name]))
        check(most - 2 <= times[name] <= most + 12, "%s: closed after %.1f s, not %d" % (name, times[name], most))
    return "%d requests that stop half-way were closed after %s s" % (
        HALF, " to ".join("%.0f" % t for t in (min(times.values()), max(times.values()))))


def ended(connection):
    """Reads what there is; whether the connection is closed."""
    connection.setblocking(False)
    try:
        while True:
            if not connection.recv(1 << 16):
                connection.close()
                return True
    except BlockingIOError:
        return False
    except OSError:
        connection.close()
        return True


def vanishing(server, job):
    """Clients that reset their connections in the middle of submits, waits, streams and downloads."""
    dice = random.Random(8)
    body = submission(example())
    submit = b"POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: %d\r\n\r\n" % len(body)
    server.call("POST", "/v1/queue/pause")
    slow = server.submit(example())
    asked = [
        submit + body, submit + body[:2000],
        b"GET /v1/jobs/%s?wait=30 HTTP/1.1\r\nhost: localhost\r\n\r\n" % slow.encode(),
        b"GET /v1/jobs/%s/events HTTP/1.1\r\nhost: localhost\r\n\r\n" % slow.encode(),
        b"GET /v1/jobs/%s/fields HTTP/1.1\r\nhost: localhost\r\n\r\n" % job.encode(),
        PREFACE + settings() + get("/v1/jobs/%s/events" % job, 1),
        PREFACE + settings(window=0) + get("/v1/jobs/%s/fields" % job, 1),
    ]
    files, memory = server.files(), server.memory()
    for number in range(VANISHING):
        connection = server.socket()
        # with this the connection is reset when it is closed
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        connection.sendall(asked[number % len(asked)])
        if dice.random() < 0.3:
            connection.settimeout(0.05)
            try:
                connection.recv(100)
            except OSError:
                pass
        connection.close()
    end = time.monotonic() + 10
    while server.files() > files + 5 and time.monotonic() < end:
        time.sleep(0.1)
    check(server.files() <= files + 5, "%d files are open, %d before" % (server.files(), files))
    grown = (server.memory() - memory) / MIB
    check(grown < 20, "memory grew by %.1f MiB" % grown)
    equal([j["id"] for j in server.every_job(status="canceled")], [], "jobs that a lost connection canceled")
    return "%d clients vanished: files back to %+d, memory %+.1f MiB, no job canceled" % (
        VANISHING, server.files() - files, grown)


figures = [crowded()]
with tempfile.TemporaryDirectory() as folder:
    authority = Authority(folder)
    options = authority.issue("service").options
    with Attacked() as server, Attacked(*options, ca=authority.file) as encrypted:
        job = server.finished_job()
        figures += [vanishing(server, job), half_requests(server, encrypted)]
        equal(encrypted.call("GET", "/livez").status, 200, "a request over TLS after the stalled ones")
print("figure: " + "; ".join(figures))
