//! Copying what is intact to a new store, row by row.

use std::path::Path;

use sqlx::{AssertSqlSafe, Column, Row, SqliteConnection, sqlite::SqliteRow};

use super::{
    checksum::{self, Value},
    content::{self, Holder, NewContent},
    database::{Rebuild, Store, Writing, with_advice},
    error::{Result, StoreError},
    rows::JobRow,
    sizes,
};
use crate::job::Job;

/// A store in a folder that must be empty or missing.
pub(super) async fn new_store(folder: &Path) -> Result<Store> {
    let empty = std::fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_none());
    if !empty {
        let text = format!("{} is not empty; name a new folder", folder.display());
        return Err(StoreError::Folder(text));
    }
    let connected = Store::connect(folder, Rebuild::Never).await;
    let (store, _) = connected.map_err(|error| with_advice(error, folder))?;
    // jobs refer to each other, and are copied in the order of their numbers
    let mut writer = store.writer.acquire().await?;
    sqlx::query("pragma foreign_keys = off")
        .execute(&mut *writer)
        .await?;
    drop(writer);
    Ok(store)
}

/// Copies a job with its events, and with its problem, its result and whatever else is attached to it.
pub(super) async fn copy_job(
    source: &mut SqliteConnection,
    tx: &mut Writing,
    job: &Job,
) -> Result<()> {
    let by_key = |statement| sqlx::query(statement).bind(job.key);
    let rows = [
        (
            "job",
            by_key("select * from job where id = ?")
                .fetch_all(&mut *source)
                .await?,
        ),
        (
            "event",
            by_key("select * from event where job_id = ?")
                .fetch_all(&mut *source)
                .await?,
        ),
    ];
    for (table, rows) in &rows {
        for row in rows {
            insert(tx, table, row).await?;
        }
    }
    for (name, value) in &job.labels {
        sqlx::query(
            "insert or ignore into job_label (key, value, created_at, job_id) values (?, ?, ?, ?)",
        )
        .bind(name)
        .bind(value)
        .bind(job.created_at.micros())
        .bind(job.key)
        .execute(&mut **tx)
        .await?;
    }
    copy_content(source, tx, Holder::Job(job.key)).await
}

/// Copies what is attached, one after the other.
pub(super) async fn copy_content(
    source: &mut SqliteConnection,
    tx: &mut Writing,
    holder: Holder,
) -> Result<()> {
    for attached in content::all(source, holder).await? {
        let bytes = attached.read(source).await?;
        content::attach(tx, holder, &attached.name, &NewContent::new(&bytes)).await?;
    }
    Ok(())
}

/// Copies what can be read of the rest, and sets right what refers to jobs that were not copied.
pub(super) async fn copy_the_rest(
    source: &mut SqliteConnection,
    target: &Store,
    last: i64,
) -> Result<()> {
    let mut change = target.change().await?;
    let lost_fields = sqlx::query_scalar("select job_id from job_size where fields = 2");
    let lost_fields: Vec<i64> = lost_fields.fetch_all(source).await.unwrap_or_default();
    // owners of meshes that were not copied
    sqlx::query("delete from mesh_owner where hash not in (select hash from mesh)")
        .execute(change.sql().await?)
        .await?;
    // a job waits by itself if the one that it waited for was not copied; the next one like it coalesces them again
    let alone = "select id from job where coalesced_into not in (select id from job)";
    let alone: Vec<i64> = sqlx::query_scalar(alone)
        .fetch_all(change.sql().await?)
        .await?;
    for key in alone {
        change.set(key, JobRow::waits_by_itself).await?;
    }
    let tx = change.sql().await?;
    let ended = "select id from job where finished_at is not null";
    let ended: Vec<i64> = sqlx::query_scalar(ended).fetch_all(&mut *tx).await?;
    for key in ended {
        sizes::count(&mut *tx, key).await?;
    }
    for key in lost_fields {
        sqlx::query("update job_size set fields = 2 where job_id = ?")
            .bind(key)
            .execute(&mut *tx)
            .await?;
    }
    // no number is given twice
    sqlx::query("update sqlite_sequence set seq = max(seq, ?) where name = 'job'")
        .bind(last)
        .execute(&mut *tx)
        .await?;
    change.commit().await.map(drop)
}

/// Inserts a row as it was read from the same table of another store.
pub(super) async fn insert(tx: &mut SqliteConnection, table: &str, row: &SqliteRow) -> Result<()> {
    let names: Vec<&str> = row.columns().iter().map(|column| column.name()).collect();
    let places = vec!["?"; names.len()].join(", ");
    let statement = format!(
        "insert or ignore into {table} ({}) values ({places})",
        names.join(", ")
    );
    let values = (0..names.len()).map(|place| checksum::value(row, place));
    let values: Vec<Value> = values.collect::<Result<_>>()?;
    checksum::bind(sqlx::query(AssertSqlSafe(statement)), values.iter())
        .execute(tx)
        .await?;
    Ok(())
}
