//! Reads what is found by a key, a name or a hash, at the start and then once a day, beside the work: what an index lacks, or
//! whose key has changed, would be said not to exist. Before a request key is said to be new the keys were read once.
//!
//! Events and what is attached to jobs and meshes are too large for it. Of them nothing is found by its content: they are
//! compared when they are read, and by `doctor`.

use std::{sync::Weak, time::Duration};

use futures_util::TryStreamExt;
use sqlx::{
    ConnectOptions, Connection, Row, SqliteConnection,
    sqlite::{SqliteConnectOptions, SqliteRow},
};

use super::{
    damage::Table,
    database::Store,
    error::{Record, Result, StoreError},
    keys, meshes, rows, sweeps,
};

/// How long after one reading the next begins.
const PAUSE: Duration = Duration::from_secs(86_400);
/// A table that cannot be read, for lack of memory or of files, is read once more, so often and after such a time.
const TRIES: u32 = 5;
const BEFORE_ANOTHER: Duration = Duration::from_secs(1);
/// Jobs that are read at a time, and the pause after them: others need the processors, too.
const JOBS_AT_ONCE: i64 = 500;
const BETWEEN: Duration = Duration::from_millis(20);

/// What is found by a job, and hides no key.
const BY_JOB: &str = "index of the request keys by job";

/// What is wrong with a row.
type Check = fn(&SqliteRow) -> Result<()>;

/// Tables whose rows are few, or small, with the check of a row if it has a checksum.
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
        Some(|row| sweeps::intact(row, row.try_get("id")?)),
    ),
    (Table::Deleted, "deleted_job", None),
    (Table::Deleted, "deleted_sweep", None),
    (Table::Attachments, "attachment", None),
];

impl Store {
    /// Waits until the request keys were read once.
    pub(super) async fn keys_were_read(&self) {
        // an error: the store is closed
        let _ = self.keys_read.subscribe().wait_for(|read| *read).await;
    }
}

/// Reads all of it, until the store is dropped.
pub(super) async fn scrub(store: Weak<Store>) {
    while store.strong_count() > 0 {
        read_once(&store).await;
        tokio::time::sleep(PAUSE).await;
    }
}

/// Reads all of it once.
pub(super) async fn read_once(store: &Weak<Store>) {
    let Some(options) = store.upgrade().map(|store| store.reader.connect_options()) else {
        return;
    };
    for (table, name, check) in TABLES {
        let mut read = read_table(store, &options, (table, name, check)).await;
        for _ in 1..TRIES {
            if matches!(read, Ok(()) | Err(StoreError::Damaged(_))) || store.strong_count() == 0 {
                break;
            }
            tokio::time::sleep(BEFORE_ANOTHER).await;
            read = read_table(store, &options, (table, name, check)).await;
        }
        let Some(store) = store.upgrade() else { return };
        match read {
            Err(StoreError::Damaged(damage)) if damage.record.name != BY_JOB => {
                store.damages.note_table(table, &damage.cause).await;
            }
            Err(StoreError::Damaged(damage)) => drop(store.damages.note(*damage).await),
            Err(cause) => tracing::warn!(
                %cause,
                "the table {name} could not be read {TRIES} times: {cause}; damage by the disk in it will be detected tomorrow"
            ),
            Ok(()) => {}
        }
        if table == Table::Keys {
            store.keys_read.send_replace(true);
        }
    }
    let _ = read_jobs(store).await; // what is damaged was noted
    if let Some(store) = store.upgrade() {
        let _ = store.damages.noting(store.compare_sums()).await;
    }
}

/// Compares a table with its indexes, and its rows with their checksums.
async fn read_table(
    store: &Weak<Store>,
    options: &SqliteConnectOptions,
    (table, name, check): (Table, &str, Option<Check>),
) -> Result<()> {
    let mut connection = options.connect().await?;
    let mut compared = indexes(&mut connection, table, name).await;
    if let Some(check) = check {
        let rows = rows_of(store, &mut connection, (table, name), check).await;
        // what hides something counts more
        compared = rows.and(compared);
    }
    connection.close().await?;
    compared
}

async fn indexes(connection: &mut SqliteConnection, table: Table, name: &str) -> Result<()> {
    // a few findings are enough
    let found: Vec<String> = sqlx::query_scalar(sqlx::AssertSqlSafe(format!(
        "pragma integrity_check({name})"
    )))
    .fetch_all(connection)
    .await?;
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

async fn rows_of(
    store: &Weak<Store>,
    connection: &mut SqliteConnection,
    (table, name): (Table, &str),
    check: Check,
) -> Result<()> {
    let mut rows =
        sqlx::query(sqlx::AssertSqlSafe(format!("select * from {name}"))).fetch(connection);
    let mut last = None;
    while let Some(row) = rows.try_next().await? {
        if table == Table::Keys {
            let place: (String, String) = (row.try_get("owner")?, row.try_get("key")?);
            if last.as_ref().is_some_and(|last| *last >= place) {
                return Err(table.damaged("its rows are not in order"));
            }
            last = Some(place);
        }
        let Err(error) = check(&row) else { continue };
        let Some(store) = store.upgrade() else {
            return Ok(());
        };
        let noted = store.damages.noting(async { Err::<(), _>(error) }).await;
        match (noted, table) {
            // only a submit of the same content can be the one that it was written for
            (Err(StoreError::Damaged(_)), Table::Keys) => {
                store
                    .damages
                    .suspect(row.try_get("payload").unwrap_or_default());
            }
            (Err(other), _) => return Err(other),
            (Ok(()), _) => {}
        }
    }
    Ok(())
}

/// Reads the records of all jobs.
async fn read_jobs(store: &Weak<Store>) -> Result<()> {
    let mut after = 0;
    loop {
        let Some(store) = store.upgrade() else {
            return Ok(());
        };
        let found = sqlx::query("select * from job where id > ? order by id limit ?")
            .bind(after)
            .bind(JOBS_AT_ONCE)
            .fetch_all(&store.lists)
            .await?;
        let Some(last) = found.last() else {
            return Ok(());
        };
        after = last.try_get("id")?;
        for row in &found {
            let _ = store.damages.noting(async { rows::from_row(row) }).await;
        }
        drop(store);
        tokio::time::sleep(BETWEEN).await;
    }
}
