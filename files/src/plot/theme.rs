//! Colours for light and for dark pages: the colours of Okabe and Ito, which people with any common kind of colour
//! blindness can distinguish. The Python client uses the same colours.

use std::str::FromStr;

use plotters::style::RGBColor;
use strum::IntoStaticStr;

/// The background for which a figure is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum Theme {
    /// A light background, for paper.
    #[default]
    Light,
    /// A dark background, for a dark page or slide.
    Dark,
}

impl FromStr for Theme {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "light" => Ok(Theme::Light),
            "dark" => Ok(Theme::Dark),
            _ => Err("expected light or dark".to_owned()),
        }
    }
}

/// The colours of a theme.
pub(super) struct Palette {
    pub(super) background: RGBColor,
    pub(super) text: RGBColor,
    pub(super) axis: RGBColor,
    pub(super) grid: RGBColor,
    /// The colour of bounds and references, sides of elements, and warnings.
    pub(super) faint: RGBColor,
    /// The colour of the inside of a body without contours.
    pub(super) body: RGBColor,
    pub(super) obstacle: RGBColor,
    pub(super) stick: RGBColor,
    pub(super) slip: RGBColor,
    /// The colour of the verdict good.
    pub(super) good: RGBColor,
    /// The colour of the verdict fair.
    pub(super) fair: RGBColor,
    /// The colour of the verdict poor.
    pub(super) poor: RGBColor,
    /// The colours of curves and boundaries; the first is for normal stress, the second for tangential stress.
    pub(super) curves: [RGBColor; 6],
}

impl Theme {
    pub(super) fn palette(self) -> Palette {
        const STICK: RGBColor = RGBColor(0, 158, 115);
        const SLIP: RGBColor = RGBColor(230, 159, 0);
        const PURPLE: RGBColor = RGBColor(204, 121, 167);
        match self {
            Theme::Light => Palette {
                background: RGBColor(255, 255, 255),
                text: RGBColor(26, 26, 26),
                axis: RGBColor(26, 26, 26),
                grid: RGBColor(224, 224, 224),
                faint: RGBColor(118, 118, 118),
                body: RGBColor(246, 246, 243),
                obstacle: RGBColor(153, 153, 153),
                stick: STICK,
                slip: SLIP,
                good: RGBColor(0, 122, 90),
                fair: RGBColor(153, 105, 0),
                poor: RGBColor(200, 80, 0),
                curves: [
                    RGBColor(0, 114, 178),
                    RGBColor(213, 94, 0),
                    SLIP,
                    STICK,
                    RGBColor(86, 180, 233),
                    PURPLE,
                ],
            },
            Theme::Dark => Palette {
                background: RGBColor(22, 24, 28),
                text: RGBColor(232, 232, 232),
                axis: RGBColor(232, 232, 232),
                grid: RGBColor(60, 64, 71),
                faint: RGBColor(150, 156, 165),
                body: RGBColor(40, 44, 51),
                obstacle: RGBColor(120, 124, 130),
                stick: STICK,
                slip: SLIP,
                good: STICK,
                fair: RGBColor(240, 192, 90),
                poor: RGBColor(255, 138, 61),
                curves: [
                    RGBColor(86, 180, 233),
                    RGBColor(255, 138, 61),
                    RGBColor(240, 228, 66),
                    STICK,
                    RGBColor(185, 215, 245),
                    PURPLE,
                ],
            },
        }
    }
}

/// A map from numbers to colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColourMap {
    /// Cividis, for values ≥ 0: even steps for the eye, also in grey and with colour blindness.
    Rising,
    /// From orange through white to purple (ColorBrewer's PuOr), for values of either sign.
    Signed,
}

impl ColourMap {
    /// The colour of the map at t, from 0 to 1.
    pub(super) fn at(self, t: f64) -> RGBColor {
        const RISING: [[u8; 3]; 9] = [
            [0, 34, 78],
            [26, 56, 111],
            [67, 78, 108],
            [97, 101, 111],
            [125, 124, 120],
            [155, 148, 118],
            [188, 174, 108],
            [222, 201, 88],
            [254, 232, 56],
        ];
        const SIGNED: [[u8; 3]; 9] = [
            [127, 59, 8],
            [190, 99, 10],
            [239, 158, 60],
            [254, 215, 162],
            [246, 246, 247],
            [206, 205, 228],
            [152, 141, 190],
            [93, 55, 144],
            [45, 0, 75],
        ];
        let stops = match self {
            ColourMap::Rising => RISING,
            ColourMap::Signed => SIGNED,
        };
        let place = t.clamp(0.0, 1.0) * (stops.len() - 1) as f64;
        let k = (place as usize).min(stops.len() - 2);
        let part = place - k as f64;
        let mix = |c: usize| {
            let (low, high) = (f64::from(stops[k][c]), f64::from(stops[k + 1][c]));
            (low + part * (high - low)).round() as u8
        };
        RGBColor(mix(0), mix(1), mix(2))
    }
}

