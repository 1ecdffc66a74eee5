//! The one SQLite file, and who may use it how.

use std::{
    fs::{File, OpenOptions, TryLockError},
    path::Path,
    sync::{Mutex, MutexGuard, PoisonError, atomic::AtomicBool},
    time::Duration,
};

use sqlx::{
    Connection, Sqlite, SqlitePool, Transaction,
    sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous},
};
use tokio::sync::mpsc;

use super::{
    error::{Result, StoreError},
    line::Line,
    submission::{Asking, Door},
};

/// So long a list waits for its turn.
const LIST_PATIENCE: Duration = Duration::from_secs(5);

/// The database of one server.
#[derive(Debug)]
pub struct Store {
    pub(super) writer: SqlitePool,
    pub(super) reader: SqlitePool,
    /// Lists and counts, which may be slow, keep nobody else from reading.
    pub(super) lists: SqlitePool,
    /// Jobs that wait, in order; true to the disk after every commit.
    pub(super) line: Mutex<Line>,
    /// True to the disk too.
    pub(super) paused: AtomicBool,
    /// One transaction at a time moves the line.
    pub(super) turn: tokio::sync::Mutex<()>,
    /// Where submissions wait for the next commit.
    pub(super) door: Door,
    /// Held as long as we live: a second server on the same folder would run our jobs again.
    _lock: File,
}

impl Store {
    /// Connects to the store in `folder`, made if need be, and brings its tables up to date; with what comes in to
    /// be committed. The line is still empty, and what was set is not yet read.
    pub(super) async fn connect(folder: &Path) -> Result<(Store, mpsc::Receiver<Asking>)> {
        let lock = lock(folder)?;
        let options = SqliteConnectOptions::new()
            .filename(folder.join("signorini.db"))
            .foreign_keys(true)
            .busy_timeout(Duration::from_secs(5));
        let writing = options
            .clone()
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full);
        // A full disk makes SQLite end a transaction by itself, which leaves the driver's count of open ones
        // wrong for ever: such a connection is given up for a new one.
        let writer = pool(1)
            .before_acquire(|connection, _| {
                let whole = !connection.is_in_transaction();
                Box::pin(async move { Ok(whole) })
            })
            .connect_with(writing)
            .await?;
        sqlx::migrate!("../migrations").run(&writer).await?;
        let reading = options.read_only(true);
        let reader = pool(4).connect_with(reading.clone()).await?;
        let lists = pool(2)
            .acquire_timeout(LIST_PATIENCE)
            .connect_with(reading)
            .await?;
        let (door, submissions) = Door::new();
        let store = Store {
            writer,
            reader,
            lists,
            line: Mutex::default(),
            paused: AtomicBool::default(),
            turn: tokio::sync::Mutex::default(),
            door,
            _lock: lock,
        };
        Ok((store, submissions))
    }

    pub(super) fn line(&self) -> MutexGuard<'_, Line> {
        // No code panics while it holds this lock; if one did, the line would still be whole.
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends every connection, and with the last one the write-ahead log.
    pub async fn close(&self) {
        self.lists.close().await;
        self.reader.close().await;
        self.writer.close().await;
    }

    /// Whether the store still answers.
    pub async fn ping(&self) -> Result<()> {
        sqlx::query("select 1").execute(&self.reader).await?;
        Ok(())
    }

    pub(super) async fn begin(&self) -> Result<Transaction<'static, Sqlite>> {
        Ok(self.writer.begin_with("begin immediate").await?)
    }
}

/// Connections to a local file neither age nor need a test before use.
fn pool(connections: u32) -> SqlitePoolOptions {
    SqlitePoolOptions::new()
        .max_connections(connections)
        .min_connections(connections)
        .idle_timeout(None)
        .max_lifetime(None)
        .test_before_acquire(false)
}

fn lock(folder: &Path) -> Result<File> {
    let named = |error: std::io::Error| {
        StoreError::Folder(format!("cannot use {}: {error}", folder.display()))
    };
    std::fs::create_dir_all(folder).map_err(named)?;
    let file = OpenOptions::new()
        .create(true)
        .truncate(false)
        .write(true)
        .open(folder.join("lock"))
        .map_err(named)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(StoreError::Folder(format!(
            "another server is using {}",
            folder.display()
        ))),
        Err(TryLockError::Error(error)) => Err(named(error)),
    }
}
