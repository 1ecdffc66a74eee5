//! The operations `POST /v1/jobs`, `PUT /v1/jobs/{id}`, `POST /v1/jobs/batch` and `…/{id}/retry`;
//! `/v1/problems/validate`.

use axum::{
    Json,
    http::{HeaderName, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use base::{
    address::link,
    job::{Job, JobId},
};
use schemars::JsonSchema;
use serde::Serialize;
use service::{
    error::ApiError,
    verbs::{
        key::Key,
        problems::{self, Validation},
        retry::{self, Changes},
        submit::{self as verbs, Submitted},
        watch::{self, Until},
    },
};

use super::{
    bodies::{self, bare_problem, submission},
    call::Call,
    events,
    jobs::{job_response, tag},
};

/// Seconds after which to poll a job that was accepted.
const POLL_AFTER_S: u64 = 1;

pub(super) async fn create(
    call: Call,
    key: Option<Key>,
    wait_s: Option<u64>,
) -> Result<Response, ApiError> {
    submit(call, None, key, wait_s).await
}

pub(super) async fn put(
    call: Call,
    id: JobId,
    key: Option<Key>,
    wait_s: Option<u64>,
) -> Result<Response, ApiError> {
    submit(call, Some(id), key, wait_s).await
}

async fn submit(
    mut call: Call,
    id: Option<JobId>,
    key: Option<Key>,
    wait_s: Option<u64>,
) -> Result<Response, ApiError> {
    call.service.accepting()?;
    let text = call.json().await?;
    let read = Box::new(move || submission(&text));
    let submitted = verbs::create(&call.service, &call.caller, read, id, key).await?;
    // the job is stored: waiting for its end takes no memory
    call.received.release();
    answer(call, submitted, wait_s, id.is_some()).await
}

pub(super) async fn retry(
    mut call: Call,
    id: JobId,
    key: Option<Key>,
    wait_s: Option<u64>,
) -> Result<Response, ApiError> {
    let changes = if call.has_body() {
        bodies::retry(&call.json().await?)?
    } else {
        Changes::default()
    };
    let submitted = retry::retry(&call.service, &call.caller, id, changes, key).await?;
    answer(call, submitted, wait_s, false).await
}

/// Answers with the job: at once, or when it has ended, or as a stream of its events.
pub(super) async fn answer(
    call: Call,
    submitted: Submitted<Job>,
    wait_s: Option<u64>,
    named: bool,
) -> Result<Response, ApiError> {
    let Call {
        service, caller, ..
    } = &call;
    let Submitted {
        accepted: mut job,
        replayed,
    } = submitted;
    if let Some(encoding) = events::preferred(&call.headers)
        && let Some(events) = watch::watch(service, caller, job.id, 0).await?
    {
        let mut response = events::write(events, encoding);
        *response.status_mut() = StatusCode::ACCEPTED;
        set(&mut response, header::LOCATION, location(&job));
        set(&mut response, header::ETAG, tag(&job));
        note_replay(&mut response, replayed);
        return Ok(response);
    }
    if let Some(wait_s) = wait_s {
        let ended = watch::wait(service, caller, job.id, Until::Terminal, wait_s as f64);
        (job, _) = ended.await?;
    }
    let done = wait_s.is_some() && job.status.is_terminal();
    let status = match (named && replayed, done) {
        (true, _) => StatusCode::OK,
        (false, true) => StatusCode::CREATED,
        (false, false) => StatusCode::ACCEPTED,
    };
    let mut response = (status, job_response(&job)).into_response();
    set(&mut response, header::LOCATION, location(&job));
    note_replay(&mut response, replayed);
    match wait_s {
        Some(wait_s) if done => {
            let name = HeaderName::from_static("preference-applied");
            set(&mut response, name, format!("wait={wait_s}"));
        }
        _ if status == StatusCode::ACCEPTED => {
            set(&mut response, header::RETRY_AFTER, POLL_AFTER_S.to_string());
        }
        _ => {}
    }
    Ok(response)
}

fn location(job: &Job) -> String {
    link(&format!("/v1/jobs/{}", job.id))
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

pub(super) async fn create_batch(mut call: Call, key: Option<Key>) -> Result<Response, ApiError> {
    call.service.accepting()?;
    let text = call.json().await?;
    let requests = call.service.work(move || bodies::batch(&text)).await??;
    let submitted = verbs::create_batch(&call.service, &call.caller, requests, key).await?;
    let batch = Batch {
        jobs: submitted.accepted,
    };
    let mut response = (StatusCode::ACCEPTED, Json(batch)).into_response();
    set(&mut response, header::RETRY_AFTER, POLL_AFTER_S.to_string());
    note_replay(&mut response, submitted.replayed);
    Ok(response)
}

pub(super) async fn validate(mut call: Call) -> Result<Json<Validation>, ApiError> {
    let text = call.json().await?;
    let problem = call.service.work(move || bare_problem(&text)).await??;
    let validation = problems::validate(&call.service, &call.caller, problem).await?;
    Ok(Json(validation))
}
