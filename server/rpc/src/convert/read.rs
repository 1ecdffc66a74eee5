//! Reads types from messages. Errors that are possible in a message but not in JSON (an absent message, an unknown enum
//! number, a number that is not finite) are all found here, with the pointers that the JSON form would have.

use std::collections::BTreeMap;

use solver::error::{Findings, Reason, Violation, escape};

/// A type that can be read from a message, or from a field of a message.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not read from `{M}`",
    note = "a field of a message and the field of our struct with the same name have types between which there is no conversion",
    note = "`server/rpc/build/mirrors.rs` lists what is converted field by field, `server/rpc/src/convert` has the rest"
)]
pub trait FromMessage<M>: Sized {
    /// Reads a value from the message. `None` if this fails; `read` then has the violation.
    fn from_message(message: M, read: &mut Reader) -> Option<Self>;
}

/// A type of a field that a message may leave out.
pub trait FromOptional<M>: Sized {
    /// Reads the field; returns `default` if it is left out.
    fn from_optional(message: Option<M>, default: Self, read: &mut Reader) -> Option<Self>;
}

/// Reads a message, or returns all its violations.
pub fn read<M, T: FromMessage<M>>(message: M) -> Result<T, Vec<Violation>> {
    let mut read = Reader::default();
    let value = T::from_message(message, &mut read);
    read.found(value)
}

/// Reads a message: holds the current place in the message, and the violations found so far.
#[derive(Debug, Default)]
pub struct Reader {
    place: Vec<Token>,
    found: Findings,
}

/// A token of a JSON Pointer.
#[derive(Debug)]
enum Token {
    Name(&'static str),
    Key(String),
    Index(usize),
}

impl Reader {
    /// Reads the value of the field `name` from `message`.
    pub fn field<M, T: FromMessage<M>>(&mut self, name: &'static str, message: M) -> Option<T> {
        self.at(Token::Name(name), |read| T::from_message(message, read))
    }

    /// Reads the field `name`, which may be left out.
    pub fn optional<M, T: FromOptional<M>>(
        &mut self,
        name: &'static str,
        message: Option<M>,
        default: T,
    ) -> Option<T> {
        let read = |read: &mut Reader| T::from_optional(message, default, read);
        self.at(Token::Name(name), read)
    }

    /// Reads the entry `index` of a list.
    pub fn place<M, T: FromMessage<M>>(&mut self, index: usize, message: M) -> Option<T> {
        self.at(Token::Index(index), |read| T::from_message(message, read))
    }

    /// Calls `read` to read the parts of the field `name`, with this field as the current place.
    pub fn inside<T>(&mut self, name: &'static str, read: impl FnOnce(&mut Self) -> T) -> T {
        self.at(Token::Name(name), read)
    }

    /// Calls `read` to read the parts of the entry `index` of a list, with this entry as the current place.
    pub fn item<T>(&mut self, index: usize, read: impl FnOnce(&mut Self) -> T) -> T {
        self.at(Token::Index(index), read)
    }

    /// Reports that a required message is absent.
    pub fn missing<T>(&mut self, expected: &str) -> Option<T> {
        self.wrong(Reason::Missing, "nothing", expected)
    }

    /// Reports that none of the alternatives `kinds` of the field `kind` is set.
    pub fn no_kind<T>(&mut self, kinds: &str) -> Option<T> {
        let kinds = format!("one of {kinds}");
        self.at(Token::Name("kind"), |read| read.missing(&kinds))
    }

    /// Reports a number that is no value of the enum `name`.
    pub fn unknown<T>(&mut self, number: i32, name: &str) -> Option<T> {
        self.wrong(
            Reason::UnknownAlternative,
            number,
            &format!("a value of the enum {name}"),
        )
    }

    /// Reports a violation at the current place.
    pub fn wrong<T>(&mut self, reason: Reason, got: impl ToString, expected: &str) -> Option<T> {
        let hint = "See the comments in signorini.proto.";
        self.violation(Violation::new("", reason, got, expected, hint))
    }

