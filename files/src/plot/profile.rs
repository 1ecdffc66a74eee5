//! The figure of σ_n and σ_t along contact boundaries, as in thesis figs 4.3 … 4.16.

use std::collections::BTreeMap;
use std::ops::Range;

use super::axis::{CUT, limits, named_peak};
use super::body::coordinates;
use super::caption::Caption;
use super::figure::{Above, Curve, LineStyle, Panel, Scale, Shade, ShadeKind, figure};
use super::numbers::{number, rounded};
use super::page::{self, with_unit};
use super::style::Style;
use solver::error::shortened;
use solver::problem::{Contact, Problem};
use solver::solution::{ContactProfile, ErrorMethod, NodeState, QuantityName, Summary};

/// Draws for each contact boundary σ_n, and below it, if there is friction, σ_t with its bound ±τ, against arc length
/// and position, with the parts in stick and slip shaded. Stresses are negative in compression.
///
/// # Errors
///
/// The reason in words, if the figure cannot be drawn.
pub fn profile_svg(
    style: Style,
    caption: &Caption,
    problem: &Problem,
    profiles: &BTreeMap<String, ContactProfile>,
    summary: Option<&Summary>,
) -> Result<String, String> {
    if profiles.is_empty() {
        return Err("there is no contact boundary to draw".to_owned());
    }
    let panels: Vec<Panel> = profiles
        .iter()
        .flat_map(|(name, profile)| panels(style, problem, name, profile, summary))
        .collect();
    figure(style, caption, &panels)
}

fn panels(
    style: Style,
    problem: &Problem,
    name: &str,
    profile: &ContactProfile,
    summary: Option<&Summary>,
) -> Vec<Panel> {
    let limits = style.limits;
    let shown = match limits.x {
        Some(_) => 0..profile.s.len(),
        None => stressed(profile),
    };
    let curve = |label: &str, style: LineStyle, values: &[f64]| Curve {
        label: label.to_owned(),
        style,
        points: shown.clone().map(|i| (profile.s[i], values[i])).collect(),
    };
    let unit = page::length(&problem.units);
    let along = format!("arc length s along “{}”", shortened(name, 40));
    let along = with_unit(&along, unit);
    let stress = |name: &str| with_unit(name, page::stress(&problem.units));
    let rough = |contact: &Contact| contact.is_on(name) && contact.friction.is_some();
    let rough = problem.contacts.iter().any(rough);
    let shades = if rough {
        shades(profile, shown.clone())
    } else {
        vec![]
    };
    let normal = Panel {
        x: if rough { String::new() } else { along.clone() },
        y: stress("normal stress σ_n"),
        curves: vec![curve("", LineStyle::Line(0), &profile.normal_stress)],
        shades: shades.clone(),
        above: position(profile, coordinates(&problem.analysis), unit, shown.clone()),
        across: limits.x,
        up: limits.y,
        of_peak: of_peak(name, summary).to_owned(),
        ..Panel::default()
    };
    if !rough {
        return vec![normal];
    }
    let bound = &profile.friction_bound;
    let opposite: Vec<f64> = bound.iter().map(|tau| -tau).collect();
    // the bound on the sides where there is stress
    let reached = |sign: f64| profile.tangential_stress.iter().any(|t| sign * t > 0.0);
    let (above, below) = match (reached(1.0), reached(-1.0)) {
        (false, true) => (vec![], vec![("friction bound −τ", &opposite)]),
        (true, true) => (vec![("friction bound ±τ", bound)], vec![("", &opposite)]),
        (_, false) => (vec![("friction bound τ", bound)], vec![]),
    };
    let bounds = above.into_iter().chain(below);
    let bounds = bounds.map(|(label, values)| curve(label, LineStyle::Bound, values));
    let own = curve(
        "tangential stress σ_t",
        LineStyle::Line(1),
        &profile.tangential_stress,
    );
    let tangential = Panel {
        x: along,
        y: stress("tangential stress σ_t"),
        scale: Scale::Linear,
        curves: bounds.chain([own]).collect(),
        shades,
        across: limits.x,
        up: limits.y_below,
        ..Panel::default()
    };
    vec![normal, tangential]
}

