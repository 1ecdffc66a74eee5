//! Submitted jobs: get, list, count, edit, cancel, delete; and the problem of one.

use std::{collections::BTreeMap, sync::Arc};

use schemars::JsonSchema;
use serde_json::json;
use solver::problem::Problem;

use super::{
    Service, envelope, filters,
    page::{self, Page, Paging},
    service::detached,
};
use crate::{
    caller::Caller,
    error::ApiError,
    job::{Job, JobId},
    parameters::{Parameter, Values, Variable, Words},
    store::{CancelOutcome, Deletion, Edit, Filter, GroupBy, Order, OrderBy, Snapshot},
    violations::Violations,
};

/// A job in a path.
pub const ID: Variable<JobIds> = Variable {
    name: "id",
    kind: "job",
    meaning: "The job",
    values: JobIds,
};

/// The ids of jobs.
#[derive(Clone, Copy, Debug)]
pub struct JobIds;

impl Values for JobIds {
    type Value = JobId;

    fn schema(&self) -> serde_json::Value {
        json!({ "$ref": "#/components/schemas/JobId" })
    }

    fn expected(&self) -> String {
        "job_ and a UUID in lower case".into()
    }

    fn read(&self, text: &str) -> Option<JobId> {
        JobId::parse(text)
    }
}

/// The job as it is now.
pub async fn get(service: &Service, caller: &Caller, id: JobId) -> Result<Job, ApiError> {
    match service.store.job(caller.sees(), id).await? {
        Some(job) => Ok(job),
        None => Err(not_found(service, caller, id).await?),
    }
}

/// The job with what there is of its result, as of one moment.
pub(super) async fn snapshot(
    service: &Service,
    caller: &Caller,
    id: JobId,
) -> Result<Snapshot, ApiError> {
    match service.store.snapshot(caller.sees(), id).await? {
        Some(found) => Ok(found),
        None => Err(not_found(service, caller, id).await?),
    }
}

async fn not_found(service: &Service, caller: &Caller, id: JobId) -> Result<ApiError, ApiError> {
    Ok(match service.store.was_deleted(caller.sees(), id).await? {
        true => ApiError::Deleted(id),
        false => ApiError::NotFound(format!("there is no job {id}")),
    })
}

/// The problem that was submitted, with its defaults filled in.
pub async fn problem(service: &Service, caller: &Caller, id: JobId) -> Result<Problem, ApiError> {
    let job = get(service, caller, id).await?;
    let stored = service.store.problem(job.key).await?;
    let (title, body) = stored.ok_or(ApiError::Deleted(id))?;
    let read = service.work(move || serde_json::from_str(&body)).await?;
    let problem: Problem = read.map_err(ApiError::internal)?;
    Ok(Problem { title, ..problem })
}

/// The order of a list.
pub const ORDER_BY: Parameter<Orders> = Parameter {
    name: "order_by",
    meaning: "Sorts by this time; by finished_at only jobs that have ended are listed",
    values: Orders,
};

/// The orders that there are.
#[derive(Clone, Copy, Debug)]
pub struct Orders;

impl Orders {
    /// All orders, each with its word.
    fn words() -> impl Iterator<Item = (String, Order)> {
        let times = [OrderBy::CreatedAt, OrderBy::FinishedAt].into_iter();
        let both = |by| [true, false].map(|descending| Order { by, descending });
        times.flat_map(both).map(|order| {
            let word = format!("{} {}", order.by.column(), order.direction());
            (word, order)
        })
    }
}

impl Values for Orders {
    type Value = Order;

    fn schema(&self) -> serde_json::Value {
        let short = [OrderBy::CreatedAt, OrderBy::FinishedAt].map(|by| by.column().to_owned());
        let words: Vec<String> = short
            .into_iter()
            .chain(Orders::words().map(|(word, _)| word))
            .collect();
        json!({ "type": "string", "enum": words })
    }

    fn expected(&self) -> String {
        "created_at or finished_at, then desc (the default) or asc".into()
    }

    fn read(&self, text: &str) -> Option<Order> {
        let whole = match text.contains(' ') {
            true => text.to_owned(),
            false => format!("{text} desc"),
        };
        Orders::words().find_map(|(word, order)| (word == whole).then_some(order))
    }
}

/// Lists jobs; newest first, unless another order is asked for.
pub async fn list(
    service: &Service,
    caller: &Caller,
    filter: &Filter,
    order: Option<Order>,
    paging: &Paging,
) -> Result<Page<Job>, ApiError> {
    let order = order.unwrap_or(Order::NEWEST_FIRST);
    let list = page::list_of_jobs(filter, order);
    let (store, cursor) = (&service.store, paging.cursor(&list)?);
    let jobs = store.jobs(caller.sees(), filter, order, cursor, paging.limit());
    Ok(paging.page(&list, jobs.await?, |job| page::after(job, order)))
}

/// What jobs are counted by.
pub const GROUP_BY: Parameter<Words<GroupBy>> = Parameter {
    name: "group_by",
    meaning: "Counts each of these on its own, too",
    values: Words(|| vec![("status", GroupBy::Status), ("owner", GroupBy::Owner)]),
};

/// How many jobs there are, and in groups how many of each.
#[derive(Clone, Debug, serde::Serialize, JsonSchema)]
pub struct Count {
    /// All that match the filters.
    pub total: i64,
    /// By the group's name; empty when no groups were asked for.
    pub groups: BTreeMap<String, i64>,
}

