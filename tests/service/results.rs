//! Results of a job: /result, /history, /profiles/{boundary}, /fields.

use reqwest::StatusCode;
use rpc::pb;
use serde_json::{Value, json};
use suite::{
    example_json,
    harness::{Server, block, large},
};

use crate::{SIGNORINI, server};

/// Operations: GetResult, GetProfile, StreamResult
#[tokio::test]
async fn a_result_has_its_summary_profiles_and_fields() {
    let server = server().await;
    let id = server.submit(&example_json("rectangular_punch")).await;
    server.until_done(&id).await;
    let result = server.json(&format!("/v1/jobs/{id}/result")).await;
    let summary = &result["summary"];
    assert_eq!(
        (
            &result["result_available"],
            &summary["converged"],
            &result["steps"]
        ),
        (&json!("final"), &json!(true), &json!([]))
    );
    // Thesis 4.1(i) on the coarse grid: T = +14.17.
    assert!((summary["tangential_force"].as_f64().unwrap() - 14.17).abs() < 0.01);
    for name in ["digest", "input_hash"] {
        assert!(summary[name].as_str().unwrap().starts_with("sha256:"));
    }
    for phase in [
        "parse", "mesh", "assemble", "order", "factor", "condense", "iterate", "recover",
    ] {
        assert!(
            summary["timings"][phase].as_f64().unwrap() >= 0.0,
            "{phase}"
        );
    }

    let profile = server.json(&format!("/v1/jobs/{id}/profiles/top")).await;
    let s = profile["s"].as_array().unwrap();
    assert!(s.is_sorted_by(|a, b| a.as_f64() < b.as_f64()));
    assert_eq!(profile.as_object().unwrap().len(), 12);

    let csv = server
        .get(&format!("/v1/jobs/{id}/profiles/top?format=csv"))
        .send()
        .await
        .unwrap();
    assert!(
        csv.headers()["content-type"]
            .to_str()
            .unwrap()
            .starts_with("text/csv")
    );
    let csv = csv.text().await.unwrap();
    let accepted = server
        .get(&format!("/v1/jobs/{id}/profiles/top"))
        .header("Accept", "text/csv")
        .send()
        .await
        .unwrap();
    assert_eq!(csv, accepted.text().await.unwrap());
    assert_eq!(csv.lines().count(), s.len() + 1);
    // every number is read back bit-identically
    let column = csv
        .lines()
        .next()
        .unwrap()
        .split(',')
        .position(|name| name == "normal_stress")
        .unwrap();
    for (line, value) in csv
        .lines()
        .skip(1)
        .zip(profile["normal_stress"].as_array().unwrap())
    {
        assert_eq!(
            line.split(',').nth(column).unwrap().parse::<f64>().unwrap(),
            value.as_f64().unwrap()
        );
    }

    let fields = server
        .json(&format!("/v1/jobs/{id}/fields?format=json"))
        .await;
    let nodes = fields["x"].as_array().unwrap().len();
    assert!(nodes > 100 && fields["stress_zz"].as_array().unwrap().len() == nodes);
    let profile = server
        .json(&format!("/v1/jobs/{id}/profiles/top?points=nodes"))
        .await;
    // the contact state of the profile's nodes is also in the fields, and that of no other node
    let states = fields["contact_state"].as_array().unwrap();
    assert_eq!(states.len(), nodes);
    let count = |state: i64| states.iter().filter(|s| s.as_i64() == Some(state)).count();
    let found = |state: &str| {
        let states = profile["state"].as_array().unwrap();
        states.iter().filter(|s| s.as_str() == Some(state)).count()
    };
    assert_eq!(
        [count(0), count(1), count(2)],
        [found("open"), found("stick"), found("slip")]
    );
}

