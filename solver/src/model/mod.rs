//! The only door from a [`Problem`] to something that can be solved.
//!
//! `Model::new` checks everything and reports all violations at once; what it lets through is
//! numbered and can be trusted by every room above.

mod boundaries;
mod checks;
mod contacts;
pub mod estimate;
mod laws;
mod loads;
mod materials;
mod numbers;
mod supports;

pub use supports::Held;

use std::collections::BTreeMap;

use checks::Checks;

use crate::contact::ContactBoundary;
use crate::elasticity::{Loads, Section};
use crate::error::{All, Checked, Violation};
use crate::friction::{Average, FrictionLaw};
use crate::mesh::{External, Mesh};
use crate::problem::{Condition, NormalOf, Problem, SolverControls, Step};
use crate::solution::Warning;

/// A problem that can be solved.
#[derive(Clone, Debug)]
pub struct Model {
    /// The refined mesh.
    pub mesh: Mesh,
    /// Theory and materials.
    pub section: Section,
    /// Gauss points of an element in each direction.
    pub quadrature: u32,
    /// Prescribed displacements by node.
    pub fixed: BTreeMap<u32, Held>,
    /// External forces.
    pub loads: Loads,
    /// Contact boundaries with their obstacles.
    pub contacts: Vec<ContactModel>,
    /// Supports alone leave a rigid motion free, which contact must hold.
    pub held_by_contact: bool,
    /// Load steps; none: one step to the values as given.
    pub steps: Vec<Step>,
    /// Tolerance and limits.
    pub controls: SolverControls,
    /// What the user should know already.
    pub warnings: Vec<Warning>,
}

/// A load level: factors on the values of the problem.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// On every indentation.
    pub indentation: f64,
    /// On every tangential displacement of an obstacle.
    pub tangential_displacement: f64,
    /// On all loads.
    pub loads: f64,
    /// On all prescribed displacements.
    pub supports: f64,
}

impl Level {
    /// Nothing.
    pub const NOTHING: Level = Level {
        indentation: 0.0,
        tangential_displacement: 0.0,
        loads: 0.0,
        supports: 0.0,
    };

    /// The end of a load step.
    pub fn end_of(step: &Step) -> Level {
        Level {
            indentation: step.indentation,
            tangential_displacement: step.tangential_displacement,
            loads: step.loads,
            supports: step.supports,
        }
    }

    /// Everything as given.
    pub const FULL: Level = Level {
        indentation: 1.0,
        tangential_displacement: 1.0,
        loads: 1.0,
        supports: 1.0,
    };
}

/// A contact boundary and what it faces.
#[derive(Clone, Debug)]
pub struct ContactModel {
    /// Name of the boundary.
    pub name: String,
    /// JSON Pointer to the contact.
    pub pointer: String,
    /// Γ_C, with the normals that the contact uses.
    pub boundary: ContactBoundary,
    /// Profile of the obstacle at each node, along the contact's normal (length).
    pub profile: Vec<f64>,
    /// How far the obstacle is pushed against the body (length).
    pub indentation: f64,
    /// The parts of that push along the contact's normal and along its t, at each node: 1 and 0 with
    /// the body's normal; with the obstacle's the cosine and minus the sine of the slope.
    pub push: Vec<[f64; 2]>,
    /// The obstacle's own displacement along the contact's t (length).
    pub tangential_displacement: f64,
    /// Whose normal it is.
    pub normal: NormalOf,
    /// What the obstacle does.
    pub condition: Condition,
    /// m where the profile is a power |c|^m: a contact's width then grows like δ^(1/m).
    pub power: Option<f64>,
    /// Absent: frictionless.
    pub friction: Option<FrictionLaw<Average>>,
}

impl ContactModel {
    /// Gap at a node (length) when the obstacle is pushed by `factor` times its indentation.
    pub fn gap(&self, node: usize, factor: f64) -> f64 {
        self.profile[node] - factor * self.indentation * self.push[node][0]
    }

    /// d: the obstacle's displacement along the contact's t at a node (length).
    pub fn drag(&self, node: usize, level: &Level) -> f64 {
        level.tangential_displacement * self.tangential_displacement
            + level.indentation * self.indentation * self.push[node][1]
    }
}

impl Model {
    /// Checks and numbers a problem; `external`: the mesh that it only names or quotes, where it does.
    pub fn new(problem: &Problem, external: Option<External>) -> Result<Model, Vec<Violation>> {
        let mut checks = Checks::default();
        let model = checks.all(problem, external);
        checks.found.conclude(model)
    }
}

impl Checks {
    fn all(&mut self, problem: &Problem, external: Option<External>) -> Checked<Model> {
        // numbers that are not finite would make nonsense of every later check
        self.finite(problem)?;
        self.counts(problem)?;
        let analysis = problem.analysis;
        let mut all = All::default();
        all.take(self.analysis(&analysis));
        all.take(self.units(problem.units.as_ref()));
        all.take(self.controls(problem));
        all.take(self.thesis(problem));
        all.take(self.steps(&problem.steps));
        let mut numbers = Vec::new();
        for (i, contact) in problem.contacts.iter().enumerate() {
            let at = |field: &str| format!("/contacts/{i}/{field}");
            let obstacle = self.obstacle(&contact.obstacle, &at("obstacle"));
            let (friction, sound) = self.friction(&analysis, contact, &at("friction"));
            all.take(sound);
            numbers.push((obstacle, friction));
        }
        let mut mesh = self.mesh(&problem.mesh, external, &analysis, problem.contacts.len())?;
        all.take(self.names(&mut mesh, &problem.mesh));
        all.take(self.thesis_elements(problem, &mesh));
        // wrong materials have been named; the checks that follow need only the theory
        let section = all
            .take(self.section(analysis, &problem.materials, &mesh))
            .unwrap_or_else(|| Section::uniform(analysis, Default::default()));
        let (fixed, supported) = self.supports(&mesh, &section, &problem.supports);
        all.take(supported);
        let loads = self.loads(&mesh, &section, &problem.loads);
        let (contacts, sound) = self.contacts(&mesh, &section, problem, numbers, &fixed);
        all.take(sound);
        let held_by_contact = self.freedom(&mesh, &section, &fixed, &contacts);
        all.then(())?;
        self.doubts(&contacts);
        Ok(Model {
            mesh,
            section,
            quadrature: problem.quadrature,
            fixed,
            loads: loads?,
            contacts,
            held_by_contact: held_by_contact?,
            steps: problem.steps.clone(),
            controls: problem.solver.clone(),
            warnings: std::mem::take(&mut self.warnings),
        })
    }
}
