//! Helps to report violations of a request: prefixes the JSON Pointers of their places, and shortens quoted names.

use solver::error::Violation;

/// The JSON Pointer of the problem in a request, with which pointers into the problem begin.
pub const PROBLEM: &str = "/problem";

/// Puts `prefix`, the place of the violations' subject in the request, before the pointers of the violations.
pub fn prefixed(prefix: &str, violations: Vec<Violation>) -> Vec<Violation> {
    violations
        .into_iter()
        .map(|v| Violation {
            pointer: format!("{prefix}{}", v.pointer),
            ..v
        })
        .collect()
}

/// Quotes a name from a request in a message: a long name is given by its beginning and its length, since it may be as
/// long as the request.
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
