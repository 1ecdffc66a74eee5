//! Divides a side of the surface at a place where an obstacle ends, so that there is a node.

use crate::element::{Element, Family, edge3};
use crate::mesh::{Edge, Mesh};

/// The smallest fraction of a side on either side of the place where it is divided: smaller ones make needle-shaped
/// elements, whose stiffness hides the stiffness of the others.
const LEAST_PART: f64 = 1e-4;

impl Mesh {
    /// Divides a side of the surface at ξ, and the element behind it into triangles; no other element changes:
    ///
    /// ```text
    ///   A ---P------- B
    ///   |   / \       |        a triangle A B C becomes A P C and P B C
    ///   |  /    \     |
    ///   | /       \   |
    ///   D ----------- C
    /// ```
    ///
    /// The side's midside node becomes the corner P. False, and nothing changes, if P lies next to an end of the side,
    /// the element is too curved for it, or a set names the midside node alone.
    pub fn divide_side(&mut self, side: Edge, xi: f64) -> bool {
        let part = 0.5 * (1.0 + xi);
        let behind = self.elements.iter().position(|e| e.contains(&side[2]));
        let Some(number) = behind.filter(|_| part > LEAST_PART && part < 1.0 - LEAST_PART) else {
            return false;
        };
        let element = self.elements[number];
        let family = element.family();
        let own: Vec<u32> = element.iter().copied().collect();
        let Some(first) = family.sides().iter().position(|s| own[s[2]] == side[2]) else {
            return false;
        };
        let count = family.corners();
        // corners and midsides from A on, counter-clockwise; the surface may be followed the other way round
        let corner = |k: usize| (first + k) % count;
        let midside = |k: usize| count + corner(k);
        let xi = if own[corner(0)] == side[0] { xi } else { -xi };
        let places = family.places();
        let along = |a: [f64; 2], b: [f64; 2], part: f64| {
            [0, 1].map(|axis| a[axis] + part * (b[axis] - a[axis]))
        };
        let p = along(places[corner(0)], places[corner(1)], 0.5 * (1.0 + xi));
        let ends = [own[corner(0)], own[corner(1)], own[midside(0)]];
        let positions = element.gather(|n| self.nodes[n as usize]);
        let inside = |k: usize| {
            let h = family.shape(along(p, places[corner(k)], 0.5));
            [0, 1].map(|axis| {
                (0..family.nodes())
                    .map(|i| h[i] * positions[i][axis])
                    .sum::<f64>()
            })
        };
        let on_side = |xi: f64| edge3::map(&self.edge_nodes(&ends), xi).0;
        let mut new = vec![on_side(0.5 * (xi - 1.0)), on_side(0.5 * (xi + 1.0))];
        new.extend((2..count).map(inside));
        let at_p = on_side(xi);
        let temperatures = self
            .temperatures_when_divided(&element, &ends, xi, |k| along(p, places[corner(k)], 0.5));
        let added = self.nodes.len() as u32;
        // A–P, P–B, and from P to the corners across: C and D
        let (before, after, to) = (added, added + 1, |k: usize| added + k as u32);
        let [a, b, mid] = ends;
        let triangles: Vec<[u32; 6]> = match family {
            Family::Triangle => {
                let c = own[corner(2)];
                vec![
                    [a, mid, c, before, to(2), own[midside(2)]],
                    [mid, b, c, after, own[midside(1)], to(2)],
                ]
            }
            Family::Quad => {
                let (c, d) = (own[corner(2)], own[corner(3)]);
                vec![
                    [a, mid, d, before, to(3), own[midside(3)]],
                    [mid, c, d, to(2), own[midside(2)], to(3)],
                    [mid, b, c, after, own[midside(1)], to(2)],
                ]
            }
        };
        let position = |n: u32| match n {
            n if n == mid => at_p,
            n if n >= added => new[(n - added) as usize],
            n => self.nodes[n as usize],
        };
        let sound = |triangle: &[u32; 6]| {
            let element = Element::Triangle(*triangle);
            let nodes = element.gather(position);
            let inner = Family::Triangle.rule(3).iter().map(|point| point.place);
            let mut all = inner.chain(Family::Triangle.places().iter().copied());
            all.all(|place| Family::Triangle.map(&nodes, place).det > 0.0)
        };
        if !triangles.iter().all(sound) || self.has_midside_alone(&ends) {
            return false;
        }
        self.lineage.leave_first(self.nodes.len());
        self.lineage.split_at(&ends, xi, [before, after]);
        self.nodes[mid as usize] = at_p;
        self.nodes.extend(new);
        if let Some((at_p, new)) = temperatures {
            self.temperatures[mid as usize] = at_p;
            self.temperatures.extend(new);
        }
        let (kept, more) = (triangles[0], &triangles[1..]);
        let parts = self.elements.len() as u32..(self.elements.len() + more.len()) as u32;
        self.elements[number] = Element::Triangle(kept);
        self.elements
            .extend(more.iter().copied().map(Element::Triangle));
        for group in self.groups.values_mut() {
            if group.contains(&(number as u32)) {
                group.extend(parts.clone());
            }
        }
        for set in self.node_sets.values_mut() {
            if ends.iter().all(|node| set.contains(node)) {
                set.extend([before, after]);
            }
        }
        self.divide_in_boundaries(a, mid, [before, after]);
        true
    }

