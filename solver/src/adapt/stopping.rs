//! When refinement stops without having met the tolerance, and how the warning explains that.

use super::mesh_results::relative_error;
use crate::model::estimate::MOST_ADAPTIVE_ELEMENTS;
use crate::problem::{AdaptiveRefine, Obstacle, Problem};
use crate::solution::{
    EstimatedQuantity, QuantityName, Refinement, Solution, Summary, Warning, WarningCode,
};

/// The largest number of meshes.
const MOST_MESHES: usize = 30;

/// The number of meshes by which the decrease of errors is judged. At a kink of the obstacle, for example, errors do
/// not decrease.
const PATIENCE: usize = 5;
/// The number of meshes before refinement stops because errors decrease too slowly.
const FEWEST_MESHES: usize = 8;

/// The largest number of meshes in a row without a known error. Errors are unknown while the obstacle between the nodes
/// is not resolved; each mesh halves the distance of the nodes where this is so.
const MOST_UNKNOWN: usize = 8;

/// Why refinement stopped.
pub(super) enum StopReason {
    /// The tolerance is met.
    Nothing,
    /// The next mesh would have more elements than allowed: the number of its elements.
    Elements(usize),
    /// The next mesh would have too many elements at one contact: the number of these, and the largest number allowed.
    ContactElements(usize, usize),
    /// The largest number of meshes is reached.
    Meshes,
    /// Finer meshes reduce the errors too slowly, or not at all.
    Stalled,
    /// The linearised problem has no unique solution, or the obstacle between the nodes is not resolved.
    Unknown,
    /// The next mesh would need more memory than the job has left (bytes).
    Memory { unknowns: u64, bytes: u64 },
    /// The next mesh has no solution: its number of unknowns, and the reason.
    Failed(u64, String),
    /// The first mesh has no solution: the reason.
    First(&'static str),
    /// An element of the first mesh is so curved or distorted that its parts would be inverted.
    Inverted,
}

impl StopReason {
    /// The reason in words, for the last mesh; `None` if the tolerance is met or the first mesh has no solution.
    fn why(&self) -> Option<String> {
        Some(match self {
            StopReason::Elements(count) => format!(
                "the next mesh would have {count} elements, more than {MOST_ADAPTIVE_ELEMENTS}"
            ),
            StopReason::ContactElements(count, most) => format!(
                "the next mesh would have {count} elements at one contact, more than {most}"
            ),
            StopReason::Memory { unknowns, bytes } => format!(
                "the next mesh, with {unknowns} unknowns, would need {} MiB, more than this job has left",
                bytes.div_ceil(1 << 20)
            ),
            StopReason::Failed(unknowns, why) => {
                format!("the next mesh, with {unknowns} unknowns, has no solution ({why})")
            }
            StopReason::Meshes => "more meshes are not allowed".to_owned(),
            StopReason::Stalled => {
                format!("the last {PATIENCE} meshes hardly reduced the error")
            }
            StopReason::Unknown => "the linearised problem has no unique solution, or the obstacle between the nodes is still not resolved".to_owned(),
            StopReason::Inverted => {
                "an element of the first mesh is so curved or distorted that its parts would be inverted"
                    .to_owned()
            }
            StopReason::Nothing | StopReason::First(_) => return None,
        })
    }
}

/// Why more meshes would not help; `None` if they may help.
pub(super) fn given_up(sequence: &[Refinement], tolerance: f64) -> Option<StopReason> {
    let errors: Vec<Option<f64>> = sequence.iter().map(|row| row.error).collect();
    let recent = |count: usize| &errors[errors.len().saturating_sub(count)..];
    let best = |errors: &[Option<f64>]| {
        errors
            .iter()
            .flatten()
            .fold(f64::INFINITY, |a, b| a.min(*b))
    };
    if errors.len() >= MOST_UNKNOWN && recent(MOST_UNKNOWN).iter().all(Option::is_none) {
        return Some(StopReason::Unknown);
    }
    if errors.len() >= MOST_MESHES {
        return Some(StopReason::Meshes);
    }
    // as the errors of the last meshes have fallen, so will those of the next
    let before = &errors[..errors.len().saturating_sub(PATIENCE)];
    let (before, now) = (best(before), best(recent(PATIENCE)));
    let falls = (before / now).ln() / PATIENCE as f64;
    let needed = (now / tolerance).ln() / falls.max(f64::MIN_POSITIVE);
    let hopeless = needed > (MOST_MESHES - errors.len()) as f64;
    (errors.len() >= FEWEST_MESHES && before.is_finite() && hopeless).then_some(StopReason::Stalled)
}

/// The warning that says why the tolerance is not met; `None` if it is. A quantity that grows without bound has no
/// tolerance to meet: the reasons of the verdict name it.
pub(super) fn unfinished(
    problem: &Problem,
    goal: &AdaptiveRefine,
    solution: &Solution,
    sequence: &[Refinement],
    reason: StopReason,
    truncation: f64,
) -> Option<Warning> {
    let accuracy = solution.summary.accuracy.as_ref()?;
    let mut sentences = Vec::new();
    if let StopReason::First(why) = reason {
        sentences.push(format!(
            "The mesh was not refined, since the problem has no solution on the first mesh: {why}."
        ));
    } else if let Some(why) = reason.why() {
        let mut above: Vec<&EstimatedQuantity> = accuracy.quantities.iter().collect();
        above.retain(|q| relative_error(q) > goal.tolerance);
        above.sort_by(|a, b| relative_error(b).total_cmp(&relative_error(a)));
        sentences.push(format!(
            "Refinement ended after {} ({why}): {}, and the tolerance is {}.",
            match sequence.len() {
                1 => "one mesh".to_owned(),
                count => format!("{count} meshes"),
            },
            remaining(&above, truncation),
            percent(goal.tolerance)
        ));
        sentences.push(advice(problem, &above));
    }
    let touches = |summary: &Summary| summary.contacts.values().any(|c| !c.contact.is_empty());
    if !touches(&solution.summary) && solution.steps.iter().any(|step| touches(&step.summary)) {
        sentences.push(
            "Nothing is in contact at the end of the last load step, and errors are estimated only there. The mesh was not refined for the earlier steps. End with the step that matters."
                .to_owned(),
        );
    }
    (!sentences.is_empty()).then(|| Warning {
        code: WarningCode::RefinementUnfinished,
        pointer: "/mesh/refine/tolerance".to_owned(),
        message: sentences.join(" "),
    })
}

/// What remains above the tolerance: the quantities, the worst first, or else the truncation of the obstacle.
fn remaining(above: &[&EstimatedQuantity], truncation: f64) -> String {
    let Some(worst) = above.first() else {
        return format!(
            "the obstacle ends inside an edge, {} of the contact's length from the end of that edge",
            percent(truncation)
        );
    };
    let error = match relative_error(worst) {
        error if error.is_finite() => percent(error),
        _ => "unknown".to_owned(),
    };
    let others = match above.len() {
        1 => String::new(),
        2 => " (another quantity is above the tolerance too)".to_owned(),
        count => format!(
            " ({} other quantities are above the tolerance too)",
            count - 1
        ),
    };
    format!("the error of {} is {error}{others}", name(worst))
}

/// What to do about the quantities above the tolerance.
fn advice(problem: &Problem, above: &[&EstimatedQuantity]) -> String {
    let kinks = |q: &&&EstimatedQuantity| {
        use QuantityName::{PeakNormalStress, PeakTangentialStress};
        if !matches!(q.quantity, PeakNormalStress | PeakTangentialStress) {
            return false;
        }
        let contact = problem.contacts.iter().find(|c| c.boundary == q.contact);
        let obstacle = contact.and_then(|contact| contact.obstacle.as_ref());
        obstacle.is_some_and(Obstacle::has_kinks)
    };
    match above.iter().find(kinks) {
        Some(q) => format!(
            "The obstacle of contact `{}` has kinks, and the pressure at a kink grows without limit: use the forces, which converge, and the pressure averaged over a length, or give the obstacle a smooth shape.",
            q.contact
        ),
        None => "Raise the tolerance, or start with a mesh that is finer where the error is large; see summary.refinements and summary.accuracy.".to_owned(),
    }
}

fn name(q: &EstimatedQuantity) -> String {
    format!("`{}` of contact `{}`", <&str>::from(q.quantity), q.contact)
}

fn percent(part: f64) -> String {
    match 100.0 * part {
        part if part < 10.0 => format!("{part:.2} %"),
        part => format!("{part:.0} %"),
    }
}
