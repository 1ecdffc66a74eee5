"""Behind nginx and Caddy, with the very configurations of contrib: events arrive as they happen, streams resume, large
uploads pass through, gRPC works, long waits are not cut, and links lead back.

    proxy.py [--soak]

Only names, ports and the files of the certificate are replaced in the configurations.
"""

import contextlib
import datetime
import hashlib
import http.client
import json
import os
import pathlib
import shutil
import socket
import ssl
import subprocess
import sys
import tempfile
import time

from attack import MIB, SOAK, check, equal, example
from outside import BINARY, Server, free_port, memory, submission, talkative

TOP = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(TOP / "tests/clients"))
from certificates import Authority
from reflected import Client

SIZE = (512 if SOAK else 64) * MIB
WAIT_S = 60 if SOAK else 3
LATE_S = 0.5
PREFIX = "/signorini"


def replaced(name, pairs):
    text = (TOP / "contrib" / name).read_text()
    for old, new in pairs:
        check(old in text, "contrib/%s has no %r" % (name, old))
        text = text.replace(old, new)
    return text


@contextlib.contextmanager
def running(command, port, log, **more):
    with log.open("w") as out:
        process = subprocess.Popen(command, stdout=out, stderr=out, **more)
    try:
        end = time.monotonic() + 20
        while True:
            check(process.poll() is None and time.monotonic() < end, "%s: %s" % (command, log.read_text()))
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
                break
            time.sleep(0.05)
        yield process
    finally:
        process.terminate()
        process.wait(10)


