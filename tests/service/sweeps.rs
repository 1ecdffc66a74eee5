//! Sweeps, over both protocols and from the command line.

use std::{collections::BTreeSet, process::Command};

use reqwest::{Method, StatusCode};
use rpc::pb;
use serde_json::{Value, json};
use suite::{
    example, example_json,
    harness::{Server, answer, block},
};
use tonic::Code;

use crate::{
    SIGNORINI,
    grpc::{connect, message},
    server,
};

const MU: &str = "/contacts/0/friction/coefficient";
const RHO: &str = "/contacts/0/friction/nonlocal_radius";

/// Two coefficients and three radii on the punch of 56 elements.
fn punch() -> Value {
    json!({
        "base": example_json("rectangular_punch"),
        "axes": [
            { "path": MU, "values": [0.1, 0.4] },
            { "path": RHO, "linspace": { "start": 0.01, "stop": 0.03, "count": 3 } },
        ],
        "name": "punch",
    })
}

/// So many members on a body of thousands of unknowns: seconds of work.
fn long(count: u32) -> Value {
    let values = json!({ "start": 0.02, "stop": 0.1, "count": count });
    json!({
        "base": block(60, 60),
        "axes": [{ "path": "/contacts/0/indentation", "linspace": values }],
    })
}

async fn post(server: &Server, sweep: &Value) -> Value {
    let (status, sweep) = answer(server.post("/v1/sweeps").json(sweep)).await;
    assert_eq!(status, StatusCode::ACCEPTED, "{sweep:#}");
    sweep
}

fn id(sweep: &Value) -> String {
    sweep["id"].as_str().unwrap().to_owned()
}

async fn until_done(server: &Server, id: &str) -> Value {
    for _ in 0..4 {
        let sweep = server.json(&format!("/v1/sweeps/{id}?wait=30")).await;
        if !["queued", "running"].contains(&sweep["status"].as_str().unwrap()) {
            return sweep;
        }
    }
    panic!("the sweep has not ended\n{}", server.log());
}

async fn rows(server: &Server, id: &str) -> Vec<Value> {
    let path = format!("/v1/sweeps/{id}/results?page_size=1000");
    server.json(&path).await["members"]
        .as_array()
        .unwrap()
        .clone()
}

/// The events after a number, to the end of the stream.
async fn events(server: &Server, id: &str, after: i64) -> Vec<Value> {
    let path = format!("/v1/sweeps/{id}/events?after_seq={after}");
    let request = server.get(&path).header("Accept", "application/jsonl");
    let response = request.send().await.unwrap();
    let text = response.text().await.unwrap_or_default();
    let lines = text.lines().map(|line| serde_json::from_str(line).unwrap());
    lines.collect()
}

fn violations(refused: &Value) -> Vec<(&str, &str)> {
    let all = refused["errors"].as_array().unwrap();
    all.iter()
        .map(|v| {
            (
                v["pointer"].as_str().unwrap(),
                v["reason"].as_str().unwrap(),
            )
        })
        .collect()
}

