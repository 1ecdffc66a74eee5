//! Profiles beside the nodes: at the points where friction acts, and sampled at any number of places.

use solver::element::edge3;
use solver::element::gauss::GAUSS_3;
use solver::problem::{Algorithm, Analysis, Condition, FrictionPoints, Problem, Step};
use solver::solution::{ContactProfile, NodeState, Solution, sample};

use crate::support::{close, example, quiet, solve};

/// ∫f over Γ_C by the Gauss rule of the friction points: `values` has three to an edge.
fn integral(problem: &Problem, nodal: &ContactProfile, values: impl Fn(usize) -> f64) -> f64 {
    let depth = |x: f64| match problem.analysis {
        Analysis::PlaneStress { thickness } => thickness,
        Analysis::Axisymmetric {} => 2.0 * std::f64::consts::PI * x,
        Analysis::PlaneStrain {} => 1.0,
    };
    let mut sum = 0.0;
    for edge in 0..nodal.s.len() / 2 {
        let nodes = [2 * edge, 2 * edge + 2, 2 * edge + 1];
        let positions = nodes.map(|i| [nodal.x[i], nodal.y[i]]);
        for (k, (xi, w)) in GAUSS_3.into_iter().enumerate() {
            let ([x, _], [dx, dy]) = edge3::map(&positions, xi);
            sum += w * dx.hypot(dy) * depth(x) * values(3 * edge + k);
        }
    }
    sum
}

/// The two profiles of a solution's only contact.
fn profiles(solution: &Solution) -> (&ContactProfile, &ContactProfile) {
    let name = solution.node_profiles.keys().next().unwrap();
    (
        &solution.node_profiles[name],
        &solution.friction_profiles[name],
    )
}

/// The columns at the friction points are what the summary adds up: to rounding, also where the
/// iteration did not converge, or its tractions are not the law's.
#[test]
fn stresses_at_the_friction_points_add_up_to_the_forces() {
    let mut problems: Vec<Problem> = suite::EXAMPLES.map(example).to_vec();
    let mut early = example("cylinder");
    early.solver.max_iterations = 2;
    let mut thesis = example("rectangular_punch");
    thesis.solver.algorithm = Algorithm::Thesis;
    thesis.solver.max_iterations = 5;
    let mut bonded = example("rectangular_punch");
    bonded.contacts[0].condition = Condition::Bonded;
    bonded.contacts[0].friction = None;
    problems.extend([early, thesis, bonded]);
    for problem in &problems {
        let solution = solver::solve(problem, &mut quiet).unwrap();
        let (nodal, friction) = profiles(&solution);
        let summary = &solution.summary;
        assert_eq!(friction.s.len(), 3 * (nodal.s.len() / 2));
        assert!(friction.s.is_sorted());
        let size = summary.friction_force;
        assert!(size > 1e-3, "something is there to be compared");
        let force = integral(problem, nodal, |g| friction.tangential_stress[g]);
        assert!((force - summary.tangential_force).abs() <= 1e-12 * size);
        let force = integral(problem, nodal, |g| friction.tangential_stress[g].abs());
        // the reactions of bonded nodes are added up one by one
        if problem.contacts[0].condition != Condition::Bonded {
            close(force, size, 1e-12);
        }
        // pressures integrate to the reactions exactly
        let force = integral(problem, nodal, |g| -friction.normal_stress[g]);
        close(force, summary.normal_force, 1e-12);
    }
}

/// What the law says at a point: σ_t = −τ φ with the τ of that very point, to the solver's tolerance,
/// and the midside's own values at the middle point.
#[test]
fn the_law_holds_at_every_friction_point() {
    for name in suite::EXAMPLES {
        let problem = example(name);
        let law = problem.contacts[0].friction.clone().unwrap();
        let solution = solve(&problem);
        let (nodal, friction) = profiles(&solution);
        let largest = friction
            .friction_bound
            .iter()
            .fold(0.0, |a: f64, b| a.max(*b));
        assert!(largest > 1.0);
        for g in 0..friction.s.len() {
            let tau = law.coefficient.unwrap() * friction.nonlocal_pressure[g].max(0.0);
            assert!((friction.friction_bound[g] - tau).abs() <= 1e-14 * largest);
            let stress = tau * friction.friction_ratio[g];
            let off = (friction.tangential_stress[g].abs() - stress).abs();
            assert!(off <= 1e-9 * largest, "{name}: {off:.1e} of {largest}");
            let beside = [g / 3 * 2, g / 3 * 2 + 1, g / 3 * 2 + 2];
            let touches = |i: usize| nodal.state[i] != NodeState::Open;
            if g % 3 == 1 {
                let row = |p: &ContactProfile, i: usize| {
                    (
                        [p.s[i], p.x[i], p.y[i], p.gap[i], p.normal_stress[i]],
                        [p.normal_displacement[i], p.tangential_displacement[i]],
                        [p.nonlocal_pressure[i], p.friction_bound[i]],
                        p.state[i],
                    )
                };
                assert_eq!(row(friction, g), row(nodal, beside[1]));
            } else if beside.iter().all(|&i| touches(i)) {
                assert_ne!(friction.state[g], NodeState::Open);
            } else if !beside.iter().any(|&i| touches(i)) {
                assert_eq!(friction.state[g], NodeState::Open);
            }
        }
    }
}

