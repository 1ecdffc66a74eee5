//! Displacements so large beside ε that rounding keeps residuals above the tolerance: told, and the same in any units.
//! The floor is formulation 4.4.

use serde_json::{Value, json};
use solver::problem::Problem;
use solver::solution::{Outcome, Summary, Warning, WarningCode};

use crate::support::{problem, quiet};

/// Factors of lengths and of stresses, no powers of two but the first.
const UNITS: [[f64; 2]; 7] = [
    [1.0, 1.0],
    [1e6, 1.0],
    [1e-6, 1.0],
    [1.0, 1e9],
    [1.0, 1e-9],
    [1e6, 1e-9],
    [1e-6, 1e9],
];

/// A whole block under a cylinder.
#[derive(Clone, Copy)]
struct Dragged {
    coefficient: f64,
    /// d (in lengths of the first units, as all that follows).
    drag: f64,
    /// u_x of the base.
    base: f64,
    elastic_slip: f64,
    /// Pressed, dragged there and back in increments.
    incremental: bool,
}

impl Dragged {
    fn json(&self, [length, stress]: [f64; 2]) -> Value {
        let line = |k: i32| 2.0 * f64::from(k.signum()) * (f64::from(k.abs()) / 16.0).powf(1.3);
        let lines = |lines: &[f64]| lines.iter().map(|x| length * x).collect::<Vec<f64>>();
        let x: Vec<f64> = (-16..=16).map(line).collect();
        let mut whole = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": lines(&x), "y": lines(&[-2.0, -1.0, -0.5, -0.2, 0.0])}},
            "materials": [{"youngs_modulus": 1000.0 * stress, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "ux": self.base * length, "uy": 0}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "parabola", "radius": 8.0 * length},
                "indentation": 0.02 * length, "tangential_displacement": self.drag * length,
                "friction": {"coefficient": self.coefficient, "nonlocal_radius": 0.1 * length,
                    "elastic_slip": self.elastic_slip * length}}],
        });
        if self.incremental {
            whole["contacts"][0]["friction"]["history"] = json!("incremental");
            whole["steps"] = json!([
                {"indentation": 1, "increments": 3},
                {"indentation": 1, "tangential_displacement": 1, "increments": 4},
                {"indentation": 1, "tangential_displacement": -1, "increments": 4},
            ]);
        }
        whole
    }

    fn problem(&self, units: [f64; 2]) -> Problem {
        problem(&self.json(units).to_string())
    }
}

fn summary(problem: &Problem) -> Summary {
    solver::solve(problem, &mut quiet).unwrap().summary
}

fn rounding(summary: &Summary) -> Option<&Warning> {
    let mut warnings = summary.warnings.iter();
    warnings.find(|warning| warning.code == WarningCode::RoundingLimitsResidual)
}

/// The number that follows `before` in a warning.
fn number(warning: &Warning, before: &str) -> f64 {
    let (_, after) = warning.message.split_once(before).unwrap();
    let end = after.find([' ', '.', ',']).unwrap();
    // a decimal point is followed by a digit
    let end = match after[end..].starts_with('.') {
        true => end + 1 + after[end + 1..].find([' ', '.', ',']).unwrap(),
        false => end,
    };
    after[..end].parse().unwrap()
}

/// Nothing suggests a second solution, or that the iteration does not settle.
fn assert_blames_nothing_else(summary: &Summary, place: &str) {
    use WarningCode::{
        ContactCycling, NotConverged, NotUnique, SlowContraction, UniquenessUnknown,
    };
    for warning in &summary.warnings {
        let other = [
            ContactCycling,
            NotConverged,
            NotUnique,
            SlowContraction,
            UniquenessUnknown,
        ];
        assert!(!other.contains(&warning.code), "{place}: {warning:?}");
        assert!(!warning.message.contains("uniq"), "{place}: {warning:?}");
    }
    let reasons = &summary.accuracy.as_ref().unwrap().reasons;
    assert!(
        !reasons.iter().any(|reason| reason.contains("uniq")),
        "{place}: {reasons:?}"
    );
}

