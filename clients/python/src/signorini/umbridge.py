"""Problems as functions of vectors, for programs that speak UM-Bridge: `python -m signorini.umbridge NAME=FILE.json`.

UM-Bridge (https://um-bridge-benchmarks.readthedocs.io, version 1.0) is the protocol by which programs for uncertainty
quantification, optimisation and inference call numerical models. `Model` is a problem of which some numbers are given
and some numbers of the result are returned; every evaluation is a job of the service. `serve` offers models over
HTTP. docs/umbridge.md has an example, the files, and how derivatives are found.

Needs `pip install "signorini[umbridge]"`.
"""

from __future__ import annotations

import argparse
import asyncio
import logging
import os
import socket
import sys
from collections.abc import Awaitable, Callable, Sequence
from types import SimpleNamespace
from typing import Any

from ._extras import load
from ._model import Model, ModelError, shown
from .client import Client
from .errors import ApiError, ConnectionLost, InvalidProblem, JobFailed, SignoriniError

umbridge = load("umbridge", "umbridge")
web = load("aiohttp.web", "umbridge")

__all__ = ["Model", "ModelError", "application", "serve"]

STATUS = {"ModelNotFound": 400, "InvalidInput": 400, "UnsupportedFeature": 400, "InvalidOutput": 500}
"""The errors of the protocol, with the status that it gives them."""

MOST_BYTES = 1 << 20
"""Largest body of a request."""

HTTP_CODES = {403: "forbidden", 404: "not-found", 405: "method-not-allowed", 413: "payload-too-large", 503: "draining"}
"""The codes of the service's API for what is refused here."""

FIELDS = ("name", "config", "input", "outWrt", "inWrt", "inWrt1", "inWrt2", "sens", "vec")
"""The fields of all requests of the protocol."""

LOG = logging.getLogger("signorini")


def application(models: Sequence[Model], threads: int = 32) -> Any:
    """An application of aiohttp that answers requests of the protocol below `/`.

    threads: how many evaluations are waited for at once; further ones wait for their turn
    """
    made: list[Any] = []
    module = umbridge.um
    # the package runs its application itself, on every interface of the machine: it is handed over here instead
    module.web = SimpleNamespace(**{**vars(web), "run_app": lambda app, **_: made.append(app)})
    try:
        # models check all that is given, and say more
        umbridge.serve_models(models, max_workers=threads, error_checks=False)
    finally:
        module.web = web
    (app,) = made
    stopping = asyncio.Event()

    async def stop(_: Any) -> None:
        stopping.set()

    app.on_shutdown.append(stop)
    app.middlewares.append(_protocol(stopping))
    return app


def serve(models: Sequence[Model], host: str = "127.0.0.1", port: int = 4242, threads: int = 32) -> None:
    """Serves models until the program is interrupted or told to stop (SIGTERM). Prints the address; port 0 is a free
    one.

    Anyone who can reach the port evaluates the models with the client's token. Raises OSError if the port is taken.
    Threads that wait for a job continue until it ends.
    """
    with socket.create_server((host, port)) as listening:
        print(f"http://{host}:{listening.getsockname()[1]}", flush=True)
        web.run_app(application(models, threads), sock=listening, print=None, access_log=None)


def _protocol(stopping: asyncio.Event) -> Any:
    """What the package's server leaves out: errors and media types as the protocol has them, limits, an end."""

    @web.middleware  # type: ignore[untyped-decorator]
    async def middleware(request: Any, handler: Callable[[Any], Awaitable[Any]]) -> Any:
        try:
            request = await _admitted(request)
            answer = await _unless(stopping, handler(request))
        except Exception as error:
            status, kind, message = _told(error)
            return web.json_response({"error": {"type": kind, "message": message}}, status=status)
        answer.content_type = "application/json"
        return answer

    return middleware


async def _admitted(request: Any) -> Any:
    """The request, with a body that was read and is an object of known fields."""
    if "Origin" in request.headers:
        # a page in a browser may send requests to this machine, but no client of the protocol is one
        raise web.HTTPForbidden(text="requests of web pages are refused")
    if request.path.endswith("ShMem"):
        raise web.HTTPNotFound(text="shared memory is not offered")
    request = request.clone(client_max_size=MOST_BYTES)
    if request.method != "POST":
        return request
    try:
        body = await request.json()
    except (ValueError, LookupError, RecursionError) as error:
        raise ModelError("InvalidInput", f"the body cannot be read: {error}") from error
    if not isinstance(body, dict):
        raise ModelError("InvalidInput", f"expected a JSON object, got {shown(body)}")
    unknown = [name for name in body if name not in FIELDS]
    if unknown:
        raise ModelError("InvalidInput", f"unknown field {shown(unknown[0])}; known are {', '.join(FIELDS)}")
    if "name" in body and not isinstance(body["name"], str):
        raise ModelError("InvalidInput", f"name: expected the name of a model, got {shown(body['name'])}")
    return request


