//! Panels with axes, curves and a legend.

use std::ops::Range;

use plotters::coord::ranged1d::Ranged;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::{
    CUT, decades, extent, interpolated, limits, named_peak, peaks, place_of, power_of_ten, ticks,
    within,
};
use super::caption::Caption;
use super::limits::Limits;
use super::lines::{between, dashed, thinned, without_returns};
use super::numbers::{number, rounded, tick};
use super::page::{self, Area, Fallible, LETTERS, LegendPlace, draw_text, px};
use super::style::{Style, Texts};
use super::theme::Palette;

/// The height of the axes of a panel, without names and legend (pixels).
const PANEL: i32 = 198;
/// The smallest height of the axes of a panel on a slide (pixels).
const LOWEST: i32 = 90;
/// The largest number of points of a curve at which each has a mark: more would cover each other.
const MARKED: usize = 60;
/// The height of one line of the legend above a panel (pixels).
const LEGEND: i32 = 22;
/// The space below a panel, and between its legend and its axes (pixels).
const MARGIN: i32 = 8;
/// The height of the numbers below the axes (pixels).
const NUMBERS: i32 = 26;
/// The height of the name of a horizontal axis (pixels).
const NAME: i32 = 24;
/// The space left of the names of vertical axes (pixels).
const EDGE: i32 = 4;
/// The space left of the axes, for names and numbers (pixels).
const LEFT: i32 = 92;
/// The space right of the axes (pixels).
const RIGHT: i32 = 20;

/// The style in which a curve is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineStyle {
    /// A solid line in one of six colours, given by its number from 0.
    Line(usize),
    /// A line in one of six colours, each with dashes of its own and, if the values are few, a mark of its own at every
    /// value: such curves differ without colours.
    Marked(usize),
    /// A thin grey line, for a reference.
    Reference,
    /// Thin grey dashes, for a bound that does not affect the range of the axis.
    Bound,
    /// A dashed line, for a limit.
    Dashed,
    /// Small circles in one of the colours, for single values.
    Points(usize),
}

/// One curve.
#[derive(Clone, Debug)]
pub struct Curve {
    /// The name in the legend; if it is empty, the legend has no entry for the curve.
    pub label: String,
    /// The style of the curve.
    pub style: LineStyle,
    /// The points in order of x.
    pub points: Vec<(f64, f64)>,
}

/// The scale of the vertical axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// Linear; a peak far beyond the other values, which would make them invisible, is cut off and marked.
    #[default]
    Peaked,
    /// Linear.
    Linear,
    /// Linear from 0, over whole numbers.
    Count,
    /// Logarithmic, over whole numbers; values ≤ 0 are left out.
    Log,
}

impl Scale {
    /// Whether the axis is over whole numbers.
    fn is_whole(self) -> bool {
        matches!(self, Scale::Count | Scale::Log)
    }
}

/// A part of the x axis in a colour of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shade {
    /// The meaning of the colour.
    pub kind: ShadeKind,
    /// The start and end of the part, on the x axis.
    pub extent: [f64; 2],
}

/// The meaning of a shaded part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShadeKind {
    /// Contact that sticks.
    Stick,
    /// Contact that slips; hatched, so that stick and slip differ also in grey.
    Slip,
}

impl ShadeKind {
    fn word(self) -> &'static str {
        match self {
            ShadeKind::Stick => "stick",
            ShadeKind::Slip => "slip",
        }
    }

    fn colour(self, palette: &Palette) -> RGBColor {
        match self {
            ShadeKind::Stick => palette.stick,
            ShadeKind::Slip => palette.slip,
        }
    }
}

/// A second axis above a panel, for another coordinate along the same line.
#[derive(Clone, Debug, Default)]
pub struct Above {
    /// The name of the axis.
    pub name: String,
    /// Pairs of values on the panel's x axis and on this axis, both monotone.
    pub places: Vec<(f64, f64)>,
}

/// A pair of axes with curves.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// The name of the x axis; empty if the panel below has the same axis, so that numbers are enough.
    pub x: String,
    /// The name of the y axis.
    pub y: String,
    /// The scale of the y axis.
    pub scale: Scale,
    /// The curves in the order in which they are drawn.
    pub curves: Vec<Curve>,
    /// Vertical lines with a word at their top, in order of x.
    pub marks: Vec<(f64, String)>,
    /// Shaded parts behind the curves; the legend names them if no curve has a name.
    pub shades: Vec<Shade>,
    /// A second horizontal axis, above the panel, for another coordinate along x.
    pub above: Option<Above>,
    /// The limits of the horizontal axis; `None`: from the first to the last value.
    pub across: Option<Limits>,
    /// The limits of the vertical axis; `None`: by the values.
    pub up: Option<Limits>,
    /// A remark about the largest peak, written after its value. If it is empty, only a peak that is cut off is named.
    pub of_peak: String,
}

