//! Makes a backup a store again.

use std::{
    fs::{self, DirBuilder, File},
    io::{self, ErrorKind},
    os::unix::fs::DirBuilderExt,
    path::{Path, PathBuf},
};

use base::time::Time;

use super::{
    backup::{new_file, sync_folder},
    connections::{Mode, blocking, open},
    error::{Result, StoreError},
    folder::{DATABASE, FILES, Folder, RESTORING, unusable},
    manifest::{Manifest, changed, copy_and_digest, read_manifest},
    migrations,
    progress::{self, LastCommit, Progress},
};

/// The beginning of the name of a folder with a store that a restore has replaced.
const ASIDE: &str = "replaced-";
/// The end of the name of a folder to which a restore has not moved the whole replaced store yet.
const PARTIAL: &str = ".partial";

/// The result of a restore.
#[derive(Debug)]
pub struct Restored {
    /// The manifest of the backup.
    pub manifest: Manifest,
    /// The folder to which the earlier store was moved, if there was one.
    pub replaced: Option<PathBuf>,
}

/// Makes the backup in `backup` the store in `data`, which must be empty or missing, unless `replace` is set. The
/// service refuses to start on the folder until the restore is complete.
pub async fn restore(backup: &Path, data: &Path, replace: bool) -> Result<Restored> {
    let (backup, data) = (backup.to_owned(), data.to_owned());
    blocking(move || write_store(&backup, &data, replace)).await
}

fn write_store(backup: &Path, data: &Path, replace: bool) -> Result<Restored> {
    let manifest = read_manifest(backup)?;
    let folder = Folder::lock(data)?;
    let unusable = |error: io::Error| unusable(data, error);
    let occupied = is_occupied(data).map_err(unusable)?;
    if occupied && !replace {
        return Err(StoreError::Folder(format!(
            "{} is not empty; name a new folder, or move its store aside with --replace",
            data.display()
        )));
    }
    let new = data.join(RESTORING);
    let _ = fs::remove_file(&new); // of a restore that was interrupted
    let last = copy(backup, &new, &manifest).inspect_err(|_| {
        let _ = fs::remove_file(&new); // nothing was moved yet
    })?;
    let replaced = if occupied {
        Some(put_aside(data).map_err(unusable)?)
    } else {
        None
    };
    if let Some(last) = last {
        // a job that ran while the backup was made has not lost its worker: as if the service had been stopped
        let stopped = LastCommit {
            stopped: true,
            ..last
        };
        Progress::start(data, stopped).map_err(unusable)?;
    }
    // the last step: until then the service does not start on it
    fs::rename(&new, folder.database()).map_err(unusable)?;
    sync_folder(data).map_err(unusable)?;
    folder.tighten();
    Ok(Restored { manifest, replaced })
}

/// Whether the folder has files, apart from those that an interrupted restore or a file system leaves.
fn is_occupied(data: &Path) -> io::Result<bool> {
    let store = data.join(DATABASE).exists();
    for entry in fs::read_dir(data)? {
        let name = entry?.file_name();
        let ours = name == RESTORING || name == "lost+found";
        if !ours && (store || name != progress::FILE) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Copies the database and compares the copy with the manifest; it is on the disk when this returns. Returns the last
/// commit that it records.
fn copy(backup: &Path, new: &Path, manifest: &Manifest) -> Result<Option<progress::LastCommit>> {
    let source = backup.join(DATABASE);
    let copied = || -> io::Result<_> {
        let mut file = new_file(new)?;
        let found = copy_and_digest(&mut File::open(&source)?, &mut file)?;
        file.sync_all()?;
        Ok(found)
    };
    let found = copied().map_err(|error| {
        StoreError::Folder(format!(
            "cannot copy {} to {}: {error}",
            source.display(),
            new.display()
        ))
    })?;
    if let Some(changed) = changed(&source, &found, manifest) {
        return Err(StoreError::Lost(format!(
            "{changed}; use another backup, or save what is intact with `signorini doctor --data {} --salvage NEW_FOLDER`",
            backup.display()
        )));
    }
    let connection = open(new, Mode::Read)?;
    migrations::check(&connection)?;
    progress::in_database(&connection)
}

/// Moves the store in this folder to a folder within it; returns the path of that folder. Its name ends with `.partial`
/// until the whole store is in it, and a restore that follows one that was killed continues with it.
fn put_aside(data: &Path) -> io::Result<PathBuf> {
    let partial = match begun(data)? {
        Some(partial) => partial,
        None => {
            let partial = data.join(format!("{ASIDE}{}{PARTIAL}", Time::now().micros()));
            DirBuilder::new().mode(0o700).create(&partial)?;
            partial
        }
    };
    for name in FILES {
        match fs::rename(data.join(name), partial.join(name)) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            Ok(()) | Err(_) => {}
        }
    }
    sync_folder(&partial)?;
    let aside = partial.with_extension("");
    fs::rename(&partial, &aside)?;
    sync_folder(data)?;
    Ok(aside)
}

/// The folder, within the store's folder `data`, to which a killed restore has moved some of the store's files;
/// `None` if there is none. A folder counts only if none of the files in it is in `data` too.
fn begun(data: &Path) -> io::Result<Option<PathBuf>> {
    for entry in fs::read_dir(data)? {
        let entry = entry?;
        let name = entry.file_name();
        let ours = name
            .to_str()
            .is_some_and(|name| name.starts_with(ASIDE) && name.ends_with(PARTIAL));
        let twice = |name: &str| data.join(name).exists() && entry.path().join(name).exists();
        if ours && !FILES.iter().any(|name| twice(name)) {
            return Ok(Some(entry.path()));
        }
    }
    Ok(None)
}
