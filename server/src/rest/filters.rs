//! The filters of lists of jobs, read from a query.

use super::input::{Input, RawInput};
use crate::{
    error::ApiError,
    parameters::{Description, Parameter, Text},
    store::Filter,
    verbs::filters::{
        self, CREATED_AFTER, CREATED_BEFORE, FINISHED_AFTER, FINISHED_BEFORE, INPUT_HASH, LABEL,
        NAME, OWNER, STATUS, SWEEP,
    },
};

/// All filters; without any, every job matches.
pub(super) const FILTERS: Filters = Filters;

/// The input of all filters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filters;

impl Input for Filters {
    type Value = Filter;

    fn descriptions(&self) -> Vec<Description> {
        filters::describe().into()
    }

    fn extract(&self, raw: &RawInput<'_>) -> Result<Filter, ApiError> {
        let statuses = raw.all(STATUS.name).flat_map(|list| list.split(','));
        let text = |filter: Parameter<Text>| raw.one(filter.name).map(str::to_owned);
        filters::checked(Filter {
            statuses: statuses
                .map(|word| STATUS.read(word))
                .collect::<Result<_, _>>()?,
            owner: text(OWNER),
            labels: raw.keyed(LABEL.name).collect(),
            name: text(NAME),
            input_hash: text(INPUT_HASH),
            sweep: SWEEP.extract(raw)?,
            created_after: CREATED_AFTER.extract(raw)?,
            created_before: CREATED_BEFORE.extract(raw)?,
            finished_after: FINISHED_AFTER.extract(raw)?,
            finished_before: FINISHED_BEFORE.extract(raw)?,
        })
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
                "2026-01-31T12:00:00Z",
                "sweep_01890a5d-ac96-774b-bcce-b302099a8057",
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
