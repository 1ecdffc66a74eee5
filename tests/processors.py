"""The same problems on other processors: the results have the same bits on every x86-64 processor with AVX2 and FMA, however wide
its vectors are, so that it does not matter where a job is solved.

    processors.py SIGNORINI

Debian's qemu-user is such a processor. On one without FMA products are rounded before they are added: there the digests differ,
and the numbers agree within the errors that are stated with them.
"""

import concurrent.futures
import json
import pathlib
import subprocess
import sys
import tempfile
import time

TOP = pathlib.Path(__file__).resolve().parent.parent
#: Processors with AVX2 and FMA and without AVX-512: of both makers, and of another generation.
SAME = ["Haswell-noTSX", "EPYC", "EPYC-Rome"]
#: A processor with neither.
OTHER = "Nehalem"
#: Dense and sparse fronts, curves, two bodies, measured obstacles, adaptive and given meshes, load steps, no friction, revolution.
PROBLEMS = ["examples/sheet.json", "examples/rectangular_punch.json", "examples/cylinder_on_end.json", "examples/press_fit.json",
            "examples/roller_on_block.json", "docs/gallery/fretting.json", "docs/gallery/measured.json", "docs/gallery/hertz.json"]


def solved(folder, binary, problem, processor=None, threads=2):
    """The summary of a problem that is solved here, or on another processor."""
    path = folder / ("%s-%s-%d.summary.json" % (pathlib.Path(problem).stem, processor, threads))
    command = [binary, "solve", TOP / problem, "--threads", str(threads), "-o", path]
    if processor:
        command = ["qemu-x86_64", "-cpu", processor, *command]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240)
    if done.returncode:
        sys.exit("%s on %s: %s" % (problem, processor or "this processor", done.stderr[-2000:]))
    return json.loads(path.read_text())


def check(folder, binary, problem):
    here = solved(folder, binary, problem)
    for processor, threads in [(None, 1)] + [(other, 2) for other in SAME]:
        there = solved(folder, binary, problem, processor, threads)
        if there["digest"] != here["digest"]:
            sys.exit("%s: another digest on %s with %d threads" % (problem, processor or "this processor", threads))
    there = solved(folder, binary, problem, OTHER)
    for ours, theirs in zip(here["accuracy"]["quantities"], there["accuracy"]["quantities"], strict=True):
        both = (ours["value"], theirs["value"])
        if ours["method"] != "no_limit" and abs(both[0] - both[1]) > ours["error"] + 1e-9 * abs(both[0]):
            sys.exit("%s: %s is %.9g here and %.9g on a processor without FMA, ± %.2g" % (problem, ours["quantity"], *both, ours["error"]))
    return there["digest"] != here["digest"]


def main():
    binary = pathlib.Path(sys.argv[1]).resolve()
    began = time.monotonic()
    flags = pathlib.Path("/proc/cpuinfo").read_text()
    if not all(" %s " % flag in flags for flag in ("avx2", "fma")):
        sys.exit("this processor has no AVX2 or no FMA: its results are those of no other kind")
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(2) as both:
        differ = sum(both.map(lambda problem: check(pathlib.Path(folder), binary, problem), PROBLEMS))
    print("processors: %d problems have the same digest here, on one thread and on %s; on %s, without FMA, %d have another, and their numbers agree, in %.0f s"
          % (len(PROBLEMS), ", ".join(SAME), OTHER, differ, time.monotonic() - began))


main()
