//! docs/verification.md, rows 1 and 2: the element.

use faer::Side;
use solver::elasticity::{Section, assemble_element, isotropic};
use solver::element::Family;
use solver::problem::{Analysis, Problem};

use crate::record::held;
use crate::support::{Lattice, problem, solve};

/// Row 1. Nine distorted elements on a unit square at r ≥ 1, its boundary driven by a linear
/// displacement: every node must follow, and the stress be one and the same. Of triangles, each
/// quadrilateral is cut in two; curved: the inner midsides lie off the middle.
///
/// ```text
///   +---+----+--+      inner corners are displaced at random-looking amounts; midsides lie on the
///   |   \    |  |      middle of straight sides: constant strain is then reproduced exactly
///   +----+--+---+
///   |   /    \  |
///   +---+----+--+
/// ```
fn distorted_patch(analysis: &str, patch: &Patch, ux: [f64; 3], uy: [f64; 3]) -> Problem {
    // displacement c0 + c1 x + c2 y, linear along each side
    let shift = |i: usize, j: usize| match (i, j) {
        (1, 1) => [0.06, -0.05],
        (2, 1) => [-0.04, 0.07],
        (1, 2) => [0.05, 0.04],
        (2, 2) => [-0.07, -0.06],
        _ => [0.0, 0.0],
    };
    let corner = |i: usize, j: usize| {
        let [dx, dy] = shift(i, j);
        [1.0 + i as f64 / 3.0 + dx, j as f64 / 3.0 + dy]
    };
    let lattice = Lattice::new(3, 3, |i, j| {
        let (a, b) = (corner(i / 2, j / 2), corner(i.div_ceil(2), j.div_ceil(2)));
        let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
        let inner = (1..6).contains(&i) && (1..6).contains(&j) && (i + j) % 2 == 1;
        match inner && patch.curved {
            true => [middle[0] + 0.02, middle[1] - 0.015],
            false => middle,
        }
    });
    let (nodes, elements) = lattice.cut(|e| match patch.elements {
        "Q8" => false,
        "T6" => true,
        _ => e % 2 == 1,
    });
    let u = |c: [f64; 3], x: f64, y: f64| c[0] + c[1] * x + c[2] * y;
    // a boundary runs with the body on its right: bottom from right to left, and so on round
    let ends = [
        ("bottom", [2.0, 0.0], [1.0, 0.0]),
        ("left", [1.0, 0.0], [1.0, 1.0]),
        ("top", [1.0, 1.0], [2.0, 1.0]),
        ("right", [2.0, 1.0], [2.0, 0.0]),
    ];
    let supports: Vec<_> = ends
        .iter()
        .map(|(name, a, b)| {
            let value = |c| [u(c, a[0], a[1]), u(c, b[0], b[1])];
            serde_json::json!({"boundary": name, "ux": value(ux), "uy": value(uy)})
        })
        .collect();
    let json = serde_json::json!({
        "analysis": serde_json::from_str::<serde_json::Value>(analysis).unwrap(),
        "mesh": {"inline": {"nodes": nodes, "elements": elements, "boundaries": {
            "bottom": lattice.edges(3, |k| (k, 0)), "top": lattice.edges(3, |k| (k, 6)),
            "left": lattice.edges(3, |k| (0, k)), "right": lattice.edges(3, |k| (6, k)),
        }}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": patch.ratio}],
        "supports": supports,
        "quadrature": patch.quadrature,
    });
    problem(&json.to_string())
}

struct Patch {
    elements: &'static str,
    curved: bool,
    quadrature: u32,
    ratio: f64,
}

/// Largest errors of displacement and of stress against a linear field with constant stress.
fn errors(
    analysis: &str,
    patch: &Patch,
    ux: [f64; 3],
    uy: [f64; 3],
    stress: [f64; 4],
) -> (f64, f64) {
    let fields = solve(&distorted_patch(analysis, patch, ux, uy)).fields;
    let (mut of_u, mut of_stress): (f64, f64) = (0.0, 0.0);
    for k in 0..fields.x.len() {
        let (x, y) = (fields.x[k], fields.y[k]);
        of_u = of_u.max((fields.ux[k] - (ux[0] + ux[1] * x + ux[2] * y)).abs());
        of_u = of_u.max((fields.uy[k] - (uy[0] + uy[1] * x + uy[2] * y)).abs());
        let found = [
            fields.stress_xx[k],
            fields.stress_yy[k],
            fields.stress_xy[k],
            fields.stress_zz[k],
        ];
        found
            .iter()
            .zip(stress)
            .for_each(|(a, b)| of_stress = of_stress.max((a - b).abs() / 1000.0));
    }
    (of_u, of_stress)
}

/// To 1e-12 of the strain's size: rounding of a well-conditioned system, and nothing else.
#[test]
fn a_distorted_patch_reproduces_constant_strain() {
    let (e, nu) = (1000.0, 0.3);
    // ε_xx = .01, ε_yy = −.02, γ_xy = .03
    let (ux, uy) = ([0.005, 0.01, 0.02], [0.003, 0.01, -0.02]);
    let (shear, lambda) = (
        e / (2.0 * (1.0 + nu)),
        e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)),
    );
    let dilation = lambda * (0.01 - 0.02);
    let plane_strain = [
        dilation + 2.0 * shear * 0.01,
        dilation - 2.0 * shear * 0.02,
        shear * 0.03,
        dilation,
    ];
    let a = e / (1.0 - nu * nu);
    let plane_stress = [
        a * (0.01 - nu * 0.02),
        a * (nu * 0.01 - 0.02),
        shear * 0.03,
        0.0,
    ];
    // u_r = r, u_z = z: ε_rr = ε_θθ = ε_zz = 1
    let volume = 3.0 * lambda + 2.0 * shear;
    let cases: [(_, _, _, _, f64); 3] = [
        (r#"{"kind": "plane_strain"}"#, ux, uy, plane_strain, 0.03),
        (
            r#"{"kind": "plane_stress", "thickness": 0.02}"#,
            ux,
            uy,
            plane_stress,
            0.03,
        ),
        (
            r#"{"kind": "axisymmetric"}"#,
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [volume, volume, 0.0, volume],
            1.0,
        ),
    ];
    for (analysis, ux, uy, stress, size) in cases {
        let kind: &str = analysis.split('"').nth(3).unwrap_or(analysis);
        let patches = ["Q8", "T6", "Q8 and T6"].into_iter().flat_map(|elements| {
            [(false, 3), (true, 3), (true, 2)].map(|(curved, quadrature)| Patch {
                elements,
                curved,
                quadrature,
                ratio: nu,
            })
        });
        for patch in patches {
            // the smaller rules do not integrate a curved quadrilateral's B exactly, nor r times it
            let smooth = patch.elements == "T6" && kind != "axisymmetric";
            if patch.curved && patch.quadrature == 2 && !smooth {
                continue;
            }
            let (of_u, of_stress) = errors(analysis, &patch, ux, uy, stress);
            let mesh = format!(
                "{} {}, quadrature {}",
                if patch.curved { "curved" } else { "distorted" },
                patch.elements,
                patch.quadrature
            );
            held(
                1,
                &format!("patch test, {kind}: error of u"),
                &mesh,
                of_u,
                0.0,
                1e-12,
            );
            assert!(
                of_u <= 1e-12 && of_stress <= 1e-12 * size,
                "{analysis}, {mesh}: u {of_u:.1e}, σ/E {of_stress:.1e}"
            );
        }
    }
}

