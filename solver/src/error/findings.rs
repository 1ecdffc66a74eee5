//! Collects violations: all are counted, and a limited number is kept.

use std::collections::BTreeMap;

use super::{Reason, Violation};

/// Violations beyond this number are counted, not listed, so that the list stays small.
pub const MOST_LISTED: usize = 100;

/// The largest number of violations of one kind that are listed for a mesh: the same fault may occur thousands of times
/// and would hide other faults.
const MOST_OF_A_KIND: usize = 20;

/// The largest number of characters of each text: a name from a request may be as long as the request.
const LONGEST: usize = 2000;

/// Collects violations.
///
/// Whether a check failed is the result of the check itself, a [`Checked`], and is not read from this list.
#[derive(Debug)]
pub struct Findings {
    /// The start of the JSON Pointers of all violations.
    at: String,
    listed: Vec<Violation>,
    /// The number of violations of each kind, counted while there is a limit for each kind.
    of_a_kind: BTreeMap<Reason, usize>,
    most_of_a_kind: usize,
    /// The number of violations found after the list was full.
    more: usize,
}

/// Proof that a violation has been reported: only [`Findings`] makes one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub struct Refused(());

/// The result of a check: the checked value, or [`Refused`].
pub type Checked<T = ()> = Result<T, Refused>;

impl Default for Findings {
    fn default() -> Self {
        Findings {
            at: String::new(),
            listed: Vec::new(),
            of_a_kind: BTreeMap::new(),
            most_of_a_kind: MOST_LISTED,
            more: 0,
        }
    }
}

impl Findings {
    /// Findings of one mesh at `pointer`, with a limit for each kind of violation.
    pub fn of_mesh(pointer: &str) -> Self {
        Findings {
            at: pointer.to_owned(),
            most_of_a_kind: MOST_OF_A_KIND,
            ..Findings::default()
        }
    }

    /// Adds a violation that makes a check fail. `place`: the JSON Pointer relative to the start of all JSON Pointers.
    pub fn report(
        &mut self,
        place: impl AsRef<str>,
        reason: Reason,
        got: impl ToString,
        expected: impl Into<String>,
        hint: impl Into<String>,
    ) -> Refused {
        self.add(Violation::new(place.as_ref(), reason, got, expected, hint));
        Refused(())
    }

    /// Adds a violation for a check whose result is the list of violations itself.
    pub fn add(&mut self, violation: Violation) {
        if !self.has_room(violation.reason) {
            return;
        }
        let Violation {
            pointer,
            reason,
            got,
            expected,
            hint,
        } = violation;
        self.listed.push(Violation {
            pointer: shortened(&format!("{}{pointer}", self.at), LONGEST),
            reason,
            got: match got.as_str() {
                "" => "an empty text".to_owned(),
                got => shortened(got, LONGEST),
            },
            expected: shortened(&expected, LONGEST),
            hint: shortened(&hint, LONGEST),
        });
    }

    /// Whether there are no violations.
    pub fn is_empty(&self) -> bool {
        self.listed.is_empty() && self.more == 0
    }

    /// Whether the list is full, so that further violations are only counted.
    pub fn is_full(&self) -> bool {
        self.listed.len() >= MOST_LISTED
    }

    /// Counts violations without listing them.
    pub fn count(&mut self, more: usize) {
        self.more += more;
    }

    /// Adds the violations of a check made elsewhere.
    pub fn merge<T>(&mut self, checked: Result<T, Vec<Violation>>) -> Checked<T> {
        checked.map_err(|violations| {
            self.extend(violations);
            Refused(())
        })
    }

    /// Counts one more violation; returns whether it should be listed.
    fn has_room(&mut self, reason: Reason) -> bool {
        if self.is_full() {
            self.more += 1;
            return false;
        }
        let count = self.of_a_kind.entry(reason).or_default();
        *count += 1;
        *count <= self.most_of_a_kind
    }

    /// The listed violations. The hint of the last one of each reason, and of the last of all, says how many more there
    /// are that are not listed.
    pub fn into_violations(mut self) -> Vec<Violation> {
        for (reason, count) in self.of_a_kind {
            let more = count.saturating_sub(self.most_of_a_kind);
            let last = self.listed.iter_mut().rfind(|v| v.reason == reason);
            if let Some(last) = last.filter(|_| more > 0) {
                last.hint.push_str(&format!(" ({more} more of this kind.)"));
            }
        }
        if let Some(last) = self.listed.last_mut().filter(|_| self.more > 0) {
            let plural = if self.more == 1 { "" } else { "s" };
            last.hint
                .push_str(&format!(" ({} more violation{plural}.)", self.more));
        }
        self.listed
    }

