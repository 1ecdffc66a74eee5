//! The memory budget: each running job reserves its estimated memory, and a job that uses far more is ended. The rest
//! of the budget is for bodies that are kept for later jobs; jobs take precedence over them.
//!
//! The next job in order is claimed when its estimate fits, and no later job before it.

use parking_lot::{Mutex, MutexGuard};
use std::{
    cell::Cell,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
};

use serde::{Deserialize, Serialize};
use solver::{Prepared, body::ElasticBody, model::Model};

use crate::bodies::{Bodies, BodyCache, Key};

/// The memory that all jobs together may use beyond the budget (bytes), since estimates are not exact. With many jobs
/// it is more, since each has at least the smallest margin.
const MARGINS: u64 = 128 << 20;
/// The smallest memory that each job may use beyond its estimate (bytes).
const LEAST_MARGIN: u64 = 4 << 20;

/// The budget of all running jobs together (bytes).
#[derive(Debug)]
pub struct Budget {
    bytes: u64,
    /// How many jobs run at the same time here.
    jobs: u16,
    /// The memory that each job may use beyond its estimate (bytes).
    margin: u64,
    state: Mutex<State>,
    /// Whether the next job of the queue waits for memory.
    short: AtomicBool,
    /// The memory of the largest worker elsewhere (bytes); 0 without one.
    elsewhere: AtomicU64,
}

#[derive(Debug)]
struct State {
    /// The memory reserved by jobs whose solvers are running, including the bodies that they use.
    reserved: u64,
    /// The kept bodies; those that no job uses fit into the rest of the budget.
    bodies: Bodies,
}

impl Budget {
    /// A budget of `bytes` for `jobs` simultaneous jobs; at most `of_bodies` of it are for kept bodies.
    pub fn new(bytes: u64, jobs: u16, of_bodies: u64) -> Arc<Budget> {
        Arc::new(Budget {
            bytes,
            jobs,
            margin: (MARGINS / u64::from(jobs.max(1))).max(LEAST_MARGIN),
            state: Mutex::new(State {
                reserved: 0,
                bodies: Bodies::new(of_bodies),
            }),
            short: AtomicBool::new(false),
            elsewhere: AtomicU64::new(0),
        })
    }

    /// The size of the budget (bytes).
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The memory of the largest worker elsewhere (bytes); 0 without one.
    pub fn elsewhere(&self) -> u64 {
        self.elsewhere.load(Ordering::Relaxed)
    }

    /// Sets the memory of the largest worker elsewhere (bytes).
    pub fn set_elsewhere(&self, bytes: u64) {
        self.elsewhere.store(bytes, Ordering::Relaxed);
    }

    /// Whether a job of this estimated memory (bytes; `None`: unknown) can be solved neither here nor by a worker that is there.
    pub fn fits_nowhere(&self, needed: Option<u64>) -> bool {
        let here = if self.jobs == 0 { 0 } else { self.bytes };
        match (self.elsewhere(), here) {
            // without workers elsewhere, a job of more than the budget runs alone
            (0, here) => here == 0,
            (elsewhere, here) => needed.is_some_and(|needed| needed > elsewhere.max(here)),
        }
    }

    /// The memory that running jobs have reserved (bytes).
    pub fn reserved(&self) -> u64 {
        self.state().reserved
    }

    /// Reserves the estimated memory of a job; `None` if it does not fit together with the running ones. A job of
    /// unknown need, or of more than the budget (which was larger when the job was accepted), takes all of the budget
    /// and runs alone. Kept bodies that no job uses are dropped if the job fits then.
    pub fn reserve(self: &Arc<Budget>, needed: Option<u64>) -> Option<Reservation> {
        let bytes = needed.unwrap_or(u64::MAX).min(self.bytes);
        let mut state = self.state();
        let left = (self.bytes - state.reserved).checked_sub(bytes);
        self.short.store(left.is_none(), Ordering::Relaxed);
        left.map(|left| {
            state.reserved += bytes;
            Reservation {
                budget: self.clone(),
                bytes,
                dropped: state.bodies.shrink_idle(left),
            }
        })
    }

    /// The body of a model, if it is kept, and its size (bytes).
    pub fn kept_body(&self, key: &Key, model: &Model) -> Option<(Arc<ElasticBody>, u64)> {
        let found = self.state().bodies.find(key);
        // not while the lock is held: meshes are compared. A wrong body gives wrong results that look right
        let same = found.filter(|(kept, _)| ElasticBody::same(&kept.model, model));
        let mut state = self.state();
        match &same {
            Some(_) => state.bodies.count_hit(key),
            None => state.bodies.count_miss(),
        }
        drop(state);
        same.map(|(kept, bytes)| (kept.body.clone(), bytes))
    }

