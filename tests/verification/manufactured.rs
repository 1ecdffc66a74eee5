//! docs/verification.md, row 5. Manufactured solutions: a smooth displacement field is chosen, the body force that
//! belongs to it derived, and the field must come back with the rates of quadratic elements.
//!
//! f = −(λ + G) ∇(div u) − G ∇²u, and in cylindrical coordinates (∇²u)_r = ∇²u_r − u_r/r².
//!
//! Plane strain, on the unit square:
//!
//!   u = (sin πx cos πy, 2 cos πx sin πy)
//!   div u = 3π cos πx cos πy,   ∇²u = −2π² u
//!   f = π² ((3(λ + G) + 2G) sin πx cos πy, (3(λ + G) + 4G) cos πx sin πy)
//!
//! Axisymmetric, on 0 ≤ r ≤ 1, 0 ≤ z ≤ 2, the axis included:
//!
//!   u = (r² sin z, r² cos z)
//!   div u = (3r − r²) sin z,   ∇²u = ((3 − r²) sin z, (4 − r²) cos z)
//!   f = −((λ + G)(3 − 2r) + G(3 − r²)) sin z,   −((λ + G)(3r − r²) + G(4 − r²)) cos z
//!
//! The whole boundary follows the exact field; the API has no body force that varies and no support
//! that is curved, so the test works with the library's own assembly and factorisation.

use serde_json::json;
use solver::elasticity::{Dof, DofMap, Mixed, Section, isotropic, stress};
use solver::element::{Element, Family, GaussPoint, Mapped, gauss};
use solver::mesh::{Mesh, grid_mesh, refine};
use solver::problem::{Analysis, Grid};

use crate::assembled::Assembled;
use crate::record::{Line, keep_table};

const E: f64 = 1000.0;
const NU: f64 = 0.3;
const G: f64 = E / (2.0 * (1.0 + NU));
const LAMBDA: f64 = E * NU / ((1.0 + NU) * (1.0 - 2.0 * NU));

/// A field at a place.
struct At {
    /// Displacement.
    u: [f64; 2],
    /// ∂u_i/∂x_j.
    gradient: [[f64; 2]; 2],
    /// The body force that belongs to it.
    force: [f64; 2],
}

type Exact<'a> = &'a dyn Fn([f64; 2]) -> At;

/// An integration point of an element.
struct Point {
    /// In master coordinates.
    master: [f64; 2],
    map: Mapped,
    place: [f64; 2],
    weight: f64,
}

#[rustfmt::skip]
fn plane([x, y]: [f64; 2]) -> At {
    let pi = std::f64::consts::PI;
    let ((sx, cx), (sy, cy)) = ((pi * x).sin_cos(), (pi * y).sin_cos());
    let a = 3.0 * (LAMBDA + G);
    At {
        u: [sx * cy, 2.0 * cx * sy],
        gradient: [
            [ pi * cx * cy,       -pi * sx * sy],
            [-2.0 * pi * sx * sy,  2.0 * pi * cx * cy],
        ],
        force: [
            pi * pi * (a + 2.0 * G) * sx * cy,
            pi * pi * (a + 4.0 * G) * cx * sy,
        ],
    }
}

#[rustfmt::skip]
fn round([r, z]: [f64; 2]) -> At {
    let (s, c) = z.sin_cos();
    At {
        u: [r * r * s, r * r * c],
        gradient: [
            [2.0 * r * s,  r * r * c],
            [2.0 * r * c, -r * r * s],
        ],
        force: [
            -((LAMBDA + G) * (3.0 - 2.0 * r) + G * (3.0 - r * r)) * s,
            -((LAMBDA + G) * (3.0 * r - r * r) + G * (4.0 - r * r)) * c,
        ],
    }
}

