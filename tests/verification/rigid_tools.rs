//! Rigid rollers, punches and plates of decks: contact pairs with analytical surfaces, rigid lines and rigid elements
//! become contacts with obstacles. Held to problems written by hand, to rigid motions that change nothing, and to
//! CalculiX (the same in `tests/calculix.py`).

use files::abaqus;
use serde_json::json;
use solver::problem::{Contact, History, Problem, Step};
use solver::solution::{Solution, WarningCode};

use crate::support::solve;

/// Nodes and elements (CPE8) of a patch that is a grid in two parameters u, v of 0 … 1.
fn patch(
    name: &str,
    base: usize,
    [nu, nv]: [usize; 2],
    at: impl Fn(f64, f64) -> [f64; 2],
) -> String {
    let (mut nodes, mut elements) = (
        format!("*NODE, NSET=N{name}\n"),
        format!("*ELEMENT, TYPE=CPE8, ELSET={name}\n"),
    );
    let label = |i: usize, j: usize| base + i + (2 * nu + 1) * j;
    for j in 0..=2 * nv {
        for i in 0..=2 * nu {
            if i % 2 == 0 || j % 2 == 0 {
                let [x, y] = at(i as f64 / (2 * nu) as f64, j as f64 / (2 * nv) as f64);
                nodes += &format!("{}, {x:.15e}, {y:.15e}\n", label(i, j));
            }
        }
    }
    for j in 0..nv {
        for i in 0..nu {
            let (a, b) = (2 * i, 2 * j);
            let around = [
                [0, 0],
                [2, 0],
                [2, 2],
                [0, 2],
                [1, 0],
                [2, 1],
                [1, 2],
                [0, 1],
            ];
            let numbers = around
                .map(|[p, q]| label(a + p, b + q).to_string())
                .join(", ");
            elements += &format!("{}, {numbers}\n", base + i + nu * j);
        }
    }
    // the sides v = 0 and v = 1
    nodes += &format!(
        "*NSET, NSET={name}LOW, GENERATE\n{base}, {}, 1\n",
        base + 2 * nu
    );
    let (first, last) = (base, base + nu * (nv - 1));
    elements += &format!(
        "*ELSET, ELSET={name}FIRST, GENERATE\n{first}, {}, 1\n",
        first + nu - 1
    );
    elements += &format!(
        "*ELSET, ELSET={name}LAST, GENERATE\n{last}, {}, 1\n",
        last + nu - 1
    );
    nodes + &elements
}

/// Of the side v = 1 of BODY.
const MATERIAL: &str = "*MATERIAL, NAME=M\n*ELASTIC\n1000., 0.3\n*SOLID SECTION, ELSET=BODY, MATERIAL=M\n\
    *SURFACE, NAME=FACE\nBODYLAST, S3\n*BOUNDARY\nBODYLOW, 1, 2\n";

/// A block 6 wide and 3 high with its face at y = 0, turned by an angle (degrees) about the origin.
pub(crate) fn block(angle: f64) -> String {
    let (sine, cosine) = f64::to_radians(angle).sin_cos();
    // nodes come closer to the middle
    let part = |u: f64| {
        let w = 2.0 * u - 1.0;
        3.0 * w * (0.2 + 0.8 * w.abs())
    };
    let place = move |u: f64, v: f64| {
        let (i, x) = (u * 24.0, |k: f64| part(k / 24.0));
        // midsides in the middle
        let x = if i.rem_euclid(2.0) > 0.5 {
            0.5 * (x(i - 1.0) + x(i + 1.0))
        } else {
            x(i)
        };
        let y = -3.0 * (1.0 - v);
        [cosine * x - sine * y, sine * x + cosine * y]
    };
    patch("BODY", 1, [12, 5], place) + MATERIAL
}

/// A ring sector about the origin between two radii, clamped at v = 0, from one angle to another (degrees).
fn sector([inner, outer]: [f64; 2], [from, to]: [f64; 2]) -> String {
    let place = move |u: f64, v: f64| {
        let (r, angle) = (
            inner + v * (outer - inner),
            f64::to_radians(from + u * (to - from)),
        );
        [r * angle.cos(), r * angle.sin()]
    };
    patch("BODY", 1, [16, 3], place) + MATERIAL
}

pub(crate) const ROLLER: &str = "*SURFACE, TYPE=SEGMENTS, NAME=TOOL\nSTART, 4., 4.\nCIRCL, 0., 0., 0., 4.\nCIRCL, -4., 4., 0., 4.\n";

/// A rigid surface with its reference node, and the pair with FACE.
pub(crate) fn touching(tool: &str, interaction: &str) -> String {
    format!(
        "*NODE\n9000, 0., 0.\n{tool}*RIGID BODY, ANALYTICAL SURFACE=TOOL, REF NODE=9000\n{}",
        pair(interaction)
    )
}

fn pair(interaction: &str) -> String {
    format!(
        "*SURFACE INTERACTION, NAME=I\n1.,\n{interaction}*CONTACT PAIR, INTERACTION=I\nFACE, TOOL\n*BOUNDARY\n9000, 6, 6\n"
    )
}

