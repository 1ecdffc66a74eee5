"""Bodies and answers that are larger, slower or more than a server can hold (R11; bodies and readers in sum).

    transfers.py [--soak]

Declared lengths that lie, bodies without end, messages whose parts take a thousand times their bytes, a hundred large
bodies at once, and readers who do not read: each is refused or waits, a bystander is answered, and memory stays within
what the service has for transfers.
"""

import socket
import struct
import threading
import time

import grpc

from attack import (
    DATA, END_STREAM, HEADERS, MIB, PREFACE, SOAK, Attacked, Bystander, check, equal, example, frame, frames_of, get,
    head, settings,
)

# what bodies and answers may take together (64 + 128 MiB), and 10 × the two bodies that are read at a time
RECEIVED, SENT = 64 * MIB, 128 * MIB
UPLOADS = 100 if SOAK else 20
READERS = 50 if SOAK else 30
LONGEST_REFUSAL_S = 0.05
# values of FieldFormat
VTU, JSON = b"\x01", b"\x03"


def post(server, path, headers, pieces):
    """Sends as much as the server takes; its status, and seconds until it had answered."""
    began, connection = time.monotonic(), server.socket()
    sent = 0
    try:
        head = ["POST %s HTTP/1.1" % path, "host: localhost", "content-type: application/json", *headers, "", ""]
        connection.sendall("\r\n".join(head).encode())
        connection.settimeout(0)
        for piece in pieces:
            while piece:
                try:
                    count = connection.send(piece)
                    piece, sent = piece[count:], sent + count
                except BlockingIOError:
                    time.sleep(0.001)
                except OSError:
                    piece = b""
                if answered(connection):
                    break
            if answered(connection) or sent > 300 * MIB:
                break
        connection.settimeout(60)
        status = int(connection.recv(1 << 16).split()[1])
    finally:
        connection.close()
    return status, time.monotonic() - began, sent


def answered(connection):
    try:
        return bool(connection.recv(1, socket.MSG_PEEK))
    except BlockingIOError:
        return False
    except OSError:
        return True


def oversize(server):
    """Single requests that are too large, or say so."""
    endless = lambda: (b"10000\r\n" + b" " * (1 << 16) + b"\r\n" for _ in range(10 << 10))
    kinds = {
        "a declared TiB": (["content-length: %d" % (1 << 40)], iter([b"{"])),
        "17 MiB": (["content-length: %d" % (17 * MIB)], iter([b" " * MIB] * 17)),
        "chunks without end": (["transfer-encoding: chunked"], endless()),
    }
    server.forget_peak()
    longest, memory = 0, server.memory()
    for name, (headers, pieces) in kinds.items():
        status, time_s, sent = post(server, "/v1/jobs", headers, pieces)
        equal(status, 413, name)
        print("%s: 413 after %.0f ms and %.1f MiB" % (name, 1000 * time_s, sent / MIB))
        if name == "a declared TiB":
            longest = time_s
            check(time_s < LONGEST_REFUSAL_S, "%s: refused after %.3f s" % (name, time_s))
    # a mesh may be larger: 512 MiB, to a file
    status, _, _ = post(server, "/v1/meshes", ["content-length: %d" % (10 << 30)], iter([b"x"]))
    equal(status, 413, "a mesh of 10 GiB")
    with server.socket() as connection:  # a message of 1 GiB over gRPC, by its own declaration
        connection.settimeout(10)
        lie = frame(DATA, 0, 1, b"\0" + struct.pack(">I", 1 << 30))
        call = head("POST", "/signorini.v1.JobService/CreateJob", 1, content_type="application/grpc", te="trailers")
        connection.sendall(PREFACE + settings() + call + lie)
        answered = next(flags for kind, flags, _, _ in frames_of(connection) if kind == HEADERS)
        check(answered & END_STREAM, "a message of 1 GiB was not refused")
    grown = (server.peak() - memory) / MIB
    check(grown < 32, "memory grew by %.1f MiB" % grown)
    return "a body that declares 1 TiB was refused after %.0f ms, memory %+.0f MiB" % (1000 * longest, grown)


