//! The log: one line per event on standard error. No work ever waits for who reads it.

use std::{io::IsTerminal, panic, time::Duration};

use tracing::{error, level_filters::LevelFilter, warn};
use tracing_appender::non_blocking::{ErrorCounter, NonBlocking, NonBlockingBuilder, WorkerGuard};
use tracing_subscriber::{filter::Targets, prelude::*};

/// Lines that wait to be written; further ones are lost, and counted. A line has some 200 bytes.
const MOST_WAITING: usize = 10_000;
/// How often lost lines are reported.
const INTERVAL: Duration = Duration::from_secs(10);

/// The log of this process, written to its end when it is dropped.
pub(super) struct Log {
    lost: ErrorCounter,
    _writing: WorkerGuard,
}

/// Starts the log, filtered by SIGNORINI_LOG, e.g. `info,service=debug`.
pub(super) fn start(default: LevelFilter) -> Log {
    let asked = std::env::var("SIGNORINI_LOG").unwrap_or_default();
    let filter = filter(&asked, default);
    let (writer, writing): (NonBlocking, _) = NonBlockingBuilder::default()
        .lossy(true)
        .buffered_lines_limit(MOST_WAITING)
        .finish(std::io::stderr());
    let lost = writer.error_counter();
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(writer)
        // a log that cannot be written must not end the process
        .log_internal_errors(false)
        .with_ansi(std::io::stderr().is_terminal());
    tracing_subscriber::registry()
        .with(lines)
        .with(filter)
        .init();
    // The usual hook writes to standard error itself, and would wait for its reader.
    panic::set_hook(Box::new(|panic| error!("{panic}")));
    Log {
        lost,
        _writing: writing,
    }
}

impl Log {
    /// Counts the lines that were lost, since nobody read them in time.
    pub(super) fn lost(&self) -> ErrorCounter {
        self.lost.clone()
    }
}

/// Reports lost lines, as soon as lines can be written again.
pub(super) async fn report_lost_lines(lost: ErrorCounter) {
    let mut reported = 0;
    loop {
        tokio::time::sleep(INTERVAL).await;
        let all = lost.dropped_lines();
        if all > reported {
            let lines = all - reported;
            warn!(
                lines,
                "{lines} lines of this log were lost: they were not read in time"
            );
            reported = all;
        }
    }
}

/// What is logged. An invalid filter is reported and ignored.
fn filter(asked: &str, default: LevelFilter) -> Targets {
    let default = Targets::new().with_default(default);
    if asked.trim().is_empty() {
        return default;
    }
    asked.parse().unwrap_or_else(|error| {
        eprintln!("signorini: SIGNORINI_LOG={asked} is ignored: {error}");
        default
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracing::Level;

    #[test]
    fn a_log_filter_is_a_level_and_targets_or_the_default() {
        let debug = |asked| {
            let filter = filter(asked, LevelFilter::WARN);
            ["service::queue", "hyper"].map(|target| filter.would_enable(target, &Level::DEBUG))
        };
        assert_eq!(debug("info,service=debug"), [true, false]);
        assert_eq!(debug("debug"), [true, true]);
        for asked in ["", " ", "service=loud"] {
            assert_eq!(debug(asked), [false, false], "{asked}");
            let warnings = filter(asked, LevelFilter::WARN).would_enable("hyper", &Level::WARN);
            assert!(warnings, "{asked}");
        }
    }
}
