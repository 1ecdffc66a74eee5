"""The programs that are compared: how each is called, and what it is compared with."""

import json
import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent
TOP = HERE.parent.parent

sys.path.insert(0, str(HERE.parent))

from measured import measured

# GetFEM's module is made for Debian's own Python; scikit-sparse is built in an environment of its own.
DEBIANS_PYTHON = "/usr/bin/python3"
ENVIRONMENT = TOP / "target/peers/bin/python"
COMMANDS = {
    "Signorini": (sys.executable, "signorini_p1.py"),
    "GetFEM": (DEBIANS_PYTHON, "getfem_p1.py"),
    "CalculiX": (sys.executable, "calculix_p1.py"),
    "CHOLMOD": (ENVIRONMENT, "cholmod_p1.py"),
}

QUANTITIES = ("vertical_force", "horizontal_force", "peak_pressure")
# The displacements under a uniform pressure are in the space of the elements: only rounding is left in CHOLMOD's.
UNIAXIAL = 1e-9


def solve(program, mesh, coefficient=0.0):
    """What the program's script prints: times in seconds, peak memory in bytes, forces of the half model."""
    python, script = COMMANDS[program]
    arguments = [mesh] if program == "CHOLMOD" else [mesh, coefficient]
    # longer than what the scripts themselves allow the programs that they start, so that none is left behind
    run = measured([python, HERE / script, *arguments], timeout_s=960)
    return json.loads(run.stdout.splitlines()[-1])


def limits(mesh, coefficient):
    """What the problem has for each of QUANTITIES when the mesh is refined, by the program.

    A program's error is its distance from its own limit, computed here on a mesh that is finer near the contact than
    the one that is compared, and for GetFEM with its own quadratic elements: the programs measure the gap to the
    cylinder along slightly different lines, which differ in 1e-4 of the force, more than the errors of a fine mesh, and
    their laws of friction differ in the force across. The two limits confirm each other as far as that goes, and without
    friction both the closed form of Hertz (`problem.hertz`). CalculiX reaches no limit by refinement, because of its
    penalty: its error is the distance from the mean of the two, and with friction from Signorini's, since the slope of
    its friction lets as much slip as Signorini's elastic slip does.
    """
    found = {program: solve(program, mesh, coefficient) for program in ("Signorini", "GetFEM")}
    mean = {key: sum(limit[key] for limit in found.values()) / 2 for key in QUANTITIES}
    found["CalculiX"] = found["Signorini"] if coefficient else mean
    return found


def error(result, limit, quantity):
    """The relative distance of a quantity from its limit."""
    return abs(result[quantity] / limit[quantity] - 1)


def cpu(result):
    """Seconds of processor time, of the program and of the system for it."""
    return result["user_s"] + result["system_s"]
