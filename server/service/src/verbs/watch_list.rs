//! The operation that streams the changes of a list of jobs: jobs that are accepted, changed or removed, their progress, rows
//! of sweeps, counts and the queue.

use std::{collections::BTreeSet, sync::Arc, time::Duration};

use async_stream::try_stream;
use base::{
    caller::Caller,
    job::{Job, JobId},
    sweep::Sweep,
    values::Text,
};
use futures_util::Stream;
use schemars::JsonSchema;
use serde::Serialize;
use store::{Changed, Filter, GroupBy, Recent};
use strum::IntoStaticStr;
use tokio::time::{Instant, sleep, sleep_until, timeout_at};

use super::{
    lists::Count,
    queue::{self, QueueState},
    service::{Service, detached},
};
use crate::{error::ApiError, parameters::Parameter};

/// The id after which a stream goes on.
pub const AFTER: Parameter<Text> = Parameter {
    name: "after",
    meaning: "The id of the last event received; without it the stream begins with the present counts and queue",
    values: Text,
};

/// The shortest time between two readings of changed jobs.
const PAUSE: Duration = Duration::from_millis(100);
/// The shortest time between two readings of the progress of jobs: each job is told twice a second at most.
const PROGRESS_PAUSE: Duration = Duration::from_millis(500);
/// The shortest time between two counts, which also take at most one part in this many of the time.
const COUNT_PAUSE: Duration = Duration::from_secs(1);
const COUNT_PART: u32 = 10;
/// Of more jobs than this that have changed at once, the client reads the list again.
const MOST_JOBS: usize = 500;

/// An event of a list.
#[derive(Debug)]
pub struct ListEvent {
    /// The id after which a stream goes on; `None` for an event before the last of those that belong together.
    pub id: Option<String>,
    /// What has happened.
    pub payload: ListPayload,
}

/// What has happened in a list.
#[derive(Debug, Serialize, JsonSchema, IntoStaticStr)]
#[serde(tag = "type", rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum ListPayload {
    /// What has happened before is not known any more, or is too much to be told: the list is to be read again.
    Reset {},
    /// A job of the list was accepted, has changed or has made progress.
    Job {
        /// The job.
        job: Box<Job>,
    },
    /// A job has changed that does not belong to the list, or not any more, or was deleted.
    Removed {
        /// The job.
        id: JobId,
    },
    /// A sweep has changed, or has more rows.
    Sweep {
        /// The sweep.
        sweep: Box<Sweep>,
    },
    /// The number of jobs of each status, of those that match the filters, whatever their status.
    Counts {
        /// The numbers.
        counts: Count,
    },
    /// The state of the queue.
    Queue {
        /// The state.
        queue: QueueState,
    },
}

/// Streams what happens to the jobs that match a filter, from the event with the id `after` on, and to the sweeps of the
/// caller. When the service stops the stream ends with an error.
pub fn watch(
    service: &Arc<Service>,
    caller: &Caller,
    filter: Filter,
    after: Option<String>,
) -> Result<impl Stream<Item = Result<ListEvent, ApiError>> + Send + use<>, ApiError> {
    service.accepting()?;
    // what happens from now on is told, however late the stream is read
    let start = service.store.changes().last();
    Ok(follow(
        Watch {
            service: service.clone(),
            caller: caller.clone(),
            filter,
            counted: None,
            next_count: Instant::now(),
        },
        after,
        start,
    ))
}

fn follow(
    mut watch: Watch,
    after: Option<String>,
    start: u64,
) -> impl Stream<Item = Result<ListEvent, ApiError>> + Send {
    try_stream! {
        let service = watch.service.clone();
        let changes = service.store.changes();
        let mut noted = changes.subscribe();
        let resumed = after.as_deref().map(|id| watch.number(id).filter(|number| changes.after(*number).is_some()));
        // a client that asks for an event of another process, or of long ago, has missed something
        let mut reset = resumed == Some(None);
        let mut cursor = resumed.flatten().unwrap_or(start);
        let mut progressed: BTreeSet<i64> = BTreeSet::new();
        let mut next_progress = Instant::now();
        let (mut uncounted, mut queue) = (true, None);
        loop {
            noted.mark_unchanged();
            let mut told = vec![];
            let recent = changes.after(cursor).unwrap_or_else(|| {
                reset = true;
                Recent { changed: BTreeSet::new(), last: changes.last() }
            });
            cursor = recent.last;
            let mut changed = BTreeSet::new();
            let mut sweeps = BTreeSet::new();
            for change in recent.changed {
                match change {
                    Changed::Job(key) => drop(changed.insert(key)),
                    Changed::Progress(key) => drop(progressed.insert(key)),
                    Changed::Sweep(key) => drop(sweeps.insert(key)),
                    Changed::Queue => {}
                }
            }
            let moved = !changed.is_empty();
            if reset || changed.len() > MOST_JOBS {
                told.push(ListPayload::Reset {});
                (reset, changed) = (false, BTreeSet::new());
                progressed.clear();
            }
            let now = Instant::now();
            let asked = if now >= next_progress && !progressed.is_empty() {
                next_progress = now + PROGRESS_PAUSE;
                std::mem::take(&mut progressed)
            } else {
                BTreeSet::new()
            };
            told.extend(watch.jobs(changed, asked).await?);
            told.extend(watch.sweeps(sweeps).await?);
            let state = queue::state(&service, &watch.caller);
            if queue.as_ref() != Some(&state) {
                queue = Some(state.clone());
                told.push(ListPayload::Queue { queue: state });
            }
            uncounted |= moved;
            if let Some(counts) = watch.counts(uncounted).await? {
                uncounted = false;
                told.extend(counts);
            }
            let last = told.len();
            for (place, payload) in (1..).zip(told) {
                let id = (place == last).then(|| watch.id(cursor));
                yield ListEvent { id, payload };
            }
            if service.queue.stopping().is_cancelled() {
                Err(ApiError::Draining)?;
            }
            sleep(PAUSE).await;
            // what was put off, and what the queue does without a commit, are looked at from time to time
            let latest = match (progressed.is_empty(), uncounted) {
                (false, _) => next_progress,
                (true, true) => watch.next_count,
                (true, false) => now + 2 * COUNT_PAUSE,
            };
            tokio::select! {
                _ = timeout_at(latest, noted.changed()) => {}
                () = service.queue.stopping().cancelled() => {}
            }
            if changes.after(cursor).is_some_and(|more| more.changed.iter().all(|change| matches!(change, Changed::Progress(_)))) {
                sleep_until(next_progress.min(Instant::now() + PROGRESS_PAUSE)).await;
            }
        }
    }
}

