//! The log: one line for each event on standard error. A slow reader of the log never delays any work.

use std::{io::IsTerminal, panic, time::Duration};

use base::metrics::METRICS;
use clap::ValueEnum;
use service::config::{LogFormat, Telemetry, log_filter};
use tracing::{error, level_filters::LevelFilter, warn};
use tracing_appender::non_blocking::{ErrorCounter, NonBlocking, NonBlockingBuilder, WorkerGuard};
use tracing_subscriber::{filter::Targets, prelude::*};

use super::log_line::Lines;

/// The largest number of lines that wait to be written; further lines are lost, and counted. An average line has some
/// 200 bytes.
const MOST_WAITING: usize = 10_000;
/// How often lost lines are reported.
const INTERVAL: Duration = Duration::from_secs(10);

/// The log of this process. When this is dropped the waiting lines are written.
pub(super) struct Log {
    lost: ErrorCounter,
    _writing: WorkerGuard,
}

/// Starts the log of a command, filtered by SIGNORINI_LOG or RUST_LOG. An invalid filter is reported and ignored: the
/// variable may be intended for another program.
pub(super) fn start(default: LevelFilter) -> Log {
    let filter = of_variable("SIGNORINI_LOG").or_else(|| of_variable("RUST_LOG"));
    // a certificate that is not accepted is the command's own message
    let usual = || {
        let usual = quiet(Targets::new().with_default(default));
        usual.with_target("rustls_platform_verifier", LevelFilter::OFF)
    };
    write(filter.unwrap_or_else(usual), LogFormat::Text)
}

/// Starts the log of a worker process, which is part of the log of the service.
pub(super) fn start_of_worker(level: LevelFilter) -> Log {
    let asked = std::env::var("SIGNORINI_LOG_FORMAT").unwrap_or_default();
    let format = LogFormat::from_str(&asked, true).unwrap_or_default();
    write(quiet(Targets::new().with_default(level)), format)
}

/// Starts the log of the service.
pub(super) fn start_as(settings: &Telemetry) -> Log {
    let filter = settings.log.clone().or_else(|| of_variable("RUST_LOG"));
    let usual = || quiet(Targets::new().with_default(LevelFilter::INFO));
    write(filter.unwrap_or_else(usual), settings.log_format)
}

/// Removes from a filter the messages of the drawing library about the letters of figures, since clients choose these
/// letters.
fn quiet(filter: Targets) -> Targets {
    filter.with_target("usvg", LevelFilter::OFF)
}

fn of_variable(name: &str) -> Option<Targets> {
    let asked = std::env::var(name).ok()?;
    if asked.trim().is_empty() {
        return None;
    }
    match log_filter(&asked) {
        Ok(filter) => Some(filter),
        Err(expected) => {
            eprintln!("signorini: {name}={asked:?} is ignored: {expected}");
            None
        }
    }
}

fn write(filter: Targets, format: LogFormat) -> Log {
    let (to, writing): (NonBlocking, _) = NonBlockingBuilder::default()
        .lossy(true)
        .buffered_lines_limit(MOST_WAITING)
        .finish(std::io::stderr());
    let lost = to.error_counter();
    let colours = format == LogFormat::Text && std::io::stderr().is_terminal();
    let lines = Lines {
        to,
        format,
        colours,
    };
    let layer = tracing_subscriber::fmt::layer()
        .with_writer(lines)
        // a log that cannot be written must not end the process
        .log_internal_errors(false)
        .with_ansi(colours);
    let layer = match format {
        LogFormat::Text => layer.boxed(),
        LogFormat::Json => {
            let json = layer.json().flatten_event(true);
            json.with_current_span(false).with_span_list(false).boxed()
        }
    };
    tracing_subscriber::registry()
        .with(layer)
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
    /// The counter of lines that were lost because nobody read them in time.
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
            METRICS.log_lines_lost.inc_by(lines as u64);
            warn!(
                lines,
                "{lines} lines of this log were lost, because they were not read in time"
            );
            reported = all;
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use tracing::Level;

    #[test]
    fn a_log_filter_is_a_level_and_targets() {
        let debug = |asked| {
            let filter = log_filter(asked).unwrap();
            ["service::queue", "hyper"].map(|target| filter.would_enable(target, &Level::DEBUG))
        };
        assert_eq!(debug("info,service=debug"), [true, false]);
        assert_eq!(debug("debug"), [true, true]);
        for wrong in ["service=loud", "verbose", "info,verbose", "info,"] {
            let told = log_filter(wrong).unwrap_err();
            assert!(told.starts_with("expected a level"), "{told}");
        }
    }
}
