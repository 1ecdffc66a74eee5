//! Reads the data of a deck about contact: rigid surfaces and bodies, pairs of surfaces, and their interactions.

use super::block::{Block, named_components};
use super::contact_parts::{
    Adjust, Behavior, Clearance, ContactBlock, DeckFriction, DeckStep, Held, Interaction, MadeOf,
    Pair, RigidBody, Tie, WRITTEN_INSTEAD,
};
use super::deck::Deck;
use super::keyword::Keyword;
use super::tool::Piece;
use super::written::{DECIMAL_POINT, Name, Target, fields, number};

/// The largest number of contact pairs, of rigid bodies, and of pieces of an analytical surface.
const MOST: usize = 1000;

/// The largest number of characters of the name of a step that are kept.
const LONGEST_STEP: usize = 60;

impl Deck {
    /// Begins the block of a keyword about contact; `None` for other keywords.
    pub(super) fn begin_contact(&mut self, keyword: &Keyword, line: u64) -> Option<Block> {
        let value = |name: &str| keyword.get(name).map(str::to_owned);
        let block = match &keyword.name[..] {
            "STEP" => {
                let name = value("NAME").map(|name| name.chars().take(LONGEST_STEP).collect());
                self.contact.steps.push(DeckStep {
                    line,
                    name,
                    increments: None,
                });
                return None;
            }
            "SURFACE" if value("TYPE").is_some_and(|t| t.eq_ignore_ascii_case("SEGMENTS")) => {
                let Some(name) = value("NAME").map(|name| self.spelled(&name)) else {
                    return Some(self.nameless(line, "*SURFACE", "NAME"));
                };
                if keyword.has("FILLET RADIUS") {
                    self.doubt(
                        line,
                        "*SURFACE, TYPE=SEGMENTS with FILLET RADIUS",
                        "corners rounded by CIRCL",
                        "Write the fillets out as arcs.",
                    );
                }
                self.here.analytical.entry(name.clone()).or_default();
                ContactBlock::Segments(name)
            }
            "RIGID BODY" => {
                self.rigid_body(keyword, line);
                return Some(Block::Skip);
            }
            "CONTACT PAIR" => return Some(self.contact_pairs(keyword, line)),
            "TIE" => return Some(self.ties(keyword, line)),
            "CLEARANCE" => {
                self.clearance(keyword, line);
                return Some(Block::Skip);
            }
            "SURFACE INTERACTION" => {
                let Some(name) = value("NAME").map(|name| self.spelled(&name)) else {
                    self.doubt(
                        line,
                        "*SURFACE INTERACTION",
                        "*SURFACE INTERACTION, NAME=…",
                        "Name the interaction.",
                    );
                    return Some(Block::Skip);
                };
                self.contact
                    .interactions
                    .insert(name.clone(), Interaction::default());
                self.contact.current = Some(name);
                // its data are the depth of the section, which the elements have already
                return Some(Block::Skip);
            }
            "FRICTION" => return Some(self.friction_block(keyword, line)),
            "SURFACE BEHAVIOR" => return Some(self.behavior_block(keyword, line)),
            "MODEL CHANGE" => {
                self.model_change(keyword, line);
                return Some(Block::Skip);
            }
            "CONTACT INTERFERENCE"
            | "CHANGE FRICTION"
            | "CONTACT"
            | "CONTACT INCLUSIONS"
            | "CONTACT EXCLUSIONS"
            | "CONTACT PROPERTY ASSIGNMENT"
            | "CONTACT INITIALIZATION DATA"
            | "CONTACT CLEARANCE"
            | "GAP"
            | "CONTACT DAMPING"
            | "RIGID SURFACE"
            | "IMPERFECTION" => {
                self.doubt(
                    line,
                    format!("*{}", keyword.name),
                    "*CONTACT PAIR of two surfaces, with *CLEARANCE; *TIE",
                    WRITTEN_INSTEAD,
                );
                return Some(Block::Skip);
            }
            _ => return None,
        };
        Some(Block::Contact(block))
    }

