//! The operations for the queue, errors, the description of the API, the page, and the probes.

use std::fmt::Display;

use axum::{
    Json,
    http::header,
    response::{IntoResponse, Response},
};
use base::{
    catalog::{self, Code, Kind, WarningKind},
    metrics::in_older_format,
    values::Words,
};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;
use service::{
    error::ApiError,
    parameters::{Parameter, Variable},
    verbs::{
        info::{self as about, Info, Me, OwnerUse},
        metrics::metrics as all_metrics,
        queue::{self as verbs, Forecast, QueueState},
        workers::{self, Workers},
    },
};
use solver::solution::WarningCode;

use super::{
    content::{bytes, json, nothing},
    operation::{ADMIN, IDENTIFIED, OPEN, Operation, READ, delete, get, post, probe},
};
use crate::rest::{
    accept::{accepted, prefers, weight},
    bodies::LogIn,
    call::Call,
    docs::{self, FILE},
    page,
    session::{self, Session},
};

pub(super) fn operations() -> Vec<Operation> {
    vec![
        get(READ, "/v1/queue", (), get_queue)
            .rpcs(&["GetQueue"])
            .summary("Returns the state of the queue")
            .answers(200, "Its state", json::<QueueState>()),
        get(READ, "/v1/queue/waiting", (), list_waiting)
            .rpcs(&["ListWaiting"])
            .summary("Returns the waiting jobs, why each waits and in how many seconds it may start, and the load of the last hour")
            .answers(200, "The waiting jobs and the load", json::<Forecast>()),
        get(READ, "/v1/workers", (), list_workers)
            .rpcs(&["ListWorkers"])
            .summary("Returns the workers on other machines that solve jobs of this service")
            .answers(200, "The workers", json::<Workers>()),
        post(ADMIN, "/v1/queue/pause", (), pause_queue)
            .rpcs(&["PauseQueue"])
            .summary("Pauses the queue: no more jobs are started until it is resumed, also after a restart; running jobs continue")
            .answers(200, "The state of the queue", json::<QueueState>())
            .fails(&[Code::StorageFull]),
        post(ADMIN, "/v1/queue/resume", (), resume_queue)
            .rpcs(&["ResumeQueue"])
            .summary("Resumes the queue: jobs are started again")
            .answers(200, "The state of the queue", json::<QueueState>())
            .fails(&[Code::StorageFull]),
        get(READ, "/v1/info", (), get_server_info)
            .rpcs(&["GetServerInfo"])
            .summary("Returns the version and the limits of this service")
            .answers(200, "Version and limits", json::<Info>()),
        get(IDENTIFIED, "/v1/me", (), get_caller)
            .rpcs(&["GetCaller"])
            .summary("Returns the caller: their owner name, scopes, and limits")
            .answers(200, "The caller", json::<Me>()),
        get(ADMIN, "/v1/owners", (), list_owners)
            .rpcs(&["ListOwners"])
            .summary("Returns the use of the service by every owner: stored jobs and bytes, queued and running jobs")
            .answers(200, "The owners, those with the most stored bytes first", json::<Owners>()),
        get(OPEN, "/v1/errors/{code}", (CODE,), get_error)
            .rest_only("GetError")
            .summary("Explains a kind of error and what to do, for programs or as a page")
            .answers(200, "The explanation", [json::<Kind>(), bytes("text/html")].concat()),
        get(OPEN, "/v1/warnings/{code}", (WARNING,), get_warning)
            .rest_only("GetWarning")
            .summary("Explains a warning of a result, for programs or as a page")
            .answers(200, "The explanation", [json::<WarningKind>(), bytes("text/html")].concat()),
        get(READ, "/v1/schema/problem.json", (), get_problem_schema)
            .rest_only("GetProblemSchema")
            .summary("Returns the JSON Schema of a problem: every field with its meaning and default")
            .answers(200, "The schema", bytes("application/json")),
        get(READ, "/openapi.json", (), get_openapi)
            .rest_only("GetOpenApi")
            .summary("Returns this description of the API over REST")
            .answers(200, "An OpenAPI document", bytes("application/json")),
        get(READ, "/proto/signorini.proto", (), get_proto)
            .rest_only("GetProto")
            .summary("Returns the description of the API over gRPC")
            .answers(200, "The protocol buffers", bytes("text/plain")),
        get(OPEN, "/", (PAGE_QUERY,), page::page)
            .rest_only("GetHome")
            .summary("Shows the page for people: jobs, results, new problems, the queue. It has no data of its own, and works offline")
            .answers(200, "The page", bytes("text/html")),
        post(OPEN, "/v1/session", (), session::create_session)
            .rest_only("CreateSession")
            .summary("Begins a session of a browser: a token becomes a cookie that scripts cannot read, for at most 12 hours. A form is answered with the page")
            .body([json::<LogIn>(), bytes("application/x-www-form-urlencoded")].concat())
            .answers(201, "The session, with its cookie", json::<Session>())
            .answers(303, "The page, after a form was sent", nothing())
            .fails(&[Code::Unauthenticated, Code::InvalidProblem]),
        delete(OPEN, "/v1/session", (), session::delete_session)
            .rest_only("DeleteSession")
            .summary("Ends the session of a browser; its token remains valid")
            .answers(204, "The cookie is removed", nothing()),
        get(READ, "/docs", (), docs::page)
            .rest_only("GetDocs")
            .summary("Shows a page with this description, on which requests can be tried out; it works offline")
            .answers(200, "The page", bytes("text/html")),
        get(READ, "/docs/{file}", (FILE,), docs::file)
            .rest_only("GetDocsFile")
            .summary("Returns a file that the page at /docs loads")
            .answers(200, "The file", PARTS.map(bytes).concat()),
        get(READ, "/metrics", (), get_metrics)
            .rest_only("GetMetrics")
            .summary("Returns metrics for Prometheus: queue, jobs, solver, store, requests, memory, process")
            .answers(200, "The text format of Prometheus or, if Accept asks for it, of OpenMetrics",
                ["text/plain", "application/openmetrics-text"].map(bytes).concat()),
        probe("/livez", live)
            .rest_only("Live")
            .summary("Answers as long as the process is alive")
            .answers(200, "ok", bytes("text/plain")),
        probe("/readyz", ready)
            .rest_only("Ready")
            .summary("Answers 200 while the service accepts jobs and can read them; the first line is ok or degraded")
            .answers(200, "ok; or degraded with the reason, such as a full disk or damaged records", bytes("text/plain"))
            .fails(&[Code::CorruptData, Code::Draining, Code::StorageLost]),
    ]
}

