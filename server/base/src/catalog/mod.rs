//! All kinds of errors, of requests and of jobs: the only source of HTTP status and gRPC code, of the pages at
//! `/v1/errors/{code}` and of `signorini explain`. Also the warnings of results (`warnings`).

mod warnings;

use schemars::JsonSchema;
use serde::Serialize;
use strum::{EnumString, IntoStaticStr, VariantArray};
use tonic::Code as Grpc;

use crate::address::link;

pub use warnings::{WarningKind, warning};

/// The stable facts about a kind of error.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Kind {
    /// The stable name of the kind.
    pub code: &'static str,
    /// The title: one line, the same for every error of the kind.
    pub title: &'static str,
    /// The HTTP status; absent for a reason that only jobs end with.
    pub status: Option<u16>,
    /// The gRPC code; absent for a reason that only jobs end with.
    #[serde(serialize_with = "grpc_name")]
    #[schemars(with = "Option<String>")]
    pub grpc: Option<Grpc>,
    /// Seconds after which the same request may succeed.
    pub retry_after_s: Option<u64>,
    /// The meaning, and what to do.
    pub explanation: &'static str,
}

/// The address where the service explains a kind of error.
pub fn explained_at(code: &str) -> String {
    link(&format!("/v1/errors/{code}"))
}

impl Kind {
    /// Whether the same request may succeed later.
    pub fn retryable(&self) -> bool {
        self.retry_after_s.is_some()
    }

