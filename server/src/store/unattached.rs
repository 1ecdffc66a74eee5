//! Content that is not attached yet: written in several short transactions, and removed if nothing needs it any more.

use super::{
    content::{self, Fingerprint},
    database::Store,
    error::{Record, Result},
};

impl Store {
    /// Writes pieces of content, numbered from `first`. They are kept once it is attached.
    pub async fn write_pieces(
        &self,
        content: &Fingerprint,
        first: usize,
        pieces: &[impl AsRef<[u8]> + Sync],
    ) -> Result<()> {
        let write = async {
            let mut tx = self.begin().await?;
            content::write_pieces(&mut tx, content, first, pieces).await?;
            tx.commit().await
        };
        self.writing(write).await
    }

    /// Removes content that was written and never attached. One who stores the same content meanwhile notices that it is gone.
    pub async fn discard_content(&self, content: &[&Fingerprint]) -> Result<()> {
        self.control(|| async {
            let mut tx = self.begin_control().await?;
            for fingerprint in content {
                let id: Option<i64> = sqlx::query_scalar(
                    "select id from content where hash = ?
                     and not exists (select 1 from attachment where content = content.id)",
                )
                .bind(&fingerprint.hash)
                .fetch_optional(&mut *tx)
                .await?;
                content::remove(&mut tx, id.as_slice()).await?;
            }
            tx.commit().await
        })
        .await
    }

    /// Removes all content that is not attached: what was being written when the service was interrupted. How many pieces.
    pub async fn discard_unattached(&self) -> Result<u64> {
        let mut pieces = 0;
        loop {
            let unattached = self.damages.noting(self.unattached()).await?;
            if unattached.is_empty() {
                return Ok(pieces); // nothing is written: the disk may be full
            }
            let removed = self
                .control(|| async {
                    let mut tx = self.begin_control().await?;
                    let removed = content::remove(&mut tx, &unattached).await?;
                    tx.commit().await?;
                    Ok(removed)
                })
                .await?;
            pieces += removed;
            if removed == 0 {
                return Ok(pieces); // a disk has changed where they are
            }
        }
    }

    /// Some content that is not attached, by the index and by the table itself: what an index lacks must not be removed.
    async fn unattached(&self) -> Result<Vec<i64>> {
        const AT_ONCE: i64 = 100;
        let by_index: Vec<i64> = sqlx::query_scalar(
            "select id from content where not exists
                 (select 1 from attachment indexed by attachment_by_content where content = content.id) limit ?",
        )
        .bind(AT_ONCE)
        .fetch_all(&self.reader)
        .await?;
        if by_index.is_empty() {
            return Ok(by_index);
        }
        let attached: Vec<i64> = sqlx::query_scalar(
            "select content from attachment not indexed where content in (select value from json_each(?))",
        )
        .bind(serde_json::to_string(&by_index)?)
        .fetch_all(&self.reader)
        .await?;
        match attached.is_empty() {
            true => Ok(by_index),
            false => Err(Record::named("index of what is attached")
                .damaged("it lacks what the table has: nothing is removed")),
        }
    }
}
