//! σ_n and σ_t along contact boundaries, as thesis figs 4.3 … 4.16.

use std::collections::BTreeMap;
use std::ops::Range;

use super::figure::{Curve, LineStyle, Panel, figure};
use super::page::{self, with_unit};
use super::theme::Theme;
use solver::error::shortened;
use solver::problem::{Contact, Problem};
use solver::solution::{Accuracy, ContactProfile};

/// For each contact boundary: σ_n above, and where there is friction σ_t with its bound ±τ below, against arc
/// length. Stresses are negative in compression. Under the title is the verdict on the accuracy, where there is one. `Err`: the reason why a figure could not be drawn.
pub fn profile_svg(
    theme: Theme,
    problem: &Problem,
    profiles: &BTreeMap<String, ContactProfile>,
    accuracy: Option<&Accuracy>,
) -> Result<String, String> {
    if profiles.is_empty() {
        return Err("there is no contact boundary to draw".to_owned());
    }
    let panels: Vec<Panel> = profiles
        .iter()
        .flat_map(|(name, profile)| panels(problem, name, profile))
        .collect();
    let title = problem.title.as_deref().unwrap_or("Contact stresses");
    figure(theme, title, page::verdict(accuracy).as_deref(), &panels)
}

fn panels(problem: &Problem, name: &str, profile: &ContactProfile) -> Vec<Panel> {
    let shown = stressed(profile);
    let curve = |label: &str, style: LineStyle, values: &[f64]| Curve {
        label: label.to_owned(),
        style,
        points: shown.clone().map(|i| (profile.s[i], values[i])).collect(),
    };
    let opposite: Vec<f64> = profile.friction_bound.iter().map(|tau| -tau).collect();
    let panel = |curves: Vec<Curve>| Panel {
        x: with_unit(
            &format!("arc length s along `{}`", shortened(name, 40)),
            page::length(&problem.units),
        ),
        y: with_unit("stress", page::stress(&problem.units)),
        curves,
        ..Panel::default()
    };
    let normal = vec![curve("σ_n", LineStyle::Line(0), &profile.normal_stress)];
    let tangential = vec![
        curve(
            "±τ, friction bound",
            LineStyle::Reference,
            &profile.friction_bound,
        ),
        curve("", LineStyle::Reference, &opposite),
        curve("σ_t", LineStyle::Line(1), &profile.tangential_stress),
    ];
    let rough = |contact: &Contact| contact.boundary == name && contact.friction.is_some();
    match problem.contacts.iter().any(rough) {
        true => vec![panel(normal), panel(tangential)],
        false => vec![panel(normal)],
    }
}

/// The nodes under stress and a margin of a fifth on each side: a contact is often a small part of
/// the boundary that faces the obstacle. All nodes where nothing is under stress.
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
            normal_stress: vec![-1.0, -2.0, -4.0],
            tangential_stress: vec![0.0, 0.3, 0.5],
            friction_bound: vec![0.3, 0.6, 1.2],
            ..ContactProfile::default()
        };
        let two = BTreeMap::from([
            ("left".to_owned(), profile.clone()),
            ("top".to_owned(), profile),
        ]);
        let mut problem = problem();
        let smooth = profile_svg(Theme::Light, &problem, &two, None).unwrap();
        let mut left = problem.contacts[0].clone();
        left.boundary = "left".into();
        problem.contacts.push(left);
        let svg = profile_svg(Theme::Light, &problem, &two, None).unwrap();
        assert_eq!(svg.matches("±τ").count(), 2);
        assert_eq!(smooth.matches("±τ").count(), 1, "no friction, no bound");
        assert!(svg.starts_with("<svg") && svg.contains("Punch") && svg.contains("`left` [mm]"));
        assert!(svg.contains("stress [MPa]"));
        assert!(svg.matches("<polyline").count() >= 8);
        let flat = ContactProfile {
            s: vec![0.0, 1.0],
            normal_stress: vec![0.0; 2],
            tangential_stress: vec![0.0; 2],
            friction_bound: vec![0.0; 2],
            ..ContactProfile::default()
        };
        let flat = BTreeMap::from([("top".to_owned(), flat)]);
        assert!(profile_svg(Theme::Dark, &problem, &flat, None).is_ok());
        assert!(profile_svg(Theme::Light, &problem, &BTreeMap::new(), None).is_err());
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
