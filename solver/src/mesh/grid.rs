//! Grids of lines, and strips between two polylines.

use crate::element::Element;
use crate::error::{AllChecks, Checked, Findings, Reason, Violation};
use crate::mesh::Mesh;
use crate::problem::Grid;

/// The mesh of a checked grid, with the boundaries `left`, `right`, `bottom`, `top`.
///
/// Corners lie on the crossings of the lines, midsides halfway between corners. In a strip the y
/// lines are fractions of the height between `bottom` (y = 0 when absent) and `top` (likewise).
pub fn grid_mesh(grid: &Grid) -> Mesh {
    let (nx, ny) = (grid.x.len() - 1, grid.y.len() - 1);
    let strip = grid.top.is_some() || grid.bottom.is_some();
    let corner = |i: usize, j: usize| -> [f64; 2] {
        let (x, y) = (grid.x[i], grid.y[j]);
        if !strip {
            return [x, y];
        }
        let (low, high) = (height(&grid.bottom, x), height(&grid.top, x));
        [x, low + y * (high - low)]
    };
    // Half-steps: (even, even) are corners, (odd, even) and (even, odd) midsides, (odd, odd) nothing.
    let mut number = vec![u32::MAX; (2 * nx + 1) * (2 * ny + 1)];
    let at = |i: usize, j: usize| j * (2 * nx + 1) + i;
    let mut nodes = Vec::new();
    for j in 0..=2 * ny {
        for i in 0..=2 * nx {
            if i % 2 == 1 && j % 2 == 1 {
                continue;
            }
            let (a, b) = (corner(i / 2, j / 2), corner(i.div_ceil(2), j.div_ceil(2)));
            number[at(i, j)] = nodes.len() as u32;
            nodes.push([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]);
        }
    }
    let node = |i: usize, j: usize| number[at(i, j)];
    let mut elements = Vec::with_capacity(nx * ny);
    for j in (0..2 * ny).step_by(2) {
        for i in (0..2 * nx).step_by(2) {
            elements.push(Element::Quad([
                node(i, j),
                node(i + 2, j),
                node(i + 2, j + 2),
                node(i, j + 2),
                node(i + 1, j),
                node(i + 2, j + 1),
                node(i + 1, j + 2),
                node(i, j + 1),
            ]));
        }
    }
    // with the body on the right: bottom runs along −x, left along +y, top along +x, right along −y
    let (w, h) = (2 * nx, 2 * ny);
    let boundaries = [
        (
            "left",
            (0..ny)
                .map(|k| [node(0, 2 * k), node(0, 2 * k + 2), node(0, 2 * k + 1)])
                .collect(),
        ),
        (
            "top",
            (0..nx)
                .map(|k| [node(2 * k, h), node(2 * k + 2, h), node(2 * k + 1, h)])
                .collect(),
        ),
        (
            "right",
            (0..ny)
                .rev()
                .map(|k| [node(w, 2 * k + 2), node(w, 2 * k), node(w, 2 * k + 1)])
                .collect(),
        ),
        (
            "bottom",
            (0..nx)
                .rev()
                .map(|k| [node(2 * k + 2, 0), node(2 * k, 0), node(2 * k + 1, 0)])
                .collect(),
        ),
    ];
    let boundaries = boundaries
        .into_iter()
        .map(|(name, edges)| (name.to_owned(), edges))
        .collect();
    Mesh {
        nodes,
        elements,
        boundaries,
        ..Mesh::default()
    }
}

/// The height of a polyline at x, linear between its points; 0 if there is no polyline.
fn height(line: &Option<Vec<[f64; 2]>>, x: f64) -> f64 {
    let Some(points) = line else { return 0.0 };
    let after = points
        .partition_point(|p| p[0] < x)
        .clamp(1, points.len() - 1);
    let ([x0, y0], [x1, y1]) = (points[after - 1], points[after]);
    if x == x1 {
        return y1; // exact at the kinks, where grid lines should lie
    }
    y0 + (x - x0) / (x1 - x0) * (y1 - y0)
}

