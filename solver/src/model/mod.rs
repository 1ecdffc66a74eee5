//! The only door from a [`Problem`] to something that can be solved.
//!
//! `Model::new` findings everything and reports all violations at once; what it lets through is
//! numbered and can be trusted by every room above.

mod boundaries;
mod contacts;
pub mod estimate;
mod findings;
mod numbers;
mod supports;

use std::collections::BTreeMap;

use findings::Findings;

use crate::contact::ContactBoundary;
use crate::elasticity::Section;
use crate::error::Violation;
use crate::mesh::{Edge, Mesh};
use crate::problem::{Friction, Problem, SolverControls};
use crate::solution::Warning;

/// A problem that can be solved.
#[derive(Clone, Debug)]
pub struct Model {
    /// The refined mesh.
    pub mesh: Mesh,
    /// Material and depth.
    pub section: Section,
    /// Prescribed displacements along x and y by node.
    pub fixed: BTreeMap<u32, [Option<f64>; 2]>,
    /// Edges under pressure, with the pressure at start, end and midside.
    pub pressures: Vec<(Edge, [f64; 3])>,
    /// Contact boundaries with their obstacles.
    pub contacts: Vec<ContactModel>,
    /// Tolerance and limits.
    pub controls: SolverControls,
    /// What the user should know already.
    pub warnings: Vec<Warning>,
}

/// A contact boundary and what it faces.
#[derive(Clone, Debug)]
pub struct ContactModel {
    /// Name of the boundary.
    pub name: String,
    /// JSON Pointer to the contact.
    pub pointer: String,
    /// Γ_C.
    pub boundary: ContactBoundary,
    /// Gap at each node: profile − indentation.
    pub gap: Vec<f64>,
    /// d, the obstacle's own tangential displacement.
    pub tangential_displacement: f64,
    /// Absent: frictionless.
    pub friction: Option<Friction>,
}

impl Model {
    /// Checks and numbers a problem.
    pub fn new(problem: &Problem) -> Result<Model, Vec<Violation>> {
        let mut findings = Findings::default();
        findings.finite(problem);
        // numbers that are not finite would make nonsense of every later check
        if !findings.violations.is_empty() {
            return Err(findings.into_violations());
        }
        findings.counts(problem);
        if !findings.violations.is_empty() {
            return Err(findings.into_violations());
        }
        findings.analysis(&problem.analysis);
        let material = findings.materials(&problem.materials);
        findings.controls(&problem.solver);
        for (i, contact) in problem.contacts.iter().enumerate() {
            findings.contact_numbers(contact, &format!("/contacts/{i}"));
        }
        let Some(mesh) = findings.mesh(&problem.mesh, &problem.analysis) else {
            return Err(findings.into_violations());
        };
        let (e, nu) = material.map_or((1.0, 0.0), |m| (m.youngs_modulus, m.poissons_ratio));
        let section = Section::new(problem.analysis, e, nu);
        let fixed = findings.supports(&mesh, &section, &problem.supports);
        let pressures = findings.loads(&mesh, &problem.loads);
        let contacts = findings.contacts(&mesh, &section, &problem.contacts, &fixed);
        findings.freedom(&mesh, &section, &fixed);
        if !findings.violations.is_empty() {
            return Err(findings.into_violations());
        }
        findings.doubts(&contacts);
        let (controls, warnings) = (problem.solver, findings.warnings);
        Ok(Model {
            mesh,
            section,
            fixed,
            pressures,
            contacts,
            controls,
            warnings,
        })
    }
}
