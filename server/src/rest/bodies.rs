//! Bodies of requests in JSON: their schemas, and reading them with all errors reported together. A problem inside is
//! read by the parser of `files`.
//!
//! A body is kept whole until it is read (16 MiB by default), since the problem may stand before what is said about it, and
//! violations quote their places. Larger meshes are uploaded.

use std::collections::{BTreeMap, BTreeSet};

use files::sweep::{MOST_MEMBERS, MOST_PATHS};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Value;
use solver::{
    error::{Reason, Violation},
    problem::Problem,
};

use super::object::{First, Object, Read, Texts};
use crate::{
    caller::{MAX_OWNER, Scope},
    error::ApiError,
    job::{Cache, Limits, MAX_PRIORITY, MIN_PRIORITY},
    parameters::Values,
    store::Edit,
    verbs::{
        envelope::{Envelope, JobRequest, MAX_LABEL, MAX_LABELS, MAX_NAME, PRIORITIES},
        jobs::LabelChanges,
        retry::Changes,
        submit::MAX_BATCH,
        sweeps::SweepRequest,
        tokens::{self, TokenRequest},
    },
    violations::{PROBLEM, prefixed},
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
    #[schemars(default, length(max = MAX_NAME))]
    name: Option<String>,
    /// Labels for programs, at most 64.
    #[schemars(default, extend("maxProperties" = MAX_LABELS))]
    labels: Option<BTreeMap<Label, Label>>,
    /// Jobs of higher priority run first; absent: 0.
    #[schemars(default, range(min = MIN_PRIORITY, max = MAX_PRIORITY))]
    priority: Option<i32>,
    /// Time limits.
    #[schemars(default)]
    limits: Option<Limits>,
    /// Whether the result of an earlier job with the same input may be used; absent: use.
    #[schemars(default)]
    cache: Option<Cache>,
}

/// A body that submits many jobs; for its schema only.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(super) struct Submissions {
    /// The jobs; all or none of them are accepted.
    #[schemars(length(min = 1, max = MAX_BATCH))]
    jobs: Vec<Submission>,
}

/// A body that submits a sweep; for its schema only.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(super) struct SweepSubmission {
    /// The problem that members differ from. It must be valid itself.
    base: Problem,
    /// What members differ in, with the modes grid and zip.
    #[schemars(default, length(min = 1, max = MOST_PATHS))]
    axes: Option<Vec<Axis>>,
    /// How the values of several axes are combined; absent: grid.
    #[schemars(default)]
    mode: Option<SweepMode>,
    /// With the mode list: the values of each member by JSON Pointer; what a point leaves out is as in the base.
    #[schemars(default, length(min = 1, max = MOST_MEMBERS))]
    points: Option<Vec<BTreeMap<String, Value>>>,
    /// A name for people, at most 256 characters.
    #[schemars(default, length(max = MAX_NAME))]
    name: Option<String>,
    /// Labels for programs, at most 64.
    #[schemars(default, extend("maxProperties" = MAX_LABELS))]
    labels: Option<BTreeMap<Label, Label>>,
    /// Its jobs run before those of lower priority; absent: 0.
    #[schemars(default, range(min = MIN_PRIORITY, max = MAX_PRIORITY))]
    priority: Option<i32>,
    /// Time limits of each of its jobs; absent: 600 s to solve the first member and 6 s for each further one of the job,
    /// at most a week.
    #[schemars(default)]
    limits: Option<Limits>,
}

/// How the values of several axes are combined.
#[derive(JsonSchema)]
#[schemars(rename_all = "snake_case")]
#[allow(dead_code)]
enum SweepMode {
    /// Every value of each axis with every value of the others; the last axis changes fastest.
    Grid,
    /// The first values of all axes, then the second ones, and so on.
    Zip,
    /// As listed in `points`.
    List,
}

/// A value of the problem that members differ in, and its values in one form.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
struct Axis {
    /// JSON Pointer (RFC 6901) into the problem, such as /contacts/0/friction/coefficient. The object around it must be in
    /// the base.
    path: String,
    /// Any values of the schema of a problem there: numbers, or a whole obstacle or list of steps.
    #[schemars(default, length(min = 1, max = MOST_MEMBERS))]
    values: Option<Vec<Value>>,
    /// Numbers at equal distances.
    #[schemars(default)]
    linspace: Option<Spaced>,
    /// Numbers at equal ratios, both ends above 0.
    #[schemars(default)]
    logspace: Option<Spaced>,
}

