//! Elements whose weighted errors stand out from those around them: at a singular point of the stresses.
//!
//! At a corner of the supports, a reentrant corner, the end of a load or of an interface stresses grow without limit, and
//! the elements that meet there hold most of what the body adds to an error, however fine the mesh. Recovery sees only a
//! part of that: a fifth at a clamped corner of an orthotropic body, where one element has nothing to be compared with. Such
//! points are found by the errors themselves, whatever they come from.

use crate::mesh::Mesh;

/// The elements around every corner node of a mesh.
pub(super) struct Surroundings {
    /// By node: the elements that meet there.
    stars: Vec<Vec<u32>>,
    /// By node: the other elements that share a corner with one of these.
    rings: Vec<Vec<u32>>,
}

impl Surroundings {
    pub(super) fn new(mesh: &Mesh) -> Self {
        let corners = |e: u32| {
            let element = &mesh.elements[e as usize];
            &element[..element.family().corners()]
        };
        let mut stars = vec![Vec::new(); mesh.nodes.len()];
        for e in 0..mesh.elements.len() as u32 {
            corners(e)
                .iter()
                .for_each(|&node| stars[node as usize].push(e));
        }
        let ring = |star: &Vec<u32>| {
            let nodes = star.iter().flat_map(|e| corners(*e));
            let mut ring: Vec<u32> = nodes.flat_map(|n| stars[*n as usize].clone()).collect();
            ring.sort_unstable();
            ring.dedup();
            ring.retain(|e| !star.contains(e));
            ring
        };
        let rings = stars.iter().map(ring).collect();
        Surroundings { stars, rings }
    }

    /// By element, what part of its error stands out: by how much the errors of the elements at one of its corners are more
    /// than those of all around them, in parts of them.
    pub(super) fn standing_out(&self, errors: &[f64]) -> Vec<f64> {
        let sum = |elements: &[u32]| -> f64 {
            let errors = elements.iter().map(|e| errors[*e as usize].abs());
            errors.sum()
        };
        let mut parts = vec![0.0f64; errors.len()];
        for (star, ring) in self.stars.iter().zip(&self.rings) {
            let (own, around) = (sum(star), sum(ring));
            if own > around {
                for e in star {
                    let part = &mut parts[*e as usize];
                    *part = part.max(1.0 - around / own);
                }
            }
        }
        parts
    }

    /// By element, whether it is away from some nodes: it touches none, and shares no corner with one that does.
    pub(super) fn away_from(&self, nodes: impl Iterator<Item = u32>) -> Vec<bool> {
        let count = self
            .stars
            .iter()
            .flatten()
            .max()
            .map_or(0, |e| *e as usize + 1);
        let mut away = vec![true; count];
        for node in nodes.map(|node| node as usize) {
            let near = self.stars[node].iter().chain(&self.rings[node]);
            near.for_each(|e| away[*e as usize] = false);
        }
        away
    }
}
