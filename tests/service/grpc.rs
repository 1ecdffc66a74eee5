//! Calls of `signorini.v1.JobService`, health and reflection.

use reqwest::StatusCode;
use rpc::pb::{self, job_service_client::JobServiceClient};
use serde_json::{Value, json};
use suite::{
    example, example_json,
    harness::{Server, answer, large},
};
use tonic::{Code, transport::Channel};
use tonic_types::StatusExt;

use crate::{SIGNORINI, by_name, server};

pub(crate) async fn connect(server: &Server) -> JobServiceClient<Channel> {
    JobServiceClient::connect(server.url.clone()).await.unwrap()
}

/// A problem as a message: converted by its names, not by the code under test.
pub(crate) fn message(text: &str) -> pb::Problem {
    by_name::message("Problem", &serde_json::from_str(text).unwrap())
}

/// Operations: CreateJob, GetJob, ListJobs, WatchJob, CancelJob, GetResult, GetProfile
#[tokio::test]
async fn a_job_is_submitted_watched_and_fetched_over_grpc() {
    let server = server().await;
    let mut grpc = connect(&server).await;
    let problem = message(&example("rectangular_punch"));
    let judged = grpc
        .validate_problem(pb::ValidateProblemRequest {
            problem: Some(problem.clone()),
        })
        .await
        .unwrap();
    assert!(judged.into_inner().valid);
    let request = pb::CreateJobRequest {
        problem: Some(problem),
        name: Some("x".into()),
        ..Default::default()
    };
    let job = grpc.create_job(request).await.unwrap().into_inner();
    assert_eq!(job.status(), pb::Status::Running, "a worker was free");

    let mut stream = grpc
        .watch_job(pb::WatchJobRequest {
            id: job.id.clone(),
            after_seq: 0,
        })
        .await
        .unwrap()
        .into_inner();
    let mut events = vec![];
    while let Some(event) = stream.message().await.unwrap() {
        events.push(event);
    }
    assert!(
        events
            .iter()
            .map(|event| event.seq)
            .eq(1..=events.len() as i64)
    );
    let Some(pb::event::Payload::Done(done)) = events.pop().unwrap().payload else {
        panic!("done comes last")
    };
    assert_eq!(done.job.unwrap().status(), pb::Status::Succeeded);

    let job = grpc
        .get_job(pb::GetJobRequest { id: job.id })
        .await
        .unwrap()
        .into_inner();
    assert_eq!(job.result_available(), pb::ResultAvailable::Final);
    let result = grpc
        .get_result(pb::GetResultRequest { id: job.id.clone() })
        .await
        .unwrap()
        .into_inner();
    assert!(result.summary.unwrap().converged);
    let profile = grpc
        .get_profile(pb::GetProfileRequest {
            id: job.id.clone(),
            boundary: "top".into(),
            ..Default::default()
        })
        .await;
    let profile = profile.unwrap().into_inner();
    assert!(!profile.s.is_empty() && profile.state.len() == profile.s.len());
    let list = grpc
        .list_jobs(pb::ListJobsRequest {
            page_size: 10,
            ..Default::default()
        })
        .await
        .unwrap()
        .into_inner();
    assert_eq!((list.jobs.len(), list.next_page_token.as_str()), (1, ""));
    let canceled = grpc
        .cancel_job(pb::CancelJobRequest { id: job.id })
        .await
        .unwrap()
        .into_inner();
    assert_eq!(
        canceled.outcome(),
        pb::cancel_job_response::Outcome::AlreadyTerminal
    );
}

/// Operations: CreateJob
#[tokio::test]
async fn a_wait_over_grpc_returns_the_terminal_job() {
    let server = server().await;
    let mut grpc = connect(&server).await;
    let problem = Some(message(&example("sheet")));
    let job = grpc
        .create_job(pb::CreateJobRequest {
            problem: problem.clone(),
            wait: Some(30.0),
            ..Default::default()
        })
        .await
        .unwrap()
        .into_inner();
    assert_eq!(job.status(), pb::Status::Succeeded);
    let refused = grpc
        .create_job(pb::CreateJobRequest {
            problem,
            wait: Some(61.0),
            ..Default::default()
        })
        .await
        .unwrap_err();
    assert_eq!(refused.code(), Code::InvalidArgument);
}