    /// The status over either protocol, and whether the error is temporary, in sentences for people.
    pub fn facts(&self) -> Vec<String> {
        let status = self
            .status
            .zip(self.grpc)
            .map(|(status, grpc)| format!("HTTP {status}, gRPC {}.", grpc_code_name(grpc)));
        let temporary = self.retry_after_s.map(|seconds| {
            format!("It is temporary: the same request may succeed after {seconds} s.")
        });
        status.into_iter().chain(temporary).collect()
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

/// A kind of error that a response to a request may have.
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

/// A reason that only jobs end with.
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

/// Makes the enum of the kinds, and the facts about each, from one table.
macro_rules! catalog {
    ($($code:ident: $of:ident($($fact:expr),*),)*) => {
        /// The kinds of errors in the order of their HTTP statuses, followed by the reasons that only jobs end with.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr, EnumString, VariantArray)]
        #[strum(serialize_all = "kebab-case")]
        #[allow(missing_docs)] // the table explains each
        pub enum Code {
            $($code,)*
        }

        impl Code {
            /// The stable facts about this kind.
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
        "The body could not be read as JSON, or is incomplete. `detail` gives line and column. Numbers must be finite: NaN and Infinity are not JSON."),
    UnknownParameter: of_request("Unknown parameter", 400, Grpc::InvalidArgument, None,
        "The query has a parameter that this operation does not have and would ignore. `detail` lists the parameters of the operation."),
    BadParameter: of_request("Invalid parameter value", 400, Grpc::InvalidArgument, None,
        "A query parameter, header or field has an invalid value. `detail` gives the expected values."),
    BadPageToken: of_request("Invalid page token", 400, Grpc::InvalidArgument, None,
        "A page token is valid only for the list that returned it, with the same filters and order. Start again without one."),
    MissingFilter: of_request("A filter is required", 400, Grpc::InvalidArgument, None,
        "Canceling or deleting many jobs requires at least one filter, so that nobody cancels or deletes all jobs by accident. To select all jobs, write status=queued,running,succeeded,failed,canceled."),
    BadRequest: of_request("The request is malformed", 400, Grpc::InvalidArgument, None,
        "The request cannot be read: it is not HTTP, or has no Host header or several, or its message over gRPC is not what the contract defines. `detail` says what is wrong."),
    Unauthenticated: of_request("A valid token is required", 401, Grpc::Unauthenticated, None,
        "The request has no token, or one that is unknown, was revoked or has expired. Send it as `Authorization: Bearer TOKEN` (metadata `authorization` over gRPC); a browser that asks for a name and a password takes the token as the password. An administrator creates tokens: `signorini token create`."),
    Forbidden: of_request("Not allowed", 403, Grpc::PermissionDenied, None,
        "`detail` gives the cause, one of: the caller lacks the scope of the operation; a priority above 0 was requested without the scope admin; the request comes from a web page of another origin; the request names a host that this service does not answer for. An administrator gives scopes (`signorini token create --scope`, or --proxy-scopes for users whom a proxy names), and sets --allowed-host and --allowed-origin."),
    NotFound: of_request("Not found", 404, Grpc::NotFound, None,
        "There is no such path, job, mesh, boundary or load step. Ids must be written as they were returned: job_ and a UUID in lower case."),
    NoResult: of_request("The job has no result", 404, Grpc::NotFound, None,
        "The job ended without a result: it failed before there was a first state, or was canceled. See its `failure` and its events."),
    MethodNotAllowed: of_request("Method not allowed", 405, Grpc::Unimplemented, None,
        "The path exists, but not with this method. The Allow header lists its methods."),
    NotAcceptable: of_request("Format not available", 406, Grpc::Unimplemented, None,
        "None of the formats requested by `format` or `Accept` is available here. `detail` lists the available formats."),
    RequestTimeout: of_request("The request took too long to arrive", 408, Grpc::DeadlineExceeded, Some(1),
        "The body arrived too slowly: nothing for a minute, or less than 4 KiB a second on average. Send it again."),
    JobActive: of_request("The job is queued or running", 409, Grpc::FailedPrecondition, None,
        "Only a job that has ended can be deleted or retried, and only a mesh that no queued or running job uses can be deleted. Cancel the job, or wait for its end."),
    ResultNotReady: of_request("The result is not ready", 409, Grpc::FailedPrecondition, Some(1),
        "The job is queued or running and has no result yet. Wait for it: GET /v1/jobs/{id}?wait=30&until=terminal, WaitJob, or its events."),
    PartialResult: of_request("The job has no solution, only the state at which it stopped", 409, Grpc::FailedPrecondition, None,
        "The job failed or was canceled; `failure` says why. Its profiles, history, fields and figures show the state at which it stopped, which is not a solution of the problem, so they are served only to those who ask for that: with the parameter partial=true (field `partial` over gRPC, --partial on the command line, partial=True in Python). The result document is served without it, since it says itself that the job has not converged. To get a solution, see what the failure advises, and submit the problem again."),
    IdConflict: of_request("The id belongs to another job", 409, Grpc::AlreadyExists, None,
        "A job with this id was submitted with other content. An id belongs to one job; use a new one."),
    Deleted: of_request("The job or sweep was deleted", 410, Grpc::NotFound, None,
        "The job or sweep was deleted within the last 7 days, with its events and its results. After that, or after 100,000 further deletions, its id is unknown."),
    StaleVersion: of_request("The job has changed", 412, Grpc::Aborted, None,
        "The job no longer has the version given by If-Match. Fetch it again and repeat your decision."),
    PayloadTooLarge: of_request("The body or message is too large", 413, Grpc::OutOfRange, None,
        "The body, or a message over gRPC, is larger than this service accepts or sends. Upload a large mesh once (POST /v1/meshes or UploadMesh) and refer to it in the problem as mesh.stored."),
    ProblemTooLarge: of_request("The problem is too large", 413, Grpc::OutOfRange, None,
        "The job is estimated to need more memory than the budget allows; the estimate is part of this error. Use a coarser mesh or less refinement, or ask the operator for a larger budget. With solver.accuracy verify the estimate includes the refined mesh."),
    UriTooLong: of_request("The address is too long", 414, Grpc::Unimplemented, None,
        "The path and the query together are longer than this service accepts. Use fewer or shorter filters."),
    UnsupportedMedia: of_request("Unsupported media type", 415, Grpc::Unimplemented, None,
        "The body must be JSON and be declared as such: Content-Type: application/json."),
    RangeNotSatisfiable: of_request("The range lies outside the data", 416, Grpc::OutOfRange, None,
        "The range starts beyond the end of the data. The Content-Range header of this response gives the length."),
    InvalidProblem: of_request("The problem or its request is invalid", 422, Grpc::InvalidArgument, None,
        "The problem, or the request that contains it, has violations. `errors` lists them, at most 100: where (a JSON Pointer), what was found, what is expected and what to do. The schema is at /v1/schema/problem.json."),
    IdempotencyKeyReuse: of_request("The key was used for another request", 422, Grpc::AlreadyExists, None,
        "This Idempotency-Key (request_id) was used before with another payload. A key belongs to one request; use a new one."),
    QuotaExceeded: of_request("The owner's share is used up", 429, Grpc::ResourceExhausted, Some(10),
        "This owner has reached a limit: the number of waiting jobs, so that one owner cannot fill the queue for all, or the bytes of jobs and meshes. `quota` (over gRPC a QuotaFailure) has the limit and the present use, like GET /v1/me (GetCaller). Of waiting jobs: wait until some have run, or cancel some. Of bytes: waiting does not help, and `retryable` is false; delete jobs or meshes, or only the fields of some jobs. The administrator sets --max-queued-per-owner and --max-bytes-per-owner."),
    RateLimited: of_request("Too many requests at once", 429, Grpc::ResourceExhausted, Some(1),
        "More requests, mostly lists and counts, arrive at the same time than can be answered soon: ask less often, or follow jobs by their events. Or this owner has submitted more jobs in a minute than the administrator allows (--max-submissions-per-owner-per-minute); then `quota` has the limit and the present use."),
    HeaderTooLarge: of_request("The headers are too large", 431, Grpc::Unimplemented, None,
        "The headers of the request are larger than this service accepts, or there are more than 100 of them."),
    Internal: of_request("Internal error", 500, Grpc::Internal, Some(1),
        "An unexpected error occurred in the service; it is not the fault of the request. The service's log has the cause under the number of the incident; please report it."),
    CorruptData: of_request("A stored record is damaged", 500, Grpc::DataLoss, None,
        "The requested record was stored, but has changed since: its checksum is wrong, or a piece is missing, as after a failure of the disk. It is not served. Other jobs are not affected. The operator finds the damaged part in the service's log under the number of the incident; signorini doctor lists all damage and saves everything that is intact."),
    QueueFull: of_request("The queue is full", 503, Grpc::Unavailable, Some(10),
        "The queue has reached its largest number of jobs. Reading, watching and canceling still work. Try again when some jobs have run."),
    Draining: of_request("The service is stopping", 503, Grpc::Unavailable, Some(5),
        "The service accepts no more jobs because it is about to stop or restart. Accepted jobs are kept. Try again."),
    Overloaded: of_request("Too many transfers at once", 503, Grpc::Unavailable, Some(2),
        "One of the service's limits is reached: the memory for bodies and answers of requests, the number of connections, or the number of simultaneous uploads of meshes. The request had no effect. Try again."),
    StorageLost: of_request("The store was removed, replaced or damaged", 503, Grpc::Unavailable, Some(60),
        "The database was removed, replaced, cut short or damaged. Nothing new is accepted, since it would be lost; data that can still be read is served. The operator can stop the service, restore the files or save everything that is intact with `signorini doctor`, and start it again."),
    StorageFull: of_request("The disk is full or cannot be written", 507, Grpc::ResourceExhausted, Some(60),
        "Nothing more can be stored: the disk is full, its quota is reached, or it cannot be written. Reading still works, and running jobs wait; the operator can free space."),
    NotConverged: of_job("The iteration did not converge",
        "The residual is still above the tolerance: max_iterations was reached, or the iteration stopped making progress, or Newton's method failed. The last state and the whole history are kept as a partial result. Look at the convergence plot: refine the mesh, raise elastic_slip, apply the load in more increments, or choose algorithm auto."),
    ContactCycling: of_job("The iteration cycles between contact sets",
        "The iteration visits the same contact sets again and again. Refine the mesh there, raise elastic_slip, or choose algorithm auto; relaxation helps the thesis's own iteration."),
    FalseConvergence: of_job("The iteration converged to a state that is not a solution",
        "The method's own criterion was met, but the true residual is above the tolerance or the forces do not balance: the state is not a solution. Use algorithm auto, and check the supports if the forces do not balance."),
    SingularSystem: of_job("The stiffness matrix is singular",
        "The body can move without resistance because its supports and contacts do not hold it (`detail` then names the motion and a node), or the matrix is singular to working precision (`detail` then names a node and a direction)."),
    NonFinite: of_job("A number is not finite",
        "A NaN or an infinity arose during the solution; the numbers of the problem are too large or too small compared with each other."),
    TimedOut: of_job("The job exceeded its time limit",
        "The job was stopped after limits.timeout_s. What its load steps had reached is kept as a partial result, if the solver could still report it. Retry it with a higher limit (a body {\"limits\": {\"timeout_s\": …}}), or make the problem smaller."),
    QueueExpired: of_job("The job waited too long in the queue",
        "The job was not started within limits.queue_ttl_s: all workers were busy, or the queue was paused. Retry it with a higher priority or a higher limit (a body {\"priority\": …, \"limits\": {\"queue_ttl_s\": …}})."),
    ResourceExhausted: of_job("The job needs more memory than there is",
        "Memory ran out while the job was solved, although its estimate was within the budget. Use a coarser mesh."),
    WorkerLost: of_job("The worker was lost too often",
        "The process died during several attempts to solve this job; attempts that ended because the service was stopped are not counted. Other jobs continue. If this job is the cause, please report it."),
    UserCancel: of_job("The job was canceled",
        "A client canceled the job."),
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
