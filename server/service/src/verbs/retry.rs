//! The operation that retries a job that has ended.

use std::sync::Arc;

use base::{
    caller::Caller,
    digest,
    job::{Cache, Job, JobId, Limits},
};
use futures_util::future::BoxFuture;
use serde::Serialize;
use solver::problem::Problem;
use store::{Accepted, NewJob, RequestKey};

use super::{
    admission::{admit, enqueue, has_share, prepare, replayed},
    envelope::{Envelope, JobRequest},
    jobs,
    key::Key,
    service::{Service, detached},
    submit::{Submitted, single},
};
use crate::error::ApiError;

/// Changes for the new job; absent fields stay unchanged.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Changes {
    /// The largest number of seconds from the start of an attempt to its end.
    pub timeout_s: Option<f64>,
    /// The largest number of seconds that the job may wait in the queue.
    pub queue_ttl_s: Option<f64>,
    /// Jobs of higher priority run first.
    pub priority: Option<i32>,
}

/// Submits the problem of an ended job again, with the same envelope, as a new job that uses no earlier result.
pub fn retry<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: JobId,
    changes: Changes,
    key: Option<Key>,
) -> BoxFuture<'a, Result<Submitted<Job>, ApiError>> {
    Box::pin(async move {
        service.accepting()?;
        let (service, caller) = (service.clone(), caller.clone());
        detached(async move {
            let key = match key {
                None => None,
                Some(Key(key)) => {
                    let payload =
                        digest::of_json(&("retry", id, changes)).map_err(ApiError::internal)?;
                    Some(RequestKey { key, payload })
                }
            };
            if let Some(old) = replayed(&service, &caller, key.as_ref()).await? {
                return single(old, true);
            }
            let job = jobs::get(&service, &caller, id).await?;
            if !job.status.is_terminal() {
                return Err(ApiError::JobActive(job.status));
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
                // one that an administrator has raised is not inherited by others
                priority: changes.priority.unwrap_or(if caller.is_admin() {
                    priority
                } else {
                    priority.min(0)
                }),
                limits: Limits {
                    timeout_s: changes.timeout_s.unwrap_or(limits.timeout_s),
                    queue_ttl_s: changes.queue_ttl_s.unwrap_or(limits.queue_ttl_s),
                },
                // a result that may not answer other jobs still may not
                cache: match cache {
                    Cache::Off => Cache::Off,
                    Cache::Use | Cache::Refresh => Cache::Refresh,
                },
            };
            has_share(&service, &caller, 1).await?;
            let problem = service.work(move || files::parse(&problem)).await?;
            let problem = problem.map(|problem| Problem { title, ..problem });
            let request = JobRequest { envelope, problem };
            let prepared = prepare(&service, request, None).await?;
            let new = NewJob {
                parent: Some(id),
                ..admit(&service, &caller, prepared).await?
            };
            let Accepted { jobs, replayed, .. } =
                enqueue(&service, &caller, vec![new], key).await?;
            single(jobs, replayed)
        })
        .await
    })
}
