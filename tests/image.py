"""The container image: built with buildah from the Dockerfile, without a registry or a daemon, and run. By hand, as root.

    image.py FOLDER [--binary FILE]

FOLDER keeps what is made, on a disk with 10 GB: the base images, which debootstrap makes once, the layers, the image. The
builder image is the base with this machine's Rust toolchain and its Cargo registry. With --binary, `cargo` in the builder
image is a stand-in that gives out this file: everything but the compilation is tried. Prints the sizes, the time until the
service answers, and until the health check agrees. Needs Debian's buildah and debootstrap.
"""

import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.request

TOP = pathlib.Path(__file__).resolve().parent.parent
BASE, BUILDER, IMAGE = "localhost/signorini-base", "localhost/signorini-builder", "localhost/signorini:test"
PATH = "/usr/local/cargo/bin:/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
MOST_ON_TOP = 60 << 20
# the user as a number, without which Kubernetes cannot tell that it is not root
USER = "999:999"
VERSION = "0.0.1-image-test"


class Buildah:
    def __init__(self, folder):
        self.options = ["--root", folder / "store", "--runroot", folder / "run", "--storage-driver", "vfs"]
        self.environment = {**os.environ, "TMPDIR": str(folder / "tmp")}
        (folder / "tmp").mkdir(parents=True, exist_ok=True)

    def command(self, name, *words):
        return ["buildah", *self.options, name, *words]

    def __call__(self, name, *words):
        done = subprocess.run(self.command(name, *words), env=self.environment, stdout=subprocess.PIPE, text=True)
        if done.returncode:
            sys.exit("buildah %s %s: exit code %d" % (name, words, done.returncode))
        return done.stdout.strip()

    def has(self, image):
        return subprocess.run(self.command("inspect", "--type", "image", image), env=self.environment, capture_output=True).returncode == 0

    def size(self, image):
        """Bytes of all files, as they are when it runs."""
        container = self("from", "--pull-never", image)
        root = pathlib.Path(self("mount", container))
        size = sum(path.lstat().st_size for path in root.rglob("*") if path.is_file() and not path.is_symlink())
        self("umount", container)
        self("rm", container)
        return size


def base(buildah, folder):
    if buildah.has(BASE):
        return
    rootfs = folder / "rootfs"
    if not (rootfs / "bin").exists():
        subprocess.run(["debootstrap", "--variant=minbase", "--include=ca-certificates", "bookworm", rootfs], check=True)
    container = buildah("from", "scratch")
    buildah("add", "-q", container, rootfs, "/")
    buildah("config", "--cmd", "bash", "--env", "PATH=" + PATH, container)
    buildah("commit", "-q", "--rm", container, BASE)


def builder(buildah, folder, binary):
    """The base with what compiles: the compiler of C as a package, Rust and the registry as they are here."""
    if buildah.has(BUILDER):
        buildah("rmi", BUILDER)
    container = buildah("from", "--pull-never", BASE)
    if binary:
        stand_in = folder / "cargo"
        stand_in.write_text("#!/bin/sh\nmkdir -p target/release && cp /prebuilt target/release/signorini\n")
        stand_in.chmod(0o755)
        (folder / "strip").write_text("#!/bin/sh\nexit 0\n")
        (folder / "strip").chmod(0o755)
        stripped = folder / "prebuilt"
        subprocess.run(["strip", "-o", stripped, binary], check=True)
        for source, place in ((stand_in, "/usr/local/bin/cargo"), (folder / "strip", "/usr/local/bin/strip"),
                              (folder / "strip", "/usr/local/bin/cc"), (stripped, "/prebuilt")):
            buildah("add", "-q", container, source, place)
    else:
        sysroot = pathlib.Path(subprocess.run(["rustc", "--print", "sysroot"], cwd=TOP, capture_output=True, text=True, check=True).stdout.strip())
        home = pathlib.Path(os.environ.get("CARGO_HOME", pathlib.Path.home() / ".cargo"))
        kept = folder / "toolchain"
        shutil.rmtree(kept, ignore_errors=True)
        shutil.copytree(sysroot, kept, symlinks=True, ignore=shutil.ignore_patterns("doc", "man"))
        buildah("add", "-q", container, kept, "/usr/local/rust")
        # not where the Dockerfile mounts a cache, which would hide it
        buildah("add", "-q", container, home / "registry", "/opt/cargo/registry")
        buildah("run", "--isolation", "chroot", container, "--", "sh", "-c",
                "apt-get update -q && apt-get install -y -q --no-install-recommends gcc libc6-dev binutils")
        buildah("config", "--env", "CARGO_HOME=/opt/cargo", "--env", "PATH=/usr/local/rust/bin:" + PATH, container)
    buildah("commit", "-q", "--rm", container, BUILDER)


