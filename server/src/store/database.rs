//! The one SQLite file: its connections, and the data that is also kept in memory.

use std::{
    collections::HashSet,
    ops::{Deref, DerefMut},
    path::Path,
    sync::{
        Arc, Mutex, MutexGuard, OnceLock, PoisonError, RwLock,
        atomic::{AtomicBool, AtomicI64, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use sqlx::{
    ConnectOptions, Connection, Sqlite, SqliteConnection, SqlitePool, Transaction,
    sqlite::{
        SqliteAutoVacuum, SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions,
        SqliteSynchronous,
    },
};
use tokio::sync::{mpsc, watch};

use super::{
    compact,
    damage::Damages,
    error::{Result, StoreError},
    folder::{Folder, Identity, JOURNAL, LOG, LOG_BYTES},
    intact::Intact,
    migrations,
    pages::Pages,
    pauses::Pauses,
    progress::{self, Known, LastCommit, Progress},
    reserve::Reserve,
    submission::{Inbox, Pending},
    waiting::WaitingJobs,
};
use crate::{memory::Budget, metrics::METRICS, token::Tokens};

/// How long a list waits for a connection.
const LIST_PATIENCE: Duration = Duration::from_secs(5);

/// The database of one server.
#[derive(Debug)]
pub struct Store {
    pub(super) writer: SqlitePool,
    /// The connection of the writer could not begin a transaction: it is to be replaced.
    cannot_begin: Arc<AtomicBool>,
    pub(super) reader: SqlitePool,
    /// For lists and counts, which may be slow, so that they do not delay other reads.
    pub(super) lists: SqlitePool,
    /// The jobs that wait, as they are on the disk after every commit.
    pub(super) waiting: Mutex<WaitingJobs>,
    /// Whether the queue is paused, as it is on the disk after every commit.
    pub(super) paused: AtomicBool,
    /// Who may use the service, as it is on the disk after every commit.
    pub(super) tokens: RwLock<Tokens>,
    /// There is a token, or was.
    pub(super) any_tokens: AtomicBool,
    /// How many jobs of one owner may run; without limit until it is set.
    pub(super) most_running: OnceLock<usize>,
    /// The memory that running jobs share; without limit until it is set.
    pub(super) budget: OnceLock<Arc<Budget>>,
    /// One transaction at a time changes the jobs that wait.
    pub(super) change_lock: tokio::sync::Mutex<()>,
    /// Where submissions wait for the next commit.
    pub(super) inbox: Inbox,
    /// Running jobs that a client has canceled, even if that could not be stored yet.
    pub(super) cancels: Mutex<HashSet<i64>>,
    /// What was found damaged.
    pub(super) damages: Arc<Damages>,
    /// Whether the request keys were read since it was opened.
    pub(super) keys_read: watch::Sender<bool>,
    /// Results that were found intact.
    pub(super) intact: Arc<Intact>,
    /// How far its clock is ahead of that of the machine, in microseconds: see `clock`.
    pub(super) ahead: AtomicI64,
    /// Time that it has not seen pass.
    pub(super) pauses: Pauses,
    /// How far the store has come.
    pub(super) progress: Progress,
    /// The service that had it before this one stopped, and did not die.
    pub(super) was_stopped: bool,
    /// Space for control when the disk is full.
    pub(super) reserve: Reserve,
    /// How many of the next commits find the disk full.
    #[cfg(test)]
    pub(super) full_commits: Arc<std::sync::atomic::AtomicU32>,
    // last: SQLite's files are closed before
    pub(super) identity: Identity,
    pub(super) folder: Folder,
}

/// Whether the database is rebuilt when the store is connected to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rebuild {
    /// If it is of an earlier version and cannot give space back.
    IfItCannotGiveBack,
    /// By whoever connects, if at all.
    Never,
}

/// A transaction of the single writer; unless it is committed it is rolled back.
pub(super) struct Writing {
    tx: Transaction<'static, Sqlite>,
    progress: Progress,
    number: i64,
    #[cfg(test)]
    full_commits: Arc<std::sync::atomic::AtomicU32>,
}

impl Deref for Writing {
    type Target = SqliteConnection;

    fn deref(&self) -> &SqliteConnection {
        &self.tx
    }
}

impl DerefMut for Writing {
    fn deref_mut(&mut self) -> &mut SqliteConnection {
        &mut self.tx
    }
}

impl Writing {
    /// Commits: the changes are on the disk when this returns.
    pub(super) async fn commit(self) -> Result<()> {
        #[cfg(test)]
        if is_full(&self.full_commits) {
            return Err(StoreError::Full);
        }
        let start = Instant::now();
        self.tx.commit().await?;
        METRICS.committed(start.elapsed());
        self.progress.reached(self.number);
        Ok(())
    }
}

impl Store {
    /// Connects to the database in `folder`, created if necessary, and brings its tables up to date. Also
    /// returns the receiver of submissions. The data kept in memory is not read yet.
    pub(super) async fn connect(
        path: &Path,
        rebuild: Rebuild,
    ) -> Result<(Store, mpsc::Receiver<Pending>)> {
        let mut folder = Folder::lock(path)?;
        folder.is_complete()?;
        // before SQLite opens the database, for which it needs space even to read
        let reserve = Reserve::new(path);
        let known = progress::read(path)?;
        let database = folder.database();
        let options = SqliteConnectOptions::new()
            .filename(&database)
            .foreign_keys(true)
            .busy_timeout(Duration::from_secs(5));
        if let Some(doubt) = compare_with_the_past(path, &known, options.clone()).await? {
            tracing::warn!("{}: {doubt}", path.display());
        }
        folder.prepare()?;
        folder.tighten();
        let identity = Identity::of(&folder)?;
        let writing = options
            .clone()
            .auto_vacuum(SqliteAutoVacuum::Incremental)
            .journal_mode(SqliteJournalMode::Wal)
            .pragma("journal_size_limit", LOG_BYTES.to_string())
            .synchronous(SqliteSynchronous::Full);
        // Two kinds of connections are replaced by new ones. A full disk makes SQLite end a transaction by itself, which
        // leaves the driver's count of open ones wrong permanently. And SQLite opens a file that it cannot write for
        // reading only, which would last: the first transaction of such a connection fails.
        let cannot_begin = Arc::new(AtomicBool::default());
        let failed = cannot_begin.clone();
        let writer = pool(1)
            .before_acquire(move |connection, _| {
                let whole = !connection.is_in_transaction() && !failed.swap(false, Relaxed);
                Box::pin(async move { Ok(whole) })
            })
            .connect_with(writing)
            .await?;
        migrations::run(&writer, path).await?;
        if rebuild == Rebuild::IfItCannotGiveBack {
            // before there are connections that read
            compact::enable_giving_back(&mut *writer.acquire().await?, path).await?;
        }
        // the service may have died between giving space back and copying the log into the file
        let pages = Pages::of(&mut *writer.acquire().await?).await?;
        identity.may_shrink_to(pages.bytes_of(pages.count));
        let record = progress::in_database(&mut *writer.acquire().await?).await?;
        let record = record.ok_or_else(|| StoreError::Unexpected("no progress".into()))?;
        let progress = Progress::start(path, record).map_err(|error| {
            let file = path.join(progress::FILE);
            StoreError::Folder(format!("cannot write {}: {error}", file.display()))
        })?;
        let reading = options.read_only(true);
        let reader = pool(4).connect_with(reading.clone()).await?;
        let lists = pool(2)
            .acquire_timeout(LIST_PATIENCE)
            .connect_with(reading)
            .await?;
        let (inbox, submissions) = Inbox::new();
        let store = Store {
            damages: Arc::new(Damages::new(reader.clone())),
            keys_read: watch::Sender::new(true),
            writer,
            cannot_begin,
            reader,
            lists,
            waiting: Mutex::default(),
            paused: AtomicBool::default(),
            tokens: RwLock::default(),
            any_tokens: AtomicBool::default(),
            most_running: OnceLock::new(),
            budget: OnceLock::new(),
            change_lock: tokio::sync::Mutex::default(),
            inbox,
            cancels: Mutex::default(),
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

    /// The waiting jobs.
    pub(super) fn waiting_jobs(&self) -> MutexGuard<'_, WaitingJobs> {
        // No code panics while it holds this lock; if one did, the list would still be whole.
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Closes every connection, and with the last one the write-ahead log. Another server may use the folder then.
    pub async fn close(&self) {
        self.close_as(true).await;
    }

    /// The same by a command that is not the service: whether the service has stopped or died, its next start still knows.
    pub async fn close_as_found(&self) {
        self.close_as(self.was_stopped).await;
    }

    async fn close_as(&self, stopped: bool) {
        self.note_alive().await;
        self.lists.close().await;
        self.reader.close().await;
        // SQLite does this with the last connection only, which may be one for reading whose thread ends late, or of another
        // program that makes a backup: what cannot be copied soon, stays for the next start
        let checkpoint =
            sqlx::raw_sql("pragma busy_timeout = 100; pragma wal_checkpoint(truncate)");
        if let Err(error) = checkpoint.execute(&self.writer).await {
            tracing::warn!(%error, "the write-ahead log could not be merged; the next start will read it: {error}");
        }
        self.writer.close().await;
        self.reserve.keep_for_a_start();
        if stopped && let Err(error) = self.progress.stop() {
            tracing::warn!(%error, "{}: {error}", progress::FILE);
        }
        self.folder.unlock();
    }

    /// Begins a transaction of the single writer.
    pub(super) async fn begin(&self) -> Result<Writing> {
        self.reserve.has_room()?;
        self.begin_control().await
    }

    /// The same for what must work even if the disk is full.
    pub(super) async fn begin_control(&self) -> Result<Writing> {
        self.damages.can_write()?;
        self.identity.check()?;
        let begun = self.writer.begin_with("begin immediate").await;
        let mut tx = begun.inspect_err(|_| self.cannot_begin.store(true, Relaxed))?;
        let count = "update progress set commits = commits + 1 returning commits";
        let number = sqlx::query_scalar(count).fetch_one(&mut *tx).await?;
        let progress = self.progress.clone();
        Ok(Writing {
            tx,
            progress,
            number,
            #[cfg(test)]
            full_commits: self.full_commits.clone(),
        })
    }

    /// Does something that must work even if the disk is full: then once more, with the space that is reserved for it.
    pub(super) async fn control<T, F: Future<Output = Result<T>>>(
        &self,
        work: impl Fn() -> F,
    ) -> Result<T> {
        let done = match work().await {
            Err(StoreError::Full) => {
                // it may have been released a moment ago, for another
                self.reserve.release();
                work().await
            }
            other => other,
        };
        self.writing(async { done }).await
    }

    /// Runs what writes, and takes note of damage that it finds. Damage of the database may be that of a single page, of data
    /// that this alone has met, or a disk may have failed to read once: only if nothing else can be written either, all
    /// writing ends.
    pub(super) async fn writing<T>(&self, work: impl Future<Output = Result<T>>) -> Result<T> {
        match self.damages.noting(work).await {
            Err(StoreError::Damaged(damage)) if damage.record.is_database() => {
                self.cannot_begin.store(true, Relaxed); // a new connection has read nothing yet
                match self.write_and_roll_back().await {
                    Err(StoreError::Damaged(_)) => Err(self.damages.stop_writing(&damage)),
                    Ok(()) | Err(_) => Err(StoreError::Damaged(damage)),
                }
            }
            other => other,
        }
    }
}

/// Compares the database with what is known of it before anything is written to it. If too little is known, why.
pub(super) async fn compare_with_the_past(
    path: &Path,
    known: &Known,
    options: SqliteConnectOptions,
) -> Result<Option<String>> {
    if !progress::has_content(&path.join(super::folder::DATABASE)) {
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
    let mut connection = options.read_only(!half_created).connect().await?;
    let compared = async {
        migrations::check(&mut connection).await?;
        let found = progress::in_database(&mut connection).await?;
        progress::compare(known, found.as_ref())
    };
    let compared = compared.await;
    connection.close().await?;
    compared
}

/// What the operator can do.
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
        StoreError::Full | StoreError::Database(_) | StoreError::Migrate(_) => StoreError::Folder(
            format!("the store in {} cannot be opened: {error}", path.display()),
        ),
        other => other,
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

/// Whether a commit is to find the disk full, as it does where the write-ahead log cannot grow.
#[cfg(test)]
fn is_full(commits: &std::sync::atomic::AtomicU32) -> bool {
    use std::sync::atomic::Ordering::Relaxed;
    commits
        .fetch_update(Relaxed, Relaxed, |left| left.checked_sub(1))
        .is_ok()
}
