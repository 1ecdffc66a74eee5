//! Public ids of jobs and sweeps.

use std::{borrow::Cow, fmt, marker::PhantomData};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::json;
use uuid::Uuid;

use crate::values::Values;

/// The public id of a job, `job_<uuidv7>`.
pub type JobId = Id<OfJob>;

/// The public id of a sweep, `sweep_<uuidv7>`.
pub type SweepId = Id<OfSweep>;

/// The public id of a record of the kind `K`: the word of the kind, and a UUID in lower case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Id<K>(pub Uuid, PhantomData<K>);

/// A kind of record that has public ids.
pub trait Kind {
    /// The word that ids begin with.
    const WORD: &'static str;
    /// The name of the schema of ids.
    const SCHEMA: &'static str;
}

/// Ids of jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum OfJob {}

impl Kind for OfJob {
    const WORD: &'static str = "job";
    const SCHEMA: &'static str = "JobId";
}

/// Ids of sweeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum OfSweep {}

impl Kind for OfSweep {
    const WORD: &'static str = "sweep";
    const SCHEMA: &'static str = "SweepId";
}

impl<K: Kind> Id<K> {
    /// A new id, which sorts after all earlier ones.
    pub fn new() -> Self {
        Uuid::now_v7().into()
    }

    /// Reads an id in its canonical form only, so that each record has one spelling.
    pub fn parse(text: &str) -> Option<Self> {
        let uuid = text.strip_prefix(K::WORD)?.strip_prefix('_')?;
        let id = Self::from(Uuid::try_parse(uuid).ok()?);
        (id.to_string() == text).then_some(id)
    }
}

impl<K> From<Uuid> for Id<K> {
    fn from(uuid: Uuid) -> Self {
        Id(uuid, PhantomData)
    }
}

impl<K: Kind> Default for Id<K> {
    fn default() -> Self {
        Id::new()
    }
}

impl<K: Kind> fmt::Display for Id<K> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}_{}", K::WORD, self.0)
    }
}

impl<K: Kind> Serialize for Id<K> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de, K: Kind> Deserialize<'de> for Id<K> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let wrong = || serde::de::Error::custom(format!("not a {} id", K::WORD));
        Id::parse(&text).ok_or_else(wrong)
    }
}

impl<K: Kind> JsonSchema for Id<K> {
    fn schema_name() -> Cow<'static, str> {
        K::SCHEMA.into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let word = K::WORD;
        json_schema!({
            "description": format!("The public id of a {word}, {word}_<uuidv7>."),
            "type": "string",
            "pattern": format!("^{word}_[0-9a-f]{{8}}-[0-9a-f]{{4}}-[0-9a-f]{{4}}-[0-9a-f]{{4}}-[0-9a-f]{{12}}$"),
        })
    }
}

/// All ids of a kind, as values of a parameter.
#[derive(Clone, Copy, Debug)]
pub struct Ids<K>(PhantomData<K>);

impl<K> Ids<K> {
    /// All ids of this kind.
    pub const fn all() -> Self {
        Ids(PhantomData)
    }
}

impl<K: Kind> Values for Ids<K> {
    type Value = Id<K>;

    fn schema(&self) -> serde_json::Value {
        json!({ "$ref": format!("#/components/schemas/{}", K::SCHEMA) })
    }

    fn expected(&self) -> String {
        format!("{}_ and a UUID in lower case", K::WORD)
    }

    fn read(&self, text: &str) -> Option<Id<K>> {
        Id::parse(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn has_one_valid_spelling<K: Kind + PartialEq + fmt::Debug>() {
        let id = Id::<K>::new();
        let text = id.to_string();
        assert_eq!(Id::parse(&text), Some(id));
        for other in [
            text.to_uppercase(),
            text.replace('-', ""),
            text.replace(K::WORD, "other"),
            text.replace('_', ""),
            format!("{text} "),
        ] {
            assert_eq!(Id::<K>::parse(&other), None, "{other}");
        }
    }

    #[test]
    fn an_id_has_one_valid_spelling() {
        has_one_valid_spelling::<OfJob>();
        has_one_valid_spelling::<OfSweep>();
    }
}