impl Panel {
    /// The space between legend and axes (pixels).
    fn room_above(&self) -> i32 {
        match self.above {
            Some(_) => NUMBERS + NAME + MARGIN,
            None => MARGIN,
        }
    }

    /// The panel with what its horizontal axis and the page show of it.
    fn shown(&self, style: Style) -> Panel {
        let mut panel = self.clone();
        if style.texts == Texts::Bare {
            panel.of_peak.clear();
        }
        if let Some(limits) = self.across {
            let across = limits.range();
            for curve in &mut panel.curves {
                let joined = !matches!(curve.style, LineStyle::Points(_));
                curve.points = between(&curve.points, &across, joined);
            }
            panel.marks.retain(|(x, _)| across.contains(x));
        }
        panel
    }
}

/// The places of panels on a page: in one column, on a slide in two.
struct Grid {
    columns: usize,
    /// The width of a panel (pixels).
    width: i32,
    /// Each row of panels, from the top.
    rows: Vec<Row>,
}

/// The heights of what is in a row of panels (pixels), whose axes stand side by side.
#[derive(Clone, Copy)]
struct Row {
    /// The height of the legends.
    legend: i32,
    /// The space between the legends and the axes.
    above: i32,
    /// The height of the axes.
    axes: i32,
    /// The space below the axes.
    below: i32,
}

impl Row {
    fn height(&self) -> i32 {
        self.legend + self.above + self.axes + self.below
    }
}

impl Grid {
    /// `room`: the height that there is for the figure, if it is given.
    fn of(style: Style, panels: &[Panel], room: Option<i32>) -> Grid {
        let columns = if room.is_some() {
            panels.len().min(2)
        } else {
            1
        };
        let width = style.width() / columns as i32;
        let most = |of: &[Panel], f: &dyn Fn(&Panel) -> i32| of.iter().map(f).max().unwrap_or(0);
        let row = |of: &[Panel]| Row {
            legend: most(of, &|panel| LEGEND * rows(width, panel)),
            above: most(of, &Panel::room_above),
            axes: PANEL,
            below: most(of, &|panel| {
                NUMBERS + MARGIN + if panel.x.is_empty() { 0 } else { NAME }
            }),
        };
        let mut rows: Vec<Row> = panels.chunks(columns).map(row).collect();
        if let Some(room) = room {
            let taken: i32 = rows.iter().map(|row| row.height() - row.axes).sum();
            let axes = (room - taken) / rows.len() as i32;
            rows.iter_mut().for_each(|row| row.axes = axes.max(LOWEST));
        }
        Grid {
            columns,
            width,
            rows,
        }
    }
}

/// Draws panels below one another, on a slide side by side, with a caption.
///
/// # Errors
///
/// The reason in words, if the figure cannot be drawn.
pub fn figure(
    style: impl Into<Style>,
    caption: &Caption,
    panels: &[Panel],
) -> Result<String, String> {
    let style = style.into();
    let empty = |panels: &[Panel]| {
        let mut curves = panels.iter().flat_map(|panel| &panel.curves);
        curves.all(|curve| curve.points.is_empty())
    };
    if empty(panels) {
        return Err("there is nothing to draw".to_owned());
    }
    let mut panels: Vec<Panel> = panels.iter().map(|panel| panel.shown(style)).collect();
    if empty(&panels) {
        return Err("there is nothing within xlim".to_owned());
    }
    let room = page::room(style, caption);
    if room.is_some() {
        // the panel with the name of a common axis is no longer below
        for k in (1..panels.len()).rev() {
            if panels[k - 1].x.is_empty() {
                panels[k - 1].x = panels[k].x.clone();
            }
        }
    }
    let grid = Grid::of(style, &panels, room);
    let height = grid.rows.iter().map(Row::height).sum();
    page::page(style, caption, height, |area| {
        let mut rest = area.clone();
        for (panels, row) in panels.chunks(grid.columns).zip(&grid.rows) {
            let (mut line, below) = rest.split_vertically(px(row.height()));
            rest = below;
            for panel in panels {
                let (place, right) = line.split_horizontally(px(grid.width));
                line = right;
                draw_panel(&place, style, (grid.width, *row), panel)?;
            }
        }
        Ok(String::new())
    })
}

