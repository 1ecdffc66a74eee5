//! The page of a figure: size, background, title, and how numbers and names are written.

use std::collections::BTreeSet;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::theme::Theme;
use solver::error::shortened;
use solver::problem::Units;
use solver::solution::{Accuracy, ErrorMethod, Verdict};

/// Width of every figure (pixels).
pub(super) const WIDTH: i32 = 720;
/// Height of the title (pixels).
pub(super) const HEAD: i32 = 40;
/// Height of a note under the title (pixels).
const NOTE: i32 = 22;
/// plotters draws in whole units: a tenth of a pixel keeps curves smooth.
pub(super) const FINE: i32 = 10;
const FONT: &str = "sans-serif";
/// Height of numbers, legends and names (pixels): 5 pt or more in a column of 9 cm.
pub(super) const LETTERS: i32 = 15;
/// Characters of a title that are shown; in smaller letters where it is long.
const TITLE: usize = 84;

pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(super) type Fallible<T> = Result<T, Box<dyn std::error::Error>>;

/// Pixels in the units of the drawing.
pub(super) const fn px(pixels: i32) -> i32 {
    pixels * FINE
}

/// A page `height` pixels high below its title, and the note under it if there is one. `draw` gets the area below the title, and returns
/// further SVG that is put on top, in the units of the drawing; its origin is the title's height above the area.
pub(super) fn page(
    theme: Theme,
    title: &str,
    note: Option<&str>,
    height: i32,
    draw: impl FnOnce(&Area<'_>) -> Fallible<String>,
) -> Result<String, String> {
    let head = HEAD + note.map_or(0, |_| NOTE);
    let size = (WIDTH, head + height);
    let mut svg = String::new();
    let drawn = || -> Fallible<String> {
        let fine = (px(size.0) as u32, px(size.1) as u32);
        let root = SVGBackend::with_string(&mut svg, fine).into_drawing_area();
        let palette = theme.palette();
        root.fill(&palette.background)?;
        let middle = (px(WIDTH / 2), px(HEAD / 2));
        let at = Pos::new(HPos::Center, VPos::Center);
        let title = shortened(title, TITLE);
        // a line holds 62 letters of 19 pixels
        let letters = (19 * 62 / title.chars().count().max(62)) as i32;
        let style = text(theme, letters).pos(at);
        root.draw(&Text::new(title, middle, style))?;
        if let Some(note) = note {
            let under = (px(WIDTH / 2), px(HEAD + NOTE / 2 - 4));
            root.draw(&Text::new(
                note.to_owned(),
                under,
                text(theme, LETTERS).pos(at),
            ))?;
        }
        let (_, below) = root.split_vertically(px(head));
        let over = draw(&below)?;
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
    // it knows of the title alone
    let over = match note {
        Some(_) => format!(r#"<g transform="translate(0 {})">{over}</g>"#, px(NOTE)),
        None => over,
    };
    match svg.rfind("</svg>") {
        Some(end) => Ok(format!("{}{over}{}", &svg[..end], &svg[end..])),
        None => Err("the drawing has no end".to_owned()),
    }
}

/// Text of a height in pixels.
pub(super) fn text(theme: Theme, pixels: i32) -> TextStyle<'static> {
    // plotters writes a font of size s as s/1.24
    (FONT, 1.24 * f64::from(px(pixels)))
        .into_font()
        .color(&theme.palette().text)
}

/// A line of text with its left end and its middle at a place (pixels).
pub(super) fn draw_text(
    area: &Area<'_>,
    theme: Theme,
    words: &str,
    (x, y): (i32, i32),
) -> Fallible<()> {
    let style = text(theme, LETTERS).pos(Pos::new(HPos::Left, VPos::Center));
    area.draw(&Text::new(words.to_owned(), (px(x), px(y)), style))?;
    Ok(())
}

/// How wide a text of that height is at most, without asking a font (pixels).
pub(super) fn width(words: &str) -> i32 {
    8 * words.chars().count() as i32
}

/// The verdict on a result, for the note of a figure.
pub(super) fn verdict(accuracy: Option<&Accuracy>) -> Option<String> {
    let accuracy = accuracy?;
    let unlimited = accuracy.quantities.iter();
    let unlimited = unlimited.filter(|q| q.method == ErrorMethod::NoLimit);
    let names: BTreeSet<&str> = unlimited.map(|q| <&str>::from(q.quantity)).collect();
    let names: Vec<String> = names.iter().map(|name| name.replace('_', " ")).collect();
    let without = match &names[..] {
        [] => String::new(),
        names => format!("; no limit: {}", names.join(", ")),
    };
    let verdict = match accuracy.verdict {
        // the note has one line
        Verdict::Good if !names.is_empty() => "good",
        Verdict::Fair if !names.is_empty() => "fair",
        other => other.in_words(),
    };
    Some(format!("accuracy: {verdict}{without}"))
}

/// A quantity with its unit, where there is one.
pub(super) fn with_unit(name: &str, unit: Option<&str>) -> String {
    match unit {
        Some(unit) if !unit.is_empty() => format!("{name} [{unit}]"),
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

/// A number for an axis: at most six digits, without trailing zeros, with a true minus.
pub(super) fn number(value: f64) -> String {
    digits(value).replace('-', "−")
}

/// The number of a tick on an axis of some length: a rounding error beside zero is zero.
pub(super) fn tick(value: f64, length: f64) -> String {
    let small = value.abs() < 1e-9 * length.abs();
    number(if small { 0.0 } else { value })
}

fn digits(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e6).contains(&value.abs()) {
        let text = format!("{value:.3e}");
        let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
        let digits = digits.trim_end_matches('0').trim_end_matches('.');
        return format!("{digits}e{power}");
    }
    let digits = 5 - (value.abs().max(1.0).log10().floor() as usize).min(5);
    let text = format!("{value:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// The first of these steps, times a power of ten, that is not below a positive number.
pub(super) fn round_up(value: f64, steps: &[f64]) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    let mut rounds = steps.iter().map(|step| step * power);
    // up to rounding above counts as equal
    let fits = rounds.find(|round| *round >= value * (1.0 - 1e-9));
    fits.unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axis_numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (0.1 + 0.2, "0.3"),
            (-11507.26, "−11507.3"),
            (250.0, "250"),
            (1e-9, "1e−9"),
            (2.5e7, "2.5e7"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn a_rounding_error_beside_zero_is_shown_as_zero() {
        assert_eq!(tick(1.388e-17, 0.1), "0");
        assert_eq!(tick(1.388e-17, 1e-16), "1.388e−17");
    }

    #[test]
    fn round_numbers_are_one_two_and_five() {
        for (value, round) in [(0.9, 1.0), (1.1, 2.0), (3.0, 5.0), (5.0, 5.0), (7e-4, 1e-3)] {
            assert!((round_up(value, &[1.0, 2.0, 5.0]) - round).abs() < 1e-12 * round);
        }
    }

    #[test]
    fn a_title_is_escaped_and_shortened() {
        let title = format!("<script>&\u{1}{}", "x".repeat(200));
        let svg = page(Theme::Dark, &title, None, 50, |_| Ok("<g/>".to_owned())).unwrap();
        assert!(
            !svg.contains("<script>")
                && !svg.contains('\u{1}')
                && svg.contains("&lt;script&gt;&amp;")
        );
        assert!(svg.contains('…') && svg.trim_end().ends_with("<g/></svg>"));
        assert!(svg.starts_with(r#"<svg width="720" height="90" viewBox="0 0 7200 900""#));
        let noted = page(Theme::Dark, &title, Some("accuracy: good"), 50, |_| {
            Ok(String::new())
        });
        let noted = noted.unwrap();
        assert!(
            noted.starts_with(r#"<svg width="720" height="112""#)
                && noted.contains("accuracy: good")
        );
    }
}
