//! Reads the SVG of a figure, shape by shape: only the elements that plotters and `body` write. Any other element is an
//! error, and is not left out.

use roxmltree::{Document, Node};
use tiny_skia::{FillRule, Path, PathBuilder, Rect};

use super::letters::{Fonts, Letter};

/// A surface that a figure is drawn on. Places and lengths are in units of the drawing, y points down.
pub(super) trait Canvas {
    /// Fills a path (`inside`) and draws a line along it.
    fn shape(
        &mut self,
        path: &Path,
        inside: Option<(FillRule, Paint)>,
        line: Option<(Stroke, Paint)>,
    );
    /// Draws letters on a line.
    fn letters(&mut self, line: &Line<'_>, paint: Paint);
    /// Clips everything that is drawn next to a rectangle; `None` ends the clipping.
    fn clip(&mut self, to: Option<Rect>);
}

/// A colour with opacity, from 0 (invisible) to 1 (opaque).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Paint {
    pub(super) rgb: [u8; 3],
    pub(super) opacity: f32,
}

/// The style of a line. Its ends are square and its joins mitred unless they are round.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Stroke {
    pub(super) width: f32,
    pub(super) round_ends: bool,
    pub(super) round_joins: bool,
    /// The lengths of dashes and of the gaps between them; empty for a solid line.
    pub(super) dashes: Vec<f32>,
}

/// Letters of one size on a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line<'a> {
    pub(super) letters: &'a [Letter],
    pub(super) size: f32,
    pub(super) start: [f32; 2],
    /// The direction of the line, as a vector of length 1.
    pub(super) along: [f32; 2],
}

/// The width and the height of a figure, in units of the drawing.
pub(super) fn size(figure: &Document<'_>) -> Result<[f32; 2], String> {
    match numbers(required(figure.root_element(), "viewBox")?)?[..] {
        [_, _, width, height] if width > 0.0 && height > 0.0 => Ok([width, height]),
        _ => Err("it has no size".to_owned()),
    }
}

/// Draws a figure.
pub(super) fn draw(
    figure: &Document<'_>,
    fonts: &Fonts,
    canvas: &mut impl Canvas,
) -> Result<(), String> {
    content(figure.root_element(), [0.0; 2], fonts, canvas)
}

/// Draws the content of an element, shifted by `from`.
fn content(
    parent: Node<'_, '_>,
    from: [f32; 2],
    fonts: &Fonts,
    canvas: &mut impl Canvas,
) -> Result<(), String> {
    for node in parent.children().filter(Node::is_element) {
        match node.tag_name().name() {
            "g" => {
                let [x, y] = arguments(required(node, "transform")?, "translate")?;
                content(node, [from[0] + x, from[1] + y], fonts, canvas)?;
            }
            "svg" => {
                let [x, y, width, height] = rectangle(node, from)?;
                canvas.clip(Rect::from_xywh(x, y, width, height));
                content(node, [x, y], fonts, canvas)?;
                canvas.clip(None);
            }
            "text" => text(node, from, fonts, canvas)?,
            _ => shape(node, from, canvas)?,
        }
    }
    Ok(())
}

fn shape(node: Node<'_, '_>, from: [f32; 2], canvas: &mut impl Canvas) -> Result<(), String> {
    // a path that is a single point has nothing to show
    let Some(path) = outline(node, from)? else {
        return Ok(());
    };
    let rule = match node.attribute("fill-rule") {
        Some("evenodd") => FillRule::EvenOdd,
        _ => FillRule::Winding,
    };
    let inside = paint(node, "fill")?.map(|paint| (rule, paint));
    let line = match paint(node, "stroke")? {
        None => None,
        Some(paint) => {
            let stroke = Stroke {
                width: inherited(node, "stroke-width").map_or(Ok(1.0), number)?,
                round_ends: inherited(node, "stroke-linecap") == Some("round"),
                round_joins: inherited(node, "stroke-linejoin") == Some("round"),
                dashes: inherited(node, "stroke-dasharray").map_or(Ok(vec![]), numbers)?,
            };
            Some((stroke, paint))
        }
    };
    canvas.shape(&path, inside, line);
    Ok(())
}

