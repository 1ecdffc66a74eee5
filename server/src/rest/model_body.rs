//! The body that registers a model: its schema, and reading it with all errors reported together.

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::value::RawValue;
use solver::{
    error::{Findings, Reason, Violation},
    problem::Problem,
};

use super::{
    bodies::{missing_envelope, problem},
    object::{First, Object, Read, wrong_type},
};
use crate::{
    error::ApiError,
    model::{MAX_TITLE, MOST_INPUTS, MOST_OUTPUTS, MOST_VECTORS, Output, Quantity},
    parameters::Values,
    verbs::models::{ModelRequest, POINTS, quantities},
    violations::{prefixed, quoted},
};

/// A body that registers a model; for its schema only.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(super) struct ModelSubmission {
    /// The problem that the inputs are put into. It must be valid itself, and at most 128 KiB as JSON.
    problem: Problem,
    /// Vectors of inputs: JSON Pointers (RFC 6901) to numbers of the problem, such as /contacts/0/indentation; at most 64.
    #[schemars(length(min = 1, max = MOST_VECTORS))]
    inputs: Vec<Vec<String>>,
    /// Vectors of outputs, each numbers of the summary or a sampled column of a profile; at most 10,000 numbers.
    #[schemars(length(min = 1, max = MOST_VECTORS))]
    outputs: Vec<Output>,
    /// For people, at most 256 characters.
    #[schemars(default, length(max = MAX_TITLE))]
    title: Option<String>,
}

/// A body `{problem, inputs, outputs, title}`.
pub(super) fn model(text: &str) -> Result<Read<ModelRequest>, ApiError> {
    let mut body = Object::open(text, "an object with problem, inputs and outputs")?;
    if let Some(violation) = missing_envelope(&body) {
        return Ok(Err(vec![violation]));
    }
    let problem = problem(&mut body);
    let inputs = vectors(&mut body, "inputs", "[[\"/contacts/0/indentation\"]]");
    let outputs = vectors(&mut body, "outputs", "[{\"scalars\": [\"normal_force\"]}]");
    let (mut all_inputs, mut all_outputs) = (vec![], vec![]);
    for (k, raw) in inputs.into_iter().flatten().enumerate() {
        // one more than allowed: the verb reports the excess
        match serde_json::from_str::<First<{ MOST_INPUTS + 1 }>>(raw.get()) {
            Ok(First(pointers)) => {
                let read = texts(
                    &format!("/inputs/{k}"),
                    &pointers,
                    "a JSON Pointer as a string",
                );
                all_inputs.push(read.unwrap_or_else(|found| {
                    body.violations.extend(found);
                    vec![]
                }));
            }
            Err(_) => body.wrong_type(&format!("inputs/{k}"), raw, "a list of JSON Pointers"),
        }
    }
    for (k, raw) in outputs.into_iter().flatten().enumerate() {
        match output(raw.get()) {
            Ok(Ok(output)) => all_outputs.push(output),
            Ok(Err(found)) | Err(ApiError::InvalidProblem(found)) => {
                body.violations
                    .extend(prefixed(&format!("/outputs/{k}"), found));
            }
            Err(other) => return Err(other),
        }
    }
    let title = body.take("title", "a string");
    let request = problem.map(|problem| ModelRequest {
        title,
        problem,
        inputs: all_inputs,
        outputs: all_outputs,
    });
    Ok(body.finish("problem, inputs, outputs, title", request))
}

/// A list of vectors, with one more than allowed: the verb reports the excess.
fn vectors<'a>(body: &mut Object<'a>, name: &str, example: &str) -> Option<Vec<&'a RawValue>> {
    let hint = format!("Send {{\"{name}\": {example}}}.");
    let raw = body.require(name, "a list of vectors", &hint)?;
    match serde_json::from_str::<First<{ MOST_VECTORS + 1 }>>(raw.get()) {
        Ok(First(vectors)) => Some(vectors),
        Err(_) => {
            body.wrong_type(name, raw, "a list of vectors");
            None
        }
    }
}

/// Strings of a list, or what else is in it.
fn texts(at: &str, raw: &[&RawValue], expected: &str) -> Result<Vec<String>, Vec<Violation>> {
    let mut found = Findings::default();
    let mut read = vec![];
    for (k, raw) in raw.iter().enumerate() {
        match serde_json::from_str(raw.get()) {
            Ok(text) => read.push(text),
            Err(_) => found.add(wrong_type(&format!("{at}/{k}"), raw, expected)),
        }
    }
    found.into_result(read)
}

/// A vector of outputs: `{scalars}`, or `{profile, quantity, points}`.
fn output(text: &str) -> Result<Read<Output>, ApiError> {
    const KINDS: &str = "an object with scalars, or with profile, quantity and points";
    const KNOWN: &str = "scalars, profile, quantity, points";
    let mut body = Object::open(text, KINDS)?;
    let read = match body.has("profile") {
        true => profile(&mut body),
        false => {
            let hint = "Send {\"scalars\": [\"normal_force\"]}, or a profile.";
            let raw = body.require("scalars", "a list of paths into the summary", hint);
            raw.and_then(|raw| {
                match serde_json::from_str::<First<{ MOST_OUTPUTS + 1 }>>(raw.get()) {
                    Ok(First(paths)) => texts("/scalars", &paths, "a path as a string")
                        .map_err(|found| body.violations.extend(found))
                        .ok(),
                    Err(_) => {
                        body.wrong_type("scalars", raw, "a list of paths into the summary");
                        None
                    }
                }
            })
            .map(|scalars| Output::Scalars { scalars })
        }
    };
    Ok(body.finish(KNOWN, read))
}

