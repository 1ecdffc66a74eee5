//! The verdict on a solution as data, and in one sentence for people.

use schemars::JsonSchema;
use serde::Serialize;
use strum::IntoStaticStr;

use super::verdict::{DOUBTFUL, by_error, percent};
use crate::solution::{
    Accuracy, ErrorMethod, EstimatedQuantity, Outcome, QuantityName, Summary, Verdict, WarningCode,
};

/// The verdict on a solution, with what limits it.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Assessment {
    /// The verdict.
    pub verdict: Verdict,
    /// The verdict in a sentence, such as "Good, but for one number: …".
    pub sentence: String,
    /// What limits the verdict, and numbers that mean nothing: the most serious first.
    pub findings: Vec<Finding>,
}

/// One reason for a verdict.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Finding {
    /// The kind of reason.
    pub code: FindingCode,
    /// The best verdict that it permits.
    pub verdict: Verdict,
    /// The quantity that it is about.
    pub quantity: Option<QuantityName>,
    /// The contact of the quantity.
    pub contact: Option<String>,
    /// The warning that it follows from.
    pub warning: Option<WarningCode>,
    /// The reason in words.
    pub text: String,
}

/// A kind of reason for a verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema, IntoStaticStr)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum FindingCode {
    /// The iterations did not converge.
    NotConverged,
    /// The iterations ended, but their result does not solve the problem.
    FalseConvergence,
    /// A quantity grows without limit as the mesh is refined: its value means nothing.
    NoLimit,
    /// A contact has too many ends of stick to state their errors.
    TooManyEnds,
    /// The error of a quantity is larger than a `good` result may have.
    LargeError,
    /// The error of a quantity is unknown.
    UnknownError,
    /// A warning limits the verdict.
    Warning,
}

/// The assessment of a solution; `None` if it has no stated errors.
pub fn assessment(summary: &Summary) -> Option<Assessment> {
    let accuracy = summary.accuracy.as_ref()?;
    let mut findings = Vec::new();
    match summary.outcome {
        Outcome::Converged | Outcome::Unfinished => {}
        Outcome::FalseConvergence => findings.push((
            f64::INFINITY,
            Finding {
                code: FindingCode::FalseConvergence,
                ..unsolved("The iterations ended, but their result does not solve the problem.")
            },
        )),
        _ => findings.push((
            f64::INFINITY,
            unsolved("The iterations did not converge, so the errors are unknown."),
        )),
    }
    if findings.is_empty() {
        findings.extend(accuracy.quantities.iter().filter_map(of_quantity));
        let given = |code| summary.warnings.iter().any(|warning| warning.code == code);
        let doubts = DOUBTFUL.iter().filter(|(code, ..)| given(*code));
        findings.extend(doubts.map(|(code, verdict, text)| {
            // as serious as the verdict, and before the errors of that verdict
            let seriousness = if *verdict == Verdict::Poor {
                f64::INFINITY
            } else {
                10.0
            };
            let finding = Finding {
                code: FindingCode::Warning,
                verdict: *verdict,
                quantity: None,
                contact: None,
                warning: Some(*code),
                text: text.replace(&format!(" (`{}`)", code.as_str()), ""),
            };
            (seriousness, finding)
        }));
    }
    findings.sort_by(|a, b| b.0.total_cmp(&a.0));
    let findings: Vec<Finding> = findings.into_iter().map(|(_, finding)| finding).collect();
    Some(Assessment {
        verdict: accuracy.verdict,
        sentence: sentence(accuracy, &findings),
        findings,
    })
}

fn unsolved(text: &str) -> Finding {
    Finding {
        code: FindingCode::NotConverged,
        verdict: Verdict::Poor,
        quantity: None,
        contact: None,
        warning: None,
        text: text.to_owned(),
    }
}

/// The finding about a quantity, with its seriousness; `None` if its error is `good`.
fn of_quantity(q: &EstimatedQuantity) -> Option<(f64, Finding)> {
    let found = by_error(q, None)?;
    let (name, contact) = (in_words(q.quantity), &q.contact);
    let (code, text) = match (q.method, q.error) {
        (ErrorMethod::NoLimit, _) => (
            FindingCode::NoLimit,
            format!(
                "The {name} at contact {contact} has no limit: it grows as the mesh is refined."
            ),
        ),
        (ErrorMethod::TooMany, _) => (
            FindingCode::TooManyEnds,
            format!("Contact {contact} has too many ends of stick to state their errors."),
        ),
        (_, Some(_)) => {
            let part = percent(q.relative.unwrap_or(f64::INFINITY));
            let of = if q.quantity.is_extent() {
                " of the length of the contact"
            } else {
                ""
            };
            let text = format!("The {name} at contact {contact} may be wrong by {part}{of}.");
            (FindingCode::LargeError, text)
        }
        (_, None) => (
            FindingCode::UnknownError,
            format!("The error of the {name} at contact {contact} is unknown."),
        ),
    };
    let finding = Finding {
        code,
        verdict: found.verdict,
        quantity: Some(q.quantity),
        contact: Some(contact.clone()),
        warning: None,
        text,
    };
    Some((found.seriousness, finding))
}

