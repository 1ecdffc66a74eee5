//! Compares the estimated memory of problems with the memory that they take, from their text to the stored form of
//! their result.

use serde_json::{Value, json};

use base::memory::Allowance;

use super::*;
use crate::queue::{
    ending::NoSolution,
    solving::{Partials, solve_task, solve_with_partials},
};

/// Problems of different shapes, named by what is large in them.
fn problems() -> Vec<(String, Value)> {
    let mut problems = vec![];
    for (name, text) in [
        (
            "annular punch",
            include_str!("../../../../../tests/data/thesis/annular_punch.json"),
        ),
        (
            "cylinder",
            include_str!("../../../../../tests/data/thesis/cylinder.json"),
        ),
        (
            "cylinder on end",
            include_str!("../../../../../tests/data/thesis/cylinder_on_end.json"),
        ),
        (
            "rectangular punch",
            include_str!("../../../../../tests/data/thesis/rectangular_punch.json"),
        ),
        (
            "sheet",
            include_str!("../../../../../tests/data/thesis/sheet.json"),
        ),
    ] {
        let example: Value = serde_json::from_str(text).unwrap();
        for refine in [0, 1, 2, 3] {
            let mut refined = example.clone();
            refined["mesh"]["refine"] = json!(refine);
            problems.push((format!("{name}, refine {refine}"), refined));
        }
        let with = |change: &dyn Fn(&mut Value)| {
            let mut changed = example.clone();
            changed["mesh"]["refine"] = json!(2);
            change(&mut changed);
            changed
        };
        problems.push((
            format!("{name}, Newton"),
            with(&|p| p["solver"] = json!({"algorithm": "newton"})),
        ));
        problems.push((
            format!("{name}, thesis"),
            with(&|p| p["solver"] = json!({"algorithm": "thesis", "max_iterations": 60})),
        ));
        problems.push((
            format!("{name}, uniqueness"),
            with(&|p| p["solver"] = json!({"check_uniqueness": true})),
        ));
        problems.push((
            format!("{name}, verified"),
            with(&|p| p["solver"] = json!({"accuracy": "verify"})),
        ));
        problems.push((
            format!("{name}, 40 steps"),
            with(&|p| {
                let step = |k: u32| {
                    json!({"indentation": f64::from(k) / 40.0, "loads": f64::from(k) / 40.0,
                "supports": f64::from(k) / 40.0, "tangential_displacement": f64::from(k) / 40.0})
                };
                p["steps"] = (1..=40).map(step).collect();
            }),
        ));
        problems.push((
            format!("{name}, 100 increments"),
            with(&|p| {
                p["steps"] = json!([{"increments": 100}]);
                p["contacts"][0]["friction"]["history"] = json!("incremental");
            }),
        ));
        problems.push((
            format!("{name}, nearly incompressible"),
            with(&|p| p["materials"][0]["poissons_ratio"] = json!(0.4999)),
        ));
        problems.push((
            format!("{name}, wide average"),
            with(&|p| p["contacts"][0]["friction"]["nonlocal_radius"] = json!(0.6)),
        ));
    }
    for lines in [10, 100, 300] {
        problems.push((format!("wall of {lines} lines"), wall(lines, 2.0)));
    }
    problems.push(("wall of 100 lines, wide average".into(), wall(100, 200.0)));
    let mut verified = wall(100, 20.0);
    verified["solver"] = json!({"accuracy": "verify"});
    problems.push(("wall of 100 lines, verified".into(), verified));
    let mut newton = wall(150, 20.0);
    newton["solver"] = json!({"algorithm": "newton"});
    problems.push(("wall of 150 lines, Newton".into(), newton));
    for (contacts, steps) in [(60, 100), (20, 300), (3, 1000)] {
        for friction in [false, true] {
            let name = if friction {
                format!("{contacts} contacts with friction, {steps} steps")
            } else {
                format!("{contacts} contacts, {steps} steps")
            };
            problems.push((name, row_of_contacts(contacts, steps, friction)));
        }
    }
    let side: Vec<u32> = (0..80).collect();
    problems.push(("block, two contacts".into(), json!({
        "analysis": {"kind": "plane_stress", "thickness": 1},
        "mesh": {"grid": {"x": side, "y": side}, "boundaries": {
            "roof": {"side": "top", "x": [5, 60]}, "wall": {"side": "left", "y": [20, 70]}}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [
            {"boundary": "roof", "obstacle": {"kind": "circle", "radius": 400, "center": 25}, "indentation": 0.1,
             "friction": {"coefficient": 0.3, "nonlocal_radius": 5, "elastic_slip": 0.001}},
            {"boundary": "wall", "obstacle": {"kind": "flat", "from": 0, "to": 50}, "indentation": 0.01},
        ],
    })));
    problems
}

/// A problem of a strip one element wide with contact along its whole long side, under a boundary name of its own.
fn wall(lines: u32, radius: f64) -> Value {
    let y: Vec<u32> = (0..lines).collect();
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [0, 1], "y": y}, "boundaries": {"wall": {"normal": [1, 0]}}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "uy": 0}],
        "contacts": [{
            "boundary": "wall",
            "obstacle": {"kind": "flat", "from": 0, "to": lines - 1},
            "indentation": 0.01,
            "friction": {"coefficient": 0.3, "nonlocal_radius": radius, "elastic_slip": 1e-4}
        }]
    })
}

