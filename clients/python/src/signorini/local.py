"""A service of one's own: the binary, started and stopped by this program."""

from __future__ import annotations

import atexit
import contextlib
import importlib.metadata
import os
import pathlib
import shutil
import signal
import subprocess
import sysconfig
import tempfile
from collections.abc import Iterator, Sequence

from .errors import SignoriniError

STOP_S = 10.0


class LocalServer:
    """A service on this machine.

    data: folder of its store; None: a temporary one, removed at the end
    listen: address and port; port 0 is a free one
    """

    def __init__(
        self,
        data: str | os.PathLike[str] | None = None,
        *,
        binary: str | os.PathLike[str] | None = None,
        listen: str = "127.0.0.1:0",
        workers: int | None = None,
        options: Sequence[str] = (),
    ) -> None:
        self.binary = find_binary(binary)
        self.temporary = data is None
        self._starter = os.getpid()
        self.url = ""
        self._own = pathlib.Path(tempfile.mkdtemp(prefix="signorini-"))
        self.data = self._own / "data" if data is None else pathlib.Path(data)
        self.log = self._own / "log"
        self._listen = listen
        self._options = [*(["--workers", str(workers)] if workers else []), *options]
        self._process: subprocess.Popen[str] | None = None

    def start(self) -> str:
        """Starts it, and returns its address once it answers. Raises `SignoriniError` with what it said."""
        command = [self.binary, "serve", "--listen", self._listen, "--data", str(self.data), *self._options]
        with open(self.log, "ab") as log:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
                # Ctrl-C in the terminal is for this program; the service is stopped when the program ends
                start_new_session=True,
            )
        assert self._process.stdout is not None
        line = self._process.stdout.readline().strip()
        if not line.startswith("http"):
            self._process.kill()
            code = self._process.wait()
            said = self.log.read_text(encoding="utf-8", errors="replace").strip()[-2000:]
            self._clean()
            raise SignoriniError(f"the service did not start (exit code {code}):\n{line}\n{said}")
        self.url = line
        # after a restart the same address is asked for
        self._listen = line.split("://")[1]
        atexit.register(self.stop)
        return line

    def kill(self) -> None:
        """Kills the service as a power cut would, for tests; `start()` restarts it with the same store and address."""
        assert self._process is not None
        self._process.kill()
        self._reap()
        atexit.unregister(self.stop)

    def stop(self) -> None:
        """Stops it; running jobs go on after the next start, if its folder is kept. In a process that was forked this
        does nothing: the service is that of its parent."""
        if self._starter != os.getpid():
            return
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)
            try:
                self._process.wait(STOP_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
        self._reap()
        atexit.unregister(self.stop)
        self._clean()

    def _reap(self) -> None:
        if self._process is not None:
            self._process.wait()
            if self._process.stdout is not None:
                self._process.stdout.close()

    def _clean(self) -> None:
        with contextlib.suppress(OSError):
            shutil.rmtree(self._own)


def find_binary(given: str | os.PathLike[str] | None = None) -> str:
    """The program, the first of: what is given, SIGNORINI_BINARY, the `signorini` that was installed with this package
    or is beside this Python (whether or not the environment is activated), `signorini` in PATH."""
    wanted = os.fspath(given) if given is not None else os.environ.get("SIGNORINI_BINARY")
    for candidate in [wanted] if wanted else [*_of_environment(), "signorini"]:
        if found := shutil.which(candidate):
            return found
    if wanted:
        raise SignoriniError(
            f"there is no program {wanted!r}: set SIGNORINI_BINARY to the binary of signorini, or put it in PATH"
        )
    raise SignoriniError(
        "there is no program 'signorini': this installation has the client alone. Install the wheel that has both "
        "(with manylinux in its name, not none-any), set SIGNORINI_BINARY to the binary of signorini, put it in PATH, "
        'or use a service that runs elsewhere: Client("http://…")'
    )


def _of_environment() -> Iterator[str]:
    """Where pip put the program of this package: as it has noted, or, after `--target`, beside it; then where it puts
    programs."""
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        for file in importlib.metadata.files("signorini") or []:
            if file.name == "signorini" and file.parent.name == "bin":
                yield os.path.normpath(file.locate())
    yield str(pathlib.Path(__file__).parents[1] / "bin/signorini")
    yield os.path.join(sysconfig.get_path("scripts"), "signorini")
