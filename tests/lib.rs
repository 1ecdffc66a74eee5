//! What the tests share.
#![allow(clippy::unwrap_used, clippy::panic)] // a test that fails should say so at once

pub mod harness;

use serde_json::Value;

/// One of the problems in `examples/`, as text.
pub fn example(name: &str) -> String {
    let path = format!("{}/../examples/{name}.json", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The same as JSON.
pub fn example_json(name: &str) -> Value {
    serde_json::from_str(&example(name)).unwrap()
}
