//! Problems, one for all jobs of the same input.

use sqlx::SqliteConnection;

use super::{
    checksum::Checksum,
    error::{Part, Result},
    submission::NewJob,
};
use crate::job::Job;

/// Writes the problem of a job, unless it is there already. One that is damaged is mended so.
pub(super) async fn write(tx: &mut SqliteConnection, new: &NewJob) -> Result<()> {
    let checksum = checksum(&new.input_hash, &new.problem, new.mesh.as_deref());
    sqlx::query(
        "insert into problem (input_hash, body, mesh, checksum) values (?, ?, ?, ?)
         on conflict do update set body = excluded.body, mesh = excluded.mesh, checksum = excluded.checksum
         where checksum is not excluded.checksum or body <> excluded.body",
    )
    .bind(&new.input_hash)
    .bind(&new.problem)
    .bind(&new.mesh)
    .bind(checksum.stored())
    .execute(tx)
    .await?;
    Ok(())
}

/// The problem of a job as JSON, without its title, and the stored mesh that it names.
pub(super) async fn read(tx: &mut SqliteConnection, job: &Job) -> Result<(String, Option<String>)> {
    let part = || Part::of_job(job.key, "problem");
    let found = sqlx::query_as("select body, mesh, checksum from problem where input_hash = ?")
        .bind(&job.input_hash)
        .fetch_optional(tx)
        .await;
    let found: Option<(String, Option<String>, Option<i64>)> =
        found.map_err(|error| crate::store::StoreError::from(error).reading(part))?;
    let (body, mesh, stored) = found.ok_or_else(|| part().damaged("it is missing"))?;
    checksum(&job.input_hash, &body, mesh.as_deref()).verify(stored, part)?;
    Ok((body, mesh))
}

fn checksum(input_hash: &str, body: &str, mesh: Option<&str>) -> Checksum {
    Checksum::new().text(input_hash).text(body).optional(mesh)
}
