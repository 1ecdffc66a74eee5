//! Many problems on one body: it is factored and condensed once.

use crate::body::ElasticBody;
use crate::error::SolveError;
use crate::mesh::{External, ExternalMesh};
use crate::model::Model;
use crate::problem::Problem;
use crate::solution::{
    Observer, Outcome, Peak, Phase, Progress, Residuals, Solution, Summary, Warning, WarningCode,
};
use crate::steps;

/// Problems on one body, solved one after the other, each from the end of the one before where that helps.
pub struct Family {
    first: Model,
    body: ElasticBody,
    /// What was said of the mesh when it was made; problems on it repeat it.
    mesh_warnings: Vec<Warning>,
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
        notify(observe, Progress::Phase(Phase::Mesh))?;
        let first = Model::new(problem, external).map_err(SolveError::Invalid)?;
        for warning in &first.warnings {
            notify(observe, Progress::Warning(warning))?;
        }
        let body = ElasticBody::new(&first, observe)?;
        let of_mesh = |warning: &&Warning| warning.pointer.starts_with("/mesh");
        let mesh_warnings = first.warnings.iter().filter(of_mesh).cloned().collect();
        Ok(Family {
            first,
            body,
            mesh_warnings,
        })
    }

    /// Solves a problem on this body (`problem.mesh` is not read: it is the family's). `Err(Invalid)` with its violations
    /// if it is wrong; `Err(OtherBody)` if its body differs.
    pub fn member(
        &mut self,
        problem: &Problem,
        observe: &mut Observer<'_>,
    ) -> Result<Member, SolveError> {
        self.solution(problem, observe)
            .map(|solution| Member::of(&solution.summary))
    }

    /// The whole solution of a problem on this body, as [`solve`](crate::solve) gives it, bit for bit.
    pub fn solution(
        &self,
        problem: &Problem,
        observe: &mut Observer<'_>,
    ) -> Result<Solution, SolveError> {
        let model = self.model(problem)?;
        match ElasticBody::same(&self.first, &model) {
            true => steps::run(&model, &self.body, None, observe),
            false => Err(SolveError::OtherBody),
        }
    }

    fn model(&self, problem: &Problem) -> Result<Model, SolveError> {
        let mesh = ExternalMesh {
            mesh: self.first.mesh.clone(),
            warnings: vec![],
        };
        let mut model = Model::on_mesh(problem, mesh).map_err(SolveError::Invalid)?;
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
        let contacts = summary.contacts.values();
        let width = |parts: &[[f64; 2]]| -> f64 {
            parts
                .iter()
                .fold(0.0, |sum, [start, end]| sum + (end - start))
        };
        let largest = |peaks: &mut dyn Iterator<Item = Option<Peak>>| {
            let values = peaks.flatten().map(|peak| peak.value);
            let larger = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
            values.fold(0.0, larger)
        };
        Member {
            outcome: summary.outcome,
            normal_force: summary.normal_force,
            tangential_force: summary.tangential_force,
            friction_force: summary.friction_force,
            contact_width: contacts
                .clone()
                .map(|contact| width(&contact.contact))
                .sum(),
            stick_width: contacts.clone().map(|contact| width(&contact.stick)).sum(),
            slip_width: contacts.clone().map(|contact| width(&contact.slip)).sum(),
            peak_normal_stress: largest(
                &mut contacts.clone().map(|contact| contact.peak_normal_stress),
            ),
            peak_tangential_stress: largest(
                &mut contacts.map(|contact| contact.peak_tangential_stress),
            ),
            iterations: summary.iterations,
            residuals: summary.residuals,
            warnings: summary
                .warnings
                .iter()
                .map(|warning| warning.code)
                .collect(),
        }
    }
}

fn notify(observe: &mut Observer<'_>, progress: Progress<'_>) -> Result<(), SolveError> {
    match observe(progress).is_break() {
        true => Err(SolveError::Stopped),
        false => Ok(()),
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
            assert_eq!(member, Member::of(&alone.summary));
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
