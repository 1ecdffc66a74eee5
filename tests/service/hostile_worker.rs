//! Workers elsewhere that break the contract: what they send is refused, nothing of it is stored, and it is told.

use std::{process::Stdio, time::Duration};

use rpc::pb::worker::{self as pb, worker_service_client::WorkerServiceClient};
use serde_json::{Value, json};
use suite::{example_json, harness::Server};
use tokio::process::Command;
use tonic::{Code, Request, Status, transport::Channel};

use crate::{SIGNORINI, auth::create};

/// A worker that is played, with a secret of its own.
struct Played {
    client: WorkerServiceClient<Channel>,
    token: String,
    secret: Vec<u8>,
    number: u64,
}

impl Played {
    async fn new(server: &Server, token: &str, secret: &str) -> Played {
        Played {
            client: WorkerServiceClient::connect(server.url.clone())
                .await
                .unwrap(),
            token: token.to_owned(),
            secret: secret.repeat(16).into_bytes(),
            number: 0,
        }
    }

    fn request<T>(&self, message: T) -> Request<T> {
        let mut request = Request::new(message);
        let token = format!("Bearer {}", self.token).parse().unwrap();
        request.metadata_mut().insert("authorization", token);
        request
    }

    fn asking(&self) -> pb::LeaseRequest {
        pb::LeaseRequest {
            secret: self.secret.clone(),
            version: env!("CARGO_PKG_VERSION").into(),
            processor: vec!["avx2".into(), "fma".into()],
            name: "played".into(),
            slots: 1,
            cores: 1,
            memory_bytes: 1 << 40,
            free_bytes: 1 << 40,
            number: self.number,
            wait_s: 20.0,
            takes_none: false,
        }
    }

    async fn try_to_lease(
        &mut self,
        asking: pb::LeaseRequest,
    ) -> Result<Option<pb::LeasedJob>, Status> {
        let request = self.request(asking);
        Ok(self.client.lease(request).await?.into_inner().job)
    }

    async fn lease(&mut self) -> pb::LeasedJob {
        self.number += 1;
        self.try_to_lease(self.asking()).await.unwrap().unwrap()
    }

    async fn try_to_report(&mut self, report: pb::JobReport) -> Result<pb::JobAnswer, Status> {
        let request = self.request(pb::ReportRequest {
            secret: self.secret.clone(),
            jobs: vec![report],
            free_bytes: 0,
        });
        Ok(self
            .client
            .report(request)
            .await?
            .into_inner()
            .jobs
            .remove(0))
    }

    async fn report(&mut self, report: pb::JobReport) -> pb::JobAnswer {
        self.try_to_report(report).await.unwrap()
    }
}

/// An empty report of a leased job.
fn of(job: &pb::LeasedJob) -> pb::JobReport {
    pb::JobReport {
        id: job.id.clone(),
        attempt: job.attempt,
        session: job.session,
        ..pb::JobReport::default()
    }
}

fn piece(offset: u64, total: u64, data: Vec<u8>) -> Option<pb::Piece> {
    Some(pb::Piece {
        upload: 1,
        partial: false,
        total_bytes: total,
        sha256: vec![7; 32],
        offset,
        data,
    })
}

/// An end that says that the job has succeeded.
fn success() -> Vec<u8> {
    let ending = json!({
        "status": "succeeded", "reason": null, "failure": null, "result": "final",
        "overview": {"verdict": null, "quantities": [], "warnings": []},
    });
    let end = json!({"Solved": {"ending": ending, "unverified": false, "iterations": 3}});
    end.to_string().into_bytes()
}

/// A service whose jobs are solved elsewhere, with the tokens of an administrator and of a worker.
async fn service() -> (Server, String, String) {
    let server = Server::start_alone(SIGNORINI, &["--workers", "0", "--lease-s", "2"]).await;
    let token = |scope: &str| json!({"name": scope, "owner": "ada", "scopes": [scope]});
    let (_, admin) = create(&server, None, token("admin")).await;
    let (_, works) = create(&server, Some(&admin), token("work")).await;
    (server, admin, works)
}

async fn submit(server: &Server, admin: &str) -> String {
    let body = json!({"problem": example_json("rectangular_punch"), "cache": "off"});
    let response = server.post("/v1/jobs").bearer_auth(admin).json(&body);
    let job: Value = response.send().await.unwrap().json().await.unwrap();
    job["id"].as_str().unwrap().to_owned()
}

