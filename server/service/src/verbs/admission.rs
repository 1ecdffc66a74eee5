//! Admits a job whose request was read: the job is fingerprinted, checked in depth, and stored in the queue.

use base::{
    caller::Caller,
    digest,
    job::{Job, JobId, Limits},
    mesh::MeshInfo,
    metrics::METRICS,
};
use solver::{
    error::{Findings, Reason, Violation},
    mesh::Mesh,
    problem::Problem,
};
use store::{Accepted, NewJob, NewSweep, QueueLimits, RequestKey, StoreError, Submission};
use tracing::info;

use super::{
    envelope::{Envelope, JobRequest},
    meshes,
    problems::{self, Admitted},
    service::Service,
};
use crate::{
    error::{ApiError, Quota, QuotaOf},
    spans,
};

/// A job whose request was read, but that is not yet checked in depth.
pub(super) struct Prepared {
    envelope: Envelope,
    /// The problem with its fingerprint, or its violations.
    problem: Result<(Problem, String), Vec<Violation>>,
    violations: Findings,
    pub(super) id: Option<JobId>,
    /// The fingerprint of everything that was submitted; empty if the problem cannot be read. Such a job is always
    /// refused, and its own fingerprint is not compared.
    pub(super) payload: String,
}

impl Prepared {
    /// Computes the fingerprints of a job and of its problem once, since fingerprinting a large mesh takes half a
    /// second: call this on a blocking thread. `max_timeout_s`: the longest time that a job may run, in seconds.
    pub(super) fn new(
        JobRequest { envelope, problem }: JobRequest,
        id: Option<JobId>,
        max_timeout_s: u32,
    ) -> Result<Prepared, ApiError> {
        let violations = envelope.violations(max_timeout_s);
        let mut payload = String::new();
        let problem = match problem {
            Ok(problem) => {
                let input_hash = digest::input_hash(&problem).map_err(ApiError::internal)?;
                let submitted = (&envelope, &problem.title, &input_hash, id);
                payload = digest::of_json(&submitted).map_err(ApiError::internal)?;
                Ok((problem, input_hash))
            }
            Err(violations) => Err(violations),
        };
        Ok(Prepared {
            envelope,
            problem,
            violations,
            id,
            payload,
        })
    }

    /// Whether the job's problem refers to a stored mesh.
    pub(super) fn has_stored_mesh(&self) -> bool {
        let problem = self.problem.as_ref();
        problem.is_ok_and(|(problem, _)| problem.mesh.stored().is_some())
    }

    /// Checks the job in depth, on the stored mesh that its problem refers to, and within the memory budget (bytes): call this on
    /// a blocking thread.
    pub(super) fn check(
        self,
        stored: Option<(MeshInfo, Mesh)>,
        budget_bytes: u64,
    ) -> Result<NewJob, ApiError> {
        let Prepared {
            envelope,
            problem,
            mut violations,
            id,
            payload,
        } = self;
        let admitted = problem.and_then(|(problem, input_hash)| {
            match problems::admit(problem, stored, budget_bytes) {
                Err(ApiError::InvalidProblem(more)) => Err(more),
                admitted => Ok(admitted.map(|admitted| (admitted, input_hash))),
            }
        });
        let (admitted, input_hash) = match admitted {
            Ok(admitted) => admitted?,
            Err(more) => {
                violations.extend(more);
                return Err(ApiError::InvalidProblem(violations.into_violations()));
            }
        };
        violations.extend(time_violation(admitted.run_s, &envelope.limits));
        let admitted = violations.into_result(admitted);
        let Admitted {
            title,
            json,
            mesh,
            memory_bytes,
            run_s: _,
        } = admitted.map_err(ApiError::InvalidProblem)?;
        let Envelope {
            name,
            labels,
            priority,
            limits,
            cache,
        } = envelope;
        Ok(NewJob {
            id,
            name,
            labels,
            priority,
            limits,
            cache,
            parent: None,
            sweep: None,
            title,
            input_hash,
            problem: json,
            mesh,
            memory_bytes,
            payload,
        })
    }
}