    /// Refuses `*MODEL CHANGE`, which removes or adds elements or contact pairs between steps.
    fn model_change(&mut self, keyword: &Keyword, line: u64) {
        let is_pair = keyword.is("TYPE", "CONTACT PAIR");
        let what = if is_pair { "CONTACT PAIR" } else { "ELEMENT" };
        let action = ["REMOVE", "ADD"].into_iter().find(|a| keyword.has(a));
        let got = match action {
            Some(action) => format!("*MODEL CHANGE, TYPE={what}, {action}"),
            None => format!("*MODEL CHANGE, TYPE={what}"),
        };
        let (expected, hint) = match (is_pair, action) {
            (true, Some("REMOVE")) => (
                "contact pairs that may touch in every step",
                "Delete this keyword if the pair still acts in the last step, and the pair itself if it does not.",
            ),
            (true, _) => (
                "contact pairs that may touch in every step",
                "Delete this keyword: a pair acts from the first step on, wherever its surfaces touch.",
            ),
            (false, Some("REMOVE")) => (
                "the same elements in every step",
                "Elements cannot be removed between steps. Leave them out of the deck if the body is without them from the beginning; what they carried before the step is not computed here.",
            ),
            (false, _) => (
                "the same elements in every step",
                "Elements cannot be added between steps. Delete this keyword if they belong to the body from the beginning.",
            ),
        };
        self.doubt(line, got, expected, hint);
    }

    fn rigid_body(&mut self, keyword: &Keyword, line: u64) {
        let name = |deck: &mut Deck, parameter: &str| {
            keyword.get(parameter).map(|name| deck.spelled(name))
        };
        let made_of = [
            name(self, "ANALYTICAL SURFACE").map(MadeOf::Surface),
            name(self, "ELSET").map(MadeOf::Elements),
            name(self, "NSET").map(MadeOf::Nodes),
        ];
        let mut made_of = made_of.into_iter().flatten();
        let (Some(first), None, Some(reference)) =
            (made_of.next(), made_of.next(), keyword.get("REF NODE"))
        else {
            return self.doubt(
                line,
                "*RIGID BODY",
                "*RIGID BODY with REF NODE and one of ANALYTICAL SURFACE, ELSET, NSET",
                WRITTEN_INSTEAD,
            );
        };
        for parameter in ["PIN NSET", "TIE NSET", "ISOTHERMAL"] {
            if keyword.has(parameter) && parameter != "ISOTHERMAL" {
                self.doubt(
                    line,
                    format!("*RIGID BODY with {parameter}"),
                    "a rigid body that holds no node of the elastic body",
                    "Support the nodes of the elastic body by *BOUNDARY instead.",
                );
            }
        }
        if self.here.rigid_bodies.len() >= MOST {
            let (got, expected) = ("one more *RIGID BODY", format!("at most {MOST}"));
            return self.doubt(line, got, &expected, WRITTEN_INSTEAD);
        }
        let reference = self.target(reference);
        let rotation = keyword.get("ROT NODE").map(str::to_owned);
        let rotation = rotation.map(|node| self.target(&node));
        self.here.rigid_bodies.push(RigidBody {
            line,
            made_of: first,
            reference,
            rotation,
        });
    }

    fn contact_pairs(&mut self, keyword: &Keyword, line: u64) -> Block {
        /// Parameters that change nothing in small sliding against a rigid surface, which is smooth and needs no
        /// stiffness.
        const HARMLESS: [&str; 16] = [
            "TYPE",
            "SMALL SLIDING",
            "INTERACTION",
            "ADJUST",
            "HCRIT",
            "EXTENSION ZONE",
            "SMOOTH",
            "TRACKING",
            "CPSET",
            "SUPPLEMENTARY CONSTRAINTS",
            "NO THICKNESS",
            "MECHANICAL CONSTRAINT",
            "WEIGHT",
            "SLIDING TRANSITION",
            "MIDFACE CORNERS",
            "GEOMETRIC CORRECTION",
        ];
        for (name, _) in &keyword.parameters {
            if !HARMLESS.contains(&&name[..]) {
                self.doubt(
                    line,
                    format!("*CONTACT PAIR with {name:.40}"),
                    &format!("*CONTACT PAIR without {name:.40}"),
                    WRITTEN_INSTEAD,
                );
            }
        }
        let adjust = keyword.get("ADJUST").map(|value| match number(value) {
            Some(within) => Adjust::Within(within),
            None => Adjust::Set,
        });
        let interaction = keyword.get("INTERACTION").map(|name| self.spelled(name));
        Block::Contact(ContactBlock::Pairs {
            interaction,
            adjust,
            tie: None,
        })
    }

