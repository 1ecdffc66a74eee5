//! `/v1/models`.

use axum::{
    Json,
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use schemars::JsonSchema;
use serde::Serialize;

use super::{call::Call, model_body};
use crate::{
    address::link,
    error::ApiError,
    model::{Model, WholeModel},
    verbs::{models as verbs, page::Paging},
};

pub(super) async fn put(mut call: Call, name: String) -> Result<Response, ApiError> {
    let text = call.json().await?;
    let request = call
        .service
        .work(move || model_body::model(&text))
        .await??;
    let request = request.map_err(ApiError::InvalidProblem)?;
    let (model, new) = verbs::put(&call.service, &call.caller, name, request).await?;
    let status = match new {
        true => StatusCode::CREATED,
        false => StatusCode::OK,
    };
    let location = link(&format!("/v1/models/{}", model.name));
    Ok((status, [(header::LOCATION, location)], Json(model)).into_response())
}

/// A page of models.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "ModelList")]
pub(super) struct List {
    models: Vec<Model>,
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
        models: page.items,
        next_page_token: page.next,
    }))
}

pub(super) async fn get(call: Call, name: String) -> Result<Json<WholeModel>, ApiError> {
    Ok(Json(verbs::get(&call.service, &call.caller, &name).await?))
}

pub(super) async fn delete(call: Call, name: String) -> Result<StatusCode, ApiError> {
    verbs::delete(&call.service, &call.caller, &name).await?;
    Ok(StatusCode::NO_CONTENT)
}
