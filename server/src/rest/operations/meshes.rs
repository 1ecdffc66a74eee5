//! Stored meshes.

use super::{
    Operation, delete, get, post,
    shapes::{bytes, header, json, nothing, text},
};
use crate::{catalog::Code, mesh::MeshInfo, rest::meshes};

pub(super) fn operations() -> Vec<Operation> {
    let location = || header("Location", text(), "Where it is");
    vec![
        post("/v1/meshes", meshes::upload)
            .rpcs(&["UploadMesh"])
            .says("Stores a mesh file (Gmsh, Abaqus or CalculiX, inline JSON) once, under the hash of its content")
            .takes(bytes("application/octet-stream"))
            .answers(200, "What is said of a mesh that was known", json::<MeshInfo>())
            .headed([location()])
            .answers(201, "What is said of a new mesh", json::<MeshInfo>())
            .headed([location()])
            .fails(&[Code::MalformedJson, Code::InvalidProblem, Code::PayloadTooLarge, Code::Draining, Code::StorageFull])
            .tested(&[
                "service::meshes::what_gmsh_wrote_is_stored_and_solved",
                "service::meshes::a_mesh_is_stored_once_and_told_apart_by_its_content",
            ]),
        get("/v1/meshes", meshes::list)
            .rpcs(&["ListMeshes"])
            .says("Lists stored meshes, newest first")
            .with(super::jobs::pages())
            .answers(200, "A page of meshes", json::<meshes::List>())
            .fails(&[Code::BadPageToken])
            .tested(&["service::meshes::a_mesh_is_stored_once_and_told_apart_by_its_content"]),
        get("/v1/meshes/{hash}", meshes::get)
            .rpcs(&["GetMesh"])
            .says("Tells of a stored mesh")
            .answers(200, "What is said of it", json::<MeshInfo>())
            .tested(&["service::meshes::a_mesh_is_stored_once_and_told_apart_by_its_content"]),
        delete("/v1/meshes/{hash}", meshes::delete)
            .rpcs(&["DeleteMesh"])
            .says("Removes a stored mesh that no waiting or running job needs")
            .answers(204, "It is gone", nothing())
            .fails(&[Code::JobActive, Code::StorageFull])
            .tested(&["service::meshes::a_mesh_is_kept_for_the_jobs_that_wait_for_it"]),
    ]
}
