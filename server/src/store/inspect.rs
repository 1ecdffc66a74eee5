//! Checking a store that no server has open, and copying what is intact to a new one.
//!
//! It reads as the service does, one job after the other by its number, so that damage in one place does not hide what
//! lies elsewhere. Nothing is written to the store that is inspected.

use std::{collections::BTreeSet, path::Path};

use sqlx::{
    AssertSqlSafe, ConnectOptions, Connection, Row, SqliteConnection,
    sqlite::{SqliteConnectOptions, SqliteRow},
};

use super::{
    content::{self, Holder, name},
    database::{Store, Writing, compare_with_the_past},
    error::{Record, Result, StoreError},
    events,
    folder::{DATABASE, Folder, unusable},
    keys, meshes, migrations,
    progress::{self, Known},
    results::StoredResult,
    rows::find,
    salvage::{copy_content, copy_job, copy_the_rest, insert, new_store},
    sweeps, tokens,
};
use crate::{
    event::Payload,
    job::{Job, ResultAvailable},
};

/// What an inspection has found.
#[derive(Debug, Default)]
pub struct Report {
    /// Each damage, or what is missing: where, and how that was seen.
    pub findings: Vec<String>,
    /// Jobs of which at least a trace was found.
    pub jobs: u64,
    /// Those that are intact, with their problem, events and result.
    pub intact: u64,
    /// The tables cannot be read: there may be more jobs.
    pub incomplete: bool,
}

/// Jobs that are written to the new store in one transaction.
const JOBS_PER_COMMIT: u64 = 100;
/// Every number up to this is looked for, whether or not a list has it. Beyond it only those that are listed: to look for
/// all takes minutes, and the highest may have been read from a damaged record.
const MOST_NUMBERS: i64 = 10_000_000;
/// Events that are read at once.
const EVENTS_PER_READ: i64 = 1000;

/// Checks everything in the store of this folder; with `new`, which must be empty or missing, copies what is intact.
pub async fn inspect(folder: &Path, new: Option<&Path>) -> Result<Report> {
    // to lock it would create it
    match folder.join(DATABASE).try_exists() {
        Ok(true) => {}
        Ok(false) => return Err(unusable(folder, absent(folder))),
        Err(error) => return Err(unusable(folder, error)),
    }
    let _locked = Folder::lock(folder)?;
    let mut report = Report::default();
    let options = SqliteConnectOptions::new().filename(folder.join(DATABASE));
    let known = progress::read(folder)?;
    match compare_with_the_past(folder, &known, options.clone()).await {
        Ok(doubt) => report.findings.extend(doubt),
        Err(StoreError::Folder(why)) => {
            let advice = "to read a database, SQLite writes beside it: copy the folder to where that is allowed, and \
                          check the copy";
            return Err(unusable(folder, format!("{why}; {advice}")));
        }
        Err(error) => report.finding("database", &error),
    }
    let target = match new {
        Some(new) => Some(new_store(new).await?),
        None => None,
    };
    match options.read_only(true).connect().await {
        Ok(mut source) => {
            // damage to the list of steps is found below, as damage
            if let Err(error @ StoreError::Schema(_)) = migrations::are_current(&mut source).await {
                return Err(error);
            }
            let inspected = report.inspect(&mut source, target.as_ref()).await;
            source.close().await?;
            inspected?;
        }
        Err(error) => report.finding("database", &StoreError::from(error)),
    }
    if let Some(target) = target {
        target.close().await;
    }
    Ok(report)
}

/// Checks the database of a backup that is being made, which has no log. If its tables are of an earlier version, only
/// whether it can be read: what they contain is not known here.
pub(super) async fn check_copy(folder: &Path) -> Result<Vec<String>> {
    let options = SqliteConnectOptions::new().filename(folder.join(DATABASE));
    let mut copy = options.read_only(true).connect().await?;
    let mut report = Report::default();
    match migrations::are_current(&mut copy).await {
        Ok(()) => report.inspect(&mut copy, None).await?,
        Err(StoreError::Schema(_)) => report.check_pages(&mut copy).await,
        Err(error) => return Err(error),
    }
    copy.close().await?;
    Ok(report.findings)
}

/// Why there is nothing to inspect.
pub(super) fn absent(folder: &Path) -> String {
    match progress::read(folder) {
        Ok(Known::Missing) => format!("it contains no {DATABASE}"),
        _ => format!(
            "there is no {DATABASE} in it, although there was one: put it back, or restore it from a backup"
        ),
    }
}

