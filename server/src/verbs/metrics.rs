//! Figures of the service for monitoring.

use std::{fs, path::Path};

use rustix::fs::statvfs;

use super::service::Service;
use crate::{
    caller::Caller,
    error::ApiError,
    metrics::{METRICS, Snapshot},
};

/// All metrics, in the text format of OpenMetrics. They have no names of owners and no ids: whoever may read may read them.
pub async fn metrics(service: &Service, _caller: &Caller) -> Result<String, ApiError> {
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
    let help = "How long the job has waited that was accepted first of those that wait";
    now.gauge("signorini_oldest_wait_seconds", help, wait_s);
    let flag = |flag: bool| f64::from(u8::from(flag));
    now.gauge(
        "signorini_queue_paused",
        "1 if no job is started",
        flag(state.paused),
    );
    now.gauge(
        "signorini_workers",
        "Jobs that can run at the same time",
        state.workers.into(),
    );
    now.gauge(
        "signorini_workers_idle",
        "Workers that are idle",
        state.idle as f64,
    );

    let budget = service.store.budget();
    let help = "Memory that running jobs share";
    now.gauge("signorini_memory_budget_bytes", help, budget.bytes() as f64);
    let help = "Memory of it that running jobs have reserved";
    now.gauge(
        "signorini_memory_reserved_bytes",
        help,
        budget.reserved() as f64,
    );
    let cache = budget.body_cache();
    now.gauge(
        "signorini_body_cache_bytes",
        "Condensed bodies that are kept",
        cache.bytes as f64,
    );
    now.gauge(
        "signorini_body_cache_bodies",
        "How many are kept",
        cache.bodies as f64,
    );
    let help = "Jobs and members that found their body";
    now.counter("signorini_body_cache_hits", help, cache.hits);
    let help = "Jobs and members that had to make it";
    now.counter("signorini_body_cache_misses", help, cache.misses);
    let help = "Bodies that gave way";
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
        "1 if the store cannot take jobs",
        flag(health.full),
    );
    let help = "Records that were found damaged since the start";
    now.gauge("signorini_damaged_records", help, health.damaged as f64);

    let data = service.data.clone();
    // what follows reads files: those of the store, and of /proc
    let text = tokio::task::spawn_blocking(move || {
        add_disk(&mut now, &data);
        METRICS.text(now)
    });
    let text = text.await.map_err(ApiError::internal)?;
    text.map_err(ApiError::internal)
}

fn add_disk(now: &mut Snapshot, folder: &Path) {
    let disk = disk(folder);
    now.gauges(
        "signorini_store_bytes",
        "Files of the store",
        "file",
        disk.files,
    );
    if let Some((free, size)) = disk.free_and_size {
        let help = "Space on its disk that the service may still use";
        now.gauge("signorini_disk_free_bytes", help, free);
        now.gauge("signorini_disk_size_bytes", "The size of its disk", size);
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
