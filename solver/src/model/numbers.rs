//! Numbers by themselves: finite, and in their range.

use super::findings::Findings;
use crate::contact::obstacle;
use crate::error::escape;
use crate::problem::{Analysis, Contact, Material, Obstacle, Problem, SolverControls};

impl Findings {
    /// JSON has no other numbers, but protobuf has.
    pub(super) fn finite(&mut self, problem: &Problem) {
        // serde_json writes a number that is not finite as null, and we never write null otherwise
        fn walk(value: &serde_json::Value, pointer: &mut String, found: &mut Vec<String>) {
            let length = pointer.len();
            match value {
                serde_json::Value::Null => found.push(pointer.clone()),
                serde_json::Value::Array(items) => {
                    for (i, item) in items.iter().enumerate() {
                        pointer.push_str(&format!("/{i}"));
                        walk(item, pointer, found);
                        pointer.truncate(length);
                    }
                }
                serde_json::Value::Object(fields) => {
                    for (name, item) in fields {
                        pointer.push('/');
                        pointer.push_str(&escape(name));
                        walk(item, pointer, found);
                        pointer.truncate(length);
                    }
                }
                _ => {}
            }
        }
        let mut found = Vec::new();
        if let Ok(value) = serde_json::to_value(problem) {
            walk(&value, &mut String::new(), &mut found);
        }
        for pointer in found {
            self.say(
                pointer,
                "not_finite",
                "NaN or infinity",
                "a finite number",
                "Check the computation that produced it.",
            );
        }
    }

    /// Long lists of the same thing are a mistake, and each of them is gone through edge by edge.
    pub(super) fn counts(&mut self, problem: &Problem) {
        const MOST: usize = 1000;
        for (pointer, count) in [
            ("/supports", problem.supports.len()),
            ("/loads", problem.loads.len()),
            ("/contacts", problem.contacts.len()),
            ("/mesh/boundaries", problem.mesh.boundaries.len()),
        ] {
            if count > MOST {
                self.say(
                    pointer,
                    "too_many",
                    format!("{count} of them"),
                    format!("at most {MOST}"),
                    "Name boundaries so that fewer are needed.",
                );
            }
        }
    }

    pub(super) fn analysis(&mut self, analysis: &Analysis) {
        if let Analysis::PlaneStress { thickness } = *analysis {
            self.require(
                thickness > 0.0,
                "/analysis/thickness".into(),
                thickness,
                "a length > 0",
                "Forces are proportional to it.",
            );
        }
    }

    pub(super) fn materials<'a>(&mut self, materials: &'a [Material]) -> Option<&'a Material> {
        if materials.len() != 1 {
            self.say(
                "/materials",
                "wrong_count",
                format!("{} materials", materials.len()),
                "exactly one material",
                "The whole body has one material.",
            );
        }
        for (i, m) in materials.iter().enumerate() {
            let at = |field: &str| format!("/materials/{i}/{field}");
            self.require(
                m.youngs_modulus > 0.0,
                at("youngs_modulus"),
                m.youngs_modulus,
                "a stress > 0",
                "Young's modulus E.",
            );
            self.require(
                m.poissons_ratio > -1.0 && m.poissons_ratio < 0.5,
                at("poissons_ratio"),
                m.poissons_ratio,
                "−1 < Poisson's ratio < 0.5",
                "For a nearly incompressible body use a value such as 0.49.",
            );
        }
        materials.first()
    }

    pub(super) fn controls(&mut self, controls: &SolverControls) {
        self.require(
            controls.tolerance >= 1e-14 && controls.tolerance < 1.0,
            "/solver/tolerance".into(),
            controls.tolerance,
            "a number from 1e-14 to below 1",
            "It bounds dimensionless residuals; 1e-10 is the default.",
        );
        self.require(
            (1..=100_000).contains(&controls.max_iterations),
            "/solver/max_iterations".into(),
            f64::from(controls.max_iterations),
            "1 … 100000 sweeps",
            "6 to 25 are usual.",
        );
    }

    pub(super) fn contact_numbers(&mut self, contact: &Contact, pointer: &str) {
        if let Obstacle::Circle { radius, .. } | Obstacle::Parabola { radius, .. } =
            contact.obstacle
        {
            self.require(
                radius > 0.0,
                format!("{pointer}/obstacle/radius"),
                radius,
                "a length > 0",
                "The obstacle is convex towards the body.",
            );
        }
        if let (Some(from), Some(to), _) = obstacle::span(&contact.obstacle)
            && from >= to
        {
            self.say(
                format!("{pointer}/obstacle/to"),
                "out_of_range",
                to,
                format!("more than `from`, {from}"),
                "`from` and `to` are the ends of the obstacle.",
            );
        }
        let Some(friction) = &contact.friction else {
            return;
        };
        let at = |field: &str| format!("{pointer}/friction/{field}");
        self.require(
            friction.coefficient >= 0.0,
            at("coefficient"),
            friction.coefficient,
            "a number ≥ 0",
            "Leave `friction` out for frictionless contact.",
        );
        self.require(
            friction.nonlocal_radius >= 0.0,
            at("nonlocal_radius"),
            friction.nonlocal_radius,
            "a length ≥ 0",
            "0 is Coulomb's local law.",
        );
        self.require(
            friction.elastic_slip > 0.0,
            at("elastic_slip"),
            friction.elastic_slip,
            "a length > 0",
            "About 1e-4 of the contact's width; below 1e-5 nothing physical changes.",
        );
    }
}