/// A coarse mesh whose inner corners are out of place, split `times` times. Splitting makes the elements
/// ever more like parallelograms, for which alone 8-node elements hold all quadratics (Arnold, Boffi,
/// Falk 2002): the full rates need that.
fn mesh(width: f64, height: f64, times: usize) -> Mesh {
    let lines = |size: f64| (0..=3).map(|k| size * f64::from(k) / 3.0).collect();
    let mut mesh = grid_mesh(&Grid {
        x: lines(width),
        y: lines(height),
        top: None,
        bottom: None,
    });
    let size = [width, height];
    let inner: Vec<usize> = (0..mesh.nodes.len())
        .filter(|&n| (0..2).all(|a| mesh.nodes[n][a] > 1e-9 && mesh.nodes[n][a] < size[a] - 1e-9))
        .collect();
    let corners: Vec<u32> = mesh.elements.iter().flat_map(|e| e[..4].to_vec()).collect();
    for (k, n) in inner
        .iter()
        .filter(|&&n| corners.contains(&(n as u32)))
        .enumerate()
    {
        let angle = 1.0 + 2.0 * k as f64;
        mesh.nodes[*n][0] += 0.07 * width * angle.cos();
        mesh.nodes[*n][1] += 0.07 * height * angle.sin();
    }
    for element in mesh.elements.clone() {
        for [a, b, middle] in element.sides().map(|side| side.map(|i| i as usize)) {
            mesh.nodes[middle] = [0, 1].map(|i| 0.5 * (mesh.nodes[a][i] + mesh.nodes[b][i]));
        }
    }
    (0..times).fold(mesh, |mesh, _| refine(&mesh))
}

/// The same mesh of triangles: every quadrilateral is cut along a diagonal, one way or the other in turn.
fn triangles(mesh: &Mesh) -> Mesh {
    let mut cut = mesh.clone();
    cut.elements.clear();
    for (e, p) in mesh.elements.iter().enumerate() {
        let centre = cut.nodes.len() as u32;
        let (from, to) = if e % 2 == 0 { (0, 2) } else { (1, 3) };
        let [a, b] = [p[from], p[to]].map(|n| mesh.nodes[n as usize]);
        cut.nodes.push([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]);
        let halves = match from {
            0 => [
                [p[0], p[1], p[2], p[4], p[5], centre],
                [p[0], p[2], p[3], centre, p[6], p[7]],
            ],
            _ => [
                [p[0], p[1], p[3], p[4], centre, p[7]],
                [p[1], p[2], p[3], p[5], p[6], centre],
            ],
        };
        cut.elements.extend(halves.map(Element::Triangle));
    }
    cut
}

/// 6 × 6 points; for a triangle on a square whose one side is drawn together (Duffy).
fn fine_rule(family: Family) -> Vec<GaussPoint> {
    let line = gauss::rule(6);
    let pairs = line.iter().flat_map(|a| line.iter().map(move |b| (*a, *b)));
    pairs
        .map(|((xi, w_xi), (eta, w_eta))| match family {
            Family::Quad => GaussPoint {
                place: [xi, eta],
                weight: w_xi * w_eta,
            },
            Family::Triangle => {
                let left = 0.5 * (1.0 - xi);
                GaussPoint {
                    place: [0.5 * (1.0 + xi), 0.5 * (1.0 + eta) * left],
                    weight: 0.25 * w_xi * w_eta * left,
                }
            }
        })
        .collect()
}

