//! Columns of numbers as differences from predictions. The bytes of the differences are stored plane by plane.
//!
//! The first plane has the lowest byte of every difference, the second plane the second byte, and so on. Planes that
//! look random are stored unchanged. The others are deflated together in one stream, because small results have many
//! short columns.

use std::io::{Read, Write};

use flate2::{read::DeflateDecoder, write::DeflateEncoder};

use crate::deflate::{FAST, deflating};

use super::{
    head::{Head, damaged, put_size, take_size},
    order::NodeOrder,
};

/// The mark of a plane that has zeros only and is not stored.
const ZEROS: u8 = 0;
/// The mark of a plane whose bytes look random and are stored unchanged.
const RANDOM: u8 = 1;
/// The mark of a plane whose bytes are deflated.
const DEFLATED: u8 = 2;

/// The mark of a column whose values are predicted by the given predictions.
const AS_PREDICTED: u8 = 0;
/// The mark of a column whose values are each predicted by the value before.
const AS_BEFORE: u8 = 1;

/// A plane whose bytes have at least this many bits of information is stored unchanged: deflating it gains less than a
/// tenth.
const RANDOM_BITS: f64 = 7.2;

/// The size of a stream (bytes) above which it is deflated fast rather than to the smallest size.
const LARGE: usize = 1 << 20;

/// Writes columns as bytes.
pub(super) struct Writer {
    random: Vec<u8>,
    /// The data to be deflated: sizes, numbers, marks of planes, and planes.
    stream: Vec<u8>,
}

impl Writer {
    pub(super) fn new() -> Writer {
        Writer {
            random: Vec::new(),
            stream: Vec::new(),
        }
    }

    /// Writes a size.
    pub(super) fn size(&mut self, size: usize) {
        put_size(&mut self.stream, size);
    }

    /// Writes a number unchanged.
    pub(super) fn number(&mut self, number: f64) {
        self.stream.extend(number.to_le_bytes());
    }

    /// Writes whole numbers, each predicted by the number before it.
    pub(super) fn whole(&mut self, values: impl Iterator<Item = i64> + Clone) {
        let before = std::iter::once(0).chain(values.clone());
        let differences: Vec<u64> = values
            .zip(before)
            .map(|(value, before)| folded(value.wrapping_sub(before)))
            .collect();
        self.planes(&differences);
    }

    /// Writes numbers, each predicted by the number before it.
    pub(super) fn sequence(&mut self, values: &[f64]) {
        let differences = differences_in_sequence(values);
        self.planes(&differences);
    }

    /// Writes numbers at nodes, predicted from numbers at other nodes.
    pub(super) fn nodal(&mut self, values: &[f64], order: &NodeOrder) {
        let difference =
            |place| difference(values[order.node(place)], order.predict(place, values));
        let differences: Vec<u64> = (0..order.len()).map(difference).collect();
        self.planes(&differences);
    }

    /// Writes numbers with the given predictions, or each predicted by the number before it if that is closer.
    pub(super) fn predicted(&mut self, values: &[f64], predicted: &[f64]) {
        let pairs = values.iter().zip(predicted);
        let own: Vec<u64> = pairs.map(|(v, p)| difference(*v, *p)).collect();
        let in_sequence = differences_in_sequence(values);
        let bits = |differences: &[u64]| -> u64 {
            let bits = |difference: &u64| u64::from(64 - difference.leading_zeros());
            differences.iter().map(bits).sum()
        };
        let (kind, nearer) = if bits(&own) <= bits(&in_sequence) {
            (AS_PREDICTED, own)
        } else {
            (AS_BEFORE, in_sequence)
        };
        self.stream.push(kind);
        self.planes(&nearer);
    }

    fn planes(&mut self, differences: &[u64]) {
        for byte in 0..8 {
            let plane = differences.iter().map(|d| (d >> (8 * byte)) as u8);
            let mut counts = [0u32; 256];
            plane
                .clone()
                .for_each(|byte| counts[usize::from(byte)] += 1);
            let (kind, to) = match bits_of_information(&counts, differences.len()) {
                _ if counts[0] as usize == differences.len() => (ZEROS, None),
                bits if bits > RANDOM_BITS.min(most_bits(differences.len())) => {
                    (RANDOM, Some(&mut self.random))
                }
                _ => (DEFLATED, None),
            };
            self.stream.push(kind);
            match (kind, to) {
                (ZEROS, _) => {}
                (_, Some(random)) => random.extend(plane),
                (_, None) => self.stream.extend(plane),
            }
        }
    }

