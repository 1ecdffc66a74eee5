//! Conversion between JSON and messages by the names in the contract alone, for tests that compare the service's own
//! conversions with it. Every field has one name in both; the few shapes that differ are listed here.

use std::collections::BTreeSet;

use base::time::Time;
use prost::Message;
use prost_reflect::{
    DescriptorPool, DynamicMessage, EnumDescriptor, FieldDescriptor, Kind, MapKey,
    MessageDescriptor, ReflectMessage, Value,
};
use rpc::pb;
use serde_json::{Map, Value as Json, json};

/// A message of the contract.
pub(crate) fn descriptor(name: &str) -> MessageDescriptor {
    let pool = DescriptorPool::decode(pb::DESCRIPTORS).unwrap();
    let message = pool.get_message_by_name(&format!("signorini.v1.{name}"));
    message.unwrap_or_else(|| panic!("{name} is no message"))
}

/// The message with the content of this JSON.
pub(crate) fn message<M: Message + Default>(name: &str, json: &Json) -> M {
    write(&descriptor(name), json).transcode_to().unwrap()
}

/// The JSON with the content of this message.
pub(crate) fn json(name: &str, message: &impl Message) -> Json {
    read(&dynamic(name, message))
}

/// A message with its descriptor.
pub(crate) fn dynamic(name: &str, message: &impl Message) -> DynamicMessage {
    DynamicMessage::decode(descriptor(name), message.encode_to_vec().as_slice()).unwrap()
}

/// Compares two JSON values, and panics with the first place where they differ. An absent value and an empty one are
/// equal, since messages do not distinguish them.
pub(crate) fn assert_same(one: &Json, other: &Json, what: &str) {
    if let Some(difference) = difference("", one, other) {
        panic!("{what}: {difference}");
    }
}

fn difference(place: &str, one: &Json, other: &Json) -> Option<String> {
    const NOTHING: &Json = &Json::Null;
    match (one, other) {
        (Json::Object(one), Json::Object(other)) => {
            let names: BTreeSet<&String> = one.keys().chain(other.keys()).collect();
            names.into_iter().find_map(|name| {
                let [one, other] = [one, other].map(|fields| fields.get(name).unwrap_or(NOTHING));
                difference(&format!("{place}/{name}"), one, other)
            })
        }
        (Json::Array(one), Json::Array(other)) if one.len() == other.len() => (0..)
            .zip(one.iter().zip(other))
            .find_map(|(i, (one, other))| difference(&format!("{place}/{i}"), one, other)),
        _ if one == other || (is_nothing(one) && is_nothing(other)) => None,
        _ => Some(format!("{place}: {one} and {other}")),
    }
}

fn is_nothing(json: &Json) -> bool {
    match json {
        Json::Null => true,
        Json::String(text) => text.is_empty(),
        Json::Array(values) => values.is_empty(),
        Json::Object(fields) => fields.values().all(is_nothing),
        Json::Bool(_) | Json::Number(_) => false,
    }
}

