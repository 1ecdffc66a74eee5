//! Every kind of error there is: of requests, and of jobs. The one source of HTTP status and gRPC code, of the
//! pages at `/v1/errors/{code}` and of `signorini explain`.

use schemars::JsonSchema;
use serde::Serialize;
use strum::{EnumString, IntoStaticStr, VariantArray};
use tonic::Code as Grpc;

/// What clients may rely on about a kind of error.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Kind {
    /// Its stable name.
    pub code: &'static str,
    /// One line, the same every time.
    pub title: &'static str,
    /// The HTTP status; none for what only jobs end with.
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

/// What a request may be answered with.
fn of_request(
    code: &'static str,
    title: &'static str,
    status: u16,
    grpc: Grpc,
    retry_after_s: Option<u64>,
    explanation: &'static str,
) -> Kind {
    Kind {
        code,
        title,
        status: Some(status),
        grpc: Some(grpc),
        retry_after_s,
        explanation,
    }
}

/// What only jobs end with.
fn of_job(code: &'static str, title: &'static str, explanation: &'static str) -> Kind {
    Kind {
        code,
        title,
        status: None,
        grpc: None,
        retry_after_s: None,
        explanation,
    }
}

/// Makes the enum of the kinds, and what is said of each, from one table.
macro_rules! catalog {
    ($($code:ident: $of:ident($($fact:expr),*),)*) => {
        /// The kinds, in the order of their HTTP statuses; then those that only jobs end with.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr, EnumString, VariantArray)]
        #[strum(serialize_all = "kebab-case")]
        #[allow(missing_docs)] // the table says of each what it is
        pub enum Code {
            $($code,)*
        }

        impl Code {
            /// What clients may rely on.
            pub fn kind(self) -> Kind {
                match self {
                    $(Code::$code => $of(self.into(), $($fact),*),)*
                }
            }
        }
    };
}

