//! Points between the stages of a job's life at which a test can make it fail, by a panic or an error. The program sets
//! no failures; passing a point then costs the reading of one flag.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use parking_lot::Mutex;
use solver::solution::Phase;

use crate::job::JobId;

/// A boundary between two stages of a job, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, strum::VariantArray)]
pub enum Point {
    /// The job is accepted, but the acceptance is not committed.
    Accepted,
    /// The acceptance of the job is committed, but the client has no response yet.
    Answered,
    /// The job is claimed, but the claim is not committed.
    Claimed,
    /// The claim is committed, but no worker has the job.
    Given,
    /// A worker has the job.
    Begun,
    /// The job's mesh is read, if it refers to one.
    MeshRead,
    /// The job's problem is read; it has one load level.
    Parsed,
    /// The phase begins in which the mesh is made.
    Meshing,
    /// The phase begins in which the stiffness is assembled.
    Assembling,
    /// The phase begins in which the unknowns are ordered.
    Ordering,
    /// The phase begins in which the stiffness is factored.
    Factoring,
    /// The phase begins in which the stiffness is condensed to the contact boundary.
    Condensing,
    /// The iterations begin.
    Iterating,
    /// The phase begins in which displacements and stresses are recovered.
    Recovering,
    /// The phase begins in which the result is compared with that of a finer mesh.
    Verifying,
    /// The job has events that are not stored.
    EventsReported,
    /// The events are stored, but not announced.
    EventsStored,
    /// The job has a partial result that is not stored.
    PartialReported,
    /// The job has a result of which nothing is stored.
    Solved,
    /// All but the last pieces of the result are stored.
    AlmostStored,
    /// The job has ended, but its end is not committed.
    Ended,
    /// The job's end is committed, but not announced.
    Unannounced,
    /// The worker has finished with the job.
    Done,
}

impl Point {
    /// The failpoint at the beginning of a phase; `None` for the phase before the solver.
    pub fn beginning_of(phase: Phase) -> Option<Point> {
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

/// Makes a job fail at a point where the caller cannot return an error: panics if a failure is set.
#[inline]
pub fn pass(point: Point, job: JobId) {
    fails(point, job);
}

/// The way in which a job fails at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failing {
    /// The job panics.
    Panic,
    /// The operation returns an error.
    Error,
}

/// The failures that are set, each for one use and one job, since tests run in parallel.
static SET: Mutex<Vec<(Point, JobId, Failing)>> = Mutex::new(vec![]);

/// Whether anything was ever set to fail.
static ARMED: AtomicBool = AtomicBool::new(false);

fn remove(point: Point, job: JobId) -> Option<Failing> {
    let mut set = SET.lock();
    let place = set.iter().position(|one| (one.0, one.1) == (point, job))?;
    Some(set.swap_remove(place).2)
}

/// Makes this job fail once, when it comes to this point.
pub fn set(point: Point, job: JobId, failing: Failing) {
    let mut set = SET.lock();
    set.push((point, job, failing));
    ARMED.store(true, Relaxed);
}

/// Removes a failure that was set; returns whether the job had not reached the point.
pub fn was_missed(point: Point, job: JobId) -> bool {
    remove(point, job).is_some()
}

/// Whether the caller should return an error for this job; panics if a panic is set.
pub fn fails(point: Point, job: JobId) -> bool {
    if !ARMED.load(Relaxed) {
        return false;
    }
    match remove(point, job) {
        #[allow(clippy::panic)]
        Some(Failing::Panic) => panic!("{point:?}, as a test wants it"),
        Some(Failing::Error) => true,
        None => false,
    }
}
