//! The fingerprints of a problem (`input_hash`) and of a result (`digest`) are the SHA-256 of canonical JSON (RFC
//! 8785), so that any client in any language can check them. The fingerprint of a body is used within one process only.

mod lists;
mod number;

use std::io::{self, Write};

use lists::List;
use serde::Serialize;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use solver::body::Source;
use solver::model::Model;
use solver::problem::{InlineMesh, MeshInput, MeshSource, Problem};
use solver::solution::{self, Fields, GaussFields, Solution, StepSolution};

use crate::bodies::Key;

/// The fingerprint of a problem with its defaults filled in. The title is for people and not included. Units are
/// included: problems are stored once per fingerprint, and figures show their units.
pub fn input_hash(problem: &Problem) -> serde_json::Result<String> {
    let mut hash = Hash::new();
    hash.problem(problem)?;
    Ok(hash.finish())
}

/// The fingerprint of anything that has a canonical form.
pub fn of_json(value: &impl Serialize) -> serde_json::Result<String> {
    let mut hash = Hash::new();
    hash.json(value)?;
    Ok(hash.finish())
}

/// The fingerprint of everything that a model's body is made from. It uses a binary form, not JSON: it never leaves
/// this process, and the canonical writer would hold a large mesh as text.
pub fn of_body(model: &Model) -> postcard::Result<Key> {
    let hash = postcard::to_io(&Source::of(model), Hash::new())?;
    Ok(hash.sha256().finalize().into())
}

