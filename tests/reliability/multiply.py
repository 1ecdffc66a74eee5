"""Small requests whose parts multiply: contacts × steps × members × labels × requests at once (G9).

    multiply.py [--soak]

The budget is 256 MiB. Sweeps whose pointers have millions of parts; a problem of many contacts and load steps, which is
told to need what it takes, two at once, over both ways of solving, and its result read by many at once; a sweep whose rows
are wide, as a table in every format, by many at once and by readers that stop; a sweep with one long value, which NumPy would
have as wide in every row; lists of jobs with the largest labels. The server stays below budget + 256 MiB.
"""

import json
import socket
import threading
import time

import grpc

from attack import MIB, SOAK, Attacked, Bystander, Watch, check, equal, example

BUDGET = 256 * MIB
MOST = BUDGET + 256 * MIB
# `page_size` of a list over gRPC: 1000
PAGE = b"\x10\xe8\x07"


def row_of_contacts(count, steps=0, friction=False):
    """A strip whose upper side touches at so many places."""
    contact = {"obstacle": {"kind": "flat"}, "indentation": 0.01}
    if friction:
        contact["friction"] = {"coefficient": 0.3, "nonlocal_radius": 2 / count, "elastic_slip": 1e-4}
    places = {"c%d" % k: {"side": "top", "x": [k / count - 1e-9, (k + 0.5) / count + 1e-9]} for k in range(count)}
    problem = {
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [k / (2 * count) for k in range(2 * count + 1)], "y": [0, 0.3, 0.6, 1]}, "boundaries": places},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [dict(contact, boundary=name) for name in places],
    }
    if steps:
        problem["steps"] = [{"indentation": (k + 1) / steps} for k in range(steps)]
    return problem


