//! A deck, read line by line.

use std::io::BufRead;

use solver::error::Reason;

use super::block::Block;
use super::deck::{Deck, Incomplete, Name};
use super::keyword::Keyword;
use crate::source::{ReadError, Source};

/// Reads a whole deck; its violations are noted in it.
pub(super) fn read(reader: impl BufRead) -> Result<Deck, ReadError> {
    let mut source = Source::new(reader);
    let mut deck = Deck::default();
    let mut block = Block::NoData("the first keyword");
    let mut material: Option<Name> = None;
    while source.advance()? {
        let line = source.line;
        let mut text = source.text().trim().to_owned();
        if text.is_empty() || text.starts_with("**") {
            continue;
        }
        if !text.starts_with('*') {
            deck.data(&mut block, line, &text);
            continue;
        }
        // a keyword line that ends in a comma continues on the next line
        while text.ends_with(',') && source.advance()? {
            text.push_str(source.text().trim());
        }
        deck.end(block, line);
        if deck.has_long_name(line, &text) {
            deck.incomplete = Incomplete {
                nodes: true,
                elements: true,
                names: true,
            };
            block = Block::Skip;
            continue;
        }
        block = deck.begin(&Keyword::new(&text), line, &mut material);
    }
    let line = source.line;
    deck.end(block, line);
    if deck.raw.nodes.is_empty() && !deck.incomplete.nodes {
        deck.fault(
            line,
            Reason::TooFew,
            "a deck without *NODE",
            "nodes and elements",
            "Check that the file is an Abaqus or CalculiX deck (.inp).",
        );
    }
    deck.faults.extend(deck.plane.fault());
    Ok(deck)
}
