//! The page of a figure: size, background, the texts around it, and the format of numbers and names.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::caption::{Caption, Mark};
use super::style::{Style, Texts};
use super::theme::hex;
use solver::error::shortened;
use solver::problem::Units;
use solver::solution::Verdict;

/// The height of the title (pixels).
const TITLE: i32 = 34;
/// The height of a line of text below the title (pixels).
const LINE: i32 = 22;
/// The height of a line of warnings (pixels).
const FOOT: i32 = 17;
/// The height of the letters of warnings (pixels).
const SMALL: i32 = 12;
/// The space left of title and warnings, and right of the verdict (pixels).
const MARGIN: i32 = 8;
/// The number of units of the drawing per pixel: plotters draws in whole units, and a tenth of a pixel keeps curves
/// smooth.
pub(super) const FINE: i32 = 10;
const FONT: &str = "sans-serif";
/// The height of numbers, legends and names (pixels): 7 pt in a column of 88 mm.
pub(super) const LETTERS: i32 = 15;
/// The height of the letters of a title (pixels); a long title has smaller letters.
const LARGE: i32 = 19;
const LONGEST: usize = 84;
/// The largest number of lines of warnings, and the largest number of lines of parameters.
const LINES: usize = 6;

pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(super) type Fallible<T> = Result<T, Box<dyn std::error::Error>>;

/// Converts pixels to the units of the drawing.
pub(super) const fn px(pixels: i32) -> i32 {
    pixels * FINE
}

/// The height of the texts above the figure (pixels), and the lines below the title.
fn head(style: Style, caption: &Caption) -> (i32, Vec<Line>) {
    match style.texts {
        Texts::Bare => (MARGIN, vec![]),
        Texts::Full => {
            let lines = above(style, caption);
            (TITLE + LINE * lines.len() as i32, lines)
        }
    }
}

/// The height of the texts below the figure (pixels), and their lines.
fn tail(style: Style, caption: &Caption) -> (i32, Vec<String>) {
    let lines = match style.texts {
        Texts::Bare => vec![],
        Texts::Full => foot(style, caption),
    };
    let margin = if lines.is_empty() { 0 } else { MARGIN };
    (FOOT * lines.len() as i32 + margin, lines)
}

/// The height that a page with a given height has for the figure (pixels).
pub(super) fn room(style: Style, caption: &Caption) -> Option<i32> {
    let texts = head(style, caption).0 + tail(style, caption).0;
    style.height().map(|height| height - texts)
}

