//! Charts in a terminal, drawn with braille characters.

use std::ops::Range;

use files::plot::within;
use ratatui_core::{
    buffer::Buffer,
    layout::Rect,
    style::{Color, Style},
    symbols::Marker,
    widgets::Widget,
};
use ratatui_widgets::chart::{self, Axis, Dataset, GraphType};

/// A curve and its name.
pub(super) struct Curve {
    pub(super) name: &'static str,
    pub(super) points: Vec<(f64, f64)>,
}

/// A chart: curves over one horizontal axis.
pub(super) struct Chart {
    pub(super) title: String,
    /// The name of the horizontal axis.
    pub(super) across: String,
    pub(super) curves: Vec<Curve>,
    /// The kind and the range of the vertical axis.
    pub(super) scale: Scale,
    /// A line of text below the title.
    pub(super) note: Option<String>,
}

/// The kind of a vertical axis.
pub(super) enum Scale {
    /// A range; parts of a curve beyond it are not drawn.
    Within(Range<f64>),
    /// Powers of ten; values that are not positive are left out.
    Logarithmic,
}

/// The looks of the first, second and third curve of a chart. They can be distinguished without red or green, and without
/// any colour: a line, a line of larger dots, and single dots.
const LOOKS: [Look; 3] = [
    Look {
        colour: Color::Cyan,
        code: "36",
        sample: '─',
        marker: Marker::Braille,
        is_dotted: false,
    },
    Look {
        colour: Color::Yellow,
        code: "33",
        sample: '•',
        marker: Marker::Dot,
        is_dotted: false,
    },
    Look {
        colour: Color::DarkGray,
        code: "90",
        sample: '·',
        marker: Marker::Custom('·'),
        is_dotted: true,
    },
];

/// How a curve is drawn.
#[derive(Clone, Copy)]
struct Look {
    colour: Color,
    /// The number of the colour in escape sequences.
    code: &'static str,
    /// The character that stands for the curve in the heading.
    sample: char,
    marker: Marker,
    /// Whether only the character in every second column is drawn.
    is_dotted: bool,
}

impl Chart {
    /// Draws the chart as `height` lines of `width` characters.
    pub(super) fn draw(&self, width: u16, height: u16, in_colour: bool) -> String {
        let visible: Vec<Vec<(f64, f64)>> = self
            .curves
            .iter()
            .map(|curve| self.visible(curve))
            .collect();
        let all = || visible.iter().flatten().copied();
        if all().next().is_none() {
            return format!("{}: there is nothing to draw\n", self.title);
        }
        let across = range(all().map(|point| point.0));
        let up = match &self.scale {
            Scale::Within(up) => [up.start, up.end],
            Scale::Logarithmic => {
                // labels are whole powers of ten, also that in the middle
                let [low, high] = range(all().map(|point| point.1));
                let (low, high) = (low.floor(), high.ceil());
                [low, high + (high - low).rem_euclid(2.0)]
            }
        };
        // a curve that leaves the axis and comes back is drawn as several
        let parts: Vec<(Look, Vec<(f64, f64)>)> = visible
            .iter()
            .zip(LOOKS)
            .flat_map(|(points, look)| {
                let parts = match &self.scale {
                    Scale::Within(up) => within(points, up),
                    Scale::Logarithmic => vec![points.clone()],
                };
                let parts = parts.into_iter().map(move |part| match look.is_dotted {
                    true => dotted(&part, across, width / 2),
                    false => part,
                });
                parts.map(move |part| (look, part))
            })
            .collect();
        let datasets = parts.iter().map(|(look, points)| {
            Dataset::default()
                .marker(look.marker)
                .graph_type(if look.is_dotted {
                    GraphType::Scatter
                } else {
                    GraphType::Line
                })
                .style(Style::new().fg(look.colour))
                .data(points)
        });
        let label = |value: f64| match self.scale {
            Scale::Logarithmic => format!("1e{}", value as i32),
            Scale::Within(_) => short(value),
        };
        let middle = |[low, high]: [f64; 2]| (low + high) / 2.0;
        let across_labels = [across[0], middle(across), across[1]].map(short);
        let up_labels = [up[0], middle(up), up[1]].map(label);
        let figure = chart::Chart::new(datasets.collect())
            .legend_position(None)
            .x_axis(
                Axis::default()
                    .title(self.across.as_str())
                    .bounds(across)
                    .labels(across_labels),
            )
            .y_axis(Axis::default().bounds(up).labels(up_labels));
        let area = Rect::new(0, 0, width, height);
        let mut buffer = Buffer::empty(area);
        figure.render(area, &mut buffer);
        format!(
            "{}\n{}",
            self.heading(in_colour),
            text_of(&buffer, in_colour)
        )
    }

