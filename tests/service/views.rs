//! What a program draws by itself: bodies and fields as compact arrays, of jobs, problems and stored meshes; a problem in
//! words; decks as problems; examples; what waits.

use reqwest::StatusCode;
use rpc::pb::{self, stream_view_request::Of};
use serde_json::{Value, json};
use suite::{
    example_json,
    harness::{Server, answer, block},
};

use crate::{grpc::connect, meshes::file, server};

/// A view, as docs/how-to/formats.md describes it.
struct View {
    head: Value,
    bytes: Vec<u8>,
}

impl View {
    fn read(whole: &[u8]) -> View {
        let length = u32::from_le_bytes(whole[..4].try_into().unwrap()) as usize;
        assert_eq!(length % 4, 0);
        View {
            head: serde_json::from_slice(&whole[4..4 + length]).unwrap(),
            bytes: whole[4 + length..].to_vec(),
        }
    }

    /// The four bytes of each number of an array.
    fn array(&self, name: &str, kind: &str) -> Vec<[u8; 4]> {
        let arrays = self.head["arrays"].as_array().unwrap();
        let array = arrays.iter().find(|array| array["name"] == name);
        let array = array.unwrap_or_else(|| panic!("no {name} in {:#}", self.head));
        assert_eq!(array["type"], kind);
        let place = |name: &str| array[name].as_u64().unwrap() as usize;
        let (offset, length) = (place("offset"), place("length"));
        let bytes = &self.bytes[offset..offset + 4 * length];
        bytes
            .chunks(4)
            .map(|four| four.try_into().unwrap())
            .collect()
    }

    fn floats(&self, name: &str) -> Vec<f64> {
        let four = self.array(name, "f32").into_iter();
        four.map(|four| f32::from_le_bytes(four).into()).collect()
    }
}

async fn view(request: reqwest::RequestBuilder) -> View {
    let response = request.send().await.unwrap();
    let status = response.status();
    let media = response.headers()["content-type"]
        .to_str()
        .unwrap()
        .to_owned();
    let whole = response.bytes().await.unwrap();
    assert_eq!(
        status,
        StatusCode::OK,
        "{}",
        String::from_utf8_lossy(&whole)
    );
    assert_eq!(media, "application/vnd.signorini.view");
    View::read(&whole)
}