/// Friction at nodes: the same rows again, without the axis, where nothing slides.
#[test]
fn friction_at_nodes_has_its_profile_at_nodes() {
    for (name, axis) in [("rectangular_punch", 0), ("cylinder_on_end", 1)] {
        let mut problem = example(name);
        problem.contacts[0].friction.as_mut().unwrap().points = FrictionPoints::Nodal;
        let solution = solve(&problem);
        let (nodal, friction) = profiles(&solution);
        assert_eq!(friction.s, nodal.s[axis..]);
        assert_eq!(friction.friction_bound, nodal.friction_bound[axis..]);
        assert_eq!(friction.state, nodal.state[axis..]);
        let pairs = friction.tangential_stress.iter();
        for (acts, law) in pairs.zip(&nodal.tangential_stress[axis..]) {
            assert!((acts - law).abs() < 1e-7);
        }
        let sampled = sample(nodal, friction, 500);
        assert_eq!(sampled.s.len(), 500);
    }
}

#[test]
fn a_contact_without_friction_has_its_profile_at_gauss_points() {
    let mut problem = example("cylinder");
    problem.contacts[0].friction = None;
    let solution = solve(&problem);
    let (nodal, friction) = profiles(&solution);
    assert_eq!(friction.s.len(), 3 * (nodal.s.len() / 2));
    assert!(
        friction
            .tangential_stress
            .iter()
            .all(|stress| *stress == 0.0)
    );
    assert!(friction.state.contains(&NodeState::Slip));
    assert!(!friction.state.contains(&NodeState::Stick));
}

/// Every step has its own, the solution that of the last.
#[test]
fn every_step_has_its_profile_at_the_friction_points() {
    let mut problem = example("rectangular_punch");
    let half = Step {
        indentation: 0.5,
        ..Step::whole()
    };
    problem.steps = vec![half, Step::whole()];
    let solution = solve(&problem);
    let ends: Vec<f64> = solution
        .steps
        .iter()
        .map(|step| {
            let force = integral(&problem, &step.node_profiles["top"], |g| {
                step.friction_profiles["top"].tangential_stress[g]
            });
            close(force, step.summary.tangential_force, 1e-12);
            force
        })
        .collect();
    assert!(ends[1] > 1.5 * ends[0]);
    assert_eq!(
        solution.friction_profiles,
        solution.steps[1].friction_profiles
    );
}

/// A sampled profile shows the peak that the solver looks for on the continuous σ_t, and its integral
/// is the force. On a mesh refined twice both are seen to .1 %, tested to .2 %.
#[test]
fn a_sampled_profile_is_the_continuous_one() {
    let mut problem = example("rectangular_punch");
    problem.mesh.refine = solver::problem::Refine::Times(2);
    let solution = solve(&problem);
    let (nodal, friction) = profiles(&solution);
    let sampled = sample(nodal, friction, 20_001);
    let stress = &sampled.tangential_stress;
    let peak = solution.summary.contacts["top"]
        .peak_tangential_stress
        .unwrap();
    let largest = (0..stress.len()).max_by(|&a, &b| stress[a].abs().total_cmp(&stress[b].abs()));
    let largest = largest.unwrap();
    close(stress[largest], peak.value, 2e-3);
    assert!((sampled.s[largest] - peak.s).abs() < 5e-4);
    let step = sampled.s[1] - sampled.s[0];
    let ends = 0.5 * (stress[0] + stress[20_000]);
    let force = step * (stress.iter().sum::<f64>() - ends);
    close(force, solution.summary.tangential_force, 2e-3);
}

