//! The jobs that wait, in memory and in the order in which they will be started: a mirror of the index
//! `job_queue`, so that neither a job's position nor the length of the queue costs a scan, however many wait.

use crate::job::{MAX_PRIORITY, MIN_PRIORITY};

/// How many priorities there are.
const PRIORITIES: usize = (MAX_PRIORITY - MIN_PRIORITY + 1) as usize;

/// Waiting jobs by their keys, for each priority in order of arrival, the highest priority first.
#[derive(Debug, Default)]
pub(super) struct WaitingJobs {
    rows: [Vec<i64>; PRIORITIES],
    /// Jobs coalesced into others: they wait, but will not be started.
    coalesced: usize,
}

/// What a transaction changes about the jobs that wait; applied when it is committed.
#[derive(Clone, Copy, Debug)]
pub(super) enum Move {
    /// A job waits for a worker.
    Enter { priority: i32, key: i64 },
    /// It does so no longer.
    Leave { priority: i32, key: i64 },
    /// A job is coalesced into another.
    Attach,
    /// It is so no longer.
    Detach,
}

impl WaitingJobs {
    /// Applies a move. To enter twice, or to leave twice, changes nothing.
    pub(super) fn apply(&mut self, change: Move) {
        match change {
            Move::Enter { priority, key } => {
                let row = &mut self.rows[rank(priority)];
                if let Err(index) = row.binary_search(&key) {
                    row.insert(index, key);
                }
            }
            Move::Leave { priority, key } => {
                let row = &mut self.rows[rank(priority)];
                if let Ok(index) = row.binary_search(&key) {
                    row.remove(index);
                }
            }
            Move::Attach => self.coalesced += 1,
            Move::Detach => self.coalesced = self.coalesced.saturating_sub(1),
        }
    }

    /// Jobs ahead of this one; none if it does not wait.
    pub(super) fn ahead(&self, priority: i32, key: i64) -> Option<usize> {
        let rank = rank(priority);
        let here = self.rows[rank].binary_search(&key).ok()?;
        Some(here + self.rows[..rank].iter().map(Vec::len).sum::<usize>())
    }

    /// How many wait, those that are coalesced among them.
    pub(super) fn len(&self) -> usize {
        self.coalesced + self.rows.iter().map(Vec::len).sum::<usize>()
    }
}

fn rank(priority: i32) -> usize {
    (MAX_PRIORITY - priority.clamp(MIN_PRIORITY, MAX_PRIORITY)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_higher_priority_goes_first_and_then_the_earlier_arrival() {
        let mut waiting = WaitingJobs::default();
        for (priority, key) in [(0, 1), (0, 2), (5, 3), (-10, 4), (0, 5)] {
            waiting.apply(Move::Enter { priority, key });
            waiting.apply(Move::Enter { priority, key });
        }
        let order = [(5, 3), (0, 1), (0, 2), (0, 5), (-10, 4)];
        for (ahead, (priority, key)) in order.into_iter().enumerate() {
            assert_eq!(waiting.ahead(priority, key), Some(ahead));
        }
        let (priority, key) = (0, 1);
        waiting.apply(Move::Leave { priority, key });
        waiting.apply(Move::Leave { priority, key });
        assert_eq!(waiting.ahead(0, 1), None);
        assert_eq!(waiting.ahead(0, 5), Some(2));
        assert_eq!(waiting.len(), 4);
    }
}