/// The view that gRPC streams.
async fn streamed(server: &Server, of: Of, field: pb::ViewField) -> Vec<u8> {
    let mut grpc = connect(server).await;
    let field = field.into();
    let request = pb::StreamViewRequest {
        of: Some(of),
        field,
        partial: false,
    };
    let mut pieces = grpc.stream_view(request).await.unwrap().into_inner();
    let mut whole = vec![];
    while let Some(piece) = pieces.message().await.unwrap() {
        whole.extend(piece.data);
    }
    whole
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// The fields of a view have the values of the result's own, at corners.
/// Operations: GetJobView, GetJobFieldView, StreamView
#[tokio::test]
async fn a_job_is_drawn_before_it_runs_and_with_its_fields_after() {
    let server = server().await;
    server.post("/v1/queue/pause").send().await.unwrap();
    let examples = server.json("/v1/examples").await;
    // its mesh is refined: the body of the result is another one
    let punch = &examples["examples"][0]["problem"];
    let id = server.submit(punch).await;
    let path = format!("/v1/jobs/{id}/view");
    let before = view(server.get(&path)).await;
    assert_eq!(before.head["boundaries"].as_array().unwrap().len(), 4);
    let (status, problem) = answer(server.get(&format!("{path}/von_mises"))).await;
    assert_eq!(status, StatusCode::CONFLICT, "{problem:#}");
    server.post("/v1/queue/resume").send().await.unwrap();
    server.until_done(&id).await;

    let after = view(server.get(&path)).await;
    let corners = after.floats("positions").len() / 2;
    assert!(corners > before.floats("positions").len() / 2);
    for (name, size) in [
        ("displacement", 2 * corners),
        ("von_mises", corners),
        ("stress_zz", corners),
        ("principal_stress_1", corners),
        ("contact_state", corners),
    ] {
        let field = view(server.get(&format!("{path}/{name}"))).await;
        assert_eq!(field.head["field"], name);
        assert_eq!(field.floats("values").len(), size, "{name}");
    }
    let fields = server.get(&format!("/v1/jobs/{id}/fields?format=json"));
    let (_, fields) = answer(fields).await;
    let uy = view(server.get(&format!("{path}/displacement")))
        .await
        .floats("values");
    let lowest = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::INFINITY, f64::min);
    let seen = lowest(&mut uy.iter().skip(1).step_by(2).copied());
    let all = fields["uy"].as_array().unwrap().iter();
    let expected = lowest(&mut all.map(|value| value.as_f64().unwrap()));
    assert!(
        (seen - expected).abs() < 1e-6 * expected.abs(),
        "{seen} {expected}"
    );
    let principal = view(server.get(&format!("{path}/principal_stress_1"))).await;
    let other = view(server.get(&format!("{path}/principal_stress_3"))).await;
    assert!(largest(&principal.floats("values")) > largest(&other.floats("values")));

    // an unchanged view is not drawn again, and gRPC has the same bytes
    let response = server.get(&path).send().await.unwrap();
    let tag = response.headers()["etag"].clone();
    let whole = response.bytes().await.unwrap();
    let again = server
        .get(&path)
        .header("If-None-Match", tag)
        .send()
        .await
        .unwrap();
    assert_eq!(again.status(), StatusCode::NOT_MODIFIED);
    assert_eq!(
        streamed(&server, Of::Job(id.clone()), pb::ViewField::Unspecified).await,
        whole
    );
    let field = server
        .get(&format!("{path}/von_mises"))
        .send()
        .await
        .unwrap();
    let field = field.bytes().await.unwrap();
    assert_eq!(
        streamed(&server, Of::Job(id.clone()), pb::ViewField::VonMises).await,
        field
    );
    let (status, _) = answer(server.get(&format!("{path}/temperature"))).await;
    assert_eq!(status, StatusCode::NOT_FOUND);
}

/// Operations: GetMeshView, PreviewProblem
#[tokio::test]
async fn a_mesh_and_a_problem_are_drawn_before_they_are_jobs() {
    let server = server().await;
    let name = "gmsh/fillet-tri6-msh22-ascii.msh";
    let (_, mesh) = answer(server.post("/v1/meshes").body(file(name))).await;
    let hash = mesh["hash"].as_str().unwrap();
    let drawn = view(server.get(&format!("/v1/meshes/{hash}/view"))).await;
    let names: Vec<&Value> = drawn.head["boundaries"]
        .as_array()
        .unwrap()
        .iter()
        .collect();
    assert!(!names.is_empty(), "{:#}", drawn.head);
    let whole = streamed(&server, Of::Mesh(hash.into()), pb::ViewField::Unspecified).await;
    assert_eq!(View::read(&whole).head, drawn.head);

    let problem = block(4, 4);
    let drawn = view(
        server
            .post("/v1/problems/view")
            .json(&json!({"problem": problem})),
    )
    .await;
    assert!(!drawn.head["obstacles"].as_array().unwrap().is_empty());
    assert!(!drawn.head["supports"].as_array().unwrap().is_empty());
    let mut nowhere = problem.clone();
    nowhere["supports"][0]["boundary"] = json!("nowhere");
    let mut aimless = problem;
    aimless["contacts"] = json!([]);
    aimless["mesh"]["refine"] = json!({"tolerance": 0.05});
    for (wrong, pointer) in [
        (nowhere, "/problem/supports/0/boundary"),
        (aimless, "/problem/mesh/refine"),
    ] {
        let request = server.post("/v1/problems/view");
        let (status, problem) = answer(request.json(&json!({"problem": wrong}))).await;
        assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY, "{problem:#}");
        assert_eq!(problem["errors"][0]["pointer"], pointer, "{problem:#}");
    }
}

