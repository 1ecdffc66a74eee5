//! Stores sweeps, and the rows of their members.

use std::{collections::BTreeMap, sync::Arc};

use base::{
    address::link,
    caller::Owners,
    job::{Job, Reason, Status, SweepId},
    sweep::{MemberCounts, MemberRow, Sweep},
    time::Time,
};
use files::sweep::MOST_VALUE_BYTES;
use rusqlite::{Connection, Row, params};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::{
    change::Change,
    changes::Changed,
    checksum::{self, Checksum},
    content::{self, Holder, NewContent, name},
    damage::Table,
    database::{Store, Writer},
    entries::{Entries, bytes_of},
    error::{Record, Result, StoreError},
    rows::is_current,
    sql::{Sql, optional_text, text},
    submission::NewSweep,
};

/// The members of a sweep that a job has to solve.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MembersTask {
    /// The definition of the sweep.
    pub definition: String,
    /// The number of the job's first member.
    pub first: usize,
    /// The numbers of all members of the job, in order.
    pub group: Vec<usize>,
    /// The numbers of the job's members that have no row yet.
    pub numbers: Vec<usize>,
}

/// Events of members that have ended.
#[derive(Debug)]
pub struct MemberEvents {
    /// The sweep at the moment when the events were read.
    pub sweep: Sweep,
    /// The number, time and row of each event, in order.
    pub events: Vec<(i64, Time, MemberRow)>,
    /// Whether further events may follow.
    pub more: bool,
    /// The number of the last event that the sweep has.
    pub last: i64,
}

impl Store {
    /// The sweep with this public id.
    pub async fn sweep(self: &Arc<Self>, owners: Owners, id: SweepId) -> Result<Option<Sweep>> {
        self.read(move |store, connection| {
            let found = with_id(connection, &owners, id)?;
            // what a sweep is doing its jobs tell
            let needed = found.as_ref().map_or(Table::Sweeps, |_| Table::Jobs);
            store.damages.have_all(&[needed])?;
            Ok(found)
        })
        .await
    }

    /// Sweeps that were accepted before the one with key `before`, newest first.
    pub async fn sweeps(
        self: &Arc<Self>,
        owners: Owners,
        before: Option<i64>,
        limit: i64,
    ) -> Result<Entries<Sweep>> {
        let before = before.unwrap_or(i64::MAX);
        self.read_list(move |store, connection| {
            let keys: Vec<i64> = match owners {
                Owners::All => connection.values(
                    "select id from sweep where id < ? order by id desc limit ?",
                    [before, limit],
                ),
                Owners::Only(owner) => connection.values(
                    "select id from sweep where owner = ? and id < ? order by id desc limit ?",
                    (owner, before, limit),
                ),
            }?;
            let mut sweeps = Entries::default();
            for key in keys {
                let Some(sweep) = find(connection, key)? else {
                    continue; // deleted a moment ago
                };
                let paths: usize = sweep.paths.iter().map(String::len).sum();
                let bytes = bytes_of(&sweep.labels) + paths;
                if sweeps.add(sweep, bytes).is_break() {
                    break;
                }
            }
            store.damages.have_all(&[Table::Sweeps, Table::Jobs])?;
            Ok(sweeps)
        })
        .await
    }

    /// Whether a sweep of these owners with this public id was deleted recently.
    pub async fn sweep_was_deleted(self: &Arc<Self>, owners: Owners, id: SweepId) -> Result<bool> {
        self.read(move |store, connection| {
            let owner = "select owner from deleted_sweep where uuid = ?";
            let owner: Option<String> = connection.optional_value(owner, [id.0.to_string()])?;
            if owner.is_none() {
                store.damages.have_all(&[Table::Deleted])?;
            }
            Ok(owner.is_some_and(|owner| owners.include(&owner)))
        })
        .await
    }

    /// The definition of a sweep as JSON; `None` if the sweep was deleted.
    pub async fn sweep_definition(self: &Arc<Self>, key: i64) -> Result<Option<String>> {
        self.read(move |_, connection| {
            let tx = connection.unchecked_transaction()?;
            match some_job(&tx, key)? {
                Some(job) => content::read_text(&tx, Holder::Job(job), name::DEFINITION).map(Some),
                None => Ok(None),
            }
        })
        .await
    }

