//! Serves one connection: passes its requests to the router and the answers back, until the connection ends or is
//! closed.

use std::{
    convert::Infallible,
    pin::{Pin, pin},
    sync::Arc,
    task::{Context, Poll},
    time::Duration,
};

use axum::{
    Router,
    body::{Body, Bytes, HttpBody},
    extract::Request,
    response::Response,
};
use base::{address, caller::Peer, metrics::METRICS};
use http_body::{Frame, SizeHint};
use hyper::{body::Incoming, service::service_fn};
use hyper_util::{
    rt::{TokioExecutor, TokioIo, TokioTimer},
    server::conn::auto::Builder,
};
use service::error::ApiError;
use tokio::{net::TcpStream, time::sleep};
use tokio_util::sync::CancellationToken;
use tower::ServiceExt;
use tracing::debug;

use super::{
    activity::{Activity, UnderWay},
    guarded::Guarded,
    slots::Slot,
    tls::{Stream, Tls},
};
use crate::rest;

/// The largest number of simultaneous requests on one connection; a client with more waits or opens another one.
const MOST_STREAMS: u32 = 100;
/// The number of bytes of an answer that one stream buffers until the client reads them, and the size of the pieces in
/// which answers are sent.
const PIECE_BYTES: usize = 64 << 10;
/// The largest head of a request (bytes).
const HEAD_BYTES: usize = 64 << 10;
/// The time that open requests have to finish when the client has sent no further request for too long.
const FAREWELL: Duration = Duration::from_secs(2);
/// How often a silent client over HTTP/2 is asked whether it is still there.
const PING: Duration = Duration::from_secs(60);

/// Serves a connection until it ends, is idle or stalled for too long, or is closed in favour of another one.
pub(super) async fn serve(
    (stream, peer): (TcpStream, Peer),
    tls: Option<Arc<Tls>>,
    router: Router,
    slot: Slot,
    closing: CancellationToken,
) {
    let activity = slot.activity().clone();
    let stream = match tls {
        None => Stream::Plain(stream),
        // until then no request is under way: the time for the head of the first one counts from the opening
        Some(tls) => tokio::select! {
            accepted = tls.accept(stream) => match accepted {
                Ok(stream) => stream,
                Err(error) => {
                    debug!(%error, "a connection ended in its handshake: {error}");
                    return;
                }
            },
            () = activity.is_cut() => return,
            () = activity.idle_too_long() => return,
            () = closing.cancelled() => return,
        },
    };
    let io = TokioIo::new(Guarded::new(stream, activity.clone()));
    let service = service_fn(|request: Request<Incoming>| {
        let mut request = request.map(Body::new);
        request.extensions_mut().insert(peer);
        answer(router.clone(), request, slot.is_reserved(), &activity)
    });
    let mut builder = Builder::new(TokioExecutor::new());
    builder
        .http1()
        .timer(TokioTimer::new())
        // `Activity` ends slow heads, and those of HTTP/2 as well
        .header_read_timeout(None)
        .max_buf_size(HEAD_BYTES);
    builder
        .http2()
        .timer(TokioTimer::new())
        .max_concurrent_streams(MOST_STREAMS)
        .max_send_buf_size(PIECE_BYTES)
        .keep_alive_interval(PING);
    let mut connection = pin!(builder.serve_connection(io, service));
    let ended = tokio::select! {
        ended = connection.as_mut() => ended,
        () = activity.is_cut() => return,
        () = activity.is_read_too_slowly() => {
            debug!("a connection was closed: its client reads too slowly, or not at all");
            return;
        }
        () = activity.idle_too_long() => {
            connection.as_mut().graceful_shutdown();
            tokio::select! {
                ended = connection.as_mut() => ended,
                () = sleep(FAREWELL) => return,
            }
        }
        () = closing.cancelled() => {
            connection.as_mut().graceful_shutdown();
            tokio::select! {
                ended = connection.as_mut() => ended,
                // an open connection on which nothing is asked
                () = idle_for(&activity, FAREWELL) => return,
                () = activity.is_read_too_slowly() => return,
            }
        }
    };
    if let Err(error) = ended {
        debug!(%error, "a connection ended: {error}");
    }
}

/// Waits until the connection has had no request for this time.
async fn idle_for(activity: &Activity, time: Duration) {
    while activity
        .idle_since()
        .is_none_or(|since| since.elapsed() < time)
    {
        sleep(time / 10).await;
    }
}

fn answer(
    router: Router,
    request: Request,
    reserved: bool,
    activity: &Arc<Activity>,
) -> impl Future<Output = Result<Response<Sent>, Infallible>> + use<> {
    let under_way = Arc::new(activity.begin());
    async move {
        let path = address::without_prefix(request.uri().path());
        let response = if reserved && !rest::is_probe(path) {
            METRICS.refused_connections.inc();
            rest::refuse(&request, ApiError::Overloaded)
        } else {
            match router.oneshot(request).await {
                Ok(response) => response,
                Err(never) => match never {},
            }
        };
        Ok(response.map(|body| Sent {
            body,
            rest: Bytes::new(),
            under_way,
        }))
    }
}

/// The body of an answer, in pieces whose progress is recorded.
struct Sent {
    body: Body,
    /// The part taken from `body` that is not sent yet.
    rest: Bytes,
    under_way: Arc<UnderWay>,
}

impl HttpBody for Sent {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        if self.rest.is_empty() {
            match Pin::new(&mut self.body).poll_frame(context) {
                Poll::Ready(Some(Ok(frame))) => match frame.into_data() {
                    Ok(data) => self.rest = data,
                    Err(trailers) => return Poll::Ready(Some(Ok(trailers))),
                },
                other => return other,
            }
        }
        let length = self.rest.len().min(PIECE_BYTES);
        let mut piece = self.rest.split_to(length);
        if length > 0 {
            piece = self.under_way.deliver(piece);
        }
        Poll::Ready(Some(Ok(Frame::data(piece))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest.is_empty() && self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        let of_body = self.body.size_hint();
        let rest = self.rest.len() as u64;
        match of_body.exact() {
            Some(bytes) => SizeHint::with_exact(bytes + rest),
            None => SizeHint::new(),
        }
    }
}
