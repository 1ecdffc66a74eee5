//! Reading the result of a job.

use std::sync::Arc;

use solver::solution::Fields;
use sqlx::{Sqlite, Transaction};

use super::{
    content::name,
    damage::{Damages, Table},
    database::Store,
    encoding::{Decoded, PartInfo},
    error::{Record, Result},
    parts::{ProfilePoints, profile_part},
    results::StoredResult,
    rows::with_id,
};
use crate::{
    caller::Owners,
    job::{Job, JobId, ResultAvailable},
};

impl Store {
    /// Size and hash of the JSON of the fields of this job, if they were read whole and found intact before.
    pub async fn fields_info(&self, key: i64) -> Result<Option<PartInfo>> {
        let read = async {
            let mut connection = self.reader.acquire().await?;
            let found = StoredResult::of(&mut connection, key).await?;
            let fields = found.as_ref().and_then(StoredResult::fields);
            let intact = fields.filter(|(content, _)| self.intact.contains(*content));
            Ok(intact.map(|(_, info)| info.clone()))
        };
        self.damages.noting(read).await
    }

    /// The memory that reading the fields of this job takes at most, in bytes; `None` if there are none.
    pub async fn fields_memory(&self, key: i64) -> Result<Option<usize>> {
        self.part_memory(key, name::FIELDS).await
    }

    /// The fields of this job, with size and hash of their JSON.
    pub async fn fields(&self, key: i64) -> Result<Option<(PartInfo, Fields)>> {
        let read = async {
            let mut connection = self.reader.acquire().await?;
            let Some(found) = StoredResult::of(&mut connection, key).await? else {
                return Ok(None);
            };
            let Some((content, _)) = found.fields() else {
                found.must_have_no_fields(&mut connection).await?;
                return Ok(None);
            };
            let Some((info, decoded)) = found.read(&mut connection, name::FIELDS).await? else {
                return Ok(None);
            };
            let fields = match decoded {
                Decoded::Fields(fields) => *fields,
                Decoded::Json(json) => serde_json::from_slice(&json)
                    .map_err(|error| Record::of_job(key, name::FIELDS).damaged(error))?,
            };
            self.intact.insert(content);
            Ok(Some((info, fields)))
        };
        self.damages.noting(read).await
    }

    /// A job and its result at one moment: the parts may be replaced while the job runs, and are removed when it is
    /// deleted.
    pub async fn snapshot(&self, owners: Owners<'_>, id: JobId) -> Result<Option<Snapshot>> {
        let read = async {
            let mut tx = self.reader.begin().await?;
            let job = with_id(&mut tx, owners, id).await?;
            if job.is_none() {
                self.damages.have_all(&[Table::Jobs])?;
            }
            Ok(job.map(|job| Snapshot {
                job,
                tx,
                result: None,
                damages: self.damages.clone(),
            }))
        };
        self.damages.noting(read).await
    }
}

/// A job and its result at one moment. It holds a connection, and should be dropped soon.
pub struct Snapshot {
    /// The job, without its queue position.
    pub job: Job,
    tx: Transaction<'static, Sqlite>,
    /// Once it was asked for.
    result: Option<StoredResult>,
    damages: Arc<Damages>,
}

impl Snapshot {
    /// The JSON of a part.
    pub async fn part(&mut self, part: &str) -> Result<Option<Vec<u8>>> {
        let damages = self.damages.clone();
        let read = async {
            self.read_index().await?;
            match &self.result {
                Some(result) => result.read(&mut self.tx, part).await,
                None => Ok(None),
            }
        };
        Ok(match damages.noting(read).await? {
            Some((_, Decoded::Json(json))) => Some(json),
            Some((_, Decoded::Fields(fields))) => Some(serde_json::to_vec(&fields)?),
            None => None,
        })
    }

    async fn read_index(&mut self) -> Result<()> {
        if self.result.is_none() {
            let key = self.job.key;
            self.result = StoredResult::of(&mut self.tx, key).await?;
            if self.result.is_none() && self.job.result_available != ResultAvailable::None {
                return Err(Record::of_job(key, name::RESULT).damaged("it is missing"));
            }
        }
        Ok(())
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
        let damages = self.damages.clone();
        damages.noting(self.read_index()).await?;
        let prefix = profile_part("", ProfilePoints::Nodes, None);
        let names = self.result.iter().flat_map(StoredResult::names);
        let boundaries = names.filter_map(|name| name.strip_prefix(&prefix));
        let mut boundaries: Vec<String> = boundaries.map(str::to_owned).collect();
        boundaries.sort_unstable();
        Ok(boundaries)
    }
}
