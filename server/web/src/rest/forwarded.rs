//! Undoes what a proxy changes in a request: the path below which clients reach the service, and the host and scheme
//! that they have used, if the proxy is trusted (RFC 7239, or the older X-Forwarded-Host and X-Forwarded-Proto), and for the
//! log the client's address. Links are paths, which do not need it.

use std::net::{IpAddr, SocketAddr};

use axum::{
    extract::Request,
    http::{
        HeaderMap, HeaderName, Uri,
        header::{self},
        uri::{Authority, PathAndQuery},
    },
};
use base::caller::Peer;
use service::{config::ProxyTrust, error::ApiError};

/// The mark of a request for the path prefix itself, without a slash: addresses in the page would lead elsewhere.
#[derive(Clone, Copy, Debug)]
pub(super) struct WithoutSlash;

/// Removes `prefix` from the beginning of the request's path; the request is unchanged if its path does not begin with
/// it.
pub(super) fn without_prefix(mut request: Request, prefix: &str) -> Request {
    let whole = request.uri().path_and_query().cloned();
    let rest = whole.and_then(|whole| {
        let rest = whole.as_str().strip_prefix(prefix)?;
        match rest.chars().next() {
            Some('/') => PathAndQuery::try_from(rest).ok(),
            None | Some('?') => {
                request.extensions_mut().insert(WithoutSlash);
                PathAndQuery::try_from(format!("/{rest}")).ok()
            }
            Some(_) => None, // only the beginning of another name
        }
    });
    if let Some(rest) = rest {
        let mut parts = request.uri().clone().into_parts();
        parts.path_and_query = Some(rest);
        if let Ok(uri) = Uri::from_parts(parts) {
            *request.uri_mut() = uri;
        }
    }
    request
}

/// The host that the client has used, according to a trusted proxy; `None` if the proxy names none, or there is no
/// proxy.
pub(super) fn host(request: &Request, trust: &ProxyTrust) -> Result<Option<Authority>, ApiError> {
    const OLDER: HeaderName = HeaderName::from_static("x-forwarded-host");
    if !is_from_proxy(request, trust) {
        return Ok(None);
    }
    let wrong = |what: &str| Err(ApiError::BadRequest(what.to_owned()));
    // the last one is that of the proxy itself; before it stands what its client has sent
    let older = last(request.headers(), &OLDER).map(|text| text.trim().to_owned());
    let named =
        last(request.headers(), &header::FORWARDED).and_then(|text| parameter(&text, "host"));
    let text = match (named, older) {
        (Some(new), Some(old)) if !new.eq_ignore_ascii_case(&old) => {
            return wrong(
                "the headers Forwarded and X-Forwarded-Host differ: the proxy must remove the one that it does not set",
            );
        }
        (Some(text), _) | (None, Some(text)) => text,
        (None, None) => return Ok(None),
    };
    match authority(text.as_bytes()) {
        Some(host) => Ok(Some(host)),
        None => wrong("the proxy gives an invalid host"),
    }
}

/// Reads a host with an optional port, and nothing else (RFC 9110, 7.2): `Authority` also accepts users, and text after
/// an address in brackets, which is not part of `Authority::host`.
pub(super) fn authority(text: &[u8]) -> Option<Authority> {
    let named = Authority::try_from(text).ok()?;
    let rest = named.as_str().strip_prefix(named.host())?;
    let is_port = |port: &str| port.bytes().all(|byte| byte.is_ascii_digit());
    let whole = rest.is_empty() || rest.strip_prefix(':').is_some_and(is_port);
    (whole && !named.host().is_empty()).then_some(named)
}

/// Whether the client has used https, according to a trusted proxy; `None` if the proxy does not say, or there is no
/// proxy.
pub(super) fn https(request: &Request, trust: &ProxyTrust) -> Option<bool> {
    const OLDER: HeaderName = HeaderName::from_static("x-forwarded-proto");
    if !is_from_proxy(request, trust) {
        return None;
    }
    let headers = request.headers();
    let named = last(headers, &header::FORWARDED).and_then(|text| parameter(&text, "proto"));
    let scheme = named.or_else(|| last(headers, &OLDER))?;
    Some(scheme.trim().eq_ignore_ascii_case("https"))
}

/// The address of the client: that which a trusted proxy gives in X-Forwarded-For or Forwarded, or else that of the
/// connection.
pub(super) fn client(request: &Request, trust: &ProxyTrust) -> Option<IpAddr> {
    const OLDER: HeaderName = HeaderName::from_static("x-forwarded-for");
    let headers = request.headers();
    let named = || {
        let new = last(headers, &header::FORWARDED).and_then(|text| parameter(&text, "for"));
        let new = new.map(|text| address(text.trim()));
        let older = last(headers, &OLDER).map(|text| address(text.trim()));
        match (new, older) {
            // the proxy has set one of them; the other may be the client's
            (Some(new), Some(older)) if new != older => None,
            (new, older) => new.or(older)?,
        }
    };
    let peer = request.extensions().get::<Peer>().map(|peer| peer.0);
    let found = is_from_proxy(request, trust).then(named).flatten().or(peer);
    found.map(|address| address.to_canonical())
}

/// An address, with or without a port.
fn address(text: &str) -> Option<IpAddr> {
    let bare = text.trim_start_matches('[').trim_end_matches(']');
    let with_port = || text.parse::<SocketAddr>().ok().map(|address| address.ip());
    bare.parse().ok().or_else(with_port)
}

