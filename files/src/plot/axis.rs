//! The range of an axis, the parts of curves within that range, and the axis's numbers.

use std::ops::Range;

/// The largest number of decades of a logarithmic axis, from the largest value down.
const DECADES: f64 = 18.0;
/// The largest stress on an axis, as a multiple of the stress that half of the contact stays below; a higher peak is
/// cut off and marked.
pub(super) const CUT: f64 = 6.0;

/// The range of an axis for stresses: from the smallest to the largest, including zero, but at most `cut` times the
/// stress that half of the length under stress stays below. Shares are measured by length and not by points, since a
/// mesh has most of its points at the peak.
pub(super) fn limits(curves: &[&[(f64, f64)]], cut: f64) -> Range<f64> {
    let mut parts: Vec<(f64, f64)> = Vec::new(); // value, length
    for points in curves {
        for (k, &(_, y)) in points.iter().enumerate() {
            let before = points[k.saturating_sub(1)].0;
            let after = points[(k + 1).min(points.len() - 1)].0;
            parts.push((y, (after - before) / 2.0));
        }
    }
    let (least, most) = parts
        .iter()
        .fold((0.0_f64, 0.0_f64), |(l, h), p| (l.min(p.0), h.max(p.0)));
    let largest = most.max(-least);
    let sizes = parts.iter().map(|&(y, length)| (y.abs(), length));
    let acting = sizes.filter(|(y, _)| *y > 1e-9 * largest).collect();
    let reach = match quantile(acting, 0.5) {
        Some(usual) if usual * cut < largest => usual * cut,
        _ => largest,
    };
    // a single point may overshoot beside a peak: where nothing of length is beyond zero, the axis ends there
    let (low, high) = (quantile(parts.clone(), 0.001), quantile(parts, 0.999));
    let below = if low.is_some_and(|low| low < 0.0) {
        reach.min(-least)
    } else {
        0.0
    };
    let above = if high.is_some_and(|high| high > 0.0) {
        reach.min(most)
    } else {
        0.0
    };
    if below + above > 0.0 {
        -1.08 * below - 0.02 * above..1.08 * above + 0.02 * below
    } else {
        -1.0..1.0
    }
}

/// The value below which a share (0 … 1) of the total length lies. `parts`: values with their lengths.
fn quantile(mut parts: Vec<(f64, f64)>, share: f64) -> Option<f64> {
    parts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole: f64 = parts.iter().map(|p| p.1).sum();
    let mut length = 0.0;
    let reached = parts.iter().find(|part| {
        length += part.1;
        length >= share * whole
    });
    reached.or(parts.last()).map(|part| part.0)
}

/// The parts of a curve within the range `up` of the vertical axis; each ends where the curve leaves the range.
pub fn within(points: &[(f64, f64)], up: &Range<f64>) -> Vec<Vec<(f64, f64)>> {
    let inside = |y: f64| up.start <= y && y <= up.end;
    let mut parts: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut part: Vec<(f64, f64)> = Vec::new();
    for (k, &(x, y)) in points.iter().enumerate() {
        if let Some(&(x0, y0)) = k.checked_sub(1).and_then(|k| points.get(k)) {
            // where the line from the point before crosses the ends of the axis, in order
            let mut crossings: Vec<(f64, f64)> = [up.start, up.end]
                .into_iter()
                .filter(|limit| (y0 < *limit) != (y < *limit) && y0 != *limit && y != *limit)
                .map(|limit| (x0 + (limit - y0) / (y - y0) * (x - x0), limit))
                .collect();
            if y < y0 {
                crossings.reverse();
            }
            for crossing in crossings {
                part.push(crossing);
                if part.len() > 1 {
                    parts.push(std::mem::take(&mut part));
                }
            }
        }
        if inside(y) {
            part.push((x, y));
        }
    }
    if part.len() > 1 {
        parts.push(part);
    }
    parts
}

/// The farthest point of a curve beyond the range `up` of the vertical axis each time that the curve leaves it: x, the
/// value, and whether the curve leaves at the top.
pub(super) fn peaks(points: &[(f64, f64)], up: &Range<f64>) -> Vec<(f64, f64, bool)> {
    let mut found: Vec<(f64, f64, bool)> = Vec::new();
    let mut before = None;
    for &(x, y) in points {
        let side = match y {
            y if y > up.end => Some(true),
            y if y < up.start => Some(false),
            _ => None,
        };
        if let Some(over) = side {
            match found.last_mut().filter(|_| before == side) {
                Some(peak) if y.abs() > peak.1.abs() => (peak.0, peak.1) = (x, y),
                Some(_) => {}
                None => found.push((x, y, over)),
            }
        }
        before = side;
    }
    found
}

