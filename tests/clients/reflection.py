"""The service as a gRPC client sees it that has no stubs: everything it knows comes from server reflection."""

import hashlib
import pathlib
import sys
import uuid

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import grpc

import outside
from outside import Server, check, equal, example
from reflected import Client, as_json, refusal

NOBODY = "job_00000000-0000-7000-8000-000000000000"


def message(problem):
    """A problem from its JSON to the JSON of its message: of alternatives each is a field."""
    problem = dict(problem)
    problem["analysis"] = {problem["analysis"]["kind"]: {}}
    problem["supports"] = [{name: {"start": value} if name in ("ux", "uy") else value for name, value in support.items()}
                           for support in problem["supports"]]
    problem["contacts"] = [dict(contact) for contact in problem["contacts"]]
    for contact in problem["contacts"]:
        obstacle = dict(contact["obstacle"])
        span = {name: obstacle.pop(name) for name in ("from", "to") if name in obstacle}
        contact["obstacle"] = {obstacle.pop("kind"): obstacle, **span}
    return problem


def steps(increments, **mesh):
    return dict(message(example(**mesh)), steps=[{"name": "press", "increments": increments}])


def envelope(problem=None, **fields):
    return {"problem": problem or message(example()), "cache": "CACHE_OFF", **fields}


def submit_and_read(client):
    job = client.CreateJob(**envelope(name="tour", labels={"by": "reflection"}, priority=2, wait=30))
    equal((as_json(job)["status"], job.name, dict(job.labels), job.owner), ("STATUS_SUCCEEDED", "tour", {"by": "reflection"}, "local"), "a job")
    equal(as_json(client.GetJob(id=job.id)), as_json(job), "the job again")
    waited = client.WaitJob(id=job.id, wait=10, until_terminal=True)
    equal((waited.job.id, waited.met), (job.id, True), "waiting for a job that has ended")

    summary = as_json(client.GetResult(id=job.id).summary)
    equal((summary["outcome"], round(summary["tangential_force"], 2)), ("OUTCOME_CONVERGED", 14.17), "the result")
    profile = client.GetProfile(id=job.id, boundary="top", points="nodes")
    equal((len(profile.s), list(profile.s)), (11, sorted(profile.s)), "the profile")
    rows = client.ListIterations(id=job.id).iterations
    equal([row.k for row in rows], list(range(1, summary["iterations"] + 1)), "the history")
    few = client.ListIterations(id=job.id, max_points=3).iterations
    equal((len(few), few[0], few[2]), (3, rows[0], rows[-1]), "three rows of the history")
    problem = client.GetJobProblem(id=job.id)
    judged = client.ValidateProblem(problem=as_json(problem))
    equal((judged.valid, judged.input_hash), (True, job.input_hash), "the problem that was handed in")

    events = list(client.WatchJob(id=job.id))
    equal([event.seq for event in events], list(range(1, len(events) + 1)), "the events")
    equal((events[-1].WhichOneof("payload"), events[-1].done.job.id), ("done", job.id), "the last event")
    equal(list(client.WatchJob(id=job.id, after_seq=3)), events[3:], "the events after the third")
    equal(list(client.WatchJob(id=job.id, after_seq=len(events))), [], "the events after the last")
    return job.id


def list_pages(client):
    made = [client.CreateJob(**envelope(name="listed", labels={"n": str(n)})).id for n in range(7)]
    pages, token = [], ""
    while token or not pages:
        page = client.ListJobs(filter={"name": "listed"}, page_size=3, page_token=token)
        pages.append([job.id for job in page.jobs])
        token = page.next_page_token
    equal([len(page) for page in pages], [3, 3, 1], "the sizes of the pages")
    equal(sum(pages, []), made[::-1], "the pages, newest first")
    one = client.ListJobs(filter={"name": "listed", "labels": {"n": "4"}})
    equal([job.id for job in one.jobs], [made[4]], "the list by a label")
    for job in made:
        check(client.WaitJob(id=job, wait=60, until_terminal=True).met, "a job of the list ends")
    counted = client.CountJobs(filter={"name": "listed"}, group_by="status")
    equal((counted.total, dict(counted.groups)), (7, {"succeeded": 7}), "the counts")


