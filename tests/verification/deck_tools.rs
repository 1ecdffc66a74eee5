//! Rigid tools of decks under forces: *CLOAD on the reference node of a *RIGID BODY that *BOUNDARY leaves free. The force that a
//! displacement needs causes that displacement, and what a deck says is what a problem by hand says.

use files::abaqus;
use solver::problem::Problem;
use solver::solution::{ContactSummary, Summary};

use crate::rigid_tools::{ROLLER, block, step, touching};
use crate::support::{close, solve};

const PUNCH: &str = "*SURFACE, TYPE=SEGMENTS, NAME=TOOL\nSTART, 0.6, 0.\nLINE, -0.6, 0.\n";
const FRICTION: &str = "*FRICTION, ELASTIC SLIP=1e-4\n0.3,\n";

/// A block under a tool; `held`: rows of *BOUNDARY in place of the one that holds the rotation.
fn deck(tool: &str, interaction: &str, held: &str, steps: &str) -> String {
    let tool = touching(tool, interaction).replace("9000, 6, 6\n", held);
    block(0.0) + &tool + steps
}

fn read(text: &str) -> Problem {
    abaqus::problem(text).unwrap_or_else(|list| panic!("{list:#?}"))
}

fn summary(text: &str) -> Summary {
    solve(&read(text)).summary
}

fn face(summary: &Summary) -> &ContactSummary {
    &summary.contacts["FACE"]
}

fn load(rows: &str) -> String {
    step("").replace("*BOUNDARY\n", &format!("*CLOAD\n{rows}"))
}

/// A roller, by its displacement, and by the force that this needs; on a deck of some thickness, too.
#[test]
fn a_force_causes_the_displacement_that_needs_it() {
    // with friction the way counts, and equal increments of the force are not those of the displacement
    for (interaction, allowed) in [("", 1e-8), (FRICTION, 1e-3)] {
        let moved = deck(
            ROLLER,
            interaction,
            "9000, 6, 6\n",
            &step("9000, 1, 1, 0\n9000, 2, 2, -0.05\n"),
        );
        // the force on the tool, not the sum of pressures in all directions
        let force = -face(&summary(&moved)).force.unwrap()[1];
        let pushed = deck(
            ROLLER,
            interaction,
            "9000, 6, 6\n9000, 1, 1\n",
            &load(&format!("9000, 2, {}\n", -force)),
        );
        let contact = read(&pushed).contacts.remove(0);
        assert_eq!(contact.normal_force, Some(force));
        assert_eq!(
            (
                contact.tangential_force,
                contact.moment,
                contact.indentation
            ),
            (None, None, 0.0)
        );
        let found = summary(&pushed);
        close(face(&found).indentation.unwrap(), 0.05, allowed);
        let thick = pushed.replace("ELSET=BODY, MATERIAL=M\n", "ELSET=BODY, MATERIAL=M\n2.\n");
        close(
            read(&thick).contacts[0].normal_force.unwrap(),
            0.5 * force,
            1e-12,
        );
    }
}

/// A roller at a distance: its indentation begins where it touches, and that is told.
#[test]
fn a_loaded_roller_is_brought_to_the_face() {
    let far = "*SURFACE, TYPE=SEGMENTS, NAME=TOOL\nSTART, 4., 4.1\nCIRCL, 0., 0.1, 0., 4.1\nCIRCL, -4., 4.1, 0., 4.1\n";
    let text = deck(
        far,
        "",
        "9000, 6, 6\n9000, 1, 1\n",
        &load("9000, 2, -20.\n"),
    );
    let (_, warnings) = abaqus::problem_with_warnings(&text).unwrap();
    let told = warnings
        .iter()
        .any(|w| w.message.contains("moves 1.0000e-1 more"));
    assert!(told, "{warnings:?}");
    let near = deck(
        ROLLER,
        "",
        "9000, 6, 6\n9000, 1, 1\n",
        &load("9000, 2, -20.\n"),
    );
    let [far, near] = [&text, &near].map(|text| face(&summary(text)).indentation.unwrap());
    close(far, near, 1e-9);
}

