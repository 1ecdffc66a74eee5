"""Runs the documentation's own commands against a fresh server: what a reader copies must work.

Pages are README.md, docs/tutorial.md, docs/gallery.md, docs/cli.md and docs/how-to/*.md, in this order. On each, blocks of `sh` and
`python` after a line `<!-- run -->` are run from the top of the repository, in order, while the command after README's
`<!-- serve -->` runs beside them (in a store of its own, on a free port if 8080 is taken). A block after a line
`<!-- prints -->` must be what the block before it printed. `tests/readme.py --write` puts there what was printed.

Names of pages select them: `tests/readme.py docs/gallery.md`.
"""

import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time

TOP = pathlib.Path(__file__).resolve().parent.parent
# a document of an error, a job or a member that failed; "failed": 0 counts members
WRONG = re.compile(r'"status": ?[45]|not_converged|: ?"failed"|"failed": ?[1-9]')
BLOCK = re.compile(r"^<!-- (run|serve|prints) -->\n```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
MARK = re.compile(r"^\s*<!-- *(run|serve|prints)\b", re.MULTILINE)


def pages():
    docs = TOP / "docs"
    return [TOP / "README.md", docs / "tutorial.md", docs / "gallery.md", docs / "cli.md", *sorted((docs / "how-to").glob("*.md"))]


def blocks_of(page):
    """The marked blocks of a page; a mark that marks nothing is an error."""
    text = page.read_text(encoding="utf-8")
    blocks = list(BLOCK.finditer(text))
    if len(blocks) != len(MARK.findall(text)):
        sys.exit("%s: a mark has no block below it" % page.relative_to(TOP))
    return text, blocks


def free_address():
    """127.0.0.1:8080, as in the README, or a free port if that one is in use."""
    for port in (8080, 0):
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", port))
                return "127.0.0.1:%d" % probe.getsockname()[1]
            except OSError:
                continue
    sys.exit("no port is free")


def run(page, language, code, address):
    """What a block prints."""
    code = code.replace("127.0.0.1:8080", address)
    command = {"sh": ["bash", "-euo", "pipefail", "-c"], "python": [sys.executable, "-c"]}[language]
    start = time.monotonic()
    done = subprocess.run(command + [code], cwd=TOP, capture_output=True, text=True, timeout=300)
    print("--- %.1f s, %s: %s" % (time.monotonic() - start, language, code.strip().splitlines()[0]), flush=True)
    print(done.stdout[-1500:], flush=True)
    # curl and python do not fail for a failed job or an error document
    wrong = WRONG.findall(done.stdout)
    if done.returncode != 0 or wrong:
        sys.exit("this command of %s failed (%s, %s):\n%s%s" % (page, done.returncode, wrong, code, done.stderr))
    return done.stdout


def check(page, address, write):
    """Runs the blocks of a page; the number of those that ran."""
    name = page.relative_to(TOP)
    print("=== %s" % name, flush=True)
    text, blocks = blocks_of(page)
    printed, ran, pieces, end = None, 0, [], 0
    for block in blocks:
        kind, language, content = block.groups()
        if kind == "run":
            printed = run(name, language, content, address)
            ran += 1
        elif kind == "prints":
            if printed is None:
                sys.exit("%s: a block says what is printed, but nothing was run before it" % name)
            # lines end in blanks where columns are empty, which editors remove
            said = "".join(line.rstrip() + "\n" for line in printed.replace(address, "127.0.0.1:8080").splitlines())
            if write:
                pieces += [text[end : block.start(3)], said]
                end = block.end(3)
            elif said != content:
                sys.exit("%s says that this is printed:\n%s\nbut it is:\n%s" % (name, content, said))
            printed = None
    if write and pieces:
        page.write_text("".join(pieces) + text[end:], encoding="utf-8")
    return ran


def main():
    write = "--write" in sys.argv[1:]
    wanted = [(TOP / name).resolve() for name in sys.argv[1:] if name != "--write"]
    every = pages()
    serve = [block[3] for page in every for block in blocks_of(page)[1] if block[1] == "serve"]
    counts = {page: sum(block[1] == "run" for block in blocks_of(page)[1]) for page in every}
    if len(serve) != 1 or counts[TOP / "README.md"] < 3 or sum(counts.values()) < 30:
        sys.exit("the pages have lost their marked commands: found %d and %s" % (len(serve), list(counts.values())))
    address = free_address()
    with tempfile.TemporaryDirectory() as data:
        # a proxy must not be used between two processes of this machine
        os.environ.update(NO_PROXY="127.0.0.1", no_proxy="127.0.0.1", SIGNORINI_URL="http://" + address)
        # as README.md leaves the reader: the program in PATH, the client installed
        os.environ["PATH"] = "%s:%s" % (TOP / "target/release", os.environ["PATH"])
        os.environ["PYTHONPATH"] = str(TOP / "clients/python/src")
        environment = dict(os.environ, SIGNORINI_LISTEN=address, SIGNORINI_DATA=data, SIGNORINI_LOG="warn")
        server = subprocess.Popen(
            ["bash", "-c", "exec " + serve[0].strip()], cwd=TOP, env=environment, stdout=subprocess.PIPE, text=True
        )
        try:
            url = server.stdout.readline().strip()
            if url != "http://" + address:
                sys.exit("serve printed %r, not http://%s" % (url, address))
            start = time.monotonic()
            ran = sum(check(page, address, write) for page in every if page in wanted or not wanted)
        finally:
            server.send_signal(signal.SIGTERM)
            code = server.wait(timeout=30)
        if code != 0:
            sys.exit("the server ended with %d" % code)
    print("%d commands of the documentation work, in %.0f s" % (ran, time.monotonic() - start))


main()
