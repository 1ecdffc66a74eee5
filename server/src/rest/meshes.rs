//! `/v1/meshes`.

use axum::{
    Json,
    body::Body,
    extract::{RawQuery, State},
    http::{HeaderMap, StatusCode, header},
    response::{IntoResponse, Response},
};
use futures_util::StreamExt;
use schemars::JsonSchema;
use serde::Serialize;

use super::{
    Rest,
    request::{Params, TextPath, declared_length, discard},
};
use crate::{
    error::ApiError,
    mesh::MeshInfo,
    verbs::{
        jobs::{MAX_PAGE_SIZE, PAGE_SIZE},
        meshes as verbs,
    },
};

/// The file is the body, of whatever type: what it is is told by how it begins.
pub(super) async fn upload(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    let limit_bytes = rest.service.max_mesh_bytes;
    let mut pieces = body.into_data_stream();
    let found = if declared_length(&headers).is_some_and(|length| length > limit_bytes) {
        Err(ApiError::PayloadTooLarge { limit_bytes })
    } else {
        let broken = |error| ApiError::MalformedJson(format!("the body broke off: {error}"));
        let stream = (&mut pieces).map(|piece| piece.map_err(broken));
        verbs::upload(&rest.service, Box::pin(stream)).await
    };
    if found.is_err() {
        tokio::spawn(discard(pieces));
    }
    let (info, new) = found?;
    let status = if new {
        StatusCode::CREATED
    } else {
        StatusCode::OK
    };
    let location = format!("/v1/meshes/{}", info.hash);
    Ok((status, [(header::LOCATION, location)], Json(info)).into_response())
}

pub(super) async fn get(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    TextPath(hash): TextPath,
) -> Result<Json<MeshInfo>, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    Ok(Json(verbs::get(&rest.service, &hash).await?))
}

/// A page of meshes.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "MeshList")]
pub(super) struct List {
    meshes: Vec<MeshInfo>,
    next_page_token: Option<String>,
}

pub(super) async fn list(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
) -> Result<Json<List>, ApiError> {
    let params = Params::parse(query.as_deref(), &["page_size", "page_token"])?;
    let size = params.number(
        "page_size",
        1..=MAX_PAGE_SIZE,
        "a whole number from 1 to 1000",
    )?;
    let token = params.one("page_token").filter(|token| !token.is_empty());
    let page = verbs::list(&rest.service, size.unwrap_or(PAGE_SIZE), token).await?;
    Ok(Json(List {
        meshes: page.meshes,
        next_page_token: page.next,
    }))
}

pub(super) async fn delete(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    TextPath(hash): TextPath,
) -> Result<StatusCode, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    verbs::delete(&rest.service, &hash).await?;
    Ok(StatusCode::NO_CONTENT)
}
