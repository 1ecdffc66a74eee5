"""What the service tells about itself, read by the programs that others read it with: metrics by the parsers of Prometheus's
own client library, spans by a collector made from OpenTelemetry's own contract.

    telemetry.py

Metrics: names, types, explanations; counters never fall; hostile paths add no labels; every name in the dashboard exists.
Spans: of requests over REST and gRPC and of their jobs, with the ids of the client's trace. A collector that is absent or
does not answer costs no request anything.
"""

import concurrent.futures
import contextlib
import json
import os
import re
import socket
import sys
import threading
import time
import urllib.parse

import grpc
from opentelemetry.proto.collector.trace.v1 import trace_service_pb2, trace_service_pb2_grpc
from prometheus_client.openmetrics.parser import text_string_to_metric_families as strictly
from prometheus_client.parser import text_string_to_metric_families as classically

import outside
from outside import TOP, Server, check, equal, example, percentile, submission

sys.path.insert(0, str(TOP / "tests/clients"))
from reflected import Client  # noqa: E402

DASHBOARD = TOP / "contrib/grafana/signorini.json"
TRACE, SPAN = "4bf92f3577b34da6a3ce929d0e0e4736", "00f067aa0ba902b7"
TRACEPARENT = "00-%s-%s-01" % (TRACE, SPAN)
# labels and the most values that each may have; le is that of histograms
LABELS = {"method": 8, "route": 80, "status": 12, "rpc": 80, "code": 17, "reason": 20, "phase": 9, "file": 3, "le": 30, "version": 1,
          "result_from": 3}


# what Prometheus sends
PROMETHEUS = "application/openmetrics-text;version=1.0.0;q=0.5,text/plain;version=0.0.4;q=0.2,*/*;q=0.1"


def scraped(server, accept=PROMETHEUS, kind="application/openmetrics-text; version=1.0.0; charset=utf-8", **headers):
    answer = server.call("GET", "/metrics", accept=accept, **headers)
    equal(answer.status, 200, "GET /metrics, %r" % answer)
    equal(answer.headers["content-type"], kind, "its type")
    return answer.body.decode()


def in_the_older_format(server, families):
    """By default the text of Prometheus 0.0.4, with the same families, types and labels."""
    kind = "text/plain; version=0.0.4; charset=utf-8"
    for accept in ("*/*", "text/plain", "application/openmetrics-text;q=0", "text/plain;q=0.9,application/openmetrics-text;q=0.1"):
        found = {family.name: family for family in classically(scraped(server, accept, kind))}
    for family in families:
        older = found.get(family.name + ("_info" if family.type == "info" else ""))
        check(older is not None, "%s in the older format: %r" % (family.name, sorted(found)))
        equal(older.type, "gauge" if family.type == "info" else family.type, "the type of %s" % family.name)
        equal(older.documentation, family.documentation, "the description of %s" % family.name)
        names = {sample.name for sample in family.samples}
        equal({sample.name for sample in older.samples}, names, "the samples of %s" % family.name)


def samples(text):
    """Families by name, and the value of each sample by its name and labels."""
    families = list(strictly(text))
    found = {}
    for family in families:
        check(family.type in ("counter", "gauge", "histogram", "info"), "%s is %s" % (family.name, family.type))
        check(len(family.documentation) > 5, "%s is explained" % family.name)
        check(re.fullmatch(r"(signorini|process)_[a-z_]+", family.name), "the name %s" % family.name)
        for sample in family.samples:
            labels = tuple(sorted(sample.labels.items()))
            check(set(sample.labels) <= set(LABELS), "the labels of %s: %r" % (sample.name, labels))
            check((sample.name, labels) not in found, "%s %r is there once" % (sample.name, labels))
            found[sample.name, labels] = sample.value
    return families, found


def never_fall(before, after):
    for (name, labels), value in before.items():
        if name.endswith(("_total", "_bucket", "_count", "_sum")):
            check(after.get((name, labels), -1) >= value, "%s %r fell from %r" % (name, labels, value))


