"""Generates clients from /openapi.json with the generators that people use, and lets each run a small study.

    tests/generators/run.py [NAME ...]      openapi-python-client, openapi-generator (Python, TypeScript),
                                            openapi-typescript; by default all of these; progenitor (Rust) by its name

progenitor is run by `tests/soak progenitor`, since it and its client take minutes to compile. Version 0.15 stops where an operation
has answers of success of two types (200 with data, 206 with a part of the file or 204 without) or a body of two media types.
`one_answer_each` leaves it one of each; a description without the others would hide them from all other clients.

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
PROGENITOR = "0.15.1"
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
    run("npm", "install", "--loglevel", "error", "--no-audit", "--no-fund")


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


def one_answer_each(description):
    """The description with one kind of success and one media type for each operation, JSON where there is JSON."""
    for item in description["paths"].values():
        for operation in item.values():
            if not isinstance(operation, dict):
                continue
            answers = operation["responses"]
            if {"200", "201"} & set(answers):
                answers.pop("204", None)
                answers.pop("206", None)
            for holder in (operation.get("requestBody", {}), *answers.values()):
                if len(content := holder.get("content", {})) > 1:
                    kind = "application/json" if "application/json" in content else next(iter(content))
                    holder["content"] = {kind: content[kind]}
    return description


def progenitor(description):
    rust = FOLDER / "rust"
    # the tool and its client share what they are built from; neither is fast, nor debugged
    os.environ.update({"CARGO_TARGET_DIR": str(rust / "target"), "CARGO_PROFILE_DEV_DEBUG": "0", "CARGO_INCREMENTAL": "0"})
    tool = rust / "bin/cargo-progenitor"
    if not tool.exists():
        run("cargo", "install", "--debug", "--quiet", "--locked", "--root", rust, "cargo-progenitor@" + PROGENITOR)
    simpler = FOLDER / "one_answer_each.json"
    simpler.write_text(json.dumps(one_answer_each(json.loads(description.read_text()))))
    crate = fresh("progenitor")
    run(tool, "progenitor", "-i", simpler, "-o", crate, "-n", "client", "-v", "0.0.0")
    manifest = crate / "Cargo.toml"
    # without the feature serde_json reads some numbers with another last bit
    exact = 'serde_json = { version = "1.0", features = ["float_roundtrip"] }\n'
    more = 'tokio = { version = "1", features = ["macros", "rt"] }\n\n[workspace]\n'
    manifest.write_text(manifest.read_text().replace('serde_json = "1.0"\n', exact) + more)
    shutil.copy(HERE / "progenitor.rs", crate / "src/main.rs")
    run("cargo", "build", "--quiet", folder=crate)
    return [rust / "target/debug/client"], crate


GENERATORS = {
    "openapi-python-client": openapi_python_client,
    "openapi-generator-python": openapi_generator_python,
    "openapi-generator-typescript": openapi_generator_typescript,
    "openapi-typescript": openapi_typescript,
    "progenitor": progenitor,
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
    names = sys.argv[1:] or [name for name in GENERATORS if name != "progenitor"]
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
