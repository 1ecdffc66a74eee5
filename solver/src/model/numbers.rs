//! Checks that single numbers are finite and in their range.

use super::checks::Checks;
use super::units;
use crate::element::{Element, Family};
use crate::error::{AllChecks, Checked, MOST_LISTED, Reason, escape};
use crate::finite::not_finite;
use crate::mesh::Mesh;
use crate::problem::{
    Algorithm, Analysis, Condition, Contact, Friction, FrictionPoints, History, Measure, NormalOf,
    Problem, Step, ThesisOptions, ThesisPressure, Units,
};
use crate::solution::WarningCode;

/// What the thesis's own iteration does not support in a contact: the test for it, the field, what was found, what is
/// supported, and the reason.
#[rustfmt::skip] // a table
const NOT_OF_THE_THESIS: [(OfContact, [&str; 4]); 9] = [
    (|contact| contact.condition != Condition::Unilateral, [
        "condition", "a condition other than `unilateral`", "`unilateral`",
        "The thesis's iteration supports no other condition",
    ]),
    (|contact| has_friction(contact, |f| f.measure == Measure::Surface), [
        "friction/measure", "`surface`", "`line`",
        "The thesis averages along the line of contact (3.4)",
    ]),
    (|contact| has_friction(contact, |f| f.history == History::Incremental), [
        "friction/history", "`incremental`", "`total`",
        "The thesis's law does not depend on the path",
    ]),
    (|contact| contact.normal == Some(NormalOf::Obstacle), [
        "normal", "`obstacle`", "`body`",
        "The thesis uses the body's normal only",
    ]),
    (|contact| contact.direction.is_some(), [
        "direction", "a direction", "none: against the body's normal",
        "Obstacles of the thesis move against the body's normal",
    ]),
    (|contact| contact.against.is_some(), [
        "against", "another body", "an `obstacle`",
        "Obstacles of the thesis are rigid",
    ]),
    (Contact::is_tool, [
        "condition", "an obstacle with a load or a tilt", "an obstacle with an `indentation`",
        "Obstacles of the thesis have given displacements",
    ]),
    (|contact| has_friction(contact, |f| f.bound.is_some()), [
        "friction/bound", "a prescribed bound", "a coefficient and a nonlocal radius",
        "The thesis's bound follows from the pressure",
    ]),
    (|contact| has_friction(contact, |f| f.points == FrictionPoints::Nodal), [
        "friction/points", "`nodal`", "`gauss3`",
        "The thesis evaluates friction at Gauss points",
    ]),
];

type OfContact = fn(&Contact) -> bool;

fn has_friction(contact: &Contact, such: fn(&Friction) -> bool) -> bool {
    contact.friction.as_ref().is_some_and(such)
}

impl Checks {
    /// Checks for NaN and infinity, which cannot come from JSON, but from protobuf.
    pub(super) fn finite(&mut self, problem: &Problem) -> Checked {
        let mut all = AllChecks::default();
        let (listed, more) = not_finite(problem, MOST_LISTED);
        for pointer in listed {
            all.fail(self.report(
                pointer,
                Reason::NotFinite,
                "NaN or infinity",
                "a finite number",
                "Check the computation that produced the number.",
            ));
        }
        self.found.count(more);
        all.finish(())
    }

    /// Checks the lengths of lists: a very long list is a mistake, and each of its entries would be checked edge by
    /// edge.
    pub(super) fn counts(&mut self, problem: &Problem) -> Checked {
        let mut all = AllChecks::default();
        const MOST: usize = 1000;
        for (pointer, count) in [
            ("/supports", problem.supports.len()),
            ("/loads", problem.loads.len()),
            ("/contacts", problem.contacts.len()),
            ("/materials", problem.materials.len()),
            ("/steps", problem.steps.len()),
            ("/mesh/boundaries", problem.mesh.boundaries.len()),
            ("/mesh/groups", problem.mesh.groups.len()),
            ("/mesh/curves", problem.mesh.curves.len()),
        ] {
            if count > MOST {
                all.fail(self.report(
                    pointer,
                    Reason::TooMany,
                    format!("{count} entries"),
                    format!("at most {MOST}"),
                    "Name boundaries so that fewer entries are needed.",
                ));
            }
        }
        all.finish(())
    }

