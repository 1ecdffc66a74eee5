//! Adaptive refinement: the mesh-converged values of formulation 5.3 without a hand on the mesh.

use solver::problem::{AdaptiveRefine, Refine};

use crate::record::held;
use crate::support::{example, solve};

/// The error of the peak is below the tolerance.
#[test]
fn adaptive_refinement_finds_the_peak_of_example_1() {
    let mut problem = example("rectangular_punch");
    problem.mesh.refine = Refine::Adaptive(AdaptiveRefine { tolerance: 0.01 });
    let summary = solve(&problem).summary;
    let peak = summary.contacts["top"].peak_tangential_stress.unwrap();
    let mesh = format!(
        "adaptive to .01: {} meshes, {} unknowns",
        summary.refinements.len(),
        summary.dofs
    );
    held(
        0,
        "example 1, ρ = .01: max σ_t",
        &mesh,
        peak.value,
        249.6,
        0.01,
    );
    held(
        0,
        "example 1, ρ = .01: Y",
        &mesh,
        summary.normal_force,
        95.267,
        0.01,
    );
    held(
        0,
        "example 1, ρ = .01: T",
        &mesh,
        summary.tangential_force,
        14.231,
        0.01,
    );
    // the sequence is reported, and begins with the user's own mesh
    assert_eq!(summary.refinements[0].elements, 56);
    assert!((summary.refinements[0].peak_tangential_stress - 443.0).abs() < 1.0);
    assert!(
        summary
            .refinements
            .windows(2)
            .all(|pair| pair[1].elements > pair[0].elements)
    );
}

#[test]
fn adaptive_refinement_finds_the_values_of_a_smooth_contact() {
    let mut problem = example("cylinder");
    problem.mesh.refine = Refine::Adaptive(AdaptiveRefine { tolerance: 0.005 });
    let summary = solve(&problem).summary;
    let mesh = format!("adaptive to .005: {} unknowns", summary.dofs);
    held(
        0,
        "example 2, ρ = .03: Y",
        &mesh,
        summary.normal_force,
        312.870,
        0.005,
    );
    held(
        0,
        "example 2, ρ = .03: T",
        &mesh,
        summary.tangential_force,
        39.070,
        0.005,
    );
    let [_, half_width] = summary.contacts["top"].contact[0];
    held(
        0,
        "example 2: contact half-width",
        &mesh,
        half_width,
        2.1375,
        0.01,
    );
}

#[test]
fn adaptive_refinement_with_a_wrong_tolerance_or_no_contact_is_refused() {
    let mut problem = example("cylinder");
    problem.mesh.refine = Refine::Adaptive(AdaptiveRefine { tolerance: 1.5 });
    problem.contacts.clear();
    let found = solver::check(&problem, None).unwrap_err();
    let pointers: Vec<_> = found.iter().map(|v| v.pointer.as_str()).collect();
    assert_eq!(pointers, ["/mesh/refine/tolerance", "/mesh/refine"]);
}
