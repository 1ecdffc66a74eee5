//! Deflates small texts and columns, of which a result has many.

use std::cell::RefCell;

use flate2::{Compression, write::DeflateEncoder};

/// The level for large content: a third of the time of the usual one. (Level 1 takes little less and leaves half as much again.)
pub const FAST: Compression = Compression::new(2);

thread_local! {
    /// The compressor of this thread: the system takes longer to give a new one its third of a megabyte than a small part
    /// takes to be deflated. Level 6 is the usual one: 9 takes several times as long for a few per cent.
    static DEFLATE: RefCell<DeflateEncoder<Vec<u8>>> =
        RefCell::new(DeflateEncoder::new(Vec::new(), Compression::new(6)));
}

/// Deflates what `write` writes to memory, which does not fail; also returns what `write` returns.
pub fn deflating<T>(write: impl FnOnce(&mut DeflateEncoder<Vec<u8>>) -> T) -> (T, Vec<u8>) {
    DEFLATE.with_borrow_mut(|deflate| {
        if deflate.total_in() > 0 {
            let _ = deflate.reset(Vec::new()); // a panic has left something
        }
        let written = write(deflate);
        let mut body = deflate.reset(Vec::new()).unwrap_or_default();
        body.shrink_to_fit();
        (written, body)
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::io::{Read, Write};

    use flate2::read::DeflateDecoder;

    use super::*;

    #[test]
    fn what_a_panic_leaves_is_not_a_part_of_the_next_text() {
        let broken = std::panic::catch_unwind(|| {
            deflating(|deflate| -> () {
                deflate.write_all(b"lost").unwrap();
                panic!("a test wants it");
            })
        });
        assert!(broken.is_err());
        for text in ["first", "second", ""] {
            let (written, body) = deflating(|deflate| deflate.write_all(text.as_bytes()));
            written.unwrap();
            let mut read = String::new();
            DeflateDecoder::new(&*body)
                .read_to_string(&mut read)
                .unwrap();
            assert_eq!(read, text);
        }
    }
}
