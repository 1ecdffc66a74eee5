//! Prescribed tractions and forces: each in exactly one form.

use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema, json_schema};
use serde::{Deserialize, Serialize};

use super::support::BoundaryValue;
use crate::error::{Reason, Violation, either};

/// A load in exactly one form: on a boundary `pressure`, or `traction`, or `normal` and `tangential`
/// (or one of them), or `nodal`; on a set of nodes `force`; on the whole body `body_force`, `gravity` or `rotation`.
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
            Load::Force(..) | Load::BodyForce(_) | Load::Gravity(_) | Load::Rotation(_) => None,
        }
    }
}

/// The allowed forms as JSON Schema: each requires its own fields and excludes the fields of the others.
fn forms() -> [Schema; 8] {
    const FORMS: [(Option<&str>, &[&str]); 8] = [
        (Some("boundary"), &["pressure"]),
        (Some("boundary"), &["traction"]),
        (Some("boundary"), &["normal", "tangential"]),
        (Some("boundary"), &["nodal"]),
        (Some("nodes"), &["force"]),
        (None, &["body_force"]),
        (None, &["gravity"]),
        (None, &["rotation"]),
    ];
    FORMS.map(|(place, values)| {
        let own = |name: &&str| place == Some(*name) || values.contains(name);
        let names = FORMS.iter().flat_map(|(_, values)| *values).copied();
        let excluded: BTreeMap<&str, bool> = ["boundary", "nodes"]
            .into_iter()
            .chain(names)
            .filter(|name| !own(name))
            .map(|name| (name, false))
            .collect();
        let place: Vec<&str> = place.into_iter().collect();
        match values {
            [only] => {
                let required = [&place[..], &[only]].concat();
                json_schema!({"required": required, "properties": excluded})
            }
            several => {
                let one: Vec<Schema> = several
                    .iter()
                    .map(|name| json_schema!({"required": [name]}))
                    .collect();
                json_schema!({"required": place, "anyOf": one, "properties": excluded})
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
}

impl TryFrom<LoadFields> for Load {
    type Error = Violation;

    #[rustfmt::skip] // a form in a row
    fn try_from(fields: LoadFields) -> Result<Load, Violation> {
        let LoadFields { boundary, nodes, pressure, traction, normal, tangential, nodal, force, body_force, gravity, rotation } = fields;
        let given = [
            ("pressure", pressure.is_some()),
            ("traction", traction.is_some()),
            ("normal", normal.is_some()),
            ("tangential", tangential.is_some()),
            ("nodal", nodal.is_some()),
            ("force", force.is_some()),
            ("body_force", body_force.is_some()),
            ("gravity", gravity.is_some()),
            ("rotation", rotation.is_some()),
        ];
        let on = || on_boundary(&boundary, &nodes);
        let whole = || nowhere(&boundary, &nodes);
        match (pressure, traction, normal, tangential, nodal, force, body_force, gravity, rotation) {
            (Some(p), None,    None,    None,    None,    None,    None,    None,    None)    => Ok(Load::Pressure(on()?, p)),
            (None,    Some(t), None,    None,    None,    None,    None,    None,    None)    => Ok(Load::Traction(on()?, t)),
            (None,    None,    Some(n), t,       None,    None,    None,    None,    None)    => Ok(Load::Normal(on()?, n, t)),
            (None,    None,    None,    Some(t), None,    None,    None,    None,    None)    => Ok(Load::Tangential(on()?, t)),
            (None,    None,    None,    None,    Some(f), None,    None,    None,    None)    => Ok(Load::Nodal(on()?, f)),
            (None,    None,    None,    None,    None,    Some(f), None,    None,    None)    => Ok(Load::Force(on_nodes(&boundary, &nodes)?, f)),
            (None,    None,    None,    None,    None,    None,    Some(f), None,    None)    => whole().map(|()| Load::BodyForce(f)),
            (None,    None,    None,    None,    None,    None,    None,    Some(g), None)    => whole().map(|()| Load::Gravity(g)),
            (None,    None,    None,    None,    None,    None,    None,    None,    Some(r)) => whole().map(|()| Load::Rotation(r)),
            _ => Err(Violation::new(
                "",
                Reason::WrongCount,
                either(&given),
                "exactly one of `pressure`, `traction`, `normal` and `tangential`, `nodal`, `force`, `body_force`, `gravity`, `rotation`",
                "Give each of them a load of its own.",
            )),
        }
    }
}

fn on_boundary(boundary: &Option<String>, nodes: &Option<String>) -> Result<String, Violation> {
    let hint =
        "Stresses act on a boundary, a `force` on `nodes`, the other loads on the whole body.";
    let (place, reason, got) = match (boundary, nodes) {
        (Some(boundary), None) => return Ok(boundary.clone()),
        (_, Some(_)) => (
            "/nodes",
            Reason::NotUsed,
            "a set of nodes for a load other than `force`",
        ),
        (None, None) => ("/boundary", Reason::Missing, "nothing"),
    };
    let expected = "the name of a boundary";
    Err(Violation::new(place, reason, got, expected, hint))
}

fn on_nodes(boundary: &Option<String>, nodes: &Option<String>) -> Result<String, Violation> {
    match (boundary, nodes) {
        (None, Some(nodes)) => Ok(nodes.clone()),
        _ => Err(Violation::new(
            "/nodes",
            Reason::Missing,
            "no set of nodes, or a boundary in addition",
            "the name of a set of nodes, and no boundary",
            "A `force` acts on each node of a set; on a boundary give `nodal` forces or a traction.",
        )),
    }
}

fn nowhere(boundary: &Option<String>, nodes: &Option<String>) -> Result<(), Violation> {
    let place = match (boundary, nodes) {
        (None, None) => return Ok(()),
        (Some(_), _) => "/boundary",
        (None, Some(_)) => "/nodes",
    };
    Err(Violation::new(
        place,
        Reason::NotUsed,
        "a place for a load on the whole body",
        "no place: `body_force`, `gravity` and `rotation` act on the whole body",
        "Remove the place, or give a traction.",
    ))
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
        }
    }
}
