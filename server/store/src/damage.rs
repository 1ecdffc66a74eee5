//! The record of what was found damaged: damage is told to the client whose request meets it, once in the log, and by
//! `/readyz`.

use parking_lot::Mutex;
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, OnceLock},
};

use base::job::JobId;
use uuid::Uuid;

use super::{
    connections::Connections,
    error::{Damage, Record, Result, StoreError},
    sql::Sql,
};

/// The largest number of damaged records that are remembered; the log has all of them.
const MOST: usize = 1000;

/// The tables whose rows are found by a key, a name or a hash, so that a damaged index hides rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Table {
    Jobs,
    Labels,
    Keys,
    Meshes,
    Sweeps,
    Deleted,
    Attachments,
}

impl Table {
    /// The error that this table is damaged.
    pub(super) fn damaged(self, cause: impl ToString) -> StoreError {
        let of = match self {
            Table::Jobs => "jobs",
            Table::Labels => "labels",
            Table::Keys => "request keys",
            Table::Meshes => "meshes",
            Table::Sweeps => "sweeps",
            Table::Deleted => "deleted jobs",
            Table::Attachments => "attached content",
        };
        Record::named(format!("index of the {of}")).damaged(cause)
    }
}

/// The damaged records that were found since the store was opened.
#[derive(Debug)]
pub(super) struct Damages {
    found: Mutex<BTreeMap<Record, (Uuid, Option<JobId>)>>,
    /// Damaged tables: a row that is not found in them may exist nevertheless.
    tables: Mutex<BTreeSet<Table>>,
    /// The fingerprints of requests whose key was damaged.
    suspects: Mutex<BTreeSet<String>>,
    /// The damage because of which nothing is written any more, if there is such damage.
    broken: OnceLock<String>,
    /// The connections that find the public ids of damaged jobs.
    reader: Arc<Connections>,
}

impl Damages {
    pub(super) fn new(reader: Arc<Connections>) -> Self {
        Damages {
            found: Mutex::default(),
            tables: Mutex::default(),
            suspects: Mutex::default(),
            broken: OnceLock::new(),
            reader,
        }
    }

    /// Records the damage if a query has failed because of damage; returns its result.
    pub(super) fn noting<T>(&self, found: Result<T>) -> Result<T> {
        match found {
            Err(StoreError::Damaged(damage)) => {
                Err(StoreError::Damaged(Box::new(self.note(*damage))))
            }
            other => other,
        }
    }

    /// Stops all writing, because this damage prevents every write; returns the error of later writes.
    pub(super) fn stop_writing(&self, damage: &Damage) -> StoreError {
        let incident = damage.incident.unwrap_or_default();
        let text = format!(
            "{damage}, incident {incident}: no more data are stored and no more jobs are started; stop the service and run \
             `signorini doctor`"
        );
        if self.broken.set(text.clone()).is_ok() {
            tracing::error!(%incident, "{text}");
        }
        StoreError::Broken(text)
    }

    /// An error if all writing was stopped.
    pub(super) fn can_write(&self) -> Result<()> {
        match self.broken.get() {
            Some(text) => Err(StoreError::Broken(text.clone())),
            None => Ok(()),
        }
    }

    /// Records damage: at the first time it is logged, under an incident number that stays the same.
    pub(super) fn note(&self, mut damage: Damage) -> Damage {
        if damage.incident.is_some() {
            return damage;
        }
        if let Some((incident, job)) = self.found().get(&damage.record) {
            damage.incident = Some(*incident);
            damage.job = damage.job.or(*job);
            return damage;
        }
        if damage.job.is_none() {
            damage.job = self.public_id(damage.record.job);
        }
        let incident = Uuid::now_v7();
        damage.incident = Some(incident);
        let job = damage.job.map(|id| id.to_string()).unwrap_or_default();
        tracing::error!(
            job.id = job, record = damage.record.name, %incident, cause = damage.cause,
            "incident {incident}: {damage}: {}; stop the service and run `signorini doctor`", damage.cause
        );
        let mut found = self.found();
        if found.len() < MOST {
            found.insert(damage.record.clone(), (incident, damage.job));
        }
        damage
    }

    fn public_id(&self, key: Option<i64>) -> Option<JobId> {
        // whoever asks may hold the last connection
        let mut connection = self.reader.free()?;
        let connection = connection.get().ok()?;
        let uuid = "select uuid from job where id = ?";
        let uuid: Option<String> = connection.optional_value(uuid, [key?]).ok()?;
        Uuid::try_parse(&uuid?).ok().map(JobId::from)
    }

    /// The number of damaged records, and the incident numbers of the first few.
    pub(super) fn summary(&self) -> (usize, Vec<Uuid>) {
        const SHOWN: usize = 10;
        let found = self.found();
        let incidents = found.values().map(|(incident, _)| *incident);
        (found.len(), incidents.take(SHOWN).collect())
    }

    /// Records that a table was found damaged, or differs from its indexes.
    pub(super) fn note_table(&self, table: Table, cause: &str) {
        {
            let mut tables = self.tables.lock();
            tables.insert(table);
        }
        if let StoreError::Damaged(damage) = table.damaged(cause) {
            self.note(*damage);
        }
    }

    /// An error if one of these tables is damaged: a row that was not found in it may exist nevertheless.
    pub(super) fn have_all(&self, tables: &[Table]) -> Result<()> {
        let damaged = self.tables.lock();
        match tables.iter().find(|table| damaged.contains(table)) {
            Some(table) => Err(table.damaged("")),
            None => Ok(()),
        }
    }

    /// Records that a damaged request key has this fingerprint.
    pub(super) fn suspect(&self, payload: String) {
        let mut suspects = self.suspects.lock();
        if suspects.len() < MOST {
            suspects.insert(payload);
        }
    }

    /// An error if a request key with this fingerprint may exist although it was not found.
    pub(super) fn have_all_keys(&self, payload: &str) -> Result<()> {
        self.have_all(&[Table::Keys])?;
        let suspects = self.suspects.lock();
        if suspects.contains(payload) {
            Err(Table::Keys.damaged(""))
        } else {
            Ok(())
        }
    }

    fn found(&self) -> parking_lot::MutexGuard<'_, BTreeMap<Record, (Uuid, Option<JobId>)>> {
        self.found.lock()
    }
}