    /// Keeps a body of this size, if there is room; returns the bodies that are dropped for it.
    pub fn keep(&self, key: Key, prepared: Prepared, bytes: u64) -> Vec<Arc<Prepared>> {
        self.state().bodies.keep(key, prepared, bytes)
    }

    /// Drops all kept bodies that no job uses, because the machine has less memory than the budget says.
    pub fn drop_bodies(&self) {
        let dropped = self.state().bodies.shrink_idle(0);
        drop(dropped);
    }

    /// The largest size of all kept bodies (bytes).
    pub fn of_bodies(&self) -> u64 {
        self.state().bodies.limit()
    }

    /// The figures of the kept bodies.
    pub fn body_cache(&self) -> BodyCache {
        self.state().bodies.figures()
    }

    /// Whether the next job of the queue waits for memory rather than for a worker.
    pub fn is_short(&self) -> bool {
        self.short.load(Ordering::Relaxed)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock()
    }
}

/// A reserved part of the budget, returned to it when the reservation is dropped.
#[derive(Debug)]
pub struct Reservation {
    budget: Arc<Budget>,
    bytes: u64,
    /// Bodies that were dropped for this reservation.
    dropped: Vec<Arc<Prepared>>,
}

/// The resources that one job may use.
#[derive(Clone, Copy, Debug)]
pub struct Allowance<'a> {
    /// The memory (bytes).
    pub share: u64,
    /// The budget with the kept bodies; `None` if no bodies are kept.
    pub bodies: Option<&'a Budget>,
}

impl Reservation {
    /// Frees the memory of the prepared bodies that the budget no longer keeps, to make room for this reservation.
    /// Call this before the job that holds the reservation begins, on a thread that may block.
    pub fn free_dropped(&mut self) {
        self.dropped.clear();
    }

    /// The resources that the job may use.
    pub fn allowance(&self) -> Allowance<'_> {
        Allowance {
            share: self.share(),
            bodies: Some(&*self.budget).filter(|budget| budget.of_bodies() > 0),
        }
    }

    /// The memory that the job may use: its estimate, which is meant to be an upper bound, plus a margin. All jobs
    /// together use no more than the budget plus 128 MiB, or plus 4 MiB for each job if that is more.
    pub fn share(&self) -> u64 {
        self.bytes.saturating_add(self.budget.margin)
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        let mut state = self.budget.state();
        state.reserved -= self.bytes;
        // the job's own body may be idle now, and larger than its estimate
        let free = self.budget.bytes - state.reserved;
        let dropped = state.bodies.shrink_idle(free);
        self.budget.short.store(false, Ordering::Relaxed);
        drop(state);
        drop(dropped);
    }
}

/// The error of a job that needs more than its share.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Outgrown {
    /// The memory in use (bytes).
    pub used: u64,
    /// The additional memory that was needed (bytes).
    pub needed: u64,
    /// The memory that the job was allowed to use (bytes).
    pub share: u64,
}

/// Measures the memory that the job on this thread uses.
#[derive(Debug)]
pub struct Meter {
    /// The thread's count when the job began, plus memory passed to other threads since, minus memory taken over from
    /// them.
    start: Cell<i64>,
    share: u64,
}

impl Meter {
    /// Starts measuring a job with this share on this thread.
    pub fn new(share: u64) -> Meter {
        let start = Cell::new(allocator::held());
        Meter { start, share }
    }

    /// The memory that the job uses (bytes).
    pub fn used(&self) -> u64 {
        u64::try_from(allocator::held().saturating_sub(self.start.get())).unwrap_or(0)
    }

    /// Adds memory of the job that another thread has allocated (bytes).
    pub fn lend(&self, bytes: u64) {
        let bytes = i64::try_from(bytes).unwrap_or(i64::MAX);
        self.start.set(self.start.get().saturating_sub(bytes));
    }

    /// Whether the job, which is about to allocate `needed` more bytes, may continue.
    pub fn check(&self, needed: u64) -> Result<(), Outgrown> {
        let (used, share) = (self.used(), self.share);
        match used.saturating_add(needed) > share {
            true => Err(Outgrown {
                used,
                needed,
                share,
            }),
            false => Ok(()),
        }
    }

    /// The error of a job that was refused `needed` more bytes by the system. If they are within its share, the machine
    /// has less memory than the share; the error then names at least the share as needed, whatever is used.
    pub fn refused(&self, needed: u64) -> Outgrown {
        self.check(needed).err().unwrap_or_else(|| Outgrown {
            used: self.used(),
            needed: needed.max(self.share),
            share: self.share,
        })
    }

