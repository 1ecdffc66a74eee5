//! Problems from JSON: strict, and with every structural fault named at once.
//!
//! serde is the judge; it stops at the first fault, and inside an enum it forgets where it was. So
//! when it refuses a text, our own JSON Schema is asked for all the reasons.

use std::sync::LazyLock;

use jsonschema::error::{TypeKind, ValidationErrorKind};
use jsonschema::{ValidationError, Validator};
use serde_json::Value;

use solver::error::{Findings, Reason, Violation, either, escape, shortened};
use solver::problem::Problem;

/// The JSON Schema of a problem (draft 2020-12).
pub fn schema() -> Value {
    schemars::schema_for!(Problem).to_value()
}

static SCHEMA: LazyLock<Value> = LazyLock::new(schema);

static VALIDATOR: LazyLock<Option<Validator>> =
    LazyLock::new(|| jsonschema::validator_for(&SCHEMA).ok());

/// Reads a problem, or says everything that is wrong with its structure. Pointers are relative to
/// the problem.
pub fn parse(text: &str) -> Result<Problem, Vec<Violation>> {
    serde_json::from_str(text).map_err(|first| explain(text, &first))
}

fn explain(text: &str, first: &serde_json::Error) -> Vec<Violation> {
    if text.trim().is_empty() {
        return vec![Violation::new(
            "",
            Reason::Malformed,
            "an empty text",
            "a problem as JSON",
            "An example is in the README.",
        )];
    }
    let value: Value = match serde_json::from_str(text) {
        Ok(value) => value,
        Err(error) => {
            return vec![Violation::new(
                "",
                Reason::Malformed,
                error,
                "a JSON document (RFC 8259), numbers within double precision",
                "Check the text at that line and column.",
            )];
        }
    };
    let mut found = Findings::default();
    if let Some(validator) = &*VALIDATOR {
        let mut errors = validator.iter_errors(&value);
        while !found.is_full()
            && let Some(error) = errors.next()
        {
            gather(&error, &mut found);
        }
        found.count(errors.count());
    }
    match found.into_violations() {
        list if list.is_empty() => vec![beyond_the_schema(text, first)],
        list => list,
    }
}

