//! Checks where a browser's request comes from: it must name a host for which this service answers, and not come from a
//! page of another site. Otherwise any page that a user opens could submit, cancel and read jobs with that user's
//! access: by a form or a script, or after leading its own host name to the address of this service (DNS rebinding).

use std::{
    net::{Ipv4Addr, Ipv6Addr},
    sync::{Arc, LazyLock},
    time::Duration,
};

use axum::{
    extract::{Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, Method, Version, header, uri::Authority},
    middleware::Next,
    response::Response,
};
use service::{
    config::{ProxyTrust, Web},
    error::ApiError,
    verbs::Service,
};
use tower_http::cors::CorsLayer;

use super::{
    forwarded,
    reply::{is_grpc, refusal},
};

/// Whether the client of a request has used https, as far as is known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Https(pub(super) bool);

/// Refuses requests that name no host or a host of others, or that come from a page of another site.
pub(super) async fn own_site(
    State(service): State<Arc<Service>>,
    mut request: Request,
    next: Next,
) -> Response {
    let config = &service.config;
    match check(&request, &config.web, &config.trust, config.tls.is_on()) {
        Ok(()) => {
            let https = forwarded::https(&request, &config.trust).unwrap_or(config.tls.is_on());
            request.extensions_mut().insert(Https(https));
            next.run(request).await
        }
        Err(error) => refusal(is_grpc(&request), request.uri().path(), error),
    }
}

/// Returns an error if a request names no host or a host of others, or comes from a page of another site. `tls`:
/// whether the service itself uses TLS.
fn check(request: &Request, web: &Web, trust: &ProxyTrust, tls: bool) -> Result<(), ApiError> {
    // the one that is believed has talked to the browser: its account replaces the name that it calls us by
    let named = host_of(request)?;
    let Some(host) = forwarded::host(request, trust)?.or(named) else {
        // HTTP/1.0: no browser, which would name both
        return if request.headers().contains_key(header::ORIGIN) {
            Err(ApiError::Forbidden(
                "the request names an origin and no host".into(),
            ))
        } else {
            Ok(())
        };
    };
    if !is_own_host(&host, web) {
        return Err(ApiError::Forbidden(format!(
            "the request names the host {:?}, for which this service does not answer; its administrator can allow it with \
             --allowed-host",
            shortened(host.as_str())
        )));
    }
    let https = forwarded::https(request, trust).unwrap_or(tls);
    check_origin(request.headers(), (https, &host), web)
}

/// The host that a request names. By RFC 9112, 3.2 a request over HTTP/1.1 has exactly one Host header; two could mean
/// different things to a proxy and to this service.
fn host_of(request: &Request) -> Result<Option<Authority>, ApiError> {
    let hosts: Vec<_> = request.headers().get_all(header::HOST).iter().collect();
    let authority = request.uri().authority();
    let wrong = |what: &str| Err(ApiError::BadRequest(what.into()));
    let named = match hosts[..] {
        [] if request.version() == Version::HTTP_11 => {
            return wrong("the request has no Host header");
        }
        [] => {
            return match authority.map(|named| forwarded::authority(named.as_str().as_bytes())) {
                Some(None) => wrong("the address does not name a host"),
                found => Ok(found.flatten()),
            };
        }
        [host] => host,
        _ => return wrong("the request has several Host headers"),
    };
    match authority {
        Some(authority) if authority.as_str().as_bytes() != named.as_bytes() => {
            wrong("the Host header differs from the authority of the address")
        }
        _ => match forwarded::authority(named.as_bytes()) {
            Some(host) => Ok(Some(host)),
            None => wrong("the Host header is not a host"),
        },
    }
}

/// Whether a host is this service's own: a numeric address or a name that this machine has for itself, neither of which
/// another site can use for itself, or an allowed host.
fn is_own_host(host: &Authority, web: &Web) -> bool {
    static MACHINE: LazyLock<String> = LazyLock::new(|| {
        let system = rustix::system::uname();
        system.nodename().to_string_lossy().to_ascii_lowercase()
    });
    let name = host.host().to_ascii_lowercase();
    let number = name.trim_start_matches('[').trim_end_matches(']');
    number.parse::<Ipv4Addr>().is_ok()
        || number.parse::<Ipv6Addr>().is_ok()
        || name == "localhost"
        || name.ends_with(".localhost")
        || (!MACHINE.is_empty() && name == *MACHINE)
        || web.allowed_hosts.iter().any(|allowed| {
            allowed.eq_ignore_ascii_case(&name) || allowed.eq_ignore_ascii_case(host.as_str())
        })
}

