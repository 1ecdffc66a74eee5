//! Decks of two elastic bodies: *CONTACT PAIR, *TIE and *CLEARANCE become contacts of two bodies. The decks themselves are compared
//! with CalculiX by `tests/calculix.py`.

use files::abaqus;
use solver::problem::{Condition, History, Problem};
use solver::solution::Warning;

use crate::record::held;
use crate::support::{close, solve};

fn deck(name: &str) -> String {
    let path = format!("{}/data/abaqus/{name}.inp", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(path).unwrap()
}

fn read(text: &str) -> (Problem, Vec<Warning>) {
    abaqus::problem_with_warnings(text).unwrap_or_else(|violations| panic!("{violations:#?}"))
}

/// What is wrong with a deck, in words.
fn refused(text: &str) -> String {
    let violations = abaqus::problem(text).unwrap_err();
    let words = violations
        .iter()
        .map(|v| format!("{} ({})", v.got, v.pointer));
    words.collect::<Vec<_>>().join("\n")
}

/// The first surface carries the law, the second faces it; friction is that of decks.
#[test]
fn a_contact_pair_of_two_bodies_is_a_contact() {
    let text = deck("pair-roller-cpe8");
    let (problem, _) = read(&text);
    let [contact] = &problem.contacts[..] else {
        panic!("{:?}", problem.contacts);
    };
    assert_eq!(contact.boundary, "FACEA");
    assert_eq!(contact.against.as_ref().unwrap().boundary, "FACEB");
    assert_eq!(
        (&contact.gap, &contact.obstacle, contact.condition),
        (&None, &None, Condition::Unilateral)
    );
    assert!(contact.friction.is_none() && problem.steps.is_empty());
    let summary = solve(&problem).summary;
    assert!(
        summary.residuals.equilibrium < 1e-9,
        "{:?}",
        summary.residuals
    );

    let rough = text.replace("1e7, 1e-3\n", "1e7, 1e-3\n*FRICTION\n0.2\n");
    let (problem, warnings) = read(&rough);
    let friction = problem.contacts[0].friction.as_ref().unwrap();
    assert_eq!(
        (friction.coefficient, friction.history),
        (Some(0.2), History::Incremental)
    );
    assert_eq!(problem.steps[0].increments, 10);
    assert!(
        warnings
            .iter()
            .any(|w| w.message.contains("gives no elastic slip")),
        "{warnings:?}"
    );
    let rough = solve(&problem).summary;
    assert!(rough.friction_force > 0.0);
}

/// A press fit, by the overlap of the meshes and by *CLEARANCE, whatever they overlap: Lamé's pressure, on a quarter of the ring.
#[test]
fn a_clearance_below_zero_is_an_interference() {
    let text = deck("pair-fit-cpe8");
    let lame = 0.360_576_923_1 * 0.5 * std::f64::consts::PI;
    let by_mesh = read(&text).0;
    assert_eq!(by_mesh.contacts[0].gap, None);
    let summary = solve(&by_mesh).summary;
    close(summary.normal_force, lame, 5e-3);
    // the parabolas of the meshes are told, and in the error
    let quantities = summary.accuracy.unwrap().quantities;
    let error = quantities[0].error.unwrap();
    assert!(
        (summary.normal_force - lame).abs() < error && error < 0.05 * lame,
        "{error}"
    );
    assert!(
        summary
            .warnings
            .iter()
            .any(|w| w.message.contains("are parabolas")),
        "{:?}",
        summary.warnings
    );

    let gap = |value: &str| {
        let line = format!("*CLEARANCE, SLAVE=FACEA, MASTER=FACEB, VALUE={value}\n*STEP\n");
        read(&text.replace("*STEP\n", &line)).0
    };
    let given = gap("-0.001");
    let overlap = given.contacts[0].gap.unwrap();
    assert_eq!(
        (overlap.interference, overlap.clearance),
        (Some(0.001), None)
    );
    let summary = solve(&given).summary;
    close(summary.normal_force, lame, 1e-3);
    assert!(
        !summary
            .warnings
            .iter()
            .any(|w| w.message.contains("are parabolas")),
        "{:?}",
        summary.warnings
    );
    held(
        27,
        "press fit of quarter rings in plane strain, a deck: force",
        "16:12 elements",
        summary.normal_force,
        lame,
        1e-3,
    );
    let flat = text.replace("CPE8", "CPS8").replace(
        "*STEP\n",
        "*CLEARANCE, SLAVE=FACEA, MASTER=FACEB, VALUE=-0.001\n*STEP\n",
    );
    let force = solve(&read(&flat).0).summary.normal_force;
    let lame = 0.328_125 * 0.5 * std::f64::consts::PI;
    held(
        27,
        "press fit of quarter rings in plane stress, a deck: force",
        "16:12 elements",
        force,
        lame,
        1e-3,
    );
    let apart = gap("0.25").contacts[0].gap.unwrap();
    assert_eq!((apart.interference, apart.clearance), (None, Some(0.25)));
}

/// *TIE, and the behavior TIED, bond surfaces as they lie.
#[test]
fn tied_surfaces_are_bonded() {
    let text = deck("pair-tie-cpe8");
    let tied = read(&text).0;
    assert_eq!(tied.contacts[0].condition, Condition::Bonded);
    let summary = solve(&tied).summary;
    // nodes of both sides at one place are no crack
    assert_eq!(summary.warnings, []);
    let force = summary.contacts["FACEA"].force.unwrap();
    let behavior = text.replace(
        "*TIE, NAME=T, POSITION TOLERANCE=0.01\n",
        "*SURFACE INTERACTION, NAME=I\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TIED\n1e7\n*CONTACT PAIR, INTERACTION=I\n",
    );
    let by_behavior = solve(&read(&behavior).0).summary.contacts["FACEA"].force;
    assert_eq!(by_behavior.unwrap(), force);
    let told = refused(&lifted(&text, "1.02"));
    assert!(told.contains("are farther apart than 1.000e-2"), "{told}");
}

/// The deck of two tied blocks with the lower nodes of the upper one, at y = 1, at another height.
fn lifted(text: &str, height: &str) -> String {
    text.replace(", 1\n5", &format!(", {height}\n5"))
}

/// ADJUST that closes the whole distance is a distance of 0; one that moves a part of the nodes is refused.
#[test]
fn an_adjustment_of_all_nodes_closes_the_gap() {
    let pair = |adjust: &str, height: &str| {
        let pair = format!("*CONTACT PAIR, ADJUST={adjust}\n");
        let text = deck("pair-tie-cpe8").replace("*TIE, NAME=T, POSITION TOLERANCE=0.01\n", &pair);
        lifted(&text, height)
    };
    let (problem, warnings) = read(&pair("0.01", "1"));
    assert_eq!(problem.contacts[0].gap, None);
    assert!(warnings.is_empty(), "{warnings:?}");
    let (problem, warnings) = read(&pair("0.01", "1.005"));
    assert_eq!(problem.contacts[0].gap.unwrap().clearance, Some(0.0));
    assert!(
        warnings.iter().any(|w| w.message.contains("ADJUST closes")),
        "{warnings:?}"
    );
    assert_eq!(read(&pair("0.001", "1.005")).0.contacts[0].gap, None);
    // of a set nothing is known
    let words = abaqus::problem(&pair("CENTER", "1.005")).unwrap_err();
    assert!(words[0].got.contains("ADJUST, which moves"), "{words:?}");
    let told = refused(&deck("pair-roller-cpe8").replace("I, TYPE", "I, ADJUST=0.01, TYPE"));
    assert!(told.contains("ADJUST, which moves"), "{told}");
}

#[test]
fn what_pairs_of_bodies_cannot_be_is_refused() {
    let (roller, tie) = (deck("pair-roller-cpe8"), deck("pair-tie-cpe8"));
    for (text, from, to, told) in [
        (
            &roller,
            "FACEA, FACEB\n",
            "FACEA, FACEA\n",
            "`FACEA` against itself",
        ),
        (
            &roller,
            "FACEA, FACEB\n",
            "FACEA, FACEB\nFACEB, FACEA\n",
            "in the opposite direction: the first is on line",
        ),
        (
            &roller,
            "FACEA, FACEB\n",
            "FACEA, FACEC\n",
            "`FACEC` in a contact pair",
        ),
        (
            &roller,
            "FACEA, FACEB\n",
            "FACEA, FACEB\nFACEA, FACEB\n",
            "in a second contact pair",
        ),
        (
            &roller,
            "FACEA, FACEB\n",
            "FACEA, FACEB\n*CLEARANCE, SLAVE=FACEB, MASTER=FACEA, VALUE=0.1\n",
            "*CLEARANCE between `FACEB` (SLAVE)",
        ),
        (
            &roller,
            "FACEA, FACEB\n",
            "FACEA, FACEB\n*CLEARANCE, SLAVE=FACEA, MASTER=FACEB, TABULAR\n",
            "*CLEARANCE",
        ),
        (&roller, "FACEA, FACEB\n", "FACEA\n", "`FACEA`"),
        (
            &tie,
            "*TIE, ",
            "*TIE, CYCLIC SYMMETRY, ",
            "*TIE with CYCLIC SYMMETRY",
        ),
        (
            &tie,
            "TOLERANCE=0.01",
            "TOLERANCE=-1",
            "POSITION TOLERANCE=-1",
        ),
        (&tie, "FRONTA, S3", "1, S1", "do not face one another"),
    ] {
        let words = refused(&text.replace(from, to));
        assert!(words.contains(told), "{to}: {words}");
    }
}
