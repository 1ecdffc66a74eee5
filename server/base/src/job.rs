//! A job: its identity, its status and how that may change. No I/O.

use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use solver::solution::{EstimatedQuantity, Outcome, Residuals, Verdict, Warning};
use strum::{Display, EnumString, IntoStaticStr, VariantArray};

pub use crate::id::{JobId, SweepId};
use crate::{
    catalog::{Code, Kind, explained_at},
    time::Time,
};

/// The lowest priority.
pub const MIN_PRIORITY: i32 = -10;
/// The highest priority.
pub const MAX_PRIORITY: i32 = 10;

/// A problem submitted to the service, as clients see it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Job {
    /// The number of the job in the store, in order of arrival; never shown to clients.
    #[serde(skip)]
    pub key: i64,
    /// The stored mesh that the job's problem names.
    #[serde(skip)]
    pub mesh: Option<String>,
    /// The memory that the job is estimated to need (bytes); unknown for jobs of early versions.
    #[serde(skip)]
    pub memory_bytes: Option<u64>,
    /// The key of the job that this one is coalesced into: it is not solved itself, but ends with the result of that
    /// job.
    #[serde(skip)]
    pub coalesced_into: Option<i64>,
    /// Whether an earlier result may be used for the job.
    #[serde(skip)]
    pub cache: Cache,
    /// The public id.
    pub id: JobId,
    /// The status of the job.
    pub status: Status,
    /// Why the job failed or was canceled.
    pub reason: Option<Reason>,
    /// Whether a client asked the job to stop while it was running.
    pub cancel_requested: bool,
    /// The number of changes of status and edits; progress does not count.
    pub version: i64,
    /// A name for people.
    pub name: Option<String>,
    /// Labels for programs.
    pub labels: BTreeMap<String, String>,
    /// The owner who submitted the job.
    pub owner: String,
    /// The priority, −10 … 10; higher runs first.
    pub priority: i32,
    /// The number of the current or last attempt to solve the job, 0 before the first.
    pub attempt: i32,
    /// The number of attempts that the job has: if the worker is lost in the last of them, the job fails.
    pub max_attempts: i32,
    /// The SHA-256 of the problem with its defaults, without its title.
    pub input_hash: String,
    /// The job whose result answered this one.
    #[serde(default)]
    pub cached_from: Option<JobId>,
    /// The job that this one retries.
    #[serde(default)]
    pub parent: Option<JobId>,
    /// The sweep whose members the job solves; its own problem and result are those of the first of these members.
    #[serde(default)]
    pub sweep: Option<SweepId>,
    /// Whether the job is pinned: never deleted because of its age or size.
    #[serde(default)]
    pub pinned: bool,
    /// The time when the job was accepted.
    pub created_at: Time,
    /// The time when the job's last attempt began.
    pub started_at: Option<Time>,
    /// The time when the job ended.
    pub finished_at: Option<Time>,
    /// Seconds from acceptance to the start of the last attempt.
    pub queue_wait_s: Option<f64>,
    /// Seconds from the start of the last attempt to the end.
    pub run_s: Option<f64>,
    /// The position of the job in the queue, while it waits.
    pub queue: Option<QueuePosition>,
    /// The progress of the job, once it has started.
    pub progress: Option<Progress>,
    /// The time limits of the job.
    #[serde(default)]
    pub limits: Limits,
    /// What went wrong, if the job failed.
    pub failure: Option<Failure>,
    /// Whether a result is available.
    pub result_available: ResultAvailable,
    /// Bytes that the job takes in the store once it has ended: its result, problem and events before the last. Data
    /// that it shares with other jobs are counted for one of them.
    #[serde(default)]
    pub stored_bytes: Option<u64>,
    /// The verdict on the result: whether it can be relied on. Absent until the job has a result with stated errors, and
    /// for a job that ended under an earlier version, or is answered by one: only the summary has it then.
    #[serde(default)]
    pub verdict: Option<Verdict>,
    /// Forces and peaks of the result with their errors, of the first contacts; the summary of the result has all of them,
    /// with the ends of contact and stick.
    #[serde(default)]
    pub quantities: Vec<EstimatedQuantity>,
    /// Up to five warnings about the result, the worst first; the summary of the result has all of them. For a job that
    /// ended under an earlier version, only the summary has them.
    #[serde(default)]
    pub warnings: Vec<Warning>,
    /// Addresses of related resources.
    pub links: BTreeMap<String, String>,
}

/// Implements the choice of some fields of a job: those that clients see, by their names.
macro_rules! fields {
    ($($name:ident)*) => {
        impl Job {
            /// The names of the fields that clients see, in the order in which they are written.
            pub const FIELDS: &[&str] = &[$(stringify!($name)),*];

            /// The job with these fields only: the others have the values of an empty job.
            pub fn with_fields(self, wanted: &BTreeSet<&str>) -> Job {
                let empty = Job::default();
                // all of them by name, so that a new one is not forgotten
                Job {
                    key: self.key,
                    mesh: self.mesh,
                    memory_bytes: self.memory_bytes,
                    coalesced_into: self.coalesced_into,
                    cache: self.cache,
                    $($name: if wanted.contains(stringify!($name)) { self.$name } else { empty.$name },)*
                }
            }
        }
    };
}

