//! A parametrised problem, registered under a name for clients of UM-Bridge: which of its numbers are given, and which
//! numbers of its result are returned. No I/O.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use solver::{
    problem::Problem,
    solution::{ContactProfile, ContactSummary, Peak, Summary},
};
use strum::{EnumString, IntoStaticStr, VariantArray};

use crate::time::Time;

/// Most models of one owner.
pub const MOST_MODELS: u32 = 100;
/// Most bytes of the problem of a model, as JSON: a larger mesh is uploaded once, and named as `stored`.
pub const MOST_PROBLEM_BYTES: usize = 128 << 10;
/// Most vectors of inputs, and of outputs.
pub const MOST_VECTORS: usize = 16;
/// Most numbers in all vectors of inputs together: a gradient takes two jobs for each.
pub const MOST_INPUTS: usize = 64;
/// Most numbers in all vectors of outputs together.
pub const MOST_OUTPUTS: usize = 10_000;
/// Most bytes of the description of a model, as JSON: lists hold many.
pub const MOST_DESCRIPTION_BYTES: usize = 16 << 10;
/// Characters of the longest name.
pub const MAX_NAME: usize = 64;
/// Characters of the longest title.
pub const MAX_TITLE: usize = 256;

/// A registered model, without its problem.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Model {
    /// Order of arrival; never shown.
    #[serde(skip)]
    pub key: i64,
    /// Its name, unique among those of its owner.
    pub name: String,
    /// Who registered it.
    pub owner: String,
    /// What it takes and returns.
    #[serde(flatten)]
    pub description: Description,
    /// When it was registered.
    pub created_at: Time,
    /// When it was last replaced.
    pub updated_at: Time,
}

/// What a model takes and returns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "ModelDescription")]
pub struct Description {
    /// For people.
    pub title: Option<String>,
    /// Vectors of JSON Pointers (RFC 6901) into the problem: the numbers that a client gives.
    pub inputs: Vec<Vec<String>>,
    /// Vectors of numbers of the result.
    pub outputs: Vec<Output>,
    /// The numbers that the problem itself has at the inputs. Their sizes are those from which steps of differences are
    /// taken.
    pub base_input: Vec<Vec<f64>>,
}

/// A registered model with its problem.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct WholeModel {
    /// All but the problem.
    #[serde(flatten)]
    pub model: Model,
    /// The problem that the inputs are put into.
    pub problem: Problem,
}

/// A vector of outputs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(rename = "ModelOutput", deny_unknown_fields)]
pub enum Output {
    /// Single numbers.
    Scalars {
        /// Paths into the summary of the result, such as normal_force or contacts/top/peak_normal_stress.
        scalars: Vec<String>,
    },
    /// A column of a profile at evenly spaced points.
    Profile {
        /// Name of a contact boundary.
        profile: String,
        /// The column.
        quantity: Quantity,
        /// How many points, the ends of the contact boundary among them.
        points: u32,
    },
}

impl Output {
    /// How many numbers it has.
    pub fn size(&self) -> usize {
        match self {
            Output::Scalars { scalars } => scalars.len(),
            Output::Profile { points, .. } => *points as usize,
        }
    }
}

impl Description {
    /// How many numbers each vector of inputs has.
    pub fn input_sizes(&self) -> Vec<usize> {
        self.inputs.iter().map(Vec::len).collect()
    }

    /// How many numbers each vector of outputs has.
    pub fn output_sizes(&self) -> Vec<usize> {
        self.outputs.iter().map(Output::size).collect()
    }

    /// Whether every input has a size from which the step of a difference is taken.
    pub fn has_differences(&self) -> bool {
        self.base_input.iter().flatten().all(|own| *own != 0.0)
    }
}

/// A column of a profile.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    Serialize,
    Deserialize,
    JsonSchema,
    EnumString,
    IntoStaticStr,
    VariantArray,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
#[schemars(rename = "ProfileQuantity")]
pub enum Quantity {
    /// Gap before deformation.
    Gap,
    /// u_n, along the outward normal.
    NormalDisplacement,
    /// u_t, along t.
    TangentialDisplacement,
    /// σ_n ≤ 0 in compression.
    NormalStress,
    /// σ_t on the body, along t.
    TangentialStress,
    /// S_ρ(p), the averaged pressure.
    NonlocalPressure,
    /// τ = μ max(S_ρ, 0).
    FrictionBound,
    /// φ_ε(|u_t − d|), between 0 and 1.
    FrictionRatio,
}

