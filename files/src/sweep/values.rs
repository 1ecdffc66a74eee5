//! The values of all members of a sweep: by axes, or by points.

use std::{borrow::Cow, collections::BTreeSet};

use serde::Deserialize;
use serde_json::value::RawValue;
use solver::error::{Findings, Reason, Violation, escape, shortened};

use super::{
    path::{Path, are_apart, path},
    plan::{MOST_MEMBERS, MOST_PATHS, Mode, Values},
};
use crate::{
    pointer::{List, Named, list, members},
    schema::{meant, quoted},
};

/// The given fields of a definition, as text.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fields<'a> {
    /// The base problem.
    pub base: Option<&'a RawValue>,
    /// The axes: a list of objects with a `path` and its values.
    pub axes: Option<&'a RawValue>,
    /// How the axes are combined.
    pub mode: Option<&'a RawValue>,
    /// The points, for the mode `list`: a list of objects from pointer to value.
    pub points: Option<&'a RawValue>,
}

/// Reports a field that a mode does not use.
fn not_used(name: &str, raw: Option<&RawValue>, mode: &str, hint: &str, found: &mut Findings) {
    if raw.is_some_and(|raw| raw.get() != "null") {
        found.add(Violation::new(
            format!("/{name}"),
            Reason::NotUsed,
            format!("`{name}`"),
            format!("no `{name}` with the mode {mode}"),
            hint,
        ));
    }
}

fn wrong_type(at: impl Into<String>, raw: &RawValue, expected: &str) -> Violation {
    Violation::new(
        at,
        Reason::WrongType,
        quoted(raw.get()),
        expected,
        "Write the value in that form.",
    )
}

/// The largest number of members of an axis or a point that are read: more than they may have.
const MOST_NAMES: usize = 64;

const AXES_HINT: &str = "Change several values together by the mode zip or list.";
const VALUES_HINT: &str = "An axis has at least one value, and a sweep at most that many members.";

/// The items of a list that must have 1 … `most` of `what`.
fn counted<'a>(
    at: &str,
    raw: &'a RawValue,
    most: usize,
    what: &str,
    hint: &str,
    found: &mut Findings,
) -> Option<Vec<&'a RawValue>> {
    let Some(List { items, count }) = list(raw.get(), most) else {
        found.add(wrong_type(at, raw, &format!("a list of {what}")));
        return None;
    };
    let (reason, hint) = match count {
        0 => (Reason::TooFew, "Give at least one."),
        _ if count > most => (Reason::TooMany, hint),
        _ => return Some(items),
    };
    found.add(Violation::new(
        at,
        reason,
        format!("{count} {what}"),
        format!("1 … {most} {what}"),
        hint,
    ));
    None
}

