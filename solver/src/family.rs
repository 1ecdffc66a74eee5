//! Many problems on one body: the body is factored and condensed once.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::body::ElasticBody;
use crate::error::SolveError;
use crate::mesh::{External, ExternalMesh};
use crate::model::{Model, VariableModel};
use crate::observer::Observer;
use crate::prepared::{Prepared, prepare};
use crate::problem::Problem;
use crate::solution::{
    ContactSummary, Outcome, Peak, Residuals, Solution, Summary, Verdict, Warning, WarningCode,
};
use crate::steps::{self, Numbers, Shared};
pub use crate::steps::{End, Start};

/// Problems on one body, solved one after another; each starts from the final state of another one where that helps.
pub struct Family {
    model: VariableModel,
    body: Arc<ElasticBody>,
    /// Warnings about the mesh, repeated for each problem on it.
    mesh_warnings: Vec<Warning>,
    shared: Shared,
}

/// The numerical results of one problem of a family.
#[derive(Clone, Debug, PartialEq)]
pub struct Member {
    /// How the solution ended.
    pub outcome: Outcome,
    /// The normal force ∫p ≥ 0 over all contacts (force).
    pub normal_force: f64,
    /// The tangential force ∫σ_t over all contacts (force).
    pub tangential_force: f64,
    /// The friction force ∫|σ_t| over all contacts (force).
    pub friction_force: f64,
    /// Length of all contacts together, along the boundaries; the ends of contact are interpolated between nodes, for this
    /// and the other lengths: [`Widths`](crate::solution::Widths).
    pub contact_width: f64,
    /// The error of `contact_width` due to the distances between the nodes at the ends of contact: the sum of them, each of
    /// which a job states for its end. It contains no error of forces; absent where an end is unknown.
    pub contact_width_error: Option<f64>,
    /// The length of contact that sticks, |u_t − d| < ε.
    pub stick_width: f64,
    /// The length of contact that slips.
    pub slip_width: f64,
    /// The largest pressure of all contacts, as a stress (≤ 0); 0 without contact.
    pub peak_normal_stress: f64,
    /// The largest |σ_t| of all contacts, with its sign; 0 without friction.
    pub peak_tangential_stress: f64,
    /// The indentation of the obstacle under loads, if there is one such obstacle (length).
    pub indentation: Option<f64>,
    /// The tangential displacement of the obstacle under loads, if there is one such obstacle (length).
    pub tangential_displacement: Option<f64>,
    /// The tilt of the obstacle under loads, if there is one such obstacle (radians).
    pub tilt: Option<f64>,
    /// The number of rows of the history.
    pub iterations: u32,
    /// Dimensionless residuals of the final state.
    pub residuals: Residuals,
    /// What to consider before relying on the numbers.
    pub warnings: Vec<WarningCode>,
    /// Whether the solution can be relied on; only of a member that was solved whole, since the others have no stated errors.
    pub verdict: Option<Verdict>,
}

impl Family {
    /// Checks the first problem, factors and condenses its body.
    ///
    /// Errors of numbers are estimated, not verified, and meshes are not refined adaptively: a problem that asks for
    /// verification or adaptive refinement shares no body, and is solved by [`solve_on`](crate::solve_on).
    ///
    /// # Errors
    ///
    /// The errors of [`prepare`].
    pub fn new(
        problem: &Problem,
        external: Option<External>,
        observer: &mut dyn Observer,
    ) -> Result<Family, SolveError> {
        Ok(Family::of(prepare(problem, external, observer)?, problem))
    }

    /// The family of problems on the body of a prepared problem.
    pub fn of(prepared: Prepared, problem: &Problem) -> Family {
        let Prepared { model, body } = prepared;
        let of_mesh = |warning: &&Warning| warning.pointer.starts_with("/mesh");
        let mesh_warnings = model.warnings.iter().filter(of_mesh).cloned().collect();
        Family {
            model: VariableModel::new(model, problem),
            body,
            mesh_warnings,
            shared: Shared::default(),
        }
    }

