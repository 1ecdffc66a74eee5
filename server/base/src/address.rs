//! The path prefix of the service: a proxy may show the service below a path of its own.

use std::sync::OnceLock;

/// The prefix, set once at the start: a process has one address, and links are also written where no request is
/// available.
static PREFIX: OnceLock<String> = OnceLock::new();

/// Sets the path that all links begin with.
pub fn set_prefix(prefix: &str) {
    // a second start in one process keeps the first prefix; only tests start twice
    let _ = PREFIX.set(prefix.to_owned());
}

/// The path prefix, without a slash at its end; usually empty.
pub fn prefix() -> &'static str {
    PREFIX.get().map_or("", String::as_str)
}

/// The path that a client has sent, without the prefix if it begins with the prefix.
pub fn without_prefix(path: &str) -> &str {
    let rest = path.strip_prefix(prefix());
    rest.filter(|rest| rest.starts_with('/')).unwrap_or(path)
}

/// A path of the service with the prefix, as clients reach it.
pub fn link(path: &str) -> String {
    format!("{}{path}", prefix())
}
