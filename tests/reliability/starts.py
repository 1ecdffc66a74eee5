"""Starting on what is there, and going on when it is taken away (R33; of R6: missing files, wrong tables).

    starts.py [--soak]

What cannot be served is refused within a second, with one line and an exit code of its own: two servers in one folder,
also when files are removed from it, or on one database, by links from other folders; a folder that cannot be written; a port in use; a store that has lost its log or
its database, or has tables of another version. A server whose database is removed, or found damaged when something is
stored, accepts nothing more and says so. The doctor says what cannot be read, and when it cannot read at all.
"""

import os
import pathlib
import shutil
import socket
import sqlite3
import stat
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

from outside import BINARY, Server, check, equal, example, submission

LISTEN, FOLDER, LOCKED, SCHEMA, DAMAGED = 3, 4, 5, 6, 7
ROUNDS = 20 if "--soak" in sys.argv else 1
MOST_S = 1
slowest = 0.0
refusals = 0


def refused(data, code, what, listen="127.0.0.1:0", **how):
    """A start that is refused."""
    global slowest, refusals
    began = time.monotonic()
    command = [BINARY, "serve", "--listen", listen, "--data", data]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, **how)
    slowest, refusals = max(slowest, time.monotonic() - began), refusals + 1
    reasons = [line for line in done.stderr.splitlines() if line.startswith("signorini: ")]
    equal((done.returncode, len(reasons), done.stdout), (code, 1, ""), "%s: %s" % (what, done.stderr))
    return reasons[0]


def crash(server, folder):
    """A copy of the store as a crash leaves it."""
    copy = pathlib.Path(tempfile.mkdtemp(dir=folder)) / "data"
    shutil.copytree(server.data, copy)
    return copy


def database(data, statement):
    with sqlite3.connect(data / "signorini.db") as connection:
        connection.execute(statement)
    connection.close()


def locks(server):
    refused(server.data, LOCKED, "a second server")
    for name in ("lock", "signorini.progress", "signorini.reserve"):
        (server.data / name).unlink(missing_ok=True)
    refused(server.data, LOCKED, "a second server, when the small files were removed")


def links(server, folder):
    """The database of a running server by a link from another folder."""
    link = folder / "linked"
    (folder / "same").symlink_to(server.data)
    refused(folder / "same", LOCKED, "a second server, by a link to the folder")
    (folder / "same").unlink()
    for what, make in (
        ("a symbolic link", lambda path: (link / path.name).symlink_to(path)),
        ("a hard link", lambda path: os.link(path, link / path.name)),
    ):
        for names in (["signorini.db"], [path.name for path in server.data.iterdir()]):
            link.mkdir(mode=0o700)
            for name in names:
                make(server.data / name)
            refused(link, LOCKED, "a second server, by %s" % what)
            done = subprocess.run([BINARY, "doctor", "--data", link], capture_output=True, text=True)
            equal(done.returncode, LOCKED, "the doctor, by %s: %r" % (what, done))
            shutil.rmtree(link)
    server.finished(server.submit(example()))


def lost_files(server, folder):
    log, main = "signorini.db-wal", "signorini.db"
    harms = {
        "no log": lambda data: (data / log).unlink(),
        "a log of zeros": lambda data: (data / log).write_bytes(bytes((data / log).stat().st_size)),
        "an empty database": lambda data: (data / main).write_bytes(b""),
        "no database": lambda data: (data / main).unlink(),
        "an empty database and no log": lambda data: ((data / main).write_bytes(b""), (data / log).unlink()),
    }
    for what, harm in harms.items():
        data = crash(server, folder)
        harm(data)
        reason = refused(data, DAMAGED, what)
        check("doctor --accept" in reason, reason)
        done = subprocess.run([BINARY, "doctor", "--data", data, "--accept"], capture_output=True, text=True)
        equal(done.returncode, 0, "doctor --accept, %s" % done.stderr)
        other = Server()
        shutil.rmtree(other.data, ignore_errors=True)
        shutil.copytree(data, other.data)
        with other:
            other.kill()
    data = crash(server, folder)
    (data / "signorini.db-shm").unlink(missing_ok=True)  # it holds nothing of its own
    with Server() as other:
        other.kill()
        shutil.rmtree(other.data)
        shutil.copytree(data, other.data)
        other.start()
        equal(len(other.every_job()), len(server.every_job()), "jobs without the shared memory")


