//! Bodies of requests in JSON: their schemas, and reading them with all errors reported together. A problem inside is
//! read by the parser of `files`.

use std::{collections::BTreeMap, fmt};

use schemars::JsonSchema;
use serde::{
    Deserialize, Deserializer,
    de::{DeserializeOwned, MapAccess, Visitor},
};
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
        envelope::{Envelope, JobRequest},
        retry::Changes,
        submit::MAX_BATCH,
    },
    violations::{self, AT, Violations, prefixed},
};

/// A body that submits a job; for its schema only, since it is read by hand: the errors of the
/// problem are reported together with those around it.
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
    /// Jobs of higher priority run first; absent: 0.
    #[schemars(default, range(min = -10, max = 10))]
    priority: Option<i32>,
    /// Time limits.
    #[schemars(default)]
    limits: Option<Limits>,
    /// Whether the result of an earlier job with the same input may be used; absent: use.
    #[schemars(default)]
    cache: Option<Cache>,
}

/// A body with many of them; for its schema only.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(super) struct Submissions {
    /// The jobs; all or none of them are accepted.
    #[schemars(length(min = 1, max = 1000))]
    jobs: Vec<Submission>,
}

/// A body that changes a job: what is absent stays; for its schema only.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(super) struct Edits {
    /// A name for people, at most 256 characters; null removes it.
    #[schemars(default, length(max = 256))]
    name: Option<String>,
    /// The new labels, all of them, at most 64: they replace the old ones; null removes them.
    #[schemars(default, extend("maxProperties" = 64))]
    labels: Option<BTreeMap<Label, Label>>,
    /// Jobs of higher priority run first.
    #[schemars(default, range(min = -10, max = 10))]
    priority: Option<i32>,
    /// Kept whatever its age; it can still be deleted on request.
    #[schemars(default)]
    pinned: Option<bool>,
}

/// A body that changes the new job of a retry: what is absent stays; for its schema only.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(super) struct Retry {
    /// Time limits; those that are absent stay.
    #[schemars(default)]
    limits: Option<NewLimits>,
    /// Jobs of higher priority run first.
    #[schemars(default, range(min = -10, max = 10))]
    priority: Option<i32>,
}

/// Time limits that are changed.
#[derive(Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct NewLimits {
    /// Seconds from a start to the end.
    timeout_s: Option<f64>,
    /// Seconds that it may wait in the queue.
    queue_ttl_s: Option<f64>,
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

/// The content of a body whose JSON is well formed, or its violations.
type Read<T> = Result<T, Vec<Violation>>;

/// A body `{problem, name, labels, priority, limits, cache}`. The problem's text goes to the solver's own
/// strict parser; what is wrong with it comes together with what is wrong around it.
pub(super) fn submission(text: &str) -> Result<JobRequest, ApiError> {
    let mut body = Body::open(text, "an object with the field problem")?;
    if let Some(violation) = body.unwrapped() {
        return Ok(JobRequest {
            envelope: Envelope::default(),
            problem: Err(vec![violation]),
        });
    }
    let problem = body.problem();
    let envelope = Envelope {
        name: body.take("name", "a string"),
        labels: body.take("labels", LABELS).unwrap_or_default(),
        priority: body.take("priority", PRIORITY).unwrap_or_default(),
        limits: body.take("limits", LIMITS).unwrap_or_default(),
        cache: body
            .take("cache", "use, refresh or off")
            .unwrap_or_default(),
    };
    let known = "problem, name, labels, priority, limits, cache";
    Ok(JobRequest {
        envelope,
        problem: body.close(known, problem),
    })
}

/// A body `{jobs: […]}`, each as a submission of its own.
pub(super) fn batch(text: &str) -> Result<Read<Vec<JobRequest>>, ApiError> {
    let mut body = Body::open(text, "an object with the field jobs")?;
    let some = "1 … 1000 submissions";
    let hint = "Send {\"jobs\": [{\"problem\": {…}}, …]}.";
    let texts = body.require("jobs", some, hint).and_then(|raw| {
        let texts = serde_json::from_str::<Vec<&RawValue>>(raw.get()).ok();
        if texts.is_none() {
            body.wrong_type("jobs", raw, "an array of submissions");
        }
        texts
    });
    let mut requests = vec![];
    // one more than allowed: the verb reports that they are too many
    for (n, text) in texts.iter().flatten().take(MAX_BATCH + 1).enumerate() {
        let at = format!("/jobs/{n}");
        match submission(text.get()) {
            Ok(request) => {
                if let Err(found) = &request.problem {
                    body.violations.extend(prefixed(&at, found.clone()));
                }
                requests.push(request);
            }
            Err(ApiError::InvalidProblem(found)) => body.violations.extend(prefixed(&at, found)),
            Err(other) => return Err(other),
        }
    }
    Ok(body.close("jobs", Some(requests)))
}

