//! The members of an object in a JSON text, whose values are not parsed.

use std::{borrow::Cow, fmt};

use serde::{
    Deserialize, Deserializer,
    de::{IgnoredAny, MapAccess, Visitor},
};
use serde_json::value::RawValue;

/// Members of an object with their names, in the order of the text.
pub(super) type Named<'a> = Vec<(Cow<'a, str>, &'a RawValue)>;

/// The first members of an object, at most `most`; none if the text is no object.
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
