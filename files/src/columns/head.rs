//! The head of stored fields: their sizes, which are checked before memory for decoding is allocated.

use solver::element::Element;

/// The version of the format.
const VERSION: u8 = 1;

/// Numbers for each node, element and integration point, in this order.
type ForEach = [usize; 3];

/// The smallest number of characters of JSON for each node, element and integration point. No number is shorter than
/// `0.0`, and each has a comma or a bracket: eight columns and a contact state for a node; a list of six nodes and an
/// error for an element; six columns for an integration point.
const LEAST_JSON: ForEach = [8 * 4 + 2, 14 + 4, 6 * 4];

/// The largest number of bytes of planes for each node, element and integration point, eight for each number. An
/// element has the number of its nodes, up to eight nodes, error and material.
const MOST_CONTENT: ForEach = [9 * 8, 11 * 8, 6 * 8];

/// The largest number of stored bytes apart from the numbers of nodes, elements and integration points: the law, and
/// marks of planes.
const MOST_BESIDE: usize = 64 << 10;

/// The number of bytes of decoded fields for each node, element and integration point.
const FIELDS: ForEach = [8 * 8 + 1, size_of::<Element>() + 8, 6 * 8];

/// The number of bytes that decoding needs for each node, element and integration point in addition to fields and
/// planes: the order of nodes and the number of elements at each, the elements by columns, differences of a column and
/// their values.
const WORKING: ForEach = [12 + 4 + 16, 48, 16];

/// The number of bytes that decoding needs whatever the sizes: windows of the inflater, and tables of the master
/// elements.
const WORKING_ALWAYS: usize = 256 << 10;

/// The sizes that precede the planes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Head {
    pub(super) nodes: usize,
    pub(super) elements: usize,
    /// The number of integration points.
    pub(super) points: usize,
    /// The number of bytes that are stored unchanged.
    pub(super) random: usize,
    /// The number of bytes that are deflated, before deflation.
    pub(super) stream: usize,
}

impl Head {
    pub(super) fn write(&self, to: &mut Vec<u8>) {
        to.push(VERSION);
        for size in [
            self.nodes,
            self.elements,
            self.points,
            self.random,
            self.stream,
        ] {
            put_size(to, size);
        }
    }

    /// Reads the head; returns it and the remaining bytes.
    pub(super) fn read(bytes: &[u8]) -> Result<(Head, &[u8]), String> {
        let (version, mut rest) = bytes.split_first().ok_or_else(|| damaged("no bytes"))?;
        if *version != VERSION {
            return Err(format!(
                "stored fields are of version {version}, and this program reads version {VERSION}"
            ));
        }
        let mut size = || take_size(&mut rest);
        let head = Head {
            nodes: size()?,
            elements: size()?,
            points: size()?,
            random: size()?,
            stream: size()?,
        };
        Ok((head, rest))
    }

    /// Fails if fields of these sizes need more than `json_bytes` bytes of JSON. Planes of zeros take no stored bytes,
    /// so that only this check limits the memory for decoding: after it, to at most six times `json_bytes`.
    pub(super) fn check(&self, json_bytes: usize) -> Result<(), String> {
        let content = self.random.saturating_add(self.stream);
        let most = self.sum(MOST_CONTENT).saturating_add(MOST_BESIDE);
        if self.sum(LEAST_JSON) > json_bytes || content > most {
            return Err(damaged("sizes larger than the content"));
        }
        if (3 * self.elements..=9 * self.elements).contains(&self.points) {
            Ok(())
        } else {
            Err(damaged("integration points"))
        }
    }

    /// The largest number of bytes that decoding takes, including the fields.
    pub(super) fn memory(&self) -> usize {
        [self.sum(FIELDS), self.sum(WORKING), WORKING_ALWAYS]
            .into_iter()
            .fold(self.stream, usize::saturating_add)
    }

    fn sum(&self, for_each: ForEach) -> usize {
        [self.nodes, self.elements, self.points]
            .iter()
            .zip(for_each)
            .map(|(count, each)| count.saturating_mul(each))
            .fold(0, usize::saturating_add)
    }
}

/// Writes a size, seven bits in each byte.
pub(super) fn put_size(to: &mut Vec<u8>, mut size: usize) {
    while size >= 0x80 {
        to.push(size as u8 | 0x80);
        size >>= 7;
    }
    to.push(size as u8);
}

pub(super) fn take_size(from: &mut &[u8]) -> Result<usize, String> {
    let mut size = 0usize;
    for shift in (0..63).step_by(7) {
        let (byte, rest) = from
            .split_first()
            .ok_or_else(|| damaged("the bytes end early"))?;
        *from = rest;
        size |= usize::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Ok(size);
        }
    }
    Err(damaged("a size"))
}

/// The error for bytes that are not valid stored fields. `what`: what is wrong, in words.
pub(super) fn damaged(what: &str) -> String {
    format!("stored fields are damaged: {what}")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn sizes_of_any_value_come_back() {
        for size in [0, 1, 127, 128, 1 << 40, usize::MAX >> 1] {
            let mut bytes = Vec::new();
            put_size(&mut bytes, size);
            assert_eq!(take_size(&mut bytes.as_slice()), Ok(size));
        }
        assert!(take_size(&mut [0xff; 20].as_slice()).is_err());
    }

    #[test]
    fn memory_is_six_times_the_json_at_most() {
        for [nodes, elements, points] in [
            [1_000_000, 0, 0],
            [0, 1_000_000, 3_000_000],
            [0, 1_000_000, 9_000_000],
            [500_000, 1_000_000, 7_000_000],
        ] {
            let mut head = Head {
                nodes,
                elements,
                points,
                ..Head::default()
            };
            head.stream = head.sum(MOST_CONTENT) + MOST_BESIDE;
            let least = head.sum(LEAST_JSON);
            head.check(least).unwrap();
            assert!(head.check(least - 1).is_err());
            assert!(
                head.memory() <= 6 * least + MOST_BESIDE + WORKING_ALWAYS,
                "{head:?}"
            );
        }
    }

    #[test]
    fn sizes_that_no_fields_have_are_refused() {
        let largest = usize::MAX >> 1;
        let good = Head {
            nodes: 8,
            elements: 1,
            points: 9,
            random: 10,
            stream: 10,
        };
        good.check(1000).unwrap();
        for bad in [
            Head {
                nodes: largest,
                ..good
            },
            Head {
                elements: largest,
                ..good
            },
            Head {
                points: largest,
                ..good
            },
            Head {
                random: largest,
                ..good
            },
            Head {
                stream: largest,
                ..good
            },
            Head { points: 2, ..good },
            Head { points: 10, ..good },
        ] {
            let mut bytes = Vec::new();
            bad.write(&mut bytes);
            assert_eq!(Head::read(&bytes), Ok((bad, &[][..])));
            assert!(bad.check(1000).is_err(), "{bad:?}");
            assert!(bad.memory() >= WORKING_ALWAYS, "{bad:?}");
        }
    }
}
