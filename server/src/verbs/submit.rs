//! Handing in jobs: one, one with a name of the client's, many at once, one again.

use std::{collections::BTreeMap, sync::Arc};

use futures_util::{StreamExt, TryStreamExt};
use serde::Serialize;
use solver::{
    error::{Violation, escape},
    problem::Problem,
};
use tracing::info;

use super::{
    Service, detached, jobs, meshes,
    problems::{self, Admitted},
};
use crate::{
    digest,
    error::ApiError,
    job::{Cache, Job, JobId, Limits},
    store::{Accepted, NewJob, RequestKey, StoreError, Submission},
    violations::{Violations, shortened},
};

/// Most jobs that are handed in together.
pub const MOST_JOBS: usize = 1000;
/// Longest time that a job may run, in seconds: a week.
const MOST_TIMEOUT_S: f64 = 7.0 * 86_400.0;
/// Longest time that it may wait: thirty days.
const MOST_QUEUE_TTL_S: f64 = 30.0 * 86_400.0;
/// Longest key of a request, in characters.
const MOST_KEY: usize = 255;

/// What a client hands in beside the problem.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Envelope {
    /// A name for people.
    pub name: Option<String>,
    /// Labels for programs.
    pub labels: BTreeMap<String, String>,
    /// Higher first.
    pub priority: i32,
    /// What it may take.
    pub limits: Limits,
    /// Whether earlier results may answer it.
    pub cache: Cache,
}

/// A job as it is handed in: the problem, or what is wrong with it.
pub type Draft = (Envelope, Result<Problem, Vec<Violation>>);

/// What became of it.
#[derive(Debug)]
pub struct Handed<T> {
    /// The job or jobs.
    pub accepted: T,
    /// They were there already, by the key or by the name.
    pub replayed: bool,
}

/// Accepts a job. It is durable when this returns. Violations of envelope and problem come together. With
/// a key, or a name of its own, the same request gives the same job, however often it is made.
pub async fn create(
    service: &Arc<Service>,
    draft: Draft,
    id: Option<JobId>,
    key: Option<String>,
) -> Result<Handed<Job>, ApiError> {
    service.accepting()?;
    let key = key.map(checked_key).transpose()?;
    let service = service.clone();
    detached(async move {
        let prepared = prepare(&service, draft, id).await?;
        let payload = prepared.payload.clone();
        let key = key.map(|key| RequestKey { key, payload });
        if let Some(old) = replayed(&service, key.as_ref()).await? {
            return only(old, true);
        }
        // before it is looked at in depth: what was accepted once need not be acceptable now
        if let Some(id) = prepared.id
            && !prepared.payload.is_empty()
            && let Some(old) = service
                .store
                .replay_named(&service.owner(), id, &prepared.payload)
                .await?
        {
            return only(vec![old], true);
        }
        let new = admit(&service, prepared).await?;
        let Accepted { jobs, replayed, .. } = hand_in(&service, vec![new], key).await?;
        only(jobs, replayed)
    })
    .await
}

/// Accepts all of these jobs or none. Violations of all come together, with pointers `/jobs/{n}/…`.
pub async fn create_batch(
    service: &Arc<Service>,
    drafts: Vec<Draft>,
    key: Option<String>,
) -> Result<Handed<Vec<Job>>, ApiError> {
    service.accepting()?;
    let key = key.map(checked_key).transpose()?;
    if drafts.is_empty() || drafts.len() > MOST_JOBS {
        return Err(ApiError::InvalidProblem(vec![Violation {
            pointer: "/jobs".into(),
            reason: "out_of_range".into(),
            got: format!("{} jobs", drafts.len()),
            expected: "1 … 1000 jobs".into(),
            hint: match drafts.is_empty() {
                true => "Send {\"jobs\": [{\"problem\": {…}}, …]}.".into(),
                false => "Hand them in in several batches.".into(),
            },
        }]));
    }
    let service = service.clone();
    detached(async move {
        let prepared = each(drafts, |draft| prepare(&service, draft, None)).await?;
        let key = match key {
            None => None,
            Some(key) => {
                let payloads: Vec<&str> = prepared.iter().map(|job| job.payload.as_str()).collect();
                let payload = digest::of_json(&("batch", payloads)).map_err(ApiError::internal)?;
                Some(RequestKey { key, payload })
            }
        };
        if let Some(accepted) = replayed(&service, key.as_ref()).await? {
            let replayed = true;
            return Ok(Handed { accepted, replayed });
        }
        let jobs = each(prepared, |prepared| admit(&service, prepared)).await?;
        let Accepted { jobs, replayed, .. } = hand_in(&service, jobs, key).await?;
        Ok(Handed {
            accepted: jobs,
            replayed,
        })
    })
    .await
}

/// What is changed of a job that is tried again; what is absent stays.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Changes {
    /// Seconds from a start to the end.
    pub timeout_s: Option<f64>,
    /// Seconds that it may wait for a start.
    pub queue_ttl_s: Option<f64>,
    /// Higher first.
    pub priority: Option<i32>,
}

