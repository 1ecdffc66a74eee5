//! The data of a deck as written: rows, sets, sections and materials, with their lines. Also reads the values of a
//! line.

use std::fmt;
use std::rc::Rc;

use solver::error::{Reason, Violation};

/// A name of a set, surface or material, stored once however often the deck uses it.
pub(super) type Name = Rc<str>;

/// The largest number of characters of a name; Abaqus and CalculiX allow 80. A line may have a million characters, and
/// every entry of a set is compared with names.
pub(super) const LONGEST_NAME: usize = 256;

/// The largest number of names of sets and surfaces: each name takes hundreds of bytes, and each set is compared with
/// the whole surface of the mesh.
pub(super) const MOST_NAMES: usize = 1 << 16;

/// The largest number of constants of a material.
pub(super) const MOST_CONSTANTS: usize = 10;

/// Advice for a number that seems to have a decimal comma, which divides it in two.
pub(super) const DECIMAL_POINT: &str =
    "A comma separates values: write numbers with a decimal point, as in `0.3`.";

/// A node or element, a range of them, or a set: a member of a set, or what a load acts on.
#[derive(Clone, Debug, Eq, Ord, PartialEq, PartialOrd)]
pub(super) enum Target {
    Label(u64),
    /// A range of numbers: first, last, step; boxed, since single numbers are many and ranges few.
    Range(Box<[u64; 3]>),
    /// The name of a set, `INSTANCE.SET`, or `INSTANCE.7`.
    Set(Name),
}

/// Elastic constants, `*ELASTIC`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Elastic {
    pub(super) line: u64,
    /// The form of the constants.
    pub(super) kind: String,
    pub(super) values: Vec<f64>,
    /// Whether a line of the constants could not be read, which a violation reports.
    pub(super) unreadable: bool,
}

/// A material, `*MATERIAL`.
#[derive(Clone, Debug, Default)]
pub(super) struct MaterialDefinition {
    pub(super) elastic: Option<Elastic>,
    /// Properties that a linear elastic material does not have: their lines, and their keywords in words.
    pub(super) other: Vec<(u64, String)>,
    /// The first `*EXPANSION`.
    pub(super) expansion: Option<Expansion>,
    /// The different densities of `*DENSITY`, at most two.
    pub(super) densities: Vec<f64>,
}

/// The material of some elements, `*SOLID SECTION`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Section {
    pub(super) line: u64,
    pub(super) elements: Name,
    pub(super) material: Name,
    pub(super) thickness: Option<f64>,
    pub(super) orientation: Option<Name>,
}

/// An orientation, `*ORIENTATION`, which gives the angle of the material's first direction: its data lines as numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct Orientation {
    /// Whether the system has curved axes.
    pub(super) curved: bool,
    pub(super) lines: Vec<Vec<f64>>,
}

/// An amplitude, `*AMPLITUDE`: factors by time.
#[derive(Clone, Debug, Default)]
pub(super) struct Amplitude {
    pub(super) line: u64,
    /// The parameter by which the amplitude is something other than a table of factors.
    pub(super) other: Option<String>,
    pub(super) values: Vec<f64>,
}

/// A row of `*BOUNDARY` that prescribes a value of the components first … last (1: x, 2: y).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Prescribed {
    pub(super) line: u64,
    pub(super) target: Target,
    pub(super) components: (u64, u64),
    pub(super) value: f64,
    pub(super) amplitude: Option<Name>,
}

/// A row of `*DLOAD` or `*DSLOAD`: a pressure, or a load of the mass.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Distributed {
    pub(super) line: u64,
    pub(super) target: Target,
    pub(super) on: On,
    pub(super) value: f64,
    pub(super) amplitude: Option<Name>,
}

impl Distributed {
    /// Whether the row has no target and, as a load of the mass, acts on all elements.
    pub(super) fn is_of_all(&self) -> bool {
        matches!(&self.target, Target::Set(name) if name.is_empty())
    }
}

/// What the value of a row of `*DLOAD` or `*DSLOAD` acts on.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum On {
    /// The sides of a surface.
    Surface,
    /// The side of this number, from 1, of elements.
    Side(usize),
    /// The mass of elements.
    Mass(MassLoad),
}

/// A load on the mass of elements, whose size is the value of its row.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum MassLoad {
    /// GRAV: the direction of the acceleration.
    Gravity([f64; 3]),
    /// CENTRIF: a point of the axis, and its direction.
    Rotation([f64; 3], [f64; 3]),
}

