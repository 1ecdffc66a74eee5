//! The space of the database on the disk: how much it is, and what is free in it given back to the file system.

use std::path::Path;

use sqlx::SqliteConnection;

use super::{
    compact,
    database::{Store, with_advice},
    error::{Result, StoreError},
    folder::DATABASE,
};

/// Free pages that stay in the file, since new rows fill them soon: 4 MiB.
const KEPT_PAGES: i64 = 1024;

/// The space of a store, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Space {
    /// Of the database and its write-ahead log.
    pub used: u64,
    /// Of it without content, for what comes next.
    pub unused: u64,
    /// What the file system has left.
    pub free: u64,
}

impl Store {
    /// The space of the store.
    pub async fn space(&self) -> Result<Space> {
        let mut connection = self.reader.acquire().await?;
        let bytes = async |connection: &mut SqliteConnection, of: &'static str| -> Result<u64> {
            let pages: i64 = sqlx::query_scalar(of).fetch_one(&mut *connection).await?;
            let page: i64 = sqlx::query_scalar("pragma page_size")
                .fetch_one(connection)
                .await?;
            Ok(u64::try_from(pages.saturating_mul(page)).unwrap_or(0))
        };
        let used = bytes(&mut connection, "pragma page_count").await?;
        let unused = bytes(&mut connection, "pragma freelist_count").await?;
        let folder = self.folder.path();
        let log = std::fs::metadata(folder.join(super::folder::LOG)).map_or(0, |log| log.len());
        let free = rustix::fs::statvfs(folder).map_or(0, |free| free.f_bavail * free.f_frsize);
        Ok(Space {
            used: used + log,
            unused,
            free,
        })
    }

    /// Gives free pages back to the file system, some at a time, as long as there are many; how many were.
    pub async fn give_space_back(&self) -> Result<i64> {
        let mut given = 0;
        loop {
            let free = self.free_pages().await?;
            if free <= KEPT_PAGES {
                return Ok(given);
            }
            self.identity.may_shrink_to(self.least_bytes().await?);
            let give = async {
                let mut tx = self.begin_control().await?;
                // 1 MiB; it takes a step for each page
                sqlx::query("pragma incremental_vacuum(256)")
                    .fetch_all(&mut *tx)
                    .await?;
                tx.commit().await
            };
            self.writing(give).await?;
            let left = self.free_pages().await?;
            if left >= free {
                return Ok(given); // a database that cannot
            }
            given += free - left;
            tokio::task::yield_now().await;
        }
    }

    /// As small as the database can become, in bytes: without free pages, and some that tell where others are.
    async fn least_bytes(&self) -> Result<u64> {
        let (pages, free, page): (i64, i64, i64) = sqlx::query_as(
            "select page_count, freelist_count, page_size from pragma_page_count(), pragma_freelist_count(), pragma_page_size()",
        )
        .fetch_one(&self.reader)
        .await?;
        let of_places = pages / 500 + 2;
        Ok(u64::try_from((pages - free - of_places) * page).unwrap_or(0))
    }

    async fn free_pages(&self) -> Result<i64> {
        let free = sqlx::query_scalar("pragma freelist_count");
        Ok(free.fetch_one(&self.reader).await?)
    }
}

/// Rebuilds the database of a store that no service uses; its size before and after, in bytes.
pub async fn compact_folder(folder: &Path) -> Result<(u64, u64)> {
    if !folder.join(DATABASE).exists() {
        let text = format!("there is no store in {}", folder.display());
        return Err(StoreError::Folder(text));
    }
    let connected = Store::connect(folder).await;
    let (store, _) = connected.map_err(|error| with_advice(error, folder))?;
    let before = store.space().await?.used;
    // only the one that writes may be open
    store.lists.close().await;
    store.reader.close().await;
    let compacted = compact::compact(&mut *store.writer.acquire().await?).await;
    store.close_as_found().await;
    compacted?;
    let after = std::fs::metadata(folder.join(DATABASE)).map_or(0, |file| file.len());
    Ok((before, after))
}
