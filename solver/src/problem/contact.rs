//! A boundary that faces a rigid obstacle or another body: what faces it, and the friction law.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::VariantArray;

/// A boundary that may touch a rigid obstacle or another elastic body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Name of the boundary.
    pub boundary: String,
    /// The rigid obstacle that faces the boundary. Required unless `against` is set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obstacle: Option<Obstacle>,
    /// The boundary of another elastic body that faces this one, in place of an obstacle. This boundary carries the law: it
    /// should be the finer one, or of equally fine ones that which is covered as a whole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub against: Option<Against>,
    /// The distance of the two bodies before deformation, the same everywhere, in place of the distance of their meshes: for
    /// curved bodies that fit one another, whose meshes overlap or gape by more than the bodies do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap: Option<BodyGap>,
    /// How far the obstacle is pushed against the body (length, either sign):
    /// gap = profile − indentation.
    #[serde(default)]
    pub indentation: f64,
    /// The force that presses the obstacle against the body along `direction` (force, that part of `force` in the summary; on a
    /// straight boundary its `normal_force`; in a half model that of the half), instead of an indentation: the obstacle moves
    /// along `direction` until it is in equilibrium.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal_force: Option<f64>,
    /// The direction `[x, y]` that the indentation moves the obstacle along, as a rigid body; its length does not
    /// matter. Absent: against the body's normal at each node, which on a curved boundary is no motion of a rigid body.
    /// An obstacle with a force, a moment or a tilt moves as a rigid body, and needs a direction on a curved boundary.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 2]>,
    /// Displacement of the obstacle along t, the outward normal turned clockwise (length). The contact stays on the
    /// material that faced the obstacle before: keep the slip below the contact's length.
    #[serde(default)]
    pub tangential_displacement: f64,
    /// The force on the body along t (force, as `tangential_force` of the summary), instead of a tangential displacement: the
    /// obstacle moves perpendicular to `direction` until it is in equilibrium.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tangential_force: Option<f64>,
    /// The angle by which the obstacle is turned about `about`, counter-clockwise (radians, as a small rotation).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tilt: Option<f64>,
    /// The moment on the body about `about`, counter-clockwise (force × length), instead of a tilt: the obstacle turns until
    /// it is in equilibrium. A normal force P at a distance e from `about` along t is a moment −P e about that point.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moment: Option<f64>,
    /// The point `[x, y]` of `tilt` and `moment`, through which `normal_force` and `tangential_force` act. With one of these
    /// forces alone: the point about which the result states the moment that keeps the obstacle from turning.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<[f64; 2]>,
    /// Springs between an obstacle under forces and the ground, such as the testing machine: they bear their part of the
    /// forces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<ObstacleStiffness>,
    /// The direction that gap and normal displacement are measured along; absent: `body`, and `mean` against another body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<NormalOf>,
    /// The contact condition.
    #[serde(default)]
    pub condition: Condition,
    /// The friction law; absent: frictionless.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<Friction>,
}

/// The boundary of another elastic body.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Against {
    /// Name of the boundary.
    pub boundary: String,
}

/// The distance of two bodies before deformation, the same everywhere: exactly one of its fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodyGap {
    /// They overlap by that much, > 0 (length), as a shaft in its hub; load steps scale it by `indentation`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interference: Option<f64>,
    /// They are that far apart, ≥ 0 (length).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clearance: Option<f64>,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// Springs between an obstacle and the ground, each against a motion that a force or moment causes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ObstacleStiffness {
    /// Against the indentation, ≥ 0 (force / length).
    #[serde(skip_serializing_if = "is_zero")]
    pub normal: f64,
    /// Against the tangential displacement, ≥ 0 (force / length).
    #[serde(skip_serializing_if = "is_zero")]
    pub tangential: f64,
    /// Against the tilt, ≥ 0 (force × length).
    #[serde(skip_serializing_if = "is_zero")]
    pub rotational: f64,
}

impl Contact {
    /// The given load along each motion of the obstacle: its normal force, its tangential force and its moment.
    pub fn obstacle_loads(&self) -> [Option<f64>; 3] {
        [self.normal_force, self.tangential_force, self.moment]
    }

