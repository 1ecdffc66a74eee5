//! The memory budget: what running jobs are estimated to need is reserved in it, and a job that takes far more than
//! that is ended.

use std::{
    ops::ControlFlow,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};

use serde::{Deserialize, Serialize};

/// What all jobs together may use beyond the budget (bytes), since an estimate is one; unless they are so many that each
/// has the least margin.
const MARGINS: u64 = 128 << 20;
const LEAST_MARGIN: u64 = 4 << 20;

/// The budget of all running jobs together (bytes).
#[derive(Debug)]
pub struct Budget {
    bytes: u64,
    /// What a job may use beyond its estimate.
    margin: u64,
    /// Reserved by the jobs whose solvers are at work.
    reserved: Mutex<u64>,
    /// The next job of the queue waits for memory.
    short: AtomicBool,
}

impl Budget {
    /// A budget of so many bytes, for so many jobs at the same time.
    pub fn new(bytes: u64, jobs: u16) -> Arc<Budget> {
        Arc::new(Budget {
            bytes,
            margin: (MARGINS / u64::from(jobs.max(1))).max(LEAST_MARGIN),
            reserved: Mutex::new(0),
            short: AtomicBool::new(false),
        })
    }

    /// Its size.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Reserves what a job is estimated to need; none if it does not fit beside the running ones. A job of unknown
    /// need, or of more than the budget (which was larger when it was accepted), takes all of it: it runs alone.
    pub fn reserve(self: &Arc<Budget>, needed: Option<u64>) -> Option<Reservation> {
        let bytes = needed.unwrap_or(u64::MAX).min(self.bytes);
        let mut reserved = self.reserved();
        let fits = self.bytes - *reserved >= bytes;
        self.short.store(!fits, Ordering::Relaxed);
        fits.then(|| {
            *reserved += bytes;
            Reservation {
                budget: self.clone(),
                bytes,
            }
        })
    }

    /// Whether the next job of the queue waits for memory and not for a worker.
    pub fn is_short(&self) -> bool {
        self.short.load(Ordering::Relaxed)
    }

    fn reserved(&self) -> MutexGuard<'_, u64> {
        // No code panics while it holds this lock.
        self.reserved.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A part of the budget, given back when it is dropped.
#[derive(Debug)]
pub struct Reservation {
    budget: Arc<Budget>,
    bytes: u64,
}

impl Reservation {
    /// What the job may use: its estimate, which is meant to be an upper bound, and a margin for what that does not
    /// foresee. All jobs together use no more than the budget and 128 MiB, or 4 MiB for each.
    pub fn share(&self) -> u64 {
        self.bytes.saturating_add(self.budget.margin)
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        *self.budget.reserved() -= self.bytes;
        self.budget.short.store(false, Ordering::Relaxed);
    }
}

/// A job has outgrown its share.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Outgrown {
    /// What it had in use (bytes).
    pub used: u64,
    /// What it needed beyond that (bytes).
    pub needed: u64,
    /// What it might use (bytes).
    pub share: u64,
}

/// Watches what the job of this thread uses.
#[derive(Debug)]
pub struct Meter {
    /// The thread's count when the job began.
    start: i64,
    share: u64,
}

impl Meter {
    /// A job of this share begins on this thread.
    pub fn new(share: u64) -> Meter {
        let start = allocator::held();
        Meter { start, share }
    }

    /// Whether the job may go on, which is about to take `needed` more bytes.
    pub fn check(&self, needed: u64) -> ControlFlow<Outgrown> {
        let used = u64::try_from(allocator::held() - self.start).unwrap_or(0);
        match used.saturating_add(needed) > self.share {
            true => ControlFlow::Break(Outgrown {
                used,
                needed,
                share: self.share,
            }),
            false => ControlFlow::Continue(()),
        }
    }

    /// Does work whose memory is handed over to another thread, and no longer that of the job.
    pub fn hand_over<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let before = allocator::held();
        let done = work();
        self.start += allocator::held() - before;
        done
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const MIB: u64 = 1 << 20;

    #[test]
    fn jobs_fit_as_long_as_their_sum_does() {
        let budget = Budget::new(100 * MIB, 2);
        let first = budget.reserve(Some(60 * MIB)).unwrap();
        assert!(budget.reserve(Some(41 * MIB)).is_none() && budget.is_short());
        let second = budget.reserve(Some(40 * MIB)).unwrap();
        assert!(!budget.is_short());
        drop(first);
        assert!(budget.reserve(Some(61 * MIB)).is_none());
        drop(second);
        assert!(!budget.is_short());
        let unknown = budget.reserve(None).unwrap();
        assert!(budget.reserve(Some(1)).is_none(), "it runs alone");
        drop(unknown);
        let too_large = budget.reserve(Some(u64::MAX)).unwrap();
        assert_eq!(too_large.share(), 164 * MIB);
    }

    #[test]
    fn shares_have_margins_and_a_limit_together() {
        for jobs in [1, 2, 16] {
            let budget = Budget::new(1000 * MIB, jobs);
            let estimate = Some(1000 * MIB / u64::from(jobs));
            let reserve = || budget.reserve(estimate);
            let reserved: Vec<Reservation> = std::iter::from_fn(reserve).collect();
            assert_eq!(reserved.len(), usize::from(jobs));
            let together: u64 = reserved.iter().map(Reservation::share).sum();
            assert!((1127 * MIB..=1128 * MIB).contains(&together), "{together}");
        }
    }

    #[test]
    fn a_meter_counts_what_its_thread_holds_and_has_not_handed_over() {
        let mut meter = Meter::new(10_000);
        assert!(meter.check(9_000).is_continue());
        let held = std::hint::black_box(vec![0u8; 6_000]);
        let outgrown = Outgrown {
            used: 6_000,
            needed: 5_000,
            share: 10_000,
        };
        assert_eq!(meter.check(5_000), ControlFlow::Break(outgrown));
        let given = meter.hand_over(|| std::hint::black_box(vec![0u8; 50_000]));
        assert!(meter.check(4_000).is_continue());
        let there = std::thread::spawn(move || drop(given));
        there.join().unwrap();
        assert!(meter.check(3_500).is_continue());
        drop(held);
        assert!(meter.check(9_000).is_continue());
        assert!(meter.check(u64::MAX).is_break());
    }
}
