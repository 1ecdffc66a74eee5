//! Reads the parts of requests other than a problem.

use std::collections::BTreeMap;

use base::{
    job::{Cache, JobId, Status, SweepId},
    time::Time,
    values::{Values, Words},
};
use files::sweep::{Axis, Mode, Spaced, Variation};
use prost_types::Timestamp;
use serde_json::value::{RawValue, to_raw_value};
use service::{
    error::ApiError,
    verbs::{
        envelope::{Envelope, JobRequest},
        filters, jobs,
        sweeps::{self, SweepRequest},
    },
};
use solver::{
    error::Reason,
    problem::Problem,
    solution::{Verdict, WarningCode},
};
use store::{Edit, Filter, job_filters};

use super::{FromMessage, Reader, read};
use crate::pb;

/// Reads the request for a job. Pointers of violations begin at the request.
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

/// Reads the request for a sweep. Pointers of violations begin at the request.
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
        Ok(pb::SweepMode::Unspecified | pb::SweepMode::Grid) => Some(Mode::Grid),
        Ok(pb::SweepMode::Zip) => Some(Mode::Zip),
        Ok(pb::SweepMode::List) => Some(Mode::List),
        Err(_) => read.unknown(mode, "SweepMode"),
    };
    let (listed, pointed) = (!axes.is_empty(), !points.is_empty());
    let axes = read_each("axes", axes, &mut read, axis);
    let points = read_each("points", points, &mut read, point);
    let definition = (|| {
        let base = serde_json::to_string(&base?).ok()?;
        let variation = Variation {
            mode: Some(mode?),
            axes: Some(axes?).filter(|_| listed),
            points: Some(points?).filter(|_| pointed),
        };
        Some((base, variation))
    })();
    let definition = read
        .found(definition)
        .and_then(|(base, variation)| files::sweep::read(&base, variation));
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

/// Reads each entry of the list `name` by `item`; what cannot be read is reported at the place of its entry.
fn read_each<M, T>(
    name: &'static str,
    messages: Vec<M>,
    read: &mut Reader,
    item: fn(M, &mut Reader) -> Option<T>,
) -> Option<Vec<T>> {
    read.inside(name, |read| {
        let each = |(n, message)| read.item(n, |read| item(message, read));
        // all of them, so that all that is wrong is noted
        let items: Vec<Option<T>> = messages.into_iter().enumerate().map(each).collect();
        items.into_iter().collect()
    })
}

fn axis(message: pb::SweepAxis, read: &mut Reader) -> Option<Axis> {
    use pb::sweep_axis::Values;
    let pb::SweepAxis { path, values } = message;
    let spaced = |name, spaced: pb::Spaced, read: &mut Reader| {
        let pb::Spaced { start, stop, count } = spaced;
        read.inside(name, |read| {
            let (start, stop) = (read.field("start", start), read.field("stop", stop));
            let count = count.into();
            Some(Spaced {
                start: start?,
                stop: stop?,
                count,
            })
        })
    };
    let mut axis = Axis {
        path,
        values: None,
        linspace: None,
        logspace: None,
    };
    match values {
        Some(Values::Numbers(pb::NumberList { numbers })) => {
            let numbers: Option<Vec<f64>> = read.field("values", numbers);
            let texts = numbers?
                .into_iter()
                .map(|number| to_raw_value(&number).ok());
            axis.values = Some(texts.collect::<Option<_>>()?);
        }
        Some(Values::Linspace(message)) => {
            axis.linspace = Some(spaced("linspace", message, read)?);
        }
        Some(Values::Logspace(message)) => {
            axis.logspace = Some(spaced("logspace", message, read)?);
        }
        Some(Values::Json(pb::JsonList { values })) => {
            axis.values = Some(read_each("values", values, read, json_text)?);
        }
        None => return read.missing("one of numbers, linspace, logspace, json"),
    }
    Some(axis)
}

