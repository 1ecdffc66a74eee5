//! Editing a job: its name and labels, its priority, whether it is pinned.

use std::{collections::BTreeMap, mem};

use super::{coalescing, database::Store, error::Result, labels, rows::with_id};
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

impl Edit {
    fn apply(&self, job: &mut Job) {
        job.name = self.name.clone().unwrap_or_else(|| job.name.take());
        job.labels = self
            .labels
            .clone()
            .unwrap_or_else(|| mem::take(&mut job.labels));
        job.priority = self.priority.unwrap_or(job.priority);
        job.pinned = self.pinned.unwrap_or(job.pinned);
    }
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
        let Some(job) = with_id(change.sql().await?, owners, id).await? else {
            return Ok(None);
        };
        if versions.is_some_and(|versions| !versions.contains(&job.version)) {
            return Ok(Some(Err(job.version)));
        }
        let key = job.key;
        let edited = change.set(key, |row| edit.apply(&mut row.job)).await?;
        if edited.labels != job.labels {
            labels::replace(&mut change, &edited).await?;
        }
        if edited.waits_for_a_worker() && edited.priority != job.priority {
            coalescing::replace_if_outranked(&mut change, key).await?;
        }
        if let Some(primary) = edited.coalesced_into {
            coalescing::detach_if_ahead(&mut change, &edited, primary).await?;
        }
        let edited = change.read(key).await?;
        change.commit().await?;
        let mut edited = [edited];
        self.try_complete(&mut edited).await;
        let [edited] = edited;
        Ok(Some(Ok(edited)))
    }
}
