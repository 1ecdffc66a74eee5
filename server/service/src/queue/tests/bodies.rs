//! Tests of jobs on kept bodies: when a body is reused, and that reuse changes no bit of a result.

use std::panic::{AssertUnwindSafe, catch_unwind};

use base::{
    memory::{Allowance, Meter},
    run::{Summary, members::is_alone},
};
use serde_json::{Value, json};
use solver::solution::Phase;

use super::*;
use crate::queue::{
    ending::NoSolution,
    solving::{prepare, solve_task},
};

const MIB: u64 = 1 << 20;

fn budget() -> Arc<Budget> {
    Budget::new(1 << 40, 2, 100 * MIB)
}

/// A problem of a sheet of two materials with everything that a body may depend on, and most of what it does not.
fn sheet() -> Value {
    json!({
        "title": "sheet",
        "units": {"length": "mm"},
        "analysis": {"kind": "plane_stress", "thickness": 2},
        "mesh": {
            "grid": {"x": [0, 0.5, 1, 1.5, 2], "y": [-1, -0.5, 0]},
            "groups": {"stiff": {"x": [0, 1], "y": [-1, -0.5]}},
            "boundaries": {"part": {"side": "top", "x": [0.5, 2]}},
        },
        "materials": [
            {"youngs_modulus": 1000, "poissons_ratio": 0.3, "name": "soft"},
            {"youngs_modulus": 3000, "poissons_ratio": 0.2, "group": "stiff"},
        ],
        "supports": [
            {"boundary": "bottom", "ux": 0.001, "uy": [0, 0.002]},
            {"boundary": "left", "ux": 0.001},
        ],
        "loads": [
            {"boundary": "right", "pressure": 3},
            {"body_force": [0.5, -1]},
        ],
        "contacts": [{
            "boundary": "part",
            "obstacle": {"kind": "circle", "radius": 8, "center": 1.2, "from": 0, "to": 2},
            "indentation": 0.05,
            "tangential_displacement": 0.01,
            "friction": {"coefficient": 0.3, "nonlocal_radius": 0.2, "elastic_slip": 1e-4},
        }],
        "steps": [
            {"name": "press", "tangential_displacement": 0.1},
            {"increments": 2, "loads": 0.7, "supports": 1.1},
        ],
        "quadrature": 3,
        "solver": {},
    })
}

/// A problem of a nearly incompressible body of revolution whose contact uses the normals of the obstacle.
fn ring() -> Value {
    json!({
        "analysis": {"kind": "axisymmetric"},
        "mesh": {"grid": {"x": [0, 0.5, 1, 1.5], "y": [-1, 0]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.499}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{
            "boundary": "top",
            "normal": "obstacle",
            "obstacle": {"kind": "parabola", "radius": 8},
            "indentation": 0.05,
        }],
    })
}

/// Every place in a value, by its pointer, with other values for it; None: the value is removed.
fn changes(value: &Value, pointer: &str, found: &mut Vec<(String, Option<Value>)>) {
    const WORDS: &[&str] = &[
        "plane_strain",
        "body",
        "obstacle",
        "unilateral",
        "bonded",
        "x",
        "y",
        "arc_length",
        "top",
        "right",
        "part",
        "parabola",
        "auto",
        "fixed_point",
        "newton",
        "verify",
        "other",
        "contact_width",
        "nodes",
        "exponential",
    ];
    let mut with = |value: Value| found.push((pointer.to_owned(), Some(value)));
    match value {
        Value::Null => {}
        Value::Bool(value) => with(json!(!value)),
        Value::Number(number) => {
            if let Some(whole) = number.as_u64() {
                with(json!(whole + 1));
            }
            if let Some(number) = number.as_f64() {
                with(json!(number + 0.001));
                // the last bit counts
                with(json!(f64::from_bits(number.to_bits() + 1)));
            }
        }
        Value::String(text) => {
            let others = WORDS.iter().filter(|word| *word != text);
            others.for_each(|word| with(json!(word)));
        }
        Value::Array(items) => {
            for (k, item) in items.iter().enumerate() {
                changes(item, &format!("{pointer}/{k}"), found);
                found.push((format!("{pointer}/{k}"), None));
            }
        }
        Value::Object(fields) => {
            for (name, field) in fields {
                changes(field, &format!("{pointer}/{name}"), found);
                found.push((format!("{pointer}/{name}"), None));
            }
        }
    }
}

