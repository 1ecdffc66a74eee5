//! Fields as columns, compressed without loss: how results are stored.
//!
//! Fields consist mostly of stresses, which follow from displacements. Each column is stored as differences from a
//! prediction that a reader can repeat: stresses are predicted by Hooke's law, values at midside nodes by the mean of
//! the corners, and other values by the value before. Differences are taken between bit patterns, so that every number
//! is restored exactly, however good the prediction is; most differences are zero or a few roundings, and take one byte
//! instead of eight.
//!
//! The predictions are a part of the format: a change of one prediction, by a single rounding, needs another version.

mod differences;
mod head;
mod mechanics;
mod order;
mod version_1;

use solver::{
    elasticity::Moduli,
    element::Element,
    solution::{Fields, GaussFields},
};

pub use self::mechanics::Law;
use self::{
    differences::{Reader, Writer},
    head::{Head, damaged},
    mechanics::{Known, MOST_MATERIALS, Stresses, at_points, predicted_stresses},
    order::NodeOrder,
};

/// Encodes fields as bytes.
///
/// # Errors
///
/// The reason in words: columns of different lengths, elements with nodes that do not exist, or too many materials.
pub fn encode(fields: &Fields, law: &Law) -> Result<Vec<u8>, String> {
    crate::fields::check(fields)?;
    if law.moduli.len() > MOST_MATERIALS {
        return Err(format!("{} materials", law.moduli.len()));
    }
    let mut out = Writer::new();
    out.size(fields.gauss.order as usize);
    out.size(usize::from(law.axisymmetric));
    out.size(law.moduli.len());
    for entry in law.moduli.iter().flatten().flatten() {
        out.number(*entry);
    }
    write_elements(&mut out, &fields.elements);
    let order = NodeOrder::new(&fields.elements, fields.x.len());
    for column in [&fields.x, &fields.y, &fields.ux, &fields.uy] {
        out.nodal(column, &order);
    }
    let states = fields.contact_state.iter().map(|state| i64::from(*state));
    out.whole(states);
    out.sequence(&fields.element_error);
    let materials = mechanics::materials_by_element(fields, law);
    out.whole(materials.iter().map(|material| i64::from(*material)));
    let predicted = predicted_stresses(&Known::of(fields), law, &materials);
    for (column, predicted) in [&fields.gauss.x, &fields.gauss.y]
        .into_iter()
        .zip(&predicted.points)
    {
        out.predicted(column, predicted);
    }
    for (column, predicted) in at_points(&fields.gauss)
        .into_iter()
        .zip(&predicted.at_points)
    {
        out.predicted(column, predicted);
    }
    for (column, predicted) in at_nodes(fields).into_iter().zip(&predicted.at_nodes) {
        out.predicted(column, predicted);
    }
    let (nodes, points) = (fields.x.len(), fields.gauss.x.len());
    Ok(out.finish([nodes, fields.elements.len(), points]))
}

/// Returns the largest memory (bytes) that decoding takes, including the fields, as the head of the bytes says; the
/// bytes after the head may be missing.
///
/// # Errors
///
/// The reason in words, if the head is not that of encoded fields.
pub fn memory_to_decode(bytes: &[u8]) -> Result<usize, String> {
    Ok(Head::read(bytes)?.0.memory())
}

