//! The pages of the database: their number, how many of them are free, and their size.

use rusqlite::Connection;

use super::error::Result;

/// The number and the size of a database's pages.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pages {
    /// The number of all pages.
    pub(super) count: i64,
    /// The number of pages without content.
    pub(super) free: i64,
    /// The size of a page (bytes).
    bytes: i64,
}

impl Pages {
    /// The present pages of a database.
    pub(super) fn of(database: &Connection) -> Result<Pages> {
        let pages = "select page_count, freelist_count, page_size
                     from pragma_page_count, pragma_freelist_count, pragma_page_size";
        let (count, free, bytes) = database.query_row(pages, (), |row| row.try_into())?;
        Ok(Pages { count, free, bytes })
    }

    /// The size of this number of pages (bytes).
    pub(super) fn bytes_of(self, pages: i64) -> u64 {
        u64::try_from(pages.saturating_mul(self.bytes)).unwrap_or(0)
    }
}
