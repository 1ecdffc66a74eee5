//! The solution: plain data, exactly the JSON of the API.
//!
//! Signs: stresses are negative in compression; forces are those on the body; `t` is the outward normal turned
//! clockwise. Forces are those of the modelled part: a half model gives half, plane stress includes the thickness,
//! axisymmetric totals include 2π.

mod accuracy;
mod sample;

pub use crate::phase::Phase;
pub use accuracy::{Accuracy, ErrorMethod, EstimatedQuantity, QuantityName, Verdict};
pub use sample::{at_all_points, sample};

use std::borrow::Cow;
use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};
use strum::{EnumString, IntoStaticStr, VariantArray};

use crate::element::Element;
use crate::finite::is_finite;
use crate::problem::NormalOf;

/// A solved problem, converged or not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Solution {
    /// Scalars, extents and warnings.
    pub summary: Summary,
    /// One row per iteration.
    pub history: Vec<Iteration>,
    /// Columns along each contact boundary, by its name, at all points where the solution is known: the nodes, the points
    /// where friction acts, and the places of the peaks, with the values of the summary. Of a boundary of another body that faces a
    /// contact: the nodes of its edges that the contact covers, with the stress that they receive.
    pub profiles: BTreeMap<String, ContactProfile>,
    /// Columns along the same boundaries at the nodes only, like `profiles`. Not part of the document and its digest:
    /// they are stored and served separately.
    #[serde(default, skip_serializing)]
    pub node_profiles: BTreeMap<String, ContactProfile>,
    /// Columns along the same boundaries at the points where friction acts only (of one that faces a contact at its nodes), see
    /// [`ContactProfile`]; not part of the document.
    #[serde(default, skip_serializing)]
    pub friction_profiles: BTreeMap<String, ContactProfile>,
    /// One entry for each load step of the problem; summary, profiles and fields of the solution are those of the last
    /// step.
    pub steps: Vec<StepSolution>,
    /// Displacements and stresses.
    pub fields: Fields,
}

impl Solution {
    /// Whether every number is finite, also those that are not serialized (`node_profiles` and `friction_profiles`).
    pub fn is_finite(&self) -> bool {
        // all of them by name, here and below, so that a new one is not forgotten
        let Solution {
            summary,
            history,
            profiles,
            node_profiles,
            friction_profiles,
            steps,
            fields,
        } = self;
        is_finite(summary)
            && is_finite(history)
            && is_finite(&[profiles, node_profiles, friction_profiles])
            && is_finite(steps)
            && steps
                .iter()
                .all(|s| is_finite(&[&s.node_profiles, &s.friction_profiles]))
            && fields.is_finite()
    }
}

/// The results at the end of one load step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepSolution {
    /// The step's name in the problem, or its number from 0.
    pub name: String,
    /// Scalars, extents and warnings at the end of the step.
    pub summary: Summary,
    /// The iterations of this step.
    pub history: Vec<Iteration>,
    /// Columns along each contact boundary, by its name.
    pub profiles: BTreeMap<String, ContactProfile>,
    /// Columns along each contact boundary at the nodes only; not part of the document.
    #[serde(default, skip_serializing)]
    pub node_profiles: BTreeMap<String, ContactProfile>,
    /// Columns along each contact boundary at the points where friction acts only; not part of the document.
    #[serde(default, skip_serializing)]
    pub friction_profiles: BTreeMap<String, ContactProfile>,
}

/// How the iterations ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The contact set is unchanged, and every residual is below the tolerance or (warning `rounding_limits_residual`)
    /// no larger than rounding permits.
    Converged,
    /// `max_iterations` reached.
    NotConverged,
    /// Contact states repeat in a cycle.
    ContactCycling,
    /// The method's own criteria are met, but the forces on the body do not balance, or (by the thesis's own iteration)
    /// the true residual is above the tolerance.
    FalseConvergence,
    /// The observer asked to stop; the last state is kept.
    Canceled,
    /// Load steps are missing: these are the results at the end of those so far, while others are solved, or because the
    /// rest was stopped.
    Unfinished,
}

