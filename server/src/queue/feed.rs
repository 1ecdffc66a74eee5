//! The events of a job, read from the store once for all of its watchers.
//!
//! Events reach watchers only from committed rows; what is shared here is such rows. Without it two hundred watchers
//! would read two hundred times, and the solver would wait for the processor.

use std::{collections::VecDeque, sync::Arc};

use tokio::sync::Mutex;

use crate::{
    event::Event,
    store::{self, Store},
};

/// Events that are read at a time, and the most that are kept for other watchers.
const MOST: i64 = 256;

/// What a watcher has not seen yet.
#[derive(Debug)]
pub struct News {
    /// The next events, in order; some at a time.
    pub events: Vec<Arc<Event>>,
    /// Whether the job had ended before these events were read; `None`: it is deleted.
    pub ended: Option<bool>,
}

/// The latest events of a job.
#[derive(Debug, Default)]
pub(super) struct Feed {
    /// Held while the store is read, so that other watchers wait for what is read.
    latest: Mutex<Latest>,
}

#[derive(Debug, Default)]
struct Latest {
    /// Without gaps, the last of them is event number `last`.
    events: VecDeque<Arc<Event>>,
    last: i64,
    /// The number of announcements when the store was read; `None`: never, or there was more to read.
    complete_at: Option<u64>,
    ended: Option<bool>,
}

impl Feed {
    /// Events after number `after`. `announced`: how many changes of the job the watcher knows of. `others`: whether
    /// events are kept for others.
    pub(super) async fn news(
        &self,
        store: &Store,
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

/// The end first: if the job had ended, all its events are there.
async fn read(store: &Store, key: i64, after: i64) -> store::Result<News> {
    let ended = store.has_ended(key).await?;
    let events = store.events_after(key, after, MOST).await?;
    Ok(News {
        events: events.into_iter().map(Arc::new).collect(),
        ended,
    })
}

impl Latest {
    /// The news for a watcher, if they need not be read.
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

    /// Adds what was read after event number `after`, which no watcher of this feed had read.
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
    use crate::{event::Payload, job::Status, time::Time};

    fn news(seq: std::ops::RangeInclusive<i64>) -> News {
        let event = |seq| {
            Arc::new(Event {
                seq,
                attempt: 1,
                t: Time::from_micros(0),
                payload: Payload::status(Status::Running),
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
    fn what_one_watcher_has_read_the_others_know() {
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

    /// Clients name any number.
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
    fn a_watcher_that_resumes_ahead_of_the_others_begins_anew() {
        let mut latest = Latest::default();
        latest.add(&news(1..=3), 1, 0);
        latest.add(&news(8..=9), 1, 7);
        assert_eq!(known(&latest, 1, 7).unwrap(), [8, 9]);
        assert_eq!(known(&latest, 1, 3), None);
    }
}
