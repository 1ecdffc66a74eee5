//! What a program needs to draw a body by itself, as compact arrays: corners of elements, boundaries, obstacles; and one
//! field at a time.
//!
//! A view is the length of its head (four bytes, little-endian), the head as JSON, filled with spaces to a multiple of four
//! bytes, and the arrays one after another, little-endian numbers of four bytes. The head names the arrays: their types, their
//! places from the end of the head (bytes), and the numbers that they have.

use std::{collections::BTreeMap, fmt};

use serde_json::{Value, json};
use solver::element::{Element, Family};
use solver::error::Violation;
use solver::mesh::Mesh;
use solver::model::{Level, Model};
use solver::problem::{Load, Problem};
use solver::solution::{ContactProfile, Fields};
use strum::{EnumString, IntoStaticStr, VariantArray};

use super::deformed::faces_after;
use super::obstacle::Face;
use crate::stress::{Stress as Tensor, principal, von_mises};

/// The version of the format.
const VERSION: u32 = 1;

/// A field of a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr, EnumString, VariantArray)]
#[strum(serialize_all = "snake_case")]
pub enum ViewField {
    /// Displacements along x and y.
    Displacement,
    /// Equivalent stress of von Mises.
    VonMises,
    /// σ_xx (σ_rr).
    StressXx,
    /// σ_yy (σ_zz in axisymmetry).
    StressYy,
    /// σ_xy (σ_rz).
    StressXy,
    /// The stress out of the plane.
    StressZz,
    /// The largest principal stress.
    #[strum(serialize = "principal_stress_1")]
    PrincipalStress1,
    /// The smallest principal stress.
    #[strum(serialize = "principal_stress_3")]
    PrincipalStress3,
    /// The state of contact: −1 not on a contact, 0 open, 1 stick, 2 slip.
    ContactState,
    /// The norm of each element's error, by element.
    ElementError,
}

/// The arrays of a view, and its head.
struct View {
    head: serde_json::Map<String, Value>,
    arrays: Vec<Value>,
    bytes: Vec<u8>,
}

impl View {
    fn new() -> View {
        View {
            head: serde_json::Map::new(),
            arrays: vec![],
            bytes: vec![],
        }
    }

    fn set(&mut self, name: &str, value: impl Into<Value>) {
        self.head.insert(name.to_owned(), value.into());
    }

    fn floats(&mut self, name: &str, values: impl Iterator<Item = f64>) {
        let start = self.bytes.len();
        // a number beyond the range of f32 becomes infinite, and is then not drawn
        values.for_each(|value| self.bytes.extend((value as f32).to_le_bytes()));
        self.name(name, "f32", start);
    }

    fn numbers(&mut self, name: &str, values: impl Iterator<Item = u32>) {
        let start = self.bytes.len();
        values.for_each(|value| self.bytes.extend(value.to_le_bytes()));
        self.name(name, "u32", start);
    }

    fn name(&mut self, name: &str, kind: &str, start: usize) {
        let count = (self.bytes.len() - start) / 4;
        self.arrays
            .push(json!({ "name": name, "type": kind, "offset": start, "length": count }));
    }

    fn written(mut self) -> Vec<u8> {
        self.set("version", VERSION);
        self.head
            .insert("arrays".to_owned(), Value::Array(self.arrays));
        let mut head = Value::Object(self.head).to_string().into_bytes();
        head.resize(head.len().next_multiple_of(4), b' ');
        let mut whole = Vec::with_capacity(4 + head.len() + self.bytes.len());
        whole.extend((head.len() as u32).to_le_bytes());
        whole.extend(head);
        whole.extend(self.bytes);
        whole
    }
}

/// Why a problem has no view.
#[derive(Debug)]
pub enum NoView {
    /// The problem is invalid.
    Invalid(Vec<Violation>),
    /// Elements do not fit their nodes, for this reason.
    Misfit(String),
}

impl fmt::Display for NoView {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NoView::Invalid(violations) => match violations.first() {
                Some(violation) => violation.fmt(f),
                None => f.write_str("the problem is invalid"),
            },
            NoView::Misfit(reason) => f.write_str(reason),
        }
    }
}

