//! Reports every request of either protocol when its answer has ended: a line of the log, metrics, and a span.

use parking_lot::Mutex;
use std::{
    net::IpAddr,
    pin::Pin,
    sync::Arc,
    task::{Context, Poll, ready},
    time::Instant,
};

use axum::{
    body::{Body, Bytes, HttpBody},
    extract::{Request, State},
    http::{HeaderMap, HeaderName, HeaderValue},
    middleware::Next,
    response::Response,
};
use base::{
    caller::{Caller, RequestId},
    metrics::METRICS,
    time::Time,
    trace::Trace,
};
use http_body::{Frame, SizeHint};
use opentelemetry::KeyValue;
use service::{
    config::ProxyTrust,
    spans::{self, Span},
    verbs::Service,
};
use tonic::Code;
use tracing::{Level, debug, enabled, info};

use super::{
    forwarded,
    request_target::is_routine,
    request_target::{RequestTarget, UNKNOWN, name_of},
};

/// The header in which a client may give its request an id; the answer has the same header, with the id of the request.
pub(super) const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");
/// The header with the version of the service, in every answer to an identified caller, so that a client of another
/// version can explain why it does not understand an answer.
pub(super) const VERSION: HeaderName = HeaderName::from_static("signorini-version");
/// The largest length of an id that is accepted from a client.
const LONGEST_ID: usize = 64;
/// The log target of the lines about requests, for filters of the log.
const TARGET: &str = "service::request";

/// Runs a request and reports it; the answer has the id of the request.
pub(super) async fn observe(
    State(service): State<Arc<Service>>,
    mut request: Request,
    next: Next,
) -> Response {
    let mut observed = Observed::new(&request, &service.config.trust);
    request.extensions_mut().insert(observed.trace.clone());
    let id = RequestId(observed.id.clone());
    request.extensions_mut().insert(id);
    let mut response = next.run(request).await;
    observed.answered(&response);
    // strangers are not told
    if !observed.owner.is_empty() {
        let version = HeaderValue::from_static(env!("CARGO_PKG_VERSION"));
        response.headers_mut().insert(VERSION, version);
    }
    if let Ok(id) = HeaderValue::from_str(&observed.id) {
        response.headers_mut().insert(REQUEST_ID, id);
    }
    response.map(|body| Body::new(ObservedBody { body, observed }))
}

/// Counts the lines about requests of callers who are not identified, whose number is limited, since anyone who reaches
/// the service could fill its disk with them. Metrics count all of these requests, and `refused` logs the refused ones
/// by kind of error.
static BUDGET: Budget = Budget(Mutex::new(None));
/// The largest number of lines about requests of unidentified callers in each second.
const LINES: u32 = 20;

/// The beginning of the present second, and the number of lines in it.
struct Budget(Mutex<Option<(Instant, u32)>>);

impl Budget {
    fn is_used_up(&self, now: Instant) -> bool {
        let mut counted = self.0.lock();
        let second = |since: &Instant| now.saturating_duration_since(*since).as_secs() == 0;
        let (since, lines) = counted
            .take_if(|(since, _)| second(since))
            .unwrap_or((now, 0));
        *counted = Some((since, lines.saturating_add(1)));
        lines >= LINES
    }
}

/// A request, from its head to the end of its answer.
#[derive(Debug)]
struct Observed {
    target: RequestTarget,
    /// Whether the log tells it only if it fails.
    routine: bool,
    trace: Trace,
    id: String,
    /// The address of the client, as far as it is known.
    client: Option<IpAddr>,
    begun: Time,
    start: Instant,
    /// The HTTP status of the answer; `None` if the client has gone before there was one.
    status: Option<u16>,
    code: Option<Code>,
    owner: String,
    bytes: u64,
}

impl Observed {
    fn new(request: &Request, trust: &ProxyTrust) -> Observed {
        METRICS.in_progress.inc();
        let trace = Trace::of_request(request.headers());
        Observed {
            target: RequestTarget::of(request),
            routine: is_routine(request.uri().path()),
            id: given_id(request.headers()).unwrap_or_else(|| trace.id().to_string()),
            client: forwarded::client(request, trust),
            trace,
            begun: Time::now(),
            start: Instant::now(),
            status: None,
            code: None,
            owner: String::new(),
            bytes: 0,
        }
    }

