//! When to stop without having met the tolerance, and what to say then.

use super::watched::relative_error;
use crate::model::estimate::MOST_ADAPTIVE_ELEMENTS;
use crate::problem::{AdaptiveRefine, Interpolation, Obstacle, Problem};
use crate::solution::{
    ErrorMethod, EstimatedQuantity, QuantityName, Refinement, Solution, Summary, Warning,
    WarningCode,
};

/// Most meshes: each about halves the smallest element.
const MOST_MESHES: usize = 30;

/// How fast errors fall is judged by so many meshes, and after this many: at a kink of the obstacle, say, they do not.
const PATIENCE: usize = 8;
const FEWEST_MESHES: usize = 12;

/// Most meshes in a row of which no error is known: none is while the obstacle between the nodes is not resolved, and each
/// mesh halves the distance of these there.
const MOST_UNKNOWN: usize = 8;

/// Why there is no finer mesh.
pub(super) enum Unmet {
    /// The tolerance is met.
    Nothing,
    /// The finer mesh would have so many elements.
    Elements(usize),
    /// It would have so many at one contact, where there may be so many.
    ContactElements(usize, usize),
    /// There were as many meshes as there may be.
    Meshes,
    /// Finer meshes make the errors smaller too slowly, or not at all.
    Stalled,
    /// The linearised problem has no unique solution, or the obstacle between the nodes is not resolved.
    Unknown,
    /// The finer mesh, of so many unknowns, would need so much memory (bytes).
    Memory { unknowns: u64, bytes: u64 },
    /// The finer mesh, of so many unknowns, has no solution: why.
    Failed(u64, String),
    /// The first mesh has no solution: why.
    First(&'static str),
    /// An element of the first mesh is so curved or crooked that its parts would be folded.
    Folded,
}

/// Whether more meshes are of no use.
pub(super) fn given_up(sequence: &[Refinement], tolerance: f64) -> Option<Unmet> {
    let errors: Vec<Option<f64>> = sequence.iter().map(|row| row.error).collect();
    let recent = |count: usize| &errors[errors.len().saturating_sub(count)..];
    let best = |errors: &[Option<f64>]| {
        errors
            .iter()
            .flatten()
            .fold(f64::INFINITY, |a, b| a.min(*b))
    };
    if errors.len() >= MOST_UNKNOWN && recent(MOST_UNKNOWN).iter().all(Option::is_none) {
        return Some(Unmet::Unknown);
    }
    if errors.len() >= MOST_MESHES {
        return Some(Unmet::Meshes);
    }
    // as the errors of the last meshes have fallen, so will those of the next
    let before = &errors[..errors.len().saturating_sub(PATIENCE)];
    let (before, now) = (best(before), best(recent(PATIENCE)));
    let falls = (before / now).ln() / PATIENCE as f64;
    let needed = (now / tolerance).ln() / falls.max(f64::MIN_POSITIVE);
    let hopeless = needed > (MOST_MESHES - errors.len()) as f64;
    (errors.len() >= FEWEST_MESHES && before.is_finite() && hopeless).then_some(Unmet::Stalled)
}

/// What stands in the way of the tolerance, or of a quantity that has no limit; none if nothing does.
pub(super) fn unfinished(
    problem: &Problem,
    goal: &AdaptiveRefine,
    solution: &Solution,
    sequence: &[Refinement],
    unmet: Unmet,
    cut: f64,
) -> Option<Warning> {
    let percent = |part: f64| match 100.0 * part {
        part if part < 10.0 => format!("{part:.2} %"),
        part => format!("{part:.0} %"),
    };
    let accuracy = solution.summary.accuracy.as_ref()?;
    let name = |q: &EstimatedQuantity| {
        format!("`{}` of contact `{}`", <&str>::from(q.quantity), q.contact)
    };
    let mut sentences = Vec::new();
    if let Unmet::First(why) = unmet {
        sentences.push(format!(
            "There is no finer mesh than the first, which has no solution: {why}."
        ));
    } else if !matches!(unmet, Unmet::Nothing) {
        let tolerance = percent(goal.tolerance);
        let mut above: Vec<&EstimatedQuantity> = accuracy.quantities.iter().collect();
        above.retain(|q| relative_error(q) > goal.tolerance);
        above.sort_by(|a, b| relative_error(b).total_cmp(&relative_error(a)));
        let known = above.first().map(|q| match relative_error(q) {
            error if error.is_finite() => {
                format!("{} is known to {} only", name(q), percent(error))
            }
            _ => format!("the error of {} is not known", name(q)),
        });
        let known = known.unwrap_or_else(|| {
            format!(
                "an end of the obstacle lies inside an edge, {} of the contact from its end",
                percent(cut)
            )
        });
        let others = match above.len() {
            0 | 1 => String::new(),
            count => format!(" (and {} more)", count - 1),
        };
        let why = match unmet {
            Unmet::Elements(count) => format!(
                "the next mesh would have {count} elements, more than {MOST_ADAPTIVE_ELEMENTS}"
            ),
            Unmet::ContactElements(count, most) => format!(
                "the next mesh would have {count} elements at one contact, more than {most}"
            ),
            Unmet::Memory { unknowns, bytes } => format!(
                "the next mesh, of {unknowns} unknowns, would need {} MiB, more than this job has left",
                bytes.div_ceil(1 << 20)
            ),
            Unmet::Failed(unknowns, why) => {
                format!("the next mesh, of {unknowns} unknowns, has no solution ({why})")
            }
            Unmet::Meshes => "there are no more meshes than that".to_owned(),
            Unmet::Stalled => {
                format!("the last {PATIENCE} have made it so little smaller that no more are tried")
            }
            Unmet::Unknown => "the linearised problem has no unique solution, or the obstacle between the nodes is still not resolved".to_owned(),
            Unmet::Folded => {
                "an element of the first mesh is so curved or crooked that its parts would be folded"
                    .to_owned()
            }
            Unmet::Nothing | Unmet::First(_) => return None,
        };
        sentences.push(format!(
            "After {} {known}{others}, and the tolerance is {tolerance}: {why}.",
            match sequence.len() {
                1 => "one mesh".to_owned(),
                count => format!("{count} meshes"),
            }
        ));
        let kinks = |q: &&&EstimatedQuantity| {
            use QuantityName::{PeakNormalStress, PeakTangentialStress};
            if !matches!(q.quantity, PeakNormalStress | PeakTangentialStress) {
                return false;
            }
            let contact = problem.contacts.iter().find(|c| c.boundary == q.contact);
            contact.is_some_and(|contact| has_kinks(&contact.obstacle))
        };
        sentences.push(match above.iter().find(kinks) {
            Some(q) => format!(
                "The obstacle of contact `{}` is a broken line, and at a kink in the contact the pressure has no limit: use the forces, which have one, and the pressure averaged over a length, or give the obstacle a smooth shape.",
                q.contact
            ),
            None => "Raise the tolerance, or begin with a mesh that is finer where the error is; see summary.refinements and summary.accuracy.".to_owned(),
        });
    }
    let touches = |summary: &Summary| summary.contacts.values().any(|c| !c.contact.is_empty());
    if !touches(&solution.summary) && solution.steps.iter().any(|step| touches(&step.summary)) {
        sentences.push(
            "At the end of the last load step nothing touches, and errors are known there only: the steps before are those of a mesh that was not refined for them. End with the step that matters."
                .to_owned(),
        );
    }
    let unlimited = accuracy
        .quantities
        .iter()
        .find(|q| q.method == ErrorMethod::NoLimit);
    if let Some(q) = unlimited {
        sentences.push(format!(
            "{} has no limit: it grows at an edge, a tip or a kink of the obstacle with every finer mesh, and no tolerance applies to it. Forces have a limit, and so has the averaged pressure.",
            name(q)
        ));
    }
    (!sentences.is_empty()).then(|| Warning {
        code: WarningCode::RefinementUnfinished,
        pointer: "/mesh/refine/tolerance".to_owned(),
        message: sentences.join(" "),
    })
}

/// The profile is made of straight pieces.
fn has_kinks(obstacle: &Obstacle) -> bool {
    match obstacle {
        Obstacle::Table {
            x, interpolation, ..
        } => x.len() > 2 && *interpolation == Interpolation::Linear,
        Obstacle::Polyline {
            points,
            interpolation,
            ..
        } => points.len() > 2 && *interpolation == Interpolation::Linear,
        _ => false,
    }
}
