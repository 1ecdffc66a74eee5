"""The manifests of contrib/kubernetes: valid by the schemas of the API, and their commands are those of the program.

    kubernetes.py

The schemas are those of the package kubernetes-validate, for each version that it has. The commands run as processes of this
machine, with its folders and addresses in place of those of a cluster: the first token, a service without slots of its own, and a
worker, which solves a job. That Kubernetes itself does with them what it says is not tried.
"""

import os
import pathlib
import re
import subprocess
import sys
import tempfile

import kubernetes_validate
import yaml

import outside
from outside import BINARY, TOP, check, equal, example, free_port

PAGE = TOP / "docs/cluster.md"
FILE = TOP / "contrib/kubernetes/signorini.yaml"
# the oldest one that has all that is used: autoscaling/v2
OLDEST = (1, 23)


def versions():
    found = [version for version in sorted(set(kubernetes_validate.utils.all_versions())) if tuple(map(int, version.split(".")[:2])) >= OLDEST]
    check(len(found) >= 10, "versions of the API: %r" % found)
    return found


def check_schemas(documents):
    for version in versions():
        for document in documents:
            kubernetes_validate.validate(document, version, strict=True)
    wrong = dict(documents[0], spec={"ports": "many"})
    try:
        kubernetes_validate.validate(wrong, versions()[-1], strict=True)
    except kubernetes_validate.ValidationError:
        return
    check(False, "the package accepts anything")


def check_names(documents):
    """What one part says of another."""
    by_kind = {document["kind"]: document for document in documents}
    pod = by_kind["StatefulSet"]["spec"]["template"]
    equal(by_kind["Service"]["spec"]["selector"], pod["metadata"]["labels"], "the pods of the service")
    target = by_kind["HorizontalPodAutoscaler"]["spec"]["scaleTargetRef"]
    equal((target["kind"], target["name"]), ("Deployment", by_kind["Deployment"]["metadata"]["name"]), "what is scaled")
    return pod["spec"], by_kind["Deployment"]["spec"]["template"]["spec"], by_kind["HorizontalPodAutoscaler"]["spec"]["metrics"][0]["external"]["metric"]


def variables(container):
    return {one["name"]: one["value"] for one in container.get("env", ())}


def run(documents):
    service, workers, metric = check_names(documents)
    with tempfile.TemporaryDirectory() as folder:
        data, port = pathlib.Path(folder), free_port()
        path = "%s:%s" % (BINARY.parent, os.environ["PATH"])
        # as the image sets it
        settings = dict(os.environ, PATH=path, SIGNORINI_DATA=folder, SIGNORINI_LISTEN="127.0.0.1:%d" % port)
        here = lambda words: [word.replace("/data/", folder + "/").replace("http://signorini:8080", "http://127.0.0.1:%d" % port)
                              .replace("/token/token", str(data / "worker.token")) for word in words]
        first = service["initContainers"][0]
        for _ in range(2):  # a pod that starts again keeps its token
            subprocess.run([*first["command"], *here(first["args"])], env=settings, check=True)
            token = (data / "admin.token").read_text().split()[-1]
        serve = service["containers"][0]
        with (data / "log").open("wb") as log:
            server = subprocess.Popen([BINARY, *here(serve["args"])], env={**settings, **variables(serve)}, stdout=subprocess.PIPE, stderr=log)
            started = [server]
            try:
                url = server.stdout.readline().decode().strip()
                ask = lambda *words, **more: subprocess.run([BINARY, *words], env=dict(settings, SIGNORINI_URL=url, SIGNORINI_TOKEN=token), check=True,
                                                            capture_output=True, text=True, **more).stdout
                # in the pod the program has the address of its variables
                command = re.search(r"kubectl exec signorini-0 -- sh -c '(.*?)' > worker.token", PAGE.read_text(), re.DOTALL)[1]
                inside = {**settings, **variables(serve), "SIGNORINI_URL": url}
                made = subprocess.run(["sh", "-c", *here([command.replace("\\\n", " ")])], env=inside, check=True, capture_output=True, text=True).stdout
                (data / "worker.token").write_text(made)
                started.append(subprocess.Popen([BINARY, *here(workers["containers"][0]["args"])], env=settings, stderr=log))
                problem = data / "problem.json"
                problem.write_text(outside.json.dumps(example()))
                told = ask("submit", str(problem), "--wait", timeout=60)
                check("succeeded" in told or "good" in told, "a job: %r" % told)
                from urllib.request import Request, urlopen
                call = lambda path, host: urlopen(Request(url + path, headers={"Authorization": "Bearer " + token, "Host": host})).read().decode()
                host = "signorini:8080"
                for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
                    call(serve[probe]["httpGet"]["path"], host)
                labels = ",".join('%s="%s"' % pair for pair in metric["selector"]["matchLabels"].items())
                check("%s{%s}" % (metric["name"], labels) in call("/metrics", host), "the metric by which workers are scaled")
                for process in reversed(started):
                    process.terminate()
                    equal(process.wait(timeout=60), 0, "the exit code after SIGTERM")
            finally:
                for process in started:
                    process.kill()


def main():
    documents = list(yaml.safe_load_all(FILE.read_text()))
    check_schemas(documents)
    run(documents)
    print("Kubernetes: %d manifests valid for %d versions of the API, their commands run" % (len(documents), len(versions())))


if __name__ == "__main__":
    sys.exit(main())
