//! What answers tell a browser: how to log in, what it may store, and that other sites may not embed them.

use axum::{
    extract::{Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header},
    middleware::Next,
    response::{IntoResponse, Redirect, Response},
};

use super::{
    accept::{accepted, weight},
    forwarded::WithoutSlash,
    reply::is_grpc,
};

/// The header by which a browser says what it asks for.
const FETCH_MODE: HeaderName = HeaderName::from_static("sec-fetch-mode");
/// The header by which an answer says which sites may embed it.
const RESOURCE_POLICY: HeaderName = HeaderName::from_static("cross-origin-resource-policy");

/// Adds the headers for browsers to an answer over REST. `is_shared`: pages of other origins may use the service.
pub(super) async fn for_browsers(
    State(is_shared): State<bool>,
    request: Request,
    next: Next,
) -> Response {
    let (grpc, opens_page) = (is_grpc(&request), opens_page(request.headers()));
    if request.extensions().get::<WithoutSlash>().is_some() && opens_page {
        let prefix = base::address::link("/");
        return Redirect::permanent(&prefix).into_response();
    }
    let mut response = next.run(request).await;
    if grpc {
        return response;
    }
    let is_refused = response.status() == StatusCode::UNAUTHORIZED;
    let headers = response.headers_mut();
    if is_refused && opens_page {
        // on a line of its own: of two ways on one line Chromium reads the first only
        const BASIC: HeaderValue = HeaderValue::from_static(
            "Basic realm=\"signorini: any name, and a token as the password\", charset=\"UTF-8\"",
        );
        headers.append(header::WWW_AUTHENTICATE, BASIC);
    }
    const NO_GUESSING: HeaderValue = HeaderValue::from_static("nosniff");
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, NO_GUESSING);
    headers
        .entry(header::CACHE_CONTROL)
        .or_insert(HeaderValue::from_static("private, no-cache"));
    if !is_shared {
        headers.insert(RESOURCE_POLICY, HeaderValue::from_static("same-origin"));
    }
    response
}

/// Whether a person opens the address in a browser. A script of a page asks by itself for a token: the browser's own
/// question for a password would cover the page at every request. Over plain HTTP browsers do not say what they ask for.
fn opens_page(headers: &HeaderMap) -> bool {
    match headers.get(FETCH_MODE) {
        Some(mode) => mode == "navigate",
        None => {
            let (q, specific, _) = weight(&accepted(headers), "text/html");
            q > 0.0 && specific == 3
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_password_is_asked_of_a_person_and_not_of_a_script() {
        let opens = |sent: &[(HeaderName, &'static str)]| {
            let sent = sent.iter().cloned();
            opens_page(
                &sent
                    .map(|(name, value)| (name, HeaderValue::from_static(value)))
                    .collect(),
            )
        };
        let page = "text/html,application/xhtml+xml,*/*;q=0.8";
        assert!(opens(&[(header::ACCEPT, page)]));
        assert!(opens(&[(FETCH_MODE, "navigate")]));
        for script in [
            &[(header::ACCEPT, "*/*")][..],
            &[(header::ACCEPT, "text/*")],
            &[(header::ACCEPT, "image/svg+xml,image/*")],
            &[(FETCH_MODE, "cors"), (header::ACCEPT, page)],
            &[],
        ] {
            assert!(!opens(script), "{script:?}");
        }
    }
}
