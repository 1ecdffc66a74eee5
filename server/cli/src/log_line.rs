//! Cleans a line of the log: it stays one line, whatever names, paths and headers of clients are in it; it loses the
//! secrets of tokens, and is not too long.

use std::{
    borrow::Cow,
    io::{self, Write},
};

use serde_json::Value;
use service::config::LogFormat;
use tracing_appender::non_blocking::NonBlocking;
use tracing_subscriber::fmt::MakeWriter;

/// The largest length of a line (bytes).
const LONGEST_LINE: usize = 4096;
/// The largest length of a text in a long line of JSON, which could not be parsed if it was cut anywhere.
const LONGEST_TEXT: usize = 500;
/// The length of a token's id, which follows `sgn_` and is not secret.
const ID: usize = 12;

/// Writes lines of the log after cleaning them, each in one call, as the layer of `tracing_subscriber` requires.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    pub(super) to: NonBlocking,
    pub(super) format: LogFormat,
    /// Whether to keep colours, which are escape sequences; the layer removes escape sequences from its input.
    pub(super) colours: bool,
}

impl Write for Lines {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let line = String::from_utf8_lossy(bytes);
        let line = clean(&line, self.format, self.colours);
        self.to.write_all(line.as_bytes())?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

impl MakeWriter<'_> for Lines {
    type Writer = Lines;

    fn make_writer(&self) -> Lines {
        self.clone()
    }
}

/// Cleans a line; the result ends with a line feed.
fn clean(line: &str, format: LogFormat, colours: bool) -> Cow<'_, str> {
    let body = line.strip_suffix('\n').unwrap_or(line);
    let harmless = |character| !breaks(character) || (colours && character == '\u{1b}');
    let short = body.len() <= LONGEST_LINE;
    if short && !body.contains("sgn") && body.chars().all(harmless) && line.len() > body.len() {
        return Cow::Borrowed(line); // nearly always
    }
    let mut text = without_secrets(body);
    if !text.chars().all(harmless) {
        let mut escaped = String::with_capacity(text.len());
        for character in text.chars() {
            if harmless(character) {
                escaped.push(character)
            } else {
                // as JSON has it, so that a line of JSON stays one
                escaped.push_str(&format!("\\u{:04x}", u32::from(character)))
            }
        }
        text = escaped;
    }
    if text.len() > LONGEST_LINE {
        text = match format {
            LogFormat::Text => cut(&text, LONGEST_LINE),
            LogFormat::Json => match serde_json::from_str::<Value>(&text) {
                Ok(mut value) => {
                    shorten(&mut value);
                    value.to_string()
                }
                Err(_) => Value::from(cut(&text, LONGEST_LINE)).to_string(),
            },
        };
    }
    text.push('\n');
    Cow::Owned(text)
}

/// Whether a character is a control character, ends a line, or changes the direction of text.
fn breaks(character: char) -> bool {
    character.is_control()
        || matches!(character, '\u{2028}' | '\u{2029}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Removes the secrets of tokens from a line. This program logs no token, but a client may have put one into a path.
fn without_secrets(line: &str) -> String {
    let mut text = String::with_capacity(line.len());
    let mut rest = line;
    while let Some(start) = rest.find("sgn") {
        let (before, found) = rest.split_at(start + 3);
        text.push_str(before);
        rest = found;
        let mark = found.get(..3).unwrap_or_default();
        let mark = match mark.eq_ignore_ascii_case("%5f") {
            true => 3,
            false if mark.starts_with('_') => 1,
            false => continue,
        };
        let part = |byte: &u8| byte.is_ascii_alphanumeric() || b"_-%".contains(byte);
        let length = mark + found.bytes().skip(mark).take_while(|b| part(b)).count();
        // a token has both, and nothing else that is called so is as long
        if length > mark + ID {
            text.push_str(found.get(..mark + ID).unwrap_or_default());
            text.push('…');
            rest = found.get(length..).unwrap_or_default();
        }
    }
    text.push_str(rest);
    text
}

fn cut(text: &str, longest: usize) -> String {
    let end = text.floor_char_boundary(longest);
    let kept = text.get(..end).unwrap_or_default();
    format!("{kept}… ({} bytes)", text.len())
}

fn shorten(value: &mut Value) {
    match value {
        Value::String(text) if text.len() > LONGEST_TEXT => *text = cut(text, LONGEST_TEXT),
        Value::Array(items) => items.iter_mut().for_each(shorten),
        Value::Object(fields) => fields.values_mut().for_each(shorten),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_line_stays_one_line_and_is_not_too_long() {
        let text = |line| clean(line, LogFormat::Text, false).into_owned();
        assert_eq!(text("as it is: µ\n"), "as it is: µ\n");
        assert_eq!(
            text("a\nb\r\u{1b}[2J\u{85}\u{2028}\u{202e}\n"),
            "a\\u000ab\\u000d\\u001b[2J\\u0085\\u2028\\u202e\n"
        );
        assert_eq!(clean("\u{1b}[2m\n", LogFormat::Text, true), "\u{1b}[2m\n");
        let long = text(&format!("{}\n", "ä".repeat(5000)));
        assert!(long.len() < LONGEST_LINE + 30 && long.ends_with("… (10000 bytes)\n"));
    }

    #[test]
    fn a_long_line_of_json_stays_json() {
        let object = serde_json::json!({"message": "x".repeat(9000), "n": 3});
        let line = clean(&format!("{object}\n"), LogFormat::Json, false).into_owned();
        assert!(line.len() < LONGEST_LINE);
        let value: Value = serde_json::from_str(&line).unwrap();
        assert_eq!(value["n"], 3);
        assert!(value["message"].as_str().unwrap().ends_with("(9000 bytes)"));
    }

    #[test]
    fn secrets_of_tokens_are_left_out_and_their_ids_are_not() {
        let secret = "Abc-_123".repeat(5);
        for (line, expected) in [
            (
                format!("/v1/tokens/sgn_2884b8f50acc_{secret}/x"),
                "/v1/tokens/sgn_2884b8f50acc…/x",
            ),
            (
                format!("sgn%5F2884b8f50acc%5f{secret}"),
                "sgn%5F2884b8f50acc…",
            ),
            (format!("sgn_{secret}"), "sgn_Abc-_123Abc-…"),
            (
                "sgn_2884b8f50acc sgn sgn_".into(),
                "sgn_2884b8f50acc sgn sgn_",
            ),
        ] {
            assert_eq!(
                clean(&line, LogFormat::Text, false),
                format!("{expected}\n")
            );
        }
    }
}
