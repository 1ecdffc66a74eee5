"""A submit is answered only after its job is on the disk: the order of system calls, under strace (R2a).

Every post carries a word of its own. It is found in what the server reads from the connection, in what
it writes to SQLite's write-ahead log, and in the answer that it writes back; between the last two lies
an fdatasync (or an fsync, which does more) of the log that began after the first and returned 0 before
the second.
"""

import asyncio
import pathlib
import re
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import outside
from outside import Connection, Server, check, each, equal, example, submission

ALONE, TOGETHER, CLIENTS = 100, 100, 8
CALLS = "read,readv,recvfrom,recvmsg,write,writev,sendto,sendmsg,pwrite64,pwritev,fdatasync,fsync"
# pid, name, rest; a call that waited is logged twice, the second time with what it returned
CALL = re.compile(r"^(\d+) +(?:<\.\.\. )?(\w+)(\(| resumed>)(.*)$")
FILE = re.compile(r"\d+<[^>]*>")
WORD = re.compile(r"power-loss-\d{4}")


class Calls:
    """What strace saw, in order: when each call began and ended, on which file, with which words."""

    def __init__(self, log):
        self.calls, open_calls = [], {}
        for place, line in enumerate(log):
            found = CALL.match(line)
            if not found:
                continue
            pid, name, kind, rest = found.groups()
            if kind == "(":
                call = {"name": name, "file": FILE.match(rest).group(), "began": place, "text": rest}
                self.calls.append(call)
            else:
                call = open_calls.pop(pid)
                call["text"] += rest
            if rest.endswith("<unfinished ...>"):
                open_calls[pid] = call
            else:
                call["ended"], call["returned"] = place, rest.rsplit("= ", 1)[-1]
        for call in self.calls:
            call["words"] = set(WORD.findall(call["text"]))
            call["wal"] = call["file"].endswith("-wal>")

    def those(self, wanted):
        return [call for call in self.calls if wanted(call)]


def check_order(calls, word):
    """Read, logged, synced, answered; gives the lines between."""
    reads = calls.those(lambda c: c["name"] in ("read", "readv", "recvfrom", "recvmsg") and word in c["words"])
    logged = calls.those(lambda c: c["name"].startswith("pwrite") and c["wal"] and word in c["words"])
    answers = calls.those(lambda c: c["name"] in ("write", "writev", "sendto", "sendmsg") and word in c["words"]
                          and re.search(r"HTTP/1\.1 2\d\d", c["text"]))
    equal((len(reads) > 0, len(logged) > 0, len(answers)), (True, True, 1), "%s is read, logged, answered" % word)
    read, logged, answer = reads[0], logged[0], answers[0]
    equal(read["file"], answer["file"], "the connection of " + word)
    check(read["ended"] < logged["began"], "%s was logged before it was read" % word)
    synced = calls.those(lambda c: c["name"] in ("fdatasync", "fsync") and c["wal"] and c.get("returned") == "0"
                         and logged["ended"] < c["began"] and c["ended"] < answer["began"])
    check(synced, "%s was answered before it was on the disk: logged at line %d, answered at line %d"
          % (word, logged["began"], answer["began"]))


async def submit(server):
    """Some posts one after the other, some from several clients at once."""
    words = iter("power-loss-%04d" % i for i in range(ALONE + TOGETHER))
    connections = [Connection(server) for _ in range(CLIENTS)]

    async def send(connection, word):
        # the name first, so that it is among the first bytes of the body
        body = b'{"name": "%s", ' % word.encode() + submission(example())[1:]
        answer = await connection.call("POST", "/v1/jobs", body)
        equal(answer.status, 202, "submit, %r" % answer)

    async def several(connection):
        for word in words:
            await send(connection, word)

    for _ in range(ALONE):
        await send(connections[0], next(words))
    await each(connections, several)
    for connection in connections:
        connection.close()


def main():
    with tempfile.TemporaryDirectory() as folder:
        log = pathlib.Path(folder) / "strace"
        # pages of the log are 4 KiB; -y writes the path beside every descriptor
        # and -D leaves the server our child, so that a signal meant for it reaches it
        strace = ("strace", "-D", "-f", "-y", "-s", "5000", "-e", "signal=none", "-e", "trace=" + CALLS, "-o", log)
        with Server(wrapper=strace) as server:
            equal(server.call("POST", "/v1/queue/pause").status, 200, "pausing the queue")
            asyncio.run(submit(server))
            server.stop()
        end = time.monotonic() + 30
        while not log.read_bytes().endswith(b"+++ exited with 0 +++\n"):
            check(time.monotonic() < end, "strace does not end")
        with log.open(errors="replace") as lines:
            calls = Calls(lines)
    for i in range(ALONE + TOGETHER):
        check_order(calls, "power-loss-%04d" % i)
    syncs = len(calls.those(lambda c: c["name"] in ("fdatasync", "fsync") and c["wal"]))
    print("%d posts one by one and %d from %d clients: each was read, logged, synced, then answered; "
          "%d syncs of the log, %d checks" % (ALONE, TOGETHER, CLIENTS, syncs, outside.checks))


main()