fn draw_panel(
    area: &Area<'_>,
    style: Style,
    (width, row): (i32, Row),
    panel: &Panel,
) -> Fallible<()> {
    let curves: Vec<Vec<(f64, f64)>> = panel
        .curves
        .iter()
        .map(|curve| shown(panel.scale, curve))
        .collect();
    let places = curves.iter().flatten().map(|p| p.0);
    let whole = panel.scale.is_whole();
    let across = match panel.across {
        Some(limits) => limits.range(),
        // the first and the last whole number stand clear of the ends
        None if whole => extent(places.flat_map(|x| [x - 0.5, x + 0.5])),
        None => extent(places),
    };
    let (head, body) = area.split_vertically(px(row.legend));
    let fit = ((width - LEFT - RIGHT) / 66).clamp(4, 9) as usize;
    let mut axes = Axes::draw(&body, style, row, panel, across, fit)?;
    for shade in &panel.shades {
        axes.draw_shade(shade)?;
    }
    if !whole {
        axes.draw_zero()?;
    }
    axes.draw_marks(&panel.marks)?;
    for (curve, points) in panel.curves.iter().zip(&curves) {
        match panel.scale {
            Scale::Peaked => axes.draw_curve(curve, &without_returns(points, &axes.up))?,
            _ => axes.draw_curve(curve, points)?,
        }
    }
    if panel.scale == Scale::Peaked {
        axes.draw_cuts(panel)?;
    }
    if let Some(above) = &panel.above {
        axes.draw_above(above, fit)?;
    }
    legend(&head, style, width, panel)
}

/// The points of a curve that a vertical axis can show, as places on that axis.
fn shown(scale: Scale, curve: &Curve) -> Vec<(f64, f64)> {
    let points = curve.points.iter().copied();
    match scale {
        Scale::Log => points
            .filter(|p| p.1 > 0.0)
            .map(|(x, y)| (x, y.log10()))
            .collect(),
        _ => points.collect(),
    }
}

/// The axes of a panel, which also draw its content. Places are in the units of the drawing.
struct Axes<'a, 'b> {
    area: &'a Area<'b>,
    style: Style,
    palette: Palette,
    chart: ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>,
    left: i32,
    right: i32,
    top: i32,
    bottom: i32,
    across: Range<f64>,
    up: Range<f64>,
}

impl<'a, 'b> Axes<'a, 'b> {
    /// Draws the axes of a panel with at most `fit` numbers on the horizontal one.
    fn draw(
        area: &'a Area<'b>,
        style: Style,
        row: Row,
        panel: &Panel,
        across: Range<f64>,
        fit: usize,
    ) -> Fallible<Self> {
        let palette = style.palette();
        let up = up(panel);
        let mut chart = ChartBuilder::on(area)
            .margin_top(px(row.above))
            .margin_right(px(RIGHT))
            .margin_bottom(px(MARGIN))
            .margin_left(px(EDGE))
            .x_label_area_size(px(row.below - MARGIN))
            .y_label_area_size(px(LEFT - EDGE))
            .build_cartesian_2d(across.clone(), up.clone())?;
        let whole = panel.scale.is_whole();
        let whole_number = |value: f64| match value.round() {
            round if (value - round).abs() < 1e-6 => number(round),
            _ => String::new(),
        };
        let x_label = |value: &f64| {
            if whole {
                whole_number(*value)
            } else {
                tick(*value, across.end - across.start)
            }
        };
        let y_label = |value: &f64| match panel.scale {
            Scale::Log => power_of_ten(*value),
            Scale::Count => whole_number(*value),
            Scale::Peaked | Scale::Linear => tick(*value, up.end - up.start),
        };
        let (x_labels, y_labels) = if whole {
            (ticks(&across).min(fit + 3), ticks(&up).min(7))
        } else {
            (fit, 7)
        };
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(palette.grid.stroke_width(px(1) as u32))
            .axis_style(palette.axis.stroke_width(px(1) as u32))
            .set_all_tick_mark_size(px(4))
            .x_desc(&panel.x)
            .y_desc(&panel.y)
            .x_labels(x_labels)
            .y_labels(y_labels)
            .x_label_formatter(&x_label)
            .y_label_formatter(&y_label)
            .label_style(page::text(style, LETTERS))
            .axis_desc_style(page::text(style, LETTERS))
            .draw()?;
        let (x, y) = chart.plotting_area().get_pixel_range();
        let (left, top) = area.get_base_pixel();
        Ok(Axes {
            area,
            style,
            palette,
            chart,
            left: x.start - left,
            right: x.end - left,
            top: y.start - top,
            bottom: y.end - top,
            across,
            up,
        })
    }

    fn x(&self, x: f64) -> i32 {
        let part = (x - self.across.start) / (self.across.end - self.across.start);
        place(part, self.left, self.right)
    }

