//! Reading the definition of a sweep, with all its violations.

use std::{borrow::Cow, collections::BTreeSet, fmt};

use serde::{
    Deserialize, Deserializer,
    de::{IgnoredAny, MapAccess, SeqAccess, Visitor},
};
use serde_json::value::RawValue;
use solver::error::{Findings, Reason, Violation, escape, shortened};
use solver::problem::Problem;
use strum::VariantArray;

use super::{
    plan::{MOST_BYTES, MOST_MEMBERS, MOST_PATHS, MOST_VALUE_BYTES, Mode, Plan, Values},
    template::{Nowhere, Place, Template, locate},
};
use crate::json::parse;
use crate::schema::{meant, quoted};

/// The fields of a definition as text, as far as they are given.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fields<'a> {
    /// The problem.
    pub base: Option<&'a RawValue>,
    /// A list of objects with a `path` and its values.
    pub axes: Option<&'a RawValue>,
    /// How they are combined.
    pub mode: Option<&'a RawValue>,
    /// For the mode `list`: a list of objects from pointer to value.
    pub points: Option<&'a RawValue>,
}

/// A sweep that was read.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// The problem that members differ from, with its mesh.
    pub base: Problem,
    /// Its members.
    pub plan: Plan,
}

/// In place of a mesh that all members share: a file that is not read.
const NO_MESH: &str = r#"{"gmsh":""}"#;

/// Reads a definition; pointers are relative to it. Its members are not checked yet, see [`groups`](super::groups).
pub fn read(fields: &Fields<'_>) -> Result<Sweep, Vec<Violation>> {
    let mut found = Findings::default();
    let base = base(fields.base, &mut found);
    let mode = mode(fields.mode, &mut found);
    let listed = match mode {
        Some(Mode::List) => points(fields, &mut found),
        Some(mode) => axes(fields, mode, &mut found),
        None => None,
    };
    let (Some(base), Some((paths, values))) = (base, listed) else {
        return Err(found.into_violations());
    };
    let text = fields.base.map_or("", RawValue::get);
    let tokens: Vec<Vec<String>> = paths.iter().map(|path| path.tokens.clone()).collect();
    let with_mesh = tokens.iter().any(|tokens| tokens[0] == "mesh");
    let text = match locate(text, &["mesh".to_owned()]) {
        Ok(Place::Value(range)) if !with_mesh => Cow::Owned(format!(
            "{}{NO_MESH}{}",
            &text[..range.start],
            &text[range.end..]
        )),
        _ => Cow::Borrowed(text),
    };
    let mut places = vec![];
    for path in &paths {
        match locate(&text, &path.tokens) {
            Ok(place) => places.push(place),
            Err(nowhere) => found.add(leads_nowhere(path, &nowhere)),
        }
    }
    if places.len() < paths.len() {
        return Err(found.into_violations());
    }
    let plan = Plan {
        template: Template::new(&text, places),
        with_mesh,
        paths: paths.into_iter().map(|path| path.text).collect(),
        values,
    };
    let (count, bytes) = (plan.count(), plan.bytes());
    let (at, list) = match mode {
        Some(Mode::List) => ("/points", true),
        _ => ("/axes", false),
    };
    if count > MOST_MEMBERS {
        let got = match count {
            usize::MAX => "more than can be counted".to_owned(),
            count => format!("{count} members"),
        };
        found.add(Violation::new(
            at,
            Reason::TooMany,
            got,
            format!("at most {MOST_MEMBERS} members"),
            match list {
                true => "Submit several sweeps.",
                false => "Give fewer values, or submit several sweeps.",
            },
        ));
    } else if plan.value_bytes() > MOST_VALUE_BYTES {
        found.add(Violation::new(
            at,
            Reason::TooLarge,
            format!(
                "values of {} bytes, each counted for every member that has it",
                plan.value_bytes()
            ),
            format!("at most {MOST_VALUE_BYTES} bytes as JSON, for all members together"),
            "Give shorter values, or submit several sweeps.",
        ));
    } else if bytes > MOST_BYTES {
        found.add(Violation::new(
            at,
            Reason::TooLarge,
            format!("{count} members of {} bytes together", bytes),
            format!("at most {MOST_BYTES} bytes as JSON"),
            match with_mesh {
                true => "Upload the mesh and name it as `stored`, or sweep its refinement in several sweeps.",
                false => "Shorten what the base has beside its mesh, or give fewer values.",
            },
        ));
    }
    found.into_result(Sweep { base, plan })
}

fn base(raw: Option<&RawValue>, found: &mut Findings) -> Option<Problem> {
    let Some(raw) = raw else {
        found.add(Violation::new(
            "/base",
            Reason::Missing,
            "nothing",
            "the problem that members differ from",
            "Send {\"base\": {…}, \"axes\": […]}.",
        ));
        return None;
    };
    let read = parse(raw.get());
    let inside = |v: Violation| Violation {
        pointer: format!("/base{}", v.pointer),
        ..v
    };
    read.map_err(|list| found.extend(list.into_iter().map(inside)))
        .ok()
}

