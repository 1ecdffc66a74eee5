//! How the bytes of a stored part of a result are encoded: as plain JSON, deflated JSON, or columns.

use std::io::{self, BufReader, BufWriter, Read, Write};

use files::{columns, deflate::deflating, fields_json::FieldsJson};
use flate2::{read::DeflateDecoder, write::DeflateEncoder};
use serde::{Deserialize, Serialize, de::IgnoredAny};
use sha2::{Digest, Sha256};
use solver::solution::Fields;

/// The size and the hash of the JSON of a part.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartInfo {
    /// The size of the JSON (bytes).
    pub bytes: u64,
    /// The SHA-256 of the JSON.
    pub digest: Vec<u8>,
}

/// How the bytes of a stored part are encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Encoding {
    /// JSON as it is, as earlier versions stored it.
    Plain,
    /// JSON, deflated.
    Deflated,
    /// The part `fields`, as columns of numbers.
    Columns,
}

/// The content of a part, decoded.
#[derive(Debug)]
pub(super) enum Decoded {
    /// The part as JSON.
    Json(Vec<u8>),
    /// The part `fields`, decoded from columns.
    Fields(Box<Fields>),
}

/// The content of a part that was stored in this encoding, and the size and hash of its JSON. `Err`: what is wrong with
/// the bytes.
pub(super) fn decoded(
    stored: Vec<u8>,
    encoding: Encoding,
    expected: &PartInfo,
) -> std::result::Result<(PartInfo, Decoded), String> {
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
            let json_bytes = usize::try_from(expected.bytes).unwrap_or(usize::MAX);
            let fields = columns::decode(&stored, json_bytes)?;
            let info = info_of_fields(&fields).map_err(|error| error.to_string())?;
            return Ok((info, Decoded::Fields(Box::new(fields))));
        }
    };
    Ok((info_of_json(&json), Decoded::Json(json)))
}

/// The largest memory (bytes) that reading the part `fields` takes: its stored bytes, which begin with `first`, and
/// what is made from them. `Err`: what is wrong with the bytes.
pub(super) fn memory_to_read(
    first: &[u8],
    stored_bytes: usize,
    encoding: Encoding,
    json_bytes: usize,
) -> std::result::Result<usize, String> {
    let made = match encoding {
        // a number has eight bytes, and four in its JSON at least; lists grow by doubling
        Encoding::Plain => json_bytes.saturating_mul(4),
        Encoding::Deflated => json_bytes.saturating_mul(6),
        Encoding::Columns => columns::memory_to_decode(first)?,
    };
    Ok(stored_bytes.saturating_add(made))
}

/// The SHA-256 of the stored bytes.
pub(super) fn digest(stored: &[u8]) -> Vec<u8> {
    Sha256::digest(stored).to_vec()
}

/// The size and the hash of a JSON text.
pub(super) fn info_of_json(json: &[u8]) -> PartInfo {
    PartInfo {
        bytes: json.len() as u64,
        digest: digest(json),
    }
}

/// The size and the hash of deflated JSON, which is never in memory as a whole; an error if it is not JSON.
pub(super) fn info_if_json(stored: &[u8]) -> serde_json::Result<PartInfo> {
    struct Seen<R> {
        text: R,
        bytes: u64,
        hash: Sha256,
    }
    impl<R: Read> Read for Seen<R> {
        fn read(&mut self, some: &mut [u8]) -> io::Result<usize> {
            let count = self.text.read(some)?;
            self.bytes += count as u64;
            self.hash.update(&some[..count]);
            Ok(count)
        }
    }
    let seen = Seen {
        text: DeflateDecoder::new(stored),
        bytes: 0,
        hash: Sha256::new(),
    };
    let mut text = BufReader::with_capacity(AT_ONCE, seen);
    let mut json = serde_json::Deserializer::from_reader(&mut text);
    IgnoredAny::deserialize(&mut json)?;
    json.end()?;
    let seen = text.into_inner();
    Ok(PartInfo {
        bytes: seen.bytes,
        digest: seen.hash.finalize().to_vec(),
    })
}

