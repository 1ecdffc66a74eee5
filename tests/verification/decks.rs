//! Decks as people write and export them: what names, blanks and keywords mean, and what is refused. Displacements by
//! CalculiX 2.20.

use files::{ReadError, abaqus};
use solver::mesh::Mesh;
use solver::problem::{Load, Problem, Rotation};
use solver::solution::{Solution, WarningCode};

use crate::support::{close, solve};

const NODES: &str = "*NODE, NSET=NALL\n1, 0, 0\n2, .5, 0\n3, 1, 0\n4, 1.5, 0\n5, 2, 0\n6, 0, .5\n7, 1, .5\n8, 2, .5\n\
    9, 0, 1\n10, .5, 1\n11, 1, 1\n12, 1.5, 1\n13, 2, 1\n";
const ELEMENTS: &str = "1, 1, 3, 11, 9, 2, 7, 10, 6\n2, 3, 5, 13, 11, 4, 8, 12, 7\n";
const SETS: &str = "*NSET, NSET=L\n1, 6, 9\n*NSET, NSET=R\n5, 8, 13\n*NSET, NSET=B\n1, 2, 3, 4, 5\n*ELSET, ELSET=E2\n2\n";
const MATERIAL: &str = "*MATERIAL, NAME=M\n*ELASTIC\n1000., .3\n";
const SECTION: &str = "*SOLID SECTION, ELSET=E, MATERIAL=M\n";
const HELD: &str = "*BOUNDARY\nL, 1, 2\n";

/// A block of two elements, 2 × 1: what is added to the model, and its step.
fn block(model: &str, step: &str) -> String {
    format!(
        "{NODES}*ELEMENT, TYPE=CPE8, ELSET=E\n{ELEMENTS}{SETS}{MATERIAL}{SECTION}{model}*STEP\n*STATIC\n{step}*END STEP\n"
    )
}

fn read(text: &str) -> Mesh {
    match abaqus::read(text.as_bytes()) {
        Ok((mesh, _)) => mesh,
        Err(error) => panic!("{error:#?}\n{text}"),
    }
}

fn problem(text: &str) -> Problem {
    abaqus::problem(text).unwrap_or_else(|violations| panic!("{violations:#?}\n{text}"))
}

fn refused(text: &str) -> Vec<String> {
    let list = abaqus::problem(text).expect_err(text);
    list.into_iter().map(|v| v.got).collect()
}

/// The displacement of node 13, the upper right corner.
fn corner(text: &str) -> [f64; 2] {
    at(&solve(&problem(text)), 12)
}

fn at(solution: &Solution, node: usize) -> [f64; 2] {
    [solution.fields.ux[node], solution.fields.uy[node]]
}

#[track_caller]
fn near(got: [f64; 2], expected: [f64; 2]) {
    for (got, expected) in got.into_iter().zip(expected) {
        close(got, expected, 2e-6);
    }
}

/// CAE's default names collide: a set of the part, which all of it is made of, and one of the assembly, which is
/// loaded.
fn assembly(members: &str, loaded: &str) -> String {
    format!(
        "*PART, NAME=Plate\n{NODES}*ELEMENT, TYPE=CPE8\n{ELEMENTS}*NSET, NSET=Set-1, GENERATE\n1, 13, 1\n\
         *ELSET, ELSET=Set-1\n1, 2\n*SURFACE, NAME=Surf-1\nSet-1, S1\n*SOLID SECTION, ELSET=Set-1, MATERIAL=M\n,\n*END PART\n\
         *ASSEMBLY, NAME=Asm\n*INSTANCE, NAME=Plate-1, PART=Plate\n*END INSTANCE\n*NSET, NSET=Fix, INSTANCE=Plate-1\n1, 6, 9\n\
         {members}*END ASSEMBLY\n{MATERIAL}*BOUNDARY\nFix, ENCASTRE\n*STEP\n*STATIC\n*CLOAD\n{loaded}, 1, 2.\n*END STEP\n"
    )
}

#[test]
fn a_set_of_the_part_and_one_of_the_assembly_are_two() {
    let set = "*NSET, NSET=Set-1, INSTANCE=Plate-1\n5, 8, 13\n*ELSET, ELSET=Set-1, INSTANCE=Plate-1\n2\n\
               *SURFACE, NAME=Surf-1\nSet-1, S2\n*SURFACE, NAME=Whole\nPlate-1.Set-1, S1\n";
    let expected = [0.01315672, -0.002800575];
    let one_by_one = "Plate-1.5, 1, 2.\nPlate-1.8, 1, 2.\nplate-1.13";
    for loaded in ["Set-1", "SET-1", "Asm.Set-1", one_by_one] {
        near(corner(&assembly(set, loaded)), expected);
    }
    let mesh = read(&assembly(set, "Set-1"));
    let sizes = ["Set-1", "Plate-1.Set-1", "Fix"].map(|name| mesh.node_sets[name].len());
    assert_eq!(sizes, [3, 13, 3]);
    let groups = ["Set-1", "Plate-1.Set-1"].map(|name| mesh.groups[name].len());
    assert_eq!(groups, [1, 2]);
    let sides = ["Surf-1", "Plate-1.Surf-1", "Whole"].map(|name| mesh.boundaries[name].len());
    assert_eq!(sides, [1, 2, 2]);
    assert_ne!(
        mesh.boundaries["Surf-1"][0],
        mesh.boundaries["Plate-1.Surf-1"][0]
    );
    // a set of another kind in the assembly: the part's is not meant
    let other = assembly("*ELSET, ELSET=Set-1, INSTANCE=Plate-1\n2\n", "Set-1");
    let found = refused(&other);
    assert!(
        found.len() == 1 && found[0].ends_with("`Set-1`"),
        "{found:?}"
    );
    assert!(!read(&other).node_sets.contains_key("Set-1"));
    // in the part alone its set is meant, in the assembly too if that has none
    let alone = read(&assembly("", "Set-1"));
    assert_eq!(alone.node_sets["Set-1"], alone.node_sets["Plate-1.Set-1"]);
}

