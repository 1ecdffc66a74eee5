//! Condensed bodies that are kept for later jobs on the same body, up to a limit; the least recently used is dropped
//! first. This module only holds data: `memory` decides when jobs need the room.
//!
//! A body is found by a hash of everything that it is made from; a solution on a kept body has the same bits as one on
//! a new body. Jobs on meshes of their own (adaptive refinement, `verify`) and worker processes keep none. Two jobs
//! that begin at the same time each make their own.

use std::{collections::HashMap, sync::Arc};

use schemars::JsonSchema;
use serde::Serialize;
use solver::Prepared;

/// The largest number of bodies that are kept, so that searching them takes microseconds.
const MOST_BODIES: usize = 1000;

/// The SHA-256 of everything that a body is made from (`digest::of_body`).
pub type Key = [u8; 32];

/// The bodies that are kept.
#[derive(Debug)]
pub struct Bodies {
    /// The largest size of all bodies together (bytes).
    limit: u64,
    kept: HashMap<Key, Kept>,
    /// The number of uses so far, which serves as the time of a use.
    uses: u64,
    counts: Counts,
}

#[derive(Debug)]
struct Kept {
    /// The body, with the model that it was made for.
    prepared: Arc<Prepared>,
    bytes: u64,
    /// The number of the body's last use.
    used: u64,
}

impl Kept {
    /// Whether no job uses the body, so that dropping it frees its memory.
    fn is_idle(&self) -> bool {
        Arc::strong_count(&self.prepared) == 1 && Arc::strong_count(&self.prepared.body) == 1
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    hits: u64,
    misses: u64,
    evictions: u64,
}

/// Figures of the kept bodies since the service started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct BodyCache {
    /// The number of bodies that are kept now.
    pub bodies: u64,
    /// The size of the bodies that are kept now (bytes).
    pub bytes: u64,
    /// The number of jobs whose body was found among the kept ones.
    pub hits: u64,
    /// The number of jobs whose body was not found, so that it had to be factored.
    pub misses: u64,
    /// The number of bodies that were dropped to make room for other bodies or for jobs.
    pub evictions: u64,
}

impl Bodies {
    /// An empty set of kept bodies, with a limit on their size (bytes); 0 keeps none.
    pub fn new(limit: u64) -> Bodies {
        Bodies {
            limit,
            kept: HashMap::new(),
            uses: 0,
            counts: Counts::default(),
        }
    }

    /// The largest size of all bodies together (bytes).
    pub fn limit(&self) -> u64 {
        self.limit
    }

    /// The body with this key and its size (bytes). The caller compares its model, and counts a hit or a miss.
    pub fn find(&self, key: &Key) -> Option<(Arc<Prepared>, u64)> {
        let kept = self.kept.get(key)?;
        Some((kept.prepared.clone(), kept.bytes))
    }

    /// Counts that a job uses the body with this key.
    pub fn count_hit(&mut self, key: &Key) {
        self.counts.hits += 1;
        self.uses += 1;
        if let Some(kept) = self.kept.get_mut(key) {
            kept.used = self.uses;
        }
    }

    /// Counts that the body of a job was not found.
    pub fn count_miss(&mut self) {
        self.counts.misses += 1;
    }

    /// Keeps a body, unless it alone is larger than the limit. It replaces a body with the same key, which was made at
    /// the same time. Returns the bodies that are dropped, to be freed on a thread that nobody waits for.
    pub fn keep(&mut self, key: Key, prepared: Prepared, bytes: u64) -> Vec<Arc<Prepared>> {
        if bytes > self.limit {
            return vec![Arc::new(prepared)];
        }
        self.uses += 1;
        let kept = Kept {
            prepared: Arc::new(prepared),
            bytes,
            used: self.uses,
        };
        let replaced = self.kept.insert(key, kept).map(|kept| kept.prepared);
        let mut dropped: Vec<_> = replaced.into_iter().collect();
        while self.bytes() > self.limit || self.kept.len() > MOST_BODIES {
            let Some(evicted) = self.evict(|_| true) else {
                break;
            };
            dropped.push(evicted);
        }
        dropped
    }

    /// Drops the least recently used of the bodies that no job uses, until those left have at most `most` bytes.
    /// Returns the dropped bodies, as [`keep`](Self::keep) does.
    pub fn shrink_idle(&mut self, most: u64) -> Vec<Arc<Prepared>> {
        let mut dropped = vec![];
        while self.idle_bytes() > most {
            let Some(evicted) = self.evict(Kept::is_idle) else {
                break;
            };
            dropped.push(evicted);
        }
        dropped
    }

