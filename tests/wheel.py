"""The wheel that has the program, on a bare Debian: no Rust, no compiler, no network.

    wheel.py [BINARY]    the binary: this one, that of SIGNORINI_BINARY, or target/release/signorini

`clients/python/wheel` makes the wheel. debootstrap makes a root of this machine's own release, with Python and nothing
else, in target/wheel-root: once, since it takes most of the time. In it pip installs the wheel, with what it depends on
from a folder; then its program and the client's first lines run, each with its time. Needs root, for debootstrap and to
enter the root, and Debian's debootstrap.
"""

import json
import os
import pathlib
import shutil
import subprocess
import sys
import time
import zipfile

TOP = pathlib.Path(__file__).resolve().parent.parent
KEPT = TOP / "target/wheel-root"
TOOLS = TOP / "target/python-wheel/bin/python"
# the folder in the root that this test writes to; the rest stays as debootstrap made it
TRIAL = "trial"
BARE = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
TOOLCHAIN = ("cc", "gcc", "clang", "tcc", "ld", "make", "cargo", "rustc")

# The first of the client's README, as far as NumPy and httpx go: the service draws the figure.
TEN_LINES = """
import signorini as sg

c = sg.Client.local("jobs")
p = sg.examples.rectangular_punch(rho=0.01)
job = c.submit(p, name="punch")
r = job.wait()
print(r.verdict, r.normal_force)
s = r.profile().tangential_stress
job.save_figure("punch.png", "profile")
r.save_vtu("punch.vtu")
"""
# What the lines leave behind, for the test to judge.
TOLD = """
import json
print(json.dumps({
    "verdict": r.verdict, "forces": [float(r.normal_force), float(r.tangential_force)], "peak": float(abs(s).max()),
    "program": sg.LocalServer().binary, "figure": open("punch.png", "rb").read(8).hex(), "body": open("punch.vtu", "rb").read(5).decode(),
}))
"""


def bare_root():
    """The folder with the root. A part of one, from a run that was interrupted, is made again."""
    release = dict(line.split("=", 1) for line in pathlib.Path("/etc/os-release").read_text().splitlines() if "=" in line)
    suite = release["VERSION_CODENAME"].strip('"')
    root = KEPT / suite
    if not root.exists():
        partial = KEPT / (suite + ".partial")
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        with open(KEPT / "debootstrap.log", "w") as log:
            command = ["debootstrap", "--variant=minbase", "--include=python3,python3-venv", suite, partial]
            if subprocess.run(command, stdout=log, stderr=subprocess.STDOUT).returncode:
                sys.exit("debootstrap failed: " + (KEPT / "debootstrap.log").read_text()[-2000:])
        partial.rename(root)
    return root


class Root:
    def __init__(self, folder):
        self.folder = folder

    def run(self, *command, path=BARE, code=0):
        """What the command printed. It sees its own /proc, and everything it started ends with it."""
        entered = ["unshare", "--mount", "--pid", "--fork", "--mount-proc", "--root=%s" % self.folder, "--wd=/" + TRIAL]
        environment = {"PATH": path, "HOME": "/" + TRIAL, "LANG": "C.UTF-8"}
        done = subprocess.run(entered + list(command), env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, timeout=120)
        if done.returncode != code:
            sys.exit("%s: exit code %d instead of %d\n%s" % (command, done.returncode, code, done.stdout))
        return done.stdout


class Times:
    """Runs and tells how long it took."""

    def __call__(self, what, function):
        began = time.monotonic()
        found = function()
        print("  %-46s %6.2f s" % (what, time.monotonic() - began), flush=True)
        return found


def licences(wheel):
    """The names of the licences in a wheel."""
    names = [pathlib.PurePath(name) for name in zipfile.ZipFile(wheel).namelist() if not name.endswith("/")]
    return sorted(name.name for name in names if name.parent.name == "licenses")


def wheels(binary, root, folder):
    """Makes both wheels, and fetches from outside what they depend on, as this root's Python wants it."""
    made = subprocess.run([TOP / "clients/python/wheel", binary], stdout=subprocess.PIPE, text=True, check=True).stdout.split()[-1]
    pure = folder / "pure"
    subprocess.run([TOOLS, "-m", "build", "--wheel", "--outdir", pure, TOP / "clients/python"], capture_output=True, check=True)
    version, machine, minor = root.run(
        "python3", "-c", "import platform as p; print('.'.join(p.python_version_tuple()[:2]), p.machine(), p.libc_ver()[1].split('.')[1])").split()
    platforms = ["--platform=manylinux_2_%d_%s" % (n, machine) for n in range(17, int(minor) + 1)]
    # pip refuses the wheel here already if its tag asks for a newer glibc than the root has
    subprocess.run([TOOLS, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--only-binary=:all:",
                    "--implementation=cp", "--python-version=" + version, *platforms, "--dest", folder / "all", made], check=True)
    (pure_wheel,) = pure.glob("*.whl")
    assert licences(pure_wheel) == ["LICENSE-APACHE", "LICENSE-MIT"], licences(pure_wheel)
    assert licences(made) == ["LICENSE-APACHE", "LICENSE-MIT", "LICENSES-PROGRAM.txt"], licences(made)
    shutil.copy(pure_wheel, folder)
    return pathlib.Path(made).name, pure_wheel.name


