//! The life of a job: create, get, list, watch, wait, cancel.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use async_stream::try_stream;
use futures_util::Stream;
use solver::{
    error::{Violation, escape},
    problem::Problem,
};
use tokio::time::{Instant, timeout_at};
use tracing::info;

use super::{
    Service, detached, meshes, page,
    problems::{self, Admitted},
};
use crate::{
    error::ApiError,
    event::{Event, Payload},
    job::{Job, JobId, Status},
    store::{CancelOutcome, NewJob, StoreError},
    violations::{Violations, shortened},
};

/// Longest time that a request may wait for a job, in seconds.
pub const MAX_WAIT_S: f64 = 60.0;
/// Jobs on a page, unless asked for otherwise; and at most.
pub const PAGE_SIZE: i64 = 50;
/// Most jobs on a page.
pub const MAX_PAGE_SIZE: i64 = 1000;
/// Events read at a time by a watcher.
const EVENTS_PER_READ: i64 = 256;

/// What a client hands in beside the problem.
#[derive(Clone, Debug, Default)]
pub struct Envelope {
    /// A name for people.
    pub name: Option<String>,
    /// Labels for programs.
    pub labels: BTreeMap<String, String>,
    /// Higher first.
    pub priority: i32,
}

/// Accepts a job. It is durable when this returns. Violations of envelope and problem come
/// together.
pub async fn create(
    service: &Arc<Service>,
    envelope: Envelope,
    problem: Result<Problem, Vec<Violation>>,
) -> Result<Job, ApiError> {
    service.accepting()?;
    let service = service.clone();
    detached(async move {
        let mut violations = envelope.violations();
        let admitted = match problem {
            Ok(problem) => match problems::admit(&service, problem).await {
                Err(ApiError::InvalidProblem(more)) => Err(more),
                admitted => Ok(admitted?),
            },
            Err(more) => Err(more),
        };
        let Admitted {
            title,
            input_hash,
            json,
            mesh,
        } = match admitted {
            Ok(admitted) if violations.is_empty() => admitted,
            refused => {
                violations.extend(refused.err().into_iter().flatten());
                return Err(ApiError::InvalidProblem(violations.into_vec()));
            }
        };
        let Envelope {
            name,
            labels,
            priority,
        } = envelope;
        let new = NewJob {
            name,
            labels,
            priority,
            title,
            input_hash,
            problem: json,
            mesh,
        };
        let limit = service.max_queued;
        let job = service
            .store
            .insert_job(&new, limit)
            .await
            .map_err(|error| match error {
                StoreError::QueueFull => ApiError::QueueFull { limit },
                // it was there when the problem was checked, and has been removed since
                StoreError::UnknownMesh => {
                    let hash = new.mesh.as_deref().unwrap_or_default();
                    ApiError::InvalidProblem(vec![meshes::missing(hash)])
                }
                other => other.into(),
            })?;
        service.queue.wake();
        info!(job.id = %job.id, job.input_hash, "job {} accepted", job.id);
        Ok(job)
    })
    .await
}

impl Envelope {
    /// What is out of bounds.
    fn violations(&self) -> Violations {
        const MOST: usize = 256; // characters of a name or label
        const LABELS: usize = 64;
        let mut found = Violations::default();
        let mut add = |pointer: String, got: String, expected: &str, hint: &str| {
            found.add(Violation {
                pointer,
                reason: "out_of_range".into(),
                got,
                expected: expected.into(),
                hint: hint.into(),
            });
        };
        let length = |text: &str| text.chars().count();
        if let Some(name) = self.name.as_deref().filter(|name| length(name) > MOST) {
            add(
                "/name".into(),
                format!("{} characters", length(name)),
                "at most 256 characters",
                "Shorten it.",
            );
        }
        if !(-10..=10).contains(&self.priority) {
            add(
                "/priority".into(),
                self.priority.to_string(),
                "-10 … 10",
                "Higher runs first; 0 is usual.",
            );
        }
        if self.labels.len() > LABELS {
            add(
                "/labels".into(),
                self.labels.len().to_string(),
                "at most 64 labels",
                "Leave some out.",
            );
        }
        for (key, value) in self.labels.iter().take(LABELS) {
            let longest = length(key).max(length(value));
            if longest > MOST || key.is_empty() {
                let pointer = format!("/labels/{}", escape(&shortened(key, MOST)));
                add(
                    pointer,
                    format!("{longest} characters"),
                    "1 … 256 characters, as key and as value",
                    "Shorten it.",
                );
            }
        }
        found
    }
}

