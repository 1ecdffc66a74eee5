//! Prescribed tractions and forces: each in exactly one form.

use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema, json_schema};
use serde::{Deserialize, Serialize};

use super::support::BoundaryValue;
use crate::error::{Reason, Violation, either};

/// A load in exactly one form: on a boundary `pressure`, or `traction`, or `normal` and `tangential`
/// (or one of them), or `nodal`; on a set of nodes `force`; on the whole body `body_force`, `gravity`, `rotation` or
/// `nodal_temperature`; on the whole body or a group of elements `temperature`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "LoadFields", into = "LoadFields")]
#[schemars(extend("oneOf" = forms()))]
pub enum Load {
    /// A stress against the outward normal of a boundary: positive pushes into the body.
    Pressure(String, BoundaryValue),
    /// A stress along x and along y on a boundary.
    Traction(String, [BoundaryValue; 2]),
    /// A stress along the outward normal of a boundary, positive pulls; and, if given, a stress along t, the outward
    /// normal turned clockwise.
    Normal(String, BoundaryValue, Option<BoundaryValue>),
    /// A stress along t on a boundary.
    Tangential(String, BoundaryValue),
    /// Forces on the nodes of a boundary (corner, midside, corner, …) from its start, before it is refined; in
    /// axisymmetry forces on the whole ring.
    Nodal(String, Vec<[f64; 2]>),
    /// A force on each node of a set, before the mesh is refined; in axisymmetry the force on the whole ring.
    Force(String, [f64; 2]),
    /// A force per volume on the whole body.
    BodyForce([f64; 2]),
    /// An acceleration along x and y: the force per volume is the density of the material times it.
    Gravity([f64; 2]),
    /// The centrifugal force of a body that rotates.
    Rotation(Rotation),
    /// A change of temperature of a group of elements, or of the whole body.
    Temperature(f64, Option<String>),
    /// The changes of temperature that the mesh has at its nodes, times a factor.
    NodalTemperature(f64),
}

/// A rotation at constant speed, seen from the rotating body: the force per volume is density · ω² · (distance from the
/// axis), away from the axis. The axis is perpendicular to the plane, or that of a body of revolution. In load steps the
/// factor of `loads` multiplies the force, and so ω².
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    /// Angular velocity ω (radians per time), of either sign.
    pub angular_velocity: f64,
    /// A point `[x, y]` of the axis; absent: the origin. A body of revolution rotates about its own axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<[f64; 2]>,
}

impl Load {
    /// The boundary that the load acts on, if any.
    pub fn boundary(&self) -> Option<&str> {
        match self {
            Load::Pressure(boundary, _)
            | Load::Traction(boundary, _)
            | Load::Normal(boundary, _, _)
            | Load::Tangential(boundary, _)
            | Load::Nodal(boundary, _) => Some(boundary),
            Load::Force(..)
            | Load::BodyForce(_)
            | Load::Gravity(_)
            | Load::Rotation(_)
            | Load::Temperature(..)
            | Load::NodalTemperature(_) => None,
        }
    }
}