    /// The lines above the chart: the title, and the names of the curves in their colours, with the note below them.
    fn heading(&self, in_colour: bool) -> String {
        let names = self.curves.iter().zip(LOOKS).map(|(curve, look)| {
            coloured(
                &format!("{} {}", look.sample, curve.name),
                look.code,
                in_colour,
            )
        });
        let names: Vec<String> = names.collect();
        let note = self.note.iter().map(|note| format!("\n{note}"));
        let note: String = note.collect();
        format!("{}   {}{note}", self.title, names.join("   "))
    }

    fn visible(&self, curve: &Curve) -> Vec<(f64, f64)> {
        let points = curve.points.iter().copied();
        let finite = |point: &(f64, f64)| point.0.is_finite() && point.1.is_finite();
        match self.scale {
            Scale::Logarithmic => points
                .filter(|point| point.1 > 0.0)
                .map(|(x, y)| (x, y.log10()))
                .filter(finite)
                .collect(),
            Scale::Within(_) => points.filter(finite).collect(),
        }
    }
}

/// Places along a curve, whose points are in order of x: evenly spaced, `count` along the whole axis.
fn dotted(points: &[(f64, f64)], [low, high]: [f64; 2], count: u16) -> Vec<(f64, f64)> {
    let mut places = Vec::new();
    let mut pairs = points.windows(2).peekable();
    for k in 0..=count {
        let x = low + (high - low) * f64::from(k) / f64::from(count.max(1));
        // on to the pair of points that has x between them
        while pairs.next_if(|pair| pair[1].0 < x).is_some() {}
        let Some(&&[(x0, y0), (x1, y1)]) = pairs.peek() else {
            break;
        };
        if x0 <= x && x1 > x0 {
            places.push((x, y0 + (x - x0) / (x1 - x0) * (y1 - y0)));
        }
    }
    if places.is_empty() {
        places.extend(points.first());
    }
    places
}

/// The range from the smallest to the largest value, widened if both are equal.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    let pad = if high > low {
        0.0
    } else {
        0.5 * high.abs().max(1.0)
    };
    [low - pad, high + pad]
}

/// Writes a number with up to three digits, or with two and an exponent if it is very small or large.
fn short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        size if (1e-2..1e4).contains(&size) => {
            let before_point = size.log10().floor().max(0.0) as usize + 1;
            format!("{value:.*}", 3_usize.saturating_sub(before_point))
        }
        _ => format!("{value:.1e}"),
    }
}

/// Puts the escape sequence of a colour around a text, if `in_colour`.
fn coloured(text: &str, code: &str, in_colour: bool) -> String {
    if in_colour {
        format!("\x1b[{code}m{text}\x1b[0m")
    } else {
        text.to_owned()
    }
}

