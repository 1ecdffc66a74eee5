//! Writes results as text: a line for each iteration, a summary, a table of stresses.

use std::fmt::{Display, Write};

use base::job::Job;
use base::run::{Document, Summary};
use files::stress::von_mises;
use solver::solution::{
    Accuracy, ContactProfile, ContactSummary, ErrorMethod, EstimatedQuantity, Fields, Iteration,
    NodeState, Outcome, Peak, Phase, QuantityName, Refinement,
};

use super::table::harmless;

/// The largest number of reasons of a verdict that are shown.
const MOST_REASONS: usize = 5;

/// The text that says that a phase begins.
pub(super) fn phase(phase: Phase) -> &'static str {
    match phase {
        Phase::Verify => "verify: solving again, to find the errors",
        phase => phase.as_str(),
    }
}

/// The text that says that adaptive refinement begins with a mesh; `error`: the largest error on the mesh before.
pub(super) fn mesh(number: u32, elements: u64, error: Option<f64>) -> String {
    let before = error.map_or(String::new(), |error| {
        format!("; largest error before {:.2} %", 100.0 * error)
    });
    format!("mesh {number}: {elements} elements{before}")
}

/// Writes a row of the history as one line.
pub(super) fn iteration(row: &Iteration) -> String {
    let mut line = format!(
        "{:>4}  {:<12}  residual {:8.2e}  friction {:8.2e}  contact {:>3} (+{} -{})",
        row.k,
        row.stage.as_str(),
        row.residual,
        row.friction_residual,
        row.contact.active,
        row.contact.entered,
        row.contact.left
    );
    if let Some(q) = row.contraction {
        let _ = write!(line, "  q {q:.3}");
    }
    if row.step + row.increment > 0 {
        // as `?step=` and `--step` count them
        let _ = write!(line, "  step {}", row.step);
    }
    if row.increment > 0 {
        let _ = write!(line, ", increment {}", row.increment + 1);
    }
    line
}

/// Writes facts, each on a line after its name.
pub(super) fn lines(facts: impl Iterator<Item = (impl Display, String)>) -> String {
    facts
        .map(|(name, value)| format!("{name:<20}{}\n", harmless(&value)))
        .collect()
}

/// Writes a document: its summary with a title.
pub(super) fn document(title: Option<&str>, document: &Document) -> String {
    let steps = document.steps.iter();
    let steps = steps.map(|step| (step.name.as_str(), &step.summary));
    let mut text = result(title, &document.summary, steps);
    if document.summary.solution.contacts.is_empty() {
        text += &lines(largest(&document.fields).into_iter());
    }
    text
}

/// Of a problem without contact: the largest displacement and the largest von Mises stress at a node, and where.
fn largest(fields: &Fields) -> Vec<(&'static str, String)> {
    let nodes = 0..fields.x.len();
    let displacement = |i: usize| fields.ux[i].hypot(fields.uy[i]);
    let stress = |i: usize| {
        let [xx, yy] = [fields.stress_xx[i], fields.stress_yy[i]];
        von_mises([xx, yy, fields.stress_xy[i], fields.stress_zz[i]])
    };
    let most = |value: &dyn Fn(usize) -> f64| {
        let node = nodes
            .clone()
            .max_by(|a, b| value(*a).total_cmp(&value(*b)))?;
        Some((node, value(node)))
    };
    let moved = most(&displacement).map(|(i, value)| {
        let [ux, uy] = [fields.ux[i], fields.uy[i]].map(number);
        format!(
            "at most {} ({ux}, {uy}) at ({}, {})",
            number(value),
            fields.x[i],
            fields.y[i]
        )
    });
    let stressed = most(&stress).map(|(i, value)| {
        format!(
            "at most {} at ({}, {})",
            number(value),
            fields.x[i],
            fields.y[i]
        )
    });
    let both = [("displacement", moved), ("von Mises stress", stressed)];
    both.into_iter()
        .filter_map(|(name, text)| Some((name, text?)))
        .collect()
}

