//! Version and limits of the service.

use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::Serialize;

use super::{
    page::MAX_PAGE_SIZE,
    service::{MAX_MESSAGE_BYTES, Service},
    submit::MAX_BATCH,
    watch::MAX_WAIT_S,
};
use crate::{
    bodies::BodyCache,
    caller::{Caller, Scope},
    config::Isolation,
    error::ApiError,
    formats::Format,
    rates::Rates,
    store::OwnerSize,
};

/// Version and limits of a service.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Info {
    /// Its name.
    pub name: String,
    /// The version of the program, and so of the solver.
    pub version: String,
    /// The version of the API.
    pub api_version: String,
    /// Jobs that can run at the same time.
    pub workers: u32,
    /// Where they run: on threads of the service, or in processes of their own.
    pub isolation: Isolation,
    /// Its limits.
    pub limits: ServiceLimits,
    /// Condensed bodies that are kept for later jobs; all 0 with isolation `process`.
    pub body_cache: BodyCache,
    /// The disk.
    pub disk: Disk,
    /// Formats of rows (profiles, history), the default first.
    pub table_formats: Vec<String>,
    /// Formats of fields, the default first.
    pub field_formats: Vec<String>,
}

/// The disk.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Disk {
    /// Bytes of the database and its write-ahead log.
    pub used_bytes: u64,
    /// Bytes of it without content, for what comes next; more than some are given back to the file system.
    pub unused_bytes: u64,
    /// Bytes that the file system has left.
    pub free_bytes: u64,
}

/// Limits of the service.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ServiceLimits {
    /// Bytes of a request over REST.
    pub max_body_bytes: u64,
    /// Bytes of a message over gRPC, in either direction.
    pub max_message_bytes: u64,
    /// Bytes of a mesh file.
    pub max_mesh_bytes: u64,
    /// Bytes of memory that one job may need, by the estimate.
    pub memory_budget_bytes: u64,
    /// Bytes of it for bodies that are kept; 0: none is kept, as with isolation `process`.
    pub body_cache_bytes: u64,
    /// Jobs that may wait.
    pub max_queued: u32,
    /// Jobs of a batch.
    pub max_batch: u32,
    /// Jobs of a page.
    pub max_page_size: u32,
    /// Seconds that a request may wait for a job.
    pub max_wait_s: f64,
}

/// Who the caller is, what they may do, and their share of the service.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Me {
    /// The owner of the jobs that they submit.
    pub owner: String,
    /// What they may do.
    pub scopes: BTreeSet<Scope>,
    /// Jobs that wait.
    pub queued: Share,
    /// Jobs that run.
    pub running: Share,
    /// Bytes of jobs that have ended, of the problems of those that wait, and of meshes.
    pub stored_bytes: Kept,
    /// Jobs submitted; absent: as many as they like.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub submissions: Option<Rate>,
}

/// What an owner keeps.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Kept {
    /// Counted now.
    pub used: u64,
    /// The most that is allowed; `null`: there is no limit.
    pub limit: Option<u64>,
}

/// How often something may be done.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Rate {
    /// In a minute.
    pub per_minute: u64,
    /// At once, now.
    pub left: u64,
}

/// What an owner has in the service.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct OwnerUse {
    /// Their name.
    pub owner: String,
    /// Jobs that have ended.
    pub jobs: u64,
    /// Bytes of these: results and events.
    pub job_bytes: u64,
    /// Bytes of uploaded meshes.
    pub mesh_bytes: u64,
    /// Jobs that wait.
    pub queued: u64,
    /// Jobs that run.
    pub running: u64,
}

/// How much of something an owner has, and may have.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Share {
    /// Counted now.
    pub used: u64,
    /// The most that is allowed.
    pub limit: u64,
}

/// Who the caller is.
pub async fn me(service: &Service, caller: &Caller) -> Result<Me, ApiError> {
    let stored = service.bytes_of(caller.owner()).await?;
    let rate = |rates: &Rates| {
        Some(Rate {
            per_minute: rates.per_minute?.into(),
            left: rates.left(caller.owner())?,
        })
    };
    let (queued, running) = service.store.load_of(caller.owner());
    let queued_limit = service.max_queued_of_owner().unwrap_or(service.max_queued);
    let workers = service.queue.state().workers;
    let running_limit = service.max_running_per_owner.unwrap_or(workers);
    Ok(Me {
        owner: caller.owner().to_owned(),
        scopes: caller.scopes().collect(),
        queued: Share {
            used: queued as u64,
            limit: queued_limit.into(),
        },
        running: Share {
            used: running as u64,
            limit: running_limit.min(workers).into(),
        },
        stored_bytes: Kept {
            used: stored,
            limit: service.max_bytes_of_owner(),
        },
        submissions: service.rates().and_then(rate),
    })
}

/// What the owners have in the service: who keeps most first, a thousand of them at most, then those who keep nothing yet.
pub async fn owners(service: &Service, _caller: &Caller) -> Result<Vec<OwnerUse>, ApiError> {
    const MOST: i64 = 1000;
    let mut sizes = service.store.sizes_of_owners(MOST).await?;
    let mut others = service.store.owners_with_load();
    for known in &sizes {
        others.remove(&known.owner);
    }
    for owner in others.into_iter().take(MOST as usize) {
        sizes.push(service.store.size_of_owner(&owner).await?);
    }
    let with_load = |size: OwnerSize| {
        let (queued, running) = service.store.load_of(&size.owner);
        OwnerUse {
            queued: queued as u64,
            running: running as u64,
            jobs: size.jobs,
            job_bytes: size.job_bytes,
            mesh_bytes: size.mesh_bytes,
            owner: size.owner,
        }
    };
    Ok(sizes.into_iter().map(with_load).collect())
}

/// Version and limits.
pub async fn info(service: &Service, _caller: &Caller) -> Result<Info, ApiError> {
    let space = service.store.space().await?;
    let budget = service.store.budget();
    let names = |formats: &[Format]| formats.iter().map(|f| f.name().to_owned()).collect();
    Ok(Info {
        name: "signorini".into(),
        version: env!("CARGO_PKG_VERSION").into(),
        api_version: "v1".into(),
        workers: service.queue.state().workers.into(),
        isolation: service.isolation,
        limits: ServiceLimits {
            max_body_bytes: service.max_body_bytes as u64,
            max_message_bytes: MAX_MESSAGE_BYTES as u64,
            max_mesh_bytes: service.max_mesh_bytes as u64,
            memory_budget_bytes: service.memory_budget_bytes,
            body_cache_bytes: budget.of_bodies(),
            max_queued: service.max_queued,
            max_batch: MAX_BATCH as u32,
            max_page_size: MAX_PAGE_SIZE as u32,
            max_wait_s: MAX_WAIT_S,
        },
        body_cache: budget.body_cache(),
        disk: Disk {
            used_bytes: space.used,
            unused_bytes: space.unused,
            free_bytes: space.free,
        },
        table_formats: names(Format::OF_TABLES),
        field_formats: names(Format::OF_FIELDS),
    })
}
