//! The operations `/v1/jobs` (list), `/v1/jobs/{id}`, `…/problem` and `…/cancel`.

use axum::{
    Json,
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use base::{
    job::{Job, JobId},
    values::Values,
};
use schemars::JsonSchema;
use serde::Serialize;
use service::{
    error::ApiError,
    verbs::{
        bulk::{self, BulkResult},
        jobs::{self as verbs, Cancellation, LabelChanges},
        lists::{self, Count},
        page::Paging,
        watch::{self, UNTIL, Until, WAIT},
    },
};
use solver::problem::Problem;
use store::{Filter, GroupBy, Order};

use super::{
    bodies::{edit, merge_patch},
    body::is_merge_patch,
    call::Call,
    headers::{Tags, version_tag},
};

pub(super) async fn get(
    call: Call,
    id: JobId,
    wait_s: Option<f64>,
    until: Option<Until>,
    seen: Option<Tags>,
) -> Result<Response, ApiError> {
    if let (Some(_), None) = (until, wait_s) {
        return Err(ApiError::BadParameter {
            name: UNTIL.name,
            got: format!("`{}` without `{}`", UNTIL.name, WAIT.name),
            expected: format!("also `{}`, {}", WAIT.name, WAIT.values.expected()),
        });
    }
    let Call {
        service, caller, ..
    } = &call;
    let job = match wait_s {
        None => verbs::get(service, caller, id).await?,
        Some(wait_s) => {
            let known = seen.as_ref().and_then(Tags::version);
            let until = until.unwrap_or(known.map_or(Until::NextChange, Until::Changed));
            let (job, _) = watch::wait(service, caller, id, until, wait_s).await?;
            job
        }
    };
    let tag = tag(&job);
    if seen.is_some_and(|seen| seen.contain(&tag)) {
        return Ok((StatusCode::NOT_MODIFIED, [(header::ETAG, tag)]).into_response());
    }
    Ok(job_response(&job))
}

/// A page of jobs.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "JobList")]
pub(super) struct List {
    jobs: Vec<Job>,
    next_page_token: Option<String>,
}

pub(super) async fn list(
    call: Call,
    filter: Filter,
    size: Option<i64>,
    token: Option<String>,
    order: Option<Order>,
) -> Result<Json<List>, ApiError> {
    let paging = Paging { size, token };
    let page = lists::list(&call.service, &call.caller, &filter, order, &paging).await?;
    Ok(Json(List {
        jobs: page.items,
        next_page_token: page.next,
    }))
}

pub(super) async fn count(
    call: Call,
    filter: Filter,
    group_by: Option<GroupBy>,
) -> Result<Json<Count>, ApiError> {
    let count = lists::count(&call.service, &call.caller, &filter, group_by).await?;
    Ok(Json(count))
}

pub(super) async fn problem(call: Call, id: JobId) -> Result<Json<Problem>, ApiError> {
    Ok(Json(verbs::problem(&call.service, &call.caller, id).await?))
}

pub(super) async fn update(
    mut call: Call,
    id: JobId,
    meant_for: Option<Tags>,
) -> Result<Response, ApiError> {
    let (edit, labels) = if is_merge_patch(&call.headers) {
        merge_patch(&call.merge_patch().await?)?
    } else {
        (edit(&call.json().await?)?, LabelChanges::new())
    };
    let Call {
        service, caller, ..
    } = &call;
    let versions = meant_for.as_ref().and_then(Tags::versions);
    let job = verbs::update(service, caller, id, edit, labels, versions).await?;
    Ok(job_response(&job))
}

pub(super) async fn cancel(call: Call, id: JobId) -> Result<Response, ApiError> {
    let (outcome, job) = verbs::cancel(&call.service, &call.caller, id).await?;
    let tag = [(header::ETAG, tag(&job))];
    Ok((tag, Json(Canceled { outcome, job })).into_response())
}

pub(super) async fn delete(call: Call, id: JobId) -> Result<StatusCode, ApiError> {
    verbs::delete(&call.service, &call.caller, id).await?;
    Ok(StatusCode::NO_CONTENT)
}

pub(super) async fn cancel_many(call: Call, filter: Filter) -> Result<Json<BulkResult>, ApiError> {
    let many = bulk::cancel_many(&call.service, &call.caller, filter).await?;
    Ok(Json(many))
}

pub(super) async fn delete_many(call: Call, filter: Filter) -> Result<Json<BulkResult>, ApiError> {
    let many = bulk::delete_many(&call.service, &call.caller, filter).await?;
    Ok(Json(many))
}

/// One job with its version as entity tag.
pub(super) fn job_response(job: &Job) -> Response {
    ([(header::ETAG, tag(job))], Json(job)).into_response()
}

pub(super) fn tag(job: &Job) -> String {
    version_tag(job.version)
}

/// The effect of asking a job to stop, and the job.
#[derive(Serialize, JsonSchema)]
pub(super) struct Canceled {
    outcome: Cancellation,
    job: Job,
}
