//! Reads, checks and writes rows of the table `job`. Only this file has statements that write this table, except
//! `old_content`, which moves what earlier versions stored.

use std::{collections::BTreeMap, str::FromStr};

use base::{
    address::link,
    caller::Owners,
    catalog::explained_at,
    job::{Failure, Job, JobId, Limits, Reason, ResultAvailable, Status},
    time::Time,
};
use rusqlite::{Connection, Row, params, params_from_iter, types::FromSql};
use serde::Serialize;
use uuid::Uuid;

use super::{
    checksum::{self, Value},
    error::{Record, Result, StoreError},
    sql::Sql,
};

/// All data of a row: the job as clients see it, and what only the store needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct JobRow {
    pub(super) job: Job,
    /// The title of the problem.
    pub(super) title: Option<String>,
    /// The fingerprint of everything that the client submitted; `None` in rows of early versions.
    pub(super) payload: Option<String>,
    /// The time at which the job fails unless it was started before.
    pub(super) expires_at: Option<Time>,
    /// The version of the program that ended the job.
    pub(super) solver_version: Option<String>,
    /// The number of the job's last event.
    pub(super) last_seq: i64,
}

/// The error that a job which must exist is missing.
pub(super) fn missing(key: i64) -> StoreError {
    Record::of_job(key, "record").damaged("it is missing")
}

/// The job with this key, if it still exists.
pub(super) fn find(connection: &Connection, key: i64) -> Result<Option<Job>> {
    Ok(find_row(connection, key)?.map(|(row, _)| row.job))
}

/// The row of the job with this key, if it still exists, and the values of its columns.
pub(super) fn find_row(connection: &Connection, key: i64) -> Result<Option<(JobRow, Vec<Value>)>> {
    connection.row("select * from job where id = ?", [key], checked)
}

/// The job with this public id, without its queue position. A job of another owner is not found.
pub(super) fn with_id(connection: &Connection, owners: &Owners, id: JobId) -> Result<Option<Job>> {
    let job = "select * from job where uuid = ?";
    let job = connection.row(job, [id.0.to_string()], from_row)?;
    Ok(job.filter(|job| owners.include(&job.owner)))
}

/// Whether this attempt of the job is the current one, and running.
pub(super) fn is_current(tx: &Connection, key: i64, attempt: i32) -> Result<bool> {
    let current =
        "select exists (select 1 from job where id = ? and status = 'running' and attempt = ?)";
    tx.value(current, (key, attempt))
}

/// The key of the next job: no key is given twice, not even that of a deleted job.
pub(super) fn next_key(tx: &Connection) -> Result<i64> {
    let next = "select coalesce((select seq from sqlite_sequence where name = 'job'), 0) + 1";
    tx.value(next, ())
}

/// Inserts a row; returns the values of its columns.
pub(super) fn insert(tx: &Connection, row: &JobRow) -> Result<Vec<Value>> {
    let (names, values) = row.columns()?;
    let places = "?, ".repeat(names.len());
    let names = names.join(", ");
    let statement = format!("insert into job ({names}, checksum) values ({places}?)");
    let checksum = Value::from(checksum::of_values(&values));
    tx.run(
        &statement,
        params_from_iter(values.iter().chain([&checksum])),
    )?;
    Ok(values)
}

/// Writes a row, of which the table has the values `stored`, with its checksum; returns its new values. Columns that
/// stay as they are, and their indexes, are not written.
pub(super) fn update(tx: &Connection, stored: &[Value], row: &JobRow) -> Result<Vec<Value>> {
    let (names, values) = row.columns()?;
    let columns = names.iter().zip(values.iter().zip(stored));
    let changed: Vec<_> = columns.filter(|(_, (new, old))| new != old).collect();
    if changed.is_empty() {
        return Ok(values);
    }
    let names = changed.iter().map(|(name, _)| format!("{name} = ?, "));
    let names: String = names.collect();
    let statement = format!("update job set {names}checksum = ? where id = ?");
    let new = changed.iter().map(|(_, (new, _))| *new);
    let last = [checksum::of_values(&values), row.job.key].map(Value::from);
    match tx.run(&statement, params_from_iter(new.chain(&last)))? {
        1 => Ok(values),
        _ => Err(missing(row.job.key)),
    }
}

