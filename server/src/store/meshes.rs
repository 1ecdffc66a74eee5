//! Stored meshes.

use super::{
    database::Store,
    error::{Result, StoreError},
};
use crate::mesh::MeshInfo;

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
    /// The description of a mesh, as clients see it.
    pub async fn mesh(&self, hash: &str) -> Result<Option<MeshInfo>> {
        let info: Option<String> = sqlx::query_scalar("select info from mesh where hash = ?")
            .bind(hash)
            .fetch_optional(&self.reader)
            .await?;
        Ok(info.map(|info| serde_json::from_str(&info)).transpose()?)
    }

    /// Meshes that were stored before the one with key `before`, newest first.
    pub async fn meshes(&self, before: Option<i64>, limit: i64) -> Result<Vec<StoredMesh>> {
        let rows: Vec<(i64, String)> =
            sqlx::query_as("select id, info from mesh where id < ? order by id desc limit ?")
                .bind(before.unwrap_or(i64::MAX))
                .bind(limit)
                .fetch_all(&self.reader)
                .await?;
        let read = |(key, info): (i64, String)| {
            let info = serde_json::from_str(&info)?;
            Ok(StoredMesh { key, info })
        };
        rows.into_iter().map(read).collect()
    }

    /// Writes pieces of a mesh, numbered from `first`. They are used only after `insert_mesh`.
    pub async fn write_mesh_pieces(
        &self,
        hash: &str,
        first: i64,
        pieces: &[Vec<u8>],
    ) -> Result<()> {
        let mut tx = self.begin().await?;
        for (piece, body) in (first..).zip(pieces) {
            // the same file may be uploaded twice at once, or again after an interruption: its pieces are the same
            sqlx::query("insert or replace into mesh_piece (hash, piece, body) values (?, ?, ?)")
                .bind(hash)
                .bind(piece)
                .bind(body)
                .execute(&mut *tx)
                .await?;
        }
        tx.commit().await?;
        Ok(())
    }

    /// Completes a mesh with this number of pieces; false if it was stored already. `None`: some pieces were removed
    /// meanwhile, with an earlier mesh of the same file, and must be written again.
    pub async fn insert_mesh(&self, info: &MeshInfo, pieces: i64) -> Result<Option<bool>> {
        let mut tx = self.begin().await?;
        let there: i64 = sqlx::query_scalar("select count(*) from mesh_piece where hash = ?")
            .bind(&info.hash)
            .fetch_one(&mut *tx)
            .await?;
        if there != pieces {
            return Ok(None);
        }
        let done = sqlx::query(
            "insert into mesh (hash, info, created_at) values (?, ?, ?) on conflict do nothing",
        )
        .bind(&info.hash)
        .bind(serde_json::to_string(info)?)
        .bind(info.created_at.micros())
        .execute(&mut *tx)
        .await?;
        tx.commit().await?;
        Ok(Some(done.rows_affected() > 0))
    }

    /// The parsed mesh as it was written.
    pub async fn mesh_body(&self, hash: &str) -> Result<Option<Vec<u8>>> {
        // one statement sees one state: a mesh with all its pieces, or no mesh
        let pieces: Vec<Vec<u8>> = sqlx::query_scalar(
            "select body from mesh_piece join mesh using (hash) where hash = ? order by piece",
        )
        .bind(hash)
        .fetch_all(&self.reader)
        .await?;
        Ok((!pieces.is_empty()).then(|| pieces.concat()))
    }

    /// Removes a mesh, unless a job that waits or runs needs it.
    pub async fn remove_mesh(&self, hash: &str) -> Result<Removal> {
        let mut tx = self.begin().await?;
        let needed: bool = sqlx::query_scalar(
            "select exists (select 1 from problem join job using (input_hash)
             where problem.mesh = ? and job.status in ('queued', 'running'))",
        )
        .bind(hash)
        .fetch_one(&mut *tx)
        .await?;
        if needed {
            return Ok(Removal::InUse);
        }
        let done = sqlx::query("delete from mesh where hash = ?")
            .bind(hash)
            .execute(&mut *tx)
            .await?;
        if done.rows_affected() == 0 {
            return Ok(Removal::Unknown);
        }
        sqlx::query("delete from mesh_piece where hash = ?")
            .bind(hash)
            .execute(&mut *tx)
            .await?;
        tx.commit().await?;
        Ok(Removal::Removed)
    }

    /// Removes the pieces of uploads that were interrupted.
    pub async fn remove_orphaned_mesh_pieces(&self) -> Result<u64> {
        let mut tx = self.begin().await?;
        let done = sqlx::query("delete from mesh_piece where hash not in (select hash from mesh)")
            .execute(&mut *tx)
            .await?;
        tx.commit().await?;
        Ok(done.rows_affected())
    }
}

/// A job's mesh must be stored when the job is accepted.
pub(super) async fn require(tx: &mut sqlx::SqliteConnection, mesh: Option<&str>) -> Result<()> {
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
