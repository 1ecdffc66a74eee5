//! Draws bodies between axes of equal scale. The content is written as SVG paths: these are clipped, have the parabolas
//! of the sides of elements, and one path may contain thousands of shapes.

use std::fmt::Write;

use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use super::limits::AxisLimits;
use super::numbers::tick;
use super::page::{self, Area, Fallible, draw_text, px};
use super::style::Style;
use super::theme::hex;
use solver::element::Element;
use solver::mesh::runs;

/// The space left of the names of vertical axes (pixels).
const EDGE: i32 = 4;
/// The space left of the axes, for names and numbers (pixels).
const LEFT: i32 = 84;
/// The space right of the axes (pixels).
const RIGHT: i32 = 16;
/// The space below the axes, for numbers and names (pixels).
const BELOW: i32 = 46;
/// The space below a body with its numbers and names (pixels).
const GAP: i32 = 12;
/// The height of the caption above the axes (pixels).
const CAPTION: i32 = 26;
/// The width (pixels) below which a page has no room for two windows side by side.
const NARROW: i32 = 640;
/// The largest height of the axes (pixels): if windows are one above the other, and if they are side by side.
const HIGHEST: [f64; 2] = [430.0, 420.0];
/// The smallest height of the axes on a slide (pixels).
const LOWEST: i32 = 100;
/// The largest ratio of the sides of a window that a request sets.
const LONGEST: f64 = 20.0;

/// A rectangle of the plane of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Window {
    pub(super) low: [f64; 2],
    pub(super) high: [f64; 2],
}

impl Window {
    /// The smallest window around points; `None` if there are no points.
    pub(super) fn around(points: impl Iterator<Item = [f64; 2]>) -> Option<Window> {
        let mut window: Option<Window> = None;
        for p in points {
            let w = window.get_or_insert(Window { low: p, high: p });
            for a in 0..2 {
                w.low[a] = w.low[a].min(p[a]);
                w.high[a] = w.high[a].max(p[a]);
            }
        }
        window
    }

    pub(super) fn size(&self) -> [f64; 2] {
        [self.high[0] - self.low[0], self.high[1] - self.low[1]]
    }

    pub(super) fn largest(&self) -> f64 {
        self.size()[0].max(self.size()[1])
    }

    /// The smallest window around this window and another.
    pub(super) fn with(&self, other: &Window) -> Window {
        Window {
            low: [0, 1].map(|a| self.low[a].min(other.low[a])),
            high: [0, 1].map(|a| self.high[a].max(other.high[a])),
        }
    }

    pub(super) fn holds(&self, point: [f64; 2]) -> bool {
        (0..2).all(|a| self.low[a] <= point[a] && point[a] <= self.high[a])
    }

    /// The window with the limits that a request sets.
    pub(super) fn limited(&self, limits: AxisLimits) -> Result<Window, String> {
        let mut window = *self;
        for (a, limits) in [limits.x, limits.y].into_iter().enumerate() {
            if let Some(limits) = limits {
                (window.low[a], window.high[a]) = (limits.range().start, limits.range().end);
            }
        }
        let [w, h] = window.size();
        if w.max(h) <= LONGEST * w.min(h) {
            Ok(window)
        } else {
            Err(format!(
                "with xlim and ylim it would be {w:.3} long and {h:.3} high; one may be at most {LONGEST} times the other: set both"
            ))
        }
    }

    /// The window enlarged on all sides by `part` times its larger side.
    pub(super) fn grown(&self, part: f64) -> Window {
        let by = part * self.largest();
        Window {
            low: self.low.map(|x| x - by),
            high: self.high.map(|x| x + by),
        }
    }
}

/// A square window with sides of length `side` around the middle of a small window, as far as possible inside `within`.
pub(super) fn square(around: &Window, side: f64, within: &Window) -> Window {
    let low = [0, 1].map(|a| {
        let middle = 0.5 * (around.low[a] + around.high[a]);
        let edge = 0.08 * side;
        let least = within.low[a] - edge;
        let most = within.high[a] + edge - side;
        (middle - 0.5 * side).max(least).min(most.max(least))
    });
    Window {
        low,
        high: low.map(|x| x + side),
    }
}