/// The size and the hash of the JSON of fields, which is never in memory as a whole.
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

/// The size and hash of the JSON of `value`, and the deflated JSON. The plain JSON is never in memory as a whole.
pub(super) fn deflated_json(value: &impl Serialize) -> serde_json::Result<(PartInfo, Vec<u8>)> {
    struct Sink<'a> {
        bytes: u64,
        hash: Sha256,
        deflate: &'a mut DeflateEncoder<Vec<u8>>,
    }
    impl Write for Sink<'_> {
        fn write(&mut self, text: &[u8]) -> io::Result<usize> {
            self.bytes += text.len() as u64;
            self.hash.update(text);
            self.deflate.write_all(text)?;
            Ok(text.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    let (info, body) = deflating(|deflate| {
        let sink = Sink {
            bytes: 0,
            hash: Sha256::new(),
            deflate,
        };
        // numbers and names come one by one
        let mut sink = BufWriter::with_capacity(AT_ONCE, sink);
        serde_json::to_writer(&mut sink, value)?;
        let sink = sink
            .into_inner()
            .map_err(|error| serde_json::Error::io(error.into_error()))?;
        Ok(PartInfo {
            bytes: sink.bytes,
            digest: sink.hash.finalize().to_vec(),
        })
    });
    Ok((info?, body))
}

/// The number of bytes of JSON that are hashed and deflated at a time.
const AT_ONCE: usize = 16 << 10;

/// The deflated text.
pub(super) fn deflated(text: &[u8]) -> Vec<u8> {
    let (_, body) = deflating(|deflate| deflate.write_all(text));
    body
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use allocator::{forget_highest, held, highest};
    use files::columns::Law;
    use solver::{element::Element, solution::GaussFields};

    use super::*;
    use crate::parts::Part;

    /// A body without load: every number has eight bytes, and four in its JSON.
    fn at_rest() -> Fields {
        let (elements, nodes, points) = (10_000, 40_000, 90_000);
        let zeros = |count: usize| vec![0.0; count];
        Fields {
            x: zeros(nodes),
            y: zeros(nodes),
            ux: zeros(nodes),
            uy: zeros(nodes),
            stress_xx: zeros(nodes),
            stress_yy: zeros(nodes),
            stress_xy: zeros(nodes),
            stress_zz: zeros(nodes),
            contact_state: vec![0; nodes],
            elements: vec![Element::Quad([0, 1, 2, 3, 4, 5, 6, 7]); elements],
            element_error: zeros(elements),
            gauss: GaussFields {
                order: 3,
                x: zeros(points),
                y: zeros(points),
                stress_xx: zeros(points),
                stress_yy: zeros(points),
                stress_xy: zeros(points),
                stress_zz: zeros(points),
            },
        }
    }

    #[test]
    fn fields_are_read_within_the_memory_that_is_reserved_for_it() {
        let fields = at_rest();
        let json = serde_json::to_vec(&fields).unwrap();
        let columns = Part::of_fields(&fields, &Law::default()).unwrap();
        let info = columns.info.clone();
        for (stored, encoding) in [
            (columns.body, Encoding::Columns),
            (deflated(&json), Encoding::Deflated),
            (json, Encoding::Plain),
        ] {
            let size = info.bytes as usize;
            let most = memory_to_read(&stored, stored.len(), encoding, size).unwrap();
            let before = held() - stored.capacity() as i64;
            forget_highest();
            let read = match decoded(stored, encoding, &info).unwrap().1 {
                Decoded::Fields(fields) => *fields,
                Decoded::Json(json) => serde_json::from_slice(&json).unwrap(),
            };
            let took = (highest() - before) as usize;
            assert!(took <= most, "{encoding:?}: {took} of {most} bytes");
            let own = files::fields::memory(&read);
            assert!((size / 2..most).contains(&own), "{encoding:?}: {own} bytes");
            assert_eq!(read, fields);
        }
    }
}
