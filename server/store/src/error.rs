//! The errors of the store.

use std::fmt;

use base::job::JobId;
use rusqlite::{Error as SqlError, ffi::ErrorCode, types::FromSqlError};
use uuid::Uuid;

/// An error of the store.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The folder of the store, or a file in it, cannot be used.
    #[error("{0}")]
    Folder(String),
    /// Another process uses the folder.
    #[error("{0}")]
    Locked(String),
    /// The tables are not those of this version of the program.
    #[error("{0}")]
    Schema(String),
    /// Stored data are missing.
    #[error("{0}")]
    Lost(String),
    /// The queue is full.
    #[error("the queue is full")]
    QueueFull,
    /// The owner already has the maximum number of waiting jobs.
    #[error("this owner already has the maximum number of waiting jobs")]
    OwnerQueueFull,
    /// The request key was used for another request.
    #[error("the key was used for another request")]
    KeyReuse,
    /// The id that the client has chosen belongs to another job.
    #[error("{0} is the id of another job")]
    IdConflict(JobId),
    /// The job was deleted.
    #[error("{0} was deleted")]
    Deleted(JobId),
    /// The job's mesh is not stored.
    #[error("the mesh is not stored")]
    UnknownMesh,
    /// A connection to the database did not become free in time.
    #[error("the database was busy for too long")]
    Busy,
    /// The disk is full, or cannot be written: SQLite reports a quota and a limit on file sizes as errors of the disk.
    #[error("the disk is full, or cannot be written")]
    Full,
    /// The database was removed or replaced while the store is open.
    #[error("{0}")]
    Replaced(String),
    /// The database itself is damaged, so that nothing can be stored.
    #[error("{0}")]
    Broken(String),
    /// A record that is not as it was written.
    #[error("{0}: {cause}", cause = .0.cause)]
    Damaged(Box<Damage>),
    /// The program has asked the store for something that must not happen.
    #[error("unexpected: {0}")]
    Unexpected(String),
    /// An error of the database.
    #[error("database: {0}")]
    Database(SqlError),
}

/// A stored record, as errors name it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Record {
    /// The key of the job that the record belongs to, if it is known.
    pub job: Option<i64>,
    /// The name of the record, like "event 12".
    pub name: String,
}

/// A record that is not as it was written.
#[derive(Clone, Debug)]
pub struct Damage {
    /// The damaged record.
    pub record: Record,
    /// The public id of the job that the record belongs to, if it is known.
    pub job: Option<JobId>,
    /// How the damage was found.
    pub cause: String,
    /// The incident number under which the log has the damage, once it was logged.
    pub incident: Option<Uuid>,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.job {
            Some(id) => write!(f, "the stored {} of {id} is damaged", self.record.name),
            None => write!(f, "the {} is damaged", self.record.name),
        }
    }
}

impl Record {
    /// A record of a job.
    pub(super) fn of_job(key: i64, name: impl Into<String>) -> Record {
        Record {
            job: Some(key),
            name: name.into(),
        }
    }

    /// A record that belongs to no job.
    pub(super) fn named(name: impl Into<String>) -> Record {
        Record {
            job: None,
            name: name.into(),
        }
    }

    /// The database itself, or a part of it that cannot be assigned to a job.
    fn database() -> Record {
        Record::named("database")
    }

    /// Whether the record is the database itself.
    pub(super) fn is_database(&self) -> bool {
        *self == Record::database()
    }

    /// The error that this record is damaged.
    pub(super) fn damaged(self, cause: impl ToString) -> StoreError {
        StoreError::Damaged(Box::new(Damage {
            record: self,
            job: None,
            cause: cause.to_string(),
            incident: None,
        }))
    }
}

/// SQLite's code of a failed read, which [`ErrorCode`] does not distinguish from other errors.
const IOERR_READ: i32 = 266;
/// SQLite's code of a read that ended early, which [`ErrorCode`] does not distinguish from other errors.
const IOERR_SHORT_READ: i32 = 522;
/// Reading failed with an error of the disk, where SQLite has not made "malformed" of it.
const IOERR_CORRUPTFS: i32 = 8458;
/// SQLite's code of a failed write: over a quota, a limit on file sizes, or on a disk that fails.
const IOERR_WRITE: i32 = 778;

impl From<SqlError> for StoreError {
    fn from(error: SqlError) -> Self {
        let (cause, message) = match &error {
            SqlError::SqliteFailure(cause, message) => (cause, message),
            // what is stored is not what is expected there
            SqlError::FromSqlConversionFailure(..)
            | SqlError::IntegralValueOutOfRange(..)
            | SqlError::InvalidColumnType(..)
            | SqlError::Utf8Error(..) => return Record::named("record").damaged(error),
            _ => return StoreError::Database(error),
        };
        let number = cause.extended_code;
        let told = match message {
            Some(message) => format!("SQLite: {message} (error {number})"),
            None => format!("SQLite: {cause} (error {number})"),
        };
        match (cause.code, number) {
            (ErrorCode::DatabaseCorrupt | ErrorCode::NotADatabase, _) => {
                Record::database().damaged(told)
            }
            // a gigabyte and more: nothing that was written is so large
            (ErrorCode::TooBig, _) => Record::named("record").damaged(told),
            (_, IOERR_READ | IOERR_SHORT_READ | IOERR_CORRUPTFS) => {
                Record::named("page of the database").damaged(told)
            }
            (ErrorCode::DiskFull, _) | (_, IOERR_WRITE) => StoreError::Full,
            (ErrorCode::ReadOnly | ErrorCode::CannotOpen, _) => {
                StoreError::Folder(format!("the database cannot be written: {told}"))
            }
            _ => StoreError::Database(error),
        }
    }
}

impl From<FromSqlError> for StoreError {
    fn from(error: FromSqlError) -> Self {
        Record::named("record").damaged(error)
    }
}

impl StoreError {
    /// Whether a record of this job is damaged, so that reading the record again finds the same damage. Errors of a
    /// disk or of the database are not included: they do not tell which job they concern.
    pub fn is_damage_of(&self, key: i64) -> bool {
        matches!(self, StoreError::Damaged(damage) if damage.record.job == Some(key))
    }

    /// Whether no change of this job can be stored until the operator has repaired the store.
    pub fn is_lasting(&self, key: i64) -> bool {
        matches!(self, StoreError::Broken(_)) || self.is_damage_of(key)
    }

    /// A copy of this error for another submission in the same transaction.
    pub(super) fn for_another(&self) -> StoreError {
        match self {
            StoreError::Full => StoreError::Full,
            StoreError::Busy => StoreError::Busy,
            StoreError::Folder(why) => StoreError::Folder(why.clone()),
            StoreError::Replaced(how) => StoreError::Replaced(how.clone()),
            StoreError::Broken(how) => StoreError::Broken(how.clone()),
            StoreError::Damaged(damage) => StoreError::Damaged(damage.clone()),
            other => StoreError::Unexpected(other.to_string()),
        }
    }

    /// This error as damage of the record that was being read, if it is damage that no job is known for yet.
    pub(super) fn reading(self, record: impl FnOnce() -> Record) -> StoreError {
        match self {
            StoreError::Damaged(damage) if damage.record.job.is_none() => {
                record().damaged(damage.cause)
            }
            other => other,
        }
    }
}

impl From<serde_json::Error> for StoreError {
    fn from(error: serde_json::Error) -> Self {
        Record::named("record").damaged(error)
    }
}

/// The result of a query to the store.
pub type Result<T> = std::result::Result<T, StoreError>;