/// Norms of the errors of u (L2), of its gradient (H1 seminorm; in axisymmetry with u_r/r) and of σ (L2), relative.
fn errors(analysis: Analysis, mesh: &Mesh, points: u32, ratio: f64, exact: Exact<'_>) -> [f64; 3] {
    let section = Section::uniform(analysis, isotropic(&analysis, E, ratio));
    let mut map = DofMap {
        dofs: vec![[Dof::Fixed(0.0); 2]; mesh.nodes.len()],
        axes: vec![None; mesh.nodes.len()],
        unknowns: 0,
    };
    let mut outside = vec![false; mesh.nodes.len()];
    for node in mesh.boundaries.values().flatten().flatten() {
        outside[*node as usize] = true;
    }
    for (node, on_boundary) in outside.iter().enumerate() {
        let u = exact(mesh.nodes[node]).u;
        map.dofs[node] = if *on_boundary {
            u.map(Dof::Fixed)
        } else {
            map.unknowns += 2;
            [Dof::Free(map.unknowns - 2), Dof::Free(map.unknowns - 1)]
        };
    }
    let (matrix, mut load) = Assembled::new(mesh, &section, points, &map);
    // a rule finer than the element's own: integration of f and of the error is not what is tested
    let fine = [Family::Quad, Family::Triangle].map(fine_rule);
    let points_of = |element: &Element| -> Vec<Point> {
        let (family, nodes) = (element.family(), mesh.element_nodes(element));
        let point = |point: &GaussPoint| {
            let m = family.map(&nodes, point.place);
            let y = (0..8).map(|i| m.shape[i] * nodes[i][1]).sum();
            Point {
                master: point.place,
                map: m,
                place: [m.x, y],
                weight: point.weight * m.det * section.depth(m.x),
            }
        };
        fine[family as usize].iter().map(point).collect()
    };
    // the element of a nearly incompressible material, and the force on its bubble
    let inner = |element: &Element| {
        let (family, nodes) = (element.family(), mesh.element_nodes(element));
        section.split(0).map(|split| {
            let mut force = [0.0; 2];
            for p in points_of(element) {
                let share = p.weight * family.bubble(p.master).0;
                (0..2).for_each(|a| force[a] += share * exact(p.place).force[a]);
            }
            (Mixed::new(&section, split, family, &nodes), force)
        })
    };
    for element in &mesh.elements {
        let mut forces = inner(element).map_or([[0.0; 2]; 8], |(mixed, f)| mixed.passed_on(&f));
        for p in points_of(element) {
            let force = exact(p.place).force;
            for i in 0..element.len() {
                (0..2).for_each(|a| forces[i][a] += p.weight * p.map.shape[i] * force[a]);
            }
        }
        for (node, force) in element.iter().zip(forces) {
            for (dof, f) in map.dofs[*node as usize].iter().zip(force) {
                if let Dof::Free(k) = dof {
                    load[*k] += f;
                }
            }
        }
    }
    let unknowns = matrix.solve(&load);
    let u = map.displacements(|i| unknowns[i], 1.0);
    let (mut off, mut size) = ([0.0; 3], [0.0; 3]);
    let moduli = &section.materials()[0];
    let strain = |[[xx, xy], [yx, yy]]: [[f64; 2]; 2], u: f64, x: f64| {
        let hoop = if section.axisymmetric() { u / x } else { 0.0 };
        [xx, yy, xy + yx, hoop]
    };
    for element in &mesh.elements {
        let own = element.gather(|n| u[n as usize]);
        let inside = inner(element).map(|(mixed, force)| mixed.inside(&own, &force, &[0.0; 3]));
        for p in points_of(element) {
            let At {
                u: u_exact,
                gradient,
                ..
            } = exact(p.place);
            let (mut found, mut slope) = ([0.0; 2], [[0.0; 2]; 2]);
            let mut add = |shape: f64, derivative: [f64; 2], value: [f64; 2]| {
                for a in 0..2 {
                    found[a] += shape * value[a];
                    (0..2).for_each(|d| slope[a][d] += derivative[d] * value[a]);
                }
            };
            for i in 0..element.len() {
                add(p.map.shape[i], p.map.gradient[i], own[i]);
            }
            if let Some(inside) = &inside {
                let (shape, [by_xi, by_eta]) = element.family().bubble(p.master);
                let [xi, eta] = p.map.master_gradients(element.family());
                let derivative = [0, 1].map(|d| by_xi * xi[d] + by_eta * eta[d]);
                add(shape, derivative, inside.bubble);
            }
            let weight = p.weight;
            for a in 0..2 {
                off[0] += weight * (found[a] - u_exact[a]).powi(2);
                size[0] += weight * u_exact[a].powi(2);
                for d in 0..2 {
                    off[1] += weight * (slope[a][d] - gradient[a][d]).powi(2);
                    size[1] += weight * gradient[a][d].powi(2);
                }
            }
            if section.axisymmetric() {
                off[1] += weight * ((found[0] - u_exact[0]) / p.map.x).powi(2);
                size[1] += weight * (u_exact[0] / p.map.x).powi(2);
            }
            let strain_found = strain(slope, found[0], p.map.x);
            let stress_found = match &inside {
                Some(inside) => inside.stress(&strain_found, p.place).1,
                None => stress(moduli, &strain_found),
            };
            let stress_exact = stress(moduli, &strain(gradient, u_exact[0], p.map.x));
            for c in 0..4 {
                off[2] += weight * (stress_found[c] - stress_exact[c]).powi(2);
                size[2] += weight * stress_exact[c].powi(2);
            }
        }
    }
    [0, 1, 2].map(|k| f64::sqrt(off[k] / size[k]))
}

