//! `/v1/jobs/{id}/result`, `/history`, `/profiles/{boundary}` and `/fields`.

use axum::{Json, body::Body, http::StatusCode, response::Response};

use super::{
    call::Call,
    data::{self, Part},
};
use crate::{
    error::ApiError,
    formats::{self, Format},
    job::JobId,
    verbs::{
        fields as stored, history as rows, jobs,
        profiles::{self, Points},
        results::{self, JobResult},
    },
};

pub(super) async fn result(call: Call, id: JobId) -> Result<Json<JobResult>, ApiError> {
    let result = results::result(&call.service, &call.caller, id).await?;
    Ok(Json(result))
}

pub(super) async fn history(
    call: Call,
    id: JobId,
    format: Format,
    max_points: Option<i64>,
    part: Part,
) -> Result<Response, ApiError> {
    let rows = rows::history(&call.service, &call.caller, id, max_points).await?;
    let bytes = call.service.work(move || formats::history(&rows, format));
    let bytes = bytes.await?.map_err(ApiError::internal)?;
    data::whole(&part, format, format!("{id}.history"), bytes)
}

pub(super) async fn profile(
    call: Call,
    id: JobId,
    boundary: String,
    format: Format,
    step: Option<String>,
    points: Option<Points>,
    part: Part,
) -> Result<Response, ApiError> {
    let Call {
        service, caller, ..
    } = &call;
    let points = points.unwrap_or_default();
    let profile = profiles::profile(service, caller, id, &boundary, step.as_deref(), points);
    let profile = profile.await?;
    let bytes = service.work(move || formats::profile(&profile, format));
    let bytes = bytes.await?.map_err(ApiError::internal)?;
    data::whole(&part, format, format!("{id}.profile.{boundary}"), bytes)
}

pub(super) async fn delete_fields(call: Call, id: JobId) -> Result<StatusCode, ApiError> {
    jobs::delete_fields(&call.service, &call.caller, id).await?;
    Ok(StatusCode::NO_CONTENT)
}

pub(super) async fn fields(
    call: Call,
    id: JobId,
    format: Format,
    part: Part,
) -> Result<Response, ApiError> {
    let Call {
        service, caller, ..
    } = &call;
    let name = format!("{id}.fields");
    if format != Format::Json {
        let bytes = stored::converted_fields(service, caller, id, format).await?;
        return data::whole(&part, format, name, bytes);
    }
    // JSON may be large, and is sent in pieces
    let fields = stored::fields(service, caller, id).await?;
    let file = data::File {
        format,
        name,
        bytes: fields.info.bytes,
        digest: fields.info.digest.clone(),
    };
    data::answer(&part, &file, |range| {
        Body::from_stream(fields.bytes(service, range.start, range.end))
    })
}
