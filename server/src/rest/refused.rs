//! Refused requests in the log: a line for each kind every ten seconds at most, however many there are.

use std::{
    collections::BTreeMap,
    mem::take,
    sync::{LazyLock, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use tracing::info;

/// How often a kind is logged.
const INTERVAL: Duration = Duration::from_secs(10);
/// A client chooses the path.
const LONGEST_PATH: usize = 100;

/// By kind, what was refused since its last line. There are as many kinds as errors.
static KINDS: LazyLock<Mutex<BTreeMap<String, Since>>> = LazyLock::new(Mutex::default);

/// How many requests were refused since the last line, and the path of the latest.
#[derive(Debug, Default, PartialEq, Eq)]
struct Since {
    count: u64,
    latest: String,
}

/// A request was refused for this kind of error.
pub(super) fn note(kind: &str, path: &str) {
    let path: String = path.chars().take(LONGEST_PATH).collect();
    if is_counted(kind, &path) {
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
            let Some(Since { count, latest }) = counted(&kind) else {
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
fn is_counted(kind: &str, path: &str) -> bool {
    let mut kinds = kinds();
    match kinds.get_mut(kind) {
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
fn counted(kind: &str) -> Option<Since> {
    let mut kinds = kinds();
    let since = take(kinds.get_mut(kind)?);
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
        assert!(!is_counted(kind, "/1"), "the first has its own line");
        assert!(is_counted(kind, "/2") && is_counted(kind, "/3"));
        assert!(!is_counted("another one", "/1"));
        let (count, latest) = (2, "/3".to_owned());
        assert_eq!(counted(kind), Some(Since { count, latest }));
        assert_eq!(counted(kind), None);
        assert!(!is_counted(kind, "/4"));
    }
}