    /// Runs work whose memory is passed to another thread and no longer counts for the job.
    pub fn hand_over<T>(&self, work: impl FnOnce() -> T) -> T {
        let before = allocator::held();
        let done = work();
        let handed_over = allocator::held() - before;
        self.start.set(self.start.get().saturating_add(handed_over));
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
        let budget = Budget::new(100 * MIB, 2, 0);
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
            let budget = Budget::new(1000 * MIB, jobs, 0);
            let estimate = Some(1000 * MIB / u64::from(jobs));
            let reserve = || budget.reserve(estimate);
            let reserved: Vec<Reservation> = std::iter::from_fn(reserve).collect();
            assert_eq!(reserved.len(), usize::from(jobs));
            let together: u64 = reserved.iter().map(Reservation::share).sum();
            assert!((1127 * MIB..=1128 * MIB).contains(&together), "{together}");
        }
    }

    fn body() -> Prepared {
        solver::prepare(&fake::problem(), None, &mut ()).unwrap()
    }

    #[test]
    fn kept_bodies_are_dropped_for_jobs_only_as_far_as_needed() {
        let budget = Budget::new(100 * MIB, 2, 50 * MIB);
        for k in 1..=3 {
            budget.keep([k; 32], body(), 15 * MIB);
        }
        let kept = || budget.body_cache().bodies;
        // beside 45 MiB of bodies
        let first = budget.reserve(Some(55 * MIB)).unwrap();
        assert_eq!((kept(), first.dropped.len()), (3, 0));
        let mut second = budget.reserve(Some(20 * MIB)).unwrap();
        assert_eq!((kept(), second.dropped.len()), (1, 2));
        second.free_dropped();
        assert!(second.dropped.is_empty());
        // what does not fit anyway drops nothing
        assert!(budget.reserve(Some(26 * MIB)).is_none());
        assert_eq!(kept(), 1);
        let third = budget.reserve(Some(25 * MIB)).unwrap();
        assert_eq!((kept(), third.dropped.len()), (0, 1));
    }

    #[test]
    fn a_body_in_use_is_a_part_of_what_its_job_has_reserved() {
        let budget = Budget::new(100 * MIB, 2, 50 * MIB);
        let body = body();
        let job = budget.reserve(Some(50 * MIB)).unwrap();
        budget.keep([1; 32], body.clone(), 50 * MIB);
        // it is not counted twice
        let other = budget.reserve(Some(50 * MIB)).unwrap();
        assert_eq!(budget.body_cache().bodies, 1);
        drop(body);
        // the job has ended, and there is no room for its body beside the other and one more
        drop(job);
        assert_eq!(budget.body_cache().bodies, 1);
        let more = budget.reserve(Some(1)).unwrap();
        assert_eq!(budget.body_cache().bodies, 0);
        drop((other, more));
    }

    #[test]
    fn a_body_larger_than_what_its_job_had_reserved_is_dropped_if_others_need_the_rest() {
        let budget = Budget::new(100 * MIB, 2, 100 * MIB);
        let other = budget.reserve(Some(70 * MIB)).unwrap();
        let job = budget.reserve(Some(30 * MIB)).unwrap();
        budget.keep([1; 32], body(), 31 * MIB);
        drop(job);
        assert_eq!(budget.body_cache().bodies, 0);
        drop(other);
    }

    #[test]
    fn a_kept_body_is_found_only_for_an_equal_model() {
        let budget = Budget::new(100 * MIB, 2, 50 * MIB);
        let prepared = body();
        let model = prepared.model.clone();
        budget.keep([1; 32], prepared, 7);
        assert!(matches!(budget.kept_body(&[1; 32], &model), Some((_, 7))));
        assert!(budget.kept_body(&[2; 32], &model).is_none());
        // as if two bodies had the same key
        let other = Model {
            quadrature: 2,
            ..model
        };
        assert!(budget.kept_body(&[1; 32], &other).is_none());
        let figures = budget.body_cache();
        assert_eq!((figures.hits, figures.misses), (1, 2));
    }

    #[test]
    fn a_meter_counts_what_its_thread_holds_and_has_not_handed_over() {
        let meter = Meter::new(10_000);
        assert!(meter.check(9_000).is_ok());
        let held = std::hint::black_box(vec![0u8; 6_000]);
        let outgrown = Outgrown {
            used: 6_000,
            needed: 5_000,
            share: 10_000,
        };
        assert_eq!(meter.check(5_000), Err(outgrown));
        let given = meter.hand_over(|| std::hint::black_box(vec![0u8; 50_000]));
        assert!(meter.check(4_000).is_ok());
        let there = std::thread::spawn(move || drop(given));
        there.join().unwrap();
        assert!(meter.check(3_500).is_ok());
        drop(held);
        assert!(meter.check(9_000).is_ok());
        meter.lend(5_000);
        assert!(meter.used() >= 5_000 && meter.check(6_000).is_err());
        meter.lend(u64::MAX);
        assert!(meter.check(0).is_err());
        assert!(meter.check(u64::MAX).is_err());
    }
}
