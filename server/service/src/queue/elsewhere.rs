//! Solves jobs at workers in other processes, elsewhere or here: what workers ask of the queue, and one leased attempt.

use std::{sync::Arc, time::Duration};

use base::job::{Job, JobId};
use store::Room;
use tokio::sync::mpsc;

use super::{
    batch::Batch,
    ending::{NoSolution, Solved},
    leases::{
        Ask, Found, Granted, JobAnswer, JobReport, Lease, Offer, Pace, Task, Told, WorkerId,
        WorkerState,
    },
    running::Running,
    solving::{members_of, stored_mesh},
    state::Queue,
};

/// How long a claim may take.
const LONGEST_CLAIM: Duration = Duration::from_secs(2);

/// The error that there are as many workers as there may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooManyWorkers;

impl Queue {
    /// Leases a job to a worker, and waits for one for at most this long; `None` if there is none.
    pub async fn lease(
        &self,
        worker: &WorkerId,
        ask: Ask,
        wait: Duration,
    ) -> Result<Option<Arc<Granted>>, TooManyWorkers> {
        let number = ask.number;
        // of one that ends, a claim may be under way: it must not miss what it gets
        let wait = if ask.takes { wait } else { LONGEST_CLAIM };
        let waiting = match self.leases.ask(worker, ask) {
            Found::Granted(granted) => return Ok(Some(granted)),
            Found::Nothing => return Ok(None),
            Found::TooMany => return Err(TooManyWorkers),
            Found::Waits(waiting) => waiting,
        };
        self.store.budget().set_elsewhere(self.leases.largest());
        let woken = waiting.wake.notified();
        tokio::pin!(woken);
        woken.as_mut().enable();
        if self.leases.granted(worker, number).is_none() {
            self.wake.notify_one();
            tokio::select! {
                () = woken => {}
                () = tokio::time::sleep(wait) => {}
                () = self.stopping.cancelled() => {}
            }
        }
        Ok(self.leases.granted(worker, number))
    }

    /// Takes what a worker reports of one job.
    pub async fn take_report(
        &self,
        worker: &WorkerId,
        job: JobId,
        attempt: i32,
        report: JobReport,
    ) -> JobAnswer {
        self.leases.take(worker, (job, attempt), report).await
    }

    /// The job with its task, if it is the last one that was leased to this worker. `Err`: why it is not.
    pub fn leased_task(
        &self,
        worker: &WorkerId,
        job: JobId,
        attempt: i32,
    ) -> Result<Arc<Granted>, String> {
        self.leases.lease_of(worker, job, attempt)?;
        let last = self.leases.last_granted(worker);
        let this = |granted: &Arc<Granted>| (granted.job, granted.attempt) == (job, attempt);
        last.filter(this)
            .ok_or_else(|| format!("{worker} has asked for another job since {job}"))
    }

    /// The stored form of the mesh of a job that is leased to this worker. `Err`: why there is none.
    pub async fn leased_mesh(
        &self,
        worker: &WorkerId,
        job: JobId,
        attempt: i32,
    ) -> Result<Arc<Vec<u8>>, String> {
        let lease = self.leases.lease_of(worker, job, attempt)?;
        let mut kept = lease.mesh.lock().await;
        if let Some(mesh) = &*kept {
            return Ok(mesh.clone());
        }
        let hash = lease
            .job
            .mesh
            .as_ref()
            .ok_or("the job has no stored mesh")?;
        let mesh = match stored_mesh(&self.store, hash).await {
            Ok(mesh) => Arc::new(mesh),
            Err(no_solution) => {
                // no other worker could read it either
                lease.fail(no_solution).await;
                return Err(format!("mesh {hash} cannot be read"));
            }
        };
        *kept = Some(mesh.clone());
        Ok(mesh)
    }

    /// The workers that have been heard of lately, in the order of their names.
    pub fn workers(&self) -> Vec<WorkerState> {
        self.leases.states()
    }

    /// Notes what memory a worker has free (bytes) as it reports.
    pub fn has_free(&self, worker: &WorkerId, free_bytes: u64) {
        self.leases.has_free(worker, free_bytes);
    }

