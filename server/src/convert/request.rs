//! Reads the parts of requests other than a problem.

use files::sweep::Fields;
use prost_types::Timestamp;
use serde_json::{json, value::RawValue};
use solver::{error::Reason, problem::Problem};

use super::{Reader, read};
use crate::{
    error::ApiError,
    job::Cache,
    pb,
    store::{Edit, Filter},
    time::Time,
    verbs::{
        envelope::{Envelope, JobRequest},
        filters::{
            self, CREATED_AFTER, CREATED_BEFORE, FINISHED_AFTER, FINISHED_BEFORE, STATUS, SWEEP,
        },
        sweeps::SweepRequest,
    },
};

/// Reads the request for a job. Pointers refer to the request.
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

/// Reads the request for a sweep: its definition as JSON, which is then read as over REST. Pointers refer to the
/// request.
pub fn sweep_request(request: pb::CreateSweepRequest) -> SweepRequest {
    let pb::CreateSweepRequest {
        base,
        axes,
        mode,
        points,
        name,
        labels,
        priority,
        limits,
        request_id: _, // under which key, for the handler
    } = request;
    let mut read = Reader::default();
    let limits = match limits {
        Some(_) => read.field("limits", limits),
        None => None,
    };
    let base: Option<Problem> = read.field("base", base.unwrap_or_default());
    let mode = match pb::SweepMode::try_from(mode) {
        Ok(pb::SweepMode::Unspecified | pb::SweepMode::Grid) => Some(r#""grid""#),
        Ok(pb::SweepMode::Zip) => Some(r#""zip""#),
        Ok(pb::SweepMode::List) => Some(r#""list""#),
        Err(_) => read.unknown(mode, "SweepMode"),
    };
    let (listed, pointed) = (!axes.is_empty(), !points.is_empty());
    let axes: Vec<Option<String>> = read_each("axes", axes, &mut read, axis);
    let points: Vec<Option<String>> = read_each("points", points, &mut read, point);
    let list = |items: Vec<Option<String>>| -> Option<Box<RawValue>> {
        let items: Option<Vec<String>> = items.into_iter().collect();
        RawValue::from_string(format!("[{}]", items?.join(","))).ok()
    };
    let definition = (|| {
        let base = serde_json::to_string(&base?).ok()?;
        let base = RawValue::from_string(base).ok()?;
        let mode = RawValue::from_string(mode?.to_owned()).ok()?;
        let (axes, points) = (list(axes)?, list(points)?);
        Some((base, mode, axes, points))
    })();
    let definition = read
        .found(definition)
        .and_then(|(base, mode, axes, points)| {
            files::sweep::read(&Fields {
                base: Some(&base),
                axes: Some(&*axes).filter(|_| listed),
                mode: Some(&mode),
                points: Some(&*points).filter(|_| pointed),
            })
        });
    SweepRequest {
        envelope: Envelope {
            name,
            labels,
            priority,
            limits: limits.unwrap_or_default(),
            cache: Cache::Off,
        },
        limits,
        definition,
    }
}

/// Reads each item as JSON; violations are recorded at their places.
fn read_each<M>(
    name: &'static str,
    messages: Vec<M>,
    read: &mut Reader,
    item: fn(M, &mut Reader) -> Option<String>,
) -> Vec<Option<String>> {
    read.inside(name, |read| {
        let each = |(n, message)| read.item(n, |read| item(message, read));
        messages.into_iter().enumerate().map(each).collect()
    })
}

/// Reads an axis as JSON.
fn axis(message: pb::SweepAxis, read: &mut Reader) -> Option<String> {
    use pb::sweep_axis::Values;
    let pb::SweepAxis { path, values } = message;
    let spaced = |name, spaced: pb::Spaced, read: &mut Reader| {
        let pb::Spaced { start, stop, count } = spaced;
        read.inside(name, |read| {
            let (start, stop): (Option<f64>, Option<f64>) =
                (read.field("start", start), read.field("stop", stop));
            let spaced = json!({"start": start?, "stop": stop?, "count": count});
            Some(json!({"path": path, name: spaced}).to_string())
        })
    };
    match values {
        Some(Values::Numbers(pb::NumberList { numbers })) => {
            let numbers: Option<Vec<f64>> = read.field("values", numbers);
            Some(json!({"path": path, "values": numbers?}).to_string())
        }
        Some(Values::Linspace(message)) => spaced("linspace", message, read),
        Some(Values::Logspace(message)) => spaced("logspace", message, read),
        Some(Values::Json(pb::JsonList { values })) => {
            let texts = read_each("values", values, read, json_text);
            let texts: Option<Vec<String>> = texts.into_iter().collect();
            let path = serde_json::Value::String(path);
            Some(format!(
                r#"{{"path":{path},"values":[{}]}}"#,
                texts?.join(",")
            ))
        }
        None => read.missing("one of numbers, linspace, logspace, json"),
    }
}

/// Reads a point as JSON.
fn point(message: pb::SweepPoint, read: &mut Reader) -> Option<String> {
    let mut members = vec![];
    let mut sound = true;
    for (n, (path, text)) in message.values.into_iter().enumerate() {
        match read.item(n, |read| json_text(text, read)) {
            Some(text) => members.push(format!("{}:{text}", serde_json::Value::String(path))),
            None => sound = false,
        }
    }
    sound.then(|| format!("{{{}}}", members.join(",")))
}

/// Reads a text that is a JSON value, nested no deeper than a problem may be.
fn json_text(text: String, read: &mut Reader) -> Option<String> {
    let deep = files::json::too_deep(&text);
    let read_one = || serde_json::from_str::<&RawValue>(&text).map(|_| ());
    match (deep, read_one()) {
        (None, Ok(())) => Some(text),
        (Some(place), _) => read.wrong(Reason::Malformed, place, "a value as JSON"),
        (None, Err(error)) => read.wrong(Reason::Malformed, error, "a value as JSON"),
    }
}

/// Reads the filter for jobs.
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
        sweep,
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
        sweep: sweep.map(|id| SWEEP.read(&id)).transpose()?,
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

/// Reads the changes of a job.
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

/// The error for a field with an invalid value.
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
