//! Decks of Abaqus and CalculiX. That the numbers agree with CalculiX's own is `tests/calculix.py`.

use files::{ReadError, abaqus};
use serde_json::json;
use solver::mesh::Mesh;
use solver::problem::{Analysis, BoundaryValue, Load};

use crate::support::{problem, solve};

fn deck(name: &str) -> String {
    let path = format!("{}/data/abaqus/{name}.inp", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

fn read(text: &str) -> Mesh {
    match abaqus::read(text.as_bytes()) {
        Ok((mesh, _)) => mesh,
        Err(error) => panic!("{error:#?}"),
    }
}

fn faults(text: &str) -> Vec<String> {
    let Err(ReadError::Invalid(list)) = abaqus::read(text.as_bytes()) else {
        panic!("a broken deck was read");
    };
    list.into_iter().map(|v| v.got).collect()
}

fn doubts(text: &str) -> Vec<String> {
    let list = abaqus::problem(text).expect_err("a doubtful deck was taken");
    list.into_iter().map(|v| v.got).collect()
}

/// Names keep their first spelling whatever the case later on; a pressure names its sides.
#[test]
fn a_deck_becomes_a_problem_with_the_names_of_the_deck() {
    let problem = abaqus::problem(&deck("ring-cps8")).unwrap();
    assert_eq!(problem.title.as_deref(), Some("Quarter ring, CPS8"));
    assert_eq!(problem.analysis, Analysis::PlaneStress { thickness: 0.25 });
    assert_eq!(problem.materials[0].group.as_deref(), Some("Eall"));
    let elasticity = serde_json::to_value(&problem.materials[0]).unwrap();
    assert_eq!(elasticity["youngs_modulus"], 2100.0);
    let names: Vec<_> = problem
        .supports
        .iter()
        .map(|s| s.nodes.as_deref())
        .collect();
    assert_eq!(names, [Some("fixed"), Some("end")]);
    assert_eq!(problem.supports[1].ux, Some(BoundaryValue::Constant(0.02)));
    assert!(matches!(&problem.loads[0], Load::Pressure(boundary, _) if boundary == "inner P1"));
    assert!(matches!(problem.loads[1], Load::Force(_, [0.0, -1.5])));
    let mesh = read(&deck("ring-cps8"));
    assert_eq!(mesh.boundaries["inner P1"].len(), 6);
    // the set of nodes spans the same sides
    let mut sides = mesh.boundaries["inside"].clone();
    sides.sort_unstable();
    assert_eq!(mesh.boundaries["inner P1"], sides);
    assert!(solve(&problem).summary.residuals.equilibrium < 1e-10);
}

#[test]
fn reduced_integration_and_triangles_determine_the_rule() {
    for (name, quadrature) in [
        ("ring-cpe8", 3),
        ("ring-cpe8r", 2),
        ("ring-cpe6", 2),
        ("ring-cax8", 3),
    ] {
        assert_eq!(
            abaqus::problem(&deck(name)).unwrap().quadrature,
            quadrature,
            "{name}"
        );
    }
}

const SQUARES: &str = "*Heading
 two squares, as a preprocessor writes them
*Part, name=Part-1
*Node
      1,           0.,           0.
      2,           1.,           0.
      3,          2.0,          0.0
     11,           0.,           1.
     12,           1.,           1.
     13,        2.D+0,           1.
*Element, type=CPE4R
1, 1, 2, 12, 11
2, 2, 3, 13, 12
*Nset, nset=Low, generate
 1, 3, 1
*Elset, elset=both, generate
 1, 2
*Solid Section, elset=BOTH, material=Rubber
,
*End Part
*Assembly, name=Assembly
*Instance, name=Part-1-1, part=Part-1
*End Instance
*Surface, type=ELEMENT, name=Upper
both, S3
*End Assembly
*Material, name=Rubber
*Elastic
1000., 0.3
*Boundary
Low, ENCASTRE
";

/// Corners become elements of second order, and their sets keep what they held; a surface can touch an
/// obstacle.
#[test]
fn a_first_order_mesh_of_a_preprocessor_can_be_in_contact() {
    let mesh = read(SQUARES);
    assert_eq!((mesh.nodes.len(), mesh.elements.len()), (13, 2));
    assert_eq!(mesh.node_sets["Low"].len(), 5);
    assert_eq!(
        (mesh.boundaries["Low"].len(), mesh.boundaries["Upper"].len()),
        (2, 2)
    );
    assert_eq!(mesh.groups["both"], [0, 1]);
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"abaqus": SQUARES, "refine": 2},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3, "group": "both"}],
        "supports": [{"nodes": "Low", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "Upper", "obstacle": {"kind": "flat"}, "indentation": 0.01,
            "friction": {"coefficient": 0.3, "nonlocal_radius": 0.1, "elastic_slip": 1e-3}}],
    });
    let refined = solve(&problem(&text.to_string()));
    // the set was refined with the mesh: the support has no holes, as on the boundary of that name
    let on_boundary = text
        .to_string()
        .replace(r#""nodes":"Low""#, r#""boundary":"Low""#);
    let same = solve(&problem(&on_boundary));
    assert_eq!(refined.summary.normal_force, same.summary.normal_force);
    assert!(refined.summary.normal_force > 10.0);
    let whole = format!("{SQUARES}*Step\n*Static\n*End Step\n");
    assert_eq!(abaqus::problem(&whole).unwrap().supports.len(), 1);
}

