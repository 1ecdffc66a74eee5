//! Schemas in the dialect of OpenAPI 3.0, which every generator of clients reads; `/v1/schema/problem.json` keeps the
//! schema of a problem in full. Where the dialect cannot say something, such as which fields exclude each other, the
//! description says it, and the service checks it.

use std::collections::BTreeSet;

use schemars::{
    Schema,
    transform::{
        AddNullable, ReplaceBoolSchemas, ReplaceConstValue, Transform, transform_subschemas,
    },
};
use serde_json::{Value, json};

/// Brings every schema of an OpenAPI document to the dialect of OpenAPI 3.0.
pub(super) fn simplify(document: &mut Value) {
    let schemas = document["components"]["schemas"].as_object();
    let are_words = |schema: &Value| {
        let all = schema["oneOf"].as_array();
        all.is_some_and(|all| all.iter().all(|one| one["const"].is_string()))
    };
    let of_words = schemas.into_iter().flatten();
    let of_words = of_words.filter(|(_, schema)| are_words(schema));
    let of_words = of_words.map(|(name, _)| format!("#/components/schemas/{name}"));
    let mut dialect = Dialect {
        of_words: of_words.collect(),
    };
    dialect.simplify(document);
}

impl Dialect {
    fn simplify(&mut self, document: &mut Value) {
        let Value::Object(members) = document else {
            if let Value::Array(items) = document {
                items.iter_mut().for_each(|item| self.simplify(item));
            }
            return;
        };
        for (name, value) in members {
            match (name.as_str(), value) {
                ("schema", schema) => self.schema(schema),
                ("schemas", Value::Object(all)) => {
                    all.values_mut().for_each(|one| self.schema(one))
                }
                // not schemas, whatever their names
                ("example", _) => {}
                (_, other) => self.simplify(other),
            }
        }
    }

    fn schema(&mut self, value: &mut Value) {
        let Ok(mut schema) = Schema::try_from(value.take()) else {
            return;
        };
        self.transform(&mut schema);
        AddNullable::default().transform(&mut schema);
        ReplaceConstValue::default().transform(&mut schema);
        let mut bools = ReplaceBoolSchemas::default();
        bools.skip_additional_properties = true;
        bools.transform(&mut schema);
        *value = schema.to_value();
    }
}

/// Keywords that OpenAPI 3.0 does not have.
const UNKNOWN: [&str; 9] = [
    "if",
    "then",
    "else",
    "contentMediaType",
    "contentSchema",
    "propertyNames",
    "prefixItems",
    "$schema",
    "examples",
];

/// The changes to a schema that are not among the library's transforms.
struct Dialect {
    /// References to schemas whose values are words.
    of_words: BTreeSet<String>,
}

impl Transform for Dialect {
    fn transform(&mut self, schema: &mut Schema) {
        // what names of a pattern have, every further name has: without it there would be no names at all
        if let Some(patterns) = schema.remove("patternProperties")
            && let Some(of_one) = patterns.as_object().and_then(|all| all.values().next())
        {
            schema.insert("additionalProperties".into(), of_one.clone());
        }
        for name in UNKNOWN {
            schema.remove(name);
        }
        // Beside a reference nothing else may stand. A description and a default can, around it; generators read that
        // where the other schema is an enum, and stumble where it is an object.
        if let Some(reference) = schema.remove("$ref") {
            let beside = std::mem::take(schema);
            let is_word = reference
                .as_str()
                .is_some_and(|name| self.of_words.contains(name));
            if is_word
                && beside
                    .as_object()
                    .is_some_and(|members| !members.is_empty())
            {
                *schema = beside;
                schema.insert("allOf".into(), json!([{ "$ref": reference }]));
            } else {
                schema.insert("$ref".into(), reference);
            }
            return;
        }
        words(schema);
        nullable(schema);
        for form in ["oneOf", "anyOf"] {
            // alternatives that only say which fields they need have no type that a client could have
            let all = schema.get(form).and_then(Value::as_array);
            if all.is_some_and(|all| all.iter().all(only_requires) || all.contains(&json!({}))) {
                schema.remove(form);
            }
        }
        if let Some(Value::Object(properties)) = schema.get_mut("properties") {
            properties.retain(|_, property| *property != Value::Bool(false));
        }
        for (limit, exclusive) in [
            ("minimum", "exclusiveMinimum"),
            ("maximum", "exclusiveMaximum"),
        ] {
            if let Some(value @ Value::Number(_)) = schema.remove(exclusive) {
                schema.insert(limit.into(), value);
                schema.insert(exclusive.into(), true.into());
            }
        }
        if let Some(Value::Null | Value::Object(_) | Value::Array(_)) = schema.get("default") {
            schema.remove("default");
        }
        transform_subschemas(self, schema);
    }
}

