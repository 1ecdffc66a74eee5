//! The idempotency key: the client's key for a request that it may repeat.

use base::values::Values;

use crate::parameters::Parameter;

/// The parameter of the idempotency key; over gRPC it is the field `request_id`.
pub const IDEMPOTENCY_KEY: Parameter<Keys> = Parameter {
    name: "Idempotency-Key",
    meaning: "Key chosen by the client for this request: a repetition with the same key returns what the first request created",
    values: Keys,
};

/// A valid idempotency key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key(pub(super) String);

/// The allowed values of the parameter: all valid keys.
#[derive(Clone, Copy, Debug)]
pub struct Keys;

/// The largest number of characters of a key.
const MAX_LENGTH: usize = 255;

impl Values for Keys {
    type Value = Key;

    /// The schema of keys: characters that HTTP allows in a header, without spaces at the ends.
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
