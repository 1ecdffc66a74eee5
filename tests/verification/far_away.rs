//! Errors that come from far away: from a clamped corner of an orthotropic body, whose stresses have no limit.

use serde_json::json;
use solver::problem::{Problem, Refine};
use solver::solution::{QuantityName, Summary};

use crate::pairs::{distance, pairs};
use crate::support::{problem, solve};

/// Stiff fibres at −58°, a base that is clamped along its whole width, and elements that become large towards it.
fn leaning_fibres() -> Problem {
    let mut x = vec![-3.03, -1.32, -1.22];
    x.extend((1..=21).map(|k| -1.22 + f64::from(k) * 3.0 / 21.0));
    x.extend([1.96, 3.03]);
    let place = |k: i32| 0.28 + 0.3 * f64::from(k);
    let gap = |k: i32| 0.07 * f64::from(k * k) * 0.09 * (1.0 + 0.002 * f64::from(k * k));
    let whole = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": [-5.48, -2.9, -1.61, -0.874, -0.454, -0.215, -0.078, 0]}},
        "materials": [{"orthotropic": {"e1": 2.13, "e2": 1.23, "e3": 0.98, "nu12": 0.0023, "nu13": 0.018, "nu23": 0.052,
            "g12": 0.19, "angle": -58.5}}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "indentation": 0.072, "tangential_displacement": 0.006, "normal": "obstacle",
            "obstacle": {"kind": "table", "x": (-9..=9).map(place).collect::<Vec<_>>(),
                "gap": (-9..=9).map(gap).collect::<Vec<_>>(), "interpolation": "cubic"},
            "friction": {"coefficient": 0.3, "nonlocal_radius": 0, "elastic_slip": 0.003}}],
        "loads": [{"boundary": "right", "traction": [0.0033, -0.0045]}],
    });
    problem(&whole.to_string())
}

fn refined(times: u32) -> Summary {
    let mut problem = leaning_fibres();
    problem.mesh.refine = Refine::Times(times);
    solve(&problem).summary
}

/// The force is known to 5 %, and half of that is the corner's, which recovery sees a fifth of; the peak was stated a
/// seventh to a tenth of what it is off by, on every mesh.
#[test]
fn errors_of_a_clamped_corner_are_stated_for_forces_and_peaks() {
    use QuantityName::{FrictionForce, NormalForce, PeakNormalStress, TangentialForce};
    let fine = refined(3);
    for times in [0, 1] {
        let own = refined(times);
        let mut compared = 0;
        for (a, b) in pairs(&own, &fine) {
            if [
                NormalForce,
                TangentialForce,
                FrictionForce,
                PeakNormalStress,
            ]
            .contains(&a.quantity)
            {
                let (off, error) = (distance(a, b), a.error.unwrap());
                println!("{times} {:?} off {off:.2e} stated {error:.2e}", a.quantity);
                assert!(off <= error, "refine {times}: off by {off:.2e}: {a:?}");
                assert!(
                    error <= 20.0 * off,
                    "refine {times}: off by {off:.2e}: {a:?}"
                );
                compared += 1;
            }
        }
        assert_eq!(compared, 4);
    }
}
