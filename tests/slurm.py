"""Workers placed by a real Slurm (Debian's packages slurmctld, slurmd, slurm-client, munge), on a cluster of two nodes on this
machine.

    slurm.py
    slurm.py --soak [SEED]

200 jobs and a sweep over pilots have the digests of those that a service solves itself; a pilot that is canceled, one that is
killed and one whose time is over lose no job; `serve --slurm auto` submits pilots when jobs wait, and none while the controller
of Slurm is down. With --soak, 10,000 jobs on eight nodes while nodes, pilots, the service and the controller are killed at
random. The cluster needs root: it has a key, a socket and ports of its own, and touches nothing outside of its folder.
"""

import contextlib
import datetime
import os
import pathlib
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

import outside
from outside import BINARY, Server, check, equal, example

CPUS = 2


class Cluster:
    """A Slurm cluster whose nodes are daemons on this machine."""

    def __init__(self, nodes):
        self.nodes = nodes

    def __enter__(self):
        # /tmp and not a home: the user munge has to reach it
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="slurm-", dir="/tmp"))
        self.folder.chmod(0o755)
        for name in ("state", "log", "run", "munge"):
            (self.folder / name).mkdir(mode=0o755)
        for number in range(1, self.nodes + 1):
            (self.folder / "spool" / ("n%d" % number)).mkdir(parents=True)
        (self.folder / "munge.key").write_bytes(os.urandom(1024))
        shutil.chown(self.folder / "munge.key", "munge", "munge")
        (self.folder / "munge.key").chmod(0o400)
        shutil.chown(self.folder / "munge", "munge", "munge")
        ports = [outside.free_port() for _ in range(self.nodes + 1)]
        self.conf = self.folder / "slurm.conf"
        self.conf.write_text(self.settings(ports))
        # of the commands that the program under test runs
        os.environ["SLURM_CONF"] = str(self.conf)
        munge = self.folder / "munge"
        self.run("setpriv", "--reuid", "munge", "--regid", "munge", "--init-groups", "munged",
                 "--key-file=%s" % (self.folder / "munge.key"), "--socket=%s" % (munge / "sock"),
                 "--pid-file=%s" % (munge / "munged.pid"), "--log-file=%s" % (munge / "log"), "--seed-file=%s" % (munge / "seed"))
        self.start_controller()
        for number in range(1, self.nodes + 1):
            self.start_node(number)
        until(lambda: self.run("sinfo", "-h", "-N", "-o", "%T").split().count("idle") == self.nodes, 30, "the nodes are idle")
        return self

    def __exit__(self, kind, *_):
        if kind is not None:
            print((self.folder / "log/slurmctld.log").read_text()[-3000:], file=sys.stderr)
        with contextlib.suppress(AssertionError):
            self.run("scancel", "--user=root")
            time.sleep(1)
        for file in [*self.folder.glob("run/*.pid"), self.folder / "munge/munged.pid"]:
            self.signal(file, "TERM")
        until(lambda: not list(self.folder.glob("run/*.pid")), 10, "the daemons have ended", must=False)
        shutil.rmtree(self.folder, ignore_errors=True)

    def settings(self, ports):
        host, folder = socket.gethostname().split(".")[0], self.folder
        lines = [
            "ClusterName=signorini", "SlurmctldHost=%s(127.0.0.1)" % host, "SlurmUser=root", "SlurmdUser=root",
            "SlurmctldPort=%d" % ports[0], "AuthType=auth/munge", "AuthInfo=socket=%s/munge/sock" % folder, "CredType=cred/munge",
            "StateSaveLocation=%s/state" % folder, "SlurmdSpoolDir=%s/spool/%%n" % folder,
            "SlurmctldPidFile=%s/run/slurmctld.pid" % folder, "SlurmdPidFile=%s/run/slurmd-%%n.pid" % folder,
            "SlurmctldLogFile=%s/log/slurmctld.log" % folder, "SlurmdLogFile=%s/log/slurmd-%%n.log" % folder,
            "ProctrackType=proctrack/linuxproc", "TaskPlugin=task/none", "JobAcctGatherType=jobacct_gather/none", "MpiDefault=none",
            "SwitchType=switch/none", "ReturnToService=2", "SlurmctldTimeout=10", "SlurmdTimeout=15", "KillWait=30",
            "SchedulerType=sched/builtin", "SchedulerParameters=sched_interval=1,batch_sched_delay=0,sched_min_interval=0",
            "SelectType=select/cons_tres", "SelectTypeParameters=CR_Core", "AccountingStorageType=accounting_storage/none",
            "JobCompType=jobcomp/none", "SlurmdParameters=config_overrides",
        ]
        for number, port in enumerate(ports[1:], 1):
            lines.append("NodeName=n%d NodeHostname=%s NodeAddr=127.0.0.1 Port=%d CPUs=%d State=UNKNOWN" % (number, host, port, CPUS))
        lines.append("PartitionName=main Nodes=ALL Default=YES MaxTime=60 State=UP")
        return "\n".join(lines) + "\n"

    def start_controller(self):
        self.run("slurmctld", "-f", self.conf)

    def start_node(self, number):
        self.run("slurmd", "-f", self.conf, "-N", "n%d" % number)

    def fail_node(self, number):
        """The daemon of a node dies, and with it what runs there."""
        self.signal(self.folder / ("run/slurmd-n%d.pid" % number), "KILL")
        # its pilots are processes of this machine: their names have that of the node
        self.kill_worker(number)

    def kill_worker(self, number):
        subprocess.run(["pkill", "-KILL", "--full", "worker --server .* --name n%d:" % number], check=False)

    def kill_controller(self):
        self.signal(self.folder / "run/slurmctld.pid", "KILL")

    def stop_controller(self):
        # one that is killed forgets the last seconds, and takes minutes to learn that a pilot has ended
        self.signal(self.folder / "run/slurmctld.pid", "TERM")

    def signal(self, file, name):
        with contextlib.suppress(OSError):
            subprocess.run(["kill", "-" + name, file.read_text().strip()], capture_output=True, check=False)

    def run(self, *command):
        path = os.environ["PATH"] + ":/usr/sbin:/sbin"
        ran = subprocess.run([*map(str, command)], capture_output=True, text=True, timeout=30, env=dict(os.environ, PATH=path))
        check(ran.returncode == 0, "%s: %s%s" % (command[0], ran.stdout, ran.stderr))
        return ran.stdout


