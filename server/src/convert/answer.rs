//! Our answers as messages.

use std::collections::BTreeMap;

use files::MeshFormat;
use prost_types::Timestamp;
use solver::{
    error::Violation,
    problem::NormalOf,
    solution::{
        Comparison, ContactProfile, ContactSummary, ErrorEstimate, Iteration, NodeState, Outcome,
        Peak, Refinement, Residuals, Warning,
    },
};

use strum::VariantArray;

use crate::{
    caller::Caller,
    event::{Event, Payload},
    job::{Failure, Job, Progress, QueuePosition, ResultAvailable, Status},
    mesh::{BoundaryInfo, MeshInfo},
    pb,
    run::{Summary, phase_name},
    time::Time,
    verbs::{
        info::{Info, ServiceLimits},
        jobs::Cancellation,
        problems::Validation,
        queue::QueueState,
        results::{JobResult, StepResult},
    },
};

/// A status as the contract numbers it.
pub fn pb_status(status: Status) -> pb::Status {
    match status {
        Status::Queued => pb::Status::Queued,
        Status::Running => pb::Status::Running,
        Status::Succeeded => pb::Status::Succeeded,
        Status::Failed => pb::Status::Failed,
        Status::Canceled => pb::Status::Canceled,
    }
}

/// The status of that number, if there is one.
pub fn status(number: i32) -> Option<Status> {
    let mut all = Status::VARIANTS.iter().copied();
    all.find(|status| pb_status(*status) as i32 == number)
}

impl From<Time> for Timestamp {
    fn from(time: Time) -> Self {
        let (seconds, micros) = (
            time.micros().div_euclid(1_000_000),
            time.micros().rem_euclid(1_000_000),
        );
        Timestamp {
            seconds,
            nanos: micros as i32 * 1000,
        }
    }
}

impl From<Job> for pb::Job {
    fn from(job: Job) -> Self {
        pb::Job {
            id: job.id.to_string(),
            status: pb_status(job.status).into(),
            reason: job.reason.map(|reason| <&str>::from(reason).into()),
            cancel_requested: job.cancel_requested,
            version: job.version,
            name: job.name,
            labels: job.labels,
            owner: job.owner,
            priority: job.priority,
            attempt: job.attempt,
            max_attempts: job.max_attempts,
            input_hash: job.input_hash,
            created_at: Some(job.created_at.into()),
            started_at: job.started_at.map(Into::into),
            finished_at: job.finished_at.map(Into::into),
            queue_wait_s: job.queue_wait_s,
            run_s: job.run_s,
            queue: job.queue.map(
                |QueuePosition {
                     position,
                     ahead,
                     reason,
                 }| pb::QueuePosition {
                    position,
                    ahead,
                    reason: <&str>::from(reason).into(),
                },
            ),
            progress: job.progress.map(
                |Progress {
                     stage,
                     iteration,
                     residual,
                     tolerance,
                     contact_changes,
                     rate,
                     eta_s,
                 }| pb::JobProgress {
                    stage,
                    iteration,
                    residual,
                    tolerance,
                    contact_changes,
                    rate,
                    eta_s,
                },
            ),
            failure: job.failure.map(
                |Failure {
                     r#type,
                     code,
                     title,
                     detail,
                 }| pb::Failure {
                    r#type,
                    code,
                    title,
                    detail,
                },
            ),
            result_available: pb::ResultAvailable::from(job.result_available).into(),
            cached_from: job.cached_from.map(|id| id.to_string()),
            parent: job.parent.map(|id| id.to_string()),
            pinned: job.pinned,
            limits: Some(pb::Limits {
                timeout_s: Some(job.limits.timeout_s),
                queue_ttl_s: Some(job.limits.queue_ttl_s),
            }),
        }
    }
}

impl From<QueueState> for pb::QueueState {
    fn from(state: QueueState) -> Self {
        let QueueState {
            paused,
            queued,
            running,
            workers,
            idle,
            max_queued,
        } = state;
        pb::QueueState {
            paused,
            queued,
            running,
            workers,
            idle,
            max_queued,
        }
    }
}