/// Writes the forces and how reliable a result is, for readers of its files: verdict and warnings.
pub(super) fn trust(document: &Document) -> String {
    let solution = &document.summary.solution;
    let verdict = solution.accuracy.iter().map(|accuracy| {
        let reason = accuracy.reasons.first().map(|reason| format!(": {reason}"));
        let verdict = accuracy.verdict.in_words();
        (
            "accuracy",
            format!("{verdict}{}", reason.unwrap_or_default()),
        )
    });
    let warnings = solution.warnings.iter().map(|warning| {
        let text = format!("{}: {}", warning.pointer, warning.message);
        (warning.code.severity().into(), text)
    });
    let forces = [
        (
            "normal force",
            solution.normal_force,
            QuantityName::NormalForce,
        ),
        (
            "tangential force",
            solution.tangential_force,
            QuantityName::TangentialForce,
        ),
    ];
    let forces = forces.into_iter().map(|(words, value, name)| {
        let error = stated(solution.accuracy.as_ref(), name, None);
        (words, format!("{}{error}", number(value)))
    });
    let forces = forces.take(if solution.contacts.is_empty() { 0 } else { 2 });
    lines(verdict.chain(forces).chain(warnings))
}

/// Writes what the row of a job says about its result, in one line: the verdict, and the forces with their errors.
pub(super) fn headline(job: &Job) -> Option<String> {
    let verdict: &str = job.verdict?.into();
    let forces = job.quantities.iter().filter(|q| {
        matches!(
            q.quantity,
            QuantityName::NormalForce | QuantityName::TangentialForce
        )
    });
    // of the first contact: others are in the result
    let first = job.quantities.first().map(|q| q.contact.as_str());
    let forces = forces.filter(|q| Some(q.contact.as_str()) == first);
    let forces = forces.map(|q| {
        let name = <&str>::from(q.quantity).replace('_', " ");
        let error = q.error.map_or(String::new(), |e| format!(" ± {e:.1e}"));
        format!("{name} {}{error}", number(q.value))
    });
    let forces: Vec<String> = forces.collect();
    Some(match &forces[..] {
        [] => verdict.to_owned(),
        forces => format!("{verdict}: {}", forces.join(", ")),
    })
}

/// Writes the summary of a result and the summaries of its load steps, each after the name of its step.
pub(super) fn result<'a>(
    title: Option<&str>,
    summary: &Summary,
    steps: impl Iterator<Item = (&'a str, &'a solver::solution::Summary)>,
) -> String {
    let s = &summary.solution;
    let mut lines = Lines::default();
    if let Some(title) = title {
        lines.add("title", title);
    }
    if let Some(accuracy) = &s.accuracy {
        lines.add_accuracy(accuracy);
    } else if s.contacts.is_empty() {
        lines.add("accuracy", "not stated: the problem has no contact. Compare with a finer mesh (mesh.refine): where stresses keep growing, as at clamped corners, notches and forces at nodes, they have no limit");
    }
    lines.add_end(s, summary.timings.values().sum());
    for mesh in &s.refinements {
        lines.add_mesh(mesh);
    }
    for (name, step) in steps {
        lines.add(
            &format!("step {name:?}"),
            format_args!(
                "normal force {}, tangential force {}, {} iterations",
                number(step.normal_force),
                number(step.tangential_force),
                step.iterations
            ),
        );
    }
    if let Some(second) = &s.uniqueness {
        let found = match (second.converged, second.agrees) {
            (false, _) => "unknown: from the bonded state the method does not converge".to_string(),
            (true, true) => {
                "yes: from the bonded state the solver finds the same solution".to_string()
            }
            (true, false) => format!(
                "NOT UNIQUE: from the bonded state the solver finds a normal force of {}",
                number(second.normal_force)
            ),
        };
        lines.add("unique", found);
    }
    for (name, contact) in &s.contacts {
        lines.add_contact(name, contact, s.accuracy.as_ref());
    }
    for warning in &s.warnings {
        let text = format_args!("{}: {}", warning.pointer, warning.message);
        lines.add(warning.code.severity().into(), text);
    }
    lines.add("digest", &summary.digest);
    lines.0
}

/// A text of facts, each on a line after its name.
#[derive(Default)]
struct Lines(String);

impl Lines {
    fn add(&mut self, name: &str, value: impl Display) {
        let _ = writeln!(self.0, "{name:<20}{value}");
    }

    fn add_accuracy(&mut self, accuracy: &Accuracy) {
        let verdict = accuracy.verdict.in_words();
        let verified = match accuracy.verified {
            Some(true) => "; compared with the refined mesh",
            _ => "",
        };
        self.add("accuracy", format_args!("{verdict}{verified}"));
        for reason in accuracy.reasons.iter().take(MOST_REASONS) {
            self.add("", reason);
        }
        if let more @ 1.. = accuracy.reasons.len().saturating_sub(MOST_REASONS) {
            let others = format_args!("and {more} more, in summary.accuracy.reasons");
            self.add("", others);
        }
        for q in &accuracy.quantities {
            self.add_verified(q);
        }
    }