    /// At most `limit` members from the number `from` on, in order, without their parameters.
    pub async fn members(
        self: &Arc<Self>,
        key: i64,
        from: i64,
        limit: i64,
    ) -> Result<Vec<MemberRow>> {
        self.read_list(move |_, connection| {
            let mut expected = from;
            // one at a time: as text they take several times as much
            let members = connection.rows(
                "select sweep_member.*, job.status as job_status, job.reason as job_reason
                 from sweep_member left join job on job.id = sweep_member.job
                 where sweep_member.sweep = ? and number >= ? order by number limit ?",
                [key, from, limit],
                |row| {
                    let number: i64 = row.get("number")?;
                    if number != expected {
                        return Err(record(key, "members").damaged("some are missing"));
                    }
                    expected += 1;
                    member(row)
                },
            )?;
            if (members.len() as i64) < limit {
                let total = "select members from sweep where id = ?";
                let total: Option<i64> = connection.optional_value(total, [key])?;
                if total.is_some_and(|total| expected < total) {
                    return Err(record(key, "members").damaged("some are missing"));
                }
            }
            Ok(members)
        })
        .await
    }

    /// About how much memory (bytes) all members of a sweep take as rows and as a table, rather too much than too
    /// little.
    pub async fn members_memory(self: &Arc<Self>, key: i64) -> Result<usize> {
        const OF_ROW: i64 = 1500;
        const OF_BODY: i64 = 3;
        const OF_VALUES: i64 = 5;
        self.read_list(move |_, connection| {
            let (members, bodies): (i64, i64) = connection.query_row(
                "select count(*), coalesce(sum(octet_length(body)), 0) from sweep_member where sweep = ?",
                [key],
                |row| row.try_into(),
            )?;
            let definition: Option<i64> = connection.optional_value(
                "select bytes from sweep_member join attachment on kind = 'job' and key = job and name = 'definition'
                 join content on content.id = content where sweep = ? limit 1",
                [key],
            )?;
            let definition = definition.unwrap_or_default();
            // of a grid each value is many members'
            let values = definition
                .saturating_mul(members)
                .min(MOST_VALUE_BYTES as i64);
            let bytes = OF_ROW * members + OF_BODY * bodies + OF_VALUES * (definition + values);
            Ok(usize::try_from(bytes).unwrap_or(usize::MAX))
        })
        .await
    }

    /// At most `limit` events of members that have ended, after event number `after`; `None` if the sweep was deleted.
    pub async fn member_events(
        self: &Arc<Self>,
        key: i64,
        after: i64,
        limit: i64,
    ) -> Result<Option<MemberEvents>> {
        self.read(move |store, connection| {
            let tx = connection.unchecked_transaction()?;
            // at one moment: if the sweep has ended, all its events are there
            let Some(sweep) = find(&tx, key)? else {
                return Ok(None);
            };
            store.damages.have_all(&[Table::Jobs])?;
            let mut expected = after;
            let events = tx.rows(
                "select *, null as job_status, null as job_reason from sweep_member
                 where sweep = ? and seq > ? order by seq limit ?",
                [key, after, limit],
                |row| {
                    expected = expected.saturating_add(1);
                    let seq: i64 = row.get("seq")?;
                    if seq != expected {
                        return Err(record(key, "events").damaged("some are missing"));
                    }
                    Ok((seq, Time::from_micros(row.get("t")?), member(row)?))
                },
            )?;
            let more = events.len() as i64 >= limit;
            let last: i64 = tx.value("select last_seq from sweep where id = ?", [key])?;
            if !more && after.saturating_add(events.len() as i64) < last {
                return Err(record(key, "events").damaged("some are missing"));
            }
            Ok(Some(MemberEvents {
                sweep,
                events,
                more,
                last,
            }))
        })
        .await
    }

    /// The number of the last event of a sweep's members; 0 if there is none.
    pub async fn last_member_event(self: &Arc<Self>, key: i64) -> Result<i64> {
        self.read(move |_, connection| {
            let last = "select last_seq from sweep where id = ?";
            Ok(connection.optional_value(last, [key])?.unwrap_or(0))
        })
        .await
    }

    /// The members of its sweep that a job has to solve; `None` if there are none.
    pub async fn members_task(self: &Arc<Self>, job: i64) -> Result<Option<MembersTask>> {
        self.read(move |_, connection| {
            let tx = connection.unchecked_transaction()?;
            let members: Vec<(i64, Option<i64>)> = tx.rows(
                "select number, seq from sweep_member where job = ? order by number",
                [job],
                |row| Ok(row.try_into()?),
            )?;
            let Some((first, _)) = members.first() else {
                return Ok(None);
            };
            let left = members.iter().filter(|(_, seq)| seq.is_none());
            Ok(Some(MembersTask {
                definition: content::read_text(&tx, Holder::Job(job), name::DEFINITION)?,
                first: number(*first),
                group: members.iter().map(|(n, _)| number(*n)).collect(),
                numbers: left.map(|(n, _)| number(*n)).collect(),
            }))
        })
        .await
    }