/// The body and what surrounds it: corners, elements, outline, boundaries, supports, loads and obstacles. The elements are those of `fields`
/// where it has some, as adaptive refinement changes them, and the obstacles are then where they ended; otherwise they are
/// those of the problem.
///
/// # Errors
///
/// The violations of a problem without a mesh that could be drawn, or the reason in words why elements do not fit their nodes.
pub fn geometry(
    problem: &Problem,
    stored: Option<&Mesh>,
    fields: Option<&Fields>,
    profiles: &BTreeMap<String, ContactProfile>,
) -> Result<Vec<u8>, NoView> {
    let external = crate::external::external_mesh(problem, stored.cloned());
    let model = Model::new(problem, external).map_err(NoView::Invalid)?;
    let mut view = View::new();
    let fields = fields.filter(|fields| !fields.elements.is_empty());
    let refined: Vec<[f64; 2]>;
    let (nodes, elements) = match fields {
        Some(fields) => {
            let all = fields.x.iter().zip(&fields.y);
            refined = all.map(|(&x, &y)| [x, y]).collect();
            (&refined[..], &fields.elements[..])
        }
        None => (&model.mesh.nodes[..], &model.mesh.elements[..]),
    };
    add_elements(&mut view, nodes, elements).map_err(NoView::Misfit)?;
    if fields.is_none() {
        add_groups(&mut view, &model.mesh);
    }
    add_boundaries(&mut view, &model.mesh);
    let faces: Vec<(&str, Vec<[f64; 2]>)> = match fields {
        Some(fields) => faces_after(problem, profiles, fields),
        None => {
            let contacts = model.contacts.iter();
            let face = |contact: &solver::model::ContactModel| Face::before(contact).points;
            let all = contacts.zip(&problem.contacts);
            all.map(|(model, contact)| (&contact.boundary[..], face(model)))
                .collect()
        }
    };
    add_lines(&mut view, "obstacles", faces.into_iter());
    let pushed = model
        .contacts
        .iter()
        .zip(&problem.contacts)
        .map(|(contact, given)| {
            json!({
                "boundary": given.boundary,
                "against": given.against.as_ref().map(|other| &other.boundary),
                "gap": contact.boundary.positions.len().checked_sub(1).map(|last| {
                    contact.gap(last / 2, &Level::FULL)
                }),
                "pushed": given.indentation,
                "direction": given.direction,
            })
        });
    view.set("contacts", Value::Array(pushed.collect()));
    view.set("supports", supports(problem));
    view.set("loads", loads(problem));
    view.set("title", json!(problem.title));
    view.set("units", json!(problem.units));
    view.set("analysis", json!(problem.analysis));
    view.set("description", super::description::description(problem));
    Ok(view.written())
}

/// A stored mesh alone.
///
/// # Errors
///
/// The reason in words, if the mesh cannot be drawn.
pub fn mesh_geometry(mesh: &Mesh) -> Result<Vec<u8>, String> {
    let mut view = View::new();
    add_elements(&mut view, &mesh.nodes, &mesh.elements)?;
    add_groups(&mut view, mesh);
    add_boundaries(&mut view, mesh);
    Ok(view.written())
}

/// One field at the corners of the elements, in the order of the geometry's positions, or one number for each element, in the
/// order of its elements.
///
/// # Errors
///
/// The reason in words, if the columns of the fields do not fit together.
pub fn field(fields: &Fields, wanted: ViewField) -> Result<Vec<u8>, String> {
    let mut view = View::new();
    view.set("field", <&str>::from(wanted));
    let at = |column: &[f64], n: usize| column.get(n).copied().unwrap_or(f64::NAN);
    let tensor = |n: usize| -> Tensor {
        [
            &fields.stress_xx,
            &fields.stress_yy,
            &fields.stress_xy,
            &fields.stress_zz,
        ]
        .map(|column| at(column, n))
    };
    let value = |n: usize| match wanted {
        ViewField::VonMises => von_mises(tensor(n)),
        ViewField::StressXx => tensor(n)[0],
        ViewField::StressYy => tensor(n)[1],
        ViewField::StressXy => tensor(n)[2],
        ViewField::StressZz => tensor(n)[3],
        ViewField::PrincipalStress1 => principal(tensor(n))[0],
        ViewField::PrincipalStress3 => principal(tensor(n))[2],
        ViewField::ContactState => fields
            .contact_state
            .get(n)
            .map_or(f64::NAN, |state| f64::from(*state)),
        ViewField::Displacement | ViewField::ElementError => f64::NAN,
    };
    let values: Vec<f64> = match wanted {
        ViewField::ElementError => {
            let order = order(&fields.elements);
            order
                .into_iter()
                .map(|e| at(&fields.element_error, e))
                .collect()
        }
        ViewField::Displacement => {
            let corners = corners(&fields.elements, fields.x.len())?.0;
            corners
                .into_iter()
                .flat_map(|n| [at(&fields.ux, n), at(&fields.uy, n)])
                .collect()
        }
        _ => corners(&fields.elements, fields.x.len())?
            .0
            .into_iter()
            .map(value)
            .collect(),
    };
    view.set(
        "components",
        if wanted == ViewField::Displacement {
            2
        } else {
            1
        },
    );
    view.set(
        "by",
        if wanted == ViewField::ElementError {
            "element"
        } else {
            "corner"
        },
    );
    let finite = values.iter().copied().filter(|value| value.is_finite());
    let range = finite.fold(None, |range: Option<[f64; 2]>, value| {
        let [least, most] = range.unwrap_or([value, value]);
        Some([least.min(value), most.max(value)])
    });
    view.set("range", json!(range));
    view.floats("values", values.into_iter());
    Ok(view.written())
}

