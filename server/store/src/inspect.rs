//! Checks a store that no server has open, and copies its intact data to a new store.
//!
//! It reads as the service does, one job after the other by its number, so that damage in one place does not hide what
//! lies elsewhere. Nothing is written to the store that is inspected.

use std::{collections::BTreeSet, path::Path};

use base::job::Job;
use rusqlite::{Connection, Row};

use super::{
    connections::{Mode, blocking, open},
    content::{self, Holder, name},
    database::{Writer, Writing, compare_with_the_past},
    error::{Record, Result, StoreError},
    events,
    folder::{DATABASE, Folder, unusable},
    keys,
    manifest::differs_from_manifest,
    meshes, migrations,
    progress::{self, Known},
    results::StoredResult,
    rows::find,
    salvage::{StoredRow, copy_content, copy_job, copy_the_rest, new_store},
    sql::Sql,
    sweeps, tokens,
};

/// What an inspection has found.
#[derive(Debug, Default)]
pub struct Report {
    /// A text about each damaged or missing record: what it is, and how that was found.
    pub findings: Vec<String>,
    /// The number of jobs of which at least a trace was found.
    pub jobs: u64,
    /// The number of jobs that are intact, with their problem, events and result.
    pub intact: u64,
    /// Whether a table cannot be read, so that there may be more jobs.
    pub incomplete: bool,
}

/// The number of jobs that are written to the new store in one transaction.
const JOBS_PER_COMMIT: u64 = 100;
/// The highest number up to which every job is looked for, whether or not an index lists it. Of higher numbers only
/// listed ones are read: looking for all takes minutes, and the highest number may come from a damaged record.
const MOST_NUMBERS: i64 = 10_000_000;
/// The number of events that are read at once.
const EVENTS_PER_READ: i64 = 1000;

/// Checks everything in the store of `folder`. With `new`, a folder which must be empty or missing, copies the intact
/// data to a new store there.
pub async fn inspect(folder: &Path, new: Option<&Path>) -> Result<Report> {
    let folder = folder.to_owned();
    let (_locked, report, folder) = blocking(move || {
        // to lock it would create it
        match folder.join(DATABASE).try_exists() {
            Ok(true) => {}
            Ok(false) => return Err(unusable(&folder, absent(&folder))),
            Err(error) => return Err(unusable(&folder, error)),
        }
        let locked = Folder::lock(&folder)?;
        Ok((locked, Report::begin(&folder)?, folder))
    })
    .await?;
    let report = match new {
        Some(new) => {
            let target = new_store(new).await?;
            let copied = target.write(move |writer| report.complete(&folder, Some(writer)));
            let report = copied.await?;
            target.close().await;
            report
        }
        None => blocking(move || report.complete(&folder, None)).await?,
    };
    Ok(report)
}

/// Checks the database of a backup that is being made, which has no log. If its tables are of an earlier version,
/// checks only whether it can be read, since this version does not know their content. Returns a text about each
/// damaged record.
pub(super) fn check_copy(folder: &Path) -> Result<Vec<String>> {
    let copy = open(&folder.join(DATABASE), Mode::Read)?;
    let mut report = Report::default();
    match migrations::are_current(&copy) {
        Ok(()) => report.inspect(&copy, None)?,
        Err(StoreError::Schema(_)) => report.check_pages(&copy),
        Err(error) => return Err(error),
    }
    Ok(report.findings)
}

/// The error text that the folder has no store to inspect.
pub(super) fn absent(folder: &Path) -> String {
    match progress::read(folder) {
        Ok(Known::Missing) => format!("it contains no {DATABASE}"),
        _ => format!(
            "there is no {DATABASE} in it, although there was one: put it back, or restore it from a backup"
        ),
    }
}

impl Report {
    /// Begins a report with the comparison of the database with its last known commit.
    fn begin(folder: &Path) -> Result<Report> {
        let mut report = Report::default();
        match differs_from_manifest(folder) {
            Ok(found) => report.findings.extend(found),
            Err(error) => report.finding("manifest", &error),
        }
        let known = progress::read(folder)?;
        match compare_with_the_past(folder, &known, &folder.join(DATABASE)) {
            Ok(doubt) => report.findings.extend(doubt),
            Err(StoreError::Folder(why)) => {
                let advice = "to read a database, SQLite writes beside it: copy the folder to where that is allowed, and \
                              check the copy";
                return Err(unusable(folder, format!("{why}; {advice}")));
            }
            Err(error) => report.finding("database", &error),
        }
        Ok(report)
    }

