//! Stores, finds and removes meshes.

use std::sync::Arc;

use base::{caller::Owners, mesh::MeshInfo, time::Time};
use rusqlite::{Connection, Row, params};

use super::{
    checksum,
    content::{self, Fingerprint, Holder, name},
    damage::Table,
    database::{Store, Writer},
    error::{Record, Result, StoreError},
    sql::{Sql, text},
};

/// The effect of removing a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Removal {
    /// The mesh was removed.
    Removed,
    /// There is no such mesh.
    Unknown,
    /// Jobs that wait or run need the mesh, which was not removed.
    InUse,
}

/// A stored mesh, with its place in the list of meshes.
#[derive(Debug)]
pub struct StoredMesh {
    /// The number of the mesh, in order of arrival.
    pub key: i64,
    /// The description of the mesh, as clients see it.
    pub info: MeshInfo,
}

impl Store {
    /// The description of a mesh of these owners, as clients see it.
    pub async fn mesh(self: &Arc<Self>, owners: Owners, hash: &str) -> Result<Option<MeshInfo>> {
        let hash = hash.to_owned();
        self.read(move |store, connection| {
            let mesh = match owners {
                Owners::All => {
                    connection.row("select * from mesh where hash = ?", [hash], described)
                }
                Owners::Only(owner) => connection.row(
                    "select mesh.* from mesh join mesh_owner using (hash) where hash = ? and owner = ?",
                    (hash, owner),
                    described,
                ),
            };
            let mesh = mesh?;
            if mesh.is_none() {
                store.damages.have_all(&[Table::Meshes])?;
            }
            Ok(mesh.map(|mesh| mesh.info))
        })
        .await
    }

    /// Meshes of these owners that were stored before the one with key `before`, newest first.
    pub async fn meshes(
        self: &Arc<Self>,
        owners: Owners,
        before: Option<i64>,
        limit: i64,
    ) -> Result<Vec<StoredMesh>> {
        let before = before.unwrap_or(i64::MAX);
        self.read(move |store, connection| {
            let meshes = match owners {
                Owners::All => connection.rows(
                    "select * from mesh where id < ? order by id desc limit ?",
                    [before, limit],
                    described,
                ),
                Owners::Only(owner) => connection.rows(
                    "select mesh.* from mesh join mesh_owner using (hash)
                     where owner = ? and id < ? order by id desc limit ?",
                    (owner, before, limit),
                    described,
                ),
            };
            let meshes = meshes?;
            store.damages.have_all(&[Table::Meshes])?;
            Ok(meshes)
        })
        .await
    }

    /// Makes a stored mesh belong to this owner, too; false if it did before. `None` if the mesh is not stored.
    pub async fn own_mesh(self: &Arc<Self>, owner: &str, hash: &str) -> Result<Option<bool>> {
        let (owner, hash) = (owner.to_owned(), hash.to_owned());
        self.write(move |writer| {
            let tx = writer.begin()?;
            if !is_stored(&tx, &hash)? {
                return Ok(None);
            }
            let new = own(&tx, &owner, &hash, writer.store.now())?;
            tx.commit()?;
            Ok(Some(new))
        })
        .await
    }

    /// Stores the description of a mesh whose body was written before, and makes the mesh belong to this owner; false
    /// if it did before. `None`: a piece of the body was removed meanwhile, with an earlier mesh of the same file, and
    /// must be written again.
    pub async fn insert_mesh(
        self: &Arc<Self>,
        owner: &str,
        info: &MeshInfo,
        body: &Fingerprint,
    ) -> Result<Option<bool>> {
        let (owner, info, body) = (owner.to_owned(), info.clone(), body.clone());
        self.write(move |writer| {
            let tx = writer.begin()?;
            let key: Option<i64> = tx.optional_value(
                "insert into mesh (hash, info, created_at) values (?, ?, ?) on conflict do nothing returning id",
                params![info.hash, serde_json::to_string(&info)?, info.created_at.micros()],
            )?;
            if let Some(key) = key {
                checksum::seal(&tx, "mesh", "id", key)?;
                if !content::attach_written(&tx, Holder::Mesh(key), name::MESH, &body)? {
                    return Ok(None);
                }
            }
            let new = own(&tx, &owner, &info.hash, info.created_at)?;
            tx.commit()?;
            Ok(Some(new))
        })
        .await
    }

    /// The body of a mesh, which is the parsed mesh, as it was written; `None` if the mesh is not stored.
    pub async fn mesh_body(self: &Arc<Self>, hash: &str) -> Result<Option<Vec<u8>>> {
        let hash = hash.to_owned();
        self.read(move |_, connection| {
            // one transaction sees one state: a mesh with its body, or no mesh
            let tx = connection.unchecked_transaction()?;
            read_body(&tx, &hash)
        })
        .await
    }