#[test]
fn instances_are_moved_and_turned_each_with_its_own_numbers() {
    let instances = |second: &str| {
        format!(
            "*PART, NAME=Plate\n{NODES}*ELEMENT, TYPE=CPE8, ELSET=E\n{ELEMENTS}*NSET, NSET=Edge\n5, 8, 13\n*END PART\n\
             *ASSEMBLY, NAME=Asm\n*INSTANCE, NAME=A, PART=Plate\n*END INSTANCE\n*INSTANCE, NAME=B, PART=Plate\n{second}*END INSTANCE\n\
             *NSET, NSET=Both\nA.Edge, B.Edge\n*NSET, NSET=Point, INSTANCE=B\n13\n*END ASSEMBLY\n"
        )
    };
    let place = |mesh: &Mesh, set: &str| mesh.nodes[mesh.node_sets[set][0] as usize];
    let moved = read(&instances("5., 1., 0.\n"));
    assert_eq!((moved.nodes.len(), moved.elements.len()), (26, 4));
    assert_eq!(place(&moved, "Point"), [7.0, 2.0]);
    assert_eq!(
        ["A.Edge", "B.Edge", "Both"].map(|name| moved.node_sets[name].len()),
        [3, 3, 6]
    );
    assert!(!moved.node_sets.contains_key("Edge") && !moved.groups.contains_key("E"));
    // moved first, then turned by a quarter about the point (5, 0)
    let turned = read(&instances("5., 0., 0.\n5., 0., 0., 5., 0., 1., 90.\n"));
    assert_eq!(place(&turned, "Point"), [4.0, 2.0]);
    let back = read(&instances("5., 0., 0.\n5., 0., 3., 5., 0., -1., -90.\n"));
    assert_eq!(place(&back, "Point"), [4.0, 2.0]);
    let blank = read(&instances("5., ,\n"));
    assert_eq!(place(&blank, "Point"), [7.0, 1.0]);
    let Err(ReadError::Invalid(list)) =
        abaqus::read(instances("5., 0., 0.\n5., 0., 0., 5., 1., 0., 90.\n").as_bytes())
    else {
        panic!("a body left its plane");
    };
    assert!(
        list[0].got.contains("turned by 90 degrees about (0, 1, 0)"),
        "{list:#?}"
    );
    // one name of two instances is that of neither
    let step = format!("{MATERIAL}*BOUNDARY\nEdge, 1, 2\n*STEP\n*STATIC\n*END STEP\n");
    let found = refused(&(instances("5., 1., 0.\n") + &step));
    assert!(found.iter().any(|got| got.ends_with("`Edge`")), "{found:?}");
}

/// An instance with a mesh of its own, as of independent instances; a part that nothing uses may be anything.
#[test]
fn a_mesh_may_belong_to_the_instance_and_unused_parts_are_left_out() {
    let deck = format!(
        "*PART, NAME=Empty\n*END PART\n*PART, NAME=Die\n*NODE\n1, 0, 0, 0\n1, 9, 9, 9\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n*PLASTIC\n1\n*END PART\n\
         *ASSEMBLY, NAME=A\n*INSTANCE, NAME=I, PART=Empty\n1., 0., 0.\n{NODES}*ELEMENT, TYPE=CPE8, ELSET=E\n{ELEMENTS}{SETS}{SECTION}\
         *END INSTANCE\n*END ASSEMBLY\n{MATERIAL}*BOUNDARY\nI.L, 1, 2\n*STEP\n*STATIC\n*CLOAD\nI.R, 1, 2.\n*END STEP\n"
    );
    assert_eq!(read(&deck).nodes[0], [1.0, 0.0]);
    near(corner(&deck), [0.01315672, -0.002800575]);
    let parts = format!("*PART, NAME=P\n{NODES}*END PART\n*PART, NAME=Q\n*END PART\n");
    let Err(ReadError::Invalid(list)) = abaqus::read(parts.as_bytes()) else {
        panic!("nothing says where the parts are");
    };
    assert!(list[0].got.contains("P, Q without *INSTANCE"), "{list:#?}");
}

#[test]
fn a_name_may_contain_a_dot() {
    let deck = block(
        &format!(
            "*NSET, NSET=P.R\n5, 8, 13\n*ELSET, ELSET=a.b.c\n2\n*SURFACE, NAME=S.1\na.b.c, S2\n{HELD}"
        ),
        "*CLOAD\nP.R, 1, 2.\n",
    );
    near(corner(&deck), [0.01315672, -0.002800575]);
    let mesh = read(&deck);
    assert_eq!(mesh.boundaries["S.1"], mesh.boundaries["P.R"]);
    assert_eq!(mesh.groups["a.b.c"], [1]);
}

/// A blank last component is the first; blank values are 0.
#[test]
fn blanks_mean_what_they_mean_in_both_programs() {
    let moved = [0.2, -0.02188596];
    for row in ["R, 1, , .2", "R,1,1,.2", "R, 1, 1, .2,", "R,1,,2.D-1,,"] {
        near(corner(&block(HELD, &format!("*BOUNDARY\n{row}\n"))), moved);
    }
    for row in ["R, 1", "R, 1,", "R,1,,", "R, 1, 1", "R, 1, , 0"] {
        let held = solve(&problem(&block(
            HELD,
            &format!("*BOUNDARY\n{row}\n*CLOAD\n10, 2, 1.\n"),
        )));
        assert_eq!(at(&held, 12)[0], 0.0, "{row}");
    }
    near(
        corner(&block("*BOUNDARY\nL, 1, 3\nR, 1, 1, .2\n", "")),
        moved,
    );
    let quiet = |step: &str| corner(&block(HELD, step));
    assert_eq!(quiet("*CLOAD\nR, 1,\n"), [0.0; 2]);
    assert_eq!(quiet("*DLOAD\n2, P2,\n"), [0.0; 2]);
    for (keyword, row) in [
        ("BOUNDARY", "R, , 1, .2"),
        ("BOUNDARY", ", 1, 1, .2"),
        ("BOUNDARY", "R"),
        ("BOUNDARY", "R, 2, 1, .2"),
        ("BOUNDARY", "R, 1, x, .2"),
        ("BOUNDARY", "R, 1, 1, x"),
        ("BOUNDARY", "R, 1, 1, .2, 7"),
        ("BOUNDARY", "R, 1, 3, .2"),
        ("BOUNDARY", "R, 11, 11, 20."),
        ("BOUNDARY", "R, ENCASTRE, 1"),
        ("BOUNDARY", "R, NOWARP"),
        ("CLOAD", "R, , 2."),
        ("CLOAD", ", 1, 2."),
        ("CLOAD", "R, 3, 2."),
        ("CLOAD", "R, 1, x"),
        ("CLOAD", "R, 1, 2., 3."),
        ("DLOAD", ", P2, 5."),
        ("DLOAD", "2, , 5."),
        ("DLOAD", "2, P2, x"),
        ("DLOAD", "2, P2NU, 5."),
        ("DLOAD", "2, P5, 5."),
        ("DSLOAD", "R, P1, 5."),
    ] {
        let found = refused(&block(HELD, &format!("*{keyword}\n{row}\n")));
        assert_eq!(found.len(), 1, "*{keyword} {row}: {found:?}");
        assert!(found[0].contains(&format!("`{row}`")), "{found:?}");
    }
    for (from, to, got) in [
        ("1000., .3", "1000.,", "1 elastic constants"),
        ("1000., .3", ", .3", "constant 1 is blank"),
        ("MATERIAL=M\n", "MATERIAL=M\nthick\n", "`thick`"),
    ] {
        let found = refused(&block(HELD, "").replacen(from, to, 1));
        assert!(found.iter().any(|found| found.contains(got)), "{found:?}");
    }
}