    /// The checked value, or all violations.
    pub fn conclude<T>(self, checked: Checked<T>) -> Result<T, Vec<Violation>> {
        checked.map_err(|_| self.into_violations())
    }

    /// `value`, or the violations if there are any.
    pub fn into_result<T>(self, value: T) -> Result<T, Vec<Violation>> {
        match self.into_violations() {
            list if list.is_empty() => Ok(value),
            list => Err(list),
        }
    }
}

impl Extend<Violation> for Findings {
    fn extend<I: IntoIterator<Item = Violation>>(&mut self, violations: I) {
        violations
            .into_iter()
            .for_each(|violation| self.add(violation));
    }
}

/// The result of several checks: all are made, and the whole fails if one of the checks does.
#[derive(Debug)]
#[must_use]
pub struct AllChecks(Checked);

impl Default for AllChecks {
    fn default() -> Self {
        AllChecks(Ok(()))
    }
}

impl AllChecks {
    /// Adds the result of a check; returns the checked value.
    pub fn check<T>(&mut self, checked: Checked<T>) -> Option<T> {
        checked.map_err(|refused| self.0 = Err(refused)).ok()
    }

    /// Adds a failed check.
    pub fn fail(&mut self, refused: Refused) {
        self.0 = Err(refused);
    }

    /// `value`, if every check holds.
    pub fn finish<T>(self, value: T) -> Checked<T> {
        self.0.map(|()| value)
    }
}

/// The first `most` characters of a text, with … where some are left out.
pub fn shortened(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// A number rounded to six digits, for messages that show it by `{:?}`, whatever its units are.
pub fn rounded(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(mut findings: Findings, count: usize) -> Vec<Violation> {
        for i in 0..count {
            let (place, hint) = (format!("/{i}"), "Leave it out.");
            let _ = findings.report(place, Reason::UnknownName, "it", "nothing", hint);
        }
        findings.into_violations()
    }

    #[test]
    fn an_empty_text_is_named() {
        let mut findings = Findings::default();
        let _ = findings.report("", Reason::UnknownName, "", "a name", "Give one.");
        assert_eq!(findings.into_violations()[0].got, "an empty text");
    }

    #[test]
    fn a_hundred_violations_are_listed_and_the_others_counted() {
        assert_eq!(found(Findings::default(), 100)[99].hint, "Leave it out.");
        let list = found(Findings::default(), 1000);
        assert_eq!(list.len(), 100);
        assert_eq!(list[99].hint, "Leave it out. (900 more violations.)");
    }

    #[test]
    fn a_mesh_lists_twenty_violations_of_a_kind() {
        let mut findings = Findings::of_mesh("/mesh/inline");
        for place in ["/nodes/7", "/nodes/8"] {
            let _ = findings.report(place, Reason::UnusedNode, "it", "another", "Move it.");
        }
        let list = found(findings, 1000);
        assert_eq!(
            (list.len(), &list[0].pointer[..]),
            (22, "/mesh/inline/nodes/7")
        );
        assert_eq!(list[1].hint, "Move it.");
        assert_eq!(list[21].hint, "Leave it out. (980 more of this kind.)");
    }

    #[test]
    fn a_very_long_text_is_cut_between_characters() {
        let mut findings = Findings::default();
        let long = "ä".repeat(1 << 20);
        let _ = findings.report(&long, Reason::UnknownName, &long, &long, &long);
        let size = |v: &Violation| v.pointer.len() + v.got.len() + v.expected.len() + v.hint.len();
        assert!(size(&findings.into_violations()[0]) < 1 << 15);
        assert_eq!(shortened("top", 3), "top");
        assert_eq!(
            shortened(&"ä".repeat(81), 80),
            format!("{}…", "ä".repeat(80))
        );
    }

    #[test]
    fn all_checks_fail_if_one_fails() {
        let mut findings = Findings::default();
        let mut all = AllChecks::default();
        assert_eq!(all.check(Ok(3)), Some(3));
        assert_eq!(AllChecks::default().finish(1), Ok(1));
        let refused = findings.report("", Reason::Missing, "nothing", "it", "Give it.");
        assert_eq!(all.check::<u8>(Err(refused)), None);
        assert_eq!(all.check(Ok(3)), Some(3));
        assert_eq!(all.finish(1), Err(refused));
        assert!(findings.into_result(1).is_err());
    }
}
