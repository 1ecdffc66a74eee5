//! The five examples of thesis chapter 4 at thesis size and refined, with their figures.

use std::f64::consts::PI;
use std::fmt::Write;
use std::path::Path;

use files::plot::{Caption, Curve, LineStyle, Panel, Theme, figure};
use solver::problem::{AdaptiveRefine, BoundaryValue, Obstacle, Problem, Refine};
use solver::solution::{ContactProfile, Solution, Summary};

use crate::table::digits;

/// Name, number in the thesis, nonlocal radii of its figure, and what follows from them.
pub(crate) const EXAMPLES: [(&str, &str, [f64; 3]); 5] = [
    ("rectangular_punch", "4.1(i), fig 4.3", [0.008, 0.01, 0.015]),
    ("cylinder", "4.1(ii), fig 4.6", [0.01, 0.03, 0.05]),
    ("annular_punch", "4.2(i), fig 4.9", [0.02, 0.05, 0.13]),
    ("cylinder_on_end", "4.2(ii), fig 4.12", [0.008, 0.01, 0.015]),
    ("sheet", "4.3, fig 4.16", [0.01, 0.05, 0.1]),
];

pub(crate) fn example(name: &str) -> Problem {
    files::parse(&suite::example(name)).unwrap()
}

pub(crate) fn solve(problem: &Problem) -> Solution {
    solver::solve(problem, &mut ()).unwrap()
}

pub(crate) fn refined(name: &str, problem: &Problem) -> Problem {
    let mut problem = problem.clone();
    problem.mesh.refine = match name {
        // its taper is no axis of the grid: split evenly
        "sheet" => Refine::Times(3),
        _ => Refine::Adaptive(AdaptiveRefine { tolerance: 0.005 }),
    };
    problem
}

/// The same with another nonlocal radius; 0.4 is the larger pull of the sheet, whose contact shows.
pub(crate) fn with_radius(name: &str, radius: f64) -> Problem {
    let mut problem = example(name);
    problem.contacts[0]
        .friction
        .as_mut()
        .unwrap()
        .nonlocal_radius = Some(radius);
    if name == "sheet" {
        problem.supports[1].ux = Some(BoundaryValue::Constant(0.4));
    }
    problem
}

pub(crate) fn section(figures: &Path) -> String {
    let mut out = String::from(
        "## The five examples\n\nMeshes of the thesis's size (dimensions are ours: its figures are lost) and refined: examples 1 to 4 by\n`refine: {\"tolerance\": 0.005}`, the sheet (pull .4) by three halvings. *Slips* is the part of the contact with\n|u_t| > ε. The thesis finds \"no gross sliding\" in example 1; here the punch slips on a\nfifth of its width.\n\n| example | ρ | mesh | Y | T | ∫\\|σ_t\\| | peak σ_t | slips | accuracy | warnings |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for (name, _, radii) in EXAMPLES {
        for radius in radii {
            let coarse = with_radius(name, radius);
            for (mesh, problem) in [
                ("thesis", coarse.clone()),
                ("refined", refined(name, &coarse)),
            ] {
                let summary = solve(&problem).summary;
                out += &line(name, radius, mesh, &summary);
            }
        }
    }
    out.push('\n');
    for (name, place, radii) in EXAMPLES {
        writeln!(out, "### {} (thesis {place})\n", name.replace('_', " ")).unwrap();
        for mesh in ["thesis", "refined"] {
            let svg = stresses(name, mesh, &radii);
            let file = format!("{name}_{mesh}.svg");
            std::fs::write(figures.join(&file), svg).unwrap();
            writeln!(out, "![{name}, {mesh} mesh](figures/verification/{file})\n").unwrap();
        }
    }
    std::fs::write(figures.join("sheet_gauss_row.svg"), gauss_row()).unwrap();
    out += "As thesis fig 4.15, σ_n along the row of Gauss points nearest the free edge, thesis mesh:\n\n![sheet, row of Gauss points](figures/verification/sheet_gauss_row.svg)\n\n";
    out
}