impl Report {
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
    async fn inspect(
        &mut self,
        source: &mut SqliteConnection,
        target: Option<&Store>,
    ) -> Result<()> {
        let tables = sqlx::query("select name from sqlite_schema");
        if let Err(error) = tables.fetch_all(&mut *source).await {
            // every table would tell the same
            self.incomplete = true;
            self.finding("database", &error.into());
            return Ok(());
        }
        self.check_pages(source).await;
        let mut last = last_key(source).await;
        let listed = keys_after(source, MOST_NUMBERS).await;
        let listed = listed.unwrap_or_else(|error| {
            self.finding("jobs", &error);
            self.incomplete = true;
            vec![]
        });
        let mut writing: Option<Writing> = None;
        for key in (1..=last).chain(listed) {
            let Some(job) = self.check_job(source, key).await else {
                continue;
            };
            last = last.max(key);
            let Some(target) = target else { continue };
            let mut tx = match writing.take() {
                Some(tx) => tx,
                None => target.begin().await?,
            };
            copy_job(source, &mut tx, &job).await?;
            match self.intact % JOBS_PER_COMMIT {
                0 => tx.commit().await?,
                _ => writing = Some(tx),
            }
        }
        if let Some(tx) = writing {
            tx.commit().await?;
        }
        let mut lost = BTreeSet::new();
        for (table, check) in TABLES {
            if !self.check_table(source, target, table, check).await? {
                lost.insert(table);
            }
        }
        if let Some(target) = target
            && lost
                .iter()
                .any(|table| matches!(*table, "token" | "setting"))
        {
            // it may have been the last one: the new store lets nobody in without a token
            let mut tx = target.begin().await?;
            tokens::require_tokens(&mut tx).await?;
            tx.commit().await?;
        }
        match target {
            Some(target) => copy_the_rest(source, target, last).await,
            None => Ok(()),
        }
    }

    /// Checks the tables and indexes as such.
    async fn check_pages(&mut self, source: &mut SqliteConnection) {
        let complaints = sqlx::query_scalar("pragma integrity_check(20)");
        let complaints: sqlx::Result<Vec<String>> = complaints.fetch_all(&mut *source).await;
        match complaints {
            Ok(lines) => {
                let lines = lines.iter().filter(|line| *line != "ok");
                self.findings
                    .extend(lines.map(|line| format!("database: {line}")));
            }
            Err(error) => self.finding("database", &error.into()),
        }
    }