pub(crate) fn step(rows: &str) -> String {
    format!("*STEP\n*STATIC\n*BOUNDARY\n{rows}*END STEP\n")
}

fn pressed(u: [f64; 2]) -> String {
    step(&format!("9000, 1, 1, {}\n9000, 2, 2, {}\n", u[0], u[1]))
}

fn read(deck: &str) -> Problem {
    abaqus::problem(deck).unwrap_or_else(|list| panic!("{list:#?}"))
}

fn contact(value: serde_json::Value) -> Contact {
    serde_json::from_value(value).unwrap()
}

fn doubts(deck: &str) -> Vec<String> {
    let list = abaqus::problem(deck).expect_err("a deck that cannot be solved was taken");
    list.into_iter().map(|v| v.to_string()).collect()
}

fn numbers(solution: &Solution) -> [f64; 3] {
    let s = &solution.summary;
    assert!(s.converged);
    [s.normal_force, s.tangential_force, s.friction_force]
}

fn close(a: [f64; 3], b: [f64; 3], within: f64) {
    let size = a[0].abs();
    assert!(
        size > 0.0 && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= within * size),
        "{a:?} {b:?}"
    );
}

/// The whole contact, as it is written by hand.
#[test]
fn a_roller_is_a_circle_that_is_pushed() {
    let problem = read(&(block(0.0) + &touching(ROLLER, "") + &pressed([0.0, -0.05])));
    assert_eq!(
        problem.contacts,
        [contact(
            json!({"boundary": "FACE", "normal": "obstacle", "indentation": 0.05,
            "obstacle": {"kind": "circle", "radius": 4.0}})
        )]
    );
    assert!(problem.steps.is_empty());
    // one that comes from farther away
    let away = "*SURFACE, TYPE=SEGMENTS, NAME=TOOL\nSTART, 4., 4.5\nCIRCL, 0., 0.5, 0., 4.5\nCIRCL, -4., 4.5, 0., 4.5\n";
    let problem = read(&(block(0.0) + &touching(away, "") + &pressed([0.0, -0.55])));
    assert!((problem.contacts[0].indentation - 0.05).abs() < 1e-12);
}

/// A quarter of the circle faces what its arc faces.
#[test]
fn an_arc_ends_where_it_ends() {
    let half = "*SURFACE, TYPE=SEGMENTS, NAME=TOOL\nSTART, 4., 4.\nCIRCL, 0., 0., 0., 4.\n";
    let problem = read(&(block(0.0) + &touching(half, "") + &pressed([0.0, -0.05])));
    let (from, to, _) = problem.contacts[0].obstacle.as_ref().unwrap().span();
    assert_eq!((from, to), (Some(0.0), None));
}

/// The same roller on a face that is turned, where positions count along the face: to rounding.
#[test]
fn a_turned_deck_gives_the_same_forces() {
    let friction = "*FRICTION, ELASTIC SLIP=1e-4\n0.3,\n";
    let solved = |angle: f64| {
        let (s, c) = f64::to_radians(angle).sin_cos();
        let turn = |[x, y]: [f64; 2]| [c * x - s * y, s * x + c * y];
        let point = |p: [f64; 2]| {
            let [x, y] = turn(p);
            format!("{x:.15e}, {y:.15e}")
        };
        let tool = format!(
            "*SURFACE, TYPE=SEGMENTS, NAME=TOOL\nSTART, {}\nCIRCL, {}, {}\nCIRCL, {}, {}\n",
            point([4.0, 4.0]),
            point([0.0, 0.0]),
            point([0.0, 4.0]),
            point([-4.0, 4.0]),
            point([0.0, 4.0])
        );
        let motion = pressed(turn([0.002, -0.02]));
        numbers(&solve(&read(
            &(block(angle) + &touching(&tool, friction) + &motion),
        )))
    };
    let straight = solved(0.0);
    assert!(
        straight[1] > 0.05 * straight[0],
        "it is dragged to the right: {straight:?}"
    );
    for angle in [90.0, 180.0, -37.0] {
        close(straight, solved(angle), 1e-8);
    }
}

/// Friction depends on the path, so that increments and steps are those of the deck.
#[test]
fn steps_press_and_drag() {
    let friction = "*FRICTION, SLIP TOLERANCE=0.01, TAUMAX=20.\n0.25\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD\n";
    let deck = block(0.0)
        + &touching(ROLLER, friction)
        + &pressed([0.0, -0.05])
        + &step("9000, 1, 1, 0.01\n").replace("*STATIC\n", "*STATIC\n0.05, 1.\n");
    let problem = read(&deck);
    let found = &problem.contacts[0];
    let law = found.friction.as_ref().unwrap();
    assert_eq!(
        (law.coefficient, law.nonlocal_radius, law.shear_cap),
        (Some(0.25), Some(0.0), Some(20.0))
    );
    assert_eq!(law.history, History::Incremental);
    assert!(
        (law.elastic_slip - 0.01 * 0.5).abs() < 1e-15,
        "of the mean side: {}",
        law.elastic_slip
    );
    assert_eq!(
        (found.indentation, found.tangential_displacement),
        (0.05, 0.01)
    );
    let factors = |s: &Step| {
        (
            s.indentation,
            s.tangential_displacement,
            s.loads,
            s.supports,
            s.increments,
        )
    };
    let steps: Vec<_> = problem.steps.iter().map(factors).collect();
    assert_eq!(steps, [(1.0, 0.0, 1.0, 1.0, 10), (1.0, 1.0, 1.0, 1.0, 20)]);
    // the roller stands where the last step leaves it, and the deck's user is told
    let (_, warnings) = abaqus::problem_with_warnings(&deck).unwrap();
    assert!(warnings.iter().any(|w| {
        w.code == WarningCode::DeckDiffers
            && w.message
                .contains("where it is at the end of the last step")
    }));
    assert_eq!(
        serde_json::to_value(&found.obstacle).unwrap()["center"],
        0.01
    );
}

