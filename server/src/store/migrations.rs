//! The tables and their history: `migrations/`, compiled in.

use std::{borrow::Cow, collections::BTreeMap, path::Path};

use sqlx::{
    Connection, SqlSafeStr, SqliteConnection, SqlitePool,
    migrate::{Migration, MigrationType, Migrator},
};

use super::{
    error::{Result, StoreError},
    model_files, old_content,
};

/// Every step, with the name of its file. They are listed here instead of found by `sqlx::migrate!`, which would
/// compile sqlx and SQLite a second time for the compiler to run; a test compares the list with the folder.
const STEPS: [(i64, &str, &str); 18] = [
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
];

/// The version of the tables of this program.
pub(super) fn last_step() -> i64 {
    STEPS.last().map_or(0, |(version, ..)| *version)
}

/// Brings the tables of the store in this folder up to date, and checks that they are those of this version.
pub(super) async fn run(database: &SqlitePool, folder: &Path) -> Result<()> {
    model_files::write(&mut *database.acquire().await?, folder).await?;
    if !has_step(&mut *database.acquire().await?, CONTENT + 1).await? {
        migrator_to(CONTENT).run(database).await?;
        old_content::move_all(database).await?;
    }
    migrator().run(database).await?;
    let mut connection = database.acquire().await?;
    let found = schema(&mut connection).await?;
    let mut empty = SqliteConnection::connect("sqlite::memory:")
        .await
        .map_err(StoreError::from)?;
    migrator().run_direct(None, &mut empty, false).await?;
    let expected = schema(&mut empty).await?;
    for (name, sql) in &expected {
        if found.get(name) != Some(sql) {
            return Err(StoreError::Schema(format!(
                "the store does not belong to this program, or is damaged: {name} is missing or different"
            )));
        }
    }
    Ok(())
}

/// An error if the tables are of a later version, or not of this program. Nothing is written.
pub(super) async fn check(connection: &mut SqliteConnection) -> Result<()> {
    let ours: bool = sqlx::query_scalar(
        "select exists (select 1 from sqlite_schema where name = '_sqlx_migrations')
                or not exists (select 1 from sqlite_schema)",
    )
    .fetch_one(&mut *connection)
    .await?;
    if !ours {
        return Err(StoreError::Schema(
            "the database does not belong to this program".into(),
        ));
    }
    let applied = "select exists (select 1 from sqlite_schema where name = '_sqlx_migrations')";
    if !sqlx::query_scalar::<_, bool>(applied)
        .fetch_one(&mut *connection)
        .await?
    {
        return Ok(());
    }
    let applied: Vec<(i64, Vec<u8>)> =
        sqlx::query_as("select version, checksum from _sqlx_migrations order by version")
            .fetch_all(connection)
            .await?;
    let known = migrator();
    for (version, checksum) in applied {
        match known.iter().find(|step| step.version == version) {
            None => {
                return Err(StoreError::Schema(format!(
                    "the store was written by a later version of this program (its tables have step {version}, the last one known \
                     here is {}); use that version",
                    STEPS.last().map_or(0, |(version, ..)| *version)
                )));
            }
            Some(step) if step.checksum[..] != checksum[..] => {
                return Err(StoreError::Schema(format!(
                    "the store does not belong to this program, or is damaged: step {version} of its tables is different"
                )));
            }
            Some(_) => {}
        }
    }
    Ok(())
}

/// An error if the tables are of an earlier version.
pub(super) async fn are_current(connection: &mut SqliteConnection) -> Result<()> {
    let steps: i64 = sqlx::query_scalar("select count(*) from _sqlx_migrations")
        .fetch_one(&mut *connection)
        .await?;
    match steps == STEPS.len() as i64 {
        true => Ok(()),
        false => Err(StoreError::Schema(
            "the store is of an earlier version of this program: start the service on it once to update it".into(),
        )),
    }
}

/// The statements that made the tables and indexes, by name.
async fn schema(connection: &mut SqliteConnection) -> Result<BTreeMap<String, Option<String>>> {
    let all: Vec<(String, Option<String>)> =
        sqlx::query_as("select name, sql from sqlite_schema where name not like 'sqlite_stat%'")
            .fetch_all(connection)
            .await?;
    Ok(all.into_iter().collect())
}

/// The step after which `old_content` moves what earlier versions stored.
pub(super) const CONTENT: i64 = 17;

/// Whether the tables have this step.
async fn has_step(connection: &mut SqliteConnection, version: i64) -> Result<bool> {
    let any = "select exists (select 1 from sqlite_schema where name = '_sqlx_migrations')";
    if !sqlx::query_scalar(any).fetch_one(&mut *connection).await? {
        return Ok(false);
    }
    let step = "select exists (select 1 from _sqlx_migrations where version = ?)";
    let step = sqlx::query_scalar(step).bind(version);
    Ok(step.fetch_one(connection).await?)
}

/// All steps: they bring the tables of an older version up to date.
pub(super) fn migrator() -> Migrator {
    migrator_to(last_step())
}

/// The steps up to this one.
pub(super) fn migrator_to(last: i64) -> Migrator {
    let migration = |(version, description, sql): (i64, &'static str, &'static str)| {
        let description = Cow::Borrowed(description);
        let without_transaction = false;
        Migration::new(
            version,
            description,
            MigrationType::Simple,
            sql.into_sql_str(),
            without_transaction,
        )
    };
    let steps = STEPS.into_iter().filter(|(version, ..)| *version <= last);
    Migrator::with_migrations(steps.map(migration).collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[tokio::test]
    async fn every_file_of_the_folder_is_a_step_under_its_name() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../migrations");
        let files = Migrator::new(folder).await.unwrap();
        let fields = |migrator: &Migrator| -> Vec<_> {
            let steps = migrator.iter().cloned();
            steps
                .map(|m| {
                    (
                        m.version,
                        m.description,
                        m.migration_type,
                        m.checksum,
                        m.no_tx,
                    )
                })
                .collect()
        };
        assert_eq!(fields(&migrator()), fields(&files));
    }
}
