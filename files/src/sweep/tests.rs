#![allow(clippy::unwrap_used)]

use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Value, json, value::RawValue};
use solver::error::{Reason, Violation};
use solver::problem::MeshSource;

use super::*;
use crate::body::{Body, Embedded};

fn base() -> Value {
    json!({
        "title": "a",
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [0, 1, 2], "y": [-1, 0]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{
            "boundary": "top", "obstacle": {"kind": "circle", "radius": 8}, "indentation": 0.1,
            "friction": {"coefficient": 0.3, "nonlocal_radius": 0.01, "elastic_slip": 1e-4}
        }]
    })
}

const MU: &str = "/contacts/0/friction/coefficient";
const RHO: &str = "/contacts/0/friction/nonlocal_radius";

#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Definition {
    #[serde(rename = "base")]
    _base: Embedded,
    #[serde(default)]
    mode: Option<Mode>,
    #[serde(default)]
    axes: Option<Vec<Axis>>,
    #[serde(default)]
    #[schemars(with = "Option<Points>")]
    points: Option<Vec<Box<RawValue>>>,
}

static DEFINITION: Body<Definition> = Body::new();

fn reading(definition: &Value) -> Result<Sweep, Vec<Violation>> {
    reading_text(&definition.to_string())
}

fn reading_text(text: &str) -> Result<Sweep, Vec<Violation>> {
    let members = |Definition {
                       mode, axes, points, ..
                   }| Variation { mode, axes, points };
    let mut content = DEFINITION.read(text).unwrap();
    let members = content.fields.take().map(members);
    of_body(content.with(members))
}

fn refused(definition: &Value) -> Vec<(String, Reason)> {
    let found = match reading(definition) {
        Ok(sweep) => groups(&sweep).unwrap_err(),
        Err(found) => found,
    };
    found.into_iter().map(|v| (v.pointer, v.reason)).collect()
}

fn at(pointer: &str, reason: Reason) -> Vec<(String, Reason)> {
    vec![(pointer.to_owned(), reason)]
}

#[test]
fn a_grid_has_every_combination_and_its_last_axis_is_the_fastest() {
    let definition = json!({"base": base(), "axes": [
        {"path": MU, "values": [0.1, 0.2]},
        {"path": RHO, "linspace": {"start": 0.01, "stop": 0.03, "count": 3}},
    ]});
    let Sweep { plan, .. } = reading(&definition).unwrap();
    assert_eq!(
        (plan.count(), plan.paths()),
        (6, &[MU.to_owned(), RHO.to_owned()][..])
    );
    let all: Vec<String> = (0..6)
        .map(|n| {
            plan.values(n)
                .into_iter()
                .flatten()
                .collect::<Vec<_>>()
                .join(" ")
        })
        .collect();
    assert_eq!(
        all,
        [
            "0.1 0.01", "0.1 0.02", "0.1 0.03", "0.2 0.01", "0.2 0.02", "0.2 0.03"
        ]
    );
    for number in 0..6 {
        let friction = plan
            .problem(number)
            .unwrap()
            .contacts
            .remove(0)
            .friction
            .unwrap();
        let mut expected = base();
        *expected.pointer_mut(MU).unwrap() =
            serde_json::from_str(plan.values(number)[0].unwrap()).unwrap();
        *expected.pointer_mut(RHO).unwrap() =
            serde_json::from_str(plan.values(number)[1].unwrap()).unwrap();
        let expected = crate::parse(&expected.to_string()).unwrap();
        assert_eq!(friction, expected.contacts[0].friction.clone().unwrap());
        assert_eq!(
            plan.whole_problem(number, &expected.mesh).unwrap(),
            expected
        );
    }
}