fn mode(raw: Option<&RawValue>, found: &mut Findings) -> Option<Mode> {
    let Some(raw) = raw.filter(|raw| raw.get() != "null") else {
        return Some(Mode::default());
    };
    let word: Option<Cow<'_, str>> = serde_json::from_str(raw.get()).ok();
    let named = |mode: &&Mode| word.as_deref() == Some(<&str>::from(**mode));
    let mode = Mode::VARIANTS.iter().find(named).copied();
    if mode.is_none() {
        let names = Mode::VARIANTS.iter().map(|mode| <&str>::from(*mode));
        let hint = meant(word.as_deref().unwrap_or_default(), names);
        found.add(Violation::new(
            "/mode",
            Reason::UnknownAlternative,
            quoted(raw.get()),
            "\"grid\", \"zip\" or \"list\"",
            hint.unwrap_or_else(|| "Leave it out for grid.".to_owned()),
        ));
    }
    mode
}

/// A pointer into the problem, and where it stands in the definition.
struct Path {
    at: String,
    text: String,
    tokens: Vec<String>,
}

fn leads_nowhere(path: &Path, nowhere: &Nowhere) -> Violation {
    let Nowhere {
        parent,
        token,
        found,
        names,
    } = nowhere;
    let parent = match parent.as_str() {
        "" => "the problem",
        parent => parent,
    };
    let hint = meant(token, names).unwrap_or_else(|| match names.is_empty() {
        true => "Check the pointer (RFC 6901).".to_owned(),
        false => format!("It has: {}.", names.join(", ")),
    });
    Violation::new(
        path.at.clone(),
        Reason::UnknownName,
        quoted(&path.text),
        format!(
            "a pointer to a value of the base; {parent} is {found} without {:?}",
            quoted(token)
        ),
        hint,
    )
}

/// A pointer to a part of a problem; `at` is its place in the definition.
fn path(at: String, text: &str, found: &mut Findings) -> Option<Path> {
    let tokens = || -> Option<Vec<String>> {
        let tokens = text.strip_prefix('/')?.split('/');
        let read = |token: &str| {
            let escaped = token.split('~').skip(1);
            let sound = escaped.into_iter().all(|rest| rest.starts_with(['0', '1']));
            sound.then(|| token.replace("~1", "/").replace("~0", "~"))
        };
        tokens.map(read).collect()
    };
    match tokens() {
        Some(tokens) => Some(Path {
            at,
            text: text.to_owned(),
            tokens,
        }),
        None => {
            found.add(Violation::new(
                at,
                Reason::Malformed,
                format!("{:?}", quoted(text)),
                "a JSON Pointer (RFC 6901) to a part of the problem, such as /contacts/0/indentation",
                "It begins with / and has ~1 for / and ~0 for ~ in names.",
            ));
            None
        }
    }
}

/// Whether no path is another one, or inside it.
fn are_apart(paths: &[Path], found: &mut Findings) -> bool {
    let mut apart = true;
    for (k, path) in paths.iter().enumerate() {
        for other in &paths[..k] {
            let (longer, shorter) = match path.tokens.len() >= other.tokens.len() {
                true => (path, other),
                false => (other, path),
            };
            if !longer.tokens.starts_with(&shorter.tokens) {
                continue;
            }
            apart = false;
            let (reason, expected) = match longer.tokens.len() == shorter.tokens.len() {
                true => (Reason::DuplicateName, "each pointer once"),
                false => (Reason::Conflict, "pointers of which none is inside another"),
            };
            found.add(Violation::new(
                path.at.clone(),
                reason,
                format!("{} beside {}", quoted(&path.text), quoted(&other.text)),
                expected,
                "Leave one of them out: one value would replace the other.",
            ));
        }
    }
    apart
}

