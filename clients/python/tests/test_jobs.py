"""Jobs of a real service: submit, find, wait, cancel, edit, delete, and what is refused."""

from __future__ import annotations

import datetime
import io
import pathlib
import signal
import subprocess
import sys
import types
import uuid

import numpy as np
import pytest
from conftest import BINARY, long_problem, unconverged_problem

import signorini as sg
from signorini._progress import Waiting, duration, job_line


def test_a_job_from_submission_to_result(client: sg.Client, tmp_path: pathlib.Path) -> None:
    before = datetime.datetime.now(datetime.timezone.utc) - datetime.timedelta(seconds=5)
    job = client.submit(sg.examples.rectangular_punch(refine=1), name="first", labels={"study": "a"}, priority=3)
    result = job.wait(60, progress=False)
    assert job.ended and job.status == "succeeded" and job.reason is None and job.failure is None
    assert (job.name, job.labels, job.priority, job.title) == ("first", {"study": "a"}, 3, "first")
    assert (job.owner, job.pinned, job.result_available) == ("local", False, "final")
    assert job.input_hash.startswith("sha256:") and job.run_s is not None and job.progress is not None
    assert before < job.created_at and job.finished_at is not None and job.finished_at >= job.created_at
    assert repr(job) == f"<Job {job.id} 'first' succeeded>" and str(job).startswith("first · succeeded · iteration ")
    assert result.converged and result.job is job and not result.partial
    # another machine, the next day
    again = client.job(job.id)
    assert again.result().normal_force == result.normal_force
    assert again.wait().summary["digest"] == result.summary["digest"]
    assert again.problem() == sg.Problem.from_dict(sg.examples.rectangular_punch(refine=1).to_dict(defaults=True))
    assert "<svg" in again.svg("profile", theme="dark", size="column")
    for ending, begins in ((".png", b"\x89PNG"), (".pdf", b"%PDF-")):
        path = again.save_figure(tmp_path / f"punch{ending}", "deformed", size="column")
        assert path.read_bytes().startswith(begins)
    with pytest.raises(ValueError, match=r"must end with \.svg, \.png, \.pdf"):
        again.save_figure(tmp_path / "punch.jpg")
    with pytest.raises(sg.NotFound):
        again.svg("profile", step="press")


def test_a_dictionary_will_do(client: sg.Client) -> None:
    problem = sg.examples.rectangular_punch(refine=0).to_dict()
    job = client.submit(problem, cache="off", timeout_s=60, queue_ttl_s=60)
    assert job.wait(60, progress=False).converged
    assert job.document["limits"] == {"timeout_s": 60, "queue_ttl_s": 60}
    assert [w.code for w in job.warnings] == [w.code for w in job.result().warnings]


def test_one_key_is_one_job(client: sg.Client) -> None:
    key = str(uuid.uuid4())
    jobs = [client.submit(sg.examples.sheet(refine=0), key=key) for _ in range(2)]
    assert jobs[0].id == jobs[1].id
    with pytest.raises(sg.Conflict, match="idempotency-key-reuse"):
        client.submit(sg.examples.sheet(refine=1), key=key)


def test_many_jobs_at_once(client: sg.Client) -> None:
    problems = [sg.Submission(sg.examples.rectangular_punch(mu=mu, refine=0), name=f"μ = {mu}") for mu in (0.1, 0.2)]
    jobs = client.submit_many([*problems, sg.examples.rectangular_punch(mu=0.3, refine=0)])
    assert [job.name for job in jobs] == ["μ = 0.1", "μ = 0.2", None]
    forces = [float(job.wait(60, progress=False).tangential_force) for job in jobs]
    assert forces == sorted(forces)
    with pytest.raises(ValueError, match="have one key"):
        client.submit_many([sg.Submission(sg.examples.sheet(), key="a")])


def test_lists_count_and_act_by_filter(client: sg.Client) -> None:
    label = {"batch": uuid.uuid4().hex}
    problem = sg.examples.rectangular_punch(refine=0)
    jobs = client.submit_many([sg.Submission(problem, f"job {n}", label) for n in range(5)])
    for job in jobs:
        job.wait(60, progress=False)
    found = list(client.jobs(labels=label, page_size=2))
    assert {job.id for job in found} == {job.id for job in jobs}
    assert [job.name for job in client.jobs(labels=label, name="job 3", status=["succeeded", "failed"])] == ["job 3"]
    assert not list(client.jobs(labels=label, created_after=datetime.datetime.now(datetime.timezone.utc)))
    assert client.count(labels=label)["total"] == 5
    assert client.count(labels=label, group_by="status")["groups"] == {"succeeded": 5}
    assert client.cancel_jobs(labels=label) == {"matched": 5, "changed": 0}
    assert client.delete_jobs(labels=label) == {"matched": 5, "changed": 5}
    assert not list(client.jobs(labels=label))
    with pytest.raises(sg.BadRequest, match="missing-filter"):
        client.delete_jobs()


