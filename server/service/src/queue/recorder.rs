//! Records the reports of a running solver: commits its events in batches, then announces them.

use std::{sync::atomic::Ordering::Relaxed, time::Duration};

use base::{
    event::{Payload, TimedIteration},
    failpoint::{self, Point},
    job::{Job, Progress},
    time::Time,
};
use store::{FinalBatch, Result, StoreError};
use tokio::{
    sync::mpsc,
    time::{Instant, sleep_until},
};
use tracing::warn;

use super::{
    backoff::Backoff,
    batch::Batch,
    phases::Phases,
    running::{Running, StopReason},
    state::Queue,
};

/// The longest time from the first event of a batch until it is stored.
const LATENCY: Duration = Duration::from_millis(50);

/// Stores the reports of the solver until the solver ends, and returns its last events: these are stored together with
/// the end of the job, in one commit. A failed write is retried while the solver waits, since the disk may be full
/// temporarily. When the attempt is no longer the current one, the solver is asked to stop and further reports are
/// dropped.
pub(super) async fn record(
    queue: &Queue,
    job: &Job,
    running: &Running,
    mut reports: mpsc::Receiver<Batch>,
) -> (FinalBatch, Phases) {
    // that of a job which goes on elsewhere after a restart of the service
    let mut progress = job.progress.clone().unwrap_or_default();
    let mut one_level = false;
    let mut phases = Phases::default();
    loop {
        let batch = next_batch(&mut reports).await;
        let payloads = batch.events.iter().map(|(_, payload)| payload);
        one_level |= batch.one_level;
        for (time, payload) in &batch.events {
            if let Payload::Stage { stage } = payload {
                phases.enter(*stage, *time);
            }
        }
        payloads.for_each(|payload| update_progress(&mut progress, payload, one_level));
        if batch.last {
            // rows of members are not stored together with the end: a row that is told is there, whatever becomes of it
            let rows = Batch {
                members: batch.members,
                ..Batch::default()
            };
            if !rows.members.is_empty()
                && !store_with_retries(queue, job, running, &rows, &progress).await
            {
                break;
            }
            phases.end(Time::now());
            let last = FinalBatch {
                events: batch.events,
                progress,
            };
            return (last, phases);
        }
        if !store_with_retries(queue, job, running, &batch, &progress).await {
            break;
        }
        running.stored.fetch_add(batch.reports, Relaxed);
    }
    running.stop(StopReason::Unwanted);
    while reports.recv().await.is_some() {} // the solver must not block on a full channel
    phases.end(Time::now());
    (FinalBatch::default(), phases)
}

/// Stores a batch, and retries until it is stored; false when the attempt is no longer the current one, the service
/// stops, or further attempts are useless.
async fn store_with_retries(
    queue: &Queue,
    job: &Job,
    running: &Running,
    batch: &Batch,
    progress: &Progress,
) -> bool {
    let mut backoff = Backoff::default();
    loop {
        let cause = match store_batch(queue, job, running, batch, progress).await {
            Ok(stored) => return stored,
            Err(cause) if backoff.gives_up(job.id, job.key, &cause) => return false,
            Err(cause) => cause,
        };
        warn!(job.id = %job.id, %cause, "events of job {} could not be stored yet: {cause}", job.id);
        if !backoff.wait(&queue.stopping).await {
            return false;
        }
    }
}

/// Stores a batch; false when the attempt is no longer the current one.
async fn store_batch(
    queue: &Queue,
    job: &Job,
    running: &Running,
    batch: &Batch,
    progress: &Progress,
) -> Result<bool> {
    let (store, key, attempt) = (&queue.store, job.key, running.attempt);
    // first: to store them again changes nothing, as a retry does after what comes below has failed
    if !batch.members.is_empty() {
        match store
            .record_members(key, attempt, batch.members.clone())
            .await?
        {
            Some(sweep) => queue.announce_sweep(sweep),
            None => return Ok(false),
        }
    }
    if !batch.events.is_empty() {
        if failpoint::fails(Point::EventsReported, job.id) {
            return Err(StoreError::Full);
        }
        let stored = store.append_events(key, attempt, batch.events.clone(), progress);
        if stored.await? {
            failpoint::pass(Point::EventsStored, job.id);
            queue.announce_events(key);
        } else {
            return Ok(false);
        }
    }
    if batch.partial.is_some() && failpoint::fails(Point::PartialReported, job.id) {
        return Err(StoreError::Full);
    }
    match &batch.partial {
        Some(parts) => store.write_partial(key, attempt, parts).await,
        None => Ok(true),
    }
}

