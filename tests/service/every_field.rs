//! Every field of every message of problems and answers is converted under its name, in both directions.
//! The messages are made from the contract alone, with a different value in every field: two fields of the same
//! type that are interchanged are found, and new fields are included automatically.

use base::{event::Event, job::Job, mesh::MeshInfo, run};
use prost::Message;
use prost_reflect::{
    DynamicMessage, EnumDescriptor, FieldDescriptor, Kind, MapKey, MessageDescriptor, Value,
};
use rpc::{convert, pb};
use serde::de::DeserializeOwned;
use serde_json::{Value as Json, json};
use solver::{
    error::Violation,
    problem::Problem,
    solution::{ContactProfile, Warning, WarningCode},
};

use crate::by_name::{assert_same, descriptor, dynamic, read};

/// How many times every message is filled, each time with the next of its alternatives: as often as any has
/// alternatives.
fn rounds() -> usize {
    let problem = descriptor("Problem");
    let messages = problem.parent_pool().all_messages();
    let own = messages.filter(|message| message.package_name() == "signorini.v1");
    let oneofs: Vec<_> = own
        .flat_map(|message| message.oneofs().collect::<Vec<_>>())
        .collect();
    let most = oneofs.iter().map(|oneof| oneof.fields().count()).max();
    let forms = FORMS.iter().map(|(_, forms)| forms.len());
    forms.chain(most).max().unwrap_or_default()
}

#[test]
fn every_field_of_a_problem_is_read_as_its_json() {
    for round in 0..rounds() {
        let filled = Filler { round, count: 0 }.message(&descriptor("Problem"));
        let expected: Problem = serde_json::from_value(read(&filled)).unwrap();
        let message: pb::Problem = filled.transcode_to().unwrap();
        let problem: Problem = convert::read(message).unwrap();
        assert_same(&json!(problem), &json!(expected), &format!("round {round}"));
    }
}

#[test]
fn every_field_of_a_problem_is_written_as_its_json() {
    for round in 0..rounds() {
        let filled = Filler { round, count: 0 }.message(&descriptor("Problem"));
        let problem: Problem = serde_json::from_value(read(&filled)).unwrap();
        let message = dynamic("Problem", &pb::Problem::from(problem));
        assert_same(&read(&message), &read(&filled), &format!("round {round}"));
    }
}

#[test]
fn every_field_of_an_answer_is_written_as_its_json() {
    answer::<Job, pb::Job>("Job");
    answer::<Event, pb::Event>("Event");
    answer::<run::Summary, pb::Summary>("Summary");
    answer::<ContactProfile, pb::ContactProfile>("ContactProfile");
    answer::<MeshInfo, pb::MeshInfo>("MeshInfo");
    answer::<Violation, pb::Violation>("Violation");
    answer::<Warning, pb::Warning>("Warning");
}

fn answer<T: DeserializeOwned + Into<M>, M: Message>(name: &str) {
    for round in 0..rounds() {
        let filled = Filler { round, count: 0 }.message(&descriptor(name));
        let filled = with_severities(read(&filled));
        let json = with_links(filled.clone());
        // it is sent, but never stored
        if json["type"] == "keep_alive" {
            continue;
        }
        let ours: T = serde_json::from_value(json).unwrap();
        let message = dynamic(name, &ours.into());
        assert_same(&read(&message), &filled, &format!("{name}, round {round}"));
    }
}

/// The severity of a warning is that of its code, whatever was read.
fn with_severities(mut answer: Json) -> Json {
    if let Some(code) = answer.get("severity").and(answer.get("code"))
        && let Ok(code) = serde_json::from_value::<WarningCode>(code.clone())
    {
        answer["severity"] = json!(code.severity());
    }
    match &mut answer {
        Json::Array(all) => all
            .iter_mut()
            .for_each(|one| *one = with_severities(one.take())),
        Json::Object(all) => all
            .values_mut()
            .for_each(|one| *one = with_severities(one.take())),
        _ => {}
    }
    answer
}

/// A job has links over REST, but not in messages.
fn with_links(mut answer: Json) -> Json {
    for place in ["", "/job"] {
        let job = answer.pointer_mut(place);
        if let Some(job) = job.filter(|job| job["max_attempts"].is_number()) {
            job["links"] = json!({});
        }
    }
    answer
}

