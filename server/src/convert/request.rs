//! What requests hold beside a problem.

use prost_types::Timestamp;

use super::{Reader, read};
use crate::{
    error::ApiError,
    pb,
    store::{Edit, Filter},
    time::Time,
    verbs::{
        envelope::{Envelope, JobRequest},
        filters::{self, CREATED_AFTER, CREATED_BEFORE, FINISHED_AFTER, FINISHED_BEFORE, STATUS},
    },
};

/// A job as it is asked for. Pointers go into the request.
pub fn job_request(request: pb::CreateJobRequest) -> JobRequest {
    let pb::CreateJobRequest {
        problem,
        name,
        labels,
        priority,
        limits,
        cache,
        // for the handlers: under which key and id, and how long to wait
        request_id: _,
        job_id: _,
        wait: _,
    } = request;
    let mut read = Reader::default();
    // what cannot be read is noted, and then of no further importance
    let limits = read.field("limits", limits).unwrap_or_default();
    let cache = read.field("cache", cache).unwrap_or_default();
    let envelope = Envelope {
        name,
        labels,
        priority,
        limits,
        cache,
    };
    // an absent problem lacks everything, and is told so
    let problem = read.field("problem", problem.unwrap_or_default());
    let problem = read.found(problem);
    JobRequest { envelope, problem }
}

/// Which jobs.
pub fn filter(message: Option<pb::JobFilter>) -> Result<Filter, ApiError> {
    let pb::JobFilter {
        status: numbers,
        owner,
        labels,
        name,
        input_hash,
        created_after,
        created_before,
        finished_after,
        finished_before,
    } = message.unwrap_or_default();
    let status = |number| {
        read(number)
            .map_err(|_| invalid_field(STATUS.name, number, "a value of the enum other than 0"))
    };
    filters::checked(Filter {
        statuses: numbers.into_iter().map(status).collect::<Result<_, _>>()?,
        owner,
        labels: labels.into_iter().collect(),
        name,
        input_hash,
        created_after: time(CREATED_AFTER.name, created_after)?,
        created_before: time(CREATED_BEFORE.name, created_before)?,
        finished_after: time(FINISHED_AFTER.name, finished_after)?,
        finished_before: time(FINISHED_BEFORE.name, finished_before)?,
    })
}

fn time(name: &'static str, stamp: Option<Timestamp>) -> Result<Option<Time>, ApiError> {
    let Some(stamp) = stamp else { return Ok(None) };
    let micros = stamp
        .seconds
        .checked_mul(1_000_000)
        .and_then(|micros| micros.checked_add(i64::from(stamp.nanos) / 1000));
    match micros {
        Some(micros) if (0..1_000_000_000).contains(&stamp.nanos) => {
            Ok(Some(Time::from_micros(micros)))
        }
        _ => Err(invalid_field(
            name,
            stamp,
            "a time within the range of a Timestamp",
        )),
    }
}

/// What is changed of a job.
pub fn edit(request: pb::UpdateJobRequest) -> Result<Edit, ApiError> {
    let pb::UpdateJobRequest {
        update_mask,
        name,
        labels,
        priority,
        pinned,
        id: _,      // which job, read by the handler
        version: _, // whether it is still the one that was meant, likewise
    } = request;
    let Some(mask) = update_mask else {
        return Ok(Edit {
            name: name.map(Some),
            labels: (!labels.is_empty()).then_some(labels),
            priority,
            pinned,
        });
    };
    let mut edit = Edit::default();
    for path in mask.paths {
        match path.as_str() {
            "name" => edit.name = Some(name.clone()),
            "labels" => edit.labels = Some(labels.clone()),
            "priority" => edit.priority = Some(priority.unwrap_or_default()),
            "pinned" => edit.pinned = Some(pinned.unwrap_or_default()),
            _ => {
                return Err(invalid_field(
                    "update_mask",
                    path,
                    "paths among name, labels, priority, pinned",
                ));
            }
        }
    }
    Ok(edit)
}

/// A field with a value that it cannot have.
pub fn invalid_field(
    name: &'static str,
    got: impl ToString,
    expected: impl Into<String>,
) -> ApiError {
    ApiError::BadParameter {
        name,
        got: got.to_string(),
        expected: expected.into(),
    }
}