    fn y(&self, y: f64) -> i32 {
        let part = (y - self.up.start) / (self.up.end - self.up.start);
        place(part, self.bottom, self.top)
    }

    /// Draws a line, dashed if its style is; a line that leaves the axes ends there.
    fn draw_line(&self, points: &[(f64, f64)], style: LineStyle) -> Fallible<()> {
        let line = stroke(&self.palette, style);
        let pattern: Vec<f64> = dashes(style).iter().map(|d| f64::from(px(*d))).collect();
        for part in within(points, &self.up) {
            let on_page = |p: &(f64, f64)| (f64::from(self.x(p.0)), f64::from(self.y(p.1)));
            let part: Vec<(f64, f64)> = part.iter().map(on_page).collect();
            for dash in dashed(&part, &pattern) {
                let dash: Vec<(i32, i32)> = dash
                    .iter()
                    .map(|p| (p.0.round() as i32, p.1.round() as i32))
                    .collect();
                self.area.draw(&PathElement::new(dash, line))?;
            }
        }
        Ok(())
    }

    /// Draws a shaded part of the axis, hatched where the contact slips.
    fn draw_shade(&self, shade: &Shade) -> Fallible<()> {
        let [from, to] = shade.extent.map(|x| self.x(x).clamp(self.left, self.right));
        if to <= from {
            return Ok(());
        }
        let place = [(from, self.top), (to, self.bottom)];
        fill(self.area, place, shade.kind, &self.palette)
    }

    fn draw_zero(&mut self) -> Fallible<()> {
        if self.up.start < 0.0 && self.up.end > 0.0 {
            let ends = [(self.across.start, 0.0), (self.across.end, 0.0)];
            let line = self.palette.axis.mix(0.5).stroke_width(6);
            self.chart.draw_series(LineSeries::new(ends, line))?;
        }
        Ok(())
    }

    /// Draws vertical lines, with the word of each where there is room.
    fn draw_marks(&mut self, marks: &[(f64, String)]) -> Fallible<()> {
        let Range { start, end: top } = self.up;
        let thin = self.palette.faint.stroke_width(px(1) as u32);
        let mut free = i32::MIN; // where the next word may start
        for (x, word) in marks {
            self.chart
                .draw_series(LineSeries::new([(*x, start), (*x, top)], thin))?;
            let place = self.x(*x) + px(4);
            let end = place + px(page::width(word));
            if place >= free && end <= self.right {
                let text = Text::new(word.clone(), (px(4), px(3)), page::text(self.style, 13));
                self.chart
                    .draw_series([EmptyElement::at((*x, top)) + text])?;
                free = end + px(6);
            }
        }
        Ok(())
    }

