//! A parameter, and a variable of a path: name, meaning and values.

use serde_json::json;

use super::values::{Seconds, Values, Whole};
use crate::{error::ApiError, violations};

/// An input of a request: a query parameter or a header over REST, a field of a message over gRPC.
#[derive(Clone, Copy, Debug)]
pub struct Parameter<V> {
    /// Its name; the field's is the same.
    pub name: &'static str,
    /// What it does: one line, without a full stop.
    pub meaning: &'static str,
    /// Its values.
    pub values: V,
}

impl<V: Values> Parameter<V> {
    /// The value of this text.
    pub fn read(&self, text: &str) -> Result<V::Value, ApiError> {
        self.values.read(text).ok_or_else(|| self.bad(text))
    }

    /// The error that this is not one of its values.
    pub fn bad(&self, got: impl ToString) -> ApiError {
        ApiError::BadParameter {
            name: self.name,
            got: violations::name(&got.to_string()),
            expected: self.values.expected(),
        }
    }

    /// Of a query, with one value.
    pub fn describe(&self) -> Description {
        Description {
            place: Place::Query,
            name: self.name,
            schema: self.values.schema(),
            meaning: self.meaning,
            repeatable: false,
        }
    }

    /// Of a query, any number of times.
    pub fn describe_several(&self) -> Description {
        Description {
            schema: json!({ "type": "array", "items": self.values.schema() }),
            repeatable: true,
            ..self.describe()
        }
    }
}

impl Parameter<Whole> {
    /// The number of a message's field, if it is within bounds.
    pub fn check(&self, number: impl Into<i64>) -> Result<i64, ApiError> {
        let number = number.into();
        match self.values.0.contains(&number) {
            true => Ok(number),
            false => Err(self.bad(number)),
        }
    }
}

impl Parameter<Seconds> {
    /// The seconds of a message's field, if they are within bounds.
    pub fn check(&self, seconds: f64) -> Result<f64, ApiError> {
        match self.values.0.contains(&seconds) {
            true => Ok(seconds),
            false => Err(self.bad(seconds)),
        }
    }
}

/// A variable of a path. Any name that is not among its values is not found.
#[derive(Clone, Copy, Debug)]
pub struct Variable<V> {
    /// Its name in the path, in braces; the field's is the same.
    pub name: &'static str,
    /// What is named by it, for errors: `job`, `plot`.
    pub kind: &'static str,
    /// What it means: one line, without a full stop.
    pub meaning: &'static str,
    /// The names that there are.
    pub values: V,
}

impl<V: Values> Variable<V> {
    /// The value of this name.
    pub fn read(&self, text: &str) -> Result<V::Value, ApiError> {
        self.values.read(text).ok_or_else(|| {
            let (kind, name) = (self.kind, violations::name(text));
            let expected = self.values.expected();
            ApiError::NotFound(format!("there is no {kind} {name:?}: expected {expected}"))
        })
    }

    /// Of a path.
    pub fn describe(&self) -> Description {
        Description {
            place: Place::Path,
            name: self.name,
            schema: self.values.schema(),
            meaning: self.meaning,
            repeatable: false,
        }
    }
}

/// Where a request over REST has a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, strum::IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum Place {
    /// A segment of the path.
    Path,
    /// The query.
    Query,
    /// A header.
    Header,
}

/// A parameter as the description of the API has it.
#[derive(Clone, Debug)]
pub struct Description {
    /// Where it is sent.
    pub place: Place,
    /// Its name; with `{key}` at its end it is a name for each key.
    pub name: &'static str,
    /// Its values, as JSON Schema.
    pub schema: serde_json::Value,
    /// What it does.
    pub meaning: &'static str,
    /// It may be given several times.
    pub repeatable: bool,
}
