//! What is wrong with a request: where it stands there, and how it is quoted.

use solver::error::{Violation, shortened};

/// Where requests carry the problem; pointers start there.
pub const AT: &str = "/problem";

/// Moves violations to where their subject stands in a request.
pub fn prefixed(prefix: &str, violations: Vec<Violation>) -> Vec<Violation> {
    violations
        .into_iter()
        .map(|v| Violation {
            pointer: format!("{prefix}{}", v.pointer),
            ..v
        })
        .collect()
}

/// A name from a request as messages quote it: it may be as long as the request.
pub fn name(text: &str) -> String {
    shortened(text, 80)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_name_is_cut_between_characters() {
        assert_eq!(name("top"), "top");
        assert_eq!(name(&"ä".repeat(81)), format!("{}…", "ä".repeat(80)));
    }
}
