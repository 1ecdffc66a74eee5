//! `/v1/jobs` as a list, `/v1/jobs/{id}`, `…/problem` and `…/cancel`.

use axum::{
    Json,
    body::Body,
    extract::{RawQuery, State},
    http::{HeaderMap, StatusCode, header},
    response::{IntoResponse, Response},
};
use schemars::JsonSchema;
use serde::Serialize;
use solver::problem::Problem;

use super::{
    Rest,
    bodies::edit,
    filters,
    request::{JobPath, Params, Tags, json_text, versions},
};
use crate::{
    error::ApiError,
    job::Job,
    verbs::{
        jobs::{self as verbs, Cancellation, Count, MAX_PAGE_SIZE, Many, PAGE_SIZE},
        watch::{self, Until},
    },
};

pub(super) async fn get(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    path: JobPath,
) -> Result<Response, ApiError> {
    let params = Params::parse(query.as_deref(), &["wait", "until"])?;
    let wait_s = params.wait_s("wait")?;
    let terminal = |word: &str| (word == "terminal").then_some(Until::Terminal);
    let until = params.word("until", terminal, "terminal")?;
    if let (Some(_), None) = (until, wait_s) {
        return Err(ApiError::BadParameter {
            name: "until",
            got: "no wait beside it".into(),
            expected: "wait=0…60 with it",
        });
    }
    let seen = versions(&headers, header::IF_NONE_MATCH);
    let mut job = verbs::get(&rest.service, path.id).await?;
    if let Some(wait_s) = wait_s {
        let known = seen.as_ref().and_then(Tags::version);
        let until = until.unwrap_or(known.map_or(Until::News, Until::Changed));
        (job, _) = watch::wait(&rest.service, path.id, until, wait_s).await?;
    }
    let tag = tag(&job);
    if seen.is_some_and(|seen| seen.contain(&tag)) {
        return Ok((StatusCode::NOT_MODIFIED, [(header::ETAG, tag)]).into_response());
    }
    Ok(one(&job))
}

/// A page of jobs.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "JobList")]
pub(super) struct List {
    jobs: Vec<Job>,
    next_page_token: Option<String>,
}

pub(super) async fn list(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
) -> Result<Json<List>, ApiError> {
    let more = ["page_size", "page_token", "order_by"];
    let (filter, params) = filters::parse(query.as_deref(), &more)?;
    let order = filters::order(&params)?;
    let page_size = params.number(
        "page_size",
        1..=MAX_PAGE_SIZE,
        "a whole number from 1 to 1000",
    )?;
    let page_size = page_size.unwrap_or(PAGE_SIZE);
    let token = params.one("page_token").filter(|token| !token.is_empty());
    let page = verbs::list(&rest.service, &filter, order, page_size, token).await?;
    Ok(Json(List {
        jobs: page.jobs,
        next_page_token: page.next,
    }))
}

pub(super) async fn count(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
) -> Result<Json<Count>, ApiError> {
    let (filter, params) = filters::parse(query.as_deref(), &["group_by"])?;
    let group_by = filters::group_by(&params)?;
    Ok(Json(verbs::count(&rest.service, &filter, group_by).await?))
}

pub(super) async fn problem(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    path: JobPath,
) -> Result<Json<Problem>, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    Ok(Json(verbs::problem(&rest.service, path.id).await?))
}

pub(super) async fn update(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    path: JobPath,
    body: Body,
) -> Result<Response, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    let text = json_text(&headers, body, rest.service.max_body_bytes).await?;
    let edit = edit(&text)?;
    let version = match versions(&headers, header::IF_MATCH) {
        None => None,
        Some(tags) if tags.any() => None,
        Some(tags) => {
            let job = verbs::get(&rest.service, path.id).await?;
            // no job is of version −1
            let same = tags.contain_strongly(&tag(&job));
            Some(if same { job.version } else { -1 })
        }
    };
    Ok(one(
        &verbs::update(&rest.service, path.id, edit, version).await?
    ))
}

pub(super) async fn cancel(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    path: JobPath,
) -> Result<Response, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    let (outcome, job) = verbs::cancel(&rest.service, path.id).await?;
    let tag = [(header::ETAG, tag(&job))];
    Ok((tag, Json(Canceled { outcome, job })).into_response())
}

pub(super) async fn delete(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    path: JobPath,
) -> Result<StatusCode, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    verbs::delete(&rest.service, path.id).await?;
    Ok(StatusCode::NO_CONTENT)
}

pub(super) async fn cancel_many(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
) -> Result<Json<Many>, ApiError> {
    let (filter, _) = filters::parse(query.as_deref(), &[])?;
    Ok(Json(verbs::cancel_many(&rest.service, filter).await?))
}

pub(super) async fn delete_many(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
) -> Result<Json<Many>, ApiError> {
    let (filter, _) = filters::parse(query.as_deref(), &[])?;
    Ok(Json(verbs::delete_many(&rest.service, filter).await?))
}

/// One job with its version as entity tag.
pub(super) fn one(job: &Job) -> Response {
    ([(header::ETAG, tag(job))], Json(job)).into_response()
}

pub(super) fn tag(job: &Job) -> String {
    format!("\"{}\"", job.version)
}

/// What asking a job to stop did, and the job.
#[derive(Serialize, JsonSchema)]
pub(super) struct Canceled {
    outcome: Cancellation,
    job: Job,
}
