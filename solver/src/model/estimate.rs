//! Memory and time that a problem needs, estimated before anything is built.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;

use crate::problem::{MeshInput, MeshSource, Problem, Refine};

/// The cost of solving a problem on one core.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Estimate {
    /// Displacements, supported ones included.
    pub dofs: u64,
    /// Peak memory (bytes), overestimated rather than underestimated.
    pub memory_bytes: u64,
    /// Time (seconds).
    pub run_s: f64,
}

/// Most elements of a mesh of adaptive refinement.
pub const MOST_ADAPTIVE_ELEMENTS: usize = 60_000;

/// Most lines of such a mesh in one direction: the dense system of the contact grows with their square.
pub const MOST_ADAPTIVE_LINES: usize = 600;

/// Size of a stored mesh, for the estimate.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshSize {
    /// Elements.
    pub elements: u64,
    /// Sides of each boundary.
    pub boundaries: BTreeMap<String, u64>,
}

/// Bytes of a mesh file for one element, underestimated rather than overestimated: in the larger files that
/// Gmsh writes an element of second order has about 150 with its nodes, one of first order 100.
const BYTES_PER_ELEMENT: f64 = 80.0;

/// Bytes of history of an increment: about twenty rows, kept for the step and for the whole.
const INCREMENT: f64 = 1e4;

/// Estimates from the numbers of elements alone; the constants are measured in `docs/performance.md`.
/// `stored`: the mesh that the problem names by its hash, if it does.
pub fn estimate(problem: &Problem, stored: Option<&MeshSize>) -> Estimate {
    let mesh = &problem.mesh;
    let split = 4f64.powi(halvings(mesh));
    let adaptive = matches!(mesh.refine, Refine::Adaptive(_));
    let elements = match &mesh.source {
        MeshSource::Grid(grid) => {
            grid.x.len().saturating_sub(1) as f64 * grid.y.len().saturating_sub(1) as f64
        }
        MeshSource::Inline(inline) => inline.elements.len() as f64,
        MeshSource::Gmsh(text) | MeshSource::Abaqus(text) => text.len() as f64 / BYTES_PER_ELEMENT,
        MeshSource::Stored(_) => stored.map_or(0.0, |size| size.elements as f64),
    };
    // A large mesh has three nodes an element, a small one up to eight.
    let n = match adaptive {
        // the largest mesh of the refinement
        true => elements.max(MOST_ADAPTIVE_ELEMENTS as f64),
        false => split * elements,
    };
    let nodes = (3.0 * n + 4.0 * n.sqrt() + 1.0).min(8.0 * n);
    let dofs = 2.0 * nodes;
    // fill of a minimum-degree factor in the plane grows like n log n
    let fill = dofs * dofs.max(2.0).log2();
    let contact = match adaptive {
        true => 4.0 * (MOST_ADAPTIVE_LINES * problem.contacts.len()) as f64,
        false => contact_dofs(problem, stored, n.sqrt()),
    };
    let increments: f64 = problem.steps.iter().map(|s| f64::from(s.increments)).sum();
    let memory = 1500.0 * dofs + 95.0 * fill + 60.0 * contact * contact + INCREMENT * increments;
    let once_more = 1
        + u32::from(problem.solver.check_uniqueness)
        + 2 * u32::from(problem.solver.check_increments);
    let iterations = increments.max(1.0) * f64::from(once_more);
    let time = 6e-6 * dofs + 4e-9 * dofs.powf(1.5) + 1e-9 * contact.powi(3) * iterations;
    // floats saturate when cast: an impossibly large problem gets the largest number
    Estimate {
        dofs: dofs as u64,
        memory_bytes: memory as u64,
        run_s: time,
    }
}

fn halvings(mesh: &MeshInput) -> i32 {
    match mesh.refine {
        Refine::Times(times) => times.min(64) as i32,
        Refine::Adaptive(_) => 0,
    }
}

/// Unknowns on the contact boundaries: two for each of two nodes per edge, taken from the sides of
/// the mesh.
fn contact_dofs(problem: &Problem, stored: Option<&MeshSize>, side: f64) -> f64 {
    let mesh = &problem.mesh;
    let split = 2f64.powi(halvings(mesh));
    let edges = |name: &str| {
        let given = match &mesh.source {
            MeshSource::Grid(grid) if name == "left" || name == "right" => Some(grid.y.len()),
            MeshSource::Grid(grid) => Some(grid.x.len()),
            MeshSource::Inline(inline) => inline.boundaries.get(name).map(Vec::len),
            MeshSource::Gmsh(_) | MeshSource::Abaqus(_) => None,
            MeshSource::Stored(_) => stored
                .and_then(|size| size.boundaries.get(name))
                .map(|edges| *edges as usize),
        };
        given.map_or(side, |edges| edges as f64 * split)
    };
    let name = |boundary: &str| {
        mesh.boundaries
            .get(boundary)
            .and_then(|part| part.side.clone())
            .unwrap_or_else(|| boundary.to_owned())
    };
    problem
        .contacts
        .iter()
        .map(|contact| 4.0 * edges(&name(&contact.boundary)))
        .sum()
}
