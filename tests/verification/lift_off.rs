//! Bodies that were pressed and are let go: what is left must be nothing.

use serde_json::json;
use solver::solution::{Verdict, WarningCode};

use crate::support::{example, solve};

/// A cylinder pressed and lifted off again: without load the body returns to rest, to rounding of what
/// it has borne, whatever the mesh; and no increment is cut back on the way.
#[test]
fn a_cylinder_that_is_lifted_off_leaves_no_forces() {
    for (refine, friction) in [(0, true), (2, false), (2, true), (5, false)] {
        let mut problem = example("cylinder");
        problem.mesh.refine = solver::problem::Refine::Times(refine);
        if !friction {
            problem.contacts[0].friction = None;
        }
        problem.steps =
            serde_json::from_value(json!([{"name": "in"}, {"name": "off", "indentation": -0.1}]))
                .unwrap();
        let solution = solve(&problem);
        let (pressed, free) = (&solution.steps[0].summary, &solution.summary);
        assert!(
            pressed.normal_force > 300.0 && free.normal_force == 0.0,
            "refine {refine}"
        );
        assert_eq!(
            (free.cut_backs, free.friction_force),
            (0, 0.0),
            "refine {refine}"
        );
        let moved = |u: &[f64]| u.iter().fold(0.0f64, |most, u| most.max(u.abs()));
        let most = moved(&solution.fields.ux).max(moved(&solution.fields.uy));
        assert!(most < 1e-10, "refine {refine}: {most:.1e} is left");
        let codes: Vec<WarningCode> = free.warnings.iter().map(|w| w.code).collect();
        assert!(
            codes.contains(&WarningCode::ContactOpened) && !codes.contains(&WarningCode::NoContact)
        );
        let accuracy = free.accuracy.as_ref().unwrap();
        assert!(accuracy.verdict <= Verdict::Fair, "{accuracy:?}");
    }
}