    fn draw_curve(&self, curve: &Curve, points: &[(f64, f64)]) -> Fallible<()> {
        let line = stroke(&self.palette, curve.style);
        let columns = (self.right - self.left) / page::FINE;
        let points = thinned(points, &self.across, columns);
        let inside = || {
            let points = points.iter().copied();
            points.filter(|p| self.up.start <= p.1 && p.1 <= self.up.end)
        };
        match curve.style {
            LineStyle::Points(_) => {
                for (x, y) in inside() {
                    let place = (self.x(x), self.y(y));
                    self.area.draw(&Circle::new(place, px(3), line))?;
                }
            }
            LineStyle::Dashed => {
                // from edge to edge: also one iteration has a limit
                let first = inside().next().map(|p| (self.across.start, p.1));
                let last = inside().next_back().map(|p| (self.across.end, p.1));
                let points: Vec<_> = first.into_iter().chain(inside()).chain(last).collect();
                self.draw_line(&points, curve.style)?;
            }
            LineStyle::Bound | LineStyle::Line(_) | LineStyle::Reference | LineStyle::Marked(_) => {
                self.draw_line(&points, curve.style)?;
                if let Some(k) = mark(curve) {
                    for (x, y) in inside() {
                        self.area.draw(&dot((self.x(x), self.y(y)), k, line))?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Draws two strokes through the axis wherever a curve leaves the panel, and the value of the largest peak. A peak
    /// that is not cut off is named only if the panel has a remark about it.
    fn draw_cuts(&self, panel: &Panel) -> Fallible<()> {
        let (area, up, palette) = (self.area, &self.up, &self.palette);
        let edge = |over: bool| if over { self.top } else { self.bottom };
        for curve in panel.curves.iter().filter(|curve| decides(curve.style)) {
            let line = stroke(palette, curve.style)
                .color
                .to_rgba()
                .stroke_width(px(1) as u32 + 6);
            for (x, _, over) in peaks(&curve.points, up) {
                let (x_at, y_at) = (self.x(x), edge(over));
                let back = [(x_at - px(7), y_at - px(4)), (x_at + px(7), y_at + px(4))];
                area.draw(&Rectangle::new(back, palette.background.filled()))?;
                for off in [-px(3), px(3)] {
                    let wave = [(-7, 2), (-3, -1), (3, 1), (7, -2)];
                    let wave = wave.map(|(dx, dy)| (x_at + px(dx), y_at + off + px(dy)));
                    area.draw(&PathElement::new(wave, line))?;
                }
            }
        }
        let Some((x, peak, over)) = named_peak(&deciding(panel), up, &panel.of_peak) else {
            return Ok(());
        };
        let words = format!("peak {}{}", rounded(peak), panel.of_peak);
        let x_at = self.x(x);
        let (side, gap) = if x_at > (self.left + self.right) / 2 {
            (HPos::Right, -px(12))
        } else {
            (HPos::Left, px(12))
        };
        let (vertical, lift) = if over {
            (VPos::Top, px(6))
        } else {
            (VPos::Bottom, -px(6))
        };
        let place = (x_at + gap, edge(over) + lift);
        let text = page::text(self.style, 13).pos(Pos::new(side, vertical));
        area.draw(&Text::new(words, place, text))?;
        Ok(())
    }

    /// Draws the second horizontal axis, above the panel.
    fn draw_above(&self, above: &Above, fit: usize) -> Fallible<()> {
        let (area, top) = (self.area, self.top);
        let axis = self.palette.axis.stroke_width(px(1) as u32);
        let text = page::text(self.style, LETTERS).pos(Pos::new(HPos::Center, VPos::Bottom));
        area.draw(&PathElement::new(
            [(self.left, top), (self.right, top)],
            axis,
        ))?;
        // what of it is shown
        let inside = |c: f64| {
            place_of(&above.places, c).filter(|s| self.across.contains(s) || *s == self.across.end)
        };
        let own = |s: f64| interpolated(above.places.iter().copied(), s);
        let (Some(first), Some(last)) = (above.places.first(), above.places.last()) else {
            return Ok(());
        };
        let ends = [self.across.start.max(first.0), self.across.end.min(last.0)].map(own);
        let [Some(a), Some(b)] = ends else {
            return Ok(());
        };
        let range: RangedCoordf64 = (a.min(b)..a.max(b)).into();
        for value in range.key_points(fit) {
            let Some(s) = inside(value) else { continue };
            let x = self.x(s);
            area.draw(&PathElement::new([(x, top), (x, top - px(4))], axis))?;
            let number = tick(value, b - a);
            area.draw(&Text::new(number, (x, top - px(7)), text.clone()))?;
        }
        let middle = (self.left + self.right) / 2;
        let place = (middle, top - px(NUMBERS));
        area.draw(&Text::new(above.name.clone(), place, text))?;
        Ok(())
    }
}

/// The place of a part (0 … 1) of the way from one place to another, which may be far outside of it.
fn place(part: f64, from: i32, to: i32) -> i32 {
    let along = (part * f64::from(to - from)).clamp(-1e6, 1e6);
    from + along.round() as i32
}

/// The lengths of dashes and gaps (pixels) of a line; none for a solid line.
fn dashes(style: LineStyle) -> &'static [i32] {
    const OF_CURVES: [&[i32]; 6] = [
        &[],
        &[8, 4],
        &[10, 3, 2, 3],
        &[2, 3],
        &[16, 4],
        &[10, 3, 2, 3, 2, 3],
    ];
    match style {
        LineStyle::Marked(k) => OF_CURVES[k % OF_CURVES.len()],
        LineStyle::Bound => &[4, 3],
        LineStyle::Dashed => &[7, 5],
        LineStyle::Line(_) | LineStyle::Reference | LineStyle::Points(_) => &[],
    }
}

/// The number of the mark that each value of a curve has, if it has one.
fn mark(curve: &Curve) -> Option<usize> {
    match curve.style {
        LineStyle::Marked(k) if curve.points.len() <= MARKED => Some(k),
        _ => None,
    }
}

/// Fills a rectangle like a shaded part of the axis.
fn fill(
    area: &Area<'_>,
    place: [(i32, i32); 2],
    kind: ShadeKind,
    palette: &Palette,
) -> Fallible<()> {
    let colour = kind.colour(palette);
    area.draw(&Rectangle::new(place, colour.mix(0.16).filled()))?;
    // a narrow one would be all hatching, and where stick and slip alternate there are thousands
    if kind == ShadeKind::Slip && place[1].0 - place[0].0 > px(4) {
        hatch(area, place, colour)?;
    }
    Ok(())
}

/// Draws thin lines at 45° in a rectangle.
fn hatch(
    area: &Area<'_>,
    [(left, top), (right, bottom)]: [(i32, i32); 2],
    colour: RGBColor,
) -> Fallible<()> {
    const APART: i32 = px(9);
    let thin = colour.mix(0.45).stroke_width(6);
    let height = bottom - top;
    // each goes up from its start at the bottom; all start at the same places, whatever the rectangle
    let mut start = (left - height).div_euclid(APART) * APART;
    while start < right {
        let (low, high) = ((left - start).max(0), (right - start).min(height));
        if high > low {
            let at = |along: i32| (start + along, bottom - along);
            area.draw(&PathElement::new([at(low), at(high)], thin))?;
        }
        start += APART;
    }
    Ok(())
}

/// Whether a curve affects the range of its axis.
fn decides(style: LineStyle) -> bool {
    style != LineStyle::Bound
}

/// The curves that affect the range of the axis.
fn deciding(panel: &Panel) -> Vec<&[(f64, f64)]> {
    let curves = panel.curves.iter().filter(|curve| decides(curve.style));
    curves.map(|curve| &curve.points[..]).collect()
}

/// The range of the vertical axis of a panel; for a logarithmic axis in exponents of ten.
fn up(panel: &Panel) -> Range<f64> {
    if let Some(limits) = panel.up {
        let Range { start, end } = limits.range();
        return match panel.scale {
            // a limit that is not positive has no place on the axis: it ends far below all values
            Scale::Log => start.max(1e-300).log10()..end.max(1e-299).log10(),
            _ => start..end,
        };
    }
    let values = || {
        panel
            .curves
            .iter()
            .flat_map(|curve| curve.points.iter().map(|p| p.1))
    };
    match panel.scale {
        Scale::Log => {
            let range = decades(values().filter(|y| *y > 0.0).map(f64::log10));
            // words at the marks stand above the curves
            let room = if panel.marks.is_empty() { 0.0 } else { 0.1 };
            range.start..range.end + room * (range.end - range.start)
        }
        Scale::Count => {
            let most = values().fold(1.0, f64::max);
            -0.06 * most..1.06 * most
        }
        Scale::Peaked => limits(&deciding(panel), CUT),
        Scale::Linear => {
            let Range { start, end } = limits(&deciding(panel), f64::INFINITY);
            // with the bounds, unless they are far from being reached
            let bounds = panel.curves.iter().filter(|curve| !decides(curve.style));
            let bounds = bounds.flat_map(|curve| curve.points.iter().map(|p| 1.08 * p.1));
            let (low, high) = bounds.fold((0.0_f64, 0.0_f64), |(l, h), y| (l.min(y), h.max(y)));
            start.min(low.max(1.6 * start))..end.max(high.min(1.6 * end))
        }
    }
}

fn stroke(palette: &Palette, style: LineStyle) -> ShapeStyle {
    let colour = |k: usize| palette.curves[k % palette.curves.len()];
    match style {
        LineStyle::Line(k) | LineStyle::Marked(k) => colour(k).stroke_width(px(2) as u32),
        LineStyle::Points(k) => colour(k).stroke_width(px(1) as u32),
        LineStyle::Reference | LineStyle::Bound => palette.faint.stroke_width(px(1) as u32),
        LineStyle::Dashed => palette.text.stroke_width(px(1) as u32),
    }
}

/// The mark of a value by the number `k` of the colour: a circle, a square, a diamond, or a triangle that points up,
/// down or to the right.
fn dot((x, y): (i32, i32), k: usize, line: ShapeStyle) -> Polygon<(i32, i32)> {
    // corners on a circle, and the angle of the first, clockwise from the right
    let (corners, first, size) = [
        (16, 0.0, 2.7),
        (4, 45.0, 3.8),
        (4, 0.0, 3.8),
        (3, -90.0, 4.0),
        (3, 90.0, 4.0),
        (3, 0.0, 4.0),
    ][k % 6];
    let size = size * f64::from(px(1));
    let corner = |j: i32| {
        let angle = f64::to_radians(first + 360.0 * f64::from(j) / f64::from(corners));
        let [dx, dy] = [angle.cos(), angle.sin()].map(|part| (part * size).round() as i32);
        (x + dx, y + dy)
    };
    Polygon::new((0..corners).map(corner).collect::<Vec<_>>(), line.filled())
}

/// An entry of the legend.
enum Entry<'a> {
    Curve(&'a Curve),
    Shade(ShadeKind),
}

impl Entry<'_> {
    fn words(&self) -> &str {
        match self {
            Entry::Curve(curve) => &curve.label,
            Entry::Shade(kind) => kind.word(),
        }
    }
}

/// The entries of a panel's legend.
fn entries(panel: &Panel) -> Vec<Entry<'_>> {
    let named = panel.curves.iter().filter(|curve| !curve.label.is_empty());
    let mut entries: Vec<Entry<'_>> = named.map(Entry::Curve).collect();
    // they are the same in the panels of one contact, and named in that whose curve needs no name
    let named = entries.is_empty();
    for kind in [ShadeKind::Stick, ShadeKind::Slip] {
        if named && panel.shades.iter().any(|shade| shade.kind == kind) {
            entries.push(Entry::Shade(kind));
        }
    }
    entries
}

fn places(width: i32, entries: &[Entry<'_>]) -> Vec<LegendPlace> {
    page::legend_places(width, LEFT, 14, entries.iter().map(Entry::words))
}

/// The number of lines of the legend of a panel of this width.
fn rows(width: i32, panel: &Panel) -> i32 {
    let places = places(width, &entries(panel));
    places.last().map_or(0, |place| place.row + 1)
}

/// Draws the legend: samples of the curves with their names, above the panel so that the legend covers no curve.
fn legend(area: &Area<'_>, style: Style, width: i32, panel: &Panel) -> Fallible<()> {
    let palette = style.palette();
    let entries = entries(panel);
    for (entry, LegendPlace { row, x }) in entries.iter().zip(places(width, &entries)) {
        let middle = LEGEND * row + LEGEND / 2;
        draw_text(area, style, entry.words(), (x + 28, middle))?;
        let curve = match entry {
            Entry::Shade(kind) => {
                let place = [(px(x + 2), px(middle - 6)), (px(x + 22), px(middle + 6))];
                fill(area, place, *kind, &palette)?;
                let border = kind.colour(&palette).stroke_width(px(1) as u32);
                area.draw(&Rectangle::new(place, border))?;
                continue;
            }
            Entry::Curve(curve) => curve,
        };
        let line = stroke(&palette, curve.style);
        let place = (px(x + 11), px(middle));
        if let LineStyle::Points(_) = curve.style {
            area.draw(&Circle::new(place, px(3), line))?;
            continue;
        }
        let ends = [x, x + 22].map(|x| (f64::from(px(x)), f64::from(px(middle))));
        let pattern: Vec<f64> = dashes(curve.style)
            .iter()
            .map(|d| f64::from(px(*d)))
            .collect();
        for dash in dashed(&ends, &pattern) {
            let dash: Vec<(i32, i32)> = dash.iter().map(|p| (p.0 as i32, p.1 as i32)).collect();
            area.draw(&PathElement::new(dash, line))?;
        }
        if let Some(k) = mark(curve) {
            area.draw(&dot(place, k, line))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::Theme;
    use plotters::element::PointCollection;

    fn curve(label: &str, points: &[(f64, f64)]) -> Curve {
        Curve {
            label: label.to_owned(),
            style: LineStyle::Line(0),
            points: points.to_vec(),
        }
    }

    #[test]
    fn a_long_legend_takes_more_lines_and_a_figure_needs_a_curve() {
        let line = [(0.0, 1.0), (1.0, 2.0)];
        let mut panel = Panel {
            x: "x".to_owned(),
            y: "y".to_owned(),
            curves: vec![curve("short", &line)],
            ..Panel::default()
        };
        let style = Style::default();
        assert_eq!(rows(style.width(), &panel), 1);
        let label = "a rather long label of a curve";
        panel.curves.extend((0..6).map(|_| curve(label, &line)));
        assert!(rows(style.width(), &panel) > 1);
        let caption = Caption {
            title: "Title".into(),
            ..Caption::default()
        };
        let svg = figure(Theme::Light, &caption, std::slice::from_ref(&panel)).unwrap();
        assert!(svg.contains("Title"));
        assert!(figure(Theme::Light, &caption, &[]).is_err());
    }

    #[test]
    fn a_peak_is_cut_and_marked_and_a_point_that_overshoots_does_not_widen_the_axis() {
        let mut points: Vec<(f64, f64)> = (0..1000).map(|k| (f64::from(k), -100.0)).collect();
        points[998] = (997.5, 4000.0);
        points[999] = (997.6, -186_869.0);
        let panel = Panel {
            curves: vec![curve("", &points)],
            of_peak: ", which grows on finer meshes".into(),
            ..Panel::default()
        };
        let up = up(&panel);
        assert_eq!((up.start, up.end), (-648.0, 12.0));
        let found = peaks(&points, &up);
        assert_eq!(found, [(997.5, 4000.0, true), (997.6, -186_869.0, false)]);
        let svg = figure(Theme::Light, &Caption::default(), &[panel]).unwrap();
        assert!(svg.contains("peak −187000, which grows on finer meshes"));
    }

    #[test]
    fn a_peak_that_is_not_cut_is_named_if_there_is_more_to_say() {
        let mut panel = Panel {
            curves: vec![curve("", &[(0.0, -1.0), (1.0, -2.5), (2.0, -1.0)])],
            ..Panel::default()
        };
        let drawn = |panel: &Panel| {
            figure(
                Theme::Light,
                &Caption::default(),
                std::slice::from_ref(panel),
            )
            .unwrap()
        };
        assert!(!drawn(&panel).contains("peak"));
        panel.of_peak = ", which grows on finer meshes".into();
        assert!(drawn(&panel).contains("peak −2.5, which grows on finer meshes"));
    }

    #[test]
    fn a_bound_far_away_does_not_hide_the_curve() {
        let line = |y: f64| vec![(0.0, 0.0), (1.0, y), (2.0, 0.0)];
        let mut panel = Panel {
            scale: Scale::Linear,
            curves: vec![curve("", &line(10.0))],
            ..Panel::default()
        };
        let alone = up(&panel);
        for (bound, end) in [(12.0, 12.96), (500.0, 1.6 * alone.end)] {
            panel.curves.push(Curve {
                style: LineStyle::Bound,
                ..curve("bound", &line(bound))
            });
            assert!((up(&panel).end - end).abs() < 1e-9);
            panel.curves.pop();
        }
    }

    #[test]
    fn curves_differ_without_colours() {
        let few = |k| Curve {
            style: LineStyle::Marked(k),
            ..curve("", &[(0.0, 1.0), (1.0, 2.0)])
        };
        let line = ShapeStyle::from(&BLACK);
        let shape = |k| (&dot((0, 0), k, line)).point_iter().to_vec();
        for k in 0..6 {
            assert_eq!(mark(&few(k)), Some(k));
            for other in 0..k {
                let [a, b] = [k, other].map(LineStyle::Marked);
                assert_ne!(dashes(a), dashes(b));
                assert_ne!(shape(k), shape(other));
            }
        }
        let many: Vec<(f64, f64)> = (0..100).map(|k| (f64::from(k), 1.0)).collect();
        assert_eq!(
            mark(&Curve {
                points: many,
                ..few(0)
            }),
            None
        );
    }

    #[test]
    fn a_curve_of_many_points_is_no_larger_than_what_can_be_seen() {
        let noisy = |k: u32| f64::from(k.wrapping_mul(2_654_435_761) >> 8) + 1.0;
        let panel = |points: u32| Panel {
            scale: Scale::Log,
            curves: vec![Curve {
                style: LineStyle::Marked(0),
                ..curve(
                    "a",
                    &(0..points)
                        .map(|k| (f64::from(k), noisy(k)))
                        .collect::<Vec<_>>(),
                )
            }],
            ..Panel::default()
        };
        let size = |points| {
            figure(Theme::Light, &Caption::default(), &[panel(points)])
                .unwrap()
                .len()
        };
        assert!(size(200_000) < 60_000, "{}", size(200_000));
    }

    #[test]
    fn limits_are_those_of_the_axes_and_a_slide_has_its_format() {
        let wave: Vec<(f64, f64)> = (0..=100)
            .map(|k| f64::from(k) / 10.0)
            .map(|x| (x, x.sin()))
            .collect();
        let mut panel = Panel {
            x: "x".into(),
            curves: vec![curve("", &wave)],
            across: "2,3".parse().ok(),
            up: "-4,4".parse().ok(),
            of_peak: ", which grows on finer meshes".into(),
            ..Panel::default()
        };
        let shown = panel.shown(Style::default());
        assert_eq!(shown.curves[0].points.first().map(|p| p.0), Some(2.0));
        assert_eq!(shown.curves[0].points.last().map(|p| p.0), Some(3.0));
        assert_eq!(up(&shown), -4.0..4.0);
        let bare = Style {
            texts: Texts::Bare,
            size: crate::plot::Size::Slide,
            ..Style::default()
        };
        let caption = Caption {
            title: "Title".into(),
            warnings: vec!["bad".into()],
            ..Caption::default()
        };
        let panels = [
            Panel {
                x: String::new(),
                ..panel.clone()
            },
            panel.clone(),
        ];
        let svg = figure(bare, &caption, &panels).unwrap();
        assert!(svg.starts_with(r#"<svg width="864" height="486""#));
        assert!(!svg.contains("Title") && !svg.contains("bad") && !svg.contains("finer"));
        panel.across = "20,30".parse().ok();
        assert_eq!(
            figure(bare, &caption, &[panel]),
            Err("there is nothing within xlim".into())
        );
    }
}
