//! Refused requests in the log: a line for each kind every ten seconds at most, however many there are.

use std::{
    collections::BTreeMap,
    mem,
    sync::{LazyLock, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use tracing::info;

/// How often a kind is logged.
const INTERVAL: Duration = Duration::from_secs(10);
/// A client chooses the path.
const LONGEST_PATH: usize = 100;

/// By kind, what was refused since its last line. There are as many kinds as errors.
static KINDS: LazyLock<Mutex<BTreeMap<String, Since>>> = LazyLock::new(Mutex::default);

/// How many requests were refused since the last line, and the path of the latest.
#[derive(Debug)]
struct Since {
    line: Instant,
    count: u64,
    latest: String,
}

impl Default for Since {
    fn default() -> Self {
        Since {
            line: Instant::now(),
            count: 0,
            latest: String::new(),
        }
    }
}

/// A request was refused for this kind of error.
pub(super) fn note(kind: &str, path: &str) {
    let path: String = path.chars().take(LONGEST_PATH).collect();
    if count(kind, &path) {
        return;
    }
    info!(
        error = kind,
        count = 1,
        "refused as {kind}: a request to {path:?}"
    );
    let kind = kind.to_owned();
    tokio::spawn(async move {
        loop {
            tokio::time::sleep(INTERVAL).await;
            let Some(Since { count, latest, .. }) = take(&kind) else {
                return;
            };
            info!(
                error = kind,
                count, "refused as {kind}: {count} more, the latest a request to {latest:?}"
            );
        }
    });
}

/// Counts a request for the next line; false if there is none to come, since nothing of this kind was refused lately.
fn count(kind: &str, path: &str) -> bool {
    let mut kinds = kinds();
    match kinds.get_mut(kind) {
        // who was to write the next line has ended, with its runtime
        Some(since) if since.line.elapsed() > 2 * INTERVAL => {
            *since = Since::default();
            false
        }
        Some(since) => {
            since.count += 1;
            since.latest = path.to_owned();
            true
        }
        None => {
            kinds.insert(kind.to_owned(), Since::default());
            false
        }
    }
}

/// What was refused since the last line; `None` if there was nothing, and then no line is to come.
fn take(kind: &str) -> Option<Since> {
    let mut kinds = kinds();
    let since = mem::take(kinds.get_mut(kind)?);
    if since.count == 0 {
        kinds.remove(kind);
        return None;
    }
    Some(since)
}

fn kinds() -> MutexGuard<'static, BTreeMap<String, Since>> {
    // No code panics while it holds this lock; if one did, the counts would still be whole.
    KINDS.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_refused_after_the_first_is_counted_for_the_next_line_until_there_is_none() {
        let kind = "a kind of this test";
        assert!(!count(kind, "/1"), "the first has its own line");
        assert!(count(kind, "/2") && count(kind, "/3"));
        assert!(!count("another one", "/1"));
        let since = take(kind);
        let since = since.map(|since| (since.count, since.latest));
        assert_eq!(since, Some((2, "/3".into())));
        assert!(take(kind).is_none());
        assert!(!count(kind, "/4"));
    }
}
