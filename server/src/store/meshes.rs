//! Stored meshes.

use sqlx::{Row, SqliteConnection, sqlite::SqliteRow};

use super::{
    checksum::{self, Checksum},
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

    /// Writes pieces of a mesh, numbered from `first`. They are used only after `insert_mesh`.
    pub async fn write_mesh_pieces(
        &self,
        hash: &str,
        first: i64,
        pieces: &[Vec<u8>],
    ) -> Result<()> {
        let write = async {
            let mut tx = self.begin().await?;
            for (piece, body) in (first..).zip(pieces) {
                // the same file may be uploaded twice at once, or again after an interruption: its pieces are the same
                sqlx::query(
                    "insert or replace into mesh_piece (hash, piece, body, checksum) values (?, ?, ?, ?)",
                )
                .bind(hash)
                .bind(piece)
                .bind(body)
                .bind(piece_checksum(hash, piece, body).stored())
                .execute(&mut *tx)
                .await?;
            }
            tx.commit().await?;
            Ok(())
        };
        self.writing(write).await
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

    /// Completes a mesh with this number of pieces as this owner's; false if it was theirs already. `None`: some pieces
    /// were removed meanwhile, with an earlier mesh of the same file, and must be written again.
    pub async fn insert_mesh(
        &self,
        owner: &str,
        info: &MeshInfo,
        pieces: i64,
    ) -> Result<Option<bool>> {
        let write = async {
            let mut tx = self.begin().await?;
            let there: i64 = sqlx::query_scalar("select count(*) from mesh_piece where hash = ?")
                .bind(&info.hash)
                .fetch_one(&mut *tx)
                .await?;
            if there != pieces {
                return Ok(None);
            }
            let key: Option<i64> = sqlx::query_scalar(
                "insert into mesh (hash, info, created_at, pieces) values (?, ?, ?, ?) on conflict do nothing returning id",
            )
            .bind(&info.hash)
            .bind(serde_json::to_string(info)?)
            .bind(info.created_at.micros())
            .bind(pieces)
            .fetch_optional(&mut *tx)
            .await?;
            if let Some(key) = key {
                let row = sqlx::query("select * from mesh where id = ?")
                    .bind(key)
                    .fetch_one(&mut *tx)
                    .await?;
                sqlx::query("update mesh set checksum = ? where id = ?")
                    .bind(checksum::of_row(&row)?)
                    .bind(key)
                    .execute(&mut *tx)
                    .await?;
            }
            let new = own(&mut tx, owner, &info.hash, info.created_at).await?;
            tx.commit().await?;
            Ok(Some(new))
        };
        self.writing(write).await
    }

    /// The parsed mesh as it was written.
    pub async fn mesh_body(&self, hash: &str) -> Result<Option<Vec<u8>>> {
        let mut connection = self.reader.acquire().await?;
        self.damages.noting(read_body(&mut connection, hash)).await
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
        for statement in [
            "delete from mesh where hash = ?",
            "delete from mesh_piece where hash = ?",
        ] {
            sqlx::query(statement).bind(hash).execute(&mut *tx).await?;
        }
        tx.commit().await?;
        Ok(Removal::Removed)
    }

    /// Removes the pieces of an upload that could not be stored, unless another one has completed the mesh. One that is
    /// being stored meanwhile notices that they are missing.
    pub async fn remove_incomplete_mesh(&self, hash: &str) -> Result<()> {
        self.control(|| async {
            let mut tx = self.begin_control().await?;
            let delete = "delete from mesh_piece where hash = ?1 and not exists (select 1 from mesh where hash = ?1)";
            sqlx::query(delete).bind(hash).execute(&mut *tx).await?;
            tx.commit().await
        })
        .await
    }

    /// Removes the pieces of uploads that were interrupted.
    pub async fn remove_orphaned_mesh_pieces(&self) -> Result<u64> {
        let some: bool = sqlx::query_scalar(
            "select exists (select 1 from mesh_piece where hash not in (select hash from mesh))",
        )
        .fetch_one(&self.reader)
        .await?;
        if !some {
            return Ok(0); // nothing is written: the disk may be full
        }
        self.control(|| async {
            let mut tx = self.begin_control().await?;
            let delete = "delete from mesh_piece where hash not in (select hash from mesh)";
            let done = sqlx::query(delete).execute(&mut *tx).await?;
            tx.commit().await?;
            Ok(done.rows_affected())
        })
        .await
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
        "select exists (select 1 from problem join job using (input_hash)
         where problem.mesh = ?1 and job.status in ('queued', 'running') and (?2 is null or job.owner = ?2))",
    );
    Ok(needed.bind(hash).bind(owner).fetch_one(tx).await?)
}

/// How many pieces the mesh has; one of them: its number, its bytes, its checksum.
type Piece = (Option<i64>, i64, Vec<u8>, Option<i64>);

/// The pieces of a mesh in one, if all are there as they were written.
pub(super) async fn read_body(
    connection: &mut SqliteConnection,
    hash: &str,
) -> Result<Option<Vec<u8>>> {
    // one statement sees one state: a mesh with all its pieces, or no mesh
    let pieces: Vec<Piece> = sqlx::query_as(
        "select pieces, piece, body, mesh_piece.checksum from mesh_piece join mesh using (hash)
         where hash = ? order by piece",
    )
    .bind(hash)
    .fetch_all(&mut *connection)
    .await
    .map_err(|error| StoreError::from(error).reading(|| record(hash)))?;
    if pieces.is_empty() {
        let row = sqlx::query("select 1 from mesh where hash = ?").bind(hash);
        return match row.fetch_optional(connection).await? {
            Some(_) => Err(record(hash).damaged("it has no pieces")),
            None => Ok(None),
        };
    }
    let count = pieces.len() as i64;
    let mut whole = vec![];
    for (number, (all, piece, body, checksum)) in (0..).zip(pieces) {
        if piece != number || all.is_some_and(|all| all != count) {
            return Err(record(hash).damaged("a piece is missing"));
        }
        piece_checksum(hash, piece, &body).verify(checksum, || record(hash))?;
        whole.extend(body);
    }
    Ok(Some(whole))
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

fn piece_checksum(hash: &str, piece: i64, body: &[u8]) -> Checksum {
    Checksum::new().text(hash).int(piece).bytes(body)
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
