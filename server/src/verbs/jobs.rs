//! Jobs that were handed in: get, list, count, edit, cancel, delete; and the problem of one.

use std::{collections::BTreeMap, sync::Arc};

use schemars::JsonSchema;
use solver::problem::Problem;

use super::{Service, envelope, page, service::detached};
use crate::{
    error::ApiError,
    job::{Job, JobId},
    store::{CancelOutcome, Deletion, Edit, Filter, GroupBy, Order, Snapshot},
    violations::Violations,
};

/// Jobs on a page, unless asked for otherwise.
pub const PAGE_SIZE: i64 = 50;
/// Most jobs on a page.
pub const MAX_PAGE_SIZE: i64 = 1000;
/// The filters that there are, as they are named where one is missing.
const FILTERS: &str = "status, owner, label.{key}, name, input_hash, created_after, created_before, finished_after, finished_before";

/// The job as it is now.
pub async fn get(service: &Service, id: JobId) -> Result<Job, ApiError> {
    match service.store.job(service.sees(), id).await? {
        Some(job) => Ok(job),
        None => Err(absent(service, id).await?),
    }
}

/// The job with what there is of its result, as of one moment.
pub(super) async fn snapshot(service: &Service, id: JobId) -> Result<Snapshot, ApiError> {
    match service.store.snapshot(service.sees(), id).await? {
        Some(found) => Ok(found),
        None => Err(absent(service, id).await?),
    }
}

async fn absent(service: &Service, id: JobId) -> Result<ApiError, ApiError> {
    Ok(match service.store.was_deleted(service.sees(), id).await? {
        true => ApiError::Deleted(id),
        false => ApiError::NotFound(format!("there is no job {id}")),
    })
}

/// The problem that was handed in, with its defaults filled in.
pub async fn problem(service: &Service, id: JobId) -> Result<Problem, ApiError> {
    let job = get(service, id).await?;
    let stored = service.store.problem(job.key).await?;
    let (title, body) = stored.ok_or(ApiError::Deleted(id))?;
    let read = service.work(move || serde_json::from_str(&body)).await?;
    let problem: Problem = read.map_err(ApiError::internal)?;
    Ok(Problem { title, ..problem })
}

/// A filter that can be asked for, each status and label once.
pub fn checked(filter: Filter) -> Result<Filter, ApiError> {
    let filter = filter.tidied();
    if filter.labels.len() > Filter::MOST_LABELS {
        return Err(ApiError::BadParameter {
            name: "labels",
            got: format!("{} labels", filter.labels.len()),
            expected: "at most 64 labels",
        });
    }
    Ok(filter)
}

/// A page of jobs.
#[derive(Debug)]
pub struct Page {
    /// The jobs.
    pub jobs: Vec<Job>,
    /// Where the next page begins; none after the last.
    pub next: Option<String>,
}

/// Lists jobs.
pub async fn list(
    service: &Service,
    filter: &Filter,
    order: Order,
    page_size: i64,
    page_token: Option<&str>,
) -> Result<Page, ApiError> {
    let list = page::list_of_jobs(filter, order);
    let cursor = page_token
        .map(|token| page::cursor(token, &list).ok_or(ApiError::BadPageToken))
        .transpose()?;
    // One more than asked for tells whether there is another page.
    let jobs = service
        .store
        .jobs(service.sees(), filter, order, cursor, page_size + 1)
        .await?;
    let mut jobs = jobs;
    let more = jobs.len() as i64 > page_size;
    jobs.truncate(page_size as usize);
    let last = jobs.last().filter(|_| more);
    let next = last.map(|job| page::token(page::after(job, order), &list));
    Ok(Page { jobs, next })
}

/// How many jobs there are, and in groups how many of each.
#[derive(Clone, Debug, serde::Serialize, JsonSchema)]
pub struct Count {
    /// All that the filters leave.
    pub total: i64,
    /// By the group's name; empty when no groups were asked for.
    pub groups: BTreeMap<String, i64>,
}

