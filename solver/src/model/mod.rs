//! All checks of a [`Problem`]: the only way to obtain a problem that can be solved.
//!
//! `Model::new` checks everything and reports all violations at once; the [`Model`] that it returns is numbered, and
//! every room above relies on it.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | names of boundaries and groups | `boundaries` |
//! | curves of boundaries | `curves` |
//! | supports | `supports` |
//! | springs between the body and the ground | `springs` |
//! | loads | `loads` |
//! | changes of temperature | `temperatures` |
//! | forces at nodes of the first mesh | `nodes` |
//! | materials | `materials` |
//! | contacts and the obstacles that they face | `contacts` |
//! | checks of obstacles and friction laws | `laws` |
//! | a checked contact | `contact_model` |
//! | common ends of two contacts | `corners` |
//! | obstacles that slide along the body | `sliding` |
//! | obstacles under loads, and their checks | `tool`, `tool_checks` |
//! | another body in place of an obstacle, and its checks | `pair`, `pair_checks` |
//! | rigid motions that nothing prevents | `freedom` |
//! | distinct nodes at one place | `unmerged` |
//! | the axis of a body of revolution | `axis` |
//! | load levels | `level` |
//! | load steps that were probably not meant | `path` |
//! | problems that differ in numbers only | `variable` |
//! | collecting violations and warnings | `checks` |
//! | checks of single numbers | `numbers` |
//! | units that belong together | `units` |
//! | memory and time | `estimate` |

mod axis;
mod boundaries;
mod checks;
mod contact_model;
mod contacts;
mod corners;
mod curves;
pub mod estimate;
mod freedom;
mod laws;
mod level;
mod loads;
mod materials;
mod nodes;
mod numbers;
mod pair;
mod pair_checks;
mod path;
mod sliding;
mod springs;
mod supports;
mod temperatures;
mod tool;
mod tool_checks;
mod units;
mod unmerged;
mod variable;

pub use axis::Axis;
pub use contact_model::ContactModel;
pub use corners::Alone;
pub use freedom::{Hold, RigidMotion};
pub use level::Level;
pub use pair::{FacingCorner, Pair};
pub use supports::Held;
pub use tool::Tool;
pub use variable::VariableModel;

use std::collections::{BTreeMap, BTreeSet};

use checks::Checks;
use nodes::FirstSides;

use crate::elasticity::{self, Inner, Loads, Section, Springs};
use crate::error::{AllChecks, Checked, Violation};
use crate::mesh::{External, ExternalMesh, Mesh};
use crate::problem::{Algorithm, Condition, Contact, History, Problem, SolverControls, Step};
use crate::solution::Warning;

/// The depth above which an obstacle counts as hollow, as a part of the contact's length.
const HOLLOW: f64 = 1e-10;

/// A problem that can be solved.
#[derive(Clone, Debug)]
pub struct Model {
    /// The refined mesh.
    pub mesh: Mesh,
    /// The analysis and the materials.
    pub section: Section,
    /// The axis of a body of revolution.
    pub axis: Axis,
    /// The number of Gauss points of an element in each direction.
    pub quadrature: u32,
    /// Prescribed displacements by node.
    pub fixed: BTreeMap<u32, Held>,
    /// Springs between the body and the ground.
    pub springs: Springs,
    /// The nodes that springs hold, with the directions.
    pub spring_holds: Vec<Hold>,
    /// External forces.
    pub loads: Loads,
    /// Contact boundaries with their obstacles.
    pub contacts: Vec<ContactModel>,
    /// Contact nodes whose displacement is measured along two directions that are not perpendicular: the normals of two
    /// contacts that meet at the node, or the normal and the direction of a support.
    pub oblique: BTreeMap<u32, [[f64; 2]; 2]>,
    /// Common ends of two contacts that belong to one contact alone, since the other contact does not touch there.
    pub alone: Alone,
    /// Contact nodes on the axis that stay open under a hollow of the obstacle: the constraints at them and at the
    /// midside nodes beside them are those of ordinary nodes (formulation 3.5).
    pub open_on_axis: BTreeSet<u32>,
    /// Whether the supports leave a rigid motion free, which contact must prevent.
    pub held_by_contact: bool,
    /// The load steps; if empty, one step leads to the given values.
    pub steps: Vec<Step>,
    /// The tolerance and limits of the solver.
    pub controls: SolverControls,
    /// Warnings known before the solution.
    pub warnings: Vec<Warning>,
}

