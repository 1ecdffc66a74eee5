//! Why a request failed, with the details of the case; `catalog` has the stable facts about each kind. This module
//! makes an error into the HTTP problem document, and into the gRPC status with its details.

use std::fmt;

use axum::{
    http::StatusCode,
    response::{IntoResponse, Response},
};
use base::text::{count, number_of, size};
use base::{
    catalog::{Code, Kind, explained_at},
    job::{Failure, JobId, Reason, Status as JobStatus, SweepId},
};
use serde::Serialize;
use serde_json::{Value, json};
use solver::{
    Estimate,
    error::{Violation, shortened},
};
use tonic::Status;
use tonic_types::{ErrorDetails, StatusExt};
use uuid::Uuid;

use crate::pace::{LEAST_RATE, LONGEST_PAUSE};

/// Why a request failed.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ApiError {
    /// The request body is not JSON.
    #[error("{0}")]
    MalformedJson(String),
    /// A query parameter is unknown to this operation.
    #[error("this operation has no parameter {name:?}; it has: {known}")]
    UnknownParameter {
        /// The name that was sent.
        name: String,
        /// The parameters of the operation.
        known: String,
    },
    /// A query parameter or header has an invalid value.
    #[error("{name}: expected {expected}, got {got:?}")]
    BadParameter {
        /// The name of the parameter or header.
        name: &'static str,
        /// The value that was sent.
        got: String,
        /// The value that was expected.
        expected: String,
    },
    /// The limits of the axes of a figure are invalid: all faults, in words.
    #[error("{}", .0.join("; "))]
    BadLimits(Vec<String>),
    /// A page token does not belong to this list.
    #[error("the page token does not belong to this list; start again without one")]
    BadPageToken,
    /// A request to change many jobs has no filter.
    #[error("a filter is required: at least one of {0}")]
    MissingFilter(String),
    /// The request is not HTTP, or not a message of the contract.
    #[error("{0}")]
    BadRequest(String),
    /// The request body arrived too slowly.
    #[error("the body arrived too slowly: nothing for {} s, or less than {} KiB a second", LONGEST_PAUSE.as_secs(), LEAST_RATE >> 10)]
    RequestTimeout,
    /// The URI of the request is too long.
    #[error("the path and the query are too long")]
    UriTooLong,
    /// The headers of the request are too large.
    #[error("the headers of the request are too large")]
    HeaderTooLarge,
    /// Other requests occupy the memory for transfers, or the connections.
    #[error("other requests occupy the memory for transfers, or all connections; try again")]
    Overloaded,
    /// The largest number of simultaneous uploads of meshes is reached.
    #[error(
        "{} at the same time, which is the limit; try again when one has ended",
        uploads(owner, most)
    )]
    TooManyUploads {
        /// The owner who has reached the limit; `None`: the limit of all owners together is reached.
        owner: Option<String>,
        /// The largest number of simultaneous uploads.
        most: usize,
    },
    /// The caller is not authenticated.
    #[error("{0}")]
    Unauthenticated(&'static str),
    /// The caller, or the place that the request comes from, may not do this.
    #[error("{0}")]
    Forbidden(String),
    /// The requested thing does not exist.
    #[error("{0}")]
    NotFound(String),
    /// The job was deleted.
    #[error("{0} was deleted")]
    Deleted(JobId),
    /// The sweep was deleted.
    #[error("{0} was deleted")]
    SweepDeleted(SweepId),
    /// The sweep has not ended.
    #[error("the sweep is {0}; cancel it, or wait for its end")]
    SweepActive(JobStatus),
    /// The job ended without a result.
    #[error("the job ended without a result (status {0})")]
    NoResult(JobStatus),
    /// The fields of a job were deleted separately.
    #[error(
        "the fields of {0} were deleted, on request or by retention; its summary, history and profiles are still available"
    )]
    FieldsDeleted(JobId),
    /// The path does not support this method.
    #[error("this path does not support this method; the Allow header lists those it supports")]
    MethodNotAllowed,
    /// None of the requested formats is available.
    #[error("not available as {got}; available: {available}")]
    NotAcceptable {
        /// The format that was requested.
        got: String,
        /// The names of the available formats.
        available: String,
    },
    /// The request body has a format that is not understood.
    #[error("expected a body of type {expected}, got {got}")]
    UnsupportedMedia {
        /// The media type that was expected.
        expected: &'static str,
        /// The media type that was declared.
        got: String,
    },
    /// The request body has a Content-Encoding that is not understood.
    #[error("expected a body without Content-Encoding, or with gzip or zstd, got {0}")]
    UnsupportedEncoding(String),
    /// The job has not ended.
    #[error("the job is {0}; cancel it, or wait for its end")]
    JobActive(JobStatus),
    /// The id that the client has chosen belongs to a job with other content.
    #[error("{0} was submitted with other content; use a new id for another job")]
    IdConflict(JobId),
    /// The idempotency key was used for a request with other content.
    #[error(
        "this key was used for a request with other content; use a new key, or repeat that request unchanged"
    )]
    KeyReuse,
    /// The job has a newer version.
    #[error("the job has version {0}")]
    StaleVersion(i64),
    /// The requested range of bytes begins after the end of the data, which has this many bytes.
    #[error("the data has {0} bytes")]
    RangeNotSatisfiable(u64),
    /// Queued or running jobs use the mesh.
    #[error("queued or running jobs use this mesh; cancel them or wait for their end")]
    MeshInUse,
    /// The job has not ended and has no result yet.
    #[error("the job is {0}; its result is available when it has ended")]
    ResultNotReady(JobStatus),
    /// The job ended without a solution, and its last state was not asked for.
    #[error("{}", stopped(id, status, failure.as_deref()))]
    PartialResult {
        /// The job.
        id: JobId,
        /// How the job ended.
        status: JobStatus,
        /// Why the job ended so.
        reason: Option<Reason>,
        /// What went wrong, if the job failed.
        failure: Option<Box<Failure>>,
    },
    /// The request body is too large.
    #[error("the body is larger than {limit_bytes} bytes")]
    PayloadTooLarge {
        /// The largest allowed size (bytes).
        limit_bytes: usize,
    },
    /// The request body becomes much larger when its Content-Encoding is undone.
    #[error(
        "the body becomes more than {ratio} times larger when its Content-Encoding is undone; send the body without one"
    )]
    EncodedTooLarge {
        /// The largest allowed ratio of the decoded size to the encoded size.
        ratio: usize,
    },
    /// The gRPC message has too many parts.
    #[error(
        "the message has too many parts: it would take more than {} in memory",
        size(*limit_bytes as u64)
    )]
    MessageTooLarge {
        /// The largest allowed memory of the message (bytes).
        limit_bytes: usize,
    },
    /// The answer does not fit into one gRPC message.
    #[error(
        "the response is larger than a message may be (1 MiB); REST has no such limit: {instead}"
    )]
    AnswerTooLarge {
        /// The REST operation that has the same data.
        instead: &'static str,
    },
    /// The job needs more memory than the budget allows.
    #[error(
        "the job has {} unknowns and needs about {} of memory; the budget is {}; use a coarser mesh or less refinement",
        count(estimate.dofs), size(estimate.memory_bytes), size(*budget_bytes)
    )]
    ProblemTooLarge {
        /// The estimated memory.
        estimate: Estimate,
        /// The memory budget (bytes).
        budget_bytes: u64,
    },
    /// The problem, or what was submitted with it, is invalid.
    #[error("{}", summed_up(.0))]
    InvalidProblem(Vec<Violation>),
    /// The owner has reached a limit.
    #[error("{0}")]
    QuotaExceeded(Quota),
    /// Too many requests at once.
    #[error("more requests arrive than can be answered in a short time")]
    RateLimited,
    /// An unexpected error of the service; the log has its cause under the number `incident`.
    #[error("an unexpected error, logged as incident {incident}")]
    Internal {
        /// The number of the incident in the log.
        incident: Uuid,
    },
    /// A stored record is damaged.
    #[error("{what}; logged as incident {incident}")]
    CorruptData {
        /// The damaged record.
        what: String,
        /// The number of the incident in the log.
        incident: Uuid,
    },
    /// Too many jobs wait.
    #[error("the queue holds {limit} jobs already{}", if *paused { ", and is paused: they wait until it is resumed" } else { "" })]
    QueueFull {
        /// The largest number of queued jobs.
        limit: u32,
        /// Whether the queue is paused, so that no job starts until it is resumed.
        paused: bool,
    },
    /// The service is about to stop.
    #[error("the service is stopping; try again when it has been restarted")]
    Draining,
    /// The database was removed, replaced or damaged.
    #[error(
        "the database was removed, replaced or damaged: nothing new can be stored safely, and only data that can still be read is \
         served; the operator should stop the service and run `signorini doctor`"
    )]
    StorageLost,
    /// The disk is full.
    #[error("the disk is full, or cannot be written")]
    StorageFull,
}