/// Counts jobs.
pub async fn count(
    service: &Service,
    filter: &Filter,
    group_by: Option<GroupBy>,
) -> Result<Count, ApiError> {
    let groups = service
        .store
        .count(service.sees(), filter, group_by)
        .await?;
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
    let service = service.clone();
    detached(async move {
        match service
            .store
            .edit(service.sees(), id, &edit, version)
            .await?
        {
            Some(Ok(job)) => {
                service.queue.announce(&[job.key]);
                Ok(job)
            }
            Some(Err(version)) => Err(ApiError::StaleVersion(version)),
            None => Err(absent(&service, id).await?),
        }
    })
    .await
}

/// Asks a job to stop.
pub async fn cancel(service: &Arc<Service>, id: JobId) -> Result<(Cancellation, Job), ApiError> {
    let key = get(service, id).await?.key;
    let service = service.clone();
    detached(async move {
        let outcome = match service.queue.cancel(key).await? {
            CancelOutcome::Canceled(_) => Cancellation::Canceled,
            CancelOutcome::Requested { .. } => Cancellation::CancelRequested,
            CancelOutcome::AlreadyTerminal => Cancellation::AlreadyTerminal,
        };
        Ok((outcome, get(&service, id).await?))
    })
    .await
}

/// What asking a job to stop did.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Cancellation {
    /// Nobody ran it, and nobody will.
    Canceled,
    /// It was running; it will have ended in half a second.
    CancelRequested,
    /// It had ended.
    AlreadyTerminal,
}

/// Deletes a job that has ended, with its events and its result.
pub async fn delete(service: &Arc<Service>, id: JobId) -> Result<(), ApiError> {
    let job = get(service, id).await?;
    let service = service.clone();
    detached(async move {
        match service.store.delete(service.sees(), job.key).await? {
            Deletion::Deleted => {
                service.queue.announce(&[job.key]);
                Ok(())
            }
            Deletion::Active => Err(ApiError::JobActive(job.status.as_str())),
            Deletion::Unknown => Err(absent(&service, id).await?),
        }
    })
    .await
}

/// What was done to many jobs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, JsonSchema)]
pub struct Many {
    /// Jobs that the filters leave.
    pub matched: u64,
    /// Those of them that changed.
    pub changed: u64,
}

/// Asks all jobs of a filter to stop; jobs that come later are not meant.
pub async fn cancel_many(service: &Arc<Service>, filter: Filter) -> Result<Many, ApiError> {
    for_each(service, filter, |service: Arc<Service>, key| async move {
        let outcome = service.queue.cancel(key).await?;
        Ok(outcome != CancelOutcome::AlreadyTerminal)
    })
    .await
}

/// Deletes all jobs of a filter that have ended.
pub async fn delete_many(service: &Arc<Service>, filter: Filter) -> Result<Many, ApiError> {
    for_each(service, filter, |service: Arc<Service>, key| async move {
        let deleted = service.store.delete(service.sees(), key).await? == Deletion::Deleted;
        if deleted {
            service.queue.announce(&[key]);
        }
        Ok(deleted)
    })
    .await
}

/// Does the same to every job of a filter, each in a transaction of its own: nobody else waits for all of
/// them. A client that hangs up changes nothing.
async fn for_each<F: Future<Output = Result<bool, ApiError>> + Send>(
    service: &Arc<Service>,
    filter: Filter,
    act: impl Fn(Arc<Service>, i64) -> F + Send + 'static,
) -> Result<Many, ApiError> {
    const AT_ONCE: i64 = 1000;
    if filter.is_empty() {
        return Err(ApiError::MissingFilter(FILTERS));
    }
    let service = service.clone();
    detached(async move {
        let last = service.store.last_key().await?;
        let (mut after, mut many) = (0, Many::default());
        loop {
            let keys = service
                .store
                .keys(service.sees(), &filter, after, last, AT_ONCE)
                .await?;
            let Some(end) = keys.last() else {
                return Ok(many);
            };
            after = *end;
            for key in keys {
                many.matched += 1;
                many.changed += u64::from(act(service.clone(), key).await?);
            }
        }
    })
    .await
}
