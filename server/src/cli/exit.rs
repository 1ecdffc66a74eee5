//! The exit codes of the process.

use crate::{app::CannotListen, store::StoreError};

/// How a command ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Exit {
    /// Success.
    Ok = 0,
    /// Something failed.
    Failed = 1,
    /// The input is invalid.
    Invalid = 2,
    /// The service cannot listen at its address.
    Listen = 3,
    /// The folder of the store cannot be used.
    Folder = 4,
    /// Another process uses the store.
    Locked = 5,
    /// The store is of another program, or of a later version of this one.
    Schema = 6,
    /// Something that was stored is missing or damaged.
    Damaged = 7,
    /// The solution did not converge.
    NotConverged = 9,
}

impl Exit {
    /// Of a command that ended with this error.
    pub(super) fn of(error: &anyhow::Error) -> Exit {
        match error.downcast_ref() {
            Some(StoreError::Folder(_)) => Exit::Folder,
            Some(StoreError::Locked(_)) => Exit::Locked,
            Some(StoreError::Schema(_)) => Exit::Schema,
            Some(StoreError::Lost(_) | StoreError::Damaged(_) | StoreError::Broken(_)) => {
                Exit::Damaged
            }
            _ if error.is::<CannotListen>() => Exit::Listen,
            _ => Exit::Failed,
        }
    }
}
