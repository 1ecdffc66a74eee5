//! Bodies whose sides are straight though they stand for curves: corners are told, and `mesh.curves` removes them.

use serde_json::{Value, json};
use solver::error::Reason;
use solver::model::Model;
use solver::solution::{ErrorMethod, QuantityName, Solution, Verdict, WarningCode};

use crate::smooth::Sector;
use crate::support::{close, problem, solve};

/// A third of a hollow cylinder, R = 4, pressed on a rigid plane: in elements of 2° or others.
fn cylinder(sector: Sector, changes: &[(&str, Value)]) -> Value {
    let mut text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": sector.mesh(),
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "inner", "ux": 0, "uy": 0}],
        "contacts": [{
            "boundary": "outer", "indentation": 0.08, "normal": "obstacle",
            "obstacle": {"kind": "line", "point": [0, -4], "angle": 0}
        }]
    });
    for (key, value) in changes {
        text["mesh"][key] = value.clone();
    }
    text
}

fn facets(around: usize) -> Sector {
    let mut sector = Sector::new([1.0, 4.0], [-150.0, -30.0], around);
    (sector.across, sector.straight) = (20, true);
    sector
}

fn circle() -> (&'static str, Value) {
    let on = json!({"outer": {"kind": "circle", "center": [0, 0], "radius": 4}});
    ("curves", on)
}

fn peak(solution: &Solution) -> (f64, ErrorMethod) {
    let known = solution.summary.accuracy.as_ref().unwrap();
    let peak = known
        .quantities
        .iter()
        .find(|q| q.quantity == QuantityName::PeakNormalStress)
        .unwrap();
    (peak.value, peak.method)
}

fn kinks(solution: &Solution) -> Vec<&str> {
    let warnings = solution.summary.warnings.iter();
    warnings
        .filter(|w| {
            [
                WarningCode::KinkInContact,
                WarningCode::PolygonInContact,
                WarningCode::PolygonTooCoarse,
            ]
            .contains(&w.code)
        })
        .map(|w| &w.message[..])
        .collect()
}

/// Corners of 2°: each halving of the mesh adds E*·δ/(2π)·ln 2 = 4.2 to the peak. It has no limit, and the warning says why.
#[test]
fn the_peak_of_a_body_of_straight_facets_has_no_limit() {
    let mut before = None;
    for refine in 0..3 {
        let text = cylinder(facets(60), &[("refine", json!(refine))]);
        let solution = solve(&problem(&text.to_string()));
        let (value, method) = peak(&solution);
        assert_eq!(method, ErrorMethod::NoLimit);
        let told = kinks(&solution);
        assert!(
            told.len() == 1 && told[0].contains("turns by up to 2.00°"),
            "{told:?}"
        );
        if let Some(before) = before {
            let growth: f64 = before - value;
            assert!((3.0..6.5).contains(&growth), "{growth}");
        }
        before = Some(value);
    }
}

/// A quarter of a ring, 20 to 40, on a pin of 20.02: in straight sides, or on its circle.
fn ring(around: usize, refine: &Value, on_circle: bool) -> Value {
    let mut sector = Sector::new([20.0, 40.0], [0.0, 90.0], around);
    (sector.across, sector.straight) = (6, true);
    let pin: Vec<[f64; 2]> = (-5..=185)
        .map(|k| {
            let (s, c) = (0.5 * f64::from(k)).to_radians().sin_cos();
            [20.02 * c, 20.02 * s]
        })
        .collect();
    let mut text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": sector.mesh(),
        "materials": [{"youngs_modulus": 210_000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "start", "uy": 0}, {"boundary": "end", "ux": 0}],
        "contacts": [{"boundary": "inner", "indentation": 0,
            "obstacle": {"kind": "polyline", "points": pin, "interpolation": "cubic"}}]
    });
    text["mesh"]["refine"] = refine.clone();
    if on_circle {
        text["mesh"]["curves"] = json!({
            "inner": {"kind": "circle", "center": [0, 0], "radius": 20},
            "outer": {"kind": "circle", "center": [0, 0], "radius": 40}
        });
    }
    text
}

