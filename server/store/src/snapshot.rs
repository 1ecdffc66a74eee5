//! Reads the result of a job.

use parking_lot::Mutex;
use std::sync::Arc;

use base::{
    caller::Owners,
    job::{Job, JobId},
};
use rusqlite::Connection;
use solver::solution::Fields;

use super::{
    connections::{Lease, blocking},
    content::name,
    damage::{Damages, Table},
    database::Store,
    encoding::{Decoded, PartInfo},
    error::{Record, Result},
    events,
    parts::{ProfilePoints, profile_part},
    results::StoredResult,
    rows::with_id,
};

impl Store {
    /// The size and hash of the JSON of this job's fields, if the fields were read whole and found intact before.
    pub async fn fields_info(self: &Arc<Self>, key: i64) -> Result<Option<PartInfo>> {
        self.read(move |store, connection| {
            let tx = connection.unchecked_transaction()?;
            let found = StoredResult::of(&tx, key)?;
            let fields = found.as_ref().and_then(StoredResult::fields);
            let intact = fields.filter(|(content, _)| store.intact.content.contains(content));
            Ok(intact.map(|(_, info)| info.clone()))
        })
        .await
    }

    /// The largest memory (bytes) that reading the fields of this job takes; `None` if it has none.
    pub async fn fields_memory(self: &Arc<Self>, key: i64) -> Result<Option<usize>> {
        self.part_memory(key, name::FIELDS).await
    }

    /// The fields of this job, and the size and hash of their JSON.
    pub async fn fields(self: &Arc<Self>, key: i64) -> Result<Option<(PartInfo, Fields)>> {
        self.read(move |store, connection| {
            let tx = connection.unchecked_transaction()?;
            let Some(found) = StoredResult::of(&tx, key)? else {
                return Ok(None);
            };
            let Some((info, decoded)) = found.read(&tx, name::FIELDS)? else {
                return Ok(None);
            };
            let fields = match decoded {
                Decoded::Fields(fields) => *fields,
                Decoded::Json(json) => serde_json::from_slice(&json)
                    .map_err(|error| Record::of_job(key, name::FIELDS).damaged(error))?,
            };
            if let Some((content, _)) = found.fields() {
                store.intact.content.insert(content);
            }
            Ok(Some((info, fields)))
        })
        .await
    }

    /// A job and its result at one moment: the parts may be replaced while the job runs, and are removed when the job
    /// is deleted.
    pub async fn snapshot(self: &Arc<Self>, owners: Owners, id: JobId) -> Result<Option<Snapshot>> {
        let (lease, store) = (self.reader.turn().await?, self.clone());
        blocking(move || {
            let taken = Snapshot::take(&store, lease, &owners, id);
            store.damages.noting(taken)
        })
        .await
    }
}

/// A job and its result at one moment. It holds a connection, and should be dropped soon.
pub struct Snapshot {
    /// The job, without its queue position.
    pub job: Job,
    /// What is stored of the job; a thread that may block has it while it reads.
    stored: Arc<Mutex<Stored>>,
    damages: Arc<Damages>,
}

/// The stored state of the database at one moment.
struct Stored {
    moment: Moment,
    /// The result of the job, once it was read.
    result: Option<StoredResult>,
}

/// A connection in a transaction that sees one state of the database.
struct Moment(Lease);

impl Moment {
    fn begin(mut lease: Lease) -> Result<Moment> {
        lease.get()?.execute_batch("begin")?;
        Ok(Moment(lease))
    }

    fn connection(&mut self) -> Result<&Connection> {
        self.0.get()
    }
}

impl Drop for Moment {
    fn drop(&mut self) {
        let is_over = |connection: &Connection| {
            connection.is_autocommit() || connection.execute_batch("rollback").is_ok()
        };
        if !self.0.get().is_ok_and(is_over) {
            self.0.discard(); // the next one would see this state
        }
    }
}

impl Snapshot {
    fn take(store: &Store, lease: Lease, owners: &Owners, id: JobId) -> Result<Option<Snapshot>> {
        let mut moment = Moment::begin(lease)?;
        let Some(job) = with_id(moment.connection()?, owners, id)? else {
            store.damages.have_all(&[Table::Jobs])?;
            return Ok(None);
        };
        let result = None;
        Ok(Some(Snapshot {
            job,
            stored: Arc::new(Mutex::new(Stored { moment, result })),
            damages: store.damages.clone(),
        }))
    }

    /// The JSON of a part of the result, if the result has this part.
    pub async fn part(&mut self, part: &str) -> Result<Option<Vec<u8>>> {
        let part = part.to_owned();
        let read = self.read_result(move |result, connection| {
            Ok(match result.read(connection, &part)? {
                Some((_, Decoded::Json(json))) => Some(json),
                Some((_, Decoded::Fields(fields))) => Some(serde_json::to_vec(&fields)?),
                None => None,
            })
        });
        Ok(read.await?.flatten())
    }

    /// The JSON of the profile of a boundary, at the end of the problem or of a load step (from 0).
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
        let names = self.read_result(|result, _| {
            let prefix = profile_part("", ProfilePoints::Nodes, None);
            let names = result.names();
            let boundaries = names.filter_map(|name| name.strip_prefix(&prefix));
            let mut boundaries: Vec<String> = boundaries.map(str::to_owned).collect();
            boundaries.sort_unstable();
            Ok(boundaries)
        });
        Ok(names.await?.unwrap_or_default())
    }

    /// The iterations of the job's current attempt, each as the number and the JSON of its event, in order; at most
    /// `most` of them, evenly distributed.
    pub async fn iterations(&mut self, most: Option<usize>) -> Result<Vec<(i64, String)>> {
        let (key, attempt) = (self.job.key, self.job.attempt);
        self.read(move |stored| events::iterations(stored.moment.connection()?, key, attempt, most))
            .await
    }

    /// Runs a query about the result, if there is one.
    async fn read_result<T: Send + 'static>(
        &mut self,
        query: impl FnOnce(&StoredResult, &Connection) -> Result<T> + Send + 'static,
    ) -> Result<Option<T>> {
        let key = self.job.key;
        self.read(move |stored| {
            let connection = stored.moment.connection()?;
            if stored.result.is_none() {
                stored.result = StoredResult::of(connection, key)?;
            }
            let result = stored.result.as_ref();
            result.map(|result| query(result, connection)).transpose()
        })
        .await
    }

    async fn read<T: Send + 'static>(
        &mut self,
        query: impl FnOnce(&mut Stored) -> Result<T> + Send + 'static,
    ) -> Result<T> {
        let (stored, damages) = (self.stored.clone(), self.damages.clone());
        blocking(move || {
            let mut stored = stored.lock();
            damages.noting(query(&mut stored))
        })
        .await
    }
}
