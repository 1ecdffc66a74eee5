//! Stored meshes.

use sqlx::{Row, SqliteConnection, sqlite::SqliteRow};

use super::{
    checksum,
    content::{self, Fingerprint, Holder, name},
    damage::Table,
    database::Store,
    error::{Record, Result, StoreError},
};
use crate::{caller::Owners, mesh::MeshInfo, time::Time};

/// The effect of removing a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Removal {
    /// It was removed.
    Removed,
    /// There is no such mesh.
    Unknown,
    /// Jobs that wait or run need it; it was not removed.
    InUse,
}

/// A stored mesh, with its place in the list.
#[derive(Debug)]
pub struct StoredMesh {
    /// Order of arrival.
    pub key: i64,
    /// Its description, as clients see it.
    pub info: MeshInfo,
}

impl Store {
    /// The description of a mesh of these owners, as clients see it.
    pub async fn mesh(&self, owners: Owners<'_>, hash: &str) -> Result<Option<MeshInfo>> {
        let read = async {
            let row = match owners {
                Owners::All => sqlx::query("select * from mesh where hash = ?").bind(hash),
                Owners::Only(owner) => sqlx::query(
                    "select mesh.* from mesh join mesh_owner using (hash) where hash = ? and owner = ?",
                )
                .bind(hash)
                .bind(owner),
            };
            let row = row.fetch_optional(&self.reader).await?;
            if row.is_none() {
                self.damages.have_all(&[Table::Meshes])?;
            }
            row.as_ref().map(|row| Ok(described(row)?.info)).transpose()
        };
        self.damages.noting(read).await
    }

    /// Meshes of these owners that were stored before the one with key `before`, newest first.
    pub async fn meshes(
        &self,
        owners: Owners<'_>,
        before: Option<i64>,
        limit: i64,
    ) -> Result<Vec<StoredMesh>> {
        let read = async {
            let rows = match owners {
                Owners::All => {
                    sqlx::query("select * from mesh where id < ? order by id desc limit ?")
                }
                Owners::Only(owner) => sqlx::query(
                    "select mesh.* from mesh join mesh_owner using (hash)
                     where owner = ? and id < ? order by id desc limit ?",
                )
                .bind(owner),
            };
            let rows = rows
                .bind(before.unwrap_or(i64::MAX))
                .bind(limit)
                .fetch_all(&self.reader)
                .await?;
            self.damages.have_all(&[Table::Meshes])?;
            rows.iter().map(described).collect()
        };
        self.damages.noting(read).await
    }

    /// Makes a stored mesh one of this owner's, too; false if it was before. `None`: it is not stored.
    pub async fn own_mesh(&self, owner: &str, hash: &str) -> Result<Option<bool>> {
        let write = async {
            let mut tx = self.begin().await?;
            let stored: bool =
                sqlx::query_scalar("select exists (select 1 from mesh where hash = ?)")
                    .bind(hash)
                    .fetch_one(&mut *tx)
                    .await?;
            if !stored {
                return Ok(None);
            }
            let new = own(&mut tx, owner, hash, self.now()).await?;
            tx.commit().await?;
            Ok(Some(new))
        };
        self.writing(write).await
    }

    /// Completes a mesh, whose body was written before, as this owner's; false if it was theirs already. `None`: some of the body
    /// was removed meanwhile, with an earlier mesh of the same file, and must be written again.
    pub async fn insert_mesh(
        &self,
        owner: &str,
        info: &MeshInfo,
        body: &Fingerprint,
    ) -> Result<Option<bool>> {
        let write = async {
            let mut tx = self.begin().await?;
            let key: Option<i64> = sqlx::query_scalar(
                "insert into mesh (hash, info, created_at) values (?, ?, ?) on conflict do nothing returning id",
            )
            .bind(&info.hash)
            .bind(serde_json::to_string(info)?)
            .bind(info.created_at.micros())
            .fetch_optional(&mut *tx)
            .await?;
            if let Some(key) = key {
                checksum::seal(&mut tx, "mesh", "id", key).await?;
                let attach = content::attach_written(&mut tx, Holder::Mesh(key), name::MESH, body);
                if !attach.await? {
                    return Ok(None);
                }
            }
            let new = own(&mut tx, owner, &info.hash, info.created_at).await?;
            tx.commit().await?;
            Ok(Some(new))
        };
        self.writing(write).await
    }

    /// The parsed mesh as it was written.
    pub async fn mesh_body(&self, hash: &str) -> Result<Option<Vec<u8>>> {
        let read = async {
            // one transaction sees one state: a mesh with its body, or no mesh
            let mut tx = self.reader.begin().await?;
            read_body(&mut tx, hash).await
        };
        self.damages.noting(read).await
    }

    /// Removes a mesh of these owners, unless one of their jobs that wait or run needs it. Its content goes with the last
    /// owner, as soon as no job needs it.
    pub async fn remove_mesh(&self, owners: Owners<'_>, hash: &str) -> Result<Removal> {
        self.control(|| self.try_to_remove_mesh(owners, hash)).await
    }

