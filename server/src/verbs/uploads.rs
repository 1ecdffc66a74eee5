//! Uploads that are arriving: how many at once, of all owners and of each, and their bytes, which are in no table yet.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

/// Uploads at once. Each has up to two files without a name, of those that `listener/files` keeps free, and a buffer.
const MOST: usize = 32;
/// Of one owner, where there are several.
const MOST_OF_OWNER: usize = 8;

/// The uploads that are arriving, by owner: how many, and their bytes.
#[derive(Debug, Default)]
pub(super) struct Uploads(Mutex<BTreeMap<String, (usize, u64)>>);

/// One of them, until it is stored or given up.
#[derive(Debug)]
pub(super) struct Upload {
    uploads: Arc<Uploads>,
    owner: String,
    bytes: u64,
}

impl Uploads {
    /// Counts an upload that begins; `None`: there are as many as there may be.
    pub(super) fn begin(self: &Arc<Uploads>, owner: &str, shared: bool) -> Option<Upload> {
        let mut all = self.all();
        let number: usize = all.values().map(|(number, _)| number).sum();
        let of_owner = all.get(owner).map_or(0, |(number, _)| *number);
        if number >= MOST || (shared && of_owner >= MOST_OF_OWNER) {
            return None;
        }
        all.entry(owner.to_owned()).or_default().0 += 1;
        Some(Upload {
            uploads: self.clone(),
            owner: owner.to_owned(),
            bytes: 0,
        })
    }

    fn all(&self) -> MutexGuard<'_, BTreeMap<String, (usize, u64)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Upload {
    /// Counts bytes that have arrived; returns those of all uploads of its owner.
    pub(super) fn arrived(&mut self, bytes: usize) -> u64 {
        let bytes = bytes as u64;
        self.bytes += bytes;
        let mut all = self.uploads.all();
        let (_, of_owner) = all.entry(self.owner.clone()).or_default();
        *of_owner += bytes;
        *of_owner
    }
}

impl Drop for Upload {
    fn drop(&mut self) {
        let mut all = self.uploads.all();
        if let Some((number, bytes)) = all.get_mut(&self.owner) {
            *number = number.saturating_sub(1);
            *bytes = bytes.saturating_sub(self.bytes);
            if *number == 0 {
                all.remove(&self.owner);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn an_owner_leaves_room_for_the_uploads_of_others() {
        let uploads = Arc::new(Uploads::default());
        let mut of_ada: Vec<Upload> = (0..MOST_OF_OWNER)
            .map(|_| uploads.begin("ada", true).unwrap())
            .collect();
        assert!(uploads.begin("ada", true).is_none());
        let mut of_bob = uploads.begin("bob", true).unwrap();
        assert_eq!(of_ada[0].arrived(10), 10);
        assert_eq!(of_ada[1].arrived(5), 15);
        assert_eq!(of_bob.arrived(1), 1);
        drop(of_ada.remove(0));
        let mut another = uploads.begin("ada", true).unwrap();
        assert_eq!(another.arrived(2), 7);
        drop((another, of_ada, of_bob));
        assert!(uploads.all().is_empty());
    }

    #[test]
    fn the_only_owner_may_have_all_of_them() {
        let uploads = Arc::new(Uploads::default());
        let all: Vec<Upload> = (0..MOST)
            .map(|_| uploads.begin("local", false).unwrap())
            .collect();
        assert!(uploads.begin("local", false).is_none());
        assert!(uploads.begin("another", true).is_none());
        drop(all);
        assert!(uploads.begin("local", false).is_some());
    }
}
