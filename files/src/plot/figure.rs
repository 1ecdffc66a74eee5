//! Panels of curves over one another, drawn as SVG.

use std::ops::Range;

use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use super::page::{self, Area, Fallible, LETTERS, WIDTH, draw_text, number, px, tick};
use super::theme::{Palette, Theme};

/// Of a panel without its legend (pixels).
const PANEL: i32 = 264;
/// Height of one line of the legend above a panel (pixels).
const LEGEND: i32 = 22;
/// Left of the names of axes, and of the axes (pixels).
const EDGE: i32 = 4;
const LEFT: i32 = 92;
/// Decades that a logarithmic axis spans at most, from the largest value down.
const DECADES: f64 = 18.0;

/// The style of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineStyle {
    /// A line in one of six colours, counted from 0.
    Line(usize),
    /// A line with a mark at every value.
    Marked(usize),
    /// A thin grey line: a bound, a reference.
    Reference,
    /// A dashed line: a limit.
    Dashed,
    /// Small circles in one of the colours: single values.
    Points(usize),
}

/// One curve.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Its name in the legend; empty: it has no entry.
    pub label: String,
    /// The style of its line.
    pub style: LineStyle,
    /// In order of x.
    pub points: Vec<(f64, f64)>,
}

/// The scale of the vertical axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// Linear; a peak that does not converge is cut off, with a note in the legend.
    #[default]
    Stress,
    /// Linear from 0, over whole numbers.
    Count,
    /// Logarithmic, over whole numbers; values ≤ 0 are left out.
    Log,
}

/// One pair of axes.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// Name of the x axis.
    pub x: String,
    /// Name of the y axis.
    pub y: String,
    /// Scale of the y axis.
    pub scale: Scale,
    /// Drawn in this order.
    pub curves: Vec<Curve>,
    /// Vertical lines with a word each at their top, in order of x.
    pub marks: Vec<(f64, String)>,
}

/// Panels below one another under a title, with a note under it if there is one. `Err`: the reason why the figure could
/// not be drawn.
pub fn figure(
    theme: Theme,
    title: &str,
    note: Option<&str>,
    panels: &[Panel],
) -> Result<String, String> {
    if panels
        .iter()
        .all(|panel| panel.curves.iter().all(|c| c.points.is_empty()))
    {
        return Err("there is nothing to draw".to_owned());
    }
    let heights: Vec<i32> = panels.iter().map(|p| LEGEND * rows(p) + PANEL).collect();
    page::page(theme, title, note, heights.iter().sum(), |area| {
        let mut rest = area.clone();
        for (panel, height) in panels.iter().zip(&heights) {
            let (place, below) = rest.split_vertically(px(*height));
            rest = below;
            draw_panel(&place, theme, panel)?;
        }
        Ok(String::new())
    })
}

