//! The JSON Pointers of a sweep to the values in which its members differ.

use solver::error::{Findings, Reason, Violation};

use crate::schema::quoted;

/// A JSON Pointer into the problem, and the place of the pointer itself in the definition of the sweep.
pub(super) struct Path {
    pub(super) at: String,
    pub(super) text: String,
    pub(super) tokens: Vec<String>,
}

/// The largest number of bytes of a JSON Pointer in a sweep: names in a problem are short.
pub const MOST_POINTER_BYTES: usize = 1 << 10;
/// The largest number of names and numbers in a JSON Pointer of a sweep: JSON is read to this depth.
pub const MOST_POINTER_TOKENS: usize = 64;

/// Checks and divides a JSON Pointer to a part of a problem. `at`: its place in the definition of the sweep.
pub(super) fn path(at: String, text: &str, found: &mut Findings) -> Option<Path> {
    // before it is divided: each of its parts takes many times the two bytes that it has in the text
    if text.len() > MOST_POINTER_BYTES || text.matches('/').count() > MOST_POINTER_TOKENS {
        found.add(Violation::new(
            at,
            Reason::TooLong,
            format!("a pointer of {} bytes: {:?}", text.len(), quoted(text)),
            format!(
                "at most {MOST_POINTER_BYTES} bytes and {MOST_POINTER_TOKENS} names or numbers"
            ),
            "Point to a value of the problem, such as /contacts/0/indentation.",
        ));
        return None;
    }
    let tokens = || -> Option<Vec<String>> {
        let tokens = text.strip_prefix('/')?.split('/');
        let read = |token: &str| {
            let mut escaped = token.split('~').skip(1);
            let sound = escaped.all(|rest| rest.starts_with(['0', '1']));
            sound.then(|| token.replace("~1", "/").replace("~0", "~"))
        };
        tokens.map(read).collect()
    };
    match tokens() {
        Some(tokens) => Some(Path {
            at,
            text: text.to_owned(),
            tokens,
        }),
        None => {
            found.add(Violation::new(
                at,
                Reason::Malformed,
                format!("{:?}", quoted(text)),
                "a JSON Pointer (RFC 6901) to a part of the problem, such as /contacts/0/indentation",
                "A pointer begins with / and has ~1 for / and ~0 for ~ in names.",
            ));
            None
        }
    }
}

/// Checks that no path equals another path or leads inside it.
pub(super) fn are_apart(paths: &[Path], found: &mut Findings) -> bool {
    let mut apart = true;
    for (k, path) in paths.iter().enumerate() {
        for other in &paths[..k] {
            let (longer, shorter) = if path.tokens.len() >= other.tokens.len() {
                (path, other)
            } else {
                (other, path)
            };
            if !longer.tokens.starts_with(&shorter.tokens) {
                continue;
            }
            apart = false;
            let (reason, expected) = if longer.tokens.len() == shorter.tokens.len() {
                (Reason::DuplicateName, "each pointer once")
            } else {
                (Reason::Conflict, "pointers of which none is inside another")
            };
            found.add(Violation::new(
                path.at.clone(),
                reason,
                format!(
                    "{} together with {}",
                    quoted(&path.text),
                    quoted(&other.text)
                ),
                expected,
                "Remove one of the two pointers: one value would replace the other.",
            ));
        }
    }
    apart
}
