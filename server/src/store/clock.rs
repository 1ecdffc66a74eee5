//! The clock of the store, which is never behind the times that are in it.

use std::{borrow::Cow, sync::atomic::Ordering};

use super::{database::Store, error::Result};
use crate::{event::Payload, time::Time};

impl Store {
    /// Compares the clock of the machine with the times in the store, when it is opened: it may have been set back since
    /// then. Jobs are listed in the order of their times, so new ones must not be earlier than those that are there; and
    /// the next event of a job that has not ended must not be earlier than its last one.
    pub(super) async fn read_clock(&self) -> Result<()> {
        let latest: Option<i64> = sqlx::query_scalar(
            "select max(t) from (select max(created_at) as t from job
                                 union all select max(finished_at) from job
                                 union all select max(event.t) from job join event
                                           on event.job_id = job.id and event.seq = job.last_seq
                                           where job.status in ('queued', 'running'))",
        )
        .fetch_one(&self.reader)
        .await?;
        let ahead = latest.map_or(0, |latest| latest - Time::now().micros());
        if ahead > 0 {
            tracing::warn!(
                "the clock is {:.0} s behind the latest time in the store: it has been set back, or was wrong; until \
                 the next start times are later by that much, so that jobs stay in their order",
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
