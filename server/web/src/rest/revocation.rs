//! Ends answers when the token of their caller is revoked or expires: a stream of events may stay open for days.

use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
    time::Duration,
};

use axum::{
    body::{Body, Bytes, HttpBody},
    response::Response,
};
use http_body::{Frame, SizeHint};
use service::{
    error::ApiError,
    verbs::{identify::By, tokens::TokensChanged},
};
use store::Store;
use tokio::time::{Instant, Interval, MissedTickBehavior, interval, sleep};

/// How often the caller's token is checked.
const INTERVAL: Duration = Duration::from_secs(1);
const NO_LONGER: &str = "the token was revoked or has expired";

/// Awaits `answer`, and returns it with a body that is cut when the caller's token becomes invalid.
///
/// # Errors
///
/// `Unauthenticated` if the token becomes invalid before there is an answer: the handler may wait for a minute.
pub(super) async fn end_when_revoked(
    answer: impl Future<Output = Response>,
    store: Arc<Store>,
    by: By,
) -> Result<Response, ApiError> {
    let answer = tokio::select! {
        biased;
        answer = answer => answer,
        () = invalid(&store, &by) => return Err(ApiError::Unauthenticated(NO_LONGER)),
    };
    if answer.extensions().get::<TokensChanged>().is_some() {
        return Ok(answer);
    }
    if !by.is_valid(&store) {
        return Err(ApiError::Unauthenticated(NO_LONGER));
    }
    Ok(answer.map(|body| {
        Body::new(UntilRevoked {
            body,
            store,
            by,
            checked: Instant::now(),
            ticks: None,
        })
    }))
}

/// Waits until the token is invalid, and then for a short time in which a caller who revokes their own token receives
/// the answer.
async fn invalid(store: &Store, by: &By) {
    loop {
        sleep(INTERVAL).await;
        if !by.is_valid(store) {
            sleep(INTERVAL).await;
            return;
        }
    }
}

struct UntilRevoked {
    body: Body,
    store: Arc<Store>,
    by: By,
    /// When the token was last checked.
    checked: Instant,
    /// Wakes the task for the next check of the token; made when the body has to wait for the first time, which is
    /// rare.
    ticks: Option<Interval>,
}

impl UntilRevoked {
    fn is_valid(&mut self) -> bool {
        let due = self.checked.elapsed() >= INTERVAL;
        if due {
            self.checked = Instant::now();
        }
        !due || self.by.is_valid(&self.store)
    }
}

impl HttpBody for UntilRevoked {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        loop {
            if !self.is_valid() {
                // an error, not an end: the client must not take what it has for all there is
                return Poll::Ready(Some(Err(axum::Error::new(NO_LONGER))));
            }
            if let Poll::Ready(frame) = Pin::new(&mut self.body).poll_frame(context) {
                return Poll::Ready(frame);
            }
            let ticks = self.ticks.get_or_insert_with(|| {
                let mut ticks = interval(INTERVAL);
                ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
                ticks
            });
            // until it is pending, so that the next tick wakes this task
            if ticks.poll_tick(context).is_pending() {
                return Poll::Pending;
            }
        }
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