def submit_and_watch(client):
    events = list(client.SubmitAndWatch(**envelope(steps(100), name="watched")))
    equal([event.seq for event in events], list(range(1, len(events) + 1)), "the events of a submit that streams")
    equal((events[-1].WhichOneof("payload"), events[-1].done.job.name), ("done", "watched"), "the last of them")
    check(len(events) > 300, "a job with 100 increments has %d events" % len(events))
    # whoever hangs up, or runs out of time, cancels nothing
    stream = client.SubmitAndWatch(**envelope(steps(200, refine=3), name="left alone"))
    next(stream)
    stream.cancel()
    slow = client.SubmitAndWatch(timeout=0.2, **envelope(steps(200, refine=3), name="left alone"))
    try:
        list(slow)
        check(False, "a stream with a deadline ended in time")
    except grpc.RpcError as error:
        equal(error.code().name, "DEADLINE_EXCEEDED", "the end of a stream with a deadline")
    for job in client.ListJobs(filter={"name": "left alone"}).jobs:
        ended = client.WaitJob(id=job.id, wait=60, until_terminal=True)
        equal(as_json(ended.job)["status"], "STATUS_SUCCEEDED", "a job that was left alone")
    equal(len(client.ListJobs(filter={"name": "left alone"}).jobs), 2, "the jobs that were left alone")


