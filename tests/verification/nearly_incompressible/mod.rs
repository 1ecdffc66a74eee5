//! Nearly incompressible bodies (formulation 3.1): elements of 8 and 6 nodes lock as ν approaches ½, those with a
//! bubble and a pressure of their own do not. Closed forms for ν up to .49999; rates are in `manufactured.rs`, constant
//! stresses in `patch.rs` and `contact_patch.rs`.

mod hertz;
mod lame;

use serde_json::{Value, json};
use solver::problem::{
    AdaptiveRefine, Algorithm, Elasticity, Problem, Refine, ThesisOptions, ThesisPressure,
};
use solver::solution::{Fields, WarningCode};

use crate::support::{Lattice, example, problem, quiet, solve};

const RATIOS: [f64; 7] = [0.45, 0.4799, 0.4801, 0.49, 0.499, 0.4999, 0.49999];

const FAMILIES: [&str; 2] = ["quadrilaterals", "triangles"];

/// A mesh of a lattice: its quadrilaterals, or each cut in two triangles.
fn inline(lattice: &Lattice, family: &str, boundaries: &[(&str, Vec<[usize; 3]>)]) -> Value {
    let (nodes, elements) = lattice.cut(|_| family == "triangles");
    let boundaries: serde_json::Map<String, Value> = boundaries
        .iter()
        .map(|(name, edges)| ((*name).to_owned(), json!(edges)))
        .collect();
    json!({"inline": {"nodes": nodes, "elements": elements, "boundaries": boundaries}})
}

/// A rectangle by its grid lines, with the boundaries left, top and bottom.
fn rectangle(x: &[f64], y: &[f64], family: &str) -> Value {
    let at = |lines: &[f64], i: usize| 0.5 * (lines[i / 2] + lines[i.div_ceil(2)]);
    let (columns, rows) = (x.len() - 1, y.len() - 1);
    let lattice = Lattice::new(columns, rows, |i, j| [at(x, i), at(y, j)]);
    let boundaries = [
        ("bottom", lattice.edges(columns, |k| (2 * columns - k, 0))),
        ("top", lattice.edges(columns, |k| (k, 2 * rows))),
        ("left", lattice.edges(rows, |k| (0, k))),
        (
            "right",
            lattice.edges(rows, |k| (2 * columns, 2 * rows - k)),
        ),
    ];
    inline(&lattice, family, &boundaries)
}

/// A body that fits its rigid box stands in it like a fluid: σ_y = −ρg (H − y), exactly, at half the load. The bubble
/// carries its part of the weight, with any rule.
#[test]
fn a_confined_body_carries_its_weight_as_a_fluid_does() {
    for kind in ["plane_strain", "axisymmetric"] {
        for family in FAMILIES {
            for quadrature in [3, 2] {
                let corner = |i: usize, j: usize| {
                    let inner = (1..3).contains(&i) && (1..3).contains(&j);
                    let shift = if inner {
                        0.1 * (i as f64 - 1.3 * j as f64)
                    } else {
                        0.0
                    };
                    [0.5 * i as f64 + shift, 0.5 * j as f64]
                };
                let lattice = Lattice::new(3, 3, |i, j| {
                    let (a, b) = (corner(i / 2, j / 2), corner(i.div_ceil(2), j.div_ceil(2)));
                    [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]
                });
                let boundaries = [
                    ("left", lattice.edges(3, |k| (0, k))),
                    ("right", lattice.edges(3, |k| (6, 6 - k))),
                    ("below", lattice.edges(3, |k| (6 - k, 0))),
                ];
                let mut supports = vec![
                    json!({"boundary": "below", "uy": 0}),
                    json!({"boundary": "right", "ux": 0}),
                ];
                if kind == "plane_strain" {
                    supports.push(json!({"boundary": "left", "ux": 0}));
                }
                let solution = solve(&problem(
                    &json!({
                        "analysis": {"kind": kind},
                        "mesh": inline(&lattice, family, &boundaries),
                        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.4999}],
                        "supports": supports,
                        "loads": [{"body_force": [0, -3]}],
                        "quadrature": quadrature,
                        "steps": [{"loads": 0.5}],
                    })
                    .to_string(),
                ));
                let f = &solution.fields;
                let (nodes, gauss) = (
                    f.y.iter().zip(&f.stress_yy),
                    f.gauss.y.iter().zip(&f.gauss.stress_yy),
                );
                for (y, stress) in nodes.chain(gauss) {
                    let exact = -1.5 * (1.5 - y);
                    assert!(
                        (stress - exact).abs() < 1e-9,
                        "{kind}, {family}, {quadrature}: {stress} for {exact}"
                    );
                }
            }
        }
    }
}

