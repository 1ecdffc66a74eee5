//! The figure of the deformed body, filled with its stresses, over its undeformed outline.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use plotters::prelude::*;

use super::bands::{BAR, Bands};
use super::body::{self, Frame, Path, Sides, Window};
use super::caption::Caption;
use super::numbers::{number, round_up};
use super::obstacle::Face;
use super::page::{self, Area, Fallible, draw_text, px, with_unit};
use super::style::{Stress, Style};
use super::theme::hex;
use crate::stress::von_mises;
use solver::problem::{Analysis, Condition, Problem};
use solver::solution::{ContactProfile, Fields, NodeState};

/// The largest displacement in the figure, as a part of the size of the body, or of the window at the contact.
const VISIBLE: f64 = 0.1;
/// The size of a contact, as a part of the body's size, below which it gets a window of its own, twice as large.
const SMALL: f64 = 0.2;
/// The height of the legend (pixels).
const LEGEND: i32 = 24;
/// The width of the line along the contact (pixels).
const LINE: i32 = 4;

impl Stress {
    /// The stress at a node.
    fn at(self, fields: &Fields, n: usize) -> f64 {
        let of = |column: &[f64]| column.get(n).copied().unwrap_or(0.0);
        let (xx, yy) = (of(&fields.stress_xx), of(&fields.stress_yy));
        let (zz, xy) = (of(&fields.stress_zz), of(&fields.stress_xy));
        match self {
            Stress::VonMises => von_mises([xx, yy, xy, zz]),
            Stress::Xx => xx,
            Stress::Yy => yy,
            Stress::Zz => zz,
            Stress::Xy => xy,
        }
    }

    fn name(self, analysis: &Analysis) -> &'static str {
        match (self, analysis) {
            (Stress::VonMises, _) => "von Mises stress",
            (Stress::Xx, Analysis::Axisymmetric {}) => "stress σ_rr",
            (Stress::Yy, Analysis::Axisymmetric {}) => "stress σ_zz",
            (Stress::Zz, Analysis::Axisymmetric {}) => "hoop stress σ_θθ",
            (Stress::Xy, Analysis::Axisymmetric {}) => "shear stress σ_rz",
            (Stress::Xx, _) => "stress σ_xx",
            (Stress::Yy, _) => "stress σ_yy",
            (Stress::Zz, _) => "stress σ_zz",
            (Stress::Xy, _) => "shear stress σ_xy",
        }
    }
}

