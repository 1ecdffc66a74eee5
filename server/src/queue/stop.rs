//! Asking a solver to stop, and why: the first reason given is the one that counts.

use std::sync::atomic::{AtomicU8, Ordering};

/// Looked at by the solver in every iteration.
#[derive(Debug, Default)]
pub(super) struct Stop(AtomicU8);

/// Why a solver should stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Why {
    /// Somebody asked for it.
    Canceled = 1,
    /// The job has run longer than it may.
    TimedOut = 2,
    /// The service is about to stop.
    Drained = 3,
    /// What it finds can no longer be stored.
    Lost = 4,
}

impl Stop {
    /// Asks for it.
    pub(super) fn ask(&self, why: Why) {
        // An earlier reason stays: that is the error of this exchange, and no harm.
        let _ = self
            .0
            .compare_exchange(0, why as u8, Ordering::Relaxed, Ordering::Relaxed);
    }

    /// Whether and why it was asked for.
    pub(super) fn why(&self) -> Option<Why> {
        let number = self.0.load(Ordering::Relaxed);
        [Why::Canceled, Why::TimedOut, Why::Drained, Why::Lost]
            .into_iter()
            .find(|why| *why as u8 == number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_reason_counts() {
        let stop = Stop::default();
        assert_eq!(stop.why(), None);
        stop.ask(Why::TimedOut);
        stop.ask(Why::Canceled);
        assert_eq!(stop.why(), Some(Why::TimedOut));
    }
}