fn point(message: pb::SweepPoint, read: &mut Reader) -> Option<Box<RawValue>> {
    let mut members = BTreeMap::new();
    let mut sound = true;
    for (n, (path, text)) in message.values.into_iter().enumerate() {
        match read.item(n, |read| json_text(text, read)) {
            Some(text) => {
                members.insert(path, text);
            }
            None => sound = false,
        }
    }
    to_raw_value(&members).ok().filter(|_| sound)
}

/// Reads a text that is a value as JSON, and nested no deeper than a problem may be.
fn json_text(text: String, read: &mut Reader) -> Option<Box<RawValue>> {
    if let Some(place) = files::json::too_deep(&text) {
        return read.wrong(Reason::Malformed, place, "a value as JSON");
    }
    match RawValue::from_string(text) {
        Ok(value) => Some(value),
        Err(error) => read.wrong(Reason::Malformed, error, "a value as JSON"),
    }
}

/// Reads a field of the message of filters, as a filter of type `T`.
trait Criterion<T> {
    fn read(self, name: &'static str) -> Result<T, ApiError>;
}

impl<T: FromMessage<i32>> Criterion<Vec<T>> for Vec<i32> {
    fn read(self, name: &'static str) -> Result<Vec<T>, ApiError> {
        let value = |number| {
            read(number)
                .map_err(|_| invalid_field(name, number, "a value of the enum other than 0"))
        };
        self.into_iter().map(value).collect()
    }
}

impl Criterion<Option<String>> for Option<String> {
    fn read(self, _name: &'static str) -> Result<Option<String>, ApiError> {
        Ok(self)
    }
}

impl Criterion<Option<SweepId>> for Option<String> {
    fn read(self, name: &'static str) -> Result<Option<SweepId>, ApiError> {
        let sweep = |id: String| {
            SweepId::parse(&id).ok_or_else(|| invalid_field(name, id, sweeps::ID.values.expected()))
        };
        self.map(sweep).transpose()
    }
}

impl Criterion<Option<bool>> for Option<bool> {
    fn read(self, _name: &'static str) -> Result<Option<bool>, ApiError> {
        Ok(self)
    }
}

impl Criterion<Option<JobId>> for Option<String> {
    fn read(self, name: &'static str) -> Result<Option<JobId>, ApiError> {
        let job = |id: String| {
            JobId::parse(&id).ok_or_else(|| invalid_field(name, id, jobs::ID.values.expected()))
        };
        self.map(job).transpose()
    }
}

impl Criterion<Vec<JobId>> for Vec<String> {
    fn read(self, name: &'static str) -> Result<Vec<JobId>, ApiError> {
        let job = |id: String| {
            JobId::parse(&id).ok_or_else(|| invalid_field(name, id, jobs::ID.values.expected()))
        };
        self.into_iter().map(job).collect()
    }
}

impl Criterion<Vec<WarningCode>> for Vec<String> {
    fn read(self, name: &'static str) -> Result<Vec<WarningCode>, ApiError> {
        let all = Words::<WarningCode>::all();
        let code = |word: String| {
            let code = all.read(&word);
            code.ok_or_else(|| invalid_field(name, word, "the code of a warning"))
        };
        self.into_iter().map(code).collect()
    }
}

impl Criterion<Option<Time>> for Option<Timestamp> {
    fn read(self, name: &'static str) -> Result<Option<Time>, ApiError> {
        time(name, self)
    }
}

macro_rules! reader {
    ($($field:ident: $type:ty, $name:ident, $column:literal $comparison:literal, $index:expr, $meaning:literal;)*) => {
        /// Reads a filter of jobs; without a message every job matches.
        pub fn filter(message: Option<pb::JobFilter>) -> Result<Filter, ApiError> {
            let pb::JobFilter { labels, excluded_labels, $($name,)* } = message.unwrap_or_default();
            filters::checked(Filter {
                labels: labels.into_iter().collect(),
                excluded_labels: excluded_labels.into_iter().collect(),
                $($field: Criterion::<$type>::read($name, stringify!($name))?,)*
            })
        }
    };
}
job_filters!(reader);

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
