//! The operation that returns the metrics, after adding the present figures of the service.

use std::{fs, path::Path};

use base::{
    caller::Caller,
    metrics::{METRICS, Snapshot},
};
use futures_util::future::BoxFuture;
use rustix::fs::statvfs;

use super::service::Service;
use crate::error::ApiError;

/// Returns all metrics, in the text format of OpenMetrics. They contain no names of owners and no ids, so that every
/// reader may see them.
pub fn metrics<'a>(
    service: &'a Service,
    _caller: &'a Caller,
) -> BoxFuture<'a, Result<String, ApiError>> {
    Box::pin(async move {
        let mut now = Snapshot::default();
        let state = service.queue.state();
        let jobs = [
            ("queued", state.queued as f64),
            ("running", state.running as f64),
        ];
        now.gauges("signorini_jobs", "Jobs that have not ended", "status", jobs);
        // a database that cannot be read is told by /readyz, and must not hide the other figures
        let wait_s = service.store.oldest_wait_s().await;
        let wait_s = wait_s.ok().flatten().unwrap_or(0.0);
        let help = "Age of the oldest queued job, in seconds";
        now.gauge("signorini_oldest_wait_seconds", help, wait_s);
        let flag = |flag: bool| f64::from(u8::from(flag));
        now.gauge(
            "signorini_queue_paused",
            "1 if the queue is paused",
            flag(state.paused),
        );
        now.gauge(
            "signorini_workers",
            "Jobs that can run at the same time",
            f64::from(state.workers),
        );
        now.gauge("signorini_workers_idle", "Idle workers", state.idle as f64);
        now.gauge(
            "signorini_workers_elsewhere",
            "Workers on other machines that have been heard of lately",
            service.queue.workers().len() as f64,
        );

        let budget = service.store.budget();
        let help = "Memory budget that running jobs share, in bytes";
        now.gauge("signorini_memory_budget_bytes", help, budget.bytes() as f64);
        let help = "Memory that running jobs have reserved, in bytes";
        now.gauge(
            "signorini_memory_reserved_bytes",
            help,
            budget.reserved() as f64,
        );
        let cache = budget.body_cache();
        now.gauge(
            "signorini_body_cache_bytes",
            "Size of the condensed bodies kept for later jobs, in bytes",
            cache.bytes as f64,
        );
        now.gauge(
            "signorini_body_cache_bodies",
            "Number of condensed bodies kept for later jobs",
            cache.bodies as f64,
        );
        let help = "Jobs and members of sweeps whose condensed body was kept";
        now.counter("signorini_body_cache_hits", help, cache.hits);
        let help = "Jobs and members of sweeps whose condensed body had to be made";
        now.counter("signorini_body_cache_misses", help, cache.misses);
        let help = "Condensed bodies dropped to make room";
        now.counter("signorini_body_cache_evictions", help, cache.evictions);

        let health = service.health().await;
        let health = health.ok();
        now.gauge(
            "signorini_ready",
            "1 if /readyz answers 200",
            flag(health.is_some()),
        );
        let health = health.unwrap_or_default();
        now.gauge(
            "signorini_disk_full",
            "1 if the disk of the store is full, so that no jobs are accepted",
            flag(health.full),
        );
        let help = "Records found damaged since the start of the service";
        now.gauge("signorini_damaged_records", help, health.damaged as f64);

        let data = service.config.store.data.clone();
        // what follows reads files: those of the store, and of /proc
        let text = tokio::task::spawn_blocking(move || {
            add_disk(&mut now, &data);
            METRICS.text(now)
        });
        let text = text.await.map_err(ApiError::internal)?;
        text.map_err(ApiError::internal)
    })
}

fn add_disk(now: &mut Snapshot, folder: &Path) {
    let disk = disk(folder);
    now.gauges(
        "signorini_store_bytes",
        "Size of the files of the store, in bytes",
        "file",
        disk.files,
    );
    if let Some((free, size)) = disk.free_and_size {
        let help = "Free space on the disk of the store, in bytes";
        now.gauge("signorini_disk_free_bytes", help, free);
        now.gauge(
            "signorini_disk_size_bytes",
            "Size of the disk of the store, in bytes",
            size,
        );
    }
}

struct Disk {
    files: [(&'static str, f64); 3],
    free_and_size: Option<(f64, f64)>,
}

fn disk(folder: &Path) -> Disk {
    let (mut database, mut wal, mut other) = (0, 0, 0);
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let bytes = entry.metadata().map_or(0, |metadata| metadata.len());
        let name = entry.file_name();
        let name = name.to_string_lossy();
        match () {
            () if name.ends_with(".db") => database += bytes,
            () if name.ends_with("-wal") => wal += bytes,
            () => other += bytes,
        }
    }
    let disk = statvfs(folder).ok();
    let bytes = |blocks: u64, of: u64| blocks as f64 * of as f64;
    Disk {
        files: [
            ("database", database as f64),
            ("wal", wal as f64),
            ("other", other as f64),
        ],
        free_and_size: disk.map(|disk| {
            (
                bytes(disk.f_bavail, disk.f_frsize),
                bytes(disk.f_blocks, disk.f_frsize),
            )
        }),
    }
}