    /// Checks the names of units, which must fit on an axis.
    pub(super) fn units(&mut self, units: Option<&Units>) -> Checked {
        const MOST: usize = 20;
        let Some(Units {
            length,
            force,
            stress,
        }) = units
        else {
            return Ok(());
        };
        let mut all = AllChecks::default();
        for (name, label) in [("length", length), ("force", force), ("stress", stress)] {
            let characters = label.as_ref().map_or(0, |label| label.chars().count());
            if characters > MOST {
                all.fail(self.report(
                    format!("/units/{name}"),
                    Reason::TooLong,
                    format!("{characters} characters"),
                    format!("at most {MOST} characters"),
                    "A unit is a label on axes, such as mm or MPa.",
                ));
            }
        }
        if let (Some(length), Some(force), Some(stress)) = (length, force, stress)
            && let Some(factor) = units::disagreement(length, force, stress)
        {
            self.warn(
                WarningCode::UnitsDisagree,
                "/units",
                format!(
                    "1 {force} on an area of 1 {length} by 1 {length} is {factor:.4e} {stress}, but must be 1 {stress}: all numbers of a problem have to be in units that belong together. Change a unit and the numbers that are given in it: mm, N and MPa belong together, as do m, N and Pa."
                ),
            );
        }
        all.finish(())
    }

    pub(super) fn analysis(&mut self, analysis: &Analysis) -> Checked {
        match *analysis {
            Analysis::PlaneStress { thickness } => self.require(
                thickness > 0.0,
                "/analysis/thickness",
                thickness,
                "a length > 0",
                "Forces are proportional to the thickness.",
            ),
            Analysis::PlaneStrain {} | Analysis::Axisymmetric {} => Ok(()),
        }
    }

    pub(super) fn controls(&mut self, problem: &Problem) -> Checked {
        let mut all = AllChecks::default();
        let controls = &problem.solver;
        if problem.quadrature != 2 && problem.quadrature != 3 {
            all.fail(self.report(
                "/quadrature",
                Reason::OutOfRange,
                problem.quadrature,
                "3 or 2",
                "Gauss points of an element in each direction.",
            ));
        }
        if controls.check_increments && problem.steps.is_empty() {
            all.fail(self.report(
                "/solver/check_increments",
                Reason::NotUsed,
                "true without steps",
                "true with `steps` only",
                "Without steps there are no increments to double.",
            ));
        }
        if controls.verifies() && problem.contacts.is_empty() {
            all.fail(self.report(
                "/solver/accuracy",
                Reason::NotUsed,
                "`verify` without a contact",
                "`verify` with `contacts` only",
                "`verify` is about the forces, peak stresses and extents of contacts.",
            ));
        }
        all.check(self.require(
            controls.tolerance >= 1e-14 && controls.tolerance < 1.0,
            "/solver/tolerance",
            controls.tolerance,
            "a number from 1e-14 to below 1",
            "The tolerance bounds dimensionless residuals; 1e-10 is the default.",
        ));
        all.check(self.require(
            (1..=100_000).contains(&controls.max_iterations),
            "/solver/max_iterations",
            f64::from(controls.max_iterations),
            "1 … 100000 sweeps",
            "6 to 25 are usual.",
        ));
        all.finish(())
    }

    pub(super) fn steps(&mut self, steps: &[Step]) -> Checked {
        let mut all = AllChecks::default();
        /// The most increments of one step: far more than is useful, but few enough to bound the time.
        const MOST_INCREMENTS: u32 = 10_000;
        /// The most increments of all steps together: each adds rows to the history.
        const MOST_IN_ALL: u64 = 20_000;
        let total: u64 = steps.iter().map(|step| u64::from(step.increments)).sum();
        if total > MOST_IN_ALL {
            all.fail(self.report(
                "/steps",
                Reason::TooMany,
                format!("{total} increments in total"),
                format!("at most {MOST_IN_ALL}"),
                "Use fewer increments, or split the problem into several jobs.",
            ));
        }
        for (i, step) in steps.iter().enumerate() {
            all.check(self.require(
                (1..=MOST_INCREMENTS).contains(&step.increments),
                format!("/steps/{i}/increments"),
                f64::from(step.increments),
                &format!("1 … {MOST_INCREMENTS}"),
                "1 is enough for the total law; the incremental law needs a few dozen for curved obstacles.",
            ));
        }
        all.finish(())
    }

