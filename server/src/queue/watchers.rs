//! How watchers learn that there is something new to read. They are not told what: they read the store.

use std::{
    collections::HashMap,
    sync::{Mutex, MutexGuard, PoisonError},
};

use tokio::sync::watch;

/// The jobs that somebody watches.
#[derive(Debug, Default)]
pub(super) struct Live {
    watched: Mutex<HashMap<i64, watch::Sender<()>>>,
}

impl Live {
    /// Says that something new about a job is on the disk.
    pub(super) fn announce(&self, key: i64) {
        if let Some(sender) = self.watched().get(&key) {
            sender.send_replace(());
        }
    }

    pub(super) fn subscribe(&self, key: i64) -> Subscription<'_> {
        let receiver = self
            .watched()
            .entry(key)
            .or_insert_with(|| watch::channel(()).0)
            .subscribe();
        Subscription {
            live: self,
            key,
            receiver,
        }
    }

    fn watched(&self) -> MutexGuard<'_, HashMap<i64, watch::Sender<()>>> {
        self.watched.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// One watcher's ear.
#[derive(Debug)]
pub struct Subscription<'a> {
    live: &'a Live,
    key: i64,
    receiver: watch::Receiver<()>,
}

impl Subscription<'_> {
    /// Returns when something was announced since the subscription or the last call.
    pub async fn news(&mut self) {
        // An error means that the sender is gone; it lives as long as we listen.
        let _ = self.receiver.changed().await;
    }
}

impl Drop for Subscription<'_> {
    fn drop(&mut self) {
        let mut watched = self.live.watched();
        // Under the lock nobody subscribes in between: the one receiver left is our own.
        if watched
            .get(&self.key)
            .is_some_and(|sender| sender.receiver_count() <= 1)
        {
            watched.remove(&self.key);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn an_announcement_between_subscribing_and_listening_is_heard() {
        let live = Live::default();
        let mut subscription = live.subscribe(7);
        live.announce(7);
        subscription.news().await;
    }

    #[test]
    fn nothing_is_kept_for_a_job_that_nobody_watches() {
        let live = Live::default();
        let (one, two) = (live.subscribe(7), live.subscribe(7));
        drop(one);
        assert_eq!(live.watched().len(), 1);
        drop(two);
        assert!(live.watched().is_empty());
    }
}
