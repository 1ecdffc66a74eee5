//! Editing a job: its name and labels, its priority, whether it is pinned.

use std::collections::BTreeMap;

use super::{
    coalescing,
    database::Store,
    error::Result,
    labels,
    rows::{read, with_id},
    waiting::{Move, Place},
};
use crate::{
    caller::Owners,
    job::{Job, JobId},
};

/// Changes to a job; absent fields stay unchanged.
#[derive(Clone, Debug, Default)]
pub struct Edit {
    /// A name, or none.
    pub name: Option<Option<String>>,
    /// All labels.
    pub labels: Option<BTreeMap<String, String>>,
    /// −10 … 10.
    pub priority: Option<i32>,
    /// Never deleted because of its age.
    pub pinned: Option<bool>,
}

impl Store {
    /// Edits a job, if it has one of these versions or none are given. `Err` holds the version that it has
    /// instead; `None`: there is no such job.
    pub async fn edit(
        &self,
        owners: Owners<'_>,
        id: JobId,
        edit: &Edit,
        versions: Option<&[i64]>,
    ) -> Result<Option<std::result::Result<Job, i64>>> {
        self.control(|| self.try_to_edit(owners, id, edit, versions))
            .await
    }

    async fn try_to_edit(
        &self,
        owners: Owners<'_>,
        id: JobId,
        edit: &Edit,
        versions: Option<&[i64]>,
    ) -> Result<Option<std::result::Result<Job, i64>>> {
        let mut change = self.control_change().await?;
        let Some(job) = with_id(change.sql(), owners, id).await? else {
            return Ok(None);
        };
        if versions.is_some_and(|versions| !versions.contains(&job.version)) {
            return Ok(Some(Err(job.version)));
        }
        let key = job.key;
        let name = edit.name.as_ref().unwrap_or(&job.name);
        let labels = edit.labels.as_ref().unwrap_or(&job.labels);
        let priority = edit.priority.unwrap_or(job.priority);
        let pinned = edit.pinned.unwrap_or(job.pinned);
        let same = *name == job.name
            && *labels == job.labels
            && priority == job.priority
            && pinned == job.pinned;
        if !same {
            sqlx::query(
                "update job set name = ?, labels = ?, priority = ?, pinned = ?, version = version + 1,
                                checksum = null where id = ?",
            )
            .bind(name)
            .bind(serde_json::to_string(labels)?)
            .bind(priority)
            .bind(pinned)
            .bind(key)
            .execute(change.sql())
            .await?;
            change.touched(key);
            if *labels != job.labels {
                sqlx::query("delete from job_label where job_id = ?")
                    .bind(key)
                    .execute(change.sql())
                    .await?;
                labels::write(&mut change, key, &job.owner, job.created_at, labels).await?;
            }
            if job.waits_for_a_worker() && priority != job.priority {
                let place = Place::of(&job);
                change.move_job(Move::Leave(place.clone()));
                change.move_job(Move::Enter(Place { priority, ..place }));
                coalescing::replace_if_outranked(&mut change, key, priority).await?;
            }
            if let Some(source) = job.coalesced_into {
                coalescing::detach_if_ahead(&mut change, &job, source, priority).await?;
            }
        }
        let edited = read(change.sql(), key).await?;
        change.commit().await?;
        let mut edited = [edited];
        self.try_complete(&mut edited).await;
        let [edited] = edited;
        Ok(Some(Ok(edited)))
    }
}
