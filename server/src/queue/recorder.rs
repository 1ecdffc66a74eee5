//! The scribe beside a running solver: commits what it says in batches, then announces it.

use std::time::Duration;

use solver::solution::Iteration;
use tokio::{
    sync::mpsc,
    time::{Instant, sleep_until},
};

use super::{Queue, Running, stop::Why};
use crate::{
    event::Payload,
    job::{Job, Progress},
    run::phase_name,
    store::{LastWords, Result},
    time::Time,
};

/// A batch ends with this many rows …
const ROWS: usize = 50;
/// … or so long after its first.
const LATENCY: Duration = Duration::from_millis(50);

/// What a solver says, with the moment it said it.
pub(super) type Line = (Time, Payload);

/// Writes until the solver hangs up, and gives what it said last: that is written with the job's end, in
/// one commit. When the start is no longer current, or the store fails, the solver is told to stop and the
/// rest is thrown away.
pub(super) async fn record(
    queue: &Queue,
    job: &Job,
    running: &Running,
    mut lines: mpsc::Receiver<Line>,
) -> Result<LastWords> {
    let mut progress = Progress::default();
    let written = loop {
        let (batch, last) = next_batch(&mut lines).await;
        batch
            .iter()
            .for_each(|(_, payload)| follow(&mut progress, payload));
        if last {
            let lines = batch;
            return Ok(LastWords { lines, progress });
        }
        match queue
            .store
            .append_events(job.key, running.attempt, &batch, &progress)
            .await
        {
            Ok(Some(seq)) => queue.live.announce(job.key, seq),
            Ok(None) => break Ok(LastWords::default()),
            Err(error) => break Err(error),
        }
    };
    running.stop.ask(Why::Lost);
    while lines.recv().await.is_some() {} // the solver must not block on a full channel
    written
}

/// The next lines, and whether they are the last.
async fn next_batch(lines: &mut mpsc::Receiver<Line>) -> (Vec<Line>, bool) {
    let Some(first) = lines.recv().await else {
        return (vec![], true);
    };
    let mut batch = vec![first];
    let end = sleep_until(Instant::now() + LATENCY);
    tokio::pin!(end);
    while batch.len() < ROWS {
        tokio::select! {
            biased;
            line = lines.recv() => match line {
                Some(line) => batch.push(line),
                None => return (batch, true),
            },
            () = &mut end => break,
        }
    }
    (batch, false)
}

/// Keeps up with what the solver says.
fn follow(progress: &mut Progress, payload: &Payload) {
    match payload {
        Payload::Stage { stage } => progress.stage = phase_name(*stage).to_string(),
        Payload::Iteration(row) => {
            *progress = Progress {
                stage: progress.stage.clone(),
                iteration: row.k,
                residual: Some(row.residual.max(row.friction_residual)),
                tolerance: Some(row.tolerance),
                contact_changes: Some(row.contact.entered + row.contact.left),
                rate: row.contraction,
                eta_s: eta_s(row),
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

    #[tokio::test]
    async fn a_batch_ends_when_the_solver_hangs_up_or_after_fifty_rows() {
        let (sender, mut lines) = mpsc::channel(64);
        for k in 1..=51 {
            sender
                .send((Time::now(), Payload::Iteration(fake::iteration(k))))
                .await
                .unwrap();
        }
        drop(sender);
        let (batch, last) = next_batch(&mut lines).await;
        assert_eq!((batch.len(), last), (50, false));
        let (batch, last) = next_batch(&mut lines).await;
        assert_eq!((batch.len(), last), (1, true));
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
    }
}
