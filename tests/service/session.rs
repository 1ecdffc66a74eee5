//! Sessions of browsers: a token as a cookie, and what it opens, from where, and for how long.

use reqwest::{Client, Method, StatusCode, header, redirect::Policy};
use serde_json::{Value, json};
use suite::harness::{Server, answer};

use crate::{SIGNORINI, auth::create, server};

/// A token of ada with these scopes, and its id.
async fn ada(server: &Server, admin: &str, more: Value) -> (String, String) {
    let mut body = json!({"name": "browser", "owner": "ada", "scopes": ["read"]});
    for (name, value) in more.as_object().unwrap() {
        body[name] = value.clone();
    }
    create(server, Some(admin), body).await
}

async fn administrator(server: &Server) -> String {
    let body = json!({"name": "test", "owner": "root", "scopes": ["admin"]});
    create(server, None, body).await.1
}

/// The cookie that an answer sets, and its attributes.
fn cookie(response: &reqwest::Response) -> (String, Vec<String>) {
    let line = response.headers()["set-cookie"].to_str().unwrap();
    let mut parts = line.split("; ").map(str::to_owned);
    (parts.next().unwrap(), parts.collect())
}

/// Operations: CreateSession, DeleteSession
#[tokio::test]
async fn a_session_opens_what_its_token_opens_and_ends_with_it() {
    let server = server().await;
    let admin = administrator(&server).await;
    let (id, token) = ada(&server, &admin, json!({})).await;
    let log_in = server.post("/v1/session").json(&json!({"token": token}));
    let response = log_in.send().await.unwrap();
    assert_eq!(response.status(), StatusCode::CREATED);
    assert_eq!(response.headers()["cache-control"], "no-store");
    let (sent, attributes) = cookie(&response);
    assert!(sent.starts_with(&format!("signorini-{id}=")), "{sent}");
    for wanted in ["Path=/", "HttpOnly", "SameSite=Strict", "Max-Age=43200"] {
        assert!(attributes.iter().any(|found| found == wanted), "{wanted}");
    }
    assert!(!attributes.contains(&"Secure".to_owned()));
    let session: Value = response.json().await.unwrap();
    assert_eq!(session["owner"], "ada");

    let with = |cookie: &str, site: &str, path: &str| {
        let request = server.get(path).header(header::COOKIE, cookie);
        request.header("Sec-Fetch-Site", site)
    };
    let status = async |request: reqwest::RequestBuilder| request.send().await.unwrap().status();
    let (code, caller) = answer(with(&sent, "same-origin", "/v1/me")).await;
    assert_eq!((code, &caller["owner"]), (StatusCode::OK, &json!("ada")));
    assert_eq!(caller["scopes"], json!(["read"]));
    // a page of another site, also of another service at this host, has no session
    for site in ["cross-site", "same-site"] {
        let request = with(&sent, site, "/v1/jobs");
        assert_eq!(status(request).await, StatusCode::UNAUTHORIZED, "{site}");
    }
    // a cookie of another service, or one that is not valid any more, does not hide one that is
    let many = format!("theme=dark; signorini-000000000000=x; {sent}; other=1");
    assert_eq!(
        status(with(&many, "none", "/v1/jobs")).await,
        StatusCode::OK
    );
    let request = with(&sent, "same-origin", "/v1/queue/pause");
    assert_eq!(status(request).await, StatusCode::METHOD_NOT_ALLOWED);
    let pause = server
        .post("/v1/queue/pause")
        .header(header::COOKIE, &sent)
        .header("Sec-Fetch-Site", "same-origin");
    assert_eq!(status(pause).await, StatusCode::FORBIDDEN);

    let log_out = server
        .request(Method::DELETE, "/v1/session")
        .header(header::COOKIE, &sent);
    let response = log_out.send().await.unwrap();
    assert_eq!(response.status(), StatusCode::NO_CONTENT);
    let (removed, attributes) = cookie(&response);
    assert_eq!(removed, format!("signorini-{id}="));
    assert!(attributes.contains(&"Max-Age=0".to_owned()));

    let revoke = server.request(Method::DELETE, &format!("/v1/tokens/{id}"));
    revoke.bearer_auth(&admin).send().await.unwrap();
    let request = with(&sent, "same-origin", "/v1/jobs");
    let (code, problem) = answer(request).await;
    assert_eq!(code, StatusCode::UNAUTHORIZED, "{problem:#}");
}

