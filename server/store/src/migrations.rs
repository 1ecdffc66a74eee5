//! The tables and the steps that brought them to their present form: `migrations/`, compiled in.

use std::{cmp::Ordering, collections::BTreeMap, path::Path, time::Instant};

use rusqlite::{Connection, params};
use sha2::{Digest, Sha256, Sha384};

use super::{
    error::{Result, StoreError},
    model_files, old_content,
    sql::Sql,
};

/// The table that lists the applied steps. Its name, columns and checksums are those of sqlx, with which earlier
/// versions applied the steps.
const APPLIED: &str = "create table if not exists _sqlx_migrations (
    version BIGINT PRIMARY KEY,
    description TEXT NOT NULL,
    installed_on TIMESTAMP NOT NULL DEFAULT CURRENT_TIMESTAMP,
    success BOOLEAN NOT NULL,
    checksum BLOB NOT NULL,
    execution_time BIGINT NOT NULL
)";

/// All steps, each with its version, name and text; a test compares the list with the folder `migrations`.
const STEPS: [(i64, &str, &str); 22] = [
    (1, "jobs", include_str!("../../../migrations/0001_jobs.sql")),
    (
        2,
        "meshes",
        include_str!("../../../migrations/0002_meshes.sql"),
    ),
    (
        3,
        "job api",
        include_str!("../../../migrations/0003_job_api.sql"),
    ),
    (
        4,
        "owners",
        include_str!("../../../migrations/0004_owners.sql"),
    ),
    (
        5,
        "coalesced jobs",
        include_str!("../../../migrations/0005_coalesced_jobs.sql"),
    ),
    (
        6,
        "digests",
        include_str!("../../../migrations/0006_digests.sql"),
    ),
    (
        7,
        "memory",
        include_str!("../../../migrations/0007_memory.sql"),
    ),
    (
        8,
        "sweeps",
        include_str!("../../../migrations/0008_sweeps.sql"),
    ),
    (
        9,
        "tokens",
        include_str!("../../../migrations/0009_tokens.sql"),
    ),
    (
        10,
        "space",
        include_str!("../../../migrations/0010_space.sql"),
    ),
    (
        11,
        "warnings",
        include_str!("../../../migrations/0011_warnings.sql"),
    ),
    (
        12,
        "models",
        include_str!("../../../migrations/0012_models.sql"),
    ),
    (
        13,
        "owners lists",
        include_str!("../../../migrations/0013_owners_lists.sql"),
    ),
    (
        14,
        "no models",
        include_str!("../../../migrations/0014_no_models.sql"),
    ),
    (
        15,
        "sealed jobs",
        include_str!("../../../migrations/0015_sealed_jobs.sql"),
    ),
    (
        16,
        "one index a filter",
        include_str!("../../../migrations/0016_one_index_a_filter.sql"),
    ),
    (
        17,
        "content",
        include_str!("../../../migrations/0017_content.sql"),
    ),
    (
        18,
        "only content",
        include_str!("../../../migrations/0018_only_content.sql"),
    ),
    (
        19,
        "turns",
        include_str!("../../../migrations/0019_turns.sql"),
    ),
    (
        20,
        "verdicts",
        include_str!("../../../migrations/0020_verdicts.sql"),
    ),
    (
        21,
        "run times",
        include_str!("../../../migrations/0021_run_times.sql"),
    ),
    (
        22,
        "leases",
        include_str!("../../../migrations/0022_leases.sql"),
    ),
];

/// The digest of the definitions that all steps make, by which a start knows them without making them; a test compares it.
const DEFINITIONS: &str = "886d4126c4df571d70d9c22d3953ac195c3cb8257381d495a3d84a3736e4aa6a";

/// The version of the tables that this program uses.
pub(super) fn last_step() -> i64 {
    STEPS.last().map_or(0, |(version, ..)| *version)
}

/// Brings the tables of the store in this folder up to date, and checks that they are those of this version.
pub(super) fn run(database: &Connection, folder: &Path) -> Result<()> {
    model_files::write(database, folder)?;
    if !has_step(database, CONTENT + 1)? {
        run_to(database, CONTENT)?;
        old_content::move_all(database)?;
    }
    run_to(database, last_step())?;
    match differing(database)?.first() {
        Some(name) => Err(StoreError::Schema(format!(
            "the store does not belong to this program, or is damaged: {name} is missing or different"
        ))),
        None => Ok(()),
    }
}

/// The names of tables and indexes of this version that a database does not have, or that it defines in another way.
pub(super) fn differing(database: &Connection) -> Result<Vec<String>> {
    let found = schema(database)?;
    if digest(&found) == DEFINITIONS {
        return Ok(vec![]);
    }
    let empty = Connection::open_in_memory()?;
    run_to(&empty, last_step())?;
    let mut expected = schema(&empty)?;
    expected.retain(|name, sql| found.get(name) != Some(sql));
    Ok(expected.into_keys().collect())
}

