//! The operations on the results of a job, as data and as figures.

use axum::{
    Extension, Json,
    body::Body,
    http::{StatusCode, header::CONTENT_TYPE},
    response::Response,
};
use base::{catalog::Code, event::HistoryRow, job::JobId};
use files::plot::ViewField;
use service::{
    error::ApiError,
    formats::{self, Format},
    transfer::{HasShare, with_own_share},
    verbs::{
        fields as stored,
        history::{self as rows, MAX_POINTS},
        jobs::{self, ID},
        plots::PLOT,
        profiles::{self, BOUNDARY, POINTS, Points, STEP},
        results::{self, JobResult, PARTIAL},
        views::{self, FIELD},
    },
};
use solver::solution::{ContactProfile, Fields};

use super::{
    content::{bytes, data, json, nothing},
    headers::{next_page_token, result_available},
    operation::{CANCEL, Content, Operation, READ, delete, get},
};
use crate::rest::{
    accept::FormatOf,
    call::Call,
    data::{self, PART, Part, marked},
    headers::{header, text},
    plots,
};

pub(super) fn operations() -> Vec<Operation> {
    const TABLE: FormatOf = FormatOf(Format::OF_TABLES);
    const FIELDS: FormatOf = FormatOf(Format::OF_FIELDS);
    vec![
        get(READ, "/v1/jobs/{id}/result", (ID,), get_result)
            .rpcs(&["GetResult"])
            .summary("Returns the summary of a job's result, and a summary for each load step")
            .answers(200, "The summary", json::<JobResult>())
            .with([result_available()])
            .fails(NO_RESULT),
        get(
            READ,
            "/v1/jobs/{id}/history",
            (ID, TABLE, MAX_POINTS, PARTIAL, PART),
            list_iterations,
        )
        .rpcs(&["ListIterations"])
        .summary("Returns the iterations of a job's last attempt, one row each")
        .file_of_result("The rows", data::<Vec<HistoryRow>>(Format::OF_TABLES))
        .fails(&[Code::PartialResult]),
        get(
            READ,
            "/v1/jobs/{id}/profiles/{boundary}",
            (ID, BOUNDARY, TABLE, STEP, POINTS, PARTIAL, PART),
            get_profile,
        )
        .rpcs(&["GetProfile"])
        .summary("Returns columns along a contact boundary, by arc length")
        .file_of_result("The columns", data::<ContactProfile>(Format::OF_TABLES))
        .fails(NO_RESULT)
        .fails(&[Code::PartialResult]),
        get(
            READ,
            "/v1/jobs/{id}/fields",
            (ID, FIELDS, PARTIAL, PART),
            stream_result,
        )
        .rpcs(&["StreamResult"])
        .summary("Returns mesh, displacements and stresses")
        .file_of_result("The fields", data::<Fields>(Format::OF_FIELDS))
        .fails(NO_RESULT)
        .fails(&[Code::PartialResult]),
        get(READ, "/v1/jobs/{id}/view", (ID, PARTIAL, PART), get_view)
            .rpcs(&["StreamView"])
            .named("GetJobView")
            .summary("Returns what a program needs to draw the body of a job: corners of elements, outline, boundaries, supports, loads and obstacles, as compact arrays (see docs/how-to/formats.md); of the problem's mesh until there is a result")
            .file_of_result("The view", bytes(Format::View.media_type())),
        get(READ, "/v1/jobs/{id}/view/{field}", (ID, FIELD, PARTIAL, PART), get_field_view)
            .rpcs(&["StreamView"])
            .named("GetJobFieldView")
            .summary("Returns one field of a job's result at the corners of its view")
            .file_of_result("The field", bytes(Format::View.media_type()))
            .fails(NO_RESULT)
            .fails(&[Code::PartialResult]),
        delete(CANCEL, "/v1/jobs/{id}/fields", (ID,), delete_fields)
            .rpcs(&["DeleteFields"])
            .summary("Deletes mesh, displacements and stresses of a job that has ended, which are most of its data; summary, history and profiles remain")
            .answers(204, "Deleted", nothing())
            .fails(&[Code::Deleted, Code::JobActive]),
        get(
            READ,
            "/v1/jobs/{id}/plots/{plot}",
            (ID, PLOT, plots::LOOK, STEP, PARTIAL, PART),
            plots::plot,
        )
        .rest_only("GetPlot")
        .summary("Draws a figure: mesh, deformed body, stresses along the contact, convergence")
        .file_of_result("The figure", figures())
        .fails(NO_RESULT)
        .fails(&[Code::PartialResult]),
    ]
}

fn figures() -> Content {
    let media = Format::OF_FIGURES.iter().map(|format| format.media_type());
    media.flat_map(bytes).collect()
}

/// The errors of an operation on a result if there is no result.
const NO_RESULT: &[Code] = &[Code::NoResult, Code::ResultNotReady];

impl Operation {
    /// Adds the answers with a file, with a part of it, or with 304 if the client has the file.
    pub(super) fn file(self, meaning: &'static str, content: Content) -> Self {
        let tag = || header("ETag", text(), "The file's SHA-256");
        let name = || header("Content-Disposition", text(), "A name for the file");
        let whole_file = header(
            "Content-Digest",
            text(),
            "The file's SHA-256 (RFC 9530); absent from a compressed answer",
        );
        let parts = content.iter().flat_map(|(media, _)| bytes(media)).collect();
        let part = header(
            "Content-Range",
            text(),
            "The part, and the size of the file",
        );
        self.answers(200, meaning, content)
            .with([tag(), name()])
            .sometimes_with(whole_file)
            .answers(206, "The requested part", parts)
            .with([tag(), name(), part])
            .answers(304, "The file has not changed", nothing())
            .with([tag()])
            .fails(&[Code::NotAcceptable, Code::RangeNotSatisfiable])
    }

