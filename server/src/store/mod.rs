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
//! The files from the ground up; each uses only those above it.
//!
//! [`Owners`]: crate::caller::Owners

// What goes in and out, and what can go wrong.
mod error;
mod filter;
mod parts;
mod submission;

// The file, one transaction of its single writer, and the queue that follows it in memory.
mod change;
mod database;
mod line;

// A job: its row, its labels, its events, its result.
mod events;
mod labels;
mod results;
mod rows;

// Its life: started and ended; with others of the same input; by a worker, a client, the clock, a restart.
mod claim;
mod end;
mod life;
mod requeue;
mod twins;

// Accepted, under keys; changed; deleted.
mod delete;
mod edit;
mod keys;
mod submit;

// Read: one, its place in the queue, its result; many.
mod list;
mod lookup;
mod places;
mod snapshot;

// What is no job.
mod meshes;
mod settings;

#[cfg(test)]
mod tests;

use std::{path::Path, sync::Arc};

pub use self::{
    database::Store,
    delete::Deletion,
    edit::Edit,
    end::CancelOutcome,
    error::{Result, StoreError},
    events::LastWords,
    filter::{Cursor, Filter, GroupBy, Order, OrderBy},
    life::Ending,
    meshes::{Removal, StoredMesh},
    parts::{PIECE_BYTES, PIECES_PER_COMMIT, Parts, ProfilePoints},
    snapshot::{PartInfo, Snapshot},
    submission::{Accepted, Claim, NewJob, RequestKey, Submission},
};

impl Store {
    /// Opens the store in `folder`, made if need be, and brings its tables up to date.
    pub async fn open(folder: &Path) -> Result<Arc<Store>> {
        let (store, submissions) = Store::connect(folder).await?;
        store.fill_line().await?;
        store.read_settings().await?;
        let store = Arc::new(store);
        let committing = submit::commit_submissions(Arc::downgrade(&store), submissions);
        tokio::spawn(committing);
        Ok(store)
    }
}