/// Numbers from start to stop, both among them.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
struct Spaced {
    /// The first.
    start: f64,
    /// The last.
    stop: f64,
    /// How many.
    #[schemars(range(min = 1, max = MOST_MEMBERS))]
    count: u64,
}

/// A body that changes a job: absent fields stay unchanged; for its schema only.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(super) struct Edits {
    /// A name for people, at most 256 characters; null removes it.
    #[schemars(default, length(max = MAX_NAME))]
    name: Option<String>,
    /// The new labels, all of them, at most 64: they replace the old ones; null removes them.
    #[schemars(default, extend("maxProperties" = MAX_LABELS))]
    labels: Option<BTreeMap<Label, Label>>,
    /// Jobs of higher priority run first.
    #[schemars(default, range(min = MIN_PRIORITY, max = MAX_PRIORITY))]
    priority: Option<i32>,
    /// Never deleted because of its age; it can still be deleted on request.
    #[schemars(default)]
    pinned: Option<bool>,
}

/// A body that changes a job, as a merge patch (RFC 7396): absent fields and labels stay unchanged; for its schema only.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(super) struct MergePatch {
    /// A name for people, at most 256 characters; null removes it.
    #[schemars(default, length(max = MAX_NAME))]
    name: Option<String>,
    /// Labels that are set, or removed by null; null for all of them removes all.
    #[schemars(default, extend("maxProperties" = 2 * MAX_LABELS))]
    labels: Option<BTreeMap<Label, Option<Label>>>,
    /// Jobs of higher priority run first; null is 0.
    #[schemars(default, range(min = MIN_PRIORITY, max = MAX_PRIORITY))]
    priority: Option<i32>,
    /// Never deleted because of its age; null is false.
    #[schemars(default)]
    pinned: Option<bool>,
}

/// A body that changes the new job of a retry: absent fields stay unchanged; for its schema only.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(super) struct Retry {
    /// Time limits; absent ones stay unchanged.
    #[schemars(default)]
    limits: Option<NewLimits>,
    /// Jobs of higher priority run first.
    #[schemars(default, range(min = MIN_PRIORITY, max = MAX_PRIORITY))]
    priority: Option<i32>,
}

/// Time limits that are changed.
#[derive(Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct NewLimits {
    /// Seconds from a start to the end.
    timeout_s: Option<f64>,
    /// Seconds that the job may wait in the queue.
    queue_ttl_s: Option<f64>,
}

/// Key or value of a label.
#[derive(JsonSchema, PartialEq, Eq, PartialOrd, Ord)]
#[schemars(inline)]
#[allow(dead_code)]
struct Label(#[schemars(length(max = MAX_LABEL))] String);

/// A body that makes a token; for its schema only.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(super) struct TokenFields {
    /// For people: where it is used.
    #[schemars(length(min = 1, max = tokens::MAX_NAME))]
    name: String,
    /// The owner of the jobs that it submits: letters, digits and . _ @ + -
    #[schemars(length(min = 1, max = MAX_OWNER), regex(pattern = r"^[A-Za-z0-9._@+-]+$"))]
    owner: String,
    /// What it allows; the first token of a service must have admin.
    #[schemars(length(min = 1))]
    scopes: BTreeSet<Scope>,
    /// Seconds until it expires; absent: it does not expire.
    #[schemars(default, range(min = tokens::MIN_EXPIRES_IN_S, max = tokens::MAX_EXPIRES_IN_S))]
    expires_in_s: Option<f64>,
}

/// A body with a problem and nothing else; for its schema only.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(super) struct BareProblem {
    /// What to check.
    problem: Problem,
}

