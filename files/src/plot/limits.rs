//! Limits that a request sets for the axes of a figure.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// The largest number that a limit may be: squares of coordinates stay finite.
const LARGEST: f64 = 1e100;
/// The smallest length of an axis, as a part of its largest value: numbers on a shorter axis could not be told apart.
const SHORTEST: f64 = 1e-6;

/// The limits of an axis: two finite numbers, the smaller first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    low: f64,
    high: f64,
}

impl Limits {
    /// What a text of limits has to be, for errors.
    pub const EXPECTED: &str =
        "two finite numbers, the smaller first, with a comma between them, such as 0,0.5";

    /// The range between the limits.
    pub fn range(self) -> Range<f64> {
        self.low..self.high
    }
}

impl FromStr for Limits {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Vec<f64> = text
            .split(',')
            .filter_map(|number| number.trim().parse().ok())
            .collect();
        let commas = text.matches(',').count();
        match numbers[..] {
            [low, high]
                if commas == 1
                    && low.abs().max(high.abs()) <= LARGEST
                    && high - low >= SHORTEST * low.abs().max(high.abs())
                    && high > low =>
            {
                Ok(Limits { low, high })
            }
            _ => Err(format!("expected {}", Limits::EXPECTED)),
        }
    }
}

impl fmt::Display for Limits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{}", self.low, self.high)
    }
}

/// The limits of the axes of a figure; `None`: the figure chooses them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisLimits {
    /// The limits of the horizontal axis.
    pub x: Option<Limits>,
    /// The limits of the vertical axis; of two panels with different quantities, of the upper one.
    pub y: Option<Limits>,
    /// The limits of the vertical axis of the lower one of two panels with different quantities.
    pub y_below: Option<Limits>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_two_finite_numbers_in_order() {
        for (text, low, high) in [
            ("0,0.5", 0.0, 0.5),
            (" -2e3 , 1", -2000.0, 1.0),
            ("-3,-1", -3.0, -1.0),
        ] {
            let limits: Limits = text.parse().unwrap();
            assert_eq!(limits.range(), low..high);
            assert_eq!(limits.to_string().parse(), Ok(limits));
        }
        for wrong in [
            "",
            "1",
            "1,",
            "1,2,3",
            "1,2,",
            "x,2",
            "2,1",
            "1,1",
            "0,inf",
            "nan,1",
            "0,1e300",
            "1,1.0000000001",
        ] {
            assert!(wrong.parse::<Limits>().is_err(), "{wrong}");
        }
    }
}