/// Operations: ListIterations, GetProfile, StreamResult
#[tokio::test]
async fn every_format_has_its_type_its_name_and_its_first_bytes() {
    let server = server().await;
    let id = server.submit(&example_json("rectangular_punch")).await;
    server.until_done(&id).await;
    let tables: [(&str, &str, &[u8]); 5] = [
        ("json", "application/json", b""),
        ("csv", "text/csv; charset=utf-8", b""),
        ("jsonl", "application/jsonl", b"{\""),
        ("arrow", "application/vnd.apache.arrow.file", b"ARROW1\0\0"),
        ("npz", "application/x-npz", b"PK\x03\x04"),
    ];
    let fields: [(&str, &str, &[u8]); 3] = [
        ("vtu", "application/vnd.vtk.unstructuredgrid+xml", b"<?xml"),
        ("npz", "application/x-npz", b"PK\x03\x04"),
        ("json", "application/json", b"{\"x\":"),
    ];
    for (part, file, formats) in [
        ("profiles/top", "profile.top", &tables[..]),
        ("history", "history", &tables[..]),
        ("fields", "fields", &fields[..]),
    ] {
        for (n, (format, media, start)) in formats.iter().enumerate() {
            let path = format!("/v1/jobs/{id}/{part}");
            let asked = server.get(&format!("{path}?format={format}"));
            let asked = asked.header("Accept", "image/png").send().await.unwrap();
            assert_eq!(asked.status(), StatusCode::OK, "{part} {format}");
            assert_eq!(asked.headers()["content-type"], media);
            assert_eq!(
                asked.headers()["content-disposition"],
                format!("attachment; filename=\"{id}.{file}.{format}\"")
            );
            let body = asked.bytes().await.unwrap();
            assert!(body.starts_with(start), "{part} {format}");
            let essence = media.split(';').next().unwrap();
            let accepted = server.get(&path).header("Accept", essence);
            assert_eq!(accepted.send().await.unwrap().bytes().await.unwrap(), body);
            if n == 0 {
                let default = server.get(&path).send().await.unwrap();
                assert_eq!(default.bytes().await.unwrap(), body, "{part}");
            }
        }
    }
}

/// Operations: ListIterations
#[tokio::test]
async fn a_history_has_the_rows_of_the_events_and_at_most_the_requested_number() {
    let server = server().await;
    let id = server.submit(&example_json("rectangular_punch")).await;
    server.until_done(&id).await;
    let history = server.json(&format!("/v1/jobs/{id}/history")).await;
    let rows = history.as_array().unwrap();
    let mut events = server.events(&id, 0).await.rest().await;
    events.retain(|event| event["type"] == "iteration");
    assert!(rows.len() > 4);
    assert_eq!(rows.len(), events.len());
    for (row, event) in rows.iter().zip(&events) {
        for (name, value) in row.as_object().unwrap() {
            assert_eq!(value, &event[name], "{name}");
        }
    }
    let few = server
        .json(&format!("/v1/jobs/{id}/history?max_points=3"))
        .await;
    let few = few.as_array().unwrap();
    assert_eq!(few.len(), 3);
    assert_eq!((&few[0], &few[2]), (&rows[0], &rows[rows.len() - 1]));
    let csv = server.get(&format!("/v1/jobs/{id}/history?format=csv&max_points=2"));
    let csv = csv.send().await.unwrap().text().await.unwrap();
    assert!(
        csv.starts_with("k,stage,") && csv.lines().count() == 3,
        "{csv}"
    );
    for wrong in ["1", "-3", "many"] {
        let refused = server.get(&format!("/v1/jobs/{id}/history?max_points={wrong}"));
        let refused = refused.send().await.unwrap();
        assert_eq!(refused.status(), StatusCode::BAD_REQUEST, "{wrong}");
    }
}

/// Operations: ListIterations
#[tokio::test]
async fn a_job_without_a_result_has_the_history_of_its_events_so_far() {
    let server = suite::harness::Server::start_alone(SIGNORINI, &["--workers", "1"]).await;
    let running = server.submit(&large()).await;
    let waiting = server.submit(&example_json("sheet")).await;
    server.until(&running, |e| e["type"] == "iteration").await;
    let so_far = server.json(&format!("/v1/jobs/{running}/history")).await;
    assert_eq!(so_far[0]["k"], 1);
    let none = server.json(&format!("/v1/jobs/{waiting}/history")).await;
    assert_eq!(none, json!([]));
    server.cancel(&running).await;
    server.until_done(&running).await;
    let kept = format!("/v1/jobs/{running}/history?partial=true");
    let kept = server.json(&kept).await;
    assert!(kept.as_array().unwrap().len() >= so_far.as_array().unwrap().len());
}

