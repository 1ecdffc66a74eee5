//! A warning where strains are not small, as linear elasticity assumes. Strains are judged where the load acts, and not
//! by the size of the body.

use crate::algorithm::system::{Patch, System};
use crate::contact::edge_nodes;
use crate::elasticity::{COMPONENTS, Recovered, inverse};
use crate::model::Model;
use crate::solution::{Warning, WarningCode};

/// The mean strain of the elements in contact above which linear elasticity is only a guess: at a quarter the common
/// measures of finite strain (ln λ, λ − 1, (λ² − 1)/2) already differ from each other by an eighth. The thesis's
/// examples reach 0.22.
const LARGE_STRAIN: f64 = 0.25;

/// The largest displacement that counts as small, as a part of the body's size.
const LARGE_DISPLACEMENT: f64 = 0.1;

/// A warning about the contact with the largest strain, or else about displacements that are large compared with the
/// body. `slides`: the body slides too far, which has a warning already, so that its displacements have none.
pub(super) fn large_strain(
    system: &System<'_>,
    active: &[bool],
    recovered: &Recovered,
    displacements: &[[f64; 2]],
    slides: bool,
) -> Option<Warning> {
    let model = system.model;
    let strains = system
        .patches
        .iter()
        .map(|patch| (patch, mean_strain(model, patch, active, recovered)));
    let largest = strains.max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((patch, strain)) = largest.filter(|(_, strain)| *strain > LARGE_STRAIN) {
        return Some(Warning {
            code: WarningCode::LargeStrain,
            pointer: patch.contact.pointer.clone(),
            message: format!(
                "The material in contact is strained by {:.0} % on average: linear elasticity is valid up to a few per cent. Forces and stresses are those of the linear model, not of a real material. Press less, or use a program for large strains.",
                100.0 * strain
            ),
        });
    }
    let size = model.mesh.extent(0).hypot(model.mesh.extent(1));
    let lengths = displacements.iter().map(|[x, y]| x.hypot(*y));
    let largest = lengths.fold(0.0, f64::max);
    (largest > LARGE_DISPLACEMENT * size && !slides).then(|| Warning {
        code: WarningCode::LargeDisplacement,
        pointer: String::new(),
        message: format!(
            "The largest displacement, {largest:.4}, is {:.0} % of the body's size: linear elasticity is no longer accurate.",
            100.0 * largest / size
        ),
    })
}

/// The largest principal strain in size, averaged over the volume of the elements with a side in contact.
fn mean_strain(model: &Model, patch: &Patch<'_>, active: &[bool], recovered: &Recovered) -> f64 {
    let boundary = &patch.contact.boundary;
    let mut midsides: Vec<u32> = (0..boundary.edge_count())
        .map(edge_nodes)
        .filter(|nodes| nodes.iter().all(|i| active[patch.first + i]))
        .map(|[_, _, midside]| boundary.nodes[midside])
        .collect();
    midsides.sort_unstable();
    let (mesh, section) = (&model.mesh, &model.section);
    let mut first = 0;
    let (mut sum, mut volume) = (0.0, 0.0);
    for (e, element) in mesh.elements.iter().enumerate() {
        let (family, nodes) = (element.family(), mesh.element_nodes(element));
        let rule = family.rule(model.quadrature);
        let own = first..first + rule.len();
        first = own.end;
        let mut sides = element.sides();
        if !sides.any(|[_, _, midside]| midsides.binary_search(&midside).is_ok()) {
            continue;
        }
        let compliance = inverse(&section.materials()[section.material_of(e)]).unwrap_or_default();
        for (point, stress) in rule.iter().zip(own.map(|point| recovered.at_point(point))) {
            let m = family.map(&nodes, point.place);
            let weight = point.weight * m.det * section.depth(m.x);
            let strain = |i: usize| {
                (0..COMPONENTS)
                    .map(|j| compliance[i][j] * stress[j])
                    .sum::<f64>()
            };
            sum += weight * principal(std::array::from_fn(strain));
            volume += weight;
        }
    }
    if volume > 0.0 { sum / volume } else { 0.0 }
}

/// The principal strain that is largest in size, from the components xx, yy, 2xy and zz.
fn principal([x, y, twice_xy, z]: [f64; COMPONENTS]) -> f64 {
    let radius = (0.5 * (x - y)).hypot(0.5 * twice_xy);
    ((0.5 * (x + y)).abs() + radius).max(z.abs())
}