def hostile(server):
    """Requests whose methods, paths and headers are of the client's making."""
    for n in range(200):
        server.call("GET", "/nowhere/%d/%s" % (n, "x" * n))
        server.call("GET", "/v1/jobs/%s" % urllib.parse.quote('job"\n{%d}' % n))
        server.call("BREW%d" % n, "/v1/jobs")
        server.call("POST", "/signorini.v1.JobService/Method%d" % n, b"", content_type="application/grpc")
        server.call("POST", "/some.Service%d/Method" % n, b"", content_type="application/grpc")
        server.call("GET", "/v1/me", x_request_id="r%d" % n, traceparent="00-%032x-%016x-01" % (n + 1, n + 1))


# Operations: GetMetrics
def test_metrics():
    with Server() as server:
        client = Client(server.address)
        job = server.submit(example())
        equal(server.finished(job)["status"], "succeeded", "the job")
        server.call("POST", "/v1/queue/pause")
        waiting = server.submit(example())
        equal(server.call("POST", "/v1/jobs", submission({})).status, 422, "an invalid one")
        client.GetServerInfo()
        server.call("GET", "/metrics")
        text = scraped(server)
        families, before = samples(text)
        check(len(families) > 40, "%d families" % len(families))
        in_the_older_format(server, families)

        def value(name, of=before, **labels):
            return of.get((name, tuple(sorted(labels.items()))))

        equal(value("signorini_jobs", status="queued"), 1, "jobs that wait")
        check(value("signorini_oldest_wait_seconds") > 0, "the oldest of them")
        equal(value("signorini_queue_paused"), 1, "the queue is paused")
        equal(value("signorini_jobs_accepted_total", result_from="solver"), 2, "accepted jobs")
        equal(value("signorini_jobs_ended_total", status="succeeded", reason=""), 1, "jobs that succeeded")
        equal((value("signorini_job_run_seconds_count"), value("signorini_job_wait_seconds_count")), (1, 1), "their times")
        phases = [labels for name, labels in before if name == "signorini_solver_phase_seconds_total"]
        check(len(phases) >= 5, "phases: %r" % phases)
        check(0 < value("signorini_solver_phase_seconds_total", phase="factor") < 10, "the factor took some time")
        check(value("signorini_store_commit_duration_seconds_count") > 3, "commits")
        check(value("signorini_store_bytes", file="wal") > 0, "the store has a log")
        check(value("signorini_store_bytes", file="database") > 0, "and a database")
        check(0 < value("signorini_disk_free_bytes") <= value("signorini_disk_size_bytes"), "its disk")
        equal(value("signorini_http_requests_total", method="POST", route="/v1/jobs", status="2xx"), 2, "submits")
        equal(value("signorini_http_requests_total", method="POST", route="/v1/jobs", status="4xx"), 1, "a refused one")
        equal(value("signorini_grpc_requests_total", rpc="signorini.v1.JobService/GetServerInfo", code="OK"), 1, "a call")
        check(value("signorini_connections") >= 1, "open connections")
        equal(value("signorini_body_cache_misses_total"), 1, "the body was made")
        check(value("signorini_memory_budget_bytes") > value("signorini_memory_reserved_bytes") == 0, "memory")
        resident, pid = value("process_resident_memory_bytes"), server.process.pid
        check(0.5 < resident / outside.memory(pid) < 2, "resident memory: %r" % resident)
        check(abs(value("process_cpu_seconds_total") - outside.cpu_s(pid)) < 1, "processor time")
        check(abs(value("process_start_time_seconds") - time.time()) < 60, "the start")
        check(3 < value("process_open_fds") < value("process_max_fds"), "files")
        equal(value("signorini_ready"), 1, "it is ready")
        equal(len([name for name, _ in before if name == "signorini_build_info"]), 1, "the version")

        hostile(server)
        server.call("POST", "/v1/jobs/%s/cancel" % waiting)
        _, after = samples(scraped(server))
        never_fall(before, after)
        equal(value("signorini_jobs_ended_total", of=after, status="canceled", reason="user_cancel"), 1, "a canceled job")
        values = {}
        for _, labels in after:
            for label, text in labels:
                values.setdefault(label, set()).add(text)
        for label, found in values.items():
            check(len(found) <= LABELS[label], "values of %s: %r" % (label, found))
            check(all(len(text) < 80 for text in found), "values of %s: %r" % (label, found))
        check(len(after) < len(before) + 150, "%d series became %d" % (len(before), len(after)))
        equal(value("signorini_grpc_requests_total", of=after, rpc="unknown", code="UNIMPLEMENTED"), 400, "unknown calls")

        names = {name for name, _ in after}
        dashboard = json.loads(DASHBOARD.read_text(encoding="utf-8"))
        expressions = [target["expr"] for panel in dashboard["panels"] for target in panel.get("targets", [])]
        expressions += [variable["query"]["query"] for variable in dashboard["templating"]["list"] if variable["type"] == "query"]
        check(len(expressions) > 20, "%d expressions" % len(expressions))
        for expression in expressions:
            used = set(re.findall(r"\b(?:signorini|process)_[a-z_]+", expression))
            check(used and used <= names, "%s: unknown are %r" % (expression, used - names))

        created = server.call("POST", "/v1/tokens", {"name": "test", "owner": "root", "scopes": ["admin"]})
        equal(server.call("GET", "/metrics").status, 401, "metrics without a token, where there are tokens")
        scraped(server, authorization="Bearer " + created.json()["secret"])