/// The scalars of a solution.
///
/// Stored with each result: a field that is added is an `Option` or has a `#[serde(default)]`, so that older results
/// can still be read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "SolutionSummary")]
pub struct Summary {
    /// How far the numbers can be trusted; absent for a load step that is not the last, and in results of older
    /// versions. It describes the result and is not part of it: the digest leaves it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<Accuracy>,
    /// How the iterations ended.
    pub outcome: Outcome,
    /// True for `converged` only.
    pub converged: bool,
    /// Normal force ∫p ≥ 0 over all contacts (force).
    pub normal_force: f64,
    /// Tangential force ∫σ_t, positive along t, over all contacts (force).
    pub tangential_force: f64,
    /// Friction force ∫|σ_t| over all contacts (force).
    pub friction_force: f64,
    /// The scalars of each contact boundary.
    pub contacts: BTreeMap<String, ContactSummary>,
    /// Number of rows of the history.
    pub iterations: u32,
    /// The stage that produced the final state.
    pub stage: Stage,
    /// Last contraction number q = |Δτ_k|/|Δτ_{k−1}| of the outer sweeps; absent below two sweeps.
    pub contraction: Option<f64>,
    /// Dimensionless residuals of the final state.
    pub residuals: Residuals,
    /// Potential energy (1.21) of the final state with its own friction bound (force × length).
    pub energy: f64,
    /// Work done against friction (force × length), never negative: ∫τ φ |e| with the slip e of this state, u_t − d in
    /// the total law and u_t − d − g in the incremental one; there the dissipation of earlier increments is added, ∫τ
    /// |Δg|. The elastic slip counts with its final stress, although at most half of that was spent on it: the work is
    /// too large by up to ε ∫τ. No error is stated for it: with the incremental law it depends on the increments (by some 8 %
    /// where a contact grows in 32 of them).
    pub friction_work: f64,
    /// Energy of the strains, ½ ∫ σ : ε (force × length); absent in results of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strain_energy: Option<f64>,
    /// Increments over all steps so far.
    pub increments: u32,
    /// Increments that did not converge and were halved.
    pub cut_backs: u32,
    /// Result of `check_uniqueness`; absent without it.
    pub uniqueness: Option<Comparison>,
    /// Result of `check_increments`: the effect of twice the increments; absent without it.
    pub doubled_increments: Option<Comparison>,
    /// The meshes of adaptive refinement, coarsest first; empty without it.
    pub refinements: Vec<Refinement>,
    /// Points to consider before relying on the result.
    pub warnings: Vec<Warning>,
    /// Unknowns of the body after supports.
    pub dofs: u64,
    /// Unknowns on the contact boundaries.
    pub contact_dofs: u64,
}

/// A second solution of the same problem, compared with the first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Comparison {
    /// True where the two solutions agree: forces and friction bounds to 1e-6 (uniqueness only; for doubled increments
    /// to `tolerance`), or within rounding.
    pub agrees: bool,
    /// Whether the second solution converged; if not, `agrees` has no meaning.
    pub converged: bool,
    /// Normal force ∫p of the second solution.
    pub normal_force: f64,
    /// Tangential force ∫σ_t of the second solution.
    pub tangential_force: f64,
    /// Friction force ∫|σ_t| of the second solution.
    pub friction_force: f64,
    /// Largest relative difference between the forces of the two solutions.
    pub change: f64,
}

/// One mesh of adaptive refinement and its results.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Refinement {
    /// Elements of the mesh.
    pub elements: u64,
    /// Unknowns of the body.
    pub dofs: u64,
    /// Normal force ∫p.
    pub normal_force: f64,
    /// Tangential force ∫σ_t.
    pub tangential_force: f64,
    /// Friction force ∫|σ_t|.
    pub friction_force: f64,
    /// Largest |σ_t| over all contacts.
    pub peak_tangential_stress: f64,
    /// Largest |σ_n| over all contacts; it does not converge at a sharp edge.
    pub peak_normal_stress: f64,
    /// Largest relative change from the previous mesh; absent for the first.
    pub change: Option<f64>,
    /// Largest relative error of the quantities that have a limit, as in `accuracy`; absent where one of the errors is
    /// unknown, and in results of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
}

