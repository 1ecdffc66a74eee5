//! The store: all data that outlast the process, in one SQLite file. Only this crate has SQL.
//!
//! One connection writes, always in `begin immediate`, so that no transaction fails half-way because it cannot get a
//! lock; other connections read at the same time (WAL). A commit is on the disk when it returns (synchronous FULL).
//! Each method runs one query or change, in one transaction, on a thread that may block: all code below it is plain
//! functions of a connection.
//!
//! Queries by public id, lists and counts have a parameter for the owners whose jobs they may return ([`Owners`]): a
//! job of another owner is not found, as if it did not exist. Keys, the store's own numbers of jobs, come only from
//! the results of such queries.
//!
//! The modules are declared in order of use: no module uses a module that uses it.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | accepting jobs, also repeated requests | `submit`, `keys` |
//! | jobs with the same input, answered from a result or coalesced | `coalescing` |
//! | editing a job | `edit` |
//! | deleting a job | `delete` |
//! | the life of a job: claimed, ended, requeued | `claim`, `end`, `requeue` |
//! | the row of a job; how it may change, and what follows | `rows`, `rules`, `change` |
//! | the end of one job, with all that belongs to it | `end_job` |
//! | a transaction of the writer and what follows its commit: the log line of a job's end, the jobs whose watchers the caller wakes | `change` |
//! | which worker elsewhere has a job | `leases` |
//! | whose turn it is | `turns`, `claim`, `migrations/0019_turns.sql` |
//! | positions in the queue | `positions` |
//! | lists of jobs: filters | `filter` |
//! | lists of jobs: pages and the indexes they use | `list` |
//! | lists of jobs: labels | `labels` |
//! | what has changed lately, for those who follow lists | `changes` |
//! | events of a job | `events` |
//! | bytes by their hash, and what has them: problems, results, definitions of sweeps, meshes | `content`, `unattached`, `migrations/0017_content.sql` |
//! | results: their parts, written and read | `results`, `parts`, `encoding`, `snapshot` |
//! | what earlier versions stored, moved to content | `old_content` |
//! | sweeps | `sweeps` |
//! | meshes | `meshes` |
//! | models of earlier versions, as files | `model_files` |
//! | tokens | `tokens` |
//! | what a disk has changed: checksums of rows | `checksum` |
//! | what a disk has changed: content that was found intact | `intact` |
//! | what a disk has changed: the damage that was found so far | `damage` |
//! | what a disk has changed: whether a job can still be stored | `write_check` |
//! | what a disk has changed: reading all keys in the background | `scrub` |
//! | the folder and its lock | `folder` |
//! | how far the store had come | `progress` |
//! | space for control on a full disk | `reserve` |
//! | tables and migrations | `migrations`, `migrations/0001_jobs.sql` and those after it |
//! | connections to the database, statements | `database`, `connections`, `sql` |
//! | the clock of the store, and the time when no service ran | `clock`, `pauses` |
//! | whether the store works (`/readyz`) | `health` |
//! | retention | `retention` |
//! | cancels and deletions of many jobs | `bulk` |
//! | remembering ids of deleted jobs | `forget` |
//! | deleting fields alone | `fields` |
//! | bytes that jobs and owners keep | `sizes` |
//! | giving free pages back to the file system | `pages`, `space` |
//! | rebuilding the database | `compact` |
//! | backups | `backup` |
//! | restoring a backup | `restore` |
//! | what a backup contains, and its digest | `manifest` |
//! | doctor and salvage | `inspect`, `salvage` |
//! | what tests of other crates do to a store | `for_tests` |
//! | random sequences of everything, by seed | `tests/simulation` |
//!
//! [`Owners`]: base::caller::Owners

// Input and output types, and errors.
mod checksum;
mod connections;
mod encoding;
mod entries;
mod error;
mod filter;
mod repeated_error;
mod sql;
mod submission;

// Bytes by their hash, and what has them.
mod content;
mod parts;

// The folder and its files; what was found damaged, or intact.
mod damage;
mod folder;
mod intact;
mod pauses;
mod progress;
mod reserve;

// The row of a job, the rules of how it may change, and what follows.
mod rows;
mod rules;

