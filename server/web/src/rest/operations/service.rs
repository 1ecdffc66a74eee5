//! The operations for checking a problem, the queue, errors, the description of the API, and the probes.

use ::service::verbs::{
    info::{Info, Me},
    problems::Validation,
    queue::QueueState,
};
use base::catalog::{Code, Kind, WarningKind};

use super::{
    content::{bytes, json, submission},
    operation::{ADMIN, IDENTIFIED, OPEN, Operation, READ, SUBMIT, get, post, probe},
};
use crate::rest::{
    bodies::BareProblem,
    docs::{self, FILE},
    service::{self, CODE, WARNING},
    submit,
};

pub(super) fn operations() -> Vec<Operation> {
    vec![
        post(SUBMIT, "/v1/problems/validate", (), submit::validate)
            .rpcs(&["ValidateProblem"])
            .summary("Checks a problem and estimates its cost; stores nothing; an invalid problem is also answered with 200")
            .body(json::<BareProblem>())
            .example(submission())
            .answers(200, "Whether it is valid, and its estimated cost", json::<Validation>())
            .fails(&[Code::InvalidProblem]),
        get(READ, "/v1/queue", (), service::queue)
            .rpcs(&["GetQueue"])
            .summary("Returns the state of the queue")
            .answers(200, "Its state", json::<QueueState>()),
        post(ADMIN, "/v1/queue/pause", (), service::pause)
            .rpcs(&["PauseQueue"])
            .summary("Pauses the queue: no more jobs are started until it is resumed, also after a restart; running jobs continue")
            .answers(200, "The state of the queue", json::<QueueState>())
            .fails(&[Code::StorageFull]),
        post(ADMIN, "/v1/queue/resume", (), service::resume)
            .rpcs(&["ResumeQueue"])
            .summary("Resumes the queue: jobs are started again")
            .answers(200, "The state of the queue", json::<QueueState>())
            .fails(&[Code::StorageFull]),
        get(READ, "/v1/info", (), service::info)
            .rpcs(&["GetServerInfo"])
            .summary("Returns the version and the limits of this service")
            .answers(200, "Version and limits", json::<Info>()),
        get(IDENTIFIED, "/v1/me", (), service::me)
            .rpcs(&["GetCaller"])
            .summary("Returns the caller: their owner name, scopes, and limits")
            .answers(200, "The caller", json::<Me>()),
        get(ADMIN, "/v1/owners", (), service::owners)
            .rpcs(&["ListOwners"])
            .summary("Returns the use of the service by every owner: stored jobs and bytes, queued and running jobs")
            .answers(200, "The owners, those with the most stored bytes first", json::<service::Owners>()),
        get(OPEN, "/v1/errors/{code}", (CODE,), service::error)
            .rest_only("GetError")
            .summary("Explains a kind of error and what to do, for programs or as a page")
            .answers(200, "The explanation", [json::<Kind>(), bytes("text/html")].concat()),
        get(OPEN, "/v1/warnings/{code}", (WARNING,), service::warning)
            .rest_only("GetWarning")
            .summary("Explains a warning of a result")
            .answers(200, "The explanation", json::<WarningKind>()),
        get(READ, "/v1/schema/problem.json", (), service::schema)
            .rest_only("GetProblemSchema")
            .summary("Returns the JSON Schema of a problem: every field with its meaning and default")
            .answers(200, "The schema", bytes("application/json")),
        get(READ, "/openapi.json", (), service::openapi)
            .rest_only("GetOpenApi")
            .summary("Returns this description of the API over REST")
            .answers(200, "An OpenAPI document", bytes("application/json")),
        get(READ, "/proto/signorini.proto", (), service::proto)
            .rest_only("GetProto")
            .summary("Returns the description of the API over gRPC")
            .answers(200, "The protocol buffers", bytes("text/plain")),
        get(READ, "/docs", (), docs::page)
            .rest_only("GetDocs")
            .summary("Shows a page with this description, on which requests can be tried out; it works offline")
            .answers(200, "The page", bytes("text/html")),
        get(READ, "/docs/{file}", (FILE,), docs::file)
            .rest_only("GetDocsFile")
            .summary("Returns a file that the page at /docs loads")
            .answers(200, "The file", PARTS.map(bytes).concat()),
        get(READ, "/metrics", (), service::metrics)
            .rest_only("GetMetrics")
            .summary("Returns metrics for Prometheus: queue, jobs, solver, store, requests, memory, process")
            .answers(200, "The text format of OpenMetrics", bytes("application/openmetrics-text")),
        probe("/livez", service::livez)
            .rest_only("Live")
            .summary("Answers as long as the process is alive")
            .answers(200, "ok", bytes("text/plain")),
        probe("/readyz", service::readyz)
            .rest_only("Ready")
            .summary("Answers 200 while the service accepts jobs and can read them; the first line is ok or degraded")
            .answers(200, "ok; or degraded with the reason, such as a full disk or damaged records", bytes("text/plain"))
            .fails(&[Code::CorruptData, Code::Draining, Code::StorageLost]),
    ]
}

/// The media types of the files of the page.
const PARTS: [&str; 3] = ["text/css", "text/javascript", "text/plain"];
