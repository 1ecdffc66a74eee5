"""Solves one problem with Signorini, GetFEM and CalculiX and compares the forces; CHOLMOD factors its matrix.

Usage: run.py [--large]

Free triangles, few and coarse, and 2e4 degrees of freedom on a grid, in half a minute; with --large also 2e5, in some
five minutes. Times are printed and not judged: tests/bench/solver.py measures them. Needs `target/release/signorini`
(or SIGNORINI_BINARY), Debian's calculix-ccx and python3-getfem, and the environment `target/peers` with
requirements.txt of this folder.
"""

import sys

import problem
from programs import TOP, UNIAXIAL, cpu, solve

# Relative, for the vertical force. GetFEM: two discretisations with elements of a seventh of the contact's length
# differ by 4e-4, the two ways to measure the gap by 1e-4. CalculiX: its penalty lets the cylinder in by 0.4 % of
# the indentation on the mean, and the force grows a little faster than the indentation.
VERTICAL = {"GetFEM": 2e-3, "CalculiX": 6e-3}
# The horizontal force, most of it friction: with elastic slip of 1e-4 the stuck middle carries 1 % less than in GetFEM,
# which has none; the penalty of CalculiX takes as much.
HORIZONTAL = {"GetFEM": 0.02, "CalculiX": 0.03}
# Triangles of a third of the contact's length, in a half that is 6 wide and 4 high. The differences are larger than on
# the grid, by less than this factor.
FREE, COARSE = TOP / "tests/data/gmsh/block-half-tri6.msh", 2


def compare(mesh, factor=1):
    """Prints a row for each program and returns what is wrong, with tolerances times a factor."""
    wrong = []
    for coefficient in (0.0, problem.COEFFICIENT):
        ours = solve("Signorini", mesh, coefficient)
        print_row(ours, coefficient, ours)
        for program in VERTICAL:
            theirs = solve(program, mesh, coefficient)
            print_row(theirs, coefficient, ours)
            differences = [("vertical", factor * VERTICAL[program])]
            if coefficient:
                differences.append(("horizontal", factor * HORIZONTAL[program]))
            for direction, allowed in differences:
                a, b = (result[direction + "_force"] for result in (theirs, ours))
                if not abs(a / b - 1) <= allowed:
                    wrong.append("%s, mu = %g: %s force %.6g, Signorini's %.6g, allowed %g relative"
                                 % (program, coefficient, direction, a, b, allowed))
    matrix = solve("CHOLMOD", mesh)
    print("%-10s %7d dofs, factor and solve %8.2f CPU s, uniaxial solution to %.1e"
          % ("CHOLMOD", matrix["dofs"], cpu(matrix), matrix["error"]))
    if not matrix["error"] <= UNIAXIAL:
        wrong.append("CHOLMOD: error %g, allowed %g" % (matrix["error"], UNIAXIAL))
    return wrong


def print_row(result, coefficient, ours):
    peak = result["peak_bytes"]
    columns = [
        "%-10s %7d dofs" % (result["program"], result["dofs"]),
        "mu = %.1f" % coefficient,
        "%7.2f CPU s (%5.1f times Signorini's)" % (cpu(result), cpu(result) / cpu(ours)),
        "%6.0f MB" % (peak / 1e6) if peak else "memory unknown",
        "%3d iterations" % result["iterations"],
        "force %.4f down, %.4f across" % (result["vertical_force"], result["horizontal_force"]),
        "peak pressure %.3f" % result["peak_pressure"],
    ]
    if not coefficient:
        columns.append("by Hertz for this force %.3f" % problem.hertz(result["vertical_force"]))
    print(", ".join(columns), flush=True)


def main(arguments):
    if set(arguments) - {"--large"}:
        sys.exit(__doc__)
    wrong = compare(str(FREE), COARSE) + compare("2e4")
    if "--large" in arguments:
        wrong += compare("2e5")
    if wrong:
        sys.exit("\n".join(wrong))


main(sys.argv[1:])