/// Fingerprint of a result: equal digests mean equal bits. Times, the program's version, the statements about accuracy and
/// the severities of warnings are not included. All numbers must be finite: others have no canonical form. `go_on` is called before every
/// row and load step, and again and again on the way through the fields; `None` if it returns false. `threads`: the number of threads that
/// write the fields.
pub fn digest(
    solution: &Solution,
    input_hash: &str,
    threads: usize,
    go_on: &mut dyn FnMut() -> bool,
) -> serde_json::Result<Option<String>> {
    let mut summary = without_severities(&solution.summary)?;
    summary["input_hash"] = json!(input_hash);
    if let Some(summary) = summary.as_object_mut() {
        summary.remove("accuracy");
    }
    // The outermost object and the fields are written by hand, their keys in canonical order: the canonical writer
    // holds every object it is inside of in memory, and fields can be large.
    let mut hash = Hash::new();
    hash.text_of(r#"{"fields":{"#);
    if !hash.fields(&solution.fields, threads, go_on)? {
        return Ok(None);
    }
    hash.text_of(r#"},"history":"#);
    if !hash.array(&solution.history, go_on)? {
        return Ok(None);
    }
    hash.text_of(r#","profiles":"#).json(&solution.profiles)?;
    hash.text_of(r#","steps":["#);
    for (number, step) in solution.steps.iter().enumerate() {
        if !go_on() {
            return Ok(None);
        }
        hash.text_of(if number == 0 { "" } else { "," });
        hash.step(step)?;
    }
    hash.text_of(r#"],"summary":"#).json(&summary)?;
    hash.text_of("}");
    Ok(Some(hash.finish()))
}

/// A summary as JSON, with its warnings as they were before they had severities, which follow from their codes.
fn without_severities(summary: &solution::Summary) -> serde_json::Result<Value> {
    let mut summary = serde_json::to_value(summary)?;
    for warning in summary["warnings"].as_array_mut().into_iter().flatten() {
        if let Some(warning) = warning.as_object_mut() {
            warning.remove("severity");
        }
    }
    Ok(summary)
}

/// A finished hash as text.
pub fn sha256_text(hash: Sha256) -> String {
    format!("sha256:{}", hex(&hash.finalize()))
}

/// Two lower-case hexadecimal digits for each byte.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The number of bytes that are hashed at once.
const AT_ONCE: usize = 1 << 14;

/// A writer of canonical JSON that computes its SHA-256.
struct Hash {
    sha256: Sha256,
    /// The text that is not hashed yet: the first `length` bytes.
    text: Box<[u8; AT_ONCE]>,
    length: usize,
}

impl Hash {
    fn new() -> Self {
        Hash {
            sha256: Sha256::new(),
            text: Box::new([0; AT_ONCE]),
            length: 0,
        }
    }

    fn text_of(&mut self, text: &str) -> &mut Self {
        self.bytes(text.as_bytes());
        self
    }

    fn bytes(&mut self, bytes: &[u8]) {
        self.make_room(bytes.len());
        match self.text[self.length..].get_mut(..bytes.len()) {
            Some(room) => {
                room.copy_from_slice(bytes);
                self.length += bytes.len();
            }
            None => self.sha256.update(bytes),
        }
    }

    /// Makes room for `bytes` more bytes; if necessary, hashes the text so far and empties the buffer.
    fn make_room(&mut self, bytes: usize) {
        if self.length + bytes > AT_ONCE {
            self.sha256.update(&self.text[..self.length]);
            self.length = 0;
        }
    }

    fn json(&mut self, value: &impl Serialize) -> serde_json::Result<()> {
        serde_json_canonicalizer::to_writer(value, self)
    }

    /// Writes an array, one value after another; false if `go_on` returned false before a value.
    fn array(
        &mut self,
        values: &[impl Serialize],
        go_on: &mut dyn FnMut() -> bool,
    ) -> serde_json::Result<bool> {
        self.text_of("[");
        for (number, value) in values.iter().enumerate() {
            if !go_on() {
                return Ok(false);
            }
            self.text_of(if number == 0 { "" } else { "," })
                .json(value)?;
        }
        self.text_of("]");
        Ok(true)
    }

    /// Writes a load step without the severities of its warnings.
    fn step(&mut self, step: &StepSolution) -> serde_json::Result<()> {
        // all of them by name, so that a new one is not forgotten here
        let StepSolution {
            history,
            name,
            profiles,
            summary,
            node_profiles: _,
            friction_profiles: _,
        } = step;
        self.text_of(r#"{"history":"#).json(history)?;
        self.text_of(r#","name":"#).json(name)?;
        self.text_of(r#","profiles":"#).json(profiles)?;
        self.text_of(r#","summary":"#)
            .json(&without_severities(summary)?)?;
        self.text_of("}");
        Ok(())
    }

    /// Writes a problem without its title. A mesh that the problem contains is written by this type, not by serde.
    fn problem(&mut self, problem: &Problem) -> serde_json::Result<()> {
        // all of them by name, here and below, so that a new one is not forgotten
        let Problem {
            analysis,
            contacts,
            loads,
            materials,
            mesh,
            quadrature,
            solver,
            steps,
            supports,
            title: _,
            units,
        } = problem;
        self.text_of(r#"{"analysis":"#).json(analysis)?;
        self.text_of(r#","contacts":"#).json(contacts)?;
        self.text_of(r#","loads":"#).json(loads)?;
        self.text_of(r#","materials":"#).json(materials)?;
        self.text_of(r#","mesh":"#);
        self.mesh(mesh)?;
        self.text_of(r#","quadrature":"#).json(quadrature)?;
        self.text_of(r#","solver":"#).json(solver)?;
        self.text_of(r#","steps":"#).json(steps)?;
        self.text_of(r#","supports":"#).json(supports)?;
        if let Some(units) = units {
            self.text_of(r#","units":"#).json(units)?;
        }
        self.text_of("}");
        Ok(())
    }

    fn mesh(&mut self, mesh: &MeshInput) -> serde_json::Result<()> {
        let MeshInput {
            boundaries: parts,
            curves,
            groups: ranges,
            refine,
            source,
        } = mesh;
        let MeshSource::Inline(inline) = source else {
            return self.json(mesh);
        };
        self.text_of("{");
        if !parts.is_empty() {
            self.text_of(r#""boundaries":"#).json(parts)?;
            self.text_of(",");
        }
        if !curves.is_empty() {
            self.text_of(r#""curves":"#).json(curves)?;
            self.text_of(",");
        }
        if !ranges.is_empty() {
            self.text_of(r#""groups":"#).json(ranges)?;
            self.text_of(",");
        }
        let InlineMesh {
            boundaries,
            elements,
            groups,
            node_sets,
            nodes,
            temperatures,
        } = inline;
        self.text_of(r#""inline":{"boundaries":"#)
            .json(boundaries)?;
        self.lists(&[(r#","elements":"#, List::Elements(elements))])?;
        if !groups.is_empty() {
            self.text_of(r#","groups":"#).json(groups)?;
        }
        if !node_sets.is_empty() {
            self.text_of(r#","node_sets":"#).json(node_sets)?;
        }
        self.lists(&[(r#","nodes":"#, List::Places(nodes))])?;
        if !temperatures.is_empty() {
            self.text_of(r#","temperatures":"#).json(temperatures)?;
        }
        self.text_of(r#"},"refine":"#).json(refine)?;
        self.text_of("}");
        Ok(())
    }

    /// Writes the content of the object of the fields; false if `go_on` returned false.
    fn fields(
        &mut self,
        fields: &Fields,
        threads: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) -> serde_json::Result<bool> {
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
        let GaussFields {
            order,
            stress_xx: at_points_xx,
            stress_xy: at_points_xy,
            stress_yy: at_points_yy,
            stress_zz: at_points_zz,
            x: points_x,
            y: points_y,
        } = gauss;
        let order = format!(r#","gauss":{{"order":{order},"stress_xx":"#);
        let (column, coordinates) = (List::Numbers, List::Repeated);
        let lists = [
            (r#""contact_state":"#, List::States(contact_state)),
            (r#","element_error":"#, column(element_error)),
            (r#","elements":"#, List::Elements(elements)),
            (order.as_str(), column(at_points_xx)),
            (r#","stress_xy":"#, column(at_points_xy)),
            (r#","stress_yy":"#, column(at_points_yy)),
            (r#","stress_zz":"#, column(at_points_zz)),
            (r#","x":"#, coordinates(points_x)),
            (r#","y":"#, coordinates(points_y)),
            (r#"},"stress_xx":"#, column(stress_xx)),
            (r#","stress_xy":"#, column(stress_xy)),
            (r#","stress_yy":"#, column(stress_yy)),
            (r#","stress_zz":"#, column(stress_zz)),
            (r#","ux":"#, column(ux)),
            (r#","uy":"#, column(uy)),
            (r#","x":"#, coordinates(x)),
            (r#","y":"#, coordinates(y)),
        ];
        are_finite(&lists)?;
        Ok(lists::write(&lists, threads, go_on, |text| self.bytes(text)).is_ok())
    }

    /// Writes keys and lists of a mesh.
    fn lists(&mut self, lists: &[(&str, List<'_>)]) -> serde_json::Result<()> {
        are_finite(lists)?;
        // nobody stops this
        let _ = lists::write(lists, 1, &mut || true, |text| self.bytes(text));
        Ok(())
    }

    fn finish(self) -> String {
        sha256_text(self.sha256())
    }

    fn sha256(mut self) -> Sha256 {
        self.sha256.update(&self.text[..self.length]);
        self.sha256
    }
}

/// Fails unless all numbers are finite: others have no canonical form.
fn are_finite(lists: &[(&str, List<'_>)]) -> serde_json::Result<()> {
    match lists.iter().find_map(|(_, list)| list.not_finite()) {
        Some(value) => {
            let message = format!("{value} has no canonical form");
            Err(serde::ser::Error::custom(message))
        }
        None => Ok(()),
    }
}

impl Write for Hash {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.bytes(bytes);
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

    fn digest_of(solution: &Solution, input_hash: &str) -> serde_json::Result<String> {
        let [one, two] = [1, 2].map(|threads| digest(solution, input_hash, threads, &mut || true));
        let (one, two) = (one?.unwrap(), two?.unwrap());
        assert_eq!(one, two);
        Ok(one)
    }
    use std::collections::BTreeMap;

    use solver::element::Element;
    use solver::problem::{BoundaryPart, Curve, CurveKind, Elasticity, ElementRange};

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
            digest_of(&solution, "h").unwrap(),
            digest_of(&other, "h").unwrap()
        );
        assert_ne!(
            digest_of(&solution, "h").unwrap(),
            digest_of(&solution, "i").unwrap()
        );
    }

    #[test]
    fn a_number_without_a_canonical_form_has_no_digest() {
        let mut solution = fake::solution();
        solution.fields.uy[0] = f64::NAN;
        assert!(digest_of(&solution, "h").is_err());
    }

    #[test]
    fn writing_the_fields_can_be_stopped() {
        let mut solution = fake::solution();
        solution.history.clear();
        solution.steps.clear();
        for threads in [1, 2] {
            let digest = digest(&solution, "h", threads, &mut || false);
            assert_eq!(digest.unwrap(), None);
        }
    }

    #[test]
    fn a_digest_is_the_hash_of_one_canonical_document() {
        let mut solution = fake::solution();
        solution.summary.warnings = vec![solution::Warning {
            code: solution::WarningCode::SharpEdge,
            pointer: "/contacts/0".into(),
            message: "The contact ends at a sharp edge.".into(),
        }];
        solution.steps.push(StepSolution {
            name: "indent".into(),
            summary: solution.summary.clone(),
            history: solution.history.clone(),
            profiles: solution.profiles.clone(),
            node_profiles: solution.node_profiles.clone(),
            friction_profiles: solution.friction_profiles.clone(),
        });
        let elements = [
            Element::Quad([0, 1, 2, 3, 4, 5, 6, 4_294_967_295]),
            Element::Triangle([10, 9, 8, 7, 6, 5]),
        ];
        // as many as are written at once, some whole times and with a rest
        solution.fields.elements = elements.repeat(513);
        solution.fields.contact_state = [0, 1, -1, 2].repeat(512);
        solution.fields.gauss.x = vec![0.25; 1025];
        // more numbers than are hashed at once, of every form that a number can have
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
        for summary in ["/summary", "/steps/0/summary"] {
            let warnings = document.pointer_mut(&format!("{summary}/warnings"));
            let warning = warnings.unwrap()[0].as_object_mut().unwrap();
            assert_eq!(warning.remove("severity"), Some(json!("note")));
        }
        let mut whole = Hash::new();
        whole.json(&document).unwrap();
        assert_eq!(digest_of(&solution, "h").unwrap(), whole.finish());
    }

    #[test]
    fn an_input_hash_is_the_hash_of_one_canonical_problem() {
        let mut problem = fake::problem();
        let canonical = |problem: &Problem| {
            let untitled = Problem {
                title: None,
                ..problem.clone()
            };
            of_json(&untitled).unwrap()
        };
        assert_eq!(input_hash(&problem).unwrap(), canonical(&problem));
        problem.title = Some("of people".into());
        problem.units = Some(solver::problem::Units::default());
        let mut inline = InlineMesh {
            temperatures: Vec::new(),
            nodes: (0..3000).map(|k| [0.1 * f64::from(k), -1e-7]).collect(),
            elements: vec![Element::Quad([7; 8]), Element::Triangle([3; 6])],
            boundaries: BTreeMap::from([("é\n\"".into(), vec![[0, 1, 2]])]),
            groups: BTreeMap::new(),
            node_sets: BTreeMap::new(),
        };
        for named in [false, true] {
            problem.mesh = MeshInput::new(MeshSource::Inline(inline.clone()));
            if named {
                let (part, range) = (BoundaryPart::default(), ElementRange::default());
                problem.mesh.boundaries.insert("part".into(), part);
                problem.mesh.groups.insert("range".into(), range);
                let curve = Curve {
                    kind: CurveKind::Circle,
                    center: Some([0.0, 1.0]),
                    radius: Some(4.0),
                };
                problem.mesh.curves.insert("part".into(), curve);
            }
            assert_eq!(input_hash(&problem).unwrap(), canonical(&problem));
            inline.groups.insert("group".into(), vec![0, 1]);
            inline.node_sets.insert("set".into(), vec![2]);
            inline.temperatures = vec![20.0, -1e-7];
        }
        inline.nodes[1][1] = f64::INFINITY;
        problem.mesh = MeshInput::new(MeshSource::Inline(inline));
        assert!(input_hash(&problem).is_err());
    }
}
