//! Converts types to messages.

use std::collections::BTreeMap;

/// A type that can be converted to a message, or to a field of a message.
#[diagnostic::on_unimplemented(
    message = "`{M}` is not written from `{Self}`",
    note = "a field of our struct and the field of the message with the same name have types between which there is no conversion",
    note = "`server/rpc/build/mirrors.rs` lists what is converted field by field, `server/rpc/src/convert` has the rest"
)]
pub trait IntoMessage<M> {
    /// Converts the value to the message.
    fn into_message(self) -> M;
}

macro_rules! as_it_is {
    ($($type:ty),*) => {
        $(impl IntoMessage<$type> for $type {
            fn into_message(self) -> $type {
                self
            }
        })*
    };
}

as_it_is!(bool, f64, i32, i64, u32, u64, String);

macro_rules! always_there {
    ($($type:ty),*) => {
        $(impl IntoMessage<Option<$type>> for $type {
            fn into_message(self) -> Option<$type> {
                Some(self)
            }
        })*
    };
}

always_there!(f64, u32);

impl IntoMessage<String> for Option<String> {
    fn into_message(self) -> String {
        self.unwrap_or_default()
    }
}

impl<M, T: IntoMessage<M>> IntoMessage<Option<M>> for Option<T> {
    fn into_message(self) -> Option<M> {
        self.map(T::into_message)
    }
}

impl<M, T: IntoMessage<M>> IntoMessage<Vec<M>> for Vec<T> {
    fn into_message(self) -> Vec<M> {
        self.into_iter().map(T::into_message).collect()
    }
}

impl<M, T: IntoMessage<M>> IntoMessage<Vec<M>> for Option<Vec<T>> {
    fn into_message(self) -> Vec<M> {
        self.unwrap_or_default().into_message()
    }
}

impl<M, T: IntoMessage<M>> IntoMessage<BTreeMap<String, M>> for BTreeMap<String, T> {
    fn into_message(self) -> BTreeMap<String, M> {
        let entries = self.into_iter();
        entries
            .map(|(name, value)| (name, value.into_message()))
            .collect()
    }
}
