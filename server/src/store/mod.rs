//! Everything durable, and the only SQL: one SQLite file.
//!
//! One connection writes, always in `begin immediate`, so that no transaction ever fails half-way
//! for want of a lock; others read at the same time (WAL). A commit is on the disk when it returns
//! (synchronous FULL). Each method answers one question, in one transaction.
//!
//! Who names a job by its public id, or asks for a list, says whose jobs are meant ([`Owners`]): a job of
//! another owner is not found, as if there were none. Keys, the store's own numbers of jobs, come only from such
//! answers.
//!
//! [`Owners`]: crate::caller::Owners

mod change;
mod delete;
mod edit;
mod events;
mod jobs;
mod line;
mod list;
mod meshes;
mod results;
mod rows;
mod settings;
mod submit;
#[cfg(test)]
mod tests;
mod twins;

use std::{
    fs::{File, OpenOptions, TryLockError},
    path::Path,
    sync::{Arc, Mutex, MutexGuard, PoisonError, atomic::AtomicBool},
    time::Duration,
};

use sqlx::{
    Connection, Sqlite, SqlitePool, Transaction,
    migrate::MigrateError,
    sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous},
};

pub use delete::Deletion;
pub use edit::Edit;
pub use jobs::{CancelOutcome, Claim, Ending, LastWords};
use line::{Line, Move};
pub use list::{Cursor, Filter, GroupBy, Order, OrderBy};
pub use meshes::{Removal, StoredMesh};
pub use results::{PIECE_BYTES, PIECES_PER_COMMIT, PartInfo, Parts, ProfilePoints, Snapshot};
pub use submit::{Accepted, NewJob, RequestKey, Submission};

use crate::job::JobId;

/// So long a list waits for its turn.
const LIST_PATIENCE: Duration = Duration::from_secs(5);

/// The database of one server.
#[derive(Debug)]
pub struct Store {
    writer: SqlitePool,
    reader: SqlitePool,
    /// Lists and counts, which may be slow, keep nobody else from reading.
    lists: SqlitePool,
    /// Jobs that wait, in order; true to the disk after every commit.
    line: Mutex<Line>,
    /// True to the disk too.
    paused: AtomicBool,
    /// One transaction at a time moves the line.
    turn: tokio::sync::Mutex<()>,
    /// Where submissions wait for the next commit.
    door: submit::Door,
    /// Held as long as we live: a second server on the same folder would run our jobs again.
    _lock: File,
}

/// What can go wrong with the store.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The folder cannot be used.
    #[error("{0}")]
    Folder(String),
    /// The queue holds as many jobs as it may.
    #[error("the queue is full")]
    QueueFull,
    /// The key was used for another request.
    #[error("the key was used for another request")]
    KeyReuse,
    /// The name belongs to another job.
    #[error("{0} is another job")]
    IdConflict(JobId),
    /// The job was deleted.
    #[error("{0} was deleted")]
    Deleted(JobId),
    /// The job's mesh is not there.
    #[error("the mesh is not stored")]
    UnknownMesh,
    /// Too many lists are asked for at once.
    #[error("too many lists at once")]
    Busy,
    /// The disk is full.
    #[error("the disk is full")]
    Full,
    /// A row that cannot be ours.
    #[error("the database holds something unexpected: {0}")]
    Corrupt(String),
    /// The database says no.
    #[error("database: {0}")]
    Database(sqlx::Error),
    /// The tables cannot be brought up to date.
    #[error("migration: {0}")]
    Migrate(#[from] MigrateError),
}

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        const SQLITE_FULL: &str = "13";
        match &error {
            sqlx::Error::Database(cause) if cause.code().as_deref() == Some(SQLITE_FULL) => {
                StoreError::Full
            }
            sqlx::Error::PoolTimedOut => StoreError::Busy,
            _ => StoreError::Database(error),
        }
    }
}

impl StoreError {
    /// The same for another one whose transaction it was too.
    fn again(&self) -> StoreError {
        match self {
            StoreError::Full => StoreError::Full,
            StoreError::Busy => StoreError::Busy,
            other => StoreError::Corrupt(other.to_string()),
        }
    }
}

impl From<serde_json::Error> for StoreError {
    fn from(error: serde_json::Error) -> Self {
        StoreError::Corrupt(error.to_string())
    }
}

/// What the store answers.
pub type Result<T> = std::result::Result<T, StoreError>;

impl Store {
    /// Opens the store in `folder`, made if need be, and brings its tables up to date.
    pub async fn open(folder: &Path) -> Result<Arc<Store>> {
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
        let mut line = Line::default();
        let waiting: Vec<(i32, i64)> = sqlx::query_as(
            "select priority, id from job where status = 'queued' and twin_of is null order by priority desc, id",
        )
        .fetch_all(&reader)
        .await?;
        for (priority, key) in waiting {
            line.make(Move::Enter { priority, key });
        }
        let joined: i64 = sqlx::query_scalar("select count(*) from job where twin_of is not null")
            .fetch_one(&reader)
            .await?;
        (0..joined).for_each(|_| line.make(Move::Join));
        let paused = AtomicBool::new(settings::was_paused(&reader).await?);
        let (door, submissions) = submit::Door::new();
        let store = Arc::new(Store {
            writer,
            reader,
            lists,
            line: Mutex::new(line),
            paused,
            turn: tokio::sync::Mutex::default(),
            door,
            _lock: lock,
        });
        tokio::spawn(submit::commit_submissions(
            Arc::downgrade(&store),
            submissions,
        ));
        Ok(store)
    }

    /// How many jobs wait for a worker, or for another job.
    pub fn waiting(&self) -> usize {
        self.line().len()
    }

    fn line(&self) -> MutexGuard<'_, Line> {
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

    async fn begin(&self) -> Result<Transaction<'static, Sqlite>> {
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