/// The place of a window on the page.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    pub(super) window: Window,
    /// The upper left corner, measured from below the title, in the units of the drawing.
    corner: [i32; 2],
    /// The width and the height, in the units of the drawing.
    size: [i32; 2],
}

impl Frame {
    /// Converts a place of the body to a place in the frame, measured from its upper left corner in the units of the
    /// drawing.
    pub(super) fn at(&self, point: [f64; 2]) -> [f64; 2] {
        let part = |a: usize| (point[a] - self.window.low[a]) / self.window.size()[a];
        [
            part(0) * f64::from(self.size[0]),
            (1.0 - part(1)) * f64::from(self.size[1]),
        ]
    }

    /// Whether some of the rectangle between two corners is visible; the corners are places as [`at`](Self::at) gives
    /// them.
    pub(super) fn shows(&self, low: [f64; 2], high: [f64; 2]) -> bool {
        (0..2).all(|a| high[a] >= 0.0 && low[a] <= f64::from(self.size[a]))
    }
}

/// The frames for one or two windows, and their total height (pixels). Two frames are side by side, but one below the
/// other if the first window is wide or the page narrow. `room`: the height that there is on a slide, where two frames
/// are always side by side.
pub(super) fn layout(style: Style, windows: &[Window], room: Option<i32>) -> (Vec<Frame>, i32) {
    let wide = |w: &Window| w.size()[0] > 1.7 * w.size()[1];
    let fits = room.is_some() || (!wide(&windows[0]) && style.width() >= NARROW);
    let beside = windows.len() > 1 && fits;
    let columns = if beside { 2 } else { 1 };
    let highest = room.map_or(HIGHEST[columns as usize - 1], |room| {
        f64::from((room - CAPTION - BELOW - GAP).max(LOWEST))
    });
    let column = style.width() / columns;
    let space = f64::from(column - LEFT - RIGHT);
    let sizes: Vec<[i32; 2]> = windows
        .iter()
        .map(|window| {
            let [w, h] = window.size();
            let scale = (space / w).min(highest / h);
            [w, h].map(|side| (scale * side * f64::from(page::FINE)).round() as i32)
        })
        .collect();
    let highest = sizes.iter().map(|s| s[1]).max().unwrap_or(0);
    let (mut left, mut top) = (0, 0);
    let mut frames = Vec::new();
    for (window, size) in windows.iter().zip(sizes) {
        let spare = px(column - LEFT - RIGHT) - size[0];
        let corner = [px(left + LEFT) + spare / 2, px(top + CAPTION)];
        frames.push(Frame {
            window: *window,
            corner,
            size,
        });
        if beside {
            left += column;
        } else {
            top += CAPTION + size[1] / page::FINE + BELOW + GAP;
        }
    }
    let height = if beside {
        CAPTION + highest / page::FINE + BELOW + GAP
    } else {
        top
    };
    (frames, height)
}

