//! A JSON Schema in the form that values are checked with. References are resolved once per process.

use std::{borrow::Cow, collections::BTreeMap, sync::LazyLock};

use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use solver::problem::Problem;

/// The JSON Schema of a problem (draft 2020-12). It accepts null where the service does: in a field that may be absent.
pub fn schema() -> Value {
    let mut schema = of_problem();
    accept_null_as_absent(&mut schema);
    schema
}

/// The schema that problems are checked with here, which leaves null to that check.
pub(super) fn of_problem() -> Value {
    schemars::schema_for!(Problem).to_value()
}

/// Lets the alternatives of an object, and the conditions on it, say that a field is absent or null, and present and not null: a
/// field that they exclude may be null, and one that they ask for may not.
fn accept_null_as_absent(schema: &mut Value) {
    match schema {
        Value::Array(list) => list.iter_mut().for_each(accept_null_as_absent),
        Value::Object(words) => {
            // the object itself is described elsewhere, with the types of its fields
            if !words.contains_key("type") {
                let asked = words.get("required").and_then(Value::as_array).cloned();
                let fields = words.get("properties").and_then(Value::as_object).cloned();
                let (asked, mut fields) = (asked.unwrap_or_default(), fields.unwrap_or_default());
                for field in fields.values_mut().filter(|field| **field == false) {
                    *field = json!({ "type": "null" });
                }
                for name in asked.iter().filter_map(Value::as_str) {
                    let field = fields.entry(name).or_insert_with(|| json!({}));
                    if field.as_object().is_some_and(Map::is_empty) {
                        *field = json!({ "not": { "type": "null" } });
                    }
                }
                if !fields.is_empty() {
                    words.insert("properties".to_owned(), Value::Object(fields));
                }
            }
            words.values_mut().for_each(accept_null_as_absent);
        }
        _ => {}
    }
}

/// The shape of a problem.
pub(super) static PROBLEM: LazyLock<Shape> = LazyLock::new(|| {
    let schema = of_problem();
    // the schema is ours; a test reads it. A shape that allows anything leaves the decision to serde.
    shape(&schema, &schema).unwrap_or_default()
});

/// The shape of a request body. The lengths of texts and the sizes of numbers are left to the code that serves the
/// request, which checks them for requests over gRPC too; only the lengths of lists are bounded here, before the lists
/// are read.
pub(super) fn of_body<T: JsonSchema>() -> serde_json::Result<Shape> {
    let schema = schemars::schema_for!(T).to_value();
    let mut shape: Shape = serde_json::from_value(Plain::OfBody.schema(&schema, &schema))?;
    shape.find_forms();
    Ok(shape)
}

/// The shape that a schema describes. `whole`: the schema with the definitions that references name.
pub(super) fn shape(schema: &Value, whole: &Value) -> serde_json::Result<Shape> {
    let mut shape: Shape = serde_json::from_value(Plain::OfProblem.schema(schema, whole))?;
    shape.find_forms();
    Ok(shape)
}

/// A type of JSON values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Type {
    Null,
    Boolean,
    Integer,
    Number,
    String,
    Array,
    Object,
}

impl Type {
    /// A value of the type, in words, such as `a number`.
    pub(super) fn words(self) -> &'static str {
        match self {
            Type::Null => "null",
            Type::Boolean => "true or false",
            Type::Integer => "an integer",
            Type::Number => "a number",
            Type::String => "a string",
            Type::Array => "a list",
            Type::Object => "an object",
        }
    }
}

/// What a value may be. The fields are the keywords of draft 2020-12 that the schema of our types has; any other
/// keyword is an error of [`shape`].
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "camelCase")]
pub(crate) struct Shape {
    /// Whether the value must be absent: the schema is `false`.
    pub(super) never: bool,
    /// Whether the value is a problem in a request body, which is checked by itself.
    pub(super) problem: bool,
    /// The largest number of entries of a list in a request body.
    pub(super) at_most: Option<usize>,
    #[serde(rename = "type")]
    types: Types,
    #[serde(rename = "const")]
    pub(super) only: Option<String>,
    pub(super) properties: BTreeMap<String, Shape>,
    pub(super) additional_properties: Option<Box<Shape>>,
    pub(super) required: Vec<String>,
    pub(super) items: Option<Box<Shape>>,
    min_items: usize,
    max_items: Option<usize>,
    /// The shape that the value must not have: the schema of our types excludes a list length in this way.
    not: Option<Box<Shape>>,
    pub(super) minimum: Option<f64>,
    any_of: Vec<Shape>,
    one_of: Vec<Shape>,
    #[serde(rename = "if")]
    pub(super) condition: Option<Box<Shape>>,
    pub(super) then: Option<Box<Shape>>,
    #[serde(rename = "else")]
    pub(super) otherwise: Option<Box<Shape>>,
    /// For each alternative, the names that only this alternative requires, if these distinguish all alternatives.
    #[serde(skip)]
    pub(super) forms: Option<Vec<Vec<String>>>,
}

