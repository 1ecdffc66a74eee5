//! The operations on `/v1/meshes`.

use axum::{
    Json,
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use base::{address::link, mesh::MeshInfo};
use schemars::JsonSchema;
use serde::Serialize;
use service::{
    error::ApiError,
    verbs::{meshes as verbs, page::Paging},
};

use super::{
    body::{declared_length, discard},
    call::Call,
    coding,
};

/// Stores the body as a mesh file, whatever its media type: its format is recognised from its first bytes.
pub(super) async fn upload(call: Call) -> Result<Response, ApiError> {
    let limit_bytes = call.service.config.max_mesh_bytes;
    let mut body = call.body.into_data_stream();
    let found = if declared_length(&call.headers).is_some_and(|length| length > limit_bytes) {
        Err(ApiError::PayloadTooLarge { limit_bytes })
    } else {
        let free = coding::FREE_UPLOADED;
        match coding::decoded(&call.headers, &mut body, &call.received, free) {
            Ok(pieces) => verbs::upload(&call.service, &call.caller, pieces).await,
            Err(error) => Err(error),
        }
    };
    if found.is_err() {
        tokio::spawn(discard(body));
    }
    let (info, new) = found?;
    let status = if new {
        StatusCode::CREATED
    } else {
        StatusCode::OK
    };
    let location = link(&format!("/v1/meshes/{}", info.hash));
    Ok((status, [(header::LOCATION, location)], Json(info)).into_response())
}

pub(super) async fn get(call: Call, hash: String) -> Result<Json<MeshInfo>, ApiError> {
    Ok(Json(verbs::get(&call.service, &call.caller, &hash).await?))
}

/// A page of meshes.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "MeshList")]
pub(super) struct List {
    meshes: Vec<MeshInfo>,
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
        meshes: page.items,
        next_page_token: page.next,
    }))
}

pub(super) async fn delete(call: Call, hash: String) -> Result<StatusCode, ApiError> {
    verbs::delete(&call.service, &call.caller, &hash).await?;
    Ok(StatusCode::NO_CONTENT)
}
