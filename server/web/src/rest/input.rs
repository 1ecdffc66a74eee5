//! The inputs of operations apart from the body: path variables, query parameters, headers. Each one describes itself
//! for the list of operations, and is read and checked before the handler runs.

use axum::{
    RequestPartsExt,
    extract::RawPathParams,
    http::{HeaderMap, request::Parts},
};
use base::values::Values;
use service::{
    error::ApiError,
    parameters::{Description, Location, Parameter, Variable},
};

/// An input of an operation.
pub(super) trait Input {
    /// The value that a handler receives.
    type Value;

    /// Describes the input for the API: as one parameter, or as several that belong together.
    fn descriptions(&self) -> Vec<Description>;

    /// Reads and checks the input.
    fn extract(&self, raw: &RawInput<'_>) -> Result<Self::Value, ApiError>;
}

/// A request without its body, as sent.
#[derive(Debug)]
pub(super) struct RawInput<'a> {
    variables: Vec<(String, String)>,
    query: Vec<(String, String)>,
    pub(super) headers: &'a HeaderMap,
}

/// The part of a parameter's name that may be any key.
const ANY_KEY: &str = "{key}";

impl<'a> RawInput<'a> {
    /// The variables of the path, as the router found them; a malformed path is answered with *not found*.
    pub(super) async fn variables(parts: &mut Parts) -> Result<Vec<(String, String)>, ApiError> {
        let ill_formed = |_| ApiError::NotFound("the path is malformed".into());
        let found: RawPathParams = parts.extract().await.map_err(ill_formed)?;
        let owned = |(name, value): (&str, &str)| (name.to_owned(), value.to_owned());
        Ok(found.iter().map(owned).collect())
    }

    /// Splits a query into its parameters.
    pub(super) fn new(
        variables: Vec<(String, String)>,
        query: Option<&str>,
        headers: &'a HeaderMap,
    ) -> RawInput<'a> {
        let query = form_urlencoded::parse(query.unwrap_or_default().as_bytes());
        RawInput {
            variables,
            query: query.into_owned().collect(),
            headers,
        }
    }

    /// Refuses an unknown parameter, and a second value of a parameter that is not repeatable: they would be ignored,
    /// which the client would not notice.
    pub(super) fn check(&self, described: &[Description]) -> Result<(), ApiError> {
        let known = described
            .iter()
            .filter(|one| one.location == Location::Query);
        for (n, (name, value)) in self.query.iter().enumerate() {
            let Some(parameter) = known.clone().find(|one| matches(one.name, name)) else {
                let known: Vec<&str> = known.map(|one| one.name).collect();
                return Err(ApiError::UnknownParameter {
                    name: name.clone(),
                    known: if known.is_empty() {
                        "none".into()
                    } else {
                        known.join(", ")
                    },
                });
            };
            let again = self.query[..n].iter().any(|(other, _)| other == name);
            if again && !parameter.repeatable {
                return Err(ApiError::BadParameter {
                    name: parameter.name,
                    got: format!("a second value, {value}"),
                    expected: "one value".into(),
                });
            }
        }
        Ok(())
    }

    /// The value of the query parameter of this name.
    pub(super) fn one(&self, name: &str) -> Option<&str> {
        self.all(name).next()
    }

    /// All values of the query parameter of this name.
    pub(super) fn all(&self, name: &str) -> impl Iterator<Item = &str> {
        let named = self.query.iter().filter(move |(own, _)| own == name);
        named.map(|(_, value)| value.as_str())
    }

    /// Keys and values of the query parameters whose names match `name`, in which `{key}` stands for any key.
    pub(super) fn keyed(&self, name: &str) -> impl Iterator<Item = (String, String)> {
        let start = name.trim_end_matches(ANY_KEY);
        self.query.iter().filter_map(move |(own, value)| {
            let key = own.strip_prefix(start)?;
            Some((key.to_owned(), value.clone()))
        })
    }
}