/// The colour as hexadecimal digits, as in SVG.
pub(super) fn hex(RGBColor(r, g, b): RGBColor) -> String {
    format!("#{r:02X}{g:02X}{b:02X}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The matrices for the colours that people with a kind of colour blindness see, in linear light: Machado, Oliveira
    /// and Fernandes 2009, table 1, severity 1.
    #[rustfmt::skip]
    const SEEN: [(&str, [[f64; 3]; 3]); 4] = [
        ("all colours", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        ("protanopia", [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]),
        ("deuteranopia", [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]),
        ("tritanopia", [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]),
    ];

    fn linear(RGBColor(r, g, b): RGBColor) -> [f64; 3] {
        [r, g, b].map(|c| {
            let c = f64::from(c) / 255.0;
            if c <= 0.04045 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            }
        })
    }

    fn times(matrix: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|i| (0..3).map(|k| matrix[i][k] * v[k]).sum())
    }

    /// The CIE L*a*b* values of linear light, with the white of D65.
    fn lab(rgb: [f64; 3]) -> [f64; 3] {
        const TO_XYZ: [[f64; 3]; 3] = [
            [0.4124, 0.3576, 0.1805],
            [0.2126, 0.7152, 0.0722],
            [0.0193, 0.1192, 0.9505],
        ];
        let xyz = times(&TO_XYZ, rgb.map(|c| c.clamp(0.0, 1.0)));
        let [x, y, z] = [xyz[0] / 0.9505, xyz[1], xyz[2] / 1.089].map(|t| {
            if t > 0.008856 {
                t.cbrt()
            } else {
                7.787 * t + 16.0 / 116.0
            }
        });
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    fn difference(a: RGBColor, b: RGBColor, seen: &[[f64; 3]; 3]) -> f64 {
        let [a, b] = [a, b].map(|c| lab(times(seen, linear(c))));
        (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
    }

    /// The contrast of two colours as WCAG 2 defines it.
    fn contrast(a: RGBColor, b: RGBColor) -> f64 {
        let light = |c| {
            let [r, g, b] = linear(c);
            0.2126 * r + 0.7152 * g + 0.0722 * b + 0.05
        };
        let (a, b): (f64, f64) = (light(a), light(b));
        a.max(b) / a.min(b)
    }

    #[test]
    fn colours_are_distinguishable_with_every_kind_of_colour_blindness() {
        for theme in [Theme::Light, Theme::Dark] {
            let palette = theme.palette();
            for (kind, seen) in &SEEN {
                for (i, &a) in palette.curves.iter().enumerate() {
                    for &b in &palette.curves[..i] {
                        let far = difference(a, b, seen);
                        // 2.3 is just noticeable side by side; thin lines apart from one another need several times that
                        assert!(far > 10.0, "{theme:?}, {kind}: {a:?} and {b:?}: {far:.1}");
                    }
                    let far = difference(a, palette.background, seen);
                    assert!(far > 20.0, "{theme:?}, {kind}: {a:?}: {far:.1}");
                }
                let far = difference(palette.stick, palette.slip, seen);
                assert!(far > 20.0, "{theme:?}, {kind}: stick and slip: {far:.1}");
            }
        }
    }

    #[test]
    fn letters_are_readable_on_their_background() {
        for theme in [Theme::Light, Theme::Dark] {
            let palette = theme.palette();
            let Palette {
                text,
                faint,
                good,
                fair,
                poor,
                ..
            } = palette;
            for letters in [text, faint, good, fair, poor] {
                let found = contrast(letters, palette.background);
                assert!(found >= 4.5, "{theme:?}: {letters:?}: {found:.2}");
            }
        }
    }

    #[test]
    fn the_steps_of_cividis_become_lighter_however_they_are_seen() {
        for (kind, seen) in &SEEN {
            let lightness =
                |k: usize| lab(times(seen, linear(ColourMap::Rising.at(k as f64 / 13.0))))[0];
            for k in 1..=13 {
                assert!(lightness(k) > lightness(k - 1) + 2.0, "{kind}: step {k}");
            }
        }
    }
}
