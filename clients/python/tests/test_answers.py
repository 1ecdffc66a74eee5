"""What is not the service's answer, or not all of it, is never taken for it."""

from __future__ import annotations

import asyncio
import base64
import functools
import hashlib
import json
import pathlib
import socket
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

import pytest
from peers import answer, answering, halving, listening, relay_that_loses, request

import signorini as sg
from signorini.sweep import SweepMember

JOB = {
    "id": "job_1", "status": "succeeded", "name": None, "result_available": "final", "input_hash": "sha256:1",
    "finished_at": "2026-01-01T00:00:00Z",
}  # fmt: skip
CONTACT: dict[str, Any] = {
    **dict.fromkeys(("normal_force", "tangential_force", "friction_force"), 1.0),
    "contact": [], "stick": [], "slip": [], "peak_normal_stress": None, "peak_tangential_stress": None,
}  # fmt: skip
SUMMARY = {"outcome": "converged", "converged": True, "contacts": {"top": CONTACT}, "iterations": 1, "dofs": 2}
SWEEP = {"id": "sweep_1", "status": "succeeded", "paths": ["/a"], "members": {"total": 1}, "finished_at": None}
PROBLEM = sg.examples.sheet(refine=0)

FOREIGN = {
    "a page": answer("200 OK", "text/html", b"<html>Please log in</html>"),
    "another page": answer("201 Created", "text/plain", b"hello"),
    "a redirect": answer("302 Found", "text/html", b"", Location="https://login.example/"),
    "a moved page": answer("301 Moved Permanently", "", b"", Location="https://login.example/"),
    "nothing": answer("204 No Content"),
    "other JSON": answer("200 OK", "application/json", b'{"ok": true}'),
    "a list": answer("200 OK", "application/json", b"[]"),
    "an image": answer("200 OK", "image/gif", b"GIF89a"),
}


def everything(client: sg.Client, folder: pathlib.Path) -> dict[str, Callable[[], Any]]:
    """All that a client can ask, by name."""
    job = sg.Job(client, JOB)
    result = sg.Result(client, job, {"summary": SUMMARY, "result_available": "final"})
    sweep = sg.Sweep(client, SWEEP)
    member = SweepMember(sweep, {"number": 0, "status": "succeeded", "parameters": {}})
    return {
        "submit": lambda: client.submit(PROBLEM),
        "submit_many": lambda: client.submit_many([PROBLEM]),
        "job": lambda: client.job("job_1"),
        "jobs": lambda: list(client.jobs()),
        "cancel_jobs": lambda: client.cancel_jobs(name="x"),
        "delete_jobs": lambda: client.delete_jobs(name="x"),
        "validate": lambda: client.validate(PROBLEM),
        "sweep": lambda: client.sweep("sweep_1"),
        "new sweep": lambda: client.sweep(PROBLEM, {"title": ["a", "b"]}),
        "sweeps": lambda: list(client.sweeps()),
        "upload_mesh": lambda: client.upload_mesh(b"mesh"),
        "mesh": lambda: client.mesh("sha256:1"),
        "meshes": lambda: list(client.meshes()),
        "delete_mesh": lambda: client.delete_mesh("sha256:1"),
        "refresh": job.refresh,
        "events": lambda: list(job.events()),
        "cancel": job.cancel,
        "retry": job.retry,
        "edit": lambda: job.edit(name="x"),
        "delete": job.delete,
        "problem": job.problem,
        "result": job.result,
        "svg": lambda: job.svg("mesh"),
        "save_figure .svg": lambda: job.save_figure(folder / "a.svg"),
        "save_figure .png": lambda: job.save_figure(folder / "a.png"),
        "save_figure .pdf": lambda: job.save_figure(folder / "a.pdf"),
        "profile": result.profile,
        "history": lambda: result.history,
        "fields": result.fields,
        "save_vtu": lambda: result.save_vtu(folder / "a.vtu"),
        "sweep.refresh": sweep.refresh,
        "sweep.events": lambda: list(sweep.events()),
        "sweep.table": sweep.table,
        "sweep.members": lambda: list(sweep.members()),
        "sweep.cancel": sweep.cancel,
        "sweep.delete": sweep.delete,
        "member.job": member.job,
        "count": client.count,
        "info": client.info,
        "me": client.me,
        "queue": client.queue,
        "pause_queue": client.pause_queue,
        "resume_queue": client.resume_queue,
        "explain": lambda: client.explain("not-found"),
    }


