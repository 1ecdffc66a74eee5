//! Springs of a deck between nodes and the ground: elements SPRING1, and `*SPRING`.

use std::collections::BTreeMap;

use super::block::Block;
use super::build::Built;
use super::deck::Deck;
use super::keyword::Keyword;
use super::written::{DECIMAL_POINT, PlacedSpring, Spring, fields, number};
use solver::problem::{SpringStiffness, Support};

const SPRING: &str = "*SPRING, ELSET=… of elements SPRING1; a data line with 1 (x) or 2 (y), and one with a stiffness ≥ 0 (force per length)";

impl Deck {
    pub(super) fn spring_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        let other = keyword.parameters.iter().find(|(name, _)| name != "ELSET");
        if let Some((name, _)) = other {
            let got = format!("*SPRING with {name:.40}");
            self.doubt(line, got, SPRING, "Springs are linear, along x or y.");
        }
        let Some(elements) = self.named(keyword, "ELSET") else {
            self.doubt(
                line,
                "*SPRING without ELSET",
                SPRING,
                "Name the set of the springs.",
            );
            return Block::Skip;
        };
        Block::Spring(Spring {
            line,
            elements,
            component: None,
            stiffness: Vec::new(),
            lines: 0,
        })
    }

    /// Reads a data line of `*SPRING`.
    pub(super) fn spring_data(&mut self, spring: &mut Spring, line: u64, text: &str) {
        let words = fields(text);
        let first = words.first().copied().unwrap_or_default();
        let others_are_blank = words.iter().skip(1).all(|word| word.is_empty());
        spring.lines += 1;
        if spring.lines == 1 {
            let component = first.parse().ok().filter(|c| (1..=2).contains(c));
            spring.component = component.filter(|_| others_are_blank);
            if spring.component.is_none() {
                let hint = "A plane body has springs along x or y, between a node and the ground.";
                self.doubt(
                    line,
                    format!("`{text:.60}`: the direction of a spring"),
                    "1 (x) or 2 (y)",
                    hint,
                );
            }
            return;
        }
        // the third number is the temperature, and there is no second one
        let second_is_blank = words.get(1).is_none_or(|word| word.is_empty());
        match number(first).filter(|k| *k >= 0.0 && second_is_blank && words.len() <= 3) {
            Some(stiffness) => spring.stiffness.push(stiffness),
            None => self.doubt(
                line,
                format!("`{text:.60}` for a stiffness"),
                "a number ≥ 0",
                DECIMAL_POINT,
            ),
        }
    }

    /// Stores what the data lines of `*SPRING` say.
    pub(super) fn end_spring(&mut self, spring: Spring) {
        let differs = spring.stiffness.windows(2).any(|pair| pair[0] != pair[1]);
        if differs {
            let got = "a stiffness that depends on temperature";
            self.doubt(
                spring.line,
                got,
                SPRING,
                "Give the stiffness at the temperature of the body.",
            );
        } else if spring.lines == 0 || spring.component.is_some() && spring.stiffness.is_empty() {
            self.doubt(
                spring.line,
                "*SPRING without its data lines",
                SPRING,
                "Write direction and stiffness on two lines.",
            );
        }
        self.here.springs.push(spring);
    }
}

impl Built {
    /// The supports of the springs, and the sets of nodes that they need, by name: nodes at which equally many springs of
    /// one `*SPRING` act. A stiffness is divided by `thickness`, that of a body in plane strain.
    pub(super) fn spring_supports(&self, thickness: f64) -> Vec<(Support, Vec<u32>)> {
        let mut found = Vec::new();
        for PlacedSpring {
            spring,
            name,
            nodes,
        } in &self.springs
        {
            let (Some(component), Some(stiffness)) = (spring.component, spring.stiffness.first())
            else {
                continue;
            };
            let mut times: BTreeMap<u32, u32> = BTreeMap::new();
            nodes
                .iter()
                .for_each(|node| *times.entry(*node).or_default() += 1);
            let mut sets: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
            for (node, times) in times {
                sets.entry(times).or_default().push(node);
            }
            for (times, nodes) in sets {
                let value = stiffness * f64::from(times) / thickness;
                let (axis, stiffness) = match component {
                    1 => (
                        "x",
                        SpringStiffness {
                            x: value,
                            ..SpringStiffness::default()
                        },
                    ),
                    _ => (
                        "y",
                        SpringStiffness {
                            y: value,
                            ..SpringStiffness::default()
                        },
                    ),
                };
                if value == 0.0 {
                    continue;
                }
                let of_times = if times == 1 {
                    String::new()
                } else {
                    format!(", {times} times")
                };
                let set = format!(
                    "{name} (springs along {axis}, line {}{of_times})",
                    spring.line
                );
                let support = Support {
                    nodes: Some(set),
                    stiffness: Some(stiffness),
                    ..Support::default()
                };
                found.push((support, nodes));
            }
        }
        found
    }
}