    fn ties(&mut self, keyword: &Keyword, line: u64) -> Block {
        const KNOWN: [&str; 6] = [
            "NAME",
            "POSITION TOLERANCE",
            "ADJUST",
            "TYPE",
            "NO ROTATION",
            "NO THICKNESS",
        ];
        for (name, _) in &keyword.parameters {
            if !KNOWN.contains(&&name[..]) {
                self.doubt(
                    line,
                    format!("*TIE with {name:.40}"),
                    "*TIE with NAME, POSITION TOLERANCE and ADJUST",
                    WRITTEN_INSTEAD,
                );
            }
        }
        let within = self.parameter(keyword, "POSITION TOLERANCE", line);
        Block::Contact(ContactBlock::Pairs {
            interaction: None,
            adjust: None,
            tie: Some(Tie { within }),
        })
    }

    /// Reads `*CLEARANCE`, which has no data lines.
    fn clearance(&mut self, keyword: &Keyword, line: u64) {
        const KNOWN: [&str; 3] = ["MASTER", "SLAVE", "VALUE"];
        let value = keyword.get("VALUE").and_then(number);
        let known = |(name, _): &(String, _)| KNOWN.contains(&&name[..]);
        let (Some(slave), Some(master), Some(value), true) = (
            keyword.get("SLAVE"),
            keyword.get("MASTER"),
            value,
            keyword.parameters.iter().all(known),
        ) else {
            return self.doubt(
                line,
                "*CLEARANCE",
                "*CLEARANCE, MASTER=…, SLAVE=…, VALUE=…",
                "Name the two surfaces of a *CONTACT PAIR and their distance, negative where they overlap; tables of nodes and CPSET are not read.",
            );
        };
        let surfaces = [slave, master].map(|word| self.surface_named(word));
        if self.contact.clearances.len() >= MOST {
            let expected = format!("at most {MOST}");
            return self.doubt(line, "one more *CLEARANCE", &expected, WRITTEN_INSTEAD);
        }
        self.contact.clearances.push(Clearance {
            line,
            surfaces,
            value,
        });
    }

    /// The name of a surface as the deck spells it.
    fn surface_named(&mut self, word: &str) -> Name {
        match self.target(word) {
            Target::Set(name) => name,
            _ => self.spelled(word),
        }
    }

