//! The figure of the mesh: elements, and the named boundaries in colours.

use std::collections::BTreeMap;

use plotters::prelude::*;
use solver::element::Element;
use solver::error::Violation;
use solver::error::shortened;
use solver::mesh::Mesh;
use solver::model::{Level, Model};
use solver::problem::Problem;
use solver::solution::Fields;

use super::body::{self, Frame, Path, Sides, Window};
use super::caption::Caption;
use super::obstacle::Face;
use super::page::{self, Area, Fallible, LegendPlace, draw_text, px, with_unit};
use super::style::Style;
use super::theme::hex;
use crate::external::external_mesh;

/// The height of one line of the legend (pixels).
const LEGEND: i32 = 22;
/// The space left of the legend (pixels).
const LEFT: i32 = 84;
/// The distance of a boundary's line from the body, and between the lines of boundaries with a common side (pixels):
/// the elements at a graded edge stay visible.
const OUTSIDE: f64 = 3.5;
/// The width of a boundary's line (pixels).
const WIDE: f64 = 2.0;
/// The largest number of boundaries that are drawn side by side; further boundaries are drawn over the last.
const BESIDE: usize = 3;
/// The number of elements above which only the outline is drawn: the lines would cover the body, and viewers refuse
/// files of some ten megabytes.
const DRAWN: usize = 30_000;
/// The largest number of boundaries that are drawn and named in the legend.
const MOST: usize = 12;
/// The distance from the body up to which obstacles are in the picture, as a part of the body's size.
const NEAR: f64 = 0.12;
/// A contact whose size is below this part of the body's size is drawn in a window of its own, too.
const SMALL: f64 = 0.2;
/// The smallest size of a window for a small contact, as a part of the body's size.
const CLOSE: f64 = 0.1;

/// Draws the elements between equal axes, each named boundary in a colour of its own, and the obstacles before they are
/// pushed; a small contact has a panel of its own. The elements are those of `fields`, where adaptive refinement has
/// changed them; if `fields` has none, those of the problem.
///
/// # Errors
///
/// The reason in words, if the figure cannot be drawn.
pub fn mesh_svg(
    style: Style,
    caption: &Caption,
    problem: &Problem,
    stored: Option<&Mesh>,
    fields: &Fields,
) -> Result<String, String> {
    let refused = |violations: Vec<Violation>| {
        violations
            .first()
            .map_or_else(String::new, |v| v.to_string())
    };
    let external = external_mesh(problem, stored.cloned());
    let model = Model::new(problem, external).map_err(refused)?;
    let mesh = &model.mesh;
    let refined: Vec<[f64; 2]> = fields
        .x
        .iter()
        .zip(&fields.y)
        .map(|(&x, &y)| [x, y])
        .collect();
    let (elements, nodes) = if fields.elements.is_empty() {
        (&mesh.elements, &mesh.nodes)
    } else {
        (&fields.elements, &refined)
    };
    if elements
        .iter()
        .any(|e| e.iter().any(|&n| n as usize >= nodes.len()))
    {
        return Err("an element has a node that is not there".to_owned());
    }
    let faces: Vec<Face> = model.contacts.iter().map(Face::before).collect();
    let mut windows = windows(&model, nodes, &faces).ok_or("there is no mesh to draw")?;
    if (style.limits.x, style.limits.y) != (None, None) {
        windows = vec![windows[0].limited(style.limits)?];
    }
    let names = in_order(problem, mesh.boundaries.keys().cloned().collect());
    let has_obstacle = faces.iter().any(|face| face.points.len() > 1);
    let entries = entries(problem, &names, has_obstacle);
    let labels = entries.iter().map(|(label, _)| &label[..]);
    let places = page::legend_places(style.width(), LEFT, 20, labels);
    let legend = LEGEND * places.last().map_or(1, |place| place.row + 1) + 6;
    let room = page::room(style, caption).map(|room| room - legend);
    let (frames, height) = body::layout(style, &windows, room);
    let drawing = Drawing::new(elements, nodes);
    // boundaries are those of the problem's own mesh
    let own = Sides::of(&mesh.elements, mesh.nodes.len());
    let content = |frame: &Frame| {
        let mut content = drawing.content(style, frame);
        content.extend(faces.iter().map(|face| face.drawn(style, frame)));
        content += &marks(style, frame, mesh, &own, &names);
        body::inside(style, frame, &content)
    };
    let over: String = frames.iter().map(content).collect();

    let unit = page::length(&problem.units);
    let axes = body::coordinates(&problem.analysis).map(|name| with_unit(name, unit));
    let outline = if drawing.is_outline { " (outline)" } else { "" };
    let count = format!(
        "{} elements, {} nodes{outline}",
        elements.len(),
        nodes.len()
    );
    page::page(style, caption, height + legend, |area| {
        for (k, frame) in frames.iter().enumerate() {
            let said = if k == 0 { &count } else { "near the contact" };
            body::axes(area, style, frame, said, [&axes[0], &axes[1]])?;
        }
        for ((label, sample), LegendPlace { row, x }) in entries.iter().zip(places) {
            let middle = height + LEGEND * row + LEGEND / 2 - 4;
            sample.draw(area, style, (x, middle))?;
            draw_text(area, style, label, (x + 28, middle))?;
        }
        Ok(over)
    })
}