@pytest.mark.parametrize("foreign", FOREIGN)
def test_what_something_else_answers_is_no_success(foreign: str, tmp_path: pathlib.Path) -> None:
    with listening(answering(FOREIGN[foreign])) as url, sg.Client(url, retry_for=0.2) as client:
        for name, ask in everything(client, tmp_path).items():
            with pytest.raises(sg.UnexpectedAnswer, match="is not answered as by the service"):
                raise AssertionError(f"{name} returned {ask()!r}")
    assert not list(tmp_path.iterdir()), "a file was written"


def test_the_same_with_asyncio(tmp_path: pathlib.Path) -> None:
    async def run(url: str) -> None:
        async with sg.AsyncClient(url, retry_for=0.2) as client:
            job = sg.AsyncJob(client, JOB)
            result = sg.AsyncResult(client, job, {"summary": SUMMARY, "result_available": "final"})
            works: list[Awaitable[Any]] = [
                client.submit(PROBLEM), client.info(), job.refresh(), job.delete(), job.result(), job.svg("mesh"),
                job.save_figure(tmp_path / "a.png"), result.profile(), result.save_vtu(tmp_path / "a.vtu"),
                anext(job.events()),
            ]  # fmt: skip
            for work in works:
                with pytest.raises(sg.UnexpectedAnswer):
                    await work

    for foreign in ("a page", "a redirect", "nothing"):
        with listening(answering(FOREIGN[foreign])) as url:
            asyncio.run(run(url))
    assert not list(tmp_path.iterdir())


def test_an_answer_about_something_else_is_refused(tmp_path: pathlib.Path) -> None:
    other = json.dumps({**JOB, "id": "job_2", "parent": "job_3", "job": {"id": "job_2"}}).encode()
    with listening(answering(answer("200 OK", "application/json", other))) as url, sg.Client(url) as client:
        job = sg.Job(client, JOB)
        asks: list[Callable[[], Any]] = [lambda: client.job("job_1"), lambda: job.edit(name="x")]
        for ask in [*asks, job.refresh, job.cancel, job.retry]:
            with pytest.raises(sg.UnexpectedAnswer, match="not job_1"):
                ask()
        with pytest.raises(sg.UnexpectedAnswer, match="not sweep_1"):
            client.sweep("sweep_1")
    solved = json.dumps({"summary": {**SUMMARY, "input_hash": "sha256:2"}, "result_available": "final"}).encode()
    with listening(answering(answer("200 OK", "application/json", solved))) as url, sg.Client(url) as client:
        with pytest.raises(sg.UnexpectedAnswer, match="of the problem sha256:2, not sha256:1"):
            sg.Job(client, JOB).result()
    figure = answer("200 OK", "image/svg+xml", b"<svg></svg>", Content_Disposition='inline; filename="job_2.mesh.svg"')
    with listening(answering(figure)) as url, sg.Client(url) as client:
        with pytest.raises(sg.UnexpectedAnswer, match="it is about job_2"):
            sg.Job(client, JOB).svg("mesh")
    done = b'data: {"seq": 1, "type": "done", "job": {"id": "job_2"}}\n\n'
    with listening(answering(answer("200 OK", "text/event-stream", done))) as url, sg.Client(url) as client:
        with pytest.raises(sg.UnexpectedAnswer, match="this event is not of job_1"):
            list(sg.Job(client, JOB).events())
    broken = answer("200 OK", "text/event-stream", b"data: what?\n\n")
    with listening(answering(broken)) as url, sg.Client(url) as client:
        with pytest.raises(sg.UnexpectedAnswer, match="no event of the service: 'what\\?'"):
            list(sg.Job(client, JOB).events())


