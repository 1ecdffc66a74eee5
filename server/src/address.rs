//! Where clients reach the service: the path before all others, where a proxy shows it below one.

use std::sync::OnceLock;

/// Set once at the start: a process has one address, and links are written where no request is at hand.
static PREFIX: OnceLock<String> = OnceLock::new();

/// From now on links begin with this path.
pub fn set_prefix(prefix: &str) {
    // a second start in one process keeps the first prefix; only tests start twice
    let _ = PREFIX.set(prefix.to_owned());
}

/// The path before all others, without a slash at its end; usually empty.
pub fn prefix() -> &'static str {
    PREFIX.get().map_or("", String::as_str)
}

/// A path as a client has sent it, without the prefix, if it has it.
pub fn without_prefix(path: &str) -> &str {
    let rest = path.strip_prefix(prefix());
    rest.filter(|rest| rest.starts_with('/')).unwrap_or(path)
}

/// A path of the service, as clients reach it.
pub fn link(path: &str) -> String {
    format!("{}{path}", prefix())
}
