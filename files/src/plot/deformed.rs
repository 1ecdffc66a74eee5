//! The deformed body, filled with its stresses, over its undeformed outline.

use std::collections::{BTreeMap, BTreeSet};
use std::str::FromStr;

use super::bands::{BAR, Bands};
use super::body::{self, Frame, Path, Sides, Window};
use super::page::{self, number, with_unit};
use super::theme::{Theme, hex};
use crate::stress::von_mises;
use solver::problem::{Analysis, Problem};
use solver::solution::{Accuracy, ContactProfile, Fields, NodeState};

/// The largest displacement is drawn as this part of the body, or of the window at the contact.
const VISIBLE: f64 = 0.1;
/// A contact below this part of the body gets a window of its own, twice its size.
const SMALL: f64 = 0.2;

/// The stress that the contours show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stress {
    /// √(½((σ_xx − σ_yy)² + (σ_yy − σ_zz)² + (σ_zz − σ_xx)²) + 3σ_xy²).
    #[default]
    VonMises,
    /// σ_xx (σ_rr).
    Xx,
    /// σ_yy (σ_zz in axisymmetry).
    Yy,
    /// σ_zz (σ_θθ in axisymmetry).
    Zz,
    /// σ_xy (σ_rz).
    Xy,
}

impl FromStr for Stress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "von_mises" => Ok(Stress::VonMises),
            "xx" => Ok(Stress::Xx),
            "yy" => Ok(Stress::Yy),
            "zz" => Ok(Stress::Zz),
            "xy" => Ok(Stress::Xy),
            _ => Err("expected von_mises, xx, yy, zz or xy".to_owned()),
        }
    }
}

impl Stress {
    /// At a node.
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

/// The deformed body with contours of a stress and its undeformed outline; a second panel shows the
/// contact where it is small. Displacements are scaled so that they are visible, and each panel shows
/// the factor. `Err`: the reason why it could not be drawn.
pub fn deformed_svg(
    theme: Theme,
    problem: &Problem,
    profiles: &BTreeMap<String, ContactProfile>,
    fields: &Fields,
    accuracy: Option<&Accuracy>,
    stress: Stress,
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
    let mut views = vec![(window, factor)];
    let near = body.contact(profiles);
    let touching = Window::around(near.iter().map(|&n| body.place(n, 0.0)));
    if let Some(touching) = touching.filter(|w| w.largest() < SMALL * whole.largest()) {
        views.push(body.near(&near, &touching, &whole));
    }

    let windows: Vec<Window> = views.iter().map(|view| view.0).collect();
    let (frames, height) = body::layout(&windows);
    let values: Vec<f64> = (0..nodes).map(|n| stress.at(fields, n)).collect();
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
        let content = body.drawn(theme, frame, *factor, &sides, &bands, &values);
        over += &body::inside(theme, frame, &content);
    }

    let unit = page::length(&problem.units);
    let names = body::coordinates(&problem.analysis).map(|name| with_unit(name, unit));
    let bar = with_unit(stress.name(&problem.analysis), page::stress(&problem.units));
    let title = problem.title.as_deref().unwrap_or("Deformed body");
    let note = page::verdict(accuracy);
    page::page(theme, title, note.as_deref(), height + BAR, |area| {
        for (k, (frame, (_, factor))) in frames.iter().zip(&views).enumerate() {
            let scale = match *factor {
                1.0 => "displacements to scale".to_owned(),
                factor => format!("displacements × {}", number(factor)),
            };
            let caption = match k {
                0 => scale,
                _ => format!("contact, {scale}"),
            };
            body::axes(area, theme, frame, &caption, [&names[0], &names[1]])?;
        }
        bands.bar(area, theme, &bar, height)?;
        Ok(over)
    })
}

/// The factor on displacements, 1, 2 or 5 times a power of ten, that makes the largest one about
/// `wanted`; 1 if that is near enough.
fn visible(wanted: f64, largest: f64) -> f64 {
    let factor = wanted / largest;
    if !factor.is_normal() || (0.25..2.0).contains(&factor) {
        return 1.0;
    }
    // rounded down: the reciprocal is rounded up
    1.0 / page::round_up(1.0 / factor, &[1.0, 2.0, 5.0])
}

/// A body and its displacements.
struct Body<'a> {
    fields: &'a Fields,
}

