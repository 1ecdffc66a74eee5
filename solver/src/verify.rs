//! `solver.accuracy: "verify"`: the problem once more on its mesh split in two, with all load steps, and on the mesh that it
//! was split from, if there is one. What they differ by says how far the solution can be trusted; the solution itself stays
//! as it is, whatever becomes of the others.

use std::ops::ControlFlow;

use crate::accuracy::{self, OnOtherMesh};
use crate::body::ElasticBody;
use crate::error::SolveError;
use crate::mesh::{External, ExternalMesh, Mesh, refine};
use crate::model::Model;
use crate::model::estimate::MostElements;
use crate::problem::{Problem, Refine};
use crate::solution::{Accuracy, Observer, Outcome, Phase, Progress, Solution};
use crate::steps;

/// What the verification of a solution needs beside its problem and its mesh.
pub struct Verification {
    /// The problem's own mesh, if it is not in the problem.
    external: Option<External>,
    /// Most elements of the finer mesh, where the caller does not choose how many there are.
    most: Option<MostElements>,
}

impl Verification {
    /// For a problem that asks for it. `external`: the mesh that it only names or quotes.
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

    /// For adaptive refinement, which begins with this model: its last mesh may have as many elements as it likes, and a
    /// finer one no more than the estimate of the memory assumes.
    pub fn limited(mut self, first: &Model) -> Verification {
        self.most = Some(MostElements::of(first));
        self
    }

    /// Verifies the errors that are stated for a solution on this mesh. A stop leaves the estimates.
    pub fn verify(
        self,
        problem: &Problem,
        mesh: &Mesh,
        solution: &mut Solution,
        observe: &mut Observer<'_>,
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
        *estimated = match self.compared(problem, mesh, estimated, observe) {
            Ok(verified) => verified,
            Err(why) => accuracy::unverified(estimated.clone(), &why),
        };
        accuracy::limit_by(&summary.warnings, estimated);
    }

    /// The errors by comparison; or why there are none, in words.
    fn compared(
        self,
        problem: &Problem,
        mesh: &Mesh,
        estimated: &Accuracy,
        observe: &mut Observer<'_>,
    ) -> Result<Accuracy, String> {
        let mut watched = Watched {
            observe,
            stopped: None,
        };
        if watched.observe(Progress::Phase(Phase::Verify)).is_break() {
            return Err(watched.why_not(&SolveError::Stopped));
        }
        let model = self.finer(problem, mesh)?;
        let finer = solved(&model, &mut watched);
        drop(model);
        let finer = finer.map_err(|error| watched.why_not(&error))??;
        let coarser = match problem.mesh.refine {
            Refine::Times(times @ 1..) => {
                let mut problem = problem.clone();
                problem.mesh.refine = Refine::Times(times - 1);
                let model = Model::new(&problem, self.external);
                // without it there are no orders, and the rest stands
                model
                    .ok()
                    .and_then(|model| solved(&model, &mut watched).ok()?.ok())
            }
            _ => None,
        };
        let mut verified = accuracy::verified(estimated, &finer, coarser.as_deref());
        if coarser.is_none() && matches!(problem.mesh.refine, Refine::Times(1..)) {
            let reason = "Orders of convergence are not known: there is no solution on the mesh of one `refine` less.";
            verified.reasons.push(reason.to_owned());
        }
        Ok(verified)
    }

