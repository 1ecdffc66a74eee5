//! Bodies of requests in JSON. Each kind of body is a type. Every body is checked against the schema of its type, with
//! all violations at once, before serde reads it (`files::body`). Limits such as the length of a name are checked by
//! the operation, which also checks them for requests over gRPC.
//!
//! A body is kept in memory as a whole until it is read (16 MiB by default), since the problem may stand before the
//! fields that concern it, and violations quote their places. Larger meshes are uploaded.

use std::collections::BTreeMap;

use base::{
    caller::MAX_OWNER,
    job::{Cache, Limits, MAX_PRIORITY, MIN_PRIORITY},
};
use files::{
    body::{Body, Content, Embedded},
    sweep::{self, Axis, MOST_MEMBERS, MOST_PATHS, Points, Variation},
};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, de::DeserializeOwned};
use serde_json::value::RawValue;
use service::{
    error::ApiError,
    verbs::{
        envelope::{Envelope, JobRequest, MAX_LABEL, MAX_LABELS, MAX_NAME},
        jobs::LabelChanges,
        retry::Changes,
        submit::MAX_BATCH,
        sweeps::SweepRequest,
        tokens::{self, TokenRequest},
    },
};
use solver::{error::Violation, problem::Problem};
use store::Edit;

/// The body of a request that submits a job.
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(super) struct Submission {
    /// The problem to solve.
    #[serde(rename = "problem")]
    _problem: Embedded,
    /// A name for people, at most 256 characters.
    #[serde(default)]
    #[schemars(length(max = MAX_NAME))]
    name: Option<String>,
    /// Labels for programs, at most 64.
    #[serde(default)]
    #[schemars(extend("maxProperties" = MAX_LABELS))]
    labels: Option<Labels>,
    /// Jobs of higher priority run first; absent: 0.
    #[serde(default)]
    #[schemars(range(min = MIN_PRIORITY, max = MAX_PRIORITY))]
    priority: Option<i32>,
    /// Time limits.
    #[serde(default)]
    limits: Option<Limits>,
    /// Whether the result of an earlier job with the same input may be used; absent: use.
    #[serde(default)]
    cache: Option<Cache>,
}

/// The body of a request that submits many jobs.
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(super) struct Submissions {
    /// The jobs; all or none of them are accepted.
    #[schemars(length(min = 1, max = MAX_BATCH))]
    jobs: Vec<Submission>,
}

/// The body of a request that submits a sweep.
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(super) struct SweepSubmission {
    /// The problem from which the members differ. It must be valid itself.
    #[serde(rename = "base")]
    _base: Embedded,
    /// The values in which the members differ, with the modes grid and zip.
    #[serde(default)]
    #[schemars(length(min = 1, max = MOST_PATHS))]
    axes: Option<Vec<Axis>>,
    /// How the values of several axes are combined; absent: grid.
    #[serde(default)]
    mode: Option<sweep::Mode>,
    /// With the mode list: the values of each member by JSON Pointer; values that a point leaves out are those of the
    /// base.
    #[serde(default)]
    #[schemars(with = "Option<Points>", length(min = 1, max = MOST_MEMBERS))]
    points: Option<Vec<Box<RawValue>>>,
    /// A name for people, at most 256 characters.
    #[serde(default)]
    #[schemars(length(max = MAX_NAME))]
    name: Option<String>,
    /// Labels for programs, at most 64.
    #[serde(default)]
    #[schemars(extend("maxProperties" = MAX_LABELS))]
    labels: Option<Labels>,
    /// The jobs of the sweep run before jobs of lower priority; absent: 0.
    #[serde(default)]
    #[schemars(range(min = MIN_PRIORITY, max = MAX_PRIORITY))]
    priority: Option<i32>,
    /// Time limits of each job of the sweep; absent: 600 s to solve the first member of the job and 6 s for each
    /// further one, at most a week.
    #[serde(default)]
    limits: Option<Limits>,
}