/// A body `{problem, name, labels, priority, limits, cache}`. The problem's text is read by `files::parse`, which is
/// strict; its violations are reported together with those of the other fields.
pub(super) fn submission(text: &str) -> Result<JobRequest, ApiError> {
    let mut body = Object::open(text, "an object with the field problem")?;
    if let Some(violation) = missing_envelope(&body) {
        return Ok(JobRequest {
            envelope: Envelope::default(),
            problem: Err(vec![violation]),
        });
    }
    let problem = problem(&mut body);
    let envelope = Envelope {
        name: body.take("name", "a string"),
        labels: labels(&mut body, LABELS).unwrap_or_default(),
        priority: body
            .take("priority", &PRIORITIES.expected())
            .unwrap_or_default(),
        limits: body.take_object("limits", LIMITS).unwrap_or_default(),
        cache: body
            .take("cache", "use, refresh or off")
            .unwrap_or_default(),
    };
    let known = "problem, name, labels, priority, limits, cache";
    Ok(JobRequest {
        envelope,
        problem: body.finish(known, problem),
    })
}

/// A body `{jobs: […]}`, each as a submission of its own.
pub(super) fn batch(text: &str) -> Result<Read<Vec<JobRequest>>, ApiError> {
    let mut body = Object::open(text, "an object with the field jobs")?;
    let some = format!("1 … {MAX_BATCH} submissions");
    let hint = "Send {\"jobs\": [{\"problem\": {…}}, …]}.";
    let texts = body.require("jobs", &some, hint).and_then(|raw| {
        // one more than allowed: the verb reports the excess
        let texts = serde_json::from_str::<First<{ MAX_BATCH + 1 }>>(raw.get()).ok();
        if texts.is_none() {
            body.wrong_type("jobs", raw, "an array of submissions");
        }
        texts
    });
    let texts = texts.map_or(vec![], |First(texts)| texts);
    let mut requests = vec![];
    let mut unchecked = None;
    for (n, text) in texts.iter().enumerate() {
        if body.violations.is_full() {
            unchecked = Some(n);
            break;
        }
        let at = format!("/jobs/{n}");
        match submission(text.get()) {
            Ok(request) => match &request.problem {
                Ok(_) => requests.push(request),
                Err(_) => {
                    let found = request.problem.err().unwrap_or_default();
                    body.violations.extend(prefixed(&at, found));
                }
            },
            Err(ApiError::InvalidProblem(found)) => body.violations.extend(prefixed(&at, found)),
            Err(other) => return Err(other),
        }
    }
    let mut read = body.finish("jobs", Some(requests));
    if let (Some(n), Err(found)) = (unchecked, &mut read)
        && let Some(last) = found.last_mut()
    {
        last.hint
            .push_str(&format!(" (The jobs from /jobs/{n} on were not checked.)"));
    }
    Ok(read)
}

/// A body `{base, axes, mode, points, name, labels, priority, limits}`.
pub(super) fn sweep(text: &str) -> Result<SweepRequest, ApiError> {
    let mut body = Object::open(text, "an object with the fields base and axes")?;
    let fields = files::sweep::Fields {
        base: body.take_raw("base"),
        axes: body.take_raw("axes"),
        mode: body.take_raw("mode"),
        points: body.take_raw("points"),
    };
    let limits: Option<Limits> = body.take_object("limits", LIMITS);
    let envelope = Envelope {
        name: body.take("name", "a string"),
        labels: labels(&mut body, LABELS).unwrap_or_default(),
        priority: body
            .take("priority", &PRIORITIES.expected())
            .unwrap_or_default(),
        limits: limits.unwrap_or_default(),
        cache: Cache::Off,
    };
    let definition = files::sweep::read(&fields);
    let definition = definition
        .map_err(|found| body.violations.extend(found))
        .ok();
    let known = "base, axes, mode, points, name, labels, priority, limits";
    Ok(SweepRequest {
        envelope,
        limits,
        definition: body.finish(known, definition),
    })
}

/// A body `{name, labels, priority, pinned}`: absent fields stay unchanged; null removes a name or labels.
pub(super) fn edit(text: &str) -> Result<Edit, ApiError> {
    let mut body = Object::open(text, "an object with what to change")?;
    let (unnamed, unlabeled) = (body.is_null("name"), body.is_null("labels"));
    let name: Option<String> = body.take("name", "a string or null");
    let labels = labels(&mut body, "an object of strings, or null");
    let edit = Edit {
        name: (unnamed || name.is_some()).then_some(name),
        labels: labels.or(unlabeled.then(BTreeMap::new)),
        priority: body.take("priority", &PRIORITIES.expected()),
        pinned: body.take("pinned", "true or false"),
    };
    let known = "name, labels, priority, pinned";
    body.finish(known, Some(edit))
        .map_err(ApiError::InvalidProblem)
}

