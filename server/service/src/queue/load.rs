//! The load of the last hour, in memory: a point for each minute.

use std::collections::VecDeque;

use base::time::Time;
use parking_lot::Mutex;
use schemars::JsonSchema;
use serde::Serialize;

/// The number of points that are kept.
const MOST: usize = 60;
/// The time between two points (seconds).
const MINUTE_S: f64 = 60.0;

/// The load in a minute: the largest numbers that were seen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct LoadPoint {
    /// When the minute began.
    pub t: Time,
    /// Waiting jobs.
    pub queued: u64,
    /// Running jobs.
    pub running: u64,
}

/// The points of the last hour.
#[derive(Debug, Default)]
pub(super) struct LastHour(Mutex<VecDeque<LoadPoint>>);

impl LastHour {
    /// Adds what was seen now.
    pub(super) fn see(&self, now: Time, queued: u64, running: u64) {
        let mut points = self.0.lock();
        match points.back_mut() {
            Some(last) if (0.0..MINUTE_S).contains(&last.t.seconds_until(now)) => {
                last.queued = last.queued.max(queued);
                last.running = last.running.max(running);
            }
            _ => {
                let t = now;
                points.push_back(LoadPoint { t, queued, running });
                if points.len() > MOST {
                    points.pop_front();
                }
            }
        }
    }

    pub(super) fn points(&self) -> Vec<LoadPoint> {
        self.0.lock().iter().copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_hour_is_kept_with_the_peaks_of_each_minute() {
        let hour = LastHour::default();
        let start = Time::from_micros(1_700_000_000_000_000);
        for second in 0..2 * 3600_u32 {
            let peak = u64::from(second % 60 == 30) * 7;
            hour.see(start.after_s(f64::from(second)), peak, 1);
        }
        let points = hour.points();
        assert_eq!(points.len(), 60);
        assert!(
            points
                .iter()
                .all(|point| (point.queued, point.running) == (7, 1))
        );
        assert_eq!(points[59].t, start.after_s(7140.0));
    }
}
