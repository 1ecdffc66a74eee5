//! The limit on connections: when it is reached, the connection that has been idle for the longest time is closed.

use parking_lot::{Mutex, MutexGuard};
use std::{collections::HashMap, sync::Arc};

use base::metrics::METRICS;

use super::activity::Activity;

/// The number of additional connections when all other slots are busy: for the probes, and for refusing further
/// connections.
const RESERVED: usize = 16;

/// The open connections, and their limit.
#[derive(Debug)]
pub(super) struct Slots {
    most: usize,
    open: Mutex<Open>,
}

#[derive(Debug, Default)]
struct Open {
    last: u64,
    connections: HashMap<u64, Arc<Activity>>,
}

/// The slot of one connection; the slot is free again when this is dropped.
#[derive(Debug)]
pub(super) struct Slot {
    slots: Arc<Slots>,
    number: u64,
    activity: Arc<Activity>,
    reserved: bool,
}

impl Slots {
    /// Slots for `most` connections, and the reserved ones.
    pub(super) fn new(most: usize) -> Arc<Slots> {
        let open = Mutex::default();
        Arc::new(Slots { most, open })
    }

    /// A slot for a new connection; `None` if all are taken, including the reserved ones.
    pub(super) fn take(self: &Arc<Self>) -> Option<Slot> {
        let mut open = self.open();
        let full = open.connections.len() >= self.most;
        let reserved = full && !open.close_longest_idle();
        if open.connections.len() >= self.most + RESERVED {
            return None;
        }
        open.last += 1;
        let (number, activity) = (open.last, Activity::new());
        open.connections.insert(number, activity.clone());
        METRICS.connections.inc();
        METRICS.accepted_connections.inc();
        Some(Slot {
            slots: self.clone(),
            number,
            activity,
            reserved,
        })
    }

    /// Closes the connection that has been without a request for the longest time, if any connection is without one.
    pub(super) fn close_longest_idle(&self) {
        self.open().close_longest_idle();
    }

    fn open(&self) -> MutexGuard<'_, Open> {
        self.open.lock()
    }
}

impl Open {
    fn close_longest_idle(&mut self) -> bool {
        let idle = self.connections.iter();
        let idle = idle.filter_map(|(number, activity)| Some((activity.idle_since()?, *number)));
        let Some((_, number)) = idle.min() else {
            return false;
        };
        if let Some(activity) = self.connections.remove(&number) {
            activity.cut();
        }
        true
    }
}

impl Slot {
    /// The activity of the connection.
    pub(super) fn activity(&self) -> &Arc<Activity> {
        &self.activity
    }

    /// Whether this slot is one of the few for the probes.
    pub(super) fn is_reserved(&self) -> bool {
        self.reserved
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        self.slots.open().connections.remove(&self.number);
        METRICS.connections.dec();
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[tokio::test]
    async fn a_new_connection_takes_the_place_of_the_longest_idle_one() {
        let slots = Slots::new(2);
        let first = slots.take().unwrap();
        let busy = first.activity().begin();
        let second = slots.take().unwrap();
        assert!(!slots.take().unwrap().is_reserved());
        second.activity().is_cut().await;
        drop((second, busy));
    }

    #[test]
    fn busy_connections_keep_their_places_and_the_reserved_ones_are_few() {
        let slots = Slots::new(1);
        let first = slots.take().unwrap();
        let _busy = first.activity().begin();
        let mut reserved = vec![];
        while let Some(slot) = slots.take() {
            assert!(slot.is_reserved());
            reserved.push((slot.activity().begin(), slot));
        }
        assert_eq!(reserved.len(), RESERVED);
        drop((_busy, first));
        assert!(slots.take().is_some());
    }
}
