//! What is wrong with a request, gathered: as many violations as help, each as long as helps.

use solver::error::Violation;

/// More violations than this say nothing new, and cost time and space. The solver lists as many.
pub const MOST: usize = 100;

/// Gathers violations; those after the first hundred are dropped, and the last one says so.
#[derive(Debug, Default)]
pub struct Violations {
    listed: Vec<Violation>,
    more: bool,
}

impl Violations {
    /// Whether all is well.
    pub fn is_empty(&self) -> bool {
        self.listed.is_empty()
    }

    /// One more.
    pub fn add(&mut self, violation: Violation) {
        if self.listed.len() >= MOST {
            self.more = true;
        } else {
            self.listed.push(violation);
        }
    }

    /// The list.
    pub fn into_vec(mut self) -> Vec<Violation> {
        if let Some(last) = self.listed.last_mut().filter(|_| self.more) {
            last.hint.push_str(" (There are more violations.)");
        }
        self.listed
    }
}

impl Extend<Violation> for Violations {
    fn extend<I: IntoIterator<Item = Violation>>(&mut self, violations: I) {
        violations.into_iter().for_each(|v| self.add(v));
    }
}

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

/// The first `most` characters of a text, with a sign where some are missing.
pub fn shortened(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hundred_violations_are_listed_and_more_are_mentioned() {
        let violation = |n: usize| Violation {
            pointer: format!("/{n}"),
            reason: "unknown_name".into(),
            got: "it".into(),
            expected: "nothing".into(),
            hint: "Leave it out.".into(),
        };
        let list = |count: usize| {
            let mut found = Violations::default();
            found.extend((0..count).map(violation));
            found.into_vec()
        };
        assert_eq!(list(100)[99].hint, "Leave it out.");
        let many = list(1000);
        assert_eq!(many.len(), 100);
        assert!(many[99].hint.contains("more"), "{}", many[99].hint);
    }

    #[test]
    fn a_long_name_is_cut_between_characters() {
        assert_eq!(name("top"), "top");
        assert_eq!(name(&"ä".repeat(81)), format!("{}…", "ä".repeat(80)));
    }
}