/// Operations: ListIterations, GetProfile, StreamResult
#[tokio::test]
async fn an_unknown_name_is_rejected_with_the_known_ones() {
    let server = server().await;
    let id = server.submit(&example_json("rectangular_punch")).await;
    server.until_done(&id).await;
    let other = server
        .get(&format!("/v1/jobs/{id}/profiles/left"))
        .send()
        .await
        .unwrap();
    assert_eq!(other.status(), StatusCode::NOT_FOUND);
    assert!(other.text().await.unwrap().contains("it has: top"));
    for (path, available) in [
        ("profiles/top?format=xml", "json, csv, jsonl, arrow, npz"),
        ("history?format=vtu", "json, csv, jsonl, arrow, npz"),
        ("fields?format=csv", "vtu, npz, json"),
    ] {
        let other = server
            .get(&format!("/v1/jobs/{id}/{path}"))
            .send()
            .await
            .unwrap();
        assert_eq!(other.status(), StatusCode::NOT_ACCEPTABLE, "{path}");
        assert!(other.text().await.unwrap().contains(available), "{path}");
    }
}

/// Operations: GetResult
#[tokio::test]
async fn there_is_no_result_before_the_end_or_after_an_end_without_one() {
    let server = suite::harness::Server::start_alone(SIGNORINI, &["--workers", "1"]).await;
    let front = server.submit(&large()).await;
    let waiting = server.submit(&example_json("sheet")).await;
    for id in [&front, &waiting] {
        let early = server
            .get(&format!("/v1/jobs/{id}/result"))
            .send()
            .await
            .unwrap();
        assert_eq!(early.status(), StatusCode::CONFLICT);
        assert_eq!(
            early.json::<Value>().await.unwrap()["code"],
            "result-not-ready"
        );
    }
    server.cancel(&waiting).await;
    let never = server
        .get(&format!("/v1/jobs/{waiting}/result"))
        .send()
        .await
        .unwrap();
    assert_eq!(never.status(), StatusCode::NOT_FOUND);
    assert_eq!(never.json::<Value>().await.unwrap()["code"], "no-result");
}

