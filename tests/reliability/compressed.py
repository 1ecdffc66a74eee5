"""Compressed bodies, and files that are archives: never unpacked beyond the limits (R12).

    compressed.py [--soak]

A few kilobytes that would become 10 GiB: as gzip, deflate, br and zstd, one around the other, as a body of JSON and as
a mesh in a gzip, zip or npz file; and compressed messages over gRPC. Each is refused at once with the status that tells
why, and takes neither memory nor time. Many that stay open share the memory for bodies with the windows of their decoders.
Honest bodies as gzip and zstd are taken, and large answers come as either.
"""

import gzip
import http.client
import select
import struct
import time
import zlib

import grpc
import zstandard

from attack import DATA, END_STREAM, HEADERS, MIB, PREFACE, SOAK, Attacked, Bystander, check, equal, frame, frames_of, head, settings
from outside import TOP, Answer, example, submission

UNPACKED = 10 << 30
MESH = (TOP / "tests/data/gmsh/fillet-mixed-msh41-ascii.msh").read_bytes()
ROUNDS = 20 if SOAK else 1
MOST_MEMORY, MOST_CPU_S = 32 * MIB, 0.5
# of a small body; the small form runs beside other tests. 10 MB that may be a mesh are read to the end.
MOST_S, MOST_LARGE_S = 0.5 if SOAK else 2, 2


def layer(content, wbits):
    packer = zlib.compressobj(9, zlib.DEFLATED, wbits)
    return packer.compress(content) + packer.flush()


