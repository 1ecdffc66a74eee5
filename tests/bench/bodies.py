"""Measures a pair of elastic bodies, a roller on a block, against one body of as many unknowns and against CalculiX, and
prints the tables of docs/performance.md, "Two bodies".

    bodies.py [--unknowns N] [--runs N] [--without-calculix]

All are decks, with their reading, on one thread, 2e5 unknowns when absent (CalculiX has half as many nodes again, since it
makes bricks of them). Runs (3 when absent; one of CalculiX, some minutes) take turns; ratios are formed within a turn.
Seconds are processor time of the user. `cargo build --release --workspace` comes first, or SIGNORINI_BINARY.
"""

import argparse
import json
import math
import pathlib
import re
import statistics
import sys
import tempfile

TESTS = pathlib.Path(__file__).resolve().parent.parent
sys.path[:0] = [str(TESTS), str(TESTS / "data/abaqus")]

import make_bodies
import make_rollers
from measured import measured
from outside import BINARY


def pair(unknowns):
    """A deck of two bodies, of half of the unknowns each: grids of n × n elements have about 6 n² of them."""
    n = round(math.sqrt(unknowns / 12))
    return make_bodies.roller(n, n, n * 9 // 10, n * 10 // 9)


def single(unknowns):
    """A deck of one body under a rigid roller."""
    n = round(math.sqrt(unknowns / 6))
    block = make_rollers.patch(1, n, n, lambda u, v: (3 * (2 * u - 1), -3 * (1 - v)))
    tool = make_rollers.around(4.0, 0.5, 4.0, 0.4, 30, 10_000_001, -1)
    return make_rollers.deck("single", block, tool, make_rollers.HARD, [(0, -0.05)], reference=20_000_001)


def signorini(folder, name):
    """Seconds, and the summary."""
    out = folder / f"{name}.json"
    run = measured([BINARY, "solve", folder / f"{name}.inp", "-o", out, "--threads", "1"])
    return run, json.loads(out.read_text())


def calculix(folder, name):
    """Seconds, and the displacements by node."""
    run = measured(["ccx", name], cwd=folder, timeout_s=7200)
    if "Job finished" not in run.stdout:
        sys.exit("CalculiX failed\n" + run.stdout[-2000:])
    last = (folder / f"{name}.dat").read_text().split("displacements")[-1]
    rows = re.findall(r"^\s+(\d+)\s+(\S+)\s+(\S+)\s+\S+$", last, re.M)
    return run, {int(node): (float(x), float(y)) for node, x, y in rows}


def memory(run):
    """The peak of memory in words, where it is known."""
    return "" if run.peak_bytes is None else f", {run.peak_bytes / 1e6:.0f} MB"


def main(options):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for deck, text in [("pair", pair(options.unknowns)), ("single", single(options.unknowns))]:
            (folder / f"{deck}.inp").write_text(text)
        ratios = []
        for _ in range(options.runs):
            (two, result), (one, other) = signorini(folder, "pair"), signorini(folder, "single")
            ratios.append(two.user_s / one.user_s)
            counts = [2 * len(r["fields"]["ux"]) for r in (result, other)]
            print(f"pair of {counts[0]} unknowns {two.user_s:.2f} s{memory(two)}; one body of {counts[1]} "
                  f"{one.user_s:.2f} s{memory(one)}", flush=True)
        print(f"| pair against one body | {min(ratios):.2f} to {max(ratios):.2f}, {statistics.median(ratios):.2f} × |")
        if options.without_calculix:
            return
        theirs, moved = calculix(folder, "pair")
        numbers = sorted(moved)
        ours = dict(zip(numbers, zip(result["fields"]["ux"], result["fields"]["uy"])))
        size = max(abs(u) for node in ours.values() for u in node)
        off = max(abs(a - b) for node in numbers for a, b in zip(ours[node], moved[node])) / size
        print(f"CalculiX {theirs.user_s:.0f} s{memory(theirs)}, {theirs.user_s / two.user_s:.0f} × the time of "
              f"Signorini; displacements differ by at most {off:.1e} of the largest")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("--unknowns", type=float, default=2e5)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--without-calculix", action="store_true")
    main(parser.parse_args())