/// Checks the origin of a page, which a browser adds to all but the safest requests. If clients reach the service by
/// https, a page that was loaded by http does not count as the service's own: anyone on the way may have changed the
/// page.
fn check_origin(
    headers: &HeaderMap,
    (https, host): (bool, &Authority),
    web: &Web,
) -> Result<(), ApiError> {
    for origin in headers.get_all(header::ORIGIN) {
        let text = String::from_utf8_lossy(origin.as_bytes()).to_ascii_lowercase();
        let own = text
            .strip_prefix("https://")
            .or(text.strip_prefix("http://").filter(|_| !https))
            .is_some_and(|page| page.eq_ignore_ascii_case(host.as_str()));
        if !own && !web.allowed_origins.contains(&text) {
            return Err(ApiError::Forbidden(format!(
                "the request comes from a page of {:?}, and not of this service; its administrator can allow that with \
                 --allowed-origin",
                shortened(&text)
            )));
        }
    }
    Ok(())
}

/// The headers that pages of the allowed origins may send.
const SENT: [&str; 13] = [
    "accept",
    "authorization",
    "content-encoding",
    "content-type",
    "idempotency-key",
    "if-match",
    "if-none-match",
    "if-range",
    "last-event-id",
    "prefer",
    "range",
    "traceparent",
    "x-request-id",
];
/// The headers that pages of the allowed origins may read.
const READ: [&str; 13] = [
    "accept-ranges",
    "content-digest",
    "content-disposition",
    "content-range",
    "etag",
    "idempotency-replayed",
    "location",
    "next-page-token",
    "preference-applied",
    "result-available",
    "retry-after",
    "signorini-version",
    "x-request-id",
];

/// The headers that make browsers show answers to pages of the allowed origins; `None` if there are none.
pub(super) fn cors(web: &Web) -> Option<CorsLayer> {
    const LASTS: Duration = Duration::from_secs(3600);
    let names = |names: &[&'static str]| -> Vec<HeaderName> {
        names
            .iter()
            .map(|name| HeaderName::from_static(name))
            .collect()
    };
    let origins = web.allowed_origins.iter();
    let origins: Vec<HeaderValue> = origins.filter_map(|origin| origin.parse().ok()).collect();
    (!origins.is_empty()).then(|| {
        CorsLayer::new()
            .allow_origin(origins)
            .allow_methods([
                Method::GET,
                Method::POST,
                Method::PUT,
                Method::PATCH,
                Method::DELETE,
            ])
            .allow_headers(names(&SENT))
            .expose_headers(names(&READ))
            .max_age(LASTS)
    })
}