/// The peak that a figure names: x, the value, and whether the peak is at the top. It is the largest peak beyond the
/// axis; if there is none, the largest point of the curves, provided that there is a remark (`of_peak`) about it.
pub(super) fn named_peak(
    curves: &[&[(f64, f64)]],
    up: &Range<f64>,
    of_peak: &str,
) -> Option<(f64, f64, bool)> {
    let beyond = curves.iter().flat_map(|points| peaks(points, up));
    let largest = beyond.reduce(|most, peak| {
        if peak.1.abs() > most.1.abs() {
            peak
        } else {
            most
        }
    });
    if largest.is_some() || of_peak.is_empty() {
        return largest;
    }
    let points = curves.iter().copied().flatten();
    let peak = points.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    Some((peak.0, peak.1, peak.1 > 0.0))
}

/// The value of a curve at `at`, linear between its points, whose first coordinate rises.
pub(super) fn interpolated(
    points: impl Iterator<Item = (f64, f64)> + Clone,
    at: f64,
) -> Option<f64> {
    let mut pairs = points.clone().zip(points.skip(1));
    pairs.find_map(|((a, p), (b, q))| {
        let inside = a <= at && at <= b && a < b;
        inside.then(|| p + (at - a) / (b - a) * (q - p))
    })
}

/// The place on the first axis where the second axis has a value. `places`: pairs of values on both axes.
pub(super) fn place_of(places: &[(f64, f64)], value: f64) -> Option<f64> {
    let turned = places.iter().map(|&(s, c)| (c, s));
    if places.first()?.1 <= places.last()?.1 {
        interpolated(turned, value)
    } else {
        interpolated(turned.rev(), value)
    }
}

/// The number of ticks of an axis over whole numbers: one for each whole number, but no more than fit.
pub(super) fn ticks(range: &Range<f64>) -> usize {
    ((range.end - range.start) as usize + 1).clamp(2, 12)
}

/// The text of 10ⁿ for a whole n; empty for other numbers.
pub(super) fn power_of_ten(exponent: f64) -> String {
    let round = exponent.round();
    if (exponent - round).abs() > 1e-6 {
        return String::new();
    }
    let raised = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + digit.to_digit(10).unwrap_or(0)).unwrap_or('?'),
    };
    format!(
        "10{}",
        (round as i32)
            .to_string()
            .chars()
            .map(raised)
            .collect::<String>()
    )
}

/// The range of whole decades around all exponents.
pub(super) fn decades(exponents: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = exponents.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), e| {
        (low.min(e), high.max(e))
    });
    if low > high {
        return -1.0..1.0;
    }
    let top = (high + 0.1).ceil();
    (low - 0.1).floor().max(top - DECADES).min(top - 2.0)..top
}

/// The range from the smallest to the largest value; never empty.
pub(super) fn extent(values: impl Iterator<Item = f64>) -> Range<f64> {
    let start = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = values.fold(start, |(low, high), v| (low.min(v), high.max(v)));
    if low < high {
        low..high
    } else if low == high {
        low - 1.0..low + 1.0
    } else {
        0.0..1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_ten_are_raised_and_their_axis_ends_on_them() {
        assert_eq!(power_of_ten(-10.0), "10⁻¹⁰");
        assert_eq!(power_of_ten(2.0), "10²");
        assert_eq!(power_of_ten(0.5), "");
        assert_eq!(decades([-9.5, 0.3].into_iter()), -10.0..1.0);
        assert_eq!(decades([-300.0, 0.3].into_iter()), -17.0..1.0);
        assert_eq!(decades([0.5].into_iter()), -1.0..1.0);
        assert_eq!(decades(std::iter::empty()), -1.0..1.0);
    }

    #[test]
    fn a_curve_ends_where_it_leaves_the_axis() {
        let points = [(0.0, 0.0), (1.0, 2.0), (2.0, -2.0), (3.0, 0.5)];
        let parts = within(&points, &(-1.0..1.0));
        assert_eq!(
            parts,
            [
                vec![(0.0, 0.0), (0.5, 1.0)],
                vec![(1.25, 1.0), (1.75, -1.0)],
                vec![(2.4, -1.0), (3.0, 0.5)],
            ]
        );
        assert!(within(&[(0.0, 5.0), (1.0, 6.0)], &(-1.0..1.0)).is_empty());
    }

    #[test]
    fn the_second_axis_may_run_either_way() {
        let rising = [(0.0, 5.0), (2.0, 9.0)];
        let falling = [(0.0, 9.0), (2.0, 5.0)];
        assert_eq!(place_of(&rising, 6.0), Some(0.5));
        assert_eq!(place_of(&falling, 6.0), Some(1.5));
        assert_eq!(place_of(&falling, 60.0), None);
    }
}