    async fn try_to_remove_mesh(&self, owners: Owners<'_>, hash: &str) -> Result<Removal> {
        let mut tx = self.begin_control().await?;
        let only = match owners {
            Owners::All => None,
            Owners::Only(owner) => Some(owner),
        };
        let theirs: bool = sqlx::query_scalar(
                "select exists (select 1 from mesh where hash = ?1
                 and (?2 is null or exists (select 1 from mesh_owner where hash = ?1 and owner = ?2)))",
            )
            .bind(hash)
            .bind(only)
            .fetch_one(&mut *tx)
            .await?;
        if !theirs {
            return Ok(Removal::Unknown);
        }
        if is_needed(&mut tx, only, hash).await? {
            return Ok(Removal::InUse);
        }
        sqlx::query("delete from mesh_owner where hash = ?1 and (?2 is null or owner = ?2)")
            .bind(hash)
            .bind(only)
            .execute(&mut *tx)
            .await?;
        let others: bool =
            sqlx::query_scalar("select exists (select 1 from mesh_owner where hash = ?)")
                .bind(hash)
                .fetch_one(&mut *tx)
                .await?;
        if others {
            tx.commit().await?;
            return Ok(Removal::Removed);
        }
        // an administrator's, on a mesh that was another's
        if is_needed(&mut tx, None, hash).await? {
            return Ok(Removal::InUse);
        }
        if let Some(key) = key_of(&mut tx, hash).await? {
            content::detach(&mut tx, Holder::Mesh(key), &[name::MESH]).await?;
        }
        sqlx::query("delete from mesh where hash = ?")
            .bind(hash)
            .execute(&mut *tx)
            .await?;
        tx.commit().await?;
        Ok(Removal::Removed)
    }
}

/// Makes a mesh one of this owner's; false if it was before.
async fn own(tx: &mut SqliteConnection, owner: &str, hash: &str, now: Time) -> Result<bool> {
    let done = sqlx::query(
        "insert into mesh_owner (hash, owner, created_at) values (?, ?, ?) on conflict do nothing",
    )
    .bind(hash)
    .bind(owner)
    .bind(now.micros())
    .execute(tx)
    .await?;
    Ok(done.rows_affected() > 0)
}

/// Whether a job that waits or runs needs the mesh: one of this owner, or any.
async fn is_needed(tx: &mut SqliteConnection, owner: Option<&str>, hash: &str) -> Result<bool> {
    let needed = sqlx::query_scalar(
        "select exists (select 1 from job indexed by job_by_mesh
         where mesh = ?1 and status in ('queued', 'running') and (?2 is null or owner = ?2))",
    );
    Ok(needed.bind(hash).bind(owner).fetch_one(tx).await?)
}

/// The body of a mesh as it was written; `None` if it is not stored.
pub(super) async fn read_body(
    connection: &mut SqliteConnection,
    hash: &str,
) -> Result<Option<Vec<u8>>> {
    let named = |error: StoreError| error.reading(|| record(hash));
    let Some(key) = key_of(connection, hash).await.map_err(named)? else {
        return Ok(None);
    };
    let body = content::find(connection, Holder::Mesh(key), name::MESH).await;
    match body.map_err(named)? {
        Some(body) => Ok(Some(body.read(connection).await.map_err(named)?)),
        None => Err(record(hash).damaged("it has no body")),
    }
}

/// The number of a stored mesh.
async fn key_of(connection: &mut SqliteConnection, hash: &str) -> Result<Option<i64>> {
    let key = sqlx::query_scalar("select id from mesh where hash = ?").bind(hash);
    Ok(key.fetch_optional(connection).await?)
}

/// A row of the table as the description of a mesh.
pub(super) fn described(row: &SqliteRow) -> Result<StoredMesh> {
    let hash: String = row.try_get("hash")?;
    let record = || Record::named(format!("description of mesh {hash}"));
    if !checksum::row_is_intact(row)? {
        return Err(record().damaged("its checksum does not match its content"));
    }
    let info =
        serde_json::from_str(row.try_get("info")?).map_err(|error| record().damaged(error))?;
    let key = row.try_get("id")?;
    Ok(StoredMesh { key, info })
}

fn record(hash: &str) -> Record {
    Record::named(format!("mesh {hash}"))
}

/// A job's mesh must be stored when the job is accepted.
pub(super) async fn require(tx: &mut SqliteConnection, mesh: Option<&str>) -> Result<()> {
    let Some(hash) = mesh else { return Ok(()) };
    let there: bool = sqlx::query_scalar("select exists (select 1 from mesh where hash = ?)")
        .bind(hash)
        .fetch_one(tx)
        .await?;
    if there {
        Ok(())
    } else {
        Err(StoreError::UnknownMesh)
    }
}