/// Rates 3 and 2 between the last two of four meshes, less .1 for what is left of the distortion; the
/// errors themselves at most about three times what was measured.
fn rates(kind: &str, analysis: Analysis, size: [f64; 2], exact: Exact<'_>) {
    for (family, points) in [
        (Family::Quad, 3),
        (Family::Quad, 2),
        (Family::Triangle, 3),
        (Family::Triangle, 2),
    ] {
        let of_size = |times: usize| match family {
            Family::Quad => mesh(size[0], size[1], times),
            Family::Triangle => triangles(&mesh(size[0], size[1], times)),
        };
        let (rule, meshes) = match family {
            Family::Quad => (format!("{points} × {points} points"), "2304 distorted Q8"),
            Family::Triangle => (format!("{} points", family.rule(points).len()), "4608 T6"),
        };
        let all: Vec<[f64; 3]> = (1..=4)
            .map(|times| errors(analysis, &of_size(times), points, NU, exact))
            .collect();
        for (norm, rate, most) in [(0, 3.0, 1e-5), (1, 2.0, 5e-4)] {
            let order = |pair: &[[f64; 3]]| (pair[0][norm] / pair[1][norm]).log2();
            let orders: Vec<f64> = all.windows(2).map(order).collect();
            let order = orders[orders.len() - 1];
            assert!(
                (order - rate).abs() < 0.1,
                "{kind}, {rule}: orders {orders:.3?} of {all:?}"
            );
            let what = format!(
                "manufactured solution, {kind}, {rule}: relative error in {}",
                ["L2", "H1"][norm]
            );
            Line {
                row: 5,
                what: &what,
                mesh: meshes,
                expected: 0.0,
                computed: all[3][norm],
                allowed: most,
                order: Some(order),
            }
            .hold();
        }
    }
}

#[test]
fn a_plane_field_converges_at_the_rates_of_quadratic_elements() {
    rates("plane strain", Analysis::PlaneStrain {}, [1.0, 1.0], &plane);
}

#[test]
fn a_field_of_revolution_converges_at_the_rates_of_quadratic_elements() {
    rates(
        "axisymmetric",
        Analysis::Axisymmetric {},
        [1.0, 2.0],
        &round,
    );
}

/// Fields whose dilatation falls like 1/λ while the pressure stays, as those of nearly incompressible bodies do:
/// u = v + (G/λ) w with div v = 0, so that λ div u = G div w.
///
/// Plane strain: v = (sin πx cos πy, −cos πx sin πy), w = (sin πx cos πy, cos πx sin πy),
///
///   div w = 2π cos πx cos πy,   ∇ div w = −2π² w,   ∇²v = −2π² v,   ∇²w = −2π² w
///   f = 2π² G (v + (1 + 2G/λ) w)
fn plane_at(ratio: f64) -> impl Fn([f64; 2]) -> At {
    let (shear, part) = shear_and_part(ratio);
    move |[x, y]| {
        let pi = std::f64::consts::PI;
        let ((sx, cx), (sy, cy)) = ((pi * x).sin_cos(), (pi * y).sin_cos());
        let (a, b) = (1.0 + part, 1.0 - part);
        let c = 1.0 + 2.0 * part;
        let scale = 2.0 * pi * pi * shear;
        At {
            u: [a * sx * cy, -b * cx * sy],
            gradient: [
                [pi * a * cx * cy, -pi * a * sx * sy],
                [pi * b * sx * sy, -pi * b * cx * cy],
            ],
            force: [scale * (1.0 + c) * sx * cy, scale * (c - 1.0) * cx * sy],
        }
    }
}