/// The job as it is now.
pub async fn get(service: &Service, id: JobId) -> Result<Job, ApiError> {
    let job = service.store.job(id).await?;
    job.ok_or_else(|| ApiError::NotFound(format!("there is no job {id}")))
}

/// The job when it is terminal, or as it is after `seconds` or when the service stops.
pub async fn wait(service: &Service, id: JobId, seconds: f64) -> Result<Job, ApiError> {
    let until = Instant::now() + Duration::from_secs_f64(seconds.clamp(0.0, MAX_WAIT_S));
    let mut job = get(service, id).await?;
    let mut news = service.queue.subscribe(job.key);
    loop {
        // Read after subscribing: an end in between is not overlooked.
        job = get(service, id).await?;
        if job.status.is_terminal() {
            return Ok(job);
        }
        tokio::select! {
            heard = timeout_at(until, news.news()) => if heard.is_err() { return Ok(job) },
            () = service.queue.stopping().cancelled() => return Ok(job),
        }
    }
}

/// A page of jobs, newest first.
#[derive(Debug)]
pub struct Page {
    /// The jobs.
    pub jobs: Vec<Job>,
    /// Where the next page begins; none after the last.
    pub next: Option<String>,
}

/// Lists jobs of these statuses (none: all), newest first.
pub async fn list(
    service: &Service,
    statuses: &[Status],
    page_size: i64,
    page_token: Option<&str>,
) -> Result<Page, ApiError> {
    let before = page_token
        .map(|token| page::before(token, statuses).ok_or(ApiError::BadPageToken))
        .transpose()?;
    // One more than asked for tells whether there is another page.
    let mut jobs = service.store.jobs(statuses, before, page_size + 1).await?;
    let more = jobs.len() as i64 > page_size;
    jobs.truncate(page_size as usize);
    let next = jobs
        .last()
        .filter(|_| more)
        .map(|job| page::token(job.key, statuses));
    Ok(Page { jobs, next })
}

/// Asks a job to stop.
pub async fn cancel(service: &Arc<Service>, id: JobId) -> Result<(Cancellation, Job), ApiError> {
    let key = get(service, id).await?.key;
    let service = service.clone();
    detached(async move {
        let outcome = match service.queue.cancel(key).await? {
            CancelOutcome::Canceled(_) => Cancellation::Canceled,
            CancelOutcome::Requested { .. } => Cancellation::CancelRequested,
            CancelOutcome::AlreadyTerminal => Cancellation::AlreadyTerminal,
        };
        Ok((outcome, get(&service, id).await?))
    })
    .await
}

/// What asking a job to stop did.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cancellation {
    /// Nobody ran it, and nobody will.
    Canceled,
    /// It was running; it will have ended in half a second.
    CancelRequested,
    /// It had ended.
    AlreadyTerminal,
}

/// Stored events after number `after`, then live ones; ends after `done`, or with the job if `after`
/// lies beyond that. When the service stops it ends with an error, so that nobody takes that for the
/// end of the job.
pub fn watch(
    service: Arc<Service>,
    key: i64,
    after: i64,
) -> impl Stream<Item = Result<Event, ApiError>> + Send {
    try_stream! {
        let mut cursor = after;
        let mut news = service.queue.subscribe(key);
        let mut ended = false;
        loop {
            let events = service.store.events_after(key, cursor, EVENTS_PER_READ).await?;
            let idle = events.is_empty();
            for event in events {
                cursor = event.seq;
                let done = matches!(event.payload, Payload::Done { .. });
                yield event;
                if done {
                    return;
                }
            }
            if idle && ended {
                return;
            }
            if idle && service.store.has_ended(key).await? {
                ended = true;
                continue; // once more: `done` may have come after the look for events
            }
            if service.queue.stopping().is_cancelled() {
                Err(ApiError::Draining)?;
            }
            if idle {
                tokio::select! {
                    () = news.news() => {}
                    () = service.queue.stopping().cancelled() => {}
                }
            }
        }
    }
}

/// Whether a finished job has nothing to tell after number `after`.
pub async fn is_silent(service: &Service, job: &Job, after: i64) -> Result<bool, ApiError> {
    Ok(job.status.is_terminal()
        && service
            .store
            .events_after(job.key, after, 1)
            .await?
            .is_empty())
}