    /// Puts the two halves in place of the side with the midside `mid`: that from its end `a` on has the first of `halves`
    /// as its midside.
    fn divide_in_boundaries(&mut self, a: u32, mid: u32, [before, after]: [u32; 2]) {
        for edges in self.boundaries.values_mut() {
            if let Some(k) = edges.iter().position(|edge| edge[2] == mid) {
                let [start, end, _] = edges[k];
                let halves = if start == a {
                    [before, after]
                } else {
                    [after, before]
                };
                edges.splice(k..=k, [[start, mid, halves[0]], [mid, end, halves[1]]]);
            }
        }
    }

    /// The temperature at a place ξ of a side, and those at the nodes that dividing the element there adds; `None` if no
    /// temperatures are given at nodes. `to_corner`: the place half-way to a corner of the element.
    fn temperatures_when_divided(
        &self,
        element: &Element,
        side: &Edge,
        xi: f64,
        to_corner: impl Fn(usize) -> [f64; 2],
    ) -> Option<(f64, Vec<f64>)> {
        if self.temperatures.is_empty() {
            return None;
        }
        let at = |node: u32| self.temperatures[node as usize];
        let on_side = |xi: f64| edge3::interpolate(&edge3::shape(xi), &side.map(at));
        let family = element.family();
        let inside = |k: usize| {
            let nodes = element.iter().zip(family.shape(to_corner(k)));
            nodes.map(|(node, h)| h * at(*node)).sum::<f64>()
        };
        let mut new = vec![on_side(0.5 * (xi - 1.0)), on_side(0.5 * (xi + 1.0))];
        new.extend((2..family.corners()).map(inside));
        Some((on_side(xi), new))
    }

    /// Whether a set names the midside of a side without its ends: then a force or support of the set must not move
    /// with the midside.
    fn has_midside_alone(&self, [a, b, mid]: &Edge) -> bool {
        let alone = |set: &Vec<u32>| set.contains(mid) && !(set.contains(a) && set.contains(b));
        self.node_sets.values().any(alone)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{check_inverted, grid_mesh};
    use crate::problem::Grid;

    fn area(mesh: &Mesh) -> f64 {
        let of = |element: &Element| {
            let (family, nodes) = (element.family(), mesh.element_nodes(element));
            let rule = family.rule(3).iter();
            rule.map(|point| point.weight * family.map(&nodes, point.place).det)
                .sum::<f64>()
        };
        mesh.elements.iter().map(of).sum()
    }

    /// A divided side has a node at the place, and no elements overlap: for every side of a grid, of quadrilaterals and
    /// then of the triangles that they became, from either end.
    #[test]
    fn a_divided_side_has_a_node_at_the_place_and_nothing_overlaps() {
        let mut mesh = grid_mesh(&Grid {
            x: vec![0.0, 1.0, 2.5],
            y: vec![0.0, 1.0, 3.0],
            top: None,
            bottom: None,
        });
        mesh.groups.insert("all".to_owned(), (0..4).collect());
        let whole = area(&mesh);
        for name in ["top", "bottom", "left", "right"] {
            for xi in [-0.4, 0.7] {
                let edge = mesh.boundaries[name][0];
                let [a, b, _] = mesh.edge_nodes(&edge);
                assert!(mesh.divide_side(edge, xi), "{name}");
                let part = 0.5 * (1.0 + xi);
                let p = [0, 1].map(|k| a[k] + part * (b[k] - a[k]));
                let [first, second] = [0, 1].map(|k| mesh.boundaries[name][k]);
                assert_eq!(
                    (first[0], first[1], second[1]),
                    (edge[0], second[0], edge[1])
                );
                let found = mesh.nodes[first[1] as usize];
                assert!((0..2).all(|k| (found[k] - p[k]).abs() < 1e-14), "{name}");
                assert!((area(&mesh) - whole).abs() < 1e-13);
                assert!(check_inverted(&mesh, true, |_| String::new(), "").is_ok());
                assert_eq!(mesh.groups["all"].len(), mesh.elements.len());
            }
        }
        let edge = mesh.boundaries["top"][0];
        let before = mesh.clone();
        assert!(!mesh.divide_side(edge, 1e-5 - 1.0));
        assert_eq!(mesh, before);
    }
}
