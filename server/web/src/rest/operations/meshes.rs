//! The operations on stored meshes.

use axum::{
    Json,
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use base::{address::link, catalog::Code, mesh::MeshInfo};
use schemars::JsonSchema;
use serde::Serialize;
use service::{
    error::ApiError,
    formats::Format,
    verbs::{
        meshes::{self as verbs, HASH},
        page::{PAGE_SIZE, PAGE_TOKEN, Paging},
        views,
    },
};

use super::{
    content::{bytes, json, nothing},
    headers::location,
    operation::{CANCEL, Operation, READ, SUBMIT, delete, get, post},
};
use crate::rest::{
    body::{declared_length, discard},
    call::Call,
    coding,
    data::{self, PART, Part},
};

pub(super) fn operations() -> Vec<Operation> {
    vec![
        post(SUBMIT, "/v1/meshes", (), upload_mesh)
            .rpcs(&["UploadMesh"])
            .summary("Stores a mesh file (Gmsh, Abaqus or CalculiX, inline JSON) once, under the hash of its content")
            .body(bytes("application/octet-stream"))
            .answers(200, "A mesh that was stored before", json::<MeshInfo>())
            .with([location()])
            .answers(201, "A new mesh", json::<MeshInfo>())
            .with([location()])
            .fails(&[Code::MalformedJson, Code::InvalidProblem, Code::PayloadTooLarge, Code::UnsupportedMedia, Code::QuotaExceeded, Code::Draining, Code::StorageFull]),
        get(READ, "/v1/meshes", (PAGE_SIZE, PAGE_TOKEN), list_meshes)
            .rpcs(&["ListMeshes"])
            .summary("Lists stored meshes, newest first")
            .answers(200, "A page of meshes", json::<List>())
            .fails(&[Code::BadPageToken]),
        get(READ, "/v1/meshes/{hash}", (HASH,), get_mesh)
            .rpcs(&["GetMesh"])
            .summary("Returns the size, names and quality of a stored mesh")
            .answers(200, "The mesh, without its nodes and elements", json::<MeshInfo>()),
        get(READ, "/v1/meshes/{hash}/view", (HASH, PART), get_mesh_view)
            .rpcs(&["StreamView"])
            .named("GetMeshView")
            .summary("Returns what a program needs to draw a stored mesh, as compact arrays (see docs/how-to/formats.md)")
            .file("The view", bytes(Format::View.media_type())),
        delete(CANCEL, "/v1/meshes/{hash}", (HASH,), delete_mesh)
            .rpcs(&["DeleteMesh"])
            .summary("Deletes a stored mesh that no waiting or running job needs")
            .answers(204, "Deleted", nothing())
            .fails(&[Code::JobActive, Code::StorageFull]),
    ]
}

/// Stores the body as a mesh file, whatever its media type: its format is recognised from its first bytes.
async fn upload_mesh(call: Call) -> Result<Response, ApiError> {
    let (declared, free) = (declared_length(&call.headers), coding::FREE_UPLOADED);
    let mut body = call.body.into_data_stream();
    let found = match coding::decoded(&call.headers, &mut body, &call.received, free) {
        Ok(pieces) => verbs::upload(&call.service, &call.caller, declared, pieces).await,
        Err(error) => Err(error),
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

async fn get_mesh(call: Call, hash: String) -> Result<Json<MeshInfo>, ApiError> {
    Ok(Json(verbs::get(&call.service, &call.caller, &hash).await?))
}

async fn get_mesh_view(call: Call, hash: String, part: Part) -> Result<Response, ApiError> {
    let content = views::of_mesh(&call.service, &call.caller, &hash).await?;
    data::whole(&part, Format::View, "mesh".into(), content)
}

/// A page of meshes.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "MeshList")]
struct List {
    meshes: Vec<MeshInfo>,
    next_page_token: Option<String>,
}

async fn list_meshes(
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

async fn delete_mesh(call: Call, hash: String) -> Result<StatusCode, ApiError> {
    verbs::delete(&call.service, &call.caller, &hash).await?;
    Ok(StatusCode::NO_CONTENT)
}
