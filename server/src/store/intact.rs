//! Reading the parts of a result, checked; and the results that were found intact.

use std::{
    collections::HashSet,
    sync::{Mutex, PoisonError},
};

use sqlx::SqliteConnection;

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
    /// The row has a checksum, hence all others of this result.
    has_checksum: bool,
}

/// Bytes, digest, checksum and encoding.
type InfoColumns = (i64, Vec<u8>, Option<i64>, Option<i64>);

/// What is stored about a part; `None` if there is no such part, or if it was written by a version that did not store it.
pub(super) async fn part_info(
    connection: &mut SqliteConnection,
    key: i64,
    name: &str,
) -> Result<Option<StoredInfo>> {
    let found: Option<InfoColumns> = sqlx::query_as(
        "select bytes, digest, checksum, encoding from result_info where job_id = ? and name = ?",
    )
    .bind(key)
    .bind(name)
    .fetch_optional(connection)
    .await?;
    let Some((bytes, digest, checksum, encoding)) = found else {
        return Ok(None);
    };
    let record = || part_of(key, name);
    info_checksum(key, name, bytes, &digest, encoding).verify(checksum, record)?;
    let unknown = || record().damaged("it is stored in a way that this program does not know");
    let info = PartInfo {
        bytes: bytes as u64,
        digest,
    };
    Ok(Some(StoredInfo {
        info,
        encoding: Encoding::from_stored(encoding).ok_or_else(unknown)?,
        has_checksum: checksum.is_some(),
    }))
}

/// The checksum of a row of `result_info`.
pub(super) fn info_checksum(
    key: i64,
    name: &str,
    bytes: i64,
    digest: &[u8],
    encoding: Option<i64>,
) -> Checksum {
    let sum = Checksum::new().int(key).text(name).int(bytes).bytes(digest);
    match encoding {
        Some(encoding) => sum.int(encoding),
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

/// A part, compared with its size and hash; `None` if there is no such part.
pub(super) async fn read_part(
    connection: &mut SqliteConnection,
    key: i64,
    name: &str,
) -> Result<Option<(PartInfo, Content)>> {
    let known = part_info(connection, key, name).await?;
    let (mut stored, mut pieces) = (vec![], 0);
    while let Some(body) = piece(connection, key, name, pieces).await? {
        stored.extend_from_slice(&body);
        pieces += 1;
    }
    let Some(known) = known else {
        // written by a version that did not store size and hash
        return Ok((pieces > 0).then(|| (info_of_json(&stored), Content::Json(stored))));
    };
    if !known.has_checksum && pieces == 0 {
        // a version without checksums kept them of a history that it had removed
        return Ok(None);
    }
    let StoredInfo { info, encoding, .. } = known;
    let expected = info.clone();
    let decode = move || decoded(stored, encoding, &expected);
    // a large one takes a second, in which its thread would answer nobody
    let decoded = match info.bytes > INLINE_BYTES {
        true => tokio::task::spawn_blocking(decode)
            .await
            .unwrap_or_else(|panic| Err(panic.to_string())),
        false => decode(),
    };
    let damaged = |cause: String| part_of(key, name).damaged(cause);
    let (found, content) = decoded.map_err(damaged)?;
    match found == info {
        true => Ok(Some((found, content))),
        false => Err(damaged(format!(
            "{} bytes of another hash in place of {}",
            found.bytes, info.bytes
        ))),
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
        read_part(connection, key, &name).await?;
    }
    Ok(())
}
