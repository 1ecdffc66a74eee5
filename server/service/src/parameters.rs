//! Parameters of requests, defined once for both protocols: name, meaning and allowed values; reading, check, error and
//! description follow from a definition. Also variables of paths.

use serde_json::json;

use crate::{error::ApiError, violations};
use base::values::{Integers, Seconds, Values};

/// An input of a request: a query parameter or a header over REST, a field of a message over gRPC.
#[derive(Clone, Copy, Debug)]
pub struct Parameter<V> {
    /// The name of the parameter over REST, and of the field over gRPC.
    pub name: &'static str,
    /// The meaning: one line, without a full stop.
    pub meaning: &'static str,
    /// The allowed values.
    pub values: V,
}

impl<V: Values> Parameter<V> {
    /// Reads a value from its text.
    pub fn read(&self, text: &str) -> Result<V::Value, ApiError> {
        let read = self.values.read(text);
        read.ok_or_else(|| self.invalid(self.values.fault(text)))
    }

    /// The error for a value that is not allowed.
    pub fn invalid(&self, got: impl ToString) -> ApiError {
        ApiError::BadParameter {
            name: self.name,
            got: violations::quoted(&got.to_string()),
            expected: self.values.expected(),
        }
    }

    /// Describes the parameter as a query parameter with one value.
    pub fn describe(&self) -> Description {
        Description {
            location: Location::Query,
            kind: "",
            name: self.name,
            schema: self.values.schema(),
            meaning: self.meaning,
            repeatable: false,
        }
    }

    /// Describes the parameter as a query parameter that may be repeated.
    pub fn describe_several(&self) -> Description {
        Description {
            schema: json!({ "type": "array", "items": self.values.schema() }),
            repeatable: true,
            ..self.describe()
        }
    }
}

impl Parameter<Integers> {
    /// Checks that the number in a message's field is within bounds.
    pub fn check(&self, number: impl Into<i64>) -> Result<i64, ApiError> {
        let number = number.into();
        if self.values.0.contains(&number) {
            Ok(number)
        } else {
            Err(self.invalid(number))
        }
    }
}

impl Parameter<Seconds> {
    /// Checks that the seconds in a message's field are within bounds.
    pub fn check(&self, seconds: f64) -> Result<f64, ApiError> {
        if self.values.0.contains(&seconds) {
            Ok(seconds)
        } else {
            Err(self.invalid(seconds))
        }
    }
}

/// A variable of a path. A text that is not an allowed value is answered with *not found*.
#[derive(Clone, Copy, Debug)]
pub struct Variable<V> {
    /// The name in the path, in braces; also the name of the field over gRPC.
    pub name: &'static str,
    /// The kind of thing that the variable names, for errors: `job`, `plot`.
    pub kind: &'static str,
    /// The meaning: one line, without a full stop.
    pub meaning: &'static str,
    /// The names that exist.
    pub values: V,
}

impl<V: Values> Variable<V> {
    /// Reads a value from its name.
    pub fn read(&self, text: &str) -> Result<V::Value, ApiError> {
        self.values.read(text).ok_or_else(|| {
            let (kind, name) = (self.kind, violations::quoted(text));
            let expected = self.values.expected();
            ApiError::NotFound(format!("there is no {kind} {name:?}: expected {expected}"))
        })
    }

    /// Describes the variable as a variable of a path.
    pub fn describe(&self) -> Description {
        Description {
            location: Location::Path,
            kind: self.kind,
            name: self.name,
            schema: self.values.schema(),
            meaning: self.meaning,
            repeatable: false,
        }
    }
}

/// The place of a parameter in a request over REST.
#[derive(Clone, Copy, Debug, PartialEq, Eq, strum::IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum Location {
    /// The parameter is a segment of the path.
    Path,
    /// The parameter is in the query.
    Query,
    /// The parameter is a header.
    Header,
}

/// A parameter in the description of the API.
#[derive(Clone, Debug)]
pub struct Description {
    /// The place of the parameter in the request.
    pub location: Location,
    /// The kind of thing that a variable of a path names, such as `job`; empty for other parameters.
    pub kind: &'static str,
    /// The name; a name that ends in `{key}` stands for one parameter for each key.
    pub name: &'static str,
    /// The allowed values, as JSON Schema.
    pub schema: serde_json::Value,
    /// The meaning.
    pub meaning: &'static str,
    /// Whether the parameter may be given several times.
    pub repeatable: bool,
}