/// Fingerprints a job that was read, on a blocking thread.
pub(super) async fn prepare(
    service: &Service,
    request: JobRequest,
    id: Option<JobId>,
) -> Result<Prepared, ApiError> {
    let max_timeout_s = service.config.max_timeout_s;
    let prepared = move || Prepared::new(request, id, max_timeout_s);
    service.work(prepared).await?
}

/// The jobs that this caller has submitted before with this idempotency key and the same request; `None` if there are
/// none.
pub(super) async fn replayed(
    service: &Service,
    caller: &Caller,
    key: Option<&RequestKey>,
) -> Result<Option<Vec<Job>>, ApiError> {
    match key {
        Some(key) if !key.payload.is_empty() => {
            Ok(service.store.replay(caller.owner(), key).await?)
        }
        _ => Ok(None),
    }
}

/// The largest ratio of a job's estimated time to its time limit: a solvable job must not be refused, and a fast
/// machine takes a third of the estimate or less (`tests/bench/estimates.py`).
const MOST_OVER: f64 = 10.0;

/// The violation of a job whose estimated time (seconds) is so long that it would only reach its time limit.
pub(super) fn time_violation(run_s: Option<f64>, limits: &Limits) -> Option<Violation> {
    let run_s = run_s?;
    (run_s > MOST_OVER * limits.timeout_s).then(|| {
        Violation::new(
            "/limits/timeout_s",
            Reason::OutOfRange,
            format!("{} s", limits.timeout_s),
            format!(
                "at least {} s: the job is estimated to take {} s",
                rounded_up(run_s / MOST_OVER),
                rounded_up(run_s)
            ),
            "Raise this limit to the estimated time, or use a coarser mesh, less refinement or fewer increments.",
        )
    })
}

/// A positive number as a decimal, rounded up to two significant digits or to an integer: who gives a limit as printed is not
/// refused again.
fn rounded_up(number: f64) -> String {
    let magnitude = number.log10().floor().clamp(-9.0, 1.0);
    let decimals = (1.0 - magnitude) as usize;
    let scale = 10_f64.powi(decimals as i32);
    format!("{:.decimals$}", (number * scale).ceil() / scale)
}

/// Checks a job in depth, on the stored mesh that its problem refers to, if it does.
pub(super) async fn admit(
    service: &Service,
    caller: &Caller,
    prepared: Prepared,
) -> Result<NewJob, ApiError> {
    let budget_bytes = service.largest_job_bytes();
    let stored = match &prepared.problem {
        Ok((problem, _)) => problems::stored(service, caller, problem).await,
        Err(_) => Ok(None),
    };
    match stored {
        Ok(stored) => {
            let check = move || prepared.check(stored, budget_bytes);
            service.work(check).await?
        }
        Err(ApiError::InvalidProblem(more)) => {
            let mut violations = prepared.violations;
            violations.extend(more);
            Err(ApiError::InvalidProblem(violations.into_violations()))
        }
        Err(other) => Err(other),
    }
}

/// Refuses priorities above 0, which put a job before those of all other owners, unless the caller is an administrator.
pub(super) fn may_have_priorities(
    caller: &Caller,
    mut priorities: impl Iterator<Item = i32>,
) -> Result<(), ApiError> {
    if priorities.any(|priority| priority > 0) && !caller.is_admin() {
        Err(ApiError::Forbidden(
            "a priority above 0 needs the scope admin: it puts a job before those of all other owners"
                .into(),
        ))
    } else {
        Ok(())
    }
}

/// Refuses a caller whose limits of stored bytes and of submissions do not permit `asked` more jobs, before these are
/// meshed and checked, which takes processor time from others. The limit of queued jobs is not checked here, since a
/// job with an earlier result is not queued.
pub(super) async fn has_share(
    service: &Service,
    caller: &Caller,
    asked: usize,
) -> Result<(), ApiError> {
    service.may_keep_more(caller.owner()).await?;
    let left = service.rates().and_then(|rates| rates.left(caller.owner()));
    match left {
        Some(left) if left < asked as u64 => Err(too_often(service, caller, left, asked as u64)),
        _ => Ok(()),
    }
}