fn is_from_proxy(request: &Request, trust: &ProxyTrust) -> bool {
    let peer = request.extensions().get::<Peer>();
    peer.is_some_and(|Peer(address)| trust.includes(*address))
}

/// The last item of the list in this header.
fn last(headers: &HeaderMap, name: &HeaderName) -> Option<String> {
    let value = headers.get_all(name).iter().next_back()?;
    let text = value.to_str().ok()?;
    split(text, ',').last().map(str::to_owned)
}

/// The value of a parameter in an element of a `Forwarded` header, without its quotes.
fn parameter(element: &str, wanted: &str) -> Option<String> {
    split(element, ';').find_map(|pair| {
        let (name, value) = pair.split_once('=')?;
        let value = value.trim();
        let bare = value.strip_prefix('"').and_then(|v| v.strip_suffix('"'));
        name.trim()
            .eq_ignore_ascii_case(wanted)
            .then(|| bare.unwrap_or(value).to_owned())
    })
}

/// The parts of a text between separators outside quotes. Backslashes in quotes are not interpreted, since no host
/// needs one.
fn split(text: &str, separator: char) -> impl Iterator<Item = &str> {
    let mut quoted = false;
    text.split(move |c| {
        quoted ^= c == '"';
        c == separator && !quoted
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use axum::body::Body;

    use super::*;

    #[test]
    fn a_prefix_is_removed_where_it_is_whole() {
        let left = |uri: &str| {
            let request = Request::builder().uri(uri).body(Body::empty()).unwrap();
            without_prefix(request, "/lab").uri().to_string()
        };
        for (sent, rest) in [
            ("/lab/v1/jobs?a=/lab/b", "/v1/jobs?a=/lab/b"),
            ("/lab", "/"),
            ("/lab?a=b", "/?a=b"),
            ("/lab/lab/x", "/lab/x"),
            ("/laboratory/x", "/laboratory/x"),
            ("/v1/jobs", "/v1/jobs"),
            ("http://localhost/lab/x", "http://localhost/x"),
        ] {
            assert_eq!(left(sent), rest, "{sent}");
        }
    }

    fn told(peer: &str, headers: &[(&str, &str)]) -> Result<Option<String>, ()> {
        let mut request = Request::builder().uri("/");
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let mut request = request.body(Body::empty()).unwrap();
        let peer = Peer(peer.parse().unwrap());
        request.extensions_mut().insert(peer);
        let trust = ProxyTrust::of(&["10.0.0.1"]);
        let found = host(&request, &trust).map_err(|_| ())?;
        Ok(found.map(|host| host.to_string()))
    }

    #[test]
    fn a_trusted_proxy_tells_the_address_of_its_client() {
        let seen = |peer: &str, name: &str, value: &str| {
            let request = Request::builder().uri("/").header(name, value);
            let mut request = request.body(Body::empty()).unwrap();
            let peer = Peer(peer.parse().unwrap());
            request.extensions_mut().insert(peer);
            let found = client(&request, &ProxyTrust::of(&["10.0.0.1"]));
            found.unwrap().to_string()
        };
        let (older, new) = ("x-forwarded-for", "forwarded");
        for (peer, name, value, expected) in [
            ("10.0.0.1", older, "9.9.9.9, 192.0.2.7", "192.0.2.7"),
            ("10.0.0.1", older, "192.0.2.7:4711", "192.0.2.7"),
            (
                "10.0.0.1",
                new,
                "for=9.9.9.9, for=\"[2001:db8::1]:4711\"",
                "2001:db8::1",
            ),
            ("10.0.0.1", new, "for=\"[2001:db8::1]\"", "2001:db8::1"),
            ("10.0.0.1", older, "unknown", "10.0.0.1"),
            ("10.0.0.2", older, "192.0.2.7", "10.0.0.2"),
            ("::ffff:10.0.0.2", older, "192.0.2.7", "10.0.0.2"),
        ] {
            assert_eq!(seen(peer, name, value), expected, "{peer} {name} {value}");
        }
    }

    #[test]
    fn only_a_trusted_proxy_is_believed() {
        let proxy = |headers| told("10.0.0.1", headers);
        let lab = Ok(Some("lab.example:8443".to_owned()));
        assert_eq!(proxy(&[("x-forwarded-host", "lab.example:8443")]), lab);
        assert_eq!(
            proxy(&[(
                "forwarded",
                "for=1.2.3.4;Host=\"lab.example:8443\";proto=https"
            )]),
            lab
        );
        assert_eq!(
            proxy(&[(
                "forwarded",
                "host=evil;for=\"a,host=b\", host=\"lab.example:8443\""
            )]),
            lab
        );
        assert_eq!(
            proxy(&[("x-forwarded-host", "evil, lab.example:8443")]),
            lab
        );
        assert_eq!(proxy(&[("forwarded", "for=1.2.3.4")]), Ok(None));
        let two = [("forwarded", "host=a"), ("x-forwarded-host", "b")];
        assert_eq!(proxy(&two), Err(()));
        assert_eq!(proxy(&[("x-forwarded-host", "a b")]), Err(()));
        assert_eq!(
            told("10.0.0.2", &[("x-forwarded-host", "lab.example")]),
            Ok(None)
        );
    }
}