fields! {
    id status reason cancel_requested version name labels owner priority attempt max_attempts input_hash cached_from
    parent sweep pinned created_at started_at finished_at queue_wait_s run_s queue progress limits failure
    result_available stored_bytes verdict quantities warnings links
}

impl Job {
    /// Whether the job waits for a worker and is not coalesced into another job.
    pub fn waits_for_a_worker(&self) -> bool {
        self.status == Status::Queued && self.coalesced_into.is_none()
    }
}

/// The status of a job.
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
    Display,
    IntoStaticStr,
    EnumString,
    VariantArray,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Status {
    /// Accepted and waiting.
    #[default]
    Queued,
    /// Being solved by a worker.
    Running,
    /// Solved.
    Succeeded,
    /// Ended without a converged solution.
    Failed,
    /// Ended on request.
    Canceled,
}

impl Status {
    /// Whether a job of this status has ended, which never changes again.
    pub fn is_terminal(self) -> bool {
        matches!(self, Status::Succeeded | Status::Failed | Status::Canceled)
    }

    /// Whether a job of this status has ended without a solution: what it has is the state at which it stopped.
    pub fn is_without_solution(self) -> bool {
        matches!(self, Status::Failed | Status::Canceled)
    }

    /// The allowed changes of the status:
    ///
    /// ```text
    /// queued ──► running ──► succeeded | failed | canceled
    ///   ▲  │        │
    ///   │  └────────┼──────► canceled | failed
    ///   └───────────┘  only when the service stops, or after a crash
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
    /// The residual stayed above the tolerance: `max_iterations` was reached, there was no more progress, or Newton's
    /// method failed.
    NotConverged,
    /// The contact states repeat in a cycle.
    ContactCycling,
    /// The method's own criterion was met, but the true residual is above the tolerance or the forces do not balance.
    FalseConvergence,
    /// The stiffness matrix is singular, or nothing holds the body.
    SingularSystem,
    /// A number became infinite or not a number.
    NonFinite,
    /// The job ran longer than `limits.timeout_s`.
    TimedOut,
    /// The job waited longer than `limits.queue_ttl_s`.
    QueueExpired,
    /// The job needs more memory than is available.
    ResourceExhausted,
    /// The process died during several attempts.
    WorkerLost,
    /// The first member of a sweep is invalid in a way that only its mesh shows.
    InvalidProblem,
    /// An error of the service itself.
    Internal,
    /// A client canceled the job.
    UserCancel,
}

impl Reason {
    /// Whether the reason lies in the problem, so that solving it again would end in the same way.
    pub fn belongs_to_the_problem(self) -> bool {
        match self {
            Reason::NotConverged
            | Reason::ContactCycling
            | Reason::FalseConvergence
            | Reason::SingularSystem
            | Reason::NonFinite
            | Reason::InvalidProblem => true,
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
            Reason::InvalidProblem => Code::InvalidProblem,
            Reason::Internal => Code::Internal,
            Reason::UserCancel => Code::UserCancel,
        }
    }
}

/// Whether a job has a result to fetch.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    Default,
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
    /// No result.
    #[default]
    None,
    /// The last state of a job that did not converge or was canceled; of a running job the finished load steps, or the mesh of
    /// adaptive refinement that was solved last.
    Partial,
    /// A converged result.
    Final,
}

/// The time limits of a job.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Seconds that an attempt may take; then the job fails with `timed_out`. The solver has two more seconds to return
    /// its last state, which is kept.
    pub timeout_s: f64,
    /// Seconds that the job may wait for a worker; then it fails with `queue_expired`.
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

/// Whether a job may be answered with the result of another one.
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
    /// The result of an earlier job with the same input is used if there is one; the job is coalesced into a queued or
    /// running job of the same input.
    #[default]
    Use,
    /// The job is solved again, and its result may be used for later jobs.
    Refresh,
    /// The job is solved again, and its result is not used for other jobs.
    Off,
}

/// The position of a queued job.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct QueuePosition {
    /// The position from 1; 0 for a job that is coalesced into a running one.
    pub position: i64,
    /// The number of jobs before this one.
    pub ahead: i64,
    /// The reason for waiting.
    pub reason: Waiting,
}

/// Why a queued job waits.
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
    /// All workers are busy.
    WorkersBusy,
    /// A worker is idle, but the running jobs leave too little of the memory budget for the next job.
    Memory,
    /// No worker that is there has the memory that the job needs, or there is no worker.
    NoWorkerFits,
    /// The queue is paused.
    Paused,
    /// The disk has no room for results; jobs start again when there is some.
    LowDisk,
    /// The owner of the job has reached the limit of running jobs.
    OwnerLimit,
    /// The job is coalesced into a queued or running job with the same input, and will end with that job's result.
    Coalesced,
}

