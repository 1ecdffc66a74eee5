//! Who may do what: every operation with every kind of credentials, over both protocols; tokens, hosts and origins.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use reqwest::{Method, StatusCode};
use rpc::pb::{self, job_service_client::JobServiceClient};
use rusqlite::Connection;
use serde_json::{Value, json};
use suite::{example_json, harness::Server};
use tonic::{Code, Request, client::Grpc, codegen::http::uri::PathAndQuery, transport::Channel};
use tonic_prost::ProstCodec;

use crate::{SIGNORINI, server};

/// Who may use which operation: written down here once more, and not taken from the service.
const POLICY: &[(&str, &[&str])] = &[
    (
        "open",
        &[
            "CreateSession",
            "DeleteSession",
            "GetError",
            "GetHome",
            "GetWarning",
            "Live",
            "Ready",
        ],
    ),
    ("identified", &["GetCaller"]),
    (
        "read",
        &[
            "GetJob",
            "GetJobDescription",
            "GetJobView",
            "GetJobFieldView",
            "GetMeshView",
            "PreviewProblem",
            "ConvertDeck",
            "ListExamples",
            "ListWaiting",
            "ListWorkers",
            "WatchJobs",
            "ListJobs",
            "CountJobs",
            "GetJobTable",
            "GetJobProblem",
            "WatchJob",
            "GetResult",
            "ListIterations",
            "GetProfile",
            "StreamResult",
            "GetPlot",
            "GetMesh",
            "ListMeshes",
            "GetSweep",
            "ListSweeps",
            "ListSweepMembers",
            "WatchSweep",
            "GetQueue",
            "GetServerInfo",
            "GetProblemSchema",
            "GetOpenApi",
            "GetProto",
            "GetDocs",
            "GetDocsFile",
            "GetMetrics",
        ],
    ),
    (
        "submit",
        &[
            "ValidateProblem",
            "CreateJob",
            "PutJob",
            "BatchCreateJobs",
            "RetryJob",
            "UpdateJob",
            "UploadMesh",
            "CreateSweep",
            "CreateMemberJob",
        ],
    ),
    (
        "cancel",
        &[
            "CancelJob",
            "CancelJobs",
            "DeleteFields",
            "DeleteJob",
            "DeleteJobs",
            "DeleteMesh",
            "CancelSweep",
            "DeleteSweep",
        ],
    ),
    (
        "admin",
        &[
            "PauseQueue",
            "ResumeQueue",
            "ListOwners",
            "CreateToken",
            "ListTokens",
            "RevokeToken",
            "RotateToken",
        ],
    ),
];

/// The name of a case; the token that is sent; what it allows, `None` if it identifies nobody.
type Case = (String, Option<String>, Option<&'static [&'static str]>);

struct Cases(Vec<Case>);

/// What an administrator may use.
const EVERYTHING: &[&str] = &[
    "open",
    "identified",
    "read",
    "submit",
    "cancel",
    "work",
    "admin",
];

pub(crate) async fn create(server: &Server, admin: Option<&str>, body: Value) -> (String, String) {
    let mut request = server.post("/v1/tokens").json(&body);
    if let Some(admin) = admin {
        request = request.bearer_auth(admin);
    }
    let response = request.send().await.unwrap();
    assert_eq!(response.status(), StatusCode::CREATED);
    assert_eq!(response.headers()["cache-control"], "no-store");
    let new: Value = response.json().await.unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    (text(&new["token"]["id"]), text(&new["secret"]))
}

/// The same id with another secret, of which one character in the middle differs.
fn another_secret(token: &str) -> String {
    let middle = if &token[30..31] == "A" { "B" } else { "A" };
    format!("{}{middle}{}", &token[..30], &token[31..])
}