fn uploads(owner: &Option<String>, most: &usize) -> String {
    match owner {
        Some(owner) => format!("{owner} uploads {most} meshes"),
        None => format!("{most} meshes are being uploaded"),
    }
}

/// The message that a job has nothing but the state at which it stopped.
fn stopped(id: &JobId, status: &JobStatus, failure: Option<&Failure>) -> String {
    let end = match (status, failure) {
        (JobStatus::Canceled, _) => "was canceled".to_owned(),
        (_, None) => "failed".to_owned(),
        (_, Some(failure)) => {
            let detail = shortened(&failure.detail, 300);
            let detail = detail.trim_end_matches('.');
            format!("failed: {}: {detail}", failure.title)
        }
    };
    format!(
        "{id} {end}. It has no solution, only the state at which it stopped: partial=true (on the command line --partial) \
         serves that"
    )
}

/// A limit that an owner has reached.
#[derive(Clone, Debug, Serialize)]
pub struct Quota {
    /// The owner.
    pub owner: String,
    /// The limited quantity.
    pub of: QuotaOf,
    /// The limit.
    pub limit: u64,
    /// The amount that the owner uses now.
    pub used: u64,
    /// The amount that the request would add.
    pub asked: u64,
}

/// A quantity that is limited for each owner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum QuotaOf {
    /// Jobs in the queue.
    Queued,
    /// Stored bytes.
    StoredBytes,
    /// Jobs submitted in a minute.
    Submissions,
}

