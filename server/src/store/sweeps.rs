//! Sweeps, and the rows of their members.

use std::collections::BTreeMap;

use files::sweep::MOST_VALUE_BYTES;
use futures_util::TryStreamExt;
use serde::{Deserialize, Serialize};
use sqlx::{Row, SqliteConnection, sqlite::SqliteRow};
use uuid::Uuid;

use super::{
    change::Change,
    checksum::{self, Checksum},
    content::{self, Holder, NewContent, name},
    damage::Table,
    database::Store,
    entries::{Entries, bytes_of},
    error::{Record, Result, StoreError},
    rows::is_current,
    submission::NewSweep,
};
use crate::{
    address::link,
    caller::Owners,
    job::{Job, Reason, Status, SweepId},
    sweep::{MemberCounts, MemberRow, Sweep},
    time::Time,
};

/// What a job of a sweep has to solve.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MembersTask {
    /// The definition of the sweep.
    pub definition: String,
    /// The first member of the job: its problem is that of the job.
    pub first: usize,
    /// All members of the job, in order.
    pub group: Vec<usize>,
    /// The members without a row.
    pub numbers: Vec<usize>,
}

/// Members of a sweep that have ended, each with the number and time of its event.
#[derive(Debug)]
pub struct MemberEvents {
    /// The sweep after them.
    pub sweep: Sweep,
    /// In order; some at a time.
    pub events: Vec<(i64, Time, MemberRow)>,
    /// There may be more after these.
    pub more: bool,
    /// The number of the last one that there is.
    pub last: i64,
}

impl Store {
    /// The sweep with this public id.
    pub async fn sweep(&self, owners: Owners<'_>, id: SweepId) -> Result<Option<Sweep>> {
        let read = async {
            let mut connection = self.reader.acquire().await?;
            let found = with_id(&mut connection, owners, id).await?;
            // what a sweep is doing its jobs tell
            let needed = found.as_ref().map_or(Table::Sweeps, |_| Table::Jobs);
            self.damages.have_all(&[needed])?;
            Ok(found)
        };
        self.damages.noting(read).await
    }

    /// Sweeps that were accepted before the one with key `before`, newest first.
    pub async fn sweeps(
        &self,
        owners: Owners<'_>,
        before: Option<i64>,
        limit: i64,
    ) -> Result<Entries<Sweep>> {
        let read = async {
            let mut connection = self.lists.acquire().await?;
            let rows = match owners {
                Owners::All => {
                    sqlx::query_scalar("select id from sweep where id < ? order by id desc limit ?")
                        .bind(before.unwrap_or(i64::MAX))
                        .bind(limit)
                }
                Owners::Only(owner) => sqlx::query_scalar(
                    "select id from sweep where owner = ? and id < ? order by id desc limit ?",
                )
                .bind(owner)
                .bind(before.unwrap_or(i64::MAX))
                .bind(limit),
            };
            let keys: Vec<i64> = rows.fetch_all(&mut *connection).await?;
            let mut sweeps = Entries::default();
            for key in keys {
                let Some(sweep) = find(&mut connection, key).await? else {
                    continue; // deleted a moment ago
                };
                let paths: usize = sweep.paths.iter().map(String::len).sum();
                let bytes = bytes_of(&sweep.labels) + paths;
                if sweeps.add(sweep, bytes).is_break() {
                    break;
                }
            }
            self.damages.have_all(&[Table::Sweeps, Table::Jobs])?;
            Ok(sweeps)
        };
        self.damages.noting(read).await
    }

    /// Whether a sweep of these owners with this public id was deleted recently.
    pub async fn sweep_was_deleted(&self, owners: Owners<'_>, id: SweepId) -> Result<bool> {
        let owner: Option<String> =
            sqlx::query_scalar("select owner from deleted_sweep where uuid = ?")
                .bind(id.0.to_string())
                .fetch_optional(&self.reader)
                .await?;
        if owner.is_none() {
            self.damages.have_all(&[Table::Deleted])?;
        }
        Ok(owner.is_some_and(|owner| owners.include(&owner)))
    }

    /// The definition of a sweep as JSON.
    pub async fn sweep_definition(&self, key: i64) -> Result<Option<String>> {
        let read = async {
            let mut tx = self.reader.begin().await?;
            match some_job(&mut tx, key).await? {
                Some(job) => content::read_text(&mut tx, Holder::Job(job), name::DEFINITION)
                    .await
                    .map(Some),
                None => Ok(None),
            }
        };
        self.damages.noting(read).await
    }