/// Operations: CreateJob, GetJob
#[tokio::test]
async fn errors_carry_codes_and_details() {
    let server = server().await;
    let mut grpc = connect(&server).await;
    let none = grpc
        .get_job(pb::GetJobRequest { id: "job_7".into() })
        .await
        .unwrap_err();
    assert_eq!(none.code(), Code::NotFound);
    assert_eq!(
        none.get_error_details().error_info().unwrap().reason,
        "not-found"
    );

    let mut problem = message(&example("sheet"));
    problem.materials[0].youngs_modulus = Some(-1.0);
    let request = pb::CreateJobRequest {
        problem: Some(problem),
        priority: 99,
        ..Default::default()
    };
    let invalid = grpc.create_job(request).await.unwrap_err();
    assert_eq!(invalid.code(), Code::InvalidArgument);
    let details = invalid.get_error_details();
    let fields: Vec<_> = details
        .bad_request()
        .unwrap()
        .field_violations
        .iter()
        .map(|v| v.field.clone())
        .collect();
    assert_eq!(fields, ["/priority", "/problem/materials/0/youngs_modulus"]);

    let empty = grpc
        .create_job(pb::CreateJobRequest::default())
        .await
        .unwrap_err();
    let details = empty.get_error_details();
    assert!(
        details
            .bad_request()
            .unwrap()
            .field_violations
            .iter()
            .any(|v| v.field == "/problem/mesh")
    );

    // many long violations still fit into the headers that a client accepts
    let mut problem = message(&example("sheet"));
    let wrong = pb::Load {
        boundary: Some("b".repeat(1000)),
        pressure: Some(pb::BoundaryValue {
            start: f64::NAN,
            end: None,
        }),
        ..Default::default()
    };
    problem.loads = vec![wrong; 1000];
    let request = pb::CreateJobRequest {
        problem: Some(problem),
        ..Default::default()
    };
    let many = grpc.create_job(request).await.unwrap_err();
    assert_eq!(many.code(), Code::InvalidArgument, "{many}");
    let details = many.get_error_details();
    let shown = &details.bad_request().unwrap().field_violations;
    assert!(shown.len() > 5 && shown.last().unwrap().description.contains("more"));
    let long = pb::GetJobRequest {
        id: "x".repeat(1 << 19),
    };
    assert_eq!(grpc.get_job(long).await.unwrap_err().code(), Code::NotFound);

    // A message over 1 MiB.
    let mut problem = message(&example("sheet"));
    problem.title = Some("x".repeat(2 << 20));
    let request = pb::CreateJobRequest {
        problem: Some(problem),
        ..Default::default()
    };
    let refused = grpc.create_job(request).await.unwrap_err();
    assert_eq!(refused.code(), Code::OutOfRange);
    let details = refused.get_error_details();
    assert_eq!(details.error_info().unwrap().reason, "payload-too-large");
}

