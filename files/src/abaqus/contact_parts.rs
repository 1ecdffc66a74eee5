//! The parts of a deck that are about contact: rigid bodies, pairs of surfaces, and how they interact.

use std::collections::BTreeMap;

use super::tool::{Piece, Point};
use super::written::{Name, Target};

/// Where a contact that a deck cannot state here is written instead.
pub(super) const WRITTEN_INSTEAD: &str = "Write the contact in a problem as JSON (`contacts`: obstacle, indentation, friction) with this deck as its mesh: \"mesh\": {\"abaqus\": \"…\"}, or upload the deck and name it by its hash.";

/// The parts of a deck that are about contact, beside those of its parts.
#[derive(Clone, Default)]
pub(super) struct DeckContact {
    pub(super) pairs: Vec<Pair>,
    pub(super) interactions: BTreeMap<Name, Interaction>,
    /// The interaction that `*FRICTION` and `*SURFACE BEHAVIOR` belong to.
    pub(super) current: Option<Name>,
    /// The lines of `*STEP`, and the increments that `*STATIC` begins with.
    pub(super) steps: Vec<(u64, Option<f64>)>,
}

impl DeckContact {
    /// Keeps how many increments `*STATIC` begins with.
    pub(super) fn note_increments(&mut self, initial: Option<f64>, period: Option<f64>) {
        let initial = initial.filter(|initial| *initial > 0.0);
        if let (Some(step), Some(initial)) = (self.steps.last_mut(), initial) {
            step.1 = Some(period.unwrap_or(1.0) / initial);
        }
    }

    /// The step, from 0, that a line belongs to; what stands before the first step belongs to it.
    pub(super) fn step_of(&self, line: u64) -> usize {
        let begun = self.steps.partition_point(|step| step.0 < line);
        begun.saturating_sub(1)
    }
}

/// `*SURFACE, TYPE=SEGMENTS`.
#[derive(Clone, Debug, Default)]
pub(super) struct Analytical {
    pub(super) pieces: Vec<Piece>,
    pub(super) at: Option<Point>,
}

impl Analytical {
    /// Moves all its points.
    pub(super) fn place(&mut self, to: impl Fn(Point) -> Point) {
        for piece in &mut self.pieces {
            *piece = piece.placed(&to);
        }
    }
}

/// A row of `*CONTACT PAIR`.
#[derive(Clone, Debug)]
pub(super) struct Pair {
    pub(super) line: u64,
    pub(super) surfaces: [Name; 2],
    pub(super) interaction: Option<Name>,
    pub(super) adjust: Option<Adjust>,
}

/// `ADJUST`: nodes are moved onto the other surface before the first step.
#[derive(Clone, Copy, Debug)]
pub(super) enum Adjust {
    /// Those nearer than a length.
    Within(f64),
    /// Those of a set.
    Set,
}

/// `*SURFACE INTERACTION`.
#[derive(Clone, Debug, Default)]
pub(super) struct Interaction {
    pub(super) friction: Option<DeckFriction>,
    pub(super) behavior: Behavior,
}

/// `*FRICTION`.
#[derive(Clone, Debug, Default)]
pub(super) struct DeckFriction {
    pub(super) line: u64,
    pub(super) coefficient: Option<f64>,
    /// CalculiX: shear stress per length of slip.
    pub(super) stick_slope: Option<f64>,
    pub(super) elastic_slip: Option<f64>,
    /// In lengths of a side.
    pub(super) slip_tolerance: Option<f64>,
    pub(super) most_stress: Option<f64>,
    /// Without elastic slip.
    pub(super) lagrange: bool,
}

/// `*SURFACE BEHAVIOR`.
#[derive(Clone, Debug, Default)]
pub(super) enum Behavior {
    #[default]
    Hard,
    /// Pressure per length of overclosure.
    Linear { line: u64, slope: Option<f64> },
    /// The clearance at which the pressure begins.
    Exponential { line: u64, clearance: Option<f64> },
}

/// A row of `*BOUNDARY`: components (6: the rotation) are held at a value.
#[derive(Clone, Debug)]
pub(super) struct Held {
    pub(super) line: u64,
    pub(super) target: Target,
    pub(super) components: Vec<u64>,
    pub(super) value: f64,
    pub(super) amplitude: Option<Name>,
}

/// The keyword that data about contact belong to.
pub(super) enum ContactBlock {
    Segments(Name),
    Pairs {
        interaction: Option<Name>,
        adjust: Option<Adjust>,
    },
    Friction,
    Behavior,
}

/// `*RIGID BODY`.
#[derive(Clone, Debug)]
pub(super) struct RigidBody {
    pub(super) line: u64,
    pub(super) made_of: MadeOf,
    /// The node that moves it.
    pub(super) reference: Target,
    /// CalculiX: the node whose displacements are its rotations.
    pub(super) rotation: Option<Target>,
}

/// What a rigid body is made of.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum MadeOf {
    /// An analytical surface.
    Surface(Name),
    /// A set of elements.
    Elements(Name),
    /// A set of nodes.
    Nodes(Name),
}