    /// At most `limit` members from this number on, in order; without their parameters.
    pub async fn members(&self, key: i64, from: i64, limit: i64) -> Result<Vec<MemberRow>> {
        let read = async {
            let mut rows = sqlx::query(
                "select sweep_member.*, job.status as job_status, job.reason as job_reason
                 from sweep_member left join job on job.id = sweep_member.job
                 where sweep_member.sweep = ? and number >= ? order by number limit ?",
            )
            .bind(key)
            .bind(from)
            .bind(limit)
            .fetch(&self.lists);
            // one at a time: as text they take several times as much
            let mut members = vec![];
            while let Some(row) = rows.try_next().await? {
                let number: i64 = row.try_get("number")?;
                if number != from + members.len() as i64 {
                    return Err(record(key, "members").damaged("some are missing"));
                }
                members.push(member(&row)?);
            }
            drop(rows);
            let end = from + members.len() as i64;
            if (members.len() as i64) < limit {
                let total = sqlx::query_scalar("select members from sweep where id = ?").bind(key);
                let total: Option<i64> = total.fetch_optional(&self.lists).await?;
                if total.is_some_and(|total| end.max(from) < total) {
                    return Err(record(key, "members").damaged("some are missing"));
                }
            }
            Ok(members)
        };
        self.damages.noting(read).await
    }

    /// About the memory (bytes) that all members of a sweep take as rows and as a table, overestimated rather than
    /// underestimated.
    pub async fn members_memory(&self, key: i64) -> Result<usize> {
        const OF_ROW: i64 = 1500;
        const OF_BODY: i64 = 3;
        const OF_VALUES: i64 = 5;
        let (members, bodies): (i64, i64) = sqlx::query_as(
            "select count(*), coalesce(sum(octet_length(body)), 0) from sweep_member where sweep = ?",
        )
        .bind(key)
        .fetch_one(&self.lists)
        .await?;
        let definition: Option<i64> = sqlx::query_scalar(
            "select bytes from sweep_member join attachment on kind = 'job' and key = job and name = 'definition'
             join content on content.id = content where sweep = ? limit 1",
        )
        .bind(key)
        .fetch_optional(&self.lists)
        .await?;
        let definition = definition.unwrap_or_default();
        // of a grid each value is many members'
        let values = definition
            .saturating_mul(members)
            .min(MOST_VALUE_BYTES as i64);
        let bytes = OF_ROW * members + OF_BODY * bodies + OF_VALUES * (definition + values);
        Ok(usize::try_from(bytes).unwrap_or(usize::MAX))
    }

    /// Members that have ended, after event number `after`; `None`: the sweep was deleted.
    pub async fn member_events(
        &self,
        key: i64,
        after: i64,
        limit: i64,
    ) -> Result<Option<MemberEvents>> {
        let read = async {
            let mut tx = self.reader.begin().await?;
            // at one moment: if the sweep has ended, all its events are there
            let Some(sweep) = find(&mut tx, key).await? else {
                return Ok(None);
            };
            self.damages.have_all(&[Table::Jobs])?;
            let rows = sqlx::query(
                "select *, null as job_status, null as job_reason from sweep_member
                 where sweep = ? and seq > ? order by seq limit ?",
            )
            .bind(key)
            .bind(after)
            .bind(limit)
            .fetch_all(&mut *tx)
            .await?;
            let mut events = vec![];
            for (expected, row) in (after.saturating_add(1)..).zip(&rows) {
                let seq: i64 = row.try_get("seq")?;
                if seq != expected {
                    return Err(record(key, "events").damaged("some are missing"));
                }
                events.push((seq, Time::from_micros(row.try_get("t")?), member(row)?));
            }
            let more = events.len() as i64 >= limit;
            let last = sqlx::query_scalar("select last_seq from sweep where id = ?");
            let last: i64 = last.bind(key).fetch_one(&mut *tx).await?;
            if !more && after.saturating_add(events.len() as i64) < last {
                return Err(record(key, "events").damaged("some are missing"));
            }
            Ok(Some(MemberEvents {
                sweep,
                events,
                more,
                last,
            }))
        };
        self.damages.noting(read).await
    }

    /// How many members have a row.
    pub async fn last_member_event(&self, key: i64) -> Result<i64> {
        let last = sqlx::query_scalar("select last_seq from sweep where id = ?")
            .bind(key)
            .fetch_optional(&self.reader);
        Ok(last.await?.unwrap_or(0))
    }

