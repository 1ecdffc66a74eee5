//! A problem from a typed message. What a message can say and JSON cannot (an absent
//! message, an enum number that nobody knows, a number that is not finite) is found here, all of
//! it, with the pointers that the JSON form would have.

mod boundary;
mod contact;
mod controls;
mod mesh;

use solver::{
    error::Violation,
    problem::{Analysis, Problem, SolverControls, Units},
};

use crate::{pb, violations::Violations};

/// Reads a message; every violation found, with pointers relative to the problem.
pub fn problem_from_pb(message: pb::Problem) -> Result<Problem, Vec<Violation>> {
    let mut read = Reader::default();
    let problem = read.problem(message);
    match problem {
        Some(problem) if read.violations.is_empty() => Ok(problem),
        _ => Err(read.violations.into_vec()),
    }
}

/// Collects what is wrong. A method that found its whole subject missing answers `None`.
#[derive(Default)]
struct Reader {
    violations: Violations,
}

impl Reader {
    fn wrong(&mut self, pointer: &str, reason: &str, got: impl ToString, expected: &str) {
        self.violations.add(Violation {
            pointer: pointer.into(),
            reason: reason.into(),
            got: got.to_string(),
            expected: expected.into(),
            hint: "See the comments in signorini.proto.".into(),
        });
    }

    fn need<T>(&mut self, at: &str, value: Option<T>, expected: &str) -> Option<T> {
        if value.is_none() {
            self.wrong(at, "missing", "nothing", expected);
        }
        value
    }

    fn number(&mut self, at: &str, value: f64) -> f64 {
        if !value.is_finite() {
            self.wrong(at, "not_finite", value, "a finite number");
        }
        value
    }

    fn some_number(&mut self, at: &str, value: Option<f64>) -> Option<f64> {
        value.map(|value| self.number(at, value))
    }

    fn numbers(&mut self, at: &str, values: Vec<f64>) -> Vec<f64> {
        for (i, value) in values.iter().enumerate() {
            if !value.is_finite() {
                self.number(&format!("{at}/{i}"), *value);
            }
        }
        values
    }

    fn points(&mut self, at: &str, points: Vec<pb::Point>) -> Vec<[f64; 2]> {
        let mut read = |(i, pb::Point { x, y }): (usize, pb::Point)| {
            if !(x.is_finite() && y.is_finite()) {
                self.number(&format!("{at}/{i}/0"), x);
                self.number(&format!("{at}/{i}/1"), y);
            }
            [x, y]
        };
        points.into_iter().enumerate().map(&mut read).collect()
    }

    fn indices<const N: usize>(&mut self, at: &str, nodes: Vec<u32>) -> [u32; N] {
        let found = nodes.len();
        nodes.try_into().unwrap_or_else(|_| {
            self.wrong(
                at,
                "wrong_length",
                format!("{found} node numbers"),
                &format!("{N} node numbers"),
            );
            [0; N]
        })
    }

    /// The message's value of an enum; a number that the contract does not have is an error.
    fn choice<E: TryFrom<i32>>(&mut self, at: &str, value: i32) -> Option<E> {
        let known = E::try_from(value).ok();
        if known.is_none() {
            self.wrong(at, "unknown_value", value, "a value of the enum");
        }
        known
    }

    fn problem(&mut self, message: pb::Problem) -> Option<Problem> {
        let pb::Problem {
            title,
            analysis,
            mesh,
            materials,
            supports,
            loads,
            contacts,
            solver,
            steps,
            quadrature,
            units,
        } = message;
        let kind = analysis.and_then(|analysis| analysis.kind);
        let analysis = self.need(
            "/analysis",
            kind,
            "one of plane_strain, plane_stress, axisymmetric",
        );
        let analysis = analysis.map(|kind| self.analysis(kind));
        let mesh = self
            .need("/mesh", mesh, "a mesh")
            .and_then(|mesh| self.mesh(mesh));
        let materials = each(materials, "/materials", |at, material| {
            self.material(at, material)
        });
        let supports = each(supports, "/supports", |at, support| {
            self.support(at, support)
        });
        let loads = each(loads, "/loads", |at, load| self.load(at, load));
        let contacts = each(contacts, "/contacts", |at, contact| {
            self.contact(at, contact)
        });
        let steps = each(steps, "/steps", |at, step| self.step(at, step));
        let solver = solver.map_or(Some(SolverControls::default()), |controls| {
            self.controls(controls)
        });
        let units = units.map(|units| Units {
            length: units.length,
            force: units.force,
            stress: units.stress,
        });
        Some(Problem {
            title,
            units,
            analysis: analysis?,
            mesh: mesh?,
            materials: materials?,
            supports: supports?,
            loads: loads?,
            contacts: contacts?,
            steps: steps?,
            quadrature: quadrature.unwrap_or(3),
            solver: solver?,
        })
    }

