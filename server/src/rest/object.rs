//! Reading a JSON object field by field, with all errors reported together.

use std::{borrow::Cow, collections::BTreeMap, fmt, marker::PhantomData};

use serde::{
    Deserialize, Deserializer,
    de::{DeserializeOwned, IgnoredAny, MapAccess, SeqAccess, Visitor},
};
use serde_json::value::RawValue;
use solver::error::{Findings, Reason, Violation, escape, shortened};

use crate::{error::ApiError, violations};

/// The content of a body whose JSON is well formed, or its violations.
pub(super) type Read<T> = Result<T, Vec<Violation>>;

/// Most fields of an object: more than any has, and enough to report a hundred unknown ones.
const MOST_FIELDS: usize = 1024;

/// An object whose fields are taken out one by one; all violations are reported at the end.
pub(super) struct Object<'a> {
    fields: BTreeMap<Cow<'a, str>, &'a RawValue>,
    pub(super) violations: Findings,
}

impl<'a> Object<'a> {
    /// The object in a text; `expected` describes it in the error if the text is something else.
    pub(super) fn open(text: &'a str, expected: &str) -> Result<Self, ApiError> {
        if text.trim().is_empty() {
            let nothing = format!("the body is empty; expected {expected}");
            return Err(ApiError::MalformedJson(nothing));
        }
        if let Some(place) = files::json::too_deep(text) {
            let most = files::json::MOST_NESTED;
            let too_deep = format!("{place}; expected at most {most}");
            return Err(ApiError::MalformedJson(too_deep));
        }
        // first only the syntax, so that a well-formed array is reported as the wrong type
        let whole: &RawValue = serde_json::from_str(text)
            .map_err(|error| ApiError::MalformedJson(error.to_string()))?;
        let Members {
            fields,
            repeated,
            count,
        } = serde_json::from_str(whole.get())
            .map_err(|_| ApiError::InvalidProblem(vec![wrong_type("", whole, expected)]))?;
        if count > MOST_FIELDS {
            return Err(ApiError::InvalidProblem(vec![Violation {
                pointer: String::new(),
                reason: Reason::TooMany,
                got: format!("an object of {count} fields"),
                expected: expected.into(),
                hint: "The bodies of all requests are described in /openapi.json.".into(),
            }]));
        }
        let mut violations = Findings::default();
        for name in repeated {
            violations.add(Violation {
                pointer: pointer(&name),
                reason: Reason::DuplicateName,
                got: "the name twice".into(),
                expected: "each name once".into(),
                hint: "Leave one of them out; one would be ignored.".into(),
            });
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

    /// A field as it is written.
    pub(super) fn take_raw(&mut self, name: &str) -> Option<&'a RawValue> {
        self.fields.remove(name)
    }

    /// An optional field; null means absent.
    pub(super) fn take<T: DeserializeOwned>(&mut self, name: &str, expected: &str) -> Option<T> {
        let raw = self.fields.remove(name).filter(|raw| !is_null(raw))?;
        let value = serde_json::from_str(raw.get());
        value.map_err(|_| self.wrong_type(name, raw, expected)).ok()
    }

    /// An optional field that is an object; null means absent. Serde also takes a list of a structure's fields in order.
    pub(super) fn take_object<T: DeserializeOwned>(
        &mut self,
        name: &str,
        expected: &str,
    ) -> Option<T> {
        let list = self
            .fields
            .get(name)
            .filter(|raw| raw.get().starts_with('['));
        if list.is_none() {
            return self.take(name, expected);
        }
        let raw = self.fields.remove(name)?;
        self.wrong_type(name, raw, expected);
        None
    }

    /// Records that a field has the wrong type.
    pub(super) fn wrong_type(&mut self, name: &str, raw: &RawValue, expected: &str) {
        self.violations
            .add(wrong_type(&format!("/{name}"), raw, expected));
    }

    /// The content, if there are no violations and no unknown fields left.
    pub(super) fn finish<T>(mut self, known: &str, read: Option<T>) -> Read<T> {
        for name in self.fields.into_keys() {
            let hint = files::meant(&name, known.split(", "));
            self.violations.add(Violation {
                pointer: pointer(&name),
                reason: Reason::UnknownName,
                got: format!("{:?}", violations::quoted(&name)),
                expected: format!("one of {known}"),
                hint: hint.unwrap_or_else(|| "Check the spelling, or leave it out.".into()),
            });
        }
        match read {
            Some(read) => self.violations.into_result(read),
            None => Err(self.violations.into_violations()),
        }
    }
}

/// The members of an object, the names that occur twice, and the number of all. A map by itself would silently keep
/// only the last one of a name. Beyond [`MOST_FIELDS`] they are only counted.
#[derive(Default)]
struct Members<'a> {
    fields: BTreeMap<Cow<'a, str>, &'a RawValue>,
    repeated: Vec<Cow<'a, str>>,
    count: usize,
}