/// The axes of a grid or zip.
pub(super) fn axes(
    fields: &Fields<'_>,
    mode: Mode,
    found: &mut Findings,
) -> Option<(Vec<Path>, Values)> {
    let hint = "Set `mode` to \"list\" for points, or leave them out.";
    not_used("points", fields.points, mode.into(), hint, found);
    let some = format!("1 … {MOST_PATHS} axes");
    let Some(raw) = fields.axes else {
        // points without their mode: that is told already
        if fields.points.is_some() {
            return None;
        }
        let hint =
            "Send {\"axes\": [{\"path\": \"/contacts/0/indentation\", \"values\": [0.1, 0.2]}]}.";
        found.add(Violation::new(
            "/axes",
            Reason::Missing,
            "nothing",
            some,
            hint,
        ));
        return None;
    };
    let items = counted("/axes", raw, MOST_PATHS, "axes", AXES_HINT, found)?;
    let count = items.len();
    let (mut paths, mut values) = (vec![], vec![]);
    for (k, raw) in items.into_iter().enumerate() {
        let at = format!("/axes/{k}");
        let Some(members) = members(raw.get(), MOST_NAMES) else {
            found.add(wrong_type(at, raw, "an object with a path and its values"));
            continue;
        };
        let (path, list) = axis(&at, members, found);
        paths.extend(path);
        values.extend(list);
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

/// One axis: its path, and its values as JSON.
fn axis(at: &str, members: Named<'_>, found: &mut Findings) -> (Option<Path>, Option<Vec<String>>) {
    const KNOWN: [&str; 4] = ["path", "values", "linspace", "logspace"];
    let mut seen = BTreeSet::new();
    for (name, _) in &members {
        if !KNOWN.contains(&&**name) {
            let hint = meant(name, KNOWN);
            found.add(Violation::new(
                format!("{at}/{}", escape(&shortened(name, 80))),
                Reason::UnknownName,
                format!("{:?}", quoted(name)),
                "one of path, values, linspace, logspace",
                hint.unwrap_or_else(|| "Check the spelling, or leave it out.".to_owned()),
            ));
        } else if !seen.insert(name.clone()) {
            found.add(Violation::new(
                format!("{at}/{name}"),
                Reason::DuplicateName,
                "the name twice",
                "each name once",
                "Remove one of them; one would be ignored.",
            ));
        }
    }
    let member = |wanted: &str| {
        let named = members.iter().find(|(name, _)| name == wanted);
        named.map(|(_, raw)| *raw)
    };
    let place = format!("{at}/path");
    let path = match member("path") {
        Some(raw) => match serde_json::from_str::<Cow<'_, str>>(raw.get()) {
            Ok(text) => path(place, &text, found),
            Err(_) => {
                found.add(wrong_type(place, raw, "a JSON Pointer as a string"));
                None
            }
        },
        None => {
            let hint = "Say what the axis changes, such as /contacts/0/friction/coefficient.";
            let expected = "a JSON Pointer into the problem";
            found.add(Violation::new(
                place,
                Reason::Missing,
                "nothing",
                expected,
                hint,
            ));
            None
        }
    };
    let given: Vec<(&str, &RawValue)> = KNOWN[1..]
        .iter()
        .filter_map(|name| Some((*name, member(name)?)))
        .collect();
    let values = match given[..] {
        [("values", raw)] => values(&format!("{at}/values"), raw, found),
        [(name, raw)] => spaced(&format!("{at}/{name}"), name == "logspace", raw, found),
        _ => {
            let named: Vec<&str> = given.iter().map(|(name, _)| *name).collect();
            let got = if named.is_empty() {
                "none of them".to_owned()
            } else {
                named.join(" and ")
            };
            found.add(Violation::new(
                at,
                Reason::WrongCount,
                got,
                "exactly one of values, linspace, logspace",
                "Give the values in one form.",
            ));
            None
        }
    };
    (path, values)
}

/// Reads a list of any values.
fn values(at: &str, raw: &RawValue, found: &mut Findings) -> Option<Vec<String>> {
    let items = counted(at, raw, MOST_MEMBERS, "values", VALUES_HINT, found)?;
    let mut sound = true;
    let mut texts = Vec::with_capacity(items.len());
    for (k, raw) in items.into_iter().enumerate() {
        sound &= is_finite(&format!("{at}/{k}"), raw, found);
        texts.push(raw.get().to_owned());
    }
    sound.then_some(texts)
}

/// Checks that a value is not too large a number. Numbers inside lists and objects are checked when the problem is
/// read.
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

/// Numbers at equal distances or ratios, including both ends.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Spaced {
    start: f64,
    stop: f64,
    count: u64,
}

fn spaced(at: &str, ratios: bool, raw: &RawValue, found: &mut Findings) -> Option<Vec<String>> {
    // serde would also take a list
    let object = raw.get().starts_with('{');
    let read = serde_json::from_str::<Spaced>(raw.get());
    let Some(Spaced { start, stop, count }) = read.ok().filter(|_| object) else {
        let expected = "an object of start, stop (finite numbers) and count (a whole number), and nothing else";
        found.add(wrong_type(at, raw, expected));
        return None;
    };
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

/// A finite number as JSON: a whole one without a fraction, so that it may be a count.
fn number(value: f64) -> String {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    if value.fract() == 0.0 && value.abs() < EXACT {
        format!("{}", value as i64)
    } else {
        format!("{value:?}")
    }
}

/// The points of a list: each an object from pointer to value.
pub(super) fn points(fields: &Fields<'_>, found: &mut Findings) -> Option<(Vec<Path>, Values)> {
    let hint = "Choose the mode grid or zip for axes, or leave them out.";
    not_used("axes", fields.axes, "list", hint, found);
    let some = format!("1 … {MOST_MEMBERS} points");
    let Some(raw) = fields.points else {
        let hint = "Send {\"points\": [{\"/contacts/0/indentation\": 0.1}, …]}.";
        found.add(Violation::new(
            "/points",
            Reason::Missing,
            "nothing",
            some,
            hint,
        ));
        return None;
    };
    let hint = "Submit several sweeps.";
    let items = counted("/points", raw, MOST_MEMBERS, "points", hint, found)?;
    let mut paths: Vec<Path> = vec![];
    let mut listed: Vec<Vec<Option<String>>> = vec![];
    let mut sound = true;
    for (n, raw) in items.into_iter().enumerate() {
        if found.is_full() {
            return None;
        }
        let at = format!("/points/{n}");
        let Some(members) = members(raw.get(), MOST_NAMES) else {
            found.add(wrong_type(at, raw, "an object from JSON Pointer to value"));
            sound = false;
            continue;
        };
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
            if point[place].replace(raw.get().to_owned()).is_some() {
                found.add(Violation::new(
                    at,
                    Reason::DuplicateName,
                    "the name twice",
                    "each name once",
                    "Remove one of them; one would be ignored.",
                ));
                sound = false;
            }
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