/// Where a load acts.
enum Place {
    /// On what the field names, which is required.
    On(&'static str),
    /// On what the field names, or on the whole body without it.
    Within(&'static str),
    WholeBody,
}

/// The allowed forms as JSON Schema: each requires its own fields and excludes the fields of the others.
fn forms() -> [Schema; 10] {
    const FORMS: [(Place, &[&str]); 10] = [
        (Place::On("boundary"), &["pressure"]),
        (Place::On("boundary"), &["traction"]),
        (Place::On("boundary"), &["normal", "tangential"]),
        (Place::On("boundary"), &["nodal"]),
        (Place::On("nodes"), &["force"]),
        (Place::WholeBody, &["body_force"]),
        (Place::WholeBody, &["gravity"]),
        (Place::WholeBody, &["rotation"]),
        (Place::Within("group"), &["temperature"]),
        (Place::WholeBody, &["nodal_temperature"]),
    ];
    FORMS.map(|(place, values)| {
        let (place, required): (Option<&str>, &[&str]) = match &place {
            Place::On(name) => (Some(name), std::slice::from_ref(name)),
            Place::Within(name) => (Some(name), &[]),
            Place::WholeBody => (None, &[]),
        };
        let own = |name: &&str| place == Some(*name) || values.contains(name);
        let names = FORMS.iter().flat_map(|(_, values)| *values).copied();
        let excluded: BTreeMap<&str, bool> = ["boundary", "nodes", "group"]
            .into_iter()
            .chain(names)
            .filter(|name| !own(name))
            .map(|name| (name, false))
            .collect();
        match values {
            [only] => {
                let required = [required, &[only]].concat();
                json_schema!({"required": required, "properties": excluded})
            }
            several => {
                let one: Vec<Schema> = several
                    .iter()
                    .map(|name| json_schema!({"required": [name]}))
                    .collect();
                json_schema!({"required": required, "anyOf": one, "properties": excluded})
            }
        }
    })
}

/// The fields of a load as it is written; [`Load`] checks which of them may be combined.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LoadFields {
    /// Name of the boundary; absent for `force` and for loads on the whole body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boundary: Option<String>,
    /// Name of a set of nodes, for `force`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodes: Option<String>,
    /// Stress against the outward normal: positive pushes into the body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure: Option<BoundaryValue>,
    /// Stress along x and along y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub traction: Option<[BoundaryValue; 2]>,
    /// Stress along the outward normal: positive pulls.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<BoundaryValue>,
    /// Stress along t, the outward normal turned clockwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tangential: Option<BoundaryValue>,
    /// Forces `[fx, fy]` on the boundary's nodes (corner, midside, corner, …) from its start, before it is refined; in
    /// axisymmetry forces on the whole ring.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodal: Option<Vec<[f64; 2]>>,
    /// Force `[fx, fy]` on each node of the set, before the mesh is refined: forces on all nodes of a side become a
    /// traction on it; in axisymmetry the force on the whole ring.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force: Option<[f64; 2]>,
    /// Force per volume along x and y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body_force: Option<[f64; 2]>,
    /// Acceleration `[gx, gy]` along x and y: the force per volume is the `density` of the material times it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity: Option<[f64; 2]>,
    /// The centrifugal force of a body that rotates, by the `density` of its materials.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<Rotation>,
    /// Name of a group of elements, for `temperature`; absent: the whole body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// Change of temperature: the strain is the `expansion` of the material times it. Several add up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<f64>,
    /// Factor of the changes of temperature that the mesh has at its nodes (`temperatures` of an inline mesh, *TEMPERATURE
    /// of a deck).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodal_temperature: Option<f64>,
}

impl TryFrom<LoadFields> for Load {
    type Error = Violation;

    fn try_from(fields: LoadFields) -> Result<Load, Violation> {
        let given = [
            ("pressure", fields.pressure.is_some()),
            ("traction", fields.traction.is_some()),
            ("normal", fields.normal.is_some()),
            ("tangential", fields.tangential.is_some()),
            ("nodal", fields.nodal.is_some()),
            ("force", fields.force.is_some()),
            ("body_force", fields.body_force.is_some()),
            ("gravity", fields.gravity.is_some()),
            ("rotation", fields.rotation.is_some()),
            ("temperature", fields.temperature.is_some()),
            ("nodal_temperature", fields.nodal_temperature.is_some()),
        ];
        let names = given.iter().filter(|(_, given)| *given);
        let names: Vec<&str> = names.map(|(name, _)| *name).collect();
        let place = Named {
            boundary: fields.boundary.clone(),
            nodes: fields.nodes.clone(),
            group: fields.group.clone(),
        };
        let one = matches!(names[..], [_] | ["normal", "tangential"]);
        #[rustfmt::skip] // a form in a row
        let load = match fields {
            _ if !one => None,
            LoadFields { pressure: Some(p), .. } => Some(Load::Pressure(place.boundary()?, p)),
            LoadFields { traction: Some(t), .. } => Some(Load::Traction(place.boundary()?, t)),
            LoadFields { normal: Some(n), tangential: t, .. } => Some(Load::Normal(place.boundary()?, n, t)),
            LoadFields { tangential: Some(t), .. } => Some(Load::Tangential(place.boundary()?, t)),
            LoadFields { nodal: Some(f), .. } => Some(Load::Nodal(place.boundary()?, f)),
            LoadFields { force: Some(f), .. } => Some(Load::Force(place.nodes()?, f)),
            LoadFields { body_force: Some(f), .. } => place.none().map(|()| Some(Load::BodyForce(f)))?,
            LoadFields { gravity: Some(g), .. } => place.none().map(|()| Some(Load::Gravity(g)))?,
            LoadFields { rotation: Some(r), .. } => place.none().map(|()| Some(Load::Rotation(r)))?,
            LoadFields { temperature: Some(t), .. } => Some(Load::Temperature(t, place.group()?)),
            LoadFields { nodal_temperature: Some(t), .. } => place.none().map(|()| Some(Load::NodalTemperature(t)))?,
            _ => None,
        };
        load.ok_or_else(|| {
            Violation::new(
                "",
                Reason::WrongCount,
                either(&given),
                "exactly one of `pressure`, `traction`, `normal` and `tangential`, `nodal`, `force`, `body_force`, `gravity`, `rotation`, `temperature`, `nodal_temperature`",
                "Give each of them a load of its own.",
            )
        })
    }
}

/// The places that a load names.
struct Named {
    boundary: Option<String>,
    nodes: Option<String>,
    group: Option<String>,
}

impl Named {
    /// The boundary, and nothing else.
    fn boundary(&self) -> Result<String, Violation> {
        match self {
            Named {
                boundary: Some(boundary),
                nodes: None,
                group: None,
            } => Ok(boundary.clone()),
            Named { nodes: Some(_), .. } => Err(not_used(
                "nodes",
                "a set of nodes for a load other than `force`",
                "the name of a boundary",
            )),
            Named { group: Some(_), .. } => Err(not_used(
                "group",
                "a group of elements for a load other than `temperature`",
                "the name of a boundary",
            )),
            _ => Err(Violation::new(
                "/boundary",
                Reason::Missing,
                "nothing",
                "the name of a boundary",
                PLACES,
            )),
        }
    }

