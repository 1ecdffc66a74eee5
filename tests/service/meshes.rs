//! Stored meshes: uploaded once, over either protocol, and referred to by jobs.

use reqwest::StatusCode;
use rpc::pb;
use serde_json::{Value, json};
use suite::{
    harness::{Server, answer},
    pressed,
};
use tonic::Code;

use crate::{SIGNORINI, by_name, grpc::connect, server};

pub(crate) fn file(name: &str) -> Vec<u8> {
    let path = format!("{}/../../tests/data/{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

async fn upload(server: &Server, bytes: Vec<u8>) -> (StatusCode, Value) {
    answer(server.post("/v1/meshes").body(bytes)).await
}

fn pulled(mesh: Value) -> Value {
    let mut sheet = suite::example_json("sheet");
    sheet["mesh"] = mesh;
    sheet
}

async fn solved(server: &Server, problem: &Value) -> Value {
    let job = server.solve(&json!({"problem": problem})).await;
    assert_eq!(job["status"], "succeeded", "{job:#}");
    let path = format!("/v1/jobs/{}/result", job["id"].as_str().unwrap());
    server.json(&path).await["summary"].take()
}

/// Every mesh family written by Gmsh, in each form of its format, is solved over REST; the four forms of a
/// mesh give equal results.
/// Operations: UploadMesh, CreateJob
#[tokio::test]
async fn meshes_from_gmsh_are_stored_and_solved() {
    let server = server().await;
    for (geometry, problem) in [("fillet", pressed as fn(Value) -> Value), ("sheet", pulled)] {
        for family in ["quad8", "tri6", "mixed"] {
            let mut forces: Vec<f64> = Vec::new();
            for form in ["msh22-ascii", "msh22-binary", "msh41-ascii", "msh41-binary"] {
                let name = format!("gmsh/{geometry}-{family}-{form}.msh");
                let (status, info) = upload(&server, file(&name)).await;
                assert_eq!(status, StatusCode::CREATED, "{name}: {info:#}");
                assert_eq!(info["format"], "gmsh");
                let summary = solved(&server, &problem(json!({"stored": info["hash"]}))).await;
                assert_eq!(summary["converged"], true, "{name}");
                forces.push(summary["normal_force"].as_f64().unwrap());
            }
            let same = |force: &f64| (force / forces[0] - 1.0).abs() < 1e-9;
            assert!(
                forces[0] > 0.0 && forces.iter().all(same),
                "{geometry}-{family}: {forces:?}"
            );
        }
    }
}

/// Operations: UploadMesh, ListMeshes, GetMesh
#[tokio::test]
async fn a_mesh_is_stored_once_and_identified_by_its_content() {
    let server = server().await;
    let bytes = file("gmsh/fillet-mixed-msh41-binary.msh");
    let (status, first) = upload(&server, bytes.clone()).await;
    assert_eq!(status, StatusCode::CREATED);
    assert_eq!(first["bytes"], bytes.len());
    assert!(
        first["quadrilaterals"].as_u64().unwrap() > 0 && first["triangles"].as_u64().unwrap() > 0
    );
    assert_eq!(first["dofs"], 2 * first["nodes"].as_u64().unwrap());
    assert_eq!(first["extent"], json!([[0.0, 4.0], [0.0, 2.0]]));
    assert_eq!(first["boundaries"]["top"]["length"], 2.0);
    assert_eq!(first["node_sets"]["corner"], 1);
    assert_eq!(first["warnings"][0]["code"], "lines_inside");
    let ratio = first["quality"]["least_jacobian_ratio"].as_f64().unwrap();
    assert!(0.0 < ratio && ratio < 1.0, "{ratio}");

    let (status, again) = upload(&server, bytes).await;
    assert_eq!((status, &again), (StatusCode::OK, &first));
    let (status, deck) = upload(&server, file("abaqus/ring-cpe8.inp")).await;
    assert_eq!(
        (status, &deck["format"]),
        (StatusCode::CREATED, &json!("abaqus"))
    );

    let list: Value = server.json("/v1/meshes?page_size=1").await;
    assert_eq!(list["meshes"][0], deck);
    let next = format!(
        "/v1/meshes?page_size=1&page_token={}",
        list["next_page_token"].as_str().unwrap()
    );
    let rest: Value = server.json(&next).await;
    assert_eq!(
        (&rest["meshes"][0], &rest["next_page_token"]),
        (&first, &Value::Null)
    );

    let path = format!("/v1/meshes/{}", deck["hash"].as_str().unwrap());
    let one: Value = server.json(&path).await;
    assert_eq!(one, deck);
    for (request, status) in [
        (server.delete(&path), StatusCode::NO_CONTENT),
        (server.delete(&path), StatusCode::NOT_FOUND),
        (server.get(&path), StatusCode::NOT_FOUND),
    ] {
        assert_eq!(request.send().await.unwrap().status(), status);
    }
}

/// Operations: UploadMesh
#[tokio::test]
async fn a_file_that_is_not_a_mesh_is_refused_with_its_line() {
    let server = server().await;
    for (bytes, expected) in [
        (b"solid cube".to_vec(), "an STL surface"),
        (
            b"Point(1) = {0, 0};".to_vec(),
            "a file that begins differently",
        ),
        (Vec::new(), "an empty file"),
        (
            file("gmsh/sheet-tri6-msh41-ascii.msh")[..3000].to_vec(),
            "the end of the file",
        ),
        (
            file("gmsh/sheet-tri6-msh41-binary.msh")[..3000].to_vec(),
            "the end of the file",
        ),
        (
            b"*NODE\n1, 0., 0.\n2, 1., 0., zero\n".to_vec(),
            "line 3: `2, 1., 0., zero`",
        ),
    ] {
        let (status, problem) = upload(&server, bytes).await;
        assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
        let got = problem["errors"][0]["got"].as_str().unwrap();
        assert!(got.contains(expected), "{got}");
    }
    let unknown = pressed(json!({"stored": "sha256:0"}));
    let response = server
        .post("/v1/jobs")
        .json(&json!({"problem": unknown}))
        .send()
        .await
        .unwrap();
    assert_eq!(response.status(), StatusCode::UNPROCESSABLE_ENTITY);
    let problem: Value = response.json().await.unwrap();
    assert_eq!(problem["errors"][0]["pointer"], "/problem/mesh/stored");
    let response = server
        .post("/v1/problems/validate")
        .json(&json!({"problem": unknown}))
        .send()
        .await
        .unwrap();
    let judged: Value = response.json().await.unwrap();
    assert_eq!(
        (&judged["valid"], &judged["violations"][0]["reason"]),
        (&json!(false), &json!("unknown_mesh"))
    );
}

/// Operations: UploadMesh
#[tokio::test]
async fn a_mesh_that_is_too_large_is_refused_with_or_without_a_declared_size() {
    let server = Server::start(SIGNORINI, &["--max-mesh-bytes", "10000"]).await;
    let bytes = file("gmsh/fillet-quad9-msh22-ascii.msh");
    let pieces: Vec<std::io::Result<Vec<u8>>> =
        bytes.chunks(1000).map(|piece| Ok(piece.to_vec())).collect();
    let streamed = reqwest::Body::wrap_stream(futures_util::stream::iter(pieces));
    for body in [reqwest::Body::from(bytes), streamed] {
        let response = server.post("/v1/meshes").body(body).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::PAYLOAD_TOO_LARGE);
    }
}

/// A mesh is kept as long as a job needs it, also after a crash, and the pieces of interrupted uploads are removed.
/// Operations: DeleteMesh
#[tokio::test]
async fn a_mesh_is_kept_for_the_jobs_that_need_it() {
    let mut server = server().await;
    let (_, info) = upload(&server, file("gmsh/fillet-tri6-msh22-ascii.msh")).await;
    let mesh = format!("/v1/meshes/{}", info["hash"].as_str().unwrap());
    // the workers are busy with long jobs
    for _ in 0..2 {
        server.submit(&suite::harness::block(150, 150)).await;
    }
    let job = server
        .submit(&pressed(json!({"stored": info["hash"], "refine": 1})))
        .await;
    let response = server.delete(&mesh).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::CONFLICT);
    let refusal: Value = response.json().await.unwrap();
    assert_eq!(refusal["type"], "/v1/errors/job-active");
    server.kill().await;
    server.restart().await;
    let ended = server.until_done(&job).await;
    assert_eq!(ended["status"], "succeeded", "{ended:#}");
    let response = server.delete(&mesh).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::NO_CONTENT);
}