/// The remark about the peak of σ_n, to be written after its value; empty if there is nothing to say.
fn of_peak(name: &str, summary: Option<&Summary>) -> &'static str {
    let accuracy = summary.and_then(|summary| summary.accuracy.as_ref());
    let no_limit = accuracy.is_some_and(|accuracy| {
        accuracy.quantities.iter().any(|q| {
            q.contact == name
                && q.quantity == QuantityName::PeakNormalStress
                && q.method == ErrorMethod::NoLimit
        })
    });
    if no_limit {
        ", which grows on finer meshes"
    } else {
        ""
    }
}

/// What figures show of the stresses along a contact boundary, for programs that draw σ_n and σ_t over one axis
/// themselves.
#[derive(Clone, Debug, PartialEq)]
pub struct ProfileView {
    /// The range of points under stress, with a margin on each side.
    pub points: Range<usize>,
    /// The range of the axis of stresses.
    pub stresses: Range<f64>,
    /// A sentence about the peak of σ_n, if it is cut off or grows on finer meshes.
    pub peak: Option<String>,
}

impl ProfileView {
    /// The view of the contact boundary `name`. The summary tells whether the peak has a limit as the mesh is refined.
    pub fn of(name: &str, profile: &ContactProfile, summary: Option<&Summary>) -> ProfileView {
        let points = stressed(profile);
        let curve = |values: &[f64]| -> Vec<(f64, f64)> {
            points.clone().map(|i| (profile.s[i], values[i])).collect()
        };
        let normal = curve(&profile.normal_stress);
        let tangential = curve(&profile.tangential_stress);
        let of_normal = limits(&[&normal], CUT);
        let stresses = if tangential.iter().any(|(_, stress)| *stress != 0.0) {
            let of_tangential = limits(&[&tangential], f64::INFINITY);
            of_normal.start.min(of_tangential.start)..of_normal.end.max(of_tangential.end)
        } else {
            of_normal
        };
        let of_peak = of_peak(name, summary);
        let peak = named_peak(&[&normal], &stresses, of_peak).map(|(s, peak, _)| {
            let place = format!("σ_n: peak {} at s = {}", rounded(peak), number(s));
            if stresses.contains(&peak) {
                format!("{place}{of_peak}")
            } else {
                format!("{place}{of_peak}; the axis ends before it")
            }
        });
        ProfileView {
            points,
            stresses,
            peak,
        }
    }
}

/// The parts of the boundary in stick and in slip; each ends half-way to a neighbour in another state.
fn shades(profile: &ContactProfile, shown: Range<usize>) -> Vec<Shade> {
    let kind = |i: usize| match profile.state.get(i)? {
        NodeState::Open => None,
        NodeState::Stick => Some(ShadeKind::Stick),
        NodeState::Slip => Some(ShadeKind::Slip),
    };
    let s = &profile.s;
    let middle = |i: usize, k: usize| 0.5 * (s[i] + s[k]);
    let mut shades: Vec<Shade> = Vec::new();
    for i in shown.clone() {
        let Some(kind) = kind(i) else { continue };
        let from = if i > shown.start {
            middle(i - 1, i)
        } else {
            s[i]
        };
        let to = if i + 1 < shown.end {
            middle(i, i + 1)
        } else {
            s[i]
        };
        match shades.last_mut() {
            Some(last) if last.kind == kind && last.extent[1] == from => last.extent[1] = to,
            _ => shades.push(Shade {
                kind,
                extent: [from, to],
            }),
        }
    }
    shades
}