    /// Adds a quantity if it was compared with the refined mesh.
    fn add_verified(&mut self, q: &EstimatedQuantity) {
        let (Some(finer), Some(difference)) = (q.finer, q.difference) else {
            return;
        };
        let order = q
            .order
            .map_or(String::new(), |order| format!(", order {order:.1}"));
        let error = match (q.error, q.method) {
            (Some(error), _) => format!("stated error {error:.1e}"),
            (None, ErrorMethod::NoLimit) => "without a limit".to_owned(),
            (None, ErrorMethod::TooMany) => "no stated error".to_owned(),
            (None, _) => "error unknown".to_owned(),
        };
        self.add(
            "  verified",
            format_args!(
                "{} at {:?}: {}, on the refined mesh {}, difference {difference:.1e}{order}; {error}",
                <&str>::from(q.quantity),
                q.contact,
                number(q.value),
                number(finer),
            ),
        );
    }

    /// Adds how the iterations ended, the forces and the residuals.
    fn add_end(&mut self, s: &solver::solution::Summary, seconds: f64) {
        let ended = match s.outcome {
            Outcome::Converged => "converged",
            Outcome::NotConverged => "NOT CONVERGED",
            Outcome::ContactCycling => "NOT CONVERGED: the iteration repeats in a cycle",
            Outcome::FalseConvergence => {
                "NOT CONVERGED: the iteration converged to a state that is not a solution; see the residuals"
            }
            Outcome::Canceled => "CANCELED",
            Outcome::Unfinished => "UNFINISHED: load steps are missing, and these are the numbers",
        };
        self.add(
            "outcome",
            format_args!("{ended} after {} iterations, {seconds:.3} s", s.iterations),
        );
        self.add(
            "unknowns",
            format_args!(
                "{}, {} of them on contact boundaries",
                s.dofs, s.contact_dofs
            ),
        );
        use QuantityName::{FrictionForce, NormalForce, TangentialForce};
        let forces = [
            ("normal force", s.normal_force, NormalForce),
            ("tangential force", s.tangential_force, TangentialForce),
            ("friction force", s.friction_force, FrictionForce),
        ];
        let shown = if s.contacts.is_empty() {
            0
        } else {
            forces.len()
        };
        for (words, value, name) in forces.into_iter().take(shown) {
            let stated = stated(s.accuracy.as_ref(), name, None);
            self.add(words, number(value) + &stated);
        }
        let r = &s.residuals;
        self.add(
            "residuals",
            format_args!(
                "kkt {:.1e}, friction {:.1e}, monolithic {:.1e}, force balance {:.1e}",
                r.kkt, r.friction, r.monolithic, r.equilibrium
            ),
        );
    }

    fn add_mesh(&mut self, mesh: &Refinement) {
        let change = mesh
            .change
            .map_or(String::new(), |change| format!(", changed by {change:.1e}"));
        let error = mesh.error.map_or(String::new(), |error| {
            format!(", largest error {:.2} %", 100.0 * error)
        });
        self.add(
            "  mesh",
            format_args!(
                "{:>6} elements: normal force {}, tangential force {}, peak σ_t {}{change}{error}",
                mesh.elements,
                number(mesh.normal_force),
                number(mesh.tangential_force),
                number(mesh.peak_tangential_stress)
            ),
        );
    }

