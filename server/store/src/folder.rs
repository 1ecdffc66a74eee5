//! The folder of a store: its files, who may read them, and the lock that keeps a second server out.

use parking_lot::Mutex;
use std::{
    fmt::Display,
    fs::{self, DirBuilder, File, OpenOptions, Permissions, TryLockError},
    io::{self, ErrorKind},
    os::unix::fs::{DirBuilderExt, FileExt, MetadataExt, OpenOptionsExt, PermissionsExt},
    path::{Path, PathBuf},
};

use super::{
    error::{Result, StoreError},
    progress, reserve,
};

/// The file of the database.
pub(super) const DATABASE: &str = "signorini.db";
/// The file of the write-ahead log, beside the database.
pub(super) const LOG: &str = "signorini.db-wal";
/// The size (bytes) to which the write-ahead log is cut where it begins anew: a thousand pages of 4 KiB, and the
/// largest transaction. It is longer only while a reader needs its older pages, as a backup does.
pub(super) const LOG_BYTES: u64 = 8 << 20;
/// SQLite's journal beside a database that is being created, before the database has a write-ahead log.
pub(super) const JOURNAL: &str = "signorini.db-journal";
/// The file that becomes the database when a restore is complete. If it exists, a restore was interrupted.
pub(super) const RESTORING: &str = "signorini.db.restoring";
/// The names of all files of a store.
pub(super) const FILES: [&str; 7] = [
    DATABASE,
    LOG,
    "signorini.db-shm",
    JOURNAL,
    progress::FILE,
    reserve::FILE,
    OLD_LOCK,
];
/// The file that earlier versions locked, which could be removed while the data stayed.
const OLD_LOCK: &str = "lock";

/// The error that a folder cannot be used.
pub(super) fn unusable(path: &Path, why: impl Display) -> StoreError {
    StoreError::Folder(format!("cannot use the folder {}: {why}", path.display()))
}

/// The folder of a store and the database in it, locked as long as this value exists.
#[derive(Debug)]
pub(super) struct Folder {
    path: PathBuf,
    /// The open files that hold the locks. The last one, that of the database, is closed after SQLite's files, like the
    /// file of `Identity`.
    locks: Vec<File>,
    has_database: bool,
}

impl Folder {
    /// Creates the folder if necessary, and locks the folder itself, since a lock file could be removed. A second
    /// server in the folder would run the same jobs.
    pub(super) fn lock(path: &Path) -> Result<Folder> {
        let named = |error: io::Error| match error.kind() {
            ErrorKind::AlreadyExists | ErrorKind::NotADirectory => {
                unusable(path, "it is not a folder")
            }
            _ => unusable(path, error),
        };
        DirBuilder::new()
            .recursive(true)
            .mode(0o700)
            .create(path)
            .map_err(named)?;
        let mut locks = vec![File::open(path).map_err(named)?];
        // a server of an earlier version may be running
        if let Ok(old) = OpenOptions::new().write(true).open(path.join(OLD_LOCK)) {
            locks.push(old);
        }
        for file in &locks {
            file.try_lock().map_err(|error| match error {
                TryLockError::WouldBlock => StoreError::Locked(format!(
                    "another server is using the folder {} (a stopping server releases it within seconds)",
                    path.display()
                )),
                TryLockError::Error(error) => named(error),
            })?;
        }
        let mut folder = Folder {
            path: path.to_owned(),
            locks,
            has_database: false,
        };
        folder.lock_database()?;
        Ok(folder)
    }

    /// Locks the database, if there is one: a second server may reach it by a link from another folder. A database that
    /// cannot be read is refused later.
    fn lock_database(&mut self) -> Result<()> {
        // elsewhere such a lock is one of those that SQLite takes, too
        if self.has_database || !cfg!(target_os = "linux") {
            return Ok(());
        }
        let Ok(file) = File::open(self.database()) else {
            return Ok(());
        };
        file.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => StoreError::Locked(format!(
                "another server is using the database {} through a link in another folder",
                self.database().display()
            )),
            TryLockError::Error(error) => unusable(&self.path, error),
        })?;
        self.has_database = true;
        self.locks.push(file);
        Ok(())
    }

    /// Unlocks the folder and the database for another server, once nothing is written any more.
    pub(super) fn unlock(&self) {
        for file in &self.locks {
            let _ = file.unlock(); // it ends with the file, too
        }
    }

    /// The path of the folder.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// An error if a restore to this folder was interrupted: the folder then has no store, or not the restored one.
    pub(super) fn is_complete(&self) -> Result<()> {
        if self.path.join(RESTORING).exists() {
            Err(StoreError::Folder(format!(
                "a restore to the folder {} was not completed: run `signorini restore` again, or remove {RESTORING} to go on \
                 with what else is in it",
                self.path.display()
            )))
        } else {
            Ok(())
        }
    }

    /// The path of the database.
    pub(super) fn database(&self) -> PathBuf {
        self.path.join(DATABASE)
    }

    /// Creates the database as an empty file for its owner alone, unless it exists. SQLite gives its other files the
    /// same mode.
    pub(super) fn prepare(&mut self) -> Result<()> {
        let created = OpenOptions::new()
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(self.database());
        match created {
            Ok(_) => self.lock_database(),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => self.lock_database(),
            Err(error) => Err(StoreError::Folder(format!(
                "cannot write to the folder {}: {error}",
                self.path.display()
            ))),
        }
    }

    /// Takes the access of other users to the files away, and to the folder if nothing else is in it.
    pub(super) fn tighten(&self) {
        let all = FILES.map(|name| self.path.join(name));
        let foreign = fs::read_dir(&self.path)
            .is_ok_and(|entries| entries.flatten().any(|entry| !all.contains(&entry.path())));
        let folder = (!foreign).then(|| self.path.clone());
        for path in all.iter().chain(&folder) {
            let Ok(found) = fs::metadata(path) else {
                continue;
            };
            let (mode, own) = (found.mode() & 0o7777, found.mode() & 0o700);
            if mode & 0o077 == 0 {
                continue;
            }
            match fs::set_permissions(path, Permissions::from_mode(own)) {
                Ok(()) => tracing::info!(
                    "{} was readable by other users (mode {mode:04o}), which was corrected (mode {own:04o})",
                    path.display()
                ),
                Err(error) => tracing::warn!(
                    %error, "{} is readable by other users (mode {mode:04o}): {error}", path.display()
                ),
            }
        }
    }
}

