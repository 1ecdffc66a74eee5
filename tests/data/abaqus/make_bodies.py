"""Writes decks of two elastic bodies, as CalculiX runs them: a roller on a block, a shaft in its hub, two blocks that are
tied. `tests/calculix.py` compares the displacements, `tests/bench/bodies.py` the time of a finer roller."""

import math
import pathlib

from make_rollers import HARD, patch, written

HERE = pathlib.Path(__file__).parent
ZERO = 1e-9
PAIR = ["*SURFACE INTERACTION, NAME=I", *HARD, "*CONTACT PAIR, INTERACTION=I, TYPE=SURFACE TO SURFACE", "FACEA, FACEB"]


def deck(name, bodies, between, held, step, moduli=(1000, 3000)):
    """`bodies`: two patches, of which the first carries the law at v = 1 and the second faces it at v = 0."""
    lines = ["*HEADING", f"{name}, two elastic bodies", "** written by make_bodies.py"]
    for body, (nodes, elements, [first, last], _) in zip("AB", bodies):
        lines += written(nodes, elements, body)
        sides, face = (last, "S3") if body == "A" else (first, "S1")
        lines += [f"*ELSET, ELSET=FRONT{body}"] + [f"{e}," for e in sides]
        lines += [f"*SURFACE, NAME=FACE{body}", f"FRONT{body}, {face}"]
    for set_name, labels in held.items():
        lines += [f"*NSET, NSET={set_name}"] + [f"{n}," for n in labels]
    lines += ["*NSET, NSET=BOTH", "NA, NB"]
    for body, modulus in zip("AB", moduli):
        lines += [f"*MATERIAL, NAME=M{body}", "*ELASTIC", f"{modulus}., .3"]
        lines += [f"*SOLID SECTION, ELSET={body}, MATERIAL=M{body}"]
    lines += between + ["*STEP", "*STATIC", "0.2, 1."] + step
    lines += ["*NODE PRINT, NSET=BOTH", "U"]
    return "\n".join(lines + ["*END STEP", ""])


def at(body, test):
    """The numbers of the nodes at which a condition holds."""
    return [label for label, x, y in body[0] if test(x, y)]


def near(u):
    """From 0 to 1 in steps that grow."""
    return 0.4 * u + 0.6 * u * u


def roller(across=16, deep=8, around=11, thick=5):
    """A half of a ring of radii 4 and 2, moved down by 0.05, on a half of a block of 3 × 3: elements along the face and across
    it of the block, and of the ring."""

    def ring(u, v):
        angle, radius = 0.7 * near(u), 4 - 2 * v
        return radius * math.sin(angle), 4 - radius * math.cos(angle)

    block = patch(1, across, deep, lambda u, v: (3 * near(u), -3 * near(1 - v)))
    upper = patch(5001 if across < 20 else 1000001, around, thick, ring)
    held = {
        "BOTTOM": at(block, lambda x, y: y < -3 + ZERO),
        "MIDDLE": at(block, lambda x, y: abs(x) < ZERO) + at(upper, lambda x, y: abs(x) < ZERO),
        "INSIDE": at(upper, lambda x, y: math.hypot(x, y - 4) < 2 + ZERO),
    }
    step = ["*BOUNDARY", "BOTTOM, 2, 2", "MIDDLE, 1, 1", "INSIDE, 1, 1", "INSIDE, 2, 2, -0.05"]
    return deck("pair-roller-cpe8", [block, upper], PAIR, held, step)


def fit():
    """A quarter of a ring of radii 0.4 and 1.001 in one of radii 1 and 2."""

    def quarter(inner, outer, across, along, base):
        def place(u, v):
            angle, radius = 0.5 * math.pi * (1 - u), inner + (outer - inner) * v
            return radius * math.cos(angle), radius * math.sin(angle)

        return patch(base, across, along, place)

    shaft, hub = quarter(0.4, 1.001, 16, 4, 1), quarter(1, 2, 12, 5, 5001)
    held = {
        "LEFT": at(shaft, lambda x, y: abs(x) < ZERO) + at(hub, lambda x, y: abs(x) < ZERO),
        "LOW": at(shaft, lambda x, y: abs(y) < ZERO) + at(hub, lambda x, y: abs(y) < ZERO),
    }
    return deck("pair-fit-cpe8", [shaft, hub], PAIR, held, ["*BOUNDARY", "LEFT, 1, 1", "LOW, 2, 2"], (1000, 1000))


def tie():
    """Two blocks of 2 × 1 on one another, the upper one displaced."""
    lower = patch(1, 6, 4, lambda u, v: (2 * u, v))
    upper = patch(5001, 4, 4, lambda u, v: (2 * u, 1 + v))
    held = {"BOTTOM": at(lower, lambda x, y: y < ZERO), "TOP": at(upper, lambda x, y: y > 2 - ZERO)}
    step = ["*BOUNDARY", "BOTTOM, 1, 2", "TOP, 1, 1, 0.02", "TOP, 2, 2, -0.01"]
    return deck("pair-tie-cpe8", [lower, upper], ["*TIE, NAME=T, POSITION TOLERANCE=0.01", "FACEA, FACEB"], held, step)


if __name__ == "__main__":
    for name, text in [("roller", roller()), ("fit", fit()), ("tie", tie())]:
        (HERE / f"pair-{name}-cpe8.inp").write_text(text)