fn draw_panel(area: &Area<'_>, theme: Theme, panel: &Panel) -> Fallible<()> {
    let palette = theme.palette();
    let limit = readable_limit(panel);
    let shown = |curve: &Curve| -> Vec<(f64, f64)> {
        let place = |&(x, y): &(f64, f64)| match panel.scale {
            Scale::Stress => Some((x, y.clamp(-limit, limit))),
            Scale::Count => Some((x, y)),
            Scale::Log => (y > 0.0).then(|| (x, y.log10())),
        };
        curve.points.iter().filter_map(place).collect()
    };
    let curves: Vec<Vec<(f64, f64)>> = panel.curves.iter().map(shown).collect();
    let all = curves.iter().flatten();
    let whole = panel.scale != Scale::Stress;
    let places = all.clone().map(|p| p.0);
    let across = match whole {
        // the first and the last whole number stand clear of the ends
        true => extent(places.flat_map(|x| [x - 0.5, x + 0.5]), 0.0),
        false => extent(places, 0.0),
    };
    let up = match panel.scale {
        Scale::Log => {
            let range = decades(all.map(|p| p.1));
            // words at the marks stand above the curves
            let room = if panel.marks.is_empty() { 0.0 } else { 0.1 };
            range.start..range.end + room * (range.end - range.start)
        }
        Scale::Count => extent(all.map(|p| p.1).chain(std::iter::once(1.0)), 0.06),
        _ => extent(all.map(|p| p.1), 0.06),
    };
    let (head, body) = area.split_vertically(px(LEGEND * rows(panel)));
    let mut chart: ChartContext<'_, _, Cartesian2d<RangedCoordf64, RangedCoordf64>> =
        ChartBuilder::on(&body)
            .margin_top(px(6))
            .margin_right(px(20))
            .margin_bottom(px(14))
            .margin_left(px(EDGE))
            .x_label_area_size(px(46))
            .y_label_area_size(px(LEFT - EDGE))
            .build_cartesian_2d(across.clone(), up.clone())?;
    let whole_number = |value: f64| match value.round() {
        round if (value - round).abs() < 1e-6 => number(round),
        _ => String::new(),
    };
    let x_label = |value: &f64| match whole {
        true => whole_number(*value),
        false => tick(*value, across.end - across.start),
    };
    let y_label = |value: &f64| match panel.scale {
        Scale::Log => power_of_ten(*value),
        Scale::Count => whole_number(*value),
        Scale::Stress => tick(*value, up.end - up.start),
    };
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(palette.grid.stroke_width(px(1) as u32))
        .axis_style(palette.axis.stroke_width(px(1) as u32))
        .set_all_tick_mark_size(px(4))
        .x_desc(&panel.x)
        .y_desc(&panel.y)
        .x_labels(if whole { ticks(&across) } else { 9 })
        .y_labels(if whole { ticks(&up).min(7) } else { 9 })
        .x_label_formatter(&x_label)
        .y_label_formatter(&y_label)
        .label_style(page::text(theme, LETTERS))
        .axis_desc_style(page::text(theme, 16))
        .draw()?;
    let thin = palette.reference.stroke_width(px(1) as u32);
    let pixels = chart.plotting_area().get_x_axis_pixel_range();
    let mut free = i32::MIN; // where the next word may start
    for (x, word) in &panel.marks {
        chart.draw_series(LineSeries::new([(*x, up.start), (*x, up.end)], thin))?;
        let part = (x - across.start) / (across.end - across.start);
        let place = pixels.start + (part * f64::from(pixels.end - pixels.start)) as i32 + px(4);
        let end = place + px(page::width(word));
        if place >= free && end <= pixels.end {
            let text = Text::new(word.clone(), (px(4), px(3)), page::text(theme, 13));
            chart.draw_series([EmptyElement::at((*x, up.end)) + text])?;
            free = end + px(6);
        }
    }
    for (curve, points) in panel.curves.iter().zip(&curves) {
        let style = style(&palette, curve.style);
        let points = points.iter().copied();
        let dots = |k: f64| {
            let radius = (k * f64::from(px(1))) as i32;
            move |p| Circle::new(p, radius, style.filled())
        };
        match curve.style {
            LineStyle::Points(_) => {
                chart.draw_series(points.map(|p| Circle::new(p, px(3), style)))?;
            }
            LineStyle::Marked(_) => {
                chart.draw_series(LineSeries::new(points.clone(), style))?;
                chart.draw_series(points.map(dots(2.6)))?;
            }
            LineStyle::Dashed => {
                // from edge to edge: also one iteration has a limit
                let ends = points.clone().next().zip(points.clone().next_back());
                let points: Vec<_> = ends.map_or(vec![], |(first, last)| {
                    let inner = points.collect::<Vec<_>>();
                    [
                        vec![(across.start, first.1)],
                        inner,
                        vec![(across.end, last.1)],
                    ]
                    .concat()
                });
                chart.draw_series(DashedLineSeries::new(points, px(7), px(5), style))?;
            }
            LineStyle::Line(_) | LineStyle::Reference => {
                chart.draw_series(LineSeries::new(points, style))?;
            }
        }
    }
    legend(&head, theme, panel, limit)
}

fn style(palette: &Palette, style: LineStyle) -> ShapeStyle {
    let colour = |k: usize| palette.curves[k % palette.curves.len()];
    match style {
        LineStyle::Line(k) | LineStyle::Marked(k) => colour(k).stroke_width(px(2) as u32),
        LineStyle::Points(k) => colour(k).stroke_width(px(1) as u32),
        LineStyle::Reference => palette.reference.stroke_width(px(1) as u32),
        LineStyle::Dashed => palette.text.stroke_width(px(1) as u32),
    }
}

/// The text of a curve in the legend, and its width (pixels).
fn entry(curve: &Curve, limit: f64) -> (String, i32) {
    let larger = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
    let peak = curve.points.iter().map(|p| p.1).fold(0.0, larger);
    let cut = if peak.abs() > limit {
        format!(" (cut off, peak {})", number(peak))
    } else {
        String::new()
    };
    let text = format!("{}{cut}", curve.label);
    let width = 28 + page::width(&text) + 18;
    (text, width)
}

/// Where each entry of the legend stands: its line and its place in it (pixels).
fn places(panel: &Panel, limit: f64) -> Vec<(i32, i32)> {
    let (mut x, mut row) = (LEFT, 0);
    let named = panel.curves.iter().filter(|curve| !curve.label.is_empty());
    named
        .map(|curve| {
            let width = entry(curve, limit).1;
            if x > LEFT && x + width > WIDTH {
                (x, row) = (LEFT, row + 1);
            }
            let place = (row, x);
            x += width;
            place
        })
        .collect()
}

