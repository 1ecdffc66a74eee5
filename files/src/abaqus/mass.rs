//! Loads of a body's mass: the rows GRAV and CENTRIF of `*DLOAD`, and `*DENSITY`.

use std::collections::BTreeMap;

use super::build::{Built, Row};
use super::deck::Deck;
use super::written::{Distributed, MassLoad, MaterialDefinition, On};
use solver::problem::{Analysis, Load, Rotation};

/// The largest number of different loads of the mass that are compared with the body; a problem may have fewer.
const MOST_LOADS: usize = 1000;

impl MassLoad {
    /// The load of a problem, with the value of its row; otherwise what is wrong, what is expected, and advice.
    fn load(&self, value: f64, analysis: &Analysis) -> Result<Load, [String; 3]> {
        let axisymmetric = matches!(analysis, Analysis::Axisymmetric {});
        match *self {
            MassLoad::Gravity([x, y, z]) => {
                if z != 0.0 {
                    return Err(wrong(
                        format!("the direction {x}, {y}, {z}"),
                        "a direction in the plane",
                        "What acts across the plane does not load it.",
                    ));
                }
                if axisymmetric && x != 0.0 {
                    return Err(wrong(
                        format!("the direction {x}, {y}, {z}"),
                        "the direction of the axis, y, for a body of revolution",
                        "A body of revolution has gravity along its axis only: otherwise it bends. The centrifugal force is CENTRIF.",
                    ));
                }
                let size = self.size();
                Ok(Load::Gravity([value * x / size, value * y / size]))
            }
            MassLoad::Rotation([x, y, _], direction) => {
                let across = if axisymmetric { [0, 2] } else { [0, 1] };
                let (what, advice) = if axisymmetric {
                    (
                        "y, the axis of the body",
                        "A body of revolution rotates about its own axis.",
                    )
                } else {
                    (
                        "z, perpendicular to the plane",
                        "A plane body rotates in its plane.",
                    )
                };
                let beside = axisymmetric && x != 0.0;
                if beside || across.iter().any(|a| direction[*a] != 0.0) {
                    let [a, b, c] = direction;
                    let got = format!("an axis through {x}, {y} with the direction {a}, {b}, {c}");
                    return Err(wrong(got, &format!("the axis {what}"), advice));
                }
                if value < 0.0 {
                    return Err(wrong(
                        format!("{value} for the square of an angular velocity"),
                        "a number ≥ 0",
                        "The value of CENTRIF is ω², in radians and units of time squared.",
                    ));
                }
                Ok(Load::Rotation(Rotation {
                    angular_velocity: value.sqrt(),
                    about: (!axisymmetric).then_some([x, y]),
                }))
            }
        }
    }
}

fn wrong(got: String, expected: &str, advice: &str) -> [String; 3] {
    [got, expected.to_owned(), advice.to_owned()]
}

impl Deck {
    /// Reads a line of `*DENSITY`: a density, and the temperature that it belongs to.
    pub(super) fn density(&mut self, line: u64, text: &str) {
        let values = self.numbers(line, text);
        if let (Some(material), Some(density)) = (self.material(), values.first())
            && !material.densities.contains(density)
            && material.densities.len() < 2
        {
            material.densities.push(*density);
        }
    }
}

impl Built {
    /// The line of the first load of the mass.
    pub(super) fn first_mass_load(&self) -> Option<u64> {
        let rows = self.pressures.iter();
        let mut of_mass = rows.filter(|row| matches!(row.row.on, On::Mass(_)));
        of_mass.next().map(|row| row.row.line)
    }

    /// The density of a material; `load`: the line of the first load of the mass, if there are any: the material then needs
    /// one density.
    pub(super) fn density_of(
        &mut self,
        name: &str,
        definition: &MaterialDefinition,
        load: Option<u64>,
    ) -> Option<f64> {
        let Some(line) = load else {
            return definition.densities.first().copied();
        };
        let got = match definition.densities[..] {
            [density] => return Some(density),
            [] => format!("a load of the mass, and the material `{name:.60}` without *DENSITY"),
            _ => format!(
                "a load of the mass, and a *DENSITY of the material `{name:.60}` that depends on temperature"
            ),
        };
        self.doubt(
            line,
            got,
            "one density of each material (*DENSITY)",
            "Give the density at the temperature of the body, 0 for a material without mass.",
        );
        None
    }

    /// The loads of the mass in `rows`, each of which has to act on the whole body: rows for parts of it count together.
    pub(super) fn mass_loads(
        &mut self,
        rows: &[Row<Distributed>],
        analysis: &Analysis,
    ) -> Vec<Load> {
        let mut found: BTreeMap<String, Together<'_>> = BTreeMap::new();
        for Row { row, name } in rows {
            let On::Mass(load) = &row.on else { continue };
            let Some(set) = name.strip_suffix(&format!(" {load}")) else {
                continue;
            };
            let key = format!("{load} {}", row.value);
            if found.len() == MOST_LOADS && !found.contains_key(&key) {
                break;
            }
            let together = found.entry(key).or_insert_with(|| Together {
                load,
                row,
                sets: BTreeMap::new(),
            });
            *together.sets.entry(set).or_default() += 1;
        }
        let mut loads = Vec::new();
        for Together { load, row, sets } in found.into_values() {
            match (load.load(row.value, analysis), self.times_of_all(&sets)) {
                (Ok(load), Some(times)) => loads.extend(std::iter::repeat_n(load, times)),
                (Err([got, expected, advice]), _) => self.doubt(row.line, got, &expected, &advice),
                (Ok(_), None) => {
                    let names: Vec<&str> = sets.keys().take(5).copied().collect();
                    self.doubt(
                        row.line,
                        format!("a load of the mass of `{:.60}` alone", names.join("`, `")),
                        "a load of the mass of all plane elements",
                        "Gravity and rotation act on the whole body here: give them for a set of all elements, and the *DENSITY 0 to a material whose mass does not count.",
                    );
                }
            }
        }
        loads
    }

    /// How often each plane element is in the given sets, which have a count each; `None` if not all equally often.
    fn times_of_all(&self, sets: &BTreeMap<&str, usize>) -> Option<usize> {
        let mut times = vec![0; self.raw.elements.len()];
        for (name, count) in sets {
            if name.is_empty() {
                // all elements
                times.iter_mut().for_each(|time| *time += count);
                continue;
            }
            let single: Option<usize>;
            let group: &[u32] = match self.raw.groups.get(*name) {
                Some(group) => {
                    single = None;
                    group
                }
                None => {
                    let label: Option<u64> = name.rsplit('.').next().and_then(|l| l.parse().ok());
                    let mut labels = self.raw.element_labels.iter();
                    single = labels.position(|known| Some(*known) == label);
                    &[]
                }
            };
            let group = group.iter().map(|place| *place as usize);
            group.chain(single).for_each(|place| times[place] += count);
        }
        let first = times.first().copied().unwrap_or_default();
        (first > 0 && times.iter().all(|other| *other == first)).then_some(first)
    }
}

/// The rows of one load of the mass: how often it is given for each set of elements.
struct Together<'a> {
    load: &'a MassLoad,
    row: &'a Distributed,
    sets: BTreeMap<&'a str, usize>,
}
