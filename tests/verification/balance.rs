//! docs/verification.md, row 25: what every solution must satisfy, checked on the five examples.

use solver::algorithm::{Finished, Place, State, System, run};
use solver::body::ElasticBody;
use solver::contact::AXIS_SHARE;
use solver::elasticity::Dof;
use solver::friction::{Average, Averaging, Chain};
use solver::model::Model;
use solver::problem::{Kernel, Measure, Normalization};

use crate::assembled::Assembled;
use crate::record::held;
use crate::support::{example, quiet, solve};

fn with_solved(name: &str, check: impl FnOnce(&Model, &ElasticBody, &System<'_>, &Finished)) {
    let model = Model::new(&example(name), None).unwrap();
    let body = ElasticBody::new(&model, &mut quiet).unwrap();
    let system = System::new(&model, &body, &mut quiet).unwrap();
    let finished = run(&system, &model.controls, Place::default(), None, &mut quiet);
    check(&model, &body, &system, &finished);
}

#[test]
fn forces_balance_to_1e_9() {
    for name in suite::EXAMPLES {
        let residuals = solve(&example(name)).summary.residuals;
        let what = format!("{name}: force balance");
        held(25, &what, "thesis mesh", residuals.equilibrium, 0.0, 1e-9);
        assert!(
            residuals.kkt < 1e-10 && residuals.friction < 1e-10 && residuals.monolithic < 1e-10,
            "{name}"
        );
    }
}

/// ∫p over the quadratic profile, integrated independently edge by edge with Simpson's rule times
/// the depth (three Gauss points in axisymmetry, where the integrand is cubic).
#[test]
fn the_pressure_profile_integrates_to_the_reactions_and_vanishes_off_the_contact() {
    for name in suite::EXAMPLES {
        let problem = example(name);
        let solution = solve(&problem);
        let (summary, profile) = (
            &solution.summary,
            solution.node_profiles.values().next().unwrap(),
        );
        let depth = |x: f64| match problem.analysis {
            solver::problem::Analysis::PlaneStrain {} => 1.0,
            solver::problem::Analysis::PlaneStress { thickness } => thickness,
            solver::problem::Analysis::Axisymmetric {} => 2.0 * std::f64::consts::PI * x,
        };
        let mut total = 0.0;
        for k in (0..profile.s.len() - 1).step_by(2) {
            let length = profile.s[k + 2] - profile.s[k];
            for (xi, w) in [
                (-0.6f64.sqrt(), 5.0 / 18.0),
                (0.0, 8.0 / 18.0),
                (0.6f64.sqrt(), 5.0 / 18.0),
            ] {
                let h = [0.5 * xi * (xi - 1.0), 1.0 - xi * xi, 0.5 * xi * (xi + 1.0)];
                let at = |v: &[f64]| (0..3).map(|i| h[i] * v[k + i]).sum::<f64>();
                total -= w * length * depth(at(&profile.x)) * at(&profile.normal_stress);
            }
        }
        // the node on the axis has no area, and what its reaction adds is not in ∫p
        let on_axis = name == "cylinder_on_end";
        let tolerance = if on_axis { 2e-3 } else { 1e-13 };
        let what = format!("{name}: ∫p against the nodal reactions");
        held(
            25,
            &what,
            "thesis mesh",
            total,
            summary.normal_force,
            tolerance,
        );
        for (state, stress) in profile.state.iter().zip(&profile.normal_stress) {
            if *state == solver::solution::NodeState::Open {
                assert_eq!(*stress, 0.0, "{name}");
            }
        }
    }
}

/// The final linear problem once more without condensation: all unknowns of the body, active nodes
/// on the obstacle, friction by its final tangent (exact for the linear φ), by Gaussian elimination.
#[test]
fn condensed_equals_uncondensed_to_1e_10() {
    for name in suite::EXAMPLES {
        with_solved(name, |model, body, system, finished| {
            let (matrix, load) = Assembled::new(&model.mesh, &model.section, 3, &body.map);
            let interior = matrix.size() - system.load.len();
            let mut a = matrix.dense();
            let mut b = load;
            let v = &finished.state.v;
            for (point, tau) in system.points.iter().zip(&finished.bound) {
                let (law, slip) = (system.law(point), system.slip(v, point));
                let (weight, slope) = (point.weight * tau, law.phi_slope(slip));
                let dofs = point.nodes.map(|i| system.nodes[i].tangent);
                let known: f64 = (0..3)
                    .map(|i| match dofs[i] {
                        Dof::Free(d) => point.shape[i] * v[d],
                        Dof::Fixed(_) => 0.0,
                    })
                    .sum();
                for i in 0..3 {
                    let Dof::Free(row) = dofs[i] else { continue };
                    // φ(slip) = φ at the solution + slope (u − u at the solution)
                    b[interior + row] -= weight * point.shape[i] * (law.phi(slip) - slope * known);
                    for j in 0..3 {
                        if let Dof::Free(column) = dofs[j] {
                            a[interior + row][interior + column] +=
                                weight * slope * point.shape[i] * point.shape[j];
                        }
                    }
                }
            }
            for (node, active) in system.nodes.iter().zip(&finished.state.active) {
                if let (true, Dof::Free(dof)) = (active, node.normal) {
                    let row = interior + dof;
                    a[row].iter_mut().for_each(|value| *value = 0.0);
                    (a[row][row], b[row]) = (1.0, node.gap);
                    let end = node.beside_axis.map(|end| system.nodes[end].normal);
                    if let Some(Dof::Free(end)) = end {
                        a[row][interior + end] = -AXIS_SHARE;
                    }
                }
            }
            let u = eliminate(a, b);
            let size = u.iter().fold(0.0f64, |m, x| m.max(x.abs()));
            let v = body.nodal_displacements(v);
            let pairs = v.iter().zip(&u[interior..]);
            let worst = pairs.map(|(a, b)| (a - b).abs() / size).fold(0.0, f64::max);
            let what = format!("{name}: condensed against uncondensed");
            held(25, &what, "thesis mesh", worst, 0.0, 1e-10);
            let fields = solve(&example(name)).fields;
            for (node, [x, y]) in body
                .map
                .displacements(|i| u[i], 1.0)
                .into_iter()
                .enumerate()
            {
                let error = (fields.ux[node] - x).abs().max((fields.uy[node] - y).abs());
                assert!(error < 1e-10 * size, "{name}: node {node} off by {error:e}");
            }
        });
    }
}

/// Gaussian elimination with row pivoting.
fn eliminate(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for k in 0..n {
        let pivot = (k..n)
            .max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))
            .unwrap();
        a.swap(k, pivot);
        b.swap(k, pivot);
        let (head, tail) = a.split_at_mut(k + 1);
        for (i, row) in tail.iter_mut().enumerate() {
            let factor = row[k] / head[k][k];
            if factor != 0.0 {
                row[k..]
                    .iter_mut()
                    .zip(&head[k][k..])
                    .for_each(|(x, p)| *x -= factor * p);
                b[k + 1 + i] -= factor * b[k];
            }
        }
    }
    for k in (0..n).rev() {
        let sum: f64 = (k + 1..n).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - sum) / a[k][k];
    }
    b
}