/// The largest stresses of the profile that a user gets are the peaks of the summary: a node or a friction point may
/// exceed one by what the iteration leaves, 1e-9.
#[test]
fn the_profile_holds_the_peaks() {
    let mut problems: Vec<Problem> = suite::EXAMPLES.map(example).to_vec();
    problems.extend((0..40).map(|number| crate::catalogue::case(number).problem));
    let (mut peaks, mut beside_nodes) = (0, 0);
    for problem in &problems {
        let solution = solver::solve(problem, &mut quiet).unwrap();
        for (name, all) in &solution.profiles {
            let summary = &solution.summary.contacts[name];
            let nodes = &solution.node_profiles[name];
            assert!(all.s.is_sorted());
            let rows: Vec<usize> = nodes
                .s
                .iter()
                .map(|s| all.s.iter().position(|other| other == s).unwrap())
                .collect();
            for (node, row) in rows.into_iter().enumerate() {
                assert_eq!(
                    all.normal_displacement[row],
                    nodes.normal_displacement[node]
                );
                assert_eq!(all.state[row], nodes.state[node]);
            }
            for (values, at_nodes, peak) in [
                (
                    &all.normal_stress,
                    &nodes.normal_stress,
                    summary.peak_normal_stress,
                ),
                (
                    &all.tangential_stress,
                    &nodes.tangential_stress,
                    summary.peak_tangential_stress,
                ),
            ] {
                let Some(peak) = peak else { continue };
                let largest = |values: &[f64]| values.iter().fold(0.0f64, |a, v| a.max(v.abs()));
                assert!(values.contains(&peak.value));
                close(largest(values), peak.value.abs(), 1e-9);
                peaks += 1;
                beside_nodes += usize::from(largest(at_nodes) < 0.999 * peak.value.abs());
            }
        }
    }
    assert!(peaks > 80 && beside_nodes > 20, "{beside_nodes} of {peaks}");
}

/// The peak of σ_t is looked for on few edges where the average is wide beside the edges: it is the largest of all points
/// of the law all the same.
#[test]
fn the_peak_under_a_wide_average_is_the_largest_of_all_points() {
    use solver::problem::{Kernel, Normalization};
    let mut problem = example("cylinder");
    problem.mesh.refine = solver::problem::Refine::Times(3);
    for (kernel, normalization) in [
        (Kernel::Bump, Normalization::UnitIntegral),
        (Kernel::Bump, Normalization::Conserving),
        (Kernel::Parabola, Normalization::PeakOne),
    ] {
        for radius in [0.3, 1.0, 3.0] {
            let friction = problem.contacts[0].friction.as_mut().unwrap();
            friction.nonlocal_radius = Some(radius);
            (friction.kernel, friction.normalization) = (kernel, normalization);
            let solution = solver::solve(&problem, &mut quiet).unwrap();
            let peak = solution.summary.contacts["top"].peak_tangential_stress;
            let all = &solution.profiles["top"];
            let law = all.friction_bound.iter().zip(&all.friction_ratio);
            let largest = law.map(|(bound, ratio)| bound * ratio).fold(0.0, f64::max);
            close(largest, peak.unwrap().value.abs(), 1e-9);
        }
    }
}

/// Between the points of the law u_t, a parabola, overshoots by more than a tiny ε: a σ_t of a sign that no point beside it
/// has is no peak. The row of a peak is the law's: σ_t = τ φ.
#[test]
fn a_peak_has_the_sign_of_the_points_beside_it() {
    let mut problem = example("cylinder");
    let mut most = 0.0f64;
    for slip in [5.3e-6, 5e-6, 1e-5] {
        let friction = problem.contacts[0].friction.as_mut().unwrap();
        (friction.nonlocal_radius, friction.elastic_slip) = (Some(0.5), slip);
        let solution = solver::solve(&problem, &mut quiet).unwrap();
        let peak = solution.summary.contacts["top"].peak_tangential_stress;
        let peak = peak.unwrap();
        assert!(peak.value > 30.0, "ε = {slip:e}: {peak:?}");
        let all = &solution.profiles["top"];
        let row = all.tangential_stress.iter().position(|v| *v == peak.value);
        let row = row.unwrap();
        let law = all.friction_bound[row] * all.friction_ratio[row];
        most = most.max((law / peak.value - 1.0).abs());
    }
    assert!(most < 1e-9, "{most:e}");
}