def until(holds, seconds, what, must=True):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if holds():
            return True
        time.sleep(0.1)
    check(not must, "not within %d s: %s" % (seconds, what))
    return False


def signorini(*arguments, **variables):
    ran = subprocess.run([BINARY, *map(str, arguments)], capture_output=True, text=True, env=dict(os.environ, **variables))
    check(ran.returncode == 0, "%s: %s%s" % (arguments, ran.stdout, ran.stderr))
    return ran.stdout


class Service(Server):
    """A server with a token for an administrator and one for workers, which solves nothing itself unless it is told so."""

    def __init__(self, *options, **named):
        super().__init__(*options, **named)
        token = lambda scope: signorini("token", "create", "--name", scope, "--owner", "root", "--scope", scope, "--data", self.data)
        self.admin = token("admin").split()[-1]
        self.file = pathlib.Path(self.folder.name) / "worker.token"
        self.file.write_text(token("work"))

    def call(self, method, path, body=None, **headers):
        return super().call(method, path, body, authorization="Bearer " + self.admin, **headers)

    def pilots(self):
        return signorini("slurm", "status", "--server", self.url).splitlines()[1:]

    def up(self, nodes, *more):
        said = signorini("slurm", "up", "--server", self.url, "--token-file", self.file, "--nodes", nodes, "--slots", CPUS, *more)
        check("submitted to Slurm as" in said, said)

    def down(self):
        signorini("slurm", "down", "--server", self.url)


def problem(number):
    found = example(refine=1)
    found["contacts"][0]["friction"]["coefficient"] = 0.1 + number / 1000
    return found


SWEEP = {
    "base": example(refine=1),
    "axes": [
        {"path": "/contacts/0/friction/coefficient", "linspace": {"start": 0.1, "stop": 0.5, "count": 10}},
        {"path": "/contacts/0/friction/nonlocal_radius", "values": [0.01, 0.02]},
    ],
}


def submit_all(server, count):
    """Submits jobs and a sweep; returns the ids of the jobs, and that of the sweep."""
    ids = []
    for first in range(0, count, 100):
        jobs = [{"problem": problem(number), "cache": "off"} for number in range(first, min(first + 100, count))]
        answer = server.call("POST", "/v1/jobs/batch", {"jobs": jobs})
        equal(answer.status, 202, "a batch, %r" % answer)
        ids += [job["id"] for job in answer.json()["jobs"]]
    answer = server.call("POST", "/v1/sweeps", SWEEP)
    equal(answer.status, 202, "a sweep, %r" % answer)
    return ids, answer.json()["id"]


def results(server, ids, sweep):
    """The digests of the jobs and the rows of the sweep, when all have ended."""
    def ended():
        queue = server.json("/v1/queue")
        return queue["queued"] == queue["running"] == 0
    until(ended, 120, "all jobs have ended")
    digests = []
    for job in ids:
        found = server.json("/v1/jobs/" + job)
        equal(found["status"], "succeeded", "the job %r" % found)
        digests.append(server.json("/v1/jobs/%s/result" % job)["summary"]["digest"])
    rows = server.json("/v1/sweeps/%s/results?page_size=1000" % sweep)["members"]
    return digests, rows