def test_edit_retry_and_delete(client: sg.Client) -> None:
    job = client.submit(sg.examples.rectangular_punch(refine=0), name="old")
    first = job.wait(60, progress=False)
    job.edit(name="new", labels={"a": "b"}, pinned=True, priority=-2)
    assert (job.name, job.labels, job.pinned, job.priority) == ("new", {"a": "b"}, True, -2)
    assert job.edit(name=None).name is None
    with pytest.raises(TypeError, match="no 'colour' to edit, only name, labels, priority, pinned"):
        job.edit(colour="blue")
    other = job.retry(timeout_s=50, priority=1)
    assert other.document["parent"] == job.id and other.document["limits"]["timeout_s"] == 50
    again = other.wait(60, progress=False)
    assert other.cached_from is None and again.summary["digest"] == first.summary["digest"]
    other.delete()
    with pytest.raises(sg.Deleted):
        client.job(other.id)
    with pytest.raises(sg.NotFound) as caught:
        client.job("job_nothing")
    assert caught.value.code == "not-found" and caught.value.request_id


def test_cancel_and_what_a_running_job_refuses(client: sg.Client) -> None:
    job = client.submit(long_problem(10_000), cache="off", name="long")
    events = job.events()
    assert next(event for event in events if event.type == "iteration")["k"] >= 1
    with pytest.raises(sg.ResultNotReady):
        job.result()
    with pytest.raises(sg.JobActive):
        job.delete()
    with pytest.raises(sg.WaitTimeout, match=r"long has not ended in time; it goes on.\n  The job goes on. Come back"):
        job.wait(timeout=0.05, progress=False)
    with pytest.raises(TimeoutError):
        job.wait(timeout=0, progress=False)
    job.cancel()
    *_, last = events
    assert last.type == "done" and last["job"]["status"] == "canceled"
    with pytest.raises(sg.JobCanceled) as caught:
        job.wait(20, progress=False)
    assert caught.value.reason == "user_cancel" and isinstance(caught.value, sg.JobFailed)
    assert job.cancel().status == "canceled", "cancelling what has ended changes nothing"


def test_a_failed_job_keeps_its_last_state(client: sg.Client) -> None:
    job = client.submit(unconverged_problem(), name="five steps")
    with pytest.raises(sg.JobFailed) as caught:
        job.wait(60, progress=False)
    assert caught.value.reason == "not_converged" and caught.value.job is job
    assert str(caught.value).startswith("five steps failed: The iteration did not converge: after 5 iterations")
    assert str(caught.value).endswith("Its last state is kept: job.result(partial=True)")
    result = client.job(job.id).result(partial=True)
    assert result.partial and not result.converged and result.outcome == "not_converged" and result.verdict == "poor"
    assert str(result).startswith("state             PARTIAL: the last state of an iteration that did not end")
    assert "error unknown" in str(result.normal_force) and result.normal_force.error is None
    assert result.profile().partial and result.history.partial and result.fields().partial
    assert len(result.history) == 5


def test_the_figures_of_a_failed_job_have_to_be_asked_for(client: sg.Client, tmp_path: pathlib.Path) -> None:
    job = client.submit(unconverged_problem(), name="no solution")
    with pytest.raises(sg.JobFailed):
        job.wait(60, progress=False)
    for plot in ("profile", "convergence", "deformed"):
        with pytest.raises(sg.PartialResult, match="did not converge: after 5 iterations.* partial=true") as caught:
            job.svg(plot)
        assert isinstance(caught.value, sg.errors.Conflict) and caught.value.code == "partial-result"
        assert "PARTIAL" in job.svg(plot, partial=True)
    assert job.svg("mesh").startswith("<")
    with pytest.raises(sg.PartialResult):
        job.save_figure(tmp_path / "a.pdf")
    assert job.save_figure(tmp_path / "a.pdf", partial=True).exists()
    # a result that was asked for as partial asks so for its parts, and is so in a file
    result = job.result(partial=True)
    assert result.save_vtu(tmp_path / "a.vtu").exists()
    kept = sg.Result.open(result.save(tmp_path / "kept.zip"))
    assert kept.partial and kept.profile().partial and len(kept.history) == 5 and kept.fields().partial


