//! A row of the table `job` as a [`Job`].

use std::collections::BTreeMap;

use sqlx::{QueryBuilder, Row, Sqlite, SqliteConnection, sqlite::SqliteRow};
use uuid::Uuid;

use super::{Result, StoreError};
use crate::{
    job::{Job, JobId, QueuePosition, Reason, ResultAvailable, Status},
    time::Time,
};

pub(super) async fn read(tx: &mut SqliteConnection, key: i64) -> Result<Job> {
    from_row(
        &sqlx::query("select * from job where id = ?")
            .bind(key)
            .fetch_one(tx)
            .await?,
    )
}

/// Fills in the places of those that are queued, all from one look at the queue.
pub(super) async fn place(connection: &mut SqliteConnection, jobs: &mut [Job]) -> Result<()> {
    let queued: Vec<i64> = jobs
        .iter()
        .filter(|job| job.status == Status::Queued)
        .map(|job| job.key)
        .collect();
    if queued.is_empty() {
        return Ok(());
    }
    let mut query = QueryBuilder::<Sqlite>::new(
        "with place as (select id, row_number() over (order by priority desc, id) as position
                        from job where status = 'queued')
         select id, position from place where id in (",
    );
    let mut list = query.separated(", ");
    queued.iter().for_each(|key| {
        list.push_bind(*key);
    });
    query.push(")");
    let places: Vec<(i64, i64)> = query.build_query_as().fetch_all(connection).await?;
    let places: BTreeMap<i64, i64> = places.into_iter().collect();
    for job in jobs {
        job.queue = places.get(&job.key).map(|&position| QueuePosition {
            position,
            ahead: position - 1,
            reason: "workers_busy".into(),
        });
    }
    Ok(())
}

pub(super) fn from_row(row: &SqliteRow) -> Result<Job> {
    let corrupt = |what: &str| StoreError::Corrupt(format!("job.{what}"));
    let uuid: &str = row.try_get("uuid")?;
    let id = JobId(Uuid::try_parse(uuid).map_err(|_| corrupt("uuid"))?);
    let status = Status::parse(row.try_get("status")?).ok_or_else(|| corrupt("status"))?;
    let reason: Option<&str> = row.try_get("reason")?;
    let time = |name: &str| -> Result<Option<Time>> {
        Ok(row.try_get::<Option<i64>, _>(name)?.map(Time::from_micros))
    };
    let created_at = Time::from_micros(row.try_get("created_at")?);
    let (started_at, finished_at) = (time("started_at")?, time("finished_at")?);
    let progress: Option<&str> = row.try_get("progress")?;
    let failure: Option<&str> = row.try_get("failure")?;
    let result_available = ResultAvailable::parse(row.try_get("result_available")?)
        .ok_or_else(|| corrupt("result_available"))?;
    Ok(Job {
        key: row.try_get("id")?,
        id,
        status,
        reason: reason
            .map(|word| Reason::parse(word).ok_or_else(|| corrupt("reason")))
            .transpose()?,
        cancel_requested: row.try_get("cancel_requested")?,
        version: row.try_get("version")?,
        name: row.try_get("name")?,
        labels: serde_json::from_str(row.try_get("labels")?)?,
        owner: row.try_get("owner")?,
        priority: row.try_get("priority")?,
        attempt: row.try_get("attempt")?,
        max_attempts: row.try_get("max_attempts")?,
        input_hash: row.try_get("input_hash")?,
        created_at,
        started_at,
        finished_at,
        queue_wait_s: started_at.map(|start| created_at.seconds_until(start)),
        run_s: started_at
            .zip(finished_at)
            .map(|(start, end)| start.seconds_until(end)),
        queue: None,
        progress: progress.map(serde_json::from_str).transpose()?,
        failure: failure.map(serde_json::from_str).transpose()?,
        result_available,
        links: links(id),
    })
}

fn links(id: JobId) -> BTreeMap<String, String> {
    ["events", "history", "result", "fields", "cancel"]
        .into_iter()
        .map(|verb| (verb.to_string(), format!("/v1/jobs/{id}/{verb}")))
        .chain([
            ("self".to_string(), format!("/v1/jobs/{id}")),
            // a template: the boundaries are those of the problem
            (
                "profiles".to_string(),
                format!("/v1/jobs/{id}/profiles/{{boundary}}"),
            ),
        ])
        .collect()
}
