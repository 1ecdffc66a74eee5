//! Numbers in canonical JSON (RFC 8785), in the form of ECMAScript: the fewest digits that distinguish a number from
//! all others, as `zmij` finds them. The form of `zmij` differs only in the place of the point: ECMAScript writes whole
//! numbers without one, and numbers from 1e-6 and below 1e21 without an exponent.

/// The room for any number, and for copies of a fixed size.
pub(super) const ROOM: usize = 32;

/// Writes a finite number to the start of `out`, and returns its length.
#[inline]
pub(super) fn write(value: f64, out: &mut [u8; ROOM]) -> usize {
    let mut buffer = zmij::Buffer::new();
    let text = buffer.format_finite(value).as_bytes();
    let size = value.abs();
    if (1e-5..1e16).contains(&size) {
        copy(text.strip_suffix(b".0").unwrap_or(text), out)
    } else if size == 0.0 {
        copy(b"0", out)
    } else if (1e-6..1e21).contains(&size) {
        without_exponent(text, out)
    } else {
        copy(text, out)
    }
}

/// Writes a whole number, in a third of the time that [`write`] takes.
#[inline]
pub(super) fn write_whole(value: u32, out: &mut [u8; ROOM]) -> usize {
    let length = value.checked_ilog10().unwrap_or_default() as usize + 1;
    let mut rest = value;
    for place in out[..length].iter_mut().rev() {
        *place = b'0' + (rest % 10) as u8;
        rest /= 10;
    }
    length
}

/// The texts of numbers that occur repeatedly, like coordinates of points on a line or of the integration points of an
/// element.
pub(super) struct Recent(Box<[Written; RECENT]>);

const RECENT: usize = 256;

#[derive(Clone, Copy)]
struct Written {
    bits: u64,
    text: [u8; ROOM],
    length: usize,
}

impl Recent {
    pub(super) fn new() -> Self {
        let zero = Written {
            bits: 0,
            text: [b'0'; ROOM],
            length: 1,
        };
        Recent(Box::new([zero; RECENT]))
    }

    /// As [`write`], using a remembered text if there is one.
    #[inline]
    pub(super) fn write(&mut self, value: f64, out: &mut [u8; ROOM]) -> usize {
        let bits = value.to_bits();
        // the upper bits of this product depend on all bits
        let place = bits.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (u64::BITS - RECENT.ilog2());
        let known = &mut self.0[place as usize];
        if known.bits != bits {
            known.length = write(value, &mut known.text);
            known.bits = bits;
        }
        *out = known.text;
        known.length
    }
}

/// Copies a number in pieces of fixed sizes, which overlap: a call that copies any number of bytes takes as long as
/// finding the digits.
#[inline]
fn copy(text: &[u8], out: &mut [u8; ROOM]) -> usize {
    let length = text.len();
    if let (16..=24, Some(start), Some(end)) =
        (length, text.first_chunk::<16>(), text.last_chunk::<8>())
    {
        out[..16].copy_from_slice(start);
        out[length - 8..length].copy_from_slice(end);
    } else {
        out[..length].copy_from_slice(text);
    }
    length
}

/// Writes a number without its exponent, such as `1.5e-6` and `1.5e+20`.
fn without_exponent(text: &[u8], out: &mut [u8; ROOM]) -> usize {
    let point = |byte: &&u8| **byte != b'.';
    let (sign, number) = match text.strip_prefix(b"-") {
        Some(number) => (&b"-"[..], number),
        None => (&b""[..], text),
    };
    let mut parts = number.split(|byte| *byte == b'e');
    let digits = parts.next().unwrap_or_default().iter().filter(point);
    let exponent = parts.next().unwrap_or_default();
    let exponent = std::str::from_utf8(exponent).ok();
    let exponent: i32 = exponent.and_then(|e| e.parse().ok()).unwrap_or_default();
    let (before, least) = match exponent {
        0.. => (&b""[..], exponent as usize + 1),
        _ => (&b"0.00000"[..], 0),
    };
    let mut length = 0;
    let mut put = |byte: &u8| {
        out[length] = *byte;
        length += 1;
    };
    sign.iter().chain(before).for_each(&mut put);
    let count = digits.clone().count();
    digits.for_each(&mut put);
    (count..least).for_each(|_| put(&b'0'));
    length
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_as_ecmascript(value: f64) {
        if value.is_finite() {
            let mut out = [0; ROOM];
            let length = write(value, &mut out);
            let text = String::from_utf8_lossy(&out[..length]);
            assert_eq!(
                text,
                ryu_js::Buffer::new().format_finite(value),
                "{value:e}"
            );
        }
    }

    #[test]
    fn numbers_of_every_form_are_written_as_ecmascript_does() {
        for value in [
            0.0,
            -0.0,
            1.0,
            -2.5,
            0.1 + 0.2,
            5e-324,
            f64::MAX,
            f64::MIN_POSITIVE,
            2f64.powi(53),
            -123456789012345680000.0,
            -1.2345678901234567e-6,
            -2.2250738585072014e-308,
        ] {
            assert_as_ecmascript(value);
        }
        // the neighbours of all powers of ten, where a form ends
        for exponent in -324..=308 {
            let power: f64 = format!("1e{exponent}").parse().unwrap_or_default();
            for value in [power.next_down(), power, power.next_up(), 3.0 * power] {
                assert_as_ecmascript(value);
                assert_as_ecmascript(-value);
            }
        }
    }

    #[test]
    fn whole_and_repeated_numbers_are_written_as_others_are() {
        let mut random = fastrand::Rng::with_seed(1);
        let (mut recent, mut out, mut same) = (Recent::new(), [0; ROOM], [0; ROOM]);
        for k in 0..100_000 {
            let whole = match k {
                0..20 => 10u32.saturating_pow(k / 2) - k % 2,
                _ => random.u32(..) >> random.u32(..32),
            };
            let length = write(f64::from(whole), &mut out);
            assert_eq!(write_whole(whole, &mut same), length);
            assert_eq!(out[..length], same[..length]);
            // of few values, so that there are old and new ones, and different ones in one place
            let value = f64::from(random.i16(-500..500)) / 8.0;
            let length = write(value, &mut out);
            assert_eq!(recent.write(value, &mut same), length);
            assert_eq!(out[..length], same[..length]);
        }
    }

    #[test]
    fn numbers_of_any_bits_are_written_as_ecmascript_does() {
        let mut random = fastrand::Rng::with_seed(8785);
        for _ in 0..200_000 {
            let bits = random.u64(..);
            assert_as_ecmascript(f64::from_bits(bits));
            // of ordinary size; with few digits; whole; powers of two
            let exponent = random.u64(1023 - 80..1023 + 80);
            assert_as_ecmascript(f64::from_bits(bits & !(0x7ff << 52) | exponent << 52));
            assert_as_ecmascript((bits % 100_000) as f64 / 10f64.powi((bits >> 60) as i32));
            assert_as_ecmascript((bits >> (bits % 64)) as f64);
            assert_as_ecmascript(f64::from_bits(bits >> 52 << 52));
        }
    }
}
