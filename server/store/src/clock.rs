//! The clock of the store, which is never behind the times in the store, and the pauses that the store has not seen
//! pass.

use std::{
    borrow::Cow,
    sync::{Arc, atomic::Ordering},
};

use base::{event::Payload, time::Time};
use rusqlite::{Connection, params};

use super::{
    database::{Store, Writer},
    error::{Result, StoreError},
    events,
    pauses::Pause,
    rows::from_row,
    sql::Sql,
};

/// The name of the setting with the last moment that the store has seen.
const SEEN: &str = "seen_until";
/// The name of the setting with the pauses.
const PAUSES: &str = "pauses";

/// How often the present moment is stored (µs).
pub(super) const NOTED_MICROS: i64 = 60 * 1_000_000;

/// Pauses shorter than this (µs) are not kept: they are a small part of the shortest age that matters.
const LEAST_MICROS: i64 = 1_000_000;
/// Pauses from this length on (µs) do not count for jobs that may expire in the queue.
const NOTABLE_MICROS: i64 = 60 * 1_000_000;
/// Pauses from this length on (µs) are logged as a warning.
const LONG_MICROS: i64 = 86_400 * 1_000_000;

impl Store {
    /// Compares the machine's clock with the times in the store, when the store is opened: the clock may have been set
    /// back. Jobs are listed in the order of their times, so new jobs must not be earlier than existing ones; and the
    /// next event of a job that has not ended must not be earlier than its last event.
    pub(super) async fn read_clock(self: &Arc<Self>) -> Result<()> {
        let latest = self.read(|_, connection| latest_time(connection)).await?;
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

    /// The present time, by the clock of the store.
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
    /// Compares the clock with the last moment that the store has seen, when the store is opened, after `read_clock`;
    /// records the pause between them.
    pub(super) async fn read_pauses(self: &Arc<Self>) -> Result<()> {
        let now = self.now().micros();
        let read = self.read(|_, connection| {
            let pauses = sealed_setting(connection, PAUSES)?;
            let latest = latest_time(connection)?;
            Ok((pauses, latest, sealed_setting(connection, SEEN)?))
        });
        let (pauses, latest, seen) = read.await?;
        let mut pauses: Vec<Pause> = match pauses {
            Sealed::Absent => vec![],
            Sealed::Intact(text) => serde_json::from_str(&text).unwrap_or_default(),
            // nothing is known of the time before
            Sealed::Damaged => vec![Pause(i64::MIN, now)],
        };
        let before = pauses.clone();
        let seen = match seen {
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
            let noted = self.control(move |writer| write_sealed(writer, PAUSES, &text));
            noted.await.or_else(unless_damaged)?;
        }
        if pause >= NOTABLE_MICROS {
            let extended = self.control(move |writer| extend_waits(writer, pause));
            extended.await.or_else(unless_damaged)?;
        }
        self.note_alive().await;
        Ok(())
    }

    /// Stores the present moment as the last one that the store has seen. Not on a full disk: the space that is
    /// reserved there is for requests of users.
    pub(super) async fn note_alive(self: &Arc<Self>) {
        if self.reserve.was_disk_full() {
            return;
        }
        let now = self.now().micros().to_string();
        let noted = self.write(move |writer| write_sealed(writer, SEEN, &now));
        if let Err(cause) = noted.await {
            tracing::debug!(%cause, "the time could not be stored: {cause}");
        }
    }

    /// The time `age_s` seconds before `now`, without the long pauses in which no service ran.
    pub(super) fn cutoff(&self, now: Time, age_s: f64) -> Time {
        Time::from_micros(self.pauses.cutoff(now.micros(), (age_s * 1e6) as i64))
    }
}

/// The latest time in the intact records of the store: a changed bit in a row or an index must not set the clock.
fn latest_time(connection: &Connection) -> Result<Option<i64>> {
    // the first of each, and some more for those that are damaged
    const CREATED: &str = "select * from job order by created_at desc limit 10";
    const FINISHED: &str =
        "select * from job where finished_at is not null order by finished_at desc limit 10";
    const OF_ACTIVE: &str =
        "select event.* from job join event on event.job_id = job.id and event.seq = job.last_seq
         where job.status in ('queued', 'running') order by event.t desc limit 10";
    let mut times = vec![];
    for query in [CREATED, FINISHED] {
        let jobs = connection.rows(query, (), |row| Ok(from_row(row)))?;
        for job in jobs.into_iter().flatten() {
            times.push(job.created_at.micros());
            times.extend(job.finished_at.map(Time::micros));
        }
    }
    let of_active = connection.rows(OF_ACTIVE, (), |row| Ok(events::intact_time(row)))?;
    times.extend(of_active.into_iter().flatten());
    Ok(times.into_iter().max())
}

/// Extends the time that a job may wait, by `pause` (µs), for the jobs that would expire within `pause` from now.
fn extend_waits(writer: &Writer<'_>, pause: i64) -> Result<()> {
    let mut change = writer.control_change()?;
    let until = change.now().micros().saturating_add(pause);
    let short =
        "select id from job indexed by job_expiry where status = 'queued' and expires_at < ?";
    let short: Vec<i64> = change.sql()?.values(short, [until])?;
    for key in short {
        let later = |at: Time| Time::from_micros(at.micros().saturating_add(pause));
        let extended = change.set(key, |row| row.expires_at = row.expires_at.map(later));
        // a damaged one stays as it is
        change.unless_damage_of(key, extended)?;
    }
    change.commit().map(drop)
}

fn sealed_setting(connection: &Connection, name: &str) -> Result<Sealed> {
    let value = "select value from setting where name = ?";
    let value: Option<String> = connection.optional_value(value, [name])?;
    Ok(match value {
        None => Sealed::Absent,
        Some(value) => match value.split_once(' ') {
            Some((sum, text)) if sum == checksum(text) => Sealed::Intact(text.to_owned()),
            _ => Sealed::Damaged,
        },
    })
}

fn write_sealed(writer: &Writer<'_>, name: &str, text: &str) -> Result<()> {
    let tx = writer.begin_control()?;
    let value = format!("{} {text}", checksum(text));
    tx.run(
        "insert or replace into setting (name, value) values (?, ?)",
        params![name, value],
    )?;
    tx.commit()
}

/// What was read of a setting that has a checksum.
enum Sealed {
    Absent,
    Intact(String),
    Damaged,
}

fn checksum(text: &str) -> String {
    format!("{:08x}", crc32fast::hash(text.as_bytes()))
}

/// Ignores errors of a damaged or full store: they are reported elsewhere, and do not prevent a start.
fn unless_damaged(error: StoreError) -> Result<()> {
    match error {
        StoreError::Damaged(_) | StoreError::Broken(_) | StoreError::Full => Ok(()),
        other => Err(other),
    }
}