/// Axisymmetric: v = (r³ cos z, −4 r² sin z), w = (0, (1 + r²) sin z),
///
///   div w = (1 + r²) cos z,   ∇²v = ((8r − r³) cos z, (4r² − 16) sin z),   ∇²w = (0, (3 − r²) sin z)
///   f = −G ((1 + G/λ) ∇ div w + ∇²v + (G/λ) ∇²w)
fn round_at(ratio: f64) -> impl Fn([f64; 2]) -> At {
    let (shear, part) = shear_and_part(ratio);
    move |[r, z]| {
        let (s, c) = z.sin_cos();
        let r2 = r * r;
        let along = -4.0 * r2 + part * (1.0 + r2);
        At {
            u: [r * r2 * c, along * s],
            gradient: [
                [3.0 * r2 * c, -r * r2 * s],
                [(-8.0 + 2.0 * part) * r * s, along * c],
            ],
            force: [
                -shear * ((1.0 + part) * 2.0 * r + (8.0 - r2) * r) * c,
                -shear * (-(1.0 + part) * (1.0 + r2) + 4.0 * r2 - 16.0 + part * (3.0 - r2)) * s,
            ],
        }
    }
}

/// G and G/λ.
fn shear_and_part(ratio: f64) -> (f64, f64) {
    (
        E / (2.0 * (1.0 + ratio)),
        (1.0 - 2.0 * ratio) / (2.0 * ratio),
    )
}

/// Rates 3, 2 and 2 between the last two of four meshes as above, with errors that do not depend on ν. Only those of σ
/// may fall faster: the volume of the whole body is prescribed with the field on its boundary, the interpolated field's
/// differs from it by the fourth power of h, and λ is large.
#[test]
fn nearly_incompressible_fields_keep_the_rates() {
    let mut rows = Vec::new();
    for (family, meshes) in [
        (Family::Quad, "2304 distorted quadrilaterals"),
        (Family::Triangle, "4608 triangles"),
    ] {
        for (kind, analysis, size) in [
            ("plane strain", Analysis::PlaneStrain {}, [1.0, 1.0]),
            ("axisymmetric", Analysis::Axisymmetric {}, [1.0, 2.0]),
        ] {
            for ratio in [0.3, 0.49, 0.4999, 0.49999] {
                let exact: Box<dyn Fn([f64; 2]) -> At> = match kind {
                    "plane strain" => Box::new(plane_at(ratio)),
                    _ => Box::new(round_at(ratio)),
                };
                let all: Vec<[f64; 3]> = (1..=4)
                    .map(|times| {
                        let quads = mesh(size[0], size[1], times);
                        let mesh = match family {
                            Family::Quad => quads,
                            Family::Triangle => triangles(&quads),
                        };
                        errors(analysis, &mesh, 3, ratio, &exact)
                    })
                    .collect();
                let orders = [0, 1, 2].map(|norm| (all[2][norm] / all[3][norm]).log2());
                let mut row = vec![json!(kind), json!(meshes), json!(ratio)];
                for (norm, name, rate, most) in [
                    (0, "u", 3.0, 3e-5),
                    (1, "∇u", 2.0, 1.5e-3),
                    (2, "σ", 2.0, 2e-3),
                ] {
                    let order = orders[norm];
                    let faster = if norm == 2 { 1.0 } else { 0.1 };
                    assert!(
                        order > rate - 0.1 && order < rate + faster,
                        "{kind}, {meshes}, ν = {ratio}, {name}: orders {orders:.3?} of {all:?}"
                    );
                    Line {
                        row: 5,
                        what: &format!(
                            "pressure that stays, {kind}, ν = {ratio}: relative error of {name}"
                        ),
                        mesh: meshes,
                        expected: 0.0,
                        computed: all[3][norm],
                        allowed: most,
                        order: Some(order),
                    }
                    .hold();
                    row.push(json!(format!("{:.1e}", all[3][norm])));
                    row.push(json!(format!("{order:.2}")));
                }
                rows.push(row);
            }
        }
    }
    keep_table(
        "nearly_incompressible",
        &json!({
            "title": "Manufactured solutions whose pressure stays while their dilatation vanishes: relative errors, and orders",
            "columns": ["analysis", "mesh", "ν", "u", "order", "∇u", "order", "σ", "order"],
            "rows": rows,
        }),
    );
}
