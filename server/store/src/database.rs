//! The one SQLite file: its connections, and the data that is also kept in memory.

use parking_lot::{Mutex, RwLock};
use std::{
    cell::Cell,
    collections::HashSet,
    ops::Deref,
    path::Path,
    sync::{
        Arc, OnceLock,
        atomic::{AtomicBool, AtomicI64, AtomicUsize},
    },
    time::{Duration, Instant},
};

use base::{memory::Budget, metrics::METRICS, token::Tokens};
use rusqlite::{Connection, Transaction, TransactionBehavior};
use tokio::sync::{mpsc, watch};

use super::{
    changes::Changes,
    compact,
    connections::{Connections, Lease, Mode, blocking, closed, open},
    damage::Damages,
    error::{Result, StoreError},
    folder::{Folder, Identity, JOURNAL, LOG, LOG_BYTES},
    intact::Intact,
    migrations,
    pages::Pages,
    pauses::Pauses,
    progress::{self, Known, LastCommit, Progress},
    reserve::Reserve,
    sql::Sql,
    submission::{Inbox, Pending},
};

/// How long a query or a change waits for a connection, behind others on a disk that hardly answers; then it fails, and
/// may be tried again.
const PATIENCE: Duration = Duration::from_secs(30);
/// How long a list or a count waits for a connection.
const LIST_PATIENCE: Duration = Duration::from_secs(5);

/// The database of one server.
#[derive(Debug)]
pub struct Store {
    /// The only connection that writes.
    writer: Arc<Connections>,
    /// The connection on which the writer reads outside its transaction: a page that cannot be read would end the
    /// transaction.
    beside: Arc<Connections>,
    pub(super) reader: Arc<Connections>,
    /// The connections for lists and counts, which may be slow, so that they do not delay other reads.
    lists: Arc<Connections>,
    /// The number of waiting jobs, as it is on the disk after every commit.
    pub(super) waiting: AtomicUsize,
    /// Whether the queue is paused, as it is on the disk after every commit.
    pub(super) paused: AtomicBool,
    /// The tokens, as they are on the disk after every commit.
    pub(super) tokens: RwLock<Tokens>,
    /// Whether a token exists, or ever existed.
    pub(super) any_tokens: AtomicBool,
    /// The number of jobs of one owner that may run at the same time; no limit until it is set.
    pub(super) most_running: OnceLock<usize>,
    /// The memory that running jobs share; no limit until it is set.
    pub(super) budget: OnceLock<Arc<Budget>>,
    /// The inbox in which submissions wait for the next commit.
    pub(super) inbox: Inbox,
    /// The keys of running jobs that a client has canceled, even if that could not be stored yet.
    pub(super) cancels: Mutex<HashSet<i64>>,
    /// What has changed lately.
    pub(super) changes: Changes,
    /// The record of what was found damaged.
    pub(super) damages: Arc<Damages>,
    /// Whether the request keys were read since the store was opened.
    pub(super) keys_read: watch::Sender<bool>,
    /// The content and inputs that were found intact.
    pub(super) intact: Arc<Intact>,
    /// How far the store's clock is ahead of the machine's clock (µs): see `clock`.
    pub(super) ahead: AtomicI64,
    /// The pauses that the store has not seen pass.
    pub(super) pauses: Pauses,
    /// The file that records how far the store has come.
    pub(super) progress: Progress,
    /// Whether the service that had the store before was stopped, and did not die.
    pub(super) was_stopped: bool,
    /// The reserved space that control operations use when the disk is full.
    pub(super) reserve: Reserve,
    /// The number of next commits that a test lets fail as on a full disk.
    #[cfg(test)]
    pub(super) full_commits: Arc<std::sync::atomic::AtomicU32>,
    // last: SQLite's files are closed before
    pub(super) identity: Identity,
    pub(super) folder: Folder,
}

/// Whether connecting to the store rebuilds the database.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rebuild {
    /// The database is rebuilt if an earlier version made it and it cannot give space back.
    IfItCannotGiveBack,
    /// Connecting does not rebuild the database; the caller may.
    Never,
}

/// The writing connection while a change uses it.
pub(super) struct Writer<'a> {
    pub(super) store: &'a Store,
    connection: &'a Connection,
    beside: &'a Connection,
    /// Whether a transaction could not begin. SQLite opens a file that it cannot write for reading only, which would
    /// last: such a connection is replaced.
    cannot_begin: Cell<bool>,
}