/// Every case converges in all units, at the tolerance or with the warning, and to the same forces. They may differ by what the
/// tolerance leaves (1e-9, as in `invariance.rs`) or by some of the largest residuals, which are those of single nodes.
fn assert_same_in_all_units(dragged: &Dragged) -> bool {
    let mut reference: Option<[f64; 2]> = None;
    let mut limited = false;
    for [length, stress] in UNITS {
        let place = format!(
            "d {} ε {:e} μ {}, lengths × {length:e}, stresses × {stress:e}",
            dragged.drag, dragged.elastic_slip, dragged.coefficient
        );
        let summary = summary(&dragged.problem([length, stress]));
        assert_eq!(
            summary.outcome,
            Outcome::Converged,
            "{place}: {:#?}",
            summary.warnings
        );
        assert_blames_nothing_else(&summary, &place);
        let mut allowed = 1e-9;
        if let Some(warning) = rounding(&summary) {
            limited = true;
            assert_eq!(warning.pointer, "/contacts/0/friction/elastic_slip");
            let (residual, floor) = (
                number(warning, "residual of "),
                number(warning, "leave up to "),
            );
            assert!(
                1e-10 < residual && residual <= floor && floor <= 1e-4,
                "{place}: {warning:?}"
            );
            // a bound that explains anything would explain nothing
            assert!(floor <= 1e3 * residual, "{place}: {warning:?}");
            allowed += 10.0 * residual;
        }
        let r = &summary.residuals;
        let largest = r.kkt.max(r.friction).max(r.monolithic);
        assert!(
            largest <= 1e-10 || rounding(&summary).is_some(),
            "{place}: {largest:e}"
        );
        let forces =
            [summary.normal_force, summary.tangential_force].map(|f| f / (length * stress));
        let [y, t] = *reference.get_or_insert(forces);
        assert!(
            (forces[0] - y).abs() <= allowed * y,
            "{place}: {forces:?} for {y}"
        );
        assert!(
            (forces[1] - t).abs() <= allowed * y,
            "{place}: {forces:?} for {t}"
        );
    }
    limited
}

#[test]
fn however_small_the_elastic_slip_the_outcome_is_the_same_in_any_units() {
    let mut limited = 0;
    for (coefficient, drag, base) in [
        (0.3, 0.01, 0.0),
        (0.9, 0.004, 0.0),
        (0.9, 1.0, 1.0),
        (0.3, 1.0, 0.0),
    ] {
        for decade in 3..=9 {
            let dragged = Dragged {
                coefficient,
                drag,
                base,
                elastic_slip: drag / 10f64.powi(decade),
                incremental: false,
            };
            let by_rounding = assert_same_in_all_units(&dragged);
            assert!(!by_rounding || decade >= 6, "d/ε = 1e{decade}, d = {drag}");
            limited += u32::from(by_rounding);
        }
    }
    // without the floor these would not converge
    assert!(limited >= 6, "{limited}");
}

#[test]
fn so_it_is_with_the_incremental_law() {
    let mut limited = 0;
    for (coefficient, drag) in [(0.3, 0.01), (0.9, 0.004), (0.9, 1.0)] {
        for elastic_slip in [1e-6, 1e-8, 1e-10, 1e-12] {
            let dragged = Dragged {
                coefficient,
                drag,
                base: 0.0,
                elastic_slip,
                incremental: true,
            };
            limited += u32::from(assert_same_in_all_units(&dragged));
        }
    }
    assert!(limited >= 4, "{limited}");
}

const LIMITED: Dragged = Dragged {
    coefficient: 0.9,
    drag: 0.004,
    base: 0.0,
    elastic_slip: 4e-12,
    incremental: false,
};