/// The path of a shape, shifted by `from`; none if the path is empty.
fn outline(node: Node<'_, '_>, from: [f32; 2]) -> Result<Option<Path>, String> {
    let value = |name| number(required(node, name)?);
    let mut path = PathBuilder::new();
    match node.tag_name().name() {
        "rect" => {
            let [x, y, width, height] = rectangle(node, from)?;
            if let Some(rect) = Rect::from_xywh(x, y, width, height) {
                path.push_rect(rect);
            }
        }
        "circle" => path.push_circle(from[0] + value("cx")?, from[1] + value("cy")?, value("r")?),
        "line" => {
            path.move_to(from[0] + value("x1")?, from[1] + value("y1")?);
            path.line_to(from[0] + value("x2")?, from[1] + value("y2")?);
        }
        kind @ ("polyline" | "polygon") => {
            for (k, point) in numbers(required(node, "points")?)?
                .chunks_exact(2)
                .enumerate()
            {
                let (x, y) = (from[0] + point[0], from[1] + point[1]);
                if k == 0 {
                    path.move_to(x, y);
                } else {
                    path.line_to(x, y);
                }
            }
            if kind == "polygon" {
                path.close();
            }
        }
        "path" => commands(required(node, "d")?, from, &mut path)?,
        other => return Err(format!("it contains <{other}>")),
    }
    Ok(path.finish())
}

/// Adds the commands of an SVG path: `M` and `L` with places; `l` and `q` with steps from the last place; `z`.
fn commands(path: &str, from: [f32; 2], to: &mut PathBuilder) -> Result<(), String> {
    let mut here = from;
    let mut commands = path
        .match_indices(|c: char| c.is_ascii_alphabetic())
        .peekable();
    while let Some((place, command)) = commands.next() {
        let end = commands.peek().map_or(path.len(), |next| next.0);
        // a minus sign separates numbers, too
        let values = numbers(&path[place + 1..end].replace('-', " -"))?;
        match command {
            "M" | "L" => {
                for point in values.chunks_exact(2) {
                    here = [from[0] + point[0], from[1] + point[1]];
                    if command == "M" {
                        to.move_to(here[0], here[1]);
                    } else {
                        to.line_to(here[0], here[1]);
                    }
                }
            }
            "l" => {
                for step in values.chunks_exact(2) {
                    here = [here[0] + step[0], here[1] + step[1]];
                    to.line_to(here[0], here[1]);
                }
            }
            "q" => {
                for step in values.chunks_exact(4) {
                    let middle = [here[0] + step[0], here[1] + step[1]];
                    here = [here[0] + step[2], here[1] + step[3]];
                    to.quad_to(middle[0], middle[1], here[0], here[1]);
                }
            }
            "z" => to.close(),
            other => return Err(format!("a path has the command {other}")),
        }
    }
    Ok(())
}

/// Draws a text, with letters of several sizes and with subscripts.
fn text(
    node: Node<'_, '_>,
    from: [f32; 2],
    fonts: &Fonts,
    canvas: &mut impl Canvas,
) -> Result<(), String> {
    let Some(paint) = paint(node, "fill")? else {
        return Ok(());
    };
    let bold = node.attribute("font-weight") == Some("bold");
    let mut parts = Vec::new();
    let (mut down, mut wide) = (0.0, 0.0);
    for (node, words) in words(node) {
        let size = number(inherited(node, "font-size").ok_or("a text has no size")?)?;
        if node.is_element() {
            down += node
                .attribute("dy")
                .map_or(Ok(0.0), |dy| length(dy, size))?;
        }
        let (letters, width) = fonts.line(&words, bold);
        parts.push((letters, size, wide, down));
        wide += width * size;
    }
    let before = match required(node, "text-anchor")? {
        "end" => wide,
        "middle" => 0.5 * wide,
        _ => 0.0,
    };
    let degrees = match node.attribute("transform") {
        // about the place of the text
        Some(transform) => arguments::<3>(transform, "rotate")?[0],
        None => 0.0,
    };
    let (sin, cos) = degrees.to_radians().sin_cos();
    let [x, y] = ["x", "y"].map(|name| number(required(node, name)?));
    let [x, y] = [from[0] + x?, from[1] + y?];
    for (letters, size, right, down) in &parts {
        let right = right - before;
        let line = Line {
            letters,
            size: *size,
            start: [x + right * cos - down * sin, y + right * sin + down * cos],
            along: [cos, sin],
        };
        canvas.letters(&line, paint);
    }
    Ok(())
}

