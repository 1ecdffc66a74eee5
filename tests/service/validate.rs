//! POST /v1/problems/validate.

use reqwest::StatusCode;
use serde_json::{Value, json};
use suite::example_json;

use crate::server;

/// Operations: ValidateProblem
#[tokio::test]
async fn a_valid_problem_has_a_cost_estimate() {
    let server = server().await;
    let body = json!({ "problem": example_json("cylinder") });
    let response = server
        .post("/v1/problems/validate")
        .json(&body)
        .send()
        .await
        .unwrap();
    assert_eq!(response.status(), StatusCode::OK);
    let judgement: Value = response.json().await.unwrap();
    assert_eq!(
        (&judgement["valid"], &judgement["violations"]),
        (&json!(true), &json!([]))
    );
    assert!(judgement["estimate"]["dofs"].as_u64().unwrap() > 0);
    assert_eq!(judgement["first_mesh"], Value::Null);
    assert!(
        judgement["input_hash"]
            .as_str()
            .unwrap()
            .starts_with("sha256:")
    );
    assert_eq!(
        server.json("/v1/jobs").await["jobs"],
        json!([]),
        "nothing was stored"
    );
}

/// What adaptive refinement may come to says little of what it takes: the first mesh is told beside it.
///
/// Operations: ValidateProblem
#[tokio::test]
async fn an_adaptive_problem_has_the_cost_of_its_first_and_of_its_largest_mesh() {
    let server = server().await;
    let mut problem = example_json("cylinder");
    problem["mesh"]["refine"] = json!({ "tolerance": 0.01 });
    let answer = server
        .post("/v1/problems/validate")
        .json(&json!({ "problem": problem }))
        .send()
        .await
        .unwrap();
    let judgement: Value = answer.json().await.unwrap();
    for number in ["dofs", "memory_bytes", "run_s"] {
        let of = |mesh: &str| judgement[mesh][number].as_f64().unwrap();
        assert!(
            0.0 < of("first_mesh") && 10.0 * of("first_mesh") < of("estimate"),
            "{judgement:#}"
        );
    }
}

/// As PowerShell and some editors write a text.
///
/// Operations: ValidateProblem
#[tokio::test]
async fn a_body_may_begin_with_a_byte_order_mark() {
    let server = server().await;
    let body = json!({ "problem": example_json("cylinder") });
    let response = server
        .post("/v1/problems/validate")
        .header("Content-Type", "application/json")
        .body(format!("\u{feff}{body}"))
        .send()
        .await
        .unwrap();
    assert_eq!(response.status(), StatusCode::OK);
    let judgement: Value = response.json().await.unwrap();
    assert_eq!(judgement["valid"], true, "{judgement}");
}

/// Operations: ValidateProblem
#[tokio::test]
async fn an_invalid_problem_is_answered_with_200() {
    let server = server().await;
    // first the violations of structure: names and types …
    let mut problem = example_json("cylinder");
    problem["contact"] = json!([]);
    problem["mesh"]["grid"]["x"][1] = json!("far");
    let judgement = validate(&server, &problem).await;
    assert_eq!(judgement["valid"], false);
    let pointers = pointers(&judgement);
    assert!(
        pointers.contains(&"/problem/contact".into()),
        "{pointers:?}"
    );
    assert!(
        pointers.contains(&"/problem/mesh/grid/x/1".into()),
        "{pointers:?}"
    );
    // … then those of content
    let mut problem = example_json("cylinder");
    problem["supports"][0]["boundary"] = json!("lft");
    let judgement = validate(&server, &problem).await;
    assert_eq!(judgement["valid"], false);
    let violation = &judgement["violations"][0];
    assert_eq!(violation["pointer"], "/problem/supports/0/boundary");
    assert!(
        violation["expected"].as_str().unwrap().contains("left"),
        "it names what exists: {violation}"
    );
}

/// Operations: ValidateProblem
#[tokio::test]
async fn a_body_without_a_problem_is_rejected_by_name() {
    let server = server().await;
    let response = server
        .post("/v1/problems/validate")
        .json(&json!({ "probelm": {} }))
        .send()
        .await
        .unwrap();
    assert_eq!(response.status(), StatusCode::OK);
    let judgement: Value = response.json().await.unwrap();
    assert_eq!(pointers(&judgement), ["/problem", "/probelm"]);
}

async fn validate(server: &suite::harness::Server, problem: &Value) -> Value {
    let body = json!({ "problem": problem });
    server
        .post("/v1/problems/validate")
        .json(&body)
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap()
}

fn pointers(judgement: &Value) -> Vec<String> {
    let violations = judgement["violations"].as_array().unwrap();
    violations
        .iter()
        .map(|violation| violation["pointer"].as_str().unwrap().to_string())
        .collect()
}

/// No client could ask for the profile of such a contact: addresses are shortened where they have these parts.
#[tokio::test]
async fn a_contact_has_a_name_that_can_stand_in_an_address() {
    let server = server().await;
    for (name, valid) in [
        ("", false),
        (".", false),
        ("..", false),
        ("...", true),
        ("a/b", true),
        ("top edge?", true),
    ] {
        let mut problem = example_json("rectangular_punch");
        problem["mesh"]["boundaries"] = json!({ name: { "side": "top" } });
        problem["contacts"][0]["boundary"] = json!(name);
        let judgement = validate(&server, &problem).await;
        assert_eq!(judgement["valid"], valid, "{name:?}: {judgement:#}");
        let expected = if valid {
            vec![]
        } else {
            vec!["/problem/contacts/0/boundary"]
        };
        assert_eq!(pointers(&judgement), expected, "{name:?}");
    }
}
