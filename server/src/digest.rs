//! The two fingerprints: of a problem (`input_hash`) and of a result (`digest`). Both are the
//! SHA-256 of canonical JSON (RFC 8785), so that any client in any language can check them.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::json;
use sha2::{Digest, Sha256};
use solver::{problem::Problem, solution::Solution};

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

/// Fingerprint of a result: equal digests mean equal bits. Times, the program's version and what is said about the
/// accuracy are not included. All numbers must be finite: others have no canonical form.
pub fn digest(solution: &Solution, input_hash: &str) -> serde_json::Result<String> {
    let mut summary = serde_json::to_value(&solution.summary)?;
    summary["input_hash"] = json!(input_hash);
    if let Some(summary) = summary.as_object_mut() {
        summary.remove("accuracy");
    }
    // The outermost object is written by hand, its keys in canonical order: the canonical writer
    // holds every object it is inside of in memory, and fields can be large.
    let mut hash = Hash::default();
    hash.text_of(r#"{"fields":"#).json(&solution.fields)?;
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
