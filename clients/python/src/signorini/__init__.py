"""Client of Signorini, a service that solves frictional contact problems by finite elements.

    import signorini as sg

    client = sg.Client()                                # SIGNORINI_URL, SIGNORINI_TOKEN
    job = client.submit(sg.examples.rectangular_punch(rho=0.01), name="punch")
    result = job.wait()
    print(result.verdict, result.normal_force)          # a number with its error

From the ground up:

    problem     the types of a problem, generated from the service's schema
    examples    the five examples of the thesis
    mesh        meshes from files and from meshio
    obstacle    obstacles from arrays
    Client      submits, finds, lists; AsyncClient the same with asyncio
    Job         waits, follows, cancels
    Result      numbers with their errors, profiles, fields, figures
    Sweep       one problem with many values, as one table
    figures     what can be drawn, and in which style
    errors      what can go wrong
    umbridge    a problem as a function of vectors, also for programs that speak UM-Bridge; imported by itself

Where to look in this package, for those who change it:

    problem, _parts, _shapes     types of a problem (generated); what is wrong with a value; where its parts lie
    _calls                       each request, as data
    _answer, _events             whether an answer is the service's, and whole; the stream of events
    _retry                       when a request is sent again
    _pool, _connection           connections, one for each call; address, token and certificates
    client, job, result, sweep   the blocking client
    aio                          the same with asyncio
    _job, _sweep                 what both clients share
    _data, _saved                numbers with their errors, profiles, histories, fields; a result in a file
    figures, _style, _about      figures, their look, and the texts in them
    _html, _progress             what notebooks show; the line of progress
    local                        a service for as long as a script runs
    umbridge, _model, _parametrised   the server of UM-Bridge; a problem as a function; its definition, paths of numbers
"""

from . import errors, examples, figures, mesh, obstacle, problem
from ._calls import Spaced, Submission, linspace, logspace
from ._connection import package_version
from ._data import (
    ContactResult,
    Event,
    Fields,
    History,
    Number,
    Peak,
    Profile,
    StoredMesh,
    Validation,
    Warning,
)
from ._sweep import SweepTable
from .aio import AsyncClient, AsyncJob, AsyncResult, AsyncSweep
from .client import Client
from .errors import (
    ApiError,
    BadRequest,
    Conflict,
    ConnectionLost,
    Deleted,
    Forbidden,
    InvalidProblem,
    JobActive,
    JobCanceled,
    JobFailed,
    NoResult,
    NotFound,
    QuotaExceeded,
    RateLimited,
    ResultNotReady,
    ServiceError,
    SignoriniError,
    StaleVersion,
    StorageFull,
    TooLarge,
    Unauthenticated,
    Unavailable,
    UnexpectedAnswer,
    Violation,
    WaitTimeout,
)
from .job import Job
from .local import LocalServer
from .problem import Problem
from .result import Result
from .sweep import Sweep

__version__ = package_version()

__all__ = [
    "ApiError",
    "AsyncClient",
    "AsyncJob",
    "AsyncResult",
    "AsyncSweep",
    "BadRequest",
    "Client",
    "Conflict",
    "ConnectionLost",
    "ContactResult",
    "Deleted",
    "Event",
    "Fields",
    "Forbidden",
    "History",
    "InvalidProblem",
    "Job",
    "JobActive",
    "JobCanceled",
    "JobFailed",
    "LocalServer",
    "NoResult",
    "NotFound",
    "Number",
    "Peak",
    "Problem",
    "Profile",
    "QuotaExceeded",
    "RateLimited",
    "Result",
    "ResultNotReady",
    "ServiceError",
    "SignoriniError",
    "Spaced",
    "StaleVersion",
    "StorageFull",
    "StoredMesh",
    "Submission",
    "Sweep",
    "SweepTable",
    "TooLarge",
    "Unauthenticated",
    "Unavailable",
    "UnexpectedAnswer",
    "Validation",
    "Violation",
    "WaitTimeout",
    "Warning",
    "errors",
    "examples",
    "figures",
    "linspace",
    "logspace",
    "mesh",
    "obstacle",
    "problem",
]
