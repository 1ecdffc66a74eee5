//! Events that keep a silent stream open through proxies, as the comments of server-sent events do.

use std::{pin::Pin, time::Duration};

use futures_util::{Stream, StreamExt, stream::unfold};
use tokio::time::timeout;
use tonic::Status;

use crate::pb::{
    Event, JobsEvent, KeepAliveEvent, SweepEvent, event::Payload as OfJob,
    jobs_event::Payload as OfJobs, sweep_event::Payload as OfSweep,
};

/// The longest silence of a stream: many proxies cut a connection after a minute.
const PAUSE: Duration = Duration::from_secs(15);

/// A stream of messages to a client.
pub(super) type Messages<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;

/// A message with the place by which a client resumes its stream: a number, or the id of an event.
pub(super) trait Numbered: Sized {
    type Place: Clone + Send;

    fn place(&self) -> Self::Place;

    /// The message that only keeps the stream open, with the place of the message before.
    fn keep_alive(place: Self::Place) -> Self;
}

impl Numbered for JobsEvent {
    type Place = String;

    fn place(&self) -> String {
        self.id.clone()
    }

    fn keep_alive(id: String) -> Self {
        let payload = Some(OfJobs::KeepAlive(KeepAliveEvent {}));
        JobsEvent { id, payload }
    }
}

impl Numbered for Event {
    type Place = i64;

    fn place(&self) -> i64 {
        self.seq
    }

    fn keep_alive(seq: i64) -> Self {
        Event {
            seq,
            payload: Some(OfJob::KeepAlive(KeepAliveEvent {})),
            ..Event::default()
        }
    }
}

impl Numbered for SweepEvent {
    type Place = i64;

    fn place(&self) -> i64 {
        self.seq
    }

    fn keep_alive(seq: i64) -> Self {
        SweepEvent {
            seq,
            payload: Some(OfSweep::KeepAlive(KeepAliveEvent {})),
            ..SweepEvent::default()
        }
    }
}

/// The stream with a message after each pause. `after`: the place after which the stream begins.
pub(super) fn kept_alive<T: Numbered<Place: 'static> + Send + 'static>(
    after: T::Place,
    messages: impl Stream<Item = Result<T, Status>> + Send + 'static,
) -> Messages<T> {
    let begin = (messages.boxed(), after);
    unfold(begin, |(mut messages, place)| async move {
        let next = match timeout(PAUSE, messages.next()).await {
            Ok(next) => next?,
            Err(_) => Ok(T::keep_alive(place.clone())),
        };
        let place = next.as_ref().map_or(place, T::place);
        Some((next, (messages, place)))
    })
    .boxed()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use futures_util::stream;

    #[tokio::test(start_paused = true)]
    async fn a_silent_stream_repeats_its_last_number_every_fifteen_seconds() {
        let first = Event {
            seq: 7,
            ..Event::default()
        };
        let begun = tokio::time::Instant::now();
        let mut messages = kept_alive(3, stream::iter([Ok(first)]).chain(stream::pending()));
        let mut seen = vec![];
        for _ in 0..3 {
            let message: Event = messages.next().await.unwrap().unwrap();
            seen.push((begun.elapsed().as_secs(), message.seq, message.payload));
        }
        let alive = || Some(OfJob::KeepAlive(KeepAliveEvent {}));
        assert_eq!(seen, [(0, 7, None), (15, 7, alive()), (30, 7, alive())]);
        // a client that resumes and hears nothing keeps its place
        let mut silent = kept_alive(7, stream::pending());
        let message: Event = silent.next().await.unwrap().unwrap();
        assert_eq!((message.seq, message.payload), (7, alive()));
    }

    #[tokio::test(start_paused = true)]
    async fn a_stream_that_ends_ends() {
        let messages = kept_alive(0, stream::iter([Ok(SweepEvent::default())]));
        assert_eq!(messages.count().await, 1);
    }
}