fn shortened(text: &str) -> String {
    solver::error::shortened(text, 100)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use axum::body::Body;

    use super::*;
    use crate::rest::operations;
    use base::caller::Peer;
    use service::parameters::{Description, Location};

    fn request(version: Version, address: &str, headers: &[(&str, &str)]) -> Request {
        let mut request = Request::builder().version(version).uri(address);
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        request.body(Body::empty()).unwrap()
    }

    #[test]
    fn a_request_has_one_host() {
        let check = |version: Version, address: &str, hosts: &[&str]| {
            let hosts: Vec<_> = hosts.iter().map(|host| ("host", *host)).collect();
            check(
                &request(version, address, &hosts),
                &Web::default(),
                &ProxyTrust::default(),
                false,
            )
            .is_ok()
        };
        assert!(check(Version::HTTP_11, "/", &["localhost"]));
        assert!(!check(Version::HTTP_11, "/", &[]));
        assert!(!check(Version::HTTP_11, "/", &["localhost", "localhost"]));
        assert!(!check(Version::HTTP_11, "/", &["local host"]));
        assert!(check(Version::HTTP_10, "/", &[]));
        assert!(check(Version::HTTP_2, "http://localhost/", &[]));
        assert!(check(Version::HTTP_2, "http://localhost/", &["localhost"]));
        assert!(!check(Version::HTTP_2, "http://localhost/", &["127.0.0.1"]));
    }

    #[test]
    fn a_host_is_a_number_or_a_name_that_is_known() {
        let web = Web {
            allowed_hosts: vec!["lab.example".into(), "other.example:81".into()],
            ..Web::default()
        };
        let allowed = |host: &str| {
            let request = request(Version::HTTP_11, "/", &[("host", host)]);
            check(&request, &web, &ProxyTrust::default(), false).is_ok()
        };
        for own in [
            "127.0.0.1:8080",
            "192.168.0.7",
            "[::1]:8080",
            "LOCALHOST:1",
            "a.localhost",
            "lab.example",
            "Lab.Example:8443",
            "other.example:81",
        ] {
            assert!(allowed(own), "{own}");
        }
        for foreign in [
            "evil.example",
            "127.0.0.1.evil.example",
            "localhost.evil.example",
            "lab.example.evil.example",
            "other.example:82",
            "evillab.example",
        ] {
            assert!(!allowed(foreign), "{foreign}");
        }
    }

    #[test]
    fn a_page_of_another_origin_is_refused() {
        let web = Web {
            allowed_origins: vec!["https://dashboard.example".into()],
            ..Web::default()
        };
        let allowed = |origin: &str| {
            let headers = [("host", "127.0.0.1:8080"), ("origin", origin)];
            check(
                &request(Version::HTTP_11, "/", &headers),
                &web,
                &ProxyTrust::default(),
                false,
            )
            .is_ok()
        };
        for own in [
            "http://127.0.0.1:8080",
            "https://127.0.0.1:8080",
            "https://dashboard.example",
        ] {
            assert!(allowed(own), "{own}");
        }
        for foreign in [
            "null",
            "http://127.0.0.1:8081",
            "http://127.0.0.1",
            "http://dashboard.example",
            "https://evil.example",
            "https://dashboard.example.evil.example",
            "",
        ] {
            assert!(!allowed(foreign), "{foreign}");
        }
    }

    #[test]
    fn where_clients_come_by_https_a_page_by_http_is_not_our_own() {
        let trust = ProxyTrust::of(&["10.0.0.1"]);
        let allowed = |origin: &str, tls: bool, peer: &str, told: &[(&str, &str)]| {
            let headers = [&[("host", "lab.localhost"), ("origin", origin)][..], told].concat();
            let mut request = request(Version::HTTP_11, "/", &headers);
            let peer = Peer(peer.parse().unwrap());
            request.extensions_mut().insert(peer);
            check(&request, &Web::default(), &trust, tls).is_ok()
        };
        let forwarded = |tls: bool, peer: &str, told: &[(&str, &str)]| {
            assert!(allowed("https://lab.localhost", tls, peer, told));
            allowed("http://lab.localhost", tls, peer, told)
        };
        assert!(forwarded(false, "10.0.0.2", &[]));
        assert!(!forwarded(true, "10.0.0.2", &[]));
        for told in [
            ("forwarded", "host=lab.localhost;proto=https"),
            ("x-forwarded-proto", "https"),
            ("x-forwarded-proto", "http, HTTPS"),
        ] {
            assert!(!forwarded(false, "10.0.0.1", &[told]), "{told:?}");
            assert!(forwarded(false, "10.0.0.2", &[told]), "no proxy: {told:?}");
        }
        // TLS from the proxy to the service only
        assert!(forwarded(
            true,
            "10.0.0.1",
            &[("x-forwarded-proto", "http")]
        ));
    }

    /// Pages of allowed origins may use every header of the operations, except those that browsers send and show
    /// anyway.
    #[test]
    fn pages_of_allowed_origins_may_use_every_header_of_the_operations() {
        const ALWAYS: [&str; 3] = ["cache-control", "content-type", "content-length"];
        for operation in operations::all() {
            let in_header = |one: &&Description| one.location == Location::Header;
            for sent in operation.parameters.iter().filter(in_header) {
                let name = sent.name.to_ascii_lowercase();
                assert!(SENT.contains(&&*name), "{} sends {name}", operation.id);
            }
            let answers = operation.answers.iter().flat_map(|answer| &answer.headers);
            for (read, _) in answers {
                let name = read.name.to_ascii_lowercase();
                let shown = READ.contains(&&*name) || ALWAYS.contains(&&*name);
                assert!(shown, "{} answers with {name}", operation.id);
            }
        }
        // of any body, and of files
        assert!(SENT.contains(&"content-encoding") && READ.contains(&"content-disposition"));
    }
}