/// An error if the tables are of a later version, or of another program. Nothing is written.
pub(super) fn check(connection: &Connection) -> Result<()> {
    if !is_listed(connection)? {
        return if connection.value("select exists (select 1 from sqlite_schema)", ())? {
            Err(StoreError::Schema(
                "the database does not belong to this program".into(),
            ))
        } else {
            Ok(())
        };
    }
    let applied: Vec<(i64, Vec<u8>)> = connection.rows(
        "select version, checksum from _sqlx_migrations order by version",
        (),
        |row| Ok(row.try_into()?),
    )?;
    for (version, found) in applied {
        match STEPS.iter().find(|(step, ..)| *step == version) {
            None => return Err(later(version)),
            Some((.., sql)) if checksum(sql) != found => {
                return Err(StoreError::Schema(format!(
                    "the store does not belong to this program, or is damaged: step {version} of its tables is different"
                )));
            }
            Some(_) => {}
        }
    }
    Ok(())
}

fn later(version: i64) -> StoreError {
    StoreError::Schema(format!(
        "the store was written by a later version of this program (its tables have step {version}, the last one known here is {}); \
         use that version",
        last_step()
    ))
}

/// An error if the tables are of an earlier or a later version. If the list of steps is missing, the error is one of
/// the database.
pub(super) fn are_current(connection: &Connection) -> Result<()> {
    let last = "select coalesce(max(version), 0) from _sqlx_migrations";
    let last: i64 = connection.value(last, ())?;
    match last.cmp(&last_step()) {
        Ordering::Equal => Ok(()),
        Ordering::Greater => Err(later(last)),
        Ordering::Less => Err(StoreError::Schema(
            "the store is of an earlier version of this program: start the service on it once to update it".into(),
        )),
    }
}

/// The statements that made the tables and indexes, by the name of the table or index. They are bytes, since damaged ones may
/// be no text.
fn schema(connection: &Connection) -> Result<BTreeMap<String, Option<Vec<u8>>>> {
    let all = "select name, cast(sql as blob) from sqlite_schema
               where name not like 'sqlite_stat%' and name not like '%_sqlx_migrations%'";
    let all = connection.rows(all, (), |row| Ok(row.try_into()?))?;
    Ok(all.into_iter().collect())
}

/// A digest of definitions.
fn digest(schema: &BTreeMap<String, Option<Vec<u8>>>) -> String {
    let mut hash = Sha256::new();
    for (name, sql) in schema {
        for part in [name.as_bytes(), sql.as_deref().unwrap_or_default()] {
            hash.update((part.len() as u64).to_le_bytes());
            hash.update(part);
        }
    }
    base::digest::hex(&hash.finalize())
}

/// The version of the step after which `old_content` moves what earlier versions stored.
pub(super) const CONTENT: i64 = 17;

/// Whether the database has the table that lists the applied steps.
fn is_listed(connection: &Connection) -> Result<bool> {
    let any = "select exists (select 1 from sqlite_schema where name = '_sqlx_migrations')";
    connection.value(any, ())
}

/// Whether the step with this version was applied.
fn has_step(connection: &Connection, version: i64) -> Result<bool> {
    let step = "select exists (select 1 from _sqlx_migrations where version = ?)";
    Ok(is_listed(connection)? && connection.value(step, [version])?)
}

/// Applies the steps up to the version `last` that were not applied yet, each in a transaction.
pub(super) fn run_to(connection: &Connection, last: i64) -> Result<()> {
    connection.execute_batch(APPLIED)?;
    check(connection)?;
    for (version, description, sql) in STEPS {
        if version > last || has_step(connection, version)? {
            continue;
        }
        let start = Instant::now();
        let tx = connection.unchecked_transaction()?;
        tx.execute_batch(sql)?;
        let took = i64::try_from(start.elapsed().as_nanos()).unwrap_or(i64::MAX);
        tx.run(
            "insert into _sqlx_migrations (version, description, success, checksum, execution_time)
             values (?, ?, true, ?, ?)",
            params![version, description, checksum(sql), took],
        )?;
        tx.commit()?;
    }
    Ok(())
}

fn checksum(sql: &str) -> Vec<u8> {
    Sha384::digest(sql).to_vec()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn the_digest_is_that_of_what_the_steps_make() {
        let database = Connection::open_in_memory().unwrap();
        run_to(&database, last_step()).unwrap();
        assert_eq!(digest(&schema(&database).unwrap()), DEFINITIONS);
        database
            .execute_batch("drop index job_queue; create index job_queue on job (id)")
            .unwrap();
        assert_eq!(differing(&database).unwrap(), ["job_queue"]);
    }

    #[test]
    fn every_file_of_the_folder_is_a_step_under_its_name() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../migrations");
        let files = std::fs::read_dir(folder).unwrap();
        let files = files.map(|file| file.unwrap().path());
        let mut files: Vec<_> = files
            .map(|file| {
                let name = file.file_name().unwrap().to_str().unwrap().to_owned();
                (name, std::fs::read_to_string(file).unwrap())
            })
            .collect();
        files.sort_unstable();
        let steps = STEPS.iter().map(|(version, description, sql)| {
            let name = format!("{version:04}_{}.sql", description.replace(' ', "_"));
            (name, (*sql).to_owned())
        });
        assert_eq!(files, steps.collect::<Vec<_>>());
    }
}
