//! Memory and time that a problem needs, estimated before anything is built.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;

use super::{ContactModel, Model};
use crate::error::{Reason, Violation};
use crate::problem::{FrictionPoints, MeshSource, Problem, Refine, Smoothing};

/// The cost of solving a problem on one core.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Estimate {
    /// The number of displacement components, supported ones included.
    pub dofs: u64,
    /// The peak memory (bytes), overestimated rather than underestimated.
    pub memory_bytes: u64,
    /// The time on one thread of a machine of 2024 (seconds): between one and several times the actual time, if
    /// friction needs no more iterations than usual. For adaptive refinement, the time of the largest mesh.
    pub run_s: f64,
}

/// The most elements of a mesh of adaptive refinement.
pub const MOST_ADAPTIVE_ELEMENTS: usize = 60_000;

/// The most elements at one contact of a mesh of adaptive refinement: the dense system of a contact grows with their
/// square.
pub const MOST_ADAPTIVE_CONTACT_ELEMENTS: usize = 600;

/// The most elements of the mesh on which the last mesh of adaptive refinement is verified: as many as refinement
/// itself may make, or as the first mesh has after it is split in two.
#[derive(Clone, Debug)]
pub struct MostElements {
    /// The most elements in total.
    pub elements: usize,
    /// The most elements at each contact.
    pub at_contacts: Vec<usize>,
}

impl MostElements {
    /// The limits for adaptive refinement that starts from the model `first`.
    pub fn of(first: &Model) -> Self {
        let at_contact = |contact: &ContactModel| {
            MOST_ADAPTIVE_CONTACT_ELEMENTS.max(2 * contact.boundary.edge_count())
        };
        MostElements {
            elements: MOST_ADAPTIVE_ELEMENTS.max(4 * first.mesh.elements.len()),
            at_contacts: first.contacts.iter().map(at_contact).collect(),
        }
    }
}

/// The size of a stored mesh, for the estimate.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshSize {
    /// The number of elements.
    pub elements: u64,
    /// The number of sides of each boundary.
    pub boundaries: BTreeMap<String, u64>,
}

/// The numbers that the cost depends on.
#[derive(Clone, Copy, Debug, Default)]
struct Size {
    nodes: f64,
    /// The number of unknowns on all contacts.
    contact: f64,
    /// The number of entries of all averages.
    weights: f64,
    /// The number of friction points on all contacts.
    points: f64,
    /// The number of nodes and friction points on all contacts, which have results for each step.
    profile: f64,
    /// 1 if an obstacle has an unknown motion, else 0.
    relative: f64,
    /// The number of contacts, each with a summary and warnings for each step.
    contacts: f64,
    steps: f64,
    increments: f64,
    /// How many times the contacts are solved: once, and again for comparisons.
    repeats: f64,
}

/// The number of bytes of a mesh file for one element, underestimated rather than overestimated: in the larger files
/// that Gmsh writes, an element of second order with its nodes takes about 150 bytes, one of first order 100.
const BYTES_PER_ELEMENT: f64 = 80.0;

/// The most elements that can be numbered, with up to eight nodes each.
const MOST_ELEMENTS: f64 = u32::MAX as f64 / 8.0;