#[test]
fn conditions_have_names() {
    let held = |name: &str| {
        let step = "*BOUNDARY\nR, 1, 1, .2\nR, 2, 2, .1\n";
        let model = format!("*BOUNDARY\nL, {name}\n");
        let support = problem(&block(&model, step)).supports.remove(0);
        [support.ux.is_some(), support.uy.is_some()]
    };
    for (name, components) in [
        ("PINNED", [true, true]),
        ("Encastre", [true, true]),
        ("XSYMM", [true, false]),
        ("ysymm", [false, true]),
        ("XASYMM", [false, true]),
        ("YASYMM", [true, false]),
        ("ZASYMM", [true, true]),
    ] {
        assert_eq!(held(name), components, "{name}");
    }
    // in the plane by itself
    assert_eq!(
        problem(&block("*BOUNDARY\nL, ZSYMM\nL, 1, 2\n", ""))
            .supports
            .len(),
        1
    );
}

/// As in CalculiX the later row holds, wherever the sets overlap; and a warning says so.
#[test]
fn of_two_rows_for_a_node_the_later_holds() {
    for (model, step, left, right) in [
        (
            "*BOUNDARY\nL, 1, 1, 0.\nB, 2, 2\nB, 1, 1, .1\n",
            "",
            -0.03663487,
            [0.0464868, 0.02040993],
        ),
        (
            "*BOUNDARY\nB, 1, 1, .1\nB, 2, 2\nL, 1, 1, 0.\n",
            "",
            -0.0561922,
            [0.04489679, 0.01900534],
        ),
        (
            "*BOUNDARY\nL, 1, 1, 0.\nB, 2, 2\n",
            "*BOUNDARY\nB, 1, 1, .1\n",
            -0.03663487,
            [0.0464868, 0.02040993],
        ),
    ] {
        let solution = solve(&problem(&block(model, step)));
        close(at(&solution, 8)[1], left, 2e-6);
        near(at(&solution, 12), right);
        let told = solution
            .summary
            .warnings
            .iter()
            .filter(|w| w.code == WarningCode::SupportsOverlap);
        let told: Vec<_> = told.map(|w| &w.message).collect();
        assert!(
            told.len() == 1 && told[0].starts_with("Node 1 at (0, 0)"),
            "{told:?}"
        );
    }
    // one value in two sets, or a row for the same set, is nothing to tell
    let same = solve(&problem(&block(
        "*BOUNDARY\nL, 1, 2\nB, 1, 1\nR, 1, 1, .1\n",
        "*BOUNDARY\nR, 1, 1, .2\n",
    )));
    let told = |solution: &Solution| {
        solution
            .summary
            .warnings
            .iter()
            .any(|w| w.code == WarningCode::SupportsOverlap)
    };
    assert!(told(&same)); // the corner of B and R
    let same = solve(&problem(&block(
        "*BOUNDARY\nL, 1, 2\nR, 1, 1, .1\n",
        "*BOUNDARY\nR, 1, 1, .2\n1, 1, 1\n",
    )));
    assert!(!told(&same));
    near(at(&same, 12), [0.2, -0.02188596]);
}

/// The first *BOUNDARY of the step decides whether those of the model remain; loads only add.
#[test]
fn op_new_in_the_first_step_is_what_calculix_does() {
    near(
        corner(&block(HELD, "*BOUNDARY, OP=NEW\nB, 1, 2\nR, 1, 1, .1\n")),
        [0.1, -0.0561922],
    );
    for step in [
        "*BOUNDARY, OP=NEW\nL, 1, 2\n*BOUNDARY, OP=NEW\nR, 1, 1, .1\n",
        "*BOUNDARY\nL, 1, 2\n*BOUNDARY, OP=NEW\nR, 1, 1, .1\n",
        "*BOUNDARY, OP=MOD\nL, 1, 2\nR, 1, 1, .1\n",
    ] {
        near(corner(&block("", step)), [0.1, -0.01094298]);
    }
    near(
        corner(&block(HELD, "*CLOAD, OP=NEW\nR, 1, 2.\n")),
        [0.01315672, -0.002800575],
    );
    near(
        corner(&block(HELD, "*CLOAD\nR, 1, 2.\n*CLOAD, OP=NEW\n8, 1, 2.\n")),
        [0.0159047, -0.002641877],
    );
    near(
        corner(&block(HELD, "*CLOAD\nR, 1, 2.\nR, 1, 2.\n")),
        [0.02631344, -0.005601151],
    );
    near(
        corner(&block(HELD, "*DLOAD, OP=NEW\n2, P2, 5.\n")),
        [-0.008916937, 0.0009685334],
    );
    near(
        corner(&block(HELD, "*DLOAD\n2, P2, 5.\nE2, P2, 5.\n")),
        [-0.01783387, 0.001937067],
    );
}

#[test]
fn an_amplitude_counts_at_the_end_of_the_step() {
    let table = |rows: &str| format!("{HELD}*AMPLITUDE, NAME=A\n{rows}\n");
    let half = [0.006578359, -0.001400288];
    let load = "*CLOAD, AMPLITUDE=A\nR, 1, 2.\n";
    for rows in [
        "0., 0., 1., .5",
        "0., 0.,\n2., 1.",
        "0., .5",
        "0., 0., .5, .5",
    ] {
        near(corner(&block(&table(rows), load)), half);
    }
    let two = block(&table("0., 0., 2., 1."), load).replace("*STATIC\n", "*STATIC\n1., 2.\n");
    near(corner(&two), [0.01315672, -0.002800575]);
    near(
        corner(&block(
            &table("0., 0., 2., 1."),
            "*BOUNDARY, AMPLITUDE=A\nR, 1, 1, .2\n",
        )),
        [0.1, -0.01094298],
    );
    for (from, to, why) in [
        (
            "A\n0",
            "A, DEFINITION=SMOOTH STEP\n0",
            "with DEFINITION=SMOOTH STEP",
        ),
        ("NAME=A", "NAME=C", "the unknown amplitude"),
        ("1., .5", "1.", "with a time that has no factor"),
        ("1., .5", "0., .5", "whose times do not increase: 0 after 0"),
        ("0., 0., 1., .5\n", "", "without a table"),
    ] {
        let found = refused(&block(&table("0., 0., 1., .5"), load).replacen(from, to, 1));
        assert!(
            found.len() == 1 && found[0].contains("amplitude `A`") && found[0].contains(why),
            "{found:?}"
        );
    }
}