#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Types {
    One(Type),
    Several(Vec<Type>),
}

impl Default for Types {
    fn default() -> Self {
        Types::Several(Vec::new())
    }
}

impl Shape {
    /// The allowed types; empty if all types are allowed.
    pub(super) fn types(&self) -> &[Type] {
        match &self.types {
            Types::One(only) => std::slice::from_ref(only),
            Types::Several(types) => types,
        }
    }

    /// Whether a value of this type is allowed. A number may turn out to be an integer.
    pub(super) fn allows(&self, found: Type) -> bool {
        let types = self.types();
        let same = |own: &Type| *own == found || (*own == Type::Integer && found == Type::Number);
        types.is_empty() || types.iter().any(same)
    }

    /// Whether the shape allows any value.
    pub(super) fn is_anything(&self) -> bool {
        !self.never
            && self.only.is_none()
            && self.minimum.is_none()
            && self.items.is_none()
            && self.additional_properties.is_none()
            && !self.has_alternatives()
            && self.only_alternatives()
    }

    /// Whether an object was probably written in place of its member `name`: one of its unknown names is required
    /// there.
    pub(super) fn lacks_only(&self, name: &str, unknown: &[Cow<'_, str>]) -> bool {
        let member = self.properties.get(name);
        member.is_some_and(|member| {
            let own = |name: &Cow<'_, str>| member.required.iter().any(|own| own == name);
            unknown.iter().any(own)
        })
    }

    /// Whether the shape is a list, of any length, of numbers or of short lists of numbers.
    pub(super) fn is_long_list_of_numbers(&self) -> bool {
        let number = |shape: &Shape| matches!(shape.types(), [Type::Number | Type::Integer]);
        // the lengths of inner lists are not compared with the limits of a walk
        let short = |items: &Shape| items.max_items.is_some();
        let within = |items: &Shape| match items.items.as_deref() {
            Some(inner) => short(items) && number(inner),
            None => number(items),
        };
        self.max_items.is_none() && self.items.as_deref().is_some_and(within)
    }

    pub(super) fn branches(&self) -> &[Shape] {
        if self.any_of.is_empty() {
            &self.one_of
        } else {
            &self.any_of
        }
    }

    /// Whether the whole value must be known to decide which parts of the shape apply.
    pub(super) fn has_alternatives(&self) -> bool {
        !self.branches().is_empty() || self.condition.is_some()
    }

    /// Whether the shape says nothing of the value itself: neither types nor names of members. It may have
    /// alternatives.
    pub(super) fn only_alternatives(&self) -> bool {
        self.types().is_empty() && self.properties.is_empty() && self.required.is_empty()
    }

    /// Whether serde keeps the whole value in memory until it knows the alternative. It does not where the only
    /// alternative to a value is null.
    pub(super) fn is_kept(&self) -> bool {
        let by_kind = self.one_of.iter().any(|branch| branch.kind().is_some());
        by_kind || !self.any_of.is_empty() && !self.any_of.iter().any(Shape::is_null)
    }

    /// Whether the shape allows null only.
    pub(super) fn is_null(&self) -> bool {
        self.types() == [Type::Null]
    }

    /// The value that the member `kind` of an object of this shape must have.
    pub(super) fn kind(&self) -> Option<&str> {
        self.properties.get("kind")?.only.as_deref()
    }

    /// Whether a list may have this length.
    pub(super) fn has_length(&self, count: usize) -> bool {
        let excluded = |shape: &Shape| shape.min_items <= count && Some(count) <= shape.max_items;
        count >= self.min_items
            && self.max_items.is_none_or(|most| count <= most)
            && !self.not.as_deref().is_some_and(excluded)
    }

    /// The largest number of items of a list of this shape.
    pub(super) fn most_items(&self) -> Option<usize> {
        self.max_items
    }

    /// The allowed lengths of a list, in words.
    pub(super) fn lengths(&self) -> String {
        let Some(most) = self.max_items else {
            return format!("at least {}", self.min_items);
        };
        let allowed = (self.min_items..=most).filter(|count| self.has_length(*count));
        let allowed: Vec<String> = allowed.map(|count| count.to_string()).collect();
        allowed.join(" or ")
    }

    fn find_forms(&mut self) {
        let inside = self.properties.values_mut().chain(&mut self.any_of);
        let boxed = [
            &mut self.additional_properties,
            &mut self.items,
            &mut self.then,
            &mut self.otherwise,
        ];
        inside
            .chain(&mut self.one_of)
            .chain(boxed.into_iter().flatten().map(|shape| &mut **shape))
            .for_each(Shape::find_forms);
        self.forms = forms(&self.one_of);
    }
}

/// For each form of an object, the names that only this form requires, if these distinguish the forms.
fn forms(branches: &[Shape]) -> Option<Vec<Vec<String>>> {
    if branches.is_empty() || branches.iter().any(|branch| !branch.types().is_empty()) {
        return None;
    }
    let asked: Vec<Vec<&str>> = branches.iter().map(all_required).collect();
    let alone = |name: &&str| asked.iter().filter(|form| form.contains(name)).count() == 1;
    let own = |form: &Vec<&str>| -> Vec<String> {
        let names = form.iter().filter(|name| alone(name));
        names.map(|name| (*name).to_owned()).collect()
    };
    let forms: Vec<Vec<String>> = asked.iter().map(own).collect();
    forms.iter().all(|form| !form.is_empty()).then_some(forms)
}

/// The names that a form requires, including those of its own alternatives.
fn all_required(form: &Shape) -> Vec<&str> {
    let further = form.branches().iter().flat_map(all_required);
    let own = form.required.iter().map(String::as_str);
    own.chain(further).collect()
}

/// How a schema is simplified: its references are replaced by the definitions that they name, and what only informs
/// readers is left out. Our types do not contain themselves.
#[derive(Clone, Copy)]
enum Plain {
    OfProblem,
    OfBody,
}

impl Plain {
    fn schema(self, schema: &Value, whole: &Value) -> Value {
        let Value::Object(words) = schema else {
            return json!({ "never": *schema == Value::Bool(false) });
        };
        let place = words.get("$ref").and_then(Value::as_str);
        if let Some(place) = place
            && let Some(named) = whole.pointer(place.trim_start_matches('#'))
        {
            let problem = matches!(self, Plain::OfBody) && place.ends_with("/Problem");
            if !problem {
                return self.schema(named, whole);
            }
            let mut problem = Plain::OfProblem.schema(named, whole);
            problem["problem"] = true.into();
            return problem;
        }
        let kept = words
            .iter()
            .filter_map(|(word, value)| self.keyword(word, value, whole));
        Value::Object(kept.collect())
    }

