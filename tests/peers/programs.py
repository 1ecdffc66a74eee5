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


def solve(program, mesh, coefficient=0.0):
    """What the program's script prints: times in seconds, peak memory in bytes, forces of the half model."""
    python, script = COMMANDS[program]
    arguments = [mesh] if program == "CHOLMOD" else [mesh, coefficient]
    # longer than what the scripts themselves allow the programs that they start, so that none is left behind
    run = measured([python, HERE / script, *arguments], timeout_s=960)
    return json.loads(run.stdout.splitlines()[-1])


def limits():
    """What the frictionless problem has for vertical force and peak pressure when the mesh is refined.

    A program's error is its distance from its own limit, computed here on a mesh that is two to three times as fine
    near the contact as the largest that is compared, and for GetFEM with the same element: the programs measure the
    gap to the cylinder along slightly different lines, which differ in 1e-4 of the force, more than the errors of a
    fine mesh. This favours none of them. The two limits confirm each other as far as those lines do, and both the
    closed form of Hertz (`problem.hertz`). CalculiX reaches no limit by refinement, because of its penalty: its
    error is the distance from the mean of the two.
    """
    found = {"Signorini": solve("Signorini", "graded:2"), "GetFEM": solve("GetFEM", "graded:2")}
    both = [{key: limit[key] for key in ("vertical_force", "peak_pressure")} for limit in found.values()]
    found["CalculiX"] = {key: (both[0][key] + both[1][key]) / 2 for key in both[0]}
    return found


def error(result, limit, quantity):
    """The relative distance of a quantity from its limit."""
    return abs(result[quantity] / limit[quantity] - 1)


def cpu(result):
    """Seconds of processor time, of the program and of the system for it."""
    return result["user_s"] + result["system_s"]
