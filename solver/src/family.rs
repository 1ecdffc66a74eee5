//! Many problems on one body: it is factored and condensed once.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::body::ElasticBody;
use crate::error::SolveError;
use crate::mesh::{External, ExternalMesh};
use crate::model::{Model, VariableModel};
use crate::prepared::{Prepared, prepare};
use crate::problem::Problem;
use crate::solution::{
    ContactSummary, Observer, Outcome, Peak, Residuals, Solution, Summary, Warning, WarningCode,
};
use crate::steps::{self, Neighbour, Numbers};

/// Problems on one body, solved one after the other, each from the end of the one before where that helps.
pub struct Family {
    model: VariableModel,
    body: Arc<ElasticBody>,
    /// What was said of the mesh when it was made; problems on it repeat it.
    mesh_warnings: Vec<Warning>,
    /// What the last member leaves to the next.
    neighbour: Neighbour,
}

/// The numbers of one member.
#[derive(Clone, Debug, PartialEq)]
pub struct Member {
    /// How it ended.
    pub outcome: Outcome,
    /// ∫p ≥ 0 over all contacts (force).
    pub normal_force: f64,
    /// ∫σ_t over all contacts (force).
    pub tangential_force: f64,
    /// ∫|σ_t| over all contacts (force).
    pub friction_force: f64,
    /// Length of all contacts together, along the boundaries.
    pub contact_width: f64,
    /// The part of it with |u_t − d| < ε.
    pub stick_width: f64,
    /// The rest of it.
    pub slip_width: f64,
    /// The largest pressure of all contacts, as a stress (≤ 0); 0 without contact.
    pub peak_normal_stress: f64,
    /// The largest |σ_t| of all contacts, with its sign; 0 without friction.
    pub peak_tangential_stress: f64,
    /// Rows of the history.
    pub iterations: u32,
    /// Dimensionless residuals of the final state.
    pub residuals: Residuals,
    /// What to consider before relying on the numbers.
    pub warnings: Vec<WarningCode>,
}

impl Family {
    /// Checks the first problem, factors and condenses its body. Errors are estimated, not verified, and meshes not
    /// refined adaptively: a problem that asks for that shares no body, and is solved by [`solve_on`](crate::solve_on).
    pub fn new(
        problem: &Problem,
        external: Option<External>,
        observe: &mut Observer<'_>,
    ) -> Result<Family, SolveError> {
        Ok(Family::of(prepare(problem, external, observe)?, problem))
    }

    /// The problems on the body of one that is prepared.
    pub fn of(prepared: Prepared, problem: &Problem) -> Family {
        let Prepared { model, body } = prepared;
        let of_mesh = |warning: &&Warning| warning.pointer.starts_with("/mesh");
        let mesh_warnings = model.warnings.iter().filter(of_mesh).cloned().collect();
        Family {
            model: VariableModel::new(model, problem),
            body,
            mesh_warnings,
            neighbour: Neighbour::default(),
        }
    }

    /// Solves a problem on this body (`problem.mesh` is not read: it is the family's). `Err(Invalid)` with its violations
    /// if it is wrong; `Err(OtherBody)` if its body differs.
    ///
    /// Its displacements away from the contacts are not computed: the balance of forces (`residuals.equilibrium`) is 0, and
    /// warnings that need it, or strains, are missing. A body that only contact holds, and comparisons of solutions, take
    /// the whole solution.
    pub fn member(
        &mut self,
        problem: &Problem,
        observe: &mut Observer<'_>,
    ) -> Result<Member, SolveError> {
        let controls = &problem.solver;
        let whole = controls.check_uniqueness || controls.check_increments;
        let set = match whole {
            true => None,
            false => self.model.set(problem),
        };
        let numbers = match set {
            Some(set) => {
                set.map_err(SolveError::Invalid)?;
                let (model, neighbour) = (self.model.model(), &mut self.neighbour);
                steps::run_to_numbers(model, &self.body, neighbour, observe)?
            }
            None => {
                let model = self.other_model(problem)?;
                if whole || model.held_by_contact {
                    let solution = steps::run(&model, &self.body, None, observe)?;
                    return match solution.summary.outcome {
                        Outcome::Canceled => Err(SolveError::Stopped),
                        _ => Ok(Member::of(&solution.summary)),
                    };
                }
                steps::run_to_numbers(&model, &self.body, &mut Neighbour::default(), observe)?
            }
        };
        Ok(Member::of_numbers(&numbers))
    }

    /// The whole solution of a problem on this body, as [`solve`](crate::solve) gives it, bit for bit.
    pub fn solution(
        &self,
        problem: &Problem,
        observe: &mut Observer<'_>,
    ) -> Result<Solution, SolveError> {
        let model = self.other_model(problem)?;
        steps::run(&model, &self.body, None, observe)
    }

    /// The model of a problem on this body.
    fn other_model(&self, problem: &Problem) -> Result<Model, SolveError> {
        let own = self.model.model();
        let mesh = ExternalMesh {
            mesh: own.mesh.clone(),
            warnings: vec![],
        };
        let mut model = Model::on_mesh(problem, mesh).map_err(SolveError::Invalid)?;
        if !ElasticBody::same(own, &model) {
            return Err(SolveError::OtherBody);
        }
        // those of the mesh come first, once
        let of_model = std::mem::take(&mut model.warnings);
        model.warnings.clone_from(&self.mesh_warnings);
        for warning in of_model {
            if !model.warnings.contains(&warning) {
                model.warnings.push(warning);
            }
        }
        Ok(model)
    }
}