/// A polygon that stands for a curve is told on every mesh, also where its sides touch one by one and none of its corners does,
/// and where a small contact has one corner or none. Where forces may be off by more than 5 %, the verdict is `poor`.
#[test]
fn a_polygon_in_place_of_a_curve_is_told_however_fine_the_mesh() {
    let of = |text: &Value| solve(&problem(&text.to_string()));
    let verdict = |solution: &Solution| solution.summary.accuracy.as_ref().unwrap().verdict;
    let told = |solution: &Solution, code: WarningCode| {
        solution.summary.warnings.iter().any(|w| w.code == code)
    };
    // Lamé: 3460.15
    let exact = of(&ring(16, &json!(1), true)).summary.normal_force;
    close(exact, 3460.15, 1e-3);
    for (around, refines, coarse) in [
        (
            16,
            &[json!(0), json!(2), json!({"tolerance": 0.005})][..],
            true,
        ),
        (32, &[json!(0), json!(1)], true),
        (128, &[json!(0), json!(1)], false),
    ] {
        for refine in refines {
            let solution = of(&ring(around, refine, false));
            let off = (solution.summary.normal_force / exact - 1.0).abs();
            let code = if coarse {
                WarningCode::PolygonTooCoarse
            } else {
                WarningCode::PolygonInContact
            };
            assert!(
                told(&solution, code),
                "{around} {refine}: {:?}",
                solution.summary.warnings
            );
            assert_eq!(coarse, off > 0.05, "{around} {refine}: {off}");
            let most = if coarse { Verdict::Poor } else { Verdict::Fair };
            assert!(verdict(&solution) >= most, "{around} {refine}");
        }
    }
    let circled = cylinder(
        facets(12),
        &[("refine", json!({"tolerance": 0.01})), circle()],
    );
    let exact = of(&circled).summary.normal_force;
    for (around, code) in [
        (12, WarningCode::PolygonTooCoarse),
        (60, WarningCode::PolygonInContact),
    ] {
        for refine in [json!(0), json!(2), json!({"tolerance": 0.01})] {
            let solution = of(&cylinder(facets(around), &[("refine", refine.clone())]));
            let off = (solution.summary.normal_force / exact - 1.0).abs();
            assert!(
                told(&solution, code),
                "{around} {refine}: {:?}",
                solution.summary.warnings
            );
            assert!(around == 12 || off < 0.05, "{around} {refine}: {off}");
        }
    }
}

/// Curved sides whose midside nodes are on the circle are parabolas, which refinement keeps: the peak is 1 % off that of the circle,
/// 110.14 by Lamé, and its error contains that.
#[test]
fn parabolic_sides_in_place_of_a_circle_are_in_the_error_of_the_peak() {
    let mut curved = Sector::new([20.0, 40.0], [0.0, 90.0], 16);
    curved.across = 6;
    for refine in [json!(0), json!(2), json!({"tolerance": 0.005})] {
        let mut text = ring(16, &refine, false);
        text["mesh"] = curved.mesh();
        text["mesh"]["refine"] = refine.clone();
        let solution = solve(&problem(&text.to_string()));
        let accuracy = solution.summary.accuracy.as_ref().unwrap();
        let mut all = accuracy.quantities.iter();
        let peak = all
            .find(|q| q.quantity == QuantityName::PeakNormalStress)
            .unwrap();
        let error = peak.error.unwrap();
        assert!(
            (peak.value + 110.14).abs() <= error && error < 8.0,
            "{refine}: {peak:?}"
        );
        let told = kinks(&solution);
        assert!(told.len() == 1 && told[0].contains("parabolas"), "{told:?}");
    }
}

/// Put on its circle it is the same as with sides that were curved from the start, on every mesh, and its peak is that of the
/// circle: 62.36 on much finer meshes.
#[test]
fn facets_on_their_circle_are_the_curved_body() {
    for refine in [0, 1] {
        let mut curved = facets(60);
        curved.straight = false;
        let [on_circle, curved] = [
            cylinder(facets(60), &[("refine", json!(refine)), circle()]),
            cylinder(curved, &[("refine", json!(refine)), circle()]),
        ]
        .map(|text| solve(&problem(&text.to_string())));
        assert_eq!(kinks(&on_circle), Vec::<&str>::new());
        assert_ne!(peak(&on_circle).1, ErrorMethod::NoLimit);
        // inner nodes of straight and of curved elements differ
        close(peak(&on_circle).0, peak(&curved).0, 2e-3);
        close(
            on_circle.summary.normal_force,
            curved.summary.normal_force,
            2e-4,
        );
        close(peak(&on_circle).0, -62.36, 0.02);
    }
}