/// A stream of a list.
struct Watch {
    service: Arc<Service>,
    caller: Caller,
    filter: Filter,
    /// The counts that were told last.
    counted: Option<Count>,
    /// When the jobs may be counted next.
    next_count: Instant,
}

impl Watch {
    /// The id of an event.
    fn id(&self, number: u64) -> String {
        format!("{}-{number}", self.service.run)
    }

    /// The number of the event with this id; `None` if it is of another process, or no id.
    fn number(&self, id: &str) -> Option<u64> {
        let (run, number) = id.rsplit_once('-')?;
        number.parse().ok().filter(|_| run == self.service.run)
    }

    /// What has become of these jobs. Of those that have only made progress nothing is told if they are not in the list.
    async fn jobs(
        &self,
        changed: BTreeSet<i64>,
        progressed: BTreeSet<i64>,
    ) -> Result<Vec<ListPayload>, ApiError> {
        if changed.is_empty() && progressed.is_empty() {
            return Ok(vec![]);
        }
        let (service, filter) = (self.service.clone(), self.filter.clone());
        let owners = self.caller.visible_owners();
        // in a task of its own: a client that does not read may stop this stream at any point
        let read = detached(async move {
            let keys: Vec<i64> = changed.union(&progressed).copied().collect();
            let store = &service.store;
            let jobs = store.jobs_with_keys(owners.clone(), &filter, keys).await?;
            let there: BTreeSet<i64> = jobs.iter().map(|job| job.key).collect();
            let gone: Vec<i64> = changed.difference(&there).copied().collect();
            let gone = store.ids_of(owners, gone).await?;
            let jobs = jobs
                .into_iter()
                .map(|job| ListPayload::Job { job: Box::new(job) });
            let gone = gone.into_iter().map(|id| ListPayload::Removed { id });
            Ok(jobs.chain(gone).collect())
        });
        read.await
    }

    /// The sweeps with these keys that the caller may see.
    async fn sweeps(&self, keys: BTreeSet<i64>) -> Result<Vec<ListPayload>, ApiError> {
        if keys.is_empty() {
            return Ok(vec![]);
        }
        let (store, owners) = (self.service.store.clone(), self.caller.visible_owners());
        let read = detached(async move {
            let keys = keys.into_iter().take(MOST_JOBS).collect();
            let sweeps = store.sweeps_with_keys(owners, keys).await?;
            let told = sweeps.into_iter();
            Ok(told
                .map(|sweep| ListPayload::Sweep {
                    sweep: Box::new(sweep),
                })
                .collect())
        });
        read.await
    }

    /// The counts, if they have changed; the outer `None`: it is not time to count.
    async fn counts(&mut self, due: bool) -> Result<Option<Option<ListPayload>>, ApiError> {
        let start = Instant::now();
        if !due || start < self.next_count {
            return Ok(None);
        }
        let (store, owners) = (self.service.store.clone(), self.caller.visible_owners());
        let filter = Filter {
            statuses: vec![],
            ..self.filter.clone()
        };
        let groups =
            detached(async move { Ok(store.count(owners, &filter, Some(GroupBy::Status)).await?) });
        let groups = groups.await?;
        self.next_count = Instant::now() + COUNT_PAUSE.max(start.elapsed() * COUNT_PART);
        let counts = Count {
            total: groups.iter().map(|(_, jobs)| jobs).sum(),
            groups: groups.into_iter().collect(),
        };
        if self.counted.as_ref() == Some(&counts) {
            return Ok(Some(None));
        }
        self.counted = Some(counts.clone());
        Ok(Some(Some(ListPayload::Counts { counts })))
    }
}

impl ListPayload {
    /// The word for the kind of event: the value of `type` in JSON.
    pub fn kind(&self) -> &'static str {
        self.into()
    }
}