def empty_parts(server):
    """BatchCreateJobs with half a million empty jobs."""
    message, results = b"\x0a\x00" * (MIB // 2 - 8), []

    def call():
        with grpc.insecure_channel(server.address) as channel:
            batch = channel.unary_unary("/signorini.v1.JobService/BatchCreateJobs")
            try:
                batch(message, timeout=60)
                results.append("OK")
            except grpc.RpcError as error:
                results.append(error.code().name)

    server.forget_peak()
    memory = server.memory()
    together([call] * 10)
    equal(set(results), {"OUT_OF_RANGE"}, "answers to batches of empty jobs")
    with grpc.insecure_channel(server.address) as channel:
        try:
            channel.unary_unary("/signorini.v1.JobService/GetJob")(b"\xff\xff\xff", timeout=10)
            check(False, "three bytes that are no message were accepted")
        except grpc.RpcError as error:
            equal(error.code().name, "INVALID_ARGUMENT", "bytes that are no message")
    grown = (server.peak() - memory) / MIB
    check(grown < 64, "memory grew by %.0f MiB" % grown)
    return "10 batches of 524,280 empty jobs: refused, memory %+.0f MiB" % grown


def together(calls):
    threads = [threading.Thread(target=call) for call in calls]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def many_bodies(server):
    """Bodies of 16 MiB, nearly complete, all at the same time."""
    body = b'{"problem": {"title": "' + b"x" * (16 * MIB - 100)
    statuses, gate = [], threading.Barrier(UPLOADS)

    def upload():
        connection = server.socket()
        try:
            head = "POST /v1/problems/validate HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: %d\r\n\r\n"
            connection.sendall((head % (len(body) + 4)).encode())
            try:
                connection.sendall(body)
            except OSError:
                pass
            gate.wait(60)
            try:
                connection.sendall(b'"}}x')
            except OSError:
                pass
            connection.settimeout(60)
            statuses.append(int(connection.recv(1 << 16).split()[1]))
        finally:
            connection.close()

    server.forget_peak()
    memory = server.memory()
    with Bystander(server):
        together([upload] * UPLOADS)
    refused = statuses.count(503)
    equal(len(statuses), UPLOADS, "answers to large bodies")
    check(refused >= UPLOADS - 5, "only %d of %d were refused: %r" % (refused, UPLOADS, statuses))
    grown = server.peak() - memory
    check(grown < RECEIVED + 64 * MIB, "memory grew by %.0f MiB" % (grown / MIB))
    return "%d bodies of 16 MiB at once: %d refused with 503, memory %+.0f MiB" % (UPLOADS, refused, grown / MIB)


def slow_readers(server, job):
    """Downloads that nobody reads: one connection each, and a hundred streams on one."""
    with server.socket() as one:  # the size of one
        one.sendall(b"GET /v1/jobs/%s/fields HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n" % job.encode())
        size = 0
        while got := one.recv(1 << 20):
            size += len(got)
    server.forget_peak()
    memory, stalled = server.memory(), []
    with Bystander(server):
        for number in range(READERS):
            connection = server.socket()
            connection.sendall(b"GET /v1/jobs/%s/fields HTTP/1.1\r\nhost: localhost\r\n\r\n" % job.encode())
            stalled.append(connection)
        streams = server.socket()
        streams.sendall(PREFACE + settings(window=0))
        for number in range(100):
            streams.sendall(get("/v1/jobs/%s/fields" % job, 2 * number + 1))
        stalled.append(streams)
        time.sleep(5)
        refused = 0
        for connection in stalled[:READERS]:
            connection.settimeout(30)
            refused += connection.recv(12) == b"HTTP/1.1 503"
    grown = server.peak() - memory
    for connection in stalled:
        connection.close()
    check(grown < SENT + 2 * 4 * size + 32 * MIB, "memory grew by %.0f MiB" % (grown / MIB))
    return "%d connections and 100 streams that do not read %.0f MiB each: memory %+.0f MiB, %d refused" % (
        READERS, size / MIB, grown / MIB, refused)


def slow_calls(server, job):
    """Downloads over gRPC that nobody reads, as they are stored and in a format that is made for each."""
    server.forget_peak()
    memory = server.memory()
    with Bystander(server), server.socket() as calls:
        calls.sendall(PREFACE + settings(window=0))
        for number in range(100):
            stream = 2 * number + 1
            # field 1 is the job, field 2 the format
            message = b"\x0a" + bytes([len(job)]) + job.encode() + b"\x10" + (VTU if number % 2 else JSON)
            call = head("POST", "/signorini.v1.JobService/StreamResult", stream, content_type="application/grpc", te="trailers")
            calls.sendall(call + frame(DATA, END_STREAM, stream, b"\0" + struct.pack(">I", len(message)) + message))
        time.sleep(5)
    grown = server.peak() - memory
    # the files that are made and wait, what two conversions take, and two pieces of 256 KiB for each call: one read, one
    # encoded
    check(grown < SENT + 2 * 4 * 5 * MIB + 100 * MIB // 2 + 32 * MIB, "memory grew by %.0f MiB" % (grown / MIB))
    return "100 calls over gRPC that do not read: memory %+.0f MiB" % (grown / MIB)


def larger_than_the_limit():
    """An answer that is larger than what all may take is sent alone."""
    with Attacked("--max-sent-bytes", str(1 << 16)) as server:
        job = server.finished(server.submit(example(refine=3)))["id"]
        equal(server.call("GET", "/v1/jobs/%s/fields?format=vtu" % job).status, 200, "a large answer")
        with grpc.insecure_channel(server.address) as channel:
            stream = channel.unary_stream("/signorini.v1.JobService/StreamResult")
            message = b"\x0a" + bytes([len(job)]) + job.encode() + b"\x10" + VTU
            received = sum(map(len, stream(message, timeout=30)))
        check(received > 1 << 16, "a file of %d bytes" % received)


larger_than_the_limit()
with Attacked() as server:
    large = server.finished(server.submit(example(refine=4)))["id"]
    figures = [oversize(server), empty_parts(server), many_bodies(server), slow_readers(server, large)]
    equal(server.call("GET", "/readyz").status, 200, "readiness after all")
# a server of its own: what readers held until they left is given back some time later, and what calls take meanwhile is
# not growth
with Attacked() as server:
    large = server.finished(server.submit(example(refine=4)))["id"]
    figures += [slow_calls(server, large)]
    equal(server.call("GET", "/readyz").status, 200, "readiness after calls")
print("figure: " + "; ".join(figures))