/// What the address of the page says after a log-in that failed.
const PAGE_QUERY: Parameter<Words<()>> = Parameter {
    name: "login",
    meaning: "Whether a log-in has failed, for the page itself",
    values: Words(|| vec![("failed", ())]),
};

/// The media types of the files that the page at `/docs` loads.
const PARTS: [&str; 3] = ["text/css", "text/javascript", "text/plain"];

async fn get_queue(call: Call) -> Result<Json<QueueState>, ApiError> {
    Ok(Json(verbs::state(&call.service, &call.caller)))
}

async fn list_waiting(call: Call) -> Result<Json<Forecast>, ApiError> {
    Ok(Json(verbs::waiting(&call.service, &call.caller).await?))
}

async fn list_workers(call: Call) -> Result<Json<Workers>, ApiError> {
    Ok(Json(workers::list(&call.service, &call.caller)))
}

async fn pause_queue(call: Call) -> Result<Json<QueueState>, ApiError> {
    Ok(Json(verbs::pause(&call.service, &call.caller).await?))
}

async fn resume_queue(call: Call) -> Result<Json<QueueState>, ApiError> {
    Ok(Json(verbs::resume(&call.service, &call.caller).await?))
}

async fn get_server_info(call: Call) -> Result<Json<Info>, ApiError> {
    Ok(Json(about::info(&call.service, &call.caller).await?))
}

async fn get_caller(call: Call) -> Result<Json<Me>, ApiError> {
    Ok(Json(about::me(&call.service, &call.caller).await?))
}

/// The owners and their use of the service.
#[derive(Serialize, JsonSchema)]
struct Owners {
    /// The owners, those with the most stored bytes first.
    owners: Vec<OwnerUse>,
}

async fn list_owners(call: Call) -> Result<Json<Owners>, ApiError> {
    let owners = about::owners(&call.service, &call.caller).await?;
    Ok(Json(Owners { owners }))
}

/// The variable of a path that names a kind of error.
const CODE: Variable<Words<Code>> = Variable {
    name: "code",
    kind: "error",
    meaning: "The kind of error",
    values: Words::all(),
};

/// Answers with the explanation of a kind of error: as JSON for programs, or as a page for people.
async fn get_error(call: Call, code: Code) -> Result<Response, ApiError> {
    let kind = code.kind();
    let mut texts: Vec<String> = kind.facts().iter().map(ToString::to_string).collect();
    texts.push(kind.explanation.to_string());
    Ok(explained(&call, &kind, kind.code, kind.title, &texts, None))
}