    /// Solves a problem on this body (`problem.mesh` is not read: it is the family's), and also returns its final
    /// state, from which other problems may start.
    ///
    /// The numbers are those of the problem's own solution within its tolerance. Their last bits depend on `start`, and
    /// on nothing else that was solved before.
    ///
    /// Displacements away from the contacts are not computed: the balance of forces (`residuals.equilibrium`) is 0, and
    /// warnings that need the balance, or strains, are missing. If only contact holds the body, or the problem asks for
    /// a comparison of solutions, it is solved completely.
    ///
    /// # Errors
    ///
    /// [`SolveError::Invalid`] with the violations of the problem; [`SolveError::OtherBody`] if its body differs;
    /// otherwise as for [`Prepared::solve`].
    pub fn member(
        &mut self,
        problem: &Problem,
        start: Start<'_>,
        observer: &mut dyn Observer,
    ) -> Result<(Member, Option<End>), SolveError> {
        let controls = &problem.solver;
        let whole = controls.check_uniqueness || controls.check_increments;
        let set = if whole { None } else { self.model.set(problem) };
        let (numbers, end) = match set {
            Some(set) => {
                set.map_err(SolveError::Invalid)?;
                let (model, shared) = (self.model.model(), &mut self.shared);
                steps::run_to_numbers(model, &self.body, shared, start, observer)?
            }
            None => {
                let model = self.other_model(problem)?;
                if whole || model.held_by_contact {
                    let solution = steps::run(&model, &self.body, None, observer)?;
                    return match solution.summary.outcome {
                        Outcome::Canceled => Err(SolveError::Stopped),
                        _ => Ok((Member::of(&solution.summary), None)),
                    };
                }
                let shared = &mut Shared::default();
                steps::run_to_numbers(&model, &self.body, shared, Start::Anew, observer)?
            }
        };
        Ok((Member::of_numbers(&numbers), end))
    }

    /// Solves a problem on this body with all its displacements, whose balance of forces shows whether the body is
    /// sound, and with stated errors, from which its verdict follows. Use it for the first of the problems that share the
    /// body. The numbers are those of the problem's own solution, bit for bit.
    ///
    /// # Errors
    ///
    /// The errors of [`Family::member`].
    pub fn whole_member(
        &self,
        problem: &Problem,
        observer: &mut dyn Observer,
    ) -> Result<Member, SolveError> {
        let solution = self.solution(problem, observer)?;
        Ok(Member::of(&solution.summary))
    }

    /// Returns the whole solution of a problem on this body, bit for bit as [`solve`](crate::solve) gives it.
    ///
    /// # Errors
    ///
    /// The errors of [`Family::member`].
    pub fn solution(
        &self,
        problem: &Problem,
        observer: &mut dyn Observer,
    ) -> Result<Solution, SolveError> {
        let model = self.other_model(problem)?;
        steps::run(&model, &self.body, None, observer)
    }

