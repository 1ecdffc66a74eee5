//! The operations on jobs that exist: get, list, wait, watch, edit, cancel, delete.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use axum::{
    Json,
    http::{HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use base::{
    catalog::Code,
    event::Event,
    job::{Job, JobId},
    values::{Values, Words},
};
use files::table::Table;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Value, value::RawValue};
use service::{
    error::ApiError,
    formats::{self, Format},
    parameters::Parameter,
    verbs::{
        bulk::{self, BulkResult},
        job_table::{self, COLUMNS, Columns, DIFFERING, NEXT_PAGE_TOKEN, ROWS},
        jobs::{self as verbs, Cancellation, ID, LabelChanges},
        lists::{self, Count, FIELDS, GROUP_BY, ORDER_BY},
        page::{PAGE_SIZE, PAGE_TOKEN, Paging},
        results::PARTIAL,
        views,
        watch::{self, AFTER_SEQ, UNTIL, Until, WAIT},
        watch_list::{AFTER, ListPayload},
    },
};
use solver::problem::Problem;
use store::{Filter, GroupBy, Order};

use super::{
    content::{data, json, lines, merge_patch, nothing, stream, the_problem},
    headers::etag,
    operation::{CANCEL, Operation, READ, SUBMIT, delete, get, patch, post},
};
use crate::rest::{
    accept::FormatOf,
    bodies::{self, Edits, MergePatch},
    body::is_merge_patch,
    call::Call,
    data::{self, PART, Part},
    events::{self, LAST_EVENT_ID, LAST_LIST_EVENT_ID},
    filters::FILTERS,
    headers::{Header, IF_MATCH, IF_NONE_MATCH, Tags, version_tag},
    job_row::{JobRow, row},
};

