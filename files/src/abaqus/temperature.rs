//! Temperatures of a deck. Only changes of temperature cause thermal strains: `*INITIAL CONDITIONS` causes none, nor
//! does a `*TEMPERATURE` equal to them.

use super::block::Block;
use super::deck::Deck;
use super::keyword::Keyword;
use super::written::{fields, number};

/// The largest number of rows of `*INITIAL CONDITIONS` that are kept, to compare the rows of `*TEMPERATURE` with them.
const MOST_ROWS: usize = 1 << 16;

impl Deck {
    /// Reads `*INITIAL CONDITIONS`; kinds that affect a static step are refused.
    pub(super) fn initial_conditions(&mut self, keyword: &Keyword, line: u64) -> Block {
        let kind = keyword.get("TYPE").unwrap_or_default().to_uppercase();
        match &kind[..] {
            "TEMPERATURE" => {
                // a file or a subroutine gives others
                self.temperatures.others |= keyword.parameters.len() > 1;
                Block::InitialTemperatures
            }
            "VELOCITY" | "ROTATING VELOCITY" => Block::Skip,
            _ => {
                let got = match &kind[..] {
                    "" => "*INITIAL CONDITIONS without TYPE".to_owned(),
                    kind => format!("*INITIAL CONDITIONS, TYPE={kind:.40}"),
                };
                self.doubt(
                    line,
                    got,
                    "TYPE=TEMPERATURE or TYPE=VELOCITY, which do not change a static step by themselves",
                    "The body has no stress and strain before the first step. Remove these conditions if that is intended.",
                );
                Block::Skip
            }
        }
    }

    pub(super) fn temperature_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        let other = keyword.parameters.iter().find(|(name, _)| name != "OP");
        if let Some((name, _)) = other {
            let got = format!("*TEMPERATURE with {name:.40}");
            self.temperatures.changed.get_or_insert((line, got));
        }
        Block::Temperatures
    }

    /// Reads a row of temperatures: node or set, value.
    pub(super) fn temperature(&mut self, is_initial: bool, line: u64, text: &str) {
        let words = fields(text);
        let word = |k: usize| words.get(k).copied().unwrap_or_default();
        let value = match word(1) {
            "" => Some(0.0),
            word => number(word),
        };
        let Some(value) = value else {
            return self.doubt(
                line,
                format!("`{:.40}` for a temperature", word(1)),
                "a number",
                "Write node or set and temperature: `ALL, 20.`",
            );
        };
        let target = self.target(word(0));
        let known = &mut self.temperatures;
        if !is_initial {
            if !known.is_initial(&target, value) {
                let got = format!("a temperature of {value} for `{:.60}`", word(0));
                known.changed.get_or_insert((line, got));
            }
        } else if known.initial.len() < MOST_ROWS {
            known.initial.push((target, value));
        } else {
            known.others = true;
        }
    }
}
