//! Logs refused requests: at most one line for each kind of error every ten seconds, however many requests there are.

use parking_lot::Mutex;
use std::{
    collections::BTreeMap,
    sync::LazyLock,
    time::{Duration, Instant},
};

use tracing::info;

/// The shortest time between two lines about the same kind of error.
const INTERVAL: Duration = Duration::from_secs(10);
/// The largest number of characters of a path that are logged, since a client chooses the path.
const LONGEST_PATH: usize = 100;

/// For each kind of error: when it was last logged, and how many requests were refused with it since. There are only as
/// many entries as kinds of errors.
static KINDS: LazyLock<Mutex<BTreeMap<String, Kind>>> = LazyLock::new(Mutex::default);

struct Kind {
    logged: Instant,
    since: u64,
}

/// Records that a request was refused with this kind of error.
pub(super) fn note(kind: &str, path: &str) {
    let Some(count) = due(kind, Instant::now()) else {
        return;
    };
    tokio::spawn(tell_the_rest(kind.to_owned()));
    let path: String = path.chars().take(LONGEST_PATH).collect();
    match count {
        1 => info!(
            error = kind,
            count, "refused as {kind}: a request to {path:?}"
        ),
        _ => info!(
            error = kind,
            count, "refused as {kind}: {count} more requests, the latest to {path:?}"
        ),
    }
}

/// After a line about a kind of error, logs how many further requests were refused, every ten seconds until there are
/// none: perhaps no later request comes that would cause a line.
async fn tell_the_rest(kind: String) {
    loop {
        tokio::time::sleep(INTERVAL).await;
        let count = rest(&kind, Instant::now());
        if count == 0 {
            return;
        }
        info!(
            error = kind,
            count, "refused as {kind}: {count} more requests"
        );
    }
}

/// Returns the number of requests that were refused since the last line about this kind of error, and resets it.
fn rest(kind: &str, now: Instant) -> u64 {
    let mut kinds = KINDS.lock();
    match kinds.get_mut(kind) {
        Some(known) if known.since > 0 => {
            known.logged = now;
            std::mem::take(&mut known.since)
        }
        Some(_) | None => 0,
    }
}

/// Counts a refused request; returns the number of requests to be logged if a line about this kind of error is due.
fn due(kind: &str, now: Instant) -> Option<u64> {
    let mut kinds = KINDS.lock();
    match kinds.get_mut(kind) {
        Some(known) => {
            known.since += 1;
            let due = now.saturating_duration_since(known.logged) >= INTERVAL;
            due.then(|| {
                known.logged = now;
                std::mem::take(&mut known.since)
            })
        }
        None => {
            let (logged, since) = (now, 0);
            kinds.insert(kind.to_owned(), Kind { logged, since });
            Some(1)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_is_logged_at_once_and_then_every_ten_seconds_with_its_number() {
        let start = Instant::now();
        let after = |seconds| due("a kind of this test", start + Duration::from_secs(seconds));
        assert_eq!(after(0), Some(1));
        assert_eq!((after(1), after(9)), (None, None));
        assert_eq!(after(10), Some(3));
        assert_eq!(after(11), None);
        let rest = |seconds| rest("a kind of this test", start + Duration::from_secs(seconds));
        assert_eq!((rest(20), rest(30)), (1, 0));
        assert_eq!(after(30), Some(1));
        assert_eq!(due("another one", start), Some(1));
    }
}
