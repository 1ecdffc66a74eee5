"""What is repeated, when, and what never is: against answers that are made up."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Any

import httpx
import pytest

import signorini as sg
from signorini._answer import raise_error
from signorini._pool import AsyncPool, Pool
from signorini._progress import Waiting
from signorini._retry import Attempts

Answer = httpx.Response | Exception
JOB = {"id": "job_1", "status": "queued", "name": None, "result_available": "none"}


class Service:
    """Answers one after the other, and notes what was asked."""

    def __init__(self, *answers: Answer | Callable[[], Answer]) -> None:
        self.answers = list(answers)
        self.requests: list[httpx.Request] = []
        self.pauses: list[float] = []

    def __call__(self, request: httpx.Request) -> httpx.Response:
        self.requests.append(request)
        answer = self.answers.pop(0)
        if isinstance(answer, httpx.TransportError):
            answer.request = request
            raise answer
        assert isinstance(answer, httpx.Response)
        return answer


def client_of(service: Service, monkeypatch: pytest.MonkeyPatch, retry_for: float = 60) -> sg.Client:
    client = sg.Client("http://service.test", token="secret", retry_for=retry_for)
    client._http = Pool({**client._connection.settings(), "transport": httpx.MockTransport(service)})
    monkeypatch.setattr("time.sleep", service.pauses.append)
    return client


def problem(status: int, code: str, retryable: bool = False, **headers: str) -> httpx.Response:
    body = {"code": code, "title": code, "status": status, "detail": "in words", "retryable": retryable, "errors": []}
    return httpx.Response(status, json=body, headers={k.replace("_", "-"): v for k, v in headers.items()})


def test_a_submission_keeps_its_key_over_all_attempts(monkeypatch: pytest.MonkeyPatch) -> None:
    service = Service(
        httpx.ConnectError("refused"),
        httpx.ReadError("reset"),
        problem(503, "draining", True),
        httpx.Response(502, text="bad gateway"),
        httpx.Response(202, json=JOB),
    )
    client = client_of(service, monkeypatch)
    assert client.submit(sg.examples.sheet(), name="sheet").id == "job_1"
    keys = {request.headers["Idempotency-Key"] for request in service.requests}
    assert len(service.requests) == 5 and len(keys) == 1 and len(keys.pop()) == 36
    assert {request.headers["Authorization"] for request in service.requests} == {"Bearer secret"}
    assert json.loads(service.requests[-1].content)["name"] == "sheet"


def test_retry_after_is_honoured(monkeypatch: pytest.MonkeyPatch) -> None:
    for status, code in [(429, "rate-limited"), (503, "queue-full")]:
        service = Service(problem(status, code, True, Retry_After="7"), httpx.Response(200, json={"name": "x"}))
        assert client_of(service, monkeypatch).info() == {"name": "x"}
        assert service.pauses == [7.0]


def test_pauses_grow_and_end_with_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    attempts = Attempts(True, 60, lambda: now[0])
    pauses = []
    with pytest.raises(sg.ConnectionLost, match="cannot be reached, also after"):
        while True:
            pauses.append(attempts.after_error(httpx.ReadError("reset")))
            now[0] += pauses[-1]
    assert all(0.05 <= pause <= 5 for pause in pauses) and pauses[0] <= 0.1 and 2.5 <= pauses[-1]
    assert 50 < sum(pauses) <= 60
    attempts.succeeded()
    assert attempts.after_error(httpx.ReadError("reset")) <= 0.1, "what comes after an answer is counted anew"


def test_a_service_that_is_away_is_told_about_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [0.0]
    told: list[str] = []
    attempts = Attempts(True, 60, lambda: now[0], told.append)
    for _ in range(8):
        now[0] += attempts.after_error(httpx.ConnectError("refused"))
    assert len(told) == 1 and told[0].startswith(
        "the service at this address cannot be reached (refused); trying again for "
    )
    assert attempts.after_answer(httpx.Response(200)) is None
    assert told[1:] == ["the service answers again"]
    attempts.succeeded()
    for _ in range(3):
        now[0] += attempts.after_error(httpx.ReadError("reset"))
    assert len(told) == 2, "nothing is said of what is over after a moment"
    # by default it goes to the log, which Python shows
    busy = problem(503, "queue-full", True, Retry_After="7")
    service = Service(busy, busy, httpx.Response(200, json={"name": "x"}))
    assert client_of(service, monkeypatch).info() == {"name": "x"}
    assert [record.message for record in caplog.records] == [
        "the service is busy (queue-full); trying again for 60 s",
        "the service answers again",
    ]
    service = Service(
        httpx.Response(502, text="bad", headers={"Retry-After": "9"}), httpx.Response(200, json={"name": "x"})
    )
    assert client_of(service, monkeypatch).info() == {"name": "x"}
    assert "a proxy gets no answer from the service (HTTP status 502)" in caplog.text
    # while one waits, on a line of its own
    waiting = Waiting("punch", None, True, "")
    waiting.note("the service is busy (queue-full); trying again for 60 s")
    assert capsys.readouterr().err == "the service is busy (queue-full); trying again for 60 s\n"
    Waiting("punch", None, False, "").note("silent")
    assert capsys.readouterr().err == ""


def test_what_might_be_done_twice_is_not_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    service = Service(httpx.ReadError("reset"))
    with pytest.raises(sg.ConnectionLost, match="http://service.test cannot be reached: reset"):
        client_of(service, monkeypatch).cancel_jobs(status="running")
    # but what never arrived is
    service = Service(httpx.ConnectError("refused"), httpx.Response(200, json={"matched": 0, "changed": 0}))
    assert client_of(service, monkeypatch).cancel_jobs(status="running")["matched"] == 0
    service = Service(httpx.Response(504, text="too slow"))
    with pytest.raises(sg.ServiceError, match=r"HTTP status 504 \(504 unknown\): too slow"):
        client_of(service, monkeypatch).cancel_jobs(status="running")


def test_what_the_service_refuses_for_good_is_not_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    service = Service(problem(429, "quota-exceeded", False))
    with pytest.raises(sg.QuotaExceeded, match=r"quota-exceeded \(429 quota-exceeded\): in words"):
        client_of(service, monkeypatch).submit(sg.examples.sheet())
    service = Service(problem(507, "storage-full", True))
    with pytest.raises(sg.StorageFull) as caught:
        client_of(service, monkeypatch).submit(sg.examples.sheet())
    assert caught.value.retryable and caught.value.status == 507


def test_the_last_answer_is_raised_when_the_time_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    service = Service(problem(503, "queue-full", True, Retry_After="30"))
    with pytest.raises(sg.Unavailable) as caught:
        client_of(service, monkeypatch, retry_for=10).submit(sg.examples.sheet())
    assert caught.value.retry_after_s == 30


def test_a_job_that_an_earlier_attempt_deleted_is_deleted(monkeypatch: pytest.MonkeyPatch) -> None:
    service = Service(httpx.ReadError("reset"), problem(410, "deleted"))
    client = client_of(service, monkeypatch)
    sg.Job(client, JOB).delete()
    service.answers = [problem(410, "deleted")]
    with pytest.raises(sg.Deleted):
        sg.Job(client, JOB).delete()


@pytest.mark.parametrize("error", [httpx.UnsupportedProtocol("no htp://"), httpx.LocalProtocolError("Illegal header")])
def test_what_no_time_mends_is_not_repeated(error: httpx.TransportError, monkeypatch: pytest.MonkeyPatch) -> None:
    service = Service(error)
    with pytest.raises(sg.ConnectionLost, match="cannot be called"):
        client_of(service, monkeypatch).info()
    assert len(service.requests) == 1 and not service.pauses


def test_addresses_and_tokens_that_cannot_be() -> None:
    with pytest.raises(ValueError, match="begins with http:// or https://, not 'htp://lab'"):
        sg.Client("htp://lab")
    with pytest.raises(ValueError, match="the token has characters") as caught:
        sg.Client(token="two\nlines")
    assert "two" not in str(caught.value)
    with pytest.raises(ValueError, match="the file of a certificate authority, '/no/such.pem', cannot be used"):
        sg.Client("https://lab", ca="/no/such.pem")
    # as it is read from a file
    assert sg.Client(token="secret\n")._connection.token == "secret"


def test_every_code_of_the_service_has_its_class(client: sg.Client) -> None:
    paths = httpx.get(client.url + "/openapi.json").json()["paths"].values()
    answers = [answer for path in paths for verb in path.values() for answer in verb["responses"].values()]
    refusals = [answer["content"].get("application/problem+json") for answer in answers if "content" in answer]
    codes = {code for refusal in refusals if refusal for code in refusal["schema"]["properties"]["code"]["enum"]}
    # no operation that there is answers that there is none
    assert codes | {"method-not-allowed"} == set(sg.errors.CLASSES)
    for code, kind in sg.errors.CLASSES.items():
        with pytest.raises(kind):
            raise_error(problem(400, code))
    with pytest.raises(sg.ApiError) as caught:
        raise_error(httpx.Response(418, json=["tea"]))
    assert type(caught.value) is sg.ApiError


def test_events_go_on_where_they_broke_off(monkeypatch: pytest.MonkeyPatch) -> None:
    def stream(*numbers: int, broken: bool = False) -> httpx.Response:
        async def pieces() -> Any:
            for piece in made():
                yield piece

        def made() -> Any:
            for n in numbers:
                kind = "done" if n == 5 else "iteration"
                yield f"id: {n}\ndata: {json.dumps({'seq': n, 'type': kind})}\n\n".encode()
            if broken:
                raise httpx.ReadError("reset")

        class Both(httpx.SyncByteStream, httpx.AsyncByteStream):
            def __iter__(self) -> Any:
                return made()

            def __aiter__(self) -> Any:
                return pieces()

        return httpx.Response(200, headers={"Content-Type": "text/event-stream"}, stream=Both())

    def answers() -> list[Answer]:
        return [
            stream(1, 2, broken=True),
            httpx.ConnectError("refused"),
            problem(503, "draining", True),
            stream(3),
            stream(),
            stream(3, 4, 5),
        ]

    asked = ["0", "2", "2", "2", "3", "3"]
    service = Service(*answers())
    client = client_of(service, monkeypatch)
    assert [event.seq for event in sg.Job(client, JOB).events()] == [1, 2, 3, 4, 5]
    assert [request.headers["Last-Event-ID"] for request in service.requests] == asked
    service.answers = [httpx.Response(204, headers={"X-Request-Id": "1"})]
    assert list(sg.Job(client, JOB).events(after_seq=5)) == []
    service.answers = [problem(410, "deleted")]
    with pytest.raises(sg.Deleted):
        list(sg.Job(client, JOB).events())

    async def the_same_with_asyncio() -> list[int]:
        twin = sg.AsyncClient("http://service.test")
        other = Service(*answers())
        transport = httpx.MockTransport(other)
        twin._http = AsyncPool({"base_url": twin.url, "transport": transport})

        async def pause(seconds: float) -> None:
            other.pauses.append(seconds)

        monkeypatch.setattr("asyncio.sleep", pause)
        found = [event.seq async for event in sg.AsyncJob(twin, JOB).events()]
        assert [request.headers["Last-Event-ID"] for request in other.requests] == asked
        other.answers = [httpx.Response(204, headers={"X-Request-Id": "1"})]
        assert [event async for event in sg.AsyncJob(twin, JOB).events(5)] == []
        other.answers = [problem(410, "deleted")]
        with pytest.raises(sg.Deleted):
            [event async for event in sg.AsyncJob(twin, JOB).events()]
        other.answers = [
            httpx.ReadError("reset"),
            problem(503, "draining", True),
            httpx.Response(200, json={"name": "x"}),
        ]
        assert await twin.info() == {"name": "x"}
        return found

    assert asyncio.run(the_same_with_asyncio()) == [1, 2, 3, 4, 5]


def test_something_else_at_the_address(monkeypatch: pytest.MonkeyPatch) -> None:
    service = Service(httpx.Response(200, text="<html>Sign in", headers={"Content-Type": "text/html"}))
    with pytest.raises(
        sg.UnexpectedAnswer,
        match="http://service.test/v1/info is not answered as by the service: got status 200, text/html, '<html>Sign",
    ):
        client_of(service, monkeypatch).info()
    service = Service(httpx.Response(200, json={}))
    with pytest.raises(sg.UnexpectedAnswer, match="it lacks something: KeyError"):
        client_of(service, monkeypatch).submit_many([sg.examples.sheet()])
    # a proxy's own answer, without the service's words
    service = Service(httpx.Response(503, text="busy"), httpx.Response(200, json={"name": "x"}))
    assert client_of(service, monkeypatch).info() == {"name": "x"}


def test_a_service_that_is_not_there() -> None:
    with sg.Client("127.0.0.1:9", retry_for=0) as client:
        assert client.url == "http://127.0.0.1:9" and repr(client) == "<Client http://127.0.0.1:9>"
        with pytest.raises(sg.ConnectionLost, match="http://127.0.0.1:9 cannot be reached"):
            client.info()
        with pytest.raises(ConnectionError):
            list(sg.Job(client, JOB).events())


def test_a_list_goes_on_over_short_and_empty_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    pages = [([], "a"), ([JOB, JOB], "b"), ([], "c"), ([JOB], None)]
    answers = [httpx.Response(200, json={"jobs": jobs, "next_page_token": token}) for jobs, token in pages]
    service = Service(*answers)
    client = client_of(service, monkeypatch)
    assert len(list(client.jobs(labels={"study": 7}))) == 3
    tokens = [request.url.params.get("page_token") for request in service.requests]
    assert tokens == [None, "a", "b", "c"]
    with pytest.raises(TypeError, match="no such filter: lables; there are created_after"):
        client.count(lables={"study": 7})  # type: ignore[call-arg]