    fn answered(&mut self, response: &Response) {
        self.status = Some(response.status().as_u16());
        if let Some(caller) = response.extensions().get::<Caller>() {
            self.owner = caller.owner().to_owned();
        }
        if !response.status().is_success() {
            self.code = Some(Code::Unknown); // what clients of gRPC make of an answer without a code
        }
        self.read_code(response.headers());
    }

    /// Reads the gRPC status of a call: from the head of an answer without messages, otherwise from the trailers after
    /// the messages.
    fn read_code(&mut self, headers: &HeaderMap) {
        if let Some(code) = headers.get(tonic::Status::GRPC_STATUS) {
            self.code = Some(Code::from_bytes(code.as_bytes()));
        }
    }

    fn tell(&self) {
        let took = self.start.elapsed();
        METRICS.sent_bytes.inc_by(self.bytes);
        let code = self.code.unwrap_or(Code::Cancelled); // the client did not wait for it
        if code == Code::Unauthenticated || self.status == Some(401) {
            METRICS.unauthenticated_requests.inc();
        }
        match &self.target {
            RequestTarget::Rpc(rpc) => METRICS.answered_call(rpc, name_of(code), took),
            RequestTarget::Route(method, route) => {
                METRICS.answered(method, route.as_str(), self.status.unwrap_or(0), took);
            }
            RequestTarget::NoRoute(method) => {
                METRICS.answered(method, UNKNOWN, self.status.unwrap_or(0), took);
            }
        }
        let wanted = if self.routine {
            enabled!(target: TARGET, Level::DEBUG)
        } else {
            enabled!(target: TARGET, Level::INFO)
        };
        let stranger = self.owner.is_empty();
        if wanted && !(stranger && BUDGET.is_used_up(self.start)) {
            self.log(took.as_secs_f64(), code);
        }
        if spans::are_wanted() && !self.routine {
            self.span(code).tell();
        }
    }

    fn log(&self, duration_s: f64, code: Code) {
        let Observed { bytes, id, .. } = self;
        let owner = Some(&*self.owner).filter(|owner| !owner.is_empty());
        let trace = self.trace.id().to_string();
        let trace_id = Some(&trace).filter(|trace| *trace != id);
        let client = self.client.map(tracing::field::display);
        macro_rules! tell {
            ($($fields:tt)*) => {
                if self.routine {
debug!(target: TARGET, $($fields)*)
} else {
info!(target: TARGET, $($fields)*)
}
            };
        }
        let (method, route) = match &self.target {
            RequestTarget::Rpc(rpc) => {
                let code = name_of(code);
                tell!(
                    rpc,
                    code,
                    duration_s,
                    owner,
                    client,
                    bytes,
                    request_id = id,
                    trace_id,
                    "{rpc}: {code}"
                );
                return;
            }
            RequestTarget::Route(method, route) => (method, route.as_str()),
            RequestTarget::NoRoute(method) => (method, UNKNOWN),
        };
        let status = self.status;
        let gone = || "no answer, the client has disconnected".to_owned();
        let answer = status.map_or_else(gone, |status| status.to_string());
        tell!(
            method,
            route,
            status,
            duration_s,
            owner,
            client,
            bytes,
            request_id = id,
            trace_id,
            "{method} {route}: {answer}"
        );
    }

