"""Runs the README's own commands against a fresh server: what a reader copies must work.

Blocks of `sh` and `python` after a line `<!-- run -->` are run from the top of the repository, in
order, while the command after `<!-- serve -->` runs beside them (in a store of its own, on a free
port if 8080 is taken).
"""

import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile

TOP = pathlib.Path(__file__).resolve().parent.parent
# a document of an error, a job or a member that failed; "failed": 0 counts members
WRONG = re.compile(r'"status": ?[45]|not_converged|: ?"failed"|"failed": ?[1-9]')
BLOCK = re.compile(r"<!-- (run|serve) -->\n```(\w+)\n(.*?)```", re.DOTALL)


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


def main():
    blocks = BLOCK.findall((TOP / "README.md").read_text(encoding="utf-8"))
    serve = [code for kind, _, code in blocks if kind == "serve"]
    runs = [(language, code) for kind, language, code in blocks if kind == "run"]
    if len(serve) != 1 or len(runs) < 5:
        sys.exit("README.md has lost its marked commands: found %d and %d" % (len(serve), len(runs)))
    address = free_address()
    with tempfile.TemporaryDirectory() as data:
        # a proxy must not be used between two processes of this machine
        os.environ.update(NO_PROXY="127.0.0.1", no_proxy="127.0.0.1")
        environment = dict(os.environ, SIGNORINI_LISTEN=address, SIGNORINI_DATA=data)
        server = subprocess.Popen(
            ["bash", "-c", "exec " + serve[0].strip()], cwd=TOP, env=environment, stdout=subprocess.PIPE, text=True
        )
        try:
            url = server.stdout.readline().strip()
            if url != "http://" + address:
                sys.exit("serve printed %r, not http://%s" % (url, address))
            for language, code in runs:
                code = code.replace("127.0.0.1:8080", address)
                command = {"sh": ["bash", "-euo", "pipefail", "-c"], "python": [sys.executable, "-c"]}[language]
                print("--- %s: %s" % (language, code.strip().splitlines()[0]), flush=True)
                done = subprocess.run(command + [code], cwd=TOP, capture_output=True, text=True, timeout=300)
                print(done.stdout[-1500:], flush=True)
                # curl and python do not fail for a failed job or an error document
                wrong = WRONG.findall(done.stdout)
                if done.returncode != 0 or wrong or not (done.stdout or done.stderr):
                    sys.exit("this command of the README failed (%s, %s):\n%s%s" % (done.returncode, wrong, code, done.stderr))
        finally:
            server.send_signal(signal.SIGTERM)
            code = server.wait(timeout=30)
        if code != 0:
            sys.exit("the server ended with %d" % code)
    print("%d commands of the README work" % len(runs))


main()