/// Draws the deformed body with contours of a stress, its undeformed outline, the obstacle, and the contact in the
/// colours of stick and slip; a small contact has a second panel. Displacements are scaled so that they are visible,
/// and each panel shows the factor.
///
/// # Errors
///
/// The reason in words, if the figure cannot be drawn.
pub fn deformed_svg(
    style: Style,
    caption: &Caption,
    problem: &Problem,
    profiles: &BTreeMap<String, ContactProfile>,
    fields: &Fields,
) -> Result<String, String> {
    let body = Body { fields };
    if fields.elements.is_empty() {
        return Err("there are no displacements to draw".to_owned());
    }
    body.check()?;
    let nodes = fields.x.len();
    let all = || 0..nodes as u32;
    let whole = Window::around(all().map(|n| body.place(n, 0.0))).ok_or("there are no nodes")?;
    let largest = all().map(|n| body.moved(n)).fold(0.0, f64::max);
    let factor = visible(VISIBLE * whole.largest(), largest);
    let moved = all().flat_map(|n| [body.place(n, 0.0), body.place(n, factor)]);
    let window = Window::around(moved)
        .ok_or("there are no nodes")?
        .grown(0.04);
    let surfaces = body.surfaces(problem, profiles);
    let views = if (style.limits.x, style.limits.y) == (None, None) {
        let near = body.contact(&surfaces);
        let touching = Window::around(near.iter().map(|&n| body.place(n, 0.0)));
        let small = touching.filter(|w| w.largest() < SMALL * whole.largest());
        let near = small.map(|touching| body.near(&near, &touching, &whole));
        [(window, factor)].into_iter().chain(near).collect()
    } else {
        let window = window.limited(style.limits)?;
        let inside = all().filter(|&n| window.holds(body.place(n, 0.0)));
        let largest = inside.map(|n| body.moved(n)).fold(0.0, f64::max);
        // at least 1: what is looked for would else be elsewhere
        vec![(
            window,
            visible(VISIBLE * window.largest(), largest).max(1.0),
        )]
    };

    let windows: Vec<Window> = views.iter().map(|view| view.0).collect();
    let legend = if profiles.is_empty() { 0 } else { LEGEND };
    let room = page::room(style, caption).map(|room| room - legend - BAR);
    let (frames, height) = body::layout(style, &windows, room);
    let values: Vec<f64> = (0..nodes).map(|n| style.stress.at(fields, n)).collect();
    // the last panel is the one at the contact
    let areas = body.areas();
    let near = views.last().map_or(vec![], |(window, factor)| {
        let inside = |&n: &u32| window.holds(body.place(n, *factor));
        let node = |n: u32| (values[n as usize], areas[n as usize]);
        all().filter(inside).map(node).collect()
    });
    let bands = Bands::of(&values, near);
    let sides = Sides::of(&fields.elements, nodes);
    let mut over = String::new();
    for (frame, (_, factor)) in frames.iter().zip(&views) {
        let mut content = body.drawn(style, frame, *factor, &sides, &bands, &values);
        for surface in &surfaces {
            content += &surface.face(&body, *factor).drawn(style, frame);
            content += &surface.states(&body, style, frame, *factor);
        }
        over += &body::inside(style, frame, &content);
    }

    let unit = page::length(&problem.units);
    let names = body::coordinates(&problem.analysis).map(|name| with_unit(name, unit));
    let stress = style.stress.name(&problem.analysis);
    let bar = with_unit(stress, page::stress(&problem.units));
    page::page(style, caption, height + legend + BAR, |area| {
        for (k, (frame, (_, factor))) in frames.iter().zip(&views).enumerate() {
            let scale = match *factor {
                1.0 => "displacements to scale".to_owned(),
                // gaps, too: the obstacle is that many times as far from the body
                factor => format!("displacements × {}", number(factor)),
            };
            let caption = match k {
                0 => scale,
                _ => format!("contact, {scale}"),
            };
            body::axes(area, style, frame, &caption, [&names[0], &names[1]])?;
        }
        if legend > 0 {
            draw_legend(area, style, &surfaces, height + LEGEND / 2 - 6)?;
        }
        bands.bar(area, style, &bar, height + legend)?;
        Ok(over)
    })
}

/// A contact boundary, by the nodes of its profile that are found in the body.
struct Surface<'a> {
    profile: &'a ContactProfile,
    /// The row of each node in the profile, and the node.
    nodes: Vec<(usize, u32)>,
    /// Whether there is an obstacle, rather than another body or only prescribed friction.
    faces: bool,
    /// Whether the contact has friction, so that its states are stick and slip.
    rough: bool,
}

/// The faces of obstacles where they ended, at the scale of the body, each with the name of its boundary.
pub(super) fn faces_after<'p>(
    problem: &Problem,
    profiles: &'p BTreeMap<String, ContactProfile>,
    fields: &Fields,
) -> Vec<(&'p str, Vec<[f64; 2]>)> {
    let body = Body { fields };
    if body.check().is_err() {
        return vec![];
    }
    let surfaces = body.surfaces(problem, profiles);
    let faces = profiles.keys().zip(&surfaces);
    let faces = faces.map(|(name, surface)| (&name[..], surface.face(&body, 1.0).points));
    faces.filter(|(_, points)| points.len() > 1).collect()
}

impl Surface<'_> {
    fn face(&self, body: &Body<'_>, factor: f64) -> Face {
        if !self.faces {
            return Face::default();
        }
        let gap = |row: usize| {
            let of = |column: &[f64]| column.get(row).copied().unwrap_or(f64::NAN);
            of(&self.profile.gap) - of(&self.profile.normal_displacement)
        };
        let nodes = self.nodes.iter();
        let surface: Vec<_> = nodes
            .map(|&(row, n)| (body.place(n, 0.0), body.place(n, factor), factor * gap(row)))
            .collect();
        Face::after(&surface)
    }

    /// The SVG of the part of the boundary that is in contact, in the colours of stick and slip.
    fn states(&self, body: &Body<'_>, style: Style, frame: &Frame, factor: f64) -> String {
        let nodes: Vec<([f64; 2], NodeState)> = self
            .nodes
            .iter()
            .filter_map(|&(row, n)| {
                let state = *self.profile.state.get(row)?;
                Some((frame.at(body.place(n, factor)), state))
            })
            .collect();
        let mut drawn = String::new();
        for (states, colour) in looks(style, self.rough) {
            let is = |state: NodeState| states.contains(&state);
            let mut path = Path::default();
            for pair in nodes.windows(2) {
                let ((a, of_a), (b, of_b)) = (pair[0], pair[1]);
                let middle = [0, 1].map(|c| 0.5 * (a[c] + b[c]));
                // each node has half of the way to its neighbours
                match (is(of_a), is(of_b)) {
                    (true, true) => path.line(&[a, b]),
                    (true, false) => path.line(&[a, middle]),
                    (false, true) => path.line(&[middle, b]),
                    (false, false) => {}
                }
            }
            let (colour, width) = (hex(colour), px(LINE));
            drawn += &path.drawn(&format!(
                r#"fill="none" stroke="{colour}" stroke-width="{width}" stroke-linecap="butt""#
            ));
        }
        drawn
    }
}