impl Quota {
    /// Seconds after which the same request may succeed; `None` if the request exceeds the limit by itself, or the owner
    /// has to delete something first.
    fn retry_after_s(&self, code: Code) -> Option<u64> {
        match self.of {
            _ if self.asked > self.limit => None,
            QuotaOf::Submissions => {
                let missing = (self.used + self.asked).saturating_sub(self.limit);
                Some((60 * missing).div_ceil(self.limit.max(1)).max(1))
            }
            QuotaOf::StoredBytes => None,
            QuotaOf::Queued => code.kind().retry_after_s,
        }
    }
}

impl fmt::Display for Quota {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Quota {
            owner,
            of,
            limit,
            used,
            asked,
        } = self;
        let in_parts = if asked > limit {
            ": submit it in parts"
        } else {
            ""
        };
        match of {
            QuotaOf::Queued => write!(
                f,
                "{owner} has {used} of at most {limit} jobs in the queue, and this request would add {asked}{in_parts}"
            ),
            QuotaOf::StoredBytes => write!(
                f,
                "{owner} has stored {} of at most {} in jobs and meshes{}: delete some of them, or the fields of some",
                size(*used),
                size(*limit),
                match asked {
                    0 => String::new(),
                    _ => format!(", and this request would add {}", size(*asked)),
                }
            ),
            QuotaOf::Submissions => write!(
                f,
                "{owner} may submit {limit} jobs in a minute, has submitted {used}, and this request would add {asked}{in_parts}"
            ),
        }
    }
}

impl ApiError {
    /// Makes an error of an unexpected cause, and logs the cause, which clients do not see.
    pub fn internal(cause: impl std::fmt::Display) -> Self {
        let incident = Uuid::now_v7();
        tracing::error!(%incident, %cause, "incident {incident}: {cause}");
        ApiError::Internal { incident }
    }

