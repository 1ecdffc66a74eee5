//! Figures as SVG.

use std::collections::BTreeMap;
use std::ops::Range;

use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use crate::solution::ContactProfile;

const WIDTH: u32 = 720;
/// Of the title, and of the two panels of one contact.
const HEAD: u32 = 30;
const HEIGHT: u32 = 560;
/// Height of the legend above a panel.
const LEGEND: i32 = 22;
const FONT: &str = "sans-serif";
const NORMAL: RGBColor = RGBColor(31, 78, 121);
const TANGENTIAL: RGBColor = RGBColor(192, 57, 43);
const BOUND: RGBColor = RGBColor(127, 127, 127);

/// For each contact boundary: σ_n above, σ_t with the friction bound ±τ below, against arc length,
/// as thesis figs 4.3 … 4.16. Stresses are negative in compression. `Err` says why a figure could
/// not be drawn.
pub fn profile_svg(
    title: &str,
    profiles: &BTreeMap<String, ContactProfile>,
) -> Result<String, String> {
    if profiles.is_empty() {
        return Err("there is no contact boundary to draw".to_owned());
    }
    let mut svg = String::new();
    draw(&mut svg, title, profiles).map_err(|error| error.to_string())?;
    Ok(svg)
}

fn draw(
    svg: &mut String,
    title: &str,
    profiles: &BTreeMap<String, ContactProfile>,
) -> Result<(), Box<dyn std::error::Error>> {
    let size = (WIDTH, HEAD + HEIGHT * profiles.len() as u32);
    let root = SVGBackend::with_string(svg, size).into_drawing_area();
    root.fill(&WHITE)?;
    let pages = root
        .titled(title, (FONT, 20))?
        .split_evenly((profiles.len(), 1));
    for ((name, profile), page) in profiles.iter().zip(pages) {
        let (above, below) = page.split_vertically(HEIGHT / 2);
        let shown = stressed(profile);
        let curve = |label, color, width, values: Vec<f64>| Curve {
            label,
            color,
            width,
            points: profile.s.iter().copied().zip(values).collect::<Vec<_>>()[shown.clone()]
                .to_vec(),
        };
        let opposite = profile.friction_bound.iter().map(|tau| -tau).collect();
        panel(
            &above,
            name,
            &[curve("σ_n", NORMAL, 2, profile.normal_stress.clone())],
        )?;
        panel(
            &below,
            name,
            &[
                curve(
                    "±τ, friction bound",
                    BOUND,
                    1,
                    profile.friction_bound.clone(),
                ),
                curve("", BOUND, 1, opposite),
                curve("σ_t", TANGENTIAL, 2, profile.tangential_stress.clone()),
            ],
        )?;
    }
    root.present()?;
    Ok(())
}