#[derive(Deserialize)]
struct Name<'a>(#[serde(borrow)] Cow<'a, str>);

impl<'de> Deserialize<'de> for Members<'de> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Read;
        impl<'de> Visitor<'de> for Read {
            type Value = Members<'de>;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut members = Members::default();
                while let Some(Name(name)) = map.next_key()? {
                    members.count += 1;
                    if members.count > MOST_FIELDS {
                        map.next_value::<IgnoredAny>()?;
                    } else if members.fields.contains_key(&name) {
                        members.fields.insert(name.clone(), map.next_value()?);
                        members.repeated.push(name);
                    } else {
                        members.fields.insert(name, map.next_value()?);
                    }
                }
                Ok(members)
            }
        }
        deserializer.deserialize_map(Read)
    }
}

/// The texts of the first `MOST` items of a list; the others are left out.
pub(super) struct First<'a, const MOST: usize>(pub(super) Vec<&'a RawValue>);

impl<'de, const MOST: usize> Deserialize<'de> for First<'de, MOST> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Read<const MOST: usize>;
        impl<'de, const MOST: usize> Visitor<'de> for Read<MOST> {
            type Value = First<'de, MOST>;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("a list")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
                let mut first = vec![];
                while first.len() < MOST
                    && let Some(item) = list.next_element()?
                {
                    first.push(item);
                }
                while list.next_element::<IgnoredAny>()?.is_some() {}
                Ok(First(first))
            }
        }
        deserializer.deserialize_seq(Read)
    }
}

/// An object of at most `MOST` texts, or of what else `T` is; the others are left out.
pub(super) struct Texts<const MOST: usize, T = String>(pub(super) BTreeMap<String, T>);

impl<'de, const MOST: usize, T: Deserialize<'de>> Deserialize<'de> for Texts<MOST, T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Read<const MOST: usize, T>(PhantomData<T>);
        impl<'de, const MOST: usize, T: Deserialize<'de>> Visitor<'de> for Read<MOST, T> {
            type Value = Texts<MOST, T>;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("an object of strings")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut texts = BTreeMap::new();
                while let Some((Name(name), text)) = map.next_entry()? {
                    if texts.len() < MOST {
                        texts.insert(name.into_owned(), text);
                    }
                }
                Ok(Texts(texts))
            }
        }
        deserializer.deserialize_map(Read(PhantomData))
    }
}

/// The place of a field, with the beginning of its name.
fn pointer(name: &str) -> String {
    format!("/{}", escape(&shortened(name, 80)))
}

fn is_null(raw: &RawValue) -> bool {
    raw.get() == "null"
}

/// The violation of a value of the wrong type.
fn wrong_type(pointer: &str, raw: &RawValue, expected: &str) -> Violation {
    Violation {
        pointer: pointer.into(),
        reason: Reason::WrongType,
        got: violations::quoted(raw.get()),
        expected: expected.into(),
        hint: "The bodies of all requests are described in /openapi.json.".into(),
    }
}