/// Scalars of one contact boundary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ContactSummary {
    /// The normal that was used.
    pub normal: NormalOf,
    /// Normal force ∫p ≥ 0 (force).
    pub normal_force: f64,
    /// Tangential force ∫σ_t, positive along t (force).
    pub tangential_force: f64,
    /// Friction force ∫|σ_t| (force).
    pub friction_force: f64,
    /// Intervals `[s0, s1]` of arc length between the outermost nodes in contact.
    pub contact: Vec<[f64; 2]>,
    /// Intervals of the contact that stick, |u_t − d| < ε.
    pub stick: Vec<[f64; 2]>,
    /// Intervals of the contact that slip; the whole contact when it is frictionless.
    pub slip: Vec<[f64; 2]>,
    /// Largest pressure, as a stress (≤ 0), over the continuous profile; absent without contact.
    pub peak_normal_stress: Option<Peak>,
    /// Largest |σ_t|, with its sign, over the continuous profile; absent without friction.
    pub peak_tangential_stress: Option<Peak>,
    /// For an obstacle with a load or a tilt: how far it has moved along its direction (length).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub indentation: Option<f64>,
    /// For an obstacle with a load or a tilt: how far it has moved perpendicular to its direction, along t (length).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tangential_displacement: Option<f64>,
    /// For an obstacle with a load or a tilt: the angle by which it has turned, counter-clockwise (radians).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tilt: Option<f64>,
    /// The force `[x, y]` on the body (force), the sum of pressures and friction as vectors; in axisymmetry along the axis alone.
    /// Absent in results of older versions. On a curved boundary `normal_force` and `tangential_force`, sums along each point's own normal and tangent,
    /// differ from its components.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force: Option<[f64; 2]>,
    /// For an obstacle with a moment or a tilt: its moment on the body about `about`, counter-clockwise (force × length).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moment: Option<f64>,
    /// The lengths of contact, stick and slip, with the ends of contact interpolated between nodes. Not part of the
    /// document and its digest: rows of sweeps have them.
    #[serde(skip)]
    pub widths: Widths,
}

/// The lengths of all intervals of a contact, whose ends are interpolated between the outermost nodes in contact and the
/// nodes beside them: lengths of nodes change by whole distances between nodes where the load changes a little.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Widths {
    /// The length in contact.
    pub contact: f64,
    /// The error of `contact` due to the distances between nodes, the sum for all ends; absent where the end is unknown:
    /// the solution did not converge, or the nodes miss a shape of the obstacle.
    pub error: Option<f64>,
    /// The length that sticks.
    pub stick: f64,
    /// The length that slips.
    pub slip: f64,
}

/// A value and where it occurs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Peak {
    /// The stress, with its sign.
    pub value: f64,
    /// Arc length from the start of the named boundary.
    pub s: f64,
    /// Position x.
    pub x: f64,
    /// Position y.
    pub y: f64,
}

/// Dimensionless residuals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Residuals {
    /// Largest force or complementarity defect for the friction bound in use, divided by the largest nodal reaction.
    pub kkt: f64,
    /// Largest |τ − μ max(S_ρ(p), 0)| divided by the largest τ.
    pub friction: f64,
    /// As `kkt`, for the friction bound that the state itself implies.
    pub monolithic: f64,
    /// Imbalance |Σ forces| / Σ|forces|, from the stresses in the body.
    pub equilibrium: f64,
}

impl Residuals {
    /// Whether the residuals of the iterations are at or below the tolerance.
    pub fn within(&self, tolerance: f64) -> bool {
        self.kkt <= tolerance && self.friction <= tolerance && self.monolithic <= tolerance
    }
}

/// A point to consider before relying on a result. Its JSON also has the severity of its code ([`WarningCode::severity`]),
/// which is derived whenever a warning is written, ignored where one is read, and left out of digests.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Warning {
    /// The kind of warning, stable for programs.
    pub code: WarningCode,
    /// JSON Pointer to the part of the problem that the warning is about.
    pub pointer: String,
    /// The warning with its numbers, and what to do.
    pub message: String,
}

