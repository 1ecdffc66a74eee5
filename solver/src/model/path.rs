//! Tells of load steps that probably lead elsewhere than was meant.

use super::checks::Checks;
use crate::problem::{BoundaryValue, Contact, History, Problem, Step, Support};
use crate::solution::WarningCode;

/// Steps that lead to at most this part of a value may have lengths in place of factors.
const SMALL: f64 = 0.1;

/// What the factors of a step multiply.
struct Multiplied {
    /// The field of the step.
    name: &'static str,
    factor: fn(&Step) -> f64,
    /// Whether the problem has anything else than zero there.
    given: bool,
    /// The largest displacement of an obstacle, for the two that are one.
    length: Option<f64>,
}

fn multiplied(problem: &Problem) -> [Multiplied; 8] {
    let longest = |of: fn(&Contact) -> f64| {
        let lengths = problem.contacts.iter().map(|contact| of(contact).abs());
        lengths.fold(0.0, f64::max)
    };
    let pushed = longest(Contact::pushed);
    let dragged = longest(|contact| contact.tangential_displacement);
    let has = |of: fn(&Contact) -> f64| problem.contacts.iter().any(|contact| of(contact) != 0.0);
    let moves = |value: &BoundaryValue| match *value {
        BoundaryValue::Constant(value) => value != 0.0,
        BoundaryValue::Linear(ends) => ends != [0.0; 2],
    };
    let prescribes = |support: &Support| {
        let Support { ux, uy, un, ut, .. } = support;
        [ux, uy, un, ut].into_iter().flatten().any(moves)
    };
    [
        Multiplied {
            name: "indentation",
            factor: |step| step.indentation,
            given: pushed > 0.0,
            length: Some(pushed),
        },
        Multiplied {
            name: "tangential_displacement",
            factor: |step| step.tangential_displacement,
            given: dragged > 0.0,
            length: Some(dragged),
        },
        Multiplied {
            name: "normal_force",
            factor: |step| step.normal_force,
            given: has(|contact| contact.normal_force.unwrap_or(0.0)),
            length: None,
        },
        Multiplied {
            name: "tangential_force",
            factor: |step| step.tangential_force,
            given: has(|contact| contact.tangential_force.unwrap_or(0.0)),
            length: None,
        },
        Multiplied {
            name: "tilt",
            factor: |step| step.tilt,
            given: has(|contact| contact.tilt.unwrap_or(0.0)),
            length: None,
        },
        Multiplied {
            name: "moment",
            factor: |step| step.moment,
            given: has(|contact| contact.moment.unwrap_or(0.0)),
            length: None,
        },
        Multiplied {
            name: "loads",
            factor: |step| step.loads,
            given: !problem.loads.is_empty(),
            length: None,
        },
        Multiplied {
            name: "supports",
            factor: |step| step.supports,
            given: problem.supports.iter().any(prescribes),
            length: None,
        },
    ]
}

impl Checks {
    /// Warns of the load steps of a problem.
    pub(super) fn warn_of_path(&mut self, problem: &Problem) {
        if problem.steps.is_empty() {
            return;
        }
        let all = multiplied(problem);
        self.warn_of_no_effect(&problem.steps, &all);
        let given: Vec<&Multiplied> = all.iter().filter(|one| one.given).collect();
        for one in &given {
            self.warn_of_small_factors(&problem.steps, one);
        }
        self.warn_of_return(problem);
        self.warn_of_no_memory(problem, &given);
    }

    /// Tells of factors on motions and forces of obstacles that no contact has; 0 and 1 are also what a step has that does not name
    /// them, and supports and loads may be meant to be 0.
    fn warn_of_no_effect(&mut self, steps: &[Step], all: &[Multiplied]) {
        let named = |one: &&Multiplied| {
            let mut factors = steps.iter().map(one.factor);
            factors.any(|factor| ![0.0, 1.0].contains(&factor))
        };
        let of_obstacles = all
            .iter()
            .filter(|one| !["loads", "supports"].contains(&one.name));
        let idle: Vec<String> = of_obstacles
            .filter(|one| !one.given)
            .filter(named)
            .map(|one| format!("`{}`", one.name))
            .collect();
        if !idle.is_empty() {
            let idle = idle.join(", ");
            self.warn(
                WarningCode::NeverApplied,
                "/steps",
                format!("Load steps have factors on {idle}, but no contact has a value there other than 0: they act on nothing. Give the contact the value that they are factors on, or leave them out."),
            );
        }
    }