fn line(name: &str, radius: f64, mesh: &str, summary: &Summary) -> String {
    let contact = summary.contacts.values().next().unwrap();
    let width = |list: &[[f64; 2]]| list.iter().map(|[a, b]| b - a).sum::<f64>();
    let slips = match width(&contact.contact) {
        0.0 => "–".to_owned(),
        all => format!("{:.0} %", 100.0 * width(&contact.slip) / all),
    };
    let peak = contact.peak_tangential_stress.map_or(0.0, |p| p.value);
    let mut codes: Vec<&str> = summary.warnings.iter().map(|w| w.code.as_str()).collect();
    codes.dedup();
    let verdict: &str = summary
        .accuracy
        .as_ref()
        .map_or("–", |accuracy| accuracy.verdict.into());
    format!(
        "| {} | {radius} | {mesh}, {} unknowns | {} | {} | {} | {} | {slips} | {verdict} | {} |\n",
        name.replace('_', " "),
        summary.dofs,
        digits(summary.normal_force),
        digits(summary.tangential_force),
        digits(summary.friction_force),
        digits(peak),
        codes.join(", ")
    )
}

fn curve(label: impl Into<String>, style: LineStyle, points: Vec<(f64, f64)>) -> Curve {
    let label = label.into();
    Curve {
        label,
        style,
        points,
    }
}

/// The obstacle's own part of a profile, with a margin: a contact is often a small part of it.
fn shown(profile: &ContactProfile) -> std::ops::Range<usize> {
    let pressed = |i: &usize| profile.normal_stress[*i] != 0.0 || profile.friction_bound[*i] != 0.0;
    let (first, last) = (
        (0..profile.s.len()).find(pressed),
        (0..profile.s.len()).rfind(pressed),
    );
    match (first, last) {
        (Some(first), Some(last)) => first.saturating_sub(1)..(last + 2).min(profile.s.len()),
        _ => 0..profile.s.len(),
    }
}

/// −πσ_n/2Y with the frictionless closed form above, σ_t for several ρ below.
fn stresses(name: &str, mesh: &str, radii: &[f64]) -> String {
    let solve_on = |problem: Problem| {
        let problem = if mesh == "refined" {
            refined(name, &problem)
        } else {
            problem
        };
        solve(&problem)
    };
    let mut frictionless = with_radius(name, radii[1]);
    frictionless.contacts[0].friction = None;
    let plain = solve_on(frictionless.clone());
    let boundary = frictionless.contacts[0].boundary.clone();
    let place = |profile: &ContactProfile, i: usize| {
        if name == "sheet" {
            profile.s[i]
        } else {
            profile.x[i]
        }
    };
    let scaled = |solution: &Solution| -> Vec<(f64, f64)> {
        let (profile, y) = (&solution.profiles[&boundary], solution.summary.normal_force);
        shown(profile)
            .map(|i| {
                (
                    place(profile, i),
                    -PI * profile.normal_stress[i] / (2.0 * y),
                )
            })
            .collect()
    };
    let mut normal = vec![curve("frictionless", LineStyle::Points(2), scaled(&plain))];
    if let Some(points) = closed_form(&frictionless, &plain.summary) {
        normal.insert(
            0,
            curve(
                "closed form, frictionless half-space",
                LineStyle::Reference,
                points,
            ),
        );
    }
    let mut tangential = Vec::new();
    for (k, &radius) in radii.iter().enumerate() {
        let solution = solve_on(with_radius(name, radius));
        if k == 1 {
            normal.push(curve(
                format!("ρ = {radius}, μ = .3"),
                LineStyle::Line(0),
                scaled(&solution),
            ));
        }
        let profile = &solution.profiles[&boundary];
        let points = shown(profile).map(|i| (place(profile, i), profile.tangential_stress[i]));
        tangential.push(curve(
            format!("ρ = {radius}"),
            LineStyle::Marked([0, 1, 3][k]),
            points.collect(),
        ));
    }
    let x = match name {
        "sheet" => "arc length s along the taper",
        "annular_punch" | "cylinder_on_end" => "r",
        _ => "x",
    };
    let title = format!(
        "{}, {mesh} mesh",
        frictionless.title.clone().unwrap_or_default()
    );
    let caption = Caption {
        title,
        ..Caption::default()
    };
    figure(
        Theme::Light,
        &caption,
        &[
            Panel {
                x: x.to_owned(),
                y: "−πσ_n / 2Y".to_owned(),
                curves: normal,
                ..Panel::default()
            },
            Panel {
                x: x.to_owned(),
                y: "σ_t".to_owned(),
                curves: tangential,
                ..Panel::default()
            },
        ],
    )
    .unwrap()
}