/// Clapeyron: the energy of a body in equilibrium under its loads is minus that of its strains, which needs the work
/// on the bubbles; and its forces balance, reactions of supports included.
#[test]
fn energy_and_forces_balance_under_a_body_force() {
    for kind in ["plane_strain", "axisymmetric"] {
        for family in FAMILIES {
            for quadrature in [3, 2] {
                let lines = [0.0, 0.4, 1.0];
                let mut supports = vec![json!({"boundary": "bottom", "ux": 0, "uy": 0})];
                if kind == "axisymmetric" {
                    supports.push(json!({"boundary": "left", "ux": 0}));
                }
                let solution = solve(&problem(
                    &json!({
                        "analysis": {"kind": kind},
                        "mesh": rectangle(&lines, &lines, family),
                        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.4999}],
                        "supports": supports,
                        "loads": [{"body_force": [1, -3]}, {"boundary": "top", "pressure": 2}],
                        "quadrature": quadrature,
                    })
                    .to_string(),
                ));
                let summary = &solution.summary;
                let strain = summary.strain_energy.unwrap();
                let off = (summary.energy / strain + 1.0).abs();
                assert!(
                    off < 1e-9,
                    "{kind}, {family}, {quadrature}: {} for {strain}",
                    summary.energy
                );
                assert!(summary.residuals.equilibrium < 1e-10);
            }
        }
    }
}

/// The thesis's way to the pressure, extrapolation from Gauss points, sees the same pressure as the nodal reactions do:
/// its friction is within 10 % (at ν = .3, formulation 4.5, 6 %).
#[test]
fn stresses_extrapolated_from_gauss_points_are_those_of_the_element() {
    let force = |pressure: ThesisPressure| {
        let mut problem = with_ratio(example("rectangular_punch"), 0.4999);
        problem.solver.algorithm = Algorithm::Thesis;
        problem.solver.thesis = Some(ThesisOptions {
            pressure,
            ..ThesisOptions::default()
        });
        let summary = solver::solve(&problem, &mut quiet).unwrap().summary;
        summary.tangential_force
    };
    let (lumped, extrapolated) = (
        force(ThesisPressure::Lumped),
        force(ThesisPressure::Extrapolated),
    );
    assert!(
        (extrapolated / lumped - 1.0).abs() < 0.1,
        "{lumped}, {extrapolated}"
    );
}

fn with_ratio(mut problem: Problem, ratio: f64) -> Problem {
    for material in &mut problem.materials {
        if let Elasticity::Isotropic { poissons_ratio, .. } = &mut material.elasticity {
            *poissons_ratio = ratio;
        }
    }
    problem
}

/// Grids are refined where the error is, here too: a punch on rubber to 1 %, against a much finer uniform mesh.
#[test]
fn a_grid_is_refined_until_the_results_settle() {
    let solved = |refine: Refine| {
        let mut problem = with_ratio(example("cylinder"), 0.4999);
        problem.mesh.refine = refine;
        solve(&problem).summary
    };
    let adaptive = solved(Refine::Adaptive(AdaptiveRefine { tolerance: 0.01 }));
    let fine = solved(Refine::Times(3));
    let unfinished = adaptive
        .warnings
        .iter()
        .any(|w| w.code == WarningCode::RefinementUnfinished);
    assert!(
        !unfinished && adaptive.dofs < fine.dofs,
        "{} of {}",
        adaptive.dofs,
        fine.dofs
    );
    for (a, b) in [
        (adaptive.normal_force, fine.normal_force),
        (adaptive.tangential_force, fine.tangential_force),
    ] {
        assert!((a / b - 1.0).abs() < 0.01, "{a}, {b}");
    }
}

/// An orthotropic material with the constants of an isotropic one, at any angle to it, is the same material: it takes the
/// same elements. Its moduli are an inverse, in which λ/G = 5000 leaves some nine digits.
#[test]
fn an_orthotropic_material_without_a_direction_is_isotropic() {
    let (e, ratio) = (1000.0, 0.4999);
    let solved = |material: Value| {
        let lines = [0.0, 0.4, 1.0];
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": rectangle(&lines, &lines, "quadrilaterals"),
            "materials": [material],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
            "loads": [{"boundary": "top", "traction": [1, -3]}],
        });
        solve(&problem(&text.to_string())).fields
    };
    let isotropic = solved(json!({"youngs_modulus": e, "poissons_ratio": ratio}));
    let orthotropic = solved(
        json!({"orthotropic": {"e1": e, "e2": e, "e3": e, "nu12": ratio, "nu13": ratio,
        "nu23": ratio, "g12": e / (2.0 * (1.0 + ratio)), "angle": 25}}),
    );
    let largest = |v: &[f64]| v.iter().fold(0.0f64, |most, x| x.abs().max(most));
    for (a, b) in [
        (&isotropic.uy, &orthotropic.uy),
        (&isotropic.stress_yy, &orthotropic.stress_yy),
        (&isotropic.stress_xy, &orthotropic.stress_xy),
    ] {
        let difference: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        assert!(largest(&difference) < 1e-7 * largest(a), "{a:?}, {b:?}");
    }
}

/// The node nearest to (x, y).
fn node(fields: &Fields, x: f64, y: f64) -> usize {
    let distance = |k: &usize| (fields.x[*k] - x).hypot(fields.y[*k] - y);
    (0..fields.x.len())
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .unwrap()
}