/// The body of a request that changes a job: absent fields stay unchanged.
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(super) struct Edits {
    /// A name for people, at most 256 characters; null removes it.
    #[serde(default, deserialize_with = "given")]
    #[schemars(length(max = MAX_NAME))]
    name: Option<Option<String>>,
    /// All labels of the job, at most 64: they replace the old labels; null removes all labels.
    #[serde(default, deserialize_with = "given")]
    #[schemars(extend("maxProperties" = MAX_LABELS))]
    labels: Option<Option<Labels>>,
    /// Jobs of higher priority run first.
    #[serde(default)]
    #[schemars(range(min = MIN_PRIORITY, max = MAX_PRIORITY))]
    priority: Option<i32>,
    /// Whether the job is kept whatever its age; it can still be deleted on request.
    #[serde(default)]
    pinned: Option<bool>,
}

/// The body of a request that changes a job, as a merge patch (RFC 7396): absent fields and labels stay unchanged.
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(super) struct MergePatch {
    /// A name for people, at most 256 characters; null removes it.
    #[serde(default, deserialize_with = "given")]
    #[schemars(length(max = MAX_NAME))]
    name: Option<Option<String>>,
    /// Labels to be set, or removed if their value is null; null in place of all labels removes all.
    #[serde(default, deserialize_with = "given")]
    #[schemars(extend("maxProperties" = 2 * MAX_LABELS))]
    labels: Option<Option<BTreeMap<Label, Option<Label>>>>,
    /// Jobs of higher priority run first; null is 0.
    #[serde(default, deserialize_with = "given")]
    #[schemars(range(min = MIN_PRIORITY, max = MAX_PRIORITY))]
    priority: Option<Option<i32>>,
    /// Whether the job is kept whatever its age; null is false.
    #[serde(default, deserialize_with = "given")]
    pinned: Option<Option<bool>>,
}

/// The body of a request for a retry, with changes for the new job: absent fields stay unchanged.
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(super) struct Retry {
    /// Time limits; absent limits stay unchanged.
    #[serde(default)]
    limits: Option<NewLimits>,
    /// Jobs of higher priority run first.
    #[serde(default)]
    #[schemars(range(min = MIN_PRIORITY, max = MAX_PRIORITY))]
    priority: Option<i32>,
}

/// Time limits that are changed.
#[derive(Default, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub(super) struct NewLimits {
    /// The largest number of seconds from the start of an attempt to its end.
    timeout_s: Option<f64>,
    /// The largest number of seconds that the job may wait in the queue.
    queue_ttl_s: Option<f64>,
}

/// The key or the value of a label.
#[derive(Deserialize, JsonSchema, PartialEq, Eq, PartialOrd, Ord)]
#[schemars(inline)]
struct Label(#[schemars(length(max = MAX_LABEL))] String);

type Labels = BTreeMap<Label, Label>;

/// The body of a request that creates a token.
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(super) struct TokenFields {
    /// A name for people, such as where the token is used.
    #[schemars(length(min = 1, max = tokens::MAX_NAME))]
    name: String,
    /// The owner of the jobs that are submitted with the token: letters, digits and . _ @ + -
    #[schemars(length(min = 1, max = MAX_OWNER), regex(pattern = r"^[A-Za-z0-9._@+-]+$"))]
    owner: String,
    /// The scopes of the token; the first token of a service must have admin.
    #[schemars(
        length(min = 1),
        inner(regex(pattern = r"^(read|submit|cancel|admin)$"))
    )]
    scopes: Vec<String>,
    /// Seconds until the token expires; absent: it does not expire.
    #[serde(default)]
    #[schemars(range(min = tokens::MIN_EXPIRES_IN_S, max = tokens::MAX_EXPIRES_IN_S))]
    expires_in_s: Option<f64>,
}

/// The body of a request that begins a session.
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(super) struct LogIn {
    /// A token, with its secret.
    token: String,
}

/// A body with a problem and nothing else.
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(super) struct BareProblem {
    /// What to check.
    #[serde(rename = "problem")]
    _problem: Embedded,
}

/// Reads the value of a present field, which may be null: an outer `None` then means only that the field is absent.
fn given<'de, T: Deserialize<'de>, D: Deserializer<'de>>(reader: D) -> Result<Option<T>, D::Error> {
    T::deserialize(reader).map(Some)
}