    fn add_contact(&mut self, name: &str, contact: &ContactSummary, accuracy: Option<&Accuracy>) {
        let ranges = |ranges: &[[f64; 2]]| {
            let ranges: Vec<String> = ranges
                .iter()
                .map(|[start, end]| format!("{start:.4} … {end:.4}"))
                .collect();
            if ranges.is_empty() {
                "nowhere".to_string()
            } else {
                ranges.join(", ")
            }
        };
        let (normal, tangential) = (&contact.peak_normal_stress, &contact.peak_tangential_stress);
        self.add(&format!("contact {name:?}"), "");
        use QuantityName::{ContactEnd, ContactStart, StickEnd};
        let touches =
            ranges(&contact.contact) + &of_ends(accuracy, &[ContactStart, ContactEnd], name);
        self.add("  touches, s", touches);
        // without friction nothing can stick
        if tangential.is_some() || !contact.stick.is_empty() {
            let sticks = ranges(&contact.stick) + &of_ends(accuracy, &[StickEnd], name);
            self.add("  sticks, s", sticks);
        }
        use QuantityName::{Indentation, TangentialDisplacement, Tilt};
        for (words, value, quantity) in [
            ("  indentation", contact.indentation, Indentation),
            (
                "  tangential shift",
                contact.tangential_displacement,
                TangentialDisplacement,
            ),
            ("  tilt, radians", contact.tilt, Tilt),
        ] {
            if let Some(value) = value {
                let error = stated(accuracy, quantity, Some(name));
                self.add(words, number(value) + &error);
            }
        }
        if let Some(moment) = contact.moment {
            self.add("  moment", number(moment));
        }
        for (words, peak, quantity) in [
            ("  peak σ_n", normal, QuantityName::PeakNormalStress),
            ("  peak σ_t", tangential, QuantityName::PeakTangentialStress),
        ] {
            let Some(Peak { value, s, .. }) = peak else {
                continue;
            };
            let stated = stated(accuracy, quantity, Some(name));
            // the error is that of the value, not of its place
            let (error, remark) = match stated.starts_with(" ±") {
                true => (stated.as_str(), ""),
                false => ("", stated.as_str()),
            };
            self.add(
                words,
                format_args!("{}{error} at s = {s:.4}{remark}", number(*value)),
            );
        }
    }
}

/// Writes a number with up to seven digits, without an exponent where that is readable.
pub(super) fn number(value: f64) -> String {
    if value == 0.0 {
        "0".to_string()
    } else if (1e-3..1e7).contains(&value.abs()) {
        let before_point = value.abs().log10().floor().max(0.0) as usize + 1;
        format!("{value:.*}", 7_usize.saturating_sub(before_point))
    } else {
        format!("{value:.6e}")
    }
}

/// The text after a value that states the error of this quantity of a contact, or of its sum over all contacts; empty
/// if errors were not assessed.
fn stated(accuracy: Option<&Accuracy>, name: QuantityName, contact: Option<&str>) -> String {
    let all = accuracy.iter().flat_map(|accuracy| &accuracy.quantities);
    let of_contact = |q: &EstimatedQuantity| contact.is_none_or(|contact| contact == q.contact);
    let own = all.filter(|q| q.quantity == name && of_contact(q));
    let own: Vec<&EstimatedQuantity> = own.collect();
    if own.is_empty() {
        return String::new();
    }
    if own.iter().any(|q| q.method == ErrorMethod::NoLimit) {
        return ", but it grows without limit on finer meshes".to_owned();
    }
    let errors: Option<Vec<f64>> = own.iter().map(|q| q.error).collect();
    match errors.map(|errors| errors.iter().sum::<f64>()) {
        Some(0.0) => String::new(),
        Some(error) => format!(" ± {error:.1e}"),
        None => ", error unknown".to_owned(),
    }
}

/// The text after intervals that states the largest error of their ends; empty if an error is unknown, or none was assessed.
fn of_ends(accuracy: Option<&Accuracy>, names: &[QuantityName], contact: &str) -> String {
    let all = accuracy.iter().flat_map(|accuracy| &accuracy.quantities);
    let own = all.filter(|q| q.contact == contact && names.contains(&q.quantity));
    let errors: Option<Vec<f64>> = own.map(|q| q.error).collect();
    match errors.unwrap_or_default().into_iter().fold(0.0, f64::max) {
        0.0 => String::new(),
        error => format!(", each end ± {error:.1e}"),
    }
}

/// Writes the stresses along a contact boundary as a table.
pub(super) fn profile(profile: &ContactProfile) -> String {
    let p = profile;
    let mut text = format!(
        "{:>10} {:>14} {:>14} {:>14}  state\n",
        "s", "σ_n", "σ_t", "bound"
    );
    let columns =
        p.s.iter()
            .zip(&p.normal_stress)
            .zip(&p.tangential_stress)
            .zip(&p.friction_bound)
            .zip(&p.state);
    for ((((s, normal), tangential), bound), state) in columns {
        let state = match state {
            NodeState::Open => "open",
            NodeState::Stick => "stick",
            NodeState::Slip => "slip",
        };
        let _ = writeln!(
            text,
            "{s:>10.4} {normal:>14.5} {tangential:>14.5} {bound:>14.5}  {state}"
        );
    }
    text
}
