//! Reads the definition of a sweep, with all its violations.

use std::borrow::Cow;

use solver::error::{Findings, Reason, Violation};
use solver::problem::Problem;

use super::{
    path::Path,
    plan::{MOST_BYTES, MOST_MEMBERS, MOST_VALUE_BYTES, Mode, Plan},
    template::Template,
    values::{Variation, axes, points},
};
use crate::{
    body::Content,
    json::parse,
    pointer::{Nowhere, Place, locate},
    schema::{meant, quoted},
};

/// A sweep whose definition was read.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// The base problem, from which members differ, with its mesh.
    pub base: Problem,
    /// The members of the sweep.
    pub plan: Plan,
}

/// A placeholder, never read, for the mesh that all members share.
const NO_MESH: &str = r#"{"gmsh":""}"#;

/// Reads a sweep from the text of its base problem and from what its members differ in. The members are checked by
/// [`groups`](super::groups) and not here.
///
/// # Errors
///
/// All violations of the definition, with pointers relative to it.
pub fn read(text: &str, variation: Variation) -> Result<Sweep, Vec<Violation>> {
    let mut found = Findings::default();
    let base = base(text, &mut found);
    let mode = variation.mode.unwrap_or_default();
    let listed = match mode {
        Mode::List => points(&variation, &mut found),
        _ => axes(variation, &mut found),
    };
    let (Some(base), Some((paths, values))) = (base, listed) else {
        return Err(found.into_violations());
    };
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
        divided: vec![],
    };
    let (count, bytes) = (plan.count(), plan.bytes());
    let (at, list) = match mode {
        Mode::List => ("/points", true),
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

/// Reads a sweep from a request body whose only problem is the base problem.
///
/// # Errors
///
/// All violations of the body: of its structure, or if there are none, of its meaning.
pub fn of_body(mut content: Content<'_, Variation>) -> Result<Sweep, Vec<Violation>> {
    let sound = content.violations.is_empty();
    match (content.fields.take(), &content.problems[..]) {
        (Some(variation), [(_, base)]) if sound => read(base, variation),
        _ => {
            content.parse_problems();
            Err(content.into_violations())
        }
    }
}

fn base(text: &str, found: &mut Findings) -> Option<Problem> {
    let inside = |v: Violation| Violation {
        pointer: format!("/base{}", v.pointer),
        ..v
    };
    parse(text)
        .map_err(|list| found.extend(list.into_iter().map(inside)))
        .ok()
}

/// The violation that a pointer names no value of the base problem.
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
            format!("Names there: {}.", names.join(", "))
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
