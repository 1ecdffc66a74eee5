//! Operations on the queue as a whole.

use std::sync::Arc;

use base::{
    caller::{Caller, Owners},
    job::{Job, JobId, Status, Waiting as Reason},
    time::Time,
};
use futures_util::future::BoxFuture;
use schemars::JsonSchema;
use serde::Serialize;
use store::{Filter, Order, OrderBy};

use super::service::{Service, detached};
use crate::{error::ApiError, queue::LoadPoint};

/// The state of the queue.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct QueueState {
    /// Whether the queue is paused, so that no new job is started.
    pub paused: bool,
    /// The number of jobs that wait for a worker, or for another job with the same input.
    pub queued: u64,
    /// The number of running jobs.
    pub running: u64,
    /// The number of jobs that can run at the same time.
    pub workers: u32,
    /// The number of idle workers.
    pub idle: u32,
    /// The maximum number of waiting jobs; further ones are refused.
    pub max_queued: u32,
}

/// Returns the state of the queue.
pub fn state(service: &Service, _caller: &Caller) -> QueueState {
    let state = service.queue.state();
    QueueState {
        paused: state.paused,
        queued: state.queued as u64,
        running: state.running as u64,
        workers: state.workers,
        idle: state.idle as u32,
        max_queued: service.config.max_queued,
    }
}

/// The jobs that wait, and the load of the last hour.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Forecast {
    /// The caller's waiting jobs, the next to start first: at most a hundred of the thousand oldest.
    pub waiting: Vec<WaitingJob>,
    /// The load of the last hour, a point for each minute that the service ran, the oldest first.
    pub last_hour: Vec<LoadPoint>,
}

/// A job that waits.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct WaitingJob {
    /// The job.
    pub id: JobId,
    /// Its name.
    pub name: Option<String>,
    /// Its owner.
    pub owner: String,
    /// Its position in the queue, from 1; 0 for a job that is coalesced into a running one.
    pub position: i64,
    /// Why it waits.
    pub reason: Reason,
    /// In how many seconds it starts, if jobs run as long as those that ended last, and one that has run longer takes as
    /// long again; absent if that is unknown, and while the queue is paused.
    pub starts_in_s: Option<f64>,
}

/// The jobs that wait, as they are listed for a forecast.
const MOST_LISTED: i64 = 1000;
/// The jobs that wait, in an answer.
const MOST_WAITING: usize = 100;
/// The jobs that have ended lately, whose mean time to run is that of those that wait.
const MOST_ENDED: i64 = 20;

/// Returns the jobs that wait, with a forecast of their starts, and the load of the last hour.
pub fn waiting<'a>(
    service: &'a Service,
    caller: &'a Caller,
) -> BoxFuture<'a, Result<Forecast, ApiError>> {
    Box::pin(async move {
        let store = &service.store;
        let with_status = |status| Filter {
            statuses: vec![status],
            ..Filter::default()
        };
        let list = |status, owners, order, most| {
            let filter = with_status(status);
            async move { store.some_jobs(owners, &filter, order, None, most).await }
        };
        let newest_end = Order {
            by: OrderBy::FinishedAt,
            descending: true,
        };
        let all = caller.visible_owners();
        let mut queued = list(Status::Queued, all, Order::OLDEST_FIRST, MOST_LISTED)
            .await?
            .items;
        // of all owners: they share the workers
        let running = list(
            Status::Running,
            Owners::All,
            Order::OLDEST_FIRST,
            MOST_LISTED,
        )
        .await?
        .items;
        let ended = list(Status::Succeeded, Owners::All, newest_end, MOST_ENDED)
            .await?
            .items;
        let state = state(service, caller);
        let mean = mean(ended.iter().filter_map(|job| job.run_s));
        let now = Time::now();
        let rest = |job: &Job| {
            let told = job.progress.as_ref().and_then(|progress| progress.eta_s);
            let ran = job.started_at.map_or(0.0, |start| start.seconds_until(now));
            Some(told.unwrap_or(rest_of(ran, mean?)))
        };
        let rests: Vec<f64> = running.iter().filter_map(rest).collect();
        queued.sort_by_key(|job| job.queue.as_ref().map_or(i64::MAX, |queue| queue.position));
        let mut starts = mean.map(|mean| starts(&rests, state.workers, mean));
        let waiting = queued.into_iter().filter_map(|job| {
            let queue = job.queue?;
            let known = !state.paused && queue.position > 0;
            Some(WaitingJob {
                id: job.id,
                name: job.name,
                owner: job.owner,
                position: queue.position,
                reason: queue.reason,
                starts_in_s: starts
                    .as_mut()
                    .filter(|_| known)
                    .map(|starts| starts(queue.ahead)),
            })
        });
        Ok(Forecast {
            waiting: waiting.take(MOST_WAITING).collect(),
            last_hour: service.queue.last_hour(),
        })
    })
}

/// How long a job still runs that has run for `ran` seconds, where others take `mean` seconds: once it has taken longer, it is
/// of another kind, of which only its own time is known.
fn rest_of(ran: f64, mean: f64) -> f64 {
    if ran < mean { mean - ran } else { ran }
}

/// In how many seconds jobs start, by how many others are before each of them, of which each takes `mean` seconds; to be asked in
/// the order of the queue. `rests`: how long the running jobs still take.
fn starts(rests: &[f64], workers: u32, mean: f64) -> impl FnMut(i64) -> f64 {
    let mut free: Vec<f64> = rests.to_vec();
    free.resize(free.len().max(workers.max(1) as usize), 0.0);
    let mut begun = 0;
    move |ahead| {
        // each in turn takes the worker that is free first
        loop {
            let first = free.iter_mut().min_by(|a, b| a.total_cmp(b));
            let Some(first) = first else { return 0.0 };
            if begun >= ahead {
                return *first;
            }
            *first += mean;
            begun += 1;
        }
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    (count > 0.0).then(|| sum / count)
}

/// Pauses the queue: no more jobs are started until it is resumed, also after a restart. Running jobs continue, and new
/// jobs are accepted.
pub fn pause<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
) -> BoxFuture<'a, Result<QueueState, ApiError>> {
    Box::pin(async move {
        let (service, caller) = (service.clone(), caller.clone());
        detached(async move {
            service.queue.pause().await?;
            Ok(state(&service, &caller))
        })
        .await
    })
}

/// Resumes the queue: jobs are started again.
pub fn resume<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
) -> BoxFuture<'a, Result<QueueState, ApiError>> {
    Box::pin(async move {
        let (service, caller) = (service.clone(), caller.clone());
        detached(async move {
            service.queue.resume().await?;
            Ok(state(&service, &caller))
        })
        .await
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_that_outran_the_others_is_expected_to_take_as_long_again() {
        assert_eq!((rest_of(0.1, 0.25), rest_of(7.0, 0.25)), (0.15, 7.0));
        // two workers, busy for 7 s and 1 s: the second takes the next three
        let two = |rests| (0..6).map(starts(rests, 2, 2.0)).collect::<Vec<f64>>();
        assert_eq!(two(&[7.0, 1.0]), [1.0, 3.0, 5.0, 7.0, 7.0, 9.0]);
        // an idle worker takes the next at once
        assert_eq!(two(&[7.0])[..2], [0.0, 2.0]);
    }
}
