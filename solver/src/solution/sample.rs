//! Evaluates a stored profile at any number of points, without solving again.

use super::ContactProfile;
use crate::element::edge3;

/// A place counts as a node if they are closer than this fraction of the whole length, which is the rounding of `s`.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// The columns of a profile at `count` places, equally spaced in arc length from the first node of Γ_C to the last;
/// units and signs are those of [`ContactProfile`].
///
/// `profile` has values at the nodes, `friction` at the friction points of the same Γ_C and the same step (it may be
/// empty: results stored by older versions have none). Nothing is solved or averaged again.
///
/// - positions, gap, displacements and normal stress are the quadratics through the three nodes of an edge: exact,
///   since the solution is quadratic. (Contact uses the gap at nodes; between them the obstacle itself may be
///   elsewhere.) But beside a steep peak the parabola may overshoot into a tension that no contact has: between three
///   nodes without tension there is no tension.
/// - tangential stress, nonlocal pressure, friction bound and ratio are those of the law at nodes and
///   friction points, five per edge with Gauss points, and curves between them: of the two parabolas in s through a
///   third neighbour the flatter one, and the straight line where they bend to opposite sides. So a
///   quadratic is exact, a smooth column is accurate to third order, and the corners of the law, at the end of
///   contact or of stick, cause no oscillation nearby. Bound ≥ 0 and
///   0 ≤ ratio ≤ 1 are kept.
/// - the state is that of the nearest node or friction point.
///
/// At a node all columns are those of the node.
pub fn sample(profile: &ContactProfile, friction: &ContactProfile, count: usize) -> ContactProfile {
    let mut sampled = ContactProfile::default();
    let edges = edges(profile);
    if edges == 0 {
        return sampled;
    }
    let known = Known::new(profile, friction);
    let (first, last) = (profile.s[0], profile.s[2 * edges]);
    for k in 0..count {
        let s = match k {
            0 => first,
            _ if k == count - 1 => last,
            _ => first + (last - first) * (k as f64 / (count - 1) as f64),
        };
        sampled.push_row(&known.at(s), 0);
    }
    sampled
}

/// The columns of a profile at all points where the solution is known: the nodes, the points where friction acts, and
/// the places of the peaks, for one contact, each in order of arc length. So the largest stresses of these columns are
/// the peaks. Between three nodes without tension there is no tension, as in [`sample`].
pub fn at_all_points(
    profile: &ContactProfile,
    friction: &ContactProfile,
    peaks: &ContactProfile,
) -> ContactProfile {
    let edges = edges(profile);
    if edges == 0 {
        return profile.clone();
    }
    let close = ROUNDING * (profile.s[2 * edges] - profile.s[0]);
    let mut all = Known::new(profile, friction).values;
    for (k, s) in peaks.s.iter().enumerate() {
        let row = all.s.partition_point(|other| *other < s - close);
        // at a node the law may have two values, of which the profile shows the mean: here the larger
        if all.s.get(row).is_some_and(|other| *other <= s + close) {
            all.remove_row(row);
        }
        all.insert_row(row, peaks, k);
    }
    all
}

/// The number of edges of a profile. Γ_C is a chain of edges, with nodes start, midside, end; each end is the next
/// edge's start.
fn edges(profile: &ContactProfile) -> usize {
    profile.s.len().saturating_sub(1) / 2
}

/// Values at nodes and friction points, in order of arc length.
struct Known<'a> {
    nodes: &'a ContactProfile,
    values: ContactProfile,
}

impl<'a> Known<'a> {
    fn new(nodes: &'a ContactProfile, friction: &ContactProfile) -> Self {
        let mut values = ContactProfile::default();
        let mut next = 0;
        for (node, s) in nodes.s.iter().enumerate() {
            while next < friction.s.len() && friction.s[next] <= *s {
                // the middle Gauss point of an edge is its midside: the node's values count
                if friction.s[next] < *s {
                    values.push_row(friction, next);
                    let edge = node.saturating_sub(1) / 2;
                    if let Some(stress) = values.normal_stress.last_mut() {
                        *stress = without_overshoot(nodes, edge, *stress);
                    }
                }
                next += 1;
            }
            values.push_row(nodes, node);
        }
        Known { nodes, values }
    }

