//! A job: its identity, its status and the moves it may make. No I/O.

use std::{borrow::Cow, collections::BTreeMap, fmt};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use strum::{Display, EnumString, IntoStaticStr, VariantArray};
use uuid::Uuid;

use crate::{
    catalog::{Code, Kind},
    time::Time,
};

/// A problem on its way through the service, as clients see it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Job {
    /// The store's own number, in order of arrival; never shown.
    #[serde(skip)]
    pub key: i64,
    /// Where the store keeps what there is of its result.
    #[serde(skip)]
    pub result_key: i64,
    /// The key of the job whose end will be its own.
    #[serde(skip)]
    pub twin_of: Option<i64>,
    /// Whether an earlier result may answer it.
    #[serde(skip)]
    pub cache: Cache,
    /// The public name.
    pub id: JobId,
    /// Where it stands.
    pub status: Status,
    /// Why it failed or was canceled.
    pub reason: Option<Reason>,
    /// Somebody asked a running job to stop.
    pub cancel_requested: bool,
    /// Counts status changes and edits, not progress.
    pub version: i64,
    /// A name for people.
    pub name: Option<String>,
    /// Labels for programs.
    pub labels: BTreeMap<String, String>,
    /// Whose job it is.
    pub owner: String,
    /// −10 … 10, higher first.
    pub priority: i32,
    /// Number of the current or last start, 0 before the first.
    pub attempt: i32,
    /// A worker lost in the last of these fails the job.
    pub max_attempts: i32,
    /// SHA-256 of the problem with its defaults, without its title.
    pub input_hash: String,
    /// The job whose result answered this one.
    #[serde(default)]
    pub cached_from: Option<JobId>,
    /// The job that this one tries again.
    #[serde(default)]
    pub parent: Option<JobId>,
    /// Never removed by age.
    #[serde(default)]
    pub pinned: bool,
    /// When it was accepted.
    pub created_at: Time,
    /// When it was last started.
    pub started_at: Option<Time>,
    /// When it became terminal.
    pub finished_at: Option<Time>,
    /// Seconds from acceptance to the last start.
    pub queue_wait_s: Option<f64>,
    /// Seconds from the last start to the end.
    pub run_s: Option<f64>,
    /// Its place, while queued.
    pub queue: Option<QueuePosition>,
    /// How far it has come, once started.
    pub progress: Option<Progress>,
    /// What it may take.
    #[serde(default)]
    pub limits: Limits,
    /// What went wrong.
    pub failure: Option<Failure>,
    /// Whether there is something to fetch.
    pub result_available: ResultAvailable,
    /// Where to go from here.
    pub links: BTreeMap<String, String>,
}

impl Job {
    /// It waits, for a worker and not for another job.
    pub fn waits_in_line(&self) -> bool {
        self.status == Status::Queued && self.twin_of.is_none()
    }
}

/// The public name of a job, `job_<uuidv7>`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct JobId(pub Uuid);

impl JobId {
    /// A new name, later than all before it.
    pub fn new() -> Self {
        JobId(Uuid::now_v7())
    }

    /// Reads the canonical form and no other: one job has one name.
    pub fn parse(text: &str) -> Option<Self> {
        let id = JobId(Uuid::try_parse(text.strip_prefix("job_")?).ok()?);
        (id.to_string() == text).then_some(id)
    }
}

impl Default for JobId {
    fn default() -> Self {
        JobId::new()
    }
}

impl fmt::Display for JobId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "job_{}", self.0)
    }
}

impl Serialize for JobId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for JobId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        JobId::parse(&text).ok_or_else(|| serde::de::Error::custom("not a job id"))
    }
}

impl JsonSchema for JobId {
    fn schema_name() -> Cow<'static, str> {
        "JobId".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "The public name of a job, job_<uuidv7>.",
            "type": "string",
            "pattern": "^job_[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}$",
        })
    }
}

/// Where a job stands.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    Serialize,
    Deserialize,
    JsonSchema,
    Display,
    IntoStaticStr,
    EnumString,
    VariantArray,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Status {
    /// Accepted and waiting.
    Queued,
    /// In the hands of a worker.
    Running,
    /// Solved.
    Succeeded,
    /// Ended without a converged solution.
    Failed,
    /// Ended on request.
    Canceled,
}

