//! The content that was read whole and found as it was written since the store was opened.

use parking_lot::{Mutex, MutexGuard};
use std::{borrow::Borrow, collections::HashSet, hash::Hash};

use rusqlite::Connection;

use super::{
    content::{Content, name},
    error::{Record, Result},
};

/// The content and the inputs that were found intact, so that a result that answers other jobs is checked only once.
#[derive(Debug, Default)]
pub(super) struct Intact {
    /// The ids of intact content; an id is never used again.
    pub(super) content: Recent<i64>,
    /// The hashes of inputs whose newest result was found intact.
    pub(super) inputs: Recent<String>,
}

/// A set whose older half is forgotten when it has many elements.
#[derive(Debug)]
pub(super) struct Recent<T>(Mutex<[HashSet<T>; 2]>);

impl<T> Default for Recent<T> {
    fn default() -> Self {
        Recent(Mutex::default())
    }
}

impl<T: Hash + Eq> Recent<T> {
    const MOST: usize = 10_000;

    pub(super) fn contains<Q: Hash + Eq + ?Sized>(&self, element: &Q) -> bool
    where
        T: Borrow<Q>,
    {
        self.halves().iter().any(|half| half.contains(element))
    }

    pub(super) fn insert(&self, element: T) {
        let mut halves = self.halves();
        if halves[0].len() >= Self::MOST {
            halves.swap(0, 1);
            halves[0].clear();
        }
        halves[0].insert(element);
    }

    pub(super) fn remove<Q: Hash + Eq + ?Sized>(&self, element: &Q)
    where
        T: Borrow<Q>,
    {
        for half in &mut *self.halves() {
            half.remove(element);
        }
    }

    fn halves(&self) -> MutexGuard<'_, [HashSet<T>; 2]> {
        self.0.lock()
    }
}

/// Compares the content of a result with its hash, unless it was found intact before. It is not decoded, which would
/// take a hundred times as long: the parts in it are checked when they are served.
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
    if !intact.content.contains(&content.id) {
        let checked = content.check(connection);
        checked.map_err(|error| error.reading(|| content.record()))?;
        intact.content.insert(content.id);
    }
    Ok(())
}
