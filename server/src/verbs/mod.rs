//! What the service does, each verb once, whatever the protocol. The skins only translate.

pub mod jobs;
pub mod page;
pub mod problems;
pub mod results;

use std::sync::Arc;

use tokio::sync::Semaphore;

use crate::{
    config::Config,
    error::ApiError,
    queue::Queue,
    store::{Store, StoreError},
};

/// What every verb works with.
#[derive(Debug)]
pub struct Service {
    /// What is durable.
    pub store: Arc<Store>,
    /// Who solves.
    pub queue: Arc<Queue>,
    /// Bounds the problems checked at the same time: meshing is work, and the cores are few.
    checks: Semaphore,
    max_queued: u32,
    memory_budget_bytes: u64,
}

impl Service {
    /// The verbs' common ground.
    pub fn new(config: &Config, store: Arc<Store>, queue: Arc<Queue>) -> Service {
        Service {
            store,
            queue,
            checks: Semaphore::new(2),
            max_queued: config.max_queued,
            memory_budget_bytes: config.memory.bytes(),
        }
    }

    /// An error once the service is about to stop.
    pub fn accepting(&self) -> Result<(), ApiError> {
        if self.queue.stopping().is_cancelled() {
            Err(ApiError::Draining)
        } else {
            Ok(())
        }
    }
}

/// Runs a mutation detached from the request: a client that hangs up in the middle must not keep
/// a committed job from being announced.
async fn detached<T: Send + 'static>(
    work: impl Future<Output = Result<T, ApiError>> + Send + 'static,
) -> Result<T, ApiError> {
    tokio::spawn(work)
        .await
        .unwrap_or_else(|panic| Err(ApiError::internal(panic)))
}

impl From<StoreError> for ApiError {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Full => ApiError::StorageFull,
            other => ApiError::internal(other),
        }
    }
}
