//! A backup: a folder with the database as it was at one point in time, and a manifest with its digest.
//!
//! `VACUUM INTO` makes the copy, on a connection that only reads: this statement sees one state of the database,
//! whatever is written meanwhile, and the single writer never waits for it. The copy has everything, meshes too.
//! SQLite's interface for online backups would begin anew with every commit of another process, and needs `unsafe`
//! here. During the backup the write-ahead log is not reused, and grows by what is written.
//!
//! The files are written to `TARGET.partial`, which is renamed to `TARGET` when all of them are complete and on the
//! disk: a folder named `TARGET` is never half a backup.

use std::{
    fs::{self, DirBuilder, File, OpenOptions},
    io::{self, ErrorKind, Write},
    os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt},
    path::{Path, PathBuf, absolute},
};

use base::{text::size, time::Time};
use rustix::fs::{CWD, RenameFlags, renameat_with, statvfs};

use super::{
    connections::{Mode, blocking, open},
    database::{compare_with_the_past, with_advice},
    error::{Result, StoreError},
    folder::{DATABASE, JOURNAL, unusable},
    inspect::{absent, check_copy},
    manifest::{FORMAT, MANIFEST, Manifest, digest},
    migrations,
    pages::Pages,
    progress::{self, Progress},
    sql::Sql,
};

/// The files that writing a backup may leave in its folder, even if it is interrupted.
const FILES: [&str; 4] = [MANIFEST, DATABASE, JOURNAL, progress::FILE];
/// Bytes that stay free on the disk of the backup, which may be the disk of the store, too.
const SPARE_BYTES: u64 = 64 << 20;

/// A backup that was made.
#[derive(Debug)]
pub struct Backup {
    /// The manifest, which tells what the backup contains.
    pub manifest: Manifest,
    /// A text about each damaged record in the backup, which was damaged in the store before.
    pub findings: Vec<String>,
}

/// Writes a backup of the store in the folder `data` to the new folder `target`, whether or not a server is using the
/// store. With `check`, reads everything in the backup as the service does.
pub async fn back_up(data: &Path, target: &Path, check: bool) -> Result<Backup> {
    let (data, target) = (data.to_owned(), target.to_owned());
    blocking(move || write_backup(&data, &target, check)).await
}

fn write_backup(data: &Path, target: &Path, check: bool) -> Result<Backup> {
    if !progress::has_content(&data.join(DATABASE)) {
        return Err(unusable(data, absent(data)));
    }
    let partial = Partial::create(data, target)?;
    let made = fill(data, &partial, check);
    let made = made.and_then(|backup| partial.complete(&backup.manifest).map(|()| backup));
    made.map_err(|error| {
        partial.remove();
        match error {
            StoreError::Full => partial.unwritable("the disk is full"),
            other => with_advice(other, data),
        }
    })
}

fn fill(data: &Path, partial: &Partial, check: bool) -> Result<Backup> {
    // before the database: later, it would tell of transactions that the copy does not have
    let known = progress::read(data)?;
    let created_at = Time::now();
    let source = open(&data.join(DATABASE), Mode::Read)?;
    migrations::check(&source)?;
    let pages = Pages::of(&source)?;
    partial.require_space(pages.bytes_of(pages.count - pages.free))?;
    let database = partial.path.join(DATABASE);
    // SQLite takes an empty file, which is for its owner alone
    partial.named(new_file(&database))?;
    let name = database.to_str();
    let name = name.ok_or_else(|| partial.unwritable("its name must be UTF-8"))?;
    source.run("vacuum into ?", [name])?;
    drop(source);

    let doubt = compare_with_the_past(&partial.path, &known, &database)?;
    let copy = open(&database, Mode::Read)?;
    let count = |statement: &str| copy.value::<i64>(statement, ());
    let mut manifest = Manifest {
        format: FORMAT,
        version: env!("CARGO_PKG_VERSION").into(),
        tables: count("select max(version) from _sqlx_migrations")?,
        created_at,
        jobs: count("select count(*) from job")?,
        unfinished: count("select count(*) from job where status in ('queued', 'running')")?,
        meshes: 0,
        bytes: 0,
        digest: String::new(),
        damaged: None,
    };
    if manifest.tables >= 2 {
        manifest.meshes = count("select count(*) from mesh")?;
    }
    if let Some(last) = progress::in_database(&copy)? {
        partial.named(Progress::start(&partial.path, last).map(drop))?;
    }
    drop(copy);
    let mut findings: Vec<String> = doubt.into_iter().collect();
    if check {
        findings.extend(check_copy(&partial.path)?);
        manifest.damaged = Some(findings.len());
    }
    let (digest, bytes) = partial.named(digest(&database))?;
    (manifest.digest, manifest.bytes) = (digest, bytes);
    Ok(Backup { manifest, findings })
}

