//! The operations `/v1/jobs/{id}/result`, `/history`, `/profiles/{boundary}` and `/fields`.

use axum::{
    Extension, Json,
    body::Body,
    http::{StatusCode, header::CONTENT_TYPE},
    response::Response,
};
use base::job::JobId;
use service::{
    error::ApiError,
    formats::{self, Format},
    transfer::{HasShare, with_own_share},
    verbs::{
        fields as stored, history as rows, jobs,
        profiles::{self, Points},
        results,
    },
};

use super::{
    call::Call,
    data::{self, Part, marked},
};

pub(super) async fn result(call: Call, id: JobId) -> Result<Response, ApiError> {
    let found = results::result(&call.service, &call.caller, id).await?;
    let (available, result, share) = (found.available, found.content, found.share);
    let Some(share) = share else {
        return Ok(marked(Json(result), available));
    };
    let written = call.service.work(move || serde_json::to_vec(&result));
    let bytes = written.await?.map_err(ApiError::internal)?;
    let json = [(CONTENT_TYPE, Format::Json.content_type())];
    let answer = (json, Extension(HasShare), with_own_share(bytes, share));
    Ok(marked(answer, available))
}

pub(super) async fn history(
    call: Call,
    id: JobId,
    format: Format,
    max_points: Option<i64>,
    part: Part,
) -> Result<Response, ApiError> {
    let found = rows::history(&call.service, &call.caller, id, max_points).await?;
    let (available, rows, share) = (found.available, found.content, found.share);
    let bytes = call.service.work(move || formats::history(&rows, format));
    let bytes = bytes.await?.map_err(ApiError::internal)?;
    let name = format!("{id}.history");
    let Some(share) = share else {
        return Ok(marked(data::whole(&part, format, name, bytes)?, available));
    };
    let whole = data::whole(&part, format, name, with_own_share(bytes, share))?;
    Ok(marked((Extension(HasShare), whole), available))
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
    let found = profile.await?;
    let (available, profile) = (found.available, found.content);
    let bytes = service.work(move || formats::profile(&profile, format));
    let bytes = bytes.await?.map_err(ApiError::internal)?;
    let whole = data::whole(&part, format, format!("{id}.profile.{boundary}"), bytes)?;
    Ok(marked(whole, available))
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
        let found = stored::converted_fields(service, caller, id, format).await?;
        let whole = data::whole(&part, format, name, found.content)?;
        return Ok(marked(whole, found.available));
    }
    // JSON may be large, and is sent in pieces
    let found = stored::fields(service, caller, id).await?;
    let (available, fields) = (found.available, found.content);
    let file = data::File {
        format,
        name,
        bytes: fields.info.bytes,
        digest: fields.info.digest.clone(),
    };
    let answer = data::answer(&part, &file, |range| {
        Body::from_stream(fields.bytes(service, range.start, range.end))
    })?;
    Ok(marked(answer, available))
}
