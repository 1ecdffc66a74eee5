//! What the solver tells an observer while it solves, and what it asks.

use crate::error::SolveError;
use crate::phase::Phase;
use crate::solution::{Iteration, Solution, Warning};

/// Follows a solution: receives its progress, and answers the solver's questions.
///
/// By default an observer lets the solver go on to the end on one thread, with all the memory it needs; so does `()`,
/// which ignores all progress. A closure that takes [`Progress`] receives progress only. An observer in front of
/// another observer passes on the questions that it does not answer itself.
pub trait Observer {
    /// Receives the progress of the solution.
    fn event(&mut self, progress: Progress<'_>);

    /// Whether the solver should stop. The solver asks after each phase and iteration, and again and again in long
    /// work; after the first `true` the observer should always return `true`.
    fn stop(&mut self) -> bool {
        self.behind().is_some_and(|observer| observer.stop())
    }

    /// Whether the solver may take `bytes` more bytes at once. If not, a solver that cannot go on without them reports
    /// [`Progress::OutOfMemory`]; otherwise it does with less, or ends with the results so far.
    fn may_use(&mut self, bytes: u64) -> bool {
        self.behind().is_none_or(|observer| observer.may_use(bytes))
    }

    /// How many threads may share the next work, at least 1: the solver uses one or two. No result depends on their
    /// number.
    fn threads(&mut self) -> usize {
        self.behind().map_or(1, |observer| observer.threads())
    }

    /// The observer behind this one, if there is one: it answers the questions that this observer does not answer
    /// itself.
    fn behind(&mut self) -> Option<&mut dyn Observer> {
        None
    }
}

/// The progress of a solution.
#[derive(Debug)]
pub enum Progress<'a> {
    /// A phase begins.
    Phase(Phase),
    /// An iteration is done.
    Iteration(&'a Iteration),
    /// Adaptive refinement begins to solve on a mesh, or returns to the mesh before, whose results are final.
    Refinement {
        /// The number of the mesh, from 1.
        number: u32,
        /// The number of elements of the mesh.
        elements: u64,
        /// Largest relative error on the mesh before; absent for the first mesh, and where the error is unknown.
        error: Option<f64>,
    },
    /// An iteration is done on a mesh of adaptive refinement that may not be the last. If it turns out to be the last,
    /// all its iterations are reported again. The iterations of the next mesh are counted from 1.
    Tentative(&'a Iteration),
    /// A warning, as soon as it is known; all warnings are repeated in the summary.
    Warning(&'a Warning),
    /// A load step that is not the last has ended: the solution so far, without fields. Sent for problems with several
    /// steps only, and not on the meshes of adaptive refinement.
    Step(&'a Solution),
    /// A mesh of adaptive refinement is solved, and a finer one follows: the solution on it, without fields.
    Mesh(&'a Solution),
    /// The solution cannot go on without this memory, which the observer or the machine refuses. An observer that does
    /// not stop the solver now gets a solution that has not converged, or an error.
    OutOfMemory {
        /// The number of bytes that were needed.
        bytes: u64,
    },
}

impl Observer for () {
    fn event(&mut self, _: Progress<'_>) {}
}

impl<F: FnMut(Progress<'_>)> Observer for F {
    fn event(&mut self, progress: Progress<'_>) {
        self(progress)
    }
}

/// Tells the observer the progress; an error if the solution is to stop.
pub(crate) fn notify(
    observer: &mut dyn Observer,
    progress: Progress<'_>,
) -> Result<(), SolveError> {
    observer.event(progress);
    go_on(observer)
}

/// An error if the solution is to stop.
pub(crate) fn go_on(observer: &mut dyn Observer) -> Result<(), SolveError> {
    match observer.stop() {
        true => Err(SolveError::Stopped),
        false => Ok(()),
    }
}

/// Asks the observer for memory that the solution cannot do without; an error if the memory is refused.
pub(crate) fn take(observer: &mut dyn Observer, bytes: u64) -> Result<(), SolveError> {
    if observer.may_use(bytes) {
        return Ok(());
    }
    observer.event(Progress::OutOfMemory { bytes });
    Err(SolveError::Stopped)
}

/// An observer in front of another one, which sees only what `seen` makes of the progress.
pub(crate) struct Filtered<'a> {
    pub(crate) observer: &'a mut dyn Observer,
    pub(crate) seen: fn(Progress<'_>) -> Option<Progress<'_>>,
}

impl Observer for Filtered<'_> {
    fn event(&mut self, progress: Progress<'_>) {
        if let Some(progress) = (self.seen)(progress) {
            self.observer.event(progress);
        }
    }

    fn behind(&mut self) -> Option<&mut dyn Observer> {
        Some(self.observer)
    }
}