/// Jobs, problems and results that REST returns in one response may be too large for a message.
/// Operations: ListJobs, GetJobProblem, GetResult
#[tokio::test]
async fn no_answer_exceeds_the_limit_of_a_message() {
    use prost::Message;
    const MOST: usize = 1 << 20;
    let server = Server::start(SIGNORINI, &[]).await;
    server.post("/v1/queue/pause").send().await.unwrap();
    let mut labels = serde_json::Map::new();
    for n in 0..64 {
        labels.insert(format!("label {n}"), json!("x".repeat(250)));
    }
    let job = json!({ "problem": example_json("sheet"), "labels": labels });
    let batch = json!({ "jobs": vec![job; 150] });
    let accepted = server.post("/v1/jobs/batch").json(&batch).send().await;
    assert_eq!(accepted.unwrap().status(), StatusCode::ACCEPTED);
    let mut grpc = connect(&server).await;
    let (mut found, mut page_token) = (vec![], String::new());
    loop {
        let request = pb::ListJobsRequest {
            page_size: 1000,
            page_token,
            ..Default::default()
        };
        let page = grpc.list_jobs(request).await.unwrap().into_inner();
        assert!(page.encoded_len() <= MOST, "{}", page.encoded_len());
        page_token = page.next_page_token;
        found.extend(page.jobs.into_iter().map(|job| job.id));
        if page_token.is_empty() {
            break;
        }
    }
    let count = found.len();
    found.sort();
    found.dedup();
    assert_eq!((count, found.len()), (150, 150));

    let mut large = example_json("sheet");
    large["title"] = json!("x".repeat(2 * MOST));
    let id = server.submit(&large).await;
    let refused = grpc.get_job_problem(pb::GetJobProblemRequest { id }).await;
    let details = refused.unwrap_err().get_error_details();
    assert_eq!(details.error_info().unwrap().reason, "payload-too-large");

    server.post("/v1/queue/resume").send().await.unwrap();
    let id = server.submit(&many_contacts_and_steps()).await;
    server.until_done(&id).await;
    let whole = server.get(&format!("/v1/jobs/{id}/result")).send().await;
    assert!(whole.unwrap().bytes().await.unwrap().len() > MOST);
    let refused = grpc.get_result(pb::GetResultRequest { id }).await;
    let refused = refused.unwrap_err();
    let words = "GET /v1/jobs/{id}/result";
    assert!(refused.message().contains(words), "{}", refused.message());
    let details = refused.get_error_details();
    assert_eq!(details.error_info().unwrap().reason, "payload-too-large");
}

/// A strip with a flat obstacle on every second edge, pressed in small steps: little to solve, much to tell.
fn many_contacts_and_steps() -> Value {
    const CONTACTS: usize = 20;
    const STEPS: usize = 150;
    let x: Vec<f64> = (0..=2 * CONTACTS).map(|n| n as f64).collect();
    let mut boundaries = serde_json::Map::new();
    let mut contacts = vec![];
    for n in 0..CONTACTS {
        let (name, from) = (format!("part {n}"), 2 * n);
        let rule = json!({ "side": "top", "x": [from as f64 - 0.01, from as f64 + 1.01] });
        boundaries.insert(name.clone(), rule);
        let obstacle = json!({ "kind": "flat" });
        contacts.push(json!({ "boundary": name, "obstacle": obstacle, "indentation": 0.01 }));
    }
    let step =
        |n: usize| json!({ "name": format!("step {n}"), "indentation": n as f64 / STEPS as f64 });
    json!({
        "analysis": { "kind": "plane_strain" },
        "mesh": { "grid": { "x": x, "y": [0, 1] }, "boundaries": boundaries },
        "materials": [{ "youngs_modulus": 1000, "poissons_ratio": 0.3 }],
        "supports": [{ "boundary": "bottom", "ux": 0, "uy": 0 }],
        "contacts": contacts,
        "steps": (1..=STEPS).map(step).collect::<Vec<Value>>(),
    })
}

/// Operations: WatchJob
#[tokio::test]
async fn a_stream_over_grpc_ends_unavailable_when_the_service_stops() {
    let mut server = Server::start_alone(SIGNORINI, &["--workers", "1"]).await;
    let id = server.submit(&large()).await;
    server.until_running(&id).await;
    let mut grpc = connect(&server).await;
    let mut stream = grpc
        .watch_job(pb::WatchJobRequest { id, after_seq: 0 })
        .await
        .unwrap()
        .into_inner();
    stream.message().await.unwrap();
    assert!(server.terminate().await.success());
    let status = loop {
        match stream.message().await {
            Ok(Some(event)) => assert!(!matches!(event.payload, Some(pb::event::Payload::Done(_)))),
            Ok(None) => panic!("the stream ended as if the job had"),
            Err(status) => break status,
        }
    };
    assert_eq!(status.code(), Code::Unavailable);
}

