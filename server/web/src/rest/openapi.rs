//! The operation `/openapi.json`: the list of operations as an OpenAPI document. The schemas of bodies are derived from
//! the types that are read and written, so that a renamed field changes the document automatically.

use std::{collections::BTreeMap, sync::LazyLock};

use base::{
    address::link,
    caller::Access,
    catalog::{Code, Kind},
};
use schemars::{
    SchemaGenerator,
    generate::{Contract, SchemaSettings},
};
use serde_json::{Map, Value, json};
use service::parameters::{Description, Location};
use solver::error::Violation;

use super::{
    openapi_dialect::simplify,
    operations::{self, Answer, Content, Operation},
};

/// Returns the OpenAPI document, which does not change while the service runs.
pub fn openapi() -> &'static Value {
    static DOCUMENT: LazyLock<Value> = LazyLock::new(document);
    &DOCUMENT
}

/// The media type of errors, RFC 9457.
const PROBLEM: &str = "application/problem+json";

fn document() -> Value {
    let mut schemas = Schemas::new();
    let mut paths: BTreeMap<&str, Map<String, Value>> = BTreeMap::new();
    let operations = operations::all();
    for operation in &operations {
        let described = schemas.operation(operation);
        let path = paths.entry(operation.path).or_default();
        path.insert(operation.method.to_ascii_lowercase(), described);
    }
    let mut document = json!({
        "openapi": "3.0.3",
        "info": {
            "title": "Signorini",
            "version": env!("CARGO_PKG_VERSION"),
            "description": INTRODUCTION,
            "license": { "name": "MIT OR Apache-2.0" },
        },
        "servers": [{ "url": link("/") }],
        "tags": operations::GROUPS.map(|(name, meaning, _)| json!({ "name": name, "description": meaning })),
        "paths": paths,
        "components": {
            "schemas": schemas.into_components(),
            "securitySchemes": {
                "token": { "type": "http", "scheme": "bearer", "description": "A token, as `signorini token create` prints it" },
            },
        },
    });
    simplify(&mut document);
    document
}

const INTRODUCTION: &str = "The same operations, names and numbers as over gRPC \
([/proto/signorini.proto](proto/signorini.proto)), on one port. The schema of a problem: \
[/v1/schema/problem.json](v1/schema/problem.json). \
Units are chosen by the client and must be consistent; stresses are negative in compression; times are RFC 3339 in UTC. \
Unknown names are refused, in bodies and in queries. Every error is a document of RFC 9457; its `code` \
is stable, and its `type` is the address of an explanation.";

/// Collects the schemas that operations refer to.
struct Schemas {
    /// Schemas for bodies that are read: fields with a default may be left out.
    requests: SchemaGenerator,
    /// Schemas for bodies that are written: fields that are always written are required.
    answers: SchemaGenerator,
}

impl Schemas {
    fn new() -> Schemas {
        let generator = |contract| {
            let mut settings = SchemaSettings::draft2020_12();
            settings.definitions_path = "/components/schemas".into();
            settings.contract = contract;
            settings.into_generator()
        };
        Schemas {
            requests: generator(Contract::Deserialize),
            answers: generator(Contract::Serialize),
        }
    }

    fn operation(&mut self, operation: &Operation) -> Value {
        let mut described = json!({
            "operationId": operation.id,
            "summary": operation.summary,
            "tags": [operation.group],
            "responses": {},
        });
        // a service without tokens asks for none
        described["security"] = match operation.access {
            Access::Open => json!([]),
            Access::Identified | Access::Needs(_) => json!([{ "token": [] }, {}]),
        };
        described["x-access"] = json!(operation.access.name());
        let parameters: Vec<Value> = operation.parameters.iter().map(parameter).collect();
        if !parameters.is_empty() {
            described["parameters"] = json!(parameters);
        }
        if !operation.rpcs.is_empty() {
            described["x-grpc"] = json!(operation.rpcs);
        }
        if let Some(body) = &operation.body {
            let content = content(&mut self.requests, body, operation.example.as_ref());
            described["requestBody"] =
                json!({ "required": operation.needs_body, "content": content });
        }
        for answer in &operation.answers {
            described["responses"][answer.status.to_string()] = self.answer(answer);
        }
        for (status, codes) in by_status(&operation.errors()) {
            described["responses"][status.to_string()] = self.failure(&codes);
        }
        described
    }

    fn answer(&mut self, answer: &Answer) -> Value {
        let mut described = json!({ "description": answer.meaning });
        if !answer.content.is_empty() {
            described["content"] = content(&mut self.answers, &answer.content, None);
        }
        for (header, always) in &answer.headers {
            let Description {
                schema, meaning, ..
            } = header;
            described["headers"][header.name] =
                json!({ "description": meaning, "required": always, "schema": schema });
        }
        described
    }