/// The nodes that are corners of elements, in order, and for each node its place among them.
fn corners(elements: &[Element], nodes: usize) -> Result<(Vec<usize>, Vec<u32>), String> {
    let mut place = vec![u32::MAX; nodes];
    for element in elements {
        for node in &element[..element.family().corners()] {
            let own = place.get_mut(*node as usize);
            *own.ok_or("an element has a node that is not there")? = 0;
        }
    }
    let mut used = vec![];
    for (node, place) in place.iter_mut().enumerate() {
        if *place == 0 {
            *place = used.len() as u32;
            used.push(node);
        }
    }
    Ok((used, place))
}

/// The elements in the order of a view: quadrilaterals first.
fn order(elements: &[Element]) -> Vec<usize> {
    let of = |family: Family| {
        let all = elements.iter().enumerate();
        all.filter(move |(_, element)| element.family() == family)
            .map(|(number, _)| number)
    };
    of(Family::Quad).chain(of(Family::Triangle)).collect()
}

fn add_elements(view: &mut View, nodes: &[[f64; 2]], elements: &[Element]) -> Result<(), String> {
    let (used, place) = corners(elements, nodes.len())?;
    view.set("nodes", nodes.len());
    view.set("elements", elements.len());
    view.floats("positions", used.iter().flat_map(|&n| nodes[n]));
    for (name, family) in [("quads", Family::Quad), ("triangles", Family::Triangle)] {
        let own = elements.iter().filter(|element| element.family() == family);
        let ids = own.flat_map(|element| {
            element[..family.corners()]
                .iter()
                .map(|n| place[*n as usize])
        });
        view.numbers(name, ids);
    }
    // sides of one element only
    let mut sides: BTreeMap<[u32; 2], [u32; 2]> = BTreeMap::new();
    for element in elements {
        for [a, b, _] in element.sides() {
            let side = [place[a as usize], place[b as usize]];
            let key = [side[0].min(side[1]), side[0].max(side[1])];
            if sides.remove(&key).is_none() {
                sides.insert(key, side);
            }
        }
    }
    view.numbers("outline", sides.into_values().flatten());
    Ok(())
}

/// The number of each element's first group, in the order of the view; elements without a group have the number of groups.
fn add_groups(view: &mut View, mesh: &Mesh) {
    let names: Vec<&String> = mesh.groups.keys().collect();
    view.set("groups", json!(names));
    if names.is_empty() {
        return;
    }
    let mut first = vec![names.len() as u32; mesh.elements.len()];
    for (group, (_, own)) in mesh.groups.iter().enumerate().rev() {
        for element in own {
            if let Some(first) = first.get_mut(*element as usize) {
                *first = group as u32;
            }
        }
    }
    let order = order(&mesh.elements);
    view.numbers("element_group", order.into_iter().map(|e| first[e]));
}

/// The named boundaries, each as its sides: two points for each.
fn add_boundaries(view: &mut View, mesh: &Mesh) {
    let sides = mesh.boundaries.iter().map(|(name, edges)| {
        let ends = edges.iter().flat_map(|[a, b, _]| [*a, *b]);
        let points: Vec<[f64; 2]> = ends.map(|n| mesh.nodes[n as usize]).collect();
        (name.as_str(), points)
    });
    add_lines(view, "boundaries", sides);
}

/// Adds lines of points, each with its name, the number of its first point, and the number of its points.
fn add_lines<'a>(
    view: &mut View,
    what: &str,
    lines: impl Iterator<Item = (&'a str, Vec<[f64; 2]>)>,
) {
    let (mut list, mut points) = (vec![], vec![]);
    for (name, own) in lines {
        list.push(json!({ "name": name, "first": points.len(), "count": own.len() }));
        points.extend(own);
    }
    view.set(what, Value::Array(list));
    view.floats(&format!("{what}_points"), points.into_iter().flatten());
}