def run(buildah):
    """Starts the service as the image says; seconds until it answers, and whether its health check agrees."""
    found = json.loads(buildah("inspect", "--type", "image", IMAGE))["Docker"]["config"]
    assert found["User"] == USER, found
    labels = {name.removeprefix("org.opencontainers.image."): text for name, text in found["Labels"].items()}
    assert labels["title"] == "Signorini" and labels["version"] == VERSION and labels["licenses"] == "MIT OR Apache-2.0", labels
    assert found["Healthcheck"]["Test"] == ["CMD", "signorini", "health"], found
    container = buildah("from", "--pull-never", IMAGE)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = "127.0.0.1:%d" % free.getsockname()[1]
    # a container of `buildah run` has the network of this machine
    command = [*found["Entrypoint"], *found["Cmd"]]
    program = buildah.command("run", "--isolation", "chroot", "--env", "SIGNORINI_LISTEN=" + address, container, "--")
    began = time.monotonic()
    process = subprocess.Popen([*program, *command], env=buildah.environment, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline().strip() == "http://" + address
        with urllib.request.urlopen("http://%s/readyz" % address) as answer:
            assert answer.read() == b"ok\n"
        took = time.monotonic() - began
        healthy = subprocess.run([*program, *found["Healthcheck"]["Test"][1:]], env=buildah.environment, stdout=subprocess.PIPE, text=True)
        assert (healthy.returncode, healthy.stdout) == (0, "ok\n"), healthy
        whoami = subprocess.run([*program, "id", "-un"], env=buildah.environment, stdout=subprocess.PIPE, text=True).stdout.strip()
        assert whoami == "signorini", whoami
    finally:
        for pid in services(address):
            os.kill(pid, signal.SIGTERM)
        process.wait(timeout=30)
    assert process.returncode == 0, process.returncode
    sick = subprocess.run([*program, *found["Healthcheck"]["Test"][1:]], env=buildah.environment, capture_output=True, text=True)
    assert sick.returncode == 1 and "does not answer" in sick.stderr, sick
    buildah("rm", container)
    return took


def services(address):
    """The process that we started: the one that listens at this address by its environment."""
    for place in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            words = (place / "cmdline").read_bytes().split(b"\0")
            if words[0].endswith(b"/signorini") and words[1:2] == [b"serve"] and b"SIGNORINI_LISTEN=" + address.encode() in (place / "environ").read_bytes().split(b"\0"):
                yield int(place.name)
        except OSError:
            pass


def main():
    folder = pathlib.Path(sys.argv[1]).absolute()
    binary = sys.argv[3] if sys.argv[2:3] == ["--binary"] else None
    for tool in ("buildah", "debootstrap"):
        if not shutil.which(tool):
            sys.exit("%s is missing (Debian's %s)" % (tool, tool))
    buildah = Buildah(folder)
    base(buildah, folder)
    builder(buildah, folder, binary)
    began = time.monotonic()
    buildah("bud", "--isolation", "chroot", "--pull-never", "--format", "docker", "--build-arg", "BUILDER=" + BUILDER,
            "--build-arg", "BASE=" + BASE, "--build-arg", "VERSION=" + VERSION, "-t", IMAGE, str(TOP))
    took = time.monotonic() - began
    on_top = buildah.size(IMAGE) - buildah.size(BASE)
    ready = run(buildah)
    assert on_top <= MOST_ON_TOP, on_top
    print("image built in %.0f s%s: %.1f MB on top of its base; answers %.2f s after its start" % (
        took, " with a binary that was there" if binary else "", on_top / 1e6, ready))


main()
