//! Data of a deck about contact: rigid bodies, pairs of surfaces, and their interactions.

use std::collections::BTreeMap;

use super::tool::{Piece, Point};
use super::written::{Name, Target};

/// Advice where a contact of a deck cannot be translated: to write it in a problem as JSON.
pub(super) const WRITTEN_INSTEAD: &str = "Write the contact in a problem as JSON (`contacts`: obstacle, indentation, friction) with this deck as its mesh: \"mesh\": {\"abaqus\": \"…\"}, or upload the deck and name it by its hash.";

/// The data of a deck about contact, apart from surfaces and rigid bodies, which its parts hold.
#[derive(Clone, Default)]
pub(super) struct DeckContact {
    pub(super) pairs: Vec<Pair>,
    pub(super) clearances: Vec<Clearance>,
    pub(super) interactions: BTreeMap<Name, Interaction>,
    /// The interaction that `*FRICTION` and `*SURFACE BEHAVIOR` belong to.
    pub(super) current: Option<Name>,
    /// The steps in order.
    pub(super) steps: Vec<DeckStep>,
    /// The line of the first `*STEP, PERTURBATION`.
    pub(super) perturbation: Option<u64>,
    /// Rows that mean something for rigid bodies only.
    pub(super) turning: Vec<Turning>,
}

/// A row of `*BOUNDARY` that prescribes a rotation, or of `*CLOAD` that gives a moment: for the nodes of a rigid body only.
#[derive(Clone, Debug)]
pub(super) struct Turning {
    pub(super) line: u64,
    /// 6 at a reference node, 3 at a node of rotations.
    pub(super) component: u64,
    /// What is wrong with the row at other nodes: what was found, what is expected, and advice.
    pub(super) doubt: (String, &'static str, &'static str),
}

/// A step of a deck.
#[derive(Clone)]
pub(super) struct DeckStep {
    /// The line of `*STEP`.
    pub(super) line: u64,
    /// The name of the step.
    pub(super) name: Option<String>,
    /// The number of increments that `*STATIC` begins with.
    pub(super) increments: Option<f64>,
}

impl DeckContact {
    /// The name of a step: that of the deck, if no other step has it, and otherwise one by its number from 1.
    pub(super) fn name_of(&self, step: usize) -> String {
        let own = self.steps.get(step).and_then(|step| step.name.as_deref());
        let same = |other: &&DeckStep| other.name.as_deref() == own;
        match own {
            Some(own) if self.steps.iter().filter(same).count() == 1 => own.to_owned(),
            _ => format!("Step-{}", step + 1),
        }
    }

    /// Records the number of increments that the current step begins with, from the first time increment of `*STATIC`
    /// and the length of the step's time.
    pub(super) fn note_increments(&mut self, initial: Option<f64>, period: Option<f64>) {
        let initial = initial.filter(|initial| *initial > 0.0);
        if let (Some(step), Some(initial)) = (self.steps.last_mut(), initial) {
            step.increments = Some(period.unwrap_or(1.0) / initial);
        }
    }

    /// The step, from 0, that a line of the deck belongs to; a line before the first step belongs to the first step.
    pub(super) fn step_of(&self, line: u64) -> usize {
        let begun = self.steps.partition_point(|step| step.line < line);
        begun.saturating_sub(1)
    }
}

/// An analytical surface, `*SURFACE, TYPE=SEGMENTS`.
#[derive(Clone, Debug, Default)]
pub(super) struct Analytical {
    pub(super) pieces: Vec<Piece>,
    pub(super) at: Option<Point>,
}

impl Analytical {
    /// Moves all points of the surface by the map `to`.
    pub(super) fn place(&mut self, to: impl Fn(Point) -> Point) {
        for piece in &mut self.pieces {
            *piece = piece.placed(&to);
        }
    }
}

/// A row of `*CONTACT PAIR`, or of `*TIE`.
#[derive(Clone, Debug)]
pub(super) struct Pair {
    pub(super) line: u64,
    pub(super) surfaces: [Name; 2],
    pub(super) interaction: Option<Name>,
    pub(super) adjust: Option<Adjust>,
    pub(super) tie: Option<Tie>,
}

