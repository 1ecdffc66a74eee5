"""Writes the decks of this folder: a quarter ring held at one end, pressed inside and pulled at the
other, in every theory and family that CalculiX and we share; one that hangs and rotates; one that is heated; and one that rests on springs. CalculiX
runs them as they are."""

import math
import pathlib

HERE = pathlib.Path(__file__).parent
ROUND, THICK = 6, 3  # elements along the quarter and across the wall


def deck(name, kind, step, thickness=None, mass=(), heat=None, springs=None):
    """step 2: midside nodes lie on the arcs; triangles are quadrilaterals cut in two. mass: rows of *DLOAD instead of the
    other loads. heat: the temperature at a place, instead of them; 20 at first. springs: along x and y at each node of the end,
    which is not moved then."""
    triangles, axisymmetric = kind[3] == "6", kind.startswith("CAX")
    number, nodes = {}, []
    for j in range(2 * THICK + 1):
        for i in range(2 * ROUND + 1):
            centre = i % 2 and j % 2
            if centre and not triangles:
                continue
            angle, radius = 0.5 * math.pi * i / (2 * ROUND), 1 + 0.5 * j / THICK
            label = 1000 * (j + 1) + i + 1  # numbers with gaps
            number[i, j] = label
            shift = 3 if axisymmetric else 0
            nodes.append((label, shift + radius * math.sin(angle), radius * math.cos(angle)))
    elements, inner, label = [], [], 0
    for j in range(0, 2 * THICK, 2):
        for i in range(0, 2 * ROUND, 2):
            n = lambda di, dj: number[i + di, j + dj]
            # counter-clockwise: along the quarter is clockwise, outwards is up
            corners = [(0, 0), (2, 0), (2, 2), (0, 2)]
            if triangles:
                cells = [
                    [(0, 0), (2, 0), (2, 2), (1, 0), (2, 1), (1, 1)],
                    [(0, 0), (2, 2), (0, 2), (1, 1), (1, 2), (0, 1)],
                ]
            else:
                cells = [corners + [(1, 0), (2, 1), (1, 2), (0, 1)]]
            for k, cell in enumerate(cells):
                label += 1
                elements.append((label, [n(*place) for place in cell]))
                if j == 0 and k == 0:
                    inner.append(label)
    first, last = number[0, 0], number[2 * ROUND, 0]
    fixed = [number[0, j] for j in range(2 * THICK + 1) if (0, j) in number]
    end = [number[2 * ROUND, j] for j in range(2 * THICK + 1) if (2 * ROUND, j) in number]
    lines = ["*HEADING", f"Quarter ring, {kind}", "** written by make.py", "*NODE, NSET=Nall"]
    lines += [f"{label}, {x:.12g}, {y:.12g}" for label, x, y in nodes]
    lines += [f"*ELEMENT, TYPE={kind}, ELSET=Eall"]
    for label, cell in elements:
        # data lines may go on
        lines += [f"{label}, " + ", ".join(map(str, cell[:4])) + ",", ", ".join(map(str, cell[4:]))]
    lines += ["*NSET, NSET=fixed"] + [f"{n}," for n in fixed]
    lines += ["*NSET, NSET=end"] + [f"{n}," for n in end]
    lines += ["*NSET, NSET=inside, GENERATE", f"{first}, {last}, 1"]
    lines += ["*ELSET, ELSET=inner"] + [f"{e}," for e in inner]
    lines += ["*MATERIAL, NAME=steel", "*ELASTIC", "2.1D3, .3", "*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL"]
    lines += [f"{thickness}," if thickness else ","]
    if mass:
        lines[-2:-2] = ["*DENSITY", "2.5D-3"]
    if heat:
        lines[-2:-2] = ["*EXPANSION, ZERO=20.", "1.2D-3"]
        lines += ["*INITIAL CONDITIONS, TYPE=TEMPERATURE", "NALL, 20."]
    if springs:
        lines += ["*ELEMENT, TYPE=SPRING1, ELSET=feet"] + [f"{9000 + k}, {n}" for k, n in enumerate(end)]
        lines += ["*ELEMENT, TYPE=SPRING1, ELSET=sides"] + [f"{9500 + k}, {n}" for k, n in enumerate(end)]
        for component, name_of, stiffness in ((2, "feet", springs[1]), (1, "sides", springs[0])):
            lines += [f"*SPRING, ELSET={name_of}", f"{component},", f"{stiffness},"]
    lines += ["*BOUNDARY", "Fixed, 1, 2" if not axisymmetric else "fixed, 2, 2"]
    lines += ["*STEP", "*STATIC"]
    if heat:
        lines += ["*TEMPERATURE"] + [f"{label}, {heat(x, y):.9g}" for label, x, y in nodes]
    else:
        lines += ["*DLOAD", *(mass or ["INNER, P1, 5."])]
    if mass or heat or springs:
        pass
    elif axisymmetric:
        lines += ["*BOUNDARY", "end, 2, 2, -.01"]
    else:
        lines += ["*BOUNDARY", "end, 1, 1, .02", "*CLOAD", f"{number[ROUND - ROUND % 2, 2 * THICK]}, 2, -1.5"]
    lines += ["*NODE PRINT, NSET=NALL", "U", "*NODE FILE", "U", "*END STEP", ""]
    (HERE / f"{name}.inp").write_text("\n".join(lines))


deck("ring-cpe8", "CPE8", 2)
deck("ring-cpe8r", "CPE8R", 2)
deck("ring-cps8", "CPS8", 2, thickness=0.25)
deck("ring-cax8", "CAX8", 2)
deck("ring-cpe6", "CPE6", 2)
deck("ring-cps6", "CPS6", 2, thickness=0.25)
deck("mass-cpe8", "CPE8", 2, mass=["EALL, GRAV, 3., .6, -.8, 0.", "eall, CENTRIF, 40., 1., -.5, 0., 0., 0., 1."])
deck("mass-cax8", "CAX8", 2, mass=["EALL, GRAV, 3., 0., -1., 0.", "eall, CENTRIF, 40., 0., 0., 0., 0., 1., 0."])


def warm(x, y):
    return 50 + 20 * x - 8 * y


deck("heat-cpe8", "CPE8", 2, heat=warm)
deck("heat-cpe8r", "CPE8R", 2, heat=warm)
deck("heat-cps6", "CPS6", 2, thickness=0.25, heat=warm)
deck("heat-cax8", "CAX8", 2, heat=warm)
deck("spring-cpe8", "CPE8", 2, springs=(40.0, 90.0))
deck("spring-cps8", "CPS8", 2, thickness=0.25, springs=(40.0, 90.0))
# none of revolution: CalculiX takes a stiffness for that of its sector of two degrees
