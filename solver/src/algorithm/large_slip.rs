//! Whether a body slides farther than its contact is long. Gaps are those of the places before deformation: however far a
//! body slides, its contact stays on the same material, which is then not where the obstacle is.

use crate::algorithm::system::{Patch, System};
use crate::error::rounded;
use crate::problem::Condition;
use crate::solution::{Warning, WarningCode};

/// Slip in lengths of the contact above which no point that touches would still do so.
const LARGE_SLIP: f64 = 1.0;

/// A piece of contact: how far the body slides along the obstacle there, the mean over the pressure, and its length.
struct Sliding {
    slip: f64,
    length: f64,
}

impl Sliding {
    fn lengths(&self) -> f64 {
        self.slip.abs() / self.length
    }
}

/// Warns once, of the piece of contact that slides by most of its lengths; true if it does.
pub(super) fn warn_of_large_slip(
    system: &System<'_>,
    v: &[f64],
    reactions: &[f64],
    warnings: &mut Vec<Warning>,
) -> bool {
    let of_patch = |patch| pieces(system, patch, v, reactions).map(move |piece| (patch, piece));
    let largest = system
        .patches
        .iter()
        .flat_map(of_patch)
        .max_by(|a, b| a.1.lengths().total_cmp(&b.1.lengths()));
    let Some((patch, piece)) = largest.filter(|(_, piece)| piece.lengths() > LARGE_SLIP) else {
        return false;
    };
    warnings.push(Warning {
        code: WarningCode::LargeSlip,
        pointer: patch.contact.pointer.clone(),
        message: format!(
            "Where it touches, the body slides along the obstacle by {:?} on average, and the contact is {:?} long: in linear kinematics it stays on the material that touched at first. Slide by less, or place the obstacle where it ends and press there.",
            rounded(piece.slip.abs()),
            rounded(piece.length)
        ),
    });
    true
}

/// The pieces of a contact that can slide as a whole, and matter: not one that ends on a line of symmetry, and not along
/// a straight obstacle without ends.
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