    /// Describes the answer with one status, for all errors that have this status; their codes distinguish them.
    fn failure(&mut self, codes: &[Kind]) -> Value {
        let kinds: Vec<String> = codes
            .iter()
            .map(|kind| format!("`{}`: {}", kind.code, kind.title))
            .collect();
        let names: Vec<&str> = codes.iter().map(|kind| kind.code).collect();
        json!({
            "description": kinds.join("; "),
            "content": { PROBLEM: { "schema": {
                "allOf": [{ "$ref": "#/components/schemas/Error" }],
                "properties": { "code": { "enum": names } },
            } } },
        })
    }

    fn into_components(mut self) -> Map<String, Value> {
        let violation = self.answers.subschema_for::<Violation>();
        let mut all = self.requests.take_definitions(true);
        // A type that is both read and written has the schema of the one that is read.
        for (name, schema) in self.answers.take_definitions(true) {
            all.entry(name).or_insert(schema);
        }
        all.insert("Error".into(), error_schema(&violation.to_value()));
        all
    }
}

fn parameter(parameter: &Description) -> Value {
    let location: &str = parameter.location.into();
    let mut described = json!({
        "name": parameter.name,
        "in": location,
        "schema": parameter.schema,
        "description": parameter.meaning,
    });
    if parameter.location == Location::Path {
        described["required"] = json!(true);
    }
    described
}

fn content(generator: &mut SchemaGenerator, body: &Content, example: Option<&Value>) -> Value {
    let by_media = body.iter().map(|(media, schema)| {
        let schema = schema(generator).to_value();
        // what has no schema is a document, or else a file
        let schema = match (schema == json!({}), *media) {
            (false, _) => schema,
            (true, "application/json") => json!({ "type": "object" }),
            (true, _) => json!({ "type": "string", "format": "binary" }),
        };
        let mut described = json!({ "schema": schema });
        if let Some(example) = example {
            described["example"] = example.clone();
        }
        ((*media).to_string(), described)
    });
    Value::Object(by_media.collect())
}

fn by_status(codes: &[Code]) -> BTreeMap<u16, Vec<Kind>> {
    let mut found: BTreeMap<u16, Vec<Kind>> = BTreeMap::new();
    for kind in codes.iter().map(|code| code.kind()) {
        if let Some(status) = kind.status {
            found.entry(status).or_default().push(kind);
        }
    }
    found
}

/// The schema of the document that `ApiError::document` makes; a test compares the two.
fn error_schema(violation: &Value) -> Value {
    json!({
        "title": "Error",
        "description": "What went wrong (RFC 9457).",
        "type": "object",
        "properties": {
            "type": { "type": "string", "description": "Address of the explanation." },
            "title": { "type": "string", "description": "One line, the same for all errors of this kind." },
            "status": { "type": "integer", "minimum": 400, "maximum": 599 },
            "code": { "type": "string", "description": "The kind of error, a stable name for programs." },
            "detail": { "type": "string", "description": "What happened in this case." },
            "instance": { "type": "string", "description": "The path of the request." },
            "retryable": { "type": "boolean", "description": "The same request may succeed later." },
            "errors": {
                "type": "array",
                "items": violation,
                "description": "All violations of an invalid request.",
            },
        },
        "required": ["type", "title", "status", "code", "detail", "instance", "retryable", "errors"],
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use service::error::ApiError;

    fn names(schema: &Value, of: &str) -> Vec<String> {
        let fields = schema[of].as_object().into_iter().flatten();
        fields.map(|(name, _)| name.clone()).collect()
    }

    /// Two types do not share a name, since two lists of schemas are merged into one.
    #[test]
    fn two_types_do_not_share_a_name() {
        let mut schemas = Schemas::new();
        for operation in operations::all() {
            schemas.operation(&operation);
        }
        let read = schemas.requests.take_definitions(true);
        let written = schemas.answers.take_definitions(true);
        let mut shared = 0;
        for (name, read) in &read {
            if let Some(written) = written.get(name) {
                assert_eq!(read["description"], written["description"], "{name}");
                assert_eq!(names(read, "properties"), names(written, "properties"));
                shared += 1;
            }
        }
        assert!(shared > 0, "limits of a job are both read and written");
    }

    #[test]
    fn an_error_is_described_as_it_is_written() {
        let written = ApiError::Draining.document("/v1/jobs");
        let described = error_schema(&json!({}));
        let mut names = names(&described, "properties");
        names.sort();
        let fields: Vec<&String> = written.as_object().unwrap().keys().collect();
        assert_eq!(names.iter().collect::<Vec<_>>(), fields);
    }
}
