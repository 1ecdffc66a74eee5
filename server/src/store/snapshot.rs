//! Reading the result of a job.

use std::sync::Arc;

use sqlx::{Sqlite, Transaction};

use super::{
    damage::Damages,
    database::Store,
    error::Result,
    intact::{self, Intact, PartInfo},
    parts::{ProfilePoints, profile_part},
    rows::with_id,
};
use crate::{
    caller::Owners,
    job::{Job, JobId},
};

impl Store {
    /// A job and its result at one moment: the parts may be replaced while the job runs, and are removed when it is
    /// deleted.
    pub async fn snapshot(&self, owners: Owners<'_>, id: JobId) -> Result<Option<Snapshot>> {
        let read = async {
            let mut tx = self.reader.begin().await?;
            let job = with_id(&mut tx, owners, id).await?;
            if job.is_none() {
                self.damages.indexes_are_intact()?;
            }
            Ok(job.map(|job| Snapshot {
                job,
                tx,
                damages: self.damages.clone(),
                intact: self.intact.clone(),
            }))
        };
        self.damages.noting(read).await
    }

    /// One piece of a part, from 0; `None` after the last.
    pub async fn piece(&self, key: i64, part: &str, piece: i64) -> Result<Option<Vec<u8>>> {
        let read = async {
            let mut connection = self.reader.acquire().await?;
            intact::piece(&mut connection, key, part, piece).await
        };
        self.damages.noting(read).await
    }
}

/// A job and its result at one moment. It holds a connection, and should be dropped soon.
pub struct Snapshot {
    /// The job, without its queue position.
    pub job: Job,
    tx: Transaction<'static, Sqlite>,
    damages: Arc<Damages>,
    intact: Arc<Intact>,
}

impl Snapshot {
    /// Size and hash of a part that is served in pieces. The whole is read before, so that damage is found before the
    /// first byte is sent; of the result of a job that has ended, once.
    pub async fn checked_part_info(&mut self, part: &'static str) -> Result<Option<PartInfo>> {
        let (key, tx) = (self.job.result_key, &mut self.tx);
        let intact = self.intact.contains(key, part);
        let read = async {
            if intact && let Some((info, _)) = intact::part_info(tx, key, part).await? {
                return Ok(Some(info));
            }
            intact::read_part(tx, key, part, |_| ()).await
        };
        let info = self.damages.noting(read).await?;
        // that of a running job is replaced
        if info.is_some() && self.job.status.is_terminal() {
            self.intact.insert(key, part);
        }
        Ok(info)
    }

    /// A whole part.
    pub async fn part(&mut self, part: &str) -> Result<Option<Vec<u8>>> {
        let mut whole = vec![];
        let read = intact::read_part(&mut self.tx, self.job.result_key, part, |piece| {
            whole.extend_from_slice(&piece);
        });
        let found = self.damages.noting(read).await?;
        Ok(found.map(|_| whole))
    }

    /// The profile of a boundary, at the end or at the end of a load step (from 0).
    pub async fn profile(
        &mut self,
        boundary: &str,
        points: ProfilePoints,
        step: Option<usize>,
    ) -> Result<Option<Vec<u8>>> {
        self.part(&profile_part(boundary, points, step)).await
    }

    /// The boundaries that have a profile.
    pub async fn profiled_boundaries(&mut self) -> Result<Vec<String>> {
        let prefix = profile_part("", ProfilePoints::Nodes, None);
        let names: Vec<String> = sqlx::query_scalar(
            "select name from result_part where job_id = ? and piece = 0 and substr(name, 1, ?) = ? order by name",
        )
        .bind(self.job.result_key)
        .bind(prefix.len() as i64)
        .bind(&prefix)
        .fetch_all(&mut *self.tx)
        .await?;
        Ok(names
            .iter()
            .map(|name| name[prefix.len()..].to_string())
            .collect())
    }
}