/// The same as a merge patch (RFC 7396): labels that are absent stay, and null removes what it stands for, or resets it.
pub(super) fn merge_patch(text: &str) -> Result<(Edit, LabelChanges), ApiError> {
    let mut body = Object::open(text, "an object with what to change")?;
    let resets = |name: &str| body.is_null(name);
    let (unnamed, unlabeled) = (resets("name"), resets("labels"));
    let (ordinary, unpinned) = (resets("priority"), resets("pinned"));
    let name: Option<String> = body.take("name", "a string or null");
    // twice as many as there may be: all old ones removed, and all set anew
    let labels = body.take::<Texts<{ 2 * MAX_LABELS + 1 }, Option<String>>>(
        "labels",
        "an object of strings and nulls, or null",
    );
    let priority: Option<i32> = body.take("priority", &PRIORITIES.expected());
    let pinned: Option<bool> = body.take("pinned", "true, false or null");
    let edit = Edit {
        name: (unnamed || name.is_some()).then_some(name),
        labels: unlabeled.then(BTreeMap::new),
        priority: priority.or(ordinary.then_some(0)),
        pinned: pinned.or(unpinned.then_some(false)),
    };
    let changes = labels.map_or(LabelChanges::new(), |labels| labels.0);
    let known = "name, labels, priority, pinned";
    body.finish(known, Some((edit, changes)))
        .map_err(ApiError::InvalidProblem)
}

/// A body `{limits, priority}`: absent fields stay unchanged.
pub(super) fn retry(text: &str) -> Result<Changes, ApiError> {
    let mut body = Object::open(text, "an object with what to change")?;
    let NewLimits {
        timeout_s,
        queue_ttl_s,
    } = body.take_object("limits", LIMITS).unwrap_or_default();
    let changes = Changes {
        timeout_s,
        queue_ttl_s,
        priority: body.take("priority", &PRIORITIES.expected()),
    };
    let changes = body.finish("limits, priority", Some(changes));
    changes.map_err(ApiError::InvalidProblem)
}

/// A body `{name, owner, scopes, expires_in_s}`. What is missing is empty, which the verb refuses.
pub(super) fn token(text: &str) -> Result<TokenRequest, ApiError> {
    let mut body = Object::open(text, "an object with name, owner and scopes")?;
    let scopes = body.take::<Vec<String>>("scopes", "a list of read, submit, cancel and admin");
    let request = TokenRequest {
        name: body.take("name", "a string").unwrap_or_default(),
        owner: body.take("owner", "a string").unwrap_or_default(),
        scopes: scopes.unwrap_or_default(),
        expires_in_s: body.take("expires_in_s", "a number of seconds"),
    };
    let known = "name, owner, scopes, expires_in_s";
    body.finish(known, Some(request))
        .map_err(ApiError::InvalidProblem)
}

/// A body `{problem}`.
pub(super) fn bare_problem(text: &str) -> Result<Read<Problem>, ApiError> {
    let mut body = Object::open(text, "an object with the field problem")?;
    if let Some(violation) = missing_envelope(&body) {
        return Ok(Err(vec![violation]));
    }
    let problem = problem(&mut body);
    Ok(body.finish("problem", problem))
}

/// The violation of a body that is the problem itself instead of an object with the field `problem`: one, not one
/// for each field of the problem.
fn missing_envelope(body: &Object<'_>) -> Option<Violation> {
    let bare = body.has("analysis") || body.has("mesh");
    (bare && !body.has("problem")).then(|| Violation {
        pointer: PROBLEM.into(),
        reason: Reason::Missing,
        got: "the bare problem".into(),
        expected: "an object with the field problem".into(),
        hint: "Wrap it as {\"problem\": …}.".into(),
    })
}

/// The field `problem`.
fn problem(body: &mut Object<'_>) -> Option<Problem> {
    let hint = "Send {\"problem\": {…}}.";
    let raw = body.require("problem", "the problem to solve", hint)?;
    let problem = files::parse(raw.get());
    problem
        .map_err(|found| body.violations.extend(prefixed(PROBLEM, found)))
        .ok()
}

/// The field `labels`, with one more than allowed: the verb reports the excess.
fn labels(body: &mut Object<'_>, expected: &str) -> Option<BTreeMap<String, String>> {
    let labels = body.take::<Texts<{ MAX_LABELS + 1 }>>("labels", expected)?;
    Some(labels.0)
}