def test_half_an_answer_is_none(server: sg.LocalServer, punch: sg.Result, tmp_path: pathlib.Path) -> None:
    def asks(client: sg.Client) -> Sequence[Callable[[], Any]]:
        job = sg.Job(client, punch.job.document)
        result = sg.Result(client, job, {"summary": punch.summary, "result_available": "final"})
        paths = [tmp_path / f"a.{end}" for end in ("svg", "png", "pdf")]
        saved: list[Callable[[], Any]] = [functools.partial(job.save_figure, path) for path in paths]
        drawn: list[Callable[[], Any]] = [lambda: result.save_vtu(tmp_path / "a.vtu"), lambda: job.svg("mesh")]
        return [*saved, *drawn, result.profile, result.fields, lambda: result.history, job.refresh, job.result]

    for share in (0.0, 0.01, 0.5, 0.95):
        with listening(halving(server.url, share)) as url, sg.Client(url, retry_for=0.1) as client:
            for number, ask in enumerate(asks(client)):
                with pytest.raises(sg.ConnectionLost, match="not whole|complete"):
                    raise AssertionError(f"{share} of {number} returned {ask()!r}")
    assert not list(tmp_path.iterdir())
    # the same proxy while all is well
    with listening(halving(server.url, 1.0)) as url, sg.Client(url, retry_for=0.1) as client:
        for ask in asks(client):
            ask()
    assert len(list(tmp_path.iterdir())) == 4


def test_a_changed_byte_is_seen_and_another_attempt_made() -> None:
    content = b"<svg>right</svg>"
    digest = base64.b64encode(hashlib.sha256(content).digest()).decode()
    answers = [b"<svg>wrong</svg>", content]
    asked: list[bytes] = []

    def handler(connection: socket.socket) -> None:
        while head := request(connection)[0]:
            body = answers[len(asked)]
            asked.append(head)
            connection.sendall(answer("200 OK", "image/svg+xml", body, Content_Digest=f"sha-256=:{digest}:"))

    with listening(handler) as url, sg.Client(url) as client:
        assert sg.Job(client, JOB).svg("mesh") == content.decode()
    assert len(asked) == 2 and all(b"accept-encoding: identity" in head.lower() for head in asked)


def test_a_deletion_whose_answer_is_lost_is_counted(server: sg.LocalServer, client: sg.Client) -> None:
    labels = {"lost": "answer"}
    for job in client.submit_many([sg.Submission(PROBLEM, "old", labels) for _ in range(5)]):
        job.wait(60, progress=False)
    with relay_that_loses(server.url, b"DELETE") as url, sg.Client(url, retry_for=10) as unlucky:
        assert unlucky.delete_jobs(labels=labels) == {"matched": 5, "changed": 5}
    assert client.count(labels=labels)["total"] == 0

    async def again() -> None:
        for job in client.submit_many([sg.Submission(PROBLEM, "old", labels) for _ in range(3)]):
            job.wait(60, progress=False)
        with relay_that_loses(server.url, b"DELETE") as url:
            async with sg.AsyncClient(url, retry_for=10) as unlucky:
                assert (await unlucky.delete_jobs(labels=labels))["changed"] == 3

    asyncio.run(again())
    # the same of one thing: it is gone, as was asked
    job = client.submit(PROBLEM)
    job.wait(60, progress=False)
    sweep = client.sweep(PROBLEM, {"contacts.0.indentation": [0.01, 0.02]}).wait(60, progress=False)
    inline = sg.problem.InlineMesh(
        nodes=[[0, 0], [2, 0], [2, 1], [0, 1], [1, 0], [2, 0.5], [1, 1], [0, 0.5]], elements=[[0, 1, 2, 3, 4, 5, 6, 7]]
    )
    mesh = client.upload_mesh(sg.problem.MeshInput(inline=inline))
    acts: list[Callable[[sg.Client], object]] = [
        lambda unlucky: unlucky.job(job.id).delete(),
        lambda unlucky: unlucky.sweep(sweep.id).delete(),
        lambda unlucky: unlucky.delete_mesh(mesh.hash),
    ]
    for act in acts:
        with relay_that_loses(server.url, b"DELETE") as url, sg.Client(url, retry_for=10) as unlucky:
            act(unlucky)
    for gone in (job.refresh, sweep.refresh, lambda: client.mesh(mesh.hash)):
        with pytest.raises(sg.NotFound):
            gone()


def test_a_closed_client_says_so(server: sg.LocalServer) -> None:
    client = sg.Client(server.url)
    client.info()
    client.close()
    with pytest.raises(RuntimeError, match="this client is closed"):
        client.info()

    async def run() -> None:
        twin = sg.AsyncClient(server.url)
        await twin.info()
        await twin.aclose()
        with pytest.raises(RuntimeError, match="this client is closed"):
            await twin.info()

    asyncio.run(run())
