"""UM-Bridge: its Python package drives `python -m signorini.umbridge` with a fresh service behind it, and the protocol is
checked point by point (R29).

    umbridge.py [CONFORMITY_FOLDER]

The checks are those that the suite of the protocol makes, one line each: written anew from the description of the
protocol, for a model that supports derivatives and one that does not, so that none of them is empty. With a folder that
has the suite itself (`testing/protocol_conformity_1.0` of the project's repository) pytest runs that, too.
"""

import contextlib
import json
import math
import os
import pathlib
import re
import shlex
import signal
import struct
import subprocess
import sys
import tempfile
import threading

HERE = pathlib.Path(__file__).resolve().parent
# this script has the name of the package
sys.path[:] = [path for path in sys.path if pathlib.Path(path or ".").resolve() != HERE]
SOURCE = HERE.parents[1] / "clients/python/src"
sys.path[:0] = [str(HERE.parent), str(SOURCE)]

import requests
import umbridge

import outside
from outside import BINARY, TOP, Server, check, equal, example
from signorini import LocalServer

INDENTATION, MODULUS, POISSON = "/contacts/0/indentation", "/materials/0/youngs_modulus", "/materials/0/poissons_ratio"
COEFFICIENT = "/contacts/0/friction/coefficient"
# a punch with friction at this point
AT = [[0.2, 0.25], [1200.0]]


def with_friction():
    """Two vectors of inputs, two of outputs."""
    return {
        "title": "A flat punch with friction",
        "problem": example("rectangular_punch"),
        "inputs": [[INDENTATION, COEFFICIENT], [MODULUS]],
        "outputs": [
            {"scalars": ["normal_force", "tangential_force", "contacts/top/peak_tangential_stress"]},
            {"profile": "top", "quantity": "normal_stress", "points": 7},
        ],
    }


def frictionless(indentation=0.25):
    """Its force is proportional to the indentation and to Young's modulus."""
    problem = example("rectangular_punch")
    del problem["contacts"][0]["friction"]
    problem["contacts"][0]["indentation"] = indentation
    return {
        "problem": problem,
        "inputs": [[INDENTATION, MODULUS]],
        "outputs": [{"scalars": ["normal_force", "contacts/top/peak_normal_stress"]}],
    }


def environment(server, token=""):
    """Of a program that uses the client for Python."""
    return dict(os.environ, PYTHONPATH=str(SOURCE), SIGNORINI_URL=server.url, SIGNORINI_TOKEN=token, SIGNORINI_CA="")


