//! Counts uploads that are arriving, in total and for each owner, and their bytes, which no table of the database has
//! yet.

use parking_lot::{Mutex, MutexGuard};
use std::{collections::BTreeMap, sync::Arc};

use crate::error::ApiError;

/// The largest number of simultaneous uploads. Each has a buffer and up to two nameless files, for which
/// `listener/files` reserves descriptors.
const MOST: usize = 32;
/// The largest number of simultaneous uploads of one owner, if there are several owners.
const MOST_OF_OWNER: usize = 8;

/// The uploads that are arriving, by owner.
#[derive(Debug, Default)]
pub(super) struct Uploads(Mutex<BTreeMap<String, Arriving>>);

/// The uploads of one owner that are arriving.
#[derive(Debug, Default)]
struct Arriving {
    number: usize,
    /// The bytes of the mesh files that have arrived so far.
    file_bytes: u64,
    /// The bytes of the meshes that were read from mesh files, and are about to be stored.
    mesh_bytes: u64,
}

/// One upload, until it is stored or given up.
#[derive(Debug)]
pub(super) struct Upload {
    uploads: Arc<Uploads>,
    owner: String,
    file_bytes: u64,
    mesh_bytes: u64,
}

impl Uploads {
    /// Counts an upload that begins; an error if a limit is reached. `shared`: whether there are several owners.
    pub(super) fn begin(
        self: &Arc<Uploads>,
        owner: &str,
        shared: bool,
    ) -> Result<Upload, ApiError> {
        let mut all = self.all();
        let number: usize = all.values().map(|of_owner| of_owner.number).sum();
        let of_owner = all.get(owner).map_or(0, |of_owner| of_owner.number);
        if shared && of_owner >= MOST_OF_OWNER {
            let owner = Some(owner.to_owned());
            let most = MOST_OF_OWNER;
            return Err(ApiError::TooManyUploads { owner, most });
        }
        if number >= MOST {
            let (owner, most) = (None, MOST);
            return Err(ApiError::TooManyUploads { owner, most });
        }
        all.entry(owner.to_owned()).or_default().number += 1;
        Ok(Upload {
            uploads: self.clone(),
            owner: owner.to_owned(),
            file_bytes: 0,
            mesh_bytes: 0,
        })
    }

    fn all(&self) -> MutexGuard<'_, BTreeMap<String, Arriving>> {
        self.0.lock()
    }
}

impl Upload {
    /// Counts bytes that have arrived of this upload's file; returns the bytes of all files of its owner that are
    /// arriving.
    pub(super) fn arrived(&mut self, bytes: usize) -> u64 {
        self.file_bytes += bytes as u64;
        let mut all = self.uploads.all();
        let of_owner = all.entry(self.owner.clone()).or_default();
        of_owner.file_bytes += bytes as u64;
        of_owner.file_bytes
    }

    /// Counts the mesh that was read from this upload's file; called once. Returns the bytes of all meshes of its owner
    /// that are about to be stored.
    pub(super) fn read(&mut self, mesh_bytes: u64) -> u64 {
        self.mesh_bytes += mesh_bytes;
        let mut all = self.uploads.all();
        let of_owner = all.entry(self.owner.clone()).or_default();
        of_owner.mesh_bytes += mesh_bytes;
        of_owner.mesh_bytes
    }
}

impl Drop for Upload {
    fn drop(&mut self) {
        let mut all = self.uploads.all();
        if let Some(of_owner) = all.get_mut(&self.owner) {
            of_owner.number = of_owner.number.saturating_sub(1);
            of_owner.file_bytes = of_owner.file_bytes.saturating_sub(self.file_bytes);
            of_owner.mesh_bytes = of_owner.mesh_bytes.saturating_sub(self.mesh_bytes);
            if of_owner.number == 0 {
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
        assert!(matches!(
            uploads.begin("ada", true),
            Err(ApiError::TooManyUploads {
                owner: Some(_),
                most: MOST_OF_OWNER
            })
        ));
        let mut of_bob = uploads.begin("bob", true).unwrap();
        assert_eq!(of_ada[0].arrived(10), 10);
        assert_eq!(of_ada[1].arrived(5), 15);
        assert_eq!(of_bob.arrived(1), 1);
        assert_eq!((of_ada[0].read(100), of_ada[1].read(50)), (100, 150));
        drop(of_ada.remove(0));
        let mut another = uploads.begin("ada", true).unwrap();
        assert_eq!((another.arrived(2), another.read(1)), (7, 51));
        drop((another, of_ada, of_bob));
        assert!(uploads.all().is_empty());
    }

    #[test]
    fn the_only_owner_may_have_all_of_them() {
        let uploads = Arc::new(Uploads::default());
        let all: Vec<Upload> = (0..MOST)
            .map(|_| uploads.begin("local", false).unwrap())
            .collect();
        for (owner, shared) in [("local", false), ("another", true)] {
            assert!(matches!(
                uploads.begin(owner, shared),
                Err(ApiError::TooManyUploads {
                    owner: None,
                    most: MOST
                })
            ));
        }
        drop(all);
        assert!(uploads.begin("local", false).is_ok());
    }
}