/// The verdict in a sentence.
fn sentence(accuracy: &Accuracy, findings: &[Finding]) -> String {
    let without_limit = findings.iter().filter(|f| f.code == FindingCode::NoLimit);
    // the reason is what permits no better verdict; what has no finding of its own is among the reasons
    let reason = findings
        .iter()
        .find(|f| f.verdict == accuracy.verdict && f.code != FindingCode::NoLimit);
    let reason = reason.map(|finding| finding.text.clone());
    let reason = reason.or_else(|| accuracy.reasons.first().map(|text| text.replace('`', "")));
    let reason = decapitalised(&reason.unwrap_or_default());
    let worst = findings.first().map_or("", |finding| finding.text.as_str());
    match (accuracy.verdict, without_limit.clone().count()) {
        (Verdict::Good, 0) => format!("Good: {}.", how_exact(accuracy)),
        (Verdict::Good, 1) => format!("Good, but for one number: {}", decapitalised(worst)),
        (Verdict::Good, count) => {
            let names = without_limit.filter_map(|finding| {
                let (quantity, contact) = (finding.quantity?, finding.contact.as_deref()?);
                Some(format!("{} at contact {contact}", in_words(quantity)))
            });
            let names: Vec<String> = names.collect();
            format!(
                "Good, but for {count} numbers without a limit: {}.",
                names.join(", ")
            )
        }
        (Verdict::Fair, _) => format!("Fair: {reason}"),
        (Verdict::Poor, _) => format!("Poor: {reason}"),
    }
}

/// How exact the numbers of a `good` result are, in words.
fn how_exact(accuracy: &Accuracy) -> String {
    let largest = |is: fn(QuantityName) -> bool| {
        let own = accuracy.quantities.iter().filter(|q| is(q.quantity));
        own.filter_map(|q| q.relative).reduce(f64::max)
    };
    let forces = largest(|name| {
        matches!(
            name,
            QuantityName::NormalForce | QuantityName::TangentialForce | QuantityName::FrictionForce
        )
    });
    let others = largest(|name| {
        name.is_extent()
            || matches!(
                name,
                QuantityName::PeakNormalStress | QuantityName::PeakTangentialStress
            )
    });
    match (forces, others) {
        (Some(forces), Some(others)) => format!(
            "forces are right to {}, peaks and extents to {}",
            percent(forces),
            percent(others)
        ),
        (Some(forces), None) => format!("forces are right to {}", percent(forces)),
        _ => "no number may be wrong by more than the verdict allows".to_owned(),
    }
}

/// The name of a quantity in words.
fn in_words(name: QuantityName) -> String {
    <&str>::from(name).replace('_', " ")
}

/// The text with a small first letter, unless its first word is a symbol.
fn decapitalised(text: &str) -> String {
    let mut rest = text.chars();
    match (rest.next(), rest.clone().next()) {
        (Some(first), Some(second)) if second.is_lowercase() || second == ' ' => {
            first.to_lowercase().chain(rest).collect()
        }
        _ => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::solution::Warning;

    fn solved() -> Summary {
        let problem: crate::problem::Problem = serde_json::from_value(serde_json::json!({
            "analysis": { "kind": "plane_strain" },
            "mesh": { "grid": { "x": [0, 0.25, 0.5, 0.75, 1], "y": [-1, -0.5, 0] } },
            "materials": [{ "youngs_modulus": 1000, "poissons_ratio": 0.3 }],
            "supports": [{ "boundary": "bottom", "ux": 0, "uy": 0 }],
            "contacts": [{ "boundary": "top", "obstacle": { "kind": "flat", "to": 0.5 }, "indentation": 0.01 }]
        }))
        .unwrap();
        crate::solve(&problem, &mut ()).unwrap().summary
    }

    #[test]
    fn a_number_without_a_limit_leaves_a_good_verdict_with_an_exception() {
        let mut summary = solved();
        summary.warnings.clear();
        let accuracy = summary.accuracy.as_mut().unwrap();
        accuracy.verdict = Verdict::Good;
        for q in &mut accuracy.quantities {
            (q.error, q.relative) = (Some(0.0), Some(0.001));
            q.method = ErrorMethod::WeightedRecovery;
        }
        let all = assessment(&summary).unwrap();
        assert_eq!(all.findings, []);
        assert_eq!(
            all.sentence,
            "Good: forces are right to 0.1 %, peaks and extents to 0.1 %."
        );
        let accuracy = summary.accuracy.as_mut().unwrap();
        let mut peaks = accuracy.quantities.iter_mut();
        let peak = peaks.find(|q| q.quantity == QuantityName::PeakNormalStress);
        let peak = peak.unwrap();
        (peak.method, peak.error, peak.relative) = (ErrorMethod::NoLimit, None, None);
        let but_one = assessment(&summary).unwrap();
        assert_eq!(
            but_one.sentence,
            "Good, but for one number: the peak normal stress at contact top has no limit: it grows as the mesh is refined."
        );
        let finding = &but_one.findings[0];
        assert_eq!(
            (finding.code, finding.quantity, finding.contact.as_deref()),
            (
                FindingCode::NoLimit,
                Some(QuantityName::PeakNormalStress),
                Some("top")
            )
        );
    }

    #[test]
    fn the_first_finding_is_the_most_serious_one() {
        let mut summary = solved();
        let accuracy = summary.accuracy.as_mut().unwrap();
        accuracy.verdict = Verdict::Poor;
        summary.warnings = vec![Warning {
            code: WarningCode::NotUnique,
            pointer: String::new(),
            message: String::new(),
        }];
        let doubted = assessment(&summary).unwrap();
        assert_eq!(doubted.findings[0].warning, Some(WarningCode::NotUnique));
        assert!(
            doubted
                .sentence
                .starts_with("Poor: there is a second solution")
        );
        summary.outcome = Outcome::NotConverged;
        let unsolved = assessment(&summary).unwrap();
        assert_eq!(unsolved.findings[0].code, FindingCode::NotConverged);
        assert!(!unsolved.sentence.contains('`'), "{}", unsolved.sentence);
        summary.accuracy = None;
        assert_eq!(assessment(&summary), None);
    }
}
