"""Solves the problem with CalculiX and prints one line of JSON.

Usage: calculix_p1.py MESH COEFFICIENT

As CalculiX's manual advises for elements with midside nodes: contact from surface to surface, by a penalty. The
cylinder is a row of elements of which all nodes are prescribed, on the arc that the contact can reach. One increment,
so that friction counts slip from the unloaded state, as the other programs here do. The CPU time is that of `ccx`
alone, without the writing of its deck.
"""

import json
import math
import pathlib
import re
import sys
import tempfile

import body
import problem

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

from measured import measured

# Times Young's modulus, per length. The manual advises 5 to 50. At 100 the cylinder enters the body by 0.5 % of the
# indentation; at 1,000 CalculiX reports a finished job with tension in the contact and a fifth of the force missing.
NORMAL_STIFFNESS = 100
# The slope of friction while it sticks, to that of the pressure. The manual advises about 0.1; with 1 the slip of what
# sticks is at most 1.5e-4, close to the problem's elastic slip, at no more iterations.
STICK = 1.0
# the arc of the cylinder: elements of about 0.1 with curved edges, wider than the contact
ARC, PIECES = 1.6, 16
# faces of the body that may touch
REACH = 1.2


def deck(made, coefficient):
    """The input of CalculiX as text for a body, whose nodes have their numbers there plus one."""
    cylinder, arc = cylinder_after(len(made.nodes))
    kind, count = "CPE%d" % len(made.elements[0]), len(made.elements)
    top = [(element, side) for element, side, ends in made.top_sides()
           if min(made.nodes[end][0] for end in ends) < REACH]

    def numbered(first, elements):
        return ["%d, %s" % (n, ", ".join(str(node + 1) for node in nodes)) for n, nodes in enumerate(elements, first)]

    friction = []
    if coefficient:
        slope = STICK * NORMAL_STIFFNESS * problem.YOUNGS_MODULUS
        friction = ["*FRICTION", "%r, %r" % (coefficient, slope)]
    return "\n".join([
        "*NODE", *("%d, %r, %r" % (n, a, b) for n, (a, b) in enumerate(made.nodes + cylinder, 1)),
        "*ELEMENT, TYPE=%s, ELSET=BODY" % kind, *numbered(1, made.elements),
        "*ELEMENT, TYPE=CPE8, ELSET=CYLINDER", *numbered(count + 1, arc),
        "*NSET, NSET=LEFT", *(str(node + 1) for node in made.left()),
        "*NSET, NSET=BOTTOM", *(str(node + 1) for node in made.bottom()),
        "*NSET, NSET=MOVED", *(str(len(made.nodes) + n) for n in range(1, len(cylinder) + 1)),
        "*SURFACE, NAME=TOP", *("%d, S%d" % (element + 1, side + 1) for element, side in top),
        "*SURFACE, NAME=ARC", *("%d, S1" % (count + n) for n in range(1, len(arc) + 1)),
        "*MATERIAL, NAME=ELASTIC",
        "*ELASTIC", "%r, %r" % (problem.YOUNGS_MODULUS, problem.POISSONS_RATIO),
        "*SOLID SECTION, ELSET=BODY, MATERIAL=ELASTIC", "1.",
        "*SOLID SECTION, ELSET=CYLINDER, MATERIAL=ELASTIC", "1.",
        "*SURFACE INTERACTION, NAME=CONTACT",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", repr(NORMAL_STIFFNESS * problem.YOUNGS_MODULUS),
        *friction,
        "*CONTACT PAIR, INTERACTION=CONTACT, TYPE=SURFACE TO SURFACE", "TOP, ARC",
        "*BOUNDARY", "LEFT, 1, 1", "BOTTOM, 2, 2", "MOVED, 1, 1",
        "*STEP", "*STATIC", "1., 1.",
        "*BOUNDARY", "MOVED, 2, 2, %r" % -problem.INDENTATION,
        "*NODE PRINT, NSET=BOTTOM, TOTALS=ONLY", "RF",
        "*NODE PRINT, NSET=LEFT, TOTALS=ONLY", "RF",
        "*CONTACT FILE", "CSTR",
        "*END STEP", "",
    ])


def cylinder_after(count):
    """The nodes of the cylinder, and its elements, of which side 1 is on the arc; their nodes are counted on from those
    of the body."""
    nodes, number = [], {}
    for i in range(2 * PIECES + 1):
        # it begins half a piece beyond the axis: a slave point on the axis has a face on both sides
        angle = (i - 1) * ARC / (2 * PIECES) / problem.RADIUS
        for j in range(3):
            if i % 2 == 0 or j != 1:
                radius = problem.RADIUS - 0.05 * j
                number[i, j] = count + len(nodes)
                nodes.append((radius * math.sin(angle), problem.RADIUS - radius * math.cos(angle)))
    places = ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1))
    return nodes, [[number[2 * i + a, b] for a, b in places] for i in range(PIECES)]


def total(table, name):
    """The components of the reaction of a set, of the last increment."""
    found = re.findall(r"for set %s .*\n\s*\n\s+(\S+)\s+(\S+)" % name, table)
    return tuple(float(component) for component in found[-1])


def pressure(results, node):
    """The contact pressure at a node: the fourth number after it, in columns of twelve characters."""
    block = results[results.rindex(" -4  CONTACT"):]
    row = re.search(r"^ -1%10d(.*)$" % node, block, re.M)[1]
    return float(row[36:48])


def main(mesh, coefficient):
    made = body.read(mesh)
    text, axis = deck(made, coefficient), made.nodes.index((0, 0)) + 1
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "p1.inp").write_text(text)
        run = measured(["ccx", "p1"], cwd=folder)
        # CalculiX says so even where it does not answer with an error
        if "Job finished" not in run.stdout or "*ERROR" in run.stdout:
            sys.exit("CalculiX failed\n" + run.stdout[-2000:])
        table, results = (folder / "p1.dat").read_text(), (folder / "p1.frd").read_text()
        rows = (folder / "p1.sta").read_text().split("\n")
    iterations = sum(int(row.split()[3]) for row in rows if re.match(r"\s+\d", row))
    print(json.dumps({
        "program": "CalculiX",
        "dofs": 2 * len(made.nodes),
        "iterations": iterations,
        "user_s": run.user_s,
        "system_s": run.system_s,
        "peak_bytes": run.peak_bytes,
        "vertical_force": abs(total(table, "BOTTOM")[1]),
        "horizontal_force": abs(total(table, "LEFT")[0]),
        "peak_pressure": pressure(results, axis),
    }))


main(sys.argv[1], float(sys.argv[2]))