def nginx(folder, server, issued):
    port = free_port()
    site = replaced("nginx.conf", [
        ("127.0.0.1:8080;", server.address + ";"), ("listen 443 ", "listen 127.0.0.1:%d " % port),
        ("lab.example", "localhost"), ("/etc/ssl/signorini/cert.pem", str(issued.cert)),
        ("/etc/ssl/signorini/key.pem", str(issued.key)),
    ])
    places = "".join("    %s_temp_path %s;\n" % (kind, folder / kind) for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi"))
    main = "pid %s;\nerror_log stderr;\ndaemon off;\nworker_processes 1;\n%sevents {}\nhttp {\n    access_log off;\n%s%s}\n" % (
        folder / "pid", "user root;\n" if os.geteuid() == 0 else "", places, site)
    (folder / "nginx.conf").write_text(main)
    return port, running([shutil.which("nginx") or "/usr/sbin/nginx", "-c", folder / "nginx.conf", "-p", folder], port, folder / "nginx.log")


def caddy(folder, server, issued):
    port = free_port()
    site = replaced("Caddyfile", [
        ("\nlab.example {\n", "\n{\n\tadmin off\n\tauto_https disable_redirects\n\tskip_install_trust\n}\nlocalhost:%d {\n\ttls %s %s\n" % (port, issued.cert, issued.key)),
        ("127.0.0.1:8080 {", server.address + " {"),
    ])
    (folder / "Caddyfile").write_text(site)
    environment = {**os.environ, "XDG_DATA_HOME": str(folder), "XDG_CONFIG_HOME": str(folder), "HOME": str(folder)}
    command = ["caddy", "run", "--adapter", "caddyfile", "--config", folder / "Caddyfile"]
    return port, running(command, port, folder / "caddy.log", env=environment)


class Through:
    """A client of the proxy."""

    def __init__(self, port, ca):
        self.port, self.trusted = port, ssl.create_default_context(cafile=ca)

    def connection(self):
        return http.client.HTTPSConnection("localhost", self.port, timeout=120, context=self.trusted)

    def call(self, method, path, body=None, **headers):
        connection = self.connection()
        if body is not None:
            headers.setdefault("content_type", "application/json")
        connection.request(method, path, body, {name.replace("_", "-"): value for name, value in headers.items()})
        answer = connection.getresponse()
        return answer, answer.read()


def events(client, job, after=0, most=None):
    """Numbers of the events that arrive, and the longest time that one was on its way."""
    connection = client.connection()
    connection.request("GET", "/v1/jobs/%s/events" % job, headers={"last-event-id": str(after)})
    answer = connection.getresponse()
    seen, latest = [], 0.0
    for line in answer:
        if line.startswith(b"data: "):
            event = json.loads(line[6:])
            written = datetime.datetime.fromisoformat(event["t"].replace("Z", "+00:00")).timestamp()
            latest = max(latest, time.time() - written)
            seen.append(event["seq"])
            if most and len(seen) >= most:
                break
    connection.close()
    return seen, latest


def streams(client):
    job = json.loads(client.call("POST", "/v1/jobs", submission(talkative(60, refine=2)))[1])["id"]
    first, late = events(client, job, most=20)
    check(late <= LATE_S, "an event arrived %.2f s after it was written" % late)
    rest, _ = events(client, job, after=first[-1])
    equal(first + rest, list(range(1, len(first + rest) + 1)), "the events of a stream that was resumed")
    return late


def upload(client, server, proxy, folder):
    """A mesh file of this size, mostly comments; and what it costs the proxy."""
    mesh = (TOP / "tests/data/gmsh" / MESH).read_bytes()
    line = b"# " + b"x" * 61 + b"\n"
    begin, end = b"$Comments\n", b"$EndComments\n"
    count = (SIZE - len(mesh) - len(begin) - len(end)) // len(line)
    block = line * 1024
    digest = hashlib.sha256()

    def pieces():
        left = count
        for piece in (mesh, begin):
            yield piece
        while left > 0:
            yield block[:min(left, 1024) * len(line)]
            left -= 1024
        yield end

    length = len(mesh) + len(begin) + count * len(line) + len(end)
    most, stored = [0], [0]

    def watched():
        for number, piece in enumerate(pieces()):
            digest.update(piece)
            if number % 200 == 0:
                children = pathlib.Path("/proc/%d/task/%d/children" % (proxy.pid, proxy.pid)).read_text().split()
                most[0] = max(most[0], *(memory(int(pid)) for pid in [proxy.pid, *children]))
                stored[0] = max(stored[0], sum(file.stat().st_size for file in (folder / "client_body").rglob("*") if file.is_file()))
            yield piece

    connection = client.connection()
    connection.request("POST", "/v1/meshes", watched(), {"content-length": str(length)})
    answer = connection.getresponse()
    told = json.loads(answer.read())
    equal(answer.status, 201, "an upload of %d MiB, %r" % (length // MIB, told))
    equal(told["hash"], "sha256:" + digest.hexdigest(), "the hash of what has arrived")
    check(most[0] < 200 * MIB and stored[0] < MIB, "the proxy took %d MiB of memory and %d MiB of disk" % (most[0] // MIB, stored[0] // MIB))
    server.call("DELETE", "/v1/meshes/" + told["hash"])
    return length


def rpcs(port, ca, job):
    with Client("localhost:%d" % port, pathlib.Path(ca).read_bytes()) as client:
        equal(client.GetJob(id=job).id, job, "GetJob")
        kinds = [event.WhichOneof("payload") for event in client.WatchJob(id=job)]
        equal(kinds[-1], "done", "the last event over gRPC")


def waits(client, server):
    server.call("POST", "/v1/queue/pause")
    job = server.submit(example())
    began = time.monotonic()
    answer, _ = client.call("GET", "/v1/jobs/%s?wait=%d&until=terminal" % (job, WAIT_S))
    took = time.monotonic() - began
    check(answer.status == 200 and took >= WAIT_S - 0.5, "a wait of %d s was answered %d after %.1f s" % (WAIT_S, answer.status, took))
    server.call("POST", "/v1/queue/resume")
    server.finished(job)
    return took


def links(client, port):
    """Below a path, as clients see it: every link of a job leads somewhere, through the proxy."""
    answer, body = client.call("POST", PREFIX + "/v1/jobs", submission(example()), prefer="wait=30")
    job = json.loads(body)
    equal((answer.status, answer.headers["location"]), (201, "%s/v1/jobs/%s" % (PREFIX, job["id"])), "Location")
    for name, link in job["links"].items():
        check(link.startswith(PREFIX + "/"), "the link %s is %s" % (name, link))
        if name != "cancel":
            link = link.replace("{boundary}", "top")
            equal(client.call("GET", link)[0].status, 200, "the link %s, %s" % (name, link))
    equal(sorted(name for name in job["links"] if name.startswith("plot_")),
          ["plot_convergence", "plot_deformed", "plot_mesh", "plot_profile"], "plots of a job that has succeeded")
    description = json.loads(client.call("GET", PREFIX + "/openapi.json")[1])
    equal(description["servers"], [{"url": PREFIX + "/"}], "the servers of the description")
    page = client.call("GET", PREFIX + "/docs")[1].decode()
    for address in ("docs/swagger-ui.css", "docs/start.js", "openapi.json"):
        check('"%s"' % address in page or address == "openapi.json", "the page names %s" % address)
        equal(client.call("GET", "%s/%s" % (PREFIX, address))[0].status, 200, address)
    answer, body = client.call("GET", PREFIX + "/v1/jobs/none")
    equal((answer.status, json.loads(body)["instance"]), (404, PREFIX + "/v1/jobs/none"), "the instance of an error")
    # a page of the proxy's own origin, and one of another
    for origin, status in (("https://localhost:%d" % port, 200), ("https://evil.example", 403)):
        equal(client.call("GET", "/v1/info", origin=origin)[0].status, status, "a page of " + origin)
    return job["id"]


def policy():
    """The path in front changes nothing of who may do what."""
    with Server("--path-prefix", PREFIX) as server:
        def token(scope):
            command = [BINARY, "token", "create", "--name", scope, "--owner", "ada", "--scope", scope, "--url", server.url]
            environment = {**os.environ, **({"SIGNORINI_TOKEN": made[0]} if made else {})}
            return subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout.strip()

        made = []
        made.append(token("admin"))
        reader = {"authorization": "Bearer " + token("read")}
        for method, path, without, with_read in (
            ("GET", "/v1/jobs", 401, 200), ("POST", "/v1/queue/pause", 401, 403), ("GET", "/openapi.json", 401, 200),
            ("GET", "/livez", 200, 200), ("GET", PREFIX + "/v1/jobs", 404, 404),
        ):
            equal(server.call(method, PREFIX + path).status, without, "%s %s below the path, without a token" % (method, path))
            equal(server.call(method, PREFIX + path, **reader).status, with_read, "%s %s below the path, to read" % (method, path))


MESH = "fillet-quad8-msh41-ascii.msh"


def main():
    policy()
    told = []
    with tempfile.TemporaryDirectory() as text:
        folder = pathlib.Path(text)
        folder.chmod(0o755)
        authority = Authority(folder)
        issued = authority.issue("proxy")
        for start in (nginx, caddy):
            name = start.__name__
            with Server("--path-prefix", PREFIX, "--max-mesh-bytes", str(512 * MIB)) as server:
                port, proxy = start(folder, server, issued)
                with proxy as process:
                    client = Through(port, str(authority.file))
                    job = links(client, port)
                    late = streams(client)
                    rpcs(port, authority.file, job)
                    size = upload(client, server, process, folder)
                    took = waits(client, server)
                server.stop()
            told.append("%s: events within %.0f ms, %d MiB uploaded, a wait of %.0f s" % (name, 1e3 * late, size // MIB, took))
            print(told[-1])
    print("figure: " + "; ".join(told))


main()
