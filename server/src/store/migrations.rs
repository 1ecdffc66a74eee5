//! The tables and their history: `migrations/`, compiled in.

use std::borrow::Cow;

use sqlx::{
    SqlSafeStr,
    migrate::{Migration, MigrationType, Migrator},
};

/// Every step, with the name of its file. They are listed here instead of found by `sqlx::migrate!`, which would
/// compile sqlx and SQLite a second time for the compiler to run; a test compares the list with the folder.
const STEPS: [(i64, &str, &str); 6] = [
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
        "memory",
        include_str!("../../../migrations/0006_memory.sql"),
    ),
];

/// The steps that bring the tables of an older version up to date.
pub(super) fn migrator() -> Migrator {
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
    Migrator::with_migrations(STEPS.map(migration).to_vec())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use std::path::Path;

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
