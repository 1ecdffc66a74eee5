//! Problems from JSON: strict, and with all structural faults reported at once.
//!
//! The nodes and elements of an inline mesh, nearly all of a large problem, are removed while the text is read. The
//! rest is first checked against our JSON Schema, which gives all faults with their places, in memory that does not
//! depend on the content of the text; then serde reads that rest.

use std::fmt;
use std::io::Read;

use serde::de::{DeserializeOwned, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use crate::inline::{Extract, Places};
use crate::schema::violations;
use crate::source::{BYTE_ORDER_MARK, ReadError};
use solver::error::{Reason, Violation, escape};
use solver::problem::{MeshSource, Problem, elastic_slip_rule};

/// The names that lead to an inline mesh.
const INLINE: &[&str] = &["mesh", "inline"];

/// The largest number of brackets that may be open at once. A problem opens at most ten.
pub const MOST_NESTED: usize = 64;

/// Reads a problem from JSON.
///
/// # Errors
///
/// All violations of the problem's structure (at most a hundred), with pointers relative to the problem: unknown and
/// missing fields, wrong types, no or several alternatives where exactly one is required. Combinations of fields are
/// checked by the solver.
pub fn parse(text: &str) -> Result<Problem, Vec<Violation>> {
    let text = text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text);
    if text.contains("\"inline\"") {
        read(text.as_bytes()).map_err(ReadError::into_violations)
    } else {
        check(text, &Places::default())
    }
}

/// Reads a problem from a reader, in pieces. Of an inline mesh only the columns are held in memory, and never the whole
/// text, unless the mesh is faulty.
///
/// # Errors
///
/// [`ReadError::Io`] if the reader fails or the text is not UTF-8; [`ReadError::Invalid`] with the violations of
/// [`parse`].
pub fn read(reader: impl Read) -> Result<Problem, ReadError> {
    let mut extract = Extract::new(reader, INLINE);
    let mut text = String::new();
    let read = extract.read_to_string(&mut text);
    read.map_err(ReadError::Io)?;
    if text.starts_with(BYTE_ORDER_MARK) {
        text.drain(..BYTE_ORDER_MARK.len_utf8());
    }
    let taken = extract.taken();
    let mut problem = check(&text, &taken.places).map_err(ReadError::Invalid)?;
    if let MeshSource::Inline(mesh) = &mut problem.mesh.source {
        taken.put(mesh);
    }
    Ok(problem)
}

/// Reads a problem from a text. `places` converts places in this text to places in the original text.
pub(crate) fn check(text: &str, places: &Places) -> Result<Problem, Vec<Violation>> {
    if text.trim().is_empty() {
        return Err(vec![Violation::new(
            "",
            Reason::Malformed,
            "an empty text",
            "a problem as JSON",
            "An example is in the README.",
        )]);
    }
    if let Some((line, column)) = deepest(text) {
        let (line, column) = places.original(line, column);
        return Err(vec![Violation::new(
            "",
            Reason::Malformed,
            nested_too_deeply(line, column),
            format!("at most {MOST_NESTED}"),
            "Check the brackets there; no problem is nested so deeply.",
        )]);
    }
    match violations(text) {
        Ok(list) if list.is_empty() => {}
        Ok(mut list) => {
            suggest_elastic_slip(text, &mut list);
            return Err(list);
        }
        Err(error) => {
            return Err(vec![Violation::new(
                "",
                Reason::Malformed,
                places.message(&syntax_error(text).unwrap_or(error)),
                "a JSON document (RFC 8259), numbers within double precision",
                "Check the text at that line and column.",
            )]);
        }
    }
    serde_json::from_str(text).map_err(|first| {
        let hint = "See /v1/schema/problem.json.";
        vec![beyond_the_schema::<Problem>(
            text,
            places.message(&first),
            hint,
        )]
    })
}

