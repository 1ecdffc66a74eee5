"""What the attacks have in common: what a server uses, a bystander who measures it, and HTTP/2 frame by frame.

    attack.py URL PATH

As a program it is the bystander: it asks for PATH again and again on new connections, until its input ends, and then
prints how long the answers took. It is a process of its own, so that the attacker's work does not slow it down.
"""

import http.client
import json
import pathlib
import select
import struct
import subprocess
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

from outside import Server, check, children, cpu_s, equal, example, memory, note, percentile

SOAK = "--soak" in sys.argv
MIB = 1 << 20
# the promise; the small form runs beside other tests and leaves a margin
MOST_P99_S = 0.1 if SOAK else 0.25


class Watch(threading.Thread):
    """The highest resident memory of a process and its worker processes together."""

    def __init__(self, pid):
        super().__init__(daemon=True)
        self.pid, self.highest, self.ended = pid, 0, False

    def run(self):
        while not self.ended:
            self.highest = max(self.highest, sum(map(memory, (self.pid, *children(self.pid)))))
            time.sleep(0.01)


class Attacked(Server):
    """A server whose use of memory, time and files is measured."""

    seen = None  # see `finished_job`

    def memory(self):
        return memory(self.process.pid)

    def peak(self):
        return memory(self.process.pid, "VmHWM")

    def forget_peak(self):
        self.note_peak()
        pathlib.Path("/proc/%d/clear_refs" % self.process.pid).write_text("5")

    def cpu_s(self):
        return cpu_s(self.process.pid)

    def files(self):
        return len(list(pathlib.Path("/proc/%d/fd" % self.process.pid).iterdir()))

    def socket(self):
        import socket

        host, port = self.address.split(":")
        return socket.create_connection((host, int(port)), timeout=120)

    def finished_job(self):
        """A small job that has succeeded, for others to ask about: always the same."""
        if self.seen is None:
            self.seen = self.finished(self.submit(example()))["id"]
        return self.seen


class Bystander:
    """Somebody else, who asks for a job all the time while something happens, and may not wait for long."""

    def __init__(self, server):
        self.server = server

    def __enter__(self):
        command = [sys.executable, __file__, self.server.address, "/v1/jobs/" + self.server.finished_job()]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.process.stdout.readline()  # it has begun
        return self

    def __exit__(self, kind, *_):
        told, _ = self.process.communicate()
        if kind is not None:
            return
        found = json.loads(told)
        equal(found["failed"], 0, "answers to the bystander that were not 200")
        note(p99_s=found["p99_s"], count=found["count"])
        check(found["p99_s"] <= MOST_P99_S, "the bystander waited %.3f s (p99 of %d)" % (found["p99_s"], found["count"]))


# so that one answer of a short attack is not taken for the slowest of a hundred
FEWEST_ANSWERS = 300


def stand_by(address, path):
    times, failed = [], 0
    print("begun", flush=True)
    while not select.select([sys.stdin], [], [], 0.01)[0] or len(times) < FEWEST_ANSWERS:
        began = time.monotonic()
        connection = http.client.HTTPConnection(address, timeout=60)
        try:
            connection.request("GET", path)
            answer = connection.getresponse()
            answer.read()
            failed += answer.status != 200
        except (OSError, http.client.HTTPException):
            failed += 1
        finally:
            connection.close()
        times.append(time.monotonic() - began)
    print(json.dumps({"count": len(times), "failed": failed, "p99_s": percentile(times, 0.99), "longest_s": max(times)}))


# HTTP/2, as far as an attacker needs it.
PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
DATA, HEADERS, PRIORITY, RST_STREAM, SETTINGS, PUSH, PING, GOAWAY, WINDOW_UPDATE, CONTINUATION = range(10)
END_STREAM, END_HEADERS = 1, 4


def frame(kind, flags=0, stream=0, content=b""):
    return struct.pack(">I", len(content))[1:] + bytes([kind, flags]) + struct.pack(">I", stream) + content


def settings(**values):
    numbers = {"window": 4, "streams": 3}
    return frame(SETTINGS, content=b"".join(struct.pack(">HI", numbers[name], value) for name, value in values.items()))


def head(method, path, stream, flags=END_HEADERS, **headers):
    """The HEADERS frame of a request, without compression. `content_type` becomes the header content-type."""
    def text(value):
        length = len(value)
        if length < 127:
            return bytes([length]) + value
        length -= 127
        return bytes([127]) + (bytes([length]) if length < 128 else bytes([length % 128 + 128, length // 128])) + value

    block = {"GET": b"\x82", "POST": b"\x83"}[method] + b"\x86"
    block += b"\x04" + text(path.encode()) + b"\x01" + text(b"localhost")
    for name, value in headers.items():
        block += b"\x00" + text(name.replace("_", "-").encode()) + text(value.encode())
    return frame(HEADERS, flags, stream, block)


def get(path, stream):
    """A complete request without a body."""
    return head("GET", path, stream, END_HEADERS | END_STREAM)


def frames_of(connection):
    """Kind, flags, stream and content of each frame that the server sends, until it closes the connection."""
    received = b""
    while True:
        while len(received) < 9 or len(received) < 9 + int.from_bytes(received[:3], "big"):
            more = connection.recv(1 << 16)
            if not more:
                return
            received += more
        length = int.from_bytes(received[:3], "big")
        yield received[3], received[4], int.from_bytes(received[5:9], "big"), received[9:9 + length]
        received = received[9 + length:]


if __name__ == "__main__":
    stand_by(*sys.argv[1:])