#[test]
fn a_zip_takes_the_values_of_all_axes_together_and_a_list_its_points() {
    let axes = json!([{"path": MU, "values": [0.1, 0.2]}, {"path": RHO, "values": [1, 2]}]);
    let zip = json!({"base": base(), "mode": "zip", "axes": axes});
    let plan = reading(&zip).unwrap().plan;
    assert_eq!(plan.count(), 2);
    assert_eq!(plan.values(1), [Some("0.2"), Some("2")]);
    let list =
        json!({"base": base(), "mode": "list", "points": [{MU: 0.1}, {RHO: 2, MU: 0.4}, {}]});
    let plan = reading(&list).unwrap().plan;
    let values: Vec<_> = (0..3).map(|n| plan.values(n)).collect();
    assert_eq!(
        values,
        [
            vec![Some("0.1"), None],
            vec![Some("0.4"), Some("2")],
            vec![None, None]
        ]
    );
    assert_eq!(
        plan.problem(2).unwrap().contacts,
        crate::parse(&base().to_string()).unwrap().contacts
    );
}

#[test]
fn spaced_values_have_both_ends_exactly() {
    let axis = |axis: Value| {
        let definition = json!({"base": base(), "axes": [axis]});
        let plan = reading(&definition).unwrap().plan;
        let all = (0..plan.count()).map(|n| plan.values(n)[0].unwrap().parse().unwrap());
        all.collect::<Vec<f64>>()
    };
    let lines = axis(json!({"path": MU, "linspace": {"start": 0.1, "stop": 0.7, "count": 7}}));
    assert_eq!((lines[0], lines[6], lines.len()), (0.1, 0.7, 7));
    assert!((lines[3] - 0.4).abs() < 1e-15);
    let ratios = axis(json!({"path": RHO, "logspace": {"start": 1e-3, "stop": 10, "count": 5}}));
    assert_eq!((ratios[0], ratios[4]), (1e-3, 10.0));
    assert!((ratios[2] - 0.1).abs() < 1e-15);
    assert_eq!(
        axis(json!({"path": MU, "linspace": {"start": 0.2, "stop": 9, "count": 1}})),
        [0.2]
    );
    // whole numbers may be counts
    let counts = json!({"base": base(), "axes": [
        {"path": "/solver/max_iterations", "linspace": {"start": 10, "stop": 30, "count": 3}}]});
    assert_eq!(
        refused(&counts),
        at("/axes/0/path", Reason::UnknownName),
        "/solver is not in the base"
    );
    let counts = json!({"base": base(), "axes": [
        {"path": "/quadrature", "linspace": {"start": 2, "stop": 3, "count": 2}}]});
    assert_eq!(
        reading(&counts)
            .unwrap()
            .plan
            .problem(0)
            .unwrap()
            .quadrature,
        2
    );
}

#[test]
fn a_value_may_be_a_whole_part_of_the_problem_and_one_that_the_base_lacks() {
    let definition = json!({"base": base(), "mode": "zip", "axes": [
        {"path": "/contacts/0/obstacle", "values": [{"kind": "flat"}, {"kind": "parabola", "radius": 3}]},
        {"path": "/steps", "values": [[{"increments": 2}], []]},
        {"path": "/quadrature", "values": [2, 3]},
        {"path": "/contacts/0/tangential_displacement", "values": [0.5, 1]},
    ]});
    let plan = reading(&definition).unwrap().plan;
    let first = plan.problem(0).unwrap();
    assert_eq!((first.steps.len(), first.quadrature), (1, 2));
    assert_eq!(first.contacts[0].tangential_displacement, 0.5);
    assert!(matches!(
        first.contacts[0].obstacle,
        Some(solver::problem::Obstacle::Flat { .. })
    ));
    assert_eq!(plan.problem(1).unwrap().quadrature, 3);
}

#[test]
fn the_mesh_is_in_the_text_of_members_only_if_it_is_swept() {
    let shared =
        reading(&json!({"base": base(), "axes": [{"path": MU, "values": [0.1]}]})).unwrap();
    assert!(!shared.plan.changes_mesh());
    assert_eq!(
        shared.plan.problem(0).unwrap().mesh.source,
        MeshSource::Gmsh(String::new())
    );
    assert_eq!(
        shared
            .plan
            .whole_problem(0, &shared.base.mesh)
            .unwrap()
            .mesh,
        shared.base.mesh
    );
    let own = json!({"base": base(), "axes": [{"path": "/mesh/refine", "values": [0, 1]}]});
    let own = reading(&own).unwrap();
    assert!(own.plan.changes_mesh());
    assert_eq!(groups(&own).unwrap(), [[0], [1]]);
}

