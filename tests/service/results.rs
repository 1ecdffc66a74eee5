//! What a job has found: /result, /profiles/{boundary}, /fields.

use reqwest::StatusCode;
use serde_json::{Value, json};
use suite::{example_json, harness::large};

use crate::{SIGNORINI, server};

#[tokio::test]
async fn a_result_has_its_summary_profiles_and_fields() {
    let server = server().await;
    let id = server.submit(&example_json("rectangular_punch")).await;
    server.until_done(&id).await;
    let result = server.json(&format!("/v1/jobs/{id}/result")).await;
    let summary = &result["summary"];
    assert_eq!(
        (&summary["converged"], &result["steps"]),
        (&json!(true), &json!([]))
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
    // Every number reads back as the very same.
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

    let fields = server.json(&format!("/v1/jobs/{id}/fields")).await;
    let nodes = fields["x"].as_array().unwrap().len();
    assert!(nodes > 100 && fields["stress_zz"].as_array().unwrap().len() == nodes);
}

#[tokio::test]
async fn what_is_not_there_is_said_with_what_is() {
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
    for path in ["profiles/top?format=xml", "fields?format=vtu"] {
        let other = server
            .get(&format!("/v1/jobs/{id}/{path}"))
            .send()
            .await
            .unwrap();
        assert_eq!(other.status(), StatusCode::NOT_ACCEPTABLE, "{path}");
        assert!(other.text().await.unwrap().contains("json"), "{path}");
    }
}

#[tokio::test]
async fn a_result_is_not_there_before_the_end_nor_after_an_end_without_one() {
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
