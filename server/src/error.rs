//! Everything that a request can be told went wrong. This one enum is the source of the HTTP
//! status and document and of the gRPC code and details.

use axum::http::StatusCode;
use serde_json::{Value, json};
use solver::{Estimate, error::Violation};
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt};
use uuid::Uuid;

use crate::violations::shortened;

/// Why a request was not answered as asked.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ApiError {
    /// The body is not JSON.
    #[error("{0}")]
    MalformedJson(String),
    /// A query parameter that this route does not have.
    #[error("there is no parameter {name:?} here; known are: {known}")]
    UnknownParameter {
        /// What was sent.
        name: String,
        /// What there is.
        known: String,
    },
    /// A query parameter or header with a value that it cannot have.
    #[error("{name}: expected {expected}, got {got:?}")]
    BadParameter {
        /// Which.
        name: &'static str,
        /// What was sent.
        got: String,
        /// What would have been right.
        expected: &'static str,
    },
    /// A page token that this service did not make for this list.
    #[error("the page token does not belong to this list; start again without one")]
    BadPageToken,
    /// No such thing.
    #[error("{0}")]
    NotFound(String),
    /// The job ended without a result.
    #[error("the job ended without a result (status {0})")]
    NoResult(&'static str),
    /// The path exists, the method does not.
    #[error("this path does not know the method; the header Allow lists those it does")]
    MethodNotAllowed,
    /// None of the wanted formats exists.
    #[error("not available in this format; available: {0}")]
    NotAcceptable(String),
    /// A body in a format that is not understood.
    #[error("expected a body of type application/json, got {0}")]
    UnsupportedMedia(String),
    /// Jobs that wait or run need the mesh.
    #[error("jobs that wait or run need this mesh; cancel them or let them end first")]
    MeshInUse,
    /// The job is not done.
    #[error("the job is {0}; its result comes when it is done")]
    ResultNotReady(&'static str),
    /// The body is too large.
    #[error("the body is larger than {limit_bytes} bytes")]
    PayloadTooLarge {
        /// The limit.
        limit_bytes: usize,
    },
    /// The job would need too much.
    #[error(
        "the job has {} unknowns and needs about {} bytes of memory; the budget is {budget_bytes} bytes",
        estimate.dofs, estimate.memory_bytes
    )]
    ProblemTooLarge {
        /// What it would need.
        estimate: Estimate,
        /// What it may have.
        budget_bytes: u64,
    },
    /// The problem, or the envelope it came in, is wrong.
    #[error("{}", summed_up(.0))]
    InvalidProblem(Vec<Violation>),
    /// Our fault; the cause is in the log under this number.
    #[error("an unexpected error, logged as incident {incident}")]
    Internal {
        /// Where to find it in the log.
        incident: Uuid,
    },
    /// Too many jobs wait.
    #[error("{limit} jobs are waiting already")]
    QueueFull {
        /// The limit.
        limit: u32,
    },
    /// The service is about to stop.
    #[error("the service is stopping; come back when it has been restarted")]
    Draining,
    /// The disk is full.
    #[error("the disk is full")]
    StorageFull,
}

/// What clients may rely on about an error.
struct Row {
    code: &'static str,
    title: &'static str,
    http: u16,
    grpc: Code,
    /// Seconds after which the same request may succeed.
    retry_after_s: Option<u64>,
}

impl ApiError {
    /// Logs an unexpected cause once, here, and keeps it from strangers.
    pub fn internal(cause: impl std::fmt::Display) -> Self {
        let incident = Uuid::now_v7();
        tracing::error!(%incident, %cause, "incident {incident}: {cause}");
        ApiError::Internal { incident }
    }

    #[rustfmt::skip]
    fn row(&self) -> Row {
        let (code, title, http, grpc, retry_after_s) = match self {
            ApiError::MalformedJson(_)        => ("malformed-json",     "The body is not JSON",              400, Code::InvalidArgument,    None),
            ApiError::UnknownParameter { .. } => ("unknown-parameter",  "Unknown parameter",                 400, Code::InvalidArgument,    None),
            ApiError::BadParameter { .. }     => ("bad-parameter",      "A parameter has a wrong value",     400, Code::InvalidArgument,    None),
            ApiError::BadPageToken            => ("bad-page-token",     "The page token is not ours",        400, Code::InvalidArgument,    None),
            ApiError::NotFound(_)             => ("not-found",          "Not found",                         404, Code::NotFound,           None),
            ApiError::NoResult(_)             => ("no-result",          "The job has no result",             404, Code::NotFound,           None),
            ApiError::MethodNotAllowed        => ("method-not-allowed", "Method not allowed",                405, Code::Unimplemented,      None),
            ApiError::NotAcceptable(_)        => ("not-acceptable",     "No such format",                    406, Code::Unimplemented,      None),
            ApiError::MeshInUse               => ("job-active",         "Jobs need it",                      409, Code::FailedPrecondition, None),
            ApiError::ResultNotReady(_)       => ("result-not-ready",   "The result is not ready",           409, Code::FailedPrecondition, Some(1)),
            ApiError::PayloadTooLarge { .. }  => ("payload-too-large",  "The body is too large",             413, Code::OutOfRange,         None),
            ApiError::ProblemTooLarge { .. }  => ("problem-too-large",  "The problem is too large",          413, Code::OutOfRange,         None),
            ApiError::UnsupportedMedia(_)     => ("unsupported-media",  "Unsupported type of body",          415, Code::Unimplemented,      None),
            ApiError::InvalidProblem(_)       => ("invalid-problem",    "The problem is invalid",            422, Code::InvalidArgument,    None),
            ApiError::Internal { .. }         => ("internal",           "Internal error",                    500, Code::Internal,           Some(1)),
            ApiError::QueueFull { .. }        => ("queue-full",         "The queue is full",                 503, Code::Unavailable,        Some(10)),
            ApiError::Draining                => ("draining",           "The service is stopping",           503, Code::Unavailable,        Some(5)),
            ApiError::StorageFull             => ("storage-full",       "The disk is full",                  507, Code::ResourceExhausted,  Some(60)),
        };
        Row { code, title, http, grpc, retry_after_s }
    }

