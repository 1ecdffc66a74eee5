//! The events of each job: appended, and read from any point on.

use sqlx::{Row, SqliteConnection};

use super::{
    database::Store,
    error::{Result, StoreError},
    rows::is_current,
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
        let mut tx = self.begin().await?;
        if !is_current(&mut tx, key, attempt).await? {
            return Ok(false);
        }
        append_with_progress(&mut tx, key, attempt, payloads, progress).await?;
        tx.commit().await?;
        Ok(true)
    }

    /// At most `limit` events after number `after`, in order.
    pub async fn events_after(&self, key: i64, after: i64, limit: i64) -> Result<Vec<Event>> {
        let rows = sqlx::query(
            "select seq, attempt, t, body from event where job_id = ? and seq > ? order by seq limit ?",
        )
        .bind(key)
        .bind(after)
        .bind(limit)
        .fetch_all(&self.reader)
        .await?;
        rows.iter()
            .map(|row| {
                let seq = row.try_get("seq")?;
                let payload = serde_json::from_str(row.try_get("body")?)
                    .map_err(|error| StoreError::Corrupt(format!("event {seq}: {error}")))?;
                Ok(Event {
                    seq,
                    attempt: row.try_get("attempt")?,
                    t: Time::from_micros(row.try_get("t")?),
                    payload,
                })
            })
            .collect()
    }

    /// The iterations of one attempt of a job, each as the JSON of its event, in order.
    pub async fn iterations(&self, key: i64, attempt: i32) -> Result<Vec<String>> {
        Ok(sqlx::query_scalar(
            "select body from event where job_id = ? and attempt = ? and type = 'iteration' order by seq",
        )
        .bind(key)
        .bind(attempt)
        .fetch_all(&self.reader)
        .await?)
    }
}

/// Appends events, with the progress after them.
pub(super) async fn append_with_progress(
    tx: &mut SqliteConnection,
    key: i64,
    attempt: i32,
    payloads: &[(Time, Payload)],
    progress: &Progress,
) -> Result<()> {
    append(tx, key, attempt, payloads).await?;
    sqlx::query("update job set progress = ? where id = ?")
        .bind(serde_json::to_string(progress)?)
        .bind(key)
        .execute(tx)
        .await?;
    Ok(())
}

/// Numbers events and appends them.
pub(super) async fn append(
    tx: &mut SqliteConnection,
    key: i64,
    attempt: i32,
    payloads: &[(Time, Payload)],
) -> Result<()> {
    let last: i64 = sqlx::query_scalar(
        "update job set last_seq = last_seq + ? where id = ? returning last_seq",
    )
    .bind(payloads.len() as i64)
    .bind(key)
    .fetch_one(&mut *tx)
    .await?;
    let first = last - payloads.len() as i64 + 1;
    for (seq, (t, payload)) in (first..).zip(payloads) {
        sqlx::query(
            "insert into event (job_id, seq, attempt, t, type, body) values (?, ?, ?, ?, ?, ?)",
        )
        .bind(key)
        .bind(seq)
        .bind(attempt)
        .bind(t.micros())
        .bind(payload.kind())
        .bind(serde_json::to_string(payload)?)
        .execute(&mut *tx)
        .await?;
    }
    Ok(())
}