const LABELS: &str = "an object of strings";
const LIMITS: &str = "an object of timeout_s and queue_ttl_s, each a number, and nothing else";

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

    /// The fields that a body may have, taken from the violation that reports an unknown one.
    fn known(found: Vec<Violation>) -> Vec<String> {
        let unknown = |v: &&Violation| v.reason == Reason::UnknownName;
        let unknown = found.iter().find(unknown).unwrap();
        let names = unknown.expected.strip_prefix("one of ").unwrap();
        names.split(", ").map(str::to_owned).collect()
    }

    fn described<T: JsonSchema>() -> Vec<String> {
        let schema = schemars::schema_for!(T);
        let fields = schema.get("properties").unwrap().as_object().unwrap();
        fields.keys().cloned().collect()
    }

    #[test]
    fn the_described_fields_of_a_body_are_those_that_are_read() {
        const OTHER: &str = r#"{"other": 1}"#;
        let ApiError::InvalidProblem(edits) = edit(OTHER).unwrap_err() else {
            unreachable!("it is well-formed");
        };
        let ApiError::InvalidProblem(patched) = merge_patch(OTHER).unwrap_err() else {
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
                sweep(OTHER).unwrap().definition.unwrap_err(),
                described::<SweepSubmission>(),
            ),
            (
                bare_problem(OTHER).unwrap().unwrap_err(),
                described::<BareProblem>(),
            ),
            (edits, described::<Edits>()),
            (patched, described::<MergePatch>()),
            (changes, described::<Retry>()),
        ] {
            let mut known = known(found);
            known.sort();
            described.sort();
            assert_eq!(known, described);
        }
    }

    #[test]
    fn all_violations_of_an_envelope_are_reported_together() {
        let limits = retry(r#"{"limits": [null, null]}"#).err();
        assert!(
            matches!(limits, Some(ApiError::InvalidProblem(found)) if found[0].pointer == "/limits")
        );
        let found = pointers(r#"{"problem": {}, "limits": [1, 2]}"#);
        assert!(
            found.iter().any(|pointer| pointer == "/limits"),
            "{found:?}"
        );
        let text = r#"{"name": 7, "labels": {"a": 1}, "priority": 0.5, "wait": 3}"#;
        assert_eq!(
            pointers(text),
            ["/problem", "/name", "/labels", "/priority", "/wait"]
        );
    }

    #[test]
    fn a_merge_patch_removes_and_resets_by_null() {
        let (edit, labels) = merge_patch(r#"{"labels": {"a": null, "b": "2"}}"#).unwrap();
        assert!(edit.name.is_none() && edit.labels.is_none() && edit.pinned.is_none());
        assert_eq!(
            labels,
            [("a".into(), None), ("b".into(), Some("2".into()))].into()
        );
        let nulls = r#"{"name": null, "labels": null, "priority": null, "pinned": null}"#;
        let (edit, labels) = merge_patch(nulls).unwrap();
        assert_eq!(
            (edit.name, edit.priority, edit.pinned),
            (Some(None), Some(0), Some(false))
        );
        assert!(edit.labels.is_some_and(|all| all.is_empty()) && labels.is_empty());
        assert!(merge_patch(r#"{"labels": {"a": {}}}"#).is_err());
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
    fn at_most_a_hundred_unknown_names_are_reported_and_long_ones_are_truncated() {
        let names: Vec<String> = (0..1000).map(|n| format!("\"n{n}\": 1")).collect();
        let text = format!("{{\"problem\": {{}}, {}}}", names.join(", "));
        assert_eq!(pointers(&text).len(), 100);
        let text = format!("{{\"problem\": {{}}, \"{}\": 1}}", "x".repeat(1 << 20));
        let violations = submission(&text).unwrap().problem.unwrap_err();
        let longest = violations.iter().map(|v| v.pointer.len().max(v.got.len()));
        assert!(longest.max() < Some(120));
        let long = violations.iter().find(|v| v.pointer.starts_with("/xxx"));
        assert!(long.unwrap().got.ends_with("… (1048576 characters)\""));
    }

    #[test]
    fn malformed_json_is_distinguished_from_a_wrong_type() {
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
