//! The faults of the structure of problems and of request bodies, found with our JSON Schema and described in words.
//!
//! The keywords of draft 2020-12 that the schema of our types has are supported. The check is written here rather than
//! left to a library: the existing libraries bring regular expressions, URIs and references over the network (a tenth
//! of the build), need a tree of the whole text, and answer in terms of the schema ("not valid under any of the
//! schemas") instead of naming the intended alternative and its faults.

mod alternatives;
mod numbers;
mod shape;
mod walk;
mod words;

use solver::error::{Findings, Violation};

use schemars::JsonSchema;

pub(crate) use shape::Shape;
pub use shape::schema;
pub use words::{meant, quoted};

/// The shape of a request body of type `T`.
pub(crate) fn of_body<T: JsonSchema>() -> Shape {
    // the schema is ours; a test reads it. A shape that allows anything leaves the decision to serde.
    shape::of_body::<T>().unwrap_or_default()
}

/// What the check of a text has found.
pub(crate) struct Checked<'a> {
    /// The violations, at most a hundred.
    pub(crate) violations: Vec<Violation>,
    /// The problems in a request body, which are not checked yet: of each the JSON Pointer to it, and its text.
    pub(crate) problems: Vec<(String, &'a str)>,
}

/// The violations of a problem's text, at most a hundred. The error is that of a text that is not JSON; its line and
/// column may be relative to a part of the text.
pub(crate) fn violations(text: &str) -> serde_json::Result<Vec<Violation>> {
    check(&shape::PROBLEM, text).map(|checked| checked.violations)
}

/// Checks a text against a shape. The error is that of [`violations`].
pub(crate) fn check<'a>(shape: &'static Shape, text: &'a str) -> serde_json::Result<Checked<'a>> {
    let mut found = Findings::default();
    let mut walk = walk::Walk::new(Some(&mut found));
    let read = walk.check(shape, text);
    let (stopped, problems) = (walk.stopped, walk.problems);
    if !stopped {
        read?;
    }
    let mut found = found.into_violations();
    if let Some(last) = found.last_mut().filter(|_| stopped) {
        last.hint
            .push_str(" (There are more violations: the check ends after 100.)");
    }
    Ok(Checked {
        violations: found,
        problems,
    })
}

/// Whether one of the definitions of the schema accepts a value.
#[cfg(test)]
pub(crate) fn accepts(definition: &str, value: &serde_json::Value) -> bool {
    let schema = shape::of_problem();
    let named = &schema["$defs"][definition];
    let shape = Box::leak(Box::new(shape::shape(named, &schema).unwrap()));
    let mut found = Findings::default();
    let mut walk = walk::Walk::new(Some(&mut found));
    walk.check(shape, &value.to_string()).unwrap();
    found.into_violations().is_empty()
}