/// A body `{name, labels, priority, pinned}`: what is absent stays, and a name or labels of null are taken away.
pub(super) fn edit(text: &str) -> Result<Edit, ApiError> {
    let mut body = Body::open(text, "an object with what to change")?;
    let nulls = |name| body.fields.get(name).is_some_and(|raw| is_null(raw));
    let (unnamed, unlabeled) = (nulls("name"), nulls("labels"));
    let name: Option<String> = body.take("name", "a string or null");
    let labels = body.take("labels", "an object of strings, or null");
    let edit = Edit {
        name: (unnamed || name.is_some()).then_some(name),
        labels: labels.or(unlabeled.then(BTreeMap::new)),
        priority: body.take("priority", PRIORITY),
        pinned: body.take("pinned", "true or false"),
    };
    let known = "name, labels, priority, pinned";
    body.close(known, Some(edit))
        .map_err(ApiError::InvalidProblem)
}

/// A body `{limits, priority}`: what is absent stays.
pub(super) fn retry(text: &str) -> Result<Changes, ApiError> {
    let mut body = Body::open(text, "an object with what to change")?;
    let NewLimits {
        timeout_s,
        queue_ttl_s,
    } = body.take("limits", LIMITS).unwrap_or_default();
    let changes = Changes {
        timeout_s,
        queue_ttl_s,
        priority: body.take("priority", PRIORITY),
    };
    let changes = body.close("limits, priority", Some(changes));
    changes.map_err(ApiError::InvalidProblem)
}

/// A body `{problem}`.
pub(super) fn bare_problem(text: &str) -> Result<Read<Problem>, ApiError> {
    let mut body = Body::open(text, "an object with the field problem")?;
    if let Some(violation) = body.unwrapped() {
        return Ok(Err(vec![violation]));
    }
    let problem = body.problem();
    Ok(body.close("problem", problem))
}

const LABELS: &str = "an object of strings";
const PRIORITY: &str = "a whole number from -10 to 10";
const LIMITS: &str = "an object of timeout_s and queue_ttl_s, each a number, and nothing else";

/// An object whose fields are taken out one by one; all violations are reported at the end.
struct Body<'a> {
    fields: BTreeMap<String, &'a RawValue>,
    violations: Violations,
}

impl<'a> Body<'a> {
    fn open(text: &'a str, expected: &str) -> Result<Self, ApiError> {
        if text.trim().is_empty() {
            let nothing = format!("the body is empty; expected {expected}");
            return Err(ApiError::MalformedJson(nothing));
        }
        // First only the syntax, so that a well-formed array is reported as the wrong type.
        let whole: &RawValue = serde_json::from_str(text)
            .map_err(|error| ApiError::MalformedJson(error.to_string()))?;
        let Pairs(pairs) = serde_json::from_str(whole.get())
            .map_err(|_| ApiError::InvalidProblem(vec![wrong_type("", whole, expected)]))?;
        let mut violations = Violations::default();
        let mut fields = BTreeMap::new();
        for (name, value) in pairs {
            if fields.insert(name.clone(), value).is_some() {
                violations.add(Violation {
                    pointer: format!("/{}", escape(&violations::name(&name))),
                    reason: "duplicate_name".into(),
                    got: "the name twice".into(),
                    expected: "each name once".into(),
                    hint: "Leave one of them out; one would be ignored.".into(),
                });
            }
        }
        Ok(Body { fields, violations })
    }

