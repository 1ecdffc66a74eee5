//! A worker: solves a claimed job, and ends it.

use std::{sync::Arc, time::Duration};

use base::{
    event::Payload,
    failpoint::{self, Point},
    job::{Job, JobId, Status},
    memory::Reservation,
    run::Solve,
    sweep::MemberRow,
    time::Time,
};
use store::{Ending, FinalBatch, Parts, StoreError};
use tokio::{
    runtime::Handle,
    sync::{Mutex as AsyncMutex, mpsc},
};
use tokio_util::task::AbortOnDropHandle;
use tracing::{error, info, warn};

use super::{
    backoff::Backoff,
    batch::Batch,
    elsewhere::InForce,
    ending::{NoSolution, Solved, ending_of_attempt, internal, panicked, timed_out},
    in_process,
    leases::Offer,
    recorder,
    running::{Running, StopReason},
    solving::{members_of, read_mesh, solve_task, stored_mesh},
    state::{Queue, Slot, Solver},
    supervisor::Supervisor,
};

/// How many reports of a solver may wait to be recorded; after that the solver waits.
const MOST_UNRECORDED: usize = 256;

/// How long the solver of a job that has reached its time limit may take to return its last state (see `Limits`).
const TIMEOUT_GRACE: Duration = Duration::from_secs(2);

/// Where a job is solved.
pub(super) enum Seat {
    /// In a slot of this service.
    Here {
        slot: Arc<Slot>,
        problem: String,
        /// The hash of the stored mesh that the problem names.
        mesh: Option<String>,
        memory: Option<Reservation>,
    },
    /// At a worker elsewhere.
    Elsewhere {
        lease: Box<InForce>,
        /// The problem that the worker is to be given; `None`: it had the job before the service restarted.
        problem: Option<String>,
    },
}

/// Makes one attempt to solve a job, from the claim to the end. A panic costs this job alone.
pub(super) async fn run_attempt(queue: &Arc<Queue>, job: Job, running: Running, seat: Seat) {
    // the slot is free when the attempt has ended and its solver has returned, whichever is later
    let _slot = match &seat {
        Seat::Here { slot, .. } => Some(slot.clone()),
        Seat::Elsewhere { .. } => None,
    };
    let attempt = try_attempt(queue.clone(), job.clone(), running.clone(), seat);
    let attempt = tokio::spawn(attempt);
    if let Err(panic) = attempt.await
        && let Ok(panic) = panic.try_into_panic()
    {
        running.stop(StopReason::Unwanted); // the solver may not have noticed yet
        let ending = internal(&job, &panicked("the worker", &*panic));
        end_with_retries(queue, &job, ending, FinalBatch::default(), None).await;
        queue.announce(&[job.key]); // if it had ended before
    }
    queue.release(&job);
}

async fn try_attempt(queue: Arc<Queue>, job: Job, running: Running, seat: Seat) {
    tell_start(&job, &seat);
    let (queue, id) = (&queue, job.id);
    failpoint::pass(Point::Begun, id);
    let (sender, reports) = mpsc::channel(MOST_UNRECORDED);
    // until the end of the attempt is stored: then the worker elsewhere is told so
    let mut in_force = None;
    let solving = match seat {
        Seat::Here {
            slot,
            problem,
            mesh,
            memory,
        } => match &queue.solver {
            Solver::Threads(solve) => {
                let worker = Worker {
                    queue: queue.clone(),
                    id,
                    running: running.clone(),
                    recorder: sender,
                };
                let (key, in_sweep, solve) = (job.key, job.sweep.is_some(), *solve);
                let task = (problem, mesh, in_sweep.then_some(key));
                tokio::task::spawn_blocking(move || {
                    // given back when the solver has returned, or panicked, in this order: another job may have them then
                    let _slot = slot;
                    let memory = memory;
                    solve_on_thread(task, memory, solve, worker)
                })
            }
            Solver::Processes(_) => {
                let (queue, job, running) = (queue.clone(), job.clone(), running.clone());
                tokio::spawn(async move {
                    let _slot = slot; // as above
                    let memory = memory;
                    in_process::solve(&queue, (&job, problem), &memory, &running, sender).await
                })
            }
        },
        Seat::Elsewhere { lease, problem } => {
            let lease = Arc::new(AsyncMutex::new(lease));
            in_force = Some(lease.clone());
            tokio::spawn(async move { lease.lock().await.solve(problem, sender).await })
        }
    };
    let timer = tokio::spawn(time_out(queue.clone(), job.clone(), running.clone()));
    let timer = AbortOnDropHandle::new(timer);
    let (last, phases) = recorder::record(queue, &job, &running, reports).await;
    let solved = solving.await.unwrap_or_else(|panic| {
        let panic = panic
            .try_into_panic()
            .map(|panic| panicked("the solver", &*panic));
        let cause = panic.unwrap_or_else(|_| "the solver's thread was lost".into());
        Err(NoSolution::Internal(cause))
    });
    drop(timer);
    let origin = queue.origin(job.key);
    if let Err(NoSolution::Lost(how)) = &solved {
        phases.tell_spans(&job, origin.as_ref(), None);
        requeue_with_retries(queue, &job, Some(how)).await;
    } else if let Err(NoSolution::GivenBack) = &solved {
        phases.tell_spans(&job, origin.as_ref(), None);
        requeue_with_retries(queue, &job, None).await;
    } else {
        let (ending, parts) = ending_of_attempt(&job, solved, running.stop.get().copied());
        // when the service stops, it is requeued then or at the next start, and not canceled
        let requeued = ending.status == Status::Canceled && queue.stopping.is_cancelled();
        phases.tell_spans(&job, origin.as_ref(), (!requeued).then_some(&ending));
        queue.forget_origin(job.key);
        if !requeued {
            end_with_retries(queue, &job, ending, last, parts).await;
        }
    }
    drop(in_force);
    failpoint::pass(Point::Done, id);
}

