//! Registering parametrised problems.

use reqwest::StatusCode;
use serde_json::{Value, json};
use suite::{
    example_json,
    harness::{Server, answer},
};

use crate::server;

/// A flat punch without friction, so that all numbers are proportional to the indentation and to Young's modulus.
pub(crate) fn punch() -> Value {
    let mut problem = example_json("rectangular_punch");
    problem["contacts"][0]
        .as_object_mut()
        .unwrap()
        .remove("friction");
    json!({
        "title": "A flat punch",
        "problem": problem,
        "inputs": [["/contacts/0/indentation"], ["/materials/0/youngs_modulus", "/materials/0/poissons_ratio"]],
        "outputs": [
            { "scalars": ["normal_force", "contacts/top/peak_normal_stress"] },
            { "profile": "top", "quantity": "normal_stress", "points": 5 },
        ],
    })
}

pub(crate) async fn put(server: &Server, name: &str, model: &Value) -> Value {
    let (status, model) = answer(server.put(&format!("/v1/models/{name}")).json(model)).await;
    assert!(
        status == StatusCode::CREATED || status == StatusCode::OK,
        "{model:#}"
    );
    model
}

/// Pointers and reasons of all violations.
async fn refused(server: &Server, model: &Value) -> Vec<(String, String)> {
    let (status, document) = answer(server.put("/v1/models/wrong").json(model)).await;
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY, "{document:#}");
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let all = document["errors"].as_array().unwrap();
    all.iter()
        .map(|v| (text(&v["pointer"]), text(&v["reason"])))
        .collect()
}

/// Operations: PutModel, GetModel, ListModels, DeleteModel
#[tokio::test]
async fn a_model_is_registered_replaced_listed_and_deleted() {
    let mut server = server().await;
    let response = server
        .put("/v1/models/punch")
        .json(&punch())
        .send()
        .await
        .unwrap();
    assert_eq!(response.status(), StatusCode::CREATED);
    assert_eq!(response.headers()["location"], "/v1/models/punch");
    let model: Value = response.json().await.unwrap();
    assert_eq!(
        (&model["name"], &model["owner"]),
        (&json!("punch"), &json!("local"))
    );
    assert_eq!(model["base_input"], json!([[0.25], [1000.0, 0.3]]));
    let mut second = punch();
    second["inputs"] = json!([["/contacts/0/indentation"]]);
    let (status, replaced) = answer(server.put("/v1/models/punch").json(&second)).await;
    assert_eq!(status, StatusCode::OK);
    assert_eq!(replaced["created_at"], model["created_at"]);
    put(&server, "a.b_c-1", &punch()).await;
    server.kill().await;
    server.restart().await;
    let whole = server.json("/v1/models/punch").await;
    assert_eq!(whole["inputs"], second["inputs"]);
    assert_eq!(whole["outputs"], second["outputs"]);
    assert_eq!(whole["title"], "A flat punch");
    assert_eq!(whole["problem"]["contacts"][0]["indentation"], 0.25);
    let list = server.json("/v1/models?page_size=1").await;
    assert_eq!(list["models"][0]["name"], "a.b_c-1");
    assert!(list["models"][0].get("problem").is_none());
    let next = list["next_page_token"].as_str().unwrap();
    let list = server
        .json(&format!("/v1/models?page_size=1&page_token={next}"))
        .await;
    assert_eq!(
        (&list["models"][0]["name"], &list["next_page_token"]),
        (&json!("punch"), &Value::Null)
    );
    let delete = async || {
        server
            .delete("/v1/models/punch")
            .send()
            .await
            .unwrap()
            .status()
    };
    assert_eq!(delete().await, StatusCode::NO_CONTENT);
    assert_eq!(delete().await, StatusCode::NOT_FOUND);
    for wrong in ["-a", ".a", "a%20b", &"a".repeat(65), "%C3%A4"] {
        let (status, _) = answer(server.put(&format!("/v1/models/{wrong}")).json(&punch())).await;
        assert_eq!(status, StatusCode::NOT_FOUND, "{wrong}");
    }
}

