//! What belongs to an owner is nobody else's: from the list of all operations.

use reqwest::{RequestBuilder, StatusCode};
use serde_json::{Value, json};
use suite::example_json;

use crate::{
    auth::{access_of, create},
    meshes::file,
    server,
};

/// Every operation on one thing of somebody else finds nothing, and no list shows it: from the list of all operations, so that
/// one that forgets to ask whose it is does not pass.
#[tokio::test]
async fn nobody_sees_or_changes_what_another_owner_has() {
    let server = server().await;
    let token =
        |owner: &str, scopes: &[&str]| json!({"name": "test", "owner": owner, "scopes": scopes});
    let (_, admin) = create(&server, None, token("root", &["admin"])).await;
    let all = ["read", "submit", "cancel"];
    let (_, ada) = create(&server, Some(&admin), token("ada", &all)).await;
    let (_, bob) = create(&server, Some(&admin), token("bob", &all)).await;
    let send = async |request: RequestBuilder, secret: &str| {
        let answer = request.bearer_auth(secret).send().await.unwrap();
        let status = answer.status();
        (status, answer.text().await.unwrap())
    };
    let make = async |request: RequestBuilder| -> Value {
        let (status, text) = send(request, &ada).await;
        assert!(status.is_success(), "{text}");
        serde_json::from_str(&text).unwrap()
    };
    let problem = example_json("sheet");
    let job = json!({"problem": problem, "name": "of ada", "cache": "off"});
    let job = make(server.post("/v1/jobs").json(&job)).await;
    let axes = json!([{ "path": "/contacts/0/friction/coefficient", "values": [0.1, 0.2] }]);
    let sweep = json!({"base": problem, "axes": axes, "name": "of ada"});
    let sweep = make(server.post("/v1/sweeps").json(&sweep)).await;
    let mesh = file("gmsh/fillet-tri6-msh22-ascii.msh");
    let mesh = make(server.post("/v1/meshes").body(mesh)).await;
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let (job, sweep, mesh) = (text(&job["id"]), text(&sweep["id"]), text(&mesh["hash"]));
    let own = [
        format!("/v1/jobs/{job}"),
        format!("/v1/jobs/{job}/result"),
        format!("/v1/meshes/{mesh}"),
    ];
    let seen = async || {
        let mut texts = vec![];
        for path in &own {
            let (status, text) = send(server.get(path), &ada).await;
            assert_eq!(status, StatusCode::OK, "{path}: {text}");
            texts.push(text);
        }
        texts
    };
    let ended = format!("/v1/jobs/{job}?wait=30&until=terminal");
    send(server.get(&ended), &ada).await;
    send(server.get(&format!("/v1/sweeps/{sweep}?wait=30")), &ada).await;
    let before = seen().await;

    let openapi = send(server.get("/openapi.json"), &bob).await.1;
    let openapi: Value = serde_json::from_str(&openapi).unwrap();
    let (mut things, mut lists) = (0, 0);
    for (route, methods) in openapi["paths"].as_object().unwrap() {
        for (method, operation) in methods.as_object().unwrap() {
            let id = operation["operationId"].as_str().unwrap();
            // what is streamed of a list does not end: watch_list.rs has a test of its own
            if ["admin", "open"].contains(&access_of(id)) || id == "WatchJobs" {
                continue;
            }
            let path = route
                .replace("/sweeps/{id}", &format!("/sweeps/{sweep}"))
                .replace("{id}", &job)
                .replace("{hash}", &mesh)
                .replace("{boundary}", "top")
                .replace("{plot}", "mesh.svg")
                .replace("{field}", "von_mises")
                .replace("{number}", "0");
            let of_one = ["{id}", "{hash}"].iter().any(|part| route.contains(part));
            let mut request = server.request(method.to_uppercase().parse().unwrap(), &path);
            let expected = match id {
                // the id is taken
                "PutJob" => {
                    request = request.json(&json!({"problem": problem}));
                    StatusCode::CONFLICT
                }
                "UpdateJob" => {
                    request = request.json(&json!({"name": "of bob"}));
                    StatusCode::NOT_FOUND
                }
                _ => StatusCode::NOT_FOUND,
            };
            if of_one {
                let (status, text) = send(request, &bob).await;
                assert_eq!(status, expected, "{method} {path}: {text}");
                things += 1;
            } else if method == "get" && !route.contains('{') {
                let (_, text) = send(request, &bob).await;
                for secret in [&*job, &*sweep, &*mesh] {
                    assert!(!text.contains(secret), "{path}: {text}");
                }
                lists += 1;
            }
        }
    }
    assert!(things > 20 && lists > 5, "{things} and {lists}");
    for (method, path) in [("POST", "/v1/jobs/cancel"), ("DELETE", "/v1/jobs")] {
        let path = format!("{path}?name=of%20ada");
        let request = server.request(method.parse().unwrap(), &path);
        let (_, text) = send(request, &bob).await;
        let changed: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(changed["matched"], 0, "{path}: {text}");
    }
    assert_eq!(seen().await, before);
}

/// Operations: ListOwners
#[tokio::test]
async fn an_owner_who_has_only_a_valid_token_is_listed() {
    let server = server().await;
    let token =
        |owner: &str, scopes: &[&str]| json!({"name": "test", "owner": owner, "scopes": scopes});
    let (_, admin) = create(&server, None, token("root", &["admin"])).await;
    let (bob, _) = create(&server, Some(&admin), token("bob", &["read"])).await;
    let listed = async || -> Vec<String> {
        let answer = server.get("/v1/owners").bearer_auth(&admin).send().await;
        let found: Value = answer.unwrap().json().await.unwrap();
        let owners = found["owners"].as_array().unwrap().iter();
        owners
            .map(|owner| owner["owner"].as_str().unwrap().to_owned())
            .collect()
    };
    assert_eq!(listed().await, ["bob", "root"]);
    let revoked = server
        .delete(&format!("/v1/tokens/{bob}"))
        .bearer_auth(&admin);
    assert!(revoked.send().await.unwrap().status().is_success());
    assert_eq!(listed().await, ["root"]);
}
