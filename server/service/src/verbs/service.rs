//! The service, which every operation receives: settings, store, queue and limits.

use std::{sync::Arc, time::Duration};

use base::tasks;
use store::{Health, Store, StoreError};
use tokio::{sync::Semaphore, time::timeout};
use tracing::error;
use uuid::Uuid;

use super::{
    fields_in_memory::FieldsInMemory,
    uploads::{Upload, Uploads},
};
use crate::{
    config::{Config, Placing},
    error::{ApiError, Quota, QuotaOf},
    queue::Queue,
    rates::Rates,
    transfer::Limit,
};

/// How long a health probe waits for the store.
const HEALTH_PATIENCE: Duration = Duration::from_secs(2);

/// Largest message over gRPC in either direction, as the contract promises.
pub const MAX_MESSAGE_BYTES: usize = 1 << 20;

/// The service, which every operation receives: settings, store, queue and limits.
#[derive(Debug)]
pub struct Service {
    /// The settings.
    pub config: Config,
    /// The durable data.
    pub store: Arc<Store>,
    /// The queue, which runs the jobs.
    pub queue: Arc<Queue>,
    /// Limits how many problems are checked and results converted at the same time, since each takes a core.
    checks: Arc<Semaphore>,
    /// Limits how many jobs each owner submits.
    rates: Rates,
    /// The limit on bytes of request bodies in memory, over all requests.
    pub received: Limit,
    /// The limit on bytes of answers in memory, over all requests.
    pub sent: Limit,
    /// Fields that are being sent.
    pub(super) fields_in_memory: FieldsInMemory,
    /// The uploads that are arriving.
    uploads: Arc<Uploads>,
    /// A name for this run of the service: numbers that are kept in memory only begin anew with the next one.
    pub(super) run: String,
}

/// The stored bytes of an owner, and their limit.
#[derive(Debug)]
pub(super) struct Room {
    owner: String,
    /// The limit of stored bytes; `None`: no limit.
    limit: Option<u64>,
    used: u64,
}

impl Room {
    /// Fails if the owner has reached the limit, or would exceed it with `more` bytes.
    pub(super) fn holds(&self, more: u64) -> Result<(), ApiError> {
        match self.limit {
            Some(limit) if self.used >= limit || self.used.saturating_add(more) > limit => {
                Err(self.refusal(limit, more))
            }
            _ => Ok(()),
        }
    }

    /// Fails if `bytes` exceeds the owner's limit of stored bytes even without what the owner already stores.
    pub(super) fn would_hold(&self, bytes: u64) -> Result<(), ApiError> {
        match self.limit {
            Some(limit) if bytes > limit => Err(self.refusal(limit, bytes)),
            _ => Ok(()),
        }
    }

    fn refusal(&self, limit: u64, asked: u64) -> ApiError {
        ApiError::QuotaExceeded(Quota {
            owner: self.owner.clone(),
            of: QuotaOf::StoredBytes,
            limit,
            used: self.used,
            asked,
        })
    }
}

impl Service {
    /// A service on this store and queue.
    pub fn new(config: Config, store: Arc<Store>, queue: Arc<Queue>) -> Service {
        Service {
            store,
            queue,
            checks: Arc::new(Semaphore::new(2)),
            rates: Rates::new(config.max_submissions_per_owner_per_minute),
            received: Limit::new(config.max_received_bytes),
            sent: Limit::new(config.max_sent_bytes),
            fields_in_memory: FieldsInMemory::default(),
            uploads: Arc::default(),
            run: Uuid::now_v7().simple().to_string(),
            config,
        }
    }

    /// The memory that one job may need according to its estimate (bytes): the memory budget, or the memory of the largest
    /// worker elsewhere.
    pub(super) fn largest_job_bytes(&self) -> u64 {
        let budget = self.config.memory.bytes();
        budget.max(self.store.budget().elsewhere())
    }

    /// How many jobs may be solved at the same time, also by workers that may be started.
    pub(super) fn most_slots(&self) -> usize {
        let settings = &self.config.placement;
        let pilots = match settings.slurm {
            Placing::Auto => {
                usize::from(settings.slurm_pilots) * usize::from(settings.slurm_slots.unwrap_or(1))
            }
            Placing::Off => 0,
        };
        let there = self.queue.state().workers as usize;
        there.max(usize::from(self.config.workers) + pilots)
    }

    /// How many jobs of one owner may wait; `None`: no separate limit, because a service without authentication has
    /// only one owner.
    pub(super) fn max_queued_of_owner(&self) -> Option<u32> {
        self.is_shared().then_some(self.config.max_queued_per_owner)
    }

    /// Whether the service distinguishes owners.
    fn is_shared(&self) -> bool {
        self.store.has_tokens() || self.config.trust.names_users()
    }

    /// How many bytes one owner may store; `None`: no limit.
    pub(super) fn max_bytes_of_owner(&self) -> Option<u64> {
        let most = self.config.max_bytes_per_owner;
        most.filter(|_| self.is_shared())
    }

    /// The limit on the jobs that each owner may submit; `None`: no limit.
    pub(super) fn rates(&self) -> Option<&Rates> {
        Some(&self.rates).filter(|rates| rates.per_minute.is_some() && self.is_shared())
    }

    /// The stored bytes of an owner, including the problems of their waiting jobs.
    pub(super) async fn bytes_of(&self, owner: &str) -> Result<u64, ApiError> {
        let kept = self.store.size_of_owner(owner).await?.bytes();
        Ok(kept.saturating_add(self.store.waiting_bytes_of(owner).await?))
    }