/// A point to consider before relying on a result.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "Warning")]
struct WrittenWarning<'a> {
    /// The kind of warning, stable for programs.
    code: WarningCode,
    /// How much the warning matters, the same for all warnings of the kind.
    severity: Severity,
    /// JSON Pointer to the part of the problem that the warning is about.
    pointer: &'a str,
    /// The warning with its numbers, and what to do.
    message: &'a str,
}

impl Serialize for Warning {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Warning {
            code,
            pointer,
            message,
        } = self;
        let written = WrittenWarning {
            code: *code,
            severity: code.severity(),
            pointer,
            message,
        };
        written.serialize(serializer)
    }
}

impl JsonSchema for Warning {
    fn schema_name() -> Cow<'static, str> {
        WrittenWarning::schema_name()
    }

    fn schema_id() -> Cow<'static, str> {
        WrittenWarning::schema_id()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        WrittenWarning::json_schema(generator)
    }
}

/// A kind of warning.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    Serialize,
    Deserialize,
    JsonSchema,
    IntoStaticStr,
    EnumString,
    VariantArray,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum WarningCode {
    /// Units of length, force and stress that do not belong together.
    UnitsDisagree,
    /// Lines of a mesh file that are not sides of the surface.
    LinesInside,
    /// Rows of a deck that prescribe different displacements of one node; the last one is used.
    SupportsOverlap,
    /// 9-node quadrilaterals that became 8-node elements.
    CentreNodesDropped,
    /// Elements that were numbered clockwise.
    ElementsReversed,
    /// Elements without midside nodes, which were given some.
    RaisedToSecondOrder,
    /// Elements of a rigid body of a deck.
    RigidElementsLeftOut,
    /// A part of a deck that the solver treats differently.
    DeckDiffers,
    /// Nodes at the same place that are not connected: a crack.
    CoincidentNodes,
    /// A strip that deviates from its polyline between two grid lines.
    StripCutsPolyline,
    /// An obstacle that ends inside an edge.
    ObstacleCutsEdge,
    /// A standard deviation that smooths most of a measured profile away.
    SmoothingFlattens,
    /// A standard deviation that differs from the scatter of the points of a measured profile.
    DeviationDiffers,
    /// An elastic slip that is not small beside the way of the obstacle.
    ElasticSlipLarge,
    /// Load steps that reach only a small part of the indentation or the tangential displacement.
    FactorsSmall,
    /// A displacement, a load or a prescribed displacement that no load step applies, or a factor of a step on none.
    NeverApplied,
    /// A load step that drags the obstacle back while its indentation or the loads change.
    DragReturns,
    /// Load steps that turn back under the total law, which depends on the end alone.
    PathForgotten,
    /// A measured profile whose lowest point is exactly 0.
    LowestPointIsZero,
    /// Points of an obstacle that scatter as measured ones do, without a standard deviation.
    NoiseUndeclared,
    /// A smoothed profile, in which undulations as high as the noise are lost.
    UndulationsUnseen,
    /// A contact boundary with a corner between two edges.
    ContactTurns,
    /// The middle of an obstacle at an end of the contact, where the body's side is free.
    SymmetryMissing,
    /// An obstacle that is dragged along a contact with a line of symmetry at its end.
    SymmetricDrag,
    /// A rigid obstacle of revolution that is dragged away from the axis or towards it.
    RadialDrag,
    /// Materials that meet on the surface in contact, where the pressure has no limit.
    MaterialJunction,
    /// Two bodies in contact of which the much coarser one carries the law.
    CoarserSideCarriesLaw,
    /// A given distance of two bodies, the same everywhere, of meshes that do not fit one another.
    GapDiffers,
    /// A gap that is closed across the normals of the contact, which the total law counts as slip.
    ClosingCountsAsSlip,
    /// Edges longer than the nonlocal radius.
    MeshTooCoarseForRadius,
    /// Few elements in the contact.
    MeshTooCoarseForContact,
    /// A body that never touches the obstacle.
    NoContact,
    /// A body that touched the obstacle in an earlier increment and touches it no longer.
    ContactOpened,
    /// Contact up to the last point of an obstacle that is given by points.
    ContactReachesObstacleEnd,
    /// Contact up to a sharp edge of the obstacle or of the body.
    SharpEdge,
    /// An averaged pressure that reaches beyond an end of the contact boundary, so that friction is lost there.
    FrictionLostAtEnd,
    /// An obstacle that reaches into the body between two nodes, or recedes from it.
    ObstacleBetweenNodes,
    /// An obstacle that is pushed so far along its direction that its gaps, which are linear in the push, are wrong.
    DirectionIsLinear,
    /// A kink of the obstacle, or a corner of the body, in the contact.
    KinkInContact,
    /// A boundary or group by a range that ends inside edges or elements, which do not belong to it.
    RangeCutsMesh,
    /// Several corners of the body in the contact, as of straight sides of elements on a curve.
    PolygonInContact,
    /// A polygon in place of a curve in the contact, so coarse that forces may be wrong by more than 5 %.
    PolygonTooCoarse,
    /// A contact so curved that the sum of its pressures is not its force.
    NormalsDiffer,
    /// Friction by the displacements at the end alone, where the way there matters.
    TotalLaw,
    /// A nonlocal radius larger than the contact.
    RadiusExceedsContact,
    /// A part of the friction that acts where the body does not touch, within a nonlocal radius of the contact.
    FrictionBeyondContact,
    /// A prescribed friction bound that acts where the body does not touch.
    BoundBeyondContact,
    /// A friction bound that jumps at the end of the pressure.
    CohesionJumps,
    /// A tangential stress that oscillates inside stick.
    OscillatingStick,
    /// Sweeps that barely contract.
    SlowContraction,
    /// Residuals above the tolerance after all iterations.
    NotConverged,
    /// Residuals that rounding keeps above the tolerance.
    RoundingLimitsResidual,
    /// An iteration of the thesis that converges to a state that is not a solution.
    FalseConvergence,
    /// Contact and slip states that repeat in a cycle.
    ContactCycling,
    /// Forces on the body that do not balance.
    OutOfBalance,
    /// A body that slides away: loads along its contacts exceed their friction, and nothing else holds it.
    SlidesAway,
    /// A body that slides farther than its contact is long.
    LargeSlip,
    /// Strains in a contact beyond what linear elasticity describes.
    LargeStrain,
    /// Displacements that are not small compared with the body.
    LargeDisplacement,
    /// An obstacle that turns farther than a small rotation.
    LargeTilt,
    /// A second solution that did not converge.
    UniquenessUnknown,
    /// A second solution that differs from the first.
    NotUnique,
    /// A largest tangential stress whose direction the mesh does not tell: one in the other direction is as large within its error.
    PeakSignUnknown,
    /// Twice the increments change the result.
    IncrementsMatter,
    /// Adaptive refinement that ended before all errors were within its tolerance.
    RefinementUnfinished,
}