/// Fields that are alternatives without being in a `oneof`. Each round has those of one of the lines, beside all
/// fields that are in none.
const FORMS: &[(&str, &[&[&str]])] = &[
    (
        "Material",
        &[&["youngs_modulus", "poissons_ratio"], &["orthotropic"]],
    ),
    (
        "Load",
        &[
            &["boundary", "pressure"],
            &["boundary", "traction"],
            &["boundary", "normal", "tangential"],
            &["boundary", "normal"],
            &["boundary", "tangential"],
            &["boundary", "nodal"],
            &["nodes", "force"],
            &["body_force"],
            &["gravity"],
            &["rotation"],
            &["group", "temperature"],
            &["nodal_temperature"],
        ],
    ),
];

/// Fills messages, each field with the next value.
struct Filler {
    round: usize,
    count: usize,
}

impl Filler {
    fn message(&mut self, of: &MessageDescriptor) -> DynamicMessage {
        let mut message = DynamicMessage::new(of.clone());
        for field in of.fields() {
            if self.is_chosen(of.name(), &field) {
                let value = self.field(of.name(), &field);
                message.set_field(&field, value);
            }
        }
        message
    }

    /// Whether the field, if it is one of several alternatives, is the one of this round.
    fn is_chosen(&self, message: &str, field: &FieldDescriptor) -> bool {
        if let Some(alternatives) = field.containing_oneof() {
            let mut alternatives = alternatives.fields();
            let count = alternatives.len();
            if alternatives.nth(self.round % count).as_ref() != Some(field) {
                return false;
            }
        }
        let forms = FORMS.iter().find(|(name, _)| *name == message);
        forms.is_none_or(|(_, forms)| {
            let chosen = forms[self.round % forms.len()];
            let in_a_form = forms.iter().any(|form| form.contains(&field.name()));
            chosen.contains(&field.name()) || !in_a_form
        })
    }

    fn field(&mut self, message: &str, field: &FieldDescriptor) -> Value {
        let kind = field.kind();
        if field.is_map() {
            let kind = kind.as_message().unwrap().map_entry_value_field().kind();
            let mut entry = || {
                let name = self.one(message, "", &Kind::String);
                (
                    MapKey::String(name.as_str().unwrap().into()),
                    self.one(message, "", &kind),
                )
            };
            return Value::Map([entry(), entry()].into());
        }
        if field.is_list() {
            let entries = match message {
                "Element" => [6, 8][self.round % 2],
                "Edge3" => 3,
                _ => 2,
            };
            let mut entry = |_| self.one(message, field.name(), &kind);
            return Value::List((0..entries).map(&mut entry).collect());
        }
        self.one(message, field.name(), &kind)
    }

    fn one(&mut self, message: &str, field: &str, kind: &Kind) -> Value {
        self.count += 1;
        let count = self.count;
        match kind {
            // so that any two of them differ in some round
            Kind::Bool => Value::Bool((count >> (self.round % 8)) & 1 == 1),
            Kind::Int32 => Value::I32(count as i32),
            Kind::Int64 => Value::I64(count as i64),
            Kind::Uint32 => Value::U32(count as u32),
            Kind::Uint64 => Value::U64(count as u64),
            Kind::Double => Value::F64(count as f64 + 0.25),
            Kind::String => Value::String(text(message, field, count)),
            Kind::Enum(names) => Value::EnumNumber(self.named(names)),
            Kind::Message(message) if message.name() == "Timestamp" => {
                let mut time = DynamicMessage::new(message.clone());
                time.set_field_by_name("seconds", Value::I64(count as i64));
                time.set_field_by_name("nanos", Value::I32(1000 * count as i32));
                Value::Message(time)
            }
            Kind::Message(message) => Value::Message(self.message(message)),
            other => panic!("{other:?} is in no problem and no answer"),
        }
    }

    /// Any value except the unspecified one.
    fn named(&self, names: &EnumDescriptor) -> i32 {
        let specified = names.values().len() - 1;
        names
            .values()
            .nth(1 + (self.count + self.round) % specified)
            .unwrap()
            .number()
    }
}

/// A unique text, for fields where any text is valid.
fn text(message: &str, field: &str, count: usize) -> String {
    match (message, field) {
        ("Job", "id" | "cached_from" | "parent") => {
            format!("job_00000000-0000-7000-8000-{count:012}")
        }
        ("Job", "sweep") => format!("sweep_00000000-0000-7000-8000-{count:012}"),
        ("Job", "reason") => "timed_out".into(),
        ("QueuePosition", "reason") => "paused".into(),
        ("Violation", "reason") => "missing".into(),
        ("Warning", "code") => "no_contact".into(),
        ("StageEvent", "stage") => "factor".into(),
        ("Iteration" | "Summary", "stage") => "inner".into(),
        _ => format!("text {count}"),
    }
}