/// The states of nodes that are drawn in a colour, with their colours; without friction one colour for contact.
fn looks(style: Style, rough: bool) -> Vec<(&'static [NodeState], RGBColor)> {
    let palette = style.palette();
    if rough {
        vec![
            (&[NodeState::Stick], palette.stick),
            (&[NodeState::Slip], palette.slip),
        ]
    } else {
        vec![(&[NodeState::Stick, NodeState::Slip], palette.curves[0])]
    }
}

/// Draws the legend for the colours along the contacts.
fn draw_legend(
    area: &Area<'_>,
    style: Style,
    surfaces: &[Surface<'_>],
    middle: i32,
) -> Fallible<()> {
    let palette = style.palette();
    let is = |rough: bool, states: &[NodeState]| {
        let mut of_kind = surfaces.iter().filter(|surface| surface.rough == rough);
        of_kind.any(|surface| {
            surface
                .profile
                .state
                .iter()
                .any(|state| states.contains(state))
        })
    };
    let line = |colour: RGBColor| colour.stroke_width(px(LINE) as u32);
    let both = [NodeState::Stick, NodeState::Slip];
    let entries = [
        (
            surfaces.iter().any(|s| s.faces),
            "obstacle",
            palette.obstacle.filled(),
            6,
        ),
        (is(true, &both[..1]), "stick", line(palette.stick), 0),
        (is(true, &both[1..]), "slip", line(palette.slip), 0),
        (is(false, &both), "in contact", line(palette.curves[0]), 0),
    ];
    let mut x = 84;
    for (_, word, look, half) in entries.into_iter().filter(|entry| entry.0) {
        match half {
            0 => area.draw(&PathElement::new(
                [(px(x), px(middle)), (px(x + 22), px(middle))],
                look,
            ))?,
            half => area.draw(&Rectangle::new(
                [(px(x), px(middle - half)), (px(x + 22), px(middle + half))],
                look,
            ))?,
        }
        draw_text(area, style, word, (x + 28, middle))?;
        x += 28 + page::width(word) + 20;
    }
    Ok(())
}

/// The factor on displacements (1, 2 or 5 times a power of ten) with which the largest displacement is about `wanted`;
/// 1 if that is close enough.
fn visible(wanted: f64, largest: f64) -> f64 {
    let factor = wanted / largest;
    if !factor.is_normal() || (0.25..2.0).contains(&factor) {
        return 1.0;
    }
    // rounded down: the reciprocal is rounded up
    1.0 / round_up(1.0 / factor, &[1.0, 2.0, 5.0])
}

/// A body and its displacements.
struct Body<'a> {
    fields: &'a Fields,
}

