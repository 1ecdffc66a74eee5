//! Writes the result of a job, in pieces before the job ends, and reads it, part by part.

use std::sync::Arc;

use base::job::ResultAvailable;
use rusqlite::Connection;

use super::{
    change::Change,
    content::{self, Content, Holder, PIECES_PER_COMMIT, name},
    database::Store,
    encoding::{self, Decoded, PartInfo, decoded},
    error::{Record, Result},
    intact::{self, Intact},
    parts::{Entry, HEADER_BYTES, Parts, index_bytes, read_index},
    rows::is_current,
    sizes,
    sql::Sql,
};

impl Store {
    /// Writes the content of a large result in several short transactions, before the job ends; false when the attempt
    /// is no longer the current one. Small content is written when the job ends.
    pub async fn write_before_end(
        self: &Arc<Self>,
        key: i64,
        attempt: i32,
        parts: &Parts,
    ) -> Result<bool> {
        for (_, content) in parts.contents() {
            let pieces = content.pieces();
            if pieces.len() == 1 {
                continue;
            }
            for (group, pieces) in pieces.chunks(PIECES_PER_COMMIT).enumerate() {
                let first = group * PIECES_PER_COMMIT;
                let pieces: Vec<Vec<u8>> = pieces.iter().map(|piece| piece.to_vec()).collect();
                let fingerprint = content.fingerprint.clone().into_owned();
                let written = self.write(move |writer| {
                    let tx = writer.begin()?;
                    if !is_current(&tx, key, attempt)? {
                        return Ok(false);
                    }
                    content::write_pieces(&tx, &fingerprint, first, &pieces)?;
                    tx.commit()?;
                    Ok(true)
                });
                if !written.await? {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// Removes the content of a result that was written for a job and attached to none.
    pub async fn discard_parts(self: &Arc<Self>, parts: &Parts) -> Result<()> {
        self.discard_content(&parts.fingerprints()).await
    }

    /// Stores the partial result of a running job (its finished load steps) in place of an earlier one; false when the
    /// attempt is no longer the current one.
    pub async fn write_partial(
        self: &Arc<Self>,
        key: i64,
        attempt: i32,
        parts: &Arc<Parts>,
    ) -> Result<bool> {
        let parts = parts.clone();
        self.write(move |writer| {
            let mut change = writer.change()?;
            if !change.is_current(key, attempt)? {
                return Ok(false);
            }
            attach(&mut change, key, &parts)?;
            let partial = ResultAvailable::Partial;
            change.set(key, |row| row.job.result_available = partial)?;
            change.commit()?;
            Ok(true)
        })
        .await
    }

    /// The largest memory (bytes) that reading a part of the result of this job takes; `None` if there is no such part.
    pub async fn part_memory(self: &Arc<Self>, key: i64, part: &str) -> Result<Option<usize>> {
        let part = part.to_owned();
        self.read(move |store, connection| {
            let tx = connection.unchecked_transaction()?;
            let Some(found) = StoredResult::of(&tx, key)? else {
                return Ok(None);
            };
            found.memory_to_read(&tx, &store.intact, &part)
        })
        .await
    }
}

/// Attaches a result to a job in place of an earlier one.
pub(super) fn attach(change: &mut Change<'_>, key: i64, parts: &Parts) -> Result<()> {
    let tx = change.sql()?;
    remove(tx, key)?;
    for (name, content) in parts.contents() {
        let job = Holder::Job(key);
        // large content was written before the end of the job; that of a partial result was not
        let written = content.fingerprint.pieces() > 1
            && content::attach_written(tx, job, name, &content.fingerprint)?;
        if !written {
            content::attach(tx, job, name, &content)?;
        }
    }
    Ok(())
}

/// Gives the job `to` the result of the job `from`.
pub(super) fn share(tx: &Connection, from: i64, to: i64) -> Result<()> {
    content::copy(tx, from, to, &name::OF_RESULT)
}

/// Removes the result of a job.
pub(super) fn remove(tx: &Connection, key: i64) -> Result<()> {
    content::detach(tx, Holder::Job(key), &name::OF_RESULT)
}

fn has_result(connection: &Connection, key: i64) -> Result<bool> {
    let available = "select exists (select 1 from job where id = ? and result_available <> 'none')";
    connection.value(available, [key])
}

/// The result of a job as it is stored: the index was read, the parts were not.
pub(super) struct StoredResult {
    key: i64,
    content: Content,
    /// The content of the fields, if they are kept.
    fields: Option<Content>,
    entries: Vec<Entry>,
    /// The bytes of the first pieces, at least up to the end of the index.
    begin: Vec<u8>,
}

impl StoredResult {
    /// The result of a job, if it has one; an error if its row says that it has one, and none is attached. The
    /// connection is in a transaction, so that both are of one moment.
    pub(super) fn of(connection: &Connection, key: i64) -> Result<Option<StoredResult>> {
        let record = || Record::of_job(key, name::RESULT);
        let found = StoredResult::read_index(connection, key);
        let found = found.map_err(|error| error.reading(record))?;
        if found.is_none() && has_result(connection, key)? {
            return Err(record().damaged("it is missing"));
        }
        Ok(found)
    }

    fn read_index(connection: &Connection, key: i64) -> Result<Option<StoredResult>> {
        let (mut content, mut fields) = (None, None);
        for attached in content::all(connection, Holder::Job(key))? {
            match attached.name.as_str() {
                name::RESULT => content = Some(attached),
                name::FIELDS => fields = Some(attached),
                _ => {}
            }
        }
        let Some(content) = content else {
            return Ok(None);
        };
        let damaged = |cause: String| content.record().damaged(cause);
        let mut begin = content.piece(connection, 0)?;
        let index_end = HEADER_BYTES + index_bytes(&begin).map_err(damaged)?;
        for number in 1..content.fingerprint.pieces() {
            if begin.len() >= index_end {
                break;
            }
            begin.extend(content.piece(connection, number)?);
        }
        let entries = read_index(&begin).map_err(damaged)?;
        Ok(Some(StoredResult {
            key,
            content,
            fields,
            entries,
            begin,
        }))
    }

    /// The names of all parts.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        let is_kept = |entry: &&Entry| entry.name != name::FIELDS || self.fields.is_some();
        let entries = self.entries.iter().filter(is_kept);
        entries.map(|entry| entry.name.as_str())
    }

    /// The id of the content of the fields, and the size and hash of their JSON.
    pub(super) fn fields(&self) -> Option<(i64, &PartInfo)> {
        let (entry, _) = self.find(name::FIELDS)?;
        Some((self.fields.as_ref()?.id, &entry.info))
    }

    /// An error if the fields, which the result had and which are not attached, were not deleted.
    fn must_be_without_fields(&self, connection: &Connection) -> Result<()> {
        match sizes::lost_fields(connection, self.key)? {
            true => Ok(()),
            false => Err(self.record(name::FIELDS).damaged("it is missing")),
        }
    }

    /// The entry of a part in the index, with the place of its first byte after the index.
    fn find(&self, part: &str) -> Option<(&Entry, usize)> {
        let mut place = 0usize;
        for entry in &self.entries {
            if entry.name == part {
                return Some((entry, place));
            }
            place = place.saturating_add(entry.bytes);
        }
        None
    }

    fn record(&self, part: &str) -> Record {
        Record::of_job(self.key, format!("result part {part}"))
    }

    /// A part, compared with its size and hash; `None` if there is no such part.
    pub(super) fn read(
        &self,
        connection: &Connection,
        part: &str,
    ) -> Result<Option<(PartInfo, Decoded)>> {
        let Some((entry, place)) = self.find(part) else {
            return Ok(None);
        };
        let stored = match (part, &self.fields) {
            (name::FIELDS, None) => return self.must_be_without_fields(connection).map(|()| None),
            (name::FIELDS, Some(fields)) => fields.read(connection),
            _ => self.bytes(connection, place, entry.bytes),
        };
        let stored = stored.map_err(|error| error.reading(|| self.record(part)))?;
        match decoded(stored, entry.encoding, &entry.info) {
            Ok((found, decoded)) if found == entry.info => Ok(Some((found, decoded))),
            Ok((found, _)) => Err(self.record(part).damaged(format!(
                "its size or hash is not the recorded one: {} bytes were read, {} are recorded",
                found.bytes, entry.info.bytes
            ))),
            Err(cause) => Err(self.record(part).damaged(cause)),
        }
    }

    /// The bytes from `place` after the index, from the pieces that have them.
    fn bytes(&self, connection: &Connection, place: usize, length: usize) -> Result<Vec<u8>> {
        let first = HEADER_BYTES + index_bytes(&self.begin).unwrap_or_default() + place;
        let end = first.saturating_add(length);
        if end > self.content.fingerprint.bytes {
            return Err(self.content.record().damaged("its index is of other parts"));
        }
        let begin = self.begin.get(first..).unwrap_or_default();
        let mut found = begin[..begin.len().min(length)].to_vec();
        while found.len() < length {
            let place = first + found.len();
            let (number, offset) = (place / content::PIECE_BYTES, place % content::PIECE_BYTES);
            let piece = self.content.piece(connection, number)?;
            let more = piece.get(offset..).unwrap_or_default();
            if more.is_empty() {
                return Err(self.content.record().damaged("a piece is cut off"));
            }
            found.extend_from_slice(&more[..more.len().min(length - found.len())]);
        }
        Ok(found)
    }

    /// The largest memory (bytes) that reading a part takes; `None` if there is no such part.
    fn memory_to_read(
        &self,
        connection: &Connection,
        intact: &Intact,
        part: &str,
    ) -> Result<Option<usize>> {
        let Some((entry, _)) = self.find(part) else {
            return Ok(None);
        };
        let (first, stored) = match (part, &self.fields) {
            (name::FIELDS, None) => return self.must_be_without_fields(connection).map(|()| None),
            (name::FIELDS, Some(fields)) => {
                // how much they take is told by their first bytes
                intact::check(connection, intact, fields)?;
                (fields.piece(connection, 0)?, fields.fingerprint.bytes)
            }
            _ => (vec![], entry.bytes),
        };
        let json = usize::try_from(entry.info.bytes).unwrap_or(usize::MAX);
        let memory = encoding::memory_to_read(&first, stored, entry.encoding, json);
        memory
            .map(Some)
            .map_err(|cause| self.record(part).damaged(cause))
    }

    /// Reads every part, to check it; an error if one is damaged or the summary is missing.
    pub(super) fn check(&self, connection: &Connection) -> Result<()> {
        if !self.names().any(|name| name == "summary") {
            return Err(self.record("summary").damaged("it is missing"));
        }
        self.content.check(connection)?;
        for name in self.names() {
            self.read(connection, name)?;
        }
        Ok(())
    }
}
