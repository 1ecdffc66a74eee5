//! Writing results, in pieces.
//!
//! Pieces are stored under the key of the job that was solved; other jobs may be answered with them. The partial
//! result of a running job (its finished load steps) is stored under the negative of its key, so that the final
//! result can be written beside it and replaces it when the job ends.

use sqlx::SqliteConnection;

use super::{
    database::Store,
    encoding::Content,
    error::Result,
    intact,
    parts::{Part, Parts, Piece},
    rows::{is_current, partial_key},
};
use crate::job::ResultAvailable;

impl Store {
    /// Writes the result of an attempt in several short transactions, all but its last megabyte, which is
    /// written when the job ends; false when the attempt is no longer the current one.
    pub async fn write_before_end(&self, key: i64, attempt: i32, parts: &Parts) -> Result<bool> {
        let write = async {
            let groups = parts.groups();
            let Some((_, all_but_last)) = groups.split_last() else {
                return Ok(true);
            };
            for (n, group) in all_but_last.iter().enumerate() {
                let mut tx = self.begin().await?;
                if !is_current(&mut tx, key, attempt).await? {
                    return Ok(false);
                }
                if n == 0 {
                    // removes the pieces of an earlier attempt that was interrupted while it wrote them
                    remove(&mut tx, key).await?;
                }
                insert(&mut tx, key, group).await?;
                tx.commit().await?;
            }
            Ok(true)
        };
        self.writing(write).await
    }

    /// Stores the partial result of a running job in place of an earlier one; false when the attempt is no longer
    /// the current one.
    pub async fn write_partial(&self, key: i64, attempt: i32, parts: &Parts) -> Result<bool> {
        let write = async {
            let mut change = self.change().await?;
            if !change.is_current(key, attempt).await? {
                return Ok(false);
            }
            let tx = change.sql().await?;
            remove(tx, partial_key(key)).await?;
            for group in parts.groups() {
                insert(tx, partial_key(key), &group).await?;
            }
            write_info(tx, partial_key(key), parts).await?;
            let partial = ResultAvailable::Partial;
            change
                .set(key, |row| row.job.result_available = partial)
                .await?;
            change.commit().await?;
            Ok(true)
        };
        self.writing(write).await
    }
}

/// Writes the last pieces of a result, and the size and hash of each part, in the transaction that ends the job.
pub(super) async fn write_at_end(tx: &mut SqliteConnection, key: i64, parts: &Parts) -> Result<()> {
    let groups = parts.groups();
    if groups.len() == 1 {
        remove(tx, key).await?;
    }
    if let Some(last) = groups.last() {
        insert(tx, key, last).await?;
    }
    write_info(tx, key, parts).await
}

/// The partial result of a running job becomes its result; but its history is that of its events, which continued
/// after the last finished load step.
pub(super) async fn keep_partial(tx: &mut SqliteConnection, key: i64) -> Result<()> {
    remove(tx, key).await?;
    let names: Vec<String> =
        sqlx::query_scalar("select distinct name from result_part where job_id = ?")
            .bind(partial_key(key))
            .fetch_all(&mut *tx)
            .await?;
    // a checksum includes the key, so the rows are written anew; partial results are small
    for name in names.into_iter().filter(|name| name != "history") {
        // partial results have no fields
        let read = intact::read_part(tx, partial_key(key), &name).await?;
        if let Some((_, Content::Json(json))) = read {
            let parts = Parts(vec![Part::new(name, &json)]);
            for group in parts.groups() {
                insert(tx, key, &group).await?;
            }
            write_info(tx, key, &parts).await?;
        }
    }
    remove(tx, partial_key(key)).await
}

/// Removes the result under this key.
pub(super) async fn remove(tx: &mut SqliteConnection, key: i64) -> Result<()> {
    sqlx::query(
        "delete from result_part where job_id = ?1; delete from result_info where job_id = ?1;",
    )
    .bind(key)
    .execute(tx)
    .await?;
    Ok(())
}

/// Writes pieces.
async fn insert(tx: &mut SqliteConnection, key: i64, group: &[Piece<'_>]) -> Result<()> {
    for Piece { name, number, body } in group {
        let checksum = intact::piece_checksum(key, name, *number, body).stored();
        sqlx::query(
            "insert into result_part (job_id, name, piece, body, checksum) values (?, ?, ?, ?, ?)",
        )
        .bind(key)
        .bind(*name)
        .bind(number)
        .bind(*body)
        .bind(checksum)
        .execute(&mut *tx)
        .await?;
    }
    Ok(())
}

/// Writes the size and hash of each part.
async fn write_info(tx: &mut SqliteConnection, key: i64, parts: &Parts) -> Result<()> {
    for part in &parts.0 {
        let (bytes, encoding) = (part.info.bytes as i64, part.encoding.stored());
        let checksum = intact::info_checksum(
            key,
            &part.name,
            &(
                bytes,
                part.info.digest.clone(),
                encoding,
                Some(part.stored_digest.clone()),
            ),
        );
        sqlx::query(
            "insert or replace into result_info (job_id, name, bytes, digest, checksum, encoding, stored_digest)
             values (?, ?, ?, ?, ?, ?, ?)",
        )
        .bind(key)
        .bind(&part.name)
        .bind(bytes)
        .bind(&part.info.digest)
        .bind(checksum.stored())
        .bind(encoding)
        .bind(&part.stored_digest)
        .execute(&mut *tx)
        .await?;
    }
    Ok(())
}