    /// Stable name of the kind of error.
    pub fn code(&self) -> &'static str {
        self.row().code
    }

    /// The HTTP status.
    pub fn http_status(&self) -> StatusCode {
        StatusCode::from_u16(self.row().http).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR)
    }

    /// Seconds after which the same request may succeed.
    pub fn retry_after_s(&self) -> Option<u64> {
        self.row().retry_after_s
    }

    /// The problem document of RFC 9457; `instance` is the path that was asked for.
    pub fn document(&self, instance: &str) -> Value {
        let Row {
            code,
            title,
            http,
            retry_after_s,
            ..
        } = self.row();
        let mut document = json!({
            "type": format!("/v1/errors/{code}"),
            "title": title,
            "status": http,
            "code": code,
            "detail": self.to_string(),
            "instance": instance,
            "retryable": retry_after_s.is_some(),
            "errors": self.violations(),
        });
        match self {
            ApiError::Internal { incident } => document["incident"] = json!(incident.to_string()),
            ApiError::ProblemTooLarge {
                estimate,
                budget_bytes,
            } => {
                document["estimate"] = json!(estimate);
                document["memory_budget_bytes"] = json!(budget_bytes);
            }
            _ => {}
        }
        document
    }

    fn violations(&self) -> &[Violation] {
        match self {
            ApiError::InvalidProblem(violations) => violations,
            _ => &[],
        }
    }
}

impl From<ApiError> for Status {
    fn from(error: ApiError) -> Status {
        let row = error.row();
        let mut details = ErrorDetails::new();
        let mut metadata = std::collections::HashMap::new();
        match &error {
            ApiError::Internal { incident } => {
                metadata.insert("incident".to_string(), incident.to_string());
            }
            ApiError::ProblemTooLarge {
                estimate,
                budget_bytes,
            } => {
                metadata.insert("dofs".to_string(), estimate.dofs.to_string());
                metadata.insert(
                    "memory_bytes".to_string(),
                    estimate.memory_bytes.to_string(),
                );
                metadata.insert("memory_budget_bytes".to_string(), budget_bytes.to_string());
            }
            _ => {}
        }
        details.set_error_info(row.code, "signorini", metadata);
        if let Some(seconds) = row.retry_after_s {
            details.set_retry_info(Some(std::time::Duration::from_secs(seconds)));
        }
        // Details travel in a header; a mesh with a thousand bad elements would burst it.
        const MOST: usize = 50;
        for v in error.violations().iter().take(MOST) {
            let text = format!(
                "{}: expected {}, got {}. {}",
                v.reason, v.expected, v.got, v.hint
            );
            // They quote their input, and so may be as long as that.
            details.add_bad_request_violation(shortened(&v.pointer, 300), shortened(&text, 300));
        }
        Status::with_error_details(row.grpc, format!("{}: {error}", row.code), details)
    }
}

/// The count and the first ones: a client that cannot unpack the details still learns something.
fn summed_up(violations: &[Violation]) -> String {
    const SHOWN: usize = 3;
    let shown: Vec<String> = violations
        .iter()
        .take(SHOWN)
        .map(|violation| shortened(&violation.to_string(), 300))
        .collect();
    let more = if violations.len() > SHOWN { " …" } else { "" };
    format!(
        "{} violation(s): {}{more}",
        violations.len(),
        shown.join(" | ")
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn violation(pointer: &str) -> Violation {
        Violation {
            pointer: pointer.into(),
            reason: "out_of_range".into(),
            got: "-1".into(),
            expected: "> 0".into(),
            hint: "Check it.".into(),
        }
    }

    #[test]
    fn an_invalid_problem_is_422_and_invalid_argument_with_every_violation() {
        let error =
            ApiError::InvalidProblem(vec![violation("/problem/a"), violation("/problem/b")]);
        let document = error.document("/v1/jobs");
        assert_eq!(document["type"], "/v1/errors/invalid-problem");
        assert_eq!(document["status"], 422);
        assert_eq!(document["errors"][1]["pointer"], "/problem/b");
        let status = Status::from(error);
        assert_eq!(status.code(), Code::InvalidArgument);
        let details = status.get_error_details();
        assert_eq!(details.bad_request().unwrap().field_violations.len(), 2);
        assert_eq!(details.error_info().unwrap().reason, "invalid-problem");
    }

    #[test]
    fn what_passes_by_itself_says_when_to_retry() {
        let status = Status::from(ApiError::Draining);
        assert_eq!(status.code(), Code::Unavailable);
        assert!(status.get_error_details().retry_info().is_some());
        assert_eq!(ApiError::Draining.document("")["retryable"], true);
        assert_eq!(ApiError::BadPageToken.document("")["retryable"], false);
    }

    #[test]
    fn an_unexpected_cause_is_not_shown() {
        let error = ApiError::internal("the password is swordfish");
        assert!(!error.document("/").to_string().contains("swordfish"));
        assert!(!Status::from(error).message().contains("swordfish"));
    }
}
