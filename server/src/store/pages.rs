//! The pages of the database: how large it is, and how much of it is free.

use sqlx::sqlite::SqliteExecutor;

use super::error::Result;

/// The pages of a database.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pages {
    /// All of them.
    pub(super) count: i64,
    /// Those without content.
    pub(super) free: i64,
    /// Bytes of each.
    bytes: i64,
}

impl Pages {
    /// As they are now.
    pub(super) async fn of(database: impl SqliteExecutor<'_>) -> Result<Pages> {
        let (count, free, bytes) = sqlx::query_as(
            "select page_count, freelist_count, page_size
             from pragma_page_count, pragma_freelist_count, pragma_page_size",
        )
        .fetch_one(database)
        .await?;
        Ok(Pages { count, free, bytes })
    }

    /// Bytes of so many of them.
    pub(super) fn bytes_of(self, pages: i64) -> u64 {
        u64::try_from(pages.saturating_mul(self.bytes)).unwrap_or(0)
    }
}
