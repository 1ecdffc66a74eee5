//! Operations that return version and limits of the service, the caller, and the owners' use.

use std::collections::BTreeSet;

use base::{
    bodies::BodyCache,
    caller::{Caller, Scope},
    time::Time,
};
use futures_util::future::BoxFuture;
use schemars::JsonSchema;
use serde::Serialize;
use store::OwnerSize;

use super::{
    page::MAX_PAGE_SIZE,
    service::{MAX_MESSAGE_BYTES, Service},
    submit::MAX_BATCH,
    watch::MAX_WAIT_S,
};
use crate::{
    config::{Isolation, RetentionLimits},
    error::ApiError,
    formats::Format,
    rates::Rates,
};

/// Version and limits of a service.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Info {
    /// The name of the service.
    pub name: String,
    /// The version of the program and of its solver.
    pub version: String,
    /// The version of the API.
    pub api_version: String,
    /// The number of jobs that the service itself solves at the same time; workers on other machines solve more.
    pub workers: u32,
    /// Where jobs run: on threads of the service, or in processes of their own.
    pub isolation: Isolation,
    /// The limits of the service.
    pub limits: ServiceLimits,
    /// Condensed bodies that are kept for later jobs; all 0 with isolation `process`.
    pub body_cache: BodyCache,
    /// The use of the disk.
    pub disk: Disk,
    /// How long jobs that have ended are kept, and how many.
    pub retention: Retention,
    /// The formats of rows (profiles, history), the default first.
    pub table_formats: Vec<String>,
    /// The formats of fields, the default first.
    pub field_formats: Vec<String>,
}

/// The use of the disk.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Disk {
    /// The bytes of the database and its write-ahead log.
    pub used_bytes: u64,
    /// The bytes of the database that are unused and reserved for new data; the service returns them to the file system
    /// if they are many.
    pub unused_bytes: u64,
    /// The bytes that are free in the file system.
    pub free_bytes: u64,
}

/// How long jobs that have ended are kept, and how many; pinned jobs do not count, and are kept. `null`: no limit.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Retention {
    /// The days that a job is kept after its end.
    pub days: Option<f64>,
    /// The days that displacements and stresses are kept; profiles, history and summary remain as long as their job.
    pub fields_days: Option<f64>,
    /// The bytes of all jobs that have ended; beyond that the oldest of the owners who store most are removed.
    pub bytes: Option<u64>,
    /// The bytes of the jobs of one owner that have ended.
    pub bytes_per_owner: Option<u64>,
    /// The number of jobs that have ended.
    pub jobs: Option<u64>,
    /// The number of jobs of one owner that have ended.
    pub jobs_per_owner: Option<u64>,
}

impl Retention {
    fn of(limits: &RetentionLimits) -> Retention {
        let days = |days: f64| Some(days).filter(|days| *days > 0.0);
        let number = |number: u64| Some(number).filter(|number| *number > 0);
        Retention {
            days: days(limits.retain_days),
            fields_days: days(limits.retain_fields_days),
            bytes: number(limits.retain_bytes),
            bytes_per_owner: number(limits.retain_bytes_per_owner),
            jobs: number(limits.retain_jobs),
            jobs_per_owner: number(limits.retain_jobs_per_owner),
        }
    }
}

/// Limits of the service.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ServiceLimits {
    /// The largest number of bytes of a request over REST.
    pub max_body_bytes: u64,
    /// The largest number of bytes of a message over gRPC, in either direction.
    pub max_message_bytes: u64,
    /// The largest number of bytes of a mesh file.
    pub max_mesh_bytes: u64,
    /// The largest number of bytes of memory that one job may need, by the estimate.
    pub memory_budget_bytes: u64,
    /// The bytes of the memory budget for kept condensed bodies; 0: none are kept, as with isolation `process`.
    pub body_cache_bytes: u64,
    /// The largest number of waiting jobs.
    pub max_queued: u32,
    /// The largest number of jobs in a batch.
    pub max_batch: u32,
    /// The largest number of jobs on a page.
    pub max_page_size: u32,
    /// The largest number of seconds that a request may wait for a job.
    pub max_wait_s: f64,
}

/// The caller: their name, scopes and limits.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Me {
    /// The owner of the jobs that the caller submits.
    pub owner: String,
    /// The scopes of the caller.
    pub scopes: BTreeSet<Scope>,
    /// The waiting jobs of the caller.
    pub queued: Share,
    /// The running jobs of the caller.
    pub running: Share,
    /// The bytes of jobs that have ended, of the problems of waiting jobs, and of meshes.
    pub stored_bytes: Kept,
    /// The jobs submitted in a minute; absent: no limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub submissions: Option<Rate>,
}

/// The stored bytes of an owner.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Kept {
    /// The present use.
    pub used: u64,
    /// The limit; `null`: no limit.
    pub limit: Option<u64>,
}

