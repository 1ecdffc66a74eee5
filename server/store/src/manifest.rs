//! The manifest of a backup: what the backup contains, and the digest of its database.

use std::{
    fs::{self, File},
    io::{self, ErrorKind, Read, Write},
    path::Path,
};

use base::time::Time;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{
    error::{Result, StoreError},
    folder::{DATABASE, unusable},
    migrations,
};

/// The name of the manifest's file.
pub(super) const MANIFEST: &str = "manifest.json";
/// The version of the manifest's form that this program writes, and the latest one that it reads.
pub(super) const FORMAT: u32 = 1;

/// What a backup contains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// The form of this manifest.
    pub format: u32,
    /// The version of the program that made the backup.
    pub version: String,
    /// The version of the tables.
    pub tables: i64,
    /// When the backup was begun. Everything that was acknowledged before that time is in it.
    pub created_at: Time,
    /// The number of jobs.
    pub jobs: i64,
    /// The number of jobs that waited or ran: they are solved after a restore.
    pub unfinished: i64,
    /// The number of stored meshes.
    pub meshes: i64,
    /// The size of the database (bytes).
    pub bytes: u64,
    /// The SHA-256 of the database, as `sha256:…`.
    pub digest: String,
    /// How many damaged records a check of the backup has found, all of them copied from the store; `None` if it was
    /// not checked.
    pub damaged: Option<usize>,
}

/// Reads the manifest of the backup in a folder.
pub(super) fn read_manifest(backup: &Path) -> Result<Manifest> {
    let path = backup.join(MANIFEST);
    let text = fs::read(&path).map_err(|error| {
        let why = match error.kind() {
            ErrorKind::NotFound => {
                format!("it contains no {MANIFEST}: it is not a backup, or was not completed")
            }
            _ => format!("{}: {error}", path.display()),
        };
        StoreError::Folder(format!(
            "{} cannot be read as a backup: {why}",
            backup.display()
        ))
    })?;
    let damaged = |error| StoreError::Lost(format!("{} is damaged: {error}", path.display()));
    let manifest: serde_json::Value = serde_json::from_slice(&text).map_err(damaged)?;
    let later = |what: &str| {
        StoreError::Schema(format!(
            "the backup {} was made by a later version of this program ({what}); use that version",
            backup.display()
        ))
    };
    if manifest["format"]
        .as_u64()
        .is_some_and(|format| format > FORMAT.into())
    {
        return Err(later("its manifest has another form"));
    }
    let manifest: Manifest = serde_json::from_value(manifest).map_err(damaged)?;
    if manifest.tables > migrations::last_step() {
        Err(later(&manifest.version))
    } else {
        Ok(manifest)
    }
}

/// How a database, with this digest and number of bytes, differs from what its manifest says.
pub(super) fn changed(source: &Path, found: &(String, u64), manifest: &Manifest) -> Option<String> {
    let (digest, bytes) = found;
    let same = (digest, *bytes) == (&manifest.digest, manifest.bytes);
    (!same).then(|| {
        format!(
            "{} was changed: it has {bytes} bytes with {digest}, but {MANIFEST} says {} with {}",
            source.display(),
            manifest.bytes,
            manifest.digest,
        )
    })
}

/// How the database in a folder with a backup differs from what the manifest there says; `None` if it is equal, or the
/// folder has no manifest.
pub(super) fn differs_from_manifest(folder: &Path) -> Result<Option<String>> {
    if !folder.join(MANIFEST).exists() {
        return Ok(None);
    }
    let manifest = read_manifest(folder)?;
    let source = folder.join(DATABASE);
    let found = digest(&source).map_err(|error| unusable(folder, error))?;
    Ok(changed(&source, &found, &manifest))
}

/// The SHA-256 of a file, as `sha256:…`, and its size (bytes).
pub(super) fn digest(path: &Path) -> io::Result<(String, u64)> {
    copy_and_digest(&mut File::open(path)?, &mut io::sink())
}

/// Copies everything from `from` to `to`; returns the SHA-256 as `sha256:…`, and the number of bytes.
pub(super) fn copy_and_digest(
    from: &mut impl Read,
    to: &mut impl Write,
) -> io::Result<(String, u64)> {
    let (mut hash, mut bytes) = (Sha256::new(), 0);
    let mut buffer = vec![0; 1 << 20];
    loop {
        let read = match from.read(&mut buffer) {
            Ok(0) => break,
            Ok(read) => read,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        hash.update(&buffer[..read]);
        to.write_all(&buffer[..read])?;
        bytes += read as u64;
    }
    let hex: String = hash
        .finalize()
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    Ok((format!("sha256:{hex}"), bytes))
}
