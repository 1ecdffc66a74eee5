//! Bytes of requests and of answers in memory: how many at the same time, over all connections.
//!
//! One request is limited by its own size; this is the limit on all of them together. What finds no room is refused
//! with `overloaded`, and not kept waiting, since waiting requests need memory, too. Small ones are not counted, so that
//! a job can be read, canceled and submitted while others transfer large files.

use std::{
    error::Error,
    fmt,
    pin::Pin,
    sync::{Arc, Mutex, PoisonError},
    task::{Context, Poll, ready},
};

use axum::body::{Body, Bytes, HttpBody};
use http_body::{Frame, SizeHint};
use http_body_util::BodyExt;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tower_http::timeout::{TimeoutBody, TimeoutError};

use crate::error::{ApiError, LONGEST_PAUSE};

/// The first bytes of each request are not counted.
const UNCOUNTED_RECEIVED: usize = 16 << 10;
/// Answers of at most this size are not counted.
const UNCOUNTED_SENT: usize = 64 << 10;
/// Budgets are counted in units of this many bytes, since a semaphore has a limited number of permits.
const UNIT: usize = 1 << 10;

/// A limit on bytes over all requests.
#[derive(Clone, Debug)]
pub struct Budget {
    free: Arc<Semaphore>,
    units: u32,
}