    /// The values of all columns at arc length `s`.
    fn at(&self, s: f64) -> ContactProfile {
        let (nodes, values) = (self.nodes, &self.values);
        let edges = edges(nodes);
        // the first edge that does not end before s
        let before = nodes.s.partition_point(|other| *other < s);
        let edge = (before.saturating_sub(1) / 2).min(edges - 1);
        let corners = [2 * edge, 2 * edge + 2, 2 * edge + 1];
        let mut row = ContactProfile::default();
        let length = nodes.s[2 * edges] - nodes.s[0];
        let same = |i: &usize| (nodes.s[*i] - s).abs() <= ROUNDING * length;
        if let Some(node) = corners.into_iter().find(same) {
            row.push_row(nodes, node);
            return row;
        }
        let interval = values.s.partition_point(|other| *other < s).max(1) - 1;
        let interval = interval.min(values.s.len() - 2);
        let h = edge3::shape(edge3::invert(&corners.map(|i| nodes.s[i]), s));
        // + 0.0 turns −0 into 0
        let along = |column: &[f64]| edge3::interpolate(&h, &corners.map(|i| column[i])) + 0.0;
        let between = |column: &[f64]| curve(&values.s, column, interval, s) + 0.0;
        let later = values.s[interval + 1] - s < s - values.s[interval];
        let nearest = interval + usize::from(later);
        ContactProfile {
            s: vec![s],
            x: vec![along(&nodes.x)],
            y: vec![along(&nodes.y)],
            gap: vec![along(&nodes.gap)],
            normal_displacement: vec![along(&nodes.normal_displacement)],
            tangential_displacement: vec![along(&nodes.tangential_displacement)],
            normal_stress: vec![without_overshoot(nodes, edge, along(&nodes.normal_stress))],
            tangential_stress: vec![between(&values.tangential_stress)],
            nonlocal_pressure: vec![between(&values.nonlocal_pressure)],
            friction_bound: vec![between(&values.friction_bound).max(0.0)],
            friction_ratio: vec![between(&values.friction_ratio).clamp(0.0, 1.0)],
            state: vec![values.state[nearest]],
        }
    }
}

/// The normal stress on an edge; tension is left out if none of the edge's three nodes has tension.
fn without_overshoot(nodes: &ContactProfile, edge: usize, stress: f64) -> f64 {
    let of_nodes = &nodes.normal_stress[2 * edge..=2 * edge + 2];
    if of_nodes.iter().all(|of_node| *of_node <= 0.0) {
        stress.min(0.0)
    } else {
        stress
    }
}

