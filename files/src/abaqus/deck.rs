//! The content of a deck: its supported parts, and violations for all other parts.

use std::collections::{BTreeMap, HashMap};

use super::contact_parts::DeckContact;
use super::part::Part;
use super::written::{
    Amplitude, LONGEST_NAME, MOST_NAMES, MaterialDefinition, Name, Orientation, Replacement, Set,
    Sides, Surface, Target, on_line,
};
use solver::error::Reason;

/// The scope of a line: a part, an instance or the assembly.
#[derive(Clone, Debug, Default)]
pub(super) enum Inside {
    /// The assembly, or a deck without parts.
    #[default]
    Assembly,
    Part(Name),
    Instance(Name),
}

/// The position of an instance: a translation, then a rotation (centre and angle in radians).
pub(super) type Placement = ([f64; 3], Option<([f64; 2], f64)>);

/// The supported parts of a deck, and violations for all other parts.
#[derive(Default)]
pub(super) struct Deck {
    /// The part, instance or assembly that the lines being read belong to.
    pub(super) here: Part,
    pub(super) inside: Inside,
    /// The assembly, set aside while lines of a part or an instance are read.
    pub(super) assembly: Part,
    pub(super) assembly_name: Option<Name>,
    pub(super) parts: BTreeMap<Name, Part>,
    pub(super) instances: Vec<(Name, Part)>,
    /// The size of all parts and instances together.
    pub(super) written: u64,
    pub(super) instantiated: u64,
    /// The number of names of sets and surfaces so far.
    pub(super) names: usize,
    /// The spelling of each name, by the name in capitals.
    spelling: HashMap<String, Name>,
    /// The material that the keywords and data lines being read belong to.
    pub(super) material: Option<Name>,
    pub(super) materials: BTreeMap<Name, MaterialDefinition>,
    pub(super) orientations: BTreeMap<Name, Orientation>,
    pub(super) amplitudes: BTreeMap<Name, Amplitude>,
    /// The first line by which temperatures are other than the rows say, and what it has.
    pub(super) other_temperatures: Option<(u64, String)>,
    pub(super) steps: usize,
    /// The position of the instance that is being read.
    pub(super) placement: Option<Placement>,
    /// The length of time of the current step; `None`: 1.
    pub(super) period: Option<f64>,
    /// Whether a `*BOUNDARY` was read in the current step.
    pub(super) supported_in_step: bool,
    /// Keywords with `OP=NEW` in steps after the first.
    pub(super) replacements: Vec<Replacement>,
    pub(super) title: Option<String>,
    pub(super) contact: DeckContact,
}

impl Deck {
    pub(super) fn fault(
        &mut self,
        line: u64,
        reason: Reason,
        got: impl Into<String>,
        expected: &str,
        hint: &str,
    ) {
        self.here
            .faults
            .add(|| on_line(line, reason, got.into(), expected, hint));
    }

    pub(super) fn doubt(&mut self, line: u64, got: impl Into<String>, expected: &str, hint: &str) {
        let reason = Reason::NotUnderstood;
        self.here
            .doubts
            .add(|| on_line(line, reason, got.into(), expected, hint));
    }

    /// A name in the spelling of its first occurrence in the deck.
    pub(super) fn spelled(&mut self, name: &str) -> Name {
        let capitals = name.to_uppercase();
        match self.spelling.get(&capitals) {
            Some(known) => known.clone(),
            // more names than a deck may define: this one is unknown anyway
            None if self.spelling.len() > 2 * MOST_NAMES => name.into(),
            None => self.spelling.entry(capitals).or_insert(name.into()).clone(),
        }
    }

    /// The material that the keywords and data lines being read belong to; none outside a material.
    pub(super) fn material(&mut self) -> Option<&mut MaterialDefinition> {
        let name = self.material.as_ref()?;
        self.materials.get_mut(name)
    }

    /// A name in the spelling of its first occurrence in the deck; none if the deck has no such name.
    pub(super) fn known(&self, name: &str) -> Option<&Name> {
        self.spelling.get(&name.to_uppercase())
    }

    /// The members of the set of nodes with this name. A new set begins on this line.
    pub(super) fn node_set(
        &mut self,
        name: &Name,
        of: &Option<Name>,
        line: u64,
    ) -> &mut Vec<Target> {
        let set = new_or_known(&mut self.here.node_sets, &mut self.names, name, line);
        members(set, of)
    }

    /// The members of the set of elements with this name. A new set begins on this line.
    pub(super) fn element_set(
        &mut self,
        name: &Name,
        of: &Option<Name>,
        line: u64,
    ) -> &mut Vec<Target> {
        let set = new_or_known(&mut self.here.element_sets, &mut self.names, name, line);
        members(set, of)
    }

    /// Adds the nodes of a set of elements to a set of nodes.
    pub(super) fn nodes_of(&mut self, name: &Name, of: &Option<Name>, elements: Name, line: u64) {
        let set = new_or_known(&mut self.here.node_sets, &mut self.names, name, line);
        set.of_elements.push((of.clone(), elements));
    }

    /// The members of a surface of nodes. Such surfaces and sets may have equal names.
    pub(super) fn node_surface(&mut self, name: &Name, line: u64) -> &mut Vec<Target> {
        let surfaces = &mut self.here.node_surfaces;
        &mut new_or_known(surfaces, &mut self.names, name, line).members
    }

    /// The sides of the surface with this name. A new surface begins on this line.
    pub(super) fn surface(&mut self, name: &Name, line: u64) -> &mut Vec<(Target, Sides)> {
        let names = &mut self.names;
        let new = || {
            *names += 1;
            Surface {
                line,
                ..Surface::default()
            }
        };
        let known = self.here.surfaces.entry(name.clone());
        &mut known.or_insert_with(new).sides
    }

