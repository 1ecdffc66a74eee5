//! The query parameters of lists of jobs.

use super::request::{ANY_LABEL, Params};
use crate::{
    error::ApiError,
    job::Status,
    store::{Filter, GroupBy, Order},
    verbs::jobs as verbs,
};

/// The parameters that filter.
pub(super) const FILTERS: [&str; 9] = [
    "status",
    "owner",
    ANY_LABEL,
    "name",
    "input_hash",
    "created_after",
    "created_before",
    "finished_after",
    "finished_before",
];

/// A query with filters, and with `more` parameters.
pub(super) fn parse(
    query: Option<&str>,
    more: &[&'static str],
) -> Result<(Filter, Params), ApiError> {
    let known: Vec<&'static str> = FILTERS.iter().chain(more).copied().collect();
    let params = Params::parse(query, &known)?;
    let status = |word: &str| {
        Status::parse(word).ok_or(ApiError::BadParameter {
            name: "status",
            got: word.into(),
            expected: "queued, running, succeeded, failed or canceled",
        })
    };
    let statuses = params
        .all("status")
        .flat_map(|list| list.split(','))
        .map(status)
        .collect::<Result<Vec<_>, _>>()?;
    let filter = Filter {
        statuses,
        owner: params.one("owner").map(str::to_owned),
        labels: params.labels().collect(),
        name: params.one("name").map(str::to_owned),
        input_hash: params.one("input_hash").map(str::to_owned),
        created_after: params.time("created_after")?,
        created_before: params.time("created_before")?,
        finished_after: params.time("finished_after")?,
        finished_before: params.time("finished_before")?,
    };
    Ok((verbs::checked(filter)?, params))
}

/// The `order_by` of a list.
pub(super) fn order(params: &Params) -> Result<Order, ApiError> {
    let expected = Order::EXPECTED;
    let order = params.word("order_by", Order::parse, expected)?;
    Ok(order.unwrap_or(Order::NEWEST_FIRST))
}

/// The `group_by` of a count.
pub(super) fn group_by(params: &Params) -> Result<Option<GroupBy>, ApiError> {
    params.word("group_by", GroupBy::parse, GroupBy::EXPECTED)
}