impl From<Info> for pb::ServerInfo {
    fn from(info: Info) -> Self {
        let ServiceLimits {
            max_body_bytes,
            max_mesh_bytes,
            memory_budget_bytes,
            max_queued,
            max_batch,
            max_page_size,
            max_wait_s,
        } = info.limits;
        pb::ServerInfo {
            name: info.name,
            version: info.version,
            api_version: info.api_version,
            workers: info.workers,
            limits: Some(pb::ServiceLimits {
                max_body_bytes,
                max_mesh_bytes,
                memory_budget_bytes,
                max_queued,
                max_batch,
                max_page_size,
                max_wait_s,
            }),
            table_formats: info.table_formats,
            field_formats: info.field_formats,
        }
    }
}

impl From<Caller> for pb::Caller {
    fn from(caller: Caller) -> Self {
        let scopes = caller.scopes().map(<&str>::from);
        pb::Caller {
            owner: caller.owner().to_owned(),
            scopes: scopes.map(str::to_owned).collect(),
        }
    }
}

impl From<Cancellation> for pb::cancel_job_response::Outcome {
    fn from(outcome: Cancellation) -> Self {
        match outcome {
            Cancellation::Canceled => Self::Canceled,
            Cancellation::CancelRequested => Self::CancelRequested,
            Cancellation::AlreadyTerminal => Self::AlreadyTerminal,
        }
    }
}

impl From<Event> for pb::Event {
    fn from(event: Event) -> Self {
        use pb::event::Payload as Out;
        let payload = match event.payload {
            Payload::Status { status, reason } => Out::Status(pb::StatusEvent {
                status: pb_status(status).into(),
                reason,
            }),
            Payload::Stage { stage } => Out::Stage(pb::StageEvent {
                stage: phase_name(stage).into(),
            }),
            Payload::Iteration(row) => Out::Iteration(row.into()),
            Payload::Warning(warning) => Out::Warning(warning.into()),
            Payload::Done { job } => Out::Done(pb::DoneEvent {
                job: Some((*job).into()),
            }),
        };
        pb::Event {
            seq: event.seq,
            attempt: event.attempt,
            t: Some(event.t.into()),
            payload: Some(payload),
        }
    }
}

impl From<Iteration> for pb::Iteration {
    fn from(row: Iteration) -> Self {
        pb::Iteration {
            k: row.k,
            stage: row.stage.as_str().into(),
            step: row.step,
            increment: row.increment,
            residual: row.residual,
            friction_residual: row.friction_residual,
            r_f: row.r_f,
            tolerance: row.tolerance,
            active: row.contact.active,
            entered: row.contact.entered,
            left: row.contact.left,
            slip: row.friction.slip,
            stick: row.friction.stick,
            normal_force: row.force.normal,
            tangential_force: row.force.tangential,
            contraction: row.contraction,
            inner: row.inner,
            wall_s: row.wall_s,
        }
    }
}

impl From<MeshInfo> for pb::MeshInfo {
    fn from(mesh: MeshInfo) -> Self {
        let MeshInfo {
            hash,
            format,
            bytes,
            nodes,
            quadrilaterals,
            triangles,
            dofs,
            extent: [x, y],
            boundaries,
            groups,
            node_sets,
            quality,
            warnings,
            created_at,
        } = mesh;
        let format = match format {
            MeshFormat::Gmsh => pb::MeshFormat::Gmsh,
            MeshFormat::Abaqus => pb::MeshFormat::Abaqus,
            MeshFormat::Json => pb::MeshFormat::Json,
        };
        let range = |[start, end]: [f64; 2]| pb::Range { start, end };
        let boundary =
            |(name, BoundaryInfo { edges, length })| (name, pb::BoundaryInfo { edges, length });
        pb::MeshInfo {
            hash,
            format: format.into(),
            bytes,
            nodes,
            quadrilaterals,
            triangles,
            dofs,
            extent_x: Some(range(x)),
            extent_y: Some(range(y)),
            boundaries: boundaries.into_iter().map(boundary).collect(),
            groups,
            node_sets,
            quality: Some(pb::MeshQuality {
                least_jacobian_ratio: quality.least_jacobian_ratio,
                worst_element: quality.worst_element,
            }),
            warnings: warnings.into_iter().map(Into::into).collect(),
            created_at: Some(created_at.into()),
        }
    }
}

