//! Results, written: piece by piece before the job's end, or in place of what it had found before.
//!
//! Pieces stand under the number of the job that wrote them, which may serve several jobs. What a job that
//! still runs has found so far (its finished load steps) stands under the negative of its number: the
//! final result can then be written beside it, and takes its place with the job's end.

use sqlx::SqliteConnection;

use super::{
    database::Store,
    error::Result,
    parts::{Parts, Piece},
    rows::{is_current, running},
};

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