async fn get(server: &Server, admin: &str, path: &str) -> Value {
    let response = server.get(path).bearer_auth(admin).send().await.unwrap();
    response.json().await.unwrap()
}

/// An honest worker solves what is left; the job then has succeeded in this attempt, with a result of its own.
async fn solved_in_attempt(server: &Server, (admin, works): (&str, &str), id: &str, attempt: i64) {
    let honest = Command::new(SIGNORINI)
        .args([
            "worker",
            "--server",
            &server.url,
            "--idle-exit",
            "0.2s",
            "--slots",
            "1",
        ])
        .env("SIGNORINI_TOKEN", works)
        .stderr(Stdio::null())
        .status();
    let ended = tokio::time::timeout(Duration::from_secs(30), honest).await;
    assert!(ended.unwrap().unwrap().success());
    let job = get(server, admin, &format!("/v1/jobs/{id}")).await;
    assert_eq!(
        (&job["status"], &job["attempt"]),
        (&json!("succeeded"), &json!(attempt)),
        "{job:#}"
    );
    let result = get(server, admin, &format!("/v1/jobs/{id}/result")).await;
    assert!(
        result["summary"]["iterations"].as_u64().unwrap() > 3,
        "not what was told"
    );
}

#[tokio::test]
async fn a_worker_that_may_not_work_is_refused_with_the_reason() {
    let (server, admin, works) = service().await;
    let token = json!({"name": "submit", "owner": "eve", "scopes": ["submit", "read", "cancel"]});
    let (_, submits) = create(&server, Some(&admin), token).await;
    for (token, code) in [
        ("sgn_x", Code::Unauthenticated),
        (&*submits, Code::PermissionDenied),
    ] {
        let mut worker = Played::new(&server, token, "a").await;
        let asking = worker.asking();
        assert_eq!(worker.try_to_lease(asking).await.unwrap_err().code(), code);
        let report = worker.try_to_report(pb::JobReport::default()).await;
        assert_eq!(report.unwrap_err().code(), code);
    }
    let mut worker = Played::new(&server, &works, "a").await;
    let wrong = pb::LeaseRequest {
        secret: vec![1; 3],
        version: "0.0.1".into(),
        processor: vec![],
        name: "a\nb".into(),
        slots: 0,
        memory_bytes: 12,
        ..worker.asking()
    };
    let refused = worker.try_to_lease(wrong).await.unwrap_err();
    assert_eq!(refused.code(), Code::InvalidArgument);
    for told in [
        "its version is \"0.0.1\"",
        "avx2 and fma",
        "0 slots",
        "of memory, expected at least 1.0 MiB",
        "its name",
        "its secret",
    ] {
        assert!(
            refused.message().contains(told),
            "{told}: {}",
            refused.message()
        );
    }
}

#[tokio::test]
async fn a_worker_that_speaks_for_anothers_job_changes_nothing() {
    let (server, admin, works) = service().await;
    let id = submit(&server, &admin).await;
    let mut owner = Played::new(&server, &works, "a").await;
    let mut other = Played::new(&server, &works, "b").await;
    let job = owner.lease().await;
    let end = pb::JobReport {
        piece: piece(0, 3, b"abc".to_vec()),
        end: Some(success()),
        ..of(&job)
    };
    let answer = other.report(end.clone()).await;
    assert!(answer.over && answer.refused.unwrap().contains("is leased to worker_"));
    let fetching = other.request(pb::GetContentRequest {
        secret: other.secret.clone(),
        id: job.id.clone(),
        attempt: job.attempt,
        mesh: false,
        offset: 0,
    });
    let refused = other.client.get_content(fetching).await.unwrap_err();
    assert_eq!(refused.code(), Code::NotFound);
    // no attempt, and no job, that it was not given
    for (attempt, id) in [
        (7, job.id.clone()),
        (-1, job.id.clone()),
        (1, format!("job_{}", "0".repeat(32))),
    ] {
        let answer = owner
            .try_to_report(pb::JobReport {
                id,
                attempt,
                ..end.clone()
            })
            .await;
        let refused = answer.map(|answer| answer.refused.is_some());
        assert!(refused.unwrap_or(true));
    }
    // its lease ends after two seconds: what it tells after that is of an attempt that is over
    tokio::time::sleep(Duration::from_millis(2500)).await;
    let again = other.lease().await;
    assert_eq!((&again.id, again.attempt), (&job.id, 2));
    let answer = owner.report(end).await;
    assert!(answer.over && answer.refused.unwrap().contains("attempt 1 of job_"));
    let job = get(&server, &admin, &format!("/v1/jobs/{id}")).await;
    assert_eq!(job["status"], "running");
    let result = get(&server, &admin, &format!("/v1/jobs/{id}/result")).await;
    assert!(result.get("summary").is_none(), "{result:#}");
    drop(other);
    // its lease ends, too
    tokio::time::sleep(Duration::from_millis(2500)).await;
    solved_in_attempt(&server, (&admin, &works), &id, 3).await;
    assert!(server.log().contains("was refused"), "{}", server.log());
}

