//! The values of all members of a sweep: by axes, or by points.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Value, value::RawValue};
use solver::error::{Findings, Reason, Violation, either, escape, shortened};

use super::{
    path::{Path, are_apart, path},
    plan::{MOST_MEMBERS, MOST_PATHS, Mode, Values},
};
use crate::{pointer::members, schema::quoted};

/// The definition of what the members of a sweep differ in.
#[derive(Clone, Debug, Default)]
pub struct Variation {
    /// How the values of several axes are combined; absent: grid.
    pub mode: Option<Mode>,
    /// The axes, with the modes grid and zip.
    pub axes: Option<Vec<Axis>>,
    /// The points, with the mode list: objects from JSON Pointer to value.
    pub points: Option<Vec<Box<RawValue>>>,
}

/// A place of the problem at which members differ, and the values there, in one of the forms `values`, `linspace` and
/// `logspace`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct Axis {
    /// JSON Pointer (RFC 6901) into the problem, such as /contacts/0/friction/coefficient. The object that contains the
    /// value must exist in the base.
    pub path: String,
    /// A list of values that the schema of a problem allows there: numbers, or whole obstacles or lists of steps.
    #[serde(default)]
    #[schemars(with = "Option<Vec<Value>>", length(min = 1, max = MOST_MEMBERS))]
    pub values: Option<Vec<Box<RawValue>>>,
    /// Numbers at equal distances.
    #[serde(default)]
    pub linspace: Option<Spaced>,
    /// Numbers at equal ratios, both ends above 0.
    #[serde(default)]
    pub logspace: Option<Spaced>,
}

/// Numbers from `start` to `stop`, including both.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct Spaced {
    /// The first number.
    pub start: f64,
    /// The last number.
    pub stop: f64,
    /// The number of numbers, including the first and the last.
    #[schemars(range(min = 1, max = MOST_MEMBERS))]
    pub count: u64,
}

/// The type of the points of a sweep in schemas: objects from JSON Pointer to value.
pub type Points = Vec<BTreeMap<String, Value>>;

/// Reports the field `name` if it is given, since the mode of the sweep does not use it.
fn not_used(name: &str, given: bool, mode: Mode, hint: &str, found: &mut Findings) {
    if given {
        let mode: &str = mode.into();
        found.add(Violation::new(
            format!("/{name}"),
            Reason::NotUsed,
            format!("`{name}`"),
            format!("no `{name}` with the mode {mode}"),
            hint,
        ));
    }
}

/// The largest number of members of a point that are read, more than a point may have.
const MOST_NAMES: usize = 64;

const AXES_HINT: &str = "Change several values together by the mode zip or list.";
const VALUES_HINT: &str = "An axis has at least one value, and a sweep at most that many members.";

/// Whether a list has 1 … `most` of `what`; reports it if not.
fn are_few(
    at: &str,
    count: usize,
    most: usize,
    what: &str,
    hint: &str,
    found: &mut Findings,
) -> bool {
    let (reason, hint) = match count {
        0 => (Reason::TooFew, "Give at least one."),
        _ if count > most => (Reason::TooMany, hint),
        _ => return true,
    };
    found.add(Violation::new(
        at,
        reason,
        format!("{count} {what}"),
        format!("1 … {most} {what}"),
        hint,
    ));
    false
}

