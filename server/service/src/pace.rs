//! The minimum speed at which a client must send a body or read an answer: an endlessly slow client would hold memory
//! and a connection for ever.

use std::time::Duration;

use tokio::time::Instant;

/// The longest time for which a client may send or read nothing.
pub const LONGEST_PAUSE: Duration = Duration::from_secs(60);
/// The least average rate at which a client must send or read (bytes per second), after a first `LONGEST_PAUSE`.
pub const LEAST_RATE: u64 = 4 << 10;

/// The progress of one request body or one answer. Only the time spent waiting for the client counts, not the time that
/// the service takes.
#[derive(Debug, Default)]
pub struct Pace {
    waiting_since: Option<Instant>,
    waited: Duration,
    bytes: u64,
}

impl Pace {
    /// Starts counting the time spent waiting for the client, unless it is counted already.
    pub fn wait(&mut self) {
        self.waiting_since.get_or_insert_with(Instant::now);
    }

    /// Records that the client has sent or read this many bytes, which ends a wait.
    pub fn advance(&mut self, bytes: usize) {
        self.waited += self.pause();
        self.waiting_since = None;
        self.bytes = self.bytes.saturating_add(bytes as u64);
    }

    /// Whether the client has paused for longer than `LONGEST_PAUSE`, or is slower on average than `LEAST_RATE`.
    pub fn is_too_slow(&self) -> bool {
        let allowed = LONGEST_PAUSE + Duration::from_secs(self.bytes / LEAST_RATE);
        let pause = self.pause();
        pause > LONGEST_PAUSE || self.waited + pause > allowed
    }

    fn pause(&self) -> Duration {
        self.waiting_since
            .map_or(Duration::ZERO, |since| since.elapsed())
    }
}

#[cfg(test)]
mod tests {
    use tokio::time::advance;

    use super::*;

    /// Whether a client that takes this time for every piece of this size is soon too slow.
    async fn is_too_slow(seconds: u64, bytes: usize) -> bool {
        let mut pace = Pace::default();
        for _ in 0..200 {
            pace.wait();
            advance(Duration::from_secs(seconds)).await;
            if pace.is_too_slow() {
                return true;
            }
            pace.advance(bytes);
        }
        false
    }

    #[tokio::test(start_paused = true)]
    async fn a_byte_a_second_is_too_slow_and_a_pause_is_not() {
        assert!(is_too_slow(1, 1).await);
        assert!(is_too_slow(61, 1 << 30).await);
        assert!(!is_too_slow(59, 1 << 20).await);
        assert!(!is_too_slow(1, 4 << 10).await);
        assert!(is_too_slow(2, 4 << 10).await);
    }

    #[tokio::test(start_paused = true)]
    async fn the_time_of_the_service_does_not_count() {
        let mut pace = Pace::default();
        for _ in 0..100 {
            advance(Duration::from_secs(50)).await;
            pace.wait();
            pace.advance(1);
        }
        assert!(!pace.is_too_slow());
    }
}
