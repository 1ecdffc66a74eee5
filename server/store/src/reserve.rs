//! A file that reserves space for control operations: it is removed or cut short when the disk is full, so that jobs
//! can still be canceled and deleted, and the queue paused. As long as the file does not have its full size, nothing
//! else is written. A part of it stays for the next start, which must write too, even on a disk that is full to its
//! last byte.

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

/// The size of the file (bytes): four times what the write-ahead log grows by before SQLite reuses it, which is a
/// thousand pages of 4 KiB.
const BYTES: u64 = 16 << 20;

/// The size of the part that stays for the next start (bytes): room for the index of a write-ahead log of the usual
/// size or more, and for what a start writes about jobs that were running.
const FOR_A_START: u64 = 2 << 20;

/// The free space (bytes) below which the disk counts as full: a submission takes some ten kilobytes.
const LEAST: u64 = 256 << 10;

/// The file that reserves space on the disk.
#[derive(Debug)]
pub(super) struct Reserve {
    path: PathBuf,
    held: AtomicBool,
    /// Whether the disk was full at the last check.
    full: AtomicBool,
}

impl Reserve {
    /// Reserves the space. If there is too little, removes the file, and if the disk has no other space left, cuts the
    /// file short: this start needs the space.
    pub(super) fn new(folder: &Path) -> Reserve {
        let reserve = Reserve {
            path: folder.join(FILE),
            held: AtomicBool::new(false),
            full: AtomicBool::new(false),
        };
        if !reserve.retake() {
            let _ = fs::remove_file(&reserve.path); // the watch tells that there is no space
        } else if reserve.is_disk_full() {
            reserve.release(); // it was taken by the last run, and others have taken what was left
        }
        reserve
    }

    /// An error if the disk has no space except for control operations.
    pub(super) fn has_room(&self) -> Result<()> {
        if self.held.load(Ordering::Acquire) {
            Ok(())
        } else {
            Err(StoreError::Full)
        }
    }

    /// Whether the disk is full, even if the reserved space is not needed yet.
    pub(super) fn is_disk_full(&self) -> bool {
        let folder = self.path.parent();
        let free = folder.and_then(|folder| rustix::fs::statvfs(folder).ok());
        let full = self.has_room().is_err()
            || free.is_some_and(|free| free.f_bavail.saturating_mul(free.f_frsize) < LEAST);
        self.full.store(full, Ordering::Relaxed);
        full
    }

    /// Whether the disk was full at the last check, at most a second ago; it does not ask the file system.
    pub(super) fn was_disk_full(&self) -> bool {
        self.full.load(Ordering::Relaxed)
    }

    /// Frees the reserved space except for what the next start needs; false if it was freed before.
    pub(super) fn release(&self) -> bool {
        if !self.held.swap(false, Ordering::AcqRel) {
            return false;
        }
        let file = OpenOptions::new().write(true).open(&self.path);
        match file.and_then(|file| file.set_len(FOR_A_START)) {
            Ok(()) => true,
            Err(error) => {
                tracing::warn!(%error, "{}: {error}", self.path.display());
                false
            }
        }
    }

    /// Reserves the space again; false if there is not enough. Blocks.
    pub(super) fn retake(&self) -> bool {
        if self.held.load(Ordering::Acquire) {
            return true;
        }
        match allocate(&self.path, BYTES) {
            Ok(()) => {
                self.held.store(true, Ordering::Release);
                true
            }
            Err(error) => {
                tracing::debug!(%error, "{}: {error}", self.path.display());
                false
            }
        }
    }

    /// Reserves what the next start needs, or as much of it as there is: this start may have used a part of it.
    pub(super) fn keep_for_a_start(&self) {
        for part in [1, 2, 4, 8] {
            match allocate(&self.path, FOR_A_START / part) {
                Ok(()) => return,
                Err(error) => tracing::debug!(%error, "{}: {error}", self.path.display()),
            }
        }
    }
}

/// Gives the file this size, unless it is at least as large. If that fails, the file is as it was before.
fn allocate(path: &Path, bytes: u64) -> io::Result<()> {
    let before = fs::metadata(path).map_or(0, |found| found.len());
    if before >= bytes {
        return Ok(()); // of the last run
    }
    let mut file: File = OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(false)
        .mode(0o600)
        .open(path)?;
    occupy(&mut file, bytes).inspect_err(|_| {
        let _ = match before {
            0 => fs::remove_file(path),
            _ => file.set_len(before),
        };
    })
}

fn occupy(file: &mut File, bytes: u64) -> io::Result<()> {
    match rustix::fs::fallocate(&*file, rustix::fs::FallocateFlags::empty(), 0, bytes) {
        Ok(()) => Ok(()),
        // the file system cannot: the space is taken by writing
        Err(rustix::io::Errno::OPNOTSUPP) => {
            let block = vec![0; 1 << 20];
            for _ in 0..bytes >> 20 {
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
        let occupied = || {
            let found = fs::metadata(folder.path().join(FILE)).unwrap();
            found.blocks() * 512
        };
        let reserve = Reserve::new(folder.path());
        assert!(occupied() >= BYTES, "{}", occupied());
        reserve.has_room().unwrap();
        assert!(reserve.release());
        assert!(
            (FOR_A_START..BYTES / 2).contains(&occupied()),
            "{}",
            occupied()
        );
        assert!(matches!(reserve.has_room(), Err(StoreError::Full)));
        assert!(!reserve.release());
        assert!(reserve.retake());
        reserve.has_room().unwrap();
        assert!(occupied() >= BYTES, "{}", occupied());
    }
    #[test]
    fn what_a_start_has_used_is_kept_for_the_next_one() {
        let folder = tempfile::tempdir().unwrap();
        let reserve = Reserve::new(folder.path());
        let path = folder.path().join(FILE);
        let bytes = || fs::metadata(&path).unwrap().len();
        reserve.keep_for_a_start();
        assert_eq!(bytes(), BYTES, "there is more");
        fs::remove_file(&path).unwrap(); // as a start does that finds no more
        reserve.keep_for_a_start();
        assert_eq!(bytes(), FOR_A_START);
    }
}
