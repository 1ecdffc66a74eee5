//! Which worker elsewhere solves a job, so that the job goes on there when the service restarts. Triggers remove a lease when its
//! attempt ends (`migrations/0022_leases.sql`).

use std::sync::Arc;

use base::job::Job;

use super::{
    change::Change, database::Store, error::Result, rows::find, sql::Sql, submission::Lessee,
};

/// A job that a worker elsewhere solves.
#[derive(Clone, Debug)]
pub struct Leased {
    /// The job.
    pub job: Job,
    /// The worker.
    pub lessee: Lessee,
    /// The number of events that its solver has told, and that are stored.
    pub events: u64,
}

impl Store {
    /// The jobs that workers elsewhere solve, as far as they are known to. A damaged row is left out: its job waits for the
    /// operator.
    pub async fn leased(self: &Arc<Self>) -> Result<Vec<Leased>> {
        self.read(|store, connection| {
            let leases = "select job.id, lease.worker, lease.name,
                    (select count(*) from event where job_id = job.id and event.attempt = job.attempt
                        and type not in ('status', 'done')) as events
                from lease join job on job.id = lease.job and job.attempt = lease.attempt
                where status = 'running'";
            let found = connection.rows(leases, (), |row| {
                let lessee = Lessee {
                    worker: row.get("worker")?,
                    name: row.get("name")?,
                };
                let key: i64 = row.get("id")?;
                Ok((key, lessee, row.get::<_, i64>("events")?))
            })?;
            let leased = found.into_iter().filter_map(|(key, lessee, events)| {
                let job = store.damages.noting(find(connection, key)).ok()??;
                Some(Leased {
                    job,
                    lessee,
                    events: u64::try_from(events).unwrap_or(0),
                })
            });
            Ok(leased.collect())
        })
        .await
    }
}

/// Notes in the transaction of a claim that a worker elsewhere solves the job.
pub(super) fn note(change: &mut Change<'_>, job: &Job, lessee: &Lessee) -> Result<()> {
    change.sql()?.run(
        "insert or replace into lease (job, attempt, worker, name) values (?, ?, ?, ?)",
        (job.key, job.attempt, &lessee.worker, &lessee.name),
    )?;
    Ok(())
}