class Collector(trace_service_pb2_grpc.TraceServiceServicer):
    """Takes spans, as a collector does."""

    def __init__(self):
        self.spans, self.resources, self.metadata = [], [], []
        self.server = grpc.server(concurrent.futures.ThreadPoolExecutor(2))
        trace_service_pb2_grpc.add_TraceServiceServicer_to_server(self, self.server)
        self.url = "http://127.0.0.1:%d" % self.server.add_insecure_port("127.0.0.1:0")
        self.server.start()

    def Export(self, request, context):  # noqa: N802, as the contract has it
        self.metadata.append(dict(context.invocation_metadata()))
        for resource in request.resource_spans:
            self.resources.append(attributes(resource.resource))
            for scope in resource.scope_spans:
                self.spans += scope.spans
        return trace_service_pb2.ExportTraceServiceResponse()

    def wait(self, holds, what):
        end = time.monotonic() + 20
        while time.monotonic() < end:
            found = [span for span in list(self.spans) if holds(span)]
            if found:
                return found
            time.sleep(0.02)
        raise AssertionError("%s: %r" % (what, [span.name for span in self.spans]))


def attributes(of):
    return {pair.key: getattr(pair.value, pair.value.WhichOneof("value")) for pair in of.attributes}


def test_spans():
    collector = Collector()
    # of the standard variables, these are used, and the address is not
    os.environ.update(OTEL_EXPORTER_OTLP_HEADERS="x-key=a%20secret", OTEL_RESOURCE_ATTRIBUTES="lab=north",
                      OTEL_EXPORTER_OTLP_ENDPOINT="http://127.0.0.1:1")
    with Server("--otlp-endpoint", collector.url, "--log", "trace") as server:
        answer = server.call("POST", "/v1/jobs", submission(example()), traceparent=TRACEPARENT)
        job = answer.json()["id"]
        equal(answer.headers["x-request-id"], TRACE, "the request is named by its trace")
        server.finished(job)
        whole = collector.wait(lambda span: span.name == "job", "the span of the job")[0]
        request = collector.wait(lambda span: span.name == "POST /v1/jobs", "the span of its request")[0]
        equal((request.trace_id.hex(), request.parent_span_id.hex(), request.kind), (TRACE, SPAN, 2), "the trace of the client")
        found = attributes(request)
        equal((found["http.route"], found["http.response.status_code"], found["enduser.id"]), ("/v1/jobs", 202, "local"), "what is known of it")
        equal((whole.trace_id, whole.parent_span_id), (request.trace_id, request.span_id), "the job is a part of it")
        found = attributes(whole)
        equal((found["job.id"], found["job.status"], found["job.attempt"]), (job, "succeeded", 1), "what is known of the job")
        parts = {span.name: span for span in collector.spans if span.parent_span_id == whole.span_id}
        equal(set(parts), {"queued", "run"}, "its parts")
        phases = [span for span in collector.spans if span.parent_span_id == parts["run"].span_id]
        check({"factor", "iterate", "recover"} <= {span.name for span in phases}, "phases: %r" % [span.name for span in phases])
        run = parts["run"]
        for span in phases:
            check(run.start_time_unix_nano <= span.start_time_unix_nano <= span.end_time_unix_nano <= run.end_time_unix_nano, "%s lies in the run" % span.name)
        check(parts["queued"].end_time_unix_nano == run.start_time_unix_nano, "it ran when it was no longer queued")
        found = collector.resources[0]
        equal((found["service.name"], found["lab"]), ("signorini", "north"), "the service")
        equal(collector.metadata[0]["x-key"], "a secret", "the credentials")

        with grpc.insecure_channel(server.address) as channel:
            call = channel.unary_unary("/signorini.v1.JobService/GetServerInfo")
            call(b"", metadata=[("traceparent", TRACEPARENT.replace("4bf9", "aaaa"))])
            with contextlib.suppress(grpc.RpcError):
                channel.unary_unary("/signorini.v1.JobService/GetJob")(b"")
        called = collector.wait(lambda span: span.name.endswith("/GetServerInfo"), "the span of a call")[0]
        equal((called.trace_id.hex(), called.parent_span_id.hex()), (TRACE.replace("4bf9", "aaaa"), SPAN), "its trace")
        equal(attributes(called)["rpc.grpc.status_code"], 0, "its status")
        refused = collector.wait(lambda span: span.name.endswith("/GetJob"), "the span of a refused call")[0]
        check(attributes(refused)["rpc.grpc.status_code"] != 0 and refused.parent_span_id == b"", "a trace of its own")

        # not to be recorded; and what is no traceparent
        server.call("GET", "/v1/queue", traceparent=TRACEPARENT[:-2] + "00")
        server.call("GET", "/v1/info", traceparent="00-nonsense")
        own = collector.wait(lambda span: span.name == "GET /v1/info", "the span of a request with a bad header")[0]
        check(own.trace_id.hex() != TRACE and own.parent_span_id == b"", "it begins a trace")
        server.call("GET", "/v1/me")
        server.stop()  # what waits is sent before the end
        collector.wait(lambda span: span.name == "GET /v1/me", "the last span")
        names = {span.name for span in collector.spans}
        check("a secret" not in server.log.read_text(), "the log has no credentials of the collector")
        check(not names & {"GET /v1/queue", "GET /livez", "GET /readyz"}, "these are not recorded: %r" % names)
    collector.server.stop(0)