def the_program_works(root, times):
    path = "/%s/venv/bin:%s" % (TRIAL, BARE)
    version = times("signorini --version", lambda: root.run("signorini", "--version", path=path))
    assert version.startswith("signorini "), version
    demo = times("signorini demo", lambda: root.run("signorini", "demo", path=path))
    assert demo.strip(), "the demo prints nothing"
    print("    its last line: " + demo.strip().splitlines()[-1])
    # what the documentation runs from the folder of the sources
    command = "signorini examples files && cd files && signorini solve tests/data/abaqus/roller-cpe8.inp"
    solved = times("signorini examples, and a deck from there", lambda: root.run("sh", "-c", command, path=path))
    assert "normal force" in solved, solved


def the_client_finds_its_own_program(root, times):
    # another one comes first on the path, and is not the one that this environment brought
    decoy = root.folder / TRIAL / "elsewhere/signorini"
    decoy.parent.mkdir()
    decoy.write_text("#!/bin/sh\nexit 3\n")
    decoy.chmod(0o755)
    path = "/%s/elsewhere:%s" % (TRIAL, BARE)
    said = times("ten lines, by the environment's Python alone", lambda: root.run("/%s/venv/bin/python" % TRIAL, "-c", TEN_LINES + TOLD, path=path))
    told = json.loads(said.strip().splitlines()[-1])
    print("    %(verdict)s, forces %(forces)s" % told)
    assert told["verdict"] == "good", told
    assert abs(told["forces"][0] - 95.28) < 0.1, told
    assert all(isinstance(force, float) and force == force for force in told["forces"]) and 0 < told["peak"] < 1e9, told
    assert told["program"] == "/%s/venv/bin/signorini" % TRIAL, told
    assert told["figure"] == b"\x89PNG\r\n\x1a\n".hex() and told["body"] == "<?xml", told


def the_pure_wheel_says_what_to_do(root, times, wheel):
    python = "/%s/pure/bin/python" % TRIAL
    root.run("python3", "-m", "venv", "/%s/pure" % TRIAL)
    times("the pure wheel, installed", lambda: root.run(python, "-m", "pip", "install", "--no-index", "--find-links", "wheels/all", "wheels/" + wheel))
    said = times("its Client.local(), without a program", lambda: root.run(python, "-c", "import signorini as sg\nsg.Client.local()", code=1))
    last = said.strip().splitlines()[-1]
    print("    " + last)
    assert "SignoriniError: there is no program 'signorini'" in last, said
    assert all(way in last for way in ("manylinux", "SIGNORINI_BINARY", "PATH", "Client(")), said


def main():
    binary = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else os.environ.get("SIGNORINI_BINARY", TOP / "target/release/signorini")).absolute()
    if os.getuid() != 0 or not shutil.which("debootstrap"):
        sys.exit("wheel.py needs root, and Debian's debootstrap")
    times = Times()
    root = Root(times("a bare root", bare_root))
    trial = root.folder / TRIAL
    shutil.rmtree(trial, ignore_errors=True)
    folder = trial / "wheels"
    folder.mkdir(parents=True)
    found = root.run("sh", "-c", "for tool in %s; do command -v $tool; done; true" % " ".join(TOOLCHAIN))
    assert not found, "the root is not bare: " + found
    wheel, pure = times("both wheels, and what they depend on", lambda: wheels(binary, root, folder))
    size = (folder / "all" / wheel).stat().st_size
    print("    %s, %.1f MB" % (wheel, size / 1e6))
    times("python3 -m venv", lambda: root.run("python3", "-m", "venv", "venv"))
    times("pip install", lambda: root.run("venv/bin/pip", "install", "--no-index", "--find-links", "wheels/all", "wheels/all/" + wheel))
    the_program_works(root, times)
    the_client_finds_its_own_program(root, times)
    the_pure_wheel_says_what_to_do(root, times, pure)
    shutil.rmtree(trial)
    print("the wheel works on a bare root")


main()