def test_jobs_as_one_table(client: sg.Client) -> None:
    labels = {"table": "yes"}
    for indentation in (0.1, 0.2):
        problem = sg.examples.rectangular_punch(refine=0)
        problem.contacts[0].indentation = indentation
        client.submit(problem, name=f"d = {indentation}", labels={**labels, "d": indentation}).wait(60, progress=False)
    hasty = sg.examples.rectangular_punch(refine=0).with_values({"solver.max_iterations": 3})
    with pytest.raises(sg.JobFailed):
        client.submit(hasty, labels=labels).wait(60, progress=False)
    table = client.table(labels=labels, order_by="created_at asc", page_size=1)
    assert list(table)[:4] == ["id", "name", "status", "reason"] and len(table) == 3
    assert table["status"].tolist() == ["succeeded", "succeeded", "failed"] and table["reason"][2] == "not_converged"
    assert table["contacts"].tolist() == ["top"] * 3
    first = client.job(str(table["id"][0])).result()
    assert table["normal_force"][0] == float(first.normal_force)
    assert table["normal_force_error"][0] == first.normal_force.error
    # of a job without a solution only if they are asked for
    assert np.isnan(table["normal_force"][2])
    chosen = client.table(["label.d", "normal_force.top", "attempt"], partial=True, labels=labels)
    assert list(chosen) == ["label.d", "normal_force.top", "attempt"]
    assert chosen["label.d"].tolist() == ["", "0.2", "0.1"] and np.isfinite(chosen["normal_force.top"]).all()
    assert chosen["attempt"].dtype.kind == "i" and "label.d" in repr(chosen)
    assert chosen.to_pandas()["normal_force.top"].tolist() == chosen.to_arrow()["normal_force.top"].to_pylist()
    assert len(client.table(labels={"table": "no"})) == 0
    with pytest.raises(sg.BadRequest, match="id, name, status.*label.KEY"):
        client.table(["colour"])


def test_what_is_wrong_with_a_problem_is_told_in_full(client: sg.Client) -> None:
    problem = sg.examples.rectangular_punch()
    problem.materials[0].youngs_modulus = -1
    problem.contacts[0].boundary = "tap"
    with pytest.raises(sg.InvalidProblem) as caught:
        client.submit(problem)
    assert {v.pointer for v in caught.value.violations} >= {"/materials/0/youngs_modulus", "/contacts/0/boundary"}
    text = str(caught.value)
    assert text.startswith("The problem or its request is invalid (422 invalid-problem):\n  1. /")
    assert "got -1, expected a stress > 0" in text
    with pytest.raises(sg.InvalidProblem, match="/title: got set, expected a value of JSON"):
        client.submit({"title": {1}})
    with pytest.raises(sg.InvalidProblem, match="/bogus"):
        client.submit({**problem.to_dict(), "bogus": 1})


def test_the_service_tells_about_itself(client: sg.Client) -> None:
    assert client.info()["name"] == "signorini" and client.me()["owner"] == "local"
    assert client.pause_queue()["paused"] is True
    assert client.resume_queue()["paused"] is False
    assert client.queue()["workers"] == 2
    for code in ("not-converged", "not_converged", "quota-exceeded", "mesh_too_coarse_for_radius"):
        assert client.explain(code)["title"], code
    with pytest.raises(sg.NotFound):
        client.explain("no_such_code")


