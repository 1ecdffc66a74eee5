//! Limits how many jobs each owner submits in a minute.

use parking_lot::Mutex;
use std::{collections::HashMap, time::Instant};

/// The largest number of owners that are remembered; beyond that, owners who may submit the full number again are
/// forgotten.
const MOST_OWNERS: usize = 10_000;

/// The limit of submissions for each owner: an owner may submit all jobs of a minute at once; used-up jobs are regained
/// evenly over a minute.
#[derive(Debug)]
pub struct Rates {
    /// The number of jobs that an owner may submit in a minute; `None`: no limit.
    pub per_minute: Option<u32>,
    /// The number of jobs that each owner had left, and the time when it was computed.
    left: Mutex<HashMap<String, (f64, Instant)>>,
}

impl Rates {
    /// The limit, with no jobs submitted yet.
    pub fn new(per_minute: Option<u32>) -> Rates {
        Rates {
            per_minute,
            left: Mutex::default(),
        }
    }

    /// Uses up `jobs` of an owner; if fewer are left, uses up none and returns the number left as `Err`.
    pub fn take(&self, owner: &str, jobs: u64) -> Result<(), u64> {
        self.take_at(owner, jobs, Instant::now())
    }

    /// Gives jobs that were used up but not stored back to the owner.
    pub fn give_back(&self, owner: &str, jobs: u64) {
        let Some(per_minute) = self.per_minute else {
            return;
        };
        let mut all = self.left.lock();
        if let Some((left, _)) = all.get_mut(owner) {
            *left = (*left + jobs as f64).min(f64::from(per_minute));
        }
    }

    /// How many jobs the owner may submit at once; `None`: no limit.
    pub fn left(&self, owner: &str) -> Option<u64> {
        let per_minute = self.per_minute?;
        let all = self.left.lock();
        let known = all.get(owner).copied();
        Some(refilled(known, per_minute, Instant::now()) as u64)
    }

    fn take_at(&self, owner: &str, jobs: u64, now: Instant) -> Result<(), u64> {
        let Some(per_minute) = self.per_minute else {
            return Ok(());
        };
        let mut all = self.left.lock();
        if all.len() >= MOST_OWNERS && !all.contains_key(owner) {
            all.retain(|_, known| refilled(Some(*known), per_minute, now) < f64::from(per_minute));
        }
        let left = refilled(all.get(owner).copied(), per_minute, now);
        if left < jobs as f64 {
            return Err(left as u64);
        }
        all.insert(owner.to_owned(), (left - jobs as f64, now));
        Ok(())
    }
}

/// The number of jobs that an owner has left now; `known`: the number at an earlier time, and that time.
fn refilled(known: Option<(f64, Instant)>, per_minute: u32, now: Instant) -> f64 {
    let most = f64::from(per_minute);
    known.map_or(most, |(left, then)| {
        let since = now.saturating_duration_since(then).as_secs_f64();
        (left + most * since / 60.0).min(most)
    })
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_limit_recovers_evenly_and_separately_for_each_owner() {
        let (rates, start) = (Rates::new(Some(60)), Instant::now());
        let at = |owner, jobs, seconds| {
            rates.take_at(owner, jobs, start + Duration::from_millis(seconds))
        };
        assert_eq!(at("ada", 60, 0), Ok(()));
        assert_eq!(at("ada", 1, 500), Err(0));
        assert_eq!(at("bob", 59, 500), Ok(()));
        assert_eq!(at("ada", 10, 10_000), Ok(()));
        assert_eq!(at("ada", 3, 12_001), Err(2));
        assert_eq!(at("ada", 61, 600_000), Err(60), "never more than the limit");
        assert_eq!(Rates::new(None).take("ada", u64::MAX), Ok(()));

        assert_eq!(at("ada", 60, 600_000), Ok(()));
        rates.give_back("ada", 20);
        assert_eq!(at("ada", 20, 600_000), Ok(()));
        rates.give_back("ada", 1000);
        assert_eq!(at("ada", 61, 600_000), Err(60), "never more than the limit");
    }
}
