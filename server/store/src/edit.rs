//! Editing a job: its name and labels, its priority, whether it is pinned.

use std::{collections::BTreeMap, mem, sync::Arc};

use base::{
    caller::Owners,
    job::{Job, JobId},
};

use super::{
    coalescing,
    database::{Store, Writer},
    error::Result,
    labels,
    rows::with_id,
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
        self: &Arc<Self>,
        owners: Owners,
        id: JobId,
        edit: &Edit,
        versions: Option<&[i64]>,
    ) -> Result<Option<std::result::Result<Job, i64>>> {
        let (edit, versions) = (edit.clone(), versions.map(<[i64]>::to_vec));
        self.control(move |writer| try_to_edit(writer, &owners, id, &edit, versions.as_deref()))
            .await
    }
}

fn try_to_edit(
    writer: &Writer<'_>,
    owners: &Owners,
    id: JobId,
    edit: &Edit,
    versions: Option<&[i64]>,
) -> Result<Option<std::result::Result<Job, i64>>> {
    let mut change = writer.control_change()?;
    let Some(job) = with_id(change.sql()?, owners, id)? else {
        return Ok(None);
    };
    if versions.is_some_and(|versions| !versions.contains(&job.version)) {
        return Ok(Some(Err(job.version)));
    }
    let key = job.key;
    let edited = change.set(key, |row| edit.apply(&mut row.job))?;
    if edited.labels != job.labels {
        labels::replace(&mut change, &edited)?;
    }
    if edited.waits_for_a_worker() && edited.priority != job.priority {
        coalescing::replace_if_outranked(&mut change, key)?;
    }
    if let Some(primary) = edited.coalesced_into {
        coalescing::detach_if_ahead(&mut change, &edited, primary)?;
    }
    let mut edited = change.read(key)?;
    change.commit()?;
    let store = writer.store;
    store.try_to_complete(writer.connection(), &mut [&mut edited]);
    Ok(Some(Ok(edited)))
}
