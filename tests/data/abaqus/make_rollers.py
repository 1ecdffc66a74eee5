"""Writes decks with rigid tools, as CalculiX runs them: a roller on a block, a plate under a disc, a plate that drags a
block. The tools are elements that a *RIGID BODY holds; `tests/calculix.py` compares the displacements."""

import math
import pathlib

HERE = pathlib.Path(__file__).parent


def patch(base, across, along, place):
    """Nodes and elements of second order of a grid in u, v of 0 … 1; midsides by `place`, too."""
    label = lambda i, j: base + i + (2 * across + 1) * j
    nodes = [
        (label(i, j), *place(i / (2 * across), j / (2 * along)))
        for j in range(2 * along + 1)
        for i in range(2 * across + 1)
        if not (i % 2 and j % 2)
    ]
    around = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]
    elements = [
        (base + i + across * j, [label(2 * i + p, 2 * j + q) for p, q in around])
        for j in range(along)
        for i in range(across)
    ]
    sides = [[base + i for i in range(across)], [base + i + across * (along - 1) for i in range(across)]]
    ends = [[label(i, j) for i in range(2 * across + 1)] for j in (0, 2 * along)]
    return nodes, elements, sides, ends


def written(nodes, elements, name):
    lines = [f"*NODE, NSET=N{name}"] + [f"{label}, {x:.12g}, {y:.12g}" for label, x, y in nodes]
    lines += [f"*ELEMENT, TYPE=CPE8, ELSET={name}"]
    return lines + [f"{label}, " + ", ".join(map(str, cell)) for label, cell in elements]


def deck(name, body, tool, interaction, steps, reference=9001):
    """The body is held at v = 0 and touched at v = 1; the tool touches by its sides S1."""
    nodes, elements, [_, last], [low, _] = body
    lines = ["*HEADING", f"{name}, with a rigid tool", "** written by make_rollers.py"] + written(nodes, elements, "BODY")
    lines += written(tool[0], tool[1], "TOOL") + ["*NODE", f"{reference}, 0., 0.", f"{reference + 1}, 0., 0."]
    lines += ["*ELSET, ELSET=FRONT"] + [f"{e}," for e in last] + ["*NSET, NSET=HELD"] + [f"{n}," for n in low]
    lines += ["*SURFACE, NAME=FACE", "FRONT, S3", "*SURFACE, NAME=RIGID", "TOOL, S1"]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", "1000., .3", "*SOLID SECTION, ELSET=BODY, MATERIAL=M"]
    lines += ["*SOLID SECTION, ELSET=TOOL, MATERIAL=M", f"*RIGID BODY, NSET=NTOOL, REF NODE={reference}, ROT NODE={reference + 1}"]
    lines += ["*SURFACE INTERACTION, NAME=I"] + interaction
    lines += ["*CONTACT PAIR, INTERACTION=I, TYPE=NODE TO SURFACE", "FACE, RIGID", "*BOUNDARY", "HELD, 1, 2", f"{reference + 1}, 1, 3"]
    for x, y in steps:
        lines += ["*STEP", "*STATIC", "0.2, 1.", "*BOUNDARY", f"{reference}, 1, 1, {x}", f"{reference}, 2, 2, {y}"]
        lines += ["*NODE PRINT, NSET=NBODY", "U", "*END STEP"]
    return "\n".join(lines + [""])


def write(name, *parts):
    (HERE / f"{name}.inp").write_text(deck(name, *parts))


def block(width, height, grade):
    """Nodes come closer to the middle of the face y = 0."""

    def place(u, v):
        w = 2 * u - 1
        return width * w * (1 - grade + grade * abs(w)), -height * (1 - v)

    return patch(1, 20, 6, place)


def around(radius, thick, middle, half, across, base, downwards):
    """A ring sector: v = 0 is its outer side if `downwards` is negative."""

    def place(u, v):
        angle = half * (1 - 2 * u) * downwards
        r = radius - thick * v
        return r * math.sin(angle), middle - r * math.cos(angle)

    return patch(base, across, 1, place)


HARD = ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "1e7, 1e-3"]


def disc(u, v):
    angle, r = 0.5 * math.pi * 0.9 * (1 - 2 * u), 0.4 + 0.6 * v
    return r * math.sin(angle), -r * math.cos(angle)


def main():
    roller = block(3.0, 3.0, 0.6), around(4.0, 0.5, 4.0, 0.4, 30, 5001, -1), HARD, [(0, -0.05)]
    write("roller-cpe8", *roller)
    # the same under a force
    pushed = deck("push-cpe8", *roller).replace("9001, 2, 2, -0.05", "*CLOAD\n9001, 2, -30.")
    (HERE / "push-cpe8.inp").write_text(pushed)
    write("disc-cpe8", patch(1, 30, 3, disc), patch(5001, 1, 1, lambda u, v: (2 - 4 * u, -1 - 0.5 * v)), HARD, [(0, 0.02)])

    # all of the face sticks at first, and slides in the end
    friction = HARD + ["*FRICTION, ELASTIC SLIP=1E-4", "0.3, 1e5"]
    write("drag-cpe8", block(1.0, 2.0, 0.0), patch(5001, 1, 1, lambda u, v: (-3 + 6 * u, 0.5 * v)), friction, [(0, -0.02), (0.01, -0.02)])


if __name__ == "__main__":
    main()
