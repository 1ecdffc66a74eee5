//! The watchers of a job are notified of changes, without their content: they read the store.

use std::{
    collections::HashMap,
    sync::{Mutex, MutexGuard, PoisonError},
};

use tokio::sync::watch;

/// The jobs that are watched.
#[derive(Debug, Default)]
pub(super) struct Watchers {
    watched: Mutex<HashMap<i64, watch::Sender<()>>>,
}

impl Watchers {
    /// Notifies the watchers of a job that there is something new in the store.
    pub(super) fn announce(&self, key: i64) {
        if let Some(sender) = self.watched().get(&key) {
            sender.send_replace(());
        }
    }

    /// Subscribes to the announcements about a job.
    pub(super) fn subscribe(&self, key: i64) -> Subscription<'_> {
        let receiver = self
            .watched()
            .entry(key)
            .or_insert_with(|| watch::channel(()).0)
            .subscribe();
        Subscription {
            watchers: self,
            key,
            receiver,
        }
    }

    fn watched(&self) -> MutexGuard<'_, HashMap<i64, watch::Sender<()>>> {
        self.watched.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A subscription to the announcements about one job.
#[derive(Debug)]
pub struct Subscription<'a> {
    watchers: &'a Watchers,
    key: i64,
    receiver: watch::Receiver<()>,
}

impl Subscription<'_> {
    /// Returns when a change was announced since the subscription or the last call.
    pub async fn changed(&mut self) {
        // an error would mean that the sender is gone, but it lives as long as this subscription
        let _ = self.receiver.changed().await;
    }
}

impl Drop for Subscription<'_> {
    fn drop(&mut self) {
        let mut watched = self.watchers.watched();
        // the lock keeps others from subscribing meanwhile: the only receiver left is this one
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
    async fn an_announcement_between_subscribing_and_waiting_is_received() {
        let watchers = Watchers::default();
        let mut subscription = watchers.subscribe(7);
        watchers.announce(7);
        subscription.changed().await;
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
