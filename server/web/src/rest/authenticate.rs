//! The one place where the caller of a request is identified and the access rules of the operations are applied, for
//! both protocols, also for streams, documents and probes.

use std::{collections::BTreeMap, sync::Arc, sync::LazyLock};

use axum::{
    extract::{MatchedPath, Request, State},
    http::{HeaderMap, Method, header},
    middleware::Next,
    response::Response,
};
use base::{
    caller::{Access, Caller, Peer, RequestId, Scope},
    token::Presented,
    trace::Trace,
};
use base64::{Engine, prelude::BASE64_STANDARD};
use service::{
    error::ApiError,
    verbs::{
        Service,
        identify::{By, Credentials, Identified, identify},
    },
};

use super::{
    operations, page,
    reply::{is_grpc, refusal},
    request_target::WORKER_SERVICE,
    revocation::end_when_revoked,
    session,
};

/// Stores the caller of a request in its extensions, where handlers and rpcs read it; refuses a request that the caller
/// may not make.
pub(super) async fn authenticate(
    State(service): State<Arc<Service>>,
    mut request: Request,
    next: Next,
) -> Response {
    let (grpc, path) = (is_grpc(&request), request.uri().path().to_owned());
    let access = access(&request);
    let Identified { caller, by } = match identified(&service, &request, access) {
        Ok(identified) => identified,
        Err(error) => return refusal(grpc, &path, error),
    };
    let (trace, id) = (
        request.extensions().get::<Trace>(),
        request.extensions().get::<RequestId>(),
    );
    let caller = caller.asking(trace.cloned(), id.cloned());
    let answer = match lacks(access, &caller, &by) {
        Some(error) => Err(error),
        None => {
            request.extensions_mut().insert(caller.clone());
            end_when_revoked(next.run(request), service.store.clone(), by).await
        }
    };
    let mut answer = answer.unwrap_or_else(|error| refusal(grpc, &path, error));
    answer.extensions_mut().insert(caller); // for `request_report`
    answer
}

/// Identifies the caller of a request.
fn identified(
    service: &Service,
    request: &Request,
    access: Access,
) -> Result<Identified, ApiError> {
    let peer = request.extensions().get::<Peer>().copied();
    let user_header = service.config.trust.user_header.as_ref();
    let credentials = credentials(request.headers(), user_header);
    match identify(&service.store, &service.config.trust, peer, &credentials) {
        // also with a token that is no longer valid, as a monitor may have it
        Err(_) if access == Access::Open => Ok(Identified {
            caller: Caller::anonymous(),
            by: By::OpenOperation,
        }),
        identified => identified,
    }
}

/// The error for a caller who lacks the scope that `access` requires; `None` if the caller has it.
fn lacks(access: Access, caller: &Caller, by: &By) -> Option<ApiError> {
    let Access::Needs(scope) = access else {
        return None;
    };
    if caller.may(scope) {
        return None;
    }
    let (scope, owner): (&str, _) = (scope.into(), caller.owner());
    Some(ApiError::Forbidden(match by {
        By::Proxy => format!(
            "this needs the scope {scope}, which {owner}, whom the proxy names, does not have; an administrator can give it \
             with --proxy-scopes, or a token that has it"
        ),
        By::Token(_) | By::NoTokensNeeded | By::OpenOperation => {
            format!("this needs the scope {scope}, which the token of {owner} does not have")
        }
    }))
}

/// The access rule of a request. Requests that match no operation are answered by 404, 405 or UNIMPLEMENTED, which
/// reveals no more than `/openapi.json` of any installation.
fn access(request: &Request) -> Access {
    static OPERATIONS: LazyLock<BTreeMap<(&str, &str), Access>> = LazyLock::new(|| {
        let all = operations::all().into_iter();
        all.map(|operation| ((operation.method, operation.path), operation.access))
            .collect()
    });
    static RPCS: LazyLock<BTreeMap<&str, Access>> = LazyLock::new(|| {
        let all = operations::all().into_iter();
        all.flat_map(|operation| {
            operation
                .rpcs
                .iter()
                .map(move |rpc| (*rpc, operation.access))
        })
        .collect()
    });
    let path = request.uri().path();
    if let Some(rpc) = path.strip_prefix("/signorini.v1.JobService/") {
        return RPCS.get(rpc).copied().unwrap_or(Access::Identified);
    }
    if path.starts_with(WORKER_SERVICE) {
        return Access::Needs(Scope::Work);
    }
    if path.starts_with("/grpc.reflection.") {
        return operations::DESCRIPTION;
    }
    match path.strip_prefix("/grpc.health.v1.Health/") {
        Some("Check" | "List") => return Access::Open,
        // `Watch` never ends, and occupies a connection
        Some(_) => return Access::Identified,
        None => {}
    }
    let Some(route) = request.extensions().get::<MatchedPath>() else {
        return Access::Open; // 404
    };
    if route.as_str() == page::FILES {
        return Access::Open; // the page, without any data
    }
    let method = match request.method() {
        // answered by the handler of GET
        method if *method == Method::HEAD => "GET",
        method => method.as_str(),
    };
    match OPERATIONS.get(&(method, route.as_str())) {
        Some(access) => *access,
        // 405
        None if OPERATIONS.keys().any(|(_, known)| *known == route.as_str()) => Access::Open,
        // a route that somebody has added beside the list
        None => Access::Needs(Scope::Admin),
    }
}

/// The credentials of a request: a bearer token, or a token as the password that a browser asks for, the tokens of a
/// browser's sessions, and the users named in `user_header`.
fn credentials(headers: &HeaderMap, user_header: Option<&header::HeaderName>) -> Credentials {
    let mut sent = headers.get_all(header::AUTHORIZATION).iter();
    let token = sent.next().map(|value| {
        if sent.next().is_some() {
            return Err(()); // a proxy might have looked at the other one
        }
        let text = value.to_str().map_err(|_| ())?;
        let (scheme, rest) = text.split_once(' ').ok_or(())?;
        let rest = rest.trim();
        let token = match scheme {
            _ if scheme.eq_ignore_ascii_case("bearer") => rest.to_owned(),
            _ if scheme.eq_ignore_ascii_case("basic") => {
                let pair = BASE64_STANDARD.decode(rest).map_err(|_| ())?;
                let pair = String::from_utf8(pair).map_err(|_| ())?;
                pair.split_once(':').ok_or(())?.1.to_owned()
            }
            _ => return Err(()),
        };
        Presented::parse(&token).ok_or(())
    });
    let users = user_header.map(|name| headers.get_all(name).iter());
    Credentials {
        token,
        cookies: session::cookies(headers),
        users: users
            .into_iter()
            .flatten()
            .map(|value| String::from_utf8_lossy(value.as_bytes()).into_owned())
            .collect(),
    }
}