    /// Makes a mesh no longer belong to these owners, unless one of their jobs that wait or run needs it. With its last
    /// owner the mesh is removed.
    pub async fn remove_mesh(self: &Arc<Self>, owners: Owners, hash: &str) -> Result<Removal> {
        let hash = hash.to_owned();
        self.control(move |writer| try_to_remove(writer, &owners, &hash))
            .await
    }
}

fn try_to_remove(writer: &Writer<'_>, owners: &Owners, hash: &str) -> Result<Removal> {
    let tx = writer.begin_control()?;
    let only = match owners {
        Owners::All => None,
        Owners::Only(owner) => Some(&**owner),
    };
    let theirs: bool = tx.value(
        "select exists (select 1 from mesh where hash = ?1
         and (?2 is null or exists (select 1 from mesh_owner where hash = ?1 and owner = ?2)))",
        (hash, only),
    )?;
    if !theirs {
        return Ok(Removal::Unknown);
    }
    if is_needed(&tx, only, hash)? {
        return Ok(Removal::InUse);
    }
    tx.run(
        "delete from mesh_owner where hash = ?1 and (?2 is null or owner = ?2)",
        (hash, only),
    )?;
    let others = "select exists (select 1 from mesh_owner where hash = ?)";
    if tx.value(others, [hash])? {
        tx.commit()?;
        return Ok(Removal::Removed);
    }
    // an administrator's, on a mesh that was another's
    if is_needed(&tx, None, hash)? {
        return Ok(Removal::InUse);
    }
    if let Some(key) = key_of(&tx, hash)? {
        content::detach(&tx, Holder::Mesh(key), &[name::MESH])?;
    }
    tx.run("delete from mesh where hash = ?", [hash])?;
    tx.commit()?;
    Ok(Removal::Removed)
}

/// Makes a mesh belong to this owner; false if it did before.
fn own(tx: &Connection, owner: &str, hash: &str, now: Time) -> Result<bool> {
    let added = tx.run(
        "insert into mesh_owner (hash, owner, created_at) values (?, ?, ?) on conflict do nothing",
        (hash, owner, now.micros()),
    )?;
    Ok(added > 0)
}

/// Whether a job that waits or runs needs the mesh: a job of `owner`, or any job if that is `None`.
fn is_needed(tx: &Connection, owner: Option<&str>, hash: &str) -> Result<bool> {
    tx.value(
        "select exists (select 1 from job indexed by job_by_mesh
         where mesh = ?1 and status in ('queued', 'running') and (?2 is null or owner = ?2))",
        (hash, owner),
    )
}

/// The body of a mesh as it was written; `None` if the mesh is not stored.
pub(super) fn read_body(connection: &Connection, hash: &str) -> Result<Option<Vec<u8>>> {
    let named = |error: StoreError| error.reading(|| record(hash));
    let Some(key) = key_of(connection, hash).map_err(named)? else {
        return Ok(None);
    };
    let body = content::find(connection, Holder::Mesh(key), name::MESH);
    match body.map_err(named)? {
        Some(body) => Ok(Some(body.read(connection).map_err(named)?)),
        None => Err(record(hash).damaged("it has no body")),
    }
}

/// The number of a stored mesh.
fn key_of(connection: &Connection, hash: &str) -> Result<Option<i64>> {
    connection.optional_value("select id from mesh where hash = ?", [hash])
}

/// The mesh of a row of the table `mesh`, if the checksum matches.
pub(super) fn described(row: &Row<'_>) -> Result<StoredMesh> {
    let hash = text(row, "hash")?;
    let record = || Record::named(format!("description of mesh {hash}"));
    if !checksum::row_is_intact(row)? {
        return Err(record().damaged("its checksum does not match its content"));
    }
    let info = serde_json::from_str(text(row, "info")?).map_err(|error| record().damaged(error))?;
    let key = row.get("id")?;
    Ok(StoredMesh { key, info })
}

fn record(hash: &str) -> Record {
    Record::named(format!("mesh {hash}"))
}

/// An error if the mesh that a job needs is not stored.
pub(super) fn require(tx: &Connection, mesh: Option<&str>) -> Result<()> {
    match mesh {
        Some(hash) if !is_stored(tx, hash)? => Err(StoreError::UnknownMesh),
        _ => Ok(()),
    }
}

fn is_stored(tx: &Connection, hash: &str) -> Result<bool> {
    tx.value("select exists (select 1 from mesh where hash = ?)", [hash])
}