fn profile(body: &mut Object<'_>) -> Option<Output> {
    let name = "the name of a contact boundary";
    let profile = field(body, "profile");
    let profile = profile.and_then(|raw| read(body, "profile", raw, name));
    let word = field(body, "quantity");
    let word: Option<String> = word.and_then(|raw| read(body, "quantity", raw, "a word"));
    let quantity = word.and_then(|word| {
        let found = word.parse::<Quantity>().ok();
        if found.is_none() {
            let words = quantities();
            let hint = files::meant(&word, words.split(", "));
            body.violations.add(Violation {
                pointer: "/quantity".into(),
                reason: Reason::UnknownAlternative,
                got: format!("{:?}", quoted(&word)),
                expected: format!("one of {words}"),
                hint: hint.unwrap_or_else(|| "These are columns of a profile.".into()),
            });
        }
        found
    });
    let points = field(body, "points");
    let points = points.and_then(|raw| read(body, "points", raw, &POINTS.expected()));
    Some(Output::Profile {
        profile: profile?,
        quantity: quantity?,
        points: points?,
    })
}

/// A field of a profile.
fn field<'a>(body: &mut Object<'a>, name: &str) -> Option<&'a RawValue> {
    const HINT: &str =
        "Send {\"profile\": \"top\", \"quantity\": \"normal_stress\", \"points\": 50}.";
    body.require(name, "profile, quantity and points together", HINT)
}

/// Its value.
fn read<T: DeserializeOwned>(
    body: &mut Object<'_>,
    name: &str,
    raw: &RawValue,
    expected: &str,
) -> Option<T> {
    let value = serde_json::from_str(raw.get()).ok();
    if value.is_none() {
        body.wrong_type(name, raw, expected);
    }
    value
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use serde_json::{Value, json};

    use super::*;
    use crate::fake;

    fn body(inputs: Value, outputs: Value) -> String {
        json!({ "problem": fake::problem(), "inputs": inputs, "outputs": outputs }).to_string()
    }

    fn violations(text: &str) -> Vec<(String, Reason)> {
        let found = model(text).unwrap().unwrap_err();
        assert!(!found.is_empty());
        found.into_iter().map(|v| (v.pointer, v.reason)).collect()
    }

    #[test]
    fn a_model_is_read_with_its_vectors() {
        let outputs = json!([
            { "scalars": ["normal_force", "contacts/top/peak_normal_stress"] },
            { "profile": "top", "quantity": "normal_stress", "points": 50 },
        ]);
        let read = model(&body(json!([["/a", "/b"], ["/c"]]), outputs.clone()));
        let read = read.unwrap().unwrap();
        assert_eq!(read.inputs, [vec!["/a", "/b"], vec!["/c"]]);
        assert_eq!(serde_json::to_value(&read.outputs).unwrap(), outputs);
        assert_eq!(read.title, None);
    }

    #[test]
    fn all_faults_of_structure_are_told_together() {
        let outputs = json!([
            { "scalars": ["normal_force", 7] },
            { "profile": null, "quantity": "normal_stress", "points": 50 },
            { "profile": "top", "quantity": "normal_stres", "points": 0.5 },
            { "profile": "top" },
            { "scalar": [] },
            "normal_force",
        ]);
        let found = violations(&body(json!([["/a", 1], "/b"]), outputs));
        let expected = [
            ("/inputs/0/1", Reason::WrongType),
            ("/inputs/1", Reason::WrongType),
            ("/outputs/0/scalars/1", Reason::WrongType),
            ("/outputs/1/profile", Reason::WrongType),
            ("/outputs/2/quantity", Reason::UnknownAlternative),
            ("/outputs/2/points", Reason::WrongType),
            ("/outputs/3/quantity", Reason::Missing),
            ("/outputs/3/points", Reason::Missing),
            ("/outputs/4/scalars", Reason::Missing),
            ("/outputs/4/scalar", Reason::UnknownName),
            ("/outputs/5", Reason::WrongType),
        ];
        let expected = expected.map(|(pointer, reason)| (pointer.to_owned(), reason));
        assert_eq!(found, expected);
        let found = violations(r#"{"title": 1}"#);
        let missing = |name: &str| (name.to_owned(), Reason::Missing);
        assert_eq!(
            found,
            [
                missing("/problem"),
                missing("/inputs"),
                missing("/outputs"),
                ("/title".into(), Reason::WrongType)
            ]
        );
    }

    #[test]
    fn the_described_fields_are_those_that_are_read() {
        let found = model(r#"{"other": 1}"#).unwrap().unwrap_err();
        let unknown = found.iter().find(|v| v.reason == Reason::UnknownName);
        let known = unknown
            .unwrap()
            .expected
            .strip_prefix("one of ")
            .unwrap()
            .to_owned();
        let mut known: Vec<&str> = known.split(", ").collect();
        let schema = schemars::schema_for!(ModelSubmission);
        let mut described: Vec<&String> = schema
            .get("properties")
            .unwrap()
            .as_object()
            .unwrap()
            .keys()
            .collect();
        known.sort();
        described.sort();
        assert_eq!(known, described);
    }
}