/// The same with a volume that changes and the pressure that this takes: errors of stress are relative to it, and those
/// of displacement grow with λ/G, as the condition of the system does. With any `quadrature`: nearly incompressible elements have one rule.
#[test]
fn a_nearly_incompressible_patch_reproduces_constant_strain() {
    let (ux, uy) = ([0.005, 0.01, 0.02], [0.003, 0.01, -0.02]);
    for ratio in [0.4801, 0.4999, 0.49999] {
        let shear = 1000.0 / (2.0 * (1.0 + ratio));
        let lambda = 2.0 * shear * ratio / (1.0 - 2.0 * ratio);
        let volume = 3.0 * lambda + 2.0 * shear;
        let allowed = 1e-12 * f64::max(1.0, lambda / shear / 500.0);
        let dilation = -0.01 * lambda;
        let strain = [
            dilation + 2.0 * shear * 0.01,
            dilation - 2.0 * shear * 0.02,
            shear * 0.03,
            dilation,
        ];
        let round = [volume, volume, 0.0, volume];
        for (kind, ux, uy, stress, size) in [
            ("plane_strain", ux, uy, strain, 0.01 * lambda),
            (
                "axisymmetric",
                [0.0, 1.0, 0.0],
                [0.0, 0.0, 1.0],
                round,
                volume,
            ),
        ] {
            let analysis = format!("{{\"kind\": \"{kind}\"}}");
            for elements in ["Q8", "T6", "Q8 and T6"] {
                for (curved, quadrature) in [(false, 3), (true, 3), (true, 2)] {
                    let patch = Patch {
                        elements,
                        curved,
                        quadrature,
                        ratio,
                    };
                    let (of_u, of_stress) = errors(&analysis, &patch, ux, uy, stress);
                    let mesh = format!(
                        "{} {elements}, quadrature {quadrature}",
                        if curved { "curved" } else { "distorted" }
                    );
                    let what = format!("patch test, {kind}, ν = {ratio}");
                    held(1, &format!("{what}: error of u"), &mesh, of_u, 0.0, allowed);
                    let of_stress = 1000.0 * of_stress / size;
                    held(
                        1,
                        &format!("{what}: error of σ"),
                        &mesh,
                        of_stress,
                        0.0,
                        1e-11,
                    );
                }
            }
        }
    }
}

