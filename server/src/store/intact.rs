//! Reading the parts of a result, checked; and the results that were found intact.

use std::{
    collections::HashSet,
    sync::{Mutex, PoisonError},
};

use sha2::{Digest, Sha256};
use sqlx::{Row, SqliteConnection};

use super::{
    checksum::Checksum,
    encoding::{self, Content, Encoding, PartInfo, decoded, info_of_json},
    error::{Record, Result},
};

/// Results, or parts of them, that were read whole and found as they were written, since the store was opened: what
/// answers another job is checked once. Keys are never used again. The older half is forgotten when there are many.
#[derive(Debug, Default)]
pub(super) struct Intact(Mutex<[HashSet<(i64, &'static str)>; 2]>);

/// Up to this size of its JSON a part is decoded where it is read: that takes a millisecond or two.
const INLINE_BYTES: u64 = 256 << 10;

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

/// What is stored about a part beside its pieces.
pub(super) struct StoredInfo {
    pub(super) info: PartInfo,
    encoding: Encoding,
    /// SHA-256 of its pieces together; unknown for what earlier versions wrote.
    stored_digest: Option<Vec<u8>>,
    /// The row has a checksum, hence all others of this result.
    has_checksum: bool,
}

/// Bytes, digest, encoding and digest of what is stored.
pub(super) type InfoColumns = (i64, Vec<u8>, Option<i64>, Option<Vec<u8>>);

/// What is stored about a part; `None` if there is no such part, or if it was written by a version that did not store it.
pub(super) async fn part_info(
    connection: &mut SqliteConnection,
    key: i64,
    name: &str,
) -> Result<Option<StoredInfo>> {
    let row = sqlx::query(
        "select bytes, digest, encoding, stored_digest, checksum from result_info where job_id = ? and name = ?",
    )
    .bind(key)
    .bind(name)
    .fetch_optional(connection)
    .await?;
    let Some(row) = row else {
        return Ok(None);
    };
    let columns: InfoColumns = (
        row.try_get("bytes")?,
        row.try_get("digest")?,
        row.try_get("encoding")?,
        row.try_get("stored_digest")?,
    );
    let checksum: Option<i64> = row.try_get("checksum")?;
    let record = || part_of(key, name);
    info_checksum(key, name, &columns).verify(checksum, record)?;
    let (bytes, digest, encoding, stored_digest) = columns;
    let unknown = || record().damaged("it is stored in a form that this program does not know");
    let info = PartInfo {
        bytes: bytes as u64,
        digest,
    };
    Ok(Some(StoredInfo {
        info,
        encoding: Encoding::from_stored(encoding).ok_or_else(unknown)?,
        stored_digest,
        has_checksum: checksum.is_some(),
    }))
}

/// The checksum of a row of `result_info`.
pub(super) fn info_checksum(key: i64, name: &str, columns: &InfoColumns) -> Checksum {
    let (bytes, digest, encoding, stored_digest) = columns;
    let mut sum = Checksum::new().int(key).text(name).int(*bytes);
    sum = sum.bytes(digest);
    if let Some(encoding) = encoding {
        sum = sum.int(*encoding);
    }
    match stored_digest {
        Some(digest) => sum.bytes(digest),
        None => sum,
    }
}

/// The checksum of a row of `result_part`.
pub(super) fn piece_checksum(key: i64, name: &str, piece: i64, body: &[u8]) -> Checksum {
    Checksum::new().int(key).text(name).int(piece).bytes(body)
}

/// One stored piece of a part, from 0; `None` after the last.
async fn piece(
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

/// A part as it is stored.
pub(super) struct StoredPart {
    record: Record,
    known: Option<StoredInfo>,
    bytes: Vec<u8>,
}

/// A part as it is stored; `None` if there is no such part.
pub(super) async fn stored_part(
    connection: &mut SqliteConnection,
    key: i64,
    name: &str,
) -> Result<Option<StoredPart>> {
    let known = part_info(connection, key, name).await?;
    let (mut bytes, mut pieces) = (vec![], 0);
    while let Some(body) = piece(connection, key, name, pieces).await? {
        bytes.extend_from_slice(&body);
        pieces += 1;
    }
    // a version without checksums kept size and hash of a history that it had removed
    let has_checksum = known.as_ref().is_some_and(|known| known.has_checksum);
    let record = part_of(key, name);
    let stored = StoredPart {
        record,
        known,
        bytes,
    };
    Ok((pieces > 0 || has_checksum).then_some(stored))
}

impl StoredPart {
    /// Its content, compared with its size and hash.
    pub(super) async fn decoded(self) -> Result<(PartInfo, Content)> {
        let StoredPart {
            record,
            known,
            bytes,
        } = self;
        let Some(StoredInfo { info, encoding, .. }) = known else {
            // written by a version that did not store size and hash
            return Ok((info_of_json(&bytes), Content::Json(bytes)));
        };
        let expected = info.clone();
        let decode = move || decoded(bytes, encoding, &expected);
        // a large one takes a second, in which its thread would answer nobody
        let decoded = match info.bytes > INLINE_BYTES {
            true => tokio::task::spawn_blocking(decode)
                .await
                .unwrap_or_else(|panic| Err(panic.to_string())),
            false => decode(),
        };
        match decoded {
            Ok((found, content)) if found == info => Ok((found, content)),
            Ok((found, _)) => Err(record.damaged(format!(
                "{} bytes of another hash in place of {}",
                found.bytes, info.bytes
            ))),
            Err(cause) => Err(record.damaged(cause)),
        }
    }
}

/// A part, compared with its size and hash; `None` if there is no such part.
pub(super) async fn read_part(
    connection: &mut SqliteConnection,
    key: i64,
    name: &str,
) -> Result<Option<(PartInfo, Content)>> {
    match stored_part(connection, key, name).await? {
        Some(stored) => stored.decoded().await.map(Some),
        None => Ok(None),
    }
}

/// The memory that reading fields takes at most, in bytes; `None` if there is no such part.
pub(super) async fn memory_to_read(
    connection: &mut SqliteConnection,
    key: i64,
    name: &str,
) -> Result<Option<usize>> {
    let known = part_info(connection, key, name).await?;
    let first = piece(connection, key, name, 0).await?;
    if first.is_none() && !known.as_ref().is_some_and(|known| known.has_checksum) {
        return Ok(None);
    }
    let stored =
        "select coalesce(sum(length(body)), 0) from result_part where job_id = ? and name = ?";
    let stored: i64 = sqlx::query_scalar(stored)
        .bind(key)
        .bind(name)
        .fetch_one(connection)
        .await?;
    let stored = stored as usize;
    let (encoding, json_bytes) = known.map_or((Encoding::Plain, stored), |known| {
        (known.encoding, known.info.bytes as usize)
    });
    let first = first.unwrap_or_default();
    let memory = encoding::memory_to_read(&first, stored, encoding, json_bytes);
    memory
        .map(Some)
        .map_err(|cause| part_of(key, name).damaged(cause))
}

/// Reads every part of a result, to check it; an error if one is damaged or the summary is missing.
pub(super) async fn check_result(connection: &mut SqliteConnection, key: i64) -> Result<()> {
    for name in names(connection, key).await? {
        read_part(connection, key, &name).await?;
    }
    Ok(())
}

/// The same by the bytes that are stored, piece by piece, without decoding them, which takes a hundredth of the time: what is
/// in them is compared when it is served. What an earlier version wrote is decoded.
pub(super) async fn check_stored(connection: &mut SqliteConnection, key: i64) -> Result<()> {
    for name in names(connection, key).await? {
        let known = part_info(connection, key, &name).await?;
        let Some(expected) = known.and_then(|known| known.stored_digest) else {
            read_part(connection, key, &name).await?;
            continue;
        };
        let (mut hash, mut pieces) = (Sha256::new(), 0);
        while let Some(body) = piece(connection, key, &name, pieces).await? {
            hash.update(&body);
            pieces += 1;
        }
        if hash.finalize()[..] != expected[..] {
            return Err(part_of(key, &name).damaged("it is stored with another hash"));
        }
    }
    Ok(())
}

/// The names of the parts of a result; an error if the summary is missing.
async fn names(connection: &mut SqliteConnection, key: i64) -> Result<Vec<String>> {
    let names: Vec<String> = sqlx::query_scalar(
        "select name from result_info where job_id = ?1 union select name from result_part where job_id = ?1",
    )
    .bind(key)
    .fetch_all(&mut *connection)
    .await?;
    match names.iter().any(|name| name == "summary") {
        true => Ok(names),
        false => Err(part_of(key, "summary").damaged("it is missing")),
    }
}
