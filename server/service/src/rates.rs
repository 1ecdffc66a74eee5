//! Limits how many jobs each owner submits in a minute.

use parking_lot::Mutex;
use std::{
    collections::{HashMap, VecDeque},
    time::{Duration, Instant},
};

/// The largest number of owners that are remembered; beyond that, owners without a submission in the last minute are
/// forgotten.
const MOST_OWNERS: usize = 10_000;

/// The time that a limit is about.
const MINUTE: Duration = Duration::from_secs(60);

/// Submissions within this time of each other are counted together, so that an owner takes little memory.
const TOGETHER: Duration = Duration::from_secs(1);

/// The limit of submissions for each owner: in no minute may an owner submit more jobs.
#[derive(Debug)]
pub struct Rates {
    /// The number of jobs that an owner may submit in a minute; `None`: no limit.
    pub per_minute: Option<u32>,
    /// The jobs of each owner in the last minute.
    owners: Mutex<HashMap<String, Submitted>>,
}

/// The jobs that an owner has submitted, the oldest first: the time of the last submission that is counted together, and
/// the number of jobs.
#[derive(Debug, Default)]
struct Submitted(VecDeque<(Instant, u64)>);

impl Rates {
    /// The limit, with no jobs submitted yet.
    pub fn new(per_minute: Option<u32>) -> Rates {
        Rates {
            per_minute,
            owners: Mutex::default(),
        }
    }

    /// Uses up `jobs` of an owner; if fewer are left, uses up none and returns the number left as `Err`.
    pub fn take(&self, owner: &str, jobs: u64) -> Result<(), u64> {
        self.take_at(owner, jobs, Instant::now())
    }

    /// Gives jobs that were used up but not stored back to the owner.
    pub fn give_back(&self, owner: &str, jobs: u64) {
        if let Some(submitted) = self.owners.lock().get_mut(owner) {
            submitted.remove(jobs);
        }
    }

    /// How many jobs the owner may submit at once; `None`: no limit.
    pub fn left(&self, owner: &str) -> Option<u64> {
        let per_minute = u64::from(self.per_minute?);
        let mut owners = self.owners.lock();
        let known = owners.get_mut(owner);
        let used = known.map_or(0, |submitted| {
            submitted.in_the_minute_before(Instant::now())
        });
        Some(per_minute.saturating_sub(used))
    }

    fn take_at(&self, owner: &str, jobs: u64, now: Instant) -> Result<(), u64> {
        let Some(per_minute) = self.per_minute else {
            return Ok(());
        };
        let mut owners = self.owners.lock();
        if owners.len() >= MOST_OWNERS && !owners.contains_key(owner) {
            owners.retain(|_, submitted| submitted.in_the_minute_before(now) > 0);
        }
        let submitted = owners.entry(owner.to_owned()).or_default();
        let left = u64::from(per_minute).saturating_sub(submitted.in_the_minute_before(now));
        if left < jobs {
            return Err(left);
        }
        submitted.add(jobs, now);
        Ok(())
    }
}

impl Submitted {
    /// The number of jobs in the minute before now; forgets older ones.
    fn in_the_minute_before(&mut self, now: Instant) -> u64 {
        let is_old = |(last, _): &(Instant, u64)| now.saturating_duration_since(*last) >= MINUTE;
        while self.0.front().is_some_and(is_old) {
            self.0.pop_front();
        }
        self.0.iter().map(|(_, jobs)| jobs).sum()
    }

    fn add(&mut self, jobs: u64, now: Instant) {
        let before = self.0.len().checked_sub(2).map(|i| self.0[i].0);
        match self.0.back_mut() {
            // as long as all of them are within that time of the entry before
            Some((last, count))
                if before
                    .is_some_and(|before| now.saturating_duration_since(before) < TOGETHER) =>
            {
                (*last, *count) = (now, *count + jobs);
            }
            _ => self.0.push_back((now, jobs)),
        }
    }

    /// Removes jobs, the last ones first.
    fn remove(&mut self, mut jobs: u64) {
        while let Some((last, count)) = self.0.pop_back() {
            if count > jobs {
                self.0.push_back((last, count - jobs));
                break;
            }
            jobs -= count;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_holds_in_every_minute_and_separately_for_each_owner() {
        let (rates, start) = (Rates::new(Some(60)), Instant::now());
        let at =
            |owner, jobs, millis| rates.take_at(owner, jobs, start + Duration::from_millis(millis));
        assert_eq!(at("ada", 50, 0), Ok(()));
        assert_eq!(at("ada", 11, 500), Err(10));
        assert_eq!(at("bob", 59, 500), Ok(()));
        assert_eq!(at("ada", 10, 30_000), Ok(()));
        assert_eq!(at("ada", 1, 59_999), Err(0));
        assert_eq!(at("ada", 51, 60_000), Err(50));
        assert_eq!(at("ada", 50, 60_001), Ok(()));
        assert_eq!(at("ada", 61, 600_000), Err(60), "never more than the limit");
        assert_eq!(Rates::new(None).take("ada", u64::MAX), Ok(()));

        assert_eq!(at("ada", 60, 600_000), Ok(()));
        rates.give_back("ada", 20);
        assert_eq!(at("ada", 20, 600_000), Ok(()));
        rates.give_back("ada", 1000);
        assert_eq!(at("ada", 61, 600_000), Err(60), "never more than the limit");
    }

    /// An owner who submits without a pause: in every minute the limit, and at most two entries for each second.
    #[test]
    fn a_flood_stays_within_the_limit_and_takes_little_memory() {
        let (rates, start) = (Rates::new(Some(300)), Instant::now());
        let mut accepted = Vec::new();
        for millis in (0..200_000).step_by(20) {
            let now = start + Duration::from_millis(millis);
            if rates.take_at("ada", 1, now).is_ok() {
                accepted.push(millis);
            }
        }
        for from in &accepted {
            let minute = *from..from + 60_000;
            let within = accepted.iter().filter(|at| minute.contains(*at));
            assert!(within.count() <= 300, "from {from}");
        }
        assert!(accepted.len() >= 1000, "{}", accepted.len());
        let owners = rates.owners.lock();
        assert!(owners["ada"].0.len() <= 122, "{}", owners["ada"].0.len());
    }
}
