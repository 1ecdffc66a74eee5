//! The operations on stored meshes.

use base::{catalog::Code, mesh::MeshInfo};
use service::verbs::{
    meshes::HASH,
    page::{PAGE_SIZE, PAGE_TOKEN},
};

use super::{
    content::{bytes, json, nothing},
    headers::location,
    operation::{CANCEL, Operation, READ, SUBMIT, delete, get, post},
};
use crate::rest::meshes;

pub(super) fn operations() -> Vec<Operation> {
    vec![
        post(SUBMIT, "/v1/meshes", (), meshes::upload)
            .rpcs(&["UploadMesh"])
            .summary("Stores a mesh file (Gmsh, Abaqus or CalculiX, inline JSON) once, under the hash of its content")
            .body(bytes("application/octet-stream"))
            .answers(200, "A mesh that was stored before", json::<MeshInfo>())
            .with([location()])
            .answers(201, "A new mesh", json::<MeshInfo>())
            .with([location()])
            .fails(&[Code::MalformedJson, Code::InvalidProblem, Code::PayloadTooLarge, Code::UnsupportedMedia, Code::QuotaExceeded, Code::Draining, Code::StorageFull]),
        get(READ, "/v1/meshes", (PAGE_SIZE, PAGE_TOKEN), meshes::list)
            .rpcs(&["ListMeshes"])
            .summary("Lists stored meshes, newest first")
            .answers(200, "A page of meshes", json::<meshes::List>())
            .fails(&[Code::BadPageToken]),
        get(READ, "/v1/meshes/{hash}", (HASH,), meshes::get)
            .rpcs(&["GetMesh"])
            .summary("Returns the size, names and quality of a stored mesh")
            .answers(200, "The mesh, without its nodes and elements", json::<MeshInfo>()),
        delete(CANCEL, "/v1/meshes/{hash}", (HASH,), meshes::delete)
            .rpcs(&["DeleteMesh"])
            .summary("Deletes a stored mesh that no waiting or running job needs")
            .answers(204, "Deleted", nothing())
            .fails(&[Code::JobActive, Code::StorageFull]),
    ]
}