/// Several sets may hold a node: what a later step prescribes for it replaces what an earlier one did, whatever the sets.
#[test]
fn prescriptions_of_a_later_step_apply_to_the_nodes() {
    let first = "*STEP\n*STATIC\n*BOUNDARY\n9000, 1, 1\n9000, 2, 2, -0.05\nBODYHIGH, 1, 1, 0.01\n*END STEP\n";
    let high = "*NSET, NSET=BODYHIGH\n3, 5\n*NSET, NSET=TWIN\n3, 5\n";
    let deck = |second: &str| {
        let model = block(0.0) + high + &touching(ROLLER, "*FRICTION, ELASTIC SLIP=1e-4\n0.3,\n");
        model + first + "*STEP\n*STATIC\n*BOUNDARY\n9000, 1, 1, 0.01\n" + second + "*END STEP\n"
    };
    let plain = read(&deck(""));
    for same in ["TWIN, 1, 1, 0.01\n", "3, 1, 1, 0.01\n"] {
        assert_eq!(read(&deck(same)).steps, plain.steps, "{same}");
    }
    for other in ["TWIN, 1, 1\n", "3, 1, 1, 0.\n", "5, 1, 1, 0.02\n"] {
        let list = abaqus::problem(&deck(other)).expect_err(other);
        let words = "a step whose prescribed displacements are in another proportion";
        assert!(
            list.iter().any(|v| v.got.contains(words)),
            "{other}: {list:#?}"
        );
    }
}

/// `OP=NEW` in a later step is as none where everything is stated again; what it ends is refused by name, once.
#[test]
fn op_new_in_a_later_step_states_everything_again() {
    let first = "*STEP\n*STATIC\n*BOUNDARY\n9000, 1, 1\n9000, 2, 2, -0.05\n*CLOAD\nBODYHIGH, 1, .25\n8, 1, .5\n8, 1, .5\n\
                 *DLOAD\n7, P1, 2.\n*END STEP\n";
    let high = "*NSET, NSET=BODYHIGH\n3, 5\n*NSET, NSET=HALF\nBODYLOW\n";
    let deck = |second: &str| {
        let model = block(0.0) + high + &touching(ROLLER, "*FRICTION, ELASTIC SLIP=1e-4\n0.3,\n");
        model + first + "*STEP\n*STATIC\n" + second + "*END STEP\n"
    };
    let kept = "*BOUNDARY\n9000, 1, 1, 0.01\n";
    let plain = read(&deck(kept));
    let again =
        "*BOUNDARY, OP=NEW\nBODYLOW, 1, 2\n9000, 6, 6\n9000, 1, 1, 0.01\n9000, 2, 2, -0.05\n";
    let loads = "*CLOAD, OP=NEW\n8, 1, 1.\nBODYHIGH, 1, .25\n*DLOAD, OP=NEW\n7, P1, 2.\n";
    let others = again.replace("BODYLOW, 1, 2\n", "HALF, 1\nHALF, 2\n");
    for second in [
        again.to_owned(),
        loads.to_owned() + kept,
        format!("{again}{loads}"),
        others,
    ] {
        let problem = read(&deck(&second));
        assert_eq!(problem.contacts, plain.contacts, "{second}");
        assert_eq!(problem.steps, plain.steps, "{second}");
    }
    for (from, to, told) in [
        ("BODYLOW, 1, 2\n", "", "displacement 1 of `BODYLOW` (line "),
        (
            "BODYLOW, 1, 2\n",
            "BODYLOW, 1\n",
            "displacement 2 of `BODYLOW` (line ",
        ),
        (
            "BODYLOW, 1, 2\n",
            "1, 1, 2\n",
            "displacement 1 of `BODYLOW` (line ",
        ),
        (
            "9000, 6, 6\n",
            "",
            "displacement 6 of `the reference node of the *RIGID BODY on line ",
        ),
        (
            "9000, 2, 2, -0.05\n",
            "",
            "displacement 2 of `the reference node",
        ),
        ("8, 1, 1.\n", "", "force 1 on `8`"),
        ("BODYHIGH, 1, .25\n", "", "force 1 on `BODYHIGH`"),
        ("7, P1, 2.\n", "8, P1, 2.\n", "the load on `7 P1`"),
    ] {
        let second = format!("{again}{loads}");
        assert!(second.contains(from), "{from}");
        let list = abaqus::problem(&deck(&second.replacen(from, to, 1))).expect_err(from);
        let ends: Vec<_> = list
            .iter()
            .filter(|v| v.got.contains("OP=NEW, which ends"))
            .collect();
        assert!(
            ends.len() == 1 && ends[0].got.contains(told),
            "{from}: {list:#?}"
        );
        assert!(ends[0].got.starts_with("line "), "{list:#?}");
        // another row may be told of as well: what it adds is of that row
        let same = |v: &&solver::error::Violation| v.got.contains("OP=NEW");
        assert_eq!(list.iter().filter(same).count(), 1, "{list:#?}");
        assert!(list.len() == 1 || to == "8, P1, 2.\n", "{list:#?}");
    }
    // forces of one step add: the second is half of the first
    let list = abaqus::problem(&deck(&format!("*CLOAD\n8, 1, .5\n{kept}"))).expect_err("half");
    assert!(
        list.len() == 1
            && list[0]
                .got
                .contains("whose loads are in another proportion"),
        "{list:#?}"
    );
    // a support of the model that the first step ends
    let model = block(0.0) + &touching(ROLLER, "");
    let ended =
        model + &pressed([0.0, -0.05]).replace("*BOUNDARY\n", "*BOUNDARY, OP=NEW\nBODYLOW, 1, 2\n");
    assert!(
        doubts(&ended)[0].contains("free in 6"),
        "{:?}",
        doubts(&ended)
    );
    // without a rigid body there is one cause, which is that there are several steps
    let two = "*STEP\n*STATIC\n*CLOAD\n8, 1, 1.\n*END STEP\n*STEP\n*STATIC\n*CLOAD, OP=NEW\n3, 1, 1.\n*BOUNDARY, OP=NEW\n8, 1\n*END STEP\n";
    let found = abaqus::problem(&(block(0.0) + two)).expect_err("two steps");
    assert!(
        found.len() == 1 && found[0].got.ends_with("the second of 2 steps"),
        "{found:#?}"
    );
}