/// Decodes fields, bit for bit as they were encoded. `json_bytes`, the size of the same fields as JSON, limits the
/// memory.
///
/// # Errors
///
/// The reason in words, if the bytes are not encoded fields of that size.
pub fn decode(bytes: &[u8], json_bytes: usize) -> Result<Fields, String> {
    let (head, rest) = Head::read(bytes)?;
    head.check(json_bytes)?;
    let mut from = Reader::new(&head, rest)?;
    let (nodes, count) = (head.nodes, head.elements);
    let order = u32::try_from(from.size()?).map_err(|_| damaged("order"))?;
    let axisymmetric = from.size()? != 0;
    let mut law = Law {
        axisymmetric,
        moduli: Vec::new(),
    };
    let materials = from.size()?;
    if materials > MOST_MATERIALS {
        return Err(damaged("materials"));
    }
    for _ in 0..materials {
        let mut moduli = Moduli::default();
        for entry in moduli.iter_mut().flatten() {
            *entry = from.number()?;
        }
        law.moduli.push(moduli);
    }
    let elements = read_elements(&mut from, count, nodes)?;
    let points = elements
        .iter()
        .map(|e| version_1::rule(e.family(), order).len());
    if points.sum::<usize>() != head.points {
        return Err(damaged("integration points"));
    }
    let node_order = NodeOrder::new(&elements, nodes);
    let mut nodal = || from.nodal(&node_order);
    let (x, y, ux, uy) = (nodal()?, nodal()?, nodal()?, nodal()?);
    let contact_state = from.whole(nodes)?;
    let element_error = from.sequence(count)?;
    let materials: Vec<u8> = from.whole(count)?;
    let mut fields = Fields {
        x,
        y,
        ux,
        uy,
        contact_state,
        elements,
        element_error,
        gauss: GaussFields {
            order,
            ..GaussFields::default()
        },
        ..Fields::default()
    };
    let Stresses {
        points: [points_x, points_y],
        at_points: [xx, yy, xy, zz],
        at_nodes: [nodal_xx, nodal_yy, nodal_xy, nodal_zz],
    } = predicted_stresses(&Known::of(&fields), &law, &materials);
    let mut actual = |predicted| from.predicted(predicted);
    let gauss = &mut fields.gauss;
    (gauss.x, gauss.y) = (actual(points_x)?, actual(points_y)?);
    (gauss.stress_xx, gauss.stress_yy) = (actual(xx)?, actual(yy)?);
    (gauss.stress_xy, gauss.stress_zz) = (actual(xy)?, actual(zz)?);
    (fields.stress_xx, fields.stress_yy) = (actual(nodal_xx)?, actual(nodal_yy)?);
    (fields.stress_xy, fields.stress_zz) = (actual(nodal_xy)?, actual(nodal_zz)?);
    from.finish()?;
    Ok(fields)
}

fn at_nodes(fields: &Fields) -> [&Vec<f64>; 4] {
    [
        &fields.stress_xx,
        &fields.stress_yy,
        &fields.stress_xy,
        &fields.stress_zz,
    ]
}

/// Writes the number of nodes of each element, then the first nodes of all elements, the second nodes, and so on.
fn write_elements(out: &mut Writer, elements: &[Element]) {
    out.whole(elements.iter().map(|element| element.len() as i64));
    for place in 0..8 {
        let nodes = elements
            .iter()
            .map(|e| e.get(place).map_or(0, |n| i64::from(*n)));
        out.whole(nodes);
    }
}

fn read_elements(
    from: &mut Reader<'_>,
    count: usize,
    nodes: usize,
) -> Result<Vec<Element>, String> {
    let lengths: Vec<u8> = from.whole(count)?;
    let mut places = Vec::with_capacity(8);
    for _ in 0..8 {
        places.push(from.whole::<u32>(count)?);
    }
    let element = |(e, length): (usize, &u8)| {
        let mut own = [0; 8];
        for (slot, place) in own.iter_mut().zip(&places) {
            *slot = place[e];
        }
        let own = own
            .get(..usize::from(*length))
            .ok_or_else(|| damaged("elements"))?;
        if own.iter().all(|node| (*node as usize) < nodes) {
            Element::try_from(own)
        } else {
            Err(damaged("nodes of elements"))
        }
    };
    let mut elements = Vec::with_capacity(count);
    for length in lengths.iter().enumerate() {
        elements.push(element(length)?);
    }
    Ok(elements)
}

#[cfg(test)]
mod stored;
#[cfg(test)]
mod tests;
