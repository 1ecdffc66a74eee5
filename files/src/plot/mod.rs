//! Figures for papers and lectures, light or dark, for a column, a page or a slide, as SVG; `image` converts them to
//! PNG and PDF. The figures of the Python client look the same.
//!
//! Axes, text and curves are drawn by plotters. Bodies (`body`) are paths written here, since plotters neither clips
//! nor joins shapes.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | the figures | `mesh`, `deformed`, `profile`, `convergence` |
//! | pieces: panels with curves, a curve, an axis | `figure`, `lines`, `axis` |
//! | pieces: a body, a field in colours, the outline of a region, an obstacle | `body`, `bands`, `region`, `obstacle` |
//! | the page, its texts, sizes, limits of axes, colours, numbers | `page`, `caption`, `style`, `limits`, `theme`, `numbers` |
//! | PNG and PDF | `image` |
//! | a problem in words | `description` |
//! | compact arrays for programs that draw themselves | `view` |

mod axis;
mod bands;
mod body;
mod caption;
mod convergence;
mod deformed;
mod description;
mod figure;
pub mod image;
mod limits;
mod lines;
mod mesh;
mod numbers;
mod obstacle;
mod page;
mod profile;
mod region;
mod style;
mod theme;
pub mod view;

use std::collections::BTreeMap;

pub use axis::within;
pub use caption::{Caption, Mark};
pub use convergence::convergence_svg;
pub use deformed::deformed_svg;
pub use description::description;
pub use figure::{Above, Curve, LineStyle, Panel, Scale, Shade, ShadeKind, figure};
pub use limits::{AxisLimits, Limits};
pub use mesh::mesh_svg;
pub use profile::{ProfileView, profile_svg};
pub use style::{Size, Stress, Style, Texts};
pub use theme::Theme;
pub use view::ViewField;

use solver::mesh::Mesh;
use solver::problem::Problem;
use solver::solution::{ContactProfile, Fields, Iteration, Summary};
use strum::{EnumString, IntoStaticStr, VariantArray};

/// The figures of a problem and its solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr, EnumString, VariantArray)]
#[strum(serialize_all = "snake_case")]
pub enum Plot {
    /// Elements and named boundaries.
    Mesh,
    /// The deformed body with its stresses.
    Deformed,
    /// Stresses along the contact boundaries.
    Profile,
    /// Residuals and contact set by iteration.
    Convergence,
}

impl Plot {
    /// All kinds of figures.
    pub const ALL: &[Plot] = Plot::VARIANTS;

    /// The name of the figure in paths and file names.
    pub fn as_str(self) -> &'static str {
        self.into()
    }

    /// What is wrong with limits of axes for this figure, each as the name of the limits and the reason.
    pub fn refused(self, limits: &AxisLimits) -> Vec<(&'static str, &'static str)> {
        let mut refused = Vec::new();
        let positive = |limits: Limits| limits.range().start > 0.0;
        if self == Plot::Convergence && limits.y.is_some_and(|limits| !positive(limits)) {
            refused.push((
                "ylim",
                "the axis of residuals is logarithmic: limits are positive",
            ));
        }
        if limits.y_below.is_some() && matches!(self, Plot::Mesh | Plot::Deformed) {
            let reason = "it is for the lower panels of the figures profile and convergence";
            refused.push(("ylim_below", reason));
        }
        refused
    }
}

/// The parts of a solution from which figures are drawn. Parts that a figure does not need may be empty.
#[derive(Clone, Copy, Debug)]
pub struct Parts<'a> {
    /// The iterations, for `convergence`.
    pub history: &'a [Iteration],
    /// The summary: every figure of a result shows its verdict, outcome and warnings.
    pub summary: Option<&'a Summary>,
    /// Whether the job has not finished.
    pub partial: bool,
    /// The load step at the end of which the result is; `None` for the last.
    pub step: Option<&'a str>,
    /// The profiles at all points, so that peaks are visible: for `profile`, and for `deformed`.
    pub profiles: &'a BTreeMap<String, ContactProfile>,
    /// The fields, for `deformed`; without them `mesh` draws the problem's own mesh.
    pub fields: &'a Fields,
    /// The mesh that the problem names by its hash, if it names one: for `mesh`.
    pub stored: Option<&'a Mesh>,
}

