//! Reads a deck line by line.

use std::io::BufRead;

use solver::error::Reason;

use super::block::Block;
use super::deck::{Deck, Inside};
use super::keyword::Keyword;
use super::written::Incomplete;
use crate::source::{ReadError, Source};

/// Reads a whole deck. Violations are recorded in the deck.
pub(super) fn read(reader: impl BufRead) -> Result<Deck, ReadError> {
    let mut source = Source::new(reader);
    let mut deck = Deck::default();
    let mut block = Block::NoData("the first keyword");
    // a keyword that ended the one before, which a comma seemed to continue
    let mut ahead: Option<String> = None;
    loop {
        let mut text = match ahead.take() {
            Some(text) => text,
            None if source.advance()? => source.text().trim().to_owned(),
            None => break,
        };
        let line = source.line;
        if is_left_out(&text) {
            continue;
        }
        if !text.starts_with('*') {
            deck.data(&mut block, line, &text);
            continue;
        }
        // a keyword line that ends in a comma continues on the next line that is no comment
        while text.ends_with(',') && source.advance()? {
            let next = source.text().trim();
            if next.starts_with('*') && !is_left_out(next) {
                ahead = Some(next.to_owned());
                break;
            }
            if !is_left_out(next) {
                text.push_str(next);
            }
        }
        deck.end(block, line);
        if deck.has_long_name(line, &text) {
            deck.here.incomplete = Incomplete::ALL;
            block = Block::Skip;
            continue;
        }
        block = deck.begin(&Keyword::new(&text), line);
    }
    let line = source.line;
    deck.end(block, line);
    let open = match &deck.inside {
        Inside::Assembly => None,
        Inside::Part(name) => Some(("PART", name.clone())),
        Inside::Instance(name) => Some(("INSTANCE", name.clone())),
    };
    if let Some((keyword, name)) = open {
        deck.here = std::mem::take(&mut deck.assembly);
        deck.here.incomplete = Incomplete::ALL;
        deck.fault(
            line,
            Reason::Truncated,
            format!("*{keyword}, NAME={name:.60} without its end"),
            &format!("*END {keyword}"),
            "End it, or send the whole deck.",
        );
    }
    Ok(deck)
}

/// Whether a line has no content: it is empty or a comment.
fn is_left_out(text: &str) -> bool {
    text.is_empty() || text.starts_with("**")
}
