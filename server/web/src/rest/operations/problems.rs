//! The operations on problems that are not jobs yet: check, draw, convert; examples.

use axum::{Json, http::header, response::IntoResponse};
use base::catalog::Code;
use service::{
    error::ApiError,
    formats::Format,
    verbs::{
        examples::{Examples, examples},
        problems::{self, Converted, Validation},
        views,
    },
};

use super::{
    content::{bytes, json, submission},
    operation::{Operation, READ, SUBMIT, get, post},
};
use crate::rest::{
    bodies::{self, BareProblem},
    body,
    call::Call,
};

pub(super) fn operations() -> Vec<Operation> {
    vec![
        post(SUBMIT, "/v1/problems/validate", (), validate_problem)
            .rpcs(&["ValidateProblem"])
            .summary("Checks a problem and estimates its cost; stores nothing; an invalid problem is also answered with 200")
            .body(json::<BareProblem>())
            .example(submission())
            .answers(200, "Whether the problem is valid, and its estimated cost", json::<Validation>())
            .fails(&[Code::InvalidProblem]),
        post(READ, "/v1/problems/view", (), preview_problem)
            .rpcs(&["StreamView"])
            .named("PreviewProblem")
            .summary("Returns what a program needs to draw a problem before it is a job, as compact arrays (see docs/how-to/formats.md); stores nothing")
            .body(json::<BareProblem>())
            .example(submission())
            .answers(200, "The view", bytes(Format::View.media_type()))
            .fails(&[Code::InvalidProblem, Code::ProblemTooLarge]),
        post(READ, "/v1/problems/convert", (), convert_deck)
            .rpcs(&["ConvertDeck"])
            .summary("Reads a deck of Abaqus or CalculiX as a problem; violations of what is not understood have their lines; stores nothing")
            .body(bytes("application/octet-stream"))
            .answers(200, "The problem, and what the solver treats differently", json::<Converted>())
            .fails(&[Code::InvalidProblem, Code::MalformedJson, Code::PayloadTooLarge]),
        get(READ, "/v1/examples", (), get_examples)
            .rpcs(&["ListExamples"])
            .summary("Returns problems to begin with, each with its description")
            .answers(200, "The examples", json::<Examples>()),
    ]
}

async fn validate_problem(mut call: Call) -> Result<Json<Validation>, ApiError> {
    let text = call.json().await?;
    let problem = call
        .service
        .work(move || bodies::bare_problem(&text))
        .await??;
    let validation = problems::validate(&call.service, &call.caller, problem).await?;
    Ok(Json(validation))
}

async fn preview_problem(mut call: Call) -> Result<impl IntoResponse, ApiError> {
    let text = call.json().await?;
    let problem = call
        .service
        .work(move || bodies::bare_problem(&text))
        .await??;
    let view = views::of_problem(&call.service, &call.caller, problem).await?;
    Ok(([(header::CONTENT_TYPE, Format::View.media_type())], view))
}

async fn convert_deck(call: Call) -> Result<Json<Converted>, ApiError> {
    let limit_bytes = call.service.config.max_body_bytes;
    let deck = body::json_text(&call.headers, call.body, limit_bytes, &call.received).await?;
    let converted = problems::convert(&call.service, &call.caller, deck).await?;
    Ok(Json(converted))
}

async fn get_examples(_: Call) -> Result<Json<Examples>, ApiError> {
    Ok(Json(examples()?))
}