#[test]
fn members_that_share_a_body_are_one_group() {
    let definition = json!({"base": base(), "axes": [
        {"path": "/materials/0/youngs_modulus", "values": [1000, 2000]},
        {"path": MU, "values": [0.1, 0.2, 0.3]},
        {"path": "/contacts/0/indentation", "values": [0.1, 0.2]},
    ]});
    let sweep = reading(&definition).unwrap();
    assert_eq!(
        groups(&sweep).unwrap(),
        [[0, 1, 2, 3, 4, 5], [6, 7, 8, 9, 10, 11]]
    );
    let verified = json!({"base": base(), "axes": [
        {"path": "/solver", "values": [{"accuracy": "verify"}, {}, {"accuracy": "verify"}, {"tolerance": 1e-8}]}]});
    assert_eq!(
        groups(&reading(&verified).unwrap()).unwrap(),
        [vec![0], vec![1, 3], vec![2]]
    );
}

#[test]
fn all_violations_are_reported_at_once_with_their_places() {
    let mut broken = base();
    broken["materials"][0]["poisons_ratio"] = json!(0.3);
    let places = |found: Vec<(String, Reason)>, expected: &[(&str, Reason)]| {
        let found: Vec<_> = found
            .iter()
            .map(|(at, reason)| (&at[..], *reason))
            .collect();
        assert_eq!(found, expected);
    };
    // first all of the structure …
    let found = refused(&json!({"base": broken, "mode": "grit", "axes": [
        {"path": MU, "values": [1], "step": 2},
        {"values": [1]},
        7,
        {"path": RHO, "linspace": [0, 1, 2]},
        {"path": RHO, "logspace": {"start": "a", "stop": 2}},
    ], "points": [7]}));
    let expected = [
        ("/axes/0/step", Reason::UnknownName),
        ("/axes/1/path", Reason::Missing),
        ("/axes/2", Reason::WrongType),
        ("/axes/3/linspace", Reason::WrongType),
        ("/axes/4/logspace/start", Reason::WrongType),
        ("/axes/4/logspace/count", Reason::Missing),
        ("/mode", Reason::UnknownAlternative),
        ("/points/0", Reason::WrongType),
        ("/base/materials/0/poisons_ratio", Reason::UnknownName),
    ];
    places(found, &expected);
    // … then all of what it means
    let mut broken = base();
    broken["materials"][0]["poisons_ratio"] = json!(0.3);
    let found = refused(&json!({"base": broken, "points": [], "axes": [
        {"path": "contacts", "values": []},
        {"path": MU, "values": [1], "linspace": {"start": 0, "stop": 1, "count": 2}},
        {"path": "/contacts/1/indentation", "logspace": {"start": 0, "stop": 1, "count": 0}},
    ]}));
    let expected = [
        ("/base/materials/0/poisons_ratio", Reason::UnknownName),
        ("/points", Reason::NotUsed),
        ("/axes/0/path", Reason::Malformed),
        ("/axes/0/values", Reason::TooFew),
        ("/axes/1", Reason::WrongCount),
        ("/axes/2/logspace/count", Reason::OutOfRange),
        ("/axes/2/logspace/start", Reason::OutOfRange),
    ];
    places(found, &expected);
}