/// A problem of a strip with this many contacts on its upper side, and this many load steps.
fn row_of_contacts(contacts: u32, steps: u32, friction: bool) -> Value {
    let count = f64::from(contacts);
    let x: Vec<f64> = (0..=2 * contacts)
        .map(|k| f64::from(k) / (2.0 * count))
        .collect();
    let place = |k: u32| (format!("c{k}"), f64::from(k) / count);
    let boundaries: serde_json::Map<String, Value> = (0..contacts)
        .map(place)
        .map(|(name, at)| {
            (
                name,
                json!({"side": "top", "x": [at - 1e-9, at + 0.5 / count + 1e-9]}),
            )
        })
        .collect();
    let contact = |k: u32| {
        let mut contact =
            json!({"boundary": format!("c{k}"), "obstacle": {"kind": "flat"}, "indentation": 0.01});
        if friction {
            contact["friction"] =
                json!({"coefficient": 0.3, "nonlocal_radius": 2.0 / count, "elastic_slip": 1e-4});
        }
        contact
    };
    let step = |k: u32| json!({"indentation": f64::from(k) / f64::from(steps)});
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": [0, 0.3, 0.6, 1]}, "boundaries": boundaries},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": (0..contacts).map(contact).collect::<Vec<_>>(),
        "steps": (1..=steps).map(step).collect::<Vec<_>>(),
    })
}

/// A share of memory, without kept bodies.
fn within(share: u64) -> Allowance<'static> {
    Allowance {
        share,
        bodies: None,
    }
}

/// The largest memory that solving a problem took, and its estimate.
fn taken_and_told(problem: &Value) -> (u64, u64) {
    let text = problem.to_string();
    let parsed = files::parse(&text).unwrap();
    let checked = solver::check(&parsed, files::external_mesh(&parsed, None));
    let told = checked.unwrap_or_else(|v| panic!("{v:?}")).estimate;
    let before = allocator::held();
    allocator::forget_highest();
    let partials = Partials::every_step();
    let solved = solve_with_partials(
        &text,
        None,
        None,
        solver::solve_on,
        within(u64::MAX),
        partials,
        &mut looking(|_| false),
    );
    let taken = allocator::highest() - before;
    drop(solved.map(|solved| solved.parts));
    (taken as u64, told.memory_bytes)
}

/// Checks that estimates are not below the memory that problems take, and not three times as much.
fn compare(problems: Vec<(String, Value)>) {
    let mut wrong = vec![];
    let first = problems[0].1.to_string();
    for (name, problem) in &problems {
        // on a new thread, whose first job also makes the thread's compressor
        let (taken, told) = std::thread::scope(|scope| {
            let job = scope.spawn(|| {
                // this makes what the solver keeps for the life of the thread
                let first = files::parse(&first).unwrap();
                solver::solve_on(&first, None, &mut ()).unwrap();
                taken_and_told(problem)
            });
            job.join().unwrap()
        });
        let ratio = told as f64 / taken as f64;
        println!(
            "{name}: takes {} KiB, told {} KiB, {ratio:.2}",
            taken >> 10,
            told >> 10
        );
        if !(1.0..3.0).contains(&ratio) {
            wrong.push((name, taken, told));
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

#[test]
fn estimates_lie_between_what_is_taken_and_three_times_that() {
    let problems = problems();
    assert!(problems.len() >= 30);
    compare(problems);
}

/// Estimates of long contacts are upper bounds. With `SIGNORINI_SOAK` set (`tests/reliability/unit.py long_contacts`)
/// it also checks those that take minutes, and up to 1 GiB.
#[test]
fn estimates_of_long_contacts_are_upper_bounds() {
    let lines: &[u32] = match std::env::var_os("SIGNORINI_SOAK") {
        Some(_) => &[300, 500, 1000, 1500],
        None => &[300],
    };
    let named = |lines: &u32| (format!("wall of {lines} lines"), wall(*lines, 2.0));
    compare(lines.iter().map(named).collect());
}

/// A job that needs more memory than its share is stopped at the next check, with the reason.
#[test]
fn a_job_that_needs_more_than_its_share_is_stopped() {
    let text = wall(300, 2.0).to_string();
    let supervisor = &mut looking(|_| false);
    let allowance = within(16 << 20);
    let solved = solve_task(&text, None, None, solver::solve_on, allowance, supervisor);
    let Some(NoSolution::OutOfMemory(outgrown)) = solved.err() else {
        panic!("it was not out of memory")
    };
    assert_eq!(outgrown.share, 16 << 20);
    // the factor alone is larger
    assert!(
        outgrown.needed > 16 << 20 && outgrown.used < 16 << 20,
        "{outgrown:?}"
    );
}

/// A verification that needs more memory than the share ends alone: the job keeps its solution, and was not asked to
/// stop.
#[test]
fn a_verification_that_needs_more_than_the_share_leaves_the_solution() {
    let mut problem = wall(100, 2.0);
    // the first one also makes what all share for the life of the process
    taken_and_told(&problem);
    let (taken, _) = taken_and_told(&problem);
    problem["solver"] = json!({"accuracy": "verify"});
    let (needed, _) = taken_and_told(&problem);
    assert!(needed > 2 * taken, "{needed} and {taken}");
    let share = taken + taken / 4;
    let solved = solve_task(
        &problem.to_string(),
        None,
        None,
        solver::solve_on,
        within(share),
        &mut looking(|_| false),
    );
    let solved = solved.unwrap();
    assert_eq!(solved.ending.status, Status::Succeeded);
    assert!(solved.unverified);
}
