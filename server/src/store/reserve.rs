//! Space that is kept free for control: a file that is removed when the disk is full, so that jobs can still be
//! canceled and deleted, and the queue paused. As long as it is missing, nothing else is written.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Write},
    os::unix::fs::OpenOptionsExt,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
};

use super::error::{Result, StoreError};

/// The name of the file.
pub(super) const FILE: &str = "signorini.reserve";

/// Four times what the write-ahead log grows by before SQLite reuses it: a thousand pages of 4 KiB.
const BYTES: u64 = 16 << 20;

/// With less than this the disk is full: a submit takes some ten kilobytes.
const LEAST: u64 = 256 << 10;

/// The file, if it is there.
#[derive(Debug)]
pub(super) struct Reserve {
    path: PathBuf,
    held: AtomicBool,
}

impl Reserve {
    /// Takes the space, if there is some.
    pub(super) fn new(folder: &Path) -> Reserve {
        let reserve = Reserve {
            path: folder.join(FILE),
            held: AtomicBool::new(false),
        };
        reserve.retake(); // if not, the watch tells
        reserve
    }

    /// An error if the disk is full but for what control needs.
    pub(super) fn has_room(&self) -> Result<()> {
        match self.held.load(Ordering::Acquire) {
            true => Ok(()),
            false => Err(StoreError::Full),
        }
    }

    /// Whether the disk is full, also if the space is not needed yet.
    pub(super) fn is_disk_full(&self) -> bool {
        let folder = self.path.parent();
        let free = folder.and_then(|folder| rustix::fs::statvfs(folder).ok());
        self.has_room().is_err()
            || free.is_some_and(|free| free.f_bavail.saturating_mul(free.f_frsize) < LEAST)
    }

    /// Frees the space; false if that was done before.
    pub(super) fn release(&self) -> bool {
        if !self.held.swap(false, Ordering::AcqRel) {
            return false;
        }
        match fs::remove_file(&self.path) {
            Ok(()) => true,
            Err(error) => {
                tracing::warn!(%error, "{}: {error}", self.path.display());
                false
            }
        }
    }

    /// Takes the space again, once there is some; false if there is none. Blocks.
    pub(super) fn retake(&self) -> bool {
        if self.held.load(Ordering::Acquire) {
            return true;
        }
        match allocate(&self.path) {
            Ok(()) => {
                self.held.store(true, Ordering::Release);
                true
            }
            Err(error) => {
                tracing::debug!(%error, "{}: {error}", self.path.display());
                let _ = fs::remove_file(&self.path); // a part of it, or nothing
                false
            }
        }
    }
}

fn allocate(path: &Path) -> io::Result<()> {
    if fs::metadata(path).is_ok_and(|found| found.len() == BYTES) {
        return Ok(()); // of the last run
    }
    let mut file: File = OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(true)
        .mode(0o600)
        .open(path)?;
    let none = rustix::fs::FallocateFlags::empty();
    match rustix::fs::fallocate(&file, none, 0, BYTES) {
        Ok(()) => Ok(()),
        // the file system cannot: the space is taken by writing
        Err(rustix::io::Errno::OPNOTSUPP) => {
            let block = vec![0; 1 << 20];
            for _ in 0..BYTES >> 20 {
                file.write_all(&block)?;
            }
            file.sync_data()
        }
        Err(error) => Err(error.into()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::os::unix::fs::MetadataExt;

    use super::*;

    #[test]
    fn a_reserve_occupies_its_space_until_it_is_released() {
        let folder = tempfile::tempdir().unwrap();
        let reserve = Reserve::new(folder.path());
        let found = fs::metadata(folder.path().join(FILE)).unwrap();
        assert!(found.blocks() * 512 >= BYTES, "{}", found.blocks());
        reserve.has_room().unwrap();
        assert!(reserve.release());
        assert!(!folder.path().join(FILE).exists());
        assert!(matches!(reserve.has_room(), Err(StoreError::Full)));
        assert!(!reserve.release());
        assert!(reserve.retake());
        reserve.has_room().unwrap();
    }
}