/// A roller at a distance that is moved and turned: about its reference node where it touches.
#[test]
fn a_turned_roller_is_turned_about_its_node() {
    let near = deck(
        ROLLER,
        "",
        "9000, 6, 6, 0.01\n9000, 1, 1\n",
        &step("9000, 2, 2, -0.05\n"),
    );
    let far = near
        .replace("START, 4., 4.", "START, 4., 4.5")
        .replace("CIRCL, 0., 0., 0., 4.", "CIRCL, 0., 0.5, 0., 4.5")
        .replace("CIRCL, -4., 4., 0., 4.", "CIRCL, -4., 4.5, 0., 4.5")
        .replace("9000, 0., 0.\n", "9000, 0., 0.5\n")
        .replace("9000, 2, 2, -0.05", "9000, 2, 2, -0.55");
    let [near, far] = [&near, &far].map(|text| read(text).contacts.remove(0));
    let [a, b] = [near.about.unwrap(), far.about.unwrap()];
    assert!(
        (a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-12,
        "{a:?} {b:?}"
    );
    close(far.indentation, near.indentation, 1e-12);
}

/// A flat punch under a force and a moment, or turned by a given angle.
#[test]
fn a_punch_tilts_under_a_moment() {
    let pushed = deck(
        PUNCH,
        "",
        "9000, 1, 1\n",
        &load("9000, 2, -100.\n9000, 6, 10.\n"),
    );
    let contact = read(&pushed).contacts.remove(0);
    assert_eq!(
        (contact.normal_force, contact.moment, contact.about),
        (Some(100.0), Some(10.0), Some([0.0, 0.0]))
    );
    let free = summary(&pushed);
    let (depth, tilt) = (face(&free).indentation.unwrap(), face(&free).tilt.unwrap());
    // counter-clockwise, as the moment
    assert!(tilt > 0.0, "{tilt}");
    let turned = deck(
        PUNCH,
        "",
        &format!("9000, 6, 6, {tilt:.15e}\n9000, 1, 1\n"),
        &step(&format!("9000, 2, 2, {:.15e}\n", -depth)),
    );
    assert_eq!(read(&turned).contacts[0].tilt, Some(tilt));
    let found = summary(&turned);
    close(face(&found).normal_force, 100.0, 1e-8);
    close(face(&found).moment.unwrap(), 10.0, 1e-7);
    // without a moment it turns freely, and stays level
    let level = deck(PUNCH, "", "9000, 1, 1\n", &load("9000, 2, -100.\n"));
    assert!(face(&summary(&level)).tilt.unwrap().abs() < 1e-9);
}

/// Pressed in one step, and dragged by a force in the next: factors of the steps, and friction that bears the force.
#[test]
fn a_punch_is_pressed_and_dragged_in_steps() {
    let steps = load("9000, 2, -100.\n") + &load("9000, 1, 15.\n");
    let text = deck(PUNCH, FRICTION, "9000, 6, 6\n", &steps);
    let problem = read(&text);
    let contact = &problem.contacts[0];
    // held against turning: the result states the moment about the reference node
    assert_eq!(
        (
            contact.normal_force,
            contact.tangential_force,
            contact.about
        ),
        (Some(100.0), Some(15.0), Some([0.0, 0.0]))
    );
    let factors: Vec<[f64; 2]> = problem
        .steps
        .iter()
        .map(|s| [s.normal_force, s.tangential_force])
        .collect();
    assert_eq!(factors, [[1.0, 0.0], [1.0, 1.0]]);
    let found = solve(&problem).summary;
    let [fx, fy] = face(&found).force.unwrap();
    close(fx, 15.0, 1e-7);
    close(fy, -100.0, 1e-7);
    assert!(face(&found).tangential_displacement.unwrap() > 0.0);
}

#[test]
fn forces_that_nothing_passes_on_are_refused() {
    let words = |text: &str| -> String {
        let list = abaqus::problem(text).unwrap_err();
        list.into_iter().map(|v| v.to_string() + "\n").collect()
    };
    let push = load("9000, 2, -20.\n");
    let second = "*SURFACE, TYPE=SEGMENTS, NAME=OTHER\nSTART, 0.6, 1.\nLINE, -0.6, 1.\n*RIGID BODY, ANALYTICAL SURFACE=OTHER, REF NODE=9001\n*NODE\n9001, 0., 1.\n";
    for (text, told) in [
        // a force along a motion that is prescribed
        (
            deck(ROLLER, "", "9000, 1, 2\n9000, 6, 6\n", &push),
            "along 2 of its reference node, whose motion *BOUNDARY prescribes",
        ),
        // free without a force
        (deck(ROLLER, "", "9000, 6, 6\n", &push), ""),
        (
            deck(ROLLER, "", "9000, 6, 6\n9000, 1, 1\n", &step("")),
            "free in 2",
        ),
        (
            deck(
                ROLLER,
                "",
                "9000, 6, 6\n9000, 1, 1\n",
                &(push.clone() + &step("9000, 2, 2, -0.1\n")),
            ),
            "free in 2 in the first step, and held later",
        ),
        (
            deck(
                ROLLER,
                "",
                "9000, 6, 6\n9000, 1, 1\n",
                &load("9000, 2, -20.\n9001, 2, -5.\n"),
            )
            .replace(
                "*SURFACE INTERACTION",
                &format!("{second}*SURFACE INTERACTION"),
            ),
            "which is in 0 contact pairs",
        ),
        (
            deck(
                ROLLER,
                "",
                "9000, 6, 6\n9000, 1, 1\n",
                &load("1, 6, -20.\n"),
            ),
            "the component `6`",
        ),
        (
            deck(
                ROLLER,
                "",
                "9000, 6, 6\n9000, 1, 1\n",
                &(push.clone() + &load("9000, 2, -30.\n").replace("*CLOAD", "*CLOAD, OP=NEW")),
            ),
            "",
        ),
        // the shape would have to move along the face while its depth is unknown
        (
            deck(ROLLER, "", "9000, 6, 6\n9000, 1, 1, 0.2\n", &push),
            "displaced along the face",
        ),
        (
            deck(ROLLER, "", "9000, 6, 6\n9000, 1, 1\n", &push)
                .replace("REF NODE=9000", "REF NODE=1"),
            "shares nodes with the elastic body",
        ),
        (
            deck(
                ROLLER,
                "",
                "9000, 6, 6\n9000, 1, 1\n",
                &(load("9000, 2, -20.\n9002, 2, -5.\n")),
            )
            .replace("REF NODE=9000", "REF NODE=9000, ROT NODE=9002")
            .replace("9000, 0., 0.\n", "9000, 0., 0.\n9002, 0., 0.\n"),
            "the node of the rotations",
        ),
        (
            deck(
                PUNCH,
                "",
                "9000, 6, 6\n9000, 1, 1, 0.1\n",
                &step("9000, 2, 2, -0.1\n"),
            )
            .replace("CPE8", "CAX8"),
            "moves radially or rotates",
        ),
        (
            deck(PUNCH, "", "9000, 6, 6, 0.01\n9000, 1, 1\n", &push).replace("CPE8", "CAX8"),
            "moves radially or rotates",
        ),
    ] {
        if told.is_empty() {
            assert!(abaqus::problem(&text).is_ok(), "{}", words(&text));
            continue;
        }
        let found = words(&text);
        assert!(found.contains(told), "{told}: {found}");
    }
}