#[test]
fn a_load_inside_the_body_is_refused_and_its_name_is_none_of_a_boundary() {
    for step in [
        "*DLOAD\nE, P2, 5.\n",
        "*DLOAD\n1, P2, 5.\n",
        "*DSLOAD\nS, P, 5.\n",
    ] {
        let deck = block(&format!("*SURFACE, NAME=S\nE, S2\n{HELD}"), step);
        let found = refused(&deck);
        assert!(
            found.len() == 1 && found[0].contains("inside the body"),
            "{found:?}"
        );
    }
    // as a mesh, what remains has a name that says what it is
    let mesh = read(&block("*SURFACE, NAME=S\nE, S2\n", "*DLOAD\nE, P2, 5.\n"));
    assert!(!mesh.boundaries.contains_key("S") && !mesh.boundaries.contains_key("E P2"));
    assert_eq!(mesh.boundaries["S at the surface"].len(), 1);
    // a surface without sides is the surface of the body
    let whole = block(
        &format!("*SURFACE, NAME=S\nE,\n*SURFACE, NAME=T\nE2\n{HELD}"),
        "*DSLOAD\nS, P, 5.\n",
    );
    let mesh = read(&whole);
    assert_eq!(
        (mesh.boundaries["S"].len(), mesh.boundaries["T"].len()),
        (6, 3)
    );
    assert!(abaqus::problem(&whole).is_ok());
}

#[test]
fn a_set_of_nodes_may_be_that_of_elements() {
    let mesh = read(&block(
        "*NSET, NSET=Q, ELSET=E2\n*NSET, NSET=Q\n1\n*NSET, NSET=W\nQ\n",
        "",
    ));
    assert_eq!(
        (mesh.node_sets["Q"].len(), mesh.node_sets["W"].len()),
        (9, 9)
    );
    let deck = block("*NSET, NSET=Q, ELSET=E3\n", "");
    let Err(ReadError::Invalid(list)) = abaqus::read(deck.as_bytes()) else {
        panic!("an empty set");
    };
    assert!(
        list[0].got.contains("`E3` in the set `Q`") && list[0].hint.contains("E2"),
        "{list:#?}"
    );
    // a number that no node has is found by its line
    let deck = block("*NSET, NSET=N1\n4, 999, 10\n", "");
    let Err(ReadError::Invalid(list)) = abaqus::read(deck.as_bytes()) else {
        panic!("a node that is missing");
    };
    let line = deck.lines().position(|text| text.contains("N1")).unwrap() + 1;
    let got = [line, line + 1].map(|line| format!("line {line}: node 999 in the set `N1`"));
    assert!(got.contains(&list[0].got), "{list:#?}");
}

#[test]
fn the_target_of_a_row_must_exist_and_not_be_empty() {
    for (model, step, got) in [
        ("", "*CLOAD\nX, 1, 2.\n", "`X`"),
        ("", "*CLOAD\n99, 1, 2.\n", "`99`"),
        (
            "*NSET, NSET=N\n",
            "*BOUNDARY\nN, 1\n",
            "a displacement of `N`",
        ),
        (
            "*NSET, NSET=N\n",
            "*CLOAD\nN, 1, 2.\n",
            "a force on `N`, a set without nodes",
        ),
        (
            "*NODE, NSET=REF\n99, 7, 7, 3\n",
            "*CLOAD\nREF, 1, 2.\n",
            "a force on `REF`, where node 99 belongs to no plane element",
        ),
        (
            "*NODE, NSET=REF\n99, 7, 7, 3\n",
            "*BOUNDARY\nREF, 2, 2, -.1\n",
            "a displacement of `REF`",
        ),
        ("*ELSET, ELSET=N\n", "*DLOAD\nN, P1, 2.\n", "no side"),
        ("", "*DLOAD\nX, P1, 2.\n", "`X`"),
        ("", "*DSLOAD\nE2, P, 2.\n", "`E2`"),
    ] {
        let found = refused(&block(&format!("{HELD}{model}"), step));
        assert!(
            found.len() == 1 && found[0].contains(got),
            "{step}: {found:?}"
        );
        assert!(abaqus::read(block(model, step).as_bytes()).is_ok());
    }
    // a reference point may be held, and lie anywhere
    let held = block(
        &format!("{HELD}*NODE, NSET=REF\n99, 7, 7, 3\n*BOUNDARY\nREF, 1, 6\n"),
        "*CLOAD\nR, 1, 2.\n",
    );
    near(corner(&held), [0.01315672, -0.002800575]);
}