/// Operations: GetJobDescription
#[tokio::test]
async fn a_problem_is_told_in_words_the_same_before_and_after() {
    let server = server().await;
    let problem = json!({"problem": example_json("sheet")});
    let (_, checked) = answer(server.post("/v1/problems/validate").json(&problem)).await;
    let id = server.submit(&problem["problem"]).await;
    let told = server.json(&format!("/v1/jobs/{id}/description")).await;
    assert_eq!(told["description"], checked["description"]);
    assert!(
        told["description"]
            .as_str()
            .unwrap()
            .starts_with("An elastic body (plane stress")
    );
    let mut grpc = connect(&server).await;
    let request = pb::GetJobDescriptionRequest { id };
    let same = grpc
        .get_job_description(request)
        .await
        .unwrap()
        .into_inner();
    assert_eq!(same.description, told["description"]);
}

/// Operations: ConvertDeck
#[tokio::test]
async fn a_deck_becomes_a_problem_that_can_be_solved() {
    let server = server().await;
    let deck = "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n*ELEMENT,TYPE=CPE4,ELSET=ALL\n1,1,2,3,4\n*NSET,NSET=LOW\n1,2\n\
                *SURFACE,NAME=TOP\n1,S3\n*MATERIAL,NAME=M\n*ELASTIC\n1000,0.3\n*SOLID SECTION,ELSET=ALL,MATERIAL=M\n\
                *STEP\n*STATIC\n*BOUNDARY\nLOW,1,2\n*DSLOAD\nTOP,P,1\n*END STEP\n";
    let send = |text: &str| server.post("/v1/problems/convert").body(text.to_owned());
    let (status, found) = answer(send(deck).header("Content-Type", "text/plain")).await;
    assert_eq!(status, StatusCode::OK, "{found:#}");
    let job = server.solve(&json!({"problem": found["problem"]})).await;
    assert_eq!(job["status"], "succeeded", "{job:#}");
    let mut grpc = connect(&server).await;
    let request = pb::ConvertDeckRequest { deck: deck.into() };
    let same = grpc.convert_deck(request).await.unwrap().into_inner();
    assert!(same.problem.is_some());
    // what is not understood has its line
    let (status, problem) = answer(send(&deck.replace("*ELASTIC", "*HYPERELASTIC"))).await;
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY, "{problem:#}");
    assert!(problem.to_string().contains("line 1"), "{problem:#}");
}

/// Operations: ListExamples, ListWaiting
#[tokio::test]
async fn examples_can_be_submitted_and_what_waits_is_told() {
    let server = server().await;
    server.post("/v1/queue/pause").send().await.unwrap();
    let examples = server.json("/v1/examples").await;
    let examples = examples["examples"].as_array().unwrap();
    assert!(examples.len() > 10);
    let mut ids = vec![];
    for example in examples {
        let id = server.submit(&example["problem"]).await;
        let told = server.json(&format!("/v1/jobs/{id}/description")).await;
        assert_eq!(told["description"], example["description"]);
        ids.push(id);
    }
    let forecast = server.json("/v1/queue/waiting").await;
    let waiting = forecast["waiting"].as_array().unwrap();
    let order: Vec<&str> = waiting
        .iter()
        .map(|job| job["id"].as_str().unwrap())
        .collect();
    assert_eq!(order, ids);
    assert_eq!(
        (&waiting[0]["position"], &waiting[0]["reason"]),
        (&json!(1), &json!("paused"))
    );
    let mut grpc = connect(&server).await;
    let same = grpc
        .list_waiting(pb::ListWaitingRequest {})
        .await
        .unwrap()
        .into_inner();
    assert_eq!(same.waiting.len(), ids.len());
    let same = grpc
        .list_examples(pb::ListExamplesRequest {})
        .await
        .unwrap()
        .into_inner();
    assert_eq!(same.examples.len(), examples.len());
    server.post("/v1/queue/resume").send().await.unwrap();
    for id in &ids {
        assert_eq!(server.until_done(id).await["status"], "succeeded");
    }
}
