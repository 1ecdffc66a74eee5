//! The one SQLite file: its connections, and the data that is also kept in memory.

use std::{
    fs::{File, OpenOptions, TryLockError},
    path::Path,
    sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, atomic::AtomicBool},
    time::Duration,
};

use sqlx::{
    Connection, Sqlite, SqlitePool, Transaction,
    sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous},
};
use tokio::sync::mpsc;

use super::{
    error::{Result, StoreError},
    migrations,
    submission::{Inbox, Pending},
    waiting::WaitingJobs,
};
use crate::memory::Budget;

/// How long a list waits for a connection.
const LIST_PATIENCE: Duration = Duration::from_secs(5);

/// The database of one server.
#[derive(Debug)]
pub struct Store {
    pub(super) writer: SqlitePool,
    pub(super) reader: SqlitePool,
    /// For lists and counts, which may be slow, so that they do not delay other reads.
    pub(super) lists: SqlitePool,
    /// The jobs that wait, as they are on the disk after every commit.
    pub(super) waiting: Mutex<WaitingJobs>,
    /// Whether the queue is paused, as it is on the disk after every commit.
    pub(super) paused: AtomicBool,
    /// The memory that running jobs share; without limit until it is set.
    pub(super) budget: OnceLock<Arc<Budget>>,
    /// One transaction at a time changes the jobs that wait.
    pub(super) change_lock: tokio::sync::Mutex<()>,
    /// Where submissions wait for the next commit.
    pub(super) inbox: Inbox,
    /// Held as long as the store is open: a second server on the same folder would run the same jobs.
    _lock: File,
}

impl Store {
    /// Connects to the database in `folder`, created if necessary, and brings its tables up to date. Also
    /// returns the receiver of submissions. The data kept in memory is not read yet.
    pub(super) async fn connect(folder: &Path) -> Result<(Store, mpsc::Receiver<Pending>)> {
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
        // wrong permanently: such a connection is replaced by a new one.
        let writer = pool(1)
            .before_acquire(|connection, _| {
                let whole = !connection.is_in_transaction();
                Box::pin(async move { Ok(whole) })
            })
            .connect_with(writing)
            .await?;
        migrations::migrator().run(&writer).await?;
        let reading = options.read_only(true);
        let reader = pool(4).connect_with(reading.clone()).await?;
        let lists = pool(2)
            .acquire_timeout(LIST_PATIENCE)
            .connect_with(reading)
            .await?;
        let (inbox, submissions) = Inbox::new();
        let store = Store {
            writer,
            reader,
            lists,
            waiting: Mutex::default(),
            paused: AtomicBool::default(),
            budget: OnceLock::new(),
            change_lock: tokio::sync::Mutex::default(),
            inbox,
            _lock: lock,
        };
        Ok((store, submissions))
    }

    /// The waiting jobs.
    pub(super) fn waiting_jobs(&self) -> MutexGuard<'_, WaitingJobs> {
        // No code panics while it holds this lock; if one did, the list would still be whole.
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Closes every connection, and with the last one the write-ahead log.
    pub async fn close(&self) {
        self.lists.close().await;
        self.reader.close().await;
        self.writer.close().await;
    }

    /// Whether the database answers.
    pub async fn ping(&self) -> Result<()> {
        sqlx::query("select 1").execute(&self.reader).await?;
        Ok(())
    }

    /// Begins a transaction of the single writer.
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