def wrong_tables(server, folder):
    later = "insert into _sqlx_migrations (version, description, success, checksum, execution_time) values (99, '', 1, x'00', 0)"
    for what, statement in (
        ("a later version", later),
        ("another program", "drop table _sqlx_migrations"),
        ("a missing index", "drop index job_queue"),
    ):
        data = crash(server, folder)
        database(data, statement)
        refused(data, SCHEMA, what)
    data = crash(server, folder)
    (data / "signorini.db-wal").unlink()
    (data / "signorini.db").write_bytes(b"not a database" * 1000)
    refused(data, DAMAGED, "a file of something else")


def folders(folder, server):
    file = folder / "file"
    file.write_text("")
    refused(file, FOLDER, "a file in place of the folder")
    if os.geteuid() == 0:
        nobody = dict(user=65534, group=65534, extra_groups=[])
    else:
        nobody = {}
    closed = folder / "closed"
    closed.mkdir(mode=0o500)
    program = folder / "signorini"
    shutil.copy(BINARY, program)
    os.chmod(folder, 0o755)
    if nobody:
        os.chown(closed, 65534, 65534)
    before = globals()["BINARY"]
    globals()["BINARY"] = program
    refused(closed, FOLDER, "a folder that cannot be written", **nobody)
    foreign = folder / "foreign"
    foreign.mkdir(mode=0o700)
    sealed = crash(server, folder)
    sealed.parent.chmod(0o755)
    for path in [*sealed.iterdir(), sealed]:
        path.chmod(0o500 if path == sealed else 0o400)
        if nobody:
            os.chown(path, 65534, 65534)
    refused(sealed, FOLDER, "a store that cannot be written", **nobody)
    if nobody:
        refused(foreign, FOLDER, "a folder of somebody else", **nobody)
    globals()["BINARY"] = before
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        address = "127.0.0.1:%d" % taken.getsockname()[1]
        refused(folder / "fresh", LISTEN, "a port in use", address)


def modes(data):
    found = {path.name: stat.S_IMODE(path.stat().st_mode) for path in [data, *data.iterdir()]}
    for name, mode in found.items():
        equal(mode, 0o700 if name == data.name else 0o600, "mode of %s" % name)


def taken_away():
    """The database is removed, or replaced, under a running server."""
    told = 0.0
    for what, harm in (
        ("database removed", lambda data: (data / "signorini.db").unlink()),
        ("log removed", lambda data: (data / "signorini.db-wal").unlink()),
        ("folder removed", lambda data: shutil.rmtree(data)),
        ("database emptied", lambda data: (data / "signorini.db").write_bytes(b"")),
    ):
        with Server() as server:
            server.finished(server.submit(example()))
            harm(server.data)
            began = time.monotonic()
            answer = server.call("POST", "/v1/jobs", submission(example()))
            equal((answer.status, answer.json()["code"]), (503, "storage-lost"), "%s: %r" % (what, answer))
            answer = server.call("GET", "/readyz")
            equal((answer.status, answer.json()["code"]), (503, "storage-lost"), "%s: %r" % (what, answer))
            told = max(told, time.monotonic() - began)
            equal(server.call("GET", "/livez").status, 200, "livez")
            time.sleep(2.2)
            lines = [line for line in server.log.read_text().splitlines() if "no data are stored until" in line]
            equal(len(lines), 1, "%s: lines in the log" % what)
            server.kill()
    return told


