//! The page for people, as a browser meets it: its files, what may store them, and what a browser is asked.

use reqwest::{StatusCode, header};
use serde_json::json;
use suite::harness::client;

use crate::{auth::create, server};

/// The addresses that an HTML text names.
fn addresses(html: &str) -> Vec<String> {
    let starts = ["src=\"", "href=\""].iter();
    let found = starts.flat_map(|start| html.split(start).skip(1));
    found
        .map(|rest| rest.split('"').next().unwrap().to_owned())
        .filter(|address| !address.starts_with(['#', 'd']))
        .collect()
}

/// Operations: GetHome
#[tokio::test]
async fn the_page_and_its_files_are_open_and_kept_by_browsers() {
    let server = server().await;
    let body = json!({"name": "test", "owner": "root", "scopes": ["admin"]});
    create(&server, None, body).await;
    let page = server.get("/").send().await.unwrap();
    assert_eq!(page.status(), StatusCode::OK);
    let headers = page.headers().clone();
    assert_eq!(headers["content-type"], "text/html; charset=utf-8");
    assert_eq!(headers["cache-control"], "no-cache");
    assert_eq!(headers["x-content-type-options"], "nosniff");
    let policy = headers["content-security-policy"].to_str().unwrap();
    assert!(policy.starts_with("default-src 'none'; script-src 'self'; style-src 'self';"));
    assert!(!policy.contains("unsafe") && !policy.contains("http"));
    let known = server.get("/").header("If-None-Match", &headers["etag"]);
    assert_eq!(
        known.send().await.unwrap().status(),
        StatusCode::NOT_MODIFIED
    );

    let html = page.text().await.unwrap();
    let files = addresses(&html);
    assert!(files.len() > 5, "{files:?}");
    for file in &files {
        // relative, so that the page works below any path
        assert!(file.starts_with("web/"), "{file}");
        let answer = server.get(&format!("/{file}")).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{file}");
        assert_eq!(
            answer.headers()["cache-control"],
            "public, max-age=31536000, immutable"
        );
        assert!(!answer.headers().contains_key("content-encoding"));
        let whole = answer.bytes().await.unwrap();
        let coded = server.get(&format!("/{file}"));
        let coded = coded
            .header("Accept-Encoding", "gzip")
            .send()
            .await
            .unwrap();
        if coded.headers().contains_key("content-encoding") {
            let coded = coded.bytes().await.unwrap();
            assert!(coded.len() < whole.len());
        }
    }
    // a tab of another version is told that its files are gone, and not given those of this one
    let (_, rest) = files[0]
        .strip_prefix("web/")
        .unwrap()
        .split_once('/')
        .unwrap();
    for other in [
        format!("/web/0000/{rest}"),
        format!("/web/{}/../../etc/passwd", "0".repeat(64)),
        format!("/{}/..%2f..%2findex.html", &files[0][..20]),
    ] {
        let answer = client().get(format!("{}{other}", server.url));
        let status = answer.send().await.unwrap().status();
        assert!(
            [StatusCode::NOT_FOUND, StatusCode::UNAUTHORIZED].contains(&status),
            "{other}: {status}"
        );
    }
}

/// A person who opens an address is asked for a password by the browser; a script of a page is not.
#[tokio::test]
async fn a_browser_asks_for_a_password_when_a_person_opens_an_address() {
    let server = server().await;
    let body = json!({"name": "test", "owner": "root", "scopes": ["admin"]});
    let (_, token) = create(&server, None, body).await;
    let asked = async |mode: &'static str| {
        let request = server.get("/docs").header("Sec-Fetch-Mode", mode);
        let response = request.send().await.unwrap();
        assert_eq!(response.status(), StatusCode::UNAUTHORIZED);
        let lines = response.headers().get_all(header::WWW_AUTHENTICATE);
        let first = |line: &header::HeaderValue| line.to_str().unwrap()[..5].to_owned();
        lines.iter().map(first).collect::<Vec<_>>()
    };
    // each on a line of its own: of two on one line Chromium reads the first only
    assert_eq!(asked("navigate").await, ["Beare", "Basic"]);
    assert_eq!(asked("cors").await, ["Beare"]);
    let with = server.get("/docs").basic_auth("anybody", Some(token));
    assert_eq!(with.send().await.unwrap().status(), StatusCode::OK);
    // explanations are read by people, who follow a link from the page
    let why = server.get("/v1/warnings/sharp_edge");
    let why = why.header("Accept", "text/html,*/*;q=0.8").send().await;
    let why = why.unwrap().text().await.unwrap();
    assert!(why.starts_with("<!doctype html>") && why.contains("<code>sharp_edge</code>"));
    // what is answered is for the one who asked, and for no other site
    let answer = server.get("/v1/errors/not-found").send().await.unwrap();
    assert_eq!(answer.headers()["cache-control"], "private, no-cache");
    assert_eq!(
        answer.headers()["cross-origin-resource-policy"],
        "same-origin"
    );
}