/// Logs where an attempt begins, or goes on.
fn tell_start(job: &Job, seat: &Seat) {
    let (id, attempt) = (job.id, job.attempt);
    match seat {
        Seat::Here { .. } => info!(job.id = %id, job.attempt = attempt, "job {id} started"),
        Seat::Elsewhere { lease, problem } => {
            let Offer { worker, name, .. } = lease.offer();
            let how = if problem.is_some() {
                "started"
            } else {
                "goes on"
            };
            info!(job.id = %id, job.attempt = attempt, %worker, "job {id} {how} at {worker} on {name}");
        }
    }
}

/// Solves a claimed job on this thread: the problem, the hash of its mesh, and the key of a job whose members are to be
/// solved.
fn solve_on_thread(
    (problem, mesh, members): (String, Option<String>, Option<i64>),
    memory: Option<Reservation>,
    solve: Solve,
    mut worker: Worker,
) -> Result<Solved, NoSolution> {
    let mut memory = memory.ok_or_else(|| NoSolution::Internal("no memory is reserved".into()))?;
    memory.free_dropped();
    let (store, now) = (worker.queue.store.clone(), Handle::current());
    let mesh = mesh.map(|hash| now.block_on(stored_mesh(&store, &hash)));
    let mesh = mesh.transpose()?;
    let members = members.map(|key| now.block_on(members_of(&store, key)));
    let members = members.transpose()?;
    if failpoint::fails(Point::MeshRead, worker.id) {
        return Err(NoSolution::Internal("a test wants it".into()));
    }
    let mesh = mesh.as_deref().map(read_mesh).transpose()?;
    let (allowance, members) = (memory.allowance(), members.as_ref());
    solve_task(&problem, mesh, members, solve, allowance, &mut worker)
}

/// The worker of a job as the supervisor of its solver, on a blocking thread.
struct Worker {
    queue: Arc<Queue>,
    id: JobId,
    running: Running,
    recorder: mpsc::Sender<Batch>,
}

impl Worker {
    fn record(&mut self, put: impl FnOnce(&mut Batch)) {
        let mut batch = Batch::default();
        put(&mut batch);
        if self.recorder.blocking_send(batch).is_err() {
            self.running.stop(StopReason::Unwanted); // the recorder has ended: the result is not needed
        }
    }
}

impl Supervisor for Worker {
    fn one_level(&mut self) {
        failpoint::pass(Point::Parsed, self.id);
        self.record(|batch| batch.one_level = true);
    }

    fn event(&mut self, payload: Payload) {
        if let Payload::Stage { stage } = &payload
            && let Some(point) = Point::beginning_of(*stage)
        {
            failpoint::pass(point, self.id);
        }
        self.record(|batch| batch.events.push((Time::now(), payload)));
    }

    fn member(&mut self, row: MemberRow) {
        self.record(|batch| batch.members.push((Time::now(), row)));
    }

    fn partial(&mut self, parts: Parts) {
        self.record(|batch| batch.partial = Some(Arc::new(parts)));
    }

    fn stop(&mut self) -> bool {
        self.running.stop.get().is_some()
    }

    fn threads(&mut self) -> usize {
        1 + usize::from(self.queue.has_spare_processor())
    }
}