impl WarningCode {
    /// The name of the warning in the API.
    pub fn as_str(self) -> &'static str {
        self.into()
    }

    /// The severity of the warning, the same for all warnings of the kind.
    pub fn severity(self) -> Severity {
        use WarningCode::*;
        match self {
            NotConverged | FalseConvergence | ContactCycling | NoContact | SlidesAway
            | OutOfBalance | NotUnique => Severity::Serious,
            UnitsDisagree
            | LargeStrain
            | LargeDisplacement
            | LargeTilt
            | LargeSlip
            | CoincidentNodes
            | ContactReachesObstacleEnd
            | FrictionLostAtEnd
            | ObstacleBetweenNodes
            | DirectionIsLinear
            | SymmetryMissing
            | SymmetricDrag
            | RadialDrag
            | BoundBeyondContact
            | RefinementUnfinished
            | IncrementsMatter
            | UniquenessUnknown
            | RoundingLimitsResidual
            | SmoothingFlattens
            | DeviationDiffers
            | LowestPointIsZero
            | NoiseUndeclared
            | NeverApplied
            | DragReturns
            | PathForgotten
            | ElasticSlipLarge
            | LinesInside
            | SupportsOverlap
            | DeckDiffers
            | StripCutsPolyline
            | ObstacleCutsEdge
            | RadiusExceedsContact
            | OscillatingStick
            | PolygonInContact
            | PolygonTooCoarse
            | RangeCutsMesh
            | CoarserSideCarriesLaw
            | GapDiffers
            | ClosingCountsAsSlip
            | MeshTooCoarseForContact
            | MeshTooCoarseForRadius => Severity::Warning,
            CentreNodesDropped
            | ElementsReversed
            | RaisedToSecondOrder
            | RigidElementsLeftOut
            | ContactTurns
            | KinkInContact
            | NormalsDiffer
            | TotalLaw
            | SharpEdge
            | MaterialJunction
            | CohesionJumps
            | SlowContraction
            | FactorsSmall
            | ContactOpened
            | PeakSignUnknown
            | UndulationsUnseen
            | FrictionBeyondContact => Severity::Note,
        }
    }
}

