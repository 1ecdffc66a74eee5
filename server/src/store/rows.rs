//! A row of the table `job` as a [`Job`].

use std::{collections::BTreeMap, str::FromStr};

use sqlx::{Row, SqliteConnection, sqlite::SqliteRow};
use uuid::Uuid;

use super::{
    checksum,
    error::{Record, Result, StoreError},
};
use crate::{
    address::link,
    caller::Owners,
    catalog::explained_at,
    job::{Failure, Job, JobId, Limits, Reason, ResultAvailable, Status, SweepId},
    time::Time,
};

/// The job with this key, which must exist.
pub(super) async fn read(tx: &mut SqliteConnection, key: i64) -> Result<Job> {
    let found = find(tx, key).await?;
    found.ok_or_else(|| Record::of_job(key, "record").damaged("it is missing"))
}

/// Gives the row of a job that this transaction has changed its checksum. Every statement that changes a job sets it
/// to null, so that one which is not renewed does not deny what is right.
pub(super) async fn seal(tx: &mut SqliteConnection, key: i64) -> Result<()> {
    let row = sqlx::query("select * from job where id = ? and checksum is null")
        .bind(key)
        .fetch_optional(&mut *tx)
        .await?;
    if let Some(row) = row {
        sqlx::query("update job set checksum = ? where id = ?")
            .bind(checksum::of_row(&row)?)
            .bind(key)
            .execute(tx)
            .await?;
    }
    Ok(())
}

/// The job with this key, if it still exists.
pub(super) async fn find(connection: &mut SqliteConnection, key: i64) -> Result<Option<Job>> {
    let row = sqlx::query("select * from job where id = ?")
        .bind(key)
        .fetch_optional(connection)
        .await?;
    row.as_ref().map(from_row).transpose()
}

/// The job with this public id, without its queue position. A job of another owner is not found.
pub(super) async fn with_id(
    connection: &mut SqliteConnection,
    owners: Owners<'_>,
    id: JobId,
) -> Result<Option<Job>> {
    let row = sqlx::query("select * from job where uuid = ?")
        .bind(id.0.to_string())
        .fetch_optional(connection)
        .await?;
    let job = row.as_ref().map(from_row).transpose()?;
    Ok(job.filter(|job| owners.include(&job.owner)))
}

/// The key under which the partial result of a running job is kept.
pub(super) fn partial_key(key: i64) -> i64 {
    -key
}

/// Whether this attempt of the job is the current one, and running.
pub(super) async fn is_current(tx: &mut SqliteConnection, key: i64, attempt: i32) -> Result<bool> {
    Ok(sqlx::query_scalar(
        "select exists (select 1 from job where id = ? and status = 'running' and attempt = ?)",
    )
    .bind(key)
    .bind(attempt)
    .fetch_one(tx)
    .await?)
}

/// A row of the table as a job, if it is as it was written.
pub(super) fn from_row(row: &SqliteRow) -> Result<Job> {
    let read = || match checksum::row_is_intact(row)? {
        true => parse(row),
        false => Err(corrupt("checksum")),
    };
    let record = || Record {
        job: row.try_get("id").ok(),
        name: "record".into(),
    };
    read().map_err(|error| error.reading(record))
}

fn parse(row: &SqliteRow) -> Result<Job> {
    let uuid: &str = row.try_get("uuid")?;
    let id = JobId(Uuid::try_parse(uuid).map_err(|_| corrupt("uuid"))?);
    let status: Status = word("status", row.try_get("status")?)?;
    let reason: Option<&str> = row.try_get("reason")?;
    let time = |name: &str| -> Result<Option<Time>> {
        Ok(row.try_get::<Option<i64>, _>(name)?.map(Time::from_micros))
    };
    let created_at = Time::from_micros(row.try_get("created_at")?);
    let (started_at, finished_at) = (time("started_at")?, time("finished_at")?);
    let progress: Option<&str> = row.try_get("progress")?;
    let failure: Option<&str> = row.try_get("failure")?;
    let warnings: Option<&str> = row.try_get("warnings")?;
    let other = |name: &str| -> Result<Option<JobId>> {
        let uuid: Option<&str> = row.try_get(name)?;
        let read = |text| Uuid::try_parse(text).map(JobId).map_err(|_| corrupt(name));
        uuid.map(read).transpose()
    };
    let key: i64 = row.try_get("id")?;
    let result_key = match row.try_get::<Option<i64>, _>("result_job")? {
        Some(other) => other,
        None if status.is_terminal() => key,
        None => partial_key(key),
    };
    let failure: Option<Failure> = failure.map(serde_json::from_str).transpose()?;
    let mut job = Job {
        key,
        result_key,
        coalesced_into: row.try_get("coalesced_into")?,
        cache: word("cache", row.try_get("cache")?)?,
        id,
        status,
        reason: reason.map(|text| word("reason", text)).transpose()?,
        cancel_requested: row.try_get("cancel_requested")?,
        version: row.try_get("version")?,
        name: row.try_get("name")?,
        labels: serde_json::from_str(row.try_get("labels")?)?,
        owner: row.try_get("owner")?,
        priority: row.try_get("priority")?,
        attempt: row.try_get("attempt")?,
        max_attempts: row.try_get("max_attempts")?,
        input_hash: row.try_get("input_hash")?,
        cached_from: other("cached_from")?,
        parent: other("parent")?,
        sweep: other("sweep")?.map(|JobId(uuid)| SweepId(uuid)),
        pinned: row.try_get("pinned")?,
        created_at,
        started_at,
        finished_at,
        queue_wait_s: started_at.map(|start| created_at.seconds_until(start)),
        run_s: started_at
            .zip(finished_at)
            .map(|(start, end)| start.seconds_until(end)),
        queue: None,
        progress: progress.map(serde_json::from_str).transpose()?,
        limits: Limits {
            timeout_s: row.try_get("timeout_s")?,
            queue_ttl_s: row.try_get("queue_ttl_s")?,
        },
        // the prefix may be another one than when it was stored
        failure: failure.map(|failure| Failure {
            r#type: explained_at(&failure.code),
            ..failure
        }),
        result_available: word("result_available", row.try_get("result_available")?)?,
        warnings: warnings.map_or(Ok(vec![]), serde_json::from_str)?,
        stored_bytes: None,
        links: BTreeMap::new(),
    };
    job.links = links(&job);
    Ok(job)
}

/// The value of a word in this column.
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

/// The figures that can be drawn of a job, as far as its row says.
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