    /// Reports a violation at or below the current place.
    pub fn violation<T>(&mut self, violation: Violation) -> Option<T> {
        if self.found.is_full() {
            self.found.count(1);
            return None;
        }
        let token = |token: &Token| match token {
            Token::Name(name) => format!("/{name}"),
            Token::Key(name) => format!("/{}", escape(name)),
            Token::Index(index) => format!("/{index}"),
        };
        let place: String = self.place.iter().map(token).collect();
        self.found.add(Violation {
            pointer: format!("{place}{}", violation.pointer),
            ..violation
        });
        None
    }

    /// Returns the value if there are no violations, otherwise the violations.
    pub fn found<T>(self, value: Option<T>) -> Result<T, Vec<Violation>> {
        match value {
            Some(value) => self.found.into_result(value),
            None => Err(self.found.into_violations()),
        }
    }

    fn at<T>(&mut self, token: Token, read: impl FnOnce(&mut Reader) -> T) -> T {
        self.place.push(token);
        let value = read(self);
        self.place.pop();
        value
    }
}

impl FromMessage<f64> for f64 {
    fn from_message(number: f64, read: &mut Reader) -> Option<f64> {
        if number.is_finite() {
            Some(number)
        } else {
            read.wrong(Reason::NotFinite, number, "a finite number")
        }
    }
}

macro_rules! as_it_is {
    ($($type:ty),*) => {
        $(impl FromMessage<$type> for $type {
            fn from_message(value: $type, _: &mut Reader) -> Option<$type> {
                Some(value)
            }
        })*
    };
}

as_it_is!(bool, u32, String);

/// Reads a name: an empty text means that it is left out.
impl FromMessage<String> for Option<String> {
    fn from_message(name: String, _: &mut Reader) -> Option<Self> {
        Some(Some(name).filter(|name| !name.is_empty()))
    }
}

impl<M, T: FromMessage<M>> FromMessage<Option<M>> for Option<T> {
    fn from_message(message: Option<M>, read: &mut Reader) -> Option<Self> {
        match message {
            Some(message) => T::from_message(message, read).map(Some),
            None => Some(None),
        }
    }
}

impl<M, T: FromMessage<M>> FromMessage<Vec<M>> for Vec<T> {
    fn from_message(messages: Vec<M>, read: &mut Reader) -> Option<Self> {
        let each = |(index, message)| read.place(index, message);
        // reads all of them, also after one that cannot be read
        let entries: Vec<Option<T>> = messages.into_iter().enumerate().map(each).collect();
        entries.into_iter().collect()
    }
}

/// Reads a list: an empty list means that it is left out.
impl<M, T: FromMessage<M>> FromMessage<Vec<M>> for Option<Vec<T>> {
    fn from_message(messages: Vec<M>, read: &mut Reader) -> Option<Self> {
        let some = !messages.is_empty();
        Vec::from_message(messages, read).map(|list| some.then_some(list))
    }
}

impl<M, T: FromMessage<M>> FromMessage<BTreeMap<String, M>> for BTreeMap<String, T> {
    fn from_message(messages: BTreeMap<String, M>, read: &mut Reader) -> Option<Self> {
        let each = |(name, message): (String, M)| {
            let value = read.at(Token::Key(name.clone()), |read| {
                T::from_message(message, read)
            });
            (name, value)
        };
        let entries: Vec<(String, Option<T>)> = messages.into_iter().map(each).collect();
        let entries = entries
            .into_iter()
            .map(|(name, value)| Some((name, value?)));
        entries.collect()
    }
}

impl<M, T: FromMessage<M>> FromOptional<M> for Option<T> {
    fn from_optional(message: Option<M>, default: Self, read: &mut Reader) -> Option<Self> {
        match message {
            Some(message) => T::from_message(message, read).map(Some),
            None => Some(default),
        }
    }
}

macro_rules! may_be_left_out {
    ($($type:ty),*) => {
        $(impl FromOptional<$type> for $type {
            fn from_optional(value: Option<$type>, default: Self, read: &mut Reader) -> Option<Self> {
                <$type>::from_message(value.unwrap_or(default), read)
            }
        })*
    };
}

may_be_left_out!(f64, u32);