/// Operations: CreateSweep, GetSweep, ListSweepMembers, WatchSweep, CreateMemberJob
#[tokio::test]
async fn a_sweep_has_the_numbers_of_separate_jobs() {
    let server = server().await;
    let response = server
        .post("/v1/sweeps")
        .json(&punch())
        .send()
        .await
        .unwrap();
    assert_eq!(response.status(), StatusCode::ACCEPTED);
    let location = response.headers()["location"].to_str().unwrap().to_owned();
    let sweep: Value = response.json().await.unwrap();
    let id = id(&sweep);
    assert_eq!(location, format!("/v1/sweeps/{id}"));
    assert_eq!(
        (&sweep["jobs"], &sweep["members"]["total"]),
        (&json!(1), &json!(6))
    );
    let sweep = until_done(&server, &id).await;
    assert_eq!(
        (&sweep["status"], &sweep["members"]["succeeded"]),
        (&json!("succeeded"), &json!(6))
    );
    let rows = rows(&server, &id).await;
    assert_eq!(rows.len(), 6);
    for (number, row) in rows.iter().enumerate() {
        assert_eq!(row["number"], number);
        let mut problem = example_json("rectangular_punch");
        for path in [MU, RHO] {
            *problem.pointer_mut(path).unwrap() = row["parameters"][path].clone();
        }
        let alone = server.submit(&problem).await;
        server.until_done(&alone).await;
        let summary = &server.json(&format!("/v1/jobs/{alone}/result")).await["summary"];
        for force in ["normal_force", "tangential_force", "friction_force"] {
            let (own, other) = (
                row[force].as_f64().unwrap(),
                summary[force].as_f64().unwrap(),
            );
            assert!(
                (own - other).abs() <= 1e-9 * other.abs(),
                "{number} {force}: {own} {other}"
            );
        }
        let top = &summary["contacts"]["top"];
        let width = |name: &str| -> f64 {
            let parts = top[name].as_array().unwrap().iter();
            parts
                .map(|part| part[1].as_f64().unwrap() - part[0].as_f64().unwrap())
                .sum()
        };
        for (column, name) in [
            ("contact_width", "contact"),
            ("stick_width", "stick"),
            ("slip_width", "slip"),
        ] {
            assert!(
                (row[column].as_f64().unwrap() - width(name)).abs() < 1e-9,
                "{number} {column}"
            );
        }
        let peak = top["peak_tangential_stress"]["value"].as_f64().unwrap();
        let own = row["peak_tangential_stress"].as_f64().unwrap();
        assert!(
            (own - peak).abs() <= 1e-9 * peak.abs(),
            "{number}: {own} {peak}"
        );
        assert_eq!(row["status"], "succeeded");
        // the first and the last are solved with stated errors
        let verdict = &summary["accuracy"]["verdict"];
        let expected = if [0, 5].contains(&number) {
            verdict
        } else {
            &Value::Null
        };
        assert_eq!(&row["verdict"], expected, "{number}");
    }

    // a member as a job of its own, with everything that a job has
    let member = server.post(&format!("/v1/sweeps/{id}/members/4/job"));
    let (status, job) = answer(member.header("Prefer", "wait=30")).await;
    assert_eq!(
        (status, &job["name"]),
        (StatusCode::CREATED, &json!("punch #4"))
    );
    let job = job["id"].as_str().unwrap();
    let result = server.json(&format!("/v1/jobs/{job}/result")).await;
    let own = rows[4]["tangential_force"].as_f64().unwrap();
    let other = result["summary"]["tangential_force"].as_f64().unwrap();
    assert!((own - other).abs() <= 1e-9 * other.abs());
    server.json(&format!("/v1/jobs/{job}/profiles/top")).await;
    let (status, _) = answer(server.post(&format!("/v1/sweeps/{id}/members/6/job"))).await;
    assert_eq!(status, StatusCode::NOT_FOUND);

    // its job is an ordinary one, and found by the filter
    let jobs = server.json(&format!("/v1/jobs?sweep={id}")).await["jobs"].take();
    assert_eq!(
        (jobs.as_array().unwrap().len(), &jobs[0]["sweep"]),
        (1, &json!(id))
    );
    assert_eq!(
        (&jobs[0]["status"], &jobs[0]["name"]),
        (&json!("succeeded"), &json!("punch"))
    );
    // the worst of its members
    let verdicts = rows.iter().filter_map(|row| row["verdict"].as_str());
    let worst =
        verdicts.max_by_key(|verdict| ["good", "fair", "poor"].iter().position(|v| v == verdict));
    assert_eq!(jobs[0]["verdict"].as_str(), worst);
    let events = events(&server, &id, 0).await;
    assert!(events.iter().map(|e| e["seq"].as_i64().unwrap()).eq(1..=7));
    assert_eq!(
        (&events[0]["type"], &events[6]["type"]),
        (&json!("member"), &json!("done"))
    );
    assert_eq!(events[6]["sweep"]["status"], "succeeded");
}

