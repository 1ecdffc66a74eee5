//! Contact that begins at the axis of a body of revolution: the node there has no area of its own (formulation 3.5).

use serde_json::{Value, json};
use solver::solution::{NodeState, Solution};

use crate::support::{graded, problem, solve};

const E_STAR: f64 = 1000.0 / 0.91;

/// A block of size 4 with elements of `h` = .1 at the axis, pressed by an obstacle.
fn pressed(obstacle: Value, indentation: f64, friction: bool, increments: Option<u32>) -> Solution {
    let h = 0.1;
    let fine: Vec<f64> = (0..=10).map(|k| f64::from(k) * h).collect();
    let x = crate::support::union(&[fine, graded(1.0, 4.0, h, 1.4)]);
    let y: Vec<f64> = graded(0.0, -4.0, h, 1.4).into_iter().rev().collect();
    let mut text = json!({
        "analysis": {"kind": "axisymmetric"},
        "mesh": {"grid": {"x": x, "y": y}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": obstacle, "indentation": indentation}],
    });
    if friction {
        text["contacts"][0]["friction"] =
            json!({"coefficient": 0.4, "nonlocal_radius": 0.1, "elastic_slip": 1e-4});
    }
    if let Some(increments) = increments {
        text["steps"] = json!([{"name": "press", "increments": increments}]);
    }
    solve(&problem(&text.to_string()))
}

fn cone(angle: f64) -> Value {
    json!({"kind": "cone", "angle": angle})
}

/// No node pulls, and none that is open carries anything.
fn only_presses(solution: &Solution, what: &str) {
    let profile = &solution.node_profiles["top"];
    for (i, stress) in profile.normal_stress.iter().enumerate() {
        let open = profile.state[i] == NodeState::Open;
        assert!(
            if open { *stress == 0.0 } else { *stress <= 0.0 },
            "{what}: {stress} at s = {}",
            profile.s[i]
        );
    }
}

/// Sneddon: F = 2 E* δ² / (π tan α), a = 2 δ / (π tan α), here a fifth of an element. Only the node on the axis touches:
/// the force is of the right size, no more can be expected, and the verdict says so. It used to be 0.
#[test]
fn a_cone_that_touches_within_the_first_element_is_felt() {
    let (angle, delta) = (5.0, 0.003);
    let slope = f64::to_radians(angle).tan();
    let exact = 2.0 * E_STAR * delta * delta / (std::f64::consts::PI * slope);
    let solution = pressed(cone(angle), delta, false, None);
    let force = solution.summary.normal_force;
    assert!(
        force > 0.5 * exact && force < 4.0 * exact,
        "{force} for {exact}"
    );
    let accuracy = solution.summary.accuracy.as_ref().unwrap();
    assert_eq!(accuracy.verdict, solver::solution::Verdict::Poor);
}

/// Contacts that end within the first elements, with and without friction: each converges, and none pulls.
#[test]
fn contacts_of_any_size_at_the_axis_converge() {
    for part in [0.1, 0.2, 0.33, 0.38, 0.45, 0.6, 0.8, 1.0, 1.3, 2.1] {
        let a = 0.1 * part;
        for friction in [false, true] {
            for angle in [2.0, 5.0, 13.0, 30.0] {
                let delta = 0.5 * std::f64::consts::PI * a * f64::to_radians(angle).tan();
                let solution = pressed(cone(angle), delta, friction, None);
                only_presses(&solution, &format!("a cone of {angle}° on {part} elements"));
                assert!(solution.summary.normal_force > 0.0);
            }
            let sphere = json!({"kind": "parabola", "radius": 8});
            let solution = pressed(sphere, a * a / 8.0, friction, None);
            only_presses(&solution, &format!("a sphere on {part} elements"));
            assert!(solution.summary.normal_force > 0.0);
        }
    }
}

/// The number of increments does not decide whether a contact is found.
#[test]
fn a_cone_in_many_increments_ends_as_in_one() {
    let delta = 0.05;
    let one = pressed(cone(13.0), delta, true, Some(1));
    for increments in [5, 10, 20, 40] {
        let many = pressed(cone(13.0), delta, true, Some(increments));
        let (a, b) = (one.summary.normal_force, many.summary.normal_force);
        assert!(
            (a - b).abs() <= 1e-9 * a,
            "{increments} increments: {b} for {a}"
        );
    }
}

/// Under a flat punch the pressure grows outwards, and the reaction of the node on the axis itself is negative: it must
/// not open. An obstacle that is hollow there leaves it open, and then nothing acts on it.
#[test]
fn the_axis_stays_closed_under_a_flat_punch_and_open_under_a_hollow_one() {
    let flat = pressed(
        json!({"kind": "flat", "from": 0, "to": 0.8}),
        0.05,
        false,
        None,
    );
    let profile = &flat.node_profiles["top"];
    assert_ne!(profile.state[0], NodeState::Open);
    let exact = E_STAR * 0.05 / (std::f64::consts::PI * 0.8);
    // the block is five times as large as the punch
    assert!(
        (-profile.normal_stress[0] / exact - 1.0).abs() < 0.25,
        "{} for {exact}",
        profile.normal_stress[0]
    );
    let hollow = pressed(
        json!({"kind": "table", "x": [0, 0.3, 2], "gap": [0.05, 0, 0], "from": 0, "to": 0.8}),
        0.02,
        true,
        None,
    );
    only_presses(&hollow, "a hollow obstacle");
    assert_eq!(hollow.node_profiles["top"].state[0], NodeState::Open);
}
