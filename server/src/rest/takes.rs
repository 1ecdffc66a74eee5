//! What operations take beside a body: each thing describes itself in the table, and is read and checked before
//! the handler runs.

use axum::{
    RequestPartsExt,
    extract::RawPathParams,
    http::{HeaderMap, request::Parts},
};

use crate::{
    error::ApiError,
    parameters::{Description, Parameter, Place, Values, Variable},
};

/// Something that an operation takes.
pub(super) trait Takes {
    /// What a handler receives of it.
    type Value;

    /// For the description of the API: one parameter, or several that belong together.
    fn described(&self) -> Vec<Description>;

    /// Reads it.
    fn take(&self, sent: &Sent<'_>) -> Result<Self::Value, ApiError>;
}

/// What a request says beside its body.
#[derive(Debug)]
pub(super) struct Sent<'a> {
    variables: Vec<(String, String)>,
    query: Vec<(String, String)>,
    pub(super) headers: &'a HeaderMap,
}

/// What stands for any key in the name of a parameter.
const ANY_KEY: &str = "{key}";

impl<'a> Sent<'a> {
    /// The variables of the path, as the router found them; an ill-formed path names nothing.
    pub(super) async fn variables(parts: &mut Parts) -> Result<Vec<(String, String)>, ApiError> {
        let ill_formed = |_| ApiError::NotFound("the path is not well formed".into());
        let found: RawPathParams = parts.extract().await.map_err(ill_formed)?;
        let owned = |(name, value): (&str, &str)| (name.to_owned(), value.to_owned());
        Ok(found.iter().map(owned).collect())
    }

    /// What a request says.
    pub(super) fn new(
        variables: Vec<(String, String)>,
        query: Option<&str>,
        headers: &'a HeaderMap,
    ) -> Sent<'a> {
        let query = form_urlencoded::parse(query.unwrap_or_default().as_bytes());
        Sent {
            variables,
            query: query.into_owned().collect(),
            headers,
        }
    }

    /// Refuses a parameter of a name that is not known, since it was meant to do something, and a second value,
    /// since the first was.
    pub(super) fn check(&self, described: &[Description]) -> Result<(), ApiError> {
        let known = described.iter().filter(|one| one.place == Place::Query);
        for (n, (name, value)) in self.query.iter().enumerate() {
            let Some(parameter) = known.clone().find(|one| stands_for(one.name, name)) else {
                let known: Vec<&str> = known.map(|one| one.name).collect();
                return Err(ApiError::UnknownParameter {
                    name: name.clone(),
                    known: match known.is_empty() {
                        true => "none".into(),
                        false => known.join(", "),
                    },
                });
            };
            let again = self.query[..n].iter().any(|(other, _)| other == name);
            if again && !parameter.repeatable {
                return Err(ApiError::BadParameter {
                    name: parameter.name,
                    got: format!("a second one, {value}"),
                    expected: "one value".into(),
                });
            }
        }
        Ok(())
    }

    /// The value of a query parameter of that name.
    pub(super) fn one(&self, name: &str) -> Option<&str> {
        self.all(name).next()
    }

    /// All values of a query parameter of that name.
    pub(super) fn all(&self, name: &str) -> impl Iterator<Item = &str> {
        let named = self.query.iter().filter(move |(own, _)| own == name);
        named.map(|(_, value)| value.as_str())
    }

    /// Keys and values of the query parameters that such a name stands for.
    pub(super) fn keyed(&self, name: &str) -> impl Iterator<Item = (String, String)> {
        let start = name.trim_end_matches(ANY_KEY);
        self.query.iter().filter_map(move |(own, value)| {
            let key = own.strip_prefix(start)?;
            Some((key.to_owned(), value.clone()))
        })
    }
}

/// Whether this is the name of a parameter, or of one of those that it stands for.
fn stands_for(parameter: &str, name: &str) -> bool {
    match parameter.strip_suffix(ANY_KEY) {
        Some(start) => name.starts_with(start),
        None => name == parameter,
    }
}

impl<V: Values> Takes for Variable<V> {
    type Value = V::Value;

    fn described(&self) -> Vec<Description> {
        vec![self.describe()]
    }

    fn take(&self, sent: &Sent<'_>) -> Result<V::Value, ApiError> {
        let mut named = sent.variables.iter().filter(|(name, _)| name == self.name);
        // the table says that its paths have their variables: a test holds it to that
        let text = named.next().map_or("", |(_, value)| value.as_str());
        self.read(text)
    }
}

impl<V: Values> Takes for Parameter<V> {
    type Value = Option<V::Value>;

    fn described(&self) -> Vec<Description> {
        vec![self.describe()]
    }

    fn take(&self, sent: &Sent<'_>) -> Result<Option<V::Value>, ApiError> {
        let text = sent.one(self.name);
        text.map(|text| self.read(text)).transpose()
    }
}

/// Several things are a tuple of them.
macro_rules! tuples {
    ($(($($T:ident)*))*) => {$(
        #[allow(non_snake_case, clippy::unused_unit)]
        impl<$($T: Takes),*> Takes for ($($T,)*) {
            type Value = ($($T::Value,)*);

            fn described(&self) -> Vec<Description> {
                let ($($T,)*) = self;
                [$($T.described()),*].concat()
            }

            fn take(&self, sent: &Sent<'_>) -> Result<Self::Value, ApiError> {
                let ($($T,)*) = self;
                Ok(($($T.take(sent)?,)*))
            }
        }
    )*};
}
tuples!((A) (A B) (A B C) (A B C D) (A B C D E) (A B C D E F));

impl Takes for () {
    type Value = ();

    fn described(&self) -> Vec<Description> {
        vec![]
    }

    fn take(&self, _: &Sent<'_>) -> Result<(), ApiError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::verbs::{filters, page::PAGE_SIZE};

    fn refused(query: &str) -> Option<String> {
        let headers = HeaderMap::new();
        let described = [filters::describe().to_vec(), vec![PAGE_SIZE.describe()]].concat();
        let sent = Sent::new(vec![], Some(query), &headers);
        sent.check(&described).err().map(|error| error.to_string())
    }

    #[test]
    fn a_parameter_is_known_and_given_once_unless_it_is_repeatable() {
        for good in [
            "",
            "status=queued&status=failed",
            "label.a=1&label.a=2&label.=3",
            "page_size=many", // whether it makes sense is looked at when it is read
        ] {
            assert_eq!(refused(good), None, "{good}");
        }
        let unknown = refused("status=queued&color=red").unwrap();
        assert!(unknown.contains("color") && unknown.contains("created_after, created_before"));
        assert!(
            refused("label=x")
                .unwrap()
                .contains("there is no parameter")
        );
        assert!(
            refused("name=a&name=b")
                .unwrap()
                .contains("a second one, b")
        );
    }

    #[test]
    fn values_are_read_from_a_query_and_checked() {
        let headers = HeaderMap::new();
        let read = |query: &str| {
            let sent = Sent::new(vec![], Some(query), &headers);
            (PAGE_SIZE,).take(&sent).map_err(|error| error.to_string())
        };
        assert_eq!(read(""), Ok((None,)));
        assert_eq!(read("page_size=7"), Ok((Some(7),)));
        let wrong = "page_size: expected a whole number from 1 to 1000, got \"1001\"";
        assert_eq!(read("page_size=1001"), Err(wrong.into()));
    }
}