/// Whether a query's `name` is that of this parameter; the name of a parameter may end in `{key}`, which stands for any
/// key.
fn matches(parameter: &str, name: &str) -> bool {
    match parameter.strip_suffix(ANY_KEY) {
        Some(start) => name.starts_with(start),
        None => name == parameter,
    }
}

impl<V: Values> Input for Variable<V> {
    type Value = V::Value;

    fn descriptions(&self) -> Vec<Description> {
        vec![self.describe()]
    }

    fn extract(&self, raw: &RawInput<'_>) -> Result<V::Value, ApiError> {
        let mut named = raw.variables.iter().filter(|(name, _)| name == self.name);
        // it exists: a test checks that each path has the variables of its operation
        let text = named.next().map_or("", |(_, value)| value.as_str());
        self.read(text)
    }
}

impl<V: Values> Input for Parameter<V> {
    type Value = Option<V::Value>;

    fn descriptions(&self) -> Vec<Description> {
        vec![self.describe()]
    }

    fn extract(&self, raw: &RawInput<'_>) -> Result<Option<V::Value>, ApiError> {
        let text = raw.one(self.name);
        text.map(|text| self.read(text)).transpose()
    }
}

/// Makes a tuple of several inputs an input.
macro_rules! tuples {
    ($(($($T:ident)*))*) => {$(
        #[allow(non_snake_case, clippy::unused_unit)]
        impl<$($T: Input),*> Input for ($($T,)*) {
            type Value = ($($T::Value,)*);

            fn descriptions(&self) -> Vec<Description> {
                let ($($T,)*) = self;
                [$($T.descriptions()),*].concat()
            }

            fn extract(&self, raw: &RawInput<'_>) -> Result<Self::Value, ApiError> {
                let ($($T,)*) = self;
                Ok(($($T.extract(raw)?,)*))
            }
        }
    )*};
}
tuples!((A) (A B) (A B C) (A B C D) (A B C D E) (A B C D E F) (A B C D E F G) (A B C D E F G H));

impl Input for () {
    type Value = ();

    fn descriptions(&self) -> Vec<Description> {
        vec![]
    }

    fn extract(&self, _: &RawInput<'_>) -> Result<(), ApiError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use service::verbs::{filters, page::PAGE_SIZE};

    fn refused(query: &str) -> Option<String> {
        let headers = HeaderMap::new();
        let described = [filters::describe(), vec![PAGE_SIZE.describe()]].concat();
        let raw = RawInput::new(vec![], Some(query), &headers);
        raw.check(&described).err().map(|error| error.to_string())
    }

    #[test]
    fn a_parameter_is_known_and_given_once_unless_it_is_repeatable() {
        for good in [
            "",
            "status=queued&status=failed",
            "label.a=1&label.a=2&label.=3",
            "page_size=many", // values are checked when they are read
        ] {
            assert_eq!(refused(good), None, "{good}");
        }
        let unknown = refused("status=queued&color=red").unwrap();
        assert!(unknown.contains("color") && unknown.contains("created_after, created_before"));
        assert!(refused("label=x").unwrap().contains("has no parameter"));
        assert!(
            refused("name=a&name=b")
                .unwrap()
                .contains("a second value, b")
        );
    }

    #[test]
    fn values_are_read_from_a_query_and_checked() {
        let headers = HeaderMap::new();
        let read = |query: &str| {
            let raw = RawInput::new(vec![], Some(query), &headers);
            (PAGE_SIZE,)
                .extract(&raw)
                .map_err(|error| error.to_string())
        };
        assert_eq!(read(""), Ok((None,)));
        assert_eq!(read("page_size=7"), Ok((Some(7),)));
        let wrong = "page_size: expected a whole number from 1 to 1000, got \"1001\"";
        assert_eq!(read("page_size=1001"), Err(wrong.into()));
    }
}
