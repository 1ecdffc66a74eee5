//! A body that only contact holds has no factor: springs on the contact unknowns give it one, and are
//! taken off again. Nothing of them may be left in what comes out.

use faer::Side;
use serde_json::{Value, json};
use solver::body::ElasticBody;
use solver::elasticity::Dof;
use solver::linear::Dense;
use solver::model::{Level, Model};

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

fn entries(matrix: &Dense) -> Vec<f64> {
    (0..matrix.size())
        .flat_map(|j| matrix.column(j).to_vec())
        .collect()
}

/// Ŝ, f̂ at a level and displacements, with and without springs. 1e-9: the springs are as stiff as
/// the body, so that a few digits are lost when they are taken off, and no more.
#[test]
fn springs_do_not_change_a_supported_body() {
    let level = Level {
        loads: 0.7,
        supports: 1.3,
        ..Level::FULL
    };
    let supports = json!([{"boundary": "top", "ux": 0.01, "uy": [-0.02, 0.01]}]);
    for kind in ["plane_strain", "axisymmetric"] {
        let mut model = block(&json!({"kind": kind}), &supports);
        assert!(!model.held_by_contact);
        let plain = ElasticBody::new(&model, &mut quiet).unwrap();
        model.held_by_contact = true;
        let sprung = ElasticBody::new(&model, &mut quiet).unwrap();
        let close = |what: &str, a: &[f64], b: &[f64]| {
            let off = largest(&a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<_>>());
            assert!(off < 1e-9 * largest(a), "{kind}, {what}: {off:.1e}");
        };
        close("Ŝ", &entries(&plain.stiffness), &entries(&sprung.stiffness));
        close("f̂", &plain.load(&level), &sprung.load(&level));
        // any displacement of Γ_C, with the force that belongs to it
        let v: Vec<f64> = (0..plain.stiffness.size())
            .map(|i| 0.01 * (i as f64).sin())
            .collect();
        let force: Vec<f64> = plain
            .stiffness
            .times(&v)
            .iter()
            .zip(plain.load(&level))
            .map(|(s, f)| s - f)
            .collect();
        let field = |body: &ElasticBody| body.displacements(&force, &v, &level).concat();
        close("u", &field(&plain), &field(&sprung));
        // and it is the field that has v on Γ_C
        for (node, dofs) in model.contacts[0]
            .boundary
            .nodes
            .iter()
            .zip(&plain.contact_dofs)
        {
            let u = sprung.displacements(&force, &v, &level)[*node as usize];
            for (dof, along) in dofs.iter().zip(sprung.map.to_axes(*node as usize, u)) {
                if let Dof::Free(i) = dof {
                    assert!((along - v[*i]).abs() < 1e-11);
                }
            }
        }
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
