//! Forces of decks: per unit of thickness in plane strain, on the whole ring of a body of revolution.

use files::abaqus;
use serde_json::json;
use solver::error::Reason;
use solver::problem::Problem;
use solver::solution::WarningCode;

use crate::support::{close, problem, solve};

/// A square of one element, held below at y, pulled at its upper side by 3 in all, 1 : 4 : 1 as a constant stress does.
fn square(kind: &str, section: &str) -> String {
    format!(
        "*NODE\n1, 0, 0\n2, 1, 0\n3, 1, 1\n4, 0, 1\n5, .5, 0\n6, 1, .5\n7, .5, 1\n8, 0, .5\n\
        *ELEMENT, TYPE={kind}, ELSET=E\n1, 1, 2, 3, 4, 5, 6, 7, 8\n*MATERIAL, NAME=M\n*ELASTIC\n1000., 0.\n\
        *SOLID SECTION, ELSET=E, MATERIAL=M\n{section}\n*NSET, NSET=LOW\n1, 2, 5\n*NSET, NSET=ENDS\n3, 4\n*BOUNDARY\nLOW, 2\n1, 1\n\
        *STEP\n*STATIC\n*CLOAD\nENDS, 2, 0.5\n7, 2, 2.\n*END STEP\n"
    )
}

fn rise(deck: &str) -> f64 {
    let solution = solve(&abaqus::problem(deck).unwrap());
    solution.fields.uy[2]
}

/// u_y = F/(t E) in a sheet and in plane strain, whose forces are given for the thickness of the section; and it is told.
#[test]
fn a_force_is_that_of_the_whole_thickness() {
    for kind in ["CPS8", "CPE8"] {
        for (section, thickness) in [("", 1.0), ("0.01,", 0.01), ("2.,", 2.0)] {
            close(rise(&square(kind, section)), 3e-3 / thickness, 1e-12);
        }
    }
    let (_, warnings) = abaqus::problem_with_warnings(&square("CPE8", "0.01,")).unwrap();
    assert!(warnings.iter().any(|w| w.code == WarningCode::DeckDiffers));
    let (_, warnings) = abaqus::problem_with_warnings(&square("CPS8", "0.01,")).unwrap();
    assert!(warnings.is_empty());
}

/// A uniform stress 3/π on a cylinder of radius 1 is a force of 1 on the ring of midsides and .5 at the rim, of 3 in all:
/// ∫h r dr is 0, 1/3 and 1/6. CalculiX gives u_y = 2.738e-3 for forces of π at the nodes 3 and 7.
#[test]
fn a_force_on_a_body_of_revolution_acts_on_the_whole_ring() {
    let deck = square("CAX8", "").replace("ENDS, 2, 0.5\n7, 2, 2.", "3, 2, 1.\n7, 2, 2.");
    close(rise(&deck), 3e-3 / std::f64::consts::PI, 1e-12);
    let deck = square("CAX8", "").replace(
        "ENDS, 2, 0.5\n7, 2, 2.",
        "3, 2, 3.14159265\n7, 2, 3.14159265",
    );
    close(rise(&deck), 2.7377e-3, 1e-3);
}

/// CalculiX reads keywords and parameters without their blanks.
#[test]
fn blanks_in_keywords_may_be_left_out() {
    let deck = square("CPS8", "0.5,");
    let without = deck
        .replace("SOLID SECTION", "SOLIDSECTION")
        .replace("END STEP", "ENDSTEP");
    assert_eq!(rise(&deck), rise(&without));
}

/// A node that belongs to no element moves no body: a force on it, or on a set with it, is refused, in decks and where a mesh comes
/// from one; a support of it holds nothing.
#[test]
fn a_force_on_nodes_without_elements_is_refused() {
    let square =
        square("CPS8", "").replace("*ELEMENT", "99, 7, 7\n*NSET, NSET=FIRST\n1,\n*ELEMENT");
    let with = |from: &str, to: &str| {
        assert!(square.contains(from));
        square.replace(from, to)
    };
    for deck in [
        with("NSET=ENDS\n3, 4\n", "NSET=ENDS\n99\n"),
        with("ENDS, 2, 0.5\n", "ENDS, 2, 0.5\n99, 2, 1.\n"),
    ] {
        let found = format!("{:?}", abaqus::problem(&deck).unwrap_err());
        assert!(
            found.contains("node 99 belongs to no plane element"),
            "{found}"
        );
    }
    let set = with("NSET=ENDS\n3, 4\n", "NSET=ENDS\n3, 4, 99\n");
    let refused = |problem: &Problem| {
        let found = solver::check(problem, files::external_mesh(problem, None)).unwrap_err();
        let found: Vec<_> = found.iter().map(|v| (&*v.pointer, v.reason)).collect();
        assert_eq!(found, [("/loads/0/nodes", Reason::UnusedNode)]);
    };
    refused(&abaqus::problem(&set).unwrap());
    for refine in [0, 1] {
        let on_mesh_of_deck = json!({
            "analysis": {"kind": "plane_stress", "thickness": 1},
            "mesh": {"abaqus": set, "refine": refine},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0}],
            "supports": [{"nodes": "LOW", "uy": 0}, {"nodes": "FIRST", "ux": 0}],
            "loads": [{"nodes": "ENDS", "force": [0, 0.5]}],
        });
        refused(&problem(&on_mesh_of_deck.to_string()));
    }
    let held = with("NSET=LOW\n1, 2, 5\n", "NSET=LOW\n1, 2, 5, 99\n");
    close(rise(&square), 3e-3, 1e-12);
    close(rise(&held), 3e-3, 1e-12);
}
