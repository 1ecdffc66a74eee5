//! Elements whose weighted errors exceed those of the elements around them, at a singular point of the stresses.
//!
//! At a corner of the supports, a reentrant corner, the end of a load or of an interface, stresses grow without limit.
//! The elements that meet there hold most of the error that the body contributes, however fine the mesh is. Recovery
//! sees only a part of that error: a fifth at a clamped corner of an orthotropic body, where one element has no
//! neighbour to be compared with. Such points are found from the errors themselves, whatever their cause.
//!
//! A body continues beyond a line of symmetry: elements there also have mirror images as neighbours, with the same
//! errors. Half a model is therefore judged like the whole model.

use crate::contact::edge_normals;
use crate::model::{Held, Model};

/// By node of a mesh, the elements that meet at the node, and the elements around these.
pub(super) struct Surroundings {
    /// By node: the elements that have the node as a corner.
    stars: ByNode,
    /// By node: the elements, mirror images included, that share a corner with an element of the star but are not in
    /// it.
    rings: ByNode,
}

/// A list of elements for each node, all in one.
struct ByNode {
    elements: Vec<u32>,
    /// By node: where its list starts; then the end of the last one.
    starts: Vec<usize>,
}

impl ByNode {
    fn of(&self, node: usize) -> &[u32] {
        &self.elements[self.starts[node]..self.starts[node + 1]]
    }
}

/// A set of lines of symmetry, one bit each: for lines across x, and for other lines.
type Lines = u8;

/// An element, or its mirror image in the given lines of symmetry.
type Imaged = (u32, Lines);

impl Surroundings {
    pub(super) fn new(model: &Model) -> Self {
        let mesh = &model.mesh;
        let corners = |e: u32| {
            let element = &mesh.elements[e as usize];
            &element[..element.family().corners()]
        };
        let all = 0..mesh.elements.len() as u32;
        let mut starts = vec![0; mesh.nodes.len()];
        for &node in all.clone().flat_map(corners) {
            starts[node as usize] += 1;
        }
        // at first the ends
        let count = starts.iter_mut().fold(0, |before, end| {
            *end += before;
            *end
        });
        let mut elements = vec![0; count];
        // from the last to the first, so that each list is in order, and each end becomes a start
        for e in all.rev() {
            for &node in corners(e) {
                let place = &mut starts[node as usize];
                *place -= 1;
                elements[*place] = e;
            }
        }
        starts.push(count);
        let stars = ByNode { elements, starts };
        let lines = lines_of_symmetry(model);
        // by element and images: the last node in whose star or ring it was put
        let mut met = vec![[u32::MAX; 4]; mesh.elements.len()];
        let mut rings = ByNode {
            elements: Vec::with_capacity(4 * count),
            starts: Vec::with_capacity(mesh.nodes.len() + 1),
        };
        rings.starts.push(0);
        let mut ring: Vec<Imaged> = Vec::new();
        for (node, of_node) in lines.iter().enumerate() {
            // of what meets at a node with its images, one of each is enough: all are there as often
            let mut is_new = |(e, images): Imaged| {
                let met = &mut met[e as usize][usize::from(images)];
                std::mem::replace(met, node as u32) != node as u32
            };
            let star = stars.of(node);
            star.iter().for_each(|e| _ = is_new((*e, 0)));
            ring.clear();
            for corner in star.iter().flat_map(|e| corners(*e)) {
                let own = lines[*corner as usize];
                for images in (0..=own).filter(|images| images & !own == 0) {
                    let around = stars.of(*corner as usize).iter();
                    let around = around.map(|e| (*e, images & !of_node));
                    ring.extend(around.filter(|imaged| is_new(*imaged)));
                }
            }
            ring.sort_unstable();
            rings.elements.extend(ring.iter().map(|(e, _)| *e));
            rings.starts.push(rings.elements.len());
        }
        Surroundings { stars, rings }
    }

    /// By element, the part of its error that stands out. At a node with the errors a of the elements that meet there
    /// and b of the elements around these, that part is 1 − b/a; an element has the largest part of its corners, at
    /// least 0.
    pub(super) fn standing_out(&self, errors: &[f64]) -> Vec<f64> {
        let sum = |elements: &[u32]| -> f64 {
            let errors = elements.iter().map(|e| errors[*e as usize].abs());
            errors.sum()
        };
        let mut parts = vec![0.0f64; errors.len()];
        for node in 0..self.stars.starts.len() - 1 {
            let star = self.stars.of(node);
            let (own, around) = (sum(star), sum(self.rings.of(node)));
            if own > around {
                for e in star {
                    let part = &mut parts[*e as usize];
                    *part = part.max(1.0 - around / own);
                }
            }
        }
        parts
    }