/// Estimates memory and time from the number of elements alone: a lower bound of [`Model::estimate`], by which a
/// problem is refused before it is meshed. `stored`: the size of the mesh that the problem names by its hash.
///
/// # Errors
///
/// One violation if the elements are too many to be numbered (2³² / 8).
pub fn estimate(problem: &Problem, stored: Option<&MeshSize>) -> Result<Estimate, Violation> {
    let mesh = &problem.mesh;
    // nodes of an element in a large mesh: of triangles fewer
    let between = |lines: usize| lines.saturating_sub(1) as f64;
    let (elements, nodes) = match &mesh.source {
        MeshSource::Grid(_) | MeshSource::Grids(_) => {
            let grids = mesh.grids().into_iter();
            let elements = grids.map(|grid| between(grid.x.len()) * between(grid.y.len()));
            (elements.sum(), 3.0)
        }
        MeshSource::Inline(inline) => (inline.elements.len() as f64, 2.0),
        MeshSource::Gmsh(text) | MeshSource::Abaqus(text) => {
            (text.len() as f64 / BYTES_PER_ELEMENT, 2.0)
        }
        MeshSource::Stored(_) => (stored.map_or(0.0, |size| size.elements as f64), 2.0),
    };
    let times = match mesh.refine {
        Refine::Times(times) => times,
        Refine::Adaptive(_) => 0,
    };
    // powers of two as floats end in infinity, and nothing overflows
    let elements = 4f64.powi(times.min(1000) as i32) * elements;
    let all = if problem.solver.verifies() {
        4.0 * elements
    } else {
        elements
    };
    if all > MOST_ELEMENTS {
        let (place, found) = match times {
            _ if elements <= MOST_ELEMENTS => (
                "/solver/accuracy",
                format!("`verify`, on {all:.1e} elements"),
            ),
            0 => ("/mesh", format!("{elements:.1e} elements")),
            _ => ("/mesh/refine", format!("{times}: {elements:.1e} elements")),
        };
        return Err(Violation::new(
            place,
            Reason::TooLarge,
            found,
            format!("at most {MOST_ELEMENTS:.1e} elements"),
            "Each refinement divides every element into four.",
        ));
    }
    let size = Size {
        nodes: nodes * elements,
        ..Size::default()
    };
    let own = size.estimate(1.0);
    Ok(if problem.solver.verifies() {
        Estimate {
            dofs: own.dofs,
            ..size.split().estimate(1.0)
        }
    } else {
        own
    })
}

impl Model {
    /// Estimates the cost of solving this model of `problem`, overestimated rather than underestimated. For adaptive
    /// refinement it is the cost of the largest mesh. With `accuracy: verify` the refined mesh is counted too.
    pub fn estimate(&self, problem: &Problem) -> Estimate {
        let adaptive = matches!(problem.mesh.refine, Refine::Adaptive(_));
        let own = self.size(adaptive);
        let solved = own.estimate(MARGIN);
        if !problem.solver.verifies() {
            return solved;
        }
        let halved = if adaptive {
            self.largest_halved(&own)
        } else {
            own.split()
        };
        let compared = Size {
            // no step is reported, nothing assessed, and no solution looked for once more
            steps: 1.0,
            repeats: 1.0,
            ..halved
        };
        let compared = compared.estimate(MARGIN);
        Estimate {
            dofs: solved.dofs,
            memory_bytes: solved
                .memory_bytes
                .max(compared.memory_bytes.saturating_add(own.held())),
            // the mesh of one refinement less takes a fraction
            run_s: 1.3 * solved.run_s + compared.run_s,
        }
    }

    /// The cost of this mesh alone.
    pub fn estimate_of_mesh(&self) -> Estimate {
        self.size(false).estimate(MARGIN)
    }

    /// The size of the largest mesh on which the last mesh of adaptive refinement is verified. `own`: the size of this
    /// model.
    fn largest_halved(&self, own: &Size) -> Size {
        let most = MostElements::of(self);
        let at_contacts: f64 = most.at_contacts.iter().map(|most| *most as f64).sum();
        let along = self.contacts.iter().zip(&most.at_contacts);
        let weights = along.filter(|(contact, _)| acts(contact));
        let weights = weights.map(|(_, most)| every_average(*most as f64).weights);
        Size {
            nodes: own.nodes.max(NODES * most.elements as f64),
            contact: own.contact.max(4.0 * at_contacts + 2.0),
            weights: weights.sum(),
            profile: own.profile.max(5.0 * at_contacts),
            ..*own
        }
    }

    fn size(&self, adaptive: bool) -> Size {
        let nodes = self.mesh.nodes.len() as f64;
        let contacts = self.contacts.iter();
        let contacts = contacts.map(|contact| Along::new(contact, adaptive));
        let all = contacts.fold(Along::default(), |all, one| Along {
            nodes: all.nodes + one.nodes,
            points: all.points + one.points,
            weights: all.weights + one.weights,
        });
        let pairs = self
            .contacts
            .iter()
            .filter_map(|contact| contact.pair.as_ref());
        let facing: f64 = pairs.map(|pair| pair.nodes.len() as f64).sum();
        let controls = &self.controls;
        let again = u32::from(controls.check_uniqueness)
            + 2 * u32::from(controls.check_increments)
            + 2 * u32::from(self.depends_on_path());
        let measured = self.contacts.iter().any(|contact| contact.measured);
        let samples = u32::from(measured) * Smoothing::SAMPLES;
        let increments: f64 = self.steps.iter().map(|s| f64::from(s.increments)).sum();
        Size {
            nodes: if adaptive {
                nodes.max(NODES * MOST_ADAPTIVE_ELEMENTS as f64)
            } else {
                nodes
            },
            contact: 2.0 * (all.nodes + facing),
            weights: all.weights,
            points: all.points,
            // of the other side there is a profile, too
            profile: all.nodes + all.points + facing,
            relative: f64::from(u8::from(self.contacts.iter().any(is_relative))),
            contacts: self.contacts.len() as f64,
            steps: self.steps.len().max(1) as f64,
            increments: increments.max(1.0),
            repeats: f64::from(1 + again + samples),
        }
    }
}

