//! The allowed values of a parameter: describes them, reads them, and lists them in errors.

use std::{borrow::Cow, ops::RangeInclusive};

use serde_json::json;
use strum::VariantArray;

use crate::time::Time;

/// A set of allowed values, written as text.
pub trait Values {
    /// The type of a value that was read.
    type Value;

    /// The allowed texts, as JSON Schema.
    fn schema(&self) -> serde_json::Value;

    /// The allowed texts in words, for errors.
    fn expected(&self) -> String;

    /// The value that this text stands for; `None` if it is not allowed.
    fn read(&self, text: &str) -> Option<Self::Value>;

    /// The part of a text that is not allowed, for errors; all of it, unless a list has parts that are.
    fn fault<'t>(&self, text: &'t str) -> Cow<'t, str> {
        text.into()
    }
}

/// Any text.
#[derive(Clone, Copy, Debug)]
pub struct Text;

impl Values for Text {
    type Value = String;

    fn schema(&self) -> serde_json::Value {
        json!({ "type": "string" })
    }

    fn expected(&self) -> String {
        "a text".into()
    }

    fn read(&self, text: &str) -> Option<String> {
        Some(text.to_owned())
    }
}

/// Whole numbers within bounds.
#[derive(Clone, Debug)]
pub struct Integers(pub RangeInclusive<i64>);

impl Values for Integers {
    type Value = i64;

    fn schema(&self) -> serde_json::Value {
        json!({ "type": "integer", "minimum": self.0.start(), "maximum": self.0.end() })
    }

    fn expected(&self) -> String {
        let (least, most) = (self.0.start(), self.0.end());
        match *most {
            i64::MAX => format!("a whole number, {least} or more"),
            most => format!("a whole number from {least} to {most}"),
        }
    }

    fn read(&self, text: &str) -> Option<i64> {
        text.parse().ok().filter(|number| self.0.contains(number))
    }
}

/// Times in seconds, within bounds.
#[derive(Clone, Debug)]
pub struct Seconds(pub RangeInclusive<f64>);

impl Values for Seconds {
    type Value = f64;

    fn schema(&self) -> serde_json::Value {
        json!({ "type": "number", "minimum": self.0.start(), "maximum": self.0.end() })
    }

    fn expected(&self) -> String {
        format!("{} … {} seconds", self.0.start(), self.0.end())
    }

    fn read(&self, text: &str) -> Option<f64> {
        text.parse().ok().filter(|seconds| self.0.contains(seconds))
    }
}

/// Points in time.
#[derive(Clone, Copy, Debug)]
pub struct Times;

impl Values for Times {
    type Value = Time;

    fn schema(&self) -> serde_json::Value {
        json!({ "type": "string", "format": "date-time" })
    }

    fn expected(&self) -> String {
        "a time as 2026-01-31T12:00:00Z (RFC 3339)".into()
    }

    fn read(&self, text: &str) -> Option<Time> {
        Time::parse(text)
    }
}

/// A list of words, each with its value.
#[derive(Clone, Copy, Debug)]
pub struct Words<T>(pub fn() -> Vec<(&'static str, T)>);

impl<T> Values for Words<T> {
    type Value = T;

    fn schema(&self) -> serde_json::Value {
        json!({ "type": "string", "enum": self.words() })
    }

    /// The words in a list such as `a, b or c`.
    fn expected(&self) -> String {
        let words = self.words();
        match words.split_last() {
            Some((last, others)) if !others.is_empty() => {
                format!("{} or {last}", others.join(", "))
            }
            _ => words.concat(),
        }
    }

    fn read(&self, text: &str) -> Option<T> {
        let mut all = self.0().into_iter();
        all.find_map(|(word, value)| (word == text).then_some(value))
    }
}

impl<T: VariantArray + Copy + Into<&'static str>> Words<T> {
    /// All variants of an enum.
    pub const fn all() -> Words<T> {
        Words(|| {
            T::VARIANTS
                .iter()
                .map(|one| ((*one).into(), *one))
                .collect()
        })
    }
}

impl<T> Words<T> {
    fn words(&self) -> Vec<&'static str> {
        self.0().into_iter().map(|(word, _)| word).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_read_if_it_is_allowed() {
        let pages = Integers(1..=1000);
        assert_eq!(pages.expected(), "a whole number from 1 to 1000");
        assert_eq!(pages.read("1000"), Some(1000));
        for wrong in ["0", "1001", "1.5", "many", ""] {
            assert_eq!(pages.read(wrong), None, "{wrong}");
        }
        assert_eq!(
            Integers(0..=i64::MAX).expected(),
            "a whole number, 0 or more"
        );
        let wait = Seconds(0.0..=60.0);
        assert_eq!(wait.expected(), "0 … 60 seconds");
        assert_eq!(wait.read("0.5"), Some(0.5));
        for wrong in ["-1", "61", "NaN", "soon"] {
            assert_eq!(wait.read(wrong), None, "{wrong}");
        }
        assert_eq!(Times.read("yesterday"), None);
    }

    #[test]
    fn valid_words_are_listed_when_another_was_given() {
        let letters = Words(|| vec![("a", 1), ("b", 2), ("c", 3)]);
        assert_eq!(letters.expected(), "a, b or c");
        assert_eq!((letters.read("b"), letters.read("d")), (Some(2), None));
        assert_eq!(
            Words(|| vec![("light", 0), ("dark", 1)]).expected(),
            "light or dark"
        );
        assert_eq!(Words(|| vec![("terminal", ())]).expected(), "terminal");
    }
}