/// How much a warning matters, the most severe first.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Serialize,
    Deserialize,
    JsonSchema,
    IntoStaticStr,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Severity {
    /// The result is not that of the intended problem.
    Serious,
    /// Some numbers of the result are not those of the intended problem, or may not be.
    Warning,
    /// A property of the problem, or a remark on how it was read; the numbers are as accurate as stated.
    Note,
}

/// The part of the method that an iteration belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema, IntoStaticStr)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Stage {
    /// The first solution, without friction.
    Frictionless,
    /// A solution with u_t = d on all of Γ_C: the start of `check_uniqueness`, and of a body that only friction
    /// holds.
    Bonded,
    /// A sweep over the friction bound.
    Outer,
    /// A convex problem with a prescribed friction bound.
    Inner,
    /// A step of the monolithic Newton method.
    Newton,
    /// A sweep of the thesis's own iteration.
    Thesis,
}

impl Stage {
    /// The name of the stage in the API.
    pub fn as_str(self) -> &'static str {
        self.into()
    }
}

/// One row of the history.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Iteration {
    /// Number of the row, from 1.
    pub k: u32,
    /// The part of the method.
    pub stage: Stage,
    /// Load step, from 0.
    pub step: u32,
    /// Increment within the step, from 0.
    pub increment: u32,
    /// `Residuals::kkt` of the convex problem just solved.
    pub residual: f64,
    /// `Residuals::friction`.
    pub friction_residual: f64,
    /// R_F of thesis 3.5: relative change of the nodal normal stress; absent in the first row.
    pub r_f: Option<f64>,
    /// The tolerance that applies.
    pub tolerance: f64,
    /// Nodes in contact and their changes.
    pub contact: ContactCount,
    /// Numbers of friction points that slip and stick.
    pub friction: FrictionCount,
    /// Forces of the state after the iteration.
    pub force: ForcePair,
    /// The motion of the obstacle that loads move; absent unless a problem has one such obstacle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<ObstacleMotion>,
    /// Contraction q = |Δτ_k|/|Δτ_{k−1}|; absent in the first sweeps.
    pub contraction: Option<f64>,
    /// Newton steps of the convex problem.
    pub inner: u32,
}

/// Nodes in contact and their changes since the previous row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ContactCount {
    /// Nodes in contact.
    pub active: u32,
    /// Nodes that came into contact.
    pub entered: u32,
    /// Nodes that left contact.
    pub left: u32,
}

/// Numbers of friction points with a positive bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct FrictionCount {
    /// Points that slip, |u_t − d| ≥ ε.
    pub slip: u32,
    /// Points that stick, |u_t − d| < ε.
    pub stick: u32,
}

/// Total forces over all contacts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ForcePair {
    /// Normal force ∫p.
    pub normal: f64,
    /// Tangential force ∫σ_t.
    pub tangential: f64,
}

