//! A warning for bodies that slide farther than their contact is long. Gaps are evaluated at the places before
//! deformation: however far a body slides, contact stays at the same points of the material, which then are no longer
//! at the obstacle.

use crate::algorithm::system::{Patch, System};
use crate::error::rounded;
use crate::problem::Condition;
use crate::solution::{Warning, WarningCode};

/// The largest slip, in lengths of the contact, without a warning: with more slip no point that touches would still
/// touch.
const LARGE_SLIP: f64 = 1.0;

/// A piece of contact: its mean slip along the obstacle, weighted by the pressure, and its length.
struct Sliding {
    slip: f64,
    length: f64,
}

impl Sliding {
    fn lengths(&self) -> f64 {
        self.slip.abs() / self.length
    }
}

/// A warning about the piece of contact with the largest slip in relation to its length, if that is above
/// [`LARGE_SLIP`].
pub(super) fn large_slip(system: &System<'_>, v: &[f64], reactions: &[f64]) -> Option<Warning> {
    let of_patch = |patch| pieces(system, patch, v, reactions).map(move |piece| (patch, piece));
    let largest = system
        .patches
        .iter()
        .flat_map(of_patch)
        .max_by(|a, b| a.1.lengths().total_cmp(&b.1.lengths()));
    let (patch, piece) = largest.filter(|(_, piece)| piece.lengths() > LARGE_SLIP)?;
    Some(Warning {
        code: WarningCode::LargeSlip,
        pointer: patch.contact.pointer.clone(),
        message: format!(
            "The body slides along {} by {:?} on average where it touches, and the contact is only {:?} long. In linear kinematics the contact stays on the material that touched at first. Slide less far, or place {} in its final position and press there.",
            patch.contact.opposite(),
            rounded(piece.slip.abs()),
            rounded(piece.length),
            patch.contact.opposite()
        ),
    })
}

/// The pieces of a contact that can slide as a whole. Pieces that end on a line of symmetry are left out, and so is
/// contact along a straight obstacle without ends, where slip does not matter.
fn pieces<'a>(
    system: &'a System<'_>,
    patch: &'a Patch<'_>,
    v: &'a [f64],
    reactions: &'a [f64],
) -> impl Iterator<Item = Sliding> + use<'a> {
    let range = system.range(patch);
    let s = &patch.contact.boundary.s;
    let last = s.len() - 1;
    let touches = |i: usize| reactions[range.start + i] > 0.0;
    let mut found = Vec::new();
    let mut next = 0;
    while patch.contact.condition == Condition::Unilateral && !patch.contact.endless && next <= last
    {
        let first = next;
        next += 1;
        if !touches(first) {
            continue;
        }
        while next <= last && touches(next) {
            next += 1;
        }
        let end = next - 1;
        let symmetric = |i: usize| {
            let node = &system.nodes[range.start + i];
            (i == 0 || i == last) && (node.on_axis || node.symmetric())
        };
        if symmetric(first) || symmetric(end) {
            continue;
        }
        let (mut moved, mut pressed) = (0.0, 0.0);
        for i in range.start + first..=range.start + end {
            let slip = system.tangential_displacement(v, i) - system.nodes[i].drag;
            moved += reactions[i] * slip;
            pressed += reactions[i];
        }
        found.push(Sliding {
            slip: moved / pressed,
            // contact may reach up to the next nodes
            length: s[(end + 1).min(last)] - s[first.saturating_sub(1)],
        });
    }
    found.into_iter()
}