/// Requeues a job whose worker was lost, for the reason `how`, or ends it if that was its last attempt; or requeues a job
/// that its worker has given back. This is retried until it succeeds or is useless.
async fn requeue_with_retries(queue: &Queue, job: &Job, how: Option<&str>) {
    let (store, key) = (&queue.store, job.key);
    match how {
        Some(how) => {
            warn!(job.id = %job.id, job.attempt, "the process that solved {} died: {how}", job.id);
        }
        None => info!(job.id = %job.id, job.attempt, "job {} was given back by its worker", job.id),
    }
    let mut backoff = Backoff::default();
    loop {
        let requeued = match how {
            Some(how) => store.requeue_lost(key, job.attempt, how).await,
            None => {
                let requeued = store.requeue_drained(key, job.attempt).await;
                requeued.map(|requeued| requeued.map(|_| key).into_iter().collect())
            }
        };
        match requeued {
            Ok(changed) => {
                queue.announce(&changed);
                return queue.wake.notify_one();
            }
            Err(cause) if backoff.gives_up(job.id, job.key, &cause) => return,
            Err(cause) => {
                warn!(job.id = %job.id, %cause, "job {} could not be requeued yet: {cause}", job.id);
            }
        }
        if !backoff.wait(&queue.stopping).await {
            return;
        }
    }
}

/// Asks the solver of a job to stop at the job's time limit, and ends the job by force if its solver does not stop.
async fn time_out(queue: Arc<Queue>, job: Job, running: Running) {
    // a job that goes on elsewhere after a restart of the service has run before
    let ran = job
        .started_at
        .map_or(0.0, |start| start.seconds_until(Time::now()));
    let left = (job.limits.timeout_s - ran.max(0.0)).clamp(0.0, job.limits.timeout_s);
    tokio::time::sleep(Duration::from_secs_f64(left)).await;
    running.stop(StopReason::OutOfTime);
    tokio::time::sleep(TIMEOUT_GRACE).await;
    // in its own task: a solver that returns now stops this timer, but not a commit that has begun
    tokio::spawn(async move {
        let ending = timed_out(&job);
        match queue.end_attempt(job.key, running.attempt, &ending).await {
            Ok(true) => warn!(
                job.id = %job.id,
                "job {} was ended at its time limit, but its solver has not stopped yet", job.id
            ),
            Ok(false) => {}
            Err(cause) => {
                error!(job.id = %job.id, %cause, "job {} could not be ended: {cause}", job.id);
            }
        }
    });
}

/// Stores the result of an attempt, then its end. This is retried until it succeeds, since the disk may be full
/// temporarily and a job must not stay running. If the service stops in the meantime, its next start requeues the job.
async fn end_with_retries(
    queue: &Queue,
    job: &Job,
    ending: Ending,
    last: FinalBatch,
    parts: Option<Parts>,
) {
    let parts = parts.map(Arc::new);
    let mut backoff = Backoff::default();
    let stored = loop {
        let cause = match try_to_end(queue, job, &ending, &last, parts.as_ref()).await {
            Ok(stored) => break stored,
            Err(cause) => cause,
        };
        if backoff.gives_up(job.id, job.key, &cause) {
            return;
        }
        warn!(job.id = %job.id, %cause, "job {} could not be ended yet: {cause}", job.id);
        if !backoff.wait(&queue.stopping).await {
            return;
        }
    };
    // another one has ended it meanwhile
    if !stored
        && let Some(parts) = parts
        && let Err(cause) = queue.store.discard_parts(&parts).await
    {
        warn!(%cause, "the unused result of job {} stays in the store until the next start: {cause}", job.id);
    }
}

/// Stores the result and the end of an attempt; false when the attempt is no longer the current one.
async fn try_to_end(
    queue: &Queue,
    job: &Job,
    ending: &Ending,
    last: &FinalBatch,
    parts: Option<&Arc<Parts>>,
) -> store::Result<bool> {
    let (key, attempt) = (job.key, job.attempt);
    if failpoint::fails(Point::Solved, job.id) {
        return Err(StoreError::Full);
    }
    let current = match parts {
        Some(parts) => queue.store.write_before_end(key, attempt, parts).await?,
        None => true,
    };
    if !current {
        return Ok(false);
    }
    if failpoint::fails(Point::AlmostStored, job.id) {
        return Err(StoreError::Full);
    }
    let changed = queue
        .store
        .finish(key, attempt, ending, last.clone(), parts);
    let Some(changed) = changed.await? else {
        return Ok(false);
    };
    failpoint::pass(Point::Unannounced, job.id);
    queue.announce(&changed);
    Ok(true)
}
