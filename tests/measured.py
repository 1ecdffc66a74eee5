"""Runs a program to its end and tells what it used, by the count of the system: for benches and comparisons."""

import dataclasses
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
import typing

# Libraries that would use several threads are held to one: what is compared is CPU time.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "CCX_NPROC_STIFFNESS": "1"}


@dataclasses.dataclass(frozen=True)
class Run:
    """What a program printed, its seconds of processor time, its own and the system's for it, and the most memory that
    it held at once (None: see `peak_bytes`)."""

    stdout: str
    user_s: float
    system_s: float
    peak_bytes: typing.Optional[int]


def peak_bytes(used):
    """The most memory that a program held, of what wait4 tells of it.

    A process begins with the peak of the one that started it. Where that is not smaller, nothing is known, and
    the answer is None.
    """
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return used.ru_maxrss * 1024 if used.ru_maxrss > own else None


def measured(command, cwd=None, timeout_s=900):
    """Runs a command, and kills it after `timeout_s`; ends this program if it does not succeed."""
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        began = time.monotonic()
        try:
            process = subprocess.Popen(
                list(map(str, command)), cwd=cwd, env={**os.environ, **ONE_THREAD}, stdout=out, stderr=err)
        except OSError as error:
            sys.exit("%s cannot be started: %s" % (command[0], error.strerror))
        alarm = threading.Timer(timeout_s, process.kill)
        alarm.daemon = True  # it must not keep this program when that is interrupted
        alarm.start()
        # not process.wait(): only wait4 tells what this one child used
        _, status, used = os.wait4(process.pid, 0)
        alarm.cancel()
        wall = time.monotonic() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        err.seek(0)
        printed = out.read()
        if process.returncode != 0:
            sys.exit("%s ended with %d after %.0f s\n%s\n%s" % (
                " ".join(map(str, command)), process.returncode, wall, printed[-2000:], err.read()[-2000:]))
    return Run(printed, used.ru_utime, used.ru_stime, peak_bytes(used))
