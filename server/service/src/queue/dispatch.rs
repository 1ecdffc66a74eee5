//! Starts jobs whenever a worker is free and a job waits; runs periodic tasks.

use std::{sync::Arc, time::Duration};

use base::{
    failpoint::{self, Point},
    job::Job,
    time::Time,
};
use store::{Accepted, Claim, Claims, Leased, Place, RepeatedError, Result, Submission};
use tokio::sync::OwnedSemaphorePermit;
use tracing::error;

use super::{
    elsewhere::InForce,
    leases::Offer,
    running::Running,
    state::{Queue, Slot, Solver},
    worker::{self, Seat},
};

/// How often the time limits of waiting jobs are checked.
const CHECK_INTERVAL: Duration = Duration::from_secs(1);

/// The pause after a panic, so that a task that panics at once does not occupy a processor.
const PAUSE_AFTER_PANIC: Duration = Duration::from_millis(100);

impl Queue {
    /// Starts the workers. They run until the service stops.
    pub fn start(self: &Arc<Self>) {
        tokio::spawn(self.clone().open());
        tokio::spawn(keep_running(self.clone(), Queue::dispatch));
        tokio::spawn(keep_running(self.clone(), Queue::run_periodic_tasks));
    }

    /// Opens the slots, when their processes have started.
    async fn open(self: Arc<Self>) {
        if let Solver::Processes(processes) = &self.solver {
            processes.prepare(self.workers).await;
        }
        self.slots.add_permits(usize::from(self.workers));
        self.wake.notify_one();
    }

    /// Accepts jobs. When this function returns they are stored on the disk; a free worker is given the next job of the
    /// queue in the same commit.
    pub async fn submit(self: &Arc<Self>, submission: Submission) -> Result<Accepted> {
        let Some(slot) = self.free_slot() else {
            let accepted = self.store.submit(submission, false).await?;
            self.announce(&accepted.changed);
            self.wake.notify_one();
            return Ok(accepted);
        };
        let _guard = self.claiming.read().await;
        let claim = !self.stopping.is_cancelled() && !self.store.is_paused();
        let submitted = self.store.submit(submission, claim).await;
        match submitted {
            Ok(mut accepted) => {
                self.announce(&accepted.changed);
                match accepted.claim.take() {
                    Some(claim) => self.start_worker(claim, slot),
                    None => drop(slot),
                }
                self.wake.notify_one(); // there may be several jobs, or the slot is free again
                Ok(accepted)
            }
            Err(cause) => {
                drop(slot);
                self.wake.notify_one();
                Err(cause)
            }
        }
    }

    /// Claims a job whenever a slot is free and a job waits, until the service stops.
    async fn dispatch(self: Arc<Self>) {
        let mut starting = RepeatedError::new("no job can be started");
        loop {
            // a notification from here on is kept for the wait below, so that none is missed
            while self.store.waiting() > 0 {
                match starting.note(self.claim().await) {
                    Some(true) => {}
                    Some(false) => break,
                    None => tokio::time::sleep(CHECK_INTERVAL).await, // the disk may be full for a while
                }
            }
            tokio::select! {
                () = self.wake.notified() => {}
                () = self.stopping.cancelled() => return,
            }
        }
    }

    /// Takes an idle worker; `None` if there is none or no job may start now.
    fn free_slot(&self) -> Option<OwnedSemaphorePermit> {
        if self.store.is_paused() || self.stopping.is_cancelled() {
            return None;
        }
        self.slots.clone().try_acquire_owned().ok()
    }

    /// Claims the next jobs for the idle workers, here and elsewhere, or ends jobs that can be answered from earlier results;
    /// false if it did neither.
    async fn claim(self: &Arc<Self>) -> Result<bool> {
        let _guard = self.claiming.read().await;
        let most = self.store.waiting();
        let mut slots: Vec<_> = (0..most).map_while(|_| self.free_slot()).collect();
        if self.stopping.is_cancelled() || self.store.is_paused() {
            return Ok(false);
        }
        let mut offers = Offers::take(self);
        if slots.is_empty() && offers.taken.is_empty() {
            return Ok(false);
        }
        let away = offers.taken.iter().flatten();
        let away = away.map(|offer| Place::Away(offer.lessee(), offer.room));
        let here = slots.iter().map(|_| Place::Here);
        let Claims { claims, changed } = self.store.claim_for(away.chain(here).collect()).await?;
        self.announce(&changed);
        // some may have been answered from results; there may be more
        let any = !claims.is_empty() || !changed.is_empty();
        for (place, claim) in claims {
            // the slots come after the offers, and are all alike
            match offers.taken.get_mut(place).and_then(Option::take) {
                Some(offer) => self.start_elsewhere(claim.job, offer, Some(claim.problem), 0),
                None => {
                    if let Some(slot) = slots.pop() {
                        self.start_worker(claim, slot);
                    }
                }
            }
        }
        Ok(any)
    }

    /// Gives a claimed job to a worker. Call this while `claiming` is held.
    fn start_worker(self: &Arc<Self>, claim: Claim, slot: OwnedSemaphorePermit) {
        let slot = Slot {
            permit: Some(slot),
            queue: self.clone(),
        };
        let Claim {
            job,
            problem,
            mesh,
            memory,
        } = claim;
        let seat = Seat::Here {
            slot: Arc::new(slot),
            problem,
            mesh,
            memory,
        };
        let running = self.enter(&job, true);
        self.start_attempt(job, running, seat);
    }

