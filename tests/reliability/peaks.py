"""The memory of every server of the scripts that `run.py` has run before this one, and how long bystanders waited (G9).

    peaks.py

Each server notes, when it is stopped or killed, the most memory that it has used, and the budget of its jobs; each
bystander notes how long 99 of 100 answers took.
"""

import json
import os
import pathlib

from attack import MIB, MOST_P99_S, check

BEYOND_BUDGET = 256 * MIB


def main():
    path = os.environ.get("SIGNORINI_NOTES")
    check(path, "run.py runs this, after the other scripts")
    notes = [json.loads(line) for line in pathlib.Path(path).read_text(encoding="utf-8").splitlines()]
    servers, bystanders = ([one for one in notes if name in one] for name in ("peak", "p99_s"))
    check(servers and bystanders, "no script has noted anything")
    for one in servers:
        check(one["peak"] <= one["budget"] + BEYOND_BUDGET, "%s: %d MiB with a budget of %d MiB" % (
            one["script"], one["peak"] / MIB, one["budget"] / MIB))
    for one in bystanders:
        check(one["p99_s"] <= MOST_P99_S, "%s: a bystander waited %.0f ms (p99)" % (one["script"], 1e3 * one["p99_s"]))
    largest, slowest = max(servers, key=lambda one: one["peak"]), max(bystanders, key=lambda one: one["p99_s"])
    print("figure: the largest of %d servers took %d MiB (%s; budget of its jobs %d MiB), none more than its budget and %d "
          "MiB; of %d bystanders the slowest was answered within %.0f ms (p99, %s)" % (
              len(servers), largest["peak"] / MIB, largest["script"], largest["budget"] / MIB, BEYOND_BUDGET / MIB,
              len(bystanders), 1e3 * slowest["p99_s"], slowest["script"]))


main()
