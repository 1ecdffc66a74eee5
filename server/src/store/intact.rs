//! Reading the parts of a result, checked; and the results that were found intact.

use std::{
    collections::HashSet,
    sync::{Mutex, PoisonError},
};

use sha2::{Digest, Sha256};
use sqlx::SqliteConnection;

use super::{
    checksum::Checksum,
    error::{Record, Result},
};

/// Size and hash of a part.
#[derive(Clone, Debug)]
pub struct PartInfo {
    /// Its size.
    pub bytes: u64,
    /// Its SHA-256.
    pub digest: Vec<u8>,
}

/// Results, or parts of them, that were read whole and found as they were written, since the store was opened: what
/// answers another job is checked once. Keys are never used again. The older half is forgotten when there are many.
#[derive(Debug, Default)]
pub(super) struct Intact(Mutex<[HashSet<(i64, &'static str)>; 2]>);

/// In place of the name of a part: all of them.
pub(super) const WHOLE: &str = "";

impl Intact {
    const MOST: usize = 10_000;

    pub(super) fn contains(&self, key: i64, part: &'static str) -> bool {
        let halves = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let has = |part| halves.iter().any(|half| half.contains(&(key, part)));
        has(WHOLE) || has(part)
    }

    pub(super) fn insert(&self, key: i64, part: &'static str) {
        let mut halves = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if halves[0].len() >= Self::MOST {
            halves.swap(0, 1);
            halves[0].clear();
        }
        halves[0].insert((key, part));
    }
}

/// The name of a part in errors.
pub(super) fn part_of(key: i64, name: &str) -> Record {
    Record::of_job(key, format!("result part {name}"))
}

/// Size and hash of a part; `None` if there is no such part, or if it was written by a version that did not store
/// them. The second value: whether the row has a checksum, hence all others of this result.
pub(super) async fn part_info(
    connection: &mut SqliteConnection,
    key: i64,
    name: &str,
) -> Result<Option<(PartInfo, bool)>> {
    let found: Option<(i64, Vec<u8>, Option<i64>)> = sqlx::query_as(
        "select bytes, digest, checksum from result_info where job_id = ? and name = ?",
    )
    .bind(key)
    .bind(name)
    .fetch_optional(connection)
    .await?;
    let Some((bytes, digest, checksum)) = found else {
        return Ok(None);
    };
    info_checksum(key, name, bytes, &digest).verify(checksum, || part_of(key, name))?;
    let info = PartInfo {
        bytes: bytes as u64,
        digest,
    };
    Ok(Some((info, checksum.is_some())))
}

/// The checksum of a row of `result_info`.
pub(super) fn info_checksum(key: i64, name: &str, bytes: i64, digest: &[u8]) -> Checksum {
    Checksum::new().int(key).text(name).int(bytes).bytes(digest)
}

/// The checksum of a row of `result_part`.
pub(super) fn piece_checksum(key: i64, name: &str, piece: i64, body: &[u8]) -> Checksum {
    Checksum::new().int(key).text(name).int(piece).bytes(body)
}

/// One piece of a part, from 0; `None` after the last.
pub(super) async fn piece(
    connection: &mut SqliteConnection,
    key: i64,
    name: &str,
    piece: i64,
) -> Result<Option<Vec<u8>>> {
    let found: Option<(Vec<u8>, Option<i64>)> = sqlx::query_as(
        "select body, checksum from result_part where job_id = ? and name = ? and piece = ?",
    )
    .bind(key)
    .bind(name)
    .bind(piece)
    .fetch_optional(connection)
    .await?;
    let Some((body, checksum)) = found else {
        return Ok(None);
    };
    piece_checksum(key, name, piece, &body).verify(checksum, || part_of(key, name))?;
    Ok(Some(body))
}

/// Reads a part piece by piece, and compares the whole with its size and hash; `None` if there is no such part.
pub(super) async fn read_part(
    connection: &mut SqliteConnection,
    key: i64,
    name: &str,
    mut take: impl FnMut(Vec<u8>),
) -> Result<Option<PartInfo>> {
    let info = part_info(connection, key, name).await?;
    let (mut bytes, mut hash, mut number) = (0, Sha256::new(), 0);
    while let Some(body) = piece(connection, key, name, number).await? {
        bytes += body.len() as u64;
        hash.update(&body);
        take(body);
        number += 1;
    }
    let found = PartInfo {
        bytes,
        digest: hash.finalize().to_vec(),
    };
    match info {
        // written by a version that did not store size and hash
        None => Ok((number > 0).then_some(found)),
        // a version without checksums kept them of a history that it had removed
        Some((_, false)) if number == 0 => Ok(None),
        Some((info, _)) if (info.bytes, &info.digest) == (found.bytes, &found.digest) => {
            Ok(Some(found))
        }
        Some((info, _)) => Err(part_of(key, name).damaged(format!(
            "{} bytes of another hash in place of {}",
            found.bytes, info.bytes
        ))),
    }
}

/// Reads every part of a result, to check it; an error if one is damaged or the summary is missing.
pub(super) async fn check_result(connection: &mut SqliteConnection, key: i64) -> Result<()> {
    let names: Vec<String> = sqlx::query_scalar(
        "select name from result_info where job_id = ?1 union select name from result_part where job_id = ?1",
    )
    .bind(key)
    .fetch_all(&mut *connection)
    .await?;
    if !names.iter().any(|name| name == "summary") {
        return Err(part_of(key, "summary").damaged("it is missing"));
    }
    for name in names {
        read_part(connection, key, &name, |_| ()).await?;
    }
    Ok(())
}