    /// What a job of a sweep has to solve.
    pub async fn members_task(&self, job: i64) -> Result<Option<MembersTask>> {
        let read = async {
            let mut tx = self.reader.begin().await?;
            let members: Vec<(i64, Option<i64>)> = sqlx::query_as(
                "select number, seq from sweep_member where job = ? order by number",
            )
            .bind(job)
            .fetch_all(&mut *tx)
            .await?;
            let Some((first, _)) = members.first() else {
                return Ok(None);
            };
            let left = members.iter().filter(|(_, seq)| seq.is_none());
            Ok(Some(MembersTask {
                definition: content::read_text(&mut tx, Holder::Job(job), name::DEFINITION).await?,
                first: number(*first),
                group: members.iter().map(|(n, _)| number(*n)).collect(),
                numbers: left.map(|(n, _)| number(*n)).collect(),
            }))
        };
        self.damages.noting(read).await
    }

    /// The member that a job's own problem is, and the job that solves a member: by their keys.
    pub async fn some_job_of(&self, key: i64) -> Result<Option<i64>> {
        let read = async {
            let mut tx = self.reader.begin().await?;
            some_job(&mut tx, key).await
        };
        self.damages.noting(read).await
    }

    /// Stores the rows of members that an attempt of a job has solved; returns their sweep, and `None` when the attempt
    /// is no longer the current one.
    pub async fn record_members(
        &self,
        job: i64,
        attempt: i32,
        rows: &[(Time, MemberRow)],
    ) -> Result<Option<i64>> {
        let write = async {
            let mut tx = self.begin().await?;
            if !is_current(&mut tx, job, attempt).await? {
                return Ok(None);
            }
            let sweep: Option<i64> =
                sqlx::query_scalar("select sweep from sweep_member where job = ? limit 1")
                    .bind(job)
                    .fetch_optional(&mut *tx)
                    .await?;
            let Some(sweep) = sweep else { return Ok(None) };
            // read whole, so that a damaged row is not given a new checksum below
            let Some(mut last) = row_of(&mut tx, sweep).await? else {
                return Ok(None);
            };
            let (mut succeeded, mut failed) = (0, 0);
            for (t, row) in rows {
                let t = self.by_our_clock(*t);
                let status = <&str>::from(row.status);
                let (n, body) = (i64::from(row.number), serde_json::to_string(row)?);
                let seq = last + 1;
                let ended = Ended {
                    status,
                    event: Some((seq, t.micros())),
                    body: &body,
                };
                let sum = sum(sweep, n, job, Some(ended)).stored();
                let done = sqlx::query(
                    "update sweep_member set status = ?, seq = ?, t = ?, body = ?, checksum = ?
                     where sweep = ? and number = ? and job = ? and seq is null",
                )
                .bind(status)
                .bind(seq)
                .bind(t.micros())
                .bind(body)
                .bind(sum)
                .bind(sweep)
                .bind(n)
                .bind(job)
                .execute(&mut *tx)
                .await?;
                if done.rows_affected() == 0 {
                    continue; // it has a row of an earlier attempt
                }
                last = seq;
                match row.status {
                    Status::Succeeded => succeeded += 1,
                    _ => failed += 1,
                }
            }
            sqlx::query(
                "update sweep set last_seq = ?, succeeded = succeeded + ?, failed = failed + ? where id = ?",
            )
            .bind(last)
            .bind(succeeded)
            .bind(failed)
            .bind(sweep)
            .execute(&mut *tx)
            .await?;
            checksum::seal(&mut tx, "sweep", "id", sweep).await?;
            tx.commit().await?;
            Ok(Some(sweep))
        };
        self.writing(write).await
    }

    /// Deletes a sweep whose jobs were deleted before; false if it has jobs, which may still run.
    pub async fn delete_sweep(&self, key: i64) -> Result<bool> {
        self.control(|| self.try_to_delete_sweep(key)).await
    }

    async fn try_to_delete_sweep(&self, key: i64) -> Result<bool> {
        let mut change = self.control_change().await?;
        let deleted = delete(&mut change, key).await?;
        if deleted {
            change.commit().await?;
        }
        Ok(deleted)
    }
}

