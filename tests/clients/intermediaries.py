"""What stands between a client and the service: a proxy of the environment, one that speaks HTTP/1.0, and a service of another
version. The command line does not send what is for this machine to a proxy, and names the one that has answered.
"""

import contextlib
import http.server
import json
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import threading

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import outside
from certificates import openssl
from outside import BINARY, Server, check, equal, example, submission


def run(*arguments, **more):
    """A client command that knows nothing of the environment but this."""
    environment = {name: value for name, value in os.environ.items() if "proxy" not in name.lower() and not name.startswith("SIGNORINI_")}
    return subprocess.run([BINARY, *arguments], capture_output=True, text=True, env={**environment, **more}, timeout=60)


@contextlib.contextmanager
def answering(status, body, **headers):
    """A server that answers everything alike, and keeps what it was asked."""
    seen = []

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            seen.append((self.path, dict(self.headers)))
            self.send_response(status)
            for name, value in headers.items():
                self.send_header(name.replace("_", "-"), value)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        do_POST = do_DELETE = do_GET

        def log_message(self, *_):
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield "127.0.0.1:%d" % server.server_port, seen
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def proxies(server):
    """A proxy of the environment is not for this machine, and else it is named."""
    with answering(403, b"<html>log in</html>", content_type="text/html") as (address, seen):
        environment = {name: "http://user:pass@" + address for name in ("http_proxy", "HTTP_PROXY", "https_proxy", "all_proxy")}
        token = "sgn_2884b8f50acc_" + "x" * 43
        port = server.address.split(":")[1]
        for host in ("127.0.0.1", "localhost"):
            done = run("ls", "--url", "http://%s:%s" % (host, port), **environment)
            equal((done.returncode, done.stderr), (0, ""), "ls at %s with a proxy in the environment" % host)
        done = run("health", "--url", server.url, **environment)
        equal(done.returncode, 0, "health with a proxy in the environment, %r" % done)
        # of another user's service: the token is told to nobody
        for other in ("[::1]:9", "127.0.0.2:9", "[::ffff:127.0.0.1]:9"):
            done = run("ls", "--url", "http://" + other, SIGNORINI_TOKEN=token, **environment)
            equal(done.returncode, 5, "ls of a service that is not there, %r" % done)
            check("proxy" not in done.stderr, "no proxy was asked, %r" % done)
        equal(seen, [], "what the proxy was asked for this machine")
        done = run("ls", "--url", "http://lab.example:8080", **environment)
        equal(len(seen), 1, "what the proxy was asked: %r" % seen)
        check(seen and done.returncode not in (0, 5), "ls through the proxy, %r" % done)
        for part in ("http://" + address, "http_proxy", "403"):
            check(part in done.stderr, "the error names %r: %r" % (part, done.stderr))
        check("pass" not in done.stderr, "the password of the proxy: %r" % done.stderr)
    # nobody listens there any more
    done = run("ls", "--url", "http://lab.example:8080", **environment)
    equal(done.returncode, 5, "ls through a proxy that is gone, %r" % done)
    check("through the proxy http://" + address in done.stderr, "the error names the proxy: %r" % done.stderr)


def self_signed(folder):
    """A certificate that is its own authority, as `openssl req -x509` makes it."""
    cert, key, other = folder / "own.pem", folder / "own.key", folder / "other.pem"
    new = ("req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", 30)
    openssl(*new, "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", "-keyout", key, "-out", cert)
    openssl(*new, "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", "-keyout", folder / "o.key", "-out", other)
    with Server("--tls-cert", str(cert), "--tls-key", str(key), ca=str(cert)) as server:
        done = subprocess.run(["curl", "--silent", "--show-error", "--cacert", cert, server.url + "/livez"], capture_output=True, text=True)
        equal(done.returncode, 0, "curl, which trusts the certificate, %r" % done)
        done = run("ls", "--url", server.url, SIGNORINI_CA=str(cert))
        equal(done.returncode, 0, "ls of a service with a certificate of its own, %r" % done)
        done = run("health", "--url", server.url, "--ca", str(cert))
        equal(done.returncode, 0, "health of a service with a certificate of its own, %r" % done)
        for wrong in ({"SIGNORINI_CA": str(other)}, {"SIGNORINI_CA": ""}, {}):
            done = run("ls", "--url", server.url, **wrong)
            equal(done.returncode, 5, "ls that trusts somebody else, %r: %r" % (wrong, done))
            check("--ca" in done.stderr, "the error says what to do: %r" % done.stderr)
        # the name counts, whatever is trusted
        done = run("ls", "--url", server.url.replace("127.0.0.1", "127.0.0.2"), "--ca", str(cert))
        equal(done.returncode, 5, "ls of another name, %r" % done)
        server.stop()
    with Server() as server:
        done = run("ls", "--url", server.url, SIGNORINI_CA="")
        equal(done.returncode, 0, "ls with SIGNORINI_CA empty, %r" % done)