fn changed(problem: &Value, pointer: &str, value: Option<Value>) -> Value {
    let mut problem = problem.clone();
    if let Some(value) = value {
        *problem.pointer_mut(pointer).unwrap() = value;
        return problem;
    }
    let (parent, last) = pointer.rsplit_once('/').unwrap();
    match problem.pointer_mut(parent).unwrap() {
        Value::Array(items) => drop(items.remove(last.parse().unwrap())),
        Value::Object(fields) => drop(fields.remove(last)),
        _ => unreachable!("only these have parts"),
    }
    problem
}

/// The effect of a change on the body.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Body {
    Same,
    Other,
    /// It depends on the mesh: two ranges may have the same sides, and two obstacles face the same nodes.
    Either,
}

fn expected(pointer: &str, problem: &Problem) -> Body {
    let turned = problem
        .contacts
        .iter()
        .any(|contact| contact.normal == Some(solver::problem::NormalOf::Obstacle));
    let parts: Vec<&str> = pointer.split('/').skip(1).collect();
    match parts[..] {
        ["title" | "units" | "steps" | "solver", ..] => Body::Same,
        ["materials", _, "name"] => Body::Same,
        ["mesh", "groups" | "boundaries", ..] => Body::Either,
        [
            "contacts",
            _,
            "indentation" | "tangential_displacement" | "friction" | "condition",
            ..,
        ] => Body::Same,
        ["contacts", _, "obstacle", "radius"] if turned => Body::Other,
        ["contacts", _, "obstacle", ..] => Body::Either,
        _ => Body::Other,
    }
}

/// Solves a problem with the kept bodies; its summary, or why there is none.
fn solved(problem: &Value, budget: Option<&Budget>) -> Result<Summary, String> {
    let allowance = Allowance {
        share: u64::MAX,
        bodies: budget,
    };
    let solved = solve_task(
        &problem.to_string(),
        None,
        None,
        solver::solve_on,
        allowance,
        &mut looking(|_| false),
    );
    let solved = solved.map_err(|error| format!("{error:?}"))?;
    let mut parts = solved.parts.into_parts();
    let summary = parts.find(|part| part.name() == "summary").unwrap();
    Ok(serde_json::from_slice(&summary.json()).unwrap())
}

#[test]
fn every_change_of_a_problem_finds_the_body_or_not_and_has_the_result_of_its_own() {
    for base in [sheet(), ring()] {
        // with all defaults
        let unchanged: Problem = files::parse(&base.to_string()).unwrap();
        let base = serde_json::to_value(&unchanged).unwrap();
        let mut all = vec![];
        changes(&base, "", &mut all);
        let (mut hits, mut misses) = (0, 0);
        for (pointer, value) in all {
            let problem = changed(&base, &pointer, value.clone());
            let Ok(parsed) = files::parse(&problem.to_string()) else {
                continue;
            };
            let alone = solved(&problem, None);
            if matches!(&alone, Err(error) if error.contains("Invalid")) {
                continue;
            }
            let budget = budget();
            assert!(!solved(&base, Some(&budget)).unwrap().body_reused);
            let kept = solved(&problem, Some(&budget));
            let digests = [&alone, &kept].map(|one| one.as_ref().map(|summary| &summary.digest));
            assert_eq!(digests[0], digests[1], "{pointer} {value:?}");
            let Ok(kept) = kept else { continue };
            let timings =
                ["assemble", "order", "factor", "condense"].map(|phase| kept.timings[phase]);
            assert_eq!(
                kept.body_reused,
                timings == [0.0; 4],
                "{pointer} {value:?}: {timings:?}"
            );
            let expected = match (is_alone(&parsed), parsed == unchanged) {
                (true, _) => Body::Other,
                // such as a default that is left out
                (false, true) => Body::Same,
                (false, false) => expected(&pointer, &parsed),
            };
            match expected {
                Body::Same => assert!(kept.body_reused, "{pointer} {value:?}"),
                Body::Other => assert!(!kept.body_reused, "{pointer} {value:?}"),
                Body::Either => {}
            }
            if kept.body_reused {
                hits += 1
            } else {
                misses += 1
            }
            let figures = budget.body_cache();
            assert_eq!(figures.hits, u64::from(kept.body_reused), "{pointer}");
        }
        println!("{hits} hits, {misses} misses");
        assert!(hits >= 15 && misses >= 15, "{hits} hits, {misses} misses");
    }
}

