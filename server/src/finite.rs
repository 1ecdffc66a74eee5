//! Whether every number of a result is one. JSON has no word for NaN and infinity, and writers put
//! null in their place without a word of their own; so it is asked before anything is written.
//!
//! Structures are taken apart by all their fields: a field added later does not compile until it
//! has its place here.

use solver::solution::{
    Comparison, ContactProfile, ContactSummary, ErrorEstimate, Fields, ForcePair, GaussFields,
    Iteration, Peak, Refinement, Residuals, Solution, StepSolution, Summary,
};

/// Whether every number of a solution is finite.
pub fn solution(solution: &Solution) -> bool {
    let Solution {
        summary: scalars,
        history,
        profiles,
        friction_profiles,
        steps,
        fields: nodes,
    } = solution;
    summary(scalars)
        && history.iter().all(iteration)
        && profiles.values().all(profile)
        && friction_profiles.values().all(profile)
        && steps.iter().all(step)
        && fields(nodes)
}

/// Whether every number of a row of history is finite.
#[rustfmt::skip]
pub fn iteration(row: &Iteration) -> bool {
    let Iteration {
        residual, friction_residual, r_f, tolerance, force: ForcePair { normal, tangential }, contraction, wall_s,
        k: _, stage: _, step: _, increment: _, contact: _, friction: _, inner: _,
    } = row;
    all(&[*residual, *friction_residual, *tolerance, *normal, *tangential, *wall_s]) && some(*r_f) && some(*contraction)
}

#[rustfmt::skip]
fn summary(summary: &Summary) -> bool {
    let Summary {
        normal_force, tangential_force, friction_force, contacts, contraction, energy, friction_work,
        residuals: Residuals { kkt, friction, monolithic, equilibrium },
        error_estimate: ErrorEstimate { error, energy_norm, relative }, uniqueness, doubled_increments, refinements,
        outcome: _, converged: _, iterations: _, stage: _, warnings: _, dofs: _, contact_dofs: _, increments: _, cut_backs: _,
    } = summary;
    all(&[*error, *energy_norm, *relative])
        && [uniqueness, doubled_increments].into_iter().flatten().all(comparison)
        && refinements.iter().all(refinement)
        && all(&[*normal_force, *tangential_force, *friction_force, *energy, *friction_work])
        && all(&[*kkt, *friction, *monolithic, *equilibrium])
        && some(*contraction)
        && contacts.values().all(contact)
}

#[rustfmt::skip]
fn comparison(comparison: &Comparison) -> bool {
    let Comparison { normal_force, tangential_force, friction_force, change, agrees: _, converged: _ } = comparison;
    all(&[*normal_force, *tangential_force, *friction_force, *change])
}

#[rustfmt::skip]
fn refinement(refinement: &Refinement) -> bool {
    let Refinement {
        normal_force, tangential_force, friction_force, peak_tangential_stress, peak_normal_stress, change,
        elements: _, dofs: _,
    } = refinement;
    all(&[*normal_force, *tangential_force, *friction_force, *peak_tangential_stress, *peak_normal_stress])
        && some(*change)
}

fn step(step: &StepSolution) -> bool {
    let StepSolution {
        summary: scalars,
        history,
        profiles,
        friction_profiles,
        name: _,
    } = step;
    let mut columns = profiles.values().chain(friction_profiles.values());
    summary(scalars) && history.iter().all(iteration) && columns.all(profile)
}

#[rustfmt::skip]
fn contact(contact: &ContactSummary) -> bool {
    let ContactSummary {
        normal_force, tangential_force, friction_force, contact, stick, slip, peak_normal_stress, peak_tangential_stress,
        normal: _,
    } = contact;
    let peak = |peak: &Peak| all(&[peak.value, peak.s, peak.x, peak.y]);
    all(&[*normal_force, *tangential_force, *friction_force])
        && [contact, stick, slip].into_iter().flatten().all(|range| all(range))
        && [peak_normal_stress, peak_tangential_stress].into_iter().flatten().all(peak)
}

#[rustfmt::skip]
fn profile(profile: &ContactProfile) -> bool {
    let ContactProfile {
        s, x, y, gap, normal_displacement, tangential_displacement, normal_stress, tangential_stress,
        nonlocal_pressure, friction_bound, friction_ratio, state: _,
    } = profile;
    [
        s, x, y, gap, normal_displacement, tangential_displacement, normal_stress, tangential_stress,
        nonlocal_pressure, friction_bound, friction_ratio,
    ].into_iter().all(|column| all(column))
}

#[rustfmt::skip]
fn fields(fields: &Fields) -> bool {
    let Fields { x, y, ux, uy, stress_xx, stress_yy, stress_xy, stress_zz, element_error, gauss, elements: _, contact_state: _ } = fields;
    let GaussFields { x: gx, y: gy, stress_xx: gxx, stress_yy: gyy, stress_xy: gxy, stress_zz: gzz, order: _ } = gauss;
    [x, y, ux, uy, stress_xx, stress_yy, stress_xy, stress_zz, element_error, gx, gy, gxx, gyy, gxy, gzz]
        .into_iter()
        .all(|column| all(column))
}

fn all(numbers: &[f64]) -> bool {
    numbers.iter().all(|number| number.is_finite())
}

fn some(number: Option<f64>) -> bool {
    number.is_none_or(f64::is_finite)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake;

    #[test]
    fn one_bad_number_anywhere_is_found() {
        assert!(solution(&fake::solution()));
        for spoil in [
            |s: &mut Solution| s.summary.energy = f64::NAN,
            |s: &mut Solution| s.summary.contraction = Some(f64::NAN),
            |s: &mut Solution| s.history[0].residual = f64::INFINITY,
            |s: &mut Solution| s.fields.ux[0] = f64::NAN,
            |s: &mut Solution| s.fields.gauss.x.push(f64::NAN),
            |s: &mut Solution| {
                s.profiles
                    .values_mut()
                    .for_each(|p| p.gap[1] = f64::NEG_INFINITY)
            },
        ] {
            let mut spoiled = fake::solution();
            spoil(&mut spoiled);
            assert!(!solution(&spoiled));
        }
    }
}
