//! The jobs that wait, in memory and in the order in which they will be started, so that neither a job's position nor the
//! length of the queue costs a scan, however many wait.
//!
//! The highest priority goes first. Within a priority owners take turns: the next job is the oldest one of the owner who
//! had their last turn longest ago. So a job of somebody else waits for one job of an owner who has submitted thousands,
//! and not for all of them. Whose turn it was is not stored: after a restart all begin anew, in the order of their jobs.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    sync::Arc,
};

use base::job::{Job, MAX_PRIORITY, MIN_PRIORITY};

/// How many priorities there are.
const PRIORITIES: usize = (MAX_PRIORITY - MIN_PRIORITY + 1) as usize;

/// The name of an owner.
pub(super) type Owner = Arc<str>;

/// Waiting jobs by their keys, and what decides about the next one.
#[derive(Debug, Default)]
pub(super) struct WaitingJobs {
    /// For each priority, the highest first: the jobs of each owner, in order of arrival.
    rows: [BTreeMap<Owner, Vec<i64>>; PRIORITIES],
    /// How many there are.
    count: usize,
    /// Jobs coalesced into others: they wait, but will not be started.
    coalesced: usize,
    /// What each owner has beside the jobs that wait for a worker.
    owners: HashMap<Owner, OwnerState>,
    /// The number of the last turn.
    turn: u64,
}

/// What an owner has beside the jobs that wait for a worker.
#[derive(Clone, Copy, Debug, Default)]
struct OwnerState {
    /// Number of their last turn; 0: they had none.
    turn: u64,
    /// Jobs that run.
    running: usize,
    /// Jobs coalesced into others.
    coalesced: usize,
}

/// A job in its place in the queue.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) priority: i32,
    pub(super) owner: Owner,
    pub(super) key: i64,
}

impl Place {
    /// That of a job.
    pub(super) fn of(job: &Job) -> Place {
        Place {
            priority: job.priority,
            owner: job.owner.as_str().into(),
            key: job.key,
        }
    }
}

/// What a transaction changes about the jobs that wait; applied when it is committed.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Move {
    /// A job waits for a worker.
    Enter(Place),
    /// It does so no longer.
    Leave(Place),
    /// A job of this owner is coalesced into another.
    Attach(Owner),
    /// A coalesced job of this owner was detached, or has ended.
    Detach(Owner),
    /// A job of this owner starts.
    Start(Owner),
    /// A running job of this owner has ended, or waits again.
    Stop(Owner),
    /// This owner has had a turn, after the turn `before`.
    Turn { owner: Owner, before: u64, now: u64 },
}

impl Move {
    /// What takes it back.
    pub(super) fn inverse(self) -> Move {
        match self {
            Move::Enter(place) => Move::Leave(place),
            Move::Leave(place) => Move::Enter(place),
            Move::Attach(owner) => Move::Detach(owner),
            Move::Detach(owner) => Move::Attach(owner),
            Move::Start(owner) => Move::Stop(owner),
            Move::Stop(owner) => Move::Start(owner),
            Move::Turn { owner, before, now } => Move::Turn {
                owner,
                before: now,
                now: before,
            },
        }
    }
}

impl WaitingJobs {
    /// The owners of jobs that wait or run.
    pub(super) fn owners(&self) -> impl Iterator<Item = &str> {
        let waiting = self.rows.iter().flat_map(BTreeMap::keys);
        let busy = self.owners.iter();
        let busy = busy.filter(|(_, state)| state.running + state.coalesced > 0);
        waiting
            .chain(busy.map(|(owner, _)| owner))
            .map(AsRef::as_ref)
    }

    /// Applies a move; false if it changes nothing: to enter twice, or to leave twice.
    pub(super) fn apply(&mut self, change: Move) -> bool {
        match change {
            Move::Enter(Place {
                priority,
                owner,
                key,
            }) => {
                let row = self.rows[rank(priority)].entry(owner).or_default();
                let place = row.binary_search(&key);
                if let Err(index) = place {
                    row.insert(index, key);
                    self.count += 1;
                }
                place.is_err()
            }
            Move::Leave(Place {
                priority,
                owner,
                key,
            }) => {
                let rows = &mut self.rows[rank(priority)];
                let Some(row) = rows.get_mut(&owner) else {
                    return false;
                };
                let place = row.binary_search(&key);
                if let Ok(index) = place {
                    row.remove(index);
                    self.count -= 1;
                }
                if row.is_empty() {
                    rows.remove(&owner);
                }
                place.is_ok()
            }
            Move::Attach(owner) => {
                self.owners.entry(owner).or_default().coalesced += 1;
                self.coalesced += 1;
                true
            }
            Move::Detach(owner) => {
                let there = one_less(&mut self.owners.entry(owner).or_default().coalesced);
                there && one_less(&mut self.coalesced)
            }
            Move::Start(owner) => {
                self.owners.entry(owner).or_default().running += 1;
                true
            }
            Move::Stop(owner) => one_less(&mut self.owners.entry(owner).or_default().running),
            Move::Turn { owner, now, .. } => {
                self.owners.entry(owner).or_default().turn = now;
                self.turn = self.turn.max(now);
                true
            }
        }
    }