/// Nodes of adaptive refinement, and of verification, lie on the circle too.
#[test]
fn all_later_nodes_lie_on_the_circle() {
    let mut coarse = facets(24);
    coarse.across = 4;
    let text = cylinder(coarse, &[("refine", json!({"tolerance": 0.003})), circle()]);
    let problem_ = problem(&text.to_string());
    let (solution, mesh) =
        solver::solve_with_mesh(&problem_, None, &mut crate::support::quiet).unwrap();
    assert!(solution.summary.refinements.len() > 2);
    for edge in &mesh.boundaries["outer"] {
        for [x, y] in mesh.edge_nodes(edge) {
            assert!((x.hypot(y) - 4.0).abs() < 1e-12, "({x}, {y})");
        }
    }
    close(peak(&solution).0, -62.36, 0.03);
    let mut verified = cylinder(coarse, &[circle()]);
    verified["solver"] = json!({"accuracy": "verify"});
    let solution = solve(&problem(&verified.to_string()));
    let known = solution.summary.accuracy.unwrap();
    assert_eq!(known.verified, Some(true), "{known:#?}");
}

/// A spline through the corners is as good as the circle.
#[test]
fn facets_on_a_spline_have_no_corners() {
    let spline = json!({"outer": {"kind": "spline"}});
    let text = cylinder(facets(60), &[("curves", spline), ("refine", json!(1))]);
    let solution = solve(&problem(&text.to_string()));
    assert_eq!(kinks(&solution), Vec::<&str>::new());
    close(peak(&solution).0, -62.36, 0.02);
}

/// The nodes of adaptive meshes lie on the spline too, however often elements are divided from one mesh to the next.
#[test]
fn adaptive_meshes_follow_a_spline() {
    let spline = json!({"outer": {"kind": "spline"}});
    let refine = json!({"tolerance": 0.002});
    let mut sector = facets(60);
    sector.across = 10;
    let text = cylinder(sector, &[("curves", spline), ("refine", refine)]);
    let solution = solve(&problem(&text.to_string()));
    assert!(solution.summary.refinements.len() > 1);
    assert_eq!(kinks(&solution), Vec::<&str>::new());
    close(peak(&solution).0, -62.36, 0.15);
    // on a circle, a spline through points every 2° differs from it by less than 1e-6 of the radius
    let (fields, profile) = (&solution.fields, &solution.profiles["outer"]);
    let on_arc = |i: usize| profile.x[i].hypot(profile.y[i]);
    let off = (0..profile.x.len())
        .map(|i| (on_arc(i) - 4.0).abs())
        .fold(0.0, f64::max);
    assert!(profile.x.len() > 2 * 60 + 1 && fields.x.len() > profile.x.len());
    assert!(off < 4e-6, "{off:e}");
}

/// The smooth body itself has no corners: nothing is said, whatever its elements.
#[test]
fn a_curved_body_has_no_corners() {
    for (around, triangles) in [(12, false), (30, true), (60, false)] {
        let mut sector = facets(around);
        (sector.straight, sector.triangles) = (false, triangles);
        let solution = solve(&problem(&cylinder(sector, &[]).to_string()));
        assert_eq!(kinks(&solution), Vec::<&str>::new());
        assert_ne!(peak(&solution).1, ErrorMethod::NoLimit);
    }
}

