//! The grid of formulation 4.3's claims: `auto` converges on all of it, and says where its friction
//! cannot be trusted.

use std::collections::BTreeMap;

use serde_json::json;
use solver::problem::{Algorithm, BoundaryValue, FrictionPoints, Problem, Refine};
use solver::solution::{Solution, Summary, WarningCode};

use crate::record::{held, keep_table};
use crate::support::{example, problem, solve};

const EXAMPLES: [(&str, f64); 4] = [
    ("rectangular_punch", 0.01),
    ("cylinder", 0.03),
    ("annular_punch", 0.05),
    ("cylinder_on_end", 0.01),
];
const SLIPS: [f64; 6] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8];

fn case(name: &str, refine: u32, points: FrictionPoints, mu: f64, rho: f64, eps: f64) -> Problem {
    let mut problem = example(name);
    problem.mesh.refine = Refine::Times(refine);
    let friction = problem.contacts[0].friction.as_mut().unwrap();
    friction.points = points;
    friction.coefficient = Some(mu);
    friction.nonlocal_radius = Some(rho);
    friction.elastic_slip = eps;
    problem
}

/// Every case converges (`solve` asserts it). On the refined meshes ∫|σ_t| below ε = 1e-5 stays
/// within 1 % of its value there: at nodes always; at Gauss points every case that does not is
/// warned of.
#[test]
fn auto_converges_on_the_whole_grid_and_warns_where_stick_oscillates() {
    let mut cases = 0;
    let mut rows: BTreeMap<(String, String), Vec<u32>> = BTreeMap::new();
    let mut missed = (0, 0);
    for points in [FrictionPoints::Gauss3, FrictionPoints::Nodal] {
        for (name, radius) in EXAMPLES {
            for refine in [0, 2] {
                for multiple in [0.0, 1.0, 10.0] {
                    for mu in [0.1, 0.3, 1.0, 4.0] {
                        let mut at_reference = None;
                        for eps in SLIPS {
                            let problem = case(name, refine, points, mu, multiple * radius, eps);
                            let summary = solve(&problem).summary;
                            cases += 1;
                            let key = (name.to_owned(), format!("{eps:e}"));
                            rows.entry(key).or_default().push(summary.iterations);
                            if eps == 1e-5 {
                                at_reference = Some(summary.friction_force);
                            }
                            let Some(reference) = at_reference.filter(|_| refine == 2) else {
                                continue;
                            };
                            let off = (summary.friction_force / reference - 1.0).abs() > 0.01;
                            let warned = warned(&summary);
                            let place = format!("{name} ρ × {multiple} μ = {mu} ε = {eps:e}");
                            match points {
                                FrictionPoints::Nodal => assert!(!off, "{place}"),
                                FrictionPoints::Gauss3 if off => {
                                    assert!(
                                        warned,
                                        "{place}: {} for {reference}",
                                        summary.friction_force
                                    );
                                    missed.0 += 1;
                                }
                                FrictionPoints::Gauss3 => missed.1 += u32::from(warned),
                            }
                        }
                    }
                }
            }
        }
    }
    assert!(cases >= 300);
    assert!(missed.0 > 0, "the warning was never needed");
    let lines: Vec<_> = rows
        .iter_mut()
        .map(|((name, eps), rows)| {
            rows.sort_unstable();
            json!({"example": name, "elastic_slip": eps, "cases": rows.len(),
                   "least": rows[0], "median": rows[rows.len() / 2], "most": rows[rows.len() - 1]})
        })
        .collect();
    keep_table(
        "robustness",
        &json!({"cases": cases, "oscillating": missed.0, "warned_besides": missed.1, "iterations": lines}),
    );
}

fn warned(summary: &Summary) -> bool {
    summary
        .warnings
        .iter()
        .any(|w| w.code == WarningCode::OscillatingStick)
}

/// The sheet of formulation 4.8, with two solutions.
fn dragged_sheet(pull: f64, drag: f64, mu: f64) -> Problem {
    let mut sheet = example("sheet");
    let mut x = vec![0.0, 0.5];
    x.extend((10..=26).map(|k| f64::from(k) / 10.0));
    x.extend([2.8, 3.0, 3.5, 4.0, 5.0]);
    sheet.mesh.grid_mut().unwrap().x = x;
    sheet.supports[1].ux = Some(BoundaryValue::Constant(pull));
    sheet.contacts[0].tangential_displacement = drag;
    sheet.contacts[0].friction.as_mut().unwrap().coefficient = Some(mu);
    sheet
}