    /// The kind of this error.
    pub fn code(&self) -> Code {
        match self {
            ApiError::MalformedJson(_) => Code::MalformedJson,
            ApiError::UnknownParameter { .. } => Code::UnknownParameter,
            ApiError::BadParameter { .. } | ApiError::BadLimits(_) => Code::BadParameter,
            ApiError::BadPageToken => Code::BadPageToken,
            ApiError::MissingFilter(_) => Code::MissingFilter,
            ApiError::BadRequest(_) => Code::BadRequest,
            ApiError::RequestTimeout => Code::RequestTimeout,
            ApiError::UriTooLong => Code::UriTooLong,
            ApiError::HeaderTooLarge => Code::HeaderTooLarge,
            ApiError::Overloaded | ApiError::TooManyUploads { .. } => Code::Overloaded,
            ApiError::Unauthenticated(_) => Code::Unauthenticated,
            ApiError::Forbidden(_) => Code::Forbidden,
            ApiError::NotFound(_) => Code::NotFound,
            ApiError::Deleted(_) | ApiError::SweepDeleted(_) => Code::Deleted,
            ApiError::NoResult(_) | ApiError::FieldsDeleted(_) => Code::NoResult,
            ApiError::MethodNotAllowed => Code::MethodNotAllowed,
            ApiError::NotAcceptable { .. } => Code::NotAcceptable,
            ApiError::UnsupportedMedia { .. } | ApiError::UnsupportedEncoding(_) => {
                Code::UnsupportedMedia
            }
            ApiError::JobActive(_) | ApiError::SweepActive(_) | ApiError::MeshInUse => {
                Code::JobActive
            }
            ApiError::IdConflict(_) => Code::IdConflict,
            ApiError::KeyReuse => Code::IdempotencyKeyReuse,
            ApiError::StaleVersion(_) => Code::StaleVersion,
            ApiError::RangeNotSatisfiable(_) => Code::RangeNotSatisfiable,
            ApiError::ResultNotReady(_) => Code::ResultNotReady,
            ApiError::PartialResult { .. } => Code::PartialResult,
            ApiError::PayloadTooLarge { .. }
            | ApiError::EncodedTooLarge { .. }
            | ApiError::MessageTooLarge { .. }
            | ApiError::AnswerTooLarge { .. } => Code::PayloadTooLarge,
            ApiError::ProblemTooLarge { .. } => Code::ProblemTooLarge,
            ApiError::InvalidProblem(_) => Code::InvalidProblem,
            ApiError::QuotaExceeded(quota) => match quota.of {
                QuotaOf::Queued | QuotaOf::StoredBytes => Code::QuotaExceeded,
                QuotaOf::Submissions => Code::RateLimited,
            },
            ApiError::RateLimited => Code::RateLimited,
            ApiError::Internal { .. } => Code::Internal,
            ApiError::QueueFull { .. } => Code::QueueFull,
            ApiError::Draining => Code::Draining,
            ApiError::CorruptData { .. } => Code::CorruptData,
            ApiError::StorageLost => Code::StorageLost,
            ApiError::StorageFull => Code::StorageFull,
        }
    }

    /// The HTTP status.
    pub fn http_status(&self) -> StatusCode {
        let status = self.code().kind().status;
        status
            .and_then(|status| StatusCode::from_u16(status).ok())
            .unwrap_or(StatusCode::INTERNAL_SERVER_ERROR)
    }

    /// Seconds after which the same request may succeed; `None` if it would not.
    pub fn retry_after_s(&self) -> Option<u64> {
        match self {
            ApiError::QuotaExceeded(quota) => quota.retry_after_s(self.code()),
            _ => self.code().kind().retry_after_s,
        }
    }