/// Deletes a job, and the data that no other job shares.
pub(super) fn delete(tx: &Connection, job: &Job, now: Time) -> Result<()> {
    tx.run(
        "insert into deleted_job (uuid, id, owner, deleted_at) values (?, ?, ?, ?)",
        params![job.id.0.to_string(), job.key, job.owner, now.micros()],
    )?;
    for of_its_own in [
        "delete from event where job_id = ?",
        "delete from job_label where job_id = ?",
        "delete from job_size where job_id = ?",
        "delete from attachment where kind = 'job' and key = ?",
        "delete from job where id = ?",
    ] {
        tx.run(of_its_own, [job.key])?;
    }
    Ok(())
}

/// The job of a row of the table, if the checksum matches.
pub(super) fn from_row(row: &Row<'_>) -> Result<Job> {
    checked(row).map(|(row, _)| row.job)
}

/// A row of the table, and its values, if the checksum matches.
fn checked(row: &Row<'_>) -> Result<(JobRow, Vec<Value>)> {
    let read = || {
        let values = checksum::values(row)?;
        match row.get::<_, Option<i64>>("checksum")? {
            Some(sum) if sum == checksum::of_values(&values) => Ok((parse(&values)?, values)),
            _ => Err(corrupt("checksum")),
        }
    };
    let record = || Record {
        job: row.get("id").ok(),
        name: "record".into(),
    };
    read().map_err(|error: StoreError| error.reading(record))
}

/// The columns of the table, in its order, without the checksum. A column that a migration adds is added here and where rows
/// are read and written.
const COLUMNS: [&str; 37] = [
    "id",
    "uuid",
    "status",
    "reason",
    "cancel_requested",
    "version",
    "name",
    "title",
    "labels",
    "owner",
    "priority",
    "attempt",
    "max_attempts",
    "input_hash",
    "created_at",
    "started_at",
    "finished_at",
    "progress",
    "failure",
    "result_available",
    "last_seq",
    "payload",
    "parent",
    "pinned",
    "cache",
    "cached_from",
    "memory_bytes",
    "coalesced_into",
    "timeout_s",
    "queue_ttl_s",
    "expires_at",
    "solver_version",
    "sweep",
    "warnings",
    "mesh",
    "verdict",
    "quantities",
];

/// The values of a row's columns.
struct Values<'r>(&'r [Value]);