/// A server with tokens of all kinds; the first is the administrator's.
async fn with_tokens() -> (Server, String, Cases) {
    let mut server = server().await;
    let token =
        |owner: &str, scopes: &[&str]| json!({"name": "test", "owner": owner, "scopes": scopes});
    let (_, admin) = create(&server, None, token("root", &["admin"])).await;
    // the shortest life is a minute: it is over in the store
    let mut short = token("ada", &["admin"]);
    short["expires_in_s"] = json!(60);
    let (id, expired) = create(&server, Some(&admin), short).await;
    server.terminate().await;
    let database = Connection::open(server.data().join("signorini.db")).unwrap();
    let over = "update token set expires_at = created_at, checksum = null where id = ?";
    database.execute(over, [&id]).unwrap();
    drop(database);
    server.restart().await;
    let mut cases: Vec<Case> = vec![
        ("none".into(), None, None),
        ("expired".into(), Some(expired), None),
        ("not a token".into(), Some("abc".into()), None),
        ("another secret".into(), Some(another_secret(&admin)), None),
        (
            "another id".into(),
            Some(admin.replace(&admin[4..16], "000000000000")),
            None,
        ),
    ];
    for (scopes, allows) in [
        ("read", &["open", "identified", "read"][..]),
        ("submit", &["open", "identified", "submit"]),
        ("cancel", &["open", "identified", "cancel"]),
        ("work", &["open", "identified", "work"]),
        ("read+submit", &["open", "identified", "read", "submit"]),
        ("admin", EVERYTHING),
    ] {
        let all: Vec<&str> = scopes.split('+').collect();
        let (_, secret) = create(&server, Some(&admin), token("ada", &all)).await;
        cases.push((scopes.into(), Some(secret), Some(allows)));
    }
    let (id, revoked) = create(&server, Some(&admin), token("ada", &["admin"])).await;
    let response = server
        .request(Method::DELETE, &format!("/v1/tokens/{id}"))
        .bearer_auth(&admin);
    assert_eq!(response.send().await.unwrap().status(), StatusCode::OK);
    cases.push(("revoked".into(), Some(revoked), None));
    let (id, old) = create(&server, Some(&admin), token("ada", &["admin"])).await;
    let rotated = server
        .post(&format!("/v1/tokens/{id}/rotate"))
        .bearer_auth(&admin);
    let rotated: Value = rotated.send().await.unwrap().json().await.unwrap();
    cases.push(("rotated away".into(), Some(old), None));
    let new = rotated["secret"].as_str().unwrap().to_owned();
    cases.push(("rotated".into(), Some(new), Some(EVERYTHING)));
    (server, admin, Cases(cases))
}

pub(crate) fn access_of(operation: &str) -> &'static str {
    let mut found = POLICY
        .iter()
        .filter(|(_, operations)| operations.contains(&operation));
    let (access, _) = found
        .next()
        .unwrap_or_else(|| panic!("{operation} has no policy here"));
    assert!(found.next().is_none());
    access
}

/// Operations: CreateToken, ListTokens, RevokeToken, RotateToken
#[tokio::test]
async fn every_route_is_for_those_whom_the_policy_names() {
    let (server, admin, Cases(cases)) = with_tokens().await;
    let openapi = server
        .get("/openapi.json")
        .bearer_auth(&admin)
        .send()
        .await
        .unwrap();
    let openapi: Value = openapi.json().await.unwrap();
    let mut seen = 0;
    for (path, methods) in openapi["paths"].as_object().unwrap() {
        for (method, operation) in methods.as_object().unwrap() {
            let id = operation["operationId"].as_str().unwrap();
            let access = access_of(id);
            assert_eq!(operation["x-access"], access, "{id}");
            let method: Method = method.to_uppercase().parse().unwrap();
            let (job, sweep) = (
                "job_01890a5d-ac96-774b-bcce-b302099a8057",
                "sweep_01890a5d-ac96-774b-bcce-b302099a8057",
            );
            let path = path
                .replace("/sweeps/{id}", &format!("/sweeps/{sweep}"))
                .replace("{id}", job)
                .replace("{hash}", &format!("sha256:{}", "0".repeat(64)))
                .replace("{boundary}", "top")
                .replace("{plot}", "mesh.svg")
                .replace("{field}", "von_mises")
                .replace("{number}", "0")
                .replace("{name}", "punch")
                .replace("{token}", "000000000000")
                .replace("{file}", "index.css")
                .replace("{code}", "not-found");
            for (case, secret, allows) in &cases {
                let mut request = server.request(method.clone(), &path);
                if let Some(secret) = secret {
                    request = request.bearer_auth(secret);
                }
                let response = request.send().await.unwrap();
                let status = response.status();
                let asks = response.headers().contains_key("www-authenticate");
                let told = format!("{method} {path} with {case}: {status}");
                match allows {
                    _ if access == "open" => assert!(status != 401 && status != 403, "{told}"),
                    None => assert!(status == 401 && asks, "{told}"),
                    Some(allows) if allows.contains(&access) => {
                        assert!(status != 401 && status != 403, "{told}");
                    }
                    Some(_) => assert_eq!(status, 403, "{told}"),
                }
                seen += 1;
            }
        }
    }
    let operations: usize = POLICY.iter().map(|(_, operations)| operations.len()).sum();
    assert_eq!(seen, operations * cases.len());
    // nothing of a secret is in the log, not even of a wrong one
    let log = server.log();
    for (_, secret, _) in &cases {
        if let Some(secret) = secret
            .as_deref()
            .filter(|secret| secret.starts_with("sgn_"))
        {
            assert!(!log.contains(&secret[17..]));
        }
    }
}

