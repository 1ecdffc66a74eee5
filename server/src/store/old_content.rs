//! What versions before step 17 of the tables stored in five of them, moved to content: problems, results, partial results,
//! meshes, definitions of sweeps. It is done once, between steps 17 and 18, some at a time: an interrupted start goes on where it was.
//!
//! What a disk has changed stays damaged: a result is moved as it is, so that reading it finds that; a problem, a definition or
//! a mesh that differs from its checksum is left out, and missing.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use sqlx::{Row, SqliteConnection, SqlitePool, sqlite::SqliteRow};

use super::{
    checksum::{self, Checksum, Value},
    content::{self, Holder, NewContent, name},
    encoding::{Encoding, PartInfo, info_of_json},
    error::Result,
    parts::{Part, Parts},
};

/// What is moved in one transaction: results, jobs or meshes.
const AT_ONCE: usize = 50;
/// How often the log tells how far it is.
const TOLD_EVERY: Duration = Duration::from_secs(5);

/// Moves all of it.
pub(super) async fn move_all(database: &SqlitePool) -> Result<()> {
    let mut told = Instant::now();
    let mut moved = 0;
    let mut tell = |count: usize, what: &str| {
        moved += count;
        if told.elapsed() > TOLD_EVERY {
            told = Instant::now();
            tracing::info!(
                moved,
                "the store is brought up to date: {moved} {what} are done"
            );
        }
    };
    loop {
        let mut tx = database.begin_with("begin immediate").await?;
        let count = move_results(&mut tx).await?;
        tx.commit().await?;
        if count == 0 {
            break;
        }
        tell(count, "results");
    }
    let mut last = 0;
    loop {
        let mut tx = database.begin_with("begin immediate").await?;
        let count = move_from_jobs(&mut tx, &mut last).await?;
        tx.commit().await?;
        if count == 0 {
            break;
        }
        tell(count, "results and jobs");
    }
    let mut last = 0;
    loop {
        let mut tx = database.begin_with("begin immediate").await?;
        let more = move_mesh(&mut tx, &mut last).await?;
        tx.commit().await?;
        if !more {
            return Ok(());
        }
        tell(1, "results, jobs and meshes");
    }
}

/// Moves some results; how many. They were stored under the key of the job that was solved, partial ones under its negative.
async fn move_results(tx: &mut SqliteConnection) -> Result<usize> {
    let keys: Vec<i64> = sqlx::query_scalar(
        "select distinct job_id from (select job_id from result_info union select job_id from result_part) order by 1 limit ?",
    )
    .bind(AT_ONCE as i64)
    .fetch_all(&mut *tx)
    .await?;
    for key in &keys {
        let holders = holders(tx, *key).await?;
        if !holders.is_empty() {
            let parts = Parts::new(old_parts(tx, *key).await?);
            for (name, content) in parts.contents() {
                for (job, lost_fields) in &holders {
                    if name != name::FIELDS || !lost_fields {
                        content::attach(tx, Holder::Job(*job), name, &content).await?;
                    }
                }
            }
        }
        let delete =
            "delete from result_part where job_id = ?1; delete from result_info where job_id = ?1;";
        sqlx::query(delete).bind(key).execute(&mut *tx).await?;
    }
    Ok(keys.len())
}

/// The jobs that have the result under this key, and whether their fields were deleted.
async fn holders(tx: &mut SqliteConnection, key: i64) -> Result<Vec<(i64, bool)>> {
    let of_jobs = "select id, exists (select 1 from job_size where job_id = id and fields = 2) from job
         where (?1 < 0 and id = -?1 and finished_at is null)
               or (result_job = ?1 and finished_at is not null and result_available <> 'none')
               or (id = ?1 and result_job is null and finished_at is not null and result_available <> 'none')";
    Ok(sqlx::query_as(of_jobs).bind(key).fetch_all(tx).await?)
}

/// The parts of a result.
async fn old_parts(tx: &mut SqliteConnection, key: i64) -> Result<Vec<Part>> {
    let names: Vec<String> = sqlx::query_scalar(
        "select name from result_info where job_id = ?1 union select name from result_part where job_id = ?1",
    )
    .bind(key)
    .fetch_all(&mut *tx)
    .await?;
    let mut parts = vec![];
    for name in names {
        parts.extend(old_part(tx, key, name).await?);
    }
    Ok(parts)
}

/// Size and hash of JSON that there is not.
fn of_nothing() -> PartInfo {
    PartInfo {
        bytes: 0,
        digest: vec![],
    }
}