/// The words of a text, each with the element that it is in. Line ends count as blanks; only the first of several
/// blanks is kept, and none at the ends of the text.
fn words<'a, 'input>(text: Node<'a, 'input>) -> Vec<(Node<'a, 'input>, String)> {
    let mut words: Vec<(Node<'a, 'input>, String)> = Vec::new();
    let mut blank = true;
    for part in text.descendants().filter(Node::is_text) {
        let mut kept = String::new();
        for char in part.text().unwrap_or_default().chars() {
            let is_blank = matches!(char, ' ' | '\n' | '\t' | '\r');
            if !(is_blank && blank) {
                kept.push(if is_blank { ' ' } else { char });
            }
            blank = is_blank;
        }
        words.push((part.parent().unwrap_or(text), kept));
    }
    if let Some((_, last)) = words.iter_mut().rfind(|(_, words)| !words.is_empty()) {
        last.truncate(last.trim_end_matches(' ').len());
    }
    words
}

/// A length as text, which may be given in heights of letters. `size`: that height.
fn length(text: &str, size: f32) -> Result<f32, String> {
    if let Some(heights) = text.strip_suffix("em") {
        Ok(number(heights)? * size)
    } else if let Some(halves) = text.strip_suffix("ex") {
        // small letters are about half as high
        Ok(number(halves)? * 0.5 * size)
    } else {
        number(text)
    }
}

/// The colour of an element's fill or line, as `what` says; `None` if it is not drawn.
fn paint(node: Node<'_, '_>, what: &str) -> Result<Option<Paint>, String> {
    let Some(colour) = inherited(node, what).filter(|colour| *colour != "none") else {
        return Ok(None);
    };
    let digits = colour.strip_prefix('#').filter(|digits| digits.len() == 6);
    let value = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
    let [_, r, g, b] = value.ok_or_else(|| unreadable(colour))?.to_be_bytes();
    let mut opacity = 1.0;
    for name in ["opacity", &format!("{what}-opacity")] {
        opacity *= node.attribute(name).map_or(Ok(1.0), number)?;
    }
    Ok(Some(Paint {
        rgb: [r, g, b],
        opacity: opacity.clamp(0.0, 1.0),
    }))
}

fn rectangle(node: Node<'_, '_>, from: [f32; 2]) -> Result<[f32; 4], String> {
    let value = |name| number(required(node, name)?);
    let [x, y] = [value("x")?, value("y")?];
    Ok([from[0] + x, from[1] + y, value("width")?, value("height")?])
}

/// An attribute of an element, or of the nearest element around it that has the attribute.
fn inherited<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    node.ancestors().find_map(|node| node.attribute(name))
}

fn required<'a>(node: Node<'a, '_>, name: &str) -> Result<&'a str, String> {
    let value = node.attribute(name);
    value.ok_or_else(|| format!("a {} has no {name}", node.tag_name().name()))
}

/// The numbers between the brackets of `name(…)`.
fn arguments<const N: usize>(text: &str, name: &str) -> Result<[f32; N], String> {
    let inside = text.strip_prefix(name).and_then(|rest| {
        let rest = rest.strip_prefix('(')?;
        rest.strip_suffix(')')
    });
    let values = numbers(inside.ok_or_else(|| unreadable(text))?)?;
    values.try_into().map_err(|_| unreadable(text))
}

