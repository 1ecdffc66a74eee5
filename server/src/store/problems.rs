//! Problems, one for all jobs of the same input.

use sqlx::SqliteConnection;

use super::{
    checksum::Checksum,
    error::{Record, Result},
    submission::NewJob,
};
use crate::job::Job;

/// A stored problem.
pub(super) struct StoredProblem {
    /// JSON, without its title.
    pub(super) body: String,
    /// The stored mesh that it names.
    pub(super) mesh: Option<String>,
    /// What it is estimated to need; unknown for those of earlier versions.
    pub(super) memory_bytes: Option<u64>,
}

/// Writes the problem of a job, unless it is there already. One that is damaged is mended so.
pub(super) async fn write(tx: &mut SqliteConnection, new: &NewJob) -> Result<()> {
    let memory_bytes = i64::try_from(new.memory_bytes).unwrap_or(i64::MAX);
    let checksum = checksum(
        &new.input_hash,
        &new.problem,
        new.mesh.as_deref(),
        Some(memory_bytes),
    );
    sqlx::query(
        "insert into problem (input_hash, body, mesh, memory_bytes, checksum) values (?, ?, ?, ?, ?)
         on conflict do update set body = excluded.body, mesh = excluded.mesh, memory_bytes = excluded.memory_bytes,
                                   checksum = excluded.checksum
         where checksum is not excluded.checksum or body <> excluded.body",
    )
    .bind(&new.input_hash)
    .bind(&new.problem)
    .bind(&new.mesh)
    .bind(memory_bytes)
    .bind(checksum.stored())
    .execute(tx)
    .await?;
    Ok(())
}

/// Body, mesh, memory and checksum.
type Columns = (String, Option<String>, Option<i64>, Option<i64>);

/// The problem of a job, which must exist.
pub(super) async fn read(tx: &mut SqliteConnection, job: &Job) -> Result<StoredProblem> {
    let record = || record(job);
    let found = find(tx, job).await.map_err(|error| error.reading(record))?;
    found.ok_or_else(|| record().damaged("it is missing"))
}

/// The problem of a job, in errors.
pub(super) fn record(job: &Job) -> Record {
    Record::of_job(job.key, "problem")
}

/// The problem of a job, if it is there. What cannot be read is an error of the database, what was changed one of the job.
pub(super) async fn find(
    connection: &mut SqliteConnection,
    job: &Job,
) -> Result<Option<StoredProblem>> {
    let found: Option<Columns> = sqlx::query_as(
        "select body, mesh, memory_bytes, checksum from problem where input_hash = ?",
    )
    .bind(&job.input_hash)
    .fetch_optional(connection)
    .await?;
    let Some((body, mesh, memory, stored)) = found else {
        return Ok(None);
    };
    checksum(&job.input_hash, &body, mesh.as_deref(), memory).verify(stored, || record(job))?;
    Ok(Some(StoredProblem {
        body,
        mesh,
        memory_bytes: memory.and_then(|bytes| u64::try_from(bytes).ok()),
    }))
}

fn checksum(input_hash: &str, body: &str, mesh: Option<&str>, memory: Option<i64>) -> Checksum {
    let sum = Checksum::new().text(input_hash).text(body).optional(mesh);
    match memory {
        Some(bytes) => sum.int(bytes),
        None => sum,
    }
}
