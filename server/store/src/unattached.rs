//! Content that is not attached yet: writes it in several short transactions, and removes it if nothing needs it any
//! more.

use std::sync::Arc;

use rusqlite::Connection;

use super::{
    content::{self, Fingerprint},
    database::Store,
    error::{Record, Result},
    sql::Sql,
};

impl Store {
    /// Writes pieces of content, numbered from `first`. They stay once the content is attached.
    pub async fn write_pieces(
        self: &Arc<Self>,
        content: &Fingerprint,
        first: usize,
        pieces: Vec<Vec<u8>>,
    ) -> Result<()> {
        let content = content.clone();
        self.write(move |writer| {
            let tx = writer.begin()?;
            content::write_pieces(&tx, &content, first, &pieces)?;
            tx.commit()
        })
        .await
    }

    /// Removes content that was written and never attached. Whoever stores the same content meanwhile finds it missing
    /// when attaching it.
    pub async fn discard_content(self: &Arc<Self>, content: &[&Fingerprint]) -> Result<()> {
        let hashes: Vec<Vec<u8>> = content.iter().map(|content| content.hash.clone()).collect();
        self.control(move |writer| {
            let tx = writer.begin_control()?;
            for hash in &hashes {
                let id: Option<i64> = tx.optional_value(
                    "select id from content where hash = ?
                     and not exists (select 1 from attachment where content = content.id)",
                    [hash],
                )?;
                content::remove(&tx, id.as_slice())?;
            }
            tx.commit()
        })
        .await
    }

    /// Removes all content that is not attached, because the service was interrupted while it was written. Returns how
    /// many pieces.
    pub async fn discard_unattached(self: &Arc<Self>) -> Result<usize> {
        let mut pieces = 0;
        loop {
            let unattached = self.read(|_, connection| unattached(connection)).await?;
            if unattached.is_empty() {
                return Ok(pieces); // nothing is written: the disk may be full
            }
            let removed = self.control(move |writer| {
                let tx = writer.begin_control()?;
                let removed = content::remove(&tx, &unattached)?;
                tx.commit()?;
                Ok(removed)
            });
            let removed = removed.await?;
            pieces += removed;
            if removed == 0 {
                return Ok(pieces); // a disk has changed where they are
            }
        }
    }
}

/// The ids of some content that is not attached, by the index and by the table itself: an index that lacks rows must
/// not lead to a removal.
fn unattached(connection: &Connection) -> Result<Vec<i64>> {
    const AT_ONCE: i64 = 100;
    let by_index: Vec<i64> = connection.values(
        "select id from content where not exists
             (select 1 from attachment indexed by attachment_by_content where content = content.id) limit ?",
        [AT_ONCE],
    )?;
    if by_index.is_empty() {
        return Ok(by_index);
    }
    let attached: Vec<i64> = connection.values(
        "select content from attachment not indexed where content in (select value from json_each(?))",
        [serde_json::to_string(&by_index)?],
    )?;
    if attached.is_empty() {
        Ok(by_index)
    } else {
        Err(Record::named("index of what is attached")
            .damaged("it lacks what the table has: nothing is removed"))
    }
}