/// A rigid plate under a disc: that the plate moves up or the disc down is the same, with friction too. Along a curved
/// boundary only a motion in one direction is one of a rigid body.
#[test]
fn a_plate_that_moves_is_a_body_that_moves() {
    let plate = "*SURFACE, TYPE=SEGMENTS, NAME=TOOL\nSTART, -9., -1.\nLINE, 9., -1.\n";
    let friction = "*FRICTION, ELASTIC SLIP=1e-4\n0.3,\n";
    let disc = sector([0.4, 1.0], [-30.0, -150.0]) + &touching(plate, friction);
    let plate_moves = read(&(disc.clone() + &pressed([0.01, 0.02])));
    let disc_moves =
        read(&(disc + &step("9000, 1, 2\nBODYLOW, 1, 1, -0.01\nBODYLOW, 2, 2, -0.02\n")));
    assert_eq!(plate_moves.contacts[0].direction, Some([0.0, 1.0]));
    let (a, b) = (numbers(&solve(&plate_moves)), numbers(&solve(&disc_moves)));
    assert!(a[1].abs() > 0.05 * a[0] && a[2] > a[1].abs(), "{a:?}");
    close(a, b, 1e-9);
    // pushed against the body's own normals it would not be a plate
    let mut by_normals = plate_moves;
    by_normals.contacts[0].direction = None;
    let c = numbers(&solve(&by_normals));
    assert!((c[2] - a[2]).abs() > 0.02 * a[2], "{c:?} {a:?}");
}

/// A pin in a hole: both are curved.
#[test]
fn a_pin_in_a_hole_is_a_spline_that_moves() {
    // the hole of radius 1, seen from inside the body: from its right to its left below the centre
    let hole = sector([2.0, 1.0], [-20.0, -160.0]);
    let pin = "*SURFACE, TYPE=SEGMENTS, NAME=TOOL\nSTART, 0.98, -0.02\nCIRCL, 0., -1., 0., -0.02\nCIRCL, -0.98, -0.02, 0., -0.02\n";
    let friction = "*FRICTION, ELASTIC SLIP=1e-4\n0.2,\n";
    let deck = hole + &touching(pin, friction);
    let pin_moves = read(&(deck.clone() + &pressed([0.001, -0.004])));
    let hole_moves =
        read(&(deck + &step("9000, 1, 2\nBODYLOW, 1, 1, -0.001\nBODYLOW, 2, 2, 0.004\n")));
    let (a, b) = (numbers(&solve(&pin_moves)), numbers(&solve(&hole_moves)));
    close(a, b, 1e-9);
}

/// Pushed so far that its gaps are others than its first normals say, the pin is told, and the verdict is not good.
#[test]
fn a_pin_that_is_pushed_far_is_reported() {
    let hole = sector([2.0, 1.0], [-20.0, -160.0]);
    let pin = "*SURFACE, TYPE=SEGMENTS, NAME=TOOL\nSTART, 0.98, -0.02\nCIRCL, 0., -1., 0., -0.02\nCIRCL, -0.98, -0.02, 0., -0.02\n";
    let deck = hole + &touching(pin, "");
    for (push, far) in [
        ([0.0, -0.004], false),
        ([0.0, -0.3], true),
        ([0.2, -0.1], true),
    ] {
        let solution = solve(&read(&(deck.clone() + &pressed(push))));
        let told = |code| solution.summary.warnings.iter().any(|w| w.code == code);
        assert_eq!(told(WarningCode::DirectionIsLinear), far, "{push:?}");
        let verdict = solution.summary.accuracy.as_ref().unwrap().verdict;
        assert!(!far || verdict != solver::solution::Verdict::Good);
    }
}

