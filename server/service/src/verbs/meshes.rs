//! Operations on meshes, each of which is stored once and may be used by many jobs.

use std::{
    fs::File,
    io::{self, BufReader, BufWriter, Seek, Write},
    path::Path,
    sync::Arc,
};

use base::{
    caller::{Caller, Owners},
    digest,
    mesh::MeshInfo,
    values::Values,
};
use files::ReadError;
use futures_util::future::BoxFuture;
use futures_util::{Stream, StreamExt};
use sha2::{Digest, Sha256};
use solver::{
    error::{Reason, Violation},
    mesh::Mesh,
};
use store::{Cursor, Fingerprint, PIECE_BYTES, PIECES_PER_COMMIT, Removal, StoredMesh};
use tokio::io::{AsyncReadExt, AsyncSeekExt, AsyncWriteExt};
use tracing::{info, warn};

use super::{
    page::{Page, Paging},
    service::{Service, detached},
};
use crate::{error::ApiError, parameters::Variable, violations};

/// The hash of a stored mesh in a path.
pub const HASH: Variable<Hashes> = Variable {
    name: "hash",
    kind: "mesh",
    meaning: "The mesh",
    values: Hashes,
};

/// The allowed names of meshes: the hashes of their files.
#[derive(Clone, Copy, Debug)]
pub struct Hashes;

impl Values for Hashes {
    type Value = String;

    fn schema(&self) -> serde_json::Value {
        serde_json::json!({ "type": "string", "pattern": "^sha256:[0-9a-f]{64}$" })
    }

    fn expected(&self) -> String {
        "sha256: and 64 digits from 0 to f, in lower case".into()
    }

    fn read(&self, text: &str) -> Option<String> {
        let digits = text.strip_prefix("sha256:")?;
        let digit = |byte: u8| matches!(byte, b'0'..=b'9' | b'a'..=b'f');
        (digits.len() == 64 && digits.bytes().all(digit)).then(|| text.to_owned())
    }
}

/// Stores a mesh file that arrives in pieces; returns whether it is new. The file is streamed to the disk
/// and from there through the reader: only the parsed mesh is held in memory. `declared`: the number of bytes that the
/// client says it will send (compressed, if the body is); a file larger than the owner's whole share is refused by it unread.
pub async fn upload(
    service: &Arc<Service>,
    caller: &Caller,
    declared: Option<usize>,
    mut pieces: impl Stream<Item = Result<impl AsRef<[u8]>, ApiError>> + Unpin,
) -> Result<(MeshInfo, bool), ApiError> {
    service.accepting()?;
    service.store.has_room()?;
    let owner = caller.owner().to_owned();
    let room = service.room_of(&owner).await?;
    room.holds(0)?;
    let mut upload = service.begin_upload(&owner)?;
    let limit_bytes = service.config.max_mesh_bytes;
    if declared.is_some_and(|bytes| bytes > limit_bytes) {
        return Err(ApiError::PayloadTooLarge { limit_bytes });
    }
    room.would_hold(declared.unwrap_or(0) as u64)?;
    // without a name: the system removes it when the process ends
    let file = tempfile::tempfile_in(&service.config.store.data).map_err(unwritten)?;
    let mut out = tokio::io::BufWriter::with_capacity(
        PIECE_BYTES,
        tokio::fs::File::from_std(file.try_clone().map_err(unwritten)?),
    );
    let (mut hash, mut bytes) = (Sha256::new(), 0);
    while let Some(piece) = pieces.next().await {
        let piece = piece?;
        let piece = piece.as_ref();
        bytes += piece.len();
        if bytes > limit_bytes {
            return Err(ApiError::PayloadTooLarge { limit_bytes });
        }
        // how large the mesh in it is, and whether it is there already, is not known yet
        room.would_hold(upload.arrived(piece.len()))?;
        hash.update(piece);
        out.write_all(piece).await.map_err(unwritten)?;
    }
    drop(pieces); // what decodes them has a window in memory
    out.flush().await.map_err(unwritten)?;
    drop(out);
    let hash = digest::sha256_text(hash);
    if let Some(known) = service
        .store
        .mesh(Owners::Only(owner.as_str().into()), &hash)
        .await?
    {
        return Ok((known, false));
    }
    service.may_keep_more(&owner).await?;
    if let Some(known) = service.store.mesh(Owners::All, &hash).await?
        && let Some(new) = service.store.own_mesh(&owner, &hash).await?
    {
        return Ok((known, new));
    }
    let name = hash.clone();
    let folder = service.config.store.data.clone();
    let parsed = service
        .work(move || parse(file, &folder, name, bytes as u64))
        .await??;
    let (info, body, encoded) = parsed;
    let mesh_bytes = encoded.metadata().map_err(ApiError::internal)?.len();
    // those first that are about to be stored: one that is stored meanwhile counts twice for a moment, and never not at all
    let more = upload.read(mesh_bytes);
    service.room_of(&owner).await?.holds(more)?;
    let service = service.clone();
    detached(async move {
        let _upload = upload;
        let encoded = tokio::fs::File::from_std(encoded);
        let stored = store(&service, &owner, &info, &body, encoded).await;
        if stored.is_err()
            && let Err(cause) = service.store.discard_content(&[&body]).await
        {
            warn!(%cause, "the stored pieces of mesh {} remain until the next start: {cause}", info.hash);
        }
        let new = stored?;
        info!(
            mesh.hash = info.hash,
            info.nodes, "mesh {} stored", info.hash
        );
        Ok((info, new))
    })
    .await
}