#[test]
fn a_pointer_leads_to_a_part_of_the_base_and_none_into_another() {
    let axes = |paths: &[&str]| {
        let axes: Vec<Value> = paths
            .iter()
            .map(|path| json!({"path": path, "values": [1]}))
            .collect();
        refused(&json!({"base": base(), "axes": axes}))
    };
    for nowhere in [
        "/contacts/1/indentation",
        "/contacts/00/indentation",
        "/solver/tolerance",
        "/title/x",
        "/contacts/-",
    ] {
        assert_eq!(
            axes(&[nowhere]),
            at("/axes/0/path", Reason::UnknownName),
            "{nowhere}"
        );
    }
    for malformed in ["", "title", "/a~", "/a~2"] {
        assert_eq!(
            axes(&[malformed]),
            at("/axes/0/path", Reason::Malformed),
            "{malformed}"
        );
    }
    assert_eq!(axes(&[MU, MU]), at("/axes/1/path", Reason::DuplicateName));
    assert_eq!(
        axes(&[MU, "/contacts/0/friction"]),
        at("/axes/1/path", Reason::Conflict)
    );
    let slash = json!({"base": base(), "axes": [{"path": "/a~1b", "values": [1]}]});
    assert_eq!(refused(&slash), at("/axes/0/path", Reason::UnknownName));
}

#[test]
fn a_violation_of_a_member_names_the_value_that_causes_it() {
    let definition = json!({"base": base(), "axes": [
        {"path": MU, "values": [0.1, "much", 0.3, -1]},
        {"path": RHO, "values": [0.01, 0.02, null]},
    ]});
    let found = refused(&definition);
    let expected = [
        ("/axes/1/values/2", Reason::Missing),
        ("/axes/0/values/1", Reason::WrongType),
        ("/axes/0/values/3", Reason::OutOfRange),
    ];
    for (at, _) in expected {
        assert!(
            found.iter().any(|(place, _)| place == at),
            "{at}: {found:?}"
        );
    }
    assert_eq!(found.len(), 3, "each once: {found:?}");
    let list = json!({"base": base(), "mode": "list", "points": [{MU: 0.1}, {"/contacts/0/obstacle": {"kind": "circle"}}]});
    assert_eq!(
        refused(&list),
        at("/points/1/~1contacts~10~1obstacle/radius", Reason::Missing)
    );
    let text = json!({"base": base(), "axes": [{"path": "/quadrature", "values": ["huge"]}]});
    let text = text.to_string().replace("\"huge\"", "1e999");
    let found = reading_text(&text).unwrap_err();
    assert_eq!(found[0].reason, Reason::NotFinite);
}

#[test]
fn of_many_invalid_members_some_are_reported() {
    let values: Vec<i32> = (1..=200).map(|n| -n).collect();
    let sweep =
        reading(&json!({"base": base(), "axes": [{"path": MU, "values": values}]})).unwrap();
    let found = groups(&sweep).unwrap_err();
    assert_eq!(found.len(), MOST_TOLD);
    assert!(
        found[MOST_TOLD - 1]
            .hint
            .contains("150 members were not checked"),
        "{}",
        found[MOST_TOLD - 1].hint
    );
}

