//! Operations that list and count jobs.

use std::{
    borrow::Cow,
    collections::{BTreeMap, BTreeSet},
};

use base::{caller::Caller, job::Job, values::Values};
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
    meaning: "Order of the list by this time; with finished_at and run_s only jobs that have ended are listed",
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
        "created_at, finished_at or run_s, then desc (the default) or asc".into()
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

/// The fields of the jobs of a list.
pub const FIELDS: Parameter<JobFields> = Parameter {
    name: "fields",
    meaning: "Fields of each job, separated by commas, such as id,name,status; default: all but links",
    values: JobFields,
};

/// The allowed values of the parameter: names of fields of a job.
#[derive(Clone, Copy, Debug)]
pub struct JobFields;

impl Values for JobFields {
    type Value = BTreeSet<&'static str>;

    fn schema(&self) -> serde_json::Value {
        json!({ "type": "string" })
    }

    fn expected(&self) -> String {
        format!(
            "some of these, separated by commas: {}",
            Job::FIELDS.join(", ")
        )
    }

    fn read(&self, text: &str) -> Option<BTreeSet<&'static str>> {
        let known = |name: &str| Job::FIELDS.iter().copied().find(|field| *field == name);
        text.split(',').map(known).collect()
    }

    /// The unknown names.
    fn fault<'t>(&self, text: &'t str) -> Cow<'t, str> {
        let unknown = |name: &&str| !Job::FIELDS.contains(name);
        let unknown: Vec<&str> = text.split(',').filter(unknown).collect();
        unknown.join(",").into()
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
pub const GROUP_BY: Parameter<Groups> = Parameter {
    name: "group_by",
    meaning: "Also counts the jobs of each value of this field: of status, owner or verdict (`none` for jobs without one), of each key of labels (label), or of each value of one label (label.KEY); at most 1000 groups, those with the most jobs",
    values: Groups,
};

/// The allowed values of the parameter: all properties by which jobs are counted.
#[derive(Clone, Copy, Debug)]
pub struct Groups;

impl Values for Groups {
    type Value = GroupBy;

    fn schema(&self) -> serde_json::Value {
        let words = json!({ "type": "string", "enum": ["status", "owner", "verdict", "label"] });
        json!({ "anyOf": [words, { "type": "string", "pattern": "^label\\..+$" }] })
    }

    fn expected(&self) -> String {
        "status, owner, verdict, label or label.KEY".into()
    }

    fn read(&self, text: &str) -> Option<GroupBy> {
        match text {
            "status" => Some(GroupBy::Status),
            "owner" => Some(GroupBy::Owner),
            "verdict" => Some(GroupBy::Verdict),
            "label" => Some(GroupBy::LabelKeys),
            label => {
                let key = label.strip_prefix("label.")?;
                (!key.is_empty()).then(|| GroupBy::Label(key.to_owned()))
            }
        }
    }
}

/// The number of jobs, in total and by group.
#[derive(Clone, Debug, PartialEq, serde::Serialize, JsonSchema)]
pub struct Count {
    /// The number of all jobs that match the filters.
    pub total: i64,
    /// The number of jobs in each group, by the group's name; empty if no groups were requested. At most a thousand groups,
    /// those with the most jobs.
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
        let count = |group| store.count(caller.visible_owners(), filter, group);
        let sum = |groups: &[(String, i64)]| groups.iter().map(|(_, jobs)| jobs).sum();
        let groups = count(group_by.clone()).await?;
        let total = match &group_by {
            // there may be more groups, and a job may be in several or in none
            Some(group) if !group.is_partition() || groups.len() as i64 >= GroupBy::MOST => {
                sum(&count(None).await?)
            }
            _ => sum(&groups),
        };
        let groups = match group_by {
            Some(_) => groups.into_iter().collect(),
            None => BTreeMap::new(),
        };
        Ok(Count { total, groups })
    })
}
