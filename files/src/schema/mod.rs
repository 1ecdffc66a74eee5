//! The faults of the structure of a problem, found with our JSON Schema and described in words.
//!
//! It supports those keywords of draft 2020-12 that the schema of our types has. Written here rather than left to a
//! library: the existing ones bring regular expressions, URIs and references over the network (a tenth of the build),
//! need a tree of the whole text, and answer in terms of the schema ("not valid under any of the schemas") instead of
//! naming the intended alternative and its faults.

mod alternatives;
mod numbers;
mod shape;
mod walk;
mod words;

use solver::error::{Findings, Violation};

pub use shape::schema;
pub use words::{meant, quoted};

/// The violations of a problem's text, at most a hundred; or the error of a text that is not JSON, whose line and
/// column may be relative to a part of it.
pub(crate) fn violations(text: &str) -> serde_json::Result<Vec<Violation>> {
    let mut found = Findings::default();
    let mut walk = walk::Walk::new(Some(&mut found));
    let read = walk.check(&shape::PROBLEM, text);
    let stopped = walk.stopped;
    if !stopped {
        read?;
    }
    let mut found = found.into_violations();
    if let Some(last) = found.last_mut().filter(|_| stopped) {
        last.hint
            .push_str(" (There are more violations: the check ends after 100.)");
    }
    Ok(found)
}

/// Whether one of the definitions of the schema accepts a value.
#[cfg(test)]
pub(crate) fn accepts(definition: &str, value: &serde_json::Value) -> bool {
    let schema = schema();
    let named = &schema["$defs"][definition];
    let shape = Box::leak(Box::new(shape::shape(named, &schema).unwrap()));
    let mut found = Findings::default();
    let mut walk = walk::Walk::new(Some(&mut found));
    walk.check(shape, &value.to_string()).unwrap();
    found.into_violations().is_empty()
}