/// A part of a budget, given back when it is dropped.
#[derive(Debug)]
pub struct Share(#[allow(dead_code)] OwnedSemaphorePermit);

impl Budget {
    /// A budget of so many bytes.
    pub fn new(bytes: usize) -> Budget {
        let units = u32::try_from(bytes.div_ceil(UNIT)).unwrap_or(u32::MAX);
        let permits = (units as usize).min(Semaphore::MAX_PERMITS);
        Budget {
            free: Arc::new(Semaphore::new(permits)),
            units: permits as u32,
        }
    }

    /// A share of so many bytes, if they are free. One that is larger than the budget takes all of it.
    pub fn take(&self, bytes: usize) -> Result<Share, ApiError> {
        let permits = self.free.clone().try_acquire_many_owned(self.units(bytes));
        permits.map(Share).map_err(|_| ApiError::Overloaded)
    }

    /// Waits for a share; for callers that hold no memory meanwhile.
    pub async fn wait_for(&self, bytes: usize) -> Result<Share, ApiError> {
        let permits = self.free.clone().acquire_many_owned(self.units(bytes));
        permits.await.map(Share).map_err(ApiError::internal)
    }

    fn units(&self, bytes: usize) -> u32 {
        u32::try_from(bytes.div_ceil(UNIT)).map_or(self.units, |units| units.min(self.units))
    }
}

/// What was received of one request and is still in memory. The clones of one request count together.
#[derive(Clone, Debug)]
pub struct Received {
    budget: Budget,
    counted: Arc<Mutex<Counted>>,
}

#[derive(Debug, Default)]
struct Counted {
    bytes: usize,
    shares: Vec<Share>,
}

impl Received {
    /// Nothing yet.
    pub fn new(budget: &Budget) -> Received {
        Received {
            budget: budget.clone(),
            counted: Arc::default(),
        }
    }

    /// Counts some more bytes.
    pub fn count(&self, bytes: usize) -> Result<(), ApiError> {
        let mut counted = self.counted.lock().unwrap_or_else(PoisonError::into_inner);
        let before = counted.bytes.max(UNCOUNTED_RECEIVED);
        counted.bytes = counted.bytes.saturating_add(bytes);
        let more = counted.bytes.saturating_sub(before);
        if more > 0 {
            let share = self.budget.take(more)?;
            counted.shares.push(share);
        }
        Ok(())
    }

    /// Gives the share back, when nothing of the request is needed any more.
    pub fn release(&self) {
        *self.counted.lock().unwrap_or_else(PoisonError::into_inner) = Counted::default();
    }
}

/// Why reading a body ended. Over gRPC its source is the status, which is where tonic finds it.
#[derive(Debug)]
pub struct BodyError {
    /// The error, for REST.
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

/// The error of this file that ended a body, or else the error itself.
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

/// The body of a request, which fails when nothing of it arrives for [`LONGEST_PAUSE`].
pub fn with_longest_pause(body: Body) -> Body {
    if body.is_end_stream() {
        return body;
    }
    let body = TimeoutBody::new(LONGEST_PAUSE, body);
    Body::new(body.map_err(|error| match error.is::<TimeoutError>() {
        true => BodyError::from(ApiError::RequestTimeout).into(),
        false => error,
    }))
}

/// The body of a request whose bytes are counted as they arrive.
pub fn counted(body: Body, received: Received) -> Body {
    Body::new(CountedBody { body, received })
}

struct CountedBody {
    body: Body,
    received: Received,
}

impl HttpBody for CountedBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
        if let Some(Ok(frame)) = &frame
            && let Some(bytes) = frame.data_ref()
            && let Err(error) = self.received.count(bytes.len())
        {
            return Poll::Ready(Some(Err(axum::Error::new(BodyError::from(error)))));
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

/// The body of an answer whose bytes have their share of the budget until they are sent. `Err`: there is no room.
pub fn with_share(body: Body, budget: &Budget) -> Result<Body, ApiError> {
    // the length of a stream is not known; what produces large ones takes shares for its pieces
    let bytes = body.size_hint().exact().unwrap_or(0);
    let bytes = usize::try_from(bytes).unwrap_or(usize::MAX);
    if bytes <= UNCOUNTED_SENT {
        return Ok(body);
    }
    let share = Arc::new(budget.take(bytes)?);
    Ok(Body::new(Shared { body, share }))
}

struct Shared {
    body: Body,
    share: Arc<Share>,
}

/// Bytes with their share of a budget, which they keep as long as any part of them is in memory.
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
        let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
        let owned = |bytes| {
            let _share = self.share.clone();
            Bytes::from_owner(Owner { bytes, _share })
        };
        Poll::Ready(frame.map(|frame| frame.map(|frame| frame.map_data(owned))))
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
    use futures_util::StreamExt;

    use super::*;

    #[test]
    fn requests_share_a_budget_until_they_end() {
        let budget = Budget::new(100 << 10);
        let (one, other) = (Received::new(&budget), Received::new(&budget));
        one.count(UNCOUNTED_RECEIVED).unwrap();
        for _ in 0..60 {
            one.clone().count(1 << 10).unwrap();
        }
        other.count(UNCOUNTED_RECEIVED + (30 << 10)).unwrap();
        assert!(matches!(other.count(20 << 10), Err(ApiError::Overloaded)));
        // small requests are received whatever others do
        Received::new(&budget).count(UNCOUNTED_RECEIVED).unwrap();
        drop(one);
        other.count(20 << 10).unwrap();
        other.release();
        assert!(budget.take(100 << 10).is_ok());
    }

    #[test]
    fn what_is_larger_than_the_budget_takes_all_of_it() {
        let budget = Budget::new(10 << 10);
        let share = budget.take(usize::MAX).unwrap();
        assert!(budget.take(1).is_err());
        drop(share);
        assert!(budget.take(1).is_ok());
    }

    #[tokio::test]
    async fn an_answer_has_its_share_as_long_as_any_of_its_bytes_is_in_memory() {
        let budget = Budget::new(200 << 10);
        let large = || Body::from(vec![7; 150 << 10]);
        let first = with_share(large(), &budget).unwrap();
        assert!(matches!(
            with_share(large(), &budget),
            Err(ApiError::Overloaded)
        ));
        assert!(with_share(Body::from(vec![7; 10 << 10]), &budget).is_ok());
        let mut pieces = first.into_data_stream();
        let last = pieces.next().await.unwrap().unwrap().slice(1..2);
        drop(pieces);
        assert!(with_share(large(), &budget).is_err());
        drop(last);
        assert!(with_share(large(), &budget).is_ok());
    }

    #[tokio::test(start_paused = true)]
    async fn a_body_that_stops_arriving_ends_as_a_request_timeout() {
        let never = futures_util::stream::pending::<Result<Bytes, axum::Error>>();
        let budget = Budget::new(1 << 20);
        let body = with_longest_pause(Body::from_stream(never));
        let body = counted(body, Received::new(&budget));
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
    }
}