impl Model {
    /// Checks and numbers a problem. `external`: the problem's mesh, if the problem only names it or contains it as
    /// text.
    ///
    /// # Errors
    ///
    /// All violations of the problem at once, including those of the external mesh; at most a hundred are listed.
    pub fn new(problem: &Problem, external: Option<External>) -> Result<Model, Vec<Violation>> {
        let mut checks = Checks::default();
        let model = checks.model(problem, Source::Given(external));
        checks.found.conclude(model)
    }

    /// Checks and numbers a problem on a refined mesh, which has all names of the first mesh: adaptive refinement makes
    /// a sequence of such meshes, and verification splits the last of them in two.
    ///
    /// # Errors
    ///
    /// All violations of the problem on that mesh.
    pub fn on_mesh(problem: &Problem, given: ExternalMesh) -> Result<Model, Vec<Violation>> {
        let mut checks = Checks {
            warnings: given.warnings,
            ..Checks::default()
        };
        let model = checks.model(problem, Source::Ready(given.mesh));
        checks.found.conclude(model)
    }

    /// The forces per volume and thermal strains at a load level.
    pub fn inner(&self, level: &Level) -> Inner<'_> {
        Inner {
            body_force: self.loads.body_force.times(level.loads),
            thermal: &self.loads.thermal,
            factor: level.loads,
        }
    }

    /// The nodes that belong to two contacts, with the indices of both in `contacts`; without supported nodes, which
    /// always belong to both.
    pub fn common_nodes(&self) -> BTreeMap<u32, [usize; 2]> {
        corners::common(&self.contacts, &self.fixed)
    }

    /// A copy of the model with `alone` as the common nodes that belong to one contact alone.
    pub fn with_alone(&self, alone: Alone) -> Model {
        Model {
            oblique: contacts::oblique(&self.contacts, &self.fixed, &alone),
            alone,
            ..self.clone()
        }
    }

    /// A copy of the model with `open_on_axis` as the contact nodes on the axis that stay open.
    pub fn with_open_on_axis(&self, open_on_axis: BTreeSet<u32>) -> Model {
        Model {
            open_on_axis,
            ..self.clone()
        }
    }

    /// Whether an obstacle is hollow at the axis: before deformation the node there is further from the obstacle than
    /// the midside node beside it.
    pub fn hollow_at_axis(&self) -> bool {
        self.contacts.iter().any(|contact| {
            let ends = self.axis.ends(&contact.boundary.positions);
            let gap = |i: usize| contact.gap(i, &Level::FULL);
            let least = HOLLOW * contact.boundary.length();
            contact.condition == Condition::Unilateral
                && ends
                    .iter()
                    .any(|[end, beside]| gap(*end) - gap(*beside) > least)
        })
    }

    /// Whether the result depends on the increments of the load path, because some friction is incremental.
    pub fn depends_on_path(&self) -> bool {
        let laws = self.contacts.iter().filter_map(|c| c.friction.as_ref());
        let mut acting = laws.filter(|law| law.bound.acts());
        acting.any(|law| law.history == History::Incremental)
    }

    /// A rigid motion that neither supports, springs nor the given holds prevent, in words, and a node
    /// that moves.
    pub fn free_motion(&self, hindered: &[Hold]) -> Option<(String, u32)> {
        let hindered = [&self.spring_holds[..], hindered].concat();
        freedom::motion_left(&self.mesh, &self.section, &self.fixed, &hindered)
    }

    /// All rigid motions that neither supports, springs nor the given holds prevent, except those that bend hinges.
    pub fn free_motions(&self, hindered: &[Hold]) -> Vec<RigidMotion> {
        let hindered = [&self.spring_holds[..], hindered].concat();
        freedom::free_motions(&self.mesh, &self.section, &self.fixed, &hindered)
    }
}

/// Whether another body faces a contact, or nothing does.
fn has_pair(contact: &Contact) -> bool {
    contact.against.is_some() || contact.obstacle.is_none()
}

/// Where the mesh of a model comes from.
enum Source {
    /// The mesh is given by the problem or its caller.
    Given(Option<External>),
    /// The mesh of an earlier model of the problem, refined.
    Ready(Mesh),
}

