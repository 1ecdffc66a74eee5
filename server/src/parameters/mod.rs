//! Parameters of requests, defined once for both protocols. A definition has a name, the allowed values, and their
//! meaning; reading, range check, error and description follow from it.

mod parameter;
mod values;

pub use parameter::{Description, Location, Parameter, Variable};
pub use values::{Integers, Seconds, Text, Times, Values, Words};
