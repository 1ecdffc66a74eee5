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
    "simulation": "%d seeds of clients, workers, crashes, full disks and clocks that are set: no promise broken",
}


def main():
    name, seeds = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 1000
    # the same selection of packages as tests/run: nothing is compiled again
    command = ["cargo", "test", "--release", "--workspace", "--lib", "--", name]
    # the one that takes minutes is asked for by its name only
    soak = {"SIGNORINI_SOAK": "1"} if name == "long_contacts" else {}
    env = {**os.environ, **soak, "SIGNORINI_SIMULATION_SEEDS": str(seeds)}
    ran = subprocess.run(command, cwd=TOP, env=env, stdout=subprocess.PIPE, text=True)
    passed = sum(int(count) for count in re.findall(r"test result: ok\. (\d+) passed", ran.stdout))
    check(ran.returncode == 0 and passed, ran.stdout)
    print("figure: " + FIGURES[name] % (seeds if name == "simulation" else passed))


main()