/// Operations: UploadMesh, ListMeshes, GetMesh, DeleteMesh
#[tokio::test]
async fn grpc_and_rest_report_the_same() {
    let server = server().await;
    let mut grpc = connect(&server).await;
    let bytes = file("gmsh/sheet-mixed-msh41-binary.msh");
    let pieces = |bytes: &[u8]| {
        let pieces: Vec<_> = bytes
            .chunks(5000)
            .map(|data| pb::UploadMeshRequest {
                data: data.to_vec(),
            })
            .collect();
        futures_util::stream::iter(pieces)
    };
    let answer = grpc.upload_mesh(pieces(&bytes)).await.unwrap().into_inner();
    assert!(!answer.known);
    let mesh = answer.mesh.unwrap();
    let (status, info) = upload(&server, bytes.clone()).await;
    assert_eq!(
        (status, info["hash"].as_str()),
        (StatusCode::OK, Some(&mesh.hash[..]))
    );
    assert_eq!(info["nodes"], mesh.nodes);
    assert_eq!(
        info["boundaries"]["taper"]["length"],
        mesh.boundaries["taper"].length
    );
    assert_eq!(mesh.format(), pb::MeshFormat::Gmsh);
    assert!(
        grpc.upload_mesh(pieces(&bytes))
            .await
            .unwrap()
            .into_inner()
            .known
    );

    let request = pb::GetMeshRequest {
        hash: mesh.hash.clone(),
    };
    assert_eq!(
        grpc.get_mesh(request.clone()).await.unwrap().into_inner(),
        mesh
    );
    let list = grpc
        .list_meshes(pb::ListMeshesRequest::default())
        .await
        .unwrap()
        .into_inner();
    assert_eq!(list.meshes, std::slice::from_ref(&mesh));
    let refused = grpc
        .upload_mesh(pieces(b"$MeshFormat\n3 0 8\n"))
        .await
        .unwrap_err();
    assert_eq!(refused.code(), Code::InvalidArgument);
    let problem = pulled(json!({"stored": mesh.hash}));
    let job = pb::CreateJobRequest {
        problem: Some(by_name::message("Problem", &problem)),
        wait: Some(60.0),
        ..Default::default()
    };
    let job = grpc.create_job(job).await.unwrap().into_inner();
    assert_eq!(job.status(), pb::Status::Succeeded);
    grpc.delete_mesh(pb::DeleteMeshRequest { hash: mesh.hash })
        .await
        .unwrap();
    assert_eq!(
        grpc.get_mesh(request).await.unwrap_err().code(),
        Code::NotFound
    );
}

