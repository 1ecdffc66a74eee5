"""Compares the time that jobs are estimated to take with the processor time that they take.

    estimates.py

Grids of even and uneven lines, short and long contacts, few and many load steps. `cargo build --release` comes first.
"""

import json
import pathlib
import sys
import tempfile

TESTS = pathlib.Path(__file__).resolve().parent.parent
sys.path[:0] = [str(TESTS), str(TESTS / "peers")]

import problem as block

from measured import measured
from outside import BINARY, Server, equal, long_contact, talkative

CASES = {
    "punch, 56 elements": talkative(1),
    "punch, refine 3": talkative(1, refine=3),
    "punch, refine 5": talkative(1, refine=5),
    "punch, refine 2, 400 load steps": talkative(400, refine=2),
    "punch, refine 3, 3,000 load steps": talkative(3000, refine=3),
    "punch, refine 4, 3,000 load steps": talkative(3000, refine=4),
    "punch, refine 5, 1,000 load steps": talkative(1000, refine=5),
    "all of 150 elements touch": long_contact(150),
    "all of 500 elements touch": long_contact(500),
    "all of 1,000 elements touch": long_contact(1000),
    "even grid of 20,000 unknowns": block.problem(block.mesh("2e4"), 0.3),
    "even grid of 200,000 unknowns": block.problem(block.mesh("2e5"), 0.3),
    "even grid of 1,000,000 unknowns": block.problem(block.mesh("1e6"), 0.3),
}


def main():
    print("| problem | estimated (s) | taken (CPU s) | ratio |\n|---|---|---|---|")
    with Server() as server, tempfile.TemporaryDirectory() as folder:
        file, out = pathlib.Path(folder) / "problem.json", pathlib.Path(folder) / "problem.summary.json"
        for name, problem in CASES.items():
            answer = server.call("POST", "/v1/problems/validate", {"problem": problem})
            equal(answer.status, 200, name)
            estimated = answer.json()["estimate"]["run_s"]
            file.write_text(json.dumps(problem))
            run = measured([BINARY, "solve", file, "-o", out])
            taken = run.user_s + run.system_s
            print("| %s | %.3f | %.3f | %.2f |" % (name, estimated, taken, estimated / taken), flush=True)


main()
