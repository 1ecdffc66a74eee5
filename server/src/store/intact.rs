//! What was found intact: content that was read whole and found as it was written, since the store was opened.

use std::{
    collections::HashSet,
    sync::{Mutex, PoisonError},
};

use rusqlite::Connection;

use super::{
    content::{Content, name},
    error::{Record, Result},
};

/// The numbers of such content: what answers other jobs is checked once. Numbers are never used again. The older half is
/// forgotten when there are many.
#[derive(Debug, Default)]
pub(super) struct Intact(Mutex<[HashSet<i64>; 2]>);

impl Intact {
    const MOST: usize = 10_000;

    pub(super) fn contains(&self, content: i64) -> bool {
        let halves = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        halves.iter().any(|half| half.contains(&content))
    }

    pub(super) fn insert(&self, content: i64) {
        let mut halves = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if halves[0].len() >= Self::MOST {
            halves.swap(0, 1);
            halves[0].clear();
        }
        halves[0].insert(content);
    }
}

/// Compares the content of a result with its hash, without decoding it, which would take a hundred times as long: what is in
/// it is compared when it is served. What was found intact before is not read again.
pub(super) fn check_result(
    connection: &Connection,
    intact: &Intact,
    key: i64,
    attached: Vec<Content>,
) -> Result<()> {
    if !attached.iter().any(|content| content.name == name::RESULT) {
        return Err(Record::of_job(key, name::RESULT).damaged("it is missing"));
    }
    for content in attached {
        if name::OF_RESULT.contains(&content.name.as_str()) {
            check(connection, intact, &content)?;
        }
    }
    Ok(())
}

/// Compares content with its hash, unless it was found intact before.
pub(super) fn check(connection: &Connection, intact: &Intact, content: &Content) -> Result<()> {
    if !intact.contains(content.id) {
        let checked = content.check(connection);
        checked.map_err(|error| error.reading(|| content.record()))?;
        intact.insert(content.id);
    }
    Ok(())
}
