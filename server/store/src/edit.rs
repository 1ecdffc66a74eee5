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

/// Changes to a job; absent fields leave the job as it is.
#[derive(Clone, Debug, Default)]
pub struct Edit {
    /// The new name, or `Some(None)` to remove it.
    pub name: Option<Option<String>>,
    /// The new labels, in place of all earlier ones.
    pub labels: Option<BTreeMap<String, String>>,
    /// The new priority, −10 … 10.
    pub priority: Option<i32>,
    /// Whether the job is pinned: never deleted because of its age or size.
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
    /// Edits a job: `edit` returns the changes, given the job as it is, or an error that is returned. `None` if there
    /// is no such job.
    pub async fn edit<E: Send + 'static>(
        self: &Arc<Self>,
        owners: Owners,
        id: JobId,
        edit: impl Fn(&Job) -> std::result::Result<Edit, E> + Send + 'static,
    ) -> Result<Option<std::result::Result<Job, E>>> {
        self.control(move |writer| try_to_edit(writer, &owners, id, &edit))
            .await
    }
}

fn try_to_edit<E>(
    writer: &Writer<'_>,
    owners: &Owners,
    id: JobId,
    edit: impl Fn(&Job) -> std::result::Result<Edit, E>,
) -> Result<Option<std::result::Result<Job, E>>> {
    let mut change = writer.control_change()?;
    let Some(job) = with_id(change.sql()?, owners, id)? else {
        return Ok(None);
    };
    let edit = match edit(&job) {
        Ok(edit) => edit,
        Err(refused) => return Ok(Some(Err(refused))),
    };
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
