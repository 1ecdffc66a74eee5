//! Limits the bytes of requests and answers in memory, over all connections.
//!
//! Each request is limited by its own size; this module limits all of them together. Data without room are refused with
//! `overloaded` instead of waiting, since waiting requests need memory, too. Small ones have room of their own, so that
//! a job can be read, canceled and submitted while others transfer large files.

use parking_lot::Mutex;
use std::{
    error::Error,
    fmt,
    pin::Pin,
    sync::Arc,
    task::{Context, Poll, ready},
};

use axum::body::{Body, Bytes, HttpBody};
use futures_util::FutureExt;
use http_body::{Frame, SizeHint};
use http_body_util::BodyExt;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tower_http::timeout::{TimeoutBody, TimeoutError};

use crate::{
    error::ApiError,
    pace::{LONGEST_PAUSE, Pace},
};

/// The first bytes of each request, up to this number, count for the room of small requests.
const SMALL_RECEIVED: usize = 16 << 10;
/// The largest size of an answer that takes its share from the room of small answers (bytes).
const SMALL_SENT: usize = 64 << 10;
/// The room for small requests together (bytes), and the room for small answers together: each is enough for some
/// thousand at the same time.
const SMALL_BYTES: usize = 64 << 20;
/// The unit of limits in bytes, since a semaphore has a limited number of permits.
const UNIT: usize = 1 << 10;

/// A limit on the bytes in memory over all requests.
#[derive(Clone, Debug)]
pub struct Limit {
    large: Room,
    small: Room,
}

#[derive(Clone, Debug)]
struct Room {
    free: Arc<Semaphore>,
    units: u32,
}

/// A part of a limit that is in use; dropping it makes the part available again.
#[derive(Debug)]
pub struct Share(OwnedSemaphorePermit);

impl Share {
    /// Gives back the part of the share beyond this many bytes.
    pub fn shrink_to(&mut self, bytes: usize) {
        let more = self.0.num_permits().saturating_sub(bytes.div_ceil(UNIT));
        drop(self.0.split(more));
    }
}

impl Limit {
    /// A limit of this many bytes for large requests or answers, with the usual room for small ones in addition.
    pub fn new(bytes: usize) -> Limit {
        Limit {
            large: Room::new(bytes),
            small: Room::new(SMALL_BYTES),
        }
    }

    /// Takes a share of this many bytes, if they are free. A share larger than the limit takes all of it.
    pub fn take(&self, bytes: usize) -> Result<Share, ApiError> {
        self.large.take(self.large.units(bytes))
    }

    /// Takes a share of this many bytes once they are free; for callers that hold no memory while they wait.
    pub async fn wait_for(&self, bytes: usize) -> Result<Share, ApiError> {
        self.large.wait_for(self.large.units(bytes)).await
    }

    /// Whether there is room for one more small answer; asked before the work for the answer is done.
    pub fn has_room(&self) -> bool {
        self.small.free.available_permits() > 0
    }
}

impl Room {
    fn new(bytes: usize) -> Room {
        let units = u32::try_from(bytes.div_ceil(UNIT)).unwrap_or(u32::MAX);
        let permits = (units as usize).min(Semaphore::MAX_PERMITS);
        Room {
            free: Arc::new(Semaphore::new(permits)),
            units: permits as u32,
        }
    }

    fn take(&self, units: u32) -> Result<Share, ApiError> {
        let permits = self.free.clone().try_acquire_many_owned(units);
        permits.map(Share).map_err(|_| ApiError::Overloaded)
    }

    async fn wait_for(&self, units: u32) -> Result<Share, ApiError> {
        let permits = self.free.clone().acquire_many_owned(units);
        permits.await.map(Share).map_err(ApiError::internal)
    }

    fn units(&self, bytes: usize) -> u32 {
        u32::try_from(bytes.div_ceil(UNIT)).map_or(self.units, |units| units.min(self.units))
    }

    /// Enlarges a share to this many bytes; an error if they are not free.
    fn enlarge(&self, share: &mut Option<Share>, bytes: usize) -> Result<(), ApiError> {
        let held = share.as_ref().map_or(0, |share| share.0.num_permits());
        let more = (self.units(bytes) as usize).saturating_sub(held);
        if more == 0 {
            return Ok(());
        }
        let more = self.take(more as u32)?;
        match share {
            Some(share) => share.0.merge(more.0),
            None => *share = Some(more),
        }
        Ok(())
    }
}