/// A part of a result; `None` if nothing is kept of it.
async fn old_part(tx: &mut SqliteConnection, key: i64, name: String) -> Result<Option<Part>> {
    let pieces: Vec<(i64, Vec<u8>, Option<i64>)> = sqlx::query_as(
        "select piece, body, checksum from result_part where job_id = ? and name = ? order by piece",
    )
    .bind(key)
    .bind(&name)
    .fetch_all(&mut *tx)
    .await?;
    let (mut body, mut intact) = (vec![], true);
    for (expected, (piece, bytes, stored)) in (0..).zip(&pieces) {
        let sum = Checksum::new()
            .int(key)
            .text(&name)
            .int(*piece)
            .bytes(bytes);
        intact &= *piece == expected && is_intact(sum, *stored);
        body.extend_from_slice(bytes);
    }
    let info = sqlx::query("select * from result_info where job_id = ? and name = ?")
        .bind(key)
        .bind(&name)
        .fetch_optional(tx)
        .await?;
    let (encoding, info) = match info {
        // a version without checksums kept size and hash of a history that it had removed
        Some(row) if pieces.is_empty() && row.try_get::<Option<i64>, _>("checksum")?.is_none() => {
            return Ok(None);
        }
        Some(row) => old_info(&row)?.unwrap_or((Encoding::Plain, of_nothing())),
        // of a version that did not store size and hash
        None if intact => (Encoding::Plain, info_of_json(&body)),
        None => (Encoding::Plain, of_nothing()),
    };
    Ok(Some(Part {
        name,
        encoding,
        body,
        info,
    }))
}

/// How a part is encoded, and size and hash of its JSON; `None` if the row is damaged.
fn old_info(row: &SqliteRow) -> Result<Option<(Encoding, PartInfo)>> {
    let (key, name, bytes): (i64, String, i64) = (
        row.try_get("job_id")?,
        row.try_get("name")?,
        row.try_get("bytes")?,
    );
    let digest: Vec<u8> = row.try_get("digest")?;
    let encoding: Option<i64> = row.try_get("encoding")?;
    let stored_digest: Option<Vec<u8>> = row.try_get("stored_digest")?;
    let mut sum = Checksum::new().int(key).text(&name).int(bytes);
    sum = sum.bytes(&digest);
    if let Some(encoding) = encoding {
        sum = sum.int(encoding);
    }
    if let Some(digest) = stored_digest {
        sum = sum.bytes(&digest);
    }
    let encoding = match encoding {
        None => Encoding::Plain,
        Some(1) => Encoding::Deflated,
        Some(2) => Encoding::Columns,
        Some(_) => return Ok(None),
    };
    let bytes = bytes.unsigned_abs();
    let intact = is_intact(sum, row.try_get("checksum")?);
    Ok(intact.then_some((encoding, PartInfo { bytes, digest })))
}

/// Rows of early versions have no checksum.
fn is_intact(sum: Checksum, stored: Option<i64>) -> bool {
    stored.is_none_or(|stored| stored == sum.stored())
}

/// Gives some jobs after this one their problem, the definition of their sweep, and what only the row of the problem told; how many.
async fn move_from_jobs(tx: &mut SqliteConnection, last: &mut i64) -> Result<usize> {
    let rows = sqlx::query("select * from job where id > ? order by id limit ?")
        .bind(*last)
        .bind(AT_ONCE as i64)
        .fetch_all(&mut *tx)
        .await?;
    for row in &rows {
        let key: i64 = row.try_get("id")?;
        *last = key;
        let values = checksum::values(row)?;
        let stored: Option<i64> = row.try_get("checksum")?;
        if stored.is_some_and(|stored| stored != checksum::of_values(&values)) {
            continue; // it stays damaged
        }
        move_from_job(tx, key, row, values).await?;
    }
    Ok(rows.len())
}

async fn move_from_job(
    tx: &mut SqliteConnection,
    key: i64,
    row: &SqliteRow,
    mut values: Vec<Value>,
) -> Result<()> {
    let job = Holder::Job(key);
    if content::find(tx, job, name::PROBLEM).await?.is_some() {
        return Ok(()); // before an interruption
    }
    let input_hash: &str = row.try_get("input_hash")?;
    let problem = old_problem(tx, input_hash).await?;
    if let Some((body, ..)) = &problem {
        content::attach(tx, job, name::PROBLEM, &NewContent::new(body.as_bytes())).await?;
    }
    if let Some(sweep) = row.try_get::<Option<&str>, _>("sweep")?
        && let Some(definition) = old_definition(tx, sweep).await?
    {
        let definition = NewContent::new(definition.as_bytes());
        content::attach(tx, job, name::DEFINITION, &definition).await?;
    }
    let (mesh, memory) = problem.map_or((None, None), |(_, mesh, memory)| (mesh, memory));
    let names: Vec<&str> = columns_of(row).collect();
    let new = BTreeMap::from([
        ("result_job", Value::from(memory)),
        ("mesh", Value::from(mesh.clone())),
    ]);
    for (name, value) in names.iter().zip(&mut values) {
        if let Some(new) = new.get(name) {
            *value = new.clone();
        }
    }
    sqlx::query("update job set result_job = ?, mesh = ?, checksum = ? where id = ?")
        .bind(memory)
        .bind(mesh)
        .bind(checksum::of_values(&values))
        .bind(key)
        .execute(tx)
        .await?;
    Ok(())
}

