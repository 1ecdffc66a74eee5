//! One transaction of the single writer, and its effects once it is committed: changes to the waiting jobs that are
//! kept in memory, and jobs whose watchers are to be notified.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use sqlx::SqliteConnection;
use tokio::sync::MutexGuard;
use tracing::info;

use super::{
    damage::Damages,
    database::{Store, Writing},
    error::{Result, StoreError},
    intact::{self, WHOLE},
    problems::{self, StoredProblem},
    rows,
    waiting::{Move, Owner},
};
use crate::{
    job::{Job, JobId, Reason, Status},
    memory::Budget,
    metrics::METRICS,
    time::Time,
};

/// An open transaction.
pub(super) struct Change<'a> {
    store: &'a Store,
    tx: Writing,
    moves: Vec<Move>,
    /// How many more jobs of each owner wait by these moves.
    more: BTreeMap<Owner, isize>,
    /// Jobs that have changed, for their watchers.
    changed: Vec<i64>,
    /// Rows of jobs that need a new checksum.
    touched: BTreeSet<i64>,
    /// What the log will tell of jobs that end or are deleted.
    log_lines: Vec<(JobId, LogLine)>,
    /// Held until the moves are applied: no other change begins before, so that moves are applied in the order of
    /// commits.
    _lock: MutexGuard<'a, ()>,
}

/// What the log tells of a job.
enum LogLine {
    Ended {
        owner: String,
        times_s: Option<(f64, f64)>,
        status: Status,
        reason: Option<Reason>,
        detail: String,
    },
    Deleted,
}

/// A point in a transaction to which it can be rolled back.
#[derive(Clone, Copy)]
pub(super) struct Savepoint {
    moves: usize,
    changed: usize,
    log_lines: usize,
}

impl Store {
    /// Begins a transaction that may change jobs that wait.
    pub(super) async fn change(&self) -> Result<Change<'_>> {
        self.reserve.has_room()?;
        self.control_change().await
    }

    /// The same for what must work even if the disk is full.
    pub(super) async fn control_change(&self) -> Result<Change<'_>> {
        let lock = self.change_lock.lock().await;
        Ok(Change {
            _lock: lock,
            store: self,
            tx: self.begin_control().await?,
            moves: vec![],
            more: BTreeMap::new(),
            changed: vec![],
            touched: BTreeSet::new(),
            log_lines: vec![],
        })
    }
}