fn supports(problem: &Problem) -> Value {
    let all = problem.supports.iter().map(|support| {
        json!({
            "boundary": support.boundary,
            "nodes": support.nodes,
            "x": support.ux.is_some(),
            "y": support.uy.is_some(),
            "normal": support.un.is_some(),
            "tangent": support.ut.is_some(),
            "springs": support.stiffness.is_some(),
        })
    });
    Value::Array(all.collect())
}

fn loads(problem: &Problem) -> Value {
    let all = problem.loads.iter().map(|load| {
        let kind = match load {
            Load::Pressure(..) => "pressure",
            Load::Traction(..) => "traction",
            Load::Normal(..) => "normal",
            Load::Tangential(..) => "tangential",
            Load::Nodal(..) => "nodal",
            Load::Force(..) => "force",
            Load::BodyForce(_) => "body_force",
            Load::Gravity(_) => "gravity",
            Load::Rotation(_) => "rotation",
            Load::Temperature(..) | Load::NodalTemperature(_) => "temperature",
        };
        json!({ "boundary": load.boundary(), "kind": kind })
    });
    Value::Array(all.collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::plot::tests::{problem, solution};

    /// The head of a view, and its arrays as numbers.
    fn read(view: &[u8]) -> (Value, BTreeMap<String, Vec<f64>>) {
        let word = |at: usize| <[u8; 4]>::try_from(&view[at..at + 4]).unwrap();
        let length = u32::from_le_bytes(word(0)) as usize;
        let head: Value = serde_json::from_slice(&view[4..4 + length]).unwrap();
        let mut arrays = BTreeMap::new();
        for array in head["arrays"].as_array().unwrap() {
            let start = 4 + length + array["offset"].as_u64().unwrap() as usize;
            let number = |k: usize| match array["type"].as_str() {
                Some("f32") => f64::from(f32::from_le_bytes(word(start + 4 * k))),
                _ => f64::from(u32::from_le_bytes(word(start + 4 * k))),
            };
            let values = (0..array["length"].as_u64().unwrap() as usize).map(number);
            arrays.insert(array["name"].as_str().unwrap().to_owned(), values.collect());
        }
        (head, arrays)
    }

    #[test]
    fn a_body_is_described_by_its_corners_and_what_is_around_it() {
        let problem = problem();
        let (head, arrays) = read(&geometry(&problem, None, None, &BTreeMap::new()).unwrap());
        assert_eq!(arrays["positions"].len(), 12);
        assert_eq!(arrays["quads"].len(), 8);
        assert_eq!(arrays["outline"].len(), 12);
        assert_eq!((&head["elements"], &head["nodes"]), (&json!(2), &json!(13)));
        let names = head["boundaries"].as_array().unwrap().iter();
        let names: Vec<&str> = names
            .map(|boundary| boundary["name"].as_str().unwrap())
            .collect();
        assert_eq!(names, ["bottom", "left", "right", "top"]);
        assert_eq!(head["obstacles"][0]["name"], "top");
        assert!(head["obstacles"][0]["count"].as_u64().unwrap() >= 5);
        assert_eq!(head["supports"][0]["boundary"], "bottom");
        assert!(
            head["description"]
                .as_str()
                .unwrap()
                .contains("radius 8 mm")
        );
    }

    #[test]
    fn every_field_has_a_number_for_each_corner_or_element() {
        let problem = problem();
        let solution = solution(&problem);
        let fields = &solution.fields;
        let whole = geometry(&problem, None, Some(fields), &solution.profiles).unwrap();
        let (_, arrays) = read(&whole);
        let corners = arrays["positions"].len() / 2;
        for wanted in ViewField::VARIANTS {
            let (head, values) = read(&field(fields, *wanted).unwrap());
            let expected = match wanted {
                ViewField::Displacement => 2 * corners,
                ViewField::ElementError => fields.elements.len(),
                _ => corners,
            };
            assert_eq!(values["values"].len(), expected, "{wanted:?}");
            let [least, most] = [0, 1].map(|k| head["range"][k].as_f64().unwrap());
            assert!(
                values["values"]
                    .iter()
                    .all(|v| *v >= least - 1e-3 * least.abs() && *v <= most + 1e-3 * most.abs())
            );
        }
        // under the cylinder the body is pressed down
        let (_, moved) = read(&field(fields, ViewField::Displacement).unwrap());
        assert!(
            moved["values"]
                .iter()
                .skip(1)
                .step_by(2)
                .any(|uy| *uy < -0.005)
        );
    }
}
