//! The operations on `/v1/sweeps`.

use axum::{
    Json,
    http::{HeaderName, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use base::{
    address::link,
    job::SweepId,
    sweep::{MemberRow, Sweep},
    values::Integers,
};
use schemars::JsonSchema;
use serde::Serialize;
use service::{
    error::ApiError,
    formats::Format,
    parameters::Parameter,
    transfer::HasShare,
    verbs::{
        key::Key,
        page::{PAGE_SIZE, PAGE_TOKEN, Paging},
        sweeps as verbs,
    },
};

use super::{
    bodies,
    call::Call,
    data::{self, Part},
    events,
    headers::Tags,
    submit,
};

/// Seconds after which to poll a sweep that was accepted.
const POLL_AFTER_S: u64 = 1;

pub(super) async fn create(mut call: Call, key: Option<Key>) -> Result<Response, ApiError> {
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
pub(super) struct List {
    sweeps: Vec<Sweep>,
    next_page_token: Option<String>,
}

pub(super) async fn list(
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

pub(super) async fn get(
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
pub(super) struct Rows {
    members: Vec<MemberRow>,
    next_page_token: Option<String>,
}

pub(super) async fn results(
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

/// The header that a browser adds when it reconnects to the same address.
pub(super) const LAST_EVENT_ID: Parameter<Integers> = events::LAST_EVENT_ID;

pub(super) async fn events(
    call: Call,
    id: SweepId,
    asked: Option<i64>,
    seen: Option<i64>,
) -> Result<Response, ApiError> {
    let after = seen.or(asked).unwrap_or(0);
    let events = verbs::watch(&call.service, &call.caller, id, after).await?;
    events::answer(&call.headers, events)
}

pub(super) async fn cancel(call: Call, id: SweepId) -> Result<Response, ApiError> {
    let sweep = verbs::cancel(&call.service, &call.caller, id).await?;
    Ok(sweep_response(&sweep))
}

pub(super) async fn delete(call: Call, id: SweepId) -> Result<StatusCode, ApiError> {
    verbs::delete(&call.service, &call.caller, id).await?;
    Ok(StatusCode::NO_CONTENT)
}

pub(super) async fn solve_member(
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

/// A sweep with its version as entity tag.
fn sweep_response(sweep: &Sweep) -> Response {
    ([(header::ETAG, tag(sweep))], Json(sweep)).into_response()
}

fn tag(sweep: &Sweep) -> String {
    format!("\"{}\"", sweep.version)
}
