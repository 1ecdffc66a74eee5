//! Keeps as many pilots going in Slurm as the queue needs (`serve --slurm auto`).

use std::{sync::Arc, time::Duration};

use service::queue::Queue;
use tracing::{info, warn};

use super::slurm::{self, Pilots};

/// How often the queue is looked at.
const INTERVAL: Duration = Duration::from_secs(5);
/// The longest pause after calls that failed.
const LONGEST_PAUSE: Duration = Duration::from_secs(300);

/// Submits pilots whenever more jobs wait than the pilots that there are have slots for, at most `most` pilots together, until
/// the service stops. Pilots that are idle end themselves; those that are not needed any more while they wait in Slurm too, as
/// soon as they run.
pub(super) async fn keep_going(queue: Arc<Queue>, pilots: Pilots, most: u16) {
    let (mut pause, mut failed) = (INTERVAL, String::new());
    while !queue.stopping().is_cancelled() {
        match add(&queue, &pilots, most).await {
            Ok(()) => (pause, failed) = (INTERVAL, String::new()),
            Err(error) => {
                let error = format!("{error:#}");
                if failed != error {
                    warn!(error, "pilots are not counted or submitted: {error}");
                }
                (pause, failed) = ((pause * 2).min(LONGEST_PAUSE), error);
            }
        }
        tokio::select! {
            () = tokio::time::sleep(pause) => {}
            () = queue.stopping().cancelled() => return,
        }
    }
}

/// Submits the pilots that are missing.
async fn add(queue: &Queue, pilots: &Pilots, most: u16) -> anyhow::Result<()> {
    let state = queue.state();
    let slots = usize::from(pilots.slots.unwrap_or(1));
    // as many as the waiting jobs could use: an array of pilots for whole nodes has one slot each at least
    let wanted = if state.paused {
        0
    } else {
        state.queued.saturating_sub(state.idle).div_ceil(slots)
    };
    if wanted == 0 {
        return Ok(());
    }
    // asked only then: an idle service leaves the controller in peace
    let there = slurm::pilots(&pilots.server).await?;
    let waiting = there
        .iter()
        .filter(|pilot| pilot.counts() && pilot.state != "RUNNING");
    let room =
        usize::from(most).saturating_sub(there.iter().filter(|pilot| pilot.counts()).count());
    let missing = wanted.saturating_sub(waiting.count()).min(room);
    let Some(missing) = u16::try_from(missing).ok().filter(|missing| *missing > 0) else {
        return Ok(());
    };
    let id = pilots.submit(missing).await?;
    info!(
        pilots = missing,
        slurm_job = id,
        "{missing} pilots were submitted to Slurm as {id}: {} jobs wait",
        state.queued
    );
    Ok(())
}