/// That two surfaces are joined, `*TIE`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tie {
    /// The largest distance of nodes that are joined.
    pub(super) within: Option<f64>,
}

/// The distance of the surfaces of a contact pair, `*CLEARANCE`.
#[derive(Clone, Debug)]
pub(super) struct Clearance {
    pub(super) line: u64,
    /// The two surfaces in the order of the contact pair: SLAVE, MASTER.
    pub(super) surfaces: [Name; 2],
    /// The distance, negative where the surfaces overlap.
    pub(super) value: f64,
}

/// The parameter `ADJUST` of a contact pair, which moves nodes onto the other surface before the first step.
#[derive(Clone, Copy, Debug)]
pub(super) enum Adjust {
    /// Moves the nodes within this distance.
    Within(f64),
    /// Moves the nodes of a set.
    Set,
}

impl Adjust {
    /// Whether it would move a node at this distance, negative where surfaces overlap. `closed`: the largest that counts as none.
    pub(super) fn moves(self, distance: f64, closed: f64) -> bool {
        match self {
            Adjust::Within(within) => distance < -closed || distance > closed && distance <= within,
            Adjust::Set => distance.abs() > closed,
        }
    }
}

/// The definition of an interaction, `*SURFACE INTERACTION`.
#[derive(Clone, Debug, Default)]
pub(super) struct Interaction {
    pub(super) friction: Option<DeckFriction>,
    pub(super) behavior: Behavior,
}

/// The friction of an interaction, `*FRICTION`.
#[derive(Clone, Debug, Default)]
pub(super) struct DeckFriction {
    pub(super) line: u64,
    pub(super) coefficient: Option<f64>,
    /// CalculiX's stick slope: shear stress per length of slip.
    pub(super) stick_slope: Option<f64>,
    pub(super) elastic_slip: Option<f64>,
    /// The slip tolerance, in lengths of a side.
    pub(super) slip_tolerance: Option<f64>,
    pub(super) most_stress: Option<f64>,
    /// Whether the deck computes friction by Lagrange multipliers, without elastic slip.
    pub(super) lagrange: bool,
}

/// The normal behavior of an interaction, `*SURFACE BEHAVIOR`.
#[derive(Clone, Debug, Default)]
pub(super) enum Behavior {
    #[default]
    Hard,
    /// Surfaces that are joined, in CalculiX.
    Tied { line: u64 },
    /// A linear law: pressure per length of overclosure.
    Linear { line: u64, slope: Option<f64> },
    /// An exponential law, with the clearance at which the pressure begins.
    Exponential { line: u64, clearance: Option<f64> },
}

/// A row of `*BOUNDARY`: the components that it holds at a value (1: x, 2: y, 6: the rotation).
#[derive(Clone, Debug)]
pub(super) struct Held {
    pub(super) line: u64,
    pub(super) target: Target,
    pub(super) components: Vec<u64>,
    pub(super) value: f64,
    pub(super) amplitude: Option<Name>,
}

/// The keyword that the following data about contact belong to.
pub(super) enum ContactBlock {
    Segments(Name),
    Pairs {
        interaction: Option<Name>,
        adjust: Option<Adjust>,
        tie: Option<Tie>,
    },
    Friction,
    Behavior,
}

/// The definition of a rigid body, `*RIGID BODY`.
#[derive(Clone, Debug)]
pub(super) struct RigidBody {
    pub(super) line: u64,
    pub(super) made_of: MadeOf,
    /// The reference node, which moves the rigid body.
    pub(super) reference: Target,
    /// CalculiX's node whose displacements are the rotations of the body.
    pub(super) rotation: Option<Target>,
}

/// What a rigid body consists of: elements, nodes or a surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum MadeOf {
    /// An analytical surface.
    Surface(Name),
    /// A set of elements.
    Elements(Name),
    /// A set of nodes.
    Nodes(Name),
}