def compare(cluster):
    """200 jobs and a sweep over two pilots, against the same in one process."""
    with Service() as here, Service("--workers", "0") as there:
        began = time.monotonic()
        expected = results(here, *submit_all(here, 200))
        alone = time.monotonic() - began
        there.up(2, "--time", "10m")
        until(lambda: sum("RUNNING" in line for line in there.pilots()) == 2, 30, "both pilots run")
        began = time.monotonic()
        found = results(there, *submit_all(there, 200))
        equal(found, expected, "digests and rows of pilots")
        print("200 jobs and a sweep: %.1f s over 2 pilots, %.1f s in one process" % (time.monotonic() - began, alone))
        there.down()
        until(lambda: not there.pilots(), 30, "no pilot is left")


def lose_pilots(cluster):
    """A pilot that is canceled finishes what it solves, one that is killed costs attempts, and neither costs a job."""
    slow = outside.long_contact(1200)  # some seconds
    with Service("--workers", "0", "--lease-s", "3") as server:
        server.up(2, "--time", "10m")
        jobs = [server.submit(slow) for _ in range(6)]
        running = lambda: [job for job in jobs if server.json("/v1/jobs/" + job)["status"] == "running"]
        until(lambda: len(running()) >= 3, 60, "pilots solve")
        canceled, killed = (line.split() for line in server.pilots()[:2])
        cluster.run("scancel", canceled[0])
        # a batch process that is killed is a failed job of Slurm, and no longer listed
        worker = cluster.run("pgrep", "--full", "worker --server %s .* --name %s:" % (server.url, killed[-1]))
        os.kill(int(worker), signal.SIGKILL)
        until(lambda: not any("RUNNING" in line for line in server.pilots()), 60, "both are gone")
        server.up(2, "--time", "10m")
        for job in jobs:
            found = server.finished(job)
            equal(found["status"], "succeeded", "the job %r" % found)
        attempts = [server.json("/v1/jobs/" + job)["attempt"] for job in jobs]
        check(max(attempts) > 1, "some were solved again: %r" % attempts)
        print("a pilot canceled and one killed: attempts %r" % attempts)
        server.down()


def by_itself(cluster):
    """`serve --slurm auto`: pilots come when jobs wait and end when they are idle, and a controller that is down is waited for."""
    port = outside.free_port()
    with Server("--workers", "0", "--slurm", "auto", "--slurm-server", "http://127.0.0.1:%d" % port, "--slurm-slots", str(CPUS),
                "--slurm-pilots", "2", "--slurm-idle-exit-s", "2", port=port) as server:
        pilots = lambda: signorini("slurm", "status", "--server", server.url).splitlines()[1:]
        equal(pilots(), [], "pilots without jobs")
        jobs = [server.submit(problem(number)) for number in range(20)]
        for job in jobs:
            equal(server.finished(job)["status"], "succeeded", "a job")
        check(0 < len(pilots()) <= 2, "as many pilots as there may be: %r" % pilots())
        until(lambda: not pilots(), 30, "idle pilots end")
        cluster.stop_controller()
        job = server.submit(problem(1))
        time.sleep(7)
        equal(server.json("/v1/jobs/" + job)["status"], "queued", "without a controller it waits")
        equal(server.call("GET", "/readyz").status, 200, "the service is well")
        cluster.start_controller()
        equal(server.finished(job)["status"], "succeeded", "once there is a controller again")
        until(lambda: not pilots(), 30, "idle pilots end")


SOAK_JOBS, NODES, LEASE_S, SOAK_S = 10_000, 8, 5, 300