/// The names of the columns whose values [`checksum::values`] returns.
fn columns_of(row: &SqliteRow) -> impl Iterator<Item = &str> {
    let names = row.columns().iter().map(sqlx::Column::name);
    names.filter(|name| *name != "checksum")
}

/// Body, mesh and memory of a problem, unless it is damaged.
async fn old_problem(
    tx: &mut SqliteConnection,
    input_hash: &str,
) -> Result<Option<(String, Option<String>, Option<i64>)>> {
    let found = sqlx::query("select * from problem where input_hash = ?")
        .bind(input_hash)
        .fetch_optional(tx)
        .await?;
    let Some(row) = found else { return Ok(None) };
    let (body, mesh): (String, Option<String>) = (row.try_get("body")?, row.try_get("mesh")?);
    let memory: Option<i64> = row.try_get("memory_bytes")?;
    let mut sum = Checksum::new().text(input_hash).text(&body);
    sum = sum.optional(mesh.as_deref());
    if let Some(bytes) = memory {
        sum = sum.int(bytes);
    }
    let intact = is_intact(sum, row.try_get("checksum")?);
    Ok(intact.then_some((body, mesh, memory)))
}

/// The definition of a sweep, unless it is damaged.
async fn old_definition(tx: &mut SqliteConnection, uuid: &str) -> Result<Option<String>> {
    let found = sqlx::query(
        "select sweep_definition.* from sweep_definition join sweep on sweep.id = sweep where uuid = ?",
    )
    .bind(uuid)
    .fetch_optional(tx)
    .await?;
    let Some(row) = found else { return Ok(None) };
    let (key, body): (i64, String) = (row.try_get("sweep")?, row.try_get("body")?);
    let sum = Checksum::new().int(key).text(&body);
    let intact = is_intact(sum, row.try_get("checksum")?);
    Ok(intact.then_some(body))
}

/// Moves the body of the first mesh after this one; false if there is none.
async fn move_mesh(tx: &mut SqliteConnection, last: &mut i64) -> Result<bool> {
    let found = sqlx::query("select * from mesh where id > ? order by id limit 1")
        .bind(*last)
        .fetch_optional(&mut *tx)
        .await?;
    let Some(row) = found else { return Ok(false) };
    *last = row.try_get("id")?;
    let (mesh, hash) = (Holder::Mesh(*last), row.try_get::<&str, _>("hash")?);
    if content::find(tx, mesh, name::MESH).await?.is_some() {
        return Ok(true); // before an interruption
    }
    let pieces: Vec<(i64, Vec<u8>, Option<i64>)> = sqlx::query_as(
        "select piece, body, checksum from mesh_piece where hash = ? order by piece",
    )
    .bind(hash)
    .fetch_all(&mut *tx)
    .await?;
    let count: Option<i64> = row.try_get("pieces")?;
    let mut intact = count.is_none_or(|count| count == pieces.len() as i64) && !pieces.is_empty();
    let mut body = vec![];
    for (expected, (piece, bytes, stored)) in (0..).zip(&pieces) {
        let sum = Checksum::new().text(hash).int(*piece).bytes(bytes);
        intact &= *piece == expected && is_intact(sum, *stored);
        body.extend_from_slice(bytes);
    }
    if intact {
        content::attach(tx, mesh, name::MESH, &NewContent::new(&body)).await?;
    }
    let mut values = checksum::values(&row)?;
    let stored: Option<i64> = row.try_get("checksum")?;
    if stored.is_none_or(|stored| stored == checksum::of_values(&values)) {
        // the column `pieces` goes
        values.truncate(
            columns_of(&row)
                .take_while(|name| *name != "pieces")
                .count(),
        );
        sqlx::query("update mesh set pieces = null, checksum = ? where id = ?")
            .bind(checksum::of_values(&values))
            .bind(*last)
            .execute(&mut *tx)
            .await?;
    }
    let delete = sqlx::query("delete from mesh_piece where hash = ?").bind(hash);
    delete.execute(tx).await?;
    Ok(true)
}
