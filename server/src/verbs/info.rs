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
    formats::Format,
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
    /// Formats of rows (profiles, history), the default first.
    pub table_formats: Vec<String>,
    /// Formats of fields, the default first.
    pub field_formats: Vec<String>,
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
pub fn me(service: &Service, caller: &Caller) -> Me {
    let (queued, running) = service.store.load_of(caller.owner());
    let queued_limit = service.max_queued_of_owner().unwrap_or(service.max_queued);
    let workers = service.queue.state().workers;
    let running_limit = service.max_running_per_owner.unwrap_or(workers);
    Me {
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
    }
}

/// Version and limits.
pub fn info(service: &Service, _caller: &Caller) -> Info {
    let budget = service.store.budget();
    let names = |formats: &[Format]| formats.iter().map(|f| f.name().to_owned()).collect();
    Info {
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
        table_formats: names(Format::OF_TABLES),
        field_formats: names(Format::OF_FIELDS),
    }
}