/// Answers with an explanation: as a page for a person who follows a link, or as JSON.
fn explained(
    call: &Call,
    kind: &impl Serialize,
    code: impl Display,
    title: &str,
    texts: &[String],
    picture: Option<&str>,
) -> Response {
    let vary = [(header::VARY, "Accept")];
    if !prefers(&call.headers, &["text/html"]) {
        return (vary, Json(kind)).into_response();
    }
    let html = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (
            header::CONTENT_SECURITY_POLICY,
            "default-src 'none'; style-src 'unsafe-inline'",
        ),
    ];
    let escaped = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;");
    let texts = texts.iter().map(|text| format!("<p>{}</p>", escaped(text)));
    let texts: String = texts.collect();
    let picture = picture.map_or_else(String::new, |picture| {
        format!("<pre>{}</pre>", escaped(picture))
    });
    let title = escaped(title);
    let page = format!(
        "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content=\"width=device-width\">\
         <title>{code} – Signorini</title>\
         <style>body{{font:1rem/1.5 system-ui,sans-serif;max-width:40rem;margin:3rem auto;padding:0 1rem}}\
         code{{font-size:1.1em}}</style>\
         <h1>{title}</h1><p><code>{code}</code></p>{texts}{picture}</html>\n"
    );
    (vary, html, page).into_response()
}

/// The variable of a path that names a kind of warning.
const WARNING: Variable<Words<WarningCode>> = Variable {
    name: "code",
    kind: "warning",
    meaning: "The code of a warning",
    values: Words::all(),
};

/// Answers with the explanation of a kind of warning.
async fn get_warning(call: Call, code: WarningCode) -> Result<Response, ApiError> {
    let kind = catalog::warning(code);
    let texts = [kind.why, kind.advice].map(str::to_owned);
    Ok(explained(
        &call,
        &kind,
        kind.code,
        &kind.title,
        &texts,
        kind.picture,
    ))
}

/// Returns the JSON Schema of a problem.
async fn get_problem_schema(_: Call) -> Result<Json<Value>, ApiError> {
    Ok(Json(files::schema()))
}

/// Returns the description of the API over REST.
async fn get_openapi(call: Call) -> Result<Json<&'static Value>, ApiError> {
    Ok(Json((call.openapi)()))
}

/// Returns the description of the API over gRPC.
async fn get_proto(_: Call) -> Result<impl IntoResponse, ApiError> {
    const TEXT: &str = include_str!("../../../../../proto/signorini/v1/signorini.proto");
    Ok(([(header::CONTENT_TYPE, "text/plain; charset=utf-8")], TEXT))
}

/// Returns metrics in the text format of OpenMetrics for a client that asks for it, and otherwise in the older one, which
/// every program reads.
async fn get_metrics(call: Call) -> Result<impl IntoResponse, ApiError> {
    let text = all_metrics(&call.service, &call.caller).await?;
    let accepted = accepted(&call.headers);
    let [open, older] = [OPENMETRICS, "text/plain"].map(|format| weight(&accepted, media(format)));
    // Prometheus names both, the one that it prefers first; `*/*` is no wish for either
    let (text, format) = if open.0 > 0.0 && open.1 > 1 && open > older {
        (text, OPENMETRICS)
    } else {
        (in_older_format(&text), PROMETHEUS_TEXT)
    };
    let headers = [(header::CONTENT_TYPE, format), (header::VARY, "Accept")];
    Ok((headers, text))
}

fn media(format: &str) -> &str {
    format.split(';').next().unwrap_or_default()
}

/// The media types of metrics.
const OPENMETRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";
const PROMETHEUS_TEXT: &str = "text/plain; version=0.0.4; charset=utf-8";

/// Answers that the process is alive.
async fn live(_: Call) -> Result<&'static str, ApiError> {
    Ok("ok\n")
}

/// Answers whether the service works; further lines say what does not work. A damaged record is not an error here,
/// since a proxy would then send no more requests, not even for intact records.
async fn ready(call: Call) -> Result<String, ApiError> {
    let health = call.service.health().await?;
    let mut text = String::from(if health.is_whole() {
        "ok\n"
    } else {
        "degraded\n"
    });
    for line in health.lines() {
        text.push_str(&line);
        text.push('\n');
    }
    Ok(text)
}