/// Operations: PutModel
#[tokio::test]
async fn all_that_is_wrong_with_a_model_is_told_together() {
    let server = server().await;
    let mut model = punch();
    model["title"] = json!("x".repeat(257));
    model["problem"]["materials"][0]["youngs_modulus"] = json!(-1);
    model["inputs"] = json!([
        ["/contacts/0/indentation", "/contacts/0/indentation"],
        ["/contacts/1/indentation", "/analysis"],
        []
    ]);
    model["outputs"] = json!([
        { "scalars": ["normal_force", "normal_forces", "contacts/side/normal_force"] },
        { "profile": "side", "quantity": "normal_stress", "points": 1 },
        { "scalars": [] },
    ]);
    let found = refused(&server, &model).await;
    for expected in [
        ("/problem/materials/0/youngs_modulus", "out_of_range"),
        ("/title", "too_long"),
        ("/inputs/2", "too_few"),
        ("/outputs/2", "too_few"),
        ("/outputs/0/scalars/1", "unknown_name"),
        ("/outputs/0/scalars/2", "unknown_boundary"),
        ("/outputs/1/profile", "unknown_boundary"),
        ("/outputs/1/points", "out_of_range"),
    ] {
        let expected = (expected.0.to_owned(), expected.1.to_owned());
        assert!(found.contains(&expected), "{expected:?} in {found:?}");
    }
    model["inputs"].as_array_mut().unwrap().pop();
    let found = refused(&server, &model).await;
    for expected in [
        ("/inputs/0/1", "duplicate_name"),
        ("/inputs/1/0", "unknown_name"),
        ("/inputs/1/1", "wrong_type"),
    ] {
        let expected = (expected.0.to_owned(), expected.1.to_owned());
        assert!(found.contains(&expected), "{expected:?} in {found:?}");
    }
    assert!(
        server.json("/v1/models").await["models"]
            .as_array()
            .unwrap()
            .is_empty()
    );
}

/// Operations: PutModel
#[tokio::test]
async fn a_model_has_bounds_and_an_owner_some_models() {
    let server = server().await;
    let first = async |model: &Value| refused(&server, model).await.remove(0);
    let own = |pointer: &str, reason: &str| (pointer.to_owned(), reason.to_owned());
    let mut many = punch();
    many["inputs"] = json!(vec![["/contacts/0/indentation"]; 17]);
    assert_eq!(first(&many).await, own("/inputs", "too_many"));
    many["inputs"] = json!([vec!["/contacts/0/indentation"; 65]]);
    assert_eq!(first(&many).await, own("/inputs", "too_many"));
    let mut many = punch();
    many["outputs"] = json!([]);
    assert_eq!(first(&many).await, own("/outputs", "too_few"));
    let profile = json!({ "profile": "top", "quantity": "gap", "points": 9999 });
    many["outputs"] = json!([profile, profile]);
    assert_eq!(first(&many).await, own("/outputs", "too_many"));
    many["outputs"] = json!([{ "scalars": vec!["contacts/top/peak_normal_stress"; 1000] }]);
    assert_eq!(first(&many).await, own("/outputs", "too_large"));
    let mut large = punch();
    let lines: Vec<f64> = (0..=20_000).map(|n| f64::from(n) / 20_000.0).collect();
    large["problem"]["mesh"]["grid"] = json!({ "x": lines, "y": [0, 1] });
    large["problem"]["contacts"][0]["obstacle"] = json!({ "kind": "flat" });
    large["problem"]["contacts"][0]["boundary"] = json!("right");
    large["outputs"] = json!([{ "scalars": ["normal_force"] }]);
    large["inputs"] = json!([["/contacts/0/indentation"]]);
    let found = refused(&server, &large).await;
    assert!(found.contains(&own("/problem", "too_large")), "{found:?}");

    for n in 0..100 {
        put(&server, &format!("m{n}"), &punch()).await;
    }
    let (status, document) = answer(server.put("/v1/models/m100").json(&punch())).await;
    assert_eq!(
        (status, &document["code"]),
        (StatusCode::TOO_MANY_REQUESTS, &json!("quota-exceeded"))
    );
    assert_eq!(document["quota"]["limit"], 100);
    assert!(
        document["detail"]
            .as_str()
            .unwrap()
            .contains("local has 100 models")
    );
    // to replace one is no further one
    put(&server, "m7", &punch()).await;
}
