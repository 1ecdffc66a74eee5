//! Rebuilds a database so that it has no free pages, and can give later free pages back to the file system.

use std::path::Path;

use base::text::size;
use rusqlite::Connection;

use super::{
    error::{Result, StoreError},
    pages::Pages,
};

/// The largest database (bytes) that is rebuilt when it is opened, if it cannot give space back: rebuilding takes some
/// seconds.
const REBUILT_BYTES: u64 = 256 << 20;

/// Rebuilds a database of an earlier version, which cannot give space back, unless that takes long or there is no room;
/// `doctor --compact` does it for large ones. The store also works without this: what prevents it is logged, and it is
/// tried again at the next start.
pub(super) fn enable_giving_back(connection: &Connection, folder: &Path) -> Result<()> {
    if gives_back(connection)? {
        return Ok(());
    }
    let pages = Pages::of(connection)?;
    let bytes = pages.bytes_of(pages.count);
    if bytes > REBUILT_BYTES {
        tracing::warn!(
            "the database is of an earlier version and does not return the space of deleted data to the file system; to change \
             that, stop the service and run `signorini doctor --compact`, which temporarily takes as much space again"
        );
        return Ok(());
    }
    let rebuilt = if has_room(folder, bytes) {
        compact(connection)
    } else {
        Err(StoreError::Full)
    };
    if let Err(cause) = rebuilt {
        tracing::warn!(
            %cause,
            "the database is of an earlier version and could not be rebuilt to return free space to the file system: {cause}. \
             Rebuilding it needs {} of free space, and no other process may read it; it is tried again at the next start",
            size(bytes.saturating_mul(2))
        );
    }
    Ok(())
}

/// Whether a database can give its free pages back to the file system.
pub(super) fn gives_back(connection: &Connection) -> Result<bool> {
    // not prepared once: it is evaluated when it is prepared
    let mode: i64 = connection.pragma_query_value(None, "auto_vacuum", |row| row.get(0))?;
    Ok(mode != 0)
}

/// Whether the disk has room for a copy of this many bytes and for the journal that undoes it.
fn has_room(folder: &Path, bytes: u64) -> bool {
    rustix::fs::statvfs(folder)
        .is_ok_and(|found| found.f_bavail.saturating_mul(found.f_frsize) >= bytes.saturating_mul(2))
}

/// Rebuilds a database without its free pages, and so that it can give space back later.
pub(super) fn compact(connection: &Connection) -> Result<()> {
    // the mode of an existing database changes when it is rebuilt, and not in a write-ahead log
    let rebuilt = connection
        .execute_batch("pragma journal_mode = delete; pragma auto_vacuum = incremental; vacuum");
    connection.execute_batch("pragma journal_mode = wal")?;
    Ok(rebuilt?)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::time::Duration;

    use super::{
        super::{
            connections::{Mode, open},
            sql::Sql,
        },
        *,
    };

    #[test]
    fn a_database_that_cannot_be_rebuilt_now_works_and_is_rebuilt_later() {
        let folder = tempfile::tempdir().unwrap();
        let connect = || {
            let connection = open(&folder.path().join("old.db"), Mode::Create).unwrap();
            connection.busy_timeout(Duration::ZERO).unwrap();
            connection
        };
        let writer = connect();
        let tables = "pragma journal_mode = wal; create table a (b)";
        writer.execute_batch(tables).unwrap();
        let other = connect();
        let reading = other.unchecked_transaction().unwrap();
        reading.values::<i64>("select b from a", ()).unwrap();
        enable_giving_back(&writer, folder.path()).unwrap();
        assert!(!gives_back(&writer).unwrap());
        let mode: String = writer.value("pragma journal_mode", ()).unwrap();
        assert_eq!(mode, "wal");
        writer.run("insert into a values (1)", ()).unwrap();
        drop(reading);
        drop(other);
        enable_giving_back(&writer, folder.path()).unwrap();
        assert!(gives_back(&writer).unwrap());
    }

    #[test]
    fn a_database_is_not_rebuilt_where_there_is_no_room_for_twice_its_size() {
        let folder = tempfile::tempdir().unwrap();
        assert!(has_room(folder.path(), 1));
        assert!(!has_room(folder.path(), u64::MAX));
    }
}