/// Draws numbers, names and a caption around a frame.
pub(super) fn axes(
    area: &Area<'_>,
    style: Style,
    frame: &Frame,
    caption: &str,
    names: [&str; 2],
) -> Fallible<()> {
    let palette = style.palette();
    let [left, top] = frame.corner;
    let [w, h] = frame.size;
    let place = area.clone().shrink(
        (left - px(LEFT - EDGE), top),
        ((w + px(LEFT - EDGE)) as u32, (h + px(BELOW)) as u32),
    );
    let Window { low, high } = frame.window;
    let mut chart: ChartContext<'_, _, Cartesian2d<RangedCoordf64, RangedCoordf64>> =
        ChartBuilder::on(&place)
            .x_label_area_size(px(BELOW))
            .y_label_area_size(px(LEFT - EDGE))
            .build_cartesian_2d(low[0]..high[0], low[1]..high[1])?;
    let fits = |size: i32, each: i32| ((size / px(each)) as usize).clamp(2, 9);
    chart
        .configure_mesh()
        .disable_mesh()
        .axis_style(palette.axis.stroke_width(px(1) as u32))
        .set_all_tick_mark_size(px(4))
        .x_desc(names[0])
        .y_desc(names[1])
        .x_labels(fits(w, 54))
        .y_labels(fits(h, 40))
        .x_label_formatter(&|value| tick(*value, high[0] - low[0]))
        .y_label_formatter(&|value| tick(*value, high[1] - low[1]))
        .label_style(page::text(style, page::LETTERS))
        .axis_desc_style(page::text(style, page::LETTERS))
        .draw()?;
    let corner = (left / page::FINE, top / page::FINE - CAPTION / 2);
    draw_text(area, style, caption, corner)
}

