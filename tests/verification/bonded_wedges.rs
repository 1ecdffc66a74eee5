//! Blocks that are bonded to an obstacle with a kink, or without one: σ_t jumps at the kink. Source: Richardson's extrapolation of the
//! same problems on finer meshes. Goal: the stated errors of forces hold.

use serde_json::{Value, json};
use solver::solution::QuantityName;

use crate::support::{problem, solve};

fn forces(obstacle: &Value, ratio: f64, whole: bool, refine: u32) -> Vec<[f64; 2]> {
    let x: Vec<i32> = if whole {
        (-4..=4).collect()
    } else {
        (0..=4).collect()
    };
    let mut supports = vec![json!({"boundary": "bottom", "ux": 0, "uy": 0})];
    if !whole {
        supports.push(json!({"boundary": "left", "ux": 0}));
    }
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": [-2, -1, 0]}, "refine": refine},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": ratio}],
        "supports": supports,
        "contacts": [{"boundary": "top", "condition": "bonded", "obstacle": obstacle, "indentation": 0.01}],
    });
    let accuracy = solve(&problem(&text.to_string())).summary.accuracy.unwrap();
    let names = [
        QuantityName::NormalForce,
        QuantityName::TangentialForce,
        QuantityName::FrictionForce,
    ];
    let of = |name: QuantityName| {
        let mut all = accuracy.quantities.iter();
        let found = all.find(|q| q.quantity == name).unwrap();
        [found.value, found.error.unwrap()]
    };
    names.map(of).to_vec()
}

#[test]
fn a_kink_of_a_bonded_obstacle_is_in_the_errors_of_forces() {
    let wedge = json!({"kind": "wedge", "angle": 1});
    let valley = json!({"kind": "table", "x": [-4, 0, 4], "gap": [0.07, 0, 0.07]});
    let tilted = json!({"kind": "tilted", "slope": 0.0175});
    let parabola = json!({"kind": "parabola", "radius": 50});
    let cases = [
        (&wedge, true),
        (&wedge, false),
        (&valley, true),
        (&tilted, false),
        (&parabola, false),
    ];
    let (mut all, mut exceeded) = (0, 0);
    for (obstacle, whole) in cases {
        for ratio in [0.0, 0.2, 0.3, 0.45] {
            let on = |refine: u32| forces(obstacle, ratio, whole, refine);
            let (coarse, middle, fine, finest) = (on(1), on(2), on(3), on(4));
            for k in 0..3 {
                // of first order: the errors halve
                let right = 2.0 * finest[k][0] - fine[k][0];
                for own in [&coarse, &middle, &fine] {
                    let [value, error] = own[k];
                    let off = (value - right).abs() / error;
                    all += 1;
                    exceeded += u32::from(off > 1.0);
                    assert!(
                        off <= 1.25,
                        "{obstacle} {ratio} {whole} {k}: {value} ± {error}, right {right}"
                    );
                }
            }
        }
    }
    assert!(20 * exceeded <= all, "{exceeded} of {all}");
}