    /// The given motions of the obstacle: its indentation, its tangential displacement and its tilt.
    pub fn obstacle_motions(&self) -> [f64; 3] {
        [
            self.indentation,
            self.tangential_displacement,
            self.tilt.unwrap_or(0.0),
        ]
    }

    /// The normal that the contact uses.
    pub fn used_normal(&self) -> NormalOf {
        let usual = match self.against {
            None => NormalOf::Body,
            Some(_) => NormalOf::Mean,
        };
        self.normal.unwrap_or(usual)
    }

    /// Whether this boundary carries the law, or faces the one that does.
    pub fn is_on(&self, boundary: &str) -> bool {
        let against = self.against.as_ref();
        self.boundary == boundary || against.is_some_and(|other| other.boundary == boundary)
    }

    /// How far the bodies overlap, or the obstacle is pushed, at the end of the load path (length).
    pub(crate) fn pushed(&self) -> f64 {
        let overlap = self.gap.and_then(|gap| gap.interference);
        overlap.unwrap_or(self.indentation)
    }

    /// Whether the obstacle moves as a rigid body whose equilibrium matters: it has a load, or a tilt.
    pub fn is_tool(&self) -> bool {
        self.tilt.is_some() || self.obstacle_loads().iter().any(Option::is_some)
    }
}

/// The normal that a contact uses. On a sloping obstacle the body's and the obstacle's normal differ, and so do the
/// forces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NormalOf {
    /// The body's outward normal, as in the thesis.
    #[default]
    Body,
    /// The normal of the obstacle where it faces the node; the gap is measured to the tangent there.
    Obstacle,
    /// The mean of the body's normal and the opposite normal of the other body where it faces the node.
    Mean,
}

/// The contact condition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Condition {
    /// u_n ≤ gap, and only pressure: thesis (1.14).
    #[default]
    Unilateral,
    /// u_n = gap and u_t = d on all of Γ_C; stresses of either sign.
    Bonded,
    /// No obstacle: only friction with a prescribed bound.
    None,
}