    /// By element, whether it is away from the given nodes: it has none of them as a corner, and shares no corner with
    /// an element that does.
    pub(super) fn away_from(&self, nodes: impl Iterator<Item = u32>) -> Vec<bool> {
        let last = self.stars.elements.iter().max();
        let count = last.map_or(0, |e| *e as usize + 1);
        let mut away = vec![true; count];
        for node in nodes.map(|node| node as usize) {
            let near = self.stars.of(node).iter().chain(self.rings.of(node));
            near.for_each(|e| away[*e as usize] = false);
        }
        away
    }
}

/// By node, the lines of symmetry through the node: straight sides whose nodes are held across the side and free along
/// it.
fn lines_of_symmetry(model: &Model) -> Vec<Lines> {
    let mut lines = vec![0; model.mesh.nodes.len()];
    for side in model.mesh.surface() {
        let normals = edge_normals(&model.mesh.edge_nodes(&side));
        let held = |node: u32, normal: [f64; 2]| {
            let held = model.fixed.get(&node);
            held.is_some_and(|held| held.along(normal) == Some(0.0))
        };
        let free_along = matches!(model.fixed.get(&side[2]), Some(Held::Along { .. }));
        let across_x = normals[2][0].abs() > normals[2][1].abs();
        // around an axis the body goes on in a circle
        let mirrors = free_along && !(across_x && model.section.axisymmetric());
        if mirrors && side.iter().zip(normals).all(|(node, n)| held(*node, n)) {
            let line = if across_x { 1 } else { 2 };
            side.iter().for_each(|node| lines[*node as usize] |= line);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn surroundings(x: &[i32], y: &[i32], supports: &serde_json::Value) -> (Model, Surroundings) {
        let problem = serde_json::json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": x, "y": y}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": supports,
            "contacts": [],
        });
        let problem = serde_json::from_value(problem).unwrap();
        let model = Model::new(&problem, None).unwrap();
        let surroundings = Surroundings::new(&model);
        (model, surroundings)
    }

    /// Errors that are symmetric about two lines stand out equally in a quarter, a half and the whole of a body,
    /// wherever they are largest. A clamped side is no line of symmetry.
    #[test]
    fn parts_of_a_symmetric_body_judge_as_the_whole() {
        let (half, whole) = ([0, 1, 2, 3, 4], [-4, -3, -2, -1, 0, 1, 2, 3, 4]);
        let left = serde_json::json!({"boundary": "left", "ux": 0});
        let bottom = serde_json::json!({"boundary": "bottom", "uy": 0});
        let clamped = serde_json::json!({"boundary": "top", "ux": 0, "uy": 0});
        let bodies = [
            surroundings(&half, &half, &serde_json::json!([left, bottom, clamped])),
            surroundings(&whole, &half, &serde_json::json!([bottom, clamped])),
            surroundings(&half, &whole, &serde_json::json!([left, clamped])),
            surroundings(&whole, &whole, &serde_json::json!([clamped])),
        ];
        let centre = |model: &Model, e: usize| {
            let corners = model.mesh.elements[e][..4].iter();
            let sum = corners.fold([0.0; 2], |[a, b], node| {
                let [x, y] = model.mesh.nodes[*node as usize];
                [a + x, b + y]
            });
            sum.map(|x| 0.25 * x)
        };
        for largest in 0..16 {
            let at = centre(&bodies[0].0, largest);
            let part = |(model, surroundings): &(Model, Surroundings)| {
                let count = model.mesh.elements.len();
                let errors = (0..count).map(|e| {
                    let [x, y] = centre(model, e).map(f64::abs);
                    let distance = (x - at[0]).hypot(y - at[1]);
                    1e-3 * (1.0 + x + 7.0 * y) + (-2.0 * distance).exp()
                });
                let out = surroundings.standing_out(&errors.collect::<Vec<_>>());
                let quarter = (0..count).filter(|e| centre(model, *e).iter().all(|x| *x > 0.0));
                quarter.map(|e| out[e]).collect::<Vec<f64>>()
            };
            let whole = part(&bodies[3]);
            assert!(whole.iter().any(|part| *part > 0.1), "{whole:?}");
            for body in &bodies[..3] {
                let off = part(body)
                    .into_iter()
                    .zip(&whole)
                    .map(|(a, b)| (a - b).abs());
                let most = off.fold(0.0, f64::max);
                assert!(most < 1e-12, "{largest}: {most}");
            }
        }
    }
}