/// A transaction of the single writer; it is rolled back unless it is committed.
pub(super) struct Writing<'a> {
    tx: Transaction<'a>,
    store: &'a Store,
    number: i64,
}

impl Deref for Writing<'_> {
    type Target = Connection;

    fn deref(&self) -> &Connection {
        &self.tx
    }
}

impl Writing<'_> {
    /// Commits: the changes are on the disk when this returns.
    pub(super) fn commit(self) -> Result<()> {
        #[cfg(test)]
        if is_full(&self.store.full_commits) {
            return Err(StoreError::Full);
        }
        let start = Instant::now();
        self.tx.commit()?;
        METRICS.committed(start.elapsed());
        self.store.progress.reached(self.number);
        Ok(())
    }
}

impl Writer<'_> {
    /// Begins a transaction.
    pub(super) fn begin(&self) -> Result<Writing<'_>> {
        self.store.reserve.has_room()?;
        self.begin_control()
    }

    /// Begins a transaction that must work even if the disk is full.
    pub(super) fn begin_control(&self) -> Result<Writing<'_>> {
        self.store.damages.can_write()?;
        self.store.identity.check()?;
        let begun = Transaction::new_unchecked(self.connection, TransactionBehavior::Immediate);
        let tx = begun.inspect_err(|_| self.cannot_begin.set(true))?;
        let number = tx.value(
            "update progress set commits = commits + 1 returning commits",
            (),
        )?;
        Ok(Writing {
            tx,
            store: self.store,
            number,
        })
    }

    /// The connection, for statements outside a transaction.
    pub(super) fn connection(&self) -> &Connection {
        self.connection
    }

    /// A connection that reads only what is committed.
    pub(super) fn beside(&self) -> &Connection {
        self.beside
    }
}

impl Store {
    /// Connects to the database in `folder`, created if necessary, and brings its tables up to date. Also
    /// returns the receiver of submissions. The data kept in memory is not read yet.
    pub(super) fn connect(
        path: &Path,
        rebuild: Rebuild,
    ) -> Result<(Store, mpsc::Receiver<Pending>)> {
        let mut folder = Folder::lock(path)?;
        folder.is_complete()?;
        // before SQLite opens the database, for which it needs space even to read
        let reserve = Reserve::new(path);
        let known = progress::read(path)?;
        let database = folder.database();
        if let Some(doubt) = compare_with_the_past(path, &known, &database)? {
            tracing::warn!("{}: {doubt}", path.display());
        }
        folder.prepare()?;
        folder.tighten();
        let identity = Identity::of(&folder)?;
        let file = database.clone();
        let writer = Connections::new(1, PATIENCE, move || {
            let connection = open(&file, Mode::ReadWrite)?;
            connection.execute_batch(&format!(
                "pragma auto_vacuum = incremental; pragma journal_mode = wal;
                 pragma journal_size_limit = {LOG_BYTES}; pragma synchronous = full"
            ))?;
            Ok(connection)
        })?;
        let progress = prepare(&writer, path, rebuild, &identity)?;
        let file = database.clone();
        let reading = move || open(&file, Mode::Read);
        let beside = Connections::new(1, PATIENCE, reading.clone())?;
        let reader = Connections::new(4, PATIENCE, reading.clone())?;
        let lists = Connections::new(2, LIST_PATIENCE, reading)?;
        let (inbox, submissions) = Inbox::new();
        let store = Store {
            damages: Arc::new(Damages::new(reader.clone())),
            keys_read: watch::Sender::new(true),
            writer,
            beside,
            reader,
            lists,
            waiting: AtomicUsize::default(),
            paused: AtomicBool::default(),
            tokens: RwLock::default(),
            any_tokens: AtomicBool::default(),
            most_running: OnceLock::new(),
            budget: OnceLock::new(),
            inbox,
            cancels: Mutex::default(),
            changes: Changes::default(),
            intact: Arc::default(),
            ahead: AtomicI64::default(),
            pauses: Pauses::default(),
            progress,
            was_stopped: matches!(known, Known::Last(LastCommit { stopped: true, .. })),
            reserve,
            #[cfg(test)]
            full_commits: Arc::default(),
            identity,
            folder,
        };
        Ok((store, submissions))
    }

    /// Closes every connection; the last one merges the write-ahead log. Another server may then use the folder.
    pub async fn close(self: &Arc<Self>) {
        self.close_as(true).await;
    }