def deflated(wbits):
    """10 GiB of spaces: in the middle the same bytes again and again, since a GiB takes seconds to pack. A full flush
    leaves nothing that later blocks refer to, and so they may be repeated."""
    packer = zlib.compressobj(9, zlib.DEFLATED, wbits)
    unit = 64 * MIB
    start = packer.compress(b" " * MIB) + packer.flush(zlib.Z_FULL_FLUSH)
    block = packer.compress(b" " * unit) + packer.flush(zlib.Z_FULL_FLUSH)
    return start + block * (UNPACKED // unit)


def nested(wbits):
    """10 GiB in gzip in gzip in gzip: some kilobytes."""
    return layer(layer(deflated(wbits), wbits), wbits)


def zstd():
    """A frame of 10 GiB: blocks that repeat one byte 128 KiB times. Four bytes each, fewer than the library needs."""
    most = 128 << 10
    block = struct.pack("<I", most << 3 | 1 << 1)[:3] + b" "
    last = struct.pack("<I", most << 3 | 1 << 1 | 1)[:3] + b" "
    return b"\x28\xb5\x2f\xfd\xc0\x38" + struct.pack("<Q", UNPACKED) + block * (UNPACKED // most - 1) + last


# an uncompressed meta-block cannot say 10 GiB in a few bytes, but whoever decodes br must first read this one: 16 MiB of
# window, and a meta-block of 16 MiB that never comes
BR = b"\x0b\xff\xff\x87" + bytes(range(256)) * 40


def window():
    """The beginning of a frame that refers to its last 8 MiB, and fills them: 256 KiB as they are, for which the rest is not
    too much, then blocks as above."""
    most = 128 << 10
    plain = struct.pack("<I", most << 3)[:3] + b" " * most
    block = struct.pack("<I", most << 3 | 1 << 1)[:3] + b" "
    return b"\x28\xb5\x2f\xfd\0\x68" + plain * 2 + block * 62


def archive(name, content):
    """A zip file with one member, whose content is there already deflated: 10 GiB by its own account."""
    # by hand: zipfile would pack the 10 GiB
    member = name.encode()
    size = struct.pack("<HHQQ", 1, 16, UNPACKED, len(content))
    local = struct.pack("<4s5H3I2H", b"PK\3\4", 45, 0, 8, 0, 0, 0, 0xFFFFFFFF, 0xFFFFFFFF, len(member), len(size)) + member + size
    central = struct.pack("<4s6H3I5H2I", b"PK\1\2", 45, 45, 0, 8, 0, 0, 0, 0xFFFFFFFF, 0xFFFFFFFF, len(member), len(size), 0, 0, 0, 0, 0)
    central += member + size
    end = struct.pack("<4s4H2IH", b"PK\5\6", 0, 0, 1, 1, len(central), len(local) + len(content), 0)
    return local + content + central + end


class Measured:
    """What the server used for one request."""

    def __init__(self, server, what, size=0):
        self.server, self.what, self.most_s = server, what, MOST_LARGE_S if size > MIB else MOST_S

    def __enter__(self):
        self.server.forget_peak()
        self.memory, self.cpu, self.began = self.server.memory(), self.server.cpu_s(), time.monotonic()

    def __exit__(self, kind, *_):
        if kind is not None:
            return
        took, cpu = time.monotonic() - self.began, self.server.cpu_s() - self.cpu
        grown = self.server.peak() - self.memory
        worst["memory"], worst["cpu"] = max(worst["memory"], grown), max(worst["cpu"], cpu)
        worst["time"], worst["requests"] = max(worst["time"], took), worst["requests"] + 1
        check(grown < MOST_MEMORY, "%s: memory grew by %.1f MiB" % (self.what, grown / MIB))
        check(cpu < MOST_CPU_S, "%s: %.2f s of CPU" % (self.what, cpu))
        check(took < self.most_s, "%s: refused after %.2f s" % (self.what, took))


worst = dict(memory=0, cpu=0, time=0, requests=0)


def post(server, path, body, headers):
    """As the server's own client does, but reads the answer though the server takes no more of the body."""
    connection = http.client.HTTPConnection(server.address, timeout=20)
    try:
        connection.putrequest("POST", path)
        for name, value in {"content_type": "application/json", **headers}.items():
            connection.putheader(name.replace("_", "-"), value)
        connection.putheader("content-length", str(len(body)))
        try:
            connection.endheaders(body)
        except OSError:
            pass  # it has been refused already
        response = connection.getresponse()
        return Answer(response.status, {name.lower(): value for name, value in response.getheaders()}, response.read())
    finally:
        connection.close()


def refused(server, path, body, wanted, what, **headers):
    with Measured(server, what, len(body)):
        answer = post(server, path, body, headers)
    found = answer.status, answer.json().get("code")
    check(found in wanted, "%s: %r" % (what, answer))
    equal(answer.headers["content-type"], "application/problem+json", what)
    return "%d %s" % found


UNDERSTOOD = ("gzip", "zstd")


def bodies(server, packed):
    """Bodies of JSON with a Content-Encoding."""
    for encoding, body in packed.items():
        wanted = (413, "payload-too-large") if encoding in UNDERSTOOD else (415, "unsupported-media")
        for path in ("/v1/jobs", "/v1/jobs/batch", "/v1/problems/validate"):
            found = refused(server, path, body, [wanted], "%s to %s" % (encoding, path), content_encoding=encoding)
        print("Content-Encoding %s, %d bytes: %s" % (encoding, len(body), found))
    answer = server.call("POST", "/v1/problems/validate", {"problem": {}}, content_encoding="br")
    equal((answer.status, answer.headers["accept-encoding"]), (415, "gzip, zstd"), "what would be taken")
    # an encoding that is not told: then it is not JSON
    for encoding, body in packed.items():
        found = refused(server, "/v1/problems/validate", body, [(400, "malformed-json")], "untold " + encoding)
    print("without Content-Encoding: " + found)
    # no lie: `identity` is no encoding
    answer = server.call("POST", "/v1/problems/validate", {"problem": {}}, content_encoding="identity")
    equal(answer.status, 200, "a body that is not encoded and says so")


# as what it is not, or as what is not taken
REFUSED = [(422, "invalid-problem"), (415, "unsupported-media")]


def meshes(server, packed):
    """Files that hold a mesh, or would."""
    files = {
        "a gzip file": packed["gzip"],
        "a gzip file in a gzip file": packed["gzip, gzip, gzip"],
        "a zip file": archive("mesh.msh", deflated(-15) + b"\3\0"),
        "an npz file": archive("points.npy", deflated(-15) + b"\3\0"),
        "a zstd file": packed["zstd"],
    }
    for what, content in files.items():
        for headers in ({}, {"content_type": "application/octet-stream"}, {"content_type": "application/zip"}):
            found = refused(server, "/v1/meshes", content, REFUSED, what, **headers)
        print("%s as a mesh, %d bytes: %s" % (what, len(content), found))
    for encoding in UNDERSTOOD:
        found = refused(server, "/v1/meshes", packed[encoding], [(413, "payload-too-large")], "a mesh as " + encoding,
                        content_encoding=encoding)
    print("a mesh with Content-Encoding: " + found)
    found = refused(server, "/v1/meshes", packed["gzip, gzip, gzip"], REFUSED, "a mesh as gzip in gzip in gzip",
                    content_encoding="gzip")
    print("a mesh as gzip in gzip in gzip: " + found)
    equal(server.json("/v1/meshes")["meshes"], [], "meshes that were stored")


def honest(server, job):
    """What is smaller than the limits is taken, and answers come in either coding."""
    pack = {"gzip": gzip.compress, "zstd": zstandard.ZstdCompressor().compress}
    unpack = {"gzip": gzip.decompress, "zstd": lambda body: zstandard.ZstdDecompressor().decompressobj().decompress(body)}
    plain = server.call("POST", "/v1/problems/validate", submission(example())).json()
    known = server.call("POST", "/v1/meshes", MESH, content_type="application/octet-stream").json()["hash"]
    for encoding in UNDERSTOOD:
        answer = server.call("POST", "/v1/problems/validate", pack[encoding](submission(example())), content_encoding=encoding)
        equal((answer.status, answer.json()), (200, plain), "a problem as " + encoding)
        answer = server.call("POST", "/v1/meshes", pack[encoding](MESH), content_encoding=encoding,
                             content_type="application/octet-stream")
        equal((answer.status, answer.json()["hash"]), (200, known), "a mesh as %s, %r" % (encoding, answer))
        cut = server.call("POST", "/v1/problems/validate", pack[encoding](submission(example()))[:-8], content_encoding=encoding)
        equal((cut.status, cut.json()["code"]), (400, "malformed-json"), "a body as %s that is cut off" % encoding)
        path = "/v1/jobs/%s/fields" % job
        fields, answer = server.call("GET", path), server.call("GET", path, accept_encoding=encoding)
        equal(answer.headers["content-encoding"], encoding, "the coding of an answer")
        equal(unpack[encoding](answer.body), fields.body, "fields as " + encoding)
        check(len(answer.body) < 0.8 * len(fields.body), "%d of %d bytes" % (len(answer.body), len(fields.body)))
    equal(server.call("DELETE", "/v1/meshes/" + known).status, 204, "deleting the mesh")


RECEIVED = 16 * MIB
STREAMS = 200 if SOAK else 50
# the limit has room for so many windows
MOST_HELD = RECEIVED // (8 * MIB)
# an upload that is not refused yet has buffers: on its way from the socket to the file
OF_STREAM = MIB


def held_open():
    """Uploads that fill the windows of their decoders, and then stay: the limit on bodies is for all of them together."""
    with Attacked("--max-received-bytes", str(RECEIVED)) as server:
        server.finished_job()
        server.forget_peak()
        before, streams = server.memory(), []
        with Bystander(server):
            for _ in range(STREAMS):
                stream = server.socket()
                streams.append(stream)
                lines = ("POST /v1/meshes HTTP/1.1", "host: " + server.address, "content-encoding: zstd", "content-length: %d" % MIB)
                try:
                    stream.sendall("\r\n".join((*lines, "", "")).encode() + window())
                except OSError:
                    pass  # it has been refused already
            waiting, told, end = set(streams), [], time.monotonic() + 60
            while len(waiting) > MOST_HELD:
                check(time.monotonic() < end, "%d of %d streams have a window of 8 MiB each" % (len(waiting), STREAMS))
                for stream in select.select(list(waiting), [], [], 1)[0]:
                    waiting.remove(stream)
                    told.append(stream.recv(4096))
            grown = server.peak() - before
            for stream in streams:
                stream.close()
        for answer in told:
            check(answer.startswith(b"HTTP/1.1 503 "), "the answer to an upload for which there is no room: %r" % answer[:100])
        check(grown < RECEIVED + STREAMS * OF_STREAM, "%d streams took %.1f MiB" % (STREAMS, grown / MIB))
        server.stop()
    print("%d streams that stay open: %d refused, memory %+.1f MiB" % (STREAMS, len(told), grown / MIB))


def messages(server, packed):
    """Messages of gRPC that say they are compressed."""
    for encoding in ("gzip", "deflate", "zstd", "br", "none of these"):
        for method in ("CreateJob", "ValidateProblem", "UploadMesh"):
            # as much as may be sent before the server gives way for more
            content = packed.get(", ".join([encoding] * 3) if encoding == "gzip" else encoding, b"x" * 10000)[:60000]
            with Measured(server, "%s over gRPC" % encoding), server.socket() as connection:
                connection.settimeout(10)
                call = head("POST", "/signorini.v1.JobService/" + method, 1, content_type="application/grpc", te="trailers",
                            grpc_encoding=encoding)
                message = b"\1" + struct.pack(">I", len(content)) + content
                connection.sendall(PREFACE + settings() + call)
                for place in range(0, len(message), 16000):
                    last = place + 16000 >= len(message)
                    connection.sendall(frame(DATA, END_STREAM if last else 0, 1, message[place:place + 16000]))
                flags = next(flags for kind, flags, _, _ in frames_of(connection) if kind == HEADERS)
                check(flags & END_STREAM, "%s over gRPC was not refused" % encoding)
    # what a client sees of it
    with grpc.insecure_channel(server.address, compression=grpc.Compression.Gzip) as channel:
        for method in ("CreateJob", "ValidateProblem"):
            call = channel.unary_unary("/signorini.v1.JobService/" + method)
            try:
                with Measured(server, "gzip over gRPC"):
                    call(b" " * 100000, timeout=10)
                check(False, "a compressed message was accepted")
            except grpc.RpcError as error:
                equal(error.code().name, "UNIMPLEMENTED", "the answer to a compressed message, %s" % error.details())
    print("compressed messages over gRPC: refused, to a client UNIMPLEMENTED")


def main():
    bomb = deflated(31)
    packed = {
        "gzip": bomb,
        "deflate": deflated(15),
        "gzip, gzip, gzip": nested(31),
        "br": BR,
        "zstd": zstd(),
        "x-unknown": b"x" * 10000,
    }
    assert zlib.decompressobj(31).decompress(bomb, 100) == b" " * 100
    with Attacked() as server:
        job = server.finished_job()
        honest(server, job)
        with Bystander(server):
            for _ in range(ROUNDS):
                bodies(server, packed)
                meshes(server, packed)
                messages(server, packed)
        equal([one["id"] for one in server.every_job()], [job], "the jobs there are")
        server.stop()
    held_open()
    print("figure: %d compressed bodies, files and messages, of which the smallest (%d bytes) would become 10 GiB: all refused, "
          "memory at most %+.1f MiB, %.2f s of CPU and %.0f ms each" % (
              worst["requests"], len(packed["gzip, gzip, gzip"]), worst["memory"] / MIB, worst["cpu"], 1e3 * worst["time"]))


main()
