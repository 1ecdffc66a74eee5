//! What happens on one connection: requests under way, and for how long there has been none.

use std::{
    collections::HashMap,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
    time::Duration,
};

use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

/// How long the head of a request may take, from its first byte or from the opening of the connection.
const LONGEST_HEAD: Duration = Duration::from_secs(30);
/// How long a connection is kept open for a further request.
const LONGEST_IDLE: Duration = Duration::from_secs(75);
/// How long a client may take to read the next piece of an answer.
const LONGEST_STALL: Duration = Duration::from_secs(60);
/// How often a connection is looked at.
const INTERVAL: Duration = Duration::from_secs(5);

/// What happens on one connection.
#[derive(Debug)]
pub(super) struct Activity {
    state: Mutex<State>,
    /// Canceled when the connection is to be closed at once.
    cut: CancellationToken,
}

#[derive(Debug)]
struct State {
    opened: Instant,
    /// The requests that are not answered completely.
    under_way: HashMap<u64, Arc<Sending>>,
    last: u64,
    /// Since when no request has been under way.
    idle_since: Instant,
    /// When the connection is to be closed if no request has begun.
    deadline: Instant,
}

/// A request under way, until its answer is sent or given up.
#[derive(Debug)]
pub(super) struct UnderWay {
    activity: Arc<Activity>,
    number: u64,
    sending: Arc<Sending>,
    opened: Instant,
}

/// Since when a piece of an answer has waited to be sent, in milliseconds after the opening of the connection; 0: none
/// waits.
#[derive(Debug, Default)]
struct Sending(AtomicU64);

impl Activity {
    pub(super) fn new() -> Arc<Activity> {
        let now = Instant::now();
        Arc::new(Activity {
            state: Mutex::new(State {
                opened: now,
                under_way: HashMap::new(),
                last: 0,
                idle_since: now,
                deadline: now + LONGEST_HEAD,
            }),
            cut: CancellationToken::new(),
        })
    }

    /// A request has arrived.
    pub(super) fn begin(self: &Arc<Self>) -> UnderWay {
        let mut state = self.state();
        state.last += 1;
        let (number, sending) = (state.last, Arc::<Sending>::default());
        state.under_way.insert(number, sending.clone());
        UnderWay {
            activity: self.clone(),
            number,
            sending,
            opened: state.opened,
        }
    }

    /// Bytes have arrived: of the head of a request, if none is under way.
    pub(super) fn received(&self) {
        let mut state = self.state();
        if state.under_way.is_empty() {
            state.deadline = state.deadline.min(Instant::now() + LONGEST_HEAD);
        }
    }

    /// Since when no request has been under way; `None` while there is one.
    pub(super) fn idle_since(&self) -> Option<Instant> {
        let state = self.state();
        state.under_way.is_empty().then_some(state.idle_since)
    }

    /// Returns when no request has begun for too long.
    pub(super) async fn idle_too_long(&self) {
        self.until(|state, now| state.under_way.is_empty() && now >= state.deadline)
            .await;
    }

    /// Returns when the client has not read the next piece of an answer for too long.
    pub(super) async fn stalled_too_long(&self) {
        let stalled = |state: &State, now: Instant| {
            let now_ms = now.duration_since(state.opened).as_millis() as u64;
            state.under_way.values().any(|sending| {
                let since = sending.0.load(Relaxed);
                since > 0 && now_ms.saturating_sub(since) > LONGEST_STALL.as_millis() as u64
            })
        };
        self.until(stalled).await;
    }

    async fn until(&self, reached: impl Fn(&State, Instant) -> bool) {
        while !reached(&self.state(), Instant::now()) {
            tokio::time::sleep(INTERVAL).await;
        }
    }

    /// Closes the connection at once.
    pub(super) fn cut(&self) {
        self.cut.cancel();
    }

    /// Returns when the connection is to be closed at once.
    pub(super) async fn is_cut(&self) {
        self.cut.cancelled().await;
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl UnderWay {
    /// A piece of the answer waits to be sent.
    pub(super) fn delivers(&self) {
        let since = self.opened.elapsed().as_millis() as u64;
        self.sending.0.store(since.max(1), Relaxed);
    }

    /// All pieces so far are sent, or soon will be: the next one is asked for.
    pub(super) fn is_asked(&self) {
        self.sending.0.store(0, Relaxed);
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
        let request = activity.begin();
        assert!(timeout(LONG, activity.stalled_too_long()).await.is_err());
        request.delivers();
        request.is_asked();
        assert!(timeout(LONG, activity.stalled_too_long()).await.is_err());
        request.delivers();
        assert!(
            timeout(2 * SHORT, activity.stalled_too_long())
                .await
                .is_err()
        );
        assert!(
            timeout(2 * SHORT, activity.stalled_too_long())
                .await
                .is_ok()
        );
    }
}
