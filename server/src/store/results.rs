//! Results: named parts, each in pieces, written before the job's end and served after it.
//!
//! Pieces stand under the number of the job that wrote them, which may serve several jobs. What a job that
//! still runs has found so far (its finished load steps) stands under the negative of its number: the
//! final result can then be written beside it, and takes its place with the job's end.

use std::collections::BTreeMap;

use serde_json::json;
use sha2::{Digest, Sha256};
use solver::solution::ContactProfile;
use sqlx::{Sqlite, SqliteConnection, Transaction};

use super::{Result, Store, jobs::is_current, rows::named};
use crate::{
    caller::Owners,
    job::{Job, JobId},
    run::Document,
};

/// Bytes of one piece of a stored result or mesh; larger rows make SQLite chain pages and readers hold more.
pub const PIECE_BYTES: usize = 256 << 10;
/// Pieces per transaction: 1 MiB holds the single writer for some ten milliseconds, so that a
/// cancel or a submit beside a large result still answers at once.
pub const PIECES_PER_COMMIT: usize = 4;

/// A document as it is stored: name, JSON and SHA-256 of each part.
#[derive(Debug)]
pub struct Parts(Vec<Part>);

#[derive(Debug)]
struct Part {
    name: String,
    body: Vec<u8>,
    digest: Vec<u8>,
}

/// What a part is, as bytes.
#[derive(Clone, Debug)]
pub struct PartInfo {
    /// Its length.
    pub bytes: u64,
    /// Its SHA-256.
    pub digest: Vec<u8>,
}

/// Where a running job keeps what it has found so far.
pub(super) fn running(key: i64) -> i64 {
    -key
}

impl Parts {
    /// Cuts a document into the parts that routes serve.
    pub fn of(document: &Document) -> serde_json::Result<Parts> {
        let mut parts = vec![
            (
                "summary".to_string(),
                serde_json::to_vec(&document.summary)?,
            ),
            (
                "history".to_string(),
                serde_json::to_vec(&document.history)?,
            ),
        ];
        // the rows of a step are among the history's; its profiles are served one by one
        let steps: Vec<_> = document
            .steps
            .iter()
            .map(|step| json!({"name": step.name, "summary": step.summary}))
            .collect();
        parts.push(("steps".to_string(), serde_json::to_vec(&steps)?));
        let mut add = |points, step, profiles: &BTreeMap<String, ContactProfile>| {
            for (boundary, profile) in profiles {
                let name = profile_part(boundary, points, step);
                parts.push((name, serde_json::to_vec(profile)?));
            }
            Ok::<_, serde_json::Error>(())
        };
        for (number, step) in document.steps.iter().enumerate() {
            add(ProfilePoints::Nodes, Some(number), &step.profiles)?;
            add(
                ProfilePoints::Friction,
                Some(number),
                &step.friction_profiles,
            )?;
        }
        add(ProfilePoints::Nodes, None, &document.profiles)?;
        add(ProfilePoints::Friction, None, &document.friction_profiles)?;
        if !document.fields.x.is_empty() {
            parts.push(("fields".to_string(), serde_json::to_vec(&document.fields)?));
        }
        let hashed = |(name, body): (String, Vec<u8>)| Part {
            digest: Sha256::digest(&body).to_vec(),
            name,
            body,
        };
        Ok(Parts(parts.into_iter().map(hashed).collect()))
    }

    /// All of them together.
    pub fn bytes(&self) -> usize {
        self.0.iter().map(|part| part.body.len()).sum()
    }

    /// All pieces, in groups that are written together.
    fn groups(&self) -> Vec<Vec<Piece<'_>>> {
        let mut groups: Vec<Vec<Piece<'_>>> = vec![vec![]];
        let mut bytes = 0;
        for part in &self.0 {
            for (number, body) in (0..).zip(part.body.chunks(PIECE_BYTES)) {
                if bytes + body.len() > PIECES_PER_COMMIT * PIECE_BYTES {
                    groups.push(vec![]);
                    bytes = 0;
                }
                bytes += body.len();
                if let Some(group) = groups.last_mut() {
                    group.push(Piece {
                        name: &part.name,
                        number,
                        body,
                    });
                }
            }
        }
        groups
    }
}

