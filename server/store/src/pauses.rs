//! Pauses: time that the store has not seen pass, because no service ran or a clock was wrong.
//!
//! Nobody can tell which of these it was: if the clock shows a hundred days more at a start, no service may have run
//! for that long, or the clock was wrong at one of the two starts (a machine without a battery begins with an old time,
//! until it learns the right one). The age at which data are removed, and the time after which a job expires in the
//! queue, therefore count the time while the service ran, which no clock can change.

use parking_lot::{Mutex, MutexGuard};
use serde::{Deserialize, Serialize};

/// The largest number of pauses that are kept: of more, the shortest are forgotten. After a year with twenty restarts a
/// day, the forgotten ones are a small part of each age that matters.
const MOST: usize = 200;
/// A pause counts as part of an age if it is at most one part in this many of it: a wrong clock changes the age little
/// then, and machines are off at night.
const SMALL_PART: i64 = 30;

/// The begin and the end of a pause, by the clock of the store (µs).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Pause(pub(super) i64, pub(super) i64);

impl Pause {
    fn length(self) -> i64 {
        self.1.saturating_sub(self.0)
    }
}

/// All pauses, the oldest first.
#[derive(Debug, Default)]
pub(super) struct Pauses(Mutex<Vec<Pause>>);

impl Pauses {
    /// Replaces all pauses; returns those that are kept. The part of a pause after `now` is left out: a clock that was
    /// ahead is right again.
    pub(super) fn set(&self, pauses: Vec<Pause>, now: i64) -> Vec<Pause> {
        let until_now = pauses
            .into_iter()
            .map(|Pause(from, to)| Pause(from, to.min(now)));
        let mut kept: Vec<Pause> = until_now.filter(|Pause(from, to)| from < to).collect();
        while kept.len() > MOST {
            let shortest = (0..kept.len()).min_by_key(|&at| kept[at].length());
            kept.remove(shortest.unwrap_or_default());
        }
        *self.all() = kept.clone();
        kept
    }

    /// The time `age` before `now` (µs), not counting the pauses.
    pub(super) fn cutoff(&self, now: i64, age: i64) -> i64 {
        cutoff(&self.all(), now, age)
    }

    fn all(&self) -> MutexGuard<'_, Vec<Pause>> {
        self.0.lock()
    }
}

/// The time `age` before `now` (µs), not counting the pauses that are more than a small part of `age`.
fn cutoff(pauses: &[Pause], now: i64, age: i64) -> i64 {
    let (mut at, mut left) = (now, age.max(0));
    for pause @ Pause(from, to) in pauses.iter().rev() {
        if at.saturating_sub(left) >= *to {
            break;
        }
        if pause.length() > age / SMALL_PART {
            left -= at.saturating_sub(*to).max(0);
            at = at.min(*from);
        }
    }
    at.saturating_sub(left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_age_counts_the_time_that_was_seen_and_short_pauses() {
        assert_eq!(cutoff(&[], 1000, 300), 700);
        // seen: 1000 to 900 and 200 to 0
        let long = [Pause(200, 900)];
        assert_eq!(cutoff(&long, 1000, 90), 910);
        assert_eq!(cutoff(&long, 1000, 100), 900);
        assert_eq!(cutoff(&long, 1000, 150), 150);
        assert_eq!(cutoff(&long, 1000, 300), 0);
        // a thirtieth of the age
        assert_eq!(cutoff(&[Pause(690, 700)], 1000, 301), 699);
        assert_eq!(cutoff(&[Pause(680, 700)], 1000, 301), 679);
        let two = [Pause(100, 400), Pause(500, 900)];
        assert_eq!(cutoff(&two, 1000, 250), 50);
        assert_eq!(cutoff(&[Pause(i64::MIN, 900)], 1000, 5000), i64::MIN);
    }

    #[test]
    fn frequent_restarts_do_not_end_retention() {
        const DAY: i64 = 86_400 * 1_000_000;
        for a_day in [1, 3, 20] {
            let every = DAY / a_day;
            let (kept, mut now) = (Pauses::default(), 0);
            let mut pauses = vec![];
            for _ in 0..365 * a_day {
                now += every;
                pauses.push(Pause(now - 5_000_000, now));
                pauses = kept.set(pauses, now);
            }
            assert!(pauses.len() <= MOST);
            let age = now - kept.cutoff(now, 90 * DAY);
            assert!((90 * DAY..91 * DAY).contains(&age), "{a_day} a day: {age}");
        }
    }
}