impl fmt::Display for MassLoad {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MassLoad::Gravity([x, y, z]) => write!(f, "GRAV {x} {y} {z}"),
            MassLoad::Rotation([x, y, z], [a, b, c]) => {
                write!(f, "CENTRIF {x} {y} {z} {a} {b} {c}")
            }
        }
    }
}

/// What the row of a load of the mass has to be.
pub(super) const LOAD_OF_MASS: &str = "a load of the mass: element set, GRAV, acceleration, direction (3 numbers); or element set, CENTRIF, square of the angular velocity, a point of the axis, its direction (3 numbers each)";

impl MassLoad {
    /// Whether a word is the kind of a load of the mass.
    pub(super) fn is_kind(word: &str) -> bool {
        ["GRAV", "CENTRIF"]
            .iter()
            .any(|kind| word.eq_ignore_ascii_case(kind))
    }

    /// Reads the numbers after the value of a row of this kind.
    pub(super) fn read(kind: &str, words: &[&str]) -> Option<MassLoad> {
        let numbers: Option<Vec<f64>> = words
            .iter()
            .map(|word| {
                if word.is_empty() {
                    Some(0.0)
                } else {
                    number(word)
                }
            })
            .collect();
        let mut numbers = numbers?;
        let count = if kind.eq_ignore_ascii_case("GRAV") {
            3
        } else {
            6
        };
        if numbers.len() > count {
            return None;
        }
        numbers.resize(count, 0.0);
        let load = match numbers[..] {
            [x, y, z] => MassLoad::Gravity([x, y, z]),
            [x, y, z, a, b, c] => MassLoad::Rotation([x, y, z], [a, b, c]),
            _ => return None,
        };
        Some(load).filter(|load| load.size() > 0.0)
    }

    /// The length of the direction.
    pub(super) fn size(&self) -> f64 {
        let (MassLoad::Gravity([x, y, z]) | MassLoad::Rotation(_, [x, y, z])) = self;
        x.hypot(*y).hypot(*z)
    }
}

/// A force, a row of `*CLOAD`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Force {
    pub(super) line: u64,
    pub(super) target: Target,
    pub(super) component: u64,
    pub(super) value: f64,
    pub(super) amplitude: Option<Name>,
}

/// `*SPRING` with its data lines.
#[derive(Clone, Debug)]
pub(super) struct Spring {
    pub(super) line: u64,
    /// The set of the elements.
    pub(super) elements: Name,
    /// The direction: 1 (x) or 2 (y); none if it is another one, or not read.
    pub(super) component: Option<u64>,
    /// The stiffnesses (force per length), one for each temperature.
    pub(super) stiffness: Vec<f64>,
    /// The number of data lines so far.
    pub(super) lines: usize,
}

/// The springs of one `*SPRING` at the nodes of the mesh.
pub(super) struct PlacedSpring {
    pub(super) spring: Spring,
    /// The name of the set of elements in the mesh.
    pub(super) name: String,
    /// The nodes of its elements, each as often as elements have it.
    pub(super) nodes: Vec<u32>,
}

/// A row of `*INITIAL CONDITIONS` or `*TEMPERATURE`: the temperature of nodes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Temperature {
    pub(super) line: u64,
    pub(super) target: Target,
    pub(super) value: f64,
    /// Whether it is that before the first step.
    pub(super) is_initial: bool,
    pub(super) amplitude: Option<Name>,
}

/// The strains of a material by one unit of temperature, `*EXPANSION`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Expansion {
    pub(super) line: u64,
    /// Whether the material has three strains, along its axes.
    pub(super) along_axes: bool,
    pub(super) values: Vec<f64>,
    /// Whether a line could not be read, or the type is another one.
    pub(super) unreadable: bool,
    /// Whether there are several rows with different strains.
    pub(super) depends_on_temperature: bool,
}

/// The kind of supports or loads that `OP=NEW` replaces. `*DLOAD` and `*DSLOAD` replace each other's pressures in
/// CalculiX, and only their own in Abaqus: both must be repeated in a deck that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Replaces {
    Supports,
    Forces,
    Pressures,
}

/// A keyword with `OP=NEW` in a step after the first.
pub(super) struct Replacement {
    pub(super) line: u64,
    /// The name of the keyword.
    pub(super) keyword: String,
    pub(super) what: Replaces,
}

