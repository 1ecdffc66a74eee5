//! `signorini serve`.

use std::{io::Write, time::Duration};

use anyhow::Context;
use rustix::process::Signal;
use tokio::signal::unix::{SignalKind, signal};
use tracing::{info, warn};
use tracing_appender::non_blocking::ErrorCounter;

use super::{exit::Exit, log, settings};
use crate::{app::App, config::Config, queue};

/// Serves until SIGTERM or SIGINT. `lost` counts the lines of the log that were lost.
pub(super) async fn run(config: Config, lost: ErrorCounter) -> anyhow::Result<Exit> {
    // Installed first, so that no signal arrives before its handler.
    survive(SignalKind::hangup(), "SIGHUP: there is nothing to reload")?;
    survive(
        SignalKind::from_raw(Signal::XFSZ.as_raw()),
        "a file has reached the limit on file sizes of this process (ulimit -f); as on a full disk, nothing more can be stored",
    )?;
    let mut terminate = signal(SignalKind::terminate()).context("SIGTERM cannot be caught")?;
    let mut interrupt = signal(SignalKind::interrupt()).context("SIGINT cannot be caught")?;
    tokio::spawn(log::report_lost_lines(lost));
    for (name, similar) in settings::unknown_variables() {
        warn!("{name} is no setting, and is ignored; did you mean {similar}?");
    }
    let app = App::start(&config).await?;
    announce(&app.url())?;
    tokio::select! {
        _ = terminate.recv() => info!("SIGTERM: stopping"),
        _ = interrupt.recv() => info!("SIGINT: stopping"),
    }
    app.stop().await;
    Ok(Exit::Ok)
}

/// Solves what the service sends, as a worker process. A signal to stop that reaches the service and its processes
/// alike is for the service: it decides about its jobs, and its end is that of this process.
pub(super) async fn work() -> anyhow::Result<Exit> {
    for kind in [
        SignalKind::terminate(),
        SignalKind::interrupt(),
        SignalKind::hangup(),
    ] {
        // from now on it has no effect, also when this is dropped
        let _caught = signal(kind).context("a signal cannot be caught")?;
    }
    let solve = || queue::run_worker_process(solver::solve_on);
    tokio::task::spawn_blocking(solve).await??;
    Ok(Exit::Ok)
}

/// Logs a signal that would end the process otherwise.
fn survive(kind: SignalKind, text: &'static str) -> anyhow::Result<()> {
    let mut signals = signal(kind).context("a signal cannot be caught")?;
    tokio::spawn(async move {
        while signals.recv().await.is_some() {
            warn!("{text}");
            // it may come with every write
            tokio::time::sleep(Duration::from_secs(10)).await;
        }
    });
    Ok(())
}

/// Prints the address as the first line of standard output; with port 0 it is not known beforehand.
fn announce(url: &str) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{url}")?;
    out.flush()
}