/// The number of nodes for each element of a large mesh, overestimated.
const NODES: f64 = 3.1;

/// By how much the factors of meshes of other shapes may exceed the factors of the meshes that the estimate is fitted
/// to.
const MARGIN: f64 = 1.2;

impl Size {
    /// The size after every element is split in two in each direction: an average reaches twice as many nodes from
    /// twice as many points.
    fn split(&self) -> Size {
        let of_points = (POINT + BESIDE) * self.points;
        Size {
            nodes: 4.0 * self.nodes,
            contact: 2.0 * self.contact,
            weights: 4.0 * (self.weights - of_points).max(0.0) + 2.0 * of_points,
            points: 2.0 * self.points,
            profile: 2.0 * self.profile,
            ..*self
        }
    }

    /// The memory that a solution takes, with its mesh and all steps, while another solution is computed (bytes).
    fn held(&self) -> u64 {
        (500.0 * self.nodes + self.history()) as u64
    }

    /// The cost for this size. The constants for memory are compared with measurements by
    /// `server/service/src/queue/tests/estimates.rs`, the constants for time by `tests/bench/estimates.py`.
    fn estimate(&self, margin: f64) -> Estimate {
        let dofs = 2.0 * self.nodes;
        let contact = self.contact;
        // entries of the factor, and of the fronts that wait, for each unknown away from contact
        let fill = (10.6 * dofs.max(2.0).log2() - 27.0).max(40.0);
        // Fronts of parts of the contact wait, too. Beside them Ŝ, and a matrix of the same size that is factored
        // (Cholesky's or Newton's).
        let factor = margin * fill * dofs + 0.8 * contact * contact;
        // with unknown motions of obstacles, the stiffness on displacements relative to them, too
        let dense = (2.0 + self.relative) * contact * contact;
        // mesh and structure of the factor; later displacements and stresses, and the stored result
        let of_nodes = 1500.0 * margin * self.nodes;
        let memory = 8.0 * (factor + dense + self.weights) + of_nodes + self.history() + FLOOR;
        // of an uneven mesh; then one elimination of the contact, and for each increment a few updates of it
        let linear = 2e-6 * dofs + 3.5e-9 * dofs.powf(1.5);
        let increments = self.increments * (3e-4 + 6e-9 * contact * contact);
        let contacts = self.repeats * (3e-11 * contact.powi(3) + increments);
        let time = linear + contacts + 2.5e-6 * self.weights;
        Estimate {
            dofs: dofs as u64,
            memory_bytes: memory as u64,
            run_s: time,
        }
    }

    /// The memory for the history (bytes). Profiles and rows are held as numbers and as text; a step is also part of a
    /// partial result, a copy of all steps so far and their text.
    fn history(&self) -> f64 {
        let of_step = 2e4 + PER_CONTACT * self.contacts + 1000.0 * self.profile;
        1.2e4 * self.increments + self.steps * of_step + 300.0 * self.profile
    }
}

/// The memory for each contact of a step apart from its profiles (bytes): a summary and its warnings, and the
/// descriptions of three profiles as parts of the result.
const PER_CONTACT: f64 = 4e3;

/// The memory for the smallest problem, most of it for compressing its result (bytes).
const FLOOR: f64 = 393_216.0;

/// The numbers of [`Size`] that come from contacts.
#[derive(Clone, Copy, Debug, Default)]
struct Along {
    nodes: f64,
    points: f64,
    /// The entries of the averages.
    weights: f64,
}