impl Submission {
    fn envelope(self) -> Envelope {
        let Submission {
            _problem: Embedded,
            name,
            labels,
            priority,
            limits,
            cache,
        } = self;
        Envelope {
            name,
            labels: labels.map(texts).unwrap_or_default(),
            priority: priority.unwrap_or_default(),
            limits: limits.unwrap_or_default(),
            cache: cache.unwrap_or_default(),
        }
    }
}

fn texts(labels: Labels) -> BTreeMap<String, String> {
    let texts = labels.into_iter().map(|(key, value)| (key.0, value.0));
    texts.collect()
}

/// Reads a body of type `T`, which has no problem in it.
fn whole<T: DeserializeOwned + JsonSchema>(
    body: &'static Body<T>,
    text: &str,
) -> Result<T, ApiError> {
    let mut content = body.read(text).map_err(ApiError::MalformedJson)?;
    match content.fields.take() {
        Some(fields) if content.violations.is_empty() => Ok(fields),
        _ => Err(ApiError::InvalidProblem(content.into_violations())),
    }
}

/// Reads the one problem of a body; the error has all violations of the body.
fn problem<T>(mut content: Content<'_, T>) -> Result<Problem, Vec<Violation>> {
    let read = content.parse_problems().pop();
    read.filter(|_| content.violations.is_empty())
        .ok_or_else(|| content.into_violations())
}

/// Reads a body that submits a job: its problem and its other fields.
pub(super) fn submission(text: &str) -> Result<JobRequest, ApiError> {
    static BODY: Body<Submission> = Body::new();
    let mut content = BODY.read(text).map_err(ApiError::MalformedJson)?;
    let fields = content.fields.take();
    Ok(JobRequest {
        envelope: fields.map_or_else(Envelope::default, Submission::envelope),
        problem: problem(content),
    })
}

/// Reads a body that submits many jobs.
pub(super) fn batch(text: &str) -> Result<Vec<JobRequest>, ApiError> {
    static BODY: Body<Submissions> = Body::new();
    let mut content = BODY.read(text).map_err(ApiError::MalformedJson)?;
    let problems = content.parse_problems();
    match content.fields.take() {
        Some(Submissions { jobs }) if content.violations.is_empty() => {
            let both = jobs.into_iter().zip(problems);
            let requests = both.map(|(job, problem)| JobRequest {
                envelope: job.envelope(),
                problem: Ok(problem),
            });
            Ok(requests.collect())
        }
        _ => Err(ApiError::InvalidProblem(content.into_violations())),
    }
}

/// Reads a body that submits a sweep: its definition and its other fields.
pub(super) fn sweep(text: &str) -> Result<SweepRequest, ApiError> {
    static BODY: Body<SweepSubmission> = Body::new();
    let mut content = BODY.read(text).map_err(ApiError::MalformedJson)?;
    let mut envelope = Envelope {
        cache: Cache::Off,
        ..Envelope::default()
    };
    let mut own_limits = None;
    let variation = content.fields.take().map(|fields| {
        let SweepSubmission {
            _base: Embedded,
            axes,
            mode,
            points,
            name,
            labels,
            priority,
            limits,
        } = fields;
        own_limits = limits;
        envelope = Envelope {
            name,
            labels: labels.map(texts).unwrap_or_default(),
            priority: priority.unwrap_or_default(),
            limits: limits.unwrap_or_default(),
            cache: Cache::Off,
        };
        Variation { mode, axes, points }
    });
    Ok(SweepRequest {
        envelope,
        limits: own_limits,
        definition: sweep::of_body(content.with(variation)),
    })
}

/// Reads a body that changes a job: absent fields stay unchanged; null removes a name or labels.
pub(super) fn edit(text: &str) -> Result<Edit, ApiError> {
    static BODY: Body<Edits> = Body::new();
    let Edits {
        name,
        labels,
        priority,
        pinned,
    } = whole(&BODY, text)?;
    Ok(Edit {
        name,
        labels: labels.map(|labels| labels.map(texts).unwrap_or_default()),
        priority,
        pinned,
    })
}