pub(super) fn operations() -> Vec<Operation> {
    const TABLE: FormatOf = FormatOf(Format::OF_TABLES);
    vec![
        get(READ, "/v1/jobs", (FILTERS, FIELDS, PAGE_SIZE, PAGE_TOKEN, ORDER_BY), list_jobs)
            .rpcs(&["ListJobs"])
            .summary("Lists jobs, newest first")
            .answers(200, "A page of jobs. It may be short or empty before the list ends, since a limited number of jobs is checked for each page: the list ends where there is no next_page_token", json::<List>())
            .fails(&[Code::BadPageToken]),
        get(READ, "/v1/jobs/count", (FILTERS, GROUP_BY), count_jobs)
            .rpcs(&["CountJobs"])
            .summary("Counts jobs")
            .answers(200, "The number of jobs", json::<Count>()),
        get(
            READ,
            "/v1/jobs/table",
            (FILTERS, (COLUMNS, DIFFERING), TABLE, NUMBERS_OF_ALL, ROWS, PAGE_TOKEN, ORDER_BY, PART),
            list_job_table,
        )
        .rest_only("GetJobTable")
        .summary("Returns jobs and the numbers of their results, with their errors, as one table: a row for each job, newest first")
        .file("The rows. There may be fewer than asked for before the table ends, since a limited number of jobs is checked for each answer: it ends where there is no next page", data::<JobTable>(Format::OF_TABLES))
        .with_next_page()
        .fails(&[Code::BadPageToken]),
        get(READ, "/v1/jobs/{id}", (ID, WAIT, UNTIL, IF_NONE_MATCH), get_job)
            .rpcs(&["GetJob", "WaitJob"])
            .summary("Returns a job now, or after it has changed or ended")
            .answers(200, "The job", json::<Job>())
            .with([etag()])
            .answers(304, "The job has not changed", nothing())
            .with([etag()]),
        get(READ, "/v1/jobs/{id}/problem", (ID,), get_job_problem)
            .rpcs(&["GetJobProblem"])
            .summary("Returns the exact input of a job, with its defaults filled in")
            .answers(200, "The problem", the_problem()),
        get(READ, "/v1/jobs/{id}/description", (ID,), get_job_description)
            .rpcs(&["GetJobDescription"])
            .summary("Returns the problem of a job in words")
            .answers(200, "The description", json::<Description>()),
        get(READ, "/v1/jobs/{id}/events", (ID, AFTER_SEQ, Header(LAST_EVENT_ID)), events::events)
            .rpcs(&["WatchJob"])
            .summary("Streams the events of a job, past ones first, then live ones, until `done`")
            .answers(200, "The events, each with its number; a comment every 15 s", [stream::<Event>(), lines()].concat())
            .answers(204, "The job has ended, and there are no events after that number", nothing())
            .fails(&[Code::NotAcceptable, Code::Draining]),
        get(READ, "/v1/events", (FILTERS, FIELDS, AFTER, Header(LAST_LIST_EVENT_ID)), events::list_events)
            .rpcs(&["WatchJobs"])
            .summary("Streams what happens to the jobs that match the filters: accepted, changed or removed jobs, their progress at most twice a second, rows of sweeps, counts, the queue. `reset` says that the list is to be read again, as after a restart of the service")
            .answers(200, "The events; the last of those that belong together has an id; a comment every 15 s", [stream::<ListPayload>(), lines()].concat())
            .fails(&[Code::NotAcceptable, Code::Draining]),
        patch(SUBMIT, "/v1/jobs/{id}", (ID, IF_MATCH), update_job)
            .rpcs(&["UpdateJob"])
            .summary("Changes the name, labels or priority of a job, or whether it is kept permanently")
            .body([json::<Edits>(), merge_patch::<MergePatch>()].concat())
            .answers(200, "The changed job", json::<Job>())
            .with([etag()])
            .fails(&[Code::InvalidProblem, Code::StaleVersion, Code::StorageFull]),
        post(CANCEL, "/v1/jobs/{id}/cancel", (ID,), cancel_job)
            .rpcs(&["CancelJob"])
            .summary("Asks a job to stop; it ends within half a second")
            .answers(200, "The effect, and the job", json::<Canceled>())
            .with([etag()])
            .fails(&[Code::StorageFull]),
        delete(CANCEL, "/v1/jobs/{id}", (ID,), delete_job)
            .rpcs(&["DeleteJob"])
            .summary("Deletes a job that has ended, with its events and its result")
            .answers(204, "Deleted; the job's id answers 410 for 7 days (kept for the last 100,000 deleted jobs)", nothing())
            .fails(&[Code::JobActive, Code::StorageFull]),
        post(CANCEL, "/v1/jobs/cancel", (FILTERS,), cancel_jobs)
            .rpcs(&["CancelJobs"])
            .summary("Asks all jobs that match the filters to stop")
            .answers(200, "How many jobs matched, and how many of them changed", json::<BulkResult>())
            .fails(&[Code::MissingFilter, Code::StorageFull]),
        delete(CANCEL, "/v1/jobs", (FILTERS,), delete_jobs)
            .rpcs(&["DeleteJobs"])
            .summary("Deletes all jobs that match the filters and have ended, pinned ones too")
            .answers(200, "How many jobs matched, and how many of them were deleted", json::<BulkResult>())
            .fails(&[Code::MissingFilter, Code::StorageFull]),
    ]
}

async fn get_job(
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
struct List {
    /// The jobs, with the fields that were asked for.
    #[schemars(with = "Vec<Job>")]
    jobs: Vec<JobRow>,
    next_page_token: Option<String>,
}

async fn list_jobs(
    call: Call,
    filter: Filter,
    fields: Option<BTreeSet<&'static str>>,
    size: Option<i64>,
    token: Option<String>,
    order: Option<Order>,
) -> Result<Json<List>, ApiError> {
    let paging = Paging { size, token };
    let page = lists::list(&call.service, &call.caller, &filter, order, &paging).await?;
    let fields = fields.map(Arc::new);
    let rows = page.items.into_iter().map(|job| row(job, fields.as_ref()));
    Ok(Json(List {
        jobs: rows.collect(),
        next_page_token: page.next,
    }))
}

/// `partial` of the table, which has a row for every job.
const NUMBERS_OF_ALL: Parameter<Words<bool>> = Parameter {
    meaning: "Whether the table also has the numbers of jobs that failed or were canceled, which are those of the state at which they stopped, not of a solution; default false",
    ..PARTIAL
};

/// A part of the table of jobs.
#[derive(Serialize, JsonSchema)]
struct JobTable {
    /// The names of the columns.
    columns: Vec<String>,
    /// The rows: the values by the names of their columns, null where a job has no such number.
    #[schemars(with = "Vec<BTreeMap<String, Value>>")]
    rows: Vec<Box<RawValue>>,
    next_page_token: Option<String>,
}

#[expect(
    clippy::too_many_arguments,
    reason = "each is a parameter of the request"
)]
async fn list_job_table(
    call: Call,
    filter: Filter,
    (columns, differing): (Option<Columns>, Option<bool>),
    format: Format,
    partial: Option<bool>,
    size: Option<i64>,
    token: Option<String>,
    order: Option<Order>,
    part: Part,
) -> Result<Response, ApiError> {
    let request = job_table::Request {
        filter,
        order,
        paging: Paging { size, token },
        columns,
        partial: partial.unwrap_or_default(),
        differing: differing.unwrap_or_default(),
    };
    let (table, next) = job_table::table(&call.service, &call.caller, request).await?;
    let token = next.clone();
    let write = move || match format {
        Format::Json => table_as_json(&table, token),
        _ => formats::answer_table(&table, format),
    };
    let bytes = call.service.work(write).await??;
    let mut response = data::whole(&part, format, "jobs".into(), bytes)?;
    if let Some(token) = next {
        let token = HeaderValue::from_str(&token).map_err(ApiError::internal)?;
        response.headers_mut().insert(NEXT_PAGE_TOKEN, token);
    }
    Ok(response)
}

