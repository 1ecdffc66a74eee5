//! The operations on sweeps: many problems that differ in a few values.

use axum::{
    Json,
    http::{HeaderName, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use base::{
    address::link,
    catalog::Code,
    job::SweepId,
    sweep::{MemberRow, Sweep, SweepEvent},
};
use schemars::JsonSchema;
use serde::Serialize;
use service::{
    error::ApiError,
    formats::Format,
    transfer::HasShare,
    verbs::{
        key::Key,
        page::{PAGE_SIZE, PAGE_TOKEN, Paging},
        sweeps::{self as verbs, ID, NUMBER, WAIT},
        watch::AFTER_SEQ,
    },
};

use super::{
    content::{self, data, json, lines, nothing, stream},
    headers::{etag, location, replayed, retry_after},
    operation::{CANCEL, Operation, READ, SUBMIT, delete, get, post},
    submit::{self, KEY, SUBMITTING},
};
use crate::rest::{
    accept::FormatOf,
    bodies::{self, SweepSubmission},
    call::Call,
    data::{self, PART, Part},
    events::{self, LAST_EVENT_ID},
    headers::{Header, IF_NONE_MATCH, PREFER, Tags},
};

pub(super) fn operations() -> Vec<Operation> {
    const TABLE: FormatOf = FormatOf(Format::OF_TABLES);
    vec![
        post(SUBMIT, "/v1/sweeps", (KEY,), create_sweep)
            .rpcs(&["CreateSweep"])
            .summary("Submits a sweep: one problem with many values, at most 10,000 members, all or none; members on the same body are solved by one job, or by several if there are many")
            .body(json::<SweepSubmission>())
            .example(content::sweep())
            .answers(202, "The accepted sweep", json::<Sweep>())
            .with([location(), etag(), retry_after()])
            .sometimes_with(replayed())
            .fails(SUBMITTING),
        get(READ, "/v1/sweeps", (PAGE_SIZE, PAGE_TOKEN), list_sweeps)
            .rpcs(&["ListSweeps"])
            .summary("Lists sweeps, newest first")
            .answers(200, "A page of sweeps", json::<List>())
            .fails(&[Code::BadPageToken]),
        get(READ, "/v1/sweeps/{id}", (ID, WAIT, IF_NONE_MATCH), get_sweep)
            .rpcs(&["GetSweep"])
            .summary("Returns a sweep now, or when it has ended: its status, and how many of its members have ended")
            .answers(200, "The sweep", json::<Sweep>())
            .with([etag()])
            .answers(304, "The sweep has not changed", nothing())
            .with([etag()]),
        get(READ, "/v1/sweeps/{id}/results",
            (ID, TABLE, PAGE_SIZE, PAGE_TOKEN, PART),
            list_sweep_members,
        )
        .rpcs(&["ListSweepMembers"])
        .summary("Returns the table of a sweep with a row for each member, which fills while the sweep runs: in pages as JSON, as a whole in the other formats")
        .file("The rows", data::<Rows>(Format::OF_TABLES))
        .fails(&[Code::BadPageToken]),
        get(READ, "/v1/sweeps/{id}/events",
            (ID, AFTER_SEQ, Header(LAST_EVENT_ID)),
            watch_sweep,
        )
        .rpcs(&["WatchSweep"])
        .summary("Streams the rows of a sweep's members as they end, past ones first, until `done`")
        .answers(200, "The events, each with its number; a comment every 15 s", [stream::<SweepEvent>(), lines()].concat())
        .answers(204, "The sweep has ended, and there are no events after that number", nothing())
        .fails(&[Code::NotAcceptable, Code::Draining]),
        post(CANCEL, "/v1/sweeps/{id}/cancel", (ID,), cancel_sweep)
            .rpcs(&["CancelSweep"])
            .summary("Asks all jobs of a sweep to stop; finished rows are kept")
            .answers(200, "The sweep", json::<Sweep>())
            .with([etag()])
            .fails(&[Code::StorageFull]),
        delete(CANCEL, "/v1/sweeps/{id}", (ID,), delete_sweep)
            .rpcs(&["DeleteSweep"])
            .summary("Deletes a sweep that has ended, with its jobs and rows")
            .answers(204, "Deleted; the sweep's id answers 410 for 7 days", nothing())
            .fails(&[Code::JobActive, Code::StorageFull]),
        post(SUBMIT, "/v1/sweeps/{id}/members/{number}/job",
            (ID, NUMBER, KEY, PREFER),
            create_member_job,
        )
        .rpcs(&["CreateMemberJob"])
        .summary("Submits a member of a sweep as a job of its own, for its fields, profiles and history")
        .submits(),
    ]
}

/// The number of seconds after which clients should poll a sweep that was accepted.
const POLL_AFTER_S: u64 = 1;

async fn create_sweep(mut call: Call, key: Option<Key>) -> Result<Response, ApiError> {
    call.service.accepting()?;
    let text = call.json().await?;
    let request = call.service.work(move || bodies::sweep(&text)).await??;
    let submitted = verbs::create(&call.service, &call.caller, request, key).await?;
    let sweep = submitted.accepted;
    let mut response = (StatusCode::ACCEPTED, sweep_response(&sweep)).into_response();
    let name = HeaderName::from_static("idempotency-replayed");
    let headers = [
        (
            header::LOCATION,
            Some(link(&format!("/v1/sweeps/{}", sweep.id))),
        ),
        (header::RETRY_AFTER, Some(POLL_AFTER_S.to_string())),
        (name, submitted.replayed.then(|| "true".to_owned())),
    ];
    for (name, value) in headers {
        if let Some(Ok(value)) = value.map(|value| HeaderValue::from_str(&value)) {
            response.headers_mut().insert(name, value);
        }
    }
    Ok(response)
}

/// A page of sweeps.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "SweepList")]
struct List {
    sweeps: Vec<Sweep>,
    next_page_token: Option<String>,
}

async fn list_sweeps(
    call: Call,
    size: Option<i64>,
    token: Option<String>,
) -> Result<Json<List>, ApiError> {
    let paging = Paging { size, token };
    let page = verbs::list(&call.service, &call.caller, &paging).await?;
    Ok(Json(List {
        sweeps: page.items,
        next_page_token: page.next,
    }))
}

async fn get_sweep(
    call: Call,
    id: SweepId,
    wait_s: Option<f64>,
    seen: Option<Tags>,
) -> Result<Response, ApiError> {
    let Call {
        service, caller, ..
    } = &call;
    let sweep = match wait_s {
        None => verbs::get(service, caller, id).await?,
        Some(wait_s) => verbs::wait(service, caller, id, wait_s).await?,
    };
    let tag = tag(&sweep);
    if seen.is_some_and(|seen| seen.contain(&tag)) {
        return Ok((StatusCode::NOT_MODIFIED, [(header::ETAG, tag)]).into_response());
    }
    Ok(sweep_response(&sweep))
}

/// A page of the members of a sweep.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "SweepResults")]
struct Rows {
    members: Vec<MemberRow>,
    next_page_token: Option<String>,
}

async fn list_sweep_members(
    call: Call,
    id: SweepId,
    format: Format,
    size: Option<i64>,
    token: Option<String>,
    part: Part,
) -> Result<Response, ApiError> {
    let Call {
        service, caller, ..
    } = &call;
    if format == Format::Json {
        let paging = Paging { size, token };
        let page = verbs::rows(service, caller, id, &paging).await?;
        let rows = Rows {
            members: page.items,
            next_page_token: page.next,
        };
        let bytes = serde_json::to_vec(&rows).map_err(ApiError::internal)?;
        data::whole(&part, format, format!("{id}.results"), bytes)
    } else {
        for (name, expected, given) in [
            (PAGE_SIZE.name, PAGE_SIZE.meaning, size.is_some()),
            (PAGE_TOKEN.name, PAGE_TOKEN.meaning, token.is_some()),
        ] {
            if given {
                return Err(ApiError::BadParameter {
                    name,
                    got: format!("`{name}` with the format {}", format.name()),
                    expected: format!("only with the format json ({expected})"),
                });
            }
        }
        let bytes = verbs::table(service, caller, id, format).await?;
        let mut response = data::whole(&part, format, format!("{id}.results"), bytes)?;
        response.extensions_mut().insert(HasShare);
        Ok(response)
    }
}

async fn watch_sweep(
    call: Call,
    id: SweepId,
    asked: Option<i64>,
    seen: Option<i64>,
) -> Result<Response, ApiError> {
    let after = seen.or(asked).unwrap_or(0);
    let events = verbs::watch(&call.service, &call.caller, id, after).await?;
    events::answer(&call.headers, events)
}

async fn cancel_sweep(call: Call, id: SweepId) -> Result<Response, ApiError> {
    let sweep = verbs::cancel(&call.service, &call.caller, id).await?;
    Ok(sweep_response(&sweep))
}

async fn delete_sweep(call: Call, id: SweepId) -> Result<StatusCode, ApiError> {
    verbs::delete(&call.service, &call.caller, id).await?;
    Ok(StatusCode::NO_CONTENT)
}

async fn create_member_job(
    call: Call,
    id: SweepId,
    number: i64,
    key: Option<Key>,
    wait_s: Option<u64>,
) -> Result<Response, ApiError> {
    let Call {
        service, caller, ..
    } = &call;
    let submitted = verbs::solve_member(service, caller, id, number, key).await?;
    submit::answer(call, submitted, wait_s, false).await
}

/// Answers with a sweep, and its version as entity tag.
fn sweep_response(sweep: &Sweep) -> Response {
    ([(header::ETAG, tag(sweep))], Json(sweep)).into_response()
}

fn tag(sweep: &Sweep) -> String {
    format!("\"{}\"", sweep.version)
}