    fn analysis(&mut self, kind: pb::analysis::Kind) -> Analysis {
        match kind {
            pb::analysis::Kind::PlaneStrain(_) => Analysis::PlaneStrain {},
            pb::analysis::Kind::PlaneStress(sheet) => Analysis::PlaneStress {
                thickness: self.number("/analysis/thickness", sheet.thickness),
            },
            pb::analysis::Kind::Axisymmetric(_) => Analysis::Axisymmetric {},
        }
    }
}

/// Reads every entry of a list, also after one that cannot be read.
fn each<M, T>(
    messages: Vec<M>,
    at: &str,
    mut read: impl FnMut(&str, M) -> Option<T>,
) -> Option<Vec<T>> {
    let read: Vec<Option<T>> = messages
        .into_iter()
        .enumerate()
        .map(|(i, message)| read(&format!("{at}/{i}"), message))
        .collect();
    read.into_iter().collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{cli::examples, convert::problem_to_pb, fake};

    #[test]
    fn every_example_survives_the_way_through_grpc() {
        for (name, text) in examples::ALL {
            let problem: Problem = files::parse(text).unwrap();
            assert_eq!(
                problem_from_pb(problem_to_pb(&problem)).unwrap(),
                problem,
                "{name}"
            );
        }
    }

    #[test]
    fn every_kind_of_input_survives_the_way_through_grpc() {
        let text = r#"{
            "units": { "length": "mm", "stress": "MPa" },
            "analysis": { "kind": "plane_stress", "thickness": 0.1 },
            "mesh": {
                "inline": {
                    "nodes": [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5]],
                    "elements": [[0, 1, 2, 3, 4, 5, 6, 7]],
                    "boundaries": { "top": [[3, 2, 6]], "bottom": [[1, 0, 4]] }
                },
                "refine": 2, "boundaries": { "part": { "side": "top", "x": [0, 0.5], "y": [1, 1] } }
            },
            "materials": [{ "youngs_modulus": 1, "poissons_ratio": 0.1, "name": "steel" }],
            "supports": [{ "boundary": "bottom", "uy": [0, -0.1] }],
            "loads": [{ "boundary": "top", "pressure": [1, 2] }],
            "contacts": [{
                "boundary": "part", "indentation": 0.1, "tangential_displacement": -0.01,
                "obstacle": { "kind": "parabola", "radius": 2, "center": 0.5, "from": 0, "to": 1, "along": "arc_length" },
                "friction": { "coefficient": 0.3, "nonlocal_radius": 0, "elastic_slip": 1e-4, "kernel": "parabola",
                              "normalization": "peak_one", "transition": "tanh" }
            }],
            "solver": { "tolerance": 1e-8, "max_iterations": 7 }
        }"#;
        let problem: Problem = serde_json::from_str(text).unwrap();
        assert_eq!(problem_from_pb(problem_to_pb(&problem)).unwrap(), problem);
    }

    fn survives(problem: &Problem) {
        let back = problem_from_pb(problem_to_pb(problem)).unwrap();
        assert_eq!(&back, problem);
    }

    #[test]
    fn every_kind_of_load_support_material_and_step_survives_the_way_through_grpc() {
        let text = r#"{
            "analysis": { "kind": "axisymmetric" }, "quadrature": 2,
            "mesh": { "grid": { "x": [0, 1, 2], "y": [0, 1] }, "refine": { "tolerance": 0.01 },
                      "groups": { "core": { "x": [0, 1] }, "low": { "y": [0, 0.5] } } },
            "materials": [
                { "orthotropic": { "e1": 1, "e2": 2, "nu12": 0.1, "g12": 0.5, "angle": 30, "e3": 3, "nu13": 0.2, "nu23": 0.3 }, "group": "core" },
                { "youngs_modulus": 1, "poissons_ratio": 0.1 }
            ],
            "supports": [{ "boundary": "bottom", "un": 0, "ut": [0, -0.1] }],
            "loads": [
                { "boundary": "top", "traction": [1, [2, 3]] }, { "boundary": "top", "normal": 1, "tangential": [2, 3] },
                { "boundary": "top", "nodal": [[1, 2], [3, 4]] }, { "body_force": [0, -9.81] }
            ],
            "contacts": [{
                "boundary": "top", "normal": "obstacle", "condition": "none", "obstacle": { "kind": "flat" },
                "friction": { "elastic_slip": 1e-4, "bound": { "s": [0, 1], "bound": [2, 3] }, "history": "incremental",
                              "points": "nodal", "measure": "surface" }
            }, {
                "boundary": "left", "condition": "bonded", "obstacle": { "kind": "flat" },
                "friction": { "elastic_slip": 1e-4, "bound": 7, "cohesion": 1, "shear_cap": 2 }
            }],
            "steps": [{ "name": "indent" },
                      { "indentation": 0.5, "tangential_displacement": 1, "loads": 2, "supports": 3, "increments": 4, "spacing": "contact_width" }],
            "solver": { "algorithm": "thesis", "check_uniqueness": true, "check_increments": true,
                        "thesis": { "contact_guess": { "top": [0, 1] }, "friction_force": 2, "pressure": "extrapolated",
                                    "local_points": 0, "relaxation": 0.5, "signed": true } }
        }"#;
        survives(&serde_json::from_str(text).unwrap());
    }

    #[test]
    fn every_obstacle_survives_the_way_through_grpc() {
        for kind in [
            r#""kind": "flat", "from": 1"#,
            r#""kind": "circle", "radius": 1, "to": 2"#,
            r#""kind": "wedge", "angle": 10, "center": 1"#,
            r#""kind": "cone", "angle": 10"#,
            r#""kind": "tilted", "slope": 0.1, "center": 3"#,
            r#""kind": "power", "coefficient": 1, "exponent": 4, "center": 2"#,
            r#""kind": "rounded_flat", "half_width": 1, "radius": 2, "center": 3"#,
            r#""kind": "table", "x": [0, 1], "gap": [2, 3]"#,
            r#""kind": "polyline", "points": [[0, 1], [2, 3]]"#,
            r#""kind": "line", "point": [0, 1], "angle": 30, "along": "arc_length""#,
        ] {
            let mut problem = fake::problem();
            problem.contacts[0].obstacle = serde_json::from_str(&format!("{{{kind}}}")).unwrap();
            survives(&problem);
        }
    }

    #[test]
    fn what_a_message_leaves_out_has_the_defaults_of_the_json() {
        let json = r#"{ "analysis": { "kind": "plane_strain" }, "mesh": { "grid": { "x": [0, 1], "y": [0, 1] } }, "materials": [{}],
                        "steps": [{}], "contacts": [{ "boundary": "top", "obstacle": { "kind": "flat" }, "friction": { "elastic_slip": 1 } }],
                        "solver": { "thesis": {} } }"#;
        let grid = pb::Grid {
            x: vec![0.0, 1.0],
            y: vec![0.0, 1.0],
            ..Default::default()
        };
        let message = pb::Problem {
            analysis: Some(pb::Analysis {
                kind: Some(pb::analysis::Kind::PlaneStrain(pb::PlaneStrain {})),
            }),
            mesh: Some(pb::Mesh {
                source: Some(pb::mesh::Source::Grid(grid)),
                ..Default::default()
            }),
            materials: vec![pb::Material::default()],
            steps: vec![pb::Step::default()],
            contacts: vec![pb::Contact {
                boundary: "top".into(),
                obstacle: Some(pb::Obstacle {
                    kind: Some(pb::obstacle::Kind::Flat(pb::Flat {})),
                    ..Default::default()
                }),
                friction: Some(pb::Friction {
                    elastic_slip: 1.0,
                    ..Default::default()
                }),
                ..Default::default()
            }],
            solver: Some(pb::SolverControls {
                thesis: Some(pb::ThesisOptions::default()),
                ..Default::default()
            }),
            ..Default::default()
        };
        let problem: Problem = serde_json::from_str(json).unwrap();
        assert_eq!(problem_from_pb(message).unwrap(), problem);
    }

    #[test]
    fn a_hundred_violations_are_enough() {
        let message = pb::Problem {
            supports: vec![
                pb::Support {
                    ux: Some(pb::BoundaryValue {
                        start: f64::NAN,
                        end: None
                    }),
                    ..Default::default()
                };
                1000
            ],
            ..Default::default()
        };
        assert_eq!(problem_from_pb(message).unwrap_err().len(), 100);
    }

    #[test]
    fn everything_that_a_message_leaves_out_is_named_at_once() {
        let message = pb::Problem {
            loads: vec![pb::Load {
                traction: Some(pb::Traction::default()),
                ..Default::default()
            }],
            contacts: vec![pb::Contact {
                obstacle: Some(pb::Obstacle::default()),
                ..Default::default()
            }],
            ..Default::default()
        };
        let pointers: Vec<_> = problem_from_pb(message)
            .unwrap_err()
            .into_iter()
            .map(|v| v.pointer)
            .collect();
        assert_eq!(
            pointers,
            [
                "/analysis",
                "/mesh",
                "/loads/0/traction/0",
                "/loads/0/traction/1",
                "/contacts/0/obstacle/kind"
            ]
        );
    }

    #[test]
    fn numbers_that_json_cannot_say_are_refused() {
        let mut message = problem_to_pb(&fake::problem());
        message.materials[0].youngs_modulus = Some(f64::NAN);
        message.contacts[0].friction.as_mut().unwrap().kernel = 99;
        let found = problem_from_pb(message).unwrap_err();
        let found: Vec<_> = found
            .iter()
            .map(|v| (v.pointer.as_str(), v.reason.as_str()))
            .collect();
        assert_eq!(
            found,
            [
                ("/materials/0/youngs_modulus", "not_finite"),
                ("/contacts/0/friction/kernel", "unknown_value")
            ]
        );
    }
}
