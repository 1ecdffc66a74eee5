"""The R script of examples/ against a service: what it prints is what the service has, and what the service refuses it says."""

import os
import pathlib
import re
import subprocess
import sys
import tempfile

TOP = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(TOP / "tests"))

from outside import Server, check, equal


def main():
    with Server() as server, tempfile.TemporaryDirectory() as folder:
        figure = pathlib.Path(folder) / "punch.pdf"

        def run(problem, boundary):
            command = ["Rscript", TOP / "examples/punch.R", problem, boundary, figure]
            environment = {**os.environ, "SIGNORINI_URL": server.url}
            return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=120)

        done = run(TOP / "examples/rectangular_punch.json", "top")
        equal(done.returncode, 0, "punch.R, %r" % done)
        printed = re.fullmatch(r"(job_\S+): (\d+) points; largest tangential stress (\S+) at s = (\S+) \((\w+)\)\n", done.stdout)
        check(printed, "punch.R printed %r" % done.stdout)
        profile = server.json("/v1/jobs/%s/profiles/top" % printed[1])
        stress = profile["tangential_stress"]
        at = max(range(len(stress)), key=lambda i: abs(stress[i]))
        equal(int(printed[2]), len(stress), "points")
        equal(tuple(printed.group(3, 4)), ("%.6g" % stress[at], "%.6g" % profile["s"][at]), "the largest stress and its place")
        equal(printed[5], profile["state"][at], "its state")
        check(figure.read_bytes().startswith(b"%PDF-"), "punch.R drew no figure")
        print(done.stdout, end="")

        none = run(TOP / "examples/rectangular_punch.json", "left")
        check(none.returncode != 0 and "it has: top" in none.stderr, "a boundary without contact, %r" % none)
        broken = pathlib.Path(folder) / "broken.json"
        broken.write_text('{"mesh": {}}')
        refused = run(broken, "top")
        check(refused.returncode != 0 and "/problem/" in refused.stderr, "a problem that is none, %r" % refused)


if __name__ == "__main__":
    main()