/// A call of any rpc with an empty message.
async fn call(channel: &Channel, path: &str, secret: Option<&str>) -> Code {
    let mut grpc = Grpc::new(channel.clone());
    grpc.ready().await.unwrap();
    let mut request = Request::new(());
    if let Some(secret) = secret {
        let value = format!("Bearer {secret}").parse().unwrap();
        request.metadata_mut().insert("authorization", value);
    }
    let codec = ProstCodec::<(), ()>::default();
    let path = PathAndQuery::try_from(path).unwrap();
    match grpc.server_streaming(request, path, codec).await {
        Err(status) => status.code(),
        // what it streams is not read: the call was allowed
        Ok(_) => Code::Ok,
    }
}

#[tokio::test]
async fn every_rpc_is_for_those_whom_the_policy_names() {
    let (server, admin, Cases(cases)) = with_tokens().await;
    let openapi = server
        .get("/openapi.json")
        .bearer_auth(&admin)
        .send()
        .await
        .unwrap();
    let openapi: Value = openapi.json().await.unwrap();
    let mut rpcs = BTreeMap::new();
    for methods in openapi["paths"].as_object().unwrap().values() {
        for operation in methods.as_object().unwrap().values() {
            let access = access_of(operation["operationId"].as_str().unwrap());
            for rpc in operation["x-grpc"].as_array().into_iter().flatten() {
                let before = rpcs.insert(rpc.as_str().unwrap().to_owned(), access);
                assert!(before.is_none_or(|before| before == access), "{rpc}");
            }
        }
    }
    let own = rpcs
        .into_iter()
        .map(|(rpc, access)| (format!("/signorini.v1.JobService/{rpc}"), access));
    let others = [
        ("/grpc.health.v1.Health/Check".to_owned(), "open"),
        ("/grpc.health.v1.Health/List".to_owned(), "open"),
        ("/grpc.health.v1.Health/Watch".to_owned(), "identified"),
        (
            "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo".to_owned(),
            "read",
        ),
        (
            "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo".to_owned(),
            "read",
        ),
        (
            "/signorini.v1.JobService/NoSuchRpc".to_owned(),
            "identified",
        ),
        (
            "/signorini.worker.v1.WorkerService/Lease".to_owned(),
            "work",
        ),
        (
            "/signorini.worker.v1.WorkerService/Report".to_owned(),
            "work",
        ),
        (
            "/signorini.worker.v1.WorkerService/GetContent".to_owned(),
            "work",
        ),
    ];
    let channel = Channel::from_shared(server.url.clone())
        .unwrap()
        .connect()
        .await
        .unwrap();
    let mut seen = 0;
    for (path, access) in own.chain(others) {
        for (case, secret, allows) in &cases {
            let code = call(&channel, &path, secret.as_deref()).await;
            let told = format!("{path} with {case}: {code:?}");
            let refused = [Code::Unauthenticated, Code::PermissionDenied].contains(&code);
            match allows {
                _ if access == "open" => assert!(!refused, "{told}"),
                None => assert_eq!(code, Code::Unauthenticated, "{told}"),
                Some(allows) if allows.contains(&access) => assert!(!refused, "{told}"),
                Some(_) => assert_eq!(code, Code::PermissionDenied, "{told}"),
            }
            seen += 1;
        }
    }
    assert!(seen > 40 * cases.len());
}

/// Streams end with an error, and not as if they were complete.
#[tokio::test]
async fn a_stream_ends_with_the_token_that_opened_it() {
    let server = server().await;
    let token =
        |owner: &str, scopes: &[&str]| json!({"name": "test", "owner": owner, "scopes": scopes});
    let (_, admin) = create(&server, None, token("root", &["admin"])).await;
    let (id, ada) = create(&server, Some(&admin), token("ada", &["read", "submit"])).await;
    server
        .post("/v1/queue/pause")
        .bearer_auth(&admin)
        .send()
        .await
        .unwrap();
    let body = json!({"problem": example_json("rectangular_punch")});
    let job = server
        .post("/v1/jobs")
        .bearer_auth(&ada)
        .json(&body)
        .send()
        .await
        .unwrap();
    let job: Value = job.json().await.unwrap();
    let path = format!("/v1/jobs/{}/events", job["id"].as_str().unwrap());
    let stream = server.get(&path).bearer_auth(&ada).send().await.unwrap();
    assert_eq!(stream.status(), StatusCode::OK);
    // nginx as it is installed would keep events back until its buffer is full
    assert_eq!(stream.headers()["x-accel-buffering"], "no");
    let mut grpc = JobServiceClient::connect(server.url.clone()).await.unwrap();
    let mut watch = Request::new(pb::WatchJobRequest {
        id: job["id"].as_str().unwrap().into(),
        after_seq: 0,
    });
    watch
        .metadata_mut()
        .insert("authorization", format!("Bearer {ada}").parse().unwrap());
    let mut watched = grpc.watch_job(watch).await.unwrap().into_inner();
    server
        .request(Method::DELETE, &format!("/v1/tokens/{id}"))
        .bearer_auth(&admin)
        .send()
        .await
        .unwrap();
    // the whole of it: it waits until the stream ends
    assert!(stream.bytes().await.is_err());
    while let Some(event) = watched.message().await.transpose() {
        if event.is_err() {
            return;
        }
    }
    panic!("the stream ended as if it were complete");
}

