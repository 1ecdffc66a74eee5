//! A sweep: many problems that differ in a few values, and the results of each. No I/O.

use std::{borrow::Cow, collections::BTreeMap};

use files::sweep::Plan;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};
use serde_json::{Value, value::RawValue};
use solver::{
    error::Violation,
    family::Member,
    solution::{Outcome, Residuals, Verdict, WarningCode},
};

use crate::{
    job::{Limits, Reason, Status, SweepId, without_solution},
    time::Time,
};

/// A sweep, as clients see it.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Sweep {
    /// The number of the sweep in the store, in order of arrival; never shown to clients.
    #[serde(skip)]
    pub key: i64,
    /// The public id.
    pub id: SweepId,
    /// The status: running once a job has started; when all have ended: canceled if one was canceled, succeeded if at
    /// least one member succeeded, else failed. `members` has the details.
    pub status: Status,
    /// A version that changes whenever the sweep does.
    pub version: String,
    /// A name for people.
    pub name: Option<String>,
    /// Labels for programs.
    pub labels: BTreeMap<String, String>,
    /// The owner who submitted the sweep.
    pub owner: String,
    /// The time when the sweep was accepted.
    pub created_at: Time,
    /// The time when the last job of the sweep ended.
    pub finished_at: Option<Time>,
    /// The values in which members differ: JSON Pointers into the problem.
    pub paths: Vec<String>,
    /// The numbers of members by status.
    pub members: MemberCounts,
    /// The number of jobs that solve the members: one job for all members on the same body. `GET /v1/jobs?sweep=…`
    /// lists the jobs.
    pub jobs: u32,
    /// Addresses of related resources.
    pub links: BTreeMap<String, String>,
}

/// The numbers of members of a sweep by status.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct MemberCounts {
    /// All members.
    pub total: u32,
    /// Members whose job waits.
    pub queued: u32,
    /// Members whose job is running, which solves them one after another.
    pub running: u32,
    /// Members that converged.
    pub succeeded: u32,
    /// Members that did not converge, are invalid, or were not reached when their job failed.
    pub failed: u32,
    /// Members that were not reached when their job was canceled.
    pub canceled: u32,
}

/// A member of a sweep, with its results: a row of the table.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MemberRow {
    /// The number of the member, from 0, in the order of the definition.
    pub number: u32,
    /// The values of the member by JSON Pointer, without those that equal the base's.
    #[serde(default)]
    pub parameters: BTreeMap<String, ParameterValue>,
    /// The member's status.
    pub status: Status,
    /// Why the member failed or was canceled.
    pub reason: Option<Reason>,
    /// The verdict on the member's own solution: whether its numbers can be relied on. Of the members on one body the
    /// first and the last have it, and so has each member with a mesh of its own; the others are solved without stated
    /// errors.
    #[serde(default)]
    pub verdict: Option<Verdict>,
    /// What went wrong, if the member failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detail: Option<String>,
    /// The first violations of an invalid member; pointers refer to its problem.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub violations: Vec<Violation>,
    /// Normal force ∫p ≥ 0 over all contacts (force); the results are absent until the member is solved, and of a
    /// member that failed.
    pub normal_force: Option<f64>,
    /// Tangential force ∫σ_t over all contacts (force).
    pub tangential_force: Option<f64>,
    /// Friction force ∫|σ_t| over all contacts (force).
    pub friction_force: Option<f64>,
    /// Length of all contacts together. Its ends, and those of the lengths of stick and slip, are interpolated between
    /// the outermost nodes in contact and the nodes beside them.
    pub contact_width: Option<f64>,
    /// The error of `contact_width` due to the distances between nodes: for each end of contact the distance to the next
    /// node, as in the `accuracy` of a job. Errors of the forces are not in it, and lengths of stick and slip have no stated
    /// error. Absent where an end is unknown, and in rows of older versions, whose lengths end at nodes.
    #[serde(default)]
    pub contact_width_error: Option<f64>,
    /// Length of the contact that sticks.
    pub stick_width: Option<f64>,
    /// Length of the contact that slips.
    pub slip_width: Option<f64>,
    /// The largest pressure, as a stress (≤ 0); 0 without contact.
    pub peak_normal_stress: Option<f64>,
    /// The largest |σ_t|, with its sign; 0 without friction.
    pub peak_tangential_stress: Option<f64>,
    /// Indentation of the obstacle with a load or a tilt; absent without one such obstacle, or with several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obstacle_indentation: Option<f64>,
    /// Tangential displacement of this obstacle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obstacle_tangential_displacement: Option<f64>,
    /// Tilt of this obstacle (radians).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obstacle_tilt: Option<f64>,
    /// The number of iterations of the member; 0 if it was not solved.
    pub iterations: u32,
    /// The dimensionless residuals of the member's final state.
    pub residuals: Option<Residuals>,
    /// The kinds of warnings to consider before relying on the results, each once.
    pub warnings: Vec<WarningCode>,
}

/// A value of a member of a sweep, as JSON.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ParameterValue(Box<RawValue>);

impl ParameterValue {
    /// The value as JSON text.
    pub fn json(&self) -> &str {
        self.0.get()
    }
}

impl From<Box<RawValue>> for ParameterValue {
    fn from(text: Box<RawValue>) -> Self {
        ParameterValue(text)
    }
}

impl PartialEq for ParameterValue {
    fn eq(&self, other: &Self) -> bool {
        self.json() == other.json()
    }
}

impl JsonSchema for ParameterValue {
    fn schema_name() -> Cow<'static, str> {
        Value::schema_name()
    }

    fn inline_schema() -> bool {
        Value::inline_schema()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        Value::json_schema(generator)
    }
}