/// The value v at a place between s_j and s_{j+1}:
///
///   v_j + (s − s_j) v[j, j+1] + (s − s_j)(s − s_{j+1}) b
///
/// with b the smaller of the second divided differences v[j−1, j, j+1] and v[j, j+1, j+2], 0 where their signs differ,
/// and the only one at the ends.
fn curve(s: &[f64], v: &[f64], j: usize, at: f64) -> f64 {
    let slope = |i: usize| (v[i + 1] - v[i]) / (s[i + 1] - s[i]);
    let bend = |i: usize| (slope(i + 1) - slope(i)) / (s[i + 2] - s[i]);
    let before = (j > 0).then(|| bend(j - 1));
    let after = (j + 2 < s.len()).then(|| bend(j));
    let flatter = match (before, after) {
        (Some(a), Some(b)) if a * b <= 0.0 => 0.0,
        (Some(a), Some(b)) if a.abs() < b.abs() => a,
        (Some(_), Some(b)) => b,
        (a, b) => a.or(b).unwrap_or(0.0),
    };
    v[j] + (at - s[j]) * slope(j) + (at - s[j]) * (at - s[j + 1]) * flatter
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::gauss::GAUSS_3;
    use crate::solution::NodeState;

    /// Columns that are quadratics of s, on edges that end at `corners`.
    fn profiles(corners: &[f64]) -> (ContactProfile, ContactProfile) {
        let (mut nodes, mut points) = (vec![corners[0]], Vec::new());
        for ends in corners.windows(2) {
            let (middle, half) = (0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0]));
            nodes.extend([middle, ends[1]]);
            points.extend(GAUSS_3.map(|(xi, _)| middle + half * xi));
        }
        (quadratics(&nodes), quadratics(&points))
    }

    /// Columns of quadratics: number c is c + s/2 − s²/10 times a factor that keeps bound and ratio in their limits.
    fn quadratics(s: &[f64]) -> ContactProfile {
        let column = |c: f64| {
            s.iter()
                .map(|s| 0.05 * (c + 0.5 * s - 0.1 * s * s))
                .collect()
        };
        ContactProfile {
            s: s.to_vec(),
            x: column(1.0),
            y: column(2.0),
            gap: column(3.0),
            normal_displacement: column(4.0),
            tangential_displacement: column(5.0),
            normal_stress: column(6.0),
            tangential_stress: column(7.0),
            nonlocal_pressure: column(8.0),
            friction_bound: column(9.0),
            friction_ratio: column(10.0),
            state: s
                .iter()
                .map(|s| match *s {
                    s if s < 1.0 => NodeState::Stick,
                    s if s < 2.5 => NodeState::Slip,
                    _ => NodeState::Open,
                })
                .collect(),
        }
    }

    #[test]
    fn at_the_nodes_a_sample_is_the_profile() {
        let (nodal, friction) = profiles(&[0.0, 0.3, 0.6, 0.9]);
        assert_eq!(sample(&nodal, &friction, 7), nodal);
        assert_eq!(sample(&nodal, &ContactProfile::default(), 7), nodal);
        let ends = sample(&nodal, &friction, 2);
        assert_eq!(
            ends.friction_ratio,
            [nodal.friction_ratio[0], nodal.friction_ratio[6]]
        );
    }

    #[test]
    fn quadratics_are_exact_with_and_without_friction_points() {
        let (nodal, friction) = profiles(&[0.0, 0.1, 0.7, 1.9, 3.0]);
        for friction in [friction, ContactProfile::default()] {
            let sampled = sample(&nodal, &friction, 1000);
            assert_eq!((sampled.s[0], sampled.s[999]), (0.0, 3.0));
            let exact = quadratics(&sampled.s);
            for (got, exact) in sampled.columns().into_iter().zip(exact.columns()) {
                assert_eq!(got.len(), 1000);
                for (got, exact) in got.iter().zip(exact) {
                    assert!((got - exact).abs() < 1e-14, "{got} for {exact}");
                }
            }
        }
    }

    #[test]
    fn a_state_reaches_half_way_to_the_next_point() {
        let (nodal, friction) = profiles(&[0.0, 2.0, 4.0]);
        let sampled = sample(&nodal, &friction, 4001);
        let turns = |state| sampled.state.iter().filter(|s| **s == state).count();
        // the last point that sticks is the Gauss point at 1 − √.6, the first that slips the node at 1
        let stick = 1000.0 * (1.0 - 0.5 * 0.6f64.sqrt());
        assert_eq!(turns(NodeState::Stick), stick as usize + 1);
        assert_eq!(sampled.state[4000], NodeState::Open);
    }

    /// There is no tension between nodes without one, although the parabola through −100, 0 and 0 has 12.5 between the
    /// last two.
    #[test]
    fn there_is_no_tension_between_nodes_without_one() {
        let (mut nodal, mut friction) = profiles(&[0.0, 1.0]);
        let at = |s: &[f64]| {
            s.iter()
                .map(|s| -100.0 * (1.0 - 2.0 * s) * (1.0 - s))
                .collect()
        };
        nodal.normal_stress = at(&nodal.s);
        friction.normal_stress = at(&friction.s);
        assert!(friction.normal_stress[2] > 8.0);
        let sampled = sample(&nodal, &friction, 5);
        assert_eq!(sampled.normal_stress, [-100.0, -37.5, 0.0, 0.0, 0.0]);
        let all = at_all_points(&nodal, &friction, &ContactProfile::default());
        assert_eq!(all.normal_stress[1], friction.normal_stress[0]);
        assert_eq!(all.normal_stress[2..], [0.0; 3]);
        // where a node is pulled, what lies beside it is as it was solved
        nodal.normal_stress[2] = 1.0;
        let sampled = sample(&nodal, &friction, 5);
        assert_eq!(sampled.normal_stress[3], 12.5 + 0.375);
    }

    /// Corners of the law (φ at the end of stick, τ at the end of contact) cause no oscillation.
    #[test]
    fn corners_of_the_law_stay_within_their_limits() {
        let (mut nodal, mut friction) = profiles(&[0.0, 1.0, 2.0, 3.0]);
        for profile in [&mut nodal, &mut friction] {
            for (i, s) in profile.s.clone().into_iter().enumerate() {
                profile.friction_ratio[i] = (s / 0.9).min(1.0);
                profile.friction_bound[i] = (2.2 - s).max(0.0);
                profile.tangential_stress[i] = -profile.friction_bound[i];
            }
        }
        let sampled = sample(&nodal, &friction, 777);
        for i in 0..777 {
            let (s, tau) = (sampled.s[i], sampled.friction_bound[i]);
            assert!((0.0..=1.0).contains(&sampled.friction_ratio[i]));
            assert!((0.0..=2.2).contains(&tau));
            assert!((tau - (2.2 - s).max(0.0)).abs() < 0.1, "{s}: {tau}");
            assert_eq!(sampled.tangential_stress[i] + tau, 0.0, "{s}");
        }
    }
}