/// Figures of the moment, by their names.
async fn metric(server: &Server, admin: &str, name: &str) -> f64 {
    let metrics = server.get("/metrics").bearer_auth(admin);
    let text = metrics.send().await.unwrap().text().await.unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix(name));
    line.unwrap().trim().parse().unwrap()
}

/// A wait may take a minute.
#[tokio::test]
async fn a_wait_ends_with_the_token_that_it_began_with() {
    let server = server().await;
    let token =
        |owner: &str, scopes: &[&str]| json!({"name": "test", "owner": owner, "scopes": scopes});
    let (_, admin) = create(&server, None, token("root", &["admin"])).await;
    let (id, ada) = create(&server, Some(&admin), token("ada", &["read", "submit"])).await;
    let pause = server.post("/v1/queue/pause").bearer_auth(&admin);
    pause.send().await.unwrap();
    let body = json!({"problem": example_json("rectangular_punch")});
    let submit = server.post("/v1/jobs").bearer_auth(&ada).json(&body);
    let job: Value = submit.send().await.unwrap().json().await.unwrap();
    let job = job["id"].as_str().unwrap().to_owned();

    let wait = server.get(&format!("/v1/jobs/{job}?wait=60"));
    let wait = tokio::spawn(wait.bearer_auth(&ada).send());
    let mut grpc = JobServiceClient::connect(server.url.clone()).await.unwrap();
    let mut called = Request::new(pb::WaitJobRequest {
        id: job.clone(),
        wait: 60.0,
        ..pb::WaitJobRequest::default()
    });
    called
        .metadata_mut()
        .insert("authorization", format!("Bearer {ada}").parse().unwrap());
    let called = tokio::spawn(async move { grpc.wait_job(called).await });
    for _ in 0..1000 {
        // both, and this one
        if metric(&server, &admin, "signorini_requests_in_progress").await >= 3.0 {
            break;
        }
    }
    let revoke = server.request(Method::DELETE, &format!("/v1/tokens/{id}"));
    revoke.bearer_auth(&admin).send().await.unwrap();
    let revoked = Instant::now();
    // soon, and not after what is left of the minute
    let answer = wait.await.unwrap().unwrap();
    assert_eq!(answer.status(), StatusCode::UNAUTHORIZED);
    assert!(revoked.elapsed() < Duration::from_secs(10));
    let document: Value = answer.json().await.unwrap();
    assert_eq!(document["code"], "unauthenticated");
    let answer = called.await.unwrap();
    assert_eq!(answer.unwrap_err().code(), Code::Unauthenticated);
    // over both protocols; the metric is counted when an answer has ended
    let unauthenticated = "signorini_requests_unauthenticated_total";
    while metric(&server, &admin, unauthenticated).await < 2.0 {
        assert!(revoked.elapsed() < Duration::from_secs(20));
    }
}

/// The answer has the only copy of the new secret, though what asked for it is no longer valid.
#[tokio::test]
async fn a_token_can_rotate_and_revoke_itself() {
    let server = server().await;
    let body = json!({"name": "test", "owner": "root", "scopes": ["admin"]});
    let (id, first) = create(&server, None, body).await;
    let rotate = server.post(&format!("/v1/tokens/{id}/rotate"));
    let answer = rotate.bearer_auth(&first).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::OK);
    let answer: Value = answer.json().await.unwrap();
    let second = answer["secret"].as_str().unwrap().to_owned();

    let mut grpc = JobServiceClient::connect(server.url.clone()).await.unwrap();
    let mut rotate = Request::new(pb::RotateTokenRequest { id: id.clone() });
    rotate
        .metadata_mut()
        .insert("authorization", format!("Bearer {second}").parse().unwrap());
    let third = grpc.rotate_token(rotate).await.unwrap().into_inner().secret;

    let revoke = || server.request(Method::DELETE, &format!("/v1/tokens/{id}"));
    let answer = revoke().bearer_auth(&third).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::OK);
    let answer: Value = answer.json().await.unwrap();
    assert!(answer["revoked_at"].is_string(), "{answer}");
    let answer = revoke().bearer_auth(&third).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::UNAUTHORIZED);
}

