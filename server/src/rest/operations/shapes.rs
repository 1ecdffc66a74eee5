//! The shapes of parameters and of bodies, in the words of JSON Schema.

use std::ops::RangeInclusive;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde_json::{Value, json};

use super::{Content, Parameter, SchemaOf};
use crate::{catalog::Code, formats::Format, rest::docs};

/// Schema and meaning of a variable in a path.
pub(in crate::rest) fn variable(path: &str, name: &str) -> (Value, &'static str) {
    match name {
        "id" => (json!({ "$ref": "#/components/schemas/JobId" }), "The job"),
        "hash" => (
            json!({ "type": "string", "pattern": "^sha256:[0-9a-f]{64}$" }),
            "The mesh",
        ),
        "boundary" => (text(), "Name of a contact boundary"),
        "plot" => (
            word(&["mesh.svg", "deformed.svg", "profile.svg", "convergence.svg"]),
            "Which figure",
        ),
        "code" => (
            word(&Code::ALL.map(|code| code.kind().code)),
            "The kind of error",
        ),
        "file" => (word(&docs::NAMES), "What the page loads"),
        _ => unreachable!("{name} in {path} has no schema"),
    }
}

pub(super) fn query(name: &'static str, schema: Value, meaning: &'static str) -> Parameter {
    Parameter {
        place: "query",
        name,
        schema,
        meaning,
    }
}

pub(super) fn header(name: &'static str, schema: Value, meaning: &'static str) -> Parameter {
    Parameter {
        place: "header",
        name,
        schema,
        meaning,
    }
}

// ---- the shapes of parameters

pub(super) fn whole(range: RangeInclusive<i64>) -> Value {
    json!({ "type": "integer", "minimum": range.start(), "maximum": range.end() })
}

pub(super) fn number(least: f64, most: f64) -> Value {
    json!({ "type": "number", "minimum": least, "maximum": most })
}

pub(super) fn time() -> Value {
    json!({ "type": "string", "format": "date-time" })
}

pub(super) fn matching(pattern: &str) -> Value {
    json!({ "type": "string", "pattern": pattern })
}

/// Usually so; what is otherwise is passed over, as HTTP has it of preferences and ranges.
pub(super) fn like(pattern: &str) -> Value {
    json!({ "type": "string", "anyOf": [{ "pattern": pattern }, {}] })
}

pub(super) fn text() -> Value {
    json!({ "type": "string" })
}

pub(super) fn word(words: &[&str]) -> Value {
    json!({ "type": "string", "enum": words })
}

pub(super) fn one_of<const N: usize>(shapes: [Value; N]) -> Value {
    json!({ "anyOf": shapes.to_vec() })
}

/// Several, as several parameters of one name.
pub(super) fn several(one: Value) -> Value {
    json!({ "type": "array", "items": one })
}

/// Parameters `label.{key}`, as many as are wanted. OpenAPI has them as the members of an object, which are
/// parameters each (style form, exploded: the default). Their values have no type: in a query all are text.
pub(super) fn labels() -> Parameter {
    let keys = json!({ "^label\\.": {} });
    let labels =
        json!({ "type": "object", "patternProperties": keys, "additionalProperties": false });
    query(
        "label.{key}",
        labels,
        "label.KEY=VALUE: only jobs with this label; several may be given",
    )
}

pub(super) fn format_of(formats: &[Format]) -> Parameter {
    let names: Vec<&str> = formats.iter().map(|format| format.name()).collect();
    query(
        "format",
        word(&names),
        "How the data are written; it overrides Accept",
    )
}

// ---- the shapes of bodies

pub(super) fn nothing() -> Content {
    vec![]
}

pub(super) fn json<T: JsonSchema>() -> Content {
    vec![("application/json", SchemaGenerator::subschema_for::<T>)]
}

pub(super) fn bytes(media: &'static str) -> Content {
    vec![(media, anything)]
}

/// A stream of server-sent events, the data of each a `T` as JSON. The schema is of one event: OpenAPI
/// 3.1 has no word for the stream.
pub(super) fn stream<T: JsonSchema>() -> Content {
    vec![("text/event-stream", |generator| {
        let data = generator.subschema_for::<T>();
        json_schema!({
            "type": "object",
            "properties": {
                "id": { "type": "string" },
                "event": { "type": "string" },
                "data": { "type": "string", "contentMediaType": "application/json", "contentSchema": data },
            },
            "required": ["id", "event", "data"],
        })
    })]
}

/// The same as JSON Lines.
pub(super) fn lines() -> Content {
    vec![("application/jsonl", anything)]
}

/// A problem, as it is read: JSON Schema of `files::schema`.
pub(super) fn the_problem() -> Content {
    vec![(
        "application/json",
        |_| json_schema!({ "$ref": "#/components/schemas/Problem" }),
    )]
}

/// A body that hands in a job.
pub(super) fn submission() -> Value {
    let problem = include_str!("../../../../examples/rectangular_punch.json");
    let problem: Value = serde_json::from_str(problem).unwrap_or_default();
    json!({ "problem": problem })
}

/// What JSON Schema has no word for.
pub(super) fn anything(_: &mut SchemaGenerator) -> Schema {
    Schema::default()
}

/// Data in each of the formats; `T` is their JSON.
pub(super) fn data<T: JsonSchema>(formats: &[Format]) -> Content {
    let schema = |format: &Format| -> SchemaOf {
        match format {
            Format::Json => SchemaGenerator::subschema_for::<T>,
            _ => anything,
        }
    };
    formats
        .iter()
        .map(|format| (format.media_type(), schema(format)))
        .collect()
}
