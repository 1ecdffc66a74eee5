"""The client with asyncio: the same names, and the same behaviour."""

from __future__ import annotations

import asyncio
import inspect
import pathlib

import pytest
from conftest import long_problem, unconverged_problem

import signorini as sg

PUNCH = sg.examples.rectangular_punch(refine=0)


def public(cls: type) -> set[str]:
    return {name for name in dir(cls) if not name.startswith("_")}


def test_both_clients_have_the_same_names() -> None:
    assert public(sg.Client) - {"close"} == public(sg.AsyncClient) - {"aclose"}
    assert public(sg.Job) == public(sg.AsyncJob)
    assert public(sg.Sweep) == public(sg.AsyncSweep)
    assert public(sg.Result) == public(sg.AsyncResult)
    for name in ("submit", "sweep", "upload_mesh"):
        ours, twin = (inspect.signature(getattr(cls, name)) for cls in (sg.Client, sg.AsyncClient))
        assert list(ours.parameters.values()) == list(twin.parameters.values()), name


def test_jobs(server: sg.LocalServer, punch: sg.Result, tmp_path: pathlib.Path) -> None:
    async def run() -> None:
        async with sg.AsyncClient(server.url) as client:
            assert repr(client) == f"<AsyncClient {server.url}>"
            job = await client.submit(PUNCH, name="async", labels={"twin": "yes"})
            result = await job.wait(60)
            assert result.normal_force == punch.normal_force and "normal force" in result._repr_html_()
            assert [event.type async for event in job.events()][-1] == "done"
            assert (await result.profile()).s[-1] == pytest.approx(punch.profile().s[-1])
            assert len(await result.history()) == len(punch.history)
            assert len((await result.fields()).points) == len(punch.fields().points)
            assert (await result.about())["verdict"] == punch.verdict
            assert (await result.save_vtu(tmp_path / "a.vtu")).stat().st_size > 1000
            assert (await result.plot_profile()).axes
            assert "<svg" in await job.svg("mesh")
            assert (await job.save_figure(tmp_path / "a.pdf", "mesh")).read_bytes().startswith(b"%PDF-")
            assert await job.problem() == sg.Problem.from_dict(PUNCH.to_dict(defaults=True))
            assert (await job.edit(name="edited")).name == "edited"
            again = await job.retry()
            await again.wait(60, progress=False)
            await again.delete()
            with pytest.raises(sg.Deleted):
                await again.refresh()
            assert [found.name async for found in client.jobs(labels={"twin": "yes"}, page_size=1)] == ["edited"]
            assert (await client.count(labels={"twin": "yes"}))["total"] == 1
            many = await client.submit_many([PUNCH, sg.Submission(PUNCH, "b", {"twin": "b"})])
            await asyncio.gather(*(found.wait(60, progress=False) for found in many))
            assert (await client.job(many[1].id)).name == "b"
            assert (await client.cancel_jobs(labels={"twin": "b"}))["changed"] == 0
            assert (await client.delete_jobs(labels={"twin": "b"}))["changed"] == 1
            with pytest.raises(sg.InvalidProblem):
                await client.submit({"bogus": 1})
            failing = await client.submit(unconverged_problem())
            with pytest.raises(sg.JobFailed):
                await failing.wait(60, progress=False)
            last = await failing.result(partial=True)
            assert last.partial and (await last.profile()).partial and (await last.history()).partial
            assert (await last.fields()).partial
            with pytest.raises(sg.PartialResult):
                await failing.svg("profile")
            assert "PARTIAL" in await failing.svg("profile", partial=True)
            table = await client.table(["id", "status"], status="failed", page_size=1)
            assert failing.id in table["id"] and set(table["status"]) == {"failed"}

    asyncio.run(run())


def test_leaving_and_canceling(server: sg.LocalServer, capsys: pytest.CaptureFixture[str]) -> None:
    async def run() -> None:
        async with sg.AsyncClient(server.url) as client:
            job = await client.submit(long_problem(10_000), cache="off", name="long")
            with pytest.raises(sg.WaitTimeout):
                await job.wait(0, progress=False)
            waiting = asyncio.create_task(job.wait())
            async for event in job.events():
                if event.type == "iteration":
                    break
            waiting.cancel()
            with pytest.raises(asyncio.CancelledError):
                await waiting
            assert "Detached. The job goes on. Come back with await (await client.job(" in capsys.readouterr().err
            with pytest.raises(sg.ResultNotReady):
                await job.result()
            await job.cancel()
            with pytest.raises(sg.JobCanceled):
                await job.wait(30, progress=False)

    asyncio.run(run())


def test_sweeps(server: sg.LocalServer, capsys: pytest.CaptureFixture[str]) -> None:
    async def run() -> None:
        async with sg.AsyncClient(server.url) as client:
            sweep = await client.sweep(PUNCH, {"contacts.0.friction.coefficient": [0.1, 0.2, 0.3]}, name="twin")
            await sweep.wait(60)
            assert len(await sweep.table()) == 3 and len(await sweep.to_pandas()) == 3
            assert (await sweep.plot("stick_width")).axes
            member = await sweep.member(2)
            assert (await (await member.job()).wait(60, progress=False)).converged
            with pytest.raises(IndexError):
                await sweep.member(3)
            assert [event.type async for event in sweep.events()] == ["member"] * 3 + ["done"]
            assert len([job async for job in sweep.jobs()]) == 1
            assert sweep.id in [found.id async for found in client.sweeps()]
            assert (await (await client.sweep(sweep.id)).refresh()).ended
            assert (await sweep.cancel()).status == "succeeded"
            await sweep.delete()
            with pytest.raises(TypeError):
                await client.sweep(PUNCH)
            long = await client.sweep(long_problem(10_000), {"contacts.0.friction.coefficient": [0.1, 0.2]})
            waiting = asyncio.create_task(long.wait())
            async for job in long.jobs():
                async for event in job.events():
                    if event.type == "iteration":
                        break
                break
            waiting.cancel()
            with pytest.raises(asyncio.CancelledError):
                await waiting
            await long.cancel()

    asyncio.run(run())
    assert "Detached. The sweep goes on." in capsys.readouterr().err


def test_meshes_and_the_service(server: sg.LocalServer) -> None:
    async def run() -> None:
        async with sg.AsyncClient(server.url) as client:
            inline = sg.problem.InlineMesh(
                nodes=[[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5]],
                elements=[[0, 1, 2, 3, 4, 5, 6, 7]],
            )
            stored = await client.upload_mesh(sg.problem.MeshInput(inline=inline))
            assert (await client.mesh(stored.hash)).nodes == 8
            assert stored.hash in [mesh.hash async for mesh in client.meshes()]
            await client.delete_mesh(stored.hash)
            assert (await client.validate(PUNCH)).valid
            assert (await client.info())["name"] == "signorini" and (await client.me())["owner"] == "local"
            assert (await client.pause_queue())["paused"] and not (await client.resume_queue())["paused"]
            assert (await client.queue())["workers"] == 2
            assert (await client.explain("timed-out"))["title"]
            assert (await client.explain("mesh_too_coarse_for_radius"))["title"]

    asyncio.run(run())


def test_a_service_of_ones_own() -> None:
    async def run() -> None:
        async with sg.AsyncClient.local(workers=1) as client:
            assert (await client.info())["workers"] == 1

    asyncio.run(run())
