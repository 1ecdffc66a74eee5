//! A problem in words, for people: what body, what presses on it, how it is held, what else acts.

use std::fmt::Write;

use solver::problem::{
    Analysis, Condition, Contact, Elasticity, Friction, History, Load, Obstacle, Problem, Refine,
    Support,
};

use super::numbers::number;

/// The largest number of contacts, supports or loads that are told one by one.
const MOST: usize = 3;

/// The problem in a few sentences.
pub fn description(problem: &Problem) -> String {
    let unit = |text: Option<&String>| text.map_or(String::new(), |unit| format!(" {unit}"));
    let units = problem.units.as_ref();
    let words = Words {
        length: unit(units.and_then(|units| units.length.as_ref())),
        force: unit(units.and_then(|units| units.force.as_ref())),
        stress: unit(units.and_then(|units| units.stress.as_ref())),
    };
    let mut sentences = vec![words.body(problem)];
    let contacts = problem.contacts.iter().take(MOST);
    sentences.extend(contacts.map(|contact| words.contact(contact)));
    if let more @ 1.. = problem.contacts.len().saturating_sub(MOST) {
        sentences.push(format!("There are {more} more contacts."));
    }
    sentences.extend(held(&problem.supports));
    sentences.extend(words.loads(&problem.loads));
    if problem.steps.len() > 1 {
        let names = problem
            .steps
            .iter()
            .take(4)
            .filter_map(|step| step.name.as_deref());
        let names: Vec<&str> = names.collect();
        let named = if names.is_empty() {
            String::new()
        } else {
            format!(": {}", names.join(", "))
        };
        sentences.push(format!(
            "It is loaded in {} steps{named}.",
            problem.steps.len()
        ));
    }
    if let Refine::Adaptive(goal) = &problem.mesh.refine {
        let percent = number(100.0 * goal.tolerance);
        sentences.push(format!(
            "The mesh is refined until errors are below {percent} %."
        ));
    }
    sentences.join(" ")
}

/// The units, each after a space, or nothing.
struct Words {
    length: String,
    force: String,
    stress: String,
}

impl Words {
    fn body(&self, problem: &Problem) -> String {
        let theory = match problem.analysis {
            Analysis::PlaneStrain {} => "plane strain".to_owned(),
            Analysis::PlaneStress { thickness } => {
                format!(
                    "plane stress, thickness {}{}",
                    number(thickness),
                    self.length
                )
            }
            Analysis::Axisymmetric {} => "axisymmetric".to_owned(),
        };
        let mut materials: Vec<String> = problem
            .materials
            .iter()
            .take(MOST)
            .map(|material| {
                let name = material
                    .name
                    .as_ref()
                    .map_or(String::new(), |name| format!("{name}: "));
                match &material.elasticity {
                    Elasticity::Isotropic {
                        youngs_modulus,
                        poissons_ratio,
                    } => format!(
                        "{name}E = {}{}, ν = {}",
                        number(*youngs_modulus),
                        self.stress,
                        number(*poissons_ratio)
                    ),
                    Elasticity::Orthotropic(_) => format!("{name}orthotropic"),
                }
            })
            .collect();
        if let more @ 1.. = problem.materials.len().saturating_sub(MOST) {
            materials.push(format!("{more} more materials"));
        }
        format!("An elastic body ({theory}; {}).", materials.join("; "))
    }

    fn contact(&self, contact: &Contact) -> String {
        let boundary = &contact.boundary;
        let friction = contact.friction.as_ref().map_or_else(
            || " without friction".to_owned(),
            |friction| self.friction(friction),
        );
        if let Some(against) = &contact.against {
            let gap = contact.gap.map_or(String::new(), |gap| {
                let told = [
                    ("an interference", gap.interference),
                    ("a clearance", gap.clearance),
                ];
                let mut told = told
                    .into_iter()
                    .filter_map(|(name, value)| Some((name, value?)));
                told.next().map_or(String::new(), |(name, value)| {
                    format!(", with {name} of {}{}", number(value), self.length)
                })
            });
            return format!(
                "Its boundary {boundary} faces the boundary {} of another body{gap},{friction}.",
                against.boundary
            );
        }
        let Some(obstacle) = &contact.obstacle else {
            return format!("On {boundary} acts friction{friction}.");
        };
        let (shape, span) = (self.shape(obstacle), self.span(obstacle));
        let mut told = match contact.condition {
            Condition::Unilateral => {
                format!("{shape}{span} is {} {boundary}", self.pressed(contact))
            }
            Condition::Bonded => format!(
                "{shape}{span} is bonded to {boundary}, {} it",
                self.pressed(contact)
            ),
            Condition::None => return format!("On {boundary} acts friction with a given bound."),
        };
        let slides = [
            contact
                .tangential_force
                .map(|force| format!("a force of {}{}", number(force), self.force)),
            (contact.tangential_displacement != 0.0)
                .then(|| format!("{}{}", number(contact.tangential_displacement), self.length)),
        ];
        if let Some(by) = slides.into_iter().flatten().next() {
            let _ = write!(told, ", dragged along it by {by}");
        }
        if let Some(tilt) = contact.tilt.filter(|tilt| *tilt != 0.0) {
            let _ = write!(told, ", tilted by {} rad", number(tilt));
        }
        if let Some(moment) = contact.moment {
            let _ = write!(told, ", under a moment of {}", number(moment));
        }
        format!("{told},{friction}.")
    }