    /// The key of some job of a sweep; `None` if the sweep was deleted.
    pub async fn some_job_of(self: &Arc<Self>, key: i64) -> Result<Option<i64>> {
        self.read(move |_, connection| {
            let tx = connection.unchecked_transaction()?;
            some_job(&tx, key)
        })
        .await
    }

    /// Stores the rows of members that an attempt of a job has solved; returns the key of their sweep, and `None` when
    /// the attempt is no longer the current one.
    pub async fn record_members(
        self: &Arc<Self>,
        job: i64,
        attempt: i32,
        rows: Vec<(Time, MemberRow)>,
    ) -> Result<Option<i64>> {
        self.write(move |writer| {
            let sweep = record_members(writer, job, attempt, &rows)?;
            writer.store.changes.note(sweep.map(Changed::Sweep));
            Ok(sweep)
        })
        .await
    }

    /// The sweeps of these owners with these keys.
    pub async fn sweeps_with_keys(
        self: &Arc<Self>,
        owners: Owners,
        keys: Vec<i64>,
    ) -> Result<Vec<Sweep>> {
        self.read_list(move |_, connection| {
            let mut sweeps = vec![];
            for key in keys {
                let found = find(connection, key)?;
                sweeps.extend(found.filter(|sweep| owners.include(&sweep.owner)));
            }
            Ok(sweeps)
        })
        .await
    }

    /// Deletes a sweep whose jobs were deleted before; false if the sweep still has jobs, which may run.
    pub async fn delete_sweep(self: &Arc<Self>, key: i64) -> Result<bool> {
        self.control(move |writer| {
            let mut change = writer.control_change()?;
            let deleted = delete(&mut change, key)?;
            if deleted {
                change.commit()?;
            }
            Ok(deleted)
        })
        .await
    }
}

fn record_members(
    writer: &Writer<'_>,
    job: i64,
    attempt: i32,
    rows: &[(Time, MemberRow)],
) -> Result<Option<i64>> {
    let tx = writer.begin()?;
    if !is_current(&tx, job, attempt)? {
        return Ok(None);
    }
    let sweep = "select sweep from sweep_member where job = ? limit 1";
    let sweep: Option<i64> = tx.optional_value(sweep, [job])?;
    let Some(sweep) = sweep else { return Ok(None) };
    // read whole, so that a damaged row is not given a new checksum below
    let Some(mut last) = row_of(&tx, sweep)? else {
        return Ok(None);
    };
    let (mut succeeded, mut failed) = (0, 0);
    for (t, row) in rows {
        let t = writer.store.by_our_clock(*t);
        let status = <&str>::from(row.status);
        let (n, body) = (i64::from(row.number), serde_json::to_string(row)?);
        let seq = last + 1;
        let ended = Ended {
            status,
            event: Some((seq, t.micros())),
            body: &body,
        };
        let sum = sum(sweep, n, job, Some(ended)).stored();
        let changed = tx.run(
            "update sweep_member set status = ?, seq = ?, t = ?, body = ?, checksum = ?
             where sweep = ? and number = ? and job = ? and seq is null",
            params![status, seq, t.micros(), body, sum, sweep, n, job],
        )?;
        if changed == 0 {
            continue; // it has a row of an earlier attempt
        }
        last = seq;
        match row.status {
            Status::Succeeded => succeeded += 1,
            _ => failed += 1,
        }
    }
    tx.run(
        "update sweep set last_seq = ?, succeeded = succeeded + ?, failed = failed + ? where id = ?",
        [last, succeeded, failed, sweep],
    )?;
    checksum::seal(&tx, "sweep", "id", sweep)?;
    tx.commit()?;
    Ok(Some(sweep))
}

/// Inserts a sweep; returns its key.
pub(super) fn insert(change: &mut Change<'_>, owner: &str, new: &NewSweep) -> Result<i64> {
    let now = change.now();
    let members: usize = new.groups.iter().map(Vec::len).sum();
    let tx = change.sql()?;
    let key: i64 = tx.value(
        "insert into sweep (uuid, owner, name, labels, paths, created_at, members) values (?, ?, ?, ?, ?, ?, ?) returning id",
        params![
            new.id.0.to_string(),
            owner,
            new.name,
            serde_json::to_string(&new.labels)?,
            serde_json::to_string(&new.paths)?,
            now.micros(),
            members as i64,
        ],
    )?;
    checksum::seal(tx, "sweep", "id", key)?;
    Ok(key)
}

