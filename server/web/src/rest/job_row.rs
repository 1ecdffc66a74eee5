//! The rows of lists of jobs: a job without its links, or with some of its fields.

use std::{collections::BTreeSet, sync::Arc};

use base::job::Job;
use serde::{Serialize, Serializer, ser::Error};

/// A job with some of its fields.
pub(super) struct JobRow(Job, Option<Arc<BTreeSet<&'static str>>>);

impl Serialize for JobRow {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let JobRow(job, fields) = self;
        let Some(fields) = fields else {
            return job.serialize(serializer);
        };
        let job = serde_json::to_value(job).map_err(S::Error::custom)?;
        let all = job.as_object().into_iter().flatten();
        serializer.collect_map(all.filter(|(name, _)| fields.contains(name.as_str())))
    }
}

/// The row of a job in a list: with these fields, or with all but its links, which are more than half of it.
pub(super) fn row(mut job: Job, fields: Option<&Arc<BTreeSet<&'static str>>>) -> JobRow {
    if fields.is_none() {
        job.links.clear();
    }
    JobRow(job, fields.cloned())
}
