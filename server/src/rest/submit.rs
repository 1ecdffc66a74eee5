//! `POST /v1/jobs`, `PUT /v1/jobs/{id}`, `POST /v1/jobs/batch` and `…/{id}/retry`; `/v1/problems/validate`.

use axum::{
    Json,
    body::{Body, HttpBody},
    extract::{RawQuery, State},
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use schemars::JsonSchema;
use serde::Serialize;

use super::{
    Rest,
    bodies::{self, bare_problem, batch, submission},
    events,
    jobs::{one, tag},
    request::{JobPath, Params, idempotency_key, json_text, preferred_wait_s},
};
use crate::{
    error::ApiError,
    job::{Job, JobId},
    verbs::{
        problems,
        retry::{self, Changes},
        submit::{self as verbs, Handed},
        watch::{self, MAX_WAIT_S, Until},
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
    hand_in(rest, query, headers, body, None).await
}

pub(super) async fn put(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    path: JobPath,
    body: Body,
) -> Result<Response, ApiError> {
    hand_in(rest, query, headers, body, Some(path.id)).await
}

async fn hand_in(
    rest: Rest,
    query: Option<String>,
    headers: HeaderMap,
    body: Body,
    id: Option<JobId>,
) -> Result<Response, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    rest.service.accepting()?;
    let key = idempotency_key(&headers)?;
    let text = json_text(&headers, body, rest.service.max_body_bytes).await?;
    let draft = rest.service.work(move || submission(&text)).await??;
    let handed = verbs::create(&rest.service, draft, id, key).await?;
    answer(&rest, &headers, handed, id.is_some()).await
}

pub(super) async fn retry(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    path: JobPath,
    body: Body,
) -> Result<Response, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    let key = idempotency_key(&headers)?;
    let changes = match body.is_end_stream() {
        false => bodies::retry(&json_text(&headers, body, rest.service.max_body_bytes).await?)?,
        true => Changes::default(), // nothing was sent
    };
    let handed = retry::retry(&rest.service, path.id, changes, key).await?;
    answer(&rest, &headers, handed, false).await
}

/// The job: at once, or when it is done, or as a stream of its events.
async fn answer(
    rest: &Rest,
    headers: &HeaderMap,
    handed: Handed<Job>,
    named: bool,
) -> Result<Response, ApiError> {
    let Handed {
        accepted: mut job,
        replayed,
    } = handed;
    if let Some(mut response) = events::wanted(headers, &rest.service, &job, 0) {
        *response.status_mut() = StatusCode::ACCEPTED;
        set(&mut response, header::LOCATION, location(&job));
        set(&mut response, header::ETAG, tag(&job));
        note_replay(&mut response, replayed);
        return Ok(response);
    }
    let wait_s = preferred_wait_s(headers).map(|seconds| seconds.min(MAX_WAIT_S as u64));
    if let Some(wait_s) = wait_s {
        (job, _) = watch::wait(&rest.service, job.id, Until::Terminal, wait_s as f64).await?;
    }
    let done = wait_s.is_some() && job.status.is_terminal();
    let status = match (named && replayed, done) {
        (true, _) => StatusCode::OK,
        (false, true) => StatusCode::CREATED,
        (false, false) => StatusCode::ACCEPTED,
    };
    let mut response = (status, one(&job)).into_response();
    set(&mut response, header::LOCATION, location(&job));
    note_replay(&mut response, replayed);
    match wait_s {
        Some(wait_s) if done => {
            let name = HeaderName::from_static("preference-applied");
            set(&mut response, name, format!("wait={wait_s}"));
        }
        _ if status == StatusCode::ACCEPTED => {
            set(&mut response, header::RETRY_AFTER, LOOK_AGAIN_S.to_string());
        }
        _ => {}
    }
    Ok(response)
}

fn location(job: &Job) -> String {
    format!("/v1/jobs/{}", job.id)
}

fn note_replay(response: &mut Response, replayed: bool) {
    if replayed {
        let name = HeaderName::from_static("idempotency-replayed");
        set(response, name, "true".into());
    }
}

fn set(response: &mut Response, name: HeaderName, value: String) {
    if let Ok(value) = HeaderValue::from_str(&value) {
        response.headers_mut().insert(name, value);
    }
}

/// Jobs that were accepted together.
#[derive(Serialize, JsonSchema)]
pub(super) struct Batch {
    jobs: Vec<Job>,
}

pub(super) async fn create_batch(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    rest.service.accepting()?;
    let key = idempotency_key(&headers)?;
    let text = json_text(&headers, body, rest.service.max_body_bytes).await?;
    let drafts = rest.service.work(move || batch(&text)).await??;
    let drafts = drafts.map_err(ApiError::InvalidProblem)?;
    let Handed { accepted, replayed } = verbs::create_batch(&rest.service, drafts, key).await?;
    let batch = Batch { jobs: accepted };
    let mut response = (StatusCode::ACCEPTED, Json(batch)).into_response();
    set(&mut response, header::RETRY_AFTER, LOOK_AGAIN_S.to_string());
    note_replay(&mut response, replayed);
    Ok(response)
}

pub(super) async fn validate(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    body: Body,
) -> Result<Json<problems::Judgement>, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    let text = json_text(&headers, body, rest.service.max_body_bytes).await?;
    let problem = rest.service.work(move || bare_problem(&text)).await??;
    Ok(Json(problems::validate(&rest.service, problem).await?))
}
