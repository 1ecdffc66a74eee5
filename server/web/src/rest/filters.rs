//! The filters of lists of jobs, read from a query.

use service::{
    error::ApiError,
    parameters::Description,
    verbs::filters::{self, LABEL},
};
use store::Filter;

use super::input::{Input, RawInput};

/// The input of all filters; a request without filters selects every job.
pub(super) const FILTERS: Filters = Filters;

/// An input that reads all filters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filters;

impl Input for Filters {
    type Value = Filter;

    fn descriptions(&self) -> Vec<Description> {
        filters::describe()
    }

    fn extract(&self, raw: &RawInput<'_>) -> Result<Filter, ApiError> {
        // `label.a!=b` is the name `label.a!` and the value `b`
        let excludes = |(key, _): &(String, String)| key.ends_with('!');
        let (excluded, labels) = raw.keyed(LABEL.name).partition(excludes);
        let named = |(key, value): (String, String)| {
            (key.strip_suffix('!').unwrap_or(&key).to_owned(), value)
        };
        let mut filter = Filter {
            labels,
            excluded_labels: Vec::into_iter(excluded).map(named).collect(),
            ..Filter::default()
        };
        for field in store::FILTERS {
            for text in raw.all(field.name) {
                let list = field.several.then(|| text.split(','));
                let one = (!field.several).then_some(text);
                for text in list.into_iter().flatten().chain(one) {
                    filters::set(&mut filter, field, text)?;
                }
            }
        }
        filters::checked(filter)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use axum::http::HeaderMap;

    use super::*;

    #[test]
    fn every_filter_that_is_described_is_read() {
        let headers = HeaderMap::new();
        for filter in filters::describe() {
            let name = filter.name.replace("{key}", "a");
            let found = [
                "queued",
                "poor",
                "2026-01-31T12:00:00Z",
                "sweep_01890a5d-ac96-774b-bcce-b302099a8057",
                "job_01890a5d-ac96-774b-bcce-b302099a8057",
                "true",
                "no_contact",
            ]
            .into_iter()
            .find_map(|value| {
                let query = format!("{name}={value}");
                let raw = RawInput::new(vec![], Some(&query), &headers);
                FILTERS.extract(&raw).ok()
            });
            assert_ne!(found.unwrap(), Filter::default(), "{name}");
        }
    }
}