    fn pressed(&self, contact: &Contact) -> String {
        match contact.normal_force {
            Some(force) => format!("pressed by a force of {}{} onto", number(force), self.force),
            None if contact.indentation == 0.0 => "touching".to_owned(),
            None => format!("pushed {}{} into", number(contact.indentation), self.length),
        }
    }

    fn shape(&self, obstacle: &Obstacle) -> String {
        let length = |value: f64| format!("{}{}", number(value), self.length);
        match obstacle {
            Obstacle::Flat { .. } => "A flat rigid obstacle".to_owned(),
            Obstacle::Circle { radius, .. } => {
                format!("A rigid circle of radius {}", length(*radius))
            }
            Obstacle::Parabola { radius, .. } => {
                format!("A rigid parabola of radius {}", length(*radius))
            }
            Obstacle::Wedge { angle, .. } => format!("A rigid wedge at {}°", number(*angle)),
            Obstacle::Cone { angle, .. } => format!("A rigid cone at {}°", number(*angle)),
            Obstacle::Tilted { slope, .. } => format!("A rigid plane of slope {}", number(*slope)),
            Obstacle::Power { exponent, .. } => {
                format!("A rigid profile of power {}", number(*exponent))
            }
            Obstacle::RoundedFlat {
                half_width, radius, ..
            } => format!(
                "A flat rigid punch of half width {} with roundings of radius {}",
                length(*half_width),
                length(*radius)
            ),
            Obstacle::Table { x, smoothing, .. } => {
                let measured = if smoothing.is_some() {
                    "measured"
                } else {
                    "rigid"
                };
                format!("A {measured} profile of {} points", x.len())
            }
            Obstacle::Polyline { points, .. } => {
                format!("A rigid curve through {} points", points.len())
            }
            Obstacle::Line { angle, .. } => format!("A rigid line at {}°", number(*angle)),
        }
    }

    /// Where the obstacle begins and ends.
    fn span(&self, obstacle: &Obstacle) -> String {
        let (from, to, along) = obstacle.span();
        let name = match along {
            solver::problem::Along::X => "x",
            solver::problem::Along::ArcLength => "s",
        };
        match (from, to) {
            (None, None) => String::new(),
            (Some(from), None) => format!(" from {name} = {}{}", number(from), self.length),
            (None, Some(to)) => format!(" up to {name} = {}{}", number(to), self.length),
            (Some(from), Some(to)) => {
                format!(
                    " from {name} = {} to {}{}",
                    number(from),
                    number(to),
                    self.length
                )
            }
        }
    }

    fn friction(&self, friction: &Friction) -> String {
        let mut told = match (friction.coefficient, &friction.bound) {
            (_, Some(_)) => " with friction of a given bound".to_owned(),
            (Some(mu), None) => format!(" with friction μ = {}", number(mu)),
            (None, None) => " with friction".to_owned(),
        };
        match friction.nonlocal_radius {
            Some(0.0) => told += " (local)",
            Some(rho) => {
                let _ = write!(told, " averaged over ρ = {}{}", number(rho), self.length);
            }
            None => {}
        }
        let _ = write!(
            told,
            ", elastic slip ε = {}{}",
            number(friction.elastic_slip),
            self.length
        );
        if friction.history == History::Incremental {
            told += ", by increments";
        }
        told
    }

