//! Verification by `solver.accuracy: "verify"`: solves the problem once more on its mesh with every element split in
//! two, with all load steps, and on the mesh one refinement coarser, if there is one. The differences show how far the
//! solution can be trusted. They never change the solution itself.

use crate::accuracy::{self, OnOtherMesh};
use crate::body::ElasticBody;
use crate::error::SolveError;
use crate::mesh::{External, ExternalMesh, Mesh, refine};
use crate::model::Model;
use crate::model::estimate::MostElements;
use crate::observer::{Observer, Progress};
use crate::problem::{Problem, Refine};
use crate::solution::{Accuracy, Outcome, Phase, Solution};
use crate::steps;

/// The data that verifying a solution needs in addition to its problem and its mesh.
pub struct Verification {
    /// The problem's mesh, if the problem refers to it instead of containing it.
    external: Option<External>,
    /// The largest number of elements of the refined mesh; `None` if the caller chooses the size.
    most: Option<MostElements>,
}

impl Verification {
    /// The verification of a problem that requests it. `external`: the mesh that the problem only names or contains as
    /// text.
    pub fn of(problem: &Problem, external: &Option<External>) -> Option<Verification> {
        problem.solver.verifies().then(|| Verification {
            // only a mesh that is refined is needed again
            external: match problem.mesh.refine {
                Refine::Times(1..) => external.clone(),
                _ => None,
            },
            most: None,
        })
    }

    /// Limits the refined mesh for adaptive refinement that starts from the model `first`: the last mesh of the
    /// refinement may have any number of elements, but the refined mesh only as many as the estimate of the memory
    /// assumes.
    pub fn limited(mut self, first: &Model) -> Verification {
        self.most = Some(MostElements::of(first));
        self
    }

    /// Verifies the errors that are stated for a solution on this mesh. If the verification is stopped, the estimates
    /// remain.
    pub fn verify(
        self,
        problem: &Problem,
        mesh: &Mesh,
        solution: &mut Solution,
        observer: &mut dyn Observer,
    ) {
        let converged = solution.summary.outcome == Outcome::Converged;
        let summary = &mut solution.summary;
        let Some(estimated) = &mut summary.accuracy else {
            return;
        };
        if !converged {
            estimated.verified = Some(false);
            return;
        }
        *estimated = match self.compared(problem, mesh, estimated, observer) {
            Ok(verified) => verified,
            Err(why) => accuracy::unverified(estimated.clone(), &why),
        };
        accuracy::limit_by(&summary.warnings, estimated);
    }

    /// The errors by comparison of solutions, or the reason why there are no such errors.
    fn compared(
        self,
        problem: &Problem,
        mesh: &Mesh,
        estimated: &Accuracy,
        observer: &mut dyn Observer,
    ) -> Result<Accuracy, String> {
        observer.event(Progress::Phase(Phase::Verify));
        let mut observer = QuietObserver {
            observer,
            stopped: None,
        };
        if observer.stop() {
            return Err(observer.why_not(&SolveError::Stopped));
        }
        let model = self.finer(problem, mesh)?;
        let finer = solved(&model, &mut observer);
        drop(model);
        let finer = finer.map_err(|error| observer.why_not(&error))??;
        let coarser = match problem.mesh.refine {
            Refine::Times(times @ 1..) => {
                let mut problem = problem.clone();
                problem.mesh.refine = Refine::Times(times - 1);
                let model = Model::new(&problem, self.external);
                // without it there are no orders, and the rest stands
                model
                    .ok()
                    .and_then(|model| solved(&model, &mut observer).ok()?.ok())
            }
            _ => None,
        };
        let mut verified = accuracy::verified(estimated, &finer, coarser.as_deref());
        if coarser.is_none() && matches!(problem.mesh.refine, Refine::Times(1..)) {
            let reason = "Orders of convergence are unknown: there is no solution on the mesh with one `refine` less.";
            verified.reasons.push(reason.to_owned());
        }
        Ok(verified)
    }

    /// The problem on the refined mesh.
    fn finer(&self, problem: &Problem, mesh: &Mesh) -> Result<Model, String> {
        let too_many = |found: usize, most: usize, of: &str| {
            if found > most {
                Err(format!(
                    "the refined mesh (every element split in two) would have {found} elements{of}, more than {most}"
                ))
            } else {
                Ok(())
            }
        };
        if let Some(most) = &self.most {
            too_many(4 * mesh.elements.len(), most.elements, "")?;
        }
        let model = Model::on_mesh(problem, ExternalMesh::from(refine(mesh)));
        let model = model.map_err(|violations| {
            let first = violations.first().map_or(String::new(), |v| v.to_string());
            format!("the refined mesh (every element split in two) is invalid: {first}")
        })?;
        if !model.mesh.inverted_elements(false).is_empty() {
            return Err(
                "an element is so curved or distorted that its parts would be inverted".to_owned(),
            );
        }
        if let Some(most) = &self.most {
            for (contact, most) in model.contacts.iter().zip(&most.at_contacts) {
                too_many(contact.boundary.edge_count(), *most, " at one contact")?;
            }
        }
        Ok(model)
    }
}