/// Row 2. Eigenvalues of one element's stiffness that are zero to rounding.
#[test]
fn an_element_has_its_rigid_modes_and_no_others() {
    let quad = [
        [1.0, 0.0],
        [2.0, 0.1],
        [2.2, 1.0],
        [1.0, 0.9],
        [1.5, 0.05],
        [2.1, 0.55],
        [1.6, 0.95],
        [1.0, 0.45],
    ];
    let triangle = [
        [1.0, 0.0],
        [2.0, 0.1],
        [1.2, 1.0],
        [1.5, 0.0],
        [1.7, 0.6],
        [1.1, 0.45],
        [0.0; 2],
        [0.0; 2],
    ];
    let modes_at =
        |(family, nodes): (Family, [[f64; 2]; 8]), analysis: Analysis, rule: u32, ratio: f64| {
            let moduli = isotropic(&analysis, 1000.0, ratio);
            let section = Section::uniform(analysis, moduli);
            let k = assemble_element(family, &nodes, &section, 0, rule);
            let size = 2 * family.nodes();
            let values = faer::Mat::from_fn(size, size, |i, j| k[i][j])
                .self_adjoint_eigenvalues(Side::Lower)
                .unwrap();
            let largest = values.iter().fold(0.0f64, |a, b| a.max(b.abs()));
            values.iter().filter(|v| v.abs() < 1e-12 * largest).count()
        };
    let zero_modes = |shape, analysis: Analysis, rule: u32| modes_at(shape, analysis, rule, 0.3);
    let (quad, triangle) = ((Family::Quad, quad), (Family::Triangle, triangle));
    let (strain, round) = (Analysis::PlaneStrain {}, Analysis::Axisymmetric {});
    let sheet = Analysis::PlaneStress { thickness: 0.5 };
    for (what, modes, expected) in [
        (
            "zero modes, plane strain, 3 × 3",
            zero_modes(quad, strain, 3),
            3,
        ),
        (
            "zero modes, plane stress, 3 × 3",
            zero_modes(quad, sheet, 3),
            3,
        ),
        (
            "zero modes, axisymmetric, 3 × 3",
            zero_modes(quad, round, 3),
            1,
        ),
        (
            "zero modes, triangle, plane strain, 7 points",
            zero_modes(triangle, strain, 3),
            3,
        ),
        (
            "zero modes, triangle, plane strain, 3 points",
            zero_modes(triangle, strain, 2),
            3,
        ),
        (
            "zero modes, triangle, axisymmetric, 7 points",
            zero_modes(triangle, round, 3),
            1,
        ),
        (
            "zero modes, plane strain, ν = .4999",
            modes_at(quad, strain, 2, 0.4999),
            3,
        ),
        (
            "zero modes, axisymmetric, ν = .4999",
            modes_at(quad, round, 2, 0.4999),
            1,
        ),
        (
            "zero modes, triangle, plane strain, ν = .4999",
            modes_at(triangle, strain, 2, 0.4999),
            3,
        ),
        (
            "zero modes, triangle, axisymmetric, ν = .4999",
            modes_at(triangle, round, 2, 0.4999),
            1,
        ),
        // one more than the rigid ones
        (
            "zero modes, plane strain, 2 × 2",
            zero_modes(quad, strain, 2),
            4,
        ),
    ] {
        held(
            2,
            what,
            "one distorted element",
            modes as f64,
            f64::from(expected),
            0.0,
        );
    }
}
