//! A problem from a typed message. What a message can say and JSON cannot (an absent
//! message, an enum number that nobody knows, a number that is not finite) is found here, all of
//! it, with the pointers that the JSON form would have.

use solver::{
    error::{Violation, escape},
    problem::{
        Algorithm, Along, Analysis, BoundaryPart, BoundaryValue, Contact, Friction, Grid, History,
        InlineMesh, Kernel, Load, Material, MeshInput, Normalization, Obstacle, Problem,
        SolverControls, Support, Transition,
    },
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
        let solver = solver.map_or(Some(SolverControls::default()), |controls| {
            self.controls(controls)
        });
        Some(Problem {
            title,
            analysis: analysis?,
            mesh: mesh?,
            materials: materials?,
            supports: supports?,
            loads: loads?,
            contacts: contacts?,
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

    fn mesh(&mut self, message: pb::Mesh) -> Option<MeshInput> {
        let pb::Mesh {
            source,
            refine,
            boundaries,
        } = message;
        let mut mesh = MeshInput {
            refine,
            ..MeshInput::default()
        };
        match self.need("/mesh", source, "one of grid, inline") {
            Some(pb::mesh::Source::Grid(grid)) => mesh.grid = Some(self.grid(grid)),
            Some(pb::mesh::Source::Inline(inline)) => mesh.inline = Some(self.inline(inline)),
            None => return None,
        }
        for (name, pb::BoundaryPart { side, x, y }) in boundaries {
            let mut range = |axis: &str, range: Option<pb::Range>| {
                let at = format!("/mesh/boundaries/{}/{axis}", escape(&name));
                range.map(|r| {
                    [
                        self.number(&format!("{at}/0"), r.start),
                        self.number(&format!("{at}/1"), r.end),
                    ]
                })
            };
            let part = BoundaryPart {
                side,
                x: range("x", x),
                y: range("y", y),
            };
            mesh.boundaries.insert(name, part);
        }
        Some(mesh)
    }

    fn grid(&mut self, pb::Grid { x, y, top, bottom }: pb::Grid) -> Grid {
        let mut edge = |at: &str, points: Vec<pb::Point>| {
            (!points.is_empty()).then(|| self.points(at, points))
        };
        let (top, bottom) = (
            edge("/mesh/grid/top", top),
            edge("/mesh/grid/bottom", bottom),
        );
        Grid {
            x: self.numbers("/mesh/grid/x", x),
            y: self.numbers("/mesh/grid/y", y),
            top,
            bottom,
        }
    }

    fn inline(
        &mut self,
        pb::InlineMesh {
            nodes,
            elements,
            boundaries,
        }: pb::InlineMesh,
    ) -> InlineMesh {
        let nodes = self.points("/mesh/inline/nodes", nodes);
        let elements = elements
            .into_iter()
            .enumerate()
            .map(|(i, element)| self.indices(&format!("/mesh/inline/elements/{i}"), element.nodes))
            .collect();
        let boundaries = boundaries
            .into_iter()
            .map(|(name, list)| {
                let at = format!("/mesh/inline/boundaries/{}", escape(&name));
                let edges = list.edges.into_iter().enumerate();
                let edges = edges
                    .map(|(i, edge)| self.indices(&format!("{at}/{i}"), edge.nodes))
                    .collect();
                (name, edges)
            })
            .collect();
        InlineMesh {
            nodes,
            elements,
            boundaries,
        }
    }

    fn material(&mut self, at: &str, message: pb::Material) -> Option<Material> {
        Some(Material {
            youngs_modulus: self.number(&format!("{at}/youngs_modulus"), message.youngs_modulus),
            poissons_ratio: self.number(&format!("{at}/poissons_ratio"), message.poissons_ratio),
            name: message.name,
        })
    }

    fn value(
        &mut self,
        at: &str,
        pb::BoundaryValue { start, end }: pb::BoundaryValue,
    ) -> BoundaryValue {
        match end {
            None => BoundaryValue::Constant(self.number(at, start)),
            Some(end) => {
                let start = self.number(&format!("{at}/0"), start);
                BoundaryValue::Linear([start, self.number(&format!("{at}/1"), end)])
            }
        }
    }

    fn support(
        &mut self,
        at: &str,
        pb::Support { boundary, ux, uy }: pb::Support,
    ) -> Option<Support> {
        let ux = ux.map(|value| self.value(&format!("{at}/ux"), value));
        let uy = uy.map(|value| self.value(&format!("{at}/uy"), value));
        Some(Support { boundary, ux, uy })
    }

    fn load(&mut self, at: &str, pb::Load { boundary, pressure }: pb::Load) -> Option<Load> {
        let at = format!("{at}/pressure");
        let pressure = self.need(&at, pressure, "a pressure")?;
        Some(Load {
            boundary,
            pressure: self.value(&at, pressure),
        })
    }

    fn contact(&mut self, at: &str, message: pb::Contact) -> Option<Contact> {
        let pb::Contact {
            boundary,
            obstacle,
            indentation,
            tangential_displacement,
            friction,
        } = message;
        let obstacle = self.need(&format!("{at}/obstacle"), obstacle, "an obstacle");
        let obstacle =
            obstacle.and_then(|obstacle| self.obstacle(&format!("{at}/obstacle"), obstacle));
        let friction = match friction {
            Some(friction) => Some(self.friction(&format!("{at}/friction"), friction)?),
            None => None,
        };
        Some(Contact {
            boundary,
            obstacle: obstacle?,
            indentation: self.number(&format!("{at}/indentation"), indentation),
            tangential_displacement: self.number(
                &format!("{at}/tangential_displacement"),
                tangential_displacement,
            ),
            friction,
        })
    }

    fn obstacle(&mut self, at: &str, message: pb::Obstacle) -> Option<Obstacle> {
        use pb::obstacle::Kind;
        let from = self.some_number(&format!("{at}/from"), message.from);
        let to = self.some_number(&format!("{at}/to"), message.to);
        let along = match self.choice(&format!("{at}/along"), message.along)? {
            pb::Along::Unspecified | pb::Along::X => Along::X,
            pb::Along::ArcLength => Along::ArcLength,
        };
        let mut pair = |radius, center| {
            (
                self.number(&format!("{at}/radius"), radius),
                self.number(&format!("{at}/center"), center),
            )
        };
        match message.kind {
            Some(Kind::Flat(_)) => Some(Obstacle::Flat { from, to, along }),
            Some(Kind::Circle(pb::Circle { radius, center })) => {
                let (radius, center) = pair(radius, center);
                Some(Obstacle::Circle {
                    radius,
                    center,
                    from,
                    to,
                    along,
                })
            }
            Some(Kind::Parabola(pb::Parabola { radius, center })) => {
                let (radius, center) = pair(radius, center);
                Some(Obstacle::Parabola {
                    radius,
                    center,
                    from,
                    to,
                    along,
                })
            }
            None => self.need(&format!("{at}/kind"), None, "one of flat, circle, parabola"),
        }
    }

    fn friction(&mut self, at: &str, message: pb::Friction) -> Option<Friction> {
        let kernel = match self.choice(&format!("{at}/kernel"), message.kernel)? {
            pb::Kernel::Unspecified | pb::Kernel::Bump => Kernel::Bump,
            pb::Kernel::Parabola => Kernel::Parabola,
        };
        let normalization =
            match self.choice(&format!("{at}/normalization"), message.normalization)? {
                pb::Normalization::Unspecified | pb::Normalization::UnitIntegral => {
                    Normalization::UnitIntegral
                }
                pb::Normalization::PeakOne => Normalization::PeakOne,
            };
        let transition = match self.choice(&format!("{at}/transition"), message.transition)? {
            pb::Transition::Unspecified | pb::Transition::Linear => Transition::Linear,
            pb::Transition::Tanh => Transition::Tanh,
        };
        let history = match self.choice(&format!("{at}/history"), message.history)? {
            pb::History::Unspecified | pb::History::Total => History::Total,
        };
        Some(Friction {
            coefficient: self.number(&format!("{at}/coefficient"), message.coefficient),
            nonlocal_radius: self.number(&format!("{at}/nonlocal_radius"), message.nonlocal_radius),
            elastic_slip: self.number(&format!("{at}/elastic_slip"), message.elastic_slip),
            kernel,
            normalization,
            transition,
            history,
        })
    }

    fn controls(&mut self, message: pb::SolverControls) -> Option<SolverControls> {
        let defaults = SolverControls::default();
        let algorithm = match self.choice("/solver/algorithm", message.algorithm)? {
            pb::Algorithm::Unspecified | pb::Algorithm::Auto => Algorithm::Auto,
        };
        let tolerance = self
            .some_number("/solver/tolerance", message.tolerance)
            .unwrap_or(defaults.tolerance);
        let max_iterations = message.max_iterations.unwrap_or(defaults.max_iterations);
        Some(SolverControls {
            algorithm,
            tolerance,
            max_iterations,
        })
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
            let problem: Problem = solver::parse(text).unwrap();
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
            loads: vec![pb::Load::default()],
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
                "/loads/0/pressure",
                "/contacts/0/obstacle/kind"
            ]
        );
    }

    #[test]
    fn numbers_that_json_cannot_say_are_refused() {
        let mut message = problem_to_pb(&fake::problem());
        message.materials[0].youngs_modulus = f64::NAN;
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
