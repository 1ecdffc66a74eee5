//! The two fingerprints: of a problem (`input_hash`) and of a result (`digest`). Both are the
//! SHA-256 of canonical JSON (RFC 8785), so that any client in any language can check them.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::json;
use sha2::{Digest, Sha256};
use solver::body::Source;
use solver::model::Model;
use solver::problem::Problem;
use solver::solution::{Fields, GaussFields, Solution};

use crate::bodies::Key;

/// Fingerprint of a problem with its defaults filled in. The title is for people and not included. Units are:
/// problems are stored once per fingerprint, and figures show their units.
pub fn input_hash(problem: &Problem) -> serde_json::Result<String> {
    let untitled = Problem {
        title: None,
        ..problem.clone()
    };
    of_json(&untitled)
}

/// Fingerprint of anything that has a canonical form.
pub fn of_json(value: &impl Serialize) -> serde_json::Result<String> {
    let mut hash = Hash::default();
    hash.json(value)?;
    Ok(hash.text())
}

/// Fingerprint of all that a model's body is made from. It is that of a binary form, not of JSON: it never leaves this
/// process, and the canonical writer would hold a large mesh as text.
pub fn of_body(model: &Model) -> postcard::Result<Key> {
    let hash = io::BufWriter::with_capacity(1 << 16, Hash::default());
    let hash = postcard::to_io(&Source::of(model), hash)?.into_inner();
    let Hash(hash) = hash.map_err(|_| postcard::Error::SerializeBufferFull)?;
    Ok(hash.finalize().into())
}

