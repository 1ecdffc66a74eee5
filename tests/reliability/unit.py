"""Promises that unit tests show (R4, R17, R22): runs them, and tells how many there were.

    unit.py failpoints
    unit.py long_contacts
    unit.py simulation [SEEDS]
"""

import os
import re
import subprocess
import sys
import pathlib

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

from outside import TOP, check

FIGURES = {
    "failpoints": "every failpoint with a panic and, where there may be one, an error (%d tests): one end for its job, the other "
                  "worker and the next job undisturbed",
    "long_contacts": "contacts of up to 3,001 nodes take between a third of their estimate and all of it (%d test)",
    "simulation": "%d seeds of clients, workers, leases, crashes, full disks and clocks that are set, and as many of workers elsewhere "
                  "whose messages are lost, repeated and late while the service restarts: no promise broken",
}


# the same selection of packages as tests/run: nothing is compiled again
COMMAND = ["cargo", "test", "--release", "--workspace", "--lib"]


def main():
    name = sys.argv[1]
    subprocess.run([*COMMAND, "--no-run"], cwd=TOP, check=True)
    if name == "simulation":
        seeds = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
        simulate(seeds)
        print("figure: " + FIGURES[name] % seeds)
        return
    # the one that takes minutes is asked for by its name only
    passed = passed_in(start(name, **({"SIGNORINI_SOAK": "1"} if name == "long_contacts" else {})))
    print("figure: " + FIGURES[name] % passed)


def start(name, cpus=os.sched_getaffinity(0), **env):
    """Starts the tests of this name, on these processors."""
    return subprocess.Popen([*COMMAND, "--", name], cwd=TOP, env={**os.environ, **env}, stdout=subprocess.PIPE, text=True,
                            preexec_fn=lambda: os.sched_setaffinity(0, cpus))


def passed_in(process):
    """The number of tests that passed, of at least one."""
    told, _ = process.communicate()
    passed = sum(int(count) for count in re.findall(r"test result: ok\. (\d+) passed", told))
    check(process.returncode == 0 and passed, told)
    return passed


def simulate(seeds):
    """A part of the seeds on each processor. The threads of one simulation take turns: to wake one that sleeps on another
    processor, and the locks that simulations in one process share, would make it twice as slow."""
    cpus = sorted(os.sched_getaffinity(0))
    bounds = [seeds * n // len(cpus) for n in range(len(cpus) + 1)]
    running = [
        start("simulation", {cpu}, SIGNORINI_SIMULATION_FIRST=str(first), SIGNORINI_SIMULATION_SEEDS=str(end))
        for cpu, first, end in zip(cpus, bounds, bounds[1:])
    ]
    for process in running:
        passed_in(process)


main()