/// Counts the data of one request that were received and are still in memory. All clones of a `Received` count
/// together.
#[derive(Clone, Debug)]
pub struct Received {
    limit: Limit,
    counted: Arc<Mutex<Counted>>,
}

#[derive(Debug, Default)]
struct Counted {
    bytes: usize,
    small: Option<Share>,
    large: Option<Share>,
}

impl Received {
    /// A count of 0 bytes for this limit.
    pub fn new(limit: &Limit) -> Received {
        Received {
            limit: limit.clone(),
            counted: Arc::default(),
        }
    }

    /// The limit that the request's data count for.
    pub fn limit(&self) -> &Limit {
        &self.limit
    }

    /// Counts more received bytes; an error if the limit has no room for them.
    pub fn count(&self, bytes: usize) -> Result<(), ApiError> {
        let mut counted = self.counted.lock();
        counted.bytes = counted.bytes.saturating_add(bytes);
        let small = counted.bytes.min(SMALL_RECEIVED);
        let large = counted.bytes - small;
        self.limit.small.enlarge(&mut counted.small, small)?;
        self.limit.large.enlarge(&mut counted.large, large)
    }

    /// Gives the request's share back, once nothing of the request is needed any more.
    pub fn release(&self) {
        *self.counted.lock() = Counted::default();
    }
}

/// Why reading a request's body failed. The `source` of this error is the gRPC status, where tonic finds it.
#[derive(Debug)]
pub struct BodyError {
    /// The error as REST answers it.
    pub error: ApiError,
    status: tonic::Status,
}

impl From<ApiError> for BodyError {
    fn from(error: ApiError) -> Self {
        BodyError {
            status: error.clone().into(),
            error,
        }
    }
}

impl fmt::Display for BodyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.error.fmt(f)
    }
}

impl Error for BodyError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        Some(&self.status)
    }
}

/// The cause of an error of reading a body, if this module ended the body; otherwise `Err` with the error.
pub fn cause(mut error: axum::Error) -> Result<ApiError, axum::Error> {
    loop {
        // each layer around a body wraps its errors once more
        let inner = error.into_inner();
        match inner.downcast::<axum::Error>() {
            Ok(wrapped) => error = *wrapped,
            Err(inner) => {
                return match inner.downcast::<BodyError>() {
                    Ok(cause) => Ok(cause.error),
                    Err(inner) => Err(axum::Error::new(inner)),
                };
            }
        }
    }
}

/// Wraps the body of a request: the wrapped body fails if it arrives too slowly, and counts its bytes for `received` as
/// they arrive, if that is given because they are kept in memory.
pub fn arriving(body: Body, received: Option<Received>) -> Body {
    if body.is_end_stream() {
        return body;
    }
    let arriving = Arriving {
        body,
        pace: Pace::default(),
        received,
    };
    let body = TimeoutBody::new(LONGEST_PAUSE, arriving);
    Body::new(body.map_err(|error| {
        if error.is::<TimeoutError>() {
            BodyError::from(ApiError::RequestTimeout).into()
        } else {
            error
        }
    }))
}

struct Arriving {
    body: Body,
    pace: Pace,
    received: Option<Received>,
}

impl Arriving {
    /// Records and counts bytes that have arrived; an error if the client is too slow or there is no room for them.
    fn check(&mut self, bytes: usize) -> Result<(), ApiError> {
        self.pace.advance(bytes);
        if self.pace.is_too_slow() {
            return Err(ApiError::RequestTimeout);
        }
        match &self.received {
            Some(received) => received.count(bytes),
            None => Ok(()),
        }
    }
}

