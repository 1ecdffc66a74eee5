//! The queue in memory: which jobs wait, in the order in which they are taken. A mirror of the index
//! `job_queue`, so that a job's place and the length of the queue cost no scan, however many wait.

/// Priorities are −10 … 10.
const PRIORITIES: usize = 21;

/// Waiting jobs by their keys, for each priority in order of arrival, the highest priority first.
#[derive(Debug, Default)]
pub(super) struct Line {
    rows: [Vec<i64>; PRIORITIES],
    /// Jobs that wait for another one's end.
    joined: usize,
}

/// A job that enters or leaves the line when its transaction is committed.
#[derive(Clone, Copy, Debug)]
pub(super) enum Move {
    Enter {
        priority: i32,
        key: i64,
    },
    Leave {
        priority: i32,
        key: i64,
    },
    /// A job waits for the end of another.
    Join,
    /// It does so no longer.
    Part,
}

impl Line {
    /// Makes a move; one that was made already changes nothing.
    pub(super) fn make(&mut self, step: Move) {
        match step {
            Move::Enter { priority, key } => {
                let row = &mut self.rows[rank(priority)];
                if let Err(place) = row.binary_search(&key) {
                    row.insert(place, key);
                }
            }
            Move::Leave { priority, key } => {
                let row = &mut self.rows[rank(priority)];
                if let Ok(place) = row.binary_search(&key) {
                    row.remove(place);
                }
            }
            Move::Join => self.joined += 1,
            Move::Part => self.joined = self.joined.saturating_sub(1),
        }
    }

    /// Jobs ahead of this one; none if it does not wait.
    pub(super) fn ahead(&self, priority: i32, key: i64) -> Option<usize> {
        let rank = rank(priority);
        let here = self.rows[rank].binary_search(&key).ok()?;
        Some(here + self.rows[..rank].iter().map(Vec::len).sum::<usize>())
    }

    /// How many wait, in line or for another job.
    pub(super) fn len(&self) -> usize {
        self.joined + self.rows.iter().map(Vec::len).sum::<usize>()
    }
}

fn rank(priority: i32) -> usize {
    (10 - priority.clamp(-10, 10)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_higher_priority_goes_first_and_then_who_came_first() {
        let mut line = Line::default();
        for (priority, key) in [(0, 1), (0, 2), (5, 3), (-10, 4), (0, 5)] {
            line.make(Move::Enter { priority, key });
            line.make(Move::Enter { priority, key });
        }
        let places = [(5, 3), (0, 1), (0, 2), (0, 5), (-10, 4)];
        for (ahead, (priority, key)) in places.into_iter().enumerate() {
            assert_eq!(line.ahead(priority, key), Some(ahead));
        }
        let (priority, key) = (0, 1);
        line.make(Move::Leave { priority, key });
        line.make(Move::Leave { priority, key });
        assert_eq!(line.ahead(0, 1), None);
        assert_eq!(line.ahead(0, 5), Some(2));
        assert_eq!(line.len(), 4);
    }
}
