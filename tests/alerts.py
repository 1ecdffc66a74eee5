"""Metrics and alerts, checked by Prometheus's own promtool (Debian's package prometheus).

    alerts.py

/metrics in the text format 0.0.4 has nothing that promtool complains about, whatever has happened: jobs that succeed and fail,
requests over both protocols, errors. The alerts of contrib/prometheus are valid, name only metrics that are there, fire in the
cases of tests/data/alerts.yml and are listed in docs/operations.md.
"""

import re
import shutil
import subprocess
import sys

import outside
from outside import TOP, Server, check, equal, example, submission

sys.path.insert(0, str(TOP / "tests/clients"))
from reflected import Client  # noqa: E402

ALERTS = TOP / "contrib/prometheus/alerts.yml"
CASES = TOP / "tests/data/alerts.yml"
# of Prometheus itself
OWN = {"up"}


def promtool(*arguments, text=None):
    """What promtool prints; it has to be satisfied."""
    ran = subprocess.run(["promtool", *map(str, arguments)], input=text, capture_output=True, text=True)
    check(ran.returncode == 0, "promtool %s: %s%s" % (" ".join(map(str, arguments)), ran.stdout, ran.stderr))
    return ran.stdout + ran.stderr


def metrics():
    """The metrics of a service that has something to tell."""
    with Server() as server:
        server.finished(server.submit(example()))
        hasty = dict(example(), solver={"max_iterations": 1})
        failed = server.finished(server.submit(hasty))
        equal(failed["reason"], "not_converged", "the job that fails")
        equal(server.call("GET", "/v1/jobs/job_7").status, 404, "a job that is not there")
        equal(server.call("POST", "/v1/jobs", submission({"mesh": {}})).status, 422, "a problem that is none")
        with Client(server.address) as grpc:
            grpc.GetQueue()
        answer = server.call("GET", "/metrics", accept="text/plain;version=0.0.4")
        equal(answer.headers["content-type"], "text/plain; version=0.0.4; charset=utf-8", "the type of the metrics")
        return answer.body.decode()


def main():
    if not shutil.which("promtool"):
        sys.exit("promtool is not there: Debian's package prometheus has it")
    text = metrics()
    equal(promtool("check", "metrics", text=text), "", "what promtool has to say of the metrics")
    # it would say so
    found = subprocess.run(["promtool", "check", "metrics"], input="a_Count 1\n", capture_output=True, text=True)
    check(found.returncode != 0, "promtool finds faults")

    promtool("check", "rules", ALERTS)
    promtool("test", "rules", CASES)
    rules, cases = ALERTS.read_text(encoding="utf-8"), CASES.read_text(encoding="utf-8")
    page = (TOP / "docs/operations.md").read_text(encoding="utf-8")
    names = re.findall(r"^ *- alert: (\w+)$", rules, re.M)
    check(len(names) > 10, "the alerts: %r" % names)
    for name in names:
        check('alertname="%s"' % name in cases, "%s has no case in which it fires" % name)
        check("`%s`" % name in page, "%s is not in docs/operations.md" % name)
    known = set(re.findall(r"^([a-z_]+)(?:\{| )", text, re.M)) | OWN
    expressions = re.findall(r"expr: (?:\|\n((?: {10}.*\n)+)|(.*)\n)", rules)
    equal(len(expressions), len(names), "the expressions of the alerts")
    for expression in expressions:
        used = set(re.findall(r"\b(?:signorini|process)_[a-z_]+|\bup\b", "".join(expression)))
        check(used, "the metrics of %r" % (expression,))
        check(used <= known, "metrics that there are not: %r" % (used - known))
    print("alerts: %d checks" % outside.checks)


main()