/// Inserts a sweep; returns its key.
pub(super) async fn insert(change: &mut Change<'_>, owner: &str, new: &NewSweep) -> Result<i64> {
    let now = change.now();
    let members: usize = new.groups.iter().map(Vec::len).sum();
    let tx = change.sql().await?;
    let key: i64 = sqlx::query_scalar(
        "insert into sweep (uuid, owner, name, labels, paths, created_at, members) values (?, ?, ?, ?, ?, ?, ?) returning id",
    )
    .bind(new.id.0.to_string())
    .bind(owner)
    .bind(&new.name)
    .bind(serde_json::to_string(&new.labels)?)
    .bind(serde_json::to_string(&new.paths)?)
    .bind(now.micros())
    .bind(members as i64)
    .fetch_one(&mut *tx)
    .await?;
    checksum::seal(tx, "sweep", "id", key).await?;
    Ok(key)
}

/// Attaches the definition of its sweep to a job, so that it is kept as long as one of its jobs. With the first of them it is written.
pub(super) async fn attach_definition(
    tx: &mut SqliteConnection,
    job: i64,
    definition: &NewContent<'_>,
    is_first: bool,
) -> Result<()> {
    let (job, what) = (Holder::Job(job), name::DEFINITION);
    if !is_first && content::attach_written(tx, job, what, &definition.fingerprint).await? {
        return Ok(());
    }
    content::attach(tx, job, what, definition).await
}

/// Inserts members of a sweep that a job is to solve.
pub(super) async fn insert_members(
    tx: &mut SqliteConnection,
    sweep: i64,
    job: i64,
    members: &[usize],
) -> Result<()> {
    for number in members {
        let number = *number as i64;
        sqlx::query("insert into sweep_member (sweep, number, job, checksum) values (?, ?, ?, ?)")
            .bind(sweep)
            .bind(number)
            .bind(job)
            .bind(sum(sweep, number, job, None).stored())
            .execute(&mut *tx)
            .await?;
    }
    Ok(())
}

/// Deletes a sweep; false if it has jobs.
async fn delete(change: &mut Change<'_>, key: i64) -> Result<bool> {
    let now = change.now().micros();
    let tx = change.sql().await?;
    let left: bool = sqlx::query_scalar(
        "select exists (select 1 from job join sweep on sweep.uuid = job.sweep where sweep.id = ?)",
    )
    .bind(key)
    .fetch_one(&mut *tx)
    .await?;
    if left {
        return Ok(false);
    }
    sqlx::query("insert into deleted_sweep select uuid, owner, ? from sweep where id = ?")
        .bind(now)
        .bind(key)
        .execute(&mut *tx)
        .await?;
    for statement in [
        "delete from sweep_member where sweep = ?",
        "delete from sweep where id = ?",
    ] {
        sqlx::query(statement).bind(key).execute(&mut *tx).await?;
    }
    Ok(true)
}

/// Deletes a sweep with the last of its jobs; false if there are others.
pub(super) async fn remove_without_jobs(change: &mut Change<'_>, id: SweepId) -> Result<bool> {
    let key: Option<i64> = sqlx::query_scalar("select id from sweep where uuid = ?")
        .bind(id.0.to_string())
        .fetch_optional(change.sql().await?)
        .await?;
    match key {
        Some(key) => delete(change, key).await,
        None => Ok(true),
    }
}

/// Stores how the members ended that a job has not solved, before it is forgotten: those of one that failed have failed.
pub(super) async fn keep_failures(tx: &mut SqliteConnection, deleted: &Job) -> Result<()> {
    if deleted.status != Status::Failed {
        return Ok(()); // without a job they count as canceled
    }
    let unsolved: Vec<(i64, i64)> = sqlx::query_as(
        "select sweep, number from sweep_member where job = ? and seq is null and body is null",
    )
    .bind(deleted.key)
    .fetch_all(&mut *tx)
    .await?;
    let status = <&str>::from(deleted.status);
    for (sweep, n) in unsolved {
        let row = MemberRow::unsolved(number(n), deleted.status, deleted.reason);
        let body = serde_json::to_string(&row)?;
        let ended = Ended {
            status,
            event: None,
            body: &body,
        };
        sqlx::query(
            "update sweep_member set status = ?, body = ?, checksum = ? where sweep = ? and number = ?",
        )
        .bind(status)
        .bind(&body)
        .bind(sum(sweep, n, deleted.key, Some(ended)).stored())
        .bind(sweep)
        .bind(n)
        .execute(&mut *tx)
        .await?;
    }
    Ok(())
}

/// Removes the ids of sweeps that were deleted long ago.
pub(super) async fn forget_deleted(tx: &mut SqliteConnection, before: i64) -> Result<()> {
    sqlx::query("delete from deleted_sweep where deleted_at < ?")
        .bind(before)
        .execute(tx)
        .await?;
    Ok(())
}