/// The place where the strip differs most from its polylines: x and the distance; `None` when every kink has a grid
/// line.
pub fn largest_cut(grid: &Grid) -> Option<(f64, f64)> {
    let rounding = 1e-9 * (grid.x[grid.x.len() - 1] - grid.x[0]);
    let mut worst: Option<(f64, f64)> = None;
    for line in [&grid.top, &grid.bottom] {
        for &[x, y] in line.iter().flatten() {
            let after = grid.x.partition_point(|grid_x| *grid_x < x);
            if after == 0 || after == grid.x.len() {
                continue;
            }
            let (x0, x1) = (grid.x[after - 1], grid.x[after]);
            let (y0, y1) = (height(line, x0), height(line, x1));
            let distance = (y - (y0 + (x - x0) / (x1 - x0) * (y1 - y0))).abs();
            if distance > rounding && worst.is_none_or(|(_, most)| distance > most) {
                worst = Some((x, distance));
            }
        }
    }
    worst
}

/// Checks that a grid can be meshed; `pointer` is its place in the problem.
///
/// # Errors
///
/// All violations of the grid.
pub fn check_grid(grid: &Grid, pointer: &str) -> Result<(), Vec<Violation>> {
    let mut found = Findings::of_mesh(pointer);
    let mut all = AllChecks::default();
    for (field, lines) in [("/x", &grid.x), ("/y", &grid.y)] {
        all.check(check_lines(field, lines, &mut found));
    }
    let edges = [("/top", &grid.top), ("/bottom", &grid.bottom)].map(|(field, edge)| {
        let checked = match edge {
            None => Ok(()),
            Some(points) => check_edge(field, points, &grid.x, &mut found),
        };
        all.check(checked)
    });
    let strip = grid.top.is_some() || grid.bottom.is_some();
    let sound = edges == [Some(()); 2] && !grid.x.is_empty() && !grid.y.is_empty();
    if strip && sound {
        all.check(check_strip(grid, &mut found));
    }
    found.conclude(all.finish(()))
}

/// Checks the lines in one direction.
fn check_lines(field: &str, lines: &[f64], found: &mut Findings) -> Checked {
    let mut all = AllChecks::default();
    if lines.len() < 2 {
        all.fail(found.report(
            field,
            Reason::TooFew,
            format!("{} line(s)", lines.len()),
            "at least two lines",
            "Give the first and the last line at least.",
        ));
    }
    if let Some(i) = (1..lines.len()).find(|&i| lines[i] <= lines[i - 1]) {
        all.fail(found.report(
            format!("{field}/{i}"),
            Reason::NotIncreasing,
            format!("{} after {}", lines[i], lines[i - 1]),
            "strictly increasing lines",
            "Sort the lines and remove repeated ones.",
        ));
    }
    all.finish(())
}

/// Checks the upper or lower edge of a strip.
fn check_edge(field: &str, points: &[[f64; 2]], x: &[f64], found: &mut Findings) -> Checked {
    if points.len() < 2 {
        return Err(found.report(
            field,
            Reason::TooFew,
            format!("{} point(s)", points.len()),
            "at least two points",
            "Give the two ends of the edge.",
        ));
    }
    if let Some(i) = (1..points.len()).find(|&i| points[i][0] <= points[i - 1][0]) {
        return Err(found.report(
            format!("{field}/{i}"),
            Reason::NotIncreasing,
            format!("x = {} after {}", points[i][0], points[i - 1][0]),
            "points with strictly increasing x",
            "A vertical step cannot be meshed; use an inline mesh.",
        ));
    }
    let ([low, _], [high, _]) = (points[0], points[points.len() - 1]);
    match (x.first(), x.last()) {
        (Some(first), Some(last)) if low > *first || high < *last => Err(found.report(
            field,
            Reason::DoesNotSpan,
            format!("x from {low} to {high}"),
            format!("a line over all of x, from {first} to {last}"),
            "Extend the polyline to the first and last grid line.",
        )),
        _ => Ok(()),
    }
}

