//! What has changed lately, for those who follow lists of jobs. Every commit notes here which jobs and sweeps it has changed;
//! what they are now is read from the tables. The notes are numbered and kept in memory: only so many of them, and not after
//! a restart. Who asks for older ones is told so, and reads the list again.

use std::collections::{BTreeSet, VecDeque};

use parking_lot::Mutex;
use tokio::sync::watch;

/// The number of notes that are kept.
const MOST: usize = 20_000;

/// Something that has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Changed {
    /// The job with this key was accepted, changed or deleted.
    Job(i64),
    /// The job with this key has made progress.
    Progress(i64),
    /// The sweep with this key has more rows.
    Sweep(i64),
    /// The queue was paused or resumed.
    Queue,
}

/// The notes of recent changes.
#[derive(Debug)]
pub struct Changes {
    notes: Mutex<VecDeque<Changed>>,
    /// The number of the last note.
    last: watch::Sender<u64>,
}

/// What has changed after some note.
#[derive(Debug)]
pub struct Recent {
    /// What has changed, each once.
    pub changed: BTreeSet<Changed>,
    /// The number of the last note that is included.
    pub last: u64,
}

impl Default for Changes {
    fn default() -> Self {
        Changes {
            notes: Mutex::default(),
            last: watch::channel(0).0,
        }
    }
}

impl Changes {
    /// Notes what has changed.
    pub(super) fn note(&self, changed: impl IntoIterator<Item = Changed>) {
        let mut notes = self.notes.lock();
        let before = notes.len();
        notes.extend(changed);
        let more = notes.len() - before;
        if more == 0 {
            return;
        }
        let excess = notes.len().saturating_sub(MOST);
        notes.drain(..excess);
        self.last.send_modify(|last| *last += more as u64);
    }

    /// The number of the last note.
    pub fn last(&self) -> u64 {
        *self.last.borrow()
    }

    /// What has changed after the note with this number; `None` if older notes than those that are kept would be needed, or
    /// there was no such note.
    pub fn after(&self, number: u64) -> Option<Recent> {
        let notes = self.notes.lock();
        let last = self.last();
        let wanted = usize::try_from(last.checked_sub(number)?).ok()?;
        let skipped = notes.len().checked_sub(wanted)?;
        Some(Recent {
            changed: notes.iter().skip(skipped).copied().collect(),
            last,
        })
    }

    /// A receiver of the number of the last note.
    pub fn subscribe(&self) -> watch::Receiver<u64> {
        self.last.subscribe()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn notes_are_numbered_and_old_ones_are_not_made_up() {
        let changes = Changes::default();
        assert!(changes.after(0).unwrap().changed.is_empty());
        assert!(changes.after(1).is_none());
        changes.note([Changed::Job(1), Changed::Progress(2)]);
        changes.note([]);
        changes.note([Changed::Job(1)]);
        assert_eq!(changes.last(), 3);
        let all = changes.after(0).unwrap();
        assert_eq!(all.last, 3);
        assert_eq!(all.changed, [Changed::Job(1), Changed::Progress(2)].into());
        assert_eq!(changes.after(2).unwrap().changed, [Changed::Job(1)].into());
        changes.note((0..MOST as i64).map(Changed::Sweep));
        assert!(changes.after(2).is_none());
        assert_eq!(changes.after(3).unwrap().changed.len(), MOST);
    }
}
