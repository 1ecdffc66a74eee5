//! Operations that list and count jobs.

use std::collections::BTreeMap;

use base::{
    caller::Caller,
    job::Job,
    values::{Values, Words},
};
use futures_util::future::BoxFuture;
use schemars::JsonSchema;
use serde_json::json;
use store::{Filter, GroupBy, Order, OrderBy};
use strum::VariantArray;

use super::{
    page::{self, Page, Paging},
    service::Service,
};
use crate::{error::ApiError, parameters::Parameter};

/// The order of a list.
pub const ORDER_BY: Parameter<Orders> = Parameter {
    name: "order_by",
    meaning: "Order of the list by this time; with finished_at only jobs that have ended are listed",
    values: Orders,
};

/// The allowed values of the parameter: all orders of a list.
#[derive(Clone, Copy, Debug)]
pub struct Orders;

impl Orders {
    /// All orders of a list, each with the word that requests it.
    fn words() -> impl Iterator<Item = (String, Order)> {
        let times = OrderBy::VARIANTS.iter();
        let both = |by: &OrderBy| {
            [true, false].map(|descending| Order {
                by: *by,
                descending,
            })
        };
        times.flat_map(both).map(|order| {
            let word = format!("{} {}", <&str>::from(order.by), order.direction());
            (word, order)
        })
    }
}

impl Values for Orders {
    type Value = Order;

    fn schema(&self) -> serde_json::Value {
        let short = OrderBy::VARIANTS
            .iter()
            .map(|by| <&str>::from(*by).to_owned());
        let words: Vec<String> = short.chain(Orders::words().map(|(word, _)| word)).collect();
        json!({ "type": "string", "enum": words })
    }

    fn expected(&self) -> String {
        "created_at or finished_at, then desc (the default) or asc".into()
    }

    fn read(&self, text: &str) -> Option<Order> {
        let whole = if text.contains(' ') {
            text.to_owned()
        } else {
            format!("{text} desc")
        };
        Orders::words().find_map(|(word, order)| (word == whole).then_some(order))
    }
}

/// Lists jobs; newest first, unless another order is requested.
pub fn list<'a>(
    service: &'a Service,
    caller: &'a Caller,
    filter: &'a Filter,
    order: Option<Order>,
    paging: &'a Paging,
) -> BoxFuture<'a, Result<Page<Job>, ApiError>> {
    Box::pin(async move {
        let order = order.unwrap_or(Order::NEWEST_FIRST);
        let list = page::list_of_jobs(filter, order);
        let (store, cursor) = (&service.store, paging.cursor(&list)?);
        let jobs = store.some_jobs(
            caller.visible_owners(),
            filter,
            order,
            cursor,
            paging.limit(),
        );
        Ok(paging.page(&list, jobs.await?, |job| page::after(job, order)))
    })
}

/// The field by which jobs are counted.
pub const GROUP_BY: Parameter<Words<GroupBy>> = Parameter {
    name: "group_by",
    meaning: "Also counts the jobs of each value of this field",
    values: Words::all(),
};

/// The number of jobs, in total and by group.
#[derive(Clone, Debug, serde::Serialize, JsonSchema)]
pub struct Count {
    /// The number of all jobs that match the filters.
    pub total: i64,
    /// The number of jobs in each group, by the group's name; empty if no groups were requested.
    pub groups: BTreeMap<String, i64>,
}

/// Counts jobs.
pub fn count<'a>(
    service: &'a Service,
    caller: &'a Caller,
    filter: &'a Filter,
    group_by: Option<GroupBy>,
) -> BoxFuture<'a, Result<Count, ApiError>> {
    Box::pin(async move {
        let store = &service.store;
        let groups = store
            .count(caller.visible_owners(), filter, group_by)
            .await?;
        let total = groups.iter().map(|(_, jobs)| jobs).sum();
        let groups = match group_by {
            Some(_) => groups.into_iter().collect(),
            None => BTreeMap::new(),
        };
        Ok(Count { total, groups })
    })
}