    fn span(&self, code: Code) -> Span {
        let number = |number: u64| i64::try_from(number).unwrap_or(i64::MAX);
        let mut attributes = vec![
            KeyValue::new("http.response.body.size", number(self.bytes)),
            KeyValue::new("request.id", self.id.clone()),
        ];
        if !self.owner.is_empty() {
            attributes.push(KeyValue::new("enduser.id", self.owner.clone()));
        }
        let (name, error) = match &self.target {
            RequestTarget::Rpc(rpc) => {
                let (service, method) = rpc.split_once('/').unwrap_or((rpc, rpc));
                attributes.extend([
                    KeyValue::new("rpc.system", "grpc"),
                    KeyValue::new("rpc.service", service),
                    KeyValue::new("rpc.method", method),
                    KeyValue::new("rpc.grpc.status_code", i64::from(code as i32)),
                ]);
                let ours = matches!(
                    code,
                    Code::Unknown | Code::Internal | Code::DataLoss | Code::Unavailable
                );
                ((*rpc).into(), ours.then(|| name_of(code).to_owned()))
            }
            RequestTarget::Route(method, _) | RequestTarget::NoRoute(method) => {
                let route = match &self.target {
                    RequestTarget::Route(_, route) => route.as_str(),
                    _ => UNKNOWN,
                };
                attributes.push(KeyValue::new("http.request.method", *method));
                attributes.push(KeyValue::new("http.route", route.to_owned()));
                if let Some(status) = self.status {
                    let status = i64::from(status);
                    attributes.push(KeyValue::new("http.response.status_code", status));
                }
                let error = match self.status {
                    Some(status) if status < 500 => None,
                    Some(status) => Some(status.to_string()),
                    None => Some("the client has disconnected".to_owned()),
                };
                (format!("{method} {route}").into(), error)
            }
        };
        Span {
            trace: self.trace.clone(),
            name,
            answers: true,
            begun: self.begun,
            ended: Time::now(),
            attributes,
            error,
        }
    }
}

impl Drop for Observed {
    /// Reports the request, even if the client does not wait for the answer, or for the end of the answer.
    fn drop(&mut self) {
        METRICS.in_progress.dec();
        self.tell();
    }
}

/// The id that a client gives its request; `None` if it is not a valid one.
fn given_id(headers: &HeaderMap) -> Option<String> {
    let id = headers.get(REQUEST_ID)?.to_str().ok()?;
    let allowed = |byte: u8| byte.is_ascii_alphanumeric() || b"._-".contains(&byte);
    let short = (1..=LONGEST_ID).contains(&id.len());
    // not a token, which would then be in answers, logs and spans
    let good = short && id.bytes().all(allowed) && !id.contains("sgn_");
    good.then(|| id.to_owned())
}

/// The body of an answer, whose bytes are counted; the request ends with it, or when it is dropped.
struct ObservedBody {
    body: Body,
    observed: Observed,
}

impl HttpBody for ObservedBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
        match &frame {
            Some(Ok(frame)) => {
                if let Some(data) = frame.data_ref() {
                    self.observed.bytes += data.len() as u64;
                } else if let Some(trailers) = frame.trailers_ref() {
                    self.observed.read_code(trailers);
                }
            }
            Some(Err(_)) => self.observed.code = Some(Code::Unknown), // it is cut
            None => {}
        }
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::time::Duration;

    use super::*;

    #[test]
    fn unidentified_callers_have_a_limited_number_of_lines() {
        let (budget, start) = (Budget(Mutex::new(None)), Instant::now());
        let lines = |millis| {
            let now = start + Duration::from_millis(millis);
            (0..100).filter(|_| !budget.is_used_up(now)).count()
        };
        assert_eq!([lines(0), lines(500), lines(999)], [20, 0, 0]);
        assert_eq!([lines(1000), lines(1999), lines(5000)], [20, 0, 20]);
    }

    #[test]
    fn a_request_is_named_by_its_client_if_others_can_read_it() {
        let named = |text: &[u8]| {
            let mut headers = HeaderMap::new();
            headers.insert(REQUEST_ID, HeaderValue::from_bytes(text).unwrap());
            given_id(&headers)
        };
        assert_eq!(named(b"Run-7.a_b"), Some("Run-7.a_b".into()));
        for wrong in [
            &b""[..],
            b"a b",
            b"a\"b",
            b"\xff",
            &[b'a'; 65],
            b"sgn_2884b8f50acc_x",
        ] {
            assert_eq!(named(wrong), None, "{wrong:?}");
        }
    }
}
