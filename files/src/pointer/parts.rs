//! The parts of a list or an object in a JSON text, without parsing them.

use std::{borrow::Cow, fmt};

use serde::{
    Deserialize, Deserializer,
    de::{IgnoredAny, MapAccess, SeqAccess, Visitor},
};
use serde_json::value::RawValue;

/// The members of an object with their names, in order.
pub(crate) type Named<'a> = Vec<(Cow<'a, str>, &'a RawValue)>;

/// The first items of a list, and their total number.
pub(crate) struct List<'a> {
    pub(crate) items: Vec<&'a RawValue>,
    pub(crate) count: usize,
}

/// The first items of a list; none if the text is no list.
pub(crate) fn list(text: &str, most: usize) -> Option<List<'_>> {
    let mut reader = serde_json::Deserializer::from_str(text);
    struct Read(usize);
    impl<'de> Visitor<'de> for Read {
        type Value = List<'de>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a list")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<List<'de>, A::Error> {
            let mut items = vec![];
            while items.len() < self.0
                && let Some(item) = list.next_element()?
            {
                items.push(item);
            }
            let mut count = items.len();
            if count == self.0 {
                while list.next_element::<IgnoredAny>()?.is_some() {
                    count += 1;
                }
            }
            Ok(List { items, count })
        }
    }
    reader.deserialize_seq(Read(most)).ok()
}

/// The first members of an object; none if the text is no object.
pub(crate) fn members(text: &str, most: usize) -> Option<Named<'_>> {
    #[derive(Deserialize)]
    struct Name<'a>(#[serde(borrow)] Cow<'a, str>);
    struct Read(usize);
    impl<'de> Visitor<'de> for Read {
        type Value = Named<'de>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("an object")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Named<'de>, A::Error> {
            let mut members = vec![];
            while let Some(Name(name)) = map.next_key()? {
                if members.len() < self.0 {
                    members.push((name, map.next_value()?));
                } else {
                    map.next_value::<IgnoredAny>()?;
                }
            }
            Ok(members)
        }
    }
    let mut reader = serde_json::Deserializer::from_str(text);
    reader.deserialize_map(Read(most)).ok()
}
