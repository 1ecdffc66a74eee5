//! Errors of the store.

use sqlx::migrate::MigrateError;

use crate::job::JobId;

/// An error of the store.
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
    /// The id belongs to another job.
    #[error("{0} is the id of another job")]
    IdConflict(JobId),
    /// The job was deleted.
    #[error("{0} was deleted")]
    Deleted(JobId),
    /// The job's mesh is not stored.
    #[error("the mesh is not stored")]
    UnknownMesh,
    /// Too many lists are requested at once.
    #[error("too many lists at once")]
    Busy,
    /// The disk is full.
    #[error("the disk is full")]
    Full,
    /// A row that this program cannot have written.
    #[error("the database holds something unexpected: {0}")]
    Corrupt(String),
    /// An error of the database.
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
    /// The same error for another submission of the same transaction.
    pub(super) fn for_another(&self) -> StoreError {
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

/// The result of a query to the store.
pub type Result<T> = std::result::Result<T, StoreError>;