/// The folder `TARGET.partial`, which becomes the backup.
struct Partial {
    target: PathBuf,
    path: PathBuf,
    /// The lock on the folder, held so that a second backup to the same target does not mix with this one.
    _lock: File,
}

impl Partial {
    /// Creates the folder, or takes over one that an earlier backup has left when it was killed.
    fn create(data: &Path, target: &Path) -> Result<Partial> {
        let refused = |why: &dyn std::fmt::Display| {
            StoreError::Folder(format!(
                "cannot write a backup to {}: {why}",
                target.display()
            ))
        };
        let named = |error: io::Error| refused(&error);
        let target = absolute(target).map_err(named)?;
        let name = target
            .file_name()
            .ok_or_else(|| refused(&"it has no name"))?;
        if fs::symlink_metadata(&target).is_ok() {
            return Err(refused(&"it exists already; name a new folder"));
        }
        let parent = target.parent().unwrap_or(Path::new("/"));
        let parent = parent
            .canonicalize()
            .map_err(|error| refused(&format!("{}: {error}", parent.display())))?;
        let within = data.canonicalize().map_err(named)?;
        if parent.starts_with(&within) {
            return Err(refused(&format!(
                "it is inside the folder of the store, {}, and would be lost with it",
                within.display()
            )));
        }
        let mut partial = name.to_owned();
        partial.push(".partial");
        let path = parent.join(partial);
        match DirBuilder::new().mode(0o700).create(&path) {
            Err(error) if error.kind() != ErrorKind::AlreadyExists => return Err(named(error)),
            Ok(()) | Err(_) => {}
        }
        let lock = File::open(&path).map_err(named)?;
        let held = lock.try_lock().is_ok() && is_at(&lock, &path);
        if !held {
            return Err(refused(&"another backup is being written to it"));
        }
        let made = Partial {
            target: parent.join(name),
            path,
            _lock: lock,
        };
        for file in FILES {
            let _ = fs::remove_file(made.path.join(file)); // whatever is left is noticed next
        }
        let foreign = fs::read_dir(&made.path).map_err(named)?.next().is_some();
        if foreign {
            Err(refused(&format!(
                "{} exists, and contains more than the remains of an interrupted backup",
                made.path.display()
            )))
        } else {
            Ok(made)
        }
    }

    /// The error that the backup cannot be written.
    fn unwritable(&self, why: impl std::fmt::Display) -> StoreError {
        let target = self.target.display();
        StoreError::Folder(format!("cannot write a backup to {target}: {why}"))
    }

    fn named<T>(&self, done: io::Result<T>) -> Result<T> {
        done.map_err(|error| self.unwritable(error))
    }

    /// An error if the disk does not have this many bytes and [`SPARE_BYTES`] free.
    fn require_space(&self, bytes: u64) -> Result<()> {
        let found = statvfs(&self.path).map_err(|error| self.unwritable(error))?;
        let free = found.f_bavail.saturating_mul(found.f_frsize);
        if bytes.saturating_add(SPARE_BYTES) <= free {
            Ok(())
        } else {
            Err(self.unwritable(format!(
                "the store takes {}, and {} must stay free, but there is only {}",
                size(bytes),
                size(SPARE_BYTES),
                size(free)
            )))
        }
    }

    /// Writes the manifest, and renames the folder to the target once everything is on the disk.
    fn complete(&self, manifest: &Manifest) -> Result<()> {
        let write = || -> io::Result<()> {
            File::open(self.path.join(DATABASE))?.sync_all()?;
            let mut file = new_file(&self.path.join(MANIFEST))?;
            let mut text = serde_json::to_vec_pretty(manifest)?;
            text.push(b'\n');
            file.write_all(&text)?;
            file.sync_all()?;
            sync_folder(&self.path)?;
            // not over one that has come there meanwhile
            renameat_with(CWD, &self.path, CWD, &self.target, RenameFlags::NOREPLACE)?;
            sync_folder(self.target.parent().unwrap_or(Path::new("/")))
        };
        self.named(write())
    }

    /// Removes the files and the folder, after an error.
    fn remove(&self) {
        for file in FILES {
            let _ = fs::remove_file(self.path.join(file));
        }
        let _ = fs::remove_dir(&self.path); // the next backup to this target takes it over
    }
}

/// Whether `path` names the open file `file`.
fn is_at(file: &File, path: &Path) -> bool {
    let id = |found: fs::Metadata| (found.dev(), found.ino());
    let (open, named) = (file.metadata().map(id), fs::metadata(path).map(id));
    matches!((open, named), (Ok(open), Ok(named)) if open == named)
}

/// Creates a file that only its owner can read and write.
pub(super) fn new_file(path: &Path) -> io::Result<File> {
    OpenOptions::new()
        .write(true)
        .create_new(true)
        .mode(0o600)
        .open(path)
}

/// Flushes a folder to the disk, and with it the names of its files.
pub(super) fn sync_folder(path: &Path) -> io::Result<()> {
    File::open(path)?.sync_all()
}