    /// The problem on the finer mesh.
    fn finer(&self, problem: &Problem, mesh: &Mesh) -> Result<Model, String> {
        let too_many = |found: usize, most: usize, of: &str| match found > most {
            true => Err(format!(
                "the mesh split in two would have {found} elements{of}, more than {most}"
            )),
            false => Ok(()),
        };
        if let Some(most) = &self.most {
            too_many(4 * mesh.elements.len(), most.elements, "")?;
        }
        let model = Model::on_mesh(problem, ExternalMesh::from(refine(mesh)));
        let model = model.map_err(|violations| {
            let first = violations.first().map_or(String::new(), |v| v.to_string());
            format!("the mesh split in two is refused: {first}")
        })?;
        if !model.mesh.inverted_elements(false).is_empty() {
            return Err(
                "an element is so curved or crooked that its parts would be folded".to_owned(),
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

/// The quantities of a problem on another mesh; `Err` inside: it was solved, but to no end.
fn solved(
    model: &Model,
    watched: &mut Watched<'_, '_>,
) -> Result<Result<Vec<OnOtherMesh>, String>, SolveError> {
    let observe: &mut Observer<'_> = &mut |progress| watched.observe(progress);
    let body = ElasticBody::new(model, observe)?;
    let reported = steps::run_to_compare(model, &body, observe)?;
    if reported.summary.outcome != Outcome::Converged {
        return Ok(Err(
            "on the mesh split in two the iterations did not converge".to_owned(),
        ));
    }
    let name = |patch: usize| &model.contacts[patch].name;
    // one that is no number is none
    let quantities = reported.quantities.iter();
    let quantities = quantities.filter(|q| q.value.is_finite());
    Ok(Ok(quantities
        .map(|q| OnOtherMesh::new(q, name(q.patch)))
        .collect()))
}

/// An observer that is asked whether to go on, and not shown how; with what it said no to.
struct Watched<'a, 'b> {
    observe: &'a mut Observer<'b>,
    stopped: Option<Stop>,
}

/// What the observer said no to.
enum Stop {
    /// So many bytes more.
    Memory(u64),
    /// Going on.
    Going,
}

impl Watched<'_, '_> {
    fn observe(&mut self, progress: Progress<'_>) -> ControlFlow<()> {
        // these ask for more than going on: a no is an answer, and does not stop the solution
        if matches!(progress, Progress::SecondThread | Progress::Room { .. }) {
            return (self.observe)(progress);
        }
        let (progress, stop) = match progress {
            Progress::Needs { bytes } => (progress, Stop::Memory(bytes)),
            Progress::OutOfMemory { bytes } => (progress, Stop::Memory(bytes)),
            Progress::Phase(Phase::Verify) => (progress, Stop::Going),
            _ => (Progress::Pulse, Stop::Going),
        };
        let answer = (self.observe)(progress);
        if answer.is_break() {
            self.stopped.get_or_insert(stop);
        }
        answer
    }

    /// Why there is no solution on the finer mesh.
    fn why_not(&self, error: &SolveError) -> String {
        match (&self.stopped, error) {
            (Some(Stop::Memory(bytes)), _) | (None, SolveError::ResourceExhausted { bytes }) => {
                format!(
                    "the mesh split in two needs more memory than there is, {:.0} MiB for one matrix alone",
                    *bytes as f64 / f64::from(1 << 20)
                )
            }
            (Some(Stop::Going), _) | (None, SolveError::Stopped) => {
                "solving on the mesh split in two was stopped before its end, on request or at a limit of time or memory".to_owned()
            }
            (None, error) => format!("on the mesh split in two {error}"),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_no_to_a_second_thread_is_an_answer_and_does_not_stop() {
        let mut asked = 0;
        let mut refuse = |progress: Progress<'_>| {
            asked += 1;
            match progress {
                Progress::SecondThread | Progress::Room { .. } => ControlFlow::Break(()),
                _ => ControlFlow::Continue(()),
            }
        };
        let mut watched = Watched {
            observe: &mut refuse,
            stopped: None,
        };
        assert!(watched.observe(Progress::SecondThread).is_break());
        assert!(watched.observe(Progress::Room { bytes: 1 }).is_break());
        assert!(watched.observe(Progress::Needs { bytes: 1 }).is_continue());
        assert!(watched.stopped.is_none());
        assert_eq!(asked, 3);
    }

    /// After adaptive refinement no mesh is solved on that its memory was not estimated for.
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
            let mut solution = crate::solve(&problem, &mut |_| ControlFlow::Continue(())).unwrap();
            assert_eq!(
                solution.summary.accuracy.as_ref().unwrap().verified,
                Some(true)
            );
            let before = solution.summary.accuracy.clone().unwrap();
            verification.verify(&problem, &model.mesh, &mut solution, &mut |progress| {
                assert!(
                    matches!(progress, Progress::Phase(Phase::Verify)),
                    "{progress:?}"
                );
                ControlFlow::Continue(())
            });
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
