//! Rust as a row of words and signs: as much of the language as it takes to find what a file names.

/// A word (`store`, `use`) or a sign (`::`, `{`), and its line. Comments, lifetimes, numbers and texts are left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Token<'a> {
    pub(crate) text: &'a str,
    pub(crate) line: usize,
}

impl Token<'_> {
    pub(crate) fn is_word(&self) -> bool {
        self.text.starts_with(starts_word)
    }
}

fn starts_word(c: char) -> bool {
    c == '_' || c.is_alphabetic()
}

fn goes_on(c: char) -> bool {
    c == '_' || c.is_alphanumeric()
}

/// The words and signs of a source.
pub(crate) fn tokens(source: &str) -> Vec<Token<'_>> {
    let mut found = Vec::new();
    let mut rest = source;
    let mut line = 1;
    while let Some(c) = rest.chars().next() {
        let length = silent(rest);
        if length > 0 {
            line += rest[..length].matches('\n').count();
            rest = &rest[length..];
            continue;
        }
        let length = match c {
            _ if rest.starts_with("::") => 2,
            c if starts_word(c) => rest.find(|c| !goes_on(c)).unwrap_or(rest.len()),
            c => c.len_utf8(),
        };
        let (text, after) = rest.split_at(length);
        found.push(Token { text, line });
        rest = after;
    }
    found
}

/// How long the comment, text, number, lifetime or space is that `rest` begins with; 0 if it begins with none.
fn silent(rest: &str) -> usize {
    let mut chars = rest.chars();
    match chars.next() {
        Some(c) if c.is_whitespace() => c.len_utf8(),
        Some('/') if rest.starts_with("//") => rest.find('\n').unwrap_or(rest.len()),
        Some('/') if rest.starts_with("/*") => comment(rest),
        Some('"') => text(rest, 1),
        Some('\'') => quoted(rest),
        Some('r' | 'b' | 'c') => prefixed(rest),
        Some(c) if c.is_ascii_digit() => number(rest),
        _ => 0,
    }
}

/// A comment in `/* */`, which may hold others.
fn comment(rest: &str) -> usize {
    let mut depth = 0;
    let mut at = 0;
    while at < rest.len() {
        if rest[at..].starts_with("/*") {
            (depth, at) = (depth + 1, at + 2);
        } else if rest[at..].starts_with("*/") {
            (depth, at) = (depth - 1, at + 2);
            if depth == 0 {
                return at;
            }
        } else {
            at += rest[at..].chars().next().map_or(1, char::len_utf8);
        }
    }
    at
}

/// A text in quotes, which begins at `from` after its first one.
fn text(rest: &str, from: usize) -> usize {
    let mut escaped = false;
    for (at, c) in rest[from..].char_indices() {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => return from + at + 1,
            _ => {}
        }
    }
    rest.len()
}

/// `r"…"`, `r#"…"#`, `b"…"`, `b'…'`, `c"…"` and what they make together; 0 for a word.
fn prefixed(rest: &str) -> usize {
    let prefix = rest.find(|c| !matches!(c, 'r' | 'b' | 'c')).unwrap_or(0);
    let after = &rest[prefix..];
    let hashes = after.len() - after.trim_start_matches('#').len();
    let raw = rest[..prefix].contains('r');
    if prefix > 2 {
        0
    } else if raw && after[hashes..].starts_with('"') {
        let end = format!("\"{}", "#".repeat(hashes));
        let inside = prefix + hashes + 1;
        let length = rest[inside..].find(&end);
        length.map_or(rest.len(), |length| inside + length + end.len())
    } else if raw && hashes == 1 && after[1..].starts_with(starts_word) {
        prefix + 1 // a word that is written `r#type`
    } else if after.starts_with('"') {
        text(rest, prefix + 1)
    } else if after.starts_with('\'') && prefix == 1 {
        prefix + quoted(after)
    } else {
        0
    }
}

/// A character `'c'`, or a lifetime `'a`.
fn quoted(rest: &str) -> usize {
    let mut chars = rest.char_indices().skip(1);
    match chars.next() {
        Some((_, '\\')) => {
            let end = rest[3..].find('\'');
            end.map_or(rest.len(), |end| 3 + end + 1)
        }
        Some((at, c)) if rest[at + c.len_utf8()..].starts_with('\'') => at + c.len_utf8() + 1,
        Some(_) => 1 + rest[1..].find(|c| !goes_on(c)).unwrap_or(rest.len() - 1),
        None => 1,
    }
}

fn number(rest: &str) -> usize {
    let whole = rest.find(|c| !goes_on(c)).unwrap_or(rest.len());
    let fraction = rest[whole..].strip_prefix('.');
    match fraction {
        Some(fraction) if fraction.starts_with(|c: char| c.is_ascii_digit()) => {
            whole + 1 + fraction.find(|c| !goes_on(c)).unwrap_or(fraction.len())
        }
        _ => whole,
    }
}

#[test]
fn only_words_and_signs_are_left() {
    let source = r##"
        // crate::comment
        use a::b; /* crate::c /* d */ e */
        const X: [&'static str; 2] = ["crate::f \" g", r#"crate::h"#];
        let c = ['"', '\'', b'x' as char]; x = 1.5e3 + 0..2; r#type::y('é')
    "##;
    let texts: Vec<_> = tokens(source).iter().map(|t| t.text).collect();
    assert_eq!(
        texts.join(" "),
        "use a :: b ; const X : [ & str ; ] = [ , ] ; let c = [ , , as char ] ; x = + . . ; type :: y ( )"
    );
    assert_eq!(tokens(source)[0].line, 3);
}