/// Attaches the definition of a sweep to one of its jobs, so that it is kept as long as one of the jobs is. For the
/// first job the definition is written.
pub(super) fn attach_definition(
    tx: &Connection,
    job: i64,
    definition: &NewContent<'_>,
    is_first: bool,
) -> Result<()> {
    let (job, what) = (Holder::Job(job), name::DEFINITION);
    if !is_first && content::attach_written(tx, job, what, &definition.fingerprint)? {
        return Ok(());
    }
    content::attach(tx, job, what, definition)
}

/// Inserts members of a sweep that a job is to solve.
pub(super) fn insert_members(
    tx: &Connection,
    sweep: i64,
    job: i64,
    members: &[usize],
) -> Result<()> {
    for number in members {
        let number = *number as i64;
        tx.run(
            "insert into sweep_member (sweep, number, job, checksum) values (?, ?, ?, ?)",
            [sweep, number, job, sum(sweep, number, job, None).stored()],
        )?;
    }
    Ok(())
}

/// Deletes a sweep; false if it still has jobs.
fn delete(change: &mut Change<'_>, key: i64) -> Result<bool> {
    let now = change.now().micros();
    let tx = change.sql()?;
    let left =
        "select exists (select 1 from job join sweep on sweep.uuid = job.sweep where sweep.id = ?)";
    if tx.value(left, [key])? {
        return Ok(false);
    }
    tx.run(
        "insert into deleted_sweep select uuid, owner, ? from sweep where id = ?",
        [now, key],
    )?;
    for statement in [
        "delete from sweep_member where sweep = ?",
        "delete from sweep where id = ?",
    ] {
        tx.run(statement, [key])?;
    }
    Ok(true)
}

/// Deletes a sweep that has no jobs left; false if it has some.
pub(super) fn remove_without_jobs(change: &mut Change<'_>, id: SweepId) -> Result<bool> {
    let key = "select id from sweep where uuid = ?";
    let key: Option<i64> = change.sql()?.optional_value(key, [id.0.to_string()])?;
    match key {
        Some(key) => delete(change, key),
        None => Ok(true),
    }
}

/// Before a failed job is deleted, stores that the members which it has not solved have failed.
pub(super) fn keep_failures(tx: &Connection, deleted: &Job) -> Result<()> {
    if deleted.status != Status::Failed {
        return Ok(()); // without a job they count as canceled
    }
    let unsolved: Vec<(i64, i64)> = tx.rows(
        "select sweep, number from sweep_member where job = ? and seq is null and body is null",
        [deleted.key],
        |row| Ok(row.try_into()?),
    )?;
    let status = <&str>::from(deleted.status);
    for (sweep, n) in unsolved {
        let row = MemberRow::unsolved(number(n), deleted.status, deleted.reason);
        let body = serde_json::to_string(&row)?;
        let ended = Ended {
            status,
            event: None,
            body: &body,
        };
        let sum = sum(sweep, n, deleted.key, Some(ended)).stored();
        tx.run(
            "update sweep_member set status = ?, body = ?, checksum = ? where sweep = ? and number = ?",
            params![status, body, sum, sweep, n],
        )?;
    }
    Ok(())
}

/// Forgets the ids of sweeps that were deleted before the time `before` (µs).
pub(super) fn forget_deleted(tx: &Connection, before: i64) -> Result<()> {
    tx.run("delete from deleted_sweep where deleted_at < ?", [before])?;
    Ok(())
}

/// An error if the checksum of a member's row does not match.
pub(super) fn check_member(row: &Row<'_>) -> Result<()> {
    checked(row).map(|_| ())
}

/// The key of some job of a sweep, to which the definition is attached; `None` if the sweep was deleted.
fn some_job(connection: &Connection, key: i64) -> Result<Option<i64>> {
    connection.row("select * from sweep where id = ?", [key], |row| {
        intact(row, key)?;
        let job = "select id from job indexed by job_by_sweep where sweep = ? limit 1";
        let job = connection.optional_value(job, [text(row, "uuid")?])?;
        // a sweep goes with its last job
        job.ok_or_else(|| Table::Jobs.damaged(""))
    })
}

fn record(key: i64, what: &str) -> Record {
    Record::named(format!("{what} of sweep number {key}"))
}

fn number(number: i64) -> usize {
    usize::try_from(number).unwrap_or_default()
}

/// The stored outcome of a member that has ended.
struct Ended<'a> {
    status: &'a str,
    /// The number and time of the member's event, if it was solved.
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

