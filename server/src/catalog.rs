//! Every kind of error there is: of requests, and of jobs. The one source of HTTP status and gRPC code, of the
//! pages at `/v1/errors/{code}` and of `signorini explain`.

use schemars::JsonSchema;
use serde::Serialize;
use tonic::Code as Grpc;

/// The kinds, in the order of their HTTP statuses; then what jobs fail of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)] // `kind` says of each what it is
pub enum Code {
    MalformedJson,
    UnknownParameter,
    BadParameter,
    BadPageToken,
    MissingFilter,
    NotFound,
    NoResult,
    MethodNotAllowed,
    NotAcceptable,
    JobActive,
    ResultNotReady,
    IdConflict,
    Deleted,
    StaleVersion,
    PayloadTooLarge,
    ProblemTooLarge,
    UnsupportedMedia,
    RangeNotSatisfiable,
    InvalidProblem,
    IdempotencyKeyReuse,
    RateLimited,
    Internal,
    QueueFull,
    Draining,
    StorageFull,
    NotConverged,
    ContactCycling,
    FalseConvergence,
    SingularSystem,
    NonFinite,
    TimedOut,
    QueueExpired,
    ResourceExhausted,
    WorkerLost,
    UserCancel,
}

/// What clients may rely on about a kind of error.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Kind {
    /// Its stable name.
    pub code: &'static str,
    /// One line, the same every time.
    pub title: &'static str,
    /// The HTTP status; none for what only jobs fail of.
    pub status: Option<u16>,
    /// The gRPC code; likewise.
    #[serde(serialize_with = "grpc_name")]
    #[schemars(with = "Option<String>")]
    pub grpc: Option<Grpc>,
    /// Seconds after which the same request may succeed.
    pub retry_after_s: Option<u64>,
    /// What it means, and what to do.
    pub explanation: &'static str,
}

impl Kind {
    /// The same request may succeed later.
    pub fn retryable(&self) -> bool {
        self.retry_after_s.is_some()
    }

    /// How it is told over either protocol, and whether it may pass: sentences for people.
    pub fn facts(&self) -> Vec<String> {
        let told = self
            .status
            .zip(self.grpc)
            .map(|(status, grpc)| format!("HTTP {status}, gRPC {}.", grpc_code_name(grpc)));
        let passes = self.retry_after_s.map(|seconds| {
            format!("It may pass by itself: the same request may succeed after {seconds} s.")
        });
        told.into_iter().chain(passes).collect()
    }
}

/// The name of a gRPC code as its specification spells it.
pub fn grpc_code_name(code: Grpc) -> &'static str {
    match code {
        Grpc::Ok => "OK",
        Grpc::Cancelled => "CANCELLED",
        Grpc::Unknown => "UNKNOWN",
        Grpc::InvalidArgument => "INVALID_ARGUMENT",
        Grpc::DeadlineExceeded => "DEADLINE_EXCEEDED",
        Grpc::NotFound => "NOT_FOUND",
        Grpc::AlreadyExists => "ALREADY_EXISTS",
        Grpc::PermissionDenied => "PERMISSION_DENIED",
        Grpc::ResourceExhausted => "RESOURCE_EXHAUSTED",
        Grpc::FailedPrecondition => "FAILED_PRECONDITION",
        Grpc::Aborted => "ABORTED",
        Grpc::OutOfRange => "OUT_OF_RANGE",
        Grpc::Unimplemented => "UNIMPLEMENTED",
        Grpc::Internal => "INTERNAL",
        Grpc::Unavailable => "UNAVAILABLE",
        Grpc::DataLoss => "DATA_LOSS",
        Grpc::Unauthenticated => "UNAUTHENTICATED",
    }
}

fn grpc_name<S: serde::Serializer>(code: &Option<Grpc>, serializer: S) -> Result<S::Ok, S::Error> {
    code.map(grpc_code_name).serialize(serializer)
}

impl Code {
    /// All of them.
    pub const ALL: [Code; 35] = [
        Code::MalformedJson,
        Code::UnknownParameter,
        Code::BadParameter,
        Code::BadPageToken,
        Code::MissingFilter,
        Code::NotFound,
        Code::NoResult,
        Code::MethodNotAllowed,
        Code::NotAcceptable,
        Code::JobActive,
        Code::ResultNotReady,
        Code::IdConflict,
        Code::Deleted,
        Code::StaleVersion,
        Code::PayloadTooLarge,
        Code::ProblemTooLarge,
        Code::UnsupportedMedia,
        Code::RangeNotSatisfiable,
        Code::InvalidProblem,
        Code::IdempotencyKeyReuse,
        Code::RateLimited,
        Code::Internal,
        Code::QueueFull,
        Code::Draining,
        Code::StorageFull,
        Code::NotConverged,
        Code::ContactCycling,
        Code::FalseConvergence,
        Code::SingularSystem,
        Code::NonFinite,
        Code::TimedOut,
        Code::QueueExpired,
        Code::ResourceExhausted,
        Code::WorkerLost,
        Code::UserCancel,
    ];