impl Quantity {
    /// The column of a profile.
    #[rustfmt::skip]
    pub fn of(self, profile: &ContactProfile) -> &[f64] {
        match self {
            Quantity::Gap                    => &profile.gap,
            Quantity::NormalDisplacement     => &profile.normal_displacement,
            Quantity::TangentialDisplacement => &profile.tangential_displacement,
            Quantity::NormalStress           => &profile.normal_stress,
            Quantity::TangentialStress       => &profile.tangential_stress,
            Quantity::NonlocalPressure       => &profile.nonlocal_pressure,
            Quantity::FrictionBound          => &profile.friction_bound,
            Quantity::FrictionRatio          => &profile.friction_ratio,
        }
    }
}

/// A number of a summary.
#[derive(Clone, Debug, PartialEq)]
pub enum Scalar {
    /// Of the whole body.
    Total(Total),
    /// Of one contact boundary.
    OfContact(String, OfContact),
    /// Of the place where a stress is largest, on one contact boundary.
    OfPeak(String, Stress, OfPeak),
}

/// A number of the whole body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "snake_case")]
#[allow(missing_docs)] // as in the summary
pub enum Total {
    NormalForce,
    TangentialForce,
    FrictionForce,
    Energy,
    FrictionWork,
    StrainEnergy,
}

/// A number of a contact boundary; widths are lengths of all its parts together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "snake_case")]
#[allow(missing_docs)] // as in the summary, and in the table of a sweep
pub enum OfContact {
    NormalForce,
    TangentialForce,
    FrictionForce,
    ContactWidth,
    StickWidth,
    SlipWidth,
}

/// A stress that has a largest value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "snake_case")]
#[allow(missing_docs)] // as in the summary
pub enum Stress {
    PeakNormalStress,
    PeakTangentialStress,
}

/// A number of the place where a stress is largest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "snake_case")]
#[allow(missing_docs)] // as in the summary
pub enum OfPeak {
    Value,
    S,
    X,
    Y,
}

impl Scalar {
    /// The number at a path into the summary; a peak by itself is its value.
    pub fn parse(path: &str) -> Option<Scalar> {
        let Some(inside) = path.strip_prefix("contacts/") else {
            return path.parse().ok().map(Scalar::Total);
        };
        let mut tokens = inside.split('/');
        let boundary = tokens.next()?.replace("~1", "/").replace("~0", "~");
        let number = tokens.next()?;
        let of_peak = tokens.next();
        if tokens.next().is_some() {
            return None;
        }
        match number.parse() {
            Ok(stress) => {
                let of_peak = of_peak.map_or(Ok(OfPeak::Value), str::parse).ok()?;
                Some(Scalar::OfPeak(boundary, stress, of_peak))
            }
            Err(_) if of_peak.is_none() => {
                let number = number.parse().ok()?;
                Some(Scalar::OfContact(boundary, number))
            }
            Err(_) => None,
        }
    }

    /// The contact boundary that it belongs to.
    pub fn boundary(&self) -> Option<&str> {
        match self {
            Scalar::Total(_) => None,
            Scalar::OfContact(boundary, _) | Scalar::OfPeak(boundary, ..) => Some(boundary),
        }
    }

    /// All paths, in words.
    pub fn expected() -> String {
        let words = |names: Vec<&'static str>| names.join(", ");
        let (totals, of_contact, peaks, of_peak) = (
            words(names::<Total>()),
            words(names::<OfContact>()),
            words(names::<Stress>()),
            words(names::<OfPeak>()),
        );
        format!(
            "{totals}; or contacts/BOUNDARY/ and {of_contact}, {peaks} (or of these / and {of_peak})"
        )
    }

    /// The number; none if the result has none, as a peak without contact.
    #[rustfmt::skip]
    pub fn of(&self, summary: &Summary) -> Option<f64> {
        match self {
            Scalar::Total(total) => match total {
                Total::NormalForce     => Some(summary.normal_force),
                Total::TangentialForce => Some(summary.tangential_force),
                Total::FrictionForce   => Some(summary.friction_force),
                Total::Energy          => Some(summary.energy),
                Total::FrictionWork    => Some(summary.friction_work),
                Total::StrainEnergy    => summary.strain_energy,
            },
            Scalar::OfContact(boundary, number) => {
                let contact = summary.contacts.get(boundary)?;
                Some(match number {
                    OfContact::NormalForce     => contact.normal_force,
                    OfContact::TangentialForce => contact.tangential_force,
                    OfContact::FrictionForce   => contact.friction_force,
                    OfContact::ContactWidth    => length(&contact.contact),
                    OfContact::StickWidth      => length(&contact.stick),
                    OfContact::SlipWidth       => length(&contact.slip),
                })
            }
            Scalar::OfPeak(boundary, stress, of_peak) => {
                let contact: &ContactSummary = summary.contacts.get(boundary)?;
                let Peak { value, s, x, y } = match stress {
                    Stress::PeakNormalStress     => contact.peak_normal_stress,
                    Stress::PeakTangentialStress => contact.peak_tangential_stress,
                }?;
                Some(match of_peak {
                    OfPeak::Value => value,
                    OfPeak::S     => s,
                    OfPeak::X     => x,
                    OfPeak::Y     => y,
                })
            }
        }
    }
}