/// A limit per minute.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Rate {
    /// The number of jobs that may be submitted in any minute.
    pub per_minute: u64,
    /// The number of jobs that may be submitted at this moment.
    pub left: u64,
}

/// The use of the service by an owner.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct OwnerUse {
    /// The owner's name.
    pub owner: String,
    /// The number of jobs that have ended.
    pub jobs: u64,
    /// The bytes of these jobs: results and events.
    pub job_bytes: u64,
    /// The bytes of uploaded meshes.
    pub mesh_bytes: u64,
    /// The number of waiting jobs.
    pub queued: u64,
    /// The number of running jobs.
    pub running: u64,
}

/// The present number of something that an owner has, and its limit.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Share {
    /// The present use.
    pub used: u64,
    /// The limit.
    pub limit: u64,
}

/// Returns the caller's name, scopes and limits.
pub fn me<'a>(service: &'a Service, caller: &'a Caller) -> BoxFuture<'a, Result<Me, ApiError>> {
    Box::pin(async move {
        let stored = service.bytes_of(caller.owner()).await?;
        let rate = |rates: &Rates| {
            Some(Rate {
                per_minute: rates.per_minute?.into(),
                left: rates.left(caller.owner())?,
            })
        };
        let load = service.store.load_of(caller.owner()).await?;
        let queued_limit = service
            .max_queued_of_owner()
            .unwrap_or(service.config.max_queued);
        let workers = service.queue.state().workers;
        let running_limit = service.config.max_running_per_owner;
        let running_limit = running_limit.map_or(workers, u32::from);
        Ok(Me {
            owner: caller.owner().to_owned(),
            scopes: caller.scopes().collect(),
            queued: Share {
                used: load.queued,
                limit: queued_limit.into(),
            },
            running: Share {
                used: load.running,
                limit: running_limit.min(workers).into(),
            },
            stored_bytes: Kept {
                used: stored,
                limit: service.max_bytes_of_owner(),
            },
            submissions: service.rates().and_then(rate),
        })
    })
}

/// Returns the use of the service by each owner: first the owners with the most stored bytes, at most a thousand of
/// them, then the owners who store nothing yet: those of waiting and running jobs, and of valid tokens.
pub fn owners<'a>(
    service: &'a Service,
    _caller: &'a Caller,
) -> BoxFuture<'a, Result<Vec<OwnerUse>, ApiError>> {
    Box::pin(async move {
        const MOST: i64 = 1000;
        let mut sizes = service.store.sizes_of_owners(MOST).await?;
        let loads = service.store.loads().await?;
        let known: BTreeSet<&String> = sizes.iter().map(|size| &size.owner).collect();
        let tokens = service.store.tokens();
        let now = Time::now();
        let with_token = tokens.iter().filter(|token| token.is_valid(now));
        let others: BTreeSet<&String> = loads
            .keys()
            .chain(with_token.map(|token| &token.owner))
            .filter(|owner| !known.contains(owner))
            .collect();
        let others: Vec<&String> = others.into_iter().take(MOST as usize).collect();
        for owner in others {
            sizes.push(service.store.size_of_owner(owner).await?);
        }
        let with_load = |size: OwnerSize| {
            let load = loads.get(&size.owner).copied().unwrap_or_default();
            OwnerUse {
                queued: load.queued,
                running: load.running,
                jobs: size.jobs,
                job_bytes: size.job_bytes,
                mesh_bytes: size.mesh_bytes,
                owner: size.owner,
            }
        };
        Ok(sizes.into_iter().map(with_load).collect())
    })
}

/// Returns version and limits of the service.
pub fn info<'a>(
    service: &'a Service,
    _caller: &'a Caller,
) -> BoxFuture<'a, Result<Info, ApiError>> {
    Box::pin(async move {
        let space = service.store.space().await?;
        let budget = service.store.budget();
        let names = |formats: &[Format]| formats.iter().map(|f| f.name().to_owned()).collect();
        Ok(Info {
            name: "signorini".into(),
            version: env!("CARGO_PKG_VERSION").into(),
            api_version: "v1".into(),
            workers: service.config.workers.into(),
            isolation: service.config.isolation,
            limits: ServiceLimits {
                max_body_bytes: service.config.max_body_bytes as u64,
                max_message_bytes: MAX_MESSAGE_BYTES as u64,
                max_mesh_bytes: service.config.max_mesh_bytes as u64,
                memory_budget_bytes: service.largest_job_bytes(),
                body_cache_bytes: budget.of_bodies(),
                max_queued: service.config.max_queued,
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
            retention: Retention::of(&service.config.retention),
            table_formats: names(Format::OF_TABLES),
            field_formats: names(Format::OF_FIELDS),
        })
    })
}
