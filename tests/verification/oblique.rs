//! docs/verification.md, row 1, continued: constant strain on a distorted patch that is turned out of the axes, so
//! that supports along normal and tangent, tractions and an orthotropic material all act obliquely.
//!
//! ```text
//!        3        a unit square of nine distorted elements, turned by 25°, at x ≥ 1; sides 0 … 3 are
//!     +------+    those of the lattice: bottom, left, top, right
//!   1 |      | 3
//!     +------+
//! ```

use serde_json::{Value, json};
use solver::solution::Fields;

use crate::element_errors::relative_error;
use crate::record::held;
use crate::support::{Lattice, problem, solve};

const SIDES: [&str; 4] = ["bottom", "left", "top", "right"];

/// Position in the unit square, and where that is.
fn turned([x, y]: [f64; 2]) -> [f64; 2] {
    let (s, c) = 25f64.to_radians().sin_cos();
    [1.5 + c * x - s * y, 0.3 + s * x + c * y]
}

/// Ends of each side in the unit square, in the direction in which it runs: body on the right.
const ENDS: [[[f64; 2]; 2]; 4] = [
    [[1.0, 0.0], [0.0, 0.0]],
    [[0.0, 0.0], [0.0, 1.0]],
    [[0.0, 1.0], [1.0, 1.0]],
    [[1.0, 1.0], [1.0, 0.0]],
];

fn patch() -> Value {
    let shift = |i: usize, j: usize| match (i, j) {
        (1, 1) => [0.06, -0.05],
        (2, 1) => [-0.04, 0.07],
        (1, 2) => [0.05, 0.04],
        (2, 2) => [-0.07, -0.06],
        _ => [0.0, 0.0],
    };
    let corner = |i: usize, j: usize| {
        let [dx, dy] = shift(i, j);
        turned([i as f64 / 3.0 + dx, j as f64 / 3.0 + dy])
    };
    let lattice = Lattice::new(3, 3, |i, j| {
        let (a, b) = (corner(i / 2, j / 2), corner(i.div_ceil(2), j.div_ceil(2)));
        [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]
    });
    json!({"inline": {"nodes": lattice.nodes, "elements": lattice.elements, "boundaries": {
        "bottom": lattice.edges(3, |k| (6 - k, 0)), "top": lattice.edges(3, |k| (k, 6)),
        "left": lattice.edges(3, |k| (0, k)), "right": lattice.edges(3, |k| (6, 6 - k)),
    }}})
}

/// A linear field: u_x = c0 + c1 x + c2 y, u_y likewise.
#[derive(Clone, Copy)]
struct Linear {
    x: [f64; 3],
    y: [f64; 3],
}

impl Linear {
    fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.x, self.y].map(|c| c[0] + c[1] * x + c[2] * y)
    }

    /// [un, ut] of a side, each from its start to its end; n is the direction of the side turned
    /// counter-clockwise, t that direction.
    fn along(&self, side: usize) -> [[f64; 2]; 2] {
        let ends = ENDS[side].map(turned);
        let t = [ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]];
        let [a, b] = ends.map(|end| self.at(end));
        let (un, ut) = (
            |u: [f64; 2]| -u[0] * t[1] + u[1] * t[0],
            |u: [f64; 2]| u[0] * t[0] + u[1] * t[1],
        );
        [[un(a), un(b)], [ut(a), ut(b)]]
    }
}

/// Largest error of displacement.
fn error(fields: &Fields, exact: &Linear) -> f64 {
    (0..fields.x.len())
        .map(|k| {
            let [ux, uy] = exact.at([fields.x[k], fields.y[k]]);
            (fields.ux[k] - ux).abs().max((fields.uy[k] - uy).abs())
        })
        .fold(0.0, f64::max)
}