impl Along {
    fn new(contact: &ContactModel, adaptive: bool) -> Along {
        let s = &contact.boundary.s;
        if adaptive {
            let elements = (MOST_ADAPTIVE_CONTACT_ELEMENTS as f64).max(0.5 * s.len() as f64);
            let along = every_average(elements);
            return if acts(contact) {
                along
            } else {
                Along {
                    weights: 0.0,
                    ..along
                }
            };
        }
        let friction = contact.friction.as_ref().filter(|_| acts(contact));
        let mut along = Along {
            nodes: s.len() as f64,
            ..Along::default()
        };
        let Some(law) = friction else { return along };
        let radius = law.bound.averaged_over().unwrap_or(0.0);
        // nodes of the edges that an average reaches: an edge has up to four beyond those within the radius
        let mut add = |at: f64| {
            let first = s.partition_point(|node| *node < at - radius);
            let last = s.partition_point(|node| *node <= at + radius);
            along.points += 1.0;
            along.weights += (last - first) as f64 + BESIDE + POINT;
        };
        match law.points {
            FrictionPoints::Gauss3 => contact
                .boundary
                .friction_points
                .iter()
                .for_each(|p| add(p.s)),
            FrictionPoints::Nodal => s.iter().for_each(|at| add(*at)),
        }
        along
    }
}

/// Whether what lies opposite a contact has an unknown motion: an obstacle with a load, or another body.
fn is_relative(contact: &ContactModel) -> bool {
    let tool = contact.tool.as_ref();
    contact.pair.is_some() || tool.is_some_and(|tool| tool.free().next().is_some())
}

/// Whether friction acts at a contact.
fn acts(contact: &ContactModel) -> bool {
    let law = contact.friction.as_ref();
    law.is_some_and(|law| law.bound.acts())
}

/// The numbers of a contact with `elements` elements, if every average reaches all nodes.
fn every_average(elements: f64) -> Along {
    let (nodes, points) = (2.0 * elements + 1.0, 3.0 * elements);
    Along {
        nodes,
        points,
        weights: nodes * points,
    }
}

/// The memory for a friction point apart from its average, as a number of entries of an average.
const POINT: f64 = 24.0;

/// The number of nodes that an average reaches beyond those within the radius.
const BESIDE: f64 = 4.0;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn problem(refine: u32, lines: u32) -> Problem {
        let y: Vec<u32> = (0..lines).collect();
        let problem = serde_json::json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {
                "grid": {"x": [0, 1], "y": y},
                "boundaries": {"wall": {"normal": [1, 0]}},
                "refine": refine
            },
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "uy": 0}],
            "contacts": [{
                "boundary": "wall",
                "obstacle": {"kind": "flat", "from": 0, "to": lines - 1},
                "indentation": 0.01,
                "friction": {"coefficient": 0.3, "nonlocal_radius": 2, "elastic_slip": 1e-4}
            }]
        });
        serde_json::from_value(problem).unwrap()
    }

    #[test]
    fn a_refinement_beyond_all_numbers_is_a_violation_of_its_field() {
        for times in [15, 100, u32::MAX] {
            let violation = estimate(&problem(times, 6), None).unwrap_err();
            let found = (&violation.pointer[..], violation.reason);
            assert_eq!(found, ("/mesh/refine", Reason::TooLarge));
        }
        assert!(estimate(&problem(10, 6), None).unwrap().memory_bytes > 1 << 30);
    }

    /// A contact counts by its nodes and not by its name, and its dense matrices are most of the memory of a long one.
    #[test]
    fn a_contact_is_counted_by_its_nodes_and_not_by_its_name() {
        let problem = problem(0, 1001);
        let first = estimate(&problem, None).unwrap().memory_bytes;
        let model = Model::new(&problem, None).unwrap();
        let told = model.estimate(&problem).memory_bytes;
        let dense = 8 * 4002 * 4002;
        assert!(3 * dense < told && told < 5 * dense, "{told}");
        assert!(first < told / 20, "{first}");
    }

    #[test]
    fn steps_and_wide_averages_are_counted() {
        let told = |problem: &Problem| {
            let model = Model::new(problem, None).unwrap();
            model.estimate(problem).memory_bytes
        };
        let mut problem = problem(0, 101);
        let plain = told(&problem);
        problem.steps = vec![crate::problem::Step::whole(); 1000];
        assert!(told(&problem) - plain > 1000 * 400 * 500);
        problem.steps.clear();
        let friction = problem.contacts[0].friction.as_mut().unwrap();
        friction.nonlocal_radius = Some(100.0);
        assert!(told(&problem) - plain > 8 * 300 * 180);
    }
}