/// The progress of a job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Progress {
    /// The phase that began last: mesh, assemble, …, recover, and verify. `low_disk`: the disk is full, and the job's
    /// results are stored once there is space; until then the job stays running, even if it is solved.
    pub stage: String,
    /// Iterations so far.
    pub iteration: u32,
    /// The larger of the two residuals of the last iteration (dimensionless).
    pub residual: Option<f64>,
    /// The tolerance that both residuals must reach.
    pub tolerance: Option<f64>,
    /// Nodes that entered or left contact in the last iteration.
    pub contact_changes: Option<u32>,
    /// The factor by which an iteration reduces the residual.
    pub rate: Option<f64>,
    /// The estimated seconds to the end, extrapolated from the rate.
    pub eta_s: Option<f64>,
    /// The number of the present mesh of adaptive refinement, from 1; absent without adaptive refinement.
    pub mesh: Option<u32>,
    /// The number of elements of the present mesh of adaptive refinement.
    pub mesh_elements: Option<u64>,
    /// The largest relative error on the mesh before the present one.
    pub mesh_error: Option<f64>,
    /// Residuals of the iterations from the first on, for a small curve: of each of the first 32 iterations, then of every
    /// second, fourth, … one. Each has three digits.
    #[serde(default)]
    pub residuals: Vec<f64>,
}

impl Progress {
    /// The largest number of residuals.
    const MOST: u32 = 32;

    /// Adds the residual of iteration `k` (from 1) to those for a small curve; iterations come one after another.
    pub fn add_residual(&mut self, k: u32, residual: f64) {
        let every = |k: u32| k.div_ceil(Progress::MOST).next_power_of_two();
        if k <= 1 {
            self.residuals.clear();
        } else if every(k) > every(k - 1) {
            let mut even = false;
            self.residuals.retain(|_| {
                even = !even;
                even
            });
        }
        if (k.max(1) - 1).is_multiple_of(every(k)) && residual.is_finite() {
            self.residuals
                .push(format!("{residual:.2e}").parse().unwrap_or(residual));
        }
    }
}

/// Why a job failed, in the form of a problem document.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Failure {
    /// The address of the page that explains the kind of failure.
    pub r#type: String,
    /// The title: one line, the same for every failure of its kind.
    pub title: String,
    /// The kind of failure, a stable name for programs.
    pub code: String,
    /// What happened in this job.
    pub detail: String,
}

impl Failure {
    /// A failure of this kind.
    pub fn new(reason: Reason, detail: impl Into<String>) -> Self {
        let Kind { code, title, .. } = Code::from(reason).kind();
        Failure {
            r#type: explained_at(code),
            title: title.into(),
            code: code.into(),
            detail: detail.into(),
        }
    }
}

/// The text about a solver that ended without a solution.
pub fn without_solution(outcome: Outcome, iterations: u32, residuals: &Residuals) -> String {
    let Residuals {
        kkt,
        friction,
        monolithic,
        equilibrium,
    } = residuals;
    let found = match outcome {
        Outcome::FalseConvergence => format!(
            "the residual of the whole problem is {monolithic:.3e}, and the forces on the body are out of balance by \
             {equilibrium:.3e} of their size"
        ),
        _ => format!("the residual is {kkt:.3e} and the friction residual {friction:.3e}"),
    };
    format!("after {iterations} iterations {found}")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_small_curve_has_evenly_spaced_residuals_from_the_first_on() {
        let mut progress = Progress::default();
        for k in 1..=1000_u32 {
            progress.add_residual(k, f64::from(k));
            let found = &progress.residuals;
            let every = k.div_ceil(32).next_power_of_two();
            let expected = (1..=k).step_by(every as usize).map(f64::from);
            assert_eq!(*found, expected.collect::<Vec<_>>(), "{k}");
            assert!(found.len() <= 32);
        }
        progress.add_residual(1, 0.123_456);
        assert_eq!(progress.residuals, [0.123]);
    }

    #[test]
    fn the_names_of_fields_are_those_in_json_in_the_same_order() {
        let text = serde_json::to_string(&Job::default()).unwrap();
        let place = |name: &&&str| text.find(&format!("\"{name}\":")).unwrap();
        assert!(Job::FIELDS.is_sorted_by_key(|name| place(&name)));
        let written: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(written.as_object().unwrap().len(), Job::FIELDS.len());
    }

    /// The statuses that a job of that status may change to.
    fn becomes(from: Status) -> Vec<Status> {
        let all = Status::VARIANTS.iter().copied();
        all.filter(|to| from.may_become(*to)).collect()
    }

    /// The statuses from which a job may change to that status.
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

    /// Checks that values have the same words in the store and in JSON, and are read back from both.
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
    fn a_value_is_the_same_word_in_the_store_and_in_json() {
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
}