/// The largest number of violations of a member that are kept.
const MOST_VIOLATIONS: usize = 5;

impl MemberRow {
    /// Sets the member's values from the plan of its sweep.
    pub fn with_values(&mut self, plan: &Plan) {
        let values = plan.parameters(self.number as usize).into_iter();
        self.parameters = values.map(|(path, value)| (path, value.into())).collect();
    }

    /// The row with each kind of warning once, however many contacts have it, and without the numbers of a state that is
    /// no solution: who plots a column must not get them. A job of the member's own has that state, as a partial result.
    pub fn tidied(mut self) -> MemberRow {
        if self.status.is_without_solution() {
            for number in [
                &mut self.normal_force,
                &mut self.tangential_force,
                &mut self.friction_force,
                &mut self.contact_width,
                &mut self.contact_width_error,
                &mut self.stick_width,
                &mut self.slip_width,
                &mut self.peak_normal_stress,
                &mut self.peak_tangential_stress,
                &mut self.obstacle_indentation,
                &mut self.obstacle_tangential_displacement,
                &mut self.obstacle_tilt,
            ] {
                *number = None;
            }
        }
        let mut kinds: Vec<WarningCode> = vec![];
        for code in std::mem::take(&mut self.warnings) {
            if !kinds.contains(&code) {
                kinds.push(code);
            }
        }
        self.warnings = kinds;
        self
    }

    /// The row of a member whose iterations have ended, converged or not.
    pub fn solved(number: usize, member: Member) -> MemberRow {
        let Member {
            outcome,
            normal_force,
            tangential_force,
            friction_force,
            contact_width,
            contact_width_error,
            stick_width,
            slip_width,
            peak_normal_stress,
            peak_tangential_stress,
            indentation,
            tangential_displacement,
            tilt,
            iterations,
            residuals,
            warnings,
            verdict,
        } = member;
        let (status, reason) = match outcome {
            Outcome::Converged => (Status::Succeeded, None),
            Outcome::NotConverged => (Status::Failed, Some(Reason::NotConverged)),
            Outcome::ContactCycling => (Status::Failed, Some(Reason::ContactCycling)),
            Outcome::FalseConvergence => (Status::Failed, Some(Reason::FalseConvergence)),
            Outcome::Canceled | Outcome::Unfinished => (Status::Canceled, Some(Reason::UserCancel)),
        };
        let failed = status == Status::Failed;
        let detail = failed.then(|| without_solution(outcome, iterations, &residuals));
        MemberRow {
            number: number_of(number),
            status,
            reason,
            detail,
            normal_force: Some(normal_force),
            tangential_force: Some(tangential_force),
            friction_force: Some(friction_force),
            contact_width: Some(contact_width),
            contact_width_error,
            stick_width: Some(stick_width),
            slip_width: Some(slip_width),
            peak_normal_stress: Some(peak_normal_stress),
            peak_tangential_stress: Some(peak_tangential_stress),
            obstacle_indentation: indentation,
            obstacle_tangential_displacement: tangential_displacement,
            obstacle_tilt: tilt,
            iterations,
            residuals: Some(residuals),
            warnings,
            verdict,
            ..MemberRow::default()
        }
        .tidied()
    }

    /// The row of a member that failed without a solution.
    pub fn failed(number: usize, reason: Reason, detail: String) -> MemberRow {
        MemberRow {
            number: number_of(number),
            status: Status::Failed,
            reason: Some(reason),
            detail: Some(detail),
            ..MemberRow::default()
        }
    }

    /// The row of a member whose problem is invalid.
    pub fn invalid(number: usize, mut violations: Vec<Violation>) -> MemberRow {
        let detail = match violations.len() {
            1 => "the problem has a violation".to_owned(),
            count => format!("the problem has {count} violations"),
        };
        violations.truncate(MOST_VIOLATIONS);
        MemberRow {
            violations,
            ..MemberRow::failed(number, Reason::InvalidProblem, detail)
        }
    }

    /// The row of a member that was not solved, or not yet, by the state of its job: waiting, running, or ended.
    pub fn unsolved(number: usize, status: Status, reason: Option<Reason>) -> MemberRow {
        MemberRow {
            number: number_of(number),
            status: match status {
                // its job has ended without it
                Status::Succeeded => Status::Canceled,
                other => other,
            },
            reason,
            ..MemberRow::default()
        }
    }
}

/// A member's number as u32, which is large enough.
fn number_of(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

/// An event of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SweepEvent {
    /// The number of the event: it counts from 1 without gaps, across restarts.
    pub seq: i64,
    /// The time of the event.
    pub t: Time,
    /// The content of the event.
    #[serde(flatten)]
    pub payload: SweepPayload,
}

/// The content of an event of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema, strum::IntoStaticStr)]
#[serde(tag = "type", rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum SweepPayload {
    /// A member was solved, or failed.
    Member {
        /// The member's row.
        member: Box<MemberRow>,
    },
    /// All jobs of the sweep have ended; this is its last event. Members without an event were not reached.
    Done {
        /// The sweep in its final state.
        sweep: Box<Sweep>,
    },
}

/// The time limits of a job that solves this many members, if the client gives none: the limits of a single job, and
/// six more seconds for each further member, at most a week.
pub fn limits_for(members: usize) -> Limits {
    const EACH_S: f64 = 6.0;
    const MOST_S: f64 = 7.0 * 86_400.0;
    let limits = Limits::default();
    let more = members.saturating_sub(1) as f64;
    Limits {
        timeout_s: (limits.timeout_s + EACH_S * more).min(MOST_S),
        ..limits
    }
}
