//! Reads the definition of a sweep, with all its violations.

use std::borrow::Cow;

use serde_json::value::RawValue;
use solver::error::{Findings, Reason, Violation};
use solver::problem::Problem;
use strum::VariantArray;

use super::{
    path::Path,
    plan::{MOST_BYTES, MOST_MEMBERS, MOST_VALUE_BYTES, Mode, Plan},
    template::Template,
    values::{Fields, axes, points},
};
use crate::{
    json::parse,
    pointer::{Nowhere, Place, locate},
    schema::{meant, quoted},
};

/// A sweep as read.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// The base problem, from which members differ, with its mesh.
    pub base: Problem,
    /// The members of the sweep.
    pub plan: Plan,
}

/// A placeholder for the mesh that all members share: a file that is not read.
const NO_MESH: &str = r#"{"gmsh":""}"#;

/// Reads the definition of a sweep. Its members are not checked yet, see [`groups`](super::groups).
///
/// # Errors
///
/// All violations of the definition, with pointers relative to it.
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
    let with_mesh = paths.iter().any(|path| path.tokens[0] == "mesh");
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
            if list {
                "Submit several sweeps."
            } else {
                "Give fewer values, or submit several sweeps."
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
            if with_mesh { "Upload the mesh and name it as `stored`, or sweep its refinement in several sweeps." } else { "Shorten the base apart from its mesh, or give fewer values." },
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
            "the base problem, from which members differ",
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
            hint.unwrap_or_else(|| "Without `mode` the sweep is a grid.".to_owned()),
        ));
    }
    mode
}

/// The violation of a pointer that names no value of the problem.
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
    let hint = meant(token, names).unwrap_or_else(|| {
        if names.is_empty() {
            "Check the pointer (RFC 6901).".to_owned()
        } else {
            format!("It has: {}.", names.join(", "))
        }
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