#[test]
fn a_sweep_has_limits() {
    let axis = |path: &str, count: usize| json!({"path": path, "linspace": {"start": 0.1, "stop": 0.2, "count": count}});
    let grid = |axes: Value| refused(&json!({"base": base(), "axes": axes}));
    assert_eq!(
        grid(json!([axis(MU, 101), axis(RHO, 100)])),
        at("/axes", Reason::TooMany)
    );
    assert_eq!(
        grid(json!([axis(MU, 10_001)])),
        at("/axes/0/linspace/count", Reason::OutOfRange)
    );
    let values: Vec<u32> = (0..10_001).collect();
    assert_eq!(
        grid(json!([{"path": MU, "values": values}])),
        at("/axes/0/values", Reason::TooMany)
    );
    let points: Vec<Value> = (0..10_001).map(|_| json!({MU: 1})).collect();
    let list = json!({"base": base(), "mode": "list", "points": points});
    assert_eq!(refused(&list), at("/points", Reason::TooMany));
    assert_eq!(grid(json!([])), at("/axes", Reason::TooFew));
    let mut wordy = base();
    wordy["title"] = json!("x".repeat(100_000));
    let wordy = json!({"base": wordy, "axes": [axis(MU, 1000)]});
    assert_eq!(refused(&wordy), at("/axes", Reason::TooLarge));
    let long: Vec<f64> = (0..2000).map(f64::from).collect();
    let table = json!({"kind": "table", "x": long, "gap": long});
    let tables = grid(json!([axis(MU, 1000), {"path": "/contacts/0/obstacle", "values": [table]}]));
    assert_eq!(tables, at("/axes", Reason::TooLarge));
    let short = json!({"base": base(), "mode": "zip", "axes": [axis(MU, 3), axis(RHO, 2)]});
    assert_eq!(refused(&short), at("/axes/1", Reason::WrongLength));
    // a deep value is refused as a deep problem is
    let deep = format!("{}1{}", "[".repeat(62), "]".repeat(62));
    let deep: Value = serde_json::from_str(&deep).unwrap();
    let axes = json!([{"path": "/contacts/0/obstacle/radius", "values": [deep]}]);
    let text = base().to_string();
    let variation = Variation {
        axes: serde_json::from_value(axes).unwrap(),
        ..Variation::default()
    };
    let found = groups(&read(&text, variation).unwrap()).unwrap_err();
    assert_eq!(found.len(), 1, "{found:?}");
}

#[test]
fn a_plan_is_stored_as_json() {
    let definition =
        json!({"base": base(), "mode": "list", "points": [{MU: 0.1}, {"/quadrature": 2}]});
    let plan = reading(&definition).unwrap().plan;
    let text = serde_json::to_string(&plan).unwrap();
    assert_eq!(serde_json::from_str::<Plan>(&text).unwrap(), plan);
}

#[test]
fn problems_read_one_after_another_equal_their_texts() {
    let mut base = base();
    base["contacts"][0]["tangential_displacement"] = json!(0.01);
    let two = |path: &str, values: Value| json!({"path": path, "values": values});
    let names = "/contacts/0/friction/transition";
    let definitions = [
        json!({"base": base, "axes": [
            two(RHO, json!([0.01, 2e-2])), two(MU, json!([1, 0])), two("/contacts/0/indentation", json!([0.1, -0.2])),
            two("/contacts/0/tangential_displacement", json!([0, 0.5]))]}),
        // those that the base lacks, and those that are no numbers
        json!({"base": base, "axes": [
            two(names, json!(["linear", "tanh"])), two("/contacts/0/friction/shear_cap", json!([5, 7])),
            two("/materials/0/youngs_modulus", json!([1000, 2000])), two("/contacts/0/friction/cohesion", json!([0, 2]))]}),
        json!({"base": base, "mode": "list", "points": [{MU: 0.1}, {RHO: 0.2}, {MU: 0.2, RHO: 0.3}]}),
        json!({"base": base, "mode": "zip", "axes": [
            two(MU, json!([0.1, 0.2, 0.3])), two("/contacts/0/friction/elastic_slip", json!([1e-4, 2e-4, 3e-4]))]}),
    ];
    for definition in definitions {
        let Sweep { plan, .. } = reading(&definition).unwrap();
        let mut problems = Problems::new(&plan);
        for number in (0..plan.count()).chain([0]) {
            let read = problems.read(number).map(|read| read.problem.clone());
            assert_eq!(read, plan.problem(number), "{number} of {definition}");
        }
    }
}

