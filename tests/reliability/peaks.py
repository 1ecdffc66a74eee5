"""The memory of every server of the scripts that `run.py` has run before this one (G9).

    peaks.py

Each server notes, when it is stopped or killed, the most memory that it has used, and the budget of its jobs.
"""

import os
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

from outside import check

MIB = 1 << 20
BEYOND_BUDGET = 256 * MIB


def main():
    noted = os.environ.get("SIGNORINI_PEAKS")
    check(noted, "run.py runs this, after the other scripts")
    servers = [line.split() for line in pathlib.Path(noted).read_text(encoding="utf-8").splitlines()]
    check(servers, "no server has noted its memory")
    for peak, budget, script in servers:
        check(int(peak) <= int(budget) + BEYOND_BUDGET, "%s: %d MiB with a budget of %d MiB" % (
            script, int(peak) / MIB, int(budget) / MIB))
    peak, budget, script = max(servers, key=lambda server: int(server[0]))
    print("figure: the highest of %d servers took %d MiB (%s; budget of its jobs %d MiB); none more than its budget and "
          "%d MiB" % (len(servers), int(peak) / MIB, script, int(budget) / MIB, BEYOND_BUDGET / MIB))


main()
