//! Bodies that carry a problem: an envelope of ours around a text for the solver's own parser.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde_json::value::RawValue;
use solver::{
    error::{Violation, escape},
    problem::Problem,
};

use crate::{
    error::ApiError,
    job::{Cache, Limits},
    store::Edit,
    verbs::{
        problems::{AT, prefixed},
        submit::{Draft, Envelope, MOST_JOBS},
    },
    violations::{self, Violations},
};

/// A body that hands in a job; for its schema only, since it is read by hand: what is wrong with the
/// problem comes together with what is wrong around it.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(super) struct Submission {
    /// What to solve.
    problem: Problem,
    /// A name for people, at most 256 characters.
    #[schemars(default, length(max = 256))]
    name: Option<String>,
    /// Labels for programs, at most 64.
    #[schemars(default, extend("maxProperties" = 64))]
    labels: Option<BTreeMap<Label, Label>>,
    /// Higher first; absent: 0.
    #[schemars(default, range(min = -10, max = 10))]
    priority: Option<i32>,
    /// What it may take.
    #[schemars(default)]
    limits: Option<Limits>,
    /// Whether an earlier result may answer it; absent: use.
    #[schemars(default)]
    cache: Option<Cache>,
}

/// A body with many of them; for its schema only.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(super) struct Submissions {
    /// All or none of them are accepted.
    #[schemars(length(min = 1, max = 1000))]
    jobs: Vec<Submission>,
}

/// A body that changes a job: what is absent stays; for its schema only.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(super) struct Edits {
    /// A name for people, at most 256 characters; null takes it away.
    #[schemars(default, length(max = 256))]
    name: Option<String>,
    /// All labels that it shall have, at most 64.
    #[schemars(default, extend("maxProperties" = 64))]
    labels: Option<BTreeMap<Label, Label>>,
    /// Higher first.
    #[schemars(default, range(min = -10, max = 10))]
    priority: Option<i32>,
    /// Never removed by age.
    #[schemars(default)]
    pinned: Option<bool>,
}

/// Key or value of a label.
#[derive(JsonSchema, PartialEq, Eq, PartialOrd, Ord)]
#[schemars(inline)]
#[allow(dead_code)]
struct Label(#[schemars(length(max = 256))] String);

/// A body with a problem and nothing else; for its schema only.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(super) struct BareProblem {
    /// What to check.
    problem: Problem,
}

/// What is wrong with a body whose JSON is well formed, or what it holds.
type Read<T> = Result<T, Vec<Violation>>;

/// A body `{problem, name, labels, priority, limits, cache}`. The problem's text goes to the solver's own
/// strict parser; what is wrong with it comes together with what is wrong around it.
pub(super) fn submission(text: &str) -> Result<Draft, ApiError> {
    let mut fields = object(text, "an object with the field problem")?;
    if let Some(violation) = unwrapped(&fields) {
        return Ok((Envelope::default(), Err(vec![violation])));
    }
    let mut violations = Violations::default();
    let mut envelope = Envelope::default();
    let problem = problem(&mut fields, &mut violations);
    take(
        &mut fields,
        "name",
        "a string",
        &mut violations,
        &mut envelope.name,
    );
    take(
        &mut fields,
        "labels",
        "an object of strings",
        &mut violations,
        &mut envelope.labels,
    );
    take(
        &mut fields,
        "priority",
        "a whole number from -10 to 10",
        &mut violations,
        &mut envelope.priority,
    );
    let limits = "an object {timeout_s, queue_ttl_s} of numbers";
    take(
        &mut fields,
        "limits",
        limits,
        &mut violations,
        &mut envelope.limits,
    );
    let cache = "use, refresh or off";
    take(
        &mut fields,
        "cache",
        cache,
        &mut violations,
        &mut envelope.cache,
    );
    let known = "problem, name, labels, priority, limits, cache";
    unknown(fields, known, &mut violations);
    Ok((envelope, together(violations, problem)))
}