/// Operations: CreateSweep, GetSweep, ListSweeps, ListSweepMembers, WatchSweep, CancelSweep, DeleteSweep, CreateMemberJob
#[tokio::test]
async fn a_sweep_over_grpc_equals_the_one_over_rest() {
    let server = server().await;
    let mut grpc = connect(&server).await;
    use pb::sweep_axis::Values;
    let axis = |path: &str, values| pb::SweepAxis {
        path: path.into(),
        values: Some(values),
    };
    let request = pb::CreateSweepRequest {
        base: Some(message(&example("rectangular_punch"))),
        axes: vec![
            axis(
                MU,
                Values::Numbers(pb::NumberList {
                    numbers: vec![0.1, 0.4],
                }),
            ),
            axis(
                RHO,
                Values::Linspace(pb::Spaced {
                    start: 0.01,
                    stop: 0.03,
                    count: 3,
                }),
            ),
        ],
        name: Some("punch".into()),
        request_id: Some("k".into()),
        ..Default::default()
    };
    let sweep = grpc
        .create_sweep(request.clone())
        .await
        .unwrap()
        .into_inner();
    let again = grpc.create_sweep(request).await.unwrap();
    assert_eq!(
        again.metadata().get("idempotency-replayed").unwrap(),
        "true"
    );
    assert_eq!(again.into_inner().id, sweep.id);
    let id = sweep.id;
    let got = pb::GetSweepRequest {
        id: id.clone(),
        wait: Some(30.0),
    };
    let sweep = grpc.get_sweep(got).await.unwrap().into_inner();
    assert_eq!(
        (sweep.status(), sweep.members.unwrap().succeeded),
        (pb::Status::Succeeded, 6)
    );
    let over_rest = server.json(&format!("/v1/sweeps/{id}")).await;
    assert_eq!(
        (
            over_rest["version"].as_str(),
            over_rest["paths"][1].as_str()
        ),
        (Some(&*sweep.version), Some(RHO))
    );

    let by_rest = rows(&server, &id).await;
    let mut stream = grpc
        .watch_sweep(pb::WatchSweepRequest {
            id: id.clone(),
            after_seq: 2,
        })
        .await
        .unwrap()
        .into_inner();
    let mut seqs = vec![];
    while let Some(event) = stream.message().await.unwrap() {
        seqs.push(event.seq);
        match event.payload.unwrap() {
            pb::sweep_event::Payload::Member(member) => {
                let row = &by_rest[member.number as usize];
                assert_eq!(row["tangential_force"].as_f64(), member.tangential_force);
                let own: f64 = member.parameters[MU].parse().unwrap();
                assert_eq!(row["parameters"][MU].as_f64(), Some(own));
            }
            pb::sweep_event::Payload::Done(done) => assert_eq!(done.id, id),
            pb::sweep_event::Payload::KeepAlive(_) => {}
        }
    }
    assert_eq!(seqs, [3, 4, 5, 6, 7]);
    let mut pages = vec![];
    let mut token = String::new();
    loop {
        let request = pb::ListSweepMembersRequest {
            id: id.clone(),
            page_size: 4,
            page_token: token,
        };
        let page = grpc.list_sweep_members(request).await.unwrap().into_inner();
        pages.push(page.members.len());
        token = page.next_page_token;
        if token.is_empty() {
            break;
        }
    }
    assert_eq!(pages, [4, 2]);
    let listed = grpc
        .list_sweeps(pb::ListSweepsRequest::default())
        .await
        .unwrap()
        .into_inner();
    assert_eq!(listed.sweeps.len(), 1);
    let job = pb::CreateMemberJobRequest {
        id: id.clone(),
        number: 5,
        request_id: None,
    };
    let job = grpc.create_member_job(job).await.unwrap().into_inner();
    assert_eq!((job.name.as_deref(), job.sweep), (Some("punch #5"), None));
    let canceled = grpc
        .cancel_sweep(pb::CancelSweepRequest { id: id.clone() })
        .await
        .unwrap()
        .into_inner();
    assert_eq!(canceled.status(), pb::Status::Succeeded, "it has ended");
    grpc.delete_sweep(pb::DeleteSweepRequest { id: id.clone() })
        .await
        .unwrap();
    let gone = grpc
        .get_sweep(pb::GetSweepRequest { id, wait: None })
        .await
        .unwrap_err();
    assert_eq!(gone.code(), Code::NotFound);

    // values of any type, and a faulty one at its place
    let obstacles = pb::JsonList {
        values: vec![r#"{"kind": "flat"}"#.into(), "{".into()],
    };
    let request = pb::CreateSweepRequest {
        base: Some(message(&example("rectangular_punch"))),
        axes: vec![axis("/contacts/0/obstacle", Values::Json(obstacles))],
        ..Default::default()
    };
    let refused = grpc.create_sweep(request).await.unwrap_err();
    assert!(
        refused.message().contains("/axes/0/values/1"),
        "{}",
        refused.message()
    );
}

/// Operations: CreateSweep, ListSweeps, ListSweepMembers
#[tokio::test]
async fn rows_come_in_pages_and_in_every_format_of_tables() {
    let server = server().await;
    let mut definition = punch();
    definition["axes"][1] = json!({ "path": "/contacts/0/obstacle", "values":
        [{ "kind": "flat", "from": 0, "to": 0.5 }, { "kind": "circle", "radius": 8, "from": 0, "to": 4 }] });
    let id = id(&post(&server, &definition).await);
    until_done(&server, &id).await;
    let path = format!("/v1/sweeps/{id}/results");
    let first = server.json(&format!("{path}?page_size=3")).await;
    let token = first["next_page_token"].as_str().unwrap();
    let second = server
        .json(&format!("{path}?page_size=3&page_token={token}"))
        .await;
    let numbers = |page: &Value| -> Vec<u64> {
        let rows = page["members"].as_array().unwrap().iter();
        rows.map(|row| row["number"].as_u64().unwrap()).collect()
    };
    assert_eq!(
        (numbers(&first), numbers(&second)),
        (vec![0, 1, 2], vec![3])
    );
    assert_eq!(second["next_page_token"], Value::Null);
    for (format, media) in [
        ("csv", "text/csv; charset=utf-8"),
        ("jsonl", "application/jsonl"),
        ("arrow", "application/vnd.apache.arrow.file"),
        ("npz", "application/x-npz"),
    ] {
        let response = server
            .get(&format!("{path}?format={format}"))
            .send()
            .await
            .unwrap();
        assert_eq!(
            (
                response.status(),
                response.headers()["content-type"].to_str().unwrap()
            ),
            (StatusCode::OK, media)
        );
        let (status, refused) =
            answer(server.get(&format!("{path}?format={format}&page_size=2"))).await;
        assert_eq!(
            (status, &refused["code"]),
            (StatusCode::BAD_REQUEST, &json!("bad-parameter"))
        );
    }
    let csv = server
        .get(&format!("{path}?format=csv"))
        .send()
        .await
        .unwrap()
        .text()
        .await
        .unwrap();
    assert_eq!(csv.lines().count(), 5);
    assert!(
        csv.lines()
            .nth(2)
            .unwrap()
            .contains(r#"""kind"":""circle"""#),
        "{csv}"
    );
    let (status, _) = answer(server.get(&format!("{path}?page_token=x"))).await;
    assert_eq!(status, StatusCode::BAD_REQUEST);
    post(&server, &punch()).await;
    let page = server.json("/v1/sweeps?page_size=1").await;
    let token = page["next_page_token"].as_str().unwrap();
    let next = server
        .json(&format!("/v1/sweeps?page_size=1&page_token={token}"))
        .await;
    assert_eq!(
        (&next["sweeps"][0]["id"], &next["next_page_token"]),
        (&json!(id), &Value::Null)
    );
}

/// Operations: CreateSweep
#[tokio::test]
async fn one_members_failure_is_a_row_and_not_the_end() {
    let server = server().await;
    // the second obstacle lies beside the body, which shows only on its mesh; the third body is held by nothing
    let definition = json!({
        "base": example_json("rectangular_punch"),
        "mode": "list",
        "points": [
            { "/contacts/0/obstacle": { "kind": "flat", "from": 90, "to": 91 } },
            { MU: 0.2 },
            { "/supports": [] },
            { "/solver": { "max_iterations": 1 } },
        ],
    });
    let sweep = post(&server, &definition).await;
    let id = id(&sweep);
    let sweep = until_done(&server, &id).await;
    assert_eq!(sweep["status"], "succeeded", "{sweep:#}");
    assert_eq!(
        (&sweep["members"]["succeeded"], &sweep["members"]["failed"]),
        (&json!(1), &json!(3))
    );
    let rows = rows(&server, &id).await;
    let reasons: Vec<_> = rows
        .iter()
        .map(|row| row["reason"].as_str().unwrap_or(""))
        .collect();
    assert_eq!(
        reasons,
        ["invalid_problem", "", "invalid_problem", "not_converged"]
    );
    assert_eq!(rows[0]["violations"][0]["reason"], "covers_nothing");
    // no numbers of a state that is no solution, but what tells how far it came
    for row in [&rows[0], &rows[2], &rows[3]] {
        assert!(
            row["normal_force"].is_null() && row["contact_width"].is_null(),
            "{row:#}"
        );
    }
    assert!(rows[3]["iterations"].as_u64().unwrap() > 0);
    assert!(rows[3]["residuals"].is_object() && rows[1]["normal_force"].as_f64().unwrap() > 0.0);
}

/// Operations: CreateSweep
#[tokio::test]
async fn everything_invalid_is_reported_before_anything_is_stored() {
    let server = server().await;
    let refused = async |body: Value| {
        let (status, refused) = answer(server.post("/v1/sweeps").json(&body)).await;
        assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY, "{refused:#}");
        refused
    };
    let mut broken = punch();
    broken["base"]["materials"][0]["poissons_ratio"] = json!(0.7);
    broken["axes"][0]["values"] = json!([0.1, -1, "x"]);
    broken["priority"] = json!(99);
    let found = refused(broken).await;
    let found: BTreeSet<(&str, &str)> = violations(&found).into_iter().collect();
    let expected = [
        ("/axes/0/values/1", "out_of_range"),
        ("/axes/0/values/2", "wrong_type"),
        ("/base/materials/0/poissons_ratio", "out_of_range"),
        ("/priority", "out_of_range"),
    ];
    assert_eq!(found, expected.into());
    let found = refused(json!({ "axis": [], "limits": { "timeout_s": "x" } })).await;
    let found: BTreeSet<&str> = violations(&found).into_iter().map(|(at, _)| at).collect();
    assert_eq!(found, ["/axis", "/base", "/limits/timeout_s"].into());
    // what is of the right structure is checked for what it means
    let found = refused(json!({ "base": punch()["base"], "points": [] })).await;
    assert_eq!(violations(&found), [("/points", "not_used")]);
    let found = refused(json!({ "base": punch()["base"] })).await;
    assert_eq!(violations(&found), [("/axes", "missing")]);

    // limits: members, values, depth
    let many = json!({ "start": 0.1, "stop": 0.2, "count": 101 });
    let mut grid = punch();
    grid["axes"][0] = json!({ "path": MU, "linspace": many });
    grid["axes"][1]["linspace"]["count"] = json!(100);
    assert_eq!(violations(&refused(grid).await), [("/axes", "too_many")]);
    let mut values = punch();
    values["axes"][0]["values"] = (0..10_001).map(|n| json!(n)).collect();
    assert_eq!(
        violations(&refused(values).await),
        [("/axes/0/values", "too_many")]
    );
    let mut deep = punch();
    for (path, reason) in [
        ("/contacts/0".repeat(20), "unknown_name"),
        ("/contacts/0".repeat(1000), "too_long"),
    ] {
        deep["axes"][0]["path"] = json!(path);
        assert_eq!(
            violations(&refused(deep.clone()).await),
            [("/axes/0/path", reason)]
        );
    }
    let nested = format!(
        r#"{{"base": {}, "axes": {}1{}}}"#,
        example("sheet"),
        "[".repeat(70),
        "]".repeat(70)
    );
    let request = server
        .post("/v1/sweeps")
        .header("Content-Type", "application/json")
        .body(nested);
    let (status, answered) = answer(request).await;
    assert_eq!(
        (status, &answered["code"]),
        (StatusCode::BAD_REQUEST, &json!("malformed-json"))
    );
    let large = server
        .post("/v1/sweeps")
        .header("Content-Type", "application/json")
        .body(vec![b' '; (16 << 20) + 1]);
    let (status, _) = answer(large).await;
    assert_eq!(status, StatusCode::PAYLOAD_TOO_LARGE);
    assert_eq!(server.json("/v1/sweeps").await["sweeps"], json!([]));
    assert_eq!(server.json("/v1/jobs/count").await["total"], 0);
}

/// A large mesh is read once and not for each of a thousand members; thousands of bodies with it are refused.
/// Operations: CreateSweep
#[tokio::test]
async fn a_large_base_is_not_copied_for_each_member() {
    let server = server().await;
    let mut base = block(2, 2);
    base["title"] = json!("x".repeat(60_000));
    let axis = json!({ "path": MU, "linspace": { "start": 0.1, "stop": 0.3, "count": 1000 } });
    let before = server.memory("VmHWM");
    let (status, accepted) = answer(
        server
            .post("/v1/sweeps")
            .json(&json!({ "base": base, "axes": [axis] })),
    )
    .await;
    assert_eq!(status, StatusCode::ACCEPTED, "{accepted:#}");
    assert!(server.memory("VmHWM") < before + (200 << 20));
    until_done(&server, &id(&accepted)).await;
    base["title"] = json!("x".repeat(70_000));
    let (status, refused) = answer(
        server
            .post("/v1/sweeps")
            .json(&json!({ "base": base, "axes": [axis] })),
    )
    .await;
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
    assert_eq!(violations(&refused), [("/axes", "too_large")]);
}

/// Operations: CreateSweep, GetSweep
#[tokio::test]
async fn a_repeated_key_gives_the_same_sweep_and_members_on_other_bodies_other_jobs() {
    let server = server().await;
    let mut definition = punch();
    definition["axes"][0] =
        json!({ "path": "/materials/0/youngs_modulus", "values": [1000, 2000] });
    let post = async |body: &Value, key: &str| {
        let request = server.post("/v1/sweeps").header("Idempotency-Key", key);
        let response = request.json(body).send().await.unwrap();
        let replayed = response.headers().contains_key("idempotency-replayed");
        (
            response.status(),
            replayed,
            response.json::<Value>().await.unwrap(),
        )
    };
    let (status, replayed, first) = post(&definition, "k").await;
    assert_eq!(
        (status, replayed, &first["jobs"]),
        (StatusCode::ACCEPTED, false, &json!(2))
    );
    let sweep = until_done(&server, &id(&first)).await;
    assert_eq!(sweep["members"]["succeeded"], 6);
    let (status, replayed, again) = post(&definition, "k").await;
    assert_eq!(
        (status, replayed, &again["id"]),
        (StatusCode::ACCEPTED, true, &first["id"])
    );
    let (status, _, refused) = post(&punch(), "k").await;
    assert_eq!(
        (status, &refused["code"]),
        (
            StatusCode::UNPROCESSABLE_ENTITY,
            &json!("idempotency-key-reuse")
        )
    );
    assert_eq!(server.json("/v1/jobs/count").await["total"], 2);

    // twice the modulus, twice the forces
    let rows = rows(&server, &id(&first)).await;
    let force = |n: usize| rows[n]["normal_force"].as_f64().unwrap();
    assert!((force(3) / force(0) - 2.0).abs() < 1e-9);
    let tag = format!("\"{}\"", sweep["version"].as_str().unwrap());
    let request = server
        .get(&format!("/v1/sweeps/{}", id(&first)))
        .header("If-None-Match", tag);
    assert_eq!(
        request.send().await.unwrap().status(),
        StatusCode::NOT_MODIFIED
    );
}

/// Operations: CancelSweep, DeleteSweep
#[tokio::test]
async fn a_canceled_sweep_keeps_its_rows_and_a_deleted_one_is_gone() {
    let server = Server::start_alone(SIGNORINI, &["--workers", "1"]).await;
    let id = id(&post(&server, &long(5000)).await);
    let path = format!("/v1/sweeps/{id}");
    loop {
        if server.json(&path).await["members"]["succeeded"]
            .as_u64()
            .unwrap()
            > 0
        {
            break;
        }
    }
    let (status, refused) = answer(server.request(Method::DELETE, &path)).await;
    assert_eq!(
        (status, &refused["code"]),
        (StatusCode::CONFLICT, &json!("job-active"))
    );
    let (status, _) = answer(server.post(&format!("{path}/cancel"))).await;
    assert_eq!(status, StatusCode::OK);
    let sweep = until_done(&server, &id).await;
    assert_eq!(sweep["status"], "canceled");
    let counts = &sweep["members"];
    let succeeded = counts["succeeded"].as_u64().unwrap();
    assert_eq!(
        succeeded + counts["canceled"].as_u64().unwrap(),
        5000,
        "{counts}"
    );
    let rows = rows(&server, &id).await;
    assert_eq!(
        (&rows[0]["status"], &rows[0]["reason"]),
        (&json!("succeeded"), &Value::Null)
    );
    let last = server.json(&format!("{path}/results?page_size=1000")).await;
    assert_eq!(last["members"].as_array().unwrap().len(), 1000);
    let events = events(&server, &id, 0).await;
    assert_eq!(
        events.len() as u64,
        succeeded + 1,
        "those that were not reached have no event"
    );
    let deleted = server.delete(&path).send().await.unwrap();
    assert_eq!(deleted.status(), StatusCode::NO_CONTENT);
    assert_eq!(
        server.get(&path).send().await.unwrap().status(),
        StatusCode::GONE
    );
    assert_eq!(server.json("/v1/jobs/count").await["total"], 0);
    // its worker is free
    let next = server.submit(&example_json("sheet")).await;
    assert_eq!(server.until_done(&next).await["status"], "succeeded");
}

/// Members that share a body are divided among the workers, and have the same bits as from one of them.
#[tokio::test]
async fn a_large_sweep_is_divided_among_workers_and_has_the_same_rows() {
    let linspace =
        |start: f64, stop: f64, count: u32| json!({ "start": start, "stop": stop, "count": count });
    let sweep = json!({
        "base": example_json("rectangular_punch"),
        "axes": [
            { "path": MU, "linspace": linspace(0.05, 0.6, 25) },
            { "path": RHO, "linspace": linspace(0.01, 0.03, 40) },
        ],
    });
    let mut found = vec![];
    for (workers, pieces) in [("1", 1), ("2", 2)] {
        let server = Server::start_alone(SIGNORINI, &["--workers", workers]).await;
        let id = id(&post(&server, &sweep).await);
        let done = until_done(&server, &id).await;
        assert_eq!(
            (&done["status"], &done["jobs"]),
            (&json!("succeeded"), &json!(pieces))
        );
        found.push(rows(&server, &id).await);
    }
    assert_eq!(found[0].len(), 1000);
    // the 13 lines of the first piece, whose length is 40, end at a member that starts from another line
    for (alone, divided) in found[0].iter().zip(&found[1]) {
        assert_eq!(alone, divided);
    }
}

/// Operations: WatchSweep
#[tokio::test]
async fn a_restart_in_the_middle_repeats_no_member_and_no_event() {
    for isolation in ["thread", "process"] {
        let arguments = ["--workers", "1", "--isolation", isolation];
        let mut server = Server::start_alone(SIGNORINI, &arguments).await;
        let id = id(&post(&server, &long(300)).await);
        let path = format!("/v1/sweeps/{id}");
        let before = loop {
            let done = server.json(&path).await["members"]["succeeded"]
                .as_u64()
                .unwrap();
            if done > 20 {
                break done;
            }
        };
        server.kill().await;
        server.restart().await;
        let path = format!("/v1/sweeps/{id}");
        let kept = server.json(&path).await["members"]["succeeded"]
            .as_u64()
            .unwrap();
        assert!(kept >= before, "{kept} {before}");
        // from where a client was, live to the end
        let resumed = events(&server, &id, before as i64).await;
        let seqs: Vec<i64> = resumed.iter().map(|e| e["seq"].as_i64().unwrap()).collect();
        assert!(seqs.iter().copied().eq(before as i64 + 1..=301), "{seqs:?}");
        let all = events(&server, &id, 0).await;
        let numbers: BTreeSet<u64> = all
            .iter()
            .filter_map(|e| e["member"]["number"].as_u64())
            .collect();
        assert_eq!((all.len(), numbers.len()), (301, 300));
        assert_eq!(all[before as usize..], resumed[..]);
        let sweep = until_done(&server, &id).await;
        assert_eq!(
            (&sweep["status"], &sweep["members"]["succeeded"]),
            (&json!("succeeded"), &json!(300))
        );
        let gone = server
            .get(&format!("{path}/events?after_seq=301"))
            .send()
            .await
            .unwrap();
        assert_eq!(gone.status(), StatusCode::NO_CONTENT);
    }
}

fn command(definition: &Value, arguments: &[&str]) -> std::process::Output {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sweep.json");
    std::fs::write(&file, definition.to_string()).unwrap();
    std::fs::write(
        folder.path().join("punch.json"),
        example("rectangular_punch"),
    )
    .unwrap();
    Command::new(SIGNORINI)
        .arg("sweep")
        .arg(&file)
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn the_command_solves_a_sweep_without_a_server() {
    let output = command(&punch(), &[]);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let csv = String::from_utf8(output.stdout).unwrap();
    assert_eq!(csv.lines().count(), 7);
    assert!(String::from_utf8_lossy(&output.stderr).contains("6 of 6 members"));

    let mut by_path = punch();
    by_path["base"] = json!("punch.json");
    let output = command(&by_path, &["-o", "-"]);
    let rows: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (rows.as_array().unwrap().len(), &rows[5]["parameters"][RHO]),
        (6, &json!(0.03))
    );

    let mut wrong = punch();
    wrong["axes"][0]["values"] = json!([-1]);
    let output = command(&wrong, &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("/axes/0/values/0"));
    assert_eq!(command(&punch(), &["-o", "x.vtu"]).status.code(), Some(2));

    let mut some_fail = punch();
    some_fail["axes"][0] = json!({ "path": "/solver", "values": [{ "max_iterations": 1 }, {}] });
    let output = command(&some_fail, &["-o", "-"]);
    assert_eq!(output.status.code(), Some(9));
    let rows: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (&rows[0]["reason"], &rows[5]["status"]),
        (&json!("not_converged"), &json!("succeeded"))
    );
}

/// The command and the service give the same table, and the examples are sweeps.
#[tokio::test]
async fn the_examples_are_solved() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/sweeps");
    let table = |name: &str| {
        let file = format!("{folder}/{name}.json");
        let output = Command::new(SIGNORINI)
            .args(["sweep", &file, "-o", "-"])
            .output()
            .unwrap();
        assert_eq!(
            output.status.code(),
            Some(0),
            "{name}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let peaks = table("rectangular_punch");
    let peak = |n: usize| peaks[n]["peak_tangential_stress"].as_f64().unwrap();
    // the larger ρ, the lower the peak: thesis figure 4.3
    assert!(peak(1) > peak(2) && peak(2) > peak(3) && peak(3) > peak(4));
    assert_eq!(table("stick_width").as_array().unwrap().len(), 100);
    let server = server().await;
    let text = std::fs::read_to_string(format!("{folder}/tangential_force.json")).unwrap();
    let id = id(&post(&server, &serde_json::from_str(&text).unwrap()).await);
    until_done(&server, &id).await;
    let by_command = table("tangential_force");
    assert_eq!(&rows(&server, &id).await, by_command.as_array().unwrap());
}
