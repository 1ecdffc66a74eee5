//! The activity of one connection: its open requests, and for how long it has had none.

use parking_lot::{Mutex, MutexGuard};
use std::{collections::HashMap, sync::Arc, time::Duration};

use axum::body::Bytes;
use service::pace::Pace;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

/// The longest time for the head of a request, from its first byte or from the opening of the connection.
const LONGEST_HEAD: Duration = Duration::from_secs(30);
/// How long a connection without a request is kept open.
const LONGEST_IDLE: Duration = Duration::from_secs(75);
/// How often a connection is checked for requests that do not come and for answers that are not read.
const INTERVAL: Duration = Duration::from_secs(5);

/// The activity of one connection.
#[derive(Debug)]
pub(super) struct Activity {
    state: Mutex<State>,
    /// Canceled when the connection must be closed at once.
    cut: CancellationToken,
}

#[derive(Debug)]
struct State {
    /// The requests whose answers are not complete, with the speed at which the client reads these answers.
    under_way: HashMap<u64, Arc<Mutex<Delivery>>>,
    last: u64,
    /// The time when the last open request ended; until the first request, the time when the connection was opened.
    idle_since: Instant,
    /// The time at which the connection is closed if no request has begun by then.
    deadline: Instant,
}

/// An open request, until its answer is sent to the last byte or given up; then it is dropped.
#[derive(Debug)]
pub(super) struct UnderWay {
    activity: Arc<Activity>,
    number: u64,
    delivery: Arc<Mutex<Delivery>>,
}

/// The progress of sending one answer.
#[derive(Debug, Default)]
struct Delivery {
    pace: Pace,
    /// The number of the answer's pieces that wait to be sent.
    waiting: usize,
}

/// A piece of an answer. It is dropped when it is sent, or no longer needed.
struct Piece {
    bytes: Bytes,
    under_way: Arc<UnderWay>,
}

impl Activity {
    pub(super) fn new() -> Arc<Activity> {
        let now = Instant::now();
        Arc::new(Activity {
            state: Mutex::new(State {
                under_way: HashMap::new(),
                last: 0,
                idle_since: now,
                deadline: now + LONGEST_HEAD,
            }),
            cut: CancellationToken::new(),
        })
    }

    /// Records that a request has arrived.
    pub(super) fn begin(self: &Arc<Self>) -> UnderWay {
        let mut state = self.state();
        state.last += 1;
        let (number, delivery) = (state.last, Arc::<Mutex<Delivery>>::default());
        state.under_way.insert(number, delivery.clone());
        UnderWay {
            activity: self.clone(),
            number,
            delivery,
        }
    }

    /// Records that bytes have arrived. If no request is open they are the beginning of a request's head.
    pub(super) fn received(&self) {
        let mut state = self.state();
        if state.under_way.is_empty() {
            state.deadline = state.deadline.min(Instant::now() + LONGEST_HEAD);
        }
    }

    /// The time since which the connection has had no open request; `None` while it has one.
    pub(super) fn idle_since(&self) -> Option<Instant> {
        let state = self.state();
        state.under_way.is_empty().then_some(state.idle_since)
    }

    /// Waits until no request has begun for too long.
    pub(super) async fn idle_too_long(&self) {
        self.until(|state, now| state.under_way.is_empty() && now >= state.deadline)
            .await;
    }

    /// Waits until the client reads an answer too slowly.
    pub(super) async fn is_read_too_slowly(&self) {
        let slow = |delivery: &Arc<Mutex<Delivery>>| locked(delivery).pace.is_too_slow();
        self.until(|state, _| state.under_way.values().any(slow))
            .await;
    }

    async fn until(&self, reached: impl Fn(&State, Instant) -> bool) {
        while !reached(&self.state(), Instant::now()) {
            tokio::time::sleep(INTERVAL).await;
        }
    }

    /// Makes the connection close at once.
    pub(super) fn cut(&self) {
        self.cut.cancel();
    }

    /// Waits until the connection must be closed at once.
    pub(super) async fn is_cut(&self) {
        self.cut.cancelled().await;
    }

    fn state(&self) -> MutexGuard<'_, State> {
        locked(&self.state)
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock()
}

impl UnderWay {
    /// Wraps bytes of the request's answer that wait to be sent: the request is open until they are sent, although
    /// hyper may have dropped the answer's body.
    pub(super) fn deliver(self: &Arc<Self>, bytes: Bytes) -> Bytes {
        let mut delivery = locked(&self.delivery);
        delivery.waiting += 1;
        delivery.pace.wait();
        let under_way = self.clone();
        Bytes::from_owner(Piece { bytes, under_way })
    }
}

impl AsRef<[u8]> for Piece {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

impl Drop for Piece {
    fn drop(&mut self) {
        let mut delivery = locked(&self.under_way.delivery);
        delivery.pace.advance(self.bytes.len());
        delivery.waiting -= 1;
        if delivery.waiting > 0 {
            delivery.pace.wait();
        }
    }
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        let mut state = self.activity.state();
        state.under_way.remove(&self.number);
        state.idle_since = Instant::now();
        state.deadline = state.idle_since + LONGEST_IDLE;
    }
}

#[cfg(test)]
mod tests {
    use tokio::time::timeout;

    use super::*;

    const SHORT: Duration = Duration::from_secs(20);
    const LONG: Duration = Duration::from_secs(1000);

    #[tokio::test(start_paused = true)]
    async fn a_connection_without_a_request_ends() {
        let activity = Activity::new();
        assert!(timeout(SHORT, activity.idle_too_long()).await.is_err());
        assert!(timeout(SHORT, activity.idle_too_long()).await.is_ok());
    }

    #[tokio::test(start_paused = true)]
    async fn a_request_may_take_its_time_and_the_next_one_may_come_later() {
        let activity = Activity::new();
        let request = activity.begin();
        assert!(timeout(LONG, activity.idle_too_long()).await.is_err());
        drop(request);
        assert!(timeout(2 * SHORT, activity.idle_too_long()).await.is_err());
        // half a head
        activity.received();
        assert!(timeout(SHORT, activity.idle_too_long()).await.is_err());
        assert!(timeout(SHORT, activity.idle_too_long()).await.is_ok());
    }

    #[tokio::test(start_paused = true)]
    async fn an_answer_that_nobody_reads_ends_the_connection() {
        let activity = Activity::new();
        let request = Arc::new(activity.begin());
        assert!(timeout(LONG, activity.is_read_too_slowly()).await.is_err());
        drop(request.deliver(Bytes::from_static(b"sent")));
        assert!(timeout(LONG, activity.is_read_too_slowly()).await.is_err());
        let piece = request.deliver(Bytes::from_static(b"waits"));
        // hyper drops the body when it has taken the last piece
        drop(request);
        assert!(
            timeout(2 * SHORT, activity.is_read_too_slowly())
                .await
                .is_err()
        );
        assert!(
            timeout(2 * SHORT, activity.is_read_too_slowly())
                .await
                .is_ok()
        );
        drop(piece);
        assert!(activity.idle_since().is_some());
    }
}