/// An error if a row of a member is not as it was written.
pub(super) fn check_member(row: &SqliteRow) -> Result<()> {
    checked(row).map(|_| ())
}

/// Some job of a sweep, which has its definition; `None`: the sweep was deleted.
async fn some_job(connection: &mut SqliteConnection, key: i64) -> Result<Option<i64>> {
    let row = sqlx::query("select * from sweep where id = ?")
        .bind(key)
        .fetch_optional(&mut *connection)
        .await?;
    let Some(row) = row else { return Ok(None) };
    intact(&row, key)?;
    let job =
        sqlx::query_scalar("select id from job indexed by job_by_sweep where sweep = ? limit 1");
    let job = job.bind(row.try_get::<&str, _>("uuid")?);
    let job = job.fetch_optional(connection).await?;
    // a sweep goes with its last job
    job.map_or_else(|| Err(Table::Jobs.damaged("")), |job| Ok(Some(job)))
}

fn record(key: i64, what: &str) -> Record {
    Record::named(format!("{what} of sweep number {key}"))
}

fn number(number: i64) -> usize {
    usize::try_from(number).unwrap_or_default()
}

/// What is stored of a member that has ended.
struct Ended<'a> {
    status: &'a str,
    /// Number and time of its event, if it was solved.
    event: Option<(i64, i64)>,
    body: &'a str,
}

fn sum(sweep: i64, number: i64, job: i64, ended: Option<Ended<'_>>) -> Checksum {
    let sum = Checksum::new().int(sweep).int(number).int(job);
    let Some(Ended {
        status,
        event,
        body,
    }) = ended
    else {
        return sum;
    };
    let sum = sum.text(status);
    match event {
        Some((seq, t)) => sum.int(seq).int(t).text(body),
        None => sum.text(body),
    }
}

/// Key, number and body of a member, if the row is as it was written.
fn checked(row: &SqliteRow) -> Result<(i64, i64, Option<&str>)> {
    let (sweep, number, job) = (
        row.try_get("sweep")?,
        row.try_get("number")?,
        row.try_get("job")?,
    );
    let body: Option<&str> = row.try_get("body")?;
    let event: (Option<i64>, Option<i64>) = (row.try_get("seq")?, row.try_get("t")?);
    let ended = match body {
        Some(body) => Some(Ended {
            status: row.try_get("status")?,
            event: event.0.zip(event.1),
            body,
        }),
        None => None,
    };
    let what = || record(sweep, &format!("member {number}"));
    sum(sweep, number, job, ended).verify(row.try_get("checksum")?, what)?;
    Ok((sweep, number, body))
}

/// A member with its own row, or by the status of its job.
fn member(row: &SqliteRow) -> Result<MemberRow> {
    let (sweep, n, body) = checked(row)?;
    if let Some(body) = body {
        let read = serde_json::from_str(body).map(MemberRow::tidied);
        return read.map_err(|error| record(sweep, &format!("member {n}")).damaged(error));
    }
    let status: Option<&str> = row.try_get("job_status")?;
    let reason: Option<&str> = row.try_get("job_reason")?;
    // its job was deleted
    let status = status.and_then(|word| word.parse().ok());
    let status = status.unwrap_or(Status::Canceled);
    let reason: Option<Reason> = reason.and_then(|word| word.parse().ok());
    Ok(MemberRow::unsolved(number(n), status, reason))
}

/// The number of the last event of a sweep, if its row is as it was written.
async fn row_of(tx: &mut SqliteConnection, key: i64) -> Result<Option<i64>> {
    let row = sqlx::query("select * from sweep where id = ?")
        .bind(key)
        .fetch_optional(tx)
        .await?;
    let Some(row) = row else { return Ok(None) };
    intact(&row, key)?;
    Ok(Some(row.try_get("last_seq")?))
}

/// An error if the row of a sweep is not as it was written.
pub(super) fn intact(row: &SqliteRow, key: i64) -> Result<()> {
    match checksum::row_is_intact(row)? {
        true => Ok(()),
        false => Err(record(key, "record").damaged("its checksum does not match its content")),
    }
}

async fn with_id(
    connection: &mut SqliteConnection,
    owners: Owners<'_>,
    id: SweepId,
) -> Result<Option<Sweep>> {
    let row = sqlx::query("select * from sweep where uuid = ?")
        .bind(id.0.to_string())
        .fetch_optional(&mut *connection)
        .await?;
    let Some(row) = row else { return Ok(None) };
    let sweep = described(connection, &row).await?;
    Ok(Some(sweep).filter(|sweep| owners.include(&sweep.owner)))
}