#[test]
fn faults_of_a_mesh_are_reported_with_their_line() {
    let with = |from: &str, to: &str| {
        assert!(SQUARES.contains(from), "{from}");
        SQUARES.replacen(from, to, 1)
    };
    for (from, to, reported) in [
        (
            "2, 2, 3, 13, 12",
            "2, 2, 3, 99, 12",
            "line 13: node 99 in element 2",
        ),
        (
            "2, 2, 3, 13, 12",
            "1, 2, 3, 13, 12",
            "line 13: element 1 a second time",
        ),
        (
            "2, 2, 3, 13, 12",
            "2, 2, 3, 13",
            "line 14: 3 numbers for element 2",
        ),
        ("CPE4R", "C3D8", "line 11: elements of type `C3D8`"),
        ("*Nset, nset=Low", "*Nset", "line 14: *NSET"),
        (
            "     13,        2.D+0",
            "     12,        2.D+0",
            "line 10: node 12 a second time",
        ),
        (
            "      3,          2.0",
            "      3,          two",
            "line 7: `3,          two,          0.0`",
        ),
        (
            "      3,          2.0,          0.0",
            "      3,          2.0,          0.0, 5",
            "z = 0 at node 1 and 5 at node 3",
        ),
        (
            "both, S3",
            "booth, S3",
            "line 24: `booth` in the surface `Upper`",
        ),
        (
            "*Instance, name=Part-1-1, part=Part-1",
            "*Instance, name=Part-1-1, part=Part-2",
            "line 22: the part `Part-2`",
        ),
        (
            "*Material",
            "*Include, input=x.inp\n*Material",
            "line 27: *INCLUDE",
        ),
    ] {
        let found = faults(&with(from, to));
        assert!(found.contains(&reported.to_owned()), "{to}: {found:?}");
    }
    assert!(faults("")[0].contains("without *NODE"));
}

/// In a whole problem every keyword counts.
#[test]
fn unsupported_parts_of_a_deck_are_errors_with_their_line() {
    let good = deck("ring-cpe8");
    let line = |text: &str| 1 + good.lines().position(|l| l == text).unwrap();
    for (from, to, reported) in [
        ("*STATIC", "*DYNAMIC", "*DYNAMIC".to_owned()),
        ("*STEP", "*STEP, NLGEOM", "*STEP, NLGEOM".to_owned()),
        (
            "INNER, P1, 5.",
            "INNER, NEWTON, 9.81, 0., -1.",
            "`INNER, NEWTON, 9.81, 0., -1.`".to_owned(),
        ),
        (
            "Fixed, 1, 2",
            "Fixed, 11, 11, 20.",
            "`Fixed, 11, 11, 20.`".to_owned(),
        ),
        ("2.1D3, .3", "2.1D3", "1 elastic constants".to_owned()),
    ] {
        let at = if reported.contains("constants") {
            line(from) - 1
        } else {
            line(from)
        };
        let found = doubts(&good.replacen(from, to, 1));
        assert!(
            found
                .iter()
                .any(|got| got.starts_with(&format!("line {at}: {reported}"))),
            "{to}: {found:?}"
        );
    }
    let two = good.clone() + "*STEP\n*STATIC\n*END STEP\n";
    assert!(doubts(&two)[0].contains("2 steps"));
    let rotated = good.replacen("Fixed, 1, 2", "Fixed, 1, 6", 1);
    assert!(abaqus::problem(&rotated).is_ok());
}
