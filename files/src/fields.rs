//! Fields as arrays, which are the same in VTU and NPZ: vectors and tensors by components in VTK's order, with the
//! stress measures that are usually drawn. The NPZ also has values at the integration points.

use crate::npz::Npz;
use crate::stress::{Stress, principal, von_mises};
use solver::element::Element;
use solver::solution::Fields;

/// One quantity at all nodes.
pub(crate) struct Array {
    pub(crate) name: &'static str,
    /// The names of the components; none for a scalar.
    pub(crate) components: &'static [&'static str],
    pub(crate) data: Data,
}

pub(crate) enum Data {
    Real(Vec<f64>),
    Small(Vec<i8>),
}

/// The arrays at nodes, made one after another, since all of them together are larger than the fields.
pub(crate) fn point_data(fields: &Fields) -> impl Iterator<Item = Array> {
    const ARRAYS: [fn(&Fields) -> Array; 5] = [
        |fields| {
            let columns = (&fields.ux, &fields.uy);
            array(
                "displacement",
                &["x", "y", "z"],
                plane(columns.0, columns.1),
            )
        },
        |fields| {
            let of = |[xx, yy, xy, zz]: Stress| [xx, yy, zz, xy, 0.0, 0.0];
            let values = stresses(fields).flat_map(of).collect();
            array("stress", &["xx", "yy", "zz", "xy", "yz", "xz"], values)
        },
        |fields| {
            let values = stresses(fields).flat_map(principal).collect();
            array("principal_stress", &["1", "2", "3"], values)
        },
        |fields| array("von_mises", &[], stresses(fields).map(von_mises).collect()),
        |fields| Array {
            name: "contact_state",
            components: &[],
            data: Data::Small(fields.contact_state.clone()),
        },
    ];
    ARRAYS.into_iter().map(move |make| make(fields))
}

/// Positions, or other vectors in the plane, with z = 0.
pub(crate) fn plane(x: &[f64], y: &[f64]) -> Vec<f64> {
    x.iter().zip(y).flat_map(|(x, y)| [*x, *y, 0.0]).collect()
}

