//! Regions of a plane that are made of many polygons, drawn by their outlines alone.

use std::collections::{BTreeMap, HashMap};

use super::body::Path;

/// The distance from a line (units of the drawing: a tenth of a pixel) within which a corner of an outline is left out.
const FLAT: f64 = 1.5;

type Corner = [i32; 2];

/// A region: the sum of polygons that go round in the same direction. A side that two of them have in common is inside of
/// the region and not kept, which changes nothing that is filled: it is passed once in each direction.
#[derive(Clone, Debug, Default)]
pub(super) struct Region {
    /// How often each side is passed.
    sides: HashMap<(Corner, Corner), u32>,
}

impl Region {
    /// Adds a polygon by its corners on the page.
    pub(super) fn add(&mut self, corners: impl Iterator<Item = [f64; 2]>) {
        let mut polygon: Vec<Corner> = corners.map(|corner| corner.map(rounded)).collect();
        polygon.dedup();
        for (k, &from) in polygon.iter().enumerate() {
            let to = polygon[(k + 1) % polygon.len()];
            if from == to {
                continue;
            }
            match self.sides.get_mut(&(to, from)) {
                Some(1) => {
                    self.sides.remove(&(to, from));
                }
                Some(count) => *count -= 1,
                None => *self.sides.entry((from, to)).or_default() += 1,
            }
        }
    }

    /// The outlines of the region as closed lines.
    pub(super) fn path(self) -> Path {
        let mut ends: BTreeMap<Corner, Vec<Corner>> = BTreeMap::new();
        for ((from, to), count) in self.sides {
            let to = std::iter::repeat_n(to, count as usize);
            ends.entry(from).or_default().extend(to);
        }
        // the order in a hash map is another one each time, and equal figures have equal bits
        ends.values_mut().for_each(|to| to.sort_unstable());
        let mut path = Path::default();
        while let Some((&start, _)) = ends.first_key_value() {
            let mut outline = vec![start];
            let mut here = start;
            // as many sides end at a corner as begin there, so that a walk ends where it began
            while let Some(to) = ends.get_mut(&here).and_then(Vec::pop) {
                if ends.get(&here).is_some_and(Vec::is_empty) {
                    ends.remove(&here);
                }
                here = to;
                if here == start {
                    break;
                }
                outline.push(here);
            }
            let outline = simplified(&outline);
            // what is thinner than can be seen has no outline
            if outline.len() > 2 {
                path.polygon(&outline);
            }
        }
        path
    }
}

fn rounded(x: f64) -> i32 {
    x.clamp(-1e6, 1e6).round() as i32
}

/// The corners of a closed outline without those that are nearly on the line between others.
fn simplified(outline: &[Corner]) -> Vec<[f64; 2]> {
    let points: Vec<[f64; 2]> = outline.iter().map(|p| p.map(f64::from)).collect();
    let off = |p: &[f64; 2]| (p[0] - points[0][0]).hypot(p[1] - points[0][1]);
    let farthest = (0..points.len()).max_by(|&a, &b| off(&points[a]).total_cmp(&off(&points[b])));
    let Some(farthest) = farthest.filter(|far| *far > 0) else {
        return points;
    };
    let round: Vec<[f64; 2]> = points.iter().chain(points.first()).copied().collect();
    let mut kept = vec![false; round.len()];
    (kept[0], kept[farthest]) = (true, true);
    // of each part between kept corners, the corner that is farthest from the line between them, if it is far enough
    let mut parts = vec![(0, farthest), (farthest, points.len())];
    while let Some((from, to)) = parts.pop() {
        let (a, b) = (round[from], round[to]);
        let away = |k: &usize| distance(round[*k], a, b);
        let most = (from + 1..to).max_by(|j, k| away(j).total_cmp(&away(k)));
        if let Some(k) = most.filter(|k| away(k) > FLAT) {
            kept[k] = true;
            parts.extend([(from, k), (k, to)]);
        }
    }
    let points = points.into_iter().zip(kept);
    points.filter_map(|(p, kept)| kept.then_some(p)).collect()
}

/// The distance of a point from the line between two others.
fn distance(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let from = [p[0] - a[0], p[1] - a[1]];
    let square = along[0] * along[0] + along[1] * along[1];
    let part = if square > 0.0 {
        ((from[0] * along[0] + from[1] * along[1]) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (from[0] - part * along[0]).hypot(from[1] - part * along[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x: f64, y: f64) -> [[f64; 2]; 4] {
        [[x, y], [x + 10.0, y], [x + 10.0, y + 10.0], [x, y + 10.0]]
    }

    #[test]
    fn common_sides_are_not_drawn() {
        let mut region = Region::default();
        for k in 0..8 {
            region.add(square(10.0 * f64::from(k), 0.0).into_iter());
        }
        assert_eq!(region.path().0, "M0 0l80 0 0 10-80 0z");
    }

    #[test]
    fn a_hole_stays_a_hole_and_separate_parts_stay_separate() {
        let mut region = Region::default();
        for (i, j) in [
            (0, 0),
            (1, 0),
            (2, 0),
            (0, 1),
            (2, 1),
            (0, 2),
            (1, 2),
            (2, 2),
            (9, 9),
        ] {
            region.add(square(10.0 * f64::from(i), 10.0 * f64::from(j)).into_iter());
        }
        let path = region.clone().path().0;
        assert_eq!(path.matches('z').count(), 3, "{path}");
        assert_eq!(path, region.path().0, "the same every time");
    }

    #[test]
    fn corners_that_cannot_be_seen_are_left_out() {
        let corners: Vec<Corner> = (0..=100)
            .map(|k| [10 * k, k % 2])
            .chain([[1000, 500], [0, 500]])
            .collect();
        assert_eq!(simplified(&corners).len(), 4);
        assert_eq!(simplified(&[[3, 4]]), [[3.0, 4.0]]);
    }
}