/// Counts jobs.
pub async fn count(
    service: &Service,
    caller: &Caller,
    filter: &Filter,
    group_by: Option<GroupBy>,
) -> Result<Count, ApiError> {
    let store = &service.store;
    let groups = store.count(caller.sees(), filter, group_by).await?;
    let total = groups.iter().map(|(_, jobs)| jobs).sum();
    let groups = match group_by {
        Some(_) => groups.into_iter().collect(),
        None => BTreeMap::new(),
    };
    Ok(Count { total, groups })
}

/// Changes what may be changed of a job, if it is still of that version.
pub async fn update(
    service: &Arc<Service>,
    caller: &Caller,
    id: JobId,
    edit: Edit,
    version: Option<i64>,
) -> Result<Job, ApiError> {
    let mut violations = Violations::default();
    let name = edit.name.iter().flatten().next();
    violations.extend(name.and_then(|name| envelope::name_violation(name)));
    violations.extend(edit.priority.and_then(envelope::priority_violation));
    violations.extend(edit.labels.iter().flat_map(envelope::label_violations));
    if !violations.is_empty() {
        return Err(ApiError::InvalidProblem(violations.into_vec()));
    }
    let (service, caller) = (service.clone(), caller.clone());
    detached(async move {
        let edited = service.store.edit(caller.sees(), id, &edit, version);
        match edited.await? {
            Some(Ok(job)) => {
                service.queue.announce(&[job.key]);
                Ok(job)
            }
            Some(Err(version)) => Err(ApiError::StaleVersion(version)),
            None => Err(not_found(&service, &caller, id).await?),
        }
    })
    .await
}

/// Asks a job to stop.
pub async fn cancel(
    service: &Arc<Service>,
    caller: &Caller,
    id: JobId,
) -> Result<(Cancellation, Job), ApiError> {
    let key = get(service, caller, id).await?.key;
    let (service, caller) = (service.clone(), caller.clone());
    detached(async move {
        let outcome = match service.queue.cancel(key).await? {
            CancelOutcome::Canceled(_) => Cancellation::Canceled,
            CancelOutcome::Requested { .. } => Cancellation::CancelRequested,
            CancelOutcome::AlreadyTerminal => Cancellation::AlreadyTerminal,
        };
        Ok((outcome, get(&service, &caller, id).await?))
    })
    .await
}

/// What asking a job to stop did.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Cancellation {
    /// It was waiting, and will not run.
    Canceled,
    /// It was running; it will have ended in half a second.
    CancelRequested,
    /// It had ended.
    AlreadyTerminal,
}

/// Deletes a job that has ended, with its events and its result.
pub async fn delete(service: &Arc<Service>, caller: &Caller, id: JobId) -> Result<(), ApiError> {
    let job = get(service, caller, id).await?;
    let (service, caller) = (service.clone(), caller.clone());
    detached(async move {
        match service.store.delete(caller.sees(), job.key).await? {
            Deletion::Deleted => {
                service.queue.announce(&[job.key]);
                Ok(())
            }
            Deletion::Active => Err(ApiError::JobActive(job.status.as_str())),
            Deletion::Unknown => Err(not_found(&service, &caller, id).await?),
        }
    })
    .await
}

/// What was done to many jobs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, JsonSchema)]
pub struct Many {
    /// Jobs that match the filters.
    pub matched: u64,
    /// Those of them that changed.
    pub changed: u64,
}

/// Asks all jobs that match a filter to stop; later jobs are not affected.
pub async fn cancel_many(
    service: &Arc<Service>,
    caller: &Caller,
    filter: Filter,
) -> Result<Many, ApiError> {
    for_each(service, caller, filter, Action::Cancel).await
}

/// Deletes all jobs that match a filter and have ended.
pub async fn delete_many(
    service: &Arc<Service>,
    caller: &Caller,
    filter: Filter,
) -> Result<Many, ApiError> {
    for_each(service, caller, filter, Action::Delete).await
}

/// What is done to each of many jobs.
#[derive(Clone, Copy, Debug)]
enum Action {
    Cancel,
    Delete,
}

/// Does the same to every job that matches a filter, each in a transaction of its own: nobody else waits for all
/// of them. A client that hangs up changes nothing.
async fn for_each(
    service: &Arc<Service>,
    caller: &Caller,
    filter: Filter,
    action: Action,
) -> Result<Many, ApiError> {
    const AT_ONCE: i64 = 1000;
    let filter = filters::required(filter)?;
    let (service, caller) = (service.clone(), caller.clone());
    detached(async move {
        let store = &service.store;
        let last = store.last_key().await?;
        let (mut after, mut many) = (0, Many::default());
        loop {
            let keys = store.keys(caller.sees(), &filter, after, last, AT_ONCE);
            let keys = keys.await?;
            let Some(end) = keys.last() else {
                return Ok(many);
            };
            after = *end;
            for key in keys {
                many.matched += 1;
                many.changed += u64::from(act(&service, &caller, key, action).await?);
            }
        }
    })
    .await
}

/// Whether that changed the job.
async fn act(
    service: &Service,
    caller: &Caller,
    key: i64,
    action: Action,
) -> Result<bool, ApiError> {
    match action {
        Action::Cancel => {
            let outcome = service.queue.cancel(key).await?;
            Ok(outcome != CancelOutcome::AlreadyTerminal)
        }
        Action::Delete => {
            let deleted = service.store.delete(caller.sees(), key).await? == Deletion::Deleted;
            if deleted {
                service.queue.announce(&[key]);
            }
            Ok(deleted)
        }
    }
}
