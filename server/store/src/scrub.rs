//! Reads the tables whose rows are found by a key, a name or a hash, at the start and then once a day, in the
//! background: the service would say that a row does not exist which an index lacks, or whose key has changed. A
//! request key counts as new only after the keys were read once.
//!
//! Events, and content attached to jobs and meshes, are too large for this, and are never searched by their content.
//! They are compared with their checksums when they are read, and by `doctor`.

use std::{path::Path, sync::Weak, time::Duration};

use rusqlite::{Connection, Row, params};

use super::{
    connections::{Mode, blocking, open},
    damage::Table,
    database::Store,
    error::{Record, Result, StoreError},
    keys, meshes, rows,
    sql::Sql,
    sweeps,
};

/// The time between two readings.
const PAUSE: Duration = Duration::from_secs(86_400);
/// How often a table that cannot be read, for lack of memory or of files, is read again.
const TRIES: u32 = 5;
/// The time between two tries to read a table that cannot be read.
const BEFORE_ANOTHER: Duration = Duration::from_secs(1);
/// The number of jobs that are read at a time.
const JOBS_AT_ONCE: i64 = 500;
/// The pause after these jobs, in which other work has the processors.
const BETWEEN: Duration = Duration::from_millis(20);

/// The name of an index in errors; its damage hides no request key.
const BY_JOB: &str = "index of the request keys by job";

/// A function that returns an error if a row is damaged.
type Check = fn(&Row<'_>) -> Result<()>;

/// The tables with few or small rows, each with the check of a row, if its rows have a checksum and are not read
/// elsewhere.
const TABLES: [(Table, &str, Option<Check>); 9] = [
    (Table::Keys, "request_key", Some(keys::check)),
    (Table::Jobs, "job", None),
    (Table::Labels, "job_label", None),
    (
        Table::Meshes,
        "mesh",
        Some(|row| meshes::described(row).map(drop)),
    ),
    (Table::Meshes, "mesh_owner", None),
    (
        Table::Sweeps,
        "sweep",
        Some(|row| sweeps::intact(row, row.get("id")?)),
    ),
    (Table::Deleted, "deleted_job", None),
    (Table::Deleted, "deleted_sweep", None),
    (Table::Attachments, "attachment", None),
];

impl Store {
    /// Waits until the request keys were read once since the store was opened.
    pub(super) async fn keys_were_read(&self) {
        // an error: the store is closed
        let _ = self.keys_read.subscribe().wait_for(|read| *read).await;
    }
}

/// Reads the tables again and again, until the store is dropped.
pub(super) async fn scrub(store: Weak<Store>) {
    while store.strong_count() > 0 {
        read_once(&store).await;
        tokio::time::sleep(PAUSE).await;
    }
}

/// Reads all of the tables once.
pub(super) async fn read_once(store: &Weak<Store>) {
    let Some(file) = store.upgrade().map(|store| store.folder.database()) else {
        return;
    };
    for (table, name, check) in TABLES {
        let mut read = read_table(store, &file, (table, name, check)).await;
        for _ in 1..TRIES {
            if matches!(read, Ok(()) | Err(StoreError::Damaged(_))) || store.strong_count() == 0 {
                break;
            }
            tokio::time::sleep(BEFORE_ANOTHER).await;
            read = read_table(store, &file, (table, name, check)).await;
        }
        let Some(store) = store.upgrade() else { return };
        match read {
            Err(StoreError::Damaged(damage)) if damage.record.name != BY_JOB => {
                store.damages.note_table(table, &damage.cause);
            }
            Err(StoreError::Damaged(damage)) => drop(store.damages.note(*damage)),
            Err(cause) => tracing::warn!(
                %cause,
                "reading the table {name} failed {TRIES} times: {cause}; it will be checked for damage again in 24 hours"
            ),
            Ok(()) => {}
        }
        if table == Table::Keys {
            store.keys_read.send_replace(true);
        }
    }
    let _ = read_jobs(store).await; // what is damaged was noted
    if let Some(store) = store.upgrade() {
        let _ = store.compare_sums().await;
    }
}

/// Compares a table with its indexes, and its rows with their checksums.
async fn read_table(
    store: &Weak<Store>,
    file: &Path,
    (table, name, check): (Table, &'static str, Option<Check>),
) -> Result<()> {
    let (store, file) = (store.clone(), file.to_owned());
    blocking(move || {
        let connection = open(&file, Mode::Read)?;
        let compared = indexes(&connection, table, name);
        match check {
            // what hides something counts more
            Some(check) => rows_of(&store, &connection, (table, name), check).and(compared),
            None => compared,
        }
    })
    .await
}

fn indexes(connection: &Connection, table: Table, name: &str) -> Result<()> {
    // a few findings are enough
    let found: Vec<String> = connection.values(&format!("pragma integrity_check({name})"), ())?;
    // keys are looked for in the table itself, whose rows are compared below
    let hides_nothing = |line: &str| {
        table == Table::Keys && line.ends_with("missing from index request_key_by_job")
    };
    let mut found = found.iter().filter(|line| *line != "ok").peekable();
    let Some(first) = found.peek().copied() else {
        return Ok(());
    };
    match found.find(|line| !hides_nothing(line)) {
        Some(line) => Err(table.damaged(line)),
        None => Err(Record::named(BY_JOB).damaged(first)),
    }
}

fn rows_of(
    store: &Weak<Store>,
    connection: &Connection,
    (table, name): (Table, &str),
    check: Check,
) -> Result<()> {
    let mut statement = connection.prepare(&format!("select * from {name}"))?;
    let mut rows = statement.query(())?;
    let mut last = None;
    while let Some(row) = rows.next()? {
        if table == Table::Keys {
            let place: (String, String) = (row.get("owner")?, row.get("key")?);
            if last.as_ref().is_some_and(|last| *last >= place) {
                return Err(table.damaged("its rows are not in order"));
            }
            last = Some(place);
        }
        let Err(error) = check(row) else { continue };
        let Some(store) = store.upgrade() else {
            return Ok(());
        };
        match (store.damages.noting(Err(error)), table) {
            // only a submit of the same content can be the one that it was written for
            (Err(StoreError::Damaged(_)), Table::Keys) => {
                store
                    .damages
                    .suspect(row.get("payload").unwrap_or_default());
            }
            (Err(other), _) => return Err(other),
            (Ok(()), _) => {}
        }
    }
    Ok(())
}

/// Reads the records of all jobs, and records damage.
async fn read_jobs(store: &Weak<Store>) -> Result<()> {
    let mut after = 0;
    loop {
        let Some(store) = store.upgrade() else {
            return Ok(());
        };
        let read = store.read_list(move |store, connection| {
            let jobs = "select * from job where id > ? order by id limit ?";
            connection.rows(jobs, params![after, JOBS_AT_ONCE], |row| {
                let _ = store.damages.noting(rows::from_row(row));
                Ok(row.get("id")?)
            })
        });
        let found: Vec<i64> = read.await?;
        let Some(last) = found.last() else {
            return Ok(());
        };
        after = *last;
        drop(store);
        tokio::time::sleep(BETWEEN).await;
    }
}