impl From<Warning> for pb::Warning {
    fn from(
        Warning {
            code,
            pointer,
            message,
        }: Warning,
    ) -> Self {
        pb::Warning {
            code,
            pointer,
            message,
        }
    }
}

impl From<Violation> for pb::Violation {
    fn from(
        Violation {
            pointer,
            reason,
            got,
            expected,
            hint,
        }: Violation,
    ) -> Self {
        pb::Violation {
            pointer,
            reason,
            got,
            expected,
            hint,
        }
    }
}

/// What there is to say about a problem.
pub fn validation(validation: Validation) -> pb::ValidateProblemResponse {
    pb::ValidateProblemResponse {
        valid: validation.valid,
        violations: validation.violations.into_iter().map(Into::into).collect(),
        warnings: validation.warnings.into_iter().map(Into::into).collect(),
        estimate: validation.estimate.map(|estimate| pb::Estimate {
            dofs: estimate.dofs,
            memory_bytes: estimate.memory_bytes,
            run_s: estimate.run_s,
        }),
        input_hash: validation.input_hash,
    }
}

impl From<Summary> for pb::Summary {
    fn from(summary: Summary) -> Self {
        let Summary {
            solution,
            timings,
            solver_version,
            input_hash,
            digest,
        } = summary;
        pb::Summary {
            timings,
            solver_version,
            input_hash,
            digest,
            ..solution.into()
        }
    }
}

impl From<ResultAvailable> for pb::ResultAvailable {
    fn from(available: ResultAvailable) -> Self {
        match available {
            ResultAvailable::None => pb::ResultAvailable::None,
            ResultAvailable::Partial => pb::ResultAvailable::Partial,
            ResultAvailable::Final => pb::ResultAvailable::Final,
        }
    }
}

impl From<JobResult> for pb::Result {
    fn from(result: JobResult) -> Self {
        let JobResult {
            result_available,
            summary,
            steps,
        } = result;
        pb::Result {
            summary: Some(summary.into()),
            steps: steps.into_iter().map(Into::into).collect(),
            result_available: pb::ResultAvailable::from(result_available).into(),
        }
    }
}

impl From<StepResult> for pb::StepResult {
    fn from(StepResult { name, summary }: StepResult) -> Self {
        pb::StepResult {
            name,
            summary: Some(summary.into()),
        }
    }
}

impl From<solver::solution::Summary> for pb::Summary {
    fn from(solution: solver::solution::Summary) -> Self {
        let outcome = match solution.outcome {
            Outcome::Converged => pb::Outcome::Converged,
            Outcome::NotConverged => pb::Outcome::NotConverged,
            Outcome::ContactCycling => pb::Outcome::ContactCycling,
            Outcome::FalseConvergence => pb::Outcome::FalseConvergence,
            Outcome::Canceled => pb::Outcome::Canceled,
        };
        let contacts: BTreeMap<String, pb::ContactSummary> = solution
            .contacts
            .into_iter()
            .map(|(name, contact)| (name, contact.into()))
            .collect();
        let Residuals {
            kkt,
            friction,
            monolithic,
            equilibrium,
        } = solution.residuals;
        let ErrorEstimate {
            error,
            energy_norm,
            relative,
        } = solution.error_estimate;
        pb::Summary {
            outcome: outcome.into(),
            converged: solution.converged,
            normal_force: solution.normal_force,
            tangential_force: solution.tangential_force,
            friction_force: solution.friction_force,
            contacts,
            iterations: solution.iterations,
            stage: solution.stage.as_str().into(),
            contraction: solution.contraction,
            residuals: Some(pb::Residuals {
                kkt,
                friction,
                monolithic,
                equilibrium,
            }),
            energy: solution.energy,
            friction_work: solution.friction_work,
            error_estimate: Some(pb::ErrorEstimate {
                error,
                energy_norm,
                relative,
            }),
            increments: solution.increments,
            cut_backs: solution.cut_backs,
            uniqueness: solution.uniqueness.map(Into::into),
            doubled_increments: solution.doubled_increments.map(Into::into),
            refinements: solution.refinements.into_iter().map(Into::into).collect(),
            warnings: solution.warnings.into_iter().map(Into::into).collect(),
            dofs: solution.dofs,
            contact_dofs: solution.contact_dofs,
            ..Default::default()
        }
    }
}

