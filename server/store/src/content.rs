//! Content: bytes, stored once by their hash, in pieces, and attached to jobs and meshes under names.
//!
//! Large content is written in several short transactions before it is attached; nobody reads it before that. Content
//! is removed by a trigger (`migrations/0017_content.sql`) with the last job or mesh that it is attached to; content
//! that was never attached is removed by [`Store::discard_content`] or at the next start. It is compared with its hash
//! whenever it is read as a whole.
//!
//! [`Store::discard_content`]: super::Store::discard_content

use std::borrow::Cow;

use rusqlite::{Connection, Row, ToSql, params, params_from_iter};
use sha2::{Digest, Sha256};

use super::{
    checksum::Checksum,
    error::{Record, Result},
    sql::{Sql, text},
};

/// The largest size of a piece (bytes): with larger rows SQLite chains pages, and readers need more memory.
pub const PIECE_BYTES: usize = 256 << 10;
/// The number of pieces that one transaction writes: 1 MiB occupies the single writer for some ten milliseconds, so
/// that a cancel or a submission during the write of a large result is still answered at once.
pub const PIECES_PER_COMMIT: usize = 4;

/// The job or mesh that content is attached to, by its key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Holder {
    Job(i64),
    Mesh(i64),
}

/// Names under which content is attached.
pub(super) mod name {
    /// The name of the problem of a job: its JSON without the title.
    pub(crate) const PROBLEM: &str = "problem";
    /// The name of the result of a job without its fields, see `parts`.
    pub(crate) const RESULT: &str = "result";
    /// The name of the fields of a job.
    pub(crate) const FIELDS: &str = "fields";
    /// The names of the content that is attached to a job with a result.
    pub(crate) const OF_RESULT: [&str; 2] = [RESULT, FIELDS];
    /// The name of the definition of the sweep of a job: JSON.
    pub(crate) const DEFINITION: &str = "definition";
    /// The name of the body of a mesh: the parsed mesh.
    pub(crate) const MESH: &str = "mesh";
}

impl Holder {
    fn kind_and_key(self) -> (&'static str, i64) {
        match self {
            Holder::Job(key) => ("job", key),
            Holder::Mesh(key) => ("mesh", key),
        }
    }

    /// The record of the holder's content of this name, as errors name it.
    pub(super) fn record(self, name: &str) -> Record {
        match self {
            Holder::Job(key) => Record::of_job(key, name),
            Holder::Mesh(key) => Record::named(format!("{name} number {key}")),
        }
    }
}

/// The hash and the size of content.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fingerprint {
    /// The SHA-256 of the bytes.
    pub hash: Vec<u8>,
    /// The number of bytes.
    pub bytes: usize,
}

impl Fingerprint {
    /// The fingerprint of the bytes of all chunks, one after the other.
    pub(super) fn of<'a>(chunks: impl IntoIterator<Item = &'a [u8]>) -> Fingerprint {
        let (mut hash, mut bytes) = (Sha256::new(), 0);
        for chunk in chunks {
            hash.update(chunk);
            bytes += chunk.len();
        }
        let hash = hash.finalize().to_vec();
        Fingerprint { hash, bytes }
    }

    /// The number of pieces in which the content is stored: one if it is empty.
    pub(super) fn pieces(&self) -> usize {
        self.bytes.div_ceil(PIECE_BYTES).max(1)
    }

    fn checksum(&self) -> i64 {
        let sum = Checksum::new().bytes(&self.hash);
        sum.int(self.bytes as i64).stored()
    }
}

/// Content that is to be stored: the bytes of its chunks, one after the other.
pub(super) struct NewContent<'a> {
    pub(super) fingerprint: Cow<'a, Fingerprint>,
    pub(super) chunks: Vec<&'a [u8]>,
}

impl<'a> NewContent<'a> {
    /// Content of these bytes, whose hash is computed here.
    pub(super) fn new(bytes: &'a [u8]) -> NewContent<'a> {
        NewContent {
            fingerprint: Cow::Owned(Fingerprint::of([bytes])),
            chunks: vec![bytes],
        }
    }

    /// The pieces in which the bytes are stored, in order.
    pub(super) fn pieces(&self) -> Vec<Cow<'a, [u8]>> {
        let mut pieces: Vec<Cow<'a, [u8]>> = vec![Cow::Borrowed(&[])];
        for chunk in &self.chunks {
            let mut chunk = *chunk;
            // fills up the last piece first
            if let Some(last) = pieces.last_mut().filter(|last| last.len() < PIECE_BYTES) {
                let (more, rest) = chunk.split_at(chunk.len().min(PIECE_BYTES - last.len()));
                last.to_mut().extend_from_slice(more);
                chunk = rest;
            }
            pieces.extend(chunk.chunks(PIECE_BYTES).map(Cow::Borrowed));
        }
        pieces
    }
}

