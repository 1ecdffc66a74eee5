//! Temperatures of a deck, `*INITIAL CONDITIONS, TYPE=TEMPERATURE` and `*TEMPERATURE`, and the thermal expansion of its
//! materials. A change of temperature from the initial one to that of the step strains the body.

use super::block::Block;
use super::build::{Built, Row};
use super::deck::Deck;
use super::keyword::Keyword;
use super::warming::{MOST_TEMPERATURES, Warming};
use super::written::{
    DECIMAL_POINT, Expansion, MaterialDefinition, Name, Section, Temperature, fields, number,
};
use solver::problem::{Elasticity, Load, Material};

impl Deck {
    /// Reads `*INITIAL CONDITIONS`; kinds that affect a static step are refused.
    pub(super) fn initial_conditions(&mut self, keyword: &Keyword, line: u64) -> Block {
        let kind = keyword.get("TYPE").unwrap_or_default().to_uppercase();
        match &kind[..] {
            "TEMPERATURE" => {
                let other = keyword.parameters.iter().find(|(name, _)| name != "TYPE");
                self.not_read("INITIAL CONDITIONS", other, line);
                Block::Temperatures(None)
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
        let read = |name: &str| ["OP", "AMPLITUDE"].contains(&name);
        let other = keyword.parameters.iter().find(|(name, _)| !read(name));
        self.not_read("TEMPERATURE", other, line);
        if self.steps > 1 && keyword.is("OP", "NEW") {
            let got = "*TEMPERATURE with OP=NEW in a later step".to_owned();
            self.other_temperatures.get_or_insert((line, got));
        }
        let amplitude = self.named(keyword, "AMPLITUDE");
        Block::Temperatures(Some(amplitude))
    }

    /// Notes a parameter by which temperatures are not those of the data lines.
    fn not_read(&mut self, keyword: &str, parameter: Option<&(String, Option<String>)>, line: u64) {
        if let Some((name, _)) = parameter {
            let got = format!("*{keyword} with {name:.40}");
            self.other_temperatures.get_or_insert((line, got));
        }
    }

    /// Reads a row of temperatures: node or set, value. `amplitude`: of the step's temperatures; `None` for initial ones.
    pub(super) fn temperature(&mut self, amplitude: &Option<Option<Name>>, line: u64, text: &str) {
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
        // a body may have temperatures at several depths of a shell: a second value here is a decimal comma
        if words.len() > 2 {
            return self.doubt(
                line,
                format!("`{text:.60}` for a temperature"),
                "node or set, and one temperature",
                DECIMAL_POINT,
            );
        }
        let target = self.target(word(0));
        self.here.temperatures.push(Temperature {
            line,
            target,
            value,
            is_initial: amplitude.is_none(),
            amplitude: amplitude.clone().flatten(),
        });
    }

    /// Reads a line of `*EXPANSION`: strains by one unit of temperature, and the temperature that they belong to.
    pub(super) fn expansion(&mut self, expansion: &mut Expansion, line: u64, text: &str) {
        let mut values = self.numbers(line, text);
        let count = if expansion.along_axes { 3 } else { 1 };
        expansion.unreadable |= values.len() < count || values.len() > count + 1;
        values.truncate(count);
        if expansion.values.is_empty() {
            expansion.values = values;
        } else {
            expansion.depends_on_temperature |= expansion.values != values;
        }
    }
}

impl Built {
    /// Whether a material of the body expands.
    fn expands(&self) -> bool {
        let expands = |Row { row, .. }: &Row<Section>| {
            let material = self.deck.materials.get(&row.material);
            material.is_some_and(|material| material.expansion.is_some())
        };
        self.sections.iter().any(expands)
    }

    /// The load by the changes of temperature, if a material expands; what is not understood of them is reported.
    pub(super) fn load_of_temperatures(&mut self) -> Option<Load> {
        if !self.expands() {
            return None;
        }
        let Warming {
            first,
            later,
            unknown,
            too_many,
        } = std::mem::take(&mut self.warming);
        const OF_ONE_STEP: &str = "Write the temperatures at the end of the first step as rows of *TEMPERATURE, or set `nodal_temperature` in a problem as JSON with this deck as its mesh.";
        if let Some((line, got)) = self.deck.other_temperatures.take() {
            self.doubt(
                line,
                got,
                "*TEMPERATURE with rows of node or set and value, in the first step",
                OF_ONE_STEP,
            );
        }
        if let Some(line) = later {
            self.doubt(
                line,
                "another temperature in a later step",
                "temperatures that stay as the first step leaves them",
                OF_ONE_STEP,
            );
        }
        if let Some((line, word)) =
            unknown.filter(|_| !self.incomplete.names && !self.incomplete.nodes)
        {
            self.doubt(
                line,
                format!("`{word:.60}` for a temperature"),
                "a node or a set of nodes",
                "Correct the name, or define the set by *NSET.",
            );
        }
        if let Some(line) = too_many {
            self.doubt(
                line,
                "one more row of temperatures, after many for large sets",
                &format!("at most {MOST_TEMPERATURES} temperatures of nodes, each counted as often as rows name it"),
                "Write the temperature of each node once.",
            );
        }
        first.map(|_| Load::NodalTemperature(1.0))
    }

    /// Adds the expansion of a deck's material to that of a problem; 0 for a material without one, if the body is
    /// warmed.
    pub(super) fn expand(
        &mut self,
        definition: &MaterialDefinition,
        warms: bool,
        material: &mut Material,
    ) {
        let Some(expansion) = &definition.expansion else {
            material.expansion = warms.then_some(0.0);
            return;
        };
        let along = &mut material.elasticity;
        let wrong = match (&expansion.values[..], along) {
            _ if expansion.unreadable => Some((
                "the numbers of *EXPANSION",
                "one strain by a unit of temperature, or three with TYPE=ORTHO, and the temperature that they belong to",
            )),
            _ if expansion.depends_on_temperature => Some((
                "an *EXPANSION that depends on temperature",
                "one row of *EXPANSION",
            )),
            ([all], _) => {
                material.expansion = Some(*all);
                None
            }
            ([first, second, third], Elasticity::Orthotropic(constants)) => {
                constants.expansion = Some([*first, *second, *third]);
                None
            }
            ([first, second, third], _) if first == second && second == third => {
                material.expansion = Some(*first);
                None
            }
            (_, _) => Some((
                "an *EXPANSION of another TYPE than the material's *ELASTIC",
                "TYPE=ISO, or TYPE=ORTHO with *ELASTIC, TYPE=ENGINEERING CONSTANTS",
            )),
        };
        if let Some((got, expected)) = wrong.filter(|_| warms) {
            self.doubt(
                expansion.line,
                got,
                expected,
                "Give the mean expansion between both temperatures, or `expansion` of a material in a problem as JSON with this deck as its mesh.",
            );
        }
    }
}
