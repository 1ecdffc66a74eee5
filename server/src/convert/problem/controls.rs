//! Load steps, and how to solve.

use solver::{
    error::escape,
    problem::{Algorithm, SolverControls, Spacing, Step, ThesisOptions, ThesisPressure},
};

use super::Reader;
use crate::pb;

impl Reader {
    pub(super) fn step(&mut self, at: &str, message: pb::Step) -> Option<Step> {
        let pb::Step {
            name,
            indentation,
            tangential_displacement,
            loads,
            supports,
            increments,
            spacing,
        } = message;
        let spacing = match self.choice(&format!("{at}/spacing"), spacing)? {
            pb::Spacing::Unspecified | pb::Spacing::Uniform => Spacing::Uniform,
            pb::Spacing::ContactWidth => Spacing::ContactWidth,
        };
        let mut factor = |name: &str, value: Option<f64>| {
            self.some_number(&format!("{at}/{name}"), value)
                .unwrap_or(1.0)
        };
        Some(Step {
            name,
            indentation: factor("indentation", indentation),
            tangential_displacement: factor(
                "tangential_displacement",
                Some(tangential_displacement),
            ),
            loads: factor("loads", loads),
            supports: factor("supports", supports),
            increments: increments.unwrap_or(1),
            spacing,
        })
    }

    pub(super) fn controls(&mut self, message: pb::SolverControls) -> Option<SolverControls> {
        let pb::SolverControls {
            algorithm,
            tolerance,
            max_iterations,
            check_uniqueness,
            check_increments,
            thesis,
        } = message;
        let defaults = SolverControls::default();
        let algorithm = match self.choice("/solver/algorithm", algorithm)? {
            pb::Algorithm::Unspecified | pb::Algorithm::Auto => Algorithm::Auto,
            pb::Algorithm::FixedPoint => Algorithm::FixedPoint,
            pb::Algorithm::Newton => Algorithm::Newton,
            pb::Algorithm::Thesis => Algorithm::Thesis,
        };
        let tolerance = self
            .some_number("/solver/tolerance", tolerance)
            .unwrap_or(defaults.tolerance);
        let thesis = match thesis {
            Some(options) => Some(self.thesis(options)?),
            None => None,
        };
        Some(SolverControls {
            algorithm,
            tolerance,
            max_iterations: max_iterations.unwrap_or(defaults.max_iterations),
            check_uniqueness,
            check_increments,
            thesis,
        })
    }

    fn thesis(&mut self, message: pb::ThesisOptions) -> Option<ThesisOptions> {
        let pb::ThesisOptions {
            contact_guess,
            friction_force,
            pressure,
            local_points,
            relaxation,
            signed,
        } = message;
        let defaults = ThesisOptions::default();
        let pressure = match self.choice("/solver/thesis/pressure", pressure)? {
            pb::ThesisPressure::Unspecified | pb::ThesisPressure::Lumped => ThesisPressure::Lumped,
            pb::ThesisPressure::Extrapolated => ThesisPressure::Extrapolated,
        };
        let guess = contact_guess.into_iter().map(|(name, range)| {
            let at = format!("/solver/thesis/contact_guess/{}", escape(&name));
            let range = self.range(&at, range);
            (name, range)
        });
        let contact_guess = guess.collect();
        Some(ThesisOptions {
            contact_guess,
            friction_force: friction_force.unwrap_or(defaults.friction_force),
            pressure,
            local_points,
            relaxation: self
                .some_number("/solver/thesis/relaxation", relaxation)
                .unwrap_or(defaults.relaxation),
            signed,
        })
    }
}
