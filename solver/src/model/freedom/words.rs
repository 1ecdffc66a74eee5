//! Describes rigid motions in words.

use super::parts::{Motion, Part, Parts, add, dot};

impl Parts<'_> {
    /// One to three motions in words, one of these motions, and whether the motions are only a rotation.
    pub(super) fn words(&self, part: &Part, motions: &[Motion]) -> (String, Motion, bool) {
        if !self.never.is_empty() {
            return ("along the axis".to_owned(), [0.0, 1.0, 0.0], false);
        }
        // one rotation, if any; the others without it are translations
        let turn = |motion: &&Motion| motion[2].abs();
        let most = motions.iter().max_by(|a, b| turn(a).total_cmp(&turn(b)));
        let scale = |m: &Motion| m[0].hypot(m[1]).max(m[2].abs());
        let rotation = most
            .filter(|m| m[2].abs() > 1e-6 * scale(m))
            .map(|m| m.map(|v| v / m[2]));
        let mut translations: Vec<Motion> = Vec::new();
        for motion in motions {
            let mut rest = *motion;
            if let Some(rotation) = rotation {
                (0..3).for_each(|i| rest[i] -= motion[2] * rotation[i]);
            }
            rest[2] = 0.0;
            if dot(&rest, &rest).sqrt() > 1e-6 * scale(motion) {
                add(&mut translations, rest, 1e-6 * scale(motion));
            }
        }
        let mut names: Vec<String> = match translations[..] {
            [_, _] => vec!["along x".to_owned(), "along y".to_owned()],
            [only] => vec![along(only)],
            _ => Vec::new(),
        };
        let turns = names.is_empty();
        let first = match (&translations[..], rotation) {
            ([_, _], _) => [1.0, 0.0, 0.0],
            ([only], _) => *only,
            (_, Some(rotation)) => rotation,
            _ => [0.0; 3],
        };
        match (rotation, &translations[..]) {
            (None, _) => {}
            (Some(_), [_, _]) => names.push("in rotation".to_owned()),
            (Some(mut rotation), translations) => {
                // the centre nearest to that of the part
                for other in translations {
                    let share = dot(other, &rotation);
                    (0..2).for_each(|i| rotation[i] -= share * other[i]);
                }
                names.push(format!(
                    "in rotation about {}",
                    self.centre(part, &rotation)
                ));
            }
        }
        let words = match &names[..] {
            [] => "in rotation".to_owned(),
            [only] => only.clone(),
            [others @ .., last] => format!("{} and {last}", others.join(", ")),
        };
        (words, first, turns)
    }

    /// The centre of a rotation (by 1) of a part, in words: a node that the part shares with another, or a position.
    fn centre(&self, part: &Part, rotation: &Motion) -> String {
        let centre = [
            part.centre[0] - rotation[1] * part.size,
            part.centre[1] + rotation[0] * part.size,
        ];
        let near = |node: &&u32| {
            let [x, y] = self.mesh.nodes[**node as usize];
            self.shared.contains_key(node)
                && (x - centre[0]).hypot(y - centre[1]) < 1e-6 * part.size
        };
        if let Some(node) = part.nodes.iter().find(near) {
            let [x, y] = self.mesh.nodes[*node as usize];
            return format!("node {node} at ({x}, {y}), where it is hinged to another part");
        }
        let [x, y] = centre.map(|c| rounded(c, part.size));
        format!("({x}, {y})")
    }
}

/// A translation in words.
fn along([x, y, _]: Motion) -> String {
    let length = x.hypot(y);
    let (x, y) = (x / length, y / length);
    match () {
        () if y.abs() < 1e-6 => "along x".to_owned(),
        () if x.abs() < 1e-6 => "along y".to_owned(),
        () => {
            let sign = x.signum();
            format!("along ({:.4}, {:.4})", sign * x, sign * y)
        }
    }
}

/// A coordinate rounded to six digits of the size of its part.
fn rounded(value: f64, size: f64) -> f64 {
    let digit = 10f64.powf((size.log10() - 5.0).floor());
    let rounded = (value / digit).round() * digit;
    // the shortest number that is this multiple
    format!("{rounded:.9e}").parse().unwrap_or(value) + 0.0
}