/// Tries a job that has ended again: the same problem and envelope as a new job, solved anew.
pub async fn retry(
    service: &Arc<Service>,
    id: JobId,
    changes: Changes,
    key: Option<String>,
) -> Result<Handed<Job>, ApiError> {
    service.accepting()?;
    let key = key.map(checked_key).transpose()?;
    let service = service.clone();
    detached(async move {
        let key = match key {
            None => None,
            Some(key) => {
                let payload =
                    digest::of_json(&("retry", id, changes)).map_err(ApiError::internal)?;
                Some(RequestKey { key, payload })
            }
        };
        if let Some(old) = replayed(&service, key.as_ref()).await? {
            return only(old, true);
        }
        let job = jobs::get(&service, id).await?;
        if !job.status.is_terminal() {
            return Err(ApiError::JobActive(job.status.as_str()));
        }
        let stored = service.store.problem(job.key).await?;
        let (title, problem) = stored.ok_or(ApiError::Deleted(id))?;
        let Job {
            name,
            labels,
            priority,
            limits,
            cache,
            ..
        } = job;
        let envelope = Envelope {
            name,
            labels,
            priority: changes.priority.unwrap_or(priority),
            limits: Limits {
                timeout_s: changes.timeout_s.unwrap_or(limits.timeout_s),
                queue_ttl_s: changes.queue_ttl_s.unwrap_or(limits.queue_ttl_s),
            },
            // who kept its result to itself means that still
            cache: match cache {
                Cache::Off => Cache::Off,
                Cache::Use | Cache::Refresh => Cache::Refresh,
            },
        };
        let problem = service.work(move || files::parse(&problem)).await?;
        let problem = problem.map(|problem| Problem { title, ..problem });
        let prepared = prepare(&service, (envelope, problem), None).await?;
        let new = NewJob {
            parent: Some(id),
            ..admit(&service, prepared).await?
        };
        let Accepted { jobs, replayed, .. } = hand_in(&service, vec![new], key).await?;
        only(jobs, replayed)
    })
    .await
}

/// The one job of a submission of one.
fn only(jobs: Vec<Job>, replayed: bool) -> Result<Handed<Job>, ApiError> {
    let accepted = jobs.into_iter().next();
    let accepted =
        accepted.ok_or_else(|| ApiError::internal("a job was accepted, but not given"))?;
    Ok(Handed { accepted, replayed })
}

/// Does the same with each of many, a few at a time, in order; of those that are invalid all are told.
async fn each<A, B, F: Future<Output = Result<B, ApiError>>>(
    many: Vec<A>,
    work: impl Fn(A) -> F,
) -> Result<Vec<B>, ApiError> {
    const AT_ONCE: usize = 4;
    let mut done = vec![];
    let mut violations = Violations::default();
    let numbered = many.into_iter().enumerate();
    let mut results = futures_util::stream::iter(numbered)
        .map(|(n, one)| {
            let working = work(one);
            async move { Ok::<_, ApiError>((n, working.await)) }
        })
        .buffered(AT_ONCE);
    while let Some((n, result)) = results.try_next().await? {
        match result {
            Ok(one) => done.push(one),
            Err(ApiError::InvalidProblem(found)) => {
                violations.extend(problems::prefixed(&format!("/jobs/{n}"), found));
            }
            Err(other) => return Err(other),
        }
    }
    if violations.is_empty() {
        Ok(done)
    } else {
        Err(ApiError::InvalidProblem(violations.into_vec()))
    }
}

/// A job that was read, but not yet checked in depth.
struct Prepared {
    envelope: Envelope,
    problem: Result<Problem, Vec<Violation>>,
    violations: Violations,
    id: Option<JobId>,
    /// Fingerprint of all that was handed in.
    payload: String,
}

async fn prepare(
    service: &Service,
    (envelope, problem): Draft,
    id: Option<JobId>,
) -> Result<Prepared, ApiError> {
    let violations = envelope.violations();
    service
        .work(move || {
            let payload = match &problem {
                Ok(problem) => {
                    digest::of_json(&(&envelope, problem, id)).map_err(ApiError::internal)?
                }
                Err(_) => String::new(), // it is refused before anybody compares
            };
            Ok(Prepared {
                envelope,
                problem,
                violations,
                id,
                payload,
            })
        })
        .await?
}

/// The jobs of a key that was used before, for the same request.
async fn replayed(
    service: &Service,
    key: Option<&RequestKey>,
) -> Result<Option<Vec<Job>>, ApiError> {
    match key {
        Some(key) if !key.payload.is_empty() => {
            Ok(service.store.replay(&service.owner(), key).await?)
        }
        _ => Ok(None),
    }
}

