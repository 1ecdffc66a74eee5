//! Figures as SVG.

use std::ops::Range;

use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use crate::solution::ContactProfile;

const SIZE: (u32, u32) = (720, 560);
const FONT: &str = "sans-serif";
const NORMAL: RGBColor = RGBColor(31, 78, 121);
const TANGENTIAL: RGBColor = RGBColor(192, 57, 43);
const BOUND: RGBColor = RGBColor(127, 127, 127);

/// σ_n above, σ_t with the friction bound ±τ below, against arc length, as thesis figs 4.3 … 4.16.
///
/// Stresses are negative in compression. `Err` says why a figure could not be drawn.
pub fn profile_svg(title: &str, profile: &ContactProfile) -> Result<String, String> {
    let mut svg = String::new();
    draw(&mut svg, title, profile).map_err(|error| error.to_string())?;
    Ok(svg)
}

fn draw(
    svg: &mut String,
    title: &str,
    profile: &ContactProfile,
) -> Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let root = root.titled(title, (FONT, 20))?;
    let (above, below) = root.split_vertically(270);
    let points = |values: &[f64]| {
        profile
            .s
            .iter()
            .copied()
            .zip(values.iter().copied())
            .collect::<Vec<_>>()
    };
    let opposite: Vec<f64> = profile.friction_bound.iter().map(|tau| -tau).collect();
    panel(
        &above,
        profile,
        "stress",
        &[Curve {
            label: "σ_n",
            color: NORMAL,
            points: points(&profile.normal_stress),
            width: 2,
        }],
    )?;
    panel(
        &below,
        profile,
        "stress",
        &[
            Curve {
                label: "±τ, friction bound",
                color: BOUND,
                points: points(&profile.friction_bound),
                width: 1,
            },
            Curve {
                label: "",
                color: BOUND,
                points: points(&opposite),
                width: 1,
            },
            Curve {
                label: "σ_t",
                color: TANGENTIAL,
                points: points(&profile.tangential_stress),
                width: 2,
            },
        ],
    )?;
    root.present()?;
    Ok(())
}

struct Curve {
    label: &'static str,
    color: RGBColor,
    points: Vec<(f64, f64)>,
    width: u32,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

fn panel(
    area: &Area<'_>,
    profile: &ContactProfile,
    unit: &str,
    curves: &[Curve],
) -> Result<(), Box<dyn std::error::Error>> {
    let values = || {
        curves
            .iter()
            .flat_map(|curve| curve.points.iter().map(|p| p.1))
    };
    let mut chart: ChartContext<'_, _, Cartesian2d<RangedCoordf64, RangedCoordf64>> =
        ChartBuilder::on(area)
            .margin(10)
            .x_label_area_size(42)
            .y_label_area_size(70)
            .build_cartesian_2d(
                extent(profile.s.iter().copied(), 0.0),
                extent(values(), 0.06),
            )?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(RGBColor(225, 225, 225))
        .axis_style(RGBColor(90, 90, 90))
        .x_desc("arc length s along the contact")
        .y_desc(unit)
        .label_style((FONT, 14))
        .draw()?;
    for curve in curves {
        let style = curve.color.stroke_width(curve.width);
        let line = chart.draw_series(LineSeries::new(curve.points.iter().copied(), style))?;
        if !curve.label.is_empty() {
            line.label(curve.label)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 22, y)], style));
        }
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerLeft)
        .background_style(WHITE)
        .border_style(RGBColor(200, 200, 200))
        .label_font((FONT, 14))
        .draw()?;
    Ok(())
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
        let svg = profile_svg("Punch", &profile).unwrap();
        assert!(
            svg.starts_with("<svg")
                && svg.contains("Punch")
                && svg.matches("<polyline").count() >= 4
        );
        let flat = ContactProfile {
            s: vec![0.0, 1.0],
            normal_stress: vec![0.0; 2],
            tangential_stress: vec![0.0; 2],
            friction_bound: vec![0.0; 2],
            ..ContactProfile::default()
        };
        assert!(profile_svg("", &flat).is_ok());
    }
}