impl Body<'_> {
    /// Checks the lengths of columns: fields may come from a file or a store.
    fn check(&self) -> Result<(), String> {
        let f = self.fields;
        let nodes = f.x.len();
        let columns = [&f.y, &f.ux, &f.uy];
        let known = |n: &u32| (*n as usize) < nodes;
        match columns.iter().all(|column| column.len() == nodes)
            && f.elements.iter().all(|e| e.iter().all(known))
        {
            true => Ok(()),
            false => Err("some nodes have no field values".to_owned()),
        }
    }

    fn place(&self, node: u32, factor: f64) -> [f64; 2] {
        let (f, n) = (self.fields, node as usize);
        [f.x[n] + factor * f.ux[n], f.y[n] + factor * f.uy[n]]
    }

    fn moved(&self, node: u32) -> f64 {
        self.fields.ux[node as usize].hypot(self.fields.uy[node as usize])
    }

    /// The part of the body's area that belongs to each node: equal parts of its elements.
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

    /// The nodes in contact and beside it; profiles identify them by their positions.
    fn contact(&self, profiles: &BTreeMap<String, ContactProfile>) -> Vec<u32> {
        let bits = |x: f64, y: f64| (x.to_bits(), y.to_bits());
        let touching: BTreeSet<(u64, u64)> = profiles
            .values()
            .flat_map(|profile| {
                // with a neighbour on each side, so that one node has an extent too
                let near = |i: usize| {
                    let states = profile.state.get(i.saturating_sub(1)..).unwrap_or_default();
                    let three = if i == 0 { 2 } else { 3 };
                    states
                        .iter()
                        .take(three)
                        .any(|state| *state != NodeState::Open)
                };
                let places = profile.x.iter().zip(&profile.y).enumerate();
                places
                    .filter(move |(i, _)| near(*i))
                    .map(|(_, place)| place)
            })
            .map(|(&x, &y)| bits(x, y))
            .collect();
        let (x, y) = (&self.fields.x, &self.fields.y);
        (0..x.len() as u32)
            .filter(|&n| touching.contains(&bits(x[n as usize], y[n as usize])))
            .collect()
    }

    /// A square around the contact, twice its size, as much of it in the body as can be.
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
        let low = [0, 1].map(|a| {
            let middle = 0.5 * (deformed.low[a] + deformed.high[a]);
            let edge = 0.08 * side;
            // both the deformed and the undeformed surface stay in sight
            let least = body.low[a].min(whole.low[a]) - edge;
            let most = body.high[a].max(whole.high[a]) + edge - side;
            (middle - 0.5 * side).max(least).min(most.max(least))
        });
        let window = Window {
            low,
            high: low.map(|x| x + side),
        };
        (window, factor)
    }

    fn drawn(
        &self,
        theme: Theme,
        frame: &Frame,
        factor: f64,
        sides: &Sides,
        bands: &Bands,
        values: &[f64],
    ) -> String {
        let place = |n: u32| self.place(n, factor);
        let value = |n: u32| values[n as usize];
        let mut content = bands.fill(frame, &self.fields.elements, &place, &value);
        let palette = theme.palette();
        let outlines = [
            (factor, palette.text, 10, ""),
            (0.0, palette.reference, 10, r#" stroke-dasharray="50 40""#),
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
        let drawn = |stress| {
            deformed_svg(
                Theme::Light,
                &problem,
                &solution.profiles,
                &solution.fields,
                None,
                stress,
            )
            .unwrap()
        };
        let svg = drawn(Stress::VonMises);
        for text in [
            "von Mises stress [MPa]",
            "displacements",
            "y [mm]",
            "stroke-dasharray",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(drawn(Stress::Yy).contains("stress σ_yy [MPa]"));
        assert_eq!("zz".parse(), Ok(Stress::Zz));
    }

    #[test]
    fn a_small_contact_has_a_window_of_its_own() {
        let mut problem = problem();
        let grid = problem.mesh.grid_mut().unwrap();
        grid.x = (0..=40).map(f64::from).collect();
        grid.y = vec![-40.0, -20.0, -10.0, -5.0, -2.0, 0.0];
        let solution = solution(&problem);
        let svg = deformed_svg(
            Theme::Dark,
            &problem,
            &solution.profiles,
            &solution.fields,
            None,
            Stress::Xx,
        )
        .unwrap();
        assert_eq!(svg.matches("<svg").count(), 3, "page, body and contact");
        assert!(svg.contains("contact, displacements"));
        let empty = Fields::default();
        assert!(
            deformed_svg(
                Theme::Dark,
                &problem,
                &solution.profiles,
                &empty,
                None,
                Stress::Xx
            )
            .is_err()
        );
        let mut short = solution.fields.clone();
        short.ux.pop();
        assert!(
            deformed_svg(
                Theme::Dark,
                &problem,
                &solution.profiles,
                &short,
                None,
                Stress::Xx
            )
            .is_err()
        );
    }

    /// Five thousand elements are a large mesh here, and still a figure that a browser shows at once.
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
        let svg = deformed_svg(
            Theme::Light,
            &problem,
            &BTreeMap::new(),
            &fields,
            None,
            Stress::Xx,
        )
        .unwrap();
        assert!(svg.len() < 2_000_000, "{}", svg.len());
        let svg = crate::plot::mesh_svg(Theme::Light, &problem, None, &fields).unwrap();
        assert!(svg.len() < 2_000_000, "{}", svg.len());
    }
}