/// Draws one figure of a problem and its solution, as SVG.
///
/// # Errors
///
/// The reason in words, if the figure cannot be drawn.
pub fn draw(
    plot: Plot,
    style: impl Into<Style>,
    problem: &Problem,
    parts: &Parts<'_>,
) -> Result<String, String> {
    let style = style.into();
    if let Some((name, reason)) = plot.refused(&style.limits).first() {
        return Err(format!("{name}: {reason}"));
    }
    let default = match plot {
        Plot::Mesh => "Mesh",
        Plot::Deformed => "Deformed body",
        Plot::Profile => "Contact stresses",
        Plot::Convergence => "Convergence",
    };
    let mut caption = Caption::of_problem(problem, default);
    if let Some(step) = parts.step {
        let step = solver::error::shortened(step, 40);
        caption.parameters.push(format!("load step {step}"));
    }
    // the mesh is that of the problem, whatever became of the result
    if plot != Plot::Mesh {
        caption = caption.with_result(parts.summary, parts.partial);
    }
    match plot {
        Plot::Mesh => mesh_svg(style, &caption, problem, parts.stored, parts.fields),
        Plot::Deformed => deformed_svg(style, &caption, problem, parts.profiles, parts.fields),
        Plot::Profile => profile_svg(style, &caption, problem, parts.profiles, parts.summary),
        Plot::Convergence => convergence_svg(style, &caption, problem, parts.history),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use solver::solution::Solution;

    /// A small problem with everything that a figure shows.
    pub(super) fn problem() -> Problem {
        serde_json::from_value(serde_json::json!({
            "title": "Punch",
            "units": { "length": "mm", "force": "N", "stress": "MPa" },
            "analysis": { "kind": "plane_strain" },
            "mesh": { "grid": { "x": [0, 1, 2], "y": [-1, 0] } },
            "materials": [{ "youngs_modulus": 1000, "poissons_ratio": 0.3 }],
            "supports": [{ "boundary": "bottom", "ux": 0, "uy": 0 }],
            "contacts": [{
                "boundary": "top",
                "obstacle": { "kind": "circle", "radius": 8 },
                "indentation": 0.01,
                "friction": { "coefficient": 0.3, "nonlocal_radius": 0.01, "elastic_slip": 1e-4 }
            }]
        }))
        .unwrap()
    }

    pub(super) fn solution(problem: &Problem) -> Solution {
        solver::solve(problem, &mut ()).unwrap()
    }

    #[test]
    fn every_plot_has_a_name_and_is_drawn_in_both_themes() {
        let problem = problem();
        let solution = solution(&problem);
        let parts = Parts {
            history: &solution.history,
            summary: Some(&solution.summary),
            partial: false,
            step: None,
            profiles: &solution.profiles,
            fields: &solution.fields,
            stored: None,
        };
        for &plot in Plot::ALL {
            assert_eq!(plot.as_str().parse(), Ok(plot));
            let drawn = |theme| draw(plot, theme, &problem, &parts).unwrap();
            let (light, dark) = (drawn(Theme::Light), drawn(Theme::Dark));
            assert!(light.contains("Punch") && light.starts_with(r#"<svg width="720""#));
            assert_ne!(light, dark);
            assert!(light.contains("μ = 0.3, ρ = 0.01 mm, ε = 1e−4 mm"));
            assert_eq!(light.contains("● verdict: "), plot != Plot::Mesh);
            let style = Style {
                size: Size::Column,
                ..Style::default()
            };
            let column = draw(plot, style, &problem, &parts).unwrap();
            assert!(column.starts_with(r#"<svg width="520""#));
            assert_eq!(light, drawn(Theme::Light), "the same figure, the same text");
        }
        assert!("elements".parse::<Plot>().is_err() && "grey".parse::<Theme>().is_err());
    }

    #[test]
    fn units_are_names_and_change_no_number() {
        let problem = problem();
        let nameless = Problem {
            units: None,
            ..problem.clone()
        };
        assert_eq!(solution(&problem), solution(&nameless));
    }

    #[test]
    fn load_steps_are_marked_by_their_names() {
        let mut problem = problem();
        problem.steps = serde_json::from_value(serde_json::json!([
            { "name": "indent" }, { "tangential_displacement": 1 }
        ]))
        .unwrap();
        let history = solution(&problem).history;
        let caption = Caption::default();
        let light = Theme::Light.into();
        let svg = convergence_svg(light, &caption, &problem, &history).unwrap();
        for text in [
            "indent",
            "step 1",
            "tolerance",
            "friction residual",
            "nodes in contact",
            "10⁻¹⁰",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(convergence_svg(light, &caption, &problem, &[]).is_err());
    }
}
