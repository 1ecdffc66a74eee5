//! Fields that are held in memory while they are sent, shared by all requests for them.

use parking_lot::Mutex;
use std::{
    collections::HashMap,
    ops::Deref,
    sync::{Arc, Weak},
};

use solver::solution::Fields;
use store::PartInfo;

use crate::transfer::Share;

/// The fields of one result in memory, with their share of the limit on answers.
#[derive(Debug)]
pub(super) struct LoadedFields {
    /// The size and hash of the fields' JSON.
    pub(super) info: PartInfo,
    pub(super) fields: Fields,
    pub(super) _share: Share,
}

/// The fields that are being sent, by the key of their job.
#[derive(Debug, Default)]
pub(super) struct FieldsInMemory(Mutex<HashMap<i64, Weak<LoadedFields>>>);

impl FieldsInMemory {
    pub(super) fn find(&self, key: i64) -> Option<Arc<LoadedFields>> {
        let all = self.0.lock();
        all.get(&key)?.upgrade()
    }

    pub(super) fn insert(&self, key: i64, loaded: &Arc<LoadedFields>) {
        let mut all = self.0.lock();
        all.retain(|_, loaded| loaded.strong_count() > 0);
        all.insert(key, Arc::downgrade(loaded));
    }
}

/// The fields in memory in the form in which the writer of their JSON takes them.
pub(super) struct Shared(pub(super) Arc<LoadedFields>);

impl Deref for Shared {
    type Target = Fields;

    fn deref(&self) -> &Fields {
        &self.0.fields
    }
}
