//! /plots/{mesh,deformed,profile,convergence}.svg.

use reqwest::StatusCode;
use serde_json::{Value, json};
use suite::{
    example_json,
    harness::{Server, block, large},
};

use crate::{SIGNORINI, server};

const PLOTS: [&str; 4] = ["mesh", "deformed", "profile", "convergence"];

/// Operations: GetPlot
#[tokio::test]
async fn every_plot_of_a_result_is_an_svg_in_both_themes() {
    let server = server().await;
    let mut problem = example_json("rectangular_punch");
    problem["title"] = json!("Punch & <base>");
    problem["units"] = json!({ "length": "mm", "force": "N", "stress": "MPa" });
    let id = server.submit(&problem).await;
    server.until_done(&id).await;
    for plot in PLOTS {
        let path = format!("/v1/jobs/{id}/plots/{plot}.svg");
        let light = server.get(&path).send().await.unwrap();
        assert_eq!(light.status(), StatusCode::OK, "{plot}");
        assert_eq!(light.headers()["content-type"], "image/svg+xml");
        let light = light.text().await.unwrap();
        assert!(light.starts_with("<svg") && light.contains("Punch &amp; &lt;base&gt;"));
        assert_eq!(light.contains("mm]"), plot != "convergence", "{plot}");
        let dark = server.get(&format!("{path}?theme=dark")).send().await;
        let dark = dark.unwrap().text().await.unwrap();
        assert!(dark.starts_with("<svg") && dark != light, "{plot}");
    }
    let path = format!("/v1/jobs/{id}/plots/deformed.svg?stress=yy");
    let normal = server.get(&path).send().await.unwrap();
    assert!(normal.text().await.unwrap().contains("σ_yy [MPa]"));
}

/// Operations: GetPlot
#[tokio::test]
async fn an_unknown_plot_or_theme_is_refused_with_the_known_ones() {
    let server = server().await;
    let id = server.submit(&example_json("sheet")).await;
    server.until_done(&id).await;
    for (path, status, expected) in [
        ("forces.svg", StatusCode::NOT_FOUND, "convergence.svg"),
        ("mesh", StatusCode::NOT_FOUND, "mesh.svg"),
        (
            "mesh.svg?theme=grey",
            StatusCode::BAD_REQUEST,
            "light or dark",
        ),
        ("mesh.svg?stress=yy", StatusCode::BAD_REQUEST, "theme"),
        (
            "deformed.svg?stress=rr",
            StatusCode::BAD_REQUEST,
            "von_mises",
        ),
    ] {
        let path = format!("/v1/jobs/{id}/plots/{path}");
        let answer = server.get(&path).send().await.unwrap();
        assert_eq!(answer.status(), status, "{path}");
        assert!(answer.text().await.unwrap().contains(expected), "{path}");
    }
}

/// Operations: GetPlot
#[tokio::test]
async fn plots_without_data_are_not_found() {
    let server = server().await;
    let mut elastic = example_json("rectangular_punch");
    elastic["contacts"] = json!([]);
    let id = server.submit(&elastic).await;
    server.until_done(&id).await;
    let profile = format!("/v1/jobs/{id}/plots/profile.svg");
    let profile = server.get(&profile).send().await.unwrap();
    assert_eq!(profile.status(), StatusCode::NOT_FOUND);
    assert!(
        profile
            .text()
            .await
            .unwrap()
            .contains("no contact boundary")
    );
    let deformed = format!("/v1/jobs/{id}/plots/deformed.svg");
    let deformed = server.get(&deformed).send().await.unwrap();
    assert_eq!(deformed.status(), StatusCode::OK);
}

/// Operations: GetPlot
#[tokio::test]
async fn a_plot_is_available_as_soon_as_its_data() {
    let server = Server::start_alone(SIGNORINI, &["--workers", "1"]).await;
    let front = server.submit(&large()).await;
    let waiting = server.submit(&example_json("sheet")).await;
    let mesh = format!("/v1/jobs/{waiting}/plots/mesh.svg");
    let mesh = server.get(&mesh).send().await.unwrap();
    assert_eq!(mesh.status(), StatusCode::OK, "of the problem alone");
    for plot in ["deformed", "profile", "convergence"] {
        let early = format!("/v1/jobs/{waiting}/plots/{plot}.svg");
        let early = server.get(&early).send().await.unwrap();
        assert_eq!(early.status(), StatusCode::CONFLICT);
        let error: Value = early.json().await.unwrap();
        assert_eq!(error["code"], "result-not-ready");
    }
    server.cancel(&waiting).await;
    let never = format!("/v1/jobs/{waiting}/plots/profile.svg");
    let never = server.get(&never).send().await.unwrap();
    assert_eq!(never.status(), StatusCode::NOT_FOUND);
    assert_eq!(never.json::<Value>().await.unwrap()["code"], "no-result");
    server.cancel(&front).await;

    let mut long = block(80, 80);
    long["contacts"][0]["friction"]["history"] = json!("incremental");
    long["steps"] = json!([{ "increments": 300 }]);
    let running = server.submit(&long).await;
    server.until(&running, |event| event["k"] == 3).await;
    let so_far = format!("/v1/jobs/{running}/plots/convergence.svg");
    let so_far = server.get(&so_far).send().await.unwrap();
    assert_eq!(so_far.status(), StatusCode::OK, "of a job that runs");
    server.cancel(&running).await;
}

/// Operations: CreateJob
#[tokio::test]
async fn a_unit_of_more_than_twenty_characters_is_refused() {
    let server = server().await;
    let mut problem = example_json("rectangular_punch");
    problem["units"] = json!({ "length": "a".repeat(21), "stress": "b".repeat(20) });
    let body = json!({ "problem": problem });
    let answer = server.post("/v1/jobs").json(&body).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::UNPROCESSABLE_ENTITY);
    let errors = answer.json::<Value>().await.unwrap()["errors"].clone();
    assert_eq!(errors.as_array().unwrap().len(), 1);
    assert_eq!(errors[0]["pointer"], "/problem/units/length");
}