def stream_in_pieces(client):
    """The fields of a larger job, broken off and resumed by offset."""
    job = client.CreateJob(**envelope(message(example(refine=4)), wait=60)).id
    pieces = list(client.StreamResult(id=job))
    whole, total = b"".join(piece.data for piece in pieces), pieces[0].total_bytes
    equal(len(whole), total, "the bytes of the fields")
    check(all(0 < len(piece.data) <= 256 << 10 for piece in pieces), "a piece has more than 256 KiB")
    check(len(pieces) > 2, "the fields are %d pieces" % len(pieces))
    equal(pieces[0].sha256, hashlib.sha256(whole).digest(), "SHA-256 of the fields")
    got, streams = b"", 0
    while len(got) < total:
        stream = client.StreamResult(id=job, offset=len(got))
        piece = next(stream)
        equal((piece.offset, piece.sha256), (len(got), pieces[0].sha256), "a piece of the fields")
        # as if the connection broke in the middle of a message, once
        got += piece.data if streams else piece.data[: len(piece.data) // 2]
        stream.cancel()
        streams += 1
    check(got == whole and streams > 1, "the fields put together from %d streams" % streams)


def repeat_under_a_request_id(client):
    first, call = client.call_with_metadata("CreateJob", **envelope(name="once", request_id="from-reflection", wait=30))
    again, repeated = client.call_with_metadata("CreateJob", **envelope(name="once", request_id="from-reflection", wait=30))
    equal((again, call.get("idempotency-replayed"), repeated.get("idempotency-replayed")), (first, None, "true"), "a repeated request")
    code, details = refusal(client.CreateJob, **envelope(name="other", request_id="from-reflection"))
    equal((code, details["ErrorInfo"].reason), ("ALREADY_EXISTS", "idempotency-key-reuse"), "another request under the same id")

    own = "job_" + str(uuid.uuid4())
    equal(client.CreateJob(**envelope(name="mine", job_id=own)).id, own, "a job with a name of the client's")
    equal(client.CreateJob(**envelope(name="mine", job_id=own)).id, own, "the same again")
    code, details = refusal(client.CreateJob, **envelope(name="other", job_id=own))
    equal((code, details["ErrorInfo"].reason), ("ALREADY_EXISTS", "id-conflict"), "another job of that name")

    batch = {"jobs": [envelope(name="batch") for _ in range(5)], "request_id": "batch"}
    made = [job.id for job in client.BatchCreateJobs(**batch).jobs]
    equal(([job.id for job in client.BatchCreateJobs(**batch).jobs], len(set(made))), (made, 5), "a batch, twice")


def edit_retry_delete(client, job):
    again = client.RetryJob(id=job)
    equal(again.parent, job, "the parent of a retry")
    again = client.WaitJob(id=again.id, wait=60, until_terminal=True).job
    edited = client.UpdateJob(id=again.id, update_mask="name,labels", name="edited", labels={"a": "b"}, version=again.version)
    equal((edited.name, dict(edited.labels), edited.version), ("edited", {"a": "b"}, again.version + 1), "an edit")
    code, details = refusal(client.UpdateJob, id=again.id, name="lost", version=again.version)
    equal((code, details["ErrorInfo"].reason), ("ABORTED", "stale-version"), "a stale edit")

    running = client.CreateJob(**envelope(steps(200, refine=3))).id
    code, details = refusal(client.DeleteJob, id=running)
    equal((code, details["ErrorInfo"].reason), ("FAILED_PRECONDITION", "job-active"), "deleting a job that runs")
    answer = as_json(client.CancelJob(id=running))
    check(answer["outcome"] in ("OUTCOME_CANCELED", "OUTCOME_CANCEL_REQUESTED"), "a cancel: %r" % answer)
    ended = client.WaitJob(id=running, wait=10, until_terminal=True).job
    equal(as_json(ended)["status"], "STATUS_CANCELED", "a canceled job")
    equal(as_json(client.CancelJob(id=running))["outcome"], "OUTCOME_ALREADY_TERMINAL", "a second cancel")
    client.DeleteJob(id=running)
    code, details = refusal(client.GetJob, id=running)
    equal((code, details["ErrorInfo"].reason), ("NOT_FOUND", "deleted"), "a deleted job")


def many_at_once(client):
    client.PauseQueue()
    made = [client.CreateJob(**envelope(name="many", labels={"half": str(n % 2)})).id for n in range(6)]
    check(client.GetQueue().paused, "the queue says that it is paused")
    code, details = refusal(client.GetResult, id=made[0])
    equal((code, details["ErrorInfo"].reason), ("FAILED_PRECONDITION", "result-not-ready"), "the result of a waiting job")
    check("RetryInfo" in details, "result-not-ready without RetryInfo")
    canceled = client.CancelJobs(filter={"name": "many", "labels": {"half": "1"}})
    equal((canceled.matched, canceled.changed), (3, 3), "cancel by filters")
    client.ResumeQueue()
    for job in made:
        client.WaitJob(id=job, wait=60, until_terminal=True)
    deleted = client.DeleteJobs(filter={"name": "many"})
    equal((deleted.matched, deleted.changed), (6, 6), "delete by filters")
    code, details = refusal(client.DeleteJobs)
    equal((code, details["ErrorInfo"].reason), ("INVALID_ARGUMENT", "missing-filter"), "delete without a filter")


def be_refused(client):
    wrong = message(example())
    wrong["materials"] = [{"youngs_modulus": -1, "poissons_ratio": 0.3}]
    wrong["contacts"][0]["friction"] = {**wrong["contacts"][0]["friction"], "coefficient": -0.3}
    code, details = refusal(client.CreateJob, **envelope(wrong))
    equal((code, details["ErrorInfo"].reason, details["ErrorInfo"].domain), ("INVALID_ARGUMENT", "invalid-problem", "signorini"), "an invalid problem")
    fields = sorted(violation.field for violation in details["BadRequest"].field_violations)
    equal(fields, ["/problem/contacts/0/friction/coefficient", "/problem/materials/0/youngs_modulus"], "the violations")
    judged = client.ValidateProblem(problem=wrong)
    equal((judged.valid, len(judged.violations)), (False, 2), "validating it")
    for name, fields, code, reason in [
        ("GetJob", {"id": NOBODY}, "NOT_FOUND", "not-found"),
        ("GetJob", {"id": "nonsense"}, "NOT_FOUND", "not-found"),
        ("WatchJob", {"id": NOBODY}, "NOT_FOUND", "not-found"),
        ("ListJobs", {"page_token": "abc"}, "INVALID_ARGUMENT", "bad-page-token"),
    ]:
        found, details = refusal(getattr(client, name), **fields)
        equal((found, details["ErrorInfo"].reason), (code, reason), "%s %r" % (name, fields))


def main():
    with Server() as server, Client(server.address) as client:
        check(len(client.service.methods) > 25, "the service has %d methods" % len(client.service.methods))
        equal(client.GetServerInfo().workers, 2, "the workers of the service")
        equal(client.GetCaller().owner, "local", "the owner without tokens")
        job = submit_and_read(client)
        for part in (list_pages, submit_and_watch, stream_in_pieces, repeat_under_a_request_id, many_at_once, be_refused):
            part(client)
        edit_retry_delete(client, job)
    print("gRPC by reflection: %d checks" % outside.checks)


main()