/// The files that the store has open, by which it notices when the files in its folder are no longer these.
#[derive(Debug)]
pub(super) struct Identity {
    database: PathBuf,
    log: PathBuf,
    /// The database, opened before SQLite opens it and closed after SQLite: to close any descriptor of the file
    /// releases the locks that SQLite holds on it.
    file: File,
    seen: Mutex<Seen>,
}

#[derive(Debug, Default)]
struct Seen {
    database: Option<(u64, u64)>,
    log: Option<(u64, u64)>,
    /// The last size of the database (bytes); it shrinks only when the store gives space back.
    bytes: u64,
    /// The size (bytes) to which the database may shrink when the log is next copied into it, after space was given
    /// back.
    least: Option<u64>,
    /// What is wrong with the files, as it was last logged.
    wrong: Option<String>,
}

impl Identity {
    /// Opens the file of the database, so that `check` can tell later whether it was removed, replaced or cut short.
    pub(super) fn of(folder: &Folder) -> Result<Identity> {
        let file = File::open(folder.database());
        let file = file.map_err(|error| {
            StoreError::Folder(format!(
                "cannot read {}: {error}",
                folder.database().display()
            ))
        })?;
        Ok(Identity {
            database: folder.database(),
            log: folder.path.join(LOG),
            file,
            seen: Mutex::default(),
        })
    }

    /// An error if the database or its log was removed, replaced or cut short: data that are written then are lost at
    /// the next start. It takes two calls of `stat`, some microseconds.
    pub(super) fn check(&self) -> Result<()> {
        let mut seen = self.seen.lock();
        let wrong = self.difference(&mut seen);
        if wrong != seen.wrong {
            match &wrong {
                Some(what) => tracing::error!(
                    "{what}; no data are stored until the service is started on a complete store"
                ),
                None => tracing::info!("the files of the store are available again"),
            }
            seen.wrong.clone_from(&wrong);
        }
        wrong.map_or(Ok(()), |what| Err(StoreError::Replaced(what)))
    }

    /// Allows the database to shrink to this size (bytes), because the store gives space back; replaces an earlier
    /// size.
    pub(super) fn may_shrink_to(&self, bytes: u64) {
        let mut seen = self.seen.lock();
        seen.least = Some(bytes);
    }

    fn difference(&self, seen: &mut Seen) -> Option<String> {
        let Ok(found) = fs::metadata(&self.database) else {
            return Some(format!("{} was removed", self.database.display()));
        };
        let id = (found.dev(), found.ino());
        if *seen.database.get_or_insert(id) != id {
            return Some(format!("{} was replaced", self.database.display()));
        }
        let given_back = seen.least.is_some_and(|least| found.len() >= least);
        if found.len() < seen.bytes && !given_back {
            return Some(format!("{} was cut short", self.database.display()));
        }
        seen.bytes = found.len();
        seen.least = seen.least.filter(|least| found.len() > *least);
        let id = fs::metadata(&self.log).map(|found| (found.dev(), found.ino()));
        match (seen.log, id) {
            (None, Ok(id)) => seen.log = Some(id),
            (Some(_), Err(_)) => return Some(format!("{} was removed", self.log.display())),
            (Some(old), Ok(id)) if old != id => {
                return Some(format!("{} was replaced", self.log.display()));
            }
            _ => {}
        }
        None
    }

    /// An error if the file does not begin as a database does: SQLite may not notice that, since it has read the pages
    /// before. Blocks.
    pub(super) fn check_header(&self) -> Result<()> {
        const MAGIC: &[u8; 16] = b"SQLite format 3\0";
        let mut found = [0; 16];
        match self.file.read_exact_at(&mut found, 0) {
            Ok(()) if found == *MAGIC => Ok(()),
            Ok(()) => Err(StoreError::Replaced(format!(
                "{} is no longer a database",
                self.database.display()
            ))),
            Err(error) => Err(StoreError::Replaced(format!(
                "{} cannot be read: {error}",
                self.database.display()
            ))),
        }
    }
}
