//! The figure of residuals and of the contact set by iteration.

use super::caption::Caption;
use super::figure::{Curve, LineStyle, Panel, Scale, figure};
use super::style::Style;
use solver::error::shortened;
use solver::problem::Problem;
use solver::solution::Iteration;

/// Draws all residuals and the tolerance on a logarithmic axis, and below them the contact set, against the number of
/// the iteration; vertical lines mark the start of load steps.
///
/// # Errors
///
/// The reason in words, if the figure cannot be drawn.
pub fn convergence_svg(
    style: Style,
    caption: &Caption,
    problem: &Problem,
    history: &[Iteration],
) -> Result<String, String> {
    if history.is_empty() || problem.contacts.is_empty() {
        return Err("without contact there are no iterations to draw".to_owned());
    }
    let curve = |label: &str, style: LineStyle, value: &dyn Fn(&Iteration) -> Option<f64>| {
        let all = history.iter();
        let all = all.filter_map(|row| Some((f64::from(row.k), value(row)?)));
        Curve {
            label: label.to_owned(),
            style,
            points: thinned(all.collect()),
        }
    };
    let limits = style.limits;
    let panel = |y: &str, scale: Scale, marks: Vec<(f64, String)>, curves: Vec<Curve>| Panel {
        x: "iteration".to_owned(),
        y: y.to_owned(),
        scale,
        marks,
        curves,
        across: limits.x,
        up: if scale == Scale::Log {
            limits.y
        } else {
            limits.y_below
        },
        ..Panel::default()
    };
    // frictionless contact has no friction points, and often no node leaves
    let nonzero = |curve: &Curve| curve.points.iter().any(|p| p.1 != 0.0);
    let residuals = vec![
        curve("contact residual", LineStyle::Marked(0), &|row| {
            Some(row.residual)
        }),
        curve("friction residual", LineStyle::Marked(1), &|row| {
            Some(row.friction_residual)
        }),
        curve(
            "criterion (3.5) of the thesis",
            LineStyle::Points(3),
            &|row| row.r_f,
        ),
        curve("tolerance", LineStyle::Dashed, &|row| Some(row.tolerance)),
    ];
    let counts = vec![
        curve("nodes in contact", LineStyle::Marked(0), &|row| {
            Some(f64::from(row.contact.active))
        }),
        curve("entered", LineStyle::Marked(3), &|row| {
            Some(f64::from(row.contact.entered))
        }),
        curve("left", LineStyle::Marked(2), &|row| {
            Some(f64::from(row.contact.left))
        }),
        curve("points in slip", LineStyle::Marked(1), &|row| {
            Some(f64::from(row.friction.slip))
        }),
        curve("points in stick", LineStyle::Marked(4), &|row| {
            Some(f64::from(row.friction.stick))
        }),
    ];
    let residuals = residuals.into_iter().filter(nonzero).collect();
    figure(
        style,
        caption,
        &[
            panel(
                "residual (relative)",
                Scale::Log,
                steps(problem, history, true),
                residuals,
            ),
            panel(
                "count",
                Scale::Count,
                steps(problem, history, false),
                counts.into_iter().filter(nonzero).collect(),
            ),
        ],
    )
}

/// Points from which the same picture is drawn as from all: of each of many parts the least and the greatest, besides the first
/// and the last. A figure has some 600 pixels across, and a job may have a hundred thousand iterations.
fn thinned(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    const PARTS: usize = 400;
    if points.len() <= 2 * PARTS {
        return points;
    }
    let last = points.len() - 1;
    let parts = points.chunks(points.len().div_ceil(PARTS)).enumerate();
    let size = points.len().div_ceil(PARTS);
    let mut kept = vec![0, last];
    for (part, own) in parts {
        let by_value = |&a: &usize, &b: &usize| own[a].1.total_cmp(&own[b].1);
        let extremes = [
            (0..own.len()).min_by(by_value),
            (0..own.len()).max_by(by_value),
        ];
        kept.extend(
            extremes
                .into_iter()
                .flatten()
                .map(|place| part * size + place),
        );
    }
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter().map(|place| points[place]).collect()
}

/// The places on the axis of iterations where load steps begin, with the steps' names.
fn steps(problem: &Problem, history: &[Iteration], named: bool) -> Vec<(f64, String)> {
    let mut marks = Vec::new();
    if problem.steps.len() < 2 {
        return marks;
    }
    let mut before = None;
    for row in history {
        if before != Some(row.step) {
            let step = problem.steps.get(row.step as usize);
            let name = step.and_then(|step| step.name.clone());
            let name = name.unwrap_or_else(|| format!("step {}", row.step));
            let word = if named {
                shortened(&name, 20)
            } else {
                String::new()
            };
            marks.push((f64::from(row.k) - 0.5, word));
            before = Some(row.step);
        }
    }
    marks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_history_is_drawn_from_few_points_with_all_its_extremes() {
        let count = 20_000;
        let mut points: Vec<(f64, f64)> = (1..=count)
            .map(|k| (f64::from(k), (f64::from(k) / 50.0).sin()))
            .collect();
        points[12_345].1 = 7.0;
        points[777].1 = -7.0;
        let kept = thinned(points.clone());
        assert!(kept.len() <= 802, "{}", kept.len());
        assert_eq!(
            (kept[0], kept[kept.len() - 1]),
            (points[0], points[count as usize - 1])
        );
        assert!(kept.contains(&points[12_345]) && kept.contains(&points[777]));
        assert!(kept.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert_eq!(thinned(points[..800].to_vec()).len(), 800);
    }
}
