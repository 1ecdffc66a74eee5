//! The profile along the boundary of the body that faces a contact: what the contact passes on to it.

use std::ops::Range;

use super::PatchView;
use crate::problem::Condition;
use crate::solution::ContactProfile;

/// The least part of the share of a node in the surface that the contact covers, with which it counts as faced: of an edge that
/// is covered in part the shares nearly cancel.
const FACED: f64 = 0.25;

/// The share of a node in the surface, as a part of the largest, that is rounding.
const ON_AXIS: f64 = 1e-9;

impl PatchView<'_> {
    /// Whether a boundary carries the law of a contact.
    pub(in crate::algorithm) fn carries_law(&self, boundary: &str) -> bool {
        let mut contacts = self.system.model.contacts.iter();
        contacts.any(|contact| contact.name == boundary)
    }

    /// The name of the boundary of the other body, and the columns of [`ContactProfile`] at the nodes of those of its edges that the
    /// contact faces; none against an obstacle. Displacements are its own, along its own normal and tangent. The stress at a node is
    /// the force that the contact passes on to it, divided by its share of the surface; averages, bounds and ratios are means with
    /// the same weights. Beside the end of contact that force may be a slight tension, which is left out. `own`: the columns at the nodes
    /// of the contact.
    pub(in crate::algorithm) fn facing_profile(
        &self,
        own: &ContactProfile,
    ) -> Option<(&str, ContactProfile)> {
        let contact = self.patch.contact;
        let (pair, opposite) = (contact.pair.as_ref()?, self.system.opposite.as_ref()?);
        // by node of the other body: nodes of the contact, with their weights
        let mut shares: Vec<Vec<(usize, f64)>> = vec![Vec::new(); pair.nodes.len()];
        for (i, row) in pair.rows.iter().enumerate() {
            for (k, weight) in row {
                shares[*k].push((i, *weight));
            }
        }
        let sum = |share: &[(usize, f64)]| share.iter().map(|(_, part)| part).sum::<f64>();
        let areas = &contact.boundary.weights;
        let largest = pair.weights.iter().copied().fold(0.0, f64::max);
        // a node on the axis has no area: it faces that of the contact
        let at_axis = (0..areas.len()).find(|i| areas[*i] <= ON_AXIS * largest);
        let by_area = |(k, share): (usize, &Vec<(usize, f64)>)| -> Vec<(usize, f64)> {
            if pair.weights[k] <= ON_AXIS * largest {
                return at_axis.into_iter().map(|i| (i, 1.0)).collect();
            }
            let part = |(i, weight): &(usize, f64)| (*i, weight * areas[*i] / pair.weights[k]);
            share.iter().map(part).collect()
        };
        let shares: Vec<Vec<(usize, f64)>> = shares.iter().enumerate().map(by_area).collect();
        let weights: Vec<f64> = shares.iter().map(|share| sum(share)).collect();
        let mut profile = ContactProfile::default();
        for k in faced_edges(&weights) {
            let share = &shares[k];
            let whole = weights[k];
            let [x, y] = opposite.facing_displacement(self.p, k, &self.displaced)?;
            let (most, _) = share.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
            let mean = |column: &[f64]| {
                let parts = share.iter().map(|(i, area)| area * column[*i]);
                parts.sum::<f64>() / whole + 0.0
            };
            let opening = mean(&own.gap) - mean(&own.normal_displacement);
            let [a, b] = pair.normals[k];
            let normal = x * a + y * b;
            profile.s.push(pair.s[k]);
            profile.x.push(pair.positions[k][0]);
            profile.y.push(pair.positions[k][1]);
            profile.gap.push(normal + opening);
            profile.normal_displacement.push(normal);
            profile.tangential_displacement.push(x * b - y * a);
            let (pressed, rubbed) = (mean(&own.normal_stress), mean(&own.tangential_stress));
            let bound = mean(&own.friction_bound).max(0.0);
            profile.normal_stress.push(match contact.condition {
                Condition::Unilateral => pressed.min(0.0),
                _ => pressed,
            });
            profile.tangential_stress.push(match contact.friction {
                Some(_) => rubbed.clamp(-bound, bound),
                None => rubbed,
            });
            profile.nonlocal_pressure.push(mean(&own.nonlocal_pressure));
            profile.friction_bound.push(bound);
            let rubbing = profile.tangential_stress.last().map_or(0.0, |t| t.abs());
            let ratio = if bound > 0.0 { rubbing / bound } else { 0.0 };
            profile.friction_ratio.push(ratio.min(1.0));
            profile.state.push(own.state[*most]);
        }
        Some((&pair.boundary, profile))
    }
}

/// The nodes of the longest run of whole edges whose nodes are covered. `weights`: the part of each that is.
fn faced_edges(weights: &[f64]) -> Range<usize> {
    let whole = |edge: usize| (2 * edge..=2 * edge + 2).all(|k| weights[k] > FACED);
    let (mut longest, mut start) = (0..0, 0);
    for edge in 0..=weights.len() / 2 {
        if edge < weights.len() / 2 && whole(edge) {
            continue;
        }
        if edge - start > longest.len() / 2 {
            longest = 2 * start..2 * edge + 1;
        }
        start = edge + 1;
    }
    longest
}

#[cfg(test)]
mod tests {
    use super::faced_edges;

    #[test]
    fn the_longest_run_of_whole_edges_is_found() {
        assert_eq!(faced_edges(&[1.0; 5]), 0..5);
        assert_eq!(faced_edges(&[0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]), 2..7);
        assert_eq!(
            faced_edges(&[1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0]),
            4..9
        );
        assert_eq!(faced_edges(&[1.0, 0.0, 1.0]), 0..0);
    }
}
