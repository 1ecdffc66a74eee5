//! Labels in a table of their own, for searches.

use std::collections::BTreeMap;

use super::{change::Change, error::Result};
use crate::time::Time;

/// Writes the labels of a job of this owner.
pub(super) async fn write(
    change: &mut Change<'_>,
    key: i64,
    owner: &str,
    created_at: Time,
    labels: &BTreeMap<String, String>,
) -> Result<()> {
    for (name, value) in labels {
        sqlx::query(
            "insert into job_label (key, value, created_at, job_id, owner) values (?, ?, ?, ?, ?)",
        )
        .bind(name)
        .bind(value)
        .bind(created_at.micros())
        .bind(key)
        .bind(owner)
        .execute(change.sql())
        .await?;
    }
    Ok(())
}
