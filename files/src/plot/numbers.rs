//! The format of numbers in figures.

/// A number for an axis: at most six digits, without trailing zeros, with the minus sign −.
pub(super) fn number(value: f64) -> String {
    digits(value).replace('-', "−")
}

/// A number with three digits: more digits would suggest an accuracy that does not exist.
pub(super) fn rounded(value: f64) -> String {
    let unit = 10f64.powf(value.abs().max(f64::MIN_POSITIVE).log10().floor() - 2.0);
    number((value / unit).round() * unit)
}

/// The number at a tick of an axis. `length`: that of the axis; a rounding error near zero is shown as zero.
pub(super) fn tick(value: f64, length: f64) -> String {
    let small = value.abs() < 1e-9 * length.abs();
    number(if small { 0.0 } else { value })
}

fn digits(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e6).contains(&value.abs()) {
        let text = format!("{value:.3e}");
        let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
        let digits = if digits.contains('.') {
            digits.trim_end_matches('0').trim_end_matches('.')
        } else {
            digits
        };
        return format!("{digits}e{power}");
    }
    let digits = 5 - (value.abs().max(1.0).log10().floor() as usize).min(5);
    let text = format!("{value:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// The smallest product of one of `steps` and a power of ten that is not below a positive number.
pub(super) fn round_up(value: f64, steps: &[f64]) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    let mut rounds = steps.iter().map(|step| step * power);
    // up to rounding above counts as equal
    let fits = rounds.find(|round| *round >= value * (1.0 - 1e-9));
    fits.unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axis_numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (0.1 + 0.2, "0.3"),
            (-11507.26, "−11507.3"),
            (250.0, "250"),
            (1e-9, "1e−9"),
            (2.5e7, "2.5e7"),
        ] {
            assert_eq!(number(value), text);
        }
        assert_eq!(rounded(-186_868.83), "−187000");
        assert_eq!(rounded(0.0), "0");
    }

    #[test]
    fn a_rounding_error_beside_zero_is_shown_as_zero() {
        assert_eq!(tick(1.388e-17, 0.1), "0");
        assert_eq!(tick(1.388e-17, 1e-16), "1.388e−17");
    }

    #[test]
    fn round_numbers_are_one_two_and_five() {
        for (value, round) in [(0.9, 1.0), (1.1, 2.0), (3.0, 5.0), (5.0, 5.0), (7e-4, 1e-3)] {
            assert!((round_up(value, &[1.0, 2.0, 5.0]) - round).abs() < 1e-12 * round);
        }
    }
}
