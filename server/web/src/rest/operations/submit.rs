//! The operations that submit jobs.

use axum::{
    Json,
    http::{HeaderName, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use base::{
    address::link,
    catalog::Code,
    event::Event,
    job::{Job, JobId},
};
use schemars::JsonSchema;
use serde::Serialize;
use service::{
    error::ApiError,
    verbs::{
        jobs::ID,
        key::{IDEMPOTENCY_KEY, Key, Keys},
        retry::{self, Changes},
        submit::{self as verbs, Submitted},
        watch::{self, Until},
    },
};

use super::{
    content::{json, lines, stream, submission},
    headers::{etag, location, preference_applied, replayed, retry_after},
    jobs::{job_response, tag},
    operation::{Operation, SUBMIT, post, put},
};
use crate::rest::{
    bodies::{self, Retry, Submission, Submissions},
    call::Call,
    events,
    headers::{Header, PREFER},
};

/// The input that reads the idempotency key, the header that makes a request safe to repeat.
pub(super) const KEY: Header<Keys> = Header(IDEMPOTENCY_KEY);

pub(super) fn operations() -> Vec<Operation> {
    vec![
        post(SUBMIT, "/v1/jobs", (KEY, PREFER), create_job)
            .rpcs(&["CreateJob", "SubmitAndWatch"])
            .summary("Submits a job; when the answer is sent, the job is stored on disk")
            .body(json::<Submission>())
            .example(submission())
            .submits(),
        put(SUBMIT, "/v1/jobs/{id}", (ID, KEY, PREFER), put_job)
            .rpcs(&["CreateJob"])
            .named("PutJob")
            .summary("Submits a job under an id chosen by the client; repeating the request changes nothing")
            .body(json::<Submission>())
            .example(submission())
            .answers(200, "The job with this id, submitted before with the same content", json::<Job>())
            .with([location(), etag()])
            .sometimes_with(replayed())
            .submits()
            .fails(&[Code::IdConflict]),
        post(SUBMIT, "/v1/jobs/batch", (KEY,), batch_create_jobs)
            .rpcs(&["BatchCreateJobs"])
            .summary("Submits up to 1000 jobs, all or none of them")
            .body(json::<Submissions>())
            .answers(202, "The accepted jobs, in their order", json::<Batch>())
            .with([retry_after()])
            .sometimes_with(replayed())
            .fails(SUBMITTING),
        post(SUBMIT, "/v1/jobs/{id}/retry", (ID, KEY, PREFER), retry_job)
            .rpcs(&["RetryJob"])
            .summary("Submits the problem of an ended job again as a new job, with the old one as its parent, and without the cache; a body changes its limits and priority")
            .optional_body(json::<Retry>())
            .submits()
            .fails(&[Code::JobActive]),
    ]
}

/// The reasons for which a submission may be refused.
pub(super) const SUBMITTING: &[Code] = &[
    Code::InvalidProblem,
    Code::ProblemTooLarge,
    Code::IdempotencyKeyReuse,
    Code::Deleted, // the key or id of a deleted job
    Code::QuotaExceeded,
    Code::Forbidden, // a priority above 0
    Code::QueueFull,
    Code::Draining,
    Code::StorageFull,
];

impl Operation {
    /// Adds the answers to a submission: the job at once, the job when it has ended, or a stream of its events.
    pub(super) fn submits(self) -> Self {
        let accepted = [json::<Job>(), stream::<Event>(), lines()].concat();
        self.answers(201, "The job, which has ended within the wait", json::<Job>())
            .with([location(), etag(), preference_applied()])
            .sometimes_with(replayed())
            .answers(
                202,
                "The accepted job; with Accept: text/event-stream or application/jsonl its events, as from /events",
                accepted,
            )
            .with([location()])
            .sometimes_with(etag())
            .sometimes_with(retry_after())
            .sometimes_with(replayed())
            .fails(SUBMITTING)
    }
}

/// The number of seconds after which clients should poll a job that was accepted.
const POLL_AFTER_S: u64 = 1;

async fn create_job(
    call: Call,
    key: Option<Key>,
    wait_s: Option<u64>,
) -> Result<Response, ApiError> {
    submit(call, None, key, wait_s).await
}

async fn put_job(
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
    let read = Box::new(move || bodies::submission(&text));
    let submitted = verbs::create(&call.service, &call.caller, read, id, key).await?;
    // the job is stored: waiting for its end takes no memory
    call.received.release();
    answer(call, submitted, wait_s, id.is_some()).await
}

async fn retry_job(
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

/// Answers a submission with the job: at once, or when it has ended, or as a stream of its events.
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
        set(&mut response, header::LOCATION, address_of(&job));
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
    set(&mut response, header::LOCATION, address_of(&job));
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

fn address_of(job: &Job) -> String {
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
struct Batch {
    jobs: Vec<Job>,
}

async fn batch_create_jobs(mut call: Call, key: Option<Key>) -> Result<Response, ApiError> {
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
