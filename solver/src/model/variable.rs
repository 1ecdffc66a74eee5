//! A model whose numbers change from problem to problem, while its body and its contact boundaries stay the same.

use super::checks::Checks;
use super::{Model, contacts};
use crate::error::{AllChecks, Violation};
use crate::problem::{BodyGap, Contact, Grid, MeshInput, MeshSource, Problem};
use crate::solution::Warning;

/// A model that takes the laws of friction, indentations, drags, load steps and controls of other problems.
pub struct VariableModel {
    model: Model,
    /// The model's problem, without the mesh.
    problem: Problem,
    /// The warnings that do not depend on the variable numbers.
    lasting: Vec<Warning>,
}

impl VariableModel {
    /// Starts with a model, and the problem that it was made from.
    pub fn new(model: Model, problem: &Problem) -> Self {
        let mut lasting = model.warnings.clone();
        for warning in warnings(&model) {
            lasting.retain(|other| *other != warning);
        }
        VariableModel {
            model,
            problem: without_mesh(problem),
            lasting,
        }
    }

    /// The model of the last problem.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Changes to the model of another problem, whose mesh is not read. `None` if the problems differ in more than the
    /// variable numbers.
    ///
    /// # Errors
    ///
    /// All violations of the other problem; the model stays as it is.
    pub fn set(&mut self, problem: &Problem) -> Option<Result<(), Vec<Violation>>> {
        let (own, other) = (&self.problem, problem);
        let same = own.analysis == other.analysis
            && own.materials == other.materials
            && own.supports == other.supports
            && own.loads == other.loads
            && own.quadrature == other.quadrature
            && own.contacts.len() == other.contacts.len()
            && own.contacts.iter().zip(&other.contacts).all(same_boundary);
        // which motions friction has to prevent depends on the law
        if !same || self.model.held_by_contact {
            return None;
        }
        Some(self.take(problem))
    }

    fn take(&mut self, problem: &Problem) -> Result<(), Vec<Violation>> {
        let mut checks = Checks::default();
        let checked = checks.numbers(problem, &self.model);
        let frictions = checks.found.conclude(checked)?;
        let model = &mut self.model;
        for ((model, contact), friction) in model
            .contacts
            .iter_mut()
            .zip(&problem.contacts)
            .zip(frictions)
        {
            model.take(contact);
            model.friction = friction;
        }
        model.steps.clone_from(&problem.steps);
        model.controls.clone_from(&problem.solver);
        model.warnings.clone_from(&self.lasting);
        let of_numbers = warnings(model);
        model.warnings.extend(of_numbers);
        self.problem = without_mesh(problem);
        Ok(())
    }
}

/// The warnings about contacts, and about drag along lines of symmetry.
fn warnings(model: &Model) -> Vec<Warning> {
    let mut checks = Checks::default();
    checks.warn_about_contacts(&model.contacts);
    checks.warn_of_dragged_symmetry(
        &model.mesh,
        &model.contacts,
        &model.fixed,
        &model.axis,
        &model.steps,
    );
    checks.warnings
}

/// The problem with an empty mesh, for comparisons without the mesh.
fn without_mesh(problem: &Problem) -> Problem {
    let nothing = Grid {
        x: Vec::new(),
        y: Vec::new(),
        top: None,
        bottom: None,
    };
    Problem {
        title: None,
        units: None,
        analysis: problem.analysis,
        mesh: MeshInput::new(MeshSource::Grid(nothing)),
        materials: problem.materials.clone(),
        supports: problem.supports.clone(),
        loads: problem.loads.clone(),
        contacts: problem.contacts.clone(),
        steps: problem.steps.clone(),
        quadrature: problem.quadrature,
        solver: problem.solver.clone(),
    }
}

/// Whether two contacts are equal apart from their law, and the motions and loads of the obstacle.
fn same_boundary((a, b): (&Contact, &Contact)) -> bool {
    a.boundary == b.boundary
        && a.obstacle == b.obstacle
        && a.against == b.against
        && same_kind_of_gap(a.gap, b.gap)
        && a.used_normal() == b.used_normal()
        && a.direction == b.direction
        && a.is_tool() == b.is_tool()
        && a.obstacle_loads().map(|load| load.is_some())
            == b.obstacle_loads().map(|load| load.is_some())
        && a.about == b.about
        && a.stiffness == b.stiffness
        && a.condition == b.condition
}

/// Whether two gaps differ in an interference only, which moves the contact as an indentation does.
fn same_kind_of_gap(a: Option<BodyGap>, b: Option<BodyGap>) -> bool {
    let fixed = |gap: Option<BodyGap>| gap.map(|gap| (gap.interference.is_some(), gap.clearance));
    fixed(a) == fixed(b)
}

impl Checks {
    /// The friction laws of `problem` on the contacts of `model`; checks every number that may differ.
    fn numbers(
        &mut self,
        problem: &Problem,
        model: &Model,
    ) -> crate::error::Checked<Vec<contacts::Law>> {
        self.finite(problem)?;
        self.counts(problem)?;
        let mut all = AllChecks::default();
        all.check(self.controls(problem));
        all.check(self.thesis(problem));
        all.check(self.steps(&problem.steps));
        let mut laws = Vec::new();
        for (i, (contact, model_contact)) in
            problem.contacts.iter().zip(&model.contacts).enumerate()
        {
            let at = |field: &str| format!("/contacts/{i}/{field}");
            let (law, sound) = self.friction(&problem.analysis, contact, &at("friction"));
            all.check(sound);
            let radius = law.as_ref().and_then(|law| law.bound.radius());
            all.check(self.radius(&model_contact.boundary, radius, &format!("/contacts/{i}")));
            let (steps, fixed) = (&problem.steps, &model.fixed);
            all.check(self.facing_body_numbers(contact, &format!("/contacts/{i}")));
            all.check(self.obstacle_loads(
                &problem.analysis,
                contact,
                steps,
                &format!("/contacts/{i}"),
            ));
            let mut moved = model_contact.clone();
            moved.take(contact);
            moved.friction.clone_from(&law);
            all.check(self.supported_contact_nodes(&moved, steps, fixed));
            all.check(self.tangential_force_borne(&moved, steps));
            all.check(self.moment_borne(&moved, steps));
            laws.push(law);
        }
        all.check(self.thesis_elements(problem, &model.mesh));
        all.finish(laws)
    }
}