impl Member {
    /// The numbers of a whole solution, by its summary.
    pub fn of(summary: &Summary) -> Member {
        Member {
            outcome: summary.outcome,
            iterations: summary.iterations,
            residuals: summary.residuals,
            ..Member::of_contacts(&summary.contacts, &summary.warnings)
        }
    }

    fn of_numbers(numbers: &Numbers) -> Member {
        Member {
            outcome: numbers.finished.outcome,
            iterations: numbers.iterations,
            residuals: numbers.finished.residuals,
            ..Member::of_contacts(&numbers.contacts, &numbers.warnings)
        }
    }

    fn of_contacts(contacts: &BTreeMap<String, ContactSummary>, warnings: &[Warning]) -> Member {
        let sum = |f: fn(&ContactSummary) -> f64| contacts.values().map(f).fold(0.0, |a, b| a + b);
        let width = |parts: &[[f64; 2]]| -> f64 {
            let lengths = parts.iter().map(|[start, end]| end - start);
            lengths.fold(0.0, |a, b| a + b)
        };
        let widths = |f: fn(&ContactSummary) -> &Vec<[f64; 2]>| {
            contacts
                .values()
                .map(|contact| width(f(contact)))
                .fold(0.0, |a, b| a + b)
        };
        let largest = |f: fn(&ContactSummary) -> Option<Peak>| {
            let values = contacts.values().filter_map(f).map(|peak| peak.value);
            let larger = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
            values.fold(0.0, larger)
        };
        Member {
            outcome: Outcome::Converged,
            normal_force: sum(|contact| contact.normal_force),
            tangential_force: sum(|contact| contact.tangential_force),
            friction_force: sum(|contact| contact.friction_force),
            contact_width: widths(|contact| &contact.contact),
            stick_width: widths(|contact| &contact.stick),
            slip_width: widths(|contact| &contact.slip),
            peak_normal_stress: largest(|contact| contact.peak_normal_stress),
            peak_tangential_stress: largest(|contact| contact.peak_tangential_stress),
            iterations: 0,
            residuals: Residuals::default(),
            warnings: warnings.iter().map(|warning| warning.code).collect(),
        }
    }
}

impl std::fmt::Debug for Family {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Family")
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::ops::ControlFlow;

    use super::*;
    use crate::solution::Progress;

    fn problem(coefficient: f64, indentation: f64) -> Problem {
        serde_json::from_value(serde_json::json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 0.5, 1, 1.5, 2], "y": [-1, -0.5, 0]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "circle", "radius": 8, "center": 1},
                "indentation": indentation, "tangential_displacement": 0.01,
                "friction": {"coefficient": coefficient, "nonlocal_radius": 0.2, "elastic_slip": 1e-4}}]
        }))
        .unwrap()
    }

    #[test]
    fn members_have_the_numbers_of_their_own_solutions() {
        let go_on = &mut |_: Progress<'_>| ControlFlow::Continue(());
        let mut family = Family::new(&problem(0.3, 0.05), None, go_on).unwrap();
        for (coefficient, indentation) in [(0.3, 0.05), (0.1, 0.1), (0.6, 0.02)] {
            let problem = problem(coefficient, indentation);
            let alone = crate::solve(&problem, go_on).unwrap();
            let member = family.member(&problem, go_on).unwrap();
            let expected = Member::of(&alone.summary);
            assert_eq!(
                (member.outcome, &member.warnings),
                (expected.outcome, &expected.warnings)
            );
            assert!(member.residuals.within(1e-10) && member.residuals.equilibrium == 0.0);
            let numbers = |m: &Member| {
                [
                    m.normal_force,
                    m.tangential_force,
                    m.friction_force,
                    m.contact_width,
                    m.stick_width,
                    m.slip_width,
                    m.peak_normal_stress,
                    m.peak_tangential_stress,
                ]
            };
            for (found, expected) in numbers(&member).into_iter().zip(numbers(&expected)) {
                assert!(
                    (found - expected).abs() <= 1e-9 * expected.abs(),
                    "{found} {expected}"
                );
            }
            assert!((member.stick_width + member.slip_width - member.contact_width).abs() < 1e-12);
            assert!(member.peak_normal_stress < 0.0 && member.contact_width > 0.0);
            assert_eq!(family.solution(&problem, go_on).unwrap(), alone);
        }
    }

    #[test]
    fn what_is_wrong_with_a_member_is_told_and_another_body_is_not_solved() {
        let go_on = &mut |_: Progress<'_>| ControlFlow::Continue(());
        let mut family = Family::new(&problem(0.3, 0.05), None, go_on).unwrap();
        let invalid = family.member(&problem(-1.0, 0.05), go_on);
        assert!(
            matches!(invalid, Err(SolveError::Invalid(list)) if list[0].pointer.ends_with("coefficient"))
        );
        let mut other = problem(0.3, 0.05);
        other.quadrature = 2;
        assert_eq!(family.member(&other, go_on), Err(SolveError::OtherBody));
    }
}