/// The names of all variants.
fn names<T: VariantArray + Copy + Into<&'static str>>() -> Vec<&'static str> {
    T::VARIANTS.iter().map(|one| (*one).into()).collect()
}

/// The length of all intervals together.
fn length(intervals: &[[f64; 2]]) -> f64 {
    intervals.iter().map(|[from, to]| to - from).sum()
}

/// Numbers in one list, as vectors of these sizes.
pub fn in_vectors(numbers: &[f64], sizes: &[usize]) -> Vec<Vec<f64>> {
    let mut rest = numbers.iter().copied();
    let vector = |size: &usize| rest.by_ref().take(*size).collect();
    sizes.iter().map(vector).collect()
}

/// The names of contact boundaries of a problem.
pub fn boundaries(problem: &Problem) -> Vec<&str> {
    let contacts = problem.contacts.iter();
    contacts.map(|contact| contact.boundary.as_str()).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::fake;

    #[test]
    fn every_number_of_a_summary_has_its_path() {
        let summary = fake::solution().summary;
        let value = |path: &str| Scalar::parse(path).unwrap().of(&summary);
        assert_eq!(value("normal_force"), Some(summary.normal_force));
        let top = &summary.contacts["top"];
        let peak = top.peak_tangential_stress.unwrap();
        assert_eq!(
            value("contacts/top/peak_tangential_stress"),
            Some(peak.value)
        );
        assert_eq!(value("contacts/top/peak_tangential_stress/x"), Some(peak.x));
        assert_eq!(
            value("contacts/top/contact_width"),
            Some(length(&top.contact))
        );
        assert_eq!(
            value("contacts/side/normal_force"),
            None,
            "there is no such contact"
        );
        // those that are in the summary have the names that it has in JSON
        let json = serde_json::to_value(&summary).unwrap();
        for name in names::<Total>() {
            assert_eq!(json[name].as_f64(), value(name), "{name}");
        }
        for name in names::<OfContact>()
            .into_iter()
            .filter(|name| name.ends_with("force"))
        {
            let path = format!("contacts/top/{name}");
            assert_eq!(
                json["contacts"]["top"][name].as_f64(),
                value(&path),
                "{path}"
            );
        }
        for name in names::<Stress>() {
            for part in names::<OfPeak>() {
                let path = format!("contacts/top/{name}/{part}");
                let expected = json["contacts"]["top"][name][part].as_f64();
                assert_eq!(expected, value(&path), "{path}");
            }
        }
    }

    #[test]
    fn what_is_no_path_of_a_number_is_none() {
        for wrong in [
            "",
            "normal_forces",
            "/normal_force",
            "contacts",
            "contacts/top",
            "contacts/top/normal_force/value",
            "contacts/top/peak_normal_stress/z",
            "contacts/top/peak_normal_stress/x/0",
            "outcome",
        ] {
            assert_eq!(Scalar::parse(wrong), None, "{wrong}");
        }
        let escaped = Scalar::parse("contacts/a~1b/normal_force").unwrap();
        assert_eq!(escaped.boundary(), Some("a/b"));
    }

    #[test]
    fn a_number_that_a_result_does_not_have_is_none() {
        let mut summary = fake::solution().summary;
        let top = summary.contacts.get_mut("top").unwrap();
        (top.peak_normal_stress, top.contact) = (None, vec![]);
        let value = |path: &str| Scalar::parse(path).unwrap().of(&summary);
        assert_eq!(value("contacts/top/peak_normal_stress"), None);
        assert_eq!(value("contacts/top/contact_width"), Some(0.0));
    }

    #[test]
    fn outputs_are_read_as_they_are_written() {
        for text in [
            r#"{"scalars":["normal_force"]}"#,
            r#"{"profile":"top","quantity":"normal_stress","points":5}"#,
        ] {
            let output: Output = serde_json::from_str(text).unwrap();
            assert_eq!(serde_json::to_string(&output).unwrap(), text);
        }
        assert_eq!(
            in_vectors(&[1.0, 2.0, 3.0], &[1, 2]),
            [vec![1.0], vec![2.0, 3.0]]
        );
    }
}