fn array(name: &'static str, components: &'static [&'static str], values: Vec<f64>) -> Array {
    Array {
        name,
        components,
        data: Data::Real(values),
    }
}

fn stresses(fields: &Fields) -> impl Iterator<Item = Stress> {
    let sides = fields.stress_xx.iter().zip(&fields.stress_yy);
    let rest = fields.stress_xy.iter().zip(&fields.stress_zz);
    sides
        .zip(rest)
        .map(|((xx, yy), (xy, zz))| [*xx, *yy, *xy, *zz])
}

/// Adds fields to an archive, each array named `prefix` and its own name.
///
/// Elements are in two arrays, `quads` and `triangles`, each with an array of the elements' numbers in the mesh;
/// `element_error` has one entry per element of the mesh, `gauss_element` the element of each integration point.
///
/// # Errors
///
/// The reason in words, if the columns of the fields do not fit together.
pub fn add(npz: &mut Npz, prefix: &str, fields: &Fields) -> Result<(), String> {
    check(fields)?;
    let name = |name: &str| format!("{prefix}{name}");
    npz.array(&name("points"), &plane(&fields.x, &fields.y), 3)?;
    for array in point_data(fields) {
        let width = array.components.len().max(1);
        match &array.data {
            Data::Real(values) => npz.array(&name(array.name), values, width)?,
            Data::Small(values) => npz.array(&name(array.name), values, width)?,
        }
    }
    npz.array(&name("element_error"), &fields.element_error, 1)?;

    let (mut quads, mut quad_numbers) = (Vec::new(), Vec::new());
    let (mut triangles, mut triangle_numbers) = (Vec::new(), Vec::new());
    let mut element_of_point = Vec::new();
    for (number, element) in (0u32..).zip(&fields.elements) {
        match element {
            Element::Quad(nodes) => {
                quads.extend_from_slice(nodes);
                quad_numbers.push(number);
            }
            Element::Triangle(nodes) => {
                triangles.extend_from_slice(nodes);
                triangle_numbers.push(number);
            }
        }
        let points = element.family().rule(fields.gauss.order).len();
        element_of_point.extend(std::iter::repeat_n(number, points));
    }
    npz.array(&name("quads"), &quads, 8)?;
    npz.array(&name("quad_numbers"), &quad_numbers, 1)?;
    npz.array(&name("triangles"), &triangles, 6)?;
    npz.array(&name("triangle_numbers"), &triangle_numbers, 1)?;

    let gauss = &fields.gauss;
    npz.array(&name("gauss_points"), &plane(&gauss.x, &gauss.y), 3)?;
    npz.array(&name("gauss_element"), &element_of_point, 1)?;
    let mut stress = Vec::with_capacity(6 * gauss.x.len());
    for point in 0..gauss.x.len() {
        let (xx, yy) = (gauss.stress_xx[point], gauss.stress_yy[point]);
        let (zz, xy) = (gauss.stress_zz[point], gauss.stress_xy[point]);
        stress.extend_from_slice(&[xx, yy, zz, xy, 0.0, 0.0]);
    }
    npz.array(&name("gauss_stress"), &stress, 6)
}

/// Writes the fields alone as an NPZ archive.
///
/// # Errors
///
/// The errors of [`add`].
pub fn npz(fields: &Fields) -> Result<Vec<u8>, String> {
    let mut npz = Npz::new();
    add(&mut npz, "", fields)?;
    npz.finish()
}

/// The memory that fields take, in bytes.
pub fn memory(fields: &Fields) -> usize {
    let (f, g) = (fields, &fields.gauss);
    let nodal = [
        &f.x,
        &f.y,
        &f.ux,
        &f.uy,
        &f.stress_xx,
        &f.stress_yy,
        &f.stress_xy,
        &f.stress_zz,
    ];
    let at_points = [
        &g.x,
        &g.y,
        &g.stress_xx,
        &g.stress_yy,
        &g.stress_xy,
        &g.stress_zz,
    ];
    let numbers = nodal.into_iter().chain(at_points).chain([&f.element_error]);
    numbers
        .map(|column| column.capacity() * size_of::<f64>())
        .sum::<usize>()
        + f.contact_state.capacity()
        + f.elements.capacity() * size_of::<Element>()
}

/// Checks that related arrays have equal lengths, and that elements have existing nodes only: invalid files crash the
/// programs that read them.
pub(crate) fn check(fields: &Fields) -> Result<(), String> {
    let f = fields;
    let nodes = f.x.len();
    let same = |what: &str, found: usize, expected: usize| {
        if found == expected {
            Ok(())
        } else {
            Err(format!("{what}: {found} values instead of {expected}"))
        }
    };
    let nodal = [
        &f.y,
        &f.ux,
        &f.uy,
        &f.stress_xx,
        &f.stress_yy,
        &f.stress_xy,
        &f.stress_zz,
    ];
    for column in nodal {
        same("nodal fields", column.len(), nodes)?;
    }
    same("contact_state", f.contact_state.len(), nodes)?;
    same("element_error", f.element_error.len(), f.elements.len())?;
    for (number, element) in f.elements.iter().enumerate() {
        if let Some(node) = element.iter().find(|node| **node as usize >= nodes) {
            return Err(format!(
                "element {number} has the node {node}, but there are only {nodes} nodes"
            ));
        }
    }
    let g = &f.gauss;
    let elements = f.elements.iter();
    let points = elements.map(|e| e.family().rule(g.order).len()).sum();
    for column in [
        &g.x,
        &g.y,
        &g.stress_xx,
        &g.stress_yy,
        &g.stress_xy,
        &g.stress_zz,
    ] {
        same("integration points", column.len(), points)?;
    }
    Ok(())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::npz::tests::read;
    use solver::solution::GaussFields;

    /// A quadrilateral with a triangle on its right side.
    pub(crate) fn mixed() -> Fields {
        let x = vec![0.0, 1.0, 1.0, 0.0, 0.5, 1.0, 0.5, 0.0, 2.0, 1.5, 1.5];
        let y = vec![0.0, 0.0, 1.0, 1.0, 0.0, 0.5, 1.0, 0.5, 0.5, 0.25, 0.75];
        let ramp = |from: f64| {
            (0..11)
                .map(|i| from + 0.1 * f64::from(i))
                .collect::<Vec<_>>()
        };
        let points = |value: f64| vec![value; 16];
        Fields {
            ux: ramp(0.1),
            uy: ramp(-0.5),
            stress_xx: ramp(-3.0),
            stress_yy: ramp(5.0),
            stress_xy: vec![0.0; 11],
            stress_zz: ramp(1.0),
            contact_state: vec![-1, -1, 2, 0, -1, -1, 1, -1, -1, -1, -1],
            elements: vec![
                Element::Quad([0, 1, 2, 3, 4, 5, 6, 7]),
                Element::Triangle([1, 8, 2, 9, 10, 5]),
            ],
            element_error: vec![0.25, 0.125],
            gauss: GaussFields {
                order: 3,
                x: points(0.5),
                y: points(0.5),
                stress_xx: points(1.0),
                stress_yy: points(2.0),
                stress_xy: points(3.0),
                stress_zz: points(4.0),
            },
            x,
            y,
        }
    }

    #[test]
    fn an_archive_holds_both_kinds_of_element_and_the_integration_points() {
        let arrays = read(npz(&mixed()).unwrap());
        let shape = |name: &str| {
            let header = &arrays[name].0;
            let (_, rest) = header.split_once("'shape': ").unwrap();
            rest.split_once(", }").unwrap().0.to_owned()
        };
        for (name, expected) in [
            ("points", "(11, 3)"),
            ("displacement", "(11, 3)"),
            ("stress", "(11, 6)"),
            ("principal_stress", "(11, 3)"),
            ("von_mises", "(11,)"),
            ("contact_state", "(11,)"),
            ("element_error", "(2,)"),
            ("quads", "(1, 8)"),
            ("quad_numbers", "(1,)"),
            ("triangles", "(1, 6)"),
            ("triangle_numbers", "(1,)"),
            ("gauss_points", "(16, 3)"),
            ("gauss_element", "(16,)"),
            ("gauss_stress", "(16, 6)"),
        ] {
            assert_eq!(shape(name), expected, "{name}");
        }
        assert_eq!(arrays.len(), 14);
        assert_eq!(arrays["triangle_numbers"].1, [1, 0, 0, 0]);
        let stress: Vec<f64> = arrays["stress"].1[..48]
            .chunks(8)
            .map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap()))
            .collect();
        assert_eq!(stress, [-3.0, 5.0, 1.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn arrays_that_do_not_fit_together_are_errors() {
        for spoil in [
            |f: &mut Fields| f.uy.truncate(3),
            |f: &mut Fields| f.contact_state.clear(),
            |f: &mut Fields| f.element_error.push(0.0),
            |f: &mut Fields| f.gauss.stress_xy.truncate(2),
            |f: &mut Fields| f.elements[1] = Element::Triangle([1, 11, 2, 9, 10, 5]),
        ] {
            let mut fields = mixed();
            spoil(&mut fields);
            assert!(npz(&fields).is_err());
            assert!(crate::vtu::file(&fields).is_err());
        }
    }
}