/// What others own is not found, by id, key or hash; an administrator finds it.
#[tokio::test]
async fn each_owner_has_their_own_jobs_meshes_and_keys() {
    let server = server().await;
    let token = |owner: &str| json!({"name": "test", "owner": owner, "scopes": ["read", "submit", "cancel"]});
    let admin = json!({"name": "test", "owner": "root", "scopes": ["admin"]});
    let (_, admin) = create(&server, None, admin).await;
    let (_, ada) = create(&server, Some(&admin), token("ada")).await;
    let (_, bob) = create(&server, Some(&admin), token("bob")).await;
    let body = json!({"problem": example_json("rectangular_punch"), "name": "x"});
    let submit = async |secret: &str| -> Value {
        let request = server
            .post("/v1/jobs")
            .bearer_auth(secret)
            .header("idempotency-key", "k")
            .json(&body);
        request.send().await.unwrap().json().await.unwrap()
    };
    let (of_ada, of_bob) = (submit(&ada).await, submit(&bob).await);
    assert_eq!(
        (of_ada["owner"].as_str(), of_bob["owner"].as_str()),
        (Some("ada"), Some("bob"))
    );
    assert_ne!(of_ada["id"], of_bob["id"]);
    let status = async |method: Method, path: &str, secret: &str| {
        let request = server.request(method, path).bearer_auth(secret);
        request.send().await.unwrap().status().as_u16()
    };
    let path = format!("/v1/jobs/{}", of_ada["id"].as_str().unwrap());
    for (secret, expected) in [(&ada, 200), (&bob, 404), (&admin, 200)] {
        assert_eq!(status(Method::GET, &path, secret).await, expected);
        assert_eq!(
            status(Method::GET, &format!("{path}/problem"), secret).await,
            expected
        );
    }
    assert_eq!(
        status(Method::POST, &format!("{path}/cancel"), &bob).await,
        404
    );

    let mesh = json!({
        "nodes": [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5]],
        "elements": [[0, 1, 2, 3, 4, 5, 6, 7]],
        "boundaries": {"top": [[3, 2, 6]]}
    });
    let upload = async |secret: &str| {
        let request = server
            .post("/v1/meshes")
            .bearer_auth(secret)
            .body(mesh.to_string());
        let response = request.send().await.unwrap();
        let status = response.status().as_u16();
        let info: Value = response.json().await.unwrap();
        let hash = info["hash"].as_str().unwrap_or_else(|| panic!("{info}"));
        (status, hash.to_owned())
    };
    let meshes = async |secret: &str| {
        let request = server
            .get("/v1/meshes")
            .bearer_auth(secret)
            .send()
            .await
            .unwrap();
        let list: Value = request.json().await.unwrap();
        list["meshes"].as_array().unwrap().len()
    };
    let (created, hash) = upload(&ada).await;
    assert_eq!(created, 201);
    let path = format!("/v1/meshes/{hash}");
    let stored = json!({"problem": {
        "analysis": {"kind": "plane_strain"},
        "mesh": {"stored": hash},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "top", "ux": 0, "uy": 0}]
    }});
    let uses = async |secret: &str| {
        let request = server.post("/v1/jobs").bearer_auth(secret).json(&stored);
        request.send().await.unwrap().status().as_u16()
    };
    assert_eq!(status(Method::GET, &path, &bob).await, 404);
    assert_eq!(
        (meshes(&ada).await, meshes(&bob).await, meshes(&admin).await),
        (1, 0, 1)
    );
    assert_eq!((uses(&bob).await, uses(&ada).await), (422, 202));
    assert_eq!(status(Method::DELETE, &path, &bob).await, 404);
    // the same file is stored once, for both
    assert_eq!(upload(&bob).await.0, 201);
    assert_eq!(upload(&bob).await.0, 200);
    assert_eq!((meshes(&bob).await, uses(&bob).await), (1, 202));
    for secret in [&ada, &bob] {
        let wait = server
            .get("/v1/jobs?status=queued,running")
            .bearer_auth(secret);
        let list: Value = wait.send().await.unwrap().json().await.unwrap();
        for job in list["jobs"].as_array().unwrap() {
            let path = format!(
                "/v1/jobs/{}?wait=60&until=terminal",
                job["id"].as_str().unwrap()
            );
            server.get(&path).bearer_auth(secret).send().await.unwrap();
        }
    }
    assert_eq!(status(Method::DELETE, &path, &ada).await, 204);
    assert_eq!(
        (
            status(Method::GET, &path, &ada).await,
            status(Method::GET, &path, &bob).await
        ),
        (404, 200)
    );
    assert_eq!(status(Method::DELETE, &path, &bob).await, 204);
    assert_eq!(
        (
            meshes(&admin).await,
            status(Method::GET, &path, &admin).await
        ),
        (0, 404)
    );
}

