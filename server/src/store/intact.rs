//! What was found intact: content that was read whole and found as it was written, since the store was opened.

use std::{
    collections::HashSet,
    sync::{Mutex, PoisonError},
};

/// The numbers of such content: what answers other jobs is checked once. Numbers are never used again. The older half is
/// forgotten when there are many.
#[derive(Debug, Default)]
pub(super) struct Intact(Mutex<[HashSet<i64>; 2]>);

impl Intact {
    const MOST: usize = 10_000;

    pub(super) fn contains(&self, content: i64) -> bool {
        let halves = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        halves.iter().any(|half| half.contains(&content))
    }

    pub(super) fn insert(&self, content: i64) {
        let mut halves = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if halves[0].len() >= Self::MOST {
            halves.swap(0, 1);
            halves[0].clear();
        }
        halves[0].insert(content);
    }
}
