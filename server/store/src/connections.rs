//! Connections to the database. Each is used by one thread at a time, which may block; other users wait for a turn.

use parking_lot::Mutex;
use std::{fmt, path::Path, sync::Arc, time::Duration};

use base::tasks;
use futures_util::future::BoxFuture;
use rusqlite::{Connection, OpenFlags, config::DbConfig};
use tokio::{
    sync::{OwnedSemaphorePermit, Semaphore},
    time::timeout,
};

use super::error::{Result, StoreError};

/// The number of statements that a connection keeps prepared for repeated use. The store has some 200 texts of
/// statements, and makes further ones from the columns that change or that a list filters by.
const MOST_STATEMENTS: usize = 200;

/// What a database is opened for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mode {
    /// Reading.
    Read,
    /// Reading and writing.
    ReadWrite,
    /// Reading and writing; the database is created if it does not exist.
    #[cfg(test)]
    Create,
}

/// For how long a connection waits for locks that others hold, such as programs that make a backup.
pub(super) const BUSY_TIMEOUT: Duration = Duration::from_secs(5);

/// Opens the database in this file.
pub(super) fn open(file: &Path, mode: Mode) -> Result<Connection> {
    let flags = match mode {
        Mode::Read => OpenFlags::SQLITE_OPEN_READ_ONLY,
        Mode::ReadWrite => OpenFlags::SQLITE_OPEN_READ_WRITE,
        #[cfg(test)]
        Mode::Create => OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_CREATE,
    };
    // one thread uses it at a time
    let connection = Connection::open_with_flags(file, flags | OpenFlags::SQLITE_OPEN_NO_MUTEX)?;
    connection.busy_timeout(BUSY_TIMEOUT)?;
    connection.set_prepared_statement_cache_capacity(MOST_STATEMENTS);
    // no statement is planned anew for the values of its parameters: the plans do not depend on them
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_ENABLE_QPSG, true)?;
    connection.execute_batch("pragma foreign_keys = on")?;
    Ok(connection)
}

/// Runs work that may block on a thread for such work.
pub(super) async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T> + Send + 'static,
) -> Result<T> {
    let span = tracing::Span::current();
    #[cfg(test)]
    let work = base::time::Time::simulated_for(work);
    let done = tasks::blocking(move || span.in_scope(work)).await;
    done.unwrap_or_else(|error| match error.try_into_panic() {
        Ok(panic) => std::panic::resume_unwind(panic),
        Err(_) => Err(closed()),
    })
}

/// The error of a use of the store after it was closed.
pub(super) fn closed() -> StoreError {
    StoreError::Folder("the store is closed".into())
}

/// A fixed number of connections that are opened in the same way.
pub(super) struct Connections {
    count: u32,
    patience: Duration,
    turns: Arc<Semaphore>,
    idle: Mutex<Vec<Connection>>,
    open: Box<dyn Fn() -> Result<Connection> + Send + Sync>,
}

impl Connections {
    /// Opens `count` connections by `open`. A user waits for a free one for at most `patience`.
    pub(super) fn new(
        count: u32,
        patience: Duration,
        open: impl Fn() -> Result<Connection> + Send + Sync + 'static,
    ) -> Result<Arc<Connections>> {
        let idle = (0..count).map(|_| open()).collect::<Result<_>>()?;
        Ok(Arc::new(Connections {
            count,
            patience,
            turns: Arc::new(Semaphore::new(count as usize)),
            idle: Mutex::new(idle),
            open: Box::new(open),
        }))
    }

    /// Waits for a connection; an error if that takes too long, for example because the disk does not answer.
    pub(super) fn turn(self: &Arc<Self>) -> BoxFuture<'_, Result<Lease>> {
        Box::pin(async {
            let turn = timeout(self.patience, self.turns.clone().acquire_owned()).await;
            let turn = turn.map_err(|_| StoreError::Busy)?.map_err(|_| closed())?;
            Ok(self.lease(turn))
        })
    }

    /// A connection, if one is free.
    pub(super) fn free(self: &Arc<Self>) -> Option<Lease> {
        let turn = self.turns.clone().try_acquire_owned().ok()?;
        Some(self.lease(turn))
    }

    fn lease(self: &Arc<Self>, turn: OwnedSemaphorePermit) -> Lease {
        Lease {
            connection: self.idle().pop(),
            of: self.clone(),
            _turn: turn,
        }
    }

    /// Closes all connections, once none is in use.
    pub(super) async fn close(&self) {
        let all = self.turns.acquire_many(self.count).await;
        self.turns.close();
        drop(all);
        let connections = std::mem::take(&mut *self.idle());
        // the last one merges the write-ahead log
        let closing = move || {
            drop(connections);
            Ok(())
        };
        let _ = blocking(closing).await; // it cannot fail
    }

    /// Whether the connections were closed.
    pub(super) fn is_closed(&self) -> bool {
        self.turns.is_closed()
    }

    fn idle(&self) -> parking_lot::MutexGuard<'_, Vec<Connection>> {
        self.idle.lock()
    }
}

impl fmt::Debug for Connections {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Connections({})", self.count)
    }
}

/// A connection in use; it is free for others when this is dropped.
pub(super) struct Lease {
    /// The connection; `None` if it is opened anew at its next use.
    connection: Option<Connection>,
    of: Arc<Connections>,
    _turn: OwnedSemaphorePermit,
}

impl Lease {
    /// The connection, opened anew if it was discarded.
    pub(super) fn get(&mut self) -> Result<&Connection> {
        match &mut self.connection {
            Some(connection) => Ok(connection),
            none => Ok(none.insert((self.of.open)()?)),
        }
    }

    /// Closes the connection; a new one is opened at the next use.
    pub(super) fn discard(&mut self) {
        self.connection = None;
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        self.of.idle().extend(self.connection.take());
    }
}