/// −πσ_n/2Y of the frictionless half-space, where there is a closed form; Y as of the model (half of
/// the load in the plane).
fn closed_form(problem: &Problem, summary: &Summary) -> Option<Vec<(f64, f64)>> {
    let e_star = 1000.0 / 0.91;
    let even = |a: f64, f: &dyn Fn(f64) -> f64| {
        (0..=99)
            .map(|k| a * f64::from(k) / 100.0)
            .map(|x| (x, f(x)))
            .collect()
    };
    match (problem.contacts[0].obstacle.as_ref()?, problem.analysis) {
        (
            Obstacle::Flat {
                to: Some(a),
                from: Some(0.0),
                ..
            },
            solver::problem::Analysis::PlaneStrain {},
        ) => Some(even(*a, &|x| 1.0 / (a * a - x * x).sqrt())),
        (
            Obstacle::Flat {
                to: Some(a),
                from: Some(0.0),
                ..
            },
            solver::problem::Analysis::Axisymmetric {},
        ) => Some(even(*a, &|r| 1.0 / (4.0 * a * (a * a - r * r).sqrt()))),
        (Obstacle::Circle { radius, .. }, _) => {
            let a = (8.0 * summary.normal_force * radius / (PI * e_star)).sqrt();
            Some(even(a, &|x| 2.0 * (a * a - x * x).sqrt() / (a * a)))
        }
        _ => None,
    }
}

/// σ_n, normal to the free edge, at the Gauss points nearest to it, for both pulls.
fn gauss_row() -> String {
    let curves = [(0.2, 0), (0.4, 1)].map(|(pull, k)| {
        let mut problem = example("sheet");
        problem.supports[1].ux = Some(BoundaryValue::Constant(pull));
        let solution = solve(&problem);
        let gauss = &solution.fields.gauss;
        let order = gauss.order as usize;
        let columns = problem.mesh.grid().unwrap().x.len() - 1;
        let elements = solution.fields.elements.len();
        let mut points = Vec::new();
        for e in elements - columns..elements {
            for p in 0..order {
                let place = e * order * order + (order - 1) * order + p;
                let x = gauss.x[place];
                // the taper falls from 1 to .5 between x = 1 and 3
                let slope: f64 = if (1.0..=3.0).contains(&x) { -0.25 } else { 0.0 };
                let length = slope.hypot(1.0);
                let (nx, ny) = (-slope / length, 1.0 / length);
                let stress = gauss.stress_xx[place] * nx * nx
                    + 2.0 * gauss.stress_xy[place] * nx * ny
                    + gauss.stress_yy[place] * ny * ny;
                points.push((x, stress));
            }
        }
        curve(format!("pull {pull}"), LineStyle::Marked(k), points)
    });
    let panel = Panel {
        x: "x".to_owned(),
        y: "σ_n".to_owned(),
        curves: curves.to_vec(),
        ..Panel::default()
    };
    let caption = Caption {
        title: "Thin sheet, row of Gauss points nearest the free edge".to_owned(),
        ..Caption::default()
    };
    figure(Theme::Light, &caption, &[panel]).unwrap()
}