/// Each message says what was found where, and what to do: numbers and names that there are, fields that are blank.
#[test]
fn messages_say_what_to_do() {
    let all = |model: &str, step: &str| {
        abaqus::problem(&block(&format!("{HELD}{model}"), step)).expect_err(step)
    };
    let known = "The nodes have numbers from 1 to 13, not necessarily all of them. Correct the number, or define it by *NODE.";
    for (model, step, got, hint) in [
        ("", "*CLOAD\n99, 1, 2.\n", "`99`", known),
        (
            "",
            "*CLOAD\nX, 1, 2.\n",
            "`X`",
            "Known names: B, L, NALL, R. Correct the name",
        ),
        ("*NSET, NSET=N\n99\n", "", "node 99 in the set `N`", known),
        (
            "*NSET, NSET=N, GENERATE\n20, 30\n",
            "",
            "nodes 20 to 30 in",
            known,
        ),
        (
            "*NSET, NSET=N, INSTANCE=P\n1\n",
            "",
            "the instance `P`",
            "leave it out",
        ),
        (
            "*ELSET, ELSET=N\nX\n",
            "",
            "`X` in the set `N`",
            "by *ELSET",
        ),
        (
            "",
            "*DLOAD\n9, P1, 2.\n",
            "`9`",
            "elements have numbers from 1 to 2",
        ),
        (
            "",
            "*DSLOAD\nS, P, 2.\n",
            "`S`",
            "define the surface by *SURFACE",
        ),
        (
            "",
            "*BOUNDARY\nR,, 1, 2.\n",
            "the first component is blank",
            "A blank last component",
        ),
        (
            "",
            "*BOUNDARY\n, 1, 1, 2.\n",
            "the node or set is blank",
            "a blank value 0",
        ),
        (
            "",
            "*BOUNDARY\nR, 1, 1, .1, 2.\n",
            ": 5 fields",
            "Components are 1 (x)",
        ),
        (
            "",
            "*BOUNDARY\nR, 1, 1, x\n",
            "the value `x`",
            "Components are",
        ),
        (
            "",
            "*BOUNDARY\nR, 3, 3, .1\n",
            "a component that a plane body does not have",
            "Components are",
        ),
        (
            "",
            "*BOUNDARY\nR, 2, 3, .1\n",
            "for components up to 3",
            "Components are",
        ),
        (
            "",
            "*BOUNDARY\nR, 2, 1, .1\n",
            "components 2 to 1",
            "Components are",
        ),
        (
            "",
            "*BOUNDARY\nR, XSIM\n",
            "`XSIM` in place of a component",
            "Components are",
        ),
        (
            "",
            "*CLOAD\nR,, 2.\n",
            "the component is blank, which",
            "A blank value is 0",
        ),
        (
            "",
            "*CLOAD\n, 1, 2.\n",
            "the target of the load is blank",
            "A blank value is 0",
        ),
        ("", "*CLOAD\nR, 6, 2.\n", "the component `6`", "Moments"),
        (
            "",
            "*DLOAD\nE, , 2.\n",
            "the kind of load is blank",
            "A blank value is 0",
        ),
        (
            "",
            "*DLOAD\nE, NEWTON, 9.81, 0., -1.\n",
            "5 fields, with the kind of load `NEWTON`",
            "Gravity is GRAV",
        ),
        (
            "",
            "*DLOAD\nE, P1, x\n",
            "the value `x` is no number",
            "A blank value is 0",
        ),
        (
            "*MATERIAL, NAME=M2\n*ELASTIC\n, .3\n",
            "",
            "constant 1 is blank",
            "no default",
        ),
    ] {
        let list = all(model, step);
        assert_eq!(list.len(), 1, "{model}{step}: {list:#?}");
        assert!(
            list[0].got.contains(got) && list[0].hint.contains(hint),
            "{model}{step}: {list:#?}"
        );
        assert!(list[0].line().is_some(), "{list:#?}");
    }
    // each unknown keyword once, and what is known once
    let list = all("*FOO\n*BAR\n*FOO, A=1\n*foo\n", "*BAR\n");
    let got: Vec<&str> = list
        .iter()
        .map(|v| v.got.split_once(": ").unwrap().1)
        .collect();
    assert_eq!(
        got,
        ["*FOO, here and 2 more times", "*BAR, here and once more"]
    );
    assert!(
        list[0].hint.contains("*RIGID BODY, *CONTACT PAIR") && !list[1].hint.contains("*RIGID"),
        "{list:#?}"
    );
    // types of two theories, of two rules: at the second, with the first
    for (of, got) in [
        (
            "CPS8",
            "elements of type `CPS8` beside those of type `CPE8` on line 15",
        ),
        (
            "CPE8R",
            "elements of type `CPE8R` beside those of type `CPE8` on line 15",
        ),
    ] {
        let deck = block(HELD, "").replace(
            "\n2, 3, 5",
            &format!("\n*ELEMENT, TYPE={of}, ELSET=E\n2, 3, 5"),
        );
        assert_eq!(refused(&deck), [format!("line 17: {got}")]);
    }
    // a mesh is one: what a problem could not have of it is not told
    let mesh =
        format!("{NODES}*ELEMENT, TYPE=CPE8\n{ELEMENTS}*ELEMENT, TYPE=T3D2\n7, 1, 3\n*FOO\n");
    assert_eq!(refused(&mesh), ["a deck without *STEP"]);
    // up to five elements of those that are meant
    let list = all("", "*DLOAD\nE, P2, 5.\n");
    assert!(
        list[0]
            .got
            .ends_with("1 of its 2 sides lie inside the body, at elements 1, 2"),
        "{list:#?}"
    );
}

/// As a mesh a deck may contain anything; lines name boundaries.
#[test]
fn other_elements_are_left_out_of_a_mesh_and_refused_in_a_problem() {
    for (kind, elements) in [
        ("T3D2", "7, 1, 6\n8, 6, 9\n"),
        ("T3D3", "7, 1, 6, 9\n"),
        ("T2D3", "7, 1, 9, 6\n"),
        ("R2D2", "7, 1, 6\n"),
        ("B21", "7, 1, 9\n"),
        ("SPRINGA", "7, 1, 9\n"),
        ("C3D8R", "7, 1, 2, 3, 4, 5, 6, 7, 8\n"),
        (
            "C3D20",
            "7, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 1, 2,\n3, 4, 5, 6, 7\n8, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 1, 2\n3, 4, 5, 6, 7\n",
        ),
        ("CONN2D2", "7, A.1, B.2\n"),
        ("U1", "7, 1,\n2, 3\n"),
    ] {
        let deck = block(
            &format!(
                "*ELEMENT, TYPE={kind}, ELSET=Wall\n{elements}*ELSET, ELSET=Mixed\nWall, 2\n{HELD}"
            ),
            "",
        );
        let mesh = read(&deck);
        assert_eq!((mesh.elements.len(), mesh.nodes.len()), (2, 13), "{kind}");
        let line = matches!(kind, "T3D3" | "T2D3" | "B21");
        assert_eq!(
            mesh.boundaries.get("Wall").map(Vec::len),
            line.then_some(1),
            "{kind}"
        );
        assert!(
            !mesh.groups.contains_key("Wall") && mesh.groups["Mixed"] == [1],
            "{kind}"
        );
        let found = refused(&deck);
        assert!(
            found.len() == 1 && found[0].contains(&format!("elements of type `{kind}`")),
            "{found:?}"
        );
    }
    // rigid lines of a rigid body are its surface; those beside them would hold the nodes of the body together
    let rigid = "*NODE\n51, 0, 3\n52, 2, 3\n53, 1, 3\n*ELEMENT, TYPE=R2D2, ELSET=TOOL\n71, 51, 52\n\
        *RIGID BODY, ELSET=TOOL, REF NODE=53\n*BOUNDARY\n53, 1, 2\n53, 6\n";
    let beside = "*ELEMENT, TYPE=R2D2, ELSET=BAR\n72, 6, 9\n";
    problem(&block(&format!("{rigid}{HELD}"), "*CLOAD\nR, 1, 2.\n"));
    let found = refused(&block(
        &format!("{rigid}{beside}{HELD}"),
        "*CLOAD\nR, 1, 2.\n",
    ));
    assert!(
        found.len() == 1 && found[0].contains("`R2D2` that belong to no *RIGID BODY"),
        "{found:?}"
    );
    let mass = format!("*ELEMENT, TYPE=MASS, ELSET=Point\n7, 5\n*MASS, ELSET=Point\n3.\n{HELD}");
    near(
        corner(&block(&mass, "*CLOAD\nR, 1, 2.\n")),
        [0.01315672, -0.002800575],
    );
}