/// A set as written.
#[derive(Clone, Debug, Default)]
pub(super) struct Set {
    /// The line of the keyword that begins the set.
    pub(super) line: u64,
    pub(super) members: Vec<Target>,
    /// Members that belong to an instance.
    pub(super) of_instances: Vec<(Name, Vec<Target>)>,
    /// Sets of elements whose nodes belong to this set, each with the name of its instance, if any.
    pub(super) of_elements: Vec<(Option<Name>, Name)>,
}

impl Set {
    /// The number of members, where a set or range counts as one member.
    pub(super) fn written(&self) -> usize {
        let inner = self.of_instances.iter().map(|(_, members)| members.len());
        self.members.len() + inner.sum::<usize>() + self.of_elements.len()
    }
}

/// Which sides of an element belong to a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sides {
    /// One side, by its number from 1.
    Number(usize),
    /// All sides on the surface of the body.
    Outer,
    /// Faces that plane elements do not have, or the element's own plane.
    None,
    /// The left side of a line from its first node to its second (SPOS), or its right side (SNEG).
    OfLine { left: bool },
}

/// A surface as written: by element or set, which of its sides belong to the surface.
#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    /// The line of the keyword that begins the surface.
    pub(super) line: u64,
    pub(super) sides: Vec<(Target, Sides)>,
}

/// Which data of a part are incomplete because a line could not be read.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Incomplete {
    pub(super) nodes: bool,
    pub(super) elements: bool,
    /// Whether names of sets, surfaces or materials may be missing.
    pub(super) names: bool,
}

impl Incomplete {
    pub(super) const ALL: Incomplete = Incomplete {
        nodes: true,
        elements: true,
        names: true,
    };

    pub(super) fn add(&mut self, other: Incomplete) {
        self.nodes |= other.nodes;
        self.elements |= other.elements;
        self.names |= other.names;
    }
}

pub(super) fn on_line(
    line: u64,
    reason: Reason,
    got: String,
    expected: &str,
    hint: &str,
) -> Violation {
    Violation::new("", reason, format!("line {line}: {got}"), expected, hint)
}

/// Numbers as a list in words, such as `element 3`, or `elements 3, 7, 12, 14, 20 and 31 others`.
pub(super) fn numbered(what: &str, numbers: impl Iterator<Item = u64>) -> String {
    const MOST: usize = 5;
    let mut numbers = numbers.fuse();
    let first: Vec<String> = numbers.by_ref().take(MOST).map(|n| n.to_string()).collect();
    match (first.len(), numbers.count()) {
        (1, _) => format!("{what} {}", first[0]),
        (_, 0) => format!("{what}s {}", first.join(", ")),
        (_, 1) => format!("{what}s {} and 1 other", first.join(", ")),
        (_, more) => format!("{what}s {} and {more} others", first.join(", ")),
    }
}

/// The values of a line, between commas and without blanks around them; a value in quotation marks may contain commas.
/// Empty values at the end are left out.
pub(super) fn fields(text: &str) -> Vec<&str> {
    let mut quoted = false;
    let mut fields: Vec<&str> = text
        .split(|c: char| {
            quoted ^= c == '"';
            c == ',' && !quoted
        })
        .map(|field| field.trim().trim_matches('"'))
        .collect();
    while fields.last().is_some_and(|field| field.is_empty()) {
        fields.pop();
    }
    fields
}

/// The value of a number as text, also with Fortran's exponent D; none if the text is no number.
pub(super) fn number(word: &str) -> Option<f64> {
    let parsed = word
        .parse()
        .or_else(|_| word.replace(['d', 'D'], "e").parse());
    parsed.ok().filter(|value: &f64| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_to_five_numbers_are_named() {
        let named = |count: u64| numbered("element", (1..=count).map(|k| 3 * k));
        assert_eq!(named(1), "element 3");
        assert_eq!(named(5), "elements 3, 6, 9, 12, 15");
        assert_eq!(named(6), "elements 3, 6, 9, 12, 15 and 1 other");
        assert_eq!(named(36), "elements 3, 6, 9, 12, 15 and 31 others");
    }

    #[test]
    fn a_line_is_split_at_commas_outside_of_quotation_marks() {
        assert_eq!(fields(" RIGHT,1,,2 , ,"), ["RIGHT", "1", "", "2"]);
        assert_eq!(fields("\"a, b\", S1"), ["a, b", "S1"]);
        assert_eq!(fields(","), Vec::<&str>::new());
    }
}
