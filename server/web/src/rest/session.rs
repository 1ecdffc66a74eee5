//! Sessions of browsers: a token becomes a cookie that scripts cannot read, and that the browser sends with every request
//! to this service: also for streams, figures and downloads, where a page cannot send a token.
//!
//! The cookie is the token itself, so that a session ends with its token, and needs no record. Each token has a cookie
//! of its own name, since browsers send the cookies of all services at one host, whatever their ports.

use axum::{
    body::Body,
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use base::{time::Time, token::Presented};
use schemars::JsonSchema;
use serde::Serialize;
use service::error::ApiError;

use super::{
    bodies,
    body::{self, content_type},
    call::Call,
};

/// What the name of a cookie begins with, before the id of its token.
const PREFIX: &str = "signorini-";
/// The longest time that a session lasts (seconds).
const MOST_S: f64 = 12.0 * 3600.0;
/// The largest size of a log-in (bytes).
const MOST_BYTES: usize = 16 << 10;
/// The media type of a form.
const FORM: &str = "application/x-www-form-urlencoded";
/// The page, from the address to which a form is sent.
const PAGE: &str = "../";

/// A session that has begun.
#[derive(Serialize, JsonSchema)]
pub(super) struct Session {
    /// The owner of the jobs that are submitted in the session.
    owner: String,
    /// When the session ends, if its token does not end before.
    expires_at: Time,
}

/// The log-in of a browser.
struct LogIn {
    token: String,
    /// The part of the page to return to: `#` and what follows, or nothing.
    part: String,
    /// Whether a form was sent, which is answered with the page.
    is_form: bool,
}

/// The tokens in the cookies of a request. A page of another site, or of another service at the same host, has none.
pub(super) fn cookies(headers: &HeaderMap) -> Vec<Presented> {
    const SITE: &str = "sec-fetch-site";
    let site = headers.get(SITE).map(HeaderValue::as_bytes);
    if !matches!(site, None | Some(b"same-origin" | b"none")) {
        return vec![];
    }
    let sent = headers.get_all(header::COOKIE).iter();
    let pairs = sent.filter_map(|line| line.to_str().ok());
    let pairs = pairs.flat_map(|line| line.split(';'));
    let tokens = pairs.filter_map(|pair| {
        let (name, value) = pair.trim().split_once('=')?;
        let id = name.strip_prefix(PREFIX)?;
        Presented::parse(value).filter(|token| token.id == id)
    });
    tokens.collect()
}

/// Begins a session: the answer sets its cookie.
pub(super) async fn create_session(mut call: Call) -> Result<Response, ApiError> {
    const WRONG: &str = "the token is unknown, was revoked or has expired";
    let log_in = read(&mut call).await?;
    let (store, now) = (&call.service.store, Time::of_the_machine());
    let presented = Presented::parse(log_in.token.trim());
    let found = presented.and_then(|presented| store.find_token(&presented, now));
    let Some(token) = found else {
        return if log_in.is_form {
            Ok(to_page(&format!("?login=failed{}", log_in.part)))
        } else {
            Err(ApiError::Unauthenticated(WRONG))
        };
    };
    let longest = now.after_s(MOST_S);
    let expires_at = token.expires_at.map_or(longest, |end| end.min(longest));
    let seconds = now.seconds_until(expires_at).max(0.0) as u64;
    let mut response = if log_in.is_form {
        to_page(&log_in.part)
    } else {
        let owner = token.owner.clone();
        (
            StatusCode::CREATED,
            axum::Json(Session { owner, expires_at }),
        )
            .into_response()
    };
    let others = cookies(&call.headers);
    let others = others.iter().filter(|other| other.id != token.id);
    for other in others.filter(|other| store.find_token(other, now).is_some()) {
        set(&mut response, &call, &other.id, "", 0)?;
    }
    set(
        &mut response,
        &call,
        &token.id,
        log_in.token.trim(),
        seconds,
    )?;
    let headers = response.headers_mut();
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    Ok(response)
}

/// Ends the sessions of a browser with this service: the answer removes their cookies.
pub(super) async fn delete_session(call: Call) -> Result<Response, ApiError> {
    let mut response = StatusCode::NO_CONTENT.into_response();
    let (store, now) = (&call.service.store, Time::of_the_machine());
    let own = cookies(&call.headers);
    // not those of another service at this host
    for token in own
        .iter()
        .filter(|token| store.find_token(token, now).is_some())
    {
        set(&mut response, &call, &token.id, "", 0)?;
    }
    Ok(response)
}

/// Adds the cookie of a token to an answer; without a value it is removed.
fn set(
    response: &mut Response,
    call: &Call,
    id: &str,
    value: &str,
    seconds: u64,
) -> Result<(), ApiError> {
    let path = match call.service.config.web.path_prefix.as_str() {
        "" => "/",
        prefix => prefix,
    };
    let secure = if call.https { "; Secure" } else { "" };
    let cookie = format!(
        "{PREFIX}{id}={value}; Path={path}; HttpOnly; SameSite=Strict; Max-Age={seconds}{secure}"
    );
    let cookie = HeaderValue::try_from(cookie).map_err(ApiError::internal)?;
    response.headers_mut().append(header::SET_COOKIE, cookie);
    Ok(())
}

/// Sends a browser back to the page after it has sent a form.
fn to_page(part: &str) -> Response {
    let to = HeaderValue::try_from(format!("{PAGE}{part}"));
    let to = to.unwrap_or(HeaderValue::from_static(PAGE));
    (StatusCode::SEE_OTHER, [(header::LOCATION, to)]).into_response()
}

/// Reads a log-in: a form, or JSON.
async fn read(call: &mut Call) -> Result<LogIn, ApiError> {
    if content_type(&call.headers) != FORM {
        let token = bodies::session(&call.json().await?)?;
        return Ok(LogIn {
            token,
            part: String::new(),
            is_form: false,
        });
    }
    let body = std::mem::replace(&mut call.body, Body::empty());
    let text = body::json_text(&call.headers, body, MOST_BYTES, &call.received).await?;
    let fields: Vec<(String, String)> = form_urlencoded::parse(text.as_bytes())
        .into_owned()
        .collect();
    let field = |wanted: &str| {
        let mut named = fields.iter().filter(|(name, _)| name == wanted);
        named
            .next()
            .map(|(_, value)| value.clone())
            .unwrap_or_default()
    };
    // only a part of the page itself: another address would lead people to another site
    let is_part =
        |part: &String| part.starts_with('#') && part.bytes().all(|byte| byte.is_ascii_graphic());
    Ok(LogIn {
        token: field("token"),
        part: Some(field("part")).filter(is_part).unwrap_or_default(),
        is_form: true,
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use base::token::Secret;

    use super::*;

    #[test]
    fn cookies_of_other_services_and_for_other_sites_are_left_out() {
        let (secret, _) = Secret::new("0123456789ab").unwrap();
        let token = secret.reveal();
        let found = |cookie: &str, site: Option<&'static str>| {
            let mut headers = HeaderMap::new();
            headers.insert(header::COOKIE, cookie.parse().unwrap());
            if let Some(site) = site {
                headers.insert("sec-fetch-site", HeaderValue::from_static(site));
            }
            cookies(&headers).len()
        };
        let own = format!("theme=dark; {PREFIX}0123456789ab={token}");
        assert_eq!(found(&own, None), 1);
        assert_eq!(found(&own, Some("same-origin")), 1);
        assert_eq!(found(&own, Some("none")), 1);
        assert_eq!(found(&own, Some("same-site")), 0);
        assert_eq!(found(&own, Some("cross-site")), 0);
        assert_eq!(found(&format!("{PREFIX}ba9876543210={token}"), None), 0);
        assert_eq!(found("a=b; =; ;;signorini-=", None), 0);
    }
}