    /// Adds to the answers of `file` the header that leads to the next part of a table.
    pub(super) fn with_next_page(mut self) -> Self {
        for answer in &mut self.answers {
            answer.headers.push((next_page_token(), false));
        }
        self
    }

    /// Adds the answers of `file` for a file of a job, with the header that says whether the result is partial or
    /// final.
    fn file_of_result(mut self, meaning: &'static str, content: Content) -> Self {
        let others = self.answers.len();
        self = self.file(meaning, content);
        for answer in &mut self.answers[others..] {
            answer.headers.push((result_available(), true));
        }
        self
    }
}

async fn get_result(call: Call, id: JobId) -> Result<Response, ApiError> {
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

async fn list_iterations(
    call: Call,
    id: JobId,
    format: Format,
    max_points: Option<i64>,
    partial: Option<bool>,
    part: Part,
) -> Result<Response, ApiError> {
    let partial = partial.unwrap_or_default();
    let found = rows::history(&call.service, &call.caller, id, max_points, partial).await?;
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

#[expect(
    clippy::too_many_arguments,
    reason = "each is a parameter of the request"
)]
async fn get_profile(
    call: Call,
    id: JobId,
    boundary: String,
    format: Format,
    step: Option<String>,
    points: Option<Points>,
    partial: Option<bool>,
    part: Part,
) -> Result<Response, ApiError> {
    let Call {
        service, caller, ..
    } = &call;
    let (step, points) = (step.as_deref(), points.unwrap_or_default());
    let partial = partial.unwrap_or_default();
    let profile = profiles::profile(service, caller, id, &boundary, step, points, partial);
    let found = profile.await?;
    let (available, profile) = (found.available, found.content);
    let bytes = service.work(move || formats::profile(&profile, format));
    let bytes = bytes.await?.map_err(ApiError::internal)?;
    let whole = data::whole(&part, format, format!("{id}.profile.{boundary}"), bytes)?;
    Ok(marked(whole, available))
}

async fn get_view(
    call: Call,
    id: JobId,
    partial: Option<bool>,
    part: Part,
) -> Result<Response, ApiError> {
    let (service, caller, partial) = (&call.service, &call.caller, partial.unwrap_or_default());
    let job = jobs::get(service, caller, id).await?;
    let tag = views::tag_of(&job, &format!("view {partial}"));
    if let Some(known) = part.known(tag.as_deref()) {
        return Ok(marked(known, job.result_available));
    }
    let found = views::of_job(service, caller, id, partial).await?;
    let whole = data::tagged(
        &part,
        Format::View,
        format!("{id}.view"),
        found.content,
        tag,
    )?;
    Ok(marked(whole, found.available))
}

async fn get_field_view(
    call: Call,
    id: JobId,
    field: ViewField,
    partial: Option<bool>,
    part: Part,
) -> Result<Response, ApiError> {
    let (service, caller, partial) = (&call.service, &call.caller, partial.unwrap_or_default());
    let job = jobs::get(service, caller, id).await?;
    let tag = views::tag_of(&job, &format!("view {field:?} {partial}"));
    if let Some(known) = part.known(tag.as_deref()) {
        return Ok(marked(known, job.result_available));
    }
    let found = views::field_of_job(service, caller, id, field, partial).await?;
    let name = format!("{id}.{}", <&str>::from(field));
    let whole = data::tagged(&part, Format::View, name, found.content, tag)?;
    Ok(marked(whole, found.available))
}

async fn delete_fields(call: Call, id: JobId) -> Result<StatusCode, ApiError> {
    jobs::delete_fields(&call.service, &call.caller, id).await?;
    Ok(StatusCode::NO_CONTENT)
}

async fn stream_result(
    call: Call,
    id: JobId,
    format: Format,
    partial: Option<bool>,
    part: Part,
) -> Result<Response, ApiError> {
    let Call {
        service, caller, ..
    } = &call;
    let (name, partial) = (format!("{id}.fields"), partial.unwrap_or_default());
    if format != Format::Json {
        let job = jobs::get(service, caller, id).await?;
        let tag = views::tag_of(&job, &format!("fields {format:?} {partial}"));
        if let Some(known) = part.known(tag.as_deref()) {
            return Ok(marked(known, job.result_available));
        }
        let found = stored::converted_fields(service, caller, id, format, partial).await?;
        let whole = data::tagged(&part, format, name, found.content, tag)?;
        return Ok(marked(whole, found.available));
    }
    // JSON may be large, and is sent in pieces
    let found = stored::fields(service, caller, id, partial).await?;
    let (available, fields) = (found.available, found.content);
    let file = data::File {
        format,
        name,
        bytes: fields.info.bytes,
        digest: fields.info.digest.clone(),
        tag: None,
    };
    let answer = data::answer(&part, &file, |range| {
        Body::from_stream(fields.bytes(service, range.start, range.end))
    })?;
    Ok(marked(answer, available))
}
