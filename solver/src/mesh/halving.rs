//! How often the quadrilaterals of a mesh are halved across their length before they are divided into four.
//!
//! A halved quadrilateral is split along two of its sides once more than along the others. A division passes this on: a
//! quadrilateral that follows its neighbour at a short side by one level gets another level ahead at a long side. Where
//! triangles, whose sides are all split equally, lead from there back to the short side, divisions would never end.
//!
//! Halvings are therefore limited in advance, such that the elements of the first mesh have *levels* at which none must be
//! divided because of its neighbours. Adding the same number to all levels keeps this property. No division can then
//! lead beyond the lowest such levels that contain the requested ones, so divisions end.

use std::collections::HashMap;

use super::Mesh;
use crate::element::Element;

/// A quadrilateral longer than this many times its width is halved, which makes its sides more equal.
const LONG: f64 = 3.0;

/// The halvings of one element.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Halving {
    /// The sides that a halving splits: 0 for the first and third, 1 for the second and fourth.
    pub(super) sides: usize,
    /// The number of halvings; 0 for triangles.
    pub(super) times: u32,
}

impl Halving {
    fn of(mesh: &Mesh, element: &Element) -> Halving {
        let Element::Quad(p) = element else {
            return Halving::default();
        };
        let side = |a: usize, b: usize| {
            let [[x0, y0], [x1, y1]] = [p[a], p[b]].map(|n| mesh.nodes[n as usize]);
            (x1 - x0).hypot(y1 - y0)
        };
        let (along, across) = (side(0, 1) + side(2, 3), side(1, 2) + side(3, 0));
        let mut ratio = along.max(across) / along.min(across);
        let mut times = 0;
        // (more than any mesh has)
        while ratio > LONG && times < 60 {
            ratio *= 0.5;
            times += 1;
        }
        Halving {
            sides: usize::from(across > along),
            times,
        }
    }

    /// By how many levels a side is split more than the element.
    fn ahead(&self, side: usize) -> u32 {
        if side % 2 == self.sides {
            self.times
        } else {
            0
        }
    }
}

/// Whether an element must be divided because of its neighbours: a half of one of its sides is split again, or all
/// sides but one are split. `split`: how often the neighbours split each side, if at all.
pub(super) fn must_divide(corners: usize, split: impl Iterator<Item = u32>) -> bool {
    let (mut count, mut twice) = (0, false);
    for times in split {
        count += usize::from(times > 0);
        twice |= times > 1;
    }
    twice || count + 1 >= corners
}

/// The halvings of all elements: as many as their shape needs, within the limit that lets divisions end.
pub(super) fn halvings(mesh: &Mesh) -> Vec<Halving> {
    let elements = mesh.elements.iter();
    let mut halvings: Vec<Halving> = elements.map(|element| Halving::of(mesh, element)).collect();
    let neighbours = neighbours(mesh);
    let most = halvings.iter().map(|halving| halving.times).max();
    let most = 1 + most.unwrap_or(0);
    let mut levels = vec![0u32; halvings.len()];
    let mut limits = vec![most; halvings.len()];
    let mut again: Vec<usize> = (0..levels.len()).collect();
    while let Some(e) = again.pop() {
        let sides = neighbours[e].iter().enumerate();
        let split = sides.map(|(side, beside)| {
            let own = levels[e] + halvings[e].ahead(side);
            let other = |&(f, side): &(usize, usize)| levels[f] + halvings[f].ahead(side);
            beside.as_ref().map_or(0, other).saturating_sub(own)
        });
        if !must_divide(mesh.elements[e].family().corners(), split) {
            continue;
        }
        levels[e] += 1;
        // what rises so high goes round in a circle, and some element of it is halved; with one halving less it may rise as
        // far again until it settles
        if levels[e] > limits[e] && halvings[e].times > 0 {
            halvings[e].times -= 1;
            limits[e] += most;
        }
        again.push(e);
        again.extend(neighbours[e].iter().flatten().map(|(f, _)| *f));
    }
    halvings
}

/// For each side of each element, the neighbouring element and the number of the side in the neighbour.
fn neighbours(mesh: &Mesh) -> Vec<Vec<Option<(usize, usize)>>> {
    let mut found: Vec<Vec<Option<(usize, usize)>>> = Vec::with_capacity(mesh.elements.len());
    let mut first: HashMap<u32, (usize, usize)> = HashMap::new();
    for (e, element) in mesh.elements.iter().enumerate() {
        let mut own = Vec::with_capacity(4);
        for (side, [_, _, mid]) in element.sides().enumerate() {
            let other = first.insert(mid, (e, side));
            if let Some((f, of_other)) = other {
                found[f][of_other] = Some((e, side));
            }
            own.push(other);
        }
        found.push(own);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::grid_mesh;
    use crate::problem::Grid;

    /// A mesh with straight sides between corners.
    fn straight(corners: &[[f64; 2]], elements: &[&[u32]]) -> Mesh {
        let mut nodes = corners.to_vec();
        let mut mids: HashMap<[u32; 2], u32> = HashMap::new();
        let mut mid = |a: u32, b: u32| {
            *mids.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                let [a, b] = [a, b].map(|n| corners[n as usize]);
                nodes.push([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]);
                nodes.len() as u32 - 1
            })
        };
        let elements = elements.iter().map(|p| match **p {
            [a, b, c] => Element::Triangle([a, b, c, mid(a, b), mid(b, c), mid(c, a)]),
            [a, b, c, d] => Element::Quad([a, b, c, d, mid(a, b), mid(b, c), mid(c, d), mid(d, a)]),
            _ => unreachable!("elements have three or four corners"),
        });
        let elements = elements.collect();
        Mesh {
            nodes,
            elements,
            ..Mesh::default()
        }
    }

    /// Halvings are limited where triangles lead from a long side of a quadrilateral to its short one: in such a circle
    /// four elements may differ by one level each, and a fifth halving would have no end.
    #[test]
    fn halvings_are_limited_where_triangles_lead_from_a_long_side_to_a_short_one() {
        let corners = [
            [0.0, 0.0],
            [100.0, 0.0],
            [100.0, 1.0],
            [0.0, 1.0],
            [50.0, 60.0],
            [130.0, 0.5],
        ];
        let quad: &[u32] = &[0, 1, 2, 3];
        let around: [&[u32]; 4] = [quad, &[3, 2, 4], &[1, 5, 2], &[2, 5, 4]];
        let alone = halvings(&straight(&corners, &around[..3]))[0];
        // 100 / 2⁶ < 3
        assert_eq!(alone, Halving { sides: 0, times: 6 });
        let within = halvings(&straight(&corners, &around));
        assert!((1..=4).contains(&within[0].times), "{within:?}");
        assert!(within[1..].iter().all(|halving| halving.times == 0));
    }

    /// In a grid halvings are not limited: cells are halved as often as their length requires.
    #[test]
    fn halvings_of_a_grid_are_as_many_as_its_cells_are_long() {
        let mut x = vec![0.0];
        (0..12).for_each(|k| x.push(x[k] + 1.7f64.powi(k as i32)));
        let y = x.iter().map(|x| 0.1 * x).collect();
        let grid = Grid {
            x,
            y,
            top: None,
            bottom: None,
        };
        let mesh = grid_mesh(&grid);
        let found = halvings(&mesh);
        for (element, halving) in mesh.elements.iter().zip(&found) {
            assert_eq!(*halving, Halving::of(&mesh, element));
        }
        assert!(found.iter().any(|h| h.sides == 0 && h.times > 8));
        assert!(found.iter().any(|h| h.sides == 1 && h.times > 2));
    }
}
