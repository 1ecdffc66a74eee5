//! The body condensed onto its contacts: against its whole stiffness, and where only contact holds it.

use faer::Side;
use serde_json::{Value, json};
use solver::body::ElasticBody;
use solver::elasticity::Dof;
use solver::model::{Level, Model};

use crate::assembled::Assembled;
use crate::support::{problem, quiet};

/// A block whose lower side, a broken line, faces an obstacle: the contact nodes' axes differ. Off the
/// axis, where nothing but supports holds it.
fn block(analysis: &Value, supports: &Value) -> Model {
    let text = json!({
        "analysis": analysis,
        "mesh": {"grid": {"x": [1, 1.4, 2, 3], "y": [0, 0.3, 1], "bottom": [[1, 0], [2, 0.2], [3, 0.3]], "top": [[1, 1], [3, 1.2]]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": supports,
        "loads": [{"boundary": "right", "pressure": [2, 5]}, {"body_force": [0.5, -1]}],
        "contacts": [{"boundary": "bottom", "obstacle": {"kind": "flat"}, "condition": "bonded"}],
    });
    Model::new(&problem(&text.to_string()), None).unwrap()
}

fn largest<'a>(values: impl IntoIterator<Item = &'a f64>) -> f64 {
    values.into_iter().fold(0.0, |most, v| v.abs().max(most))
}

/// Ŝ, f̂ at a level and displacements against those of the whole stiffness, of which each column of Ŝ⁻¹ is a solution.
/// 1e-11: both lose some digits, in a matrix of another condition.
#[test]
fn the_condensed_body_is_that_of_the_whole_stiffness() {
    let level = Level {
        loads: 0.7,
        supports: 1.3,
        ..Level::FULL
    };
    let supports = json!([{"boundary": "top", "ux": 0.01, "uy": [-0.02, 0.01]}]);
    for kind in ["plane_strain", "axisymmetric"] {
        let model = block(&json!({"kind": kind}), &supports);
        let body = ElasticBody::new(&model, &mut quiet).unwrap();
        let (whole, of_supports) =
            Assembled::new(&model.mesh, &model.section, model.quadrature, &body.map);
        let close = |what: &str, a: &[f64], b: &[f64]| {
            let off = largest(&a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<_>>());
            assert!(off < 1e-11 * largest(b), "{kind}, {what}: {off:.1e}");
        };
        let (n, m) = (whole.size(), body.stiffness.size());
        assert!(m > 10 && n > 3 * m);
        for j in 0..m {
            let mut unit = vec![0.0; n];
            unit[n - m + j] = 1.0;
            let column = whole.solve(&unit).split_off(n - m);
            close("Ŝ", &body.stiffness.times(&column), &unit[n - m..]);
        }
        let mut forces: Vec<f64> = of_supports.iter().map(|f| level.supports * f).collect();
        for (node, load) in body.nodal_loads.iter().enumerate() {
            let load = body.map.to_axes(node, load.map(|f| level.loads * f));
            for (dof, f) in body.map.dofs[node].iter().zip(load) {
                if let Dof::Free(i) = dof {
                    forces[*i] += f;
                }
            }
        }
        assert!(largest(&forces) > 0.0);
        let free = whole.solve(&forces);
        close(
            "f̂",
            &body.load(&level),
            &body.stiffness.times(&free[n - m..]),
        );
        // any displacement of Γ_C, held by the force that belongs to it
        let v: Vec<f64> = (0..m).map(|i| 0.01 * (i as f64).sin()).collect();
        let held = body.stiffness.times(&v).into_iter().zip(body.load(&level));
        held.enumerate()
            .for_each(|(i, (s, f))| forces[n - m + i] += s - f);
        let u = whole.solve(&forces);
        let u = body.map.displacements(|i| u[i], level.supports).concat();
        close("u", &body.displacements(&v, &level).concat(), &u);
    }
}

/// Without supports Ŝ costs nothing for rigid motions, and for nothing else: as many eigenvalues are
/// zero to rounding (1e-10 of the largest, with a gap of 1e4 to the next) as there are motions.
#[test]
fn only_rigid_motions_of_an_unsupported_body_need_no_energy() {
    let plane: [fn([f64; 2]) -> [f64; 2]; 3] = [|_| [1.0, 0.0], |_| [0.0, 1.0], |[x, y]| [-y, x]];
    let cases = [("plane_strain", &plane[..]), ("axisymmetric", &plane[1..2])];
    for (kind, motions) in cases {
        let model = block(&json!({"kind": kind}), &json!([]));
        assert!(model.held_by_contact);
        let body = ElasticBody::new(&model, &mut quiet).unwrap();
        let n = body.stiffness.size();
        let values = faer::Mat::from_fn(n, n, |i, j| body.stiffness.at(i, j))
            .self_adjoint_eigenvalues(Side::Lower)
            .unwrap();
        let most = largest(&values);
        let below = |limit: f64| values.iter().filter(|v| v.abs() < limit * most).count();
        assert_eq!(
            (below(1e-10), below(1e-6)),
            (motions.len(), motions.len()),
            "{kind}: {values:?}"
        );
        for motion in motions {
            let mut v = vec![0.0; n];
            let boundary = &model.contacts[0].boundary;
            for (i, dofs) in body.contact_dofs.iter().enumerate() {
                let node = boundary.nodes[i] as usize;
                let along = body.map.to_axes(node, motion(boundary.positions[i]));
                for (dof, u) in dofs.iter().zip(along) {
                    if let Dof::Free(i) = dof {
                        v[*i] = u;
                    }
                }
            }
            let force = largest(&body.stiffness.times(&v));
            assert!(force < 1e-11 * most * largest(&v), "{kind}: {force:.1e}");
        }
    }
}