    /// Adds the findings about the store in `folder` to the report, and copies intact data to `target`.
    fn complete(mut self, folder: &Path, target: Option<&Writer<'_>>) -> Result<Report> {
        match open(&folder.join(DATABASE), Mode::Read) {
            Ok(source) => {
                // else SQLite reads nothing of a file that has lost its end
                source.execute_batch("pragma writable_schema = on")?;
                // damage to the list of steps is found below, as damage
                if let Err(error @ StoreError::Schema(_)) = migrations::are_current(&source) {
                    return Err(error);
                }
                self.inspect(&source, target)?;
            }
            Err(error) => {
                self.finding("database", &error);
                lock_out(target)?;
            }
        }
        Ok(self)
    }

    fn finding(&mut self, what: &str, error: &StoreError) {
        let text = match error {
            StoreError::Damaged(damage) if damage.record.name == what => damage.cause.clone(),
            StoreError::Damaged(damage) => format!("{}: {}", damage.record.name, damage.cause),
            other => other.to_string(),
        };
        let finding = format!("{what}: {text}");
        // what made the comparison with the past fail may be met again
        if !self.findings.contains(&finding) {
            self.findings.push(finding);
        }
    }

    /// Checks one table after the other; an error only if the new store cannot be written.
    fn inspect(&mut self, source: &Connection, target: Option<&Writer<'_>>) -> Result<()> {
        let differing = match migrations::differing(source) {
            Ok(differing) => differing,
            Err(error) => {
                // every table would tell the same
                self.incomplete = true;
                self.finding("database", &error);
                return lock_out(target);
            }
        };
        let definitions = differing.iter();
        self.findings.extend(
            definitions.map(|name| format!("database: {name} is missing, or defined differently")),
        );
        // what reads jobs relies on the names of columns, and on indexes
        let of_jobs = |name: &&String| TABLES.iter().all(|(table, _)| table != name);
        if differing.iter().any(|name| of_jobs(&name)) {
            self.incomplete = true;
            return lock_out(target);
        }
        self.check_pages(source);
        let mut last = last_key(source);
        let listed = keys_after(source, MOST_NUMBERS).unwrap_or_else(|error| {
            self.finding("jobs", &error);
            self.incomplete = true;
            vec![]
        });
        let mut writing: Option<Writing<'_>> = None;
        for key in (1..=last).chain(listed) {
            let Some(job) = self.check_job(source, key) else {
                continue;
            };
            last = last.max(key);
            let Some(target) = target else { continue };
            let tx = match writing.take() {
                Some(tx) => tx,
                None => target.begin()?,
            };
            copy_job(source, &tx, &job)?;
            match self.intact % JOBS_PER_COMMIT {
                0 => tx.commit()?,
                _ => writing = Some(tx),
            }
        }
        if let Some(tx) = writing {
            tx.commit()?;
        }
        let mut lost = BTreeSet::new();
        for (table, check) in TABLES {
            let differs = differing.iter().any(|name| name == table);
            if differs || !self.check_table(source, target, table, check)? {
                lost.insert(table);
            }
        }
        if lost
            .iter()
            .any(|table| matches!(*table, "token" | "setting"))
        {
            lock_out(target)?;
        }
        match target {
            Some(target) => copy_the_rest(source, target, last),
            None => Ok(()),
        }
    }

    /// Checks the structure of tables and indexes.
    fn check_pages(&mut self, source: &Connection) {
        match source.values::<String>("pragma integrity_check(20)", ()) {
            Ok(lines) => {
                let lines = lines.iter().filter(|line| *line != "ok");
                self.findings
                    .extend(lines.map(|line| format!("database: {line}")));
            }
            Err(error) => self.finding("database", &error),
        }
    }

    /// Reads all data of a job; returns the job if all of them are intact.
    fn check_job(&mut self, source: &Connection, key: i64) -> Option<Job> {
        let job = match find(source, key) {
            Ok(Some(job)) => job,
            Ok(None) => {
                if has_events(source, key) && !was_deleted(source, key) {
                    self.jobs += 1;
                    self.findings
                        .push(format!("job number {key}: record: it is missing"));
                }
                return None;
            }
            Err(error) => {
                self.jobs += 1;
                self.finding(&format!("{} (number {key})", name(source, key)), &error);
                return None;
            }
        };
        self.jobs += 1;
        match check_parts(source, &job) {
            Ok(()) => {
                self.intact += 1;
                Some(job)
            }
            Err(error) => {
                self.finding(&job.id.to_string(), &error);
                None
            }
        }
    }

