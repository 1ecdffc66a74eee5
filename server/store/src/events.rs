//! The events of each job: appends them, and reads them from any number on.

use std::sync::Arc;

use base::{
    event::{Payload, StoredEvent},
    job::Progress,
    time::Time,
};
use rusqlite::{Connection, Row, params};

use super::{
    checksum::Checksum,
    database::Store,
    error::{Record, Result, StoreError},
    sql::{Sql, text},
};

/// The last events of an attempt, stored together with its end.
#[derive(Clone, Debug, Default)]
pub struct FinalBatch {
    /// Events not yet stored.
    pub events: Vec<(Time, Payload)>,
    /// The job's progress after these events.
    pub progress: Progress,
}

impl Store {
    /// Appends events of an attempt, and sets the job's progress after them; false when the attempt is no longer the
    /// current one.
    pub async fn append_events(
        self: &Arc<Self>,
        key: i64,
        attempt: i32,
        payloads: Vec<(Time, Payload)>,
        progress: &Progress,
    ) -> Result<bool> {
        let progress = progress.clone();
        self.write(move |writer| {
            let mut change = writer.change()?;
            if !change.is_current(key, attempt)? {
                return Ok(false);
            }
            change.append_with_progress(key, &payloads, &progress)?;
            change.commit()?;
            Ok(true)
        })
        .await
    }

    /// At most `limit` events after number `after`, in order.
    pub async fn events_after(
        self: &Arc<Self>,
        key: i64,
        after: i64,
        limit: i64,
    ) -> Result<Vec<StoredEvent>> {
        self.read(move |_, connection| read(connection, key, after, limit))
            .await
    }
}

/// The iterations of one attempt of a job, each as the number and the JSON of its event, in order; if there are more than
/// `most`, that many of them, evenly distributed. The others are not read.
pub(super) fn iterations(
    connection: &Connection,
    key: i64,
    attempt: i32,
    most: Option<usize>,
) -> Result<Vec<(i64, String)>> {
    let count: i64 = connection.value(
        "select count(*) from event where job_id = ? and attempt = ? and type = 'iteration'",
        (key, attempt),
    )?;
    let mut kept = spread(usize::try_from(count).unwrap_or(0), most).peekable();
    let mut place = 0..;
    let rows = connection.rows(
        "select seq, attempt, t, type, body, checksum from event
         where job_id = ? and attempt = ? and type = 'iteration' order by seq",
        (key, attempt),
        |row| {
            if kept.next_if_eq(&place.next().unwrap_or(0)).is_none() {
                return Ok(None);
            }
            let (seq, body) = checked(key, row)?;
            Ok(Some((seq, body.to_owned())))
        },
    )?;
    Ok(rows.into_iter().flatten().collect())
}

/// The places of at most `most` of `count` things (`most` is 2 or more), evenly distributed, including the first and the
/// last; all for `None`.
pub fn spread(count: usize, most: Option<usize>) -> impl Iterator<Item = usize> {
    let kept = most.map_or(count, |most| count.min(most.max(2)));
    let steps = kept.saturating_sub(1).max(1);
    (0..kept).map(move |n| (n * count.saturating_sub(1) + steps / 2) / steps)
}

/// At most `limit` events after number `after`, in order; an error if an event is damaged or missing.
pub(super) fn read(
    connection: &Connection,
    key: i64,
    after: i64,
    limit: i64,
) -> Result<Vec<StoredEvent>> {
    // one statement sees one state: the events, and after them the number of the last one
    let rows = connection.rows(
        "select * from (select seq, attempt, t, type, body, checksum from event
                        where job_id = ?1 and seq > ?2 order by seq limit ?3)
         union all select last_seq, 0, 0, '', '', null from job where id = ?1",
        [key, after, limit],
        |row| Ok((row.get::<_, i64>("seq")?, event(key, row))),
    );
    let mut rows = rows.map_err(|error| error.reading(|| Record::of_job(key, "events")))?;
    // the row after them is no event
    let Some((last, _)) = rows.pop() else {
        return Ok(vec![]); // the job was deleted
    };
    let events: Vec<StoredEvent> = rows
        .into_iter()
        .map(|(_, event)| event)
        .collect::<Result<_>>()?;
    // they are numbered without a gap
    let expected = last.saturating_sub(after).clamp(0, limit);
    let dense = (0..)
        .zip(&events)
        .all(|(place, event)| event.seq - 1 - place == after);
    if dense && events.len() as i64 == expected {
        Ok(events)
    } else {
        Err(Record::of_job(key, "events").damaged("some are missing"))
    }
}