/// What the warning advises: the ε it names, and below it the same problem says it again.
#[test]
fn the_elastic_slip_that_the_warning_names_is_large_enough() {
    let limited = summary(&LIMITED.problem(UNITS[0]));
    let named = number(rounding(&limited).unwrap(), "elastic_slip to ");
    assert!(
        named > LIMITED.elastic_slip && named < 1e-4 * LIMITED.drag,
        "{named:e}"
    );
    let raised = Dragged {
        elastic_slip: named,
        ..LIMITED
    };
    let summary = summary(&raised.problem(UNITS[0]));
    assert!(
        summary.converged && rounding(&summary).is_none(),
        "{:#?}",
        summary.warnings
    );
}

/// A second solution is not seen where rounding makes the difference.
#[test]
fn rounding_is_no_second_solution() {
    for elastic_slip in [4e-12, 4e-13] {
        let mut problem = Dragged {
            elastic_slip,
            ..LIMITED
        }
        .problem(UNITS[0]);
        problem.solver.check_uniqueness = true;
        let summary = summary(&problem);
        assert_blames_nothing_else(&summary, "with a second solution");
        let second = summary.uniqueness.unwrap();
        assert!(
            second.converged && second.agrees && rounding_is_told(&problem),
            "{second:?}"
        );
    }
}

fn rounding_is_told(problem: &Problem) -> bool {
    rounding(&summary(problem)).is_some()
}

/// Where rounding may leave more than the smallest error that is ever stated, nothing has converged, in any units; it is
/// said why.
#[test]
fn a_state_that_rounding_decides_has_not_converged() {
    for incremental in [false, true] {
        for units in UNITS {
            let dragged = Dragged {
                elastic_slip: 4e-17,
                incremental,
                ..LIMITED
            };
            let place = format!("incremental {incremental}, units {units:?}");
            let summary = summary(&dragged.problem(units));
            assert_eq!(
                summary.outcome,
                Outcome::NotConverged,
                "{place}: {:#?}",
                summary.warnings
            );
            assert_blames_nothing_else(&summary, &place);
            let warning = rounding(&summary).unwrap();
            assert!(
                warning.message.contains("does not count as converged"),
                "{warning:?}"
            );
            assert!(number(warning, "leave up to ") > 1e-4, "{warning:?}");
            // halving increments would not help
            assert_eq!(summary.cut_backs, 0, "{place}");
        }
    }
}

/// Without friction it is the elastic forces that rounding leaves something of: a body carried far beside its strains.
#[test]
fn a_body_that_is_carried_far_is_reported() {
    let mut near: Option<f64> = None;
    for units in UNITS {
        let mut whole = LIMITED.json(units);
        let far = 1e5 * units[0];
        whole["contacts"][0]
            .as_object_mut()
            .unwrap()
            .remove("friction");
        whole["supports"][0]["uy"] = json!(far);
        whole["contacts"][0]["indentation"] = json!(0.02 * units[0] - far);
        let summary = summary(&problem(&whole.to_string()));
        let place = format!("{units:?}");
        assert_eq!(summary.outcome, Outcome::Converged, "{place}");
        assert_blames_nothing_else(&summary, &place);
        let warning = rounding(&summary).unwrap();
        assert_eq!(warning.pointer, "/solver/tolerance");
        assert!(
            warning.message.contains("relative to one another"),
            "{warning:?}"
        );
        // what a body that is not carried is pressed with, to what is left of the digits of the gap
        let force = summary.normal_force / (units[0] * units[1]);
        let y = *near.get_or_insert_with(|| {
            let mut whole = LIMITED.json(units);
            whole["contacts"][0]
                .as_object_mut()
                .unwrap()
                .remove("friction");
            let whole = problem(&whole.to_string());
            self::summary(&whole).normal_force
        });
        assert!((force - y).abs() < 1e-6 * y, "{place}: {force} for {y}");
    }
}