/// The sweep's key, the member's number and the body of a member's row, if its checksum matches.
fn checked<'r>(row: &'r Row<'_>) -> Result<(i64, i64, Option<&'r str>)> {
    let (sweep, number, job) = (row.get("sweep")?, row.get("number")?, row.get("job")?);
    let body = optional_text(row, "body")?;
    let event: (Option<i64>, Option<i64>) = (row.get("seq")?, row.get("t")?);
    let ended = match body {
        Some(body) => Some(Ended {
            status: text(row, "status")?,
            event: event.0.zip(event.1),
            body,
        }),
        None => None,
    };
    let what = || record(sweep, &format!("member {number}"));
    sum(sweep, number, job, ended).verify(row.get("checksum")?, what)?;
    Ok((sweep, number, body))
}

/// The member of a row: as its body tells, or without a body by the status of its job.
fn member(row: &Row<'_>) -> Result<MemberRow> {
    let (sweep, n, body) = checked(row)?;
    if let Some(body) = body {
        let read = serde_json::from_str(body).map(MemberRow::tidied);
        return read.map_err(|error| record(sweep, &format!("member {n}")).damaged(error));
    }
    let status = optional_text(row, "job_status")?;
    let reason = optional_text(row, "job_reason")?;
    // its job was deleted
    let status = status.and_then(|word| word.parse().ok());
    let status = status.unwrap_or(Status::Canceled);
    let reason: Option<Reason> = reason.and_then(|word| word.parse().ok());
    Ok(MemberRow::unsolved(number(n), status, reason))
}

/// The number of the last event of a sweep, if the checksum of the sweep's row matches.
fn row_of(tx: &Connection, key: i64) -> Result<Option<i64>> {
    tx.row("select * from sweep where id = ?", [key], |row| {
        intact(row, key)?;
        Ok(row.get("last_seq")?)
    })
}

/// An error if the checksum of a sweep's row does not match.
pub(super) fn intact(row: &Row<'_>, key: i64) -> Result<()> {
    if checksum::row_is_intact(row)? {
        Ok(())
    } else {
        Err(record(key, "record").damaged("its checksum does not match its content"))
    }
}

fn with_id(connection: &Connection, owners: &Owners, id: SweepId) -> Result<Option<Sweep>> {
    let sweep = "select * from sweep where uuid = ?";
    let sweep = connection.row(sweep, [id.0.to_string()], |row| described(connection, row))?;
    Ok(sweep.filter(|sweep| owners.include(&sweep.owner)))
}

fn find(connection: &Connection, key: i64) -> Result<Option<Sweep>> {
    connection.row("select * from sweep where id = ?", [key], |row| {
        described(connection, row)
    })
}

/// The sweep of a row, with its status and counts from the rows of its jobs.
fn described(connection: &Connection, row: &Row<'_>) -> Result<Sweep> {
    let key: i64 = row.get("id")?;
    intact(row, key)?;
    let uuid = text(row, "uuid")?;
    let id = Uuid::try_parse(uuid).map_err(|error| record(key, "record").damaged(error))?;
    let id = SweepId::from(id);
    let (mut jobs, mut queued, mut running, mut versions, mut finished) = (0, 0, 0, 0, None);
    let of_jobs: Vec<(String, i64, i64, Option<i64>)> = connection.rows(
        "select status, count(*), sum(version), max(finished_at) from job indexed by job_by_sweep
         where sweep = ? group by status",
        [uuid],
        |row| Ok(row.try_into()?),
    )?;
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
        let count: i64 = row.get(name)?;
        Ok(u32::try_from(count).unwrap_or_default())
    };
    let last: i64 = row.get("last_seq")?;
    let mut members = MemberCounts {
        total: count("members")?,
        succeeded: count("succeeded")?,
        failed: count("failed")?,
        ..MemberCounts::default()
    };
    if last < i64::from(members.total) {
        let unsolved: Vec<(Option<String>, i64)> = connection.rows(
            "select coalesce(job.status, sweep_member.status), count(*)
             from sweep_member left join job on job.id = sweep_member.job
             where sweep_member.sweep = ? and seq is null group by 1",
            [key],
            |row| Ok(row.try_into()?),
        )?;
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
        name: row.get("name")?,
        labels: serde_json::from_str(text(row, "labels")?).map_err(damaged)?,
        owner: row.get("owner")?,
        created_at: Time::from_micros(row.get("created_at")?),
        finished_at: finished.map(Time::from_micros),
        paths: serde_json::from_str(text(row, "paths")?).map_err(damaged)?,
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
