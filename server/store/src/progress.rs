//! A file beside the database that records how far the store has come: by it the service notices when the database, or
//! the write-ahead log with its last transactions, is missing or was replaced by an older one.
//!
//! Every transaction counts itself in the database, and after its commit the number is written to the file: 80 bytes in
//! place, without a flush, which would cost as much as the commit. The file is therefore never ahead of what is
//! durable. After a power cut it may be behind: then less is noticed, but no intact store is refused.

use parking_lot::Mutex;
use std::{
    fs::{File, OpenOptions},
    io::{self, ErrorKind},
    os::unix::fs::{FileExt, OpenOptionsExt},
    path::{Path, PathBuf},
    sync::Arc,
};

use rusqlite::Connection;

use super::{
    error::{Result, StoreError},
    sql::Sql,
};

/// The name of the file.
pub(super) const FILE: &str = "signorini.progress";
/// The word in the file while the service runs, and after it has died. It is as long as [`STOPPED`].
const RUNNING: &str = "running";
/// The word in the file after the service was stopped.
const STOPPED: &str = "stopped";

/// The last commit of a store, as the file or the database records it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct LastCommit {
    /// The identity of the store.
    pub(super) store: String,
    /// The number of the store's last transaction.
    pub(super) commits: i64,
    /// Whether the service was stopped after this transaction, and did not die.
    pub(super) stopped: bool,
}

/// What the file tells about the last commit.
#[derive(Debug)]
pub(super) enum Known {
    /// The file does not exist.
    Missing,
    /// The file is damaged: its checksum does not match.
    Damaged,
    /// The last commit that the file records.
    Last(LastCommit),
}

/// The file, kept open.
#[derive(Clone, Debug)]
pub(super) struct Progress(Arc<Mutex<Open>>);

#[derive(Debug)]
struct Open {
    file: File,
    last: LastCommit,
    /// Whether the last write failed, which was logged.
    failed: bool,
}