/// The quantities of a problem on another mesh; the inner `Err`: the iterations did not converge.
fn solved(
    model: &Model,
    observer: &mut QuietObserver<'_>,
) -> Result<Result<Vec<OnOtherMesh>, String>, SolveError> {
    let body = ElasticBody::new(model, observer)?;
    let reported = steps::run_to_compare(model, &body, observer)?;
    if reported.summary.outcome != Outcome::Converged {
        return Ok(Err(
            "the iterations did not converge on the refined mesh".to_owned()
        ));
    }
    let name = |patch: usize| &model.contacts[patch].name;
    // one that is no number is none
    let quantities = reported.along.quantities.iter();
    let quantities = quantities.filter(|q| q.value.is_finite());
    Ok(Ok(quantities
        .map(|q| OnOtherMesh::new(q, name(q.patch)))
        .collect()))
}

/// An observer of the other solution: passes questions on to the observer of the solution, but no progress; records why
/// the other solution was stopped.
struct QuietObserver<'a> {
    observer: &'a mut dyn Observer,
    stopped: Option<Stop>,
}

/// Why the other solution was stopped.
enum Stop {
    /// The other solution needed this many more bytes.
    Memory(u64),
    /// The observer asked to stop.
    Asked,
}

impl Observer for QuietObserver<'_> {
    fn event(&mut self, progress: Progress<'_>) {
        if let Progress::OutOfMemory { bytes } = progress {
            self.stopped.get_or_insert(Stop::Memory(bytes));
        }
    }

    fn stop(&mut self) -> bool {
        if self.stopped.is_none() && self.observer.stop() {
            self.stopped = Some(Stop::Asked);
        }
        self.stopped.is_some()
    }

    fn behind(&mut self) -> Option<&mut dyn Observer> {
        Some(self.observer)
    }
}

impl QuietObserver<'_> {
    /// The reason why there is no solution on the refined mesh.
    fn why_not(&self, error: &SolveError) -> String {
        match (&self.stopped, error) {
            (Some(Stop::Memory(bytes)), _) | (None, SolveError::ResourceExhausted { bytes }) => {
                format!(
                    "verification on the refined mesh needs more memory than there is, {:.0} MiB for one matrix alone",
                    *bytes as f64 / f64::from(1 << 20)
                )
            }
            (Some(Stop::Asked), _) | (None, SolveError::Stopped) => {
                "verification on the refined mesh was stopped (canceled, or out of time or memory)"
                    .to_owned()
            }
            (None, error) => format!("on the refined mesh {error}"),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Refuses memory, and must not be shown anything.
    struct Refuses;

    impl Observer for Refuses {
        fn event(&mut self, progress: Progress<'_>) {
            panic!("{progress:?}");
        }

        fn may_use(&mut self, _: u64) -> bool {
            false
        }
    }

    #[test]
    fn memory_that_is_refused_stops_only_what_cannot_go_on_without() {
        let mut observer = QuietObserver {
            observer: &mut Refuses,
            stopped: None,
        };
        assert!(!observer.may_use(1) && observer.threads() == 1 && !observer.stop());
        observer.event(Progress::OutOfMemory { bytes: 1 << 20 });
        assert!(observer.stop());
        let why = observer.why_not(&SolveError::Stopped);
        assert!(why.contains("more memory than there is, 1 MiB"), "{why}");
    }

    /// After adaptive refinement, a mesh for which no memory was estimated is not solved on.
    #[test]
    fn a_mesh_that_would_be_too_large_is_not_solved_on() {
        let problem: Problem = serde_json::from_value(serde_json::json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 1, 2, 3], "y": [0, 1, 2]}, "refine": {"tolerance": 0.5}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "uy": 0}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "parabola", "radius": 20}, "indentation": 0.05}],
            "solver": {"accuracy": "verify"}
        }))
        .unwrap();
        let model = Model::new(&problem, None).unwrap();
        let verification = Verification::of(&problem, &None).unwrap().limited(&model);
        assert!(verification.finer(&problem, &model.mesh).is_ok());
        let too_small = |elements: usize, at_contact: usize| Verification {
            external: None,
            most: Some(MostElements {
                elements,
                at_contacts: vec![at_contact],
            }),
        };
        let refused = |verification: Verification| {
            let mut solution = crate::solve(&problem, &mut ()).unwrap();
            assert_eq!(
                solution.summary.accuracy.as_ref().unwrap().verified,
                Some(true)
            );
            let before = solution.summary.accuracy.clone().unwrap();
            verification.verify(
                &problem,
                &model.mesh,
                &mut solution,
                &mut |progress: Progress<'_>| {
                    assert!(
                        matches!(progress, Progress::Phase(Phase::Verify)),
                        "{progress:?}"
                    );
                },
            );
            let accuracy = solution.summary.accuracy.unwrap();
            assert_eq!(accuracy.verified, Some(false));
            assert_eq!(accuracy.quantities, before.quantities);
            accuracy.reasons[0].clone()
        };
        assert!(refused(too_small(23, 6)).ends_with("would have 24 elements, more than 23."));
        let at_contact = refused(too_small(24, 5));
        assert!(
            at_contact.ends_with("6 elements at one contact, more than 5."),
            "{at_contact}"
        );
        let none = too_small(24, 6).finer(&problem, &model.mesh);
        assert!(none.is_ok());
    }
}
