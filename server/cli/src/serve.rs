//! The command `signorini serve`.

use std::{io::Write, time::Duration};

use anyhow::Context;
use app::App;
use rustix::process::Signal;
use service::config::Config;
use tokio::signal::unix::{Signal as Signals, SignalKind, signal};
use tracing::{info, warn};
use tracing_appender::non_blocking::ErrorCounter;
use web::listener;

use super::{exit::Exit, log, notify, settings};

/// Runs the service until SIGTERM or SIGINT. `lost` counts the lines of the log that were lost.
pub(super) async fn run(config: &Config, lost: ErrorCounter) -> anyhow::Result<Exit> {
    allocator::keep_freed_memory();
    // Installed first, so that no signal arrives before its handler.
    let hangup = signal(SignalKind::hangup()).context("SIGHUP cannot be caught")?;
    survive(
        SignalKind::from_raw(Signal::XFSZ.as_raw()),
        "a file has reached the limit on file sizes of this process (ulimit -f); as on a full disk, nothing more can be stored",
    )?;
    let mut terminate = signal(SignalKind::terminate()).context("SIGTERM cannot be caught")?;
    let mut interrupt = signal(SignalKind::interrupt()).context("SIGINT cannot be caught")?;
    tokio::spawn(log::report_lost_lines(lost));
    for (name, similar) in settings::unknown_variables() {
        warn!("{name} is not a setting and is ignored; did you mean {similar}?");
    }
    let app = App::start(config).await?;
    match app.tls() {
        Some(tls) => {
            tokio::spawn(listener::reload_on(hangup, tls.clone()));
            tokio::spawn(async move { tls.watch_expiry().await });
        }
        None => log_signals(hangup, "SIGHUP: there is no certificate to read again"),
    }
    announce(&app.url())?;
    notify::ready(&app.url());
    tokio::spawn(notify::keep_alive(app.url(), app.pulse()));
    tokio::select! {
        _ = terminate.recv() => info!("SIGTERM: stopping"),
        _ = interrupt.recv() => info!("SIGINT: stopping"),
    }
    notify::stopping();
    app.stop().await;
    Ok(Exit::Ok)
}

/// Logs each signal of a kind that would end the process otherwise.
fn survive(kind: SignalKind, text: &'static str) -> anyhow::Result<()> {
    log_signals(signal(kind).context("a signal cannot be caught")?, text);
    Ok(())
}

fn log_signals(mut signals: Signals, text: &'static str) {
    tokio::spawn(async move {
        while signals.recv().await.is_some() {
            warn!("{text}");
            // it may come with every write
            tokio::time::sleep(Duration::from_secs(10)).await;
        }
    });
}

/// Prints the address of the service as the first line of standard output; with port 0 it is not known beforehand.
fn announce(url: &str) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{url}")?;
    out.flush()
}
