"""Runs a program to its end and tells what it used, by the count of the system: for benches and comparisons."""

import dataclasses
import os
import subprocess
import sys
import tempfile
import time

# Libraries that would use several threads are held to one: what is compared is CPU time.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "CCX_NPROC_STIFFNESS": "1"}


@dataclasses.dataclass(frozen=True)
class Run:
    """What a program printed, the seconds of processor time and of the clock, page faults that needed no disk, and
    the most memory that it held at once."""

    stdout: str
    user_s: float
    system_s: float
    wall_s: float
    faults: int
    peak_bytes: int


def measured(command, cwd=None, allowed=(0,)):
    """Runs a command; ends this program if its exit code is not one of `allowed`."""
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        began = time.monotonic()
        process = subprocess.Popen(
            list(map(str, command)), cwd=cwd, env={**os.environ, **ONE_THREAD}, stdout=out, stderr=err)
        # not process.wait(): only wait4 tells what this one child used
        _, status, used = os.wait4(process.pid, 0)
        wall = time.monotonic() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        err.seek(0)
        printed = out.read()
        if process.returncode not in allowed:
            sys.exit("%s ended with %d\n%s\n%s" % (command[:3], process.returncode, printed[-2000:], err.read()[-2000:]))
    return Run(printed, used.ru_utime, used.ru_stime, wall, used.ru_minflt, used.ru_maxrss * 1024)