/// The event of a row, if the checksum matches.
fn event(key: i64, row: &Row<'_>) -> Result<StoredEvent> {
    let (seq, body) = checked(key, row)?;
    let mut event = StoredEvent {
        seq,
        attempt: row.get("attempt")?,
        t: Time::from_micros(row.get("t")?),
        kind: text(row, "type")?.to_owned(),
        payload: body.to_owned(),
    };
    // written anew: a job, as this version describes jobs; and what no checksum says to be as it was written
    if event.is_done() || row.get::<_, Option<i64>>("checksum")?.is_none() {
        let read = serde_json::from_str::<Payload>(body);
        let written = read.and_then(|payload| serde_json::to_string(&payload));
        event.payload = written.map_err(|error| record(key, seq).damaged(error))?;
    }
    Ok(event)
}

/// The time of an event (µs), if the checksum of its row matches.
pub(super) fn intact_time(row: &Row<'_>) -> Option<i64> {
    checked(row.get("job_id").ok()?, row).ok()?;
    row.get("t").ok()
}

/// The number and the body of an event, if the checksum of its row matches.
fn checked<'r>(key: i64, row: &'r Row<'_>) -> Result<(i64, &'r str)> {
    let read = || {
        let (seq, body) = (row.get("seq")?, text(row, "body")?);
        let (attempt, t, kind) = (row.get("attempt")?, row.get("t")?, text(row, "type")?);
        checksum(key, seq, attempt, t, kind, body)
            .verify(row.get("checksum")?, || record(key, seq))?;
        Ok((seq, body))
    };
    read().map_err(|error: StoreError| error.reading(|| Record::of_job(key, "events")))
}

fn checksum(key: i64, seq: i64, attempt: i32, t: i64, kind: &str, body: &str) -> Checksum {
    let row = Checksum::new().int(key).int(seq).int(attempt.into());
    row.int(t).text(kind).text(body)
}

pub(super) fn record(key: i64, seq: i64) -> Record {
    Record::of_job(key, format!("event {seq}"))
}

/// Inserts events of an attempt, numbered from `first`.
pub(super) fn insert(
    tx: &Connection,
    key: i64,
    first: i64,
    attempt: i32,
    payloads: &[(Time, Payload)],
) -> Result<()> {
    for (seq, (t, payload)) in (first..).zip(payloads) {
        let (t, kind, body) = (t.micros(), payload.kind(), serde_json::to_string(payload)?);
        let checksum = checksum(key, seq, attempt, t, kind, &body).stored();
        tx.run(
            "insert into event (job_id, seq, attempt, t, type, body, checksum) values (?, ?, ?, ?, ?, ?, ?)",
            params![key, seq, attempt, t, kind, body, checksum],
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_of_many_has_their_ends_and_at_most_the_requested_number() {
        for count in 0..40 {
            for most in 2..45 {
                let kept: Vec<usize> = spread(count, Some(most)).collect();
                assert_eq!(kept.len(), most.min(count), "{count} {most}");
                let ends = (kept.first().copied(), kept.last().copied());
                assert_eq!(ends, ((0..count).next(), (0..count).last()));
                assert!(kept.is_sorted_by(|a, b| a < b), "{kept:?}");
            }
            assert!(spread(count, None).eq(0..count));
        }
    }
}
