//! Operations on one job: get, edit, cancel and delete the job, and get its problem.

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

/// Returns the job in its present state.
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

/// Opens a snapshot of a job and its result so far, both at the same moment.
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

/// Returns the problem of a job as it was submitted, with its defaults filled in.
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

/// Changes the editable fields of a job, if the version of the job is one of `versions`; `None`: any version.
pub fn update<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: JobId,
    edit: Edit,
    labels: LabelChanges,
    versions: Option<Vec<i64>>,
) -> BoxFuture<'a, Result<Job, ApiError>> {
    Box::pin(async move {
        // before the job is looked at: a condition is judged only if the request is valid (RFC 9110, 13.2.1)
        let mut violations = edit_violations(&edit);
        let set = labels.iter();
        let set = set.filter_map(|(name, value)| Some((name.clone(), value.clone()?)));
        violations.extend(envelope::label_violations(&set.collect()));
        violations.extend(envelope::label_changes_violation(labels.len()));
        violations
            .into_result(())
            .map_err(ApiError::InvalidProblem)?;
        let by = caller.clone();
        let decide = move |job: &Job| {
            let raised = edit.priority.filter(|priority| *priority != job.priority);
            may_have_priorities(&by, raised.into_iter())?;
            match &versions {
                Some(known) if !known.contains(&job.version) => {
                    return Err(ApiError::StaleVersion(job.version));
                }
                _ if labels.is_empty() => return Ok(edit.clone()),
                _ => {}
            }
            let mut all = job.labels.clone();
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
            edit_violations(&edit)
                .into_result(edit)
                .map_err(ApiError::InvalidProblem)
        };
        change(service, caller, id, decide).await
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

/// Changes the editable fields of a job: `edit` receives the present job and returns the changes, or refuses them.
async fn change(
    service: &Arc<Service>,
    caller: &Caller,
    id: JobId,
    edit: impl Fn(&Job) -> Result<Edit, ApiError> + Send + 'static,
) -> Result<Job, ApiError> {
    let (service, caller) = (service.clone(), caller.clone());
    detached(async move {
        match service
            .store
            .edit(caller.visible_owners(), id, edit)
            .await?
        {
            Some(edited) => {
                let job = edited?;
                service.queue.announce(&[job.key]);
                Ok(job)
            }
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

/// Makes the error if `deletion` says that the job was not deleted.
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use futures_util::future::try_join_all;

    use super::*;
    use crate::verbs::tests::{caller, service, waiting};

    #[tokio::test]
    async fn labels_that_are_set_at_the_same_time_are_all_there() {
        let folder = tempfile::tempdir().unwrap();
        let (service, ada) = (service(folder.path()).await, caller("ada"));
        let id = waiting(&service, &ada).await;
        let names: Vec<String> = (0..30).map(|n| n.to_string()).collect();
        let set = |name: &String| {
            let change = LabelChanges::from([(name.clone(), Some("x".to_owned()))]);
            update(&service, &ada, id, Edit::default(), change, None)
        };
        try_join_all(names.iter().map(set)).await.unwrap();
        let job = get(&service, &ada, id).await.unwrap();
        assert!(names.iter().all(|name| job.labels.contains_key(name)));
        assert_eq!((job.labels.len(), job.version), (30, 31));
    }

    /// The priority is compared with that of the job as it is: to leave a high one as it is needs no right.
    #[tokio::test]
    async fn an_edit_that_is_refused_changes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let (service, ada) = (service(folder.path()).await, caller("ada"));
        let id = waiting(&service, &ada).await;
        let edit = |priority| Edit {
            name: Some(Some("new".into())),
            priority: Some(priority),
            ..Edit::default()
        };
        let none = LabelChanges::new;
        let raised = update(&service, &ada, id, edit(3), none(), None).await;
        assert!(matches!(raised, Err(ApiError::Forbidden(_))));
        let stale = update(&service, &ada, id, edit(0), none(), Some(vec![7])).await;
        assert!(matches!(stale, Err(ApiError::StaleVersion(1))));
        let full = (0..65).map(|n| (n.to_string(), Some(String::new())));
        let full = update(&service, &ada, id, edit(0), full.collect(), None).await;
        assert!(matches!(full, Err(ApiError::InvalidProblem(_))));
        let job = get(&service, &ada, id).await.unwrap();
        assert_eq!((job.name, job.version), (None, 1));
        let admin = update(&service, &Caller::local(), id, edit(3), none(), None).await;
        assert_eq!(admin.unwrap().priority, 3);
        let kept = update(&service, &ada, id, edit(3), none(), Some(vec![2])).await;
        assert_eq!(kept.unwrap().version, 2);
    }
}