/// Checks that a strip has fractions of the height, and a positive height everywhere.
fn check_strip(grid: &Grid, found: &mut Findings) -> Checked {
    let mut all = AllChecks::default();
    if grid.y[0] != 0.0 || grid.y[grid.y.len() - 1] != 1.0 {
        all.fail(found.report(
            "/y",
            Reason::OutOfRange,
            format!("{} … {}", grid.y[0], grid.y[grid.y.len() - 1]),
            "fractions of the strip's height from 0 to 1",
            "With `top` or `bottom`, y counts from 0 at the lower edge to 1 at the upper.",
        ));
    }
    let at = |x: f64| height(&grid.top, x) - height(&grid.bottom, x);
    let flat = grid.x.iter().find(|x| at(**x).is_nan() || at(**x) <= 0.0);
    if let Some(x) = flat {
        let field = match grid.top {
            Some(_) => "/top",
            None => "/bottom",
        };
        all.fail(found.report(
            field,
            Reason::OutOfRange,
            format!("height {} at x = {x}", at(*x)),
            "an upper edge above the lower one everywhere",
            "Without `bottom` (or `top`) that edge is y = 0.",
        ));
    }
    all.finish(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(x: &[f64], y: &[f64]) -> Grid {
        Grid {
            x: x.to_vec(),
            y: y.to_vec(),
            top: None,
            bottom: None,
        }
    }

    #[test]
    fn a_grid_of_two_by_one_has_thirteen_nodes_and_directed_boundaries() {
        let mesh = grid_mesh(&lines(&[0.0, 1.0, 3.0], &[-1.0, 0.0]));
        assert_eq!((mesh.nodes.len(), mesh.elements.len()), (13, 2));
        assert!(mesh.inverted_elements(true).is_empty());
        for (name, direction) in [
            ("top", [1.0, 0.0]),
            ("bottom", [-1.0, 0.0]),
            ("left", [0.0, 1.0]),
            ("right", [0.0, -1.0]),
        ] {
            for edge in &mesh.boundaries[name] {
                let [a, b, m] = mesh.edge_nodes(edge);
                for k in 0..2 {
                    assert_eq!(
                        (b[k] - a[k]).signum() * f64::from(b[k] != a[k]),
                        direction[k],
                        "{name}"
                    );
                    assert_eq!(m[k], 0.5 * (a[k] + b[k]), "{name}");
                }
            }
        }
    }

    #[test]
    fn a_strip_follows_its_polyline() {
        let mut grid = lines(&[0.0, 1.0, 2.0, 3.0, 5.0], &[0.0, 0.5, 1.0]);
        grid.top = Some(vec![[0.0, 1.0], [1.0, 1.0], [3.0, 0.5], [5.0, 0.5]]);
        assert_eq!(check_grid(&grid, ""), Ok(()));
        assert_eq!(largest_cut(&grid), None);
        let mesh = grid_mesh(&grid);
        for (x, y) in [(1.0, 1.0), (2.0, 0.75), (3.0, 0.5), (2.5, 0.625)] {
            assert!(mesh.nodes.contains(&[x, y]), "({x}, {y})");
        }
    }

    #[test]
    fn a_kink_between_grid_lines_is_found() {
        let mut grid = lines(&[0.0, 2.0, 4.0], &[0.0, 1.0]);
        grid.top = Some(vec![[0.0, 1.0], [1.0, 4.0], [2.0, 1.0], [4.0, 1.0]]);
        assert_eq!(largest_cut(&grid), Some((1.0, 3.0)));
    }

    #[test]
    fn every_fault_of_a_grid_is_reported() {
        let mut grid = lines(&[0.0, 2.0, 1.0], &[0.0]);
        grid.top = Some(vec![[0.0, 1.0]]);
        let pointers: Vec<_> = check_grid(&grid, "/mesh/grid")
            .unwrap_err()
            .into_iter()
            .map(|v| v.pointer)
            .collect();
        assert_eq!(
            pointers,
            ["/mesh/grid/x/2", "/mesh/grid/y", "/mesh/grid/top"]
        );
    }
}