/// Fingerprint of a result: equal digests mean equal bits. Times, the program's version and what is said about the
/// accuracy are not included. All numbers must be finite: others have no canonical form.
pub fn digest(solution: &Solution, input_hash: &str) -> serde_json::Result<String> {
    let mut summary = serde_json::to_value(&solution.summary)?;
    summary["input_hash"] = json!(input_hash);
    if let Some(summary) = summary.as_object_mut() {
        summary.remove("accuracy");
    }
    // The outermost object and the fields are written by hand, their keys in canonical order: the canonical writer
    // holds every object it is inside of in memory, and fields can be large.
    let mut hash = Hash::default();
    hash.text_of(r#"{"fields":"#);
    hash.fields(&solution.fields)?;
    hash.text_of(r#","history":"#).json(&solution.history)?;
    hash.text_of(r#","profiles":"#).json(&solution.profiles)?;
    hash.text_of(r#","steps":"#).json(&solution.steps)?;
    hash.text_of(r#","summary":"#).json(&summary)?;
    hash.text_of("}");
    Ok(hash.text())
}

/// A finished hash in its text form.
pub fn sha256_text(hash: Sha256) -> String {
    format!("sha256:{}", hex(&hash.finalize()))
}

/// Two lower-case hexadecimal digits for each byte.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// SHA-256 as something to write canonical JSON to.
#[derive(Default)]
struct Hash(Sha256);

impl Hash {
    fn text_of(&mut self, text: &str) -> &mut Self {
        self.0.update(text);
        self
    }

    fn json(&mut self, value: &impl Serialize) -> serde_json::Result<()> {
        let mut buffered = io::BufWriter::with_capacity(1 << 16, &mut *self);
        serde_json_canonicalizer::to_writer(value, &mut buffered)?;
        buffered.flush().map_err(serde_json::Error::io)
    }

    fn fields(&mut self, fields: &Fields) -> serde_json::Result<()> {
        // all of them by name, so that a new one is not forgotten here
        let Fields {
            contact_state,
            element_error,
            elements,
            gauss,
            stress_xx,
            stress_xy,
            stress_yy,
            stress_zz,
            ux,
            uy,
            x,
            y,
        } = fields;
        self.text_of(r#"{"contact_state":"#).json(contact_state)?;
        self.column(r#","element_error":"#, element_error)?;
        self.text_of(r#","elements":"#).json(elements)?;
        let GaussFields {
            order,
            stress_xx: at_points_xx,
            stress_xy: at_points_xy,
            stress_yy: at_points_yy,
            stress_zz: at_points_zz,
            x: points_x,
            y: points_y,
        } = gauss;
        self.text_of(r#","gauss":{"order":"#).json(order)?;
        self.column(r#","stress_xx":"#, at_points_xx)?;
        self.column(r#","stress_xy":"#, at_points_xy)?;
        self.column(r#","stress_yy":"#, at_points_yy)?;
        self.column(r#","stress_zz":"#, at_points_zz)?;
        self.column(r#","x":"#, points_x)?;
        self.column(r#","y":"#, points_y)?;
        self.column(r#"},"stress_xx":"#, stress_xx)?;
        self.column(r#","stress_xy":"#, stress_xy)?;
        self.column(r#","stress_yy":"#, stress_yy)?;
        self.column(r#","stress_zz":"#, stress_zz)?;
        self.column(r#","ux":"#, ux)?;
        self.column(r#","uy":"#, uy)?;
        self.column(r#","x":"#, x)?;
        self.column(r#","y":"#, y)?;
        self.text_of("}");
        Ok(())
    }

    /// A key and the list of its numbers, as the canonical writer has them.
    fn column(&mut self, key: &str, numbers: &[f64]) -> serde_json::Result<()> {
        const AT_ONCE: usize = 1024;
        self.text_of(key).text_of("[");
        let (mut text, mut number) = (String::new(), ryu_js::Buffer::new());
        for (part, numbers) in numbers.chunks(AT_ONCE).enumerate() {
            text.clear();
            for (k, value) in numbers.iter().enumerate() {
                if !value.is_finite() {
                    let message = format!("{value} has no canonical form");
                    return Err(serde::ser::Error::custom(message));
                }
                if part + k > 0 {
                    text.push(',');
                }
                text.push_str(number.format_finite(*value));
            }
            self.text_of(&text);
        }
        self.text_of("]");
        Ok(())
    }

    fn text(self) -> String {
        sha256_text(self.0)
    }
}

impl Write for Hash {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::fake;
    use solver::{problem::Elasticity, solution::StepSolution};

    #[test]
    fn a_title_does_not_change_the_input() {
        let problem = fake::problem();
        let titled = Problem {
            title: Some("other".into()),
            ..problem.clone()
        };
        assert_eq!(input_hash(&problem).unwrap(), input_hash(&titled).unwrap());
        let mut other = problem.clone();
        other.materials[0].elasticity = Elasticity::Isotropic {
            youngs_modulus: 1001.0,
            poissons_ratio: 0.3,
        };
        assert_ne!(input_hash(&problem).unwrap(), input_hash(&other).unwrap());
        let named = Problem {
            units: Some(solver::problem::Units::default()),
            ..problem.clone()
        };
        assert_ne!(input_hash(&problem).unwrap(), input_hash(&named).unwrap());
    }

    #[test]
    fn the_last_bit_of_a_field_changes_a_digest() {
        let solution = fake::solution();
        let mut other = solution.clone();
        other.fields.ux[0] = f64::from_bits(other.fields.ux[0].to_bits() + 1);
        assert_ne!(
            digest(&solution, "h").unwrap(),
            digest(&other, "h").unwrap()
        );
        assert_ne!(
            digest(&solution, "h").unwrap(),
            digest(&solution, "i").unwrap()
        );
    }

    #[test]
    fn a_number_without_a_canonical_form_has_no_digest() {
        let mut solution = fake::solution();
        solution.fields.uy[0] = f64::NAN;
        assert!(digest(&solution, "h").is_err());
    }

    #[test]
    fn a_digest_is_the_hash_of_one_canonical_document() {
        let mut solution = fake::solution();
        solution.steps.push(StepSolution {
            name: "indent".into(),
            summary: solution.summary.clone(),
            history: solution.history.clone(),
            profiles: solution.profiles.clone(),
            node_profiles: solution.node_profiles.clone(),
            friction_profiles: solution.friction_profiles.clone(),
        });
        // more numbers than are written at once, of every form that a number can have
        let forms = [
            0.0,
            -0.0,
            1.0,
            -2.5,
            1e21,
            1e-7,
            123456.789,
            5e-324,
            f64::MAX,
            0.1 + 0.2,
        ];
        let numbers = (0..3000).map(|k| forms[k % forms.len()] / (1 + k / 7) as f64);
        solution.fields.gauss.stress_xy = numbers.collect();
        let mut document = serde_json::to_value(&solution).unwrap();
        document["summary"]["input_hash"] = json!("h");
        document["summary"]
            .as_object_mut()
            .unwrap()
            .remove("accuracy");
        let mut whole = Hash::default();
        whole.json(&document).unwrap();
        assert_eq!(digest(&solution, "h").unwrap(), whole.text());
    }
}