    /// Checks that the thesis's algorithm has quadrilaterals only: it extrapolates stresses to the boundary from rows
    /// of Gauss points, which triangles lack.
    pub(super) fn thesis_elements(&mut self, problem: &Problem, mesh: &Mesh) -> Checked {
        let triangle = |element: &Element| element.family() == Family::Triangle;
        if problem.solver.algorithm == Algorithm::Thesis
            && let Some(e) = mesh.elements.iter().position(triangle)
        {
            return Err(self.report(
                "/solver/algorithm",
                Reason::NotUsed,
                format!("`thesis` with triangles (element {e} is one)"),
                "a mesh of quadrilaterals",
                "Only quadrilaterals have the rows of Gauss points that `thesis` uses; choose another algorithm.",
            ));
        }
        Ok(())
    }

    /// Checks the options of the thesis's own iteration, and that it supports the contacts.
    pub(super) fn thesis(&mut self, problem: &Problem) -> Checked {
        let mut all = AllChecks::default();
        let controls = &problem.solver;
        if controls.algorithm != Algorithm::Thesis {
            if controls.thesis.is_some() {
                return Err(self.report(
                    "/solver/thesis",
                    Reason::NotUsed,
                    "`thesis` options with another algorithm",
                    "no `thesis` options unless \"algorithm\" is \"thesis\"",
                    "Choose the algorithm `thesis`, or remove the options.",
                ));
            }
            return Ok(());
        }
        for (i, contact) in problem.contacts.iter().enumerate() {
            for (is_so, [field, got, expected, why]) in NOT_OF_THE_THESIS {
                if is_so(contact) {
                    all.fail(self.report(
                        format!("/contacts/{i}/{field}"),
                        Reason::NotUsed,
                        got,
                        expected,
                        format!("{why}; choose another algorithm."),
                    ));
                }
            }
        }
        if let Some(options) = &controls.thesis {
            all.check(self.thesis_options(options, &problem.contacts));
        }
        all.finish(())
    }

    fn thesis_options(&mut self, options: &ThesisOptions, contacts: &[Contact]) -> Checked {
        let mut all = AllChecks::default();
        all.check(self.require(
            options.relaxation > 0.0 && options.relaxation <= 1.0,
            "/solver/thesis/relaxation",
            options.relaxation,
            "0 < relaxation ≤ 1",
            "1 applies the new friction force without relaxation.",
        ));
        all.check(self.require(
            [1, 2].contains(&options.friction_force),
            "/solver/thesis/friction_force",
            f64::from(options.friction_force),
            "1 or 2",
            "The two ways of thesis 3.2.",
        ));
        all.check(self.require(
            options.local_points <= 100,
            "/solver/thesis/local_points",
            f64::from(options.local_points),
            "0 … 100",
            "The number of Gauss points in the part of each element that the kernel covers; 0 averages the quadratic pressure between the nodes by a rule that does not depend on the elements.",
        ));
        if options.local_points > 0 && options.pressure == ThesisPressure::Lumped {
            all.fail(self.report(
                "/solver/thesis/local_points",
                Reason::NotUsed,
                options.local_points,
                "0 with lumped pressure",
                "Local Gauss points need an extrapolated stress: choose \"pressure\": \"extrapolated\".",
            ));
        }
        for (name, [s0, s1]) in &options.contact_guess {
            let pointer = format!("/solver/thesis/contact_guess/{}", escape(name));
            if !contacts.iter().any(|c| c.boundary == *name) {
                all.fail(self.report(
                    &pointer,
                    Reason::UnknownBoundary,
                    name,
                    "the boundary of a contact",
                    "Give guesses only for the boundaries named under /contacts.",
                ));
            }
            if s0 >= s1 {
                all.fail(self.report(
                    &pointer,
                    Reason::OutOfRange,
                    format!("[{s0}, {s1}]"),
                    "a first end below the second",
                    "Arc length from the start of the named boundary.",
                ));
            }
        }
        all.finish(())
    }
}