    fn keyword(self, word: &str, value: &Value, whole: &Value) -> Option<(String, Value)> {
        let each = |named: &Map<String, Value>| -> Value {
            let each = named
                .iter()
                .map(|(name, one)| (name.clone(), self.schema(one, whole)));
            Value::Object(each.collect())
        };
        let plain = match (word, value) {
            ("description" | "default" | "format" | "title" | "$schema" | "$defs", _) => {
                return None;
            }
            ("const" | "required" | "type", _) => value.clone(),
            ("properties", Value::Object(named)) => each(named),
            (_, Value::Array(list)) => list.iter().map(|one| self.schema(one, whole)).collect(),
            (_, Value::Object(_) | Value::Bool(_)) if !LEFT_TO_OPERATIONS.contains(&word) => {
                self.schema(value, whole)
            }
            _ => value.clone(),
        };
        match (self, word) {
            (Plain::OfBody, "maxItems") => Some(("atMost".to_owned(), plain)),
            (Plain::OfBody, word) if LEFT_TO_OPERATIONS.contains(&word) => None,
            _ => Some((word.to_owned(), plain)),
        }
    }
}

/// Keywords that are not checked in request bodies: the code that serves the request checks them.
const LEFT_TO_OPERATIONS: &[&str] = &[
    "maxLength",
    "maxProperties",
    "maximum",
    "minItems",
    "minLength",
    "minimum",
    "pattern",
    "uniqueItems",
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_published_alternative_takes_null_for_absent() {
        let schema = schema();
        let material = &schema["$defs"]["Material"];
        let (null, given) = (json!({"type": "null"}), json!({"not": {"type": "null"}}));
        assert_eq!(material["if"]["properties"]["orthotropic"], given);
        assert_eq!(material["then"]["properties"]["youngs_modulus"], null);
        let pressure = &schema["$defs"]["Load"]["oneOf"][0];
        assert_eq!(pressure["properties"]["traction"], null);
        assert_eq!(pressure["properties"]["pressure"], given);
        assert_eq!(
            schema["$defs"]["MeshInput"]["oneOf"][0]["properties"]["grid"],
            given
        );
        // names that are unknown stay refused
        assert_eq!(schema["additionalProperties"], json!(false));
    }

    #[test]
    fn every_keyword_of_the_schema_is_supported() {
        let schema = of_problem();
        let shape = shape(&schema, &schema).unwrap();
        assert!(shape.properties.contains_key("contacts"));
        for (keyword, value) in [("pattern", json!("a")), ("uniqueItems", json!(true))] {
            let mut other = schema.clone();
            other["properties"]["quadrature"][keyword] = value;
            assert!(super::shape(&other, &other).is_err(), "{keyword}");
        }
    }

    #[test]
    fn the_forms_of_a_load_are_recognised_by_their_own_required_names() {
        let loads = PROBLEM.properties["loads"].items.as_ref().unwrap();
        let forms = loads.forms.as_ref().unwrap();
        assert_eq!(forms[0], ["pressure"]);
        assert_eq!(forms[2], ["normal", "tangential"]);
    }
}
