//! The events of a job, read from the store once for all of its watchers.
//!
//! Watchers receive events only from committed rows, which are read here for all of them. Otherwise two hundred
//! watchers would read the rows two hundred times, and the solver would wait for the processor.

use std::{collections::VecDeque, sync::Arc};

use base::event::StoredEvent;
use store::Store;
use tokio::sync::Mutex;

/// The largest number of events that are read at a time, and that are kept for other watchers.
const MOST: i64 = 256;

/// The events that a watcher has not seen yet.
#[derive(Debug)]
pub struct News {
    /// The next events in order, up to a limit.
    pub events: Vec<Arc<StoredEvent>>,
    /// Whether the job had ended before these events were read; `None`: the job is deleted.
    pub ended: Option<bool>,
}

/// The latest events of a job.
#[derive(Debug, Default)]
pub(super) struct Feed {
    /// The kept events; locked while the store is read, so that other watchers wait for the result of reading.
    latest: Mutex<Latest>,
}

#[derive(Debug, Default)]
struct Latest {
    /// The latest consecutive events; the last of them has number `last`.
    events: VecDeque<Arc<StoredEvent>>,
    last: i64,
    /// The number of announcements before the last reading of the store; `None`: the store was never read, or has more
    /// events than were read.
    complete_at: Option<u64>,
    ended: Option<bool>,
}

impl Feed {
    /// Returns the events of a job after number `after`. `announced`: the number of changes of the job that were
    /// announced before this call. `others`: whether other watchers need the events, which are then kept for them.
    pub(super) async fn news(
        &self,
        store: &Arc<Store>,
        key: i64,
        announced: u64,
        after: i64,
        others: bool,
    ) -> store::Result<News> {
        let mut latest = self.latest.lock().await;
        if let Some(news) = latest.known(announced, after) {
            return Ok(news);
        }
        let behind = after < latest.last;
        if behind {
            // a late watcher: what it needs is of no use to the others, which do not wait for it
            drop(latest);
            return read(store, key, after).await;
        }
        let news = read(store, key, after).await?;
        latest.add(&news, announced, after);
        if !others {
            latest.events.clear();
        }
        Ok(news)
    }
}

/// Reads from the store whether a job has ended, and afterwards its events after number `after`: if the job has ended,
/// all of its events are stored when they are read.
async fn read(store: &Arc<Store>, key: i64, after: i64) -> store::Result<News> {
    let ended = store.has_ended(key).await?;
    let events = store.events_after(key, after, MOST).await?;
    Ok(News {
        events: events.into_iter().map(Arc::new).collect(),
        ended,
    })
}

impl Latest {
    /// The events after number `after`, if they are known without reading the store; `announced` as in `Feed::news`.
    fn known(&self, announced: u64, after: i64) -> Option<News> {
        if after == self.last && self.complete_at.is_some_and(|at| at >= announced) {
            return Some(News {
                events: vec![],
                ended: self.ended,
            });
        }
        // the event before those that are kept
        let before = self.last - self.events.len() as i64;
        if after >= self.last {
            return None;
        }
        let skipped = usize::try_from(after.checked_sub(before)?).ok()?;
        Some(News {
            events: self.events.iter().skip(skipped).cloned().collect(),
            // there are events to come after these: the watcher will ask again
            ended: Some(false),
        })
    }

    /// Adds `news`, which was read from the store after event number `after`.
    fn add(&mut self, news: &News, announced: u64, after: i64) {
        if after > self.last {
            self.events.clear();
            self.last = after;
        }
        self.events.extend(news.events.iter().cloned());
        self.last = news.events.last().map_or(self.last, |event| event.seq);
        let excess = self.events.len().saturating_sub(MOST as usize);
        self.events.drain(..excess);
        let complete = (news.events.len() as i64) < MOST;
        self.complete_at = complete.then_some(announced);
        self.ended = news.ended;
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use base::time::Time;

    fn news(seq: std::ops::RangeInclusive<i64>) -> News {
        let event = |seq| {
            Arc::new(StoredEvent {
                seq,
                attempt: 1,
                t: Time::from_micros(0),
                kind: "status".to_owned(),
                payload: r#"{"type":"status","status":"running"}"#.to_owned(),
            })
        };
        News {
            events: seq.map(event).collect(),
            ended: Some(false),
        }
    }

    fn known(latest: &Latest, announced: u64, after: i64) -> Option<Vec<i64>> {
        let news = latest.known(announced, after)?;
        Some(news.events.iter().map(|event| event.seq).collect())
    }

    #[test]
    fn events_read_by_one_watcher_are_shared_with_the_others() {
        let mut latest = Latest::default();
        latest.add(&news(1..=3), 1, 0);
        assert_eq!(known(&latest, 1, 0).unwrap(), [1, 2, 3]);
        assert_eq!(known(&latest, 1, 2).unwrap(), [3]);
        // nothing more, until more is announced
        assert_eq!(known(&latest, 1, 3), Some(vec![]));
        assert_eq!(known(&latest, 2, 3), None);
        latest.add(&news(4..=5), 2, 3);
        assert_eq!(known(&latest, 2, 1).unwrap(), [2, 3, 4, 5]);
    }

    #[test]
    fn a_full_reading_is_not_the_end() {
        let mut latest = Latest::default();
        latest.add(&news(1..=MOST), 1, 0);
        assert_eq!(known(&latest, 1, MOST), None);
        latest.add(&news(MOST + 1..=MOST + 1), 1, MOST);
        assert_eq!(known(&latest, 1, MOST).unwrap(), [MOST + 1]);
        // the first is no longer kept
        assert_eq!(known(&latest, 1, 0), None);
        assert_eq!(known(&latest, 1, 1).unwrap().len() as i64, MOST);
    }

    /// A watcher may resume after any number, since clients choose it.
    #[test]
    fn a_watcher_may_resume_after_any_number() {
        let mut latest = Latest::default();
        latest.add(&news(1..=3), 1, 0);
        assert_eq!(known(&latest, 1, i64::MIN), None);
        assert_eq!(known(&latest, 1, i64::MAX), None);
        let none = News {
            events: vec![],
            ended: Some(false),
        };
        latest.add(&none, 1, i64::MAX);
        assert_eq!(known(&latest, 1, i64::MAX), Some(vec![]));
        assert_eq!(known(&latest, 1, i64::MIN), None);
        assert_eq!(known(&latest, 1, 3), None);
    }

    #[test]
    fn a_watcher_that_resumes_ahead_of_the_others_reads_again() {
        let mut latest = Latest::default();
        latest.add(&news(1..=3), 1, 0);
        latest.add(&news(8..=9), 1, 7);
        assert_eq!(known(&latest, 1, 7).unwrap(), [8, 9]);
        assert_eq!(known(&latest, 1, 3), None);
    }
}
