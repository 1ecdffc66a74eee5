//! docs/verification.md, row 3. Thick cylinders for ν up to .49999, and of two materials.

use serde_json::json;
use solver::problem::Problem;
use solver::solution::Fields;

use super::{FAMILIES, RATIOS, inline, node, rectangle};
use crate::record::{held, keep_table};
use crate::support::{Lattice, problem, solve};

/// Thick cylinder, Lamé: a = 1, b = 2, inner pressure 1; a quarter ring in plane strain or a slice of the wall.
fn thick(round: bool, family: &str, n: usize, ratio: f64) -> Problem {
    let rows = if round { 1 } else { n };
    let lattice = Lattice::new(n, rows, |i, j| {
        let r = 1.0 + i as f64 / (2 * n) as f64;
        let (sin, cos) = (std::f64::consts::FRAC_PI_2 * j as f64 / (2 * n) as f64).sin_cos();
        if round {
            [r, 0.125 * j as f64]
        } else {
            [r * cos, r * sin]
        }
    });
    let boundaries = [
        ("inner", lattice.edges(rows, |k| (0, k))),
        ("below", lattice.edges(n, |k| (k, 0))),
        ("side", lattice.edges(n, |k| (k, 2 * rows))),
    ];
    let (kind, side) = if round {
        ("axisymmetric", "uy")
    } else {
        ("plane_strain", "ux")
    };
    problem(
        &json!({
            "analysis": {"kind": kind},
            "mesh": inline(&lattice, family, &boundaries),
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": ratio}],
            "supports": [{"boundary": "below", "uy": 0}, {"boundary": "side", side: 0}],
            "loads": [{"boundary": "inner", "pressure": 1}],
        })
        .to_string(),
    )
}

/// Largest errors at nodes: of u, relative, and of σ_r and σ_θ in parts of the pressure.
fn against_lame(round: bool, ratio: f64, f: &Fields) -> [f64; 3] {
    let mut worst = [0.0f64; 3];
    for k in 0..f.x.len() {
        let r = if round { f.x[k] } else { f.x[k].hypot(f.y[k]) };
        let (c, s) = if round {
            (1.0, 0.0)
        } else {
            (f.x[k] / r, f.y[k] / r)
        };
        let u = f.ux[k] * c + f.uy[k] * s;
        let exact = (1.0 + ratio) / 3000.0 * ((1.0 - 2.0 * ratio) * r + 4.0 / r);
        let (xx, yy, xy) = (f.stress_xx[k], f.stress_yy[k], f.stress_xy[k]);
        let radial = xx * c * c + 2.0 * xy * c * s + yy * s * s;
        let hoop = match round {
            true => f.stress_zz[k],
            false => xx * s * s - 2.0 * xy * c * s + yy * c * c,
        };
        let off = [
            u / exact - 1.0,
            radial - (1.0 - 4.0 / (r * r)) / 3.0,
            hoop - (1.0 + 4.0 / (r * r)) / 3.0,
        ];
        (0..3).for_each(|i| worst[i] = worst[i].max(off[i].abs()));
    }
    worst
}

/// Displacements and stresses of 16 elements across have errors that do not grow with ν. Recovered stresses at a surface
/// are a one-sided extrapolation.
#[test]
fn a_thick_cylinder_has_lames_solution_at_any_ratio() {
    let mut rows = Vec::new();
    for (round, case) in [(false, "quarter ring"), (true, "slice of the wall")] {
        for family in FAMILIES {
            for ratio in [0.3].into_iter().chain(RATIOS) {
                let solution = solve(&thick(round, family, 16, ratio));
                let off = against_lame(round, ratio, &solution.fields);
                let mut row = vec![json!(case), json!(family), json!(ratio)];
                // 6-node triangles begin to lock before .48
                let stress = match ratio < 0.48 && family == "triangles" {
                    true => 0.05,
                    false => 0.02,
                };
                let names = [("u", 1e-3), ("σ_r", stress), ("σ_θ", stress)];
                for (off, (name, most)) in off.into_iter().zip(names) {
                    let what =
                        format!("thick cylinder, {case}, {family}, ν = {ratio}: error of {name}");
                    held(3, &what, "16 elements across", off, 0.0, most);
                    row.push(json!(format!("{off:.1e}")));
                }
                rows.push(row);
            }
        }
    }
    keep_table(
        "nearly_incompressible",
        &json!({
            "title": "Thick cylinder under inner pressure, 16 elements across: largest errors at nodes, of u relative, of stresses in parts of the pressure",
            "columns": ["body", "mesh", "ν", "u", "σ_r", "σ_θ"],
            "rows": rows,
        }),
    );
}

/// Two rings grown together, rubber (1 ≤ r ≤ 1.5) within steel: in each u = A r + B/r, with u and σ_r the same where
/// they meet. Each element takes its own formulation.
#[test]
fn rubber_and_steel_in_one_body_share_their_boundary() {
    let (inner, outer) = ((10.0, 0.4999), (1000.0, 0.3));
    // σ_r = E/(1 + ν) (A/(1 − 2ν) − B/r²)
    let parts = |(e, nu): (f64, f64), r: f64| {
        let g = e / (1.0 + nu);
        [g / (1.0 - 2.0 * nu), -g / (r * r)]
    };
    // unit pressure at the interface q: each ring by itself, then the q at which both meet
    let solve_ring = |material, (a, p_a): (f64, f64), (b, p_b): (f64, f64)| {
        let ([m, n], [o, p]) = (parts(material, a), parts(material, b));
        let det = m * p - n * o;
        [(-p_a * p + p_b * n) / det, (p_a * o - p_b * m) / det]
    };
    let u = |[a, b]: [f64; 2], r: f64| a * r + b / r;
    let jump = |q: f64| {
        let within = solve_ring(inner, (1.0, 1.0), (1.5, q));
        u(within, 1.5) - u(solve_ring(outer, (1.5, q), (2.0, 0.0)), 1.5)
    };
    let q = jump(0.0) / (jump(0.0) - jump(1.0));
    for family in FAMILIES {
        let mesh = rectangle(
            &(0..=16)
                .map(|i| 1.0 + f64::from(i) / 16.0)
                .collect::<Vec<_>>(),
            &[0.0, 0.1],
            family,
        );
        let mut text = json!({
            "analysis": {"kind": "axisymmetric"}, "mesh": mesh,
            "materials": [
                {"youngs_modulus": inner.0, "poissons_ratio": inner.1, "group": "rubber"},
                {"youngs_modulus": outer.0, "poissons_ratio": outer.1},
            ],
            "supports": [{"boundary": "bottom", "uy": 0}, {"boundary": "top", "uy": 0}],
            "loads": [{"boundary": "left", "pressure": 1}],
        });
        let rubber = if family == "triangles" { 16 } else { 8 };
        text["mesh"]["inline"]["groups"] = json!({"rubber": (0..rubber).collect::<Vec<_>>()});
        let solution = solve(&problem(&text.to_string()));
        let fields = &solution.fields;
        for r in [1.0, 1.25, 1.5, 1.75, 2.0] {
            let exact = match r <= 1.5 {
                true => u(solve_ring(inner, (1.0, 1.0), (1.5, q)), r),
                false => u(solve_ring(outer, (1.5, q), (2.0, 0.0)), r),
            };
            let found = fields.ux[node(fields, r, 0.0)];
            let what = format!("rubber ring within a steel ring, {family}: u at r = {r}");
            held(
                3,
                &what,
                "16 elements across, ν = .4999 and .3",
                found,
                exact,
                2e-3,
            );
        }
        assert!(solution.summary.residuals.equilibrium < 1e-9);
    }
}