/// Driven along normal and tangent on all four sides, whose corners are given twice: 1e-12, rounding.
#[test]
fn supports_along_normal_and_tangent_drive_a_turned_patch() {
    let plane = Linear {
        x: [0.005, 0.01, 0.02],
        y: [0.003, 0.01, -0.02],
    };
    // u_r = r, u_z = z
    let round = Linear {
        x: [0.0, 0.01, 0.0],
        y: [0.0, 0.0, 0.01],
    };
    for (kind, field) in [("plane_strain", plane), ("axisymmetric", round)] {
        let supports: Vec<Value> = (0..4)
            .map(|side| {
                let [un, ut] = field.along(side);
                json!({"boundary": SIDES[side], "un": un, "ut": ut})
            })
            .collect();
        let solution = solve(&problem(
            &json!({
                "analysis": {"kind": kind}, "mesh": patch(), "supports": supports,
                "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            })
            .to_string(),
        ));
        let what = format!("constant strain, un and ut prescribed obliquely, {kind}: error of u");
        held(
            1,
            &what,
            "9 distorted Q8",
            error(&solution.fields, &field),
            0.0,
            1e-12,
        );
        // no error where there is none: σ/E is 1e-2
        assert!(relative_error(&solution) < 1e-11);
    }
}

/// Held along the normal only on two sides, with tractions on the others: the free tangential
/// unknowns at oblique nodes must find the exact field by themselves.
#[test]
fn rollers_on_turned_sides_slide() {
    // uniaxial tension p along the turned x: u = p/E (ξ, −ν η) in sheet coordinates
    let (e, nu, p) = (1000.0, 0.3, 7.0);
    let (s, c) = 25f64.to_radians().sin_cos();
    let gradient = |a: f64, b: f64| {
        [
            a * c * c + b * s * s,
            (a - b) * c * s,
            a * s * s + b * c * c,
        ]
    };
    let [xx, xy, yy] = gradient(p / e, -nu * p / e);
    let origin = turned([0.0, 0.0]);
    let field = Linear {
        x: [-xx * origin[0] - xy * origin[1], xx, xy],
        y: [-xy * origin[0] - yy * origin[1], xy, yy],
    };
    let text = json!({
        "analysis": {"kind": "plane_stress", "thickness": 0.2}, "mesh": patch(),
        "supports": [{"boundary": "left", "un": 0}, {"boundary": "bottom", "un": 0}],
        "loads": [{"boundary": "right", "normal": p}],
        "materials": [{"youngs_modulus": e, "poissons_ratio": nu}],
    });
    let fields = solve(&problem(&text.to_string())).fields;
    held(
        1,
        "constant strain between oblique rollers, plane stress: error of u",
        "9 distorted Q8",
        error(&fields, &field),
        0.0,
        1e-12,
    );
}

/// An orthotropic sheet pulled along x, its stiff axis θ above x. With c = cos θ, s = sin θ:
///
///   ε_x/σ  = c⁴/e1 + (1/g12 − 2 nu12/e1) c²s² + s⁴/e2
///   ε_y/σ  = (1/e1 + 1/e2 − 1/g12) c²s² − nu12/e1 (c⁴ + s⁴)
///   γ_xy/σ = 2 cs (c²/e1 − s²/e2) − cs (c² − s²) (1/g12 − 2 nu12/e1)
///
/// Two sides follow that field, the other two bear its traction. 1e-12: rounding.
#[test]
fn an_orthotropic_sheet_pulled_off_its_axis_stretches_and_shears() {
    let (e1, e2, nu12, g12, stress) = (1200.0, 100.0, 0.3, 60.0, 2.0);
    for angle in [-30.0, 0.0, 20.0, 45.0, 90.0] {
        let (s, c) = f64::to_radians(angle).sin_cos();
        let (c2, s2) = (c * c, s * s);
        let ex = c2 * c2 / e1 + (1.0 / g12 - 2.0 * nu12 / e1) * c2 * s2 + s2 * s2 / e2;
        let ey = (1.0 / e1 + 1.0 / e2 - 1.0 / g12) * c2 * s2 - nu12 / e1 * (c2 * c2 + s2 * s2);
        let shear =
            2.0 * c * s * (c2 / e1 - s2 / e2) - c * s * (c2 - s2) * (1.0 / g12 - 2.0 * nu12 / e1);
        let field = Linear {
            x: [0.0, stress * ex, 0.5 * stress * shear],
            y: [0.0, 0.5 * stress * shear, stress * ey],
        };
        let follow = |side: usize| {
            let ends = ENDS[side].map(|end| field.at(turned(end)));
            let [ux, uy] = [0, 1].map(|a| [ends[0][a], ends[1][a]]);
            json!({"boundary": SIDES[side], "ux": ux, "uy": uy})
        };
        // t = σ n with n the direction of the side turned counter-clockwise
        let bear = |side: usize| {
            let ends = ENDS[side].map(turned);
            json!({"boundary": SIDES[side], "traction": [-stress * (ends[1][1] - ends[0][1]), 0]})
        };
        let text = json!({
            "analysis": {"kind": "plane_stress", "thickness": 0.2}, "mesh": patch(),
            "supports": [follow(0), follow(1)], "loads": [bear(2), bear(3)],
            "materials": [{"orthotropic": {"e1": e1, "e2": e2, "nu12": nu12, "g12": g12, "angle": angle}}],
        });
        let fields = solve(&problem(&text.to_string())).fields;
        let what = format!("orthotropic sheet pulled at {angle}° to its axis: error of u");
        held(
            1,
            &what,
            "9 distorted Q8",
            error(&fields, &field),
            0.0,
            1e-12,
        );
        let stresses = fields
            .stress_xx
            .iter()
            .zip(&fields.stress_yy)
            .zip(&fields.stress_xy);
        for ((xx, yy), xy) in stresses {
            let off = (xx - stress).abs().max(yy.abs()).max(xy.abs());
            assert!(off < 1e-11 * stress, "{angle}: {off:.1e}");
        }
    }
}
