//! Results: named parts, each in pieces, written before the job's end and served after it.

use serde_json::json;

use super::{Result, Store, jobs::is_current};
use crate::run::Document;

/// Bytes of one piece; larger rows make SQLite chain pages and readers hold more.
const PIECE_BYTES: usize = 256 << 10;
/// Pieces per transaction: 1 MiB holds the single writer for some ten milliseconds, so that a
/// cancel or a submit beside a large result still answers at once.
const PIECES_PER_COMMIT: usize = 4;

/// A document as it is stored: the name and the JSON of each part.
#[derive(Debug)]
pub struct Parts(Vec<(String, Vec<u8>)>);

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
        for (number, step) in document.steps.iter().enumerate() {
            for (boundary, profile) in &step.profiles {
                let name = profile_part(boundary, Some(number));
                parts.push((name, serde_json::to_vec(profile)?));
            }
        }
        for (boundary, profile) in &document.profiles {
            parts.push((profile_part(boundary, None), serde_json::to_vec(profile)?));
        }
        if !document.fields.x.is_empty() {
            parts.push(("fields".to_string(), serde_json::to_vec(&document.fields)?));
        }
        Ok(Parts(parts))
    }
}

/// The part that holds the profile of a boundary, at the end or at the end of a load step.
fn profile_part(boundary: &str, step: Option<usize>) -> String {
    match step {
        None => format!("profile/{boundary}"),
        Some(number) => format!("step/{number}/profile/{boundary}"),
    }
}

impl Store {
    /// Writes the result of this start of a job over several short transactions; false when the
    /// start is no longer current. It counts only when the job's end says so.
    pub async fn write_result(&self, key: i64, attempt: i32, parts: &Parts) -> Result<bool> {
        let pieces: Vec<(&str, usize, &[u8])> = parts
            .0
            .iter()
            .flat_map(|(name, bytes)| {
                bytes
                    .chunks(PIECE_BYTES)
                    .enumerate()
                    .map(move |(n, piece)| (name.as_str(), n, piece))
            })
            .collect();
        for (n, group) in pieces.chunks(PIECES_PER_COMMIT).enumerate() {
            let mut tx = self.begin().await?;
            if !is_current(&mut tx, key, attempt).await? {
                return Ok(false);
            }
            if n == 0 {
                // Pieces of an earlier start that died while it wrote them.
                sqlx::query("delete from result_part where job_id = ?")
                    .bind(key)
                    .execute(&mut *tx)
                    .await?;
            }
            for (name, piece, body) in group {
                sqlx::query(
                    "insert into result_part (job_id, name, piece, body) values (?, ?, ?, ?)",
                )
                .bind(key)
                .bind(name)
                .bind(*piece as i64)
                .bind(body)
                .execute(&mut *tx)
                .await?;
            }
            tx.commit().await?;
        }
        Ok(true)
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

    /// A whole part.
    pub async fn part(&self, key: i64, part: &str) -> Result<Option<Vec<u8>>> {
        let pieces: Vec<Vec<u8>> = sqlx::query_scalar(
            "select body from result_part where job_id = ? and name = ? order by piece",
        )
        .bind(key)
        .bind(part)
        .fetch_all(&self.reader)
        .await?;
        Ok((!pieces.is_empty()).then(|| pieces.concat()))
    }

    /// The profile of a boundary, at the end or at the end of a load step (from 0).
    pub async fn profile(
        &self,
        key: i64,
        boundary: &str,
        step: Option<usize>,
    ) -> Result<Option<Vec<u8>>> {
        self.part(key, &profile_part(boundary, step)).await
    }

    /// The boundaries that have a profile.
    pub async fn profiled_boundaries(&self, key: i64) -> Result<Vec<String>> {
        let prefix = profile_part("", None);
        let names: Vec<String> = sqlx::query_scalar(
            "select name from result_part where job_id = ? and piece = 0 and substr(name, 1, ?) = ? order by name",
        )
        .bind(key)
        .bind(prefix.len() as i64)
        .bind(&prefix)
        .fetch_all(&self.reader)
        .await?;
        Ok(names
            .iter()
            .map(|name| name[prefix.len()..].to_string())
            .collect())
    }
}