/// Declares the kinds of obstacle, each with the three fields that all kinds have.
macro_rules! obstacles {
    ($($(#[$doc:meta])* $kind:ident { $($(#[$attribute:meta])* $field:ident: $type:ty,)* })*) => {
        /// Shape of a rigid obstacle: its distance from the boundary before it is pushed, as a function of a coordinate
        /// c along the boundary; or a curve in the plane.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
        pub enum Obstacle {
            $($(#[$doc])* $kind {
                $($(#[$attribute])* $field: $type,)*
                /// Where the obstacle begins; absent: at the start of the boundary.
                #[serde(default, skip_serializing_if = "Option::is_none")]
                from: Option<f64>,
                /// Where the obstacle ends; absent: at the end of the boundary.
                #[serde(default, skip_serializing_if = "Option::is_none")]
                to: Option<f64>,
                /// The coordinate c along the boundary.
                #[serde(default)]
                along: Along,
            },)*
        }

        impl Obstacle {
            /// The fields `from`, `to` and `along`, which all kinds have.
            pub fn span(&self) -> (Option<f64>, Option<f64>, Along) {
                match *self {
                    $(Obstacle::$kind { from, to, along, .. } => (from, to, along),)*
                }
            }
        }
    };
}

obstacles! {
    /// Profile 0: a flat face.
    Flat {}
    /// Profile R − √(R² − (c − center)²); there is no obstacle beyond R.
    Circle {
        /// Radius R > 0 (length).
        radius: f64,
        /// Coordinate where the profile is zero.
        #[serde(default)]
        center: f64,
    }
    /// Profile (c − center)² / (2 radius).
    Parabola {
        /// Radius of curvature at the apex, > 0 (length).
        radius: f64,
        /// Coordinate where the profile is zero.
        #[serde(default)]
        center: f64,
    }
    /// Profile |c − center| tan(angle).
    Wedge {
        /// Angle between face and surface, 0 < angle < 90 (degrees).
        angle: f64,
        /// Coordinate where the profile is zero.
        #[serde(default)]
        center: f64,
    }
    /// Profile |c − center| tan(angle): a wedge of revolution.
    Cone {
        /// Angle between face and surface, 0 < angle < 90 (degrees).
        angle: f64,
        /// Coordinate where the profile is zero.
        #[serde(default)]
        center: f64,
    }
    /// Profile slope · (c − center).
    Tilted {
        /// Rise per length of c.
        slope: f64,
        /// Coordinate where the profile is zero.
        #[serde(default)]
        center: f64,
    }
    /// Profile coefficient · |c − center|^exponent.
    Power {
        /// Coefficient > 0 (length^(1 − exponent)).
        coefficient: f64,
        /// Exponent ≥ 1.
        exponent: f64,
        /// Coordinate where the profile is zero.
        #[serde(default)]
        center: f64,
    }
    /// Profile 0 up to `half_width` from the center, then a circle that leaves it tangentially; there
    /// is no obstacle beyond half_width + radius.
    RoundedFlat {
        /// Half the width of the flat part, ≥ 0 (length).
        half_width: f64,
        /// Radius of the rounding, > 0 (length).
        radius: f64,
        /// Coordinate of the middle of the flat part.
        #[serde(default)]
        center: f64,
    }
    /// Profile by a table of points; there is no obstacle outside of it.
    Table {
        /// Coordinates c, strictly increasing; at most 100,000.
        x: Vec<f64>,
        /// Profile at the coordinates `x` (length, any sign).
        gap: Vec<f64>,
        /// The shape between the points.
        #[serde(default, skip_serializing_if = "Interpolation::is_linear")]
        interpolation: Interpolation,
        /// For a measured profile: the curve passes near the points instead of through them. Requires the interpolation
        /// `cubic`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        smoothing: Option<Smoothing>,
    }
    /// A polyline or smooth curve through points; the profile is the distance along the body's normal.
    Polyline {
        /// The points `[x, y]`; at most 10,000.
        points: Vec<[f64; 2]>,
        /// The shape between the points.
        #[serde(default, skip_serializing_if = "Interpolation::is_linear")]
        interpolation: Interpolation,
    }
    /// A straight line, infinitely long; the profile is the distance along the body's normal.
    Line {
        /// A point `[x, y]` of the line.
        point: [f64; 2],
        /// Angle from x to the line, counter-clockwise (degrees).
        angle: f64,
    }
}

/// The shape of an obstacle between its points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// Straight lines. Every point is a kink, at which the pressure has no limit as the mesh is refined.
    #[default]
    Linear,
    /// A cubic spline, whose slope and curvature have no jumps. For a table it reproduces parabolas and cubics exactly
    /// (its ends are not-a-knot); for a polyline its parameter is the length of the chords.
    Cubic,
}

impl Interpolation {
    fn is_linear(&self) -> bool {
        *self == Interpolation::Linear
    }
}

/// How far the points of a measured profile may be from the curve. Among all curves with
/// Σ((gap − curve)/standard_deviation)² ≤ number of points, the one whose curvature changes least is taken. What the
/// deviation leaves open of forces, peaks and extents is part of their stated errors: the problem is solved for 24
/// more profiles that could have been measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Smoothing {
    /// Standard deviation of the error of one point, > 0 (length).
    pub standard_deviation: f64,
}

impl Smoothing {
    /// The number of profiles for which the problem is solved once more, to find what the deviation leaves open.
    pub const SAMPLES: u32 = 24;
}

/// The coordinate c along a contact boundary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Along {
    /// The position x.
    #[default]
    X,
    /// Arc length from the start of the named boundary, along t.
    ArcLength,
}

/// The nonlocal, nonlinear friction law of Oden and Pires, thesis (1.8):
/// σ_t = −τ φ_ε(|u_t − d|) sign(u_t − d), τ = min(shear_cap, cohesion + coefficient · S_ρ(p)) where
/// S_ρ(p) > 0; or with a prescribed `bound` τ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// Friction coefficient μ ≥ 0 (the thesis's ν). Required unless `bound` is set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coefficient: Option<f64>,
    /// Radius ρ ≥ 0 (length): the pressure is averaged over this distance. 0: Coulomb's local law. Required unless
    /// `bound` is set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nonlocal_radius: Option<f64>,
    /// Elastic slip ε > 0 (length): the tangential displacement at which the friction bound is reached. It has no default,
    /// because it is a length. If it is not known from a measurement, take a thousandth of the slip in the problem: of
    /// `indentation` or `tangential_displacement`, whichever is larger in size. Friction is then close to Coulomb's; a smaller
    /// one needs a finer mesh.
    pub elastic_slip: f64,
    /// Shape of the averaging kernel.
    #[serde(default)]
    pub kernel: Kernel,
    /// Scale of the averaging kernel.
    #[serde(default)]
    pub normalization: Normalization,
    /// The transition φ_ε from stick to slip.
    #[serde(default)]
    pub transition: Transition,
    /// Whether friction depends on the load path.
    #[serde(default)]
    pub history: History,
    /// The points where friction is evaluated.
    #[serde(default)]
    pub points: FrictionPoints,
    /// The domain of the averaging integral in axisymmetry.
    #[serde(default)]
    pub measure: Measure,
    /// Cohesion ≥ 0 (stress), added to μ S wherever S > 0.
    #[serde(default)]
    pub cohesion: f64,
    /// Upper limit of τ, > 0 (stress); absent: no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shear_cap: Option<f64>,
    /// A prescribed τ ≥ 0 (Tresca's law) instead of coefficient, radius, cohesion and cap. It acts on all of Γ_C,
    /// with or without contact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bound: Option<PrescribedBound>,
}