    /// The problem itself where an envelope around it was expected: one violation says so, instead of one for each
    /// of its names.
    fn unwrapped(&self) -> Option<Violation> {
        let has = |name: &str| self.fields.contains_key(name);
        (!has("problem") && (has("analysis") || has("mesh"))).then(|| Violation {
            pointer: AT.into(),
            reason: "missing".into(),
            got: "the bare problem".into(),
            expected: "an object with the field problem".into(),
            hint: "Wrap it as {\"problem\": …}.".into(),
        })
    }

    /// The field `problem`.
    fn problem(&mut self) -> Option<Problem> {
        let raw = self.require(
            "problem",
            "the problem to solve",
            "Send {\"problem\": {…}}.",
        )?;
        let problem = files::parse(raw.get());
        problem
            .map_err(|found| self.violations.extend(prefixed(AT, found)))
            .ok()
    }

    /// A field that must be there.
    fn require(&mut self, name: &str, expected: &str, hint: &str) -> Option<&'a RawValue> {
        let found = self.fields.remove(name);
        if found.is_none() {
            self.violations.add(Violation {
                pointer: format!("/{name}"),
                reason: "missing".into(),
                got: "nothing".into(),
                expected: expected.into(),
                hint: hint.into(),
            });
        }
        found
    }

    /// An optional field; null means absent.
    fn take<T: DeserializeOwned>(&mut self, name: &str, expected: &str) -> Option<T> {
        let raw = self.fields.remove(name).filter(|raw| !is_null(raw))?;
        let value = serde_json::from_str(raw.get());
        value.map_err(|_| self.wrong_type(name, raw, expected)).ok()
    }

    fn wrong_type(&mut self, name: &str, raw: &RawValue, expected: &str) {
        self.violations
            .add(wrong_type(&format!("/{name}"), raw, expected));
    }

    /// What was read, if there are no violations and no unknown fields left.
    fn close<T>(mut self, known: &str, read: Option<T>) -> Read<T> {
        // One more than are listed, so that the list says that there are more.
        for name in self.fields.into_keys().take(violations::MOST + 1) {
            let name = violations::name(&name);
            self.violations.add(Violation {
                pointer: format!("/{}", escape(&name)),
                reason: "unknown_name".into(),
                got: format!("{name:?}"),
                expected: format!("one of {known}"),
                hint: "Check the spelling, or leave it out.".into(),
            });
        }
        match read {
            Some(read) if self.violations.is_empty() => Ok(read),
            _ => Err(self.violations.into_vec()),
        }
    }
}

/// The members of an object in their order. A map would silently keep only the last one of a name.
struct Pairs<'a>(Vec<(String, &'a RawValue)>);

impl<'de> Deserialize<'de> for Pairs<'de> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Members;
        impl<'de> Visitor<'de> for Members {
            type Value = Pairs<'de>;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut pairs = vec![];
                while let Some(pair) = map.next_entry()? {
                    pairs.push(pair);
                }
                Ok(Pairs(pairs))
            }
        }
        deserializer.deserialize_map(Members)
    }
}

fn is_null(raw: &RawValue) -> bool {
    raw.get() == "null"
}

fn wrong_type(pointer: &str, raw: &RawValue, expected: &str) -> Violation {
    Violation {
        pointer: pointer.into(),
        reason: "wrong_type".into(),
        got: violations::name(raw.get()),
        expected: expected.into(),
        hint: "The bodies of all requests are described in /openapi.json.".into(),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn pointers(text: &str) -> Vec<String> {
        submission(text)
            .unwrap()
            .problem
            .unwrap_err()
            .into_iter()
            .map(|v| v.pointer)
            .collect()
    }

    /// What a body may have, by the violation that reports an unknown name.
    fn known(found: Vec<Violation>) -> Vec<String> {
        let unknown = found.iter().find(|v| v.reason == "unknown_name").unwrap();
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
        let ApiError::InvalidProblem(changes) = retry(OTHER).unwrap_err() else {
            unreachable!("it is well-formed");
        };
        for (found, mut described) in [
            (
                submission(OTHER).unwrap().problem.unwrap_err(),
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
            (changes, described::<Retry>()),
        ] {
            let mut known = known(found);
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
    fn a_bare_problem_is_one_violation() {
        let text = serde_json::to_string(&crate::fake::problem()).unwrap();
        let by_both = [
            submission(&text).unwrap().problem.unwrap_err(),
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
        let violations = submission(&text).unwrap().problem.unwrap_err();
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