/// Lines of the legend.
fn rows(panel: &Panel) -> i32 {
    let places = places(panel, readable_limit(panel));
    places.last().map_or(1, |(row, _)| row + 1)
}

/// Samples of the curves, above the panel so that they cover no curve.
fn legend(area: &Area<'_>, theme: Theme, panel: &Panel, limit: f64) -> Fallible<()> {
    let palette = theme.palette();
    let named = panel.curves.iter().filter(|curve| !curve.label.is_empty());
    for (curve, (row, x)) in named.zip(places(panel, limit)) {
        let middle = LEGEND * row + LEGEND / 2;
        let style = style(&palette, curve.style);
        let line = |from: i32, to: i32| {
            PathElement::new([(px(from), px(middle)), (px(to), px(middle))], style)
        };
        let dot = (px(x + 11), px(middle));
        match curve.style {
            LineStyle::Points(_) => area.draw(&Circle::new(dot, px(3), style))?,
            LineStyle::Marked(_) => {
                area.draw(&line(x, x + 22))?;
                area.draw(&Circle::new(dot, px(3), style.filled()))?;
            }
            LineStyle::Dashed => {
                area.draw(&line(x, x + 8))?;
                area.draw(&line(x + 14, x + 22))?;
            }
            LineStyle::Line(_) | LineStyle::Reference => area.draw(&line(x, x + 22))?,
        }
        draw_text(area, theme, &entry(curve, limit).0, (x + 28, middle))?;
    }
    Ok(())
}

/// As many ticks as there are whole numbers, and no more than fit.
fn ticks(range: &Range<f64>) -> usize {
    ((range.end - range.start) as usize + 1).clamp(2, 12)
}

/// 10ⁿ; nothing between the powers.
fn power_of_ten(exponent: f64) -> String {
    let round = exponent.round();
    if (exponent - round).abs() > 1e-6 {
        return String::new();
    }
    let raised = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + digit.to_digit(10).unwrap_or(0)).unwrap_or('?'),
    };
    format!(
        "10{}",
        (round as i32)
            .to_string()
            .chars()
            .map(raised)
            .collect::<String>()
    )
}

/// Whole decades around all exponents.
fn decades(exponents: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = exponents.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), e| {
        (low.min(e), high.max(e))
    });
    if low > high {
        return -1.0..1.0;
    }
    let top = (high + 0.1).ceil();
    (low - 0.1).floor().max(top - DECADES).min(top - 2.0)..top
}

/// The largest |stress| that is drawn. At a sharp edge one node may exceed all others, and does not
/// converge: what exceeds the value that 97 % of the contact stays below is cut off at twice that.
fn readable_limit(panel: &Panel) -> f64 {
    if panel.scale != Scale::Stress {
        return f64::INFINITY;
    }
    let mut pieces: Vec<(f64, f64)> = Vec::new(); // |stress|, length
    for curve in &panel.curves {
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
    } else if low == high {
        low - 1.0..low + 1.0
    } else {
        0.0..1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_legend_takes_more_lines_and_a_figure_needs_a_curve() {
        let curve = |label: &str| Curve {
            label: label.to_owned(),
            style: LineStyle::Line(0),
            points: vec![(0.0, 1.0), (1.0, 2.0)],
        };
        let mut panel = Panel {
            x: "x".to_owned(),
            y: "y".to_owned(),
            curves: vec![curve("short")],
            ..Panel::default()
        };
        assert_eq!(rows(&panel), 1);
        panel
            .curves
            .extend((0..6).map(|_| curve("a rather long label of a curve")));
        assert!(rows(&panel) > 1);
        let svg = figure(Theme::Light, "Title", None, std::slice::from_ref(&panel)).unwrap();
        assert!(svg.contains("Title"));
        assert!(figure(Theme::Light, "", None, &[]).is_err());
    }

    #[test]
    fn powers_of_ten_are_raised_and_their_axis_ends_on_them() {
        assert_eq!(power_of_ten(-10.0), "10⁻¹⁰");
        assert_eq!(power_of_ten(2.0), "10²");
        assert_eq!(power_of_ten(0.5), "");
        assert_eq!(decades([-9.5, 0.3].into_iter()), -10.0..1.0);
        assert_eq!(decades([-300.0, 0.3].into_iter()), -17.0..1.0);
        assert_eq!(decades([0.5].into_iter()), -1.0..1.0);
        assert_eq!(decades(std::iter::empty()), -1.0..1.0);
    }
}