/// A grid of 8-node elements as a Gmsh file.
fn gmsh_grid(columns: usize, rows: usize) -> Vec<u8> {
    use std::io::Write;
    let mut text = Vec::with_capacity(100 << 20);
    let (w, h) = (2 * columns + 1, 2 * rows + 1);
    let exists = |i: usize, j: usize| i.is_multiple_of(2) || j.is_multiple_of(2);
    let label = |i: usize, j: usize| j * w + i + 1;
    let count = w * h - columns * rows;
    writeln!(text, "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n1 1 \"bottom\"\n1 2 \"top\"\n2 3 \"body\"\n$EndPhysicalNames\n$Nodes\n{count}").unwrap();
    for j in 0..h {
        for i in (0..w).filter(|&i| exists(i, j)) {
            let (x, y) = (i as f64 / w as f64, j as f64 / h as f64);
            writeln!(text, "{} {x:.16} {y:.16} 0", label(i, j)).unwrap();
        }
    }
    writeln!(
        text,
        "$EndNodes\n$Elements\n{}",
        columns * rows + 2 * columns
    )
    .unwrap();
    let mut number = 0;
    for (tag, j) in [(1, 0), (2, 2 * rows)] {
        for i in (0..2 * columns).step_by(2) {
            number += 1;
            writeln!(
                text,
                "{number} 8 2 {tag} {tag} {} {} {}",
                label(i, j),
                label(i + 2, j),
                label(i + 1, j)
            )
            .unwrap();
        }
    }
    for j in (0..2 * rows).step_by(2) {
        for i in (0..2 * columns).step_by(2) {
            number += 1;
            write!(text, "{number} 16 2 3 1").unwrap();
            for (di, dj) in [
                (0, 0),
                (2, 0),
                (2, 2),
                (0, 2),
                (1, 0),
                (2, 1),
                (1, 2),
                (0, 1),
            ] {
                write!(text, " {}", label(i + di, j + dj)).unwrap();
            }
            writeln!(text).unwrap();
        }
    }
    writeln!(text, "$EndElements").unwrap();
    text
}

/// A million nodes, over REST and over gRPC: the server grows by no more than twice the parsed mesh
/// (positions, node numbers, and 4 bytes for each element of a group), and a job on it is a small message.
/// Operations: UploadMesh
#[tokio::test]
async fn a_mesh_of_a_million_nodes_streams_through() {
    let bytes = gmsh_grid(580, 575);
    for over_grpc in [false, true] {
        let server = Server::start_alone(SIGNORINI, &[]).await;
        // the very first request allocates memory that every server needs
        upload(&server, file("gmsh/sheet-tri6-msh22-ascii.msh")).await;
        let (before, cpu) = (server.memory("VmRSS"), server.cpu_s());
        let (nodes, elements) = if over_grpc {
            let mut grpc = connect(&server).await;
            let pieces: Vec<_> = bytes
                .chunks(512 << 10)
                .map(|data| pb::UploadMeshRequest {
                    data: data.to_vec(),
                })
                .collect();
            let answer = grpc
                .upload_mesh(futures_util::stream::iter(pieces))
                .await
                .unwrap();
            let mesh = answer.into_inner().mesh.unwrap();
            (mesh.nodes, mesh.quadrilaterals)
        } else {
            let (status, info) = upload(&server, bytes.clone()).await;
            assert_eq!(status, StatusCode::CREATED);
            let message = pressed(json!({"stored": info["hash"]})).to_string();
            assert!(message.len() < 2048, "{}", message.len());
            (
                info["nodes"].as_u64().unwrap(),
                info["quadrilaterals"].as_u64().unwrap(),
            )
        };
        assert!(nodes > 1_000_000, "{nodes}");
        let parsed = 16 * nodes + (8 * 4 + 4 + 4) * elements;
        let grown = server.memory("VmHWM") - before;
        println!(
            "{} nodes, file {} MiB, parsed {} MiB: grown by {} MiB, {:.2} s CPU",
            nodes,
            bytes.len() >> 20,
            parsed >> 20,
            grown >> 20,
            server.cpu_s() - cpu
        );
        assert!(
            grown <= 2 * parsed,
            "grown by {grown}, the parsed mesh has {parsed}"
        );
    }
}
