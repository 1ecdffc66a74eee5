//! The space of the database on the disk: tells its size, and gives free space back to the file system.

use std::{path::Path, sync::Arc, time::Duration};

use super::{
    compact,
    connections::{BUSY_TIMEOUT, blocking},
    database::{Rebuild, Store, with_advice},
    delete::PAUSE,
    error::{Result, StoreError},
    folder::{DATABASE, LOG, LOG_BYTES},
    pages::Pages,
    sql::Sql,
};

/// The number of free pages that stay in the file, since new rows fill them soon: 4 MiB.
const KEPT_PAGES: i64 = 1024;

/// The space of a store, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Space {
    /// The size of the database and its write-ahead log.
    pub used: u64,
    /// The part of the database without content, which later data will fill.
    pub unused: u64,
    /// The free space of the file system.
    pub free: u64,
}

impl Store {
    /// Measures the space of the store.
    pub async fn space(self: &Arc<Self>) -> Result<Space> {
        let pages = self.pages().await?;
        let folder = self.folder.path();
        let free = rustix::fs::statvfs(folder).map_or(0, |free| free.f_bavail * free.f_frsize);
        Ok(Space {
            // pages that are only in the log are counted with the log
            used: self.length(DATABASE) + self.length(LOG),
            unused: pages.bytes_of(pages.free),
            free,
        })
    }

    /// The pages of the store's database.
    async fn pages(self: &Arc<Self>) -> Result<Pages> {
        self.read(|_, connection| Pages::of(connection)).await
    }

    /// Gives free pages back to the file system if there are many, or all of them if the disk is full; returns how
    /// many.
    pub async fn give_space_back(self: &Arc<Self>) -> Result<i64> {
        let gives_back = self.read(|_, connection| compact::gives_back(connection));
        let given = if gives_back.await? {
            self.free_pages().await?
        } else {
            0 // of an earlier version
        };
        self.shorten_files().await?;
        Ok(given)
    }

    /// Takes free pages out of the database, some at a time; returns how many. The file has them until the log is
    /// copied into it.
    async fn free_pages(self: &Arc<Self>) -> Result<i64> {
        let full = self.reserve.is_disk_full();
        let kept = if full { 0 } else { KEPT_PAGES };
        let mut given = 0;
        loop {
            let before = self.pages().await?;
            if before.free <= kept {
                return Ok(given);
            }
            // the log may be copied into the file with the commit
            self.identity.may_shrink_to(least_bytes(before));
            let give = self.control(|writer| {
                let tx = writer.begin_control()?;
                // 1 MiB; it takes a step for each page
                tx.rows("pragma incremental_vacuum(256)", (), |_| Ok(()))?;
                tx.commit()
            });
            give.await?;
            let after = self.pages().await?;
            self.identity.may_shrink_to(after.bytes_of(after.count));
            given += before.free - after.free;
            if after.free >= before.free {
                return Ok(given); // others have written meanwhile
            }
            tokio::time::sleep(PAUSE).await;
        }
    }

    /// Shrinks the files of the database to the size of their content: SQLite does so only after a thousand more pages
    /// were written, and never on a full disk, where the log is emptied too, since the reserve may lack just its space.
    /// If a reader still needs pages of the log, the next call does it.
    async fn shorten_files(self: &Arc<Self>) -> Result<()> {
        let pages = self.pages().await?;
        let content = pages.bytes_of(pages.count);
        let full = self.reserve.is_disk_full();
        let kept = if full { 0 } else { LOG_BYTES };
        if self.length(DATABASE) > content {
            self.identity.may_shrink_to(content);
        } else if self.length(LOG) <= kept {
            return Ok(());
        }
        self.write(move |writer| {
            let connection = writer.connection();
            // waits for nobody
            connection.execute_batch("pragma wal_checkpoint(passive)")?;
            if full {
                connection.busy_timeout(Duration::ZERO)?;
                let emptied = connection.execute_batch("pragma wal_checkpoint(truncate)");
                connection.busy_timeout(BUSY_TIMEOUT)?;
                emptied?;
            } else if writer.store.length(LOG) > LOG_BYTES {
                // the next transaction begins the log anew
                writer.begin_control()?.commit()?;
            }
            Ok(())
        })
        .await
    }

    /// The size of a file in the store's folder (bytes).
    fn length(&self, name: &str) -> u64 {
        std::fs::metadata(self.folder.path().join(name)).map_or(0, |file| file.len())
    }
}

/// The smallest size of the database (bytes): without its free pages, and without some pages that tell where others
/// are.
fn least_bytes(pages: Pages) -> u64 {
    let of_places = pages.count / 500 + 2;
    pages.bytes_of(pages.count - pages.free - of_places)
}

/// Rebuilds the database of a store that no service uses; returns its size before and after (bytes).
pub async fn compact_folder(folder: &Path) -> Result<(u64, u64)> {
    if !folder.join(DATABASE).exists() {
        let text = format!("there is no store in {}", folder.display());
        return Err(StoreError::Folder(text));
    }
    let path = folder.to_owned();
    let connected = blocking(move || Store::connect(&path, Rebuild::Never)).await;
    let (store, _) = connected.map_err(|error| with_advice(error, folder))?;
    let store = Arc::new(store);
    let before = store.space().await?.used;
    // no other connection may have read anything; the one beside the writer has not
    store.close_readers().await;
    let compacted = store.write(|writer| Ok(compact::compact(writer.connection())));
    let compacted = compacted.await;
    store.close_as_found().await;
    compacted??;
    let after = std::fs::metadata(folder.join(DATABASE)).map_or(0, |file| file.len());
    Ok((before, after))
}