#[test]
fn twins_of_plane_elements_are_read() {
    let twin = |kind: &str| block(HELD, "*CLOAD\nR, 1, 2.\n").replacen("CPE8", kind, 1);
    for kind in ["CPE8", "CPE8H", "CPE8T", "CPE8HT"] {
        near(corner(&twin(kind)), [0.01315672, -0.002800575]);
    }
    assert_eq!(problem(&twin("CPE8RH")).quadrature, 2);
    for kind in ["CPEG8", "DC2D8", "DCAX8", "CPE8P", "S8R", "M3D8", "CGAX8"] {
        assert_eq!(read(&twin(kind)).elements.len(), 2, "{kind}");
        let found = refused(&twin(kind));
        assert!(
            found.len() == 1 && found[0].contains(&format!("`{kind}`")),
            "{found:?}"
        );
    }
    let solid = twin("C3D8").replace(ELEMENTS, "1, 1, 2, 3, 4, 5, 6, 7, 8\n");
    let Err(ReadError::Invalid(list)) = abaqus::read(solid.as_bytes()) else {
        panic!("a solid is no plane mesh");
    };
    assert!(list[0].got.contains("elements of type `C3D8`"), "{list:#?}");
}

#[test]
fn texts_of_other_systems_are_read() {
    let deck = block(
        &format!("*NSET,\n** a remark\n\nNSET=Q\n5, 8,\n** another\n13\n{HELD}"),
        "*CLOAD\nQ, 1, 2.\n",
    );
    let expected = [0.01315672, -0.002800575];
    near(corner(&deck), expected);
    let bytes = |text: &str| files::text(text.as_bytes().to_vec());
    near(corner(&bytes(&format!("\u{feff}{deck}"))), expected);
    for end in ["\r\n", "\r"] {
        let other = deck.replace('\n', end);
        near(corner(&other), expected);
        assert_eq!(read(&other), read(&deck));
    }
    // Latin-1: a heading, a comment and a name
    let named = format!(
        "*HEADING\nPrüfkörper\n** 20 °C\n{}",
        deck.replace("=Q", "=Stütze").replace("Q,", "STÜTZE,")
    );
    let latin: Vec<u8> = named.chars().map(|c| c as u8).collect();
    let problem = problem(&files::text(latin.clone()));
    assert_eq!(problem.title.as_deref(), Some("Prüfkörper"));
    near(at(&solve(&problem), 12), expected);
    let (mesh, _) = abaqus::read(&latin[..]).unwrap_or_else(|error| panic!("{error:?}"));
    assert!(mesh.node_sets.contains_key("Stütze"));
    let binary = deck.replace("a remark", "a\0remark");
    assert!(abaqus::read(binary.as_bytes()).is_err());
}

/// A comma in a number divides it in two: where the second number could have a meaning, the first would be taken for
/// zero without a word.
#[test]
fn decimal_commas_are_told() {
    let load = "*CLOAD\nR, 1, 2.\n";
    let good = block(HELD, load).replace(SECTION, &format!("{SECTION}2.5\n"));
    let thick = corner(&good);
    for same in [
        good.replace("1000., .3", "1000., .3, 20."),
        good.replace("2.5\n", "2.5,,\n"),
        good.replace("\n2, .5, 0\n", "\n2, .5, 0, 0,\n"),
        // as CalculiX's own decks have it
        good.replace("\n2, .5, 0\n", "\n2, .5, 0, , 0.\n"),
        good.replace("*SOLID SECTION", "*SOLID SECTION, OFFSET=0.5"),
        good.replace("2.5\n", "2.500   , 5\n"),
    ] {
        near(corner(&same), thick);
    }
    let cork = good.replace("1000., .3", "1000., 0");
    assert!(abaqus::problem(&cork).is_ok());
    for (from, to, got) in [
        ("1000., .3", "1000., 0,3", "ν = 0, and 3 as a temperature"),
        (
            "1000., .3",
            "1000,0, 0.3",
            "ν = 0, and 0.3 as a temperature",
        ),
        ("1000., .3", "1000,0, 0,3", "4 elastic constants"),
        ("2.5\n", "2,5\n", "`2,5`"),
        ("\n2, .5, 0\n", "\n2, 0,5, 0,0\n", "`2, 0,5, 0,0`"),
        ("\n2, .5, 0\n", "\n2, .5, 0, , 5\n", "`2, .5, 0, , 5`"),
        ("R, 1, 2.", "R, 1, 2,5", "`R, 1, 2,5`: 4 fields"),
        ("L, 1, 2\n", "L, 1, 2, 0,0\n", "`L, 1, 2, 0,0`: 5 fields"),
    ] {
        assert!(good.contains(from), "{from}");
        let found = refused(&good.replacen(from, to, 1));
        assert!(
            found.iter().any(|text| text.contains(got)),
            "{to}: {found:?}"
        );
    }
}

/// GRAV and CENTRIF act on the mass, the direction without regard to its length; rows for parts of the body count together.
#[test]
fn gravity_and_rotation_of_a_deck_are_loads_of_the_mass() {
    let dense = format!("{MATERIAL}*DENSITY\n2., 20.\n2., 100.\n");
    let deck = |rows: &str| block(HELD, &format!("*DLOAD\n{rows}")).replace(MATERIAL, &dense);
    let gravity = Load::Gravity([6.0, -8.0]);
    let rotation = Load::Rotation(Rotation {
        angular_velocity: 2.0,
        about: Some([1.0, -0.5]),
    });
    let both = "E, GRAV, 10., 3., -4.\nE, CENTRIF, 4., 1., -.5, 0., 0., 0., 2.\n";
    let found = problem(&deck(both));
    assert_eq!(found.materials[0].density, Some(2.0));
    assert_eq!(found.loads, [rotation.clone(), gravity.clone()]);
    let parts = "1, GRAV, 10., 3., -4.\n2, grav, 10., 3., -4., 0.\n";
    assert_eq!(problem(&deck(parts)).loads, std::slice::from_ref(&gravity));
    let all = ", GRAV, 10., 3., -4.\n";
    assert_eq!(problem(&deck(all)).loads, std::slice::from_ref(&gravity));
    let twice = "E, GRAV, 10., 3., -4.\n, GRAV, 10., 3., -4.\n";
    assert_eq!(problem(&deck(twice)).loads, [gravity.clone(), gravity]);
    for (row, got) in [
        ("1, GRAV, 10., 3., -4.", "of `1` alone"),
        ("E, GRAV, 10., 0., 0., 1.", "the direction 0, 0, 1"),
        ("E, GRAV, 10.", "the kind of load `GRAV`"),
        ("E, GRAV, x, 0., -1.", "with the kind of load `GRAV`"),
        (
            "E, CENTRIF, 4., 0., 0., 0., 1.",
            "with the direction 1, 0, 0",
        ),
        (
            "E, CENTRIF, -4., 0., 0., 0., 0., 0., 1.",
            "-4 for the square",
        ),
        ("F, GRAV, 10., 0., -1.", "`F`"),
    ] {
        let found = refused(&deck(&format!("{row}\n")));
        assert!(
            found.len() == 1 && found[0].contains(got),
            "{row}: {found:?}"
        );
    }
    for (from, to, got) in [
        ("*DENSITY\n2., 20.\n2., 100.\n", "", "without *DENSITY"),
        ("2., 100.", "3., 100.", "depends on temperature"),
    ] {
        let found = refused(&deck(both).replace(from, to));
        assert!(found.len() == 1 && found[0].contains(got), "{found:?}");
    }
    // a body of revolution rotates about its own axis, and hangs along it
    let revolved = |rows: &str| deck(rows).replace("CPE8", "CAX8");
    let about = Load::Rotation(Rotation {
        angular_velocity: 2.0,
        about: None,
    });
    let rows = "E, CENTRIF, 4., 0., 0., 0., 0., 1., 0.\nE, GRAV, 10., 0., 1., 0.\n";
    assert_eq!(
        problem(&revolved(rows)).loads,
        [about, Load::Gravity([0.0, 10.0])]
    );
    for (row, got) in [
        (
            "E, CENTRIF, 4., 0., 0., 0., 0., 0., 1.",
            "with the direction 0, 0, 1",
        ),
        (
            "E, CENTRIF, 4., 1., 0., 0., 0., 1., 0.",
            "an axis through 1, 0",
        ),
        ("E, GRAV, 10., 1., 0., 0.", "the direction 1, 0, 0"),
    ] {
        let found = refused(&revolved(&format!("{row}\n")));
        assert!(
            found.len() == 1 && found[0].contains(got),
            "{row}: {found:?}"
        );
    }
}