async fn find(connection: &mut SqliteConnection, key: i64) -> Result<Option<Sweep>> {
    let row = sqlx::query("select * from sweep where id = ?")
        .bind(key)
        .fetch_optional(&mut *connection)
        .await?;
    match row {
        Some(row) => described(connection, &row).await.map(Some),
        None => Ok(None),
    }
}

/// A row of the table as a sweep, with what its jobs say.
async fn described(connection: &mut SqliteConnection, row: &SqliteRow) -> Result<Sweep> {
    let key: i64 = row.try_get("id")?;
    intact(row, key)?;
    let uuid: &str = row.try_get("uuid")?;
    let id = Uuid::try_parse(uuid).map_err(|error| record(key, "record").damaged(error))?;
    let id = SweepId(id);
    let (mut jobs, mut queued, mut running, mut versions, mut finished) = (0, 0, 0, 0, None);
    let of_jobs: Vec<(String, i64, i64, Option<i64>)> = sqlx::query_as(
        "select status, count(*), sum(version), max(finished_at) from job indexed by job_by_sweep
         where sweep = ? group by status",
    )
    .bind(uuid)
    .fetch_all(&mut *connection)
    .await?;
    for (status, count, version, finished_at) in of_jobs {
        jobs += count;
        versions += version;
        finished = finished.max(finished_at);
        match status.parse() {
            Ok(Status::Queued) => queued += count,
            Ok(Status::Running) => running += count,
            _ => {}
        }
    }
    let count = |name: &str| -> Result<u32> {
        let count: i64 = row.try_get(name)?;
        Ok(u32::try_from(count).unwrap_or_default())
    };
    let last: i64 = row.try_get("last_seq")?;
    let mut members = MemberCounts {
        total: count("members")?,
        succeeded: count("succeeded")?,
        failed: count("failed")?,
        ..MemberCounts::default()
    };
    if last < i64::from(members.total) {
        let unsolved: Vec<(Option<String>, i64)> = sqlx::query_as(
            "select coalesce(job.status, sweep_member.status), count(*)
             from sweep_member left join job on job.id = sweep_member.job
             where sweep_member.sweep = ? and seq is null group by 1",
        )
        .bind(key)
        .fetch_all(&mut *connection)
        .await?;
        for (status, count) in unsolved {
            let count = u32::try_from(count).unwrap_or_default();
            match status.and_then(|word| word.parse().ok()) {
                Some(Status::Queued) => members.queued += count,
                Some(Status::Running) => members.running += count,
                Some(Status::Failed) => members.failed += count,
                Some(Status::Succeeded | Status::Canceled) | None => members.canceled += count,
            }
        }
    }
    let active = queued + running > 0;
    let status = match (running, queued) {
        (1.., _) => Status::Running,
        (0, 1..) if queued < jobs || last > 0 => Status::Running,
        (0, 1..) => Status::Queued,
        _ if members.canceled > 0 => Status::Canceled,
        _ if members.succeeded > 0 => Status::Succeeded,
        _ => Status::Failed,
    };
    let damaged = |error: serde_json::Error| -> StoreError { record(key, "record").damaged(error) };
    let finished = finished.filter(|_| !active);
    Ok(Sweep {
        key,
        id,
        status,
        version: format!("{last}.{versions}"),
        name: row.try_get("name")?,
        labels: serde_json::from_str(row.try_get("labels")?).map_err(damaged)?,
        owner: row.try_get("owner")?,
        created_at: Time::from_micros(row.try_get("created_at")?),
        finished_at: finished.map(Time::from_micros),
        paths: serde_json::from_str(row.try_get("paths")?).map_err(damaged)?,
        members,
        jobs: u32::try_from(jobs).unwrap_or_default(),
        links: links(id),
    })
}

fn links(id: SweepId) -> BTreeMap<String, String> {
    let verbs = ["results", "events", "cancel"];
    let below = verbs.map(|verb| (verb.to_owned(), link(&format!("/v1/sweeps/{id}/{verb}"))));
    let others = [
        ("self".to_owned(), link(&format!("/v1/sweeps/{id}"))),
        ("jobs".to_owned(), link(&format!("/v1/jobs?sweep={id}"))),
    ];
    below.into_iter().chain(others).collect()
}
