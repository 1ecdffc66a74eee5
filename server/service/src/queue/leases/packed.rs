//! A result as bytes, which can be sent in pieces: a header that lists the parts, then the parts.

use sha2::{Digest, Sha256};
use store::{Part, Parts};

/// A result as bytes.
#[derive(Debug)]
pub struct Packed {
    chunks: Vec<Vec<u8>>,
    /// The size of all chunks together.
    total: u64,
    sha256: Vec<u8>,
}

impl Packed {
    /// Packs a result; with its SHA-256 if it is `hashed`, which a process of the service needs not.
    ///
    /// # Errors
    ///
    /// The list of the parts cannot be written.
    pub fn new(parts: Parts, hashed: bool) -> serde_json::Result<Packed> {
        let mut bodies = vec![];
        let mut list = vec![];
        for mut part in parts.into_parts() {
            let body = std::mem::take(&mut part.body);
            list.push((part, body.len()));
            bodies.push(body);
        }
        let list = serde_json::to_vec(&list)?;
        let mut header = (list.len() as u64).to_le_bytes().to_vec();
        header.extend(list);
        let chunks: Vec<Vec<u8>> = [header].into_iter().chain(bodies).collect();
        let sha256 = match hashed {
            true => {
                let mut hash = Sha256::new();
                chunks.iter().for_each(|chunk| hash.update(chunk));
                hash.finalize().to_vec()
            }
            false => vec![],
        };
        Ok(Packed {
            total: chunks.iter().map(|chunk| chunk.len() as u64).sum(),
            sha256,
            chunks,
        })
    }

    /// The size (bytes).
    pub fn total(&self) -> u64 {
        self.total
    }

    /// The SHA-256; empty if it is not hashed.
    pub fn sha256(&self) -> &[u8] {
        &self.sha256
    }

    /// The bytes from `offset` on, at most `most` of them.
    pub fn piece(&self, offset: u64, most: usize) -> Vec<u8> {
        let (mut skip, mut piece) = (offset as usize, vec![]);
        for chunk in &self.chunks {
            let rest = chunk.get(skip..).unwrap_or_default();
            skip = skip.saturating_sub(chunk.len());
            let taken = rest.len().min(most - piece.len());
            piece.extend(&rest[..taken]);
            if piece.len() == most {
                break;
            }
        }
        piece
    }
}

/// Reads a result that was packed on another machine, and checks that every part can be served; at most about `most` bytes of
/// memory are taken. `Err`: what is wrong with it.
pub(super) fn unpack(bytes: Vec<u8>, sha256: &[u8], most: u64) -> Result<Parts, String> {
    if *Sha256::digest(&bytes) != *sha256 {
        return Err("its SHA-256 is not the one that was announced".into());
    }
    let parts = parts_of(bytes)?;
    store::check_parts(&parts, most)?;
    Ok(Parts::new(parts))
}

/// Reads a result that was packed by a process of this service.
pub(super) fn unpack_ours(bytes: Vec<u8>) -> Result<Parts, String> {
    parts_of(bytes).map(Parts::new)
}

fn parts_of(mut bytes: Vec<u8>) -> Result<Vec<Part>, String> {
    let cut = || "its header is cut off".to_owned();
    let length = bytes
        .first_chunk()
        .map(|length| u64::from_le_bytes(*length));
    let length = usize::try_from(length.ok_or_else(cut)?).map_err(|_| cut())?;
    let list = length.checked_add(8).and_then(|end| bytes.get(8..end));
    let list: Vec<(Part, usize)> = serde_json::from_slice(list.ok_or_else(cut)?)
        .map_err(|error| format!("its header cannot be read: {error}"))?;
    let mut rest = bytes.split_off(8 + length);
    let mut parts = Vec::with_capacity(list.len());
    for (mut part, length) in list {
        if length > rest.len() {
            return Err("its parts are cut off".into());
        }
        let after = rest.split_off(length);
        part.body = std::mem::replace(&mut rest, after);
        part.body.shrink_to_fit();
        parts.push(part);
    }
    if !rest.is_empty() {
        return Err(format!("{} bytes belong to no part", rest.len()));
    }
    Ok(parts)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const MOST: u64 = 1 << 20;

    fn packed() -> Packed {
        Packed::new(Parts::of_a_summary(), true).unwrap()
    }

    #[test]
    fn a_result_that_comes_in_pieces_is_the_one_that_was_sent() {
        for most in [1, 7, 100, 1 << 20] {
            let (packed, mut bytes) = (packed(), vec![]);
            while (bytes.len() as u64) < packed.total() {
                bytes.extend(packed.piece(bytes.len() as u64, most));
            }
            let parts = unpack(bytes, packed.sha256(), MOST).unwrap();
            let [sent, came] = [Parts::of_a_summary(), parts];
            let bodies = |parts: Parts| parts.into_parts().map(|part| part.body);
            assert!(bodies(sent).eq(bodies(came)));
        }
        assert!(packed().piece(1 << 30, 10).is_empty());
    }

    #[test]
    fn a_damaged_result_is_refused() {
        let (packed, bytes) = (packed(), packed().piece(0, 1 << 20));
        assert!(unpack(bytes.clone(), packed.sha256(), MOST).is_ok());
        assert!(unpack(bytes.clone(), b"", MOST).is_err());
        for cut in 0..bytes.len() {
            let some = bytes[..cut].to_vec();
            let sha256 = Sha256::digest(&some);
            assert!(unpack(some, &sha256, MOST).is_err(), "{cut}");
        }
        let mut long = bytes.clone();
        long.push(0);
        let sha256 = Sha256::digest(&long);
        assert!(unpack(long, &sha256, MOST).is_err());
        for place in 0..bytes.len() {
            let mut other = bytes.clone();
            other[place] ^= 0x20;
            let sha256 = Sha256::digest(&other);
            // it is refused, or another name is read: no panic
            let _ = unpack(other, &sha256, MOST);
        }
    }
}