/// How far an obstacle is moved, by its loads or as given.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ObstacleMotion {
    /// Along the direction in which it is pushed (length).
    pub indentation: f64,
    /// Perpendicular to that, along t (length).
    pub tangential_displacement: f64,
    /// Counter-clockwise (radians).
    pub tilt: f64,
}

/// Columns along a contact boundary in order of arc length: one entry per node of Γ_C, or one per
/// point where friction acts.
///
/// The points where friction acts are three Gauss points per edge, also without friction; with `"points": "nodal"` the
/// nodes, except a node on the axis. At these points `normal_stress`, the gap and the displacements are the edge's,
/// quadratic between its nodes (which beside a steep peak may overshoot into a tension that no node has; profiles at
/// all points and at equally spaced ones show 0 there); `nonlocal_pressure`, `friction_bound` and `friction_ratio` are
/// the values of the law at the point; `tangential_stress` is the stress that acts in the solution, so that it adds up
/// to the forces of the summary (at a node it is the stress of the law, which differs by `Residuals::friction` of the
/// largest); and a point is open if one of the nodes beside it is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ContactProfile {
    /// Arc length from the start of the named boundary.
    pub s: Vec<f64>,
    /// Position x before deformation.
    pub x: Vec<f64>,
    /// Position y before deformation.
    pub y: Vec<f64>,
    /// Gap before deformation, obstacle profile − indentation, along the outward normal; against another body the gap that its
    /// displacement leaves.
    pub gap: Vec<f64>,
    /// Normal displacement u_n ≤ gap, along the outward normal.
    pub normal_displacement: Vec<f64>,
    /// Tangential displacement u_t, along t.
    pub tangential_displacement: Vec<f64>,
    /// Normal stress σ_n, ≤ 0 in compression.
    pub normal_stress: Vec<f64>,
    /// Tangential stress σ_t on the body, along t.
    pub tangential_stress: Vec<f64>,
    /// Averaged pressure S_ρ(p).
    pub nonlocal_pressure: Vec<f64>,
    /// Friction bound τ = μ max(S_ρ, 0).
    pub friction_bound: Vec<f64>,
    /// Friction ratio φ_ε(|u_t − d|), between 0 and 1.
    pub friction_ratio: Vec<f64>,
    /// State at the node or point.
    pub state: Vec<NodeState>,
}

impl ContactProfile {
    /// All columns of numbers.
    #[rustfmt::skip]
    fn columns(&self) -> [&Vec<f64>; 11] {
        let ContactProfile {
            s, x, y, gap, normal_displacement, tangential_displacement, normal_stress, tangential_stress,
            nonlocal_pressure, friction_bound, friction_ratio, state: _,
        } = self;
        [
            s, x, y, gap, normal_displacement, tangential_displacement, normal_stress, tangential_stress,
            nonlocal_pressure, friction_bound, friction_ratio,
        ]
    }

    /// All columns of numbers, to be written.
    #[rustfmt::skip]
    fn columns_mut(&mut self) -> [&mut Vec<f64>; 11] {
        let ContactProfile {
            s, x, y, gap, normal_displacement, tangential_displacement, normal_stress, tangential_stress,
            nonlocal_pressure, friction_bound, friction_ratio, state: _,
        } = self;
        [
            s, x, y, gap, normal_displacement, tangential_displacement, normal_stress, tangential_stress,
            nonlocal_pressure, friction_bound, friction_ratio,
        ]
    }

    /// Adds a row of another profile.
    pub(crate) fn push_row(&mut self, other: &ContactProfile, row: usize) {
        for (to, from) in self.columns_mut().into_iter().zip(other.columns()) {
            to.push(from[row]);
        }
        self.state.push(other.state[row]);
    }

    /// Inserts a row of another profile before a row of this one.
    fn insert_row(&mut self, before: usize, other: &ContactProfile, row: usize) {
        for (to, from) in self.columns_mut().into_iter().zip(other.columns()) {
            to.insert(before, from[row]);
        }
        self.state.insert(before, other.state[row]);
    }