    /// Gives a job to a worker elsewhere, or goes on with one that it has had since before the service restarted: then without
    /// the problem, and with the number of events that are stored. Call this while `claiming` is held, or before the first
    /// report can come.
    fn start_elsewhere(
        self: &Arc<Self>,
        job: Job,
        offer: Offer,
        problem: Option<String>,
        stored_events: u64,
    ) {
        let running = self.enter(&job, false);
        // in force when this returns: a report may come at once
        let lease = Box::new(InForce::new(self, offer, &job, &running, stored_events));
        self.start_attempt(job, running, Seat::Elsewhere { lease, problem });
    }

    /// Enters a claimed job among those that run.
    fn enter(&self, job: &Job, here: bool) -> Running {
        failpoint::pass(Point::Given, job.id);
        let running = Running::begin(job, here);
        self.running().insert(job.key, running.clone());
        running
    }

    fn start_attempt(self: &Arc<Self>, job: Job, running: Running, seat: Seat) {
        let queue = self.clone();
        tokio::spawn(async move { worker::run_attempt(&queue, job, running, seat).await });
    }

    /// Goes on with the jobs that workers elsewhere solve since before the service restarted: each has the time of a lease to
    /// report. Call this before the first report can come.
    pub async fn go_on(self: &Arc<Self>) -> Result<()> {
        let memory = self.store.workers_memory().await?;
        self.leases.remember(memory);
        self.store.budget().set_elsewhere(memory);
        for Leased {
            job,
            lessee,
            events,
        } in self.store.leased().await?
        {
            self.start_elsewhere(job, Offer::of_before(lessee), None, events);
        }
        Ok(())
    }

    /// Jobs that are running according to the store, but that no worker has: their keys and attempts.
    async fn lost(&self) -> Result<Vec<(i64, i32)>> {
        let mut running = self.store.running().await?;
        let ours = self.running();
        running.retain(|(key, _)| !ours.contains_key(key));
        Ok(running)
    }

    /// Requeues jobs that are running according to the store but have no worker: because the task that should have
    /// given them to a worker has panicked, or because the disk was full when the last service ended and when this one
    /// started.
    async fn requeue_lost(&self) -> Result<()> {
        if self.lost().await?.is_empty() {
            return Ok(()); // nearly always
        }
        let _guard = self.claiming.write().await; // no claim is under way
        if self.stopping.is_cancelled() {
            return Ok(()); // they are requeued by that
        }
        for (key, attempt) in self.lost().await? {
            let how = "it was left without a worker";
            let changed = match self.store.requeue_lost(key, attempt, how).await {
                Ok(changed) => changed,
                Err(cause) if cause.is_lasting(key) => continue, // logged, once; `doctor` names it
                Err(cause) => return Err(cause),
            };
            error!(
                job.key = key,
                attempt, "a job was left without a worker: it was requeued, or has ended"
            );
            self.announce(&changed);
            self.wake.notify_one();
        }
        Ok(())
    }

    /// Ends jobs that have waited too long, requeues lost jobs, and removes the ids of jobs deleted long ago, until the
    /// service stops.
    async fn run_periodic_tasks(self: Arc<Self>) {
        let mut expiring = RepeatedError::new("jobs that waited too long could not be ended");
        let mut requeuing = RepeatedError::new("lost jobs could not be requeued");
        let mut noting = RepeatedError::new("the memory of workers could not be stored");
        let mut stored = self.leases.remembered();
        let mut forgetting = RepeatedError::new("ids of deleted jobs could not be removed");
        loop {
            // one that is gone has no room for anybody
            let largest = self.leases.largest();
            self.store.budget().set_elsewhere(largest);
            if largest != stored {
                // after a restart a job that only they have room for waits for them
                let noted = noting.note(self.store.set_workers_memory(largest).await);
                stored = noted.map_or(stored, |()| largest);
            }
            let seen = self.state();
            self.last_hour
                .see(Time::now(), seen.queued as u64, seen.running as u64);
            match expiring.note(self.store.expire_queued(Time::now()).await) {
                Some(changed) if !changed.is_empty() => {
                    self.announce(&changed);
                    self.wake.notify_one();
                    continue; // there may be more
                }
                Some(_) | None => {}
            }
            requeuing.note(self.requeue_lost().await);
            forgetting.note(self.store.forget_deleted(Time::now()).await);
            tokio::select! {
                () = tokio::time::sleep(CHECK_INTERVAL) => {}
                () = self.stopping.cancelled() => return,
            }
        }
    }
}

/// Offers of workers elsewhere that were taken; those that got no job are given back when this is dropped.
struct Offers<'a> {
    queue: &'a Queue,
    /// `None`: the offer has got a job.
    taken: Vec<Option<Offer>>,
}

impl Offers<'_> {
    fn take(queue: &Queue) -> Offers<'_> {
        let taken = queue.leases.take_offers();
        let taken = taken.into_iter().map(Some).collect();
        Offers { queue, taken }
    }
}

impl Drop for Offers<'_> {
    fn drop(&mut self) {
        for Offer { worker, number, .. } in self.taken.iter().flatten() {
            self.queue.leases.give_back(worker, *number);
        }
    }
}

/// Runs a task of the queue until it ends, and again after each panic.
async fn keep_running<F>(queue: Arc<Queue>, task: fn(Arc<Queue>) -> F)
where
    F: Future<Output = ()> + Send + 'static,
{
    while let Err(panic) = tokio::spawn(task(queue.clone())).await {
        if panic.is_cancelled() {
            return; // with the whole runtime
        }
        error!(%panic, "a task of the queue has panicked and is started again: {panic}");
        tokio::time::sleep(PAUSE_AFTER_PANIC).await;
    }
}
