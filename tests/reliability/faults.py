"""Servers on a disk that fails when it is told to, and that forgets what was not synced when the power goes.

Both are done by a library that is loaded into the server, `faults.c`; this is what a test sees of it.
"""

import mmap
import os
import pathlib
import shutil
import sqlite3
import struct
import subprocess
import tempfile

from attack import Attacked, equal
from outside import TOP

LIBRARY = TOP / "target/reliability/faults.so"
FOREVER = 1 << 62
# instead of an errno: half of the bytes are written; the process is killed just before the call
HALF, DIE = -1, -2
# the fields of `struct control`, and of `struct record` with its kinds
CONTROL = ("calls", "fail_at", "count", "error", "failed", "lying", "reads", "fail_read_at")
RECORD = struct.Struct("=7q")
WRITE, CUT, SYNCED, CREATED, REMOVED = range(1, 6)
PAGE = 4096


def build():
    source = pathlib.Path(__file__).with_name("faults.c")
    if not LIBRARY.exists() or LIBRARY.stat().st_mtime < source.stat().st_mtime:
        LIBRARY.parent.mkdir(parents=True, exist_ok=True)
        # under another name first: two tests may begin at once
        made = LIBRARY.with_suffix(".%d" % os.getpid())
        subprocess.run(["cc", "-shared", "-fPIC", "-O2", "-Wall", "-U_FORTIFY_SOURCE", "-o", made, source, "-lpthread"], check=True)
        made.rename(LIBRARY)


class Faulty(Attacked):
    """A server whose disk does as `fail` says, and as `cut_power` finds it."""

    def __init__(self, *options, undo=False):
        super().__init__(*options)
        build()
        top = pathlib.Path(self.folder.name)
        control, self.undo = top / "control", top / "undo"
        control.write_bytes(bytes(8 * len(CONTROL)))
        with control.open("r+b") as file:
            self.control = mmap.mmap(file.fileno(), 0)
        self.wrapper = ["env", "LD_PRELOAD=%s" % LIBRARY, "FAULTS_CONTROL=%s" % control, "FAULTS_FOLDER=%s" % self.data]
        if undo:
            self.wrapper += ["FAULTS_UNDO=%s" % self.undo]

    def read(self, name):
        return struct.unpack_from("=q", self.control, 8 * CONTROL.index(name))[0]

    def write(self, name, value):
        struct.pack_into("=q", self.control, 8 * CONTROL.index(name), value)

    def fail(self, n, error, count=1):
        """The n-th call from now on fails, and so do those after it until there were `count`."""
        self.write("fail_at", 0)
        self.write("failed", 0)
        self.write("count", count)
        self.write("error", error)
        self.write("fail_at", self.read("calls") + n)

    def fail_read(self, n):
        """The n-th read from now on fails once, with EIO."""
        self.write("failed", 0)
        self.write("reads", 0)
        self.write("fail_read_at", n)

    def heal(self):
        """No call fails from now on; so many have since it was last asked."""
        self.write("fail_at", 0)
        self.write("fail_read_at", 0)
        failed = self.read("failed")
        self.write("failed", 0)
        return failed

    def cut_power(self, dice, everything):
        """Takes back what the disk may not have had when the process was killed: everything that was not synced, or any
        part of it, since a disk writes what it has in any order. Gives the number of unsynced changes."""
        changes = unsynced(self.undo.read_bytes())
        names = [change for change in changes if change.file == 0]
        files = {}
        for change in changes:
            if change.file:
                files.setdefault(change.file, []).append(change)
        paths = {path.stat().st_ino: path for folder in (self.data, pathlib.Path(str(self.undo) + ".kept"))
                 for path in folder.iterdir()}
        for file, own in files.items():
            if file in paths:  # or it is no more there to be undone
                take_back(paths[file], own, dice, everything)
        # a folder has its changes in their order, and those with one number together
        numbers = sorted({change.number for change in names})
        left = 0 if everything else dice.randrange(len(numbers) + 1)
        for change in reversed(names):
            if change.number in numbers[left:]:
                path = pathlib.Path(change.kept.decode())
                if change.kind == REMOVED:
                    os.replace("%s.kept/%d-%s" % (self.undo, change.number, path.name), path)
                else:
                    path.unlink(missing_ok=True)
        (self.data / "signorini.db-shm").unlink(missing_ok=True)
        self.undo.unlink()
        shutil.rmtree(str(self.undo) + ".kept")
        return len(changes)


class Change:
    """A record of what would undo a change, with the bytes that it keeps."""

    def __init__(self, fields, kept):
        self.kind, self.number, self.file, self.offset, self.size, self.length, _ = fields
        self.kept = kept


def unsynced(records):
    """The changes that were not synced later, in their order."""
    changes, place = [], 0
    while place < len(records):
        fields = RECORD.unpack_from(records, place)
        place += RECORD.size + fields[-1]
        change = Change(fields, records[place - fields[-1]:place])
        if change.kind == SYNCED:
            changes = [one for one in changes if one.file != change.file or one.number > change.number]
        else:
            changes.append(change)
    return changes


def take_back(path, changes, dice, everything):
    """Makes a file what it was before its unsynced changes, or a mixture of what it was before and after each: page by
    page, and its length too."""
    content = bytearray(path.read_bytes())
    lengths, versions = [len(content)], {}
    for change in reversed(changes):
        end = max(change.offset + change.size, change.length if change.kind == CUT else 0)
        for page in range(change.offset // PAGE, -(-end // PAGE)):
            versions.setdefault(page, []).append(bytes(content[page * PAGE:(page + 1) * PAGE]))
        content.extend(bytes(max(0, change.offset + len(change.kept) - len(content))))
        content[change.offset:change.offset + len(change.kept)] = change.kept
        del content[change.length:]
        content.extend(bytes(max(0, change.length - len(content))))
        lengths.append(change.length)
    if not everything:
        length = dice.choice(lengths)
        content.extend(bytes(max(0, max(lengths) - len(content))))
        for page, before in versions.items():
            found = dice.choice([None, *before])
            if found is not None:  # None: as it was synced
                content[page * PAGE:(page + 1) * PAGE] = found.ljust(PAGE, b"\0")
        content = content[:length].ljust(length, b"\0")
    path.write_bytes(content)


def check_database(server):
    """SQLite's own check of what a server left, on a copy. The write-ahead log belongs to it."""
    with tempfile.TemporaryDirectory() as folder:
        for name in ("signorini.db", "signorini.db-wal", "signorini.db-journal"):
            if (server.data / name).exists():
                shutil.copy(server.data / name, folder)
        database = sqlite3.connect(pathlib.Path(folder) / "signorini.db")
        equal(database.execute("pragma integrity_check").fetchall(), [("ok",)], "pragma integrity_check")
        equal(database.execute("pragma foreign_key_check").fetchall(), [], "pragma foreign_key_check")
        database.close()
