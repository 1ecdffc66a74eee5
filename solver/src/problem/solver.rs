//! Load steps and the options of the solution.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One load step: factors on the values given elsewhere, reached in equal or growing increments from the factors of the
/// previous step (in the first step from zero).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Step {
    /// A name for readers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Factor on the indentation of every contact at the end of the step.
    pub indentation: f64,
    /// Factor on the tangential displacement of every obstacle.
    pub tangential_displacement: f64,
    /// Factor on the normal force of every obstacle.
    #[serde(skip_serializing_if = "is_one")]
    pub normal_force: f64,
    /// Factor on the tangential force of every obstacle.
    #[serde(skip_serializing_if = "is_zero")]
    pub tangential_force: f64,
    /// Factor on the tilt of every obstacle.
    #[serde(skip_serializing_if = "is_one")]
    pub tilt: f64,
    /// Factor on the moment of every obstacle.
    #[serde(skip_serializing_if = "is_one")]
    pub moment: f64,
    /// Factor on all loads.
    pub loads: f64,
    /// Factor on all prescribed displacements.
    pub supports: f64,
    /// Increments of the step (≥ 1).
    pub increments: u32,
    /// How the indentation grows from increment to increment.
    pub spacing: Spacing,
}

/// How the indentation grows inside a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Spacing {
    /// The indentation grows by equal amounts.
    #[default]
    Uniform,
    /// The contact grows by equal widths: δ_k = δ (k/n)^m for a profile of power m.
    ContactWidth,
}

impl Step {
    /// The step that applies all given values at once.
    pub fn whole() -> Self {
        Step {
            name: None,
            indentation: 1.0,
            tangential_displacement: 1.0,
            normal_force: 1.0,
            tangential_force: 1.0,
            tilt: 1.0,
            moment: 1.0,
            loads: 1.0,
            supports: 1.0,
            increments: 1,
            spacing: Spacing::Uniform,
        }
    }
}

fn is_one(factor: &f64) -> bool {
    *factor == 1.0
}

fn is_zero(factor: &f64) -> bool {
    *factor == 0.0
}

/// A step that applies all loads at once, with no tangential displacement and no tangential force.
impl Default for Step {
    fn default() -> Self {
        Step {
            tangential_displacement: 0.0,
            tangential_force: 0.0,
            ..Step::whole()
        }
    }
}

/// Options of the solution: algorithm, tolerance and limits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SolverControls {
    /// The algorithm.
    pub algorithm: Algorithm,
    /// The tolerance (0 < tolerance < 1), below which each of the dimensionless residuals must fall.
    pub tolerance: f64,
    /// The most outer sweeps over the friction bound, per increment (≥ 1).
    pub max_iterations: u32,
    /// Solve once more from the bonded state, and report whether the two solutions agree.
    pub check_uniqueness: bool,
    /// Solve once more with twice the increments, and report how much the result changes.
    pub check_increments: bool,
    /// How the errors in `summary.accuracy` are found; absent: `estimate`. `verify` solves once more with every element
    /// split in two in each direction, which takes several times as long and as much memory.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<AccuracyMode>,
    /// Options that the thesis leaves open; for `algorithm: thesis` only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thesis: Option<ThesisOptions>,
}

/// The algorithm, docs/formulation.md section 4.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Algorithm {
    /// Sweeps over the friction bound; where they converge slowly, accelerated; where that fails, Newton's method.
    #[default]
    Auto,
    /// Sweeps over the friction bound, each a convex problem, with Anderson acceleration.
    FixedPoint,
    /// One semi-smooth Newton iteration for contact, friction and averaging together.
    Newton,
    /// The thesis's own iteration, exactly as described in thesis 3.1. At the thesis's parameters it does not solve the
    /// problem; the outcome is then `false_convergence`.
    Thesis,
}

/// How the errors of the results are found, docs/formulation.md section 3.9.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AccuracyMode {
    /// Estimated on the mesh of the solution, at little cost.
    #[default]
    Estimate,
    /// By a second solution with every element split in two in each direction; with `refine` of 1 or more also by a
    /// solution on the mesh before the last refinement, which gives orders of convergence.
    Verify,
}

impl SolverControls {
    /// Whether the errors are to be verified.
    pub fn verifies(&self) -> bool {
        self.accuracy == Some(AccuracyMode::Verify)
    }
}

/// Options of the thesis's own iteration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ThesisOptions {
    /// First guess of the contact Γ_C*: `[s0, s1]` of arc length by boundary; absent: all of Γ_C.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub contact_guess: BTreeMap<String, [f64; 2]>,
    /// Way of evaluating the friction force, thesis 3.2: 1 at the boundary's own Gauss points, 2 along
    /// the two nearest rows of internal Gauss points, extrapolated linearly to the boundary.
    pub friction_force: u32,
    /// The source of the normal stress.
    pub pressure: ThesisPressure,
    /// Number of local Gauss points for integrating the kernel in each element, thesis 3.4.2, no further than the next
    /// element; for extrapolated pressure only. 0: the mesh-free average of nodal values.
    pub local_points: u32,
    /// Fraction of the new friction force that is applied (0 < relaxation ≤ 1).
    pub relaxation: f64,
    /// Whether friction opposes the motion, as in thesis (1.8), instead of acting along t everywhere.
    pub signed: bool,
}

impl Default for ThesisOptions {
    fn default() -> Self {
        ThesisOptions {
            contact_guess: BTreeMap::new(),
            friction_force: 1,
            pressure: ThesisPressure::default(),
            local_points: 0,
            relaxation: 1.0,
            signed: false,
        }
    }
}

/// The source of the normal stress in the thesis's iteration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ThesisPressure {
    /// Nodal reactions divided by ∫h.
    #[default]
    Lumped,
    /// Stresses at internal Gauss points, extrapolated to the boundary, thesis 3.3.
    Extrapolated,
}

impl Default for SolverControls {
    fn default() -> Self {
        Self {
            algorithm: Algorithm::Auto,
            tolerance: 1e-10,
            max_iterations: 200,
            check_uniqueness: false,
            check_increments: false,
            accuracy: None,
            thesis: None,
        }
    }
}