#[test]
fn keywords_without_effect_are_passed_over_and_others_refused_by_name() {
    let load = "*CLOAD\nR, 1, 2.\n";
    let idle = "*EXPANSION\n1.2E-5\n*DENSITY\n7.8E-9\n*CONDUCTIVITY\n50.\n*MATERIAL, NAME=Rubber\n*HYPERELASTIC, N=1\n1., 0.\n\
                *ELASTIC, TYPE=ANISO\n1., 2.\n*PHYSICAL CONSTANTS, ABSOLUTE ZERO=-273\n*ORIENTATION, NAME=O, SYSTEM=CYLINDRICAL\n0., 0., 0., 0., 0., 1.\n";
    let step = "*CONTROLS, PARAMETERS=FIELD\n.005, .01\n*CONTACT OUTPUT\nCSTRESS\n*OUTPUT, FIELD, VARIABLE=PRESELECT\n*ENERGY FILE\n*CLOAD\nR, 1, 2.\n";
    let deck = block(&format!("{idle}{HELD}"), step)
        .replace("MATERIAL=M\n*EXP", "MATERIAL=M, ORIENTATION=O\n*EXP");
    near(corner(&deck), [0.01315672, -0.002800575]);
    let warm = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nNALL, 20.\n";
    near(
        corner(&block(&format!("{warm}{HELD}"), load)),
        [0.01315672, -0.002800575],
    );
    let plastic = MATERIAL.to_owned() + "*PLASTIC\n5., 0.\n";
    for (deck, got) in [
        (block(HELD, load).replace(MATERIAL, &plastic), "*PLASTIC"),
        (
            block(&format!("*EQUATION\n2\n1, 1, 1., 5, 1, 1.\n{HELD}"), load),
            "*EQUATION",
        ),
        (
            block(&format!("*TIE, NAME=T\nA, B\n{HELD}"), load),
            "`A` in a contact pair",
        ),
        (block(HELD, load).replace("*STATIC", "*DYNAMIC"), "*DYNAMIC"),
        (
            block(HELD, load).replace("*STATIC", "*STATIC, RIKS"),
            "*STATIC, RIKS",
        ),
        (
            block(HELD, load).replace("*STEP", "*STEP, NLGEOM=YES"),
            "*STEP, NLGEOM",
        ),
        (
            block(HELD, load).replace("*STEP", "*STEP, NLGEON"),
            "*STEP with NLGEON",
        ),
        (
            block(HELD, load).replace("*ELASTIC", "*ELASTIC, TYP=ENGINEERING"),
            "*ELASTIC with TYP",
        ),
        (
            block(HELD, load).replace("*SOLID SECTION", "*SOLID SECTION, ORIENTAION=A"),
            "*SOLID SECTION with ORIENTAION",
        ),
        (
            block(HELD, load).replace("*CLOAD", "*CLOAD, FOLLOWER"),
            "*CLOAD with FOLLOWER",
        ),
        (
            block(HELD, "*BOUNDARY, TYPE=VELOCITY\nR, 1, 1, 1.\n"),
            "*BOUNDARY with TYPE=VELOCITY",
        ),
        (
            block(&format!("{MATERIAL}{HELD}"), load),
            "the material `M` a second time",
        ),
    ] {
        let found = refused(&deck);
        assert!(
            !found.is_empty()
                && found
                    .iter()
                    .all(|found| found.contains(got) || found.contains("second time")),
            "{got}: {found:?}"
        );
    }
    for (change, hint) in [
        ("TYPE=ELEMENT, REMOVE\nE2\n", "Leave them out of the deck"),
        ("TYPE=ELEMENT, ADD\nE2\n", "Delete this keyword"),
        (
            "TYPE=CONTACT PAIR, REMOVE\nA, B\n",
            "Delete this keyword if the pair still acts",
        ),
        (
            "TYPE=CONTACT PAIR, ADD\nA, B\n",
            "a pair acts from the first step",
        ),
    ] {
        let list = abaqus::problem(&block(HELD, &format!("*MODEL CHANGE, {change}{load}")));
        let list = list.expect_err(change);
        let what = change.split('\n').next().unwrap();
        assert_eq!(list.len(), 1, "{list:?}");
        assert!(
            list[0].got.ends_with(what) && list[0].hint.contains(hint),
            "{list:?}"
        );
    }
    let linear = block(HELD, load).replace("*STEP", "*STEP, NLGEOM=NO, NAME=Pull, PERTURBATION");
    assert!(abaqus::problem(&linear).is_ok());
}

