//! Operations that submit jobs: one, one with an id chosen by the client, or many at once. Each submission runs in a
//! task of its own, so that it does not matter whether the client disconnects.

use std::sync::Arc;

use base::{
    caller::Caller,
    digest,
    job::{Job, JobId},
};
use futures_util::future::BoxFuture;
use futures_util::{StreamExt, TryStreamExt};
use solver::error::{Findings, Reason, Violation};
use store::{Accepted, NewJob, RequestKey};

use super::{
    admission::{Prepared, admit, enqueue, has_share, prepare, replayed},
    envelope::JobRequest,
    key::Key,
    service::{Service, detached},
};
use crate::{error::ApiError, violations::prefixed};

/// Maximum number of jobs in a batch.
pub const MAX_BATCH: usize = 1000;

/// The result of a submission.
#[derive(Debug)]
pub struct Submitted<T> {
    /// The accepted job or jobs.
    pub accepted: T,
    /// Whether the jobs existed already, under the idempotency key or the id of the request.
    pub replayed: bool,
}

/// A function that reads a request for a job; it is called on a blocking thread.
pub type ReadRequest = Box<dyn FnOnce() -> Result<JobRequest, ApiError> + Send>;

/// Accepts a job and stores it durably. Violations of envelope and problem are reported together. With a key, or an id
/// chosen by the client, the same request gives the same job, however often it is repeated.
pub fn create<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    request: ReadRequest,
    id: Option<JobId>,
    key: Option<Key>,
) -> BoxFuture<'a, Result<Submitted<Job>, ApiError>> {
    Box::pin(async move {
        service.accepting()?;
        let (service, caller) = (service.clone(), caller.clone());
        detached(async move {
            let (new, key) = if key.is_none() && id.is_none() {
                has_share(&service, &caller, 1).await?;
                (admit_new(&service, &caller, request).await?, None)
            } else {
                let max_timeout_s = service.config.max_timeout_s;
                let prepared = service
                    .work(move || Prepared::new(request()?, id, max_timeout_s))
                    .await??;
                let payload = prepared.payload.clone();
                let key = key.map(|Key(key)| RequestKey { key, payload });
                if let Some(old) = repeated(&service, &caller, &prepared, key.as_ref()).await? {
                    return single(old, true);
                }
                has_share(&service, &caller, 1).await?;
                (admit(&service, &caller, prepared).await?, key)
            };
            let accepted = enqueue(&service, &caller, vec![new], key).await?;
            single(accepted.jobs, accepted.replayed)
        })
        .await
    })
}

/// Reads and checks a job that repeats no other; all on one blocking thread, unless its mesh has to be loaded.
async fn admit_new(
    service: &Service,
    caller: &Caller,
    request: ReadRequest,
) -> Result<NewJob, ApiError> {
    enum Read {
        Checked(Box<NewJob>),
        OnStoredMesh(Box<Prepared>),
    }
    let budget_bytes = service.largest_job_bytes();
    let max_timeout_s = service.config.max_timeout_s;
    let read = move || {
        let prepared = Prepared::new(request()?, None, max_timeout_s)?;
        Ok::<_, ApiError>(if prepared.has_stored_mesh() {
            Read::OnStoredMesh(Box::new(prepared))
        } else {
            Read::Checked(Box::new(prepared.check(None, budget_bytes)?))
        })
    };
    match service.work(read).await?? {
        Read::Checked(new) => Ok(*new),
        Read::OnStoredMesh(prepared) => admit(service, caller, *prepared).await,
    }
}

/// The jobs that this request has submitted before, by its key or the id that the client has chosen; `None`: none. They
/// are looked for before the job is checked in depth: a request that was accepted once need not be acceptable now.
async fn repeated(
    service: &Service,
    caller: &Caller,
    prepared: &Prepared,
    key: Option<&RequestKey>,
) -> Result<Option<Vec<Job>>, ApiError> {
    let old = replayed(service, caller, key).await?;
    match prepared.id {
        Some(id) if old.is_none() && !prepared.payload.is_empty() => {
            let owner = caller.owner();
            let named = service.store.replay_with_id(owner, id, &prepared.payload);
            Ok(named.await?.map(|old| vec![old]))
        }
        _ => Ok(old),
    }
}

/// Accepts all of these jobs or none. The violations of all jobs are reported together, with pointers `/jobs/{n}/…`.
pub fn create_batch<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    requests: Vec<JobRequest>,
    key: Option<Key>,
) -> BoxFuture<'a, Result<Submitted<Vec<Job>>, ApiError>> {
    Box::pin(async move {
        service.accepting()?;
        if requests.is_empty() || requests.len() > MAX_BATCH {
            return Err(ApiError::InvalidProblem(vec![Violation {
                pointer: "/jobs".into(),
                reason: Reason::OutOfRange,
                got: format!("{} jobs", requests.len()),
                expected: format!("1 … {MAX_BATCH} jobs"),
                hint: if requests.is_empty() {
                    "Send {\"jobs\": [{\"problem\": {…}}, …]}.".into()
                } else {
                    "Submit the jobs in several batches.".into()
                },
            }]));
        }
        let (service, caller) = (service.clone(), caller.clone());
        detached(async move {
            let prepared = each(requests, |request| prepare(&service, request, None)).await?;
            let key = match key {
                None => None,
                Some(Key(key)) => {
                    let payloads: Vec<&str> =
                        prepared.iter().map(|job| job.payload.as_str()).collect();
                    let payload =
                        digest::of_json(&("batch", payloads)).map_err(ApiError::internal)?;
                    Some(RequestKey { key, payload })
                }
            };
            if let Some(accepted) = replayed(&service, &caller, key.as_ref()).await? {
                let replayed = true;
                return Ok(Submitted { accepted, replayed });
            }
            has_share(&service, &caller, prepared.len()).await?;
            let jobs = each(prepared, |prepared| admit(&service, &caller, prepared)).await?;
            let Accepted { jobs, replayed, .. } = enqueue(&service, &caller, jobs, key).await?;
            Ok(Submitted {
                accepted: jobs,
                replayed,
            })
        })
        .await
    })
}

/// The result of a submission of one job, from the list `jobs`, which has this job alone.
pub(super) fn single(jobs: Vec<Job>, replayed: bool) -> Result<Submitted<Job>, ApiError> {
    let accepted = jobs.into_iter().next();
    let accepted =
        accepted.ok_or_else(|| ApiError::internal("a job was accepted, but not returned"))?;
    Ok(Submitted { accepted, replayed })
}

/// Applies `work` to each item, a few at a time, and returns the results in the order of the items; the violations of
/// all items are reported together.
async fn each<A, B, F: Future<Output = Result<B, ApiError>>>(
    many: Vec<A>,
    work: impl Fn(A) -> F,
) -> Result<Vec<B>, ApiError> {
    const AT_ONCE: usize = 4;
    let mut done = vec![];
    let mut violations = Findings::default();
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
                violations.extend(prefixed(&format!("/jobs/{n}"), found));
            }
            Err(other) => return Err(other),
        }
    }
    violations
        .into_result(done)
        .map_err(ApiError::InvalidProblem)
}