    fn friction_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        const KNOWN: [&str; 4] = ["SLIP TOLERANCE", "ELASTIC SLIP", "TAUMAX", "LAGRANGE"];
        for (name, _) in &keyword.parameters {
            if !KNOWN.contains(&&name[..]) {
                let hint = match &name[..] {
                    "ROUGH" => "For a contact without slip, give a large friction coefficient.",
                    _ => {
                        "Give one friction coefficient; or see `friction` of a problem as JSON, with this deck as its mesh."
                    }
                };
                self.doubt(
                    line,
                    format!("*FRICTION with {name:.40}"),
                    "a friction coefficient, with SLIP TOLERANCE, ELASTIC SLIP, TAUMAX or LAGRANGE",
                    hint,
                );
            }
        }
        let friction = DeckFriction {
            line,
            elastic_slip: self.parameter(keyword, "ELASTIC SLIP", line),
            slip_tolerance: self.parameter(keyword, "SLIP TOLERANCE", line),
            most_stress: self.parameter(keyword, "TAUMAX", line),
            lagrange: keyword.has("LAGRANGE"),
            ..DeckFriction::default()
        };
        match self.interaction(line, "*FRICTION") {
            Some(interaction) => {
                interaction.friction = Some(friction);
                Block::Contact(ContactBlock::Friction)
            }
            None => Block::Skip,
        }
    }

    /// The value of a parameter that must be a positive number.
    fn parameter(&mut self, keyword: &Keyword, name: &str, line: u64) -> Option<f64> {
        let written = keyword.get(name)?.to_owned();
        let value = number(&written).filter(|value| *value > 0.0);
        if value.is_none() {
            self.doubt(
                line,
                format!("{name}={written:.40}"),
                "a number > 0",
                &format!("Write it like {name}=0.005, or leave it out."),
            );
        }
        value
    }

    fn behavior_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        const HARD: [&str; 5] = [
            "PRESSURE-OVERCLOSURE",
            "PENALTY",
            "AUGMENTED LAGRANGE",
            "DIRECT",
            "STIFFNESS VALUE",
        ];
        let kind = keyword.get("PRESSURE-OVERCLOSURE").unwrap_or("HARD");
        let behavior = match &kind.to_uppercase()[..] {
            "HARD" => Behavior::Hard,
            "TIED" => Behavior::Tied { line },
            "LINEAR" => Behavior::Linear { line, slope: None },
            "EXPONENTIAL" => Behavior::Exponential {
                line,
                clearance: None,
            },
            other => {
                self.doubt(
                    line,
                    format!("*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE={other:.20}"),
                    "PRESSURE-OVERCLOSURE=HARD",
                    "Contact is hard here: pressure without overclosure; TIED and *TIE join surfaces.",
                );
                return Block::Skip;
            }
        };
        for (name, _) in &keyword.parameters {
            if !HARD.contains(&&name[..]) {
                self.doubt(
                    line,
                    format!("*SURFACE BEHAVIOR with {name:.40}"),
                    "contact that opens again, without overclosure",
                    WRITTEN_INSTEAD,
                );
            }
        }
        let whole = matches!(behavior, Behavior::Hard | Behavior::Tied { .. });
        match self.interaction(line, "*SURFACE BEHAVIOR") {
            Some(interaction) => interaction.behavior = behavior,
            None => return Block::Skip,
        }
        if whole {
            Block::Skip
        } else {
            Block::Contact(ContactBlock::Behavior)
        }
    }

    fn interaction(&mut self, line: u64, keyword: &str) -> Option<&mut Interaction> {
        let Some(name) = self.contact.current.clone() else {
            self.doubt(
                line,
                keyword,
                "*SURFACE INTERACTION, NAME=… before it",
                "Name the interaction that it belongs to.",
            );
            return None;
        };
        self.contact.interactions.get_mut(&name)
    }

    /// Reads a line of data about contact.
    pub(super) fn contact_data(&mut self, block: &mut ContactBlock, line: u64, text: &str) {
        let words: Vec<&str> = text.split(',').map(str::trim).collect();
        match block {
            ContactBlock::Segments(name) => self.segment(name.clone(), &words, line, text),
            ContactBlock::Pairs {
                interaction,
                adjust,
                tie,
            } => match words[..] {
                [slave, master, ref rest @ ..]
                    if !slave.is_empty()
                        && !master.is_empty()
                        && rest.iter().all(|word| word.is_empty())
                        && self.contact.pairs.len() < MOST =>
                {
                    let surfaces = [slave, master].map(|word| self.surface_named(word));
                    self.contact.pairs.push(Pair {
                        line,
                        surfaces,
                        interaction: interaction.clone(),
                        adjust: *adjust,
                        tie: *tie,
                    });
                }
                _ => self.doubt(
                    line,
                    format!("`{text:.60}`"),
                    "two surfaces: that of the body, and that of the rigid body or of the other elastic body",
                    WRITTEN_INSTEAD,
                ),
            },
            ContactBlock::Friction => {
                let current = self.contact.current.clone();
                let interactions = &mut self.contact.interactions;
                let friction = current
                    .and_then(|name| interactions.get_mut(&name))
                    .and_then(|interaction| interaction.friction.as_mut());
                let Some(friction) = friction else { return };
                let values: Vec<Option<f64>> = words.iter().map(|word| number(word)).collect();
                let readable = words
                    .iter()
                    .zip(&values)
                    .all(|(w, v)| w.is_empty() || v.is_some());
                let known =
                    friction.coefficient.is_none() && values.iter().skip(2).all(Option::is_none);
                match values.first() {
                    Some(Some(0.0)) if values[1..].iter().any(Option::is_some) => self.doubt(
                        line,
                        format!("`{text:.60}`: a coefficient of 0 with a stick slope"),
                        "a friction coefficient > 0 before a stick slope, or 0 alone",
                        DECIMAL_POINT,
                    ),
                    Some(Some(coefficient)) if readable && known => {
                        friction.coefficient = Some(*coefficient);
                        friction.stick_slope = values.get(1).copied().flatten();
                    }
                    _ => self.doubt(
                        line,
                        format!("`{text:.60}`"),
                        "one friction coefficient, or with CalculiX's stick slope after it",
                        "A coefficient that depends on slip rate, pressure or temperature is not supported.",
                    ),
                }
            }
            ContactBlock::Behavior => {
                let current = self.contact.current.clone();
                let interactions = &mut self.contact.interactions;
                let Some(interaction) = current.and_then(|name| interactions.get_mut(&name)) else {
                    return;
                };
                let first = words.first().and_then(|word| number(word));
                match &mut interaction.behavior {
                    Behavior::Hard | Behavior::Tied { .. } => {}
                    Behavior::Linear { slope: value, .. }
                    | Behavior::Exponential {
                        clearance: value, ..
                    } => *value = value.or(first),
                }
            }
        }
    }

    /// Reads a line of an analytical surface.
    fn segment(&mut self, name: Name, words: &[&str], line: u64, text: &str) {
        let numbers: Vec<Option<f64>> = words.iter().skip(1).map(|word| number(word)).collect();
        let point = |k: usize| Some([(*numbers.get(2 * k)?)?, (*numbers.get(2 * k + 1)?)?]);
        // further values would be left out, such as those that decimal commas make
        let most = if ["START", "LINE"].contains(&&words[0].to_uppercase()[..]) {
            2
        } else {
            4
        };
        if numbers.iter().skip(most).any(Option::is_some) {
            let expected = format!("at most {most} coordinates");
            return self.doubt(line, format!("`{text:.60}`"), &expected, DECIMAL_POINT);
        }
        let surface = self.here.analytical.entry(name).or_default();
        let from = surface.at;
        let piece = match (&words[0].to_uppercase()[..], from) {
            ("START", None) => {
                surface.at = point(0);
                if surface.at.is_some() {
                    return;
                }
                None
            }
            ("LINE", Some(from)) => point(0)
                .filter(|to| *to != from)
                .map(|to| Piece::Line([from, to])),
            ("CIRCL", Some(from)) => point(0)
                .zip(point(1))
                .and_then(|(to, center)| Piece::arc([from, to], center)),
            ("PARAB", Some(from)) => point(0)
                .zip(point(1))
                .filter(|(middle, to)| *middle != from && to != middle && *to != from)
                .map(|(middle, to)| Piece::Parabola([from, middle, to])),
            _ => None,
        };
        match piece {
            Some(piece) if surface.pieces.len() < MOST => {
                surface.at = Some(piece.end());
                surface.pieces.push(piece);
            }
            _ => self.doubt(
                line,
                format!("`{text:.60}`"),
                "START, x, y; LINE, x, y of its end; CIRCL, x, y of its end, x, y of its centre (less than half a circle, both ends equally far from it); PARAB, x, y of its middle, x, y of its end",
                "Begin with START; each line continues where the one before ends, and no number may be blank.",
            ),
        }
    }

    /// Records a row of `*BOUNDARY` with all its components, for reference nodes.
    pub(super) fn note_row(&mut self, amplitude: &Option<Name>, line: u64, text: &str) {
        let words = fields(text);
        let word = |k: usize| words.get(k).copied().unwrap_or_default();
        let components: Option<Vec<u64>> = match (word(1).parse::<u64>(), word(2).parse::<u64>()) {
            (Ok(first), Ok(last)) if first <= last && last <= 6 => Some((first..=last).collect()),
            (Ok(first), Err(_)) if word(2).is_empty() && first <= 6 => Some(vec![first]),
            (Ok(_), _) => None,
            _ => match &word(1).to_uppercase()[..] {
                "XSYMM" => Some(vec![1, 5, 6]),
                "YSYMM" => Some(vec![2, 4, 6]),
                "ENCASTRE" => Some((1..=6).collect()),
                "ZASYMM" => Some(vec![1, 2, 6]),
                name => named_components(name).map(|(first, last)| (first..=last).collect()),
            },
        };
        let value = match word(3) {
            "" => Some(0.0),
            written => number(written),
        };
        if let (Some(components), Some(value)) = (components, value) {
            let target = self.target(word(0));
            self.here.held.push(Held {
                line,
                target,
                components,
                value,
                amplitude: amplitude.clone(),
            });
        }
    }
}
