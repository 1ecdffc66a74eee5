//! Answers that end with the token of their request: a stream of events may stay open for days.

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
use tokio::time::{Interval, MissedTickBehavior, interval};

use crate::{store::Store, time::Time};

/// How often a token is looked at while an answer waits for more.
const INTERVAL: Duration = Duration::from_secs(1);

/// The answer, which is cut when the token with this id is no longer valid.
pub(super) fn while_valid(answer: Response, store: Arc<Store>, token: String) -> Response {
    answer.map(|body| {
        Body::new(WhileValid {
            body,
            store,
            token,
            ticks: None,
        })
    })
}

struct WhileValid {
    body: Body,
    store: Arc<Store>,
    token: String,
    /// Since the answer had to wait for the first time: most never do.
    ticks: Option<Interval>,
}

impl HttpBody for WhileValid {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        if let Poll::Ready(frame) = Pin::new(&mut self.body).poll_frame(context) {
            return Poll::Ready(frame);
        }
        let WhileValid {
            store,
            token,
            ticks,
            ..
        } = &mut *self;
        let ticks = ticks.get_or_insert_with(|| {
            let mut ticks = interval(INTERVAL);
            ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
            ticks
        });
        // until it is pending, so that the next tick wakes this task
        while ticks.poll_tick(context).is_ready() {
            if !store.is_valid_token(token, Time::now()) {
                // an error, not an end: the client must not take what it has for all there is
                let cause = "the token was revoked or has expired";
                return Poll::Ready(Some(Err(axum::Error::new(cause))));
            }
        }
        Poll::Pending
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