    /// What `look` finds with these moves, which are not committed yet.
    pub(super) fn with<T>(&mut self, moves: &[Move], look: impl FnOnce(&WaitingJobs) -> T) -> T {
        let mut done = vec![];
        for change in moves {
            if self.apply(change.clone()) {
                done.push(change);
            }
        }
        let found = look(self);
        for change in done.into_iter().rev() {
            self.apply(change.clone().inverse());
        }
        found
    }

    /// The next job, and its owner's turn; but for those in `damaged`, which wait until the operator removes them, and for
    /// those of owners who have as many running as they may.
    pub(super) fn next(&self, damaged: &BTreeSet<i64>, most_running: usize) -> Option<(i64, Move)> {
        self.rows.iter().find_map(|row| {
            let candidates = row.iter().filter_map(|(owner, keys)| {
                if self.running(owner) >= most_running {
                    return None;
                }
                let key = keys.iter().find(|key| !damaged.contains(key))?;
                Some((self.turn_of(owner), *key, owner))
            });
            let (before, key, owner) = candidates.min()?;
            let turn = Move::Turn {
                owner: owner.clone(),
                before,
                now: self.turn + 1,
            };
            Some((key, turn))
        })
    }

    fn turn_of(&self, owner: &str) -> u64 {
        self.owners.get(owner).map_or(0, |state| state.turn)
    }

    /// Jobs ahead of this one; none if it does not wait. Owners with as many running jobs as they may have are counted as
    /// if they had fewer.
    pub(super) fn ahead(&self, priority: i32, owner: &str, key: i64) -> Option<usize> {
        let rank = rank(priority);
        let row = &self.rows[rank];
        let keys = row.get(owner)?;
        let here = keys.binary_search(&key).ok()?;
        let order = |owner: &str, keys: &[i64]| (self.turn_of(owner), keys.first().copied());
        let own = order(owner, keys);
        // before its own turn with number `here`, each of the others has had as many, or one more
        let others = row.iter().filter(|(other, _)| ***other != *owner);
        let of_others = others.map(|(other, keys)| {
            let one_more = usize::from(order(other, keys) < own);
            keys.len().min(here + one_more)
        });
        let above = self.rows[..rank].iter().flat_map(BTreeMap::values);
        Some(here + of_others.sum::<usize>() + above.map(Vec::len).sum::<usize>())
    }

    /// How many wait, those that are coalesced among them.
    pub(super) fn len(&self) -> usize {
        self.coalesced + self.count
    }

    /// The first that was accepted of those that wait for a worker: keys go by arrival.
    pub(super) fn oldest(&self) -> Option<i64> {
        let rows = self.rows.iter().flat_map(BTreeMap::values);
        rows.filter_map(|keys| keys.first()).min().copied()
    }

    /// The same of one owner.
    pub(super) fn len_of(&self, owner: &str) -> usize {
        let waiting = self.rows.iter().filter_map(|row| row.get(owner));
        let coalesced = self.owners.get(owner).map_or(0, |state| state.coalesced);
        coalesced + waiting.map(Vec::len).sum::<usize>()
    }

    /// How many of this owner's jobs run.
    pub(super) fn running(&self, owner: &str) -> usize {
        self.owners.get(owner).map_or(0, |state| state.running)
    }
}

#[cfg(test)]
impl WaitingJobs {
    /// Fails unless both have the same jobs, whoever had their turn.
    pub(super) fn assert_same(&self, other: &WaitingJobs) {
        let busy = |jobs: &WaitingJobs| -> BTreeMap<Owner, (usize, usize)> {
            let states = jobs.owners.iter();
            let states = states.map(|(owner, has)| (owner.clone(), (has.running, has.coalesced)));
            states.filter(|(_, has)| *has != (0, 0)).collect()
        };
        assert_eq!(self.rows, other.rows);
        assert_eq!(
            (self.count, self.coalesced, busy(self)),
            (other.count, other.coalesced, busy(other))
        );
    }
}

/// One less, if there is any.
fn one_less(count: &mut usize) -> bool {
    let there = *count > 0;
    *count -= usize::from(there);
    there
}

