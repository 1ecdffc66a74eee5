"""The service over TLS, with certificates of a lab's own authority: curl over HTTP/1.1 and HTTP/2, gRPC, the command
`token`, certificates read again under open connections, and files that cannot be used.
"""

import os
import pathlib
import signal
import socket
import ssl
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import outside
from certificates import Authority, openssl
from outside import BINARY, Server, check, equal, example, submission
from reflected import Client


def curl(server, path, *options):
    command = ["curl", "--silent", "--show-error", "--max-time", "60", *options, server.url + path]
    return subprocess.run(command, capture_output=True, text=True)


def both_protocols(server):
    for option, version in (("--http1.1", "1.1"), ("--http2", "2")):
        done = curl(server, "/livez", option, "--cacert", server.ca, "--output", "/dev/null", "--write-out",
                    "%{http_code} %{http_version}")
        equal(done.stdout, "200 " + version, "curl %s, %r" % (option, done.stderr))
    done = curl(server, "/livez")
    equal(done.returncode, 60, "curl that does not know the authority, %r" % done)

    job = server.call("POST", "/v1/jobs", submission(example()), prefer="wait=30")
    equal((job.status, job.json()["status"]), (201, "succeeded"), "a job over TLS")
    with Client(server.address, pathlib.Path(server.ca).read_bytes()) as client:
        kinds = [event.WhichOneof("payload") for event in client.WatchJob(id=job.json()["id"])]
        equal(kinds[-1], "done", "the last event over gRPC with TLS")


def plain_text(server):
    """Who forgets the s is told."""
    host, port = server.address.split(":")
    with socket.create_connection((host, int(port)), timeout=10) as connection:
        connection.sendall(b"GET /livez HTTP/1.1\r\nhost: localhost\r\n\r\n")
        connection.settimeout(10)
        told = b"".join(iter(lambda: connection.recv(4096), b"")).decode()
    check(told.startswith("HTTP/1.1 400 ") and "https://" in told, "the answer to plain text: %r" % told)


def health(server, certificate):
    """The health check of a container has the settings of the service, and nothing else; the certificate need not name
    127.0.0.1."""
    def run(*arguments, **more):
        environment = {name: value for name, value in os.environ.items() if not name.startswith("SIGNORINI_")}
        return subprocess.run([BINARY, "health", *arguments], capture_output=True, text=True, env={**environment, **more}, timeout=30)

    listen = server.address.replace("127.0.0.1", "localhost")
    done = run(SIGNORINI_LISTEN=listen, SIGNORINI_TLS_CERT=str(certificate))
    equal((done.returncode, done.stdout), (0, "ok\n"), "health with the settings of a service with TLS, %r" % done)
    done = run("--url", "https://" + listen, "--ca", server.ca)
    equal(done.returncode, 0, "health of a service that is named, %r" % done)
    for empty in ({}, {"SIGNORINI_TLS_CERT": ""}):
        done = run(SIGNORINI_LISTEN=listen, **empty)
        check(done.returncode == 1 and "use https" in done.stderr, "health in plain text, %r" % done)


def serial(server):
    """Which certificate it shows now."""
    host, port = server.address.split(":")
    trusted = ssl.create_default_context(cafile=server.ca)
    with socket.create_connection((host, int(port)), timeout=10) as connection:
        with trusted.wrap_socket(connection, server_hostname="localhost") as encrypted:
            return encrypted.getpeercert()["serialNumber"]


def reload(server, what):
    """SIGHUP; returns what the log says of it."""
    before = len(server.log.read_text())
    server.process.send_signal(signal.SIGHUP)
    end = time.monotonic() + 10
    while "SIGHUP" not in (told := server.log.read_text()[before:]):
        check(time.monotonic() < end, "nothing in the log after SIGHUP: " + what)
        time.sleep(0.02)
    return told


