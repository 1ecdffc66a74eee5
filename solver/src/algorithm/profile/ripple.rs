//! The ripple of σ_t where the body sticks: it rises towards the ends of each edge, or towards the middle of each, above the curve
//! through the means of the edges.
//!
//! Under the incremental law a contact that grows from node to node leaves it: the anchors of an edge are set when its nodes begin to
//! touch, one after the other. Sums over edges are right, single values are not.

use super::{Highest, PatchView};
use crate::contact::edge_nodes;
use crate::problem::History;

/// The number of edges on either side of a peak of σ_t on which a ripple counts.
const REACH: usize = 3;

/// The part of the largest σ_t above which a ripple beside it is told as an oscillation: what the verdict `good` promises of a peak.
const OSCILLATES: f64 = 0.05;

impl PatchView<'_> {
    /// How far a ripple beside a peak of σ_t lifts it (stress), the largest of the edges around; 0 without a ripple.
    pub(super) fn ripple_at(&self, Highest { value, edge, .. }: Highest) -> f64 {
        let friction = self.patch.contact.friction.as_ref();
        if friction.is_none_or(|law| law.history == History::Total) {
            return 0.0;
        }
        let last = self.patch.contact.boundary.edge_count() - 1;
        let around = edge.saturating_sub(REACH)..=(edge + REACH).min(last);
        let lifts = around.filter_map(|edge| self.lift(edge, value.signum()));
        lifts.fold(0.0, f64::max).min(value.abs())
    }

    /// The ripple beside the peak of σ_t as a part of the peak, if it is large enough to be told.
    pub(super) fn large_ripple(&self) -> Option<f64> {
        let highest = self.highest_traction()?;
        let part = self.ripple_at(highest) / highest.value.abs();
        (part > OSCILLATES).then_some(part)
    }

    /// How far σ_t in the direction `sign` rises within an edge above its mean, less what the means of the edges beside it explain
    /// (stress). None if not all of the edge sticks, or there is no edge beside it.
    fn lift(&self, edge: usize, sign: f64) -> Option<f64> {
        let places = [-1.0, 0.0, 1.0];
        let law = self.patch.law.as_ref()?;
        let sticks = |xi: &f64| law.phi(self.slip_at(edge, *xi)).abs() < 1.0;
        let mean = self
            .mean_traction(edge)
            .filter(|_| places.iter().all(sticks))?;
        let [start, middle, end] = places.map(|xi| self.tangential_stress_at(edge, xi));
        let at_ends = 0.5 * (start + end);
        let before = (edge.checked_sub(1)).and_then(|edge| self.mean_traction(edge))?;
        let after = self.mean_traction(edge + 1)?;
        let centre = |edge: usize| {
            let [start, end, _] = self.patch.contact.boundary.edge_arc(edge);
            (0.5 * (start + end), end - start)
        };
        let ((left, _), (here, length), (right, _)) =
            (centre(edge - 1), centre(edge), centre(edge + 1));
        let bend = (after - mean) / (right - here) - (mean - before) / (here - left);
        // the change of the slope along the edge, times its length: of a parabola the ends are a twelfth of it above the mean, and
        // the middle is a twenty-fourth below it
        let bend = 2.0 * bend / (right - left) * length * length;
        let at_ends = sign * (at_ends - mean - bend / 12.0);
        let in_middle = sign * (middle - mean + bend / 24.0);
        Some(at_ends.max(in_middle))
    }

    /// The mean of σ_t on an edge on which all nodes touch (stress); none on others, and beyond the last.
    fn mean_traction(&self, edge: usize) -> Option<f64> {
        let within = edge < self.patch.contact.boundary.edge_count();
        let touches = within && edge_nodes(edge).iter().all(|i| self.engaged(*i));
        touches.then(|| {
            let [start, middle, end] =
                [-1.0, 0.0, 1.0].map(|xi| self.tangential_stress_at(edge, xi));
            (start + 4.0 * middle + end) / 6.0
        })
    }
}
