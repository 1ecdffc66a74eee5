//! What a request may say beside its body: each parameter once, for both protocols. A skin, or a verb, names it,
//! says which values it may have and what they mean; reading, range, error and description follow from that.

mod parameter;
mod values;

pub use parameter::{Description, Parameter, Place, Variable};
pub use values::{Seconds, Text, Times, Values, Whole, Words};
