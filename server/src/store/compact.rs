//! A database without free pages, that can give back to the file system what becomes free later.

use std::path::Path;

use sqlx::SqliteConnection;

use super::{
    error::{Result, StoreError},
    pages::Pages,
};
use crate::error::size;

/// A database without the means to give space back is rebuilt when it is opened, if it is not larger than this: some seconds.
const REBUILT_BYTES: u64 = 256 << 20;

/// Rebuilds a database of an earlier version, which cannot give space back, unless that takes long or there is no room. What
/// `doctor --compact` does for large ones. It works without that as well: what stands in the way of it is told in the log,
/// and it is tried again at the next start.
pub(super) async fn enable_giving_back(
    connection: &mut SqliteConnection,
    folder: &Path,
) -> Result<()> {
    if gives_back(connection).await? {
        return Ok(());
    }
    let pages = Pages::of(&mut *connection).await?;
    let bytes = pages.bytes_of(pages.count);
    if bytes > REBUILT_BYTES {
        tracing::warn!(
            "the database is of an earlier version and does not return the space of deleted data to the file system; to change \
             that, stop the service and run `signorini doctor --compact`, which temporarily takes as much space again"
        );
        return Ok(());
    }
    let rebuilt = match has_room(folder, bytes) {
        true => compact(connection).await,
        false => Err(StoreError::Full),
    };
    if let Err(cause) = rebuilt {
        tracing::warn!(
            %cause,
            "the database is of an earlier version, and could not be rebuilt so that it returns space to the file system, for \
             which it needs {} of space and no other reader; this is tried again at the next start: {cause}",
            size(bytes.saturating_mul(2))
        );
    }
    Ok(())
}

/// Whether a database can give back to the file system what is free in it.
pub(super) async fn gives_back(connection: &mut SqliteConnection) -> Result<bool> {
    let mode: i64 = sqlx::query_scalar("pragma auto_vacuum")
        .fetch_one(connection)
        .await?;
    Ok(mode != 0)
}

/// Whether there is room for a copy of so many bytes and for the journal that undoes it.
fn has_room(folder: &Path, bytes: u64) -> bool {
    rustix::fs::statvfs(folder)
        .is_ok_and(|found| found.f_bavail.saturating_mul(found.f_frsize) >= bytes.saturating_mul(2))
}

/// Rebuilds a database without free pages, and so that it can give space back later.
pub(super) async fn compact(connection: &mut SqliteConnection) -> Result<()> {
    // the mode of an existing database changes when it is rebuilt, and not in a write-ahead log
    let rebuilt = async {
        for statement in [
            "pragma journal_mode = delete",
            "pragma auto_vacuum = incremental",
            "vacuum",
        ] {
            sqlx::query(statement).fetch_all(&mut *connection).await?;
        }
        Ok(())
    };
    let rebuilt: Result<()> = rebuilt.await;
    sqlx::query("pragma journal_mode = wal")
        .fetch_all(connection)
        .await?;
    rebuilt
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::time::Duration;

    use sqlx::{ConnectOptions, Connection, sqlite::SqliteConnectOptions};

    use super::*;

    #[tokio::test]
    async fn a_database_that_cannot_be_rebuilt_now_works_and_is_rebuilt_later() {
        let folder = tempfile::tempdir().unwrap();
        let options = SqliteConnectOptions::new()
            .filename(folder.path().join("old.db"))
            .create_if_missing(true)
            .busy_timeout(Duration::ZERO);
        let mut writer = options.connect().await.unwrap();
        for statement in ["pragma journal_mode = wal", "create table a (b)"] {
            sqlx::query(statement).execute(&mut writer).await.unwrap();
        }
        let mut other = options.connect().await.unwrap();
        let mut reading = other.begin().await.unwrap();
        let read = sqlx::query("select * from a").fetch_all(&mut *reading);
        read.await.unwrap();
        enable_giving_back(&mut writer, folder.path())
            .await
            .unwrap();
        assert!(!gives_back(&mut writer).await.unwrap());
        let mode = sqlx::query_scalar("pragma journal_mode");
        let mode: String = mode.fetch_one(&mut writer).await.unwrap();
        assert_eq!(mode, "wal");
        sqlx::query("insert into a values (1)")
            .execute(&mut writer)
            .await
            .unwrap();
        drop(reading);
        other.close().await.unwrap();
        enable_giving_back(&mut writer, folder.path())
            .await
            .unwrap();
        assert!(gives_back(&mut writer).await.unwrap());
    }

    #[test]
    fn a_database_is_not_rebuilt_where_there_is_no_room_for_twice_its_size() {
        let folder = tempfile::tempdir().unwrap();
        assert!(has_room(folder.path(), 1));
        assert!(!has_room(folder.path(), u64::MAX));
    }
}
