//! `/v1/jobs`, `/v1/jobs/{id}`, `…/cancel` and `/v1/problems/validate`.

use axum::{
    Json,
    body::Body,
    extract::{RawQuery, State},
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use serde::Serialize;

use super::{
    Rest,
    request::{JobPath, Params, json_text, preferred_wait_s},
    submission::{bare_problem, submission},
};
use crate::{
    error::ApiError,
    job::{Job, Status},
    verbs::{
        jobs::{self as verbs, Cancellation, MAX_PAGE_SIZE, MAX_WAIT_S, PAGE_SIZE},
        problems,
    },
};

/// Seconds after which to look again for a job that was accepted.
const LOOK_AGAIN_S: u64 = 1;

pub(super) async fn create(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    rest.service.accepting()?;
    let text = json_text(&headers, body, rest.max_body_bytes).await?;
    let (envelope, problem) = rest.service.work(move || submission(&text)).await??;
    let mut job = verbs::create(&rest.service, envelope, problem).await?;
    let wait_s = preferred_wait_s(&headers).map(|seconds| seconds.min(MAX_WAIT_S as u64));
    if let Some(wait_s) = wait_s {
        job = verbs::wait(&rest.service, job.id, wait_s as f64).await?;
    }
    let done = wait_s.is_some() && job.status.is_terminal();
    let status = if done {
        StatusCode::CREATED
    } else {
        StatusCode::ACCEPTED
    };
    let mut response = (status, one(&job)).into_response();
    let mut set = |name: HeaderName, value: String| {
        if let Ok(value) = HeaderValue::from_str(&value) {
            response.headers_mut().insert(name, value);
        }
    };
    set(header::LOCATION, format!("/v1/jobs/{}", job.id));
    match wait_s {
        Some(wait_s) if done => set(
            HeaderName::from_static("preference-applied"),
            format!("wait={wait_s}"),
        ),
        _ => set(header::RETRY_AFTER, LOOK_AGAIN_S.to_string()),
    }
    Ok(response)
}

pub(super) async fn validate(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    body: Body,
) -> Result<Json<problems::Judgement>, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    let text = json_text(&headers, body, rest.max_body_bytes).await?;
    let problem = rest.service.work(move || bare_problem(&text)).await??;
    Ok(Json(problems::validate(&rest.service, problem).await?))
}

pub(super) async fn get(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    path: JobPath,
) -> Result<Response, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    Ok(one(&verbs::get(&rest.service, path.id).await?))
}

pub(super) async fn list(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
) -> Result<Json<List>, ApiError> {
    let params = Params::parse(query.as_deref(), &["status", "page_size", "page_token"])?;
    let statuses = params
        .all("status")
        .flat_map(|list| list.split(','))
        .map(|word| {
            let expected = "queued, running, succeeded, failed or canceled";
            Status::parse(word).ok_or(ApiError::BadParameter {
                name: "status",
                got: word.into(),
                expected,
            })
        })
        .collect::<Result<Vec<_>, _>>()?;
    let page_size = params.number(
        "page_size",
        1..=MAX_PAGE_SIZE,
        "a whole number from 1 to 1000",
    )?;
    let token = params.one("page_token").filter(|token| !token.is_empty());
    let page = verbs::list(
        &rest.service,
        &statuses,
        page_size.unwrap_or(PAGE_SIZE),
        token,
    )
    .await?;
    Ok(Json(List {
        jobs: page.jobs,
        next_page_token: page.next,
    }))
}

pub(super) async fn cancel(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    path: JobPath,
) -> Result<Response, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    let (outcome, job) = verbs::cancel(&rest.service, path.id).await?;
    Ok(tagged(&job, Canceled { outcome, job: &job }))
}

/// One job with its version as entity tag.
fn one(job: &Job) -> Response {
    tagged(job, job)
}

fn tagged(job: &Job, body: impl Serialize) -> Response {
    ([(header::ETAG, format!("\"{}\"", job.version))], Json(body)).into_response()
}

/// A page of jobs.
#[derive(Serialize)]
pub(super) struct List {
    jobs: Vec<Job>,
    next_page_token: Option<String>,
}

/// What asking a job to stop did, and the job.
#[derive(Serialize)]
struct Canceled<'a> {
    outcome: Cancellation,
    job: &'a Job,
}