/// Parses the mesh file `file` and writes the parsed mesh to another file.
fn parse(
    mut file: File,
    folder: &Path,
    hash: String,
    bytes: u64,
) -> Result<(MeshInfo, Fingerprint, File), ApiError> {
    file.rewind().map_err(ApiError::internal)?;
    let encoded = tempfile::tempfile_in(folder).map_err(unwritten)?;
    let reader = BufReader::with_capacity(PIECE_BYTES, file);
    let (format, mesh, warnings) = files::read_mesh(reader).map_err(refused)?;
    let info = MeshInfo::new(hash, bytes, (format, &mesh, warnings));
    let mut out = Kept {
        out: BufWriter::with_capacity(PIECE_BYTES, encoded),
        hash: Sha256::new(),
        bytes: 0,
        error: None,
    };
    if let Err(cause) = base::mesh::write_stored(&mesh, &mut out) {
        // which the encoder does not pass on
        return Err(out
            .error
            .map_or_else(|| ApiError::internal(cause), unwritten));
    }
    let body = Fingerprint {
        hash: out.hash.finalize().to_vec(),
        bytes: out.bytes,
    };
    let file = out.out.into_inner();
    let mut encoded = file.map_err(|error| unwritten(error.into_error()))?;
    encoded.flush().map_err(unwritten)?;
    Ok((info, body, encoded))
}

/// A file that is being written, with the hash of what was written, and the error that ended writing.
struct Kept {
    out: BufWriter<File>,
    hash: Sha256,
    bytes: usize,
    error: Option<io::Error>,
}

impl Write for Kept {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes).map_err(|error| {
            let kind = error.kind();
            self.error = Some(error);
            io::Error::from(kind)
        })?;
        self.hash.update(&bytes[..written]);
        self.bytes += written;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

fn refused(error: ReadError) -> ApiError {
    match error {
        ReadError::Invalid(violations) => ApiError::InvalidProblem(violations),
        ReadError::Io(error) => ApiError::internal(error),
    }
}

/// Stores a mesh; returns whether it is new to its owner.
async fn store(
    service: &Service,
    owner: &str,
    info: &MeshInfo,
    body: &Fingerprint,
    mut encoded: tokio::fs::File,
) -> Result<bool, ApiError> {
    loop {
        write_pieces(service, body, &mut encoded).await?;
        if let Some(new) = service.store.insert_mesh(owner, info, body).await? {
            return Ok(new);
        }
    }
}