    /// The set of nodes, and nothing else.
    fn nodes(&self) -> Result<String, Violation> {
        match self {
            Named {
                boundary: None,
                nodes: Some(nodes),
                group: None,
            } => Ok(nodes.clone()),
            _ => Err(Violation::new(
                "/nodes",
                Reason::Missing,
                "no set of nodes, or another place in addition",
                "the name of a set of nodes, and no other place",
                "A `force` acts on each node of a set; on a boundary give `nodal` forces or a traction.",
            )),
        }
    }

    /// The group of elements, if there is one, and nothing else.
    fn group(&self) -> Result<Option<String>, Violation> {
        let expected = "a `group` of elements, or no place: then the whole body is warmed";
        match self {
            Named {
                boundary: None,
                nodes: None,
                group,
            } => Ok(group.clone()),
            Named {
                boundary: Some(_), ..
            } => Err(not_used(
                "boundary",
                "a boundary for a temperature",
                expected,
            )),
            _ => Err(not_used(
                "nodes",
                "a set of nodes for a temperature",
                expected,
            )),
        }
    }

    /// Checks that the load names no place.
    fn none(&self) -> Result<(), Violation> {
        let named = [
            ("boundary", &self.boundary),
            ("nodes", &self.nodes),
            ("group", &self.group),
        ];
        match named.iter().find(|(_, name)| name.is_some()) {
            None => Ok(()),
            Some((field, _)) => Err(not_used(
                field,
                "a place for a load on the whole body",
                "no place: `body_force`, `gravity`, `rotation` and `nodal_temperature` act on the whole body",
            )),
        }
    }
}

const PLACES: &str = "Stresses act on a boundary, a `force` on `nodes`, a `temperature` on a `group` of elements or on the whole body, the other loads on the whole body.";

fn not_used(field: &str, got: &str, expected: &str) -> Violation {
    Violation::new(format!("/{field}"), Reason::NotUsed, got, expected, PLACES)
}

impl From<Load> for LoadFields {
    fn from(load: Load) -> LoadFields {
        let empty = LoadFields::default();
        let on = |boundary: String| LoadFields {
            boundary: Some(boundary),
            ..LoadFields::default()
        };
        match load {
            Load::Pressure(boundary, pressure) => LoadFields {
                pressure: Some(pressure),
                ..on(boundary)
            },
            Load::Traction(boundary, traction) => LoadFields {
                traction: Some(traction),
                ..on(boundary)
            },
            Load::Normal(boundary, normal, tangential) => LoadFields {
                normal: Some(normal),
                tangential,
                ..on(boundary)
            },
            Load::Tangential(boundary, tangential) => LoadFields {
                tangential: Some(tangential),
                ..on(boundary)
            },
            Load::Nodal(boundary, nodal) => LoadFields {
                nodal: Some(nodal),
                ..on(boundary)
            },
            Load::Force(nodes, force) => LoadFields {
                nodes: Some(nodes),
                force: Some(force),
                ..empty
            },
            Load::BodyForce(body_force) => LoadFields {
                body_force: Some(body_force),
                ..empty
            },
            Load::Gravity(gravity) => LoadFields {
                gravity: Some(gravity),
                ..empty
            },
            Load::Rotation(rotation) => LoadFields {
                rotation: Some(rotation),
                ..empty
            },
            Load::Temperature(temperature, group) => LoadFields {
                group,
                temperature: Some(temperature),
                ..empty
            },
            Load::NodalTemperature(factor) => LoadFields {
                nodal_temperature: Some(factor),
                ..empty
            },
        }
    }
}
