//! Moves what versions before step 17 of the tables stored in five tables to content: problems, results, partial
//! results, meshes, definitions of sweeps. This is done once, between steps 17 and 18, a part at a time: after an
//! interrupted start it continues.
//!
//! What a disk has changed stays damaged: a result is moved as it is, so that reading it finds the damage; a problem, a
//! definition or a mesh that differs from its checksum is left out, and is then missing.

use std::time::{Duration, Instant};

use rusqlite::{Connection, Row, Transaction, TransactionBehavior};

use super::{
    checksum::{self, Checksum},
    content::{self, Holder, NewContent, name},
    encoding::{Encoding, PartInfo, info_of_json},
    error::Result,
    parts::{Part, Parts},
    sql::{Sql, optional_text, text},
};

/// The number of results or jobs that are moved in one transaction.
const AT_ONCE: usize = 50;
/// The time between two lines of the log that tell the progress.
const TOLD_EVERY: Duration = Duration::from_secs(5);

/// Moves all problems, results, definitions and meshes of earlier versions.
pub(super) fn move_all(database: &Connection) -> Result<()> {
    let begin = || Transaction::new_unchecked(database, TransactionBehavior::Immediate);
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
        let tx = begin()?;
        let count = move_results(&tx)?;
        tx.commit()?;
        if count == 0 {
            break;
        }
        tell(count, "results");
    }
    let mut last = 0;
    loop {
        let tx = begin()?;
        let count = move_from_jobs(&tx, &mut last)?;
        tx.commit()?;
        if count == 0 {
            break;
        }
        tell(count, "results and jobs");
    }
    let mut last = 0;
    loop {
        let tx = begin()?;
        let more = move_mesh(&tx, &mut last)?;
        tx.commit()?;
        if !more {
            return Ok(());
        }
        tell(1, "results, jobs and meshes");
    }
}

/// Moves some results; returns how many. A result was stored under the key of the job that was solved, a partial one
/// under the negative key.
fn move_results(tx: &Connection) -> Result<usize> {
    let keys: Vec<i64> = tx.values(
        "select distinct job_id from (select job_id from result_info union select job_id from result_part) order by 1 limit ?",
        [AT_ONCE as i64],
    )?;
    for key in &keys {
        let holders = holders(tx, *key)?;
        if !holders.is_empty() {
            let parts = Parts::new(old_parts(tx, *key)?);
            for (name, content) in parts.contents() {
                for (job, lost_fields) in &holders {
                    if name != name::FIELDS || !lost_fields {
                        content::attach(tx, Holder::Job(*job), name, &content)?;
                    }
                }
            }
        }
        tx.run("delete from result_part where job_id = ?", [key])?;
        tx.run("delete from result_info where job_id = ?", [key])?;
    }
    Ok(keys.len())
}

/// The keys of the jobs that have the result stored under `key`, each with whether its fields were deleted.
fn holders(tx: &Connection, key: i64) -> Result<Vec<(i64, bool)>> {
    let of_jobs = "select id, exists (select 1 from job_size where job_id = id and fields = 2) from job
         where (?1 < 0 and id = -?1 and finished_at is null)
               or (result_job = ?1 and finished_at is not null and result_available <> 'none')
               or (id = ?1 and result_job is null and finished_at is not null and result_available <> 'none')";
    tx.rows(of_jobs, [key], |row| Ok(row.try_into()?))
}

/// The parts of the result stored under `key`.
fn old_parts(tx: &Connection, key: i64) -> Result<Vec<Part>> {
    let names: Vec<String> = tx.values(
        "select name from result_info where job_id = ?1 union select name from result_part where job_id = ?1",
        [key],
    )?;
    let mut parts = vec![];
    for name in names {
        parts.extend(old_part(tx, key, name)?);
    }
    Ok(parts)
}

/// The size and hash of a part whose JSON is not known: no JSON has them.
fn of_nothing() -> PartInfo {
    PartInfo {
        bytes: 0,
        digest: vec![],
    }
}