/// Removes content that is not attached, by its ids; returns how many pieces it had.
pub(super) fn remove(tx: &Connection, ids: &[i64]) -> Result<usize> {
    let mut pieces = 0;
    for id in ids {
        pieces += tx.run("delete from content_piece where content = ?", [id])?;
        tx.run("delete from content where id = ?", [id])?;
    }
    Ok(pieces)
}

/// Writes pieces of content, numbered from `first`; returns the content's id. Pieces that were written before, and that
/// a disk has changed since, are written again, but not a piece of other content that a damaged index names.
pub(super) fn write_pieces(
    tx: &Connection,
    content: &Fingerprint,
    first: usize,
    pieces: &[impl AsRef<[u8]>],
) -> Result<i64> {
    let id = insert(tx, content)?;
    for (number, piece) in (first as i64..).zip(pieces) {
        tx.run(
            "insert into content_piece (content, piece, body) values (?, ?, ?)
             on conflict do update set body = excluded.body
                 where content = excluded.content and piece = excluded.piece and body <> excluded.body",
            params![id, number, piece.as_ref()],
        )?;
    }
    Ok(id)
}

/// The id of the content with this hash, which is inserted if it does not exist.
fn insert(tx: &Connection, content: &Fingerprint) -> Result<i64> {
    tx.value(
        "insert into content (hash, bytes, checksum) values (?, ?, ?)
         on conflict (hash) do update set bytes = excluded.bytes, checksum = excluded.checksum
         returning id",
        params![content.hash, content.bytes as i64, content.checksum()],
    )
}

/// Writes content, and attaches it under a name that the holder does not use yet. Pieces that are already stored, and
/// that a disk has changed, are written again.
pub(super) fn attach(
    tx: &Connection,
    holder: Holder,
    name: &str,
    content: &NewContent<'_>,
) -> Result<()> {
    let fingerprint = &*content.fingerprint;
    let id = write_pieces(tx, fingerprint, 0, &content.pieces())?;
    attach_stored(tx, holder, name, id, &fingerprint.hash)
}

/// Attaches content whose pieces were written before; false if a piece is missing.
pub(super) fn attach_written(
    tx: &Connection,
    holder: Holder,
    name: &str,
    content: &Fingerprint,
) -> Result<bool> {
    let id = insert(tx, content)?;
    if !has_all_pieces(tx, id, content)? {
        return Ok(false);
    }
    attach_stored(tx, holder, name, id, &content.hash)?;
    Ok(true)
}

fn has_all_pieces(tx: &Connection, id: i64, content: &Fingerprint) -> Result<bool> {
    let there = "select count(*) from content_piece where content = ?";
    let there: i64 = tx.value(there, [id])?;
    Ok(there == content.pieces() as i64)
}

fn attach_stored(tx: &Connection, holder: Holder, name: &str, id: i64, hash: &[u8]) -> Result<()> {
    let (kind, key) = holder.kind_and_key();
    let checksum = attachment_checksum(kind, key, name, hash);
    tx.run(
        "insert into attachment (kind, key, name, content, checksum) values (?, ?, ?, ?, ?)",
        params![kind, key, name, id, checksum],
    )?;
    Ok(())
}

fn attachment_checksum(kind: &str, key: i64, name: &str, hash: &[u8]) -> i64 {
    let sum = Checksum::new().text(kind).int(key).text(name);
    sum.bytes(hash).stored()
}

/// Attaches what the job `from` has under these names to the job `to`, too.
pub(super) fn copy(tx: &Connection, from: i64, to: i64, names: &[&str]) -> Result<()> {
    let attached = all(tx, Holder::Job(from))?;
    let copied = attached
        .iter()
        .filter(|content| names.contains(&content.name.as_str()));
    for content in copied {
        attach_stored(
            tx,
            Holder::Job(to),
            &content.name,
            content.id,
            &content.fingerprint.hash,
        )?;
    }
    Ok(())
}

/// Detaches the holder's content of these names.
pub(super) fn detach(tx: &Connection, holder: Holder, names: &[&str]) -> Result<()> {
    let (kind, key) = holder.kind_and_key();
    let places = vec!["?"; names.len()].join(", ");
    let statement =
        format!("delete from attachment where kind = ? and key = ? and name in ({places})");
    let names = names.iter().map(|name| name as &dyn ToSql);
    let params = [&kind as &dyn ToSql, &key].into_iter().chain(names);
    tx.run(&statement, params_from_iter(params))?;
    Ok(())
}

/// Content that is attached to a job or mesh.
#[derive(Debug)]
pub(super) struct Content {
    /// The number of the content in the table `content`.
    pub(super) id: i64,
    /// The name under which it is attached.
    pub(super) name: String,
    pub(super) fingerprint: Fingerprint,
    record: Record,
}

const ATTACHED: &str =
    "select name, attachment.checksum as attached, content, hash, bytes, content.checksum as stored
     from attachment left join content on content.id = content where kind = ? and key = ?";