#[test]
fn a_sheet_dragged_along_its_wall_converges_up_to_a_coefficient_of_ten() {
    let mut lines = Vec::new();
    for drag in [-1.0, 0.0, 1.0] {
        for pull in [0.1, 0.2] {
            for mu in [0.3, 0.6, 0.8, 1.0, 2.0, 4.0, 10.0] {
                let summary = solve(&dragged_sheet(pull, drag, mu)).summary;
                assert!(
                    summary.residuals.monolithic < 1e-10,
                    "d = {drag}, pull {pull}, μ = {mu}"
                );
                lines.push(json!({"drag": drag, "pull": pull, "coefficient": mu,
                    "iterations": summary.iterations, "normal_force": summary.normal_force}));
            }
        }
    }
    keep_table("dragged_sheet", &json!(lines));
}

/// Free (Y = 0) and jammed at once from μ = .8 on; one state only up to .6.
#[test]
fn the_jammed_sheet_is_found_beside_the_free_one() {
    for (mu, jammed) in [(0.8, 8.50132), (1.0, 8.66656), (2.0, 8.87861)] {
        let mut sheet = dragged_sheet(0.1, 1.0, mu);
        sheet.solver.check_uniqueness = true;
        let summary = solve(&sheet).summary;
        assert_eq!(summary.normal_force, 0.0, "μ = {mu}");
        let second = summary.uniqueness.as_ref().unwrap();
        assert!(second.converged && !second.agrees);
        // five decimals are published
        let what = format!("sheet jammed at μ = {mu}: Y from the bonded state");
        held(
            0,
            &what,
            "formulation 4.8",
            second.normal_force,
            jammed,
            1e-6,
        );
        assert!(
            summary
                .warnings
                .iter()
                .any(|w| w.code == WarningCode::NotUnique)
        );
    }
    for mu in [0.3, 0.6] {
        let mut sheet = dragged_sheet(0.1, 1.0, mu);
        sheet.solver.check_uniqueness = true;
        let summary = solve(&sheet).summary;
        assert!(summary.uniqueness.unwrap().agrees, "μ = {mu}");
    }
}

/// All three algorithms are of one mind; 1e-8 is far above what their tolerances leave.
#[test]
fn newton_and_the_sweeps_find_what_auto_finds() {
    for name in suite::EXAMPLES {
        let mut problem = example(name);
        let auto = solve(&problem).summary;
        for algorithm in [Algorithm::FixedPoint, Algorithm::Newton] {
            problem.solver.algorithm = algorithm;
            let summary = solve(&problem).summary;
            for (a, b) in [
                (summary.normal_force, auto.normal_force),
                (summary.tangential_force, auto.tangential_force),
                (summary.friction_force, auto.friction_force),
            ] {
                assert!(
                    (a / b - 1.0).abs() < 1e-8,
                    "{name} by {algorithm:?}: {a} for {b}"
                );
            }
        }
    }
}

/// A mesh generator misses the axis by rounding of the body's size, which is much for a small contact. The
/// node is on the axis for supports, contact and friction alike, and the results are those of r = 0.
#[test]
fn a_node_that_misses_the_axis_by_rounding_is_on_it_however_small_the_contact() {
    let pressed = |first: f64| {
        let text = json!({
            "analysis": {"kind": "axisymmetric"},
            "mesh": {"grid": {"x": [first, 0.002, 0.004, 0.01, 0.1, 1], "y": [-1, -0.1, -0.01, -0.002, 0]},
                "boundaries": {"tip": {"side": "top", "x": [0, 0.01]}}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "uy": 0}],
            "contacts": [{"boundary": "tip", "obstacle": {"kind": "parabola", "radius": 0.05}, "indentation": 1e-4,
                "friction": {"coefficient": 0.3, "nonlocal_radius": 1e-3, "elastic_slip": 1e-7}}],
        });
        solve(&problem(&text.to_string()))
    };
    // 5e-14 is the axis beside a radius of 1, and was none beside a contact of 0.01
    let (exact, rounded) = (pressed(0.0), pressed(5e-14));
    let forces = |s: &Solution| [s.summary.normal_force, s.summary.friction_force];
    for (a, b) in forces(&exact).into_iter().zip(forces(&rounded)) {
        assert!((a / b - 1.0).abs() < 1e-9, "{a}, {b}");
    }
    let pressures = |s: &Solution| s.node_profiles["tip"].normal_stress.clone();
    let (exact, rounded) = (pressures(&exact), pressures(&rounded));
    let most = exact.iter().fold(0.0f64, |most, p| most.max(-p));
    for (a, b) in exact.iter().zip(&rounded) {
        assert!((a - b).abs() < 1e-6 * most, "{exact:?}, {rounded:?}");
    }
}
