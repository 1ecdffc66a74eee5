//! Widths of contact in a sweep. Source: Hertz, a rigid parabola on a half-space, of whose load P the half-width is a =
//! √(4PR/(πE*)); here half of it, P = 2Y. Goal: the widths of the members change smoothly with the indentation although nodes
//! close one after another, and are known to the errors that their rows state, as are those of jobs.

use serde_json::json;
use solver::family::{Family, Start};
use solver::problem::Problem;
use solver::solution::QuantityName;

use crate::support::{graded, problem, solve, union};

const RADIUS: f64 = 8.0;
/// Distance between nodes.
const SPACING: f64 = 0.04;

fn cylinder(indentation: f64) -> Problem {
    let fine: Vec<f64> = (0..=20).map(|k| f64::from(k) * 2.0 * SPACING).collect();
    let x = union(&[fine, graded(1.6, 60.0, 2.0 * SPACING, 1.35)]);
    let y: Vec<f64> = graded(0.0, -60.0, 2.0 * SPACING, 1.35)
        .into_iter()
        .rev()
        .collect();
    problem(
        &json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": x, "y": y}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "uy": 0}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "parabola", "radius": RADIUS}, "indentation": indentation}],
        })
        .to_string(),
    )
}

/// Hertz's half-width under the normal force of half a cylinder.
fn hertz(force: f64) -> f64 {
    (4.0 * 2.0 * force * RADIUS / (std::f64::consts::PI * 1000.0 / 0.91)).sqrt()
}

#[test]
fn widths_in_a_sweep_change_smoothly_and_agree_with_hertz_and_with_jobs() {
    let quiet = &mut ();
    let indentations: Vec<f64> = (0..40).map(|k| 0.08 + 0.0015 * f64::from(k)).collect();
    let mut family = Family::new(&cylinder(indentations[0]), None, quiet).unwrap();
    let (mut end, mut widths, mut of_nodes) = (None, Vec::new(), Vec::new());
    for indentation in &indentations {
        let problem = cylinder(*indentation);
        let start = end.as_ref().map_or(Start::Anew, Start::Next);
        let (member, own_end) = family.member(&problem, start, quiet).unwrap();
        end = own_end;
        let error = member.contact_width_error.unwrap();
        assert!(error > 0.0 && error <= SPACING * (1.0 + 1e-9), "{error}");
        let off = member.contact_width - hertz(member.normal_force);
        assert!(
            off.abs() <= error,
            "{indentation}: off by {off}, stated {error}"
        );
        // interpolation is worth it: nodes alone may be off by a whole distance
        assert!(off.abs() <= 0.3 * SPACING, "{indentation}: off by {off}");

        // a job states its end at a node, with an error of its own
        let job = solve(&problem).summary;
        let accuracy = job.accuracy.unwrap();
        let ends =
            |q: &&solver::solution::EstimatedQuantity| q.quantity == QuantityName::ContactEnd;
        let stated = accuracy.quantities.iter().find(ends).unwrap();
        // its true end may be just before the next node
        let off = (stated.value - hertz(job.normal_force)).abs();
        assert!(
            off <= stated.error.unwrap(),
            "{indentation}: {stated:?} is off by {off}"
        );
        let apart = (member.contact_width - stated.value).abs();
        assert!(
            apart <= error + stated.error.unwrap(),
            "{indentation}: {apart}"
        );
        assert_eq!(member.stick_width, 0.0);
        assert!((member.slip_width - member.contact_width).abs() < 1e-12);
        widths.push(member.contact_width);
        of_nodes.push(stated.value);
    }
    let steps =
        |all: &[f64]| -> Vec<f64> { all.windows(2).map(|pair| pair[1] - pair[0]).collect() };
    let (smooth, stairs) = (steps(&widths), steps(&of_nodes));
    let mean = (widths[39] - widths[0]) / 39.0;
    // of Hertz's width each step is 0.8 to 1.2 of the mean; of nodes most are 0, and some a whole distance
    let largest = smooth.iter().copied().fold(0.0, f64::max);
    assert!(smooth.iter().all(|step| *step > 0.0), "{smooth:?}");
    assert!(largest < 3.0 * mean, "{largest} {mean}: {smooth:?}");
    assert!(
        stairs.iter().filter(|step| **step == 0.0).count() > 20,
        "{stairs:?}"
    );
}
