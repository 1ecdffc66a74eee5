"""Hostile inputs for every reader, in as many processes as it may use processors (R27).

    fuzz.py [--soak HOURS]

Runs the fuzz targets among the unit tests and in tests/fuzz for some seconds each, with --soak for HOURS of processor
time in all, on inputs that follow from a new seed each time. What answers in a new way is
kept in target/fuzz-corpus for the next run. A panic, an input that takes seconds and one that takes memory out of
proportion are failures; their input is left in target/fuzz.
"""

import json
import os
import re
import subprocess
import sys
import time

from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from outside import TOP, check

TARGETS = {
    "fuzz": ["changed_gmsh_files", "changed_decks", "changed_inline_meshes", "changed_problems"],
    "web": ["changed_filters", "changed_headers", "changed_bodies"],
    "rpc": ["changed_messages"],
    "service": ["changed_tokens"],
}
SOAK = "--soak" in sys.argv
HOURS = float(sys.argv[2]) if SOAK else 0.0
# the decks are attacked twice, as a mesh and as a whole problem
RUNS = sum(len(names) for names in TARGETS.values()) + 1
SECONDS = int(HOURS * 3600 / RUNS) if SOAK else 1
CORPUS = TOP / "target" / "fuzz-corpus"


def programs():
    """The test programs by name; Cargo builds them if they are not there."""
    command = ["cargo", "test", "--release", "--workspace", "--no-run", "--message-format", "json"]
    command += ["--lib", "--test", "fuzz"]
    built = subprocess.run(command, cwd=TOP, stdout=subprocess.PIPE, check=True)
    found = {}
    for line in built.stdout.splitlines():
        message = json.loads(line)
        if message.get("executable") and message["profile"]["test"]:
            found[message["target"]["name"]] = message["executable"]
    return found


def main():
    seed = time.time_ns() % (1 << 32)
    print("seed %d" % seed, flush=True)
    found = programs()
    # those of the server find their files from the folder of their crate, as under Cargo
    work = [(found[program], TOP / ("tests" if program == "fuzz" else "server/" + program), name)
            for program, names in TARGETS.items() for name in names]
    environment = dict(os.environ, SIGNORINI_FUZZ_SECONDS=str(SECONDS), SIGNORINI_FUZZ_SEED=str(seed),
                       SIGNORINI_FUZZ_CORPUS=str(CORPUS))
    running, lines, failed = [], [], []

    def collect(process, name):
        output = process.communicate()[0].decode(errors="replace")
        told = re.finditer(r"fuzz ([\w-]+): (\d+) executions in (\d+) s, corpus (\d+), .*", output)
        for line in told:
            lines.append(line.groups())
            print(line.group(), flush=True)
        if process.returncode != 0 or " 1 passed" not in output:
            failed.append("%s:\n%s" % (name, output[-3000:]))

    for program, folder, name in work:
        if len(running) >= len(os.sched_getaffinity(0)):
            collect(*running.pop(0))
        command = [program, name, "--nocapture", "--test-threads=1"]
        process = subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        running.append((process, name))
    for one in running:
        collect(*one)
    check(not failed, "\n".join(failed))
    check(len(lines) == RUNS, "%d of %d targets told what they did" % (len(lines), RUNS))
    executions = sum(int(line[1]) for line in lines)
    hours = sum(int(line[2]) for line in lines) / 3600
    corpus = sum(int(line[3]) for line in lines)
    size = sum(path.stat().st_size for path in CORPUS.rglob("*") if path.is_file())
    print("figure: %d executions on %d targets in %.2f processor hours, no panic, none longer than 2 s; corpus of %d "
          "inputs, %.1f MiB" % (executions, RUNS, hours, corpus, size / (1 << 20)))


main()