    /// Reports a name or number of a line that is too long; returns whether there is one.
    pub(super) fn has_long_name(&mut self, line: u64, text: &str) -> bool {
        let long = |word: &str| word.trim().len() > LONGEST_NAME;
        let Some(word) = text.split([',', '=']).find(|word| long(word)) else {
            return false;
        };
        let got = format!("`{:.40}…` of {} bytes", word.trim(), word.trim().len());
        let expected = format!("names and numbers of at most {LONGEST_NAME} characters");
        self.fault(line, Reason::TooLong, got, &expected, "Shorten the name.");
        true
    }

    /// The factor of an amplitude at the end of the current step, or the reason why it has none.
    pub(super) fn factor(&self, name: &Name) -> Result<f64, String> {
        let Some(amplitude) = self.amplitudes.get(name) else {
            return Err(format!("the unknown amplitude `{name:.60}`"));
        };
        let (times, rest) = amplitude.values.as_chunks::<2>();
        let back = times.windows(2).find(|pair| pair[0][0] >= pair[1][0]);
        let why = match (&amplitude.other, back) {
            (Some(other), _) => format!("with {other:.60}"),
            (None, _) if times.is_empty() => "without a table".to_owned(),
            (None, _) if !rest.is_empty() => "with a time that has no factor".to_owned(),
            (None, Some([[time, _], [next, _]])) => {
                format!("whose times do not increase: {next} after {time}")
            }
            (None, _) => String::new(),
        };
        if !why.is_empty() {
            return Err(format!(
                "the amplitude `{name:.60}` (line {}), {why}",
                amplitude.line
            ));
        }
        let end = self.period.unwrap_or(1.0);
        let after = times.partition_point(|[time, _]| *time < end);
        Ok(
            match (
                times.get(after),
                after.checked_sub(1).map(|before| &times[before]),
            ) {
                (Some([_, factor]), None) | (None, Some([_, factor])) => *factor,
                (Some([next, up]), Some([last, low])) => {
                    low + (up - low) * (end - last) / (next - last)
                }
                (None, None) => 1.0,
            },
        )
    }

    /// Whether an amplitude rises and falls before the end of the step, for a row on this line: in the first step from 0.
    pub(super) fn turns(&self, name: &Name, line: u64) -> bool {
        let (Some(amplitude), Ok(last)) = (self.amplitudes.get(name), self.factor(name)) else {
            return false;
        };
        let (times, _) = amplitude.values.as_chunks::<2>();
        let end = self.period.unwrap_or(1.0);
        let within = times.iter().filter(|[time, _]| *time < end);
        let before = (self.contact.step_of(line) == 0).then_some(0.0);
        let within = within.map(|[_, factor]| *factor);
        let factors: Vec<f64> = before.into_iter().chain(within).chain([last]).collect();
        let (mut rises, mut falls) = (false, false);
        for pair in factors.windows(2) {
            rises |= pair[1] > pair[0];
            falls |= pair[1] < pair[0];
        }
        rises && falls
    }

    /// What keeps an amplitude from being followed on the way to the end of its step, in words: that it jumps at the
    /// beginning, or, if `alone` is false, that other loads of the step do not rise and fall with it.
    pub(super) fn off_the_way(&self, name: &Name, line: u64, alone: bool) -> Option<String> {
        let (amplitude, last) = (self.amplitudes.get(name)?, self.factor(name).ok()?);
        let (times, _) = amplitude.values.as_chunks::<2>();
        let end = self.period.unwrap_or(1.0);
        let [from, first] = *times.first()?;
        if self.contact.step_of(line) == 0 && from <= 0.0 && first != 0.0 {
            return Some(format!("which begins at {first} and not at 0"));
        }
        let straight = |[time, factor]: &[f64; 2]| {
            let expected = first + (last - first) * (time - from) / (end - from);
            (factor - expected).abs() <= 1e-6 * last.abs().max(first.abs())
        };
        let within = times.iter().filter(|[time, _]| *time < end);
        let is_straight = from <= 0.0 && within.clone().all(straight);
        (!alone && !is_straight).then(|| {
            "which is not a straight line, beside loads or displacements without it".to_owned()
        })
    }

    /// Whether a contact has friction, so that the way to the end of a step matters.
    pub(super) fn has_friction(&self) -> bool {
        let mut laws = self.contact.interactions.values();
        laws.any(|law| {
            let friction = law.friction.as_ref();
            friction.is_some_and(|said| said.coefficient.is_some_and(|mu| mu != 0.0))
        })
    }

    pub(super) fn target(&mut self, word: &str) -> Target {
        match word.parse() {
            Ok(label) => Target::Label(label),
            Err(_) => Target::Set(self.spelled(word)),
        }
    }
}

fn new_or_known<'a>(
    sets: &'a mut BTreeMap<Name, Set>,
    names: &mut usize,
    name: &Name,
    line: u64,
) -> &'a mut Set {
    let new = || {
        *names += 1;
        Set {
            line,
            ..Set::default()
        }
    };
    sets.entry(name.clone()).or_insert_with(new)
}

/// The members that a set has in its own part, or in the named instance.
fn members<'a>(set: &'a mut Set, instance: &Option<Name>) -> &'a mut Vec<Target> {
    let Some(instance) = instance else {
        return &mut set.members;
    };
    // lines of one instance follow one another
    if set
        .of_instances
        .last()
        .is_none_or(|(last, _)| last != instance)
    {
        set.of_instances.push((instance.clone(), Vec::new()));
    }
    let last = set.of_instances.len() - 1;
    &mut set.of_instances[last].1
}