/// The form that JSON has instead of an object with the message's fields.
enum Shape {
    Object,
    /// A list of the fields.
    Array,
    /// The content of the only field.
    Content,
    /// An object with the fields of one alternative, and its name in the field named here.
    Tagged(&'static str),
    /// A number, or a list of two.
    BoundaryValue,
    /// Text.
    Time,
}

fn shape(message: &MessageDescriptor) -> Shape {
    match message.name() {
        "Point" | "Range" | "Vector" | "Expansion" | "Box" | "Traction" => Shape::Array,
        "Edge3" | "EdgeList" | "Element" | "ElementList" | "NodeList" | "NodalForces" | "Grids" => {
            Shape::Content
        }
        "Analysis" | "Obstacle" => Shape::Tagged("kind"),
        "Event" => Shape::Tagged("type"),
        "BoundaryValue" => Shape::BoundaryValue,
        "Timestamp" => Shape::Time,
        _ => Shape::Object,
    }
}

/// Fields that have another place in JSON: the message, its field, and the path to it.
const ELSEWHERE: &[(&str, &str, &[&str])] = &[
    ("Friction", "constant_bound", &["bound"]),
    ("Friction", "bound_table", &["bound"]),
    ("Mesh", "adaptive", &["refine"]),
    ("Iteration", "active", &["contact", "active"]),
    ("Iteration", "entered", &["contact", "entered"]),
    ("Iteration", "left", &["contact", "left"]),
    ("Iteration", "slip", &["friction", "slip"]),
    ("Iteration", "stick", &["friction", "stick"]),
    ("Iteration", "normal_force", &["force", "normal"]),
    ("Iteration", "tangential_force", &["force", "tangential"]),
];

/// A message as JSON.
pub(crate) fn read(message: &DynamicMessage) -> Json {
    let of = message.descriptor();
    let present = |field: &FieldDescriptor| !field.supports_presence() || message.has_field(field);
    let fields = of.fields().filter(present);
    let mut fields = fields.map(|field| {
        let value = entry(&message.get_field(&field), &field);
        (field, value)
    });
    match shape(&of) {
        Shape::Array => fields.map(|(_, value)| value).collect(),
        Shape::Content => fields.next().unwrap().1,
        Shape::BoundaryValue => match (fields.next().unwrap().1, fields.next()) {
            (start, None) => start,
            (start, Some((_, end))) => json!([start, end]),
        },
        Shape::Time => {
            let [seconds, nanos] =
                [fields.next(), fields.next()].map(|field| field.unwrap().1.as_i64().unwrap());
            json!(Time::from_micros(seconds * 1_000_000 + nanos / 1000))
        }
        Shape::Tagged(tag) => {
            let mut object = Map::new();
            for (field, value) in fields {
                match is_alternative(&field) {
                    true => {
                        object.insert(tag.into(), field.name().into());
                        object.extend(value.as_object().unwrap().clone());
                    }
                    false => {
                        object.insert(field.name().into(), value);
                    }
                }
            }
            Json::Object(object)
        }
        Shape::Object => {
            let mut object = json!({});
            for (field, value) in fields {
                let elsewhere = ELSEWHERE
                    .iter()
                    .find(|(message, name, _)| *message == of.name() && *name == field.name());
                let place = match elsewhere {
                    Some((_, _, [name])) => &mut object[*name],
                    Some((_, _, [outer, inner])) => &mut object[*outer][*inner],
                    _ => &mut object[field.name()],
                };
                *place = value;
            }
            if of.name() == "MeshInfo" {
                let mut take = |name: &str| object.as_object_mut().unwrap().remove(name);
                object["extent"] = json!([take("extent_x"), take("extent_y")]);
            }
            object
        }
    }
}

/// One of several, and not just a field that may be absent.
fn is_alternative(field: &FieldDescriptor) -> bool {
    field
        .containing_oneof()
        .is_some_and(|oneof| !oneof.is_synthetic())
}

/// The value of a field as JSON.
fn entry(value: &Value, field: &FieldDescriptor) -> Json {
    let kind = field.kind();
    match value {
        Value::List(values) => values.iter().map(|value| single(value, &kind)).collect(),
        Value::Map(values) => {
            let kind = kind.as_message().unwrap().map_entry_value_field().kind();
            let entry = |(name, value): (&MapKey, &Value)| {
                (name.as_str().unwrap().to_owned(), single(value, &kind))
            };
            Json::Object(values.iter().map(entry).collect())
        }
        value => single(value, &kind),
    }
}

fn single(value: &Value, kind: &Kind) -> Json {
    match value {
        Value::Bool(value) => json!(value),
        Value::I32(value) => json!(value),
        Value::I64(value) => json!(value),
        Value::U32(value) => json!(value),
        Value::U64(value) => json!(value),
        Value::F64(value) => json!(value),
        Value::String(value) => json!(value),
        Value::EnumNumber(number) => json!(word(kind.as_enum().unwrap(), *number)),
        Value::Message(message) => read(message),
        other => panic!("{other:?} is in no JSON answer"),
    }
}

/// The word of JSON for a value of an enum.
fn word(names: &EnumDescriptor, number: i32) -> String {
    let value = names.get_value(number).unwrap();
    let word = value.name().strip_prefix(&prefix(names)).unwrap();
    word.to_lowercase()
}

/// `NORMAL_OF_`, of the enum `NormalOf`.
fn prefix(names: &EnumDescriptor) -> String {
    let mut prefix = String::new();
    for letter in names.name().chars() {
        if letter.is_uppercase() && !prefix.is_empty() {
            prefix.push('_');
        }
        prefix.extend(letter.to_uppercase());
    }
    prefix + "_"
}

/// JSON as a message.
fn write(of: &MessageDescriptor, json: &Json) -> DynamicMessage {
    let mut message = DynamicMessage::new(of.clone());
    let mut set = |name: &str, json: &Json| {
        let field = of.get_field_by_name(name);
        let field = field.unwrap_or_else(|| panic!("{} has no field {name}", of.name()));
        message.set_field(&field, value(&field, json));
    };
    match shape(of) {
        Shape::Array => {
            for (field, json) in of.fields().zip(json.as_array().unwrap()) {
                set(field.name(), json);
            }
        }
        Shape::Content => set(of.fields().next().unwrap().name(), json),
        Shape::BoundaryValue => match json.as_array() {
            Some(pair) => {
                set("start", &pair[0]);
                set("end", &pair[1]);
            }
            None => set("start", json),
        },
        Shape::Time => panic!("no test writes points in time"),
        Shape::Tagged(tag) => {
            let mut content = json.as_object().unwrap().clone();
            let alternative = content.remove(tag).unwrap();
            for field in of.fields().filter(|field| !is_alternative(field)) {
                if let Some(json) = content.remove(field.name()) {
                    set(field.name(), &json);
                }
            }
            set(alternative.as_str().unwrap(), &Json::Object(content));
        }
        Shape::Object => {
            let present = json
                .as_object()
                .unwrap()
                .iter()
                .filter(|(_, json)| !json.is_null());
            for (name, json) in present {
                let name = match (of.name(), name.as_str(), json.is_object()) {
                    ("Friction", "bound", false) => "constant_bound",
                    ("Friction", "bound", true) => "bound_table",
                    ("Mesh", "refine", true) => "adaptive",
                    (_, name, _) => name,
                };
                set(name, json);
            }
        }
    }
    message
}

/// JSON as the value of a field.
fn value(field: &FieldDescriptor, json: &Json) -> Value {
    let kind = field.kind();
    if field.is_map() {
        let kind = kind.as_message().unwrap().map_entry_value_field().kind();
        let entry =
            |(name, json): (&String, &Json)| (MapKey::String(name.clone()), one(&kind, json));
        Value::Map(json.as_object().unwrap().iter().map(entry).collect())
    } else if field.is_list() {
        Value::List(
            json.as_array()
                .unwrap()
                .iter()
                .map(|json| one(&kind, json))
                .collect(),
        )
    } else {
        one(&kind, json)
    }
}

fn one(kind: &Kind, json: &Json) -> Value {
    match kind {
        Kind::Bool => Value::Bool(json.as_bool().unwrap()),
        Kind::Int32 => Value::I32(json.as_i64().unwrap() as i32),
        Kind::Uint32 => Value::U32(json.as_u64().unwrap() as u32),
        Kind::Double => Value::F64(json.as_f64().unwrap()),
        Kind::String => Value::String(json.as_str().unwrap().to_owned()),
        Kind::Enum(names) => {
            let name = prefix(names) + &json.as_str().unwrap().to_uppercase();
            Value::EnumNumber(names.get_value_by_name(&name).unwrap().number())
        }
        Kind::Message(message) => Value::Message(write(message, json)),
        other => panic!("{other:?} is in no problem"),
    }
}