impl Checks {
    fn model(&mut self, problem: &Problem, source: Source) -> Checked<Model> {
        // the later checks assume finite numbers
        self.finite(problem)?;
        self.counts(problem)?;
        let analysis = problem.analysis;
        let mut all = AllChecks::default();
        all.check(self.analysis(&analysis));
        all.check(self.units(problem.units.as_ref()));
        all.check(self.controls(problem));
        all.check(self.thesis(problem));
        all.check(self.steps(&problem.steps));
        self.warn_of_path(problem);
        let mut numbers = Vec::new();
        for (i, contact) in problem.contacts.iter().enumerate() {
            let at = |field: &str| format!("/contacts/{i}/{field}");
            let pointer = format!("/contacts/{i}");
            let obstacle = self.obstacle_or_body(contact, &pointer);
            self.warn_of_noise(contact, &at("obstacle"));
            let (friction, sound) = self.friction(&analysis, contact, &at("friction"));
            all.check(sound);
            all.check(self.push_direction(&analysis, contact.direction, &at("direction")));
            all.check(self.obstacle_loads(&analysis, contact, &problem.steps, &pointer));
            numbers.push((obstacle, friction));
        }
        let mesh = match source {
            Source::Given(external) => {
                let contacts = problem.contacts.len();
                let mut mesh = self.mesh(&problem.mesh, external, &analysis, contacts, &mut all)?;
                // the thesis's own iteration does not know triangles
                if problem.solver.algorithm != Algorithm::Thesis {
                    let sound = numbers.iter().map(|(obstacle, _)| obstacle.is_ok());
                    let contacts = problem.contacts.iter().zip(sound);
                    contacts::put_nodes_at_ends(&mut mesh, contacts, &problem.steps);
                }
                mesh
            }
            Source::Ready(mut mesh) => {
                mesh.order_boundaries();
                self.curves(&mut mesh, &problem.mesh, " of the refined mesh")?;
                mesh
            }
        };
        all.check(self.thesis_elements(problem, &mesh));
        // faults of materials are reported; the following checks need only the theory
        let section = all
            .check(self.section(analysis, &problem.materials, &mesh))
            .unwrap_or_else(|| Section::uniform(analysis, Default::default()));
        let warmed = self.temperatures(&mesh, &section, &problem.materials, &problem.loads);
        let warmed = all.check(warmed).flatten();
        let section = warmed
            .as_ref()
            .map_or(section, |warmed| warmed.section.clone());
        let axis = Axis::new(&section, &mesh);
        let sides = FirstSides::new(&mesh, problem);
        let (fixed, supported) = self.supports(&mesh, &sides, &axis, &problem.supports);
        all.check(supported);
        let springs::Held { springs, holds } = springs::springs(&mesh, &section, &problem.supports);
        let loads = self.loads(&mesh, &sides, &section, &problem.materials, &problem.loads);
        let loads = loads.map(|loads| match warmed {
            Some(warmed) => warmed.added_to(loads),
            None => loads,
        });
        let (contacts, sound) = self.contacts(&mesh, &section, &axis, problem, numbers, &fixed);
        // what a pair that is refused would hold is unknown
        let unknown = sound.is_err() && problem.contacts.iter().any(has_pair);
        let held_by_contact = match unknown {
            true => Ok(false),
            false => self.freedom(&mesh, &section, &fixed, &holds, &contacts),
        };
        all.check(sound);
        all.finish(())?;
        let (loads, held_by_contact) = (loads?, held_by_contact?);
        if held_by_contact {
            let nodal = elasticity::assemble_loads(&mesh, &section, problem.quadrature, &loads);
            self.pressed(&mesh, &section, &fixed, &holds, &contacts, &nodal)?;
        }
        self.warn_about_contacts(&contacts);
        self.warn_of_dragged_symmetry(&mesh, &contacts, &fixed, &axis, &problem.steps);
        if section.axisymmetric() {
            self.warn_of_radial_drag(&contacts, &axis, &problem.steps);
        }
        self.warn_of_unmerged(&mesh, &contacts);
        let alone = corners::guess(&contacts, &fixed, &problem.steps);
        Ok(Model {
            mesh,
            section,
            axis,
            quadrature: problem.quadrature,
            oblique: contacts::oblique(&contacts, &fixed, &alone),
            alone,
            open_on_axis: BTreeSet::new(),
            fixed,
            springs,
            spring_holds: holds,
            loads,
            contacts,
            held_by_contact,
            steps: problem.steps.clone(),
            controls: problem.solver.clone(),
            warnings: std::mem::take(&mut self.warnings),
        })
    }
}