/// A field that a mode does not use.
fn not_used(name: &str, raw: Option<&RawValue>, mode: &str, found: &mut Findings) {
    if raw.is_some_and(|raw| raw.get() != "null") {
        found.add(Violation::new(
            format!("/{name}"),
            Reason::NotUsed,
            format!("`{name}`"),
            format!("no `{name}` with the mode {mode}"),
            "Leave it out, or choose another mode.",
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

/// The axes of a grid or zip.
fn axes(fields: &Fields<'_>, mode: Mode, found: &mut Findings) -> Option<(Vec<Path>, Values)> {
    not_used("points", fields.points, <&str>::from(mode), found);
    let some = format!("1 … {MOST_PATHS} axes");
    let Some(raw) = fields.axes else {
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
    let Some(List { items, count }) = list(raw, MOST_PATHS) else {
        found.add(wrong_type("/axes", raw, "a list of axes"));
        return None;
    };
    if count == 0 || count > MOST_PATHS {
        let reason = if count == 0 {
            Reason::TooFew
        } else {
            Reason::TooMany
        };
        let hint = "Change several values together by the mode zip or list.";
        found.add(Violation::new(
            "/axes",
            reason,
            format!("{count} axes"),
            some,
            hint,
        ));
        return None;
    }
    let (mut paths, mut values) = (vec![], vec![]);
    for (k, raw) in items.into_iter().enumerate() {
        let at = format!("/axes/{k}");
        let Some(members) = members(raw) else {
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

type Named<'a> = Vec<(Cow<'a, str>, &'a RawValue)>;

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
                "Leave one of them out; one would be ignored.",
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
            let got = match named.is_empty() {
                true => "none of them".to_owned(),
                false => named.join(" and "),
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

/// A list of any values.
fn values(at: &str, raw: &RawValue, found: &mut Findings) -> Option<Vec<String>> {
    let Some(List { items, count }) = list(raw, MOST_MEMBERS) else {
        found.add(wrong_type(at, raw, "a list of values"));
        return None;
    };
    if count == 0 || count > MOST_MEMBERS {
        let reason = if count == 0 {
            Reason::TooFew
        } else {
            Reason::TooMany
        };
        let expected = format!("1 … {MOST_MEMBERS} values");
        let hint = "An axis has at least one value, and a sweep at most that many members.";
        found.add(Violation::new(
            at,
            reason,
            format!("{count} values"),
            expected,
            hint,
        ));
        return None;
    }
    let mut sound = true;
    let mut texts = Vec::with_capacity(count);
    for (k, raw) in items.into_iter().enumerate() {
        sound &= is_finite(&format!("{at}/{k}"), raw, found);
        texts.push(raw.get().to_owned());
    }
    sound.then_some(texts)
}

/// Whether a value is not a number that is too large. Inside of lists and objects the problem's reader tells it.
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

/// Numbers at equal distances or ratios, both ends among them.
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
            _ if ratios => ((1.0 - part) * start.ln() + part * stop.ln()).exp(),
            _ => (1.0 - part) * start + part * stop,
        }
    };
    sound.then(|| (0..count).map(|k| number(value(k))).collect())
}

/// A finite number as JSON: a whole one without a fraction, so that it may be a count.
fn number(value: f64) -> String {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    match value.fract() == 0.0 && value.abs() < EXACT {
        true => format!("{}", value as i64),
        false => format!("{value:?}"),
    }
}

/// The points of a list: each an object from pointer to value.
fn points(fields: &Fields<'_>, found: &mut Findings) -> Option<(Vec<Path>, Values)> {
    not_used("axes", fields.axes, "list", found);
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
    let Some(List { items, count }) = list(raw, MOST_MEMBERS) else {
        found.add(wrong_type("/points", raw, "a list of points"));
        return None;
    };
    if count == 0 || count > MOST_MEMBERS {
        let reason = if count == 0 {
            Reason::TooFew
        } else {
            Reason::TooMany
        };
        let hint = "Submit several sweeps.";
        found.add(Violation::new(
            "/points",
            reason,
            format!("{count} points"),
            some,
            hint,
        ));
        return None;
    }
    let mut paths: Vec<Path> = vec![];
    let mut listed: Vec<Vec<Option<String>>> = vec![];
    let mut sound = true;
    for (n, raw) in items.into_iter().enumerate() {
        if found.is_full() {
            return None;
        }
        let at = format!("/points/{n}");
        let Some(members) = members(raw) else {
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
                    "Leave one of them out; one would be ignored.",
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

/// The first items of a list, and how many it has.
struct List<'a> {
    items: Vec<&'a RawValue>,
    count: usize,
}

/// The first items of a list; none if it is something else.
fn list(raw: &RawValue, most: usize) -> Option<List<'_>> {
    let mut reader = serde_json::Deserializer::from_str(raw.get());
    struct Read(usize);
    impl<'de> Visitor<'de> for Read {
        type Value = List<'de>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a list")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<List<'de>, A::Error> {
            let mut items = vec![];
            while items.len() < self.0
                && let Some(item) = list.next_element()?
            {
                items.push(item);
            }
            let mut count = items.len();
            if count == self.0 {
                while list.next_element::<IgnoredAny>()?.is_some() {
                    count += 1;
                }
            }
            Ok(List { items, count })
        }
    }
    reader.deserialize_seq(Read(most)).ok()
}

/// Most members of an axis or a point that are looked at: more than they may have.
const MOST_NAMES: usize = 64;

/// The first members of an object; none if it is something else.
fn members(raw: &RawValue) -> Option<Named<'_>> {
    #[derive(Deserialize)]
    struct Name<'a>(#[serde(borrow)] Cow<'a, str>);
    struct Read;
    impl<'de> Visitor<'de> for Read {
        type Value = Named<'de>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("an object")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Named<'de>, A::Error> {
            let mut members = vec![];
            while let Some(Name(name)) = map.next_key()? {
                if members.len() < MOST_NAMES {
                    members.push((name, map.next_value()?));
                } else {
                    map.next_value::<IgnoredAny>()?;
                }
            }
            Ok(members)
        }
    }
    let mut reader = serde_json::Deserializer::from_str(raw.get());
    reader.deserialize_map(Read).ok()
}