// The database; one transaction of its single writer.
mod change;
mod clock;
mod compact;
mod database;
mod migrations;
mod model_files;
mod old_content;
mod pages;

// What has changed lately.
mod changes;

// What belongs to a job: its labels, its events, its problem and result.
mod events;
mod labels;
mod lookup;
mod manifest;
mod results;
mod sizes;
mod unattached;

// Its end; coalesced with others of the same input; claimed, ended, requeued.
mod claim;
mod coalescing;
mod end;
mod end_job;
mod leases;
mod requeue;

// Sweeps, which are solved by jobs.
mod sweeps;

// Submitted, under request keys; edited; deleted; many at once.
mod bulk;
mod delete;
mod edit;
mod fields;
mod forget;
mod keys;
mod retention;
mod submit;
mod write_check;

// Read: its queue position, its result; many jobs.
mod health;
mod list;
mod positions;
mod snapshot;
mod turns;

// What is found by keys and hashes, read from time to time.
mod scrub;

// What is not a job.
mod meshes;
mod settings;
mod space;
mod tokens;

// A store that no server has open; backups, also of one that a server has.
mod backup;
mod inspect;
mod restore;
mod salvage;

// For tests.
mod for_tests;
#[cfg(test)]
mod tests;

use std::{path::Path, sync::Arc};

use futures_util::future::BoxFuture;

use self::database::Rebuild;

pub use self::{
    backup::{Backup, back_up},
    changes::{Changed, Changes, Recent},
    claim::Claims,
    content::{Fingerprint, PIECE_BYTES, PIECES_PER_COMMIT},
    database::Store,
    database::with_advice,
    delete::Deletion,
    edit::Edit,
    encoding::PartInfo,
    end::CancelOutcome,
    entries::Entries,
    error::{Damage, Record, Result, StoreError},
    events::{FinalBatch, spread},
    filter::{Cursor, FILTERS, Field, Filter, GroupBy, Order, OrderBy},
    health::Health,
    inspect::{Report, inspect},
    leases::Leased,
    list::Keys,
    manifest::Manifest,
    meshes::{Removal, StoredMesh},
    parts::{Part, Parts, ProfilePoints, check_parts},
    progress::accept,
    repeated_error::RepeatedError,
    restore::{Restored, restore},
    retention::{Retention, Retired, keep_within},
    rules::{Ending, Overview},
    sizes::OwnerSize,
    snapshot::Snapshot,
    space::{Space, compact_folder},
    submission::{
        Accepted, Claim, Lessee, NewJob, NewSweep, Place, QueueLimits, RequestKey, Room, Submission,
    },
    sweeps::{MemberEvents, MembersTask},
    turns::Load,
};

impl Store {
    /// What has changed lately.
    pub fn changes(&self) -> &Changes {
        &self.changes
    }

    /// Opens the store in `folder`, which is created if necessary, and brings its tables up to date.
    pub fn open(folder: &Path) -> BoxFuture<'_, Result<Arc<Store>>> {
        Box::pin(Store::open_watched(folder))
    }

    async fn open_watched(folder: &Path) -> Result<Arc<Store>> {
        let store = Store::open_unwatched(folder).await;
        let store = store.map_err(|error| with_advice(error, folder))?;
        tokio::spawn(health::watch(Arc::downgrade(&store)));
        store.keys_read.send_replace(false);
        tokio::spawn(scrub::scrub(Arc::downgrade(&store)));
        Ok(store)
    }

    /// Opens the store without the tasks that check its files and read its tables in the background.
    async fn open_unwatched(folder: &Path) -> Result<Arc<Store>> {
        let folder = folder.to_owned();
        let connect = move || Store::connect(&folder, Rebuild::IfItCannotGiveBack);
        let (store, submissions) = connections::blocking(connect).await?;
        let store = Arc::new(store);
        store.count_queue().await?;
        store.read_settings().await?;
        store.read_tokens().await?;
        store.read_clock().await?;
        store.read_pauses().await?;
        let committing = submit::commit_submissions(Arc::downgrade(&store), submissions);
        tokio::spawn(committing);
        Ok(store)
    }
}