struct Piece<'a> {
    name: &'a str,
    number: i64,
    body: &'a [u8],
}

/// Where a stored profile has its values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProfilePoints {
    /// At the nodes of the boundary.
    Nodes,
    /// Where friction acts.
    Friction,
}

/// The part that holds the profile of a boundary, at the end or at the end of a load step.
fn profile_part(boundary: &str, points: ProfilePoints, step: Option<usize>) -> String {
    let kind = match points {
        ProfilePoints::Nodes => "profile",
        ProfilePoints::Friction => "friction",
    };
    match step {
        None => format!("{kind}/{boundary}"),
        Some(number) => format!("step/{number}/{kind}/{boundary}"),
    }
}

impl Store {
    /// Writes the result of this start of a job over several short transactions, all but its last
    /// megabyte, which is written with the job's end; false when the start is no longer current.
    pub async fn write_ahead(&self, key: i64, attempt: i32, parts: &Parts) -> Result<bool> {
        let groups = parts.groups();
        let Some((_, ahead)) = groups.split_last() else {
            return Ok(true);
        };
        for (n, group) in ahead.iter().enumerate() {
            let mut tx = self.begin().await?;
            if !is_current(&mut tx, key, attempt).await? {
                return Ok(false);
            }
            if n == 0 {
                // Pieces of an earlier start that died while it wrote them.
                remove(&mut tx, key).await?;
            }
            insert(&mut tx, key, group).await?;
            tx.commit().await?;
        }
        Ok(true)
    }

    /// Keeps what a running job has found so far, in place of what it had before; false when the start is
    /// no longer current.
    pub async fn write_partial(&self, key: i64, attempt: i32, parts: &Parts) -> Result<bool> {
        let mut tx = self.begin().await?;
        if !is_current(&mut tx, key, attempt).await? {
            return Ok(false);
        }
        remove(&mut tx, running(key)).await?;
        for group in parts.groups() {
            insert(&mut tx, running(key), &group).await?;
        }
        describe(&mut tx, running(key), parts).await?;
        sqlx::query("update job set result_available = 'partial' where id = ?")
            .bind(key)
            .execute(&mut *tx)
            .await?;
        tx.commit().await?;
        Ok(true)
    }

    /// A job with what there is of its result, as of one moment: while it runs, or is being deleted, the
    /// parts are replaced and removed.
    pub async fn snapshot(&self, owners: Owners<'_>, id: JobId) -> Result<Option<Snapshot>> {
        let mut tx = self.reader.begin().await?;
        let job = named(&mut tx, owners, id).await?;
        Ok(job.map(|job| Snapshot { job, tx }))
    }

    /// One piece of a part, from 0; `None` after the last.
    pub async fn piece(&self, key: i64, part: &str, piece: i64) -> Result<Option<Vec<u8>>> {
        Ok(sqlx::query_scalar(
            "select body from result_part where job_id = ? and name = ? and piece = ?",
        )
        .bind(key)
        .bind(part)
        .bind(piece)
        .fetch_optional(&self.reader)
        .await?)
    }
}

/// A job and its result as of one moment. It holds a reader: not for long.
pub struct Snapshot {
    /// The job; without its place in the queue.
    pub job: Job,
    tx: Transaction<'static, Sqlite>,
}

impl Snapshot {
    /// What a part is, as bytes.
    pub async fn part_info(&mut self, part: &str) -> Result<Option<PartInfo>> {
        let found: Option<(i64, Vec<u8>)> =
            sqlx::query_as("select bytes, digest from result_info where job_id = ? and name = ?")
                .bind(self.job.result_key)
                .bind(part)
                .fetch_optional(&mut *self.tx)
                .await?;
        if let Some((bytes, digest)) = found {
            let bytes = bytes as u64;
            return Ok(Some(PartInfo { bytes, digest }));
        }
        // stored before lengths and fingerprints were
        let body = self.part(part).await?;
        Ok(body.map(|body| PartInfo {
            bytes: body.len() as u64,
            digest: Sha256::digest(&body).to_vec(),
        }))
    }