/// Adds to each violation of a missing elastic slip what to take, by the displacements of its obstacle.
fn suggest_elastic_slip(text: &str, violations: &mut [Violation]) {
    const SLIP: &str = "/friction/elastic_slip";
    let missing =
        |found: &&mut Violation| found.reason == Reason::Missing && found.pointer.ends_with(SLIP);
    let mut missing = violations.iter_mut().filter(missing).peekable();
    if missing.peek().is_none() {
        return;
    }
    let Ok(problem) = serde_json::from_str::<serde_json::Value>(text) else {
        return;
    };
    for violation in missing {
        let contact = violation.pointer.strip_suffix(SLIP).unwrap_or_default();
        let moved = |field: &str| {
            let given = problem.pointer(&format!("{contact}/{field}"));
            given.and_then(serde_json::Value::as_f64).unwrap_or(0.0)
        };
        let rule = elastic_slip_rule(moved("indentation"), moved("tangential_displacement"));
        violation.hint = format!("{} {rule}", violation.hint);
    }
}

/// The place, in words, of the first bracket beyond [`MOST_NESTED`] open ones.
pub fn too_deep(text: &str) -> Option<String> {
    deepest(text).map(|(line, column)| nested_too_deeply(line, column))
}

fn nested_too_deeply(line: usize, column: usize) -> String {
    format!("more than {MOST_NESTED} open brackets at line {line} column {column}")
}

/// The line and column of the first bracket beyond [`MOST_NESTED`] open ones.
fn deepest(text: &str) -> Option<(usize, usize)> {
    let bytes = text.as_bytes();
    let (mut depth, mut at, mut line, mut start) = (0, 0, 1, 0);
    while let Some(byte) = bytes.get(at) {
        match byte {
            b'"' => {
                at += 1;
                while let Some(byte) = bytes.get(at).filter(|byte| **byte != b'"') {
                    at += if *byte == b'\\' { 2 } else { 1 };
                }
            }
            b'[' | b'{' if depth == MOST_NESTED => {
                return Some((line, at + 1 - start));
            }
            b'[' | b'{' => depth += 1,
            b']' | b'}' => depth = depth.saturating_sub(1),
            b'\n' => (line, start) = (line + 1, at + 1),
            _ => {}
        }
        at += 1;
    }
    None
}

/// The first error of a text's syntax, or of a number or string without a value, with line and column.
pub(crate) fn syntax_error(text: &str) -> Option<serde_json::Error> {
    let mut reader = serde_json::Deserializer::from_str(text);
    let read = reader.deserialize_any(Anything);
    read.and_then(|()| reader.end()).err()
}

/// Reads any value and keeps nothing; unlike serde's `IgnoredAny` it also checks numbers and strings.
struct Anything;

impl<'de> Visitor<'de> for Anything {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E: Error>(self) -> Result<(), E> {
        Ok(())
    }

    fn visit_bool<E: Error>(self, _: bool) -> Result<(), E> {
        Ok(())
    }

    fn visit_i64<E: Error>(self, _: i64) -> Result<(), E> {
        Ok(())
    }

    fn visit_u64<E: Error>(self, _: u64) -> Result<(), E> {
        Ok(())
    }

    fn visit_f64<E: Error>(self, _: f64) -> Result<(), E> {
        Ok(())
    }

    fn visit_str<E: Error>(self, _: &str) -> Result<(), E> {
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        while list.next_element_seed(Anything)?.is_some() {}
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<(), A::Error> {
        while members.next_key_seed(Anything)?.is_some() {
            members.next_value_seed(Anything)?;
        }
        Ok(())
    }
}

impl<'de> serde::de::DeserializeSeed<'de> for Anything {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, reader: D) -> Result<(), D::Error> {
        reader.deserialize_any(self)
    }
}

/// The violation for a fault that the schema cannot express, such as a repeated name or a number too large for its
/// type. `first`: the message of serde for the fault.
pub(crate) fn beyond_the_schema<T: DeserializeOwned>(
    text: &str,
    first: String,
    hint: &str,
) -> Violation {
    let mut reader = serde_json::Deserializer::from_str(text);
    let path = serde_path_to_error::deserialize::<_, T>(&mut reader).err();
    Violation::new(
        path.map_or_else(String::new, |error| pointer_of(error.path())),
        Reason::Malformed,
        first,
        "a value as the schema describes it",
        hint,
    )
}

