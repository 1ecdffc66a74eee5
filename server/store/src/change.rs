//! One transaction of the single writer, and its effects once it is committed.
//!
//! A job is changed by [`Change::update`] and in no other way (but for the number of its last event, which follows from
//! appending): the caller gives a function that changes its row, and everything else follows from the row. The row is written whole, with its checksum, before the next statement of the
//! transaction or its commit; its version is counted, its events are appended, its line in the log is kept for after
//! the commit, and its key, if the status has changed, is returned by the commit for those who wake its watchers.

use std::{
    collections::{BTreeMap, BTreeSet},
    mem,
    sync::Arc,
};

use base::{
    event::Payload,
    job::{Job, JobId, Progress, Status},
    memory::Budget,
    metrics::METRICS,
    time::Time,
};
use rusqlite::Connection;
use tracing::info;

use super::{
    changes::Changed,
    checksum::Value,
    content::{self, Holder, name},
    damage::Damages,
    database::{Store, Writer, Writing},
    error::{Result, StoreError},
    events, intact,
    rows::{self, JobRow},
    rules::{self, Ended},
    sql::Sql,
};

/// The number of rows that a transaction keeps in memory: some transactions change all jobs that wait.
const MOST_ROWS: usize = 256;

/// An open transaction.
pub(super) struct Change<'a> {
    writer: &'a Writer<'a>,
    store: &'a Store,
    tx: Writing<'a>,
    /// The rows of jobs that this transaction has read or changed, by their keys.
    rows: BTreeMap<i64, Cached>,
    /// The keys of rows in `rows` that are not written yet.
    unwritten: BTreeSet<i64>,
    /// The key of the next job, once one was inserted.
    next_key: Option<i64>,
    /// The keys of the jobs whose status has changed: their watchers are woken after the commit.
    changed: Vec<i64>,
    /// What those who follow lists are told after the commit.
    noted: BTreeSet<Changed>,
    /// The lines about jobs that end or are deleted, which are logged after the commit.
    log_lines: Vec<(JobId, LogLine)>,
}

/// The row of a job, as the transaction keeps it in memory.
struct Cached {
    row: JobRow,
    /// The values of the row's columns, as they are in the database; `None` if the row is not inserted yet.
    stored: Option<Vec<Value>>,
    /// Events that are appended once the row is inserted.
    events: Vec<Events>,
}

/// Events of one attempt, numbered from `first`.
struct Events {
    first: i64,
    attempt: i32,
    events: Vec<(Time, Payload)>,
}

/// What the log tells of a job.
enum LogLine {
    Ended(Ended),
    Deleted,
}

/// A point in a transaction to which it can be rolled back.
#[derive(Clone, Copy)]
pub(super) struct Savepoint {
    changed: usize,
    log_lines: usize,
}

impl Writer<'_> {
    /// Begins a transaction that may change jobs.
    pub(super) fn change(&self) -> Result<Change<'_>> {
        self.store.reserve.has_room()?;
        self.control_change()
    }

    /// Begins a transaction that must work even if the disk is full, such as a cancel.
    pub(super) fn control_change(&self) -> Result<Change<'_>> {
        Ok(Change {
            writer: self,
            store: self.store,
            tx: self.begin_control()?,
            rows: BTreeMap::new(),
            unwritten: BTreeSet::new(),
            next_key: None,
            changed: vec![],
            noted: BTreeSet::new(),
            log_lines: vec![],
        })
    }
}