def damaged_table(server, folder):
    """The database is damaged where sizes of jobs are stored: a job is solved, and its end cannot be stored."""
    data = crash(server, folder)
    with sqlite3.connect(data / "signorini.db") as connection:
        connection.execute("pragma wal_checkpoint(truncate)")
        place = "select rootpage - 1, page_size from sqlite_schema, pragma_page_size where name = 'job_size'"
        (page, size), = connection.execute(place)
    connection.close()
    with (data / "signorini.db").open("r+b") as file:
        file.seek(page * size)
        file.write(bytes(size))
    server = Server()
    data.rename(server.data)
    with server:
        equal(server.call("POST", "/v1/queue/pause").status, 200, "pausing the queue")
        job, *_ = [server.submit(example(), cache="off", limits={"timeout_s": 5}) for _ in range(4)]
        equal(server.call("POST", "/v1/queue/resume").status, 200, "resuming the queue")
        wait_until(lambda: server.call("GET", "/readyz").status == 503, "readyz tells of the damage")
        for method, path, body in (("GET", "/readyz", None), ("POST", "/v1/jobs", submission(example()))):
            answer = server.call(method, path, body)
            equal((answer.status, answer.json()["code"]), (503, "storage-lost"), "%s: %r" % (path, answer))
        wait_until(lambda: server.call("GET", "/v1/queue").json()["idle"] == 2, "its worker is free")
        equal(server.call("GET", "/v1/jobs/" + job).status, 200, "reading")
        time.sleep(1.2)
        lines = server.log.read_text().splitlines()
        equal(len([line for line in lines if "ERROR" in line and "signorini doctor" in line and "cannot be stored any more" not in line]), 2,
              "lines that tell of the damage, and that nothing is stored")
        check(any("job %s cannot be stored any more" % job in line for line in lines), "its job is named: %r" % lines)
        time.sleep(2.2)
        equal(server.log.read_text().splitlines(), lines, "the log of a store that stores nothing")
        server.stop()


def wait_until(done, what, most_s=10):
    end = time.monotonic() + most_s
    while not done():
        check(time.monotonic() < end, what)
        time.sleep(0.02)


def doctor(data, code, last, program=BINARY, **how):
    """What the doctor finds; its last line ends like this."""
    done = subprocess.run([program, "doctor", "--data", data], capture_output=True, text=True, timeout=30, **how)
    equal(done.returncode, code, "doctor %s: %r" % (data, done))
    lines = (done.stdout or done.stderr).splitlines()
    check(lines and lines[-1].endswith(last), "doctor %s: %r" % (data, done))
    return lines[:-1]


def doctors(server, folder):
    data = crash(server, folder)
    (data / "signorini.db-wal").unlink(missing_ok=True)
    with (data / "signorini.db").open("r+b") as file:
        file.write(bytes(100))
    equal(len(doctor(data, DAMAGED, "no job can be read: restore the store from a backup")), 1, "findings, each once")
    doctor(folder / "missing", FOLDER, "it contains no signorini.db")
    data = crash(server, folder)
    doctor(data, 0, "3 of 3 jobs are intact")
    if os.geteuid() == 0:
        for path in [*data.iterdir(), data]:
            os.chown(path, 65534, 65534)
            path.chmod(0o500 if path == data else 0o400)
        database(data, "select count(*) from job")  # closes the log: to open it again, it has to be created
        program = folder / "of-anybody"
        shutil.copy(BINARY, program)
        folder.chmod(0o755)
        data.parent.chmod(0o755)
        nobody = dict(program=program, user=65534, group=65534, extra_groups=[])
        doctor(data, FOLDER, "copy the folder to where that is allowed, and check the copy", **nobody)
        os.chown(data, 0, 0)
        doctor(data, FOLDER, "Permission denied (os error 13)", **nobody)


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for _ in range(ROUNDS):
            with Server() as server:
                for n in range(3):
                    server.finished(server.submit(example(), name=str(n)))
                modes(server.data)
                lost_files(server, folder)
                wrong_tables(server, folder)
                doctors(server, folder)
                damaged_table(server, folder)
                locks(server)
                links(server, folder)
                server.stop()
                modes(server.data)
                if not folder.joinpath("closed").exists():
                    folders(folder, server)
    told = taken_away()
    check(slowest <= MOST_S, "a refusal took %.2f s" % slowest)
    print("figure: %d starts refused within %.2f s, each with one line and its exit code; a store taken away under a "
          "running server is told within %.2f s" % (refusals, slowest, told))


main()