/// Rigid lines of Abaqus, and elements of CalculiX that a rigid body holds: the same tool three times.
#[test]
fn rigid_lines_and_rigid_elements_are_the_analytical_surface() {
    let motion = "*STEP\n*STATIC\n*BOUNDARY\n9000, 1, 1, 0.\n9000, 2, 2, -0.03\n*END STEP\n";
    let analytical = "*SURFACE, TYPE=SEGMENTS, NAME=TOOL\nSTART, 2., 1.\nLINE, 1., 0.\nLINE, -1., 0.\nLINE, -2., 1.\n";
    let first = read(&(block(0.0) + &touching(analytical, "") + motion));
    let places = "*NODE\n9000, 0., 5.\n9001, 2., 1.\n9002, 1., 0.\n9003, -1., 0.\n9004, -2., 1.\n";
    let lines = format!(
        "{places}*ELEMENT, TYPE=R2D2, ELSET=RIGID\n8001, 9001, 9002\n8003, 9003, 9004\n8002, 9002, 9003\n\
        *SURFACE, NAME=TOOL\nRIGID, SPOS\n*RIGID BODY, ELSET=RIGID, REF NODE=9000\n{}",
        pair("")
    );
    let second = read(&(block(0.0) + &lines + motion));
    assert_eq!(first.contacts, second.contacts);
    let elements = format!(
        "{places}9005, 2., 2.\n9006, 1., 2.\n9007, -1., 2.\n9008, -2., 2.\n*NODE\n9010, 0., 5.\n\
        *ELEMENT, TYPE=CPE4, ELSET=RIGID\n8001, 9002, 9001, 9005, 9006\n8002, 9003, 9002, 9006, 9007\n8003, 9004, 9003, 9007, 9008\n\
        *SOLID SECTION, ELSET=RIGID, MATERIAL=M\n*NSET, NSET=ALLRIGID, GENERATE\n9001, 9008, 1\n\
        *SURFACE, NAME=TOOL\nRIGID, S1\n*RIGID BODY, NSET=ALLRIGID, REF NODE=9000, ROT NODE=9010\n{}*BOUNDARY\n9010, 3, 3\n",
        pair("")
    );
    let deck = block(0.0) + &elements.replace("9000, 6, 6\n", "9000, 1, 1\n") + motion;
    let third = read(&deck);
    assert_eq!(first.contacts, third.contacts);
    assert_eq!(third.materials.len(), 1, "the rigid elements need none");
    let (mesh, warnings) = abaqus::read(deck.as_bytes()).unwrap();
    assert_eq!(mesh.elements.len(), 60);
    assert!(
        warnings
            .iter()
            .any(|w| w.code == WarningCode::RigidElementsLeftOut)
    );
    close(numbers(&solve(&first)), numbers(&solve(&third)), 1e-12);
}

/// A circle of sides of second order is nearly one of arcs.
#[test]
fn a_meshed_roller_is_nearly_the_round_one() {
    let place = |u: f64, v: f64| {
        let (r, angle) = (4.0 - 0.5 * v, 0.4 * (1.0 - 2.0 * u));
        [-r * angle.sin(), 4.0 - r * angle.cos()]
    };
    let tool = patch("RIGID", 20_001, [24, 1], place)
        + "*NODE\n9000, 0., 4.\n*SURFACE, NAME=TOOL\nRIGID, S1\n\
        *RIGID BODY, ELSET=RIGID, REF NODE=9000\n"
        + &pair("");
    let meshed = numbers(&solve(&read(
        &(block(0.0) + &tool + &pressed([0.0, -0.05])),
    )));
    let round = numbers(&solve(&read(
        &(block(0.0) + &touching(ROLLER, "") + &pressed([0.0, -0.05])),
    )));
    // an edge is divided where the meshed tool ends, and nothing where the round one goes on
    close(meshed, round, 1e-4);
}

/// A fillet between straight sides is a spline through points of them; its force is that of the exact shape.
#[test]
fn fillets_are_a_spline() {
    let punch = "*SURFACE, TYPE=SEGMENTS, NAME=TOOL\nSTART, 1.5, 3.\nLINE, 1.5, 0.5\nCIRCL, 1., 0., 1., 0.5\nLINE, -1., 0.\n\
        CIRCL, -1.5, 0.5, -1., 0.5\nLINE, -1.5, 3.\n";
    let deck = block(0.0) + &touching(punch, "") + &pressed([0.0, -0.05]);
    let (problem, warnings) = abaqus::problem_with_warnings(&deck).unwrap();
    assert!(
        warnings.iter().any(|w| w.message.contains("spline")),
        "{warnings:?}"
    );
    let mut exact = problem.clone();
    exact.contacts = vec![contact(
        json!({"boundary": "FACE", "normal": "obstacle", "indentation": 0.05,
        "obstacle": {"kind": "rounded_flat", "half_width": 1.0, "radius": 0.5}}),
    )];
    close(numbers(&solve(&exact)), numbers(&solve(&problem)), 1e-5);
}

