//! Nodes at the same place that a mesh generator did not merge: a crack that nobody asked for, and nothing said so.

use serde_json::{Value, json};
use solver::error::Violation;
use solver::model::Model;
use solver::solution::{Warning, WarningCode};

use crate::support::{Lattice, problem, solve};

/// A bar of 4 × 2 squares; the nodes of the elements right of its middle are others, shifted by `apart`, but those of the
/// rows below `open`.
fn bar(open: usize, apart: f64) -> (Lattice, Vec<[f64; 2]>, Vec<[usize; 8]>) {
    let lattice = Lattice::new(4, 2, |i, j| [0.5 * i as f64, 0.5 * j as f64]);
    let (mut nodes, mut elements) = (lattice.nodes.clone(), lattice.elements.clone());
    let mut other = std::collections::BTreeMap::new();
    for (_, element) in elements.iter_mut().enumerate().filter(|(e, _)| e % 4 >= 2) {
        for node in element {
            let [x, y] = lattice.nodes[*node];
            if x == 2.0 && y >= open as f64 {
                *node = *other.entry(*node).or_insert_with(|| {
                    nodes.push([x + apart, y]);
                    nodes.len() - 1
                });
            }
        }
    }
    (lattice, nodes, elements)
}

/// The bar, held at its left end and pulled at its right one.
fn pulled(open: usize, apart: f64, supports: &Value) -> Value {
    let (lattice, nodes, elements) = bar(open, apart);
    let sides = json!({
        "left": lattice.edges(2, |k| (0, k)),
        "right": lattice.edges(2, |k| (8, k)),
    });
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"inline": {"nodes": nodes, "elements": elements, "boundaries": sides}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": supports,
        "loads": [{"boundary": "right", "traction": [10, 0]}],
    })
}

fn checked(value: &Value) -> Result<Vec<Warning>, Vec<Violation>> {
    Model::new(&problem(&value.to_string()), None).map(|model| model.warnings)
}

fn told(warnings: &[Warning]) -> Option<&Warning> {
    warnings
        .iter()
        .find(|w| w.code == WarningCode::CoincidentNodes)
}

/// Open over the upper of its two rows, the bar is half as stiff there, and its end moves much farther. Told with both nodes, the
/// place, the number of pairs and what to do; also where the places differ by rounding, whatever the unit; not for a slit
/// that is one, and not for merged nodes.
#[test]
fn unmerged_nodes_are_told() {
    let held = json!([{"boundary": "left", "ux": 0, "uy": 0}]);
    let end = |open: usize| {
        let solution = solve(&problem(&pulled(open, 0.0, &held).to_string()));
        let moved = solution.fields.ux.iter().fold(0.0f64, |a, b| a.max(*b));
        (moved, solution.summary.warnings)
    };
    let ((whole, silent), (open, warnings)) = (end(9), end(1));
    assert!(told(&silent).is_none());
    assert!(open > 1.5 * whole, "{open} {whole}");
    let warning = told(&warnings).unwrap();
    assert_eq!(warning.pointer, "/mesh");
    // the bottom of the crack at (2, 1) is open too: the lower row ends there
    for part in ["both at (2, 1)", "3 such pairs", "crack", "Coherence Mesh"] {
        assert!(warning.message.contains(part), "{}", warning.message);
    }
    let wide =
        json!([{"boundary": "left", "ux": 0, "uy": 0}, {"boundary": "right", "uy": 0, "ux": 0.1}]);
    for (apart, found) in [(0.0, true), (1e-7, true), (-1e-7, true), (1e-3, false)] {
        for scale in [1.0, 1e-6, 1e6] {
            let mut value = pulled(0, apart, &wide);
            value["loads"] = json!([]);
            for node in value["mesh"]["inline"]["nodes"].as_array_mut().unwrap() {
                *node = json!([
                    scale * node[0].as_f64().unwrap(),
                    scale * node[1].as_f64().unwrap()
                ]);
            }
            let warnings = checked(&value).unwrap();
            assert_eq!(told(&warnings).is_some(), found, "{apart} {scale}");
            assert!(!found || told(&warnings).unwrap().message.contains("5 such pairs"));
        }
    }
    // refined, and adaptively, it is told once, as of the mesh that was given
    for refine in [json!(2), json!({"tolerance": 0.1})] {
        let mut value = pulled(1, 0.0, &held);
        value["mesh"]["refine"] = refine.clone();
        if refine.is_object() {
            let lattice = bar(1, 0.0).0;
            value["mesh"]["inline"]["boundaries"]["bottom"] =
                json!(lattice.edges(1, |k| (2 + k, 0)));
            value["contacts"] =
                json!([{"boundary": "bottom", "obstacle": {"kind": "flat"}, "indentation": 0.01}]);
        }
        let warnings = solve(&problem(&value.to_string())).summary.warnings;
        let found: Vec<&Warning> = warnings
            .iter()
            .filter(|w| w.code == WarningCode::CoincidentNodes)
            .collect();
        assert_eq!(found.len(), 1, "{warnings:#?}");
        assert!(found[0].message.contains("3 such pairs"));
    }
}