impl Body<'_> {
    /// Checks the lengths of the columns of fields, which may come from a file or a store.
    fn check(&self) -> Result<(), String> {
        let f = self.fields;
        let nodes = f.x.len();
        let columns = [&f.y, &f.ux, &f.uy];
        let known = |n: &u32| (*n as usize) < nodes;
        if columns.iter().all(|column| column.len() == nodes)
            && f.elements.iter().all(|e| e.iter().all(known))
        {
            Ok(())
        } else {
            Err("some nodes have no field values".to_owned())
        }
    }

    fn place(&self, node: u32, factor: f64) -> [f64; 2] {
        let (f, n) = (self.fields, node as usize);
        [f.x[n] + factor * f.ux[n], f.y[n] + factor * f.uy[n]]
    }

    fn moved(&self, node: u32) -> f64 {
        self.fields.ux[node as usize].hypot(self.fields.uy[node as usize])
    }

    /// The part of the body's area that belongs to each node: every element is shared equally by its nodes.
    fn areas(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.fields.x.len()];
        for element in &self.fields.elements {
            let corners = &element[..element.family().corners()];
            let cross = |k: usize| {
                let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
                let ([ax, ay], [bx, by]) = (self.place(a, 0.0), self.place(b, 0.0));
                0.5 * (ax * by - bx * ay)
            };
            let area: f64 = (0..corners.len()).map(cross).sum();
            for &node in element.iter() {
                areas[node as usize] += area / element.len() as f64;
            }
        }
        areas
    }

    /// The contact boundaries. Nodes of their profiles are recognised by position.
    fn surfaces<'b>(
        &self,
        problem: &Problem,
        profiles: &'b BTreeMap<String, ContactProfile>,
    ) -> Vec<Surface<'b>> {
        let bits = |x: f64, y: f64| (x.to_bits(), y.to_bits());
        let places = self.fields.x.iter().zip(&self.fields.y);
        let known: HashMap<(u64, u64), u32> = places
            .zip(0..)
            .map(|((&x, &y), n)| (bits(x, y), n))
            .collect();
        let surface = |(name, profile): (&String, &'b ContactProfile)| {
            let rows = profile.x.iter().zip(&profile.y).enumerate();
            let nodes = rows.filter_map(|(row, (&x, &y))| Some((row, *known.get(&bits(x, y))?)));
            let mut contacts = problem.contacts.iter();
            let contact = contacts.find(|contact| contact.is_on(name));
            Surface {
                profile,
                nodes: nodes.collect(),
                faces: contact.is_some_and(|contact| {
                    contact.obstacle.is_some() && contact.condition != Condition::None
                }),
                rough: contact.is_some_and(|contact| contact.friction.is_some()),
            }
        };
        profiles.iter().map(surface).collect()
    }

    /// The nodes in contact, and their neighbours on the boundary, so that a contact of one node has an extent too.
    fn contact(&self, surfaces: &[Surface<'_>]) -> Vec<u32> {
        let mut found = BTreeSet::new();
        for surface in surfaces {
            let touches = |place: usize| {
                let state = surface
                    .nodes
                    .get(place)
                    .and_then(|(row, _)| surface.profile.state.get(*row));
                state.is_some_and(|state| *state != NodeState::Open)
            };
            for (place, (_, node)) in surface.nodes.iter().enumerate() {
                let from = place.saturating_sub(1);
                if (from..=place + 1).any(touches) {
                    found.insert(*node);
                }
            }
        }
        found.into_iter().collect()
    }

    /// A square window around the contact, about twice its size, and the factor on displacements in it. The window is
    /// as far as possible inside the body.
    fn near(&self, contact: &[u32], touching: &Window, whole: &Window) -> (Window, f64) {
        let side = (2.0 * touching.largest()).max(0.002 * whole.largest());
        let largest = contact.iter().map(|&n| self.moved(n)).fold(0.0, f64::max);
        // at least 1: the window follows a contact that has moved far
        let factor = visible(VISIBLE * side, largest).max(1.0);
        let places = |nodes: &mut dyn Iterator<Item = u32>, factor: f64| {
            Window::around(nodes.map(|n| self.place(n, factor)))
        };
        let deformed = places(&mut contact.iter().copied(), factor);
        let body = places(&mut (0..self.fields.x.len() as u32), factor);
        let (deformed, body) = (deformed.unwrap_or(*touching), body.unwrap_or(*whole));
        let side = side.max(1.1 * deformed.largest());
        // both the deformed and the undeformed surface stay in sight
        let window = body::square(&deformed, side, &body.with(whole));
        (window, factor)
    }

    fn drawn(
        &self,
        style: Style,
        frame: &Frame,
        factor: f64,
        sides: &Sides,
        bands: &Bands,
        values: &[f64],
    ) -> String {
        let place = |n: u32| self.place(n, factor);
        let value = |n: u32| values[n as usize];
        let mut content = bands.fill(frame, &self.fields.elements, &place, &value);
        let palette = style.palette();
        let outlines = [
            (factor, palette.text, 10, ""),
            (0.0, palette.faint, 10, r#" stroke-dasharray="50 40""#),
        ];
        for (factor, colour, width, dashes) in outlines {
            let mut path = Path::default();
            let on_page = |side: &[u32; 3]| side.map(|n| frame.at(self.place(n, factor)));
            path.sides(
                &sides.surface.iter().map(on_page).collect::<Vec<_>>(),
                false,
            );
            let colour = hex(colour);
            content += &path.drawn(&format!(
                r#"fill="none" stroke="{colour}" stroke-width="{width}"{dashes}"#
            ));
        }
        content
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::tests::{problem, solution};

    fn drawn(
        problem: &Problem,
        profiles: &BTreeMap<String, ContactProfile>,
        fields: &Fields,
        stress: Stress,
    ) -> Result<String, String> {
        let style = Style {
            stress,
            ..Style::default()
        };
        deformed_svg(style, &Caption::default(), problem, profiles, fields)
    }

    #[test]
    fn displacements_are_scaled_by_round_factors_or_not_at_all() {
        for (wanted, largest, factor) in [
            (1.0, 1.0, 1.0),
            (1.0, 0.6, 1.0),
            (1.0, 0.3, 2.0),
            (1.0, 0.011, 50.0),
            (1.0, 0.0015, 500.0),
            (1.0, 9.0, 0.1),
            (1.0, 0.0, 1.0),
        ] {
            let found = visible(wanted, largest);
            assert!((found / factor - 1.0).abs() < 1e-9, "{largest}: {found}");
        }
    }

    #[test]
    fn a_deformed_body_has_contours_a_colour_bar_and_its_scale() {
        let problem = problem();
        let solution = solution(&problem);
        let drawn = |stress| drawn(&problem, &solution.profiles, &solution.fields, stress).unwrap();
        let svg = drawn(Stress::VonMises);
        for text in [
            "von Mises stress (MPa)",
            "displacements",
            "y (mm)",
            "stroke-dasharray",
            "obstacle",
            "slip",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(drawn(Stress::Yy).contains(r#"font-size="108">yy</tspan>"#));
        assert_eq!("zz".parse(), Ok(Stress::Zz));
    }

    #[test]
    fn a_small_contact_has_a_window_of_its_own() {
        let mut problem = problem();
        let grid = problem.mesh.grid_mut().unwrap();
        grid.x = (0..=40).map(f64::from).collect();
        grid.y = vec![-40.0, -20.0, -10.0, -5.0, -2.0, 0.0];
        let solution = solution(&problem);
        let of = |fields: &Fields| drawn(&problem, &solution.profiles, fields, Stress::Xx);
        let svg = of(&solution.fields).unwrap();
        assert_eq!(svg.matches("<svg").count(), 3, "page, body and contact");
        assert!(svg.contains("contact, displacements"));
        assert!(of(&Fields::default()).is_err());
        let mut short = solution.fields.clone();
        short.ux.pop();
        assert!(of(&short).is_err());
    }

    /// A figure of five thousand elements, a large mesh here, stays below two megabytes, so that a browser shows it at
    /// once.
    #[test]
    fn a_figure_of_five_thousand_elements_stays_below_two_megabytes() {
        let mut problem = problem();
        let grid = problem.mesh.grid_mut().unwrap();
        grid.x = (0..=100).map(|k| 0.04 * f64::from(k)).collect();
        grid.y = (0..=50).map(|k| 0.04 * f64::from(k) - 2.0).collect();
        let mesh = solver::mesh::grid_mesh(grid);
        let column = |f: &dyn Fn(f64, f64) -> f64| {
            mesh.nodes.iter().map(|p| f(p[0], p[1])).collect::<Vec<_>>()
        };
        let wave = column(&|x, y| (9.0 * x).sin() * (7.0 * y).cos());
        let fields = Fields {
            x: column(&|x, _| x),
            y: column(&|_, y| y),
            ux: column(&|x, _| 0.01 * x),
            uy: column(&|_, y| 0.01 * y),
            stress_xx: wave.clone(),
            stress_yy: wave.clone(),
            stress_xy: wave.clone(),
            stress_zz: wave,
            elements: mesh.elements.clone(),
            ..Fields::default()
        };
        let svg = drawn(&problem, &BTreeMap::new(), &fields, Stress::Xx).unwrap();
        assert!(svg.len() < 2_000_000, "{}", svg.len());
        let style = Style::default();
        let svg =
            crate::plot::mesh_svg(style, &Caption::default(), &problem, None, &fields).unwrap();
        assert!(svg.len() < 2_000_000, "{}", svg.len());
    }
}
