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

use solver::elasticity::{Dof, DofMap, Section, assemble_stiffness, isotropic};
use solver::element::{Element, Family, GaussPoint, Mapped, gauss};
use solver::linear::{Breaks, Factor, Graph, Ordering};
use solver::mesh::{Mesh, grid_mesh, refine};
use solver::problem::{Analysis, Grid};

use crate::record::Line;

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

type Exact = fn([f64; 2]) -> At;

/// What is done at an integration point: with its element, map, place and weight.
type Visit<'a> = dyn FnMut(&Element, &Mapped, [f64; 2], f64) + 'a;

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

/// Norms of the error of u (L2) and of its gradient (H1 seminorm; in axisymmetry with u_r/r), relative.
fn errors(analysis: Analysis, mesh: &Mesh, points: u32, exact: Exact) -> [f64; 2] {
    let section = Section::uniform(analysis, isotropic(&analysis, E, NU));
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
    let graph = Graph::from_cliques(mesh.nodes.len(), mesh.elements.iter().map(|e| &e[..]));
    let (matrix, mut load) = assemble_stiffness(mesh, &section, points, &map, &graph);
    // a rule finer than the element's own: integration of f and of the error is not what is tested
    let fine = [Family::Quad, Family::Triangle].map(fine_rule);
    let at_points = |visit: &mut Visit<'_>| {
        for element in &mesh.elements {
            let (family, nodes) = (element.family(), mesh.element_nodes(element));
            for point in &fine[family as usize] {
                let m = family.map(&nodes, point.place);
                let y = (0..8).map(|i| m.shape[i] * nodes[i][1]).sum();
                let weight = point.weight * m.det * section.depth(m.x);
                visit(element, &m, [m.x, y], weight);
            }
        }
    };
    at_points(&mut |element, m, place, weight| {
        let force = exact(place).force;
        for (i, node) in element.iter().enumerate() {
            for (dof, f) in map.dofs[*node as usize].iter().zip(force) {
                if let Dof::Free(k) = dof {
                    load[*k] += weight * m.shape[i] * f;
                }
            }
        }
    });
    let cliques: Vec<Vec<u32>> = mesh
        .elements
        .iter()
        .map(|element| {
            let dofs = element.iter().flat_map(|n| map.dofs[*n as usize]);
            let free = |dof| match dof {
                Dof::Free(i) => Some(i as u32),
                Dof::Fixed(_) => None,
            };
            dofs.filter_map(free).collect()
        })
        .collect();
    let unknowns = Graph::from_cliques(map.unknowns, cliques.iter().map(|c| &c[..]));
    let order = Ordering::minimum_degree(&unknowns).unwrap();
    let ordering = Ordering::new(&matrix, &order, 0).unwrap();
    let go_on = &mut || std::ops::ControlFlow::Continue(());
    let factor = Factor::new(&matrix, ordering, &mut Breaks::new(go_on));
    factor.unwrap().solve(&mut load);
    let u = map.displacements(&load, 1.0);
    let (mut off, mut size) = ([0.0; 2], [0.0; 2]);
    at_points(&mut |element, m, place, weight| {
        let At {
            u: u_exact,
            gradient,
            ..
        } = exact(place);
        for a in 0..2 {
            let sum = |of: &dyn Fn(usize) -> f64| {
                (0..element.len())
                    .map(|i| of(i) * u[element[i] as usize][a])
                    .sum::<f64>()
            };
            let found = sum(&|i| m.shape[i]);
            off[0] += weight * (found - u_exact[a]).powi(2);
            size[0] += weight * u_exact[a].powi(2);
            for d in 0..2 {
                off[1] += weight * (sum(&|i| m.gradient[i][d]) - gradient[a][d]).powi(2);
                size[1] += weight * gradient[a][d].powi(2);
            }
            if a == 0 && section.axisymmetric() {
                off[1] += weight * ((found - u_exact[0]) / m.x).powi(2);
                size[1] += weight * (u_exact[0] / m.x).powi(2);
            }
        }
    });
    [0, 1].map(|k| f64::sqrt(off[k] / size[k]))
}

/// Rates 3 and 2 between the last two of four meshes, less .1 for what is left of the distortion; the
/// errors themselves at most about three times what was measured.
fn rates(kind: &str, analysis: Analysis, size: [f64; 2], exact: Exact) {
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
        let all: Vec<[f64; 2]> = (1..=4)
            .map(|times| errors(analysis, &of_size(times), points, exact))
            .collect();
        for (norm, rate, most) in [(0, 3.0, 1e-5), (1, 2.0, 5e-4)] {
            let order = |pair: &[[f64; 2]]| (pair[0][norm] / pair[1][norm]).log2();
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
    rates("plane strain", Analysis::PlaneStrain {}, [1.0, 1.0], plane);
}

#[test]
fn a_field_of_revolution_converges_at_the_rates_of_quadratic_elements() {
    rates("axisymmetric", Analysis::Axisymmetric {}, [1.0, 2.0], round);
}