impl HttpBody for Arriving {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let Poll::Ready(frame) = Pin::new(&mut self.body).poll_frame(context) else {
            self.pace.wait();
            return Poll::Pending;
        };
        Poll::Ready(match self.check(length(frame.as_ref())) {
            Ok(()) => frame,
            Err(error) => Some(Err(axum::Error::new(BodyError::from(error)))),
        })
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// The number of content bytes in a frame.
fn length(frame: Option<&Result<Frame<Bytes>, axum::Error>>) -> usize {
    let data = frame.and_then(|frame| frame.as_ref().ok()?.data_ref());
    data.map_or(0, Bytes::len)
}

/// A mark in the extensions of a response whose body has taken its share of the limit already.
#[derive(Clone, Copy, Debug)]
pub struct HasShare;

/// Bytes with the share of the limit that was taken before they were made.
pub fn with_own_share(bytes: Vec<u8>, mut share: Share) -> Bytes {
    share.shrink_to(bytes.len());
    Bytes::from_owner(Owner {
        bytes: bytes.into(),
        _share: Arc::new(share),
    })
}

/// What happens to an answer for which there is no room.
#[derive(Clone, Copy, Debug)]
pub enum NoRoom {
    /// The answer is refused: the client may ask again.
    Refuse,
    /// The answer waits: its request was carried out and should not be repeated.
    Wait,
}

/// Wraps the body of an answer so that its bytes hold a share of the limit until they are sent. For a stream of unknown
/// length these are the bytes that are ready at once, such as a whole gRPC answer; producers of large streams take
/// shares for their pieces themselves.
pub async fn with_share(mut body: Body, limit: &Limit, no_room: NoRoom) -> Result<Body, ApiError> {
    let exact = body.size_hint().exact();
    let mut first = None;
    let bytes = match exact {
        Some(bytes) => usize::try_from(bytes).unwrap_or(usize::MAX),
        None => {
            match body.frame().now_or_never() {
                None => return Ok(body),
                Some(None) => return Ok(Body::empty()),
                Some(Some(frame)) => first = Some(frame),
            }
            length(first.as_ref())
        }
    };
    let room = match bytes {
        ..=SMALL_SENT => &limit.small,
        _ => &limit.large,
    };
    let share = match no_room {
        _ if bytes == 0 => None,
        NoRoom::Refuse => Some(room.take(room.units(bytes))?),
        NoRoom::Wait => Some(room.wait_for(room.units(bytes)).await?),
    };
    let share = share.map(Arc::new);
    Ok(Body::new(Shared { first, body, share }))
}

struct Shared {
    /// The first piece of a stream, if it was ready; the share is for this piece alone.
    first: Option<Result<Frame<Bytes>, axum::Error>>,
    body: Body,
    share: Option<Arc<Share>>,
}

/// Bytes with their share of a limit, which is held as long as any part of them is in memory.
struct Owner {
    bytes: Bytes,
    _share: Arc<Share>,
}

impl AsRef<[u8]> for Owner {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

impl HttpBody for Shared {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let (frame, share) = match self.first.take() {
            Some(first) => (Some(first), self.share.take()),
            None => {
                let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
                (frame, self.share.clone())
            }
        };
        let owned = |bytes| match share {
            Some(_share) => Bytes::from_owner(Owner { bytes, _share }),
            None => bytes,
        };
        Poll::Ready(frame.map(|frame| frame.map(|frame| frame.map_data(owned))))
    }

