//! Reading a JSON object field by field, with all errors reported together.

use std::{collections::BTreeMap, fmt};

use serde::{
    Deserialize, Deserializer,
    de::{DeserializeOwned, MapAccess, Visitor},
};
use serde_json::value::RawValue;
use solver::error::{Findings, Reason, Violation, escape};

use crate::{error::ApiError, violations};

/// The content of a body whose JSON is well formed, or its violations.
pub(super) type Read<T> = Result<T, Vec<Violation>>;

/// An object whose fields are taken out one by one; all violations are reported at the end.
pub(super) struct Object<'a> {
    fields: BTreeMap<String, &'a RawValue>,
    pub(super) violations: Findings,
}

impl<'a> Object<'a> {
    /// The object in a text; `expected` describes it in the error if the text is something else.
    pub(super) fn open(text: &'a str, expected: &str) -> Result<Self, ApiError> {
        if text.trim().is_empty() {
            let nothing = format!("the body is empty; expected {expected}");
            return Err(ApiError::MalformedJson(nothing));
        }
        // first only the syntax, so that a well-formed array is reported as the wrong type
        let whole: &RawValue = serde_json::from_str(text)
            .map_err(|error| ApiError::MalformedJson(error.to_string()))?;
        let Pairs(pairs) = serde_json::from_str(whole.get())
            .map_err(|_| ApiError::InvalidProblem(vec![wrong_type("", whole, expected)]))?;
        let mut violations = Findings::default();
        let mut fields = BTreeMap::new();
        for (name, value) in pairs {
            if fields.insert(name.clone(), value).is_some() {
                violations.add(Violation {
                    pointer: format!("/{}", escape(&violations::quoted(&name))),
                    reason: Reason::DuplicateName,
                    got: "the name twice".into(),
                    expected: "each name once".into(),
                    hint: "Leave one of them out; one would be ignored.".into(),
                });
            }
        }
        Ok(Object { fields, violations })
    }

    /// Whether there is a field of that name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.fields.contains_key(name)
    }

    /// Whether there is a field of that name, and it is null.
    pub(super) fn is_null(&self, name: &str) -> bool {
        self.fields.get(name).is_some_and(|raw| is_null(raw))
    }

    /// A field that must be there.
    pub(super) fn require(
        &mut self,
        name: &str,
        expected: &str,
        hint: &str,
    ) -> Option<&'a RawValue> {
        let found = self.fields.remove(name);
        if found.is_none() {
            self.violations.add(Violation {
                pointer: format!("/{name}"),
                reason: Reason::Missing,
                got: "nothing".into(),
                expected: expected.into(),
                hint: hint.into(),
            });
        }
        found
    }

    /// An optional field; null means absent.
    pub(super) fn take<T: DeserializeOwned>(&mut self, name: &str, expected: &str) -> Option<T> {
        let raw = self.fields.remove(name).filter(|raw| !is_null(raw))?;
        let value = serde_json::from_str(raw.get());
        value.map_err(|_| self.wrong_type(name, raw, expected)).ok()
    }

    /// Records that a field has the wrong type.
    pub(super) fn wrong_type(&mut self, name: &str, raw: &RawValue, expected: &str) {
        self.violations
            .add(wrong_type(&format!("/{name}"), raw, expected));
    }

    /// The content, if there are no violations and no unknown fields left.
    pub(super) fn finish<T>(mut self, known: &str, read: Option<T>) -> Read<T> {
        for name in self.fields.into_keys() {
            let name = violations::quoted(&name);
            self.violations.add(Violation {
                pointer: format!("/{}", escape(&name)),
                reason: Reason::UnknownName,
                got: format!("{name:?}"),
                expected: format!("one of {known}"),
                hint: "Check the spelling, or leave it out.".into(),
            });
        }
        match read {
            Some(read) => self.violations.into_result(read),
            None => Err(self.violations.into_violations()),
        }
    }
}

/// The members of an object in their order. A map would silently keep only the last one of a name.
struct Pairs<'a>(Vec<(String, &'a RawValue)>);

impl<'de> Deserialize<'de> for Pairs<'de> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Members;
        impl<'de> Visitor<'de> for Members {
            type Value = Pairs<'de>;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut pairs = vec![];
                while let Some(pair) = map.next_entry()? {
                    pairs.push(pair);
                }
                Ok(Pairs(pairs))
            }
        }
        deserializer.deserialize_map(Members)
    }
}

fn is_null(raw: &RawValue) -> bool {
    raw.get() == "null"
}

fn wrong_type(pointer: &str, raw: &RawValue, expected: &str) -> Violation {
    Violation {
        pointer: pointer.into(),
        reason: Reason::WrongType,
        got: violations::quoted(raw.get()),
        expected: expected.into(),
        hint: "The bodies of all requests are described in /openapi.json.".into(),
    }
}