    /// The problem document of RFC 9457; `instance` is the path of the request.
    pub fn document(&self, instance: &str) -> Value {
        let kind = self.code().kind();
        let Kind {
            code,
            title,
            status,
            ..
        } = kind;
        let mut document = json!({
            "type": explained_at(code),
            "title": title,
            "status": status,
            "code": code,
            "detail": self.to_string(),
            "instance": instance,
            "retryable": self.retry_after_s().is_some(),
            "errors": self.violations(),
        });
        match self {
            ApiError::Internal { incident } | ApiError::CorruptData { incident, .. } => {
                document["incident"] = json!(incident.to_string());
            }
            ApiError::ProblemTooLarge {
                estimate,
                budget_bytes,
            } => {
                document["estimate"] = json!(estimate);
                document["memory_budget_bytes"] = json!(budget_bytes);
            }
            ApiError::QuotaExceeded(quota) => document["quota"] = json!(quota),
            ApiError::PartialResult {
                reason, failure, ..
            } => {
                document["reason"] = json!(reason);
                document["failure"] = json!(failure);
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

impl IntoResponse for ApiError {
    /// Makes a response of the status, with the error in its extensions: REST adds headers and document, since it knows
    /// the path.
    fn into_response(self) -> Response {
        let mut response = self.http_status().into_response();
        response.extensions_mut().insert(self);
        response
    }
}

impl From<ApiError> for Status {
    fn from(error: ApiError) -> Status {
        let kind = error.code().kind();
        let grpc = kind.grpc.unwrap_or(tonic::Code::Internal);
        let mut details = ErrorDetails::new();
        let mut metadata = std::collections::HashMap::new();
        match &error {
            ApiError::Internal { incident } | ApiError::CorruptData { incident, .. } => {
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
            ApiError::PartialResult {
                reason: Some(reason),
                ..
            } => {
                metadata.insert("reason".to_string(), <&str>::from(*reason).to_string());
            }
            ApiError::QuotaExceeded(quota) => {
                let subject = format!("owner:{}", quota.owner);
                details.add_quota_failure_violation(subject, quota.to_string());
            }
            _ => {}
        }
        details.set_error_info(kind.code, "signorini", metadata);
        if let Some(seconds) = error.retry_after_s() {
            details.set_retry_info(Some(std::time::Duration::from_secs(seconds)));
        }
        // the details are sent in a header in addition to the message, a third longer because of their encoding;
        // clients accept 8 KiB of headers
        const MOST_BYTES: usize = 2400;
        let mut bytes = 0;
        let all = error.violations();
        for (n, v) in all.iter().enumerate() {
            let text = format!(
                "{}: expected {}, got {}. {}",
                v.reason, v.expected, v.got, v.hint
            );
            // they quote the input and may be as long as it
            let (pointer, text) = (shortened(&v.pointer, 300), shortened(&text, 300));
            bytes += pointer.len() + text.len() + 10;
            if bytes > MOST_BYTES {
                let more = format!(
                    "and {} more, which do not fit into this message",
                    all.len() - n
                );
                details.add_bad_request_violation("", more);
                break;
            }
            details.add_bad_request_violation(pointer, text);
        }
        Status::with_error_details(grpc, format!("{}: {error}", kind.code), details)
    }
}

/// Summarises violations: their number and the first ones, for clients that do not read the details.
fn summed_up(violations: &[Violation]) -> String {
    const SHOWN: usize = 3;
    let shown: Vec<String> = violations
        .iter()
        .take(SHOWN)
        .map(|violation| shortened(&violation.to_string(), 120))
        .collect();
    let more = if violations.len() > SHOWN { " …" } else { "" };
    let count = number_of(violations.len(), "violation");
    format!("{count}: {}{more}", shown.join(" | "))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use solver::error::Reason;
    use tonic::Code;

    fn violation(pointer: &str) -> Violation {
        Violation {
            pointer: pointer.into(),
            reason: Reason::OutOfRange,
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

    /// Many violations fit into the headers of an answer, whose size clients limit: grpcio to 8 KiB.
    #[test]
    fn many_violations_fit_into_the_headers_of_an_answer() {
        for length in [1, 20, 300] {
            let long = violation(&format!("/problem/{}", "ü".repeat(length)));
            let status = Status::from(ApiError::InvalidProblem(vec![long; 100]));
            let details = status.get_error_details();
            let shown = &details.bad_request().unwrap().field_violations;
            assert!((3..100).contains(&shown.len()));
            assert!(shown.last().unwrap().description.contains("more"));
            let headers = status.into_http::<()>();
            let bytes = |(name, value): (&axum::http::HeaderName, &axum::http::HeaderValue)| {
                name.as_str().len() + value.len() + 32
            };
            let total: usize = headers.headers().iter().map(bytes).sum();
            assert!(total < 7500, "{total}");
        }
    }

    #[test]
    fn a_temporary_error_has_a_time_to_retry() {
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