/// A body `{jobs: […]}`, each as a submission of its own.
pub(super) fn batch(text: &str) -> Result<Read<Vec<Draft>>, ApiError> {
    let mut fields = object(text, "an object with the field jobs")?;
    let mut violations = Violations::default();
    let mut texts: Vec<&RawValue> = vec![];
    match fields.remove("jobs") {
        Some(raw) => match serde_json::from_str(raw.get()) {
            Ok(jobs) => texts = jobs,
            Err(_) => violations.add(wrong_type("/jobs", raw, "an array of submissions")),
        },
        None => violations.add(Violation {
            pointer: "/jobs".into(),
            reason: "missing".into(),
            got: "nothing".into(),
            expected: "1 … 1000 submissions".into(),
            hint: "Send {\"jobs\": [{\"problem\": {…}}, …]}.".into(),
        }),
    }
    unknown(fields, "jobs", &mut violations);
    let mut drafts = vec![];
    // one more than there may be: the verb says that they are too many
    for (n, text) in texts.iter().take(MOST_JOBS + 1).enumerate() {
        let at = format!("/jobs/{n}");
        match submission(text.get()) {
            Ok((envelope, problem)) => {
                if let Err(found) = &problem {
                    violations.extend(prefixed(&at, found.clone()));
                }
                drafts.push((envelope, problem));
            }
            Err(ApiError::InvalidProblem(found)) => violations.extend(prefixed(&at, found)),
            Err(other) => return Err(other),
        }
    }
    Ok(if violations.is_empty() {
        Ok(drafts)
    } else {
        Err(violations.into_vec())
    })
}

/// A body `{name, labels, priority, pinned}`: what is absent stays, and a name of null is taken away.
pub(super) fn edit(text: &str) -> Result<Edit, ApiError> {
    let mut fields = object(text, "an object with what to change")?;
    let mut violations = Violations::default();
    let mut edit = Edit::default();
    if fields.get("name").is_some_and(|raw| raw.get() == "null") {
        fields.remove("name");
        edit.name = Some(None);
    }
    let mut name: Option<String> = None;
    take(
        &mut fields,
        "name",
        "a string or null",
        &mut violations,
        &mut name,
    );
    if name.is_some() {
        edit.name = Some(name);
    }
    let labels = "an object of strings";
    take(
        &mut fields,
        "labels",
        labels,
        &mut violations,
        &mut edit.labels,
    );
    let priority = "a whole number from -10 to 10";
    take(
        &mut fields,
        "priority",
        priority,
        &mut violations,
        &mut edit.priority,
    );
    take(
        &mut fields,
        "pinned",
        "true or false",
        &mut violations,
        &mut edit.pinned,
    );
    unknown(fields, "name, labels, priority, pinned", &mut violations);
    if violations.is_empty() {
        Ok(edit)
    } else {
        Err(ApiError::InvalidProblem(violations.into_vec()))
    }
}

/// A body `{problem}`.
pub(super) fn bare_problem(text: &str) -> Result<Read<Problem>, ApiError> {
    let mut fields = object(text, "an object with the field problem")?;
    if let Some(violation) = unwrapped(&fields) {
        return Ok(Err(vec![violation]));
    }
    let mut violations = Violations::default();
    let problem = problem(&mut fields, &mut violations);
    unknown(fields, "problem", &mut violations);
    Ok(together(violations, problem))
}

fn object<'a>(text: &'a str, expected: &str) -> Result<BTreeMap<String, &'a RawValue>, ApiError> {
    // First only the syntax, so that a well-formed array is told that it should be an object.
    let whole: &RawValue =
        serde_json::from_str(text).map_err(|error| ApiError::MalformedJson(error.to_string()))?;
    serde_json::from_str(whole.get())
        .map_err(|_| ApiError::InvalidProblem(vec![wrong_type("", whole, expected)]))
}

/// The problem itself where an envelope around it was expected: to call each of its names unknown
/// would not help.
fn unwrapped(fields: &BTreeMap<String, &RawValue>) -> Option<Violation> {
    let has = |name: &str| fields.contains_key(name);
    (!has("problem") && (has("analysis") || has("mesh"))).then(|| Violation {
        pointer: AT.into(),
        reason: "missing".into(),
        got: "the bare problem".into(),
        expected: "an object with the field problem".into(),
        hint: "Wrap it as {\"problem\": …}.".into(),
    })
}

fn problem(
    fields: &mut BTreeMap<String, &RawValue>,
    violations: &mut Violations,
) -> Option<Problem> {
    match fields.remove("problem") {
        Some(raw) => match solver::parse(raw.get()) {
            Ok(problem) => return Some(problem),
            Err(found) => violations.extend(prefixed(AT, found)),
        },
        None => violations.add(Violation {
            pointer: AT.into(),
            reason: "missing".into(),
            got: "nothing".into(),
            expected: "the problem to solve".into(),
            hint: "Send {\"problem\": {…}}.".into(),
        }),
    }
    None
}

/// Reads one field into its place; null is as good as absent.
fn take<T: serde::de::DeserializeOwned>(
    fields: &mut BTreeMap<String, &RawValue>,
    name: &str,
    expected: &str,
    violations: &mut Violations,
    place: &mut T,
) {
    let Some(raw) = fields.remove(name).filter(|raw| raw.get() != "null") else {
        return;
    };
    match serde_json::from_str(raw.get()) {
        Ok(value) => *place = value,
        Err(_) => violations.add(wrong_type(&format!("/{name}"), raw, expected)),
    }
}