/// Energy (1.21) on the contact unknowns for the frozen bound.
fn energy(system: &System<'_>, bound: &[f64], v: &[f64]) -> f64 {
    let elastic: f64 = system
        .stiffness
        .times(v)
        .iter()
        .zip(v)
        .map(|(f, u)| 0.5 * f * u)
        .sum();
    let load: f64 = system.load.iter().zip(v).map(|(f, u)| f * u).sum();
    elastic - load + friction_work(system, bound, v)
}

/// j(v) of (1.19).
fn friction_work(system: &System<'_>, bound: &[f64], v: &[f64]) -> f64 {
    let point = |(p, tau): (&solver::algorithm::Point, &f64)| {
        p.weight * tau * system.law(p).psi(system.slip(v, p))
    };
    system.points.iter().zip(bound).map(point).sum()
}

/// A fixed sequence of numbers in [−1, 1], the same on every machine.
fn sequence(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        seed = seed
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Against admissible states near and far: no lower energy, and the variational inequality (1.17)
/// a(u, v − u) + j(v) − j(u) ≥ f(v − u).
#[test]
fn no_admissible_state_has_less_energy_and_the_variational_inequality_holds() {
    for name in suite::EXAMPLES {
        with_solved(name, |_, _, system, finished| {
            let u = &finished.state.v;
            let size = u.iter().fold(1e-6f64, |m, x| m.max(x.abs()));
            let (least, j_u, force) = (
                energy(system, &finished.bound, u),
                friction_work(system, &finished.bound, u),
                system.elastic_force(u),
            );
            let (mut next, mut least_seen) = (sequence(7), f64::INFINITY);
            for trial in 0..300 {
                let step = size * 10f64.powi(-(trial % 7));
                let mut v: Vec<f64> = u.iter().map(|x| x + step * next()).collect();
                for node in &system.nodes {
                    if let Dof::Free(dof) = node.normal {
                        v[dof] = v[dof].min(node.gap);
                    }
                }
                let scale = energy(system, &finished.bound, &v).abs().max(least.abs());
                assert!(
                    energy(system, &finished.bound, &v) >= least - 1e-12 * scale,
                    "{name}: trial {trial}"
                );
                let left: f64 = force
                    .iter()
                    .zip(v.iter().zip(u))
                    .map(|(f, (v, u))| f * (v - u))
                    .sum();
                let inequality = left + friction_work(system, &finished.bound, &v) - j_u;
                least_seen = least_seen.min(inequality / scale);
                assert!(
                    inequality >= -1e-12 * scale,
                    "{name}: trial {trial}: {inequality:e}"
                );
            }
            let what = format!("{name}: (1.17) against 300 admissible states, largest violation");
            held(25, &what, "thesis mesh", (-least_seen).max(0.0), 0.0, 1e-12);
        });
    }
}

/// The inner problem has one solution: from rest and from the end it is the same.
#[test]
fn a_solution_restarted_from_itself_does_not_change() {
    with_solved("cylinder", |_, _, system, finished| {
        let again =
            solver::algorithm::minimise(system, &finished.bound, &finished.state, 1e-12, &mut ());
        let State { v, active } = &again.state;
        assert_eq!(active, &finished.state.active);
        assert!(
            v.iter()
                .zip(&finished.state.v)
                .all(|(a, b)| (a - b).abs() < 1e-13)
        );
        let from_rest =
            solver::algorithm::minimise(system, &finished.bound, &system.rest(), 1e-12, &mut ());
        assert!(
            from_rest
                .state
                .v
                .iter()
                .zip(v)
                .all(|(a, b)| (a - b).abs() < 1e-12)
        );
    });
}

/// Row 21. Moments of the bump on meshes far finer and far coarser than ρ, and a mirror beside a first
/// element smaller than ρ. Forty points per piece leave 1.4e-11 of its integral.
#[test]
fn the_averaging_operator_has_the_moments_of_its_kernel() {
    let average = Average {
        radius: 0.3,
        kernel: Kernel::default(),
        normalization: Normalization::default(),
        measure: Measure::default(),
    };
    let even = |edges: usize| -> Vec<f64> {
        (0..=2 * edges)
            .map(|k| 2.0 * k as f64 / (2 * edges) as f64)
            .collect()
    };
    let (rho, x) = (0.3f64, 1.03f64);
    for (edges, mesh) in [(1, "one element of 7 ρ"), (600, "elements of ρ/90")] {
        let s = even(edges);
        let row = Averaging::new(&average, Chain::plain(s.clone())).row(x);
        let moment =
            |f: &dyn Fn(f64) -> f64| row.apply(&s.iter().map(|y| f(*y)).collect::<Vec<_>>());
        held(21, "S(1)", mesh, moment(&|_| 1.0), 1.0, 1e-10);
        held(21, "S(x) / x", mesh, moment(&|y| y) / x, 1.0, 1e-10);
        let second = x * x + 0.1581136363 * rho * rho;
        held(21, "S(x²)", mesh, moment(&|y| y * y), second, 1e-10);
        if edges > 1 {
            let fourth = x.powi(4) + 0.9486818178 * x * x * rho * rho + 0.0529818180 * rho.powi(4);
            held(21, "S(x⁴)", mesh, moment(&|y| y.powi(4)), fourth, 1e-8);
        }
    }
    let s = vec![0.0, 0.05, 0.1, 1.05, 2.0];
    let chain = Chain {
        mirror_start: true,
        ..Chain::plain(s.clone())
    };
    let row = Averaging::new(&average, chain).row(0.0);
    let mean = row.apply(&s.iter().map(|y| 1.0 + y * y).collect::<Vec<_>>());
    held(
        21,
        "mirror, first element ρ/3: S(1 + x²) at 0",
        "three nodes of it",
        mean,
        1.0 + 0.1581136363 * rho * rho,
        1e-10,
    );
}
