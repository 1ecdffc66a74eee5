//! Reads a problem or a sweep from a file for submission, and reports its violations with their lines.

use std::{
    collections::BTreeMap,
    io::Read,
    path::{Path, PathBuf},
};

use anyhow::{Context, bail};
use serde::Deserialize;
use serde_json::value::{RawValue, to_raw_value};
use service::error::ApiError;
use solver::error::Violation;

use super::super::{
    service::{CallError, Refusal},
    sweep,
};

/// The largest number of violations that are printed.
const MOST_TOLD: usize = 100;

/// What a file submits: a job or a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Job,
    Sweep,
}

/// A file to be submitted.
pub(super) struct Submitted {
    path: PathBuf,
    /// The text of the file, for counting lines.
    text: String,
    pub(super) kind: Kind,
    /// The fields of the request as JSON text, so that every number is sent as it is written in the file.
    pub(super) fields: BTreeMap<String, Box<RawValue>>,
    /// The beginning of pointers into the request that pointers into the file lack: `/problem` if the file is the
    /// problem itself, otherwise empty.
    envelope: &'static str,
}

#[derive(Deserialize)]
struct Names<'a> {
    #[serde(borrow)]
    problem: Option<&'a RawValue>,
    #[serde(borrow)]
    base: Option<&'a RawValue>,
}

impl Submitted {
    /// Reads a file, or standard input as `-`: a problem as JSON, a deck (.inp), a request with a problem, or a sweep.
    pub(super) fn read(path: &Path) -> anyhow::Result<Submitted> {
        let mut bytes = Vec::new();
        let unread = || format!("cannot read {}", path.display());
        let read = if path.as_os_str() == "-" {
            std::io::stdin().read_to_end(&mut bytes).map(|_| ())
        } else {
            std::fs::read(path).map(|found| bytes = found)
        };
        read.with_context(unread)?;
        let deck = path
            .extension()
            .is_some_and(|ending| ending.eq_ignore_ascii_case("inp"));
        if deck {
            let text = files::text(bytes);
            let mut submitted = Submitted {
                path: path.to_path_buf(),
                text,
                kind: Kind::Job,
                fields: BTreeMap::new(),
                envelope: "/problem",
            };
            let read = files::abaqus::problem_with_warnings(&submitted.text);
            let (problem, warnings) = match read {
                Ok(read) => read,
                Err(violations) => {
                    submitted.tell(&violations);
                    // all of them are told already, with their lines
                    bail!(ApiError::InvalidProblem(Vec::new()));
                }
            };
            for warning in warnings {
                eprintln!("{}: {}", path.display(), warning.message);
            }
            let problem = to_raw_value(&problem)?;
            submitted.fields.insert("problem".to_owned(), problem);
            return Ok(submitted);
        }
        let mut text = String::from_utf8(bytes).with_context(unread)?;
        if text.starts_with(files::BYTE_ORDER_MARK) {
            text.drain(..files::BYTE_ORDER_MARK.len_utf8());
        }
        let path = path.to_path_buf();
        let names: Names<'_> = match serde_json::from_str(&text) {
            Ok(names) => names,
            Err(error) => bail!(ApiError::InvalidProblem(vec![Violation::new(
                "",
                solver::error::Reason::Malformed,
                format!("{}: {error}", path.display()),
                "a problem or a sweep as JSON",
                "Check the text there; examples are in examples/.",
            )])),
        };
        let (kind, envelope) = match (names.problem, names.base) {
            (Some(_), _) => (Kind::Job, ""),
            (None, Some(_)) => (Kind::Sweep, ""),
            (None, None) => (Kind::Job, "/problem"),
        };
        let fields = match (kind, envelope) {
            (Kind::Job, "/problem") => {
                let problem = RawValue::from_string(text.clone())?;
                [("problem".to_owned(), problem)].into()
            }
            (Kind::Job, _) => serde_json::from_str(&text)?,
            (Kind::Sweep, _) => {
                let mut fields: BTreeMap<String, Box<RawValue>> = serde_json::from_str(&text)?;
                let base = names.base.map_or("", RawValue::get);
                if let Some(base) = sweep::base_from_file(&path, base)? {
                    fields.insert("base".into(), base);
                }
                fields
            }
        };
        Ok(Submitted {
            path,
            text,
            kind,
            fields,
            envelope,
        })
    }

    /// The request as JSON.
    pub(super) fn body(&self) -> anyhow::Result<String> {
        Ok(serde_json::to_string(&self.fields)?)
    }

    /// Converts a pointer into the request to a pointer into the file.
    pub(super) fn in_file<'a>(&self, pointer: &'a str) -> &'a str {
        pointer.strip_prefix(self.envelope).unwrap_or(pointer)
    }

    /// Prints violations, with the line of the file for each.
    pub(super) fn tell(&self, violations: &[Violation]) {
        let many = match violations.len() {
            1 => "violation",
            _ => "violations",
        };
        eprintln!("{}: {} {many}", self.path.display(), violations.len());
        for violation in violations.iter().take(MOST_TOLD) {
            let pointer = self.in_file(&violation.pointer);
            let shown = Violation {
                pointer: pointer.to_owned(),
                ..violation.clone()
            };
            let path = self.path.display();
            let in_deck = shown.line().and_then(|line| usize::try_from(line).ok());
            let line = in_deck.or_else(|| files::pointer::line_of(&self.text, pointer));
            match line {
                Some(line) if in_deck.is_none() => eprintln!("{path}:{line}: {shown}"),
                // a deck has other places than the problem made of it
                _ => eprintln!("{}", shown.in_file(path)),
            }
            if let Some(line) = line {
                let text = self.text.lines().nth(line.saturating_sub(1));
                let text: String = text.unwrap_or_default().chars().take(100).collect();
                eprintln!("{line:>6} | {text}");
            }
        }
        if let more @ 1.. = violations.len().saturating_sub(MOST_TOLD) {
            eprintln!("and {more} more");
        }
    }

    /// Prints the violations for which the service has refused the file, if `error` has any; returns the error
    /// unchanged.
    pub(super) fn refused(&self, error: anyhow::Error) -> anyhow::Error {
        if let Some(CallError::Refused(refusal)) = error.downcast_ref() {
            let Refusal { violations, .. } = &**refusal;
            if !violations.is_empty() {
                self.tell(violations);
            }
        }
        error
    }
}