@contextlib.contextmanager
def bridge(server, models, token="", options=()):
    """The address of `python -m signorini.umbridge` with these models; it ends well when it is told to."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for model, definition in models.items():
            (folder / (model + ".json")).write_text(json.dumps(definition))
        words = ["%s=%s" % (model, folder / (model + ".json")) for model in models]
        command = [sys.executable, "-m", "signorini.umbridge", "--port", "0", *options, *words]
        with running(command, environment(server, token)) as url:
            yield url


@contextlib.contextmanager
def running(command, environment):
    """The address that a program prints, which is told to stop at the end."""
    # not in the folder of this script, which has the name of the package
    process = subprocess.Popen(command, cwd=TOP, env=environment, stdout=subprocess.PIPE, text=True)
    try:
        url = process.stdout.readline().strip()
        check(url.startswith("http://127.0.0.1:"), "the server of models began with %r" % url)
        yield url
        process.send_signal(signal.SIGTERM)
        equal(process.wait(timeout=30), 0, "exit code after SIGTERM")
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def bits(values):
    return [struct.pack("<d", value) for value in values]


def close(found, expected, tolerance, what):
    check(math.isclose(found, expected, rel_tol=tolerance), "%s: found %r, expected %r" % (what, found, expected))


def evaluate(server, url, model):
    """The package gets what a job with the same problem has, bit by bit."""
    equal(umbridge.supported_models(url), ["punch", "smooth", "hasty"], "the models")
    equal((model.get_input_sizes(), model.get_output_sizes()), ([2, 1], [3, 7]), "the sizes")
    features = [model.supports_evaluate(), model.supports_gradient(), model.supports_apply_jacobian(), model.supports_apply_hessian()]
    equal(features, [True, True, True, False], "what is supported")
    found = model(AT)
    equal(model(AT, {}), found, "the same again")
    problem = with_friction()["problem"]
    problem["contacts"][0].update(indentation=AT[0][0])
    problem["contacts"][0]["friction"].update(coefficient=AT[0][1])
    problem["materials"][0].update(youngs_modulus=AT[1][0])
    job = server.submit(problem)
    equal(server.finished(job)["status"], "succeeded", "the same problem as a job")
    summary = server.json("/v1/jobs/%s/result" % job)["summary"]
    profile = server.json("/v1/jobs/%s/profiles/top?points=7" % job)
    numbers = [summary["normal_force"], summary["tangential_force"], summary["contacts"]["top"]["peak_tangential_stress"]["value"]]
    equal(bits(found[0]), bits(numbers), "the scalars, bit by bit")
    equal(bits(found[1]), bits(profile["normal_stress"]), "the profile, bit by bit")
    jobs = server.every_job(**{"label.model": "punch"})
    check(any(one["cached_from"] for one in jobs), "the second evaluation was answered from the cache: %r" % jobs)
    equal({one["name"] for one in jobs}, {"model punch"}, "the names of the jobs")


def moved(point, vector, number, by):
    point = [list(values) for values in point]
    point[vector][number] += by
    return point


def differentiate(model):
    """Derivatives are those of differences made by hand; the Jacobian of the gradient is the same."""
    rows = []
    for number in range(2):
        # another step than the service takes: what is compared is the derivative, and not the recipe
        step = 2e-3 * AT[0][number]
        ends = [model(moved(AT, 0, number, by))[0] for by in (step, -step)]
        rows.append([(plus - minus) / (2 * step) for plus, minus in zip(*ends)])
    sens = [1.0, -2.0, 0.5]
    gradient = model.gradient(0, 0, AT, sens)
    for number, found in enumerate(gradient):
        expected = sum(s * derivative for s, derivative in zip(sens, rows[number]))
        close(found, expected, 1e-3, "the gradient by input %d" % number)
    vec = [0.3, -0.1]
    jacobian = model.apply_jacobian(0, 0, AT, vec)
    for k, found in enumerate(jacobian):
        close(found, sum(v * rows[number][k] for number, v in enumerate(vec)), 1e-3, "the Jacobian, output %d" % k)
    both = sum(s * value for s, value in zip(sens, jacobian)), sum(v * value for v, value in zip(vec, gradient))
    close(both[0], both[1], 1e-3, "s (J v) = (s J) v")
    equal(len(model.gradient(1, 1, AT, [1.0] * 7)), 1, "a gradient of the profile by Young's modulus")


def known_derivatives(url):
    """F = c E d: its derivatives are F/d and F/E."""
    model = umbridge.HTTPModel(url, "smooth")
    depth, modulus = 0.3, 900.0
    (force, peak), = model([[depth, modulus]])
    check(force > 0 and peak < 0, "a force of %r and a stress of %r" % (force, peak))
    for sens, value in (([1.0, 0.0], force), ([0.0, 1.0], peak)):
        found = model.gradient(0, 0, [[depth, modulus]], sens)
        close(found[0], value / depth, 1e-6, "the derivative by the indentation")
        close(found[1], value / modulus, 1e-6, "the derivative by Young's modulus")
    found = model.apply_jacobian(0, 0, [[depth, modulus]], [depth, modulus])
    close(found[0], 2 * force, 1e-6, "the derivative along the point itself")


def refused(work, *words):
    try:
        work()
    except Exception as error:
        check(all(word in str(error) for word in words), "%r is not in %r" % (words, str(error)))
    else:
        check(False, "was not refused: %r" % (words,))


def be_refused(url, model):
    """What the package shows its user."""
    refused(lambda: model([[0.2], [1200.0]]), "InvalidInput", "input 0 has 1 numbers; expected 2")
    refused(lambda: model(AT, {"level": 2}), "InvalidInput", "level")
    refused(lambda: model([[0.2, -1.0], [1200.0]]), "InvalidInput", COEFFICIENT)
    smooth, hasty = umbridge.HTTPModel(url, "smooth"), umbridge.HTTPModel(url, "hasty")
    refused(lambda: smooth([[-0.1, 900.0]]), "InvalidOutput", "job_", "peak_normal_stress")
    refused(lambda: model.apply_hessian(0, 0, 0, AT, [1.0] * 3, [1.0] * 2), "not supported")
    refused(lambda: umbridge.HTTPModel(url, "press"), "press", "punch")
    # a job that failed, and steps to where a problem is invalid
    refused(lambda: hasty(AT), "InvalidOutput", "job_", "not-converged")
    refused(lambda: model.gradient(0, 0, [[0.2, 0.0], [1200.0]], [1.0, 0.0, 0.0]), "InvalidInput", COEFFICIENT + " = -0.000139")


def wrong_requests(url):
    """What the package does not send: each is refused in the form of the protocol, and nothing is submitted for it."""
    good = {"name": "punch", "input": AT, "config": {}, "outWrt": 0, "inWrt": 0, "sens": [1, 0, 0], "vec": [1, 0]}
    for endpoint, changes, words in (
        ("Evaluate", {"name": None}, "name: expected"),
        ("Evaluate", {"name": "press"}, "press"),
        ("Evaluate", {"inputs": []}, "inputs"),
        ("Evaluate", {"config": []}, "config: expected an object"),
        ("Evaluate", {"input": [[0.2, 0.25]]}, "1 vectors; the model takes 2"),
        ("Evaluate", {"input": [0.2, 1200]}, "a list of finite numbers"),
        ("Evaluate", {"input": [["0.2", 0.25], [1200]]}, "a list of finite numbers"),
        ("Evaluate", {"input": [[True, 0.25], [1200]]}, "a list of finite numbers"),
        ("Evaluate", {"input": [[math.nan, 0.25], [1200]]}, "a list of finite numbers"),
        ("Evaluate", {"input": [[10**400, 0.25], [1200]]}, "a list of finite numbers"),
        ("Evaluate", {"input": [[0.2, 0.25], [-5]]}, "/materials/0/youngs_modulus"),
        ("Gradient", {"outWrt": 2}, "outWrt is 2; expected 0 … 1"),
        ("Gradient", {"inWrt": -1}, "inWrt is -1; expected 0 … 1"),
        ("Gradient", {"inWrt": 0.5}, "inWrt: expected"),
        ("Gradient", {"sens": [1]}, "sens has 1 numbers; expected 3"),
        ("ApplyJacobian", {"vec": [1]}, "vec has 1 numbers; expected 2"),
        ("ApplyJacobian", {"vec": [1.7e308, 0]}, "vec is too large"),
    ):
        answer = requests.post("%s/%s" % (url, endpoint), data=json.dumps({**good, **changes}))
        kind = "ModelNotFound" if changes == {"name": "press"} else "InvalidInput"
        found = answer.status_code, list(answer.json()), answer.json()["error"]["type"]
        equal(found, (400, ["error"], kind), "%s %r, %s" % (endpoint, changes, answer.text))
        check(words in answer.json()["error"]["message"], "%r is not in %s" % (words, answer.text))
    for body, status, words in (
        ("", 400, "cannot be read"),
        ('{"name": "punch"', 400, "cannot be read"),
        ("[" * 100_000, 400, "cannot be read"),
        ('["punch"]', 400, "expected a JSON object"),
        ('{"name": "punch"}', 400, "input is missing"),
        (" " * ((1 << 20) + 1), 413, "1048576"),
    ):
        answer = requests.post(url + "/Evaluate", data=body)
        equal(answer.status_code, status, "%.80r, %s" % (body, answer.text))
        check(words in answer.json()["error"]["message"], "%r is not in %s" % (words, answer.text))
    for answer in (
        requests.post(url + "/Evaluate", data=json.dumps(good), headers={"Origin": "http://elsewhere.example"}),
        requests.post(url + "/EvaluateShMem", data=json.dumps(good)),
        requests.get(url + "/Evaluate"),
    ):
        check(answer.status_code in (403, 404, 405) and "error" in answer.json(), answer.text)


def wrong_definitions(server):
    """All that is wrong is told before anything is served, and nothing is."""
    problem = dict(example("rectangular_punch"), materials=[{"youngs_modulus": -1, "poissons_ratio": 0.3}])
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        inputs = [["/contacts/0/identation", "/title"], []]
        outputs = [{"scalars": ["normal_forces", "contacts/side/normal_force"]}, {"profile": "top"}]
        definition = {"problem": problem, "inputs": inputs, "outputs": outputs}
        (folder / "wrong.json").write_text(json.dumps(definition))
        (folder / "none.json").write_text("{")
        words = ["wrong=%s" % (folder / "wrong.json"), "none=%s" % (folder / "none.json"), "absent=%s" % (folder / "absent.json")]
        done = subprocess.run([sys.executable, "-m", "signorini.umbridge", "--port", "0", *words], cwd=TOP,
                              env=environment(server), capture_output=True, text=True, timeout=60)
    equal((done.returncode, done.stdout), (1, ""), "the end of a server without models: %s" % done.stderr)
    for words in ("/problem/materials/0/youngs_modulus", "/inputs/0/0", "/contacts/0/identation", "`indentation`", "/inputs/0/1",
                  "/inputs/1", "/outputs/0/scalars/0", "/outputs/0/scalars/1", "/outputs/1", "none.json", "absent.json"):
        check(words in done.stderr, "%r is not in %s" % (words, done.stderr))


def without_the_service():
    """What is asked while the service is away is asked again for a while, and then an error; it comes back by itself."""
    server = LocalServer(binary=BINARY)
    server.start()
    with bridge(server, {"smooth": frictionless()}, options=("--retry-for", "1")) as url:
        model = umbridge.HTTPModel(url, "smooth")
        check(model([[0.3, 900.0]])[0][0] > 0, "an evaluation")
        server.kill()
        refused(lambda: model([[0.31, 900.0]]), "service-unreachable", server.url)
        server.start()
        check(model([[0.31, 900.0]])[0][0] > 0, "an evaluation when the service is back")
    server.stop()


def stopped():
    """A server that is told to stop while it waits answers with an error; the job stays in the queue, and ends."""
    with Server("--memory-budget-bytes", str(2 << 30)) as server:
        found = []
        with bridge(server, {"smooth": frictionless()}) as url:
            equal(server.call("POST", "/v1/queue/pause").status, 200, "pausing")
            asking = threading.Thread(target=lambda: found.append(
                requests.post(url + "/Evaluate", data=json.dumps({"name": "smooth", "input": [[0.3, 900.0]]}))))
            asking.start()
            while not server.every_job(status="queued"):
                pass
        asking.join()
        equal((found[0].status_code, found[0].json()["error"]["type"]), (503, "draining"), "the answer of one that stops")
        equal(server.call("POST", "/v1/queue/resume").status, 200, "resuming")
        job, = server.every_job()
        equal(server.finished(job["id"])["status"], "succeeded", "the job")


def as_documented(server):
    """The commands of the page, as a reader copies them."""
    page = (TOP / "docs/umbridge.md").read_text(encoding="utf-8")
    blocks = re.findall(r"<!-- (run|serve) -->\n```(sh|python)\n(.*?)```", page, re.S)
    equal([block[:2] for block in blocks], [("run", "sh"), ("serve", "sh"), ("run", "python")], "the commands of the page")
    (*_, define), (*_, serve), (*_, call) = blocks
    with tempfile.TemporaryDirectory() as folder:
        model = os.path.join(folder, "model.json")
        done = subprocess.run(["bash", "-euo", "pipefail", "-c", define.replace("model.json", model)], cwd=TOP)
        equal(done.returncode, 0, define)
        words = shlex.split(serve.replace("model.json", model))
        equal(words[0], "python", serve)
        with running([sys.executable, *words[1:], "--port", "0"], environment(server)) as url:
            code = call.replace("http://127.0.0.1:4242", url)
            done = subprocess.run([sys.executable, "-c", code], cwd=TOP, capture_output=True, text=True, timeout=300)
            equal(done.returncode, 0, "%s\n%s%s" % (code, done.stdout, done.stderr))
            equal(done.stdout.splitlines()[0], "[2] [3, 50]", "the sizes that the page shows")


def from_other_ways(url):
    """Shared memory is offered by the package: it finds that there is none, and goes on over HTTP."""
    model = umbridge.HTTPModel(url, "smooth", use_shmem=True)
    equal(len(model([[0.3, 900.0]])[0]), 2, "an evaluation by a client that tried shared memory")


def with_tokens():
    """The server of models has a token; whoever reaches it evaluates with that."""
    with Server("--memory-budget-bytes", str(2 << 30)) as server:
        server.kill()
        create = [BINARY, "token", "create", "--data", server.data, "--name", "test", "--owner"]
        made = [subprocess.run([*create, owner, "--scope", scope], capture_output=True, text=True, check=True).stdout.strip()
                for owner, scope in (("root", "admin"), ("ada", "read,submit"), ("bob", "read"))]
        admin, ada, reads = made
        server.start()
        with bridge(server, {"smooth": frictionless()}, token=ada) as url:
            check(umbridge.HTTPModel(url, "smooth")([[0.3, 900.0]])[0][0] > 0, "an evaluation with a token")
        job, = server.call("GET", "/v1/jobs", authorization="Bearer " + admin).json()["jobs"]
        equal(job["owner"], "ada", "the owner of the job")
        for token, words in ((reads, ("forbidden", "submit")), ("", ("unauthenticated",))):
            with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
                file.write(json.dumps(frictionless()))
                file.flush()
                done = subprocess.run([sys.executable, "-m", "signorini.umbridge", "smooth=" + file.name], cwd=TOP,
                                      env=environment(server, token), capture_output=True, text=True, timeout=60)
            equal(done.returncode, 1, "without the right token")
            check(all(word in done.stderr for word in words), done.stderr)


class Protocol:
    """The 22 checks of the protocol, of a model with derivatives and one without."""

    def __init__(self, url, name, value):
        self.url, self.name, self.value = url, name, value
        self.inputs = self.post("InputSizes", {"name": name}).json()["inputSizes"]
        self.outputs = self.post("OutputSizes", {"name": name}).json()["outputSizes"]
        self.support = self.post("ModelInfo", {"name": name}).json()["support"]

    def post(self, endpoint, body):
        # without a type, as some clients send it
        return requests.post("%s/%s" % (self.url, endpoint), data=json.dumps(body))

    def at(self, more=0, **fields):
        """A request at the point whose numbers are all the same, with so many more numbers than there should be."""
        return {"name": self.name, "input": [[self.value] * (size + more) for size in self.inputs], "config": {}, **fields}

    def derivative(self, more=0, **fields):
        return self.at(more, **{"outWrt": 0, "inWrt": 0, **fields})

    def answers(self, endpoint, body):
        answer = self.post(endpoint, body)
        equal(answer.status_code, 200, "%s, %s" % (endpoint, answer.text))
        check(answer.headers["content-type"].startswith("application/json"), answer.headers["content-type"])
        equal(list(answer.json()), ["output"], "the fields of the answer")
        return answer.json()["output"]

    def refuses(self, endpoint, body, kind):
        answer = self.post(endpoint, body)
        equal(answer.status_code, 400, "%s, %s" % (endpoint, answer.text))
        error = answer.json()
        equal(list(error), ["error"], "the fields of the answer")
        equal(sorted(error["error"]), ["message", "type"], "the fields of the error")
        equal(error["error"]["type"], kind, "the type of the error")
        check(isinstance(error["error"]["message"], str) and error["error"]["message"], "the message of the error")

    def is_vector(self, found, size):
        check(isinstance(found, list) and all(type(value) in (int, float) for value in found), "a vector: %r" % (found,))
        equal(len(found), size, "the length of a vector")

    def supported(self, endpoint, expected):
        equal(self.support[endpoint], expected, "whether %s is supported by %s" % (endpoint, self.name))


def conformity(url):
    """Each check is one of the suite's; all are made of one model or the other."""
    full, plain = Protocol(url, "punch", 0.1), Protocol(url, "plain", 0.1)

    def connection():
        requests.head(url)

    def evaluate():
        full.supported("Evaluate", True)
        output = full.answers("Evaluate", full.at())
        equal(len(output), len(full.outputs), "the vectors of the output")
        for vector, size in zip(output, full.outputs):
            full.is_vector(vector, size)

    def evaluate_with_wrong_model_name():
        full.refuses("Evaluate", {"name": "wrong_model_name"}, "ModelNotFound")

    def evaluate_unsupported():
        # every model can be evaluated: there is none to be refused
        plain.supported("Evaluate", True)

    def evaluate_with_wrong_input_dimensions():
        full.refuses("Evaluate", full.at(more=1), "InvalidInput")

    def gradient():
        full.supported("Gradient", True)
        full.is_vector(full.answers("Gradient", full.derivative(sens=[0] * full.outputs[0])), full.inputs[0])

    def gradient_unsupported():
        plain.supported("Gradient", False)
        plain.refuses("Gradient", {"name": plain.name}, "UnsupportedFeature")

    def gradient_with_wrong_input_dimensions():
        full.refuses("Gradient", full.derivative(more=1, sens=[0] * full.outputs[0]), "InvalidInput")

    def gradient_with_wrong_in_wrt():
        full.refuses("Gradient", full.derivative(inWrt=len(full.inputs), sens=[0] * full.outputs[0]), "InvalidInput")

    def gradient_with_wrong_out_wrt():
        full.refuses("Gradient", full.derivative(outWrt=len(full.outputs), sens=[0] * full.outputs[0]), "InvalidInput")

    def apply_jacobian():
        full.supported("ApplyJacobian", True)
        full.is_vector(full.answers("ApplyJacobian", full.derivative(vec=[0.1] * full.inputs[0])), full.outputs[0])

    def apply_jacobian_unsupported():
        plain.supported("ApplyJacobian", False)
        plain.refuses("ApplyJacobian", {"name": plain.name}, "UnsupportedFeature")

    def apply_jacobian_with_wrong_input_dimensions():
        full.refuses("ApplyJacobian", full.derivative(more=1, vec=[0.1] * full.inputs[0]), "InvalidInput")

    def apply_hessian():
        # no model has one: what is asked for all the same is refused
        full.supported("ApplyHessian", False)
        full.refuses("ApplyHessian", full.at(outWrt=0, inWrt1=0, inWrt2=0, sens=[0] * full.outputs[0], vec=[0] * full.inputs[0]),
                     "UnsupportedFeature")

    def apply_hessian_unsupported():
        full.refuses("ApplyHessian", {"name": full.name}, "UnsupportedFeature")

    def apply_hessian_with_wrong_input_dimensions():
        full.refuses("ApplyHessian", full.at(1, outWrt=0, inWrt1=0, inWrt2=0, sens=[0] * full.outputs[0], vec=[0] * full.inputs[0]),
                     "UnsupportedFeature")

    def sizes(endpoint, field):
        answer = full.post(endpoint, {"name": full.name})
        equal((answer.status_code, list(answer.json())), (200, [field]), endpoint)
        found = answer.json()[field]
        check(found and all(type(size) is int and size > 0 for size in found), "%s: %r" % (endpoint, found))

    def input_sizes():
        sizes("InputSizes", "inputSizes")

    def output_sizes():
        sizes("OutputSizes", "outputSizes")

    def protocol_version():
        version = requests.get(url + "/Info").json()["protocolVersion"]
        check(type(version) is float and version == 1.0, "the version: %r" % version)

    def info():
        answer = requests.get(url + "/Info")
        equal((answer.status_code, sorted(answer.json())), (200, ["models", "protocolVersion"]), "Info")
        check(all(type(name) is str for name in answer.json()["models"]), "the names: %r" % answer.json())

    def model_info():
        answer = full.post("ModelInfo", {"name": full.name})
        equal((answer.status_code, list(answer.json())), (200, ["support"]), "ModelInfo")
        support = answer.json()["support"]
        equal(sorted(support), ["ApplyHessian", "ApplyJacobian", "Evaluate", "Gradient"], "the features")
        check(all(type(value) is bool for value in support.values()), "the features: %r" % support)

    def model_info_with_wrong_model_name():
        full.refuses("ModelInfo", {"name": "wrong_model_name"}, "ModelNotFound")

    checks = [
        connection, evaluate, evaluate_with_wrong_model_name, evaluate_unsupported, evaluate_with_wrong_input_dimensions,
        gradient, gradient_unsupported, gradient_with_wrong_input_dimensions, gradient_with_wrong_in_wrt,
        gradient_with_wrong_out_wrt, apply_jacobian, apply_jacobian_unsupported, apply_jacobian_with_wrong_input_dimensions,
        apply_hessian, apply_hessian_unsupported, apply_hessian_with_wrong_input_dimensions, input_sizes, output_sizes,
        protocol_version, info, model_info, model_info_with_wrong_model_name,
    ]
    failed = 0
    for number, one in enumerate(checks, 1):
        try:
            one()
            told = "ok"
        except Exception as error:
            failed += 1
            told = "FAILED: %r" % error
        print("%2d %s: %s" % (number, one.__name__.replace("_", " "), told))
    equal((len(checks), failed), (22, 0), "the checks of the protocol, and those that failed")
    return len(checks)


