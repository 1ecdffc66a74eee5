"""Solves the problem with `signorini solve` and prints one line of JSON, as the scripts of its peers do.

Usage: signorini_p1.py MESH COEFFICIENT
"""

import json
import math
import pathlib
import sys
import tempfile

import problem

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

from measured import measured
from outside import BINARY

STATED = {
    "vertical_force": "normal_force", "horizontal_force": "tangential_force", "peak_pressure": "peak_normal_stress",
}


def simpson(x, values):
    """The integral along edges of three nodes."""
    return sum((x[i + 2] - x[i]) / 6 * (values[i] + 4 * values[i + 1] + values[i + 2])
               for i in range(0, len(x) - 2, 2))


def forces(profile, contact):
    """The horizontal and the vertical force on the body.

    The forces of the summary are integrals of stresses along the obstacle's normal and tangent, taken by the solver.
    Only their small deviations from the vertical and the horizontal are integrated here: the normal is inclined by at
    most 5°.
    """
    x = profile["x"]
    normal, tangential = profile["normal_stress"], profile["tangential_stress"]
    # the slope of the circle above the node; far from the contact stresses are zero
    sine = [min(c / problem.RADIUS, 0.9) for c in x]
    lost = [1 - math.sqrt(1 - s * s) for s in sine]
    down = contact["normal_force"] + simpson(x, [p * l - t * s for p, t, l, s in zip(normal, tangential, lost, sine)])
    across = contact["tangential_force"] - simpson(
        x, [t * l + p * s for p, t, l, s in zip(normal, tangential, lost, sine)])
    return across, down


def main(mesh, coefficient):
    with tempfile.TemporaryDirectory() as name:
        given, *results = [pathlib.Path(name) / file for file in ("problem.json", "summary.json", "profile.json")]
        given.write_text(json.dumps(problem.problem(problem.mesh(mesh), coefficient)))
        # what its peers are asked for too: forces and stresses along the contact, no fields
        run = measured([BINARY, "solve", given, "-o", results[0], "-o", results[1]])
        summary, profile = [json.loads(result.read_text()) for result in results]
    across, down = forces(profile, summary["contacts"]["top"])
    relative = {row["quantity"]: row["relative"] for row in summary["accuracy"]["quantities"]}
    print(json.dumps({
        "program": "Signorini",
        "dofs": summary["dofs"],
        "iterations": summary["iterations"],
        "user_s": run.user_s,
        "system_s": run.system_s,
        "peak_bytes": run.peak_bytes,
        "vertical_force": abs(down),
        "horizontal_force": abs(across),
        "peak_pressure": abs(profile["normal_stress"][0]),
        # the errors that it states of the forces along the normal and the tangent, and of the peak, relative
        "stated": {key: relative.get(name) for key, name in STATED.items()},
    }))


main(sys.argv[1], float(sys.argv[2]))
