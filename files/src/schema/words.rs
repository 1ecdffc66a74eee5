//! Quotes values and names of a text in violations, shortened to a limit.

use std::borrow::Cow;

use solver::error::{Reason, Violation};

/// The largest number of characters of a name or text that are quoted.
const QUOTED: usize = 80;

/// A text, or of a long text its beginning and its length in characters.
pub fn quoted(text: &str) -> String {
    match beginning(text) {
        Cow::Borrowed(whole) => whole.to_owned(),
        Cow::Owned(beginning) => format!("{beginning} ({} characters)", text.chars().count()),
    }
}

/// A text, or of a long text its beginning.
pub(super) fn beginning(text: &str) -> Cow<'_, str> {
    match text.char_indices().nth(QUOTED) {
        Some((end, _)) => Cow::Owned(format!("{}…", &text[..end])),
        None => Cow::Borrowed(text),
    }
}

/// A string in quotes, shortened to a limit.
pub(super) fn text(text: &str) -> String {
    match beginning(text) {
        Cow::Borrowed(whole) => serde_json::Value::from(whole).to_string(),
        Cow::Owned(beginning) => {
            let beginning = serde_json::Value::from(beginning);
            format!("{beginning} ({} characters)", text.chars().count())
        }
    }
}

/// The JSON text of a value, shortened to a limit.
pub(super) fn value(json: &str) -> String {
    quoted(json)
}

/// Describes a list or an object by the number of its entries, such as `a list of 3 items`.
pub(super) fn counted(count: usize, what: &str, of: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    let article = if what.starts_with('o') { "an" } else { "a" };
    format!("{article} {what} {count} {of}{plural}")
}

/// Names in backquotes, with the text `between` between them.
pub(super) fn listed<S: AsRef<str>>(names: &[S], between: &str) -> String {
    let names: Vec<_> = names
        .iter()
        .map(|name| format!("`{}`", name.as_ref()))
        .collect();
    names.join(between)
}

/// The violation for an unknown name.
pub(super) fn unknown_name<'a>(
    at: String,
    name: &str,
    known: impl Iterator<Item = &'a String>,
) -> Violation {
    let known: Vec<_> = known.map(String::as_str).collect();
    let expected = match &known[..] {
        [] => "no field".to_owned(),
        known => format!("one of {}", listed(known, ", ")),
    };
    let hint = meant(name, known)
        .unwrap_or_else(|| "Check the spelling; unknown names are rejected.".to_owned());
    let got = format!("`{}`", quoted(name));
    Violation::new(at, Reason::UnknownName, got, expected, hint)
}

/// The violation for an object that was written in place of its member `name`.
pub(super) fn bare(at: String, name: &str) -> Violation {
    Violation::new(
        at,
        Reason::Missing,
        format!("the bare {name}"),
        format!("an object with the field {name}"),
        format!("Wrap it as {{\"{name}\": …}}."),
    )
}

/// Advice “Did you mean …” with the known name that differs from `name` by the fewest letters; none if it differs by
/// many.
pub fn meant<S: AsRef<str>>(name: &str, known: impl IntoIterator<Item = S>) -> Option<String> {
    /// The largest number of characters of a name that is compared: a longer name is not just misspelt, and the time of
    /// the comparison grows with the square of the length.
    const LONGEST: usize = 40;
    if name.len() > LONGEST {
        return None;
    }
    let (name, letters) = (name.to_lowercase(), name.chars().count());
    let by_distance = known.into_iter().map(|known| {
        let distance = strsim::osa_distance(&name, &known.as_ref().to_lowercase());
        (distance, known)
    });
    let (distance, nearest) = by_distance.min_by_key(|(distance, _)| *distance)?;
    let close = distance <= letters.div_ceil(3).min(3) && distance < letters;
    close.then(|| format!("Did you mean `{}`?", nearest.as_ref()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelt_name_is_recognised_and_another_one_is_not() {
        let known = ["youngs_modulus", "poissons_ratio", "orthotropic", "name"];
        for (name, expected) in [
            ("young_modulus", Some("youngs_modulus")),
            ("poisson_ratio", Some("poissons_ratio")),
            ("Name", Some("name")),
            ("nmae", Some("name")),
            ("viscosity", None),
            ("x", None),
            ("", None),
        ] {
            let expected = expected.map(|name| format!("Did you mean `{name}`?"));
            assert_eq!(meant(name, known), expected, "{name}");
        }
        assert_eq!(meant(&"n".repeat(1 << 20), known), None);
    }

    #[test]
    fn a_long_text_is_quoted_by_its_beginning_and_length() {
        assert_eq!(quoted("top"), "top");
        let long = quoted(&"ä".repeat(1 << 20));
        assert_eq!(long, format!("{}… (1048576 characters)", "ä".repeat(80)));
        assert_eq!(text("a\"b"), r#""a\"b""#);
    }
}