def at_once(count, do):
    """What so many threads have found, each."""
    found = []
    threads = [threading.Thread(target=lambda: found.append(do())) for _ in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return found


def field(number, value):
    """A text or message as a field of a message of gRPC."""
    length, value = b"", value if isinstance(value, bytes) else value.encode()
    left = len(value)
    while left > 127:
        length, left = length + bytes([left & 127 | 128]), left >> 7
    return bytes([number << 3 | 2]) + length + bytes([left]) + value


def calls(server, rpc, message, count=8):
    """How so many calls end that are made at once."""

    def call():
        with grpc.insecure_channel(server.address) as channel:
            try:
                channel.unary_unary("/signorini.v1.JobService/" + rpc)(message, timeout=120)
                return "OK"
            except grpc.RpcError as error:
                return error.code().name

    return set(at_once(count, call))


def pointers(server):
    for text in ("/a" * (7 << 20), "/" * (15 << 20), "/" + "~1" * (7 << 20)):
        sweep = json.dumps({"base": example(), "axes": [{"path": text, "values": [1]}]}).encode()
        answers = at_once(4, lambda: server.call("POST", "/v1/sweeps", sweep))
        check(all(answer.status in (422, 503) for answer in answers), "a long pointer, %r" % answers)
        check(any(answer.status == 422 for answer in answers), "a long pointer, %r" % answers)
    deep = {"base": example(), "mode": "list", "points": [{"/a" * 40_000: 1}] * 100}
    equal(server.call("POST", "/v1/sweeps", deep).status, 422, "points with long pointers")
    axis = field(1, "/a" * 400_000)
    equal(calls(server, "CreateSweep", field(2, axis)), {"INVALID_ARGUMENT"}, "a long pointer over gRPC")


def steps(server):
    """Jobs of many contacts and steps: solved or refused by their estimate; the result of one read by many."""
    solved, refused = [], 0
    for contacts, count in ((60, 100), (20, 300), (60, 1000)):
        problem = row_of_contacts(contacts, count)
        jobs = []
        for _ in range(2):
            answer = server.call("POST", "/v1/jobs", {"cache": "off", "problem": problem})
            refused += answer.status == 413
            check(answer.status in (202, 413), "%d contacts and %d steps, %r" % (contacts, count, answer))
            jobs += [answer.json()["id"]] if answer.status == 202 else []
        for job in jobs:
            ended = server.finished(job)
            equal(ended["status"], "succeeded", "%d contacts and %d steps, %r" % (contacts, count, ended["failure"]))
        solved += jobs
    check(len(solved) >= 4, "%d jobs were solved" % len(solved))
    for path in ("result", "history", "profiles/c0?step=3"):
        answers = at_once(8, lambda: server.call("GET", "/v1/jobs/%s/%s" % (solved[-1], path)).status)
        check(set(answers) <= {200, 503} and 200 in answers, "%s by many: %r" % (path, answers))
    # it is larger than this client takes (4 MiB)
    told = calls(server, "GetResult", field(1, solved[-1]))
    check(told <= {"RESOURCE_EXHAUSTED", "OUT_OF_RANGE", "UNAVAILABLE"}, "the result over gRPC by many: %r" % told)
    return len(solved), refused


def finished_sweep(server, sweep):
    answer = server.call("POST", "/v1/sweeps", sweep)
    equal(answer.status, 202, "a sweep, %r" % answer)
    name = answer.json()["id"]
    while server.json("/v1/sweeps/%s?wait=10" % name)["status"] not in ("succeeded", "failed"):
        pass
    return name


def tables(server):
    members = 10_000 if SOAK else 2_000
    wide = finished_sweep(server, {"base": row_of_contacts(85), "axes": [
        {"path": "/contacts/0/indentation", "linspace": {"start": 0.001, "stop": 0.002, "count": members}}]})
    for form in ("csv", "npz", "arrow", "jsonl"):
        answers = at_once(20, lambda: server.call("GET", "/v1/sweeps/%s/results?format=%s" % (wide, form)).status)
        check(set(answers) <= {200, 503} and answers.count(200) > 5, "%s by many: %r" % (form, answers))
    readers = []
    for _ in range(40):
        reader = server.socket()
        reader.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        reader.sendall(b"GET /v1/sweeps/%s/results?format=jsonl HTTP/1.1\r\nHost: localhost\r\n\r\n" % wide.encode())
        readers.append(reader)
    time.sleep(5)
    for reader in readers:
        reader.close()
    # one value of 400 KB beside many short ones
    table = {"kind": "table", "x": [k / 30_000 for k in range(30_001)], "gap": [0.0] * 30_001}
    flat = {"kind": "flat", "from": 0, "to": 0.5}
    values = [flat] * 1_000 + [table]
    long = finished_sweep(server, {"base": example(), "axes": [{"path": "/contacts/0/obstacle", "values": values}]})
    equal(server.call("GET", "/v1/sweeps/%s/results?format=npz" % long).status, 406, "texts as wide as the longest")
    told = calls(server, "ListSweepMembers", field(1, long) + PAGE)
    check("OK" in told and told <= {"OK", "UNAVAILABLE"}, "members over gRPC by many: %r" % told)
    for form in ("csv", "arrow", "jsonl"):
        equal(server.call("GET", "/v1/sweeps/%s/results?format=%s" % (long, form)).status, 200, form)
    return members


def labels(server):
    """The largest labels that a job may have, for many jobs, and lists of all of them by many."""
    large = {"%02d%s" % (k, "ä" * 254): "ö" * 256 for k in range(64)}
    server.call("POST", "/v1/queue/pause")
    batches = 5 if SOAK else 2
    for _ in range(batches):
        for _ in range(4):
            jobs = [{"problem": example(), "cache": "off", "labels": large} for _ in range(60)]
            equal(server.call("POST", "/v1/jobs/batch", {"jobs": jobs}).status, 202, "a batch")
    count, token, pages = 0, "", 0
    while token is not None:
        page = server.json("/v1/jobs?status=queued&page_size=1000&page_token=" + token)
        count, token, pages = count + len(page["jobs"]), page["next_page_token"], pages + 1
    equal(count, 240 * batches, "the jobs of all pages")
    check(pages > batches, "%d pages" % pages)
    answers = at_once(16, lambda: server.call("GET", "/v1/jobs?page_size=1000").status)
    check(set(answers) <= {200, 503} and 200 in answers, "lists by many: %r" % answers)
    told = calls(server, "ListJobs", PAGE)
    check("OK" in told and told <= {"OK", "UNAVAILABLE"}, "lists over gRPC by many: %r" % told)
    server.call("POST", "/v1/jobs/cancel?status=queued")
    server.call("POST", "/v1/queue/resume")
    return count


def attack(isolation):
    options = ("--workers", "2", "--memory-budget-bytes", str(BUDGET), "--isolation", isolation)
    with Attacked(*options) as server, Bystander(server):
        watch = Watch(server.process.pid)
        watch.start()
        solved, refused = steps(server)
        told = "%s: %d jobs of up to 60 contacts and 1000 steps solved, %d refused" % (isolation, solved, refused)
        if isolation == "thread":
            pointers(server)
            told += ", tables of %d members, lists of %d jobs with the largest labels" % (tables(server), labels(server))
        equal(server.call("GET", "/readyz").status, 200, "the server after all of it")
        watch.ended = True
        check(watch.highest <= MOST, "resident %d MiB, allowed %d" % (watch.highest // MIB, MOST // MIB))
        return "%s; resident memory reached %d MiB" % (told, watch.highest // MIB)


print("figure: with a budget of %d MiB, %s" % (BUDGET // MIB, "; ".join(map(attack, ("thread", "process")))))