fn unknown(fields: BTreeMap<String, &RawValue>, known: &str, violations: &mut Violations) {
    // One more than are listed: the list shall say that there are more.
    for name in fields.into_keys().take(violations::MOST + 1) {
        let name = violations::name(&name);
        violations.add(Violation {
            pointer: format!("/{}", escape(&name)),
            reason: "unknown_name".into(),
            got: format!("{name:?}"),
            expected: format!("one of {known}"),
            hint: "Check the spelling, or leave it out.".into(),
        });
    }
}

fn wrong_type(pointer: &str, raw: &RawValue, expected: &str) -> Violation {
    let got: String = raw.get().chars().take(60).collect();
    Violation {
        pointer: pointer.into(),
        reason: "wrong_type".into(),
        got,
        expected: expected.into(),
        hint: "See /v1/schema/problem.json for the problem itself.".into(),
    }
}

fn together(violations: Violations, problem: Option<Problem>) -> Read<Problem> {
    match problem {
        Some(problem) if violations.is_empty() => Ok(problem),
        _ => Err(violations.into_vec()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn pointers(text: &str) -> Vec<String> {
        submission(text)
            .unwrap()
            .1
            .unwrap_err()
            .into_iter()
            .map(|v| v.pointer)
            .collect()
    }

    /// What a body may have, by what it is told that has something else.
    fn known(told: Vec<Violation>) -> Vec<String> {
        let unknown = told.iter().find(|v| v.reason == "unknown_name").unwrap();
        let names = unknown.expected.strip_prefix("one of ").unwrap();
        names.split(", ").map(str::to_owned).collect()
    }

    fn described<T: JsonSchema>() -> Vec<String> {
        let schema = schemars::schema_for!(T);
        let fields = schema.get("properties").unwrap().as_object().unwrap();
        fields.keys().cloned().collect()
    }

    #[test]
    fn what_is_described_of_a_body_is_what_is_read() {
        const OTHER: &str = r#"{"other": 1}"#;
        let ApiError::InvalidProblem(edits) = edit(OTHER).unwrap_err() else {
            unreachable!("it is well-formed");
        };
        for (told, mut described) in [
            (
                submission(OTHER).unwrap().1.unwrap_err(),
                described::<Submission>(),
            ),
            (
                batch(OTHER).unwrap().unwrap_err(),
                described::<Submissions>(),
            ),
            (
                bare_problem(OTHER).unwrap().unwrap_err(),
                described::<BareProblem>(),
            ),
            (edits, described::<Edits>()),
        ] {
            let mut known = known(told);
            known.sort();
            described.sort();
            assert_eq!(known, described);
        }
    }

    #[test]
    fn everything_wrong_with_an_envelope_is_said_at_once() {
        let text = r#"{"name": 7, "labels": {"a": 1}, "priority": 0.5, "wait": 3}"#;
        assert_eq!(
            pointers(text),
            ["/problem", "/name", "/labels", "/priority", "/wait"]
        );
    }

    #[test]
    fn a_bare_problem_is_told_once_to_be_wrapped() {
        let text = serde_json::to_string(&crate::fake::problem()).unwrap();
        let by_both = [
            submission(&text).unwrap().1.unwrap_err(),
            bare_problem(&text).unwrap().unwrap_err(),
        ];
        for violations in by_both {
            assert_eq!(violations.len(), 1, "{violations:?}");
            assert!(violations[0].hint.contains(r#"{"problem": …}"#));
        }
    }

    #[test]
    fn a_thousand_unknown_names_are_a_hundred_violations_and_a_long_one_is_cut() {
        let names: Vec<String> = (0..1000).map(|n| format!("\"n{n}\": 1")).collect();
        let text = format!("{{\"problem\": {{}}, {}}}", names.join(", "));
        assert_eq!(pointers(&text).len(), 100);
        let text = format!("{{\"problem\": {{}}, \"{}\": 1}}", "x".repeat(1 << 20));
        let violations = submission(&text).unwrap().1.unwrap_err();
        let longest = violations.iter().map(|v| v.pointer.len().max(v.got.len()));
        assert!(longest.max() < Some(100));
    }

    #[test]
    fn broken_json_is_told_apart_from_a_wrong_shape() {
        assert!(matches!(
            submission("{\"problem\": "),
            Err(ApiError::MalformedJson(_))
        ));
        assert!(matches!(
            submission("[1]"),
            Err(ApiError::InvalidProblem(_))
        ));
    }
}