    /// Fails if the owner has reached the limit of stored bytes.
    pub(super) async fn may_keep_more(&self, owner: &str) -> Result<(), ApiError> {
        self.room_of(owner).await?.holds(0)
    }

    /// The stored bytes of an owner, and their limit.
    pub(super) async fn room_of(&self, owner: &str) -> Result<Room, ApiError> {
        let limit = self.max_bytes_of_owner();
        let used = match limit {
            Some(_) => self.bytes_of(owner).await?,
            None => 0,
        };
        let owner = owner.to_owned();
        Ok(Room { owner, limit, used })
    }

    /// Counts an upload of this owner that begins; an error if a limit on simultaneous uploads is reached.
    pub(super) fn begin_upload(&self, owner: &str) -> Result<Upload, ApiError> {
        self.uploads.begin(owner, self.is_shared())
    }

    /// Fails once the service is about to stop.
    pub fn accepting(&self) -> Result<(), ApiError> {
        if self.queue.stopping().is_cancelled() {
            Err(ApiError::Draining)
        } else {
            Ok(())
        }
    }

    /// The health of the service; an error if it accepts no jobs, or cannot read existing ones.
    pub async fn health(&self) -> Result<Health, ApiError> {
        self.accepting()?;
        let health = timeout(HEALTH_PATIENCE, self.store.health()).await;
        match health.map_err(|_| ApiError::internal("the store does not answer"))? {
            // not a record of a job, but the database around them
            Err(StoreError::Damaged(_)) => Err(ApiError::StorageLost),
            health => Ok(health?),
        }
    }

    /// Runs work whose duration depends on the client's input (reading, meshing, hashing a problem) on a blocking
    /// thread, a few at a time: the async threads stay free for other requests. The permit belongs to the work, not
    /// to the request: a client that disconnects does not free it before the work is done.
    pub async fn work<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ApiError> {
        self.work_on(async { Ok(()) }, |()| work()).await
    }

    /// Loads data and runs work on them, once there is a permit, so that waiting requests use no memory. While data are
    /// loaded the permit belongs to the request, afterwards to the work: loading that must count as long as it lasts
    /// has to run `detached`.
    pub async fn work_on<L: Send + 'static, T: Send + 'static>(
        &self,
        load: impl Future<Output = Result<L, ApiError>>,
        work: impl FnOnce(L) -> T + Send + 'static,
    ) -> Result<T, ApiError> {
        let permit = self.checks.clone().acquire_owned().await;
        let permit = permit.map_err(ApiError::internal)?;
        let loaded = load.await?;
        let working = tasks::blocking(move || {
            let _permit = permit;
            work(loaded)
        });
        working.await.map_err(ApiError::internal)
    }
}

/// Runs work in a task of its own, which goes on if the client of the request disconnects: a committed job must be
/// announced, and reserved memory counts until its use has ended.
pub(super) async fn detached<T: Send + 'static>(
    work: impl Future<Output = Result<T, ApiError>> + Send + 'static,
) -> Result<T, ApiError> {
    tasks::detached(work)
        .await
        .unwrap_or_else(|panic| Err(ApiError::internal(panic)))
}

impl From<StoreError> for ApiError {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Full => ApiError::StorageFull,
            StoreError::Busy => ApiError::RateLimited,
            StoreError::KeyReuse => ApiError::KeyReuse,
            StoreError::IdConflict(id) => ApiError::IdConflict(id),
            StoreError::Deleted(id) => ApiError::Deleted(id),
            StoreError::Replaced(_) | StoreError::Broken(_) => ApiError::StorageLost,
            StoreError::Damaged(damage) => {
                // most of it was logged by the store, once
                let incident = damage.incident.unwrap_or_else(|| {
                    let incident = Uuid::now_v7();
                    error!(%incident, cause = damage.cause, "incident {incident}: {damage}: {}", damage.cause);
                    incident
                });
                ApiError::CorruptData {
                    what: damage.to_string(),
                    incident,
                }
            }
            other => ApiError::internal(other),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::{sync::mpsc, time::Duration};

    use crate::verbs::tests::service;

    /// Work leaves the async threads free: this test has one thread, which blocking work would stop for ever.
    #[tokio::test]
    async fn work_leaves_the_async_threads_free() {
        let folder = tempfile::tempdir().unwrap();
        let service = service(folder.path()).await;
        let (send, received) = mpsc::channel();
        let work = service.work(move || received.recv_timeout(Duration::from_secs(10)));
        let (worked, sent) = tokio::join!(work, async { send.send(7) });
        sent.unwrap();
        assert_eq!(worked.unwrap(), Ok(7));
    }

    #[tokio::test]
    async fn a_client_that_disconnects_frees_no_permit_before_the_work_is_done() {
        let folder = tempfile::tempdir().unwrap();
        let service = service(folder.path()).await;
        let (send, received) = mpsc::channel::<()>();
        let (start, started) = tokio::sync::oneshot::channel();
        let work = service.work(move || {
            let _ = start.send(());
            received.recv()
        });
        tokio::select! {
            _ = work => unreachable!("it waits for a message"),
            _ = started => {} // the request is dropped
        }
        assert_eq!(service.checks.available_permits(), 1);
        drop(send);
        service.checks.acquire_many(2).await.unwrap().forget();
    }
}