/// A node that is not on the circle is refused by name, like anything else that cannot be put on a curve.
#[test]
fn a_boundary_that_is_not_on_its_curve_is_refused() {
    let refused = |curves: Value, around: usize, across: usize| {
        let mut sector = facets(around);
        sector.across = across;
        let text = cylinder(sector, &[("curves", curves)]);
        let mut found = Model::new(&problem(&text.to_string()), None).unwrap_err();
        found.remove(0)
    };
    let circle =
        |radius: f64| json!({"outer": {"kind": "circle", "center": [0, 0], "radius": radius}});
    let off = refused(circle(4.01), 60, 8);
    assert_eq!(
        (off.reason, &off.pointer[..]),
        (Reason::Conflict, "/mesh/curves/outer")
    );
    assert!(off.got.contains("1.000e-2 from the circle"), "{}", off.got);
    assert!(off.expected.contains("4.010e-4"), "{}", off.expected);
    let unknown = refused(json!({"other": {"kind": "spline"}}), 60, 8);
    assert_eq!(unknown.reason, Reason::UnknownBoundary);
    let half = refused(json!({"outer": {"kind": "circle", "radius": 4}}), 60, 8);
    assert_eq!(half.reason, Reason::Missing);
    let none = refused(circle(0.0), 60, 8);
    assert_eq!(none.reason, Reason::OutOfRange);
    let spline = refused(json!({"outer": {"kind": "spline", "radius": 4}}), 60, 8);
    assert_eq!(spline.reason, Reason::NotUsed);
    // sides of 60° turn too sharply for a spline
    let turns = refused(json!({"outer": {"kind": "spline"}}), 2, 1);
    assert_eq!(turns.reason, Reason::TurnsCorner);
    // the inner circle moves into the first row of elements: 2 of them around, thinner than its bow
    let mut thin = Sector::new([3.9, 4.0], [-150.0, -30.0], 2);
    (thin.straight, thin.across) = (true, 1);
    let inner = json!({"outer": {"kind": "circle", "center": [0, 0], "radius": 4}, "inner": {"kind": "circle", "center": [0, 0], "radius": 3.9}});
    assert!(
        Model::new(
            &problem(&cylinder(thin, &[("curves", inner)]).to_string()),
            None
        )
        .is_ok()
    );
    // an inner boundary that bows outwards, alone
    let inner = json!({"inner": {"kind": "circle", "center": [0, 0], "radius": 3.9}});
    let found = Model::new(
        &problem(&cylinder(thin, &[("curves", inner)]).to_string()),
        None,
    )
    .unwrap_err();
    assert_eq!(found[0].reason, Reason::InvertedElement);
}

/// A bore of straight facets around a pin: its corners point into the body, where the pin does not reach. They are told; on the
/// circle there are none. And an obstacle that follows the body's surface at a distance has the body's corners: none counts.
#[test]
fn reentrant_corners_are_reported() {
    let pin: Vec<[f64; 2]> = (0..=120)
        .map(|k| (k as f64 - 150.0).to_radians())
        .map(|angle| [3.9 * angle.cos(), 3.9 * angle.sin() - 0.1])
        .collect();
    let mut bore = Sector::new([4.0, 8.0], [-150.0, -30.0], 30);
    (bore.across, bore.straight) = (10, true);
    let told = |bore: Sector, obstacle: Value, indentation: f64, changes: &[(&str, Value)]| {
        let mut text = cylinder(bore, changes);
        text["supports"] = json!([{"boundary": "outer", "ux": 0, "uy": 0}]);
        text["contacts"][0]["boundary"] = json!("inner");
        text["contacts"][0]["obstacle"] = obstacle;
        text["contacts"][0]["indentation"] = json!(indentation);
        let solution = solve(&problem(&text.to_string()));
        assert!(solution.summary.normal_force > 0.0);
        kinks(&solution).join("\n")
    };
    let round = json!({"kind": "polyline", "points": pin, "interpolation": "cubic"});
    let facets = told(bore, round.clone(), 0.05, &[]);
    assert!(
        facets.contains("is a polygon") && facets.contains("turns by up to 4.00°"),
        "{facets}"
    );
    // a single corner is no polygon
    (bore.angles, bore.around) = ([-120.0, -60.0], 2);
    let single = told(bore, round.clone(), 0.15, &[("refine", json!(2))]);
    assert!(
        single.contains("has a reentrant corner in the contact") && single.contains("-30.00°"),
        "{single}"
    );
    (bore.angles, bore.around) = ([-150.0, -30.0], 30);
    let circle = json!({"inner": {"kind": "circle", "center": [0, 0], "radius": 4}});
    assert_eq!(told(bore, round, 0.05, &[("curves", circle)]), "");
    assert_eq!(told(bore, json!({"kind": "flat"}), 0.05, &[]), "");
}