    /// Closes the store for a command that is not the service: the record of whether the service has stopped or died
    /// stays as it was.
    pub async fn close_as_found(self: &Arc<Self>) {
        self.close_as(self.was_stopped).await;
    }

    /// Whether the store was closed.
    pub(super) fn is_closed(&self) -> bool {
        self.writer.is_closed()
    }

    /// Closes the connections that read.
    pub(super) async fn close_readers(&self) {
        self.lists.close().await;
        self.reader.close().await;
    }

    async fn close_as(self: &Arc<Self>, stopped: bool) {
        self.note_alive().await;
        self.close_readers().await;
        let merged = self
            .write(|writer| {
                // SQLite does this with the last connection only, which may be one of another program that makes a backup:
                // what cannot be copied soon, stays for the next start
                let checkpoint = "pragma busy_timeout = 100; pragma wal_checkpoint(truncate)";
                Ok(writer.connection.execute_batch(checkpoint)?)
            })
            .await;
        if let Err(error) = merged {
            tracing::warn!(%error, "the write-ahead log could not be merged; the next start will read it: {error}");
        }
        self.beside.close().await;
        self.writer.close().await;
        self.reserve.keep_for_a_start();
        if stopped && let Err(error) = self.progress.stop() {
            tracing::warn!(%error, "{}: {error}", progress::FILE);
        }
        self.folder.unlock();
    }

    /// Runs a query on a thread that may block, and records the damage that it finds.
    pub(super) async fn read<T: Send + 'static>(
        self: &Arc<Self>,
        query: impl FnOnce(&Store, &Connection) -> Result<T> + Send + 'static,
    ) -> Result<T> {
        let lease = self.reader.turn().await?;
        self.query(lease, query).await
    }

    /// Runs a list or a count like `read`, but on connections for lists, so that other queries do not wait for it.
    pub(super) async fn read_list<T: Send + 'static>(
        self: &Arc<Self>,
        query: impl FnOnce(&Store, &Connection) -> Result<T> + Send + 'static,
    ) -> Result<T> {
        let lease = self.lists.turn().await?;
        self.query(lease, query).await
    }

    async fn query<T: Send + 'static>(
        self: &Arc<Self>,
        mut lease: Lease,
        query: impl FnOnce(&Store, &Connection) -> Result<T> + Send + 'static,
    ) -> Result<T> {
        let store = self.clone();
        blocking(move || {
            let found = query(&store, lease.get()?);
            drop(lease);
            store.damages.noting(found)
        })
        .await
    }

    /// Runs a change on a thread that may block, and records the damage that it finds. The change runs to its end even
    /// if nobody waits for it any more.
    pub(super) async fn write<T: Send + 'static>(
        self: &Arc<Self>,
        work: impl FnOnce(&Writer<'_>) -> Result<T> + Send + 'static,
    ) -> Result<T> {
        let (mut lease, store) = (self.writer.turn().await?, self.clone());
        blocking(move || {
            let done = store.attempt(&mut lease, work);
            let done = store.noting_what_cannot_be_written(&mut lease, done);
            drop(lease); // before the store, which may be its last user
            done
        })
        .await
    }

    /// Runs a change like `write`, and also when the disk is full: then it runs once more, with the reserved space
    /// released.
    pub(super) async fn control<T: Send + 'static>(
        self: &Arc<Self>,
        work: impl Fn(&Writer<'_>) -> Result<T> + Send + 'static,
    ) -> Result<T> {
        let (mut lease, store) = (self.writer.turn().await?, self.clone());
        blocking(move || {
            let mut done = store.attempt(&mut lease, &work);
            if let Err(StoreError::Full) = done {
                // it may have been released a moment ago, for another
                store.reserve.release();
                done = store.attempt(&mut lease, &work);
            }
            let done = store.noting_what_cannot_be_written(&mut lease, done);
            drop(lease);
            done
        })
        .await
    }

    fn attempt<T>(
        &self,
        lease: &mut Lease,
        work: impl FnOnce(&Writer<'_>) -> Result<T>,
    ) -> Result<T> {
        let mut beside = self.beside.free().ok_or_else(closed)?; // only who writes has it
        let writer = Writer {
            store: self,
            connection: lease.get()?,
            beside: beside.get()?,
            cannot_begin: Cell::new(false),
        };
        let done = work(&writer);
        // and one that has met a full disk begins anew, too
        if writer.cannot_begin.get() || matches!(done, Err(StoreError::Full)) {
            lease.discard();
        }
        done
    }

    /// Records the damage that a change has met. Damage of the database may concern a single page, which other changes
    /// do not need, or a disk may have failed to read once: all writing is stopped only if a check cannot write
    /// anything either.
    fn noting_what_cannot_be_written<T>(&self, lease: &mut Lease, done: Result<T>) -> Result<T> {
        match self.damages.noting(done) {
            Err(StoreError::Damaged(damage)) if damage.record.is_database() => {
                lease.discard(); // a new connection has read nothing yet
                match self.attempt(lease, |writer| writer.write_and_roll_back()) {
                    Err(StoreError::Damaged(_)) => Err(self.damages.stop_writing(&damage)),
                    Ok(()) | Err(_) => Err(StoreError::Damaged(damage)),
                }
            }
            other => other,
        }
    }
}