/// The content that is attached under a name, if there is any.
pub(super) fn find(connection: &Connection, holder: Holder, name: &str) -> Result<Option<Content>> {
    let (kind, key) = holder.kind_and_key();
    let statement = format!("{ATTACHED} and name = ?");
    connection.row(&statement, params![kind, key, name], |row| {
        attached(row, holder)
    })
}

/// All content that is attached to the holder, in the order of its names.
pub(super) fn all(connection: &Connection, holder: Holder) -> Result<Vec<Content>> {
    let (kind, key) = holder.kind_and_key();
    let statement = format!("{ATTACHED} order by name");
    connection.rows(&statement, (kind, key), |row| attached(row, holder))
}

/// The attached content of a row, if the checksums match.
fn attached(row: &Row<'_>, holder: Holder) -> Result<Content> {
    let name = text(row, "name")?.to_owned();
    let record = holder.record(&name);
    let hash: Option<Vec<u8>> = row.get("hash")?;
    let Some(hash) = hash else {
        return Err(record.damaged("it is missing"));
    };
    let bytes: i64 = row.get("bytes")?;
    let fingerprint = Fingerprint {
        hash,
        bytes: usize::try_from(bytes).unwrap_or(usize::MAX),
    };
    let (kind, key) = holder.kind_and_key();
    let sums: (i64, i64) = (row.get("attached")?, row.get("stored")?);
    let expected = (
        attachment_checksum(kind, key, &name, &fingerprint.hash),
        fingerprint.checksum(),
    );
    if sums != expected {
        return Err(record.damaged("its checksum does not match its content"));
    }
    Ok(Content {
        id: row.get("content")?,
        name,
        fingerprint,
        record,
    })
}

/// The text that is attached under a name, where there must be one.
pub(super) fn read_text(connection: &Connection, holder: Holder, name: &str) -> Result<String> {
    let read = try_to_read_text(connection, holder, name);
    read.map_err(|error| error.reading(|| holder.record(name)))
}

/// Like [`read_text`], but a page that cannot be read is an error of the database, not of the holder.
pub(super) fn try_to_read_text(
    connection: &Connection,
    holder: Holder,
    name: &str,
) -> Result<String> {
    let found = find(connection, holder, name)?;
    let found = found.ok_or_else(|| holder.record(name).damaged("it is missing"))?;
    let bytes = found.read(connection)?;
    String::from_utf8(bytes).map_err(|error| holder.record(name).damaged(error))
}

impl Content {
    /// The record of this content, as errors name it.
    pub(super) fn record(&self) -> Record {
        self.record.clone()
    }

    /// The whole content, compared with its hash. A difference is an error of the holder; a page that cannot be read is
    /// an error of the database.
    pub(super) fn read(&self, connection: &Connection) -> Result<Vec<u8>> {
        let mut whole = Vec::with_capacity(self.fingerprint.bytes.min(MOST_RESERVED));
        for number in 0..self.fingerprint.pieces() {
            whole.extend(self.piece(connection, number)?);
        }
        self.compare(&Fingerprint::of([&*whole]))?;
        Ok(whole)
    }

    /// Compares the content with its hash, one piece after the other.
    pub(super) fn check(&self, connection: &Connection) -> Result<()> {
        let (mut hash, mut bytes) = (Sha256::new(), 0);
        for number in 0..self.fingerprint.pieces() {
            let piece = self.piece(connection, number)?;
            hash.update(&piece);
            bytes += piece.len();
        }
        let hash = hash.finalize().to_vec();
        self.compare(&Fingerprint { hash, bytes })
    }

    fn compare(&self, found: &Fingerprint) -> Result<()> {
        if *found == self.fingerprint {
            Ok(())
        } else {
            Err(self
                .record
                .clone()
                .damaged("its hash does not match its content"))
        }
    }

    /// The piece with this number, counted from 0. Its body is not verified: the hash is that of the whole content, which
    /// `read` and `check` compare. The index may be damaged, and name a piece of other content: what the row itself says is
    /// compared, which is read by its number and without the index.
    pub(super) fn piece(&self, connection: &Connection, number: usize) -> Result<Vec<u8>> {
        let piece = "select body, content = ?1 and piece = ?2 from content_piece not indexed
                     where rowid = (select rowid from content_piece where content = ?1 and piece = ?2)";
        let piece = connection.row(piece, (self.id, number as i64), |row| {
            // a text, too: only its hash tells whether it is as it was written
            Ok((row.get_ref(0)?.as_bytes()?.to_vec(), row.get(1)?))
        })?;
        match piece {
            Some((body, true)) => Ok(body),
            Some((_, false)) => Err(self
                .record
                .clone()
                .damaged("a piece belongs to other content")),
            None => Err(self.record.clone().damaged("a piece is missing")),
        }
    }
}

/// The most memory (bytes) that is reserved for content before it is read: a size that a disk has changed must not take
/// all memory.
const MOST_RESERVED: usize = 64 << 20;