    /// Returns the written bytes, after the head of fields with these numbers of nodes, elements and integration
    /// points.
    pub(super) fn finish(self, [nodes, elements, points]: [usize; 3]) -> Vec<u8> {
        let head = Head {
            nodes,
            elements,
            points,
            random: self.random.len(),
            stream: self.stream.len(),
        };
        let mut out = Vec::new();
        head.write(&mut out);
        out.extend(&self.random);
        if self.stream.len() > LARGE {
            let mut deflate = DeflateEncoder::new(out, FAST);
            // writing to memory does not fail
            let _ = deflate.write_all(&self.stream);
            return deflate.finish().unwrap_or_default();
        }
        let (_, deflated) = deflating(|deflate| deflate.write_all(&self.stream));
        out.extend(deflated);
        out
    }
}

/// Reads columns from bytes.
pub(super) struct Reader<'a> {
    random: &'a [u8],
    stream: Vec<u8>,
    at_random: usize,
    at: usize,
}

impl Reader<'_> {
    /// Reads the bytes that follow a checked head.
    pub(super) fn new<'a>(head: &Head, bytes: &'a [u8]) -> Result<Reader<'a>, String> {
        let (random, deflated) = bytes
            .split_at_checked(head.random)
            .ok_or_else(|| damaged("length"))?;
        let mut stream = Vec::with_capacity(head.stream);
        let inflated = DeflateDecoder::new(deflated)
            .take(head.stream as u64)
            .read_to_end(&mut stream);
        match inflated {
            Ok(all) if all == head.stream => Ok(Reader {
                random,
                stream,
                at_random: 0,
                at: 0,
            }),
            Ok(_) => Err(damaged("some bytes are missing")),
            Err(error) => Err(damaged(&error.to_string())),
        }
    }

    fn take(&mut self, count: usize) -> Result<&[u8], String> {
        take(&self.stream, &mut self.at, count)
    }

    pub(super) fn size(&mut self) -> Result<usize, String> {
        let mut rest = self.stream.get(self.at..).unwrap_or_default();
        let before = rest.len();
        let size = take_size(&mut rest)?;
        self.at += before - rest.len();
        Ok(size)
    }

    pub(super) fn number(&mut self) -> Result<f64, String> {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(self.take(8)?);
        Ok(f64::from_le_bytes(bytes))
    }

    pub(super) fn whole<T: TryFrom<i64>>(&mut self, count: usize) -> Result<Vec<T>, String> {
        let mut before = 0i64;
        let value = |difference| {
            before = before.wrapping_add(unfolded(difference));
            T::try_from(before).map_err(|_| damaged("a whole number"))
        };
        self.planes(count)?.into_iter().map(value).collect()
    }

    pub(super) fn sequence(&mut self, count: usize) -> Result<Vec<f64>, String> {
        let mut before = 0.0;
        let value = |difference| {
            before = moved(before, difference);
            before
        };
        Ok(self.planes(count)?.into_iter().map(value).collect())
    }

    pub(super) fn nodal(&mut self, order: &NodeOrder) -> Result<Vec<f64>, String> {
        let differences = self.planes(order.len())?;
        let mut values = vec![0.0; order.len()];
        for (place, difference) in differences.into_iter().enumerate() {
            values[order.node(place)] = moved(order.predict(place, &values), difference);
        }
        Ok(values)
    }

    pub(super) fn predicted(&mut self, mut predicted: Vec<f64>) -> Result<Vec<f64>, String> {
        match self.take(1)?[0] {
            AS_PREDICTED => {
                let differences = self.planes(predicted.len())?;
                for (value, difference) in predicted.iter_mut().zip(differences) {
                    *value = moved(*value, difference);
                }
                Ok(predicted)
            }
            AS_BEFORE => self.sequence(predicted.len()),
            _ => Err(damaged("an unknown prediction")),
        }
    }

    fn planes(&mut self, count: usize) -> Result<Vec<u64>, String> {
        let mut differences = vec![0u64; count];
        let Reader {
            random,
            stream,
            at_random,
            at,
        } = self;
        for byte in 0..8 {
            let plane = match take(stream, at, 1)?[0] {
                ZEROS => continue,
                RANDOM => take(random, at_random, count)?,
                DEFLATED => take(stream, at, count)?,
                _ => return Err(damaged("an unknown plane")),
            };
            for (difference, part) in differences.iter_mut().zip(plane) {
                *difference |= u64::from(*part) << (8 * byte);
            }
        }
        Ok(differences)
    }

    /// Fails unless all bytes were read.
    pub(super) fn finish(self) -> Result<(), String> {
        if (self.at, self.at_random) == (self.stream.len(), self.random.len()) {
            Ok(())
        } else {
            Err(damaged("there are more bytes than the fields need"))
        }
    }
}