def test_a_token_says_who_one_is(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    data = tmp_path_factory.mktemp("tokens") / "data"

    def token(name: str, scope: str) -> str:
        command = [BINARY, "token", "create", "--data", data, "--name", name, "--owner", name, "--scope", scope]
        made = subprocess.run(list(map(str, command)), check=True, capture_output=True, text=True)
        return made.stdout.strip()

    token("root", "admin")
    secret = token("ada", "read")
    server = sg.LocalServer(data)
    monkeypatch.setenv("SIGNORINI_URL", server.start())
    try:
        with sg.Client(retry_for=0) as stranger, pytest.raises(sg.Unauthenticated):
            stranger.info()
        monkeypatch.setenv("SIGNORINI_TOKEN", secret)
        with sg.Client(retry_for=0) as reader:
            assert reader.me()["owner"] == "ada"
            with pytest.raises(sg.Forbidden):
                reader.submit(sg.examples.sheet(refine=0))
    finally:
        server.stop()
    assert data.exists(), "only a temporary store is removed"


# The progress line


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_one_line_is_drawn_in_place_in_a_terminal() -> None:
    out = Terminal()
    waiting = Waiting("job", None, True, "Come back.", None, out)
    assert waiting.seconds() == 0.5
    waiting.seen("running", "a longer line", False)
    waiting.seen("running", "a line", False)
    waiting.seen("succeeded", "end", True)
    waiting.close()
    assert out.getvalue() == "\ra longer line\ra line       \rend   \n"


def test_in_a_log_there_is_a_line_for_each_status() -> None:
    out = io.StringIO()
    waiting = Waiting("job", None, True, "Come back.", None, out)
    assert waiting.seconds() == 20
    for status, line in [("queued", "1"), ("queued", "2"), ("running", "3"), ("running", "4"), ("succeeded", "5")]:
        waiting.seen(status, line, status == "succeeded")
    waiting.detached()
    assert out.getvalue() == "1\n3\n5\nDetached. Come back.\n"


def test_in_a_notebook_a_card_with_the_convergence_is_drawn(client: sg.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []

    class ZMQInteractiveShell:
        pass

    class Handle:
        def update(self, html: str) -> None:
            shown.append(html)

    def display(html: str, display_id: bool) -> Handle:
        shown.append(html)
        return Handle()

    notebook = types.ModuleType("IPython")
    notebook.get_ipython = ZMQInteractiveShell  # type: ignore[attr-defined]
    display_module = types.ModuleType("IPython.display")
    display_module.display, display_module.HTML = display, str  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    monkeypatch.setitem(sys.modules, "IPython.display", display_module)
    job = client.submit(long_problem(2000), cache="off", name="card")
    monkeypatch.setattr(Waiting, "seconds", lambda self: 0.1)
    job.wait(60)
    assert len(shown) >= 2 and "card</b>" in shown[0] and "succeeded" in shown[-1]
    assert "<polyline points='0.0," in shown[-1] and "aria-label='residual while waiting'" in shown[-1]
    sweep = client.sweep(sg.examples.rectangular_punch(refine=0), {"contacts.0.indentation": [0.1, 0.2]})
    sweep.wait(60)
    assert "indentation" in shown[-1]


def test_what_the_line_says() -> None:
    progress = {
        "stage": "iterate", "iteration": 7, "residual": 3.2e-7, "tolerance": 1e-10, "contact_changes": 2,
        "eta_s": 200, "mesh": 3, "mesh_elements": 96,
    }  # fmt: skip
    job = {"status": "running", "progress": progress}
    assert job_line("punch", job) == (
        "punch · running · mesh 3, 96 elements · iteration 7 · residual 3.2e-07 → 1e-10 · contact ±2 · eta 3 min 20 s"
    )
    queue = {"ahead": 4, "reason": "workers_busy"}
    assert job_line("punch", {"status": "queued", "queue": queue}) == "punch · queued · 4 ahead (workers busy)"
    queue = {"ahead": 0, "reason": "paused"}
    assert job_line("punch", {"status": "queued", "queue": queue}) == "punch · queued · next in line (paused)"
    ended = {"status": "failed", "reason": "timed_out", "run_s": 61.2, "finished_at": "now"}
    assert job_line("punch", ended) == "punch · failed (timed out) · in 1 min 1 s"
    assert [duration(s) for s in (0.04, 9.96, 59.4, 7500)] == ["0.0 s", "10.0 s", "59 s", "2 h 5 min"]


def test_ctrl_c_detaches_and_the_job_goes_on(
    client: sg.Client, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    job = client.submit(long_problem(10_000), cache="off", name="detached")
    with monkeypatch.context() as patched:
        patched.setattr(Waiting, "seconds", lambda self: 0.05)
        patched.setattr(Waiting, "seen", lambda self, *seen: signal.raise_signal(signal.SIGINT))
        with pytest.raises(KeyboardInterrupt):
            job.wait()
    said = capsys.readouterr().err
    assert said == (
        f"Detached. The job goes on. Come back with client.job({job.id!r}).wait(), "
        f"or stop it with client.job({job.id!r}).cancel()\n"
    )
    assert not client.job(job.id).ended
    with pytest.raises(sg.JobCanceled):
        client.job(job.id).cancel().wait(30)
    assert "detached · canceled (user cancel)" in capsys.readouterr().err