impl<'r> Values<'r> {
    /// The value of a column. Its place is looked up here: SQLite compares the names of all columns for each value.
    fn value(&self, column: &'static str) -> Result<&'r Value> {
        let place = COLUMNS.iter().position(|name| *name == column);
        let value = place.and_then(|place| self.0.get(place));
        value.ok_or_else(|| corrupt(column))
    }

    fn get<T: FromSql>(&self, column: &'static str) -> Result<T> {
        Ok(T::column_result(self.value(column)?.into())?)
    }

    fn text(&self, column: &'static str) -> Result<&'r str> {
        self.optional_text(column)?.ok_or_else(|| corrupt(column))
    }

    fn optional_text(&self, column: &'static str) -> Result<Option<&'r str>> {
        match self.value(column)? {
            Value::Null => Ok(None),
            Value::Text(text) => Ok(Some(text)),
            _ => Err(corrupt(column)),
        }
    }
}

fn parse(values: &[Value]) -> Result<JobRow> {
    let row = Values(values);
    let uuid = row.text("uuid")?;
    let reason = row.optional_text("reason")?;
    let time =
        |name| -> Result<Option<Time>> { Ok(row.get::<Option<i64>>(name)?.map(Time::from_micros)) };
    let progress = row.optional_text("progress")?;
    let memory_bytes: Option<i64> = row.get("memory_bytes")?;
    let failure = row.optional_text("failure")?;
    let warnings = row.optional_text("warnings")?;
    let verdict = row.optional_text("verdict")?;
    let quantities = row.optional_text("quantities")?;
    let other = |name| -> Result<Option<JobId>> {
        let uuid = row.optional_text(name)?;
        let read = |text| {
            Uuid::try_parse(text)
                .map(JobId::from)
                .map_err(|_| corrupt(name))
        };
        uuid.map(read).transpose()
    };
    let failure: Option<Failure> = failure.map(serde_json::from_str).transpose()?;
    let job = Job {
        key: row.get("id")?,
        coalesced_into: row.get("coalesced_into")?,
        cache: word("cache", row.text("cache")?)?,
        id: JobId::from(Uuid::try_parse(uuid).map_err(|_| corrupt("uuid"))?),
        status: word("status", row.text("status")?)?,
        reason: reason.map(|text| word("reason", text)).transpose()?,
        cancel_requested: row.get("cancel_requested")?,
        version: row.get("version")?,
        name: row.get("name")?,
        labels: serde_json::from_str(row.text("labels")?)?,
        owner: row.get("owner")?,
        priority: row.get("priority")?,
        attempt: row.get("attempt")?,
        max_attempts: row.get("max_attempts")?,
        input_hash: row.get("input_hash")?,
        cached_from: other("cached_from")?,
        parent: other("parent")?,
        sweep: other("sweep")?.map(|id| id.0.into()),
        pinned: row.get("pinned")?,
        created_at: Time::from_micros(row.get("created_at")?),
        started_at: time("started_at")?,
        finished_at: time("finished_at")?,
        progress: progress.map(serde_json::from_str).transpose()?,
        limits: Limits {
            timeout_s: row.get("timeout_s")?,
            queue_ttl_s: row.get("queue_ttl_s")?,
        },
        // the prefix may be another one than when it was stored
        failure: failure.map(|failure| Failure {
            r#type: explained_at(&failure.code),
            ..failure
        }),
        result_available: word("result_available", row.text("result_available")?)?,
        verdict: verdict.map(|text| word("verdict", text)).transpose()?,
        quantities: quantities.map_or(Ok(vec![]), serde_json::from_str)?,
        warnings: warnings.map_or(Ok(vec![]), serde_json::from_str)?,
        mesh: row.get("mesh")?,
        memory_bytes: memory_bytes.map(i64::unsigned_abs),
        // what follows from the rest, below; and what others fill in
        ..Job::default()
    };
    let mut row = JobRow {
        job,
        title: row.get("title")?,
        payload: row.get("payload")?,
        expires_at: time("expires_at")?,
        solver_version: row.get("solver_version")?,
        last_seq: row.get("last_seq")?,
    };
    row.derive();
    Ok(row)
}

impl JobRow {
    /// Computes the job's waiting time, running time and links from its other fields.
    pub(super) fn derive(&mut self) {
        let job = &mut self.job;
        let started = job.started_at;
        job.queue_wait_s = started.map(|start| job.created_at.seconds_until(start));
        let run = started.zip(job.finished_at);
        job.run_s = run.map(|(start, end)| start.seconds_until(end));
        job.links = links(job);
    }

    /// The names and values of the row's columns, in the order of the table, without the checksum.
    fn columns(&self) -> Result<(Vec<&'static str>, Vec<Value>)> {
        let job = &self.job;
        let uuid = |id: Option<JobId>| Value::from(id.map(|id| id.0.to_string()));
        let micros = |time: Option<Time>| Value::from(time.map(Time::micros));
        let memory_bytes = job.memory_bytes.map(|bytes| bytes as i64);
        let warnings = (!job.warnings.is_empty()).then_some(&job.warnings);
        let quantities = (!job.quantities.is_empty()).then_some(&job.quantities);
        let columns = [
            ("id", job.key.into()),
            ("uuid", uuid(Some(job.id))),
            ("status", word_of(job.status)),
            ("reason", job.reason.map(word_of).into()),
            ("cancel_requested", i64::from(job.cancel_requested).into()),
            ("version", job.version.into()),
            ("name", job.name.clone().into()),
            ("title", self.title.clone().into()),
            ("labels", json(Some(&job.labels))?),
            ("owner", job.owner.clone().into()),
            ("priority", i64::from(job.priority).into()),
            ("attempt", i64::from(job.attempt).into()),
            ("max_attempts", i64::from(job.max_attempts).into()),
            ("input_hash", job.input_hash.clone().into()),
            ("created_at", micros(Some(job.created_at))),
            ("started_at", micros(job.started_at)),
            ("finished_at", micros(job.finished_at)),
            ("progress", json(job.progress.as_ref())?),
            ("failure", json(job.failure.as_ref())?),
            ("result_available", word_of(job.result_available)),
            ("last_seq", self.last_seq.into()),
            ("payload", self.payload.clone().into()),
            ("parent", uuid(job.parent)),
            ("pinned", i64::from(job.pinned).into()),
            ("cache", word_of(job.cache)),
            ("cached_from", uuid(job.cached_from)),
            ("memory_bytes", memory_bytes.into()),
            ("coalesced_into", job.coalesced_into.into()),
            ("timeout_s", Value::Real(job.limits.timeout_s)),
            ("queue_ttl_s", Value::Real(job.limits.queue_ttl_s)),
            ("expires_at", micros(self.expires_at)),
            ("solver_version", self.solver_version.clone().into()),
            ("sweep", uuid(job.sweep.map(|id| id.0.into()))),
            ("warnings", json(warnings)?),
            ("mesh", job.mesh.clone().into()),
            ("verdict", job.verdict.map(word_of).into()),
            ("quantities", json(quantities)?),
        ];
        Ok(columns.into_iter().unzip())
    }
}

fn json<T: Serialize>(value: Option<&T>) -> Result<Value> {
    let text = value.map(serde_json::to_string).transpose()?;
    Ok(text.into())
}

fn word_of(word: impl Into<&'static str>) -> Value {
    let word: &str = word.into();
    word.to_owned().into()
}

/// The value that this word stands for in this column.
fn word<T: FromStr>(column: &str, text: &str) -> Result<T> {
    text.parse().map_err(|_| corrupt(column))
}

fn corrupt(column: &str) -> StoreError {
    Record::named("record").damaged(format!("job.{column}"))
}

fn links(job: &Job) -> BTreeMap<String, String> {
    let id = job.id;
    let plots = plots(job).into_iter().map(|plot| {
        (
            format!("plot_{plot}"),
            link(&format!("/v1/jobs/{id}/plots/{plot}.svg")),
        )
    });
    ["problem", "events", "history", "result", "fields", "cancel"]
        .into_iter()
        .map(|verb| (verb.to_string(), link(&format!("/v1/jobs/{id}/{verb}"))))
        .chain([
            ("self".to_string(), link(&format!("/v1/jobs/{id}"))),
            // a template: the boundaries are those of the problem
            (
                "profiles".to_string(),
                link(&format!("/v1/jobs/{id}/profiles/{{boundary}}")),
            ),
        ])
        .chain(plots)
        .collect()
}

/// The names of the figures that can be drawn of a job, as far as its row tells.
fn plots(job: &Job) -> Vec<&'static str> {
    // without contacts there is one iteration without a residual; a job that was answered by another one has counted none itself
    let iterations = job.progress.as_ref().is_some_and(|made| {
        made.iteration > 1 || (made.iteration == 1 && made.residual.is_some_and(|left| left > 0.0))
    });
    let has_contacts = iterations || job.cached_from.is_some();
    let has_result = job.result_available != ResultAvailable::None;
    // fields are those of a solver that came to an end by itself
    let solved = job.status == Status::Succeeded
        || (job.status == Status::Failed
            && job.reason.is_some_and(|reason| {
                matches!(
                    reason,
                    Reason::NotConverged | Reason::ContactCycling | Reason::FalseConvergence
                )
            }));
    [
        ("mesh", true),
        ("convergence", has_contacts),
        ("profile", has_contacts && has_result),
        ("deformed", solved && has_result),
    ]
    .into_iter()
    .filter_map(|(plot, is_there)| is_there.then_some(plot))
    .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::Store;

    #[tokio::test]
    async fn the_columns_are_those_of_the_table() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path()).await.unwrap();
        let names = "select name from pragma_table_info('job') where name <> 'checksum'";
        let names = store.read(|_, connection| connection.values::<String>(names, ()));
        let names = names.await.unwrap();
        assert_eq!(names, JobRow::default().columns().unwrap().0);
        assert_eq!(names, COLUMNS);
    }
}
