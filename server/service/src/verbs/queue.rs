//! Operations on the queue as a whole.

use std::sync::Arc;

use base::caller::Caller;
use futures_util::future::BoxFuture;
use schemars::JsonSchema;
use serde::Serialize;

use super::service::{Service, detached};
use crate::error::ApiError;

/// The state of the queue.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct QueueState {
    /// Whether the queue is paused, so that no new job is started.
    pub paused: bool,
    /// The number of jobs that wait for a worker, or for another job with the same input.
    pub queued: u64,
    /// The number of running jobs.
    pub running: u64,
    /// The number of jobs that can run at the same time.
    pub workers: u32,
    /// The number of idle workers.
    pub idle: u32,
    /// The maximum number of waiting jobs; further ones are refused.
    pub max_queued: u32,
}

/// Returns the state of the queue.
pub fn state(service: &Service, _caller: &Caller) -> QueueState {
    let state = service.queue.state();
    QueueState {
        paused: state.paused,
        queued: state.queued as u64,
        running: state.running as u64,
        workers: u32::from(state.workers),
        idle: state.idle as u32,
        max_queued: service.config.max_queued,
    }
}

/// Pauses the queue: no more jobs are started until it is resumed, also after a restart. Running jobs continue, and new
/// jobs are accepted.
pub fn pause<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
) -> BoxFuture<'a, Result<QueueState, ApiError>> {
    Box::pin(async move {
        let (service, caller) = (service.clone(), caller.clone());
        detached(async move {
            service.queue.pause().await?;
            Ok(state(&service, &caller))
        })
        .await
    })
}

/// Resumes the queue: jobs are started again.
pub fn resume<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
) -> BoxFuture<'a, Result<QueueState, ApiError>> {
    Box::pin(async move {
        let (service, caller) = (service.clone(), caller.clone());
        detached(async move {
            service.queue.resume().await?;
            Ok(state(&service, &caller))
        })
        .await
    })
}
