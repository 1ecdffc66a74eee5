//! The bodies of operations, described by JSON Schema.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde_json::{Value, json};
use service::formats::Format;

use super::operation::{Content, SchemaOf};

pub(super) fn nothing() -> Content {
    vec![]
}

pub(super) fn json<T: JsonSchema>() -> Content {
    vec![("application/json", SchemaGenerator::subschema_for::<T>)]
}

/// A body that is a merge patch (RFC 7396).
pub(super) fn merge_patch<T: JsonSchema>() -> Content {
    vec![(
        "application/merge-patch+json",
        SchemaGenerator::subschema_for::<T>,
    )]
}

pub(super) fn bytes(media: &'static str) -> Content {
    vec![(media, anything)]
}

/// A body that is a stream of server-sent events whose data are `T` as JSON. The schema is that of one event: OpenAPI
/// 3.1 cannot describe a stream.
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

/// A body that is a stream of events as JSON Lines.
pub(super) fn lines() -> Content {
    vec![("application/jsonl", anything)]
}

/// A body that is a problem, by the JSON Schema of `files::schema`.
pub(super) fn the_problem() -> Content {
    vec![(
        "application/json",
        |_| json_schema!({ "$ref": "#/components/schemas/Problem" }),
    )]
}

/// An example of a body that submits a job.
pub(super) fn submission() -> Value {
    let problem = include_str!("../../../../../examples/rectangular_punch.json");
    let problem: Value = serde_json::from_str(problem).unwrap_or_default();
    json!({ "problem": problem })
}

/// An example of a body that submits a sweep.
pub(super) fn sweep() -> Value {
    let mut example = submission();
    json!({
        "base": example["problem"].take(),
        "axes": [
            { "path": "/contacts/0/friction/coefficient", "values": [0.1, 0.2, 0.3] },
            { "path": "/contacts/0/friction/nonlocal_radius", "logspace": { "start": 0.01, "stop": 0.1, "count": 5 } },
        ],
    })
}

/// The schema of a body that JSON Schema cannot describe.
pub(super) fn anything(_: &mut SchemaGenerator) -> Schema {
    Schema::default()
}

/// A body that is data in one of the formats; `T` is the JSON form of the data.
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