struct Curve {
    label: &'static str,
    color: RGBColor,
    points: Vec<(f64, f64)>,
    width: u32,
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
    // one node beyond, so that the curves are seen to return to zero
    low.min(first.saturating_sub(1))..high.max(last + 2).min(nodes)
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

fn panel(
    area: &Area<'_>,
    boundary: &str,
    curves: &[Curve],
) -> Result<(), Box<dyn std::error::Error>> {
    let limit = readable_limit(curves);
    let (head, body) = area.split_vertically(LEGEND);
    let places = curves
        .iter()
        .flat_map(|curve| curve.points.iter().map(|p| p.0));
    let values = curves
        .iter()
        .flat_map(|curve| curve.points.iter().map(|p| p.1.clamp(-limit, limit)));
    let mut chart: ChartContext<'_, _, Cartesian2d<RangedCoordf64, RangedCoordf64>> =
        ChartBuilder::on(&body)
            .margin(10)
            .x_label_area_size(42)
            .y_label_area_size(70)
            .build_cartesian_2d(extent(places, 0.0), extent(values, 0.06))?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(RGBColor(225, 225, 225))
        .axis_style(RGBColor(90, 90, 90))
        .x_desc(format!("arc length s along `{boundary}`"))
        .y_desc("stress")
        .x_label_formatter(&|value| number(*value))
        .y_label_formatter(&|value| number(*value))
        .label_style((FONT, 14))
        .draw()?;
    for curve in curves {
        let points = curve.points.iter().map(|p| (p.0, p.1.clamp(-limit, limit)));
        chart.draw_series(LineSeries::new(
            points,
            curve.color.stroke_width(curve.width),
        ))?;
    }
    legend(&head, curves, limit)
}

/// A line of samples above the panel, where it hides nothing.
fn legend(area: &Area<'_>, curves: &[Curve], limit: f64) -> Result<(), Box<dyn std::error::Error>> {
    let mut x = 80;
    for curve in curves.iter().filter(|curve| !curve.label.is_empty()) {
        let peak = curve
            .points
            .iter()
            .map(|p| p.1)
            .fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
        let cut = if peak.abs() > limit {
            format!(" (cut off, peak {})", number(peak))
        } else {
            String::new()
        };
        let text = format!("{}{cut}", curve.label);
        let style = curve.color.stroke_width(curve.width);
        area.draw(&PathElement::new(
            [(x, LEGEND / 2), (x + 22, LEGEND / 2)],
            style,
        ))?;
        area.draw(&Text::new(
            text.clone(),
            (x + 28, LEGEND / 2 - 7),
            (FONT, 14),
        ))?;
        x += 28 + 8 * text.chars().count() as i32 + 24;
    }
    Ok(())
}

/// A number for an axis: at most six digits, without trailing zeros.
fn number(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e6).contains(&value.abs()) {
        return format!("{value:.3e}");
    }
    let digits = 5 - (value.abs().max(1.0).log10().floor() as usize).min(5);
    let text = format!("{value:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// The largest |stress| that is drawn. At a sharp edge one node may dwarf all others, and has no
/// mesh limit: what exceeds the value that 97 % of the contact stays below is cut off at twice that.
fn readable_limit(curves: &[Curve]) -> f64 {
    let mut pieces: Vec<(f64, f64)> = Vec::new(); // |stress|, length
    for curve in curves {
        for pair in curve.points.windows(2) {
            pieces.push((pair[0].1.abs().max(pair[1].1.abs()), pair[1].0 - pair[0].0));
        }
    }
    pieces.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole: f64 = pieces.iter().map(|p| p.1).sum();
    let mut length = 0.0;
    for &(stress, piece) in &pieces {
        length += piece;
        if length > 0.97 * whole {
            let largest = pieces[pieces.len() - 1].0;
            return if largest > 3.0 * stress {
                2.0 * stress
            } else {
                largest
            };
        }
    }
    f64::INFINITY
}

/// From the least to the largest value, zero included where a margin is asked for; never empty.
fn extent(values: impl Iterator<Item = f64> + Clone, margin: f64) -> Range<f64> {
    let base = if margin > 0.0 {
        (0.0, 0.0)
    } else {
        (f64::INFINITY, f64::NEG_INFINITY)
    };
    let (low, high) = values.fold(base, |(low, high), v| (low.min(v), high.max(v)));
    let pad = margin * (high - low);
    if low < high {
        low - pad..high + pad
    } else {
        low - 1.0..low + 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_holds_its_curves_and_survives_a_flat_profile() {
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
        let svg = profile_svg("Punch", &two).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("Punch") && svg.contains("`left`"));
        assert!(svg.matches("<polyline").count() >= 8);
        let flat = ContactProfile {
            s: vec![0.0, 1.0],
            normal_stress: vec![0.0; 2],
            tangential_stress: vec![0.0; 2],
            friction_bound: vec![0.0; 2],
            ..ContactProfile::default()
        };
        assert!(profile_svg("", &BTreeMap::from([("top".to_owned(), flat)])).is_ok());
        assert!(profile_svg("", &BTreeMap::new()).is_err());
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

    #[test]
    fn axis_numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (0.1 + 0.2, "0.3"),
            (-11507.26, "-11507.3"),
            (250.0, "250"),
            (1e-9, "1.000e-9"),
            (2.5e7, "2.500e7"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