impl From<Comparison> for pb::Comparison {
    fn from(second: Comparison) -> Self {
        let Comparison {
            agrees,
            converged,
            normal_force,
            tangential_force,
            friction_force,
            change,
        } = second;
        pb::Comparison {
            agrees,
            converged,
            normal_force,
            tangential_force,
            friction_force,
            change,
        }
    }
}

impl From<Refinement> for pb::Refinement {
    fn from(mesh: Refinement) -> Self {
        let Refinement {
            elements,
            dofs,
            normal_force,
            tangential_force,
            friction_force,
            peak_tangential_stress,
            peak_normal_stress,
            change,
        } = mesh;
        pb::Refinement {
            elements,
            dofs,
            normal_force,
            tangential_force,
            friction_force,
            peak_tangential_stress,
            peak_normal_stress,
            change,
        }
    }
}

impl From<ContactSummary> for pb::ContactSummary {
    fn from(contact: ContactSummary) -> Self {
        let ranges = |ranges: Vec<[f64; 2]>| {
            ranges
                .into_iter()
                .map(|[start, end]| pb::Range { start, end })
                .collect()
        };
        let peak = |Peak { value, s, x, y }: Peak| pb::Peak { value, s, x, y };
        let normal = match contact.normal {
            NormalOf::Body => pb::NormalOf::Body,
            NormalOf::Obstacle => pb::NormalOf::Obstacle,
        };
        pb::ContactSummary {
            normal: normal.into(),
            normal_force: contact.normal_force,
            tangential_force: contact.tangential_force,
            friction_force: contact.friction_force,
            contact: ranges(contact.contact),
            stick: ranges(contact.stick),
            slip: ranges(contact.slip),
            peak_normal_stress: contact.peak_normal_stress.map(peak),
            peak_tangential_stress: contact.peak_tangential_stress.map(peak),
        }
    }
}

impl From<ContactProfile> for pb::ContactProfile {
    fn from(profile: ContactProfile) -> Self {
        let state = |state: NodeState| match state {
            NodeState::Open => pb::NodeState::Open as i32,
            NodeState::Stick => pb::NodeState::Stick as i32,
            NodeState::Slip => pb::NodeState::Slip as i32,
        };
        pb::ContactProfile {
            s: profile.s,
            x: profile.x,
            y: profile.y,
            gap: profile.gap,
            normal_displacement: profile.normal_displacement,
            tangential_displacement: profile.tangential_displacement,
            normal_stress: profile.normal_stress,
            tangential_stress: profile.tangential_stress,
            nonlocal_pressure: profile.nonlocal_pressure,
            friction_bound: profile.friction_bound,
            friction_ratio: profile.friction_ratio,
            state: profile.state.into_iter().map(state).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statuses_keep_their_numbers_and_zero_is_none() {
        assert!(
            Status::VARIANTS
                .iter()
                .all(|s| status(pb_status(*s) as i32) == Some(*s))
        );
        assert_eq!(status(0), None);
        assert_eq!(status(17), None);
    }

    #[test]
    fn a_time_before_1970_keeps_its_nanoseconds_positive() {
        let stamp = Timestamp::from(Time::from_micros(-1));
        assert_eq!((stamp.seconds, stamp.nanos), (-1, 999_999_000));
    }
}