fn numbers(text: &str) -> Result<Vec<f32>, String> {
    let parts = text.split([' ', ',']).filter(|part| !part.is_empty());
    parts.map(number).collect()
}

fn number(text: &str) -> Result<f32, String> {
    let value = text.parse().ok().filter(|value: &f32| value.is_finite());
    value.ok_or_else(|| unreadable(text))
}

fn unreadable(text: &str) -> String {
    format!("it contains “{}”", solver::error::shortened(text, 40))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What was drawn, in words.
    #[derive(Default)]
    struct Said(Vec<String>);

    impl Canvas for Said {
        fn shape(
            &mut self,
            path: &Path,
            inside: Option<(FillRule, Paint)>,
            line: Option<(Stroke, Paint)>,
        ) {
            if let Some((_, Paint { rgb, opacity })) = inside {
                let b = path.bounds();
                let corners = [b.left(), b.top(), b.right(), b.bottom()];
                self.0.push(format!("fill {corners:?} {rgb:?} {opacity}"));
            }
            if let Some((stroke, _)) = line {
                let (width, dashes) = (stroke.width, stroke.dashes);
                self.0
                    .push(format!("stroke {width} {} {dashes:?}", stroke.round_joins));
            }
        }

        fn letters(&mut self, line: &Line<'_>, _: Paint) {
            let words: String = line.letters.iter().map(|letter| letter.char).collect();
            self.0
                .push(format!("“{words}” {} {}", line.size, line.start[1]));
        }

        fn clip(&mut self, to: Option<Rect>) {
            self.0.push(format!(
                "clip {:?}",
                to.map(|rect| [rect.x(), rect.width()])
            ));
        }
    }

    fn drawn(content: &str) -> Result<Vec<String>, String> {
        let text = format!(r#"<svg viewBox="0 0 100 50">{content}</svg>"#);
        let figure = Document::parse(&text).unwrap();
        let mut said = Said::default();
        draw(&figure, &Fonts::new().unwrap(), &mut said)?;
        Ok(said.0)
    }

    #[test]
    fn shapes_stand_where_the_elements_around_them_put_them() {
        let said = drawn(
            r##"<g transform="translate(0 10)"><svg x="5" y="1" width="20" height="9" stroke-linejoin="round">
            <path fill="#FF0080" fill-opacity="0.5" d="M1 1l2 0-0 3z"/>
            <polyline fill="none" stroke="#000000" stroke-dasharray="5 4" points="0,0 1,1 "/></svg></g>"##,
        );
        assert_eq!(
            said.unwrap(),
            [
                "clip Some([5.0, 20.0])",
                "fill [6.0, 12.0, 8.0, 15.0] [255, 0, 128] 0.5",
                "stroke 1 true [5.0, 4.0]",
                "clip None",
            ]
        );
    }

    #[test]
    fn an_index_is_smaller_and_below_the_line() {
        let said = drawn(
            r##"<text x="0" y="40" dy="0.5ex" text-anchor="start" font-size="20" fill="#000000">
stress  σ<tspan dy="4" font-size="14">xx</tspan><tspan dy="-4"> (MPa)
</tspan></text>"##,
        );
        assert_eq!(
            said.unwrap(),
            ["“stress σ” 20 45", "“xx” 14 49", "“ (MPa)” 20 45"]
        );
    }

    #[test]
    fn an_unknown_element_is_an_error() {
        for (content, reason) in [
            ("<ellipse/>", "it contains <ellipse>"),
            (
                r#"<path d="M0 0C1 1 2 2 3 3"/>"#,
                "a path has the command C",
            ),
            (r#"<circle cx="1" cy="many" r="2"/>"#, "it contains “many”"),
            (r#"<line x1="0" y1="0" x2="1"/>"#, "a line has no y2"),
            (r#"<g transform="scale(2)"/>"#, "it contains “scale(2)”"),
        ] {
            assert_eq!(drawn(content).unwrap_err(), reason);
        }
    }
}
