//! Bodies of HTTP requests: JSON that is checked against the schema of a type, with all violations at once, and then
//! read.
//!
//! A problem in the body of a request is read by [`json::parse`], like a problem in a file: it may have a large mesh.
//! Its violations are listed with those of the rest of the body.

use std::{borrow::Cow, marker::PhantomData, sync::LazyLock};

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Deserializer, de::DeserializeOwned, de::IgnoredAny};
use solver::{
    error::{Findings, Violation},
    problem::Problem,
};

use crate::{json, schema};

/// Stands for a problem in the body of a request; the problem itself is read apart from the rest of the body.
#[derive(Clone, Copy, Debug, Default)]
pub struct Embedded;

impl<'de> Deserialize<'de> for Embedded {
    fn deserialize<D: Deserializer<'de>>(reader: D) -> Result<Self, D::Error> {
        IgnoredAny::deserialize(reader).map(|_| Embedded)
    }
}

impl JsonSchema for Embedded {
    fn schema_name() -> Cow<'static, str> {
        Problem::schema_name()
    }

    fn schema_id() -> Cow<'static, str> {
        Problem::schema_id()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        Problem::json_schema(generator)
    }
}

/// A kind of request body, which is read as the type `T`. The schema of `T` refuses unknown names, but its
/// `Deserialize` ignores them, so that the rest of a body with unknown names can still be read.
pub struct Body<T> {
    shape: LazyLock<schema::Shape>,
    read: PhantomData<fn() -> T>,
}

/// The content of a request body that was read.
#[derive(Debug)]
pub struct Content<'a, T> {
    /// The fields of the body apart from its problems; none if they cannot be read.
    pub fields: Option<T>,
    /// The problems in the body: of each the JSON Pointer to it, and its text.
    pub problems: Vec<(String, &'a str)>,
    /// The violations found in the body so far.
    pub violations: Findings,
    /// The JSON Pointer to the first problem that was not checked, because there were enough violations before it.
    unchecked: Option<String>,
}

impl<T: DeserializeOwned + JsonSchema> Body<T> {
    /// Request bodies of the type `T`.
    #[allow(clippy::new_without_default)]
    pub const fn new() -> Self {
        Body {
            shape: LazyLock::new(schema::of_body::<T>),
            read: PhantomData,
        }
    }

    /// Reads a request body.
    ///
    /// # Errors
    ///
    /// A message if the text is not JSON. All other faults are listed in the content's `violations`.
    pub fn read<'a>(&'static self, text: &'a str) -> Result<Content<'a, T>, String> {
        if text.trim().is_empty() {
            return Err("the body of the request is empty; expected an object".to_owned());
        }
        if let Some(place) = json::too_deep(text) {
            return Err(format!("{place}; expected at most {}", json::MOST_NESTED));
        }
        let checked = schema::check(&self.shape, text).map_err(|error| {
            let error = json::syntax_error(text).unwrap_or(error);
            error.to_string()
        })?;
        let sound = checked.violations.is_empty();
        let mut violations = Findings::default();
        violations.extend(checked.violations);
        let fields = serde_json::from_str(text);
        let fields = fields.map_err(|error: serde_json::Error| {
            if sound {
                let (first, hint) = (error.to_string(), "See /openapi.json.");
                violations.add(json::beyond_the_schema::<T>(text, first, hint));
            }
        });
        Ok(Content {
            fields: fields.ok(),
            problems: checked.problems,
            violations,
            unchecked: None,
        })
    }
}

impl<T> std::fmt::Debug for Body<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Body")
    }
}

impl<'a, T> Content<'a, T> {
    /// Reads the problems. Invalid problems are left out; their violations are added to those of the body.
    pub fn parse_problems(&mut self) -> Vec<Problem> {
        let mut read = vec![];
        for (place, text) in &self.problems {
            if self.violations.is_full() {
                self.unchecked = Some(place.clone());
                break;
            }
            match json::parse(text) {
                Ok(problem) => read.push(problem),
                Err(found) => self.violations.extend(found.into_iter().map(|v| Violation {
                    pointer: format!("{place}{}", v.pointer),
                    ..v
                })),
            }
        }
        read
    }

    /// All violations of the body.
    pub fn into_violations(self) -> Vec<Violation> {
        let mut found = self.violations.into_violations();
        if let (Some(place), Some(last)) = (self.unchecked, found.last_mut()) {
            let note =
                format!(" (The problem at {place} and the problems after it were not checked.)");
            last.hint.push_str(&note);
        }
        found
    }

    /// The same content with other fields.
    pub fn with<U>(self, fields: Option<U>) -> Content<'a, U> {
        Content {
            fields,
            problems: self.problems,
            violations: self.violations,
            unchecked: self.unchecked,
        }
    }
}

#[cfg(test)]
mod tests {
    use solver::error::Reason;

    use super::*;

    #[derive(Deserialize, JsonSchema)]
    #[schemars(deny_unknown_fields)]
    struct Letter {
        #[serde(rename = "problem")]
        _problem: Embedded,
        #[serde(default, rename = "copies")]
        #[schemars(range(min = 1, max = 3), length(max = 2))]
        _copies: Option<Vec<i32>>,
        #[serde(default, rename = "stamp")]
        _stamp: Option<Stamp>,
    }

    #[derive(Deserialize, JsonSchema)]
    #[schemars(deny_unknown_fields)]
    struct Stamp {
        #[serde(rename = "worth")]
        _worth: f64,
    }

    static LETTER: Body<Letter> = Body::new();

    fn found(text: &str) -> Vec<(String, Reason)> {
        let mut content = LETTER.read(text).unwrap();
        content.parse_problems();
        let found = content.into_violations();
        found.into_iter().map(|v| (v.pointer, v.reason)).collect()
    }

    #[test]
    fn all_violations_of_a_body_and_of_the_problem_in_it_are_told_at_once() {
        let text = r#"{"problem": {"mesh": 7}, "copies": [1.5, "2"], "stamp": [3], "paper": 1}"#;
        let all = found(text);
        let places: Vec<_> = all.iter().map(|(at, reason)| (&at[..], *reason)).collect();
        let expected = [
            ("/copies/0", Reason::WrongType),
            ("/copies/1", Reason::WrongType),
            ("/stamp", Reason::WrongType),
            ("/paper", Reason::UnknownName),
        ];
        assert_eq!(places[..4], expected);
        assert!(
            places.contains(&("/problem/mesh", Reason::WrongCount))
                || places.contains(&("/problem/mesh", Reason::WrongType)),
            "{places:?}"
        );
        assert!(places.contains(&("/problem/analysis", Reason::Missing)));
    }

    #[test]
    fn sizes_are_left_to_the_operation_apart_from_lengths_of_lists() {
        let content = LETTER.read(r#"{"problem": {}, "copies": [7, -7], "stamp": null}"#);
        let content = content.unwrap();
        assert!(content.violations.is_empty() && content.fields.is_some());
        assert_eq!(content.problems, [("/problem".to_owned(), "{}")]);
        let long = LETTER.read(r#"{"problem": {}, "copies": [1, 1, 1], "stamp": null}"#);
        let long = long.unwrap().into_violations();
        assert_eq!(
            (&long[0].pointer[..], long[0].reason),
            ("/copies", Reason::TooMany)
        );
    }

    #[test]
    fn a_number_that_its_type_cannot_hold_is_a_violation_with_its_place() {
        let found = found(r#"{"problem": {}, "copies": [9000000000]}"#);
        assert_eq!(found[0], ("/copies/0".to_owned(), Reason::Malformed));
    }
}