fn take<'a>(from: &'a [u8], at: &mut usize, count: usize) -> Result<&'a [u8], String> {
    let end = at.saturating_add(count);
    let taken = from
        .get(*at..end)
        .ok_or_else(|| damaged("the bytes end early"))?;
    *at = end;
    Ok(taken)
}

fn differences_in_sequence(values: &[f64]) -> Vec<u64> {
    let before = std::iter::once(&0.0).chain(values);
    let pairs = values.iter().zip(before);
    pairs
        .map(|(value, before)| difference(*value, *before))
        .collect()
}

/// How many floating-point numbers a value lies above or below a prediction, as a number without sign.
fn difference(value: f64, predicted: f64) -> u64 {
    folded(rank(value).wrapping_sub(rank(finite(predicted))))
}

/// The floating-point number with this [`difference`] from a prediction.
fn moved(predicted: f64, difference: u64) -> f64 {
    ranked(rank(finite(predicted)).wrapping_add(unfolded(difference)))
}

/// The prediction, or 0 in place of NaN, since the bits of a computed NaN differ between machines.
fn finite(predicted: f64) -> f64 {
    if predicted.is_nan() { 0.0 } else { predicted }
}

/// The place of a number in the order of all floating-point numbers.
fn rank(value: f64) -> i64 {
    let bits = value.to_bits() as i64;
    bits ^ (((bits >> 63) as u64) >> 1) as i64
}

fn ranked(rank: i64) -> f64 {
    f64::from_bits((rank ^ (((rank >> 63) as u64) >> 1) as i64) as u64)
}

/// Maps small numbers of both signs to small numbers without sign.
fn folded(value: i64) -> u64 {
    ((value << 1) ^ (value >> 63)) as u64
}

fn unfolded(value: u64) -> i64 {
    (value >> 1) as i64 ^ -((value & 1) as i64)
}

/// The mean information (bits) of a byte, where `counts` says how often each byte occurs among `total` bytes.
fn bits_of_information(counts: &[u32; 256], total: usize) -> f64 {
    let total = total as f64;
    let bits = |count: &u32| match f64::from(*count) / total {
        part if part > 0.0 => -part * part.log2(),
        _ => 0.0,
    };
    counts.iter().map(bits).sum()
}

/// Approximately the mean information (bits) of a byte among `count` random bytes, if they are few.
fn most_bits(count: usize) -> f64 {
    0.9 * (count as f64).log2()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_order_as_ranks_and_come_back_whatever_they_are() {
        let numbers = [
            f64::NEG_INFINITY,
            -1e300,
            -1.0,
            -5e-324,
            -0.0,
            0.0,
            5e-324,
            1.0,
            1e300,
            f64::INFINITY,
        ];
        for pair in numbers.windows(2) {
            assert!(rank(pair[0]) < rank(pair[1]), "{pair:?}");
        }
        for value in numbers.into_iter().chain([f64::NAN, -f64::NAN]) {
            for predicted in numbers.into_iter().chain([f64::NAN]) {
                let back = moved(predicted, difference(value, predicted));
                assert_eq!(back.to_bits(), value.to_bits());
            }
        }
    }

    #[test]
    fn differences_of_any_value_come_back() {
        for value in [0, 1, -1, i64::MAX, i64::MIN] {
            assert_eq!(unfolded(folded(value)), value);
        }
    }
}
