"""Workers on other machines that are killed, told to end and cut off, and a service that is killed under them (R36).

    workers.py [--soak] [SEED]

Four workers solve the jobs of a service that solves none itself, through a network that is slow, breaks connections and is cut
for a while. They are killed or told to end at random, and so is the service. In the end every acknowledged job is there once and
has ended once, with the digest that it has anywhere; the job of a killed worker runs again soon.
"""

import datetime
import pathlib
import random
import socket
import subprocess
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import outside
from outside import BINARY, Server, check, equal, example

SOAK = "--soak" in sys.argv
SEED = next((int(word) for word in sys.argv[1:] if word.isdigit()), random.randrange(1 << 32))
JOBS, SECONDS, WORKERS = (10_000, 600, 8) if SOAK else (250, 25, 4)
LEASE_S = 3
# three lost attempts end a job as `worker_lost`: rare, but allowed
MOST_LOST = 3


class Network:
    """A proxy between workers and service that delays, breaks connections, and can be cut."""

    def __init__(self, port, dice):
        self.port, self.dice, self.cut = port, dice, False
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = "http://127.0.0.1:%d" % self.listener.getsockname()[1]
        self.open, self.lock = [], threading.Lock()
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            near, _ = self.listener.accept()
            try:
                if self.cut:
                    raise OSError("cut")
                far = socket.create_connection(("127.0.0.1", self.port))
            except OSError:
                near.close()
                continue
            with self.lock:
                self.open.append((near, far))
            for pair in ((near, far), (far, near)):
                threading.Thread(target=self.pass_on, args=pair, daemon=True).start()

    def pass_on(self, source, sink):
        try:
            while data := source.recv(1 << 16):
                time.sleep(self.dice.choice((0, 0, 0.001, 0.02)))
                sink.sendall(data)
        except OSError:
            pass
        for one in (source, sink):
            one.close()

    def break_all(self):
        with self.lock:
            pairs, self.open = self.open, []
        for pair in pairs:
            for one in pair:
                try:
                    one.shutdown(socket.SHUT_RDWR)
                except OSError:
                    pass


class Workers:
    def __init__(self, url, log):
        self.url, self.log, self.all = url, log, []

    def start(self):
        command = [BINARY, "worker", "--server", self.url, "--slots", "1", "--grace", "0.2s"]
        self.all.append(subprocess.Popen(command, stderr=self.log))

    def replace(self, dice, kill):
        """Kills a worker or tells it to end, and starts another."""
        old = self.all.pop(dice.randrange(len(self.all)))
        if kill:
            old.kill()
        else:
            old.terminate()
        self.start()

    def end(self):
        for one in self.all:
            one.kill()


def submit(server, count):
    problem, ids = example(refine=3), []
    while len(ids) < count:
        jobs = [{"problem": problem, "cache": "off"} for _ in range(min(100, count - len(ids)))]
        answer = server.call("POST", "/v1/jobs/batch", {"jobs": jobs})
        equal(answer.status, 202, "a batch, %r" % answer)
        ids += [job["id"] for job in answer.json()["jobs"]]
    return problem, ids


def ended(server):
    queue = server.json("/v1/queue")
    return queue["queued"] == queue["running"] == 0


def disturb(server, network, workers, dice):
    """Faults, one after the other, until the time is over or no job is left; returns how many there were of each kind."""
    faults = dict.fromkeys(("worker killed", "worker told to end", "service killed", "service stopped", "connections broken", "network cut"), 0)
    end = time.monotonic() + SECONDS
    while time.monotonic() < end and not ended(server):
        time.sleep(dice.uniform(0.3, 1.5))
        kind = dice.choice(list(faults))
        faults[kind] += 1
        if kind.startswith("worker"):
            workers.replace(dice, kind == "worker killed")
        elif kind == "service killed":
            server.kill()
            server.start()
        elif kind == "service stopped":
            server.stop()
            server.start()
        elif kind == "connections broken":
            network.break_all()
        else:
            network.cut = True
            network.break_all()
            time.sleep(dice.uniform(0.5, 1.5 * LEASE_S))
            network.cut = False
    return faults


def seconds(text):
    return datetime.datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()


def run_again(server, ids):
    """The longest time from the loss of a worker until its job ran again, from the events of the jobs."""
    longest = 0
    for job in ids:
        events = [event for event in server.events(job) if event["type"] == "status"]
        for event, after in zip(events, events[1:]):
            if event.get("reason") == "worker_lost" and after["status"] == "running":
                longest = max(longest, seconds(after["t"]) - seconds(event["t"]))
    return longest


def check_jobs(server, problem, ids):
    with Server("--workers", "1") as other:
        alone = other.submit(problem)
        other.finished(alone)
        digest = other.json("/v1/jobs/%s/result" % alone)["summary"]["digest"]
    found = {job["id"]: job for job in server.every_job()}
    equal(sorted(found), sorted(ids), "the jobs")
    lost = 0
    for job in ids:
        events = server.events(job)
        equal([event["seq"] for event in events], list(range(1, len(events) + 1)), "the numbers of " + job)
        equal([event["type"] for event in events].count("done"), 1, "the ends of " + job)
        if found[job]["status"] == "failed":
            equal(found[job]["reason"], "worker_lost", "the failure of " + job)
            lost += 1
            continue
        equal(found[job]["status"], "succeeded", job)
        equal(server.json("/v1/jobs/%s/result" % job)["summary"]["digest"], digest, "the digest of " + job)
        rows = [event["k"] for event in events if event["type"] == "iteration" and event["attempt"] == found[job]["attempt"]]
        equal(rows, list(range(1, len(rows) + 1)), "the iterations of the last attempt of " + job)
    check(lost <= MOST_LOST, "%d jobs lost three workers each" % lost)
    return lost


def main():
    print("seed %d" % SEED, flush=True)
    dice = random.Random(SEED)
    with Server("--workers", "0", "--lease-s", str(LEASE_S), port=outside.free_port()) as server:
        network = Network(server.port, dice)
        with server.open_log() as log:
            workers = Workers(network.url, log)
            for _ in range(WORKERS):
                workers.start()
            try:
                problem, ids = submit(server, JOBS)
                faults = disturb(server, network, workers, dice)
                end = time.monotonic() + 60 + JOBS / 20
                while not ended(server):
                    check(time.monotonic() < end, "jobs do not end")
                    time.sleep(0.2)
            finally:
                workers.end()
        lost = check_jobs(server, problem, ids)
        longest = run_again(server, ids)
        check(longest < 60, "a job ran again only after %.1f s" % longest)
        told = ", ".join("%d × %s" % (count, kind) for kind, count in faults.items())
        print("figure: %d jobs over %d workers, %s: each ended once, with the same digest; %d lost three workers; after a loss a job ran again "
              "within %.1f s" % (len(ids), WORKERS, told, lost, longest))


main()