/// Friction depends on the way to the end of a step: an amplitude that goes beyond the end and back is refused with friction,
/// and one that only rises is not. Without friction the end is all there is.
#[test]
fn an_amplitude_that_turns_back_is_refused_with_friction() {
    let deck = |friction: &str, amplitude: &str| {
        let whole = block(0.0)
            + &touching(ROLLER, friction)
            + &format!("*AMPLITUDE, NAME=A\n{amplitude}\n")
            + &pressed([0.0, -0.05]);
        assert!(whole.contains("*STATIC\n*BOUNDARY\n"), "{whole}");
        whole.replace("*STATIC\n*BOUNDARY\n", "*STATIC\n*BOUNDARY, AMPLITUDE=A\n")
    };
    let friction = "*FRICTION, ELASTIC SLIP=1e-4\n0.3,\n";
    let (turns, falls, rises) = (
        "0., 0., 0.5, 2., 1., 1.",
        "0., 1., 0.5, -1., 1., 0.5",
        "0., 0., 0.5, 0.7, 1., 1., 2., 0.",
    );
    for amplitude in [turns, falls, "0., 1., 1., 0.5"] {
        let found = doubts(&deck(friction, amplitude));
        let told = |text: &String| text.contains("rises and falls within the step");
        assert!(!found.is_empty() && found.iter().all(told), "{found:#?}");
        assert!(abaqus::problem(&deck("", amplitude)).is_ok());
    }
    assert!(
        abaqus::problem(&deck(friction, rises)).is_ok(),
        "it falls after the end of the step"
    );
    // a jump has no way; nor have displacements that do not rise together a common one
    let found = doubts(&deck(friction, "0., 1., 1., 1."));
    assert!(found[0].contains("begins at 1 and not at 0"), "{found:#?}");
    assert!(abaqus::problem(&deck("", "0., 1., 1., 1.")).is_ok());
    let beside = |amplitude: &str| {
        deck(friction, amplitude).replace("*END STEP", "*CLOAD\n8, 1, .1\n*END STEP")
    };
    let found = doubts(&beside(rises));
    assert!(
        found[0].contains("which is not a straight line"),
        "{found:#?}"
    );
    assert!(abaqus::problem(&beside("0., 0., 0.5, 0.5, 1., 1.")).is_ok());
}

/// Friction with a stick slope, or by Lagrange multipliers, acts at once: its elastic slip is a part of the way, and not of
/// the sides, which may be as long.
#[test]
fn the_elastic_slip_of_friction_that_acts_at_once_is_a_part_of_the_way() {
    for (friction, expected) in [
        ("*FRICTION\n0.3, 1e6\n", 1e-3 * 0.05),
        ("*FRICTION, LAGRANGE\n0.3,\n", 1e-3 * 0.05),
        ("*FRICTION\n0.3,\n", 0.005 * 0.5),
        ("*FRICTION, ELASTIC SLIP=2e-4\n0.3, 1e6\n", 2e-4),
    ] {
        let deck = block(0.0) + &touching(ROLLER, friction) + &pressed([0.0, -0.05]);
        let law = read(&deck).contacts[0].friction.clone().unwrap();
        assert!(
            (law.elastic_slip - expected).abs() < 1e-12,
            "{friction}: {}",
            law.elastic_slip
        );
    }
}

/// A half model of a deck, whose rigid surface ends its way beside the line of symmetry, and is no longer level there.
#[test]
fn a_dragged_half_model_is_told_whatever_the_obstacle_is() {
    let obstacle = |at: f64, first: i32| {
        let points: Vec<[f64; 2]> = (first..=60)
            .map(|k| {
                let x = 0.05 * f64::from(k);
                [x + at, x * x / 16.0]
            })
            .collect();
        json!({"kind": "polyline", "points": points, "interpolation": "cubic"})
    };
    // the last one ended on the line before it was dragged
    for (at, first) in [(0.0, -60), (0.02, -60), (0.02, 0)] {
        let problem = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1, 2, 3], "y": [-3, -1, -0.4, -0.1, 0]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}, {"boundary": "left", "ux": 0}],
            "contacts": [{"boundary": "top", "obstacle": obstacle(at, first), "normal": "obstacle", "indentation": 0.01,
                "tangential_displacement": 0.02,
                "friction": {"coefficient": 0.3, "nonlocal_radius": 0, "elastic_slip": 1e-4}}],
        });
        let problem = files::parse(&problem.to_string()).unwrap();
        let model = solver::model::Model::new(&problem, None).unwrap();
        let codes: Vec<WarningCode> = model.warnings.iter().map(|w| w.code).collect();
        assert!(
            codes.contains(&WarningCode::SymmetricDrag),
            "at {at}: {codes:?}"
        );
    }
}

