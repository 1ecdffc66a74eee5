//! A text of JSON with gaps, into which values are written.

use std::{fmt, ops::Range};

use serde::{
    Deserialize, Deserializer, Serialize,
    de::{IgnoredAny, SeqAccess, Visitor},
};
use serde_json::value::RawValue;

use super::parts::members;

/// A text of JSON with gaps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Template {
    text: String,
    /// In the order of the paths.
    gaps: Vec<Gap>,
    /// The gaps in the order of their places.
    order: Vec<usize>,
}

/// A place of a value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Gap {
    /// The text that the value replaces: empty for a member that the object there lacks.
    place: Range<usize>,
    /// Written before the value: the name of such a member.
    before: String,
    /// Written after it.
    after: String,
}

/// Where a pointer leads in a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// To this value.
    Value(Range<usize>),
    /// To a member that the object lacks.
    Absent {
        /// Where it begins, after its brace.
        inside: usize,
        /// Whether it has no members.
        empty: bool,
        /// The name.
        name: String,
    },
}

/// Why a pointer leads nowhere.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Nowhere {
    /// The pointer to the last value on the way.
    pub(super) parent: String,
    /// What was looked for there.
    pub(super) token: String,
    /// What is there: `an object`, `a list of 2`, `a value`.
    pub(super) found: String,
    /// The names in it, if it is an object.
    pub(super) names: Vec<String>,
}

impl Template {
    /// A text with a gap at each of these places, of which none is inside another.
    pub(super) fn new(text: &str, places: Vec<Place>) -> Template {
        let mut gaps: Vec<Gap> = Vec::with_capacity(places.len());
        for place in places {
            gaps.push(match place {
                Place::Value(place) => Gap {
                    place,
                    before: String::new(),
                    after: String::new(),
                },
                Place::Absent {
                    inside,
                    empty,
                    name,
                } => {
                    let here = |gap: &Gap| gap.place == (inside..inside);
                    let first = !gaps.iter().any(here);
                    let name = serde_json::Value::String(name);
                    Gap {
                        place: inside..inside,
                        before: match empty && !first {
                            true => format!(",{name}:"),
                            false => format!("{name}:"),
                        },
                        after: (if empty { "" } else { "," }).to_owned(),
                    }
                }
            });
        }
        let mut order: Vec<usize> = (0..gaps.len()).collect();
        // stable: members of one object in the order of the paths
        order.sort_by_key(|k| (gaps[*k].place.start, gaps[*k].place.end));
        Template {
            text: text.to_owned(),
            gaps,
            order,
        }
    }

    /// The text with these values; where there is none, it stays as it is.
    pub(super) fn filled(&self, values: &[Option<&str>]) -> String {
        let mut filled = String::with_capacity(self.text.len() + 64);
        let mut at = 0;
        for k in &self.order {
            let (Some(gap), Some(Some(value))) = (self.gaps.get(*k), values.get(*k)) else {
                continue;
            };
            filled.push_str(self.text.get(at..gap.place.start).unwrap_or_default());
            filled.push_str(&gap.before);
            filled.push_str(value);
            filled.push_str(&gap.after);
            at = gap.place.end;
        }
        filled.push_str(self.text.get(at..).unwrap_or_default());
        filled
    }

    pub(super) fn bytes(&self) -> usize {
        let more = |gap: &Gap| gap.before.len() + gap.after.len();
        self.text.len() + self.gaps.iter().map(more).sum::<usize>()
    }
}

/// Where a pointer (RFC 6901) leads. The text is well formed.
pub(super) fn locate(text: &str, tokens: &[String]) -> Result<Place, Nowhere> {
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
                let List { item, count } = item(trimmed, place.unwrap_or(usize::MAX));
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

/// Most members of an object that are looked at: no object of a problem with fixed names has more, and one with free
/// names is not read further.
const MOST_NAMES: usize = 1 << 14;

/// An item of a list; the text is one.
fn item(text: &str, place: usize) -> List<'_> {
    let mut reader = serde_json::Deserializer::from_str(text.trim_end());
    let read = serde::de::DeserializeSeed::deserialize(Item(place), &mut reader);
    read.unwrap_or(List {
        item: None,
        count: 0,
    })
}

struct Item(usize);

struct List<'a> {
    item: Option<&'a RawValue>,
    count: usize,
}

impl<'de> serde::de::DeserializeSeed<'de> for Item {
    type Value = List<'de>;

    fn deserialize<D: Deserializer<'de>>(self, reader: D) -> Result<List<'de>, D::Error> {
        struct Read(usize);
        impl<'de> Visitor<'de> for Read {
            type Value = List<'de>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<List<'de>, A::Error> {
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
                Ok(List { item, count })
            }
        }
        reader.deserialize_seq(Read(self.0))
    }
}
