"""The service is killed as by a power cut, and starts again, while a client waits and while it follows events."""

from __future__ import annotations

import pathlib
import subprocess
import threading

import pytest
from conftest import long_problem

import signorini as sg


def test_waiting_and_following_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    server = sg.LocalServer(workers=1)
    server.start()
    try:
        with sg.Client(server.url) as follower, sg.Client(server.url) as waiter:
            job = follower.submit(long_problem(1500), cache="off", name="survivor")
            results: list[sg.Result] = []
            waiting = threading.Thread(target=lambda: results.append(waiter.job(job.id).wait(60, progress=False)))
            waiting.start()
            seen: list[sg.Event] = []
            restarted = refused = 0
            pause = threading.Event().wait  # a pause that this test does not replace

            def start_then_pause(seconds: float) -> None:
                # the first pause: the connection broke. Only the second attempt finds the service again.
                nonlocal refused, restarted
                refused += 1
                if restarted == 0 and refused >= 2:
                    restarted += 1
                    server.start()
                pause(seconds)

            lock = threading.Lock()

            def in_turn(seconds: float) -> None:
                with lock:
                    start_then_pause(seconds)

            for event in job.events():
                seen.append(event)
                if event.type == "iteration" and event["k"] == 200 and not refused:
                    monkeypatch.setattr("time.sleep", in_turn)
                    server.kill()
            waiting.join(60)
            assert restarted == 1 and refused >= 2
            assert [event.seq for event in seen] == list(range(1, len(seen) + 1)), "nothing is missing or repeated"
            assert [event.type for event in seen].count("done") == 1 and seen[-1].type == "done"
            assert {event.attempt for event in seen} >= {1, 2}, "it ran once before the kill and once after"
            assert seen == list(sg.Client(server.url).job(job.id).events()), "what was seen is what is stored"
            (result,) = results
            assert result.converged and len(result.history) == result.summary["iterations"]
    finally:
        server.stop()


def test_a_service_of_ones_own_stops_with_the_client(tmp_path_factory: pytest.TempPathFactory) -> None:
    data = tmp_path_factory.mktemp("own") / "data"
    with sg.Client.local(data, workers=1, options=["--log", "warn"]) as client:
        job = client.submit(sg.examples.rectangular_punch(refine=0))
        force = job.wait(60).normal_force
        assert "The job goes on" in job._back()
    with pytest.raises(RuntimeError):
        client.info()
    with sg.Client.local(data) as client:
        assert client.job(job.id).result().normal_force == force
        url = client.url
    with sg.Client(url, retry_for=0) as other, pytest.raises(sg.ConnectionLost):
        other.info()
    with sg.Client.local() as client:
        assert "lost when this program ends" in client.submit(sg.examples.sheet(refine=0))._back()
        assert client._server is not None
        temporary = client._server.data
        assert temporary.exists()
    assert not temporary.exists()


def test_a_service_of_ones_own_needs_no_token(monkeypatch: pytest.MonkeyPatch) -> None:
    # that of another service, which a service without tokens would refuse
    monkeypatch.setenv("SIGNORINI_TOKEN", "of_the_lab")
    with sg.Client.local() as client:
        assert client.me()["owner"] == "local"
        sweep = client.sweep(long_problem(10_000), {"contacts.0.friction.coefficient": [0.1, 0.2]})
        with pytest.raises(sg.WaitTimeout, match="The sweep is lost when this program ends"):
            sweep.wait(timeout=0, progress=False)


def test_a_certificate_of_ones_own_authority(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    command = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=lab".split()
    command += ["-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(key), "-out", str(certificate)]
    subprocess.run(command, check=True, capture_output=True)
    server = sg.LocalServer(options=["--tls-cert", str(certificate), "--tls-key", str(key)])
    try:
        url = server.start()
        with sg.Client(url, ca=certificate) as client:
            assert client.info()["name"] == "signorini"
        # not tried for a minute: it would never be trusted
        with sg.Client(url) as client, pytest.raises(sg.ConnectionLost, match="cannot be called: .*certificate"):
            client.info()
        monkeypatch.setenv("SIGNORINI_CA", str(certificate))
        with sg.Client(url) as client:
            assert client.info()["name"] == "signorini"
    finally:
        server.stop()


def test_a_service_that_does_not_start_says_why(tmp_path_factory: pytest.TempPathFactory) -> None:
    with pytest.raises(sg.SignoriniError, match=r"did not start \(exit code 2\)"):
        sg.LocalServer(options=["--bogus"]).start()
    with pytest.raises(sg.SignoriniError, match="there is no program '/no/such/program'"):
        sg.LocalServer(binary="/no/such/program")


def test_the_program_of_the_environment_comes_before_that_in_path(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    programs = {name: tmp_path / name / "signorini" for name in ("environment", "path", "named")}
    for program in programs.values():
        program.parent.mkdir()
        program.write_text("#!/bin/sh\n")
        program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path / "path"))
    monkeypatch.setattr("sysconfig.get_path", lambda _: str(tmp_path / "environment"))
    # this one wins over all that are found
    monkeypatch.setenv("SIGNORINI_BINARY", str(programs["named"]))
    assert sg.LocalServer().binary == str(programs["named"])
    monkeypatch.delenv("SIGNORINI_BINARY")
    assert sg.LocalServer().binary == str(programs["environment"])
    programs["environment"].unlink()
    assert sg.LocalServer().binary == str(programs["path"])
    programs["path"].unlink()
    with pytest.raises(sg.SignoriniError, match="the client alone. Install the wheel that has both"):
        sg.LocalServer()
