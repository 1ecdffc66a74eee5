//! A database without free pages, that can give back to the file system what becomes free later.

use sqlx::{Connection, SqliteConnection};

use super::error::Result;

/// A database without the means to give space back is rebuilt when it is opened, if it is not larger than this: some seconds.
const REBUILT_BYTES: i64 = 256 << 20;

/// Rebuilds a database of an earlier version, which cannot give space back, unless that takes long. What `doctor --compact`
/// does for large ones.
pub(super) async fn enable_giving_back(connection: &mut SqliteConnection) -> Result<()> {
    let mode: i64 = sqlx::query_scalar("pragma auto_vacuum")
        .fetch_one(&mut *connection)
        .await?;
    if mode != 0 {
        return Ok(());
    }
    let bytes: i64 = sqlx::query_scalar(
        "select page_count * page_size from pragma_page_count(), pragma_page_size()",
    )
    .fetch_one(&mut *connection)
    .await?;
    if bytes > REBUILT_BYTES {
        tracing::warn!(
            "the database is of an earlier version and keeps the space of what is deleted for itself; to have it given back to the \
             file system, stop the service and run `signorini doctor --compact`, which takes as much space again for a while"
        );
        return Ok(());
    }
    compact(connection).await
}

/// Rebuilds a database without free pages, and so that it can give space back later.
pub(super) async fn compact(connection: &mut SqliteConnection) -> Result<()> {
    // the mode of an existing database changes when it is rebuilt, and not in a write-ahead log
    for statement in [
        "pragma journal_mode = delete",
        "pragma auto_vacuum = incremental",
        "vacuum",
        "pragma journal_mode = wal",
    ] {
        sqlx::query(statement).fetch_all(&mut *connection).await?;
    }
    connection.ping().await?;
    Ok(())
}
