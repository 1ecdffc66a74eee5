//! The queue as a whole, the service itself, and who asks.

use schemars::JsonSchema;
use std::sync::Arc;

use serde::Serialize;

use super::{Service, service::detached};
use crate::{caller, error::ApiError, formats::Format};

/// How the queue stands.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct QueueState {
    /// No new job is started.
    pub paused: bool,
    /// Jobs that wait for a worker, or for another job with the same input.
    pub queued: u64,
    /// Jobs in the hands of workers.
    pub running: u64,
    /// Jobs that can run at the same time.
    pub workers: u32,
    /// Workers that have nothing to do.
    pub idle: u32,
    /// Jobs that may wait before more are refused.
    pub max_queued: u32,
}

/// How the queue stands.
pub fn state(service: &Service) -> QueueState {
    let state = service.queue.state();
    QueueState {
        paused: state.paused,
        queued: state.queued as u64,
        running: state.running as u64,
        workers: u32::from(state.workers),
        idle: state.idle as u32,
        max_queued: service.max_queued,
    }
}

/// Lets no job start until the queue is resumed, also after a restart. Jobs that run go on, and new ones are
/// accepted.
pub async fn pause(service: &Arc<Service>) -> Result<QueueState, ApiError> {
    let service = service.clone();
    detached(async move {
        service.queue.pause().await?;
        Ok(state(&service))
    })
    .await
}

/// Lets jobs start again.
pub async fn resume(service: &Arc<Service>) -> Result<QueueState, ApiError> {
    let service = service.clone();
    detached(async move {
        service.queue.resume().await?;
        Ok(state(&service))
    })
    .await
}

/// What this service is.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Info {
    /// Its name.
    pub name: String,
    /// Of the program, and so of the solver.
    pub version: String,
    /// Of the API.
    pub api_version: String,
    /// Jobs that can run at the same time.
    pub workers: u32,
    /// What it takes at most.
    pub limits: ServiceLimits,
    /// What rows (profiles, history) are served as, the default first.
    pub table_formats: Vec<String>,
    /// What fields are served as, the default first.
    pub field_formats: Vec<String>,
}

/// What the service takes at most.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ServiceLimits {
    /// Bytes of a request over REST.
    pub max_body_bytes: u64,
    /// Bytes of a mesh file.
    pub max_mesh_bytes: u64,
    /// Bytes of memory that one job may need, by the estimate.
    pub memory_budget_bytes: u64,
    /// Jobs that may wait.
    pub max_queued: u32,
    /// Jobs of a batch.
    pub max_batch: u32,
    /// Jobs of a page.
    pub max_page_size: u32,
    /// Seconds that a request may wait for a job.
    pub max_wait_s: f64,
}

/// What this service is.
pub fn info(service: &Service) -> Info {
    let names = |formats: &[Format]| formats.iter().map(|f| f.name().to_owned()).collect();
    Info {
        name: "signorini".into(),
        version: env!("CARGO_PKG_VERSION").into(),
        api_version: "v1".into(),
        workers: service.queue.state().workers.into(),
        limits: ServiceLimits {
            max_body_bytes: service.max_body_bytes as u64,
            max_mesh_bytes: service.max_mesh_bytes as u64,
            memory_budget_bytes: service.memory_budget_bytes,
            max_queued: service.max_queued,
            max_batch: super::submit::MOST_JOBS as u32,
            max_page_size: super::jobs::MAX_PAGE_SIZE as u32,
            max_wait_s: super::watch::MAX_WAIT_S,
        },
        table_formats: names(Format::OF_TABLES),
        field_formats: names(Format::OF_FIELDS),
    }
}

/// Who asks.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Caller {
    /// The owner of the jobs that this caller hands in.
    pub owner: String,
    /// What this caller may do.
    pub scopes: Vec<String>,
}

/// Who asks: without tokens everybody is one owner, who may do everything.
pub fn caller() -> Caller {
    let local = caller::Caller::local();
    Caller {
        owner: local.owner().into(),
        scopes: local.scopes().map(<&str>::from).map(Into::into).collect(),
    }
}