#[tokio::test]
async fn health_and_unknown_services_answer() {
    let server = server().await;
    let channel = Channel::from_shared(server.url.clone())
        .unwrap()
        .connect()
        .await
        .unwrap();
    let mut health = tonic_health::pb::health_client::HealthClient::new(channel.clone());
    for name in ["", "signorini.v1.JobService"] {
        let request = tonic_health::pb::HealthCheckRequest {
            service: name.into(),
        };
        let answer = health.check(request).await.unwrap().into_inner();
        assert_eq!(
            answer.status(),
            tonic_health::pb::health_check_response::ServingStatus::Serving,
            "{name:?}"
        );
    }
    let mut unknown = tonic::client::Grpc::new(channel);
    unknown.ready().await.unwrap();
    let codec = tonic_prost::ProstCodec::<pb::GetJobRequest, pb::Job>::default();
    let path = "/other.Service/Call".parse().unwrap();
    let status = unknown
        .unary(
            tonic::Request::new(pb::GetJobRequest::default()),
            path,
            codec,
        )
        .await
        .unwrap_err();
    assert_eq!(status.code(), Code::Unimplemented);
}

/// A call without the type of gRPC would be taken as one, and the bytes of its body counted as none.
#[tokio::test]
async fn a_call_without_the_content_type_of_grpc_is_refused() {
    let server = server().await;
    for path in [
        "/signorini.v1.JobService/CreateJob",
        "/signorini.v1.JobService/UploadMesh",
        "/grpc.health.v1.Health/Check",
    ] {
        for content_type in [
            None,
            Some("application/json"),
            Some("application/octet-stream"),
        ] {
            // an empty message
            let mut request = server.post(path).body(vec![0; 5]);
            if let Some(content_type) = content_type {
                request = request.header("content-type", content_type);
            }
            let (status, document) = answer(request).await;
            assert_eq!(status, 415, "{path}, {content_type:?}");
            assert_eq!(document["code"], "unsupported-media");
            let detail = document["detail"].as_str().unwrap();
            assert!(detail.contains("application/grpc"), "{detail}");
        }
    }
}

#[tokio::test]
async fn reflection_names_our_service_in_both_versions() {
    use futures_util::stream;
    let server = server().await;
    let channel = Channel::from_shared(server.url.clone())
        .unwrap()
        .connect()
        .await
        .unwrap();

    use tonic_reflection::pb::v1;
    let mut reflection = v1::server_reflection_client::ServerReflectionClient::new(channel.clone());
    let ask = v1::ServerReflectionRequest {
        message_request: Some(v1::server_reflection_request::MessageRequest::ListServices(
            String::new(),
        )),
        ..Default::default()
    };
    let mut answers = reflection
        .server_reflection_info(stream::iter([ask]))
        .await
        .unwrap()
        .into_inner();
    let answer = format!("{:?}", answers.message().await.unwrap().unwrap());
    assert!(
        answer.contains("signorini.v1.JobService") && answer.contains("grpc.health.v1.Health"),
        "{answer}"
    );

    use tonic_reflection::pb::v1alpha;
    let mut reflection = v1alpha::server_reflection_client::ServerReflectionClient::new(channel);
    let ask = v1alpha::ServerReflectionRequest {
        message_request: Some(
            v1alpha::server_reflection_request::MessageRequest::FileContainingSymbol(
                "signorini.v1.JobService".into(),
            ),
        ),
        ..Default::default()
    };
    let mut answers = reflection
        .server_reflection_info(stream::iter([ask]))
        .await
        .unwrap()
        .into_inner();
    let answer = format!("{:?}", answers.message().await.unwrap().unwrap());
    assert!(
        answer.contains("FileDescriptorResponse"),
        "{}",
        &answer[..300.min(answer.len())]
    );
}
