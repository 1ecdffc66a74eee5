//! What is drawn of a curve: its part between two places, no more points than can be seen, and dashes.

use std::ops::Range;

/// A point of a curve, or of the page.
type Point = (f64, f64);

/// The part of a curve, whose points are in order of x, within the range `across` of the horizontal axis. `joined`: the
/// points are joined by lines, which end where they leave the range.
pub(super) fn between(points: &[Point], across: &Range<f64>, joined: bool) -> Vec<Point> {
    let inside = |x: f64| across.start <= x && x <= across.end;
    let mut part = Vec::new();
    for (k, &(x, y)) in points.iter().enumerate() {
        let before = k.checked_sub(1).and_then(|k| points.get(k));
        if let Some(&(x0, y0)) = before.filter(|_| joined) {
            for edge in [across.start, across.end] {
                if x0 < edge && edge < x {
                    part.push((edge, y0 + (edge - x0) / (x - x0) * (y - y0)));
                }
            }
        }
        if inside(x) {
            part.push((x, y));
        }
    }
    part
}

/// The points of a curve that can be seen on a page with `columns` columns of pixels over the range `across`: of those in
/// one column the first, the lowest, the highest and the last, in their order. So no peak is lost, whatever the number of
/// points.
pub(super) fn thinned(points: &[Point], across: &Range<f64>, columns: i32) -> Vec<Point> {
    let each = (across.end - across.start) / f64::from(columns.max(1));
    let column = |p: &Point| ((p.0 - across.start) / each).floor();
    let mut kept = Vec::new();
    for same in points.chunk_by(|a, b| column(a) == column(b)) {
        let lowest = (0..same.len()).min_by(|&a, &b| same[a].1.total_cmp(&same[b].1));
        let highest = (0..same.len()).max_by(|&a, &b| same[a].1.total_cmp(&same[b].1));
        let mut places = vec![0, same.len() - 1];
        places.extend(lowest.into_iter().chain(highest));
        places.sort_unstable();
        places.dedup();
        kept.extend(places.into_iter().map(|k| same[k]));
    }
    kept
}

/// The points of a curve without single ones that return into the range `up` between two beyond the same end of it: beside
/// a peak without a limit the quadratic pressure of an edge turns back between its nodes.
pub(super) fn without_returns(points: &[Point], up: &Range<f64>) -> Vec<Point> {
    let returns = |k: usize| {
        let around = k
            .checked_sub(1)
            .and_then(|before| points.get(before))
            .zip(points.get(k + 1));
        around.is_some_and(|(a, b)| {
            let inside = up.start <= points[k].1 && points[k].1 <= up.end;
            inside && (a.1.max(b.1) < up.start || a.1.min(b.1) > up.end)
        })
    };
    let kept = (0..points.len()).filter(|&k| !returns(k));
    kept.map(|k| points[k]).collect()
}

/// Cuts a line on the page into dashes. `pattern`: the lengths of dashes and gaps in turn; an empty pattern leaves the
/// line as it is.
pub(super) fn dashed(line: &[Point], pattern: &[f64]) -> Vec<Vec<Point>> {
    if pattern.iter().sum::<f64>() <= 0.0 {
        return vec![line.to_vec()];
    }
    let mut lengths = pattern.iter().copied().cycle();
    let mut left = lengths.next().unwrap_or(f64::INFINITY);
    let (mut dashes, mut dash, mut draws) = (Vec::new(), Vec::new(), true);
    dash.extend(line.first());
    for pair in line.windows(2) {
        let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
        let length = (x1 - x0).hypot(y1 - y0);
        let mut done = 0.0;
        while length - done > left {
            done += left;
            let part = done / length;
            let at = (x0 + part * (x1 - x0), y0 + part * (y1 - y0));
            if draws {
                dash.push(at);
                dashes.push(std::mem::take(&mut dash));
            } else {
                dash = vec![at];
            }
            draws = !draws;
            left = lengths.next().unwrap_or(f64::INFINITY);
        }
        left -= length - done;
        if draws {
            dash.push((x1, y1));
        }
    }
    if dash.len() > 1 {
        dashes.push(dash);
    }
    dashes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_ends_at_the_ends_of_the_axis() {
        let points = [(0.0, 0.0), (1.0, 10.0), (2.0, 0.0)];
        let part = between(&points, &(0.5..1.5), true);
        assert_eq!(part, [(0.5, 5.0), (1.0, 10.0), (1.5, 5.0)]);
        assert_eq!(
            between(&points, &(0.2..0.6), true),
            [(0.2, 2.0), (0.6, 6.0)]
        );
        assert_eq!(between(&points, &(0.5..1.5), false), [(1.0, 10.0)]);
        assert!(between(&points, &(5.0..6.0), true).is_empty());
    }

    #[test]
    fn a_thinned_curve_keeps_its_peaks_and_its_shape() {
        let mut points: Vec<(f64, f64)> = (0..20_000).map(|k| (f64::from(k), 1.0)).collect();
        points[777].1 = 1e6;
        points[778].1 = -1e6;
        let kept = thinned(&points, &(0.0..20_000.0), 600);
        assert!(kept.len() < 2500, "{}", kept.len());
        assert!(kept.contains(&points[777]) && kept.contains(&points[778]));
        assert_eq!((kept[0], kept[kept.len() - 1]), (points[0], points[19_999]));
        assert!(kept.windows(2).all(|pair| pair[0].0 < pair[1].0));
        let few = &points[..100];
        assert_eq!(
            thinned(few, &(0.0..100.0), 600),
            few,
            "nothing to leave out"
        );
    }

    #[test]
    fn a_point_that_returns_beside_a_peak_is_left_out() {
        let points = [
            -1.0, -3.0, -9.0, -2.0, -12.0, -90.0, -9.0, -1.0, -9.0, -2.0, -3.0,
        ];
        let points: Vec<(f64, f64)> = (0..).map(f64::from).zip(points).collect();
        let kept = without_returns(&points, &(-5.0..1.0));
        let places: Vec<f64> = kept.iter().map(|p| p.0).collect();
        assert_eq!(places, [0.0, 1.0, 2.0, 4.0, 5.0, 6.0, 8.0, 9.0, 10.0]);
        assert_eq!(without_returns(&points, &(-100.0..1.0)), points);
        assert_eq!(without_returns(&points[..1], &(-5.0..1.0)), points[..1]);
    }

    #[test]
    fn dashes_go_round_corners_and_have_their_lengths() {
        let line = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)];
        let dashes = dashed(&line, &[8.0, 1.0]);
        assert_eq!(
            dashes,
            [
                vec![(0.0, 0.0), (8.0, 0.0)],
                vec![(9.0, 0.0), (10.0, 0.0), (10.0, 7.0)],
                vec![(10.0, 8.0), (10.0, 10.0)],
            ]
        );
        assert_eq!(dashed(&line, &[]), [line.to_vec()]);
    }
}