/// Writes alternatives that are words as an enum, with the meaning of each in the description.
fn words(schema: &mut Schema) {
    let Some(Value::Array(all)) = schema.get("oneOf") else {
        return;
    };
    let word = |one: &Value| {
        let word = one["const"].as_str()?.to_owned();
        let meaning = one["description"].as_str().unwrap_or_default();
        Some((json!(word), format!("- `{word}`: {meaning}")))
    };
    let Some(found) = all.iter().map(word).collect::<Option<Vec<_>>>() else {
        return;
    };
    let (words, meanings): (Vec<Value>, Vec<String>) = found.into_iter().unzip();
    let of_all = schema.get("description").and_then(Value::as_str);
    let description = format!("{}\n\n{}", of_all.unwrap_or_default(), meanings.join("\n"));
    schema.remove("oneOf");
    schema.insert("type".into(), "string".into());
    schema.insert("enum".into(), words.into());
    schema.insert("description".into(), description.trim().into());
}

/// Writes a schema that allows another one or null as the other one, which may be null.
fn nullable(schema: &mut Schema) {
    let Some(Value::Array(all)) = schema.get_mut("anyOf") else {
        return;
    };
    let count = all.len();
    all.retain(|one| one["type"] != "null");
    if all.len() == count {
        return;
    }
    let only = (all.len() == 1).then(|| all.remove(0));
    schema.insert("nullable".into(), true.into());
    if let Some(only) = only {
        schema.remove("anyOf");
        schema.insert("allOf".into(), json!([only]));
    }
}

/// Whether an alternative says nothing but which fields it needs or excludes.
fn only_requires(alternative: &Value) -> bool {
    let Some(members) = alternative.as_object() else {
        return false;
    };
    members.iter().all(|(name, value)| match name.as_str() {
        "required" => true,
        "anyOf" => value
            .as_array()
            .is_some_and(|all| all.iter().all(only_requires)),
        "properties" => {
            let mut all = value.as_object().into_iter().flat_map(|own| own.values());
            all.all(|property| *property == Value::Bool(false))
        }
        _ => false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn simple(schema: Value) -> Value {
        let mut document = json!({ "schema": schema });
        simplify(&mut document);
        document["schema"].take()
    }

    #[test]
    fn words_become_an_enum_with_their_meanings() {
        let words = json!({"description": "A size.", "oneOf": [
            {"const": "s", "type": "string", "description": "Small."}, {"const": "l", "type": "string"}]});
        assert_eq!(
            simple(words),
            json!({"type": "string", "enum": ["s", "l"], "description": "A size.\n\n- `s`: Small.\n- `l`:"})
        );
    }

    #[test]
    fn what_may_be_null_is_nullable() {
        let reference = json!({"anyOf": [{"$ref": "#/components/schemas/A"}, {"type": "null"}]});
        assert_eq!(
            simple(reference),
            json!({"nullable": true, "allOf": [{"$ref": "#/components/schemas/A"}]})
        );
        assert_eq!(
            simple(json!({"type": ["number", "null"], "exclusiveMinimum": 0})),
            json!({"type": "number", "nullable": true, "minimum": 0, "exclusiveMinimum": true})
        );
    }

    #[test]
    fn a_reference_keeps_its_description_where_it_is_to_words() {
        let field = |name: &str| json!({"$ref": format!("#/components/schemas/{name}"), "description": "Which.", "default": "s"});
        let mut document = json!({"components": {"schemas": {
            "Size": {"oneOf": [{"const": "s", "type": "string"}]},
            "Object": {"type": "object"},
            "Fields": {"type": "object", "properties": {"size": field("Size"), "object": field("Object")}},
        }}});
        simplify(&mut document);
        assert_eq!(
            document["components"]["schemas"]["Fields"]["properties"],
            json!({
                "size": {"allOf": [{"$ref": "#/components/schemas/Size"}], "description": "Which.", "default": "s"},
                "object": {"$ref": "#/components/schemas/Object"},
            })
        );
    }

    #[test]
    fn no_schema_is_a_boolean() {
        let forms = json!({"type": "object", "properties": {"a": true, "list": {"type": "array", "items": true}},
            "oneOf": [{"required": ["a"], "properties": {"b": false}}, {"required": ["list"]}]});
        assert_eq!(
            simple(forms),
            json!({"type": "object", "properties": {"a": {}, "list": {"type": "array", "items": {}}}})
        );
    }
}
