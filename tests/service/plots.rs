//! /plots/{mesh,deformed,profile,convergence}.{svg,png,pdf}.

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
        assert_eq!(light.contains("(mm)"), plot != "convergence", "{plot}");
        assert!(light.contains("μ = 0.3, ρ = 0.01 mm"), "{plot}");
        assert_eq!(light.contains("● verdict: "), plot != "mesh", "{plot}");
        let dark = server.get(&format!("{path}?theme=dark")).send().await;
        let dark = dark.unwrap().text().await.unwrap();
        assert!(dark.starts_with("<svg") && dark != light, "{plot}");
    }
    let path = format!("/v1/jobs/{id}/plots/deformed.svg?stress=yy");
    let normal = server.get(&path).send().await.unwrap();
    assert!(normal.text().await.unwrap().contains(">yy</tspan>"));
}

/// Operations: GetPlot
#[tokio::test]
async fn a_figure_is_also_png_and_pdf_and_is_sent_once() {
    let server = server().await;
    let id = server.submit(&example_json("rectangular_punch")).await;
    server.until_done(&id).await;
    let (mut png, mut pdf) = (vec![], vec![]);
    for (ending, media, begins, all) in [
        ("png", "image/png", &b"\x89PNG"[..], &mut png),
        ("pdf", "application/pdf", b"%PDF-", &mut pdf),
    ] {
        for plot in PLOTS {
            let path = format!("/v1/jobs/{id}/plots/{plot}.{ending}?size=column");
            let answer = server.get(&path).send().await.unwrap();
            assert_eq!(answer.status(), StatusCode::OK, "{path}");
            let headers = answer.headers().clone();
            assert_eq!(headers["content-type"], media);
            let shown = format!("inline; filename=\"{id}.{plot}.{ending}\"");
            assert_eq!(headers["content-disposition"], shown.as_str());
            let bytes = answer.bytes().await.unwrap();
            assert!(bytes.starts_with(begins), "{path}");
            assert!(!all.contains(&bytes), "another figure");
            all.push(bytes);
            let known = server.get(&path).header("if-none-match", &headers["etag"]);
            let known = known.send().await.unwrap();
            assert_eq!(known.status(), StatusCode::NOT_MODIFIED, "{path}");
        }
    }
    let path = format!("/v1/jobs/{id}/plots/profile.svg");
    let tag = |answer: &reqwest::Response| answer.headers()["etag"].clone();
    let page = server.get(&path).send().await.unwrap();
    let column = server.get(&format!("{path}?size=column")).send().await;
    assert_ne!(tag(&page), tag(&column.unwrap()));
}