/// Reading and changing jobs.
impl Change<'_> {
    /// The job with this key, as this transaction has left it, if it exists.
    pub(super) fn find(&mut self, key: i64) -> Result<Option<Job>> {
        let found = self.cached(key)?;
        Ok(found.map(|cached| cached.row.job.clone()))
    }

    /// The job with this key, which must exist, as this transaction has left it.
    pub(super) fn read(&mut self, key: i64) -> Result<Job> {
        self.find(key)?.ok_or_else(|| rows::missing(key))
    }

    /// Whether this attempt of the job is the current one, and running.
    pub(super) fn is_current(&mut self, key: i64, attempt: i32) -> Result<bool> {
        let found = self.cached(key)?.map(|cached| &cached.row.job);
        Ok(found.is_some_and(|job| job.status == Status::Running && job.attempt == attempt))
    }

    /// Accepts a job: `new` makes its row from its key, which is returned.
    pub(super) fn insert(&mut self, new: impl FnOnce(i64) -> JobRow) -> Result<i64> {
        let key = match self.next_key {
            Some(key) => key,
            None => rows::next_key(&self.tx)?,
        };
        self.next_key = Some(key + 1);
        let mut row = new(key);
        let events = Vec::from_iter(rules::event(None, &row.job, self.now()));
        row.last_seq = events.len() as i64;
        let first = Events {
            first: 1,
            attempt: row.job.attempt,
            events,
        };
        let cached = Cached {
            row,
            stored: None,
            events: vec![first],
        };
        self.keep(key, cached)?;
        self.unwritten.insert(key);
        self.noted.insert(Changed::Job(key));
        Ok(key)
    }

    /// Changes a job, which must exist, by `step`. Everything that follows from the change is done here, too. Returns
    /// the changed job.
    pub(super) fn update(
        &mut self,
        key: i64,
        step: impl FnOnce(&mut JobRow) -> Result<()>,
    ) -> Result<Job> {
        let now = self.now();
        let cached = self.cached(key)?;
        let cached = cached.ok_or_else(|| rows::missing(key))?;
        let mut new = cached.row.clone();
        step(&mut new)?;
        if new == cached.row {
            return Ok(new.job);
        }
        new.job.version += i64::from(rules::is_new_version(&cached.row.job, &new.job));
        new.derive();
        let job = new.job.clone();
        let old = mem::replace(&mut cached.row, new).job;
        self.unwritten.insert(key);
        let only_progress = old.version == job.version && old.status == job.status;
        self.noted.insert(if only_progress {
            Changed::Progress(key)
        } else {
            Changed::Job(key)
        });
        if old.status != job.status {
            self.changed.push(key);
        }
        if let Some(ended) = rules::ended(&old, &job) {
            self.log_lines.push((job.id, LogLine::Ended(ended)));
        }
        if let Some(event) = rules::event(Some(&old), &job, now) {
            self.append(key, &[event])?;
        }
        Ok(job)
    }

    /// Changes a job, which must exist, by a step that is allowed in every status. Returns the changed job.
    pub(super) fn set(&mut self, key: i64, step: impl FnOnce(&mut JobRow)) -> Result<Job> {
        let step = |row: &mut JobRow| {
            step(row);
            Ok(())
        };
        self.update(key, step)
    }

    /// Appends events to a job, which must exist.
    pub(super) fn append(&mut self, key: i64, events: &[(Time, Payload)]) -> Result<()> {
        let cached = self.cached(key)?;
        let cached = cached.ok_or_else(|| rows::missing(key))?;
        let row = &mut cached.row;
        let (first, attempt) = (row.last_seq + 1, row.job.attempt);
        row.last_seq += events.len() as i64;
        let inserted = cached.stored.is_some();
        if !inserted {
            cached.events.push(Events {
                first,
                attempt,
                events: events.to_vec(),
            });
        }
        self.unwritten.insert(key);
        if inserted {
            events::insert(&self.tx, key, first, attempt, events)?;
        }
        Ok(())
    }

    /// Appends events of the current attempt, and sets the job's progress after these events.
    pub(super) fn append_with_progress(
        &mut self,
        key: i64,
        events: &[(Time, Payload)],
        progress: &Progress,
    ) -> Result<()> {
        let events = self.store.events_by_our_clock(events);
        self.append(key, &events)?;
        let progress = Some(progress.clone());
        self.set(key, |row| row.job.progress = progress)?;
        Ok(())
    }

    /// Deletes a job that has ended, and the data that no other job shares.
    pub(super) fn delete(&mut self, job: &Job) -> Result<()> {
        let now = self.now();
        rows::delete(self.sql()?, job, now)?;
        self.rows.remove(&job.key);
        self.noted.insert(Changed::Job(job.key));
        self.changed.push(job.key);
        self.log_lines.push((job.id, LogLine::Deleted));
        Ok(())
    }

    /// The row with this key, as this transaction has left it, if it exists.
    fn cached(&mut self, key: i64) -> Result<Option<&mut Cached>> {
        if !self.rows.contains_key(&key) {
            let Some((row, stored)) = rows::find_row(&self.tx, key)? else {
                return Ok(None);
            };
            let (stored, events) = (Some(stored), vec![]);
            self.keep(
                key,
                Cached {
                    row,
                    stored,
                    events,
                },
            )?;
        }
        Ok(self.rows.get_mut(&key))
    }

    fn keep(&mut self, key: i64, cached: Cached) -> Result<()> {
        if self.rows.len() >= MOST_ROWS {
            self.write_rows()?;
            self.rows.clear();
        }
        self.rows.insert(key, cached);
        Ok(())
    }

    /// Writes the rows that have changed to the database.
    fn write_rows(&mut self) -> Result<()> {
        for key in mem::take(&mut self.unwritten) {
            let Some(cached) = self.rows.get_mut(&key) else {
                continue;
            };
            let row = &cached.row;
            cached.stored = Some(match &cached.stored {
                Some(stored) => rows::update(&self.tx, stored, row)?,
                None => rows::insert(&self.tx, row)?,
            });
            for batch in mem::take(&mut cached.events) {
                let Events {
                    first,
                    attempt,
                    events,
                } = batch;
                events::insert(&self.tx, key, first, attempt, &events)?;
            }
        }
        Ok(())
    }
}