async def _unless(stopping: asyncio.Event, work: Awaitable[Any]) -> Any:
    """An answer, or an error if the server stops before there is one: the job continues in the service."""
    answering, stop = asyncio.ensure_future(work), asyncio.ensure_future(stopping.wait())
    await asyncio.wait({answering, stop}, return_when=asyncio.FIRST_COMPLETED)
    stop.cancel()
    if not answering.done():
        answering.cancel()
        why = "the server of models stops; the job goes on, so that the same request finds its result"
        raise web.HTTPServiceUnavailable(text=why)
    return answering.result()


def _told(error: Exception) -> tuple[int, str, str]:
    """Status, type and message of an error; one that the protocol does not know has the code of the service's API."""
    if isinstance(error, ModelError):
        return STATUS[error.type], error.type, error.message
    if isinstance(error, JobFailed):
        code = (error.job.failure or {}).get("code") or error.reason
        return 500, "InvalidOutput", f"{error.job.id} {error.job.status}: {code}: {error.detail}"
    if isinstance(error, ApiError):
        return error.status or 500, error.code, str(error)
    if isinstance(error, ConnectionLost):
        return 503, "service-unreachable", str(error)
    if isinstance(error, SignoriniError):
        return 502, "unexpected-answer", str(error)
    if isinstance(error, web.HTTPException):
        return error.status, HTTP_CODES.get(error.status, "bad-request"), error.text or error.reason
    if isinstance(error, KeyError) and error.args[0] in FIELDS:
        return 400, "InvalidInput", f"{error.args[0]} is missing"
    LOG.error("a request failed", exc_info=error)
    return 500, "internal", "this is a fault of the server; its log has the cause"


def main(arguments: Sequence[str] | None = None) -> int:
    """`python -m signorini.umbridge`; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m signorini.umbridge",
        description="Serves problems as models of UM-Bridge. Evaluations are jobs of a service of Signorini, which is "
        "named by SIGNORINI_URL, SIGNORINI_TOKEN and SIGNORINI_CA (see docs/umbridge.md).",
    )
    parser.add_argument("models", nargs="+", metavar="NAME=FILE.json", help="a model and the file that defines it")
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on (default: %(default)s)")
    parser.add_argument("--port", type=int, default=4242, help="port; 0: a free one (default: %(default)s)")
    parser.add_argument("--threads", type=int, default=32, help="evaluations at once (default: %(default)s)")
    parser.add_argument(
        "--retry-for",
        type=float,
        default=60.0,
        metavar="SECONDS",
        help="how long to try again while the service cannot be reached or is busy (default: %(default)g)",
    )
    options = parser.parse_args(arguments)
    try:
        with Client(retry_for=options.retry_for) as client:
            models = _read_all(options.models, client)
            for model in models:
                print(_line(model), file=sys.stderr)
            serve(models, options.host, options.port, options.threads)
    except (SignoriniError, OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def _read_all(named: Sequence[str], client: Client) -> list[Model]:
    """The models of the command line. Raises ValueError with everything that is wrong with any of them."""
    models: list[Model] = []
    wrong: list[str] = []
    for text in named:
        name, equals, path = text.partition("=")
        try:
            if not equals:
                raise ValueError(f"{text}: expected NAME=FILE.json")
            if name in (model.name for model in models):
                raise ValueError(f"{text}: there are two models {name}")
            models.append(Model.from_file(name, path, client))
        except (InvalidProblem, OSError, ValueError) as error:
            wrong.append(str(error))
    if wrong:
        raise ValueError("\n".join(wrong))
    return models


def _line(model: Model) -> str:
    """A model in one line."""
    derivatives = (
        "with derivatives" if model.supports_gradient() else "no derivatives, since an input is 0 in the problem"
    )
    title = f" ({model.title})" if model.title else ""
    return f"{model.name}{title}: inputs {model.get_input_sizes()}, outputs {model.get_output_sizes()}, {derivatives}"


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    # threads that wait for jobs would keep the program until those end
    os._exit(code)