/// Writes all pieces of an encoded mesh into the store.
async fn write_pieces(
    service: &Service,
    body: &Fingerprint,
    encoded: &mut tokio::fs::File,
) -> Result<(), ApiError> {
    encoded.rewind().await.map_err(ApiError::internal)?;
    let mut first = 0;
    loop {
        let mut group = Vec::with_capacity(PIECES_PER_COMMIT);
        while group.len() < PIECES_PER_COMMIT {
            let mut piece = Vec::with_capacity(PIECE_BYTES);
            let mut limited = (&mut *encoded).take(PIECE_BYTES as u64);
            let read = limited.read_to_end(&mut piece).await;
            read.map_err(ApiError::internal)?;
            if piece.is_empty() {
                break;
            }
            group.push(piece);
        }
        let count = group.len();
        if count == 0 {
            return Ok(());
        }
        service.store.write_pieces(body, first, group).await?;
        first += count;
    }
}

fn unwritten(error: std::io::Error) -> ApiError {
    match error.kind() {
        std::io::ErrorKind::StorageFull => ApiError::StorageFull,
        _ => ApiError::internal(error),
    }
}

/// Returns a stored mesh, without its nodes and elements.
pub fn get<'a>(
    service: &'a Service,
    caller: &'a Caller,
    hash: &'a str,
) -> BoxFuture<'a, Result<MeshInfo, ApiError>> {
    Box::pin(async move {
        let found = service.store.mesh(caller.visible_owners(), hash).await?;
        found.ok_or_else(|| unknown(hash))
    })
}

fn unknown(hash: &str) -> ApiError {
    ApiError::NotFound(format!("there is no mesh {:?}", violations::quoted(hash)))
}

/// The name of the only list of meshes, for its page tokens.
const LIST: &str = "meshes";

/// Lists meshes, newest first.
pub fn list<'a>(
    service: &'a Service,
    caller: &'a Caller,
    paging: &'a Paging,
) -> BoxFuture<'a, Result<Page<MeshInfo>, ApiError>> {
    Box::pin(async move {
        let before = paging.cursor(LIST)?.map(|cursor| cursor.key);
        let owners = caller.visible_owners();
        let meshes = service.store.meshes(owners, before, paging.limit()).await?;
        let at = |mesh: &StoredMesh| Cursor {
            micros: mesh.info.created_at.micros(),
            key: mesh.key,
        };
        let Page { items, next } = paging.page(LIST, meshes, at);
        let items = items.into_iter().map(|mesh| mesh.info).collect();
        Ok(Page { items, next })
    })
}

/// Removes a mesh of the caller, unless a waiting or running job of the caller needs it.
pub fn delete<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    hash: &'a str,
) -> BoxFuture<'a, Result<(), ApiError>> {
    Box::pin(async move {
        let (service, caller, hash) = (service.clone(), caller.clone(), hash.to_owned());
        detached(async move {
            let removed = service.store.remove_mesh(caller.visible_owners(), &hash);
            match removed.await? {
                Removal::Removed => Ok(()),
                Removal::Unknown => Err(unknown(&hash)),
                Removal::InUse => Err(ApiError::MeshInUse),
            }
        })
        .await
    })
}

/// Loads the stored mesh of this hash, to which a problem refers; an error with a violation if it is not stored.
pub(super) async fn load(
    service: &Service,
    caller: &Caller,
    hash: &str,
) -> Result<(MeshInfo, Mesh), ApiError> {
    // loaded once there is a permit, so that waiting requests use no memory
    let load = async {
        let found = match service.store.mesh(caller.visible_owners(), hash).await? {
            Some(info) => service
                .store
                .mesh_body(hash)
                .await?
                .map(|body| (info, body)),
            None => None,
        };
        found.ok_or_else(|| ApiError::InvalidProblem(vec![missing(hash)]))
    };
    let read = |(info, body): (MeshInfo, Vec<u8>)| {
        let mesh = base::mesh::read_stored(&body).map_err(ApiError::internal)?;
        Ok((info, mesh))
    };
    service.work_on(load, read).await?
}

/// The violation of a problem that refers to a mesh that is not stored.
pub(super) fn missing(hash: &str) -> Violation {
    Violation {
        pointer: format!("{}/mesh/stored", violations::PROBLEM),
        reason: Reason::UnknownMesh,
        got: violations::quoted(hash).to_owned(),
        expected: "the hash of a mesh that this service has stored".to_owned(),
        hint: "Upload the mesh first: POST /v1/meshes, or UploadMesh.".to_owned(),
    }
}
