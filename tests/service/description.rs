//! The service's description of its own API.

use serde_json::Value;
use suite::harness::{Server, client};

async fn server() -> Server {
    Server::start(env!("CARGO_BIN_EXE_signorini"), &[]).await
}

/// Every `$ref` of a document.
fn references<'a>(value: &'a Value, found: &mut Vec<&'a str>) {
    match value {
        Value::Object(fields) => {
            found.extend(fields.get("$ref").and_then(Value::as_str));
            fields.values().for_each(|value| references(value, found));
        }
        Value::Array(items) => items.iter().for_each(|value| references(value, found)),
        _ => {}
    }
}

/// Operations: GetOpenApi, GetProblemSchema
#[tokio::test]
async fn the_description_is_complete_and_explains_each_error() {
    let document = server().await.json("/openapi.json").await;
    // the dialect that every generator of clients reads
    assert_eq!(document["openapi"], "3.0.3");
    let mut found = vec![];
    references(&document, &mut found);
    assert!(found.len() > 100);
    for reference in found {
        let pointer = reference.strip_prefix('#').unwrap();
        assert!(document.pointer(pointer).is_some(), "{reference}");
    }
    for (path, operations) in document["paths"].as_object().unwrap() {
        for (method, operation) in operations.as_object().unwrap() {
            for (status, response) in operation["responses"].as_object().unwrap() {
                let error = status.starts_with(['4', '5']);
                let document = &response["content"]["application/problem+json"];
                assert_eq!(document.is_object(), error, "{method} {path} {status}");
            }
        }
    }
    // the schema of a problem is that of `signorini schema`
    let problem = &document["components"]["schemas"]["Problem"]["properties"];
    let names =
        |schema: &Value| -> Vec<String> { schema.as_object().unwrap().keys().cloned().collect() };
    let schema = server().await.json("/v1/schema/problem.json").await;
    assert_eq!(names(problem), names(&schema["properties"]));
}

/// A valid value for a variable of a path, so that only the parameter of the request is invalid.
fn filled(path: &str) -> String {
    path.replace("{id}", "job_01a1fd7a-0018-72af-8a1b-e7e5d5106dae")
        .replace("{hash}", &format!("sha256:{}", "0".repeat(64)))
        .replace("{boundary}", "top")
        .replace("{code}", "internal")
        .replace("{file}", "start.js")
        .replace("{plot}", "deformed.svg")
        .replace("{name}", "punch")
}

/// Operations: GetOpenApi
#[tokio::test]
async fn every_described_route_exists_and_has_the_described_parameters() {
    let server = server().await;
    let document = server.json("/openapi.json").await;
    for (path, operations) in document["paths"].as_object().unwrap() {
        for (method, operation) in operations.as_object().unwrap() {
            let what = format!("{method} {path}");
            let url = format!("{}{}?nobody_knows_this=1", server.url, filled(path));
            let method = method.to_uppercase().parse().unwrap();
            let answer = client().request(method, url).send().await.unwrap();
            if path.ends_with('z') {
                assert_eq!(answer.status(), 200, "{what}: a probe takes what it gets");
                continue;
            }
            let error: Value = answer.json().await.unwrap();
            assert_eq!(error["code"], "unknown-parameter", "{what}: {error:#}");
            let detail = error["detail"].as_str().unwrap();
            let known = detail.split("it has: ").nth(1).unwrap();
            let mut known: Vec<&str> = known.split(", ").filter(|name| *name != "none").collect();
            let parameters = operation["parameters"].as_array().into_iter().flatten();
            let mut described: Vec<&str> = parameters
                .filter(|parameter| parameter["in"] == "query")
                .map(|parameter| parameter["name"].as_str().unwrap())
                .collect();
            known.sort_unstable();
            described.sort_unstable();
            assert_eq!(described, known, "{what}");
        }
    }
}

/// Operations: GetDocs, GetDocsFile
#[tokio::test]
async fn the_page_of_the_api_loads_files_from_this_service_only() {
    let server = server().await;
    let page = server.get("/docs").send().await.unwrap();
    let policy = page.headers()["content-security-policy"].to_str().unwrap();
    assert!(policy.starts_with("default-src 'none'") && !policy.contains("http"));
    let html = page.text().await.unwrap();
    let addresses: Vec<&str> = ["src=\"", "href=\""]
        .iter()
        .flat_map(|start| html.split(start).skip(1))
        .map(|rest| rest.split('"').next().unwrap())
        .filter(|address| !address.starts_with("data:"))
        .collect();
    assert!(addresses.len() > 3);
    for address in addresses {
        // relative, so that the page works below any path
        assert!(
            !address.starts_with('/') && !address.contains(':'),
            "{address}"
        );
        let answer = server.get(&format!("/{address}")).send().await.unwrap();
        assert_eq!(answer.status(), 200, "{address}");
    }
}

/// Operations: GetProto
#[tokio::test]
async fn the_contract_of_grpc_is_served_unchanged() {
    // it lives until its whole answer is read
    let server = server().await;
    let served = server.get("/proto/signorini.proto").send().await;
    let served = served.unwrap().text().await.unwrap();
    let written = include_str!("../../proto/signorini/v1/signorini.proto");
    assert_eq!(served, written);
}

/// Operations: GetError
#[tokio::test]
async fn every_error_is_explained_to_programs_and_people() {
    let server = server().await;
    let document = server.json("/openapi.json").await;
    let path = &document["paths"]["/v1/errors/{code}"]["get"];
    let codes = path["parameters"][0]["schema"]["enum"].as_array().unwrap();
    assert!(codes.len() > 30);
    for code in codes {
        let path = format!("/v1/errors/{}", code.as_str().unwrap());
        let kind = server.json(&path).await;
        assert_eq!(kind["code"], *code);
        let page = server.get(&path).header("accept", "text/html").send();
        let page = page.await.unwrap().text().await.unwrap();
        let explanation = kind["explanation"].as_str().unwrap();
        let explanation = explanation.replace('&', "&amp;").replace('<', "&lt;");
        assert!(page.contains(&explanation), "{path}");
    }
}

/// Operations: GetWarning
#[tokio::test]
async fn every_warning_is_explained() {
    let server = server().await;
    let document = server.json("/openapi.json").await;
    let path = &document["paths"]["/v1/warnings/{code}"]["get"];
    let codes = path["parameters"][0]["schema"]["enum"].as_array().unwrap();
    assert!(codes.len() > 30);
    for code in codes {
        let path = format!("/v1/warnings/{}", code.as_str().unwrap());
        let kind = server.json(&path).await;
        assert_eq!(kind["code"], *code);
        assert!(kind["title"].as_str().unwrap().len() > 10, "{kind}");
    }
}
