//! Reports of a solver that are stored together.

use std::sync::Arc;

use base::{event::Payload, sweep::MemberRow, time::Time};
use store::Parts;
use tokio::sync::OwnedSemaphorePermit;

/// The most events in a batch.
const MOST_EVENTS: usize = 50;
/// The most members of a sweep in a batch.
const MOST_MEMBERS: usize = 200;

/// Reports of a solver that are stored together. The solver sends each report as a batch of its own, and the recorder
/// combines these batches.
#[derive(Debug, Default)]
pub(super) struct Batch {
    pub(super) events: Vec<(Time, Payload)>,
    /// The results of members of a sweep.
    pub(super) members: Vec<(Time, MemberRow)>,
    /// A partial result that the solver has reported after the events.
    pub(super) partial: Option<Arc<Parts>>,
    /// The memory for a partial result that came from a worker elsewhere, until it is stored.
    pub(super) room: Option<OwnedSemaphorePermit>,
    /// Whether the problem has one load level on one grid, so that the job ends with its iterations.
    pub(super) one_level: bool,
    /// The number of reports in the batch.
    pub(super) reports: u64,
    /// Whether the solver has ended, so that this is the last batch.
    pub(super) last: bool,
}

impl Batch {
    /// Adds what was reported later.
    pub(super) fn add(&mut self, more: Batch) {
        self.events.extend(more.events);
        self.members.extend(more.members);
        if more.partial.is_some() {
            (self.partial, self.room) = (more.partial, more.room);
        }
        self.one_level |= more.one_level;
        self.reports += more.reports;
    }

    /// Whether more may be added.
    pub(super) fn is_open(&self) -> bool {
        self.events.len() < MOST_EVENTS
            && self.members.len() < MOST_MEMBERS
            && self.partial.is_none()
            && !self.last
    }
}