async fn admit(service: &Service, prepared: Prepared) -> Result<NewJob, ApiError> {
    let Prepared {
        envelope,
        problem,
        mut violations,
        id,
        payload,
    } = prepared;
    let admitted = match problem {
        Ok(problem) => match problems::admit(service, problem).await {
            Err(ApiError::InvalidProblem(more)) => Err(more),
            admitted => Ok(admitted?),
        },
        Err(more) => Err(more),
    };
    match admitted {
        Ok(admitted) if violations.is_empty() => {
            let Admitted {
                title,
                input_hash,
                json,
                mesh,
            } = admitted;
            let Envelope {
                name,
                labels,
                priority,
                limits,
                cache,
            } = envelope;
            Ok(NewJob {
                id,
                name,
                labels,
                priority,
                limits,
                cache,
                parent: None,
                title,
                input_hash,
                problem: json,
                mesh,
                payload,
            })
        }
        refused => {
            violations.extend(refused.err().into_iter().flatten());
            Err(ApiError::InvalidProblem(violations.into_vec()))
        }
    }
}

async fn hand_in(
    service: &Arc<Service>,
    jobs: Vec<NewJob>,
    key: Option<RequestKey>,
) -> Result<Accepted, ApiError> {
    let limit = service.max_queued;
    let hash = jobs.iter().find_map(|job| job.mesh.clone());
    let submission = Submission {
        owner: service.owner(),
        jobs,
        key,
        max_queued: limit,
    };
    let accepted = service.queue.submit(submission).await;
    let accepted = accepted.map_err(|error| match error {
        StoreError::QueueFull => ApiError::QueueFull { limit },
        // it was there when the problem was checked, and has been removed since
        StoreError::UnknownMesh => {
            ApiError::InvalidProblem(vec![meshes::missing(&hash.unwrap_or_default())])
        }
        other => other.into(),
    })?;
    for job in &accepted.jobs {
        info!(job.id = %job.id, job.input_hash, "job {} accepted", job.id);
    }
    Ok(accepted)
}

fn checked_key(key: String) -> Result<String, ApiError> {
    let length = key.chars().count();
    if (1..=MOST_KEY).contains(&length) && !key.chars().any(char::is_control) {
        Ok(key)
    } else {
        Err(ApiError::BadParameter {
            name: "Idempotency-Key",
            got: shortened(&key, 80),
            expected: "1 … 255 characters, none of them a control character",
        })
    }
}

/// What is wrong with a name, as an envelope and an edit have one.
pub(super) fn name_violation(name: &str) -> Option<Violation> {
    const MOST: usize = 256;
    let length = name.chars().count();
    (length > MOST).then(|| Violation {
        pointer: "/name".into(),
        reason: "out_of_range".into(),
        got: format!("{length} characters"),
        expected: "at most 256 characters".into(),
        hint: "Shorten it.".into(),
    })
}

/// What is wrong with a priority.
pub(super) fn priority_violation(priority: i32) -> Option<Violation> {
    (!(-10..=10).contains(&priority)).then(|| Violation {
        pointer: "/priority".into(),
        reason: "out_of_range".into(),
        got: priority.to_string(),
        expected: "-10 … 10".into(),
        hint: "Higher runs first; 0 is usual.".into(),
    })
}

/// What is wrong with labels.
pub(super) fn label_violations(labels: &BTreeMap<String, String>) -> Vec<Violation> {
    const MOST: usize = 256; // characters of a key or value
    const LABELS: usize = 64;
    let violation = |pointer: String, got: String, expected: &str, hint: &str| Violation {
        pointer,
        reason: "out_of_range".into(),
        got,
        expected: expected.into(),
        hint: hint.into(),
    };
    let mut found = vec![];
    if labels.len() > LABELS {
        found.push(violation(
            "/labels".into(),
            labels.len().to_string(),
            "at most 64 labels",
            "Leave some out.",
        ));
    }
    for (key, value) in labels.iter().take(LABELS) {
        let pointer = || format!("/labels/{}", escape(&shortened(key, MOST)));
        let length = key.chars().count();
        if length == 0 || length > MOST {
            let (got, hint) = (
                format!("a key of {length} characters"),
                "Name it otherwise.",
            );
            found.push(violation(pointer(), got, "a key of 1 … 256", hint));
        }
        let length = value.chars().count();
        if length > MOST {
            let got = format!("a value of {length} characters");
            found.push(violation(pointer(), got, "at most 256", "Shorten it."));
        }
    }
    found
}

impl Envelope {
    /// What is out of bounds.
    fn violations(&self) -> Violations {
        let mut found = Violations::default();
        found.extend(self.name.as_deref().and_then(name_violation));
        found.extend(priority_violation(self.priority));
        found.extend(label_violations(&self.labels));
        let Limits {
            timeout_s,
            queue_ttl_s,
        } = self.limits;
        for (name, seconds, most) in [
            ("timeout_s", timeout_s, MOST_TIMEOUT_S),
            ("queue_ttl_s", queue_ttl_s, MOST_QUEUE_TTL_S),
        ] {
            if !(seconds > 0.0 && seconds <= most) {
                found.add(Violation {
                    pointer: format!("/limits/{name}"),
                    reason: "out_of_range".into(),
                    got: seconds.to_string(),
                    expected: format!("more than 0, at most {most} seconds"),
                    hint: "Leave it out for the default.".into(),
                });
            }
        }
        found
    }
}
