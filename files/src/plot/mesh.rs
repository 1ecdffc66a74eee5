//! The mesh: elements, and the named boundaries in colours.

use std::collections::BTreeMap;

use plotters::prelude::*;
use solver::error::Violation;
use solver::error::shortened;
use solver::mesh::Mesh;
use solver::model::Model;
use solver::problem::Problem;
use solver::solution::Fields;

use super::body::{self, Path, Sides, Window};
use super::page::{self, WIDTH, draw_text, px, with_unit};
use super::theme::{Theme, hex};
use crate::external::external_mesh;

/// Height of one line of the legend (pixels).
const LEGEND: i32 = 22;
const LEFT: i32 = 84;
/// Lines of boundaries that lie over one another, the first below (pixels).
const WIDTHS: [f64; 3] = [5.0, 2.4, 1.2];
/// With more elements than this only the outline is drawn: the lines would cover the body, and viewers refuse
/// files of some ten megabytes.
const DRAWN: usize = 30_000;
/// Most boundaries with a name.
const MOST: usize = 24;

/// Elements between equal axes, each named boundary in a colour of its own. The elements are those of
/// `fields`, which adaptive refinement makes, or without them those of the problem. `Err`: the reason why it
/// could not be drawn.
pub fn mesh_svg(
    theme: Theme,
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
    let mesh = Model::new(problem, external).map_err(refused)?.mesh;
    let refined: Vec<[f64; 2]> = fields
        .x
        .iter()
        .zip(&fields.y)
        .map(|(&x, &y)| [x, y])
        .collect();
    let (elements, nodes) = match fields.elements.is_empty() {
        true => (&mesh.elements, &mesh.nodes),
        false => (&fields.elements, &refined),
    };
    if elements
        .iter()
        .any(|e| e.iter().any(|&n| n as usize >= nodes.len()))
    {
        return Err("an element has a node that is not there".to_owned());
    }
    let window = Window::around(nodes.iter().copied()).ok_or("there is no mesh to draw")?;
    let (frames, height) = body::layout(&[window.grown(0.04)]);
    let frame = frames.first().ok_or("there is nothing to draw")?;
    let palette = theme.palette();

    let on_page = |side: &[u32; 3]| side.map(|n| frame.at(nodes[n as usize]));
    let sides = Sides::of(elements, nodes.len());
    let each = elements.len() <= DRAWN;
    let (mut inside, mut lines) = (Path::default(), Path::default());
    if each {
        for element in elements {
            inside.sides(
                &element.sides().map(|s| on_page(&s)).collect::<Vec<_>>(),
                true,
            );
        }
    } else {
        // the area between its outline and its holes
        inside.sides(
            &sides.surface.iter().map(on_page).collect::<Vec<_>>(),
            false,
        );
    }
    let drawn = if each { &sides.all } else { &sides.surface };
    lines.sides(&drawn.iter().map(on_page).collect::<Vec<_>>(), false);
    let finest = if each && elements.len() > 4000 { 3 } else { 7 };
    let (fill, line) = (hex(palette.body), hex(palette.reference));
    let mut content = inside.drawn(&format!(r#"fill="{fill}" fill-rule="evenodd""#));
    content += &lines.drawn(&format!(
        r#"fill="none" stroke="{line}" stroke-width="{finest}""#
    ));

    // a boundary on top of another one is drawn thinner, so that both are visible
    let mut covered: BTreeMap<u32, usize> = BTreeMap::new();
    let names = in_order(problem, mesh.boundaries.keys().cloned().collect());
    for (k, name) in names.iter().take(MOST).enumerate() {
        let edges = &mesh.boundaries[name];
        let over = edges.iter().map(|edge| {
            let count = covered.entry(edge[2]).or_default();
            *count += 1;
            *count
        });
        let depth = over.max().unwrap_or(1).min(WIDTHS.len());
        let mut path = Path::default();
        let on_page = |edge: &[u32; 3]| edge.map(|n| frame.at(mesh.nodes[n as usize]));
        path.sides(&edges.iter().map(on_page).collect::<Vec<_>>(), false);
        let colour = hex(palette.curves[k % palette.curves.len()]);
        let width = f64::from(page::FINE) * WIDTHS[depth - 1];
        let dashes = if k < palette.curves.len() {
            ""
        } else {
            r#" stroke-dasharray="80 60""#
        };
        content += &path.drawn(&format!(
            r#"fill="none" stroke="{colour}" stroke-width="{width}"{dashes}"#
        ));
    }

    let mut labels: Vec<String> = names
        .iter()
        .take(MOST)
        .map(|name| label(problem, name))
        .collect();
    if names.len() > MOST {
        labels.push(format!("and {} more", names.len() - MOST));
    }
    let places = places(&labels);
    let legend = LEGEND * places.last().map_or(1, |(row, _)| row + 1) + 6;
    let title = problem.title.as_deref().unwrap_or("Mesh");
    let unit = page::length(&problem.units);
    let axes = body::coordinates(&problem.analysis).map(|name| with_unit(name, unit));
    let mut caption = format!("{} elements, {} nodes", elements.len(), nodes.len());
    if !each {
        caption += "; too many to be drawn one by one";
    }
    page::page(theme, title, None, height + legend, |area| {
        body::axes(area, theme, frame, &caption, [&axes[0], &axes[1]])?;
        for (k, (label, (row, x))) in labels.iter().zip(&places).enumerate() {
            let middle = height + LEGEND * row + LEGEND / 2 - 4;
            if k < MOST {
                let colour = palette.curves[k % palette.curves.len()];
                let sample = [(px(*x), px(middle)), (px(x + 22), px(middle))];
                let style = colour.stroke_width(px(4) as u32);
                if k < palette.curves.len() {
                    area.draw(&PathElement::new(sample, style))?;
                } else {
                    for from in [*x, x + 13] {
                        let dash = [(px(from), px(middle)), (px(from + 8), px(middle))];
                        area.draw(&PathElement::new(dash, style))?;
                    }
                }
            }
            draw_text(area, theme, label, (x + 28, middle))?;
        }
        Ok(body::inside(theme, frame, &content))
    })
}

/// First the boundaries that the mesh has by itself, then those that name parts of them.
fn in_order(problem: &Problem, mut names: Vec<String>) -> Vec<String> {
    names.sort_by_key(|name| problem.mesh.boundaries.contains_key(name));
    names
}

/// The name, and its use in the problem.
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
    let name = shortened(name, 30);
    match roles.is_empty() {
        true => name,
        false => format!("{name} ({})", roles.join(", ")),
    }
}

/// Line and place of each entry of the legend (pixels).
fn places(labels: &[String]) -> Vec<(i32, i32)> {
    let (mut x, mut row) = (LEFT, 0);
    labels
        .iter()
        .map(|label| {
            let width = 28 + page::width(label) + 20;
            if x > LEFT && x + width > WIDTH {
                (x, row) = (LEFT, row + 1);
            }
            let place = (row, x);
            x += width;
            place
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::tests::problem;
    use solver::problem::{MeshInput, MeshSource, Refine};

    #[test]
    fn a_very_fine_mesh_is_drawn_as_its_outline() {
        let mut problem = problem();
        let size = |problem: &Problem| {
            let svg = mesh_svg(Theme::Light, problem, None, &Fields::default()).unwrap();
            (svg.len(), svg.contains("too many to be drawn"))
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
        let svg = mesh_svg(Theme::Light, &problem, None, &Fields::default()).unwrap();
        for text in [
            "2 elements, 13 nodes",
            "top (contact)",
            "bottom (support)",
            "x [mm]",
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
            mesh_svg(Theme::Light, &problem, None, &Fields::default())
                .unwrap_err()
                .contains("/mesh")
        );
        let wrong = Fields {
            elements: vec![solver::element::Element::Triangle([0, 1, 2, 3, 4, 5])],
            ..Fields::default()
        };
        let problem = crate::plot::tests::problem();
        assert!(mesh_svg(Theme::Light, &problem, None, &wrong).is_err());
    }
}