def soak(cluster, dice):
    """10,000 jobs while everything is killed at random: each ends once, with the digest that it has anywhere."""
    faults = dict.fromkeys(("pilot killed", "pilot canceled", "node failed", "service killed", "controller killed"), 0)
    port = outside.free_port()
    with Service("--workers", "0", "--lease-s", str(LEASE_S), "--max-queued", "100000", "--max-queued-per-owner", "100000", port=port) as server:
        kinds = [problem(number) for number in range(10)]
        for number, one in enumerate(kinds):
            one["mesh"]["refine"] = 2 if number else 4
        ids = []
        while len(ids) < SOAK_JOBS:
            jobs = [{"problem": kinds[number % 10], "cache": "off"} for number in range(500)]
            answer = server.call("POST", "/v1/jobs/batch", {"jobs": jobs})
            equal(answer.status, 202, "a batch, %r" % answer)
            ids += [job["id"] for job in answer.json()["jobs"]]
        began, failed_nodes, controller = time.monotonic(), {}, None
        while True:
            queue = server.json("/v1/queue")
            if queue["queued"] == queue["running"] == 0:
                break
            now = time.monotonic()
            check(now < began + 3 * SOAK_S, "jobs do not end: %r" % queue)
            for number, since in list(failed_nodes.items()):
                if now > since + 20:
                    cluster.start_node(number)
                    del failed_nodes[number]
            if controller and now > controller + 5:
                cluster.start_controller()
                controller = None
            if not controller:
                refill(server)
            time.sleep(dice.uniform(1, 4))
            if now > began + SOAK_S:
                continue
            kind = dice.choice(list(faults))
            if (kind == "controller killed" and controller) or (kind == "pilot canceled" and controller):
                continue
            number = dice.randint(1, NODES)
            if kind == "node failed" and (number in failed_nodes or len(failed_nodes) > 2):
                continue
            faults[kind] += 1
            if kind == "pilot killed":
                cluster.kill_worker(number)
            elif kind == "pilot canceled":
                listed = [line.split() for line in server.pilots() if "RUNNING" in line]
                if listed:
                    with contextlib.suppress(AssertionError):  # it has ended meanwhile
                        cluster.run("scancel", dice.choice(listed)[0])
            elif kind == "node failed":
                cluster.fail_node(number)
                failed_nodes[number] = now
            elif kind == "service killed":
                server.kill()
                server.start()
            else:
                cluster.kill_controller()
                controller = now
        wall = time.monotonic() - began
        told = ", ".join("%d × %s" % (count, kind) for kind, count in faults.items())
        longest, lost = check_soaked(server, kinds, ids)
        print("figure: %d jobs over %d nodes of Slurm in %.0f s, %s: each ended once, with the same digest; %d lost three workers; after a "
              "loss a job ran again within %.1f s" % (len(ids), NODES, wall, told, lost, longest))
        if controller:
            cluster.start_controller()
        with contextlib.suppress(AssertionError):
            server.down()


def refill(server):
    """As many pilots as there are nodes: those that failed are not started again by Slurm."""
    with contextlib.suppress(AssertionError):  # the controller may be busy
        missing = NODES - len(server.pilots())
        if missing > 0:
            server.up(missing, "--time", "30m")


def check_soaked(server, kinds, ids):
    """The longest time until a job of a lost worker ran again (s), and how many jobs lost three workers."""
    with Server("--workers", "2") as alone:
        digests = []
        for one in kinds:
            job = alone.submit(one)
            alone.finished(job)
            digests.append(alone.json("/v1/jobs/%s/result" % job)["summary"]["digest"])
    found = {job["id"]: job for job in server.every_job()}
    equal(len(found), len(ids), "the jobs")
    longest, lost = 0, 0
    seconds = lambda text: datetime.datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()
    for number, job in enumerate(ids):
        events = server.events(job)
        equal([event["seq"] for event in events], list(range(1, len(events) + 1)), "the numbers of " + job)
        equal([event["type"] for event in events].count("done"), 1, "the ends of " + job)
        states = [event for event in events if event["type"] == "status"]
        for event, after in zip(states, states[1:]):
            if event.get("reason") == "worker_lost" and after["status"] == "running":
                longest = max(longest, seconds(after["t"]) - seconds(event["t"]))
        if found[job]["status"] == "failed":
            equal(found[job]["reason"], "worker_lost", "the failure of " + job)
            lost += 1
            continue
        equal(found[job]["status"], "succeeded", job)
        # every tenth result: all of them are read by their rows above
        if number % 10 == number // 10 % 10:
            digest = server.json("/v1/jobs/%s/result" % job)["summary"]["digest"]
            equal(digest, digests[number % 10], "the digest of " + job)
    check(lost <= len(ids) // 1000, "%d jobs lost three workers each" % lost)
    check(longest < 60, "a job ran again only after %.1f s" % longest)
    return longest, lost


def main():
    if "--soak" in sys.argv:
        seed = next((int(word) for word in sys.argv if word.isdigit()), random.randrange(1 << 32))
        print("seed %d" % seed, flush=True)
        with Cluster(NODES) as cluster:
            soak(cluster, random.Random(seed))
        return
    with Cluster(2) as cluster:
        for part in (compare, lose_pilots, by_itself):
            began = time.monotonic()
            part(cluster)
            print("%s: %.0f s" % (part.__name__, time.monotonic() - began), flush=True)
    print("Slurm: %d checks" % outside.checks)


if __name__ == "__main__":
    main()
