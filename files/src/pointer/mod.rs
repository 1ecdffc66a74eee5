//! Finds the place in a JSON text that a JSON Pointer names.

mod parts;

use std::{fmt, ops::Range};

use serde::{
    Deserializer,
    de::{IgnoredAny, SeqAccess, Visitor},
};
use serde_json::value::RawValue;

pub(crate) use parts::members;

/// The place in a text that a JSON Pointer names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// An existing value, by its range in the text.
    Value(Range<usize>),
    /// A member that the object lacks.
    Absent {
        /// The place after the object's opening brace.
        inside: usize,
        /// Whether the object has no members.
        empty: bool,
        /// The name of the member.
        name: String,
    },
}

/// The reason why a JSON Pointer names no place in a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Nowhere {
    /// The pointer to the last existing value on the way.
    pub(crate) parent: String,
    /// The name or number that is missing in the last existing value.
    pub(crate) token: String,
    /// A description of the last existing value: `an object`, `a list of 2`, `a value`.
    pub(crate) found: String,
    /// The names in the last existing value, if it is an object.
    pub(crate) names: Vec<String>,
}

/// The line, from 1, of the value that a JSON Pointer names, or of the last existing value on the way there; none if
/// the text is not JSON.
pub fn line_of(text: &str, pointer: &str) -> Option<usize> {
    serde_json::from_str::<&RawValue>(text).ok()?;
    let unescaped = |token: &str| token.replace("~1", "/").replace("~0", "~");
    let tokens: Vec<String> = pointer.split('/').skip(1).map(unescaped).collect();
    let found = (0..=tokens.len())
        .rev()
        .find_map(|count| match locate(text, &tokens[..count]) {
            Ok(Place::Value(range)) => Some(range.start),
            Ok(Place::Absent { .. }) | Err(_) => None,
        });
    let start = found.unwrap_or_default();
    // a whole text may begin with empty lines
    let start = start + text[start..].len() - text[start..].trim_start().len();
    Some(1 + text[..start].matches('\n').count())
}

/// Finds the place that the tokens of a JSON Pointer (RFC 6901) name. The text must be well-formed JSON.
pub(crate) fn locate(text: &str, tokens: &[String]) -> Result<Place, Nowhere> {
    let mut value = text;
    let mut parent = String::new();
    // all parts are slices of the text
    let offset = |part: &str| part.as_ptr() as usize - text.as_ptr() as usize;
    for (k, token) in tokens.iter().enumerate() {
        let trimmed = value.trim_start();
        let nowhere = |found: String, names: Vec<String>| Nowhere {
            parent: parent.clone(),
            token: token.clone(),
            found,
            names,
        };
        let next = match trimmed.as_bytes().first() {
            Some(b'{') => {
                let members = members(trimmed.trim_end(), MOST_NAMES).unwrap_or_default();
                let found = members.iter().find(|(name, _)| name == token);
                match found {
                    Some((_, raw)) => raw.get(),
                    None if k + 1 == tokens.len() => {
                        return Ok(Place::Absent {
                            inside: offset(trimmed) + 1,
                            empty: members.is_empty(),
                            name: token.clone(),
                        });
                    }
                    None => {
                        let names = members.iter().take(20).map(|(name, _)| name.to_string());
                        return Err(nowhere("an object".into(), names.collect()));
                    }
                }
            }
            Some(b'[') => {
                // without a leading zero, as the RFC says
                let place = token.parse::<usize>().ok();
                let place = place.filter(|place| place.to_string() == *token);
                let Found { item, count } = item(trimmed, place.unwrap_or(usize::MAX));
                match item {
                    Some(raw) => raw.get(),
                    None => return Err(nowhere(format!("a list of {count}"), vec![])),
                }
            }
            _ => return Err(nowhere("a single value".into(), vec![])),
        };
        value = next;
        parent.push('/');
        parent.push_str(&solver::error::escape(token));
    }
    let start = offset(value);
    Ok(Place::Value(start..start + value.len()))
}

/// The largest number of members of an object that are searched: no object of a problem with fixed names has more, and
/// an object with free names is not read further.
const MOST_NAMES: usize = 1 << 14;

/// Finds an item of a list. The text must be a list.
fn item(text: &str, place: usize) -> Found<'_> {
    let mut reader = serde_json::Deserializer::from_str(text.trim_end());
    let read = serde::de::DeserializeSeed::deserialize(Item(place), &mut reader);
    read.unwrap_or(Found {
        item: None,
        count: 0,
    })
}

struct Item(usize);

struct Found<'a> {
    item: Option<&'a RawValue>,
    count: usize,
}

impl<'de> serde::de::DeserializeSeed<'de> for Item {
    type Value = Found<'de>;

    fn deserialize<D: Deserializer<'de>>(self, reader: D) -> Result<Found<'de>, D::Error> {
        struct Read(usize);
        impl<'de> Visitor<'de> for Read {
            type Value = Found<'de>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Found<'de>, A::Error> {
                let (mut item, mut count) = (None, 0);
                loop {
                    if count == self.0 {
                        match list.next_element::<&RawValue>()? {
                            Some(found) => item = Some(found),
                            None => break,
                        }
                    } else if list.next_element::<IgnoredAny>()?.is_none() {
                        break;
                    }
                    count += 1;
                }
                Ok(Found { item, count })
            }
        }
        reader.deserialize_seq(Read(self.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_of_a_value_or_of_the_last_one_before_it_is_found() {
        let text = "\n{\n \"a\": [1,\n  {\"b/c\": 2}],\n \"d\": 3\n}";
        for (pointer, line) in [
            ("", 2),
            ("/a", 3),
            ("/a/0", 3),
            ("/a/1/b~1c", 4),
            ("/a/7", 3),
            ("/d", 5),
            ("/e", 2),
            ("/e/f", 2),
            ("/d/x", 5),
        ] {
            assert_eq!(line_of(text, pointer), Some(line), "{pointer}");
        }
        assert_eq!(line_of("{", ""), None);
    }
}