    fn loads(&self, loads: &[Load]) -> Option<String> {
        let mut told: Vec<String> = loads
            .iter()
            .take(MOST)
            .map(|load| match load {
                Load::Pressure(boundary, _) => format!("a pressure on {boundary}"),
                Load::Traction(boundary, _) => format!("a traction on {boundary}"),
                Load::Normal(boundary, ..) => format!("a normal stress on {boundary}"),
                Load::Tangential(boundary, _) => format!("a tangential stress on {boundary}"),
                Load::Nodal(boundary, _) => format!("forces at the nodes of {boundary}"),
                Load::Force(nodes, _) => format!("a force on each node of {nodes}"),
                Load::BodyForce(_) => "a force per volume".to_owned(),
                Load::Gravity(_) => "gravity".to_owned(),
                Load::Rotation(rotation) => {
                    format!("a rotation at ω = {}", number(rotation.angular_velocity))
                }
                Load::Temperature(change, group) => {
                    let of = group
                        .as_ref()
                        .map_or(String::new(), |group| format!(" of {group}"));
                    format!("a change of temperature{of} by {}", number(*change))
                }
                Load::NodalTemperature(_) => "temperatures at the nodes".to_owned(),
            })
            .collect();
        if let more @ 1.. = loads.len().saturating_sub(MOST) {
            told.push(format!("{more} more loads"));
        }
        (!told.is_empty()).then(|| format!("On it act {}.", told.join(", ")))
    }
}

/// How the body is held.
fn held(supports: &[Support]) -> Option<String> {
    let mut told: Vec<String> = supports
        .iter()
        .take(MOST + 1)
        .map(|support| {
            let place = support
                .boundary
                .as_deref()
                .or(support.nodes.as_deref())
                .unwrap_or("a place");
            let directions = [
                ("x", support.ux),
                ("y", support.uy),
                ("its normal", support.un),
                ("its tangent", support.ut),
            ];
            let directions: Vec<&str> = directions
                .into_iter()
                .filter_map(|(name, value)| value.map(|_| name))
                .collect();
            match (directions.is_empty(), support.stiffness) {
                (true, _) => format!("by springs at {place}"),
                (false, None) => format!("at {place} along {}", directions.join(" and ")),
                (false, Some(_)) => format!(
                    "at {place} along {} and by springs",
                    directions.join(" and ")
                ),
            }
        })
        .collect();
    if let more @ 1.. = supports.len().saturating_sub(MOST + 1) {
        told.push(format!("at {more} more places"));
    }
    (!told.is_empty()).then(|| format!("It is held {}.", told.join(", ")))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_first_example_is_told_in_words() {
        let problem: Problem =
            serde_json::from_str(include_str!("../../../examples/rectangular_punch.json")).unwrap();
        assert_eq!(
            description(&problem),
            "An elastic body (plane strain; E = 1000, ν = 0.3). A flat rigid obstacle from x = 0 to 0.5 is pushed 0.25 into \
             top, with friction μ = 0.3 averaged over ρ = 0.01, elastic slip ε = 1e−4. It is held at left along x, at bottom \
             along x and y. The mesh is refined until errors are below 0.2 %."
        );
    }

    #[test]
    fn loads_units_and_other_bodies_are_told() {
        let problem: Problem = serde_json::from_value(serde_json::json!({
            "units": { "length": "mm", "force": "N", "stress": "MPa" },
            "analysis": { "kind": "plane_stress", "thickness": 2 },
            "mesh": { "grid": { "x": [0, 1], "y": [0, 1] } },
            "materials": [{ "name": "steel", "youngs_modulus": 210000, "poissons_ratio": 0.3 }],
            "loads": [{ "boundary": "right", "pressure": 1 }, { "gravity": [0, -9.81] }],
            "supports": [{ "boundary": "bottom", "stiffness": { "normal": 3 } }],
            "contacts": [
                { "boundary": "top", "obstacle": { "kind": "wedge", "angle": 10 }, "normal_force": 5, "tangential_force": -1 },
                { "boundary": "hub", "against": { "boundary": "shaft" }, "gap": { "interference": 0.02 },
                  "friction": { "coefficient": 0.2, "nonlocal_radius": 0, "elastic_slip": 0.001, "history": "incremental" } },
            ],
            "steps": [{ "name": "press" }, { "name": "drag" }],
        })).unwrap();
        assert_eq!(
            description(&problem),
            "An elastic body (plane stress, thickness 2 mm; steel: E = 210000 MPa, ν = 0.3). A rigid wedge at 10° is pressed by \
             a force of 5 N onto top, dragged along it by a force of −1 N, without friction. Its boundary hub faces the \
             boundary shaft of another body, with an interference of 0.02 mm, with friction μ = 0.2 (local), elastic slip ε = \
             0.001 mm, by increments. It is held by springs at bottom. On it act a pressure on right, gravity. It is loaded in \
             2 steps: press, drag."
        );
    }
}
