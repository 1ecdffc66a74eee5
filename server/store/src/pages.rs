//! The pages of the database: how large it is, and how much of it is free.

use rusqlite::Connection;

use super::error::Result;

/// The pages of a database.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pages {
    /// All of them.
    pub(super) count: i64,
    /// Pages without content.
    pub(super) free: i64,
    /// Bytes of each.
    bytes: i64,
}

impl Pages {
    /// As they are now.
    pub(super) fn of(database: &Connection) -> Result<Pages> {
        let pages = "select page_count, freelist_count, page_size
                     from pragma_page_count, pragma_freelist_count, pragma_page_size";
        let (count, free, bytes) = database.query_row(pages, (), |row| row.try_into())?;
        Ok(Pages { count, free, bytes })
    }

    /// Bytes of so many of them.
    pub(super) fn bytes_of(self, pages: i64) -> u64 {
        u64::try_from(pages.saturating_mul(self.bytes)).unwrap_or(0)
    }
}
