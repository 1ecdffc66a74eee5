"""Runs the commands of `table.py`, and keeps what they found.

    run.py [--soak] [--record] [--without-tools] [ROW ...]
    run.py --page

Each command ends with a line `figure: …`. With --record the figures and the date are written to figures.json, and
docs/reliability.md is written anew; tests/soak does that. Without it the page is only compared with what the table and
the recorded figures say. With --page it is written anew from them, and nothing is run. With --without-tools rows
that need other programs than a C compiler and Python are named, and not run.
"""

import datetime
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

from table import ROWS

HERE = pathlib.Path(__file__).resolve().parent
TOP = HERE.parent.parent
FIGURES = HERE / "figures.json"
PAGE = TOP / "docs/reliability.md"
# of every server that does not choose another
BUDGET_BYTES = 512 << 20
# what every server and bystander notes, for the figures and for peaks.py
NOTES = tempfile.NamedTemporaryFile()


def run(command):
    """Runs a command of the table: its figure, and why it failed if it did, which is the last line that it printed."""
    words = command.split()
    noted = {"PYTHONUNBUFFERED": "1", "SIGNORINI_NOTES": NOTES.name, "SIGNORINI_MEMORY_BUDGET_BYTES": str(BUDGET_BYTES)}
    before = os.stat(NOTES.name).st_size
    if words[0].endswith(".py"):
        words = [sys.executable, str(HERE / words[0]), *words[1:]]
    print("\n-- " + command, flush=True)
    began = time.monotonic()
    process = subprocess.Popen(words, cwd=TOP, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env={**os.environ, **noted})
    last = ""
    for line in process.stdout:
        print(line, end="", flush=True)
        last = line.strip() or last
    if process.wait() != 0:
        return "", last
    noted = measured(before)
    print("   %.0f s%s" % (time.monotonic() - began, noted))
    return last.removeprefix("figure: ") + noted, ""


def measured(before):
    """What the servers and bystanders of the last command noted, in words."""
    with open(NOTES.name, "rb") as file:
        file.seek(before)
        notes = [json.loads(line) for line in file]
    told = ""
    if peaks := [one["peak"] for one in notes if "peak" in one]:
        told += "; a server took at most %d MiB" % (max(peaks) >> 20)
    if times := [one["p99_s"] for one in notes if "p99_s" in one]:
        told += "; a bystander was answered within %.0f ms (p99)" % (1e3 * max(times))
    return told


def page(figures):
    """The page: a row for each promise."""
    lines = [
        "# Reliability",
        "",
        "What the service promises under faults and attacks, and the command that shows it. `tests/run` runs the small",
        "form of each (`tests/run --all` where it needs other programs); `tests/soak` the large one, by hand. Both are listed in",
        "`tests/reliability/table.py`, from which `tests/reliability/run.py` writes this page. Scripts lie in",
        "`tests/reliability`. *Before* is what an attack on an earlier version found.",
        "",
    ]
    for row in ROWS:
        small = "passes in `tests/run%s`" % (" --all" if row.needs else "")
        lines += ["## %s. %s" % (row.name, row.promise), ""]
        if row.before:
            lines += ["- Before: " + row.before]
        for command in dict.fromkeys([row.small, row.soak]):
            if command:
                found = figures.get(command)
                unrecorded = small if command == row.small else "**not run at this size yet**"
                figure = "%s (%s)" % (found["figure"], found["date"]) if found else unrecorded
                lines += ["- `%s`: %s" % (command, figure)]
        if row.missing:
            lines += ["- **Not shown:** " + row.missing]
        lines += [""]
    return "\n".join(lines)


def main():
    options = [word for word in sys.argv[1:] if word.startswith("--")]
    wanted = [word for word in sys.argv[1:] if not word.startswith("--")]
    rows = [row for row in ROWS if not wanted or row.name in wanted]
    if "--without-tools" in options:
        for row in rows:
            if row.needs:
                print("-- left to tests/run --all: %s, which needs %s" % (row.name, ", ".join(row.needs)), flush=True)
        rows = [row for row in rows if not row.needs]
    commands = dict.fromkeys(row.soak if "--soak" in options else row.small for row in rows)
    figures = json.loads(FIGURES.read_text(encoding="utf-8")) if FIGURES.exists() else {}
    failed = []
    for command in commands:
        if command and "--page" not in options:
            figure, why = run(command)
            if not figure:
                failed.append("%s: %s" % (command, why))
            elif "--record" in options:
                figures[command] = {"figure": figure, "date": datetime.date.today().isoformat()}
                FIGURES.write_text(json.dumps(figures, indent=1, ensure_ascii=False, sort_keys=True) + "\n", encoding="utf-8")
    if "--record" in options or "--page" in options:
        PAGE.write_text(page(figures), encoding="utf-8")
    elif PAGE.read_text(encoding="utf-8") != page(figures):
        failed.append("docs/reliability.md, which is not what the table and the recorded figures say: run.py --page writes it")
    if failed:
        sys.exit("failed: " + "; ".join(failed))


if __name__ == "__main__":
    main()