/// Solves a problem until its solver reports this phase; then runs the action, which answers whether to stop.
fn until(phase: Phase, budget: &Budget, mut then: impl FnMut() -> bool) -> Result<(), NoSolution> {
    let allowance = Allowance {
        share: u64::MAX,
        bodies: Some(budget),
    };
    let supervisor = &mut looking(|event| {
        matches!(event, Payload::Stage { stage } if *stage == phase) && then()
    });
    let text = sheet().to_string();
    solve_task(&text, None, None, solver::solve_on, allowance, supervisor).map(|_| ())
}

#[test]
fn a_preparation_that_is_stopped_or_panics_leaves_nothing_behind() {
    let alone = solved(&sheet(), None).unwrap();
    for phase in [Phase::Mesh, Phase::Assemble, Phase::Factor, Phase::Condense] {
        let budget = budget();
        let stopped = until(phase, &budget, || true);
        assert!(matches!(stopped, Err(NoSolution::Stopped)), "{phase:?}");
        let panicked = catch_unwind(AssertUnwindSafe(|| {
            until(phase, &budget, || panic!("the test wants it"))
        }));
        assert!(panicked.is_err());
        let figures = budget.body_cache();
        assert_eq!((figures.bodies, figures.bytes, figures.hits), (0, 0, 0));
        // and nothing is in the way of the next ones
        for reused in [false, true] {
            let next = solved(&sheet(), Some(&budget)).unwrap();
            assert_eq!((next.body_reused, &next.digest), (reused, &alone.digest));
        }
    }
}

#[test]
fn the_body_of_a_job_that_is_canceled_in_its_iterations_is_kept() {
    let budget = budget();
    let _ = until(Phase::Iterate, &budget, || true);
    assert!(solved(&sheet(), Some(&budget)).unwrap().body_reused);
}

/// A problem that is solved within a second and whose body takes nearly all of its memory.
fn block(lines: usize) -> Value {
    let mut block = sheet();
    let places =
        |end: f64| -> Vec<f64> { (0..=lines).map(|k| k as f64 / lines as f64 * end).collect() };
    let y: Vec<f64> = places(1.0).iter().map(|y| y - 1.0).collect();
    block["mesh"] = json!({"grid": {"x": places(2.0), "y": y}});
    block["materials"] = json!([{"youngs_modulus": 1000, "poissons_ratio": 0.3}]);
    block["contacts"][0]["boundary"] = json!("top");
    block
}

/// Runs work on a thread of its own, as jobs are.
fn elsewhere<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| scope.spawn(work).join().unwrap())
}

/// The memory of a thread that has prepared a problem, and that of the body (bytes).
fn prepared(problem: &Value, budget: &Budget) -> (u64, u64) {
    elsewhere(|| {
        let problem = files::parse(&problem.to_string()).unwrap();
        let meter = Meter::new(u64::MAX);
        let prepared = prepare(&problem, None, Some(budget), &meter, &mut ()).unwrap();
        let used = meter.used();
        drop(prepared);
        (used, budget.body_cache().bytes)
    })
}

#[test]
fn a_job_is_charged_for_its_body_whoever_has_made_it() {
    let budget = budget();
    // the first one also makes what all share for the life of the process
    solved(&block(4), None).unwrap();
    let (made, bytes) = prepared(&block(40), &budget);
    let (found, _) = prepared(&block(40), &budget);
    assert_eq!(budget.body_cache().hits, 1);
    // the factor of 9,922 unknowns, and Ŝ of the 162 on the contact
    assert!(bytes > 4 * MIB && made > bytes, "{bytes} of {made}");
    assert!(made.abs_diff(found) < 64 << 10, "{made} and {found}");
}

