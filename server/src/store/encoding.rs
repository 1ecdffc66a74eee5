//! How the pieces of a part of a result hold it: deflated, or as columns.

use std::io::{Read, Write};

use files::{columns, fields_json::FieldsJson};
use flate2::{Compression, read::DeflateDecoder, write::DeflateEncoder};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use solver::solution::Fields;

/// Size and hash of the JSON of a part.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartInfo {
    /// Its size.
    pub bytes: u64,
    /// Its SHA-256.
    pub digest: Vec<u8>,
}

/// How the pieces of a part hold it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Encoding {
    /// Its JSON, as versions before this one stored it.
    Plain,
    /// Its JSON, deflated.
    Deflated,
    /// The columns of fields.
    Columns,
}

impl Encoding {
    /// As it is stored.
    pub(super) fn stored(self) -> Option<i64> {
        match self {
            Encoding::Plain => None,
            Encoding::Deflated => Some(1),
            Encoding::Columns => Some(2),
        }
    }

    /// As it was stored; `None` if it is unknown.
    pub(super) fn from_stored(stored: Option<i64>) -> Option<Encoding> {
        [Encoding::Plain, Encoding::Deflated, Encoding::Columns]
            .into_iter()
            .find(|encoding| encoding.stored() == stored)
    }
}

/// The content of a part.
#[derive(Debug)]
pub(super) enum Content {
    /// Its JSON.
    Json(Vec<u8>),
    /// Fields.
    Fields(Box<Fields>),
}

/// The content of a part that was stored so, and size and hash of its JSON. `Err`: what is wrong with the bytes.
pub(super) fn decoded(
    stored: Vec<u8>,
    encoding: Encoding,
    expected: &PartInfo,
) -> std::result::Result<(PartInfo, Content), String> {
    let json = match encoding {
        Encoding::Plain => stored,
        Encoding::Deflated => {
            let mut json = Vec::new();
            // one more byte than there should be shows that there are more
            let mut inflated = DeflateDecoder::new(&*stored).take(expected.bytes.saturating_add(1));
            let read = inflated.read_to_end(&mut json);
            read.map_err(|error| error.to_string())?;
            json
        }
        Encoding::Columns => {
            // a number has eight bytes, and two in its JSON at least
            let limit = usize::try_from(expected.bytes).unwrap_or(usize::MAX);
            let fields = columns::decode(&stored, limit.saturating_mul(4))?;
            let info = info_of_fields(&fields).map_err(|error| error.to_string())?;
            return Ok((info, Content::Fields(Box::new(fields))));
        }
    };
    Ok((info_of_json(&json), Content::Json(json)))
}

/// The hash of the bytes that are stored.
pub(super) fn digest(stored: &[u8]) -> Vec<u8> {
    Sha256::digest(stored).to_vec()
}

/// Size and hash of a JSON.
pub(super) fn info_of_json(json: &[u8]) -> PartInfo {
    PartInfo {
        bytes: json.len() as u64,
        digest: digest(json),
    }
}

/// Size and hash of the JSON of fields, which is never in memory as a whole.
pub(super) fn info_of_fields(fields: &Fields) -> serde_json::Result<PartInfo> {
    let (mut bytes, mut hash, mut json) = (0, Sha256::new(), FieldsJson::new(fields));
    while let Some(piece) = json.piece()? {
        bytes += piece.len() as u64;
        hash.update(&piece);
    }
    Ok(PartInfo {
        bytes,
        digest: hash.finalize().to_vec(),
    })
}

/// A text deflated. Level 6 is the usual one: 9 takes several times as long for a few per cent.
pub(super) fn deflated(text: &[u8]) -> Vec<u8> {
    let mut deflate = DeflateEncoder::new(Vec::new(), Compression::new(6));
    // writing to memory does not fail
    let _ = deflate.write_all(text);
    deflate.finish().unwrap_or_default()
}
