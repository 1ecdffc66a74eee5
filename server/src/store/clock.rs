//! The clock of the store, which is never behind the times that are in it; and the time that it has seen pass.

use std::{borrow::Cow, sync::atomic::Ordering};

use super::{
    database::Store,
    error::{Result, StoreError},
    events,
    pauses::Pause,
    rows::from_row,
};
use crate::{event::Payload, time::Time};

/// The settings with the last moment that the store has seen, and with the pauses.
const SEEN: &str = "seen_until";
const PAUSES: &str = "pauses";

/// How often the moment is noted.
pub(super) const NOTED_MICROS: i64 = 60 * 1_000_000;

/// Shorter pauses are not kept: they are a small part of the shortest age that matters.
const LEAST_MICROS: i64 = 1_000_000;
/// Longer ones do not count for what waits in the queue.
const NOTABLE_MICROS: i64 = 60 * 1_000_000;
/// Longer ones are told as a warning.
const LONG_MICROS: i64 = 86_400 * 1_000_000;

impl Store {
    /// Compares the clock of the machine with the times in the store, when it is opened: it may have been set back since
    /// then. Jobs are listed in the order of their times, so new ones must not be earlier than those that are there; and
    /// the next event of a job that has not ended must not be earlier than its last one.
    pub(super) async fn read_clock(&self) -> Result<()> {
        let latest = self.latest_time().await?;
        let ahead = latest.map_or(0, |latest| latest - Time::now().micros());
        if ahead > 0 {
            tracing::warn!(
                "the clock is {:.0} s behind the latest time in the store: it has been set back, or was wrong before; until \
                 the next start, times are later by that much, so that jobs stay in their order",
                ahead as f64 / 1e6
            );
            self.ahead.store(ahead, Ordering::Relaxed);
        }
        Ok(())
    }

    /// This moment.
    pub(super) fn now(&self) -> Time {
        self.by_our_clock(Time::now())
    }

    pub(super) fn by_our_clock(&self, time: Time) -> Time {
        let ahead = self.ahead.load(Ordering::Relaxed);
        Time::from_micros(time.micros().saturating_add(ahead))
    }

    pub(super) fn events_by_our_clock<'a>(
        &self,
        events: &'a [(Time, Payload)],
    ) -> Cow<'a, [(Time, Payload)]> {
        if self.ahead.load(Ordering::Relaxed) == 0 {
            return Cow::Borrowed(events);
        }
        let ours = |(t, payload): &(Time, Payload)| (self.by_our_clock(*t), payload.clone());
        Cow::Owned(events.iter().map(ours).collect())
    }
}

impl Store {
    /// Compares the clock with the last moment that the store has seen, when it is opened; after `read_clock`.
    pub(super) async fn read_pauses(&self) -> Result<()> {
        let now = self.now().micros();
        let mut pauses: Vec<Pause> = match self.sealed_setting(PAUSES).await? {
            Sealed::Absent => vec![],
            Sealed::Intact(text) => serde_json::from_str(&text).unwrap_or_default(),
            // nothing is known of the time before
            Sealed::Damaged => vec![Pause(i64::MIN, now)],
        };
        let before = pauses.clone();
        let latest = self.latest_time().await?;
        let seen = match self.sealed_setting(SEEN).await? {
            // jobs may have been stored since it was noted, but none long after
            Sealed::Intact(text) => text.parse().ok().map(|seen: i64| {
                let since = latest.unwrap_or(seen).saturating_sub(seen);
                seen + if since < 2 * NOTED_MICROS {
                    since.max(0)
                } else {
                    0
                }
            }),
            Sealed::Absent | Sealed::Damaged => latest,
        };
        let pause = now.saturating_sub(seen.unwrap_or(now));
        if pause >= LEAST_MICROS {
            pauses.push(Pause(now - pause, now));
        }
        let pauses = self.pauses.set(pauses, now);
        let changed = pauses != before;
        let text = serde_json::to_string(&pauses)?;
        if pause >= LONG_MICROS {
            tracing::warn!(
                "the clock is {:.1} days ahead of the latest time in the store: no service ran for that long, or \
                 a clock was wrong, then or now; this time does not count for jobs that are removed for their age or expire in the \
                 queue",
                pause as f64 / LONG_MICROS as f64
            );
        }
        if changed {
            // an error is told when the queue is first written: a full disk does not prevent a start
            let noted = self.control(|| self.write_sealed(PAUSES, &text)).await;
            noted.or_else(unless_damaged)?;
        }
        if pause >= NOTABLE_MICROS {
            let extended = self.control(|| self.extend_waits(pause)).await;
            extended.or_else(unless_damaged)?;
        }
        self.note_alive().await;
        Ok(())
    }

