//! Requests that repeat an earlier one, by a request key or by a job id that the client has chosen. Both belong to an
//! owner.

use std::{ops::Range, sync::Arc};

use base::{
    caller::Owners,
    job::{Job, JobId},
};
use rusqlite::{Connection, Row, params};

use super::{
    change::Change,
    checksum::Checksum,
    damage::Table,
    database::Store,
    delete::{deleted_id, owner_of_deleted},
    error::{Record, Result, StoreError},
    rows::find,
    sql::Sql,
    submission::{NewJob, RequestKey},
};

impl Store {
    /// The jobs that this owner has submitted under a request key.
    pub async fn replay(
        self: &Arc<Self>,
        owner: &str,
        key: &RequestKey,
    ) -> Result<Option<Vec<Job>>> {
        self.keys_were_read().await;
        let (owner, key) = (owner.to_owned(), key.clone());
        self.read(move |store, connection| {
            let Some(keys) = jobs_of_key(connection, &owner, &key)? else {
                store.damages.have_all_keys(&key.payload)?;
                return Ok(None);
            };
            let Some(mut jobs) = remaining(connection, keys)? else {
                store.damages.have_all(&[Table::Jobs, Table::Deleted])?;
                return Ok(None);
            };
            store.complete(connection, &mut jobs.iter_mut().collect::<Vec<_>>())?;
            Ok(Some(jobs))
        })
        .await
    }

    /// The job with an id chosen by the client, if this owner submitted it with this payload.
    pub async fn replay_with_id(
        self: &Arc<Self>,
        owner: &str,
        id: JobId,
        payload: &str,
    ) -> Result<Option<Job>> {
        let payload = payload.to_owned();
        let same = self.read(move |store, connection| {
            let same = "select id from job where uuid = ? and payload = ?";
            let same =
                connection.optional_value::<i64>(same, params![id.0.to_string(), payload])?;
            if same.is_none() {
                store.damages.have_all(&[Table::Jobs])?;
            }
            Ok(same)
        });
        match same.await? {
            Some(_) => self.job(Owners::Only(owner.into()), id).await,
            None => Ok(None),
        }
    }
}

/// The jobs of the earlier submission that a submission repeats, by its request key or by the ids that the client has
/// chosen.
pub(super) fn already_submitted(
    change: &mut Change<'_>,
    owner: &str,
    jobs: &[NewJob],
    key: Option<&RequestKey>,
) -> Result<Option<Vec<Job>>> {
    if let Some(key) = key {
        match jobs_of_key(change.sql()?, owner, key)? {
            None => change.damages().have_all_keys(&key.payload)?,
            Some(keys) => match remaining(change.sql()?, keys)? {
                Some(old) => return Ok(Some(old)),
                None => change.damages().have_all(&[Table::Jobs, Table::Deleted])?,
            },
        }
    }
    let mut old = vec![];
    for new in jobs {
        let Some(id) = new.id else { continue };
        let found = "select id, owner, payload from job where uuid = ?";
        let found: Option<(i64, String, Option<String>)> =
            change
                .sql()?
                .row(found, [id.0.to_string()], |row| Ok(row.try_into()?))?;
        match found {
            Some((key, theirs, Some(payload)))
                if theirs == owner && payload == new.payload && jobs.len() == 1 =>
            {
                old.push(change.read(key)?);
            }
            Some(_) => return Err(StoreError::IdConflict(id)),
            None => match owner_of_deleted(change.sql()?, id)? {
                Some(theirs) if theirs == owner => return Err(StoreError::Deleted(id)),
                // of another owner: whether that job still exists is not revealed
                Some(_) => return Err(StoreError::IdConflict(id)),
                None => change.damages().have_all(&[Table::Jobs, Table::Deleted])?,
            },
        }
    }
    Ok((!old.is_empty()).then_some(old))
}

/// Records that these jobs, whose numbers have no gap, were accepted under a request key.
pub(super) fn remember(
    change: &mut Change<'_>,
    owner: &str,
    key: &RequestKey,
    jobs: &[i64],
) -> Result<()> {
    let (first, count) = (jobs.first().copied().unwrap_or_default(), jobs.len() as i64);
    let (now, sum) = (
        change.now().micros(),
        checksum(owner, key, first, count).stored(),
    );
    change.sql()?.run(
        "insert or replace into request_key (owner, key, payload, first_job, jobs, created_at, checksum)
         values (?, ?, ?, ?, ?, ?, ?)",
        params![owner, key.key, key.payload, first, count, now, sum],
    )?;
    Ok(())
}

/// The numbers of the jobs that were accepted under a request key.
fn jobs_of_key(
    connection: &Connection,
    owner: &str,
    key: &RequestKey,
) -> Result<Option<Range<i64>>> {
    let found: Option<(String, i64, i64, Option<i64>)> = connection.row(
        "select payload, first_job, jobs, checksum from request_key where owner = ? and key = ?",
        params![owner, key.key],
        |row| Ok(row.try_into()?),
    )?;
    let Some((payload, first, jobs, stored)) = found else {
        return Ok(None);
    };
    let written = RequestKey {
        key: key.key.clone(),
        payload,
    };
    checksum(owner, &written, first, jobs)
        .verify(stored, || Record::named("record of a request key"))?;
    if written.payload == key.payload {
        Ok(Some(first..first.saturating_add(jobs)))
    } else {
        Err(StoreError::KeyReuse)
    }
}

/// An error if the checksum of a row of the table `request_key` does not match.
pub(super) fn check(row: &Row<'_>) -> Result<()> {
    let key = RequestKey {
        key: row.get("key")?,
        payload: row.get("payload")?,
    };
    let owner = row.get_ref("owner")?.as_str()?;
    checksum(owner, &key, row.get("first_job")?, row.get("jobs")?)
        .verify(row.get("checksum")?, || {
            Record::named("record of a request key")
        })
}

fn checksum(owner: &str, key: &RequestKey, first: i64, jobs: i64) -> Checksum {
    let row = Checksum::new().text(owner).text(&key.key);
    row.text(&key.payload).int(first).int(jobs)
}

/// Forgets the request key under which a job was submitted whose id was just forgotten, unless another job of the key
/// is still known.
pub(super) fn forget(tx: &Connection, job: i64) -> Result<()> {
    tx.run(FORGET, [job])?;
    Ok(())
}

pub(super) const FORGET: &str = "delete from request_key
     where first_job = (select max(first_job) from request_key indexed by request_key_by_job where first_job <= ?)
           and not exists (select 1 from job where id between first_job and first_job + jobs - 1)
           and not exists (select 1 from deleted_job where id between first_job and first_job + jobs - 1)";

/// The jobs with these keys that still exist. An error if all of them were deleted and their ids are still remembered;
/// `None` after that: the request key may be used again.
fn remaining(connection: &Connection, keys: Range<i64>) -> Result<Option<Vec<Job>>> {
    let (mut jobs, mut deleted) = (vec![], None);
    for key in keys {
        match find(connection, key)? {
            Some(job) => jobs.push(job),
            None => deleted = deleted_id(connection, key)?.or(deleted),
        }
    }
    match (jobs.is_empty(), deleted) {
        (false, _) => Ok(Some(jobs)),
        (true, Some(id)) => Err(StoreError::Deleted(id)),
        (true, None) => Ok(None),
    }
}
