//! The texts above and below a figure: title, parameters, verdict and warnings.

use std::collections::BTreeSet;

use solver::problem::{Contact, History, Problem};
use solver::solution::{Outcome, Severity, Summary, Verdict};

use super::numbers::number;

/// The texts around a figure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Caption {
    /// The title, in one line.
    pub title: String,
    /// The parameters below the title, one text for each contact.
    pub parameters: Vec<String>,
    /// The verdict or state of the result.
    pub mark: Option<Mark>,
    /// The kinds of warnings of the result that are more than notes, in words.
    pub warnings: Vec<String>,
}

/// How reliable the result of a figure is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// The verdict on a result.
    Verdict(Verdict),
    /// The result is partial, or is no solution: the reason, in words.
    Partial(&'static str),
}

impl Mark {
    pub(super) fn words(self) -> String {
        match self {
            Mark::Verdict(Verdict::Good) => "● verdict: good".to_owned(),
            Mark::Verdict(Verdict::Fair) => "● verdict: fair".to_owned(),
            Mark::Verdict(Verdict::Poor) => "● verdict: POOR".to_owned(),
            Mark::Partial(reason) => format!("● PARTIAL: {reason}"),
        }
    }
}

impl Caption {
    /// The caption for a problem: its title, or `default` if it has none, and the parameters of its laws of friction.
    pub fn of_problem(problem: &Problem, default: &str) -> Caption {
        let title = problem.title.as_deref().unwrap_or(default);
        let several = problem.contacts.len() > 1;
        let parameters = problem.contacts.iter().map(|contact| {
            let law = law(contact, length(problem));
            if several {
                format!("{}: {law}", solver::error::shortened(&contact.boundary, 20))
            } else {
                law
            }
        });
        Caption {
            title: title.to_owned(),
            parameters: parameters.collect(),
            ..Caption::default()
        }
    }

    /// The caption with the verdict and warnings of a result. `partial`: the job has not finished.
    pub fn with_result(self, summary: Option<&Summary>, partial: bool) -> Caption {
        const UNFINISHED: Mark = Mark::Partial("job not finished");
        let Some(summary) = summary else {
            return Caption {
                mark: partial.then_some(UNFINISHED),
                ..self
            };
        };
        let verdict = summary.accuracy.as_ref().map(|accuracy| accuracy.verdict);
        let mark = match summary.outcome {
            Outcome::NotConverged => Some(Mark::Partial("not converged")),
            Outcome::ContactCycling => Some(Mark::Partial("contact cycling")),
            Outcome::FalseConvergence => Some(Mark::Partial("false convergence")),
            Outcome::Canceled => Some(Mark::Partial("canceled")),
            Outcome::Unfinished => Some(UNFINISHED),
            Outcome::Converged if partial => Some(UNFINISHED),
            Outcome::Converged => verdict.map(Mark::Verdict),
        };
        let mut seen = BTreeSet::new();
        // a note is a property of the problem, which the figure shows itself
        let codes = summary.warnings.iter().map(|warning| warning.code);
        let codes = codes.filter(|code| code.severity() < Severity::Note);
        let codes = codes.map(<&str>::from);
        let codes = codes.filter(|code| seen.insert(*code));
        Caption {
            mark,
            warnings: codes.map(|code| code.replace('_', " ")).collect(),
            ..self
        }
    }
}

fn length(problem: &Problem) -> &str {
    let units = problem.units.as_ref();
    units
        .and_then(|units| units.length.as_deref())
        .unwrap_or_default()
}

/// The parameters of a law of friction by their symbols, with the unit of length, and whether it depends on the load path.
fn law(contact: &Contact, unit: &str) -> String {
    let Some(friction) = &contact.friction else {
        return "no friction".to_owned();
    };
    let lengths = [
        ("ρ", friction.nonlocal_radius),
        ("ε", Some(friction.elastic_slip)),
    ];
    let lengths = lengths.into_iter().filter_map(|(symbol, value)| {
        let value = value?;
        let unit = if value == 0.0 { "" } else { unit };
        Some(
            format!("{symbol} = {} {unit}", number(value))
                .trim_end()
                .to_owned(),
        )
    });
    let coefficient = friction.coefficient.map(|mu| format!("μ = {}", number(mu)));
    let bound = friction
        .bound
        .as_ref()
        .map(|_| "prescribed bound".to_owned());
    let path = match friction.history {
        History::Total => "total law",
        History::Incremental => "incremental law",
    };
    let all: Vec<String> = coefficient
        .into_iter()
        .chain(bound)
        .chain(lengths)
        .chain([path.to_owned()])
        .collect();
    all.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::tests::{problem, solution};

    #[test]
    fn figures_of_a_study_show_their_parameters() {
        let mut problem = problem();
        let of = |problem: &Problem| Caption::of_problem(problem, "Contact").parameters;
        assert_eq!(
            of(&problem),
            ["μ = 0.3, ρ = 0.01 mm, ε = 1e−4 mm, total law"]
        );
        let mut second = problem.contacts[0].clone();
        second.boundary = "left".into();
        second.friction = None;
        problem.contacts.push(second);
        assert_eq!(of(&problem)[1], "left: no friction");
    }

    #[test]
    fn a_figure_of_no_solution_says_so() {
        let problem = problem();
        let mut summary = solution(&problem).summary;
        let mark = |summary: &Summary, partial| {
            let caption = Caption::of_problem(&problem, "").with_result(Some(summary), partial);
            caption.mark.map(Mark::words)
        };
        let whole = mark(&summary, false).unwrap();
        assert!(whole.starts_with("● verdict: "), "{whole}");
        assert_eq!(mark(&summary, true).unwrap(), "● PARTIAL: job not finished");
        summary.outcome = Outcome::ContactCycling;
        assert_eq!(mark(&summary, false).unwrap(), "● PARTIAL: contact cycling");
    }
}