/// Reads a merge patch (RFC 7396) that changes a job: absent fields and labels stay unchanged; null removes a name or
/// labels, and resets a priority or pinning.
pub(super) fn merge_patch(text: &str) -> Result<(Edit, LabelChanges), ApiError> {
    static BODY: Body<MergePatch> = Body::new();
    let MergePatch {
        name,
        labels,
        priority,
        pinned,
    } = whole(&BODY, text)?;
    let edit = Edit {
        name,
        labels: matches!(labels, Some(None)).then(BTreeMap::new),
        priority: priority.map(Option::unwrap_or_default),
        pinned: pinned.map(Option::unwrap_or_default),
    };
    let changes = labels.flatten().unwrap_or_default().into_iter();
    let changes = changes.map(|(key, value)| (key.0, value.map(|value| value.0)));
    Ok((edit, changes.collect()))
}

/// Reads a body with changes for a retry: absent fields stay unchanged.
pub(super) fn retry(text: &str) -> Result<Changes, ApiError> {
    static BODY: Body<Retry> = Body::new();
    let Retry { limits, priority } = whole(&BODY, text)?;
    let NewLimits {
        timeout_s,
        queue_ttl_s,
    } = limits.unwrap_or_default();
    Ok(Changes {
        timeout_s,
        queue_ttl_s,
        priority,
    })
}

/// Reads a body that creates a token.
pub(super) fn token(text: &str) -> Result<TokenRequest, ApiError> {
    static BODY: Body<TokenFields> = Body::new();
    let TokenFields {
        name,
        owner,
        scopes,
        expires_in_s,
    } = whole(&BODY, text)?;
    Ok(TokenRequest {
        name,
        owner,
        scopes,
        expires_in_s,
    })
}

/// Reads a body that begins a session; returns the token.
pub(super) fn session(text: &str) -> Result<String, ApiError> {
    static BODY: Body<LogIn> = Body::new();
    Ok(whole(&BODY, text)?.token)
}

/// A body with a problem and nothing else.
pub(super) fn bare_problem(text: &str) -> Result<Result<Problem, Vec<Violation>>, ApiError> {
    static BODY: Body<BareProblem> = Body::new();
    let content = BODY.read(text).map_err(ApiError::MalformedJson)?;
    Ok(problem(content))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use solver::error::Reason;

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

    /// A body whose schema cannot be read would allow anything.
    #[test]
    fn every_body_refuses_names_that_are_not_described() {
        const OTHER: &str = r#"{"other": 1}"#;
        let refused = |read: Result<(), ApiError>| match read {
            Err(ApiError::InvalidProblem(found)) => found,
            _ => vec![],
        };
        let invalid =
            |read: Result<(), Vec<Violation>>| refused(read.map_err(ApiError::InvalidProblem));
        for found in [
            invalid(submission(OTHER).unwrap().problem.map(|_| ())),
            refused(batch(OTHER).map(|_| ())),
            invalid(sweep(OTHER).unwrap().definition.map(|_| ())),
            invalid(bare_problem(OTHER).unwrap().map(|_| ())),
            refused(edit(OTHER).map(|_| ())),
            refused(merge_patch(OTHER).map(|_| ())),
            refused(retry(OTHER).map(|_| ())),
            refused(token(OTHER).map(|_| ())),
            refused(session(OTHER).map(|_| ())),
        ] {
            let unknown = |v: &Violation| v.pointer == "/other" && v.reason == Reason::UnknownName;
            assert!(found.iter().any(unknown), "{found:?}");
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
            ["/name", "/labels/a", "/priority", "/problem", "/wait"]
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
        let text = serde_json::to_string(&fake::problem()).unwrap();
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
        assert!(long.unwrap().got.ends_with("… (1048576 characters)`"));
    }

    #[test]
    fn malformed_json_is_distinguished_from_a_wrong_type() {
        assert!(matches!(
            submission("{\"problem\": "),
            Err(ApiError::MalformedJson(_))
        ));
        assert_eq!(pointers("[1]"), [""]);
    }
}