#[test]
fn a_job_has_no_more_memory_after_it_freed_the_body_of_another() {
    let mut other = block(40);
    other["materials"][0]["youngs_modulus"] = json!(2000);
    let whole = budget();
    solved(&block(4), None).unwrap();
    let (_, bytes) = prepared(&other, &whole);
    let (alone, both) = prepared(&block(40), &whole);
    assert!(both > bytes);
    // room for one
    let tight = Budget::new(1 << 40, 2, both - bytes / 2);
    prepared(&other, &tight);
    let (evicting, _) = prepared(&block(40), &tight);
    assert_eq!(tight.body_cache().evictions, 1);
    assert!(
        alone.abs_diff(evicting) < 64 << 10,
        "{alone} and {evicting}"
    );
}

/// The smallest share of memory within which a problem is solved, to 64 KiB.
fn least_share(problem: &Value, bodies: impl Fn() -> Option<Arc<Budget>> + Sync) -> u64 {
    let text = problem.to_string();
    let fits = |share| {
        elsewhere(|| {
            let budget = bodies();
            let allowance = Allowance {
                share,
                bodies: budget.as_deref(),
            };
            let supervisor = &mut looking(|_| false);
            let solved = solve_task(&text, None, None, solver::solve_on, allowance, supervisor);
            match solved {
                Ok(solved) => solved.ending.status == Status::Succeeded,
                Err(NoSolution::OutOfMemory(_)) => false,
                Err(error) => panic!("{error:?}"),
            }
        })
    };
    let (mut none, mut enough) = (0, 1 << 30);
    while enough - none > 64 << 10 {
        let middle = (none + enough) / 2;
        if fits(middle) {
            enough = middle
        } else {
            none = middle
        }
    }
    enough
}

/// A job that keeps its body, or finds it kept, needs no more memory than on its own, so that its estimate is valid in
/// all cases.
#[test]
fn a_job_that_keeps_its_body_or_finds_it_needs_no_more_than_on_its_own() {
    let problem = block(40);
    // the first one also makes what all share for the life of the process
    solved(&problem, None).unwrap();
    let alone = least_share(&problem, || None);
    let keeps = least_share(&problem, || Some(budget()));
    let full = budget();
    let (_, bytes) = prepared(&problem, &full);
    let finds = least_share(&problem, || Some(full.clone()));
    println!("alone {alone}, keeps {keeps}, finds {finds}, body {bytes}");
    assert!(finds > bytes, "its body is a part of what it uses");
    // but for the copy of the model that is kept with the body, and for 4 MiB of scratch space: its first factorisation leaves
    // them to a thread, and they are counted with the body
    let (copy, scratch) = (1 << 20, 4 << 20);
    assert!(
        keeps <= alone + copy && finds <= alone + copy + scratch,
        "alone {alone}, keeps {keeps}, finds {finds}"
    );
}

#[tokio::test]
async fn jobs_of_a_queue_share_a_body_until_another_needs_the_room() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    store.set_budget(Budget::new(100 * MIB, 2, 50 * MIB));
    let queue = Queue::new(store.clone(), Solver::Threads(solver::solve_on), 2);
    queue.start();
    let rig = Rig {
        store,
        queue,
        folder,
    };
    let submit = async |coefficient: f64, mib: u64| {
        let mut problem = block(20);
        problem["contacts"][0]["friction"]["coefficient"] = json!(coefficient);
        let new = NewJob {
            input_hash: format!("sha256:{coefficient}"),
            problem: problem.to_string(),
            memory_bytes: mib * MIB,
            ..new(0)
        };
        let job = rig.submit_as(new).await;
        let ended = rig.until_done(&job).await;
        assert_eq!(ended.status, Status::Succeeded, "{:?}", ended.failure);
    };
    let figures = || rig.store.budget().body_cache();
    for (coefficient, hits) in [(0.1, 0), (0.2, 1), (0.3, 2)] {
        submit(coefficient, 20).await;
        assert_eq!((figures().hits, figures().misses), (hits, 1));
    }
    // all of the budget
    submit(0.4, 100).await;
    let figures = figures();
    assert_eq!((figures.hits, figures.misses, figures.evictions), (2, 2, 1));
    assert_eq!(figures.bodies, 1);
}