#[test]
fn a_member_of_a_grid_begins_from_one_that_differs_by_one_place_of_one_axis() {
    let radius = "/contacts/0/obstacle/radius";
    let definition = json!({"base": base(), "axes": [
        {"path": MU, "values": [0.1, 0.2, 0.3]},
        {"path": "/materials/0/poissons_ratio", "values": [0.2, 0.3]},
        {"path": RHO, "values": [0.01, 0.02, 0.03]},
    ]});
    let sweep = reading(&definition).unwrap();
    let plan = &sweep.plan;
    let groups = groups(&sweep).unwrap();
    assert_eq!(groups.len(), 2);
    for group in &groups {
        let mut lines: Vec<Option<usize>> = vec![None; plan.lines()];
        assert_eq!(plan.neighbour(group, 0), None);
        lines[0] = group.first().copied();
        for (place, number) in group.iter().enumerate().skip(1) {
            let found = plan.neighbour(group, place).unwrap();
            // the last one of a line is all that is needed
            assert!(lines.contains(&Some(found.number)), "{number}: {found:?}");
            assert_eq!(found.adjacent, group[place - 1] == found.number);
            lines[found.line] = Some(*number);
            let (a, b) = (plan.values(*number), plan.values(found.number));
            assert_eq!(a.iter().zip(&b).filter(|(a, b)| a != b).count(), 1);
        }
    }
    let list: Vec<Value> = (1..=130)
        .map(|k| json!({MU: 1e-3 * f64::from(k), radius: 8}))
        .collect();
    let sweep = reading(&json!({"base": base(), "mode": "list", "points": list})).unwrap();
    let group: Group = (0..130).collect();
    let from = |place: usize| sweep.plan.neighbour(&group, place).map(|n| n.number);
    assert_eq!(
        [0, 1, 63, 64, 65, 128].map(from),
        [None, Some(0), Some(62), Some(0), Some(64), Some(0)]
    );
    let long = json!([{"path": MU, "linspace": {"start": 0.1, "stop": 0.5, "count": 130}}]);
    let sweep = reading(&json!({"base": base(), "axes": long})).unwrap();
    let from = |place: usize| sweep.plan.neighbour(&group, place).map(|n| n.number);
    assert_eq!([1, 64, 65, 128].map(from), [0, 0, 64, 0].map(Some));
}

#[test]
fn members_that_share_a_body_are_divided_where_a_line_begins_and_the_plan_knows_their_group() {
    let definition = json!({"base": base(), "axes": [
        {"path": MU, "linspace": {"start": 0.1, "stop": 0.5, "count": 41}},
        {"path": RHO, "linspace": {"start": 0.01, "stop": 0.03, "count": 40}},
    ]});
    let mut plan = reading(&definition).unwrap().plan;
    let group: Group = (0..1640).collect();
    let small: Group = vec![7];
    let pieces = plan.divide(vec![small.clone(), group.clone()], 20);
    // 1640 are three times 500, and the thirds are in the middle of lines of 40
    let ends = pieces.iter().map(|piece| (piece[0], piece.len()));
    let ends: Vec<(usize, usize)> = ends.collect();
    assert_eq!(ends, [(7, 1), (0, 560), (560, 560), (1120, 520)]);
    assert_eq!(plan.divided(1120), Some(&group));
    let read: Plan = serde_json::from_str(&serde_json::to_string(&plan).unwrap()).unwrap();
    assert_eq!(read, plan);
    assert_eq!(read.divided(5000), None);
    assert_eq!(plan.divide(vec![group.clone()], 0), [group]);
}

/// A pointer of megabytes with millions of names is refused by its length before it is divided into them.
#[test]
fn a_pointer_of_megabytes_is_refused_by_its_length() {
    let swept = |path: &str| {
        let definition = json!({"base": base(), "axes": [{"path": path, "values": [1]}]});
        refused(&definition)
    };
    for text in ["/a".repeat(1 << 20), "/".repeat(1 << 20), "/~1".repeat(400)] {
        assert_eq!(swept(&text), at("/axes/0/path", Reason::TooLong));
    }
    // too many names, and as many as there may be
    assert_eq!(
        swept(&"/a".repeat(MOST_POINTER_TOKENS + 1)),
        at("/axes/0/path", Reason::TooLong)
    );
    assert_eq!(
        swept(&"/a".repeat(MOST_POINTER_TOKENS)),
        at("/axes/0/path", Reason::UnknownName)
    );
    let point = json!({ "/a".repeat(1 << 20): 1 });
    let definition = json!({"base": base(), "mode": "list", "points": [point]});
    let found = refused(&definition);
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].1, Reason::TooLong);
}
