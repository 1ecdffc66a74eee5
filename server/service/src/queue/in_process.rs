//! Solves jobs in worker processes on this machine.

use std::{sync::Arc, time::Duration};

use base::{job::Job, memory::Reservation};
use tokio::{sync::mpsc, time::sleep};
use tracing::info;

use super::{
    batch::Batch,
    elsewhere::InForce,
    ending::{NoSolution, Solved},
    running::Running,
    state::{Queue, Solver},
};

/// How long a process may take to stop when its job is to stop; after that it is killed. A solver stops sooner (see `Interrupt`
/// in `solver`), and the worker is free a second after the end of the job.
const STOP_GRACE: Duration = Duration::from_millis(750);

/// Solves a claimed job in a worker process, within the memory that is reserved for it.
pub(super) async fn solve(
    queue: &Arc<Queue>,
    (job, problem): (&Job, String),
    memory: &Option<Reservation>,
    running: &Running,
    recorder: mpsc::Sender<Batch>,
) -> Result<Solved, NoSolution> {
    let (Solver::Processes(processes), Some(memory)) = (&queue.solver, memory) else {
        return Err(NoSolution::Internal(
            "there is no process or no memory".into(),
        ));
    };
    let mut process = processes.take(running).await?;
    process.jobs += 1;
    let share = memory.share();
    let who = (process.worker.clone(), process.jobs);
    let mut lease = InForce::here(queue, who, job, running, share);
    let (solved, is_usable) = tokio::select! {
        biased;
        solved = lease.solve(Some(problem), recorder) => {
            // one that breaks the contract, was not given its job, or whose solver has panicked, is not used again
            use NoSolution::{GivenBack, Internal, Lost};
            let broken = matches!(solved, Err(Lost(_) | GivenBack | Internal(_)));
            (solved, !broken)
        }
        cause = process.death(share) => {
            // if its job is to stop, its end is known, whatever it died of
            let is_to_stop = running.stop.get().is_some();
            (Err(if is_to_stop { NoSolution::Stopped } else { cause }), false)
        }
        () = unwilling(running) => {
            info!("a worker process did not stop and is killed");
            (Err(NoSolution::Stopped), false)
        }
    };
    drop(lease);
    if is_usable {
        processes.keep(process);
    } else {
        queue.leases.forget(&process.worker);
        process.kill().await;
    }
    solved
}

/// Waits until the solver should have stopped long ago.
async fn unwilling(running: &Running) {
    running.stop.wait().await;
    sleep(STOP_GRACE).await;
}