#[tokio::test]
async fn what_is_out_of_order_is_refused_and_the_worker_may_go_on() {
    let (server, admin, works) = service().await;
    submit(&server, &admin).await;
    let mut worker = Played::new(&server, &works, "a").await;
    let job = worker.lease().await;
    for (wrong, told) in [
        (
            pb::JobReport {
                first: 5,
                ..of(&job)
            },
            "reports from 5 on came after 0",
        ),
        (
            pb::JobReport {
                piece: piece(100, 200, vec![0; 50]),
                ..of(&job)
            },
            "byte 100 to 150 came after 0",
        ),
        (
            pb::JobReport {
                piece: piece(0, 20, vec![0; 50]),
                ..of(&job)
            },
            "byte 0 to 50",
        ),
        (
            pb::JobReport {
                end: Some(success()),
                ..of(&job)
            },
            "the result has not arrived",
        ),
    ] {
        let answer = worker.report(wrong).await;
        assert!(!answer.over);
        let refused = answer.refused.unwrap();
        assert!(refused.contains(told), "{refused}");
    }
    // it has its lease still, and may give the job back
    let back = pb::JobReport {
        end: Some(br#""GivenBack""#.to_vec()),
        ..of(&job)
    };
    assert!(worker.report(back).await.over);
    solved_in_attempt(&server, (&admin, &works), &job.id, 2).await;
}

#[tokio::test]
async fn a_worker_that_lies_loses_its_job_and_nothing_is_stored() {
    let (server, admin, works) = service().await;
    let event = |json: &str| vec![json.as_bytes().to_vec()];
    let iteration = r#"{"Event":{"type":"iteration","k":1,"residual":1e999}}"#;
    for (number, (report, told)) in [
        // 10 GiB: not a byte of it is waited for
        (
            pb::JobReport {
                piece: piece(0, 10 << 30, vec![0; 1000]),
                ..Default::default()
            },
            "announced a result of 10",
        ),
        (
            pb::JobReport {
                piece: piece(0, 1000, vec![0; 1000]),
                ..Default::default()
            },
            "SHA-256",
        ),
        (
            pb::JobReport {
                reports: event(iteration),
                ..Default::default()
            },
            "cannot be read",
        ),
        (
            pb::JobReport {
                reports: event(r#"{"Event":{"type":"done","status":"succeeded"}}"#),
                ..Default::default()
            },
            "sent a",
        ),
        (
            pb::JobReport {
                reports: vec![vec![b'['; 500_000]],
                ..Default::default()
            },
            "cannot be read",
        ),
        (
            pb::JobReport {
                end: Some(b"nonsense".to_vec()),
                ..Default::default()
            },
            "an end that cannot be read",
        ),
    ]
    .into_iter()
    .enumerate()
    {
        let id = submit(&server, &admin).await;
        let mut liar = Played::new(&server, &works, &format!("{number}")).await;
        let job = liar.lease().await;
        assert_eq!((&job.id, job.attempt), (&id, 1));
        let lie = pb::JobReport {
            id: job.id.clone(),
            attempt: job.attempt,
            session: job.session,
            ..report
        };
        let answer = liar.report(lie).await;
        let refused = answer.refused.unwrap_or_default();
        assert!(refused.contains(told), "{told}: {refused}");
        drop(liar);
        solved_in_attempt(&server, (&admin, &works), &id, 2).await;
    }
    // a message beyond the limit is not read at all
    let mut worker = Played::new(&server, &works, "z").await;
    let large = pb::JobReport {
        id: submit(&server, &admin).await,
        reports: vec![vec![b' '; 5 << 20]],
        ..Default::default()
    };
    let refused = worker.try_to_report(large).await.unwrap_err();
    assert_eq!(refused.code(), Code::OutOfRange, "{refused}");
    assert!(
        server.log().contains("is lost") || server.log().contains("died"),
        "{}",
        server.log()
    );
}