impl Status {
    /// No move leads away from here.
    pub fn is_terminal(self) -> bool {
        matches!(self, Status::Succeeded | Status::Failed | Status::Canceled)
    }

    /// The legal moves:
    ///
    /// ```text
    /// queued ──► running ──► succeeded | failed | canceled
    ///   ▲  │        │
    ///   │  └────────┼──────► canceled | failed
    ///   └───────────┘  only by recovery after a crash, or a drain
    /// ```
    pub fn may_become(self, next: Status) -> bool {
        match self {
            Status::Queued => matches!(next, Status::Running | Status::Canceled | Status::Failed),
            Status::Running => next != Status::Running,
            Status::Succeeded | Status::Failed | Status::Canceled => false,
        }
    }
}

/// Why a job failed or was canceled.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    Serialize,
    Deserialize,
    JsonSchema,
    IntoStaticStr,
    EnumString,
    VariantArray,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Reason {
    /// `max_iterations` reached.
    NotConverged,
    /// The contact set repeats itself.
    ContactCycling,
    /// The method's own tests were met, but the forces on the body do not balance.
    FalseConvergence,
    /// The stiffness matrix has no factor.
    SingularSystem,
    /// A number that is not finite came up.
    NonFinite,
    /// It ran longer than it may.
    TimedOut,
    /// It waited longer than it may.
    QueueExpired,
    /// It needs more than there is.
    ResourceExhausted,
    /// The process died under it once too often.
    WorkerLost,
    /// Our fault.
    Internal,
    /// The client's wish.
    UserCancel,
}

impl Reason {
    /// A property of the problem: whoever solves it again ends the same way.
    pub fn belongs_to_the_problem(self) -> bool {
        match self {
            Reason::NotConverged
            | Reason::ContactCycling
            | Reason::FalseConvergence
            | Reason::SingularSystem
            | Reason::NonFinite => true,
            Reason::TimedOut
            | Reason::QueueExpired
            | Reason::ResourceExhausted
            | Reason::WorkerLost
            | Reason::Internal
            | Reason::UserCancel => false,
        }
    }
}

impl From<Reason> for Code {
    fn from(reason: Reason) -> Code {
        match reason {
            Reason::NotConverged => Code::NotConverged,
            Reason::ContactCycling => Code::ContactCycling,
            Reason::FalseConvergence => Code::FalseConvergence,
            Reason::SingularSystem => Code::SingularSystem,
            Reason::NonFinite => Code::NonFinite,
            Reason::TimedOut => Code::TimedOut,
            Reason::QueueExpired => Code::QueueExpired,
            Reason::ResourceExhausted => Code::ResourceExhausted,
            Reason::WorkerLost => Code::WorkerLost,
            Reason::Internal => Code::Internal,
            Reason::UserCancel => Code::UserCancel,
        }
    }
}

/// Whether a job has something to fetch.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Serialize,
    Deserialize,
    JsonSchema,
    IntoStaticStr,
    EnumString,
    VariantArray,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum ResultAvailable {
    /// Nothing.
    None,
    /// The last state of a job that did not converge or was canceled, or the finished load steps of one that
    /// runs.
    Partial,
    /// A converged result.
    Final,
}

/// What a job may take.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Seconds from a start to the end; then it fails with `timed_out`. Its solver then has two more to hand
    /// over its last state.
    pub timeout_s: f64,
    /// Seconds that it may wait for a start; then it fails with `queue_expired`.
    pub queue_ttl_s: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Limits {
            timeout_s: 600.0,
            queue_ttl_s: 86_400.0,
        }
    }
}

/// Whether earlier results may answer a job.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    Serialize,
    Deserialize,
    JsonSchema,
    IntoStaticStr,
    EnumString,
    VariantArray,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Cache {
    /// The result of the same input answers it at once; a job at work on that input is joined.
    #[default]
    Use,
    /// It is solved anew, and its result answers later ones.
    Refresh,
    /// It is solved anew, and its result answers nobody else.
    Off,
}

/// The place of a queued job.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct QueuePosition {
    /// From 1; 0 for a job that another one, already running, will answer.
    pub position: i64,
    /// Jobs before this one.
    pub ahead: i64,
    /// What it waits for.
    pub reason: Waiting,
}

