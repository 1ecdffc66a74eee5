//! Messages to systemd for a service with `Type=notify`: that it is ready, alive, or stopping. Nothing is sent without
//! `NOTIFY_SOCKET`.

use std::time::Duration;

use app::Pulse;
use sd_notify::NotifyState;
use tokio::time::{sleep, timeout};

/// The longest time between two messages about the status.
const STATUS_PERIOD: Duration = Duration::from_secs(10);

/// Reports that the service answers at its address.
pub(super) fn ready(url: &str) {
    tell(&[NotifyState::Ready, NotifyState::Status(url)]);
}

/// Reports that the service was asked to stop.
pub(super) fn stopping() {
    let status = "stopping: running jobs are requeued";
    tell(&[NotifyState::Stopping, NotifyState::Status(status)]);
}

/// Reports that the service is alive, as often as the watchdog expects (`WatchdogSec=`), each time only if its store
/// answers. Also reports the status of the service when it changes.
pub(super) async fn keep_alive(url: String, pulse: Pulse) {
    let watchdog = sd_notify::watchdog_enabled();
    // three in the time that the watchdog allows, of which one may be late
    let period = watchdog.map_or(STATUS_PERIOD, |longest| (longest / 3).min(STATUS_PERIOD));
    let (mut told, mut was_alive) = (String::new(), true);
    loop {
        sleep(period).await;
        let alive = timeout(period, pulse.store_answers())
            .await
            .unwrap_or(false);
        if alive && watchdog.is_some() {
            tell(&[NotifyState::Watchdog]);
        }
        if !alive && was_alive {
            tracing::warn!("the store has not answered for {period:?}");
        }
        was_alive = alive;
        let status = format!("{url}: {}", pulse.status());
        if status != told && alive {
            tell(&[NotifyState::Status(&status)]);
            told = status;
        }
    }
}

fn tell(state: &[NotifyState]) {
    if let Err(error) = sd_notify::notify(state) {
        tracing::warn!(%error, "the message {state:?} to systemd failed: {error}");
    }
}