def old_protocol(server):
    """Over HTTP/1.0 each answer has a length, so that one that is cut is noticed."""
    job = server.call("POST", "/v1/jobs", submission(example(refine=2)), prefer="wait=30").json()["id"]
    sweep = server.call("POST", "/v1/sweeps", {"base": example(), "axes": [{"path": "/contacts/0/indentation", "values": [0.1, 0.2]}]}).json()["id"]
    server.call("GET", "/v1/sweeps/%s?wait=30" % sweep)
    host, port = server.address.split(":")
    paths = ["/v1/jobs/%s" % job, "/v1/jobs", "/v1/jobs/%s/result" % job, "/v1/jobs/%s/problem" % job, "/v1/schema/problem.json", "/openapi.json",
             "/metrics", "/docs", "/proto/signorini.proto", "/v1/jobs/%s/events" % job]
    for format in ("json", "csv", "jsonl", "arrow", "npz"):
        paths += [path + "?format=" + format for path in (
            "/v1/jobs/%s/history" % job, "/v1/jobs/%s/profiles/top" % job, "/v1/sweeps/%s/results" % sweep)]
    for format in ("json", "vtu", "npz"):
        paths.append("/v1/jobs/%s/fields?format=%s" % (job, format))
    for plot in ("convergence", "profile", "deformed", "mesh"):
        paths += ["/v1/jobs/%s/plots/%s.%s" % (job, plot, kind) for kind in ("svg", "png", "pdf")]
    for path in paths:
        for coding in ("gzip", "gzip, deflate, br, zstd"):
            with socket.create_connection((host, int(port)), timeout=60) as connection:
                connection.sendall(("GET %s HTTP/1.0\r\nHost: localhost\r\nAccept-Encoding: %s\r\n\r\n" % (path, coding)).encode())
                answer = b"".join(iter(lambda: connection.recv(65536), b""))
            head, _, body = answer.partition(b"\r\n\r\n")
            check(b" 200 " in head.split(b"\r\n")[0], "%s: %r" % (path, head))
            if path.endswith("/events"):
                # as long as they come: their end is an event
                check(b"\nevent: done\n" in body, "events over HTTP/1.0: %r" % body[-300:])
                continue
            lengths = [line.split(b":")[1] for line in head.lower().split(b"\r\n") if line.startswith(b"content-length:")]
            equal([int(length) for length in lengths], [len(body)], "the length of %s over HTTP/1.0: %r" % (path, head))
    # a client that knows of later protocols has it compressed
    answer = server.call("GET", "/v1/jobs/%s/fields?format=vtu" % job, accept_encoding="gzip")
    equal(answer.headers.get("content-encoding"), "gzip", "the coding over HTTP/1.1")


def other_versions(server):
    """The service says its version to whom it knows, and the command line says it where it does not understand the answer."""
    version = run("--version").stdout.split()[-1]
    equal(server.call("GET", "/v1/me").headers.get("signorini-version"), version, "the version of the service")
    equal(server.json("/v1/info")["version"], version, "the version in /v1/info")
    equal(server.call("GET", "/livez").status, 200, "a probe")
    job = server.call("GET", "/v1/jobs").json()["jobs"][0]
    later = json.dumps({**job, "status": "hibernating"}).encode()
    more = json.dumps({**job, "colour": "of a later version"}).encode()
    refusal = json.dumps({"status": 400, "code": "unknown-parameter", "title": "Unknown parameter", "detail": "no parameter x"}).encode()
    for status, body, headers, told in (
        (200, later, {"signorini_version": "9.9.9"}, ("9.9.9", version)),
        (200, later, {}, ()),
        (400, refusal, {"signorini_version": "0.0.1", "content_type": "application/problem+json"}, ("no parameter x", "0.0.1", version)),
    ):
        with answering(status, body, **headers) as (address, seen):
            done = run("get", job["id"], "--url", "http://" + address)
            check(done.returncode != 0, "get from a service of another version: %r" % done)
            for part in told:
                check(part in done.stderr, "the error tells %r: %r" % (part, done.stderr))
            equal(seen[0][1].get("user-agent", seen[0][1].get("User-Agent")), "signorini/" + version, "how the command names itself")
    # what a later service says besides is no fault
    with answering(200, more, signorini_version="9.9.9") as (address, _):
        done = run("get", job["id"], "--url", "http://" + address)
        equal((done.returncode, done.stderr), (0, ""), "get from a later service that says more")


def main():
    with Server() as server:
        server.finished(server.submit(example()))
        proxies(server)
        old_protocol(server)
        other_versions(server)
        server.stop()
    with tempfile.TemporaryDirectory() as folder:
        self_signed(pathlib.Path(folder))
    print("intermediaries: %d checks" % outside.checks)


main()