/// The elastic slip as a part of the slip, where it is not known: forces then differ from Coulomb's by about a hundredth at
/// most, and the meshes of the examples bear it.
pub const SLIP_PART: f64 = 1e-3;

/// The rule for an elastic slip that is not known from a measurement, in words, with its value for an obstacle that is moved
/// this far (lengths). An obstacle that is not moved at all, as where loads press the body, gives no value.
pub fn elastic_slip_rule(indentation: f64, tangential_displacement: f64) -> String {
    let moved = indentation.abs().max(tangential_displacement.abs());
    let value = SLIP_PART * moved;
    if value > 0.0 && value.is_finite() {
        format!(
            "If it is not known, take a thousandth of the slip, here of the displacement of what the body touches: {value:.1e}."
        )
    } else {
        "If it is not known, take a thousandth of the slip that you expect, such as the displacement of the body beside the obstacle."
            .to_owned()
    }
}

/// A prescribed friction bound τ (stress).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum PrescribedBound {
    /// The same value everywhere.
    Constant(f64),
    /// A table over arc length, linear between points; zero outside.
    Table(BoundTable),
}

/// A friction bound by arc length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoundTable {
    /// Arc length from the start of the named boundary, strictly increasing.
    pub s: Vec<f64>,
    /// Friction bound τ at the places `s`, ≥ 0 (stress).
    pub bound: Vec<f64>,
}

/// The points where friction is evaluated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FrictionPoints {
    /// At three Gauss points per edge. On a coarse mesh and with a small elastic slip the
    /// tangential stress may oscillate inside stick.
    #[default]
    Gauss3,
    /// At the nodes; the tangential stress does not oscillate.
    Nodal,
}

/// The domain of the averaging integral in axisymmetry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Arc length along the meridian, as in the thesis.
    #[default]
    Line,
    /// The contact surface itself, as rings.
    Surface,
}

/// Shape of the averaging kernel ω_ρ, thesis 1.2.1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kernel {
    /// The bump C exp(ρ²/(x² − ρ²)), thesis (1.2).
    #[default]
    Bump,
    /// The parabola C (1 − x²/ρ²).
    Parabola,
}

/// Scale of the averaging kernel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Normalization {
    /// ∫ω = 1 on a line: tends to Coulomb's law as ρ → 0.
    #[default]
    UnitIntegral,
    /// ω(0) = 1, the literal text of the thesis; friction then vanishes with ρ.
    PeakOne,
    /// As `unit_integral`, divided by the part of the integral that lies on the contact boundary: no friction is lost
    /// beyond its ends, and at full sliding friction is μ times the normal force. For `measure: line`.
    Conserving,
}

/// The transition φ_ε from stick to slip, thesis (1.7).
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, VariantArray,
)]
#[serde(rename_all = "snake_case")]
pub enum Transition {
    /// min(|u|/ε, 1), thesis (1.7b).
    #[default]
    Linear,
    /// tanh(|u|/ε), thesis (1.7a).
    Tanh,
}

/// Whether friction depends on the load path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum History {
    /// Friction depends on the total displacement, as in the thesis.
    #[default]
    Total,
    /// Friction depends on the displacement since the point last slipped: each point keeps an anchor,
    /// docs/formulation.md 1.5. For the linear transition only.
    Incremental,
}
