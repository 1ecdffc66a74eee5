//! Finds out which of several alternatives a value is meant to be, from its type, its `kind` and its names.

use std::{borrow::Cow, iter};

use serde::Deserialize;
use serde::de::{Deserializer, IgnoredAny, MapAccess, Visitor};
use serde_json::value::RawValue;

use super::shape::{Shape, Type};
use super::words;
use solver::error::{Reason, Violation, either};

/// A function that makes a violation from the pointer to its place, which is not known yet.
pub(super) type Displaced = Box<dyn FnOnce(String) -> Violation>;

/// The features of a value that distinguish alternatives.
pub(super) struct Outline<'de> {
    pub(super) found: Type,
    /// The text of the value.
    text: &'de str,
    /// The JSON text of the member `kind`.
    kind: Option<&'de str>,
    /// The names of members that are not null, as far as they distinguish the alternatives.
    given: Vec<&'static str>,
}

impl<'de> Outline<'de> {
    pub(super) fn of(shape: &'static Shape, value: &'de RawValue) -> serde_json::Result<Self> {
        let text = value.get();
        let found = match text.as_bytes().first() {
            Some(b'{') => Type::Object,
            Some(b'[') => Type::Array,
            Some(b'"') => Type::String,
            Some(b't' | b'f') => Type::Boolean,
            Some(b'n') => Type::Null,
            _ => Type::Number,
        };
        let mut outline = Outline {
            found,
            text,
            kind: None,
            given: Vec::new(),
        };
        let kinds = shape
            .branches()
            .iter()
            .any(|branch| branch.kind().is_some());
        if found == Type::Object && (kinds || shape.forms.is_some()) {
            let names = shape.forms.iter().flatten().flatten().map(String::as_str);
            let reader = &mut serde_json::Deserializer::from_str(text);
            reader.deserialize_map(Members {
                outline: &mut outline,
                names: names.collect(),
            })?;
        }
        Ok(outline)
    }

    /// Whether the value has the type and the `kind` of an alternative; its other content is not checked.
    pub(super) fn resembles(&self, shape: &Shape) -> bool {
        let same =
            |only: &str| serde_json::from_str::<Cow<str>>(self.text).is_ok_and(|t| t == only);
        let branches = shape.branches();
        shape.allows(self.found)
            && shape.only.as_deref().is_none_or(same)
            && shape.kind().is_none_or(|kind| {
                let own = self.kind.and_then(|text| serde_json::from_str(text).ok());
                own.is_some_and(|own: String| own == kind)
            })
            && (branches.is_empty()
                || shape.kind().is_some()
                || branches.iter().any(|branch| self.resembles_nested(branch)))
    }

    /// Like [`resembles`](Self::resembles), but by type alone, for an alternative whose `kind` was not read.
    fn resembles_nested(&self, shape: &Shape) -> bool {
        let branches = shape.branches();
        shape.allows(self.found)
            && (branches.is_empty() || branches.iter().any(|branch| self.resembles_nested(branch)))
    }

    /// The number of the form that is meant: the only one of which the value has a name that no other form requires.
    /// The error is a violation that there is none, or several.
    pub(super) fn form(&self, forms: &'static [Vec<String>]) -> Result<usize, Displaced> {
        let given = |name: &String| self.given.contains(&name.as_str());
        let mut meant = (0..).zip(forms).filter(|(_, form)| form.iter().any(given));
        if let (Some((place, _)), None) = (meant.next(), meant.next()) {
            return Ok(place);
        }
        let names = forms.iter().flatten();
        let got: Vec<(&str, bool)> = names.map(|name| (name.as_str(), given(name))).collect();
        let (got, offers) = (
            either(&got),
            forms.iter().map(|form| words::listed(form, " and ")),
        );
        let expected = format!("exactly one of {}", offers.collect::<Vec<_>>().join(", "));
        let (reason, hint) = (Reason::WrongCount, "Choose one of the forms.");
        Err(Box::new(move |at| {
            Violation::new(at, reason, got, expected, hint)
        }))
    }

    /// The violation of a value that resembles no alternative, and the member that the violation concerns, if any.
    pub(super) fn no_alternative(
        &self,
        branches: &'static [Shape],
    ) -> (Option<&'static str>, Displaced) {
        let reason = Reason::UnknownAlternative;
        let kinds: Vec<&str> = branches.iter().filter_map(Shape::kind).collect();
        let quoted: Vec<String> = kinds.iter().map(|kind| format!("{kind:?}")).collect();
        let names = quoted.join(", ");
        let got = self.described();
        match (self.found, quoted.first()) {
            (Type::Object, Some(_)) => {
                let got = self.kind.map_or("nothing".to_owned(), words::value);
                let meant = words::meant(got.trim_matches('"'), kinds);
                let hint = meant.unwrap_or_else(|| "Choose one of the kinds.".to_owned());
                let expected = format!("one of {names}");
                let violation = move |at| Violation::new(at, reason, got, expected, hint);
                (Some("kind"), Box::new(violation))
            }
            (_, Some(first)) => {
                let expected = format!("an object with a `kind`, one of {names}");
                let hint = format!("Write it as {{\"kind\": {first}, …}}.");
                let violation = move |at| Violation::new(at, reason, got, expected, hint);
                (None, Box::new(violation))
            }
            (_, None) => {
                let mut offers: Vec<_> = branches.iter().flat_map(offers).collect();
                offers.dedup();
                let only = branches.iter().filter_map(|branch| branch.only.as_deref());
                let meant = words::meant(got.trim_matches('"'), only);
                let hint =
                    meant.unwrap_or_else(|| "Write the value in one of these forms.".to_owned());
                let expected = offers.join(" or ");
                let violation = move |at| Violation::new(at, reason, got, expected, hint);
                (None, Box::new(violation))
            }
        }
    }

    fn described(&self) -> String {
        words::value(self.text)
    }
}

/// The values that a shape allows, in words, without `null`.
fn offers(shape: &'static Shape) -> Vec<String> {
    match &shape.only {
        Some(only) => vec![format!("{only:?}")],
        None => {
            let types = shape.types().iter().filter(|own| **own != Type::Null);
            let names = types.map(|own| own.words().to_owned());
            let further = shape.branches().iter().flat_map(offers);
            iter::chain(names, further).collect()
        }
    }
}

/// Reads the members that distinguish alternatives.
struct Members<'o, 'de> {
    outline: &'o mut Outline<'de>,
    names: Vec<&'static str>,
}

impl<'de> Visitor<'de> for Members<'_, 'de> {
    type Value = ();

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<(), A::Error> {
        while let Some(Name(name)) = members.next_key()? {
            let known = self.names.iter().find(|known| **known == name);
            if name == "kind" {
                self.outline.kind = Some(members.next_value::<&RawValue>()?.get());
            } else if let Some(known) = known {
                let value: &RawValue = members.next_value()?;
                if value.get() != "null" && !self.outline.given.contains(known) {
                    self.outline.given.push(known);
                }
            } else {
                members.next_value::<IgnoredAny>()?;
            }
        }
        Ok(())
    }
}

#[derive(Deserialize)]
struct Name<'a>(#[serde(borrow)] Cow<'a, str>);