fn pointer_of(path: &serde_path_to_error::Path) -> String {
    path.iter()
        .map(|segment| match segment {
            serde_path_to_error::Segment::Seq { index } => format!("/{index}"),
            serde_path_to_error::Segment::Map { key } => format!("/{}", escape(key)),
            _ => String::new(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;
    use crate::schema::accepts;

    const GOOD: &str = r#"{
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [0, 1], "y": [0, 1]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "contacts": [{"boundary": "top", "obstacle": {"kind": "flat"},
            "friction": {"coefficient": 0.3, "nonlocal_radius": 0.01, "elastic_slip": 1e-4}}]
    }"#;

    fn faults(from: &str, to: &str) -> Vec<(String, Reason, String)> {
        assert!(GOOD.contains(from), "{from}");
        let list = parse(&GOOD.replacen(from, to, 1)).expect_err("a faulty problem was accepted");
        list.into_iter()
            .map(|v| (v.pointer, v.reason, v.expected))
            .collect()
    }

    #[test]
    fn a_good_problem_is_read_with_its_defaults() {
        let problem = parse(GOOD).unwrap();
        assert_eq!(problem.solver.tolerance, 1e-10);
        assert_eq!(
            parse(&serde_json::to_string(&problem).unwrap()).unwrap(),
            problem
        );
    }

    #[test]
    fn a_byte_order_mark_is_passed_over() {
        let text = format!("\u{feff}{GOOD}");
        assert_eq!(parse(&text).unwrap(), parse(GOOD).unwrap());
        assert_eq!(read(text.as_bytes()).unwrap(), parse(GOOD).unwrap());
        assert!(parse(&format!("{GOOD}\u{feff}")).is_err());
    }

    #[test]
    fn every_structural_fault_is_reported_with_its_pointer() {
        let text = GOOD
            .replace("\"plane_strain\"", "\"plain_strain\"")
            .replace("[0, 1], \"y\"", "[0, \"one\"], \"y\"")
            .replace("\"youngs_modulus\"", "\"young\"")
            .replace("\"elastic_slip\": 1e-4", "\"kernel\": \"bell\"");
        let mut pointers: Vec<_> = parse(&text)
            .unwrap_err()
            .into_iter()
            .map(|v| v.pointer)
            .collect();
        pointers.sort();
        assert_eq!(
            pointers,
            [
                "/analysis/kind",
                "/contacts/0/friction/elastic_slip",
                "/contacts/0/friction/kernel",
                "/materials/0/young",
                "/materials/0/youngs_modulus",
                "/mesh/grid/x/1",
            ]
        );
    }

    #[test]
    fn a_missing_elastic_slip_is_suggested_from_the_displacements_of_the_obstacle() {
        let hints = |more: &str| -> Vec<String> {
            let slipless = GOOD.replace(", \"elastic_slip\": 1e-4", "");
            let text = slipless.replace(
                "\"boundary\": \"top\",",
                &format!("\"boundary\": \"top\",{more}"),
            );
            let found = parse(&text).unwrap_err().into_iter();
            found.map(|violation| violation.hint).collect()
        };
        let [hint] = &hints("\"indentation\": -0.02, \"tangential_displacement\": 0.5,")[..] else {
            panic!("not one violation");
        };
        assert!(
            hint.starts_with("The field has no default.") && hint.contains("5.0e-4"),
            "{hint}"
        );
        // of what is no number nothing is taken
        for more in ["", "\"indentation\": \"deep\","] {
            let all = hints(more);
            let suggests = |hint: &String| hint.contains("the slip that you expect");
            assert_eq!(
                all.iter().filter(|hint| suggests(hint)).count(),
                1,
                "{all:?}"
            );
        }
    }

    #[test]
    fn unknown_names_are_refused_everywhere_with_the_known_ones() {
        let found = faults(
            r#""boundary": "top","#,
            r#""boundary": "top", "bounce": 1,"#,
        );
        assert_eq!(
            (&found[0].0[..], found[0].1),
            ("/contacts/0/bounce", Reason::UnknownName)
        );
        assert!(found[0].2.contains("`indentation`"), "{}", found[0].2);
        for (from, to, pointer) in [
            (
                r#"{"kind": "plane_strain"}"#,
                r#"{"kind": "plane_strain", "thickness": 1}"#,
                "/analysis/thickness",
            ),
            (
                r#"{"kind": "flat"}"#,
                r#"{"kind": "flat", "radius": 1}"#,
                "/contacts/0/obstacle/radius",
            ),
            (
                r#""coefficient": 0.3"#,
                r#""coefficient": 0.3, "mu": 1"#,
                "/contacts/0/friction/mu",
            ),
        ] {
            let found = faults(from, to);
            assert_eq!(found.len(), 1, "{found:?}");
            assert_eq!(found[0].0, pointer);
        }
    }

    #[test]
    fn an_unknown_kind_is_reported_with_the_known_ones() {
        let found = faults(r#"{"kind": "flat"}"#, r#"{"kind": "sphere", "radius": 1}"#);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].0, "/contacts/0/obstacle/kind");
        assert!(
            found[0].2.contains("circle") && found[0].2.contains("parabola"),
            "{}",
            found[0].2
        );
        let found = faults(r#"{"kind": "flat"}"#, r#"{"from": 0}"#);
        assert_eq!(found[0].0, "/contacts/0/obstacle/kind");
        let found = faults(r#"{"kind": "plane_strain"}"#, r#""plane_strain""#);
        assert_eq!((found.len(), &found[0].0[..]), (1, "/analysis"));
        assert!(
            found[0].2.starts_with("an object with a `kind`"),
            "{}",
            found[0].2
        );
        let found = faults(r#"{"kind": "flat"}"#, r#"{"kind": "circle"}"#);
        assert_eq!(
            (found.len(), &found[0].0[..]),
            (1, "/contacts/0/obstacle/radius")
        );
    }

    #[test]
    fn alternatives_are_given_in_exactly_one_form() {
        let reported = |from: &str, to: &str| -> Vec<(String, Reason, String)> {
            assert!(GOOD.contains(from), "{from}");
            let mut list =
                parse(&GOOD.replacen(from, to, 1)).expect_err("a faulty problem was accepted");
            list.sort_by(|a, b| a.pointer.cmp(&b.pointer));
            list.into_iter()
                .map(|v| (v.pointer, v.reason, v.got))
                .collect()
        };
        let one =
            |pointer: &str, reason, got: &str| vec![(pointer.to_owned(), reason, got.to_owned())];
        let (grid, count) = (r#""grid": {"x": [0, 1], "y": [0, 1]}"#, Reason::WrongCount);
        assert_eq!(reported(grid, ""), one("/mesh", count, "none of them"));
        let both = format!(r#"{grid}, "stored": "sha256:0""#);
        assert_eq!(
            reported(grid, &both),
            one("/mesh", count, "`grid` and `stored`")
        );
        let expected = &faults(grid, "")[0].2;
        assert_eq!(
            expected,
            "exactly one of `grid`, `grids`, `inline`, `gmsh`, `abaqus`, `stored`"
        );

        let load = |load: &str| {
            reported(
                r#""materials""#,
                &format!(r#""loads": [{load}], "materials""#),
            )
        };
        assert_eq!(
            load(r#"{"boundary": "top"}"#),
            one("/loads/0", count, "none of them")
        );
        assert_eq!(
            load(r#"{"boundary": "top", "pressure": 1, "traction": [0, 1]}"#),
            one("/loads/0", count, "`pressure` and `traction`")
        );
        assert_eq!(
            load(r#"{"tangential": 1}"#),
            one("/loads/0/boundary", Reason::Missing, "nothing")
        );
        assert_eq!(
            load(r#"{"boundary": "top", "body_force": [0, 1]}"#),
            one("/loads/0/boundary", Reason::NotUsed, "\"top\"")
        );
        assert_eq!(
            load(r#"{"boundary": "top", "force": [0, 1]}"#),
            [
                one("/loads/0/boundary", Reason::NotUsed, "\"top\""),
                one("/loads/0/nodes", Reason::Missing, "nothing")
            ]
            .concat()
        );
        assert_eq!(
            reported(r#""youngs_modulus": 1000, "#, ""),
            one("/materials/0/youngs_modulus", Reason::Missing, "nothing")
        );
        let wood = r#""orthotropic": {"e1": 1, "e2": 1, "nu12": 0.3, "g12": 1}, "youngs_modulus""#;
        let found = reported(r#""youngs_modulus""#, wood);
        let places: Vec<_> = found.iter().map(|v| (&v.0[..], v.1)).collect();
        let excluded = ["/materials/0/poissons_ratio", "/materials/0/youngs_modulus"];
        assert_eq!(places, excluded.map(|place| (place, Reason::NotUsed)));
    }

    /// As many clients write what they leave out.
    #[test]
    fn null_counts_as_absent() {
        let isotropic = r#""youngs_modulus": 1000, "poissons_ratio": 0.3"#;
        let wood = r#""orthotropic": {"e1": 1, "e2": 1, "nu12": 0.3, "g12": 1}"#;
        let accepts = |from: &str, to: String| {
            assert!(GOOD.contains(from), "{from}");
            parse(&GOOD.replacen(from, &to, 1)).map(|_| ())
        };
        let nulls = format!(r#"{isotropic}, "orthotropic": null, "group": null"#);
        assert_eq!(accepts(isotropic, nulls), Ok(()));
        let nulls = format!(r#"{wood}, "youngs_modulus": null, "poissons_ratio": null"#);
        assert_eq!(accepts(isotropic, nulls), Ok(()));
        let load = r#"{"boundary": "top", "pressure": 1, "force": null, "nodes": null}"#;
        let loads = format!(r#""loads": [{load}], "materials""#);
        assert_eq!(accepts(r#""materials""#, loads), Ok(()));
        // what is needed is missing if it is null
        let missing = format!(r#"{isotropic}, "boundary": null"#).replace("1000", "null");
        assert!(accepts(isotropic, missing).is_err());
    }

    /// The schema and the types accept the same forms.
    #[test]
    fn the_schema_accepts_the_same_problems_as_the_types() {
        let names = [
            "boundary",
            "nodes",
            "pressure",
            "traction",
            "normal",
            "tangential",
            "nodal",
            "force",
            "body_force",
            "gravity",
            "rotation",
            "group",
            "temperature",
            "nodal_temperature",
        ];
        let value = |name: &str| match name {
            "boundary" | "nodes" | "group" => serde_json::json!("top"),
            "pressure" | "normal" | "tangential" | "temperature" | "nodal_temperature" => {
                serde_json::json!(1.0)
            }
            "nodal" => serde_json::json!([[0.0, 1.0]]),
            "rotation" => serde_json::json!({"angular_velocity": 1.0}),
            _ => serde_json::json!([0.0, 1.0]),
        };
        let subsets = |names: &[&str], value: &dyn Fn(&str) -> Value| -> Vec<Value> {
            let object = |bits: usize| {
                let chosen = names.iter().enumerate().filter(|(k, _)| bits >> k & 1 == 1);
                chosen
                    .map(|(_, name)| (name.to_string(), value(name)))
                    .collect()
            };
            (0..1 << names.len())
                .map(object)
                .map(Value::Object)
                .collect()
        };
        for load in subsets(&names, &value) {
            let read = serde_json::from_value::<solver::problem::Load>(load.clone());
            assert_eq!(accepts("Load", &load), read.is_ok(), "{load}");
            // and it is written as it was read
            if let Ok(read) = read {
                assert_eq!(serde_json::to_value(read).unwrap(), load);
            }
        }
        let wood = serde_json::json!({"e1": 1.0, "e2": 1.0, "nu12": 0.3, "g12": 1.0, "angle": 0.0});
        let constant = |name: &str| match name {
            "orthotropic" => wood.clone(),
            "group" | "name" => serde_json::json!("wood"),
            _ => serde_json::json!(0.25),
        };
        for material in subsets(
            &[
                "youngs_modulus",
                "poissons_ratio",
                "orthotropic",
                "group",
                "name",
            ],
            &constant,
        ) {
            let read = serde_json::from_value::<solver::problem::Material>(material.clone());
            assert_eq!(accepts("Material", &material), read.is_ok(), "{material}");
            if let Ok(read) = read {
                assert_eq!(serde_json::to_value(read).unwrap(), material);
            }
        }
        let source = |name: &str| match name {
            "grid" => serde_json::json!({"x": [0.0, 1.0], "y": [0.0, 1.0]}),
            "inline" => serde_json::json!({"nodes": [], "elements": [], "boundaries": {}}),
            "refine" => serde_json::json!(1),
            "boundaries" => serde_json::json!({"a": {"side": "top"}}),
            "curves" => serde_json::json!({"a": {"kind": "spline"}}),
            _ => serde_json::json!("text"),
        };
        for mesh in subsets(
            &[
                "grid",
                "inline",
                "gmsh",
                "abaqus",
                "stored",
                "refine",
                "boundaries",
                "curves",
            ],
            &source,
        ) {
            let read = serde_json::from_value::<solver::problem::MeshInput>(mesh.clone());
            assert_eq!(accepts("MeshInput", &mesh), read.is_ok(), "{mesh}");
            if let Ok(read) = read {
                let mut written = mesh.clone();
                written
                    .as_object_mut()
                    .unwrap()
                    .entry("refine")
                    .or_insert(serde_json::json!(0));
                assert_eq!(serde_json::to_value(read).unwrap(), written);
            }
        }
    }

    #[test]
    fn wrong_numbers_and_lists_are_described_in_words() {
        let expected = |from: &str, to: &str| faults(from, to).remove(0).2;
        assert_eq!(
            expected(r#""grid": {"x""#, r#""refine": -1, "grid": {"x""#),
            "a number of at least 0"
        );
        let support = r#""supports": [{"boundary": "top", "ux": [0, 1, 2]}], "materials""#;
        assert_eq!(expected(r#""materials""#, support), "2 items");
        let support = r#""supports": [{"boundary": "top", "ux": "5"}], "materials""#;
        assert_eq!(expected(r#""materials""#, support), "a number or a list");
    }

    #[test]
    fn invalid_json_and_numbers_beyond_double_precision_are_reported() {
        for text in ["{", "", " \n"] {
            assert_eq!(parse(text).unwrap_err()[0].reason, Reason::Malformed);
        }
        assert_eq!(faults("1000", "1e999")[0].1, Reason::Malformed);
    }

    #[test]
    fn faults_beyond_the_schema_have_their_pointer() {
        let found = faults(r#""grid": {"x""#, r#""refine": 1e3, "grid": {"x""#);
        assert_eq!(found[0].0, "/mesh/refine");
        let found = faults(
            r#""youngs_modulus": 1000"#,
            r#""youngs_modulus": 1000, "youngs_modulus": 2000"#,
        );
        assert_eq!(found.len(), 1);
    }

    #[test]
    fn a_misspelt_name_or_kind_is_answered_with_the_one_that_is_meant() {
        let hint = |from: &str, to: &str| {
            let list = parse(&GOOD.replacen(from, to, 1)).unwrap_err();
            list.into_iter().map(|v| v.hint).collect::<String>()
        };
        let found = hint("\"youngs_modulus\"", "\"young_modulus\"");
        assert!(found.contains("Did you mean `youngs_modulus`?"), "{found}");
        let found = hint("plane_strain", "plain_strain");
        assert!(found.contains("Did you mean `plane_strain`?"), "{found}");
        let solver = hint(
            r#""contacts""#,
            r#""solver": {"algorithm": "newtn"}, "contacts""#,
        );
        assert!(solver.contains("Did you mean `newton`?"), "{solver}");
    }

    #[test]
    fn an_element_has_six_or_eight_nodes() {
        let mesh = |nodes: &str| {
            let inline = format!(r#""inline": {{"nodes": [], "elements": [[{nodes}]]}}"#);
            faults(r#""grid": {"x": [0, 1], "y": [0, 1]}"#, &inline).remove(0)
        };
        for nodes in ["0,1,2,3", "0,1,2,3,4,5,6", "0,1,2,3,4,5,6,7,8"] {
            let (pointer, reason, expected) = mesh(nodes);
            assert_eq!(pointer, "/mesh/inline/elements/0");
            assert_eq!(
                (reason, &expected[..]),
                (Reason::WrongLength, "6 or 8 items")
            );
        }
    }

    #[test]
    fn a_text_is_refused_where_it_is_nested_too_deeply() {
        let nested = |depth: usize| format!("{}{}", "[".repeat(depth), "]".repeat(depth));
        assert_eq!(too_deep(&nested(MOST_NESTED)), None);
        let place = too_deep(&format!("{{\n \"[[\\\"[\": {}", nested(100_000))).unwrap();
        assert_eq!(place, "more than 64 open brackets at line 2 column 74");
        for text in [nested(65), "{\"a\":".repeat(1 << 20), "[".repeat(1 << 20)] {
            let list = parse(&text).unwrap_err();
            assert_eq!((list.len(), list[0].reason), (1, Reason::Malformed));
            assert!(list[0].got.contains("open brackets"), "{}", list[0].got);
        }
    }

    #[test]
    fn a_check_ends_after_a_hundred_violations_and_says_that_there_are_more() {
        let with = |items: &str| GOOD.replacen("[0, 1], \"y\"", &format!("[{items}], \"y\""), 1);
        let list = parse(&with(&["[]"; 100].join(","))).unwrap_err();
        assert_eq!(list.len(), 100);
        assert!(!list[99].hint.contains("more"), "{}", list[99].hint);
        let list = parse(&with(&["[]"; 1 << 20].join(","))).unwrap_err();
        assert_eq!(
            (list.len(), &list[99].pointer[..]),
            (100, "/mesh/grid/x/99")
        );
        assert!(list[99].hint.contains("There are more violations"));
    }

    #[test]
    fn lists_that_take_much_more_memory_than_text_are_bounded() {
        let first = |more: String| {
            let list = parse(&GOOD.replacen("\"contacts\"", &(more + ", \"contacts\""), 1));
            list.unwrap_err().remove(0)
        };
        let many = |item: &str, count: usize| vec![item; count].join(",");
        let steps = first(format!("\"steps\": [{}]", many("{}", (1 << 14) + 1)));
        assert_eq!(
            (&steps.pointer[..], steps.reason),
            ("/steps", Reason::TooMany)
        );
        assert!(steps.expected.contains("16384"), "{}", steps.expected);
        let points = many("0", (1 << 17) + 1);
        let table = format!(r#"{{"kind": "table", "x": [{points}], "gap": []}}"#);
        let list = parse(&GOOD.replace(r#"{"kind": "flat"}"#, &table)).unwrap_err();
        assert_eq!(list[0].pointer, "/contacts/0/obstacle/x");
        let lines = many("0", (1 << 20) + 1);
        let grid = GOOD.replacen("[0, 1], \"y\"", &format!("[{lines}], \"y\""), 1);
        assert_eq!(parse(&grid).unwrap_err()[0].pointer, "/mesh/grid/x");
        let lines = many("0", 1 << 18);
        assert!(parse(&GOOD.replacen("[0, 1], \"y\"", &format!("[{lines}], \"y\""), 1)).is_ok());
    }

    #[test]
    fn a_name_that_occurs_twice_is_a_violation_at_its_place() {
        let twice =
            r#""inline": {"nodes": [], "elements": [], "boundaries": {"a": [], "b": [], "a": []}}"#;
        let found = faults(r#""grid": {"x": [0, 1], "y": [0, 1]}"#, twice);
        let place = ("/mesh/inline/boundaries/a", Reason::DuplicateName);
        assert_eq!((&found[0].0[..], found[0].1), place);
        let found = faults(
            "\"youngs_modulus\": 1000",
            "\"youngs_modulus\": 1000, \"youngs_modulus\": 1000",
        );
        assert_eq!(found[0].0, "/materials/0/youngs_modulus");
    }

    #[test]
    fn a_huge_name_or_text_is_quoted_by_its_beginning() {
        let long = "n".repeat(1 << 20);
        for (from, to) in [
            ("\"youngs_modulus\"", format!("\"{long}\"")),
            ("plane_strain", long.clone()),
            ("1000", format!("\"{long}\"")),
        ] {
            let list = parse(&GOOD.replacen(from, &to, 1)).unwrap_err();
            let size =
                |v: &Violation| v.pointer.len() + v.got.len() + v.expected.len() + v.hint.len();
            assert!(list.iter().all(|v| size(v) < 1000));
            let told = |v: &Violation| v.got.contains("1048576 ") || v.got.contains("1048578 ");
            assert!(list.iter().any(told), "{list:?}");
        }
    }

    #[test]
    fn a_malformed_text_is_placed_by_its_line_and_column() {
        for (from, to) in [
            ("1000", "1e999"),
            ("\"top\"", "\"\\ud800\""),
            ("0.3}]", "NaN}]"),
        ] {
            let list = parse(&GOOD.replacen(from, to, 1)).unwrap_err();
            assert_eq!((list.len(), list[0].reason), (1, Reason::Malformed));
            let line = 1 + GOOD[..GOOD.find(from).unwrap()].matches('\n').count();
            assert!(
                list[0].got.contains(&format!("line {line} ")),
                "{}",
                list[0].got
            );
        }
    }
}