    /// The model of a problem on this body.
    fn other_model(&self, problem: &Problem) -> Result<Model, SolveError> {
        let own = self.model.model();
        let mesh = ExternalMesh {
            mesh: own.mesh.clone(),
            warnings: vec![],
        };
        let mut model = Model::on_mesh(problem, mesh).map_err(SolveError::Invalid)?;
        // its own mesh would have nodes where its obstacles end
        let cuts =
            |model: &Model| -> Vec<_> { model.contacts.iter().map(|c| c.cut.clone()).collect() };
        if !ElasticBody::same(own, &model) || cuts(own) != cuts(&model) {
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
    /// The results of a whole solution, from its summary.
    pub fn of(summary: &Summary) -> Member {
        Member {
            outcome: summary.outcome,
            iterations: summary.iterations,
            residuals: summary.residuals,
            verdict: summary.accuracy.as_ref().map(|accuracy| accuracy.verdict),
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
        let largest = |f: fn(&ContactSummary) -> Option<Peak>| {
            let values = contacts.values().filter_map(f).map(|peak| peak.value);
            let larger = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
            values.fold(0.0, larger)
        };
        let mut tools = contacts.values().filter(|contact| contact.tilt.is_some());
        let tool = tools.next().filter(|_| tools.next().is_none());
        Member {
            outcome: Outcome::Converged,
            indentation: tool.and_then(|contact| contact.indentation),
            tangential_displacement: tool.and_then(|contact| contact.tangential_displacement),
            tilt: tool.and_then(|contact| contact.tilt),
            normal_force: sum(|contact| contact.normal_force),
            tangential_force: sum(|contact| contact.tangential_force),
            friction_force: sum(|contact| contact.friction_force),
            contact_width: sum(|contact| contact.widths.contact),
            contact_width_error: contacts
                .values()
                .try_fold(0.0, |all, contact| Some(all + contact.widths.error?)),
            stick_width: sum(|contact| contact.widths.stick),
            slip_width: sum(|contact| contact.widths.slip),
            peak_normal_stress: largest(|contact| contact.peak_normal_stress),
            peak_tangential_stress: largest(|contact| contact.peak_tangential_stress),
            iterations: 0,
            residuals: Residuals::default(),
            warnings: warnings.iter().map(|warning| warning.code).collect(),
            verdict: None,
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
        let quiet = &mut ();
        let mut family = Family::new(&problem(0.3, 0.05), None, quiet).unwrap();
        let mut end: Option<End> = None;
        for (coefficient, indentation) in [(0.3, 0.05), (0.1, 0.1), (0.6, 0.02)] {
            let start = end.as_ref().map_or(Start::Anew, Start::Next);
            let problem = problem(coefficient, indentation);
            let alone = crate::solve(&problem, quiet).unwrap();
            let (member, own_end) = family.member(&problem, start, quiet).unwrap();
            end = own_end;
            assert!(end.is_some());
            let mut expected = Member::of(&alone.summary);
            // of a member no errors are stated
            let of_errors = |code: &WarningCode| *code == WarningCode::PeakSignUnknown;
            expected.warnings.retain(|code| !of_errors(code));
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
            assert_eq!(family.solution(&problem, quiet).unwrap(), alone);
        }
    }

    #[test]
    fn an_invalid_member_is_reported_and_another_body_is_refused() {
        let quiet = &mut ();
        let mut family = Family::new(&problem(0.3, 0.05), None, quiet).unwrap();
        let invalid = family.member(&problem(-1.0, 0.05), Start::Anew, quiet);
        assert!(
            matches!(invalid, Err(SolveError::Invalid(list)) if list[0].pointer.ends_with("coefficient"))
        );
        let mut other = problem(0.3, 0.05);
        other.quadrature = 2;
        let refused = family.member(&other, Start::Anew, quiet);
        assert_eq!(refused.err(), Some(SolveError::OtherBody));
    }

    /// A quarter of a cylinder in contact, with the numbers of the measured sweep of 1,000 members.
    fn pressed(radius: f64, coefficient: f64, slip: f64, indentation: f64) -> Problem {
        let x: Vec<f64> = (0..=20)
            .map(|i| 0.08 * f64::from(i))
            .chain([2.4, 4.0])
            .collect();
        serde_json::from_value(serde_json::json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": x, "y": [-8, -4, -2, -1, -0.5, -0.25, -0.1, 0]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "uy": 0}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "circle", "radius": 8}, "indentation": indentation,
                "friction": {"coefficient": coefficient, "nonlocal_radius": radius, "elastic_slip": slip}}]
        }))
        .unwrap()
    }