/// Where the body falls apart, or a boundary into pieces, that is refused; the unmerged nodes are named as a cause.
#[test]
fn refusals_name_unmerged_nodes() {
    let held = json!([{"boundary": "left", "ux": 0, "uy": 0}]);
    let found = checked(&pulled(0, 0.0, &held)).unwrap_err();
    assert_eq!(found[0].reason.as_str(), "free_body");
    assert!(
        found[0]
            .hint
            .contains("(5 such pairs in total): merge them"),
        "{}",
        found[0].hint
    );

    let mut value = pulled(1, 0.0, &held);
    let (lattice, nodes, _) = bar(1, 0.0);
    let mut top = lattice.edges(4, |k| (k, 4));
    // the right part of the top begins at the other node
    let corner = nodes.len() - 1 - nodes.iter().rev().position(|x| *x == [2.0, 2.0]).unwrap();
    top[2][0] = corner;
    value["mesh"]["inline"]["boundaries"]["top"] = json!(top);
    value["contacts"] =
        json!([{"boundary": "top", "obstacle": {"kind": "flat"}, "indentation": 0.01}]);
    let found = checked(&value).unwrap_err();
    assert_eq!(found[0].reason.as_str(), "not_a_chain");
    assert!(
        found[0]
            .hint
            .contains("(3 such pairs in total): merge them"),
        "{}",
        found[0].hint
    );
}

/// A file of a generator whose surfaces do not share their curve: the same warning.
#[test]
fn a_file_with_unmerged_nodes_is_reported() {
    let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n1 1 \"left\"\n$EndPhysicalNames\n$Nodes\n8\n\
        1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 1 0 0\n6 2 0 0\n7 2 1 0\n8 1 1 0\n$EndNodes\n$Elements\n3\n\
        1 1 2 1 1 4 1\n2 3 2 2 1 1 2 3 4\n3 3 2 2 1 5 6 7 8\n$EndElements\n";
    let value = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"gmsh": text, "boundaries": {"end": {"normal": [1, 0]}}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "left", "ux": 0, "uy": 0}, {"boundary": "end", "ux": 0.1, "uy": 0}],
    });
    let problem = problem(&value.to_string());
    let model = Model::new(&problem, files::external_mesh(&problem, None)).unwrap();
    let warning = told(&model.warnings).unwrap();
    assert!(
        warning.message.contains("at (1, 0)") && warning.message.contains("3 such pairs"),
        "{}",
        warning.message
    );
}

/// A crack whose two sides are contacts is meant.
#[test]
fn a_crack_between_two_contacts_is_meant() {
    let supports =
        json!([{"boundary": "left", "ux": 0, "uy": 0}, {"boundary": "right", "ux": 0, "uy": 0}]);
    let mut value = pulled(0, 0.0, &supports);
    let (lattice, nodes, _) = bar(0, 0.0);
    let own = lattice.edges(2, |k| (4, k));
    let other = own.iter().map(|edge| {
        edge.map(|node| {
            (0..nodes.len())
                .rev()
                .find(|n| nodes[*n] == nodes[node])
                .unwrap()
        })
    });
    let sides = &mut value["mesh"]["inline"]["boundaries"];
    sides["other"] = json!(other.collect::<Vec<_>>());
    sides["own"] = json!(own);
    let contact =
        |name: &str| json!({"boundary": name, "obstacle": {"kind": "flat"}, "indentation": 0.01});
    value["contacts"] = json!([contact("own"), contact("other")]);
    assert!(told(&checked(&value).unwrap()).is_none());
    value["contacts"] = json!([contact("own")]);
    assert!(told(&checked(&value).unwrap()).is_some());
}

/// Two long columns side by side, and many elements at one place: found in a moment, whatever the order and the number.
#[test]
fn very_many_unmerged_nodes_are_found_at_once() {
    let rows = 20_000;
    let column = |x: f64| Lattice::new(1, rows, |i, j| [x + 0.5 * i as f64, 0.5 * j as f64]);
    let (left, right) = (column(0.0), column(1.0));
    let mut nodes = left.nodes.clone();
    let first = nodes.len();
    nodes.extend(&right.nodes);
    let mut elements = left.elements.clone();
    elements.extend(right.elements.iter().map(|e| e.map(|n| n + first)));
    let ends = |lattice: &Lattice, from: usize| {
        lattice
            .edges(1, |k| (2 - k, 0))
            .iter()
            .map(|e| e.map(|n| n + from))
            .collect::<Vec<_>>()
    };
    let value = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"inline": {"nodes": nodes, "elements": elements, "boundaries": {"a": ends(&left, 0), "b": ends(&right, first)}}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "a", "ux": 0, "uy": 0}, {"boundary": "b", "ux": 0, "uy": 0}],
    });
    let warnings = checked(&value).unwrap();
    let message = &told(&warnings).unwrap().message;
    assert!(
        message.contains(&format!("{} such pairs", 2 * rows + 1)),
        "{message}"
    );

    let same = 3000;
    let square = Lattice::new(1, 1, |i, j| [0.5 * i as f64, 0.5 * j as f64]);
    let mut nodes: Vec<[f64; 2]> = Vec::new();
    let mut elements = Vec::new();
    for _ in 0..same {
        let first = nodes.len();
        nodes.extend(&square.nodes);
        elements.push(square.elements[0].map(|n| n + first));
    }
    let all: Vec<usize> = (0..nodes.len()).collect();
    let value = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"inline": {"nodes": nodes, "elements": elements, "node_sets": {"all": all}}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"nodes": "all", "ux": 0, "uy": 0}],
    });
    let warnings = checked(&value).unwrap();
    let message = &told(&warnings).unwrap().message;
    assert!(
        message.contains(&format!("{} such pairs", 8 * (same - 1))),
        "{message}"
    );
}