    /// How often workers are to report: those elsewhere, or the processes on this machine.
    pub fn pace(&self, here: bool) -> Pace {
        self.leases.pace(here)
    }

    /// Sets how long a lease lasts that is not renewed.
    pub fn set_lease(&self, lasts: Duration) {
        self.leases.set_lasts(lasts);
    }
}

/// A lease that is in force; it ends when this is dropped.
pub(super) struct InForce {
    queue: Arc<Queue>,
    offer: Offer,
    lease: Arc<Lease>,
    told: Option<mpsc::Receiver<Told>>,
    /// How many threads the solver may have; `None`: the worker decides.
    threads: Option<usize>,
}

impl Drop for InForce {
    fn drop(&mut self) {
        self.queue.leases.remove(&self.lease);
        self.lease.end();
        let Offer { worker, number, .. } = &self.offer;
        self.queue.leases.give_back(worker, *number);
        self.queue.wake.notify_one();
    }
}

impl InForce {
    /// Leases a job to a worker, of whose attempt as many events are stored.
    pub(super) fn new(
        queue: &Arc<Queue>,
        offer: Offer,
        job: &Job,
        running: &Running,
        stored_events: u64,
    ) -> InForce {
        InForce::of(queue, offer, job.clone(), running, stored_events, None)
    }

    /// Leases a job of this share of the memory (bytes) to a process on this machine, as its job of this number.
    pub(super) fn here(
        queue: &Arc<Queue>,
        (worker, number): (WorkerId, u64),
        job: &Job,
        running: &Running,
        share: u64,
    ) -> InForce {
        let name = "this machine".to_owned();
        let room = Room { whole: 0, free: 0 };
        let offer = Offer {
            worker,
            name,
            number,
            room,
        };
        // it may use its share, and its result too
        let job = Job {
            memory_bytes: Some(share),
            ..job.clone()
        };
        let threads = 1 + usize::from(queue.has_spare_processor());
        InForce::of(queue, offer, job, running, 0, Some(threads))
    }

    fn of(
        queue: &Arc<Queue>,
        offer: Offer,
        job: Job,
        running: &Running,
        stored_events: u64,
        threads: Option<usize>,
    ) -> InForce {
        let (worker, name) = (offer.worker.clone(), offer.name.clone());
        let session = (queue.session, stored_events, queue.leases.lasts());
        let (lease, told) = Lease::new(job, worker, name, running.clone(), session);
        queue.leases.enter(&lease);
        InForce {
            queue: queue.clone(),
            offer,
            lease,
            told: Some(told),
            threads,
        }
    }

    /// The offer that was taken.
    pub(super) fn offer(&self) -> &Offer {
        &self.offer
    }

    /// Has the job solved by the worker, until it tells the end of the attempt or is lost. Without a problem: it has the job
    /// already.
    pub(super) async fn solve(
        &mut self,
        problem: Option<String>,
        recorder: mpsc::Sender<Batch>,
    ) -> Result<Solved, NoSolution> {
        if let Some(problem) = problem {
            self.grant(problem).await?;
        }
        match self.told.take() {
            Some(told) => {
                let stopping = &self.queue.stopping;
                self.lease.attend(told, recorder, stopping).await
            }
            None => Err(NoSolution::Internal("the job was leased twice".into())),
        }
    }

    /// Grants the job to the worker that waits for it.
    async fn grant(&self, problem: String) -> Result<(), NoSolution> {
        let job = &self.lease.job;
        let members = match job.sweep {
            Some(_) => Some(members_of(&self.queue.store, job.key).await?),
            None => None,
        };
        let task = serde_json::to_vec(&Task {
            problem,
            members,
            threads: self.threads,
        });
        let granted = Granted {
            number: self.offer.number,
            job: job.id,
            attempt: job.attempt,
            memory_bytes: job.memory_bytes,
            mesh: job.mesh.clone(),
            session: self.queue.session,
            task: task.map_err(|error| NoSolution::Internal(error.to_string()))?,
        };
        let (leases, worker) = (&self.queue.leases, &self.offer.worker);
        match self.lease.is_here() {
            true => leases.grant_here(worker, granted),
            false => leases.grant(worker, granted),
        }
        Ok(())
    }
}
