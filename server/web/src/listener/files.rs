//! The limit of open files: each connection needs one, the store and uploads need some.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use tracing::{debug, warn};

/// The number of open files other than connections: the database with its log for each connection to the database,
/// uploads, standard streams, the runtime, and files that a command writes.
const RESERVED: u64 = 128;
/// The smallest number of connections, even if hardly any files may be open.
const FEWEST: u64 = 16;

/// Raises the limit of open files to the highest that the system allows, since connections soon reach the usual limit,
/// 1024. Returns the new limit.
fn raise_file_limit() -> u64 {
    let before = getrlimit(Resource::Nofile);
    let highest = Rlimit {
        current: before.maximum,
        maximum: before.maximum,
    };
    if let Err(error) = setrlimit(Resource::Nofile, highest) {
        warn!(%error, "the limit of open files cannot be raised: {error}");
    }
    // no limit is reported as none
    let limit = getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX);
    debug!(limit, "at most {limit} files may be open");
    limit
}

/// The largest number of connections: `wanted`, or fewer if the limit of open files is too low.
pub fn most_connections(wanted: u32) -> usize {
    let limit = raise_file_limit();
    let rest = limit.saturating_sub(RESERVED).max(FEWEST);
    if rest < u64::from(wanted) {
        warn!(
            limit,
            "at most {rest} connections instead of {wanted}: only {limit} files may be open"
        );
    }
    usize::try_from(rest.min(u64::from(wanted))).unwrap_or(usize::MAX)
}
