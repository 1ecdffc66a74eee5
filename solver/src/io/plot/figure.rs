//! Panels of curves over one another, drawn as SVG.

use std::ops::Range;

use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

const WIDTH: u32 = 720;
/// Of the title, and of each panel.
const HEAD: u32 = 30;
const PANEL: u32 = 280;
/// Height of one line of the legend above a panel.
const LEGEND: i32 = 22;
const FONT: &str = "sans-serif";

/// Colours of curves, told apart also by who sees no red or green, and darkest first.
const COLOURS: [RGBColor; 6] = [
    RGBColor(31, 78, 121),
    RGBColor(192, 57, 43),
    RGBColor(230, 159, 0),
    RGBColor(0, 142, 115),
    RGBColor(86, 160, 213),
    RGBColor(150, 85, 150),
];
const GREY: RGBColor = RGBColor(127, 127, 127);

/// How a curve looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// A line in one of six colours, counted from 0.
    Line(usize),
    /// A thin grey line: a bound, a reference.
    Reference,
    /// Small circles in one of the colours: single values.
    Points(usize),
}

/// One curve.
#[derive(Clone, Debug)]
pub struct Curve {
    /// In the legend; empty: not there.
    pub label: String,
    /// How it looks.
    pub look: Look,
    /// In order of x.
    pub points: Vec<(f64, f64)>,
}

/// One pair of axes.
#[derive(Clone, Debug)]
pub struct Panel {
    /// What x is.
    pub x: String,
    /// What y is.
    pub y: String,
    /// Drawn in this order.
    pub curves: Vec<Curve>,
}

/// Panels below one another under a title. `Err` says why the figure could not be drawn.
pub fn figure(title: &str, panels: &[Panel]) -> Result<String, String> {
    if panels
        .iter()
        .all(|panel| panel.curves.iter().all(|c| c.points.is_empty()))
    {
        return Err("there is nothing to draw".to_owned());
    }
    let mut svg = String::new();
    draw(&mut svg, title, panels).map_err(|error| error.to_string())?;
    Ok(svg)
}

fn draw(svg: &mut String, title: &str, panels: &[Panel]) -> Result<(), Box<dyn std::error::Error>> {
    let heads: Vec<u32> = panels
        .iter()
        .map(|p| LEGEND as u32 * rows(p) as u32)
        .collect();
    let size = (
        WIDTH,
        HEAD + heads
            .iter()
            .map(|head| head + PANEL - LEGEND as u32)
            .sum::<u32>(),
    );
    let root = SVGBackend::with_string(svg, size).into_drawing_area();
    root.fill(&WHITE)?;
    let mut rest = root.titled(title, (FONT, 18))?;
    for (panel, head) in panels.iter().zip(heads) {
        let (page, below) = rest.split_vertically(head + PANEL - LEGEND as u32);
        rest = below;
        draw_panel(&page, panel)?;
    }
    root.present()?;
    Ok(())
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

fn draw_panel(area: &Area<'_>, panel: &Panel) -> Result<(), Box<dyn std::error::Error>> {
    let limit = readable_limit(&panel.curves);
    let (head, body) = area.split_vertically(LEGEND * rows(panel));
    let all = panel.curves.iter().flat_map(|curve| &curve.points);
    let places = all.clone().map(|p| p.0);
    let values = all.map(|p| p.1.clamp(-limit, limit));
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
        .x_desc(&panel.x)
        .y_desc(&panel.y)
        .x_label_formatter(&|value| number(*value))
        .y_label_formatter(&|value| number(*value))
        .label_style((FONT, 14))
        .draw()?;
    for curve in &panel.curves {
        let points = curve.points.iter().map(|p| (p.0, p.1.clamp(-limit, limit)));
        match curve.look {
            Look::Points(_) => {
                let style = style(curve.look);
                chart.draw_series(points.map(|p| Circle::new(p, 3, style)))?;
            }
            _ => {
                chart.draw_series(LineSeries::new(points, style(curve.look)))?;
            }
        }
    }
    legend(&head, &panel.curves, limit)
}

fn style(look: Look) -> ShapeStyle {
    match look {
        Look::Line(k) => COLOURS[k % COLOURS.len()].stroke_width(2),
        Look::Points(k) => COLOURS[k % COLOURS.len()].stroke_width(1),
        Look::Reference => GREY.stroke_width(1),
    }
}

/// What the legend says of a curve, and how wide that is.
fn entry(curve: &Curve, limit: f64) -> (String, i32) {
    let larger = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
    let peak = curve.points.iter().map(|p| p.1).fold(0.0, larger);
    let cut = if peak.abs() > limit {
        format!(" (cut off, peak {})", number(peak))
    } else {
        String::new()
    };
    let text = format!("{}{cut}", curve.label);
    let width = 28 + 8 * text.chars().count() as i32 + 24;
    (text, width)
}

/// Where each entry of the legend stands: its line and its place in it.
fn places(panel: &Panel) -> Vec<(i32, i32)> {
    const START: i32 = 80;
    let limit = readable_limit(&panel.curves);
    let (mut x, mut row) = (START, 0);
    let named = panel.curves.iter().filter(|curve| !curve.label.is_empty());
    named
        .map(|curve| {
            let width = entry(curve, limit).1;
            if x > START && x + width > WIDTH as i32 {
                (x, row) = (START, row + 1);
            }
            let place = (row, x);
            x += width;
            place
        })
        .collect()
}

/// Lines of the legend.
fn rows(panel: &Panel) -> i32 {
    places(panel).last().map_or(1, |(row, _)| row + 1)
}

/// Samples above the panel, where they hide nothing.
fn legend(area: &Area<'_>, curves: &[Curve], limit: f64) -> Result<(), Box<dyn std::error::Error>> {
    let panel = Panel {
        x: String::new(),
        y: String::new(),
        curves: curves.to_vec(),
    };
    let named = curves.iter().filter(|curve| !curve.label.is_empty());
    for (curve, (row, x)) in named.zip(places(&panel)) {
        let middle = LEGEND * row + LEGEND / 2;
        match curve.look {
            Look::Points(_) => area.draw(&Circle::new((x + 11, middle), 3, style(curve.look)))?,
            _ => area.draw(&PathElement::new(
                [(x, middle), (x + 22, middle)],
                style(curve.look),
            ))?,
        }
        let text = entry(curve, limit).0;
        area.draw(&Text::new(text, (x + 28, middle - 7), (FONT, 14)))?;
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
    fn a_long_legend_takes_more_lines_and_nothing_is_no_figure() {
        let curve = |label: &str| Curve {
            label: label.to_owned(),
            look: Look::Line(0),
            points: vec![(0.0, 1.0), (1.0, 2.0)],
        };
        let mut panel = Panel {
            x: "x".to_owned(),
            y: "y".to_owned(),
            curves: vec![curve("short")],
        };
        assert_eq!(rows(&panel), 1);
        panel
            .curves
            .extend((0..6).map(|_| curve("a rather long label of a curve")));
        assert!(rows(&panel) > 1);
        assert!(
            figure("Title", std::slice::from_ref(&panel))
                .unwrap()
                .contains("Title")
        );
        assert!(figure("", &[]).is_err());
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