/// A part of the result stored under `key`; `None` if only its size and hash were kept.
fn old_part(tx: &Connection, key: i64, name: String) -> Result<Option<Part>> {
    let pieces: Vec<(i64, Vec<u8>, Option<i64>)> = tx.rows(
        "select piece, body, checksum from result_part where job_id = ? and name = ? order by piece",
        (key, &name),
        |row| Ok(row.try_into()?),
    )?;
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
    let info = "select * from result_info where job_id = ? and name = ?";
    let info = tx.row(info, (key, &name), |row| {
        // a version without checksums kept size and hash of a history that it had removed
        if pieces.is_empty() && row.get::<_, Option<i64>>("checksum")?.is_none() {
            return Ok(None);
        }
        let info = old_info(row)?;
        Ok(Some(info.unwrap_or((Encoding::Plain, of_nothing()))))
    })?;
    let (encoding, info) = match info {
        Some(Some(info)) => info,
        Some(None) => return Ok(None),
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

/// The encoding of a part, and the size and hash of its JSON; `None` if the row is damaged.
fn old_info(row: &Row<'_>) -> Result<Option<(Encoding, PartInfo)>> {
    let (key, name) = (row.get("job_id")?, text(row, "name")?);
    let (bytes, digest): (i64, Vec<u8>) = (row.get("bytes")?, row.get("digest")?);
    let encoding: Option<i64> = row.get("encoding")?;
    let stored_digest: Option<Vec<u8>> = row.get("stored_digest")?;
    let mut sum = Checksum::new().int(key).text(name).int(bytes);
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
    let intact = is_intact(sum, row.get("checksum")?);
    Ok(intact.then_some((encoding, PartInfo { bytes, digest })))
}

/// Whether a checksum matches the stored one; a row of an early version, which has none, counts as intact.
fn is_intact(sum: Checksum, stored: Option<i64>) -> bool {
    stored.is_none_or(|stored| stored == sum.stored())
}

/// Whether the checksum of a whole row matches, if it has one.
fn row_is_intact(row: &Row<'_>) -> Result<bool> {
    let stored: Option<i64> = row.get("checksum")?;
    let found = checksum::of_row(row)?;
    Ok(stored.is_none_or(|stored| stored == found))
}

/// The columns of a job's row that are needed to move its content.
struct OldJob {
    input_hash: String,
    sweep: Option<String>,
}

/// Attaches content to some jobs after the job `last`: to each its problem and the definition of its sweep. Also sets
/// what only the row of the problem told: the mesh and the memory. Returns how many jobs.
fn move_from_jobs(tx: &Connection, last: &mut i64) -> Result<usize> {
    let jobs = "select * from job where id > ? order by id limit ?";
    let jobs = tx.rows(jobs, [*last, AT_ONCE as i64], |row| {
        let key: i64 = row.get("id")?;
        if !row_is_intact(row)? {
            return Ok((key, None)); // it stays damaged
        }
        let job = OldJob {
            input_hash: row.get("input_hash")?,
            sweep: row.get("sweep")?,
        };
        Ok((key, Some(job)))
    })?;
    for (key, job) in &jobs {
        *last = *key;
        if let Some(job) = job {
            move_from_job(tx, *key, job)?;
        }
    }
    Ok(jobs.len())
}

fn move_from_job(tx: &Connection, key: i64, old: &OldJob) -> Result<()> {
    let job = Holder::Job(key);
    if content::find(tx, job, name::PROBLEM)?.is_some() {
        return Ok(()); // before an interruption
    }
    let problem = old_problem(tx, &old.input_hash)?;
    if let Some((body, ..)) = &problem {
        content::attach(tx, job, name::PROBLEM, &NewContent::new(body.as_bytes()))?;
    }
    if let Some(sweep) = &old.sweep
        && let Some(definition) = old_definition(tx, sweep)?
    {
        let definition = NewContent::new(definition.as_bytes());
        content::attach(tx, job, name::DEFINITION, &definition)?;
    }
    let (mesh, memory) = problem.map_or((None, None), |(_, mesh, memory)| (mesh, memory));
    tx.run(
        "update job set result_job = ?, mesh = ? where id = ?",
        (memory, mesh, key),
    )?;
    checksum::seal(tx, "job", "id", key)
}

/// The body, mesh and memory of a problem.
type OldProblem = (String, Option<String>, Option<i64>);

/// The problem of this fingerprint, unless it is damaged.
fn old_problem(tx: &Connection, input_hash: &str) -> Result<Option<OldProblem>> {
    let found = "select * from problem where input_hash = ?";
    let found = tx.row(found, [input_hash], |row| {
        let (body, mesh) = (text(row, "body")?, optional_text(row, "mesh")?);
        let memory: Option<i64> = row.get("memory_bytes")?;
        let mut sum = Checksum::new().text(input_hash).text(body);
        sum = sum.optional(mesh);
        if let Some(bytes) = memory {
            sum = sum.int(bytes);
        }
        let intact = is_intact(sum, row.get("checksum")?);
        Ok(intact.then(|| (body.to_owned(), mesh.map(str::to_owned), memory)))
    })?;
    Ok(found.flatten())
}

/// The definition of the sweep with this id, unless it is damaged.
fn old_definition(tx: &Connection, uuid: &str) -> Result<Option<String>> {
    let found = tx.row(
        "select sweep_definition.* from sweep_definition join sweep on sweep.id = sweep where uuid = ?",
        [uuid],
        |row| {
            let body = text(row, "body")?;
            let sum = Checksum::new().int(row.get("sweep")?).text(body);
            let intact = is_intact(sum, row.get("checksum")?);
            Ok(intact.then(|| body.to_owned()))
        },
    )?;
    Ok(found.flatten())
}

/// The columns of a mesh's row that are needed to move its body.
struct OldMesh {
    key: i64,
    hash: String,
    /// The number of pieces of its body, if it is known.
    pieces: Option<i64>,
    is_intact: bool,
}

/// Moves the body of the first mesh after the mesh `last`; false if there is none.
fn move_mesh(tx: &Connection, last: &mut i64) -> Result<bool> {
    let found = "select * from mesh where id > ? order by id limit 1";
    let found = tx.row(found, [*last], |row| {
        Ok(OldMesh {
            key: row.get("id")?,
            hash: row.get("hash")?,
            pieces: row.get("pieces")?,
            is_intact: row_is_intact(row)?,
        })
    })?;
    let Some(old) = found else { return Ok(false) };
    *last = old.key;
    let (mesh, hash) = (Holder::Mesh(old.key), old.hash.as_str());
    if content::find(tx, mesh, name::MESH)?.is_some() {
        return Ok(true); // before an interruption
    }
    let pieces: Vec<(i64, Vec<u8>, Option<i64>)> = tx.rows(
        "select piece, body, checksum from mesh_piece where hash = ? order by piece",
        [hash],
        |row| Ok(row.try_into()?),
    )?;
    let count = pieces.len() as i64;
    let mut intact = old.pieces.is_none_or(|expected| expected == count) && !pieces.is_empty();
    let mut body = vec![];
    for (expected, (piece, bytes, stored)) in (0..).zip(&pieces) {
        let sum = Checksum::new().text(hash).int(*piece).bytes(bytes);
        intact &= *piece == expected && is_intact(sum, *stored);
        body.extend_from_slice(bytes);
    }
    if intact {
        content::attach(tx, mesh, name::MESH, &NewContent::new(&body))?;
    }
    if old.is_intact {
        // the column goes
        tx.run("update mesh set pieces = null where id = ?", [old.key])?;
        checksum::seal(tx, "mesh", "id", old.key)?;
    }
    tx.run("delete from mesh_piece where hash = ?", [hash])?;
    Ok(true)
}