/// Draws a page: a figure `height` pixels high between the texts of its caption. `draw` draws the figure in the given
/// area and returns SVG to be put on top, in the units of the drawing, from the area's upper left corner.
pub(super) fn page(
    style: Style,
    caption: &Caption,
    height: i32,
    draw: impl FnOnce(&Area<'_>) -> Fallible<String>,
) -> Result<String, String> {
    let width = style.width();
    let (head, above) = head(style, caption);
    let (below, foot) = tail(style, caption);
    // on a page with a given height the figure is in the middle of what it leaves
    let spare = (room(style, caption).unwrap_or(height) - height).max(0);
    let (head, end) = (head + spare / 2, head + height + spare);
    let size = (width, end + below);
    let mut svg = String::new();
    let drawn = || -> Fallible<String> {
        let fine = (px(size.0) as u32, px(size.1) as u32);
        let root = SVGBackend::with_string(&mut svg, fine).into_drawing_area();
        let palette = style.palette();
        root.fill(&palette.background)?;
        let title = match style.texts {
            Texts::Full => shortened(&caption.title, LONGEST),
            Texts::Bare => String::new(),
        };
        let fits = bold_letters(width);
        let letters = (LARGE as usize * fits / title.chars().count().max(fits)) as i32;
        let font = (FONT, plotters_size(letters), FontStyle::Bold).into_font();
        let bold = font.color(&palette.text).pos(at(HPos::Left));
        root.draw(&Text::new(title, (px(MARGIN), px(TITLE / 2 + 2)), bold))?;
        for (k, line) in (0..).zip(&above) {
            let middle = px(TITLE + LINE * k + LINE / 2 - 3);
            let left = text(style, LETTERS).pos(at(HPos::Left));
            root.draw(&Text::new(line.left.clone(), (px(MARGIN), middle), left))?;
            if let Some(mark) = line.right {
                let colour = colour(style, mark);
                let right = text(style, LETTERS).pos(at(HPos::Right)).color(&colour);
                root.draw(&Text::new(
                    mark.words(),
                    (px(width - MARGIN), middle),
                    right,
                ))?;
            }
        }
        for (k, line) in (0..).zip(&foot) {
            let middle = px(end + FOOT * k + FOOT / 2);
            let faint = text(style, SMALL).color(&palette.faint).pos(at(HPos::Left));
            root.draw(&Text::new(line.clone(), (px(MARGIN), middle), faint))?;
        }
        let (_, rest) = root.split_vertically(px(head));
        let (figure, _) = rest.split_vertically(px(height));
        let over = draw(&figure)?;
        root.present()?;
        Ok(over)
    };
    let over = drawn().map_err(|error| error.to_string())?;
    // the view box stays fine; the size is given in pixels
    let fine = format!(r#"width="{}" height="{}""#, px(size.0), px(size.1));
    let size = format!(r#"width="{}" height="{}""#, size.0, size.1);
    let mut svg = svg.replacen(&fine, &size, 1);
    // names come from clients, and XML does not allow these characters
    svg.retain(|c| c == '\n' || !(c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}')));
    let svg = with_subscripts(&svg);
    match svg.rfind("</svg>") {
        Some(end) => Ok(format!(
            "{}<g transform=\"translate(0 {})\">{over}</g>{}",
            &svg[..end],
            px(head),
            &svg[end..]
        )),
        None => Err("the drawing has no end".to_owned()),
    }
}

fn at(side: HPos) -> Pos {
    Pos::new(side, VPos::Center)
}

fn colour(style: Style, mark: Mark) -> RGBColor {
    let palette = style.palette();
    match mark {
        Mark::Verdict(Verdict::Good) => palette.good,
        Mark::Verdict(Verdict::Fair) => palette.fair,
        Mark::Verdict(Verdict::Poor) | Mark::Partial(_) => palette.poor,
    }
}

/// A line of text below the title.
struct Line {
    left: String,
    right: Option<Mark>,
}

/// The lines below the title: the parameters, with as many contacts in a line as fit, and the mark at the right of the
/// first line that has room for it.
fn above(style: Style, caption: &Caption) -> Vec<Line> {
    let room = style.width() - 2 * MARGIN;
    let parameters = wrapped(&caption.parameters, ";  ", room, width);
    let mut lines: Vec<Line> = parameters
        .into_iter()
        .filter(|left| !left.is_empty())
        .map(|left| Line { left, right: None })
        .collect();
    if let Some(mark) = caption.mark {
        let wide = width(&mark.words()) + 16;
        match lines
            .iter_mut()
            .find(|line| width(&line.left) + wide <= room)
        {
            Some(line) => line.right = Some(mark),
            None => lines.push(Line {
                left: String::new(),
                right: Some(mark),
            }),
        }
    }
    lines
}

/// The lines of warnings below the figure.
fn foot(style: Style, caption: &Caption) -> Vec<String> {
    if caption.warnings.is_empty() {
        return vec![];
    }
    let mut words: Vec<String> = caption.warnings.clone();
    let last = words.len() - 1;
    words[..last].iter_mut().for_each(|word| word.push(';'));
    words[0].insert_str(0, "Warnings: ");
    let small = |text: &str| width(text) * SMALL / LETTERS;
    wrapped(&words, " ", style.width() - 2 * MARGIN, small)
}

/// Joins texts to lines of at most the width `room`; lines after the first [`LINES`] are replaced by `…`.
fn wrapped(texts: &[String], between: &str, room: i32, width: impl Fn(&str) -> i32) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for text in texts {
        match lines.last_mut() {
            Some(line) if width(line) + width(between) + width(text) <= room => {
                line.push_str(between);
                line.push_str(text);
            }
            _ => lines.push(text.clone()),
        }
    }
    if lines.len() > LINES {
        lines.truncate(LINES);
        if let Some(last) = lines.last_mut() {
            last.push_str(" …");
        }
    }
    lines
}

/// The style of a text of this height (pixels).
pub(super) fn text(style: Style, pixels: i32) -> TextStyle<'static> {
    (FONT, plotters_size(pixels))
        .into_font()
        .color(&style.palette().text)
}

/// The font size with which plotters draws letters of a height (pixels): it writes a font of size s as s/1.24.
fn plotters_size(pixels: i32) -> f64 {
    1.24 * f64::from(px(pixels))
}

/// Draws a line of text whose left end, at half height, is at a place (pixels).
pub(super) fn draw_text(
    area: &Area<'_>,
    style: Style,
    words: &str,
    (x, y): (i32, i32),
) -> Fallible<()> {
    let style = text(style, LETTERS).pos(at(HPos::Left));
    area.draw(&Text::new(words.to_owned(), (px(x), px(y)), style))?;
    Ok(())
}

/// The approximate width (pixels) of a text of the height [`LETTERS`], without reading a font: fonts differ, and a wide
/// font is assumed.
pub(super) fn width(words: &str) -> i32 {
    43 * words.chars().count() as i32 / 5
}

/// The place of an entry of a legend: its row, and its left end (pixels).
pub(super) struct LegendPlace {
    pub(super) row: i32,
    pub(super) x: i32,
}

/// Places the entries of a legend in rows that begin at `left` and end before `end`. An entry is a sample of a line and words, followed by
/// the space `gap` (pixels).
pub(super) fn legend_places<'a>(
    end: i32,
    left: i32,
    gap: i32,
    words: impl Iterator<Item = &'a str>,
) -> Vec<LegendPlace> {
    let (mut x, mut row) = (left, 0);
    let placed = words.map(|words| {
        let width = 28 + width(words) + gap;
        if x > left && x + width > end {
            (x, row) = (left, row + 1);
        }
        let place = LegendPlace { row, x };
        x += width;
        place
    });
    placed.collect()
}

/// The number of large bold letters that fit on a line of this width (pixels).
fn bold_letters(width: i32) -> usize {
    ((width - 2 * MARGIN) / 13).max(1) as usize
}

/// Adds subscripts to SVG: `σ_xx` becomes σ with lowered letters. Their sizes are numbers, since not every program
/// reads relative sizes.
fn with_subscripts(svg: &str) -> String {
    let mut out = String::with_capacity(svg.len());
    let mut rest = svg;
    while let Some(place) = rest.find("σ_") {
        let (before, from) = rest.split_at(place);
        out.push_str(before);
        let after = &from["σ_".len()..];
        let end = after
            .find(|c: char| !c.is_alphabetic())
            .unwrap_or(after.len());
        let (index, tail) = after.split_at(end);
        // only inside of a text, and only an index
        let Some(close) = tail.find('<').filter(|_| (1..=4).contains(&index.len())) else {
            out.push_str("σ_");
            rest = after;
            continue;
        };
        let letters = font_size(&out).unwrap_or(f64::from(px(LETTERS)));
        let (small, down) = ((0.72 * letters).round(), (0.2 * letters).round());
        out.push_str(&format!(
            r#"σ<tspan dy="{down}" font-size="{small}">{index}</tspan>"#
        ));
        let stop = tail[..close].find("σ_").unwrap_or(close);
        let (following, tail) = tail.split_at(stop);
        if following.trim().is_empty() && stop == close {
            out.push_str(following);
        } else {
            // back to the line
            out.push_str(&format!(r#"<tspan dy="-{down}">{following}</tspan>"#));
        }
        rest = tail;
    }
    out.push_str(rest);
    out
}

/// The font size of the last text element that begins in this part of an SVG.
fn font_size(svg: &str) -> Option<f64> {
    const NAME: &str = "font-size=\"";
    let text = &svg[svg.rfind("<text")?..];
    let value = &text[text.find(NAME)? + NAME.len()..];
    value.split('"').next()?.parse().ok()
}

/// The name of a quantity with its unit, if it has one.
pub(super) fn with_unit(name: &str, unit: Option<&str>) -> String {
    match unit {
        Some(unit) if !unit.is_empty() => format!("{name} ({unit})"),
        _ => name.to_owned(),
    }
}

/// The unit of length of a problem.
pub(super) fn length(units: &Option<Units>) -> Option<&str> {
    units.as_ref()?.length.as_deref()
}

/// The unit of stress of a problem.
pub(super) fn stress(units: &Option<Units>) -> Option<&str> {
    units.as_ref()?.stress.as_deref()
}

/// A transparent rectangle of a colour, as SVG.
pub(super) fn tinted(colour: RGBColor, opacity: f64) -> String {
    format!(r#"fill="{}" fill-opacity="{opacity}""#, hex(colour))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::{Size, Theme};

    #[test]
    fn a_title_is_escaped_and_shortened() {
        let caption = Caption {
            title: format!("<script>&\u{1}{}", "x".repeat(200)),
            ..Caption::default()
        };
        let svg = page(Theme::Dark.into(), &caption, 50, |_| Ok("<g/>".to_owned())).unwrap();
        assert!(
            !svg.contains("<script>")
                && !svg.contains('\u{1}')
                && svg.contains("&lt;script&gt;&amp;")
        );
        assert!(svg.contains('…') && svg.trim_end().ends_with("<g/></g></svg>"));
        assert!(svg.starts_with(r#"<svg width="720" height="84" viewBox="0 0 7200 840""#));
    }

    #[test]
    fn texts_take_as_many_lines_as_they_need() {
        let caption = |contacts: usize| Caption {
            title: "Title".into(),
            parameters: vec![
                "a contact:  μ = 0.3   ρ = 0.01 mm   ε = 1e−4 mm".into();
                contacts
            ],
            mark: Some(Mark::Verdict(Verdict::Good)),
            warnings: vec!["an assumption is violated".into(); 9],
        };
        let style = |size| Style {
            size,
            ..Style::default()
        };
        let lines = |size, contacts| {
            let lines = above(style(size), &caption(contacts));
            let marked = lines.iter().position(|line| line.right.is_some());
            (lines.len(), marked)
        };
        assert_eq!(lines(Size::Page, 1), (1, Some(0)));
        assert_eq!(lines(Size::Column, 1), (2, Some(1)), "no room beside it");
        assert_eq!(lines(Size::Page, 3).0, 3);
        assert_eq!(lines(Size::Page, 30), (LINES, Some(0)));
        let foot = foot(style(Size::Column), &caption(1));
        assert!(
            foot.len() > 2 && foot[0].starts_with("Warnings: an assumption"),
            "{foot:?}"
        );
    }

    #[test]
    fn an_index_stands_below_the_line_and_nothing_else_does() {
        assert_eq!(
            with_subscripts("<text font-size=\"100\">\nstress σ_xx (MPa)\n</text>"),
            "<text font-size=\"100\">\nstress σ<tspan dy=\"20\" font-size=\"72\">xx</tspan><tspan dy=\"-20\"> (MPa)\n</tspan></text>"
        );
        assert_eq!(
            with_subscripts("<text>\nσ_n\n</text>"),
            "<text>\nσ<tspan dy=\"30\" font-size=\"108\">n</tspan>\n</text>"
        );
        let two = with_subscripts("<text font-size=\"100\">σ_n and σ_t</text>");
        assert_eq!(two.matches("font-size=\"72\"").count(), 2, "{two}");
        assert!(!two.contains('_'));
        for plain in ["<text>σ_ of</text>", "<text>my_σ_experiment</text>", "σ_n"] {
            assert_eq!(with_subscripts(plain), plain);
        }
    }
}
