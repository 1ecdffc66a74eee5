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

Where to look in this package, for those who change it. Each module uses only those that are named before it; what
type checkers alone read (TYPE_CHECKING) may also name a type that comes later.

    errors, pointer, _extras          what can go wrong; places in a problem; packages that need not be installed
    _paper, _style, _around           how figures are saved; how they look; the texts around them, panels, legends
    _shapes, _profiles, figures       where the parts of a problem lie; figures of profiles; all figures
    _data, _table                     numbers with their errors, profiles, histories, fields; tables
    _parts, _whole, problem           what is wrong with a value; what a problem can do; its types (generated)
    mesh, obstacle, examples          from which a problem is made
    _retry, _answer, _events          when a request is sent again; whether an answer is whole; the stream of events
    _calls                            each request, as data
    _connection, _pool, local         address and certificates; connections, one for each call; a service of one's own
    _progress, _html                  the line of progress; what notebooks show
    _job, _sweep, _about, _saved      what both clients share; what figures say of a result; a result in a file
    job, result, sweep, client        the blocking client; `Result` is in job
    aio                               the same with asyncio
    _parametrised, _model, umbridge   paths of numbers; a problem as a function; the server of UM-Bridge
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
from ._table import JobTable
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
    PartialResult,
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
    "JobTable",
    "LocalServer",
    "NoResult",
    "NotFound",
    "Number",
    "PartialResult",
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