/// Brings the tables up to date, before any connection reads; returns how far the store has come.
fn prepare(
    writer: &Arc<Connections>,
    path: &Path,
    rebuild: Rebuild,
    identity: &Identity,
) -> Result<Progress> {
    let mut lease = writer.free().ok_or_else(closed)?;
    let writer = lease.get()?;
    migrations::run(writer, path)?;
    if rebuild == Rebuild::IfItCannotGiveBack {
        compact::enable_giving_back(writer, path)?;
    }
    // the service may have died between giving space back and copying the log into the file
    let pages = Pages::of(writer)?;
    identity.may_shrink_to(pages.bytes_of(pages.count));
    let record = progress::in_database(writer)?;
    let record =
        record.ok_or_else(|| StoreError::Unexpected("the table progress is empty".into()))?;
    Progress::start(path, record).map_err(|error| {
        let file = path.join(progress::FILE);
        StoreError::Folder(format!("cannot write {}: {error}", file.display()))
    })
}

/// Compares the database with what is known of its last commit, before anything is written to it. Returns why data may
/// be lost unnoticed, if too little is known.
pub(super) fn compare_with_the_past(
    path: &Path,
    known: &Known,
    database: &Path,
) -> Result<Option<String>> {
    if !progress::has_content(database) {
        return match known {
            Known::Last(_) => Err(StoreError::Lost("it is missing or empty".into())),
            _ if progress::has_content(&path.join(LOG)) => Err(StoreError::Lost(
                "it is missing or empty, and only its write-ahead log exists".into(),
            )),
            _ => Ok(None),
        };
    }
    // the disk failed when the database was created: what was half done is undone first
    let half_created = progress::has_content(&path.join(JOURNAL));
    let mode = if half_created {
        Mode::ReadWrite
    } else {
        Mode::Read
    };
    let connection = open(database, mode)?;
    migrations::check(&connection)?;
    let found = progress::in_database(&connection)?;
    progress::compare(known, found.as_ref())
}

/// The error with advice on what the operator can do about it.
pub fn with_advice(error: StoreError, path: &Path) -> StoreError {
    let database = path.join(super::folder::DATABASE);
    let damaged = |how: &str| {
        StoreError::Lost(format!(
            "the database {} {how}; restore it from a backup, or save what is intact with \
             `signorini doctor --data {} --salvage NEW_FOLDER`",
            database.display(),
            path.display()
        ))
    };
    match error {
        StoreError::Lost(what) => StoreError::Lost(format!(
            "the database {} was changed since the service last used it: {what}; restore {} and {LOG}, or, if you want to continue \
             with the present files, run `signorini doctor --accept --data {}`",
            database.display(),
            super::folder::DATABASE,
            path.display()
        )),
        StoreError::Broken(_) => damaged("is damaged where jobs are stored"),
        StoreError::Damaged(damage) => damaged(&format!("cannot be read: {}", damage.cause)),
        StoreError::Full | StoreError::Database(_) => StoreError::Folder(format!(
            "the store in {} cannot be opened: {error}",
            path.display()
        )),
        other => other,
    }
}

/// Whether this commit is to fail as on a full disk, where the write-ahead log cannot grow.
#[cfg(test)]
fn is_full(commits: &std::sync::atomic::AtomicU32) -> bool {
    use std::sync::atomic::Ordering::Relaxed;
    commits
        .fetch_update(Relaxed, Relaxed, |left| left.checked_sub(1))
        .is_ok()
}