def read_again(server, authority, used):
    """New certificates under an open connection and an open stream."""
    server.call("POST", "/v1/queue/pause")
    job = server.submit(example())
    stream = server.connection()
    stream.request("GET", "/v1/jobs/%s/events" % job)
    events = stream.getresponse()
    kept = server.connection()
    kept.request("GET", "/livez")
    kept.getresponse().read()

    first = serial(server)
    renewed = authority.issue("renewed", key=("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256"))
    # one file after the other: in between they do not match
    os.replace(renewed.cert, used.cert)
    told = reload(server, "the pair does not match")
    check("is not that of the first certificate" in told and "remains in use" in told, "a pair that does not match: " + told)
    equal(serial(server), first, "the certificate after a pair that does not match")
    os.replace(renewed.key, used.key)
    check("was read again" in reload(server, "renewed"), "the log after a reload")
    second = serial(server)
    check(second != first, "the certificate is still the first one")

    for bad, says in (
        (authority.issue("expired", at="30 days ago"), "expires 20"),
        (authority.issue("early", at="30 days"), "is not valid before 20"),
        (authority.issue("never", days=-1), "ends before it begins"),
    ):
        for source, kind in ((bad.cert, "cert"), (bad.key, "key")):
            os.replace(source, getattr(used, kind))
        told = reload(server, says)
        check(says in told and "remains in use" in told, "a certificate at the wrong time: " + told)
    used.key.unlink()
    check("cannot be read" in reload(server, "no key"), "a missing key")
    equal(serial(server), second, "the certificate after bad ones")

    kept.request("GET", "/livez")
    equal(kept.getresponse().status, 200, "a request on a connection from before")
    server.call("POST", "/v1/queue/resume")
    check(b"event: done" in events.read(), "the stream from before ends with the job")


def refused(authority, folder):
    """Files that cannot be used: exit 2, and what to do."""
    good, other = authority.issue("good"), authority.issue("other")
    empty, encrypted, big = folder / "empty.pem", folder / "encrypted.key", folder / "big.pem"
    empty.write_text("")
    openssl("pkey", "-in", good.key, "-aes128", "-passout", "pass:secret", "-out", encrypted)
    with big.open("wb") as file:
        file.truncate(3 << 30)
    for cert, key, told in (
        (good.cert, None, "--tls-key"),
        (None, good.key, "--tls-cert"),
        (good.cert, other.key, "is not that of the first certificate"),
        (good.key, good.cert, "found no certificate in"),
        (good.cert, good.cert, "found no private key in"),
        (good.cert, encrypted, "openssl pkey"),
        (empty, good.key, "found no certificate in"),
        (folder / "none.pem", good.key, "cannot be read"),
        (folder, good.key, "cannot be read"),
        (big, good.key, "more than 1 MiB"),
        ("/dev/zero", good.key, "more than 1 MiB"),
    ):
        options = [*(("--tls-cert", cert) if cert else ()), *(("--tls-key", key) if key else ())]
        command = [BINARY, "serve", "--listen", "127.0.0.1:0", "--data", folder / "unused", *options]
        done = subprocess.run(command, capture_output=True, text=True, timeout=20)
        equal(done.returncode, 2, "serve %r, %r" % (options, done.stderr))
        check(told in done.stderr, "serve %r says %r" % (options, done.stderr))
    equal((folder / "unused").exists(), False, "a store was made in vain")
    # the rule about open addresses does not change with TLS: that is no identification
    command = [BINARY, "serve", "--listen", "0.0.0.0:0", "--data", folder / "open", *good.options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20)
    check(done.returncode == 2 and "there is no token" in done.stderr, "TLS without tokens: %r" % done)




def token(server):
    """`signorini token` over TLS."""
    def run(*arguments, **more):
        environment = {**os.environ, "SIGNORINI_URL": server.url, **more}
        return subprocess.run([BINARY, "token", *arguments], capture_output=True, text=True, env=environment, timeout=30)

    ca = ("--ca", server.ca)
    made = run("create", "--name", "first", "--owner", "root", "--scope", "admin", *ca)
    equal(made.returncode, 0, "token create over TLS, %r" % made)
    listed = run("list", SIGNORINI_TOKEN=made.stdout.strip(), SIGNORINI_CA=server.ca)
    check(listed.returncode == 0 and "first" in listed.stdout, "token list over TLS, %r" % listed)
    unknown = run("list")
    check(unknown.returncode == 5 and "cannot reach" in unknown.stderr, "an authority that is not known, %r" % unknown)
    missing = run("list", "--ca", "/nonexistent")
    check("cannot be read" in missing.stderr, "an authority without a file, %r" % missing)
    wrong = run("list", "--ca", "/dev/null")
    check("found no certificate" in wrong.stderr, "an empty authority, %r" % wrong)
    print(unknown.stderr, end="")


def main():
    with tempfile.TemporaryDirectory() as text:
        folder = pathlib.Path(text)
        authority = Authority(folder)
        used = authority.issue("service")
        with Server(*used.options, ca=str(authority.file)) as server:
            both_protocols(server)
            plain_text(server)
            health(server, used.cert)
            read_again(server, authority, used)
            token(server)
            server.stop()
        refused(authority, folder)
    print("TLS: %d checks" % outside.checks)


main()
