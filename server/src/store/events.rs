//! The events of each job: appended, and read from any point on.

use sqlx::{Row, SqliteConnection, sqlite::SqliteRow};

use super::{
    checksum::Checksum,
    database::Store,
    error::{Record, Result, StoreError},
};
use crate::{
    event::{Event, Payload},
    job::Progress,
    time::Time,
};

/// The last events of an attempt, stored together with its end.
#[derive(Clone, Debug, Default)]
pub struct FinalBatch {
    /// Events not yet stored.
    pub events: Vec<(Time, Payload)>,
    /// The progress after them.
    pub progress: Progress,
}

impl Store {
    /// Appends events of an attempt, with the progress after them; false when the attempt is no longer the current
    /// one.
    pub async fn append_events(
        &self,
        key: i64,
        attempt: i32,
        payloads: &[(Time, Payload)],
        progress: &Progress,
    ) -> Result<bool> {
        let write = async {
            let mut change = self.change().await?;
            if !change.is_current(key, attempt).await? {
                return Ok(false);
            }
            change.append_with_progress(key, payloads, progress).await?;
            change.commit().await?;
            Ok(true)
        };
        self.writing(write).await
    }

    /// At most `limit` events after number `after`, in order.
    pub async fn events_after(&self, key: i64, after: i64, limit: i64) -> Result<Vec<Event>> {
        let read = async {
            let mut connection = self.reader.acquire().await?;
            read(&mut connection, key, after, limit).await
        };
        self.damages.noting(read).await
    }

    /// The iterations of one attempt of a job, each as the JSON of its event, in order.
    pub async fn iterations(&self, key: i64, attempt: i32) -> Result<Vec<String>> {
        let read = async {
            let rows = sqlx::query(
                "select seq, attempt, t, type, body, checksum from event
                 where job_id = ? and attempt = ? and type = 'iteration' order by seq",
            )
            .bind(key)
            .bind(attempt)
            .fetch_all(&self.reader)
            .await?;
            let body = |row| Ok(checked(key, row)?.1.to_owned());
            rows.iter().map(body).collect()
        };
        self.damages.noting(read).await
    }
}

/// At most `limit` events after number `after`, in order; an error if one is damaged or missing.
pub(super) async fn read(
    connection: &mut SqliteConnection,
    key: i64,
    after: i64,
    limit: i64,
) -> Result<Vec<Event>> {
    // one statement sees one state: the events, and after them the number of the last one
    let rows = sqlx::query(
        "select * from (select seq, attempt, t, type, body, checksum from event
                        where job_id = ?1 and seq > ?2 order by seq limit ?3)
         union all select last_seq, 0, 0, '', '', null from job where id = ?1",
    )
    .bind(key)
    .bind(after)
    .bind(limit)
    .fetch_all(connection)
    .await
    .map_err(|error| StoreError::from(error).reading(|| Record::of_job(key, "events")))?;
    let Some((end, rows)) = rows.split_last() else {
        return Ok(vec![]); // the job was deleted
    };
    let last: i64 = end.try_get("seq")?;
    let events: Vec<Event> = rows
        .iter()
        .map(|row| {
            let (seq, body) = checked(key, row)?;
            Ok(Event {
                seq,
                attempt: row.try_get("attempt")?,
                t: Time::from_micros(row.try_get("t")?),
                payload: serde_json::from_str(body)
                    .map_err(|error| record(key, seq).damaged(error))?,
            })
        })
        .collect::<Result<_>>()?;
    // they are numbered without a gap
    let expected = last.saturating_sub(after).clamp(0, limit);
    let dense = (0..)
        .zip(&events)
        .all(|(place, event)| event.seq - 1 - place == after);
    match dense && events.len() as i64 == expected {
        true => Ok(events),
        false => Err(Record::of_job(key, "events").damaged("some are missing")),
    }
}

/// The time of an event (µs), if its row is as it was written.
pub(super) fn intact_time(row: &SqliteRow) -> Option<i64> {
    checked(row.try_get("job_id").ok()?, row).ok()?;
    row.try_get("t").ok()
}

/// The number of an event and its body, if the row is as it was written.
fn checked(key: i64, row: &SqliteRow) -> Result<(i64, &str)> {
    let read = || {
        let (seq, body) = (row.try_get("seq")?, row.try_get("body")?);
        let (attempt, t, kind) = (
            row.try_get("attempt")?,
            row.try_get("t")?,
            row.try_get("type")?,
        );
        checksum(key, seq, attempt, t, kind, body)
            .verify(row.try_get("checksum")?, || record(key, seq))?;
        Ok((seq, body))
    };
    read().map_err(|error: StoreError| error.reading(|| Record::of_job(key, "events")))
}

fn checksum(key: i64, seq: i64, attempt: i32, t: i64, kind: &str, body: &str) -> Checksum {
    let row = Checksum::new().int(key).int(seq).int(attempt.into());
    row.int(t).text(kind).text(body)
}

fn record(key: i64, seq: i64) -> Record {
    Record::of_job(key, format!("event {seq}"))
}

/// Inserts events of an attempt; `first`: the number of the first of them.
pub(super) async fn insert(
    tx: &mut SqliteConnection,
    key: i64,
    first: i64,
    attempt: i32,
    payloads: &[(Time, Payload)],
) -> Result<()> {
    for (seq, (t, payload)) in (first..).zip(payloads) {
        let (t, kind, body) = (t.micros(), payload.kind(), serde_json::to_string(payload)?);
        let checksum = checksum(key, seq, attempt, t, kind, &body).stored();
        sqlx::query(
            "insert into event (job_id, seq, attempt, t, type, body, checksum) values (?, ?, ?, ?, ?, ?, ?)",
        )
        .bind(key)
        .bind(seq)
        .bind(attempt)
        .bind(t)
        .bind(kind)
        .bind(body)
        .bind(checksum)
        .execute(&mut *tx)
        .await?;
    }
    Ok(())
}
