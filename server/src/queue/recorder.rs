//! The scribe beside a running solver: commits what it says in batches, then announces it.

use std::time::Duration;

use solver::solution::Iteration;
use tokio::{
    sync::mpsc,
    time::{Instant, sleep_until},
};
use tracing::warn;

use super::{
    backoff::Pauses,
    running::{Running, Why},
    state::Queue,
};
use crate::{
    event::Payload,
    job::{Job, Progress},
    run::phase_name,
    store::{LastWords, Parts, Result},
    time::Time,
};

/// A batch ends with this many rows …
const ROWS: usize = 50;
/// … or so long after its first.
const LATENCY: Duration = Duration::from_millis(50);

/// What a solver says.
#[derive(Debug)]
pub(super) enum Line {
    /// An event, with the moment it happened.
    Event(Time, Payload),
    /// What it has found so far, ready to be stored.
    Partial(Box<Parts>),
    /// The end of the sweeps will be that of the job: there are no further increments, steps or grids.
    OneLevel,
}

/// Lines that are written together.
#[derive(Debug, Default)]
struct Batch {
    events: Vec<(Time, Payload)>,
    /// What comes after them.
    partial: Option<Box<Parts>>,
    one_level: bool,
    /// Nothing comes after them: the solver hung up.
    last: bool,
}

/// Writes until the solver hangs up, and gives what it said last: that is written with the job's end, in
/// one commit. What cannot be stored is tried again, while the solver waits for us: a full disk may pass. When
/// the start is no longer current, the solver is told to stop and the rest is thrown away.
pub(super) async fn record(
    queue: &Queue,
    job: &Job,
    running: &Running,
    mut lines: mpsc::Receiver<Line>,
) -> LastWords {
    let (mut progress, mut one_level) = (Progress::default(), false);
    loop {
        let batch = next_batch(&mut lines).await;
        let payloads = batch.events.iter().map(|(_, payload)| payload);
        one_level |= batch.one_level;
        payloads.for_each(|payload| follow(&mut progress, payload, one_level));
        if batch.last {
            let lines = batch.events;
            return LastWords { lines, progress };
        }
        if !written(queue, job, running, &batch, &progress).await {
            break;
        }
    }
    running.stop(Why::Unwanted);
    while lines.recv().await.is_some() {} // the solver must not block on a full channel
    LastWords::default()
}

/// Writes a batch, however long that takes; false when the start is no longer current, or the service stops.
async fn written(
    queue: &Queue,
    job: &Job,
    running: &Running,
    batch: &Batch,
    progress: &Progress,
) -> bool {
    let mut pauses = Pauses::default();
    loop {
        let cause = match write(queue, job, running, batch, progress).await {
            Ok(written) => return written,
            Err(cause) => cause,
        };
        warn!(job.id = %job.id, %cause, "events of job {} could not be stored yet: {cause}", job.id);
        if !pauses.next(&queue.stopping).await {
            return false;
        }
    }
}

/// Writes a batch; false when the start is no longer current.
async fn write(
    queue: &Queue,
    job: &Job,
    running: &Running,
    batch: &Batch,
    progress: &Progress,
) -> Result<bool> {
    let (store, key, attempt) = (&queue.store, job.key, running.attempt);
    if !batch.events.is_empty() {
        let written = store.append_events(key, attempt, &batch.events, progress);
        match written.await? {
            true => queue.announce(&[key]),
            false => return Ok(false),
        }
    }
    match &batch.partial {
        Some(parts) => store.write_partial(key, attempt, parts).await,
        None => Ok(true),
    }
}

/// The next lines.
async fn next_batch(lines: &mut mpsc::Receiver<Line>) -> Batch {
    let mut batch = Batch::default();
    match lines.recv().await {
        Some(line) => batch.take(line),
        None => batch.last = true,
    }
    let end = sleep_until(Instant::now() + LATENCY);
    tokio::pin!(end);
    while batch.is_open() {
        tokio::select! {
            biased;
            line = lines.recv() => match line {
                Some(line) => batch.take(line),
                None => batch.last = true,
            },
            () = &mut end => break,
        }
    }
    batch
}

impl Batch {
    fn take(&mut self, line: Line) {
        match line {
            Line::Event(time, payload) => self.events.push((time, payload)),
            Line::Partial(parts) => self.partial = Some(parts),
            Line::OneLevel => self.one_level = true,
        }
    }

    fn is_open(&self) -> bool {
        self.events.len() < ROWS && self.partial.is_none() && !self.last
    }
}

/// Keeps up with what the solver says.
fn follow(progress: &mut Progress, payload: &Payload, one_level: bool) {
    match payload {
        Payload::Stage { stage } => {
            progress.stage = phase_name(*stage).to_string();
            progress.eta_s = None; // of a phase nothing is known
        }
        Payload::Iteration(row) => {
            *progress = Progress {
                stage: progress.stage.clone(),
                iteration: row.k,
                residual: Some(row.residual.max(row.friction_residual)),
                tolerance: Some(row.tolerance),
                contact_changes: Some(row.contact.entered + row.contact.left),
                rate: row.contraction,
                // of several levels the end of these sweeps is not the job's
                eta_s: eta_s(row).filter(|_| one_level),
            }
        }
        Payload::Status { .. } | Payload::Warning(_) | Payload::Done { .. } => {}
    }
}

/// Sweeps still to go if each takes as long as those before and shrinks the residual by q:
/// n = ln(tolerance / residual) / ln q.
fn eta_s(row: &Iteration) -> Option<f64> {
    let q = row.contraction.filter(|q| (1e-6..1.0).contains(q))?;
    let residual = row.residual.max(row.friction_residual);
    let sweeps = if residual <= row.tolerance {
        0.0
    } else {
        (row.tolerance / residual).ln() / q.ln()
    };
    Some(sweeps.ceil() * row.wall_s / f64::from(row.k.max(1)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::fake;
    use solver::solution::Phase;

    #[tokio::test]
    async fn a_batch_ends_when_the_solver_hangs_up_or_after_fifty_rows() {
        let (sender, mut lines) = mpsc::channel(64);
        for k in 1..=51 {
            sender
                .send(Line::Event(
                    Time::now(),
                    Payload::Iteration(fake::iteration(k)),
                ))
                .await
                .unwrap();
        }
        drop(sender);
        let batch = next_batch(&mut lines).await;
        assert_eq!((batch.events.len(), batch.last), (50, false));
        let batch = next_batch(&mut lines).await;
        assert_eq!((batch.events.len(), batch.last), (1, true));
    }

    #[test]
    fn the_time_to_the_end_follows_from_the_rate() {
        let mut row = fake::iteration(4);
        (row.residual, row.friction_residual, row.tolerance) = (1e-12, 1e-6, 1e-10);
        (row.contraction, row.wall_s) = (Some(0.1), 8.0);
        assert!(
            (eta_s(&row).unwrap() - 8.0).abs() < 1e-9,
            "four sweeps of two seconds"
        );
        let mut progress = Progress::default();
        let row = Payload::Iteration(row);
        follow(&mut progress, &row, false);
        assert_eq!(progress.eta_s, None, "there are more steps");
        follow(&mut progress, &row, true);
        assert!(progress.eta_s.is_some());
        let stage = Phase::Recover;
        follow(&mut progress, &Payload::Stage { stage }, true);
        assert_eq!((progress.eta_s, progress.rate), (None, Some(0.1)));
    }
}