/// The name and the number of a load step select the same one.
/// Operations: GetResult, GetProfile
#[tokio::test]
async fn load_steps_without_names_are_numbered_from_0() {
    let server = server().await;
    let mut problem = example_json("rectangular_punch");
    problem["steps"] = json!([{ "indentation": 0.5 }, { "name": "0" }, { "indentation": 0.8 }]);
    let id = server.submit(&problem).await;
    server.until_done(&id).await;
    let at = |what: &str| format!("/v1/jobs/{id}/{what}");
    let result = server.json(&at("result")).await;
    let names: Vec<_> = result["steps"]
        .as_array()
        .unwrap()
        .iter()
        .map(|step| step["name"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["0", "0", "2"]);
    let force = async |step: &str| {
        let profile = server.json(&at(&format!("profiles/top?step={step}"))).await;
        let stress = profile["normal_stress"].as_array().unwrap();
        stress
            .iter()
            .map(|s| s.as_f64().unwrap())
            .sum::<f64>()
            .abs()
    };
    let forces = [force("0").await, force("1").await, force("2").await];
    assert!(forces[0] < forces[2] && forces[2] < forces[1], "{forces:?}");
}

/// Load steps: while the second runs, the results of the first are available.
/// Operations: GetResult
#[tokio::test]
async fn finished_load_steps_of_a_running_job_are_served() {
    let server = Server::start_alone(SIGNORINI, &["--workers", "1"]).await;
    let mut problem = block(100, 100);
    problem["contacts"][0]["friction"]["history"] = json!("incremental");
    problem["contacts"][0]["tangential_displacement"] = json!(0.01);
    problem["steps"] = json!([
        { "name": "indent" },
        { "name": "drag", "tangential_displacement": 1, "increments": 400 },
    ]);
    let id = server.submit(&problem).await;
    // an iteration of the second step comes after the first step was stored
    server
        .until(&id, |event| {
            event["type"] == "iteration" && event["step"] == 1
        })
        .await;
    let job = server.job(&id).await;
    assert_eq!(
        (&job["status"], &job["result_available"]),
        (&json!("running"), &json!("partial"))
    );
    let at = |what: &str| format!("/v1/jobs/{id}/{what}");
    let result = server.json(&at("result")).await;
    let steps = result["steps"].as_array().unwrap();
    assert_eq!((steps.len(), &steps[0]["name"]), (1, &json!("indent")));
    // the step has converged, and the whole is not finished
    let summary = &result["summary"];
    assert_eq!(
        [
            &result["result_available"],
            &summary["outcome"],
            &summary["converged"]
        ],
        [&json!("partial"), &json!("unfinished"), &json!(false)]
    );
    assert_eq!(steps[0]["summary"]["converged"], true);
    let first = result["summary"]["normal_force"].as_f64().unwrap();
    assert!(first > 0.0);
    let profile = server.json(&at("profiles/top?step=indent")).await;
    assert_eq!(profile, server.json(&at("profiles/top")).await);
    let rows = server.json(&at("history")).await;
    assert!(rows.as_array().unwrap().len() > 1);
    let fields = server.get(&at("fields")).send().await.unwrap();
    assert_eq!(fields.status(), StatusCode::CONFLICT);
    let plot = server.get(&at("plots/profile.svg")).send().await.unwrap();
    assert_eq!(plot.status(), StatusCode::OK);
    let plot = server.get(&at("plots/deformed.svg")).send().await.unwrap();
    assert_eq!(plot.status(), StatusCode::CONFLICT);
    // and is kept if the job does not finish
    server.cancel(&id).await;
    let done = server.until_done(&id).await;
    assert_eq!(
        (&done["status"], &done["result_available"]),
        (&json!("canceled"), &json!("partial"))
    );
    let result = server.json(&at("result")).await;
    assert_eq!(result["steps"][0]["summary"]["normal_force"], first);
    assert_eq!(result["result_available"], "partial");
}

/// Operations: GetProfile
#[tokio::test]
async fn a_profile_is_given_at_all_points_at_nodes_at_friction_points_or_at_any_number() {
    let server = server().await;
    let mut grpc = crate::grpc::connect(&server).await;
    let id = server.submit(&example_json("rectangular_punch")).await;
    server.until_done(&id).await;
    let at = |points: &str| format!("/v1/jobs/{id}/profiles/top?points={points}");
    let count = |profile: &Value| profile["s"].as_array().unwrap().len();
    let nodes = server.json(&at("nodes")).await;
    let all = server.json(&at("all")).await;
    assert_eq!(
        all,
        server.json(&format!("/v1/jobs/{id}/profiles/top")).await
    );
    // it holds the peaks
    let result = server.json(&format!("/v1/jobs/{id}/result")).await;
    for name in ["normal_stress", "tangential_stress"] {
        let sizes = all[name].as_array().unwrap().iter();
        let largest = sizes.map(|v| v.as_f64().unwrap().abs()).fold(0.0, f64::max);
        let peak = &result["summary"]["contacts"]["top"][format!("peak_{name}")];
        assert_eq!(peak["value"].as_f64().unwrap().abs(), largest, "{name}");
    }
    let friction = server.json(&at("friction")).await;
    assert_eq!(
        count(&friction),
        (count(&nodes) - 1) / 2 * 3,
        "three an edge"
    );
    let spaced = server.json(&at("101")).await;
    assert_eq!(count(&spaced), 101);
    for name in ["s", "normal_stress", "tangential_stress"] {
        let (first, last) = (count(&nodes) - 1, 100);
        assert_eq!(nodes[name][0], spaced[name][0], "{name}");
        assert_eq!(nodes[name][first], spaced[name][last], "{name}");
    }
    for (points, same) in [
        ("all", &all),
        ("nodes", &nodes),
        ("friction", &friction),
        ("101", &spaced),
    ] {
        let request = pb::GetProfileRequest {
            id: id.clone(),
            boundary: "top".into(),
            points: Some(points.into()),
            ..Default::default()
        };
        let over_grpc = grpc.get_profile(request).await.unwrap().into_inner();
        assert_eq!(
            same["tangential_stress"],
            json!(over_grpc.tangential_stress)
        );
    }
    for bad in ["1", "100001", "corners", "-3"] {
        let response = server.get(&at(bad)).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::BAD_REQUEST, "{bad}");
    }
}