/// The SVG of `content` inside a frame, clipped and with a border, to be put on top of the page.
pub(super) fn inside(style: Style, frame: &Frame, content: &str) -> String {
    let ([x, y], [w, h]) = (frame.corner, frame.size);
    let (place, border) = (
        format!(r#"x="{x}" y="{y}" width="{w}" height="{h}""#),
        hex(style.palette().axis),
    );
    format!(
        r#"<svg {place} overflow="hidden" stroke-linejoin="round" stroke-linecap="round">
{content}</svg>
<rect {place} fill="none" stroke="{border}" stroke-width="10"/>
"#
    )
}

/// The data (`d`) of an SVG path, in whole units of the drawing.
#[derive(Clone, Debug, Default)]
pub(super) struct Path(pub(super) String);

impl Path {
    /// Adds a closed polygon, unless it is only a point in the drawing.
    pub(super) fn polygon(&mut self, points: &[[f64; 2]]) {
        let points: Vec<[i64; 2]> = points.iter().map(|p| p.map(round)).collect();
        let Some((first, rest)) = points.split_first() else {
            return;
        };
        if rest.iter().all(|p| p == first) {
            return;
        }
        let mut here = *first;
        // writing to a string does not fail
        let _ = write!(self.0, "M{} {}l", first[0], first[1]);
        for p in rest.iter().filter(|p| *p != first) {
            for step in [p[0] - here[0], p[1] - here[1]] {
                // a minus sign separates, too
                let joined = step < 0 || self.0.ends_with('l');
                let _ = write!(self.0, "{}{step}", if joined { "" } else { " " });
            }
            here = *p;
        }
        self.0.push('z');
    }

    /// Adds an open line through points.
    pub(super) fn line(&mut self, points: &[[f64; 2]]) {
        for (k, p) in points.iter().enumerate() {
            let [x, y] = p.map(round);
            // writing to a string does not fail
            let _ = write!(self.0, "{}{x} {y}", if k == 0 { 'M' } else { 'L' });
        }
    }

    /// Adds consecutive sides, as given by `Element::sides`; `closed` if they form a loop.
    pub(super) fn sides(&mut self, sides: &[[[f64; 2]; 3]], closed: bool) {
        let mut here = None;
        for &[start, end, mid] in sides {
            let [a, b, m] = [start, end, mid].map(|p| p.map(round));
            if here != Some(a) {
                let _ = write!(self.0, "M{} {}", a[0], a[1]);
            }
            // the parabola through the midside node
            let c = [0, 1].map(|k| round(2.0 * mid[k] - 0.5 * (start[k] + end[k])) - a[k]);
            let off = (0..2).any(|k| (2 * m[k] - a[k] - b[k]).abs() > 2);
            let to = [b[0] - a[0], b[1] - a[1]];
            let _ = if off {
                write!(self.0, "q{} {} {} {}", c[0], c[1], to[0], to[1])
            } else {
                write!(self.0, "l{} {}", to[0], to[1])
            };
            here = Some(b);
        }
        if closed {
            self.0.push('z');
        }
    }

    /// The SVG element of the path, with these attributes; empty if the path is empty.
    pub(super) fn drawn(&self, attributes: &str) -> String {
        if self.0.is_empty() {
            String::new()
        } else {
            format!("<path {attributes} d=\"{}\"/>\n", self.0)
        }
    }
}

/// Rounds a coordinate, and limits it if it is far outside the page: some viewers fail on large numbers.
fn round(x: f64) -> i64 {
    x.clamp(-1e6, 1e6).round() as i64
}

/// The sides of the elements of a mesh, each once, and the sides on the surface.
pub(super) struct Sides {
    pub(super) all: Vec<[u32; 3]>,
    pub(super) surface: Vec<[u32; 3]>,
}

impl Sides {
    /// Finds all sides; a side is identified by its midside node.
    pub(super) fn of(elements: &[Element], nodes: usize) -> Sides {
        let mut seen = vec![0u8; nodes];
        let mut all = Vec::new();
        for side in elements.iter().flat_map(Element::sides) {
            if let Some(count) = seen.get_mut(side[2] as usize) {
                if *count == 0 {
                    all.push(side);
                }
                *count = count.saturating_add(1);
            }
        }
        let alone = |side: &&[u32; 3]| seen[side[2] as usize] == 1;
        let surface: Vec<[u32; 3]> = all.iter().filter(alone).copied().collect();
        // one after the other, so that dashes continue from side to side
        let surface = runs(&surface).concat();
        Sides { all, surface }
    }
}

/// The names of the coordinates in a type of analysis.
pub(super) fn coordinates(analysis: &solver::problem::Analysis) -> [&'static str; 2] {
    match analysis {
        solver::problem::Analysis::Axisymmetric {} => ["r", "z"],
        _ => ["x", "y"],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_equal_and_two_wide_windows_stand_below_one_another() {
        let window = |w: f64, h: f64| Window {
            low: [0.0, 0.0],
            high: [w, h],
        };
        for (windows, beside) in [
            (vec![window(4.0, 4.0), window(1.0, 1.0)], true),
            (vec![window(5.0, 1.0), window(1.0, 1.0)], false),
        ] {
            let (frames, height) = layout(Style::default(), &windows, None);
            assert_eq!(frames[0].corner[1] == frames[1].corner[1], beside);
            for frame in &frames {
                let [w, h] = frame.window.size();
                let [p, q] = frame.size.map(f64::from);
                assert!((p / w - q / h).abs() < 0.01 * p / w, "{frame:?}");
                assert!(frame.corner[0] + frame.size[0] <= px(720));
                assert!(frame.corner[1] + frame.size[1] <= px(height));
            }
            assert_eq!(frames[0].at([0.0, 0.0])[0], 0.0);
        }
    }

    #[test]
    fn a_bent_side_is_a_parabola_and_a_straight_one_a_line() {
        let mut path = Path::default();
        path.sides(&[[[0.0, 0.0], [100.0, 0.0], [50.0, 20.0]]], false);
        path.sides(&[[[0.0, 0.0], [100.0, 0.0], [50.0, 0.0]]], false);
        assert_eq!(path.0, "M0 0q50 40 100 0M0 0l100 0");
        path.polygon(&[[0.2, 0.1], [0.3, 0.0], [0.0, 0.4]]);
        assert_eq!(path.0, "M0 0q50 40 100 0M0 0l100 0", "a point is nothing");
    }

    #[test]
    fn the_surface_consists_of_sides_with_one_element() {
        let strip = solver::mesh::grid_mesh(&solver::problem::Grid {
            x: vec![0.0, 1.0, 2.0],
            y: vec![0.0, 1.0],
            top: None,
            bottom: None,
        });
        let sides = Sides::of(&strip.elements, strip.nodes.len());
        assert_eq!((sides.all.len(), sides.surface.len()), (7, 6));
    }
}