#[tokio::test]
async fn a_new_token_is_checked_and_the_first_one_must_be_for_an_administrator() {
    let server = server().await;
    let refused = async |body: Value| -> Vec<String> {
        let response = server.post("/v1/tokens").json(&body).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::UNPROCESSABLE_ENTITY);
        let found: Value = response.json().await.unwrap();
        let errors = found["errors"].as_array().unwrap();
        errors
            .iter()
            .map(|error| error["pointer"].as_str().unwrap().to_owned())
            .collect()
    };
    assert_eq!(refused(json!({})).await, ["/name", "/owner", "/scopes"]);
    let first = json!({"name": "x", "owner": "ada", "scopes": ["read"]});
    assert_eq!(refused(first).await, ["/scopes"]);
    let wrong = json!({"name": "", "owner": "ä", "scopes": ["admin", "root"], "expires_in_s": 1, "more": 1});
    assert_eq!(refused(wrong).await, ["/more"]);
    let wrong = json!({"name": "", "owner": "ä", "scopes": ["admin", "root"], "expires_in_s": 1});
    assert_eq!(
        refused(wrong).await,
        ["/name", "/owner", "/scopes/1", "/expires_in_s"]
    );
    // until there is one, nothing is closed
    assert_eq!(
        server.get("/v1/jobs").send().await.unwrap().status(),
        StatusCode::OK
    );
}

/// Tokens survive a restart; the command line manages them with the service stopped, and through it.
#[tokio::test]
async fn the_command_line_manages_tokens() {
    let mut server = server().await;
    server.terminate().await;
    let data = server.data();
    let run = |arguments: &[&str], envs: &[(&str, &str)]| {
        let mut command = std::process::Command::new(SIGNORINI);
        command
            .arg("token")
            .args(arguments)
            .envs(envs.iter().copied());
        let output = command.output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap().trim().to_owned();
        (
            output.status.code(),
            text(output.stdout),
            text(output.stderr),
        )
    };
    let folder = data.to_str().unwrap();
    let create = [
        "create", "--name", "x", "--owner", "root", "--scope", "admin", "--data", folder,
    ];
    let (code, admin, _) = run(&create, &[]);
    assert_eq!(code, Some(0));
    let (code, _, told) = run(
        &["create", "--name", "", "--owner", "", "--data", folder],
        &[],
    );
    assert_eq!((code, told.lines().count()), (Some(2), 2), "{told}");
    server.restart().await;
    assert_eq!(
        server.get("/v1/jobs").send().await.unwrap().status(),
        StatusCode::UNAUTHORIZED
    );
    let (code, _, told) = run(&["list", "--data", folder], &[]);
    assert!(code == Some(5) && told.contains("--url"), "{told}");
    let envs = [
        ("SIGNORINI_TOKEN", admin.as_str()),
        ("SIGNORINI_URL", server.url.as_str()),
    ];
    let (code, ada, _) = run(
        &[
            "create",
            "--name",
            "y",
            "--owner",
            "ada",
            "--expires-in",
            "1d",
        ],
        &envs,
    );
    assert_eq!(code, Some(0));
    let me = server.get("/v1/me").bearer_auth(&ada).send().await.unwrap();
    let me: Value = me.json().await.unwrap();
    assert_eq!(me["owner"], "ada");
    assert_eq!(me["scopes"], json!(["read", "submit", "cancel"]));
    let (_, list, _) = run(&["list"], &envs);
    assert_eq!(list.lines().count(), 3, "{list}");
    let (_, list, _) = run(&["list", "-f", "json"], &envs);
    let list: Value = serde_json::from_str(&list).unwrap();
    assert_eq!(list[1]["owner"], "ada", "{list}");
    // an empty variable counts as absent
    let (code, _, told) = run(
        &["list", "--data", folder],
        &[("SIGNORINI_URL", ""), ("SIGNORINI_CA", "")],
    );
    assert!(code == Some(5) && told.contains("--url"), "{told}");
    // a folder that is named goes before an address of the environment
    let (code, _, told) = run(&["list", "--data", "/no/such/folder"], &envs);
    assert_eq!(code, Some(4), "{told}");
    let id = &ada[4..16];
    let (_, rotated, _) = run(&["rotate", id], &envs);
    let status = async |secret: &str| {
        server
            .get("/v1/me")
            .bearer_auth(secret)
            .send()
            .await
            .unwrap()
            .status()
    };
    assert_eq!(
        (status(&ada).await, status(&rotated).await),
        (StatusCode::UNAUTHORIZED, StatusCode::OK)
    );
    assert_eq!(run(&["revoke", id], &envs).0, Some(0));
    assert_eq!(status(&rotated).await, StatusCode::UNAUTHORIZED);
    let (code, _, told) = run(&["revoke", "000000000000"], &envs);
    assert!(code == Some(6) && told.contains("no token"), "{told}");
    // the password that a browser asks for is the token
    let basic = server
        .get("/docs")
        .basic_auth("anyone", Some(&admin))
        .send()
        .await
        .unwrap();
    assert_eq!(basic.status(), StatusCode::OK);
}

