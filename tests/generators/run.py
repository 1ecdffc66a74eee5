"""Generates clients from /openapi.json with the generators that people use, and lets each run a small study.

    tests/generators/run.py [NAME ...]      openapi-python-client, openapi-generator (Python, TypeScript),
                                            openapi-typescript; by default all of these

progenitor, for Rust, is not among them: version 0.15 panics where the answers of success are not of one type (200 with data and 206
with a part of the file, of ListIterations, GetProfile, StreamResult, ListSweepMembers and GetJobTable; 200 with events and 204 without,
of WatchJob and WatchSweep), and where a body has two media types (UpdateJob). To leave these out of the description would hide
answers that all other clients get.

Every client solves one problem for three coefficients of friction, and must find the forces that a plain request finds, to the
last bit. The generators come from pip and npm, to target/generators.
"""

# Operations: GetOpenApi

import json
import os
import pathlib
import shutil
import subprocess
import sys
import urllib.request

HERE = pathlib.Path(__file__).resolve().parent
TOP = HERE.parent.parent
sys.path[:0] = [str(TOP / "tests")]

from outside import BINARY, Server  # noqa: E402

FOLDER = TOP / "target/generators"
ENVIRONMENT = FOLDER / "python"
PROBLEM = TOP / "tests/data/thesis/rectangular_punch.json"
COEFFICIENTS = (0.1, 0.2, 0.3)


def run(*command, folder=FOLDER, **more):
    """Runs a command; ends the program if it fails. Returns what it printed, on standard output and beside it."""
    done = subprocess.run([str(word) for word in command], cwd=folder, capture_output=True, text=True, **more)
    if done.returncode:
        sys.exit("%s: exit code %d\n%s%s" % (command, done.returncode, done.stdout[-3000:], done.stderr[-3000:]))
    return done.stdout, done.stderr


def fresh(name):
    folder = FOLDER / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder


def python(name):
    return ENVIRONMENT / "bin" / name


def prepare():
    """Installs the generators."""
    if not python("openapi-python-client").exists():
        run(sys.executable, "-m", "venv", ENVIRONMENT, folder=TOP)
    run(python("pip"), "install", "--quiet", "--disable-pip-version-check", "-r", HERE / "requirements.txt")
    # Node.js and npm of the environment
    os.environ["PATH"] = "%s:%s" % (ENVIRONMENT / "bin", os.environ["PATH"])
    shutil.copy(HERE / "package.json", FOLDER)
    run("npm", "install", "--silent", "--no-audit", "--no-fund")


def openapi_python_client(description):
    _, told = run(
        python("openapi-python-client"), "generate", "--path", description, "--meta", "none", "--output-path", fresh("opc") / "client"
    )
    # it leaves out what it cannot read, and goes on
    if "Endpoint will not be generated" in told or "Unable to process schema" in told:
        sys.exit("openapi-python-client leaves something out:\n" + told[:5000])
    return [python("python"), HERE / "openapi_python_client.py"], FOLDER / "opc"


def generated(language, name, description):
    return run(python("openapi-generator-cli"), "generate", "-i", description, "-g", language, "-o", fresh(name))


def openapi_generator_python(description):
    generated("python", "ogp", description)
    return [python("python"), HERE / "openapi_generator.py"], FOLDER / "ogp"


def compiled(source, folder):
    """Compiles a program in TypeScript, with all checks of types."""
    shutil.copy(HERE / source, folder)
    tsc = [FOLDER / "node_modules/.bin/tsc", "--strict", "--skipLibCheck"]
    run(*tsc, "--module", "nodenext", "--moduleResolution", "nodenext", "--target", "es2022", "--outDir", "out", source, folder=folder)
    (folder / "out/package.json").write_text('{"type": "module"}')
    return ["node", (folder / "out" / source).with_suffix(".js")], folder


def openapi_generator_typescript(description):
    run(
        python("openapi-generator-cli"), "generate", "-i", description, "-g", "typescript-fetch", "-o", fresh("ogt"),
        "--additional-properties", "importFileExtension=.js",
    )
    (FOLDER / "ogt/package.json").write_text('{"type": "module"}')
    return compiled("openapi_generator.ts", FOLDER / "ogt")


def openapi_typescript(description):
    run("node_modules/.bin/openapi-typescript", description, "-o", fresh("ots") / "api.d.ts")
    (FOLDER / "ots/package.json").write_text('{"type": "module"}')
    return compiled("openapi_typescript.ts", FOLDER / "ots")


GENERATORS = {
    "openapi-python-client": openapi_python_client,
    "openapi-generator-python": openapi_generator_python,
    "openapi-generator-typescript": openapi_generator_typescript,
    "openapi-typescript": openapi_typescript,
}


def forces(server):
    """The normal forces that plain requests find."""
    problem = json.loads(PROBLEM.read_text())
    found = []
    for coefficient in COEFFICIENTS:
        problem["contacts"][0]["friction"]["coefficient"] = coefficient
        job = server.finished(server.submit(problem))
        found.append(server.json("/v1/jobs/%s/result" % job["id"])["summary"]["normal_force"])
    return found


def main():
    names = sys.argv[1:] or list(GENERATORS)
    if set(names) - set(GENERATORS):
        sys.exit("known generators: " + ", ".join(GENERATORS))
    FOLDER.mkdir(parents=True, exist_ok=True)
    prepare()
    with Server() as server:
        url = "http://" + server.address
        description = FOLDER / "openapi.json"
        with urllib.request.urlopen(url + "/openapi.json") as answer:
            description.write_bytes(answer.read())
        expected = forces(server)
        for name in names:
            command, folder = GENERATORS[name](description)
            told, _ = run(*command, url, PROBLEM, *COEFFICIENTS, folder=folder, env={**os.environ, "PYTHONPATH": str(folder)})
            found = [float(line) for line in told.split()]
            if found != expected:
                sys.exit("%s: the client finds %s, not %s" % (name, found, expected))
            print("%s: a study of %d jobs, with the forces of plain requests" % (name, len(found)), flush=True)


if __name__ == "__main__":
    main()