    /// Tells of factors that are all so small that they may be meant as lengths, and of a value that no step applies.
    fn warn_of_small_factors(&mut self, steps: &[Step], one: &Multiplied) {
        let Multiplied {
            name,
            factor,
            length,
            ..
        } = one;
        let most = steps.iter().map(|step| factor(step).abs());
        let most = most.fold(0.0, f64::max);
        if most == 0.0 {
            let unnamed = match *name {
                "tangential_force" => "tangential_force",
                _ => "tangential_displacement",
            };
            self.warn(
                WarningCode::NeverApplied,
                "/steps",
                format!("The problem has `{name}`, but the factor on it is 0 in every load step, so that it is never applied. A step that does not name `{unnamed}` has the factor 0 on it, and 1 on everything else."),
            );
        } else if let Some(length) = length
            && most <= SMALL
        {
            self.warn(
                WarningCode::FactorsSmall,
                "/steps",
                format!("The load steps reach at most {most} times the `{name}` of {length} in `contacts`, which is {:.4e}: values in `steps` are factors, and 1 is the whole.", most * length),
            );
        }
    }

    /// Warns of a step that drags the obstacle back to where it began while another factor changes: probably the step only
    /// leaves `tangential_displacement` out.
    fn warn_of_return(&mut self, problem: &Problem) {
        let dragged = problem
            .contacts
            .iter()
            .map(|one| one.tangential_displacement);
        let Some(dragged) = dragged.max_by(|a, b| a.abs().total_cmp(&b.abs())) else {
            return;
        };
        let returns = |pair: &[Step]| {
            let [before, step] = pair else { return false };
            let changes = step.indentation != before.indentation
                || step.loads != before.loads
                || step.supports != before.supports;
            dragged != 0.0
                && before.tangential_displacement != 0.0
                && step.tangential_displacement == 0.0
                && changes
                && step.indentation > 0.0
        };
        let Some(before) = problem.steps.windows(2).position(returns) else {
            return;
        };
        let back = dragged * problem.steps[before].tangential_displacement;
        self.warn(
            WarningCode::DragReturns,
            &format!("/steps/{}", before + 1),
            format!("The obstacle is dragged back by {back:.4e} to where it began, while the indentation, the loads or the supports change: the factor on `tangential_displacement` is 0 where a step does not name it. Give {} to keep it where it is.", problem.steps[before].tangential_displacement),
        );
    }

    /// Warns of a path that turns back under the total law, which does not remember it.
    fn warn_of_no_memory(&mut self, problem: &Problem, given: &[&Multiplied]) {
        let total = problem.contacts.iter().position(|contact| {
            let law = contact.friction.as_ref();
            law.is_some_and(|law| law.history == History::Total)
        });
        let turns = |one: &&&Multiplied| {
            let factors = problem.steps.iter().map(one.factor);
            let levels: Vec<f64> = [0.0].into_iter().chain(factors).collect();
            let changes: Vec<f64> = levels.windows(2).map(|pair| pair[1] - pair[0]).collect();
            changes.iter().any(|change| *change > 0.0) && changes.iter().any(|change| *change < 0.0)
        };
        if let Some(contact) = total
            && let Some(one) = given.iter().find(turns)
        {
            self.warn(
                WarningCode::PathForgotten,
                &format!("/contacts/{contact}/friction/history"),
                format!("The load steps turn back (`{}`), but friction follows the total law, which depends on the present displacements alone: the end is the same as without the earlier steps. For loops, and for what remains after unloading, give \"history\": \"incremental\".", one.name),
            );
        }
    }
}
