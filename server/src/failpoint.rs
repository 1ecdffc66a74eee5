//! Points at which a test makes a job fail, with a panic or an error: the boundaries between the stages of its life.
//! In other builds there is nothing at them.

use solver::solution::Phase;

use crate::job::JobId;

pub(crate) use points::fails;
#[cfg(test)]
pub(crate) use points::{Failing, set, was_missed};

/// A boundary between two stages of a job, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(test, derive(strum::VariantArray))]
pub(crate) enum Point {
    /// It is accepted, but that is not committed.
    Accepted,
    /// That is committed, but not answered.
    Answered,
    /// It is claimed, but that is not committed.
    Claimed,
    /// That is committed, but no worker has it.
    Given,
    /// A worker has it.
    Begun,
    /// Its mesh is read, if it refers to one.
    MeshRead,
    /// Its problem is read, which has one load level.
    Parsed,
    /// A phase of the solver begins.
    Meshing,
    Assembling,
    Ordering,
    Factoring,
    Condensing,
    Iterating,
    Recovering,
    Verifying,
    /// It has events that are not stored.
    EventsReported,
    /// They are stored, but not announced.
    EventsStored,
    /// It has a partial result that is not stored.
    PartialReported,
    /// It has a result, of which nothing is stored.
    Solved,
    /// All but the last pieces of it are stored.
    AlmostStored,
    /// It has ended, but that is not committed.
    Ended,
    /// That is committed, but not announced.
    Unannounced,
    /// Its worker is done with it.
    Done,
}

impl Point {
    /// The beginning of a phase; none for the one before the solver.
    pub(crate) fn beginning_of(phase: Phase) -> Option<Point> {
        Some(match phase {
            Phase::Parse => return None,
            Phase::Mesh => Point::Meshing,
            Phase::Assemble => Point::Assembling,
            Phase::Order => Point::Ordering,
            Phase::Factor => Point::Factoring,
            Phase::Condense => Point::Condensing,
            Phase::Iterate => Point::Iterating,
            Phase::Recover => Point::Recovering,
            Phase::Verify => Point::Verifying,
        })
    }
}

/// Lets a job fail at a point where the caller cannot return an error.
#[inline]
pub(crate) fn pass(point: Point, job: JobId) {
    fails(point, job);
}

#[cfg(not(test))]
mod points {
    use super::{JobId, Point};

    /// Whether the caller is to return an error for this job.
    #[inline]
    pub(crate) fn fails(_: Point, _: JobId) -> bool {
        false
    }
}

#[cfg(test)]
mod points {
    use std::sync::{Mutex, PoisonError};

    use super::{JobId, Point};

    /// How a job fails at a point.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub(crate) enum Failing {
        Panic,
        Error,
    }

    /// What is to fail, each once. Tests run beside each other, and so each names its job.
    static SET: Mutex<Vec<(Point, JobId, Failing)>> = Mutex::new(vec![]);

    fn remove(point: Point, job: JobId) -> Option<Failing> {
        let mut set = SET.lock().unwrap_or_else(PoisonError::into_inner);
        let place = set.iter().position(|one| (one.0, one.1) == (point, job))?;
        Some(set.swap_remove(place).2)
    }

    /// Lets this job fail once, when it comes to this point.
    pub(crate) fn set(point: Point, job: JobId, failing: Failing) {
        let mut set = SET.lock().unwrap_or_else(PoisonError::into_inner);
        set.push((point, job, failing));
    }

    /// Whether it has not come there; it does not fail there any more.
    pub(crate) fn was_missed(point: Point, job: JobId) -> bool {
        remove(point, job).is_some()
    }

    /// Whether the caller is to return an error for this job; or panics.
    pub(crate) fn fails(point: Point, job: JobId) -> bool {
        match remove(point, job) {
            #[allow(clippy::panic)]
            Some(Failing::Panic) => panic!("{point:?}, as a test wants it"),
            Some(Failing::Error) => true,
            None => false,
        }
    }
}