/// A session ends with its token; behind a proxy with https its cookie is for https alone, and for the proxy's path.
#[tokio::test]
async fn a_cookie_is_for_the_address_and_the_life_of_its_token() {
    let server = Server::start(
        SIGNORINI,
        &[
            "--path-prefix",
            "/signorini",
            "--trusted-proxy",
            "127.0.0.1",
            "--allow-unauthenticated",
        ],
    )
    .await;
    let admin = administrator(&server).await;
    let (_, token) = ada(&server, &admin, json!({"expires_in_s": 600})).await;
    let log_in = server
        .post("/signorini/v1/session")
        .header("X-Forwarded-Proto", "https")
        .json(&json!({"token": format!(" {token}\n")}));
    let response = log_in.send().await.unwrap();
    assert_eq!(response.status(), StatusCode::CREATED);
    let (_, attributes) = cookie(&response);
    for wanted in ["Path=/signorini", "Secure"] {
        assert!(attributes.iter().any(|found| found == wanted), "{wanted}");
    }
    let life = attributes
        .iter()
        .find_map(|found| found.strip_prefix("Max-Age="));
    let life: u64 = life.unwrap().parse().unwrap();
    assert!((590..=600).contains(&life), "{life}");
}

#[tokio::test]
async fn a_wrong_log_in_sets_no_cookie_and_names_no_token() {
    let server = server().await;
    let admin = administrator(&server).await;
    for body in [
        json!({"token": "abc"}),
        json!({"token": ""}),
        json!({"token": admin.replace("sgn_", "sgn-")}),
        json!({"token": admin, "more": 1}),
        json!({"token": 7}),
        json!([admin]),
        json!({}),
    ] {
        let response = server.post("/v1/session").json(&body).send().await.unwrap();
        let expected = if body["token"].is_string() && body.get("more").is_none() {
            StatusCode::UNAUTHORIZED
        } else {
            StatusCode::UNPROCESSABLE_ENTITY
        };
        assert_eq!(response.status(), expected, "{body}");
        assert!(!response.headers().contains_key("set-cookie"));
        assert!(!response.text().await.unwrap().contains(&admin[17..]));
    }
}

/// The log-in of the page without scripts; it leads back to the part of the page that was open, and to no other address.
#[tokio::test]
async fn a_form_leads_back_to_the_page() {
    let server = server().await;
    let admin = administrator(&server).await;
    let client = Client::builder().no_proxy().tls_certs_only([]);
    let client = client.redirect(Policy::none()).build().unwrap();
    let send = async |token: &str, part: &str| {
        let pairs = [("token", token), ("part", part)];
        let mut form = form_urlencoded::Serializer::new(String::new());
        form.extend_pairs(pairs);
        let request = client.post(format!("{}/v1/session", server.url));
        let request = request.header(header::CONTENT_TYPE, "application/x-www-form-urlencoded");
        let response = request.body(form.finish()).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::SEE_OTHER);
        let to = response.headers()["location"].to_str().unwrap().to_owned();
        (to, response.headers().contains_key("set-cookie"))
    };
    let to = |address: &str, is_set: bool| (address.to_owned(), is_set);
    assert_eq!(send(&admin, "#/queue").await, to("../#/queue", true));
    assert_eq!(send(&admin, "").await, to("../", true));
    let wrong = send("sgn_wrong", "#/queue").await;
    assert_eq!(wrong, to("../?login=failed#/queue", false));
    for hostile in [
        "//example.org",
        "https://example.org",
        "#/a\r\nX: y",
        "..%2f",
    ] {
        assert_eq!(send(&admin, hostile).await, to("../", true), "{hostile}");
    }
}