#[tokio::test]
async fn a_service_that_others_reach_needs_tokens_or_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let at = |address: &str, more: &[&str]| {
        let mut command = std::process::Command::new(SIGNORINI);
        command
            .args(["serve", "--listen", address, "--data"])
            .arg(folder.path().join("data"))
            .args(more);
        command
    };
    let serve = |more: &[&str]| at("0.0.0.0:0", more);
    // the name is for clients of a proxy, which are other machines, too
    let behind_a_proxy = at("127.0.0.1:0", &["--allowed-host", "lab.example"]);
    let unnamed = at("127.0.0.1:0", &["--trusted-proxy", "127.0.0.1"]);
    for mut open in [serve(&[]), behind_a_proxy, unnamed] {
        let refused = open.output().unwrap();
        let told = String::from_utf8(refused.stderr).unwrap();
        assert!(
            refused.status.code() == Some(2) && told.contains("token create"),
            "{told}"
        );
    }
    let pattern = serve(&["--allowed-host", "http://lab.example/"])
        .output()
        .unwrap();
    assert!(
        String::from_utf8_lossy(&pattern.stderr).contains("a name without scheme, path or pattern")
    );
    for more in [
        &["--allow-unauthenticated"][..],
        &[
            "--trusted-proxy",
            "10.0.0.1",
            "--proxy-user-header",
            "x-remote-user",
        ],
    ] {
        let mut child = serve(more)
            .stdout(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        let mut first = String::new();
        let out = child.stdout.take().unwrap();
        std::io::BufRead::read_line(&mut std::io::BufReader::new(out), &mut first).unwrap();
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(first.starts_with("http://0.0.0.0:"), "{more:?}: {first}");
    }
}

/// A page of another site can neither submit nor read, whatever it names.
#[tokio::test]
async fn foreign_hosts_and_origins_are_refused() {
    let arguments = [
        "--allowed-host",
        "lab.example",
        "--allowed-origin",
        "https://dashboard.example",
        "--allow-unauthenticated",
    ];
    let server = Server::start(SIGNORINI, &arguments).await;
    let own = server.url.trim_start_matches("http://").to_owned();
    let pause = async |headers: &[(&str, &str)]| {
        let mut request = server.post("/v1/queue/pause");
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        request.send().await.unwrap().status().as_u16()
    };
    for (headers, status) in [
        (vec![], 200),
        (vec![("host", "lab.example:1")], 200),
        (vec![("host", "evil.example")], 403),
        (vec![("host", "[::1]:80")], 200),
        (vec![("host", "[::1].evil")], 400),
        (vec![("host", "[::1]evil.example:80")], 400),
        (vec![("host", "evil@localhost")], 400),
        (vec![("host", "localhost:evil")], 400),
        (vec![("origin", "http://evil.example")], 403),
        (vec![("origin", "null")], 403),
        (
            vec![("origin", "http://lab.example"), ("host", "lab.example")],
            200,
        ),
        (
            vec![("origin", "http://evil.example"), ("host", "evil.example")],
            403,
        ),
        (vec![("origin", "https://dashboard.example")], 200),
    ] {
        assert_eq!(pause(&headers).await, status, "{headers:?}");
    }
    let same = format!("http://{own}");
    assert_eq!(pause(&[("origin", &same)]).await, 200);
    let plain = server
        .post("/v1/jobs")
        .header("content-type", "text/plain")
        .body("{}")
        .send()
        .await
        .unwrap();
    assert_eq!(plain.status(), StatusCode::UNSUPPORTED_MEDIA_TYPE);
    let answer = server
        .get("/v1/jobs")
        .header("origin", "https://dashboard.example")
        .send()
        .await
        .unwrap();
    let headers = answer.headers();
    assert_eq!(
        headers["access-control-allow-origin"],
        "https://dashboard.example"
    );
    assert!(!headers.values().any(|value| value == "*"));
    // also what is refused before any handler
    let refused = server
        .post("/signorini.v1.JobService/GetJob")
        .header("origin", "https://dashboard.example")
        .send()
        .await
        .unwrap();
    assert_eq!(refused.status(), StatusCode::UNSUPPORTED_MEDIA_TYPE);
    assert_eq!(
        refused.headers()["access-control-allow-origin"],
        "https://dashboard.example"
    );
    // a browser asks beforehand, for allowed origins only
    let ask = async |origin: &str| {
        let request = server
            .request(Method::OPTIONS, "/v1/jobs")
            .header("origin", origin)
            .header("access-control-request-method", "POST")
            .header(
                "access-control-request-headers",
                "authorization,content-type",
            );
        request.send().await.unwrap()
    };
    let allowed = ask("https://dashboard.example").await;
    assert_eq!(allowed.status(), StatusCode::OK);
    assert!(
        allowed.headers()["access-control-allow-headers"]
            .to_str()
            .unwrap()
            .contains("authorization")
    );
    assert_eq!(
        ask("https://evil.example").await.status(),
        StatusCode::FORBIDDEN
    );
}