/// Only a change of temperature strains a material that expands: 20 degrees from the beginning to the end change nothing.
/// Displacements by CalculiX.
#[test]
fn temperatures_count_where_they_change_and_the_body_expands() {
    let load = "*CLOAD\nR, 1, 2.\n";
    let warm = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nNALL, 20.\n";
    let expanding = |model: &str, step: &str| {
        let deck = block(&format!("{model}{HELD}"), &format!("{step}{load}"));
        let deck = deck.replace(
            MATERIAL,
            &format!("{MATERIAL}*EXPANSION, ZERO=100.\n1E-3\n"),
        );
        // with full integration CalculiX takes a mean of the ends at midside nodes
        deck.replace("TYPE=CPE8,", "TYPE=CPE8R,")
    };
    let other = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nL, 20.\nR, 30.\n";
    for deck in [
        expanding("", ""),
        expanding(warm, ""),
        expanding(other, ""),
        expanding(warm, "*TEMPERATURE\nnall, 20.\n"),
        expanding("", "*TEMPERATURE\nNALL,\n"),
        expanding("*INITIAL CONDITIONS, TYPE=VELOCITY\nNALL, 1, 5.\n", ""),
        // nothing expands that the body is made of
        block(
            &format!("*MATERIAL, NAME=M2\n*EXPANSION\n1E-3\n{warm}{HELD}"),
            &format!("*TEMPERATURE\nNALL, 90.\n{load}"),
        )
        .replace("TYPE=CPE8,", "TYPE=CPE8R,"),
    ] {
        near(corner(&deck), [0.01529306, -0.004962850]);
    }
    let sides = "*TEMPERATURE\nNALL, 20.\nR, 90.\n";
    let ramp = "*AMPLITUDE, NAME=A\n0., 0., 1., .25\n";
    for (model, step, expected) in [
        (warm, sides, [0.01260489, 0.03594992]),
        ("", "*TEMPERATURE\nNALL, 20.\n", [0.06993394, 0.006976975]),
        (other, "*TEMPERATURE\nL, 20.\n", [0.01529306, -0.004962850]),
        (
            other,
            "*TEMPERATURE\nL, 20.\nR, 35.\n7, -5\n",
            [0.00976195, -0.001498414],
        ),
        (
            &format!("{ramp}{warm}"),
            "*TEMPERATURE, AMPLITUDE=A\nNALL, 20.\n",
            [-0.02568759, -0.01391772],
        ),
    ] {
        near(corner(&expanding(model, step)), expected);
    }
    for (model, step, got) in [
        (
            warm,
            "*TEMPERATURE, AMPLITUDE=A\nNALL, 20.\n",
            "the unknown amplitude `A`",
        ),
        (warm, "*TEMPERATURE, FILE=heat\n", "*TEMPERATURE with FILE"),
        (warm, "*TEMPERATURE\nNALL, warm\n", "`warm`"),
        (
            warm,
            "*TEMPERATURE\nNALL, 20,5\n",
            "`NALL, 20,5` for a temperature",
        ),
        (
            warm,
            "*TEMPERATURE\nNONE, 20.\n",
            "`NONE` for a temperature",
        ),
    ] {
        let found = refused(&expanding(model, step));
        assert!(
            found.len() == 1 && found[0].contains(got),
            "{got}: {found:?}"
        );
    }
    for (rows, got) in [
        ("", "the numbers of *EXPANSION"),
        (
            "1E-3, 20.\n2E-3, 90.\n",
            "an *EXPANSION that depends on temperature",
        ),
        ("1E-3, 2E-3, 3E-3\n", "the numbers of *EXPANSION"),
    ] {
        let deck = expanding(warm, sides).replace("1E-3\n", rows);
        let found = refused(&deck);
        assert!(found.len() == 1 && found[0].ends_with(got), "{found:?}");
    }
    let found = refused(&expanding(
        "*INITIAL CONDITIONS, TYPE=STRESS\nE, 5., 5., 0., 0.\n",
        "",
    ));
    assert!(
        found.len() == 1 && found[0].ends_with("TYPE=STRESS"),
        "{found:?}"
    );
}

/// A material turned by an orientation; displacements by CalculiX.
#[test]
fn an_orientation_turns_the_material() {
    let wood =
        "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n1000., 500., 700., .2, .25, .3, 300., 250.,\n200.";
    let turned = |lines: &str| {
        let deck = block(
            &format!("*ORIENTATION, NAME=O\n{lines}{HELD}"),
            "*CLOAD\nR, 1, 2.\n",
        );
        deck.replace("*ELASTIC\n1000., .3", wood)
            .replace("MATERIAL=M\n", "MATERIAL=M, ORIENTATION=O\n")
    };
    let expected = [0.01928585, -0.009027166];
    for lines in [
        "1., 1., 0., -1., 1., 0.\n",
        "1., 1., 0., 1., -1., 0.\n",
        "1., 0., 0., 0., 1., 0.\n3, 45.\n",
        "1., 0., 0., 0., -1., 0.\n3, -45.\n",
    ] {
        near(corner(&turned(lines)), expected);
    }
    let found = refused(&turned("0., 0., 1., 0., 1., 0.\n"));
    assert!(
        found.len() == 1 && found[0].contains("the orientation `O`"),
        "{found:?}"
    );
}

/// SPRING1 and *SPRING: springs between nodes and the ground, which add up where a node has several.
#[test]
fn springs_of_a_deck_are_those_of_its_nodes() {
    let springs =
        "*ELEMENT, TYPE=SPRING1, ELSET=S\n91, 5\n92, 13\n93, 13\n*SPRING, ELSET=S\n2,\n40.,\n";
    let deck = |springs: &str| block(&format!("{HELD}{springs}"), "*CLOAD\n13, 1, 2.\n");
    let found = problem(&deck(springs));
    let stiffness: Vec<(&str, f64)> = found
        .supports
        .iter()
        .filter_map(|s| Some((s.nodes.as_deref()?, s.stiffness?.y)))
        .collect();
    assert_eq!(
        stiffness,
        [
            ("S (springs along y, line 36)", 40.0),
            ("S (springs along y, line 36, 2 times)", 80.0)
        ]
    );
    let solution = {
        let external = files::external_mesh(&found, None);
        solver::solve_on(&found, external, &mut crate::support::quiet).unwrap()
    };
    assert!(solution.summary.residuals.equilibrium < 1e-11);
    // of the whole ring, unlike in CalculiX
    let ring = deck(springs).replace("CPE8", "CAX8");
    let (_, warnings) = abaqus::problem_with_warnings(&ring).unwrap();
    assert!(
        warnings
            .iter()
            .any(|w| w.message.contains("sector of two degrees")),
        "{warnings:?}"
    );
    for (from, to, got) in [
        (
            "*SPRING, ELSET=S\n2,\n40.,\n",
            "",
            "SPRING1 without *SPRING",
        ),
        ("2,\n40.", "3,\n40.", "`3,`: the direction of a spring"),
        ("2,\n40.", "1, 2\n40.", "`1, 2`: the direction of a spring"),
        ("40.,", "-40.,", "`-40.,` for a stiffness"),
        ("40.,", "40.,,20.\n50.,,100.", "depends on temperature"),
        ("40.,\n", "", "without its data lines"),
        ("ELSET=S\n2", "ELSET=E\n2", "*SPRING of `E`"),
        (
            "ELSET=S\n2",
            "ELSET=S, NONLINEAR\n2",
            "*SPRING with NONLINEAR",
        ),
        (
            "SPRING1, ELSET=S\n91, 5\n92, 13\n93, 13",
            "SPRINGA, ELSET=S\n91, 5, 13",
            "elements of type `SPRINGA`",
        ),
    ] {
        let found = refused(&deck(&springs.replace(from, to)));
        assert!(found.iter().any(|f| f.contains(got)), "{from}: {found:?}");
    }
}