/// Receives the next batch.
async fn next_batch(reports: &mut mpsc::Receiver<Batch>) -> Batch {
    let mut batch = Batch::default();
    match reports.recv().await {
        Some(more) => batch.add(more),
        None => batch.last = true,
    }
    let end = sleep_until(Instant::now() + LATENCY);
    tokio::pin!(end);
    while batch.is_open() {
        tokio::select! {
            biased;
            more = reports.recv() => match more {
                Some(more) => batch.add(more),
                None => batch.last = true,
            },
            () = &mut end => break,
        }
    }
    batch
}

/// Updates the progress of a job by one more event.
fn update_progress(progress: &mut Progress, payload: &Payload, one_level: bool) {
    match payload {
        Payload::Stage { stage } => {
            progress.stage = stage.as_str().to_owned();
            progress.eta_s = None; // nothing is known about how long a phase takes
        }
        Payload::Mesh {
            number,
            elements,
            error,
        } => {
            progress.mesh = Some(*number);
            progress.mesh_elements = Some(*elements);
            progress.mesh_error = *error;
        }
        Payload::Iteration(timed) => {
            let row = &timed.row;
            let residual = row.residual.max(row.friction_residual);
            progress.add_residual(row.k, residual);
            *progress = Progress {
                iteration: row.k,
                residual: Some(residual),
                tolerance: Some(row.tolerance),
                contact_changes: Some(row.contact.entered + row.contact.left),
                rate: row.contraction,
                // with several levels the end of these iterations is not that of the job
                eta_s: eta_s(timed).filter(|_| one_level),
                ..progress.clone()
            }
        }
        Payload::Status { .. } | Payload::Warning(_) | Payload::Done { .. } => {}
    }
}

/// The estimated seconds to the end of the job: the time of the remaining iterations, if each reduces the residual by
/// the factor q and takes as long as those before: n = ln(tolerance / residual) / ln q.
fn eta_s(TimedIteration { row, wall_s }: &TimedIteration) -> Option<f64> {
    let q = row.contraction.filter(|q| (1e-6..1.0).contains(q))?;
    let residual = row.residual.max(row.friction_residual);
    let iterations = if residual <= row.tolerance {
        0.0
    } else {
        (row.tolerance / residual).ln() / q.ln()
    };
    Some(iterations.ceil() * wall_s / f64::from(row.k.max(1)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use solver::solution::Phase;

    #[tokio::test]
    async fn a_batch_ends_when_the_solver_ends_or_after_fifty_events() {
        let (sender, mut reports) = mpsc::channel(64);
        for k in 1..=51 {
            let event = (Time::now(), Payload::Iteration(fake::timed(k)));
            let batch = Batch {
                events: vec![event],
                ..Batch::default()
            };
            sender.send(batch).await.unwrap();
        }
        drop(sender);
        let batch = next_batch(&mut reports).await;
        assert_eq!((batch.events.len(), batch.last), (50, false));
        let batch = next_batch(&mut reports).await;
        assert_eq!((batch.events.len(), batch.last), (1, true));
    }

    #[test]
    fn the_time_to_the_end_is_extrapolated_from_the_rate() {
        let mut timed = fake::timed(4);
        timed.wall_s = 8.0;
        let row = &mut timed.row;
        (row.residual, row.friction_residual, row.tolerance) = (1e-12, 1e-6, 1e-10);
        row.contraction = Some(0.1);
        assert!(
            (eta_s(&timed).unwrap() - 8.0).abs() < 1e-9,
            "four iterations of two seconds"
        );
        let mut progress = Progress::default();
        let row = Payload::Iteration(timed);
        update_progress(&mut progress, &row, false);
        assert_eq!(progress.eta_s, None, "there are more steps");
        update_progress(&mut progress, &row, true);
        assert!(progress.eta_s.is_some());
        let stage = Phase::Recover;
        update_progress(&mut progress, &Payload::Stage { stage }, true);
        assert_eq!((progress.eta_s, progress.rate), (None, Some(0.1)));
    }
}