    /// Reads everything of a job; returns it if it is intact.
    async fn check_job(&mut self, source: &mut SqliteConnection, key: i64) -> Option<Job> {
        let job = match find(source, key).await {
            Ok(Some(job)) => job,
            Ok(None) => {
                if has_events(source, key).await && !was_deleted(source, key).await {
                    self.jobs += 1;
                    self.findings
                        .push(format!("job number {key}: record: it is missing"));
                }
                return None;
            }
            Err(error) => {
                self.jobs += 1;
                self.finding(
                    &format!("{} (number {key})", name(source, key).await),
                    &error,
                );
                return None;
            }
        };
        self.jobs += 1;
        match check_parts(source, &job).await {
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

    /// Checks the rows of a table, one after the other, and copies those that are intact, a mesh with its body; whether all are.
    async fn check_table(
        &mut self,
        source: &mut SqliteConnection,
        target: Option<&Store>,
        table: &'static str,
        check: Check,
    ) -> Result<bool> {
        let statement = AssertSqlSafe(format!("select * from {table}"));
        let rows = match sqlx::query(statement).fetch_all(&mut *source).await {
            Ok(rows) => rows,
            Err(error) => {
                self.finding(table, &error.into());
                return Ok(false);
            }
        };
        let mut whole = true;
        let mut tx = match target {
            Some(target) => Some(target.begin().await?),
            None => None,
        };
        for row in &rows {
            let checked = match (check(row), table) {
                (Ok(()), "mesh") => check_body(source, row).await,
                (checked, _) => checked,
            };
            if let Err(error) = checked {
                self.finding(table, &error);
                whole = false;
                continue;
            }
            let Some(tx) = &mut tx else { continue };
            insert(tx, table, row).await?;
            if table == "mesh" {
                copy_content(source, tx, Holder::Mesh(row.try_get("id")?)).await?;
            }
        }
        if let Some(tx) = tx {
            tx.commit().await?;
        }
        Ok(whole)
    }
}

/// What is wrong with a row.
type Check = fn(&SqliteRow) -> Result<()>;

/// What is no part of a job: tables that are checked and copied row by row, in this order.
const TABLES: [(&str, Check); 9] = [
    ("mesh", |row| meshes::described(row).map(drop)),
    // one whose owner cannot be read becomes an administrator's
    ("mesh_owner", |_| Ok(())),
    ("request_key", keys::check),
    ("sweep", |row| sweeps::intact(row, row.try_get("id")?)),
    ("sweep_member", sweeps::check_member),
    ("deleted_sweep", |_| Ok(())),
    ("deleted_job", |_| Ok(())),
    ("token", |row| tokens::read(row).map(drop)),
    ("setting", |_| Ok(())),
];

/// An error if the body of a mesh is missing or damaged.
async fn check_body(source: &mut SqliteConnection, row: &SqliteRow) -> Result<()> {
    let body = meshes::read_body(source, row.try_get("hash")?).await;
    body.map(drop)
}

/// The numbers of jobs after this one of which there is a trace, in order.
async fn keys_after(source: &mut SqliteConnection, key: i64) -> Result<Vec<i64>> {
    let keys = sqlx::query_scalar(
        "select id from job where id > ?1 union select distinct job_id from event where job_id > ?1 order by 1",
    );
    Ok(keys.bind(key).fetch_all(source).await?)
}

/// The highest number of a job up to [`MOST_NUMBERS`] that is found anywhere.
async fn last_key(source: &mut SqliteConnection) -> i64 {
    let mut last = 0;
    for statement in [
        "select seq from sqlite_sequence where name = 'job' and seq <= ?",
        "select max(id) from job where id <= ?",
        "select max(job_id) from event where job_id <= ?",
    ] {
        let found: Option<Option<i64>> = sqlx::query_scalar(statement)
            .bind(MOST_NUMBERS)
            .fetch_optional(&mut *source)
            .await
            .ok()
            .flatten();
        last = last.max(found.flatten().unwrap_or(0));
    }
    last
}

async fn exists(source: &mut SqliteConnection, statement: &'static str, key: i64) -> bool {
    let found = sqlx::query(statement).bind(key).fetch_optional(source);
    found.await.is_ok_and(|row| row.is_some())
}

async fn has_events(source: &mut SqliteConnection, key: i64) -> bool {
    exists(source, "select 1 from event where job_id = ? limit 1", key).await
}

async fn was_deleted(source: &mut SqliteConnection, key: i64) -> bool {
    exists(source, "select 1 from deleted_job where id = ?", key).await
}

/// The public id of a job with a damaged row, as far as it can be read.
async fn name(source: &mut SqliteConnection, key: i64) -> String {
    let uuid = sqlx::query_scalar("select uuid from job where id = ?").bind(key);
    let uuid: sqlx::Result<Option<String>> = uuid.fetch_optional(source).await;
    match uuid {
        Ok(Some(uuid)) => format!("job_{uuid}"),
        _ => "job".into(),
    }
}

/// An error if the problem, an event or a part of the result of a job is missing or damaged.
async fn check_parts(source: &mut SqliteConnection, job: &Job) -> Result<()> {
    let has = Holder::Job(job.key);
    content::read_text(source, has, name::PROBLEM).await?;
    if job.sweep.is_some() {
        content::read_text(source, has, name::DEFINITION).await?;
    }
    let (mut after, mut ended) = (0, false);
    loop {
        let events = events::read(source, job.key, after, EVENTS_PER_READ).await?;
        let Some(last) = events.last() else { break };
        ended = matches!(last.payload, Payload::Done { .. });
        after = last.seq;
    }
    if ended != job.status.is_terminal() {
        return Err(
            Record::of_job(job.key, "events").damaged("the last event is not the end of the job")
        );
    }
    match job.result_available {
        ResultAvailable::None => Ok(()),
        ResultAvailable::Partial | ResultAvailable::Final => {
            let missing = || Record::of_job(job.key, "result").damaged("it is missing");
            let result = StoredResult::of(source, job.key).await?;
            result.ok_or_else(missing)?.check(source).await
        }
    }
}
