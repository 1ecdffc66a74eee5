//! Violations of a request: prefixes of their places, and quoting.

use solver::error::Violation;

/// The place of the problem in a request, where pointers start.
pub const PROBLEM: &str = "/problem";

/// Violations with pointers that start at `prefix`, the place of their subject in the request.
pub fn prefixed(prefix: &str, violations: Vec<Violation>) -> Vec<Violation> {
    violations
        .into_iter()
        .map(|v| Violation {
            pointer: format!("{prefix}{}", v.pointer),
            ..v
        })
        .collect()
}

/// A name from a request as quoted in messages: a long one by its beginning and its length, since it may be as long as
/// the request.
pub fn quoted(text: &str) -> String {
    files::quoted(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_name_is_truncated_between_characters() {
        assert_eq!(quoted("top"), "top");
        let long = format!("{}… (81 characters)", "ä".repeat(80));
        assert_eq!(quoted(&"ä".repeat(81)), long);
    }
}