impl Change<'_> {
    /// The connection, for statements that read jobs: it writes the changed rows first, so that they see every change.
    pub(super) fn sql(&mut self) -> Result<&Connection> {
        self.write_rows()?;
        Ok(&self.tx)
    }

    /// The store that is changed.
    pub(super) fn store(&self) -> &Store {
        self.store
    }

    /// The connection, for statements on a job's data that neither read nor name rows of jobs. It does not write the
    /// changed rows first, so that the row of a job that is answered at once is written only once.
    pub(super) fn sql_beside_jobs(&self) -> &Connection {
        &self.tx
    }

    /// The record of what was found damaged.
    pub(super) fn damages(&self) -> &Damages {
        &self.store.damages
    }

    /// Makes the newest result of this input be checked again before it answers a job.
    pub(super) fn forget_checked(&self, input_hash: &str) {
        self.store.intact.inputs.remove(input_hash);
    }

    /// The memory that running jobs share.
    pub(super) fn budget(&self) -> &Arc<Budget> {
        self.store.budget()
    }

    /// The value that was read; `None`, with a note of the damage, if a record is damaged.
    pub(super) fn unless_damaged<T>(&self, read: Result<T>) -> Result<Option<T>> {
        match self.store.damages.noting(read) {
            Ok(read) => Ok(Some(read)),
            Err(StoreError::Damaged(_)) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// The value that was read of this job; `None`, with a note of the damage, if a record of the job is damaged.
    /// Damage of the database itself is an error: the change may be half done.
    pub(super) fn unless_damage_of<T>(&self, key: i64, read: Result<T>) -> Result<Option<T>> {
        match read {
            Err(error) if !error.is_damage_of(key) => Err(error),
            read => self.unless_damaged(read),
        }
    }

    /// The problem of a job. It is read on a connection beside the transaction first, since a page that cannot be read
    /// would end the transaction.
    pub(super) fn problem(&mut self, job: &Job) -> Result<String> {
        let holder = Holder::Job(job.key);
        match content::try_to_read_text(self.writer.beside(), holder, name::PROBLEM) {
            // this transaction may have written it, or mended it
            Err(error) if error.is_damage_of(job.key) => {
                content::read_text(&self.tx, holder, name::PROBLEM)
            }
            read => read.map_err(|error| error.reading(|| holder.record(name::PROBLEM))),
        }
    }

    /// Whether the result of a job that has ended is as it was written. Its content is read once, on a connection
    /// beside the transaction, since a page that cannot be read would end the transaction.
    pub(super) fn has_intact_result(&mut self, job: &Job) -> Result<bool> {
        // this transaction may have attached it
        let attached = content::all(self.sql()?, Holder::Job(job.key));
        let checked = attached.and_then(|attached| {
            let beside = self.writer.beside();
            intact::check_result(beside, &self.store.intact, job.key, attached)
        });
        Ok(self.unless_damaged(checked)?.is_some())
    }

    /// The present time, by the clock of the store.
    pub(super) fn now(&self) -> Time {
        self.store.now()
    }

    /// How often the status of a job has changed so far.
    pub(super) fn changes(&self) -> usize {
        self.changed.len()
    }

    /// The keys of the jobs whose status has changed since there were so many changes.
    pub(super) fn changed_since(&self, changes: usize) -> Vec<i64> {
        self.changed.get(changes..).unwrap_or_default().to_vec()
    }

    /// Sets a savepoint. There is one at a time: it must be released or rolled back to before the next is set.
    pub(super) fn savepoint(&mut self) -> Result<Savepoint> {
        self.sql()?.run("savepoint submission", ())?;
        Ok(Savepoint {
            changed: self.changed.len(),
            log_lines: self.log_lines.len(),
        })
    }

    /// Keeps the changes since the savepoint.
    pub(super) fn release(&mut self) -> Result<()> {
        self.sql()?.run("release submission", ())?;
        Ok(())
    }

    /// Undoes the changes since this savepoint.
    pub(super) fn roll_back_to(&mut self, savepoint: Savepoint) -> Result<()> {
        self.rows.clear();
        self.unwritten.clear();
        self.next_key = None;
        self.sql()?.run("rollback to submission", ())?;
        self.release()?;
        self.changed.truncate(savepoint.changed);
        self.log_lines.truncate(savepoint.log_lines);
        Ok(())
    }

    /// Commits: the changes are on the disk when this returns. Returns the keys of the jobs whose status has changed, or that
    /// were deleted.
    pub(super) fn commit(mut self) -> Result<Vec<i64>> {
        self.write_rows()?;
        let waiting = self.waiting()?;
        self.tx.commit()?;
        self.store.note_waiting(waiting);
        self.store.changes.note(self.noted);
        self.log_lines.iter().for_each(|(id, line)| line.log(*id));
        Ok(self.changed)
    }
}

impl LogLine {
    fn log(&self, job: JobId) {
        match self {
            LogLine::Deleted => info!(job.id = %job, "job {job} was deleted"),
            LogLine::Ended(Ended {
                owner,
                times_s,
                status,
                reason,
                detail,
            }) => {
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