@contextlib.contextmanager
def mute():
    """Accepts connections, and never answers."""
    held = []
    with socket.create_server(("127.0.0.1", 0)) as listener:
        def accept():
            with contextlib.suppress(OSError):
                while True:
                    held.append(listener.accept()[0])
        threading.Thread(target=accept, daemon=True).start()
        yield "http://127.0.0.1:%d" % listener.getsockname()[1]


def test_no_collector():
    """A collector that is absent, and one that never answers: spans are dropped and counted, and nothing waits."""
    longest = []
    with socket.create_server(("127.0.0.1", 0)) as listener:
        absent = "http://127.0.0.1:%d" % listener.getsockname()[1]
    with mute() as silent:
        for url in (absent, silent):
            with Server("--otlp-endpoint", url) as server:
                times = []
                for _ in range(600 if url == absent else 5500):
                    began = time.monotonic()
                    equal(server.call("GET", "/v1/me").status, 200, "a request")
                    times.append(time.monotonic() - began)
                longest.append(percentile(times, 0.99))
                equal(server.finished(server.submit(example()))["status"], "succeeded", "a job")
                end = time.monotonic() + 20
                while not dict(samples(scraped(server))[1])["signorini_spans_dropped_total", ()]:
                    check(time.monotonic() < end, "no span was dropped")
                    time.sleep(0.1)
                began = time.monotonic()
                server.stop()
                check(time.monotonic() - began < 5, "it stops without waiting for the collector")
                told = [line for line in server.log.read_text().splitlines() if "does not receive them" in line]
                # of one that does not answer it is known after 5 s
                check(len(told) == 1 or (url == silent and not told), "the log tells it once: %r" % told)
    check(max(longest) < 0.5, "requests took %r s" % longest)
    return longest


if __name__ == "__main__":
    test_metrics()
    test_spans()
    slow = test_no_collector()
    print("%d checks; with an absent and a mute collector 99 %% of requests took %.1f and %.1f ms" % (outside.checks, *(1000 * s for s in slow)))