def suite(folder, url):
    """The suite itself, if it is there, on the first model of the list."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", folder, "--model_url", url, "--input_value", "0.1"]
    done = subprocess.run(command, capture_output=True, text=True)
    print(done.stdout)
    equal(done.returncode, 0, "the suite of the protocol: %s" % done.stderr)


def main():
    hasty = with_friction()
    hasty["problem"]["solver"] = {"max_iterations": 1}
    with Server("--memory-budget-bytes", str(2 << 30)) as server:
        with bridge(server, {"punch": with_friction(), "smooth": frictionless(), "hasty": hasty}) as url:
            model = umbridge.HTTPModel(url, "punch")
            evaluate(server, url, model)
            differentiate(model)
            known_derivatives(url)
            be_refused(url, model)
            submitted = server.json("/v1/jobs/count")["total"]
            wrong_requests(url)
            equal(server.json("/v1/jobs/count")["total"], submitted, "jobs of requests that were refused")
            from_other_ways(url)
            for folder in sys.argv[1:2]:
                suite(folder, url)
        wrong_definitions(server)
        with bridge(server, {"punch": with_friction(), "plain": frictionless(indentation=0)}) as url:
            passed = conformity(url)
            for folder in sys.argv[1:2]:
                suite(folder, url)
    with Server("--memory-budget-bytes", str(2 << 30)) as server:
        as_documented(server)
    with_tokens()
    without_the_service()
    stopped()
    print("figure: %d of 22 checks of the protocol; the package umbridge drives the service, with the numbers of jobs bit by bit and "
          "derivatives that are known (%d checks in all)" % (passed, outside.checks))


main()
