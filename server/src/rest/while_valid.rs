//! Answers that end with what identified their caller, a token for instance: a stream of events may stay open for days.

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
use tokio::time::{Instant, Interval, MissedTickBehavior, interval, sleep};

use crate::{
    error::ApiError,
    store::Store,
    verbs::{identify::By, tokens::TokensChanged},
};

/// How often it is looked whether the caller is still who they were.
const INTERVAL: Duration = Duration::from_secs(1);
const NO_LONGER: &str = "the token was revoked or has expired";

/// The answer, which is cut when what identified its caller is no longer valid; an error if that happens before, as the
/// handler may wait for a minute.
pub(super) async fn while_valid(
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
        Body::new(WhileValid {
            body,
            store,
            by,
            looked: Instant::now(),
            ticks: None,
        })
    }))
}

/// Returns when what identified a caller has been invalid for a while: who revokes their own token is answered meanwhile.
async fn invalid(store: &Store, by: &By) {
    loop {
        sleep(INTERVAL).await;
        if !by.is_valid(store) {
            sleep(INTERVAL).await;
            return;
        }
    }
}

struct WhileValid {
    body: Body,
    store: Arc<Store>,
    by: By,
    /// When it was last looked.
    looked: Instant,
    /// Since the answer had to wait for the first time: most never do.
    ticks: Option<Interval>,
}

impl WhileValid {
    fn is_valid(&mut self) -> bool {
        let due = self.looked.elapsed() >= INTERVAL;
        if due {
            self.looked = Instant::now();
        }
        !due || self.by.is_valid(&self.store)
    }
}

impl HttpBody for WhileValid {
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