/// The error for a caller who has `left` jobs left in this minute and submits `asked` jobs.
fn too_often(service: &Service, caller: &Caller, left: u64, asked: u64) -> ApiError {
    let per_minute = service.rates().and_then(|rates| rates.per_minute);
    let limit = u64::from(per_minute.unwrap_or_default());
    ApiError::QuotaExceeded(Quota {
        owner: caller.owner().to_owned(),
        of: QuotaOf::Submissions,
        limit,
        used: limit.saturating_sub(left),
        asked,
    })
}

/// Stores jobs in the queue, all or none, with the caller as their owner.
pub(super) async fn enqueue(
    service: &Service,
    caller: &Caller,
    jobs: Vec<NewJob>,
    key: Option<RequestKey>,
) -> Result<Accepted, ApiError> {
    enqueue_sweep(service, caller, jobs, None, key).await
}

/// Stores the jobs of a sweep in the queue, together with the sweep, all or none.
pub(super) async fn enqueue_sweep(
    service: &Service,
    caller: &Caller,
    jobs: Vec<NewJob>,
    sweep: Option<NewSweep>,
    key: Option<RequestKey>,
) -> Result<Accepted, ApiError> {
    may_have_priorities(caller, jobs.iter().map(|job| job.priority))?;
    let limit = service.config.max_queued;
    let asked = jobs.len() as u64;
    service.may_keep_more(caller.owner()).await?;
    if let Some(rates) = service.rates()
        && let Err(left) = rates.take(caller.owner(), asked)
    {
        return Err(too_often(service, caller, left, asked));
    }
    let most_of_owner = service.max_queued_of_owner();
    let hash = jobs.iter().find_map(|job| job.mesh.clone());
    let submission = Submission {
        owner: caller.owner().to_owned(),
        jobs,
        sweep,
        key,
        limits: QueueLimits {
            queued: limit,
            queued_of_owner: most_of_owner,
        },
    };
    let accepted = service.queue.submit(submission).await;
    if !accepted.as_ref().is_ok_and(|accepted| !accepted.replayed)
        && let Some(rates) = service.rates()
    {
        rates.give_back(caller.owner(), asked);
    }
    let used = match accepted {
        Err(StoreError::OwnerQueueFull) => service.store.load_of(caller.owner()).await?.queued,
        _ => 0,
    };
    let accepted = accepted.map_err(|error| match error {
        StoreError::QueueFull => ApiError::QueueFull {
            limit,
            paused: service.store.is_paused(),
        },
        StoreError::OwnerQueueFull => ApiError::QuotaExceeded(Quota {
            owner: caller.owner().to_owned(),
            of: QuotaOf::Queued,
            limit: most_of_owner.unwrap_or(limit).into(),
            used,
            asked,
        }),
        // it was stored when the problem was checked, and has been deleted since
        StoreError::UnknownMesh => {
            ApiError::InvalidProblem(vec![meshes::missing(&hash.unwrap_or_default())])
        }
        other => other.into(),
    })?;
    if !accepted.replayed {
        for job in &accepted.jobs {
            METRICS.job_accepted(match (&job.cached_from, job.coalesced_into) {
                (Some(_), _) => "earlier_result",
                (None, Some(_)) => "running_job",
                (None, None) => "solver",
            });
        }
        if let Some(trace) = caller.trace().filter(|_| spans::are_wanted()) {
            service.queue.remember_origin(&accepted.jobs, trace);
        }
    }
    if !accepted.replayed {
        log(&accepted.jobs, caller);
    }
    Ok(accepted)
}

/// Logs that jobs were accepted.
fn log(jobs: &[Job], caller: &Caller) {
    let (owner, request_id) = (caller.owner(), caller.request_id());
    if let Some(id) = jobs.iter().find_map(|job| job.sweep) {
        let jobs = jobs.len();
        info!(sweep.id = %id, jobs, owner, request_id, "sweep {id} of {owner} accepted: {jobs} jobs");
        return;
    }
    for job in jobs {
        info!(job.id = %job.id, job.input_hash, owner, request_id, "job {} of {owner} accepted", job.id);
    }
}