/// The windows of the figure: the whole body with the obstacles near it, and a window at the contact if that is small.
fn windows(model: &Model, nodes: &[[f64; 2]], faces: &[Face]) -> Option<Vec<Window>> {
    let body = Window::around(nodes.iter().copied())?;
    let reach = body.grown(NEAR);
    let near = faces.iter().flat_map(|face| &face.points).copied();
    let near = Window::around(near.filter(|p| reach.holds(*p)));
    let whole = near.map_or(body, |near| body.with(&near));
    let mut windows = vec![whole.grown(0.05)];
    windows
        .extend(at_contact(model, &body).map(|(around, side)| body::square(&around, side, &whole)));
    Some(windows)
}

/// The elements of a mesh, or their outline.
struct Drawing<'a> {
    elements: &'a [Element],
    nodes: &'a [[f64; 2]],
    sides: Sides,
    /// Whether only the outline is drawn, since there are too many elements.
    is_outline: bool,
}

impl<'a> Drawing<'a> {
    fn new(elements: &'a [Element], nodes: &'a [[f64; 2]]) -> Self {
        Drawing {
            elements,
            nodes,
            sides: Sides::of(elements, nodes.len()),
            is_outline: elements.len() > DRAWN,
        }
    }

    /// The SVG of the elements, or of the outline, that a frame shows.
    fn content(&self, style: Style, frame: &Frame) -> String {
        let on_page = |side: &[u32; 3]| side.map(|n| frame.at(self.nodes[n as usize]));
        let visible = |side: &[[f64; 2]; 3]| {
            let corners = |pick: fn(f64, f64) -> f64| {
                [0, 1].map(|a| side.iter().map(|p| p[a]).reduce(pick).unwrap_or(0.0))
            };
            frame.shows(corners(f64::min), corners(f64::max))
        };
        let (mut inside, mut lines) = (Path::default(), Path::default());
        let drawn = if self.is_outline {
            // the area between its outline and its holes
            let surface: Vec<_> = self.sides.surface.iter().map(on_page).collect();
            inside.sides(&surface, false);
            &self.sides.surface
        } else {
            for element in self.elements {
                let around = element.sides().map(|s| on_page(&s)).collect::<Vec<_>>();
                if around.iter().any(visible) {
                    inside.sides(&around, true);
                }
            }
            &self.sides.all
        };
        let drawn: Vec<_> = drawn.iter().map(on_page).filter(visible).collect();
        lines.sides(&drawn, false);
        let many = self.elements.len() > 4000 && !self.is_outline;
        let finest = if many { 3 } else { 6 };
        let palette = style.palette();
        let (fill, line) = (hex(palette.body), hex(palette.faint));
        inside.drawn(&format!(r#"fill="{fill}" fill-rule="evenodd""#))
            + &lines.drawn(&format!(
                r#"fill="none" stroke="{line}" stroke-width="{finest}""#
            ))
    }
}

/// The sample before the label of an entry of the legend.
enum Sample {
    /// The line of a boundary, by its number.
    Boundary(usize),
    Obstacle,
    None,
}

impl Sample {
    fn draw(&self, area: &Area<'_>, style: Style, (x, middle): (i32, i32)) -> Fallible<()> {
        let palette = style.palette();
        match *self {
            Sample::Boundary(k) => {
                let colour = palette.curves[k % palette.curves.len()];
                let line = colour.stroke_width(px(3) as u32);
                let dashes: &[[i32; 2]] = if k < palette.curves.len() {
                    &[[0, 22]]
                } else {
                    &[[0, 8], [13, 21]]
                };
                for dash in dashes {
                    let ends = dash.map(|along| (px(x + along), px(middle)));
                    area.draw(&PathElement::new(ends, line))?;
                }
            }
            Sample::Obstacle => {
                let place = [(px(x), px(middle - 6)), (px(x + 22), px(middle + 6))];
                area.draw(&Rectangle::new(place, palette.obstacle.filled()))?;
            }
            Sample::None => {}
        }
        Ok(())
    }
}

/// The entries of the legend: the first boundaries, the number of further boundaries, and the obstacle.
fn entries(problem: &Problem, names: &[String], has_obstacle: bool) -> Vec<(String, Sample)> {
    let named = names.iter().take(MOST).enumerate();
    let mut entries: Vec<(String, Sample)> = named
        .map(|(k, name)| (label(problem, name), Sample::Boundary(k)))
        .collect();
    if names.len() > MOST {
        entries.push((format!("and {} more", names.len() - MOST), Sample::None));
    }
    if has_obstacle {
        entries.push(("obstacle".to_owned(), Sample::Obstacle));
    }
    entries
}

/// A window around the nodes that the obstacles are pushed to, or that are nearest to the obstacles, and the side of a
/// window for them; none unless these nodes are a small part of the body.
fn at_contact(model: &Model, body: &Window) -> Option<(Window, f64)> {
    let mut reached = Vec::new();
    for contact in &model.contacts {
        let gap = |i: usize| contact.gap(i, &Level::FULL);
        let nodes = 0..contact.boundary.positions.len();
        let least = nodes.clone().map(gap).fold(f64::INFINITY, f64::min);
        let touches = nodes.filter(|&i| gap(i) <= least.max(0.0));
        reached.extend(touches.map(|i| contact.boundary.positions[i]));
    }
    let around = Window::around(reached.into_iter())?;
    let small = around.largest() < SMALL * body.largest();
    small.then(|| (around, (2.0 * around.largest()).max(CLOSE * body.largest())))
}

/// The SVG of lines along the named boundaries, outside the body.
fn marks(style: Style, frame: &Frame, mesh: &Mesh, own: &Sides, names: &[String]) -> String {
    let palette = style.palette();
    // each side of the surface as its element goes round, by its midside node
    let surface: BTreeMap<u32, [u32; 3]> =
        own.surface.iter().map(|side| (side[2], *side)).collect();
    let mut beside: BTreeMap<u32, usize> = BTreeMap::new();
    let mut drawn = String::new();
    for (k, name) in names.iter().take(MOST).enumerate() {
        let edges = &mesh.boundaries[name];
        let deepest = edges.iter().map(|edge| {
            let count = beside.entry(edge[2]).or_default();
            *count += 1;
            *count
        });
        let depth = deepest.max().unwrap_or(1).min(BESIDE);
        let out = f64::from(page::FINE) * OUTSIDE * depth as f64;
        let shifted = edges.iter().map(|edge| {
            let Some(side) = surface.get(&edge[2]) else {
                // inside of the body
                return edge.map(|n| frame.at(mesh.nodes[n as usize]));
            };
            let [a, b, m] = side.map(|n| frame.at(mesh.nodes[n as usize]));
            let along = [b[0] - a[0], b[1] - a[1]];
            let length = along[0].hypot(along[1]).max(f64::MIN_POSITIVE);
            // an element is on the left of its sides; on the page, where down is positive, outside is here
            let by = [-along[1] / length * out, along[0] / length * out];
            [a, b, m].map(|p| [p[0] + by[0], p[1] + by[1]])
        });
        let mut path = Path::default();
        path.sides(&shifted.collect::<Vec<_>>(), false);
        let colour = hex(palette.curves[k % palette.curves.len()]);
        let width = f64::from(page::FINE) * WIDE;
        let dashes = if k < palette.curves.len() {
            ""
        } else {
            r#" stroke-dasharray="80 60""#
        };
        drawn += &path.drawn(&format!(
            r#"fill="none" stroke="{colour}" stroke-width="{width}"{dashes}"#
        ));
    }
    drawn
}

/// Sorts the names of boundaries: first those of the mesh itself, then those that the problem defines.
fn in_order(problem: &Problem, mut names: Vec<String>) -> Vec<String> {
    names.sort_by_key(|name| problem.mesh.boundaries.contains_key(name));
    names
}

/// The label of a boundary: its name, and its use in the problem.
fn label(problem: &Problem, name: &str) -> String {
    let contact = problem.contacts.iter().any(|c| c.boundary == name);
    let support = problem
        .supports
        .iter()
        .any(|s| s.boundary.as_deref() == Some(name));
    let load = problem.loads.iter().any(|l| l.boundary() == Some(name));
    let uses = [(contact, "contact"), (support, "support"), (load, "load")];
    let roles: Vec<&str> = uses
        .into_iter()
        .filter(|(is, _)| *is)
        .map(|(_, role)| role)
        .collect();
    let name = shortened(name, 24);
    if roles.is_empty() {
        name
    } else {
        format!("{name} ({})", roles.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::tests::problem;
    use solver::problem::{MeshInput, MeshSource, Refine};

    fn drawn(problem: &Problem, fields: &Fields) -> Result<String, String> {
        let caption = Caption::of_problem(problem, "Mesh");
        mesh_svg(Style::default(), &caption, problem, None, fields)
    }

    #[test]
    fn a_very_fine_mesh_is_drawn_as_its_outline() {
        let mut problem = problem();
        let size = |problem: &Problem| {
            let svg = drawn(problem, &Fields::default()).unwrap();
            (svg.len(), svg.contains("(outline)"))
        };
        problem.mesh.refine = Refine::Times(6);
        let (fine, outlined) = size(&problem);
        assert!(!outlined);
        problem.mesh.refine = Refine::Times(7);
        let (finer, outlined) = size(&problem);
        assert!(outlined && finer < fine, "{finer} {fine}");
    }

    #[test]
    fn a_mesh_has_its_elements_and_the_names_of_its_boundaries() {
        let problem = problem();
        let svg = drawn(&problem, &Fields::default()).unwrap();
        for text in [
            "2 elements, 13 nodes",
            "top (contact)",
            "bottom (support)",
            "x (mm)",
            "near the contact",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(svg.matches("<path").count() >= 6);
    }

    #[test]
    fn a_problem_without_a_mesh_is_an_error() {
        let mut problem = problem();
        problem.mesh = MeshInput::new(MeshSource::Stored("sha256:0".to_owned()));
        assert!(
            drawn(&problem, &Fields::default())
                .unwrap_err()
                .contains("/mesh")
        );
        let wrong = Fields {
            elements: vec![solver::element::Element::Triangle([0, 1, 2, 3, 4, 5])],
            ..Fields::default()
        };
        let problem = crate::plot::tests::problem();
        assert!(drawn(&problem, &wrong).is_err());
    }
}