    fn is_end_stream(&self) -> bool {
        self.first.is_none() && self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        match self.first {
            Some(_) => SizeHint::default(),
            None => self.body.size_hint(),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::time::Duration;

    use futures_util::StreamExt;

    use super::*;

    #[test]
    fn requests_share_a_budget_until_they_end() {
        let limit = Limit::new(100 << 10);
        let (one, other) = (Received::new(&limit), Received::new(&limit));
        one.count(SMALL_RECEIVED).unwrap();
        for _ in 0..60 {
            one.clone().count(1 << 10).unwrap();
        }
        other.count(SMALL_RECEIVED + (30 << 10)).unwrap();
        assert!(matches!(other.count(20 << 10), Err(ApiError::Overloaded)));
        // small requests are received whatever others do
        Received::new(&limit).count(SMALL_RECEIVED).unwrap();
        drop(one);
        other.count(20 << 10).unwrap();
        other.release();
        assert!(limit.take(100 << 10).is_ok());
    }

    #[test]
    fn a_request_larger_than_the_budget_takes_all_of_it() {
        let limit = Limit::new(10 << 10);
        let share = limit.take(usize::MAX).unwrap();
        assert!(limit.take(1).is_err());
        drop(share);
        assert!(limit.take(1).is_ok());
    }

    #[test]
    fn a_share_that_is_more_than_needed_is_returned_at_once() {
        let limit = Limit::new(10 << 10);
        let mut share = limit.take(8 << 10).unwrap();
        share.shrink_to(20 << 10);
        assert!(limit.take(3 << 10).is_err());
        share.shrink_to(5 << 10);
        assert!(limit.take(6 << 10).is_err());
        let rest = limit.take(5 << 10).unwrap();
        drop((share, rest));
        assert!(limit.take(10 << 10).is_ok());
    }

    #[tokio::test]
    async fn an_answer_has_its_share_as_long_as_any_of_its_bytes_is_in_memory() {
        let limit = Limit::new(200 << 10);
        let large = || Body::from(vec![7; 150 << 10]);
        let first = with_share(large(), &limit, NoRoom::Refuse).await.unwrap();
        assert!(matches!(
            with_share(large(), &limit, NoRoom::Refuse).await,
            Err(ApiError::Overloaded)
        ));
        assert!(
            with_share(Body::from(vec![7; 10 << 10]), &limit, NoRoom::Refuse)
                .await
                .is_ok()
        );
        let mut pieces = first.into_data_stream();
        let last = pieces.next().await.unwrap().unwrap().slice(1..2);
        drop(pieces);
        assert!(with_share(large(), &limit, NoRoom::Refuse).await.is_err());
        drop(last);
        assert!(with_share(large(), &limit, NoRoom::Refuse).await.is_ok());
    }

    #[tokio::test]
    async fn ready_bytes_of_a_stream_are_counted_and_small_answers_have_room_of_their_own() {
        let limit = Limit::new(200 << 10);
        let ready = || {
            let frame = Ok::<_, axum::Error>(Bytes::from(vec![7; 150 << 10]));
            Body::from_stream(futures_util::stream::iter([frame]))
        };
        let refuse = |body| with_share(body, &limit, NoRoom::Refuse);
        let first = refuse(ready()).await.unwrap();
        assert!(matches!(refuse(ready()).await, Err(ApiError::Overloaded)));
        let small = || Body::from(vec![7; SMALL_SENT]);
        let mut held = vec![];
        while let Ok(body) = refuse(small()).await {
            held.push(body);
        }
        assert_eq!(held.len(), SMALL_BYTES / SMALL_SENT);
        assert!(!limit.has_room());
        assert_eq!(first.collect().await.unwrap().to_bytes().len(), 150 << 10);
        assert!(refuse(ready()).await.is_ok());
        // what was done is answered, as soon as there is room
        let mut waits = std::pin::pin!(with_share(small(), &limit, NoRoom::Wait));
        assert!((&mut waits).now_or_never().is_none());
        drop(held);
        assert!(waits.await.is_ok() && limit.has_room());
    }

    #[tokio::test(start_paused = true)]
    async fn a_body_that_stops_arriving_ends_as_a_request_timeout() {
        let never = futures_util::stream::pending::<Result<Bytes, axum::Error>>();
        let limit = Limit::new(1 << 20);
        let body = arriving(Body::from_stream(never), Some(Received::new(&limit)));
        let error = body.into_data_stream().next().await.unwrap().unwrap_err();
        // as tonic looks for a status
        let mut source: Option<&dyn Error> = Some(&error);
        let mut status = None;
        while let Some(error) = source {
            status = status.or(error.downcast_ref::<tonic::Status>());
            source = error.source();
        }
        assert_eq!(status.unwrap().code(), tonic::Code::DeadlineExceeded);
        assert!(matches!(cause(error), Ok(ApiError::RequestTimeout)));
        // a byte a second
        let bytes = futures_util::stream::unfold((), |()| async {
            tokio::time::sleep(Duration::from_secs(1)).await;
            Some((Ok::<_, axum::Error>(Bytes::from_static(b"x")), ()))
        });
        let slow = arriving(Body::from_stream(bytes), None).into_data_stream();
        let received: Vec<_> = slow
            .take(100)
            .take_while(|piece| std::future::ready(piece.is_ok()))
            .collect()
            .await;
        assert!((55..65).contains(&received.len()), "{}", received.len());
    }
}