fn table_as_json(table: &Table, next_page_token: Option<String>) -> Result<Vec<u8>, ApiError> {
    let lines = table.jsonl().map_err(ApiError::internal)?;
    let rows = lines.lines().map(|line| RawValue::from_string(line.into()));
    let table = JobTable {
        columns: table
            .columns
            .iter()
            .map(|column| column.name.to_string())
            .collect(),
        rows: rows.collect::<Result<_, _>>().map_err(ApiError::internal)?,
        next_page_token,
    };
    serde_json::to_vec(&table).map_err(ApiError::internal)
}

async fn count_jobs(
    call: Call,
    filter: Filter,
    group_by: Option<GroupBy>,
) -> Result<Json<Count>, ApiError> {
    let count = lists::count(&call.service, &call.caller, &filter, group_by).await?;
    Ok(Json(count))
}

async fn get_job_problem(call: Call, id: JobId) -> Result<Json<Problem>, ApiError> {
    Ok(Json(verbs::problem(&call.service, &call.caller, id).await?))
}

/// A problem in words.
#[derive(Serialize, JsonSchema)]
struct Description {
    /// A few sentences.
    description: String,
}

async fn get_job_description(call: Call, id: JobId) -> Result<Json<Description>, ApiError> {
    let description = views::description(&call.service, &call.caller, id).await?;
    Ok(Json(Description { description }))
}

async fn update_job(
    mut call: Call,
    id: JobId,
    meant_for: Option<Tags>,
) -> Result<Response, ApiError> {
    let (edit, labels) = if is_merge_patch(&call.headers) {
        bodies::merge_patch(&call.merge_patch().await?)?
    } else {
        (bodies::edit(&call.json().await?)?, LabelChanges::new())
    };
    let Call {
        service, caller, ..
    } = &call;
    let versions = meant_for.as_ref().and_then(Tags::versions);
    let job = verbs::update(service, caller, id, edit, labels, versions).await?;
    Ok(job_response(&job))
}

async fn cancel_job(call: Call, id: JobId) -> Result<Response, ApiError> {
    let (outcome, job) = verbs::cancel(&call.service, &call.caller, id).await?;
    let tag = [(header::ETAG, tag(&job))];
    Ok((tag, Json(Canceled { outcome, job })).into_response())
}

async fn delete_job(call: Call, id: JobId) -> Result<StatusCode, ApiError> {
    verbs::delete(&call.service, &call.caller, id).await?;
    Ok(StatusCode::NO_CONTENT)
}

async fn cancel_jobs(call: Call, filter: Filter) -> Result<Json<BulkResult>, ApiError> {
    let many = bulk::cancel_many(&call.service, &call.caller, filter).await?;
    Ok(Json(many))
}

async fn delete_jobs(call: Call, filter: Filter) -> Result<Json<BulkResult>, ApiError> {
    let many = bulk::delete_many(&call.service, &call.caller, filter).await?;
    Ok(Json(many))
}

/// Answers with one job, and its version as entity tag.
pub(super) fn job_response(job: &Job) -> Response {
    ([(header::ETAG, tag(job))], Json(job)).into_response()
}

pub(super) fn tag(job: &Job) -> String {
    version_tag(job.version)
}

/// The job that was asked to stop, and the effect of asking.
#[derive(Serialize, JsonSchema)]
struct Canceled {
    outcome: Cancellation,
    job: Job,
}