/// A fault that the schema cannot express, such as a repeated name or a number out of its type.
fn beyond_the_schema(text: &str, first: &serde_json::Error) -> Violation {
    let mut reader = serde_json::Deserializer::from_str(text);
    let path = serde_path_to_error::deserialize::<_, Problem>(&mut reader).err();
    Violation::new(
        path.map_or_else(String::new, |error| pointer_of(error.path())),
        Reason::Malformed,
        first,
        "a value as the schema describes it",
        "See /v1/schema/problem.json.",
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

/// One schema error as one violation or more.
fn gather(error: &ValidationError<'_>, found: &mut Findings) {
    let pointer = error.instance_path().as_str();
    let got = || quoted(error.instance());
    found.add(match error.kind() {
        ValidationErrorKind::AdditionalProperties { unexpected } => {
            let expected = match known_names(error) {
                known if known.is_empty() => "a name that the schema has".to_owned(),
                known => format!("one of {}", known.join(", ")),
            };
            let unknown = |name: &String| {
                Violation::new(
                    format!("{pointer}/{:.80}", escape(name)),
                    Reason::UnknownName,
                    format!("`{name:.80}`"),
                    &expected,
                    "Check the spelling; names that mean nothing here are refused.",
                )
            };
            return found.extend(unexpected.iter().map(unknown));
        }
        ValidationErrorKind::AnyOf { context }
        | ValidationErrorKind::OneOfNotValid { context }
        | ValidationErrorKind::OneOfMultipleValid { context } => {
            return match forms(error) {
                Some(forms) => one_form(error, context, &forms, found),
                None => alternatives(error, context, found),
            };
        }
        ValidationErrorKind::FalseSchema => Violation::new(
            pointer,
            Reason::NotUsed,
            got(),
            "nothing: it does not go with what stands beside it",
            "Leave it out, or choose another form.",
        ),
        ValidationErrorKind::Required { property } => {
            let name = property.as_str().unwrap_or_default();
            Violation::new(
                format!("{pointer}/{name}"),
                Reason::Missing,
                "nothing",
                format!("a value for `{name}`"),
                "It has no default.",
            )
        }
        ValidationErrorKind::Minimum { limit } => Violation::new(
            pointer,
            Reason::OutOfRange,
            got(),
            format!("a number of at least {limit}"),
            "Correct the number.",
        ),
        ValidationErrorKind::MinItems { limit } | ValidationErrorKind::MaxItems { limit } => {
            let items = error.instance().as_array().map_or(0, Vec::len);
            Violation::new(
                pointer,
                Reason::WrongLength,
                format!("{items} item(s)"),
                format!("{limit} items"),
                "Correct the list.",
            )
        }
        ValidationErrorKind::Type { kind } => Violation::new(
            pointer,
            Reason::WrongType,
            got(),
            type_names(kind),
            "Write the value in that form.",
        ),
        _ => Violation::new(
            pointer,
            Reason::Malformed,
            got(),
            error.to_string(),
            "See /v1/schema/problem.json.",
        ),
    });
}

/// The names that make up each form of an object, where its schema tells forms apart by what they require:
/// those that no other form requires.
fn forms(error: &ValidationError<'_>) -> Option<Vec<Vec<&'static str>>> {
    let branches = SCHEMA.pointer(error.schema_path().as_str())?.as_array()?;
    let required: Vec<Vec<&str>> = branches
        .iter()
        .map(|branch| match branch.get("type") {
            None => required(branch),
            Some(_) => Vec::new(),
        })
        .collect();
    let own = |(i, names): (usize, &Vec<&'static str>)| {
        let others = || required.iter().enumerate().filter(|(j, _)| *j != i);
        let alone = |name: &&&str| !others().any(|(_, other)| other.contains(name));
        names.iter().filter(alone).copied().collect()
    };
    let own: Vec<Vec<&str>> = required.iter().enumerate().map(own).collect();
    own.iter().all(|names| !names.is_empty()).then_some(own)
}

/// What a branch of the schema requires, all of it or one of several.
fn required(branch: &'static Value) -> Vec<&'static str> {
    let list = |branch: &'static Value, name: &str| {
        let list = branch.get(name).and_then(Value::as_array);
        list.into_iter().flatten()
    };
    let either = list(branch, "anyOf").flat_map(required);
    let all = list(branch, "required").filter_map(Value::as_str);
    all.chain(either).collect()
}

/// Of several forms one was meant, and has errors; or it must be said that it is exactly one.
fn one_form(
    error: &ValidationError<'_>,
    branches: &[Vec<ValidationError<'static>>],
    forms: &[Vec<&str>],
    found: &mut Findings,
) {
    let instance = error.instance();
    let given = |name: &str| instance.get(name).is_some_and(|value| !value.is_null());
    let all: Vec<_> = forms.iter().zip(branches).collect();
    let meant: Vec<_> = all
        .iter()
        .filter(|(form, _)| form.iter().any(|name| given(name)))
        .collect();
    if let [(_, errors)] = meant[..] {
        return errors.iter().for_each(|error| gather(error, found));
    }
    let names = forms.iter().flatten();
    let got: Vec<(&str, bool)> = names.map(|name| (*name, given(name))).collect();
    let form = |names: &Vec<&str>| {
        let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
        names.join(" and ")
    };
    let offers: Vec<String> = forms.iter().map(form).collect();
    found.add(Violation::new(
        error.instance_path().as_str(),
        Reason::WrongCount,
        either(&got),
        format!("exactly one of {}", offers.join(", ")),
        "Choose one of the forms.",
    ));
}

/// The branch that was meant, judged by its `kind` and its type; or, when none was, what all offer.
fn alternatives(
    error: &ValidationError<'_>,
    branches: &[Vec<ValidationError<'static>>],
    found: &mut Findings,
) {
    let pointer = error.instance_path().as_str();
    let kind = format!("{pointer}/kind");
    let excludes = |e: &ValidationError<'_>| {
        let place = e.instance_path().as_str();
        match e.kind() {
            ValidationErrorKind::Type { .. } => place == pointer,
            ValidationErrorKind::Constant { .. } | ValidationErrorKind::Enum { .. } => {
                place == pointer || place == kind
            }
            ValidationErrorKind::Required { property } => place == pointer && property == "kind",
            _ => false,
        }
    };
    let meant: Vec<_> = branches
        .iter()
        .filter(|errors| !errors.iter().any(excludes))
        .collect();
    if let [errors] = meant[..] {
        return errors.iter().for_each(|error| gather(error, found));
    }
    let mut offers = Vec::new();
    let mut tagged = false;
    for e in branches.iter().flatten() {
        match e.kind() {
            ValidationErrorKind::Constant { expected_value } => {
                tagged |= e.instance_path().as_str() == kind;
                offers.push(expected_value.to_string());
            }
            ValidationErrorKind::Enum { options } => offers.push(options.to_string()),
            ValidationErrorKind::Type { kind } if e.instance_path().as_str() == pointer => {
                offers.push(type_names(kind))
            }
            ValidationErrorKind::Required { property } if property == "kind" => tagged = true,
            _ => {}
        }
    }
    offers.dedup();
    offers.retain(|offer| offer != "null");
    let instance = error.instance();
    let (place, got) = match instance.get("kind") {
        Some(found) if tagged => (kind, quoted(found)),
        None if tagged && instance.is_object() => (kind, "nothing".to_owned()),
        _ => (pointer.to_owned(), quoted(instance)),
    };
    let kinds = kinds(error);
    let (expected, hint) = if kinds.is_empty() {
        (
            offers.join(" or "),
            "Write the value in one of these forms.".to_owned(),
        )
    } else if instance.is_object() {
        (
            format!("one of {}", kinds.join(", ")),
            "Choose one of the kinds.".to_owned(),
        )
    } else {
        let example = format!("Write it as {{\"kind\": {}, …}}.", kinds[0]);
        (
            format!("an object with a `kind`, one of {}", kinds.join(", ")),
            example,
        )
    };
    let reason = Reason::UnknownAlternative;
    found.add(Violation::new(place, reason, got, expected, hint));
}

/// The `kind`s that the schema offers where `error` stands.
fn kinds(error: &ValidationError<'_>) -> Vec<String> {
    let branches = SCHEMA.pointer(error.schema_path().as_str());
    let branches = branches.and_then(Value::as_array).into_iter().flatten();
    branches
        .filter_map(|b| b.pointer("/properties/kind/const").map(Value::to_string))
        .collect()
}

/// The names that the schema has where an unknown one was found.
fn known_names(error: &ValidationError<'_>) -> Vec<String> {
    let path = error.schema_path().as_str();
    let object = path
        .strip_suffix("/additionalProperties")
        .and_then(|parent| SCHEMA.pointer(parent));
    let properties = object
        .and_then(|o| o.get("properties"))
        .and_then(Value::as_object);
    properties
        .into_iter()
        .flat_map(|p| p.keys().map(|name| format!("`{name}`")))
        .collect()
}

fn type_names(kind: &TypeKind) -> String {
    match kind {
        TypeKind::Single(one) => one.to_string(),
        TypeKind::Multiple(many) => {
            let names: Vec<String> = many
                .iter()
                .map(|t| t.to_string())
                .filter(|name| name != "null")
                .collect();
            names.join(" or ")
        }
    }
}

/// A value as text, cut where it would fill the page.
fn quoted(value: &Value) -> String {
    shortened(&value.to_string(), 80)
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn every_structural_fault_is_named_with_its_pointer() {
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
    fn a_wrong_kind_is_answered_with_those_that_exist() {
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
    fn what_has_several_forms_is_given_in_exactly_one() {
        let said = |from: &str, to: &str| -> Vec<(String, Reason, String)> {
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
        assert_eq!(said(grid, ""), one("/mesh", count, "none of them"));
        let both = format!(r#"{grid}, "stored": "sha256:0""#);
        assert_eq!(
            said(grid, &both),
            one("/mesh", count, "`grid` and `stored`")
        );
        let expected = &faults(grid, "")[0].2;
        assert_eq!(
            expected,
            "exactly one of `grid`, `inline`, `gmsh`, `abaqus`, `stored`"
        );

        let load = |load: &str| {
            said(
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
            said(r#""youngs_modulus": 1000, "#, ""),
            one("/materials/0/youngs_modulus", Reason::Missing, "nothing")
        );
        let wood = r#""orthotropic": {"e1": 1, "e2": 1, "nu12": 0.3, "g12": 1}, "youngs_modulus""#;
        let found = said(r#""youngs_modulus""#, wood);
        let places: Vec<_> = found.iter().map(|v| (&v.0[..], v.1)).collect();
        let excluded = ["/materials/0/poissons_ratio", "/materials/0/youngs_modulus"];
        assert_eq!(places, excluded.map(|place| (place, Reason::NotUsed)));
    }

    /// What the schema says of forms and what the types accept is the same.
    #[test]
    fn the_schema_refuses_what_is_refused_and_accepts_what_is_accepted() {
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
        ];
        let value = |name: &str| match name {
            "boundary" | "nodes" => serde_json::json!("top"),
            "pressure" | "normal" | "tangential" => serde_json::json!(1.0),
            "nodal" => serde_json::json!([[0.0, 1.0]]),
            _ => serde_json::json!([0.0, 1.0]),
        };
        let validator = |definition: &str| {
            let mut schema = SCHEMA.clone();
            let root = serde_json::json!({"$ref": format!("#/$defs/{definition}"), "$defs": schema["$defs"].take()});
            jsonschema::validator_for(&root).unwrap()
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
        let loads = validator("Load");
        for load in subsets(&names, &value) {
            let read = serde_json::from_value::<solver::problem::Load>(load.clone());
            assert_eq!(loads.is_valid(&load), read.is_ok(), "{load}");
            // and what was read is written as it was
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
        let materials = validator("Material");
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
            assert_eq!(materials.is_valid(&material), read.is_ok(), "{material}");
            if let Ok(read) = read {
                assert_eq!(serde_json::to_value(read).unwrap(), material);
            }
        }
        let source = |name: &str| match name {
            "grid" => serde_json::json!({"x": [0.0, 1.0], "y": [0.0, 1.0]}),
            "inline" => serde_json::json!({"nodes": [], "elements": [], "boundaries": {}}),
            "refine" => serde_json::json!(1),
            "boundaries" => serde_json::json!({"a": {"side": "top"}}),
            _ => serde_json::json!("text"),
        };
        let meshes = validator("MeshInput");
        for mesh in subsets(
            &[
                "grid",
                "inline",
                "gmsh",
                "abaqus",
                "stored",
                "refine",
                "boundaries",
            ],
            &source,
        ) {
            let read = serde_json::from_value::<solver::problem::MeshInput>(mesh.clone());
            assert_eq!(meshes.is_valid(&mesh), read.is_ok(), "{mesh}");
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
    fn numbers_and_lists_out_of_shape_are_said_in_words() {
        let expected = |from: &str, to: &str| faults(from, to).remove(0).2;
        assert_eq!(
            expected(r#""grid": {"x""#, r#""refine": -1, "grid": {"x""#),
            "a number of at least 0"
        );
        let support = r#""supports": [{"boundary": "top", "ux": [0, 1, 2]}], "materials""#;
        assert_eq!(expected(r#""materials""#, support), "2 items");
        let support = r#""supports": [{"boundary": "top", "ux": "5"}], "materials""#;
        assert_eq!(expected(r#""materials""#, support), "number or array");
    }

    #[test]
    fn text_that_is_no_json_and_numbers_beyond_double_precision_are_named() {
        for text in ["{", "", " \n"] {
            assert_eq!(parse(text).unwrap_err()[0].reason, Reason::Malformed);
        }
        assert_eq!(faults("1000", "1e999")[0].1, Reason::Malformed);
    }

    #[test]
    fn what_the_schema_cannot_express_still_has_its_place() {
        let found = faults(r#""grid": {"x""#, r#""refine": 1e3, "grid": {"x""#);
        assert_eq!(found[0].0, "/mesh/refine");
        let found = faults(
            r#""youngs_modulus": 1000"#,
            r#""youngs_modulus": 1000, "youngs_modulus": 2000"#,
        );
        assert_eq!(found.len(), 1);
    }
}
