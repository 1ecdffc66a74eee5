"""Random pairs of elastic bodies: every stated error against the same problem on a mesh four times as fine.

    pairs.py PROGRAM [--pairs 300] [--seed 1]

Rollers on blocks, flats on blocks and rings in rings, of several moduli, meshes that do not match, with and without friction.
Of the numbers of solutions that are not `poor` at most one in twenty may be off by more than its error, none by more than twice;
at most one pair in a hundred may not converge. Each exception is printed.
"""

import argparse
import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile

MODULI = [(1000, 1000), (1000, 3000), (3000, 1000), (1000, 2e5)]
RATIOS = [0, 0.2, 0.3, 0.45]
EDGES = [0.05, 0.08, 0.1]


def lines(start, end, first, growth):
    """Grid lines from `start` to `end`, with a first distance that grows."""
    found, step = [start], first
    while end - found[-1] > 1.3 * step:
        found.append(found[-1] + step)
        step *= growth
    return [*found, end]


def down(end, first, growth):
    """Grid lines below 0, the finest at 0."""
    return [-y for y in reversed(lines(0, end, first, growth))]


def roller(dice, own, other):
    """A quarter of a cylinder on half of a block."""
    radius, size = dice.choice([5, 10, 20]), 12.0
    across = lines(0, 1.2, other, 1.0)[:-1] + lines(1.2, 3.5, 1.5 * other, 1.5)
    arc = [[x, radius - math.sqrt(radius * radius - x * x)] for x in across]
    block = {"x": lines(0, 1.2, own, 1.0)[:-1] + lines(1.2, size, 1.5 * own, 1.5), "y": down(size, own, 1.4)}
    upper = {
        "x": across,
        "y": [y / size for y in lines(0, size, other, 1.4)],
        "bottom": arc,
        "top": [[0, size], [across[-1], size]],
    }
    circle = {"kind": "circle", "center": [0, radius], "radius": radius}
    return {
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grids": {"lower": block, "upper": upper}, "curves": {"upper.bottom": circle}},
        "supports": [
            {"boundary": "lower.bottom", "uy": 0},
            {"boundary": "lower.left", "ux": 0},
            {"boundary": "upper.left", "ux": 0},
        ],
        "loads": [{"boundary": "upper.top", "pressure": dice.uniform(1, 8)}],
        "contacts": [{"boundary": "lower.top", "against": {"boundary": "upper.bottom"}}],
    }


def flat(dice, own, other):
    """Half of a flat block on half of a wider one."""
    width = dice.choice([0.8, 1.0, 1.3])
    lower = {"x": lines(0, width, own, 1.0)[:-1] + lines(width, 4, own, 1.4), "y": down(3, own, 1.5)}
    upper = {"x": lines(0, width, other, 1.0), "y": lines(0, 2, other, 1.4)}
    return {
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grids": {"lower": lower, "upper": upper}},
        "supports": [
            {"boundary": "lower.bottom", "ux": 0, "uy": 0},
            {"boundary": "lower.left", "ux": 0},
            {"boundary": "upper.left", "ux": 0},
        ],
        "loads": [{"boundary": "upper.top", "pressure": dice.uniform(1, 20)}],
        "contacts": [{"boundary": "upper.bottom", "against": {"boundary": "lower.top"}}],
    }


def ring(dice, own, other):
    """A hub on a longer shaft, by an interference."""
    hub = {"x": lines(1, 2, own, 1.3), "y": lines(0, 1, own, 1.0)}
    shaft = {"x": [1 + x for x in down(0.6, other, 1.3)], "y": lines(0, 1.4, other, 1.0)}
    gap = {"interference": dice.choice([1e-3, 5e-3])}
    return {
        "analysis": {"kind": "axisymmetric"},
        "mesh": {"grids": {"lower": hub, "upper": shaft}},
        "supports": [{"boundary": "lower.bottom", "uy": 0}, {"boundary": "upper.bottom", "uy": 0}],
        "contacts": [{"boundary": "lower.left", "against": {"boundary": "upper.right"}, "gap": gap}],
    }


def pair(dice):
    """A random problem."""
    problem = dice.choice([roller, roller, flat, ring])(dice, dice.choice(EDGES), dice.choice(EDGES))
    moduli = dice.choice(MODULI)
    problem["materials"] = [
        {"group": group, "youngs_modulus": modulus, "poissons_ratio": dice.choice(RATIOS)}
        for group, modulus in zip(("lower", "upper"), moduli, strict=True)
    ]
    if dice.random() < 0.7:
        problem["contacts"][0]["friction"] = {
            "coefficient": dice.choice([0.1, 0.3, 0.6]),
            "nonlocal_radius": dice.choice([0, 0.1, 0.2]),
            "elastic_slip": dice.choice([1e-4, 1e-3]),
        }
    return problem


def solved(program, folder, problem, refine):
    """The summary of a solution; none if there is none."""
    file, out = folder / "pair.json", folder / "out.json"
    file.write_text(json.dumps({**problem, "mesh": {**problem["mesh"], "refine": refine}}))
    ran = subprocess.run([program, "solve", file, "-o", out], capture_output=True, text=True)
    if ran.returncode:
        print(ran.stderr[-500:])
        return None
    summary = json.loads(out.read_text())["summary"]
    return summary if summary["converged"] else None


def excesses(own, fine):
    """By how many of its stated errors each number is off."""
    finer = {q["quantity"]: q["value"] for q in fine["accuracy"]["quantities"]}
    unsigned = any(warning["code"] == "peak_sign_unknown" for warning in own["warnings"])
    for quantity in own["accuracy"]["quantities"]:
        name, error = quantity["quantity"], quantity["error"]
        # ends of stick are several of one name
        if name == "stick_end" or name not in finer or error is None:
            continue
        values = quantity["value"], finer[name]
        if name == "peak_tangential_stress" and unsigned:
            values = tuple(map(abs, values))
        rounding = 1e-9 * abs(values[1]) + 1e-14
        yield name, abs(values[0] - values[1]) / max(error, rounding)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--pairs", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    dice = random.Random(options.seed)
    count = exceeded = worst = unsolved = poor = 0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(options.pairs):
            problem = pair(dice)
            own, fine = (solved(options.program.resolve(), pathlib.Path(folder), problem, refine) for refine in (0, 2))
            if own is None or fine is None:
                unsolved += 1
                print("pair %d is not solved: %s" % (number, json.dumps(problem)))
                continue
            if own["accuracy"]["verdict"] == "poor":
                poor += 1
                continue
            for name, off in excesses(own, fine):
                count += 1
                worst = max(worst, off)
                if off > 1:
                    exceeded += 1
                    print("pair %d: %s is off by %.2f of its errors" % (number, name, off))
    print(
        "%d pairs: %d not solved, %d poor; of %d numbers %d off by more than their errors, the worst by %.2f of them"
        % (options.pairs, unsolved, poor, count, exceeded, worst)
    )
    sys.exit(int(100 * unsolved > options.pairs or 20 * exceeded > count or worst > 2))


if __name__ == "__main__":
    main()