/// A proxy that is trusted names the user; nobody else can.
#[tokio::test]
async fn users_are_those_that_a_trusted_proxy_names() {
    const NAMED: [&str; 2] = ["--proxy-user-header", "x-remote-user"];
    let proxy = ["--trusted-proxy", "127.0.0.0/8", "--proxy-admin", "root"];
    let server = Server::start(SIGNORINI, &[&proxy[..], &NAMED].concat()).await;
    // as a proxy that listens for both protocols is written, alone and with others
    for proxies in ["::ffff:127.0.0.1", "::ffff:127.0.0.0/104"] {
        let arguments = [&["--trusted-proxy", proxies][..], &NAMED].concat();
        let mapped = Server::start(SIGNORINI, &arguments).await;
        let me = mapped.get("/v1/me").header("x-remote-user", "ada");
        assert_eq!(
            me.send().await.unwrap().status(),
            StatusCode::OK,
            "{proxies}"
        );
    }
    let me = async |users: &[&str]| -> (u16, Value) {
        let mut request = server.get("/v1/me");
        for user in users {
            request = request.header("x-remote-user", *user);
        }
        let response = request.send().await.unwrap();
        (response.status().as_u16(), response.json().await.unwrap())
    };
    let (status, ada) = me(&["ada"]).await;
    assert_eq!(
        (status, &ada["owner"], &ada["scopes"]),
        (200, &json!("ada"), &json!(["read", "submit", "cancel"]))
    );
    assert_eq!(me(&["root"]).await.1["scopes"].as_array().unwrap().len(), 4);
    // local is everybody on a service without tokens
    for wrong in [&[][..], &["ada", "root"], &["a b"], &[""], &["local"]] {
        assert_eq!(me(wrong).await.0, 401, "{wrong:?}");
    }
    // a user has no token, and is not told of one
    let pause = server
        .post("/v1/queue/pause")
        .header("x-remote-user", "ada");
    let refused: Value = pause.send().await.unwrap().json().await.unwrap();
    let detail = refused["detail"].as_str().unwrap();
    assert!(
        detail.contains("ada, whom the proxy names") && detail.contains("--proxy-scopes"),
        "{detail}"
    );
    // from elsewhere, and where the proxy is trusted for the address of clients only
    let elsewhere = [&["--trusted-proxy", "10.0.0.1"][..], &NAMED].concat();
    let elsewhere = Server::start(SIGNORINI, &elsewhere).await;
    let of_addresses = Server::start(
        SIGNORINI,
        &["--allow-unauthenticated", "--trusted-proxy", "127.0.0.1"],
    )
    .await;
    let forge = async |server: &Server| {
        let me = server.get("/v1/me").header("x-remote-user", "root");
        me.send().await.unwrap()
    };
    assert_eq!(forge(&elsewhere).await.status(), StatusCode::UNAUTHORIZED);
    let everybody: Value = forge(&of_addresses).await.json().await.unwrap();
    assert_eq!(everybody["owner"], "local");
    let first = json!({"name": "first", "owner": "boss", "scopes": ["admin"]});
    let created = of_addresses.post("/v1/tokens").json(&first).send().await;
    assert_eq!(created.unwrap().status(), StatusCode::CREATED);
    assert_eq!(
        forge(&of_addresses).await.status(),
        StatusCode::UNAUTHORIZED
    );
}