    /// Checks the rows of a table, one after the other, and copies the intact ones, meshes with their content. Returns
    /// whether all rows are intact.
    fn check_table(
        &mut self,
        source: &Connection,
        target: Option<&Writer<'_>>,
        table: &'static str,
        check: Check,
    ) -> Result<bool> {
        let checked = |row: &Row<'_>| check(source, row).and_then(|()| StoredRow::read(row));
        let statement = format!("select * from {table}");
        let rows = match source.rows(&statement, (), |row| Ok(checked(row))) {
            Ok(rows) => rows,
            Err(error) => {
                self.finding(table, &error);
                return Ok(false);
            }
        };
        let mut whole = true;
        let tx = target.map(Writer::begin).transpose()?;
        for row in rows {
            let row = match row {
                Ok(row) => row,
                Err(error) => {
                    self.finding(table, &error);
                    whole = false;
                    continue;
                }
            };
            let Some(tx) = &tx else { continue };
            row.insert(tx, table)?;
            if let ("mesh", Some(key)) = (table, row.id()) {
                copy_content(source, tx, Holder::Mesh(key))?;
            }
        }
        if let Some(tx) = tx {
            tx.commit()?;
        }
        Ok(whole)
    }
}

/// Lets nobody into the new store without a token: the one that was lost may have been the last.
fn lock_out(target: Option<&Writer<'_>>) -> Result<()> {
    let Some(target) = target else { return Ok(()) };
    let tx = target.begin()?;
    tokens::require_tokens(&tx)?;
    tx.commit()
}

/// A function that returns an error if a row is damaged.
type Check = fn(&Connection, &Row<'_>) -> Result<()>;

/// Tables with data that belong to no job: they are checked and copied row by row, in this order.
const TABLES: [(&str, Check); 9] = [
    ("mesh", check_mesh),
    // one whose owner cannot be read becomes an administrator's
    ("mesh_owner", |_, _| Ok(())),
    ("request_key", |_, row| keys::check(row)),
    ("sweep", |_, row| sweeps::intact(row, row.get("id")?)),
    ("sweep_member", |_, row| sweeps::check_member(row)),
    ("deleted_sweep", |_, _| Ok(())),
    ("deleted_job", |_, _| Ok(())),
    ("token", |_, row| tokens::read(row).map(drop)),
    ("setting", |_, _| Ok(())),
];

/// An error if a mesh is damaged, or its body is missing or damaged.
fn check_mesh(source: &Connection, row: &Row<'_>) -> Result<()> {
    meshes::described(row)?;
    let hash: String = row.get("hash")?;
    meshes::read_body(source, &hash).map(drop)
}

/// The numbers greater than `key` of jobs that have a row or an event, in order.
fn keys_after(source: &Connection, key: i64) -> Result<Vec<i64>> {
    source.values(
        "select id from job where id > ?1 union select distinct job_id from event where job_id > ?1 order by 1",
        [key],
    )
}

/// The highest number of a job, up to [`MOST_NUMBERS`], that the database contains in any place.
fn last_key(source: &Connection) -> i64 {
    let mut last = 0;
    for statement in [
        "select seq from sqlite_sequence where name = 'job' and seq <= ?",
        "select max(id) from job where id <= ?",
        "select max(job_id) from event where job_id <= ?",
    ] {
        let found = source.optional_value::<Option<i64>>(statement, [MOST_NUMBERS]);
        last = last.max(found.ok().flatten().flatten().unwrap_or(0));
    }
    last
}

fn exists(source: &Connection, statement: &str, key: i64) -> bool {
    let found = source.row(statement, [key], |_| Ok(()));
    found.is_ok_and(|row| row.is_some())
}

fn has_events(source: &Connection, key: i64) -> bool {
    exists(source, "select 1 from event where job_id = ? limit 1", key)
}

fn was_deleted(source: &Connection, key: i64) -> bool {
    exists(source, "select 1 from deleted_job where id = ?", key)
}

/// The public id of a job with a damaged row, as far as it can be read.
fn name(source: &Connection, key: i64) -> String {
    match source.optional_value::<String>("select uuid from job where id = ?", [key]) {
        Ok(Some(uuid)) => format!("job_{uuid}"),
        _ => "job".into(),
    }
}

/// An error if the problem, an event or a part of the result of a job is missing or damaged.
fn check_parts(source: &Connection, job: &Job) -> Result<()> {
    let has = Holder::Job(job.key);
    content::read_text(source, has, name::PROBLEM)?;
    if job.sweep.is_some() {
        content::read_text(source, has, name::DEFINITION)?;
    }
    let (mut after, mut ended) = (0, false);
    loop {
        let events = events::read(source, job.key, after, EVENTS_PER_READ)?;
        let Some(last) = events.last() else { break };
        for event in &events {
            let readable = event.read().map(|_| ());
            readable.map_err(|error| events::record(job.key, event.seq).damaged(error))?;
        }
        ended = last.is_done();
        after = last.seq;
    }
    if ended != job.status.is_terminal() {
        return Err(
            Record::of_job(job.key, "events").damaged("the last event is not the end of the job")
        );
    }
    let result = StoredResult::of(source, job.key)?;
    result.map_or(Ok(()), |result| result.check(source))
}