    /// The present figures of the kept bodies.
    pub fn figures(&self) -> BodyCache {
        let Counts {
            hits,
            misses,
            evictions,
        } = self.counts;
        BodyCache {
            bodies: self.kept.len() as u64,
            bytes: self.bytes(),
            hits,
            misses,
            evictions,
        }
    }

    fn bytes(&self) -> u64 {
        self.kept.values().map(|kept| kept.bytes).sum()
    }

    /// The size of the bodies that no job uses (bytes); the others are part of the memory that jobs have reserved.
    fn idle_bytes(&self) -> u64 {
        let idle = self.kept.values().filter(|kept| kept.is_idle());
        idle.map(|kept| kept.bytes).sum()
    }

    /// Drops the least recently used body of those for which `some` is true.
    fn evict(&mut self, some: impl Fn(&Kept) -> bool) -> Option<Arc<Prepared>> {
        let found = self.kept.iter().filter(|(_, kept)| some(kept));
        let key = *found.min_by_key(|(_, kept)| kept.used)?.0;
        self.counts.evictions += 1;
        Some(self.kept.remove(&key)?.prepared)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn body() -> Prepared {
        let prepared = solver::prepare(&fake::problem(), None, &mut ());
        prepared.unwrap()
    }

    /// Whether bodies with these keys are kept.
    fn kept(bodies: &Bodies, keys: &[u8]) -> Vec<bool> {
        let found = keys.iter().map(|k| bodies.find(&[*k; 32]).is_some());
        found.collect()
    }

    #[test]
    fn the_least_recently_used_goes_first_when_the_limit_is_reached() {
        let mut bodies = Bodies::new(100);
        for k in 1..=3 {
            assert!(bodies.keep([k; 32], body(), 30).is_empty());
        }
        bodies.count_hit(&[1; 32]);
        assert_eq!(bodies.keep([4; 32], body(), 40).len(), 1);
        assert_eq!(kept(&bodies, &[1, 2, 3, 4]), [true, false, true, true]);
        assert_eq!(bodies.keep([5; 32], body(), 100).len(), 3);
        let figures = BodyCache {
            bodies: 1,
            bytes: 100,
            hits: 1,
            misses: 0,
            evictions: 4,
        };
        assert_eq!(bodies.figures(), figures);
    }

    #[test]
    fn a_body_larger_than_the_limit_drops_no_other() {
        let mut bodies = Bodies::new(100);
        assert!(bodies.keep([1; 32], body(), 100).is_empty());
        // it is given back itself
        assert_eq!(bodies.keep([2; 32], body(), 101).len(), 1);
        assert_eq!(kept(&bodies, &[1, 2]), [true, false]);
        assert_eq!(Bodies::new(0).keep([1; 32], body(), 1).len(), 1);
    }

    #[test]
    fn one_of_two_bodies_made_at_the_same_time_is_kept() {
        let mut bodies = Bodies::new(100);
        assert!(bodies.keep([1; 32], body(), 60).is_empty());
        assert_eq!(bodies.keep([1; 32], body(), 70).len(), 1);
        let figures = bodies.figures();
        assert_eq!(
            (figures.bodies, figures.bytes, figures.evictions),
            (1, 70, 0)
        );
    }

    #[test]
    fn only_unused_bodies_are_dropped_the_least_recently_used_first() {
        let mut bodies = Bodies::new(100);
        for k in 1..=4 {
            bodies.keep([k; 32], body(), 10);
        }
        let whole = bodies.find(&[1; 32]).unwrap().0;
        let only_body = bodies.find(&[2; 32]).unwrap().0.body.clone();
        assert_eq!(bodies.idle_bytes(), 20);
        assert_eq!(bodies.shrink_idle(10).len(), 1);
        assert_eq!(kept(&bodies, &[1, 2, 3, 4]), [true, true, false, true]);
        drop(whole);
        assert_eq!(bodies.idle_bytes(), 20);
        assert_eq!(bodies.shrink_idle(0).len(), 2);
        assert_eq!(kept(&bodies, &[1, 2, 3, 4]), [false, true, false, false]);
        drop(only_body);
        assert_eq!(bodies.shrink_idle(0).len(), 1);
        assert_eq!(bodies.figures().bytes, 0);
    }

    #[test]
    fn the_number_of_small_bodies_is_limited() {
        let mut bodies = Bodies::new(u64::MAX);
        let body = body();
        for k in 0..MOST_BODIES + 5 {
            let mut key = [0; 32];
            key[..8].copy_from_slice(&k.to_le_bytes());
            bodies.keep(key, body.clone(), 1);
        }
        let figures = bodies.figures();
        assert_eq!((figures.bodies, figures.evictions), (MOST_BODIES as u64, 5));
    }
}
