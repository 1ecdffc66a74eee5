//! Operations on one job: get, edit, cancel, delete; and its problem.

use std::{collections::BTreeMap, sync::Arc};

use base::{
    caller::Caller,
    id::{Ids, OfJob},
    job::{Job, JobId},
};
use futures_util::future::BoxFuture;
use schemars::JsonSchema;
use solver::{error::Findings, problem::Problem};
use store::{CancelOutcome, Deletion, Edit, Snapshot};

use super::{
    admission::may_have_priorities,
    envelope,
    service::{Service, detached},
};
use crate::{error::ApiError, parameters::Variable};

/// The id of a job in a path.
pub const ID: Variable<Ids<OfJob>> = Variable {
    name: "id",
    kind: "job",
    meaning: "The job",
    values: Ids::all(),
};

/// The job in its present state.
pub fn get<'a>(
    service: &'a Service,
    caller: &'a Caller,
    id: JobId,
) -> BoxFuture<'a, Result<Job, ApiError>> {
    Box::pin(async move {
        match service.store.job(caller.visible_owners(), id).await? {
            Some(job) => Ok(job),
            None => Err(not_found(service, caller, id).await?),
        }
    })
}

/// The job with its result so far, read at one moment.
pub(super) async fn snapshot(
    service: &Service,
    caller: &Caller,
    id: JobId,
) -> Result<Snapshot, ApiError> {
    match service.store.snapshot(caller.visible_owners(), id).await? {
        Some(found) => Ok(found),
        None => Err(not_found(service, caller, id).await?),
    }
}

async fn not_found(service: &Service, caller: &Caller, id: JobId) -> Result<ApiError, ApiError> {
    Ok(
        match service
            .store
            .was_deleted(caller.visible_owners(), id)
            .await?
        {
            true => ApiError::Deleted(id),
            false => ApiError::NotFound(format!("there is no job {id}")),
        },
    )
}

/// The problem that was submitted, with its defaults filled in.
pub fn problem<'a>(
    service: &'a Service,
    caller: &'a Caller,
    id: JobId,
) -> BoxFuture<'a, Result<Problem, ApiError>> {
    Box::pin(async move {
        let job = get(service, caller, id).await?;
        let stored = service.store.problem(job.key).await?;
        let (title, body) = stored.ok_or(ApiError::Deleted(id))?;
        let read = service.work(move || serde_json::from_str(&body)).await?;
        let problem: Problem = read.map_err(ApiError::internal)?;
        Ok(Problem { title, ..problem })
    })
}

/// Changes the editable fields of a job, if it has one of these versions; `None`: any version.
pub fn update<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: JobId,
    edit: Edit,
    labels: LabelChanges,
    versions: Option<Vec<i64>>,
) -> BoxFuture<'a, Result<Job, ApiError>> {
    Box::pin(async move {
        if labels.is_empty() {
            return replace(service, caller, id, edit, versions).await;
        }
        // before the job is looked at: a condition is judged only if the request is valid (RFC 9110, 13.2.1)
        let set = labels.iter();
        let set = set.filter_map(|(name, value)| Some((name.clone(), value.clone()?)));
        let labels_alone = Edit {
            labels: Some(set.collect()),
            ..edit.clone()
        };
        let mut violations = edit_violations(&labels_alone);
        violations.extend(envelope::label_changes_violation(labels.len()));
        violations
            .into_result(())
            .map_err(ApiError::InvalidProblem)?;
        // Changed on what there is, which must not change meanwhile; a job changes its version a few times in its life.
        const MOST_TRIES: u32 = 10;
        let mut tries = 0;
        loop {
            let job = get(service, caller, id).await?;
            if versions
                .as_ref()
                .is_some_and(|known| !known.contains(&job.version))
            {
                return Err(ApiError::StaleVersion(job.version));
            }
            let mut all = job.labels;
            for (name, value) in &labels {
                match value {
                    Some(text) => drop(all.insert(name.clone(), text.clone())),
                    None => drop(all.remove(name)),
                }
            }
            let edit = Edit {
                labels: Some(all),
                ..edit.clone()
            };
            tries += 1;
            match replace(service, caller, id, edit, Some(vec![job.version])).await {
                Err(ApiError::StaleVersion(_)) if versions.is_none() && tries < MOST_TRIES => {}
                other => return other,
            }
        }
    })
}

/// Labels to be set, or removed if they are `None`.
pub type LabelChanges = BTreeMap<String, Option<String>>;

fn edit_violations(edit: &Edit) -> Findings {
    let mut violations = Findings::default();
    let name = edit.name.iter().flatten().next();
    violations.extend(name.and_then(|name| envelope::name_violation(name)));
    violations.extend(edit.priority.and_then(envelope::priority_violation));
    violations.extend(edit.labels.iter().flat_map(envelope::label_violations));
    violations
}

async fn replace(
    service: &Arc<Service>,
    caller: &Caller,
    id: JobId,
    edit: Edit,
    versions: Option<Vec<i64>>,
) -> Result<Job, ApiError> {
    edit_violations(&edit)
        .into_result(())
        .map_err(ApiError::InvalidProblem)?;
    if let Some(priority) = edit.priority.filter(|priority| *priority > 0)
        && get(service, caller, id).await?.priority != priority
    {
        may_have_priorities(caller, [priority].into_iter())?;
    }
    let (service, caller) = (service.clone(), caller.clone());
    detached(async move {
        let (owners, versions) = (caller.visible_owners(), versions.as_deref());
        match service.store.edit(owners, id, &edit, versions).await? {
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
pub fn cancel<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: JobId,
) -> BoxFuture<'a, Result<(Cancellation, Job), ApiError>> {
    Box::pin(async move {
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
    })
}

/// The effect of asking a job to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Cancellation {
    /// The job was queued, and will not run.
    Canceled,
    /// The job was running, and ends within half a second.
    CancelRequested,
    /// The job had ended already.
    AlreadyTerminal,
}

/// Deletes a job that has ended, with its events and its result.
pub fn delete<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: JobId,
) -> BoxFuture<'a, Result<(), ApiError>> {
    Box::pin(async move {
        let job = get(service, caller, id).await?;
        let (service, caller) = (service.clone(), caller.clone());
        detached(async move {
            let deletion = service
                .store
                .delete(caller.visible_owners(), job.key)
                .await?;
            answer(&service, &caller, &job, deletion).await?;
            service.queue.announce(&[job.key]);
            Ok(())
        })
        .await
    })
}

/// Deletes mesh, displacements and stresses of a job that has ended; summary, history and profiles remain.
pub fn delete_fields<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: JobId,
) -> BoxFuture<'a, Result<(), ApiError>> {
    Box::pin(async move {
        let job = get(service, caller, id).await?;
        let (service, caller) = (service.clone(), caller.clone());
        detached(async move {
            let owners = caller.visible_owners();
            let deletion = service.store.delete_fields(owners, job.key).await?;
            answer(&service, &caller, &job, deletion).await
        })
        .await
    })
}

/// The error if a job was not deleted.
async fn answer(
    service: &Service,
    caller: &Caller,
    job: &Job,
    deletion: Deletion,
) -> Result<(), ApiError> {
    match deletion {
        Deletion::Deleted => Ok(()),
        Deletion::Active => Err(ApiError::JobActive(job.status)),
        Deletion::Unknown => Err(not_found(service, caller, job.id).await?),
    }
}