/// What cannot be translated is refused in words, with what is written instead.
#[test]
fn a_contact_that_is_not_with_a_rigid_obstacle_is_refused() {
    let good = block(0.0)
        + &touching(ROLLER, "*FRICTION, ELASTIC SLIP=1e-4\n0.3,\n")
        + &pressed([0.0, -0.05]);
    assert!(abaqus::problem(&good).is_ok());
    for (from, to, told) in [
        (
            "*RIGID BODY, ANALYTICAL SURFACE=TOOL, REF NODE=9000\n",
            "",
            "`TOOL` in a contact pair",
        ),
        ("FACE, TOOL", "TOOL, TOOL", "two rigid surfaces"),
        ("FACE, TOOL", "FAC, TOOL", "`FAC` in a contact pair"),
        (
            "FACE, TOOL\n",
            "FACE, TOOL\nFACE, TOOL2\n*SURFACE, TYPE=SEGMENTS, NAME=TOOL2\nSTART, 9., 4.\nLINE, 5., 4.\n*RIGID BODY, ANALYTICAL SURFACE=TOOL2, REF NODE=9000\n",
            "`FACE` in a second contact pair: the first is on line",
        ),
        (
            "FACE, TOOL\n",
            "FACE, TOOL\nPART, TOOL2\n*SURFACE, NAME=PART\n49, S3\n*SURFACE, TYPE=SEGMENTS, NAME=TOOL2\nSTART, 9., 4.\nLINE, 5., 4.\n*RIGID BODY, ANALYTICAL SURFACE=TOOL2, REF NODE=9000\n",
            "of which 1 of 1 sides belong to `FACE` too",
        ),
        (
            "START, 4., 4.\nCIRCL, 0., 0., 0., 4.\nCIRCL, -4.",
            "START, -4., 4.\nCIRCL, 0., 0., 0., 4.\nCIRCL, 4.",
            "whose outer side does not face",
        ),
        (
            "CIRCL, 0., 0., 0., 4.",
            "CIRCL, 0., 0., 0., 3.",
            "`CIRCL, 0., 0., 0., 3.`",
        ),
        ("START, 4., 4.\n", "", "`CIRCL"),
        (
            "TYPE=SEGMENTS, NAME=TOOL",
            "TYPE=SEGMENTS, NAME=TOOL, FILLET RADIUS=0.1",
            "FILLET RADIUS",
        ),
        ("9000, 6, 6\n", "", "free in 6"),
        ("9000, 1, 1, 0\n", "", "free in 1"),
        (
            "9000, 6, 6\n",
            "9000, 3, 3, 0.1\n",
            "a value of 0.1 for a component that a plane body",
        ),
        (
            "9000, 1, 1, 0\n",
            "*CLOAD\n9000, 3, -5.\n",
            "the component `3`",
        ),
        ("*FRICTION, ELASTIC SLIP=1e-4", "*FRICTION, ROUGH", "ROUGH"),
        (
            "*FRICTION, ELASTIC SLIP=1e-4",
            "*FRICTION, EXPONENTIAL DECAY",
            "EXPONENTIAL DECAY",
        ),
        // decimal commas
        ("0.3,\n", "0,3\n", "a coefficient of 0 with a stick slope"),
        ("START, 4., 4.", "START, 4,0, 4,0", "`START, 4,0, 4,0`"),
        (
            "CIRCL, 0., 0., 0., 4.",
            "CIRCL, 0,0, 0,0, 0,0, 4,0",
            "`CIRCL, 0,0, 0,0",
        ),
        (
            "0.3,\n",
            "0.3, 0., 10.\n0.2, 0., 20.\n",
            "one friction coefficient",
        ),
        (
            "0.3,\n",
            "0.3,\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n0., 0.\n1., 1.\n",
            "TABULAR",
        ),
        (
            "0.3,\n",
            "0.3,\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n50.\n",
            "a pressure of 50 per length",
        ),
        (
            "0.3,\n",
            "0.3,\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=EXPONENTIAL\n0.01, 5.\n",
            "a clearance of 0.01",
        ),
        (
            "0.3,\n",
            "0.3,\n*SURFACE BEHAVIOR, NO SEPARATION\n",
            "NO SEPARATION",
        ),
        (
            "*CONTACT PAIR, INTERACTION=I",
            "*CONTACT PAIR, INTERACTION=I, TIED",
            "TIED",
        ),
        (
            "*CONTACT PAIR, INTERACTION=I",
            "*CONTACT PAIR, INTERACTION=J",
            "the interaction `J`",
        ),
        (
            "*CONTACT PAIR, INTERACTION=I",
            "*CONTACT PAIR, INTERACTION=I, ADJUST=0.1",
            "ADJUST",
        ),
        (
            "*CONTACT PAIR, INTERACTION=I\n",
            "*CLEARANCE, VALUE=0.1\n*CONTACT PAIR, INTERACTION=I\n",
            "*CLEARANCE",
        ),
        (
            "*CONTACT PAIR, INTERACTION=I\nFACE, TOOL\n",
            "*CONTACT\n*CONTACT INCLUSIONS, ALL EXTERIOR\n",
            "`contacts`",
        ),
    ] {
        assert!(good.contains(from), "{from}");
        let found = doubts(&good.replacen(from, to, 1));
        assert!(
            found.iter().any(|text| text.contains(told)),
            "{to}: {found:#?}"
        );
    }
    let json = doubts(&good.replace("FACE, TOOL", "FACE, TOOL, X"));
    assert!(json[0].contains("\"mesh\": {\"abaqus\""), "{json:?}");
    // a stiff layer is nearly hard, and its difference is told
    let stiff = good.replacen(
        "0.3,\n",
        "0.3,\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n1e7\n",
        1,
    );
    let (_, warnings) = abaqus::problem_with_warnings(&stiff).unwrap();
    assert!(
        warnings.iter().any(|w| w.message.contains("p/1e7")),
        "{warnings:?}"
    );
    // without an elastic slip of its own it is Abaqus's default, and told
    let (_, warnings) =
        abaqus::problem_with_warnings(&good.replace(", ELASTIC SLIP=1e-4", "")).unwrap();
    assert!(
        warnings
            .iter()
            .any(|w| w.message.contains("gives no elastic slip")),
        "{warnings:?}"
    );
    let curved = sector([2.0, 1.0], [-20.0, -160.0])
        + &touching(
            "*SURFACE, TYPE=SEGMENTS, NAME=TOOL\nSTART, 0.98, -0.02\nCIRCL, 0., -1., 0., -0.02\nCIRCL, -0.98, -0.02, 0., -0.02\n",
            "",
        )
        + &pressed([0.0, -0.004]);
    assert!(abaqus::problem(&curved).is_ok());
    let turned = curved.clone() + &step("9000, 1, 1, 0.002\n");
    assert!(doubts(&turned)[0].contains("different directions"));
    // free where the tool is pressed, and moved in a later step only
    let drag = "*END STEP\n*STEP\n*STATIC\n*BOUNDARY\n9000, 1, 1, 0.001\n*END STEP";
    let free = good.replacen("9000, 1, 1, 0\n", "", 1);
    let found = doubts(&free.replacen("*END STEP", drag, 1));
    assert!(
        found[0].contains("free in 1 in the first step"),
        "{found:?}"
    );
}