    /// The kind of that name.
    pub fn parse(name: &str) -> Option<Code> {
        Code::ALL.into_iter().find(|code| code.kind().code == name)
    }

    /// What clients may rely on.
    #[rustfmt::skip]
    pub fn kind(self) -> Kind {
        let of_request = |code, title, status, grpc, retry_after_s, explanation| Kind {
            code, title, status: Some(status), grpc: Some(grpc), retry_after_s, explanation,
        };
        let of_job = |code, title, explanation| Kind {
            code, title, status: None, grpc: None, retry_after_s: None, explanation,
        };
        match self {
            Code::MalformedJson => of_request("malformed-json", "The body is not JSON", 400, Grpc::InvalidArgument, None,
                "The body could not be read as JSON, or broke off. `detail` names line and column. Numbers must be finite: NaN and Infinity are not JSON."),
            Code::UnknownParameter => of_request("unknown-parameter", "Unknown parameter", 400, Grpc::InvalidArgument, None,
                "The query has a parameter that this route does not know; it would have had no effect. `detail` lists those that there are."),
            Code::BadParameter => of_request("bad-parameter", "A parameter has a wrong value", 400, Grpc::InvalidArgument, None,
                "A query parameter, header or field has a value that it cannot have. `detail` says what was expected."),
            Code::BadPageToken => of_request("bad-page-token", "The page token is not ours", 400, Grpc::InvalidArgument, None,
                "A page token belongs to the list that gave it: the same filters and order. Start again without one."),
            Code::MissingFilter => of_request("missing-filter", "A filter is needed", 400, Grpc::InvalidArgument, None,
                "Canceling or deleting many jobs needs at least one filter, so that nobody does it to all by accident. To mean all, say so: status=queued,running,succeeded,failed,canceled."),
            Code::NotFound => of_request("not-found", "Not found", 404, Grpc::NotFound, None,
                "There is no such path, job, mesh, boundary or load step. Ids are written as they were given: job_ and a UUID in lower case."),
            Code::NoResult => of_request("no-result", "The job has no result", 404, Grpc::NotFound, None,
                "The job ended without anything to show: it failed before its first state, or was canceled. Its `failure` and its events say more."),
            Code::MethodNotAllowed => of_request("method-not-allowed", "Method not allowed", 405, Grpc::Unimplemented, None,
                "The path exists, but not with this method. The header Allow lists the methods that it has."),
            Code::NotAcceptable => of_request("not-acceptable", "No such format", 406, Grpc::Unimplemented, None,
                "None of the formats asked for by `format` or `Accept` exists here. `detail` lists those that do."),
            Code::JobActive => of_request("job-active", "The job waits or runs", 409, Grpc::FailedPrecondition, None,
                "Only a job that has ended can be deleted or tried again, and only a mesh that no waiting or running job needs can be removed. Cancel the job, or wait for its end."),
            Code::ResultNotReady => of_request("result-not-ready", "The result is not ready", 409, Grpc::FailedPrecondition, Some(1),
                "The job waits or runs, and has found nothing yet. Wait for it: GET /v1/jobs/{id}?wait=30&until=terminal, WaitJob, or its events."),
            Code::IdConflict => of_request("id-conflict", "The id belongs to another job", 409, Grpc::AlreadyExists, None,
                "A job of this id was handed in with other content. An id stands for one job; make a new one."),
            Code::Deleted => of_request("deleted", "The job was deleted", 410, Grpc::NotFound, None,
                "The job was deleted within the last 7 days, with its events and its result. After that its id is unknown."),
            Code::StaleVersion => of_request("stale-version", "The job has changed", 412, Grpc::Aborted, None,
                "The job is no longer of the version named by If-Match. Get it again, and decide anew."),
            Code::PayloadTooLarge => of_request("payload-too-large", "The body or message is too large", 413, Grpc::OutOfRange, None,
                "The body, or a message over gRPC, is larger than this service takes or gives. Upload a large mesh once (POST /v1/meshes or UploadMesh) and name it in the problem as mesh.stored."),
            Code::ProblemTooLarge => of_request("problem-too-large", "The problem is too large", 413, Grpc::OutOfRange, None,
                "By the estimate, which comes with this error, the job would need more memory than it may. Use a coarser mesh or less refinement, or ask the operator for a larger budget."),
            Code::UnsupportedMedia => of_request("unsupported-media", "Unsupported type of body", 415, Grpc::Unimplemented, None,
                "The body must be JSON, and say so: Content-Type: application/json."),
            Code::RangeNotSatisfiable => of_request("range-not-satisfiable", "The range lies outside", 416, Grpc::OutOfRange, None,
                "The range begins behind the end of the data. The header Content-Range of this answer has the length."),
            Code::InvalidProblem => of_request("invalid-problem", "The problem, or what came with it, is invalid", 422, Grpc::InvalidArgument, None,
                "The problem, or the envelope around it, has violations. `errors` lists all of them: where (a JSON Pointer), what was found, what is expected, what to do. The schema is at /v1/schema/problem.json."),
            Code::IdempotencyKeyReuse => of_request("idempotency-key-reuse", "The key was used for something else", 422, Grpc::AlreadyExists, None,
                "This Idempotency-Key (request_id) was used before, with another payload. One key stands for one request; use a new one."),
            Code::RateLimited => of_request("rate-limited", "Too much at once", 429, Grpc::ResourceExhausted, Some(1),
                "More is asked at the same time than can be answered soon, mostly lists and counts. Ask less often, or follow jobs by their events."),
            Code::Internal => of_request("internal", "Internal error", 500, Grpc::Internal, Some(1),
                "Something unexpected happened, and it is our fault. The cause is in the service's log under the incident's number; please report it."),
            Code::QueueFull => of_request("queue-full", "The queue is full", 503, Grpc::Unavailable, Some(10),
                "As many jobs wait as may. Reading, watching and canceling go on. Try again when some have run."),
            Code::Draining => of_request("draining", "The service is stopping", 503, Grpc::Unavailable, Some(5),
                "The service takes no more jobs, since it is about to stop or restart. Accepted jobs are kept. Try again."),
            Code::StorageFull => of_request("storage-full", "The disk is full", 507, Grpc::ResourceExhausted, Some(60),
                "Nothing can be stored. Reading goes on, and what runs waits; the operator can make room."),
            Code::NotConverged => of_job("not-converged", "The iteration did not converge",
                "max_iterations was reached with a residual above the tolerance. The last state and the whole history are kept, as a partial result. Look at the convergence plot: refine the mesh, raise elastic_slip, apply the load in more increments, or choose algorithm auto."),
            Code::ContactCycling => of_job("contact-cycling", "The contact set repeats itself without settling",
                "The iteration visits the same contact sets again and again. Algorithm auto does not do this; the thesis's own iteration may, and relaxation helps it."),
            Code::FalseConvergence => of_job("false-convergence", "The iteration settled, but not in a solution",
                "The method's own test was met, but the true residual is above the tolerance: the state is no solution. Use another algorithm."),
            Code::SingularSystem => of_job("singular-system", "The stiffness matrix is singular",
                "The body can move without a force: its supports and contacts do not hold it. `detail` names node and direction."),
            Code::NonFinite => of_job("non-finite", "A number that is not finite came up",
                "A NaN or an infinity arose; the input's numbers are too large or too small beside each other."),
            Code::TimedOut => of_job("timed-out", "The job ran longer than it may",
                "It was stopped after limits.timeout_s. What it had found is kept as a partial result. Retry it with a longer time (a body {\"limits\": {\"timeout_s\": …}}), or make the problem smaller."),
            Code::QueueExpired => of_job("queue-expired", "The job waited longer than it may",
                "It was not started within limits.queue_ttl_s: all workers were busy, or the queue was paused. Retry it, with a higher priority or a longer time (a body {\"priority\": …, \"limits\": {\"queue_ttl_s\": …}})."),
            Code::ResourceExhausted => of_job("resource-exhausted", "The job needs more than there is",
                "Memory ran out while it was solved, in spite of the estimate. Use a coarser mesh."),
            Code::WorkerLost => of_job("worker-lost", "The worker was lost once too often",
                "The process died during each of max_attempts starts of this job. Others go on. If it is the job that kills it, please report it."),
            Code::UserCancel => of_job("user-cancel", "The job was canceled",
                "Somebody asked for it."),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_has_one_name() {
        for (n, code) in Code::ALL.into_iter().enumerate() {
            assert_eq!(Code::parse(code.kind().code), Some(code));
            assert!(Code::ALL[..n].iter().all(|other| *other != code));
        }
    }
}
