//! Operations that wait for a job to change or to end, and that stream its events.

use std::{sync::Arc, time::Duration};

use async_stream::try_stream;
use base::{
    caller::Caller,
    event::StoredEvent,
    job::{Job, JobId},
    values::{Integers, Seconds, Words},
};
use futures_util::Stream;
use futures_util::future::BoxFuture;
use tokio::time::{Instant, sleep_until, timeout_at};

use super::{jobs, service::Service};
use crate::{error::ApiError, parameters::Parameter, queue::News};

/// The parameter of how long to wait for a job.
pub const WAIT: Parameter<Seconds> = Parameter {
    name: "wait",
    meaning: "Seconds to wait until the job's version differs from If-None-Match or, without that header, from the current version",
    values: Seconds(0.0..=MAX_WAIT_S),
};
/// Longest time that a request may wait for a job, in seconds.
pub const MAX_WAIT_S: f64 = 60.0;

/// The parameter of the condition to wait for.
pub const UNTIL: Parameter<Words<Until>> = Parameter {
    name: "until",
    meaning: "Wait until the job has ended",
    values: Words(|| vec![("terminal", Until::Terminal)]),
};

/// The parameter of the number of the event after which a stream begins.
pub const AFTER_SEQ: Parameter<Integers> = Parameter {
    name: "after_seq",
    meaning: "Number of the last event already received; default 0: all events",
    values: Integers(0..=i64::MAX),
};

/// The number of events that are read before the answer to a watcher begins.
const FIRST_EVENTS: i64 = 64;

/// If one job has many watchers, the pause of each between two reads. It equals the time that the recorder may wait
/// before it commits events, so that events are at most twice as late.
const CROWDED_PAUSE: Duration = Duration::from_millis(50);

/// The condition that a client waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Until {
    /// The job has ended.
    Terminal,
    /// The version of the job differs from this one.
    Changed(i64),
    /// The version of the job has changed since the request, or the job has ended, after which no change will come: for
    /// a client that knows no version.
    NextChange,
}

/// Returns the job once the condition is met, after `seconds`, or when the service stops; and whether the condition is
/// met.
pub fn wait<'a>(
    service: &'a Service,
    caller: &'a Caller,
    id: JobId,
    until: Until,
    seconds: f64,
) -> BoxFuture<'a, Result<(Job, bool), ApiError>> {
    Box::pin(async move {
        let end = Instant::now() + Duration::from_secs_f64(seconds.clamp(0.0, MAX_WAIT_S));
        let at_arrival = jobs::get(service, caller, id).await?;
        let mut subscription = service.queue.subscribe(at_arrival.key);
        loop {
            // some at a time: thousands may wait for the same job
            let turn = service.queue.turn().await;
            // read after subscribing, so that a change in between is not missed
            let job = jobs::get(service, caller, id).await?;
            let has_ended = job.status.is_terminal();
            let met = match until {
                Until::Terminal => has_ended,
                Until::Changed(version) => job.version != version,
                Until::NextChange => has_ended || job.version != at_arrival.version,
            };
            if met {
                return Ok((job, true));
            }
            drop(turn);
            tokio::select! {
                change = timeout_at(end, subscription.job_changed()) => if change.is_err() { return Ok((job, false)) },
                () = service.queue.stopping().cancelled() => return Ok((job, false)),
            }
        }
    })
}

/// Streams the stored events after number `after`, then live ones; the stream ends after `done`, or when the job ends
/// if `after` is beyond that. `None`: the job has ended, and there are no events after that number. When the service
/// stops, or the job is deleted before it ends, the stream ends with an error, so that it is not mistaken for the end
/// of the job.
pub async fn watch(
    service: &Arc<Service>,
    caller: &Caller,
    id: JobId,
    after: i64,
) -> Result<Option<impl Stream<Item = Result<Arc<StoredEvent>, ApiError>> + Send + use<>>, ApiError>
{
    let job = jobs::get(service, caller, id).await?;
    // read before the answer begins, which then is an error if they are damaged
    let first = service.store.events_after(job.key, after, FIRST_EVENTS);
    let first = first.await?;
    if job.status.is_terminal() && first.is_empty() {
        return Ok(None);
    }
    if !job.status.is_terminal() {
        service.accepting()?; // it would end at once
    }
    Ok(Some(follow(service.clone(), (id, job.key), after, first)))
}

fn follow(
    service: Arc<Service>,
    (id, key): (JobId, i64),
    after: i64,
    first: Vec<StoredEvent>,
) -> impl Stream<Item = Result<Arc<StoredEvent>, ApiError>> + Send {
    try_stream! {
        let mut cursor = after;
        for event in first {
            cursor = event.seq;
            let done = event.is_done();
            yield Arc::new(event);
            if done {
                return;
            }
        }
        let mut subscription = service.queue.subscribe(key);
        loop {
            let News { events, ended } = subscription.news(&service.store, cursor).await?;
            let (read, idle) = (Instant::now(), events.is_empty());
            for event in events {
                cursor = event.seq;
                let done = event.is_done();
                yield event;
                if done {
                    return;
                }
            }
            // deleted: `done` cannot be read any more
            let ended = ended.ok_or(ApiError::Deleted(id))?;
            if idle && ended {
                return;
            }
            if service.queue.stopping().is_cancelled() {
                Err(ApiError::Draining)?;
            }
            if idle {
                tokio::select! {
                    () = subscription.changed() => {}
                    () = service.queue.stopping().cancelled() => {}
                }
                if subscription.is_crowded() {
                    sleep_until(read + CROWDED_PAUSE).await;
                }
            }
        }
    }
}
