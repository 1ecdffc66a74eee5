//! The client's key for a request that it may repeat.

use crate::parameters::{Parameter, Values};

/// The key; over gRPC the field `request_id`.
pub const IDEMPOTENCY_KEY: Parameter<Keys> = Parameter {
    name: "Idempotency-Key",
    meaning: "Key chosen by the client for this request: if it is repeated with the same key, the answer is what the first one created",
    values: Keys,
};

/// A valid key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key(pub(super) String);

/// The valid keys.
#[derive(Clone, Copy, Debug)]
pub struct Keys;

/// Characters of the longest key.
const MAX_LENGTH: usize = 255;

impl Values for Keys {
    type Value = Key;

    /// As HTTP allows them in a header, without spaces at the ends.
    fn schema(&self) -> serde_json::Value {
        let inner = MAX_LENGTH - 2;
        let pattern = format!("^[!-~]([ -~]{{0,{inner}}}[!-~])?$");
        serde_json::json!({ "type": "string", "pattern": pattern })
    }

    fn expected(&self) -> String {
        format!("1 … {MAX_LENGTH} characters, none of them a control character")
    }

    fn read(&self, text: &str) -> Option<Key> {
        let fits = (1..=MAX_LENGTH).contains(&text.chars().count());
        let plain = !text.chars().any(char::is_control);
        (fits && plain).then(|| Key(text.to_owned()))
    }
}