    /// The store has seen this moment. On a full disk it is not noted: the space that is reserved there is for what users ask.
    pub(super) async fn note_alive(&self) {
        if self.reserve.was_disk_full() {
            return;
        }
        let now = self.now().micros().to_string();
        if let Err(cause) = self.writing(self.write_sealed(SEEN, &now)).await {
            tracing::debug!(%cause, "the time could not be stored: {cause}");
        }
    }

    /// When was what is now of this age (seconds), as far as the store has seen the time since then pass?
    pub(super) fn cutoff(&self, now: Time, age_s: f64) -> Time {
        Time::from_micros(self.pauses.cutoff(now.micros(), (age_s * 1e6) as i64))
    }

    /// The latest time in the store, of records that are intact: a changed bit in a row or an index would set the clock.
    pub(super) async fn latest_time(&self) -> Result<Option<i64>> {
        // the first of each, and some more for those that are damaged
        const CREATED: &str = "select * from job order by created_at desc limit 10";
        const FINISHED: &str =
            "select * from job where finished_at is not null order by finished_at desc limit 10";
        const OF_ACTIVE: &str =
            "select event.* from job join event on event.job_id = job.id and event.seq = job.last_seq
             where job.status in ('queued', 'running') order by event.t desc limit 10";
        let mut times = vec![];
        for query in [CREATED, FINISHED] {
            for row in sqlx::query(query).fetch_all(&self.reader).await? {
                if let Ok(job) = from_row(&row) {
                    times.push(job.created_at.micros());
                    times.extend(job.finished_at.map(Time::micros));
                }
            }
        }
        for row in sqlx::query(OF_ACTIVE).fetch_all(&self.reader).await? {
            times.extend(events::intact_time(&row));
        }
        Ok(times.into_iter().max())
    }

    /// Jobs that would expire within as much time as was not seen may wait for that much longer.
    async fn extend_waits(&self, pause: i64) -> Result<()> {
        let mut change = self.control_change().await?;
        let short: Vec<i64> = sqlx::query_scalar(
            "select id from job indexed by job_expiry where status = 'queued' and expires_at < ?",
        )
        .bind(change.now().micros().saturating_add(pause))
        .fetch_all(change.sql().await?)
        .await?;
        for key in short {
            let later = |at: Time| Time::from_micros(at.micros().saturating_add(pause));
            let extended = change.set(key, |row| row.expires_at = row.expires_at.map(later));
            let extended = extended.await;
            // a damaged one stays as it is
            change.unless_damage_of(key, extended).await?;
        }
        change.commit().await.map(drop)
    }

    async fn sealed_setting(&self, name: &str) -> Result<Sealed> {
        let value: Option<String> = sqlx::query_scalar("select value from setting where name = ?")
            .bind(name)
            .fetch_optional(&self.reader)
            .await?;
        Ok(match value {
            None => Sealed::Absent,
            Some(value) => match value.split_once(' ') {
                Some((sum, text)) if sum == checksum(text) => Sealed::Intact(text.to_owned()),
                _ => Sealed::Damaged,
            },
        })
    }

    async fn write_sealed(&self, name: &str, text: &str) -> Result<()> {
        let mut tx = self.begin_control().await?;
        sqlx::query("insert or replace into setting (name, value) values (?, ?)")
            .bind(name)
            .bind(format!("{} {text}", checksum(text)))
            .execute(&mut *tx)
            .await?;
        tx.commit().await
    }
}

/// A setting that has a checksum.
enum Sealed {
    Absent,
    Intact(String),
    Damaged,
}

fn checksum(text: &str) -> String {
    format!("{:08x}", crc32fast::hash(text.as_bytes()))
}

/// Damage and a full disk are told elsewhere, and prevent no start.
fn unless_damaged(error: StoreError) -> Result<()> {
    match error {
        StoreError::Damaged(_) | StoreError::Broken(_) | StoreError::Full => Ok(()),
        other => Err(other),
    }
}
