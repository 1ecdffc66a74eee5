//! A task, as a worker solves it.

use std::panic::{AssertUnwindSafe, catch_unwind};

use base::{memory::Allowance, run::Solve};
use serde::{Deserialize, Serialize};
use store::MembersTask;

use super::{
    super::{
        ending::{NoSolution, Solved, panicked},
        solving::{read_mesh, solve_task},
        supervisor::Supervisor,
    },
    messages::End,
    packed::Packed,
};

/// What a worker is to solve.
#[derive(Debug, Serialize, Deserialize)]
pub struct Task {
    /// The problem as JSON.
    pub problem: String,
    /// The members of a sweep that are solved together with the problem.
    pub members: Option<MembersTask>,
    /// How many threads may share its work; `None`: the worker decides.
    pub threads: Option<usize>,
}

/// Solves a task on this thread, on the stored form of the mesh that its problem names; returns the end of the attempt, and
/// the result if there is one, `hashed` or not. Call this on a blocking thread.
pub fn solve_leased(
    task: &Task,
    mesh: Option<&[u8]>,
    solve: Solve,
    allowance: Allowance<'_>,
    hashed: bool,
    supervisor: &mut dyn Supervisor,
) -> (End, Option<Packed>) {
    let solving = || {
        let mesh = mesh.map(read_mesh).transpose()?;
        let members = task.members.as_ref();
        let solved = solve_task(&task.problem, mesh, members, solve, allowance, supervisor)?;
        let Solved {
            ending,
            unverified,
            iterations,
            parts,
        } = solved;
        let end = End::Solved {
            ending,
            unverified,
            iterations,
        };
        let packed = Packed::new(parts, hashed);
        let packed = packed.map_err(|error| NoSolution::Internal(error.to_string()))?;
        Ok((end, Some(packed)))
    };
    // what a panic leaves behind is not used again
    catch_unwind(AssertUnwindSafe(solving))
        .unwrap_or_else(|panic| Err(NoSolution::Internal(panicked("the solver", &*panic))))
        .unwrap_or_else(|no_solution| (End::NoSolution(no_solution), None))
}