/// The paths and values of the axes of a grid or zip.
pub(super) fn axes(given: Variation, found: &mut Findings) -> Option<(Vec<Path>, Values)> {
    let mode = given.mode.unwrap_or_default();
    let hint = "Set `mode` to \"list\" for points, or leave them out.";
    not_used("points", given.points.is_some(), mode, hint, found);
    let Some(axes) = given.axes else {
        // points without their mode: that is told already
        if given.points.is_none() {
            found.add(Violation::new(
                "/axes",
                Reason::Missing,
                "nothing",
                format!("1 … {MOST_PATHS} axes"),
                "Send {\"axes\": [{\"path\": \"/contacts/0/indentation\", \"values\": [0.1, 0.2]}]}.",
            ));
        }
        return None;
    };
    let count = axes.len();
    if !are_few("/axes", count, MOST_PATHS, "axes", AXES_HINT, found) {
        return None;
    }
    let (mut paths, mut values) = (vec![], vec![]);
    for (k, given) in axes.into_iter().enumerate() {
        let at = format!("/axes/{k}");
        paths.extend(path(format!("{at}/path"), &given.path, found));
        values.extend(axis(&at, given, found));
    }
    if !are_apart(&paths, found) || paths.len() < count || values.len() < count {
        return None;
    }
    if mode == Mode::Zip {
        let first = values[0].len();
        let mut equal = true;
        for (k, list) in values
            .iter()
            .enumerate()
            .filter(|(_, list)| list.len() != first)
        {
            equal = false;
            found.add(Violation::new(
                format!("/axes/{k}"),
                Reason::WrongLength,
                format!("{} values", list.len()),
                format!("{first} values, as the first axis has"),
                "With the mode zip the k-th values of all axes belong together.",
            ));
        }
        return equal.then_some((paths, Values::Zip(values)));
    }
    Some((paths, Values::Grid(values)))
}

/// The values of an axis as JSON.
fn axis(at: &str, axis: Axis, found: &mut Findings) -> Option<Vec<String>> {
    match axis {
        Axis {
            values: Some(given),
            linspace: None,
            logspace: None,
            ..
        } => values(&format!("{at}/values"), &given, found),
        Axis {
            values: None,
            linspace: Some(given),
            logspace: None,
            ..
        } => spaced(&format!("{at}/linspace"), false, given, found),
        Axis {
            values: None,
            linspace: None,
            logspace: Some(given),
            ..
        } => spaced(&format!("{at}/logspace"), true, given, found),
        Axis {
            values,
            linspace,
            logspace,
            ..
        } => {
            let forms = [
                ("values", values.is_some()),
                ("linspace", linspace.is_some()),
                ("logspace", logspace.is_some()),
            ];
            found.add(Violation::new(
                at,
                Reason::WrongCount,
                either(&forms),
                "exactly one of `values`, `linspace`, `logspace`",
                "Give the values in one form.",
            ));
            None
        }
    }
}

/// The values of an axis that are given as a list.
fn values(at: &str, given: &[Box<RawValue>], found: &mut Findings) -> Option<Vec<String>> {
    if !are_few(at, given.len(), MOST_MEMBERS, "values", VALUES_HINT, found) {
        return None;
    }
    let mut sound = true;
    for (k, raw) in given.iter().enumerate() {
        sound &= is_finite(&format!("{at}/{k}"), raw, found);
    }
    sound.then(|| given.iter().map(|raw| raw.get().to_owned()).collect())
}

/// Checks that a value is not a number too large for double precision. Numbers inside lists and objects are checked
/// when the problem is read.
fn is_finite(at: &str, raw: &RawValue, found: &mut Findings) -> bool {
    let number = raw
        .get()
        .starts_with(|c: char| c == '-' || c.is_ascii_digit());
    let finite = !number || serde_json::from_str::<f64>(raw.get()).is_ok();
    if !finite {
        found.add(Violation::new(
            at,
            Reason::NotFinite,
            quoted(raw.get()),
            "a finite number",
            "Numbers have double precision, up to 1.8e308.",
        ));
    }
    finite
}