/// What a queued job waits for.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    Serialize,
    Deserialize,
    JsonSchema,
    IntoStaticStr,
    EnumString,
    VariantArray,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Waiting {
    /// All workers have something to do.
    WorkersBusy,
    /// The queue was paused.
    Paused,
    /// A job with the same input is ahead of it; its result will answer both.
    Joined,
}

/// How far a job has come.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Progress {
    /// The phase that began last: mesh, assemble, …, recover.
    pub stage: String,
    /// Rows of history so far.
    pub iteration: u32,
    /// The larger of the two residuals of the last row (dimensionless).
    pub residual: Option<f64>,
    /// What both must fall below.
    pub tolerance: Option<f64>,
    /// Nodes that entered or left contact in the last row.
    pub contact_changes: Option<u32>,
    /// Contraction number of the sweeps.
    pub rate: Option<f64>,
    /// Seconds to the end, extrapolated from the rate.
    pub eta_s: Option<f64>,
}

/// Why a job failed, in the form of a problem document.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Failure {
    /// Address of the explanation.
    pub r#type: String,
    /// One line, the same for every failure of its kind.
    pub title: String,
    /// The kind, stable for programs.
    pub code: String,
    /// What happened this time.
    pub detail: String,
}

impl Failure {
    /// A failure of this kind.
    pub fn new(reason: Reason, detail: impl Into<String>) -> Self {
        let Kind { code, title, .. } = Code::from(reason).kind();
        Failure {
            r#type: format!("/v1/errors/{code}"),
            title: title.into(),
            code: code.into(),
            detail: detail.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// What a job of that status may become.
    fn becomes(from: Status) -> Vec<Status> {
        let all = Status::VARIANTS.iter().copied();
        all.filter(|to| from.may_become(*to)).collect()
    }

    /// From where a job may come to that status.
    fn comes_from(to: Status) -> Vec<Status> {
        let all = Status::VARIANTS.iter().copied();
        all.filter(|from| from.may_become(to)).collect()
    }

    #[test]
    fn a_terminal_job_never_moves_again() {
        for from in Status::VARIANTS.iter().filter(|from| from.is_terminal()) {
            assert_eq!(becomes(*from), [], "{from:?}");
        }
    }

    #[test]
    fn only_a_running_job_goes_back_to_the_queue() {
        assert_eq!(comes_from(Status::Queued), [Status::Running]);
    }

    #[test]
    fn success_comes_only_from_running() {
        assert_eq!(comes_from(Status::Succeeded), [Status::Running]);
    }

    /// In the store as in JSON, and read back from both.
    fn has_words<T>()
    where
        T: VariantArray + Copy + PartialEq + std::fmt::Debug,
        T: Into<&'static str> + std::str::FromStr + Serialize + serde::de::DeserializeOwned,
    {
        for value in T::VARIANTS {
            let word: &str = (*value).into();
            assert_eq!(serde_json::to_value(value).unwrap(), word);
            assert_eq!(word.parse().ok(), Some(*value));
            assert_eq!(serde_json::from_value::<T>(word.into()).unwrap(), *value);
        }
    }

    #[test]
    fn a_word_is_the_same_in_the_store_and_in_json() {
        has_words::<Status>();
        has_words::<Reason>();
        has_words::<ResultAvailable>();
        has_words::<Cache>();
        has_words::<Waiting>();
    }

    #[test]
    fn a_failure_has_the_code_of_its_reason() {
        for reason in Reason::VARIANTS {
            let failure = Failure::new(*reason, "so");
            let word: &str = reason.into();
            assert_eq!(failure.code, word.replace('_', "-"));
            assert_eq!(failure.r#type, format!("/v1/errors/{}", failure.code));
            assert!(!failure.title.is_empty(), "{reason:?}");
        }
    }

    #[test]
    fn a_job_id_has_one_spelling() {
        let id = JobId::new();
        let text = id.to_string();
        assert_eq!(JobId::parse(&text), Some(id));
        for other in [
            text.to_uppercase(),
            text.replace('-', ""),
            text[4..].to_string(),
            format!("{text} "),
        ] {
            assert_eq!(JobId::parse(&other), None, "{other}");
        }
    }
}