/// The text of a drawn buffer, with the escape sequences of its colours if `in_colour`.
fn text_of(buffer: &Buffer, in_colour: bool) -> String {
    let mut text = String::new();
    for y in 0..buffer.area.height {
        let mut line = String::new();
        for x in 0..buffer.area.width {
            let Some(cell) = buffer.cell((x, y)) else {
                continue;
            };
            let look = LOOKS.iter().find(|look| look.colour == cell.fg);
            match look {
                Some(look) => line += &coloured(cell.symbol(), look.code, in_colour),
                None => line += cell.symbol(),
            }
        }
        text += line.trim_end();
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_that_rises_begins_below_and_ends_above() {
        let chart = Chart {
            title: "A line".into(),
            across: "s".into(),
            curves: vec![Curve {
                name: "σ_n",
                points: vec![(0.0, -2.0), (1.0, 3.0)],
            }],
            scale: Scale::Within(-2.0..3.0),
            note: None,
        };
        let drawn = chart.draw(40, 10, false);
        let lines: Vec<&str> = drawn.lines().collect();
        assert_eq!(lines.len(), 11);
        assert!(lines[0] == "A line   ─ σ_n", "{drawn}");
        assert!(lines[1].trim_start().starts_with("3.00"), "{drawn}");
        let place = |line: &str| {
            line.chars()
                .position(|c| ('\u{2801}'..='\u{28ff}').contains(&c))
        };
        assert!(place(lines[1]) > place(lines[6]), "{drawn}");
        assert!(
            !drawn.contains('\x1b') && chart.draw(40, 10, true).contains("\x1b[36m"),
            "{drawn}"
        );
    }

    #[test]
    fn curves_differ_without_colours() {
        let level = |name, y| Curve {
            name,
            points: (0..=10).map(|k| (f64::from(k), y)).collect(),
        };
        let chart = Chart {
            title: "Three".into(),
            across: "s".into(),
            curves: vec![level("a", 1.0), level("b", 2.0), level("c", 3.0)],
            scale: Scale::Within(0.0..4.0),
            note: None,
        };
        let drawn = chart.draw(60, 20, false);
        let lines: Vec<&str> = drawn.lines().collect();
        assert_eq!(lines[0], "Three   ─ a   • b   · c");
        let count = |mark: &dyn Fn(char) -> bool| {
            let rows = lines[1..]
                .iter()
                .map(|line| line.chars().filter(|c| mark(*c)).count());
            rows.max().unwrap()
        };
        let braille = count(&|c| ('\u{2801}'..='\u{28ff}').contains(&c));
        let (dots, single) = (count(&|c| c == '•'), count(&|c| c == '·'));
        assert!(braille > 40 && dots > 40, "{drawn}");
        assert!((20..=31).contains(&single), "{drawn}");
    }

    #[test]
    fn a_peak_beyond_the_axis_does_not_hide_the_curve() {
        let curve: Vec<(f64, f64)> = (0..=100)
            .map(|k| f64::from(k) / 100.0)
            .map(|s| (s, if s == 0.5 { -1e5 } else { -1.0 - s }))
            .collect();
        let chart = Chart {
            title: "Stresses".into(),
            across: "s".into(),
            curves: vec![Curve {
                name: "σ_n",
                points: curve,
            }],
            scale: Scale::Within(-4.0..0.0),
            note: Some("σ_n: peak −100000 at s = 0.5; the axis ends before it".into()),
        };
        let drawn = chart.draw(40, 14, false);
        let lines: Vec<&str> = drawn.lines().collect();
        assert_eq!(lines[0], "Stresses   ─ σ_n");
        assert!(
            lines[1].starts_with("σ_n: peak −100000 at s = 0.5"),
            "{drawn}"
        );
        assert!(drawn.contains("-4.00"), "{drawn}");
        // the curve runs from −1 to −2, in more than one line of characters, and to the end of the axis at the peak
        let of_curve = |line: &&&str| line.chars().any(|c| ('\u{2801}'..='\u{28ff}').contains(&c));
        let rows = lines.iter().filter(of_curve).count();
        assert!(rows >= 8, "{drawn}");
        let left = |line: &str| {
            line.chars()
                .take(20)
                .any(|c| c as u32 > 0x2800 && (c as u32) < 0x2900)
        };
        assert!(
            lines.iter().filter(|line| left(line)).count() >= 2,
            "{drawn}"
        );
    }

    #[test]
    fn a_chart_without_curves_says_so() {
        let none = Chart {
            title: "Convergence".into(),
            across: "iteration".into(),
            curves: vec![Curve {
                name: "residual",
                points: vec![(1.0, 0.0)],
            }],
            scale: Scale::Logarithmic,
            note: None,
        };
        assert_eq!(
            none.draw(40, 10, false),
            "Convergence: there is nothing to draw\n"
        );
    }
}