fn spaced(at: &str, ratios: bool, given: Spaced, found: &mut Findings) -> Option<Vec<String>> {
    let Spaced { start, stop, count } = given;
    let mut sound = true;
    if count == 0 || count > MOST_MEMBERS as u64 {
        sound = false;
        found.add(Violation::new(
            format!("{at}/count"),
            Reason::OutOfRange,
            count,
            format!("1 … {MOST_MEMBERS}"),
            "Both ends are among the values; with a count of 1 only the start is.",
        ));
    }
    for (name, end) in [("start", start), ("stop", stop)] {
        if ratios && end <= 0.0 {
            sound = false;
            found.add(Violation::new(
                format!("{at}/{name}"),
                Reason::OutOfRange,
                end,
                "a number above 0",
                "The values have equal ratios; `linspace` has equal distances.",
            ));
        }
    }
    let last = count.saturating_sub(1).max(1) as f64;
    let value = |k: u64| {
        let part = k as f64 / last;
        match k {
            0 => start,
            _ if k + 1 == count => stop,
            // each end with its own weight: the difference of both may be infinite
            _ if ratios => rounded(((1.0 - part) * start.ln() + part * stop.ln()).exp()),
            _ => rounded((1.0 - part) * start + part * stop),
        }
    };
    sound.then(|| (0..count).map(|k| number(value(k))).collect())
}

/// A number rounded to 15 digits, so that 0.9 is not 0.8999999999999999.
fn rounded(value: f64) -> f64 {
    format!("{value:.14e}").parse().unwrap_or(value)
}

/// A finite number as JSON. A whole number has no fraction, so that it may be a count.
fn number(value: f64) -> String {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    if value.fract() == 0.0 && value.abs() < EXACT {
        format!("{}", value as i64)
    } else {
        format!("{value:?}")
    }
}

/// The paths and values of the points of a list, each an object from pointer to value.
pub(super) fn points(given: &Variation, found: &mut Findings) -> Option<(Vec<Path>, Values)> {
    let hint = "Choose the mode grid or zip for axes, or leave them out.";
    not_used("axes", given.axes.is_some(), Mode::List, hint, found);
    let Some(items) = &given.points else {
        found.add(Violation::new(
            "/points",
            Reason::Missing,
            "nothing",
            format!("1 … {MOST_MEMBERS} points"),
            "Send {\"points\": [{\"/contacts/0/indentation\": 0.1}, …]}.",
        ));
        return None;
    };
    let hint = "Submit several sweeps.";
    if !are_few("/points", items.len(), MOST_MEMBERS, "points", hint, found) {
        return None;
    }
    let mut paths: Vec<Path> = vec![];
    let mut listed: Vec<Vec<Option<String>>> = vec![];
    let mut sound = true;
    for (n, raw) in items.iter().enumerate() {
        if found.is_full() {
            return None;
        }
        let at = format!("/points/{n}");
        let members = members(raw.get(), MOST_NAMES).unwrap_or_default();
        let mut point: Vec<Option<String>> = vec![None; paths.len()];
        for (name, raw) in members {
            let at = format!("{at}/{}", escape(&shortened(&name, 80)));
            sound &= is_finite(&at, raw, found);
            let known = paths.iter().position(|path| path.text == name);
            let place = match known {
                Some(place) => place,
                None if paths.len() == MOST_PATHS => {
                    found.add(Violation::new(
                        at,
                        Reason::TooMany,
                        format!("{:?}", quoted(&name)),
                        format!("at most {MOST_PATHS} pointers in all points together"),
                        "Sweep a whole object instead of each of its values.",
                    ));
                    return None;
                }
                None => match path(at.clone(), &name, found) {
                    Some(path) => {
                        paths.push(path);
                        point.push(None);
                        paths.len() - 1
                    }
                    None => {
                        sound = false;
                        continue;
                    }
                },
            };
            point[place] = Some(raw.get().to_owned());
        }
        listed.push(point);
    }
    sound &= are_apart(&paths, found);
    if paths.is_empty() && sound {
        let hint = "Name what the points change, such as {\"/contacts/0/indentation\": 0.1}.";
        let expected = "at least one pointer in the points";
        found.add(Violation::new(
            "/points",
            Reason::TooFew,
            "none",
            expected,
            hint,
        ));
        return None;
    }
    let most = paths.len();
    listed.iter_mut().for_each(|point| point.resize(most, None));
    sound.then_some((paths, Values::List(listed)))
}