    /// A whole part.
    pub async fn part(&mut self, part: &str) -> Result<Option<Vec<u8>>> {
        let pieces: Vec<Vec<u8>> = sqlx::query_scalar(
            "select body from result_part where job_id = ? and name = ? order by piece",
        )
        .bind(self.job.result_key)
        .bind(part)
        .fetch_all(&mut *self.tx)
        .await?;
        Ok((!pieces.is_empty()).then(|| pieces.concat()))
    }

    /// The profile of a boundary, at the end or at the end of a load step (from 0).
    pub async fn profile(
        &mut self,
        boundary: &str,
        points: ProfilePoints,
        step: Option<usize>,
    ) -> Result<Option<Vec<u8>>> {
        self.part(&profile_part(boundary, points, step)).await
    }

    /// The boundaries that have a profile.
    pub async fn profiled_boundaries(&mut self) -> Result<Vec<String>> {
        let prefix = profile_part("", ProfilePoints::Nodes, None);
        let names: Vec<String> = sqlx::query_scalar(
            "select name from result_part where job_id = ? and piece = 0 and substr(name, 1, ?) = ? order by name",
        )
        .bind(self.job.result_key)
        .bind(prefix.len() as i64)
        .bind(&prefix)
        .fetch_all(&mut *self.tx)
        .await?;
        Ok(names
            .iter()
            .map(|name| name[prefix.len()..].to_string())
            .collect())
    }
}

/// The last pieces of a result, with what its parts are. In the transaction of the job's end.
pub(super) async fn write_last(tx: &mut SqliteConnection, key: i64, parts: &Parts) -> Result<()> {
    let groups = parts.groups();
    if groups.len() == 1 {
        remove(tx, key).await?;
    }
    if let Some(last) = groups.last() {
        insert(tx, key, last).await?;
    }
    describe(tx, key, parts).await
}

/// What a job has found while it ran becomes its result; but its history is the one that was told, which
/// went on after the last finished load step.
pub(super) async fn promote(tx: &mut SqliteConnection, key: i64) -> Result<()> {
    remove(tx, key).await?;
    sqlx::query("delete from result_part where job_id = ? and name = 'history'")
        .bind(running(key))
        .execute(&mut *tx)
        .await?;
    for table in ["result_part", "result_info"] {
        let statement = format!("update {table} set job_id = ? where job_id = ?");
        sqlx::query(sqlx::AssertSqlSafe(statement))
            .bind(key)
            .bind(running(key))
            .execute(&mut *tx)
            .await?;
    }
    Ok(())
}

/// Removes all that is kept under this number.
pub(super) async fn remove(tx: &mut SqliteConnection, key: i64) -> Result<()> {
    for statement in [
        "delete from result_part where job_id = ?",
        "delete from result_info where job_id = ?",
    ] {
        sqlx::query(statement).bind(key).execute(&mut *tx).await?;
    }
    Ok(())
}

async fn insert(tx: &mut SqliteConnection, key: i64, group: &[Piece<'_>]) -> Result<()> {
    for Piece { name, number, body } in group {
        sqlx::query("insert into result_part (job_id, name, piece, body) values (?, ?, ?, ?)")
            .bind(key)
            .bind(*name)
            .bind(number)
            .bind(*body)
            .execute(&mut *tx)
            .await?;
    }
    Ok(())
}

async fn describe(tx: &mut SqliteConnection, key: i64, parts: &Parts) -> Result<()> {
    for part in &parts.0 {
        sqlx::query(
            "insert or replace into result_info (job_id, name, bytes, digest) values (?, ?, ?, ?)",
        )
        .bind(key)
        .bind(&part.name)
        .bind(part.body.len() as i64)
        .bind(&part.digest)
        .execute(&mut *tx)
        .await?;
    }
    Ok(())
}