impl Change<'_> {
    /// The connection, for statements.
    pub(super) fn sql(&mut self) -> &mut SqliteConnection {
        &mut self.tx
    }

    /// What was found damaged.
    pub(super) fn damages(&self) -> &Damages {
        &self.store.damages
    }

    /// The memory that running jobs share.
    pub(super) fn budget(&self) -> &Arc<Budget> {
        self.store.budget()
    }

    /// Changes the waiting jobs in memory, once this is committed.
    pub(super) fn move_job(&mut self, change: Move) {
        self.count(&change, 1);
        self.moves.push(change);
    }

    /// Counts a move, or takes it back: looking at all moves for every job of a large submission would take minutes.
    fn count(&mut self, change: &Move, sign: isize) {
        let (owner, more) = match change {
            Move::Enter(place) => (&place.owner, 1),
            Move::Attach(owner) => (owner, 1),
            Move::Leave(place) => (&place.owner, -1),
            Move::Detach(owner) => (owner, -1),
            Move::Start(_) | Move::Stop(_) | Move::Turn { .. } => return,
        };
        *self.more.entry(owner.clone()).or_default() += sign * more;
    }

    /// Records that this job has changed.
    pub(super) fn changed(&mut self, key: i64) {
        self.changed.push(key);
    }

    /// The row of this job has changed.
    pub(super) fn touched(&mut self, key: i64) {
        self.touched.insert(key);
    }

    /// A job ends: told in the log and counted, once this is committed. `times_s`: how long it waited and ran, if it ran.
    pub(super) fn ended(
        &mut self,
        job: &Job,
        times_s: Option<(f64, f64)>,
        status: Status,
        reason: Option<Reason>,
        detail: String,
    ) {
        let (id, owner) = (job.id, job.owner.clone());
        let ended = LogLine::Ended {
            owner,
            times_s,
            status,
            reason,
            detail,
        };
        self.log_lines.push((id, ended));
    }

    /// A job is deleted: told in the log, once this is committed.
    pub(super) fn deleted(&mut self, id: JobId) {
        self.log_lines.push((id, LogLine::Deleted));
    }

    /// What was read, unless it is damaged, which is noted.
    pub(super) async fn unless_damaged<T>(&self, read: Result<T>) -> Result<Option<T>> {
        match self.store.damages.noting(async { read }).await {
            Ok(read) => Ok(Some(read)),
            Err(StoreError::Damaged(_)) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// What was read of this job, unless a record of it is damaged, which is noted. If it is the database, it is an error:
    /// the change may be half done.
    pub(super) async fn unless_damage_of<T>(&self, key: i64, read: Result<T>) -> Result<Option<T>> {
        match read {
            Err(error) if !error.is_damage_of(key) => Err(error),
            read => self.unless_damaged(read).await,
        }
    }

    /// The problem of a job. It is read beside the transaction first: a page that cannot be read would end that.
    pub(super) async fn problem(&mut self, job: &Job) -> Result<StoredProblem> {
        let mut reader = self.store.reader.acquire().await?;
        match problems::find(&mut reader, job).await {
            Ok(Some(found)) => Ok(found),
            Err(error) if !error.is_damage_of(job.key) => {
                Err(error.reading(|| problems::record(job)))
            }
            // this transaction may have written it, or mended it
            Ok(None) | Err(_) => problems::read(&mut self.tx, job).await,
        }
    }

    /// Whether the result of a job that has ended is as it was written; checked once, and beside the transaction, as above.
    pub(super) async fn has_intact_result(&self, job: &Job) -> Result<bool> {
        let (store, key) = (self.store, job.result_key);
        if store.intact.contains(key, WHOLE) {
            return Ok(true);
        }
        let mut reader = store.reader.acquire().await?;
        let checked = intact::check_stored(&mut reader, key).await;
        let intact = self.unless_damaged(checked).await?.is_some();
        if intact {
            store.intact.insert(key, WHOLE);
        }
        Ok(intact)
    }

    /// This moment, by the clock of the store.
    pub(super) fn now(&self) -> Time {
        self.store.now()
    }

    /// Jobs that have changed since a savepoint.
    pub(super) fn changed_since(&self, savepoint: Savepoint) -> Vec<i64> {
        self.changed
            .get(savepoint.changed..)
            .unwrap_or_default()
            .to_vec()
    }

    /// How many jobs of this owner wait, with the changes of this transaction.
    pub(super) fn waiting_of(&self, owner: &str) -> usize {
        let more = self.more.get(owner).copied().unwrap_or_default();
        let waiting = self.store.waiting_jobs().len_of(owner);
        waiting.saturating_add_signed(more)
    }

    /// The next job that waits, with the changes of this transaction, and its owner's turn.
    pub(super) fn next(&self, damaged: &BTreeSet<i64>) -> Option<(i64, Move)> {
        let most_running = self.store.most_running_of_owner();
        let mut waiting = self.store.waiting_jobs();
        waiting.with(&self.moves, |waiting| waiting.next(damaged, most_running))
    }

    /// How many jobs wait, with the changes of this transaction.
    pub(super) fn waiting(&self) -> usize {
        let more: isize = self.more.values().sum();
        self.store.waiting_jobs().len().saturating_add_signed(more)
    }

    /// Sets a point to roll back to. There is one at a time: it is released or rolled back to before the next is set.
    pub(super) async fn savepoint(&mut self) -> Result<Savepoint> {
        sqlx::query("savepoint submission")
            .execute(self.sql())
            .await?;
        Ok(Savepoint {
            moves: self.moves.len(),
            changed: self.changed.len(),
            log_lines: self.log_lines.len(),
        })
    }

    /// Keeps the changes since the savepoint.
    pub(super) async fn release(&mut self) -> Result<()> {
        sqlx::query("release submission")
            .execute(self.sql())
            .await?;
        Ok(())
    }

    /// Undoes the changes since this savepoint.
    pub(super) async fn roll_back_to(&mut self, savepoint: Savepoint) -> Result<()> {
        sqlx::query("rollback to submission")
            .execute(self.sql())
            .await?;
        self.release().await?;
        for change in self.moves.split_off(savepoint.moves) {
            self.count(&change, -1);
        }
        self.changed.truncate(savepoint.changed);
        self.log_lines.truncate(savepoint.log_lines);
        Ok(())
    }

    /// Commits: the changes are on the disk when this returns, and only then applied to the jobs in memory. Returns the
    /// jobs that have changed.
    pub(super) async fn commit(mut self) -> Result<Vec<i64>> {
        for key in &self.touched {
            rows::seal(&mut self.tx, *key).await?;
        }
        self.tx.commit().await?;
        let mut waiting = self.store.waiting_jobs();
        for change in self.moves {
            waiting.apply(change);
        }
        drop(waiting);
        self.log_lines.iter().for_each(|(id, line)| line.log(*id));
        Ok(self.changed)
    }
}

impl LogLine {
    fn log(&self, job: JobId) {
        match self {
            LogLine::Deleted => info!(job.id = %job, "job {job} was deleted"),
            LogLine::Ended {
                owner,
                times_s,
                status,
                reason,
                detail,
            } => {
                let (status, reason): (&'static str, _) =
                    ((*status).into(), reason.map(<&'static str>::from));
                let words = [
                    Some(status),
                    reason,
                    Some(&**detail).filter(|detail| !detail.is_empty()),
                ];
                let words: Vec<&str> = words.into_iter().flatten().collect();
                METRICS.job_ended(status, reason, *times_s);
                let (wait_s, run_s) = times_s.unzip();
                info!(job.id = %job, owner, job.status = status, job.reason = reason, wait_s, run_s, "job {job} has ended: {}", words.join(": "));
            }
        }
    }
}