/// Operations: GetPlot
#[tokio::test]
async fn a_bare_figure_has_nothing_around_it_and_a_slide_is_16_to_9() {
    let server = server().await;
    let mut problem = example_json("rectangular_punch");
    problem["title"] = json!("A punch");
    let id = server.submit(&problem).await;
    server.until_done(&id).await;
    for plot in PLOTS {
        let drawn = async |query: &str| {
            let path = format!("/v1/jobs/{id}/plots/{plot}.svg{query}");
            let answer = server.get(&path).send().await.unwrap();
            assert_eq!(answer.status(), StatusCode::OK, "{path}");
            answer.text().await.unwrap()
        };
        let (full, bare) = (drawn("?style=full").await, drawn("?style=bare").await);
        assert_eq!(full, drawn("").await);
        for word in ["A punch", "μ = 0.3", "verdict", "Warnings", "finer meshes"] {
            assert!(!bare.contains(word), "{plot}: {word}");
        }
        assert!(
            full.contains("A punch") && bare.len() < full.len(),
            "{plot}"
        );
        let slide = drawn("?size=slide").await;
        assert!(
            slide.starts_with(r#"<svg width="864" height="486""#),
            "{plot}"
        );
    }
}

/// Operations: GetPlot
#[tokio::test]
async fn axes_have_the_limits_that_are_asked_for_or_all_faults_are_told() {
    let server = server().await;
    let id = server.submit(&example_json("rectangular_punch")).await;
    server.until_done(&id).await;
    let at = async |path: &str| {
        let path = format!("/v1/jobs/{id}/plots/{path}");
        let answer = server.get(&path).send().await.unwrap();
        (answer.status(), answer.text().await.unwrap())
    };
    for path in [
        "profile.svg?xlim=0.3,0.5&ylim=-700,10&ylim_below=-1,300",
        "convergence.svg?xlim=1,5&ylim=1e-8,1&ylim_below=0,500",
        "deformed.svg?xlim=0.3,0.7&ylim=-0.4,0.1",
        "mesh.pdf?xlim=0,1&ylim=-1,0.1",
    ] {
        assert_eq!(at(path).await.0, StatusCode::OK, "{path}");
    }
    let (_, drawn) = at("profile.svg?xlim=0.3,0.5&ylim=-700,10").await;
    assert!(
        drawn.contains(">\n0.35\n<") && !drawn.contains(">\n0.1\n<"),
        "{drawn}"
    );
    for (path, words) in [
        (
            "profile.svg?xlim=2,1&ylim=0,nan&ylim_below=a",
            vec![
                "xlim: expected two finite numbers",
                "; ylim: ",
                "; ylim_below: ",
            ],
        ),
        (
            "convergence.svg?xlim=1&ylim=-1,1",
            vec!["xlim: ", "; ylim: the axis of residuals"],
        ),
        (
            "mesh.svg?ylim_below=0,1",
            vec!["ylim_below: it is for the lower panels"],
        ),
    ] {
        let (status, text) = at(path).await;
        assert_eq!(status, StatusCode::BAD_REQUEST, "{path}");
        let error: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(error["code"], "bad-parameter");
        let detail = error["detail"].as_str().unwrap();
        assert!(words.iter().all(|word| detail.contains(word)), "{detail}");
    }
    // what can be read and has nothing to show
    for path in [
        "profile.svg?xlim=70,80",
        "deformed.svg?xlim=0,0.001&ylim=-4,0",
    ] {
        let (status, text) = at(path).await;
        assert_eq!(status, StatusCode::NOT_FOUND, "{path}");
        assert!(text.contains("xlim"), "{text}");
    }
}

/// Operations: GetPlot
#[tokio::test]
async fn a_load_step_has_figures_of_its_own() {
    let server = server().await;
    let mut problem = example_json("rectangular_punch");
    problem["steps"] = json!([{ "name": "half", "indentation": 0.5 }, { "name": "whole" }]);
    let id = server.submit(&problem).await;
    server.until_done(&id).await;
    let at = |path: &str| format!("/v1/jobs/{id}/plots/{path}");
    for plot in ["profile", "convergence"] {
        let mut drawn = vec![];
        for step in ["", "?step=half", "?step=1"] {
            let answer = server
                .get(&at(&format!("{plot}.svg{step}")))
                .send()
                .await
                .unwrap();
            assert_eq!(answer.status(), StatusCode::OK, "{plot}{step}");
            drawn.push(answer.text().await.unwrap());
        }
        assert!(!drawn[0].contains("load step") && drawn[1].contains("load step half"));
        assert!(drawn[2].contains("load step whole") && drawn[0] != drawn[1]);
    }
    for (path, status, expected) in [
        (
            "profile.svg?step=third",
            StatusCode::NOT_FOUND,
            "half, whole",
        ),
        ("deformed.svg?step=half", StatusCode::BAD_REQUEST, "stress"),
        ("mesh.svg?step=half", StatusCode::BAD_REQUEST, "size"),
    ] {
        let answer = server.get(&at(path)).send().await.unwrap();
        assert_eq!(answer.status(), status, "{path}");
        assert!(answer.text().await.unwrap().contains(expected), "{path}");
    }
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
        ("mesh.gif", StatusCode::NOT_FOUND, "mesh.png"),
        ("mesh.svg?size=poster", StatusCode::BAD_REQUEST, "column"),
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