/// In a step of perturbation contact does not change: a deck with contact that has one is not what it seems.
#[test]
fn a_perturbation_with_contact_is_refused() {
    let deck = block(0.0) + &touching(ROLLER, "") + &pressed([0.0, -0.05]);
    read(&deck);
    let found = doubts(&deck.replace("*STEP\n", "*STEP, PERTURBATION\n"));
    assert!(
        found.len() == 1 && found[0].contains("*STEP, PERTURBATION"),
        "{found:?}"
    );
}

/// What a deck says of its friction is told with the most that it can be, and stays told where a value of the problem is
/// changed; not where another obstacle takes its place.
#[test]
fn deviations_of_a_deck_stay_told_after_a_change() {
    let friction = "*FRICTION\n0.3, 100.\n";
    let deck = block(0.0) + &touching(ROLLER, friction) + &pressed([0.0, -0.05]);
    let messages = |problem: &Problem| {
        let model = solver::checked(
            problem,
            files::external_mesh(problem, None),
            &mut crate::support::quiet,
        );
        let warnings = model.unwrap().warnings.into_iter();
        let own = warnings.filter(|w| w.code == WarningCode::DeckDiffers);
        own.map(|w| w.message).collect::<Vec<_>>()
    };
    let mut problem = read(&deck);
    let as_read = messages(&problem);
    // 100 × 0.05
    assert!(
        as_read.len() == 1 && as_read[0].contains("at most 5.0000e0 (stress)"),
        "{as_read:?}"
    );
    problem.contacts[0].indentation = 0.02;
    let changed = messages(&problem);
    assert_eq!(
        changed,
        [format!(
            "Of the deck, before it was changed: {}",
            as_read[0]
        )]
    );
    problem.contacts[0].obstacle =
        serde_json::from_value(json!({"kind": "circle", "radius": 3.0})).unwrap();
    assert_eq!(messages(&problem), [""; 0]);
}

/// Lines of a rigid tool are not lines inside the body.
#[test]
fn the_lines_of_a_rigid_tool_are_no_boundary_of_the_body() {
    let tool = "*NODE\n9000, 0., 1.\n8001, -2., 0.\n8002, 2., 0.\n*ELEMENT, TYPE=R2D2, ELSET=TOOLLINES\n8001, 8001, 8002\n\
        *SURFACE, NAME=TOOL, TYPE=ELEMENT\nTOOLLINES, SNEG\n*RIGID BODY, ELSET=TOOLLINES, REF NODE=9000\n";
    let deck = block(0.0) + tool + &pair("") + &pressed([0.0, -0.05]);
    let problem = read(&deck);
    let model = solver::checked(
        &problem,
        files::external_mesh(&problem, None),
        &mut crate::support::quiet,
    )
    .unwrap();
    let codes: Vec<WarningCode> = model.warnings.iter().map(|w| w.code).collect();
    assert!(
        !codes.contains(&WarningCode::LinesInside),
        "{:#?}",
        model.warnings
    );
}