    fn remove_row(&mut self, row: usize) {
        for column in self.columns_mut() {
            column.remove(row);
        }
        self.state.remove(row);
    }
}

/// State of a contact node, or of a point between two.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema, IntoStaticStr)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum NodeState {
    /// Not in contact.
    Open,
    /// In contact, |u_t − d| < ε.
    Stick,
    /// In contact and sliding, or in contact without friction.
    Slip,
}

impl NodeState {
    /// The name of the state in the API.
    pub fn as_str(self) -> &'static str {
        self.into()
    }
}

/// Values at all nodes of the mesh, in the order of the nodes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Fields {
    /// Position x before deformation.
    pub x: Vec<f64>,
    /// Position y before deformation.
    pub y: Vec<f64>,
    /// Displacement along x.
    pub ux: Vec<f64>,
    /// Displacement along y.
    pub uy: Vec<f64>,
    /// Recovered stress σ_xx (σ_rr).
    pub stress_xx: Vec<f64>,
    /// Recovered stress σ_yy (σ_zz in axisymmetry).
    pub stress_yy: Vec<f64>,
    /// Recovered shear stress σ_xy (σ_rz).
    pub stress_xy: Vec<f64>,
    /// Recovered out-of-plane stress σ_zz (the hoop stress σ_θθ in axisymmetry).
    pub stress_zz: Vec<f64>,
    /// −1 where the node lies on no contact boundary, else its state in the profile: 0 open, 1 stick, 2 slip; the
    /// largest number where contacts meet.
    pub contact_state: Vec<i8>,
    /// Eight or six node numbers per element: corners counter-clockwise, then midsides.
    pub elements: Vec<Element>,
    /// Where the mesh is coarse for the stresses: the norm (∫ (σ* − σ) : C⁻¹ (σ* − σ))^½ of each element's stresses σ
    /// against the recovered ones σ* ((force × length)^½). It compares elements with each other and is no error bound:
    /// see `accuracy` in the summary.
    pub element_error: Vec<f64>,
    /// Stresses at the integration points of every element, not averaged.
    pub gauss: GaussFields,
}

impl Fields {
    /// Whether all fields are finite. Checked column by column: they are nearly all numbers of a large solution, and
    /// serializing them would take ten times as long.
    pub fn is_finite(&self) -> bool {
        let Fields {
            x,
            y,
            ux,
            uy,
            stress_xx,
            stress_yy,
            stress_xy,
            stress_zz,
            contact_state: _,
            elements: _,
            element_error,
            gauss,
        } = self;
        let GaussFields {
            order: _,
            x: points_x,
            y: points_y,
            stress_xx: at_points_xx,
            stress_yy: at_points_yy,
            stress_xy: at_points_xy,
            stress_zz: at_points_zz,
        } = gauss;
        let at_nodes = [x, y, ux, uy, stress_xx, stress_yy, stress_xy, stress_zz];
        let at_points = [
            points_x,
            points_y,
            at_points_xx,
            at_points_yy,
            at_points_xy,
            at_points_zz,
        ];
        let mut columns = at_nodes.into_iter().chain(at_points).chain([element_error]);
        columns.all(|column| column.iter().all(|number| number.is_finite()))
    }
}

/// Values at the integration points, element by element. A quadrilateral has order × order of them, the
/// first local coordinate running fastest; a triangle 7 for order 3 and 3 for order 2.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GaussFields {
    /// Gauss points of an element in each direction.
    pub order: u32,
    /// Position x before deformation.
    pub x: Vec<f64>,
    /// Position y before deformation.
    pub y: Vec<f64>,
    /// Stress σ_xx (σ_rr).
    pub stress_xx: Vec<f64>,
    /// Stress σ_yy (σ_zz in axisymmetry).
    pub stress_yy: Vec<f64>,
    /// Stress σ_xy (σ_rz).
    pub stress_xy: Vec<f64>,
    /// Stress σ_zz (σ_θθ in axisymmetry).
    pub stress_zz: Vec<f64>,
}