/// A second axis for the position along the boundary: x, or y if x is not monotone along it. `None` if neither is, or
/// if the position equals s.
fn position(
    profile: &ContactProfile,
    [x, y]: [&str; 2],
    unit: Option<&str>,
    shown: Range<usize>,
) -> Option<Above> {
    let s = profile.s.get(shown.clone())?;
    let axis = |name: &str, values: &[f64]| {
        let values = values.get(shown.clone())?;
        let runs = |sign: f64| {
            values
                .windows(2)
                .all(|pair| sign * (pair[1] - pair[0]) > 0.0)
        };
        if values.len() < 2 || !(runs(1.0) || runs(-1.0)) {
            return None;
        }
        let places: Vec<(f64, f64)> = s.iter().copied().zip(values.iter().copied()).collect();
        let length = s[s.len() - 1] - s[0];
        let same = places
            .iter()
            .all(|(s, value)| (s - value).abs() <= 1e-6 * length);
        Some((!same).then(|| Above {
            name: with_unit(&format!("position {name}"), unit),
            places,
        }))
    };
    axis(x, &profile.x)
        .or_else(|| axis(y, &profile.y))
        .flatten()
}

/// The range of nodes under stress, with a margin of a fifth on each side: a contact is often a small part of the
/// boundary that faces the obstacle. All nodes if none is under stress.
fn stressed(profile: &ContactProfile) -> Range<usize> {
    let nodes = profile.s.len();
    let loaded = |&i: &usize| profile.normal_stress[i] != 0.0 || profile.friction_bound[i] != 0.0;
    let (Some(first), Some(last)) = ((0..nodes).find(loaded), (0..nodes).rfind(loaded)) else {
        return 0..nodes;
    };
    let margin = 0.2 * (profile.s[last] - profile.s[first]);
    let low = profile
        .s
        .partition_point(|s| *s < profile.s[first] - margin);
    let high = profile
        .s
        .partition_point(|s| *s <= profile.s[last] + margin);
    // one node beyond, so that the curves visibly return to zero
    low.min(first.saturating_sub(1))..high.max(last + 2).min(nodes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::tests::problem;

    #[test]
    fn a_figure_has_its_curves_also_for_a_flat_profile() {
        let profile = ContactProfile {
            s: vec![0.0, 0.5, 1.0],
            x: vec![2.0, 2.5, 3.0],
            y: vec![0.0; 3],
            normal_stress: vec![-1.0, -2.0, -4.0],
            tangential_stress: vec![-0.1, 0.3, 0.5],
            friction_bound: vec![0.3, 0.6, 1.2],
            state: vec![NodeState::Stick, NodeState::Slip, NodeState::Slip],
            ..ContactProfile::default()
        };
        let two = BTreeMap::from([
            ("left".to_owned(), profile.clone()),
            ("top".to_owned(), profile),
        ]);
        let mut problem = problem();
        let drawn = |problem: &Problem, profiles: &BTreeMap<String, ContactProfile>| {
            let caption = Caption::of_problem(problem, "Contact");
            profile_svg(Style::default(), &caption, problem, profiles, None)
        };
        let smooth = drawn(&problem, &two).unwrap();
        let mut left = problem.contacts[0].clone();
        left.boundary = "left".into();
        problem.contacts.push(left);
        let svg = drawn(&problem, &two).unwrap();
        assert_eq!(svg.matches("±τ").count(), 2);
        assert_eq!(smooth.matches("±τ").count(), 1, "no friction, no bound");
        assert!(svg.starts_with("<svg") && svg.contains("Punch") && svg.contains("“left” (mm)"));
        assert!(svg.contains("position x (mm)") && svg.contains("stick") && svg.contains("slip"));
        assert!(svg.contains(r#"σ<tspan dy="30" font-size="108">n</tspan>"#));
        assert!(svg.matches("<polyline").count() >= 6);
        let flat = ContactProfile {
            s: vec![0.0, 1.0],
            normal_stress: vec![0.0; 2],
            tangential_stress: vec![0.0; 2],
            friction_bound: vec![0.0; 2],
            ..ContactProfile::default()
        };
        let flat = BTreeMap::from([("top".to_owned(), flat)]);
        assert!(drawn(&problem, &flat).is_ok());
        assert!(drawn(&problem, &BTreeMap::new()).is_err());
    }

    #[test]
    fn a_peak_is_beyond_the_axis_and_named() {
        let mut profile = ContactProfile {
            s: (0..=100).map(f64::from).collect(),
            normal_stress: vec![-10.0; 101],
            tangential_stress: vec![3.0; 101],
            friction_bound: vec![3.0; 101],
            ..ContactProfile::default()
        };
        let flat = ProfileView::of("top", &profile, None);
        assert_eq!((flat.points.clone(), &flat.peak), (0..101, &None));
        assert!(flat.stresses.start < -10.0 && flat.stresses.end > 3.0);
        assert!(flat.stresses.start > -12.0 && flat.stresses.end < 4.0);

        profile.normal_stress[100] = -186_868.83;
        let peaked = ProfileView::of("top", &profile, None);
        assert!((-80.0..-60.0).contains(&peaked.stresses.start));
        let said = "σ_n: peak −187000 at s = 100; the axis ends before it";
        assert_eq!(peaked.peak.as_deref(), Some(said));
    }

    #[test]
    fn a_peak_without_a_limit_is_named_in_any_case() {
        let problem: Problem = serde_json::from_str(include_str!(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../examples/rectangular_punch.json"
        )))
        .unwrap();
        let solution = crate::plot::tests::solution(&problem);
        let profile = &solution.profiles["top"];
        let shown = ProfileView::of("top", profile, Some(&solution.summary));
        let peak = shown.peak.unwrap();
        assert!(peak.starts_with("σ_n: peak −"), "{peak}");
        assert!(peak.contains(", which grows on finer meshes"), "{peak}");
    }

    #[test]
    fn stick_and_slip_meet_between_the_points() {
        use NodeState::{Open, Slip, Stick};
        let profile = ContactProfile {
            s: vec![0.0, 1.0, 2.0, 4.0, 5.0],
            state: vec![Stick, Stick, Slip, Open, Slip],
            ..ContactProfile::default()
        };
        let found: Vec<[f64; 2]> = shades(&profile, 0..5).iter().map(|s| s.extent).collect();
        assert_eq!(found, [[0.0, 1.5], [1.5, 3.0], [4.5, 5.0]]);
    }

    #[test]
    fn the_position_is_shown_where_it_is_not_the_arc_length() {
        let mut profile = ContactProfile {
            s: vec![0.0, 1.0, 2.0],
            x: vec![0.0, 1.0, 2.0],
            y: vec![3.0, 3.0, 3.0],
            ..ContactProfile::default()
        };
        assert_eq!(
            position(&profile, ["x", "y"], None, 0..3).map(|above| above.name),
            None
        );
        profile.x = vec![1.0; 3];
        profile.y = vec![2.0, 1.0, 0.0];
        let name = position(&profile, ["x", "y"], Some("mm"), 0..3).map(|above| above.name);
        assert_eq!(name.as_deref(), Some("position y (mm)"));
        profile.y = vec![2.0, 1.0, 3.0];
        assert!(
            position(&profile, ["x", "y"], None, 0..3).is_none(),
            "it turns back"
        );
    }

    #[test]
    fn a_small_contact_on_a_long_boundary_fills_the_figure() {
        let mut profile = ContactProfile {
            s: (0..400).map(f64::from).collect(),
            normal_stress: vec![0.0; 400],
            friction_bound: vec![0.0; 400],
            ..ContactProfile::default()
        };
        assert_eq!(stressed(&profile), 0..400);
        profile.normal_stress[100..=110].fill(-5.0);
        assert_eq!(stressed(&profile), 98..113);
        profile.normal_stress[0] = -1.0;
        assert_eq!(stressed(&profile), 0..133);
    }
}
