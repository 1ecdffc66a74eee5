//! Points in time: microseconds since 1970 in the store, RFC 3339 in UTC outside.

use std::{borrow::Cow, fmt, sync::LazyLock, time::Duration};

use jiff::Timestamp;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The start of this process's time: microseconds since 1970 by the clock, and the time since the machine was started.
static START: LazyLock<(i64, Duration)> = LazyLock::new(|| (wall_clock(), since_boot()));

thread_local! {
    /// The simulated time of this thread, in microseconds since 1970.
    static SIMULATED: std::cell::Cell<Option<i64>> = const { std::cell::Cell::new(None) };
}

/// A point in time, to the microsecond.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Time(i64);

impl Time {
    /// The present time. The machine's clock is read once; from then on time is measured by a counter that nobody can
    /// set and that also runs while the machine sleeps, so that durations, time limits and the order of times are right
    /// whatever happens to the clock. The clock is read again at the next start.
    pub fn now() -> Self {
        if let Some(micros) = SIMULATED.get() {
            return Time(micros);
        }
        let (wall, boot) = *START;
        Time(wall.saturating_add(micros(since_boot().saturating_sub(boot))))
    }

    /// Sets the simulated time of this thread, for tests.
    pub fn simulate(self) {
        SIMULATED.set(Some(self.0));
    }

    /// Work for another thread that sees the simulated time of this one, for tests.
    pub fn simulated_for<T>(work: impl FnOnce() -> T) -> impl FnOnce() -> T {
        let simulated = SIMULATED.get();
        move || {
            let own = SIMULATED.replace(simulated);
            let done = work();
            SIMULATED.set(own);
            done
        }
    }

    /// The present time of the machine's clock, also if it was set since the start: for tokens, which expire at a time
    /// that others know.
    pub fn of_the_machine() -> Self {
        if let Some(micros) = SIMULATED.get() {
            return Time(micros);
        }
        Time(wall_clock())
    }

    /// How far the machine's clock is ahead of [`Time::now`], in seconds, because it was set since the start.
    pub fn clock_was_set_by_s() -> f64 {
        wall_clock().saturating_sub(Time::now().0) as f64 / 1e6
    }

    /// A time from microseconds since 1970.
    pub const fn from_micros(micros: i64) -> Self {
        Time(micros)
    }

    /// Reads a time in RFC 3339.
    pub fn parse(text: &str) -> Option<Self> {
        let time: Timestamp = text.parse().ok()?;
        Some(Time(time.as_microsecond()))
    }

    /// The microseconds since 1970.
    pub fn micros(self) -> i64 {
        self.0
    }

    /// This time plus a number of seconds.
    pub fn after_s(self, seconds: f64) -> Self {
        Time(self.0.saturating_add((seconds * 1e6) as i64))
    }

    /// The seconds from this time to `later`; 0, not negative, if the clock was set back in between.
    pub fn seconds_until(self, later: Time) -> f64 {
        later.0.saturating_sub(self.0).max(0) as f64 / 1e6
    }
}

fn wall_clock() -> i64 {
    Timestamp::now().as_microsecond()
}

/// The time since the machine was started, used because `std::time::Instant` stands still while the machine sleeps.
fn since_boot() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
    Duration::new(
        time.tv_sec.unsigned_abs(),
        time.tv_nsec.unsigned_abs() as u32,
    )
}

fn micros(duration: Duration) -> i64 {
    i64::try_from(duration.as_micros()).unwrap_or(i64::MAX)
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match Timestamp::from_microsecond(self.0) {
            Ok(time) => write!(f, "{time:.6}"),
            Err(_) => write!(f, "{} µs", self.0), // beyond the year 9999, which no clock gives
        }
    }
}

impl Serialize for Time {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Time {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let time: Timestamp = text.parse().map_err(serde::de::Error::custom)?;
        Ok(Time(time.as_microsecond()))
    }
}

impl JsonSchema for Time {
    fn schema_name() -> Cow<'static, str> {
        "Time".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "format": "date-time" })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_time_is_read_back_from_its_text() {
        let time = Time::from_micros(1_700_000_000_000_001);
        assert_eq!(time.to_string(), "2023-11-14T22:13:20.000001Z");
        assert_eq!(
            serde_json::from_str::<Time>(&serde_json::to_string(&time).unwrap()).unwrap(),
            time
        );
    }

    #[test]
    fn times_of_one_process_are_in_order_and_near_the_clock() {
        let times: Vec<Time> = (0..1000).map(|_| Time::now()).collect();
        assert!(times.is_sorted());
        assert!(Time::clock_was_set_by_s().abs() < 1.0);
    }

    #[test]
    fn a_clock_set_back_gives_no_negative_duration() {
        assert_eq!(
            Time::from_micros(2_000_000).seconds_until(Time::from_micros(0)),
            0.0
        );
    }
}