    /// Every member of a sweep has the numbers of its own solution: a fresh start on the same body, which equals
    /// `solve` bit for bit. Widths are compared as parts of the contact's width, since a narrow part is as accurate as
    /// a wide one.
    #[test]
    fn every_member_of_a_sweep_has_the_numbers_of_its_own_solution() {
        let quiet = &mut ();
        let even = |from: f64, to: f64, count: u32| {
            let at = move |k: u32| from + (to - from) * f64::from(k) / f64::from(count - 1);
            (0..count).map(at).collect::<Vec<f64>>()
        };
        let mut family = Family::new(&pressed(0.02, 0.05, 1e-4, 0.06), None, quiet).unwrap();
        let (mut checked, mut steps, mut sweeps) = (0, 0, 0);
        let mut first: Option<End> = None;
        for radius in even(0.02, 0.04, 5) {
            for coefficient in even(0.05, 0.45, 5) {
                for slip in even(1e-4, 2e-4, 5) {
                    let mut last: Option<End> = None;
                    for indentation in even(0.06, 0.1, 8) {
                        let problem = pressed(radius, coefficient, slip, indentation);
                        let start = match (&last, &first) {
                            (Some(end), _) => Start::Next(end),
                            (None, Some(end)) => Start::Near(end),
                            (None, None) => Start::Anew,
                        };
                        let (member, end) = family.member(&problem, start, quiet).unwrap();
                        if last.is_none() {
                            first.clone_from(&end);
                        }
                        last = end;
                        let alone = family.solution(&problem, quiet).unwrap();
                        let own = Member::of(&alone.summary);
                        assert_eq!(
                            (member.outcome, &member.warnings),
                            (own.outcome, &own.warnings)
                        );
                        for (found, expected, scale) in [
                            (member.normal_force, own.normal_force, own.normal_force),
                            (
                                member.tangential_force,
                                own.tangential_force,
                                own.tangential_force,
                            ),
                            (
                                member.friction_force,
                                own.friction_force,
                                own.friction_force,
                            ),
                            (member.contact_width, own.contact_width, own.contact_width),
                            (member.stick_width, own.stick_width, own.contact_width),
                            (member.slip_width, own.slip_width, own.contact_width),
                            (
                                member.peak_normal_stress,
                                own.peak_normal_stress,
                                own.peak_normal_stress,
                            ),
                            (
                                member.peak_tangential_stress,
                                own.peak_tangential_stress,
                                own.peak_tangential_stress,
                            ),
                        ] {
                            let off = (found - expected).abs();
                            assert!(
                                off <= 1e-9 * scale.abs(),
                                "{found} for {expected} at {radius} {coefficient} {slip} {indentation}"
                            );
                        }
                        checked += 1;
                        steps += member.iterations;
                        sweeps += own.iterations;
                    }
                }
            }
        }
        assert_eq!(checked, 1000);
        assert!(steps < 12_000 && sweeps > 4_000, "{steps} {sweeps}");
    }

    /// The bits of a member depend on its start only, whatever was solved before on the body: with other radii, deeper,
    /// or without friction.
    #[test]
    fn the_bits_of_a_member_depend_on_where_it_begins_and_on_nothing_else() {
        let quiet = &mut ();
        let chain = [0.05, 0.06, 0.07, 0.2].map(|d| pressed(0.03, 0.3, 1e-4, d));
        let others = [
            pressed(0.2, 0.5, 1e-3, 0.4),
            pressed(0.03, 0.0, 1e-4, 0.06),
            pressed(0.03, 0.3, 1e-4, 0.01),
        ];
        let mut found = Vec::new();
        for with_others in [false, true] {
            let mut family = Family::new(&chain[0], None, quiet).unwrap();
            if with_others {
                let mut end: Option<End> = None;
                for other in &others {
                    let start = end.as_ref().map_or(Start::Anew, Start::Next);
                    let (member, own) = family.member(other, start, quiet).unwrap();
                    assert_eq!(member.outcome, Outcome::Converged);
                    end = own;
                }
            }
            let (mut members, mut end) = (Vec::new(), None::<End>);
            for problem in &chain {
                let start = end.as_ref().map_or(Start::Anew, Start::Next);
                let (member, own) = family.member(problem, start, quiet).unwrap();
                members.push(member);
                end = own;
            }
            found.push(members);
        }
        assert_eq!(found[0], found[1]);
    }
}
