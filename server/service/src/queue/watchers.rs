//! Notifies the watchers of a job of changes, but not of the content of changes: watchers read that from the store,
//! together (see `feed`).

use parking_lot::{Mutex, MutexGuard};
use std::{collections::HashMap, sync::Arc};

use store::{Store, StoreError};
use tokio::sync::watch;

use super::feed::{Feed, News};

/// If one job has more watchers than this number, each of them reads less often.
const CROWD: usize = 16;

/// The jobs or sweeps that are watched, by key.
#[derive(Debug, Default)]
pub(super) struct Watchers {
    watched: Mutex<HashMap<i64, Arc<Watched>>>,
}

/// A job or sweep that is watched.
#[derive(Debug)]
struct Watched {
    changes: watch::Sender<Changes>,
    feed: Feed,
}

/// How many changes of a watched job were announced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Changes {
    /// Changes of any kind.
    all: u64,
    /// Changes of the job itself, without new events.
    of_job: u64,
}

impl Watchers {
    /// Notifies the watchers of a job that it has changed.
    pub(super) fn announce(&self, key: i64) {
        self.change(key, |changes| changes.of_job += 1);
    }

    /// Notifies the watchers of a job that it has new events but is otherwise unchanged.
    pub(super) fn announce_events(&self, key: i64) {
        self.change(key, |_| {});
    }

    fn change(&self, key: i64, change: impl FnOnce(&mut Changes)) {
        if let Some(watched) = self.watched().get(&key) {
            watched.changes.send_modify(|changes| {
                changes.all += 1;
                change(changes);
            });
        }
    }

    /// Subscribes to the announcements about a job.
    pub(super) fn subscribe(&self, key: i64) -> Subscription<'_> {
        let mut all = self.watched();
        let watched = all.entry(key).or_insert_with(|| {
            Arc::new(Watched {
                changes: watch::channel(Changes::default()).0,
                feed: Feed::default(),
            })
        });
        let receiver = watched.changes.subscribe();
        let seen = receiver.borrow().of_job;
        Subscription {
            watchers: self,
            key,
            receiver,
            watched: watched.clone(),
            seen,
        }
    }

    fn watched(&self) -> MutexGuard<'_, HashMap<i64, Arc<Watched>>> {
        self.watched.lock()
    }
}

/// A subscription to the announcements about one job.
#[derive(Debug)]
pub struct Subscription<'a> {
    watchers: &'a Watchers,
    key: i64,
    watched: Arc<Watched>,
    receiver: watch::Receiver<Changes>,
    /// The number of changes of the job itself that were announced before the subscription, or that `job_changed` has
    /// returned for.
    seen: u64,
}

impl Subscription<'_> {
    /// Waits until anything was announced since the subscription or the last call.
    pub async fn changed(&mut self) {
        // an error would mean that the sender is gone, but it lives as long as this subscription
        let _ = self.receiver.changed().await;
    }

    /// Waits until a change of the job itself was announced since the subscription or the last call.
    pub async fn job_changed(&mut self) {
        let seen = self.seen;
        let changed = self.receiver.wait_for(|changes| changes.of_job != seen);
        // an error would mean that the sender is gone, but it lives as long as this subscription
        if let Ok(changes) = changed.await.map(|changes| *changes) {
            self.seen = changes.of_job;
        }
    }

    /// The job's events after number `after`, and whether the job has ended. All watchers of a job share what one of
    /// them reads. The reading is done in a task of its own: a client that does not read blocks its stream at any
    /// point, and would block the others if it held the lock that they wait for.
    pub async fn news(&mut self, store: &Arc<Store>, after: i64) -> store::Result<News> {
        let announced = self.receiver.borrow_and_update().all;
        let others = self.receiver_count() > 1;
        let (store, watched, key) = (store.clone(), self.watched.clone(), self.key);
        let reading = tokio::spawn(async move {
            let feed = &watched.feed;
            feed.news(&store, key, announced, after, others).await
        });
        let read = reading.await;
        read.unwrap_or_else(|panic| Err(StoreError::Unexpected(panic.to_string())))
    }

    /// Whether this job has so many watchers that each should read less often.
    pub fn is_crowded(&self) -> bool {
        self.receiver_count() > CROWD
    }

    fn receiver_count(&self) -> usize {
        self.watched.changes.receiver_count()
    }
}

impl Drop for Subscription<'_> {
    fn drop(&mut self) {
        let mut watched = self.watchers.watched();
        // the lock keeps others from subscribing meanwhile: the only receiver left is this one
        if self.receiver_count() <= 1 {
            watched.remove(&self.key);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tokio::time::timeout;

    use super::*;

    #[tokio::test]
    async fn an_announcement_between_subscribing_and_waiting_is_received() {
        let watchers = Watchers::default();
        let mut subscription = watchers.subscribe(7);
        watchers.announce(7);
        subscription.changed().await;
        subscription.job_changed().await;
        watchers.announce(7);
        subscription.job_changed().await;
    }

    #[tokio::test(start_paused = true)]
    async fn a_request_that_waits_for_a_change_is_not_notified_of_events() {
        let watchers = Watchers::default();
        let mut subscription = watchers.subscribe(7);
        let wait = Duration::from_secs(1);
        let changed = async {
            watchers.announce_events(7);
            timeout(wait, subscription.job_changed()).await
        };
        assert!(changed.await.is_err());
        let (changed, ()) = tokio::join!(subscription.job_changed(), async {
            watchers.announce(7);
        });
        changed
    }

    #[test]
    fn nothing_is_kept_for_a_job_without_watchers() {
        let watchers = Watchers::default();
        let (one, two) = (watchers.subscribe(7), watchers.subscribe(7));
        drop(one);
        assert_eq!(watchers.watched().len(), 1);
        drop(two);
        assert!(watchers.watched().is_empty());
    }
}