/// Reads the file.
pub(super) fn read(folder: &Path) -> Result<Known> {
    let path = folder.join(FILE);
    match std::fs::read(&path) {
        Ok(bytes) => Ok(LastCommit::parse(&bytes).map_or(Known::Damaged, Known::Last)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(Known::Missing),
        Err(error) => Err(StoreError::Folder(format!(
            "cannot read {}: {error}",
            path.display()
        ))),
    }
}

/// The last commit that the database records; `None` if it is of a version that did not count transactions.
pub(super) fn in_database(connection: &Connection) -> Result<Option<LastCommit>> {
    let counted = "select exists (select 1 from sqlite_schema where name = 'progress')";
    if !connection.value::<bool>(counted, ())? {
        return Ok(None);
    }
    let last = connection.row("select store, commits from progress", (), |row| {
        Ok(LastCommit {
            store: row.get("store")?,
            commits: row.get("commits")?,
            stopped: false,
        })
    })?;
    match last {
        Some(last) => Ok(Some(last)),
        None => Err(rusqlite::Error::QueryReturnedNoRows.into()),
    }
}

/// An error if the database is of another store than the file, or lacks transactions that the file counts. Returns why
/// this cannot be known, if the file is missing or damaged.
pub(super) fn compare(known: &Known, database: Option<&LastCommit>) -> Result<Option<String>> {
    let doubt = |how: &str| {
        // a version that did not count had no file
        let counted =
            database.map(|_| format!("{FILE} is {how}, so lost data cannot be ruled out"));
        Ok(counted)
    };
    let file = match known {
        Known::Missing => return doubt("missing"),
        Known::Damaged => return doubt("damaged"),
        Known::Last(file) => file,
    };
    let lost = |what: String| Err(StoreError::Lost(what));
    match database {
        None => lost("it is older than the last store in this folder".into()),
        Some(found) if found.store != file.store => lost("it belongs to another store".into()),
        Some(found) if found.commits < file.commits => lost(format!(
            "its last {} transactions are missing",
            file.commits - found.commits
        )),
        Some(_) => Ok(None),
    }
}

impl Progress {
    /// Writes the file, which is on the disk when this returns, and keeps it open.
    pub(super) fn start(folder: &Path, last: LastCommit) -> io::Result<Progress> {
        let file = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .open(folder.join(FILE))?;
        let text = last.text();
        file.set_len(text.len() as u64)?;
        file.write_all_at(text.as_bytes(), 0)?;
        file.sync_all()?;
        File::open(folder)?.sync_all()?;
        let failed = false;
        let open = Open { file, last, failed };
        Ok(Progress(Arc::new(Mutex::new(open))))
    }

    /// Records that the transaction with this number is on the disk.
    pub(super) fn reached(&self, number: i64) {
        let mut open = self.0.lock();
        if number <= open.last.commits {
            return; // a later one was faster
        }
        open.last.commits = number;
        let written = open.write();
        if let (Err(error), false) = (&written, open.failed) {
            tracing::warn!(%error, "{FILE} cannot be written: {error}");
        }
        open.failed = written.is_err();
    }

    /// Records that the service was stopped, after its last write. Needs no space on the disk.
    pub(super) fn stop(&self) -> io::Result<()> {
        {
            let mut open = self.0.lock();
            open.last.stopped = true;
            open.write()?;
        }
        self.sync()
    }

    /// Flushes the file.
    pub(super) fn sync(&self) -> io::Result<()> {
        let file = {
            let open = self.0.lock();
            open.file.try_clone()?
        };
        file.sync_data()
    }
}

impl Open {
    fn write(&self) -> io::Result<()> {
        self.file.write_all_at(self.last.text().as_bytes(), 0)
    }
}

impl LastCommit {
    /// The text of the file, always of the same length, so that it is replaced in place and within one sector.
    fn text(&self) -> String {
        let LastCommit { store, commits, .. } = self;
        let state = if self.stopped { STOPPED } else { RUNNING };
        let line = format!("signorini {store} {commits:020} {state}");
        format!("{line} {:08x}\n", crc32fast::hash(line.as_bytes()))
    }

    fn parse(bytes: &[u8]) -> Option<LastCommit> {
        let text = std::str::from_utf8(bytes).ok()?;
        let mut words = text.split_whitespace();
        let (_, store, commits) = (words.next()?, words.next()?, words.next()?);
        let last = LastCommit {
            store: store.to_owned(),
            commits: commits.parse().ok()?,
            stopped: words.next()? == STOPPED,
        };
        (last.text() == text).then_some(last)
    }
}

/// Forgets how far the store had come, so that the next start accepts the present database. Returns whether the file
/// existed.
pub fn accept(folder: &Path) -> io::Result<bool> {
    let moved = |path: PathBuf| {
        let mut name = path.clone().into_os_string();
        name.push(".unused");
        std::fs::rename(path, name)
    };
    // a log without its database holds nothing that can be used, and SQLite would remove it
    let log = folder.join("signorini.db-wal");
    if log.exists() && !has_content(&folder.join("signorini.db")) {
        moved(log)?;
    }
    match std::fs::remove_file(folder.join(FILE)) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

/// Whether a file exists and is not empty.
pub(super) fn has_content(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|found| found.len() > 0)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_record_is_read_back_and_a_changed_one_is_not() {
        let last = LastCommit {
            store: "0123456789abcdef0123456789abcdef".into(),
            commits: 12,
            stopped: true,
        };
        let text = last.text().into_bytes();
        assert_eq!(text.len(), 81);
        assert_eq!(LastCommit::parse(&text), Some(last));
        for place in 0..text.len() {
            let mut other = text.clone();
            other[place] ^= 1;
            assert_eq!(LastCommit::parse(&other), None, "{place}");
        }
        assert_eq!(LastCommit::parse(b""), None);
    }
}