fn rank(priority: i32) -> usize {
    (MAX_PRIORITY - priority.clamp(MIN_PRIORITY, MAX_PRIORITY)) as usize
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const ANY: usize = usize::MAX;

    fn place(priority: i32, owner: &str, key: i64) -> Place {
        let owner = owner.into();
        Place {
            priority,
            owner,
            key,
        }
    }

    /// Starts all jobs one after the other, and gives their order.
    fn order(mut waiting: WaitingJobs, jobs: &[Place]) -> Vec<i64> {
        let mut started = vec![];
        while let Some((key, turn)) = waiting.next(&BTreeSet::new(), ANY) {
            let job = jobs.iter().find(|job| job.key == key).unwrap();
            waiting.apply(Move::Leave(job.clone()));
            waiting.apply(turn);
            started.push(key);
        }
        started
    }

    fn entered(jobs: &[Place]) -> WaitingJobs {
        let mut waiting = WaitingJobs::default();
        for job in jobs {
            waiting.apply(Move::Enter(job.clone()));
            waiting.apply(Move::Enter(job.clone()));
        }
        waiting
    }

    #[test]
    fn the_higher_priority_goes_first_and_then_the_earlier_arrival() {
        let jobs = [(0, 1), (0, 2), (5, 3), (-10, 4), (0, 5)];
        let jobs = jobs.map(|(priority, key)| place(priority, "ada", key));
        let mut waiting = entered(&jobs);
        assert_eq!(order(entered(&jobs), &jobs), [3, 1, 2, 5, 4]);
        for (ahead, key) in [3, 1, 2, 5, 4].into_iter().enumerate() {
            let job = jobs.iter().find(|job| job.key == key).unwrap();
            assert_eq!(waiting.ahead(job.priority, "ada", key), Some(ahead));
        }
        waiting.apply(Move::Leave(place(0, "ada", 1)));
        waiting.apply(Move::Leave(place(0, "ada", 1)));
        assert_eq!(waiting.ahead(0, "ada", 1), None);
        assert_eq!(waiting.ahead(0, "ada", 5), Some(2));
        assert_eq!(waiting.ahead(0, "bob", 5), None);
        assert_eq!(
            (waiting.len(), waiting.len_of("ada"), waiting.len_of("bob")),
            (4, 4, 0)
        );
    }

    #[test]
    fn owners_take_turns_and_positions_say_so() {
        let mut jobs: Vec<Place> = (1..=6).map(|key| place(0, "ada", key)).collect();
        jobs.extend([
            place(0, "bob", 7),
            place(0, "bob", 8),
            place(0, "eve", 9),
            place(1, "ada", 10),
        ]);
        let waiting = entered(&jobs);
        // the high priority first; then each in turn, the oldest job of each
        let expected = [10, 7, 9, 1, 8, 2, 3, 4, 5, 6];
        let mut at_once = entered(&jobs);
        let (key, turn) = at_once.next(&BTreeSet::new(), ANY).unwrap();
        assert_eq!(key, 10);
        at_once.apply(Move::Leave(place(1, "ada", 10)));
        at_once.apply(turn);
        for (ahead, key) in expected[1..].iter().enumerate() {
            let job = jobs.iter().find(|job| job.key == *key).unwrap();
            let found = at_once.ahead(0, &job.owner, *key);
            assert_eq!(found, Some(ahead), "position of {key}");
        }
        assert_eq!(order(waiting, &jobs), expected);
    }

    #[test]
    fn owners_with_as_many_running_as_they_may_and_damaged_jobs_are_passed_over() {
        let jobs = [
            place(3, "ada", 1),
            place(0, "ada", 2),
            place(0, "bob", 3),
            place(0, "bob", 4),
        ];
        let mut waiting = entered(&jobs);
        waiting.apply(Move::Start("ada".into()));
        let next = |waiting: &WaitingJobs, damaged: &[i64], most| {
            let damaged = damaged.iter().copied().collect();
            waiting.next(&damaged, most).map(|(key, _)| key)
        };
        assert_eq!(next(&waiting, &[], 2), Some(1));
        assert_eq!(next(&waiting, &[], 1), Some(3));
        assert_eq!(next(&waiting, &[3], 1), Some(4));
        assert_eq!(next(&waiting, &[3, 4], 1), None);
        assert_eq!(next(&waiting, &[1], 2), Some(2));
        waiting.apply(Move::Stop("ada".into()));
        assert_eq!(
            (next(&waiting, &[], 1), waiting.running("ada")),
            (Some(1), 0)
        );
    }

    #[test]
    fn moves_that_are_not_committed_are_seen_and_taken_back() {
        let jobs = [place(0, "ada", 1), place(0, "bob", 2)];
        let mut waiting = entered(&jobs);
        let look = |waiting: &WaitingJobs| waiting.next(&BTreeSet::new(), ANY);
        let (key, turn) = waiting.with(&[], look).unwrap();
        assert_eq!(key, 1);
        let moves = [
            Move::Leave(jobs[0].clone()),
            Move::Start("ada".into()),
            turn,
            Move::Enter(place(0, "ada", 3)),
            Move::Attach("eve".into()),
        ];
        assert_eq!(
            waiting.with(&moves, |waiting| (look(waiting).unwrap().0, waiting.len())),
            (2, 3)
        );
        assert_eq!((look(&waiting).unwrap().0, waiting.len()), (1, 2));
        assert_eq!((waiting.running("ada"), waiting.turn_of("ada")), (0, 0));
    }
}
