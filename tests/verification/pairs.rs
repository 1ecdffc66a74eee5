//! The quantities of one problem on two meshes, side by side.

use std::collections::BTreeMap;

use solver::solution::{EstimatedQuantity, QuantityName, Summary};

/// Each quantity with the same one on another mesh. Those of a kind are in the order of their values; where one of the
/// meshes has more of a kind, as ends of contact that appear or vanish, that kind is left out.
pub(crate) fn pairs<'a>(
    own: &'a Summary,
    other: &'a Summary,
) -> Vec<(&'a EstimatedQuantity, &'a EstimatedQuantity)> {
    let mut others = by_kind(other);
    let same = by_kind(own).into_iter().filter_map(|(name, kind)| {
        let others = others.remove(&name)?;
        (others.len() == kind.len()).then(|| kind.into_iter().zip(others))
    });
    same.flatten().collect()
}

/// How far the two are apart. A peak of σ_t has the same size on both sides of a symmetric problem.
pub(crate) fn distance(a: &EstimatedQuantity, b: &EstimatedQuantity) -> f64 {
    match a.quantity {
        QuantityName::PeakTangentialStress => (a.value.abs() - b.value.abs()).abs(),
        _ => (a.value - b.value).abs(),
    }
}

fn by_kind(summary: &Summary) -> BTreeMap<QuantityName, Vec<&EstimatedQuantity>> {
    let mut kinds: BTreeMap<QuantityName, Vec<&EstimatedQuantity>> = BTreeMap::new();
    for estimated in &summary.accuracy.as_ref().unwrap().quantities {
        kinds.entry(estimated.quantity).or_default().push(estimated);
    }
    for kind in kinds.values_mut() {
        kind.sort_by(|a, b| a.value.total_cmp(&b.value));
    }
    kinds
}
