//! Takes jobs, has them solved, and reports.

use std::{
    collections::BTreeMap,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use base::{
    memory::{Allowance, Budget, Reservation},
    run::Solve,
};
use parking_lot::Mutex;
use service::queue::{End, Supervisor as _, Task, limit_memory, solve_leased};
use tokio::{
    sync::{OwnedSemaphorePermit, Semaphore},
    time::{sleep, timeout},
};
use tokio_util::sync::CancellationToken;
use tonic::transport::Channel;
use tracing::{info, warn};

use super::{
    calls::{Calls, Failure, Leased, PAUSES},
    outbox::{Key, News, Outbox, Teller},
    settings::Settings,
};

/// How long a request for a job waits at the service.
const WAIT: Duration = Duration::from_secs(20);
/// How long a report waits for more, unless a job has ended.
const TOGETHER: Duration = Duration::from_millis(10);
/// How long a solver that is asked to stop may take, before its job is given back without it.
const STOP_GRACE: Duration = Duration::from_secs(5);
/// The part of the memory for condensed bodies that are kept for later jobs, as 1/n.
const FOR_BODIES: u64 = 4;
/// How many jobs there may be for each slot, with those that have ended and are being stored by the service.
const JOBS_PER_SLOT: usize = 2;
/// The largest number of jobs at a time: a report names all of them.
const MOST_JOBS: usize = 1024;
/// The memory for the stored forms of meshes that are kept for later jobs (bytes).
const FOR_MESHES: usize = 256 << 20;

/// The error that the service wants nothing of this worker.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Unwanted(String);

#[derive(Debug)]
struct Worker {
    calls: Calls,
    settings: Settings,
    solve: Solve,
    budget: Arc<Budget>,
    jobs: Mutex<BTreeMap<Key, Arc<Outbox>>>,
    /// Notified when there is something to report.
    news: Arc<News>,
    /// The longest time between two reports.
    pulse: Mutex<Duration>,
    meshes: Mutex<Vec<(String, Arc<Vec<u8>>)>>,
    /// Why the service wants nothing of this worker.
    unwanted: Mutex<Option<String>>,
    /// Whether the service takes no reports.
    mute: AtomicBool,
    /// Canceled when the worker is to end.
    stop: CancellationToken,
}

/// Solves jobs of the service at the other end of a channel until `stop` is canceled, or until there was no job for long.
/// Returns how many it has solved.
///
/// # Errors
///
/// The service does not accept this worker: its token, its version or its processor.
pub async fn run(
    channel: Channel,
    token: Option<&str>,
    settings: Settings,
    solve: Solve,
    stop: CancellationToken,
) -> Result<u64, Unwanted> {
    let calls = Calls::new(channel, token, settings.process.clone()).map_err(Unwanted)?;
    let memory = settings.memory_bytes;
    let of_bodies = match settings.process {
        Some(_) => 0, // its memory is that of its job
        None => memory / FOR_BODIES,
    };
    let worker = Arc::new(Worker {
        calls,
        budget: Budget::new(memory, settings.slots, of_bodies),
        settings,
        solve,
        jobs: Mutex::default(),
        news: Arc::default(),
        pulse: Mutex::new(PAUSES.0),
        meshes: Mutex::default(),
        unwanted: Mutex::default(),
        mute: AtomicBool::new(false),
        stop: stop.child_token(),
    });
    let reporting = tokio::spawn(worker.clone().report());
    let solved = worker.clone().take_jobs().await;
    worker.drain().await;
    reporting.abort();
    match worker.unwanted.lock().take() {
        Some(why) => Err(Unwanted(why)),
        None => Ok(solved),
    }
}

impl Worker {
    /// Asks for jobs and starts them, until the worker is to end; returns how many.
    async fn take_jobs(self: Arc<Self>) -> u64 {
        let count = usize::from(self.settings.slots);
        let slots = Arc::new(Semaphore::new(count));
        // a slot is free when its solver has ended: the next job is asked for while the service stores the end
        let places = Arc::new(Semaphore::new((JOBS_PER_SLOT * count).min(MOST_JOBS)));
        let (mut number, mut busy) = (0, Instant::now());
        loop {
            let free = async {
                let place = places.clone().acquire_owned().await;
                Some((place.ok()?, slots.clone().acquire_owned().await.ok()?))
            };
            let free = tokio::select! {
                free = free => free,
                () = self.stop.cancelled() => return number,
            };
            let Some((place, slot)) = free else {
                return number;
            };
            let Some(leased) = self.next_job(number + 1, &mut busy).await else {
                return number;
            };
            number += 1;
            busy = Instant::now();
            self.start(leased, place, slot).await;
        }
    }

    /// Asks for a job until there is one; `None` if the worker is to end. `busy`: when it last had a job.
    async fn next_job(&self, number: u64, busy: &mut Instant) -> Option<Leased> {
        let mut pause = PAUSES.0;
        loop {
            if !self.jobs.lock().is_empty() {
                *busy = Instant::now();
            }
            let idle = self.settings.idle_exit;
            let left = idle.map(|idle| idle.saturating_sub(busy.elapsed()));
            let ends = left == Some(Duration::ZERO) || self.stop.is_cancelled();
            let wait = if ends {
                Duration::ZERO
            } else {
                left.map_or(WAIT, |left| left.min(WAIT))
            };
            let asking = self
                .calls
                .lease(&self.settings, number, self.free_bytes(), wait, ends);
            let answer = tokio::select! {
                answer = asking => answer,
                // it is asked whether it has just got a job
                () = self.stop.cancelled(), if !ends => continue,
            };
            match answer {
                Ok((leased, pulse)) => {
                    *self.pulse.lock() = pulse;
                    if leased.is_some() || ends {
                        return leased;
                    }
                    pause = PAUSES.0;
                }
                Err(Failure::Final(why)) => {
                    self.give_up(why);
                    return None;
                }
                Err(Failure::Passing(_)) if ends => return None,
                Err(Failure::Passing(why)) => {
                    if pause == PAUSES.0 {
                        warn!("the service gives no job: {why}; it is asked again");
                    }
                    let _ = timeout(pause, self.stop.cancelled()).await;
                    pause = (pause * 2).min(PAUSES.1);
                }
            }
        }
    }

    /// The memory that is free (bytes).
    fn free_bytes(&self) -> u64 {
        self.budget.bytes() - self.budget.reserved()
    }

    fn give_up(&self, why: String) {
        self.unwanted.lock().get_or_insert(why);
        self.stop.cancel();
    }

    /// Fetches what the job needs, and starts to solve it.
    async fn start(
        self: &Arc<Self>,
        leased: Leased,
        place: OwnedSemaphorePermit,
        slot: OwnedSemaphorePermit,
    ) {
        let (id, attempt) = (leased.id.clone(), leased.attempt);
        info!(job.id = %id, attempt, "job {id} is leased");
        let outbox = Arc::new(Outbox::new(
            self.news.clone(),
            leased.session,
            self.settings.process.is_some(),
        ));
        self.jobs
            .lock()
            .insert((id.clone(), attempt), outbox.clone());
        let task = self.task(&leased).await;
        // before the next job is asked for
        let memory = self.budget.reserve(leased.memory_bytes);
        let worker = self.clone();
        tokio::spawn(async move {
            match (task, memory) {
                (Some(task), Some(memory)) => {
                    worker.solve(&leased, task, (memory, slot), &outbox).await;
                }
                // another worker may have more luck
                _ => outbox.finish(&End::GivenBack, None),
            }
            outbox.over.cancelled().await;
            worker.jobs.lock().remove(&(leased.id, leased.attempt));
            drop(place);
            info!(job.id = %id, attempt, "job {id} {}", outbox.how_it_went());
        });
    }

    /// The task of a job; `None` if it cannot be fetched.
    async fn task(&self, leased: &Leased) -> Option<Task> {
        let rest = self
            .calls
            .content(leased, false, leased.task.clone(), leased.task_bytes);
        let json = rest
            .await
            .inspect_err(|why| warn!(job.id = %leased.id, "its task cannot be fetched: {why}"));
        let task = serde_json::from_slice(&json.ok()?);
        task.inspect_err(|why| warn!(job.id = %leased.id, "its task cannot be read: {why}"))
            .ok()
    }

    /// The stored form of a job's mesh: one that is kept, or that of the service.
    async fn mesh(&self, leased: &Leased, hash: &str) -> Result<Arc<Vec<u8>>, String> {
        let kept = self
            .meshes
            .lock()
            .iter()
            .find(|(kept, _)| kept == hash)
            .cloned();
        if let Some((_, mesh)) = kept {
            return Ok(mesh);
        }
        let mesh = Arc::new(self.calls.content(leased, true, vec![], u64::MAX).await?);
        if self.settings.process.is_some() {
            return Ok(mesh);
        }
        let mut meshes = self.meshes.lock();
        meshes.push((hash.to_owned(), mesh.clone()));
        // the oldest go, but the last one stays
        while meshes.len() > 1
            && meshes.iter().map(|(_, mesh)| mesh.len()).sum::<usize>() > FOR_MESHES
        {
            meshes.remove(0);
        }
        Ok(mesh)
    }

    async fn solve(
        self: &Arc<Self>,
        leased: &Leased,
        task: Task,
        (memory, slot): (Reservation, OwnedSemaphorePermit),
        outbox: &Arc<Outbox>,
    ) {
        let mesh = match &leased.mesh {
            None => None,
            Some(hash) => match self.mesh(leased, hash).await {
                Ok(mesh) => Some(mesh),
                Err(why) => {
                    warn!(job.id = %leased.id, "its mesh cannot be fetched: {why}");
                    return outbox.finish(&End::GivenBack, None);
                }
            },
        };
        let (worker, solve) = (self.clone(), self.solve);
        let mut teller = Teller::new(
            outbox.clone(),
            match task.threads {
                Some(threads) => Box::new(move || threads > 1),
                None => Box::new(move || worker.has_spare_processor()),
            },
        );
        let share = leased
            .memory_bytes
            .filter(|_| self.settings.process.is_some());
        let solving = tokio::task::spawn_blocking(move || {
            let mut memory = memory;
            memory.free_dropped();
            let mesh = mesh.as_ref().map(|mesh| mesh.as_slice());
            let allowance = match share {
                None => memory.allowance(),
                Some(share) => {
                    if let Err(error) = limit_memory(share) {
                        warn!(%error, "the memory of a job cannot be limited: {error}");
                    }
                    let bodies = None;
                    Allowance { share, bodies }
                }
            };
            let (end, result) =
                solve_leased(&task, mesh, solve, allowance, share.is_none(), &mut teller);
            if share.is_some() {
                // what the next job needs before it is solved is not in its share
                let _ = limit_memory(u64::MAX);
            }
            match teller.stop() && teller.is_given_back() {
                true => teller.outbox().finish(&End::GivenBack, None),
                false => teller.outbox().finish(&end, result),
            }
            // given back before the service is asked for another job
            drop(memory);
            drop(slot);
        });
        if solving.await.is_err() {
            outbox.finish(&End::GivenBack, None);
        }
    }

    fn has_spare_processor(&self) -> bool {
        2 * self.jobs.lock().len() <= self.settings.cores as usize
    }

    /// Reports for all jobs together, whenever there is something to report, and often enough to renew their leases.
    async fn report(self: Arc<Self>) {
        let mut pause = PAUSES.0;
        loop {
            let pulse = *self.pulse.lock();
            let _ = timeout(pulse, self.news.any.notified()).await;
            let _ = timeout(TOGETHER, self.news.ended.notified()).await;
            let jobs: Vec<(Key, Arc<Outbox>)> = {
                let jobs = self.jobs.lock();
                // the service knows no more of one that is over
                let jobs = jobs
                    .iter()
                    .filter(|(_, outbox)| !outbox.over.is_cancelled());
                jobs.map(|(key, outbox)| (key.clone(), outbox.clone()))
                    .collect()
            };
            if jobs.is_empty() {
                continue;
            }
            match self.calls.report(&jobs, self.free_bytes()).await {
                Ok(pulse) => {
                    (*self.pulse.lock(), pause) = (pulse, PAUSES.0);
                }
                Err(Failure::Final(why)) => {
                    self.mute.store(true, Relaxed);
                    self.give_up(why);
                    return;
                }
                Err(Failure::Passing(why)) => {
                    if pause == PAUSES.0 {
                        warn!("the service takes no report: {why}; it is told again");
                    }
                    sleep(pause).await;
                    pause = (pause * 2).min(PAUSES.1);
                }
            }
        }
    }

    /// Lets the jobs go on for a while, then gives back those that have not ended.
    async fn drain(&self) {
        let outboxes = || -> Vec<Arc<Outbox>> { self.jobs.lock().values().cloned().collect() };
        let (grace, all) = (self.settings.grace, outboxes());
        let is_process = self.settings.process.is_some(); // its service is gone
        if is_process || self.mute.load(Relaxed) || timeout(grace, all_over(&all)).await.is_ok() {
            return;
        }
        let rest = outboxes();
        rest.iter().for_each(|outbox| outbox.give_back());
        if timeout(STOP_GRACE, all_over(&rest)).await.is_ok() {
            return;
        }
        // without their solvers, which take long to stop; nobody waits for them
        rest.iter()
            .for_each(|outbox| outbox.finish(&End::GivenBack, None));
        if timeout(STOP_GRACE, all_over(&rest)).await.is_err() {
            warn!(
                "the service did not confirm that it got back the jobs: it will miss them when their leases end"
            );
        }
    }
}

/// Waits until the service needs nothing more of these jobs.
async fn all_over(outboxes: &[Arc<Outbox>]) {
    for outbox in outboxes {
        outbox.over.cancelled().await;
    }
}