// What requests are answered with: title, HTTP status, gRPC code, seconds until a retry may succeed, explanation.
// What only jobs end with: title, explanation.
catalog! {
    MalformedJson: of_request("The body is not JSON", 400, Grpc::InvalidArgument, None,
        "The body could not be read as JSON, or broke off. `detail` names line and column. Numbers must be finite: NaN and Infinity are not JSON."),
    UnknownParameter: of_request("Unknown parameter", 400, Grpc::InvalidArgument, None,
        "The query has a parameter that this route does not know; it would have had no effect. `detail` lists those that there are."),
    BadParameter: of_request("A parameter has a wrong value", 400, Grpc::InvalidArgument, None,
        "A query parameter, header or field has a value that it cannot have. `detail` says what was expected."),
    BadPageToken: of_request("The page token is not ours", 400, Grpc::InvalidArgument, None,
        "A page token belongs to the list that gave it: the same filters and order. Start again without one."),
    MissingFilter: of_request("A filter is needed", 400, Grpc::InvalidArgument, None,
        "Canceling or deleting many jobs needs at least one filter, so that nobody does it to all by accident. To mean all, say so: status=queued,running,succeeded,failed,canceled."),
    NotFound: of_request("Not found", 404, Grpc::NotFound, None,
        "There is no such path, job, mesh, boundary or load step. Ids are written as they were given: job_ and a UUID in lower case."),
    NoResult: of_request("The job has no result", 404, Grpc::NotFound, None,
        "The job ended without anything to show: it failed before its first state, or was canceled. Its `failure` and its events say more."),
    MethodNotAllowed: of_request("Method not allowed", 405, Grpc::Unimplemented, None,
        "The path exists, but not with this method. The header Allow lists the methods that it has."),
    NotAcceptable: of_request("No such format", 406, Grpc::Unimplemented, None,
        "None of the formats asked for by `format` or `Accept` exists here. `detail` lists those that do."),
    JobActive: of_request("The job waits or runs", 409, Grpc::FailedPrecondition, None,
        "Only a job that has ended can be deleted or tried again, and only a mesh that no waiting or running job needs can be removed. Cancel the job, or wait for its end."),
    ResultNotReady: of_request("The result is not ready", 409, Grpc::FailedPrecondition, Some(1),
        "The job waits or runs, and has found nothing yet. Wait for it: GET /v1/jobs/{id}?wait=30&until=terminal, WaitJob, or its events."),
    IdConflict: of_request("The id belongs to another job", 409, Grpc::AlreadyExists, None,
        "A job of this id was handed in with other content. An id stands for one job; make a new one."),
    Deleted: of_request("The job was deleted", 410, Grpc::NotFound, None,
        "The job was deleted within the last 7 days, with its events and its result. After that its id is unknown."),
    StaleVersion: of_request("The job has changed", 412, Grpc::Aborted, None,
        "The job is no longer of the version named by If-Match. Get it again, and decide anew."),
    PayloadTooLarge: of_request("The body or message is too large", 413, Grpc::OutOfRange, None,
        "The body, or a message over gRPC, is larger than this service takes or gives. Upload a large mesh once (POST /v1/meshes or UploadMesh) and name it in the problem as mesh.stored."),
    ProblemTooLarge: of_request("The problem is too large", 413, Grpc::OutOfRange, None,
        "By the estimate, which comes with this error, the job would need more memory than it may. Use a coarser mesh or less refinement, or ask the operator for a larger budget."),
    UnsupportedMedia: of_request("Unsupported type of body", 415, Grpc::Unimplemented, None,
        "The body must be JSON, and say so: Content-Type: application/json."),
    RangeNotSatisfiable: of_request("The range lies outside", 416, Grpc::OutOfRange, None,
        "The range begins behind the end of the data. The header Content-Range of this answer has the length."),
    InvalidProblem: of_request("The problem, or what came with it, is invalid", 422, Grpc::InvalidArgument, None,
        "The problem, or the envelope around it, has violations. `errors` lists all of them: where (a JSON Pointer), what was found, what is expected, what to do. The schema is at /v1/schema/problem.json."),
    IdempotencyKeyReuse: of_request("The key was used for something else", 422, Grpc::AlreadyExists, None,
        "This Idempotency-Key (request_id) was used before, with another payload. One key stands for one request; use a new one."),
    RateLimited: of_request("Too much at once", 429, Grpc::ResourceExhausted, Some(1),
        "More is asked at the same time than can be answered soon, mostly lists and counts. Ask less often, or follow jobs by their events."),
    Internal: of_request("Internal error", 500, Grpc::Internal, Some(1),
        "Something unexpected happened, and it is our fault. The cause is in the service's log under the incident's number; please report it."),
    QueueFull: of_request("The queue is full", 503, Grpc::Unavailable, Some(10),
        "As many jobs wait as may. Reading, watching and canceling go on. Try again when some have run."),
    Draining: of_request("The service is stopping", 503, Grpc::Unavailable, Some(5),
        "The service takes no more jobs, since it is about to stop or restart. Accepted jobs are kept. Try again."),
    StorageFull: of_request("The disk is full", 507, Grpc::ResourceExhausted, Some(60),
        "Nothing can be stored. Reading goes on, and what runs waits; the operator can make room."),
    NotConverged: of_job("The iteration did not converge",
        "max_iterations was reached with a residual above the tolerance. The last state and the whole history are kept, as a partial result. Look at the convergence plot: refine the mesh, raise elastic_slip, apply the load in more increments, or choose algorithm auto."),
    ContactCycling: of_job("The contact set repeats itself without settling",
        "The iteration visits the same contact sets again and again. Algorithm auto does not do this; the thesis's own iteration may, and relaxation helps it."),
    FalseConvergence: of_job("The iteration settled, but not in a solution",
        "The method's own test was met, but the true residual is above the tolerance: the state is no solution. Use another algorithm."),
    SingularSystem: of_job("The stiffness matrix is singular",
        "The body can move without a force: its supports and contacts do not hold it. `detail` names node and direction."),
    NonFinite: of_job("A number that is not finite came up",
        "A NaN or an infinity arose; the input's numbers are too large or too small beside each other."),
    TimedOut: of_job("The job ran longer than it may",
        "It was stopped after limits.timeout_s. What it had found is kept as a partial result. Retry it with a longer time (a body {\"limits\": {\"timeout_s\": …}}), or make the problem smaller."),
    QueueExpired: of_job("The job waited longer than it may",
        "It was not started within limits.queue_ttl_s: all workers were busy, or the queue was paused. Retry it, with a higher priority or a longer time (a body {\"priority\": …, \"limits\": {\"queue_ttl_s\": …}})."),
    ResourceExhausted: of_job("The job needs more than there is",
        "Memory ran out while it was solved, in spite of the estimate. Use a coarser mesh."),
    WorkerLost: of_job("The worker was lost once too often",
        "The process died during each of max_attempts starts of this job. Others go on. If it is the job that kills it, please report it."),
    UserCancel: of_job("The job was canceled",
        "Somebody asked for it."),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_is_found_by_its_name() {
        for code in Code::VARIANTS {
            assert_eq!(code.kind().code.parse(), Ok(*code));
        }
        assert_eq!(
            Code::IdempotencyKeyReuse.kind().code,
            "idempotency-key-reuse"
        );
    }
}
